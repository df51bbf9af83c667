"""Any communication step from a microsecond to a tenth of a second, and not the same one twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from .models import Model, each
from .runner import run_in_process

# free to swing, driven and loaded: steps matter to nothing but the error control
VALUES = {
    "FiveBarSlider": {
        "drive.mode": 0,
        "initial.crank_speed": 30.0,
        "drive.torque": 0.2,
        "slider.force": 0.5,
        "slider.coulomb_friction": 0.1,
    },
    "SliderCrank": {
        "drive.mode": 0,
        "axial.mode": 0,
        "guide.twist": 4.4,
        "initial.crank_speed": 12.0,
        "drive.torque": 5.0,
        "axial.force": -8.0,
        "slider.load": 10.0,
        "slider.damping": 3.0,
        "shift.stiffness": 4000.0,
        "shift.spring_free_position": 0.05,
        "shift.damping": 20.0,
        "gravity.x": -9.81,
    },
}
#: Magnitudes that quantities have in these runs, by how their names begin, where it is not one of their unit.
SCALES = {
    "FiveBarSlider": {
        "energy": 1.0,
        "pin": 10.0,
        "slider.acceleration": 50.0,
        "crank.acceleration": 100.0,
        "slider": 0.3,
    },
    "SliderCrank": {
        "energy": 100.0,
        **dict.fromkeys(("bearing", "crank_pin.f", "slider_pin.f", "guide"), 200.0),
        **dict.fromkeys(("crank.acceleration", "shift.acceleration", "slider.acceleration"), 100.0),
    },
}


def run_sizes(fmu: str, folder: str, values: dict[str, float], runs: list[list[float]]) -> list[dict[str, float]]:
    """End values of each run, given as tolerance, step size and number of steps."""
    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    ends = []
    for tolerance, size, number in runs:
        instance = fmu.instantiate().start(values | {"solver.tolerance": tolerance})
        for k in range(number):
            assert instance.step(k * size, size) == 0, instance.log
        ends.append(instance.outputs())
        instance.free()
    return ends


def differing(model: Model, a: dict[str, float], b: dict[str, float], bound: float) -> list[Any]:
    """Outputs that differ by more than ``bound`` of the magnitude that quantities of their kind have in these runs."""
    found = []
    for name in a:
        size = next((s for start, s in SCALES[model.name].items() if name.startswith(start)), 1.0)
        if abs(a[name] - b[name]) > bound * max(size, abs(a[name])):
            found.append([name, a[name], b[name]])
    return found


def test_all_sizes_agree(fmu: Path, model: Model, tmp_path: Path) -> None:
    sizes = [(0.1, 3), (0.05, 6), (0.025, 12), (1e-2, 30), (5e-3, 60), (1e-3, 300), (5e-4, 600), (1e-4, 3000)]
    runs = [[1e-13, 0.3, 1]] + [[1e-9, size, number] for size, number in sizes]
    exact, *ends = run_in_process(run_sizes, fmu, tmp_path, VALUES[model.name], runs)
    for end in ends:
        assert differing(model, exact, end, 1e-6) == []
    # halving the step changes the result, but within the tolerance
    assert len({end["slider.position"] for end in ends}) == len(ends)


def test_microseconds(fmu: Path, model: Model, tmp_path: Path) -> None:
    whole, cut = run_in_process(run_sizes, fmu, tmp_path, VALUES[model.name], [[1e-9, 4e-3, 1], [1e-9, 1e-6, 4000]])
    assert differing(model, whole, cut, 1e-8) == []


def test_master_tolerance_counts_where_it_is_tighter(fmu: Path, model: Model, tmp_path: Path) -> None:
    own, tighter, looser, exact = run_in_process(run_tolerances, fmu, tmp_path, VALUES[model.name], [None, 1e-12, 1e-3])
    assert own == looser

    def error(end: dict[str, float]) -> float:
        return abs(end["slider.position"] - exact["slider.position"])

    assert error(tighter) < 0.1 * error(own)
    assert error(tighter) < 1e-12


def run_tolerances(
    fmu: str, folder: str, values: dict[str, float], tolerances: list[float | None]
) -> list[dict[str, float]]:
    """End values with each tolerance of the master, and last with the slave's own at its tightest."""
    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    ends = []
    for tolerance, own in [*((t, 1e-7) for t in tolerances), (None, 1e-13)]:
        instance = fmu.instantiate().start(values | {"solver.tolerance": own}, tolerance=tolerance)
        instance.run([0.1] * 3)
        ends.append(instance.outputs())
        instance.free()
    return ends


