"""Fig 8.9: rig 1 with spring A, where four peaks a turn become two.

Between half the natural frequency and the whole, the first harmonic overtakes the second. The thesis sees the slider's four
peaks a turn (highest and lowest points together) become two at about 450 rpm. So do we: the second pair flattens into a
shoulder and is gone at 451 rpm.

The captions are lost: the choice of speeds, and that they stand under this number of 8.7 to 8.13, is our assignment.
"""

from __future__ import annotations

from ..study import OURS, TEXT, Study, StudyResult, near
from ._rig_1 import draw_turns, speed_of_fewer_peaks, turns_result

NUMBER = "8.9"


def compute() -> StudyResult:
    """The steady turns at these speeds."""
    return turns_result(
        NUMBER,
        "Four peaks a turn become two at about 450 rpm.",
        "a",
        (400, 430, 451, 480),
        near("speed at which four peaks become two", TEXT, 450.0, speed_of_fewer_peaks("a", 400, 500), 5.0, "rpm"),
        near("speed at which four peaks become two", OURS, 451.0, speed_of_fewer_peaks("a", 400, 500), 1.0, "rpm"),
    )


STUDY = Study(NUMBER, compute, draw_turns)
