"""Reading and writing files: CSV results, curves, drawings, and parameters and cases in TOML or JSON with units.

In a file every quantity is a number in SI or a text with its unit, such as ``"15.35 cm"`` or ``"420 rpm"``; the unit's
dimension is checked. Names are those of the FMI contract: ``[slider] stiffness`` is ``slider.stiffness``.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, asdict, fields
from functools import lru_cache
from math import inf, isfinite, pi
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, MissingParameterError, ParameterError, UnknownNameError
from linkwork.parameters import field_name

from ..mechanisms import FIVE_BAR, MECHANISMS, Mechanism, Parameters, mechanism_of
from ..run.case import PUBLISHED, Case
from ..run.inputs import (
    Channels,
    Harmonics,
    InductionMotor,
    Inputs,
    Piecewise,
    Signal,
    SliderCrankInputs,
    Torque,
    TorsionBar,
    ramp,
    table,
)
from .drawings import Drawing, to_dxf, to_svg

#: Units of the contract as pint spells them.
_PINT = {
    "1": "dimensionless",
    "N.m": "N*m",
    "kg.m2": "kg*m**2",
    "m/s2": "m/s**2",
    "rad/s2": "rad/s**2",
    "N.s/m": "N*s/m",
}


def write_csv(path: str | Path, columns: Mapping[str, ArrayLike]) -> Path:
    """Write columns of equal length with a header line; numbers in full precision.

    Raises
    ------
    InputError
        If the columns differ in length.
    """
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    lengths = {name: len(values) for name, values in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"the columns of a CSV file differ in length: {lengths}")
    path = _prepare(path)
    part = path.with_name(path.name + ".part")
    # a name with a comma in it is one column all the same
    header = ",".join(f'"{name}"' if "," in name else name for name in arrays)
    np.savetxt(part, np.column_stack(list(arrays.values())), delimiter=",", header=header, comments="", fmt="%.17g")
    os.replace(part, path)
    return path


def save_figure(figure: Any, path: str | Path, *, dpi: int = 150) -> Path:
    """Write a Matplotlib figure, as the format that the path's ending names."""
    path = _prepare(path)
    figure.savefig(path, dpi=dpi)
    return path


def save_array(path: str | Path, values: ArrayLike) -> Path:
    """Write an array to a file that is there as a whole or not at all, for caches; see `load_array`."""
    target = _prepare(path)
    part = target.with_name(f"{target.name}.{os.getpid()}.part")
    with part.open("wb") as file:
        np.save(file, np.asarray(values, dtype=float))
    os.replace(part, target)
    return target


def load_array(path: str | Path) -> NDArray[np.float64] | None:
    """An array from a file of `save_array`; None if it is not there or damaged."""
    try:
        with Path(path).open("rb") as file:
            values: NDArray[np.float64] = np.load(file)
    except (OSError, ValueError, EOFError):
        return None
    return values


def _prepare(path: str | Path) -> Path:
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


# Curves and drawings

#: Lengths of SVG in m (CSS: an inch has 96 px, 72 pt, 6 pc).
_CSS = {"": 0.0254 / 96, "px": 0.0254 / 96, "mm": 1e-3, "cm": 1e-2, "in": 0.0254, "pt": 0.0254 / 72, "pc": 0.0254 / 6}
#: Deviation of the chords from a curve of an SVG file, as a share of the curve's extent.
_CHORD_ERROR = 1e-4


def save_drawing(path: str | Path, drawing: Drawing, *, unit: str = "mm") -> Path:
    """Write a drawing as DXF or SVG, as the path's ending says.

    Raises
    ------
    InputError
        If the ending is another.
    ParameterError
        If the unit is not one that the format has.
    """
    path = Path(path)
    writers = {".dxf": to_dxf, ".svg": to_svg}
    ending = path.suffix.lower()
    if ending not in writers:
        raise InputError(f"{path.name} ends in {path.suffix!r}: it must end in .dxf or .svg")
    text = writers[ending](drawing, unit)
    _prepare(path).write_bytes(text.encode())
    return path


