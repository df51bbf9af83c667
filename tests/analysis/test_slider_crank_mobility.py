"""Mobility of the slider-crank: against the closed forms, against dense scans, and against known numbers."""

import random
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import cos, degrees, inf, nan, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.slider_crank import mobility as M
from linkwork.errors import InputError, ParameterError
from linkwork.slider_crank import kinematics as K
from linkwork.slider_crank import published
from linkwork.slider_crank.parameters import SliderCrankParameters
from tests import published_rahman as rahman
from tests.published_rahman import INCH

several = settings(max_examples=60, derandomize=True, deadline=None)
TURN = 2.0 * pi
STILL = M.constant_shift(0.0)


def turns_fully(par: SliderCrankParameters, law: M.PeriodicShift) -> bool:
    return M.assembly_margin(par, law).length >= 0.0


def mechanism(a1: float, a2: float, a4: float, twist: float, branch: int = 1) -> SliderCrankParameters:
    lengths = {"crank_length": a1, "rod_length": a2, "guide_offset": a4, "guide_twist": twist}
    return SliderCrankParameters(**lengths, crank_mass=1.0, crank_inertia=1.0, assembly_branch=branch)


@st.composite
def mechanisms(draw: st.DrawFn) -> tuple[SliderCrankParameters, float]:
    """Any mechanism and shift, whether it can be assembled or not: about a third turn fully, a third not, a third never."""
    return (
        mechanism(
            draw(st.floats(0.05, 1.0)),
            draw(st.floats(0.1, 3.0)),
            draw(st.floats(-1.5, 1.5)),
            draw(st.floats(-pi, TURN)),
            draw(st.sampled_from((1, -1))),
        ),
        draw(st.floats(-1.5, 1.5)),
    )


def general(count: int) -> Iterator[tuple[SliderCrankParameters, float]]:
    """Mechanisms and shifts with no round numbers, the same on every machine."""
    source = random.Random(5)
    for _ in range(count):
        a1 = source.uniform(0.05, 1.0)
        a4, shift = source.uniform(-1.0, 1.0), source.uniform(-1.0, 1.0)
        twist = source.uniform(-pi, TURN)
        a2 = source.uniform(0.1, 3.0)
        if source.random() < 0.3:
            # a guide that passes through the crank's circle, and a short rod: two ranges
            a2, a4, shift = source.uniform(0.1, 0.9) * a1, 0.1 * a4 * a1, 0.1 * shift * a1
        yield mechanism(a1, a2, a4, twist, source.choice((1, -1))), shift


def squares(par: SliderCrankParameters, shift: np.ndarray | float, angles: np.ndarray) -> np.ndarray:
    """Square of the rod's length less that of the crank pin's distance from the guide, by the distance in space."""
    c, s = np.cos(angles), np.sin(angles)
    pin = np.stack([par.crank_length * c, par.crank_length * s, shift + 0.0 * angles], axis=-1)
    arm = pin + np.array([par.guide_offset, 0.0, 0.0])
    way = np.array([0.0, sin(par.guide_twist), cos(par.guide_twist)])
    return par.rod_length**2 - (np.cross(arm, way) ** 2).sum(axis=-1)


def positions(par: SliderCrankParameters, shift: np.ndarray | float, angles: np.ndarray) -> np.ndarray:
    """Slider positions by the closed form of the notes; NaN where the rod does not reach."""
    c, s = cos(par.guide_twist), sin(par.guide_twist)
    root = squares(par, shift, angles)
    h = par.assembly_branch * np.sqrt(np.where(root >= 0.0, root, nan))
    return -(par.crank_length * np.sin(angles) * s + shift * c) + h


