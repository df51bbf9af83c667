"""Ensembles: many runs at once, in lanes or one after the other, are the runs by themselves, on any number of cores."""

import errno
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import replace
from math import nan
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import joblib
import numpy as np
import pytest

import analysis
from analysis import Ensemble, Function, Harmonics, Inputs, TorsionBar, simulate, simulate_many, steps
from analysis.numerics import vectors
from analysis.run import EnsembleBroken, EnsembleInterrupted, batches
from linkwork.errors import InputError, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests.scripts import called

EXAMPLES = Path(__file__).parents[2] / "examples"
SPEED = SETS["table-3.1"].crank_speed
OPTIONS: dict[str, Any] = {"stop_time": 0.1, "step": 5e-3}

MOTOR = analysis.InductionMotor(breakdown_torque=5.0, breakdown_slip=0.2, synchronous_speed=50.0)
#: Torques with breaks and harmonics of differing numbers; some steady, some not.
TORQUES = [
    1.0,
    steps([0.0, 0.03, 0.06], [1.0, -1.0, 2.0]),
    Harmonics(1.0, [0.5, 0.2, 0.1], [30.0, 70.0, 200.0], [0.0, 1.0, 2.0]),
    TorsionBar(torque=10.0),
    (analysis.table([0.0, 0.02, 0.05, 0.1], [0.0, 1.0, 2.0, 0.0], "cubic"), Harmonics(0.0, [1.0], [9.0], [0.0])),
    MOTOR,
    steps([0.0, 0.2], [1.0, 5.0]),
]
#: Runs that are killed; a batch of them is less than 16 KiB, which a process hands over at once or not at all.
MANY = [replace(TABLE_3_1, slider_stiffness=500.0 + i) for i in range(400)]
LONG: dict[str, Any] = {"stop_time": 20.0, "step": 1.0, "batch": 4}
ONE, VARIED = {"parameters": TABLE_3_1}, {"slider.stiffness": [1e3]}
SPRINGS = [replace(TABLE_3_1, slider_stiffness=500.0 + 200.0 * i) for i in range(len(TORQUES))]


def assert_same(many: Ensemble, index: int, **run: Any) -> None:
    """Within ten times the tolerance."""
    one = simulate(**run)
    ours = many[index]
    assert_near(ours.values, one.values, one.names, 1e-8)
    assert np.array_equal(ours.time, one.time)
    assert (ours.status, ours.message) == (one.status, one.message)


def assert_near(ours: np.ndarray, theirs: np.ndarray, names: tuple[str, ...], share: float) -> None:
    """Outputs differ by no more than a share of the greatest value of each, energies of the greatest energy."""
    greatest = np.maximum(np.abs(theirs).max(axis=0), 1e-4)
    energies = [name.startswith("energy.") for name in names]
    greatest[energies] = greatest[energies].max()
    assert np.all(np.abs(ours - theirs) <= share * greatest)


@pytest.mark.parametrize("hold", [None, 5e-3])
def test_runs_of_an_ensemble_are_the_runs_one_by_one(hold: float | None) -> None:
    inputs = [Inputs(torque=torque, force=float(i)) for i, torque in enumerate(TORQUES)]
    starts = [InitialState(crank_speed=float(i), slider_velocity=0.01 * i) for i in range(len(TORQUES))]
    many = simulate_many(SPRINGS, inputs, initial=starts, hold=hold, batch=3, **OPTIONS)
    assert len(many) == len(TORQUES)
    for i, parameters in enumerate(SPRINGS):
        assert_same(many, i, parameters=parameters, inputs=inputs[i], initial=starts[i], hold=hold, **OPTIONS)
    assert many.output("crank.angle").shape == (len(TORQUES), 21)
    assert not np.any(many.output("crank.angle").mask)
    assert np.array_equal(many.output("slider.position")[4], many[4]["slider.position"])


