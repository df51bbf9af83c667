"""Throughput of `simulate_many` over short runs, as ratios within this one process.

    python -m benchmarks.ensembles --runs 3000
    python -m benchmarks.ensembles --runs 100000 --disk

Runs of 0.1 s of the five-bar slider of Table 3.1 with varying springs, at commanded speeds and under torques. Times and ratios
are of the processor, so that they hold on a busy machine; the speed-up of two threads by the clock needs two free cores.
"""

from __future__ import annotations

import argparse
import resource
from collections.abc import Callable
from dataclasses import replace
from tempfile import TemporaryDirectory
from time import process_time

from rich.console import Console
from rich.table import Table

from analysis import Inputs, simulate, simulate_many
from analysis.run import compiled
from benchmarks.accuracy import best_time
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import TABLE_3_1

REPEATS = 7
#: Number of runs solved one by one.
FEW = 300
OPTIONS = {"stop_time": 0.1, "step": 1e-3}


def best_of_each(runs: list[Callable[[], object]]) -> list[float]:
    """Return the shortest time by the clock of each run (s), taken in turn, as other programs may use the machine."""
    times = [[best_time(run, 1) for run in runs] for _ in range(REPEATS)]
    return [min(column) for column in zip(*times)]


def times_of(run: Callable[[], object]) -> tuple[float, float]:
    """Return the CPU time of the shortest of several runs, and the part inside the compiled solver (s)."""
    kernel, spent = compiled.run, []

    def timed(*arguments: object) -> None:
        begun = process_time()
        kernel(*arguments)
        spent.append(process_time() - begun)

    times = []
    compiled.run = timed
    try:
        for _ in range(REPEATS):
            spent.clear()
            whole = best_time(run, 1, process_time)
            times.append((whole, sum(spent)))
    finally:
        compiled.run = kernel
    return min(times)


def report_memory(springs: list[FiveBarParameters]) -> None:
    """Print the peak memory of an ensemble that is kept in a folder, and of this process before it."""

    def peak() -> float:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0

    with TemporaryDirectory(dir=".") as folder:
        before = peak()
        runs = simulate_many(springs, Inputs(speed=30.0), folder=folder, **OPTIONS)
        size = (runs.states.nbytes + runs.forces.nbytes) / 2.0**20
        print(f"{len(runs)} runs, {size:.0f} MiB of results: peak {peak():.0f} MiB, {before:.0f} MiB before them")
        del runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=3000, help="how many (default: %(default)s)")
    parser.add_argument("--disk", action="store_true", help="instead the peak of memory of runs that are kept on disk")
    options = parser.parse_args()
    n = options.runs
    # evenly over all, which differ in their cost
    some = range(0, n, max(1, n // FEW))
    springs = [replace(TABLE_3_1, slider_stiffness=500.0 + 1000.0 * i / n) for i in range(n)]
    if options.disk:
        report_memory(springs)
        return
    kinds = {
        "commanded speed": [Inputs(speed=20.0 + 10.0 * i / n) for i in range(n)],
        "torque": [Inputs(torque=10.0 * i / n) for i in range(n)],
    }
    columns = ("`simulate`", "a run", "of it compiled", "the rest", "times `simulate`", "two threads: CPU", "the clock")
    table = Table("runs", *columns)
    for name, inputs in kinds.items():

        def together(n_jobs: int | None = None, inputs: list[Inputs] = inputs) -> object:
            return simulate_many(springs, inputs, n_jobs=n_jobs, **OPTIONS)

        def one_by_one(inputs: list[Inputs] = inputs) -> object:
            return [simulate(springs[i], inputs[i], **OPTIONS) for i in some]

        alone = best_time(one_by_one, REPEATS, process_time) / len(some)
        cpu, inside = times_of(together)
        of_two = best_time(lambda: together(2), REPEATS, process_time)
        clock = best_of_each([lambda jobs=jobs: together(jobs) for jobs in (1, 2)])
        table.add_row(
            name,
            f"{1e6 * alone:.0f} us",
            *(f"{1e6 * time / n:.0f} us" for time in (cpu, inside, cpu - inside)),
            f"{alone * n / cpu:.1f}",
            f"{of_two / cpu:.2f}",
            f"{clock[0] / clock[1]:.2f}",
        )
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