def dead_centres_by_quartic(par: SliderCrankParameters, shift: float) -> list[tuple[float, float, bool]]:
    """All dead centres of both branches at a constant shift: angle, slider position, whether on the mechanism's branch.

    At a dead centre the plane of crank axis and crank pin has the slider pin in it, whose distance R from the axis is
    sqrt(a4^2 + S4^2 sin^2): crank and rod stretched out or folded there, (R -+ a1)^2 + (S1 + S4 cos)^2 = a2^2, which
    squared once more is a quartic in S4.
    """
    a1, a2, a4 = par.crank_length, par.rod_length, par.guide_offset
    c, s = cos(par.guide_twist), sin(par.guide_twist)
    inner = np.array([1.0, 2.0 * shift * c, shift**2 + a4**2 + a1**2 - a2**2])
    quartic = np.polysub(np.polymul(inner, inner), 4.0 * a1 * a1 * np.array([s * s, 0.0, a4 * a4]))
    found = []
    for root in np.roots(quartic):
        if abs(root.imag) > 1e-7 * a2:
            continue
        x = root.real
        # crank towards the slider pin where R is a1 and more, (a1^2 + R^2 - ...) / 2 a1 R being +1
        sign = np.sign(np.polyval(inner, x))
        angle = np.arctan2(-sign * x * s, -sign * a4) % TURN
        beyond = x + a1 * sin(angle) * s + shift * c
        found.append((float(angle), float(x), beyond * par.assembly_branch > 0.0))
    return found


def apart(a: float, b: float, span: float = TURN) -> float:
    """Distance of two angles on the turn."""
    return abs((a - b + 0.5 * span) % span - 0.5 * span)


# ------------------------------------------------------------------ can it be assembled


@several
@given(drawn=mechanisms())
def test_margins_over_the_turn_are_the_extremes_of_a_scan(drawn: tuple[SliderCrankParameters, float]) -> None:
    par, shift = drawn
    angles = np.linspace(0.0, TURN, 2001)
    # squares of the rod's projection on the guide, which have no corner where the rod is across it
    scan = par.rod_length**2 - squares(par, shift, angles)
    least, greatest = (find(par, M.constant_shift(shift)) for find in (M.assembly_margin, M.greatest_margin))
    highest, lowest = ((par.rod_length - margin.length) ** 2 for margin in (least, greatest))
    assert scan.max() - 1e-11 <= highest == pytest.approx(scan.max(), abs=1e-4)
    assert scan.min() + 1e-11 >= lowest == pytest.approx(scan.min(), abs=1e-4)
    for margin in (least, greatest):
        assert 0.0 <= margin.crank_angle < TURN
        there = squares(par, shift, np.array([margin.crank_angle]))[0]
        assert par.rod_length - sqrt(par.rod_length**2 - there) == pytest.approx(margin.length, abs=1e-12)


# ------------------------------------------------------------------ how far the crank turns


def assert_ranges_are_those_of_a_scan(par: SliderCrankParameters, shift: float) -> None:
    law = M.constant_shift(shift)
    found = M.ranges(par, law)
    assert len(found) <= 2
    assert [part.low for part in found] == sorted(part.low for part in found)
    size = par.rod_length**2 + squares(par, shift, np.linspace(0.0, TURN, 50)).min() ** 2
    covered = []
    for part in found:
        assert 0.0 <= part.low < TURN
        assert part.low < part.high <= part.low + TURN
        ends = np.array([part.low, part.high])
        if turns_fully(par, law):
            assert (part.low, part.high) == (0.0, TURN)
        else:
            # at the ends the rod is perpendicular to the guide, to the last digits
            slope = np.abs(squares(par, shift, ends + 1e-6) - squares(par, shift, ends - 1e-6)) / 2e-6
            assert np.all(np.abs(squares(par, shift, ends)) <= 1e-12 * slope + 1e-14 * size)
        inside = np.linspace(part.low, part.high, 203)[1:-1]
        assert np.all(squares(par, shift, inside) >= -1e-12)
        covered.append((part.low, part.high))
    # outside of them nothing reaches
    angles = np.linspace(0.0, TURN, 1441)
    reached = squares(par, shift, angles) > 1e-12
    in_ranges = np.zeros_like(reached)
    for low, high in covered:
        in_ranges |= (angles - low) % TURN <= high - low + 1e-12
    assert not np.any(reached & ~in_ranges)


