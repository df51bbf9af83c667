"""What the description of a native FMU states is what its library does."""

from collections.abc import Iterator
from ctypes import c_double
from itertools import product
from pathlib import Path
from shutil import rmtree
from typing import Any, NamedTuple

import pytest
from fmpy import extract, instantiate_fmu, read_model_description

from .models import MODELS, MODES


class Fmu(NamedTuple):
    """A native FMU, unpacked."""

    model: str
    description: Any
    folder: str

    def exchange(self, modes: dict[str, int] | None = None) -> Any:
        """An instance for model exchange, initialised."""
        fmi2 = self.description.fmiVersion == "2.0"
        instance = instantiate_fmu(self.folder, self.description, "ModelExchange")
        reference = {v.name: v.valueReference for v in self.description.modelVariables}
        for name, value in (modes or {}).items():
            (instance.setInteger if fmi2 else instance.setInt32)([reference[name]], [value])
        if fmi2:
            instance.setupExperiment(startTime=0.0)
        instance.enterInitializationMode()
        instance.exitInitializationMode()
        (instance.newDiscreteStates if fmi2 else instance.updateDiscreteStates)()
        instance.enterContinuousTimeMode()
        return instance


@pytest.fixture(params=[f"{model}-{kind}" for model in MODELS for kind in ("native", "native-fmi3")])
def native(request: pytest.FixtureRequest, natives: dict[str, Path]) -> Iterator[Fmu]:
    """Each model as each kind of native FMU."""
    path = str(natives[request.param])
    folder = extract(path)
    yield Fmu(request.param.partition("-")[0], read_model_description(path), folder)
    rmtree(folder, ignore_errors=True)


def test_outputs_start_as_described(native: Fmu) -> None:
    instance = native.exchange()
    outputs = [v for v in native.description.modelVariables if v.causality == "output"]
    read = instance.getReal if native.description.fmiVersion == "2.0" else instance.getFloat64
    for variable, value in zip(outputs, read([v.valueReference for v in outputs])):
        # forces are sums of greater ones, to whose rounding they are zero
        assert value == pytest.approx(float(variable.start), rel=1e-11, abs=1e-12), variable.name
    instance.terminate()
    instance.freeInstance()


def test_nominal_values_are_those_described(native: Fmu) -> None:
    instance = native.exchange()
    count = native.description.numberOfContinuousStates
    values = (c_double * count)()
    instance.getNominalsOfContinuousStates(values, count)
    described = [float(unknown.variable.derivative.nominal) for unknown in native.description.derivatives]
    assert list(values) == pytest.approx(described, rel=1e-14)
    instance.terminate()
    instance.freeInstance()


def test_nothing_depends_on_what_it_does_not_say(native: Fmu) -> None:
    """By the directional derivatives in every mode."""
    states = [unknown.variable.derivative for unknown in native.description.derivatives]
    known = [*states, *(v for v in native.description.modelVariables if v.causality == "input")]
    unknowns = [*native.description.outputs, *native.description.derivatives]
    seen: dict[str, set[str]] = {unknown.variable.name: set() for unknown in unknowns}
    for modes in MODES[native.model].values():
        instance = native.exchange(modes)
        at = (c_double * len(states))(0.7, 0.02, 30.0, 0.4, 0.1, 0.2)
        instance.setContinuousStates(at, len(states))
        for unknown, variable in product(unknowns, known):
            reference = unknown.variable.valueReference
            (slope,) = instance.getDirectionalDerivative([reference], [variable.valueReference], [1.0])
            if slope != 0.0:
                seen[unknown.variable.name].add(variable.name)
        instance.terminate()
        instance.freeInstance()
    assert sum(map(len, seen.values())) > 4 * len(unknowns)
    for unknown in unknowns:
        declared = {variable.name for variable in unknown.dependencies}
        assert seen[unknown.variable.name] <= declared, unknown.variable.name
