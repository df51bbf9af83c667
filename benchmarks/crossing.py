"""Synthesise targets that cross themselves: compare `synthesize` with a long differential evolution on the area.

    python -m benchmarks.crossing                           # runs all, writes the results, prints the table
    python -m benchmarks.crossing --budget 60 --target eight

Each target is searched for under two constraints: a transmission angle of 40 degrees over a full turn, and a full turn alone.
SciPy's differential evolution has the same unknowns, bounds and constraints as `synthesize`; compiled code computes the areas
of a whole generation at once. It is restarted, alternating the assemblies, until its processor time is over, and each run ends
with a simplex. `analysis.synthesis.evaluate` measures the results of both searches. The table has a row for each target and
constraint.
"""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import count
from math import inf, tau
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.console import Console
from scipy.optimize import OptimizeResult
from threadpoolctl import threadpool_limits

from analysis.numerics.overlap import find_nearest, symmetric_difference
from analysis.synthesis import FullTurn, TargetPath, UntimedPath, evaluate, normal_form, synthesize, turn
from analysis.synthesis.linkage.kernels import coupler_path
from analysis.synthesis.search.fit import cut_into_pieces
from analysis.synthesis.search.program import make_linkage
from analysis.synthesis.task.constraint import USUAL, Constraint
from analysis.synthesis.task.limits import make_limits
from analysis.synthesis.task.task import Normal

from . import tables
from .black_box import PENALTY, BlackBox, evolve, minimise_score

FloatArray = NDArray[np.float64]

RESULTS = Path("out/crossing.csv")
BUDGET = 10.0
#: Number of points of the curves in the differential evolution, generations of one run, and allowed constraint violation.
CURVE, GENERATIONS, KEPT = 120, 800, 1e-4
ASKED: Mapping[str, tuple[Constraint, ...]] = {"40 degrees": USUAL, "full turn": (FullTurn(),)}


def eight(t: FloatArray) -> FloatArray:
    """Return points of Gerono's figure-eight curve, 1 m long and 0.5 m wide, at n parameters t (rad), shape (n, 2)."""
    return np.column_stack([0.5 * np.sin(t), 0.25 * np.sin(2.0 * t)])


def lemniscate(t: FloatArray) -> FloatArray:
    """Return points of Bernoulli's lemniscate, 2 m long, at n parameters t (rad), shape (n, 2)."""
    return np.column_stack([np.cos(t), np.sin(t) * np.cos(t)]) / (1.0 + np.sin(t)[:, None] ** 2)


def limacon(t: FloatArray) -> FloatArray:
    """Return points of a limaçon with an inner loop (m), at n polar angles t (rad), shape (n, 2)."""
    return (0.5 + np.cos(t))[:, None] * np.column_stack([np.cos(t), np.sin(t)])


def targets() -> dict[str, TargetPath]:
    """Return the targets by name; all open targets except the last return to their first point."""
    round_, there = turn(40), np.linspace(0.0, tau, 41)
    s = np.linspace(-1.3, 1.3, 41)
    return {
        "eight": TargetPath(points=eight(round_), closed=True),
        "eight, open": TargetPath(points=eight(there), closed=False),
        "lemniscate": TargetPath(points=lemniscate(round_), closed=True),
        "lemniscate, open": TargetPath(points=lemniscate(there), closed=False),
        "limaçon": TargetPath(points=limacon(round_), closed=True),
        "loop, open": TargetPath(points=np.column_stack([s**3 - s, s**2]), closed=False),
    }


class Row(NamedTuple):
    """Errors of the two searches on a target (m2), and the processor time of `synthesize` (s)."""

    target: str
    asked: str
    ours: float
    evolution: float
    seconds: float


# Evolution

_KERNELS: tuple[Any, ...] = (coupler_path, find_nearest, symmetric_difference)
_path, _nearest, _difference = (njit()(kernel.py_func) for kernel in _KERNELS)


@njit
def _areas(rows, spans, branch, target, middles, lengths, closed, areas):
    """Write the areas between the curves of linkages and a target into ``areas``; infinite if the links do not close.

    Each of ``rows`` is a linkage; ``spans`` are the crank rotations (rad) over which its curve is traced.
    """
    n, m = CURVE, middles.shape[1]
    zero, out, gradient, half = np.zeros(n), np.empty((2, n)), np.empty((2, n)), np.empty((2, n - 1))
    distance, segment, share = np.empty(max(n, m)), np.empty(max(n, m), np.int64), np.empty(max(n, m))
    for row in range(len(rows)):
        at = np.arange(n) * (spans[row] / (n if closed else n - 1))
        _path(np.cos(at), np.sin(at), zero, zero, rows[row], branch, out)
        areas[row] = np.inf
        if not np.isfinite(out.sum()):
            continue
        if closed:
            areas[row] = _difference(out, target, gradient)
            continue
        _nearest(middles, out, False, distance, segment, share)
        total = (distance[:m] * lengths).sum()
        half[:] = 0.5 * (out[:, 1:] + out[:, :-1])
        _nearest(half, target, False, distance, segment, share)
        for k in range(n - 1):
            total += distance[k] * np.hypot(out[0, k + 1] - out[0, k], out[1, k + 1] - out[1, k])
        areas[row] = 0.5 * total