def test_ranges_of_general_mechanisms() -> None:
    counts = {0: 0, 1: 0, 2: 0}
    for par, shift in general(200):
        assert_ranges_are_those_of_a_scan(par, shift)
        if not turns_fully(par, M.constant_shift(shift)):
            counts[len(M.ranges(par, M.constant_shift(shift)))] += 1
    assert min(counts.values()) > 5  # all three kinds were there


# ------------------------------------------------------------------ greatest shift


@pytest.mark.parametrize("offset_in", rahman.GREATEST_SHIFTS_IN)
def test_greatest_shift_at_right_angles(offset_in: float) -> None:
    for par in (published.parameters(offset_in), published.parameters(-offset_in)):
        greatest = M.greatest_shift(par)
        assert greatest is not None
        assert greatest / INCH == pytest.approx(rahman.GREATEST_SHIFTS_IN[offset_in], abs=6e-4)
        assert greatest / INCH == pytest.approx(sqrt(50.0**2 - (12.0 + offset_in) ** 2), abs=1e-12)


def test_greatest_shift_of_general_mechanisms_is_that_of_a_scan() -> None:
    angles = np.linspace(0.0, TURN, 20001)
    found = 0
    for par, _ in general(60):
        room = par.rod_length**2 - (par.crank_length * np.cos(angles) + par.guide_offset) ** 2
        bounds = np.sqrt(np.maximum(room, 0.0)) + par.crank_length * np.sin(angles) * abs(cos(par.guide_twist))
        greatest = M.greatest_shift(par)
        if greatest is None:
            assert room.min() < 0.0 or bounds.min() < 1e-6
            continue
        found += 1
        assert greatest * abs(sin(par.guide_twist)) == pytest.approx(bounds.min(), abs=1e-6)
        assert greatest * abs(sin(par.guide_twist)) <= bounds.min() + 1e-13
    assert found > 10


def test_any_shift_will_do_along_a_parallel_guide() -> None:
    par = mechanism(0.5, 1.0, 0.2, 0.0)
    assert M.greatest_shift(par) == inf
    assert turns_fully(par, M.constant_shift(1e3))
    assert M.greatest_shift(mechanism(0.5, 1.0, 0.6, 0.0)) is None
    # twisted a little the pin's circle leans from the guide: long enough in one direction, and yet no shift will do
    assert M.greatest_shift(mechanism(0.5, 0.55, 0.0, 0.0)) == inf
    assert M.greatest_shift(mechanism(0.5, 0.51, 0.005, 0.0)) is not None


@pytest.mark.parametrize("turns", [-1.0, 1.0, 2.0, 3.0, 100.0])
def test_a_parallel_guide_is_one_to_the_rounding_of_its_twist(turns: float) -> None:
    assert M.greatest_shift(mechanism(0.5, 1.0, 0.2, turns * pi)) == inf
    # a twist of a hundred-millionth of a degree is none of rounding
    leaning = M.greatest_shift(mechanism(0.5, 1.0, 0.2, pi + radians(1e-8)))
    assert leaning is not None
    assert 1e8 < leaning < 1e11


# ------------------------------------------------------------------ dead centres


