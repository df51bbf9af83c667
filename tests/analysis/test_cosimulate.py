"""The FMU through FMPy against the in-process solver and against the reference numbers, and `compare` itself."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from functools import cache
from math import inf, nan, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis import CosimulationError, Inputs, Trajectory, compare, cosimulate, simulate
from analysis.mechanisms import FIVE_BAR, find_mechanism
from analysis.run import CASES
from analysis.units import CM_PER_METRE
from linkwork.errors import InputError
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests import published
from tests.fmu.runner import run_in_process

from .conftest import copied

SPEED = SETS["table-3.1"].crank_speed

# --- Through a process of its own: what an FMU leaves in an interpreter must not reach the next test


def _check_cases(fmu: str, names: list[str], method: str) -> list[Any]:
    """Cases of `analysis.run.checks` and of this project's issue, each in process and through the FMU."""
    from dataclasses import replace

    import numpy as np

    from analysis import Function, Harmonics, Inputs, TorsionBar, compare, cosimulate, ramp, simulate, steps
    from analysis.run import CASES
    from linkwork.five_bar.parameters import InitialState
    from linkwork.five_bar.published import TABLE_3_1

    def case(name: str) -> dict:
        common = {"stop_time": 0.2, "step": 1e-3}
        if name == "bar-and-load":
            point = replace(TABLE_3_1, coupler_point_distance=0.1, coupler_point_angle=0.4, slider_coulomb_friction=2.0)
            inputs = Inputs(torque=(TorsionBar(torque=5.0), Harmonics(0.0, [1.0], [50.0], [0.0])), load_x=2.0)
            return {"parameters": point, "inputs": inputs, **common}
        if name == "ramp-and-jump":
            inputs = Inputs(speed=(ramp(10.0, 40.0, 0.03, 0.1), steps([0.0, 0.0505], [0.0, 8.0])))
            return {"parameters": TABLE_3_1, "inputs": inputs, **common}
        if name == "functions-of-the-state":
            inputs = Inputs(
                torque=Function(lambda t, th2, u, w2, v: 2.0 + 10.0 * t - 0.05 * w2),
                force=Function(lambda t, th2, u, w2, v: -300.0 * u - 20.0 * v),
                load_y=Function(lambda t, th2, u, w2, v: np.sin(th2)),
            )
            return {"parameters": TABLE_3_1, "inputs": inputs, **common}
        if name == "late-start":
            initial = InitialState(crank_angle=2.0, slider_position=0.003, slider_velocity=-0.1)
            inputs = Inputs(speed=Harmonics(40.0, [3.0], [30.0], [0.0]), force=steps([0.0, 5.1], [0.0, 4.0]))
            times = {"start_time": 5.0, "stop_time": 5.2005, "step": 1e-3}
            return {"parameters": TABLE_3_1, "inputs": inputs, "initial": initial, **times}
        kept = {key: getattr(CASES[name], key) for key in ("parameters", "inputs", "initial", "step")}
        return kept | {"stop_time": 0.4}

    results = []
    for name in names:
        options = case(name)
        through_fmu = cosimulate(fmu, tolerance=1e-9, **options)
        tolerance = 1e-9 if method == "compiled" else 1e-10
        in_process = simulate(hold=options["step"], tolerance=tolerance, method=method, **options)
        result = compare(in_process, through_fmu)
        results.append([name, result.worst.name, result.worst.relative, len(through_fmu), through_fmu.status])
    return results


#: Every standard case of the five-bar, and what joins several of them.
CASE_NAMES = [name for name, case in CASES.items() if find_mechanism(case.parameters) is FIVE_BAR]
CASE_NAMES += ["bar-and-load", "ramp-and-jump", "functions-of-the-state", "late-start"]


@pytest.mark.parametrize("method", ["compiled", "DOP853"])
def test_fmu_and_in_process_solver_agree(fmu: Path, method: str) -> None:
    # by SciPy's integrator for some of them, so that nothing but the equations is shared
    names = CASE_NAMES if method == "compiled" else ["torque-switched-off", "other-assembly", "late-start"]
    results = run_in_process(_check_cases, fmu, names, method, timeout=120.0)
    assert [result[0] for result in results] == names
    for name, output, relative, samples, status in results:
        assert relative <= 1e-6, (name, output, relative)
        assert samples > 200
        assert status == 0


