"""Fig 8.17: what Coulomb friction in the guide does to the amplitude.

The amplitudes that the thesis measures and computes differ, and it blames the Coulomb friction of the guide, which its
equations leave out. Its measurements are not in the text; what can be asked is whether friction acts as it must. We add a
level of 1, 2 and 5 N to rig 1 with spring A. It lowers all maxima, the one at half the natural frequency far more than
its share. The resonance moves up, from 574 rpm towards the natural frequency of small swings, 592, since smaller swings
meet less of the mechanism's nonlinearity. The captions are lost: that this stands under this number of 8.14 to 8.17 is our
assignment.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

from ..figures import Panel, plot_curves
from ._rig_1 import natural_speed, sweep
from ._runs import SETTLING_TIME
from .study import ASSIGNED, BALANCE, Study, StudyResult, at_least, at_most, curves_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMBER = "8.17"

#: Levels of friction (N).
LEVELS = (0.0, 1.0, 2.0, 5.0)
#: Step of the speeds (rpm) and time to settle (s): friction makes the equations stiff, and settles the motion
#: to within the creep of its regularised law.
STEP, TIME = 10, 4.0


def compute() -> StudyResult:
    """Amplitude over the speed with each level of friction."""
    runs = {level: sweep("a", level, STEP, TIME if level else SETTLING_TIME) for level in LEVELS}
    speed = runs[0.0].speed_rpm
    peaks = np.array([run.amplitude_cm.max() for run in runs.values()])
    half = (speed > 250.0) & (speed < 350.0)
    half_peaks = np.array([run.amplitude_cm[half].max() for run in runs.values()])
    places = np.array([run.highest_near(500, 700) for run in runs.values()])
    columns = {"speed [rpm]": speed}
    columns |= {f"amplitude; friction {level:g} N [cm]": run.amplitude_cm for level, run in runs.items()}
    return StudyResult(
        number=NUMBER,
        claim="Coulomb friction in the guide makes the measured amplitudes differ from the computed ones.",
        assignment=ASSIGNED,
        columns=columns,
        verdicts=(
            at_least("drop of the greatest amplitude per level, least", BALANCE, 0.0, -np.diff(peaks).max(), "cm"),
            at_most(
                "what 5 N leave of the maximum at half the natural frequency, relative to what they leave at resonance",
                BALANCE,
                1.0,
                half_peaks[-1] / half_peaks[0] * peaks[0] / peaks[-1],
            ),
            at_least("rise of the resonance by 5 N", BALANCE, 0.0, places[-1] - places[0], "rpm"),
            at_most(
                "change of u from one turn to the next",
                BALANCE,
                1e-3,
                max(run.change_cm for run in runs.values()),
                "cm",
            ),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Amplitude over the speed, one curve a level."""
    natural = natural_speed("a")
    panel = Panel(
        x_label="crank speed [rpm]",
        y_label="amplitude of u [cm]",
        curves=curves_of(
            result, "speed [rpm]", {f"amplitude; friction {level:g} N [cm]": f"{level:g} N" for level in LEVELS}
        ),
        verticals={f"half of it, {natural / 2:.0f}": natural / 2, f"natural frequency, {natural:.0f}": natural},
        legend="Coulomb friction",
        legend_at="upper right",
        x_range=(100.0, 1200.0),
        y_range=(0.0, 4.5),
    )
    return plot_curves([panel], title=result.heading)


STUDY = Study(NUMBER, compute, draw)
main = STUDY.main

if __name__ == "__main__":
    main(*sys.argv[1:])