def assert_dead_centres_are_all(par: SliderCrankParameters, shift: float) -> None:
    law = M.constant_shift(shift)
    found = M.dead_centres(par, law)
    expected = [(angle, x) for angle, x, here in dead_centres_by_quartic(par, shift) if here]
    assert len(found) == len(expected)
    p = par.constants()
    for centre in found:
        q = K.position(centre.crank_angle, shift, p)
        k = K.coefficients(q, p)
        assert centre.shift == shift
        assert centre.slider_position == pytest.approx(q.s4, abs=1e-12)
        # zero to the rounding of the angle
        slope = K.centripetal(q, k, 1.0, 0.0, p)
        assert abs(k.kth) <= 1e-13 * abs(slope) + 1e-14 * (abs(p.a1 * (abs(q.f) + abs(q.g)) / q.h) + p.a1)
        assert centre.outer == (slope * p.branch < 0.0)
        assert min(apart(centre.crank_angle, angle) + abs(x - q.s4) for angle, x in expected) < 1e-6
    assert M.singularities(par, law) == found
    assert list(found) == sorted(found)
    for part in M.ranges(par, law):
        if turns_fully(par, law):
            assert [centre.outer for centre in part.dead_centres].count(True) == 1
            assert len(part.dead_centres) == 2
        else:
            assert len(part.dead_centres) % 2 == 1
        kinds = [centre.outer for centre in sorted(part.dead_centres, key=lambda d: (d.crank_angle - part.low) % TURN)]
        assert all(a != b for a, b in pairwise(kinds))


def test_dead_centres_of_general_mechanisms_are_those_of_the_quartic() -> None:
    counts = dict.fromkeys(range(5), 0)
    for par, shift in general(150):
        assert_dead_centres_are_all(par, shift)
        counts[len(M.dead_centres(par, M.constant_shift(shift)))] += 1
    assert counts[0] > 10
    assert counts[1] > 10
    assert counts[2] > 10


def assert_stroke_is_that_of_a_scan(par: SliderCrankParameters, law: M.PeriodicShift) -> None:
    for part in M.ranges(par, law):
        # dense at the ends, where h is the root of the distance from them
        share = np.linspace(0.0, 1.0, 4001)
        for _ in range(2):
            share = 0.5 - 0.5 * np.cos(pi * share)
        angles = part.low + (part.high - part.low) * share
        shifts = np.array([law.at(angle)[0] for angle in angles.tolist()])
        scan = positions(par, shifts, angles)
        scan = scan[np.isfinite(scan)]
        tolerance = 1e-5 * (par.rod_length + par.crank_length)
        # at the limit of assembly, at an end or in passing, rounding is a root of it in h
        rounding = 1e-12 if M.assembly_margin(par, law).length > 1e-9 else 1e-7
        assert part.greatest.slider_position >= scan.max() - rounding
        assert part.least.slider_position <= scan.min() + rounding
        assert part.greatest.slider_position == pytest.approx(scan.max(), abs=tolerance)
        assert part.least.slider_position == pytest.approx(scan.min(), abs=tolerance)
        assert part.stroke == part.greatest.slider_position - part.least.slider_position >= 0.0
        for place in (part.greatest, part.least):
            assert place.shift == pytest.approx(law.at(place.crank_angle)[0], abs=1e-12)
            # rounding of the angle is a root of it at the limit of assembly
            root = max(0.0, squares(par, place.shift, np.array([place.crank_angle]))[0])
            th, twist = place.crank_angle, par.guide_twist
            foot = -par.crank_length * sin(th) * sin(twist) - place.shift * cos(twist)
            assert place.slider_position == pytest.approx(foot + par.assembly_branch * sqrt(root), abs=1e-6)


@settings(max_examples=60, derandomize=True, deadline=None)
@given(drawn=mechanisms())
def test_stroke_is_that_of_a_scan(drawn: tuple[SliderCrankParameters, float]) -> None:
    par, shift = drawn
    assert_stroke_is_that_of_a_scan(par, M.constant_shift(shift))


@pytest.mark.parametrize("offset_in", rahman.STROKES_IN)
def test_strokes_of_the_thesiss_mechanism(offset_in: float) -> None:
    # "a4 reduces the stroke" does not hold
    (part,) = M.ranges(published.parameters(offset_in), STILL)
    assert part.stroke / INCH == pytest.approx(rahman.STROKES_IN[offset_in], abs=6e-4)
    # in the plane: sqrt((a2 + a1)^2 - a4^2) - sqrt((a2 - a1)^2 - a4^2)
    planar = sqrt(62.0**2 - offset_in**2) - sqrt(38.0**2 - offset_in**2)
    assert part.stroke / INCH == pytest.approx(planar, abs=1e-12)


