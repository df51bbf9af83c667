"""Measure the cost of a communication step of every kind of FMU, from a host in C and through FMPy, and of the bare equations.

    python -m benchmarks.fmu

The mechanism is Table 3.1 at 420 rpm, with steps of 1 ms. In each step all inputs are set and all outputs read. For comparison,
a trivial slave of PythonFMU has the same number of variables and does nothing, and the smallest native FMU is a pendulum. Each
number is the best of several runs. The evaluations of the right-hand side in a step are counted, and timed in a C loop of their
own at the states at which the steps evaluate them.
"""

import importlib
import subprocess
import sysconfig
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from pythonfmu.builder import FmuBuilder
from rich.console import Console

from analysis import Inputs, simulate
from analysis.export import (
    NATIVE,
    NATIVE_FMI3,
    PLATFORMS,
    WASM,
    build,
    build_native,
    compile_library,
    source_files,
    this_platform,
)
from analysis.run import check_run
from analysis.run.fmu import FmuRun
from linkwork.five_bar import MECHANISM
from linkwork.plant import Plant
from tests.fmu.c_host import compile_host, run_host, unpack
from tests.mechanisms.pendulum import MECHANISM as PENDULUM

from . import tables

STEP = 1e-3
STEPS = 430
REPEATS = 7
GOALS = (2.0, 100.0)  # largest time relative to the bare right-hand sides; least speed relative to the Python FMU