def read_points(
    path: str | Path, *, unit: str | None = None, name: str | None = None
) -> tuple[NDArray[np.float64], bool]:
    """Points of a curve from a CSV or SVG file, as the path's ending says.

    CSV (also ``.txt``): two columns, x and y, between commas, semicolons, tabs or spaces; a header line, empty lines and
    lines that start with # are passed over. The curve is closed if its last point is its first again, which is then left
    out.

    SVG: the first path, or without one the first ellipse, circle, polygon, polyline, rectangle or line; ``name`` is the
    ``id`` of the element, or of a group to take the first one from.
    Transforms are honoured, and y, which points down in SVG, is turned upwards: a point (x, y) of the user space that the
    drawing's ``viewBox`` is in comes out at (x, -y). Curves become chords that are within 1e-4 of the curve's extent.
    The curve is closed if its path says so or ends where it started.

    Parameters
    ----------
    path : path
    unit : str, optional
        Unit of the file's numbers, such as ``"mm"``. By default m for CSV; an SVG file's own scale (``width`` and
        ``height`` with ``viewBox``; if it has none, pixels of 1/96 inch).
    name : str, optional
        ``id`` of the element or group of an SVG file.

    Returns
    -------
    points : ndarray, shape (n, 2)
        m.
    closed : bool

    Raises
    ------
    InputError
        If the file cannot be read, or is not of this kind; with the line for CSV.
    UnknownNameError
        If nothing in an SVG file has the name.
    ParameterError
        If the unit is not one of length.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".csv", ".txt", ".svg"):
        raise InputError(f"{path.name} ends in {path.suffix!r}: points are read from .csv, .txt or .svg")
    scale = None if unit is None else quantity(f"1 {unit}", "m", "unit")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} cannot be read: it is not text in UTF-8") from error
    if ending == ".svg":
        return _svg_points(path, text, scale, name)
    if name is not None:
        raise InputError(f"{path.name} has one curve without a name: {name!r} cannot be looked up in it")
    rows = _two_columns(path, text)
    closed = len(rows) > 2 and bool((rows[0] == rows[-1]).all())
    return (1.0 if scale is None else scale) * (rows[:-1] if closed else rows), closed


def _two_columns(path: Path, text: str) -> NDArray[np.float64]:
    rows: list[tuple[float, float]] = []
    header = False
    for number, line in enumerate(text.splitlines(), start=1):
        cells = re.split(r"\s*[,;]\s*|\s+", line.strip())
        if cells == [""] or line.lstrip().startswith("#"):
            continue
        try:
            x, y = (float(cell) for cell in cells)
        except ValueError:
            if not rows and not header and not any(_is_number(cell) for cell in cells):
                header = True
                continue
            raise InputError(f"{path}, line {number}: {line.strip()!r} is not two numbers, x and y") from None
        if not (isfinite(x) and isfinite(y)):
            raise InputError(f"{path}, line {number}: {line.strip()!r} is not finite")
        rows.append((x, y))
    if not rows:
        raise InputError(f"{path} has no points: it must have two columns of numbers, x and y")
    return np.array(rows)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _svg_points(path: Path, text: str, scale: float | None, name: str | None) -> tuple[NDArray[np.float64], bool]:
    from io import StringIO
    from xml.etree import ElementTree

    import svgelements

    try:
        root = ElementTree.fromstring(text)
        drawing = svgelements.SVG.parse(StringIO(text))
    except (ElementTree.ParseError, ValueError, TypeError, AttributeError, KeyError, IndexError) as error:
        raise InputError(f"{path} is not valid SVG: {_first_sentence(error)}") from error
    if not isinstance(drawing, svgelements.SVG):
        raise InputError(f"{path} is not valid SVG: its outermost element is {root.tag}")
    metre = _svg_scale(path, root) if scale is None else scale
    within = [drawing]
    if name is not None:
        kinds = (svgelements.Shape, svgelements.Group, svgelements.Use)
        named = [element for element in drawing.elements() if isinstance(element, kinds) and element.id is not None]
        within = [element for element in named if element.id == name]
        if not within:
            raise unknown_name(name, [str(element.id) for element in named])
    shapes = [within[0]] if isinstance(within[0], svgelements.Shape) else within[0].select()
    shapes = [shape for shape in shapes if isinstance(shape, svgelements.Shape)]
    shapes.sort(key=lambda shape: not isinstance(shape, svgelements.Path))
    if not shapes:
        raise InputError(f"{path} has no path")
    # back from the pixels of the page to the user space; svgelements rounds a millimetre to 3.7795296 px
    curve = abs(svgelements.Path(shapes[0]) * ~svgelements.Matrix(drawing.viewbox_transform or ""))
    curves = [part for part in curve.as_subpaths() if any(not isinstance(s, svgelements.Move) for s in part)]
    if len(curves) != 1:
        raise InputError(f"{path}: the path {shapes[0].id or ''} has {len(curves)} curves: it must have one")
    segments = [s for s in curves[0] if not isinstance(s, svgelements.Move)]
    extent = float(np.ptp(np.vstack([_chords(s, np.inf) for s in segments]), axis=0).max())
    points = np.vstack([_chords(s, _CHORD_ERROR * extent) for s in segments])
    # each segment starts where the one before ended, and may have no length, as a Z at the first point
    points = points[np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-9 * extent)]
    gap = float(np.hypot(*(points[-1] - points[0])))
    closed = gap <= 1e-9 * extent
    return (points[:-1] if closed else points) * np.array([metre, -metre]), closed


def _chords(segment: Any, allowed: float) -> NDArray[np.float64]:
    """Points of a segment of an SVG path whose chords are within ``allowed`` of it."""
    import svgelements

    if isinstance(segment, svgelements.Line | svgelements.Close):
        return np.array([segment.start, segment.end], dtype=float)
    n = 8
    while True:
        # a chord from each second point to the next; between them the middles
        points = np.array(segment.npoint(np.linspace(0.0, 1.0, 2 * n + 1)), dtype=float)
        if n > 2000 or np.hypot(*(points[1::2] - 0.5 * (points[:-1:2] + points[2::2])).T).max() <= allowed:
            return points[::2]
        n *= 2


def _svg_scale(path: Path, root: Any) -> float:
    """Metres per user unit of an SVG document."""
    lengths: list[float | None] = []
    for key in ("width", "height"):
        found = re.fullmatch(r"\s*((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(px|mm|cm|in|pt|pc|)\s*", root.get(key, ""))
        lengths.append(float(found[1]) * _CSS[found[2]] if found else None)
    box = root.get("viewBox")
    if box is None or lengths == [None, None]:
        return _CSS["px"]
    numbers = re.split(r"[\s,]+", box.strip())
    if len(numbers) != 4 or not all(_is_number(n) for n in numbers) or min(float(n) for n in numbers[2:]) <= 0.0:
        raise InputError(
            f"{path} has the viewBox {box!r}: it must be four numbers, the width and the height above zero"
        )
    scales = [length / float(side) for length, side in zip(lengths, numbers[2:]) if length is not None]
    if len(scales) == 2 and abs(scales[1] / scales[0] - 1.0) > 1e-6 and root.get("preserveAspectRatio") == "none":
        raise InputError(f"{path} is stretched: one unit is {scales[0]:.6g} m wide and {scales[1]:.6g} m high")
    return min(scales)


# Quantities


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


def quantity(value: Any, unit: str, name: str) -> float:
    """A number in SI from a number or a text with a unit.

    Parameters
    ----------
    value : float or str
        ``0.1535`` or ``"15.35 cm"``. A text needs its unit: a bare "30" for an angle was hardly meant in radians.
    unit : str
        SI unit of the contract, such as ``N.s/m``.
    name : str
        What it is, for the error.

    Raises
    ------
    ParameterError
        If it is neither, the unit is missing or has another dimension, or the number is not finite. Hertz is refused for
        a speed: a cycle is not a radian.
    """
    si = _PINT.get(unit, unit)
    wanted = f"be a number in {unit}" if unit == "1" else f"be a number in {unit}, or a text with a unit of that kind"
    if isinstance(value, bool):
        raise ParameterError(name, value, wanted)
    if isinstance(value, (int, float)):
        try:
            number = float(value)
        except OverflowError:  # a whole number beyond all floats
            number = inf
        if not isfinite(number):
            raise ParameterError(name, value, "be a finite number")
        return number
    if not isinstance(value, str):
        raise ParameterError(name, value, wanted)
    import pint

    if unit == "rad/s" and "hz" in value.lower().replace("hertz", "hz"):
        raise ParameterError(name, value, "be in rad/s or rpm: in Hz it would be ambiguous by a factor of 2 pi")
    try:
        bare: float | None = float(value)
    except ValueError:
        bare = None
    if bare is not None and unit != "1":
        raise ParameterError(name, value, f"come with its unit, such as '{value} {si}', or be a number, which is in SI")
    try:
        number = bare if bare is not None else float(_registry().Quantity(value).to(si).magnitude)
    except (pint.PintError, ValueError, TypeError, AttributeError, ArithmeticError, SyntaxError) as error:
        raise ParameterError(name, value, f"{wanted} ({_first_sentence(error)})") from error
    if not isfinite(number):
        raise ParameterError(name, value, "be a finite number")
    return number


def _first_sentence(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]


def unknown_name(name: str, known: Iterable[str]) -> UnknownNameError:
    """The error for a name that is not among those known, with the nearest of them."""
    names = tuple(known)
    near = difflib.get_close_matches(name, names, n=1)
    return UnknownNameError(name, names, near[0] if near else None)


def _flatten(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in data.items():
        if isinstance(value, Mapping):
            flat |= _flatten(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value
    return flat


# Parameters


def parameters_from(
    data: Mapping[str, Any], base: Parameters | None = None, mechanism: Mechanism = FIVE_BAR
) -> Parameters:
    """Parameters from nested tables or dotted names; what they leave out is taken from ``base``.

    Parameters
    ----------
    data : mapping
    base : FiveBarParameters or SliderCrankParameters, optional
    mechanism : Mechanism
        Whose parameters they are; with a base, the base's.

    Raises
    ------
    ParameterError
        If a name is unknown, a value is wrong, or, without a base, one is missing.
    """
    mechanism = mechanism if base is None else mechanism_of(base)
    known = mechanism.mechanism_variables
    values: dict[str, Any] = {}
    for name, value in _flatten(data).items():
        if name not in known:
            raise unknown_name(name, known)
        if known[name].kind == "Integer":
            if isinstance(value, bool) or not isinstance(value, int):
                raise ParameterError(name, value, "be +1 or -1")
            values[field_name(name)] = value
        else:
            values[field_name(name)] = quantity(value, known[name].unit, name)
    if base is not None:
        values = {field: getattr(base, field) for field in base.__dataclass_fields__} | values
    defaults = {field.name: field.default for field in fields(mechanism.parameters)}
    missing = [name for name in known if field_name(name) not in values and defaults[field_name(name)] is MISSING]
    if missing:
        raise MissingParameterError(missing[0], tuple(missing[1:]))
    made: Parameters = mechanism.parameters(**values)
    return made


def parameters_to(parameters: Parameters) -> dict[str, Any]:
    """Parameters as nested tables of texts with SI units, every digit kept; those of the five-bar need no ``mechanism``."""
    mechanism = mechanism_of(parameters)
    data: dict[str, Any] = {} if mechanism is FIVE_BAR else {"mechanism": mechanism.name}
    for name, variable in mechanism.mechanism_variables.items():
        value = getattr(parameters, field_name(name))
        text = value if variable.kind == "Integer" else f"{float(value)!r} {_PINT.get(variable.unit, variable.unit)}"
        group, _, leaf = name.rpartition(".")
        (data.setdefault(group, {}) if group else data)[leaf] = text
    return data


def _mechanism_named(data: Mapping[str, Any]) -> Mechanism:
    """The mechanism that a file is about: its ``mechanism``, by default the five-bar."""
    name = data.get("mechanism", FIVE_BAR.name)
    if not isinstance(name, str) or name not in MECHANISMS:
        raise ParameterError("mechanism", name, f"be one of {', '.join(MECHANISMS)}")
    return MECHANISMS[name]


def save_parameters(path: str | Path, parameters: Parameters) -> Path:
    """Write parameters to a TOML or JSON file, as the path's ending says."""
    kinds = tuple(mechanism.parameters for mechanism in MECHANISMS.values())
    if not isinstance(parameters, kinds):
        names = " or ".join(kind.__name__ for kind in kinds)
        raise InputError(f"save_parameters takes a path and {names}, not {type(parameters).__name__}")
    return write_tables(path, parameters_to(parameters))


