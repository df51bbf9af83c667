"""Kinematics: the loop closes, on both assemblies, and every rate is the derivative of its position."""

from dataclasses import replace
from math import atan2, cos, hypot, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings

from linkwork.five_bar import kinematics as K
from linkwork.five_bar.parameters import Constants
from linkwork.five_bar.published import TABLE_3_1
from tests.oracles.differences import derivative
from tests.strategies import Case, cases, seeded

SEEDS = range(40)
#: Step of the differences in radians; the nearer the limit of assembly, which is at sin(th4 - th3)^2 / 2, the shorter.
STEP = 5e-3
several = settings(max_examples=100, derandomize=True, deadline=None)


def angles(th2: float, u: float, p: Constants, near: tuple[float, float]) -> tuple[float, float]:
    """th3 and th4 without the jumps of atan2: those next to ``near``."""
    g = K.position(th2, u, p)
    th3, th4 = K.link_angles(g, p)
    return th3 - 2 * pi * round((th3 - near[0]) / (2 * pi)), th4 - 2 * pi * round((th4 - near[1]) / (2 * pi))


def speeds(case: Case) -> tuple[float, float, K.Position, K.Coefficients]:
    th2, u, w2, v, _, _ = case.state
    p = case.parameters.constants()
    g = K.position(th2, u, p)
    k = K.coefficients(g, p)
    return k.k32 * w2 + k.k3u * v, k.k42 * w2 + k.k4u * v, g, k


@several
@given(case=cases())
def test_loop_closes(case: Case) -> None:
    th2, u, *_ = case.state
    p = case.parameters.constants()
    g = K.position(th2, u, p)
    # (2.1) written out with the directions, not through closure_residual
    x = p.l2 * cos(th2) + p.l3 * g.c3 - p.l4 * g.c4 - p.l1 - u * p.ca
    y = p.l2 * sin(th2) + p.l3 * g.s3 - p.l4 * g.s4 - u * p.sa
    assert hypot(x, y) < 2e-14 * (p.l1 + p.l3 + p.l4)
    assert hypot(g.c3, g.s3) == pytest.approx(1.0, abs=2e-14)
    assert hypot(g.c4, g.s4) == pytest.approx(1.0, abs=2e-14)
    assert K.closure_residual(th2, *K.link_angles(g, p), u, p) < 2e-14 * (p.l1 + p.l3 + p.l4)
    assert g.c43 == pytest.approx(g.c3 * g.c4 + g.s3 * g.s4, abs=2e-14)
    assert g.s43 == pytest.approx(g.c3 * g.s4 - g.s3 * g.c4, abs=2e-13)


@several
@given(case=cases())
def test_branch_is_the_sign_of_the_sine_and_both_assemblies_close(case: Case) -> None:
    th2, u, *_ = case.state
    tips = []
    for branch in (1, -1):
        p = replace(case.parameters, assembly_branch=branch).constants()
        g = K.position(th2, u, p)
        assert g.s43 * branch > 0.0
        assert g.c3 * g.s4 - g.s3 * g.c4 == pytest.approx(g.s43, abs=2e-13)
        tips.append(complex(p.l2 * g.c2 + p.l3 * g.c3, p.l2 * g.s2 + p.l3 * g.s3))
    # the two positions of C are mirror images in the line BD
    b = complex(p.l2 * cos(th2), p.l2 * sin(th2))
    d = complex(p.l1 + u * p.ca, u * p.sa)
    line = (d - b) / abs(d - b)
    mirrored = b + line * ((tips[0] - b) / line).conjugate()
    assert abs(mirrored - tips[1]) < 1e-12


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_coefficients_are_the_partial_derivatives(seed: int) -> None:
    case = seeded(seed)
    th2, u, *_ = case.state
    p = case.parameters.constants()
    _, _, g, k = speeds(case)
    near = K.link_angles(g, p)
    step = STEP * g.s43**2
    k32, k42 = derivative(lambda h: angles(th2 + h, u, p, near), step)
    k3u, k4u = derivative(lambda h: angles(th2, u + h * p.l1, p, near), step)
    scale = max(abs(x) for x in (k.k32, k.k42, p.l1 * k.k3u, p.l1 * k.k4u))
    assert (k32, k42) == pytest.approx((k.k32, k.k42), abs=1e-8 * scale)
    assert (k3u, k4u) == pytest.approx((p.l1 * k.k3u, p.l1 * k.k4u), abs=1e-8 * scale)


