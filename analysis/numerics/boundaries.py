"""Find the boundaries in a chart: the curves in the plane of two parameters on which a smooth test function is zero.

The module knows no mechanics. `scan` finds the roots along a line, also two that lie close together; `trace` follows a
boundary from a point near it; `chart` finds and traces all boundaries that cross one of its lines.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite, isnan
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError

from .continuation import ContinuationError, End, Evaluation, Follower, Reason, Settings

#: Test function of the coordinates of a point of a chart: smooth, and negative in a region of instability.
Test = Callable[[float, float], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """A point at which a test function has no value, and the reason."""

    point: tuple[float, float]
    message: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Line:
    """Roots of a test function along a line.

    Attributes
    ----------
    roots : ndarray, shape (n,)
        Zeros of the test function, increasing.
    gaps : tuple of (float, str)
        Arguments at which the test function has no value, each with the reason.
    """

    roots: NDArray[np.float64]
    gaps: tuple[tuple[float, str], ...]


def scan(
    function: Callable[[float], float], low: float, high: float, *, samples: int = 200, tolerance: float = 1e-12
) -> Line:
    """Find the roots of a function on an interval, also two roots between neighbouring samples.

    Where the samples have an extremum in the direction of zero, the extremum itself is computed: if the function has the other
    sign there, the roots on both sides of the extremum are found. A pair of roots can be missed only if the function has
    several extrema between samples.

    Parameters
    ----------
    function : callable
        Function of one float; where it raises a `LinkworkError` the line has a gap.
    low, high : float
    samples : int
        Number of samples, at least 3.
    tolerance : float
        Tolerance of the roots, relative to the length of the interval.

    Raises
    ------
    InputError
        If the interval or the number of samples is not usable.
    """
    sampled, gaps = _sample_function(function, _samples(low, high, samples))
    roots: list[float] = []
    for (here, value), (there, following) in pairwise(sampled):
        # a function value of zero counts as positive: the same root is not found from both sides
        if not (isnan(value) or isnan(following)) and (value < 0.0) != (following < 0.0):
            try:
                found = (
                    scipy.optimize.brentq(function, here, there, xtol=tolerance * (high - low)) if following else there
                )
                roots.append(float(found))
            except LinkworkError as error:
                gaps.append((there, f"just before: {error}"))
    return Line(roots=np.array(roots), gaps=tuple(gaps))


def _sample_function(
    function: Callable[[float], float], samples: NDArray[np.float64]
) -> tuple[list[tuple[float, float]], list[tuple[float, str]]]:
    """Sample a function, also at extrema of the opposite sign between samples; return (argument, value or NaN), and gaps."""
    values, gaps = np.full(len(samples), np.nan), []
    for i, place in enumerate(samples.tolist()):
        try:
            values[i] = function(place)
        except LinkworkError as error:
            gaps.append((place, str(error)))
    found = list(zip(samples.tolist(), values.tolist()))
    for i in range(len(samples)):
        first, last = max(i - 1, 0), min(i + 1, len(samples) - 1)
        around, sign = values[first : last + 1], np.sign(values[i])
        if np.isfinite(around).all() and (np.sign(around) == sign).all() and first + np.argmin(sign * around) == i:
            try:
                extremum = scipy.optimize.minimize_scalar(
                    lambda x, sign=sign: sign * function(x),
                    bounds=(samples[first], samples[last]),
                    method="bounded",
                    options={"xatol": 1e-9 * (samples[-1] - samples[0])},
                )
            except LinkworkError as error:
                gaps.append((float(samples[i]), f"between the samples: {error}"))
                continue
            if extremum.fun < 0.0:
                found.append((float(extremum.x), float(sign * extremum.fun)))
    return sorted(found, key=lambda pair: pair[0]), gaps


def find_minimum(
    function: Callable[[float], float], low: float, high: float, *, samples: int = 40, tolerance: float = 1e-9
) -> tuple[float, float]:
    """Find the minimum of a smooth function on an interval; return its argument and its value.

    The minimum is refined near the least of ``samples`` values. The error of the argument is ``tolerance`` times the length of
    the interval; the error of the value is of second order.

    Raises
    ------
    InputError
        If the interval or the number of samples is not usable.
    """
    points = _samples(low, high, samples)
    values = [function(x) for x in points.tolist()]
    i = int(np.argmin(values))
    bounds = points[max(i - 1, 0)], points[min(i + 1, samples - 1)]
    found = scipy.optimize.minimize_scalar(
        function, bounds=bounds, method="bounded", options={"xatol": tolerance * (high - low)}
    )
    return (float(found.x), float(found.fun)) if found.fun < values[i] else (float(points[i]), float(values[i]))


def _samples(low: float, high: float, count: int) -> NDArray[np.float64]:
    if not (isfinite(low) and isfinite(high) and low < high) or count < 3:
        raise InputError(
            f"a line from {low} to {high} with {count} samples: it must have a length and at least three samples"
        )
    return np.linspace(low, high, count)


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A rectangle in a chart: the ranges (low, high) of x and of y.

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Boundary:
    """A boundary in a chart; seen along its points, the region of instability is on the left.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        Points (x, y) in the units of the axes; a closed boundary ends with its first point.
    tangents : ndarray, shape (n, 2)
        Unit tangents in coordinates in which the box is 1 by 1.
    residual : float
        Largest distance of a point from the true boundary, estimated from the test function and its slope, in coordinates
        in which the box is 1 by 1.
    ends : (End, End)
        Ends at the first and at the last point.
    """

    points: NDArray[np.float64]
    tangents: NDArray[np.float64]
    residual: float
    ends: tuple[End, End]

    @property
    def closed(self) -> bool:
        """Whether the boundary is a closed loop."""
        return self.ends[0].reason is Reason.CLOSED

    def crossings(self, axis: int, value: float, box: Box) -> NDArray[np.float64]:
        """Interpolate the values of y where the boundary crosses x = value (axis 0), or of x where y = value (axis 1)."""
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

            # an end may be a zero, which brentq accepts
            u = scipy.optimize.brentq(lambda u: curve(u)[axis] - level, 0.0, 1.0)
            found.append(curve(u)[1 - axis] * box.size[1 - axis] + box.corner[1 - axis])
        return np.array(found)


#: Step (of the box scaled to 1 by 1) for differences of the test function.
_DIFFERENCE = 1e-4
#: Shortest step of a trace in sharp turns.
_SHORTEST = 1e-6
#: Largest turn of the tangent in a step (rad), and the turn up to which the step grows.
_TURN, _STRAIGHT = 0.35, 0.1


@dataclass(frozen=True, slots=True)
class _Zero:
    """The equation of a boundary, test(x, y) = 0, for a `Follower`: x is the unknown, y the parameter."""

    test: Test
    box: Box

    def residual(self, x: NDArray[np.float64], y: float) -> NDArray[np.float64]:
        """Return the test function times the width of the box, shape (1,)."""
        place = float(x[0]), y
        value = self.test(*place)
        if not isfinite(value):
            raise InputError(f"the test function is {value} at ({place[0]:.9g}, {place[1]:.9g}): it must be finite")
        return np.array([value * self.box.size[0]])

    def evaluate(self, x: NDArray[np.float64], y: float) -> Evaluation:
        """Return the residual and its derivatives by second-order differences; ``data`` is the distance from the boundary."""
        place, low, high = np.array([x[0], y]), self.box.corner, self.box.corner + self.box.size
        here, slope = float(self.residual(x, y)[0]), np.empty(2)
        for axis, size in enumerate(self.box.size):
            step = np.zeros(2)
            step[axis] = _DIFFERENCE * size

            def ahead(steps: float, step: NDArray[np.float64] = step) -> float:
                there = np.clip(place + steps * step, low, high)
                return float(self.residual(there[:1], float(there[1]))[0])

            if place[axis] - step[axis] < low[axis]:
                change = 4.0 * ahead(1.0) - ahead(2.0) - 3.0 * here
            elif place[axis] + step[axis] > high[axis]:
                change = 3.0 * here - 4.0 * ahead(-1.0) + ahead(-2.0)
            else:
                change = ahead(1.0) - ahead(-1.0)
            slope[axis] = change / (2.0 * step[axis])
        steepest = float(np.hypot(*(slope * self.box.size)))
        return Evaluation(np.array([here]), slope[:1, None], slope[1:], abs(here) / steepest if steepest else 0.0)


def trace(test: Test, seed: tuple[float, float], box: Box, *, step: float = 0.02, most: int = 5000) -> Boundary:
    """Follow the boundary through a point in both directions; see `analysis.numerics.continuation`.

    A step is halved if the tangent turns by more than 20 degrees, or if the step jumps to the opposite boundary of a narrow
    region.

    Parameters
    ----------
    test : callable
        Smooth function of (x, y), negative on one side of the boundary.
    seed : (float, float)
        A point near the boundary.
    box : Box
    step : float
        Longest step, with the box scaled to 1 by 1.
    most : int
        Largest number of points in each direction.

    Raises
    ------
    InputError
        If there is no boundary near the seed.
    LinkworkError
        If the test function has no value at the seed.
    """
    place = np.array(seed, dtype=float)
    sides = [axis for axis in (0, 1) if seed[axis] in (box.x, box.y)[axis]]
    if ((place < box.corner) | (place > box.corner + box.size)).any():
        raise InputError(f"the seed {seed} lies outside the box")
    zero = _Zero(test, box)
    settings = Settings(
        low=box.y[0],
        high=box.y[1],
        bounds={0: box.x},
        first=step,
        least=min(_SHORTEST, step),
        greatest=step,
        most_points=most,
        greatest_turn=_TURN,
        growing_turn=_STRAIGHT,
        oriented=True,
    )
    follower = Follower(zero.evaluate, box.size[:1], settings, zero.residual)
    evaluation = zero.evaluate(place[:1], place[1])
    # along a side of the box if the seed lies on one, else along the normal
    across = np.array([-evaluation.slope[0] * box.size[1], evaluation.jacobian[0, 0] * box.size[0]])
    if len(sides) == 1:
        across = np.eye(2)[sides[0]]
    try:
        start = follower.start(place[:1], float(place[1]), 1, across / (float(np.hypot(*across)) or 1.0))
    except ContinuationError as error:
        raise InputError(
            f"no boundary is within {step:g}, in units of the box's sides, of the seed {seed}: {error}"
        ) from None
    found = np.array([start.y[0], start.parameter])
    if len(sides) == 1:
        found[sides[0]] = place[sides[0]]
        start = replace(start, y=found[:1], parameter=float(found[1]))
    if (np.abs(found - place) > step * box.size).any() or follower.is_beyond(start):
        raise InputError(f"no boundary is within {step:g}, in units of the box's sides, of the seed {seed}")
    if start.orientation < 0.0:
        start = start.with_opposite_tangent()
    way, *curves = follower.follow_both(start)
    return Boundary(
        points=np.array([[point.y[0], point.parameter] for point in way]),
        tangents=np.array([point.tangent for point in way]),
        residual=max(point.data for point in way),
        ends=(curves[0].plane_end(curves[0].message), curves[1].plane_end(curves[1].message)),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chart:
    """The boundaries of the regions of instability in a box.

    Attributes
    ----------
    box : Box
    test : callable
        Test function, which is zero on the boundaries.
    boundaries : tuple of Boundary
    gaps : tuple of Gap
        Points of the searched lines at which the test function has no value or jumps.
    """

    box: Box
    test: Test
    boundaries: tuple[Boundary, ...]
    gaps: tuple[Gap, ...]

    def scan_line(self, y: float, *, samples: int = 200) -> Line:
        """Scan the line of constant ``y`` for its crossings with boundaries."""
        return scan(lambda x: self.test(x, y), *self.box.x, samples=samples)


def chart(test: Test, box: Box, *, lines: tuple[int, int] = (2, 5), samples: int = 200, step: float = 0.02) -> Chart:
    """Find and trace the boundaries in a box.

    Parameters
    ----------
    test : callable
        Test function, negative in a region of instability.
    box : Box
    lines : (int, int)
        Numbers of lines x = const and y = const that are searched, evenly spaced over the box, its sides included. Every
        boundary that crosses one of these lines is found. A line costs ``samples`` values of the test function.
    samples : int
        See `scan`.
    step : float
        See `trace`.

    Raises
    ------
    InputError
        If both numbers of lines are zero, or one is 1: the position of a single line would be arbitrary.
    """
    if 1 in lines or min(lines) < 0 or lines == (0, 0):
        raise InputError(f"lines is {lines}: each number must be 0 or at least 2, and one of them above 0")
    gaps: list[Gap] = []
    candidates: list[tuple[int, tuple[float, float]]] = []
    for side, count in enumerate(lines):
        for value in np.linspace(*(box.x, box.y)[side], count).tolist():

            def point(other: float, axis: int = side, value: float = value) -> tuple[float, float]:
                return (value, other) if axis == 0 else (other, value)

            line = scan(lambda other: test(*point(other)), *(box.y, box.x)[side], samples=samples)
            candidates += [(side, point(root)) for root in line.roots.tolist()]
            gaps += [Gap(point=point(place), message=message) for place, message in line.gaps]
    found: list[Boundary] = []
    for axis, seed in candidates:
        if any(_contains_root(boundary, axis, seed, box) for boundary in found):
            continue
        try:
            found.append(trace(test, seed, box, step=step))
        except LinkworkError as error:
            # the sign also changes where the function jumps
            gaps.append(Gap(point=seed, message=f"no boundary leads through: {error}"))
    return Chart(box=box, test=test, boundaries=tuple(found), gaps=tuple(gaps))


def _contains_root(boundary: Boundary, axis: int, seed: tuple[float, float], box: Box) -> bool:
    """Return whether a boundary passes through a root found on a line, to within the error of interpolation."""
    others = boundary.crossings(axis, seed[axis], box)
    return len(others) > 0 and float(np.abs(others - seed[1 - axis]).min()) < 1e-5 * box.size[1 - axis]
