"""Dead centres, toggles, time ratio and mechanical advantage against the linkage's own motion."""

from math import acos, cos, pi, radians
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import analysis.synthesis as syn
from analysis.numerics.fourier import FourierSeries
from linkwork.errors import InputError, ParameterError

links = st.floats(0.05, 1.0)


@st.composite
def four_bars(draw: st.DrawFn) -> syn.Linkage:
    ground, crank, coupler, rocker = (draw(links) for _ in range(4))
    longest, total = max(ground, crank, coupler, rocker), ground + crank + coupler + rocker
    assume(longest < 0.97 * (total - longest))
    # next to a change point the links come to lie in one line, all at once
    assume(abs(2.0 * (longest + min(ground, crank, coupler, rocker)) - total) > 0.03)
    return syn.Linkage(
        ground_length=ground,
        crank_length=crank,
        coupler_length=coupler,
        rocker_length=rocker,
        crank_phase=draw(st.floats(-3.0, 3.0)),
        branch=draw(st.sampled_from([1, -1])),
    )


def rate(linkage: syn.Linkage, rotation: float) -> float:
    """Speed of the rocker for a crank speed of 1, by a difference."""
    ahead, behind = linkage.rocker_angle(np.array([rotation - 1e-6, rotation + 1e-6]))
    return float(behind - ahead) / 2e-6


@settings(max_examples=100)
@given(four_bars())
def test_the_rocker_rests_in_its_dead_centres_and_nowhere_else(linkage: syn.Linkage) -> None:
    rests = syn.dead_centres(linkage)
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


@settings(max_examples=100)
@given(four_bars())
def test_the_crank_goes_to_its_toggles(linkage: syn.Linkage) -> None:
    found = syn.toggles(linkage)
    assert (len(found) == 0) == linkage.turns_fully
    phi = np.linspace(0.0, 2.0 * pi, 1441)
    joined = np.isfinite(linkage.path(phi)).all(axis=1)
    ends = phi[1:][joined[1:] != joined[:-1]]
    for end in ends:
        assert min(abs((end - at + pi) % (2.0 * pi) - pi) for at in found) < 0.01


@settings(max_examples=60)
@given(four_bars(), st.floats(0.0, 6.0))
def test_the_advantage_is_the_ratio_of_speeds(linkage: syn.Linkage, rotation: float) -> None:
    assume(np.isfinite(linkage.path([rotation])).all())
    assume(linkage.transmission([rotation])[0] > 0.1)
    speed = rate(linkage, rotation)
    assume(abs(speed) > 1e-3)
    assert float(syn.mechanical_advantage(linkage, rotation)) == pytest.approx(1.0 / speed, rel=1e-4)


def test_a_quick_return_by_hand() -> None:
    """Links 4, 1, 3.2, 2: the angles of A to C stretched and folded by the law of cosines."""
    linkage = syn.Linkage(ground_length=4.0, crank_length=1.0, coupler_length=3.2, rocker_length=2.0)
    stretched = acos((16.0 + 4.2**2 - 4.0) / (8.0 * 4.2))
    folded = acos((16.0 + 2.2**2 - 4.0) / (8.0 * 2.2))
    assert syn.dead_centres(linkage) == pytest.approx(sorted([stretched, folded + pi]))
    way = folded + pi - stretched
    assert syn.time_ratio(linkage) == pytest.approx(max(way, 2.0 * pi - way) / min(way, 2.0 * pi - way))


def test_no_time_ratio_without_a_swinging_rocker() -> None:
    drag = syn.Linkage(ground_length=0.2, crank_length=0.6, coupler_length=0.5, rocker_length=0.6)
    assert drag.grashof == "drag-link"
    assert syn.dead_centres(drag) == ()
    assert syn.time_ratio(drag) is None
    with pytest.raises(ParameterError, match="pivot"):
        syn.dead_centres(syn.Linkage(**drag.values() | {"pivot": syn.SliderMotion(FourierSeries.constant(0.1))}))


