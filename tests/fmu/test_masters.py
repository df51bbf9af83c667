"""FMPy, libcosimpy and ecospy run the same case to the same end, and each lives through a step that is refused.

A master that cannot be imported is skipped, unless the environment variable LINKWORK_ALL_MASTERS is set, as it is where
the whole project is checked.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from .models import Model
from .runner import run_in_process
from .test_description import ROWS

#: What has to be installed for each master.
NEEDS = {
    "fmpy": "the package FMPy",
    "libcosimpy": "the package libcosimpy",
    "ecospy": "the package ecospy and the library libtbb.so.12 (Debian: apt-get install libtbb12)",
}
OUTPUTS = {
    model: [name for name, causality, kind, *_ in rows if causality == "output" and kind == "Real"]
    for model, rows in ROWS.items()
}


class Case(NamedTuple):
    """A run of 100 steps of 1 ms: parameters and inputs at the start, and an input that changes after half of it.

    ``shown`` is an output of which that makes a difference, ``too_much`` a value that ends in the limit of assembly in the
    second step after it is set, at 0.051 s.
    """

    reals: dict[str, float]
    integers: dict[str, int]
    changed: str
    later: float
    shown: str
    too_much: float


CASES = {
    "FiveBarSlider": Case(
        {
            "slider.damping": 25.0,
            "slider.coulomb_friction": 0.3,
            "coupler.point_distance": 0.07,
            "initial.crank_speed": 30.0,
            "drive.torque": 0.3,
            "slider.force": 0.5,
        },
        {"drive.mode": 0},
        "slider.force",
        2.0,
        "slider.position",
        1e5,
    ),
    "SliderCrank": Case(
        {
            "guide.twist": 4.4,
            "slider.damping": 25.0,
            "slider.coulomb_friction": 0.3,
            "shift.stiffness": 500.0,
            "gravity.y": -9.81,
            "initial.crank_speed": 30.0,
            "drive.torque": 3.0,
            "axial.force": 0.5,
            "slider.load": 4.0,
        },
        {"drive.mode": 0, "axial.mode": 0},
        "axial.force",
        2.0,
        "shift.position",
        2e7,
    ),
}


def by_fmpy(
    fmu: str, reals: dict[str, float], integers: dict[str, int], changed: str, later: float, outputs: list[str]
) -> Any:
    """The case by FMPy's own simulate_fmu."""
    import numpy as np
    from fmpy import read_model_description, simulate_fmu

    names = [v.name for v in read_model_description(fmu).modelVariables if v.causality == "input"]
    before = [reals.get(name, 0.0) for name in names]
    after = [later if name == changed else reals.get(name, 0.0) for name in names]
    # the jump is where the communication point is: halves of rounded milliseconds would make a step of their own
    half = 50 * 1e-3
    signals = np.array(
        [(0.0, *before), (half, *before), (half, *after), (0.1, *after)],
        dtype=[("time", float), *((name, float) for name in names)],
    )
    said: list[str] = []
    result = simulate_fmu(
        fmu,
        stop_time=0.1,
        step_size=1e-3,
        output_interval=1e-3,
        start_values=reals | integers,
        input=signals,
        output=[*outputs, "solver.status"],
        debug_logging=True,
        logger=lambda environment, instance, status, category, message: said.append(message.decode()),
    )
    return {
        "end": {name: float(result[-1][name]) for name in outputs},
        "time": float(result[-1]["time"]),
        "status": int(result[-1]["solver.status"]),
        "said": said,
    }


def by_libcosimpy(
    fmu: str, reals: dict[str, float], integers: dict[str, int], changed: str, later: float, outputs: list[str]
) -> Any:
    """The case by libcosim's fixed-step algorithm."""
    import zipfile
    from xml.etree import ElementTree

    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.DEBUG)
    root = ElementTree.fromstring(zipfile.ZipFile(fmu).read("modelDescription.xml"))
    reference = {v.get("name"): int(v.get("valueReference")) for v in root.find("ModelVariables")}
    execution = CosimExecution.from_step_size(1_000_000)  # ns
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=fmu, instance_name="slider"))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    override = CosimManipulator.create_override()
    execution.add_manipulator(override)
    for name, value in reals.items():
        assert execution.real_initial_value(slave, reference[name], value)
    for name, value in integers.items():
        assert execution.integer_initial_value(slave, reference[name], value)
    assert execution.step(50)
    override.slave_real_values(slave, [reference[changed]], [later])
    good = execution.step(50)
    return {
        "end": dict(zip(outputs, observer.last_real_values(slave, [reference[name] for name in outputs]))),
        "time": execution.status().current_time * 1e-9,
        "status": observer.last_integer_values(slave, [reference["solver.status"]])[0],
        "good": good,
    }