def _check_random_mechanisms(fmu: str, root: str, count: int) -> dict[str, Any]:
    """Random mechanisms under random smooth inputs, in process and through the FMU."""
    import random
    import sys

    sys.path.insert(0, root)
    from analysis import Harmonics, Inputs, compare, cosimulate, simulate
    from tests.strategies import seeded

    def waves(source: random.Random, mean: float, size: float) -> Harmonics:
        n = source.randint(1, 3)
        ranges = ((-size, size), (5.0, 100.0), (0.0, 6.3))
        return Harmonics(mean, *([source.uniform(*each) for _ in range(n)] for each in ranges))

    worst: list[Any] = []
    ended: list[Any] = []
    for seed in range(count):
        case = seeded(seed)
        source = random.Random(seed)
        held = case.torque_inputs
        acting = {name: waves(source, getattr(held, name), 10.0) for name in ("force", "load_x", "load_y")}
        speed = seed % 2 == 1
        # torques in proportion to the crank's inertia: a light one at thousands of rad/s is a matter of rounding
        inertia = case.parameters.constants().i2b
        torque = waves(source, 100.0 * inertia * held.torque, 300.0 * inertia)
        drive = {"speed": waves(source, case.state[2], 5.0)} if speed else {"torque": torque}
        options: dict[str, Any] = {"initial": case.initial, "stop_time": 0.1, "step": 1e-3, "tolerance": 1e-9}
        inputs = Inputs(**acting, **drive)
        through_fmu = cosimulate(fmu, case.parameters, inputs, **options)
        in_process = simulate(case.parameters, inputs, hold=1e-3, **options)
        result = compare(in_process, through_fmu)
        worst.append([result.worst.relative, result.worst.name, seed])
        if seed % 9 == 0:
            options["tolerance"] = 1e-11
            independent = simulate(case.parameters, inputs, hold=1e-3, method="DOP853", **options)
            result = compare(independent, through_fmu)
            worst.append([result.worst.relative, result.worst.name, seed])
        ended.append([seed, len(through_fmu), through_fmu.status, in_process.status, through_fmu.message])
    return {"worst": sorted(worst)[-5:], "ended": ended}


@pytest.mark.slow
def test_fmu_and_in_process_solver_agree_on_random_mechanisms(fmu: Path) -> None:
    found = run_in_process(_check_random_mechanisms, fmu, Path(__file__).parents[2], 40, timeout=240.0)
    assert found["worst"][-1][0] <= 1e-6, found["worst"]
    ended = found["ended"]
    assert len(ended) == 40
    # those that reach the limit of assembly do so in both, at the same sample; most go on to the end, and all move
    assert all(status == other for _, _, status, other, _ in ended)
    assert sum(status == 0 for _, _, status, _, _ in ended) > 20
    assert {status for _, _, status, _, _ in ended} <= {0, 3}
    assert all("limit of assembly" in message for _, _, status, _, message in ended if status)
    assert np.mean([count for _, count, _, _, _ in ended]) > 60


