"""Speed of the in-process solver at a stated accuracy, beside SciPy, the multiplier form, MuJoCo and Exudyn.

    python -m benchmarks.solvers

Two cases: Table 3.1 at 420 rpm for three revolutions, and a torsion bar of 1e8 dyn.cm released at 1 rad, 0.5 s in all. Error is
the largest difference in u from a 1e-13 reference on a grid of samples, relative to the largest u; each solver gets the loosest
setting whose error is at most 1e-6, and its best method. Times are the best of several runs, ratios within this one process.
MuJoCo and Exudyn (extra ``bench``) are left out with a word where they are not installed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.integrate import solve_ivp

from analysis import Inputs, TorsionBar, simulate
from analysis.run import compiled
from benchmarks import engines
from benchmarks.engines import ACCURACY, CASES, Case, relative_error
from linkwork.five_bar import dynamics
from linkwork.five_bar.parameters import InitialState
from tests.oracles.multipliers import SpeedDrive, simulate_redundant

TOLERANCES = 10.0 ** np.arange(-3.0, -11.0, -0.1)
REPEATS = 7
SCIPY_METHODS = ("RK45", "DOP853", "LSODA", "Radau", "BDF")


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Time of a solver at its loosest setting that reaches the accuracy (s), its error, and what it did."""

    solver: str
    seconds: float
    error: float
    note: str


def loosest(run: Callable[[float], np.ndarray], case: Case, settings: Iterable[float]) -> tuple[float, float] | None:
    """First of the settings, loose to tight, whose error and that of the next one are within the accuracy; and its error."""
    candidate: tuple[float, float] | None = None
    for setting in settings:
        error = relative_error(case, run(float(setting)))
        if error > ACCURACY:
            candidate = None
        elif candidate is None:
            candidate = (float(setting), error)
        else:
            return candidate
    return candidate


