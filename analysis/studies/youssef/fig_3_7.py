"""Fig 3.7: the crank speed after a launch, by the torque of the launch.

The runs of Fig 3.6. After the launch the crank is free: its speed swings as it trades energy with coupler, rocker and
slider, and falls as the damper takes energy out. The captions are lost: that this
quantity stands under this number of 3.6 to 3.10 is our assignment.
"""

from __future__ import annotations

from ..study import OURS, Study, StudyResult, near
from ._free_crank import CRANK_SPEED, draw_launches_by_torque, launch_result, launches_by_torque
from ._runs import launch

NUMBER = "3.7"


def compute() -> StudyResult:
    """The crank speed after launches with the three torques."""
    stated = launch(1e8, 1e6)["crank.speed"][500]
    return launch_result(
        NUMBER,
        launches_by_torque(),
        CRANK_SPEED,
        near("crank speed at 0.25 s; T0 = 1e8 dyn.cm, k = 1e6 dyn/cm", OURS, 72.7805553, stated, 5e-8, "rad/s"),
    )


STUDY = Study(NUMBER, compute, draw_launches_by_torque)
