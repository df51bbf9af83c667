"""Represent target curves as points in m, and measure the deviation of a traced curve from its target.

A curve is a polyline: straight segments join its points; in a closed curve a segment also joins the last point to the first.
Length, centroid, size and areas are exact for the polyline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, cos, isfinite, pi, sin
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ...files import read_points

FloatArray = NDArray[np.float64]
#: Fraction of a curve's extent below which two points coincide, and of its length squared below which its area is zero.
COINCIDENT = 1e-12
#: Greatest number of points for smoothing; a curve with more points is resampled first.
MOST_SMOOTHED = 1000
#: Weight of the degrees of freedom in the generalised cross-validation: 1 sometimes smooths too little; Kim and Gu advise
#: 1.4 (J. R. Statist. Soc. B 66, 2004, p 337).
FREEDOM_WEIGHT = 1.4


def plane_points(points: ArrayLike, what: str, least: int) -> FloatArray:
    """Return a copy of the points as an array of finite numbers, shape (n, 2).

    Raises InputError, with ``what`` as the name of the points, if the shape is wrong, a coordinate is not finite, or there are
    fewer than ``least`` points.
    """
    try:
        array = np.array(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} is not an array of numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 2:
        raise InputError(f"{what} has shape {array.shape}: it must be (n, 2), one point per row")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise InputError(
            f"{what} has {len(bad)} points that are not finite, the first at index {bad[0]}: {array[bad[0]]}"
        )
    if len(array) < least:
        raise InputError(f"{what} has {len(array)} points: it needs at least {least}")
    return array


def closed_vertices(points: FloatArray, closed: bool) -> FloatArray:
    """Return the vertices of a polyline in order; for a closed polyline the first vertex is repeated at the end."""
    return np.vstack([points, points[:1]]) if closed else points


def transform_points(points: FloatArray, scale: float, angle: float, shift: ArrayLike) -> FloatArray:
    """Return points, shape (n, 2), scaled and rotated (rad, counter-clockwise) about the origin, then shifted (m)."""
    c, s = scale * cos(angle), scale * sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + shift)


def arc_lengths(vertices: FloatArray) -> FloatArray:
    """Return the length along a polyline up to each vertex, from 0, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(vertices, axis=0).T))])


def half_lengths(lengths: FloatArray, closed: bool) -> FloatArray:
    """Return, for each point of a polyline, half the total length of the segments that meet there.

    ``lengths`` are the lengths of all segments.
    """
    before = np.roll(lengths, 1) if closed else np.append(0.0, lengths)
    after = lengths if closed else np.append(lengths, 0.0)
    return 0.5 * (before + after)


def interpolate_polyline(vertices: FloatArray, s: ArrayLike) -> FloatArray:
    """Interpolate points of a polyline at arc lengths s, shape (len(s), 2)."""
    lengths = arc_lengths(vertices)
    return np.column_stack([np.interp(np.asarray(s, dtype=float), lengths, column) for column in vertices.T])


