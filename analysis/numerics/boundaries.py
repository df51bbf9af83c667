"""Boundaries in a chart: curves along which a smooth function of two parameters is zero, found and traced.

It knows no mechanics. `scan` finds the roots along a line, close pairs too; `trace` follows a boundary from a point near it by
predictor and corrector; `chart` finds and follows all that cross its lines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from linkwork.errors import InputError, LinkworkError

#: A smooth function of a point of a chart, negative in a region of instability.
Test = Callable[[float, float], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """A point at which a test function has no value, and why."""

    point: tuple[float, float]
    message: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Line:
    """What a test function does along a line.

    Attributes
    ----------
    roots : ndarray, shape (n,)
        Where it is zero, increasing.
    intervals : tuple of (float, float)
        Where it is negative; an interval may end at an end of the line or at a gap.
    gaps : tuple of (float, str)
        Samples at which it has no value, and why.
    """

    roots: NDArray[np.float64]
    intervals: tuple[tuple[float, float], ...]
    gaps: tuple[tuple[float, str], ...]


def scan(
    function: Callable[[float], float], low: float, high: float, *, samples: int = 200, tolerance: float = 1e-12
) -> Line:
    """Find the roots of a function on an interval, the close pairs on both sides of a narrow region too.

    Where the samples pass an extremum towards zero, the extremum itself is sought: two boundaries closer together than the
    samples are not missed, as long as the function is monotonic on the way to them.

    Parameters
    ----------
    function : callable
        Of one float; where it raises a `LinkworkError` there is a gap.
    low, high : float
    samples : int
        At least 3.
    tolerance : float
        Of the roots, relative to the length of the interval.

    Raises
    ------
    InputError
        If the interval or the number of samples is not usable.
    """
    points = _samples(low, high, samples)
    values, gaps = np.full(samples, np.nan), []
    for i, point in enumerate(points.tolist()):
        try:
            values[i] = function(point)
        except LinkworkError as error:
            gaps.append((point, str(error)))
    places, results = list(points), list(values)
    for i in range(samples):
        first, last = max(i - 1, 0), min(i + 1, samples - 1)
        around, sign = values[first : last + 1], np.sign(values[i])
        if np.isfinite(around).all() and (np.sign(around) == sign).all() and first + np.argmin(sign * around) == i:
            try:
                found = minimize_scalar(
                    lambda x, sign=sign: sign * function(x),
                    bounds=(points[first], points[last]),
                    method="bounded",
                    options={"xatol": 1e-9 * (high - low)},
                )
            except LinkworkError as error:
                gaps.append((float(points[i]), f"between the samples: {error}"))
                continue
            if found.fun < 0.0:
                places.append(float(found.x))
                results.append(sign * float(found.fun))
    order = np.argsort(places, kind="stable")
    points, values = np.array(places)[order], np.array(results)[order]
    roots = []
    intervals: list[tuple[float, float]] = []
    begun = float(points[0]) if values[0] < 0.0 else None
    for i in range(1, len(points)):
        left, right = values[i - 1], values[i]
        here = float(points[i])
        if np.isnan(left) or np.isnan(right):
            if begun is not None and np.isnan(right):
                intervals.append((begun, float(points[i - 1])))
                begun = None
            elif right < 0.0:
                begun = here
            continue
        if (left < 0.0) == (right < 0.0):
            continue
        # a function value of zero counts as positive: the same root is not found from both sides
        try:
            root = here if right == 0.0 else float(brentq(function, points[i - 1], here, xtol=tolerance * (high - low)))
        except LinkworkError as error:
            gaps.append((here, f"just before: {error}"))
            # the boundary is somewhere between the samples, and so is the end of the interval
            if begun is not None:
                intervals.append((begun, float(points[i - 1])))
            begun = here if right < 0.0 else None
            continue
        roots.append(root)
        if right < 0.0:
            begun = root
        elif begun is not None:
            intervals.append((begun, root))
            begun = None
    if begun is not None:
        intervals.append((begun, float(points[-1])))
    return Line(roots=np.array(roots), intervals=tuple(intervals), gaps=tuple(gaps))


def lowest(
    function: Callable[[float], float], low: float, high: float, *, samples: int = 40, tolerance: float = 1e-9
) -> tuple[float, float]:
    """Place and value of the least value of a smooth function on an interval.

    The place to within a tolerance relative to the length of the interval; the value is good to its square.

    Raises
    ------
    InputError
        If the interval or the number of samples is not usable.
    """
    points = _samples(low, high, samples)
    values = [function(x) for x in points.tolist()]
    i = int(np.argmin(values))
    bounds = points[max(i - 1, 0)], points[min(i + 1, samples - 1)]
    found = minimize_scalar(function, bounds=bounds, method="bounded", options={"xatol": tolerance * (high - low)})
    return (float(found.x), float(found.fun)) if found.fun < values[i] else (float(points[i]), float(values[i]))


def _samples(low: float, high: float, count: int) -> NDArray[np.float64]:
    if not (isfinite(low) and isfinite(high) and low < high) or count < 3:
        raise InputError(f"a line from {low} to {high} with {count} samples: it needs a length and three samples")
    return np.linspace(low, high, count)


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A rectangle of a chart: (low, high) of either axis.

    Raises
    ------
    InputError
        If a side has no length.
    """

    x: tuple[float, float]
    y: tuple[float, float]

    def __post_init__(self) -> None:
        for name, (low, high) in (("x", self.x), ("y", self.y)):
            if not (isfinite(low) and isfinite(high) and low < high):
                raise InputError(f"{name} from {low} to {high}: it must increase")

    @property
    def size(self) -> NDArray[np.float64]:
        """Lengths of the sides, shape (2,)."""
        return np.array([self.x[1] - self.x[0], self.y[1] - self.y[0]])

    @property
    def corner(self) -> NDArray[np.float64]:
        """The lower left corner, shape (2,)."""
        return np.array([self.x[0], self.y[0]])


