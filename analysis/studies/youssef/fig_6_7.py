"""Fig 6.7: a rocker function, unweighted.

The rocker is to be at 70 + 100 |sin(th/2)| degrees over a turn of the crank. The thesis prints a linkage with a sum of squared
errors of 700 deg2 and does not say at how many crank angles: its linkage has 1059.9 at 72 and 721 at 48. The target's corner at
the beginning is more than any four-bar can do. The transmission angle is what the target makes it; how much the error grows as
more is asked of it is shown. That this problem stands under this number is our assignment.
"""

from __future__ import annotations

from ...figures import Figure, plot_curves
from ...synthesis import RockerFunction, Search, evaluate, synthesize
from ...synthesis.published import PROBLEMS, rocker_function
from ..study import OURS, TEXT, Study, StudyResult, at_most, near, padded
from ._chapter_6 import ASSIGNED, angle_columns, best, error_verdicts, rocker_panels, trade_off_columns

NUMBER = "6.7"
PROBLEM = "rocker"
#: The other number of crank angles that the printed error may be meant for.
FEWER = 48


def compute() -> StudyResult:
    """Rocker angles of the printed linkage and ours, and the trade-off."""
    p = PROBLEMS[PROBLEM]
    assert isinstance(p.task, RockerFunction)
    fewer = rocker_function(FEWER)
    printed = p.convert(evaluate(fewer, p.linkage).error)
    found = p.convert(
        synthesize(fewer, p.bounds, p.constraints, search=Search(starts=4, candidates=1 << 13)).best.error
    )
    return StudyResult(
        number=NUMBER,
        claim="A four-bar makes the rocker function with a sum of squared errors of 700 deg2.",
        assignment=ASSIGNED,
        columns=padded(
            angle_columns({"printed": p.linkage, "ours": best(PROBLEM).linkage})
            | trade_off_columns(PROBLEM, {"fixed": p.task})
        ),
        verdicts=(
            *error_verdicts(PROBLEM, 700.0, 0.5, 1059.9, 0.05),
            near(f"error of the printed linkage; N = {FEWER}", TEXT, 700.0, printed, 0.5, p.unit),
            near(f"error of the printed linkage; N = {FEWER}", OURS, 721.0, printed, 0.5, p.unit),
            at_most(f"error of our linkage; N = {FEWER}", OURS, 695.85, found, p.unit),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Rocker angles, errors, and the trade-off."""
    panels = rocker_panels(
        result, PROBLEM, {"printed": "printed linkage", "ours": "our linkage"}, {"fixed": "at 72 crank angles"}
    )
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.6))


STUDY = Study(NUMBER, compute, draw)
