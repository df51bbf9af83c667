"""Measure how well each master follows a varying commanded speed: error of the coordinate after 0.2 s, and order of this error.

    python -m benchmarks.commanded                   # all masters, two minutes; writes docs/commanded.csv
    python -m benchmarks.commanded --master FMPy     # one of them (repeatable); prints its results

The command is the speed a + b sin(20 t). It is set at the communication points, alone or together with its rate of change. The
coordinate is the integral of the speed. Each master runs in a process of its own. `docs/generate.py` puts the table into
docs/fmu.md.
"""

import argparse
import tempfile
from collections.abc import Callable
from math import cos, log2, sin
from pathlib import Path
from typing import Any, NamedTuple

from analysis.export import KINDS, build, build_native
from analysis.mechanisms import MECHANISMS
from linkwork.mechanism import Mechanism
from tests.fmu import masters
from tests.fmu.runner import run_in_process

from . import tables

RESULTS = Path(__file__).parents[1] / "docs" / "commanded.csv"
#: Both communication steps (s), and the number of steps of a run at the first, longer one.
STEPS, COUNT = (2e-3, 1e-3), 100
#: Errors below this limit come from the solvers and from rounding.
LEAST = 1e-9
#: Rows of a table: texts by heading.
Table = list[dict[str, str]]


class Command(NamedTuple):
    """A commanded speed of a mechanism: FMI names of speed, rate of change and coordinate, and a and b of a + b sin(20 t)."""

    mechanism: str
    speed: str
    rate: str
    coordinate: str
    a: float
    b: float


COMMANDS = (
    Command("five-bar", "drive.speed", "drive.acceleration", "crank.angle", 40.0, 10.0),
    Command("slider-crank", "axial.speed", "axial.acceleration", "shift.position", 0.0, 0.3),
)


# The masters that are not called step by step: each function runs in a process of its own and imports there what it needs. It
# takes cases. A case has an FMU, the fields of a `Command`, whether the rate is also set, the communication step, the number of
# steps, and the arguments of a `Row`. The function returns the coordinate at the end of each case.


def by_fmpy(cases: list[Any]) -> list[float]:
    """Run the cases by FMPy's `simulate_fmu`; return the coordinate at the end of each case.

    With CVode it sets inputs only at the ends of CVode's own steps; the table of the command is therefore dense.
    """
    import numpy as np
    from fmpy import simulate_fmu

    def run(
        fmu: str,
        command: list[Any],
        rated: bool,
        step: float,
        count: int,
        kind: str = "CoSimulation",
        solver: str = "Euler",
    ) -> float:
        _, speed, rate, coordinate, a, b = command
        times = np.linspace(0.0, count * step, (count if solver == "Euler" else 100 * count) + 1)
        columns = {"time": times, speed: a + b * np.sin(20.0 * times)}
        if rated:
            columns[rate] = 20.0 * b * np.cos(20.0 * times)
        rows = simulate_fmu(
            fmu,
            fmi_type=kind,
            solver=solver,
            stop_time=count * step,
            step_size=step,
            output_interval=step,
            relative_tolerance=1e-9,
            start_values={speed: a},
            input=np.array(list(zip(*columns.values())), dtype=[(name, float) for name in columns]),
            output=[coordinate],
        )
        return float(rows[-1][coordinate])

    return [run(*case) for case in cases]


