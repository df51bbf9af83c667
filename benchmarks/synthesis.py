"""Synthesis beside pylinkage's optimisers, SciPy's differential evolution and the thesis's simplex.

    python -m benchmarks.synthesis

Three tables, all in one run:

1. a coupler curve of 72 points and its Jacobian in a compiled loop, beside NumPy over arrays and pylinkage's steps;
2. every problem of chapter VI: time until the goal is reached, and until the error is within 1 % of the best that any search
   of the run found. `synthesize` counts with its whole call, as it comes and with `FEW` candidates and starts. Each other
   search is begun afresh, in turn of either assembly, until the time given to it is over (``--budget``, s) or it has come to
   ours. All have the same unknowns, bounds and constraints, and all are measured alike: where one improves, its clock is
   stopped, the linkage evaluated by the task's own measure, and left out if it violates a constraint;
3. of 40 starts each, with bounds alone, how many reach the optimum, and the time a start takes: exact Jacobians (SciPy's least
   squares, IPOPT) and the simplex.

pylinkage (extra ``bench``) counts link lengths alone as dimensions: `PlacedFourBar` opens the others to its optimisers. They
see the coupler curve by its own compiled solver; the constraints as charges in proportion, as our simplex does; and infinity,
as is its custom, where the links cannot be joined. Its population methods are followed by its Nelder-Mead, as its manual
advises. Its closed-form synthesis of paths takes five points; that of functions knows the phase and no weights, so that it is
tried over `PHASES` phases, on the unweighted function alone. Its swarm takes no seed.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import count
from math import degrees, inf, isfinite, pi, tau
from statistics import median
from time import perf_counter
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from analysis.synthesis import (
    LargestLink,
    Linkage,
    RockerFunction,
    Search,
    TimedPath,
    evaluate,
    normal_form,
    synthesize,
    turn,
)
from analysis.synthesis.black_box import DRAWS, PENALTY, BlackBox, descend, descend_from, evolve
from analysis.synthesis.constraints import Limits, limits_of
from analysis.synthesis.kernels import coupler_path, coupler_path_jacobian
from analysis.synthesis.polish import Polisher, fit_least_squares, quality_of
from analysis.synthesis.published import (
    AREA_N,
    PACKAGING_FLATNESS,
    PACKAGING_ROTATION,
    PACKAGING_TRAVEL,
    PROBLEMS,
    WEIGHT,
    N,
    PublishedProblem,
    ellipse,
)
from analysis.synthesis.scan import scan
from analysis.synthesis.starts import Start, linkage_of, start_of
from analysis.synthesis.tasks import Normal
from linkwork.five_bar import kinematics

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Score = Callable[[FloatArray], float]

#: Time given to each search but ours on each problem (s).
BUDGET = 15.0
#: A search ends when it comes this near to ours: what more it could find is not worth the time.
ENOUGH = 1e-4
#: "Within 1 % of the best".
NEAR = 0.01
#: Starts of the third table.
STARTS = 40
#: Phases over which pylinkage's function generation is tried.
PHASES = 360
REPEATS = 15
#: Least effort of `synthesize` that is timed beside its defaults.
FEW = Search(candidates=1 << 12, starts=4)


# Kernels

_path, _jacobian = (njit(error_model="numpy")(kernel.py_func) for kernel in (coupler_path, coupler_path_jacobian))


@njit
def _curves(repeats, c, s, zero, q, out):
    total = 0.0
    for _ in range(repeats):
        # never the same linkage twice, and a result that is used: nothing to be left out by the compiler
        q[8] += 1e-9
        _path(c, s, zero, zero, q, 1.0, out)
        total += out[0, 0]
    return total


@njit
def _jacobians(repeats, c, s, zero, q, out, jacobian):
    total = 0.0
    for _ in range(repeats):
        q[8] += 1e-9
        _jacobian(c, s, zero, zero, q, 1.0, out, jacobian)
        total += out[0, 0] + jacobian[9, 1, 0]
    return total


def curve_by_numpy(linkage: Linkage, rotation: FloatArray) -> ComplexArray:
    """The coupler curve over arrays, by the plant's own loop closure with NumPy's square root."""
    joined = FunctionType(kinematics.joined.__code__, {"sqrt": np.sqrt, "Position": kinematics.Position})
    q = linkage
    th2 = rotation + q.crank_phase
    c2, s2 = np.cos(th2), np.sin(th2)
    dx, dy = q.ground_length - q.crank_length * c2, -q.crank_length * s2
    g = joined(c2, s2, dx, dy, q.coupler_length, q.rocker_length, float(q.branch))
    point = q.point_distance * np.exp(1j * q.point_angle) * (g.c3 + 1j * g.s3)
    curve: ComplexArray = complex(q.pivot_x, q.pivot_y) + np.exp(1j * q.ground_angle) * (
        q.crank_length * (c2 + 1j * s2) + point
    )
    return curve


def per_call(run: Callable[[int], object], calls: int) -> float:
    """Median time of one call, of `REPEATS` measurements of so many (s)."""
    run(1)
    times = []
    for _ in range(REPEATS):
        begun = perf_counter()
        run(calls)
        times.append((perf_counter() - begun) / calls)
    return median(times)


def kernel_times(linkage: Linkage, n: int = N) -> dict[str, float]:
    """Times of a coupler curve of n points and of its Jacobian (s), ours first."""
    rotation = turn(n)
    c, s, zero = np.cos(rotation), np.sin(rotation), np.zeros(n)
    q, out, jacobian = linkage.vector, np.empty((2, n)), np.empty((12, 2, n))
    times = {
        "compiled, in a compiled loop": per_call(lambda k: _curves(k, c, s, zero, q, out), 20_000),
        "its Jacobian and the curve, in a compiled loop": per_call(
            lambda k: _jacobians(k, c, s, zero, q, out, jacobian), 5_000
        ),
        "NumPy over arrays": per_call(lambda k: [curve_by_numpy(linkage, rotation) for _ in range(k)], 200),
    }
    with suppress(ImportError):
        times.update(_kernel_times_of_pylinkage(linkage, n))
    return times


def _kernel_times_of_pylinkage(linkage: Linkage, n: int) -> dict[str, float]:
    from pylinkage.bridge.solver_conversion import linkage_to_solver_data
    from pylinkage.solver.simulation import simulate

    four_bar = PlacedFourBar.of(linkage, n)
    data = linkage_to_solver_data(four_bar.linkage)
    arrays = (data.constraints, data.joint_types, data.parent_indices, data.constraint_offsets, data.solve_order)

    @njit
    def loop(repeats, positions, constraints, types, parents, offsets, order):
        total = 0.0
        for _ in range(repeats):
            total += simulate(positions, constraints, types, parents, offsets, order, n, 1.0)[0, 4, 0]
        return total

    return {
        "pylinkage's compiled simulate, in a compiled loop": per_call(
            lambda k: loop(k, data.positions, *arrays), 2_000
        ),
        "pylinkage's step_fast": per_call(lambda k: [four_bar.linkage.step_fast(n) for _ in range(k)], 200),
        "pylinkage's step": per_call(lambda k: [list(four_bar.linkage.step(n)) for _ in range(k)], 5),
    }


# A problem, and what is found of it over time


class TimeUp(Exception):
    """A search has used its time, or found enough."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contest:
    """A problem in the form that all searches share.

    It has a `BlackBox` for each assembly, and a plain one that asks nothing of a straight part: a `BlackBox` has its stations
    at equal shares of the length, and asks there for more than the task does.
    """

    problem: PublishedProblem
    normal: Normal
    limits: Limits
    boxes: tuple[BlackBox, ...]
    plain: Mapping[int, BlackBox]

    @classmethod
    def of(cls, problem: PublishedProblem) -> Contest:
        """The contest on a published problem."""
        normal = normal_form(problem.task)
        limits = limits_of(problem.task, normal, problem.bounds, problem.constraints)
        boxes = tuple(BlackBox(normal, limits, branch) for branch in limits.branches)
        plain = {branch: BlackBox(replace(normal, straight=None), limits, branch) for branch in limits.branches}
        return cls(problem=problem, normal=normal, limits=limits, boxes=boxes, plain=plain)

    def error(self, box: BlackBox, x: FloatArray) -> float:
        """Error by the task's own measure, in the unit of print; infinite where a constraint is violated."""
        plain = self.plain[box.branch]
        answer = plain.answer(SimpleNamespace(x=x, success=True, message="", nit=0))
        linkage = linkage_of(answer.start, self.normal)
        if not answer.feasible or (self.normal.straight is not None and not packs(linkage)):
            return inf
        return self.problem.convert(evaluate(self.problem.task, linkage).error)


