"""Plot the response before and after tuning, with the range of speeds to be kept clear."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from ..periodic import parameter_unit
from ..tuning import Survey, Tuned
from ..units import RAD_S_PER_RPM, display_scale
from .curves import Curve, Panel, Shade, plot_curves
from .dispatch import plot
from .style import COLOURS, LINE, name_in_words

#: Greatest Floquet multiplier on the axis.
_GREATEST = 2.0


@plot.register
def plot_tuned(tuned: Tuned, *, title: str = "") -> Figure:
    """Plot amplitude and largest Floquet multiplier over the speed before and after the change, unstable motions dashed."""
    orbit = tuned.after.response.branches[0].orbits[0]
    family = tuned.after.response.family
    scale, of_x = (RAD_S_PER_RPM, "rpm") if family.unit == "rad/s" else (1.0, family.unit)
    low, high = (level / scale for level in tuned.wish.span)
    span = [level / scale for level in (tuned.after.response.low, tuned.after.response.high)]
    branches = [branch for survey in (tuned.before, tuned.after) for branch in survey.response.branches]
    cut = max(float(branch.largest_multiplier.max()) for branch in branches) > _GREATEST
    amplitudes = []
    for n, (what, si) in enumerate(orbit.flow.components[: orbit.flow.swing_count]):
        unit, factor = display_scale(si)
        label = f"amplitude of {name_in_words(what)} [{unit}]"
        amplitudes.append((label, lambda b, n=n, factor=factor: factor * b.amplitudes[:, n]))
    label = "largest Floquet multiplier,\nunstable above 1" + (f" (cut at {_GREATEST:g})" if cut else "")
    rows = (*amplitudes, (label, lambda b: np.minimum(b.largest_multiplier, _GREATEST)))
    panels = []
    for number, (label, value) in enumerate(rows):
        curves: list[Curve] = []
        # the curve after the change is thinner and above the one before, so that equal curves are both visible
        for colour, width, when, survey in (
            (COLOURS[1], 2.5 * LINE, "" if number else "before", tuned.before),
            (COLOURS[0], LINE, "" if number else "after", tuned.after),
        ):
            curves += _curves(survey, value, colour, width, when, scale)
        if number == len(amplitudes):
            curves.append(Curve(x=span, y=[1.0, 1.0], colour="0.6", line=":"))
        panels.append(
            Panel(
                x_label=f"{name_in_words(family.name)} [{of_x}]",
                y_label=label,
                curves=curves,
                shades=[Shade(low=low, high=high, label="" if number else "range to be kept clear")],
                x_range=(span[0], span[1]),
                y_range=_view_range(curves),
                legend_at="above",
            )
        )
    changed = [
        f"{name_in_words(name)} {scaled * before:.5g} to {scaled * after:.5g} {quantity}"
        for name, before, after in zip(tuned.wish.names, tuned.wish.present, tuned.values)
        for quantity, scaled in [display_scale(parameter_unit(tuned.wish.mechanism, name))]
    ]
    return plot_curves(
        panels, title=title, notes=[f"Changed: {', '.join(changed)}.", "Dashed: unstable.", *tuned.missed]
    )


def _view_range(curves: Sequence[Curve]) -> tuple[float, float]:
    """Return the range of the y axis: the range of the curves with a margin, or from zero if the least value is near zero."""
    y = np.concatenate([np.asarray(curve.y, dtype=float) for curve in curves])
    low, high = float(np.nanmin(y)), float(np.nanmax(y))
    rim = 0.08 * (high - low) or 0.05 * abs(high) or 1.0
    return (0.0 if 0.0 <= low < 0.3 * high else low - rim), high + rim


def _curves(survey: Survey, value: object, colour: str, width: float, name: str, scale: float) -> Iterator[Curve]:
    """Yield the curves of a quantity along the branches of a response, stable parts solid, unstable ones dashed.

    ``value`` computes the quantity from a branch; only the first curve has the ``name`` in the legend. ``scale`` is the size of
    the x axis's unit in SI.
    """
    for branch in survey.response.branches:
        stable = branch.largest_multiplier <= 1.0
        for part, line in ((stable, "-"), (~stable, "--")):
            if not part.any():
                continue
            # unstable parts are extended to the neighbouring stable points
            wide = part | np.append(part[1:], False) | np.insert(part[:-1], 0, False) if line == "--" else part
            y = np.where(wide, value(branch), np.nan)  # type: ignore[operator]
            yield Curve(x=branch.parameter / scale, y=y, colour=colour, line=line, label=name, width=width)
            name = ""
