"""Fig 3.8: the slider after a launch, by its spring.

A launch by T0 = 1e8 dyn.cm as in Fig 3.6, with k = 5e5, 1e6 and 2e6 dyn/cm. The captions are lost: that this
quantity stands under this number of 3.6 to 3.10 is our assignment.
"""

from __future__ import annotations

from linkwork.five_bar.published import CM_PER_METRE

from ..study import OURS, Study, StudyResult, near
from ._free_crank import SLIDER, draw_launches_by_spring, launch_result, launches_by_spring
from ._runs import launch

NUMBER = "3.8"


def compute() -> StudyResult:
    """The slider after launches with the three springs."""
    stated = launch(1e8, 1e6)["slider.position"][500]
    return launch_result(
        NUMBER,
        launches_by_spring(),
        SLIDER,
        near("u at 0.25 s; T0 = 1e8 dyn.cm, k = 1e6 dyn/cm", OURS, -0.611604, CM_PER_METRE * stated, 5e-8, "cm"),
    )


STUDY = Study(NUMBER, compute, draw_launches_by_spring)
