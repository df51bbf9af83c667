"""Fig 8.14: amplitude of rig 1 with spring A over the speed.

The thesis compares this curve with its measurements. It puts the natural frequency at 580 rpm, the local maximum at half
of it at 290 and the minimum above that at 345. With the mean effective mass the natural frequency is 592 rpm; the maximum
is at 296 and the minimum at 367. The measured amplitudes are not in the text; see Fig 8.17 for the friction that the thesis
blames for the misfit. The captions are lost: that this curve stands under this number of 8.14 to 8.17 is our assignment.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

from ..figures import Panel, plot_curves
from ._rig_1 import falling_sweep, natural_speed, steady_verdict, sweep
from .study import ASSIGNED, BALANCE, REFERENCE, THESIS, Study, StudyResult, at_most, curves_of, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMBER = "8.14"


def compute() -> StudyResult:
    """Amplitude over the speed, with its natural frequency, maximum and minimum."""
    runs, falling = sweep("a"), falling_sweep("a")
    natural = natural_speed("a")
    local_maximum, minimum = runs.highest_near(250, 350), runs.lowest_near(320, 420)
    other = np.interp(runs.speed_rpm, falling.speed_rpm, falling.amplitude_cm)
    shared = np.isin(runs.speed_rpm, falling.speed_rpm)
    difference = np.abs(other - runs.amplitude_cm)[shared].max()
    return StudyResult(
        number=NUMBER,
        claim="The natural frequency is 580 rpm; local maximum of the amplitude at 290, minimum at 345.",
        assignment=ASSIGNED,
        columns={"speed [rpm]": runs.speed_rpm, "amplitude [cm]": runs.amplitude_cm},
        verdicts=(
            near("natural frequency", THESIS, 580.0, natural, 5.0, "rpm"),
            near("natural frequency from the mean effective mass", REFERENCE, 592.0, natural, 0.5, "rpm"),
            near("speed of the local maximum", THESIS, 290.0, local_maximum, 5.0, "rpm"),
            near("speed of the local maximum", REFERENCE, 296.0, local_maximum, 0.5, "rpm"),
            near("speed of the minimum", THESIS, 345.0, minimum, 5.0, "rpm"),
            near("speed of the minimum", REFERENCE, 367.0, minimum, 0.5, "rpm"),
            steady_verdict(runs.change_cm),
            at_most("difference between runs from rest and with falling speed", BALANCE, 1e-4, difference, "cm"),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Amplitude over the speed, the natural frequency and its half marked."""
    natural = natural_speed("a")
    panel = Panel(
        x_label="crank speed [rpm]",
        y_label="amplitude of u [cm]",
        curves=curves_of(result, "speed [rpm]", {"amplitude [cm]": ""}),
        verticals={
            f"half of it, {natural / 2:.0f}": natural / 2,
            f"natural frequency, {natural:.0f}": natural,
        },
        x_range=(100.0, 1200.0),
        y_range=(0.0, 4.5),
    )
    return plot_curves([panel], title=result.heading)


STUDY = Study(NUMBER, compute, draw)
main = STUDY.main

if __name__ == "__main__":
    main(*sys.argv[1:])
