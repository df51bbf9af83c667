"""Read the points of a curve from a CSV or SVG file."""

from __future__ import annotations

import re
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError

from ..libraries import require
from ..units import INCH, LENGTHS, quantity
from .outputs import note_assumed_units
from .paths import check_ending, first_line, is_number, read_text
from .reader import unknown_name
from .tables import NO_UNIT, SEPARATOR_LINE, heading_unit, is_meant_as_number, units_below

#: Lengths of SVG in m (CSS: an inch has 96 px, 72 pt, 6 pc).
_CSS = {**LENGTHS, "": INCH / 96, "px": INCH / 96, "pt": INCH / 72, "pc": INCH / 6, "q": 0.25e-3}
#: Greatest deviation of the chords from a curve of an SVG file, as a share of the curve's extent.
_CHORD_ERROR = 1e-4
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
#: A cell in quotation marks that needs none.
_QUOTED = re.compile(r'"([^",]*)"')
#: Greatest extent of a curve of an SVG file (m); a larger extent is taken for a typing error.
_WIDEST = 1e9
#: Greatest depth of nested groups and ``<use>`` elements in an SVG file; greatest number of elements after each ``<use>`` is
#: replaced by its target.
_DEPTH, _ELEMENTS = 100, 100_000
#: Words and units in SVG's transforms that svgelements knows; svgelements silently ignores all others.
_TRANSFORMS = {
    "matrix", "translate", "translateX", "translateY", "scale", "scaleX", "scaleY", "rotate", "skew", "skewX", "skewY",
    "px", "pt", "pc", "mm", "cm", "in", "deg", "rad", "grad", "turn", "e", "E",
}  # fmt: skip
#: Elements whose content is drawn only where another element refers to it; svgelements draws the content itself, too.
_REFERENCED = ("symbol", "mask", "marker")
#: A centre of a transform that is not the origin, in a style or an attribute.
_CENTRE = re.compile(
    r"transform-(?:box\s*:\s*(?!view-box)[^\s;}]+|origin\s*:[^;}]*(?:[1-9]|center|right|bottom)[^;}]*)", re.IGNORECASE
)
# Grammars of path data and of points: possessive, so that the match ends at the first mistake. A comma counts as a space.
_NUMBER = r"(?>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)[\s,]*+"
_COUNTS = {"Mm": 2, "Ll": 2, "Tt": 2, "Hh": 1, "Vv": 1, "Cc": 6, "Ss": 4, "Qq": 4}
_COMMANDS = [rf"[{letters}]\s*+(?:(?:{_NUMBER}){{{count}}})++" for letters, count in _COUNTS.items()]
_COMMANDS += [rf"[Aa]\s*+(?:(?:{_NUMBER}){{3}}(?:[01][\s,]*+){{2}}(?:{_NUMBER}){{2}})++", r"[Zz]\s*+"]
_GRAMMARS = {
    "d": re.compile(rf"\s*+(?=[Mm])(?:{'|'.join(_COMMANDS)})*+"),
    "points": re.compile(rf"\s*+(?:(?:{_NUMBER}){{2}})*+"),
}


