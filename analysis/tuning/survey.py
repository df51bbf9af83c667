"""Survey a range of speeds: follow the response over the range; find resonances, lost stability and greatest outputs.

The level is the value of the quantity over whose range the response is followed: the crank speed, or another drive quantity
(see `Wish`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from linkwork.errors import LinkworkError

from .. import periodic
from ..numerics.continuation import ContinuationError
from ..periodic import Branch, Crossing, PeriodicOrbit, Response, SpecialPoint, speed_names
from . import conditions
from .conditions import CrossPlane, FloatArray, Spot, TrackedMotion, crossing_margin, known_spot
from .wishes import Limit, Wish

#: Greatest step along the response, relative to the range that is followed, and how far the response is followed beyond each
#: end of the range, relative to its width.
STEP, BESIDE = 2e-2, 0.4
#: How far a branch that the response does not meet is followed beyond each end of the range, relative to its width.
FAR = 4.0
#: Greatest number of minima of a test function along a branch, and greatest number of maxima of an output, that are refined.
_LEAST, _MOST = 3, 4
#: Value of a test function above which no multiplier is near to the circle.
_NEAR = 0.5
#: Distances that are neglected: of a level from an end of the range, relative to its middle, and of a multiplier from the unit
#: circle.
AT_THE_END, MARGINAL = 1e-7, 1e-6
#: Width of a part of the range without a stable motion that is neglected, relative to the range's middle.
NO_GAP = 1e-6
#: Number of levels at which all motions are sought, and number of points of the row of a chart.
SOUGHT, _CHARTED = 5, 201


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """A part of a branch on which stability is lost by one kind of crossing, as far as the branch was followed."""

    kind: Crossing
    low: float  # least and greatest level of the region
    high: float
    first: SpecialPoint | None  # special points at the ends of the region; None at an end that was not reached
    last: SpecialPoint | None
    worst: Spot  # motion with the least value of the test function
    across: CrossPlane  # equation that picks this motion from the branch


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TestMinimum:
    """A minimum of a test function along a branch inside the range."""

    kind: Crossing
    spot: Spot  # the motion at the minimum
    value: float  # value of the test function, see `conditions.crossing_margin`


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputMaximum:
    """A maximum, over the range, of an output that has a limit."""

    limit: Limit
    value: float  # the maximum (SI)
    spot: Spot  # the motion with the maximum
    angles: tuple[float, ...]  # crank angles of the maximum (rad), see `conditions.limited_value`


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """Survey of the range of a wish with the changes x.

    Attributes
    ----------
    wish : Wish
    x : ndarray, shape (k,)
        The changes of the parameters in units of their tolerances.
    response : Response
        Response over the range and beyond its ends.
    regions : tuple of Region
        Regions of lost stability that reach into the range.
    peaks : tuple of Spot
        Resonances in the range or within the margin beside the range.
    least : tuple of TestMinimum
        Minima of the test functions that matter for the wish.
    greatest : tuple of OutputMaximum
        Maxima of each limited output.
    largest : (float, float)
        Modulus of the largest Floquet multiplier in the range, and the level of this multiplier.
    unstable : tuple of (float, float)
        Parts of the range without a stable motion.
    """

    wish: Wish
    x: FloatArray
    response: Response
    regions: tuple[Region, ...]
    peaks: tuple[Spot, ...]
    least: tuple[TestMinimum, ...]
    greatest: tuple[OutputMaximum, ...]
    largest: tuple[float, float]
    unstable: tuple[tuple[float, float], ...]


def survey(wish: Wish, x: FloatArray, more: Sequence[PeriodicOrbit] = ()) -> Survey:
    """Follow the response, and the branches of the motions ``more``, with changes x of the parameters, and survey the range.

    Raises OrbitError if there is no periodic motion from which to start.
    """
    parameters, drive = wish.operation(x, wish.span[0])
    low, high = _ends(wish, BESIDE)
    if wish.no_resonance:
        low, high = min(low, wish.range_with_margin[0]), max(high, wish.range_with_margin[1])
    doublings = wish.turns.bit_length() - 1
    response = periodic.frequency_response(
        parameters, low, high, drive=drive, vary=wish.over, start=wish.start, doublings=doublings, greatest_step=STEP
    )
    for orbit in more:
        response = _add_branch(wish, response, orbit)
    branches = response.branches
    regions = [region for branch in branches for region in _regions(wish, x, branch, response)]
    inside = [(branch, np.flatnonzero(_is_inside(wish, branch.parameter))) for branch in branches]
    motions = [[(float(b.parameter[i]), b.orbits[i]) for i in places] for b, places in inside]
    unstable = tuple(_parts_without_stable_motion(wish, branches))
    least: tuple[TestMinimum, ...] = ()
    if wish.judges_stability or unstable:
        least = tuple(found for branch in branches for found in _test_minima(wish, x, branch))
    if not wish.judges_stability:
        # if the wish allows it, unstable motions may lie beside stable ones
        without = [found for found in least if any(low <= found.spot.level <= high for low, high in unstable)]
        least = tuple(found for found in without if found.value < 0.0)
    # include the motions at the minima of the test functions, which lie between the points of the branches
    brought = [(found.spot.level, conditions.motion(wish, found.spot)) for found in least]
    largest = max((orbit.largest, level) for branch in [*motions, brought] for level, orbit in branch)
    return Survey(
        wish=wish,
        x=x,
        response=response,
        regions=tuple(region for region in regions if reaches(wish, region.low, region.high)),
        peaks=tuple(_peaks(wish, x, response)) if wish.no_resonance else (),
        least=least,
        greatest=tuple(top for limit in wish.limits for top in _output_maxima(wish, x, limit, motions)),
        largest=largest,
        unstable=unstable,
    )


def _parts_without_stable_motion(wish: Wish, branches: Sequence[Branch]) -> Iterator[tuple[float, float]]:
    """Yield the parts of the range that no stable stretch of a branch covers."""
    covered = sorted(stretch for branch in branches for stretch in _stable_stretches(branch))
    low, end = wish.span
    for first, last in [*covered, (end, end)]:
        if reaches(wish, low, min(first, end)) and first - low > NO_GAP * wish.size:
            yield low, min(first, end)
        low = max(low, last)


def _stable_stretches(branch: Branch) -> Iterator[tuple[float, float]]:
    """Yield the least and the greatest level of each stable stretch between neighbouring points of a branch."""
    stable = [orbit.largest <= 1.0 + MARGINAL for orbit in branch.orbits]
    lost = {special.after: special.parameter for special in branch.special}
    for i, ends in enumerate(map(list, pairwise(branch.parameter.tolist()))):
        if stable[i] != stable[i + 1] and i in lost:
            ends[stable[i]] = lost[i]
        elif not (stable[i] and stable[i + 1]):
            continue
        yield min(ends), max(ends)


def _is_inside(wish: Wish, level: Any) -> Any:
    low, high = wish.span
    return (level >= low) & (level <= high)


def _ends(wish: Wish, beside: float) -> tuple[float, float]:
    """Return the range widened at both ends by ``beside`` times its width, without crossing zero."""
    low, high = wish.span
    wide = beside * (high - low)
    first = max(low - wide, 0.5 * low) if low > 0.0 else low - wide
    return first, (min(high + wide, 0.5 * high) if high < 0.0 else high + wide)


def reaches(wish: Wish, low: float, high: float, span: tuple[float, float] | None = None) -> bool:
    """Return whether the interval of levels from ``low`` to ``high`` overlaps the inside of the range, or of ``span``."""
    first, last = span or wish.span
    slack = AT_THE_END * wish.size
    return bool(high > first + slack and low < last - slack)


def _add_branch(wish: Wish, response: Response, orbit: PeriodicOrbit) -> Response:
    """Follow the branch of a motion in both directions and add it to the response, unless the response has the motion."""
    if _meets(wish, response, orbit):
        return response
    level, (low, high) = wish.level(orbit), _ends(wish, FAR)
    try:
        branch = periodic.follow_both(
            response.family.with_ratios(orbit.drive.ratios), orbit, level, low=low, high=high, greatest=STEP
        )
    except ContinuationError:
        return response
    return replace(response, branches=(*response.branches, branch))


def _meets(wish: Wish, response: Response, orbit: PeriodicOrbit) -> bool:
    """Return whether a motion is on a branch of the response."""
    return periodic.has_motion(response.branches, orbit, wish.level(orbit), response.high - response.low)


# Lost stability


def _tests(branch: Branch, kind: Crossing, radius: float = 1.0) -> FloatArray:
    return np.array([crossing_margin(orbit.monodromy, kind, radius) for orbit in branch.orbits])


def _kinds(branch: Branch) -> Iterator[Crossing]:
    """Yield the kinds of loss of stability to look for on a branch.

    A torus is left out if there is only one multiplier, since it needs a complex pair. A branch point is left out because its
    multiplier is +1, as at a fold.
    """
    for kind in Crossing:
        if kind is not Crossing.BRANCH_POINT and (kind is not Crossing.TORUS or len(branch.orbits[0].start) > 1):
            yield kind


def _parts(
    wish: Wish, branch: Branch, kind: Crossing, response: Response
) -> Iterator[tuple[SpecialPoint | None, Any, SpecialPoint | None]]:
    """Divide a branch where the test function of a kind of crossing changes its sign, and yield the parts.

    Each part is (special point at the beginning or None, indices of the points, special point at the end or None).
    """
    special = [s for s in branch.special if s.kind is kind]
    ends = [-1, *(s.after for s in special), len(branch) - 1]
    points: list[SpecialPoint | None] = [None, *special, None]
    if kind is Crossing.FOLD and branch.periods > 1:
        # such a branch begins, and may end, where a motion of half the period has the multiplier -1
        width = response.high - response.low
        points[0], points[-1] = (
            periodic.find_beginning(
                response.branches, Crossing.PERIOD_DOUBLING, branch.orbits[i], wish.level(branch.orbits[i]), width
            )
            for i in (0, -1)
        )
    parts = [np.arange(begin + 1, end + 1) for begin, end in pairwise(ends)]
    if branch.closed and special:
        # the last point of a closed branch is its first
        parts = [*parts[1:-1], np.concatenate([parts[-1], parts[0][1:]])]
        points = [*special, special[0]]
    for number, part in enumerate(parts):
        yield points[number], part, points[number + 1]


def _regions(wish: Wish, x: FloatArray, branch: Branch, response: Response) -> Iterator[Region]:
    """Yield the regions of a branch in which a test function is negative."""
    for kind in _kinds(branch):
        tests = _tests(branch, kind)
        for first, part, last in _parts(wish, branch, kind, response):
            if not len(part) or tests[part].min() >= 0.0:
                continue
            levels = [*branch.parameter[part], *(s.parameter for s in (first, last) if s is not None)]
            place, at_level = int(part[tests[part].argmin()]), kind is not Crossing.FOLD
            worst, across, _ = _find_minimum(wish, x, branch, kind, place, 1.0, at_level=at_level)
            low, high = min(levels), max(levels)
            yield Region(kind=kind, low=low, high=high, first=first, last=last, worst=worst, across=across)


def _find_minimum(
    wish: Wish, x: FloatArray, branch: Branch, kind: Crossing, i: int, radius: float, *, at_level: bool
) -> tuple[Spot, CrossPlane, float]:
    """Find the minimum of a test function near point ``i`` of a branch.

    Motions are picked by levels in the range if ``at_level``, otherwise by planes across the branch. Return the motion, the
    equation that picks it, and the value of the test function.
    """
    orbit, before, after = branch.orbits[i], max(i - 1, 0), min(i + 1, len(branch) - 1)
    spot = known_spot(wish, x, orbit)
    scale = np.append(periodic.motion_scales(orbit.parameters, orbit.drive, orbit.start), wish.size)
    ends = [np.append(branch.orbits[j].start, branch.parameter[j]) / scale for j in (before, after)]
    normal = np.append(np.zeros(len(orbit.start)), 1.0)
    if not at_level:
        normal = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    low, high = sorted(float(normal @ end) for end in ends)
    if at_level:
        low, high = max(low, wish.span[0] / wish.size), min(high, wish.span[1] / wish.size)
    normal = normal / scale

    def test(offset: float) -> float:
        place = TrackedMotion(wish, CrossPlane(normal, offset), spot)
        return crossing_margin(place.find(x).orbit.monodromy, kind, radius)

    offset = float(normal @ np.append(spot.y, spot.level))
    value = crossing_margin(orbit.monodromy, kind, radius)
    if low < high:
        try:
            best = minimize_scalar(test, bounds=(low, high), method="bounded", options={"xatol": 1e-7 * (high - low)})
            offsets = [(float(best.fun), float(best.x)), (test(low), low), (test(high), high)]
            value, offset = min([*offsets, *([(value, offset)] if low <= offset <= high else [])])
        except LinkworkError:
            pass  # next to the limit of assembly a neighbour may not be found: keep the point itself
    row = CrossPlane(normal, offset)
    return TrackedMotion(wish, row, spot).find(x).spot, row, value


def _test_minima(wish: Wish, x: FloatArray, branch: Branch) -> Iterator[TestMinimum]:
    """Yield the minima of the test functions along a branch in the range; their motions are picked by their levels."""
    inside = np.flatnonzero(_is_inside(wish, branch.parameter))
    if not len(inside):
        return
    for kind in _kinds(branch):
        tests = _tests(branch, kind, wish.radius)
        if kind is Crossing.FOLD:
            # the part between two folds is a region: see `_regions`
            tests = np.where(_tests(branch, kind) < 0.0, np.inf, tests)
        found = []
        within = np.where(_is_inside(wish, branch.parameter), tests, np.inf)
        for i in inside.tolist():
            around = slice(max(i - 1, 0), i + 2)
            if tests[i] < _NEAR and tests[i] <= within[around].min():
                found.append((float(tests[i]), np.isfinite(tests[around]).all(), i))
        for value, smooth, i in sorted(found)[:_LEAST]:
            spot = known_spot(wish, x, branch.orbits[i])
            if smooth:
                spot, _, value = _find_minimum(wish, x, branch, kind, i, wish.radius, at_level=True)
            yield TestMinimum(kind=kind, spot=spot, value=value)


# Resonances and outputs


def _peaks(wish: Wish, x: FloatArray, response: Response) -> Iterator[Spot]:
    """Yield the resonances in the range and within the margin beside the range."""
    for top in response.maxima():
        if reaches(wish, top.parameter, top.parameter, wish.range_with_margin):
            yield known_spot(wish, x, top.orbit, top.coordinate)


def _output_maxima(
    wish: Wish, x: FloatArray, limit: Limit, motions: Sequence[Sequence[tuple[float, PeriodicOrbit]]]
) -> Iterator[OutputMaximum]:
    """Yield the local maxima of an output over the levels of the range, refined between the levels of the given motions."""
    found = []
    for branch in motions:
        values = [conditions.limited_value(orbit.resolved_turn(limit.parts), limit)[0] for _, orbit in branch]
        for i, value in enumerate(values):
            if value >= max(values[max(i - 1, 0) : i + 2]):
                found.append((value, branch[i][1]))
    found.sort(key=lambda entry: -entry[0])
    for _, orbit in found[:_MOST]:
        yield _refine_maximum(wish, limit, known_spot(wish, x, orbit))


def _refine_maximum(wish: Wish, limit: Limit, near: Spot) -> OutputMaximum:
    """Find the maximum of an output near a motion as the level varies."""
    step = 2.0 * STEP * (wish.span[1] - wish.span[0])
    low, high = max(wish.span[0], near.level - step), min(wish.span[1], near.level + step)
    found: list[OutputMaximum] = []

    def value(level: float) -> float:
        try:
            there = TrackedMotion.at_level(wish, near, level).find(near.x)
        except conditions.LostError:
            return 0.0  # beyond a fold
        size, angles = conditions.limited_value(there.orbit.resolved_turn(limit.parts), limit)
        found.append(OutputMaximum(limit=limit, value=size, spot=there.spot, angles=angles))
        return -size

    for level in (near.level, low, high):
        value(level)
    minimize_scalar(value, bounds=(low, high), method="bounded", options={"xatol": 1e-7 * wish.size})
    return max(found, key=lambda entry: entry.value)


# Beside the response


def other_motions(found: Survey) -> tuple[tuple[PeriodicOrbit, ...], tuple[float, ...]]:
    """Search for all motions at `SOUGHT` levels; return the motions on no branch, and the levels with two stable motions."""
    wish = found.wish
    new: list[PeriodicOrbit] = []
    several: list[float] = []
    for level in np.linspace(*wish.span, SOUGHT).tolist():
        parameters, drive = wish.operation(found.x, level)
        start = None if wish.over in speed_names(wish.mechanism) else _nearest_motion(wish, found.response, level).start
        stable = 0
        for turns in range(1, wish.turns + 1):
            there: periodic.Orbits = periodic.search_orbits(parameters, drive, turns=turns, start=start)
            # a machine does not come near a motion from which deviations grow faster
            new += [o for o in there.orbits if o.largest < periodic.GREATEST and not _meets(wish, found.response, o)]
            stable += len(there.stable)
        if stable > 1:
            several.append(level)
    return tuple(new), tuple(several)


def _nearest_motion(wish: Wish, response: Response, level: float) -> PeriodicOrbit:
    """Return the motion of one common period that is nearest to a level."""
    known = [orbit for branch in response.branches if branch.periods == 1 for orbit in branch.orbits]
    return min(known, key=lambda orbit: abs(wish.level(orbit) - level))


def chart_range(found: Survey) -> tuple[float, float, int]:
    """Compute the row of a stability chart over the range; return the largest multiplier, its level and the number of points.

    The multiplier is infinite if no motion was found at some point.
    """
    wish = found.wish
    levels = np.linspace(*wish.span, _CHARTED)
    near = _nearest_motion(wish, found.response, wish.span[0])
    rows, driven = zip(*(wish.operation(found.x, level) for level in levels.tolist()))
    drives = [replace(drive, ratios=near.drive.ratios) for drive in driven]
    guess = None if wish.over in speed_names(wish.mechanism) and not near.rounds else near.start
    values = np.nan_to_num(periodic.largest_multipliers(rows, drives, guess)[0], nan=np.inf)
    i = int(values.argmax())
    return float(values[i]), float(levels[i]), len(levels)