def even_odd_area(*rings: FloatArray) -> float:
    """Compute the area of the points that closed polylines encircle an odd number of times in total (m2).

    For one polyline the result is the enclosed area by the even-odd rule: both lobes of a figure-eight count, an inner loop
    does not. For two polylines the result is the area of the symmetric difference of the enclosed areas, whose points are
    inside exactly one of the polylines. The polylines are cut at their crossings; a face between the pieces counts if a point
    inside the face is encircled an odd number of times.

    Parameters
    ----------
    *rings : ndarray, shape (n, 2)
        Closed polylines without the first point again at the end.
    """
    import shapely

    vertices = [closed_vertices(points, True) for points in rings]
    pieces = shapely.get_parts(shapely.unary_union([shapely.LineString(v) for v in vertices]))
    faces = shapely.get_parts(shapely.polygonize(pieces))
    x, y = shapely.get_coordinates(shapely.point_on_surface(faces)).T
    inside = [shapely.contains_xy(shapely.Polygon(v), x, y) for v in vertices]
    return float(shapely.area(faces)[np.logical_xor.reduce(inside)].sum())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetPath:
    """A plane curve to be traced, in the order of the points.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Points in order (m); a closed curve does not repeat its first point at the end.
    closed : bool
        Whether the last point is joined to the first.

    Raises
    ------
    InputError
        If there are fewer than 3 points (2 if open), a point is not finite, two successive points or all are the same, the
        shape is not (n, 2), or a closed curve encloses no area.
    """

    points: FloatArray
    closed: bool

    def __post_init__(self) -> None:
        points = plane_points(self.points, "the target", 3 if self.closed else 2)
        extent = float(np.ptp(points, axis=0).max())
        nothing = COINCIDENT * max(extent, float(np.abs(points).max()))
        if extent <= nothing:
            raise InputError(
                f"all {len(points)} points of the target are the same one: {points[0, 0]:.6g} m, {points[0, 1]:.6g} m"
            )
        # relative to the coordinates, too: far from the origin rounding makes close points coincide
        steps = np.hypot(*np.diff(closed_vertices(points, self.closed), axis=0).T)
        same = np.flatnonzero(steps <= nothing)
        if len(same):
            first, second = int(same[0]), int(same[0] + 1) % len(points)
            hint = ": the last point repeats the first, leave it out" if second == 0 else ""
            raise InputError(
                f"the target has {len(same)} pairs of successive points that are the same, the first at indices "
                f"{first} and {second}{hint}"
            )
        points.setflags(write=False)
        object.__setattr__(self, "points", points)
        if self.closed and self.enclosed_area <= COINCIDENT * self.length**2:
            raise InputError(
                "the target is closed and encloses no area: give a line that is traced there and back as an open curve"
            )

    @classmethod
    def from_file(
        cls, path: str | Path, *, unit: str | None = None, name: str | None = None, closed: bool | None = None
    ) -> TargetPath:
        """Read the curve of a CSV or SVG file; see `analysis.files.read_points`. If given, ``closed`` overrules the file.

        Raises
        ------
        InputError
            If the file cannot be read, or its points are not a valid target.
        """
        points, found = read_points(path, unit=unit, name=name)
        return cls(points=points, closed=found if closed is None else closed)

    @property
    def length(self) -> float:
        """Return the length of the polyline (m)."""
        return float(arc_lengths(closed_vertices(self.points, self.closed))[-1])

    def _segments(self) -> tuple[FloatArray, FloatArray]:
        vertices = closed_vertices(self.points, self.closed)
        return 0.5 * (vertices[:-1] + vertices[1:]), np.hypot(*np.diff(vertices, axis=0).T)

    @property
    def centroid(self) -> FloatArray:
        """Return the centroid of the line itself, not of the area inside (m), shape (2,)."""
        middles, lengths = self._segments()
        return lengths @ middles / lengths.sum()

    @property
    def size(self) -> float:
        """Return the radius of gyration: the root of the mean squared distance of the line from its centroid (m)."""
        middles, lengths = self._segments()
        # the mean squared distance of a segment from its own middle is l^2/12
        squares = ((middles - self.centroid) ** 2).sum(axis=1) + lengths**2 / 12.0
        return float(np.sqrt(lengths @ squares / lengths.sum()))

    @property
    def signed_area(self) -> float:
        """Return the integral of x dy around the closed curve (m2): positive counter-clockwise; lobes of a figure-eight cancel.

        Raises
        ------
        InputError
            If the curve is open.
        """
        self._must_be_closed()
        x, y = (self.points - self.points[0]).T
        return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))

    @property
    def enclosed_area(self) -> float:
        """Return the enclosed area, by the even-odd rule (m2); see `even_odd_area`.

        Raises
        ------
        InputError
            If the curve is open.
        """
        self._must_be_closed()
        return even_odd_area(self.points)

    def _must_be_closed(self) -> None:
        if not self.closed:
            raise InputError("the target is open: it encloses no area")

    @property
    def weights(self) -> FloatArray:
        """Return the arc length that belongs to each point: half the length of its two segments (m), shape (n,)."""
        return half_lengths(self._segments()[1], self.closed)

    @property
    def normals(self) -> FloatArray:
        """Return the unit normals at the points, shape (n, 2): outward for a closed curve, to the right along an open one.

        A normal is perpendicular to the parabola through the point and its two neighbours (second order in the spacing), or at
        an open end to the end segment. For a closed curve that crosses itself, outward refers to the lobe with more area.
        """
        vertices = closed_vertices(self.points, self.closed)
        steps = np.diff(vertices, axis=0)
        lengths = np.hypot(*steps.T)[:, None]
        units = steps / lengths
        if self.closed:
            before, after, h, k = np.roll(units, 1, axis=0), units, np.roll(lengths, 1, axis=0), lengths
        else:
            before, after = np.vstack([units[:1], units]), np.vstack([units, units[-1:]])
            h, k = np.vstack([lengths[:1], lengths]), np.vstack([lengths, lengths[-1:]])
        tangents = (k * before + h * after) / (h + k)
        size = np.hypot(*tangents.T)[:, None]
        # at the tip of a cusp, where the curve turns back on itself, take the tangent before the tip
        tangents = np.where(size > 1e-9, tangents / np.maximum(size, 1e-9), before)
        side = -1.0 if self.closed and self.signed_area < 0.0 else 1.0
        return side * np.column_stack([tangents[:, 1], -tangents[:, 0]])

    def reverse(self) -> TargetPath:
        """Return the same curve in the opposite direction; a closed curve starts at the same point."""
        points = np.roll(self.points[::-1], 1, axis=0) if self.closed else self.points[::-1]
        return TargetPath(points=points, closed=self.closed)

    def resample(self, n: int) -> TargetPath:
        """Return the curve through n points of the polyline at equal arc lengths, from the first point.

        An open curve keeps both ends.

        Raises
        ------
        InputError
            If n is less than 3 (2 if open), or points coincide.
        """
        least = 3 if self.closed else 2
        if n < least:
            raise InputError(f"{n} points are asked for: there must be at least {least}")
        s = np.linspace(0.0, self.length, n, endpoint=not self.closed)
        return TargetPath(points=interpolate_polyline(closed_vertices(self.points, self.closed), s), closed=self.closed)

    def transform(
        self, *, scale: float = 1.0, angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)
    ) -> TargetPath:
        """Return the curve scaled and rotated (rad, counter-clockwise) about the origin, then shifted (m).

        Raises
        ------
        InputError
            If the scale is not greater than zero, or a number is not finite.
        """
        if not scale > 0.0:
            raise InputError(f"the scale is {scale!r}: it must be greater than zero")
        return TargetPath(points=transform_points(self.points, scale, angle, shift), closed=self.closed)

    def smooth(self, n: int, *, deviation: float | None = None) -> TargetPath:
        """Fit a cubic smoothing spline to a noisy curve; return n points of the spline at equal arc lengths as a curve.

        The spline z(u) over the chord length u of the points z_k = x + i y minimises::

            sum |z_k - z(u_k)|^2 + lambda * integral |z''|^2 du,

        periodic for a closed curve, with natural ends for an open one (Green and Silverman, Nonparametric Regression and
        Generalized Linear Models, 1994, chapter 2). Both coordinates share lambda, so that a rotation of the curve rotates the
        result.

        Parameters
        ----------
        n : int
            Number of points of the result.
        deviation : float, optional
            Root mean square distance of the points from the spline (m), if the noise is known. By default lambda is chosen by
            generalised cross-validation, which assumes that the noise is not correlated from point to point; for a slow tremor
            of the hand give the deviation.

        Raises
        ------
        InputError
            If the curve has fewer than 6 points, or the deviation is not between zero and the deviation of the smoothest
            possible curve (a point if closed, a straight line if open).
        """
        from scipy.interpolate import CubicSpline
        from scipy.optimize import brentq, minimize_scalar

        if len(self.points) < 6:
            raise InputError(f"the target has {len(self.points)} points: smoothing needs at least 6")
        points = self.points if len(self.points) <= MOST_SMOOTHED else self.resample(MOST_SMOOTHED).points
        origin, unit = points.mean(axis=0), self.size
        vertices = closed_vertices(points - origin, self.closed) / unit
        u = arc_lengths(vertices)
        z = vertices[: len(points)] @ np.array([1.0, 1j])
        stiffness, modes = np.linalg.eigh(_bending(np.diff(u), self.closed))
        free = 1 if self.closed else 2  # modes without bending: a point, or a straight line
        stiffness[:free] = 0.0
        c = modes.T @ z

        def misfit(log: float) -> float:
            """Return the mean squared distance of the points from the spline, for the logarithm of lambda."""
            held = 1.0 / (1.0 + np.exp(log) * stiffness)
            return float((np.abs((1.0 - held) * c) ** 2).mean())

        def validation(log: float) -> float:
            freedom = (1.0 / (1.0 + np.exp(log) * stiffness)).mean()
            left = 1.0 - FREEDOM_WEIGHT * freedom
            return float(np.log(misfit(log) + 1e-30) - 2.0 * np.log(left)) if left > 0.0 else float("inf")

        low, high = -np.log(stiffness[-1]) - 20.0, -np.log(stiffness[free]) + 20.0
        if deviation is None:
            grid = np.linspace(low, high, 200)
            k = int(np.argmin([validation(g) for g in grid]))
            log = minimize_scalar(
                validation, bounds=(grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]), method="bounded"
            ).x
        else:
            wanted, most = (deviation / unit) ** 2, misfit(high)
            if not (deviation > 0.0 and wanted < most):
                raise InputError(
                    f"a deviation of {deviation!r} m: it must be greater than zero and less than {unit * most**0.5:.3g} m, "
                    "where nothing is left of the curve"
                )
            log = low if misfit(low) >= wanted else brentq(lambda g: misfit(g) - wanted, low, high, xtol=1e-12)
        fitted = modes @ (c / (1.0 + np.exp(log) * stiffness))
        knots = closed_vertices(np.column_stack([fitted.real, fitted.imag]), self.closed)
        spline = CubicSpline(u, knots, bc_type="periodic" if self.closed else "natural")
        fine = spline(np.linspace(0.0, u[-1], max(20 * n, 10 * len(u)), endpoint=not self.closed))
        return TargetPath(points=origin + unit * fine, closed=self.closed).resample(n)


