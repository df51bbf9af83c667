"""Fig 8.14: amplitude of rig 1 with spring A over the speed.

The thesis compares this curve with its measurements. It puts the natural frequency at 580 rpm, the local maximum at half
of it at 290 and the minimum above that at 345. With the mean effective mass the natural frequency is 592 rpm; the maximum
is at 296 and the minimum at 367. The amplitude is greatest at 574 rpm, below the natural frequency: large swings meet more of
the mechanism's nonlinearity. There is one steady motion at every speed, stable everywhere, least so near 1050 rpm. The
measured amplitudes are not in the text; see Fig 8.17 for the friction that the thesis blames for the misfit.

The captions are lost: that this curve stands under this number of 8.14 to 8.17 is our assignment.
"""

from __future__ import annotations

import numpy as np

from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM

from ...figures import COLOURS, Figure, Panel, plot_curves
from ...periodic import sweep
from ..study import ASSIGNED, OURS, TEXT, Study, StudyResult, at_most, near
from ._orbits import SAME, between, columns_of, curves_over_speed, multiplier_verdict, runs_verdict
from ._rig_1 import FASTEST, SLOWEST, local_maximum, natural_speed, slow
from ._runs import rig_1

NUMBER = "8.14"
NAME = "spring A"


def compute() -> StudyResult:
    """Amplitude over the speed, with its natural frequency, maximum and minimum."""
    found, natural, highest = slow("a"), natural_speed("a"), local_maximum("a")
    lowest = between(found.minima(), 320.0, 420.0)[0]
    speeds = np.arange(SLOWEST, FASTEST + 1.0, 25.0) * RAD_S_PER_RPM
    rising, falling = (sweep(rig_1("a"), grid).amplitude for grid in (speeds, speeds[::-1]))
    difference = CM_PER_METRE * float(np.ma.abs(rising - falling[::-1]).filled(np.inf).max())
    return StudyResult(
        number=NUMBER,
        claim="The natural frequency is 580 rpm; local maximum of the amplitude at 290, minimum at 345.",
        assignment=ASSIGNED,
        columns=columns_of(found.branches[0], NAME),
        verdicts=(
            near("natural frequency", TEXT, 580.0, natural, 5.0, "rpm"),
            near("natural frequency from the mean effective mass", OURS, 592.0, natural, 0.5, "rpm"),
            near("speed of the local maximum", TEXT, 290.0, highest, 5.0, "rpm"),
            near("speed of the local maximum", OURS, 296.0, highest, 0.5, "rpm"),
            near("speed of the minimum", TEXT, 345.0, lowest, 5.0, "rpm"),
            near("speed of the minimum", OURS, 367.0, lowest, 0.5, "rpm"),
            runs_verdict(rig_1("a"), (200.0, 300.0, 574.0, 1000.0)),
            at_most("difference between sweeps with rising and falling speed", OURS, SAME, difference, "cm"),
            multiplier_verdict(found),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Amplitude over the speed, the natural frequency and its half marked."""
    natural = natural_speed("a")
    panel = Panel(
        x_label="crank speed [rpm]",
        y_label="amplitude of u [cm]",
        curves=curves_over_speed(result, NAME, COLOURS[0]),
        verticals={
            f"half of it, {natural / 2:.0f}": natural / 2,
            f"natural frequency, {natural:.0f}": natural,
        },
        x_range=(SLOWEST, FASTEST),
        y_range=(0.0, 4.5),
    )
    return plot_curves([panel], title=result.heading)


STUDY = Study(NUMBER, compute, draw)
