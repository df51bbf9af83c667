"""Fig 6.9: path (a), an ellipse traced in any time.

The ellipse of Fig 6.4 without its timing: the quality function is the area between the curves. The thesis prints 2.3 cm2. With
X0 = 154.85 cm as printed the curve would lie far beside its target; read as 15.485 it is 3.11. That this problem stands under
this number is our assignment.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from ..figures import plot_curves
from ._chapter_6 import (
    ASSIGNED,
    curves_panel,
    distance_columns,
    distance_panel,
    error_verdicts,
    linkages_panel,
    path_columns,
    sound_verdicts,
)
from .study import Study, StudyResult, padded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMBER = "6.9"
PROBLEM = "path-a"


def compute() -> StudyResult:
    """Curves, linkages and distances of the printed linkage and ours."""
    return StudyResult(
        number=NUMBER,
        claim="A four-bar traces path (a), whatever its timing, with an area of 2.3 cm2 between the curves.",
        assignment=ASSIGNED,
        columns=padded(path_columns(PROBLEM) | distance_columns(PROBLEM)),
        verdicts=(*error_verdicts(PROBLEM, 2.3, 0.05, 3.11, 5e-3), *sound_verdicts(PROBLEM)),
    )


def draw(result: StudyResult) -> Figure:
    """The target and both curves, their distances, and the linkages."""
    panels = [curves_panel(result, marks=False), distance_panel(result, timed=False), linkages_panel(result)]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.6))


STUDY = Study(NUMBER, compute, draw)
main = STUDY.main

if __name__ == "__main__":
    main(*sys.argv[1:])
