"""Measure the accuracy of long runs: a million turns, a start at 1e9 s, an angle of 1e9 turns; print tables of docs/solvers.md.

    python -m benchmarks.long_runs turns --turns 1e5
    python -m benchmarks.long_runs turns --turns 1e6 --tolerances 1e-9
    python -m benchmarks.long_runs times
    python -m benchmarks.long_runs angles
    python -m benchmarks.long_runs fmu
    python -m benchmarks.long_runs built

Except in the table ``times`` both mechanisms run freely, without damping, drive and load, so that their energy is constant.
Residuals are relative to the kinetic energy at the start.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import fmod, pi
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from analysis import Inputs, cosimulate, simulate
from analysis.export import NATIVE, NATIVE_FMI3, build, build_native
from analysis.mechanisms import MECHANISMS
from analysis.run import Harmonics, ramp, table
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import TABLE_3_1
from linkwork.plant import Plant
from linkwork.slider_crank.published import OFFSET_CASE

#: Parameters, initial state and initial crank speed (rad/s) of the mechanisms, by name.
FREE: Mapping[str, tuple[Any, Any, float]] = {
    "five-bar": (replace(TABLE_3_1, slider_damping=0.0), InitialState(crank_speed=44.0), 44.0),
    "slider-crank": (*OFFSET_CASE, OFFSET_CASE[1].crank_speed),
}
LATE = 1e9
MANY = 1e9
TOLERANCES = (1e-9, 1e-12)
#: Frequency (rad/s) and amplitude (N) of the harmonic force.
_WAVE = (30.0, 5.0)

#: Functions that return inputs of the five-bar for a run that starts at a time t0 (s), by name.
ACTING: Mapping[str, Callable[[float], Inputs]] = {
    "constant speed": lambda t0: Inputs(speed=44.0),
    "ramp of the speed": lambda t0: Inputs(speed=ramp(0.0, 44.0, t0, t0 + 0.25)),
    "cubic table of a force": lambda t0: Inputs(
        speed=44.0, force=table(t0 + 0.125 * np.arange(6), [0.0, 1.0, 2.0, -1.0, 4.0, 0.0], "cubic")
    ),
    "harmonic force": lambda t0: Inputs(
        speed=44.0, force=Harmonics(1.0, [_WAVE[1]], [_WAVE[0]], [0.3 - fmod(_WAVE[0] * t0, 2.0 * pi)])
    ),
}


def free_run(mechanism: str, turns: float, *, begun: float = 0.0, **options: Any) -> tuple[float, float]:
    """Run a mechanism for a number of turns at its initial speed, from a crank angle of ``begun`` turns.

    Return the largest relative residual of the energy, and the angle by which the crank has turned (rad).
    """
    parameters, start, speed = FREE[mechanism]
    start = replace(start, crank_angle=2.0 * pi * begun)
    samples = np.linspace(0.0, turns * 2.0 * pi / speed, 101)
    run = simulate(parameters, initial=start, samples=samples, max_steps=10**10, **options)
    if run.status:
        raise RuntimeError(run.message)
    residual = float(np.abs(run["energy.residual"]).max() / run["energy.kinetic"][0])
    return residual, float(run["crank.angle"][-1] - run["crank.angle"][0])


def compare_late_run(what: str, **options: Any) -> tuple[float, float]:
    """Compare a run of half a second that begins at the time `LATE` (s) with a run that begins at zero.

    ``what`` is the name of the inputs of both runs in `ACTING`. Return the largest difference of the slider position relative
    to its largest magnitude, and the ratio of the numbers of steps.
    """
    # sample times that are exact floats in both runs
    samples = np.arange(513) * 2.0**-10
    runs = [simulate(TABLE_3_1, ACTING[what](t0), samples=t0 + samples, **options) for t0 in (0.0, LATE)]
    u = [run["slider.position"] for run in runs]
    return float(np.abs(u[1] - u[0]).max() / np.abs(u[0]).max()), runs[1].statistics["steps"] / runs[0].statistics[
        "steps"
    ]


def plant_run(mechanism: str, *, time: float = 0.0, begun: float = 0.0, tolerance: float = 1e-9) -> tuple[float, float]:
    """Take 300 steps of 1 ms with the Python FMU's plant, beginning at a time (s) and at a crank angle of ``begun`` turns.

    Returns the relative residual of the energy and the angle (rad) by which the crank has turned.
    """
    parameters, start, _ = FREE[mechanism]
    start = replace(start, crank_angle=2.0 * pi * begun)
    plant = Plant(MECHANISMS[mechanism], parameters, start, tolerance=tolerance, time=time)
    names = plant.mechanism.output_names
    kinetic = plant.outputs()[names.index("energy.kinetic")]
    for k in range(300):
        plant.step(time + 1e-3 * k, 1e-3)
    return plant.outputs()[names.index("energy.residual")] / kinetic, plant.state[0] - start.crank_angle


def compare_late_fmu(
    file: str | Path, mechanism: str, step: float, interface: str = "co-simulation"
) -> tuple[float, float]:
    """Compare 512 steps of a built FMU from the time `LATE` (s) with 512 steps from zero.

    Return the largest differences of the crank's angle (rad) and of the slider's position (m).
    """
    parameters, start, _ = FREE[mechanism]
    options = {"initial": start, "step": step, "interface": interface}
    runs = [cosimulate(file, parameters, start_time=t0, stop_time=t0 + 512 * step, **options) for t0 in (0.0, LATE)]
    for run in runs:
        if run.status:
            raise RuntimeError(run.message)
    angle, position = (
        float(np.abs(runs[1][name] - runs[0][name]).max()) for name in ("crank.angle", "slider.position")
    )
    return angle, position


def turns_table(turns: float, tolerances: Sequence[float] = TOLERANCES) -> Table:
    """Tabulate energy and angle after many turns.

    Angles are relative to the result of the balanced method at the tightest tolerance.
    """
    out = Table(
        "mechanism", "tolerance", "method", "energy residual", "error of the angle (rad)", title=f"{turns:g} turns"
    )
    for mechanism in FREE:
        reference = None
        for tolerance in sorted(tolerances):
            for method in ("balanced", "compiled"):
                residual, angle = free_run(mechanism, turns, method=method, tolerance=tolerance)
                off = "" if reference is None else f"{abs(angle - reference):.1e}"
                reference = angle if reference is None else reference
                row = (mechanism, f"{tolerance:g}", method, f"{residual:.1e}", off)
                print(*row, file=sys.stderr)  # a million turns take minutes a row
                out.add_row(*row)
    return out


def times_table() -> Table:
    """Tabulate runs that start at 1e9 s."""
    out = Table("inputs", "tolerance", "difference", "ratio of steps", title=f"runs from {LATE:g} s on and from 0")
    for what in ACTING:
        for tolerance in TOLERANCES:
            difference, steps = compare_late_run(what, tolerance=tolerance)
            out.add_row(what, f"{tolerance:g}", f"{difference:.1e}", f"{steps:.2f}")
    return out


def angles_table() -> Table:
    """Tabulate runs of 1000 turns that begin after many turns."""
    out = Table("mechanism", "begun after", "tolerance", "energy residual", title="1000 turns")
    for mechanism in FREE:
        for tolerance in TOLERANCES:
            for begun in (0.0, MANY):
                residual, _ = free_run(mechanism, 1000.0, begun=begun, tolerance=tolerance)
                out.add_row(mechanism, f"{begun:g} turns", f"{tolerance:g}", f"{residual:.1e}")
    return out


def fmu_table() -> Table:
    """Tabulate runs of the Python FMU's plant that begin at a late time or after many turns."""
    out = Table(
        "mechanism", "from", "energy residual", "angle, difference (rad)", title="300 steps of 1 ms of the plant"
    )
    for mechanism in FREE:
        _, reference = plant_run(mechanism)
        rows = {f"{LATE:g} s": {"time": LATE}} | {f"{n:g} turns": {"begun": n} for n in (0.0, 1e3, 1e6, MANY)}
        for name, where in rows.items():
            residual, angle = plant_run(mechanism, **where)
            out.add_row(mechanism, name, f"{abs(residual):.1e}", f"{abs(angle - reference):.1e}")
    return out


