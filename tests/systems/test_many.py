"""Many runs of a system: the same as one by one, kept, continued, and lived through by the loss of a worker."""

import json
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pytest

from analysis.numerics.workers import WorkersLost
from analysis.systems import SystemRuns, SystemRunsEnded, many, run_many, run_system
from linkwork.errors import InputError, UnknownNameError
from tests.refusals import refused

from ..analysis.test_workers import killing, new_cluster
from .conftest import system_of, wiring_of

OUTPUTS = ["linkage.crank.speed", "linkage.slider.position"]
SPRINGS = np.linspace(500.0, 2500.0, 40)


def runs(folder: Path | None = None, springs: Any = SPRINGS, **options: Any) -> SystemRuns:
    """Runs of motor and crank with different springs of the slider."""
    short = {"step": 1e-3, "stop_time": 0.02, "every": 5}
    return run_many(
        wiring_of("motor-crank"), {"linkage.slider.stiffness": springs}, OUTPUTS, folder=folder, **short | options
    )


def test_each_is_the_run_of_its_values() -> None:
    found = runs(springs=SPRINGS[:3])
    assert found.time.tolist() == pytest.approx([0.0, 5e-3, 1e-2, 1.5e-2, 2e-2])
    for number, stiffness in enumerate(SPRINGS[:3]):
        wiring = wiring_of("motor-crank")
        part = wiring.parts["linkage"]
        part = replace(part, values={**part.values, "slider.stiffness": stiffness})
        wiring = replace(wiring, parts={**wiring.parts, "linkage": part})
        alone = run_system(wiring, step=1e-3, stop_time=0.02)
        for name in OUTPUTS:
            assert found.output(name)[number].tolist() == alone[name][::5].tolist()


def test_steps_that_do_not_fill_the_run_end_with_a_shorter_one() -> None:
    found = runs(springs=SPRINGS[:2], step=3e-3, stop_time=1e-2, every=1)
    assert found.time.tolist() == pytest.approx([0.0, 3e-3, 6e-3, 9e-3, 1e-2])
    assert found.output(OUTPUTS[0]).shape == (2, 5)
    assert not found.messages


def test_what_is_there_is_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[int] = []
    whole = many._batch

    def counted(task: Any) -> Any:
        calls.append(len(task.sets))
        if len(calls) == 2:
            raise WorkersLost("the workers failed")
        return whole(task)

    monkeypatch.setattr(many, "_batch", counted)
    with pytest.raises(SystemRunsEnded, match="16 of 40 runs are done") as stopped:
        runs(tmp_path / "kept")
    assert np.count_nonzero(stopped.value.runs.lengths) == 16
    calls.append(0)
    found = runs(tmp_path / "kept")
    assert calls[3:] == [16, 8]
    again = runs(tmp_path / "kept")
    assert len(calls) == 5
    for one in (found, again):
        assert np.array_equal(one.output(OUTPUTS[0]), runs().output(OUTPUTS[0]))
    with pytest.raises(InputError, match="give another folder"):
        runs(tmp_path / "kept", springs=SPRINGS + 1.0)


def test_failures_are_kept_beside_results(tmp_path: Path) -> None:
    """A spring that may not be, and a slider that is pushed into the limit of assembly."""
    wiring = wiring_of("slider-tracking")
    vary = {
        "linkage.slider.mass": [0.5, -1.0, 0.5],
        "controller.limit": [200.0, 200.0, 1e6],
        "controller.gain": [23e3, 23e3, -1e7],
    }
    found = run_many(wiring, vary, ["linkage.slider.position"], stop_time=0.3, folder=tmp_path)
    assert found.lengths[0] == len(found.time)
    assert found.lengths[1] == 0
    assert 0 < found.lengths[2] < len(found.time)
    assert repr(found) == f"<SystemRuns: 3 runs of {len(found.time)} samples, 2 of them ended early, as messages says>"
    assert "slider.mass" in found.messages[1]
    assert "refused the step" in found.messages[2]
    assert found.output("linkage.slider.position").mask.any(axis=1).tolist() == [False, True, True]
    lines = (tmp_path / "messages.jsonl").read_text(encoding="utf-8").splitlines()
    assert {json.loads(line)[0] for line in lines} == {1, 2}
    # stopped after the messages and before the lengths, and while a message was written
    lengths = np.load(tmp_path / "lengths.npy")
    lengths[:] = 0
    np.save(tmp_path / "lengths.npy", lengths)
    with (tmp_path / "messages.jsonl").open("a", encoding="utf-8") as file:
        file.write('[0, "a message that is cut')
    again = run_many(wiring, vary, ["linkage.slider.position"], stop_time=0.3, folder=tmp_path)
    assert (again.lengths == found.lengths).all()
    assert again.messages == found.messages


def test_wrong_arguments_are_refused() -> None:
    wiring = wiring_of("motor-crank")
    refused(UnknownNameError, r"slider\.stiffness", run_many, wiring, {"linkage.slider.stifness": [1.0]}, OUTPUTS)
    with pytest.raises(UnknownNameError):
        run_many(wiring, {"linkage.slider.stiffness": [1.0]}, ["linkage.slider.place"])
    for vary in ({}, {"linkage.slider.stiffness": [1.0, 2.0], "linkage.slider.damping": [1.0]}):
        refused(InputError, "one of each for every run", run_many, wiring, vary, OUTPUTS)
    with pytest.raises(InputError, match=r"slider\.stiffness varies over \['8 N/mm'\]: .* numbers in SI"):
        run_many(wiring, {"linkage.slider.stiffness": ["8 N/mm"]}, OUTPUTS)
    with pytest.raises(InputError, match=r"such as \['linkage\.crank\.speed'\]"):
        run_many(wiring, {"linkage.slider.stiffness": [1.0]}, "linkage.crank.speed")
    refused(InputError, r"wiring is System: give .*wiring\(\)", run_many, system_of("motor-crank"), {}, OUTPUTS)
    for wrong in ({"step": 0.0}, {"stop_time": inf}, {"every": 0}):
        with pytest.raises(InputError, match="communication step"):
            run_many(wiring, {"linkage.slider.stiffness": [1.0]}, OUTPUTS, **wrong)


def test_processes_give_the_same() -> None:
    assert np.array_equal(runs(n_jobs=2).output(OUTPUTS[1]), runs().output(OUTPUTS[1]))


@pytest.mark.long
def test_ten_thousand_runs_on_a_cluster_whose_worker_is_killed(tmp_path: Path) -> None:
    """One in a thousand has a spring that may not be; what is kept is read again without a run."""
    springs = np.random.default_rng(1).normal(1500.0, 200.0, 10_000)
    springs[500::1000] = -1.0
    with new_cluster() as local, joblib.parallel_config("dask"), killing(local) as killed:
        found = runs(tmp_path, springs)
    assert len(killed) == 1
    assert sorted(found.messages) == list(range(500, 10_000, 1000))
    assert np.array_equal(found.lengths == 0, springs < 0.0)
    some = np.arange(0, 10_000, 250)
    few = runs(springs=springs[some])
    for name in OUTPUTS:
        assert np.array_equal(found.output(name)[some].filled(0.0), few.output(name).filled(0.0))
    again = runs(tmp_path, springs)
    assert np.array_equal(again.samples, found.samples)
    assert again.messages == found.messages
