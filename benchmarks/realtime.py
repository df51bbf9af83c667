"""Measure step times and missed deadlines of `motor-tracking`, a motor, five-bar slider and controllers, in one C program.

    python -m benchmarks.realtime [--steps 1000000] [--seconds 10]

The program first takes the given number of steps as fast as it can. Then it takes 1000 and 4000 steps a second for the given
number of seconds: each step begins at its scheduled time and must end before the next one begins. These runs are made with
normal priority and, where `chrt` is permitted, with real-time priority. The same system is also timed in the Python master.
"""

import argparse
import platform
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from analysis.systems import Wiring, build_host, library, load_system, run_system

from . import tables

RATES = (1000, 4000)
REAL_TIME = ("chrt", "--fifo", "50")
PERCENTILES = ("median", "99%", "99.9%", "99.99%", "worst")


def run_host(host: Path, steps: int, rate: float | None = None, *, by: Sequence[str] = ()) -> dict[str, float]:
    """Run the C program and return the numbers that it prints, by name; ``by`` is a command that starts it, such as `chrt`.

    ``rate`` is the number of steps a second; without it the steps are taken as fast as possible.
    """
    words = [*by, str(host), str(steps), *([] if rate is None else [f"{rate:g}"])]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)} ended with {done.returncode}: {done.stderr}")
    return {name: float(value) for name, value in (line.split() for line in done.stdout.splitlines())}


def python_step(wiring: Wiring, steps: int = 1000) -> float:
    """Measure the time (s) of a step of the Python master, without its start."""

    def run(count: int) -> float:
        begun = time.perf_counter()
        assert run_system(wiring, stop_time=count * wiring.step).status == 0
        return time.perf_counter() - begun

    return min((run(2 * steps) - run(steps)) / steps for _ in range(3))


def may_be_real_time() -> bool:
    """Return whether `chrt` may give a process real-time priority on this machine."""
    return (
        shutil.which(REAL_TIME[0]) is not None
        and not subprocess.run([*REAL_TIME, "true"], capture_output=True).returncode
    )


def processor() -> str:
    """Return the name of the processor's model."""
    try:
        found = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    except OSError:
        found = None
    return found[1] if found else platform.machine()


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--steps", type=int, default=1_000_000, help="number of steps of the run as fast as possible")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of each run at a fixed rate (s)")
    options = parser.parse_args(arguments)
    console = Console(width=120)
    wiring = load_system(library()["motor-tracking"]).wiring()
    with tempfile.TemporaryDirectory() as folder:
        host = build_host(wiring, folder)
        free = run_host(host, options.steps)
        ways: dict[str, tuple[str, ...]] = {"": ()} | ({", real-time": REAL_TIME} if may_be_real_time() else {})
        paced = {
            (way, rate): run_host(host, round(rate * options.seconds), rate, by=by)
            for rate in RATES
            for way, by in ways.items()
        }
    percentiles = [name.replace("%", " %") for name in PERCENTILES]
    title = f"{wiring.title}: a communication step of the C program, microseconds, on {processor()}"
    table = tables.numbers(title, ("run", "steps", *percentiles), ("run",))
    rows = {f"as fast as possible, {1e3 * wiring.step:g} ms": free}
    rows |= {f"{rate / 1000:g} kHz{way}": run for (way, rate), run in paced.items()}
    for what, run in rows.items():
        table.add_row(what, f"{run['steps']:.0f}", *(f"{run[f'step_us_{p}']:.1f}" for p in PERCENTILES))
    console.print(table)
    title = "Deadlines missed, and how late a step began, microseconds"
    report = tables.numbers(title, ("run", "deadlines", "missed", "latest", *percentiles), ("run",))
    for (way, rate), run in paced.items():
        counts = (f"{run[name]:.0f}" for name in ("steps", "deadlines_missed", "latest_us"))
        report.add_row(f"{rate / 1000:g} kHz{way}", *counts, *(f"{run[f'wake_us_{p}']:.1f}" for p in PERCENTILES))
    console.print(report)
    python = 1e6 * python_step(wiring)
    middle = free["step_us_median"]
    console.print(
        f"a step in the Python master: {python:.0f} microseconds, {python / middle:.0f} times the median of the C program; "
        f"that needs {100.0 * middle * 1e-6 * RATES[0]:.2g} % of 1 ms, {100.0 * middle * 1e-6 * RATES[1]:.2g} % of 0.25 ms",
        highlight=False,
    )
    console.print(
        f"pool: {free['pool_bytes']:.0f} bytes at the start, {free['pool_bytes_in_steps']:.0f} in the steps; memory "
        f"{'locked' if free['memory_locked'] else 'not locked'}",
        highlight=False,
    )


if __name__ == "__main__":
    main()
