"""A linkage and its curves drawn to scale, as plain lines, circles, polylines and texts on named layers, for CAD.

A `Drawing` is in m with y upwards and knows no mechanics; it may have dimensions. `to_dxf` and `to_svg` write it in a unit of
length; the same drawing gives the same text, byte for byte.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from io import StringIO
from math import atan2, cos, degrees, hypot, isfinite, radians, sin
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError

from ..libraries import require
from ..units import LENGTHS
from .outputs import output, write_text
from .paths import ending_of
from .reader import unknown_name

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """How what is on a layer looks: its colour as 0xRRGGBB and the width of its lines (m).

    Where the reader is to see it at any rate it is in the ``foreground``: in DXF black on white and white on black.
    """

    colour: int
    width: float
    foreground: bool = False


#: The layers there are, drawn in this order; their colours are seen on white and on black.
LAYERS = {
    "poses": Layer(colour=0x808080, width=0.13e-3),
    "ground": Layer(colour=0x404040, width=0.35e-3, foreground=True),
    "guide": Layer(colour=0x808080, width=0.25e-3),
    "crank": Layer(colour=0xC0392B, width=0.5e-3),
    "coupler": Layer(colour=0x1F6FB4, width=0.5e-3),
    "rocker": Layer(colour=0x2E8B57, width=0.5e-3),
    "slider": Layer(colour=0x8E44AD, width=0.35e-3),
    "coupler-curve": Layer(colour=0x1F6FB4, width=0.25e-3),
    "target": Layer(colour=0xD35400, width=0.25e-3),
    "plate": Layer(colour=0x202020, width=0.5e-3, foreground=True),
    "hole": Layer(colour=0xC0392B, width=0.35e-3),
    "dimension": Layer(colour=0x1F6FB4, width=0.18e-3),
    "text": Layer(colour=0x202020, width=0.18e-3, foreground=True),
}

_ORDER = list(LAYERS)

#: Units of length, by their code in the DXF variable $INSUNITS.
UNITS = {"mm": 4, "cm": 5, "m": 6, "in": 1}
#: Those that SVG has.
SVG_UNITS = ("mm", "cm", "in")
_NO_GUID = "{00000000-0000-0000-0000-000000000000}"
#: AutoCAD's colour that is the opposite of the background.
_FOREGROUND = 7
#: Margin of an SVG around the drawing, as a share of its larger extent.
MARGIN = 0.05


def _check(layer: str, *numbers: float) -> None:
    if layer not in LAYERS:
        raise unknown_name(layer, LAYERS, f"layer {layer!r}")
    if not all(isfinite(number) for number in numbers):
        raise InputError(f"on layer {layer}: {numbers} must be finite numbers")


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A straight line between two points (m)."""

    layer: str
    start: Point
    end: Point

    def __post_init__(self) -> None:
        _check(self.layer, *self.start, *self.end)


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """A circle about a point (m), such as a pin."""

    layer: str
    centre: Point
    radius: float

    def __post_init__(self) -> None:
        _check(self.layer, *self.centre, self.radius)
        if self.radius <= 0.0:
            raise InputError(
                f"on layer {self.layer}: a circle's radius is {self.radius!r} m: it must be greater than zero"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polyline:
    """Points joined by straight lines, shape (n, 2) in m; the last one to the first if closed.

    Where ``bulges`` are given, one a point, the way from it to the next is an arc: the tangent of a quarter of its angle,
    above zero counter-clockwise, as in DXF; at most 1, a half circle.
    """

    layer: str
    points: NDArray[np.float64]
    closed: bool = False
    bulges: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
            raise InputError(
                f"on layer {self.layer}: a polyline of shape {points.shape}: it must be (n, 2), n at least 2"
            )
        _check(self.layer)
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(bad):
            raise InputError(
                f"on layer {self.layer}: point {bad[0]} of a polyline is {points[bad[0]]}: it must be finite"
            )
        if self.bulges and (len(self.bulges) != len(points) or not all(abs(b) <= 1.0 for b in self.bulges)):
            raise InputError(
                f"on layer {self.layer}: bulges {self.bulges} of a polyline of {len(points)} points: one a point, from -1 to 1"
            )
        points.setflags(write=False)
        object.__setattr__(self, "points", points)

    @property
    def around(self) -> NDArray[np.float64]:
        """Points between which all of it lies, shape (n, 2): of an arc, its ends and the corners of a box about it."""
        ways = np.roll(self.points, -1, axis=0) - self.points
        bulges = np.array(self.bulges or np.zeros(len(ways)))[:, None]
        # the height of an arc over its chord
        out = 0.5 * bulges * np.column_stack([ways[:, 1], -ways[:, 0]])
        return np.vstack([self.points, self.points + out, self.points + ways + out])


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """A line of text that starts at a point (m), in letters of a height (m)."""

    layer: str
    position: Point
    height: float
    text: str

    def __post_init__(self) -> None:
        _check(self.layer, *self.position, self.height)
        if self.height <= 0.0:
            raise InputError(f"a text's height is {self.height!r} m: it must be greater than zero")
        if not self.text or not self.text.isprintable():
            raise InputError(f"a text is {self.text!r}: it must be one line of printable characters")


@dataclass(frozen=True, slots=True, kw_only=True)
class Dimension:
    """The distance between two points (m), written over a line beside them; ``offset`` to the left of the way (m)."""

    layer: str
    start: Point
    end: Point
    offset: float
    height: float

    def __post_init__(self) -> None:
        _check(self.layer, *self.start, *self.end, self.offset, self.height)
        if self.start == self.end or self.height <= 0.0:
            raise InputError(
                f"a dimension from {self.start} to {self.end} m in letters of {self.height} m: "
                "it must have a length and a height"
            )

    @property
    def line(self) -> tuple[Point, Point]:
        """Ends of the line that carries the number (m)."""
        (x1, y1), (x2, y2) = self.start, self.end
        share = self.offset / hypot(x2 - x1, y2 - y1)
        dx, dy = share * (y1 - y2), share * (x2 - x1)
        return (x1 + dx, y1 + dy), (x2 + dx, y2 + dy)

    @property
    def readable(self) -> Dimension:
        """The same, from left to right or upwards: its number is read from below or from the right."""
        (x1, y1), (x2, y2) = self.start, self.end
        slight = 1e-9 * abs(y2 - y1)
        forward = x2 - x1 > slight or (abs(x2 - x1) <= slight and y2 > y1)
        return self if forward else replace(self, start=self.end, end=self.start, offset=-self.offset)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """What is drawn, in m with y upwards.

    Attributes
    ----------
    title : str
        One line.
    lines, circles, polylines, dimensions, texts
        In any order; they are drawn by layer.

    Raises
    ------
    InputError
        If nothing is drawn, all of it at one point, or the title is not one printable line.
    """

    title: str
    lines: tuple[Line, ...] = ()
    circles: tuple[Circle, ...] = ()
    polylines: tuple[Polyline, ...] = ()
    dimensions: tuple[Dimension, ...] = ()
    texts: tuple[Text, ...] = ()

    def __post_init__(self) -> None:
        if not self.title.isprintable():
            raise InputError(f"the title is {self.title!r}: it must be one line of printable characters")
        if not (self.lines or self.circles or self.polylines):
            raise InputError("nothing is drawn: there must be a line, a circle or a polyline")
        low, high = self.extents
        if low == high:
            raise InputError(f"all that is drawn is at one point, {low} m")

    @property
    def extents(self) -> tuple[Point, Point]:
        """Lower left and upper right corner of all but the letters, whose starting points count (m)."""
        points = np.vstack(
            [np.array([p for line in self.lines for p in (line.start, line.end)]).reshape(-1, 2)]
            + [np.array(c.centre) + side * c.radius for c in self.circles for side in (-1.0, 1.0)]
            + [p.around for p in self.polylines]
            + [np.array(d.line) for d in self.dimensions]
            + [np.array([t.position for t in self.texts]).reshape(-1, 2)]
        )
        (left, bottom), (right, top) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return (left, bottom), (right, top)


def _metres(unit: str, known: Iterable[str]) -> float:
    names = tuple(known)
    if unit not in names:
        raise ParameterError("unit", unit, f"be one of {', '.join(names)}")
    return LENGTHS[unit]


def _number(dimension: Dimension, metre: float) -> str:
    """The distance in a unit, to its hundredths at the finest."""
    return f"{round(hypot(*np.subtract(dimension.end, dimension.start)) / metre, 2):g}"


def to_dxf(drawing: Drawing, unit: str = "mm") -> str:
    """The drawing as DXF (AutoCAD 2010, UTF-8).

    Parameters
    ----------
    drawing : Drawing
    unit : str
        One of `UNITS`; it is named in the header ($INSUNITS).

    Returns
    -------
    str
        Without a date: the header's times and identifiers are set to the constants 0.

    Raises
    ------
    ParameterError
        If the unit is not known.
    """
    require("ezdxf")
    from ezdxf.filemanagement import new
    from ezdxf.version import __version__

    metre = _metres(unit, UNITS)
    document = new("R2010", setup=["styles", "dimstyles"])
    document.units = UNITS[unit]
    document.header["$MEASUREMENT"] = 0 if unit == "in" else 1
    for name, layer in LAYERS.items():
        entry = document.layers.add(name, lineweight=round(layer.width * 1e5))
        if layer.foreground:
            entry.color = _FOREGROUND
        else:
            entry.rgb = (layer.colour >> 16, layer.colour >> 8 & 255, layer.colour & 255)
    space = document.modelspace()

    def at(point: Point) -> Point:
        return point[0] / metre, point[1] / metre

    shapes: list[Line | Circle | Polyline] = [*drawing.lines, *drawing.circles, *drawing.polylines]
    for shape in sorted(shapes, key=lambda one: _ORDER.index(one.layer)):
        own = {"layer": shape.layer}
        if isinstance(shape, Line):
            space.add_line(at(shape.start), at(shape.end), dxfattribs=own)
        elif isinstance(shape, Circle):
            space.add_circle(at(shape.centre), shape.radius / metre, dxfattribs=own)
        else:
            bulges = shape.bulges or [0.0] * len(shape.points)
            points = [(x, y, bulge) for (x, y), bulge in zip((shape.points / metre).tolist(), bulges)]
            space.add_lwpolyline(points, format="xyb", close=shape.closed, dxfattribs=own)
    for dimension in drawing.dimensions:
        _measure(space, dimension.readable, metre)
    for text in drawing.texts:
        space.add_text(
            text.text,
            height=text.height / metre,
            dxfattribs={"layer": text.layer, "insert": at(text.position)},
        )
    (left, bottom), (right, top) = (at(corner) for corner in drawing.extents)
    space.reset_extents((left, bottom, 0.0), (right, top, 0.0))
    document.header.custom_vars.append("Title", drawing.title)
    height = 1.1 * max(top - bottom, 0.5 * (right - left))
    document.set_modelspace_vport(height, center=(0.5 * (left + right), 0.5 * (bottom + top)))
    stream = StringIO()
    document.write(stream)
    # ezdxf dates each file, and leaves that out by a global option only
    dxf = re.sub(r"(\$TDU?(?:CREATE|UPDATE)\n *40\n)[^\n]*", r"\g<1>0.0", stream.getvalue())
    dxf = re.sub(r"(\$(?:FINGERPRINT|VERSION)GUID\n *2\n)[^\n]*", rf"\g<1>{_NO_GUID}", dxf)
    return re.sub(rf"(?<=\n{re.escape(__version__)} @ )[^\n]*", "0", dxf)


def _measure(space: Any, dimension: Dimension, metre: float) -> None:
    """A dimension of a DXF, in a unit."""
    height = dimension.height / metre
    ends = [(x / metre, y / metre) for x, y in (dimension.start, dimension.end)]
    look = {"dimtxt": height, "dimasz": height, "dimexo": 0.5 * height, "dimexe": 0.5 * height, "dimgap": 0.3 * height}
    space.add_aligned_dim(
        *ends,
        dimension.offset / metre,
        text=_number(dimension, metre),
        override=look | {"dimtad": 1, "dimblk": ""},
        dxfattribs={"layer": dimension.layer},
    ).render()


def to_svg(drawing: Drawing, unit: str = "mm") -> str:
    """The drawing as SVG of real size: ``width`` and ``height`` in the unit, and one user unit one of it.

    Parameters
    ----------
    drawing : Drawing
    unit : str
        One of `SVG_UNITS`.

    Returns
    -------
    str
        A group for each layer that has something on it, its name as ``id``. SVG's y points down: a point (x, y) is at
        (x, -y), the origin kept, so that `analysis.files.read_points` reads back the same points.

    Raises
    ------
    ParameterError
        If the unit is not one of SVG's.
    """
    metre = _metres(unit, SVG_UNITS)

    def number(metres: float) -> str:
        return format(metres / metre + 0.0, ".15g")

    (left, bottom), (right, top) = drawing.extents
    margin = MARGIN * max(right - left, top - bottom)
    x, y = left - margin, -top - margin
    width, height = right - left + 2.0 * margin, top - bottom + 2.0 * margin
    root = ElementTree.Element(
        "svg",
        xmlns="http://www.w3.org/2000/svg",
        width=f"{number(width)}{unit}",
        height=f"{number(height)}{unit}",
        viewBox=" ".join(number(v) for v in (x, y, width, height)),
    )
    if drawing.title:
        ElementTree.SubElement(root, "title").text = drawing.title
    groups: dict[str, ElementTree.Element] = {}
    for name, layer in LAYERS.items():
        groups[name] = ElementTree.Element(
            "g",
            id=name,
            fill="none",
            stroke=f"#{layer.colour:06x}",
            attrib={"stroke-width": number(layer.width), "stroke-linejoin": "round", "stroke-linecap": "round"},
        )

    def put(layer: str, tag: str, **attributes: Any) -> ElementTree.Element:
        return ElementTree.SubElement(
            groups[layer], tag, {k: v if isinstance(v, str) else number(v) for k, v in attributes.items()}
        )

    for line in drawing.lines:
        (x1, y1), (x2, y2) = line.start, line.end
        put(line.layer, "line", x1=x1, y1=-y1, x2=x2, y2=-y2)
    for circle in drawing.circles:
        put(circle.layer, "circle", cx=circle.centre[0], cy=-circle.centre[1], r=circle.radius)
    for polyline in drawing.polylines:
        put(polyline.layer, "path", d=_path(polyline, number))
    for dimension in drawing.dimensions:
        ends = dimension.line
        for (x1, y1), (x2, y2) in (ends, *zip((dimension.start, dimension.end), ends)):
            put(dimension.layer, "line", x1=x1, y1=-y1, x2=x2, y2=-y2)
        for here, there in (ends, ends[::-1]):
            put(dimension.layer, "path", d=_arrow(here, there, dimension.height, number))
        _write(put, dimension, metre, number)
    for text in drawing.texts:
        element = put(text.layer, "text", x=text.position[0], y=-text.position[1], **{"font-size": text.height})
        _letter(element, text.layer, text.text)
    root.extend(group for group in groups.values() if len(group))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _path(polyline: Polyline, number: Callable[[float], str]) -> str:
    """The data of an SVG path along a polyline; its y points down, so that a left turn stays one."""
    points = polyline.points.tolist()
    bulges = polyline.bulges or [0.0] * len(points)
    parts = [f"M {number(points[0][0])},{number(-points[0][1])}"]
    following = [*points[1:], *(points[:1] if polyline.closed and polyline.bulges else [])]
    for (x1, y1), bulge, (x2, y2) in zip(points, bulges, following):
        if bulge:
            radius = number(hypot(x2 - x1, y2 - y1) * (1.0 + bulge * bulge) / (4.0 * abs(bulge)))
            parts.append(f"A {radius} {radius} 0 0 {0 if bulge > 0.0 else 1} {number(x2)},{number(-y2)}")
        else:
            parts.append(f"L {number(x2)},{number(-y2)}")
    return " ".join(parts) + (" Z" if polyline.closed else "")


def _arrow(tip: Point, towards: Point, height: float, number: Callable[[float], str]) -> str:
    """The data of an SVG path: the two barbs of an arrow with its tip at the end of a line."""
    way = np.subtract(towards, tip)
    along = height * way / hypot(*way)
    barbs = [tip + along + side * np.array([-along[1], along[0]]) for side in (0.2, -0.2)]
    (ax, ay), (bx, by) = barbs
    return f"M {number(ax)},{number(-ay)} L {number(tip[0])},{number(-tip[1])} L {number(bx)},{number(-by)}"


def _write(put: Callable[..., Any], dimension: Dimension, metre: float, number: Callable[[float], str]) -> None:
    """The number of a dimension over the middle of its line, readable from below or from the right."""
    (x1, y1), (x2, y2) = dimension.readable.line
    turned = round(degrees(atan2(y2 - y1, x2 - x1)), 9)
    up = 0.3 * dimension.height
    x = 0.5 * (x1 + x2) - up * sin(radians(turned))
    y = 0.5 * (y1 + y2) + up * cos(radians(turned))
    text = put(dimension.layer, "text", x=x, y=-y, **{"font-size": dimension.height, "text-anchor": "middle"})
    text.set("transform", f"rotate({-turned + 0.0:.6g} {number(x)} {number(-y)})")
    _letter(text, dimension.layer, _number(dimension, metre))


def _letter(element: ElementTree.Element, layer: str, text: str) -> None:
    """Letters in the colour of a layer, filled."""
    element.set("font-family", "sans-serif")
    element.set("fill", f"#{LAYERS[layer].colour:06x}")
    element.set("stroke", "none")
    element.text = text


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
    text = to_dxf(drawing, unit) if ending_of(path, (".dxf", ".svg")) == ".dxf" else to_svg(drawing, unit)
    return write_text(path, text)


def save_figure(figure: Any, path: str | Path, *, dpi: int = 150) -> Path:
    """Write a Matplotlib figure, as the format that the path's ending names."""
    with output(path) as (part, path):
        kind = path.suffix[1:] or "png"
        try:
            figure.savefig(part, dpi=dpi, format=kind)
        except ValueError:
            # a title from a file may look like mathematics without being any: dollars then stand for themselves
            texts = figure.findobj(lambda artist: hasattr(artist, "set_parse_math") and "$" in artist.get_text())
            if not texts:
                raise
            for text in texts:
                text.set_parse_math(False)
            figure.savefig(part, dpi=dpi, format=kind)
    return path