def _runs(fmu: str) -> dict[str, Any]:
    """Runs that single numbers are asked of, one after the other."""
    import json
    from dataclasses import replace
    from math import pi

    import numpy as np

    from analysis import CosimulationError, Function, Inputs, RunInterrupted, TorsionBar, cosimulate, simulate, steps
    from linkwork.errors import InputError
    from linkwork.five_bar.parameters import InitialState
    from linkwork.five_bar.published import SETS, TABLE_3_1

    found: dict[str, Any] = {}

    def report(of: str, **options: Any) -> None:
        try:
            cosimulate(fmu, **options)
            found[of] = "nothing"
        except (CosimulationError, InputError) as error:
            found[of] = [type(error).__name__, str(error)]

    # the reference numbers: 0.5 deg a step
    speed = SETS["table-3.1"].crank_speed
    turns = cosimulate(fmu, TABLE_3_1, Inputs(speed=speed), stop_time=3 / 7, step=pi / 360 / speed, tolerance=1e-11)
    found["u"] = {str(deg): turns["slider.position"][2 * deg] for deg in (90, 360, 720, 1080)}
    found["torque"] = turns["drive.applied_torque"][0]
    found["C"] = [turns["pin.C.fx"][720], turns["pin.C.fy"][720]]
    found["residual"] = float(np.abs(turns["energy.residual"]).max())
    # the torsion bar's torque is held, that of the middle of each step
    bar = {"parameters": TABLE_3_1, "inputs": Inputs(torque=TorsionBar(torque=10.0)), "stop_time": 0.25}
    for step in (1e-3, 1e-4):
        end = cosimulate(fmu, step=step, tolerance=1e-11, **bar).values[-1]
        found[f"bar-{step}"] = [end[0], end[5], end[1]]

    # loss of assembly: the refused step ends the run
    slips = replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=10.0)
    lost = cosimulate(fmu, slips, Inputs(speed=speed), stop_time=3.0, step=0.01)
    same = simulate(slips, Inputs(speed=speed), stop_time=3.0, step=0.01, hold=0.01)
    found["lost"] = [lost.status, lost.message, len(lost), lost.time[-1], bool(np.isfinite(lost.values).all())]
    found["same"] = [same.status, len(same), np.abs(same["slider.position"][:50] - lost["slider.position"]).max()]

    report("bad parameter", parameters=TABLE_3_1, stop_time=0.1, tolerance=0.5)
    apart = InitialState(slider_position=1.0)
    report("not assembled", parameters=TABLE_3_1, initial=apart, stop_time=0.1)
    wrong = Function(lambda t, th2, u, w2, v: np.sqrt(0.0505 - t))
    with np.errstate(invalid="ignore"):
        report("not a number", parameters=TABLE_3_1, inputs=Inputs(force=wrong), stop_time=0.1)
    report("no time", parameters=TABLE_3_1, stop_time=0.0)

    # Ctrl-C is heard between two steps
    def force(t: float, th2: float, u: float, w2: float, v: float) -> float:
        import os
        import signal

        if abs(t - 0.05) < 1e-9:
            os.kill(os.getpid(), signal.SIGINT)
        return 0.0

    try:
        cosimulate(fmu, TABLE_3_1, Inputs(speed=speed, force=Function(force)), stop_time=0.1)
    except RunInterrupted as interrupted:
        found["interrupted"] = [str(interrupted), len(interrupted.trajectory)]

    jump = cosimulate(fmu, TABLE_3_1, Inputs(torque=steps([0.0, 0.3], [0.1, 0.7])), stop_time=0.5, step=0.1)
    found["jump"] = jump["drive.applied_torque"].tolist()
    found["statistics"] = [jump.statistics["steps"], jump.source]
    return json.loads(json.dumps(found, default=float))


@pytest.fixture(scope="module")
def runs(fmus: dict[str, Path]) -> Any:
    return run_in_process(_runs, fmus["FiveBarSlider"], timeout=120.0)


def test_reference_numbers_through_the_fmu(runs: dict[str, Any]) -> None:
    for degrees, u in published.U_CM_AT_CRANK_DEG.items():
        assert runs["u"][str(degrees)] * CM_PER_METRE == pytest.approx(u, abs=6e-10)
    assert runs["torque"] * 1e7 == pytest.approx(published.CRANK_TORQUE_AT_START_DYN_CM, rel=1e-9)
    assert [f * 1e5 for f in runs["C"]] == pytest.approx(published.FORCE_AT_C_AT_360_DEG_DYN, abs=2e-3)
    assert runs["residual"] < 1e-11


def test_torsion_bar_of_the_reference_through_the_fmu(runs: dict[str, Any]) -> None:
    # held at the middle of the step, the torque's impulse is right to second order: at ten times shorter steps the run is
    # at least thirty times closer, where a torque held from the beginning would be ten times
    reference = published.TORQUE_AT_0_25_S
    exact = np.array([reference["th2_rad"], reference["u_cm"] / CM_PER_METRE, reference["th2_rate_rad_s"]])
    coarse, fine = (np.abs(np.array(runs[f"bar-{step}"]) - exact) for step in (1e-3, 1e-4))
    assert np.all(fine <= coarse / 30.0)
    assert coarse[0] < 0.01
    assert coarse[2] < 0.2
    assert fine[2] < 2e-3


