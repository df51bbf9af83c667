"""Find the least change of parameters that keeps a range of speeds free of resonance and instability, with IPOPT."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import product
from math import isfinite
from typing import Any

import numpy as np

from linkwork.errors import LinkworkError

from ..numerics import symbolic
from ..periodic import Crossing, SpecialPoint, describe_end
from ..run import require_kind, show_progress
from .conditions import (
    Condition,
    FloatArray,
    LostError,
    MultipliersInside,
    OutputBelow,
    PeakBeyond,
    Spot,
    StabilityLoss,
    StabilityLossBeyond,
    TrackedMotion,
    known_spot,
)
from .result import JUMP, RESONANCE, STABLE, Tuned, Verification, readings, requirements
from .survey import MARGINAL, SOUGHT, Region, Survey, chart_range, other_motions, survey
from .wishes import Wish

#: IPOPT's tolerance, greatest number of iterations, and greatest violation of the conditions that is accepted.
_TOLERANCE, _ITERATIONS, VIOLATION = 1e-9, 60, 1e-8
#: Number of points at which a motion was lost, after which a nonlinear program is given up.
_PATIENCE = 4
#: Weight of the squares of the other changes if one parameter is minimised, and of all changes if violations are minimised: a
#: parameter without effect keeps its value.
_REST = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """Solution of a nonlinear program."""

    x: FloatArray  # changes of the parameters in units of their tolerances, shape (k,)
    objective: float
    violations: dict[str, float]  # greatest violation among the conditions of each requirement, by its name

    @property
    def met(self) -> bool:
        """Whether all conditions are satisfied."""
        return self.total <= VIOLATION

    @property
    def total(self) -> float:
        """Sum of the violations of all requirements."""
        return sum(self.violations.values())


def objective(wish: Wish, x: Any) -> Any:
    """Return the objective for changes x, numbers or symbols: the sum of their squares, or the change of one parameter."""
    squares = symbolic.library().sumsqr(x)
    if not wish.least:
        return squares
    k = wish.names.index(wish.least)
    return x[k] + _REST * (squares - x[k] ** 2)


def find_least_change(wish: Wish, conditions: Sequence[Condition], x: FloatArray) -> Answer:
    """Find the least change that satisfies the conditions; if no change does, find the change with the least sum of violations.

    ``x`` is the change from which IPOPT starts.
    """
    answer = _solve(wish, conditions, x, elastic=False)
    if not answer.met and isfinite(answer.total):
        softer = _solve(wish, conditions, x, elastic=True)
        if softer.met:
            answer = _solve(wish, conditions, softer.x, elastic=False)
        if not answer.met and softer.total < answer.total:
            answer = softer
    return answer


def _solve(wish: Wish, conditions: Sequence[Condition], x: FloatArray, *, elastic: bool) -> Answer:
    casadi = symbolic.library()
    count, groups = len(x), list(dict.fromkeys(condition.group for condition in conditions))
    low, high = wish.scale_changes(wish.low), wish.scale_changes(wish.high)
    z = casadi.MX.sym("z", count + len(groups) * elastic)
    f, lows, highs, start = objective(wish, z[:count]), low, high, np.clip(x, low, high)
    values = _Values(conditions)
    held = values.function(count)
    g = held(z[:count])
    if elastic:
        share = np.zeros((len(conditions), len(groups)))
        for row, condition in enumerate(conditions):
            share[row, groups.index(condition.group)] = 1.0
        over = z[count:]
        f, g = casadi.sum1(over) + _REST * casadi.sumsqr(z[:count]), g + casadi.DM(share) @ over
        first = np.array([max(-v for v, c in zip(values(start)[0], conditions) if c.group == name) for name in groups])
        lows, highs = np.append(low, np.zeros(len(groups))), np.append(high, np.full(len(groups), np.inf))
        start = np.append(start, np.maximum(first, 0.0) + 1e-3)
    solver = symbolic.ipopt(
        "tune",
        {"x": z, "f": f, "g": g},
        tol=_TOLERANCE,
        constr_viol_tol=0.1 * VIOLATION,
        max_iter=_ITERATIONS,
        bound_relax_factor=0.0,
        hessian_approximation="limited-memory",
        # a start inside its bounds is hardly moved
        bound_push=1e-6,
        bound_frac=1e-6,
        mu_strategy="adaptive",
    )
    found = np.asarray(solver(x0=start, lbx=lows, ubx=highs, lbg=0.0, ubg=np.inf)["x"]).ravel()[:count]
    found = np.clip(found, low, high)
    reached = values(found)[0]
    if not np.isfinite(reached).all():
        found, reached = np.clip(x, low, high), values(np.clip(x, low, high))[0]
    over_by = dict.fromkeys(groups, 0.0)
    for value, condition in zip(reached, conditions):
        over_by[condition.group] = max(over_by[condition.group], -value if np.isfinite(value) else np.inf)
    return Answer(x=found, objective=float(objective(wish, casadi.DM(found))), violations=over_by)


class _Values:
    """Values and derivatives of the conditions for given changes.

    If the motion of a condition is lost, the results of this and all later conditions are NaN. The last results are cached.
    """

    def __init__(self, conditions: Sequence[Condition]) -> None:
        self.conditions = conditions
        self._last: tuple[bytes, bool, FloatArray, FloatArray] | None = None
        self._lost = 0

    def __call__(self, x: FloatArray, slopes: bool = False) -> tuple[FloatArray, FloatArray]:
        """Return the values of the m conditions, shape (m,), and their derivatives, shape (m, k), at changes x.

        The derivatives are NaN unless ``slopes`` is true.
        """
        key = x.tobytes()
        if self._last is not None and self._last[0] == key and self._last[1] >= slopes:
            return self._last[2:]
        values, rows = np.full(len(self.conditions), np.nan), np.full((len(self.conditions), len(x)), np.nan)
        for row, condition in enumerate(self.conditions if self._lost < _PATIENCE else ()):
            try:
                values[row] = condition.value(x)
                if slopes:
                    rows[row] = condition.slopes(x)
            except LinkworkError:
                self._lost += 1
                break
        self._last = key, slopes, values, rows
        return values, rows

    def function(self, count: int) -> Callable[[Any], Any]:
        """Return the values of the conditions as a CasADi function of ``count`` changes."""
        return symbolic.wrap_function("conditions", count, len(self.conditions), self.__call__)


#: Greatest number of rounds of the exchange, and of combinations of moves that are tried.
_ROUNDS, _WAYS = 12, 8
#: Value of a condition above which the condition counts as far from active.
_FAR = 0.05
#: Number of changes spread over their bounds that are tried if no move meets the wish, a power of two; halvings of the distance
#: from the present values to changes that meet the wish; ratio of positive bounds above which the values are spread evenly in
#: the logarithm.
_SPREAD, _BISECTIONS, _WIDE = 16, 6, 10.0
#: Where a region of lost stability or a resonance is moved to clear the range: below the range, above it, or removed.
_BELOW, _ABOVE, _REMOVED = -1, 1, 0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Way:
    """Choice of how one region of lost stability, or one resonance, is moved out of the range."""

    kind: Crossing | None  # kind of the region; None for a resonance
    level: float  # middle of the region, or the resonance
    side: int  # _BELOW, _ABOVE or _REMOVED


@dataclass(slots=True, eq=False)
class _Search:
    """State of a tuning: motions on branches off the response, and the best changes so far."""

    wish: Wish
    rounds: int = 0
    #: Motions on branches that the response does not meet.
    more: list[Spot] = field(default_factory=list)
    #: The best so far: rank (whether requirements are missed, excess, objective), survey, and levels with two stable motions.
    best: tuple[tuple[bool, float, float], Survey, tuple[float, ...]] | None = None

    def survey_changes(self, x: FloatArray) -> Survey:
        """Follow the response with changes x of the parameters and survey the range."""
        own = []
        for spot in self.more:
            with suppress(LostError):  # its branch may be gone there
                own.append(TrackedMotion.at_level(self.wish, spot, spot.level).find(x).orbit)
        return survey(self.wish, x, own)

    def search_others(self, found: Survey) -> tuple[bool, tuple[float, ...]]:
        """Search for motions off the response; return whether there are new ones, and the levels with two stable motions."""
        new, several = other_motions(found)
        self.more += [known_spot(self.wish, found.x, orbit) for orbit in new]
        return bool(new), several

    def excess(self, found: Survey, several: tuple[float, ...]) -> float:
        """Return the sum of the excesses of all requirements: see `Reading`."""
        return sum(reading.excess for reading in readings(found, several).values())

    def keep(self, found: Survey, several: tuple[float, ...]) -> None:
        """Store a survey, with the levels that have two stable motions, if it is the best so far."""
        excess = self.excess(found, several)
        rank = excess > 0.0, excess, float(objective(self.wish, found.x))
        if self.best is None or rank < self.best[0]:
            self.best = rank, found, several

    @property
    def least(self) -> float:
        """Least objective found so far for which all requirements are met; infinite if there is none."""
        return np.inf if self.best is None or self.best[0][0] else self.best[0][2]


def tune(wish: Wish, *, progress: bool = False) -> Tuned:
    """Find the least change of parameters that keeps a range of speeds free of resonance, jumps and instability.

    Conditions at motions of the response, with exact derivatives, keep unwanted regions and resonances out of the range; IPOPT
    finds the least change that satisfies them. The response is then followed again, and each region or resonance still in the
    range adds a condition, until none is left. Each region of lost stability may be moved below the range, moved above it, or
    removed; each resonance may be moved below or above. The least change of all combinations is returned.

    Parameters
    ----------
    wish : Wish
    progress : bool
        Show a progress bar.

    Returns
    -------
    Tuned
        The verified changes; if the wish cannot be met, the changes with the least sum of excesses.

    Raises
    ------
    InputError
        If ``wish`` is not a `Wish`.
    OrbitError
        If there is no periodic motion to begin with at either end of the range.

    Examples
    --------
    >>> from analysis import Limit, Wish, tune
    >>> pin = Limit(output="pin.C", below="9 N")
    >>> change = {"slider.stiffness": "5 %"}
    >>> wish = Wish(parameters="rig-2-spring-c", speeds=("500 rpm", "510 rpm"), change=change, limits=[pin])
    >>> tuned = tune(wish)
    >>> tuned.met, f"{tuned.values[0]:.1f} N/m"
    (True, '4153.3 N/m')
    """
    require_kind(wish, Wish, "wish", "a Wish, such as Wish(parameters='rig-2-spring-c', speeds=..., change=...)")
    search = _Search(wish)
    zero = np.zeros(len(wish.names))
    start = np.clip(zero, wish.scale_changes(wish.low), wish.scale_changes(wish.high))
    before = search.survey_changes(zero)
    first = before if (start == zero).all() else search.survey_changes(start)
    if search.search_others(first)[0]:
        first = search.survey_changes(start)
        before = first if (start == zero).all() else search.survey_changes(zero)
    _try_ways(search, first, progress)
    if search.least == np.inf:
        nearer = _survey_near_solution(search, first)
        if nearer is not None:
            _try_ways(search, nearer, progress)
    if search.best is None:
        raise LinkworkError(
            f"the motions from {wish.say(*wish.span, joint=' to ')} could not be followed with any change of "
            f"{', '.join(wish.names)} that was tried: choose a narrower range, or narrower bounds of the changes"
        )
    return _make_result(search, before, *search.best[1:])


def _try_ways(search: _Search, first: Survey, progress: bool) -> None:
    """Try the combinations of moves that clear the range, starting from the changes of a survey; keep the best result."""
    ways = _ways(first)
    with show_progress(progress, len(ways), "trying changes") as show:
        for number, way in enumerate(ways):
            found = _exchange(search, first, list(way))
            show(number + 1)
            if found is not None:
                search.keep(*found)


def _survey_near_solution(search: _Search, first: Survey) -> Survey | None:
    """Find changes within the bounds that meet the requirements, and return a survey at nearby changes that do not.

    If every search from the first changes fails because motions are lost, a search from these nearby changes may succeed. The
    result is None if none of the sampled changes, spread over the bounds, meets the requirements.
    """
    wish = search.wish
    low, high = wish.scale_changes(wish.low), wish.scale_changes(wish.high)
    spread = wish.scale_changes(_spread_values(wish.low, wish.high))
    for x in sorted([low, high, *spread], key=lambda x: float(objective(wish, x))):
        if _try_changes(search, x)[0]:
            break
    else:
        return None
    dirty, clean, found = first.x, x, None
    for _ in range(_BISECTIONS):
        middle = 0.5 * (dirty + clean)
        is_clean, there = _try_changes(search, middle)
        if is_clean:
            clean = middle
        else:
            dirty, found = middle, there or found
    return found


def _spread_values(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return m sets of values of the k parameters, spread over the bounds ``low`` and ``high``; shape (m, k)."""
    from scipy.stats import qmc  # takes half a second

    share = qmc.Sobol(len(low), rng=0).random(_SPREAD)
    wide = (low > 0.0) & (high > _WIDE * low)
    base, ratio = np.where(wide, low, 1.0), np.where(wide, high / np.where(wide, low, 1.0), 1.0)
    return np.asarray(np.where(wide, base * ratio**share, low + (high - low) * share))


