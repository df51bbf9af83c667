"""Optimise from the starts of a scan: SciPy's least squares if there are only bounds, IPOPT if there are constraints.

Both solvers use exact Jacobians. If the objective is not a sum of squares, the squared errors are minimised first. Then
`fit` minimises the area or the greatest distance between an untimed path and its target. For other tasks IPOPT minimises the
greatest error at the stations, as an unknown that bounds all errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ContextDecorator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from math import degrees
from threading import Lock
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from linkwork.errors import InputError

from ...numerics.workers import check_jobs, record_interrupts, run_in_parallel, worker_count
from ...run import show_progress
from ..linkage.linkage import ANGLES, FiveBar, SliderCrank, gear_turns
from ..result.solution import Solution
from ..task.constraint import UNKNOWNS, Constraint, InfeasibleError
from ..task.limits import CrankUnknown, Limits, PivotUnknown, SliderUnknown, limits_by_kind
from ..task.task import Normal, normal_form
from .fit import ITERATIONS, Refinement, fit_least_squares, sum_of_squares
from .program import (
    KEPT,
    Answer,
    Program,
    Start,
    clip_to_bounds,
    convert_to_start,
    distances_from_bounds,
    keep_distinct,
)
from .statement import Objective

FloatArray = NDArray[np.float64]
Item = TypeVar("Item")
Made = TypeVar("Made")
#: Number of untimed stations up to which least squares is as fast as IPOPT, whose Jacobian is sparse.
FEW = 20
#: Number of the best fits from which the greatest error is minimised.
ONWARDS = 6
#: Laps of the refinement of paths, as (number of paths, iterations of each): many paths by a few iterations, then the best of
#: them by more. Open paths, whose ends are free, are harder to rank early, so that more of them stay.
RACE = {
    "area": ((40, 12), (6, 60), (2, 100), (1, 100), (1, 200)),
    "open area": ((40, 12), (12, 40), (3, 100), (1, 100), (1, 200)),
    "worst": ((ONWARDS, ITERATIONS),),
}
#: Number of least-squares fits from which paths are refined, besides the starts: most fits end at the same few optima.
FITTED = 8
#: Number of the best answers that are continued if they reached the limit of iterations, and the new limit for each.
FINISHED, LONG = 4, 1500
#: Number of triangles of a region that are tried at a time.
PIECES = 3
#: Greatest number of starts per piece of work on several cores; an interruption loses the piece.
MOST = 32
#: Linkages that differ by less than this, relative to the longest link and in rad, count as the same.
DIFFERENT = 1e-3
#: The same limit for the laps of `RACE`: refined linkages that differ by less end at the same optimum.
RACED = 0.02
#: Quality below which points count as passed exactly (units squared).
EXACT = 1e-14


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Settings of a search.

    Attributes
    ----------
    starts : int
        Number of candidates of the scan from which a search is started.
    solutions : int
        Greatest number of different linkages that are returned.
    seed : int
        Seed of the random numbers; the same seed gives the same solutions, on any number of cores.
    candidates : int
        Number of linkages in the scan.
    n_jobs : int, optional
        Number of processes, -1 for one per core. The default is one process; inside `joblib.parallel_config` for a cluster the
        default is all cores of the cluster.
    progress : bool
        Whether to show a progress bar.
    """

    starts: int = 24
    solutions: int = 6
    seed: int = 0
    candidates: int = 1 << 16
    n_jobs: int | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        for name in ("candidates", "solutions"):
            if getattr(self, name) < 1:
                raise InputError(f"{getattr(self, name)} {name}: there must be at least one")
        check_jobs(self.n_jobs)
        if self.seed < 0 or int(self.seed) != self.seed or int(self.solutions) != self.solutions:
            raise InputError(
                f"seed {self.seed} and {self.solutions} solutions: both must be whole numbers, the seed not below zero"
            )

    @property
    def cores(self) -> int:
        """Return the number of workers that share the searches."""
        return worker_count(self.n_jobs)


USUAL_SEARCH = Search()
#: Default settings if many searches follow one another.
QUICK_SEARCH = Search(starts=12)


