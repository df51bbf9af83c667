"""A saved state is the whole state: restored, in this process or another, the run goes on bit for bit."""

import json
import zlib
from pathlib import Path
from typing import Any

from .bare_master import DISCARD, ERROR, Fmu
from .models import Model, each
from .runner import run_in_process

#: What the runs start with, by drive; the first leaves both freedoms to forces.
VALUES = {
    "FiveBarSlider": {
        "torque drive": {
            "drive.mode": 0, "initial.crank_speed": 30.0, "drive.torque": 0.2, "slider.force": 0.5,
            "slider.coulomb_friction": 0.1, "load.fx": 0.3,
        },
        "speed drive": {"drive.speed": 30.0, "drive.acceleration": 20.0, "slider.force": 0.5},
    },
    "SliderCrank": {
        "forces": {
            "drive.mode": 0, "axial.mode": 0, "initial.crank_speed": 12.0, "initial.shift_velocity": 0.2, "drive.torque": 5.0,
            "axial.force": -3.0, "slider.coulomb_friction": 0.1, "shift.stiffness": 900.0, "gravity.z": -9.81,
        },
        "speeds": {"drive.speed": 9.0, "drive.acceleration": 20.0, "axial.speed": 0.3, "slider.load": 0.5},
        "speed, force": {"axial.mode": 0, "drive.speed": 9.0, "axial.force": 4.0, "shift.damping": 3.0},
        "torque, axial speed": {"drive.mode": 0, "drive.torque": 5.0, "axial.speed": 0.2, "axial.acceleration": -3.0},
        "groove, torque": {"drive.mode": 0, "axial.mode": 2, "drive.torque": 4.0, "groove.amplitude": 0.07},
        "groove, speed": {"axial.mode": 2, "drive.speed": 8.0, "groove.amplitude": 0.07, "groove.ratio": 3.0},
    },
}  # fmt: skip
#: One of them for tests of what does not depend on the drive.
ONE = {model: next(iter(values.values())) for model, values in VALUES.items()}

#: Inputs that are set, but not stepped with, when the state is saved: part of it as well.
WAITING = {"FiveBarSlider": {"drive.speed": 31.0}, "SliderCrank": {"drive.speed": 31.0, "axial.speed": 0.25}}
#: Inputs that lead elsewhere, whatever the drive.
OTHER = {
    "FiveBarSlider": {"drive.torque": -3.0, "drive.speed": 55.0, "slider.force": 4.0, "load.fy": 2.0},
    "SliderCrank": {
        "drive.torque": -3.0, "drive.speed": 5.0, "axial.force": 20.0, "axial.speed": -0.5, "slider.load": 2.0,
    },
}  # fmt: skip


def save_diverge_restore(
    fmu: str, folder: str, values: dict[str, float], waiting: dict[str, float], other: dict[str, float]
) -> dict[str, Any]:
    """Save after 20 steps, go on, come back, go elsewhere, come back, go on again; and on in another instance."""
    fmu, sizes = Fmu(fmu, folder), (1e-3, 3e-3, 1e-2, 1e-4) * 5
    instance = fmu.instantiate("one").start(values)
    instance.run([1e-3] * 20)
    for name, value in waiting.items():
        instance.set(name, value)
    state = instance.save()
    data = instance.serialize(state)
    first = instance.rows(sizes, 0.02)
    assert instance.restore(state) == 0
    for name, value in other.items():
        instance.set(name, value)
    elsewhere = instance.rows(sizes, 0.02)
    assert instance.restore(state) == 0
    again = instance.rows(sizes, 0.02)
    # a state outlives changes of the instance, and can be written again
    assert instance.serialize(state) == data
    fresh = fmu.instantiate("two")
    status, read = fresh.deserialize(data)
    assert status == 0
    assert fresh.restore(read) == 0
    other = fresh.rows(sizes, 0.02)
    for one in (instance, fresh):
        assert one.free_state(state if one is instance else read) == 0
        assert one.terminate() == 0
        one.free()
    return {"data": data.decode("ascii"), "first": first, "elsewhere": elsewhere, "again": again, "other": other}


