"""What the description of a native FMU states is what its library does."""

from collections.abc import Iterator
from ctypes import c_double
from pathlib import Path
from shutil import rmtree
from typing import Any, NamedTuple

import pytest
from fmpy import extract, instantiate_fmu, read_model_description

from .models import MODELS


class Fmu(NamedTuple):
    """A native FMU, unpacked."""

    model: str
    description: Any
    folder: str

    def exchange(self) -> Any:
        """An instance for model exchange, initialised."""
        fmi2 = self.description.fmiVersion == "2.0"
        instance = instantiate_fmu(self.folder, self.description, "ModelExchange")
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