def run_on_cores(
    work: Callable[[Item], Made], items: Sequence[Item], search: Search, what: str
) -> tuple[list[Made], bool]:
    """Apply ``work`` to all items on several cores; return the results in order, and whether Ctrl-C interrupted the work.

    ``what`` is the text beside the progress bar.
    """
    made: dict[int, Made] = {}
    with record_interrupts() as interrupted, show_progress(search.progress, float(len(items)), what) as show:
        for number, value in run_in_parallel(work, items, interrupted, n_jobs=search.n_jobs):
            made[number] = value
            show(float(len(made)))
            if interrupted:
                break
    return [made[number] for number in sorted(made)], bool(interrupted)


class _OneThread(ContextDecorator):
    """A context in which linear algebra runs on one thread; several threads of this process may be in it at once.

    The last digits of a sum depend on the number of threads. Where the objective is flat, these digits decide where a search
    ends.
    """

    def __init__(self) -> None:
        self._lock, self._inside = Lock(), 0

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._limits = threadpool_limits(1, user_api="blas")
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                self._limits.restore_original_limits()


ONE_THREAD = _OneThread()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Polished:
    """The answers of the searches from all starts: feasible answers in ``kept``, best first, infeasible answers in ``others``.

    ``done`` is the number of searches. ``begun`` has, as answers, the starts that are feasible before any search.
    """

    kept: tuple[Answer, ...] = ()
    others: tuple[Answer, ...] = ()
    done: int = 0
    interrupted: bool = False
    begun: tuple[Answer, ...] = ()

    def merge(self, other: Polished) -> Polished:
        """Return the answers of two searches, such as for two kinds of linkages, in one record."""
        return Polished(
            kept=self.kept + other.kept,
            others=self.others + other.others,
            done=self.done + other.done,
            interrupted=self.interrupted or other.interrupted,
            begun=self.begun + other.begun,
        )


def infeasible_error(done: Polished) -> InfeasibleError:
    """Return the error for a search without a feasible answer."""
    if not done.others:
        return InfeasibleError("no linkage keeps all bounds and constraints")
    nearest: Answer = min(done.others, key=lambda a: a.violation)
    return InfeasibleError(
        f"no linkage keeps all bounds and constraints: of {len(done.others)} searches the nearest violates "
        f"the {nearest.worst or 'quality'}{f' by {nearest.excess}' if nearest.excess else ''} "
        f"({nearest.status.replace('_', ' ').lower()})"
    )


