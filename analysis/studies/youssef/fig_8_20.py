"""Fig 8.20: harmonics of the slider's motion over the speed, rig 2.

The periodic motion of Fig 8.18 and 8.19 taken apart into harmonics of the crank's turn. With so short a crank it is nearly
the first harmonic alone, but about half the natural frequency, where the second overtakes it; at resonance the second is a
hundredth of the first. The thesis's two harmonics of the linear equation, the points, give both; the third, which they
leave out, is a sixth of the first at most, about a third of the natural frequency.

The captions are lost: that this stands under this number of 8.18 to 8.21 is our assignment.
"""

from __future__ import annotations

import numpy as np

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ..study import ASSIGNED, OURS, Study, StudyResult, at_most, near, padded
from ._orbits import ORDERS, highest, orbit, rpm
from ._rig_2 import FASTEST, SLOWEST, motions, natural_speed, resonance, rig_2, thesis_motion

NUMBER = "8.20"
SPRINGS = ("c", "d")
#: Step of the points by two harmonics (rpm).
STEP = 40.0


def compute() -> StudyResult:
    """The first three harmonics, both springs, and two of them by the linear equation."""
    columns, verdicts = {}, []
    for spring in SPRINGS:
        name, natural = f"spring {spring.upper()}", natural_speed(spring)
        branch = motions(spring).branches[0]
        table, speeds = branch.columns(), rpm(branch)
        columns[f"speed; {name} [rpm]"] = speeds
        for order in ORDERS:
            amplitude = CM_PER_METRE * table[f"harmonic {order} of u [m]"]
            columns[f"harmonic {order}; {name} [cm]"] = amplitude
            within = np.abs(speeds * order / natural - 1.0) < 0.05
            place = order * highest(speeds[within], amplitude[within]) / natural
            statement = f"harmonic {order} is greatest, over natural frequency / {order}; {name}"
            verdicts.append(near(statement, OURS, 1.0, place, 0.02))
        points = np.arange(SLOWEST, FASTEST + 1.0, STEP)
        columns[f"speed; two harmonics; {name} [rpm]"] = points
        turns = [orbit(rig_2(spring), speed).turn() for speed in points.tolist()]
        motion = [thesis_motion(spring, speed) for speed in points.tolist()]
        length = CM_PER_METRE * rig_2(spring).rocker_length
        for order, limit in ((1, 0.02), (2, 0.1)):
            found = length * np.array([one.harmonic(order) for one in motion])
            columns[f"harmonic {order} by two harmonics; {name} [cm]"] = found
            true = np.array([turn.harmonic("slider.position", order) for turn in turns]) * CM_PER_METRE
            error = float(np.abs(found / true - 1.0).max())
            statement = f"error of harmonic {order} by two harmonics, relative; {name}"
            verdicts.append(at_most(statement, OURS, limit, error))
        at = float(resonance(spring)[0])
        second, first = (np.interp(at, speeds, columns[f"harmonic {order}; {name} [cm]"]) for order in (2, 1))
        verdicts.append(at_most(f"harmonic 2 over harmonic 1 at resonance; {name}", OURS, 0.02, second / first))
    return StudyResult(
        number=NUMBER,
        claim="Near resonance and near half of it two harmonics make the motion.",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The harmonics, one panel a spring."""
    panels = []
    for spring in SPRINGS:
        name, natural, last = f"spring {spring.upper()}", natural_speed(spring), spring == SPRINGS[-1]
        speed, points = (result.columns[f"speed; {part}{name} [rpm]"] for part in ("", "two harmonics; "))
        curves = [
            Curve(
                x=speed,
                y=result.columns[f"harmonic {order}; {name} [cm]"],
                label=f"harmonic {order}" if last else "",
                colour=colour,
            )
            for order, colour in zip(ORDERS, COLOURS)
        ]
        curves += [
            Curve(
                x=points,
                y=result.columns[f"harmonic {order} by two harmonics; {name} [cm]"],
                label=f"harmonic {order}, linear equation" if last else "",
                line="",
                marker="o",
                colour=colour,
            )
            for order, colour in zip((1, 2), COLOURS)
        ]
        panels.append(
            Panel(
                x_label="crank speed [rpm]",
                y_label="amplitude of the harmonic [cm]",
                title=name,
                curves=curves,
                verticals={
                    f"{label}{natural / n:.0f}": natural / n
                    for n, label in ((1, "natural, "), (2, "half, "), (3, "a third, "))
                },
                legend_at="outside",
                logarithmic="y",
                x_range=(SLOWEST, FASTEST),
                y_range=(1e-5, 3e1),
            )
        )
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 4.0))


STUDY = Study(NUMBER, compute, draw)
