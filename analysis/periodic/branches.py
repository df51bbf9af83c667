"""Branches of periodic motions: how an orbit changes with a parameter, where it loses its stability, and what branches off.

The parameter is the speed, the torque, a force, any parameter of the FMI contract, or whatever a function of one number
says. A branch is followed by arclength, past its folds; between its points are located where a Floquet multiplier crosses the
unit circle: at +1 (fold), at -1 (period doubling), or as a complex pair (torus). From a period doubling one switches to the
motion of twice the period.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..files import write_csv
from ..mechanisms import Parameters, mechanism_of
from ..notebook import Shown, format_count, format_range
from ..numerics.continuation import ContinuationError, Curve, Evaluate, Evaluation, Follower, Point, Settings
from .drives import Drive
from .floquet import TOLERANCE, Crossing, Stability, crossing_test
from .flows import label
from .orbits import (
    Direction,
    Period,
    PeriodicOrbit,
    period_from,
)
from .planes import Operation, format_value, require_variable, unit_of, with_values
from .starts import scale_of
from .turns import Turn

#: Relative step of the difference by which the constants are differentiated with respect to the parameter. The constants
#: are smooth functions of it, most of them linear, and the derivative steers Newton's method only.
_DIFFERENCE = 1e-6
#: First step along a branch, in scaled arc length.
_FIRST = 5e-3
#: Distance from a period doubling at which the doubled branch is begun, relative to the crank's length.
_SWITCH = 2e-3

#: A branch is left where the links come this close to the limit of assembly (least sine, as `LIMIT_SINE`), or where its
#: largest multiplier passes the greatest that single shooting follows with certainty.
LEAST_SINE, GREATEST_MULTIPLIER = 0.02, 1e4


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

    def _direction(self, value: float, low: float, high: float) -> Direction:
        """By differences inside the parameter's range."""
        step = _DIFFERENCE * max(abs(value), 1e-3 * (high - low))
        a, b = max(value - step, low), min(value + step, high)
        mechanism = mechanism_of(self.parameters)
        vectors, numbers = zip(*((d.vector(mechanism), np.array(p.constants())) for p, d in (self.at(a), self.at(b))))
        return Direction((vectors[1] - vectors[0]) / (b - a), (numbers[1] - numbers[0]) / (b - a))

    def evaluate(self, turns: int, low: float, high: float) -> Evaluate:
        """y(T) - y(0) with its derivatives over a range, as `continuation` follows it; its data are the `PeriodicOrbit`."""

        def evaluation(y: NDArray[np.float64], value: float) -> Evaluation:
            parameters, drive = self.at(value)
            period = period_from(parameters, drive, y, turns, self._direction(value, low, high), high - low)
            orbit = orbit_from(parameters, drive, y, turns, period)
            return Evaluation(period.shift, period.monodromy - np.eye(len(y)), period.slope, orbit)

        return evaluation


