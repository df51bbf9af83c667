"""Search for linkages that do a task and rank them; trade the error against size, transmission angle or pin force."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, isfinite
from pathlib import Path
from time import perf_counter
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, Interrupted

from ...display import NotebookResult, format_count
from ...files import unknown_name, write_csv
from ...units import Amount, in_si
from ..exact.burmester import guidance
from ..exact.generation import QuickReturn, QuickSwing, function_generators, quick_returns
from ..linkage.linkage import UNITS, Kind, Linkage
from ..result.report import solution_columns
from ..result.solution import Solution, group_similar, rank_solutions
from ..task.constraint import (
    SECOND_LENGTH,
    USUAL,
    Constraint,
    Demand,
    InfeasibleError,
    LargestLink,
    LeastTransmission,
    MaxPinForce,
)
from ..task.limits import (
    GEARS,
    Limits,
    PivotUnknown,
    check_bounds,
    check_sequence,
    check_task,
    limits_by_kind,
    make_limits,
    place_as_task,
    usual_kinds,
)
from ..task.task import Motion, Normal, PrecisionPoints, RockerFunction, Task, UntimedPath, normal_form
from .polish import (
    EXACT,
    QUICK_SEARCH,
    USUAL_SEARCH,
    Polished,
    Polisher,
    Search,
    distinct_answers,
    feasible_answers,
    infeasible_error,
    polish,
)
from .program import Answer, convert_to_start, make_linkage, random_pivot
from .scan import scan

#: Number of stations of an untimed path with a moving pivot: more than with a fixed one, as harmonics cause waves in the curve.
STATIONS = 144
#: Number of untimed points that a four-bar can pass exactly, and factor by which starts are increased until one passes the
#: points.
MOST_EXACT, AGAIN = 9, 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Synthesis(NotebookResult):
    """Ranked solutions of a task.

    Attributes
    ----------
    task : Task
    solutions : tuple of Solution
        Solutions without defects come first, and among these the one with the least value of what is minimised. A solution also
        represents its mirror images and near copies, which are its ``variants``.
    method : str
        How the solutions were found: "scan" or "closed form".
    seed : int
        Seed of the search.
    starts : int
        Number of searches that were run.
    seconds : float
        Duration of the search (s).
    complete : bool
        False if the search was stopped.
    """

    task: Task
    solutions: tuple[Solution, ...]
    method: str
    seed: int
    starts: int
    seconds: float
    complete: bool = True

    def __repr__(self) -> str:
        count, stopped = format_count(len(self.solutions), "solution"), "" if self.complete else ", stopped early"
        best = f"; the best: {self.best.describe()}" if self.solutions else ""
        return (
            f"<Synthesis: {count} of a {type(self.task).__name__} by {self.method}, {format_count(self.starts, 'start')}, "
            f"{self.seconds:.3g} s{stopped}{best}>"
        )

    @property
    def best(self) -> Solution:
        """Return the best solution, the first."""
        return self.solutions[0]

    def columns(self) -> dict[str, list[float]]:
        """Return rank, errors, verdicts (1 or 0) and dimensions of the solutions and their variants; SI, units in the names.

        For a variant, ``variant of`` is the rank of the solution that represents it; otherwise it is 0.
        """
        columns = solution_columns(self.with_variants)
        ranks = [float(rank) for rank, s in enumerate(self.solutions, start=1) for _ in s.variants]
        return {"rank": columns["rank"], "variant of": [0.0] * len(self.solutions) + ranks} | columns

    @property
    def with_variants(self) -> tuple[Solution, ...]:
        """Return the solutions, followed by the variants of each."""
        return (*self.solutions, *(variant for s in self.solutions for variant in s.variants))

    def to_csv(self, path: str | Path) -> Path:
        """Write `columns` to a CSV file."""
        return write_csv(path, self.columns())


class SynthesisInterrupted(Interrupted):
    """A synthesis was interrupted by Ctrl-C; ``synthesis`` has the best solutions so far, or is None."""

    def __init__(self, synthesis: Synthesis | None, done: int, starts: int) -> None:
        self.synthesis = synthesis
        super().__init__(f"stopped after {done} of {starts} searches")


@in_si(bounds=UNITS)
def synthesize(
    task: Task,
    bounds: Mapping[str, tuple[Amount, Amount]] | None = None,
    constraints: Sequence[Constraint] = USUAL,
    *,
    pivot: PivotUnknown | None = None,
    guesses: Sequence[Solution] = (),
    search: Search = USUAL_SEARCH,
    kinds: Sequence[Kind] | None = None,
    gears: Sequence[float] = GEARS,
) -> Synthesis:
    """Find linkages that do a task.

    A scan over many thousand linkages of each kind, each placed in closed form, gives the starts; each start is optimised with
    exact derivatives. If no linkage does the task exactly, the best approximations are returned with their errors.

    Parameters
    ----------
    task : TimedPath, UntimedPath, RockerFunction, SliderFunction, QuickReturn, QuickSwing, Motion or PrecisionPoints
    bounds : mapping, optional
        (least, greatest) of dimensions by their name in `Linkage` (m, rad, or text such as "5 cm"), or of a five-bar's
        ``second_crank_length``. Equal bounds fix a dimension. If several kinds of linkages are tried, a kind without the
        dimension ignores its bounds. By default links are at most five times the target's size; for a rocker function the
        ground link is 0.1 m and the other links are at most 0.5 m.
    constraints : sequence
        See `task.constraint`; by default a transmission angle of at least 40 degrees over a full turn.
    pivot : SliderUnknown or CrankUnknown, optional
        Unknown motion of the rocker pivot, which is found together with the links.
    guesses : sequence of Solution
        Solutions from which searches start, in addition to the starts of the scan.
    search : Search
        Settings of the search: starts, seed, cores.
    kinds : sequence of "four-bar", "slider-crank", "geared-five-bar", optional
        Kinds of linkages that are tried and ranked together; the best of each kind is among the solutions. By default
        four-bars, for a slider function slider-cranks.
    gears : sequence of float
        Gear ratios of five-bars: turns of the second crank per turn of the first.

    Raises
    ------
    InputError
        If an argument is not usable or has no effect, or a kind of linkage cannot do the task or meet a constraint.
    InfeasibleError
        If no linkage meets all bounds and constraints; the message names the constraint that the nearest linkage violates most.
    SynthesisInterrupted
        On Ctrl-C, with the best solutions so far.

    Notes
    -----
    A `QuickReturn` and a `QuickSwing` are solved in closed form: of the settings of the search only ``solutions`` counts.

    Examples
    --------
    >>> import numpy as np
    >>> from analysis import synthesize
    >>> from analysis.synthesis import Search, TimedPath, turn
    >>> phi = turn(24)
    >>> ellipse = np.column_stack([0.2 + 0.1 * np.cos(phi), 0.15 + 0.05 * np.sin(phi)])
    >>> found = synthesize(TimedPath(points=ellipse), {"rocker_length": ("5 cm", "50 cm")}, search=Search(starts=2))
    >>> found.best.verdicts.sound
    True
    """
    if search.starts < 1:
        raise InputError(f"{search.starts} starts: there must be at least one")
    begun = perf_counter()
    kinds = usual_kinds(task) if kinds is None else kinds
    check_arguments(task, kinds, bounds=bounds, pivot=pivot, guesses=guesses, gears=gears)
    if isinstance(task, QuickReturn | QuickSwing):
        return _solve_in_closed_form(task, bounds, constraints, search, begun)
    task = _prepare_task(task, constraints, pivot)
    normal = search_form(task, pivot)
    every = limits_by_kind(task, normal, bounds, constraints, kinds, gears)
    if tuple(kinds) != ("four-bar",) and pivot is not None:
        raise InputError("only a four-bar's pivot can be moved: leave the other kinds out")
    for number, guess in enumerate(guesses):
        if not any(limits.admits(guess.linkage) for limits in every):
            raise InputError(
                f"guess {number} is a {guess.verdicts.grashof}: it must be of one of the kinds that the search allows"
            )
    found: list[tuple[Solution, ...]] = []
    exact = closed_form_solutions(task) if pivot is None else ()
    done, refused, total = Polished(), None, 0
    for limits in every:
        own = pivot or limits.second_crank(normal.unit)
        given = [guess for guess in (*guesses, *exact) if limits.admits(guess.linkage)]
        # the ratios of gears share the starts and the candidates of a kind
        share = 1 if limits.second is None else len(gears)
        how = replace(search, starts=-(-search.starts // share), candidates=-(-search.candidates // share))
        total += (len(given) + how.starts) * (1 if limits.without_defects(normal) is None else 2)
        try:
            part = _search_kind(normal, limits, given, own, how)
        except InfeasibleError as error:
            refused = refused or error
            continue
        except KeyboardInterrupt:
            done = replace(done, interrupted=True)
            break
        done = done.merge(part)
        found.append(make_solutions(task, normal, limits, part, own, search.solutions))
        if done.interrupted:
            break
    if refused is not None and not found:
        raise refused
    together = found[0] if len(found) == 1 else _merge_kinds(found, search.solutions)
    return _make_result(task, together, done, total, search, begun)


def closed_form_solutions(task: Task) -> tuple[Solution, ...]:
    """Return the four-bars without defects that do a task exactly, found in closed form; empty if there are none.

    Closed forms exist for untimed poses and for rocker functions, if there are as many targets as unknowns.
    """
    try:
        if isinstance(task, RockerFunction):
            return function_generators(task).sound
        if isinstance(task, PrecisionPoints | Motion) and task.angle is not None and task.rotation is None:
            return tuple(s for s in guidance(task).solutions if s.verdicts.sound)
    except InputError:
        # not as many targets as unknowns, or targets that depend on one another
        pass
    return ()


def check_arguments(
    task: Task,
    kinds: Sequence[Kind] | None,
    *,
    bounds: Mapping[str, Any] | None = None,
    pivot: PivotUnknown | None = None,
    guesses: Sequence[Solution] = (),
    gears: Sequence[float] = GEARS,
    over: str | None = None,
) -> None:
    """Check arguments of `synthesize` and `trade_off`.

    Raises InputError if an argument is of another type, a kind is unknown, or an argument has no effect on the task with these
    kinds.
    """
    kinds, named = usual_kinds(task) if kinds is None else kinds, check_bounds(bounds)
    for name, values in (("kinds", kinds), ("guesses", guesses), ("gears", gears)):
        check_sequence(name, values)
    if not len(kinds):
        raise InputError(f"no kind of linkages is given: there are {', '.join(get_args(Kind))}")
    for kind in kinds:
        if kind not in get_args(Kind):
            raise unknown_name(kind, get_args(Kind), f"kind {kind!r}")
    if not isinstance(pivot, PivotUnknown | None):
        raise InputError(f"pivot is {pivot!r}: it must be a SliderUnknown or a CrankUnknown")
    for number, guess in enumerate(guesses):
        if not isinstance(guess, Solution):
            raise InputError(f"guess {number} is {guess!r}: it must be a Solution, such as the best of a Synthesis")
    alone, geared = f"but kinds are {' and '.join(map(str, kinds))} alone", "geared-five-bar" in kinds
    sliding = tuple(kinds) == ("slider-crank",)
    unused = {
        "gears": (tuple(gears) != GEARS and not geared, f"it is for a geared-five-bar, {alone}"),
        SECOND_LENGTH: (SECOND_LENGTH in named and not geared, f"it is a dimension of a geared-five-bar, {alone}"),
        "rocker_length": ("rocker_length" in named and sliding, f"a slider-crank has no rocker, {alone}"),
    }
    closed = isinstance(task, QuickReturn | QuickSwing)
    if closed:
        solved = f"a {type(task).__name__} is solved in closed form, with"
        unused |= {
            "pivot": (pivot is not None, f"{solved} a fixed pivot"),
            "guesses": (len(guesses) > 0, f"{solved} no search that starts from guesses"),
            "over": (over is not None, f"{solved} no error to trade"),
        }
    for name, (given, reason) in unused.items():
        if given:
            raise InputError(f"{name} has no effect: {reason}; leave it out")
    if closed and tuple(kinds) != usual_kinds(task):
        link = "slider of a slider-crank" if isinstance(task, QuickReturn) else "rocker of a four-bar"
        raise InputError(f"a {type(task).__name__} is a task for the {link}: kinds must be {usual_kinds(task)}")


def _solve_in_closed_form(
    task: QuickReturn | QuickSwing, bounds: Any, constraints: Sequence[Any], search: Search, begun: float
) -> Synthesis:
    found = group_similar(quick_returns(task, bounds, constraints))[: search.solutions]
    seconds = perf_counter() - begun
    return Synthesis(
        task=task, solutions=found, method="closed form", seed=search.seed, starts=len(found), seconds=seconds
    )


def _search_kind(
    normal: Normal, limits: Limits, guesses: Sequence[Solution], pivot: PivotUnknown | None, search: Search
) -> Polished:
    """Search for one kind of linkage, from the starts of a scan and from guesses.

    Linkages without defects rank first: if the limits do not exclude defects, a second search excludes them.
    """
    begin = [convert_to_start(guess, normal, pivot) for guess in guesses]
    random = np.random.default_rng(search.seed)
    again = AGAIN if normal.exact and not normal.timed and normal.n <= MOST_EXACT else 1
    scanned = scan(normal, limits, seed=search.seed, candidates=search.candidates, starts=again * search.starts)
    if pivot is not None and limits.second is None:
        scanned = [replace(s, pivot=random_pivot(pivot, s.q[2], normal.unit, random)) for s in scanned]
    done = polish(normal, limits, [*begin, *scanned[: search.starts]], pivot=pivot, search=search)
    rest, met = scanned[search.starts :], bool(done.kept) and done.kept[0].start.quality < EXACT
    if rest and not met and not done.interrupted:
        more = polish(normal, limits, rest, pivot=pivot, search=search)
        done = replace(done.merge(more), kept=tuple(feasible_answers([*done.kept, *more.kept])))
    sound = limits.without_defects(normal)
    if done.interrupted or sound is None:
        return done
    try:
        return _search_kind(normal, sound, guesses, pivot, search).merge(done)
    except InfeasibleError:
        return done


def _merge_kinds(found: Sequence[Sequence[Solution]], count: int) -> tuple[Solution, ...]:
    """Return the best ``count`` solutions of several rankings ``found``, with the best solution of each kind of linkage."""
    every = rank_solutions([s for part in found for s in part])
    first = {s.linkage.kind: s for s in reversed(every)}.values()
    rest = [s for s in every if not any(s is best for best in first)]
    return rank_solutions([*rank_solutions(list(first))[:count], *rest[: max(0, count - len(first))]])


@in_si(bounds=UNITS)
def improve(
    task: Task,
    linkage: Linkage | Solution,
    pivot: PivotUnknown,
    *,
    bounds: Mapping[str, tuple[float, float]],
    constraints: Sequence[Constraint],
    guesses: Sequence[Linkage | Solution] = (),
    kept: Collection[str] = (),
    search: Search = USUAL_SEARCH,
) -> Synthesis:
    """Improve a linkage by letting its rocker pivot move: optimise its dimensions and the motion of the pivot.

    The optimisation starts from ``search.starts`` random motions of the pivot, and from guesses.

    Parameters
    ----------
    task, bounds, constraints, guesses, search
        See `synthesize`; there is no scan.
    linkage : Linkage or Solution
        The linkage to be improved. For an open path it must be a `Solution`, because the crank rotations of the stations are
        needed. The same holds for each guess.
    pivot : SliderUnknown or CrankUnknown
        Unknown motion of the rocker pivot.
    kept : collection of str
        Dimensions that are fixed and returned unchanged.

    Raises
    ------
    InputError, InfeasibleError, SynthesisInterrupted
        See `synthesize`.
    """
    if search.starts < 1 and not guesses:
        raise InputError(f"{search.starts} starts and no guess: there must be at least one of either")
    begun = perf_counter()
    check_task("four-bar", task)
    task = _prepare_task(task, constraints, pivot)
    normal = search_form(task, pivot)
    limits = make_limits(task, normal, bounds, constraints)
    base, *begin = (convert_to_start(guess, normal, pivot) for guess in (linkage, *guesses))
    random = np.random.default_rng(search.seed)
    begin += [replace(base, pivot=random_pivot(pivot, base.q[2], normal.unit, random)) for _ in range(search.starts)]
    done = polish(normal, limits, begin, pivot=pivot, search=search)
    as_given = Polisher(normal, limits, pivot).judge_start(base)
    if as_given.feasible and all(answer.start.quality > as_given.start.quality for answer in done.kept):
        # the pivot at rest does better than all motions found from other starts
        done = done.merge(polish(normal, limits, [base], pivot=pivot, search=search))
    given = linkage.linkage if isinstance(linkage, Solution) else linkage
    same: dict[str, Any] = {name: getattr(given, name) for name in kept}

    def put_back(s: Solution) -> Solution:
        made = Solution.from_linkage(task, replace(s.linkage, **same), s.evaluation.rotation)
        return replace(made, variants=tuple(map(put_back, s.variants)))

    found = tuple(map(put_back, make_solutions(task, normal, limits, done, pivot, search.solutions)))
    return _make_result(task, found, done, len(begin), search, begun)


def _prepare_task(task: Task, constraints: Sequence[Any], pivot: PivotUnknown | None) -> Task:
    """Return the task for the search; its objective is the greatest error if a function other than an error is minimised.

    Raises InputError if a constraint does not apply to a moving pivot.
    """
    demands = [c for c in constraints if isinstance(c, Demand)] if isinstance(constraints, Sequence) else []
    if demands and pivot is not None:
        raise InputError(f"{type(demands[0]).__name__} applies only to a fixed rocker pivot: leave it out")
    return replace(task, objective="worst") if any(c.seeks for c in demands) else task


def _make_result(
    task: Task, found: tuple[Solution, ...], done: Polished, total: int, search: Search, begun: float
) -> Synthesis:
    """Return the result of a search; raise an error if the search has no solution, or was interrupted.

    ``done`` are the answers from which the solutions ``found`` were made, ``total`` is the number of starts of a whole search,
    and ``begun`` the time at which the search began (s).
    """
    result = Synthesis(
        task=task,
        solutions=found,
        method="scan",
        seed=search.seed,
        starts=done.done,
        seconds=perf_counter() - begun,
        complete=not done.interrupted,
    )
    if done.interrupted:
        raise SynthesisInterrupted(result if found else None, done.done, total)
    if not found:
        raise infeasible_error(done)
    return result


def search_form(task: Task, pivot: PivotUnknown | None) -> Normal:
    """Return the normal form of a task for a search; an untimed path has more stations if the pivot moves."""
    if pivot is not None and isinstance(task, UntimedPath):
        task = replace(task, samples=max(task.samples, STATIONS))
    return normal_form(task)


def make_solutions(
    task: Task, normal: Normal, limits: Limits, done: Polished, pivot: PivotUnknown | None, count: int
) -> tuple[Solution, ...]:
    """Evaluate answers as solutions, rank them, and return at most ``count``."""

    def evaluate_answers(answers: Sequence[Answer]) -> tuple[Solution, ...]:
        found = (
            Solution.from_linkage(
                task,
                place_as_task(task, make_linkage(a.start, normal, pivot, limits)),
                _task_rotations(task, normal, a.start.rotation),
            )
            for a in answers
        )
        there = [s for s in found if isfinite(s.error)]
        if limits.least is not None:
            # in the order of the function that is minimised instead of an error
            return tuple(sorted(there, key=lambda s: not s.verdicts.sound))
        return rank_solutions(there)

    solutions = evaluate_answers(distinct_answers(done.kept, 4 * count, pivot))
    # the best start is a solution itself if it is better than all answers
    first = evaluate_answers(done.begun)[:1] if limits.least is None else ()
    if first and rank_solutions([*solutions[:1], *first])[0] is first[0]:
        solutions = rank_solutions([*first, *solutions])
    return group_similar(solutions)[:count]


def _task_rotations(task: Task, normal: Normal, rotation: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Return the crank rotations of the task's stations; interpolate the rotations of a search that has other stations."""
    own = normal_form(task)
    if rotation is None or len(rotation) == own.n:
        return rotation
    at, turned = normal.shares, rotation
    if own.closed:
        at = np.append(at, 1.0)
        turned = np.append(rotation, rotation[0] + np.copysign(2.0 * np.pi, rotation[-1] - rotation[0]))
    return np.interp(own.shares, at, turned)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TradeOff:
    """The least error for each of several limits of size, transmission angle or pin force.

    Attributes
    ----------
    over : str
        The quantity whose limit is tightened, a key of `OVER`.
    limit : ndarray, shape (n,)
        Largest link (m), least transmission angle (rad), or greatest force on a pin (N).
    solutions : tuple of Solution or None
        The best solution at each limit; None if there is no linkage.
    """

    over: str
    limit: NDArray[np.float64]
    solutions: tuple[Solution | None, ...]

    @property
    def error(self) -> np.ma.MaskedArray:
        """Return the value of the quality function at each limit, masked where there is no linkage; shape (n,)."""
        values = [np.nan if s is None else s.error for s in self.solutions]
        return np.ma.masked_invalid(np.array(values))

    def columns(self) -> dict[str, list[float]]:
        """Return the limit, errors, verdicts (1 or 0) and dimensions of each solution; SI, units in the names."""
        there = [(float(limit), s) for limit, s in zip(self.limit, self.solutions) if s is not None]
        over = OVER[self.over]
        columns = solution_columns([s for _, s in there])
        columns.pop("rank", None)
        return {f"limit of {over.name} [{over.unit}]": [limit for limit, _ in there], **columns}

    def to_csv(self, path: str | Path) -> Path:
        """Write `columns` to a CSV file."""
        return write_csv(path, self.columns())