def _bending(h: FloatArray, closed: bool) -> FloatArray:
    """Return the matrix K = Q R^-1 Q' for which z' K z is the integral of z''^2 over the cubic spline through the values z.

    ``h`` has the distances between the knots. The spline is periodic if ``closed``, otherwise natural with z'' = 0 at both ends
    (Green and Silverman, section 2.1.2).
    """
    n = len(h) if closed else len(h) + 1
    inner = np.arange(n) if closed else np.arange(1, n - 1)
    before, after = h[inner - 1], h[inner % len(h)]
    eye = np.eye(n)
    # R z'' = Q' z at every knot (of an open curve: at the inner ones, z'' being zero at the ends)
    r = (
        eye[inner - 1] * (before / 6.0)[:, None]
        + eye[inner] * ((before + after) / 3.0)[:, None]
        + eye[(inner + 1) % n] * (after / 6.0)[:, None]
    )[:, inner]
    slopes = (eye[(inner + 1) % n] - eye[inner]) / after[:, None] - (eye[inner] - eye[inner - 1]) / before[:, None]
    k: FloatArray = slopes.T @ np.linalg.solve(r, slopes)
    return 0.5 * (k + k.T)


#: Pieces of equal length into which a curve is cut to integrate a distance along it.
PIECES = 2000


