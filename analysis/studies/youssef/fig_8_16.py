"""Fig 8.16: why the amplitude of rig 1 has its maxima where it has them.

The periodic motion of Fig 8.14 and 8.15 taken apart into harmonics of the crank's turn, over the speed relative to the natural
frequency. The n-th harmonic is greatest near 1/n of the natural frequency with both springs: the maxima below resonance are
resonances of the second and the third harmonic of one and the same excitation. With spring B the curves end at the fold of
Fig 8.15.

The captions are lost: that this stands under this number of 8.14 to 8.17 is our assignment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import Figure, Panel, plot_curves
from ...periodic import Branch
from ..study import ASSIGNED, OURS, Study, StudyResult, at_most, curves_of, near, padded
from ._orbits import ORDERS, SAME, highest, orbit, rpm
from ._rig_1 import natural_speed, resonant_b, slow
from ._runs import rig_1, steady_turn

NUMBER = "8.16"
#: Speeds at which the harmonics are held against those of runs (rpm), by spring.
CHECKED = (("a", 200.0), ("a", 296.0), ("b", 378.0), ("b", 1000.0))


def harmonics(spring: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Speeds (rpm, shape (m,)) and harmonics of u (cm, shape (m, 3)), with spring B up to the fold."""
    parts: list[tuple[Branch, int | None]] = [(slow(spring).branches[0], None)]
    if spring == "b":
        lower = resonant_b().branches[0]
        parts.append((lower, lower.special[0].after + 1))
    speeds = np.concatenate([rpm(branch)[:end] for branch, end in parts])
    tables = [(branch.columns(), end) for branch, end in parts]
    amplitudes = [np.concatenate([table[f"harmonic {n} of u [m]"][:end] for table, end in tables]) for n in ORDERS]
    return speeds, CM_PER_METRE * np.column_stack(amplitudes)


def compute() -> StudyResult:
    """The first three harmonics over the relative speed, both springs."""
    columns, verdicts = {}, []
    for spring in ("a", "b"):
        speeds, amplitudes = harmonics(spring)
        ratio = speeds / natural_speed(spring)
        columns[f"speed over natural frequency; spring {spring.upper()} [1]"] = ratio
        for order, amplitude in zip(ORDERS, amplitudes.T):
            columns[f"harmonic {order}; spring {spring.upper()} [cm]"] = amplitude
            if order > 1:
                within = np.abs(ratio * order - 1.0) < 0.2
                place = order * highest(ratio[within], amplitude[within])
                statement = f"harmonic {order} is greatest, over natural frequency / {order}; spring {spring.upper()}"
                verdicts.append(near(statement, OURS, 1.0, place, 0.03))
    difference = max(
        abs(
            CM_PER_METRE * orbit(rig_1(spring), speed).turn().harmonic("slider.position", order)
            - steady_turn(rig_1(spring), speed).harmonic(order)
        )
        for spring, speed in CHECKED
        for order in ORDERS
    )
    return StudyResult(
        number=NUMBER,
        claim="The maxima below resonance lie at fractions of the natural frequency.",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=(
            *verdicts,
            at_most("difference of the harmonics between orbits and runs from rest", OURS, SAME, difference, "cm"),
        ),
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