class Reason(Enum):
    """Why a traced boundary ends."""

    BOX = "it leaves the box"
    CLOSED = "it is closed"
    TIP = "it turns too sharply to follow, or meets another boundary"
    NO_VALUE = "the test function has no value beyond"
    LENGTH = "the number of points is used up"


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """An end of a traced boundary: why, the last good point, and what the test function had to say."""

    reason: Reason
    point: tuple[float, float]
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Boundary:
    """A boundary in a chart; the region of instability is on the left of its direction.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        (x, y) in the units of the axes; of a closed one the last is the first.
    tangents : ndarray, shape (n, 2)
        Directions, of unit length with the box scaled to 1 by 1.
    residual : float
        Largest distance of a point from the boundary, estimated from the test function and its slope, with the box scaled.
    ends : (End, End)
        At the first and at the last point.
    """

    points: NDArray[np.float64]
    tangents: NDArray[np.float64]
    residual: float
    ends: tuple[End, End]

    @property
    def closed(self) -> bool:
        """Whether it is a loop."""
        return self.ends[0].reason is Reason.CLOSED

    def crossings(self, axis: int, value: float, box: Box) -> NDArray[np.float64]:
        """Where it crosses x = value (axis 0) or y = value (axis 1): values of the other, by cubic interpolation."""
        scaled = (self.points - box.corner) / box.size
        level = (value - box.corner[axis]) / box.size[axis]
        found = []
        for p, q, s, t in zip(scaled, scaled[1:], self.tangents, self.tangents[1:]):
            if (p[axis] - level) * (q[axis] - level) > 0.0 or p[axis] == q[axis]:
                continue
            h = float(np.hypot(*(q - p)))

            def curve(u: float, p: Any = p, q: Any = q, s: Any = h * s, t: Any = h * t) -> Any:
                return (
                    (1.0 + 2.0 * u) * (1.0 - u) ** 2 * p
                    + u * u * (3.0 - 2.0 * u) * q
                    + u * (1.0 - u) ** 2 * s
                    - u * u * (1.0 - u) * t
                )

            u = 0.0 if p[axis] == level else 1.0 if q[axis] == level else brentq(lambda u: curve(u)[axis] - level, 0, 1)
            found.append(curve(u)[1 - axis] * box.size[1 - axis] + box.corner[1 - axis])
        return np.array(found)


