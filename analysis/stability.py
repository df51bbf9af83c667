"""Stability of the periodic motion: charts with traced boundaries, damping that removes a region, grids, long runs.

A chart is a plane of any two parameters, the crank speed among them (`plane`). A test function of its points is negative in
a region of instability and zero on its boundary, where a Floquet multiplier is +1 or -1: of the linear equation about u = 0
(`linear_test`), as the thesis has it, or of the mechanism's own periodic orbit (`orbit_test`), which is right. `trace`
follows a boundary, `chart` finds and follows all that cross its lines, `removing_damping` finds where a region ends, `grid`
computes the largest multiplier of every point of a grid, and `confirm` puts a verdict to the test of a long nonlinear run.
"""

from __future__ import annotations

import hashlib
import inspect
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import exp, isfinite, pi
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, minimize_scalar

from linkwork.errors import InputError, LinkworkError, UnknownNameError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState, field_name, fmi_name

from . import floquet, orbit_kernels, orbits
from .compiled import cache_folder
from .floquet import TOLERANCE, Stability, StabilityVerdict, multipliers, verdict
from .hill import PeriodicEquation, crossing_test, monodromy
from .inputs import Inputs
from .orbits import Drive, PeriodicOrbit, find_orbit
from .simulate import interruptible, shown, simulate
from .slider_equation import Variant, slider_equation

#: Names under which the crank speed (rad/s) is an axis.
SPEED_NAMES = ("speed", "drive.speed")

#: A mechanism and its crank speed (rad/s).
Operation = tuple[FiveBarParameters, float]
#: The operation at a point of a chart.
Plane = Callable[[float, float], Operation]
#: A smooth function of a point of a chart, negative in a region of instability.
Test = Callable[[float, float], float]


# Planes and test functions


def plane(parameters: FiveBarParameters, speed: float, x: str, y: str) -> Plane:
    """The plane of two parameters, all else as given.

    Parameters
    ----------
    parameters : FiveBarParameters
    speed : float
        Crank speed (rad/s).
    x, y : str
        Parameters by their names in the FMI contract or as fields, or ``"speed"``; in SI.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If both axes are the same.
    """
    fields = [_axis(name) for name in (x, y)]
    if fields[0] == fields[1]:
        raise InputError(f"both axes are {x!r}: a chart needs two parameters")

    def operation(first: float, second: float) -> Operation:
        values: dict[str, Any] = dict(zip(fields, (first, second)))
        own_speed = float(values.pop("speed", speed))
        return replace(parameters, **values), own_speed

    return operation


def _axis(name: str) -> str:
    if name in SPEED_NAMES:
        return "speed"
    field = field_name(name) if "." in name else name
    known = tuple(k for k in FiveBarParameters.__dataclass_fields__ if k != "assembly_branch")
    if field not in known:
        raise UnknownNameError(name, ("speed", *map(fmi_name, known)), None)
    return field


def linear_equation(parameters: FiveBarParameters, speed: float, variant: Variant = Variant.EXACT) -> PeriodicEquation:
    """The slider's equation about u = 0, which is the motion only where nothing drives it: the thesis's."""
    a, b, c = slider_equation(parameters, speed, variant=variant).coefficients()
    return PeriodicEquation(a=a, b=b, c=c)


def linear_verdict(
    parameters: FiveBarParameters, speed: float, *, variant: Variant = Variant.EXACT, tolerance: float = TOLERANCE
) -> StabilityVerdict:
    """The verdict on u = 0 by the linear equation; that on the true motion is `PeriodicOrbit.verdict`."""
    return verdict(multipliers(monodromy(linear_equation(parameters, speed, variant))), tolerance)


def linear_test(operation: Plane, multiplier: int, *, variant: Variant = Variant.EXACT) -> Test:
    """det(Phi - multiplier I) of the linear equation about u = 0; ``multiplier`` is +1 or -1."""

    def test(x: float, y: float) -> float:
        return float(crossing_test(monodromy(linear_equation(*operation(x, y), variant)), multiplier))

    return test