def orbit_from(
    parameters: Parameters, drive: Drive, start: NDArray[np.float64], turns: int, period: Period
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
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SpecialPoint:
    """Where a multiplier crosses the unit circle on a branch.

    Attributes
    ----------
    kind : Crossing
        FOLD, PERIOD_DOUBLING or TORUS.
    parameter : float
    orbit : PeriodicOrbit
    after : int
        Number of the branch's point after which it lies.
    """

    kind: Crossing
    parameter: float
    orbit: PeriodicOrbit
    after: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Branch(Shown):
    """Orbits along a curve, in its order.

    Attributes
    ----------
    family : Family
    turns : int
        Turns of the crank in a period.
    parameter : ndarray, shape (m,)
    orbits : tuple of PeriodicOrbit
    special : tuple of SpecialPoint
    reached, closed : bool
        Whether it ended at an end of the range or where it began; where it began.
    reason : str
        Why it ended. Where the branch was lost, its last point is the last good one.
    """

    family: Family
    turns: int
    parameter: NDArray[np.float64]
    orbits: tuple[PeriodicOrbit, ...]
    special: tuple[SpecialPoint, ...]
    reached: bool
    closed: bool
    reason: str
    # what `columns` has computed
    _table: dict[str, NDArray[np.float64]] = field(default_factory=dict, init=False, repr=False)

    def __repr__(self) -> str:
        special = "".join(f", {s.kind.value} at {self.family.format_value(s.parameter)}" for s in self.special)
        ended = "" if self.reached else f", ended early: {self.reason}"
        return f"<Branch: {describe((self,))}{special}{ended}>"

    def __len__(self) -> int:
        return len(self.orbits)

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """Half the range of the first free coordinate at each point, of a slider position (m); shape (m,)."""
        label, unit = self.orbits[0].swing
        return self.columns()[f"amplitude of {label} [{unit}]"]

    @property
    def largest_multiplier(self) -> NDArray[np.float64]:
        """Largest modulus of the Floquet multipliers at each point, shape (m,)."""
        return np.array([orbit.largest for orbit in self.orbits])

    def stability(self, tolerance: float = TOLERANCE) -> tuple[Stability, ...]:
        """Verdict at each point."""
        return tuple(orbit.verdict(tolerance).stability for orbit in self.orbits)

    def columns(self) -> Mapping[str, NDArray[np.float64]]:
        """What varies along the branch, by name with unit, each of shape (m,).

        The parameter, mean speed (under a torque), turns in a period, and of the first free coordinate, a five-bar's u,
        amplitude, mean and first harmonics; largest multiplier, stability; of what the mechanism has, mean and greatest crank
        torque, greatest forces in pins, guide and bearings, least transmission sine.
        """
        if not self._table:
            turns = [orbit.turn() for orbit in self.orbits]
            values = _of_a_turn(self.orbits[0], turns[0])
            self._table.update({name: np.array([value(turn) for turn in turns]) for name, value in values.items()})
        unit = f" [{self.family.unit}]" if self.family.unit else ""
        first = {
            f"{self.family.name}{unit}": self.parameter,
            "turns in a period [1]": np.full(len(self), float(self.turns)),
            "largest multiplier [1]": self.largest_multiplier,
            "stable (1), marginal (0), unstable (-1)": np.array([_SIGN[s] for s in self.stability()]),
        }
        return first | self._table

    def to_csv(self, path: str | Path) -> Path:
        """Write the branch as a table, a row a point; see `columns`."""
        return write_csv(path, self.columns())


#: Beginning of the names of the columns of forces in joints.
FORCE = "greatest force in "


def _of_a_turn(orbit: PeriodicOrbit, first: Turn) -> dict[str, Callable[[Turn], float]]:
    """Columns of a branch that come from the outputs over a period, of those outputs that the mechanism has."""
    mechanism = mechanism_of(orbit.parameters)
    rate = next(v for v in mechanism.variables if v.name == mechanism.freedoms[orbit.flow.crank].rate)
    swing, what = first.swing, "{} [{}]".format(*orbit.swing)
    columns: dict[str, Callable[[Turn], float]] = {
        f"mean {label(rate)} [rad/s]": lambda turn: orbit.flow.period * turn.turns / turn.period,
        f"amplitude of {what}": lambda turn: turn.amplitude,
        f"mean of {what}": lambda turn: float(turn[swing].mean()),
    }
    for order in (1, 2, 3):
        columns[f"harmonic {order} of {what}"] = lambda turn, order=order: turn.harmonic(swing, order)  # type: ignore[misc]
    if "drive.applied_torque" in first.names:
        columns["mean crank torque [N.m]"] = lambda turn: float(turn["drive.applied_torque"].mean())
        columns["greatest crank torque [N.m]"] = lambda turn: float(np.abs(turn["drive.applied_torque"]).max())
    for joint in dict.fromkeys(name.removesuffix(".fx") for name in first.names if name.endswith(".fx")):
        parts = [f"{joint}.f{axis}" for axis in "xyz" if f"{joint}.f{axis}" in first.names]
        columns[f"{FORCE}{joint.replace('.', ' ')} [N]"] = lambda turn, parts=parts: float(  # type: ignore[misc]
            reduce(np.hypot, (turn[part] for part in parts)).max()
        )
    if "slider.guide_force" in first.names:
        columns["greatest guide force [N]"] = lambda turn: float(np.abs(turn["slider.guide_force"]).max())
    if "transmission.angle" in first.names:
        columns["least sine of the transmission angle [1]"] = lambda turn: float(
            np.abs(np.sin(turn["transmission.angle"])).min()
        )
    return columns


_SIGN = {Stability.STABLE: 1.0, Stability.MARGINAL: 0.0, Stability.UNSTABLE: -1.0}


def follow(
    family: Family,
    orbit: PeriodicOrbit,
    value: float,
    *,
    low: float,
    high: float,
    direction: int = 1,
    greatest: float = 2e-2,
    most_points: int = 5000,
    watch: Callable[[float], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Branch:
    """Follow the branch through an orbit to an end of the range of the parameter.

    Parameters
    ----------
    family : Family
    orbit : PeriodicOrbit
        At the value of the parameter.
    value : float
        Where to begin, from ``low`` to ``high``.
    low, high : float
        Range of the parameter.
    direction : int
        +1 to higher values at first, -1 to lower.
    greatest : float
        Greatest step in scaled arc length: the range has length 1, and the crank's length counts as 1.
    most_points : int
    watch : callable, optional
        Called with the parameter of every point.
    stop : callable, optional
        Asked at every point whether to leave it at that.

    Returns
    -------
    Branch
        As far as it could be followed; ``reason`` says why it ended.

    Raises
    ------
    ContinuationError
        If the orbit is not on the family.
    """
    settings = _settings(low, high, greatest, most_points)
    follower = _follower(family, orbit, settings)
    return _branch(family, orbit.turns, follower, follower.start(orbit.start, value, direction), watch, stop)


def switch(
    family: Family,
    doubling: SpecialPoint,
    *,
    low: float,
    high: float,
    greatest: float = 2e-2,
    most_points: int = 5000,
    watch: Callable[[float], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Branch:
    """The branch of twice the period that leaves a branch at a period doubling.

    Raises
    ------
    InputError
        If the point is no period doubling.
    ContinuationError
        If no point on the new branch is found.
    """
    if doubling.kind is not Crossing.PERIOD_DOUBLING:
        raise InputError(
            f"the point at {doubling.parameter:.9g} is a {doubling.kind.value}: only a period doubling has a branch"
        )
    orbit = doubling.orbit
    settings = _settings(low, high, greatest, most_points)
    doubled = replace(orbit, turns=2 * orbit.turns, monodromy=orbit.monodromy @ orbit.monodromy)
    follower = _follower(family, doubled, settings)
    # the eigenvector of the multiplier -1 is the direction in which every second period differs
    scale = follower.scale[:-1]
    scaled = (orbit.monodromy + np.eye(len(scale))) * scale / scale[:, None]
    vector = np.linalg.svd(scaled)[2][-1] * scale
    base = follower.along(orbit.start, doubling.parameter, np.append(vector, 0.0))
    for length in (_SWITCH, 4.0 * _SWITCH, 0.25 * _SWITCH, 16.0 * _SWITCH):
        taken = follower.step(base, length)
        # back on the undoubled branch the start repeats itself after half the period
        if taken is not None and abs(float((taken.y / scale - orbit.start / scale) @ (vector / scale))) > 0.5 * length:
            return _branch(family, doubled.turns, follower, taken, watch, stop)
    raise ContinuationError(
        f"the motion of twice the period is not met next to {family.format_value(doubling.parameter)}"
    )


def _settings(low: float, high: float, greatest: float, most_points: int) -> Settings:
    return Settings(low=low, high=high, first=min(_FIRST, greatest), greatest=greatest, most_points=most_points)


def _follower(family: Family, orbit: PeriodicOrbit, settings: Settings) -> Follower:
    ends = [family.at(value) for value in (settings.low, settings.high)]
    scale = np.max([scale_of(parameters, drive, orbit.start) for parameters, drive in ends], axis=0)
    return Follower(family.evaluate(orbit.turns, settings.low, settings.high), scale, settings)


def reason_to_leave(point: Point) -> str:
    """Why a branch is not followed beyond a point; empty where it is."""
    orbit = point.data
    if orbit.largest > GREATEST_MULTIPLIER:
        return f"its largest multiplier passes {GREATEST_MULTIPLIER:g}"
    sine = orbit.clearance(64)
    if sine < LEAST_SINE:
        return f"the links come near to the limit of assembly (sine of the angle to it {sine:.3g})"
    return ""


def _branch(
    family: Family,
    turns: int,
    follower: Follower,
    first: Point,
    watch: Callable[[float], None] | None,
    stop: Callable[[], bool] | None,
) -> Branch:
    curve = follower.follow(
        first,
        watch=None if watch is None else lambda point: watch(point.parameter),
        leave=lambda point: "it was interrupted" if stop is not None and stop() else reason_to_leave(point),
    )
    special = _special_points(curve, follower)
    return Branch(
        family=family,
        turns=turns,
        parameter=np.array([point.parameter for point in curve.points]),
        orbits=tuple(point.data for point in curve.points),
        special=tuple(special),
        reached=curve.reached,
        closed=curve.closed,
        reason=curve.reason,
    )


def _tests(point: Point) -> dict[Crossing, float]:
    """What changes its sign along a branch where a multiplier crosses the unit circle."""
    # det(M - 1) is zero where a branch is crossed as well; the parameter turns back at a fold only
    return {
        kind: float(point.tangent[-1]) if kind is Crossing.FOLD else float(crossing_test(point.data.monodromy, kind))
        for kind in Crossing
    }


def _special_points(curve: Curve, follower: Follower) -> list[SpecialPoint]:
    found: list[tuple[int, float, SpecialPoint]] = []
    values = [_tests(point) for point in curve.points]
    for i, length in enumerate(curve.steps):
        for kind in Crossing:
            # the product of two multipliers at prescribed speed follows from the damping alone and crosses nothing
            if (
                kind is Crossing.TORUS
                and curve.points[i].data.drive.speed_drive
                and len(curve.points[i].data.start) < 3
            ):
                continue
            if not values[i][kind] * values[i + 1][kind] < 0.0:
                continue
            point, s = follower.locate(curve.points[i], length, lambda p, kind=kind: _tests(p)[kind])  # type: ignore[misc]
            # a real pair with the product 1 is no torus
            if kind is Crossing.TORUS and abs(point.data.multipliers[0].imag) < 1e-6:
                continue
            found.append((i, s, SpecialPoint(kind=kind, parameter=point.parameter, orbit=point.data, after=i)))
    return [special for _, _, special in sorted(found, key=lambda entry: entry[:2])]


def describe(branches: Sequence[Branch]) -> str:
    """One line on branches of a family: range, orbits, stability and greatest amplitude, and where."""
    family, (name, unit) = branches[0].family, branches[0].orbits[0].flow.components[0]
    span = format_range(np.concatenate([branch.parameter for branch in branches]), family.unit)
    words = dict.fromkeys(word.value for branch in branches for word in branch.stability())
    largest = max(branches, key=lambda branch: float(branch.amplitude.max()))
    place = int(largest.amplitude.argmax())
    return (
        f"{family.name} {span}, {format_count(sum(len(branch) for branch in branches), 'orbit')}, {' and '.join(words)}; "
        f"greatest amplitude of {name} {largest.amplitude[place]:.4g} {unit} at "
        f"{family.format_value(float(largest.parameter[place]))}"
    )