def packs(linkage: Linkage) -> bool:
    """Whether somewhere within the crank rotation asked the coupler point has the travel and flatness asked, to a degree."""
    x, y = linkage.path(turn(360)).T
    window = (np.arange(360)[:, None] + np.arange(round(degrees(PACKAGING_ROTATION)) + 1)) % 360
    across, travel = y[window], np.abs(x[window] - x[:, None])
    flatness = np.maximum.accumulate(across, axis=1) - np.minimum.accumulate(across, axis=1)
    return bool(((flatness <= PACKAGING_FLATNESS) & (travel >= PACKAGING_TRAVEL)).any())


class Trace:
    """The best so far over the time of a search, its clock stopped while that is measured.

    Parameters
    ----------
    contest : Contest
    budget : float
        Time after which the search ends (s).
    enough : float
        Error at which it ends, in the unit of print.
    """

    def __init__(self, contest: Contest, budget: float, enough: float = -inf) -> None:
        self.contest, self.budget, self.enough = contest, budget, enough
        self.points: list[tuple[float, float]] = []
        self._begun, self._measuring = perf_counter(), 0.0

    @property
    def best(self) -> float:
        """Least error so far, in the unit of print."""
        return self.points[-1][1] if self.points else inf

    def tick(self) -> float:
        """Time that the search has taken (s).

        Raises
        ------
        TimeUp
            If that is all it has.
        """
        seconds = perf_counter() - self._begun - self._measuring
        if seconds > self.budget:
            raise TimeUp
        return seconds

    def offer(self, box: BlackBox, x: FloatArray) -> None:
        """Measure a linkage, and take it down if it is the best.

        Raises
        ------
        TimeUp
            If it is good enough, or the time is over.
        """
        seconds, begun = self.tick(), perf_counter()
        value = self.contest.error(box, x)
        if value < self.best:
            self.points.append((seconds, value))
        self._measuring += perf_counter() - begun
        if value <= self.enough:
            raise TimeUp

    def watched(self, box: BlackBox, score: Score) -> Score:
        """A function to be minimised, each improvement of it offered."""
        least = inf

        def value(x: FloatArray) -> float:
            nonlocal least
            found = score(x)
            if found < least:
                least = found
                self.offer(box, x)
            else:
                self.tick()
            return found

        return value

    def time_to(self, error: float) -> float:
        """When an error was reached (s); infinite if it was not."""
        return next((seconds for seconds, value in self.points if value <= error), inf)


