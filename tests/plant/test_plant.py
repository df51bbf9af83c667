"""The plant as a stateful object: what a step does, what it refuses, and how a run is saved and taken up again."""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf, isfinite, nan, pi, radians
from typing import Any

import numpy as np
import pytest
from linkwork.five_bar.plant import INPUT_NAMES, SPEED_DRIVE, TORQUE_DRIVE, Plant, check_assembly, error_scale
from linkwork.slider_crank.plant import Plant as SliderCrankPlant
from scipy.integrate import solve_ivp

from linkwork.errors import (
    AssemblyError,
    InputError,
    IntegrationError,
    LinkworkError,
    ParameterError,
    StateError,
    StepError,
)
from linkwork.five_bar import dynamics
from linkwork.five_bar.kinematics import coefficients, position
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.limits import LIMIT_SINE
from linkwork.plant import MechanismPlant, check_tolerance
from linkwork.slider_crank.published import OFFSET_CASE
from tests import published
from tests.published import CM, DYN_CM, DYN_S_PER_CM
from tests.strategies import seeded

W = SETS["table-3.1"].crank_speed
#: A turn at 420 rpm (s).
TURN = 2.0 * pi / W


def speed_plant(**options: Any) -> Plant:
    return Plant(
        options.pop("parameters", TABLE_3_1),
        options.pop("initial", InitialState()),
        drive_mode=SPEED_DRIVE,
        inputs={"drive.speed": W, **options.pop("inputs", {})},
        **options,
    )


def go(plant: MechanismPlant, steps: int, step: float) -> None:
    start = plant.time
    for n in range(steps):
        plant.step(start + n * step, step)


# ------------------------------------------------------------------ what a step does


def test_step_goes_where_the_known_numbers_say() -> None:
    plant = speed_plant(tolerance=1e-11)
    step = TURN / 360
    for n in range(1080):
        plant.step(n * step, step)
        if n + 1 in published.U_CM_AT_CRANK_DEG:
            assert plant.state[0] == pytest.approx(radians(n + 1), abs=1e-12)
            assert plant.outputs().slider_position / CM == pytest.approx(published.U_CM_AT_CRANK_DEG[n + 1], abs=1e-8)
    assert plant.time == pytest.approx(3 * TURN, rel=1e-14)
    assert abs(plant.outputs().energy_residual) < 1e-9
    assert plant.outputs().closure_residual < 1e-15


def test_crank_torque_at_the_start() -> None:
    torque = speed_plant().outputs().drive_applied_torque
    assert torque / DYN_CM == pytest.approx(published.CRANK_TORQUE_AT_START_DYN_CM, rel=5e-10)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("drive", [TORQUE_DRIVE, SPEED_DRIVE])
def test_step_against_another_integrator(seed: int, drive: int) -> None:
    case = seeded(seed)
    i = case.speed_inputs if drive == SPEED_DRIVE else case.torque_inputs
    p = case.parameters.constants()
    given = {
        "drive.torque": i.torque,
        "drive.speed": case.state[2],
        "drive.acceleration": i.acceleration,
        "slider.force": i.force,
        "load.fx": i.load_x,
        "load.fy": i.load_y,
    }
    plant = Plant(case.parameters, case.initial, drive_mode=drive, tolerance=1e-12, inputs=given)
    duration = 2e-3
    expected = solve_ivp(
        lambda t, y: dynamics.derivative(tuple(y.tolist()), i, p),
        (0.0, duration),
        case.state,
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    ).y[:, -1]
    plant.step(0.0, duration)
    assert plant.state == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_halving_the_communication_step_changes_nothing_beyond_the_tolerance() -> None:
    ends = []
    for steps in (7, 14, 28, 200):
        plant = speed_plant(tolerance=1e-9)
        go(plant, steps, TURN / steps)
        ends.append(plant.state)
    for end in ends[1:]:
        assert end[1:4] == pytest.approx(ends[0][1:4], rel=0, abs=2e-8)
        assert end[0] == pytest.approx(2 * pi, rel=1e-12)


