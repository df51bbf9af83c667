"""The thesis's method mended, by dual vectors: against the plant's vector mechanics, published numbers and balances."""

from dataclasses import replace
from itertools import product
from math import inf, nan, radians

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import brentq

from analysis.slider_crank import DeadCentreError, JointLoads, Rates, close, follow, joint_loads, rates
from linkwork.errors import AssemblyError, InputError
from linkwork.slider_crank import dynamics, kinematics
from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, parameters
from tests.published_rahman import DEAD_CENTRES_DEG, INCH, OFFSETS_IN, POUND_FORCE, SHIFTS_IN, TORQUE_LB_IN, TWISTS_DEG
from tests.slider_cranks import Case, cases, components, seeded

several = settings(max_examples=40, derandomize=True, deadline=None)
every_case = pytest.mark.parametrize(("offset", "twist"), list(product(OFFSETS_IN, TWISTS_DEG)))
TURN = np.radians(np.arange(0.0, 360.0, 10.0))
COARSE = TURN[::3]
FORCES = ("bearing", "axial", "crank_pin", "slider_pin", "guide", "slider_force")
MOMENTS = ("bearing_moment", "guide_moment", "torque")


def plant(
    p: SliderCrankParameters, x: dynamics.State, e: float, a: float, load: float
) -> tuple[dynamics.Motion, dynamics.Reactions, float]:
    """Motion, reactions and whole force on the slider with both accelerations prescribed, by the plant."""
    k = p.constants()
    q = kinematics.position(x[0], x[1], k)
    i = dynamics.Inputs(1.0, 1.0, 0.0, 0.0, e, 0.0, a, load)
    m = dynamics.motion(q, kinematics.coefficients(q, k), x, i, k)
    return m, dynamics.reactions(q, x, m, i, k), dynamics.slider_resistance(q.s4, m.slider_velocity, load, k)


def assert_same(
    found: JointLoads, expected: list[tuple[dynamics.Motion, dynamics.Reactions, float]], share: float
) -> None:
    """Forces to ``share`` of the largest force, moments to ``share`` of the largest moment."""
    values = {name: np.array([getattr(r, name) for _, r, _ in expected]) for name in dynamics.Reactions._fields}
    values["torque"] = np.array([m.torque for m, _, _ in expected])
    values["slider_force"] = np.array([force for *_, force in expected])
    for names in (FORCES, MOMENTS):
        largest = max(np.abs(values[name]).max() for name in names)
        for name in names:
            np.testing.assert_allclose(getattr(found, name), values[name], rtol=0.0, atol=share * largest, err_msg=name)


@every_case
def test_agrees_with_vector_mechanics_in_all_cases_of_the_thesis(offset: float, twist: float) -> None:
    """With the load given, and with the torque that the plant finds for it, clear of the dead centres by 0.02 a1."""
    for shift, branch in product(SHIFTS_IN, (1, -1)):
        p = replace(parameters(offset, twist), assembly_branch=branch)
        at = close(p, COARSE, shift * INCH)
        expected = [plant(p, (th, shift * INCH, CRANK_SPEED, 0.0, 0.0, 0.0), 0.0, 0.0, 20.0) for th in COARSE]
        found = joint_loads(at, speed=CRANK_SPEED, slider_force=20.0)
        assert_same(found, expected, 1e-9)
        assert np.abs(found.residual).max() < 1e-9 * np.abs(found.bearing_moment).max()
        (clear,) = np.nonzero(np.abs(rates(at, speed=1.0).ratio) > 0.02 * p.crank_length)
        torque = found.torque[clear]
        sought = joint_loads(at.at(clear), speed=CRANK_SPEED, torque=torque)
        np.testing.assert_array_equal(sought.torque, torque)
        assert_same(sought, [expected[i] for i in clear], 1e-9)


@given(cases())
@several
def test_agrees_with_vector_mechanics_for_random_mechanisms_and_motions(case: Case) -> None:
    """General masses, centres of mass, products of inertia, gravity, springs, friction, and shift in motion."""
    p = case.parameters
    th, s1, w, v, _, _ = case.state
    e, a = case.acceleration, case.shift_acceleration
    expected = plant(p, case.state, e, a, case.load)
    motion = {"speed": w, "shift_velocity": v, "acceleration": e, "shift_acceleration": a}
    found = close(p, th, s1)
    moved = rates(found, **motion)
    q = kinematics.position(th, s1, case.p)
    k = kinematics.coefficients(q, case.p)
    slide = kinematics.centripetal(q, k, w, v, case.p)
    assert moved.slider_velocity[0] == pytest.approx(expected[0].slider_velocity, rel=1e-9, abs=1e-9)
    size = abs(k.kth * e) + abs(k.ks * a) + abs(slide)
    assert moved.slider_acceleration[0] == pytest.approx(k.kth * e + k.ks * a + slide, rel=1e-9, abs=1e-9 * size)
    assert moved.ratio[0] == pytest.approx(k.kth, rel=1e-9, abs=1e-11)
    load_given = joint_loads(found, **motion, slider_force=expected[2])
    assert_same(load_given, [expected], 1e-9)
    # the other problem gives the load back, as exactly as the lever allows
    lever = abs(k.kth) / p.crank_length
    if lever > 1e-3:
        assert_same(joint_loads(found, **motion, torque=expected[0].torque), [expected], 1e-10 / lever + 1e-9)


