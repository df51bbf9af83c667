"""Dynamics of the slider-crank, what is special of it: Newton and Euler on each body in space, the groove and prescribed
motions, mirror images in space, and the thesis's relations and numbers. What it shares is in `test_dynamics`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, hypot, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given, settings

from linkwork.slider_crank import dynamics as D
from linkwork.slider_crank import kinematics as K
from linkwork.slider_crank import published
from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.vectors import scale
from tests.oracles.bodies import (
    crank_particles,
    guide_frame,
    pins,
    shift_push,
    slider_crank,
    slider_motion,
    solve_bodies,
)
from tests.plant.test_dynamics import SLIDER_CRANK
from tests.published_rahman import INCH, POUND_FORCE, POUND_INCH, SPOTS, TORQUE_LB_IN, Spot
from tests.slider_cranks import DRIVES, Case, cases, seeded

every_drive = pytest.mark.parametrize("drive", DRIVES)
REST, evaluate = SLIDER_CRANK.rest, SLIDER_CRANK.evaluate


def test_particles_have_the_inertia_of_the_parameters() -> None:
    # of the test's own particles: what they stand for
    for seed in range(10):
        case = seeded(seed)
        par = case.parameters
        masses, places = crank_particles(par)
        assert masses.sum() == pytest.approx(par.crank_mass)
        assert masses @ (places[:, 0] ** 2 + places[:, 1] ** 2) == pytest.approx(par.crank_inertia)
        assert masses @ (places[:, 0] * places[:, 2]) == pytest.approx(par.crank_product_xz)
        assert masses @ (places[:, 1] * places[:, 2]) == pytest.approx(par.crank_product_yz)
        assert masses @ places / masses.sum() == pytest.approx([par.crank_cog_x, par.crank_cog_y, par.crank_cog_z])
        _, rod, _ = slider_crank(case.state, par)
        at = pins(case.state, par)
        u = (at.p3 - at.p2) / par.rod_length
        across = np.eye(3) - np.outer(u, u)
        tensor = rod.inertia()
        assert across @ tensor @ across == pytest.approx(par.rod_inertia * across, abs=1e-12)
        assert u @ tensor @ u == pytest.approx(par.rod_inertia)  # an inertia about the line, of no effect


def assert_agrees_with_bodies(case: Case, drive: str) -> None:
    p, i, x = case.p, case.inputs(drive), case.under(drive)
    e = evaluate(x, i, p)
    s = solve_bodies(case, drive)
    motion, f = e.motion, e.forces
    tolerance = 1e-9
    accelerations = [
        *s["crank_acceleration"] * p.a1,
        *s["shift_acceleration"],
        *s["slider_acceleration"],
    ]
    found = [motion.crank_acceleration * p.a1, motion.shift_acceleration, motion.slider_acceleration]
    size = max(map(abs, accelerations)) + (abs(x[2]) * p.a1 + abs(x[3])) ** 2 / p.a1
    assert found == pytest.approx(accelerations, rel=0.0, abs=tolerance * size)
    guide = s["guide"] @ guide_frame(case.parameters)[:2]
    pairs = [
        (f.crank_pin, s["crank_pin"]),
        (f.slider_pin, s["slider_pin"]),
        ((*f.bearing[:2], f.axial), s["bearing"]),
        (f.guide, guide),
        ((motion.force, motion.groove_force), (*s["force"] + s["groove_force"], *s["groove_force"])),
    ]
    size = max(np.abs(known).max() for _, known in pairs)
    for value, known in pairs:
        assert tuple(value) == pytest.approx(tuple(known), rel=0.0, abs=tolerance * size)
    assert f.bearing.z == 0.0
    size *= p.a1 + abs(x[1]) + abs(p.a4)
    assert f.bearing_moment == pytest.approx(tuple(s["bearing_moment"]), rel=0.0, abs=tolerance * size)
    assert f.guide_moment == pytest.approx(tuple(s["guide_moment"]), rel=0.0, abs=tolerance * size)
    assert motion.torque == pytest.approx(float(s["torque"][0]), rel=0.0, abs=tolerance * size)


@every_drive
@settings(max_examples=60, derandomize=True, deadline=None)
@given(case=cases())
def test_newton_and_euler_body_by_body_agree(drive: str, case: Case) -> None:
    assert_agrees_with_bodies(case, drive)


@every_drive
def test_newton_and_euler_agree_on_seeded_mechanisms(drive: str) -> None:
    # hypothesis likes round numbers; these are general ones
    for seed in range(60):
        assert_agrees_with_bodies(seeded(seed), drive)


def test_axial_force_is_that_of_drive_groove_spring_and_damper() -> None:
    for drive in DRIVES:
        for seed in range(10):
            case = seeded(seed)
            x, i = case.under(drive), case.inputs(drive)
            e = evaluate(x, i, case.p)
            assert e.forces.axial == pytest.approx(
                e.motion.force + shift_push(x[1], x[3], case.parameters), rel=1e-9, abs=1e-9
            )
            pitch = K.groove(x[0], case.p).pitch
            assert e.forces.bearing_moment.z == pytest.approx(
                e.motion.torque - pitch * e.motion.groove_force, rel=1e-9, abs=1e-9
            )


def test_prescribed_motions_are_the_motions_under_the_forces_they_take() -> None:
    # what a drive by speed, shift or groove supplies, given as torque and force, makes the same motion
    for drive in DRIVES:
        for seed in range(20):
            case = seeded(seed)
            p, x, i = case.p, case.under(drive), case.inputs(drive)
            motion = evaluate(x, i, p).motion
            pitch = K.groove(x[0], p).pitch
            torque = motion.torque - pitch * motion.groove_force
            free = REST._replace(torque=torque, force=motion.force, load=i.load)
            again = evaluate(x, free, p).motion
            size = max(abs(motion.crank_acceleration) * p.a1, abs(motion.shift_acceleration), p.a1 * x[2] ** 2)
            assert (again.crank_acceleration * p.a1, again.shift_acceleration) == pytest.approx(
                (motion.crank_acceleration * p.a1, motion.shift_acceleration), abs=1e-9 * size
            )
            if i.speed_drive:
                assert motion.crank_acceleration == pytest.approx(i.acceleration, rel=1e-12)
            if i.shift_drive:
                assert motion.shift_acceleration == pytest.approx(i.shift_acceleration, rel=1e-12)


def test_groove_makes_shift_velocity_and_acceleration() -> None:
    for seed in range(20):
        case = seeded(seed)
        p, par, (th, _, w, v, *_) = case.p, case.parameters, case.state
        for drive, (_, _, groove) in DRIVES.items():
            x = D.grooved((th, 0.123, w, v, 3.0, 5.0), groove, p)
            if not groove:
                assert x == (th, 0.123, w, v, 3.0, 5.0)
                continue
            phase = par.groove_ratio * th
            assert x == pytest.approx(
                (
                    th,
                    par.groove_amplitude * sin(phase),
                    w,
                    par.groove_amplitude * par.groove_ratio * cos(phase) * w,
                    3.0,
                    5.0,
                ),
                rel=1e-13,
            )
            e = evaluate(x, case.inputs(drive), p).motion.crank_acceleration

            def shift_velocity(
                t: float, e: float = e, th: float = th, w: float = w, par: SliderCrankParameters = par
            ) -> float:
                angle, speed = th + w * t + 0.5 * e * t * t, w + e * t
                return par.groove_amplitude * par.groove_ratio * cos(par.groove_ratio * angle) * speed

            h = 1e-4 / max(abs(w), abs(e) ** 0.5)
            change = (
                (8 * (shift_velocity(h) - shift_velocity(-h)) - shift_velocity(2 * h) + shift_velocity(-2 * h)) / 12 / h
            )
            found = evaluate(x, case.inputs(drive), p).motion.shift_acceleration
            assert found == pytest.approx(change, rel=1e-8, abs=1e-8 * abs(w) ** 2 * p.a1)
            # whatever shift the state carries, derivative and outputs see the groove's
            assert D.derivative((th, 9.0, w, 9.0, 0.0, 0.0), case.inputs(drive), p) == D.derivative(
                (*x[:4], 0.0, 0.0), case.inputs(drive), p
            )
            assert D.outputs((th, 9.0, w, 9.0, 0.0, 0.0), case.inputs(drive), 0.0, p) == D.outputs(
                (*x[:4], 0.0, 0.0), case.inputs(drive), 0.0, p
            )


# ------------------------------------------------------------------ mirror images


#: Components of forces that change their sign in a mirror normal to y or z, and of moments and turning, that do not.
MIRRORS = {"y": ("y", "xz"), "z": ("z", "xy")}


def mirrored(case: Case, mirror: str) -> Case:
    """The case seen in the mirror y = 0 (the crank turns the other way) or z = 0 (the shift is the other way)."""
    par, (th, s1, w, v, _, _) = case.parameters, case.state

    def negated(*names: str) -> dict[str, float]:
        return {name: -getattr(par, name) for name in names}

    if mirror == "y":
        fields = negated(
            "crank_cog_y", "crank_product_yz", "slider_cog_y", "gravity_y", "groove_amplitude", "guide_twist"
        )
        return case._replace(
            parameters=replace(par, **fields),
            state=(-th, s1, -w, v, 0.0, 0.0),
            torque=-case.torque,
            acceleration=-case.acceleration,
        )
    fields = negated(
        "crank_cog_z",
        "crank_product_xz",
        "crank_product_yz",
        "slider_cog_y",
        "gravity_z",
        "groove_amplitude",
        "shift_spring_free_position",
    )
    return case._replace(
        parameters=replace(par, **fields, guide_twist=pi - par.guide_twist),
        state=(th, -s1, w, -v, 0.0, 0.0),
        force=-case.force,
        shift_acceleration=-case.shift_acceleration,
    )


def mirror_sign(name: str, mirror: str) -> float:
    """Sign of an output in the mirror."""
    polar, axial = MIRRORS[mirror]
    if name.startswith("rod_w") or name.startswith(("bearing_m", "guide_m")):
        return -1.0 if name[-1] in axial else 1.0
    if name[-2:] in ("_x", "_y", "_z", "fx", "fy", "fz"):
        return -1.0 if name[-1] in polar else 1.0
    flips = {
        "y": ("crank_angle", "crank_speed", "crank_acceleration", "drive_applied_torque"),
        "z": ("shift_position", "shift_velocity", "shift_acceleration", "axial_applied_force"),
    }
    return -1.0 if name in flips[mirror] else 1.0


@pytest.mark.parametrize("mirror", MIRRORS)
@every_drive
def test_mirror_image_moves_as_the_mechanism_does(drive: str, mirror: str) -> None:
    for seed in range(15):
        case = seeded(seed)
        image = mirrored(case, mirror)
        direct = D.outputs(case.state, case.inputs(drive), 0.0, case.p)
        seen = D.outputs(image.state, image.inputs(drive), 0.0, image.p)
        for name, expected, value in zip(D.Outputs._fields, direct, seen):
            assert mirror_sign(name, mirror) * value == pytest.approx(expected, rel=1e-8, abs=1e-8), name


# ------------------------------------------------------------------ the thesis's relations and numbers


@pytest.mark.parametrize("spot", SPOTS)
def test_spot_values_of_both_force_problems(spot: Spot) -> None:
    p = published.parameters(spot.offset_in, spot.twist_deg).constants()
    x = (radians(30.0), spot.shift_in * INCH, published.CRANK_SPEED, 0.0, 0.0, 0.0)
    i = REST._replace(speed_drive=1.0, shift_drive=1.0)
    e = evaluate(x, i, p)
    assert e.motion.torque / POUND_INCH == pytest.approx(spot.torque_lb_in, abs=6e-6)
    # the slider's load that leaves 100 lb.in to the crank
    load = (e.motion.torque - TORQUE_LB_IN * POUND_INCH) / e.k.kth
    assert load / POUND_FORCE == pytest.approx(spot.slider_force_lb, abs=6e-7)
    loaded = evaluate(x, i._replace(load=load), p)
    assert loaded.motion.torque / POUND_INCH == pytest.approx(TORQUE_LB_IN, rel=1e-12)


@pytest.mark.parametrize("angle_deg", [10.0, 75.0, 160.0, 250.0, 340.0])
def test_relations_of_the_thesis_that_hold_and_what_they_lack(angle_deg: float) -> None:
    par = published.parameters(20.0, 310.0)
    p = par.constants()
    shift = 3.5 * INCH
    x = (radians(angle_deg), shift, published.CRANK_SPEED, 0.0, 0.0, 0.0)
    e = evaluate(x, REST._replace(speed_drive=1.0, shift_drive=1.0, load=17.0), p)
    f, q = e.forces, e.g
    size = hypot(*f.bearing_moment)
    # the full relations: the thesis leaves the axial force out
    assert f.bearing_moment.x == pytest.approx(-f.bearing.y * shift + f.axial * p.a1 * q.s, abs=1e-12 * size)
    assert f.bearing_moment.y == pytest.approx(f.bearing.x * shift - f.axial * p.a1 * q.c, abs=1e-12 * size)
    assert abs(f.axial * p.a1) > 0.01 * size
    # 4T4 = 0, and at constant speed the rod's force across the crank balances the torque: 2F2j = -T/a1
    assert f.guide_moment == (0.0, 0.0, 0.0)
    on_crank = K.to_crank_frame(scale(-1.0, f.crank_pin), q)
    assert on_crank.y == pytest.approx(-e.motion.torque / p.a1, rel=1e-12)
    # 2F2k = 0 does not hold
    assert abs(on_crank.z) > 0.1
    # with the slider's centre of mass off the pin there is a moment
    moved = replace(par, slider_cog_y=0.01).constants()
    assert hypot(*evaluate(x, REST._replace(speed_drive=1.0), moved).forces.guide_moment) > 1e-3


def test_planar_mechanism_has_the_textbooks_forces() -> None:
    # in line, light rod, at constant speed: T = (push of the slider) times the velocity ratio, all in the plane
    par = SliderCrankParameters(
        crank_length=0.1,
        rod_length=0.4,
        guide_twist=1.5 * pi,
        crank_mass=1.0,
        crank_inertia=0.01,
        slider_mass=2.0,
    )
    p = par.constants()
    for th in np.linspace(0.1, 6.1, 13).tolist():
        x = (th, 0.0, 10.0, 0.0, 0.0, 0.0)
        e = evaluate(x, REST._replace(speed_drive=1.0, shift_drive=1.0, load=-30.0), p)
        lean = np.arcsin(0.1 * cos(th) / 0.4)
        acceleration = e.motion.slider_acceleration
        thrust = (2.0 * acceleration + 30.0) / cos(lean)  # along the rod
        assert e.forces.crank_pin == pytest.approx((-thrust * sin(lean), thrust * cos(lean), 0.0), abs=1e-12)
        assert e.motion.torque == pytest.approx(0.1 * thrust * cos(th - lean), abs=1e-12)
        assert e.forces.guide == pytest.approx((thrust * sin(lean), 0.0, 0.0), abs=1e-11)


def test_outputs_carry_the_configuration_and_the_forces() -> None:
    case = seeded(7)
    par, p, x = case.parameters, case.p, case.state
    i = case.inputs("speed-shift")
    e = evaluate(x, i, p)
    o = D.outputs((*x[:4], 3.0, 5.0), i, 2.0, p)
    at = pins(x, par)
    s4, v4 = slider_motion(at, par)

    def triple(prefix: str) -> Sequence[float]:
        return [getattr(o, f"{prefix}{axis}") for axis in "xyz"]

    assert (o.crank_angle, o.shift_position, o.crank_speed, o.shift_velocity) == x[:4]
    assert (o.crank_acceleration, o.shift_acceleration) == e.motion[:2]
    assert (o.slider_position, o.slider_velocity) == pytest.approx((s4, v4), rel=1e-12)
    assert o.slider_acceleration == e.motion.slider_acceleration
    assert (o.drive_applied_torque, o.axial_applied_force) == (e.motion.torque, e.motion.force)
    assert triple("crank_pin_") == pytest.approx(at.p2, rel=1e-12)
    assert triple("slider_pin_") == pytest.approx(at.p3, rel=1e-12)
    assert triple("rod_w") == pytest.approx(at.turn, rel=1e-10)
    assert triple("bearing_f") == [*e.forces.bearing[:2], e.forces.axial]
    assert triple("bearing_m") == list(e.forces.bearing_moment)
    assert triple("crank_pin_f") == list(e.forces.crank_pin)
    assert triple("slider_pin_f") == list(e.forces.slider_pin)
    assert triple("guide_f") == list(e.forces.guide)
    assert triple("guide_m") == list(e.forces.guide_moment)
    assert o.energy_kinetic + o.energy_potential == D.mechanical_energy(x, p)
    assert (o.energy_dissipated, o.energy_supplied) == (3.0, 5.0)
    assert o.energy_residual == pytest.approx(o.energy_kinetic + o.energy_potential - 2.0 + 3.0 - 5.0, rel=1e-14)
    assert o.closure_residual < 1e-14
    assert o.transmission_angle == K.transmission_angle(e.g, p)
    assert o.assembly_margin == K.assembly_margin(e.g, p)
