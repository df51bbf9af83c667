"""Fig 8.18: amplitude of rig 2 with spring C over the speed.

The thesis measures a natural frequency of 585 rpm. The mean effective mass gives 585.5, and the amplitude is greatest, 1.72
cm, at 586.1. At half of it, 295.0 rpm, the second harmonic makes a local maximum of 0.89 mm. The thesis's approximation,
two harmonics of the linear equation to second order in the crank's length, put right, is good to 0.3 and 0.1 % there, and
to 0.6 % from half the natural frequency on; about a third of it, where the third harmonic has its turn, it falls short by
up to 8 %.

The captions are lost: that this curve stands under this number of 8.18 to 8.21 is our assignment.
"""

from __future__ import annotations

from ...figures import Figure
from ..study import Study, StudyResult
from ._rig_2 import amplitude_result, draw_amplitude

NUMBER = "8.18"
SPRING = "c"


def compute() -> StudyResult:
    """Amplitude over the speed, with its resonances, and the thesis's two harmonics beside it."""
    return amplitude_result(NUMBER, SPRING)


def draw(result: StudyResult) -> Figure:
    """Amplitude over the speed, the natural frequency and its half marked."""
    return draw_amplitude(result, SPRING)


STUDY = Study(NUMBER, compute, draw)