def go_on_elsewhere(fmu: str, folder: str, data: str) -> list[dict[str, float]]:
    """The same steps from a state that another process wrote."""
    instance = Fmu(fmu, folder).instantiate("three")
    status, state = instance.deserialize(data.encode("ascii"))
    assert status == 0
    assert instance.restore(state) == 0
    return instance.rows((1e-3, 3e-3, 1e-2, 1e-4) * 5, 0.02)


@each(VALUES, "values")
def test_save_diverge_restore_repeat(fmu: Path, model: Model, tmp_path: Path, values: dict[str, float]) -> None:
    inputs = (WAITING[model.name], OTHER[model.name])
    runs = run_in_process(save_diverge_restore, fmu, tmp_path / "a", values, *inputs)
    assert runs["first"][-1] != runs["elsewhere"][-1]
    assert runs["again"] == runs["first"]
    assert runs["other"] == runs["first"]
    assert run_in_process(go_on_elsewhere, fmu, tmp_path / "b", runs["data"]) == runs["first"]


def reset(fmu: str, folder: str, values: dict[str, float], force: str, too_much: float) -> list[Any]:
    """Outputs of a run, of the same after a reset, and of the defaults after another."""
    fmu = Fmu(fmu, folder)
    instance = fmu.instantiate()
    rows = []
    for chosen in (values, values, {}):
        instance.start(chosen)
        start = instance.outputs()
        instance.run([1e-3] * 20)
        rows.append([start, instance.outputs()])
        assert instance.reset() == 0
    # before the next initialisation it is as new: steps are refused, the parameters are the defaults
    assert instance.step(0.0, 1e-3) == 2
    assert instance.get("initial.crank_speed") == fmu.instantiate().get("initial.crank_speed")
    # in the middle of a run that went wrong, and after an initialisation that failed
    instance.start(values)
    instance.set(force, too_much)
    assert instance.step(0.0, 0.1) == 2
    assert instance.get("solver.status") == 3
    assert instance.reset() == 0
    instance.set("crank.length", -1.0)
    assert instance.setup() == instance.enter() == 0
    assert instance.exit() == ERROR
    assert instance.reset() == 0
    instance.start(values)
    instance.run([1e-3] * 20)
    rows.append([None, instance.outputs()])
    assert instance.trouble() == [0, ""]
    assert instance.terminate() == 0
    instance.free()
    return rows


def test_reset(fmu: Path, model: Model, tmp_path: Path) -> None:
    given = (ONE[model.name], model.force, model.too_much)
    first, again, default, after_failures = run_in_process(reset, fmu, tmp_path, *given)
    assert first == again
    assert first != default
    assert after_failures[1] == first[1]


def after_refusal(fmu: str, folder: str, values: dict[str, float], force: str, too_much: float) -> list[Any]:
    """State saved after a refused step: outputs, trouble, and the run that goes on from it, there and elsewhere."""
    fmu = Fmu(fmu, folder)
    runs = []
    for fail in ("no", "force", "nan"):
        instance = fmu.instantiate().start(values)
        instance.run([1e-3] * 10)
        if fail != "no":
            instance.set(force, too_much if fail == "force" else float("nan"))
            assert instance.step(0.01, 0.1) == DISCARD
        state = instance.save()
        data = instance.serialize(state)
        other = fmu.instantiate()
        assert other.restore(other.deserialize(data)[1]) == 0
        for one in (instance, other):
            trouble = one.trouble()
            one.set(force, values[force])
            time = one.run([1e-3] * 10, 0.01)
            runs.append([fail, trouble, one.outputs(), one.trouble(), time])
        instance.free_state(state)
    return runs


def test_state_saved_after_a_refused_step(fmu: Path, model: Model, tmp_path: Path) -> None:
    runs = run_in_process(after_refusal, fmu, tmp_path, ONE[model.name], model.force, model.too_much)
    assert len(runs) == 6
    for fail, trouble, outputs, after, _ in runs:
        assert outputs == runs[0][2]
        assert trouble[0] == {"no": 0, "force": 3, "nan": 2}[fail]
        assert {"no": "", "force": "limit of assembly", "nan": f"{model.force} is nan"}[fail] in trouble[1]
        assert after == [0, ""]


