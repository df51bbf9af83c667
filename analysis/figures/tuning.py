"""The response before and after parameters were tuned, with the range of speeds that was to be kept free."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from ..tuning import Survey, Tuned
from ..units import RAD_S_PER_RPM, display_of
from .curves import Curve, Panel, plot_curves
from .dispatch import plot
from .style import COLOURS


@plot.register
def plot_tuned(tuned: Tuned, *, title: str = "") -> Figure:
    """Plot amplitude and largest Floquet multiplier over the speed before and after the change, unstable motions dashed."""
    orbit = tuned.after.response.branches[0].orbits[0]
    what, si = orbit.swing
    unit, factor = display_of(si)
    family = tuned.after.response.family
    name, scale, of_x = (
        ("crank speed", RAD_S_PER_RPM, "rpm") if family.unit == "rad/s" else (family.name, 1.0, family.unit)
    )
    low, high = (level / scale for level in tuned.wish.span)
    span = [level / scale for level in (tuned.after.response.low, tuned.after.response.high)]
    top = 1.1 * max(factor * float(b.amplitude.max()) for s in (tuned.before, tuned.after) for b in s.response.branches)
    greatest = max(1.05, min(2.0, 1.1 * max(tuned.before.largest[0], tuned.after.largest[0])))
    rows = (
        (f"amplitude of {what} [{unit}]", top, lambda b: factor * b.amplitude),
        ("largest Floquet multiplier", greatest, lambda b: b.largest_multiplier),
    )
    panels = []
    for number, (label, highest, value) in enumerate(rows):
        curves: list[Curve] = []
        for colour, when, survey in ((COLOURS[1], "before", tuned.before), (COLOURS[0], "after", tuned.after)):
            curves += _curves(survey, value, colour, "" if number else when, scale)
        if number:
            curves.append(Curve(x=span, y=[1.0, 1.0], colour="0.6", line=":"))
        box = np.array([[low, 0.0], [high, 0.0], [high, highest], [low, highest]])
        panels.append(
            Panel(
                x_label=f"{name} [{of_x}]",
                y_label=label,
                curves=curves,
                filled=[[box]],
                x_range=(span[0], span[1]),
                y_range=(0.0, highest),
            )
        )
    note = "Shaded: the range of the wish. Dashed: unstable."
    return plot_curves(panels, title=title, notes=[note, *tuned.missed])


def _curves(survey: Survey, value: object, colour: str, name: str, scale: float) -> Iterator[Curve]:
    """Plot branches of the response, stable parts solid; only the first has a name."""
    for branch in survey.response.branches:
        stable = branch.largest_multiplier <= 1.0
        for part, line in ((stable, "-"), (~stable, "--")):
            if not part.any():
                continue
            # a part reaches to the first point of the next
            wide = part | np.append(part[1:], False) if line == "--" else part
            y = np.where(wide, value(branch), np.nan)  # type: ignore[operator]
            yield Curve(x=branch.parameter / scale, y=y, colour=colour, line=line, label=name)
            name = ""
