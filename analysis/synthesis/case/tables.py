"""Read the task of a synthesis case from its table: points, files and formulas."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import tau
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, MissingParameterError, ParameterError

from ...files import Choice, Kinds, Many, Quantity, Table, Whole, any_value, entry, flag, read, read_points, text
from ...units import quantity
from ..exact.generation import QuickReturn, QuickSwing
from ..task import task as tasks
from ..task.target import TargetPath, function_from_formula, path_from_formula, transform_points

FloatArray = NDArray[np.float64]


# Readers


def read_plane_points(value: Any, name: str, bare: str | None = None) -> FloatArray:
    """Read points, shape (n, 2) in m; ``bare`` is the unit of numbers that have no unit, by default m."""
    return np.array(Many(Many(Quantity("m", bare=bare), length=2))(value, name)).reshape(-1, 2)


def _unit(value: Any, name: str, kind: str, si: str, example: str) -> str:
    """Check and return the unit that applies to numbers written without a unit.

    ``kind`` and ``example`` describe the units that are allowed, in messages; ``si`` is the SI unit of this kind.
    """
    try:
        quantity(f"1 {value}", si, name)
    except ParameterError:
        raise ParameterError(name, value, f"be a unit of {kind}, such as {example}") from None
    return str(value)


_length_unit = partial(_unit, kind="length", si="m", example="'mm'")
_angle_unit = partial(_unit, kind="angle", si="rad", example="'deg'")


def _end(value: Any, name: str) -> float | str:
    """Read one end of the range of a formula's parameter: an angle such as "360 deg", or a formula such as "2*pi"."""
    angle = r"\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*[A-Za-z]+\s*"
    if isinstance(value, str) and not re.fullmatch(angle, value):
        return value
    return quantity(value, "rad", name)