@pytest.mark.parametrize("twist_deg", rahman.STROKES_BY_TWIST_IN)
def test_strokes_by_twist(twist_deg: float) -> None:
    (part,) = M.ranges(published.parameters(20.0, twist_deg), STILL)
    assert part.stroke / INCH == pytest.approx(rahman.STROKES_BY_TWIST_IN[twist_deg], abs=6e-3)


@pytest.mark.parametrize("offset_in", rahman.DEAD_CENTRES_DEG)
def test_dead_centres_of_the_thesiss_mechanism(offset_in: float) -> None:
    outer, inner = M.dead_centres(published.parameters(offset_in), STILL)
    angles = (degrees(outer.crank_angle), degrees(inner.crank_angle))
    assert angles == pytest.approx(rahman.DEAD_CENTRES_DEG[offset_in], abs=6e-3)
    assert (outer.outer, inner.outer) == (True, False)
    assert outer.slider_position / INCH == pytest.approx(sqrt(62.0**2 - offset_in**2), abs=1e-12)
    assert inner.slider_position / INCH == pytest.approx(sqrt(38.0**2 - offset_in**2), abs=1e-12)
    assert (outer.shift, inner.shift) == (0.0, 0.0)


def test_in_line_mechanism_has_its_dead_centres_exactly() -> None:
    # at such a symmetric one the zeros of both branches coincide
    for branch in (1, -1):
        par = replace(published.parameters(), assembly_branch=branch)
        first, second = M.dead_centres(par, M.constant_shift(0.3))
        assert (first.crank_angle, second.crank_angle) == pytest.approx((0.5 * pi, 1.5 * pi), abs=1e-13)
        assert (first.outer, second.outer) == ((True, False) if branch == 1 else (False, True))


def test_slider_on_the_crank_axis_that_does_not_move_has_no_dead_centres() -> None:
    # rod as long as from the axis to the crank pin: the slider pin stays where the guide crosses the axis
    par = mechanism(0.5, 0.5, 0.0, pi)
    assert M.dead_centres(par, STILL) == ()
    par = mechanism(0.5, 1.3, 0.0, pi)
    (part,) = M.ranges(par, STILL)
    assert part.dead_centres == ()
    assert part.stroke == pytest.approx(0.0, abs=1e-15)


def test_parallel_guide_has_its_dead_centres_in_the_common_normal() -> None:
    par = mechanism(0.5, 1.5, 0.3, 0.0)
    # S4 = -S1 + root, S1 = 0: furthest where the pin is nearest to the guide, at 180 deg
    near, far = M.dead_centres(par, STILL)
    assert near.crank_angle == pytest.approx(0.0, abs=1e-13) or near.crank_angle == pytest.approx(TURN, abs=1e-13)
    assert far.crank_angle == pytest.approx(pi, abs=1e-13)
    assert (near.outer, far.outer) == (False, True)
    assert (near.slider_position, far.slider_position) == pytest.approx((sqrt(2.25 - 0.64), sqrt(2.25 - 0.04)))


# ------------------------------------------------------------------ laws of the shift


def grooved(par: SliderCrankParameters, amplitude: float, ratio: float) -> SliderCrankParameters:
    return replace(par, groove_amplitude=amplitude, groove_ratio=ratio)