def _try_changes(search: _Search, x: FloatArray) -> tuple[bool, Survey | None]:
    """Return whether the changes x meet all requirements, and their survey, None if the motions cannot be followed."""
    several: tuple[float, ...] = ()
    try:
        found = search.survey_changes(x)
        if search.excess(found, several) == 0.0:
            new, several = search.search_others(found)
            found = search.survey_changes(x) if new else found
    except LinkworkError:
        return False, None
    if search.excess(found, several) > 0.0:
        return False, found
    search.keep(found, several)
    return True, found


def _make_result(search: _Search, before: Survey, after: Survey, several: tuple[float, ...]) -> Tuned:
    wish = search.wish
    largest, level, count = chart_range(after)
    low, high = (f(*ends) for f, ends in zip((min, max), zip(wish.span, wish.range_with_margin)))
    # a branch that is lost outside the range does not matter
    beside = {
        describe_end(b) for b in after.response.branches if not any(low <= b.parameter[end] <= high for end in (0, -1))
    }
    problems = [sentence for sentence in after.response.problems if sentence not in beside]
    if (
        wish.judges_stability
        and not largest <= wish.radius + MARGINAL
        and all(r.excess == 0.0 for r in readings(after).values())
    ):
        problems.append(f"a chart has a multiplier of {largest:.6g}, which the response does not have")
    return Tuned(
        wish=wish,
        x=after.x,
        requirements=requirements(before, after, several),
        before=before,
        after=after,
        verification=Verification(
            orbits=sum(len(branch) for branch in after.response.branches),
            charted=count,
            largest=largest,
            place=wish.say(level),
            sought=SOUGHT,
            several=wish.say(*several) if several else "",
            problems=tuple(problems),
        ),
        rounds=search.rounds,
    )