def by_pathsim(cases: list[Any]) -> list[float]:
    """Run the cases by PathSim's block for co-simulation or, if a solver is given, by its block for model exchange.

    Return the coordinate at the end of each case.
    """
    from math import cos, sin

    import pathsim.solvers
    from pathsim import Connection, Simulation
    from pathsim.blocks import Source
    from pathsim_fmi.blocks import CoSimulationFMU, ModelExchangeFMU

    def run(fmu: str, command: list[Any], rated: bool, step: float, count: int, solver: str = "") -> float:
        _, speed, rate, coordinate, a, b = command
        start = {speed: a}
        block = ModelExchangeFMU(fmu, "one", start) if solver else CoSimulationFMU(fmu, "one", start, dt=step)
        laws = {name: (lambda t: 0.0) for name in block.fmu_wrapper.input_refs}
        laws["drive.speed"] = lambda t: 5.0
        laws[speed] = lambda t: a + b * sin(20.0 * t)
        if rated:
            laws[rate] = lambda t: 20.0 * b * cos(20.0 * t)
        sources = [Source(law) for law in laws.values()]
        connections = [Connection(source, block[place]) for place, source in enumerate(sources)]
        options = {"Solver": getattr(pathsim.solvers, solver), "tolerance_lte_rel": 1e-9} if solver else {}
        simulation = Simulation([*sources, block], connections, dt=step, log=False, **options)
        # the block for co-simulation takes its step at the beginning of each period
        simulation.run(count * step if solver else (count - 1.5) * step)
        return float(dict(zip(block.fmu_wrapper.output_refs, block.fmu_wrapper.get_outputs_as_array()))[coordinate])

    return [run(*case) for case in cases]


def by_cosimulate(cases: list[Any]) -> list[float]:
    """Run the cases by `analysis.cosimulate`, which sets the rate itself; return the change of the coordinate in each case."""
    from math import cos, sin

    from analysis import Function, Inputs, cosimulate
    from analysis.mechanisms import MECHANISMS

    def run(fmu: str, command: list[Any], rated: bool, step: float, count: int, interface: str) -> float:
        mechanism, _, _, coordinate, a, b = command
        parameters = next(iter(MECHANISMS[mechanism].published.values())).parameters

        def speed(t: float, q1: float, q2: float, v1: float, v2: float) -> float:
            return float(a + b * sin(20.0 * t))

        def rate(t: float, q1: float, q2: float, v1: float, v2: float) -> float:
            return float(20.0 * b * cos(20.0 * t))

        law = Function(speed, rate)
        inputs = Inputs(speed=law) if mechanism == "five-bar" else Inputs(speed=5.0, shift_speed=law)
        found = cosimulate(fmu, parameters, inputs, stop_time=count * step, step=step, interface=interface)
        return float(found[coordinate][-1] - found[coordinate][0])

    return [run(*case) for case in cases]


def by_steps(by: Callable[..., Any], cases: list[Any]) -> list[float]:
    """Run the cases by a function of `tests.fmu.masters`, which calls a master step by step.

    Return the coordinate at the end of each case.
    """

    def run(fmu: str, command: list[Any], rated: bool, step: float, count: int) -> float:
        _, speed, rate, coordinate, a, b = command
        given = [
            {speed: a + b * sin(20.0 * n * step)} | ({rate: 20.0 * b * cos(20.0 * n * step)} if rated else {})
            for n in range(count)
        ]
        # CoFMUPy sets an input that is not connected to zero
        starts = ({"drive.speed": 5.0} if by is masters.by_cofmupy else {}) | {speed: a}
        case = [starts, {}, "", 0.0]
        found = run_in_process(by, fmu, case, [coordinate], "", step, given, options=(), timeout=300.0)
        return float(found["end"][coordinate])

    return [run(*case) for case in cases]


class Row(NamedTuple):
    """A row of the table: a master with one interface, on FMUs of some kinds.

    ``by`` runs the master with ``arguments``; ``sets_rate`` tells whether the master sets the rate of a command by itself.
    """

    master: str
    interface: str
    kinds: tuple[str, ...]
    by: Callable[..., Any]
    arguments: tuple[str, ...] = ()
    sets_rate: bool = False


BOTH = ("native", "native-fmi3")
_STEPS, _STATES = "co-simulation", "model exchange"
ROWS = (
    Row("FMPy", _STEPS, tuple(KINDS), by_fmpy),
    Row("FMPy", f"{_STATES}, Euler", BOTH, by_fmpy, ("ModelExchange", "Euler")),
    Row("FMPy", f"{_STATES}, CVode", BOTH, by_fmpy, ("ModelExchange", "CVode")),
    Row("libcosimpy", _STEPS, ("native",), masters.by_libcosimpy),
    Row("ecospy", _STEPS, BOTH, masters.by_ecospy),
    Row("CoFMUPy", _STEPS, BOTH, masters.by_cofmupy),
    Row("PathSim", _STEPS, BOTH, by_pathsim),
    Row("PathSim", f"{_STATES}, RK4", BOTH, by_pathsim, ("RK4",)),
    Row("PathSim", f"{_STATES}, RKDP54", BOTH, by_pathsim, ("RKDP54",)),
    Row("`cosimulate`", _STEPS, BOTH, by_cosimulate, ("co-simulation",), True),
    Row("`cosimulate`", "`linear-co-simulation`", ("native",), by_cosimulate, ("linear-co-simulation",), True),
    Row("`cosimulate`", f"{_STATES}, CVode", BOTH, by_cosimulate, ("model-exchange",), True),
)


