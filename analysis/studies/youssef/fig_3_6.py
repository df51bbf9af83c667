"""Fig 3.6: the slider after a launch, by the torque of the launch.

The thesis starts the crank from rest by a torque T = T0 (1 - th2) that vanishes at th2 = 1 rad, for T0 = 1e7, 1e8 and 2e8
dyn.cm. We end it exactly there. The harder the launch, the further the slider is thrown. The captions are lost: that this
quantity stands under this number of 3.6 to 3.10 is our assignment.
"""

from __future__ import annotations

from linkwork.five_bar.published import CM_PER_METRE

from ..study import OURS, Study, StudyResult, near
from ._free_crank import SLIDER, draw_launches_by_torque, launch_result, launches_by_torque
from ._runs import launch

NUMBER = "3.6"


def compute() -> StudyResult:
    """The slider after launches with the three torques."""
    stated = launch(1e8, 1e6)["slider.position"][500]
    return launch_result(
        NUMBER,
        launches_by_torque(),
        SLIDER,
        near("u at 0.25 s; T0 = 1e8 dyn.cm, k = 1e6 dyn/cm", OURS, -0.611604, CM_PER_METRE * stated, 5e-8, "cm"),
    )


STUDY = Study(NUMBER, compute, draw_launches_by_torque)
