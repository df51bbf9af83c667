"""Represent targets, from points, files or formulas, and measure the deviation of a traced curve from its target.

A curve is a polyline: straight segments join its points; in a closed curve a segment also joins the last point to the first.
Length, centroid, size and areas are exact for the polyline.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, e, pi, sin, tau
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ...files import read_points, unknown_name
from ...units import quantity

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
        raise InputError(f"{what}: not an array of numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] != 2:
        raise InputError(f"{what}: the shape is {array.shape}, it must be (n, 2), one point per row")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if len(bad):
        raise InputError(f"{what}: {len(bad)} are not finite, the first at index {bad[0]}: {array[bad[0]]}")
    if len(array) < least:
        raise InputError(f"{what}: {len(array)} are too few, there must be at least {least}")
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

    The polylines, shape (n, 2), do not repeat the first point at the end. For one polyline the result is the enclosed area by
    the even-odd rule: both lobes of a figure-eight count, an inner loop does not. For two polylines the result is the area of
    the symmetric difference of the enclosed areas, whose points are inside exactly one of the polylines. The polylines are cut
    at their crossings; a face between the pieces counts if a point inside the face is encircled an odd number of times.
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
        points = plane_points(self.points, "points of the target", 3 if self.closed else 2)
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

        Raises InputError if the file cannot be read, or its points are not a valid target.
        """
        points, found = read_points(path, unit=unit, name=name)
        return cls(points=points, closed=found if closed is None else closed)

    @property
    def length(self) -> float:
        """Return the length of the polyline (m)."""
        return float(arc_lengths(closed_vertices(self.points, self.closed))[-1])

    @property
    def size(self) -> float:
        """Return the radius of gyration: the root of the mean squared distance of the line from its centroid (m)."""
        vertices = closed_vertices(self.points, self.closed)
        middles, lengths = 0.5 * (vertices[:-1] + vertices[1:]), np.hypot(*np.diff(vertices, axis=0).T)
        centroid = lengths @ middles / lengths.sum()
        # the mean squared distance of a segment from its own middle is l^2/12
        squares = ((middles - centroid) ** 2).sum(axis=1) + lengths**2 / 12.0
        return float(np.sqrt(lengths @ squares / lengths.sum()))

    @property
    def enclosed_area(self) -> float:
        """Return the enclosed area, by the even-odd rule (m2); see `even_odd_area`.

        Raises InputError if the curve is open.
        """
        if not self.closed:
            raise InputError("the target is open: it encloses no area")
        return even_odd_area(self.points)

    def resample(self, n: int) -> TargetPath:
        """Return the curve through n points of the polyline at equal arc lengths, from the first point.

        An open curve keeps both ends.

        Raises InputError if n is less than 3 (2 if open), or points coincide.
        """
        least = 3 if self.closed else 2
        if n < least:
            raise InputError(f"{n} points are asked for: there must be at least {least}")
        s = np.linspace(0.0, self.length, n, endpoint=not self.closed)
        return TargetPath(points=interpolate_polyline(closed_vertices(self.points, self.closed), s), closed=self.closed)

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


#: Number of pieces of equal length into which a curve is cut to integrate a distance along it.
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
    from ...numerics.overlap import find_nearest

    line = np.ascontiguousarray(plane_points(curve, "points of the curve", 2).T)
    places = np.ascontiguousarray(plane_points(points, "the points", 0).T)
    distance, share = np.empty((2, places.shape[1]))
    find_nearest(places, line, closed, distance, np.empty(len(distance), dtype=np.int64), share)
    return distance


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
    points = plane_points(curve, "points of the curve", 3 if closed else 2)
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
    points = plane_points(curve, "points of the curve", 3 if closed else 2)
    seen = np.vstack([target.points, _cut_into_pieces(closed_vertices(target.points, target.closed))[0]])
    largest = float(curve_distance(points, seen, closed=closed).max())
    if closed and not target.closed:
        return largest
    seen = np.vstack([points, _cut_into_pieces(closed_vertices(points, closed))[0]])
    return max(largest, float(curve_distance(target.points, seen, closed=target.closed).max()))