# Ways


def _end(region: Region, side: int) -> SpecialPoint | None:
    """Return the special point at the upper end of a region (side -1, to go below the range) or at its lower end (side +1).

    The result is None if the branch was not followed to that end.
    """
    ends = [s for s in (region.first, region.last) if s is not None]
    return next((s for s in ends if s.parameter == (region.high if side == _BELOW else region.low)), None)


def _ways(found: Survey) -> list[tuple[_Way, ...]]:
    """Return the combinations of moves that clear the range of all regions and resonances; the shortest total move is first."""
    wish = found.wish
    low, high = wish.span
    choices: list[list[tuple[float, _Way]]] = []
    for region in _unwanted_regions(found):
        middle, sides = 0.5 * (region.low + region.high), [(0.5 * (region.high - region.low), _REMOVED)]
        sides += [
            (d, s) for d, s in ((region.high - low, _BELOW), (high - region.low, _ABOVE)) if _end(region, s) is not None
        ]
        choices.append([(d, _Way(kind=region.kind, level=middle, side=s)) for d, s in sides])
    low, high = wish.range_with_margin
    for spot in found.peaks:
        sides = [(spot.level - low, _BELOW), (high - spot.level, _ABOVE)]
        choices.append([(d, _Way(kind=None, level=spot.level, side=s)) for d, s in sides])
    combined = sorted(product(*choices), key=lambda way: sum(d for d, _ in way))
    return [tuple(w for _, w in way) for way in combined[:_WAYS]]


