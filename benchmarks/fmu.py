"""Cost of a communication step of the FMU, beside a trivial slave and beside the in-process solver.

    python -m benchmarks.fmu

Table 3.1 at 420 rpm, steps of 1 ms through FMPy, all inputs set and all outputs read at each step; the trivial slave has
as many variables and does nothing. Each row is the best of several runs.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from linkwork.five_bar.GONE import SPEED_DRIVE
from pythonfmu.builder import FmuBuilder
from rich.console import Console
from rich.table import Table

from analysis import Inputs, simulate
from analysis.export import build
from build_fmu import FMUS
from linkwork.five_bar import dynamics
from linkwork.five_bar.published import SETS
from linkwork.plant import Plant

STEP = 1e-3
STEPS = 430
REPEATS = 5

TRIVIAL = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Trivial(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for i in range(6):
            setattr(self, f"i{i}", 0.0)
            self.register_variable(Real(f"i{i}", causality=Fmi2Causality.input))
        for i in range(27):
            setattr(self, f"o{i}", 0.0)
            self.register_variable(Real(f"o{i}", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
"""


def seconds_per_step(fmu: Path) -> tuple[float, float]:
    """Best time of a step with its inputs set and outputs read, and of the bare ``doStep`` (s)."""
    description = read_model_description(str(fmu))
    folder = extract(str(fmu))
    reals = [v for v in description.modelVariables if v.type == "Real"]
    inputs = [v.valueReference for v in reals if v.causality == "input"]
    starts = [float(v.start) for v in reals if v.causality == "input"]
    outputs = [v.valueReference for v in reals if v.causality == "output"]
    whole, bare = [], []
    for _ in range(REPEATS):
        slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="benchmark",
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        inside = 0.0
        begun = time.perf_counter()
        for k in range(STEPS):
            slave.setReal(inputs, starts)
            before = time.perf_counter()
            slave.doStep(k * STEP, STEP)
            inside += time.perf_counter() - before
            slave.getReal(outputs)
        whole.append((time.perf_counter() - begun) / STEPS)
        bare.append(inside / STEPS)
        slave.terminate()
        slave.freeInstance()
    return min(whole), min(bare)


def main() -> None:
    """Measure and print the table."""
    entry = SETS["table-3.1"]
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "trivial_slave.py"
        script.write_text(TRIVIAL)
        trivial = seconds_per_step(Path(FmuBuilder.build_FMU(script, dest=folder, needsExecutionTool=False)))
        ours = seconds_per_step(build(FMUS["FiveBarSlider"], folder))

    def in_process() -> float:
        begun = time.perf_counter()
        run = simulate(entry.parameters, Inputs(speed=entry.crank_speed), stop_time=STEPS * STEP, step=STEP, hold=STEP)
        assert run.status == 0
        return (time.perf_counter() - begun) / STEPS

    in_process()
    compiled = min(in_process() for _ in range(REPEATS))

    plant_times = []
    for _ in range(REPEATS):
        plant = Plant(
            entry.parameters, entry.initial, drive_mode=SPEED_DRIVE, inputs={"drive.speed": entry.crank_speed}
        )
        begun = time.perf_counter()
        for k in range(STEPS):
            plant.step(k * STEP, STEP)
            plant.outputs()
        plant_times.append((time.perf_counter() - begun) / STEPS)
    p, x, i = entry.parameters.constants(), plant.state, dynamics.Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    begun = time.perf_counter()
    for _ in range(5000):
        dynamics.derivative(x, i, p)
    rhs = (time.perf_counter() - begun) / 5000

    table = Table(title="Table 3.1 at 420 rpm, 1 ms steps, tolerance 1e-9; best of 5")
    for heading in ("what", "microseconds a step", "times the trivial slave", "of real time"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    rows = (
        ("FMU through FMPy, inputs set and outputs read", ours[0]),
        ("FMU through FMPy, doStep alone", ours[1]),
        ("trivial slave, inputs set and outputs read", trivial[0]),
        ("trivial slave, doStep alone", trivial[1]),
        ("the plant in plain Python, without FMI", min(plant_times)),
        ("in process, compiled, inputs held likewise", compiled),
    )
    for what, seconds in rows:
        table.add_row(what, f"{seconds * 1e6:.2f}", f"{seconds / trivial[0]:.2f}", f"{seconds / STEP:.2%}")
    console = Console()
    console.print(table)
    console.print(f"one right-hand side in plain Python: {rhs * 1e6:.2f} microseconds", highlight=False)


if __name__ == "__main__":
    main()