def best_time(run: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest of several runs (s)."""
    times = []
    for _ in range(repeats):
        begun = perf_counter()
        run()
        times.append(perf_counter() - begun)
    return min(times)


# The in-process solver


def in_process(case: Case) -> tuple[list[Timing], str]:
    """The compiled solver: the whole call of `simulate`, the integration inside it, and the bare right-hand sides."""
    inputs = Inputs(speed=case.crank_speed) if case.crank_speed else Inputs(torque=TorsionBar(torque=case.torque))

    def run(tolerance: float) -> object:
        return simulate(
            case.parameters,
            inputs,
            initial=InitialState(crank_speed=case.start_speed),
            stop_time=case.duration,
            samples=case.times,
            tolerance=tolerance,
        )

    found = loosest(lambda tolerance: run(tolerance)["slider.position"], case, TOLERANCES)  # type: ignore[index]
    assert found is not None, "the in-process solver does not reach the accuracy"
    tolerance, error = found
    whole = best_time(lambda: run(tolerance), 50)
    results = [run(tolerance) for _ in range(50)]
    statistics = results[0].statistics  # type: ignore[attr-defined]
    inner = min(r.statistics["seconds_integrating"] for r in results)  # type: ignore[attr-defined]
    evaluations = int(statistics["evaluations"])
    bare = right_hand_side(case) * evaluations
    note = f"tolerance {tolerance:.1e}, {int(statistics['steps'])} steps, {evaluations} evaluations"
    timings = [
        Timing(solver="in process, the integration", seconds=inner, error=error, note=note),
        Timing(solver="in process, the whole call of simulate", seconds=whole, error=error, note="all 27 outputs"),
    ]
    return timings, (
        f"{case.name}: the integration takes {inner / bare:.2f} times the bare cost of its {evaluations} right-hand sides "
        f"({bare / evaluations * 1e9:.0f} ns each)"
    )


def right_hand_side(case: Case) -> float:
    """Time of one compiled right-hand side, along the states of the case (s)."""
    n = 20_000
    angles = np.linspace(0.0, 2.0 * np.pi, n)
    speed = case.crank_speed or 70.0
    states = np.column_stack(
        [angles, 0.01 * np.sin(angles), np.full(n, speed), 0.2 * np.cos(angles), 0 * angles, 0 * angles]
    )
    forces = np.zeros((n, 6))
    forces[:, 0] = 1.0 if case.crank_speed else 0.0
    out = np.empty((n, 6))
    p = case.parameters.constants()
    return best_time(lambda: compiled.solver(p).derivatives(p, states, forces, out), 20) / n


# SciPy


def with_scipy(case: Case) -> Timing:
    """`solve_ivp` on the plain-Python right-hand side, by the method that is fastest at the accuracy."""
    best: Timing | None = None
    for method in SCIPY_METHODS:
        found = loosest(lambda rtol, m=method: _scipy(case, m, rtol), case, TOLERANCES)
        if found is None:
            continue
        rtol, error = found
        seconds = best_time(lambda m=method, r=rtol: _scipy(case, m, r), 3)
        if best is None or seconds < best.seconds:
            best = Timing(
                solver="SciPy, plain-Python right-hand side",
                seconds=seconds,
                error=error,
                note=f"{method}, rtol {rtol:.1e}",
            )
    assert best is not None, "no method of SciPy reaches the accuracy"
    return best


def _scipy(case: Case, method: str, rtol: float) -> np.ndarray:
    """u at the case's times; the four mechanical states alone, the torque switched at an event."""
    p = case.parameters.constants()
    speed_drive = 1.0 if case.crank_speed else 0.0

    def rhs(t: float, x: np.ndarray, torque: float) -> tuple[float, ...]:
        th2, u, w2, v = x.tolist()
        applied = torque * (1.0 - th2 / case.switch_angle)
        return dynamics.derivative(
            (th2, u, w2, v, 0.0, 0.0), dynamics.Inputs(speed_drive, applied, 0.0, 0.0, 0.0, 0.0), p
        )[:4]

    def released(t: float, x: np.ndarray, torque: float) -> float:
        return x[0] - case.switch_angle if torque else -1.0

    released.terminal = True  # type: ignore[attr-defined]
    start, torque = 0.0, case.torque
    x = np.array([0.0, 0.0, case.start_speed, 0.0])
    scale = np.array(
        [1.0, case.parameters.crank_length, max(1.0, case.start_speed), case.parameters.crank_length * 40.0]
    )
    u = [0.0]
    while len(u) < len(case.times):
        leg = solve_ivp(
            rhs,
            (start, case.duration),
            x,
            method=method,
            t_eval=case.times[len(u) :],
            events=released if torque else None,
            args=(torque,),
            rtol=rtol,
            atol=rtol * scale,
        )
        u.extend(leg.y[1])
        if leg.status != 1:
            break
        start, x, torque = leg.t_events[0][0], leg.y_events[0][0], 0.0
    return np.array(u) if len(u) == len(case.times) else np.full(len(case.times), np.nan)


# The multiplier form


def with_multipliers(case: Case) -> Timing:
    """The redundant form under SciPy's DOP853; under the torsion bar the time of release is given to it for nothing."""
    found = loosest(lambda rtol: _multipliers(case, rtol), case, TOLERANCES[::5])
    assert found is not None, "the multiplier form does not reach the accuracy"
    rtol, error = found
    seconds = best_time(lambda: _multipliers(case, rtol), 2)
    return Timing(
        solver="multiplier form under SciPy", seconds=seconds, error=error, note=f"DOP853, rtol {rtol:.1e}, 8 states"
    )


def _multipliers(case: Case, rtol: float) -> np.ndarray:
    start = InitialState(crank_speed=case.start_speed)
    if case.crank_speed:
        run = simulate_redundant(
            case.parameters,
            start,
            lambda t, q, qd: (0.0, 0.0, 0.0, 0.0),
            case.times,
            rtol=rtol,
            atol=rtol * 1e-2,
            speed=SpeedDrive(case.crank_speed),
        )
        return run.q[:, 3]
    release = _release_time(case)
    inner = case.times[case.times < release]
    first = simulate_redundant(
        case.parameters,
        start,
        lambda t, q, qd: (case.torque * (1.0 - q[0] / case.switch_angle), 0.0, 0.0, 0.0),
        np.append(inner, release),
        rtol=rtol,
        atol=rtol * 1e-2,
    )
    middle = InitialState(
        crank_angle=first.q[-1, 0],
        crank_speed=first.qd[-1, 0],
        slider_position=first.q[-1, 3],
        slider_velocity=first.qd[-1, 3],
    )
    outer = case.times[case.times > release]
    second = simulate_redundant(
        case.parameters,
        middle,
        lambda t, q, qd: (0.0, 0.0, 0.0, 0.0),
        np.append(release, outer),
        rtol=rtol,
        atol=rtol * 1e-2,
    )
    return np.concatenate([first.q[:-1, 3], second.q[1:, 3]])


def _release_time(case: Case) -> float:
    from analysis import Event

    run = simulate(
        case.parameters,
        Inputs(torque=TorsionBar(torque=case.torque)),
        stop_time=case.duration,
        step=case.duration,
        tolerance=1e-12,
        events=[Event(name="release", output="crank.angle", level=case.switch_angle)],
    )
    return run.events[0].time


# The engines


def with_engine(engine: engines.Engine, case: Case) -> Timing:
    """A multibody engine at its largest step that reaches the accuracy."""
    steps = engines.time_steps(case, engine.first_step, engine.last_step)
    choice = engines.largest_step(engine.run, case, steps)
    run = engines.fastest(engine.run, case, choice.time_step)
    reached = "" if choice.reached else ", accuracy not reached"
    note = f"step {choice.time_step:.2e} s, {run.steps} steps{reached}"
    return Timing(solver=run.label, seconds=run.seconds, error=run.error, note=note)


def main() -> None:
    """Measure and print a table for each case."""
    console = Console(width=130)
    for case in CASES:
        timings, remark = in_process(case)
        timings += [with_scipy(case), with_multipliers(case)]
        missing = []
        plain = engines.ENGINES[0]._replace(run=partial(engines.run_mujoco, stiffened=False))
        for engine in (*engines.ENGINES, plain):
            try:
                timings.append(with_engine(engine, case))
            except ImportError as error:
                missing += [error.name or str(error)] * (error.name not in missing)
        table = Table(title=f"{case.name}: error in u at most {ACCURACY:g}")
        for heading in ("solver", "error", "time [ms]", "times the integration", "times the whole call", "setting"):
            table.add_column(heading, justify="left" if heading in ("solver", "setting") else "right")
        for timing in timings:
            table.add_row(
                timing.solver,
                f"{timing.error:.1e}",
                f"{timing.seconds * 1e3:.3f}",
                f"{timing.seconds / timings[0].seconds:.1f}",
                f"{timing.seconds / timings[1].seconds:.1f}",
                timing.note,
            )
        console.print(table)
        console.print(remark, highlight=False)
        if missing:
            console.print(f"left out, not installed (extra 'bench'): {', '.join(missing)}", highlight=False)


if __name__ == "__main__":
    main()
