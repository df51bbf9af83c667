"""Fig 8.13: rig 1 with spring B, towards resonance.

As with spring A, four peaks a turn become two as the first harmonic overtakes the second, here at about 847 rpm, three
quarters of the natural frequency in both. Runs from rest stay on this motion up to 1030 rpm; see Fig 8.15 for what
lies beyond.

The captions are lost: the choice of speeds, and that they stand under this number of 8.7 to 8.13, is our assignment.
"""

from __future__ import annotations

from ..study import Study, StudyResult
from ._rig_1 import draw_turns, turns_result

NUMBER = "8.13"


def compute() -> StudyResult:
    """The steady turns at these speeds."""
    return turns_result(
        NUMBER,
        "Four peaks a turn become two below resonance.",
        "b",
        (780, 847, 900, 960, 1020),
    )


STUDY = Study(NUMBER, compute, draw_turns)
