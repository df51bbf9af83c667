"""The slider-crank as a stateful object: its six ways to be driven, what it refuses, and how a run is saved and taken up again.

What every plant shares is tested in `test_plant`.
"""

from __future__ import annotations

import json
from dataclasses import replace
from math import cos, hypot, inf, isfinite, nan, pi, radians, sin, sqrt
from typing import Any

import pytest
from linkwork.five_bar.plant import Plant as FiveBarPlant
from linkwork.slider_crank.plant import INPUT_NAMES, Plant, error_scale
from scipy.integrate import solve_ivp

from linkwork.errors import AssemblyError, InputError, IntegrationError, LinkworkError, ParameterError, StateError
from linkwork.five_bar.parameters import InitialState as FiveBarInitialState
from linkwork.five_bar.published import TABLE_3_1
from linkwork.limits import LIMIT_SINE
from linkwork.slider_crank import dynamics
from linkwork.slider_crank.kinematics import coefficients, position
from linkwork.slider_crank.parameters import InitialState
from linkwork.slider_crank.published import CRANK_SPEED, OFFSET_CASE, parameters
from tests.published_rahman import CRANK_IN, GREATEST_SHIFTS_IN, INCH, ROD_IN, SPOTS, Spot
from tests.slider_cranks import DRIVES, Case, seeded

from .test_plant import assert_refused, go, snapshot

EVERY_DRIVE = pytest.mark.parametrize("drive", DRIVES)
#: A turn at 50 rpm (s).
TURN = 1.2


def modes(drive: str) -> dict[str, int]:
    """Options of the plant for one of `DRIVES`."""
    turning, shifting = drive.split("-")
    return {
        "drive_mode": ("torque", "speed").index(turning),
        "axial_mode": ("force", "shift", "groove").index(shifting),
    }


def plant_of(case: Case, drive: str, **options: Any) -> Plant:
    """A case's mechanism in its state, with all of its inputs set."""
    given = {
        "drive.torque": case.torque,
        "drive.speed": case.state[2],
        "drive.acceleration": case.acceleration,
        "axial.force": case.force,
        "axial.speed": case.state[3],
        "axial.acceleration": case.shift_acceleration,
        "slider.load": case.load,
    }
    return Plant(case.parameters, case.initial, **modes(drive), inputs=given, **options)


def read(case: Case, drive: str) -> dynamics.Inputs:
    """The case's inputs as a plant under the drive has to read them: those of the other drives are none."""
    speed_drive, shift_drive, groove = DRIVES[drive]
    return dynamics.Inputs(
        speed_drive,
        shift_drive,
        groove,
        0.0 if speed_drive else case.torque,
        case.acceleration if speed_drive else 0.0,
        0.0 if shift_drive or groove else case.force,
        case.shift_acceleration if shift_drive else 0.0,
        case.load,
    )


def default(drive: str = "speed-shift", **options: Any) -> Plant:
    """The case a4 = 10 in, S1 = 3.5 in at 50 rpm."""
    mechanism, initial = OFFSET_CASE
    inputs = {"drive.speed": CRANK_SPEED, **options.pop("inputs", {})}
    return Plant(
        options.pop("parameters", mechanism), options.pop("initial", initial), **modes(drive), inputs=inputs, **options
    )


# ------------------------------------------------------------------ what a step does


@pytest.mark.parametrize("spot", SPOTS, ids=["offset and shift", "offset and twist"])
def test_steps_go_where_the_known_numbers_say(spot: Spot) -> None:
    plant = default(
        parameters=parameters(spot.offset_in, spot.twist_deg),
        initial=InitialState(shift_position=spot.shift_in * INCH),
    )
    go(plant, 10, TURN / 120)
    o = plant.outputs()
    assert o.crank_angle == pytest.approx(radians(30.0), rel=1e-12)
    assert o.slider_position / INCH == pytest.approx(spot.position_in, abs=6e-7)
    assert o.slider_velocity / INCH == pytest.approx(spot.velocity_in_s, abs=6e-7)
    assert o.slider_acceleration / INCH == pytest.approx(spot.acceleration_in_s2, abs=6e-6)