def load_parameters(path: str | Path) -> Parameters:
    """Read parameters from a TOML or JSON file.

    Raises
    ------
    InputError
        If the file cannot be read.
    ParameterError
        As `parameters_from`.
    """
    data = read_tables(path)
    mechanism = _mechanism_named(data)
    return parameters_from({k: v for k, v in data.items() if k != "mechanism"}, mechanism=mechanism)


def write_tables(path: str | Path, data: Mapping[str, Any]) -> Path:
    """Write nested tables to a TOML or JSON file, as the path's ending says.

    Raises
    ------
    InputError
        If the ending is another.
    """
    path = _prepare(path)
    ending = path.suffix.lower()
    if ending == ".toml":
        # plain values before tables, as TOML asks
        ordered = {k: v for k, v in data.items() if not isinstance(v, dict)} | {
            k: v for k, v in data.items() if isinstance(v, dict)
        }
        path.write_text(tomli_w.dumps(ordered), encoding="utf-8")
    elif ending == ".json":
        path.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
    else:
        raise InputError(f"{path.name} ends in {ending!r}: it must end in .toml or .json")
    return path


def read_tables(path: str | Path) -> dict[str, Any]:
    """Nested tables from a TOML or JSON file.

    Raises
    ------
    InputError
        If the file cannot be read, or is not what its ending says.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".toml", ".json"):
        raise InputError(f"{path.name} ends in {ending!r}: it must end in .toml or .json")
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} cannot be read: it is not text in UTF-8") from error
    try:
        data = tomllib.loads(text) if ending == ".toml" else json.loads(text)
    except (tomllib.TOMLDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path} is not valid {ending[1:].upper()}: {_first_sentence(error)}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} must hold tables, not {type(data).__name__}")
    return data


# Cases

#: Entries of a case file that are not parameters of the mechanism.
_CASE_KEYS = {
    "five-bar": ("mechanism", "title", "published", "initial", "drive", "force", "load", "run"),
    "slider-crank": ("mechanism", "title", "published", "initial", "drive", "axial", "load", "run"),
}


def load_case(path: str | Path, overrides: Mapping[str, Any] | None = None) -> Case:
    """Read a case from a TOML or JSON file; see `docs/case-files.md`.

    Parameters
    ----------
    path : path
    overrides : mapping, optional
        Values by dotted name that replace the file's, such as ``slider.stiffness``, ``drive.speed`` or ``run.stop_time``.

    Raises
    ------
    InputError
        If the file cannot be read or leaves out what a run needs.
    ParameterError
        If a name is unknown or a value is wrong.
    """
    return case_from(read_tables(path), folder=Path(path).parent, title=Path(path).stem, overrides=overrides)


def case_from(
    data: Mapping[str, Any], *, folder: Path, title: str = "", overrides: Mapping[str, Any] | None = None
) -> Case:
    """A case from the tables of a case file; ``folder`` is where its CSV tables are looked for."""
    data = _overridden(data, overrides or {})
    base, speed, start = None, None, {}
    mechanism = _mechanism_named(data)
    published = data.get("published")
    if published is not None:
        if not isinstance(published, str) or published not in PUBLISHED:
            raise unknown_name(str(published), PUBLISHED)
        base = PUBLISHED[published].parameters
        speed = PUBLISHED[published].crank_speed
        if "mechanism" in data and mechanism is not mechanism_of(base):
            raise ParameterError("mechanism", data["mechanism"], f"be that of the published set {published}")
        mechanism = mechanism_of(base)
        # a five-bar's published start is at rest but for the speed, which the drive gives
        start = {} if mechanism is FIVE_BAR else asdict(PUBLISHED[published].initial)
    flat = _flatten({name: value for name, value in data.items() if name not in _CASE_KEYS[mechanism.name]})
    initial_values = _table(data, "initial")
    run = _table(data, "run")
    parameters = parameters_from(flat, base, mechanism)
    known = mechanism.initial_variables
    for name in initial_values:
        if name not in known:
            raise unknown_name(f"initial.{name}", [f"initial.{n}" for n in known])
    given = {name: quantity(value, known[name].unit, f"initial.{name}") for name, value in initial_values.items()}
    initial = mechanism.initial(**start | given)
    read = _inputs if mechanism is FIVE_BAR else _slider_crank_inputs
    inputs = read(data, folder, speed)
    if inputs.axial_mode == 2 and getattr(parameters, "groove_amplitude", 1.0) == 0.0:
        raise ParameterError(
            "groove.amplitude", 0.0, "be given with axial.groove: a groove without it holds the shift at zero"
        )
    if inputs.axial_mode == 1 and not inputs.parts("shift_speed") and given.get("shift_velocity"):
        raise ParameterError(
            "initial.shift_velocity", given["shift_velocity"], "come with axial.force: the shift is held"
        )
    stop_time, step, tolerance = _run_table(run, inputs)
    return Case(
        title=str(data.get("title", title)),
        parameters=parameters,
        initial=initial,
        inputs=inputs,
        stop_time=stop_time,
        step=step,
        tolerance=tolerance,
    )


def _overridden(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with single values replaced, by dotted name; one way of driving a freedom replaces the other."""
    result = {name: dict(value) if isinstance(value, Mapping) else value for name, value in data.items()}
    for name, value in overrides.items():
        group, _, leaf = name.rpartition(".")
        if group in ("drive", "axial"):
            result[group] = {leaf: value}
        elif group:
            table = result.setdefault(group, {})
            if not isinstance(table, dict):
                raise ParameterError(group, table, "be a table")
            table[leaf] = value
        else:
            result[leaf] = value
    return result