def by_ecospy(
    fmu: str, reals: dict[str, float], integers: dict[str, int], changed: str, later: float, outputs: list[str]
) -> Any:
    """The case by ecos."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        structure.add_model("slider", fmu)
        structure.add_parameter_set("case", {f"slider::{name}": value for name, value in (reals | integers).items()})
        with EcosSimulation(structure=structure, step_size=1e-3) as simulation:
            initialised = simulation.init(parameter_set="case")
            simulation.step(50)
            simulation.set_real(f"slider::{changed}", later)
            time = simulation.step(50)
            found = {
                "end": {name: simulation.get_real(f"slider::{name}") for name in outputs},
                "time": time,
                "status": simulation.get_integer("slider::solver.status"),
                "message": simulation.get_string("slider::solver.message"),
                "initialised": initialised,
            }
            simulation.terminate()
    return found


MASTERS = {"fmpy": by_fmpy, "libcosimpy": by_libcosimpy, "ecospy": by_ecospy}


def need(master: str) -> None:
    """Skip where a master cannot be imported, or fail where all have to be."""
    done = subprocess.run(
        [sys.executable, "-c", f"import {master}"], capture_output=True, text=True, timeout=60, check=False
    )
    if done.returncode != 0:
        message = f"{master} cannot be imported; it needs {NEEDS[master]}: {done.stderr.strip().splitlines()[-1]}"
        if os.environ.get("LINKWORK_ALL_MASTERS"):
            pytest.fail(message)
        pytest.skip(message)


def run(master: str, fmu: Path, model: Model, **changes: Any) -> dict[str, Any]:
    """The model's case, with changes, by a master."""
    need(master)
    case = CASES[model.name]._replace(**changes)
    return run_in_process(MASTERS[master], fmu, *case[:4], OUTPUTS[model.name])


def by_hand(
    fmu: str, folder: str, reals: dict[str, float], integers: dict[str, int], changed: str, later: float
) -> Any:
    """The case step by step: 50 of 1 ms, the input changed, 50 more."""
    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start(reals | integers)
    for k in range(100):
        if k == 50:
            instance.set(changed, later)
        if instance.step(k * 1e-3, 1e-3):
            break
    return [instance.outputs(), instance.trouble()]