@pytest.mark.parametrize("seed", range(5))
@EVERY_DRIVE
def test_step_against_another_integrator(seed: int, drive: str) -> None:
    case = seeded(seed)
    duration = 2e-3
    i, p = read(case, drive), case.p
    expected = solve_ivp(
        lambda t, y: dynamics.derivative(tuple(y.tolist()), i, p),
        (0.0, duration),
        case.under(drive),
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    ).y[:, -1]
    plant = plant_of(case, drive, tolerance=1e-12)
    plant.step(0.0, duration)
    assert plant.state == pytest.approx(expected, rel=1e-9, abs=1e-9)


@EVERY_DRIVE
def test_halving_the_communication_step_changes_nothing_beyond_the_tolerance(drive: str) -> None:
    case = seeded(3)
    ends = []
    for steps in (1, 2, 8, 50):
        plant = plant_of(case, drive)
        # the ramp of a commanded speed starts anew at every step: none here
        plant.set_input("drive.acceleration", 0.0)
        plant.set_input("axial.acceleration", 0.0)
        go(plant, steps, 0.02 / steps)
        ends.append(plant.outputs()[:15])
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("again", [True, False])
def test_ramps_of_both_speeds_start_anew_at_every_step(again: bool) -> None:
    plant = default(inputs={"drive.acceleration": 20.0, "axial.speed": 0.3, "axial.acceleration": -4.0})
    step = 1e-2
    o = plant.outputs()
    assert (o.crank_acceleration, o.shift_acceleration) == (20.0, -4.0)
    for n in range(3):
        if again:
            plant.set_input("drive.speed", CRANK_SPEED)
            plant.set_input("axial.speed", 0.3)
        before = plant.state
        plant.step(n * step, step)
        assert plant.state[2:4] == pytest.approx((CRANK_SPEED + 20.0 * step, 0.3 - 4.0 * step), rel=1e-13)
        assert plant.state[0] - before[0] == pytest.approx(CRANK_SPEED * step + 10.0 * step**2, rel=1e-11)
        assert plant.state[1] - before[1] == pytest.approx(0.3 * step - 2.0 * step**2, rel=1e-11)