def assert_law_agrees_with_a_scan(par: SliderCrankParameters, law: M.PeriodicShift) -> None:
    """Dead centres and singularities against the changes of sign on a grid, and the ranges' ends."""
    p = par.constants()

    def rates(angle: float) -> tuple[float, float] | None:
        s1, ds1 = law.at(angle)[:2]
        if K.assembly_square(angle, s1, p) <= 0.0:
            return None
        k = K.coefficients(K.position(angle, s1, p), p)
        return k.kth + k.ks * ds1, k.kth

    angles = np.linspace(0.05, 0.05 + law.span, 700 * law.turns).tolist()
    on_grid = [rates(angle) for angle in angles]
    for which, found in enumerate((M.dead_centres(par, law), M.singularities(par, law))):
        crossings = [
            (a, b)
            for a, b, at_a, at_b in zip(angles, angles[1:], on_grid, on_grid[1:])
            if at_a is not None and at_b is not None and (at_a[which] > 0.0) != (at_b[which] > 0.0)
        ]
        # every one of the grid is found; what is found beyond them lies between the grid's points in a pair or at an end
        for a, b in crossings:
            assert any(apart(centre.crank_angle, 0.5 * (a + b), law.span) <= b - a for centre in found)
        for centre in found:
            at = rates(centre.crank_angle)
            around = [rates(centre.crank_angle + h) for h in (-1e-6, 1e-6)]
            if at is None or None in around:
                continue
            slope = abs(around[1][which] - around[0][which]) / 2e-6  # type: ignore[index]
            assert abs(at[which]) <= 1e-8 * slope + 1e-12
            falling = around[0][which] > around[1][which]  # type: ignore[index]
            assert centre.outer == (falling if p.branch > 0 else not falling)


def test_groove_of_general_mechanisms() -> None:
    source = random.Random(8)
    kinds = set()
    for par, _ in general(60):
        model = grooved(par, source.uniform(-0.6, 0.6), source.choice((1.0, 2.0, 3.0, -2.0, 0.5, 1.5, 2.0 / 3.0)))
        law = M.groove_shift(model)
        assert_law_agrees_with_a_scan(model, law)
        assert_stroke_is_that_of_a_scan(model, law)
        margin = M.assembly_margin(model, law)
        angles = np.linspace(0.0, law.span, 3001 * law.turns)
        shifts = model.groove_amplitude * np.sin(model.groove_ratio * angles)
        scan = model.rod_length - np.sqrt(model.rod_length**2 - squares(model, shifts, angles))
        assert margin.length == pytest.approx(scan.min(), abs=1e-4)
        assert margin.length <= scan.min() + 1e-13
        kinds.add((min(len(M.ranges(model, law)), 3), turns_fully(model, law)))
    assert {(0, False), (1, False), (2, False), (1, True)} <= kinds


def test_ends_of_ranges_along_a_groove() -> None:
    model = grooved(published.parameters(30.0), 1.1 * 48.0 * INCH, 3.0)
    law = M.groove_shift(model)
    found = M.ranges(model, law)
    assert len(found) > 2
    assert [part.low for part in found] == sorted(part.low for part in found)
    assert found[-1].high > TURN  # the last goes on past the turn
    for part in found:
        for end in (part.low, part.high):
            shift = model.groove_amplitude * sin(3.0 * end)
            assert squares(model, shift, np.array([end]))[0] == pytest.approx(0.0, abs=1e-12)
        assert len(part.dead_centres) % 2 == 1


@pytest.mark.parametrize(
    ("ratio", "turns"), [(1.0, 1), (2.0, 1), (0.5, 2), (-1.5, 2), (1.0 / 3.0, 3), (2.2, 5), (0.0, 1)]
)
def test_groove_repeats_after_whole_turns(ratio: float, turns: int) -> None:
    model = grooved(published.parameters(10.0), 0.1, ratio)
    law = M.groove_shift(model)
    assert law.turns == turns
    assert law.span == pytest.approx(TURN * turns)
    angles = np.linspace(0.0, law.span, 501).tolist()
    assert max(abs(law.at(angle)[1]) for angle in angles) <= law.rate * (1.0 + 1e-12)
    assert max(abs(K.groove(angle, model.constants()).bend) for angle in angles) <= law.curvature * (1.0 + 1e-12)
    assert M.ranges(model, law)[0].high == law.span


def test_groove_that_does_not_repeat_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"groove\.ratio is 1\.4142.* 64 turns"):
        M.groove_shift(grooved(published.parameters(), 0.1, sqrt(2.0)))


