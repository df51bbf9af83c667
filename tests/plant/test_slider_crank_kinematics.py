"""Kinematics of the slider-crank: the loop closes, on both assemblies, and every rate is the derivative of its position."""

from dataclasses import replace
from math import acos, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings

from linkwork.slider_crank import kinematics as K
from linkwork.slider_crank import published
from linkwork.slider_crank.parameters import Constants
from linkwork.slider_crank.vectors import Vector, cross, dot, scale, subtract
from tests.oracles.differences import derivative
from tests.slider_cranks import Case, cases, seeded

SEEDS = range(40)
#: Step of the differences in radians; the nearer the limit of assembly, the shorter.
STEP = 3e-3
several = settings(max_examples=100, derandomize=True, deadline=None)


def nearness(q: K.Position, p: Constants) -> float:
    """Square of the cosine of the angle between rod and guide: about twice the way to the limit of assembly."""
    return (q.h / p.a2) ** 2


def frame_4(p: Constants) -> np.ndarray:
    """Axes of frame 4 by rows: that of frame 1 turned about i by the twist."""
    return np.array([[1.0, 0.0, 0.0], [0.0, p.ca, -p.sa], [0.0, p.sa, p.ca]])


@several
@given(case=cases())
def test_loop_closes(case: Case) -> None:
    th, s1, *_ = case.state
    p = case.p
    q = K.position(th, s1, p)
    size = p.a1 + p.a2 + abs(p.a4) + abs(s1)
    # the three vectors written out: crank, guide and offset, and the rod that joins them
    crank = np.array([p.a1 * cos(th), p.a1 * sin(th), s1])
    twist = case.parameters.guide_twist
    slider = np.array([-p.a4, 0.0, 0.0]) - q.s4 * np.array([0.0, sin(twist), cos(twist)])
    assert K.crank_pin(q, s1, p) == pytest.approx(tuple(crank), abs=1e-15 * size)
    assert K.slider_pin(q, p) == pytest.approx(tuple(slider), abs=1e-15 * size)
    assert K.rod(q, p) == pytest.approx(tuple(slider - crank), abs=1e-14 * size)
    assert np.linalg.norm(slider - crank) == pytest.approx(p.a2, rel=1e-13)
    assert K.closure_residual(th, s1, q.s4, p) < 1e-13 * size
    assert K.closure_residual(th, s1, q.s4 + 0.1 * q.h, p) > 1e-3 * abs(q.h)


@several
@given(case=cases())
def test_branch_is_the_side_of_the_foot_and_both_assemblies_close(case: Case) -> None:
    th, s1, *_ = case.state
    positions = []
    for branch in (1, -1):
        p = replace(case.parameters, assembly_branch=branch).constants()
        q = K.position(th, s1, p)
        foot = dot(K.crank_pin(q, s1, p), K.guide(p))
        assert (q.s4 - foot) * branch > 0.0
        assert K.assembly_square(th, s1, p) == pytest.approx(q.h**2, rel=1e-12)
        positions.append((q.s4, foot))
    # the two slider pins are mirror images in the foot
    assert positions[0][0] + positions[1][0] == pytest.approx(2.0 * positions[0][1], abs=1e-13)


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_coefficients_are_the_partial_derivatives(seed: int) -> None:
    case = seeded(seed)
    th, s1, *_ = case.state
    p = case.p
    q = K.position(th, s1, p)
    k = K.coefficients(q, p)
    step = STEP * nearness(q, p)
    (kth,) = derivative(lambda h: (K.position(th + h, s1, p).s4,), step)
    (ks,) = derivative(lambda h: (K.position(th, s1 + h * p.a1, p).s4,), step)
    size = max(abs(k.kth), p.a1 * abs(k.ks))
    assert (kth, ks) == pytest.approx((k.kth, p.a1 * k.ks), abs=1e-8 * size)


@pytest.mark.parametrize("seed", SEEDS)
def test_velocities_and_accelerations_are_the_derivatives_along_a_motion(seed: int) -> None:
    case = seeded(seed)
    th, s1, w, v, _, _ = case.state
    e, a = case.acceleration, case.shift_acceleration
    p = case.p

    def at(t: float) -> tuple[K.Position, K.Coefficients, float, float, float]:
        q = K.position(th + w * t + 0.5 * e * t * t, s1 + v * t + 0.5 * a * t * t, p)
        return q, K.coefficients(q, p), s1 + v * t + 0.5 * a * t * t, w + e * t, v + a * t

    def velocities(t: float) -> tuple[float, ...]:
        q, k, _, w, v = at(t)
        return (k.kth * w + k.ks * v, *K.crank_pin_velocity(q, w, v, p))

    q, k, *_ = at(0.0)
    step = STEP * nearness(q, p) / max(abs(w), abs(e) ** 0.5, abs(v) / p.a1, (abs(a) / p.a1) ** 0.5)
    found = velocities(0.0)
    moved = derivative(lambda t: (at(t)[0].s4, *K.crank_pin(at(t)[0], at(t)[2], p)), step)
    assert found == pytest.approx(moved, abs=1e-8 * max(map(abs, found)))
    accelerations = (k.kth * e + k.ks * a + K.centripetal(q, k, w, v, p), *K.crank_pin_acceleration(q, w, e, a, p))
    assert accelerations == pytest.approx(derivative(velocities, step), abs=1e-8 * max(map(abs, accelerations)))


