"""Fig 3.9: the crank speed after a launch, by the slider's spring.

The runs of Fig 3.8. As the torque in Fig 3.5, the crank hardly feels the spring at first; then the runs drift apart in crank
angle, and the swings of their speeds with them. The captions are lost: that this
quantity stands under this number of 3.6 to 3.10 is our assignment.
"""

from __future__ import annotations

from ..study import OURS, Study, StudyResult, near
from ._free_crank import CRANK_SPEED, draw_launches_by_spring, launch_result, launches_by_spring
from ._runs import launch

NUMBER = "3.9"


def compute() -> StudyResult:
    """The crank speed after launches with the three springs."""
    stated = launch(1e8, 1e6)["crank.angle"][500]
    return launch_result(
        NUMBER,
        launches_by_spring(),
        CRANK_SPEED,
        near("crank angle at 0.25 s; T0 = 1e8 dyn.cm, k = 1e6 dyn/cm", OURS, 17.8051227, stated, 5e-8, "rad"),
    )


STUDY = Study(NUMBER, compute, draw_launches_by_spring)
