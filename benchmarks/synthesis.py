"""Measure the synthesis: its kernels, its time on the problems of Youssef's chapter VI, and the starts that it needs.

    python -m benchmarks.synthesis

Three tables, all in one run:

1. the time of a coupler curve of 72 points and of its Jacobian in a compiled loop, compared with NumPy over arrays and with
   pylinkage's steps;
2. for every problem of chapter VI, the error and the time of a call of `synthesize`, with its default settings, on two cores,
   and with the fewer candidates and starts of `FEW` (`benchmarks.race` compares it with other searches);
3. how many of 40 starts reach the optimum, with bounds alone, and the time of a start: with exact Jacobians (SciPy's least
   squares, IPOPT) and with the simplex.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import pi, tau
from statistics import median
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from analysis.numerics.tracing import rebind_functions
from analysis.studies.youssef.problems import PROBLEMS, WEIGHT, N, ellipse
from analysis.synthesis import LargestLink, Linkage, Search, TimedPath, normal_form, synthesize, turn
from analysis.synthesis.linkage.kernels import coupler_path, coupler_path_jacobian
from analysis.synthesis.search.fit import fit_least_squares, sum_of_squares
from analysis.synthesis.search.polish import Polisher
from analysis.synthesis.search.program import Start, make_linkage, make_start
from analysis.synthesis.search.scan import scan
from analysis.synthesis.task.limits import make_limits
from analysis.synthesis.task.task import Normal
from linkwork.five_bar import kinematics

from . import tables
from .black_box import DRAWS, BlackBox, minimise_score
from .contest import PlacedFourBar

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Fraction above the best error that counts as "within 1 % of the best".
NEAR = 0.01
#: Number of starts for the third table.
STARTS = 40
REPEATS = 15
#: Settings of a shorter call of `synthesize`, and the settings of the second table by heading.
FEW = Search(candidates=1 << 12, starts=4)
SETTINGS = {"defaults": Search(), "2 cores": Search(n_jobs=2), f"{FEW.starts} starts": FEW}


# Kernels

_KERNELS: tuple[Any, ...] = (coupler_path, coupler_path_jacobian)
_path, _jacobian = (njit(error_model="numpy")(kernel.py_func) for kernel in _KERNELS)


@njit
def _curves(repeats, c, s, zero, q, out):
    total = 0.0
    for _ in range(repeats):
        # the linkage changes each time and the result is used, so that the compiler cannot drop the call
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
    """Compute the coupler curve over arrays, by the five-bar model's loop closure with NumPy's square root."""
    close_loop = rebind_functions((kinematics,), {"sqrt": np.sqrt}).find(kinematics.close_loop)
    q = linkage
    th2 = rotation + q.crank_phase
    c2, s2 = np.cos(th2), np.sin(th2)
    dx, dy = q.ground_length - q.crank_length * c2, -q.crank_length * s2
    g = close_loop(c2, s2, dx, dy, q.coupler_length, q.rocker_length, float(q.branch))
    point = q.point_distance * np.exp(1j * q.point_angle) * (g.c3 + 1j * g.s3)
    return complex(q.pivot_x, q.pivot_y) + np.exp(1j * q.ground_angle) * (q.crank_length * (c2 + 1j * s2) + point)


def time_per_call(run: Callable[[int], object], calls: int) -> float:
    """Return the median time of one call (s), from `REPEATS` measurements; ``run`` makes the given number of calls."""
    run(1)
    times = []
    for _ in range(REPEATS):
        begun = perf_counter()
        run(calls)
        times.append((perf_counter() - begun) / calls)
    return median(times)


def kernel_times(linkage: Linkage) -> dict[str, float]:
    """Return the times (s) of a coupler curve of N points and of its Jacobian, by method, ours first."""
    rotation = turn(N)
    c, s, zero = np.cos(rotation), np.sin(rotation), np.zeros(N)
    q, out, jacobian = linkage.vector, np.empty((2, N)), np.empty((12, 2, N))
    times = {
        "compiled, in a compiled loop": time_per_call(lambda k: _curves(k, c, s, zero, q, out), 20_000),
        "its Jacobian and the curve, in a compiled loop": time_per_call(
            lambda k: _jacobians(k, c, s, zero, q, out, jacobian), 5_000
        ),
        "NumPy over arrays": time_per_call(lambda k: [curve_by_numpy(linkage, rotation) for _ in range(k)], 200),
    }
    with suppress(ImportError):
        times.update(_kernel_times_of_pylinkage(linkage))
    return times


def _kernel_times_of_pylinkage(linkage: Linkage) -> dict[str, float]:
    from pylinkage.bridge.solver_conversion import linkage_to_solver_data
    from pylinkage.solver.simulation import simulate

    four_bar = PlacedFourBar.from_linkage(linkage, N)
    data = linkage_to_solver_data(four_bar.linkage)
    arrays = (data.constraints, data.joint_types, data.parent_indices, data.constraint_offsets, data.solve_order)

    @njit
    def loop(repeats, positions, constraints, types, parents, offsets, order):
        total = 0.0
        for _ in range(repeats):
            total += simulate(positions, constraints, types, parents, offsets, order, N, 1.0)[0, 4, 0]
        return total

    return {
        "pylinkage's compiled simulate, in a compiled loop": time_per_call(
            lambda k: loop(k, data.positions, *arrays), 2_000
        ),
        "pylinkage's step_fast": time_per_call(lambda k: [four_bar.linkage.step_fast(N) for _ in range(k)], 200),
        "pylinkage's step": time_per_call(lambda k: [list(four_bar.linkage.step(N)) for _ in range(k)], 5),
    }


# Starts


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """Values of the quality function that a method reaches from several starts, and the mean time of a run (s)."""

    method: str
    qualities: tuple[float, ...]
    seconds: float


def convergence(weighted: bool, scanned: bool, number: int = STARTS) -> list[Statistics]:
    """Fit ellipse a, with bounds only, from many starts by each method; return the statistics of the methods.

    With ``scanned`` the starts come from the scan of `synthesize`; otherwise each is the best of some random linkages.
    """
    phi = turn(N)
    weights = np.where((np.degrees(phi) >= 60.0) & (np.degrees(phi) <= 260.0), WEIGHT, 1.0) if weighted else np.ones(N)
    task = TimedPath(points=ellipse(10.0, N), weights=weights)
    normal = normal_form(task)
    largest = LargestLink(length=PROBLEMS["ellipse-a"].linkage.largest_link)
    limits = make_limits(task, normal, None, (largest,))
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
        # angles are wrapped into the turn that the box allows
        first[-3:] = (start.q[free][-3:] + pi) % tau - pi
        return float(box.quality(minimise_score(box, first, box.penalised_quality).x[None, :])[0])

    runs: dict[str, Callable[[Start], float]] = {
        "least squares, exact Jacobian": lambda start: fit_least_squares(normal, limits, start).start.quality,
        "IPOPT, exact derivatives": lambda start: sum_of_squares(normal, program.solve(start).start),
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
        best = draws[np.argmin(box.penalised_qualities(draws))]
        answer = box.answer(SimpleNamespace(x=best, success=True, message="", nit=0))
        yield make_start(make_linkage(answer.start, normal), normal)


# Tables


def kernel_table() -> Table:
    """Measure and return the first table, of coupler curves and Jacobians."""
    times = kernel_times(PROBLEMS["ellipse-a"].linkage)
    table = tables.numbers(f"coupler curve of {N} points", ("", "microseconds", "times the compiled curve"))
    first = next(iter(times.values()))
    for name, seconds in times.items():
        table.add_row(name, f"{1e6 * seconds:.2f}", f"{seconds / first:.1f}")
    return table


def problem_table(names: Sequence[str]) -> Table:
    """Measure and return the second table, of the problems of chapter VI."""
    # machine code, CasADi and the workers are loaded before the timing begins
    for search in SETTINGS.values():
        _run_problem("ellipse-a", search)
    table = Table("problem", *SETTINGS, title="problems of chapter VI: error in the thesis's unit, and seconds")
    for name in names:
        problem = PROBLEMS[name]
        table.add_row(
            f"{name}: goal {problem.goal:g} {problem.unit}",
            *(_run_problem(name, search) for search in SETTINGS.values()),
        )
    return table


def _run_problem(name: str, search: Search) -> str:
    """Return the error of `synthesize` on a problem and the time of the call, as text."""
    problem = PROBLEMS[name]
    begun = perf_counter()
    best = synthesize(problem.task, problem.bounds, problem.constraints, search=search).best
    return f"{problem.convert(best.error):.4g} in {perf_counter() - begun:.2f}"


def start_table() -> Table:
    """Measure and return the third table, of the results from many starts."""
    texts = ("path", "starts", "method")
    headings = (*texts, "at the optimum", "ms a start", "times least squares")
    table = tables.numbers(f"ellipse a with bounds only, {STARTS} starts", headings, texts)
    for weighted, path in ((False, "unweighted"), (True, f"weighted {WEIGHT:g} to 1")):
        cases = {kind: convergence(weighted, kind == "scan") for kind in ("scan", "random")}
        best = min(q for found in cases.values() for s in found for q in s.qualities)
        for kind, found in cases.items():
            for s in found:
                reached = sum(q <= (1.0 + NEAR) * best for q in s.qualities)
                share, ratio = f"{reached} of {len(s.qualities)}", f"{s.seconds / found[0].seconds:.1f}"
                table.add_row(path, kind, s.method, share, f"{1e3 * s.seconds:.1f}", ratio)
            table.add_section()
    return table


def main(names: Sequence[str]) -> None:
    """Measure and print the three tables."""
    console = Console(width=150)
    begun = perf_counter()
    console.print(kernel_table())
    console.print(problem_table(names))
    console.print(start_table())
    try:
        import pylinkage

        console.print(f"pylinkage {pylinkage.__version__}", highlight=False)
    except ImportError:
        console.print("left out, not installed (extra 'bench'): pylinkage", highlight=False)
    console.print(f"{perf_counter() - begun:.0f} s in all", highlight=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--problem", choices=tuple(PROBLEMS), action="append", help="run only this problem (repeatable)"
    )
    main(parser.parse_args().problem or tuple(PROBLEMS))