def test_refused_step_ends_the_run_with_status_message_and_data(runs: dict[str, Any]) -> None:
    status, message, count, end, finite = runs["lost"]
    assert (status, count, finite) == (3, 50, True)
    assert end == pytest.approx(0.49)
    assert message.startswith("in the step from t = 0.49 s: limit of assembly")
    assert runs["same"][:2] == [3, 51]
    assert runs["same"][2] < 1e-9


def test_what_the_fmu_refuses_is_reported_in_its_sentence(runs: dict[str, Any]) -> None:
    kind, sentence = runs["bad parameter"]
    assert kind == "CosimulationError"
    assert "parameter solver.tolerance is 0.5: it must be between 1e-13 and 0.01" in sentence
    kind, sentence = runs["not assembled"]
    assert kind == "CosimulationError"
    assert "the links cannot be joined at crank angle 0 rad (0.0000 deg) and slider position 1 m" in sentence


def test_inputs_that_are_not_usable_are_refused_here(runs: dict[str, Any]) -> None:
    kind, sentence = runs["not a number"]
    assert kind == "NotFiniteError"
    assert sentence.startswith("the input force is not a finite number at t = 0.051 s, crank angle")
    assert runs["no time"][0] == "InputError"


def test_interrupt_keeps_the_data(runs: dict[str, Any]) -> None:
    sentence, count = runs["interrupted"]
    # the speed is sampled one step ahead, and the force with it
    assert sentence == "interrupted at t = 0.049 s"
    assert count == 50


def test_samples_at_a_jump_belong_to_what_follows(runs: dict[str, Any]) -> None:
    assert runs["jump"] == [0.1, 0.1, 0.1, 0.7, 0.7, 0.7]
    assert runs["statistics"] == [5.0, "FiveBarSlider.fmu"]


# --- Files that are no such FMU


def _cosimulate(path: Path) -> Trajectory:
    return cosimulate(path, TABLE_3_1, Inputs(speed=SPEED), stop_time=0.1)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(CosimulationError, match=r"there is no file .*none\.fmu: build it with 'linkwork build'"):
        _cosimulate(tmp_path / "none.fmu")


def test_file_that_is_no_fmu(tmp_path: Path) -> None:
    path = tmp_path / "text.fmu"
    path.write_text("hello", encoding="utf-8")
    with pytest.raises(CosimulationError, match=r"text\.fmu is not an FMU: "):
        _cosimulate(path)


FOREIGN = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Foreign" guid="{{1}}">
  {interface}
  <ModelVariables>
    <ScalarVariable name="drive.torque" valueReference="0" causality="input" variability="continuous">
      <Real start="0"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
