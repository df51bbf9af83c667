"""Both force problems of the slider-crank over the turn.

The truth is the plant's scalar functions, the thesis's dual vectors (another formulation), balances of power, and the published
numbers.
"""

from dataclasses import replace
from math import degrees, pi, radians, tau
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given

from analysis.files import write_csv
from analysis.slider_crank import (
    FRAMES,
    JOINTS,
    AngleShift,
    ConstantShift,
    ForceTurn,
    GrooveShift,
    ShiftMotion,
    TimeShift,
    close,
    constant_shift,
    force_turn,
    joint_loads,
    ranges,
    sensitivities,
)
from linkwork.errors import AssemblyError, InputError, ParameterError
from linkwork.slider_crank import dynamics, kinematics
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters
from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, parameters
from tests.refusals import refused

from ..published_rahman import DEAD_CENTRES_DEG, GREATEST_SHIFTS_IN, INCH
from ..slider_cranks import Case, cases, components, seeded
from .conftest import csv

OFFSET = parameters(10.0)
SHIFT = ConstantShift(3.5 * INCH)


class Prescribed(NamedTuple):
    """A shift law that is given at each angle alone: any motion."""

    motion: ShiftMotion

    def at(self, angle: Any, speed: Any, acceleration: Any) -> ShiftMotion:
        return self.motion

    def periodic_shift(self, parameters: SliderCrankParameters) -> None:
        return None


def turn_of(case: Case, **given: Any) -> ForceTurn:
    th, s1, w, v, _, _ = case.state
    shift = Prescribed(ShiftMotion(s1, v, case.shift_acceleration))
    driven = {"crank_speed": w, "crank_acceleration": case.acceleration}
    return force_turn(case.parameters, **driven, shift=shift, angles=[th], **given)


def relative(found: Any, true: Any, scale: float = 0.0) -> float:
    """Greatest difference over the greatest of the true values."""
    a, b = np.ma.filled(found, np.nan).astype(float), np.asarray(true, dtype=float)
    return float(np.max(np.abs(a - b))) / max(float(np.max(np.abs(b))), scale, 1e-300)


def assert_forces(turn: ForceTurn, r: dynamics.Reactions, p: Constants, share: float) -> float:
    """The forces in the joints are the plant's, to ``share`` of the largest, which is returned."""
    level = max(abs(x) for name in JOINTS if "moment" not in name for x in getattr(r, name))
    for name, joint in JOINTS.items():
        size = level * (p.a1 if joint.unit == "N.m" else 1.0)
        assert relative(turn.vector(name)[0], getattr(r, name), size) < share
    return level


@given(cases())
def test_equal_to_the_plant_where_the_load_is_given(case: Case) -> None:
    p = case.p
    inputs = case.inputs("speed-shift")._replace(torque=0.0, force=0.0)
    x = case.state
    q = kinematics.position(x[0], x[1], p)
    m = dynamics.motion(q, kinematics.coefficients(q, p), x, inputs, p)
    r = dynamics.reactions(q, x, m, inputs, p)
    turn = turn_of(case, load=case.load)
    level = assert_forces(turn, r, p, 1e-12)
    assert relative(turn.slider_position, q.s4) < 1e-12
    assert relative(turn.slider_velocity, m.slider_velocity, abs(x[2]) * p.a1) < 1e-12
    assert relative(turn.slider_acceleration, m.slider_acceleration, x[2] ** 2 * p.a1) < 1e-12
    assert relative(turn.torque, m.torque, level * p.a1) < 1e-12
    assert relative(turn.axial_force, r.axial, level) < 1e-12
    assert relative(turn.applied_axial_force, m.force, level) < 1e-12


@given(cases())
def test_the_load_that_is_found_keeps_the_motion_under_the_torque(case: Case) -> None:
    """The other way round: under this load the plant's crank, driven by the torque, accelerates as prescribed."""
    turn = turn_of(case, torque=case.torque)
    p, x = case.p, case.state
    q = kinematics.position(x[0], x[1], p)
    k = kinematics.coefficients(q, p)
    if abs(k.kth) < 1e-3 * p.a1:
        return
    inputs = case.inputs("torque-shift")._replace(load=float(turn.slider_force[0]), force=0.0)
    m = dynamics.motion(q, k, x, inputs, p)
    assert (turn.sought, turn.torque[0]) == ("slider force", case.torque)
    scale = abs(case.acceleration) + (abs(case.torque) + abs(inputs.load * k.kth)) / dynamics.inertia(q, k, p).m11
    assert abs(m.crank_acceleration - case.acceleration) < 1e-9 * scale
    assert_forces(turn, dynamics.reactions(q, x, m, inputs, p), p, 1e-8)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("sought", ["torque", "slider force"])
