"""Define laws of the crank's axial shift, on arrays, and find dead centres and limits of assembly along a law.

`plant_functions` is also here, because the law of a groove is one of the plant's functions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import ceil, isfinite, tau
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from linkwork import friction
from linkwork.errors import InputError, ParameterError
from linkwork.limits import LIMIT_SINE
from linkwork.slider_crank import dynamics, kinematics, parameters, vectors
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters

from ..numerics.tracing import ReboundFunctions, rebind_functions
from ..units import Amount, in_si
from . import mobility
from .mobility import DeadCentre
from .quantities import FloatArray

#: Modules of the slider-crank's equations and of their constants.
MODULES = parameters, friction, vectors, kinematics, dynamics


@cache
def plant_functions() -> ReboundFunctions:
    """Return the slider-crank's equations of `linkwork`, for NumPy arrays and for dual numbers (`analysis.numerics.dual`)."""
    elementary = {"sin": np.sin, "cos": np.cos, "sqrt": np.sqrt, "atan2": np.arctan2, "tanh": np.tanh}
    return rebind_functions(MODULES, elementary)


class ShiftMotion(NamedTuple):
    """The axial shift (m) and its rates (m/s, m/s2)."""

    shift: Any
    velocity: Any
    acceleration: Any


@runtime_checkable
class ShiftLaw(Protocol):
    """Interface of a law: the crank's axial shift as a function of its angle, or of time at constant speed."""

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """Return shift and rates at crank angles (rad) with speeds (rad/s) and accelerations (rad/s2) of the same shape."""

    def periodic_shift(self, parameters: SliderCrankParameters) -> mobility.PeriodicShift | None:
        """Return the law as `mobility.PeriodicShift`; None if it is not known to repeat after whole turns."""


@in_si(value="m")
@dataclass(frozen=True, slots=True)
class ConstantShift:
    """The law of a crank that is held at a constant shift S1 (m).

    Raises
    ------
    InputError
        If the shift is not finite.
    """

    value: Amount = 0.0

    def __post_init__(self) -> None:
        if not isfinite(self.value):
            raise InputError(f"the shift is {self.value!r} m: it must be a finite number")

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """Return shift and rates; see `ShiftLaw.at`."""
        zero = 0.0 * angle
        return ShiftMotion(self.value + zero, zero, zero)

    def periodic_shift(self, parameters: SliderCrankParameters) -> mobility.PeriodicShift:
        """Return the law as `mobility.PeriodicShift`."""
        return mobility.constant_shift(self.value)


@in_si(amplitude="m")
@dataclass(frozen=True, slots=True)
class GrooveShift:
    """The law of a groove, S1 = SS1 sin(alpha theta1), eq 28 (eq 28a prints S1 for SS1).

    Parameters
    ----------
    amplitude : float
        SS1 (m).
    ratio : float
        alpha, periods of the shift per turn of the crank.
    in_shaft : bool
        Whether the groove is cut in the crank's shaft, so that the crank's torque also moves the shift, as in the FMU. By
        default, as in the thesis, the shift has a drive of its own.

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
        """Return shift and rates; see `ShiftLaw.at`."""
        # the plant's function uses only amplitude and ratio of the constants
        return groove_motion(plant_functions(), self, angle, speed, acceleration)

    def periodic_shift(self, parameters: SliderCrankParameters) -> mobility.PeriodicShift | None:
        """Return the law as `mobility.PeriodicShift`; None if alpha is not a ratio of small whole numbers."""
        try:
            return mobility.groove_shift(
                replace(parameters, groove_amplitude=float(self.amplitude), groove_ratio=float(self.ratio))
            )
        except ParameterError:  # alpha is not a ratio of small whole numbers
            return None


#: A function on arrays of angles or times.
ArrayFunction: TypeAlias = Callable[[FloatArray], ArrayLike]


@dataclass(frozen=True, slots=True)
class AngleShift:
    """A shift given as a function of the crank angle with its first two derivatives.

    ``value``, ``slope`` and ``curvature`` take an array of angles (rad) and give m, m/rad and m/rad2.
    """

    value: ArrayFunction
    slope: ArrayFunction
    curvature: ArrayFunction

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """Return shift and rates; see `ShiftLaw.at`."""
        value, slope, bend = (np.asarray(f(angle)) for f in (self.value, self.slope, self.curvature))
        return ShiftMotion(value, slope * speed, slope * acceleration + bend * speed * speed)

    def periodic_shift(self, parameters: SliderCrankParameters) -> None:
        """Return None: the law need not repeat after whole turns."""
        return None


@dataclass(frozen=True, slots=True)
class TimeShift:
    """A shift given as a function of time with its first two derivatives, for a crank of constant speed.

    ``value``, ``velocity`` and ``acceleration`` take an array of times (s) and give m, m/s and m/s2. The time is 0 when the
    crank angle is 0.

    Raises
    ------
    InputError
        If the law is evaluated at a crank speed that is zero or varies; use an `AngleShift` instead.
    """

    value: ArrayFunction
    velocity: ArrayFunction
    acceleration: ArrayFunction

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        """Return shift and rates; see `ShiftLaw.at`."""
        w = np.unique(speed)
        if w.size != 1 or w[0] == 0.0 or np.any(acceleration):
            raise InputError(
                "a shift given over time needs a constant crank speed other than 0 rad/s, which gives the time of each angle; "
                "use an AngleShift instead"
            )
        time = angle / w[0]
        return ShiftMotion(*(np.asarray(f(time)) for f in (self.value, self.velocity, self.acceleration)))

    def periodic_shift(self, parameters: SliderCrankParameters) -> None:
        """Return None: the law need not repeat after whole turns."""
        return None


def groove_motion(f: ReboundFunctions, p: Any, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
    """Return shift and rates by the groove with ``amplitude`` and ``ratio`` of ``p``; ``f`` are the plant's equations."""
    shift, pitch, bend = f.groove(angle, p)
    return ShiftMotion(shift, pitch * speed, pitch * acceleration + bend * speed * speed)


