"""Paint solids in space in orthographic projection, from back to front.

A solid is an array (n, 4, 3) of n faces with four corners each, anticlockwise seen from outside.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import pi
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.float64]

#: Direction towards the light: components to the right, upwards, and towards the eye.
_LIGHT = np.array([-0.25, 0.75, 0.61])


def cylinder(start: FloatArray, end: FloatArray, radius: float, *, pieces: int = 1, sides: int = 16) -> FloatArray:
    """Return a cylinder with closed ends from ``start`` to ``end``.

    The cylinder is divided along its length into ``pieces``, because `paint` orders faces by depth. ``sides`` is the number of
    faces around the cylinder.
    """
    way = (end - start) / np.linalg.norm(end - start)
    first = np.cross(way, np.eye(3)[np.argmin(np.abs(way))])
    first /= np.linalg.norm(first)
    turn = np.linspace(0.0, 2.0 * pi, sides + 1)[:, None]
    ring = radius * (np.cos(turn) * first + np.sin(turn) * np.cross(way, first))
    stations = [start + share * (end - start) for share in np.linspace(0.0, 1.0, pieces + 1)]
    faces = [
        np.stack([near + ring[:-1], near + ring[1:], far + ring[1:], far + ring[:-1]], axis=1)
        for near, far in pairwise(stations)
    ]
    for place, rim in ((start, ring[::-1]), (end, ring)):
        middle = np.broadcast_to(place, rim[:-1].shape)
        faces.append(np.stack([middle, place + rim[:-1], place + rim[1:], middle], axis=1))
    return np.concatenate(faces)


def ball(centre: FloatArray, radius: float, *, sides: int = 20) -> FloatArray:
    """Return a sphere; ``sides`` is the number of faces round its equator."""
    turn, rise = np.meshgrid(
        np.linspace(0.0, 2.0 * pi, sides + 1), np.linspace(-0.5 * pi, 0.5 * pi, sides // 2 + 1), indexing="ij"
    )
    points = centre + radius * np.stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)], -1)
    corners = (points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:])
    return np.stack(corners, axis=2).reshape(-1, 4, 3)


def box(low: ArrayLike, high: ArrayLike, rows: FloatArray, origin: FloatArray, *, pieces: int = 1) -> FloatArray:
    """Return a box from corner ``low`` to corner ``high``, divided into pieces along its first axis.

    The corners (3,) are given in the frame with the origin ``origin`` and right-handed unit vectors in ``rows`` (3, 3).
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    faces = []
    cuts = np.linspace(low[0], high[0], pieces + 1)
    for number, (start, end) in enumerate(pairwise(cuts)):
        ends = np.array([[start, low[1], low[2]], [end, high[1], high[2]]])
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for side, order in ((0, ((0, 0), (0, 1), (1, 1), (1, 0))), (1, ((0, 0), (1, 0), (1, 1), (0, 1)))):
                if axis == 0 and number != (pieces - 1) * side:
                    continue
                corners = np.empty((4, 3))
                corners[:, axis] = ends[side, axis]
                for corner, (i, j) in zip(corners, order):
                    corner[u], corner[v] = ends[i, u], ends[j, v]
                faces.append(corners @ rows + origin)
    return np.array(faces)


def paint(axis: Axes, solids: Sequence[tuple[FloatArray, str]], view: FloatArray) -> FloatArray:
    """Paint the faces of solids that are turned towards the eye; each solid has a colour.

    Parameters
    ----------
    axis : Axes
    solids : sequence of (ndarray, str)
    view : ndarray, shape (3, 3)
        Unit vectors in its rows: right and up on the page, and towards the eye.

    Returns
    -------
    ndarray, shape (n, 2)
        Covered points on the page: middles and corners of the painted faces.
    """
    seen = np.concatenate([solid for solid, _ in solids]) @ view.T
    colours = np.concatenate([np.broadcast_to(to_rgb(colour), (len(solid), 3)) for solid, colour in solids])
    normal = np.cross(seen[:, 2] - seen[:, 0], seen[:, 3] - seen[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    bright = 0.6 + 0.4 * np.clip(normal @ (_LIGHT / np.linalg.norm(_LIGHT)), 0.0, 1.0)
    (front,) = np.nonzero(normal[:, 2] > 0.0)
    order = front[np.argsort(seen[front, :, 2].mean(axis=1), kind="stable")]
    seen, colours = seen[order], (bright[:, None] * colours)[order]
    axis.add_collection(
        PolyCollection(list(seen[:, :, :2]), facecolors=colours, edgecolors=colours, linewidths=0.4, zorder=3),
        autolim=False,
    )
    return np.concatenate([seen[:, :, :2].mean(axis=1), seen[:, ::2, :2].reshape(-1, 2)])
