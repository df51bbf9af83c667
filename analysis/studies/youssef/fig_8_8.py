"""Fig 8.8: rig 1 with spring A, about half its natural frequency.

The second harmonic of the crank's turn meets the natural frequency, and the amplitude has a local maximum; the thesis reads
290 rpm, we find 296. The slider goes up and down twice a turn.

The captions are lost: the choice of speeds, and that they stand under this number of 8.7 to 8.13, is our assignment.
"""

from __future__ import annotations

from ..study import OURS, TEXT, Study, StudyResult, near
from ._rig_1 import draw_turns, local_maximum, turns_result

NUMBER = "8.8"


def compute() -> StudyResult:
    """The steady turns at these speeds."""
    return turns_result(
        NUMBER,
        "The amplitude has a local maximum at 290 rpm.",
        "a",
        (270, 296, 320),
        near("speed of the local maximum", TEXT, 290.0, local_maximum("a"), 5.0, "rpm"),
        near("speed of the local maximum", OURS, 296.0, local_maximum("a"), 0.5, "rpm"),
    )


STUDY = Study(NUMBER, compute, draw_turns)
