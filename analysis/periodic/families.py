"""Periodic motions of a mechanism as one parameter varies: what a branch is a curve of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ..mechanisms import Parameters, mechanism_of
from ..numerics.continuation import Evaluate, Evaluation
from .drives import Drive
from .orbits import Direction, Period, PeriodicOrbit, Stations
from .paths import PeriodPath
from .planes import Operation, format_value, require_variable, unit_of, with_values
from .starts import is_smooth, scale_of

#: Relative step of the difference by which the constants are differentiated with respect to the parameter. The constants
#: are smooth functions of it, most of them linear, and the derivative steers Newton's method only.
_DIFFERENCE = 1e-6

#: What varies: an FMI name, or a function of one number.
Vary = str | Callable[[float], Operation]


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Periodic motions of a mechanism as one parameter varies.

    Attributes
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    vary : str or callable
        FMI name of an input that acts, such as ``drive.speed``, ``drive.torque`` or ``slider.force``, or of a parameter, such
        as ``slider.damping``; or a function from a number to (parameters, Drive).
    name, unit : str
        Of the parameter, for tables and plots; they follow from an FMI name.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If it does not act in this drive.
    """

    parameters: Parameters
    drive: Drive
    vary: Vary = "drive.speed"
    name: str = ""
    unit: str = ""

    def __post_init__(self) -> None:
        if callable(self.vary):
            object.__setattr__(self, "name", self.name or "parameter")
            return
        require_variable(self.parameters, self.drive, self.vary)
        object.__setattr__(self, "name", self.name or self.vary)
        object.__setattr__(self, "unit", self.unit or unit_of(mechanism_of(self.parameters), self.vary))

    def at(self, value: float) -> Operation:
        """Mechanism and drive at a value of the parameter."""
        if callable(self.vary):
            return self.vary(value)
        return with_values(self.parameters, self.drive, {self.vary: value})

    def format_value(self, value: float) -> str:
        """A value of the parameter with its name and unit; speeds in rpm too."""
        return format_value(self.name, value, self.unit)

    def direction(self, value: float, low: float, high: float) -> Direction:
        """By differences inside the parameter's range."""
        step = _DIFFERENCE * max(abs(value), 1e-3 * (high - low))
        a, b = max(value - step, low), min(value + step, high)
        mechanism = mechanism_of(self.parameters)
        vectors, numbers = zip(*((d.vector(mechanism), np.array(p.constants())) for p, d in (self.at(a), self.at(b))))
        return Direction((vectors[1] - vectors[0]) / (b - a), (numbers[1] - numbers[0]) / (b - a))

    def evaluate(self, turns: int, low: float, high: float, angles: NDArray[np.float64] | None = None) -> Evaluate:
        """y(T) - y(0) with its derivatives over a range, as `continuation` follows it; its data are the `PeriodicOrbit`.

        With ``angles``, shape (k + 1,), the unknowns are y at the beginning of each piece between them, and what is to vanish
        is the difference of each end from the next beginning: multiple shooting.
        """

        (mechanism, drive), (other, _) = self.at(low), self.at(high)
        whole = np.array([0.0, drive.flow(mechanism_of(mechanism)).period * turns])
        path = PeriodPath(whole if angles is None else angles, is_smooth(mechanism) and is_smooth(other))
        # what varies is a number of the drive: all of them are linear in it
        same = self.direction(high, low, high) if mechanism is other else None

        def evaluation(y: NDArray[np.float64], value: float) -> Evaluation:
            parameters, drive = self.at(value)
            direction = same or self.direction(value, low, high)
            ends = path.follow(parameters, drive, y[None, :], value, direction, high - low)
            period = Period(ends.y[0] - y, ends.matrices[0].copy(), ends.slopes[0])
            orbit = orbit_from(parameters, drive, y, turns, period, ends.clearance)
            return Evaluation(period.shift, period.monodromy - np.eye(len(y)), period.slope, orbit)

        def in_pieces(y: NDArray[np.float64], value: float) -> Evaluation:
            assert angles is not None
            parameters, drive = self.at(value)
            k = len(angles) - 1
            starts = y.reshape(k, -1).copy()
            n = starts.shape[1]
            direction = same or self.direction(value, low, high)
            ends, matrices, slopes, clearance = path.follow(parameters, drive, starts, value, direction, high - low)
            gaps = ends - np.roll(starts, -1, axis=0)
            jacobian = np.zeros((k, n, k, n))
            pieces = np.arange(k)
            jacobian[pieces, :, pieces] = matrices
            jacobian[pieces, :, (pieces + 1) % k] -= np.eye(n)
            scale = scale_of(parameters, drive, starts[0])
            orbit = PeriodicOrbit(
                parameters=parameters,
                drive=drive,
                turns=turns,
                start=starts[0].copy(),
                monodromy=reduce(lambda product, matrix: matrix @ product, matrices),
                residual=float(np.abs(gaps / scale).max()),
                iterations=1,
                stations=Stations(angles, starts, float(growths(matrices, scale).max())),
                nearest=clearance,
            )
            return Evaluation(gaps.ravel(), jacobian.reshape(k * n, k * n), slopes.ravel(), orbit)

        return evaluation if angles is None else in_pieces


def orbit_from(
    parameters: Parameters,
    drive: Drive,
    start: NDArray[np.float64],
    turns: int,
    period: Period,
    nearest: float | None = None,
) -> PeriodicOrbit:
    """The orbit that one period from its start is, as far as it closes."""
    return PeriodicOrbit(
        parameters=parameters,
        drive=drive,
        turns=turns,
        start=start.copy(),
        monodromy=period.monodromy,
        residual=float(np.abs(period.shift / scale_of(parameters, drive, start)).max()),
        iterations=1,
        nearest=nearest,
    )


def growths(matrices: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Greatest growth of a deviation, scaled, over each piece of a period; shape (k,)."""
    growths: NDArray[np.float64] = np.linalg.norm(matrices * scale / scale[:, None], ord=2, axis=(1, 2))
    return growths