class TradedQuantity(NamedTuple):
    """The quantity traded against the error: name and SI unit of its limit, and how the limit is shown."""

    name: str
    unit: str
    factor: float  # shown values per SI value
    shown: str  # their unit
    small: bool  # whether a smaller limit is tighter


OVER: Mapping[str, TradedQuantity] = {
    "size": TradedQuantity("largest link", "m", 1e3, "mm", True),
    "transmission": TradedQuantity("least transmission angle", "rad", degrees(1.0), "deg", False),
    "pin-force": TradedQuantity("greatest pin force", "N", 1.0, "N", True),
}


class TradeOffInterrupted(Interrupted):
    """A trade-off was interrupted by Ctrl-C; ``trade_off`` has the best solution so far at each limit, if any."""

    def __init__(self, trade_off: TradeOff, done: int, problems: int) -> None:
        self.trade_off = trade_off
        super().__init__(f"stopped after {done} of {problems} problems of the trade-off")


@in_si(bounds=UNITS)
def trade_off(
    task: Task,
    over: Literal["size", "transmission", "pin-force"],
    limits: ArrayLike,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    constraints: Sequence[Constraint] = USUAL,
    *,
    search: Search = QUICK_SEARCH,
    kinds: Sequence[Kind] | None = None,
    gears: Sequence[float] = GEARS,
) -> TradeOff:
    """Trade error against size, transmission angle or pin force, by the epsilon-constraint method with warm starts.

    From the loosest limit to the tightest, each problem starts from its own scan and from the solutions of the previous
    problem. A solution of a tighter limit also meets the next looser limit: a second pass in the opposite direction uses such a
    solution for the looser limit as well, unchanged or optimised again. Thus the error can only grow as the limit is tightened.

    Parameters
    ----------
    task : Task
    over : "size", "transmission" or "pin-force"
    limits : array_like, shape (n,)
        Largest links (m), least transmission angles (rad), or greatest forces on the pins (N).
    bounds, constraints, kinds, gears
        See `synthesize`; the limit replaces a constraint of the same kind. For pin forces a `MaxPinForce` among the
        constraints gives masses, load and speed.
    search : Search
        See `synthesize`; but there are at most 16384 candidates, and ``solutions`` is ignored.

    Raises
    ------
    InputError
        If ``over`` or the limits are not usable.
    TradeOffInterrupted
        On Ctrl-C, with the best solution so far at each limit.
    """
    if over not in OVER:
        raise InputError(f"a trade-off over {over!r}: it must be one of {', '.join(OVER)}")
    check_arguments(task, kinds, bounds=bounds, gears=gears, over=over)
    check_sequence("constraints", constraints)
    values = np.array(limits, dtype=float)
    kind = {"size": LargestLink, "transmission": LeastTransmission, "pin-force": MaxPinForce}[over]
    running = next((c for c in constraints if isinstance(c, MaxPinForce)), MaxPinForce(force=1.0))
    if values.ndim != 1 or len(values) < 2 or not np.isfinite(values).all():
        raise InputError("the limits of a trade-off must be finite numbers, at least two")
    rest = tuple(c for c in constraints if not isinstance(c, kind))
    first = replace(search, candidates=min(search.candidates, 1 << 14), solutions=3)
    order = np.argsort(-values if OVER[over].small else values)

    def limit(k: int) -> Constraint:
        if over == "pin-force":
            return replace(running, force=values[k])
        return LargestLink(length=values[k]) if over == "size" else LeastTransmission(angle=values[k])

    def best(k: int, guesses: Sequence[Solution], back: bool) -> tuple[Solution, ...]:
        how = replace(first, starts=1, candidates=1 << 8) if back else first
        asked = (*rest, limit(k))
        return synthesize(task, bounds, asked, guesses=guesses, search=how, kinds=kinds, gears=gears).solutions

    found, done = solve_both_ways(order.tolist(), best)
    result = TradeOff(over=over, limit=values, solutions=tuple(found.get(k) for k in range(len(values))))
    if done is not None:
        raise TradeOffInterrupted(result, done, 2 * len(values))
    return result


