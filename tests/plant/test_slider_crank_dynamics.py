"""Dynamics of the slider-crank, what is special of it: Newton and Euler on each body in space, the groove, and the thesis's
relations and numbers. What it shares is in `test_dynamics`."""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, radians

import numpy as np
import pytest

from linkwork.slider_crank import dynamics as D
from linkwork.slider_crank import kinematics as K
from linkwork.slider_crank import published
from linkwork.slider_crank.vectors import scale
from tests.oracles.bodies import crank_particles, guide_frame, pins, slider_crank, slider_motion, solve_bodies
from tests.plant.test_dynamics import SLIDER_CRANK
from tests.published_rahman import INCH, POUND_FORCE, POUND_INCH, SPOTS, TORQUE_LB_IN, Spot
from tests.slider_cranks import DRIVES, Case, seeded

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
    accelerations = [*s["crank_acceleration"] * p.a1, *s["shift_acceleration"], *s["slider_acceleration"]]
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
def test_newton_and_euler_agree_on_seeded_mechanisms(drive: str) -> None:
    # hypothesis likes round numbers; these are general ones
    for seed in range(60):
        assert_agrees_with_bodies(seeded(seed), drive)


@pytest.mark.parametrize("seed", range(20))
def test_groove_takes_the_place_of_the_shift_of_the_state(seed: int) -> None:
    case = seeded(seed)
    p, (th, _, w, *_) = case.p, case.state
    carried, law = (th, 9.0, w, 9.0, 0.0, 0.0), K.groove(th, p)
    for drive, (_, _, groove) in DRIVES.items():
        x = D.impose_groove(carried, groove, p)
        assert x == ((th, law.shift, w, pytest.approx(law.pitch * w, rel=1e-13), 0.0, 0.0) if groove else carried)
        if groove:
            i = case.inputs(drive)
            assert D.derivative(carried, i, p) == D.derivative(x, i, p)
            assert D.outputs(carried, i, 0.0, p) == D.outputs(x, i, 0.0, p)


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
    assert o.energy_kinetic + o.energy_potential == D.energy(x, p)
    assert (o.energy_dissipated, o.energy_supplied) == (3.0, 5.0)
    assert o.energy_residual == pytest.approx(o.energy_kinetic + o.energy_potential - 2.0 + 3.0 - 5.0, rel=1e-14)
    assert o.closure_residual < 1e-14
    assert o.transmission_angle == K.transmission_angle(e.g, p)
    assert o.assembly_margin == K.assembly_margin(e.g, p)
