"""Compare work and precision of all solvers and engines on the same runs, and the cost of a run in ensembles up to a million.

    python -m benchmarks.precision docs
    python -m benchmarks.precision docs --runs 10000

writes ``work-precision.png`` and ``cost-of-runs.png`` into a folder, and prints the costs of runs as a table. Times are ratios:
in the first picture to the compiled integration at the accuracy of `benchmarks.accuracy`, in the second to one run alone. Each
time is the least of several, measured in one process. Engines that are not installed (extra ``bench``) are left out and named.
"""

from argparse import ArgumentParser
from collections.abc import Callable, Iterable
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from analysis import Inputs, simulate, simulate_many
from analysis.figures import Curve, Panel, plot_curves
from analysis.figures.style import COLOURS
from benchmarks import engines
from benchmarks.accuracy import ACCURACY, SCIPY_METHODS, shortest_time
from benchmarks.engine_cases import CASES, Case, relative_error, run_in_process, run_scipy
from benchmarks.ensembles import integration_time, without_lanes
from linkwork.five_bar.published import SETS, TABLE_3_1

#: Tolerances of the solvers.
TOLERANCES = 10.0 ** np.arange(-3.0, -12.5, -0.5)
#: Numbers of runs in the ensembles.
COUNTS = (1, 10, 100, 1_000, 10_000, 100_000, 1_000_000)
OURS = "Linkwork, integration"
_TITLES = {"constant-speed": "Table 3.1, 420 rpm, three turns", "torsion-bar": "under a torsion bar, 0.5 s"}


class Point(NamedTuple):
    """Error of a run, relative to the largest slider position, and its time (s)."""

    error: float
    seconds: float


def measure_in_process(case: Case, part: str) -> list[Point]:
    """Measure the compiled solver at all tolerances: the "integration" alone, or the "whole" call with all outputs."""
    run = partial(run_in_process, case)
    measure_time = shortest_time if part == "whole" else integration_time
    points = []
    for tolerance in TOLERANCES.tolist():
        error = relative_error(case, run(tolerance)["slider.position"])
        points.append(Point(error, measure_time(partial(run, tolerance), 40)))
    return points


def measure_scipy(case: Case, method: str) -> list[Point]:
    """Measure one of SciPy's methods on the right-hand side in plain Python, at every other one of `TOLERANCES`."""
    runs = [partial(run_scipy, case, method, tolerance) for tolerance in TOLERANCES[::2].tolist()]
    return [Point(relative_error(case, run()), shortest_time(run, 2)) for run in runs]


def measure_engine(case: Case, engine: engines.Engine, run: engines.Run) -> list[Point]:
    """Measure a multibody engine over a series of steps."""
    steps = engines.time_steps(case, engine.first_step, engine.last_step, 0.5)
    found = (engines.fastest_run(run, case, step, 2) for step in steps)
    return [Point(result.error, result.seconds) for result in found]


def measure_case(case: Case, say: Callable[[str], None]) -> dict[str, list[Point]]:
    """Measure all solvers that are installed on a case; return their points by name, ours first."""
    found = {OURS: measure_in_process(case, "integration"), "Linkwork, all outputs": measure_in_process(case, "whole")}
    found |= {f"SciPy {method}": measure_scipy(case, method) for method in SCIPY_METHODS}
    mujoco, exudyn = engines.ENGINES
    for name, engine, run in (
        ("MuJoCo", mujoco, partial(engines.run_mujoco, iterations=2)),
        ("MuJoCo, its model file alone", mujoco, partial(engines.run_mujoco, stiffened=False)),
        ("Exudyn", exudyn, partial(engines.run_exudyn, newton_tolerance=1e-9)),
    ):
        try:
            found[name] = measure_engine(case, engine, run)
        except ImportError as error:
            say(f"left out, not installed (extra 'bench'): {error.name or error}")
    return found


def least_time_at_accuracy(points: Iterable[Point]) -> float:
    """Return the least time of the points that reach the accuracy."""
    return min(point.seconds for point in points if point.error <= ACCURACY)


def picture(found: dict[str, dict[str, list[Point]]]) -> Any:
    """Return a figure of the error over time, with a panel for each case; ``found`` has the points by case and solver."""
    panels = []
    for case, solvers in found.items():
        unit = least_time_at_accuracy(solvers[OURS])
        curves = []
        for name, points in solvers.items():
            usable = [p for p in points if isfinite(p.error) and p.error < 1.0]
            width = 2.2 if name.startswith("Linkwork") else 1.0
            # there are fewer colours than solvers: the others repeat a colour with a broken line
            again = len(curves) >= len(COLOURS)
            line, label = "--" if again else "-", "" if panels else name
            times, errors = [p.seconds / unit for p in usable], [p.error for p in usable]
            curves.append(Curve(x=times, y=errors, label=label, marker="o", width=width, line=line, hollow=again))
        x, y = "time, over that of our integration to 1e-6", "error of the slider position"
        at = "" if panels else "outside"
        panels.append(Panel(x_label=x, y_label=y, title=_TITLES[case], curves=curves, logarithmic="xy", legend_at=at))
    return plot_curves(panels, title="Work and precision")


def costs(most: int) -> list[tuple[int, float, float]]:
    """Measure ensembles of up to ``most`` runs.

    Returns a row for each ensemble: number of runs, and time per run over the time of one run alone, with and without lanes.
    """
    speed = SETS["table-3.1"].crank_speed
    settings = {"stop_time": 0.1, "step": 1e-2}
    alone = shortest_time(lambda: simulate(TABLE_3_1, Inputs(speed=speed), **settings), 40)
    rows = []
    for count in (count for count in COUNTS if count <= most):
        values = {"slider.stiffness": np.linspace(500.0, 1500.0, count)}

        def together(values: dict[str, Any] = values) -> object:
            return simulate_many(TABLE_3_1, Inputs(speed=speed), vary=values, outputs=["slider.position"], **settings)

        repeats = max(1, min(20, 20_000 // count))
        lanes = shortest_time(together, repeats)
        with without_lanes():
            apart = shortest_time(together, max(1, repeats // 4))
        rows.append((count, lanes / count / alone, apart / count / alone))
    return rows


def cost_picture(rows: list[tuple[int, float, float]]) -> Any:
    """Return a figure of the cost of a run over the number of runs."""
    counts, lanes, apart = zip(*rows)
    curves = [
        Curve(x=counts, y=apart, label="one after the other", marker="o"),
        Curve(x=counts, y=lanes, label="in lanes", marker="o", width=2.2),
    ]
    y = "time of a run, over that of one alone"
    panel = Panel(x_label="runs", y_label=y, curves=curves, logarithmic="xy", legend_at="best")
    return plot_curves([panel], title="Cost of a run in an ensemble: Table 3.1, 0.1 s, one core")


def main() -> None:
    parser = ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder for the pictures")
    parser.add_argument(
        "--runs", type=int, default=COUNTS[-1], help="greatest number of runs in an ensemble (default: %(default)s)"
    )
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    console = Console(width=110)
    found = {case.name: measure_case(case, lambda text: console.print(text, highlight=False)) for case in CASES}
    picture(found).savefig(options.folder / "work-precision.png", dpi=110)
    rows = costs(options.runs)
    cost_picture(rows).savefig(options.folder / "cost-of-runs.png", dpi=110)
    table = Table("runs", "in lanes", "one after the other", title="time per run, divided by that of a single run")
    for count, lanes, apart in rows:
        table.add_row(f"{count:,}", f"{lanes:.3f}", f"{apart:.3f}")
    console.print(table)


if __name__ == "__main__":
    main()