def built_table() -> Table:
    """Tabulate runs of every kind of FMU from 1e9 s on, through FMPy."""
    out = Table(
        "FMU", "interface", "step", "angle, difference (rad)", "slider (m)", title=f"512 steps from {LATE:g} s on"
    )
    with TemporaryDirectory() as folder:
        for mechanism, made in MECHANISMS.items():
            files = [build(made, folder), *(build_native(made, kind, folder) for kind in (NATIVE, NATIVE_FMI3))]
            for file, interface in product(files, ("co-simulation", "model-exchange")):
                if file is files[0] and interface == "model-exchange":
                    continue  # the Python FMU has none
                for step in (2.0**-10, 1e-3):
                    angle, position = compare_late_fmu(file, mechanism, step, interface)
                    out.add_row(file.name, interface, f"{step:g} s", f"{angle:.1e}", f"{position:.1e}")
    return out


TABLES = {"turns": turns_table, "times": times_table, "angles": angles_table, "fmu": fmu_table, "built": built_table}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=TABLES)
    parser.add_argument(
        "--turns", type=float, default=1e5, help="number of turns, for the table of turns (default: %(default)g)"
    )
    parser.add_argument(
        "--tolerances", type=float, nargs="+", default=TOLERANCES, help="tolerances, for the table of turns"
    )
    given = parser.parse_args()
    made = turns_table(given.turns, given.tolerances) if given.table == "turns" else TABLES[given.table]()
    Console(width=120).print(made)


if __name__ == "__main__":
    main()