def random_steps(fmu: str, folder: str, values: dict[str, float]) -> list[Any]:
    """A run in steps no two of which are alike, by a master that adds them up, and one in a single step."""
    import random
    from itertools import pairwise

    from bare_master import Fmu

    draw = random.Random(1)
    cuts = sorted(draw.uniform(0.0, 0.4) for _ in range(40))
    # around each cut steps from a microsecond upwards
    cuts += [cut + 10.0 ** draw.uniform(-6.0, -3.0) for cut in cuts for _ in range(5)]
    cuts = [0.0, *sorted(cut for cut in cuts if cut < 0.4), 0.4]
    sizes = [b - a for a, b in pairwise(cuts)]
    assert len(set(sizes)) == len(sizes)
    fmu = Fmu(fmu, folder)
    ends = []
    for run in (sizes, [0.4]):
        instance = fmu.instantiate().start(values | {"solver.tolerance": 1e-11})
        time = instance.run(run)
        ends.append([time, instance.outputs()])
        instance.free()
    return [min(sizes), max(sizes), *ends]


def test_random_mixture(fmu: Path, model: Model, tmp_path: Path) -> None:
    least, greatest, (time, mixed), (_, whole) = run_in_process(random_steps, fmu, tmp_path, VALUES[model.name])
    assert least < 1e-5
    assert greatest > 1e-2
    assert time == pytest.approx(0.4, abs=1e-12)
    assert differing(model, whole, mixed, 1e-8) == []


def count_time(fmu: str, folder: str, number: int) -> list[Any]:
    """Thousands of steps at constant speed from a late start, timed by k * h and by adding up."""
    import json

    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    size = 1e-5
    found = []
    for adding in (False, True):
        instance = fmu.instantiate().start({"drive.speed": 10.0}, start=1000.0)
        time = 1000.0
        for k in range(number):
            assert instance.step(time, size) == 0, instance.log
            time = time + size if adding else 1000.0 + (k + 1) * size
        state = instance.save()
        saved = instance.serialize(state)
        found.append([time, json.loads(saved)["plant"]["time"], instance.get("crank.angle")])
        instance.free_state(state)
        instance.free()
    return found


#: Steps over which time is counted; what counts it is the same in both.
COUNTED = {"FiveBarSlider": {"6000 steps": 6_000}, "SliderCrank": {"2000 steps": 2_000}}


@each(COUNTED, "number")
def test_time_does_not_drift(fmu: Path, tmp_path: Path, number: int) -> None:
    for master, slave, angle in run_in_process(count_time, fmu, tmp_path, number):
        assert slave == pytest.approx(master, abs=1e-12 * 1000.0)
        assert angle == pytest.approx(10.0 * number * 1e-5, rel=1e-10)


def end_of_step(fmu: str, folder: str) -> list[float]:
    """Crank angle after steps at constant speed, which is where the step ends and nowhere else."""
    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    angles = []
    for size in (1e-6, 1.2345e-5, 1e-3, 0.0137, 0.1):
        instance = fmu.instantiate().start({"drive.speed": 16.0, "initial.crank_angle": 0.0})
        assert instance.step(0.0, size) == 0
        angles.append(instance.get("crank.angle") / size)
        instance.free()
    return angles


def test_step_ends_exactly(fmu: Path, tmp_path: Path) -> None:
    assert run_in_process(end_of_step, fmu, tmp_path) == pytest.approx([16.0] * 5, rel=1e-14)
