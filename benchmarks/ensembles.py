"""Measure the throughput of `simulate_many`, as ratios within this one process.

    python -m benchmarks.ensembles
    python -m benchmarks.ensembles --runs 1000000 --disk

The runs are of the five-bar slider of Table 3.1 with different springs, at commanded speeds, under torques, a motor and a
torsion bar: three turns with samples of 1 ms, and 0.1 s. They are compared with the same runs alone, and with the same ensemble
without lanes. Times and ratios are of processor time, so that they hold on a busy machine; the wall-clock speed-up of two
threads needs two free cores.
"""

import argparse
import resource
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import pi
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from analysis import Ensemble, InductionMotor, Inputs, TorsionBar, simulate, simulate_many
from analysis.numerics import vectors
from analysis.numerics.codegen import Kernel
from analysis.run import compiled, lanes
from linkwork.five_bar.published import SETS, TABLE_3_1

REPEATS = 7
#: Number of runs that are also solved alone.
FEW = 20
SPEED = SETS["table-3.1"].crank_speed
LENGTHS = {"three turns": 6.0 * pi / SPEED, "0.1 s": 0.1}


@contextmanager
def without_lanes() -> Iterator[None]:
    """Solve all runs one after the other while the context lasts, not several at once in the lanes of vector instructions."""
    lanes_of_processor = vectors.LANES
    vectors.LANES = 1
    try:
        yield
    finally:
        vectors.LANES = lanes_of_processor


@contextmanager
def time_kernels(spent: list[float]) -> Iterator[None]:
    """Append the CPU time (s) of each call of the compiled solvers to ``spent`` while the context lasts."""
    kernels = compiled.run, lanes.run_in_lanes

    def time_kernel(kernel: Kernel) -> Any:
        def call(*arguments: object) -> None:
            begun = process_time()
            kernel.unchecked(*arguments)
            spent.append(process_time() - begun)

        call.unchecked = call  # type: ignore[attr-defined]
        return call

    compiled.run, lanes.run_in_lanes = map(time_kernel, kernels)
    try:
        yield
    finally:
        compiled.run, lanes.run_in_lanes = kernels


def integration_time(run: Callable[[], object], repeats: int) -> float:
    """Return the shortest CPU time (s) that the compiled solver takes within ``run``, a call of `simulate`."""
    spent: list[float] = []
    with time_kernels(spent):
        for _ in range(repeats):
            run()
    return min(spent)


def measure_runs(runs: list[Callable[[], object]]) -> list[tuple[float, float, float]]:
    """Return for each run the shortest CPU time, CPU time in the compiled solver, and clock time (s); the runs alternate."""
    times = []
    for _ in range(REPEATS + 1):
        row = []
        for run in runs:
            spent: list[float] = []
            with time_kernels(spent):
                begun, clock = process_time(), perf_counter()
                run()
                row.append((process_time() - begun, sum(spent), perf_counter() - clock))
        times.append(row)
    # the first repetition compiles
    return [tuple(map(min, zip(*column))) for column in zip(*times[1:])]


def report_memory(count: int) -> None:
    """Print the peak memory of an ensemble whose results are kept in a folder, and the peak memory before the ensemble."""

    def peak() -> float:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0

    values = {"slider.stiffness": np.linspace(500.0, 1500.0, count)}
    with TemporaryDirectory(dir=".") as folder:
        options = {"outputs": ["slider.position"], "stop_time": 0.1, "step": 0.01}
        simulate_many(TABLE_3_1, Inputs(speed=30.0), vary={"slider.stiffness": [1.0]}, **options)
        before, begun = peak(), process_time()
        runs = simulate_many(TABLE_3_1, Inputs(speed=30.0), vary=values, folder=folder, **options)
        assert runs.values is not None
        print(
            f"{len(runs)} runs, {runs.values.nbytes / 2.0**20:.0f} MiB of results: peak {peak():.0f} MiB, {before:.0f} MiB "
            f"before them; {1e6 * (process_time() - begun) / count:.0f} us a run"
        )
        del runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=400, help="number of runs (default: %(default)s)")
    parser.add_argument(
        "--disk", action="store_true", help="measure instead the peak memory of runs whose results are kept on disk"
    )
    options = parser.parse_args()
    n = options.runs
    if options.disk:
        report_memory(n)
        return
    stiffness, some = 500.0 + 1000.0 * np.arange(n) / n, range(0, n, max(1, n // FEW))
    speeds, torques = 0.5 * SPEED * (1.0 + np.arange(n) / n), 10.0 * np.arange(n) / n
    motor = InductionMotor(breakdown_torque=5.0, breakdown_slip=0.2, synchronous_speed=50.0)
    # inputs of all runs, and by name the inputs that vary
    drives = {
        "speed": (Inputs(), {"speed": speeds}),
        "torque": (Inputs(), {"torque": torques}),
        "motor": (Inputs(torque=motor), {}),
        "torsion bar": (Inputs(torque=TorsionBar(torque=10.0)), {}),
    }
    times, ratios = ("alone", "one by one", "in lanes", "compiled part"), ("alone", "one by one", "compiled parts")
    title = "microseconds a run; ratios to lanes; two threads"
    table = Table(f"{n} runs", *times, *ratios, "CPU", "clock", title=title)
    for length, stop_time in LENGTHS.items():
        for drive, (inputs, varied) in drives.items():
            samples = {"stop_time": stop_time, "step": 1e-3}

            def run_together(
                n_jobs: int | None = None, inputs: Inputs = inputs, varied: dict = varied, samples: dict = samples
            ) -> Ensemble:
                vary = {"slider.stiffness": stiffness, **varied}
                return simulate_many(TABLE_3_1, inputs, vary=vary, n_jobs=n_jobs, **samples)

            def run_one_by_one(run_together: Callable[[], Ensemble] = run_together) -> None:
                with without_lanes():
                    run_together()

            springs = run_together().parameters

            def run_alone(
                inputs: Inputs = inputs, varied: dict = varied, samples: dict = samples, springs: Sequence = springs
            ) -> None:
                for i in some:
                    own = inputs.replace(**{name: values[i] for name, values in varied.items()})
                    simulate(springs[i], own, **samples)

            single, other, ours, two = measure_runs(
                [run_alone, run_one_by_one, run_together, lambda run_together=run_together: run_together(2)]
            )
            own = single[0] / len(some), other[0] / n, ours[0] / n
            table.add_row(
                f"{length}, {drive}",
                *(f"{1e6 * time:.0f}" for time in (*own, ours[1] / n)),
                *(f"{ratio:.1f}" for ratio in (own[0] / own[2], own[1] / own[2], other[1] / ours[1])),
                f"{two[0] / ours[0]:.2f}",
                f"{ours[2] / two[2]:.2f}",
            )
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