def test_agrees_with_the_dual_vectors_of_the_thesis_in_every_frame(seed: int, sought: str) -> None:
    case = seeded(seed)
    # what the dual vectors call the slider's force is all along the guide: without friction and spring it is the load
    free = dict.fromkeys(("slider_stiffness", "slider_damping", "slider_coulomb_friction", "shift_stiffness"), 0.0)
    mechanism = replace(case.parameters, **free)
    at = np.linspace(case.state[0] - 0.05, case.state[0] + 0.05, 7)
    law = GrooveShift(0.02, 0.7)
    w, e = case.state[2], case.acceleration
    given: dict[str, Any] = {"torque": case.torque} if sought == "slider force" else {"load": case.load}
    s1 = case.state[1]

    def at_unit_speed(th: Any) -> ShiftMotion:
        return law.at(th, 1.0, 0.0)

    motion = (lambda th: s1 + at_unit_speed(th).shift, lambda th: at_unit_speed(th).velocity)
    shifted = AngleShift(*motion, lambda th: at_unit_speed(th).acceleration)
    turn = force_turn(mechanism, crank_speed=w, crank_acceleration=e, shift=shifted, angles=at, partial=True, **given)
    assert len(turn) > 3
    known = {"torque": case.torque} if sought == "slider force" else {"slider_force": case.load}
    shifting = {"shift_velocity": turn.shift_velocity, "shift_acceleration": turn.shift_acceleration}
    closed = close(mechanism, turn.angle, turn.shift)
    loads = joint_loads(closed, speed=w, acceleration=e, **shifting, **known)
    level = float(np.abs(loads.crank_pin).max())
    assert relative(turn.torque, loads.torque, level * mechanism.crank_length) < 1e-9
    assert relative(turn.slider_force, loads.slider_force, level) < 1e-9
    assert relative(turn.axial_force, loads.axial, level) < 1e-9
    for name, joint in JOINTS.items():
        for frame in FRAMES:
            scale = level * (mechanism.crank_length if joint.unit == "N.m" else 1.0)
            assert relative(turn.vector(name, frame), components(loads, name, frame), scale) < 1e-9, (name, frame)


def test_groove_in_the_shaft_is_the_plants() -> None:
    law = GrooveShift(0.05, 1.5, in_shaft=True)
    mechanism = replace(seeded(3).parameters, groove_amplitude=0.05, groove_ratio=1.5, rod_length=2.0)
    p = mechanism.constants()
    turn = force_turn(mechanism, crank_speed=4.0, crank_acceleration=7.0, shift=law, angles=[0.4, 1.9], load=5.0)
    for i, th in enumerate([0.4, 1.9]):
        inputs = dynamics.Inputs(1.0, 0.0, 1.0, 0.0, 7.0, 0.0, 0.0, 5.0)
        x = dynamics.impose_groove((th, 0.0, 4.0, 0.0, 0.0, 0.0), 1.0, p)
        q = kinematics.position(th, x[1], p)
        m = dynamics.motion(q, kinematics.coefficients(q, p), x, inputs, p)
        assert turn.torque[i] == pytest.approx(m.torque, rel=1e-12)
        assert turn.applied_axial_force[i] == pytest.approx(m.groove_force, rel=1e-12)
        assert turn.shift_acceleration[i] == pytest.approx(m.shift_acceleration, rel=1e-12)
        assert turn.shift[i] == pytest.approx(0.05 * np.sin(1.5 * th), rel=1e-14)
    driven = {"crank_speed": 4.0, "crank_acceleration": 7.0}
    back = force_turn(mechanism, **driven, shift=law, angles=[0.4, 1.9], torque=turn.torque.data)
    assert relative(back.slider_force, [5.0, 5.0]) < 1e-9


