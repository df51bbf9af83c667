"""Other masters run an archive of SSP, or its FMUs by their own wiring, to where ours comes; each in a process of its own."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from analysis.systems import run_system, write_ssp

from ..fmu.runner import run_in_process
from ..fmu.test_masters import need
from .conftest import system_of

STEP, STEPS = 5e-4, 100
#: What is compared.
COMPARED = ("linkage.crank.angle", "linkage.crank.speed", "linkage.slider.position", "motor.rotor.angle")


def by_fmpy(archive: str, step: float, count: int, names: list[str]) -> Any:
    """FMPy's runner of SSP: it takes start values as one set, and records what is connected."""
    import zipfile
    from pathlib import Path

    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import ParameterSet, read_ssv

    with zipfile.ZipFile(archive) as content:
        content.extractall("unpacked")
    start = ParameterSet()
    for file in Path("unpacked/resources").glob("*.ssv"):
        for parameter in read_ssv(str(file)).parameters:
            parameter.name = f"{file.stem}.{parameter.name}"
            start.parameters.append(parameter)
    # a row has the outputs at the end of the step that begins at its time
    run = simulate_ssp(archive, stop_time=(count - 0.5) * step, step_size=step, parameter_set=start)
    return {name: float(run[-1][name]) for name in names if name in run.dtype.names}


def by_libcosimpy(archive: str, step: float, count: int, names: list[str]) -> Any:
    """libcosim's fixed-step algorithm on the unpacked archive."""
    import zipfile
    from pathlib import Path

    from fmpy import read_model_description
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver

    with zipfile.ZipFile(archive) as content:
        content.extractall("unpacked")
    execution = CosimExecution.from_ssp_file("unpacked", round(step * 1e9))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    assert execution.step(count)
    found = {}
    for info in execution.slave_infos():
        part = info.name.decode() if isinstance(info.name, bytes) else info.name
        fmu = {"motor": "InductionMotor-native.fmu", "linkage": "FiveBarSlider-native.fmu"}[part]
        variables = read_model_description(str(Path("unpacked/resources") / fmu)).modelVariables
        reference = {f"{part}.{v.name}": v.valueReference for v in variables}
        own = [name for name in names if name in reference]
        found |= dict(zip(own, observer.last_real_values(info.index, [reference[name] for name in own])))
    return found


def by_ecospy(archive: str, step: float, count: int, names: list[str]) -> Any:
    """ecos on the archive, with the start values of the sets of one name."""
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=archive, step_size=step) as simulation:
        simulation.init(parameter_set="default")
        simulation.step(count)
        found = {name: simulation.get_real(name.replace(".", "::", 1)) for name in names}
        simulation.terminate()
    return found


def by_pathsim(archive: str, step: float, count: int, names: list[str]) -> Any:
    """PathSim's blocks of FMUs, wired by hand; a block shows what it came to at its next step, and its neighbour sees it then."""
    import zipfile

    from fmpy.ssp.ssd import read_ssv
    from pathsim import Connection, Simulation
    from pathsim.blocks import Constant
    from pathsim_fmi.blocks import CoSimulationFMU

    with zipfile.ZipFile(archive) as content:
        content.extractall("unpacked")
    kinds = {"Integer": int}
    blocks = {}
    for part, fmu in (("motor", "InductionMotor-native.fmu"), ("linkage", "FiveBarSlider-native.fmu")):
        parameters = read_ssv(f"unpacked/resources/{part}.ssv").parameters
        start = {p.name: kinds.get(p.type, float)(p.value) for p in parameters}
        blocks[part] = (CoSimulationFMU(f"unpacked/resources/{fmu}", part, start, dt=step), start)
    wires = {("linkage", "drive.torque"): ("motor", "shaft.exerted_torque")}
    wires["motor", "flangeDrive.speed"] = ("linkage", "crank.speed")
    others, connections = [], []
    for part, (block, start) in blocks.items():
        for place, name in enumerate(block.fmu_wrapper.input_refs):
            if (part, name) in wires:
                of, output = wires[part, name]
                source = blocks[of][0]
                connections.append(Connection(source[list(source.fmu_wrapper.output_refs).index(output)], block[place]))
            else:
                others.append(Constant(start.get(name, 0.0)))
                connections.append(Connection(others[-1], block[place]))
    simulation = Simulation([*others, *(block for block, _ in blocks.values())], connections, dt=step, log=False)
    simulation.run((count - 2.5) * step)
    found = {}
    for part, (block, _) in blocks.items():
        values = dict(zip(block.fmu_wrapper.output_refs, map(float, block.fmu_wrapper.get_outputs_as_array())))
        found |= {f"{part}.{name}": value for name, value in values.items() if f"{part}.{name}" in names}
    return found


MASTERS: dict[str, Callable[..., Any]] = {
    "fmpy": by_fmpy,
    "libcosimpy": by_libcosimpy,
    "ecospy": by_ecospy,
    "pathsim": by_pathsim,
}


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_ssp(
        system_of("motor-crank").without_rates().wiring(), tmp_path_factory.mktemp("ssp") / "motor-crank.ssp"
    )


@pytest.mark.parametrize("master", [pytest.param(m, marks=pytest.mark.slow if m == "pathsim" else ()) for m in MASTERS])
def test_a_master_comes_to_where_ours_does(archive: Path, master: str) -> None:
    need(master)
    ours = run_system(system_of("motor-crank").without_rates().wiring(), step=STEP, stop_time=STEP * STEPS)
    found = run_in_process(MASTERS[master], str(archive), STEP, STEPS, list(COMPARED), options=())
    assert found
    for name, value in found.items():
        assert value == pytest.approx(float(ours[name][-1]), rel=1e-2 if master == "pathsim" else 1e-6), name
    if os.environ.get("LINKWORK_ALL_MASTERS") and master != "fmpy":
        assert set(found) == set(COMPARED)
