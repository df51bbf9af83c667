"""Fig 6.10: path (b), an ellipse traced in any time.

The ellipse of Fig 6.5 without its timing. The thesis prints an area of 12.6 cm2 between the curves, which its linkage has if
l4 = 183.443 cm is read as 184.443. That this problem stands under this number is our assignment.
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

NUMBER = "6.10"
PROBLEM = "path-b"


def compute() -> StudyResult:
    """Curves, linkages and distances of the printed linkage and ours."""
    return StudyResult(
        number=NUMBER,
        claim="A four-bar traces path (b), whatever its timing, with an area of 12.6 cm2 between the curves.",
        assignment=ASSIGNED,
        columns=padded(path_columns(PROBLEM) | distance_columns(PROBLEM)),
        verdicts=(*error_verdicts(PROBLEM, 12.6, 0.05, 12.61, 5e-3), *sound_verdicts(PROBLEM)),
    )


def draw(result: StudyResult) -> Figure:
    """The target and both curves, their distances, and the linkages."""
    panels = [curves_panel(result, marks=False), distance_panel(result, timed=False), linkages_panel(result)]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.6))


STUDY = Study(NUMBER, compute, draw)
main = STUDY.main

if __name__ == "__main__":
    main(*sys.argv[1:])