def test_points_and_start_of_the_iteration_do_not_matter() -> None:
    """Continuation gives the rod another spin than closing each point for itself; the forces are the same."""
    p = seeded(5).parameters
    th = np.linspace(0.0, 0.5, 6) + seeded(5).state[0]
    s1 = seeded(5).state[1]
    motion = {"speed": 3.0, "shift_velocity": 0.4, "acceleration": -7.0, "shift_acceleration": 2.0, "slider_force": 5.0}
    one, other = joint_loads(close(p, th, s1), **motion), joint_loads(follow(p, th, s1), **motion)
    assert np.abs(one.closure.crank_ball - other.closure.crank_ball).max() > 1e-3
    for name in (*FORCES, *MOMENTS):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9, atol=1e-9)


# ------------------------------------------------------------------ rates


def moving(case: Case) -> tuple[Rates, Rates, Rates, float]:
    """Rates of a motion with theta1 and S1 quadratic in time, now and a moment before and after."""
    th, s1, w, v, _, _ = case.state
    e, a = 10.0, 2.0
    h = 1e-5
    found = []
    for t in (-h, 0.0, h):
        at = close(case.parameters, th + w * t + 0.5 * e * t * t, s1 + v * t + 0.5 * a * t * t)
        found.append(rates(at, speed=w + e * t, shift_velocity=v + a * t, acceleration=e, shift_acceleration=a))
    return found[0], found[1], found[2], h


@pytest.mark.parametrize("seed", range(6))
def test_rates_are_those_of_the_dual_velocities(seed: int) -> None:
    """The dual velocities in the ground frame, differentiated numerically, and no spin of the rod at any time."""
    before, now, after, h = moving(seeded(seed))
    for name in ("crank", "rod", "slider"):
        for part in ("real", "dual"):
            slope = (getattr(getattr(after, name), part) - getattr(getattr(before, name), part)) / (2.0 * h)
            rate = getattr(getattr(now, f"{name}_rate"), part)
            np.testing.assert_allclose(rate, slope, rtol=0.0, atol=1e-4 * max(1.0, np.abs(slope).max()))
    rod = close(seeded(seed).parameters, *seeded(seed).state[:2]).rod_frame.real[0, :, 0]
    assert now.rod.real[0] @ rod == pytest.approx(0.0, abs=1e-12 * np.linalg.norm(now.rod.real))
    assert now.rod_rate.real[0] @ rod == pytest.approx(0.0, abs=1e-11 * np.linalg.norm(now.rod_rate.real))
    np.testing.assert_array_equal(now.slider.real, 0.0)


# ------------------------------------------------------------------ frames


def test_statements_of_the_thesis_on_single_components() -> None:
    """Section 3.2 by the notes: 4T4 = 0 and 2F2j = -T/a1 = -8.33 lb at constant speed hold, 2F2k = 0 does not."""
    found = joint_loads(close(parameters(10.0), TURN + 0.01, 3.5 * INCH), speed=CRANK_SPEED, torque=CRANK_TORQUE)
    np.testing.assert_allclose(found.guide_moment, 0.0, atol=1e-10)
    # the force of the rod on the crank, in frame 2
    on_crank = -components(found, "crank_pin", 2) / POUND_FORCE
    np.testing.assert_allclose(on_crank[:, 1], -TORQUE_LB_IN / 12.0, rtol=1e-9)
    assert np.abs(on_crank[:, 2]).max() > 1.0


# ------------------------------------------------------------------ errors


@pytest.mark.parametrize("offset", [10.0, 20.0, 30.0])
def test_dead_centres_are_reported(offset: float) -> None:
    p = parameters(offset)
    near = [radians(angle) for angle in DEAD_CENTRES_DEG[offset]]
    exact = [
        brentq(lambda th: float(rates(close(p, th, 0.0), speed=1.0).ratio[0]), guess - 0.01, guess + 0.01, xtol=1e-15)
        for guess in near
    ]
    assert np.degrees(exact) == pytest.approx(DEAD_CENTRES_DEG[offset], abs=0.005)
    with pytest.raises(DeadCentreError, match="is a dead centre"):
        joint_loads(close(p, [0.1, *exact], 0.0), speed=CRANK_SPEED, torque=1.0)
    joint_loads(close(p, exact, 0.0), speed=CRANK_SPEED, slider_force=1.0)


def test_one_of_torque_and_force_is_needed() -> None:
    found = close(parameters(), 0.3, 0.0)
    for both in ({}, {"torque": 1.0, "slider_force": 1.0}):
        with pytest.raises(InputError, match="give either the torque"):
            joint_loads(found, speed=1.0, **both)


@pytest.mark.parametrize("name", ["speed", "shift_velocity", "acceleration", "shift_acceleration", "slider_force"])
@pytest.mark.parametrize("bad", [nan, inf, [1.0, 2.0]])
def test_values_of_no_use_are_reported_by_name(name: str, bad: float) -> None:
    found = close(parameters(), [0.3, 0.4, 0.5], 0.0)
    with pytest.raises(InputError, match=name):
        joint_loads(found, **({"speed": 1.0, "slider_force": 0.0} | {name: bad}))


def test_no_rates_at_the_limit_of_assembly() -> None:
    p = replace(parameters(0.0), rod_length=12.0 * INCH, rod_cog_distance=6.0 * INCH)
    with pytest.raises(AssemblyError, match="perpendicular to the guide at theta1 = 0 rad"):
        rates(close(p, 0.0, 0.0), speed=1.0)
