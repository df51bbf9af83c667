"""The runs behind the figures, each made once however many figures show it.

Parameters come in the thesis's units (dyn/cm, dyn.s/cm, dyn.cm, rpm), as its text names them; results are in cm, degrees,
turns, rad/s and N.m.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import asin, ceil, pi

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.published import (
    CM_PER_METRE,
    DYN_CM_PER_NEWTON_METRE,
    DYN_PER_CM_PER_NEWTON_PER_METRE,
    RAD_S_PER_RPM,
    SETS,
    TABLE_3_1,
)

from ...run import Event, Inputs, TorsionBar, Trajectory, simulate

#: Transmission at which the coupler and the rocker count as collinear: |sin(th4 - th3)|.
COLLINEAR_SINE = 0.3
#: Crank speed of chapter III (rpm).
SPEED = 420.0
#: Dampings of Fig 3.2 and 3.3 (dyn.s/cm).
DAMPINGS = (1e4, 5e4, 1e5, 5e5, 1e6)
#: Springs of Fig 3.4 to 3.14 (dyn/cm).
STIFFNESSES = (5e5, 1e6, 2e6)
#: Torques of Fig 3.6 to 3.10 (dyn.cm).
TORQUES = (1e7, 1e8, 2e8)
#: Turns over which the drift is followed.
DRIFT_TURNS = 40
SAMPLES_PER_DRIFT_TURN = 120
#: How long a motion is given to become steady (s).
SETTLING_TIME = 8.0
#: How long the launch and the free motion are followed (s).
LAUNCH_TIME, COAST_TIME = 0.5, 2.0


def table_3_1(stiffness: float, damping: float = 3e4, gravity: float = 9.81) -> FiveBarParameters:
    """The mechanism of Table 3.1 with a spring (dyn/cm), a damper (dyn.s/cm) and gravity (m/s2)."""
    return replace(
        TABLE_3_1,
        slider_stiffness=stiffness / DYN_PER_CM_PER_NEWTON_PER_METRE,
        slider_damping=damping / DYN_PER_CM_PER_NEWTON_PER_METRE,
        gravity=gravity,
    )


def rig_1(spring: str, friction: float = 0.0) -> FiveBarParameters:
    """Rig 1 with spring ``a`` or ``b``, and Coulomb friction in the guide (N)."""
    parameters: FiveBarParameters = SETS[f"rig-1-spring-{spring}"].parameters
    return replace(parameters, slider_coulomb_friction=friction)


def plain(value: float) -> str:
    """A value as the thesis's tables are quoted here and in the CSV headers: 5e5."""
    return f"{value:.0e}".replace("e+0", "e")


def scientific(value: float) -> str:
    """The same in print: 5 times a power of ten, a leading 1 left out."""
    digits, exponent = plain(value).split("e")
    power = "10" + exponent.translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return power if digits == "1" else f"{digits}\N{MULTIPLICATION SIGN}{power}"


@dataclass(frozen=True, slots=True)
class Drift:
    """The slider without a spring: turns of the crank, slider position (cm), and the turn at which the links line up.

    ``collinear_turn`` is NaN if they never do.
    """

    turns: NDArray[np.float64]
    slider_cm: NDArray[np.float64]
    collinear_turn: float

    def per_turn(self, turn: int) -> float:
        """Drift over a turn (cm), the first being turn 1."""
        n = SAMPLES_PER_DRIFT_TURN
        return float(self.slider_cm[turn * n] - self.slider_cm[(turn - 1) * n])

    @property
    def until_collinear(self) -> NDArray[np.float64]:
        """Slider position until the links line up (cm), NaN from there on."""
        return np.where(self.turns > self.collinear_turn, np.nan, self.slider_cm)

    @property
    def growth(self) -> float:
        """Drift over the third turn relative to the first: 1 if it is linear."""
        return self.per_turn(3) / self.per_turn(1)