def orbit_test(operation: Plane, multiplier: int, *, start: ArrayLike | None = None) -> Test:
    """det(Phi - multiplier I) of the mechanism's own periodic orbit of one turn; ``multiplier`` is +1 or -1.

    Each orbit is sought from the one found last, so that neighbouring points stay on one branch.

    Parameters
    ----------
    start : array_like, shape (2,), optional
        Guess of the first: see `find_orbit`.
    """
    last = None if start is None else np.array(start, dtype=float)

    def test(x: float, y: float) -> float:
        nonlocal last
        parameters, speed = operation(x, y)
        orbit = find_orbit(parameters, speed=speed, start=last)
        last = orbit.start
        return float(crossing_test(orbit.monodromy, multiplier))

    return test


# Along a line


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
    if not (isfinite(low) and isfinite(high) and low < high) or samples < 3:
        raise InputError(f"a line from {low} to {high} with {samples} samples: it needs a length and three samples")
    points = np.linspace(low, high, samples)
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
            found = minimize_scalar(
                lambda x, sign=sign: sign * function(x),
                bounds=(points[first], points[last]),
                method="bounded",
                options={"xatol": 1e-9 * (high - low)},
            )
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
        root = here if right == 0.0 else float(brentq(function, points[i - 1], here, xtol=tolerance * (high - low)))
        roots.append(root)
        if right < 0.0:
            begun = root
        elif begun is not None:
            intervals.append((begun, root))
            begun = None
    if begun is not None:
        intervals.append((begun, float(points[-1])))
    return Line(roots=np.array(roots), intervals=tuple(intervals), gaps=tuple(gaps))


# Boundaries


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
        found.append(trace(test, seed, box, step=step, tolerance=tolerance))
    return Chart(box=box, test=test, boundaries=tuple(found), gaps=tuple(gaps))


def _on(boundary: Boundary, axis: int, seed: tuple[float, float], box: Box) -> bool:
    """Whether a root of a line has been passed by a boundary, to within the interpolation between its points."""
    others = boundary.crossings(axis, seed[axis], box)
    return len(others) > 0 and float(np.abs(others - seed[1 - axis]).min()) < 1e-5 * box.size[1 - axis]


# Removing damping


