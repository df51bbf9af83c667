"""Fig 8.7: rig 1 with spring A, far below resonance.

The theory curves of the first rig's soft spring, 3e6 dyn/cm, at speeds below half its natural frequency (592 rpm). The
slider has eight, six and four peaks a turn at 150, 200 and 250 rpm, counting its highest and lowest points: the fourth,
third and second harmonic of the crank's turn stand out as each comes near the natural frequency.

The captions are lost: the choice of speeds, and that they stand under this number of 8.7 to 8.13, is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._rig_1 import draw_turns, turns_result

NUMBER = "8.7"


def compute() -> StudyResult:
    """The steady turns at these speeds."""
    return turns_result(
        NUMBER,
        "At low speed the slider has several peaks a turn.",
        "a",
        (150, 200, 250),
    )


STUDY = Study(NUMBER, compute, draw_turns)
