"""How the crank shifts along its axis while it turns: laws of the shift for the force problems, on arrays.

The plant's functions on arrays are here too, as a groove's law is one of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import isfinite
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from linkwork import friction
from linkwork.errors import InputError, ParameterError
from linkwork.slider_crank import dynamics, kinematics, vectors
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters

from ..numerics.tracing import Rebound, rebound
from ..units import Amount, in_si
from . import mobility
from .quantities import FloatArray


@cache
def on_arrays() -> Rebound:
    """The plant's functions by name, for NumPy arrays and for what NumPy's functions work on (`analysis.numerics.dual`)."""
    elementary = {"sin": np.sin, "cos": np.cos, "sqrt": np.sqrt, "atan2": np.arctan2, "tanh": np.tanh}
    return rebound((friction, vectors, kinematics, dynamics), elementary)


class ShiftMotion(NamedTuple):
    """The axial shift (m) and its rates by time (m/s, m/s2)."""

    shift: Any
    velocity: Any
    acceleration: Any


@runtime_checkable
class ShiftLaw(Protocol):
    """How the crank shifts along its axis while it turns."""

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """Shift and its rates by time at crank angles (rad), speeds (rad/s) and accelerations (rad/s2) of one shape."""

    def repeating(self, parameters: SliderCrankParameters) -> mobility.PeriodicShift | None:
        """The law as `analysis.slider_crank.mobility` takes it; None if it is not known to repeat after whole turns."""


@in_si(value="m")
@dataclass(frozen=True, slots=True)
class ConstantShift:
    """The crank held at a shift S1 (m).

    Raises
    ------
    InputError
        If it is not finite.
    """

    value: Amount = 0.0

    def __post_init__(self) -> None:
        if not isfinite(self.value):
            raise InputError(f"the shift is {self.value!r} m: it must be a finite number")

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """See `ShiftLaw`."""
        zero = 0.0 * angle
        return ShiftMotion(self.value + zero, zero, zero)

    def repeating(self, parameters: SliderCrankParameters) -> mobility.PeriodicShift:
        """See `ShiftLaw`."""
        return mobility.constant_shift(self.value)


@in_si(amplitude="m")
@dataclass(frozen=True, slots=True)
class GrooveShift:
    """S1 = SS1 sin(alpha theta1), eq 28 (eq 28a prints S1 for SS1).

    Parameters
    ----------
    amplitude : float
        SS1 (m).
    ratio : float
        alpha, periods of the shift in a turn of the crank.
    in_shaft : bool
        Whether the groove is cut in the crank's shaft, so that the torque of the drive works against its flank: the groove of
        the plant and the FMU. By default, as in the thesis, something apart from the crank's drive moves the crank along.

    Raises
    ------
    InputError
        If a value is not finite.
    """

    amplitude: float
    ratio: float = 1.0
    in_shaft: bool = False

    def __post_init__(self) -> None:
        for name in ("amplitude", "ratio"):
            if not isfinite(getattr(self, name)):
                raise InputError(f"the groove's {name} is {getattr(self, name)!r}: it must be a finite number")

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """See `ShiftLaw`."""
        # all that the plant's function asks the constants for is amplitude and ratio
        shift, pitch, bend = on_arrays().groove(angle, self)
        return ShiftMotion(shift, pitch * speed, pitch * acceleration + bend * speed * speed)

    def repeating(self, parameters: SliderCrankParameters) -> mobility.PeriodicShift | None:
        """See `ShiftLaw`."""
        try:
            return mobility.groove_shift(
                replace(parameters, groove_amplitude=float(self.amplitude), groove_ratio=float(self.ratio))
            )
        except ParameterError:  # alpha is no ratio of small whole numbers
            return None


#: A function on arrays of angles or times.
ArrayFunction: TypeAlias = Callable[[FloatArray], ArrayLike]


@dataclass(frozen=True, slots=True)
class AngleShift:
    """A shift that is any function of the crank angle, with its first two derivatives.

    ``value``, ``slope`` and ``curvature`` take an array of angles (rad) and give m, m/rad and m/rad2.
    """

    value: ArrayFunction
    slope: ArrayFunction
    curvature: ArrayFunction

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """See `ShiftLaw`."""
        slope = np.asarray(self.slope(angle))
        return ShiftMotion(
            np.asarray(self.value(angle)),
            slope * speed,
            slope * acceleration + np.asarray(self.curvature(angle)) * speed * speed,
        )

    def repeating(self, parameters: SliderCrankParameters) -> None:
        """See `ShiftLaw`."""
        return None


@dataclass(frozen=True, slots=True)
class TimeShift:
    """A shift that is any function of time, with its first two derivatives, for a crank of constant speed.

    ``value``, ``velocity`` and ``acceleration`` take an array of times (s) and give m, m/s and m/s2. The time is 0 where the
    crank angle is.

    Raises
    ------
    InputError
        When it is evaluated at a speed that is zero or varies: give the law as an `AngleShift`.
    """

    value: ArrayFunction
    velocity: ArrayFunction
    acceleration: ArrayFunction

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """See `ShiftLaw`."""
        w = np.unique(speed)
        if w.size != 1 or w[0] == 0.0 or np.any(acceleration):
            raise InputError(
                "a shift by time needs a crank speed that is constant and not 0 rad/s, to tell the time of each angle; "
                "give the law by the angle"
            )
        time = angle / w[0]
        return ShiftMotion(*(np.asarray(f(time)) for f in (self.value, self.velocity, self.acceleration)))

    def repeating(self, parameters: SliderCrankParameters) -> None:
        """See `ShiftLaw`."""
        return None


def in_the_shaft(law: ShiftLaw) -> bool:
    """Whether a groove in the crank's shaft makes the shift."""
    return isinstance(law, GrooveShift) and law.in_shaft


def with_groove(p: Constants, law: ShiftLaw) -> Constants:
    """The constants with the groove of the law, where it is one."""
    return p._replace(amplitude=law.amplitude, ratio=law.ratio) if isinstance(law, GrooveShift) else p
