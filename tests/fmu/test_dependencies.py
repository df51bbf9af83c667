"""The dependencies that the model description declares are those that the FMU has."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import pytest

from .runner import run_in_process
from .test_description import INPUTS, ROWS, unknowns

# nothing zero and nothing aligned, so that no dependency hides
MECHANISM = {
    "crank.mass": 0.3,
    "crank.cog_distance": 0.02,
    "crank.cog_angle": 0.4,
    "coupler.cog_angle": 0.3,
    "rocker.cog_angle": -0.2,
    "slider.guide_angle": 0.25,
    "slider.coulomb_friction": 0.5,
    "slider.spring_free_position": 0.001,
    "coupler.point_distance": 0.08,
    "coupler.point_angle": 0.5,
    "ground.inclination": 0.3,
    "initial.crank_angle": 0.7,
    "initial.slider_velocity": 0.1,
    "initial.slider_position": 0.004,
    "drive.torque": 0.6,
    "drive.acceleration": 30.0,
    "slider.force": 1.5,
    "load.fx": 2.0,
    "load.fy": -1.0,
}


def perturb_inputs(fmu: str, folder: str, mechanism: dict[str, float]) -> list[list[Any]]:
    """For both drives, at the start and after a step: which outputs change at once with each input."""
    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    inputs = [v.name for v in fmu.variables.values() if v.causality == "input"]
    found = []
    for mode in (0, 1):
        instance = fmu.instantiate().start(mechanism | {"drive.mode": mode})
        time = 0.0
        for steps in (0, 1, 3):
            time = instance.run([1e-3] * steps, time)
            state = instance.save()
            for name in inputs:
                before = instance.outputs() | dict(zip(("solver.status", "solver.message"), instance.trouble()))
                instance.set(name, instance.get(name) * 1.01)
                after = instance.outputs() | dict(zip(("solver.status", "solver.message"), instance.trouble()))
                found.append([mode, steps, name, [n for n in before if before[n] != after[n]]])
                assert instance.restore(state) == 0
                assert instance.outputs() == {n: before[n] for n in fmu.outputs}
            instance.free_state(state)
        instance.free()
    return found


def perturb_start(fmu: str, folder: str, mechanism: dict[str, float]) -> dict[str, list[str]]:
    """For both drives: which outputs at the start change with each parameter and input."""
    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    found = {}
    for mode in (0, 1):
        base = fmu.instantiate().start(mechanism | {"drive.mode": mode})
        before = base.outputs()
        for name, variable in fmu.variables.items():
            if variable.causality == "output" or variable.kind != "Real":
                continue
            value = base.get(name)
            instance = fmu.instantiate().start(mechanism | {"drive.mode": mode, name: value * 1.01 or 0.01})
            after = instance.outputs()
            found.setdefault(name, []).extend(n for n in before if before[n] != after[n])
            instance.free()
        base.free()
    return found


@pytest.fixture(scope="module")
def changed(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """Which outputs were seen to change at once with each input."""
    seen: dict[str, set[str]] = {}
    for _, _, name, outputs in run_in_process(perturb_inputs, fmu, tmp_path_factory.mktemp("run"), MECHANISM):
        seen.setdefault(name, set()).update(outputs)
    return seen


@pytest.mark.parametrize("name", sorted(INPUTS))
def test_outputs_that_change_at_once_are_those_declared(
    description: Element, changed: dict[str, set[str]], name: str
) -> None:
    declared = {output for output, on in unknowns(description, "Outputs").items() if name in on}
    # the one dependency declared to be safe that there is not: the acceleration is commanded apart from the speed
    never = {"crank.acceleration"} if name == "drive.speed" else set()
    assert changed[name] == declared - never


def test_outputs_at_the_start_change_only_with_what_they_declare(
    description: Element, fmu: Path, tmp_path: Path
) -> None:
    declared = unknowns(description, "InitialUnknowns")
    found = run_in_process(perturb_start, fmu, tmp_path, MECHANISM)
    assert set(found) == {name for name, causality, kind, *_ in ROWS if causality != "output" and kind == "Real"}
    assert set(found["slider.guide_angle"]) >= {"coupler.angle", "rocker.angle", "transmission.angle"}
    undeclared = {
        (output, name)
        for name, outputs in found.items()
        for output in outputs
        if declared[output] is not None and name not in declared[output]
    }
    assert undeclared == set()
