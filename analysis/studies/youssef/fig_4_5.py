"""Fig 4.5: first and second harmonic of the slider near half the natural frequency; I4 = 1.

The second harmonic resonates there. What makes it is the second harmonic of the force, a term of second order in l2/l4: an
equation of first order has it more than twenty times too small. The thesis's code has it about seven times too small.
The errors of it that we know, M' zeta' left out and first-order terms halved, change it by two per cent, so that its
second-order force must be wrong; the formula is lost. The captions are lost: that the harmonics near half the natural
frequency stand under this number is our assignment.
"""

from __future__ import annotations

import numpy as np

from linkwork.five_bar.published import chapter_4

from ...figures import Curve, Figure, Panel, plot_curves
from ...youssef import Variant, resonance
from ..study import ASSIGNED, OURS, Study, StudyResult, at_least, at_most, near
from ._chapter_4 import harmonic, name, true_harmonic

NUMBER = "4.5"
INERTIA_RATIO = 1.0
#: omega_c = mu/(m4 + m5) (1/s), which removes the unstable region according to the thesis.
OMEGA_C = 0.45
SPEEDS = np.arange(14.0, 16.81, 0.02)
VARIANTS = (Variant.EXACT, Variant.PRINTED, Variant.FIRST_ORDER, Variant.FORTRAN)
#: How many times too small the thesis's second harmonic is, "about".
TOO_SMALL = 7.0


def compute() -> StudyResult:
    """Both harmonics over the speed, of the plant and by the variants of the equation."""
    columns = {"speed [rad/s]": SPEEDS}
    for n, word in ((1, "first"), (2, "second")):
        columns[f"{word} harmonic of zeta; plant [1]"] = true_harmonic(n, SPEEDS.tolist(), INERTIA_RATIO, OMEGA_C)
        for variant in VARIANTS:
            columns[f"{word} harmonic of zeta; {name(variant)} [1]"] = harmonic(
                n, SPEEDS, INERTIA_RATIO, OMEGA_C, variant
            )
    right = columns["second harmonic of zeta; plant [1]"].max()
    greatest = {v: harmonic(2, SPEEDS, INERTIA_RATIO, OMEGA_C, v).max() for v in VARIANTS}
    lower, _ = resonance(chapter_4(INERTIA_RATIO), harmonic=2)
    return StudyResult(
        number=NUMBER,
        claim="The second harmonic resonates near half the natural frequency; the thesis's is about seven times too small.",
        assignment=ASSIGNED,
        columns=columns,
        verdicts=(
            near("second harmonic by two harmonics to the plant's", OURS, 1.0, greatest[Variant.EXACT] / right, 0.005),
            at_least(
                "plant's second harmonic to that of first-order coefficients",
                OURS,
                TOO_SMALL,
                right / greatest[Variant.FIRST_ORDER],
            ),
            at_most(
                "plant's second harmonic to that of the FORTRAN as far as known",
                OURS,
                TOO_SMALL,
                right / greatest[Variant.FORTRAN],
            ),
            near(
                "speed of the greatest second harmonic",
                OURS,
                lower,
                SPEEDS[np.argmax(columns["second harmonic of zeta; plant [1]"])],
                0.02,
                "rad/s",
            ),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """One panel per harmonic."""
    lower, _ = resonance(chapter_4(INERTIA_RATIO), harmonic=2)
    panels = [
        Panel(
            x_label="crank speed [rad/s]",
            y_label=f"{word} harmonic of u, relative to l4",
            curves=[
                *(
                    Curve(
                        x=SPEEDS, y=result.columns[f"{word} harmonic of zeta; {name(variant)} [1]"], label=name(variant)
                    )
                    for variant in VARIANTS
                ),
                Curve(
                    x=SPEEDS,
                    y=result.columns[f"{word} harmonic of zeta; plant [1]"],
                    label="plant",
                    colour="black",
                    line=":",
                ),
            ],
            verticals={f"resonance, {lower:.2f}": lower},
            logarithmic="y" if word == "second" else "",
            legend_at="outside",
            x_range=(14.0, 16.8),
            y_range=(0.0, 3.5e-3) if word == "first" else (1e-5, 0.5),
        )
        for word in ("first", "second")
    ]
    return plot_curves(panels, title=result.heading)


STUDY = Study(NUMBER, compute, draw)
