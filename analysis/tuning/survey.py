"""What lies in a range of speeds: the response followed anew, and on it resonances, lost stability and greatest outputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from linkwork.errors import LinkworkError

from ..numerics.continuation import ContinuationError
from ..periodic import (
    Branch,
    Crossing,
    Drive,
    Orbits,
    PeriodicOrbit,
    Response,
    SpecialPoint,
    Stability,
    follow_both,
    frequency_response,
    largest_multipliers,
    orbits_of,
    passes,
    scale_of,
)
from .conditions import greatest
from .places import Across, FloatArray, LostError, Place, Spot, margin_of, motion
from .wish import Limit, Wish

#: Greatest step along the response, in scaled arc length, and how far it is followed beside the range, relative to its width.
STEP, BESIDE = 2e-2, 0.4
#: Least values of a test function along a branch, and greatest ones of an output, that are looked at more closely, at most.
_LEAST, _MOST = 3, 4
#: Test function above which no multiplier is near to its circle.
_NEAR = 0.5
#: Distance in speed and in multipliers that counts as none: of the range's ends, and of the unit circle.
AT_THE_END, MARGINAL = 1e-7, 1e-6
#: Speeds of the range at which all motions are sought, and those of the chart.
SOUGHT, _CHARTED = 5, 201


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """A part of a branch on which stability is lost in one way.

    Attributes
    ----------
    kind : Crossing
    low, high : float
        Least and greatest speed of it (rad/s), as far as it was followed.
    first, last : SpecialPoint or None
        At these, where they were met.
    worst : Spot
        Where the test function is least, on the way.
    across : Across
        What picks that place.
    value : float
        The test function there.
    """

    kind: Crossing
    low: float
    high: float
    first: SpecialPoint | None
    last: SpecialPoint | None
    worst: Spot
    across: Across
    value: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Least:
    """Where a test function is least along a branch inside the range, at a fixed speed; see `places.margin_of`."""

    kind: Crossing
    spot: Spot
    value: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Greatest:
    """The greatest value of an output in the range, at a speed (rad/s) and crank angles."""

    limit: Limit
    value: float
    spot: Spot
    angles: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """What lies in the range of a wish with some changes.

    Attributes
    ----------
    wish : Wish
    x : ndarray, shape (k,)
        The changes in their tolerances.
    response : Response
        Of the range and of what is beside it.
    regions : tuple of Region
        That reach into the range.
    peaks : tuple of Spot
        Resonances in it.
    least : tuple of Least
    greatest : tuple of Greatest
        For each limit the greatest ones, and where.
    largest : (float, float)
        The largest Floquet multiplier in the range, and its speed (rad/s).
    """

    wish: Wish
    x: FloatArray
    response: Response
    regions: tuple[Region, ...]
    peaks: tuple[Spot, ...]
    least: tuple[Least, ...]
    greatest: tuple[Greatest, ...]
    largest: tuple[float, float]

    @property
    def folds(self) -> tuple[Region, ...]:
        """Where the response jumps."""
        return tuple(region for region in self.regions if region.kind is Crossing.FOLD)


def survey(wish: Wish, x: FloatArray, more: Sequence[PeriodicOrbit] = ()) -> Survey:
    """Follow the response with some changes and look at what lies in the range.

    Parameters
    ----------
    wish : Wish
    x : ndarray, shape (k,)
        Changes in their tolerances.
    more : sequence of PeriodicOrbit
        Motions on branches of their own, which are followed too.

    Raises
    ------
    OrbitError
        If there is no motion to begin with.
    """
    low, high = wish.speeds
    wide = BESIDE * (high - low)
    ends = max(low - wide, 0.5 * low), high + wide
    parameters, drive = wish.operation(x, low)
    response = frequency_response(parameters, *ends, drive=drive, doublings=0, greatest_step=STEP)
    for orbit in more:
        response = _with(response, orbit, ends)
    branches = [branch for branch in response.branches if branch.turns == 1]
    regions = [region for branch in branches for region in _regions(wish, x, branch)]
    inside = [(branch, np.flatnonzero(_in(wish, branch.parameter))) for branch in branches]
    motions = [[(float(b.parameter[i]), b.orbits[i]) for i in places] for b, places in inside]
    least = tuple(found for branch in branches for found in _least(wish, x, branch)) if wish.judged else ()
    # that at the least test functions is there to the last digit
    brought = [(found.spot.speed, motion(wish, *found.spot, 1)) for found in least]
    largest = max((orbit.largest, speed) for branch in [*motions, brought] for speed, orbit in branch)
    return Survey(
        wish=wish,
        x=x,
        response=response,
        regions=tuple(region for region in regions if reaches(wish, region.low, region.high)),
        peaks=tuple(_peaks(wish, x, response)) if wish.no_resonance else (),
        least=least,
        greatest=tuple(top for limit in wish.limits for top in _greatest(wish, x, limit, motions)),
        largest=largest,
    )


def _in(wish: Wish, speed: Any) -> Any:
    low, high = wish.speeds
    return (speed >= low) & (speed <= high)


def reaches(wish: Wish, low: float, high: float) -> bool:
    """Whether an interval of speeds has more than a point in common with the inside of the range."""
    slack = AT_THE_END * wish.speeds[1]
    return bool(high > wish.speeds[0] + slack and low < wish.speeds[1] - slack)


def _with(response: Response, orbit: PeriodicOrbit, ends: tuple[float, float]) -> Response:
    """The response with the branch of a motion that it does not meet, followed both ways."""
    speed = float(orbit.drive.speed or 0.0)
    if _meets(response, orbit):
        return response
    try:
        branch = follow_both(response.family, orbit, speed, low=ends[0], high=ends[1], greatest=STEP)
    except ContinuationError:
        return response
    branches = (*response.branches, branch)
    return Response(branches=branches, low=response.low, high=response.high, problems=response.problems)


def _meets(response: Response, orbit: PeriodicOrbit) -> bool:
    """Whether a motion is on one of the branches."""
    speed, width = float(orbit.drive.speed or 0.0), response.high - response.low
    return any(passes(branch, speed, orbit.start, width) for branch in response.branches if branch.turns == 1)


# Lost stability


def _tests(branch: Branch, kind: Crossing, radius: float = 1.0) -> FloatArray:
    return np.array([margin_of(orbit.monodromy, kind, radius) for orbit in branch.orbits])


def _kinds(branch: Branch) -> Iterator[Crossing]:
    """The ways in which multipliers can cross: with one multiplier there is no pair."""
    for kind in Crossing:
        if kind is not Crossing.TORUS or len(branch.orbits[0].start) > 1:
            yield kind


def _regions(wish: Wish, x: FloatArray, branch: Branch) -> Iterator[Region]:
    """Where the test functions are negative along a branch."""
    for kind in _kinds(branch):
        tests = _tests(branch, kind)
        special = [s for s in branch.special if s.kind is kind]
        # the ends of the parts without a point where the test changes its sign
        ends = [-1, *(s.after for s in special), len(branch) - 1]
        points: list[SpecialPoint | None] = [None, *special, None]
        for number, (begin, end) in enumerate(pairwise(ends)):
            part = np.arange(begin + 1, end + 1)
            first, last = points[number], points[number + 1]
            if not len(part) or tests[part].min() >= 0.0:
                continue
            speeds = [*branch.parameter[part], *(s.parameter for s in (first, last) if s is not None)]
            place, at_speed = int(part[tests[part].argmin()]), kind is not Crossing.FOLD
            worst, across, value = _lowest(wish, x, branch, kind, place, 1.0, at_speed=at_speed)
            yield Region(
                kind=kind,
                low=min(speeds),
                high=max(speeds),
                first=first,
                last=last,
                worst=worst,
                across=across,
                value=value,
            )


def _lowest(
    wish: Wish, x: FloatArray, branch: Branch, kind: Crossing, i: int, radius: float, *, at_speed: bool
) -> tuple[Spot, Across, float]:
    """The least value of a test function about a point of a branch: at fixed speeds of the range, or across it."""
    orbit, before, after = branch.orbits[i], max(i - 1, 0), min(i + 1, len(branch) - 1)
    spot = Spot(x, orbit.start, float(branch.parameter[i]))
    scale = np.append(scale_of(orbit.parameters, orbit.drive, orbit.start), spot.speed)
    ends = [np.append(branch.orbits[j].start, branch.parameter[j]) / scale for j in (before, after)]
    normal = np.append(np.zeros(len(orbit.start)), 1.0)
    if not at_speed:
        normal = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    low, high = sorted(float(normal @ end) for end in ends)
    if at_speed:
        low, high = max(low, wish.speeds[0] / spot.speed), min(high, wish.speeds[1] / spot.speed)
    normal = normal / scale

    def across(offset: float) -> Across:
        return Across(normal, offset)

    def test(offset: float) -> float:
        place = Place(wish, across(offset), 1, spot)
        return margin_of(place.at(x).orbit.monodromy, kind, radius)

    offset = float(normal @ np.append(spot.y, spot.speed))
    value = margin_of(orbit.monodromy, kind, radius)
    if low < high:
        try:
            best = minimize_scalar(test, bounds=(low, high), method="bounded", options={"xatol": 1e-7 * (high - low)})
            offsets = [(float(best.fun), float(best.x)), (test(low), low), (test(high), high)]
            value, offset = min([*offsets, *([(value, offset)] if low <= offset <= high else [])])
        except LinkworkError:
            pass  # next to the limit of assembly a neighbour may not be found: the point itself stands
    row = across(offset)
    return Place(wish, row, 1, spot).at(x).spot, row, value


def _least(wish: Wish, x: FloatArray, branch: Branch) -> Iterator[Least]:
    """The least values of the test functions along a branch in the range, at fixed speeds."""
    inside = np.flatnonzero(_in(wish, branch.parameter))
    if not len(inside):
        return
    for kind in _kinds(branch):
        tests = _tests(branch, kind, wish.radius)
        if kind is Crossing.FOLD:
            # what lies between two folds is a region of its own
            tests = np.where(_tests(branch, kind) < 0.0, np.inf, tests)
        found = []
        within = np.where(_in(wish, branch.parameter), tests, np.inf)
        for i in inside.tolist():
            around = slice(max(i - 1, 0), i + 2)
            if tests[i] < _NEAR and tests[i] <= within[around].min():
                found.append((float(tests[i]), np.isfinite(tests[around]).all(), i))
        for value, smooth, i in sorted(found)[:_LEAST]:
            spot = Spot(x, branch.orbits[i].start, float(branch.parameter[i]))
            if smooth:
                spot, _, value = _lowest(wish, x, branch, kind, i, wish.radius, at_speed=True)
            yield Least(kind=kind, spot=spot, value=value)


# Resonances and outputs


def _peaks(wish: Wish, x: FloatArray, response: Response) -> Iterator[Spot]:
    """The resonances in the range."""
    for top in response.maxima():
        if reaches(wish, top.parameter, top.parameter):
            yield Spot(x, top.orbit.start, top.parameter)


def _greatest(
    wish: Wish, x: FloatArray, limit: Limit, motions: Sequence[Sequence[tuple[float, PeriodicOrbit]]]
) -> Iterator[Greatest]:
    """The greatest values of an output in the range: of each branch those that are greatest about them, brought to rest."""
    found = []
    for branch in motions:
        values = [greatest(orbit.turn(), limit)[0] for _, orbit in branch]
        for i, value in enumerate(values):
            if value >= max(values[max(i - 1, 0) : i + 2]):
                found.append((value, *branch[i]))
    found.sort(key=lambda entry: -entry[0])
    for _, speed, orbit in found[:_MOST]:
        yield _at_rest(wish, limit, Spot(x, orbit.start, speed))


def _at_rest(wish: Wish, limit: Limit, near: Spot) -> Greatest:
    """The greatest value of an output next to a motion, over the speed."""
    step = 2.0 * STEP * (wish.speeds[1] - wish.speeds[0])
    low, high = max(wish.speeds[0], near.speed - step), min(wish.speeds[1], near.speed + step)
    found: list[Greatest] = []

    def value(speed: float) -> float:
        try:
            there = Place(wish, Across.at_speed(len(near.y), speed), 1, near).at(near.x)
        except LostError:
            return 0.0  # beyond a fold
        size, angles = greatest(there.orbit.turn(), limit)
        found.append(Greatest(limit=limit, value=size, spot=there.spot, angles=angles))
        return -size

    for speed in (near.speed, low, high):
        value(speed)
    minimize_scalar(value, bounds=(low, high), method="bounded", options={"xatol": 1e-7 * near.speed})
    return max(found, key=lambda entry: entry.value)


# Beside the response


def others(found: Survey) -> tuple[tuple[PeriodicOrbit, ...], tuple[float, ...]]:
    """Of all motions at `SOUGHT` speeds of the range those on no branch, and the speeds with two stable ones."""
    wish = found.wish
    new: list[PeriodicOrbit] = []
    several: list[float] = []
    for speed in np.linspace(*wish.speeds, SOUGHT).tolist():
        parameters, drive = wish.operation(found.x, speed)
        there: Orbits = orbits_of(parameters, drive)
        new += [o for o in there.orbits if not _meets(found.response, o)]
        if sum(o.verdict().stability is not Stability.UNSTABLE for o in there.orbits) > 1:
            several.append(speed)
    return tuple(new), tuple(several)


def charted(wish: Wish, x: FloatArray) -> tuple[float, float, int]:
    """The largest multiplier in a row of a chart over the range, infinite where no motion is found, its speed, and how many."""
    speeds = np.linspace(*wish.speeds, _CHARTED)
    rows: list[Any] = []
    drives: list[Drive] = []
    for speed in speeds.tolist():
        parameters, drive = wish.operation(x, speed)
        rows.append(parameters)
        drives.append(drive)
    values = np.nan_to_num(largest_multipliers(rows, drives)[0], nan=np.inf)
    i = int(values.argmax())
    return float(values[i]), float(speeds[i]), len(speeds)