def test_a_time_ratio_is_kept_by_the_search() -> None:
    phi = np.linspace(0.0, 2.0 * pi, 12, endpoint=False)
    task = syn.RockerFunction(angle=[1.6 + 0.3 * cos(t) for t in phi], rotation=phi, mounting=True)
    wanted = [syn.TimeRatio(least=1.25, greatest=1.4), syn.LeastTransmission(angle=0.5)]
    free = syn.synthesize(task, constraints=wanted[1:], search=syn.QUICK_SEARCH).best
    held = syn.synthesize(task, constraints=wanted, search=syn.QUICK_SEARCH).best
    ratio = syn.time_ratio(held.linkage)
    assert 1.25 - 1e-6 <= ratio <= 1.4 + 1e-6
    assert held.error > free.error


PHI = np.linspace(0.0, 2.0 * pi, 24, endpoint=False)
SWING = syn.RockerFunction(angle=1.6 + 0.6 * np.cos(PHI), rotation=PHI, mounting=True)
LOOP = syn.UntimedPath(path=syn.TargetPath(points=np.column_stack([np.cos(PHI), 0.5 * np.sin(PHI)]), closed=True))
WAY = np.linspace(0.0, radians(100.0), 11)
PART = syn.RockerFunction(angle=1.0 + 0.3 * WAY**2, rotation=WAY, mounting=True)
CLEAR, ANY = syn.LeastTransmission(angle=0.5), syn.LeastTransmission(angle=0.0, over="task")
FEW = syn.Search(starts=4, candidates=1 << 12, solutions=3)


def advantage(linkage: syn.Linkage, rotation: Any) -> np.ndarray:
    """By differences of the rocker's angle, which know nothing of velocity coefficients."""
    phi = np.atleast_1d(np.asarray(rotation, dtype=float))
    ahead, behind = (np.array([linkage.rocker_angle([at + step])[0] for at in phi]) for step in (1e-5, -1e-5))
    with np.errstate(divide="ignore"):
        found: np.ndarray = 2e-5 / np.abs((ahead - behind + pi) % (2.0 * pi) - pi)
    return found


def solutions(task: Any, *constraints: Any) -> tuple[syn.Solution, ...]:
    return syn.synthesize(task, constraints=constraints, search=FEW).solutions


@pytest.mark.slow
@pytest.mark.parametrize("task", [SWING, LOOP])
def test_a_least_advantage_holds_all_the_way(task: Any) -> None:
    turn = np.linspace(0.0, 2.0 * pi, 2881)
    constraints = (CLEAR, syn.LargestLink(length=4.0)) if isinstance(task, syn.UntimedPath) else (CLEAR,)
    free = solutions(task, *constraints)[0]
    bound = 1.2 * float(advantage(free.linkage, turn).min())
    for s in solutions(task, *constraints, syn.MechanicalAdvantage(least=bound)):
        assert advantage(s.linkage, turn).min() >= bound * (1.0 - 1e-6)
    best = solutions(task, *constraints, syn.MechanicalAdvantage(least=bound))[0]
    # between two of the rotations where it is held, too, and no more than asked
    assert advantage(best.linkage, turn).min() == pytest.approx(bound, rel=1e-4)
    assert best.error > free.error


def test_an_advantage_at_crank_rotations() -> None:
    at = np.radians([30.0, 200.0])
    (best, *_) = solutions(SWING, CLEAR, syn.MechanicalAdvantage(least=10.0, at=["30 deg", "200 deg"]))
    assert advantage(best.linkage, at).min() == pytest.approx(10.0, rel=1e-3)
    (best, *_) = solutions(SWING, CLEAR, syn.MechanicalAdvantage(greatest=1.5, at="90 deg"))
    assert float(advantage(best.linkage, 0.5 * pi)[0]) == pytest.approx(1.5, rel=1e-3)