@pytest.mark.parametrize("command", [("drive.speed",), ("axial.speed",), ("drive.speed", "axial.speed")], ids="+".join)
@pytest.mark.parametrize("seed", range(4))
@EVERY_DRIVE
def test_jump_of_a_commanded_speed_conserves_what_has_no_impulse(
    seed: int, drive: str, command: tuple[str, ...]
) -> None:
    case = seeded(seed)
    speed_drive, shift_drive, groove = DRIVES[drive]
    plant = plant_of(case, drive)
    before = plant.outputs()
    p = case.p
    q = position(before.crank_angle, before.shift_position, p)
    m = dynamics.inertia(q, coefficients(q, p), p)
    w, v = before.crank_speed, before.shift_velocity
    commanded = {"drive.speed": w + 5.0, "axial.speed": v - 0.7}
    for name in command:
        plant.set_input(name, commanded[name])
    after = plant.outputs()
    new = (after.crank_speed, after.shift_velocity)
    if not (speed_drive and "drive.speed" in command) and not (shift_drive and "axial.speed" in command):
        assert after == before
        return
    if speed_drive:
        assert new[0] == (commanded["drive.speed"] if "drive.speed" in command else w)
    else:
        assert m.m11 * new[0] + m.m12 * new[1] == pytest.approx(m.m11 * w + m.m12 * v, rel=1e-11, abs=1e-11)
    if shift_drive:
        assert new[1] == (commanded["axial.speed"] if "axial.speed" in command else v)
    elif groove:
        law = case.parameters
        slope = law.groove_amplitude * law.groove_ratio * cos(law.groove_ratio * after.crank_angle)
        assert new[1] == pytest.approx(slope * new[0], rel=1e-13)
    else:
        assert m.m12 * new[0] + m.m22 * new[1] == pytest.approx(m.m12 * w + m.m22 * v, rel=1e-11, abs=1e-11)
    assert new[0] != w or new[1] != v
    assert (after.crank_angle, after.shift_position) == (before.crank_angle, before.shift_position)
    # the impulse's work is supplied, so that the balance holds across it
    gain = 0.5 * (m.m11 * new[0] ** 2 + 2.0 * m.m12 * new[0] * new[1] + m.m22 * new[1] ** 2) - before.energy_kinetic
    assert after.energy_kinetic - before.energy_kinetic == pytest.approx(gain, rel=1e-9)
    assert after.energy_supplied - before.energy_supplied == pytest.approx(gain, rel=1e-9)
    assert after.energy_residual == pytest.approx(before.energy_residual, abs=1e-9 * max(1.0, after.energy_kinetic))
    # shown before the step as it is at its start
    plant.step(0.0, 1e-9)
    assert plant.state[2:4] == pytest.approx(new, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("name", Plant.COMMANDS)
def test_speed_that_is_not_commanded_anew_goes_on_as_its_ramp_left_it(name: str) -> None:
    plant = default(inputs={"drive.acceleration": 20.0, "axial.speed": 0.3, "axial.acceleration": -4.0})
    plant.step(0.0, 1e-2)
    ramped = {"drive.speed": CRANK_SPEED + 20.0 * 1e-2, "axial.speed": 0.3 - 4.0 * 1e-2}
    plant.set_input(name, 0.7)
    o = plant.outputs()
    assert (o.crank_speed, o.shift_velocity) == pytest.approx(tuple((ramped | {name: 0.7}).values()), rel=1e-13)


@EVERY_DRIVE
def test_setting_the_same_speeds_again_does_nothing(drive: str) -> None:
    plain, told = default(drive), default(drive)
    for n in range(5):
        told.set_input("drive.speed", CRANK_SPEED)
        told.set_input("axial.speed", 0.0)
        for plant in (plain, told):
            plant.step(n * 1e-2, 1e-2)
    assert told.state == plain.state


#: Inputs that are of no use under part of a drive's name.
NO_USE = {
    "torque": ("drive.speed", "drive.acceleration"),
    "speed": ("drive.torque",),
    "force": ("axial.speed", "axial.acceleration"),
    "shift": ("axial.force",),
    "groove": ("axial.force", "axial.speed", "axial.acceleration"),
}


@EVERY_DRIVE
def test_inputs_of_another_drive_are_of_no_use(drive: str) -> None:
    case = seeded(1)
    one, other = plant_of(case, drive), plant_of(case, drive)
    for part in drive.split("-"):
        for name in NO_USE[part]:
            other.set_input(name, other.inputs[name] + 3.0)
    assert other.outputs() == one.outputs()
    for plant in (one, other):
        plant.step(0.0, 1e-2)
    assert other.outputs() == one.outputs()
    # and every other input is of some
    for name in set(INPUT_NAMES) - {name for part in drive.split("-") for name in NO_USE[part]}:
        changed = plant_of(case, drive)
        changed.set_input(name, changed.inputs[name] + 3.0)
        assert changed.outputs() != plant_of(case, drive).outputs(), name


@pytest.mark.parametrize("drive", ["torque-groove", "speed-groove"])
def test_groove_makes_the_shift_at_all_times(drive: str) -> None:
    case = seeded(2)
    law, p = case.parameters, case.p
    plant = plant_of(case, drive, tolerance=1e-6)
    for n in range(40):
        plant.set_input("drive.speed", case.state[2] * (1.0 + 0.3 * sin(0.5 * n)))
        plant.set_input("drive.torque", case.torque * cos(n))
        o = plant.outputs()
        # eq 28, exactly, however loose the tolerance
        assert o.shift_position == law.groove_amplitude * sin(law.groove_ratio * o.crank_angle)
        slope = law.groove_amplitude * law.groove_ratio * cos(law.groove_ratio * o.crank_angle)
        assert o.shift_velocity == pytest.approx(slope * o.crank_speed, rel=1e-13, abs=1e-15)
        plant.step(plant.time, 2e-3)
        # what is supplied is the work of shaft and load: the groove's force has no power of its own
        o = plant.outputs()
        inputs = read(case, drive)._replace(torque=0.0 if drive.startswith("speed") else plant.inputs["drive.torque"])
        power = dynamics.derivative(plant.state, inputs, p)[5]  # type: ignore[arg-type]
        given = o.drive_applied_torque * o.crank_speed + case.load * o.slider_velocity
        assert power == pytest.approx(given, rel=1e-9, abs=1e-9)
        assert o.axial_applied_force != 0.0
    assert abs(plant.outputs().energy_residual) < 1e-3 * plant.outputs().energy_kinetic


@EVERY_DRIVE
def test_energy_balance_over_a_run_with_everything_switched_on(drive: str) -> None:
    case = seeded(4)
    plant = plant_of(case, drive, tolerance=1e-11)
    largest = 0.0
    for n in range(100):
        plant.set_input("drive.torque", case.torque * (-1) ** n)
        plant.set_input("drive.speed", case.state[2] * (1.0 + 0.1 * sin(0.3 * n)))
        plant.set_input("axial.force", case.force * (n % 3))
        plant.set_input("axial.speed", 0.2 * cos(0.5 * n))
        plant.set_input("slider.load", 1.0 - 0.1 * n)
        plant.step(n * 1e-3, 1e-3)
        largest = max(largest, plant.outputs().energy_kinetic)
    o = plant.outputs()
    assert o.energy_dissipated > 1e-3
    assert abs(o.energy_supplied) > 1e-3
    assert abs(o.energy_residual) < 1e-8 * max(1.0, largest)


# ------------------------------------------------------------------ what a step refuses


@pytest.mark.parametrize("value", [nan, inf, -inf])
@pytest.mark.parametrize("name", INPUT_NAMES)
def test_input_that_is_not_finite(name: str, value: float) -> None:
    plant = default()
    kept = plant.inputs[name]
    plant.set_input(name, value)
    with pytest.raises(InputError, match=rf"input {name} is {value} at t = 0 s: it must be a finite number"):
        plant.outputs()
    assert_refused(plant, InputError, rf"input {name} is {value} at t = 0 s", plant.time, 1e-3)
    plant.set_input(name, kept)
    plant.step(0.0, 1e-3)
    assert isfinite(plant.outputs().slider_position)


def test_unknown_input() -> None:
    with pytest.raises(InputError, match=r"no input 'slider\.force': the inputs are drive\.torque, .*, slider\.load"):
        default().set_input("slider.force", 1.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("drive", ["speed-shift", "torque-shift"])
def test_shift_out_of_the_rods_reach_is_refused_and_the_last_good_state_kept(drive: str, sign: float) -> None:
    plant = default(drive, inputs={"axial.speed": 2.0 * sign})
    error: LinkworkError | None = None
    while error is None and plant.time < 1.0:
        before = snapshot(plant)
        time = plant.time
        try:
            plant.step(time, 1e-2)
        except LinkworkError as caught:
            error = caught
    assert isinstance(error, AssemblyError)
    assert str(error).startswith(f"in the step from t = {time:.9g} s: limit of assembly")
    assert "crank angle" in str(error)
    assert "shift" in str(error)
    assert snapshot(plant) == before
    o = plant.outputs()
    assert all(map(isfinite, o))
    assert 0.0 < o.assembly_margin < 0.02
    if drive == "speed-shift":
        # the last step that is still inside: |(a1 c + a4, S1)| reaches a2 within the next
        def reach(t: float) -> float:
            return hypot(CRANK_IN * cos(CRANK_SPEED * t) + 10.0, 3.5 + sign * 2.0 * t / INCH)

        assert reach(time) < ROD_IN < reach(time + 1e-2)
    assert_refused(plant, AssemblyError, "limit of assembly", plant.time, 1e-2)
    # a shorter step that stays inside is taken, and so is one back
    plant.step(plant.time, 1e-5)
    plant.set_input("axial.speed", -2.0 * sign)
    plant.set_input("drive.speed", -CRANK_SPEED)
    if drive == "speed-shift":
        go(plant, 10, 1e-2)
        assert plant.outputs().assembly_margin > o.assembly_margin


@pytest.mark.parametrize("drive", ["torque-force", "speed-force", "torque-groove", "speed-groove"])
def test_other_ways_out_of_the_rods_reach(drive: str) -> None:
    # a groove too deep for the rod, or a force that pushes the crank off
    plant = default(
        drive,
        parameters=replace(OFFSET_CASE[0], groove_amplitude=3.0),
        initial=InitialState(crank_speed=CRANK_SPEED),
        inputs={"axial.force": 1e4},
    )
    assert_refused(
        plant, AssemblyError, r"in the step from t = 0 s: limit of assembly .*crank angle .* shift", plant.time, 1.0
    )
    plant.step(0.0, 1e-3)


def test_step_that_cannot_meet_its_tolerance() -> None:
    plant = default("torque-force", inputs={"slider.load": 1e200})
    match = r"in the step from t = 0 s: .*, at crank angle 0 rad .* and axial shift 0\.0889 m"
    assert_refused(plant, IntegrationError, match, plant.time, 1.0)


def test_refused_step_leaves_newly_commanded_speeds_waiting() -> None:
    plants = [default(inputs={"axial.speed": 0.5}) for _ in range(2)]
    for plant in plants:
        go(plant, 5, 1e-2)
        plant.set_input("drive.speed", 0.9 * CRANK_SPEED)
        plant.set_input("axial.speed", 1.0)
    assert_refused(plants[0], AssemblyError, "limit of assembly", plants[0].time, 10.0)
    for plant in plants:
        plant.step(plant.time, 1e-3)
        assert plant.state[2:4] == pytest.approx((0.9 * CRANK_SPEED, 1.0), rel=1e-14)
    assert plants[0].state == plants[1].state


def test_a_speed_too_large_for_finite_outputs_is_told() -> None:
    for name in ("drive.speed", "axial.speed"):
        plant = default()
        plant.set_input(name, 1e200)
        with pytest.raises(InputError, match=rf"an output is not finite .*{name} is 1e\+200"):
            plant.outputs()


def test_errors_count_as_absolute_below_the_scale_of_the_mechanism() -> None:
    par = OFFSET_CASE[0]
    energy = 0.5 * (par.crank_inertia + (par.crank_mass + par.rod_mass + par.slider_mass) * par.crank_length**2) * 64.0
    expected = (1.0, par.crank_length, 8.0, 8.0 * par.crank_length, energy, energy)
    assert error_scale(par, -8.0) == pytest.approx(expected, rel=1e-14)
    assert error_scale(par, 0.1) == error_scale(par, 1.0)  # one rad/s at least


# ------------------------------------------------------------------ how a run begins


def test_start_out_of_the_rods_reach_says_by_how_much() -> None:
    with pytest.raises(AssemblyError) as caught:
        default(initial=InitialState(crank_angle=pi / 3, shift_position=1.5))
    # at 270 deg the crank pin is (a1 c + a4, S1) from the guide
    distance = hypot((6.0 + 10.0) * INCH, 1.5)
    text = str(caught.value)
    assert text.startswith(
        "the rod does not reach the guide at crank angle 1.04719755 rad (60.0000 deg) and shift 1.5 m: "
    )
    assert f"the crank pin is {distance:.9g} m from the guide" in text
    assert f"the rod is 1.27 m long, {distance - 1.27:.9g} m too short" in text


def test_start_in_a_groove_too_deep_says_by_how_much() -> None:
    deep = replace(OFFSET_CASE[0], groove_amplitude=1.4, groove_ratio=3.0)
    with pytest.raises(
        AssemblyError, match=r"crank angle 0\.523598776 rad \(30\.0000 deg\) and shift 1\.4 m: .* too short"
    ):
        default("speed-groove", parameters=deep, initial=InitialState(crank_angle=pi / 6))
    # the shift that is given is not the one that counts
    default("speed-groove", initial=InitialState(shift_position=5.0))


@pytest.mark.parametrize("offset", GREATEST_SHIFTS_IN)
def test_start_at_the_limit_of_assembly(offset: float) -> None:
    mechanism = parameters(offset)

    def start(shift: float) -> Plant:
        return default(parameters=mechanism, initial=InitialState(shift_position=shift))

    stretched = sqrt(ROD_IN**2 - (CRANK_IN + offset) ** 2)
    assert stretched == pytest.approx(GREATEST_SHIFTS_IN[offset], abs=6e-4)
    with pytest.raises(
        AssemblyError, match=r"limit of assembly at crank angle 0 rad .* within 0\.0\d\d deg of perpendicular"
    ):
        start((stretched - 1e-6) * INCH)
    # the sine at which it counts as the limit is h / a2, with h^2 = stretched^2 - S1^2
    inside = (LIMIT_SINE * ROD_IN) ** 2 / (2.0 * stretched)
    start((stretched - 1.05 * inside) * INCH)
    with pytest.raises(AssemblyError, match="limit of assembly"):
        start((stretched - 0.95 * inside) * INCH)
    with pytest.raises(AssemblyError, match="does not reach"):
        start((stretched + 1e-6) * INCH)


@pytest.mark.parametrize("mode", [2, -1, 0.5, "speed", None])
def test_drive_mode_is_one_of_two(mode: Any) -> None:
    with pytest.raises(ParameterError, match=r"drive\.mode is .* be 0 \(torque\) or 1 \(speed\)"):
        Plant(*OFFSET_CASE, drive_mode=mode)


@pytest.mark.parametrize("mode", [3, -1, 1.5, "groove", None])
def test_axial_mode_is_one_of_three(mode: Any) -> None:
    with pytest.raises(ParameterError, match=r"axial\.mode is .* be 0 \(force\), 1 \(speed\) or 2 \(groove\)"):
        Plant(*OFFSET_CASE, axial_mode=mode)


def test_start_with_inputs_that_are_not_usable() -> None:
    with pytest.raises(InputError, match=r"input axial\.speed is nan at t = 0 s"):
        default(inputs={"axial.speed": nan})
    with pytest.raises(InputError, match="there is no input 'load'"):
        default(inputs={"load": 1.0})


@pytest.mark.parametrize(
    ("drive", "options", "names"),
    [
        ("torque-force", {"initial": InitialState(crank_speed=1e180)}, r"initial\.crank_speed is 1e\+180 rad/s"),
        ("torque-force", {"initial": InitialState(shift_velocity=1e180)}, r"initial\.shift_velocity\) 1e\+180 m/s"),
        ("speed-shift", {"inputs": {"drive.speed": 1e300}}, r"drive\.speed is 1e\+300 rad/s"),
        ("speed-shift", {"inputs": {"axial.speed": 1e300}}, r"axial\.speed\) 1e\+300 m/s"),
        ("speed-groove", {"inputs": {"drive.speed": 1e300}}, r"drive\.speed is 1e\+300 rad/s, .*groove\.amplitude"),
    ],
)
def test_start_with_a_kinetic_energy_that_overflows(drive: str, options: dict[str, Any], names: str) -> None:
    with pytest.raises(InputError, match=rf"energy at the start is not finite: .*{names}"):
        default(drive, **options)


@EVERY_DRIVE
def test_commanded_speeds_and_groove_take_the_place_of_the_initial_state(drive: str) -> None:
    speed_drive, shift_drive, groove = DRIVES[drive]
    given = InitialState(crank_angle=0.4, crank_speed=1.0, shift_position=0.05, shift_velocity=0.25)
    law = replace(OFFSET_CASE[0], groove_amplitude=0.07, groove_ratio=1.5)
    plant = default(drive, parameters=law, initial=given, time=2.0, inputs={"axial.speed": -0.1})
    o = plant.outputs()
    speed = CRANK_SPEED if speed_drive else 1.0
    assert o.crank_angle == 0.4
    assert o.crank_speed == speed
    if groove:
        assert o.shift_position == 0.07 * sin(1.5 * 0.4)
        assert o.shift_velocity == pytest.approx(0.07 * 1.5 * cos(0.6) * speed, rel=1e-14)
    else:
        assert o.shift_position == 0.05
        assert o.shift_velocity == (-0.1 if shift_drive else 0.25)
    assert o.energy_residual == o.energy_supplied == o.energy_dissipated == 0.0
    assert plant.time == 2.0
    plant.step(2.0, 1e-3)
    assert plant.time == pytest.approx(2.001)


# ------------------------------------------------------------------ saving and taking up again


@EVERY_DRIVE
def test_run_taken_up_from_json_goes_on_bit_by_bit(drive: str) -> None:
    plant = plant_of(seeded(5), drive)
    go(plant, 13, 1.1e-3)
    plant.set_input("slider.load", 3.0)
    for name in Plant.COMMANDS:
        plant.set_input(name, plant.inputs[name] + 0.1)  # commanded, not yet in force
    other = Plant.restore(json.loads(json.dumps(plant.save())))
    assert other.outputs() == plant.outputs()
    for n in range(25):
        time = plant.time
        for p in (plant, other):
            if n == 10:
                p.set_input("axial.force", -2.0)
                p.set_input("axial.speed", 0.0)
            p.step(time, 0.7e-3)
        assert other.state == plant.state
        assert other.time == plant.time
    assert other.outputs() == plant.outputs()
    assert other.save() == plant.save()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("state", [0.0] * 5),
        ("state", [nan] * 6),
        ("modes", {"drive.mode": 1}),
        ("modes", {"drive.mode": 1, "axial.mode": 3}),
        ("modes", {"drive.mode": 2, "axial.mode": 1}),
        ("commanded", ["drive.torque"]),
        ("commanded", ["slider.speed"]),
        ("inputs", dict.fromkeys(INPUT_NAMES[:-1], 0.0)),
        ("inputs", dict.fromkeys(INPUT_NAMES, "x")),
        ("parameters", {"rod_length": 1.0}),
        ("start_energy", inf),
        ("scale", [1.0] * 5),
    ],
)
def test_a_damaged_saved_state_is_refused(key: str, value: Any) -> None:
    saved = default().save()
    assert Plant.restore(dict(saved)).save() == saved
    with pytest.raises(StateError, match="the saved state is not one of a slider-crank"):
        Plant.restore({**saved, key: value})


def test_a_saved_state_of_another_mechanism_is_refused() -> None:
    five_bar = FiveBarPlant(TABLE_3_1, FiveBarInitialState()).save()
    with pytest.raises(StateError, match="the saved state is not one of a slider-crank"):
        Plant.restore(five_bar)
    with pytest.raises(StateError, match="the saved state is not one of a five-bar slider"):
        FiveBarPlant.restore(default().save())