def test_tolerance_is_what_the_error_follows() -> None:
    exact = published.U_CM_AT_CRANK_DEG[360] * CM
    errors = []
    for tolerance in (1e-4, 1e-7, 1e-10):
        plant = speed_plant(tolerance=tolerance)
        plant.step(0.0, TURN)
        errors.append(abs(plant.state[1] - exact))
    assert errors[0] < 1e-3
    assert errors[1] < 1e-6
    assert errors[2] < 1e-9
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.parametrize("again", [True, False])
def test_ramp_of_the_speed_starts_anew_at_every_step(again: bool) -> None:
    # drive.speed + drive.acceleration (t - t_n), whether or not the speed is set again
    plant = speed_plant(inputs={"drive.acceleration": 200.0})
    step = 1e-3
    assert plant.outputs().crank_acceleration == 200.0
    for n in range(3):
        if again:
            plant.set_input("drive.speed", W)
        before = plant.outputs().crank_angle
        plant.step(n * step, step)
        assert plant.state[2] == pytest.approx(W + 200.0 * step, rel=1e-13)
        assert plant.state[0] - before == pytest.approx(W * step + 100.0 * step**2, rel=1e-11)


def test_ramp_continued_by_the_master_is_one_motion() -> None:
    whole, pieces = (speed_plant(inputs={"drive.acceleration": 200.0}, tolerance=1e-12) for _ in range(2))
    whole.step(0.0, 0.02)
    for n in range(10):
        pieces.set_input("drive.speed", W + 200.0 * n * 2e-3)
        pieces.step(n * 2e-3, 2e-3)
    assert pieces.state == pytest.approx(whole.state, rel=1e-9, abs=1e-10)


@pytest.mark.parametrize("seed", range(10))
def test_jump_of_the_speed_conserves_the_momentum_of_the_slider(seed: int) -> None:
    case = seeded(seed)
    p = case.parameters.constants()
    plant = Plant(case.parameters, case.initial, drive_mode=SPEED_DRIVE, inputs={"drive.speed": case.state[2]})
    before = plant.outputs()
    g = position(case.state[0], case.state[1], p)
    m = dynamics.inertia(g, coefficients(g, p), p)
    plant.set_input("drive.speed", case.state[2] + 5.0)
    after = plant.outputs()
    assert after.crank_speed == case.state[2] + 5.0
    assert (after.crank_angle, after.slider_position) == (before.crank_angle, before.slider_position)
    assert m.m12 * after.crank_speed + m.m22 * after.slider_velocity == pytest.approx(
        m.m12 * before.crank_speed + m.m22 * before.slider_velocity, rel=1e-12, abs=1e-12
    )
    assert after.slider_velocity != before.slider_velocity
    # the impulse's work is supplied, so that the balance holds across it
    assert after.energy_residual == pytest.approx(before.energy_residual, abs=1e-9 * max(1.0, after.energy_kinetic))
    assert after.energy_supplied != before.energy_supplied
    # shown before the step as it is at its start
    plant.step(0.0, 1e-9)
    assert plant.state[3] == pytest.approx(after.slider_velocity, rel=1e-5, abs=1e-5)


def test_step_size_is_carried_from_step_to_step(monkeypatch: pytest.MonkeyPatch) -> None:
    plant = speed_plant()
    go(plant, 10, 1e-4)
    assert plant.save()["step_size"] > 1e-4
    calls = 0
    original = dynamics.derivative

    def counted(*arguments: Any) -> dynamics.State:
        nonlocal calls
        calls += 1
        return original(*arguments)

    monkeypatch.setattr(dynamics, "derivative", counted)
    plant.step(10 * 1e-4, 1e-4)
    assert calls == 13  # one step of the integrator, with the evaluations at its start and its end


def test_setting_the_same_speed_again_does_nothing() -> None:
    plain, told = speed_plant(), speed_plant()
    for n in range(5):
        told.set_input("drive.speed", W)
        plain.step(n * 1e-3, 1e-3)
        told.step(n * 1e-3, 1e-3)
    assert told.state == pytest.approx(plain.state, rel=1e-14, abs=1e-16)


def test_torque_drive_has_no_use_for_the_speed() -> None:
    plants = []
    for speed in (0.0, 50.0):
        plant = Plant(TABLE_3_1, InitialState(crank_speed=W), inputs={"drive.speed": speed, "drive.torque": 0.3})
        plant.set_input("drive.acceleration", 10.0 * speed)
        plant.step(0.0, 1e-2)
        plants.append(plant)
    assert plants[0].state == plants[1].state