# The other searches: one run each, from a box, with random numbers; `TimeUp` ends them


def by_scipy(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """SciPy's differential evolution over whole generations, as `synthesize` does by the method of that name."""
    evolve(box, random, lambda intermediate_result: trace.offer(box, intermediate_result.x))


def by_simplex(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """The thesis's simplex, from the best of some random linkages."""
    descend(box, random, trace.watched(box, box.charge))


# pylinkage


class PlacedFourBar:
    """pylinkage's four-bar whose dimensions are all unknowns of a problem: place, phase and direction as well.

    pylinkage's optimisers take any container that has its linkage's methods; they count and set what it gives as constraints.

    Parameters
    ----------
    fixed : ndarray, shape (11,)
        Of `constraints.UNKNOWNS`; those that are free are set by `set_constraints`.
    free : ndarray of int
        Their places.
    branch : int
        Assembly: pylinkage goes on from where C is put.
    n : int
        Steps in a turn.
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
    def of(cls, linkage: Linkage, n: int) -> PlacedFourBar:
        """A given linkage."""
        return cls(np.append(linkage.vector, 0.0), np.arange(10), linkage.branch, n)

    def get_constraints(self) -> list[float]:
        """The free unknowns."""
        values: list[float] = self.q[self.free].tolist()
        return values

    def get_coords(self) -> list[tuple[float | None, float | None]]:
        """Places of A, D, B, C, P."""
        coords: list[tuple[float | None, float | None]] = self.linkage.get_coords()
        return coords

    def set_constraints(self, values: Sequence[float]) -> None:
        """Set the free unknowns, and put the joints a step before the start."""
        self.q[self.free] = values
        x, y, l1, l2, l3, l4, r, a1, th20, a2 = self.q[:10].tolist()
        self.linkage.set_constraints([l2, l3, l4, r, a2])
        a = complex(x, y)
        d = a + l1 * np.exp(1j * a1)
        b = a + l2 * np.exp(1j * (a1 + th20 - tau / self.n))
        # C on its side of BD; where the links cannot be joined, pylinkage finds out
        bd = abs(d - b)
        along = 0.5 * (bd * bd + l3 * l3 - l4 * l4) / bd
        c = b + (along + 1j * self.branch * max(l3 * l3 - along * along, 0.0) ** 0.5) * (d - b) / bd
        self.linkage.set_coords([(z.real, z.imag) for z in (a, d, b, c, b)])

    def track(self) -> ComplexArray:
        """Joints A, D, B, C, P over the turn, shape (n, 5), by pylinkage's compiled solver; NaN where it cannot join them."""
        track: ComplexArray = self.linkage.step_fast(self.n) @ np.array([1.0, 1j])
        return track


class PylinkageScore:
    """A problem's quality function and charges on pylinkage's own curve, in the form in which its optimisers take them."""

    def __init__(self, contest: Contest, box: BlackBox) -> None:
        self.normal, self.box = contest.normal, box
        low, high = contest.limits.low, contest.limits.high
        self.four_bar = PlacedFourBar(
            0.5 * (low + high),
            np.nonzero(high > low)[0],
            box.branch,
            # in longer steps pylinkage goes over to the other assembly: it takes the nearer place of C
            self.normal.n * -(-N // self.normal.n) if self.normal.timed else AREA_N,
        )
        # what is asked of the straight part is taken from pylinkage's curve
        self.plain = contest.plain[box.branch]

    def __call__(self, linkage: PlacedFourBar, values: Sequence[float], coords: object = None) -> float:
        """Score to be minimised."""
        x = np.asarray(values, dtype=float)
        if (x < self.box.low).any() or (x > self.box.high).any():
            return inf
        linkage.set_constraints(values)
        track = linkage.track()
        if not np.isfinite(track).all():
            return inf
        quality, excess = self.measured(track[:: len(track) // self.normal.n] if self.normal.timed else track)
        excess += float(np.maximum(self.plain.violations(x[None, :]), 0.0).sum())
        return quality + PENALTY * float(self.normal.weights.sum()) * excess

    def measured(self, track: ComplexArray) -> tuple[float, float]:
        """Weighted squared errors, and by how much the straight part misses what is asked of it."""
        normal = self.normal
        if normal.angle is not None:
            left = np.angle((track[:, 3] - track[:, 1]) / np.exp(1j * normal.angle))
            return float(normal.weights @ left**2), 0.0
        assert normal.points is not None
        if normal.timed:
            return float(normal.weights @ np.abs(track[:, 4] - normal.points) ** 2), 0.0
        return min(self._paired(track[:, 4], way) for way in (1, -1))

    def _paired(self, curve: ComplexArray, way: int) -> tuple[float, float]:
        """The same at equal shares of the lengths of curve and target, as `BlackBox` compares closed paths."""
        normal = self.normal
        points = normal.points
        assert points is not None
        shares = np.cumsum(np.abs(np.diff(np.append(points, points[0]))))
        curve = np.append(curve, curve[0])[::way]
        length = np.append(0.0, np.cumsum(np.abs(np.diff(curve))))
        at = np.append(0.0, shares[:-1]) / shares[-1] * length[-1]
        met = np.interp(at, length, curve)
        excess = 0.0
        straight = normal.straight
        if straight is not None:
            spent = np.diff(np.interp(at[[straight.start, straight.end]], length, np.linspace(0.0, tau, len(curve))))
            excess += max(0.0, float(spent[0]) - straight.rotation)
            line = points[straight.end] - points[straight.start]
            off = (met[straight.start : straight.end + 1] * line.conjugate()).imag / abs(line)
            excess += max(0.0, float(np.ptp(off)) - (straight.flatness or inf))
        return float(normal.weights @ np.abs(met - points) ** 2), excess


def _by_pylinkage(trace: Trace, box: BlackBox, *stages: tuple[Callable[..., Any], dict[str, Any]]) -> None:
    from pylinkage.optimization import chain_optimizers

    score = PylinkageScore(trace.contest, box)
    watched = trace.watched(box, lambda x: score(score.four_bar, x.tolist()))
    chain_optimizers(
        lambda linkage, values, coords: watched(np.asarray(values)),
        score.four_bar,
        stages,
        order_relation=min,
        verbose=False,
    )


def by_swarm(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """pylinkage's particle swarm and, from its best, Nelder-Mead; settings as they come."""
    from pylinkage.optimization import minimize_linkage, particle_swarm_optimization

    bounds = (box.low, box.high)
    _by_pylinkage(trace, box, (particle_swarm_optimization, {"bounds": bounds}), (minimize_linkage, {}))


def by_pylinkage_evolution(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """pylinkage's differential evolution and, from its best, Nelder-Mead; settings as they come."""
    from pylinkage.optimization import differential_evolution_optimization, minimize_linkage

    settings = {"bounds": (box.low, box.high), "seed": int(random.integers(1 << 31))}
    _by_pylinkage(trace, box, (differential_evolution_optimization, settings), (minimize_linkage, {}))


def by_pylinkage_simplex(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """pylinkage's Nelder-Mead, from the best of as many random linkages as our simplex; settings as they come."""
    from pylinkage.optimization import minimize_linkage

    score = PylinkageScore(trace.contest, box)
    draws = random.uniform(box.low, box.high, (DRAWS, len(box.low)))
    first = min(draws.tolist(), key=lambda x: score(score.four_bar, x))
    _by_pylinkage(trace, box, (minimize_linkage, {"x0": first}))


def by_freudenstein(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """pylinkage's function generation, which solves Freudenstein's equation by least squares, at every phase; once."""
    from pylinkage.synthesis import function_generation

    task = trace.contest.problem.task
    assert isinstance(task, RockerFunction)
    angle, rotation = np.asarray(task.angle), np.asarray(task.rotation)
    low, high = trace.contest.limits.low, trace.contest.limits.high
    free = np.nonzero(high > low)[0]
    for phase in np.linspace(-pi, pi, PHASES, endpoint=False).tolist():
        pairs = list(zip((rotation + phase).tolist(), angle.tolist()))
        for found in function_generation(pairs, ground_length=float(low[2])).raw_solutions:
            q = 0.5 * (low + high)
            q[3:6] = found.crank_length, found.coupler_length, found.rocker_length
            q[8] = phase
            for other in trace.contest.boxes:
                trace.offer(other, q[free])
    raise TimeUp


BlackBoxSearch = Callable[[Trace, BlackBox, np.random.Generator], None]

SEARCHES: dict[str, BlackBoxSearch] = {
    "SciPy's differential evolution": by_scipy,
    "simplex, many starts (the thesis)": by_simplex,
    "pylinkage, particle swarm": by_swarm,
    "pylinkage, differential evolution": by_pylinkage_evolution,
    "pylinkage, Nelder-Mead, many starts": by_pylinkage_simplex,
}


def searched(search: BlackBoxSearch, contest: Contest, budget: float, enough: float) -> Trace:
    """Runs of a search, in turn of either assembly, until its time is over or it has found enough."""
    trace = Trace(contest, budget, enough)
    with suppress(TimeUp):
        for number in count():
            search(trace, contest.boxes[number % len(contest.boxes)], np.random.default_rng([0, number]))
    return trace


def ours(contest: Contest, search: Search) -> Trace:
    """`synthesize`, its answer at the end of the call."""
    problem = contest.problem
    trace = Trace(contest, inf)
    begun = perf_counter()
    result = synthesize(problem.task, problem.bounds, problem.constraints, search=search)
    trace.points.append((perf_counter() - begun, problem.convert(result.best.error)))
    return trace


def contested(contest: Contest, budget: float) -> dict[str, Trace]:
    """Every search on a problem, ours first; those of pylinkage left out where it is not installed."""
    traces = {
        "synthesize": ours(contest, Search()),
        "synthesize, 2 cores": ours(contest, Search(n_jobs=2)),
        f"synthesize, {FEW.starts} starts": ours(contest, FEW),
    }
    enough = (1.0 + ENOUGH) * min(trace.best for trace in traces.values())
    searches = dict(SEARCHES)
    task = contest.problem.task
    if isinstance(task, RockerFunction) and np.ptp(np.asarray(task.weights)) == 0.0:
        searches[f"pylinkage, function generation, {PHASES} phases"] = by_freudenstein
    for name, search in searches.items():
        with suppress(ImportError):
            traces[name] = searched(search, contest, budget, enough)
    return traces


# Starts


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Of the runs of a method from some starts: their qualities, and the mean time of one (s)."""

    method: str
    qualities: tuple[float, ...]
    seconds: float


def convergence(weighted: bool, scanned: bool, number: int = STARTS) -> list[Statistics]:
    """Ellipse a with bounds alone, from starts of the scan or from the best of some random linkages each."""
    phi = turn(N)
    weights = np.where((np.degrees(phi) >= 60.0) & (np.degrees(phi) <= 260.0), WEIGHT, 1.0) if weighted else np.ones(N)
    task = TimedPath(points=ellipse(10.0, N), weights=weights)
    normal = normal_form(task)
    largest = LargestLink(length=PROBLEMS["ellipse-a"].linkage.largest_link)
    limits = limits_of(task, normal, None, (largest,))
    boxes = {branch: BlackBox(normal, limits, branch) for branch in limits.branches}
    if scanned:
        starts = scan(normal, limits, seed=0, candidates=1 << 16, starts=number)
    else:
        starts = list(_random_starts(boxes, normal, number))
    program = Polisher(normal, limits, None).program("squares")
    free = np.nonzero(limits.high > limits.low)[0]

    def simplex(start: Start) -> float:
        box = boxes[start.branch]
        first = np.clip(start.q[free], box.low, box.high)
        # angles within the turn that the box has
        first[-3:] = (start.q[free][-3:] + pi) % tau - pi
        return float(box.quality(descend_from(box, first, box.charge).x[None, :])[0])

    runs: dict[str, Callable[[Start], float]] = {
        "least squares, exact Jacobian": lambda start: fit_least_squares(normal, limits, start).start.quality,
        "IPOPT, exact derivatives": lambda start: quality_of(normal, program.solve(start).start),
        "simplex": simplex,
    }
    found = []
    for method, run in runs.items():
        run(starts[0])
        begun = perf_counter()
        qualities = tuple(run(start) for start in starts)
        found.append(Statistics(method=method, qualities=qualities, seconds=(perf_counter() - begun) / len(starts)))
    return found


def _random_starts(boxes: dict[int, BlackBox], normal: Normal, number: int) -> Iterator[Start]:
    random = np.random.default_rng(0)
    for k in range(number):
        box = list(boxes.values())[k % len(boxes)]
        draws = random.uniform(box.low, box.high, (DRAWS, len(box.low)))
        best = draws[np.argmin(box.charged(draws))]
        answer = box.answer(SimpleNamespace(x=best, success=True, message="", nit=0))
        yield start_of(linkage_of(answer.start, normal), normal)


# Tables


def kernel_table() -> Table:
    """The first table."""
    times = kernel_times(PROBLEMS["ellipse-a"].linkage)
    table = Table(title=f"coupler curve of {N} points")
    for heading in ("", "microseconds", "times the compiled curve"):
        table.add_column(heading, justify="right" if heading else "left")
    first = next(iter(times.values()))
    for name, seconds in times.items():
        table.add_row(name, f"{1e6 * seconds:.2f}", f"{seconds / first:.1f}")
    return table


def contest_table(names: Sequence[str], budget: float, console: Console) -> Table:
    """The second table."""
    table = Table(
        title=f"problems of chapter VI; {budget:g} s for each search but ours; one core but where two are named"
    )
    for heading in ("problem", "search", "error", "s to the goal", "s to 1 % of the best", "times synthesize"):
        table.add_column(heading, justify="left" if heading in ("problem", "search") else "right")
    for name in names:
        problem = PROBLEMS[name]
        traces = contested(Contest.of(problem), budget)
        best = min(trace.best for trace in traces.values())
        first = next(iter(traces.values())).time_to((1.0 + NEAR) * best)
        title = f"{name}: goal {problem.goal:g} {problem.unit}"
        for search, trace in traces.items():
            near = trace.time_to((1.0 + NEAR) * best)
            table.add_row(
                title,
                search,
                f"{trace.best:.4g}" if isfinite(trace.best) else "none feasible",
                _seconds(trace.time_to(problem.goal)),
                _seconds(near),
                f"{near / first:.2f}" if isfinite(near / first) else "",
            )
            title = ""
        table.add_section()
        console.print(f"{name} done", highlight=False)
    return table


def _seconds(value: float) -> str:
    return f"{value:.2f}" if isfinite(value) else "not reached"


def start_table() -> Table:
    """The third table."""
    table = Table(title=f"ellipse a with bounds alone, {STARTS} starts")
    for heading in ("path", "starts", "method", "at the optimum", "ms a start", "times least squares"):
        table.add_column(heading, justify="left" if heading in ("path", "starts", "method") else "right")
    for weighted in (False, True):
        cases = {kind: convergence(weighted, kind == "scan") for kind in ("scan", "random")}
        best = min(q for found in cases.values() for s in found for q in s.qualities)
        for kind, found in cases.items():
            for s in found:
                reached = sum(q <= (1.0 + NEAR) * best for q in s.qualities)
                table.add_row(
                    f"weighted {WEIGHT:g} to 1" if weighted else "unweighted",
                    kind,
                    s.method,
                    f"{reached} of {len(s.qualities)}",
                    f"{1e3 * s.seconds:.1f}",
                    f"{s.seconds / found[0].seconds:.1f}",
                )
            table.add_section()
    return table


def main(budget: float = BUDGET, names: Sequence[str] = tuple(PROBLEMS)) -> None:
    """Measure and print."""
    console = Console(width=150)
    begun = perf_counter()
    console.print(kernel_table())
    # machine code, CasADi and the workers are loaded before the clock
    for cores in (1, 2):
        ours(Contest.of(PROBLEMS["ellipse-a"]), Search(n_jobs=cores))
    console.print(contest_table(names, budget, console))
    console.print(start_table())
    try:
        import pylinkage

        console.print(f"pylinkage {pylinkage.__version__}", highlight=False)
    except ImportError:
        console.print("left out, not installed (extra 'bench'): pylinkage", highlight=False)
    console.print(f"{perf_counter() - begun:.0f} s in all", highlight=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--budget", type=float, default=BUDGET, help="time of each search but ours on each problem (s)")
    parser.add_argument("--problem", choices=tuple(PROBLEMS), action="append", help="this problem alone (repeatable)")
    arguments = parser.parse_args()
    main(arguments.budget, arguments.problem or tuple(PROBLEMS))
