"""Waiting times: imports, first results on an empty cache of compiled code, and the same again.

    python -m benchmarks.first

Each is a process of its own; times are by the clock, and of the processor, which other programs change less.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from time import perf_counter

from rich.console import Console
from rich.table import Table

#: Arguments of Python; what is written goes to the folder in which they run.
WAITS = {
    "import analysis": ("-c", "import analysis"),
    "linkwork --version": ("-m", "analysis.cli", "--version"),
    "simulate, Table 3.1": ("-c", "import analysis; analysis.simulate('table-3.1', stop_time=0.5)"),
    "linkwork resonance --published rig-2-spring-c": (
        "-m",
        "analysis.cli",
        "resonance",
        "--published",
        "rig-2-spring-c",
    ),
}


def waited(arguments: tuple[str, ...], folder: str) -> tuple[str, str, str]:
    """Measure seconds by the clock and of the processor, and count the announced compilations."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    environment = os.environ | {"LINKWORK_CACHE_DIR": folder}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    seconds, after = perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return f"{seconds:.2f}", f"{processor:.2f}", str(done.stderr.count("linkwork: compiling"))


def main() -> None:
    """Measure and print."""
    table = Table(title="seconds by the clock, of the processor; compilations")
    for heading in ("", *("first", "s", "compiled"), *("again", "s", "compiled")):
        table.add_column(heading, justify="right" if heading else "left")
    for what, arguments in WAITS.items():
        with tempfile.TemporaryDirectory() as folder:
            table.add_row(what, *waited(arguments, folder), *waited(arguments, folder))
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
