"""How far a traced curve is from its target, whatever the timing: areas, distances, and the flatness of a straight part.

These are measures to verify with, not to optimise by: they are exact or of stated accuracy, and do not care which point of
the curve belongs to which of the target. The thesis's quality function of path generation is `area_between`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, cos, isfinite, pi, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from .targets import TargetPath, along, arc_lengths, even_odd_area, plane_points, ring

FloatArray = NDArray[np.float64]

#: Pieces of equal length into which a curve is cut to integrate a distance along it.
PIECES = 2000


def distance_to(curve: ArrayLike, points: ArrayLike, *, closed: bool = True) -> FloatArray:
    """Distance of each point from the nearest point of a curve, exact to its segments (m), shape (m,).

    Parameters
    ----------
    curve : array_like, shape (n, 2)
        m.
    points : array_like, shape (m, 2)
        m.
    closed : bool
        Whether the curve's last point is joined to its first.

    Raises
    ------
    InputError
        If the curve has less than 2 points, or a coordinate is not finite.
    """
    import shapely

    line = shapely.LineString(ring(plane_points(curve, "the curve", 2), closed))
    distances: FloatArray = shapely.distance(line, shapely.points(plane_points(points, "the points", 0)))
    return distances


def _cut(vertices: FloatArray) -> tuple[FloatArray, float]:
    """Middles of the `PIECES` of a polyline, and its length."""
    length = float(arc_lengths(vertices)[-1])
    return along(vertices, (np.arange(PIECES) + 0.5) * (length / PIECES)), length


def area_between(curve: ArrayLike, target: TargetPath, *, closed: bool = True) -> float:
    """Area between a traced curve and its target (m2).

    Both closed: the area of the symmetric difference of what they enclose, each by the even-odd rule where it crosses itself
    (`even_odd_area`); exact for the polylines.

    Else, with d(p, S) the distance of a point p from the nearest point of a curve S,

        A = 1/2 (integral over the target of d(p, curve) ds + integral over the curve of d(p, target) ds),

    which is symmetric and zero only for equal curves. For parallel curves it is the area of the strip between them, exactly
    (Steiner's formula: their distance times the mean of their lengths). An open target that a closed curve traces on part of
    its way is an exception, since the rest of the way is free:

        A = integral over the target of d(p, curve) ds.

    The integrals are sums over `PIECES` pieces of equal length by the midpoint rule: about 1e-6 of the value.

    Parameters
    ----------
    curve : array_like, shape (n, 2)
        m.
    target : TargetPath
    closed : bool
        Whether the curve's last point is joined to its first.

    Raises
    ------
    InputError
        If the curve has less than 3 points (2 if open), or a coordinate is not finite.
    """
    points = plane_points(curve, "the curve", 3 if closed else 2)
    if closed and target.closed:
        return even_odd_area(target.points, points)
    middles, length = _cut(ring(target.points, target.closed))
    missed = length * float(distance_to(points, middles, closed=closed).mean())
    if closed:
        return missed
    middles, length = _cut(points)
    return 0.5 * (missed + length * float(distance_to(target.points, middles, closed=target.closed).mean()))


def hausdorff(curve: ArrayLike, target: TargetPath, *, closed: bool = True) -> float:
    """Hausdorff distance of a traced curve from its target: the largest that a point of the one is from the other (m).

    Of an open target and a closed curve only the target's points are taken, as in `area_between`. It is the largest over
    the vertices and over `PIECES` points at equal arc length: short of the true one by at most half their spacing.

    Parameters
    ----------
    curve, target, closed
        As for `area_between`.

    Raises
    ------
    InputError
        As `area_between`.
    """
    points = plane_points(curve, "the curve", 3 if closed else 2)
    seen = np.vstack([target.points, _cut(ring(target.points, target.closed))[0]])
    largest = float(distance_to(points, seen, closed=closed).max())
    if closed and not target.closed:
        return largest
    seen = np.vstack([points, _cut(ring(points, closed))[0]])
    return max(largest, float(distance_to(target.points, seen, closed=target.closed).max()))


# Straight parts


@dataclass(frozen=True, slots=True, kw_only=True)
class Straightness:
    """How straight and how long a part of a curve is.

    Attributes
    ----------
    travel : float
        Distance from the part's first to its last point, along the line (m).
    extent : float
        Distance between the outermost points along the line (m): more than the travel where the part turns back.
    flatness : float
        Distance between the outermost points across the line (m).
    direction : float
        Of the line, from the first point to the last (rad, -pi to pi).
    start : int
        Index of the part's first point in the curve.
    """

    travel: float
    extent: float
    flatness: float
    direction: float
    start: int = 0


def straightness(part: ArrayLike, *, direction: float | None = None) -> Straightness:
    """Travel and flatness of a part of a curve.

    Parameters
    ----------
    part : array_like, shape (n, 2)
        Its points in order (m), for example those within a window of crank angles.
    direction : float, optional
        Of the line that is to be followed (rad). By default it is free: that of the narrowest strip that holds the points
        (the minimum zone of ISO 1101; an edge of the convex hull lies along it).

    Raises
    ------
    InputError
        If there are less than 2 points, a number is not finite, or no direction is given and all points are the same.
    """
    points = plane_points(part, "the part", 2)
    points = points - points[0]
    if direction is None:
        direction = _narrowest(points)
    elif not isfinite(direction):
        raise InputError(f"the direction is {direction!r}: it must be finite")
    distance, across = (points @ np.array([[cos(direction), -sin(direction)], [sin(direction), cos(direction)]])).T
    if distance[-1] < 0.0:
        direction += pi
    return Straightness(
        travel=abs(float(distance[-1])),
        extent=float(np.ptp(distance)),
        flatness=float(np.ptp(across)),
        direction=atan2(sin(direction), cos(direction)),
    )


def _narrowest(points: FloatArray) -> float:
    """Direction of the narrowest strip that holds the points."""
    import shapely

    hull = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(points)))
    if len(hull) == 1:
        raise InputError(f"all {len(points)} points of the part are the same one: it has no direction")
    edges = np.diff(hull, axis=0)
    edges /= np.hypot(*edges.T)[:, None]
    widths = np.ptp(edges[:, :1] * hull[:, 1] - edges[:, 1:] * hull[:, 0], axis=1)
    x, y = edges[int(np.argmin(widths))]
    return atan2(y, x)


def straightest_part(
    curve: ArrayLike,
    count: int,
    *,
    direction: float | None = None,
    least_travel: float = 0.0,
    closed: bool = True,
) -> Straightness:
    """The flattest part of ``count`` successive points of a curve; points at equal crank angles make it a crank window.

    Parameters
    ----------
    curve : array_like, shape (n, 2)
        m.
    count : int
        Number of points: of a curve at 5 deg steps 25 for a window of 120 deg.
    direction : float, optional
        As for `straightness`.
    least_travel : float
        Travel below which a part is not taken (m).
    closed : bool
        Whether a part may run over the curve's last point to its first.

    Raises
    ------
    InputError
        If there are not as many points, or no part has the travel.
    """
    points = plane_points(curve, "the curve", 2)
    if not 2 <= count <= len(points):
        raise InputError(f"a part of {count} points of {len(points)}: it must be from 2 to all of them")
    starts = len(points) if closed else len(points) - count + 1
    # over the seam: the curve's beginning once more
    laid = np.vstack([points, points[: count - 1]]) if closed else points
    best: Straightness | None = None
    longest = 0.0
    for start in range(starts):
        part = straightness(laid[start : start + count], direction=direction)
        longest = max(longest, part.travel)
        if part.travel >= least_travel and (best is None or part.flatness < best.flatness):
            best = replace(part, start=start)
    if best is None:
        raise InputError(
            f"no part of {count} points has a travel of {least_travel!r} m: the longest is {longest:.6g} m"
        )
    return best