class Evolution:
    """Differential evolution of linkages of one assembly; it minimises the area between a path and the coupler curve."""

    def __init__(self, task: UntimedPath, normal: Normal, box: BlackBox) -> None:
        self.task, self.normal, self.box = task, normal, box
        assert normal.outline is not None
        line, _ = cut_into_pieces(normal.outline, normal.outline_weights, normal.closed)
        self._target = np.ascontiguousarray([normal.outline.real, normal.outline.imag])
        self._middles = np.ascontiguousarray(0.5 * (line[:, 1:] + line[:, :-1]))
        self._lengths = np.hypot(*np.diff(line, axis=1))

    def areas(self, x: FloatArray) -> FloatArray:
        """Return the area for each row of unknowns, in squared units of the normal form."""
        q, areas = np.ascontiguousarray(self.box._linkages(x)[:, :10]), np.empty(len(x))
        spans = np.full(len(x), tau) if self.normal.closed else np.ascontiguousarray(x[:, -1])
        branch = float(self.box.branch)
        _areas(q, spans, branch, self._target, self._middles, self._lengths, self.normal.closed, areas)
        return areas

    def penalised_area(self, x: FloatArray) -> float:
        """Return the area of one linkage plus proportional penalties for violated constraints."""
        if (x < self.box.low).any() or (x > self.box.high).any():
            return inf
        return float(self.areas(x[None, :])[0]) + PENALTY * float(self.box.violations(x[None, :]).clip(min=0.0).sum())

    def error(self, x: FloatArray) -> float:
        """Return the error of one linkage by the task's own measure (m2); infinite if a constraint is violated."""
        if self.box.violations(x[None, :]).max() > KEPT:
            return inf
        start = self.box.answer(OptimizeResult(x=x, success=True, message="", nit=0)).start
        span = tau if self.normal.closed else float(x[-1])
        return evaluate(self.task, make_linkage(start, self.normal), np.linspace(0.0, span, self.normal.n)).error

    def run(self, random: np.random.Generator, has_expired: Callable[[], bool]) -> float:
        """Make one run of evolution until it converges or ``has_expired`` returns true; improve the result by a simplex.

        Returns the least error (m2).
        """
        found = evolve(
            self.box,
            random,
            lambda intermediate_result: has_expired(),
            lambda x: self.areas(np.ascontiguousarray(x)),
            maxiter=GENERATIONS,
            tol=1e-4,
        )
        return min(self.error(found.x), self.error(minimise_score(self.box, found.x, self.penalised_area).x))


def search_with_evolution(task: UntimedPath, constraints: Sequence[Constraint], budget: float) -> float:
    """Return the least error (m2) of all runs of differential evolution within the processor time ``budget`` (s)."""
    normal = normal_form(task)
    limits = make_limits(task, normal, None, constraints)
    searches = [Evolution(task, normal, BlackBox(normal, limits, branch)) for branch in limits.branches]
    for search in searches:
        search.areas(search.box.low[None, :])
    begun, best, runs = process_time(), inf, count()

    def has_expired() -> bool:
        return process_time() - begun > budget

    while not has_expired():
        number = next(runs)
        best = min(best, searches[number % len(searches)].run(np.random.default_rng([0, number]), has_expired))
    return best


def run(name: str, path: TargetPath, asked: str, budget: float) -> Row:
    """Run both searches on a target with the constraints named ``asked``; ``budget`` is the processor time of evolution (s)."""
    task, constraints = UntimedPath(path=path), ASKED[asked]
    with threadpool_limits(1):
        begun = process_time()
        ours = synthesize(task, constraints=constraints).best.error
        seconds = process_time() - begun
        return Row(name, asked, ours, search_with_evolution(task, constraints, budget), seconds)


# Results


def read(path: Path) -> list[Row]:
    """Read the rows of results from a file."""
    rows = ([*row.values()] for row in tables.read(path))
    return [Row(target, asked, *map(float, numbers)) for target, asked, *numbers in rows]


def write(path: Path, rows: Iterable[Row]) -> None:
    """Write the rows of results to a file."""
    headings = ["target", "asked", "synthesize [m2]", "evolution [m2]", "synthesize [s]"]
    tables.write(path, headings, ([*row[:2], *(f"{value:.6g}" for value in row[2:])] for row in rows))


def markdown(rows: Iterable[Row]) -> str:
    """Return the table of results in Markdown."""
    lines = (
        [row.target, row.asked, f"{row.ours:.4g}", f"{row.evolution:.4g}", f"{row.ours / row.evolution - 1.0:+.1%}"]
        for row in rows
    )
    return tables.markdown(["target", "asked", "`synthesize` [m2]", "evolution [m2]", "ours over evolution's"], lines)


def main(path: Path, names: Sequence[str], budget: float) -> None:
    """Run both searches on the targets, write the results and print the table."""
    console, rows = Console(width=120), []
    for name, target in targets().items():
        for asked in ASKED if name in names else ():
            rows.append(run(name, target, asked, budget))
            write(path, rows)
            console.print(markdown(rows[-1:]).splitlines()[-1], highlight=False, markup=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--budget", type=float, default=BUDGET, help="processor time of evolution (s)")
    parser.add_argument("--target", choices=tuple(targets()), action="append", help="run only this target (repeatable)")
    parser.add_argument("--results", type=Path, default=RESULTS, help="CSV file with the results")
    given = parser.parse_args()
    main(given.results, given.target or tuple(targets()), given.budget)
