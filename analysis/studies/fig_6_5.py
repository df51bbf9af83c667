"""Fig 6.5: ellipse (b) traced in time.

As Fig 6.4 with semi-axes of 15 and 5 cm. The thesis prints a linkage with a sum of squared distances of 4.001 cm2, which
evaluates to 9.15. That this problem stands under this number is our assignment.
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

NUMBER = "6.5"
PROBLEM = "ellipse-b"


def compute() -> StudyResult:
    """Curves, linkages and distances of the printed linkage and ours."""
    return StudyResult(
        number=NUMBER,
        claim="A four-bar traces ellipse (b) at 72 crank angles with a sum of squared distances of 4.001 cm2.",
        assignment=ASSIGNED,
        columns=padded(path_columns(PROBLEM) | distance_columns(PROBLEM)),
        verdicts=(
            *error_verdicts(PROBLEM, 4.001, 5e-4, 9.15, 5e-3),
            *sound_verdicts(PROBLEM),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """The target and both curves, their distances, and the linkages."""
    panels = [curves_panel(result, marks=True), distance_panel(result, timed=True), linkages_panel(result)]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.6))


STUDY = Study(NUMBER, compute, draw)
main = STUDY.main

if __name__ == "__main__":
    main(*sys.argv[1:])
