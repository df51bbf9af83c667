"""Fig 3.12: free motion with the soft spring, the crank.

The run of Fig 3.11. The speed swings by more than a third of its mean within a turn, as the crank trades its energy with
coupler, rocker and slider, and the damper lowers the mean.

The captions are lost: that this quantity stands under this number of 3.11 to 3.14 is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._free_crank import CRANK_SPEED, coast_result, draw_over_time

NUMBER = "3.12"
#: dyn/cm
STIFFNESS = 5e5


def compute() -> StudyResult:
    """The crank speed in free motion with the soft spring."""
    return coast_result(NUMBER, STIFFNESS, CRANK_SPEED)


STUDY = Study(NUMBER, compute, draw_over_time)