def test_speed_drive_has_no_use_for_the_torque_nor_the_initial_speed() -> None:
    one, other = speed_plant(), speed_plant(initial=InitialState(crank_speed=3.0), inputs={"drive.torque": 7.0})
    one.step(0.0, 1e-2)
    other.step(0.0, 1e-2)
    assert one.state == other.state
    assert one.outputs().drive_applied_torque == other.outputs().drive_applied_torque


def test_energy_balance_over_a_run_with_everything_switched_on() -> None:
    parameters = replace(
        TABLE_3_1,
        crank_mass=0.1,
        crank_cog_distance=0.02,
        slider_guide_angle=0.2,
        ground_inclination=0.4,
        slider_coulomb_friction=0.5,
        coupler_point_distance=0.1,
        coupler_point_angle=0.3,
    )
    plant = Plant(parameters, InitialState(crank_speed=30.0), tolerance=1e-11)
    for n in range(200):
        plant.set_input("drive.torque", 0.2 * (-1) ** n)
        plant.set_input("slider.force", 2.0 * (n % 3))
        plant.set_input("load.fx", 1.0 - 0.01 * n)
        plant.set_input("load.fy", 0.02 * n)
        plant.step(n * 1e-3, 1e-3)
    o = plant.outputs()
    assert o.energy_dissipated > 0.01
    assert abs(o.energy_supplied) > 0.01
    assert abs(o.energy_residual) < 1e-8


# ------------------------------------------------------------------ what a step refuses


def snapshot(plant: MechanismPlant) -> str:
    return json.dumps(plant.save())


def assert_refused(
    plant: MechanismPlant, error: type[LinkworkError], match: str, time: float, step: float
) -> LinkworkError:
    """The step fails with the message, leaves everything as it was, and the plant goes on as if it had not been asked."""
    before = snapshot(plant)
    with pytest.raises(error, match=match) as caught:
        plant.step(time, step)
    assert snapshot(plant) == before
    return caught.value


def running() -> Plant:
    plant = speed_plant()
    go(plant, 10, 1e-3)
    return plant


def running_slider_crank() -> SliderCrankPlant:
    plant = SliderCrankPlant(*OFFSET_CASE, drive_mode=SPEED_DRIVE, inputs={"drive.speed": 5.0, "axial.speed": 0.2})
    go(plant, 10, 1e-3)
    return plant


#: A plant of each kind at 0.01 s, for tests of what all of them share.
RUNNING = {"five-bar slider": running, "slider-crank": running_slider_crank}
EVERY_KIND = pytest.mark.parametrize("kind", RUNNING)


@EVERY_KIND
@pytest.mark.parametrize("step", [0.0, -1e-3])
def test_step_that_is_not_positive(step: float, kind: str) -> None:
    assert_refused(RUNNING[kind](), StepError, r"it must be greater than zero", 0.01, step)


@EVERY_KIND
@pytest.mark.parametrize(("time", "step"), [(nan, 1e-3), (0.01, nan), (inf, 1e-3), (0.01, inf)])
def test_step_that_is_not_finite(time: float, step: float, kind: str) -> None:
    assert_refused(RUNNING[kind](), StepError, "both must be finite numbers", time, step)


@EVERY_KIND
def test_gap_and_step_backwards(kind: str) -> None:
    assert_refused(
        RUNNING[kind](), StepError, r"over a gap: it starts at t = 0\.02 s, but the state is at t = 0\.01 s", 0.02, 1e-3
    )
    assert_refused(RUNNING[kind](), StepError, r"backwards: it starts at t = 0\.009 s, but .* t = 0\.01 s", 0.009, 1e-3)


def test_rounding_of_the_masters_clock_is_no_gap() -> None:
    plant = speed_plant()
    time = 0.0
    for _ in range(1000):
        plant.step(time, 1e-4)
        time += 1e-4
    plant.step(0.1, 1e-4)
    assert plant.time == pytest.approx(0.1001, rel=1e-12)


