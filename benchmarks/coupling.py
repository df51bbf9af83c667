"""Measure the errors that coupling of systems causes, in our and other masters, over four decades of communication step.

    python -m benchmarks.coupling                          # every system of the library, and the other masters: an hour
    python -m benchmarks.coupling --system press           # one system (repeatable), without the other masters
    python -m benchmarks.coupling --masters                # the other masters alone: ten minutes
    python -m benchmarks.coupling --decades 2              # a hundredth of the time

The reference is the system as one model, integrated by SciPy at a tolerance of 1e-12. For our couplings the error is the
greatest error of all connected outputs over the run. For the other masters, which hold inputs, the error is that of the crank
speed at the end of the run. The tables are printed; the plots go into the folder ``--out``.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from analysis import figures
from analysis.systems import Convergence, JoinedSystem, convergence, library, load_system, write_ssp
from tests.fmu.runner import run_in_process
from tests.systems import masters
from tests.systems.conftest import started_in_its_modes

from . import tables

#: Number of communication steps of a run at the greatest step.
POINTS = 20
#: Other masters, each with whether it sets no integers and therefore needs FMUs that start in the modes of the system.
MASTERS = {
    "FMPy": (masters.by_fmpy, False),
    "libcosimpy": (masters.by_libcosimpy, False),
    "ecospy": (masters.by_ecospy, False),
    "CoFMUPy": (masters.by_cofmupy, True),
    "PathSim": (masters.by_pathsim, False),
}
CONSOLE = Console(width=128)


def show(found: Convergence, powers: bool = True) -> None:
    """Print errors and orders; with ``powers`` also each error divided by the share of work that the coupling has added."""
    table = tables.numbers(f"{found.title}: greatest relative error", ("step [ms]", *found.errors))
    for n, step in enumerate(found.steps):
        table.add_row(f"{1e3 * step:.4g}", *(f"{errors[n]:.1e}" for errors in found.errors.values()))
    table.add_row("order", *(f"{found.order(way):.2f}" for way in found.errors))
    if powers:
        ratios = {
            way: found.errors[way] / np.where(found.powers[way] > 0.0, found.powers[way], np.nan)
            for way in found.errors
        }
        good = {way: ratio[np.isfinite(ratio) & (found.errors[way] < 0.1)] for way, ratio in ratios.items()}
        rows = [f"{r.min():.2g} to {r.max():.2g}" if len(r) else "-" for r in good.values()]
        table.add_row("error / share added", *rows)
    CONSOLE.print(table)


def measure_our_couplings(name: str, decades: int, out: Path) -> None:
    """Measure all couplings of our master on a system of the library; print the errors and save the plot."""
    system = load_system(library()[name])
    periods = [m.values.get("sample_time", 1e-3) for m in system.members.values() if m.controller]
    first = min([system.run.step, *periods])
    found = convergence(system, decades=decades, stop_time=POINTS * first, progress=CONSOLE.is_terminal)
    show(found)
    figures.plot(found).savefig(out / f"coupling-{name}.png", dpi=110)


def measure_other_masters(steps: Sequence[float], stop_time: float, out: Path) -> None:
    """Measure the other masters, which hold inputs, on the system motor-crank; print the errors and save the plot."""
    system = load_system(library()["motor-crank"]).without_rates()
    name = "linkage.crank.speed"
    right = JoinedSystem(system).run(stop_time, stop_time)[name][-1]
    errors = {}
    with tempfile.TemporaryDirectory() as folder:
        plain = write_ssp(system.wiring(), Path(folder, "plain.ssp"))
        started = write_ssp(started_in_its_modes("motor-crank", Path(folder)), Path(folder, "started.ssp"))
        for master, (run, modes) in MASTERS.items():
            archive = str(started if modes else plain)
            ends = [
                run_in_process(run, archive, h, round(stop_time / h), [name], options=(), timeout=3600.0)[name]
                for h in steps
            ]
            errors[master] = np.abs(np.array(ends) - right) / abs(right)
    none: dict[str, np.ndarray] = {master: np.zeros(len(steps)) for master in errors}
    title = "Motor, shaft and five-bar slider, other masters: crank speed at the end"
    found = Convergence(title=title, steps=np.array(steps), errors=errors, powers=none, messages={})
    show(found, powers=False)
    figures.plot(found).savefig(out / "coupling-masters.png", dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--system", choices=tuple(library()), action="append", help="measure only this system (repeatable)"
    )
    parser.add_argument("--masters", action="store_true", help="measure only the other masters")
    parser.add_argument("--decades", type=int, default=4, help="decades of steps (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the plots (default: %(default)s)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for name in options.system or (() if options.masters else library()):
        measure_our_couplings(name, options.decades, options.out)
    if options.masters or not options.system:
        measure_other_masters([10.0 ** -(3 + n) for n in range(options.decades + 1)], 1e-3 * POINTS, options.out)


if __name__ == "__main__":
    main()
