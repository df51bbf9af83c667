"""Signals: inputs of a run as functions of time, and torques that depend on the motion of the crank."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, ParameterError

from ..mechanisms import MECHANISMS, input_units
from ..units import Amount, in_si, si

#: A function of time, all coordinates and all their rates; arguments and value are floats.
StateFunction = Callable[..., float]


def _to_si(values: Any, what: str) -> tuple[Any, str]:
    """Return the values of a signal in SI and their SI unit; the unit is empty if no value is a text."""
    if not any(isinstance(value, str) for value in (values if isinstance(values, (list, tuple)) else (values,))):
        return values, ""
    units = dict.fromkeys(unit for mechanism in MECHANISMS.values() for unit in input_units(mechanism).values())
    for unit in units:
        try:
            return si(values, unit, what), unit
        except ParameterError:
            continue
    raise InputError(
        f"{what} of a signal: {values!r}: it must be numbers, or texts with a unit such as {', '.join(units)}"
    )


@dataclass(frozen=True, slots=True)
class Piecewise:
    """A signal that is a polynomial of degree three at most between its breaks.

    Parameters
    ----------
    breaks : ndarray, shape (n + 1,)
        Times (s), increasing. The first and the last polynomial also hold before the first and after the last break.
    coefficients : ndarray, shape (n, 4)
        Coefficients of the powers 0 to 3 of the time since the break on the left.
    unit : str
        SI unit if the values were given as texts, else empty. A signal with a unit can be an input of that unit only.

    Notes
    -----
    Where the signal jumps, its value at the break is the limit from the right.
    """

    breaks: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    unit: str = ""

    def __post_init__(self) -> None:
        for name in ("breaks", "coefficients"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        if self.breaks.ndim != 1 or len(self.breaks) < 2:
            raise InputError(
                f"a signal needs at least two breaks in one dimension, not an array of {self.breaks.shape}"
            )
        if self.coefficients.shape != (len(self.breaks) - 1, 4):
            raise InputError(
                f"a signal with {len(self.breaks)} breaks needs coefficients of shape ({len(self.breaks) - 1}, 4), "
                f"not {self.coefficients.shape}"
            )
        if not (np.all(np.isfinite(self.breaks)) and np.all(np.isfinite(self.coefficients))):
            raise InputError("a signal's breaks and coefficients must be finite numbers")
        if np.any(np.diff(self.breaks) <= 0.0):
            raise InputError(f"a signal's times must increase: they are {self.breaks}")


@in_si(frequencies="rad/s", phases="rad")
@dataclass(frozen=True, slots=True)
class Harmonics:
    """A sum of harmonics: mean + sum of amplitude cos(frequency t + phase).

    Frequencies are in rad/s, phases in rad; shapes are (n,). The values may be texts with units; ``unit`` is the SI unit of
    mean and amplitudes if these are texts, see `Piecewise`.
    """

    mean: Amount = 0.0
    amplitudes: Sequence[Amount] = ()
    frequencies: Sequence[Amount] = ()
    phases: Sequence[Amount] = ()
    unit: str = ""

    def __post_init__(self) -> None:
        (mean, *amplitudes), unit = _to_si(
            [self.mean, *np.ravel(np.array(self.amplitudes, object))], "mean and amplitudes"
        )
        if unit:
            for name, value in (("mean", mean), ("amplitudes", amplitudes), ("unit", unit)):
                object.__setattr__(self, name, value)
        if any(np.ndim(values) != 1 for values in (self.amplitudes, self.frequencies, self.phases)):
            raise InputError("amplitudes, frequencies and phases of harmonics must be lists of numbers")
        if not len(self.amplitudes) == len(self.frequencies) == len(self.phases):
            raise InputError("harmonics need as many amplitudes as frequencies and phases")
        if not np.all(np.isfinite([self.mean, *self.amplitudes, *self.frequencies, *self.phases])):
            raise InputError("harmonics must be finite numbers")


@in_si(torque="N.m", release_angle="rad")
@dataclass(frozen=True, slots=True, kw_only=True)
class TorsionBar:
    """Torque of a wound-up bar: torque (1 - angle / release_angle) until the crank reaches release_angle, then zero.

    ``torque`` (N.m) is the torque at the angle 0; ``release_angle`` is in rad. Such a bar, released at 1 rad, starts the
    mechanism of the thesis (section 3.2.2). The time of the release is located exactly.
    """

    torque: Amount
    release_angle: Amount = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.torque) and self.torque >= 0.0):
            raise InputError(
                f"torque of the torsion bar is {self.torque}: it must be a finite number of N.m, not below zero, because a bar "
                "turns the crank towards the angle of its release, which is positive"
            )
        if not (np.isfinite(self.release_angle) and self.release_angle > 0.0):
            raise InputError(f"release angle of the torsion bar is {self.release_angle}: it must be above 0 rad")


@in_si(breakdown_torque="N.m", breakdown_slip="1", synchronous_speed="rad/s")
@dataclass(frozen=True, slots=True, kw_only=True)
class InductionMotor:
    """Torque of an induction motor by Kloss's formula, 2 Tb / (s / sb + sb / s) at the slip s = 1 - speed / synchronous_speed.

    Parameters
    ----------
    breakdown_torque : float
        Greatest torque Tb (N.m).
    breakdown_slip : float
        Slip sb at which the torque is greatest.
    synchronous_speed : float
        Speed of the field (rad/s).
    """

    breakdown_torque: Amount
    breakdown_slip: Amount
    synchronous_speed: Amount

    def __post_init__(self) -> None:
        if not np.isfinite(self.breakdown_torque):
            raise InputError(f"breakdown torque is {self.breakdown_torque}: it must be a finite number of N.m")
        if not (np.isfinite(self.breakdown_slip) and self.breakdown_slip > 0.0):
            raise InputError(f"breakdown slip is {self.breakdown_slip}: it must be above 0")
        if not (np.isfinite(self.synchronous_speed) and self.synchronous_speed != 0.0):
            raise InputError(f"synchronous speed is {self.synchronous_speed}: it must be finite and not 0 rad/s")
        if self.breakdown_torque * self.synchronous_speed < 0.0:
            raise InputError(
                f"breakdown torque is {self.breakdown_torque} N.m at a synchronous speed of {self.synchronous_speed} rad/s: "
                "they must have the same sign, or the motor drives away from this speed"
            )


#: Fields of an induction motor in the order of the argument ``motor`` of `kloss`.
MOTOR = ("breakdown_torque", "breakdown_slip", "synchronous_speed")


def kloss(motor: Any, speed: Any) -> Any:
    """Return the torque (N.m) of an induction motor at a crank speed (rad/s), which may be a symbol.

    ``motor`` has the three numbers that `MOTOR` names.
    """
    slip = 1.0 - speed / motor[2]
    return 2.0 * motor[0] * slip * motor[1] / (slip * slip + motor[1] * motor[1])


@dataclass(frozen=True, slots=True)
class Function:
    """A channel given by a Python function of time, all coordinates of the mechanism and all their rates, all floats.

    The arguments for a five-bar are t, crank angle, slider position u, and the two rates; for a slider-crank the second
    coordinate is the axial shift S1. The compiled solver needs a function that Numba can compile; SciPy's methods take any
    function. A commanded speed must be a function of ``t`` alone and needs ``rate``, the function of its acceleration.
    ``breaks`` are times (s) at which the function is not smooth.
    """

    function: StateFunction
    rate: StateFunction | None = None
    breaks: Sequence[float] = ()

    def __post_init__(self) -> None:
        for name, value in (("function", self.function), ("rate", self.rate)):
            if not callable(value) and not (name == "rate" and value is None):
                raise InputError(
                    f"{name} of an input is {value!r}: it must be a function of t, the coordinates and their rates"
                )
        if not np.all(np.isfinite(self.breaks)):
            raise InputError(f"the breaks of a function must be finite times, not {self.breaks}")


Signal = float | Piecewise | Harmonics | Function
Torque = Signal | TorsionBar | InductionMotor


@in_si(from_time="s", to_time="s")
def ramp(start: Amount, end: Amount, from_time: Amount, to_time: Amount) -> Piecewise:
    """Return a signal that changes linearly between two times (s), such as ``ramp(0.0, "420 rpm", 0.0, "1 s")``."""
    if not to_time > from_time:
        raise InputError(f"a ramp from {from_time} s to {to_time} s: it must end after it begins")
    return table([from_time - 1.0, from_time, to_time, to_time + 1.0], [start, start, end, end])


@in_si(times="s")
def steps(times: ArrayLike, values: ArrayLike) -> Piecewise:
    """Return a signal with the value ``values[i]`` from ``times[i]`` (s) to the next time; shapes (n,) and (n,)."""
    t, y, unit = _points(times, values, least=1)
    breaks = np.append(t, t[-1] + 1.0)
    coefficients = np.zeros((len(t), 4))
    coefficients[:, 0] = y
    return Piecewise(breaks, coefficients, unit)


#: Kinds of interpolation between the points of a table.
SHAPES = ("linear", "cubic", "hold")


@in_si(times="s")
def table(times: ArrayLike, values: ArrayLike, kind: str = "linear") -> Piecewise:
    """Return a signal through the points (times, values), shapes (n,), times in s.

    ``kind`` is ``linear`` (interpolation), ``cubic`` (spline) or ``hold`` (the value of the previous point). Before and
    after the table the signal has the first and the last value.
    """
    if kind == "hold":
        return steps(times, values)
    t, y, unit = _points(times, values, least=2)
    if kind == "linear":
        slopes = np.diff(y) / np.diff(t)
        inner = np.pad(np.column_stack([y[:-1], slopes]), ((0, 0), (0, 2)))
    elif kind == "cubic":
        from scipy.interpolate import CubicSpline

        inner = CubicSpline(t, y).c[::-1].T
    else:
        raise InputError(f"kind of table is {kind!r}: it must be 'linear', 'cubic' or 'hold'")
    before, after = ((value, 0.0, 0.0, 0.0) for value in (y[0], y[-1]))
    return Piecewise(np.array([t[0] - 1.0, *t, t[-1] + 1.0]), np.vstack([before, inner, after]), unit)


def _points(times: ArrayLike, values: ArrayLike, least: int) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    t = np.asarray(times, dtype=float)
    values, unit = _to_si(values, "values")
    y = np.asarray(values, dtype=float)
    if t.ndim != 1 or t.shape != y.shape:
        raise InputError(f"a table needs as many times as values in one dimension each, not {t.shape} and {y.shape}")
    if len(t) < least:
        raise InputError(f"a table needs at least {least} points, not {len(t)}")
    if np.any(np.diff(t) <= 0.0):
        raise InputError(f"a table's times must increase: they are {t}")
    return t, y, unit


class Source(NamedTuple):
    """`Inputs` as arrays for the compiled code. A signal is a channel that is not the derivative of another channel.

    Attributes
    ----------
    breaks : ndarray, shape (n + 1,)
        Times at which some signal's polynomial changes.
    coefficients : ndarray, shape (n, signals, 4)
        Polynomials of the signals between the breaks.
    harmonics : ndarray, shape (m, 4)
        For each harmonic: index of the signal, amplitude, frequency (rad/s), phase (rad).
    places : ndarray of int, shape (signals, 2)
        For each signal the index of its channel, and the index of its derivative's channel, -1 if it has none.
    laws : ndarray, shape (torques, 6)
        For each of `Mechanism.torques` a torsion bar (torque, release angle, and 1 while it acts, 0 after its release or
        without a bar) and a motor (breakdown torque, breakdown slip, synchronous speed; the torque is 0 without a motor).
    law_places : ndarray of int, shape (torques, 3)
        For each of `Mechanism.torques` the index of its channel, and the indices in the state of the coordinate and of the
        rate on which the torque acts.
    functions : ndarray of int, shape (signals, 2)
        Addresses of the user's compiled functions for a signal and its derivative, or 0.
    """

    breaks: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    harmonics: NDArray[np.float64]
    places: NDArray[np.int64]
    laws: NDArray[np.float64]
    law_places: NDArray[np.int64]
    functions: NDArray[np.int64]

    @property
    def is_constant(self) -> bool:
        """Return whether all signals are constant, apart from the users' functions, and no torque law acts."""
        varies = len(self.harmonics) or self.laws[:, 2:4].any() or self.coefficients[:, :, 1:].any()
        return len(self.coefficients) == 1 and not varies
