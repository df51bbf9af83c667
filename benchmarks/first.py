"""Measure waiting times of imports and of first results: with an empty cache of compiled code, and again with the filled cache.

    python -m benchmarks.first
    python -m benchmarks.first linkages
    python -m benchmarks.first linkages klann watt-1

The second and third commands measure linkages of the library: from the file to a run and to a native FMU, with an empty cache,
with a cache that another linkage has filled, and once more. An empty cache is measured twice: without the kernels that an
installation carries, and with them.

Each measurement is a process of its own. Times are wall-clock times and processor times; other programs change the latter less.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from rich.console import Console
from rich.table import Table

from . import tables

#: Code for Python and its arguments, by name; the code runs in a folder of its own, into which it writes its files.
COMMAND = "from analysis.cli import main; main()"
WAITS = {
    "import analysis": ("import analysis",),
    "linkwork --version": (COMMAND, "--version"),
    "simulate, Table 3.1": ("import analysis; analysis.simulate('table-3.1', stop_time=0.5)",),
    "linkwork resonance --published rig-2-spring-c": (COMMAND, "resonance", "--published", "rig-2-spring-c"),
}
#: Names of the entries of `WAITS` that use no compiled code.
IDLE = ("import analysis", "linkwork --version")
#: Code that runs first to hide the kernels that the installation carries.
WITHOUT = "from pathlib import Path; from analysis.numerics import codegen; codegen.CARRIED = Path('none'); "

#: Commands on the file of a linkage, whose path is the last argument.
FROM_A_FILE = {"run": (COMMAND, "run"), "native FMU": (COMMAND, "build", "--kinds", "native", "--dest", ".")}
LIBRARY = Path(__file__).parents[1] / "examples" / "linkages"
#: The linkage that fills the cache for the others.
BEFORE = "toggle-press"
#: Linkages measured by default: two walking legs, one linkage with gears, one with springs as bearings.
MEASURED = ("klann", "jansen", "geared-five-bar", "elastic-bearing")


def measure_waiting(arguments: tuple[str, ...], folder: str) -> tuple[str, str, str]:
    """Run Python with these arguments; return wall-clock and processor time (s) and the number of announced compilations."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    # Python keeps the modules that it has compiled, as for any user
    environment = os.environ | {"LINKWORK_CACHE_DIR": folder, "PYTHONDONTWRITEBYTECODE": ""}
    done = subprocess.run(
        [sys.executable, "-c", *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    seconds, after = perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return f"{seconds:.2f}", f"{processor:.2f}", str(done.stderr.count("linkwork: compiling"))


def measure_first(arguments: tuple[str, ...], *, carried: bool) -> tuple[str, str, str]:
    """Return the result of `measure_waiting` for an empty cache, with or without the kernels that the installation carries."""
    code, *others = arguments
    with tempfile.TemporaryDirectory() as folder:
        return measure_waiting((code if carried else WITHOUT + code, *others), folder)


def _empty_table(title: str, *states: str) -> Table:
    """Return a table with the three numbers of `measure_waiting` for each state of the cache."""
    headings = (heading for state in states for heading in (state, "s", "compiled"))
    return tables.numbers(f"{title}; seconds by the clock, of the processor; compilations", ("", *headings))


def linkages(names: list[str]) -> Table:
    """Return a table of the time that each linkage takes from its file to a run and to a native FMU."""
    table = _empty_table("from file", "no kernels", "empty cache", "another before", "again")
    for name in names:
        for what, command in FROM_A_FILE.items():
            measured, other = ((*command, str(LIBRARY / f"{own}.toml")) for own in (name, BEFORE))
            empty = [*measure_first(measured, carried=False), *measure_first(measured, carried=True)]
            with tempfile.TemporaryDirectory() as folder:
                measure_waiting(other, folder)
                filled = [text for _ in range(2) for text in measure_waiting(measured, folder)]
                table.add_row(f"{name}: {what}", *empty, *filled)
    return table


def main() -> None:
    """Measure and print the tables."""
    if sys.argv[1:2] == ["linkages"]:
        Console(width=180).print(linkages(sys.argv[2:] or list(MEASURED)))
        return
    table = _empty_table("installation", "no kernels", "first", "again")
    for what, arguments in WAITS.items():
        with tempfile.TemporaryDirectory() as folder:
            bare = measure_first(arguments, carried=False) if what not in IDLE else ("", "", "")
            table.add_row(what, *bare, *measure_waiting(arguments, folder), *measure_waiting(arguments, folder))
    Console(width=150).print(table)


if __name__ == "__main__":
    main()