def straightness(part: ArrayLike, direction: float) -> tuple[float, float]:
    """Return travel and flatness of a part of a curve, whose points have the shape (n, 2): two lengths (m).

    The travel is the distance from the first point to the last along the ``direction`` (rad) of a straight line; the flatness
    is the distance between the outermost points across this line.
    """
    points = plane_points(part, "points of the part", 2)
    points = points - points[0]
    along, across = (points @ np.array([[cos(direction), -sin(direction)], [sin(direction), cos(direction)]])).T
    return abs(float(along[-1])), float(np.ptp(across))


# Formulas

Spacing = Literal["even", "chebyshev"]
#: Constants, functions and operators of formulas; most functions have one argument.
_CONSTANTS = {"pi": pi, "e": e, "tau": tau}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")},
    **{name: getattr(np, name) for name in ("abs", "sign", "floor", "ceil", "degrees", "radians", "hypot")},
    **{name: getattr(np, f"arc{name[1:]}") for name in ("asin", "acos", "atan", "atan2")},
    "min": np.minimum,
    "max": np.maximum,
}
_TWO_ARGUMENTS = ("atan2", "hypot", "min", "max")
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
#: Longest expression, in characters.
_LONGEST = 1000


def parse_expression(text: str, what: str) -> ast.expr:
    """Parse a text with `ast`, without running it; ``what`` is its name in messages, as in "the formula".

    Raises InputError if the text is too long, or not an expression.
    """
    if len(text) > _LONGEST:
        raise InputError(f"{what} {text[:40]!r}... has {len(text)} characters: it must have no more than {_LONGEST}")
    try:
        return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else str(error)
        raise InputError(f"{what} {text!r} cannot be read: {reason}") from None


def evaluate_expression(
    node: ast.expr, what: str, names: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]
) -> Any:
    """Evaluate a parsed expression of numbers, ``names``, ``functions`` and operators, and refuse anything else.

    Raises InputError, which begins with ``what``, such as "the formula 't^2'", and names the wrong part.
    """

    def refusal(node: ast.AST, reason: str) -> InputError:
        return InputError(f"in {what}: {ast.unparse(node)!r} {reason}")

    def value(node: ast.AST) -> Any:
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                try:
                    return np.float64(number)
                except OverflowError:
                    raise refusal(node, "is too large") from None
            case ast.Name(id=name):
                if name not in names:
                    raise refusal(node, f"is not known: {unknown_name(name, [*names])}")
                return names[name]
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](value(left), value(right))
            case ast.BinOp(op=ast.BitXor()):
                raise refusal(node, "has ^, which is no power here: write **")
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](value(operand))
            case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
                if name not in functions:
                    raise refusal(node, f"is not known: {unknown_name(name, [*functions])}")
                count = 2 if name in _TWO_ARGUMENTS else 1
                if len(args) != count:
                    raise refusal(node, f"has {len(args)} arguments: {name} takes {count}")
                return functions[name](*map(value, args))
            case _:
                raise refusal(node, "is not allowed: there may be numbers, operators, functions and names only")

    try:
        with np.errstate(all="ignore"):
            return value(node)
    except RecursionError:
        raise InputError(f"{what} is nested too deeply") from None


def formula(text: str, variable: str = "t") -> Callable[[ArrayLike], FloatArray]:
    """Convert a text such as ``"70 + 100*abs(sin(t/2))"`` to a function of one variable.

    The text may contain numbers, ``+ - * / % **``, brackets, ``pi e tau``, ``sin cos tan asin acos atan atan2 sinh cosh tanh
    exp log sqrt abs sign floor ceil hypot min max degrees radians``, and the variable; angles are in radians. The function
    takes an array, and returns one of the same shape; it raises InputError if a value is not finite.

    Raises InputError if the text is not a formula of this kind; the message names the wrong part.
    """
    if not isinstance(text, str):
        raise InputError(f"a formula must be a text, not {text!r}")
    tree, what = parse_expression(text, "the formula"), f"the formula {text!r}"

    def value(t: FloatArray) -> Any:
        return evaluate_expression(tree, what, {variable: t} | _CONSTANTS, _FUNCTIONS)

    def evaluate_formula(t: ArrayLike) -> FloatArray:
        t = np.asarray(t, dtype=float)
        values: FloatArray = np.array(np.broadcast_to(value(t), t.shape), dtype=float)
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"{what} has the value {values.flat[bad[0]]} at {variable} = {t.flat[bad[0]]:.6g}: it must be finite"
            )
        return values

    value(np.zeros(()))
    return evaluate_formula


