"""Fig 3.13: free motion with the stiff spring, the slider.

The run of Fig 3.11 with k = 2e6 dyn/cm: the slider swings less, and as the crank slows down, with an oscillation of
its own between the pushes.

The captions are lost: that this quantity stands under this number of 3.11 to 3.14 is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._free_crank import SLIDER, coast_result, draw_over_time

NUMBER = "3.13"
#: dyn/cm
STIFFNESS = 2e6


def compute() -> StudyResult:
    """The slider in free motion with the stiff spring."""
    return coast_result(NUMBER, STIFFNESS, SLIDER)


STUDY = Study(NUMBER, compute, draw_over_time)