class RemovalError(LinkworkError):
    """The damping asked for does not lie in the range given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RemovingDamping:
    """The damping at which a region vanishes, and the point at which it does last.

    Attributes
    ----------
    damping : float
        In the unit of the range given.
    x : float
        The other parameter at the tip of the region.
    residual : float
        The test function there.
    """

    damping: float
    x: float
    residual: float


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
    if not (isfinite(low) and isfinite(high) and low < high) or samples < 3:
        raise InputError(f"a line from {low} to {high} with {samples} samples: it needs a length and three samples")
    points = np.linspace(low, high, samples)
    values = [function(x) for x in points.tolist()]
    i = int(np.argmin(values))
    bounds = points[max(i - 1, 0)], points[min(i + 1, samples - 1)]
    found = minimize_scalar(function, bounds=bounds, method="bounded", options={"xatol": tolerance * (high - low)})
    return (float(found.x), float(found.fun)) if found.fun < values[i] else (float(points[i]), float(values[i]))


def removing_damping(
    test: Callable[[float, float], float],
    x: tuple[float, float],
    damping: tuple[float, float],
    *,
    samples: int = 40,
    tolerance: float = 1e-8,
) -> RemovingDamping:
    """Damping at which a region of instability vanishes: where the least value of its test function is zero.

    Parameters
    ----------
    test : callable
        Test function of (x, damping).
    x : (float, float)
        Range of the other parameter, with this region and no other in it.
    damping : (float, float)
        Range in which the region vanishes: it is there at the lower end and not at the upper one.
    samples : int
        Of x, from which the least value is sought.
    tolerance : float
        Of the damping, relative to its upper end.

    Raises
    ------
    RemovalError
        If the region is not there at the lower end, or still there at the upper one.
    LinkworkError
        As the test function.
    """

    def least(d: float) -> float:
        return lowest(lambda s: test(s, d), *x, samples=samples)[1]

    low, high = (least(d) for d in damping)
    if not low < 0.0:
        raise RemovalError(f"there is no region between {x[0]:g} and {x[1]:g} at the damping {damping[0]:g}")
    if not high > 0.0:
        raise RemovalError(f"the region between {x[0]:g} and {x[1]:g} is still there at the damping {damping[1]:g}")
    found = float(brentq(least, *damping, xtol=0.1 * tolerance * damping[1], rtol=1e-14))
    place, value = lowest(lambda s: test(s, found), *x, samples=samples)
    return RemovingDamping(damping=found, x=place, residual=value)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstDamping:
    """The greatest of the removing dampings over a further parameter: it removes the region everywhere.

    Attributes
    ----------
    damping, x, other : float
        The damping, and the point at which the region vanishes last.
    """

    damping: float
    x: float
    other: float


def removing_damping_over(
    test: Callable[[float, float, float], float],
    x: Callable[[float], tuple[float, float]],
    damping: tuple[float, float],
    other: tuple[float, float],
    *,
    samples: int = 5,
    tolerance: float = 1e-8,
) -> WorstDamping:
    """Damping that removes a region for every value of a further parameter.

    Parameters
    ----------
    test : callable
        Test function of (x, damping, other).
    x : callable
        Range of x at a value of the other parameter; see `removing_damping`.
    damping : (float, float)
    other : (float, float)
        Range of the further parameter.
    samples : int
        Of it, from which the worst is sought.
    tolerance : float
        See `removing_damping`.
    """

    def removing(value: float) -> RemovingDamping:
        return removing_damping(lambda s, d: test(s, d, value), x(value), damping, tolerance=tolerance)

    worst, _ = lowest(lambda value: -removing(value).damping, *other, samples=samples, tolerance=1e-4)
    found = removing(worst)
    return WorstDamping(damping=found.damping, x=found.x, other=worst)


# Grids


class GridInterrupted(LinkworkError):
    """A grid was interrupted; the rows that were done are kept and the same call goes on from there.

    Attributes
    ----------
    done, rows : int
    """

    def __init__(self, done: int, rows: int, folder: Path) -> None:
        self.done = done
        self.rows = rows
        super().__init__(
            f"interrupted with {done} of {rows} rows done, which are kept in {folder}: call again to go on"
        )


#: Why a point of a grid has no orbit, by the status of `orbits.largest_multipliers`.
REASONS = {
    orbit_kernels.LIMIT: "the links come to the limit of assembly",
    orbit_kernels.NO_STEP: "the integrator cannot meet its tolerance",
    orbit_kernels.STALLED: "the crank comes to rest",
    orbit_kernels.DIVERGED: "Newton's method does not converge",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """The largest multiplier of the true orbit over a grid.

    Attributes
    ----------
    x, y : ndarray, shapes (nx,) and (ny,)
    largest : masked array, shape (ny, nx)
        Largest modulus of the Floquet multipliers; masked where no orbit was found.
    starts : ndarray, shape (ny, nx, 2)
        u (m) and u' (m/s) of the orbits at crank angle 0; NaN where ``largest`` is masked.
    status : ndarray of int, shape (ny, nx)
        0, or why there is no orbit: a key of `REASONS`.
    computed : int
        Rows that were not in the cache.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    largest: np.ma.MaskedArray[Any, np.dtype[np.float64]]
    starts: NDArray[np.float64]
    status: NDArray[np.int64]
    computed: int

    def reason(self, row: int, column: int) -> str:
        """Why a point has no orbit; empty if it has one."""
        return REASONS.get(int(self.status[row, column]), "")

    def stability(self, tolerance: float = TOLERANCE) -> NDArray[Any]:
        """`Stability` of each point, None where no orbit was found; an array of objects of shape (ny, nx)."""
        margin = 1.0 - self.largest.filled(np.nan)
        result = np.full(margin.shape, Stability.MARGINAL, dtype=object)
        result[margin > tolerance] = Stability.STABLE
        result[margin < -tolerance] = Stability.UNSTABLE
        result[np.isnan(margin)] = None
        return result


def grid_folder() -> Path:
    """Folder of the rows of grids that have been computed, beside that of the compiled code."""
    return cache_folder().parent / "grids"


def _sources() -> bytes:
    """What the rows depend on beside their arguments: the plant's sources, by the cache's name, and those used here."""
    digest = hashlib.sha256(cache_folder().name.encode())
    for module in (orbit_kernels, orbits, floquet):
        digest.update(inspect.getsource(module).encode())
    return digest.digest()