def _column(command: Command, rated: bool) -> str:
    return f"`{command.rate}` too" if rated else f"`{command.speed}`"


COLUMNS = [_column(command, rated) for command in COMMANDS for rated in (False, True)]


def built_fmu(mechanism: Mechanism, kind: str, folder: Path) -> Path:
    """Return the path of a mechanism's FMU of the given kind in a folder; build the FMU if it is missing."""
    target = folder / KINDS[kind].file_name(mechanism)
    if not target.is_file():
        target = build(mechanism, folder) if kind == "python" else build_native(mechanism, KINDS[kind], folder)
    return target


def exact_end(command: Command, row: Row) -> float:
    """Return the exact coordinate at the end of a run.

    For `cosimulate`, which starts from another coordinate, the result is the exact change of the coordinate.
    """
    end = COUNT * STEPS[0]
    start = {v.name: v.start for v in MECHANISMS[command.mechanism].variables}[
        f"initial.{command.coordinate.replace('.', '_')}"
    ]
    return command.a * end + command.b * (1.0 - cos(20.0 * end)) / 20.0 + (0.0 if row.sets_rate else float(start))


def format_errors(errors: list[float]) -> str:
    """Format the error at the smaller step and the order of the error, from the errors at both steps."""
    coarse, fine = errors
    if fine < LEAST:
        return f"below {LEAST:.0e}"
    order = round(log2(coarse / fine), 1)
    return f"{fine:.1e}, {'whatever the step' if abs(order) < 0.5 else f'order {order:g}'}"


def measure_master(master: str, folder: Path) -> Table:
    """Measure a master and return its rows of the table; a cell has several results if the kinds of FMU differ."""
    looked = [
        (row, command, rated, kind)
        for row in ROWS
        for command in COMMANDS
        for rated in (False, True)
        for kind in row.kinds
        if row.master == master and (rated or not row.sets_rate)
    ]
    cases: list[list[Any]] = []
    for row, command, rated, kind in looked:
        fmu = str(built_fmu(MECHANISMS[command.mechanism], kind, folder))
        cases += [[fmu, [*command], rated, h, round(COUNT * STEPS[0] / h), *row.arguments] for h in STEPS]
    by = looked[0][0].by
    stepwise = by.__module__ == masters.__name__
    ends = by_steps(by, cases) if stepwise else run_in_process(by, cases, options=(), timeout=3000.0)
    table: dict[Row, dict[str, str]] = {}
    for n, (row, command, rated, kind) in enumerate(looked):
        found = table.setdefault(row, {"master": row.master, "interface": row.interface} | dict.fromkeys(COLUMNS, ""))
        name = _column(command, rated)
        said = format_errors([abs(end - exact_end(command, row)) for end in ends[2 * n : 2 * n + 2]])
        if not found[name]:
            found[name] = said
        elif found[name] != said:
            found[name] += f"; {kind}: {said}"
    return [{name: said or "-" for name, said in found.items()} for found in table.values()]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = tuple(dict.fromkeys(row.master for row in ROWS))
    parser.add_argument("--master", choices=names, action="append", help="run only this master (repeatable)")
    parser.add_argument("--fmus", type=Path, help="folder of FMUs that are built already")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = (chosen.fmus or Path(place)).resolve()
        table = [row for master in chosen.master or names for row in measure_master(master, folder)]
    headings, rows = list(table[0]), [row.values() for row in table]
    if not chosen.master:
        tables.write(RESULTS, headings, rows)
    print(tables.markdown(headings, rows))