TRIVIAL = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Trivial(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for i in range(6):
            setattr(self, f"i{i}", 0.0)
            self.register_variable(Real(f"i{i}", causality=Fmi2Causality.input, start=0.0))
        for i in range(27):
            setattr(self, f"o{i}", 0.0)
            self.register_variable(Real(f"o{i}", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
"""


def least_measurement(measure: Callable[[], float]) -> float:
    """Return the smallest of several measurements."""
    return min(measure() for _ in range(REPEATS))


def time_with_fmpy(fmu: Path) -> float:
    """Measure the time (s) of a step through FMPy, with inputs set and outputs read."""
    description = read_model_description(str(fmu))
    fmi3 = description.fmiVersion == "3.0"
    reals = [v for v in description.modelVariables if v.type in ("Real", "Float64")]
    inputs = [v.valueReference for v in reals if v.causality == "input"]
    starts = [float(v.start) for v in reals if v.causality == "input"]
    outputs = [v.valueReference for v in reals if v.causality == "output"]
    slave = (FMU3Slave if fmi3 else FMU2Slave)(
        guid=description.instantiationToken if fmi3 else description.guid,
        unzipDirectory=extract(str(fmu)),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="benchmark",
    )
    slave.instantiate()
    if not fmi3:
        slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    put, read = (slave.setFloat64, slave.getFloat64) if fmi3 else (slave.setReal, slave.getReal)
    begun = time.perf_counter()
    for k in range(STEPS):
        put(inputs, starts)
        slave.doStep(k * STEP, STEP)
        read(outputs)
    took = (time.perf_counter() - begun) / STEPS
    slave.terminate()
    if hasattr(slave.dll, "finalizePythonInterpreter"):
        # otherwise PythonFMU's library uses freed memory when it is unloaded; our slaves prevent that themselves
        slave.dll.finalizePythonInterpreter()
    slave.freeInstance()
    return took


def time_with_host(host: Path, fmu: Path, folder: Path) -> float:
    """Measure the time (s) of a step from the host in C, with inputs set and outputs read."""
    unpacked = unpack(fmu, folder / fmu.stem)
    inputs = {s.name: float(s.attributes["start"]) for s in unpacked.reals("input")}
    python = (unpacked.folder / "resources" / "slavemodule.txt").is_file()
    # PythonFMU's library, if it is without our guard, expects Python's library in the process
    preload = {"LD_PRELOAD": str(sysconfig.get_config_var("INSTSONAME"))} if python else {}

    def measure() -> float:
        run = run_host(host, unpacked, {}, inputs=inputs, steps=STEPS, step=STEP, environment=preload)
        assert run["status"] == 0, run["logged"]
        return float(run["microseconds"]) * 1e-6

    return least_measurement(measure)


def count_and_time_right_hand_sides(folder: Path) -> tuple[float, float]:
    """Return the number of right-hand side evaluations in a step, and the time of one evaluation (s)."""
    files = source_files(MECHANISM, NATIVE)
    driver = Path(__file__).with_name("right_hand_sides.c")
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    sources = [name for name in files if name.endswith(".c") and name not in ("all.c", "equations.c")]
    options = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-sanitize=undefined", "-D_GNU_SOURCE", "-I.")
    target = PLATFORMS[this_platform()].target
    compile_library(folder, [str(driver), *sources], "right_hand_sides", target, options)
    command = [str(folder / "right_hand_sides"), str(STEPS), str(STEP), "200"]
    counted, nanoseconds, _ = subprocess.run(
        command, input="", capture_output=True, text=True, check=True
    ).stdout.split()
    return float(counted), float(nanoseconds) * 1e-9


def time_plain_step() -> float:
    """Measure the time (s) of a step of the mechanism in plain Python, with its outputs."""
    entry = MECHANISM.published["table-3.1"]
    plant = Plant(MECHANISM, entry.parameters, entry.initial, inputs={"drive.speed": entry.crank_speed}, drive_mode=1)
    begun = time.perf_counter()
    for k in range(STEPS):
        plant.step(k * STEP, STEP)
        plant.outputs()
    return (time.perf_counter() - begun) / STEPS


def time_compiled_step() -> float:
    """Measure the time (s) of a step of the compiled solver in this process, with inputs held as in the FMU."""
    entry = MECHANISM.published["table-3.1"]
    begun = time.perf_counter()
    run = simulate(entry.parameters, Inputs(speed=entry.crank_speed), stop_time=STEPS * STEP, step=STEP, hold=STEP)
    assert run.status == 0
    return (time.perf_counter() - begun) / STEPS


def compare_component(native: Path, component: Path) -> list[tuple[float, float, float]]:
    """Compare the step times of a WebAssembly component with those of the native library.

    Returns for each step length (s) two ratios to the native time: of the whole step, and of the time inside wasmtime's
    library. The difference is the time of wasmtime's Python code, which looks up the types of all values.
    """
    entry = MECHANISM.published["table-3.1"]
    inputs, initial = check_run(MECHANISM, Inputs(speed=entry.crank_speed), entry.initial)
    values = dict.fromkeys(MECHANISM.input_names, 0.0) | {"drive.speed": entry.crank_speed}
    inside: list[float] = []

    def step(fmu: Path, length: float) -> float:
        modes = inputs.modes(MECHANISM)
        with FmuRun(fmu, entry.parameters, initial, modes=modes, tolerance=1e-9, start_time=0.0, inputs=values) as run:
            inside.clear()
            begun = time.perf_counter()
            for k in range(20):
                assert run.step(k * length, length)[0] == 0
            return time.perf_counter() - begun

    def step_inside(length: float) -> float:
        step(component, length)
        return sum(inside)

    found = []
    for length in (1.0, 0.1, STEP):
        bare = least_measurement(lambda length=length: step(native, length))
        whole = least_measurement(lambda length=length: step(component, length))
        with timed_calls(inside):
            within = least_measurement(lambda length=length: step_inside(length))
        found.append((length, whole / bare, within / bare))
    return found


@contextmanager
def timed_calls(times: list[float]) -> Iterator[None]:
    """Append the time (s) of every call of a component to a list while the context lasts, without wasmtime's Python code."""
    library: Any = importlib.import_module("wasmtime._ffi")
    call = library.wasmtime_component_func_call

    def timed(*arguments: Any) -> Any:
        begun = time.perf_counter()
        result = call(*arguments)
        times.append(time.perf_counter() - begun)
        return result

    library.wasmtime_component_func_call = timed
    try:
        yield
    finally:
        library.wasmtime_component_func_call = call


def main() -> None:
    """Measure and print the table."""
    console = Console()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        script = folder / "trivial_slave.py"
        script.write_text(TRIVIAL)
        fmus = {
            "Python FMU": build(MECHANISM, folder),
            "native FMU, FMI 2.0": build_native(MECHANISM, NATIVE, folder),
            "native FMU, FMI 3.0": build_native(MECHANISM, NATIVE_FMI3, folder),
            "PythonFMU's trivial slave": Path(FmuBuilder.build_FMU(script, dest=folder, needsExecutionTool=False)),
            "smallest native FMU: a pendulum": build_native(PENDULUM, NATIVE, folder),
        }
        host = compile_host(folder)
        seconds = {
            what: (time_with_host(host, fmu, folder), least_measurement(lambda f=fmu: time_with_fmpy(f)))
            for what, fmu in fmus.items()
        }
        counted, bare = count_and_time_right_hand_sides(folder)
        web = folder / "web"
        ratios = compare_component(fmus["native FMU, FMI 3.0"], build_native(MECHANISM, NATIVE_FMI3, web, [WASM]))

    time_compiled_step()  # the first one loads what is compiled
    title = f"Table 3.1 at 420 rpm, 1 ms steps, tolerance 1e-9; microseconds a step, best of {REPEATS}"
    table = tables.numbers(title, ("what", "from C", "through FMPy"), ("what",))
    rows: dict[str, tuple[float | None, float | None]] = {
        **seconds,
        f"{counted:.2f} bare right-hand sides of {bare * 1e9:.0f} ns": (counted * bare, None),
        "the plant in plain Python, without FMI": (None, least_measurement(time_plain_step)),
        "in process, compiled, with held inputs too": (None, least_measurement(time_compiled_step)),
    }
    for what, pair in rows.items():
        table.add_row(what, *("" if value is None else f"{value * 1e6:.2f}" for value in pair))
    console.print(table)
    python, native = (seconds[what][0] for what in ("Python FMU", "native FMU, FMI 2.0"))
    for what, ratio, goal, met in (
        ("times its bare right-hand sides", native / (counted * bare), f"at most {GOALS[0]:g}", GOALS[0].__ge__),
        ("times less than the Python FMU", python / native, f"at least {GOALS[1]:g}", GOALS[1].__le__),
    ):
        verdict = "met" if met(ratio) else "missed"
        console.print(f"native FMU from C: {ratio:.2f} {what}; goal {goal}: {verdict}", highlight=False)
    for length, whole, inside in ratios:
        console.print(
            f"a step of {length:g} s of the WebAssembly component: {inside:.1f} times the native one's; with the Python of "
            f"wasmtime around it {whole:.1f}"
        )


if __name__ == "__main__":
    main()