@pytest.mark.parametrize("branch", [1, -1])
def test_laws_are_one_another(branch: int) -> None:
    """The groove's law, the same as a function of the angle, and of time at constant speed; rates by differences."""
    mechanism = replace(OFFSET, assembly_branch=branch)
    amplitude, ratio, w = 0.06, 3.0, -7.0
    groove = GrooveShift(amplitude, ratio)
    angle = AngleShift(
        lambda th: amplitude * np.sin(ratio * th),
        lambda th: amplitude * ratio * np.cos(ratio * th),
        lambda th: -amplitude * ratio**2 * np.sin(ratio * th),
    )
    f = ratio * w
    time = TimeShift(
        lambda t: amplitude * np.sin(f * t),
        lambda t: amplitude * f * np.cos(f * t),
        lambda t: -amplitude * f * f * np.sin(f * t),
    )
    angles = np.linspace(0.0, tau, 97)
    driven = {"crank_speed": w, "torque": CRANK_TORQUE, "angles": angles}
    turns = [force_turn(mechanism, shift=law, **driven) for law in (groove, angle, time)]
    for turn in turns[1:]:
        for name in ("shift", "shift_velocity", "shift_acceleration", "slider_force"):
            assert relative(getattr(turn, name), getattr(turns[0], name)) < 1e-9
        # what is searched by signs is what is searched by bounds
        for kind in ("dead_centres", "singularities"):
            found, true = getattr(turn, kind), getattr(turns[0], kind)
            assert [c.outer for c in found] == [c.outer for c in true]
            assert [c.crank_angle for c in found] == pytest.approx([c.crank_angle for c in true], abs=1e-9)
            assert [c.slider_position for c in found] == pytest.approx([c.slider_position for c in true], abs=1e-12)
    assert turns[0].dead_centres != turns[0].singularities
    # theta1 = w t + e t^2 / 2 with the law differentiated by time
    e, h, th = 11.0, 1e-4, 0.8
    around = [groove.at(th + w * t + 0.5 * e * t * t, 0.0, 0.0).shift for t in (-h, 0.0, h)]
    at = groove.at(th, w, e)
    assert at.velocity == pytest.approx((around[2] - around[0]) / (2.0 * h), rel=1e-5)
    assert at.acceleration == pytest.approx((around[2] - 2.0 * around[1] + around[0]) / h**2, rel=1e-5)
    assert angle.at(np.array([th]), w, e).acceleration[0] == pytest.approx(at.acceleration, rel=1e-14)


def test_dead_centres_are_reported_over_the_angles_that_were_asked_for() -> None:
    first, second = (radians(x) for x in DEAD_CENTRES_DEG[10.0])
    mechanism = parameters(10.0)
    turn = force_turn(mechanism, crank_speed=1.0, angles=np.linspace(-pi, 3.0 * pi, 50))
    found = [c.crank_angle for c in turn.dead_centres]
    assert found == pytest.approx([second - tau, first, second, first + tau], abs=1e-4)
    assert force_turn(mechanism, crank_speed=1.0, angles=np.linspace(2.0, 4.0, 5)).dead_centres == ()
    # a law of half a period in a turn has other dead centres in its second turn
    half = GrooveShift(0.3, 0.5)
    two = force_turn(mechanism, crank_speed=1.0, shift=half, angles=np.linspace(0.0, 2.0 * tau, 9)).dead_centres
    one = force_turn(mechanism, crank_speed=1.0, shift=half).dead_centres
    assert len(two) == 4
    assert one == two[:2]
    assert two[2].shift == pytest.approx(half.at(two[2].crank_angle, 0.0, 0.0).shift)


def test_a_law_that_does_not_repeat_has_its_dead_centres_located() -> None:
    """A groove of an irrational number of periods: between its dead centres the slider moves one way only."""
    law = GrooveShift(0.2, np.sqrt(2.0))
    assert law.periodic_shift(OFFSET) is None
    turn = force_turn(OFFSET, crank_speed=1.0, shift=law, angles=np.linspace(0.0, 3.0 * tau, 2000))
    turning = turn.angle[:-1][np.diff(np.sign(turn.slider_velocity)) != 0]
    assert len(turn.dead_centres) == len(turning) == 6
    assert [c.crank_angle for c in turn.dead_centres] == pytest.approx(turning, abs=np.diff(turn.angle)[0])
    for centre in turn.dead_centres:
        there = force_turn(OFFSET, crank_speed=1.0, shift=law, angles=[centre.crank_angle])
        assert abs(there.slider_velocity[0]) < 1e-12
        assert (there.slider_acceleration[0] < 0.0) == centre.outer


