"""Simulation runs that several figures use, cached.

Parameters are in the thesis's units (dyn/cm, dyn.s/cm, dyn.cm, rpm), as its text gives them; results are in cm, degrees,
turns, rad/s and N.m.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.published import DYN_PER_CM_PER_NEWTON_PER_METRE, TABLE_3_1

from ...display import format_count
from ...run import Inputs, simulate
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import ALIKE
from ..statements import FloatArray
from ..variation import cache, vary

#: Crank speed of chapter III (rpm).
SPEED = 420.0
#: Time of a turn (s).
PERIOD = 60.0 / SPEED
#: Column of the crank rotation from the start.
TURNS = "turns of the crank [1]"
#: Springs of Fig 3.4 to 3.14 (dyn/cm).
STIFFNESSES = (5e5, 1e6, 2e6)
#: Tolerances in the words of statements.
ALIKE_WORDS, SIGN = f"{ALIKE:g}, the rule for what is steady, linear or the same", "none, the sign decides"
#: Time for a motion to become steady (s).
SETTLING_TIME = 8.0


def table_3_1(stiffness: float, damping: float = 3e4, gravity: float = 9.81) -> FiveBarParameters:
    """Return the parameters of Table 3.1 with this spring (dyn/cm), damper (dyn.s/cm) and gravity (m/s2).

    The reader's changes are applied last.
    """
    return vary(
        replace(
            TABLE_3_1,
            slider_stiffness=stiffness / DYN_PER_CM_PER_NEWTON_PER_METRE,
            slider_damping=damping / DYN_PER_CM_PER_NEWTON_PER_METRE,
            gravity=gravity,
        )
    )


def plain(value: float) -> str:
    """Format a value as in the thesis's tables and in CSV headers, such as 5e5."""
    return re.sub(r"\.?0*e\+0?", "e", f"{value:.3e}")


def scientific(value: float) -> str:
    """Format a value for a plot: a factor times a power of ten; a factor of 1 is omitted."""
    digits, exponent = plain(value).split("e")
    power = "10" + exponent.translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return power if digits == "1" else f"{digits}\N{MULTIPLICATION SIGN}{power}"


@dataclass(frozen=True, slots=True)
class SteadyTurn:
    """One turn of the steady motion, sampled at evenly spaced crank angles; the last is 360 deg.

    ``torque`` is the crank torque (N.m); ``change`` is the greatest difference of the slider position from the turn before
    (cm).
    """

    angle_deg: FloatArray
    slider_cm: FloatArray
    torque: FloatArray
    change: float

    @property
    def relative_change(self) -> float:
        """Return `change` relative to the range of u, to one digit, since it is an error of the integration."""
        return float(f"{self.change / np.ptp(self.slider_cm):.0e}")


@cache
def steady_turn(parameters: FiveBarParameters, speed_rpm: float, start: tuple[float, float] = (0.0, 0.0)) -> SteadyTurn:
    """Simulate until the motion is steady and return a turn; ``start`` is (u, u') at crank angle 0 (m, m/s)."""
    period, samples = 60.0 / speed_rpm, 1440
    inputs = Inputs(speed=speed_rpm * RAD_S_PER_RPM)
    turns = ceil(SETTLING_TIME / period)
    begun = InitialState(slider_position=start[0], slider_velocity=start[1])
    settling = simulate(parameters, inputs, initial=begun, stop_time=turns * period, step=turns * period)
    if settling.status:
        raise AssemblyError(f"the mechanism does not stay assembled at {speed_rpm:g} rpm: {settling.message}")
    u, v = (float(settling[name][-1]) for name in ("slider.position", "slider.velocity"))
    settled = InitialState(slider_position=u, slider_velocity=v)
    run = simulate(parameters, inputs, initial=settled, stop_time=2.0 * period, step=period / samples)
    u_cm = CM_PER_METRE * run["slider.position"]
    return SteadyTurn(
        np.linspace(0.0, 360.0, samples + 1),
        u_cm[samples:],
        run["drive.applied_torque"][samples:],
        float(np.abs(u_cm[samples:] - u_cm[: samples + 1]).max()),
    )


def least(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return abscissa and value of the minimum of evenly spaced samples, by a parabola.

    The parabola passes through the lowest sample and the samples beside it.
    """
    i = int(np.clip(np.argmin(y), 1, len(y) - 2))
    a, b, c = y[i - 1 : i + 2]
    shift = 0.5 * (a - c) / (a - 2.0 * b + c)
    return float(x[i] + shift * (x[i + 1] - x[i])), float(b - 0.25 * (a - c) * shift)


def greatest(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return abscissa and value of the maximum of evenly spaced samples, by a parabola; see `least`."""
    place, value = least(x, -y)
    return place, -value


def greatest_ratio(values: FloatArray) -> float:
    """Return the greatest ratio of a value to its predecessor; raise an InputError for fewer than two values."""
    if len(values) < 2:
        raise InputError(
            f"{format_count(len(values), 'turn')} to compare: there must be at least 2; change the parameters less"
        )
    return float((values[1:] / values[:-1]).max())


def distance_from_line(x: FloatArray, y: FloatArray) -> float:
    """Return the greatest distance in y between a curve from (0, 0) to (1, 1) and the best line parallel to its chord."""
    return 0.5 * float(np.ptp(y - x))