@pytest.mark.parametrize("seed", SEEDS)
def test_rod_turns_as_its_ends_move_and_not_about_itself(seed: int) -> None:
    case = seeded(seed)
    th, s1, w, v, _, _ = case.state
    p = case.p
    q = K.position(th, s1, p)
    k = K.coefficients(q, p)
    r = K.rod(q, p)
    step = STEP * nearness(q, p) / max(abs(w), abs(v) / p.a1)
    rate = Vector(*derivative(lambda t: K.rod(K.position(th + w * t, s1 + v * t, p), p), step))
    exact = subtract(scale(k.kth * w + k.ks * v, K.guide(p)), K.crank_pin_velocity(q, w, v, p))
    assert exact == pytest.approx(rate, abs=1e-8 * max(map(abs, rate)))
    turn = K.rod_angular_velocity(r, exact, p)
    assert cross(turn, r) == pytest.approx(exact, abs=1e-12 * max(map(abs, exact)))
    assert dot(turn, r) == pytest.approx(0.0, abs=1e-13 * p.a2 * max(map(abs, turn)))


@pytest.mark.parametrize("seed", SEEDS)
def test_groove_is_equation_28_and_its_derivatives(seed: int) -> None:
    case = seeded(seed)
    th, p, par = case.state[0], case.p, case.parameters
    law = K.groove(th, p)
    assert law.shift == pytest.approx(par.groove_amplitude * sin(par.groove_ratio * th), abs=1e-15)
    first, second = derivative(lambda h: K.groove(th + h, p)[:2], 1e-2)
    assert (law.pitch, law.bend) == pytest.approx((first, second), abs=1e-9)


@several
@given(case=cases())
def test_transmission_angle_and_margin_are_those_of_rod_and_guide(case: Case) -> None:
    th, s1, *_ = case.state
    p = case.p
    q = K.position(th, s1, p)
    cosine = abs(dot(K.rod(q, p), K.guide(p))) / p.a2
    assert K.transmission_angle(q, p) == pytest.approx(pi / 2 - acos(min(1.0, cosine)), abs=1e-7)
    assert sin(K.transmission_angle(q, p)) == pytest.approx(cosine, abs=1e-13)
    # distance of the crank pin from the guide's line, by the area under the two
    arm = subtract(K.crank_pin(q, s1, p), Vector(-p.a4, 0.0, 0.0))
    distance = sqrt(sum(x * x for x in cross(arm, K.guide(p))))
    assert K.assembly_margin(q, p) == pytest.approx(p.a2 - distance, abs=1e-14)
    assert K.assembly_margin(q, p) > 0.0


def test_margin_changes_sign_where_the_rod_comes_off_the_guide() -> None:
    p = published.parameters(30.0).constants()
    limit = sqrt(p.a2**2 - (p.a1 + p.a4) ** 2)
    assert K.assembly_square(0.0, limit + 1e-9, p) < 0.0 < K.assembly_square(0.0, limit - 1e-9, p)
    assert K.transmission_angle(K.position(0.0, limit * (1.0 - 1e-12), p), p) < 1e-5
    with pytest.raises(ValueError, match=r"math domain|nonnegative"):
        K.position(0.0, limit + 1e-9, p)


@several
@given(case=cases())
def test_frames_are_rotations(case: Case) -> None:
    th, s1, *_ = case.state
    p = case.p
    q = K.position(th, s1, p)
    axes = [Vector(1.0, 0.0, 0.0), Vector(0.0, 1.0, 0.0), Vector(0.0, 0.0, 1.0)]
    crank = np.array([K.to_crank_frame(a, q) for a in axes]).T
    guide = np.array([K.to_guide_frame(a, p) for a in axes]).T
    back = np.array([K.from_guide_frame(a, p) for a in axes]).T
    r = K.rod(q, p)
    frames = [crank, guide]
    if hypot(r.x, r.y) > 1e-6 * p.a2:
        frames.append(np.array([K.to_rod_frame(a, q, p) for a in axes]).T)
        # i along the rod, j across it and the crank axis
        assert K.to_rod_frame(r, q, p) == pytest.approx((p.a2, 0.0, 0.0), abs=1e-9 * p.a2)
        assert frames[-1][1, 2] == 0.0
    for frame in frames:
        assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-9)
        assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-9)
    assert back @ guide == pytest.approx(np.eye(3), abs=1e-14)
    assert guide == pytest.approx(frame_4(p), abs=1e-15)
    # the crank pin is on i of frame 2, the slider pin goes along -k of frame 4
    assert K.to_crank_frame(K.crank_pin(q, s1, p), q) == pytest.approx((p.a1, 0.0, s1), abs=1e-14)
    assert K.to_guide_frame(K.slider_pin(q, p), p) == pytest.approx((-p.a4, 0.0, -q.s4), abs=1e-13)
    assert K.to_guide_frame(K.guide(p), p) == pytest.approx((0.0, 0.0, -1.0), abs=1e-14)
