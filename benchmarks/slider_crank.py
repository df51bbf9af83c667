"""Measure the speed of the slider-crank: runs in time, joint forces over a turn by two formulations, Monte Carlo.

    python -m benchmarks.slider_crank

The runs are Rahman's case a4 = 10 in, S1 = 3.5 in: 2.4 s from 50 rpm under a constant torque. The error is the largest
difference in slider position from a run at a tolerance of 1e-13, relative to the stroke. Each solver gets the loosest tolerance
whose error is at most 1e-6. Times are the best of several; ratios are of times measured in this one process.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from scipy.integrate import solve_ivp

from analysis import Inputs, Trajectory, simulate
from analysis.cli.common import say, show_table
from analysis.slider_crank import QUANTITIES, ConstantShift, Tolerance, close, force_turn, joint_loads, monte_carlo
from benchmarks import accuracy
from benchmarks.ensembles import integration_time
from linkwork.slider_crank import dynamics, published
from linkwork.slider_crank.kinematics import coefficients, position

PARAMETERS, INITIAL = published.OFFSET_CASE
TORQUE = 10.0  # N.m
STOP = 2.4
TIMES = np.linspace(0.0, STOP, 49)
ANGLES = np.linspace(0.0, 2.0 * np.pi, 361)


def run_in_process(tolerance: float) -> Trajectory:
    """Run the case with the compiled solver."""
    inputs = Inputs(torque=TORQUE)
    return simulate(PARAMETERS, inputs, initial=INITIAL, stop_time=STOP, samples=TIMES, tolerance=tolerance)


def constant_torque(torque: float) -> dynamics.Inputs:
    """Return the inputs of the plant: a torque (N.m) on the crank, and the shift held constant."""
    return dynamics.apply_inputs((0.0, 1.0), (torque, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), PARAMETERS.constants())


def run_scipy(method: str, tolerance: float) -> np.ndarray:
    """Compute the slider position at `TIMES` by one of SciPy's methods on the plain-Python right-hand side."""
    p, inputs = PARAMETERS.constants(), constant_torque(TORQUE)
    start = [INITIAL.crank_angle, INITIAL.shift_position, INITIAL.crank_speed, 0.0, 0.0, 0.0]

    def rate(_: float, x: np.ndarray) -> tuple[float, ...]:
        return dynamics.derivative(tuple(x.tolist()), inputs, p)

    result = solve_ivp(rate, (0.0, STOP), start, method=method, t_eval=TIMES, rtol=tolerance, atol=tolerance)
    return np.array([position(x[0], x[1], p).s4 for x in result.y.T.tolist()])


@cache
def reference() -> np.ndarray:
    """Return the slider position at `TIMES` by the compiled solver at a tolerance of 1e-13."""
    return run_in_process(1e-13)["slider.position"]


def error(position: np.ndarray) -> float:
    """Return the largest error of slider positions at `TIMES`, relative to the stroke."""
    return float(np.abs(position - reference()).max() / np.ptp(reference()))


def runs() -> None:
    """Measure and print the runs in time."""
    tolerance, off, _ = accuracy.loosest_setting(
        lambda tolerance: error(run_in_process(tolerance)["slider.position"]), accuracy.TOLERANCES
    )
    whole = accuracy.shortest_time(partial(run_in_process, tolerance), 30)
    inner = integration_time(partial(run_in_process, tolerance), 30)
    steps = int(run_in_process(tolerance).statistics["steps"])
    others = []
    for method in accuracy.SCIPY_METHODS:
        choice = accuracy.loosest_setting(lambda setting, m=method: error(run_scipy(m, setting)), accuracy.TOLERANCES)
        others.append((accuracy.shortest_time(partial(run_scipy, method, choice.setting), 3), choice.error, method))
    best = min(others)
    show_table(
        f"{STOP} s under {TORQUE:g} N.m, error at most {accuracy.ACCURACY:g} of the stroke",
        ("solver", "error", "time [ms]", "times the integration"),
        [
            (name, f"{e:.1e}", f"{1e3 * seconds:.3f}", f"{seconds / inner:.1f}")
            for name, e, seconds in (
                (f"in process, the integration ({steps} steps)", off, inner),
                ("in process, the whole call of simulate", off, whole),
                (f"SciPy, plain-Python right-hand side, best method ({best[2]})", best[1], best[0]),
            )
        ],
        words=("solver",),
    )