@EVERY_KIND
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_millionth_of_the_step_is_what_counts_as_rounding(sign: float, kind: str) -> None:
    RUNNING[kind]().step(0.01 + sign * 0.9e-9, 1e-3)
    assert_refused(RUNNING[kind](), StepError, "a step (backwards|over a gap)", 0.01 + sign * 1.1e-9, 1e-3)


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize("name", INPUT_NAMES)
def test_input_that_is_not_finite(name: str, value: float) -> None:
    plant = running()
    plant.set_input(name, value)
    with pytest.raises(InputError, match=rf"input {name} is {value} at t = 0\.01 s: it must be a finite number"):
        plant.outputs()
    with pytest.raises(InputError, match=name):
        plant.step(0.01, 1e-3)
    # the last good state stays readable once the input is good again
    plant.set_input(name, W if name == "drive.speed" else 0.0)
    assert isfinite(plant.outputs().slider_position)
    plant.step(0.01, 1e-3)


def test_unknown_input() -> None:
    with pytest.raises(InputError, match=r"no input 'drive\.torqe': the inputs are drive\.torque, drive\.speed"):
        running().set_input("drive.torqe", 1.0)


def falling() -> Plant:
    """Without spring and nearly without damper the slider drifts to the limit of assembly within four turns."""
    return speed_plant(parameters=replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=1e4 * DYN_S_PER_CM))


def test_limit_of_assembly_is_refused_and_the_last_good_state_kept() -> None:
    plant = falling()
    step, n = TURN / 100, 0
    error: LinkworkError | None = None
    while error is None and n < 1000:
        before = snapshot(plant)
        try:
            plant.step(n * step, step)
            n += 1
        except LinkworkError as caught:
            error = caught
    assert isinstance(error, AssemblyError)
    assert f"in the step from t = {n * step:.9g} s: " in str(error)
    assert "limit of assembly" in str(error)
    assert "crank angle" in str(error)
    assert "slider position" in str(error)
    assert snapshot(plant) == before
    assert 3.0 < n * step / TURN < 5.0  # beyond where sin(th4 - th3) passes 0.3
    o = plant.outputs()
    assert all(isfinite(value) for value in o)
    # asked again, it refuses again
    assert_refused(plant, AssemblyError, "limit of assembly", n * step, step)


def test_one_long_step_into_the_limit_is_refused_as_well() -> None:
    assert_refused(falling(), AssemblyError, r"in the step from t = 0 s: limit of assembly", 0.0, 10 * TURN)


def test_errors_count_as_absolute_below_the_scale_of_the_mechanism() -> None:
    par = TABLE_3_1
    masses = par.coupler_mass + par.rocker_mass + par.slider_mass
    energy = 0.5 * (par.crank_inertia + masses * par.crank_length**2) * 40.0**2
    expected = (1.0, par.crank_length, 40.0, 40.0 * par.crank_length, energy, energy)
    assert error_scale(par, -40.0) == pytest.approx(expected, rel=1e-14)
    assert error_scale(par, 0.1) == error_scale(par, 1.0)  # one rad/s at least


def test_step_that_cannot_meet_its_tolerance() -> None:
    plant = Plant(TABLE_3_1, InitialState(), inputs={"slider.force": 1e200})
    match = r"in the step from t = 0 s: .*, at crank angle 0 rad .* and slider position 0 m"
    assert_refused(plant, IntegrationError, match, 0.0, 1.0)


def test_refused_step_leaves_a_newly_commanded_speed_waiting() -> None:
    plant = falling()
    go(plant, 10, 1e-3)
    plant.set_input("drive.speed", 0.9 * W)
    assert_refused(plant, AssemblyError, "limit of assembly", plant.time, 10 * TURN)
    other = falling()
    go(other, 10, 1e-3)
    other.set_input("drive.speed", 0.9 * W)
    for p in (plant, other):
        p.step(p.time, 1e-3)
    assert plant.state == other.state
    assert plant.state[2] == pytest.approx(0.9 * W, rel=1e-14)


def test_refused_step_can_be_taken_shorter() -> None:
    plant, straight = falling(), falling()
    assert_refused(plant, AssemblyError, "limit of assembly", 0.0, 10 * TURN)
    plant.step(0.0, 1e-3)
    straight.step(0.0, 1e-3)
    assert plant.state == straight.state


# ------------------------------------------------------------------ how a run begins