def _table(data: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    value = data.get(name, {})
    if not isinstance(value, Mapping):
        raise ParameterError(name, value, "be a table")
    return value


def _drive(data: Mapping[str, Any], folder: Path, speed: float | None) -> dict[str, Any]:
    """What drives the crank: its speed, by default that of a published set, or a torque or the sum of several."""
    drive = _table(data, "drive")
    for name in drive:
        if name not in ("speed", "torque"):
            raise unknown_name(f"drive.{name}", ["drive.speed", "drive.torque"])
    if not drive and speed is not None:
        drive = {"speed": speed}
    torque = drive.get("torque")
    laws = torque if isinstance(torque, list) else [] if torque is None else [torque]
    return {
        "speed": _signal(drive["speed"], "rad/s", "drive.speed", folder) if "speed" in drive else None,
        "torque": tuple(_torque(law, folder) for law in laws) if laws else None,
    }


def _inputs(data: Mapping[str, Any], folder: Path, speed: float | None) -> Channels:
    load = _table(data, "load")
    for name in load:
        if name not in ("fx", "fy"):
            raise unknown_name(f"load.{name}", ["load.fx", "load.fy"])
    return Inputs(
        **_drive(data, folder, speed),
        force=_signal(data.get("force", 0.0), "N", "force", folder),
        load_x=_signal(load.get("fx", 0.0), "N", "load.fx", folder),
        load_y=_signal(load.get("fy", 0.0), "N", "load.fy", folder),
    )


def _slider_crank_inputs(data: Mapping[str, Any], folder: Path, speed: float | None) -> Channels:
    axial = _table(data, "axial")
    for name in axial:
        if name not in ("speed", "force", "groove"):
            raise unknown_name(f"axial.{name}", ["axial.speed", "axial.force", "axial.groove"])
    groove = axial.get("groove", False)
    if not isinstance(groove, bool):
        raise ParameterError("axial.groove", groove, "be true or false")
    if len(axial) > 1:
        raise ParameterError("axial", ", ".join(axial), "have one of speed, force and groove")
    load = data.get("load", 0.0)
    if isinstance(load, Mapping) and "kind" not in load:
        raise ParameterError(
            "load", ", ".join(load), "be one force, along the guide: a quantity, or a table with its kind"
        )
    return SliderCrankInputs(
        **_drive(data, folder, speed),
        load=_signal(load, "N", "load", folder),
        shift_speed=_signal(axial["speed"], "m/s", "axial.speed", folder) if "speed" in axial else None,
        axial_force=_signal(axial["force"], "N", "axial.force", folder) if "force" in axial else None,
        groove=groove,
    )


def _torque(value: Any, folder: Path) -> Torque:
    if isinstance(value, Mapping):
        kind = value.get("kind")
        if kind == "torsion-bar":
            entries = _entries(value, "drive.torque", {"torque": "N.m", "release_angle": "rad"}, required=("torque",))
            return TorsionBar(**entries)
        if kind == "induction-motor":
            units = {"breakdown_torque": "N.m", "breakdown_slip": "1", "synchronous_speed": "rad/s"}
            return InductionMotor(**_entries(value, "drive.torque", units, required=units))
    return _signal(value, "N.m", "drive.torque", folder, extra=("torsion-bar", "induction-motor"))


def _signal(value: Any, unit: str, name: str, folder: Path, extra: tuple[str, ...] = ()) -> Signal:
    if not isinstance(value, Mapping):
        return quantity(value, unit, name)
    kind = value.get("kind")
    if kind == "ramp":
        units = {"start": unit, "end": unit, "from_time": "s", "to_time": "s"}
        e = _entries(value, name, units, required=units)
        return ramp(e["start"], e["end"], e["from_time"], e["to_time"])
    if kind == "table":
        return _tabulated(value, unit, name, folder)
    if kind == "harmonics":
        check_names(value, name, ("kind", "mean", "amplitudes", "frequencies", "phases"))
        rows = {key: _list(value, key, name) for key in ("amplitudes", "frequencies")}
        phases = value.get("phases", [0.0] * len(rows["amplitudes"]))
        return Harmonics(
            quantity(value.get("mean", 0.0), unit, f"{name}.mean"),
            [quantity(a, unit, f"{name}.amplitudes") for a in rows["amplitudes"]],
            [quantity(f, "rad/s", f"{name}.frequencies") for f in rows["frequencies"]],
            [quantity(p, "rad", f"{name}.phases") for p in phases],
        )
    kinds = ("ramp", "table", "harmonics", *extra)
    raise ParameterError(f"{name}.kind", kind, f"be one of {', '.join(kinds)}")


def _tabulated(value: Mapping[str, Any], unit: str, name: str, folder: Path) -> Piecewise:
    check_names(value, name, ("kind", "times", "values", "file", "interpolation"))
    interpolation = value.get("interpolation", "linear")
    if "file" in value:
        path = folder / str(value["file"])
        try:
            rows = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
        except (OSError, ValueError) as error:
            raise InputError(f"{name}: {path} cannot be read as CSV: {_first_sentence(error)}") from error
        if rows.shape[1] < 2:
            raise InputError(f"{name}: {path} must have two columns, time in s and value in {unit}")
        return table(rows[:, 0], rows[:, 1], interpolation)
    times = [quantity(t, "s", f"{name}.times") for t in _list(value, "times", name)]
    values = [quantity(v, unit, f"{name}.values") for v in _list(value, "values", name)]
    return table(times, values, interpolation)


def _list(value: Mapping[str, Any], key: str, name: str) -> list[Any]:
    found = value.get(key)
    if not isinstance(found, list):
        raise ParameterError(f"{name}.{key}", found, "be a list")
    return found


def check_names(value: Mapping[str, Any], name: str, keys: Iterable[str]) -> None:
    """Make sure that a table has no other entries than these.

    Raises
    ------
    UnknownNameError
        For the first that is none of them.
    """
    for key in value:
        if key not in keys:
            raise unknown_name(f"{name}.{key}", [f"{name}.{k}" for k in keys])


def _entries(
    value: Mapping[str, Any], name: str, units: Mapping[str, str], required: Iterable[str]
) -> dict[str, float]:
    check_names(value, name, ("kind", *units))
    for key in required:
        if key not in value:
            raise MissingParameterError(f"{name}.{key}")
    return {key: quantity(value[key], unit, f"{name}.{key}") for key, unit in units.items() if key in value}


def _run_table(run: Mapping[str, Any], inputs: Channels) -> tuple[float, float, float]:
    keys = ("stop_time", "revolutions", "step", "tolerance")
    for name in run:
        if name not in keys:
            raise unknown_name(f"run.{name}", [f"run.{key}" for key in keys])
    tolerance = quantity(run.get("tolerance", 1e-9), "1", "run.tolerance")
    constant = float(inputs.speed) if isinstance(inputs.speed, (int, float)) and inputs.speed != 0.0 else None
    turn = None if constant is None else 2.0 * pi / abs(constant)
    if "stop_time" in run and "revolutions" in run:
        raise ParameterError("run.revolutions", run["revolutions"], "not come together with run.stop_time")
    if "stop_time" in run:
        stop_time = quantity(run["stop_time"], "s", "run.stop_time")
    elif "revolutions" in run:
        if turn is None:
            raise ParameterError(
                "run.revolutions", run["revolutions"], "come with a constant drive.speed; give run.stop_time"
            )
        revolutions = quantity(run["revolutions"], "1", "run.revolutions")
        if revolutions <= 0.0:
            raise ParameterError("run.revolutions", run["revolutions"], "be greater than zero")
        stop_time = revolutions * turn
    elif turn is not None:
        stop_time = 3.0 * turn
    else:
        raise MissingParameterError("run.stop_time")
    step = quantity(run["step"], "s", "run.step") if "step" in run else 1e-3 if turn is None else turn / 360.0
    return stop_time, step, tolerance
