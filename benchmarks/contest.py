"""Define targets of the race in the form that all searches share, and the searches other than `synthesize`.

All searches have the same unknowns, bounds and constraints and the same measure: when a search improves, its clock is stopped
and the linkage is evaluated by the task's own measure, unless it violates a constraint.

pylinkage (extra ``bench``) optimises link lengths only: `PlacedFourBar` gives its optimisers the other dimensions. These
optimisers minimise a score of the coupler curve of pylinkage's own compiled solver. Violated constraints have proportional
penalties, as for our simplex; the score is infinite if the links cannot be joined. pylinkage's population methods are followed
by its Nelder-Mead, as its manual advises. Its particle swarm takes no seed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import count
from math import inf, log, tau
from time import process_time
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.numerics.overlap import symmetric_difference
from analysis.studies.youssef.problems import AREA_N, N
from analysis.synthesis import Linkage, evaluate, normal_form, turn
from analysis.synthesis.search.program import make_linkage
from analysis.synthesis.task.limits import Limits, make_limits
from analysis.synthesis.task.task import Normal

from .black_box import DRAWS, PENALTY, BlackBox, evolve, minimise_score
from .targets import Target

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Score = Callable[[FloatArray], float]

#: Least relative improvement of a score for which a linkage is measured, because measuring takes long.
SLIGHT = 1e-4
#: Number of population sizes of the evolution strategy, each twice the one before, until it starts again with the first.
DOUBLED = 8

# A target, and the progress of a search


class TimeUp(Exception):
    """A search has used up its time."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contest:
    """A target in the form that all searches share, with a `BlackBox` for each assembly.

    With ``on_area``, searches for a path whose measure is the area first use stations at equal shares of the length, and then
    minimise the area itself.
    """

    target: Target
    normal: Normal
    limits: Limits
    boxes: tuple[BlackBox, ...]
    on_area: bool

    @classmethod
    def from_target(cls, target: Target) -> Contest:
        """Return the contest for a target."""
        normal = normal_form(target.task)
        limits = make_limits(target.task, normal, target.bounds, target.constraints)
        boxes = tuple(BlackBox(normal, limits, branch) for branch in limits.branches)
        return cls(target=target, normal=normal, limits=limits, boxes=boxes, on_area=normal.quality == "area")

    def area(self, curve: ComplexArray) -> float:
        """Return the area between a closed curve and the target, in squared units of the normal form."""
        assert self.normal.outline is not None
        place, target = (np.ascontiguousarray([z.real, z.imag]) for z in (curve, self.normal.outline))
        return float(symmetric_difference(place, target, np.empty_like(place)))

    def unknowns(self, x: FloatArray) -> FloatArray:
        """Return the values of all `constraints.UNKNOWNS`, given the free ones."""
        q = self.limits.low.copy()
        q[self.limits.high > self.limits.low] = x
        return q

    def penalised_area(self, box: BlackBox, x: FloatArray) -> float:
        """Return the area of one linkage plus proportional penalties for violated constraints."""
        if (x < box.low).any() or (x > box.high).any():
            return inf
        curve = Linkage.from_vector(self.unknowns(x)[:10], box.branch).path(turn(AREA_N)) @ np.array([1.0, 1j])
        return self.area(curve) + self.penalty(box, x) if np.isfinite(curve).all() else inf

    def penalty(self, box: BlackBox, x: FloatArray) -> float:
        """Return the penalty to add to an area: `PENALTY` times the sum of the constraint violations."""
        return PENALTY * float(np.maximum(box.violations(x[None, :]), 0.0).sum())

    def error(self, box: BlackBox, x: FloatArray) -> float:
        """Return the error by the task's own measure, in SI; infinite if a constraint is violated."""
        answer = box.answer(SimpleNamespace(x=x, success=True, message="", nit=0))
        return evaluate(self.target.task, make_linkage(answer.start, self.normal)).error if answer.feasible else inf