@ONE_THREAD
def polish(
    normal: Normal,
    limits: Limits,
    starts: Sequence[Start],
    *,
    pivot: PivotUnknown | None = None,
    search: Search = USUAL_SEARCH,
) -> Polished:
    """Optimise from every start; on Ctrl-C return the answers so far, marked as interrupted."""
    worker = Polisher(normal, limits, pivot)

    def spread(name: str, items: Sequence[Any], what: str) -> tuple[list[Answer], bool]:
        cores = search.cores
        # as many pieces for each core, at least three
        pieces = cores * max(3, -(-len(items) // (MOST * cores)))
        size = 1 if cores == 1 else max(1, -(-len(items) // pieces))
        # a polisher holds compiled solvers, which cannot be sent to a process: each part of the work makes its own
        made = (lambda: worker) if cores == 1 else partial(Polisher, normal, limits, pivot)
        step = partial(_call_polisher, name, made)
        parts, interrupted = run_on_cores(step, [items[k : k + size] for k in range(0, len(items), size)], search, what)
        return [answer for part in parts for answer in part], interrupted

    def record(found: Sequence[Answer], kept: Sequence[Answer], interrupted: bool) -> Polished:
        others = tuple(a for a in found if not a.feasible)
        return Polished(kept=tuple(kept), others=others, done=len(found), interrupted=interrupted, begun=tuple(begun))

    begun = feasible_answers([worker.judge_start(start) for start in starts])
    given = [answer for answer in begun if answer.start.given]
    # if enough starts can be refined directly, only a few are fitted by squares; not with a straight part, whose ends need more
    # iterations
    races = normal.outline is not None and normal.quality != "squares" and pivot is None and normal.straight is None
    enough = races and len(begun) >= FITTED
    fitted = starts[: sum(start.given for start in starts) + FITTED] if enough else starts
    found, interrupted = spread("fit", fitted, f"fitting {len(fitted)} starts")
    kept = feasible_answers(found)
    # an interruption after the last search is ignored
    if interrupted and len(found) < len(fitted):
        return record(found, kept, True)
    interrupted = False
    if normal.quality == "squares":
        if limits.bounds_rotations:
            kept = distinct_answers(kept, ONWARDS, pivot)
        kept = [*map(worker.finish_squares, kept[:FINISHED]), *kept[FINISHED:]]
    elif not races:
        best = [*given, *distinct_answers(kept, ONWARDS, pivot)]
        kept, interrupted = spread(
            "minimise_measure", [(answer, ITERATIONS) for answer in best], f"refining the best {len(best)}"
        )
    else:
        begin = feasible_answers([worker.with_measure(answer) for answer in [*kept, *begun]])
        laps = RACE["open area" if normal.quality == "area" and not normal.closed else normal.quality]
        kept, interrupted = _refine_in_laps(spread, begin, given, laps)
    if limits.least is not None and not interrupted:
        best = distinct_answers(feasible_answers(kept) or feasible_answers(found), ONWARDS, pivot)
        kept, interrupted = spread("minimise_objective", best, f"minimising the {limits.least.along.name}")
        found = [*(answer for answer in found if not answer.feasible), *kept] if kept else found
    elif limits.bounds_rotations:
        kept = [answer for answer in kept if worker.judge_start(answer.start).feasible]
    return replace(record(found, feasible_answers(kept), interrupted), done=len(starts))


def _refine_in_laps(
    spread: Callable[[str, Sequence[Any], str], tuple[list[Answer], bool]],
    kept: Sequence[Answer],
    given: Sequence[Answer],
    laps: Sequence[tuple[int, int]],
) -> tuple[list[Answer], bool]:
    """Refine many answers by few iterations each, then the best by more; return the answers, and whether Ctrl-C was pressed.

    The refinement has several laps, and in each lap the best answers take part. ``laps`` has, for each lap, the number of these
    answers and the limit of iterations for each. The guesses ``given`` always take part in the first lap. ``spread`` calls a
    method of `Polisher` for many items.
    """
    for lap, (count, iterations) in enumerate(laps):
        # guesses take part in the first lap however poor they are; answers that do not take part are dropped
        best = distinct_answers([*given, *kept], count + len(given), distance=RACED)
        stage = "refining" if lap else "comparing"
        done, interrupted = spread(
            "minimise_measure", [(answer, iterations) for answer in best], f"{stage} the best {len(best)}"
        )
        if interrupted:
            return [*done, *kept], True
        rest = [answer for answer in kept if answer not in best] if lap else []
        # answers that have reached the same optimum count as one
        kept, given = distinct_answers(feasible_answers([*done, *rest]), len(done) + len(rest), distance=RACED), []
    return list(kept), False


def feasible_answers(answers: Sequence[Answer]) -> list[Answer]:
    """Return the feasible answers, best first."""
    return sorted((a for a in answers if a.feasible), key=lambda a: a.start.quality)


@ONE_THREAD
def _call_polisher(name: str, make: Callable[[], Polisher], items: Sequence[Any]) -> list[Answer]:
    """Call the method ``name`` of the `Polisher` that ``make`` returns for each item, also in another process or thread."""
    method = getattr(make(), name)
    return [method(item) for item in items]


def distinct_answers(
    answers: Sequence[Answer], count: int, pivot: PivotUnknown | None = None, *, distance: float = DIFFERENT
) -> list[Answer]:
    """Return the first ``count`` answers that are distinct: any two differ by at least ``distance`` in a dimension.

    Lengths are compared relative to the longest link.
    """

    def mark(answer: Answer) -> FloatArray:
        q, v = answer.start.q, answer.start.pivot
        largest = q[2:7].max()
        if isinstance(pivot, SliderUnknown):
            # as vectors, because a guide turned by pi is the same guide
            v = np.concatenate([np.cos(v[0]) * v[1:], np.sin(v[0]) * v[1:]])
        if isinstance(pivot, CrankUnknown):
            # the second crank's angle while the first lies along the ground link, independent of whole turns
            turned = gear_turns(pivot.ratio)
            relative = turned[0] * v[1] - turned[1] * q[8]
            v = np.array([v[0], largest * np.cos(relative), largest * np.sin(relative), *v[2:]])
        side = 3.0 * answer.start.branch
        if answer.start.linkage is SliderCrank:
            # without an offset a slider-crank and its mirror image about the guide are the same
            turned = np.exp(1j * q[7])
            v = np.outer((q[2], side * largest), (turned.real, turned.imag)).ravel()
            q, side = np.array([*q[:2], 0.0, *q[3:7], 0.0, q[7] + q[8], *q[9:]]), 0.0
        mark = np.concatenate([q[:7] / largest, np.cos(q[7:]), np.sin(q[7:]), v / largest])
        # the crank phase of an untimed path is no dimension
        if answer.start.rotation is not None:
            mark[[8, 12]] = 0.0
        return np.append(mark, side)

    return keep_distinct(answers, mark, distance, count)


class Polisher:
    """An optimiser for one task; it builds its nonlinear programs when they are first needed."""

    def __init__(self, normal: Normal, limits: Limits, pivot: PivotUnknown | None) -> None:
        self.normal, self.limits, self.pivot = normal, limits, pivot
        few = normal.timed or normal.n <= FEW
        self.by_least_squares = limits.bounds_only and pivot is None and normal.straight is None and few
        self._programs: dict[tuple[str, bool, bool], Program] = {}

    def program(self, objective: Objective, *, exact: bool = False, judged: bool = False) -> Program:
        """Return the program with this objective; see `Statement`. With a fixed pivot ``exact`` has no effect."""
        key = objective, exact and self.pivot is not None, judged
        if key not in self._programs:
            self._programs[key] = Program(self.normal, self.limits, self.pivot, objective, exact=key[1], judged=judged)
        return self._programs[key]

    def fit(self, start: Start) -> Answer:
        """Minimise the squared errors from a start; if precision points are met, then maximise the transmission angle."""
        fitted = self.by_least_squares
        return self.maximise_transmission(
            fit_least_squares(self.normal, self.limits, start) if fitted else self._solve_squares(start)
        )

    def maximise_transmission(self, answer: Answer) -> Answer:
        """Maximise the transmission angle from an answer that meets its precision points; return other answers unchanged."""
        if self.normal.exact and answer.feasible and answer.start.quality < EXACT:
            met = self.program("transmission").solve(answer.start)
            if met.feasible:
                return replace(met, start=replace(met.start, quality=self.program("squares").value(met.start)))
        return answer

    def _solve_squares(self, start: Start) -> Answer:
        """Minimise the squared errors by IPOPT.

        If the region of a pivot consists of several triangles, the program is solved for the triangles nearest to the pivot.
        This is repeated from the best answer until no answer is better.
        """
        program = self.program("squares")
        if all(len(triangles) == 1 for _, triangles in self.limits.regions):
            return program.solve(start)
        best: Answer | None = None
        tried: set[tuple[int, ...]] = set()
        now = start
        while True:
            ways = product(*(order[:PIECES] for order in program.nearest_triangles(now.q)))
            fresh = [way for way in ways if way not in tried]
            tried |= set(fresh)
            answers = [program.solve(now, pieces=way) for way in fresh]
            better = min(answers, key=lambda a: (not a.feasible, a.start.quality), default=None)
            if better is None or (
                best and (best.feasible, -best.start.quality) >= (better.feasible, -better.start.quality)
            ):
                break
            best, now = better, better.start
        assert best is not None
        return best

    def finish_squares(self, answer: Answer) -> Answer:
        """Finish a fit of squared errors: continue an unfinished search, then impose the bounds at the extremes of its result.

        Where the objective is flat, the result of an unfinished search would depend on rounding. For the bounds at extremes see
        `Program.settle_extremes`.
        """
        if self.by_least_squares:
            return answer
        program = self.program("squares")
        if not answer.converged and self.pivot is None:
            longer = program.solve(answer.start, iterations=LONG)
            if longer.feasible and longer.start.quality < answer.start.quality:
                answer = self.maximise_transmission(longer)
        if self.normal.exact:
            return answer
        last = self.program("squares", exact=True)
        return last.settle_extremes(answer, lambda start, places: last.solve(start, places=places))

    def minimise_objective(self, answer: Answer) -> Answer:
        """Minimise, from an answer, the objective `Limits.least`, which replaces the error."""
        program = self.program("least", exact=True)
        size = program.greatest_value(answer.start)
        found = program.solve(answer.start, size=size)
        if not found.feasible:
            found = program.solve(answer.start, size=size, small=True)
        solve: Callable[..., Answer] = partial(program.solve, size=size)
        if self.normal.outline is not None:
            # the error is bounded at the stations first, then along the whole curves
            refinement = Refinement(self.program("least curve", exact=True))
            program = refinement.program

            def solve(start: Start, *, places: Sequence[FloatArray] | None = None) -> Answer:
                return refinement.refine(replace(answer, start=start), places=places, size=size)

            for begin in [found.start, answer.start] if found.feasible else [answer.start]:
                found = solve(begin)
                if found.feasible:
                    break
        if not found.feasible:
            return found
        return program.settle_extremes(found, lambda start, places: solve(start, places=places))

    def with_measure(self, answer: Answer) -> Answer:
        """Return the answer with the area or the greatest distance between its path and the target as its quality."""
        curve, _ = self.refinement.trace(*self.refinement.program.unknowns_and_parameters(answer.start))
        return replace(answer, start=replace(answer.start, quality=self.refinement.measure(curve)))

    def minimise_measure(self, item: tuple[Answer, int]) -> Answer:
        """Minimise the area or the greatest error from an answer; ``item`` is the answer and the limit of iterations."""
        answer, iterations = item
        if self.normal.outline is not None:
            refinement = self.refinement
            found = refinement.refine(answer, iterations=iterations)
            return refinement.program.settle_extremes(
                found, lambda start, places: refinement.refine(replace(answer, start=start), places=places)
            )
        program = self.program("worst", exact=True)
        size = max(program.value(answer.start), 1e-9)

        def solve(start: Start, places: Sequence[FloatArray] | None = None) -> Answer:
            return program.solve(start, size=size, places=places)

        unchanged = replace(answer, start=replace(answer.start, quality=size))
        if self.normal.exact and size**2 < EXACT:
            return unchanged
        found = solve(answer.start)
        if not (found.feasible and found.start.quality < size):
            return unchanged
        return program.settle_extremes(found, solve)

    @cached_property
    def refinement(self) -> Refinement:
        """Return the refinement of an untimed path."""
        return Refinement(self.program("curve", exact=True))

    def judge_start(self, start: Start) -> Answer:
        """Evaluate a start without optimising it; return an answer that says whether it meets every constraint and bound."""
        if self.by_least_squares:
            within = distances_from_bounds(self.normal, self.limits.low, self.limits.high, start).max() <= KEPT
            quality = sum_of_squares(self.normal, start)
            clipped = clip_to_bounds(start.q, self.limits.low, self.limits.high)
            met, begun = within and np.isfinite(quality), replace(start, q=clipped, quality=quality)
            return replace(Answer.for_unjoined_links(start), start=begun, feasible=met)
        objective: Objective = "squares" if self.normal.outline is None else "curve"
        judged = self.limits.way is not None or self.pivot is not None
        return self.program(objective, exact=True, judged=judged).judge_start(start)


def worst_violation(
    solution: Solution, bounds: Mapping[str, tuple[float, float]] | None, constraints: Sequence[Constraint]
) -> str:
    """Return as text the constraint or bound that a linkage violates most, and by how much; empty if it violates none."""
    task, linkage = solution.task, solution.linkage
    normal = normal_form(task)
    ratios = [linkage.pivot.ratio] if isinstance(linkage, FiveBar) else []
    (limits,) = limits_by_kind(task, normal, bounds, constraints, [linkage.kind], ratios)
    pivot = limits.second_crank(normal.unit)
    start = convert_to_start(solution, normal, pivot)
    answer = Polisher(normal, limits, pivot).judge_start(start)
    if answer.feasible:
        return ""
    off = distances_from_bounds(normal, limits.low, limits.high, start)
    if off.max() <= KEPT:
        return f"{answer.worst} by {answer.excess}"
    name = UNKNOWNS[int(off.argmax())]
    over = f"{degrees(off.max()):.3g} deg" if name in ANGLES else f"{1e3 * normal.unit * off.max():.6g} mm"
    return f"bound of {name} by {over}"
