"""Fig 8.15: amplitude of rig 1 with spring B over the speed.

The thesis takes 1160 rpm as the natural frequency, twice that of spring A; but the springs are as 11 to 3, so that the
natural frequencies are as 1.915 to 1, whatever the effective mass: 1133 rpm. The local maximum at half of it is at 564 rpm.

The curve has more to it than the text tells. The resonance leans so far to lower speeds that two steady motions exist side by
side. A machine that speeds up stays on the lower branch until it folds back at 1036 rpm, and jumps from 3.8 to 10.6 cm. One
that slows down stays on the upper branch, which doubles its period at 932.7 rpm and again at 916.7; the motion of four turns
is lost before 910 rpm and the links come to the limit of assembly, at amplitudes that no rig would survive.

The captions are lost: that this curve stands under this number of 8.14 to 8.17 is our assignment.
"""

from __future__ import annotations

from functools import cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import Crossing, PeriodicOrbit, SpecialPoint, Sweep, sweep
from ..study import ASSIGNED, OURS, TEXT, Study, StudyResult, near, padded
from ._orbits import columns_of, curves_over_speed, disturbed_verdict, orbit, rpm, runs_verdict
from ._rig_1 import FASTEST, SLOWEST, SPLIT, local_maximum, natural_speed, resonant_b, slow
from ._runs import rig_1

NUMBER = "8.15"
#: Step of the sweeps (rpm).
STEP = 10.0
#: Branches: up to 900 rpm; from there on those from the low and from the high end, and the one of twice the period.
NAMES = ("below resonance", "lower branch", "upper branch", "period of two turns")


@cache
def sweep_b(rising: bool) -> Sweep:
    """What a machine meets about resonance as it speeds up or slows down step by step."""
    speeds = np.arange(SPLIT, FASTEST + 1.0, STEP) * RAD_S_PER_RPM
    return sweep(rig_1("b"), speeds if rising else speeds[::-1])


def special_points() -> list[SpecialPoint]:
    """Fold and period doublings of the branches about resonance."""
    return [special for branch in resonant_b().branches for special in branch.special]


def speeds_of(kind: Crossing) -> list[float]:
    """Their speeds (rpm)."""
    return [special.parameter / RAD_S_PER_RPM for special in special_points() if special.kind is kind]


def upper_orbit(speed: float) -> PeriodicOrbit:
    """The motion of large amplitude at a speed (rpm)."""
    upper = resonant_b().branches[1]
    near_it = upper.orbits[int(np.argmin(np.abs(rpm(upper) - speed)))]
    return orbit(rig_1("b"), speed, near_it.start)


def compute() -> StudyResult:
    """Branches of periodic motions, and sweeps with rising and falling speed."""
    natural, highest = natural_speed("b"), local_maximum("b")
    columns: dict[str, NDArray[np.float64]] = {}
    for name, branch in zip(NAMES, slow("b").branches + resonant_b().branches):
        columns |= columns_of(branch, name)
    for name, swept in (("rising speed", sweep_b(True)), ("falling speed", sweep_b(False))):
        columns[f"speed; {name} [rpm]"] = swept.speed / RAD_S_PER_RPM
        columns[f"amplitude; {name} [cm]"] = CM_PER_METRE * swept.amplitude.filled(np.nan)
    special = special_points()
    columns["speed; fold and period doublings [rpm]"] = np.array([s.parameter for s in special]) / RAD_S_PER_RPM
    columns["amplitude; fold and period doublings [cm]"] = CM_PER_METRE * np.array([s.orbit.amplitude for s in special])
    (fold,), doublings = speeds_of(Crossing.FOLD), speeds_of(Crossing.PERIOD_DOUBLING)
    (jump,) = (jump.speed / RAD_S_PER_RPM for jump in sweep_b(True).jumps)
    doubled = max(s for s, turns in zip(sweep_b(False).speed / RAD_S_PER_RPM, sweep_b(False).turns) if turns == 2)
    return StudyResult(
        number=NUMBER,
        claim="The natural frequency is 1160 rpm, twice that of spring A; local maximum of the amplitude at 580.",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=(
            near("natural frequency", TEXT, 1160.0, natural, 5.0, "rpm"),
            near("natural frequency from the mean effective mass", OURS, 1133.0, natural, 0.5, "rpm"),
            near("natural frequency relative to spring A's", TEXT, 2.0, natural / natural_speed("a"), 0.01),
            near("the same, sqrt(11/3)", OURS, sqrt(11.0 / 3.0), natural / natural_speed("a"), 1e-9),
            near("speed of the local maximum", TEXT, 580.0, highest, 5.0, "rpm"),
            near("speed of the local maximum", OURS, 564.0, highest, 0.5, "rpm"),
            near("the jump of the sweep with rising speed, at the fold", OURS, fold, jump, STEP, "rpm"),
            near("two turns of the falling sweep, from the doubling", OURS, max(doublings), doubled, STEP, "rpm"),
            runs_verdict(rig_1("b"), (300.0, 564.0, 1000.0)),
            disturbed_verdict(upper_orbit(1000.0), 0.95, "upper branch at 1000 rpm"),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Amplitude over the speed up to resonance, and the two motions about it."""
    natural = natural_speed("b")
    below = curves_over_speed(result, NAMES[0], COLOURS[0]) + curves_over_speed(result, NAMES[1], COLOURS[0])
    about = [
        curve for name, colour in zip(NAMES[1:], COLOURS) for curve in curves_over_speed(result, name, colour, name)
    ]
    for name, marker in (("rising speed", "^"), ("falling speed", "v")):
        x, y = result.columns[f"speed; {name} [rpm]"], result.columns[f"amplitude; {name} [cm]"]
        about.append(Curve(x=x, y=y, label=f"sweep with {name}", line=":", marker=marker, colour="0.45"))
    marks = "fold and period doublings"
    x, y = result.columns[f"speed; {marks} [rpm]"], result.columns[f"amplitude; {marks} [cm]"]
    about.append(Curve(x=x, y=y, label=marks, line="", marker="D", colour=COLOURS[6]))
    panels = [
        Panel(
            x_label="crank speed [rpm]",
            y_label="amplitude of u [cm]",
            title="up to resonance",
            curves=below,
            verticals={
                f"a third of the natural frequency, {natural / 3:.0f}": natural / 3,
                f"half of it, {natural / 2:.0f}": natural / 2,
            },
            x_range=(SLOWEST, 1060.0),
            y_range=(0.0, 4.5),
        ),
        Panel(
            x_label="crank speed [rpm]",
            y_label="amplitude of u [cm]",
            title="about resonance; dashed: unstable",
            curves=about,
            verticals={f"natural frequency, {natural:.0f}": natural},
            x_range=(880.0, FASTEST),
            y_range=(0.0, 18.0),
            legend_at="outside",
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(5.4, 3.9))


STUDY = Study(NUMBER, compute, draw)