class Trace:
    """The best error of a search as a function of its processor time; the search ends after the time ``budget`` (s).

    The clock is stopped while a linkage is measured.
    """

    def __init__(self, contest: Contest, budget: float) -> None:
        self.contest, self.budget = contest, budget
        self.points: list[tuple[float, float]] = []
        self._begun, self._measuring = process_time(), 0.0

    @property
    def best(self) -> float:
        """Least error so far, in SI; infinite if there is none."""
        return self.points[-1][1] if self.points else inf

    def tick(self) -> float:
        """Return the time that the search has taken so far (s); raise TimeUp if its time is over."""
        seconds = process_time() - self._begun - self._measuring
        if seconds > self.budget:
            raise TimeUp
        return seconds

    def record_if_best(self, box: BlackBox, x: FloatArray) -> None:
        """Measure a linkage, and record its error with the time if it is the least so far; raise `TimeUp` if time is over."""
        seconds, begun = self.tick(), process_time()
        value = self.contest.error(box, x)
        if value < self.best:
            self.points.append((seconds, value))
        self._measuring += process_time() - begun

    def watch(self, box: BlackBox, score: Score) -> Score:
        """Wrap a function to be minimised: a linkage is measured whenever it improves the function by more than `SLIGHT`."""
        least = inf

        def value(x: FloatArray) -> float:
            nonlocal least
            found = score(x)
            if found < (1.0 - SLIGHT) * least:
                least = found
                self.record_if_best(box, x)
            else:
                self.tick()
            return found

        return value

    def least_error(self, seconds: float) -> float:
        """Return the least error within a time (s), in SI; infinite if nothing was found by then."""
        return min((value for passed, value in self.points if passed <= seconds), default=inf)


# The other searches: each function makes one run with random numbers; `TimeUp` ends it


