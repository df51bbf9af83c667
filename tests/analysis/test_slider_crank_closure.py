"""Loop closure by dual matrices: against the closed form, on the residual, in any unit, and what it says when it fails."""

from dataclasses import replace
from itertools import pairwise, product
from math import cos, hypot, inf, nan, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.numerics.dual import Dual, about_i, about_j, about_k
from analysis.slider_crank import ClosureError, close, follow, shortage
from analysis.slider_crank import closure as C
from analysis.slider_crank.closure import planar_loops, residuals
from analysis.units import INCH
from linkwork.errors import AssemblyError, InputError
from linkwork.slider_crank import kinematics
from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.published import parameters
from tests.published_rahman import GREATEST_SHIFTS_IN, OFFSETS_IN, SHIFTS_IN, TWISTS_DEG
from tests.slider_cranks import Case, cases

several = settings(max_examples=30, derandomize=True, deadline=None)
TURN = np.linspace(0.0, 2.0 * pi, 37)
every_case = pytest.mark.parametrize(("offset", "twist"), list(product(OFFSETS_IN, TWISTS_DEG)))


def in_unit(p: SliderCrankParameters, unit: float) -> SliderCrankParameters:
    """The mechanism with its lengths counted in ``unit`` (m); the masses stay as they are."""
    inertia = {name: getattr(p, name) / unit**2 for name in ("crank_inertia", "rod_inertia")}
    lengths = ("crank_length", "rod_length", "guide_offset", "crank_cog_x", "rod_cog_distance")
    return replace(p, **{name: getattr(p, name) / unit for name in lengths}, **inertia)


@every_case
def test_agrees_with_the_closed_form_in_all_cases_of_the_thesis(offset: float, twist: float) -> None:
    for shift, branch in product(SHIFTS_IN, (1, -1)):
        p = replace(parameters(offset, twist), assembly_branch=branch)
        found = close(p, TURN, shift * INCH)
        plant = [kinematics.position(th, shift * INCH, p.constants()) for th in TURN]
        np.testing.assert_allclose(found.slider_position, [q.s4 for q in plant], rtol=0.0, atol=1e-12)
        pins = [kinematics.slider_pin(q, p.constants()) for q in plant]
        np.testing.assert_allclose(found.slider_pin, pins, rtol=0.0, atol=1e-12)
        assert found.rotation_residual.max() < 1e-13
        assert found.length_residual.max() < 1e-13
        assert found.iterations <= 8


@given(cases())
@several
def test_random_mechanisms_close_and_agree_with_the_closed_form(case: Case) -> None:
    th, s1 = case.state[:2]
    found = close(case.parameters, th, s1)
    q = kinematics.position(th, s1, case.p)
    assert found.slider_position[0] == pytest.approx(q.s4, abs=1e-9 * C.scale(case.parameters, found.shift))
    assert shortage(case.parameters, th, s1) < 0.0
    for ball in (found.crank_ball, found.slider_ball):
        np.testing.assert_allclose(ball[0] @ ball[0].T, np.eye(3), atol=1e-13)
    # rod between the pins, its frame's i along it; the guide's frame as the twist gives it
    between = found.slider_pin[0] - found.crank_pin[0]
    np.testing.assert_allclose(between, case.p.a2 * found.rod_frame.real[0, :, 0], atol=1e-10)
    np.testing.assert_allclose(found.guide_frame.real[0, :, 2], [0.0, case.p.sa, case.p.ca], atol=1e-10)


@every_case
def test_continuation_finds_the_same_round_the_turn_and_back_to_its_start(offset: float, twist: float) -> None:
    p = parameters(offset, twist)
    turn = np.linspace(0.5, 0.5 + 2.0 * pi, 25)
    found = follow(p, turn, 9.0 * INCH)
    np.testing.assert_allclose(found.slider_position, close(p, turn, 9.0 * INCH).slider_position, rtol=0.0, atol=1e-12)
    assert found.slider_position[-1] == pytest.approx(found.slider_position[0], abs=1e-12)