def test_speed_drives_with_jumps_of_differing_numbers() -> None:
    speeds = [SPEED, steps([0.0, 0.05], [20.0, 40.0]), steps([0.0, 0.01, 0.02, 0.09], [5.0, 6.0, 7.0, 8.0])]
    inputs = [Inputs(speed=speed) for speed in speeds]
    many = simulate_many([TABLE_3_1] * 3, inputs, **OPTIONS)
    for i in range(3):
        assert_same(many, i, parameters=TABLE_3_1, inputs=inputs[i], **OPTIONS)


def test_functions_are_shared() -> None:
    brake = Function(lambda t, th2, u, w2, v: -0.02 * w2)
    inputs = [Inputs(torque=(TorsionBar(torque=torque), brake)) for torque in (5.0, 10.0)]
    many = simulate_many([TABLE_3_1] * 2, inputs, **OPTIONS)
    for i in range(2):
        assert_same(many, i, parameters=TABLE_3_1, inputs=inputs[i], **OPTIONS)
    # one that commands a speed counts at the start already
    speed = Inputs(speed=(1.0, Function(lambda t, th2, u, w2, v: 40.0 + t, lambda t, th2, u, w2, v: 1.0)))
    many = simulate_many(SPRINGS[:2], speed, **OPTIONS)
    for i in range(2):
        assert_same(many, i, parameters=SPRINGS[i], inputs=speed, **OPTIONS)
    other = Inputs(torque=Function(lambda t, th2, u, w2, v: 0.0))
    with pytest.raises(InputError, match="share their Python functions"):
        simulate_many([TABLE_3_1] * 2, [inputs[0], other], **OPTIONS)