def solve_both_ways(
    order: Sequence[int], search: Callable[[int, Sequence[Solution], bool], Sequence[Solution]]
) -> tuple[dict[int, Solution], int | None]:
    """Solve a series of problems, from the loosest to the tightest and back, each starting from the previous solutions.

    Parameters
    ----------
    order : sequence of int
        Indices of the problems, the loosest first.
    search : callable
        Function of the index of a problem, the guesses, and whether the pass goes back from the tightest problem to the
        loosest; it returns solutions or raises `InfeasibleError`.

    Returns
    -------
    found : dict
        The best solution of each problem that has one. A solution that meets a tighter limit also meets a looser one, so that
        errors can only grow as the limit is tightened.
    done : int or None
        Number of solved problems, counted in both directions, if Ctrl-C interrupted the series; otherwise None.
    """
    found: dict[int, Solution] = {}
    for back in (False, True):
        previous: list[Solution] = []
        for number, k in enumerate(order[::-1] if back else order):
            own = [found[k]] if k in found else []
            guesses = [*previous, *own]
            if back and not guesses:
                continue
            kept = guesses if back else own
            done: int | None = None
            try:
                result = search(k, guesses, back)
            except InfeasibleError:
                result = ()
            except (SynthesisInterrupted, KeyboardInterrupt) as error:
                last = error.synthesis if isinstance(error, SynthesisInterrupted) else None
                result, done = last.solutions if last else (), back * len(order) + number
            if result or kept:
                found[k] = rank_solutions([*kept, *result])[0]
                previous = [found[k]] if back else list(result)
            if done is not None:
                return found, done
    return found, None


def format_limit(over: str, limit: float) -> str:
    """Format a limit of a trade-off with its unit."""
    return f"{OVER[over].factor * limit:.6g} {OVER[over].shown}"
