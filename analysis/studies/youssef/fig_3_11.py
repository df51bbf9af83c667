"""Fig 3.11: free motion with the soft spring, the slider.

The thesis lets go of the crank of Table 3.1 at 420 rpm, th2 = u = u' = 0, with k = 5e5 dyn/cm. The motion resembles the
steady one of Fig 3.4, though the crank is free now and its speed swings; as the damper takes energy out, the slider
swings less, and nearer to the spring's zero.

The captions are lost: that this quantity stands under this number of 3.11 to 3.14 is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._free_crank import SLIDER, coast_result, draw_over_time

NUMBER = "3.11"
#: dyn/cm
STIFFNESS = 5e5


def compute() -> StudyResult:
    """The slider in free motion with the soft spring."""
    return coast_result(NUMBER, STIFFNESS, SLIDER)


STUDY = Study(NUMBER, compute, draw_over_time)
