"""Fig 4.4: first harmonic of the slider over the speed with dampers; I4 = 1.

At the resonance the damper alone balances the first harmonic of the force, so that the amplitude is nearly F1/lambda_c with
lambda_c = mu/((m4 + m5) omega). The linear equation keeps to this whatever the amplitude; the plant does too up to a fifth
of the rocker's length. The captions are lost: that damping stands under this number is our assignment.
"""

from __future__ import annotations

import numpy as np

from linkwork.five_bar.published import chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...youssef import slider_equation
from ..study import ASSIGNED, OURS, Study, StudyResult, near
from ._chapter_4 import harmonic, true_harmonic

NUMBER = "4.4"
INERTIA_RATIO = 1.0
#: omega_c = mu/(m4 + m5) (1/s).
DAMPINGS = (1.0, 2.0, 4.0, 8.0)
SPEEDS = np.arange(26.0, 35.01, 0.1)


def compute() -> StudyResult:
    """First harmonic over the speed for each damper, by the right linear equation and by the plant."""
    columns = {"speed [rad/s]": SPEEDS}
    verdicts = []
    for omega_c in DAMPINGS:
        by_two = harmonic(1, SPEEDS, INERTIA_RATIO, omega_c)
        true = true_harmonic(1, SPEEDS.tolist(), INERTIA_RATIO, omega_c)
        columns[f"first harmonic of zeta at omega_c = {omega_c:g} 1/s; linear [1]"] = by_two
        columns[f"first harmonic of zeta at omega_c = {omega_c:g} 1/s; plant [1]"] = true
        peak = int(np.argmax(by_two))
        equation = slider_equation(chapter_4(INERTIA_RATIO, omega_c), float(SPEEDS[peak]))
        alone = equation.force.amplitudes[1] / equation.damping
        verdicts += [
            near(f"peak relative to F1/lambda_c; omega_c = {omega_c:g} 1/s", OURS, 1.0, by_two[peak] / alone, 0.02),
            near(
                f"peak of the plant relative to the linear one; omega_c = {omega_c:g} 1/s",
                OURS,
                1.0,
                true.max() / by_two[peak],
                0.03,
            ),
        ]
    return StudyResult(
        number=NUMBER,
        claim="The amplitude at resonance is limited by the damper.",
        assignment=ASSIGNED,
        columns=columns,
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """Linear curves full, the plant's broken."""
    curves = []
    for omega_c, colour in zip(DAMPINGS, COLOURS):
        for label, line in (("linear", "-"), ("plant", "--")):
            y = result.columns[f"first harmonic of zeta at omega_c = {omega_c:g} 1/s; {label} [1]"]
            curves.append(Curve(x=SPEEDS, y=y, label=f"{omega_c:g}, {label}", colour=colour, line=line))
    panel = Panel(
        x_label="crank speed [rad/s]",
        y_label="first harmonic of u, relative to l4",
        curves=curves,
        legend="\N{GREEK SMALL LETTER OMEGA}c [1/s]",
        legend_at="outside",
        x_range=(26.0, 35.0),
        y_range=(0.0, 0.23),
    )
    return plot_curves([panel], title=result.heading)


STUDY = Study(NUMBER, compute, draw)