def read_points(
    path: str | Path, *, unit: str | None = None, name: str | None = None, si: str = "m"
) -> tuple[NDArray[np.float64], bool]:
    """Read the points of a curve from a CSV or SVG file.

    CSV (also ``.txt``): two columns, x and y, separated by commas, semicolons, tabs or spaces; they may have a header line such
    as ``x [mm],y [mm]``, and a line of units below it. Where a semicolon or a tab separates them, numbers may have a decimal
    comma. Empty lines and lines that start with # are ignored. If the last point repeats the first point, it is omitted and the
    curve is closed.

    SVG: the first path that is drawn is read; if there is no path, the first ellipse, circle, polygon, polyline, rectangle or
    line. ``name`` selects an element by its ``id``; if the element is a group, the first path or shape in the group is read.
    Transforms are applied. y points down in SVG, and is turned upwards: a point (x, y) in the user space of the drawing's
    ``viewBox`` becomes (x, -y). Curves are replaced by chords, with a deviation below 1e-4 of the curve's extent. The curve is
    closed if the SVG path is closed, or if the path ends at its first point.

    Parameters
    ----------
    path : path
    unit : str, optional
        Unit of the file's numbers, such as ``"mm"``. The default for CSV is the unit in the header line, or else ``si``. The
        default for SVG is the scale of the file, from ``width``, ``height`` and ``viewBox``; if the file has no scale, pixels
        of 1/96 inch.
    name : str, optional
        ``id`` of the element or group of an SVG file.
    si : str
        SI unit of the two columns of a CSV file, such as ``"rad"``.

    Returns
    -------
    points : ndarray, shape (n, 2)
        Points of the curve, in ``si``.
    closed : bool
        Whether the last point is joined to the first.

    Raises
    ------
    InputError
        If the file cannot be read or is not valid, or its header line contradicts ``unit``; for CSV the message gives the line.
    UnknownNameError
        If no element of the SVG file has this ``id``.
    ParameterError
        If the unit is not of the kind of ``si``.
    MissingLibraryError
        If svgelements, which reads SVG, is not installed.
    """
    path = Path(path)
    ending = check_ending(path, (".csv", ".txt", ".svg"))
    scale = None if unit is None else quantity(f"1 {unit}", si, "unit")
    text = read_text(path)
    if ending == ".svg":
        try:
            with np.errstate(all="ignore"):
                points, closed = _svg_points(path, text, scale, name)
        except LinkworkError:
            raise
        except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
            # errors of svgelements and NumPy for an invalid drawing
            raise InputError(f"{path} has a curve that cannot be read: {first_line(error)[:200]}") from error
        if len(points) < 2 or not np.isfinite(points).all() or not 0.0 < np.ptp(points, axis=0).max() < _WIDEST:
            raise InputError(f"{path} has a curve without an extent, or one beyond {_WIDEST:.0e} m")
        return points, closed
    if name is not None:
        raise InputError(f"{path.name} has one curve, without a name: {name!r} cannot be selected")
    rows, units = _two_columns(path, text)
    for own in units:
        found = quantity(f"1 {own}", si, f"{path.name} in {own!r}")
        if scale is not None and scale != found:
            raise InputError(f"{path.name} is in {own} by its header line, which is not the unit {unit or units[0]}")
        scale = found
    if scale is None:
        note_assumed_units(path, ("", ""), (si, si))
    closed = len(rows) > 2 and bool((rows[0] == rows[-1]).all())
    return (1.0 if scale is None else scale) * (rows[:-1] if closed else rows), closed


def _two_columns(path: Path, text: str) -> tuple[NDArray[np.float64], list[str]]:
    """Return the columns x and y of a CSV file's text, shape (n, 2), and the units in its header line."""
    rows: list[tuple[float, float]] = []
    header = comment = ""
    below: tuple[list[str], int] | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        if ";" in line or "\t" in line.strip():
            line = _DECIMAL_COMMA.sub(".", line)
        line = _QUOTED.sub(r"\1", line)
        cells = re.split(r"\s*[,;]\s*|\s+", line.strip())
        if number == 1 and SEPARATOR_LINE.match(line):
            continue
        if cells == [""] or line.lstrip().startswith("#"):
            comment = line if not rows and line.strip() else comment
            continue
        try:
            x, y = (float(cell) for cell in cells)
        except ValueError:
            if not rows and not header and not any(map(is_meant_as_number, cells)):
                header = line
                continue
            if not rows and below is None and len(cells) == 2 and not any(map(NO_UNIT.match, cells)):
                below = cells, number
                continue
            raise InputError(f"{path}, line {number}: {line.strip()[:100]!r} is not two numbers, x and y") from None
        if not (isfinite(x) and isfinite(y)):
            raise InputError(f"{path}, line {number}: {line.strip()[:100]!r} is not finite")
        rows.append((x, y))
    if not rows:
        raise InputError(f"{path} has no points: it must have two columns of numbers, x and y")
    # NumPy writes headings as a comment
    headings = re.split(r"[,;\t]|(?<=[\])])\s", header or comment)
    units = [heading_unit(heading) for heading in headings]
    if below is not None:
        units = units_below(units, *below, path)
    units = [unit for unit in units if unit]
    return np.array(rows), units if header or len(units) == 2 else []


