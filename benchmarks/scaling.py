"""Measure parallel speed: each kind of work on one worker and on two, as processes and as a Dask cluster on this machine.

    python -m benchmarks.scaling

A worker is a process. Wall-clock times need as many free cores as workers. Processor times, summed over all processes, show the
cost of distributing the work even on a busy machine. Each time is the best of several, measured in turn. The results are
compared bit by bit.
"""

import argparse
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import joblib
import numpy as np
import psutil
from distributed import Client, LocalCluster
from rich.console import Console
from rich.table import Table

from analysis import Inputs, Tolerance, force_turn, monte_carlo, simulate_many
from analysis.numerics.workers import run_in_parallel
from analysis.periodic import Drive, grid, plane
from analysis.synthesis import Search, TimedPath, synthesize
from linkwork.five_bar.published import SETS, TABLE_3_1

SPEED = SETS["table-3.1"].crank_speed


def ensemble() -> Any:
    springs = [replace(TABLE_3_1, slider_stiffness=500.0 + n) for n in range(300)]
    return simulate_many(springs, Inputs(speed=SPEED), stop_time=10.0, step=0.1).states


def chart() -> Any:
    operation = plane(TABLE_3_1, Drive(speed=SPEED), "drive.speed", "slider.damping")
    with TemporaryDirectory() as folder:
        return grid(operation, np.linspace(20.0, 60.0, 120), np.linspace(10.0, 60.0, 60), folder=folder).starts


def synthesis() -> Any:
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ellipse = np.column_stack([0.2 * np.cos(angle), 0.1 * np.sin(angle)])
    found = synthesize(TimedPath(points=ellipse), search=Search(starts=288, candidates=1 << 12))
    return np.array([list(s.linkage.values().values()) for s in found.solutions])


def samples() -> Any:
    turn = force_turn("rahman-a4-10-s1-3.5", angles=np.linspace(0.0, 6.2, 48))
    tolerances = [Tolerance("rod.length", 5e-4), Tolerance("guide.offset", 5e-4)]
    found = monte_carlo(turn, tolerances, quantities=("slider.position", "crank_pin.fz"), samples=200_000)
    return found.spreads["crank_pin.fz"].percentiles.filled()


WORK: dict[str, Callable[[], Any]] = {
    "ensemble, 300 runs of 10 s": ensemble,
    "chart, 120 x 60 orbits": chart,
    "synthesis, 288 starts": synthesis,
    "Monte Carlo, 48 x 200,000 samples": samples,
}


def processor_time() -> float:
    """Return the processor time (s) of this process and its child processes."""
    own = psutil.Process()
    return sum(sum(process.cpu_times()[:2]) for process in [own, *own.children(recursive=True)])


def time_work(work: Callable[[], Any], backend: str | None) -> tuple[float, float, Any]:
    """Run work on one worker, or on two workers of a backend; return wall-clock and processor time (s) and the result."""
    with joblib.parallel_config(backend, n_jobs=2) if backend else nullcontext():
        begun, spent = perf_counter(), processor_time()
        result = work()
        return perf_counter() - begun, processor_time() - spent, result


def import_packages(_: int) -> None:
    """Import the packages that a worker needs, so that the import is not timed."""
    import analysis.periodic.chart.grid
    import analysis.run.compiled
    import analysis.slider_crank
    import analysis.synthesis  # noqa: F401


def measure(backends: tuple[str | None, ...], repeats: int) -> list[list[list[tuple[float, float, Any]]]]:
    """Time each kind of work on each backend, the backends in turn; return the results of `time_work`, by work and backend."""
    for backend in filter(None, backends):
        with joblib.parallel_config(backend, n_jobs=2):
            list(run_in_parallel(import_packages, range(8)))
    turns = {name: [[time_work(work, b) for b in backends] for _ in range(repeats + 1)] for name, work in WORK.items()}
    return [[list(row) for row in zip(*turns[name])] for name in WORK]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="repetitions of each measurement (default: %(default)s)")
    repeats = parser.parse_args().repeats
    places = ("one worker", "two processes", "two workers of Dask")
    headings = [f"{place}: {what}" for place in places for what in ("clock", "CPU")]
    table = Table("work", *headings, "bits", title=f"{joblib.cpu_count()} cores")
    # Dask comes last: its cluster sets MALLOC_TRIM_THRESHOLD_, which slows down the processes that are started afterwards
    found = measure((None, "loky"), repeats)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster, Client(cluster):
        found = [here + there for here, there in zip(found, measure(("dask",), repeats))]
    for name, rows in zip(WORK, found):
        # the first repetition compiles
        times = [min(time[what] for time in row[1:]) for row in rows for what in (0, 1)]
        alike = all(np.array_equal(time[2], rows[0][0][2], equal_nan=True) for row in rows for time in row)
        table.add_row(name, *(f"{t:.2f} s" for t in times), "the same" if alike else "DIFFERENT")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
