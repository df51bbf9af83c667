"""FMUs that share a process, and with it one Python interpreter, each run on their own equations."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import build_fmu

from .bare_master import DISCARD, Fmu
from .models import MODELS, Changes, Model
from .runner import run_in_process


@pytest.fixture
def variant(build_variant: Callable[[Changes], Path], model: Model) -> Path:
    """The same model with another constant in its equations."""
    return build_variant(model.equation)


def run_together(fmus: list[str], folder: str, values: list[dict[str, float]]) -> list[Any]:
    """An instance of each FMU with its values, stepped in turn in one process, in torque drive."""
    loaded = [Fmu(fmu, Path(folder) / str(k)) for k, fmu in enumerate(fmus)]
    given = [chosen | {"drive.torque": 0.2} for chosen in values]
    instances = [fmu.instantiate().start(chosen) for fmu, chosen in zip(loaded, given)]
    for k in range(30):
        for instance in instances:
            assert instance.step(k * 1e-3, 1e-3) == 0
    # and new instances of each, made while the others live
    backwards = zip(reversed(loaded), reversed(given))
    late = [fmu.instantiate().start(chosen) for fmu, chosen in backwards][::-1]
    for instance in late:
        instance.run([1e-3] * 30)
    ends = [[instance.outputs() for instance in both] for both in (instances, late)]
    for instance in instances + late:
        instance.free()
    return ends


def test_two_builds_in_one_process(fmu: Path, model: Model, variant: Path, tmp_path: Path) -> None:
    def ends(folder: str, *fmus: Path) -> Any:
        return run_in_process(run_together, list(map(str, fmus)), tmp_path / folder, [model.free] * len(fmus))

    (apart,), (late_apart,) = ends("a", fmu)
    (other,), _ = ends("b", variant)
    together, late = ends("c", fmu, variant)
    assert apart["crank.angle"] != other["crank.angle"]
    assert together == [apart, other]
    assert late[0] == late_apart
    assert late[0] != late[1]
    # whichever comes first
    assert ends("d", variant, fmu)[0] == [other, apart]


def test_all_models_in_one_process(fmus: dict[str, Path], tmp_path: Path) -> None:
    names = list(MODELS)

    def ends(folder: str, *each: tuple[str, float]) -> Any:
        values = [MODELS[name].free | {"slider.damping": damping} for name, damping in each]
        return run_in_process(run_together, [str(fmus[name]) for name, _ in each], tmp_path / folder, values)

    every = [(name, damping) for damping in (10.0, 30.0) for name in names]
    apart = {one: ends(f"{one}", one) for one in every}
    for order in (every, every[::-1]):
        together, late = ends(f"{order[0]}-", *order)
        assert together == [apart[one][0][0] for one in order]
        assert late == [apart[one][1][0] for one in order]
    assert len({str(end) for end in together}) == len(every)


def module_path(fmus: list[str], folder: str) -> list[Any]:
    """The module path before, and after instances of each FMU, one of them reset."""
    import sys

    before = list(sys.path)
    loaded = [Fmu(fmu, Path(folder) / str(k)) for k, fmu in enumerate(fmus)]
    for _ in range(3):
        for fmu in loaded:
            instance = fmu.instantiate().start()
            assert instance.reset() == 0
            instance.start().run([1e-3])
            instance.free()
    return [before, list(sys.path)]


def test_module_path_of_the_process_stays_as_it_was(fmus: dict[str, Path], tmp_path: Path) -> None:
    before, after = run_in_process(module_path, [str(fmus[name]) for name in MODELS], tmp_path)
    assert after == before


def fail_together(fmus: list[str], folder: str, values: list[dict[str, float]], bad: list[list[Any]]) -> list[Any]:
    """Instances of several FMUs that refuse a step, each in its turn, and are restored, beside the others."""
    loaded = [Fmu(fmu, Path(folder) / str(k)) for k, fmu in enumerate(fmus)]
    instances = [fmu.instantiate().start(chosen) for fmu, chosen in zip(loaded, values)]
    for k in range(20):
        for number, instance in enumerate(instances):
            if bad and k % 5 == 4 and (k // 5) % len(instances) == number:
                state = instance.save()
                name, value = bad[number]
                kept = instance.get(name)
                instance.set(name, value)
                assert instance.step(k * 1e-3, 0.1) == DISCARD
                assert instance.get("solver.status") == 3
                instance.set(name, kept)
                assert instance.restore(state) == 0
                assert instance.free_state(state) == 0
                # one more of the same, that does not even start
                lost = loaded[number].instantiate()
                lost.set("crank.length", -1.0)
                assert lost.setup() == lost.enter() == 0
                assert lost.exit() != 0
                lost.free()
            assert instance.step(k * 1e-3, 1e-3) == 0
    return [instance.outputs() for instance in instances]


def test_failures_of_one_model_do_not_reach_another(fmus: dict[str, Path], tmp_path: Path) -> None:
    models = list(MODELS.values())
    paths = [str(fmus[model.name]) for model in models]
    values = [model.free | {"drive.torque": 0.2} for model in models]
    bad = [[model.force, model.too_much] for model in models]
    together = run_in_process(fail_together, paths, tmp_path / "together", values, bad)
    for path, chosen, found in zip(paths, values, together):
        assert run_in_process(fail_together, [path], tmp_path / Path(path).stem, [chosen], []) == [found]


def rebuild(root: str, folder: str, name: str, values: dict[str, float], changes: dict[str, list[str]]) -> list[Any]:
    """Build, run, change the equations, build at the same path, run again, change back, build and run again."""
    import shutil
    import sys
    from pathlib import Path

    sys.path.insert(0, root)
    from fmpy import simulate_fmu

    from analysis.export import SOURCES, build
    from build_fmu import FMUS

    folder = Path(folder)
    sources = folder / "fmu_src"
    shutil.copytree(SOURCES, sources, ignore=shutil.ignore_patterns("__pycache__"))
    ((path, (old, new)),) = changes.items()
    dynamics = sources / path
    text = dynamics.read_text(encoding="utf-8")
    ends = []
    modules = []
    for source in (text, text.replace(old, new), text):
        dynamics.write_text(source, encoding="utf-8")
        fmu = build(FMUS[name], folder / "build", sources)
        tops = ("linkwork_", "five_bar_slave_", "slider_crank_slave_")
        modules.append(sorted(module for module in sys.modules if module.startswith(tops)))
        times = {"stop_time": 0.03, "step_size": 1e-3, "output_interval": 1e-3}
        given = values | {"drive.torque": 0.2}
        end = simulate_fmu(fmu, **times, start_values=given, output=["crank.angle"])[-1]
        ends.append(float(end["crank.angle"]))
    return [str(fmu), ends, modules]


@pytest.mark.slow
def test_rebuilt_fmu_runs_its_own_new_code(model: Model, tmp_path: Path) -> None:
    root = str(Path(build_fmu.__file__).parent)
    arguments = (model.name, model.free, model.equation)
    _, (first, second, third), modules = run_in_process(rebuild, root, tmp_path, *arguments)
    assert first != second
    assert third == first
    assert modules[0] == [], "building leaves modules behind"


def many_cycles(fmu: str, folder: str, number: int) -> dict[str, Any]:
    """Instances made, run a step and freed, with the memory taken on the way."""
    import gc
    import os
    import sys

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
    ours = ("linkwork", "slave", "five_bar_slave", "slider_crank_slave")
    tops = sorted(name for name in sys.modules if name.startswith(ours))
    return {"sizes": list(sizes.values()), "modules": [name for name in tops if "." not in name]}


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_five_hundred_instances_one_after_the_other(fmu: Path, model: Model, tmp_path: Path) -> None:
    found = run_in_process(many_cycles, fmu, tmp_path, 500)
    early, late = found["sizes"]
    # an instance takes about 0.2 MB while it lives; the wrapper keeps little of it, a string on sys.path among others
    assert late - early < 8.0
    assert [name[:-9] for name in found["modules"]] == sorted(["linkwork", "slave", model.slave])


def body_again(fmu: str, folder: str, slave: str, times: int) -> list[Any]:
    """What the module body of the slave changes when it is executed again, as the wrapper does for each instance."""
    import atexit
    import sys
    import threading
    import warnings

    fmu = Fmu(fmu, folder)
    instance = fmu.instantiate().start()
    (name,) = [name for name in sys.modules if name.startswith(f"{slave}_")]
    path = fmu.folder / "resources" / f"{name}.py"
    code = compile(path.read_text(), name, "exec")

    def facts():
        return [
            sorted(sys.modules),
            sorted(vars(sys.modules[name])),
            id(getattr(sys.modules[name], fmu.identifier)),
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


def test_module_body_has_no_side_effects(fmu: Path, model: Model, tmp_path: Path) -> None:
    same, outputs, _ = run_in_process(body_again, fmu, tmp_path, model.slave, 3)
    assert same
    # 420 and 50 rpm
    assert outputs["crank.speed"] == pytest.approx(
        {"five_bar": 43.982297150257104, "slider_crank": 5.235987755983}[model.plant]
    )


def mix_loggers(fmus: list[str], root: str) -> list[Any]:
    """Errors of two instances of ours at a time, then, after both are gone, of one of FMPy with its own logger."""
    import gc
    import sys

    sys.path.insert(0, root)
    from fmpy import extract, instantiate_fmu, read_model_description

    from analysis.run import FmuRun
    from linkwork.five_bar import MECHANISM

    entry = MECHANISM.published["table-3.1"]
    found = []
    modes = {"drive.mode": 1}
    inputs = dict.fromkeys(MECHANISM.input_names, 0.0)
    for fmu in fmus:
        initial = entry.initial
        acting = inputs | {"drive.speed": entry.crank_speed}
        given = {"modes": modes, "tolerance": 1e-9, "start_time": 0.0, "inputs": acting}
        with (
            FmuRun(fmu, entry.parameters, initial, **given) as one,
            FmuRun(fmu, entry.parameters, initial, **given) as two,
        ):
            for run, step in ((one, -1.0), (two, -2.0)):
                run.step(0.0, step)
            found.append([run.messages for run in (one, two)])
    gc.collect()
    for fmu in fmus:
        description = read_model_description(fmu)
        slave = instantiate_fmu(extract(fmu), description, "CoSimulation")
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        try:
            slave.doStep(0.0, -3.0)
        except Exception as error:
            found.append(str(error))
        slave.freeInstance()
    return found


def test_each_instance_has_its_own_log_and_none_calls_one_that_is_gone(
    fmus: dict[str, Path], natives: dict[str, Path]
) -> None:
    paths = [str(fmus["FiveBarSlider"]), str(natives["FiveBarSlider-native"])]
    root = Path(build_fmu.__file__).resolve().parent
    *ours, python, native = run_in_process(mix_loggers, paths, root, options=())
    for one, two in ours:
        assert [len(one), len(two)] == [1, 1]
        assert "-1" in one[0]
        assert "-2" in two[0]
    assert "fmi2DoStep" in python
    assert "fmi2DoStep" in native