def _unwanted_regions(found: Survey) -> list[Region]:
    """Return the regions of lost stability that the wish excludes from the range."""
    wish = found.wish
    if wish.judges_stability:
        return list(found.regions)
    jumps = [r for r in found.regions if wish.no_jump and r.kind is Crossing.FOLD]
    return jumps + [
        r for r in found.regions if r not in jumps and any(r.low < b and a < r.high for a, b in found.unstable)
    ]


def _side(ways: Sequence[_Way], kind: Crossing | None, level: float) -> int | None:
    same = [way for way in ways if way.kind is kind]
    return min(same, key=lambda way: abs(way.level - level)).side if same else None


# Exchange


def _exchange(search: _Search, first: Survey, ways: list[_Way]) -> tuple[Survey, tuple[float, ...]] | None:
    """Find the least change that clears the range by given moves; return its survey and the levels with two stable motions.

    The requirements may not all be met after the last round. The result is None if a motion is lost, or if another combination
    of moves has led to an objective that is as small.
    """
    wish, found = search.wish, first
    conditions: list[Condition] = []
    several: tuple[float, ...] = ()
    answer = Answer(x=first.x, objective=0.0, violations={})
    for number in range(_ROUNDS):
        try:
            new = [c for c in _conditions(found, ways) if _counts(c, answer)]
            if not new:
                own, several = search.search_others(found)
                if not own and (number > 0 or not wish.least):
                    return found, several
            # conditions that are far from active are dropped; they are found again if they matter
            conditions = [c for c in conditions if _value(c, answer) < _FAR] + new
            answer = find_least_change(wish, conditions, answer.x)
            search.rounds += 1
            if not isfinite(answer.total) or (answer.met and answer.objective >= search.least):
                return None
            found = search.survey_changes(answer.x)
        except LinkworkError:
            return None
    return found, several


