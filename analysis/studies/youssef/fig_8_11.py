"""Fig 8.11: rig 1 with spring B, about a third of its natural frequency.

The theory curves of the first rig's stiff spring, 11e6 dyn/cm. Near 380 rpm, a third of the natural frequency of 1133 rpm,
the third harmonic of the crank's turn stands out: three swings a turn.

The captions are lost: the choice of speeds, and that they stand under this number of 8.7 to 8.13, is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._rig_1 import draw_turns, turns_result

NUMBER = "8.11"


def compute() -> StudyResult:
    """The steady turns at these speeds."""
    return turns_result(
        NUMBER,
        "The stiff spring makes the slider swing three times a turn.",
        "b",
        (350, 380, 410),
    )


STUDY = Study(NUMBER, compute, draw_turns)
