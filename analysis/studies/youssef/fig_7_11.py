"""Fig 7.11: the strategy of section 7.4, the simplest mechanism that meets a tolerance.

A four-bar is tried first; where its best is not good enough its rocker pivot is moved by a slider, harmonic by harmonic, links
and motion optimised together; then the pivot goes on a second crank, geared or turned by itself. The task is the unweighted
rocker function at N = 24, whose corner at the start of the turn no four-bar can follow. The tolerance is 3 degrees at worst.

The thesis states the strategy in words; what its figure shows is lost. That the strategy stands under this number is our
assignment; the tolerance, the least transmission angle of 25 degrees and the two gears that are tried are our choice.
"""

from __future__ import annotations

from functools import cache
from math import degrees, radians

import numpy as np

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...motion import Strategy, simplest_mechanism
from ...synthesis import LeastTransmission, Linkage, Search, Solution, evaluate
from ...synthesis.published import WEIGHTED_N, rocker_function
from ..study import OURS, Study, StudyResult, at_least, at_most, near, padded
from ._chapter_7 import ASSIGNED, TARGET, TURN, angle_error, over_turn, sound

NUMBER = "7.11"
#: deg, at the worst crank rotation; least transmission angle (deg).
TOLERANCE, TRANSMISSION = 3.0, 25.0
#: With a moving pivot it is held at 72 rotations: what may be missing between them (deg).
BETWEEN = 0.5
RATIOS, HARMONICS, STARTS = (1, 2), 3, 4
#: What the steps are called in the picture, by the first words of the strategy's own.
SHORT = {
    "four-bar with a moved slider": "slider",
    "four-bar": "four-bar",
    "five-bar, second crank geared": "2nd crank geared",
    "five-bar, second crank turned independently": "2nd crank",
}


@cache
def strategy() -> Strategy:
    """What was tried, and what was chosen."""
    return simplest_mechanism(
        rocker_function(WEIGHTED_N),
        radians(TOLERANCE),
        criterion="worst",
        constraints=(LeastTransmission(angle=radians(TRANSMISSION)),),
        harmonics=HARMONICS,
        ratios=RATIOS,
        search=Search(starts=STARTS),
    )


def short(mechanism: str) -> str:
    """A mechanism in a few words."""
    start = max((words for words in SHORT if mechanism.startswith(words)), key=len)
    return (SHORT[start] + mechanism[len(start) :]).replace("harmonics", "harm.").replace("harmonic", "harm.")


def chosen() -> dict[str, Linkage]:
    """The mechanisms whose errors are shown: the four-bar, the best with a slider, and the one that was chosen."""
    steps = strategy().steps
    sliders = [step for step in steps if "slider" in step.mechanism]
    return {short(step.mechanism): _solution(step.solution).linkage for step in (steps[0], sliders[-1], steps[-1])}


def _solution(solution: Solution | None) -> Solution:
    assert solution is not None
    return solution


def compute() -> StudyResult:
    """The ladder of mechanisms, and the errors of three over the turn."""
    found = strategy()
    task = rocker_function(WEIGHTED_N)
    worst = np.degrees([step.value for step in found.steps])
    sliders = worst[["slider" in step.mechanism for step in found.steps]]
    columns = {"step [1]": np.arange(1.0, len(worst) + 1.0), "worst error [deg]": worst}
    columns |= {"crank rotation [deg]": np.degrees(TURN)}
    for name, linkage in chosen().items():
        columns[f"error; {name.replace(',', ';')} [deg]"] = angle_error(linkage, TURN)
    solutions = [_solution(step.solution) for step in found.steps]
    verdicts = (
        at_least("the tolerance is met", OURS, 1.0, float(found.met)),
        at_most("worst error of the mechanism chosen", OURS, TOLERANCE, degrees(found.chosen.value), "deg"),
        near(
            "the same, evaluated afresh",
            OURS,
            degrees(found.chosen.value),
            degrees(evaluate(task, solutions[-1].linkage).worst),
            1e-6,
            "deg",
        ),
        at_least("least worst error of those before it", OURS, TOLERANCE, worst[:-1].min(), "deg"),
        at_least("four-bar's worst error, of the best with a slider", OURS, 2.0, worst[0] / sliders.min()),
        near(
            "steps taken that say they moved on",
            OURS,
            len(worst) - 1,
            sum("moved on" in s.reason for s in found.steps),
            0,
        ),
        at_least(
            "least transmission angle of them all",
            OURS,
            TRANSMISSION - BETWEEN,
            degrees(min(s.linkage.least_transmission for s in solutions)),
            "deg",
        ),
        sound("no circuit, branch or order defect in any", *solutions),
    )
    return StudyResult(
        number=NUMBER,
        claim="A four-bar if it will do, else one with a moved slider, else a five-bar: the simplest that is good enough.",
        assignment=f"{ASSIGNED} Task, tolerance and least transmission angle are our choice.",
        columns=padded(columns),
        verdicts=verdicts,
    )


def draw(result: StudyResult) -> Figure:
    """The ladder, and the errors."""
    steps = strategy().steps
    c = result.columns
    names = {f"error; {name.replace(',', ';')} [deg]": name for name in chosen()}
    panels = [
        Panel(
            x_label="mechanisms in the order in which they are tried",
            y_label="worst error of the rocker's angle [deg]",
            curves=[
                Curve(x=c["step [1]"], y=c["worst error [deg]"], label="best of each", marker="o", colour=COLOURS[0]),
                Curve(x=[0.5, len(steps) + 0.3], y=[TOLERANCE] * 2, label="tolerance", colour=TARGET, line="--"),
            ],
            verticals={short(step.mechanism): k for k, step in enumerate(steps, start=1)},
            x_range=(0.4, len(steps) + 0.4),
            y_range=(0.0, 36.0),
            x_ticks=range(1, len(steps) + 1),
            legend_at="outside",
        ),
        over_turn(result, names, "error of the rocker's angle [deg]"),
    ]
    return plot_curves(panels, title=result.heading, size=(7.6, 3.4))


STUDY = Study(NUMBER, compute, draw)
