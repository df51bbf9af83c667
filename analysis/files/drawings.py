"""Drawings to scale of lines, circles, polylines, dimensions and texts on named layers, written as DXF or SVG.

The coordinates of a `Drawing` are in m, with y upwards. `to_dxf` and `to_svg` write a drawing in a given unit of length; the
same drawing always gives the same text, byte for byte.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from io import StringIO
from math import atan2, ceil, cos, degrees, floor, hypot, isfinite, log10, radians, sin
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError

from ..libraries import require
from ..units import LENGTHS
from .outputs import output, write_text
from .paths import check_ending
from .reader import unknown_name

Point = tuple[float, float]

#: Units of length, each with its code in the DXF variable $INSUNITS.
UNITS = {"mm": 4, "cm": 5, "m": 6, "in": 1}
#: Units of length that SVG has.
SVG_UNITS = ("mm", "cm", "in")
_NO_GUID = "{00000000-0000-0000-0000-000000000000}"
#: AutoCAD's colour that contrasts with the background.
_FOREGROUND = 7
#: Margin of an SVG around the drawing, as a share of its larger extent.
MARGIN = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """Appearance of a layer: colour as 0xRRGGBB, and width of its lines (m).

    The lines of a layer with ``foreground`` contrast with any background: in DXF they are black on white and white on black.
    """

    colour: int
    width: float
    foreground: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Shape:
    layer: str

    def _require(self, holds: bool, requirement: str) -> None:
        if not holds:
            raise InputError(f"{self!r} on layer {self.layer}: {requirement}")

    def _check(self, *numbers: float, positive: float = 1.0) -> None:
        """Check that all numbers are finite, and that ``positive`` is greater than zero."""
        self._require(all(map(isfinite, (*numbers, positive))), "all numbers must be finite")
        self._require(positive > 0.0, f"its size is {positive!r} m: it must be greater than zero")


@dataclass(frozen=True, slots=True, kw_only=True)
class Line(_Shape):
    """A straight line between two points (m)."""

    start: Point
    end: Point

    def __post_init__(self) -> None:
        self._check(*self.start, *self.end)


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle(_Shape):
    """A circle about a point (m), such as a pin."""

    centre: Point
    radius: float

    def __post_init__(self) -> None:
        self._check(*self.centre, positive=self.radius)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polyline(_Shape):
    """A line through points, shape (n, 2) in m, with straight or circular segments; if closed, back to the first point.

    ``bulges``, one for each point, bend the segments to arcs, as in DXF. A bulge is the tangent of a quarter of the arc's angle
    from this point to the next, positive counter-clockwise, from -1 to 1; 0 is a straight line, 1 is a half circle.
    """

    points: NDArray[np.float64]
    closed: bool = False
    bulges: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        object.__setattr__(self, "points", points)
        self._require(
            points.ndim == 2 and points.shape[1:] == (2,) and len(points) > 1, "its shape must be (n, 2), n > 1"
        )
        self._check(*points.ravel())
        fits = len(self.bulges) in (0, len(points)) and all(abs(bulge) <= 1.0 for bulge in self.bulges)
        self._require(fits, f"{len(points)} points need as many bulges, from -1 to 1")
        points.setflags(write=False)

    @property
    def hull(self) -> NDArray[np.float64]:
        """Points whose convex hull contains the polyline, shape (m, 2): its points, and corners of boxes around its arcs."""
        chords = np.roll(self.points, -1, axis=0) - self.points
        bulges = np.array(self.bulges or np.zeros(len(chords)))[:, None]
        # vector from a chord to the top of its arc
        heights = 0.5 * bulges * np.column_stack([chords[:, 1], -chords[:, 0]])
        return np.vstack([self.points, self.points + heights, self.points + chords + heights])


@dataclass(frozen=True, slots=True, kw_only=True)
class Text(_Shape):
    """A line of text that starts at ``position`` (m), with letters of ``height`` (m)."""

    position: Point
    height: float
    text: str

    def __post_init__(self) -> None:
        self._check(*self.position, positive=self.height)
        self._require(bool(self.text) and self.text.isprintable(), "it must be one line of printable characters")


@dataclass(frozen=True, slots=True, kw_only=True)
class Dimension(_Shape):
    """The distance between two points (m), written on a line parallel to the line from ``start`` to ``end``.

    ``offset`` is the distance (m) between these lines, positive to the left as seen from ``start`` to ``end``. ``height`` (m)
    is the height of the number and the length of the arrows.
    """

    start: Point
    end: Point
    offset: float
    height: float

    def __post_init__(self) -> None:
        self._check(*self.start, *self.end, self.offset, positive=self.height)
        self._require(self.start != self.end, "its points must be apart")

    @property
    def length(self) -> float:
        """Distance between the points (m)."""
        return hypot(*np.subtract(self.end, self.start))

    @property
    def line(self) -> tuple[Point, Point]:
        """End points (m) of the dimension line, above which the number is written."""
        (x1, y1), (x2, y2) = self.start, self.end
        share = self.offset / hypot(x2 - x1, y2 - y1)
        dx, dy = share * (y1 - y2), share * (x2 - x1)
        return (x1 + dx, y1 + dy), (x2 + dx, y2 + dy)

    @property
    def readable(self) -> Dimension:
        """The same dimension with its points in the order left to right, or upwards.

        The number is then read from below or from the right.
        """
        (x1, y1), (x2, y2) = self.start, self.end
        slight = 1e-9 * abs(y2 - y1)
        forward = x2 - x1 > slight or (abs(x2 - x1) <= slight and y2 > y1)
        return self if forward else replace(self, start=self.end, end=self.start, offset=-self.offset)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """Shapes on layers, in m with y upwards.

    Attributes
    ----------
    title : str
        Title of the drawing, in one line.
    layers : mapping of str to Layer
        Layers by name, in the order in which they are drawn.
    lines, circles, polylines, dimensions, texts : tuple
        Shapes in any order; they are drawn by layer.

    Raises
    ------
    InputError
        If there is no line, circle or polyline, all shapes are at one point, or the title is not one printable line.
    UnknownNameError
        If the layer of a shape is not in ``layers``.
    """

    title: str
    layers: Mapping[str, Layer]
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
        for shape in (*self.lines, *self.circles, *self.polylines, *self.dimensions, *self.texts):
            if shape.layer not in self.layers:
                raise unknown_name(shape.layer, self.layers, f"layer {shape.layer!r}")
        low, high = self.extents
        if low == high:
            raise InputError(f"all that is drawn is at one point, {low} m")

    @property
    def extents(self) -> tuple[Point, Point]:
        """Lower left and upper right corner (m) of the box around all shapes; of a text only the start is counted."""
        points = np.vstack(
            [np.array([p for line in self.lines for p in (line.start, line.end)]).reshape(-1, 2)]
            + [np.array(c.centre) + side * c.radius for c in self.circles for side in (-1.0, 1.0)]
            + [p.hull for p in self.polylines]
            + [np.array(d.line) for d in self.dimensions]
            + [np.array([t.position for t in self.texts]).reshape(-1, 2)]
        )
        (left, bottom), (right, top) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return (left, bottom), (right, top)


def _unit_length(unit: str, known: Iterable[str]) -> float:
    """Return the length of a unit (m); raise ParameterError if the unit is not in ``known``."""
    names = tuple(known)
    if unit not in names:
        raise ParameterError("unit", unit, f"be one of {', '.join(names)}")
    return LENGTHS[unit]


def _label(dimension: Dimension, metre: float) -> str:
    """Return the number of a dimension as text; ``metre`` is the length of the unit (m).

    It is rounded to 0.01 mm, or to four digits if it is shorter than 10 mm.
    """
    step = min(1e-5, 10.0 ** (floor(log10(dimension.length)) - 3))
    return np.format_float_positional(round(dimension.length / metre, ceil(log10(metre / step) - 0.01)), trim="-")


def to_dxf(drawing: Drawing, unit: str = "mm") -> str:
    """Write a drawing as DXF (AutoCAD 2010, UTF-8).

    Parameters
    ----------
    drawing : Drawing
    unit : str
        One of `UNITS`; the header names it ($INSUNITS).

    Returns
    -------
    str
        The DXF text, without a date: times and identifiers in the header are 0.

    Raises
    ------
    ParameterError
        If the unit is unknown.
    MissingLibraryError
        If ezdxf is not installed.
    """
    require("ezdxf")
    from ezdxf.filemanagement import new
    from ezdxf.version import __version__

    metre = _unit_length(unit, UNITS)
    document = new("R2010", setup=["styles", "dimstyles"])
    document.units = UNITS[unit]
    document.header["$MEASUREMENT"] = 0 if unit == "in" else 1
    for name, layer in drawing.layers.items():
        entry = document.layers.add(name, lineweight=round(layer.width * 1e5))
        if layer.foreground:
            entry.color = _FOREGROUND
        else:
            entry.rgb = (layer.colour >> 16, layer.colour >> 8 & 255, layer.colour & 255)
    space = document.modelspace()

    def in_units(point: Point) -> Point:
        return point[0] / metre, point[1] / metre

    order = list(drawing.layers)
    shapes: list[Line | Circle | Polyline] = [*drawing.lines, *drawing.circles, *drawing.polylines]
    for shape in sorted(shapes, key=lambda one: order.index(one.layer)):
        own = {"layer": shape.layer}
        if isinstance(shape, Line):
            space.add_line(in_units(shape.start), in_units(shape.end), dxfattribs=own)
        elif isinstance(shape, Circle):
            space.add_circle(in_units(shape.centre), shape.radius / metre, dxfattribs=own)
        else:
            bulges = shape.bulges or [0.0] * len(shape.points)
            points = [(x, y, bulge) for (x, y), bulge in zip((shape.points / metre).tolist(), bulges)]
            space.add_lwpolyline(points, format="xyb", close=shape.closed, dxfattribs=own)
    for dimension in (given.readable for given in drawing.dimensions):
        height = dimension.height / metre
        sizes = {"dimtxt": 1.0, "dimasz": 1.0, "dimexo": 0.5, "dimexe": 0.5, "dimgap": 0.3}
        space.add_aligned_dim(
            in_units(dimension.start),
            in_units(dimension.end),
            dimension.offset / metre,
            text=_label(dimension, metre),
            override={name: share * height for name, share in sizes.items()}
            | {"dimtad": 1, "dimblk": "", "dimtfill": 1},
            dxfattribs={"layer": dimension.layer},
        ).render()
    for text in drawing.texts:
        place = {"layer": text.layer, "insert": in_units(text.position)}
        space.add_text(text.text, height=text.height / metre, dxfattribs=place)
    (left, bottom), (right, top) = (in_units(corner) for corner in drawing.extents)
    space.reset_extents((left, bottom, 0.0), (right, top, 0.0))
    document.header.custom_vars.append("Title", drawing.title)
    height = 1.1 * max(top - bottom, 0.5 * (right - left))
    document.set_modelspace_vport(height, center=(0.5 * (left + right), 0.5 * (bottom + top)))
    # ezdxf lists the classes in the order of a set, which differs between processes
    document.classes.add_required_classes(document.dxfversion)
    document.classes.classes = dict(sorted(document.classes.classes.items()))
    stream = StringIO()
    document.write(stream)
    # ezdxf dates each file; only a global option would prevent that
    dxf = re.sub(r"(\$TDU?(?:CREATE|UPDATE)\n *40\n)[^\n]*", r"\g<1>0.0", stream.getvalue())
    dxf = re.sub(r"(\$(?:FINGERPRINT|VERSION)GUID\n *2\n)[^\n]*", rf"\g<1>{_NO_GUID}", dxf)
    return re.sub(rf"(?<=\n{re.escape(__version__)} @ )[^\n]*", "0", dxf)


def to_svg(drawing: Drawing, unit: str = "mm") -> str:
    """Write a drawing as SVG to scale 1:1, with ``width`` and ``height`` in the unit, which is also the user unit.

    Parameters
    ----------
    drawing : Drawing
    unit : str
        One of `SVG_UNITS`.

    Returns
    -------
    str
        The SVG text, with a group for each layer that has shapes; its ``id`` is the layer's name. As SVG's y points down, a
        point (x, y) is at (x, -y), and `analysis.files.read_points` reads the same points back.

    Raises
    ------
    ParameterError
        If SVG does not have the unit.
    """
    svg = _Svg(drawing, _unit_length(unit, SVG_UNITS))
    number = svg.number
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
    for line in drawing.lines:
        svg.add_line(line.layer, line.start, line.end)
    for circle in drawing.circles:
        svg.add(circle.layer, "circle", cx=circle.centre[0], cy=-circle.centre[1], r=circle.radius)
    for polyline in drawing.polylines:
        svg.add(polyline.layer, "path", d=svg.path(polyline))
    for dimension in drawing.dimensions:
        svg.add_dimension(dimension)
    for text in drawing.texts:
        svg.add_text(text.layer, text.text, text.position, text.height)
    root.extend(group for group in svg.groups.values() if len(group))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


class _Svg:
    """Elements of an SVG drawing, in one group for each layer; ``metre`` is the length of the drawing's unit (m)."""

    def __init__(self, drawing: Drawing, metre: float) -> None:
        self.metre = metre
        self.layers = drawing.layers
        look = {"stroke-linejoin": "round", "stroke-linecap": "round"}
        self.groups = {
            name: ElementTree.Element(
                "g",
                id=name,
                fill="none",
                stroke=f"#{layer.colour:06x}",
                attrib={"stroke-width": self.number(layer.width), **look},
            )
            for name, layer in drawing.layers.items()
        }

    def number(self, metres: float) -> str:
        """Return a length (m) as text in the unit of the SVG."""
        return format(metres / self.metre + 0.0, ".15g")

    def point(self, x: float, y: float) -> str:
        """Return a point (m) as text, with y downwards."""
        return f"{self.number(x)},{self.number(-y)}"

    def add(self, layer: str, tag: str, **attributes: Any) -> ElementTree.Element:
        """Add an element to a layer and return it; attributes that are numbers are lengths (m)."""
        texts = {name: value if isinstance(value, str) else self.number(value) for name, value in attributes.items()}
        return ElementTree.SubElement(self.groups[layer], tag, texts)

    def add_line(self, layer: str, start: Point, end: Point) -> None:
        """Add a straight line."""
        self.add(layer, "line", x1=start[0], y1=-start[1], x2=end[0], y2=-end[1])

    def path(self, polyline: Polyline) -> str:
        """Return the path data of a polyline, the SVG attribute ``d``."""
        points = polyline.points.tolist()
        bulges = polyline.bulges or [0.0] * len(points)
        parts = [f"M {self.point(*points[0])}"]
        following = [*points[1:], *(points[:1] if polyline.closed and polyline.bulges else [])]
        for (x1, y1), bulge, (x2, y2) in zip(points, bulges, following):
            if bulge:
                radius = self.number(hypot(x2 - x1, y2 - y1) * (1.0 + bulge * bulge) / (4.0 * abs(bulge)))
                parts.append(f"A {radius} {radius} 0 0 {0 if bulge > 0.0 else 1} {self.point(x2, y2)}")
            else:
                parts.append(f"L {self.point(x2, y2)}")
        return " ".join(parts) + (" Z" if polyline.closed else "")

    def add_text(self, layer: str, text: str, place: Point, height: float, **attributes: Any) -> ElementTree.Element:
        """Add a text in the colour of its layer, and return the SVG element."""
        element = self.add(layer, "text", x=place[0], y=-place[1], **{"font-size": height}, **attributes)
        element.attrib |= {"font-family": "sans-serif", "fill": f"#{self.layers[layer].colour:06x}", "stroke": "none"}
        element.text = text
        return element

    def add_dimension(self, dimension: Dimension) -> None:
        """Add the lines, the arrows and the number of a dimension to its layer."""
        layer, height, ends = dimension.layer, dimension.height, dimension.line
        for start, end in (ends, *zip((dimension.start, dimension.end), ends)):
            self.add_line(layer, start, end)
        for tip, other in (ends, ends[::-1]):
            way = np.subtract(other, tip)
            along = height * way / hypot(*way)
            left, right = (tip + along + side * np.array([-along[1], along[0]]) for side in (0.2, -0.2))
            self.add(layer, "path", d=f"M {self.point(*left)} L {self.point(*tip)} L {self.point(*right)}")
        (x1, y1), (x2, y2) = dimension.readable.line
        turned = round(degrees(atan2(y2 - y1, x2 - x1)), 9)
        x = 0.5 * (x1 + x2) - 0.3 * height * sin(radians(turned))
        y = 0.5 * (y1 + y2) + 0.3 * height * cos(radians(turned))
        text = _label(dimension, self.metre)
        element = self.add_text(layer, text, (x, y), height, **{"text-anchor": "middle"})
        element.set("transform", f"rotate({-turned + 0.0:.6g} {self.number(x)} {self.number(-y)})")


def save_drawing(path: str | Path, drawing: Drawing, *, unit: str = "mm") -> Path:
    """Write a drawing as DXF or SVG, according to the path's ending, and return the path.

    Raises
    ------
    InputError
        If the path has another ending.
    ParameterError
        If the format does not have the unit.
    """
    path = Path(path)
    text = to_dxf(drawing, unit) if check_ending(path, (".dxf", ".svg")) == ".dxf" else to_svg(drawing, unit)
    return write_text(path, text)


def save_figure(figure: Any, path: str | Path, *, dpi: int = 150) -> Path:
    """Write a Matplotlib figure in the format of the path's ending, by default PNG, and return the path."""
    with output(path) as (part, path):
        kind = path.suffix[1:] or "png"
        try:
            figure.savefig(part, dpi=dpi, format=kind)
        except ValueError:
            # a title from a file may look like a formula without being one: show its dollars as dollars
            texts = figure.findobj(lambda artist: hasattr(artist, "set_parse_math") and "$" in artist.get_text())
            if not texts:
                raise
            for text in texts:
                text.set_parse_math(False)
            figure.savefig(part, dpi=dpi, format=kind)
    return path
