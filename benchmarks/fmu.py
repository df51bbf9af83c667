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
from pythonfmu.builder import FmuBuilder
from rich.console import Console
from rich.table import Table

from analysis import Inputs, simulate
from analysis.export import build
from build_fmu import FMUS
from linkwork.five_bar import MECHANISM
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
        if hasattr(slave.dll, "finalizePythonInterpreter"):
            # else PythonFMU's library uses, when it is unloaded, what it has freed; our slaves see to it themselves
            slave.dll.finalizePythonInterpreter()
        slave.freeInstance()
    return min(whole), min(bare)


def plain_step() -> tuple[float, float]:
    """Best time of a step and its outputs of the plant in plain Python, and of one right-hand side (s)."""
    entry = MECHANISM.published["table-3.1"]
    steps, sides = [], []
    for _ in range(REPEATS):
        plant = Plant(
            MECHANISM, entry.parameters, entry.initial, inputs={"drive.speed": entry.crank_speed}, drive_mode=1
        )
        begun = time.perf_counter()
        for k in range(STEPS):
            plant.step(k * STEP, STEP)
            plant.outputs()
        steps.append((time.perf_counter() - begun) / STEPS)
        equations, p = MECHANISM.equations, entry.parameters.constants()
        i = equations.applied((1.0,), tuple(plant.inputs.values()), p)
        begun = time.perf_counter()
        for _ in range(STEPS):
            equations.derivative(plant.state, i, p)
        sides.append((time.perf_counter() - begun) / STEPS)
    return min(steps), min(sides)


def compiled_step() -> float:
    """Best time of a step in process, inputs held as the FMU's (s)."""
    entry = MECHANISM.published["table-3.1"]
    inputs = Inputs(speed=entry.crank_speed)
    times = []
    for _ in range(1 + REPEATS):
        begun = time.perf_counter()
        run = simulate(entry.parameters, inputs, stop_time=STEPS * STEP, step=STEP, hold=STEP)
        assert run.status == 0
        times.append((time.perf_counter() - begun) / STEPS)
    # the first one loads what is compiled
    return min(times[1:])


def main() -> None:
    """Measure and print the table."""
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "trivial_slave.py"
        script.write_text(TRIVIAL)
        trivial = seconds_per_step(Path(FmuBuilder.build_FMU(script, dest=folder, needsExecutionTool=False)))
        ours = seconds_per_step(build(FMUS["FiveBarSlider"], folder))
    plain, side = plain_step()

    table = Table(title=f"Table 3.1 at 420 rpm, 1 ms steps, tolerance 1e-9; best of {REPEATS}")
    for heading in ("what", "microseconds a step", "times the trivial slave", "of real time"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    rows = (
        ("FMU through FMPy, inputs set and outputs read", ours[0]),
        ("FMU through FMPy, doStep alone", ours[1]),
        ("trivial slave, inputs set and outputs read", trivial[0]),
        ("trivial slave, doStep alone", trivial[1]),
        ("the plant in plain Python, without FMI", plain),
        ("in process, compiled, inputs held likewise", compiled_step()),
    )
    for what, seconds in rows:
        table.add_row(what, f"{seconds * 1e6:.2f}", f"{seconds / trivial[0]:.2f}", f"{seconds / STEP:.2%}")
    console = Console()
    console.print(table)
    console.print(f"one right-hand side in plain Python: {side * 1e6:.2f} microseconds", highlight=False)


if __name__ == "__main__":
    main()