def _svg_points(path: Path, text: str, scale: float | None, name: str | None) -> tuple[NDArray[np.float64], bool]:
    """Return the points of a curve in an SVG document, shape (n, 2), and whether the curve is closed."""
    require("svgelements")
    from io import StringIO
    from xml.etree import ElementTree

    import svgelements

    try:
        root = ElementTree.fromstring(text)
        _check_tree(path, root)
        metre = _svg_scale(path, root) if scale is None else scale
        _hide_referenced(root, name)
        drawing = svgelements.SVG.parse(StringIO(ElementTree.tostring(root, encoding="unicode")))
    except InputError:
        raise
    except (SyntaxError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path} is not valid SVG: {first_line(error)[:200]}") from error
    if not isinstance(drawing, svgelements.SVG):
        raise InputError(f"{path} is not valid SVG: its outermost element is {root.tag}")
    within = [drawing]
    if name is not None:
        kinds = (svgelements.Shape, svgelements.Group, svgelements.Use)
        named = [element for element in drawing.elements() if isinstance(element, kinds) and element.id is not None]
        within = [element for element in named if element.id == name]
        if not within:
            raise unknown_name(name, [str(element.id)[:100] for element in named[:200]])
    if isinstance(within[0], svgelements.Shape):
        shapes = within[:1]
    else:
        shapes = [shape for shape in within[0].select() if isinstance(shape, svgelements.Shape)]
        shapes = [shape for shape in shapes if shape.values.get("visibility") not in ("hidden", "collapse")]
    shapes.sort(key=lambda shape: not isinstance(shape, svgelements.Path))
    if not shapes:
        raise InputError(f"{path} has no path")
    said = f"the path {shapes[0].id}" if shapes[0].id else "the path"
    for entry, grammar in _GRAMMARS.items():
        data = str(shapes[0].values.get(entry, ""))
        read = grammar.match(data)
        if rest := data[read.end() if read else 0 :].strip():
            raise InputError(f"{path}: {said} has a mistake in its {entry!r}, at {rest[:40]!r}")
    # transform the pixels of the page back to the user space, because svgelements rounds a millimetre to 3.7795296 px
    curve = abs(svgelements.Path(shapes[0]) * ~svgelements.Matrix(drawing.viewbox_transform or ""))
    curves = [part for part in curve.as_subpaths() if any(not isinstance(s, svgelements.Move) for s in part)]
    if len(curves) != 1:
        raise InputError(f"{path}: {said} has {len(curves)} curves: it must have one")
    segments = [s for s in curves[0] if not isinstance(s, svgelements.Move)]
    extent = float(np.ptp(np.vstack([_chords(s, np.inf) for s in segments]), axis=0).max())
    points = np.vstack([_chords(s, _CHORD_ERROR * extent) for s in segments])
    # a segment begins with the last point of the previous segment, and may have no length, such as a Z at the first point
    points = points[np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-9 * extent)]
    gap = float(np.hypot(*(points[-1] - points[0])))
    closed = gap <= 1e-9 * extent
    return (points[:-1] if closed else points) * np.array([metre, -metre]), closed


