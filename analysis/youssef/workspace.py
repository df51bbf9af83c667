"""Coupler curves with the slider held, and the area that the coupler point P can reach (Youssef, Fig 7.2).

P has two degrees of freedom, the crank angle th2 and the slider position u. At a fixed u it traces a coupler curve, which is
closed if the crank turns fully and otherwise consists of open arcs. Over a range of u the curves fill the accessible area.

The curves come from the plant's kinematics. The area comes from inverse kinematics: a point (x, y) is accessible if one of
its at most four configurations exists,

    |B - A| = l2 and |P - B| = r             two crank pins B, hence two couplers and two pins C
    D on the guide and |C - D| = l4          two slider positions u for each
    sin(th4 - th3) of the assembly's sign    and u in its range

This test has a closed form. It is applied to a square grid, the boundary is located between neighbouring points by
bisection, and the grid is refined until the area no longer changes. The method works for every kind of boundary (coupler
curves of the ends of the range, limits of assembly, folds where the two partial velocities of P are parallel) and for holes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import acos, atan2, hypot, isfinite, pi
from typing import Any, NamedTuple

import numpy as np
import shapely
from contourpy import contour_generator
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError
from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import Constants, FiveBarParameters

from ..run import takes_published
from ..units import Amount, in_si
from .premises import require_five_bar

#: Number of cells across the area in the coarsest and in the finest grid.
COARSEST, FINEST = 128, 4096
#: Number of halvings of a cell's edge to locate the boundary on the edge.
BISECTIONS = 40
#: A grid is fine enough if at most this share of the sampled configurations lies outside the boundaries.
MISSED = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """Arc of a coupler curve on which the linkage can be assembled: n crank angles (rad) and the coordinates of P (m)."""

    crank_angle: NDArray[np.float64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class CouplerCurve:
    """Path of P over a turn of the crank at a held slider.

    Attributes
    ----------
    slider_position : float
        Slider position (m).
    arcs : tuple of Arc
        One closed arc if the crank turns fully, its last point equal to its first. Otherwise one arc for each range of crank
        angles between limits of assembly; no arc if the links cannot be joined at any crank angle.
    closed : bool
        Whether the crank turns fully.
    """

    slider_position: float
    arcs: tuple[Arc, ...]
    closed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class AccessibleArea:
    """Area that P can reach.

    Attributes
    ----------
    outer, holes : tuple of ndarray, shape (n, 2)
        Boundaries (m), closed without repeating the first point; outer ones counter-clockwise, holes clockwise.
    area : float
        Area without the holes (m2).
    error : float
        Change of the area at the last refinement (m2), about three times the area's error.
    missed : float
        Share of the configurations sampled over (th2, u) whose point P lies more than a cell outside the boundaries: zero on
        a fine enough grid.
    cells : int
        Cells across the area in the last grid.
    converged : bool
        Whether ``error`` and ``missed`` are within their tolerances.
    """

    outer: tuple[NDArray[np.float64], ...]
    holes: tuple[NDArray[np.float64], ...]
    area: float
    error: float
    missed: float
    cells: int
    converged: bool

    def contains(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
        """Return whether points lie inside the boundaries; x and y are their coordinates (m), each of shape (k,)."""
        x, y = np.atleast_1d(np.asarray(x, float)), np.atleast_1d(np.asarray(y, float))
        inside = np.zeros(x.shape, dtype=bool)
        for ring in (*self.outer, *self.holes):
            inside ^= shapely.contains_xy(shapely.Polygon(ring), x, y)
        return inside


@takes_published()
@in_si(slider_position="m")
def coupler_curve(parameters: FiveBarParameters, slider_position: Amount, n: int = 720) -> CouplerCurve:
    """Return the path of P over a turn of the crank with the slider held.

    Parameters
    ----------
    parameters : FiveBarParameters
        ``assembly_branch`` chooses the assembly.
    slider_position : float
        Slider position (m).
    n : int
        Number of intervals of each arc. In an open arc the intervals become shorter towards the ends, where P varies as the
        square root of the angle.

    Raises
    ------
    InputError
        If the slider position is not a finite number, or n is less than 2.
    """
    require_five_bar(parameters, "a coupler curve")
    if not isfinite(slider_position):
        raise InputError(f"slider position is {slider_position}: it must be a finite number of m")
    if n < 2:
        raise InputError(f"n is {n}: a coupler curve needs at least 2 intervals")
    p = parameters.constants()
    spans = assembly_ranges(slider_position, p)
    closed = len(spans) == 1 and spans[0][1] - spans[0][0] >= 2.0 * pi
    arcs = []
    for start, end in spans:
        share = np.linspace(0.0, 1.0, n + 1) if closed else 0.5 - 0.5 * np.cos(np.linspace(0.0, pi, n + 1))
        angle = start + share * (end - start)
        middle = 0.5 * (start + end)
        points = np.array([_coupler_point(th2, slider_position, middle, p) for th2 in angle.tolist()])
        if closed:
            points[-1] = points[0]
        arcs.append(Arc(crank_angle=angle, x=points[:, 0], y=points[:, 1]))
    return CouplerCurve(slider_position=slider_position, arcs=tuple(arcs), closed=closed)


def assembly_ranges(u: float, p: Constants) -> list[tuple[float, float]]:
    """Return the ranges (begin, end) of crank angles (rad) in which the links can be joined at slider position u.

    With e = |AD|, BD^2 = e^2 + l2^2 - 2 l2 e cos(th2 - phi) must lie between (l3 - l4)^2 and (l3 + l4)^2. The limits are
    symmetric about the direction phi of D. The end of a range is greater than its beginning.
    """
    dx, dy = p.l1 + u * p.ca, u * p.sa
    e = hypot(dx, dy)
    phi = atan2(dy, dx)

    def angle(distance: float) -> float:
        """Return |th2 - phi| at which BD has the length ``distance``, 0 if BD is always longer, pi if it is always shorter."""
        if e == 0.0:
            return 0.0 if p.l2 > distance else pi
        return acos(min(1.0, max(-1.0, (e * e + p.l2 * p.l2 - distance * distance) / (2.0 * e * p.l2))))

    least, most = angle(abs(p.l3 - p.l4)), angle(p.l3 + p.l4)
    if p.l3 == p.l4 and e == p.l2:
        least = 0.0
    if not least < most:
        return []
    if most < pi:
        if least > 0.0:
            return [(phi - most, phi - least), (phi + least, phi + most)]
        return [(phi - most, phi + most)]
    if least > 0.0:
        return [(phi + least, phi + 2.0 * pi - least)]
    return [(0.0, 2.0 * pi)]


def _coupler_point(th2: float, u: float, middle: float, p: Constants) -> tuple[float, float]:
    """Return P (m) at the crank angle ``th2``, for slider position u.

    If rounding puts the angle beyond a limit of assembly, the angle is moved slightly towards ``middle``, the middle of its
    range.
    """
    share = 1e-16
    angle = th2
    while True:
        try:
            return kinematics.coupler_point(kinematics.position(angle, u, p), p)
        except (ValueError, ZeroDivisionError):
            if share > 1e-3:
                raise
            angle = th2 + share * (middle - th2)
            share *= 4.0


@takes_published()
@in_si(slider_range="m", x="m", y="m")
def accessible(parameters: FiveBarParameters, slider_range: Amount, x: Amount, y: Amount) -> NDArray[np.bool_]:
    """Return whether P can reach given points with the slider within a range, computed in closed form.

    Parameters
    ----------
    slider_range : (float, float)
        Least and greatest slider position (m).
    x, y : array_like
        Coordinates of the points (m), of shapes that broadcast.

    Returns
    -------
    ndarray of bool
        Whether each point can be reached; all False if P is the crank pin B, whose path is a circle.
    """
    p = parameters.constants()
    low, high = slider_range
    r = hypot(p.xp, p.yp)
    # complex numbers are points, those of length one directions
    q = np.asarray(x, float) + 1j * np.asarray(y, float)
    result = np.zeros(q.shape, dtype=bool)
    if r == 0.0:
        return result
    to_coupler = complex(p.xp, -p.yp) / r
    guide = complex(p.ca, p.sa)
    d2 = np.maximum(np.abs(q) ** 2, np.finfo(float).tiny)
    a = 0.5 * (d2 + p.l2**2 - r**2)
    h2 = p.l2**2 * d2 - a**2
    meets = h2 >= 0.0
    h = np.sqrt(np.where(meets, h2, 0.0))
    for side in (1.0, -1.0):
        b = q * (a + side * 1j * h) / d2
        coupler = (q - b) / r * to_coupler
        # C from the slider's zero, in the frame of the guide
        c = (b + p.l3 * coupler - p.l1) * guide.conjugate()
        s2 = p.l4**2 - c.imag**2
        reaches = meets & (s2 >= 0.0)
        s = np.sqrt(np.where(reaches, s2, 0.0))
        for end in (1.0, -1.0):
            rocker = (end * s + 1j * c.imag) * guide
            u = c.real - end * s
            joined = p.branch * (coupler.conjugate() * rocker).imag >= 0.0
            result |= reaches & joined & (low <= u) & (u <= high)
    return result


@takes_published()
@in_si(slider_range="m")
def accessible_area(
    parameters: FiveBarParameters, slider_range: Amount, *, tolerance: float = 1e-4, finest: int = FINEST
) -> AccessibleArea:
    """Return the area that the coupler point P reaches as crank and slider move independently.

    Parameters
    ----------
    parameters : FiveBarParameters
        Any linkage, even one whose crank cannot turn fully; ``assembly_branch`` chooses the assembly.
    slider_range : (float, float)
        Least and greatest slider position (m).
    tolerance : float
        Relative change of the area at which refinement stops.
    finest : int
        Cells across the area at which refinement stops in any case.

    Raises
    ------
    InputError
        If the range is not two increasing finite numbers, or the tolerance is not above zero.
    """
    require_five_bar(parameters, "the accessible area of the coupler point")
    low, high = (float(end) for end in slider_range)
    if not (isfinite(low) and isfinite(high) and low < high):
        raise InputError(f"slider range is {low} m to {high} m: it must be two finite numbers, increasing")
    if not tolerance > 0.0:
        raise InputError(f"tolerance is {tolerance}: it must be above zero")
    sample = _sample_points(parameters, low, high)
    nothing = AccessibleArea(outer=(), holes=(), area=0.0, error=0.0, missed=0.0, cells=0, converged=True)
    if not len(sample) or hypot(parameters.constants().xp, parameters.constants().yp) == 0.0:
        return nothing
    previous = None
    cells = min(COARSEST, finest)
    while True:
        rings, missed = _trace(parameters, (low, high), sample, cells)
        areas = [_signed_area(ring) for ring in rings]
        area = float(sum(areas))
        error = float("inf") if previous is None else abs(area - previous)
        converged = missed <= MISSED and error <= tolerance * area
        if converged or 2 * cells > finest:
            return AccessibleArea(
                outer=tuple(ring for ring, a in zip(rings, areas) if a > 0.0),
                holes=tuple(ring for ring, a in zip(rings, areas) if a < 0.0),
                area=area,
                error=error,
                missed=missed,
                cells=cells,
                converged=converged,
            )
        previous = area
        cells *= 2


def _sample_points(parameters: FiveBarParameters, low: float, high: float) -> NDArray[np.float64]:
    """Return the points P (m) at configurations spread over crank angle and slider position, shape (k, 2)."""
    curves = (coupler_curve(parameters, u, 120) for u in np.linspace(low, high, 33).tolist())
    arcs = [np.column_stack([arc.x, arc.y]) for curve in curves for arc in curve.arcs]
    return np.concatenate(arcs) if arcs else np.empty((0, 2))


class _Grid(NamedTuple):
    """Square grid over the plane: coordinates of the grid points (m), whether P can reach each grid point, and a test.

    ``inside`` has the shape (len(ys), len(xs)); the test ``reaches(x, y)`` tells whether P can reach any other points.
    """

    xs: NDArray[np.float64]
    ys: NDArray[np.float64]
    inside: NDArray[np.bool_]
    reaches: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]


def _trace(
    parameters: FiveBarParameters, slider_range: tuple[float, float], sample: NDArray[np.float64], cells: int
) -> tuple[list[NDArray[np.float64]], float]:
    """Return the boundaries (m) from a grid with ``cells`` cells across, and the share of the sample points outside of them."""
    least, most = sample.min(axis=0), sample.max(axis=0)
    size = float((most - least).max()) / cells
    margin = 0.02
    while True:
        # the odd offset keeps the axis of a symmetric mechanism off the rows of points
        origin = least - margin * (most - least) - 2.37 * size
        count = np.ceil((most + margin * (most - least) + 2.37 * size - origin) / size).astype(int) + 1
        xs = origin[0] + size * np.arange(count[0])
        ys = origin[1] + size * np.arange(count[1])
        inside = np.array([accessible(parameters, slider_range, xs, y) for y in ys])
        if not (inside[0].any() or inside[-1].any() or inside[:, 0].any() or inside[:, -1].any()):
            break
        margin *= 2.0
    i, j = ((sample - origin) / size).astype(int).T
    corners = inside[j, i] | inside[j + 1, i] | inside[j, i + 1] | inside[j + 1, i + 1]
    return _rings(_Grid(xs, ys, inside, partial(accessible, parameters, slider_range))), float(1.0 - corners.mean())


def _rings(grid: _Grid) -> list[NDArray[np.float64]]:
    """Return the closed boundaries (m), the largest first; the vertices are located on the grid's edges by bisection."""
    xs, ys, inside, reaches = grid
    heights = inside.astype(float)
    # if two diagonal corners of a cell are inside, its centre decides whether they connect: the contour uses their mean
    lower, upper = inside[:-1], inside[1:]
    across = (lower[:, :-1] == upper[:, 1:]) & (lower[:, 1:] == upper[:, :-1]) & (lower[:, :-1] != lower[:, 1:])
    j, i = np.nonzero(across)
    half = 0.5 * (xs[1] - xs[0])
    joined = reaches(xs[i] + half, ys[j] + half)
    for k in range(4):
        corner = j + k // 2, i + k % 2
        own = inside[corner] == joined
        np.add.at(heights, tuple(place[own] for place in corner), np.where(joined[own], 0.5, -0.5))
    # a vertex lies on an edge of the grid: one of its two indices is a whole number up to rounding
    contours: Sequence[Any] = contour_generator(z=heights).lines(0.5)
    lines = [np.round(line, 6)[:-1] for line in contours]
    if not lines:
        return []
    vertices = _crossings(grid, np.concatenate(lines))
    rings = np.split(vertices, np.cumsum([len(line) for line in lines])[:-1])
    return sorted(rings, key=lambda ring: (-abs(_signed_area(ring)), *ring[0]))


def _crossings(grid: _Grid, between: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points on the boundary (m), shape (k, 2), located by bisection between neighbouring points of the grid.

    Each row of ``between``, shape (k, 2), has two grid indices, one of them fractional: a place on an edge of the grid.
    """
    xs, ys, inside, reaches = grid
    (i, j), (far_i, far_j) = np.floor(between).astype(int).T, np.ceil(between).astype(int).T
    first = np.column_stack([xs[i], ys[j]])
    second = np.column_stack([xs[far_i], ys[far_j]])
    swap = inside[far_j, far_i][:, None]
    good, bad = np.where(swap, second, first), np.where(swap, first, second)
    for _ in range(BISECTIONS):
        middle = 0.5 * (good + bad)
        keep = reaches(middle[:, 0], middle[:, 1])[:, None]
        good, bad = np.where(keep, middle, good), np.where(keep, bad, middle)
    return good


def _signed_area(ring: NDArray[np.float64]) -> float:
    """Return the area enclosed by a closed boundary (m2); the area is negative if the points, shape (n, 2), run clockwise."""
    x, y = (ring - ring[0]).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