def test_at_a_dead_centre_values_are_masked_with_the_reason() -> None:
    ideal = parameters(0.0)
    turn = force_turn(ideal, crank_speed=CRANK_SPEED, torque=CRANK_TORQUE)
    dead = np.zeros(361, dtype=bool)
    dead[[90, 270]] = True
    for values in (turn.slider_force, turn.axial_force, turn.applied_axial_force):
        assert (np.ma.getmaskarray(values) == dead).all()
    for name in JOINTS:
        for frame in FRAMES:
            mask = np.ma.getmaskarray(turn.vector(name, frame))
            assert (mask == (dead & (name != "guide_moment"))[:, None]).all()
    assert not np.ma.getmaskarray(turn.torque).any()
    places = [text.partition(":")[0] for text in turn.mask_reasons]
    assert places == [f"dead centre at crank angle {angle}.0000 deg" for angle in (90, 270)]
    assert "no lever" in turn.mask_reasons[0]
    assert [c.crank_angle for c in turn.dead_centres] == pytest.approx([0.5 * pi, 1.5 * pi], abs=1e-12)
    assert turn.vector("guide_moment")[90].tolist() == [0.0, 0.0, 0.0]
    # a guide along the crank axis: the lever is exactly zero, and what needs no force is still known
    still = force_turn(parameters(0.0, 0.0), crank_speed=CRANK_SPEED, torque=CRANK_TORQUE)
    assert still.without_lever
    assert abs(still.slider_acceleration).max() < 1e-12
    assert abs(still.vector("guide_moment").filled()).max() == 0.0
    exact = sensitivities(still, ("guide.offset",), ("slider.acceleration", "guide.mx"))
    assert all(np.isfinite(exact.derivative(name, "guide.offset")).all() for name in exact.values)
    # with the load given the same configuration is like any other
    free = force_turn(ideal, crank_speed=CRANK_SPEED)
    assert not any(np.ma.getmaskarray(free.vector(name)).any() for name in JOINTS)
    assert free.mask_reasons == ()


def test_speeds_and_accelerations_may_vary_over_the_turn() -> None:
    """An array is the numbers one by one."""
    angles = np.linspace(0.0, 6.0, 5)
    w, e, load = np.linspace(1.0, 3.0, 5), np.linspace(-4.0, 9.0, 5), np.linspace(2.0, -7.0, 5)
    turn = force_turn(OFFSET, crank_speed=w, crank_acceleration=e, shift=SHIFT, angles=angles, load=load)
    for i in range(5):
        one = force_turn(OFFSET, crank_speed=w[i], crank_acceleration=e[i], shift=SHIFT, load=load[i], angles=angles[i])
        assert turn.torque[i] == pytest.approx(one.torque[0], rel=1e-13)
        for name in JOINTS:
            assert turn.vector(name)[i].data == pytest.approx(one.vector(name)[0].data, rel=1e-13, abs=1e-13)


def test_where_the_crank_cannot_turn_fully() -> None:
    limit = GREATEST_SHIFTS_IN[10.0]
    mechanism = parameters(10.0)
    assert len(force_turn(mechanism, crank_speed=1.0, shift=ConstantShift((limit - 0.01) * INCH))) == 361
    beyond = ConstantShift((limit + 1.0) * INCH)
    with pytest.raises(AssemblyError, match="cannot turn over all 361 angles") as caught:
        force_turn(mechanism, crank_speed=1.0, shift=beyond)
    (low, high, *_), *others = ranges(mechanism, constant_shift(beyond.value))
    assert not others
    assert f"it can turn from {degrees(low):.6g} to {degrees(high):.6g} deg" in str(caught.value)
    assert "m too short at crank angle 0 rad" in str(caught.value)
    part = force_turn(mechanism, crank_speed=1.0, shift=beyond, partial=True)
    assert len(part) + len(part.unreachable) == 361
    assert low < part.angle.min() < low + radians(1.2)
    assert high - radians(1.2) < part.angle.max() < high
    assert ((part.unreachable < low + 1e-3) | (part.unreachable > high - 1e-3)).all()
    assert np.isfinite(part.torque.data).all()
    with pytest.raises(AssemblyError, match="at no angle"):
        force_turn(mechanism, crank_speed=1.0, shift=ConstantShift(2.0), partial=True)
    # a law that need not repeat has no ranges, but the angles are named
    same = AngleShift(lambda th: beyond.value + 0.0 * th, lambda th: 0.0 * th, lambda th: 0.0 * th)
    with pytest.raises(AssemblyError, match=r"at 0 to 3[0-9] deg; 3[0-9]+ to 360 deg") as caught:
        force_turn(mechanism, crank_speed=1.0, shift=same)
    assert "it can turn" not in str(caught.value)


