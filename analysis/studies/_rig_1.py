"""What Fig 8.7 to 8.17 share: the steady motion of rig 1 over the crank speed.

The amplitude is half the distance between the least and the greatest slider position over a turn of the steady motion. A
steady motion is run to from rest, or from that of the neighbouring speed, for eight seconds. The damper alone would
bring a deviation down by exp(-46) in that time; it takes longest with spring A at 1050 rpm, where the periodic effective
mass comes near to unsettling the motion. How much the last two turns differ goes with every result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import pi, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import RAD_S_PER_RPM

from ..figures import Panel, plot_curves
from ..inputs import Inputs
from ..simulate import simulate_many
from ._runs import SETTLING_TIME, SteadyTurn, greatest, last_turn, least, rig_1, settle, steady_turn
from .study import ASSIGNED, BALANCE, StudyResult, Verdict, at_most, curves_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Speeds of the sweeps (rpm).
SLOWEST, FASTEST, SPEED_STEP = 100, 1200, 5
#: Highest order of the harmonics kept.
ORDERS = (1, 2, 3)
#: Change from turn to turn (cm) up to which a motion counts as steady.
STEADY = 1e-4


@dataclass(frozen=True, slots=True)
class Sweep:
    """Steady motions over the speed: rpm, amplitudes (cm), of the first harmonics too, shape (n, 3), and their change (cm)."""

    speed_rpm: NDArray[np.float64]
    amplitude_cm: NDArray[np.float64]
    harmonics_cm: NDArray[np.float64]
    change_cm: float

    @property
    def jump(self) -> int:
        """Sample from which on the amplitude has jumped to another motion, by a half and more; their number if never."""
        jumps = np.flatnonzero(self.amplitude_cm[1:] > 1.5 * self.amplitude_cm[:-1])
        return int(jumps[-1]) + 1 if len(jumps) else len(self.amplitude_cm)

    def highest_near(self, low: float, high: float) -> float:
        """Speed of the greatest amplitude between two speeds (rpm)."""
        within = (self.speed_rpm >= low) & (self.speed_rpm <= high)
        return greatest(self.speed_rpm[within], self.amplitude_cm[within])[0]

    def lowest_near(self, low: float, high: float) -> float:
        """Speed of the least amplitude between two speeds (rpm)."""
        within = (self.speed_rpm >= low) & (self.speed_rpm <= high)
        return least(self.speed_rpm[within], self.amplitude_cm[within])[0]


def _gather(speeds: Sequence[float], turns: Sequence[SteadyTurn]) -> Sweep:
    return Sweep(
        np.array(speeds),
        np.array([turn.amplitude for turn in turns]),
        np.array([[turn.harmonic(order) for order in ORDERS] for turn in turns]),
        max(turn.change for turn in turns),
    )


@cache
def sweep(spring: str, friction: float = 0.0, step: int = SPEED_STEP, time: float = SETTLING_TIME) -> Sweep:
    """Steady motions that runs from rest at u = 0 end in after a time (s), every ``step`` rpm, with Coulomb friction (N)."""
    parameters = rig_1(spring, friction)
    speeds = np.arange(SLOWEST, FASTEST + 1, step, dtype=float).tolist()
    settled = simulate_many(
        [parameters] * len(speeds),
        [Inputs(speed=speed * RAD_S_PER_RPM) for speed in speeds],
        stop_time=time,
        step=time,
    ).states[:, -1]
    turns = [last_turn(parameters, speed, (x[1], x[3]), crank_angle=x[0]) for speed, x in zip(speeds, settled)]
    return _gather(speeds, turns)


@cache
def falling_sweep(spring: str, step: int = 10) -> Sweep:
    """Steady motions met as the speed falls step by step, each run from the last, as far as they go."""
    parameters = rig_1(spring)
    speeds, turns = [], []
    start = (0.0, 0.0)
    for speed in np.arange(FASTEST, SLOWEST - 1, -step, dtype=float).tolist():
        settled = settle(parameters, speed, start)
        if settled is None:
            break
        turn = last_turn(parameters, speed, settled)
        if turn.change > STEADY:
            break
        start = settled
        speeds.append(speed)
        turns.append(turn)
    return _gather(speeds[::-1], turns[::-1])


def mean_effective_mass(parameters: FiveBarParameters) -> float:
    """Mean over a turn of what moves with the slider at u = 0, m22 (kg)."""
    p = parameters.constants()
    masses = []
    for th2 in np.linspace(0.0, 2.0 * pi, 720, endpoint=False).tolist():
        g = kinematics.position(th2, 0.0, p)
        masses.append(dynamics.inertia(g, kinematics.coefficients(g, p), p).m22)
    return float(np.mean(masses))


@cache
def natural_speed(spring: str) -> float:
    """Crank speed at the slider's natural frequency with the mean effective mass (rpm)."""
    parameters = rig_1(spring)
    return sqrt(parameters.slider_stiffness / mean_effective_mass(parameters)) / RAD_S_PER_RPM


@cache
def speed_of_fewer_peaks(spring: str, low: float, high: float) -> float:
    """Speed above which the slider has two peaks a turn instead of four (rpm), to 0.1 rpm."""
    while high - low > 0.1:
        middle = 0.5 * (low + high)
        if steady_turn(rig_1(spring), middle).peaks > 2:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def turns_result(number: str, claim: str, spring: str, speeds: Sequence[float], *verdicts: Verdict) -> StudyResult:
    """The steady turns at several speeds (rpm) as the result of a study."""
    turns = {speed: steady_turn(rig_1(spring), float(speed)) for speed in speeds}
    columns = {"crank angle [deg]": next(iter(turns.values())).angle_deg}
    columns |= {f"slider position u at {speed:g} rpm [cm]": turn.slider_cm for speed, turn in turns.items()}
    change = max(turn.change for turn in turns.values())
    return StudyResult(
        number=number,
        claim=claim,
        assignment=ASSIGNED,
        columns=columns,
        verdicts=(*verdicts, steady_verdict(change)),
    )


def steady_verdict(change: float) -> Verdict:
    """That the motions are steady."""
    return at_most("change of u from one turn to the next", BALANCE, STEADY, change, "cm")


def draw_turns(result: StudyResult) -> Figure:
    """The turns over the crank angle."""
    names = {name: name.split(" at ")[1].split(" [")[0] for name in result.columns if " at " in name}
    panel = Panel(
        x_label="crank angle [deg]",
        y_label="slider position u [cm]",
        curves=curves_of(result, "crank angle [deg]", names),
        legend_at="outside",
        x_range=(0.0, 360.0),
        x_ticks=range(0, 361, 45),
    )
    return plot_curves([panel], title=result.heading)
