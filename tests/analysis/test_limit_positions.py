"""Dead centres, toggles, time ratio and mechanical advantage against the linkage's own motion."""

from __future__ import annotations

from math import acos, cos, pi, sqrt

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from analysis.numerics.fourier import FourierSeries
from analysis.synthesis import (
    QUICK_SEARCH,
    LeastTransmission,
    Linkage,
    RockerFunction,
    SliderMotion,
    TimeRatio,
    dead_centres,
    mechanical_advantage,
    synthesize,
    time_ratio,
    toggles,
)
from linkwork.errors import ParameterError

links = st.floats(0.05, 1.0)


@st.composite
def four_bars(draw: st.DrawFn) -> Linkage:
    ground, crank, coupler, rocker = (draw(links) for _ in range(4))
    longest, total = max(ground, crank, coupler, rocker), ground + crank + coupler + rocker
    assume(longest < 0.97 * (total - longest))
    # next to a change point the links come to lie in one line, all at once
    assume(abs(2.0 * (longest + min(ground, crank, coupler, rocker)) - total) > 0.03)
    return Linkage(
        ground_length=ground,
        crank_length=crank,
        coupler_length=coupler,
        rocker_length=rocker,
        crank_phase=draw(st.floats(-3.0, 3.0)),
        branch=draw(st.sampled_from([1, -1])),
    )


def rate(linkage: Linkage, rotation: float) -> float:
    """Speed of the rocker for a crank speed of 1, by a difference."""
    ahead, behind = linkage.rocker_angle(np.array([rotation - 1e-6, rotation + 1e-6]))
    return float(behind - ahead) / 2e-6


@settings(max_examples=100, deadline=None)
@given(four_bars())
def test_the_rocker_rests_in_its_dead_centres_and_nowhere_else(linkage: Linkage) -> None:
    rests = dead_centres(linkage)
    for at in rests:
        pins = linkage.pins(at) if np.isfinite(linkage.path([at])).all() else None
        if pins is None or linkage.transmission([at])[0] < 0.01:
            continue
        assert rate(linkage, at) == pytest.approx(0.0, abs=1e-4)
    phi = np.linspace(0.0, 2.0 * pi, 2881)
    th4 = linkage.rocker_angle(phi)
    speed = np.diff(th4)
    # a change of sign, but no step over a gap
    turned = phi[1:-1][(np.abs(speed[:-1]) < 0.1) & (np.abs(speed[1:]) < 0.1) & (speed[:-1] * speed[1:] < 0.0)]
    for at in turned:
        away = [abs((at - rest + pi) % (2.0 * pi) - pi) for rest in rests]
        assert min(away, default=pi) < 0.01


@settings(max_examples=100, deadline=None)
@given(four_bars())
def test_the_crank_goes_to_its_toggles(linkage: Linkage) -> None:
    found = toggles(linkage)
    assert (len(found) == 0) == linkage.turns_fully
    phi = np.linspace(0.0, 2.0 * pi, 1441)
    joined = np.isfinite(linkage.path(phi)).all(axis=1)
    ends = phi[1:][joined[1:] != joined[:-1]]
    for end in ends:
        assert min(abs((end - at + pi) % (2.0 * pi) - pi) for at in found) < 0.01


@settings(max_examples=60, deadline=None)
@given(four_bars(), st.floats(0.0, 6.0))
def test_the_advantage_is_the_ratio_of_speeds(linkage: Linkage, rotation: float) -> None:
    assume(np.isfinite(linkage.path([rotation])).all())
    assume(linkage.transmission([rotation])[0] > 0.1)
    speed = rate(linkage, rotation)
    assume(abs(speed) > 1e-3)
    assert float(mechanical_advantage(linkage, rotation)) == pytest.approx(1.0 / speed, rel=1e-4)


def test_a_quick_return_by_hand() -> None:
    """Links 4, 1, 3.2, 2: the angles of A to C stretched and folded by the law of cosines."""
    linkage = Linkage(ground_length=4.0, crank_length=1.0, coupler_length=3.2, rocker_length=2.0)
    stretched = acos((16.0 + 4.2**2 - 4.0) / (8.0 * 4.2))
    folded = acos((16.0 + 2.2**2 - 4.0) / (8.0 * 2.2))
    assert dead_centres(linkage) == pytest.approx(sorted([stretched, folded + pi]))
    way = folded + pi - stretched
    assert time_ratio(linkage) == pytest.approx(max(way, 2.0 * pi - way) / min(way, 2.0 * pi - way))


def test_a_central_crank_rocker_has_the_ratio_one() -> None:
    """l1^2 + l2^2 = l3^2 + l4^2: the dead centres are half a turn apart."""
    linkage = Linkage(ground_length=1.0, crank_length=0.3, coupler_length=0.9, rocker_length=sqrt(1.09 - 0.81))
    assert time_ratio(linkage) == pytest.approx(1.0, abs=1e-12)


def test_no_time_ratio_without_a_swinging_rocker() -> None:
    drag = Linkage(ground_length=0.2, crank_length=0.6, coupler_length=0.5, rocker_length=0.6)
    assert drag.grashof == "drag-link"
    assert dead_centres(drag) == ()
    assert time_ratio(drag) is None
    with pytest.raises(ParameterError, match="pivot"):
        toggles(Linkage(**drag.values() | {"pivot": SliderMotion(FourierSeries.constant(0.1))}))


def test_a_time_ratio_is_kept_by_the_search() -> None:
    phi = np.linspace(0.0, 2.0 * pi, 12, endpoint=False)
    task = RockerFunction(angle=[1.6 + 0.3 * cos(t) for t in phi], rotation=phi, mounting=True)
    wanted = [TimeRatio(least=1.25, greatest=1.4), LeastTransmission(angle=0.5)]
    free = synthesize(task, constraints=wanted[1:], search=QUICK_SEARCH).best
    held = synthesize(task, constraints=wanted, search=QUICK_SEARCH).best
    ratio = time_ratio(held.linkage)
    assert ratio is not None
    assert 1.25 - 1e-6 <= ratio <= 1.4 + 1e-6
    assert held.error > free.error