def search_with_scipy(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """Run SciPy's differential evolution over whole generations."""
    found = evolve(box, random, lambda intermediate_result: trace.record_if_best(box, intermediate_result.x))
    if trace.contest.on_area:
        minimise_score(box, found.x, trace.watch(box, partial(trace.contest.penalised_area, box)))


def search_with_cma(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """Run Hansen's evolution strategy (package ``cma``) on each assembly, several times with a doubled population."""
    import cma

    contest = trace.contest
    n = len(box.low)

    def run(
        box: BlackBox, first: FloatArray, step: float, members: int, score: Callable[[FloatArray], FloatArray]
    ) -> FloatArray:
        settings = {"popsize": members, "seed": int(random.integers(1, 1 << 31)), "verbose": -9, "bounds": [0.0, 1.0]}
        strategy, least, width = cma.CMAEvolutionStrategy(first, step, settings), inf, box.high - box.low
        while not strategy.stop():
            drawn = strategy.ask()
            rows = box.low + np.array(drawn) * width
            scores = score(rows)
            strategy.tell(drawn, scores.tolist())
            if scores.min() < (1.0 - SLIGHT) * least:
                least = scores.min()
                trace.record_if_best(box, rows[scores.argmin()])
            trace.tick()
        return np.asarray(strategy.result.xbest)

    members = int(4 + 3 * log(n))
    for doubled in range(DOUBLED):
        for own in contest.boxes:
            best = run(own, random.uniform(size=n), 0.3, members << doubled, own.penalised_qualities)
            if contest.on_area:
                charged = partial(contest.penalised_area, own)
                run(own, best, 0.01, members, lambda rows, charged=charged: np.array([charged(x) for x in rows]))


# pylinkage


class PlacedFourBar:
    """pylinkage's four-bar with all unknowns of a problem as dimensions, including place, phase and direction.

    pylinkage's optimisers accept any object that has the methods of its linkages. They call `set_constraints` with values in
    the form that `get_constraints` returns.

    ``fixed``, shape (11,), are the values of `constraints.UNKNOWNS`, of which `set_constraints` sets those with the indices
    ``free``. ``branch`` is the assembly (pylinkage itself continues from the position of C), and ``n`` the number of steps in a
    turn.
    """

    def __init__(self, fixed: FloatArray, free: NDArray[np.intp], branch: int, n: int) -> None:
        from pylinkage.actuators import Crank
        from pylinkage.components import Ground
        from pylinkage.dyads import FixedDyad, RRRDyad
        from pylinkage.simulation import Linkage as Simulated

        self.q, self.free, self.branch, self.n = fixed.copy(), free, branch, n
        a, d = Ground(0.0, 0.0), Ground(1.0, 0.0)
        crank = Crank(a, 0.5, angular_velocity=tau / n)
        rocker = RRRDyad(crank.output, d, 1.0, 1.0)
        self.linkage = Simulated([a, d, crank, rocker, FixedDyad(crank.output, rocker, 1.0, 0.0)])
        self.set_constraints(self.get_constraints())

    @classmethod
    def from_linkage(cls, linkage: Linkage, n: int) -> PlacedFourBar:
        """Return the four-bar of a given linkage, with n steps in a turn."""
        return cls(np.append(linkage.vector, 0.0), np.arange(10), linkage.branch, n)

    def get_constraints(self) -> list[float]:
        """Return the values of the free unknowns."""
        return self.q[self.free].tolist()

    def get_coords(self) -> list[tuple[float | None, float | None]]:
        """Return the positions of A, D, B, C, P."""
        return self.linkage.get_coords()

    def set_constraints(self, values: Sequence[float]) -> None:
        """Set the free unknowns, and put the joints at their positions one step before the start."""
        self.q[self.free] = values
        x, y, l1, l2, l3, l4, r, a1, th20, a2 = self.q[:10].tolist()
        self.linkage.set_constraints([l2, l3, l4, r, a2])
        a = complex(x, y)
        d = a + l1 * np.exp(1j * a1)
        b = a + l2 * np.exp(1j * (a1 + th20 - tau / self.n))
        # put C on the side of BD of its assembly; pylinkage finds out whether the links can be joined
        bd = abs(d - b)
        along = 0.5 * (bd * bd + l3 * l3 - l4 * l4) / bd
        c = b + (along + 1j * self.branch * max(l3 * l3 - along * along, 0.0) ** 0.5) * (d - b) / bd
        self.linkage.set_coords([(z.real, z.imag) for z in (a, d, b, c, b)])

    def track(self) -> ComplexArray:
        """Return A, D, B, C, P over the turn by pylinkage's compiled solver, shape (n, 5); NaN if the links do not close."""
        return self.linkage.step_fast(self.n) @ np.array([1.0, 1j])


class PylinkageScore:
    """Quality function and penalties of a problem, in the form that pylinkage's optimisers take.

    The coupler curve is that of pylinkage's solver.
    """

    def __init__(self, contest: Contest, box: BlackBox) -> None:
        self.contest, self.normal, self.box = contest, contest.normal, box
        low, high = contest.limits.low, contest.limits.high
        # with longer steps pylinkage may change to the other assembly, because it takes the nearer position of C
        steps = AREA_N
        if self.normal.rotation is not None:
            own = round(tau / float(np.abs(np.diff(self.normal.rotation)).min()))
            steps = own * -(-N // own)
            self.stations = np.rint(self.normal.rotation * steps / tau).astype(int) % steps
        self.four_bar = PlacedFourBar(0.5 * (low + high), np.nonzero(high > low)[0], box.branch, steps)

    def __call__(self, linkage: PlacedFourBar, values: Sequence[float], coords: object = None) -> float:
        """Return the penalised quality of the four-bar with these values."""
        x = np.asarray(values, dtype=float)
        if (x < self.box.low).any() or (x > self.box.high).any():
            return inf
        linkage.set_constraints(values)
        track = linkage.track()
        if not np.isfinite(track).all():
            return inf
        at = track[self.stations] if self.normal.timed else track
        return self.errors(at, linkage.q[10]) + float(self.normal.weights.sum()) * self.contest.penalty(self.box, x)

    def penalised_area(self, linkage: PlacedFourBar, values: Sequence[float], coords: object = None) -> float:
        """Return `Contest.penalised_area` on the curve of pylinkage's solver."""
        x = np.asarray(values, dtype=float)
        if (x < self.box.low).any() or (x > self.box.high).any():
            return inf
        linkage.set_constraints(values)
        curve = linkage.track()[:, 4]
        return self.contest.area(curve) + self.contest.penalty(self.box, x) if np.isfinite(curve).all() else inf

    def errors(self, track: ComplexArray, mounting: float) -> float:
        """Return the weighted sum of squared errors.

        ``track`` has the joints at the stations, or over the whole turn if the path is untimed. ``mounting`` is the angle (rad)
        at which the output of a rocker function is mounted on the rocker.
        """
        normal = self.normal
        if normal.angle is not None:
            left = np.angle((track[:, 3] - track[:, 1]) * np.exp(1j * (mounting - normal.angle)))
            return float(normal.weights @ left**2)
        assert normal.points is not None
        if normal.timed:
            return float(normal.weights @ np.abs(track[:, 4] - normal.points) ** 2)
        curve = np.append(track[:, 4], track[0, 4])
        # in both directions of travel
        return min(self._errors_at_equal_shares(closed, normal.points) for closed in (curve, curve[::-1]))

    def _errors_at_equal_shares(self, curve: ComplexArray, points: ComplexArray) -> float:
        """Return the errors of a closed curve at equal shares of the lengths of curve and target."""
        shares = np.cumsum(np.abs(np.diff(np.append(points, points[0]))))
        length = np.append(0.0, np.cumsum(np.abs(np.diff(curve))))
        at = np.append(0.0, shares[:-1]) / shares[-1] * length[-1]
        return float(self.normal.weights @ np.abs(np.interp(at, length, curve) - points) ** 2)


def _search_with_pylinkage(trace: Trace, box: BlackBox, *stages: tuple[Callable[..., Any], dict[str, Any]]) -> None:
    """Run optimisers of pylinkage one after another; if the measure is an area, its Nelder-Mead finally minimises the area."""
    from pylinkage.optimization import chain_optimizers, minimize_linkage

    score = PylinkageScore(trace.contest, box)

    def watch_score(function: Callable[..., float]) -> Callable[..., float]:
        value = trace.watch(box, lambda x: function(score.four_bar, x.tolist()))
        return lambda linkage, values, coords: value(np.asarray(values))

    if trace.contest.on_area:
        stages = (*stages, (minimize_linkage, {"eval_func": watch_score(score.penalised_area)}))
    chain_optimizers(watch_score(score), score.four_bar, stages, order_relation=min, verbose=False)


def search_with_swarm(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """Run pylinkage's particle swarm and, from its best linkage, its Nelder-Mead, with default settings."""
    from pylinkage.optimization import minimize_linkage, particle_swarm_optimization

    bounds = (box.low, box.high)
    _search_with_pylinkage(trace, box, (particle_swarm_optimization, {"bounds": bounds}), (minimize_linkage, {}))


def search_with_pylinkage_simplex(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """Run pylinkage's Nelder-Mead with default settings from the best of `DRAWS` random linkages, as our simplex does."""
    from pylinkage.optimization import minimize_linkage

    score = PylinkageScore(trace.contest, box)
    draws = random.uniform(box.low, box.high, (DRAWS, len(box.low)))
    first = min(draws.tolist(), key=lambda x: score(score.four_bar, x))
    _search_with_pylinkage(trace, box, (minimize_linkage, {"x0": first}))


BlackBoxSearch = Callable[[Trace, BlackBox, np.random.Generator], None]


def run_search(search: BlackBoxSearch, contest: Contest, budget: float) -> Trace:
    """Repeat a search, alternating the assemblies, until its time is over; return its trace."""
    trace = Trace(contest, budget)
    with suppress(TimeUp):
        for number in count():
            search(trace, contest.boxes[number % len(contest.boxes)], np.random.default_rng([0, number]))
    return trace
