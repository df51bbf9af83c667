"""Measure the processor time of `linkwork resonance`, as a whole and by its parts, with everything compiled.

    python -m benchmarks.resonance
    python -m benchmarks.resonance rig-1-spring-b

The whole command runs as a process of its own. It is run once before it is timed, so that the machine code is in the cache. Its
parts are then run in this process, one after the other. All times are processor times; other work on the machine hardly
changes them.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console

from . import tables
from .first import COMMAND, measure_waiting

#: Defaults of the command: range of speeds relative to the natural frequency, and how many period doublings are followed.
RANGE, DOUBLINGS = (0.15, 2.3), 3


def parts(name: str, folder: str) -> dict[str, float]:
    """Return the processor time (s) of each part of the command, by name."""
    times: dict[str, float] = {}

    def time_part(what: str, does: Callable[[], Any]) -> Any:
        begin = time.process_time()
        result = does()
        times[what] = time.process_time() - begin
        return result

    def imports() -> None:
        import numba  # noqa: F401 - with its dependencies

        from analysis import figures, periodic, youssef

        _ = figures.plot, periodic.frequency_response, youssef.approximations

    time_part("imports", imports)
    from analysis import figures
    from analysis.files import save_figure
    from analysis.periodic import frequency_response, natural_frequency, with_isolas
    from analysis.youssef import approximations
    from linkwork.five_bar.published import SETS

    rig = SETS[name].parameters
    low, high = (factor * natural_frequency(rig) for factor in RANGE)
    response = time_part("motions followed", lambda: frequency_response(rig, low, high, doublings=DOUBLINGS))
    response = time_part("all motions sought at five speeds", lambda: with_isolas(response))
    points = sum(map(len, response.branches))
    time_part(f"outputs over a turn of {points} points", lambda: response.to_csv(Path(folder) / "response.csv"))
    time_part(
        "maxima and minima, speeds to avoid", lambda: (response.maxima(), response.minima(), response.speeds_to_avoid)
    )
    beside = time_part("classical approximations", lambda: approximations(response))
    picture = time_part("figure", lambda: figures.plot(response, title=name, beside=beside))
    time_part("picture written", lambda: save_figure(picture, Path(folder) / "response.png"))
    return times


def main(name: str) -> None:
    """Measure the command and its parts, and print the times."""
    table = tables.numbers(f"linkwork resonance --published {name}, processor time", ("", "s"))
    command = (COMMAND, "resonance", "--published", name, "--out", "out")
    with tempfile.TemporaryDirectory() as folder:
        measure_waiting(command, folder)
        table.add_row("the command, warm", measure_waiting(command, folder)[1])
        for part, seconds in parts(name, folder).items():
            table.add_row(f"  {part}", f"{seconds:.2f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", nargs="?", default="rig-2-spring-c", help="published set")
    main(parser.parse_args().name)