def has_shaft_groove(law: ShiftLaw) -> bool:
    """Return whether the shift is made by a groove in the crank's shaft."""
    return isinstance(law, GrooveShift) and law.in_shaft


def with_groove(p: Constants, law: ShiftLaw) -> Constants:
    """Return the constants ``p`` with amplitude and ratio of a `GrooveShift`; for any other law return ``p`` unchanged."""
    return p._replace(amplitude=law.amplitude, ratio=law.ratio) if isinstance(law, GrooveShift) else p


# Special configurations along a law

#: Pieces of a turn in the search for sign changes, if the law need not repeat; two zeros in one piece are not found.
_PIECES = 1440


@dataclass(frozen=True, slots=True)
class Course:
    """A mechanism whose shift follows a law over the crank angle.

    ``speed`` is the crank speed (rad/s). It matters only if the shift is a function of time.
    """

    parameters: SliderCrankParameters
    law: ShiftLaw
    speed: float

    def limits(self, low: float, high: float) -> tuple[float, ...]:
        """Find the crank angles from ``low`` to ``high`` (rad) at which a range of assembly ends."""
        repeating = self.law.periodic_shift(self.parameters)
        if repeating is None:
            at = _search_angles(low, high)
            reached = self._assembly_square(at) > 0.0
            changes = np.flatnonzero(reached[1:] != reached[:-1])
            return tuple(
                float(brentq(lambda x: float(self._assembly_square(np.array([x]))[0]), at[i], at[i + 1], xtol=1e-14))
                for i in changes
            )
        parts = mobility.ranges(self.parameters, repeating)
        ends = {end for part in parts if not part.full(repeating.span) for end in (part.low, part.high)}
        moved = (end + more for more in _whole_spans(low, high, repeating.span) for end in ends)
        return tuple(sorted(end for end in moved if low <= end <= high))

    def zeros(self, low: float, high: float, *, held: bool) -> tuple[DeadCentre, ...]:
        """Find the configurations from ``low`` to ``high`` (rad) in which the slider reverses.

        If ``held``, these are the configurations in which the slider would reverse if the shift stayed constant there.
        """
        repeating = self.law.periodic_shift(self.parameters)
        if repeating is None:
            return self._sign_changes(low, high, 0.0 if held else 1.0)
        find = mobility.singularities if held else mobility.dead_centres
        found = find(self.parameters, repeating)
        spans = _whole_spans(low, high, repeating.span)
        moved = (c._replace(crank_angle=c.crank_angle + more) for more in spans for c in found)
        return tuple(centre for centre in moved if low <= centre.crank_angle <= high)

    def _sign_changes(self, low: float, high: float, pitch: float) -> tuple[DeadCentre, ...]:
        """Find the zeros of kth + ``pitch`` S1' ks from the signs at `_PIECES` angles per turn.

        kth and ks are the partial derivatives of S4 with respect to theta1 and S1.
        """
        f, p = plant_functions(), self.parameters.constants()

        def slope(angle: FloatArray) -> FloatArray:
            moving = self._shift(angle)
            k = f.coefficients(f.position(angle, moving.shift, p), p)
            return np.asarray(k.kth + pitch * moving.velocity / (self.speed or 1.0) * k.ks)

        at = _search_angles(low, high)
        reached = self._assembly_square(at) > (LIMIT_SINE * p.a2) ** 2
        values = np.zeros(at.shape)
        values[reached] = slope(at[reached])
        positive = values > 0.0
        found = []
        for i in np.flatnonzero((positive[1:] != positive[:-1]) & reached[1:] & reached[:-1]):
            angle = brentq(lambda x: float(slope(np.array([x]))[0]), at[i], at[i + 1], xtol=1e-14)
            moving = self._shift(np.array([angle]))
            q = f.position(np.array([angle]), moving.shift, p)
            outer = bool(positive[i]) == (p.branch > 0.0)
            found.append(DeadCentre(float(angle), float(moving.shift[0]), float(q.s4[0]), outer))
        return tuple(found)

    def _shift(self, angle: FloatArray) -> ShiftMotion:
        moving = self.law.at(angle, np.full(angle.shape, self.speed or 1.0), np.zeros(angle.shape))
        # a function of a law may return a number for all angles
        return ShiftMotion(*(np.broadcast_to(x, angle.shape) for x in moving))

    def _assembly_square(self, angle: FloatArray) -> FloatArray:
        """Return squared rod length minus squared distance of pin from guide (m2); positive if the rod reaches the guide."""
        p = self.parameters.constants()
        return np.asarray(plant_functions().assembly_square(angle, self._shift(angle).shift, p))


def _whole_spans(low: float, high: float, span: float) -> list[float]:
    """Return the multiples of ``span`` that, added to angles in [0, 2 span], can bring them between ``low`` and ``high``."""
    return [span * n for n in range(ceil(low / span) - 2, ceil(high / span) + 1)]


def _search_angles(low: float, high: float) -> FloatArray:
    """Return evenly spaced angles from ``low`` to ``high`` (rad), `_PIECES` per turn or slightly more."""
    return np.linspace(low, high, ceil((high - low) / tau * _PIECES) + 1)