@pytest.mark.parametrize("gap", [0.05, 1e-2, 2e-3])
def test_close_pairs_of_dead_centres_are_found(gap: float) -> None:
    """Along the crank's axis the slider goes with the shift: one that stops it twice, at 1 +- gap, and turns it back.

    S4 = still - S1 is made 0.05 ((2 a^2 - 1) sin u - a/2 sin 2u) with u = theta1 - 1 and a = cos(gap), so that its rate is
    0.05 (a - cos u)(1 + 2 a cos u).
    """
    par, a = mechanism(0.5, 3.0, 0.4, 0.0), cos(gap)

    def law_at(th: float) -> tuple[float, float]:
        u = th - 1.0
        still = sqrt(9.0 - (0.5 * cos(th) + 0.4) ** 2 - 0.25 * sin(th) ** 2)
        moved = (2.0 * a * a - 1.0) * sin(u) - 0.5 * a * sin(2.0 * u)
        return still - 0.05 * moved, 0.2 * sin(th) / still - 0.05 * (a - cos(u)) * (1.0 + 2.0 * a * cos(u))

    law = M.PeriodicShift(at=law_at, rate=1.0, curvature=1.0)
    others = [1.0 - np.arccos(-0.5 / a) + TURN, 1.0 + np.arccos(-0.5 / a)]
    angles = [centre.crank_angle for centre in M.dead_centres(par, law)]
    assert angles == pytest.approx(sorted([1.0 - gap, 1.0 + gap, *others]), abs=1e-8)


def test_a_constant_shift_is_a_number_or_a_text_with_its_unit() -> None:
    assert M.constant_shift("3.5 in").at(0.0)[0] == pytest.approx(0.0889, rel=1e-14)


# ------------------------------------------------------------------ what is refused


@pytest.mark.parametrize("shift", [nan, inf, -inf])
def test_shift_that_is_not_finite_is_refused(shift: float) -> None:
    with pytest.raises(InputError, match="shift is"):
        M.constant_shift(shift)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rate": -1.0}, "rate is -1.0"),
        ({"rate": nan}, "rate is nan"),
        ({"curvature": inf}, "curvature is inf"),
        ({"turns": 0}, "turns are 0"),
        ({"turns": 1.5}, "turns are 1.5"),
        ({"turns": True}, "turns are True"),
        ({"at": lambda th: (0.1 * th, 0.1)}, r"0 m at 0 and 0\.628\d* m after 1 turns"),
        ({"at": lambda th: (nan, 0.0)}, "nan m at 0"),
    ],
)
def test_law_that_is_none_is_refused(changes: dict[str, object], message: str) -> None:
    law = {"at": lambda th: (0.1 * sin(th), 0.1 * cos(th)), "rate": 0.1, "curvature": 0.1} | changes
    with pytest.raises(InputError, match=message):
        M.PeriodicShift(**law)  # type: ignore[arg-type]


def test_law_beyond_its_bound_is_refused_where_it_is() -> None:
    law = M.PeriodicShift(at=lambda th: (0.1 * sin(th), 0.1 * cos(th)), rate=0.05, curvature=0.1)
    with pytest.raises(InputError, match=r"crank angle .* 0\.05 m/rad"):
        M.dead_centres(published.parameters(), law)


@pytest.mark.parametrize(("rod", "offset"), [(0.1, 0.0), (0.3, 0.2), (0.3, -0.2), (0.1 * (1.0 - 1e-16), 0.0)])
@pytest.mark.parametrize("twist", [0.5 * pi, radians(310.0)])
def test_a_rod_that_just_reaches_the_guide_does_so_whatever_the_rounding(
    rod: float, offset: float, twist: float
) -> None:
    par, law = mechanism(0.1, rod, offset, twist), M.constant_shift(0.0)
    assert M.assembly_margin(par, law).length == M.greatest_shift(par) == 0.0
    (whole,) = M.ranges(par, law)
    assert (whole.low, whole.high) == (0.0, 2.0 * pi)