def test_start_outside_of_assembly() -> None:
    with pytest.raises(AssemblyError) as caught:
        Plant(TABLE_3_1, InitialState(crank_angle=pi, slider_position=0.2))
    text = str(caught.value)
    assert "the links cannot be joined at crank angle 3.14159265 rad (180.0000 deg) and slider position 0.2 m" in text
    assert "0.4035 m apart" in text
    assert "0 m to 0.3 m" in text


def test_start_at_the_limit_of_assembly() -> None:
    # BD = l1 + u - l2 at crank angle 0; 30 cm is stretched out
    stretched = 0.30 - 0.1535 + 0.05
    with pytest.raises(AssemblyError, match=r"limit of assembly .* collinear to 0\.0\d\d deg"):
        check_assembly(TABLE_3_1, 0.0, stretched - 1e-9)
    # at the limit the sine is 1e-3: it is about 2 sqrt(2 x / 0.3) for BD short of stretched by x
    assert LIMIT_SINE == 1e-3
    inside = 0.3 / 8 * 1e-3**2
    check_assembly(TABLE_3_1, 0.0, stretched - 1.05 * inside)
    with pytest.raises(AssemblyError):
        check_assembly(TABLE_3_1, 0.0, stretched - 0.95 * inside)


@pytest.mark.parametrize("mode", [2, -1, 0.5, "speed"])
def test_drive_mode_is_one_of_two(mode: Any) -> None:
    with pytest.raises(ParameterError, match=r"drive\.mode is .* be 0 \(torque\) or 1 \(speed\)"):
        Plant(TABLE_3_1, InitialState(), drive_mode=mode)


@pytest.mark.parametrize("tolerance", [0.0, -1e-6, 0.1, 1e-16, nan, inf])
def test_tolerance_out_of_range(tolerance: float) -> None:
    with pytest.raises(ParameterError, match=r"solver\.tolerance is .* between 1e-13 and 0\.01$"):
        check_tolerance(tolerance)
    with pytest.raises(ParameterError, match=r"solver\.tolerance"):
        Plant(TABLE_3_1, InitialState(), tolerance=tolerance)


def test_start_with_inputs_that_are_not_usable() -> None:
    with pytest.raises(InputError, match=r"load\.fx is nan"):
        Plant(TABLE_3_1, InitialState(), inputs={"load.fx": nan})
    with pytest.raises(InputError, match="no input"):
        Plant(TABLE_3_1, InitialState(), inputs={"load": 1.0})


def test_start_with_a_kinetic_energy_that_overflows() -> None:
    with pytest.raises(InputError, match=r"energy at the start is not finite.*slider_velocity 1e\+180"):
        Plant(TABLE_3_1, InitialState(slider_velocity=1e180))
    with pytest.raises(InputError, match=r"drive\.speed is 1e\+300"):
        Plant(TABLE_3_1, InitialState(), drive_mode=SPEED_DRIVE, inputs={"drive.speed": 1e300})


def test_speed_drive_starts_at_the_commanded_speed() -> None:
    plant = speed_plant(initial=InitialState(crank_speed=1.0, slider_velocity=0.25), time=2.0)
    assert plant.state == (0.0, 0.0, W, 0.25, 0.0, 0.0)
    assert plant.time == 2.0
    assert plant.outputs().energy_residual == 0.0
    plant.step(2.0, 1e-3)
    assert plant.time == pytest.approx(2.001)


# ------------------------------------------------------------------ saving and taking up again


@pytest.mark.parametrize("drive", [TORQUE_DRIVE, SPEED_DRIVE])
def test_run_taken_up_from_json_goes_on_bit_by_bit(drive: int) -> None:
    plant = Plant(
        TABLE_3_1, InitialState(crank_speed=W), drive_mode=drive, inputs={"drive.speed": W, "drive.torque": 0.1}
    )
    go(plant, 13, 1.1e-3)
    plant.set_input("slider.force", 3.0)
    plant.set_input("drive.speed", W + 1.0)  # commanded, not yet in force
    other = Plant.restore(json.loads(json.dumps(plant.save())))
    assert other.outputs() == plant.outputs()
    for n in range(25):
        time = plant.time
        plant.step(time, 0.7e-3)
        other.step(time, 0.7e-3)
        if n == 10:
            for p in (plant, other):
                p.set_input("load.fy", -2.0)
        assert other.state == plant.state
        assert other.time == plant.time
    assert other.outputs() == plant.outputs()
    assert other.save() == plant.save()


