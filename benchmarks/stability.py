"""Measure the time of a chart of the true orbit's largest Floquet multiplier, and compare it with SciPy.

    python -m benchmarks.stability

The chart has 200 x 200 points of rig 1 with spring A, damping over crank speed. Each point has its own periodic orbit. The
chart is computed on two cores from an empty cache of results.

SciPy computes pieces of a few rows of the chart; its time per point is scaled to the whole chart. The orbits are found by the
same Newton iterations. solve_ivp's DOP853 integrates the orbit and two neighbouring motions together at the same tolerance; the
differences of these motions replace the variational equations. Chart and pieces are timed in the same run on the same cores.
With --cores 1 processor time is measured instead of elapsed time; it hardly depends on other programs.
"""

import argparse
import tempfile
import time
from math import pi

import joblib
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from scipy.integrate import solve_ivp

from analysis.periodic import INTEGRATOR_TOLERANCE, ORBIT_TOLERANCE, Drive, Plane, grid, plane
from analysis.units import RAD_S_PER_RPM
from linkwork.five_bar import dynamics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SETS

from . import tables

POINTS = 200
#: Number of rows in the sample, and number of points in each.
ROWS, RUN = 4, 10
SPEEDS = np.linspace(200.0, 1200.0, POINTS) * RAD_S_PER_RPM
DAMPINGS = np.linspace(3.0, 40.0, POINTS)
#: Distance of the neighbouring motions' starts, relative to crank length and speed; it balances truncation and rounding.
STEP = 1e-6


def scipy_orbit(
    parameters: FiveBarParameters, drive: Drive, guess: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """Return the start of the periodic orbit and the modulus of its largest Floquet multiplier, by shooting with SciPy."""
    p = parameters.constants()
    speed = drive.speed
    assert speed is not None
    inputs = dynamics.Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    scale = np.array([parameters.crank_length, parameters.crank_length * speed])

    def rate(t: float, z: NDArray[np.float64]) -> list[float]:
        out = []
        for i in (0, 2, 4):
            x = dynamics.derivative((speed * t, z[i], speed, z[i + 1], 0.0, 0.0), inputs, p)
            out += [x[1], x[3]]
        return out

    y = guess.copy()
    for _ in range(20):
        start = (y + STEP * np.array([[0.0, 0.0], [scale[0], 0.0], [0.0, scale[1]]])).ravel()
        tolerances = {"rtol": INTEGRATOR_TOLERANCE, "atol": INTEGRATOR_TOLERANCE * np.tile(scale, 3)}
        end = solve_ivp(rate, (0.0, 2.0 * pi / speed), start, "DOP853", **tolerances).y[:, -1]
        matrix = np.column_stack([(end[2:4] - end[:2]) / (STEP * scale[0]), (end[4:] - end[:2]) / (STEP * scale[1])])
        correction = np.linalg.solve(np.eye(2) - matrix, end[:2] - y)
        y = y + correction
        # the errors of the differences make the convergence of Newton's method linear at the end
        if np.abs(correction / scale).max() < 10.0 * ORBIT_TOLERANCE:
            break
    return y, float(np.abs(np.linalg.eigvals(matrix)).max())


def scipy_row(operation: Plane, damping: float, speeds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest Floquet multipliers at several speeds: a piece of a row of the chart.

    The first guess of each orbit is extrapolated from the last two orbits.
    """
    starts: list[NDArray[np.float64]] = []
    values = []
    for speed in speeds.tolist():
        guess = 2.0 * starts[-1] - starts[-2] if len(starts) > 1 else starts[-1] if starts else np.zeros(2)
        start, value = scipy_orbit(*operation(speed, damping), guess)
        starts.append(start)
        values.append(value)
    return np.array(values)


def main(points: int = POINTS, cores: int = 2) -> None:
    """Time the chart and SciPy's pieces of the chart, and print the comparison."""
    clock = time.perf_counter if cores > 1 else time.process_time
    rig = SETS["rig-1-spring-a"].parameters
    operation = plane(rig, Drive(speed=float(SPEEDS[0])), "drive.speed", "slider.damping")
    speeds, dampings = (np.linspace(axis[0], axis[-1], points) for axis in (SPEEDS, DAMPINGS))
    with tempfile.TemporaryDirectory() as folder:
        # the workers are started and the machine code is loaded before the timing begins
        grid(operation, speeds[:4], dampings[:4], folder=folder, n_jobs=cores)
        begin = clock()
        chart = grid(operation, speeds, dampings, folder=folder, n_jobs=cores)
        ours = clock() - begin
        begin = clock()
        grid(operation, speeds, dampings, folder=folder, n_jobs=cores)
        again = clock() - begin
    rows = np.linspace(0, points - 1, ROWS).astype(int)
    pieces = [slice(first, first + RUN) for first in np.linspace(0, points - RUN, ROWS).astype(int)]
    begin = clock()
    sample = joblib.Parallel(n_jobs=cores)(
        joblib.delayed(scipy_row)(operation, dampings[row], speeds[piece]) for row, piece in zip(rows, pieces)
    )
    theirs = (clock() - begin) / (ROWS * RUN) * points**2
    difference = max(
        float(np.abs(chart.largest[row, piece] - values).max()) for row, piece, values in zip(rows, pieces, sample)
    )
    title = f"{points} x {points} largest Floquet multipliers of the true orbit, {cores} core(s)"
    table = tables.numbers(title, ("", "s", "ms a point and core", "ratio"))
    per_point = 1e3 * cores / points**2
    table.add_row("periodic.grid", f"{ours:.2f}", f"{ours * per_point:.3f}", "1")
    table.add_row("the same again, from the cache on disk", f"{again:.2f}", "", "")
    plain = f"SciPy DOP853, plain (from {ROWS * RUN} points)"
    table.add_row(plain, f"{theirs:.0f}", f"{theirs * per_point:.2f}", f"{theirs / ours:.0f}")
    console = Console(width=120)
    console.print(table)
    found = int((~np.ma.getmaskarray(chart.largest)).sum())
    console.print(f"orbits found: {found} of {points**2}; largest difference of the multipliers: {difference:.1e}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=POINTS, help="points along each axis")
    parser.add_argument("--cores", type=int, default=2, help="number of processes; with 1, processor time is measured")
    given = parser.parse_args()
    main(given.points, given.cores)