def _number(value: float | str) -> float:
    return float(formula(value, "")(0.0)) if isinstance(value, str) else float(value)


def _parameter(start: float | str, end: float | str, n: int, turn: bool) -> FloatArray:
    """Return n evenly spaced values from start to end; ``turn`` leaves the end out."""
    a, b = _number(start), _number(end)
    if not (np.isfinite([a, b]).all() and b > a):
        raise InputError(f"the parameter goes from {start!r} to {end!r}: the end must be greater, and both finite")
    return np.linspace(a, b, n, endpoint=not turn)


def path_from_formula(
    x: str,
    y: str,
    *,
    n: int = 72,
    unit: str = "m",
    start: float | str = 0.0,
    end: float | str = 2.0 * pi,
) -> TargetPath:
    """Compute a curve from two formulas, at n equal steps of their parameter.

    Parameters
    ----------
    x, y : str
        See `formula`; for example ``"20 + 10*cos(t)"`` and ``"15 + 5*sin(t)"``.
    n : int
        Number of points.
    unit : str
        Unit of the formulas' values, such as ``"cm"``.
    start, end : float or str
        Range of the parameter, as numbers or formulas such as ``"3*pi/2"``. If the curve ends at its first point (to within
        1e-9 of its extent), it is closed, and that point is not repeated.

    Raises
    ------
    InputError
        If a formula, the range or the curve is not usable.
    ParameterError
        If the unit is not a unit of length.
    """
    factor = quantity(f"1 {unit}", "m", "unit")
    functions = [formula(text) for text in (x, y)]

    def points(turn: bool, number: int) -> FloatArray:
        t = _parameter(start, end, number, turn)
        return factor * np.column_stack([f(t) for f in functions])

    drawn = points(False, n + 1)
    closed = bool(np.hypot(*(drawn[-1] - drawn[0])) <= 1e-9 * np.ptp(drawn, axis=0).max())
    return TargetPath(points=points(closed, n), closed=closed)


def function_from_formula(
    text: str,
    *,
    n: int = 72,
    unit: str = "rad",
    start: float | str = 0.0,
    end: float | str = 2.0 * pi,
    spacing: Spacing = "even",
) -> tuple[FloatArray, FloatArray]:
    """Compute angles at n equal steps of the crank angle from a formula such as ``"70 + 100*abs(sin(t/2))"``.

    Parameters
    ----------
    text : str
        See `formula`; its variable is the crank angle omega t (rad).
    n
        As for `path_from_formula`.
    unit : str
        Unit of the formula's value.
    start, end : float or str
        Range of the crank angle. If it is a number of whole turns, the end is left out, because it repeats the start.
    spacing : "even" or "chebyshev"
        "chebyshev" is for precision points: see `chebyshev_spacing`.

    Returns
    -------
    crank_angle, angle : ndarray, shape (n,)
        Crank angles and angles of the formula (rad).

    Raises
    ------
    InputError
        If the formula or the range is not usable.
    ParameterError
        If the unit is not a unit of angle.
    """
    factor = quantity(f"1 {unit}", "rad", "unit")
    if spacing == "chebyshev":
        places = chebyshev_spacing(_number(start), _number(end), n)
        return places, factor * formula(text)(places)
    turns = (_number(end) - _number(start)) / tau
    whole = bool(np.isfinite(turns) and abs(turns - round(turns)) < 1e-9)
    crank_angle = _parameter(start, end, n, whole)
    return crank_angle, factor * formula(text)(crank_angle)


def chebyshev_spacing(low: float, high: float, n: int) -> FloatArray:
    """Return n precision points between two limits, spaced so that the error between them is nearly the least possible.

    The points are the roots of Chebyshev's polynomial of degree n, as Freudenstein recommends.

    Raises InputError if there is no point, or the limits are not in order.
    """
    if n < 1 or not (np.isfinite([low, high]).all() and low < high):
        raise InputError(f"{n} precision points from {low:g} to {high:g}: at least one, between finite limits in order")
    return 0.5 * (low + high) - 0.5 * (high - low) * np.cos((2.0 * np.arange(1, n + 1) - 1.0) * pi / (2 * n))
