"""Fig 8.19: amplitude of rig 2 with spring D over the speed.

The thesis measures a natural frequency of 825 rpm; the mean effective mass gives 828.0, and the ratio to spring C's can be
nothing but the root of 2. The amplitude is greatest, 2.43 cm, at 828.0, with a local maximum of 1.10 mm at 415.3. Spring D
is twice as stiff and the damper the same: at resonance the excitation grows with the square of the speed and the damping
force with the speed, so that the greatest amplitude is about root 2 times that of spring C. Two harmonics are good to 0.1 %
at both, and fall short by up to 12 % about a third of the natural frequency.

The captions are lost: that this curve stands under this number of 8.18 to 8.21 is our assignment.
"""

from __future__ import annotations

from ...figures import Figure
from ..study import Study, StudyResult
from ._rig_2 import amplitude_result, draw_amplitude

NUMBER = "8.19"
SPRING = "d"


def compute() -> StudyResult:
    """Amplitude over the speed, with its resonances, and the thesis's two harmonics beside it."""
    return amplitude_result(NUMBER, SPRING)


def draw(result: StudyResult) -> Figure:
    """Amplitude over the speed, the natural frequency and its half marked."""
    return draw_amplitude(result, SPRING)


STUDY = Study(NUMBER, compute, draw)
