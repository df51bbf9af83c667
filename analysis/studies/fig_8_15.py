"""Fig 8.15: amplitude of rig 1 with spring B over the speed.

The thesis takes 1160 rpm as the natural frequency, twice that of spring A; but the springs are as 11 to 3, so that the
natural frequencies are as 1.915 to 1, whatever the effective mass: 1133 rpm. The local maximum at half of it is at 564 rpm.

The curve has more to it than the text tells. Near resonance the amplitude is so large that the motion is no longer linear,
and two steady motions exist side by side between about 940 and 1035 rpm: runs from rest stay on the lower one and jump
above it, runs with falling speed stay on the upper one, at amplitudes that no rig would survive. The captions are lost:
that this curve stands under this number of 8.14 to 8.17 is our assignment.
"""

from __future__ import annotations

import sys
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from ..figures import COLOURS, Curve, Panel, plot_curves
from ._rig_1 import falling_sweep, natural_speed, steady_verdict, sweep
from .study import ASSIGNED, REFERENCE, THESIS, Study, StudyResult, near, padded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMBER = "8.15"


def compute() -> StudyResult:
    """Amplitude over the speed from rest and with falling speed."""
    runs, falling = sweep("b"), falling_sweep("b")
    natural = natural_speed("b")
    local_maximum = runs.highest_near(500, 650)
    columns = {
        "speed [rpm]": runs.speed_rpm,
        "amplitude from rest [cm]": runs.amplitude_cm,
        "falling speed [rpm]": falling.speed_rpm,
        "amplitude with falling speed [cm]": falling.amplitude_cm,
    }
    return StudyResult(
        number=NUMBER,
        claim="The natural frequency is 1160 rpm, twice that of spring A; local maximum of the amplitude at 580.",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=(
            near("natural frequency", THESIS, 1160.0, natural, 5.0, "rpm"),
            near("natural frequency from the mean effective mass", REFERENCE, 1133.0, natural, 0.5, "rpm"),
            near("natural frequency relative to spring A's", THESIS, 2.0, natural / natural_speed("a"), 0.01),
            near("the same, sqrt(11/3)", REFERENCE, sqrt(11.0 / 3.0), natural / natural_speed("a"), 1e-9),
            near("speed of the local maximum", THESIS, 580.0, local_maximum, 5.0, "rpm"),
            near("speed of the local maximum", REFERENCE, 564.0, local_maximum, 0.5, "rpm"),
            steady_verdict(max(runs.change_cm, falling.change_cm)),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Amplitude over the speed, and the two motions near resonance."""
    natural = natural_speed("b")
    speed, amplitude = result.columns["speed [rpm]"], result.columns["amplitude from rest [cm]"]
    # no line along the jump
    jump = sweep("b").jump
    broken_speed, broken = np.insert(speed, jump, np.nan), np.insert(amplitude, jump, np.nan)
    rest = Curve(x=broken_speed, y=broken, label="from rest")
    falling = Curve(
        x=result.columns["falling speed [rpm]"],
        y=result.columns["amplitude with falling speed [cm]"],
        label="falling speed",
        line="--",
        colour=COLOURS[1],
    )
    panels = [
        Panel(
            x_label="crank speed [rpm]",
            y_label="amplitude of u [cm]",
            curves=[Curve(x=broken_speed, y=broken)],
            verticals={
                f"a third of the natural frequency, {natural / 3:.0f}": natural / 3,
                f"half of it, {natural / 2:.0f}": natural / 2,
            },
            x_range=(100.0, float(speed[jump - 1])),
            y_range=(0.0, 4.0),
        ),
        Panel(
            x_label="crank speed [rpm]",
            y_label="amplitude of u [cm]",
            curves=[rest, falling],
            verticals={f"natural frequency, {natural:.0f}": natural},
            x_range=(850.0, 1200.0),
            y_range=(0.0, 17.0),
            legend_at="center left",
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.6, 3.7))


STUDY = Study(NUMBER, compute, draw)
main = STUDY.main

if __name__ == "__main__":
    main(*sys.argv[1:])