def test_limits_of_assembly_are_where_the_cosine_says() -> None:
    """At 270 deg the rod reaches the guide where |a1 c + a4| is at most sqrt(a2^2 - S1^2); by bounds and by signs."""
    mechanism = replace(parameters(-20.0), rod_length=30.0 * INCH)
    s1 = 3.5 * INCH
    end = np.arccos((20.0 - np.sqrt(30.0**2 - 3.5**2)) / 12.0)
    same = AngleShift(lambda th: s1, lambda th: 0.0, lambda th: 0.0)
    angles = np.linspace(-pi, 3.0 * pi, 145)
    centres = []
    for law in (ConstantShift(s1), same):
        turn = force_turn(mechanism, crank_speed=1.0, shift=law, angles=angles, load=1.0, partial=True)
        assert turn.limits == pytest.approx([-end, end, tau - end, tau + end], abs=1e-9)
        assert turn.angle[list(turn.breaks)] == pytest.approx([angles[angles < end].max()])
        away = np.abs(turn.angle[:, None] - [-end, end, tau - end, tau + end]).min(axis=1)
        assert turn.clear(12.0).tolist() == (away > radians(12.0)).tolist()
        centres.append(sorted(centre.crank_angle for centre in turn.dead_centres))
    assert centres[0] == pytest.approx(centres[1], abs=1e-9)
    # both ends between two of the angles: no angle is left out, and there is a break all the same
    coarse = force_turn(mechanism, crank_speed=1.0, shift=SHIFT, angles=[0.0, 2.0, tau - 2.0, tau], load=1.0)
    assert (coarse.unreachable.size, coarse.breaks) == (0, (1,))
    whole = force_turn(OFFSET, crank_speed=1.0, shift=SHIFT, load=1.0)
    assert (whole.limits, whole.breaks) == ((), ())
    assert whole.clear().all()


def test_clear_of_the_dead_centres_where_the_force_is_sought() -> None:
    """Also of one that is beyond the last angle."""
    turn = force_turn(OFFSET, crank_speed=1.0, torque=1.0, angles=np.radians(np.arange(0.0, 95.0)))
    first = DEAD_CENTRES_DEG[10.0][0]
    away = np.abs(np.degrees(turn.angle) - first)
    assert turn.clear(10.0).tolist() == (away > 10.0 + 0.05).tolist()
    assert 0 < turn.clear(10.0).sum() < 95
    assert turn.clear(poles=False).all()
    assert force_turn(OFFSET, crank_speed=1.0, load=1.0).clear().all()


def test_runs_of_masked_angles_are_reported_once() -> None:
    """Guide and crank axis in one line: the slider stands still, and its force has no lever."""
    still = force_turn(parameters(0.0, 180.0), crank_speed=1.0, shift=SHIFT, torque=1.0)
    assert np.ma.getmaskarray(still.slider_force).sum() == 361
    assert still.without_lever
    (reason,) = still.mask_reasons
    assert reason == "the slider has no lever on the crank at any angle, so that the torque determines no force on it"
    ideal = force_turn(parameters(0.0), crank_speed=1.0, torque=1.0, angles=[1.0, 0.5 * pi, 0.5 * pi + 1e-12, 1.5 * pi])
    assert not ideal.without_lever
    (place,) = (text.partition(":")[0] for text in ideal.mask_reasons)
    assert place == "dead centre at all 3 crank angles from 90.0000 to 270.0000 deg"
    assert not force_turn(parameters(0.0), crank_speed=1.0, torque=1.0, angles=[0.5 * pi]).without_lever