@pytest.mark.parametrize("seed", SEEDS)
def test_centripetal_terms_are_the_second_derivatives_at_constant_speeds(seed: int) -> None:
    case = seeded(seed)
    th2, u, w2, v, _, _ = case.state
    p = case.parameters.constants()
    w3, w4, g, _ = speeds(case)

    def rates(t: float) -> tuple[float, float]:
        c = K.coefficients(K.position(th2 + w2 * t, u + v * t, p), p)
        return c.k32 * w2 + c.k3u * v, c.k42 * w2 + c.k4u * v

    expected = derivative(rates, STEP * g.s43**2 / max(abs(w2), abs(w3), abs(w4)))
    g3, g4 = K.centripetal(g, w2, w3, w4, p)
    assert (g3, g4) == pytest.approx(expected, abs=1e-8 * max(abs(g3), abs(g4)))


@pytest.mark.parametrize("seed", SEEDS)
def test_coupler_point_velocity(seed: int) -> None:
    case = seeded(seed)
    th2, u, w2, v, _, _ = case.state
    p = case.parameters.constants()
    w3, w4, g, _ = speeds(case)
    vp = K.coupler_point_velocity(g, w2, w3, p)

    def point(t: float) -> tuple[float, float]:
        return K.coupler_point(K.position(th2 + w2 * t, u + v * t, p), p)

    h = STEP * g.s43**2 / max(abs(w2), abs(w3), abs(w4))
    assert vp == pytest.approx(derivative(point, h), abs=1e-8 * hypot(*vp))


@several
@given(case=cases())
def test_coupler_point_lies_where_its_distance_and_angle_say(case: Case) -> None:
    th2, u, *_ = case.state
    par = case.parameters
    p = par.constants()
    g = K.position(th2, u, p)
    x, y = K.coupler_point(g, p)
    x -= p.l2 * cos(th2)
    y -= p.l2 * sin(th2)
    direction = atan2(g.s3, g.c3) + par.coupler_point_angle
    assert x == pytest.approx(par.coupler_point_distance * cos(direction), abs=1e-13)
    assert y == pytest.approx(par.coupler_point_distance * sin(direction), abs=1e-13)


@several
@given(case=cases())
def test_angles_of_the_links_are_their_directions(case: Case) -> None:
    th2, u, *_ = case.state
    p = case.parameters.constants()
    g = K.position(th2, u, p)
    th3, th4 = K.link_angles(g, p)
    assert (cos(th3), sin(th3), cos(th4), sin(th4)) == pytest.approx((g.c3, g.s3, g.c4, g.s4), abs=1e-13)
    assert (cos(th4 - th3), sin(th4 - th3)) == pytest.approx((g.c43, g.s43), abs=1e-13)
    assert max(abs(th3), abs(th4)) < 2.0 * pi


def changes(places: list[tuple[float, float]], p: Constants) -> np.ndarray:
    """The changes of th3 and th4 from each crank angle and slider position to the next."""
    return np.diff([K.link_angles(K.position(th2, u, p), p) for th2, u in places], axis=0)


@pytest.mark.parametrize("branch", [1, -1])
def test_the_angles_of_the_links_do_not_leap(branch: int) -> None:
    """The slider pin lies beyond all places of the crank pin, and the rocker swings through the direction of half a turn."""
    lengths = {"ground_length": 0.3, "crank_length": 0.1, "coupler_length": 0.11, "rocker_length": 0.32}
    p = replace(TABLE_3_1, slider_guide_angle=0.5 * pi, assembly_branch=branch, **lengths).constants()
    places = [(angle, 0.1 * branch) for angle in np.linspace(0.0, 4.0 * pi, 2001)]
    directions = [K.position(*place, p) for place in places]
    assert max(abs(np.diff([atan2(g.s4, g.c4) for g in directions]))) > 6.0
    assert np.abs(changes(places, p)).max() < 0.02


def test_no_function_of_crank_and_slider_has_no_leap_where_their_pins_can_meet() -> None:
    """Round the place where both pins meet crank and slider come back to where they were, and the links have made a turn."""
    p = TABLE_3_1.constants()
    turn = np.linspace(0.0, 2.0 * pi, 721)
    changed = changes([(0.3 * sin(angle), p.l2 - p.l1 + 0.02 * cos(angle)) for angle in turn], p)
    small = np.remainder(changed + pi, 2.0 * pi) - pi
    assert np.abs(small).max() < 0.1
    assert np.abs(small.sum(axis=0)) == pytest.approx([2.0 * pi, 2.0 * pi])