@pytest.fixture(scope="module")
def ends(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """The last good outputs of a model's case run by hand, to its end or to the limit of assembly, and the trouble then."""

    @cache
    def of(model: str, *, too_far: bool) -> Any:
        case = CASES[model]
        case = case._replace(later=case.too_much) if too_far else case
        return run_in_process(by_hand, fmus[model], tmp_path_factory.mktemp("run"), *case[:4])

    return of


@pytest.fixture
def expected(ends: Callable[..., Any], model: Model) -> dict[str, float]:
    end, trouble = ends(model.name, too_far=False)
    assert trouble == [0, ""]
    return end


@pytest.fixture
def last_good(ends: Callable[..., Any], model: Model) -> dict[str, float]:
    end, trouble = ends(model.name, too_far=True)
    assert trouble[0] == 3
    assert trouble[1].startswith(SENTENCE)
    return end


#: Outputs of which the last digits are those of sums of far greater ones: forces, moments, accelerations, and the balance of
#: the slider-crank's hundreds of joules.
SUMS = {
    "FiveBarSlider": ("pin.", "acceleration", "guide_force"),
    "SliderCrank": ("acceleration", "guide.", "bearing.", "crank_pin.f", "slider_pin.f", "applied_force", "residual"),
}


@pytest.mark.parametrize("master", MASTERS)
def test_same_end_values(fmu: Path, model: Model, expected: dict[str, float], master: str) -> None:
    found = run(master, fmu, model)
    assert found["status"] == 0
    assert found["time"] == pytest.approx(0.1, abs=1e-12)
    assert list(found["end"]) == list(expected) == OUTPUTS[model.name]
    for name, value in expected.items():
        scale = 1e2 if any(part in name for part in SUMS[model.name]) else 1.0
        assert found["end"][name] == pytest.approx(value, rel=1e-12, abs=1e-12 * scale), name


def test_parameters_and_inputs_arrive(fmu: Path, model: Model, tmp_path: Path, expected: dict[str, float]) -> None:
    # that the masters agree says something only if what they set makes a difference
    case = CASES[model.name]
    for name in case.reals:
        changed = case._replace(reals=case.reals | {name: case.reals[name] * 1.1})
        end, _ = run_in_process(by_hand, fmu, tmp_path / name, *changed[:4])
        assert end != expected, name
    end, _ = run_in_process(by_hand, fmu, tmp_path / "later", *case._replace(later=case.later * 1.1)[:4])
    assert end[case.shown] != expected[case.shown]


SENTENCE = "in the step from t = 0.051 s: limit of assembly at crank angle"
#: Time and solver.status that a master ends with after the refused step. FMPy ends the run without a word: only the status
#: in its last row says that it was not the end. libcosim reports failure and reads nothing more: the status is that of the
#: last good step. ecos overlooks the refusal and goes on to the end: status and message alone tell, with the first cause.
REFUSED = {"fmpy": (0.051, 3), "libcosimpy": (0.051, 0), "ecospy": (0.1, 3)}


@pytest.mark.parametrize("master", MASTERS)
def test_refused_step(fmu: Path, model: Model, last_good: dict[str, float], master: str) -> None:
    case = CASES[model.name]
    found = run(master, fmu, model, later=case.too_much)
    time, status = REFUSED[master]
    assert found["time"] == pytest.approx(time)
    assert found["status"] == status
    assert found["end"][case.shown] == pytest.approx(last_good[case.shown], rel=1e-9)
    if master == "fmpy":
        assert [said for said in found["said"] if said.startswith(SENTENCE)]
    elif master == "libcosimpy":
        assert found["good"] is False
    else:
        assert found["message"].startswith("a step over a gap: it starts at t = 0.099 s")
        assert SENTENCE in found["message"]


def bad_by_fmpy(fmu: str, reals: dict[str, float]) -> list[Any]:
    """Initialisations that fail by FMPy, and a good run after them."""
    from fmpy import simulate_fmu
    from fmpy.fmi1 import FMICallException

    said: list[str] = []
    for _ in range(5):
        try:
            simulate_fmu(
                fmu,
                stop_time=0.01,
                start_values=reals,
                debug_logging=True,
                logger=lambda environment, instance, status, category, message: said.append(message.decode()),
            )
        except FMICallException as error:
            last = str(error)
    return [last, said, len(simulate_fmu(fmu, stop_time=0.01, step_size=1e-3, output_interval=1e-3))]


def test_bad_parameter_under_fmpy(fmu: Path) -> None:
    error, said, rows = run_in_process(bad_by_fmpy, fmu, {"slider.damping": -1.0})
    assert "fmi2ExitInitializationMode" in error
    sentence = "parameter slider.damping is -1.0: it must be a finite number, zero or greater"
    assert said.count(sentence) == 5
    assert rows == 11


def test_bad_parameter_under_ecospy(fmu: Path, model: Model) -> None:
    # ecos overlooks this as well: every read has to be survived, and the sentence is there to be read
    found = run("ecospy", fmu, model, reals=CASES[model.name].reals | {"slider.damping": -1.0})
    assert found["status"] == 6
    assert "parameter slider.damping is -1.0" in found["message"]


def test_bad_parameter_under_libcosimpy(fmu: Path, model: Model) -> None:
    # libcosim itself ends the process on a failed initialisation, but not before the sentence is in its log
    need("libcosimpy")
    with pytest.raises(AssertionError, match=r"parameter slider\.damping is -1\.0: it must be"):
        run("libcosimpy", fmu, model, reals=CASES[model.name].reals | {"slider.damping": -1.0})