#: Step (of the box scaled to 1 by 1) for differences of the test function.
_DIFFERENCE = 1e-4
#: Shortest step of a trace, as far as which sharp turns are followed.
_SHORTEST = 1e-6
#: Cosine of the largest turn of the tangent in a step, and of that up to which the step grows.
_TURN, _STRAIGHT = 0.94, 0.995
#: Slope, relative to the steepest so far, below which two boundaries meet.
_FLAT = 1e-6


@dataclass(frozen=True, slots=True)
class _Scaled:
    """A test function on the box scaled to 1 by 1."""

    test: Test
    box: Box
    tolerance: float

    def __call__(self, s: NDArray[np.float64]) -> float:
        x, y = (self.box.corner + s * self.box.size).tolist()
        value = self.test(x, y)
        if not isfinite(value):
            raise InputError(f"the test function is {value} at ({x:.9g}, {y:.9g})")
        return value

    def gradient(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        """By differences of second order that stay inside the box."""
        slope = np.empty(2)
        for axis in range(2):
            step = np.zeros(2)
            step[axis] = _DIFFERENCE
            if s[axis] < _DIFFERENCE:
                slope[axis] = 4.0 * self(s + step) - self(s + 2.0 * step) - 3.0 * self(s)
            elif s[axis] > 1.0 - _DIFFERENCE:
                slope[axis] = 3.0 * self(s) - 4.0 * self(s - step) + self(s - 2.0 * step)
            else:
                slope[axis] = self(s + step) - self(s - step)
        slope /= 2.0 * _DIFFERENCE
        return slope

    def correct(
        self, s: NDArray[np.float64], direction: NDArray[np.float64], slope: float, reach: float
    ) -> tuple[NDArray[np.float64], int] | None:
        """The root on a line through s, by the secant method from a known slope, and the iterations; None if none is near."""
        r, value = 0.0, self(s)
        for iteration in range(1, 13):
            change = -value / slope
            if not abs(r + change) <= reach:
                return None
            r += change
            point = s + r * direction
            if abs(change) <= self.tolerance:
                return point, iteration
            if not _inside(point):
                # it is for the caller to find where the box is left
                return point, iteration
            new = self(point)
            if new == 0.0:
                return point, iteration
            if change != 0.0 and new != value:
                slope = (new - value) / change
            value = new
        return None


def _inside(s: NDArray[np.float64]) -> bool:
    return bool((s >= 0.0).all() and (s <= 1.0).all())


def trace(
    test: Test,
    seed: tuple[float, float],
    box: Box,
    *,
    step: float = 0.02,
    tolerance: float = 1e-10,
    most: int = 5000,
) -> Boundary:
    """Follow the boundary through a point, both ways, by predictor and corrector.

    The predictor goes along the tangent, the corrector along the normal there; a step is taken again at half its length if
    the tangent turns by more than 20 degrees, which also keeps the two sides of a narrow region apart: theirs are opposite.

    Parameters
    ----------
    test : callable
        Smooth function of (x, y), negative on one side.
    seed : (float, float)
        A point near the boundary.
    box : Box
    step : float
        Longest step, with the box scaled to 1 by 1.
    tolerance : float
        Of the points, in the same scale.
    most : int
        Points at most, each way.

    Raises
    ------
    InputError
        If there is no boundary near the seed.
    LinkworkError
        As the test function there.
    """
    f = _Scaled(test, box, tolerance)
    start = (np.array(seed, dtype=float) - box.corner) / box.size
    if not _inside(start):
        raise InputError(f"the seed {seed} lies outside the box")
    slope = f.gradient(start)
    norm = float(np.hypot(*slope))
    # along a side of the box if it lies on one, else along the normal
    on_side = [axis for axis in range(2) if start[axis] in (0.0, 1.0)]
    normal = np.array([0.0, 1.0])[:: 1 if on_side == [0] else -1] if len(on_side) == 1 else slope / (norm or 1.0)
    along = float(slope @ normal)
    corrected = f.correct(start, normal, along, step) if along != 0.0 else None
    if corrected is None or not _inside(corrected[0]):
        raise InputError(f"no boundary within {step:g} of the box of the seed {seed}")
    start = corrected[0]
    forth = _follow(f, start, 1.0, step, most)
    if forth.reason is Reason.CLOSED:
        sides = [forth]
        points, tangents = forth.points, forth.tangents
    else:
        back = _follow(f, start, -1.0, step, most)
        sides = [back, forth]
        points, tangents = back.points[:0:-1] + forth.points, back.tangents[:0:-1] + forth.tangents
    ends = [
        End(reason=side.reason, point=_point(box.corner + side.points[-1] * box.size), message=side.message)
        for side in sides
    ]
    return Boundary(
        points=box.corner + np.array(points) * box.size,
        tangents=np.array(tangents),
        residual=max(side.residual for side in sides),
        ends=(ends[0], ends[-1]),
    )


def _point(values: NDArray[np.float64]) -> tuple[float, float]:
    return float(values[0]), float(values[1])


@dataclass(slots=True)
class _Way:
    """One way along a boundary from its seed, scaled."""

    points: list[NDArray[np.float64]]
    tangents: list[NDArray[np.float64]]
    residual: float
    reason: Reason
    message: str = ""


def _follow(f: _Scaled, start: NDArray[np.float64], way: float, longest: float, most: int) -> _Way:
    """Points from ``start``, it included, in the direction of the boundary (``way`` +1) or against it (-1)."""

    def tangent_of(slope: NDArray[np.float64]) -> NDArray[np.float64]:
        # the negative side, which the slope points away from, is on the left
        direction: NDArray[np.float64] = np.array([-slope[1], slope[0]]) / np.hypot(*slope)
        return direction

    slope = f.gradient(start)
    steepest = float(np.hypot(*slope))
    tangent = tangent_of(slope)
    path = _Way([start], [tangent], abs(f(start)) / steepest, Reason.LENGTH)
    here, h, message = start, longest, ""
    while len(path.points) < most:
        if h < _SHORTEST:
            path.reason, path.message = (Reason.NO_VALUE if message else Reason.TIP), message
            return path
        message = ""
        try:
            ahead = here + way * h * tangent
            normal = np.array([-tangent[1], tangent[0]])
            found = (ahead, 0) if not _inside(ahead) else f.correct(ahead, normal, float(slope @ normal), 0.5 * h)
            leaves = found is not None and not _inside(found[0])
            if found is not None and leaves:
                found = _to_side(f, here, found[0], slope, h)
                if found is not None and np.hypot(*(found[0] - here)) <= f.tolerance:
                    path.reason = Reason.BOX
                    return path
            if found is None:
                h *= 0.5
                continue
            there, iterations = found
            new_slope = f.gradient(there)
            size = float(np.hypot(*new_slope))
            if size <= _FLAT * steepest:
                h *= 0.5
                continue
            new_tangent = tangent_of(new_slope)
            turn = float(new_tangent @ tangent)
            progress = way * float((there - here) @ tangent)
            if turn < _TURN or progress <= 0.0:
                h *= 0.5
                continue
            residual = abs(f(there)) / size
        except LinkworkError as error:
            message = str(error)
            h *= 0.5
            continue
        closed = len(path.points) > 3 and _passes(start, path.tangents[0], here, there, new_tangent)
        if closed:
            there, new_tangent = start, path.tangents[0]
        path.points.append(there)
        path.tangents.append(new_tangent)
        path.residual = max(path.residual, residual)
        if closed or leaves:
            path.reason = Reason.CLOSED if closed else Reason.BOX
            return path
        here, slope, tangent, steepest = there, new_slope, new_tangent, max(steepest, size)
        if turn > _STRAIGHT and iterations <= 4:
            h = min(1.5 * h, longest)
    return path


def _to_side(
    f: _Scaled, here: NDArray[np.float64], outside: NDArray[np.float64], slope: NDArray[np.float64], reach: float
) -> tuple[NDArray[np.float64], int] | None:
    """Where the boundary leaves the box between a point inside and one outside; None if not near the line between them."""
    way = outside - here
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = np.where(way > 0.0, (1.0 - here) / way, np.where(way < 0.0, -here / way, np.inf))
    axis = int(np.argmin(parts))
    part = float(parts[axis])
    side = here + part * way
    side[axis] = 1.0 if way[axis] > 0.0 else 0.0
    if part * float(np.hypot(*way)) <= f.tolerance:
        return here, 0
    other = np.zeros(2)
    other[1 - axis] = 1.0
    along = float(slope @ other)
    if along == 0.0:
        return None
    found = f.correct(side, other, along, 0.5 * reach)
    return found if found is not None and _inside(found[0]) else None


def _passes(
    start: NDArray[np.float64],
    direction: NDArray[np.float64],
    here: NDArray[np.float64],
    there: NDArray[np.float64],
    tangent: NDArray[np.float64],
) -> bool:
    """Whether the step from here to there passes the start in its direction."""
    chord = there - here
    length = float(np.hypot(*chord))
    part = float((start - here) @ chord) / length**2
    distance = abs(float(chord[0] * (start - here)[1] - chord[1] * (start - here)[0])) / length
    return 0.0 < part <= 1.0 and distance < 0.2 * length and float(tangent @ direction) > _TURN


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chart:
    """The boundaries of the regions of instability in a box.

    Attributes
    ----------
    box : Box
    test : callable
        The function whose zeros they are.
    boundaries : tuple of Boundary
    gaps : tuple of Gap
        Points of the lines searched at which the test function has no value.
    """

    box: Box
    test: Test
    boundaries: tuple[Boundary, ...]
    gaps: tuple[Gap, ...]

    def across(self, y: float, *, samples: int = 200) -> Line:
        """Boundaries and intervals of instability along x at a y, from the test function itself."""
        return scan(lambda x: self.test(x, y), *self.box.x, samples=samples)


def chart(
    test: Test,
    box: Box,
    *,
    lines: tuple[int, int] = (2, 5),
    samples: int = 200,
    step: float = 0.02,
    tolerance: float = 1e-10,
    seeds: Iterable[tuple[float, float]] = (),
) -> Chart:
    """Find and trace the boundaries in a box.

    Parameters
    ----------
    test : callable
        See `linear_test` and `orbit_test`.
    box : Box
    lines : (int, int)
        Lines x = const and y = const, evenly spaced from side to side, on which boundaries are sought: every one that crosses
        at least one of them is found. A line searched costs ``samples`` values of the test function.
    samples : int
        See `scan`.
    step, tolerance : float
        See `trace`.
    seeds : iterable of (float, float)
        Points near further boundaries.

    Raises
    ------
    InputError
        If no line and no seed is given, or one line of a kind, which has no place.
    """
    if 1 in lines or min(lines) < 0 or (lines == (0, 0) and not seeds):
        raise InputError(f"lines is {lines}: none or two and more of each kind, and at least one kind or seed")
    gaps: list[Gap] = []
    candidates: list[tuple[int | None, tuple[float, float]]] = [(None, seed) for seed in seeds]
    for side, count in enumerate(lines):
        for value in np.linspace(*(box.x, box.y)[side], count).tolist():

            def point(other: float, axis: int = side, value: float = value) -> tuple[float, float]:
                return (value, other) if axis == 0 else (other, value)

            line = scan(lambda other: test(*point(other)), *(box.y, box.x)[side], samples=samples)
            candidates += [(side, point(root)) for root in line.roots.tolist()]
            gaps += [Gap(point=point(place), message=message) for place, message in line.gaps]
    found: list[Boundary] = []
    for axis, seed in candidates:
        if axis is not None and any(_on(boundary, axis, seed, box) for boundary in found):
            continue
        try:
            found.append(trace(test, seed, box, step=step, tolerance=tolerance))
        except LinkworkError as error:
            if axis is None:
                raise
            # the sign changes where the function jumps, too
            gaps.append(Gap(point=seed, message=f"no boundary leads through: {error}"))
    return Chart(box=box, test=test, boundaries=tuple(found), gaps=tuple(gaps))


def _on(boundary: Boundary, axis: int, seed: tuple[float, float], box: Box) -> bool:
    """Whether a root of a line has been passed by a boundary, to within the interpolation between its points."""
    others = boundary.crossings(axis, seed[axis], box)
    return len(others) > 0 and float(np.abs(others - seed[1 - axis]).min()) < 1e-5 * box.size[1 - axis]
