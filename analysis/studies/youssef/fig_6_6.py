"""Fig 6.6: ellipse (a) traced in time by a small linkage.

As Fig 6.4 with ground link, coupler and rocker from 10 to 30 cm, a crank of at most 10 cm and the coupler point at most 30 cm
from it. The thesis prints an error of 53.6 cm2 with a ground link at 93.8 degrees, which would put the curve far off; read as
-93.8 the linkage is better than the thesis says, 30.4, and the best has a fifth of that. That this problem stands under this
number is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._chapter_6 import draw_timed, ellipse_result

NUMBER = "6.6"


def compute() -> StudyResult:
    """Curves, linkages and distances of the printed linkage and ours."""
    return ellipse_result(
        NUMBER,
        "ellipse-a-bounded",
        "With bounds on its lengths a four-bar traces ellipse (a) with a sum of squared distances of 53.6 cm2.",
        stated=(53.6, 0.05),
        reference=(30.4, 0.05),
    )


STUDY = Study(NUMBER, compute, draw_timed)