@pytest.mark.parametrize(
    "drive",
    [
        {"speed": SPEED},
        {"speed": analysis.ramp(10.0, SPEED, 0.0, 0.2), "force": Harmonics(1.0, [5.0], [30.0], [0.5])},
        {"torque": (TorsionBar(torque=10.0), Function(lambda t, th2, u, w2, v: -0.02 * w2))},
        {"torque": MOTOR},
    ],
    ids=["speed", "ramp", "bar", "motor"],
)
def test_lanes_take_the_steps_of_single_runs(drive: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """One by one and in lanes the same steps but for rounding, and with them the same states."""
    springs = [replace(TABLE_3_1, slider_stiffness=500.0 + 100.0 * i) for i in range(19)]
    many = simulate_many(springs, Inputs(**drive), stop_time=0.3, step=1e-3)
    monkeypatch.setattr(vectors, "LANES", 1)
    alone = simulate_many(springs, Inputs(**drive), stop_time=0.3, step=1e-3)
    greatest = np.abs(alone.states).max(axis=(0, 1))
    assert np.all(np.abs(many.states - alone.states) <= 1e-12 * greatest)
    assert not np.array_equal(many.states, alone.states)
    # a motor's torque changes by more than its speed
    assert np.all(np.abs(many.forces - alone.forces) <= 1e-11 * np.abs(alone.forces).max(axis=(0, 1)))


@pytest.mark.parametrize("drive", ["speed", "torque"])
def test_bits_do_not_depend_on_what_shares_a_vector(drive: str) -> None:
    """Runs of different lengths, steps and ends, in another order, in batches of another size, alone."""
    springs = [replace(TABLE_3_1, slider_stiffness=150.0 * (i % 7), slider_damping=10.0) for i in range(21)]
    inputs = [Inputs(**{drive: SPEED if drive == "speed" else 0.5 * i}) for i in range(21)]
    if drive == "torque":
        inputs[4] = Inputs(torque=steps([0.0, 0.1, 0.2], [1.0, -3.0, 2.0]))
        inputs[9] = Inputs(torque=Harmonics(1.0, [1.0], [20.0], [0.0]))
    options: dict[str, Any] = {"stop_time": 0.6, "step": 7e-3}
    one = simulate_many(springs, inputs, **options)
    assert len(set(one.status.tolist())) > 1
    order = np.random.default_rng(1).permutation(21).tolist()
    other = simulate_many([springs[i] for i in order], [inputs[i] for i in order], batch=5, n_jobs=2, **options)
    assert np.array_equal(other.states, one.states[order], equal_nan=True)
    assert [other.messages[n] for n in range(21)] == [one.messages[i] for i in order]
    alone = simulate_many([springs[3]], [inputs[3]], **options)
    assert np.array_equal(alone.states[0], one.states[3], equal_nan=True)
    assert [run.parameters for run in one[-3:]] == springs[-3:]


def test_lanes_pause_and_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    options: dict[str, Any] = {"stop_time": 0.3, "step": 1e-3}
    inputs = [Inputs(torque=torque) for torque in TORQUES]
    whole = simulate_many(SPRINGS, inputs, **options)
    monkeypatch.setattr(batches, "STEPS_PER_CALL", 13)
    assert same(whole, simulate_many(SPRINGS, inputs, **options))


def test_sets_made_by_arrays_are_the_sets_one_by_one() -> None:
    stiffness, torque = np.linspace(300.0, 900.0, 70), np.linspace(-1.0, 4.0, 70)
    options: dict[str, Any] = {"initial": InitialState(crank_speed=5.0), "stop_time": 0.2, "step": 0.01}
    values = {"slider.stiffness": stiffness, "slider_damping": stiffness / 50.0, "torque": torque}
    varied = simulate_many(TABLE_3_1, Inputs(force=0.5), vary=values, **options)
    sets = [replace(TABLE_3_1, slider_stiffness=k, slider_damping=k / 50.0) for k in stiffness.tolist()]
    listed = simulate_many(sets, [Inputs(force=0.5, torque=value) for value in torque.tolist()], **options)
    assert same(varied, listed)
    assert list(varied.parameters) == sets
    assert np.array_equal(varied[7].values, listed[7].values)
    again = simulate_many(TABLE_3_1, Inputs(force=0.5), vary=values, n_jobs=2, batch=16, **options)
    assert same(again, listed)


def test_a_torque_that_varies_takes_the_place_of_the_speed_of_a_published_set() -> None:
    runs = simulate_many("table-3.1", vary={"drive.torque": [0.0, 1.0]}, stop_time=0.1)
    for run, torque in zip(runs, (0.0, 1.0)):
        one = simulate("table-3.1", Inputs(torque=torque), stop_time=0.1)
        assert run["crank.angle"][-1] == pytest.approx(one["crank.angle"][-1], rel=1e-12)
    with pytest.raises(InputError, match="both speed and torque are given"):
        simulate_many("table-3.1", Inputs(speed=3.0), vary={"drive.torque": [0.0, 1.0]}, stop_time=0.1)


def test_texts_and_names_of_the_contract_vary_too(tmp_path: Path) -> None:
    values = {"slider.stiffness": ["1 kN/m", 1500.0], "drive.speed": ["420 rpm", "430 rpm"]}
    varied = simulate_many("table-3.1", vary=values, folder=tmp_path, **OPTIONS)
    speeds = [Inputs(speed="420 rpm"), Inputs(speed="430 rpm")]
    sets = [replace(TABLE_3_1, slider_stiffness=k) for k in (1000.0, 1500.0)]
    assert same(varied, simulate_many(sets, speeds, initial=SETS["table-3.1"].initial, **OPTIONS))


@pytest.mark.parametrize(
    ("values", "error", "said"),
    [
        ({"slider.stiffness": [1.0, -2.0, 3.0]}, ParameterError, "set 1 of 3: parameter slider.stiffness is -2.0"),
        ({"slider.mass": [1.0, 1.0, 0.0], "rocker.mass": [1.0, 1.0, 0.0]}, ParameterError, "set 2 of 3"),
        ({"crank.length": [0.1, nan]}, ParameterError, "set 1 of 2: parameter crank.length is nan"),
        ({"crank.inertia": [1.0, 0.0]}, ParameterError, "set 1 of 2: parameter crank.inertia is 0.0"),
        ({"assembly.branch": [1, 2]}, ParameterError, "set 1 of 2: parameter assembly.branch is 2"),
        ({"slider.stifness": [1.0]}, InputError, "did you mean slider.stiffness"),
        ({"slider.stiffness": [1.0], "torque": [1.0, 2.0]}, InputError, "1 of slider.stiffness, 2 of torque"),
        ({"slider.stiffness": 3.0}, InputError, "it must be a list or an array of numbers"),
        ({"slider.stiffness": [True]}, InputError, "it must be a list or an array of numbers"),
        ({"torque": [0.0, nan]}, InputError, "set 1 of 2: torque is nan"),
        ({"torque": ["1 N.m", "1 N"]}, InputError, "set 1 of 2: torque is '1 N'"),
        ({"crank.length": ["5 cm", "5"]}, ParameterError, "set 1 of 2: parameter crank_length is '5'"),
        ({}, InputError, "vary has nothing"),
    ],
)
def test_what_varies_is_checked_and_names_the_set(values: dict[str, Any], error: type, said: str) -> None:
    heavy = replace(TABLE_3_1, crank_mass=1.0, crank_cog_distance=0.1, crank_inertia=1.0)
    with pytest.raises(error, match=said):
        simulate_many(heavy, vary=values, **OPTIONS)


def slipping() -> list[FiveBarParameters]:
    """The second runs into the limit of assembly after half a second, the others do not."""
    return [replace(TABLE_3_1, slider_stiffness=k, slider_damping=10.0) for k in (1000.0, 0.0, 2000.0)]


def test_runs_that_end_early_are_masked_and_counted() -> None:
    many = simulate_many(slipping(), Inputs(speed=SPEED), stop_time=1.0, step=0.01)
    assert many.status.tolist() == [0, 3, 0]
    assert many.counts.tolist() == [101, 50, 101]
    one = simulate(slipping()[1], Inputs(speed=SPEED), stop_time=1.0, step=0.01)
    assert many.messages == ("", one.message, "")
    assert many[1].message.startswith("limit of assembly at t = 0.499978413 s, crank angle 21.99")
    assert_near(many[1].values, one.values[:-1], one.names, 1e-8)
    u = many.output("slider.position")
    assert u.mask.sum(axis=1).tolist() == [0, 51, 0]
    assert np.all(u.mask[1, 50:])
    assert np.all(np.isfinite(u.compressed()))
    assert np.all(np.isnan(many.states[1, 50:]))


def test_steps_that_do_not_suffice() -> None:
    many = simulate_many(SPRINGS[:2], Inputs(speed=SPEED), max_steps=10, **OPTIONS)
    assert many.status.tolist() == [4, 4]
    assert many.messages[0].startswith("10 steps did not suffice: stopped at t = ")


def test_input_that_ceases_to_be_a_number_ends_its_run_alone() -> None:
    # only the first crank gets as far as that
    force = Function(lambda t, th2, u, w2, v: np.sqrt(1.0 - th2))
    inputs = [Inputs(torque=torque, force=force) for torque in (10.0, 0.5)]
    many = simulate_many([replace(TABLE_3_1, gravity=0.0)] * 2, inputs, stop_time=0.05, step=5e-3)
    assert many.status.tolist() == [2, 0]
    assert many.messages[0].startswith("the input force is not a finite number at t = 0.0193")
    assert 0 < many.counts[0] < many.counts[1] == 11


def same(a: Ensemble, b: Ensemble) -> bool:
    pairs = ((getattr(a, name), getattr(b, name)) for name in ("states", "forces", "status", "counts", "energies"))
    return a.messages == b.messages and all(np.array_equal(*pair, equal_nan=True) for pair in pairs)


@pytest.mark.parametrize("n_jobs", [None, 2])
def test_runs_that_cannot_start_leave_the_others_as_they_are(n_jobs: int | None) -> None:
    force = Function(lambda t, th2, u, w2, v: nan if th2 > 1.0 else 0.0)
    starts = [InitialState(crank_angle=0.05 * i) for i in range(7)]
    starts[2], starts[5] = InitialState(slider_position=1.0), InitialState(crank_angle=1.5)
    inputs, options = Inputs(speed=SPEED, force=force), {"stop_time": 0.01, "step": 1e-3}
    many = simulate_many(SPRINGS, inputs, initial=starts, batch=3, n_jobs=n_jobs, **options)
    assert many.status.tolist() == [0, 0, 3, 0, 0, 2, 0]
    assert list(many.failures) == [2, 5]
    assert many.messages[2].startswith("the links cannot be joined at crank angle 0 rad (0.0000 deg) and slider pos")
    assert many.messages[5].startswith("the input force is not a finite number at t = 0 s, crank angle 1.5 rad")
    assert many.counts.tolist() == [11, 11, 0, 11, 11, 0, 11]
    assert np.isnan(many.energies[[2, 5]]).all()
    assert len(many[2]) == 0
    assert many.output("crank.angle").mask[2].all()
    for i in (0, 4, 6):
        assert_same(many, i, parameters=SPRINGS[i], inputs=inputs, initial=starts[i], **options)


def test_chosen_outputs_are_those_of_all() -> None:
    every = simulate_many(slipping(), Inputs(speed=SPEED), stop_time=1.0, step=0.01)
    names = ("slider.position", "pin.C.fx", "energy.residual", "crank.angle")
    some = simulate_many(slipping(), Inputs(speed=SPEED), outputs=names, stop_time=1.0, step=0.01)
    assert some.names == names
    assert some.states.size == some.forces.size == 0
    assert some.values.shape == (3, 101, 4)
    for name in names:
        assert np.ma.allequal(some.output(name), every.output(name))
        assert np.array_equal(some.output(name).mask, every.output(name).mask)
        assert np.array_equal(some[1][name], every[1][name])
    with pytest.raises(InputError, match=r"no output 'crank.speed'.* \(the names are slider.position, .*crank.angle\)"):
        some.output("crank.speed")


@pytest.mark.parametrize("outputs", [None, ("slider.position",)])
def test_batches_on_disk_are_gone_on_with(outputs: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    starts = [InitialState()] * 2 + [InitialState(slider_position=1.0)] + [InitialState()] * 4
    inputs = [Inputs(torque=torque) for torque in TORQUES]
    options = OPTIONS | {"initial": starts, "batch": 2, "folder": tmp_path, "outputs": outputs}
    first = simulate_many(SPRINGS, inputs, **options)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 4
    computed, integrate = [], batches._integrate
    monkeypatch.setattr(batches, "_integrate", lambda task, *more: computed.append(task) or integrate(task, *more))
    again = simulate_many(SPRINGS, inputs, **options)
    assert same(first, again)
    assert computed == []
    assert again.failures[2].startswith("the links cannot be joined")
    damaged = bytearray(files[1].read_bytes())
    damaged[len(damaged) // 2] ^= 1
    files[1].write_bytes(damaged)
    files[2].unlink()
    with pytest.warns(RuntimeWarning, match="is damaged"):
        again = simulate_many(SPRINGS, inputs, **options)
    assert same(first, again)
    assert len(computed) == 2
    # what differs is computed anew
    simulate_many(SPRINGS, inputs, **options | {"tolerance": 1e-8})
    simulate_many(SPRINGS, inputs, **options | {"outputs": ("crank.angle",)})
    assert len(list(tmp_path.iterdir())) == 12


def resident() -> int:
    """Memory of this process (bytes)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_an_ensemble_on_disk_takes_little_memory(tmp_path: Path) -> None:
    options: dict[str, Any] = {"stop_time": 2.0, "step": 1e-3, "batch": 4}
    simulate_many(MANY[:8], Inputs(speed=SPEED), **options)
    before = resident()
    kept = simulate_many(MANY, Inputs(speed=SPEED), folder=tmp_path, **options)
    size = kept.states.nbytes + kept.forces.nbytes
    assert size > 60e6
    assert resident() - before < 0.2 * size
    # none but the batches has a name
    assert {path.suffix for path in tmp_path.iterdir()} == {".runs"}
    held = simulate_many(MANY, Inputs(speed=SPEED), **options)
    assert same(kept, held)


def test_where_the_disk_has_no_room_the_results_are_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full, raising=False)
    with pytest.warns(RuntimeWarning, match=r"has no room for .* MB \(No space left on device\): they are in memory"):
        there = simulate_many(SPRINGS, Inputs(speed=SPEED), folder=tmp_path, **OPTIONS)
    assert same(there, simulate_many(SPRINGS, Inputs(speed=SPEED), **OPTIONS))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_an_ensemble_that_is_killed_is_gone_on_with(tmp_path: Path) -> None:
    code = f"""
from tests.analysis.test_ensemble import *
simulate_many(MANY, Inputs(speed=SPEED), folder={str(tmp_path)!r}, **LONG)
"""
    process = subprocess.Popen([sys.executable, "-c", code], cwd=Path(__file__).parents[2])
    try:
        while process.poll() is None and len(list(tmp_path.glob("*.runs"))) < 5:
            sleep(0.01)
    finally:
        process.kill()
    assert process.wait() == -signal.SIGKILL
    done = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.runs")}
    assert 5 <= len(done) < 100
    again = simulate_many(MANY, Inputs(speed=SPEED), folder=tmp_path, **LONG)
    assert len(list(tmp_path.glob("*.runs"))) == 100
    assert {path: path.stat().st_mtime_ns for path in done} == done
    assert same(again, simulate_many(MANY, Inputs(speed=SPEED), **LONG))


@pytest.mark.parametrize("n_jobs", [None, 2])
def test_an_interrupt_is_heard_and_keeps_what_was_done(n_jobs: int | None, tmp_path: Path) -> None:
    # one short batch, and then runs of many seconds each
    buzz = Inputs(speed=SPEED, force=Harmonics(0.0, [1.0], [1e6], [0.0]))
    inputs = [Inputs(speed=SPEED)] * 2 + [buzz] * 6
    options: dict[str, Any] = {"stop_time": 10.0, "step": 0.1, "batch": 2, "folder": tmp_path}
    simulate_many([TABLE_3_1] * 2, inputs[1:3], **options | {"stop_time": 1e-3})
    timer = threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT))
    begun = perf_counter()
    timer.start()
    with pytest.raises(EnsembleInterrupted, match=r"with 2 of 8 runs done; whole batches are kept in ") as caught:
        simulate_many([TABLE_3_1] * 8, inputs, n_jobs=n_jobs, **options)
    assert perf_counter() - begun < 10.0
    many = caught.value.ensemble
    assert many.status.tolist() == [0, 0] + [-1] * 6
    assert many.counts[:2].tolist() == [101, 101]
    assert many.messages[2].startswith("interrupted at t = ")
    assert many.messages[7] == "not run: interrupted"
    assert many[2].status == -1
    over = "8 runs of 101 samples from 0 to 10 s"
    assert repr(many) == f"<Ensemble: {over}, 6 of them interrupted before their end>"
    ended = replace(many, status=np.array([0, 3] + [-1] * 6))
    assert repr(ended).endswith("6 of them interrupted before their end, 1 of them ended early: see messages>")
    # the short one is there, what was cut off is not
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:a worker was killed")
@pytest.mark.parametrize("times", [1, 1000])
def test_killed_workers_leave_what_was_done(times: int, tmp_path: Path) -> None:
    from joblib.externals.loky import reusable_executor

    def kill() -> None:
        while len(list(tmp_path.glob("*.runs"))) < 20:
            sleep(0.01)
        for _ in range(times):
            # asked for an executor, loky might make another
            processes = list(getattr(reusable_executor._executor, "_processes", None) or ())
            if over.is_set():
                return
            for process in processes[:1]:
                with suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            sleep(0.01)

    over = threading.Event()
    options: dict[str, Any] = {**LONG, "folder": tmp_path}
    killer = threading.Thread(target=kill)
    killer.start()
    with joblib.parallel_config(backend="loky"):
        if times == 1:
            many = simulate_many(MANY, Inputs(speed=SPEED), n_jobs=2, **options)
            assert (many.status == 0).all()
        else:
            with pytest.raises(EnsembleBroken, match=r"were killed 4 times, .*, with \d+ of 400 runs done") as caught:
                simulate_many(MANY, Inputs(speed=SPEED), n_jobs=2, **options)
            many = caught.value.ensemble
    over.set()
    killer.join()
    done = np.flatnonzero(many.status == 0)
    assert 0 < len(done) < 400 or times == 1
    assert np.isnan(many.states[many.status != 0]).all()
    run = {"parameters": MANY[done[0]], "inputs": Inputs(speed=SPEED), "stop_time": 20.0, "step": 1.0}
    assert_same(many, int(done[0]), **run)
    kept = len(list(tmp_path.glob("*.runs")))
    assert kept >= len(done) // 4
    assert (simulate_many(MANY, Inputs(speed=SPEED), **options).status == 0).all()


def test_progress_changes_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    silent = simulate_many(SPRINGS, Inputs(speed=SPEED), batch=2, **OPTIONS)
    assert capfd.readouterr() == ("", "")
    shown = simulate_many(SPRINGS, Inputs(speed=SPEED), batch=2, progress=True, **OPTIONS)
    assert np.array_equal(silent.states, shown.states)


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"parameters": []}, InputError, "at least one set of parameters"),
        ({"inputs": [Inputs()]}, InputError, "1 inputs for 3 sets of parameters"),
        ({"initial": [InitialState()] * 4}, InputError, "4 initial states for 3"),
        ({"inputs": [Inputs(), Inputs(speed=1.0), Inputs()]}, InputError, "all drive the mechanism in the same way"),
        ({"tolerance": 1.0}, ParameterError, "solver.tolerance"),
        ({"hold": 1e-3}, InputError, "held over 0.001 s"),
        ({"batch": 0}, ParameterError, "batch is 0"),
        ({"batches": 2}, InputError, "no argument 'batches' of simulate_many; did you mean batch"),
        ({"n_jobs": 0}, InputError, "0 cores"),
        ({"n_jobs": 1.5}, InputError, r"n_jobs is 1\.5"),
        ({"batch": 2.5}, ParameterError, "batch is 2.5"),
        ({"outputs": ["crank.angel"]}, InputError, "there is no output 'crank.angel'; did you mean crank.angle"),
        ({"step": -1.0}, InputError, "step is -1.0 s"),
        ({"outputs": "slider.position"}, InputError, "must be a list of names"),
        (ONE | {"vary": VARIED | {"slider_stiffness": [2e3]}}, InputError, "slider_stiffness twice"),
        (ONE | {"vary": {"drive.speed": [1.0], "speed": [1.0]}}, InputError, "speed twice"),
        ({"parameters": ["table-3.1"] * 3, "initial": [{}, {}]}, InputError, "2 .*for 3 sets.*: give one, or one"),
        ({"initial": [{}, {}]}, InputError, "2 .*for 3 sets.*: give one, or one for each"),
        (ONE, InputError, "it must be a list, or vary must say what differs"),
        ({"vary": VARIED}, InputError, "one set of parameters"),
        (ONE | {"inputs": [Inputs()], "vary": VARIED}, InputError, "one object for all sets"),
    ],
)
def test_what_is_not_usable_is_refused_and_names_its_run(change: dict[str, Any], error: type, said: str) -> None:
    with pytest.raises(error, match=said):
        simulate_many(**{"parameters": SPRINGS[:3]} | OPTIONS | change)


def test_example_with_dask() -> None:
    words = ["-W", "error", EXAMPLES / "dask_ensemble.py", "--mechanisms", "40"]
    printed = called(sys.executable, *words, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}, timeout=120)
    assert "40 mechanisms" in printed
