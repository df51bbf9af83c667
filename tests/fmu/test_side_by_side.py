"""FMUs that share a process, and with it one Python interpreter, each run on their own equations."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import build_fmu

from .conftest import Changes
from .runner import run_in_process

#: One constant of the equations of motion: the coupler's coupling into the crank's inertia, 2 q3.
EQUATION = ("g3 * q3 - w3 * w3 * n3", "g3 * q3 - 1.01 * w3 * w3 * n3")


@pytest.fixture
def variant(build_variant: Callable[[Changes], Path]) -> Path:
    """The same model with another constant in its equations."""
    return build_variant({"linkwork/five_bar/dynamics.py": EQUATION})


def run_together(fmus: list[str], folder: str) -> list[Any]:
    """An instance of each FMU, stepped in turn in one process, in torque drive."""
    from pathlib import Path

    from bare_master import Fmu

    loaded = [Fmu(fmu, Path(folder) / str(k)) for k, fmu in enumerate(fmus)]
    instances = [fmu.instantiate().start({"drive.mode": 0, "drive.torque": 0.2}) for fmu in loaded]
    for k in range(30):
        for instance in instances:
            assert instance.step(k * 1e-3, 1e-3) == 0
    # and new instances of each, made while the others live
    late = [fmu.instantiate().start({"drive.mode": 0, "drive.torque": 0.2}) for fmu in reversed(loaded)][::-1]
    for instance in late:
        instance.run([1e-3] * 30)
    ends = [[instance.outputs() for instance in both] for both in (instances, late)]
    for instance in instances + late:
        instance.free()
    return ends


def test_two_builds_in_one_process(fmu: Path, variant: Path, tmp_path: Path) -> None:
    (apart,), (late_apart,) = run_in_process(run_together, [str(fmu)], tmp_path / "a")
    (other,), _ = run_in_process(run_together, [str(variant)], tmp_path / "b")
    together, late = run_in_process(run_together, [str(fmu), str(variant)], tmp_path / "c")
    assert apart["crank.angle"] != other["crank.angle"]
    assert together == [apart, other]
    assert late[0] == late_apart
    assert late[0] != late[1]
    # whichever comes first
    assert run_in_process(run_together, [str(variant), str(fmu)], tmp_path / "d")[0] == [other, apart]


def rebuild(root: str, folder: str, old: str, new: str) -> list[Any]:
    """Build, run, change the equations, build at the same path, run again, change back, build and run again."""
    import shutil
    import sys
    from pathlib import Path

    sys.path.insert(0, root)
    from fmpy import simulate_fmu

    import build_fmu

    folder = Path(folder)
    sources = folder / "fmu_src"
    shutil.copytree(build_fmu.SOURCES, sources, ignore=shutil.ignore_patterns("__pycache__"))
    dynamics = sources / "linkwork" / "five_bar" / "dynamics.py"
    text = dynamics.read_text(encoding="utf-8")
    ends = []
    modules = []
    for source in (text, text.replace(old, new), text):
        dynamics.write_text(source, encoding="utf-8")
        fmu = build_fmu.build("FiveBarSlider", folder / "build", sources)
        modules.append(sorted(name for name in sys.modules if name.startswith(("linkwork_", "five_bar_slave_"))))
        end = simulate_fmu(
            fmu,
            stop_time=0.03,
            step_size=1e-3,
            output_interval=1e-3,
            start_values={"drive.mode": 0, "drive.torque": 0.2},
            output=["crank.angle"],
        )[-1]
        ends.append(float(end["crank.angle"]))
    return [str(fmu), ends, modules]


def test_rebuilt_fmu_runs_its_own_new_code(tmp_path: Path) -> None:
    root = str(Path(build_fmu.__file__).parent)
    _, (first, second, third), modules = run_in_process(rebuild, root, tmp_path, *EQUATION)
    assert first != second
    assert third == first
    assert modules[0] == [], "building leaves modules behind"


def many_cycles(fmu: str, folder: str, number: int) -> dict[str, Any]:
    """Instances made, run a step and freed, with the memory taken on the way."""
    import gc
    import os
    import sys
    from pathlib import Path

    from bare_master import Fmu

    fmu = Fmu(fmu, folder)

    def megabytes() -> float:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    sizes = {}
    end = None
    for k in range(1, number + 1):
        instance = fmu.instantiate().start()
        instance.run([1e-3])
        outputs = instance.outputs()
        assert end in (None, outputs)
        end = outputs
        instance.terminate()
        instance.free()
        if k in (number // 5, number):
            sizes[k] = megabytes()
    tops = sorted(name for name in sys.modules if name.startswith(("linkwork", "slave", "five_bar_slave")))
    return {"sizes": list(sizes.values()), "modules": [name for name in tops if "." not in name]}


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_five_hundred_instances_one_after_the_other(fmu: Path, tmp_path: Path) -> None:
    found = run_in_process(many_cycles, fmu, tmp_path, 500)
    early, late = found["sizes"]
    # an instance takes about 0.2 MB while it lives; the wrapper keeps little of it, a string on sys.path among others
    assert late - early < 8.0
    assert [name[:-9] for name in found["modules"]] == ["five_bar_slave", "linkwork", "slave"]


def body_again(fmu: str, folder: str, times: int) -> list[Any]:
    """What the module body of the slave changes when it is executed again, as the wrapper does for each instance."""
    import atexit
    import sys
    import threading
    import warnings

    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    instance = fmu.instantiate().start()
    (name,) = [name for name in sys.modules if name.startswith("five_bar_slave_")]
    path = fmu.folder / "resources" / f"{name}.py"
    code = compile(path.read_text(), name, "exec")

    def facts():
        return [
            sorted(sys.modules),
            sorted(vars(sys.modules[name])),
            id(sys.modules[name].FiveBarSlider),
            atexit._ncallbacks(),
            threading.active_count(),
            list(warnings.filters),
            list(sys.path),
        ]

    before = facts()
    for _ in range(times):
        exec(code, vars(sys.modules[name]), {})
    same = facts() == before
    instance.run([1e-3] * 5)
    return [same, instance.outputs(), fmu.instantiate().start().run([1e-3] * 5)]


def test_module_body_has_no_side_effects(fmu: Path, tmp_path: Path) -> None:
    same, outputs, _ = run_in_process(body_again, fmu, tmp_path, 3)
    assert same
    assert outputs["crank.speed"] == pytest.approx(43.982297150257104)