@pytest.mark.parametrize(("position", "at"), [("stretched", 20.0), ("folded", 160.0), ("stretched", (5.0, 12.0))])
def test_a_dead_centre_is_where_it_is_asked(position: Any, at: Any) -> None:
    asked = syn.DeadCentre(at=tuple(np.radians(at)) if isinstance(at, tuple) else f"{at} deg", position=position)
    for s in solutions(SWING, CLEAR, asked):
        linkage, (low, high) = s.linkage, np.radians(at if isinstance(at, tuple) else (at, at))
        found = []
        for rest in syn.dead_centres(linkage):
            pins = {name: complex(*place) for name, place in linkage.pins(rest).items()}
            along = ((pins["C"] - pins["B"]) / (pins["B"] - pins["A"])).real
            if (along > 0.0) == (position == "stretched"):
                found.append(rest)
        assert any(low - 1e-6 <= rest + k * 2.0 * pi <= high + 1e-6 for rest in found for k in (-1, 0))


@pytest.mark.parametrize(("position", "at"), [("stretched", 110.0), ("folded", (105.0, 115.0))])
def test_a_toggle_is_where_it_is_asked(position: Any, at: Any) -> None:
    low, high = np.radians(at if isinstance(at, tuple) else (at, at))
    for s in solutions(PART, ANY, syn.Toggle(at=(low, high), position=position)):
        l3, l4 = s.linkage.coupler_length, s.linkage.rocker_length
        reach = l3 + l4 if position == "stretched" else abs(l3 - l4)
        found = []
        for place in syn.toggles(s.linkage):
            th2 = place + s.linkage.crank_phase
            distance = abs(s.linkage.ground_length - s.linkage.crank_length * np.exp(1j * th2))
            if distance == pytest.approx(reach, rel=1e-6):
                found.append(place)
        assert any(low - 1e-6 <= place + k * 2.0 * pi <= high + 1e-6 for place in found for k in (-1, 0))


def test_no_toggle_in_a_range() -> None:
    begin, end = radians(-40.0), radians(150.0)
    free, held = solutions(PART, ANY), solutions(PART, ANY, syn.NoToggle(between=(begin, end)))

    def inside(s: syn.Solution) -> bool:
        return any(begin <= at + k * 2.0 * pi <= end for at in syn.toggles(s.linkage) for k in (-1, 0))

    assert any(inside(s) for s in free)
    assert not any(inside(s) for s in held)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: syn.MechanicalAdvantage(least=2.0, greatest=1.0), "two numbers in order"),
        (lambda: syn.MechanicalAdvantage(least=2.0, at=[]), "finite numbers"),
        (lambda: syn.DeadCentre(at="3 mm"), "at is"),
        (lambda: syn.DeadCentre(at=(2.0, 1.0)), "in order"),
        (lambda: syn.DeadCentre(at=(0.0, 4.0)), "less than 3.142 rad apart"),
        (lambda: syn.Toggle(at=1.0, position="bent"), "stretched, folded"),
        (lambda: syn.NoToggle(between="a while"), "between is"),
    ],
)
def test_what_is_not_usable_is_refused(made: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        made()


@pytest.mark.parametrize(
    ("task", "constraint", "message"),
    [
        (SWING, syn.Toggle(at=1.0), "cannot turn fully"),
        (syn.SliderFunction(position=[0.0, 1.0, 0.5]), syn.MechanicalAdvantage(greatest=9.0), "rests twice"),
        (LOOP, syn.DeadCentre(at=1.0), "gives none"),
        (LOOP, syn.MechanicalAdvantage(least=1.0, at=[0.3]), "gives none"),
    ],
)
def test_what_contradicts_the_task_is_refused(task: Any, constraint: Any, message: str) -> None:
    with pytest.raises((InputError, syn.InfeasibleError), match=message):
        solutions(task, syn.FullTurn(), constraint)