def set_up_and_restored(fmu: str, folder: str, tolerance: float) -> list[float]:
    """Outputs after a step of two instances, the one with the master's tolerance, the other from its state before the start."""
    fmu = Fmu(fmu, folder)
    one, other = fmu.instantiate(), fmu.instantiate()
    one.setup(start=1.0, tolerance=tolerance)
    other.restore(one.save())
    found = []
    for instance in (one, other):
        assert [instance.enter(), instance.exit(), instance.step(1.0, 0.05)] == [0, 0, 0]
        found.append(instance.outputs()["energy.supplied"])
        instance.free()
    return found


def test_a_state_saved_before_the_initialisation_has_the_masters_times_and_tolerance(fmu: Path, tmp_path: Path) -> None:
    loose, restored = run_in_process(set_up_and_restored, fmu, tmp_path / "a", 1e-9)
    tight, restored_tight = run_in_process(set_up_and_restored, fmu, tmp_path / "b", 1e-13)
    assert (loose, tight) == (restored, restored_tight)
    assert loose != tight


def damaged(fmu: str, folder: str, pieces: list[str]) -> list[Any]:
    """Status and log of restoring what is not a state of this FMU; the instance is freed afterwards."""
    fmu = Fmu(fmu, folder)
    found = []
    for piece in pieces:
        instance = fmu.instantiate().start()
        instance.run([1e-3])
        before = instance.outputs()
        status, state = instance.deserialize(piece.encode("utf-8"))
        assert status == 0, "what is wrong is reported when the state is set"
        found.append([instance.restore(state), instance.log, instance.outputs() == before])
        instance.free()
    return found


def checked(state: Any) -> str:
    """Return a state as text with the checksum that it must have."""
    text = json.dumps(state)
    return text[:-1] + f', "check": "{zlib.crc32(text.encode()):08x}"}}'


def test_damaged_state_is_refused(fmu: Path, model: Model, tmp_path: Path) -> None:
    arguments = (ONE[model.name], WAITING[model.name], OTHER[model.name])
    data = run_in_process(save_diverge_restore, fmu, tmp_path / "a", *arguments)["data"]
    whole = json.loads(data)
    del whole["check"]
    assert checked(whole) == data
    digits = [place for place, character in enumerate(data) if character.isdigit()]
    changed = [data[:place] + str((int(data[place]) + 1) % 10) + data[place + 1 :] for place in digits]
    pieces = [
        "not JSON",
        "[" * 200_000,
        "[1, 2]",
        data + " ",
        data.replace('"check"', '"chick"'),
        *changed,
        checked(whole | {"interface": "another"}),
        checked({name: value for name, value in whole.items() if name != "phase"}),
        checked(whole | {"plant": {"time": 0.0}}),
        checked(whole | {"plant": whole["plant"] | {"parameters": {"crank_length": -1.0}}}),
    ]
    for status, log, same in run_in_process(damaged, fmu, tmp_path / "b", pieces):
        assert status == 3
        assert any("state" in sentence for _, _, sentence in log)
        assert same


def state_of(fmu: str, folder: str) -> str:
    """The state of a run, as bytes."""
    instance = Fmu(fmu, folder).instantiate().start()
    instance.run([1e-3] * 3)
    return instance.serialize(instance.save()).decode("ascii")


def test_state_of_another_model_is_refused(fmus: dict[str, Path], model: Model, tmp_path: Path) -> None:
    for name, other in fmus.items():
        if name == model.name:
            continue
        data = run_in_process(state_of, other, tmp_path / "a")
        ((status, log, same),) = run_in_process(damaged, fmus[model.name], tmp_path / "b", [data])
        assert status == 3
        sentence = f"the saved state belongs to '{name}' with another interface, not to this {model.name}"
        assert [text for _, category, text in log if category == "logStatusError"] == [sentence]
        assert same
