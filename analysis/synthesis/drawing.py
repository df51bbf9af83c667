"""A linkage that was found as a drawing at real size, for CAD."""

from __future__ import annotations

from math import hypot

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError

from ..files import Circle, Drawing, Line, Polyline, Text
from .scene import LinkageScene
from .solution import Solution

FloatArray = NDArray[np.float64]

#: Radius of a pin and height of a letter, as shares of the drawing's extent.
PIN, LETTER = 0.008, 0.022


def drawing(solution: Solution, rotation: float | None = None, *, title: str = "") -> Drawing:
    """Links, pins, guide, coupler curve and target in the plane's own coordinates (m), for `files.save_drawing`.

    Parameters
    ----------
    solution : Solution
    rotation : float, optional
        Of the crank (rad); the first at which the links are joined by default.
    title : str

    Raises
    ------
    AssemblyError
        If the links cannot be joined there, or anywhere.
    """
    scene = LinkageScene(solution, title)
    tried = (*scene.rotation, *scene.transmission[0]) if rotation is None else (rotation,)
    pins = next((found for phi in tried if (found := scene.pins(float(phi))) is not None), None)
    if pins is None:
        where = "at any rotation of the crank" if rotation is None else f"at a crank rotation of {rotation:.6g} rad"
        raise AssemblyError(f"the links cannot be joined {where}: there is nothing to draw")
    a, b, c, d, e = (pins[name] for name in "ABCDE")
    p = pins.get("P")
    drawn = [np.array(list(pins.values())), *(q for q in (*scene.curves, scene.target) if q is not None)]
    size = float(np.ptp(np.vstack(drawn), axis=0).max())
    radius, height = PIN * size, LETTER * size
    bar = {"ground": (a, e), "crank": (a, b), "rocker": (d, c)}
    lines = [Line(layer=layer, start=start, end=end) for layer, (start, end) in bar.items()]
    held = "ground" if scene.guide is None else "slider"
    circles = [
        Circle(layer=layer, centre=pin, radius=radius)
        for layer, pin in (("ground", a), ("crank", b), ("rocker", c), (held, d))
    ]
    polylines = []
    if scene.second_crank:
        lines.append(Line(layer="crank", start=e, end=d))
        circles.append(Circle(layer="ground", centre=e, radius=radius))
    if p is None or abs((c[0] - b[0]) * (p[1] - b[1]) - (c[1] - b[1]) * (p[0] - b[0])) < 1e-9 * size * size:
        lines.append(Line(layer="coupler", start=b, end=c))
        if p is not None:
            lines.append(Line(layer="coupler", start=b, end=p))
    else:
        polylines.append(Polyline(layer="coupler", points=np.array([b, c, p]), closed=True))
    if p is not None:
        circles.append(Circle(layer="coupler", centre=p, radius=0.7 * radius))
    if scene.guide is not None:
        guide, block = _guide_and_block(scene.guide, np.array(d), radius)
        lines.append(guide)
        polylines.append(block)
    polylines += [_curve("coupler-curve", piece) for piece in scene.curves]
    if scene.target is not None and scene.target_closed is not None:
        polylines.append(Polyline(layer="target", points=scene.target, closed=scene.target_closed))
    elif scene.target is not None:
        circles += [Circle(layer="target", centre=(x, y), radius=0.5 * radius) for x, y in scene.target.tolist()]
    texts = [
        Text(layer="text", position=(x + 1.5 * radius, y + 1.5 * radius), height=height, text=name)
        for name, (x, y) in pins.items()
        if name != "E" or scene.second_crank
    ]
    return Drawing(
        title=scene.title,
        lines=tuple(lines),
        circles=tuple(circles),
        polylines=tuple(polylines),
        texts=tuple(texts),
    )


def _curve(layer: str, points: FloatArray) -> Polyline:
    """A curve, closed where it ends at its first point."""
    closed = len(points) > 3 and hypot(*(points[-1] - points[0])) <= 1e-9 * float(np.ptp(points, axis=0).max())
    return Polyline(layer=layer, points=points[:-1] if closed else points, closed=closed)


def _guide_and_block(guide: FloatArray, d: FloatArray, radius: float) -> tuple[Line, Polyline]:
    way = guide[1] - guide[0]
    length = hypot(*way)
    along = way / length if length > 0.0 else np.array([1.0, 0.0])
    left = np.array([-along[1], along[0]])
    ends = [guide[0] - 4.0 * radius * along, guide[1] + 4.0 * radius * along]
    block = np.array([d + radius * (3.0 * s * along + 2.0 * n * left) for s, n in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    start, end = ((float(x), float(y)) for x, y in ends)
    return Line(layer="guide", start=start, end=end), Polyline(layer="slider", points=block, closed=True)