def curve_distance(curve: ArrayLike, points: ArrayLike, *, closed: bool = True) -> FloatArray:
    """Compute the distance of each point from a curve of straight segments, exactly (m), shape (m,).

    Parameters
    ----------
    curve : array_like, shape (n, 2)
        Vertices of the curve (m).
    points : array_like, shape (m, 2)
        Points whose distances are computed (m).
    closed : bool
        Whether the curve's last point is joined to its first.

    Raises
    ------
    InputError
        If the curve has fewer than 2 points, or a coordinate is not finite.
    """
    import shapely

    line = shapely.LineString(closed_vertices(plane_points(curve, "the curve", 2), closed))
    return shapely.distance(line, shapely.points(plane_points(points, "the points", 0)))


def _cut_into_pieces(vertices: FloatArray) -> tuple[FloatArray, float]:
    """Divide a polyline into `PIECES` pieces of equal length; return their midpoints, shape (PIECES, 2), and its length."""
    length = float(arc_lengths(vertices)[-1])
    return interpolate_polyline(vertices, (np.arange(PIECES) + 0.5) * (length / PIECES)), length


def area_difference(curve: ArrayLike, target: TargetPath, *, closed: bool = True) -> float:
    """Compute the area between a traced curve and its target (m2).

    If both are closed, the result is the area of the symmetric difference of the enclosed areas, by the even-odd rule
    (`even_odd_area`); it is exact for the polylines.

    Otherwise, with d(p, S) the distance of a point p from the nearest point of a curve S, the area is

        A = 1/2 (integral over the target of d(p, curve) ds + integral over the curve of d(p, target) ds),

    which is symmetric and zero only for equal curves. For parallel curves A is exactly the area of the strip between them
    (Steiner's formula: their distance times the mean of their lengths). If the target is open and the curve closed, only a part
    of the curve traces the target, and the rest of the curve does not count:

        A = integral over the target of d(p, curve) ds.

    The integrals are sums over `PIECES` pieces of equal length by the midpoint rule, with an error of about 1e-6 of the value.

    Parameters
    ----------
    curve : array_like, shape (n, 2)
        Vertices of the traced curve (m).
    target : TargetPath
    closed : bool
        Whether the curve's last point is joined to its first.

    Raises
    ------
    InputError
        If the curve has fewer than 3 points (2 if open), or a coordinate is not finite.
    """
    points = plane_points(curve, "the curve", 3 if closed else 2)
    if closed and target.closed:
        return even_odd_area(target.points, points)
    middles, length = _cut_into_pieces(closed_vertices(target.points, target.closed))
    missed = length * float(curve_distance(points, middles, closed=closed).mean())
    if closed:
        return missed
    middles, length = _cut_into_pieces(points)
    return 0.5 * (missed + length * float(curve_distance(target.points, middles, closed=target.closed).mean()))


