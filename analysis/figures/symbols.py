"""Symbols of drawings of linkages: bearings, links, pins, blocks on guides, springs and dampers.

``unit`` is the size of symbols, in the unit of the axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.patches import Circle, Polygon
from numpy.typing import ArrayLike, NDArray

from . import style

Array = NDArray[np.float64]
#: Look of the centre line between two points of the ground.
CENTRE_LINE: dict[str, Any] = {"linewidth": style.HAIR, "linestyle": (0, (9, 3, 2, 3)), "color": "0.55", "zorder": 0}
#: Width of a link (points), and the least height of a plate to be drawn, relative to the distance of its first two points.
_WIDE, _FLAT = 4.5, 0.02


def draw_line(axis: Axes, points: ArrayLike | Sequence[Array], **options: Any) -> None:
    """Draw a line through points."""
    look: dict[str, Any] = {"color": style.GROUND, "linewidth": style.LINE, "solid_capstyle": "butt"}
    axis.plot(*np.array(points).T, **look | options)


def draw_ground(axis: Axes, start: Array, end: Array, unit: float, **options: Any) -> None:
    """Draw a surface of the ground from start to end, with strokes to its right."""
    length = hypot(*(end - start))
    way = (end - start) / length
    stroke = 0.55 * unit * (np.array([way[1], -way[0]]) - way)
    count = max(4, round(1.8 * length / unit))
    feet = [start + share * (end - start) for share in (np.arange(count) + 0.9) / count]
    draw_line(axis, [start, end], **options)
    strokes = [(foot, foot + stroke) for foot in feet]
    axis.add_collection(LineCollection(strokes, colors=style.GROUND, linewidths=style.HAIR, **options))


def draw_bearing(axis: Axes, pin: Array, unit: float) -> None:
    """Draw the bearing of a fixed pin."""
    foot, half = -1.75 * unit, 1.0 * unit
    outline = pin + np.array([[-0.3 * unit, 0.0], [-half, foot], [half, foot], [0.3 * unit, 0.0]])
    axis.add_patch(Polygon(outline, facecolor="0.92", edgecolor=style.GROUND, linewidth=style.LINE, zorder=5))
    draw_ground(axis, pin + np.array([-1.5 * unit, foot]), pin + np.array([1.5 * unit, foot]), unit, zorder=5)


def draw_link(axis: Axes, points: Sequence[Array], colour: str, *, zorder: float = 6.0, wide: float = _WIDE) -> None:
    """Draw a link from its first to its second point; through three points or more it is a plate, unless they lie on a line."""
    first, second, *_ = points
    bar: dict[str, Any] = {"color": colour, "linewidth": wide, "solid_capstyle": "round"}
    if len(points) > 2:
        spread = np.array(points) - np.mean(points, axis=0)
        corners = np.array(points)[np.argsort(np.arctan2(spread[:, 1], spread[:, 0]))]
        along = (second - first) / max(hypot(*(second - first)), 1e-300)
        heights = [abs(float(along[0] * (q - first)[1] - along[1] * (q - first)[0])) for q in points]
        if max(heights) > _FLAT * hypot(*(second - first)):
            look: dict[str, Any] = {"facecolor": colour, "alpha": 0.16, "edgecolor": "none"}
            axis.add_patch(Polygon(corners, **look, zorder=zorder - 1.0))
            draw_line(axis, [*corners, corners[0]], color=colour, zorder=zorder)
        else:
            draw_line(axis, sorted(points, key=lambda q: float((q - first) @ along)), **bar, zorder=zorder)
    draw_line(axis, [first, second], **bar, zorder=zorder + 1.0)


def draw_pin(axis: Axes, place: Array, unit: float, colour: str = "white", *, zorder: float = 9.0) -> None:
    """Draw a pin, or in another colour than white a marked point."""
    x, y = map(float, place)
    radius, edge = (0.36 * unit, 1.2) if colour == "white" else (0.26 * unit, style.THIN)
    axis.add_patch(Circle((x, y), radius, facecolor=colour, edgecolor="black", linewidth=edge, zorder=zorder))


def block_corners(place: Array, along: Array, unit: float) -> list[Array]:
    """Return the corners of a block that slides in the direction of the unit vector ``along``."""
    across = np.array([-along[1], along[0]])
    return [place + s * 1.5 * unit * along + n * unit * across for s, n in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def draw_block(axis: Axes, place: Array, along: Array, unit: float) -> None:
    """Draw a block that slides in the direction of the unit vector ``along``."""
    corners = block_corners(place, along, unit)
    axis.add_patch(Polygon(corners, facecolor=style.BLOCK, edgecolor=style.SLIDER, linewidth=style.LINE, zorder=4))


def draw_spring(axis: Axes, start: Array, end: Array, unit: float) -> None:
    """Draw a coil spring."""
    across = 0.38 * unit * np.array([-(end - start)[1], (end - start)[0]]) / hypot(*(end - start))
    share = np.concatenate([[0.0, 0.12], np.linspace(0.12, 0.88, 15)[1:-1], [0.88, 1.0]])
    swing = np.zeros(len(share))
    swing[2:-2] = (-1.0) ** np.arange(len(share) - 4)
    draw_line(axis, start + np.outer(share, end - start) + np.outer(swing, across), color=style.SLIDER, zorder=3)


def draw_damper(axis: Axes, start: Array, end: Array, unit: float) -> None:
    """Draw a dashpot."""
    along = (end - start) / hypot(*(end - start))
    across, middle, deep = 0.32 * unit * np.array([-along[1], along[0]]), 0.5 * (start + end), 0.8 * unit * along
    look: dict[str, Any] = {"color": style.SLIDER, "zorder": 3}
    draw_line(axis, [middle + s * deep + n * across for s, n in ((-1, 1), (1, 1), (1, -1), (-1, -1))], **look)
    draw_line(axis, [middle + deep, end], **look)
    draw_line(axis, [start, middle], **look)
    draw_line(axis, [middle - 0.8 * across, middle + 0.8 * across], **look | {"linewidth": style.BOLD})