def _check_tree(path: Path, root: Any) -> None:
    """Check the transforms of an SVG drawing, and the number of its elements after each ``<use>`` is replaced by its target.

    Raises InputError if svgelements does not know a transform or its centre, or if the drawing has too many elements.
    """
    named = {element.get("id"): element for element in root.iter() if element.get("id") is not None}
    sizes: dict[int, int] = {}

    def size(element: Any, depth: int) -> int:
        """Count an element and the elements inside it, with each ``<use>`` replaced by its target."""
        if depth > _DEPTH:
            raise InputError(f"{path} has groups and uses inside each other, deeper than {_DEPTH}, or a use of itself")
        if id(element) not in sizes:
            inside = list(element)
            if str(element.tag).rpartition("}")[2] == "use":
                links = (value for key, value in element.items() if key.rpartition("}")[2] == "href")
                inside += [named[link.strip()[1:]] for link in links if link.strip()[1:] in named]
            sizes[id(element)] = 1 + sum(size(child, depth + 1) for child in inside)
        return sizes[id(element)]

    for element in root.iter():
        sheet = element.text if str(element.tag).rpartition("}")[2] == "style" else element.get("style")
        own = f"{sheet or ''};transform-origin:{element.get('transform-origin', '')};"
        moved = element.get("transform") or re.search(r"(?<![\w-])transform\s*:", own)
        if moved and (centre := _CENTRE.search(own)):
            raise InputError(
                f"{path} has a transform about a centre of its own, {centre[0][:60]!r}, which is not read: save the drawing "
                "with plain transforms, such as rotate(30, x, y)"
            )
    for transform in filter(None, (element.get("transform") for element in root.iter())):
        other = set(re.findall(r"[^\W\d_]+", transform)) - _TRANSFORMS
        if other:
            raise InputError(
                f"{path} has the transform {transform[:100]!r}: {min(other)[:50]!r} is neither a transformation, such as "
                "translate(10, 20), nor a number"
            )
    if size(root, 0) > _ELEMENTS:
        raise InputError(f"{path} has more than {_ELEMENTS} elements with all its uses replaced")


def _hide_referenced(root: Any, wanted: str | None) -> None:
    """Hide from svgelements the parts of an SVG drawing that are drawn only where another element refers to them.

    They are put into ``<defs>``, which svgelements does not draw, unless they contain the element with the id ``wanted``.
    """
    for parent in list(root.iter()):
        for place, child in enumerate(parent):
            space, bracket, kind = str(child.tag).rpartition("}")
            if kind in _REFERENCED and not (wanted and any(inner.get("id") == wanted for inner in child.iter())):
                parent[place] = parent.makeelement(f"{space}{bracket}defs", {})
                parent[place].append(child)


def _chords(segment: Any, allowed: float) -> NDArray[np.float64]:
    """Return points on a segment of an SVG path, so close that the chords deviate from the segment by at most ``allowed``."""
    import svgelements

    if isinstance(segment, svgelements.Line | svgelements.Close):
        return np.array([segment.start, segment.end], dtype=float)
    n = 8
    while True:
        # chords join every second point; the points between them show the deviation
        points = np.array(segment.npoint(np.linspace(0.0, 1.0, 2 * n + 1)), dtype=float)
        if n > 2000 or np.hypot(*(points[1::2] - 0.5 * (points[:-1:2] + points[2::2])).T).max() <= allowed:
            return points[::2]
        n *= 2


def _svg_scale(path: Path, root: Any) -> float:
    """Return the length of a user unit of an SVG document in metres."""
    lengths: list[float | None] = []
    given = [root.get(key, "").strip() for key in ("width", "height")]
    for length in given:
        found = re.fullmatch(r"((?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*(px|mm|cm|in|pt|pc|q|)", length.lower())
        lengths.append(float(found[1]) * _CSS[found[2]] or None if found else None)
    unread = [length for length in given if not (length in ("", "auto") or length.endswith("%"))]
    if lengths == [None, None] and unread:
        raise InputError(f"{path} is {unread[0][:40]!r} wide or high: it must be a length such as '210mm'")
    box = root.get("viewBox")
    if box is None or lengths == [None, None]:
        return _CSS["px"]
    numbers = re.split(r"[\s,]+", box.strip())
    four = len(numbers) == 4 and all(map(is_number, numbers))
    if not (four and all(0.0 < float(n) < inf for n in numbers[2:])):
        raise InputError(
            f"{path} has the viewBox {box!r}: it must be four numbers, the width and the height above zero"
        )
    scales = [length / float(side) for length, side in zip(lengths, numbers[2:]) if length is not None]
    if len(scales) == 2 and abs(scales[1] / scales[0] - 1.0) > 1e-6 and root.get("preserveAspectRatio") == "none":
        raise InputError(f"{path} is stretched: one unit is {scales[0]:.6g} m wide and {scales[1]:.6g} m high")
    return max(scales) if "slice" in root.get("preserveAspectRatio", "") else min(scales)
