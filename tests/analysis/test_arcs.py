"""Stable parts of branches, jumps at folds, and the ranges to avoid, on curves known by formulas."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.cli.vibration import _print_ranges_to_avoid
from analysis.periodic import Branch, Crossing, FoldJump, Response, Risk, arcs, fold_jumps, ranges_to_avoid

from .periodic_branches import branch, hysteresis, response

X = np.linspace(90.0, 110.0, 801)


def resonant(width: float = 1.5) -> np.ndarray:
    """An amplitude whose half-power points are 100 - width and 100 + width."""
    return 1.0 / np.sqrt(1.0 + ((X - 100.0) / width) ** 2)


def found(*branches: Branch) -> dict[Risk, list[tuple[float, float]]]:
    """The ranges to avoid by their reasons."""
    ranges: dict[Risk, list[tuple[float, float]]] = {}
    for avoided in response(*branches).speeds_to_avoid:
        ranges.setdefault(avoided.risk, []).append((avoided.low, avoided.high))
    return ranges


def single(low: float, high: float) -> Branch:
    """A motion of amplitude 1 that is unstable between two period doublings."""
    doublings = [(Crossing.PERIOD_DOUBLING, at, 1.0, int((at > X).sum()) - 1) for at in (low, high)]
    return branch(X, np.ones(len(X)), np.where((low < X) & (high > X), 1.2, 0.9), doublings)


def test_half_power_band_of_a_resonance() -> None:
    (band,) = found(branch(X, resonant(), 0.9)).pop(Risk.RESONANCE)
    assert band == pytest.approx((98.5, 101.5), abs=1e-3)
    assert list(found(branch(X, resonant(), 0.9))) == [Risk.RESONANCE]


def test_a_peak_that_does_not_come_down_on_one_side_is_none() -> None:
    x = X[X < 107.0]
    ripple = 1.0 + 0.2 * (x - 90.0) + 0.3 * np.sin(x)
    assert (np.diff(ripple) < 0.0).any()
    assert not found(branch(x, ripple, 0.9))


def test_a_band_is_cut_where_the_range_ends() -> None:
    part = X > 99.2
    (band,) = found(branch(X[part], resonant()[part], 0.9))[Risk.RESONANCE]
    assert band == pytest.approx((X[part][0], 101.5), abs=1e-3)


@pytest.mark.parametrize("backwards", [False, True])
def test_jumps_of_a_hysteresis(backwards: bool) -> None:
    curve = hysteresis()
    if backwards:
        special = [(s.kind, s.parameter, s.orbit.amplitude, len(curve) - 2 - s.after) for s in reversed(curve.special)]
        curve = branch(curve.parameter[::-1], curve.amplitude[::-1], curve.largest_multiplier[::-1], special)
    down, up = fold_jumps([curve])
    assert (up.parameter, up.direction, up.before) == (102.0, 1, 1.0)
    assert up.after == pytest.approx((4.0,), abs=1e-4)
    assert (down.parameter, down.direction, down.before) == (98.0, -1, 3.0)
    assert down.after == pytest.approx((0.0,), abs=1e-4)
    assert [(arc.stable, *arc.span) for arc in arcs([curve])][1] == (False, 98.0, 102.0)
    assert found(curve)[Risk.SEVERAL] == [(98.0, 102.0)]
    assert Risk.UNSTABLE not in found(curve)


def test_where_nothing_else_was_followed_a_fold_has_no_goal() -> None:
    curve = hysteresis()
    half = slice(0, 150)
    lower = branch(curve.parameter[half], curve.amplitude[half], 0.5, [(Crossing.FOLD, 102.0, 1.0, 112)])
    assert lower.amplitude[112] < 1.0 < lower.amplitude[113]
    assert fold_jumps([lower]) == (FoldJump(parameter=102.0, direction=1, before=1.0, after=()),)


def test_a_curve_that_was_followed_from_both_ends_is_one_motion() -> None:
    up, down = branch(X, resonant(), 0.9), branch(X[::-1], resonant()[::-1], 0.9)
    assert list(found(up, down)) == [Risk.RESONANCE]
    other = branch(X, 2.0 * resonant(), 0.9)
    assert found(up, other)[Risk.SEVERAL] == [(90.0, 110.0)]
    curve = hysteresis()
    assert fold_jumps([curve, hysteresis(433)]) == fold_jumps([curve])


@pytest.mark.parametrize("greatest", [5.0, 50.0])
def test_a_resonance_without_damping(greatest: float) -> None:
    """The curve from either side ends where its amplitude is ``greatest`` times the scale."""
    away = np.geomspace(1.0 / greatest, 10.0, 100)
    ranges = found(branch(100.0 - away[::-1], 1.0 / away[::-1], 0.9), branch(100.0 + away, 1.0 / away, 0.9))
    risk = Risk.UNBOUNDED if greatest > 10.0 else Risk.UNSTABLE
    assert ranges[risk] == [pytest.approx((100.0 - 1.0 / greatest, 100.0 + 1.0 / greatest))]


def test_doubled_motions_and_none() -> None:
    simple = single(98.0, 102.0)
    x = np.linspace(98.0, 101.0, 50)
    # the doubled branch turns back on itself where it begins: that is no fold at which a motion ends
    doubled = branch(x, np.sqrt(1.0 + x - 98.0), 0.9, [(Crossing.FOLD, 98.0, 1.0, 0)], turns=2)
    ranges = found(simple, doubled)
    assert ranges[Risk.DOUBLED] == [pytest.approx((98.0, 101.0))]
    assert ranges[Risk.UNSTABLE] == [pytest.approx((101.0, 102.0))]
    assert not fold_jumps([simple, doubled])
    beside = branch(np.linspace(102.5, 104.0, 50), np.full(50, 3.0), 0.9, turns=2)
    assert found(simple, doubled, beside)[Risk.SEVERAL] == [pytest.approx((102.5, 104.0))]


def test_a_doubled_motion_is_stable_from_its_doubling_on() -> None:
    """Its branch is followed from a step beyond the doubling on, and to a step before the other one."""
    doubled = branch(np.linspace(98.01, 101.99, 50), np.full(50, 1.01), 0.9, turns=2)
    ranges = found(single(98.0 + 1e-9, 102.0 - 1e-9), doubled)
    assert ranges[Risk.DOUBLED] == [(98.0 + 1e-9, 102.0 - 1e-9)]
    assert Risk.UNSTABLE not in ranges


def test_a_stable_stretch_between_two_unstable_ones_is_not_avoided() -> None:
    gaps = ((92.0, 95.0), (103.0, 106.0))
    multiplier = np.where(np.any([(low < X) & (high > X) for low, high in gaps], axis=0), 1.2, 0.9)
    doublings = [(Crossing.PERIOD_DOUBLING, at, 1.0, int((at > X).sum()) - 1) for at in (92.0, 95.0, 103.0, 106.0)]
    simple = branch(X, np.ones(len(X)), multiplier, doublings)
    pieces = [branch(np.linspace(low, high - 1.0, 50), np.full(50, 2.0), 0.9, turns=2) for low, high in gaps]
    ranges = found(simple, *pieces)
    assert ranges[Risk.DOUBLED] == [pytest.approx((low, high - 1.0)) for low, high in gaps]
    assert ranges[Risk.UNSTABLE] == [pytest.approx((high - 1.0, high)) for _, high in gaps]


def test_a_motion_without_damping_is_not_unstable() -> None:
    assert Risk.UNSTABLE not in found(branch(X, resonant(), 1.0))
    assert found(branch(X, resonant(), 1.001)) == {Risk.UNSTABLE: [(90.0, 110.0)]}


def test_what_is_outside_of_the_branches_has_no_stable_motion() -> None:
    inside = branch(X, np.ones(len(X)), 0.9)
    outside = [(a.low, a.high, a.risk) for a in ranges_to_avoid([inside], 80.0, 111.0)]
    assert outside == [(80.0, 90.0, Risk.UNSTABLE), (110.0, 111.0, Risk.UNSTABLE)]


def test_a_maximum_that_is_no_resonance_is_not_denied(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr("analysis.cli.vibration.common.say", said.append)
    flat = response(branch(X, 1.0 - 4e-4 * ((X - 103.0) / 10.0) ** 2, 0.9))
    assert not flat.maxima()
    _print_ranges_to_avoid(replace(flat, sought=3), 1.0, "kg")
    assert said[0] == "all motions were sought at 3 values of p only: more --places may find more"
    assert said[-1].endswith("the amplitude has no peak; it is greatest, 1000 mm, at 103 kg")
    monkeypatch.setattr(Response, "maxima", lambda self: ("one, above which the amplitude rises",))
    _print_ranges_to_avoid(flat, 1.0, "kg")
    assert said[-1].endswith("at no maximum does the amplitude fall to 0.71 of it on both sides")
