"""Define the tasks of synthesis, and their normal form.

A task has target values and weights. Searches work on its normal form (`normal_form`): lengths are divided by the target's
size and measured from its centre, so that a watch and an excavator are the same problem.

The quality functions are the thesis's (chapter VI): for a timed path the sum of weighted squared distances at the given crank
rotations, for a rocker function the sum of weighted squared angular errors, for an untimed path the area between the curves or
the sum of squared distances to the curve.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import hypot, isfinite, pi
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ...units import in_si
from .target import TargetPath, half_lengths, plane_points

FloatArray = NDArray[np.float64]
#: Default size of a target at which a body only rotates (m).
TURNED = 0.1
Measure = Literal["area", "distance"]
Objective = Literal["error", "worst"]
Quality = Literal["squares", "area", "worst"]


def _check_different(
    points: FloatArray, what: str, rotation: ArrayLike | None, angle: FloatArray | None = None
) -> None:
    """Raise InputError if two successive targets are the same and have no crank rotations: a dwell needs crank rotations."""
    same = (np.diff(points, axis=0) == 0.0).all(axis=1)
    if angle is not None:
        same &= np.diff(angle) == 0.0
    if rotation is None and same.any():
        k = int(np.argmax(same))
        place = f"{points[k].tolist()} m" + ("" if angle is None else f" at {angle[k]:.6g} rad")
        raise InputError(
            f"{what}: numbers {k} and {k + 1} are the same, {place}; leave one out, or give crank rotations for a dwell"
        )


def _check_extent(points: FloatArray, what: str) -> None:
    if not _extent(points) > 0.0:
        raise InputError(f"all {what} are the same, {points[0].tolist()} m: a path has an extent")


def _check_finite(values: FloatArray, what: str) -> None:
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        raise InputError(f"{what}: number {int(bad[0][0])} is {values[tuple(bad[0])]}: it must be finite")


def _numbers(values: ArrayLike, what: str, n: int) -> FloatArray:
    numbers = np.array(values, dtype=float)
    if numbers.shape != (n,):
        raise InputError(f"{what} have the shape {numbers.shape}: there must be one for each of the {n} targets")
    _check_finite(numbers, what)
    return numbers


def _rotation(values: ArrayLike | None, n: int) -> FloatArray:
    if values is None:
        return turn(n)
    rotation = _numbers(values, "crank rotations", n)
    steps = np.diff(rotation)
    if not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        k = int(np.argmin(steps * np.sign(steps.sum() or 1.0)))
        raise InputError(
            f"crank rotations {k} and {k + 1} are {rotation[k]:.6g} and {rotation[k + 1]:.6g} rad: they must go one way"
        )
    span = abs(rotation[-1] - rotation[0])
    if span > 2.0 * pi * (1.0 + 1e-9):
        raise InputError(f"crank rotations span {span:.6g} rad: they may span one turn at most")
    return rotation


def _weights(values: ArrayLike | None, n: int) -> FloatArray:
    if values is None:
        return np.ones(n)
    weights = _numbers(values, "weights", n)
    if (weights < 0.0).any() or not weights.any():
        k = int(np.argmin(weights))
        raise InputError(f"weight {k} is {weights[k]:g}: none may be below zero, nor all be zero")
    return weights


def _check_objective(objective: str) -> None:
    if objective not in get_args(Objective):
        raise InputError(f"objective is {objective!r}: it must be 'error' or 'worst'")


def _set_fields(task: Any, **values: Any) -> None:
    """Set fields of a frozen task during its construction."""
    for name, value in values.items():
        object.__setattr__(task, name, value)


def turn(n: int) -> FloatArray:
    """Return n evenly spaced crank rotations over one turn (rad), from 0 to less than 2 pi."""
    return np.linspace(0.0, 2.0 * pi, n, endpoint=False)


@in_si(points="m", rotation="rad")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimedPath:
    """Task: the coupler point passes given points at given crank rotations.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        At least three target points (m); the same point at successive rotations is a dwell.
    rotation : ndarray, shape (n,)
        Crank rotation from the start (rad), within a turn; equal steps over one turn by default.
    weights : ndarray, shape (n,)
        Weights of the squared distances.
    objective : "error" or "worst"
        What is minimised: the quality function, or the greatest error times the square root of its weight.
    """

    points: ArrayLike
    rotation: ArrayLike | None = None
    weights: ArrayLike | None = None
    objective: Objective = "error"

    def __post_init__(self) -> None:
        _check_objective(self.objective)
        # any number of linkages pass two points exactly
        points = plane_points(self.points, "target points", 3)
        _check_extent(points, "target points")
        n = len(points)
        _set_fields(self, points=points, rotation=_rotation(self.rotation, n), weights=_weights(self.weights, n))


@in_si(position="m", rotation="rad")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SliderFunction(TimedPath):
    """Task: the slider of a slider-crank is at given positions at given crank rotations.

    The task is a path of the slider's pin C along the x axis. The points of this path follow from the positions; the search
    finds the position of the crank shaft.

    Attributes
    ----------
    position : ndarray, shape (n,)
        x of the slider (m).
    rotation, weights, objective
        See `TimedPath`.
    """

    position: ArrayLike
    points: ArrayLike = field(init=False)

    def __post_init__(self) -> None:
        position = np.array(self.position, dtype=float)
        if position.ndim != 1:
            raise InputError(f"target positions have the shape {position.shape}: they must be a list")
        _set_fields(self, position=position, points=np.column_stack([position, np.zeros(len(position))]))
        TimedPath.__post_init__(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Straight:
    """A part of an untimed path that must be straight and traced within a given crank rotation.

    Attributes
    ----------
    start, end : int
        First and last of the path's points on the straight part, in the order of the points.
    rotation : float
        Greatest crank rotation for the straight part (rad).
    flatness : float, optional
        Greatest extent of the traced part across the line from start to end (m).
    """

    start: int
    end: int
    rotation: float
    flatness: float | None = None

    def __post_init__(self) -> None:
        if self.end <= self.start or self.start < 0:
            raise InputError(f"a straight part from point {self.start} to {self.end}: it must run forward")
        if not 0.0 < self.rotation <= 2.0 * pi:
            raise InputError(
                f"crank rotation of the straight part is {self.rotation}: it must be above 0, at most 2 pi rad"
            )
        if self.flatness is not None and not self.flatness > 0.0:
            raise InputError(f"flatness is {self.flatness}: it must be greater than zero (m)")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UntimedPath:
    """Task: the coupler point traces a curve, at any crank rotations.

    Attributes
    ----------
    path : TargetPath
        Closed or open.
    measure : "area" or "distance"
        Quality function that ranks solutions: the area between the curves (m2), or the weighted sum of squared distances from
        the stations to the curve (m2).
    samples : int
        Number of stations: points of the path at equal arc lengths, at which the curve is fitted.
    straight : Straight, optional
        A straight part of ``path`` that is traced within a given crank rotation.
    weights : ndarray, shape (number of the path's points,), optional
        Weight of each point of ``path``, interpolated between the points.
    objective : "error" or "worst"
        What is minimised: the quality function, or the Hausdorff distance between curve and path, which ignores weights.
    """

    path: TargetPath
    measure: Measure = "area"
    samples: int = 72
    straight: Straight | None = None
    weights: ArrayLike | None = None
    objective: Objective = "error"

    def __post_init__(self) -> None:
        _check_objective(self.objective)
        if self.measure not in ("area", "distance"):
            raise InputError(f"measure is {self.measure!r}: it must be 'area' or 'distance'")
        if self.samples < 8:
            raise InputError(f"{self.samples} samples of a path: there must be at least 8")
        if self.straight is not None and self.straight.end >= len(self.path.points):
            raise InputError(
                f"the straight part ends at point {self.straight.end}, the path has {len(self.path.points)}"
            )
        _set_fields(self, weights=_weights(self.weights, len(self.path.points)))


@in_si(angle="rad", rotation="rad")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RockerFunction:
    """Task: the rocker is at given angles at given crank rotations.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        Angles of the rocker from the ground link, th4 (rad).
    rotation, weights : ndarray, shape (n,)
        As in `TimedPath`; the weights multiply the squared angular errors.
    mounting : bool
        Whether the output may be mounted on the rocker at any angle.
    objective : "error" or "worst"
        What is minimised: the quality function, or the greatest weighted error.
    """

    angle: ArrayLike
    rotation: ArrayLike | None = None
    weights: ArrayLike | None = None
    mounting: bool = False
    objective: Objective = "error"

    def __post_init__(self) -> None:
        _check_objective(self.objective)
        angle = np.array(self.angle, dtype=float)
        if angle.ndim != 1 or len(angle) < 3:
            raise InputError(f"target angles have the shape {angle.shape}: they must be a list of at least 3")
        _check_finite(angle, "target angles")
        if not np.ptp(angle) > 0.0:
            raise InputError(
                f"all target angles are the same, {angle[0]:.6g} rad: a rocker that stands still needs no linkage"
            )
        n = len(angle)
        _set_fields(self, angle=angle, rotation=_rotation(self.rotation, n), weights=_weights(self.weights, n))


@in_si(points="m", angle="rad", rotation="rad", length="m")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """Task: the coupler carries a body through given poses.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Positions of the coupler point (m). Equal positions with several directions mean a body that only rotates; the same
        pose at successive crank rotations is a dwell.
    angle : ndarray, shape (n,)
        Direction of the body at each point (rad); its mounting angle on the coupler is free.
    rotation : ndarray, shape (n,), optional
        Crank rotations; without them only the order of the poses matters.
    length : float, optional
        Length by which an angular error is multiplied to count as an error of position (m/rad); by default half the target's
        extent, or 50 mm for a body that only rotates.
    weights : ndarray, shape (n,)
        Weights of the squared errors.
    objective : "error" or "worst"
        What is minimised: the quality function, or the greatest error, position and angle combined.
    """

    points: ArrayLike
    angle: ArrayLike
    rotation: ArrayLike | None = None
    length: float | None = None
    weights: ArrayLike | None = None
    objective: Objective = "error"

    def __post_init__(self) -> None:
        _check_objective(self.objective)
        points = plane_points(self.points, "target points", 2)
        n = len(points)
        angle = _numbers(self.angle, "target angles", n)
        _check_different(points, "target poses", self.rotation, angle)
        _set_fields(self, points=points, angle=angle, length=_leverage(self.length, points))
        if self.rotation is not None:
            _set_fields(self, rotation=_rotation(self.rotation, n))
        _set_fields(self, weights=_weights(self.weights, n))


@in_si(points="m", angle="rad", rotation="rad")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PrecisionPoints:
    """Task: the coupler point passes exactly through a few points, in order, at any crank rotations or at given ones.

    A four-bar can pass nine untimed points or five timed points, but rarely with a good transmission angle. If it cannot pass
    the points exactly, it comes as close as possible. With ``angle`` the targets are poses; a four-bar can pass five untimed
    poses.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Points in the order in which they are passed (m).
    angle : ndarray, shape (n,), optional
        Direction of the carried body at each point (rad).
    rotation : ndarray, shape (n,), optional
        Crank rotation at each point (rad).
    length : float, optional
        See `Motion`.
    objective : "error" or "worst"
        What is minimised if the points cannot be passed exactly: the quality function, or the greatest error.
    """

    points: ArrayLike
    angle: ArrayLike | None = None
    rotation: ArrayLike | None = None
    length: float | None = None
    objective: Objective = "error"

    def __post_init__(self) -> None:
        _check_objective(self.objective)
        points = plane_points(self.points, "precision points", 2)
        angle = None if self.angle is None else _numbers(self.angle, "target angles", len(points))
        _check_different(points, "precision points", self.rotation, angle)
        _set_fields(self, points=points)
        if self.rotation is not None:
            _set_fields(self, rotation=_rotation(self.rotation, len(points)))
        if angle is None:
            _check_extent(points, "precision points")
            if self.length is not None:
                raise InputError(
                    f"length is {self.length}: points without angles have no errors of angle; leave it out"
                )
        else:
            _set_fields(self, angle=angle, length=_leverage(self.length, points))


Task = TimedPath | UntimedPath | RockerFunction | Motion | PrecisionPoints


def _extent(points: FloatArray) -> float:
    return float(hypot(*np.ptp(points, axis=0)))


def _leverage(length: float | None, points: FloatArray) -> float:
    """Return the length that converts an angular error to an error of position (m/rad): as given, or the default."""
    if length is None:
        return 0.5 * (_extent(points) or TURNED)
    if not (isfinite(length) and length > 0.0):
        raise InputError(f"length is {length}: it must be a finite number greater than zero (m/rad)")
    return length


def covers_turn(rotation: FloatArray) -> bool:
    """Return whether crank rotations cover a whole turn: the gap from last to first is no wider than the widest step."""
    gap = 2.0 * pi - float(np.ptp(rotation))
    return gap <= 1.01 * float(np.abs(np.diff(rotation)).max(initial=0.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Normal:
    """A task in normal form: targets at n stations, in units of the target's size and relative to its centre."""

    origin: complex  # centre of the target (m)
    unit: float  # size of the target (m): diagonal of its bounding box; for a rocker function 1 m
    points: NDArray[np.complex128] | None = None  # target of the coupler point, shape (n,)
    angle: FloatArray | None = None  # target of the coupler's or the rocker's angle (rad), shape (n,)
    # whether `angle` is the rocker's, relative to the ground link; otherwise it is the coupler's, in the plane
    of_rocker: bool = False
    of_slider: bool = False  # whether the points are positions of a slider
    mounting: bool = False  # whether the output angle is free
    leverage: float = 1.0  # factor of an angular error (units per rad); 1 for a rocker function
    weights: FloatArray  # of the squared errors, shape (n,)
    rotation: FloatArray | None = None  # crank rotations (rad), shape (n,); None if only the order is given
    closed: bool = False  # whether the last station is followed by the first
    # length of the target that belongs to each station, shape (n,)
    arc: FloatArray = field(default_factory=lambda: np.empty(0))
    # all points of an untimed path, of which the stations are samples, and the weights of the errors there, shape (m,)
    outline: NDArray[np.complex128] | None = None
    outline_weights: FloatArray = field(default_factory=lambda: np.empty(0))
    straight: Straight | None = None  # straight part, with its ends as indices of stations and its flatness in units
    exact: bool = False  # whether the points must be passed exactly
    quality: Quality = "squares"  # what is minimised: sum of squared errors, area between the curves, or greatest error

    @property
    def n(self) -> int:
        """Return the number of stations."""
        return len(self.weights)

    @property
    def places(self) -> NDArray[np.complex128]:
        """Return the target points in the plane (m), shape (n,)."""
        assert self.points is not None
        return self.origin + self.unit * self.points

    @property
    def timed(self) -> bool:
        """Return whether the crank rotations are given."""
        return self.rotation is not None

    @property
    def whole_turn(self) -> bool:
        """Return whether the task is known to take a whole turn of the crank."""
        return self.closed or (self.rotation is not None and covers_turn(self.rotation))

    @property
    def shares(self) -> FloatArray:
        """Return the arc length from the first station to each station as a fraction of the total length, shape (n,)."""
        assert self.points is not None
        steps = np.abs(np.diff(np.append(self.points, self.points[0]) if self.closed else self.points))
        length = np.concatenate([[0.0], np.cumsum(steps)])
        return length[: self.n] / length[-1]


def normal_form(task: Task) -> Normal:
    """Return the normal form of a task.

    Raises InputError if the argument is not a task.
    """
    if not isinstance(task, TimedPath | UntimedPath | RockerFunction | Motion | PrecisionPoints):
        raise InputError(
            f"{task!r} is not a task: use TimedPath, UntimedPath, RockerFunction, Motion or PrecisionPoints"
        )
    quality: Quality = "worst" if task.objective == "worst" else "squares"
    if isinstance(task, RockerFunction):
        return Normal(
            origin=0.0,
            unit=1.0,
            angle=np.asarray(task.angle),
            of_rocker=True,
            mounting=task.mounting,
            weights=np.asarray(task.weights),
            rotation=np.asarray(task.rotation),
            quality=quality,
        )
    if isinstance(task, UntimedPath):
        return _path_normal(task)
    points = np.asarray(task.points)
    # a body that only rotates has no extent: its size follows from the length by which its angles count
    unit = _extent(points) or 2.0 * float(task.length)  # type: ignore[union-attr, arg-type]
    low, high = points.min(axis=0), points.max(axis=0)
    origin = complex(*(0.5 * (low + high)))
    angle = None if isinstance(task, TimedPath) else task.angle
    return Normal(
        origin=origin,
        unit=unit,
        points=(points @ np.array([1.0, 1j]) - origin) / unit,
        angle=None if angle is None else np.asarray(angle),
        mounting=angle is not None,
        leverage=1.0 if angle is None else float(task.length) / unit,  # type: ignore[union-attr, arg-type]
        weights=np.ones(len(points)) if isinstance(task, PrecisionPoints) else np.asarray(task.weights),
        rotation=None if task.rotation is None else np.asarray(task.rotation),
        exact=isinstance(task, PrecisionPoints),
        of_slider=isinstance(task, SliderFunction),
        quality=quality,
    )


def _path_normal(task: UntimedPath) -> Normal:
    points = np.asarray(task.path.points) @ np.array([1.0, 1j])
    closed = task.path.closed
    weights = np.asarray(task.weights)
    outline, outline_weights = points, weights
    if closed:
        points, weights = np.append(points, points[0]), np.append(weights, weights[0])
    low, high = complex(points.real.min(), points.imag.min()), complex(points.real.max(), points.imag.max())
    origin, unit = 0.5 * (low + high), abs(high - low)
    length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(points)))])
    ends = [0.0, float(length[-1])]
    straight = task.straight
    if straight is not None:
        ends = sorted({*ends, float(length[straight.start]), float(length[straight.end])})
    # pieces of the path, each divided evenly, so that the ends of the straight part are stations
    pieces = [
        np.linspace(a, b, max(2, round(task.samples * (b - a) / length[-1])), endpoint=False) for a, b in pairwise(ends)
    ]
    if not closed:
        pieces.append(np.array([length[-1]]))
    s = np.concatenate(pieces)

    edges = np.diff(np.append(s, length[-1])) if closed else np.diff(s)
    if straight is not None:
        first, last = (int(np.argmin(np.abs(s - length[k]))) for k in (straight.start, straight.end))
        flatness = None if straight.flatness is None else straight.flatness / unit
        straight = replace(straight, start=first, end=last, flatness=flatness)
    station_weights = np.interp(s, length, weights)
    if not station_weights.any():
        raise InputError(f"the weights are zero at each of the {len(s)} stations: take more samples or wider weights")
    return Normal(
        origin=origin,
        unit=unit,
        points=(np.interp(s, length, points) - origin) / unit,
        weights=station_weights,
        closed=closed,
        arc=half_lengths(edges, closed) / unit,
        outline=(outline - origin) / unit,
        outline_weights=outline_weights,
        straight=straight,
        quality="worst" if task.objective == "worst" else "area" if task.measure == "area" else "squares",
    )