def grid(
    operation: Plane,
    x: ArrayLike,
    y: ArrayLike,
    *,
    start: ArrayLike | None = None,
    tolerance: float = orbits.INTEGRATOR_TOLERANCE,
    folder: str | Path | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> Grid:
    """The largest Floquet multiplier of the true orbit at every point of a grid.

    Each row is a task of joblib and, once done, a file in the cache, under a name that tells all it depends on: mechanisms,
    speeds, guess, tolerance and sources. An interrupted grid goes on from the rows that are there.

    Parameters
    ----------
    operation : callable
        See `plane`.
    x, y : array_like, shapes (nx,) and (ny,)
        Values of the axes.
    start : array_like, shape (2,), optional
        Guess of the first orbit of each row.
    tolerance : float
        Bound of the integrator's local error.
    folder : path, optional
        Of the cache; `grid_folder` by default.
    n_jobs : int, optional
        Cores, as `joblib.Parallel`.
    progress : bool
        Show a progress bar.

    Raises
    ------
    InputError
        If an axis is empty or not finite.
    ParameterError
        If a point is no mechanism.
    GridInterrupted
        On Ctrl-C.
    """
    xs, ys = (np.array(axis, dtype=float, ndmin=1) for axis in (x, y))
    for name, axis in (("x", xs), ("y", ys)):
        if axis.ndim != 1 or len(axis) == 0 or not np.isfinite(axis).all():
            raise InputError(f"the axis {name} of a grid must be finite numbers, at least one")
    guess = np.zeros(2) if start is None else np.array(start, dtype=float)
    where = grid_folder() if folder is None else Path(folder)
    where.mkdir(parents=True, exist_ok=True)
    sources = _sources()
    paths, missing = [], []
    for value in ys.tolist():
        row = [operation(first, value) for first in xs.tolist()]
        digest = hashlib.sha256(sources)
        digest.update(np.array([(*p.constants(), speed) for p, speed in row]).tobytes())
        digest.update(np.array([*guess, tolerance]).tobytes())
        path = where / f"{digest.hexdigest()[:32]}.npy"
        paths.append(path)
        if _read(path, len(xs)) is None:
            missing.append((path, row))
    done = len(paths) - len(missing)
    with interruptible() as interrupted, shown(progress, float(len(paths)), "stability") as show:
        show(float(done))
        tasks = (joblib.delayed(_compute_row)(path, row, guess, tolerance) for path, row in missing)
        try:
            for _ in joblib.Parallel(n_jobs=n_jobs, return_as="generator_unordered")(tasks):
                done += 1
                show(float(done))
                if interrupted:
                    break
        except KeyboardInterrupt:  # of a worker, or of one who raises it himself
            interrupted.append(True)
        if interrupted and done < len(paths):
            raise GridInterrupted(done, len(paths), where)
    rows = [_read(path, len(xs)) for path in paths]
    if any(row is None for row in rows):
        raise LinkworkError(f"a row of the grid cannot be read back from {where}")
    data = np.array(rows, dtype=float)
    status = data[..., 3].astype(np.int64)
    return Grid(
        x=xs,
        y=ys,
        largest=np.ma.MaskedArray(data[..., 0], mask=status != orbit_kernels.DONE),
        starts=data[..., 1:3],
        status=status,
        computed=len(missing),
    )


def _compute_row(path: Path, row: Sequence[Operation], guess: NDArray[np.float64], tolerance: float) -> None:
    """Compute a row and write its file, which is there as a whole or not at all."""
    mechanisms, drives = [p for p, _ in row], [Drive(speed=speed) for _, speed in row]
    values, starts, status = orbits.largest_multipliers(mechanisms, drives, guess, tolerance=tolerance)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    with part.open("wb") as file:
        np.save(file, np.column_stack([values, starts, status]))
    os.replace(part, path)


def _read(path: Path, count: int) -> NDArray[np.float64] | None:
    """A row from its file, columns multiplier, u, u' and status, shape (count, 4); None if it is not there or not whole."""
    try:
        with path.open("rb") as file:
            row: NDArray[np.float64] = np.load(file)
    except (OSError, ValueError, EOFError):
        return None
    return row if row.shape == (count, 4) else None


# Long runs


class Outcome(Enum):
    """What a deviation did in a long run."""

    DECAYS = "decays"
    BOUNDED = "stays bounded"
    GROWS = "grows"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Confirmation:
    """A verdict beside a long run of the nonlinear mechanism from close to its periodic orbit.

    Attributes
    ----------
    verdict : StabilityVerdict
        By the multipliers of the orbit.
    outcome : Outcome
    growth : float
        Factor a turn of the deviation along the leading multiplier's direction, by regression over the turns up to the first
        at which it is lost in noise or greater than a hundredth of the crank.
    deviations : ndarray, shape (n,)
        Distance from the orbit at the crank angle 0 of each turn, relative to that at the start. It ends before the others
        if the run does.
    message : str
        Why the run ended early; empty if it did not.
    """

    verdict: StabilityVerdict
    outcome: Outcome
    growth: float
    deviations: NDArray[np.float64]
    message: str

    @property
    def agrees(self) -> bool:
        """Whether the run does what the verdict says; a marginal motion must neither decay nor grow."""
        expected = {
            Stability.STABLE: Outcome.DECAYS,
            Stability.UNSTABLE: Outcome.GROWS,
            Stability.MARGINAL: Outcome.BOUNDED,
        }
        return self.outcome is expected[self.verdict.stability]


#: Start of a long run: distance from the orbit relative to the crank's length, and the range over which growth is measured.
DISTURBANCE, NOISE, LINEAR = 1e-5, 1e-8, 1e-2
#: Growth or decay over a run, of the envelope, from which it counts.
NOTABLE = 3.0


def confirm(
    parameters: FiveBarParameters,
    speed: float,
    *,
    turns: int = 1000,
    start: ArrayLike | None = None,
    disturbance: float = DISTURBANCE,
    tolerance: float = TOLERANCE,
) -> Confirmation:
    """Run the nonlinear mechanism for many turns from a slightly disturbed periodic orbit.

    Parameters
    ----------
    parameters : FiveBarParameters
    speed : float
        Crank speed (rad/s).
    turns : int
        At least 20.
    start : array_like, shape (2,), optional
        Guess of the orbit.
    disturbance : float
        Distance from the orbit at the start relative to the crank's length, in the direction that grows most.
    tolerance : float
        Of the verdict.

    Raises
    ------
    OrbitError
        If there is no periodic orbit.
    InputError
        If the number of turns or the disturbance is not usable.
    LinkworkError
        If the deviation grows or dies too fast to be measured.
    """
    if turns < 20 or not NOISE < disturbance < LINEAR:
        raise InputError(
            f"{turns} turns from a disturbance of {disturbance}: 20 and more, and between {NOISE:g} and {LINEAR:g}"
        )
    orbit = find_orbit(parameters, speed=speed, start=start)
    scale = parameters.crank_length * np.array([1.0, speed])
    direction, measure = _leading(orbit, scale)
    u, v = orbit.start + disturbance * scale * direction
    run = simulate(
        parameters,
        Inputs(speed=speed),
        initial=InitialState(slider_position=float(u), slider_velocity=float(v)),
        samples=2.0 * pi / speed * np.arange(turns + 1),
        stop_time=2.0 * pi * turns / speed,
        tolerance=1e-12,
    )
    away = (np.column_stack([run["slider.position"], run["slider.velocity"]]) - orbit.start) / scale
    size = np.hypot(*away.T)
    outside = np.flatnonzero((size > LINEAR) | (size < NOISE))
    used = np.abs(away @ measure)[: outside[0] if len(outside) else None]
    growth = _growth(used)
    told = growth ** len(used)
    if told > NOTABLE or size.max() > NOTABLE * LINEAR:
        outcome = Outcome.GROWS
    else:
        outcome = Outcome.DECAYS if told < 1.0 / NOTABLE else Outcome.BOUNDED
    return Confirmation(
        verdict=orbit.verdict(tolerance),
        outcome=outcome,
        growth=growth,
        deviations=size / size[0],
        message=run.message,
    )


def _leading(orbit: PeriodicOrbit, scale: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Direction that grows most, of unit length, and what its growth is measured with, both in scaled components.

    The product with the left eigenvector of the largest multiplier takes that factor each turn, of a complex pair too, where
    the distance itself swings.
    """
    scaled = orbit.monodromy * scale / scale[:, None]
    values, left, right = scipy.linalg.eig(scaled, left=True)
    leading = int(np.argmax(np.abs(values)))
    direction = right[:, leading].real
    return direction / np.hypot(*direction), left[:, leading].conj()


def _growth(size: NDArray[np.float64]) -> float:
    """Factor a turn, by regression of the logarithms."""
    if len(size) < 2:
        raise LinkworkError("the deviation leaves the range of linear growth within a turn: take a smaller disturbance")
    return exp(float(np.polyfit(np.arange(len(size)), np.log(size), 1)[0]))