def test_continuation_turns_the_rod_without_spin() -> None:
    """Between near points the rod's rotation has no component along the rod: omega . u = 0, to the square of the step."""
    spins = []
    for steps in (36, 72):
        found = follow(parameters(20.0, 232.0), np.linspace(0.0, 2.0 * pi, steps + 1), 6.0 * INCH)
        rods = found.rod_frame.real
        turns = rods[1:] @ np.swapaxes(rods[:-1], 1, 2)
        skew = turns - np.swapaxes(turns, 1, 2)
        vectors = 0.5 * np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], -1)
        along = np.abs(np.sum(vectors * (rods[1:, :, 0] + rods[:-1, :, 0]), -1)) / 2.0
        spins.append(along.max())
        assert np.linalg.norm(vectors, axis=-1).max() > 1e2 * along.max()
    assert spins[1] < spins[0] / 3.5


def test_the_estimate_is_the_closed_loop_of_the_planar_mechanism() -> None:
    p = parameters(20.0)
    th = TURN[:-1]
    assert np.max(residuals(planar_loops(p, th, 0.0 * th).product)) < 1e-14
    # section 2.6.2: with a1 cos th + a4 across, the planar slider is at a1 sin th + sqrt(a2^2 - across^2)
    across = p.crank_length * np.cos(th) + p.guide_offset
    planar = p.crank_length * np.sin(th) + np.sqrt(p.rod_length**2 - across**2)
    np.testing.assert_allclose(planar_loops(p, th, 0.0 * th).slider_position, planar, atol=1e-14)
    assert close(p, th, 0.0).iterations == 1


def test_newtons_method_converges_quadratically_from_open_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    """An inexact Jacobian would converge by a factor: here every residual is of the order of the square of the one before.

    The planar estimate closes in rotation; it is disturbed here by 0.3 rad in either ball joint and a tenth in length.
    """
    p = parameters(10.0, 232.0)
    errors: list[float] = []

    def recorded(product: Dual) -> tuple[np.ndarray, np.ndarray]:
        rotation, distance = residuals(product)
        errors.append(float(max(rotation.max(), distance.max() / p.rod_length)))
        return rotation, distance

    def disturbed(p: SliderCrankParameters, th: np.ndarray, s1: np.ndarray) -> C.Loops:
        start = planar_loops(p, th, s1)
        return replace(
            start,
            crank_ball=start.crank_ball @ about_k(0.3).real @ about_i(0.2).real,
            slider_ball=about_j(-0.3).real @ start.slider_ball,
            slider_position=1.1 * start.slider_position,
        )

    monkeypatch.setattr(C, "residuals", recorded)
    monkeypatch.setattr(C, "planar_loops", disturbed)
    found = close(p, 0.7, 9.0 * INCH)
    by_plant = kinematics.position(0.7, 9.0 * INCH, p.constants()).s4
    assert found.slider_position[0] == pytest.approx(by_plant, rel=0.0, abs=1e-13)
    assert errors[0] > 0.3
    large = [error for error in errors if error > 1e-12]
    assert len(large) >= 4
    assert all(after < 3.0 * before**2 for before, after in pairwise(large[1:]))


@pytest.mark.parametrize("unit", [INCH, 1e-3])
@every_case
def test_the_unit_of_length_does_not_matter(offset: float, twist: float, unit: float) -> None:
    p = parameters(offset, twist)
    metres = close(p, TURN, 6.0 * INCH)
    other = close(in_unit(p, unit), TURN, 6.0 * INCH / unit)
    np.testing.assert_allclose(other.slider_position * unit, metres.slider_position, rtol=1e-13)
    np.testing.assert_allclose(other.crank_ball, metres.crank_ball, atol=1e-13)
    np.testing.assert_allclose(other.slider_ball, metres.slider_ball, atol=1e-13)
    assert other.iterations == metres.iterations


@pytest.mark.parametrize("offset", OFFSETS_IN)
def test_closes_up_to_the_limit_of_the_shift_and_says_by_how_much_the_rod_is_short_beyond(offset: float) -> None:
    """The limits of the notes, far beyond the published limits of convergence."""
    limit = GREATEST_SHIFTS_IN[offset]
    p = parameters(offset)
    assert close(p, TURN, (limit - 1e-3) * INCH).length_residual.max() < 1e-12
    with pytest.raises(AssemblyError, match="does not reach the guide") as error:
        close(p, TURN, (limit + 1.0) * INCH)
    lacking = hypot(12.0 + offset, limit + 1.0) - 50.0
    assert f"{lacking * INCH:.3g} m too far" in str(error.value)
    assert "theta1 = 0 rad" in str(error.value)


