"""Fig 8.16: why the amplitude of rig 1 has its maxima where it has them.

The steady motion of Fig 8.14 and 8.15 taken apart into harmonics of the crank's turn, over the speed relative to the natural
frequency. The n-th harmonic is greatest near 1/n of the natural frequency with both springs: the maxima below resonance are
resonances of the second and the third harmonic of one and the same excitation. With spring B the curves end at the jump of
Fig 8.15. The captions are lost: that this stands
under this number of 8.14 to 8.17 is our assignment.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

from ..figures import Panel, plot_curves
from ._rig_1 import ORDERS, natural_speed, steady_verdict, sweep
from ._runs import greatest
from .study import ASSIGNED, BALANCE, Study, StudyResult, curves_of, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMBER = "8.16"


def compute() -> StudyResult:
    """The first three harmonics over the relative speed, both springs."""
    columns, verdicts = {}, []
    for spring in ("a", "b"):
        runs = sweep(spring)
        # spring B only up to the jump of Fig 8.15
        ratio = np.where(np.arange(len(runs.speed_rpm)) < runs.jump, runs.speed_rpm / natural_speed(spring), np.nan)
        columns[f"speed over natural frequency; spring {spring.upper()} [1]"] = ratio
        for order, amplitude in zip(ORDERS, runs.harmonics_cm.T):
            columns[f"harmonic {order}; spring {spring.upper()} [cm]"] = amplitude
            if order > 1:
                within = np.abs(ratio * order - 1.0) < 0.2
                place = order * greatest(ratio[within], amplitude[within])[0]
                statement = f"harmonic {order} is greatest, over natural frequency / {order}; spring {spring.upper()}"
                verdicts.append(near(statement, BALANCE, 1.0, place, 0.03))
    return StudyResult(
        number=NUMBER,
        claim="The maxima below resonance lie at fractions of the natural frequency.",
        assignment=ASSIGNED,
        columns=columns,
        verdicts=(*verdicts, steady_verdict(max(sweep("a").change_cm, sweep("b").change_cm))),
    )


def draw(result: StudyResult) -> Figure:
    """The harmonics, one panel a spring."""
    panels = [
        Panel(
            x_label="crank speed / natural frequency",
            y_label="amplitude of the harmonic [cm]",
            title=f"spring {spring}",
            curves=curves_of(
                result,
                f"speed over natural frequency; spring {spring} [1]",
                {f"harmonic {order}; spring {spring} [cm]": str(order) for order in ORDERS},
            ),
            verticals={"1": 1.0, "1/2": 1.0 / 2.0, "1/3": 1.0 / 3.0},
            legend="harmonic",
            legend_at="lower right",
            logarithmic="y",
            x_range=(0.15, 1.5),
            y_range=(3e-3, 10.0),
        )
        for spring in ("A", "B")
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.6, 3.7))


STUDY = Study(NUMBER, compute, draw)
main = STUDY.main

if __name__ == "__main__":
    main(*sys.argv[1:])