"""


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_foreign_fmu(tmp_path: Path, interface: str) -> None:
    path = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", FOREIGN.format(interface=f'<{interface} modelIdentifier="Foreign"/>'))
    with pytest.raises(CosimulationError, match=r"is not a FiveBarSlider .*, but Foreign: it has no .*drive\.speed"):
        _cosimulate(path)


def test_fmu_without_a_library_for_this_platform(fmu: Path, tmp_path: Path) -> None:
    stripped = copied(fmu, tmp_path / "stripped.fmu", lambda name, content: None if "binaries/" in name else content)
    with pytest.raises(CosimulationError, match=r"stripped\.fmu: Cannot find shared library"):
        _cosimulate(stripped)


# --- Comparing


@cache
def base() -> Trajectory:
    return simulate(TABLE_3_1, Inputs(speed=SPEED), stop_time=0.1, step=1e-2)


def changed(name: str, change: Any) -> Trajectory:
    values = base().values.copy()
    values[:, FIVE_BAR.output_names.index(name)] += change
    return replace(base(), values=values)


@pytest.mark.parametrize("name", FIVE_BAR.output_names)
def test_difference_in_one_output_is_found_with_its_size(name: str) -> None:
    change = np.zeros(11)
    change[3], change[7] = 0.03, -0.04
    result = compare(base(), changed(name, change))
    assert result[name].largest == pytest.approx(0.04)
    assert result[name].rms == pytest.approx(0.05 / np.sqrt(11.0))
    assert result[name].unit == base().units[name]
    assert result.worst.name == name
    assert not result.agrees
    assert sum(d.largest != 0.0 for d in result.differences) == 1


@pytest.mark.parametrize("factor", [0.9, 1.1])
@pytest.mark.parametrize("name", ["crank.angle", "slider.position", "pin.C.fy", "energy.kinetic", "transmission.angle"])
def test_tolerance_is_relative_to_the_largest_value(name: str, factor: float) -> None:
    scale = np.abs(base()[name]).max()
    result = compare(base(), changed(name, 1e-4 * factor * scale), tolerance=1e-4)
    assert result[name].relative == pytest.approx(1e-4 * factor)
    assert result.agrees is (factor < 1.0)


def test_small_output_is_measured_by_its_like() -> None:
    # with no load and no gravity at all, the guide's force is what rounding leaves of forces that are not small
    result = compare(base(), changed("crank.acceleration", 1e-9))
    assert result["crank.acceleration"].scale == pytest.approx(1e-3 * SPEED**2)
    assert compare(base(), changed("energy.residual", 1e-9)).agrees
    assert not compare(base(), changed("closure.residual", 1e-6)).agrees


def test_whole_turns_of_an_angle_are_no_difference() -> None:
    for name in ("coupler.angle", "rocker.angle"):
        turned = changed(name, 2.0 * pi * np.arange(11) - 10.0 * pi)
        assert compare(base(), turned).agrees
        assert compare(base(), turned)[name].largest < 1e-13
        near = compare(base(), changed(name, 2.0 * pi - 0.01))
        assert near[name].largest == pytest.approx(0.01)
    assert not compare(base(), changed("crank.angle", 2.0 * pi)).agrees
    assert not compare(base(), changed("transmission.angle", 2.0 * pi)).agrees


def test_angles_on_both_sides_of_half_a_turn() -> None:
    a = changed("coupler.angle", pi - 1e-9 - base()["coupler.angle"])
    b = changed("coupler.angle", -pi + 1e-9 - base()["coupler.angle"])
    assert compare(a, b)["coupler.angle"].largest == pytest.approx(2e-9, rel=1e-5)


@pytest.mark.parametrize("bad", [nan, inf])
@pytest.mark.parametrize("both", [False, True])
def test_what_is_not_a_number_agrees_with_nothing(bad: float, both: bool) -> None:
    change = np.zeros(11)
    change[5] = bad
    for name in ("slider.position", "crank.angle", "transmission.angle"):
        other = changed(name, change)
        assert not compare(other if both else base(), other).agrees
        assert not compare(other, base()).agrees


def shorter(run: Trajectory, n: int, **changes: Any) -> Trajectory:
    return replace(run, time=run.time[:n], values=run.values[:n], **changes)


def test_runs_of_different_length_cannot_be_compared() -> None:
    with pytest.raises(InputError, match=r"cannot be compared: 11 samples to t = 0.1 s, and 10 samples to t = 0.09 s"):
        compare(base(), shorter(base(), 10))
    with pytest.raises(InputError, match="cannot be compared"):
        compare(base(), replace(base(), time=base().time + 1e-6))
    with pytest.raises(InputError, match="cannot be compared: 0 samples, and 0 samples"):
        compare(shorter(base(), 0), shorter(base(), 0))


def test_runs_that_ended_early_are_compared_where_both_went() -> None:
    ended = {"status": 3, "message": "limit of assembly"}
    in_process = shorter(base(), 8, **ended)
    last = in_process.time.copy()
    last[-1] -= 5e-3
    in_process = replace(in_process, time=last)
    assert compare(in_process, shorter(base(), 7, **ended)).agrees
    assert compare(shorter(base(), 7, **ended), in_process).agrees
    # for another reason, or not at the same sample, is not the same end
    with pytest.raises(InputError, match="cannot be compared"):
        compare(in_process, shorter(base(), 7, status=4))
    with pytest.raises(InputError, match="cannot be compared"):
        compare(in_process, shorter(base(), 3, **ended))
