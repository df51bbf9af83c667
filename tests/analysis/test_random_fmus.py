"""FMUs of random linkages: the Python one is the plant to the last bit, the native one to its tolerance."""

from typing import Any

import numpy as np
import pytest

from analysis.export import NATIVE_FMI3, build, build_native
from analysis.linkages import LinkageError
from analysis.run import Inputs, cosimulate
from linkwork.mechanism import Mechanism
from linkwork.plant import Plant
from tests.fmu.runner import run_in_process
from tests.fmu.test_plant_in_fmu import START, outputs_of_fmus, outputs_of_plant
from tests.random_linkages import KINDS

from .test_linkages import assembled, rough

pytestmark = [pytest.mark.slow, pytest.mark.fmu]

#: Steps of a run (s), no two alike.
SIZES = [1e-6, 1.2345e-5, 3e-4, 1e-3, 2.5e-3]


def made(seed: int, folder: Any) -> Mechanism:
    """A random linkage; every third has four or five dyads, every fourth racks, every fifth friction in its joints."""
    options: dict[str, Any] = {"name": f"random-{seed}", **({} if seed % 3 else {"dyads": (4, 6)})}
    options |= {} if seed % 4 else {"kinds": (*KINDS, "rack")}
    package, _ = assembled(seed, folder, **options)
    if seed % 5 == 0:
        try:
            return assembled(seed, folder, friction=rough(package), **options)[0].mechanism(folder)
        except LinkageError:  # it may jam
            pass
    return package.mechanism(folder)


#: The first part of the draws has every combination of kinds; the others are for `make test-long`.
@pytest.mark.parametrize(
    "first", [400, *(pytest.param(first, marks=pytest.mark.long) for first in range(450, 700, 50))]
)
def test_the_python_fmus_are_the_plants(first, tmp_path, monkeypatch):
    """And energy gained and lost is that supplied. Every tenth is built whole, with experiments, and validated by FMPy."""
    wanted, cases = [], []
    for seed in range(first, first + 50):
        mechanism = made(seed, tmp_path)
        loads = {c.name: 2.0 for c in mechanism.channels if c.kind == "force"}
        starts = {v.name: v.start for v in mechanism.variables}
        expected, times = outputs_of_plant(
            Plant.from_values(mechanism, starts, tolerance=1e-9, time=START), loads, SIZES
        )
        # friction may jam a linkage: both then refuse the step in the same words
        assert len(times) == len(SIZES) or (seed % 5 == 0 and "jam" in expected[-2])
        assert abs(expected[-1]["energy.residual"]) < 1e-7 * (1.0 + expected[-1]["energy.kinetic"])
        wanted.append(expected)
        with monkeypatch.context() as patched:
            if seed % 10 != 3:
                patched.setattr("analysis.export.archive.experiments", lambda mechanism: {})
                patched.setattr("analysis.export.archive.to_html", lambda mechanism, files: "")
                patched.setattr("analysis.export.archive.find_problems", lambda path: [])
            file = build(mechanism, tmp_path)
        cases.append((str(file), str(tmp_path / f"{seed}"), {}, loads, times, SIZES))
    found = run_in_process(outputs_of_fmus, cases, timeout=600.0)
    for seed, (one, expected) in enumerate(zip(found, wanted, strict=True), first):
        assert one == expected, seed


#: Of these one has racks, one many dyads, one none of this, and one friction; the others are for `make test-long`.
FEW = (424, 426, 427, 430)


@pytest.mark.parametrize(
    "seed", [seed if seed in FEW else pytest.param(seed, marks=pytest.mark.long) for seed in range(424, 432)]
)
def test_the_native_fmu_is_the_plant_within_its_tolerance(seed, tmp_path):
    """And energy gained and lost is that supplied."""
    mechanism = made(seed, tmp_path)
    known, step = mechanism.published[mechanism.name], 1e-3
    modes = {mode.arguments[0]: 0.0 for mode in mechanism.modes}
    file = build_native(mechanism, NATIVE_FMI3, tmp_path)
    times = {"stop_time": 0.02, "step": step}
    run = cosimulate(file, known.parameters, Inputs(**modes), initial=known.initial, **times, tolerance=1e-12)
    modes = {m.name.replace(".", "_"): 0 for m in mechanism.modes}
    plant = Plant(mechanism, known.parameters, known.initial, tolerance=1e-12, **modes)
    assert len(run) == 21
    for n in range(len(run)):
        if n:
            plant.step(plant.time, step)
        for name, value in zip(mechanism.output_names, plant.outputs()):
            assert run[name][n] == pytest.approx(value, rel=1e-8, abs=1e-8 * max(1.0, np.abs(run[name]).max())), (
                name,
                n,
            )
    assert abs(run["energy.residual"]).max() < 1e-8 * (1.0 + abs(run["energy.kinetic"]).max())
