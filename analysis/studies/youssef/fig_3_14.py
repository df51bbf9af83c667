"""Fig 3.14: free motion with the stiff spring, the crank.

The run of Fig 3.13. The swings within a turn are those of Fig 3.12: they come from the inertia of the links, not from the
spring.

The captions are lost: that this quantity stands under this number of 3.11 to 3.14 is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._free_crank import CRANK_SPEED, coast_result, draw_over_time

NUMBER = "3.14"
#: dyn/cm
STIFFNESS = 2e6


def compute() -> StudyResult:
    """The crank speed in free motion with the stiff spring."""
    return coast_result(NUMBER, STIFFNESS, CRANK_SPEED)


STUDY = Study(NUMBER, compute, draw_over_time)