@cache
def drift(damping: float, gravity: float = 9.81) -> Drift:
    """Table 3.1 at 420 rpm without a spring; ends at the limit of assembly."""
    period = 60.0 / SPEED
    angle = asin(COLLINEAR_SINE)
    run = simulate(
        table_3_1(0.0, damping, gravity),
        Inputs(speed=SPEED * RAD_S_PER_RPM),
        stop_time=DRIFT_TURNS * period,
        step=period / SAMPLES_PER_DRIFT_TURN,
        events=(
            Event(name="folded", output="transmission.angle", level=angle, direction=-1),
            Event(name="stretched", output="transmission.angle", level=pi - angle, direction=1),
        ),
    )
    first = run.events[0].time / period if run.events else np.nan
    return Drift(run["crank.angle"] / (2.0 * pi), CM_PER_METRE * run["slider.position"], first)


@dataclass(frozen=True, slots=True)
class SteadyTurn:
    """One turn of the steady motion, samples at equal crank angles, the last at 360 deg.

    ``change`` is how much the slider position differs from the turn before at most (cm): how steady it is.
    """

    angle_deg: NDArray[np.float64]
    slider_cm: NDArray[np.float64]
    torque: NDArray[np.float64]
    change: float

    @property
    def amplitude(self) -> float:
        """Half the distance between the least and the greatest slider position (cm)."""
        return 0.5 * float(np.ptp(self.slider_cm))

    @property
    def peaks(self) -> int:
        """Highest and lowest points of the slider position over the turn, together."""
        rise = np.diff(self.slider_cm)
        return int(np.sum(np.sign(rise) != np.sign(np.roll(rise, 1))))

    def harmonic(self, order: int) -> float:
        """Amplitude of a harmonic of the crank's turn in the slider position (cm)."""
        return 2.0 * float(np.abs(np.fft.rfft(self.slider_cm[:-1])[order])) / (len(self.slider_cm) - 1)


@cache
def steady_turn(parameters: FiveBarParameters, speed_rpm: float, start: tuple[float, float] = (0.0, 0.0)) -> SteadyTurn:
    """The steady motion that a run ends in; from rest at u = 0, or from another (u, u') at crank angle 0 (m, m/s)."""
    period, samples = 60.0 / speed_rpm, 1440
    inputs = Inputs(speed=speed_rpm * RAD_S_PER_RPM)
    turns = ceil(SETTLING_TIME / period)
    settling = simulate(
        parameters,
        inputs,
        initial=InitialState(slider_position=start[0], slider_velocity=start[1]),
        stop_time=turns * period,
        step=turns * period,
    )
    assert not settling.status, "the published mechanisms stay assembled at the speeds of the figures"
    u, v = (float(settling[name][-1]) for name in ("slider.position", "slider.velocity"))
    run = simulate(
        parameters,
        inputs,
        initial=InitialState(slider_position=u, slider_velocity=v),
        stop_time=2.0 * period,
        step=period / samples,
    )
    u_cm = CM_PER_METRE * run["slider.position"]
    return SteadyTurn(
        np.linspace(0.0, 360.0, samples + 1),
        u_cm[samples:],
        run["drive.applied_torque"][samples:],
        float(np.abs(u_cm[samples:] - u_cm[: samples + 1]).max()),
    )


def least(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Place and value of the least of evenly spaced samples, by the parabola through it and its neighbours."""
    i = int(np.clip(np.argmin(y), 1, len(y) - 2))
    a, b, c = y[i - 1 : i + 2]
    shift = 0.5 * (a - c) / (a - 2.0 * b + c)
    return float(x[i] + shift * (x[i + 1] - x[i])), float(b - 0.25 * (a - c) * shift)


def greatest(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Place and value of the greatest of evenly spaced samples; see `least`."""
    place, value = least(x, -y)
    return place, -value


@cache
def launch(torque: float, stiffness: float) -> Trajectory:
    """Table 3.1 from rest under T = T0 (1 - th2) up to 1 rad, then none; T0 in dyn.cm. Its event is the release."""
    return simulate(
        table_3_1(stiffness),
        Inputs(torque=TorsionBar(torque=torque / DYN_CM_PER_NEWTON_METRE)),
        stop_time=LAUNCH_TIME,
        step=5e-4,
        events=(Event(name="release", output="crank.angle", level=1.0, direction=1),),
    )


@cache
def coast(stiffness: float) -> Trajectory:
    """Table 3.1 left to itself at 420 rpm, th2 = u = u' = 0."""
    return simulate(table_3_1(stiffness), initial=SETS["table-3.1"].initial, stop_time=COAST_TIME, step=5e-4)
