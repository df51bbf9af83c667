"""Fig 8.12: rig 1 with spring B, about half its natural frequency.

The second harmonic meets the natural frequency: the amplitude has its local maximum at 564 rpm. The thesis expects 580,
half of the 1160 it takes as the natural frequency.

The captions are lost: the choice of speeds, and that they stand under this number of 8.7 to 8.13, is our assignment.
"""

from __future__ import annotations

from ..study import OURS, TEXT, Study, StudyResult, near
from ._rig_1 import draw_turns, local_maximum, turns_result

NUMBER = "8.12"


def compute() -> StudyResult:
    """The steady turns at these speeds."""
    return turns_result(
        NUMBER,
        "The amplitude has a local maximum at 580 rpm.",
        "b",
        (530, 564, 600),
        near("speed of the local maximum", TEXT, 580.0, local_maximum("b"), 5.0, "rpm"),
        near("speed of the local maximum", OURS, 564.0, local_maximum("b"), 0.5, "rpm"),
    )


STUDY = Study(NUMBER, compute, draw_turns)
