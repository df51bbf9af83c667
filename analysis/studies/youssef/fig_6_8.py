"""Fig 6.8: the rocker function with weights, and with a mounting angle.

As Fig 6.7 with a weight of 1000 from 60 to 260 degrees. The thesis prints an error of 35.0, divided by that weight: its linkage
has 35.8 at 24 crank angles, 60 degrees included. With the output mounted on the rocker at an angle that is free the function
is followed within the window with a thirtieth of the squared errors. That this problem stands under this number is our
assignment.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...figures import Figure, plot_curves
from ...synthesis import Evaluation, RockerFunction, Search, evaluate, synthesize
from ...synthesis.published import DEG2_PER_RAD2, PROBLEMS, N, rocker_function
from ..study import OURS, Study, StudyResult, at_most, near, padded
from ._chapter_6 import (
    ASSIGNED,
    CANDIDATES,
    STARTS,
    angle_columns,
    best,
    error_verdicts,
    rocker_panels,
    trade_off_columns,
)

NUMBER = "6.8"
PROBLEM = "rocker-weighted"


def window_sum(task: RockerFunction, evaluation: Evaluation) -> float:
    """Sum of the squared errors within the weighted window (deg2)."""
    within = np.asarray(task.weights) > 1.0
    return DEG2_PER_RAD2 * float(np.sum(evaluation.errors[within] ** 2))


def compute() -> StudyResult:
    """Rocker angles of the printed linkage and ours, with and without a mounting angle, and the trade-off."""
    p = PROBLEMS[PROBLEM]
    assert isinstance(p.task, RockerFunction)
    task = rocker_function(N, weighted=True, mounting=True)
    mounted = synthesize(task, p.bounds, p.constraints, search=Search(starts=STARTS, candidates=CANDIDATES)).best
    return StudyResult(
        number=NUMBER,
        claim="Weighted by 1000 from 60 to 260 degrees the rocker function is made with an error of 35.0 deg2.",
        assignment=ASSIGNED,
        columns=padded(
            angle_columns({"printed": p.linkage, "ours": best(PROBLEM).linkage, "mounted": mounted.linkage})
            | trade_off_columns(PROBLEM, {"fixed": p.task, "mounted": replace(p.task, mounting=True)})
        ),
        verdicts=(
            *error_verdicts(PROBLEM, 35.0, 0.05, 35.8, 0.05),
            near(
                f"sum of the window's squared errors, printed linkage; N = {N}",
                OURS,
                104.9,
                window_sum(task, evaluate(task, p.linkage)),
                0.05,
                "deg2",
            ),
            at_most(
                f"the same with a free mounting angle; N = {N}",
                OURS,
                3.5,
                window_sum(task, mounted.evaluation),
                "deg2",
            ),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Rocker angles, errors, and the trade-off."""
    labels = {"printed": "printed linkage", "ours": "our linkage", "mounted": "ours, mounting free"}
    panels = rocker_panels(result, PROBLEM, labels, {"fixed": "mounting fixed", "mounted": "mounting free"})
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.6))


STUDY = Study(NUMBER, compute, draw)
