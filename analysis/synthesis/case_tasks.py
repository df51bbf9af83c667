"""The task of a synthesis case: its table read, with units, from points, files and formulas."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from math import cos, isfinite, sin, tau
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, MissingParameterError, ParameterError, UnknownNameError

from ..files.io import check_names, quantity, read_points
from .targets import TargetPath, function_from_formula, path_from_formula
from .tasks import Motion, PrecisionPoints, RockerFunction, Straight, Task, TimedPath, UntimedPath, turn

FloatArray = NDArray[np.float64]


# Tables


def section(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """A table of a file by its name, empty if it is not there."""
    value = data.get(name, {})
    if not isinstance(value, Mapping):
        raise ParameterError(name, value, f"be a table, [{name}]")
    return value


def one_of(value: Any, name: str, known: Iterable[str]) -> str:
    """A text that is one of those known."""
    names = tuple(known)
    if isinstance(value, str) and value not in names:
        near = difflib.get_close_matches(value, names, n=1)
        raise UnknownNameError(f"{name} {value!r}", names, near[0] if near else None)
    if not isinstance(value, str):
        raise ParameterError(name, value, f"be one of {', '.join(names)}")
    return value


def whole(value: Any, name: str, least: int | None = None) -> int:
    """A whole number, at least so great."""
    if isinstance(value, bool) or not isinstance(value, int):
        raise ParameterError(name, value, "be a whole number")
    if least is not None and value < least:
        raise ParameterError(name, value, f"be at least {least}")
    return value


def flag(value: Any, name: str) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise ParameterError(name, value, "be true or false")
    return value


def listed(value: Any, name: str, length: int | None = None) -> Sequence[Any]:
    """A list, of a length."""
    if not isinstance(value, list) or (length is not None and len(value) != length):
        raise ParameterError(name, value, "be a list" if length is None else f"be a list of {length}")
    return value


def measured(value: Any, unit: str, name: str, bare: str | None = None) -> float:
    """A quantity; a number without a unit is in ``bare``, where one is given, else in SI."""
    if bare is not None and isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value) * quantity(f"1 {bare}", unit, f"unit of {name}")
    return quantity(value, unit, name)


def list_of(value: Any, unit: str, name: str, bare: str | None = None) -> FloatArray:
    """Quantities in SI; see `measured`."""
    return np.array([measured(v, unit, f"{name}[{k}]", bare) for k, v in enumerate(listed(value, name))])


def pairs(value: Any, name: str, bare: str | None = None) -> FloatArray:
    """Points, shape (n, 2) in m."""
    rows = [
        [measured(v, "m", f"{name}[{k}]", bare) for v in listed(row, f"{name}[{k}]", 2)]
        for k, row in enumerate(listed(value, name))
    ]
    return np.array(rows).reshape(-1, 2)


def given(table: Mapping[str, Any], key: str, name: str) -> Any:
    """A value that must be there."""
    if key not in table:
        raise MissingParameterError(f"{name}.{key}")
    return table[key]


# The task

_CURVE = ("points", "file", "name", "closed", "unit", "x", "y", "n", "start", "end", "scale", "turn", "shift")
#: Names in the table ``[task]`` of each kind.
KINDS: Mapping[str, tuple[str, ...]] = {
    "timed-path": (*_CURVE, "rotation", "weights"),
    "untimed-path": (*_CURVE, "measure", "samples", "smoothing", "straight", "weights"),
    "rocker-function": ("angle", "angle_unit", "file", "n", "start", "end", "rotation", "weights", "mounting"),
    "motion": (*_CURVE, "angle", "angle_unit", "rotation", "weights", "length"),
    "precision-points": (*_CURVE, "angle", "angle_unit", "rotation", "length"),
}


def task_from(table: Mapping[str, Any], folder: Path) -> Task:
    """The task of a table ``[task]``; ``folder`` is where its files are looked for."""
    if "kind" not in table:
        raise MissingParameterError("task.kind")
    kind = one_of(table["kind"], "task.kind", KINDS)
    check_names(table, "task", ("kind", *KINDS[kind]))
    if kind == "rocker-function":
        return _rocker_function(table, folder)
    path, turned = _curve(table, folder, points=kind in ("motion", "precision-points"))
    if kind == "untimed-path":
        return _untimed(table, path)
    points = path.points if isinstance(path, TargetPath) else path
    rotation = _rotation(table, len(points))
    if kind == "timed-path":
        at = turn(len(points)) if rotation is None else rotation
        return TimedPath(points=points, rotation=rotation, weights=_weights(table, at))
    angle = list_of(table["angle"], "rad", "task.angle", _unit(table, "angle_unit")) if "angle" in table else None
    if angle is not None:
        angle = angle + turned
    length = quantity(table["length"], "m", "task.length") if "length" in table else None
    if kind == "precision-points":
        return PrecisionPoints(points=points, angle=angle, rotation=rotation, length=length)
    if angle is None:
        raise MissingParameterError("task.angle")
    weights = _weights(table, rotation, len(points))
    return Motion(points=points, angle=angle, rotation=rotation, length=length, weights=weights)


def _unit(table: Mapping[str, Any], key: str = "unit") -> str | None:
    """Unit of the numbers that have none, if it is given."""
    value = table.get(key)
    if value is None:
        return None
    kind, unit, examples = ("length", "m", "'mm'") if key == "unit" else ("angle", "rad", "'deg'")
    try:
        quantity(f"1 {value}", unit, key)
    except ParameterError:
        raise ParameterError(f"task.{key}", value, f"be a unit of {kind}, such as {examples}") from None
    return str(value)


def _source(table: Mapping[str, Any], sources: Sequence[str]) -> str:
    """Which of the ways of giving a target is there."""
    there = [key for key in sources if key in table]
    if len(there) != 1:
        ways = " or ".join(f"task.{key}" for key in sources)
        both = f"there are {' and '.join(f'task.{key}' for key in there)}" if there else "there is none of them"
        raise InputError(f"the target must be given by one of {ways}: {both}")
    return there[0]


def _only_with(table: Mapping[str, Any], keys: Iterable[str], source: str) -> None:
    for key in keys:
        if key in table:
            raise ParameterError(f"task.{key}", table[key], f"come with task.{source} only")


def _curve(table: Mapping[str, Any], folder: Path, *, points: bool) -> tuple[TargetPath | FloatArray, float]:
    """Points in m, as a curve where the task is about one, and the angle by which they are turned (rad)."""
    source = _source(table, ("points", "file", "x"))
    unit = _unit(table)
    closed = flag(table["closed"], "task.closed") if "closed" in table else None
    if source != "x":
        _only_with(table, ("y", "n", "start", "end"), "x")
    if source != "file":
        _only_with(table, ("name",), "file")
    if source == "points":
        found, is_closed = pairs(table["points"], "task.points", unit), True
    elif source == "file":
        name = table.get("name")
        found, is_closed = read_points(folder / str(table["file"]), unit=unit, name=None if name is None else str(name))
    else:
        if "y" not in table:
            raise MissingParameterError("task.y")
        n, start, end = _parameter(table)
        path = path_from_formula(str(table["x"]), str(table["y"]), n=n, unit=unit or "m", start=start, end=end)
        found, is_closed = path.points, path.closed
    scale, turned = (
        quantity(table.get("scale", 1.0), "1", "task.scale"),
        quantity(table.get("turn", 0.0), "rad", "task.turn"),
    )
    shift = pairs([table["shift"]], "task.shift", unit)[0] if "shift" in table else np.zeros(2)
    if not (isfinite(scale) and scale > 0.0):
        raise ParameterError("task.scale", table["scale"], "be greater than zero")
    if any(key in table for key in ("scale", "turn", "shift")):
        c, s = scale * cos(turned), scale * sin(turned)
        found = found @ np.array([[c, s], [-s, c]]) + shift
    if points or table["kind"] == "timed-path":
        return found, turned
    return TargetPath(points=found, closed=is_closed if closed is None else closed), turned


def _parameter(table: Mapping[str, Any]) -> tuple[int, float | str, float | str]:
    """Number of points of a formula, and the range of its parameter; "360 deg" is an angle, "2*pi" a formula."""
    ends: list[float | str] = []
    for key, usual in (("start", 0.0), ("end", tau)):
        value = table.get(key, usual)
        if isinstance(value, str) and re.fullmatch(r"\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*[A-Za-z]+\s*", value):
            value = quantity(value, "rad", f"task.{key}")
        ends.append(value if isinstance(value, str) else quantity(value, "rad", f"task.{key}"))
    return whole(table.get("n", 72), "task.n", 3), ends[0], ends[1]


def _rotation(table: Mapping[str, Any], n: int) -> FloatArray | None:
    value = table.get("rotation")
    if value is None:
        return None
    if isinstance(value, Mapping):
        check_names(value, "task.rotation", ("from", "to"))
        begin, end = (
            quantity(given(value, key, "task.rotation"), "rad", f"task.rotation.{key}") for key in ("from", "to")
        )
        return np.linspace(begin, end, n)
    return list_of(value, "rad", "task.rotation")


def _weights(table: Mapping[str, Any], rotation: FloatArray | None, n: int = 0) -> FloatArray | None:
    """Weights as a list, or as windows of crank rotation, of an untimed task of point numbers, their ends included."""
    value = table.get("weights")
    if value is None:
        return None
    rows = listed(value, "task.weights")
    if not any(isinstance(row, Mapping) for row in rows):
        return list_of(rows, "1", "task.weights")
    at = np.arange(n, dtype=float) if rotation is None else rotation
    weights = np.ones(len(at))
    for k, window in enumerate(rows):
        name = f"task.weights[{k}]"
        if not isinstance(window, Mapping):
            raise ParameterError(name, window, "be a window as the others, with from, to and weight")
        check_names(window, name, ("from", "to", "weight"))
        ends = [
            float(whole(given(window, key, name), f"{name}.{key}", 0))
            if rotation is None
            else quantity(given(window, key, name), "rad", f"{name}.{key}")
            for key in ("from", "to")
        ]
        within = (at >= ends[0] - 1e-9) & (at <= ends[1] + 1e-9)
        if not within.any():
            raise ParameterError(name, dict(window), "hold at least one target")
        weights[within] = quantity(given(window, "weight", name), "1", f"{name}.weight")
    return weights


def _untimed(table: Mapping[str, Any], path: TargetPath | FloatArray) -> UntimedPath:
    assert isinstance(path, TargetPath)
    straight = table.get("straight")
    smoothing = table.get("smoothing", False)
    if smoothing is not False:
        if straight is not None:
            raise ParameterError(
                "task.smoothing", smoothing, "not come with task.straight, which counts the points given"
            )
        path = _smoothed(smoothing, path)
    more: dict[str, Any] = {}
    if straight is not None:
        if not isinstance(straight, Mapping):
            raise ParameterError("task.straight", straight, "be a table")
        check_names(straight, "task.straight", ("start", "end", "rotation", "flatness", "weight"))
        name = "task.straight"
        flatness = straight.get("flatness")
        more["straight"] = Straight(
            start=whole(given(straight, "start", name), f"{name}.start", 0),
            end=whole(given(straight, "end", name), f"{name}.end", 0),
            rotation=quantity(given(straight, "rotation", name), "rad", f"{name}.rotation"),
            flatness=None if flatness is None else quantity(flatness, "m", f"{name}.flatness"),
            weight=quantity(straight.get("weight", 1.0), "1", f"{name}.weight"),
        )
    if "measure" in table:
        more["measure"] = one_of(table["measure"], "task.measure", ("area", "distance"))
    if "samples" in table:
        more["samples"] = whole(table["samples"], "task.samples", 8)
    return UntimedPath(path=path, weights=_weights(table, None, len(path.points)), **more)


def _smoothed(value: Any, path: TargetPath) -> TargetPath:
    options: Mapping[str, Any] = {}
    if isinstance(value, Mapping):
        check_names(value, "task.smoothing", ("points", "deviation"))
        options = value
    elif value is not True:
        raise ParameterError("task.smoothing", value, "be true, false, or a table with points and deviation")
    deviation = options.get("deviation")
    return path.smoothed(
        whole(options.get("points", 180), "task.smoothing.points", 8),
        deviation=None if deviation is None else quantity(deviation, "m", "task.smoothing.deviation"),
    )


def _rocker_function(table: Mapping[str, Any], folder: Path) -> RockerFunction:
    source = _source(table, ("angle", "file"))
    unit = _unit(table, "angle_unit")
    written = source == "angle" and isinstance(table["angle"], str)
    if not written:
        _only_with(table, ("n", "start", "end"), "angle as a formula")
    if written or source == "file":
        _only_with({k: v for k, v in table.items() if k == "rotation"}, ("rotation",), "angle as a list")
    rotation: FloatArray | None
    if written:
        n, start, end = _parameter(table)
        rotation, angle = function_from_formula(table["angle"], n=n, unit=unit or "rad", start=start, end=end)
    elif source == "file":
        columns, _ = read_points(folder / str(table["file"]))
        rotation, angle = (quantity(f"1 {unit or 'rad'}", "rad", "task.angle_unit") * columns).T
    else:
        angle = list_of(table["angle"], "rad", "task.angle", unit)
        rotation = _rotation(table, len(angle))
    at = turn(len(angle)) if rotation is None else rotation
    return RockerFunction(
        angle=angle,
        rotation=rotation,
        weights=_weights(table, at),
        mounting=flag(table.get("mounting", False), "task.mounting"),
    )