# Tables inside the task's


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """Crank rotations at equal steps between two ends (rad)."""

    begin: float = entry(Quantity("rad"), key="from")
    end: float = entry(Quantity("rad"), key="to")

    @property
    def is_turn(self) -> bool:
        """Return whether the rotations span a whole turn."""
        return abs(abs(self.end - self.begin) - tau) <= 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """A weight for a range of targets, between two crank rotations or, for an untimed task, between two indices of points."""

    begin: float = entry(Quantity("rad"), key="from")
    end: float = entry(Quantity("rad"), key="to")
    weight: float = entry(Quantity("1"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Smoothing:
    """Settings for smoothing a path; see `TargetPath.smooth`."""

    points: int = entry(Whole(8), 180)
    deviation: float | None = entry(Quantity("m"), None)


_STRAIGHT = Table(
    tasks.Straight,
    {"start": Whole(0), "end": Whole(0), "rotation": Quantity("rad"), "flatness": Quantity("m")},
)


def _smoothing(value: Any, name: str) -> Smoothing | None:
    if isinstance(value, bool):
        return Smoothing() if value else None
    if not isinstance(value, Mapping):
        raise ParameterError(name, value, "be true, false, or a table with points and deviation")
    return read(Smoothing, value, name)


def _steps_or_list(value: Any, name: str) -> Any:
    return read(Steps, value, name) if isinstance(value, Mapping) else Many(Quantity("rad"))(value, name)


def _rotation(value: Any, *targets: FloatArray) -> FloatArray | None:
    """Return the crank rotations of targets (rad) from `Steps` or a list; None if they are not given.

    ``value`` is the entry of the table; ``targets`` are columns with a row for each target. The end of a whole turn is its
    start: it has a target of its own only if the last target repeats the first.
    """
    if not isinstance(value, Steps):
        return None if value is None else np.array(value)
    rows = np.column_stack(targets)
    repeated = bool(np.abs(rows[-1] - rows[0]).max() <= 1e-9 * np.ptp(rows, axis=0).max())
    return np.linspace(value.begin, value.end, len(rows), endpoint=repeated or not value.is_turn)


def _weights(value: Any, rotation: FloatArray | None, n: int = 0) -> FloatArray | None:
    """Read the weights of targets, given as a list or as windows of crank rotations; see `Window`.

    For an untimed task, with n targets, the windows are ranges of point indices. A window includes its ends. A window of crank
    rotations holds in every turn, so that it may pass the start of the task.
    """
    if value is None:
        return None
    name = "task.weights"
    rows = Many(any_value)(value, name)
    if not any(isinstance(row, Mapping) for row in rows):
        return np.array(Many(Quantity("1"))(value, name))
    at = np.arange(n, dtype=float) if rotation is None else rotation
    numbers = {"begin": Whole(0), "end": Whole(0)} if rotation is None else {}
    weights = np.ones(len(at))
    for k, row in enumerate(rows):
        window = read(Window, row, f"{name}[{k}]", readers=numbers)
        after = at - window.begin + 1e-9
        if rotation is not None:
            after %= tau
        within = (after >= 0.0) & (after <= window.end - window.begin + 2e-9)
        if not within.any():
            raise ParameterError(f"{name}[{k}]", dict(row), "hold at least one target, with 'from' below 'to'")
        weights[within] = window.weight
    return weights


# The task


def _only_source(table: Any, sources: tuple[str, ...]) -> str:
    """Return the name of the entry among ``sources`` that gives the target; raise InputError unless there is exactly one."""
    there = [name for name in sources if getattr(table, name) is not None]
    if len(there) != 1:
        ways = " or ".join(f"task.{name}" for name in sources)
        both = f"there are {' and '.join(f'task.{name}' for name in there)}" if there else "there is none of them"
        raise InputError(f"the target must be given by one of {ways}: {both}")
    return there[0]


def _refuse_entries(table: Any, names: tuple[str, ...], source: str) -> None:
    for name in names:
        if getattr(table, name) is not None:
            raise ParameterError(f"task.{name}", getattr(table, name), f"come with task.{source} only")


@dataclass(frozen=True, slots=True, kw_only=True)
class _ObjectiveAndRange:
    """Entries shared by several tasks: the objective and, for a formula, the number and the range of the parameter's values.

    Attributes
    ----------
    n : int
        Number of values of a formula's parameter, at equal steps; 72 by default.
    start, end : float or str
        Range of the parameter t of a formula: an angle, or a formula such as "2*pi".
    unit, angle_unit : str
        Unit of numbers that are written without a unit.
    rotation : list or Steps
        Crank rotations as a list, or { from = "0 deg", to = "120 deg" }.
    weights : list
        One weight per target, or windows [{ from = "60 deg", to = "260 deg", weight = 1000 }] of crank rotations.
    """

    objective: tasks.Objective = entry(Choice(get_args(tasks.Objective)), "error")
    n: int | None = entry(Whole(3), None)
    start: float | str | None = entry(_end, None)
    end: float | str | None = entry(_end, None)

    def _range(self) -> dict[str, Any]:
        usual: dict[str, Any] = {"n": 72, "start": 0.0, "end": tau}
        own = {name: getattr(self, name) for name in usual}
        return usual | {name: value for name, value in own.items() if value is not None}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Curve(_ObjectiveAndRange):
    """Entries for the points of a target: a list, a file or formulas, which can be scaled, rotated and shifted.

    Attributes
    ----------
    points : list
        Points [x, y] in the order in which they are passed.
    file : str
        Name of a CSV file with two columns, or of an SVG file, instead of points.
    name : str
        id of the element of an SVG file.
    closed : bool
        Whether the curve continues from its last point to its first.
    x, y : str
        Formulas of t instead of points, such as "60*cos(t)".
    scale, turn, shift : float, float, list
        The target is scaled and turned about the origin, then shifted by [x, y].
    """

    points: Any = entry(any_value, None)
    file: str | None = entry(text, None)
    name: str | None = entry(text, None)
    closed: bool | None = entry(flag, None)
    unit: str | None = entry(_length_unit, None)
    x: str | None = entry(text, None)
    y: str | None = entry(text, None)
    scale: float | None = entry(Quantity("1", above=0.0), None)
    turn: float | None = entry(Quantity("rad"), None)
    shift: Any = entry(any_value, None)

    def _target_points(self, folder: Path) -> tuple[FloatArray, bool]:
        """Return the points in m, and whether their curve is closed."""
        source = _only_source(self, ("points", "file", "x"))
        if source != "x":
            _refuse_entries(self, ("y", "n", "start", "end"), "x")
        if source != "file":
            _refuse_entries(self, ("name",), "file")
        if source == "points":
            found, closed = read_plane_points(self.points, "task.points", self.unit), True
        elif source == "file":
            found, closed = read_points(folder / str(self.file), unit=self.unit, name=self.name)
        elif self.y is None:
            raise MissingParameterError("task.y")
        else:
            path = path_from_formula(str(self.x), self.y, unit=self.unit or "m", **self._range())
            found, closed = path.points, path.closed
        if source != "points" and closed and self.closed is False:
            found = np.vstack([found, found[:1]])
        shift = np.zeros(2) if self.shift is None else read_plane_points([self.shift], "task.shift", self.unit)[0]
        if not (self.scale is None and self.turn is None and self.shift is None):
            found = transform_points(found, 1.0 if self.scale is None else self.scale, self.turn or 0.0, shift)
        return found, closed if self.closed is None else self.closed

    def _timed_points(self, folder: Path, *given: Any) -> FloatArray:
        """Return the points in m; a closed curve from a file ends at its first point if ``given`` has a value for this end.

        ``given`` are the values for each point: crank rotations, as `Steps` or a list, and a list of angles; each may be None.
        """
        if self.points is not None:
            _refuse_entries(self, ("closed",), "file or task.x, in tasks with crank rotations")
        points, closed = self._target_points(folder)
        n = len(points) + 1
        counted = any(isinstance(one, Steps) or (one is not None and len(one) == n) for one in given)
        return np.vstack([points, points[:1]]) if self.file is not None and closed and counted else points


@dataclass(frozen=True, slots=True, kw_only=True)
class TimedPathTable(_Curve):
    """The table ``[task]`` of a `tasks.TimedPath`."""

    rotation: Any = entry(_steps_or_list, None)
    weights: Any = entry(any_value, None)

    def task(self, folder: Path) -> tasks.Task:
        points = self._timed_points(folder, self.rotation)
        rotation = _rotation(self.rotation, points)
        at = tasks.turn(len(points)) if rotation is None else rotation
        weights = _weights(self.weights, at)
        return tasks.TimedPath(points=points, rotation=rotation, weights=weights, objective=self.objective)


@dataclass(frozen=True, slots=True, kw_only=True)
class UntimedPathTable(_Curve):
    """The table ``[task]`` of a `tasks.UntimedPath`.

    Attributes
    ----------
    smoothing : Smoothing
        true, or { points = 180, deviation = "0.5 mm" }, for curves drawn by hand.
    weights : list
        One weight per point, or windows [{ from = 0, to = 3, weight = 10 }] of point indices.
    """

    measure: Any = entry(Choice(("area", "distance")), "area")
    samples: int = entry(Whole(8), 72)
    smoothing: Smoothing | None = entry(_smoothing, None)
    straight: tasks.Straight | None = entry(_STRAIGHT, None)
    weights: Any = entry(any_value, None)

    def task(self, folder: Path) -> tasks.Task:
        points, closed = self._target_points(folder)
        path = TargetPath(points=points, closed=closed)
        if self.smoothing is not None:
            if self.straight is not None:
                requirement = "not come with task.straight, which counts the points given"
                raise ParameterError("task.smoothing", True, requirement)
            path = path.smooth(self.smoothing.points, deviation=self.smoothing.deviation)
        weights = _weights(self.weights, None, len(path.points))
        return tasks.UntimedPath(
            path=path,
            weights=weights,
            measure=self.measure,
            samples=self.samples,
            straight=self.straight,
            objective=self.objective,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PrecisionPointsTable(_Curve):
    """The table ``[task]`` of `tasks.PrecisionPoints`.

    Attributes
    ----------
    length : float
        Length that converts an error of angle into an error of position; half the target's extent by default.
    """

    angle: Any = entry(any_value, None)
    angle_unit: str | None = entry(_angle_unit, None)
    rotation: Any = entry(_steps_or_list, None)
    length: float | None = entry(Quantity("m"), None)

    def _body(self, folder: Path) -> dict[str, Any]:
        """Return the arguments that `PrecisionPoints` and `Motion` share; the entry ``turn`` rotates both points and body."""
        angle = None
        if self.angle is None:
            _refuse_entries(self, ("angle_unit", "length"), "angle")
        else:
            angles = Many(Quantity("rad", bare=self.angle_unit))(self.angle, "task.angle")
            angle = np.array(angles) + (self.turn or 0.0)
        points = self._timed_points(folder, self.rotation, angle)
        # a path may pass a point twice, with the body at another angle
        body = () if angle is None or len(angle) != len(points) else (np.cos(angle), np.sin(angle))
        rotation = _rotation(self.rotation, points, *body)
        return {
            "points": points, "angle": angle, "rotation": rotation, "length": self.length, "objective": self.objective,
        }  # fmt: skip

    def task(self, folder: Path) -> tasks.Task:
        return tasks.PrecisionPoints(**self._body(folder))


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionTable(PrecisionPointsTable):
    """The table ``[task]`` of a `tasks.Motion`."""

    weights: Any = entry(any_value, None)

    def task(self, folder: Path) -> tasks.Task:
        body = self._body(folder)
        if body["angle"] is None:
            raise MissingParameterError("task.angle")
        return tasks.Motion(**body, weights=_weights(self.weights, body["rotation"], len(body["points"])))


@dataclass(frozen=True, slots=True, kw_only=True)
class RockerFunctionTable(_ObjectiveAndRange):
    """The table ``[task]`` of a `tasks.RockerFunction`.

    Attributes
    ----------
    angle : list or str
        Angles of the rocker from the ground link, or a formula of the crank rotation t in rad.
    file : str
        Name of a CSV file with two columns, rotation and angle, instead of angles.
    spacing : str
        Spacing of a formula's points: equal steps, or Chebyshev's precision points.
    """

    angle: Any = entry(any_value, None)
    angle_unit: str | None = entry(_angle_unit, None)
    file: str | None = entry(text, None)
    rotation: Any = entry(_steps_or_list, None)
    weights: Any = entry(any_value, None)
    mounting: bool = entry(flag, False)
    spacing: Any = entry(Choice(("even", "chebyshev")), None)

    def task(self, folder: Path) -> tasks.Task:
        written = isinstance(self.angle, str)
        if _only_source(self, ("angle", "file")) == "file" or written:
            _refuse_entries(self, ("rotation",), "angle as a list")
        if not written:
            _refuse_entries(self, ("n", "start", "end", "spacing"), "angle as a formula")
        unit = self.angle_unit or "rad"
        rotation: FloatArray | None
        if written:
            rotation, angle = function_from_formula(
                self.angle, unit=unit, spacing=self.spacing or "even", **self._range()
            )
        elif self.file is not None:
            rotation, angle = read_points(folder / self.file, unit=self.angle_unit, si="rad")[0].T
        else:
            angle = np.array(Many(Quantity("rad", bare=self.angle_unit))(self.angle, "task.angle"))
            rotation = _rotation(self.rotation, np.cos(angle), np.sin(angle))
        at = tasks.turn(len(angle)) if rotation is None else rotation
        weights = _weights(self.weights, at)
        return tasks.RockerFunction(
            angle=angle, rotation=rotation, weights=weights, mounting=self.mounting, objective=self.objective
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SliderFunctionTable(_ObjectiveAndRange):
    """The table ``[task]`` of a `tasks.SliderFunction`.

    Attributes
    ----------
    position : list or str
        Positions of the slider along the x axis, or a formula of the crank rotation t in rad.
    """

    position: Any = entry(any_value)
    unit: str | None = entry(_length_unit, None)
    rotation: Any = entry(_steps_or_list, None)
    weights: Any = entry(any_value, None)

    def task(self, folder: Path) -> tasks.Task:
        if isinstance(self.position, str):
            _refuse_entries(self, ("rotation",), "position as a list")
            rotation, numbers = function_from_formula(self.position, **self._range())
            position = quantity(f"1 {self.unit or 'm'}", "m", "task.unit") * numbers
        else:
            _refuse_entries(self, ("n", "start", "end"), "position as a formula")
            position = np.array(Many(Quantity("m", bare=self.unit))(self.position, "task.position"))
            given = _rotation(self.rotation, position)
            rotation = tasks.turn(len(position)) if given is None else given
        weights = _weights(self.weights, rotation)
        return tasks.SliderFunction(position=position, rotation=rotation, weights=weights, objective=self.objective)


@dataclass(frozen=True, slots=True, kw_only=True)
class QuickReturnTable:
    """The table ``[task]`` of a `QuickReturn` or a `QuickSwing`.

    Attributes
    ----------
    time_ratio : float
        Duration of the slow stroke or swing divided by the duration of the quick one, 1 or greater.
    """

    stroke: float | None = entry(Quantity("m", above=0.0), None)
    swing: float | None = entry(Quantity("rad"), None)
    time_ratio: float = entry(Quantity("1", least=1.0), 1.0)

    def task(self, folder: Path) -> tasks.Task:
        if _only_source(self, ("stroke", "swing")) == "swing":
            return QuickSwing(swing=float(self.swing or 0.0), time_ratio=self.time_ratio)
        return QuickReturn(stroke=float(self.stroke or 0.0), time_ratio=self.time_ratio)


#: Class of the table ``[task]`` for each kind of task.
KINDS: Mapping[str, type] = {
    "timed-path": TimedPathTable,
    "untimed-path": UntimedPathTable,
    "rocker-function": RockerFunctionTable,
    "slider-function": SliderFunctionTable,
    "quick-return": QuickReturnTable,
    "motion": MotionTable,
    "precision-points": PrecisionPointsTable,
}


def read_task(value: Any, name: str, *, folder: Path) -> tasks.Task:
    """Read the task from the table ``[task]``; names of further files are relative to ``folder``."""
    return Kinds({kind: Table(table) for kind, table in KINDS.items()})(value, name).task(folder)