def test_a_rod_parallel_to_the_crank_axis_has_no_frame_3() -> None:
    """Guide and crank axis parallel, the crank pin on the guide: the thesis's frame 3 has no direction there."""
    mechanism = replace(parameters(12.0, 0.0), assembly_branch=-1)
    turn = force_turn(mechanism, crank_speed=2.0, shift=ConstantShift(0.1), angles=[pi - 0.5, pi], load=3.0)
    assert not np.ma.getmaskarray(turn.vector("crank_pin", 2)).any()
    assert np.ma.getmaskarray(turn.vector("crank_pin", 3)).all(axis=1).tolist() == [False, True]
    (reason,) = turn.mask_reasons
    assert "parallel to the crank axis at crank angle 180.0000 deg" in reason
    columns = turn.columns()
    assert columns["rod parallel to crank axis (1): frame 3 not determined"].tolist() == [0.0, 1.0]


def test_csv(tmp_path: Path) -> None:
    turn = force_turn(parameters(0.0), crank_speed=CRANK_SPEED, torque=CRANK_TORQUE)
    si, inch = (csv(write_csv(tmp_path / f"{units}.csv", turn.columns(units))) for units in ("SI", "inch"))
    # angle, shift, slider, torque, forces; six vectors in four frames; two flags
    assert len(si) == len(inch) == 11 + 6 * 4 * 3 + 2
    assert inch["crank angle [deg]"] == pytest.approx(list(range(361)))
    pound = 4.4482216152605
    factors = {"rad": radians(1.0), "m": INCH, "m/s": INCH, "m/s2": INCH, "N": pound, "N.m": pound * INCH, "1)": 1.0}
    for (name, values), others in zip(si.items(), inch.values(), strict=True):
        unit = name.rpartition("[")[2].rstrip("]") if "[" in name else "1)"
        assert others * factors[unit] == pytest.approx(values, nan_ok=True), name
    assert si["crank torque [N.m]"] == pytest.approx([CRANK_TORQUE] * 361)
    assert si["slider position [m]"] == pytest.approx(turn.slider_position)
    flag = si["dead centre (1): forces not determined"]
    assert np.flatnonzero(flag).tolist() == [90, 270]
    for name, right in (
        ("slider force [N]", turn.slider_force),
        ("guide i in frame 4 [N]", turn.vector("guide", 4)[:, 0]),
        ("crank pin j in frame 2 [N]", turn.vector("crank_pin", 2)[:, 1]),
    ):
        assert (np.isnan(si[name]) == flag.astype(bool)).all()
        assert si[name] == pytest.approx(right.filled(np.nan), nan_ok=True)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"load": 0.0, "torque": 1.0}, "both load and torque"),
        ({"load": np.nan}, "load is nan"),
        ({"torque": [1.0, 2.0]}, "torque has the shape"),
        ({"crank_speed": np.inf}, "crank_speed is inf"),
        ({"crank_acceleration": np.zeros((2, 2))}, "crank_acceleration has the shape"),
        ({"angles": []}, "angles"),
        ({"angles": [0.0, np.nan]}, "angles"),
        ({"angles": np.zeros((2, 2))}, "angles"),
        ({"shift": AngleShift(lambda th: np.full(th.shape, np.nan), np.sin, np.cos)}, "the shift law's shift"),
        ({"crank_speed": "50 kg"}, "crank_speed is '50 kg'.*rad/s"),
        ({"crank_speed": None}, "the crank speed is missing"),
        ({"load": object()}, "load is <object"),
        ({"angles": "abc"}, "angles is 'abc'.*rad"),
        ({"angles": [[0.0], [1.0, 2.0]]}, "angles"),
        ({"shift": 3.5}, r"shift is 3.5.*ConstantShift"),
        ({"shift": constant_shift(0.1)}, "ConstantShift"),
        ({"shift": TimeShift(np.sin, np.cos, np.sin), "crank_speed": 0.0}, "other than 0 rad/s"),
        ({"shift": TimeShift(np.sin, np.cos, np.sin), "crank_acceleration": 1.0}, "constant"),
    ],
)
def test_wrong_input_is_reported(changes: dict[str, Any], message: str) -> None:
    with pytest.raises((InputError, ParameterError), match=message):
        force_turn(OFFSET, **{"crank_speed": 1.0} | changes)


def test_wrong_names_are_reported() -> None:
    turn = force_turn(OFFSET, crank_speed=1.0, angles=[0.0])
    refused(InputError, "no joint force or moment 'pin'", turn.vector, "pin")
    refused(InputError, "no frame 5", turn.vector, "bearing", 5)
    refused(InputError, "no units 'cgs'", turn.columns, "cgs")
    for law in (ConstantShift, GrooveShift):
        refused(InputError, "finite", law, np.inf)
