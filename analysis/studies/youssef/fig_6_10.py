"""Fig 6.10: path (b), an ellipse traced in any time.

The ellipse of Fig 6.5 without its timing. The thesis prints an area of 12.6 cm2 between the curves, which its linkage has if
l4 = 183.443 cm is read as 184.443. That this problem stands under this number is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._chapter_6 import draw_untimed, ellipse_result

NUMBER = "6.10"


def compute() -> StudyResult:
    """Curves, linkages and distances of the printed linkage and ours."""
    return ellipse_result(
        NUMBER,
        "path-b",
        "A four-bar traces path (b), whatever its timing, with an area of 12.6 cm2 between the curves.",
        stated=(12.6, 0.05),
        reference=(12.61, 5e-3),
    )


STUDY = Study(NUMBER, compute, draw_untimed)
