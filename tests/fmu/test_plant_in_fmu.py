"""A Python FMU is the plant to the last bit: when its inputs change, over steps of any size, after one that is refused.

What the plant does is tested in `tests/plant`.
"""

from pathlib import Path
from typing import Any

import pytest

from build_fmu import FMUS
from linkwork.errors import LinkworkError
from linkwork.plant import Plant

from .bare_master import Fmu
from .drawn import drawn
from .models import Model
from .runner import run_in_process

#: Where runs start (s), and their steps: from a microsecond to a tenth of a second, no two alike.
START, SIZES = 1000.0, [1e-6, 1.2345e-5, 3e-4, 1e-3, 2.5e-3, 1e-6, 0.0137, 0.1]


def outputs_of_fmus(
    cases: list[tuple[str, str, dict[str, float], dict[str, float], list[float], list[float]]],
) -> list[list[Any]]:
    """Outputs at the start, after each input is set and after each step, or None and the sentence where it is refused.

    Of each file, unpacked into its folder, with values, inputs, times and step sizes.
    """
    every = []
    for fmu, folder, values, inputs, times, sizes in cases:
        instance = Fmu(fmu, folder).instantiate().start(values, start=times[0])
        found = [instance.outputs()]
        for n, (time, size) in enumerate(zip(times, sizes), 1):
            for name, value in inputs.items():
                instance.set(name, value * (1.0 + 0.01 * n))
                found.append(instance.outputs())
            if instance.step(time, size):
                found += [None, instance.get("solver.message"), instance.outputs()]
                break
            found.append(instance.outputs())
        every.append(found)
    return every


def outputs_of_plant(plant: Plant, inputs: dict[str, float], sizes: list[float]) -> tuple[list[Any], list[float]]:
    """The same of a plant, and the times at which the steps begin."""

    def outputs() -> dict[str, float]:
        return dict(zip(plant.mechanism.output_names, plant.outputs()))

    found: list[Any] = [outputs()]
    times = []
    for n, size in enumerate(sizes, 1):
        for name, value in inputs.items():
            plant.set_input(name, value * (1.0 + 0.01 * n))
            found.append(outputs())
        times.append(plant.time)
        try:
            plant.step(plant.time, size)
        except LinkworkError as error:
            return [*found, None, str(error), outputs()], times
        found.append(outputs())
    return found, times


@pytest.mark.parametrize("seed", range(6))
def test_outputs_are_the_plants(fmu: Path, model: Model, tmp_path: Path, seed: int) -> None:
    # six seeds drive in every way
    case = drawn(model.name, seed)
    plant = Plant.from_values(FMUS[model.name], case.values, tolerance=1e-9, time=START)
    expected, times = outputs_of_plant(plant, case.inputs, SIZES)
    found = run_in_process(outputs_of_fmus, [(str(fmu), str(tmp_path), case.values, case.inputs, times, SIZES)])
    assert found == [expected]
