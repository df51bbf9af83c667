"""Fig 8.21: what the crank's drive and the pins of rig 2 carry over the speed.

Far below resonance the slider hardly moves, and every force of this horizontal machine grows with the square of the speed.
What resonance makes of that law differs from pin to pin: on the slider pin D 2.5 times as much with spring C and 3.4 times
with D, on the rocker pin C 1.6 and 2.1 times, on the crank pins A and B, which carry mostly the coupler's own inertia, 1.15
and 1.3 times. Above resonance all of them fall below the law, pin D to 0.4 of it. The crank torque's greatest value is 1.7
and 2.1 times the law's; its mean, which only feeds the damper, is next to nothing but at resonance, where it comes to a
quarter of the greatest. Even so the law wins: at 1300 rpm pin A carries 119 N, four times (C) and twice (D) what it does at
resonance.

The captions are lost: that this stands under this number of 8.18 to 8.21 is our assignment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import Branch
from ..study import ASSIGNED, OURS, Study, StudyResult, at_least, at_most, padded
from ._orbits import rpm
from ._rig_2 import FASTEST, SLOWEST, motions, natural_speed

NUMBER = "8.21"
SPRINGS = ("c", "d")
PINS = "ACD"
TORQUES = ("greatest crank torque", "mean crank torque")


def compute() -> StudyResult:
    """Crank torque and pin forces along the motions, and what resonance adds to the law of low speeds."""
    columns, verdicts = {}, []
    for spring in SPRINGS:
        name, branch = f"spring {spring.upper()}", motions(spring).branches[0]
        table, speeds = branch.columns(), rpm(branch)
        columns[f"speed; {name} [rpm]"] = speeds
        for torque in TORQUES:
            columns[f"{torque}; {name} [N.m]"] = table[f"{torque} [N.m]"]
        for pin in PINS:
            columns[f"greatest force in pin {pin}; {name} [N]"] = table[f"greatest force in pin {pin} [N]"]
        added = {pin: amplification(branch, table[f"greatest force in pin {pin} [N]"]) for pin in PINS}
        for pin, factor in added.items():
            columns[f"force in pin {pin} over the law of low speeds; {name} [1]"] = factor
        near_resonance = np.abs(speeds / natural_speed(spring) - 1.0) < 0.1
        at_d = added["D"][near_resonance].max()
        others = max(added[pin][near_resonance].max() for pin in "AC")
        verdicts += [
            at_least(f"pin D at resonance over the law of low speeds; {name}", OURS, 1.0, at_d),
            at_most(f"the same of pins A and C; {name}", OURS, at_d, others),
            at_most(f"pin D at {FASTEST:g} rpm over the law of low speeds; {name}", OURS, 1.0, added["D"][-1]),
            at_most(
                f"mean crank power less what the damper takes, relative; {name}", OURS, 1e-8, power_balance(branch)
            ),
        ]
    return StudyResult(
        number=NUMBER,
        claim="The pins carry most near resonance (nothing of it is stated in the text).",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def amplification(branch: Branch, force: NDArray[np.float64]) -> NDArray[np.float64]:
    """A force along a branch over what it would be if it grew with the square of the speed from the branch's low end."""
    return np.asarray(force / (force[0] * (branch.parameter / branch.parameter[0]) ** 2))


def power_balance(branch: Branch) -> float:
    """Mean power at the crank less the damper's, relative to the greatest torque's; the greatest along a branch."""
    damping = branch.family.parameters.slider_damping
    worst = 0.0
    for speed, turn in zip(branch.parameter, (orbit.turn() for orbit in branch.orbits)):
        torque = turn["drive.applied_torque"]
        taken = damping * float(np.mean(turn["slider.velocity"] ** 2))
        worst = max(worst, abs(float(torque.mean()) - taken / speed) / float(np.abs(torque).max()))
    return worst


def draw(result: StudyResult) -> Figure:
    """Torque above, pin forces below, one column a spring; dotted the law of low speeds."""
    torques, forces = [], []
    for spring in SPRINGS:
        name = f"spring {spring.upper()}"
        speed = result.columns[f"speed; {name} [rpm]"]
        law = (speed / speed[0]) ** 2
        carried = {torque: result.columns[f"{torque}; {name} [N.m]"] for torque in TORQUES}
        lines = [
            Curve(x=speed, y=values, label=torque.split()[0], colour=colour)
            for (torque, values), colour in zip(carried.items(), COLOURS)
        ]
        greatest = carried[TORQUES[0]][0] * law
        lines.append(Curve(x=speed, y=greatest, label="speed squared", line=":", colour=COLOURS[0]))
        torques.append(_panel(spring, "crank torque [N.m]", lines, 0.9))
        lines = []
        for pin, colour in zip(PINS, COLOURS):
            force = result.columns[f"greatest force in pin {pin}; {name} [N]"]
            lines.append(Curve(x=speed, y=force, label="A and B" if pin == "A" else pin, colour=colour))
            lines.append(Curve(x=speed, y=force[0] * law, line=":", colour=colour))
        lines.append(Curve(x=[], y=[], label="speed squared", line=":", colour="0.35"))
        forces.append(_panel(spring, "greatest pin force [N]", lines, 150.0, "pin"))
    return plot_curves([*torques, *forces], title=result.heading, columns=2, size=(4.9, 3.5))


def _panel(spring: str, y_label: str, lines: list[Curve], top: float, legend: str = "") -> Panel:
    natural = natural_speed(spring)
    return Panel(
        x_label="crank speed [rpm]",
        y_label=y_label,
        title=f"spring {spring.upper()}",
        curves=lines,
        verticals={f"natural, {natural:.0f}": natural},
        legend=legend,
        legend_at="upper left",
        x_range=(SLOWEST, FASTEST),
        y_range=(0.0, top),
    )


STUDY = Study(NUMBER, compute, draw)