def _scalar_turn() -> None:
    p = PARAMETERS.constants()
    inputs = dynamics.apply_inputs((1.0, 1.0), (0.0,) * 7, p)
    for angle in ANGLES.tolist():
        x = (angle, INITIAL.shift_position, INITIAL.crank_speed, 0.0, 0.0, 0.0)
        q = position(x[0], x[1], p)
        dynamics.reactions(q, x, dynamics.motion(q, coefficients(q, p), x, inputs, p), inputs, p)


def _dual_turn() -> None:
    closure = close(PARAMETERS, ANGLES, np.full(len(ANGLES), INITIAL.shift_position))
    joint_loads(closure, speed=INITIAL.crank_speed, slider_force=0.0)


def forces() -> None:
    """Measure all joint forces over a turn of 361 points by each method, and print the times."""
    shift = ConstantShift(INITIAL.shift_position)
    arrays = accuracy.shortest_time(
        lambda: force_turn(PARAMETERS, crank_speed=INITIAL.crank_speed, shift=shift, angles=ANGLES)
    )
    times = {
        "vector mechanics on arrays, force_turn": arrays,
        "vector mechanics, the plant in plain Python": accuracy.shortest_time(_scalar_turn),
        "dual numbers: closure by Newton-Raphson, 17 equations": accuracy.shortest_time(_dual_turn),
    }
    show_table(
        "all joint forces at 361 angles",
        ("method", "time [ms]", "ratio"),
        [(name, f"{1e3 * seconds:.1f}", f"{seconds / arrays:.1f}") for name, seconds in times.items()],
        words=("method",),
    )


def tolerances() -> None:
    """Measure Monte Carlo simulations with a million samples at one crank angle, and print the times."""
    turn = force_turn(
        PARAMETERS,
        crank_speed=INITIAL.crank_speed,
        shift=ConstantShift(INITIAL.shift_position),
        angles=np.pi / 6.0,
    )
    widths = {
        "guide.offset": 5e-4,
        "shift.position": 5e-4,
        "guide.twist": 2e-3,
        "crank.length": 1e-4,
        "rod.length": 2e-4,
    }
    off = [Tolerance(name, half_width) for name, half_width in widths.items()]
    rows = []
    for name, quantities in (
        ("slider position", ("slider.position",)),
        ("motion of the slider, torque and every joint force", tuple(QUANTITIES)),
    ):
        found = []
        seconds = accuracy.shortest_time(
            lambda q=quantities, f=found: f.append(monte_carlo(turn, off, quantities=q)), 3
        )
        spread, linear = found[0].spreads["slider.position"], found[0].estimates["slider.position"]
        ratio = float(spread.deviation[0] / linear.deviation[0])
        rows.append((name, f"{seconds:.2f}", f"{ratio:.5f}"))
    headings = "quantities", "time [s]", "standard deviation of S4 over the linear estimate"
    show_table("a million samples of five tolerances at one angle", headings, rows, words=("quantities",))


def main() -> None:
    """Measure and print the tables."""
    runs()
    x = (1.0, INITIAL.shift_position, INITIAL.crank_speed, 0.0, 0.0, 0.0)
    p, inputs = PARAMETERS.constants(), constant_torque(TORQUE)
    fast = accuracy.right_hand_side_time(PARAMETERS, Inputs(torque=TORQUE), np.tile(x, (20_000, 1)))
    plain = accuracy.shortest_time(lambda: [dynamics.derivative(x, inputs, p) for _ in range(1000)]) / 1000
    say(f"a right-hand side takes {1e9 * fast:.0f} ns compiled, {1e6 * plain:.1f} microseconds in plain Python")
    forces()
    tolerances()


if __name__ == "__main__":
    main()
