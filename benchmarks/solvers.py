"""Compare the speed of the in-process solver at a stated accuracy with SciPy, MuJoCo and Exudyn.

    python -m benchmarks.solvers

There are two cases: Table 3.1 at 420 rpm for three turns, and 0.5 s under a torsion bar of 1e8 dyn.cm that acts up to 1 rad.
The error is the largest difference in u at the sample times from a reference at 1e-13, relative to the largest u. Each solver
gets its best method and the loosest setting whose error is at most 1e-6. Times are the best of several runs, and ratios are of
times in this one process. MuJoCo and Exudyn (extra ``bench``) are left out, with a note, if they are not installed.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from rich.console import Console

from benchmarks import engines, tables
from benchmarks.accuracy import (
    ACCURACY,
    SCIPY_METHODS,
    TOLERANCES,
    loosest_setting,
    right_hand_side_time,
    shortest_time,
)
from benchmarks.engine_cases import CASES, Case, relative_error, run_in_process, run_scipy
from benchmarks.ensembles import integration_time


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Time (s) and error of a solver at its loosest setting that reaches the accuracy, with a note."""

    solver: str
    seconds: float
    error: float
    note: str


def time_in_process(case: Case) -> tuple[list[Timing], str]:
    """Time the compiled solver on a case; return the timings, and a sentence on the cost of the right-hand sides.

    The timings are of the integration alone and of the whole call of `simulate`.
    """
    run = partial(run_in_process, case)
    found = loosest_setting(lambda tolerance: relative_error(case, run(tolerance)["slider.position"]), TOLERANCES)
    assert found.reached, "the in-process solver does not reach the accuracy"
    whole = shortest_time(lambda: run(found.setting), 500)
    inner = integration_time(lambda: run(found.setting), 500)
    statistics = run(found.setting).statistics
    steps, evaluations = int(statistics["steps"]), int(statistics["evaluations"])
    bare = right_hand_side_time(case.parameters, case.inputs, _states(case)) * evaluations
    note = f"tolerance {found.setting:.1e}, {steps} steps, {evaluations} evaluations"
    timings = [
        Timing(solver="in process, the integration", seconds=inner, error=found.error, note=note),
        Timing(solver="in process, the whole call of simulate", seconds=whole, error=found.error, note="all outputs"),
    ]
    return timings, (
        f"{case.name}: the integration takes {inner / bare:.2f} times the bare cost of its {evaluations} right-hand sides "
        f"({bare / evaluations * 1e9:.0f} ns each)"
    )


def _states(case: Case) -> np.ndarray:
    """Return states like those of the case, at which its right-hand side is timed."""
    angles = np.linspace(0.0, 2.0 * np.pi, 20_000)
    none, speed = np.zeros_like(angles), np.full_like(angles, case.crank_speed or 70.0)
    return np.column_stack([angles, 0.01 * np.sin(angles), speed, 0.2 * np.cos(angles), none, none])


def time_scipy(case: Case) -> Timing:
    """Time `solve_ivp` on the right-hand side in plain Python, with the method that reaches the accuracy soonest."""
    timings = []
    for method in SCIPY_METHODS:
        run = partial(run_scipy, case, method)
        rtol, error, reached = loosest_setting(lambda rtol, run=run: relative_error(case, run(rtol)), TOLERANCES)
        if reached:
            solver, seconds = "SciPy, plain-Python right-hand side", shortest_time(partial(run, rtol), 3)
            timings.append(Timing(solver=solver, seconds=seconds, error=error, note=f"{method}, rtol {rtol:.1e}"))
    return min(timings, key=lambda timing: timing.seconds)


def time_engine(engine: engines.Engine, case: Case) -> Timing:
    """Time a multibody engine at its largest step that reaches the accuracy."""
    steps = engines.time_steps(case, engine.first_step, engine.last_step)
    choice = loosest_setting(lambda step: engine.run(case, step).error, steps)
    run = engines.fastest_run(engine.run, case, choice.setting)
    reached = "" if choice.reached else ", accuracy not reached"
    note = f"step {choice.setting:.2e} s, {run.steps} steps{reached}"
    return Timing(solver=run.label, seconds=run.seconds, error=run.error, note=note)


def main() -> None:
    """Measure and print a table for each case."""
    console = Console(width=130)
    for case in CASES:
        timings, remark = time_in_process(case)
        timings.append(time_scipy(case))
        missing = []
        plain = engines.ENGINES[0]._replace(run=partial(engines.run_mujoco, stiffened=False))
        for engine in (*engines.ENGINES, plain):
            try:
                timings.append(time_engine(engine, case))
            except ImportError as error:
                missing += [error.name or str(error)] * (error.name not in missing)
        headings = ("solver", "error", "time [ms]", "times the integration", "times the whole call", "setting")
        table = tables.numbers(f"{case.name}: error in u at most {ACCURACY:g}", headings, ("solver", "setting"))
        for timing in timings:
            ratios = (f"{timing.seconds / ours.seconds:.1f}" for ours in timings[:2])
            row = timing.solver, f"{timing.error:.1e}", f"{timing.seconds * 1e3:.3f}", *ratios, timing.note
            table.add_row(*row)
        console.print(table)
        console.print(remark, highlight=False)
        if missing:
            console.print(f"left out, not installed (extra 'bench'): {', '.join(missing)}", highlight=False)


if __name__ == "__main__":
    main()