@several
@given(case=cases())
def test_transmission_angle_is_that_of_the_triangle(case: Case) -> None:
    th2, u, *_ = case.state
    p = case.parameters.constants()
    angle = K.transmission_angle(K.position(th2, u, p), p)
    distance, low, high = K.joint_distance((th2, u), p)
    assert 0.0 <= angle <= pi
    assert low <= distance <= high
    # law of cosines at C
    assert distance**2 == pytest.approx(p.l3**2 + p.l4**2 - 2 * p.l3 * p.l4 * cos(angle), rel=1e-11)


@several
@given(case=cases())
def test_margins_and_square_say_how_far_the_limit_of_assembly_is(case: Case) -> None:
    th2, u, *_ = case.state
    p = case.parameters.constants()
    g = K.position(th2, u, p)
    stretched, folded = K.assembly_margin(th2, u, p)
    distance, low, high = K.joint_distance((th2, u), p)
    assert stretched == pytest.approx(high - distance, abs=1e-14)
    assert folded == pytest.approx(distance - low, abs=1e-14)
    assert stretched > 0.0
    assert folded > 0.0
    square = K.assembly_square(th2, u, p)
    assert square == pytest.approx((p.l3 * p.l4 * g.s43) ** 2, rel=1e-9)
    # Heron: 16 area^2 = (l3 + l4 + d)(l3 + l4 - d)(d + l3 - l4)(d - l3 + l4), and area = l3 l4 sin / 2
    span = (p.l3 + p.l4 + distance) * stretched * (distance + p.l3 - p.l4) * (distance - p.l3 + p.l4)
    assert 4.0 * square == pytest.approx(span, rel=1e-8)


def test_margins_change_sign_where_the_links_come_apart() -> None:
    p = TABLE_3_1.constants()
    u = p.l3 + p.l4 - p.l1 + p.l2  # crank at 0: BD = l1 + u - l2
    assert K.assembly_margin(0.0, u, p)[0] == pytest.approx(0.0, abs=1e-15)
    assert K.assembly_margin(0.0, u + 1e-6, p)[0] < 0.0
    assert K.assembly_square(0.0, u + 1e-6, p) < 0.0 < K.assembly_square(0.0, u - 1e-6, p)
    with pytest.raises(ValueError, match=r"math domain|nonnegative"):
        K.position(0.0, u + 1e-6, p)


def test_b_on_d_is_refused() -> None:
    p = replace(TABLE_3_1, coupler_length=0.15, rocker_length=0.15, ground_length=0.05, crank_length=0.05).constants()
    with pytest.raises(ZeroDivisionError):
        K.position(0.0, 0.0, p)


def kine_plus_root(th2: float, u: float, p: Constants) -> tuple[float, float]:
    """C - B by the "+ root" of appendix 1's KINE: x eliminated with the line of intersection, then the + root for y."""
    dx = p.l1 + u - p.l2 * cos(th2)
    dy = -p.l2 * sin(th2)
    d2 = dx * dx + dy * dy
    a = 0.5 * (d2 + p.l3 * p.l3 - p.l4 * p.l4)
    y = (a * dy + sqrt(a * a * dy * dy - d2 * (a * a - p.l3 * p.l3 * dx * dx))) / d2
    return (a - y * dy) / dx, y


@pytest.mark.parametrize("angle", [50.0, -50.0])
def test_plus_root_of_the_listing_changes_assembly_where_b_passes_d(angle: float) -> None:
    # the slider moves until D is to the left of B, which stays above it or below it
    p = TABLE_3_1.constants()
    th2 = radians(angle)
    over = p.l2 * cos(th2) - p.l1  # the slider position with B vertically above or below D
    for u in (over + 1e-3, over + 1e-6):
        g = K.position(th2, u, p)
        assert kine_plus_root(th2, u, p) == pytest.approx((p.l3 * g.c3, p.l3 * g.s3), abs=1e-9)
    for u in (over - 1e-6, over - 1e-3):
        g = K.position(th2, u, p)
        x, y = kine_plus_root(th2, u, p)
        assert hypot(x, y) == pytest.approx(p.l3, rel=1e-6)  # a position of the links it is
        assert abs(complex(x - p.l3 * g.c3, y - p.l3 * g.s3)) > p.l3  # the other one
        assert g.s43 > 0.0
    # there, where the listing divides by zero, nothing special happens
    before, at, after = (K.position(th2, over + h, p) for h in (-1e-7, 0.0, 1e-7))
    assert at == pytest.approx([0.5 * (x + y) for x, y in zip(before, after)], abs=1e-11)
