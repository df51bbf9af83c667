"""Fig 4.6: speed of resonance over the inertia of the rocker.

The rocker turns as the slider moves, and so adds p45 I4/3 to the effective mass m4 + m5; the resonance falls with it. The
crank moves it a little more, by the mean mass and stiffness of second order in l2/l4 and by the harmonics of both. The
shift by the thesis's code is three times the right one, and the errors of it that we know account for a fifth of the
excess. With a damper the plant has its greatest amplitude where two harmonics have it while that is small; the slider
softens as it swings farther, by 0.04 rad/s at I4 = 2 and a fifth of the rocker's length. The captions are lost: that the
resonance over the inertia stands under this number is our assignment.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from linkwork.five_bar.published import P45, SQUARE_OF_OMEGA_K, chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...youssef import Variant, resonance
from ..study import ASSIGNED, OURS, TEXT, Study, StudyResult, at_most, near, padded
from ._chapter_4 import DAMPING, linear, name, true_motion
from .fig_4_3 import RESONANCES

NUMBER = "4.6"
RATIOS = np.arange(0.25, 2.01, 0.25)
VARIANTS = (Variant.EXACT, Variant.PRINTED, Variant.FORTRAN)


def fastest(ratio: float, plant: bool) -> float:
    """Speed of the greatest first harmonic with a damper (rad/s), of the plant or by two harmonics."""
    middle = sum(resonance(chapter_4(ratio))) / 2.0

    def size(speed: float) -> float:
        motion = true_motion(speed, ratio, DAMPING) if plant else linear(speed, ratio, DAMPING)
        return -motion.harmonic(1)

    found = minimize_scalar(size, bounds=(middle - 0.5, middle + 0.5), method="bounded", options={"xatol": 1e-5})
    return float(found.x)


def compute() -> StudyResult:
    """Resonances by the determinant over I4, those of the thesis, and the plant's."""
    at_rest = np.sqrt(SQUARE_OF_OMEGA_K / (1.0 + P45 * RATIOS / 3.0))
    columns = {"inertia ratio I4 [1]": RATIOS, "crank of no length [rad/s]": at_rest}
    for variant in VARIANTS:
        lower = [resonance(chapter_4(ratio), variant=variant)[0] for ratio in RATIOS]
        columns[f"resonance; {name(variant)} [rad/s]"] = np.array(lower)
    columns["I4 of the thesis's resonances [1]"] = np.array(list(RESONANCES))
    columns["resonance; thesis's code [rad/s]"] = np.array([thesis for thesis, _ in RESONANCES.values()])
    plant, by_two = (np.array([fastest(ratio, which) for ratio in RATIOS]) for which in (True, False))
    columns[f"greatest first harmonic of the plant at omega_c = {DAMPING:g} 1/s [rad/s]"] = plant
    columns[f"greatest first harmonic by two harmonics at omega_c = {DAMPING:g} 1/s [rad/s]"] = by_two
    right = columns[f"resonance; {name(Variant.EXACT)} [rad/s]"]
    verdicts = []
    for ratio, (thesis, reference) in RESONANCES.items():
        i = int(np.flatnonzero(ratio == RATIOS)[0])
        verdicts += [
            near(
                f"shift by the crank; I4 = {ratio:g}",
                source,
                1e3 * (stated - at_rest[i]),
                1e3 * (right[i] - at_rest[i]),
                0.051,
                "mrad/s",
            )
            for source, stated in ((TEXT, thesis), (OURS, reference))
        ]
    off = 1e3 * (plant - by_two)
    verdicts += [
        near("peak of the plant less that of two harmonics; I4 = 0.25", OURS, 0.0, off[0], 1.0, "mrad/s"),
        at_most("peak of the plant less that of two harmonics; I4 = 2", OURS, -30.0, off[-1], "mrad/s"),
    ]
    return StudyResult(
        number=NUMBER,
        claim="The resonance falls with the inertia of the rocker: 31.076, 30.557, 30.065 rad/s at I4 = 0.5, 1, 1.5.",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The resonances, and below how far they are from that with a crank of no length."""
    c = result.columns
    at_rest = c["crank of no length [rad/s]"]
    ratios, stated = (c[n][: len(RESONANCES)] for n in list(c)[5:7])
    thesis_at_rest = np.sqrt(SQUARE_OF_OMEGA_K / (1.0 + P45 * ratios / 3.0))
    plant, by_two = list(c)[7:9]
    panels = []
    for shift in (0.0, 1.0):
        curves = [
            Curve(x=RATIOS, y=c[f"resonance; {name(v)} [rad/s]"] - shift * at_rest, label=name(v)) for v in VARIANTS
        ]
        curves.append(
            Curve(
                x=ratios,
                y=stated - shift * thesis_at_rest,
                label="thesis's code",
                colour=COLOURS[3],
                line="",
                marker="s",
            )
        )
        if shift:
            peak = f"peak at \N{GREEK SMALL LETTER OMEGA}c = {DAMPING:g} 1/s"
            curves += [
                Curve(x=RATIOS, y=c[column] - at_rest, label=label, colour=COLOURS[4], line=line, marker=marker)
                for column, label, line, marker in (
                    (by_two, f"{peak}, two harmonics", "--", ""),
                    (plant, f"{peak}, plant", "", "o"),
                )
            ]
        panels.append(
            Panel(
                x_label="inertia ratio I4",
                y_label="shift by the crank [rad/s]" if shift else "resonance [rad/s]",
                curves=curves,
                legend_at="outside",
            )
        )
    return plot_curves(panels, title=result.heading)


STUDY = Study(NUMBER, compute, draw)