def _counts(condition: Condition, answer: Answer) -> bool:
    """Return whether a condition's violation exceeds the greatest violation in the answer for the same requirement."""
    return _value(condition, answer) < -answer.violations.get(condition.group, 0.0) - condition.slack


def _value(condition: Condition, answer: Answer) -> float:
    """Return the value of a condition, or infinity if its motion cannot be found."""
    try:
        return condition.value(answer.x)
    except LinkworkError:
        return np.inf


def _conditions(found: Survey, ways: list[_Way]) -> Iterator[Condition]:
    """Yield the conditions that follow from the regions, minima, resonances and outputs of a survey.

    A move for each new region is added to ``ways``.
    """
    wish, x = found.wish, found.x
    low, high = wish.span
    gone: list[Region] = []
    for region in _unwanted_regions(found):
        side = _side(ways, region.kind, 0.5 * (region.low + region.high))
        if side is None:
            nearer = _BELOW if region.high - low < high - region.low else _ABOVE
            side = next((s for s in (nearer, -nearer) if _end(region, s) is not None), _REMOVED)
            ways.append(_Way(kind=region.kind, level=0.5 * (region.low + region.high), side=side))
        end = _end(region, side) if side else None
        group = JUMP if wish.no_jump and region.kind is Crossing.FOLD else STABLE
        if end is not None:
            gone.append(region)
            place = TrackedMotion(wish, StabilityLoss(end.kind), known_spot(wish, x, end.orbit))
            yield StabilityLossBeyond(group, place, high if side == _ABOVE else low, side)
        elif region.kind is Crossing.FOLD:
            yield MultipliersInside(group, TrackedMotion(wish, region.across, region.worst), region.kind, 1.0)
    for lost in found.least:
        if not any(r.kind is lost.kind and r.low <= lost.spot.level <= r.high for r in gone):
            place = TrackedMotion.at_level(wish, lost.spot, lost.spot.level)
            yield MultipliersInside(STABLE, place, lost.kind, wish.radius)
    low, high = wish.range_with_margin
    for spot in found.peaks:
        side = _side(ways, None, spot.level) or (_BELOW if spot.level - low < high - spot.level else _ABOVE)
        yield PeakBeyond(RESONANCE, wish, spot, high if side == _ABOVE else low, side)
    for top in found.greatest:
        yield OutputBelow(str(top.limit), wish, top.spot, top.limit, top.angles)