@EVERY_KIND
def test_going_back_repeats_the_same_steps(kind: str) -> None:
    plant = RUNNING[kind]()
    saved = plant.save()
    go(plant, 20, 1e-3)
    again = type(plant).restore(saved)
    assert again.time == pytest.approx(0.01)
    go(again, 20, 1e-3)
    assert again.state == plant.state


@EVERY_KIND
def test_saved_state_is_a_copy(kind: str) -> None:
    plant = RUNNING[kind]()
    saved = plant.save()
    text = json.dumps(saved)
    plant.set_input("drive.torque", 1.0)
    go(plant, 3, 1e-3)
    assert json.dumps(saved) == text


@EVERY_KIND
@pytest.mark.parametrize("key", sorted(running().save()))
def test_saved_state_with_something_missing(key: str, kind: str) -> None:
    plant = RUNNING[kind]()
    saved = plant.save()
    del saved[key]
    with pytest.raises(StateError, match=f"not one of a {kind}"):
        type(plant).restore(saved)


@pytest.mark.parametrize(
    "change",
    [
        {"state": [0.0, 0.0]},
        {"inputs": {}},
        {"parameters": {"ground_length": 1.0}},
        {"scale": None},
        {"parameters": {**running().save()["parameters"], "crank_length": -1.0}},
    ],
)
def test_saved_state_that_is_damaged(change: dict[str, Any]) -> None:
    with pytest.raises(StateError, match="not one of a five-bar slider"):
        Plant.restore(running().save() | change)


def test_two_plants_do_not_share_anything() -> None:
    one, other = running(), running()
    one.set_input("slider.force", 100.0)
    one.step(one.time, 1e-3)
    assert other.inputs["slider.force"] == 0.0
    assert other.state == running().state
    assert np.all(np.array(one.state) != np.array(other.state), where=[True, True, False, True, True, True])
    assert issubclass(IntegrationError, LinkworkError)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("state", [0.0] * 5),
        ("state", ["a"] * 6),
        ("state", [nan] * 6),
        ("tolerance", nan),
        ("modes", {"drive.mode": 7}),
        ("time", "x"),
        ("time", inf),
        ("step_size", "x"),
        ("start_energy", None),
        ("scale", [0.0] * 6),
        ("scale", [1.0] * 5),
        ("inputs", dict.fromkeys(("drive.torque",), 0.0)),
        ("parameters", {}),
        ("commanded", "no"),
    ],
)
def test_a_damaged_saved_state_is_refused(key: str, value: Any) -> None:
    saved = Plant(TABLE_3_1, InitialState()).save()
    assert Plant.restore(dict(saved)).save() == saved
    with pytest.raises(StateError):
        Plant.restore({**saved, key: value})


def test_a_repeated_small_step_is_told_even_by_a_long_one() -> None:
    plant = Plant(TABLE_3_1, InitialState())
    plant.step(0.0, 1e-6)
    with pytest.raises(StepError, match="backwards"):
        plant.step(0.0, 0.1)


def test_steps_late_in_a_long_run_are_taken_for_what_they_are() -> None:
    plant = Plant(TABLE_3_1, InitialState(), time=1e6)
    for k in range(5):
        plant.step(1e6 + k * 1e-6, 1e-6)
    with pytest.raises(StepError, match="backwards"):
        plant.step(1e6 + 3e-6, 1e-6)


def test_a_speed_too_large_for_finite_outputs_is_told() -> None:
    plant = speed_plant()
    plant.set_input("drive.speed", 1e200)
    with pytest.raises(InputError, match=r"drive\.speed is 1e\+200"):
        plant.outputs()


def test_a_start_time_that_is_not_finite_is_refused() -> None:
    with pytest.raises(InputError, match="time at the start"):
        Plant(TABLE_3_1, InitialState(), time=nan)


@pytest.mark.parametrize("name", ["crank_length", "coupler_cog_distance", "crank_cog_distance"])
def test_lengths_whose_moments_of_inertia_overflow_are_refused_by_name(name: str) -> None:
    with pytest.raises(ParameterError, match=name.replace("_", r"\.", 1) + "|crank.inertia"):
        replace(TABLE_3_1, **{name: 1e200, "crank_mass": 1.0})