@given(cases(), st.floats(0.01, 0.9))
@several
def test_a_rod_too_short_is_reported_with_what_it_lacks(case: Case, share: float) -> None:
    th, s1 = case.state[:2]
    p = case.parameters
    # the guide through (-a4, 0, 0) along k4: the distance of the crank pin from it
    k4 = np.array([0.0, sin(p.guide_twist), cos(p.guide_twist)])
    pin = np.array([p.crank_length * cos(th) + p.guide_offset, p.crank_length * sin(th), s1])
    distance = float(np.linalg.norm(np.cross(pin, k4)))
    short = replace(p, rod_length=distance * share, rod_cog_distance=0.0)
    assert shortage(short, th, s1) == pytest.approx(distance * (1.0 - share), rel=1e-9)
    with pytest.raises(AssemblyError) as error:
        close(short, th, s1)
    assert f"{distance * (1.0 - share):.3g} m too far" in str(error.value)


def test_the_half_turned_loop_is_not_taken_for_closed() -> None:
    """The antisymmetric part of a half turn is zero; the residual is not."""
    rotation, distance = residuals(Dual(np.diag([-1.0, -1.0, 1.0])[None]))
    assert rotation[0] == pytest.approx(pi)
    assert distance[0] == 0.0


def test_a_start_at_the_other_assembly_is_reported() -> None:
    p = parameters(10.0)
    other = close(replace(p, assembly_branch=-1), 0.3, 0.0)
    with pytest.raises(ClosureError, match="closes in assembly -1"):
        close(p, 0.31, 0.0, start=other)


def test_a_start_nearby_is_used() -> None:
    p = parameters(10.0, 232.0)
    start = close(p, 0.3, 0.05)
    found = close(p, [0.3, 0.31], 0.05, start=start)
    assert found.iterations <= 3
    np.testing.assert_allclose(found.slider_position, close(p, [0.3, 0.31], 0.05).slider_position, atol=1e-13)


def test_a_start_of_another_number_of_loops_is_refused() -> None:
    p = parameters(10.0)
    for count, points in ((2, [0.1, 0.2, 0.3]), (3, 0.1)):
        with pytest.raises(InputError, match=f"start has {count} loops"):
            close(p, points, 0.0, start=close(p, np.linspace(0.1, 0.3, count), 0.0))


def test_an_iteration_that_ends_open_is_reported_with_its_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(C, "MAX_ITERATIONS", 1)
    with pytest.raises(ClosureError, match=r"residual .* rad and .* m after 1 iterations at theta1 = 0.7 rad"):
        close(parameters(10.0, 232.0), 0.7, 9.0 * INCH)


@pytest.mark.parametrize("twist", [0.0, 270.0])
def test_rod_perpendicular_to_the_guide_is_the_last_loop_that_closes(twist: float) -> None:
    p = replace(parameters(0.0, twist), rod_length=12.0 * INCH, rod_cog_distance=6.0 * INCH)
    found = close(p, 0.0, 0.0)
    np.testing.assert_allclose(found.slider_pin, 0.0, atol=1e-12)
    if twist:
        with pytest.raises(AssemblyError, match="too far"):
            close(p, 0.0, INCH)


@pytest.mark.parametrize(
    ("angle", "shift", "message"),
    [
        ([0.0, nan], 0.0, "crank angle 1 is nan"),
        ([0.0, inf], 0.0, "crank angle 1 is inf"),
        (0.0, nan, "shift 0 is nan"),
        (0.0, inf, "shift 0 is inf"),
        ([0.0, 1.0], [0.0, 1.0, 2.0], "one length"),
        ([[0.0]], 0.0, "one axis"),
        ([], 0.0, "one axis"),
    ],
)
@pytest.mark.parametrize("how", [close, follow])
def test_points_that_are_none_are_refused(how: Any, angle: Any, shift: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        how(parameters(), angle, shift)
