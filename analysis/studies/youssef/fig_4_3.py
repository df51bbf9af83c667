"""Fig 4.3: first harmonic of the slider over the speed, without damping, for three inertias of the rocker.

The thesis balances two harmonics of its linear equation (4.21), eqs (4.30)-(4.35). The amplitude grows without bound where
the determinant vanishes, its resonance. As printed the equation leaves out M' zeta', and its resonances are too low; those
of the thesis's code are lower still, because of coefficients that we have no record of. The captions are lost: that the
first harmonic without damping stands under this number is our assignment.
"""

from __future__ import annotations

import numpy as np

from linkwork.five_bar.published import chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...youssef import Variant, resonance
from ..study import ASSIGNED, OURS, TEXT, Study, StudyResult, near
from ._chapter_4 import INERTIA_RATIOS, harmonic

NUMBER = "4.3"
#: Resonance (rad/s) by I4: of the thesis's code, and right.
RESONANCES = {0.5: (31.0763, 31.0975), 1.0: (30.5572, 30.5979), 1.5: (30.0645, 30.1220)}
SPEEDS = np.unique(
    np.concatenate(
        [
            np.arange(29.0, 32.51, 0.02),
            *(np.arange(right - 0.05, right + 0.05, 0.002) for _, right in RESONANCES.values()),
        ]
    )
)


def compute() -> StudyResult:
    """First harmonic over the speed by the right equation and by the printed one."""
    columns = {"speed [rad/s]": SPEEDS}
    verdicts = []
    for ratio in INERTIA_RATIOS:
        for variant, label in ((Variant.EXACT, "right"), (Variant.PRINTED, "printed")):
            columns[f"first harmonic of zeta at I4 = {ratio:g}; {label} [1]"] = harmonic(1, SPEEDS, ratio, 0.0, variant)
        right = columns[f"first harmonic of zeta at I4 = {ratio:g}; right [1]"]
        thesis, reference = RESONANCES[ratio]
        lower, upper = resonance(chapter_4(ratio))
        # the determinant vanishes twice, at speeds of which the curve's samples may miss one
        peak = SPEEDS[np.argmax(right)]
        verdicts += [
            near(f"resonance; I4 = {ratio:g}", TEXT, thesis, lower, 5.1e-5, "rad/s"),
            near(f"resonance; I4 = {ratio:g}", OURS, reference, lower, 5.1e-5, "rad/s"),
            near(
                f"greatest amplitude relative to the resonance; I4 = {ratio:g}",
                OURS,
                1.0,
                peak / (0.5 * (lower + upper)),
                0.5 * (upper - lower) / lower + 1e-4,
            ),
        ]
    return StudyResult(
        number=NUMBER,
        claim="Balance of two harmonics without damping: resonance at 31.076, 30.557 and 30.065 rad/s.",
        assignment=ASSIGNED,
        columns=columns,
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The right curves, and those for I4 = 1 next to the resonance beside the thesis's."""
    curves = [
        Curve(
            x=SPEEDS, y=result.columns[f"first harmonic of zeta at I4 = {ratio:g}; right [1]"], label=f"I4 = {ratio:g}"
        )
        for ratio in INERTIA_RATIOS
    ]
    close = [
        Curve(
            x=SPEEDS,
            y=result.columns[f"first harmonic of zeta at I4 = 1; {label} [1]"],
            label=f"I4 = 1, {label}",
            colour=COLOURS[1],
            line=line,
        )
        for label, line in (("right", "-"), ("printed", "--"))
    ]
    thesis, _ = RESONANCES[1.0]
    panels = [
        Panel(
            x_label="crank speed [rad/s]",
            y_label="first harmonic of u, relative to l4",
            curves=shown,
            verticals=verticals,
            logarithmic="y",
            legend_at="outside",
            x_range=x_range,
            y_range=y_range,
        )
        for shown, verticals, x_range, y_range in (
            (curves, None, (29.0, 32.5), (0.03, 20.0)),
            (close, {f"thesis's code, {thesis:.2f}": thesis}, (30.4, 30.8), (0.2, 60.0)),
        )
    ]
    return plot_curves(panels, title=result.heading)


STUDY = Study(NUMBER, compute, draw)