def hausdorff(curve: ArrayLike, target: TargetPath, *, closed: bool = True) -> float:
    """Compute the Hausdorff distance of a traced curve from its target (m).

    For an open target and a closed curve only the target's points count, as in `area_difference`. Distances are computed at the
    vertices and at `PIECES` points at equal arc lengths. The result is below the true distance by at most half the spacing of
    these points.

    Parameters
    ----------
    curve, target, closed
        As for `area_difference`.

    Raises
    ------
    InputError
        As for `area_difference`.
    """
    points = plane_points(curve, "the curve", 3 if closed else 2)
    seen = np.vstack([target.points, _cut_into_pieces(closed_vertices(target.points, target.closed))[0]])
    largest = float(curve_distance(points, seen, closed=closed).max())
    if closed and not target.closed:
        return largest
    seen = np.vstack([points, _cut_into_pieces(closed_vertices(points, closed))[0]])
    return max(largest, float(curve_distance(target.points, seen, closed=target.closed).max()))


# Straight parts


@dataclass(frozen=True, slots=True, kw_only=True)
class Straightness:
    """Length and flatness of a part of a curve, along and across a straight line.

    Attributes
    ----------
    travel : float
        Distance from the part's first to its last point, along the line (m).
    extent : float
        Distance between the outermost points along the line (m): more than the travel if the part turns back.
    flatness : float
        Distance between the outermost points across the line (m).
    direction : float
        Direction of the line, from the first point to the last (rad, -pi to pi).
    start : int
        Index of the part's first point in the curve.
    """

    travel: float
    extent: float
    flatness: float
    direction: float
    start: int = 0


def straightness(part: ArrayLike, *, direction: float | None = None) -> Straightness:
    """Compute travel and flatness of a part of a curve.

    Parameters
    ----------
    part : array_like, shape (n, 2)
        Points of the part in order (m), for example those within a range of crank angles.
    direction : float, optional
        Direction of the wanted line (rad). The default is the direction of the narrowest strip that contains the points (the
        minimum zone of ISO 1101; an edge of the convex hull lies along the strip).

    Raises
    ------
    InputError
        If there are fewer than 2 points, a number is not finite, or no direction is given and all points are the same.
    """
    points = plane_points(part, "the part", 2)
    points = points - points[0]
    if direction is None:
        direction = _narrowest_direction(points)
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


def _narrowest_direction(points: FloatArray) -> float:
    """Return the direction of the narrowest strip that contains the points."""
    import shapely

    hull = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(points)))
    if len(hull) == 1:
        raise InputError(f"all {len(points)} points of the part are the same one: it has no direction")
    edges = np.diff(hull, axis=0)
    edges /= np.hypot(*edges.T)[:, None]
    widths = np.ptp(edges[:, :1] * hull[:, 1] - edges[:, 1:] * hull[:, 0], axis=1)
    x, y = edges[int(np.argmin(widths))]
    return atan2(y, x)


def straight_parts(
    curve: ArrayLike, count: int, *, direction: float | None = None, closed: bool = True
) -> list[Straightness]:
    """Return travel and flatness of every part of a curve that consists of ``count`` successive points.

    ``curve`` has the shape (n, 2), in m; for ``direction`` see `straightness`. In a ``closed`` curve a part may continue from
    the last point to the first. Raises InputError if the curve has fewer than ``count`` points.
    """
    points = plane_points(curve, "the curve", 2)
    if not 2 <= count <= len(points):
        raise InputError(f"a part of {count} points of {len(points)}: it must have from 2 to {len(points)} points")
    starts = len(points) if closed else len(points) - count + 1
    # a part may cross the seam of a closed curve: append the curve's beginning
    laid = np.vstack([points, points[: count - 1]]) if closed else points
    return [
        replace(straightness(laid[start : start + count], direction=direction), start=start) for start in range(starts)
    ]
