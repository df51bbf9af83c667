"""Fig 8.10: rig 1 with spring A, through resonance.

Around the natural frequency of 592 rpm the motion is nearly the first harmonic alone, and its phase moves by a quarter of a
turn over the speeds shown. The greatest amplitude comes at about 574 rpm, below the natural frequency taken from the mean
effective mass: the effective mass changes over the turn and with u.

The captions are lost: the choice of speeds, and that they stand under this number of 8.7 to 8.13, is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._rig_1 import draw_turns, turns_result

NUMBER = "8.10"


def compute() -> StudyResult:
    """The steady turns at these speeds."""
    return turns_result(
        NUMBER,
        "At resonance the slider moves nearly harmonically.",
        "a",
        (520, 550, 574, 600, 650),
    )


STUDY = Study(NUMBER, compute, draw_turns)
