"""Response over the speed: against the reference numbers, long runs, and the statements of the thesis."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import pi
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from analysis import Inputs, figures, periodic, simulate
from analysis.periodic.response import frequency as resonance
from analysis.units import RAD_S_PER_RPM
from analysis.youssef import approximations
from linkwork.errors import AssemblyError, InputError, ParameterError
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests.published import LOCAL_MAXIMUM_RPM, MINIMUM_RPM
from tests.refusals import refused

RPM = RAD_S_PER_RPM
RIG = {spring: SETS[f"rig-{1 if spring in 'ab' else 2}-spring-{spring}"].parameters for spring in "abcd"}


@pytest.fixture(scope="module")
def response_b():  # type: ignore[no-untyped-def]
    return periodic.frequency_response(RIG["b"], 100.0 * RPM, 1300.0 * RPM)


def test_natural_frequency_needs_a_spring_and_a_turn() -> None:
    with pytest.raises(ParameterError, match=r"slider\.stiffness"):
        periodic.natural_frequency(replace(TABLE_3_1, slider_stiffness=0.0))
    with pytest.raises(AssemblyError):
        periodic.natural_frequency(replace(TABLE_3_1, coupler_length=0.05))


def test_rig_1_spring_a_has_its_maximum_and_minimum_where_the_reference_has_them() -> None:
    response = periodic.frequency_response(RIG["a"], 100.0 * RPM, 1300.0 * RPM)
    assert not response.problems
    assert len(response.branches) == 1
    assert min(abs(e.parameter / RPM - LOCAL_MAXIMUM_RPM["a"].right) for e in response.maxima()) < 0.5
    assert min(abs(e.parameter / RPM - MINIMUM_RPM["a"].right) for e in response.minima()) < 0.5
    assert set(response.branches[0].stability()) == {periodic.Stability.STABLE}


@pytest.mark.slow
def test_rig_1_spring_b_folds_and_doubles(response_b) -> None:  # type: ignore[no-untyped-def]
    low, high, doubled = response_b.branches
    assert min(abs(e.parameter / RPM - LOCAL_MAXIMUM_RPM["b"].right) for e in response_b.maxima()) < 0.5
    assert [s.kind for s in low.special] == [periodic.Crossing.FOLD]
    # runs from rest jump between 1035 and 1040 rpm
    assert 1035.0 < low.special[0].parameter / RPM < 1040.0
    assert periodic.Crossing.PERIOD_DOUBLING in {s.kind for s in high.special}
    assert doubled.turns == 2
    # what ends early is told, with where
    early = [problem for problem in response_b.problems if "is followed from drive.speed" in problem]
    assert len(early) == 3
    assert all("only:" in problem and "rpm" in problem for problem in early)
    assert all("twice the period" in problem for problem in response_b.problems if problem not in early)
    # multiple shooting takes both branches of one turn to where the links come to the limit of assembly
    for branch in (low, high):
        assert branch.orbits[-1].largest > 1e5
        assert min(orbit.clearance() for orbit in branch.orbits[-5:]) < 0.02


@pytest.mark.parametrize("rpm", [300.0, 560.0, 900.0])
def test_amplitude_is_that_of_a_long_run_from_rest(response_b, rpm: float) -> None:  # type: ignore[no-untyped-def]
    low = response_b.branches[0]
    stable = low.special[0].after
    amplitude = np.interp(rpm * RPM, low.parameter[:stable], low.amplitude[:stable])
    period = 60.0 / rpm
    run = simulate(RIG["b"], Inputs(speed=rpm * RPM), stop_time=200 * period, step=period / 360)
    assert amplitude == pytest.approx(0.5 * np.ptp(run["slider.position"][-361:]), rel=2e-3)


def test_sweeps_up_and_down_jump_at_different_speeds() -> None:
    speeds = np.arange(960.0, 1101.0, 10.0) * RPM
    up, down = periodic.sweep(RIG["b"], speeds), periodic.sweep(RIG["b"], speeds[::-1])
    assert [round(jump.speed / RPM) for jump in up.jumps] == [1040]
    assert up.jumps[0].amplitude_after > 2.5 * up.jumps[0].amplitude_before
    assert not down.jumps
    shared = np.abs(up.amplitude - down.amplitude[::-1]) < 1e-9
    assert shared[speeds > 1036.0 * RPM].all()
    assert not shared[speeds < 1035.0 * RPM].any()


def test_a_coarse_step_over_the_fold_is_a_jump_too() -> None:
    # Newton's method may land on the other motion by itself
    result = periodic.sweep(RIG["b"], np.array([1030.0, 1060.0, 1080.0]) * RPM)
    assert len(result.jumps) == 1
    assert result.jumps[0].speed == pytest.approx(1060.0 * RPM)


def test_a_falling_sweep_doubles_its_period_and_is_lost_with_a_flag() -> None:
    result = periodic.sweep(RIG["b"], np.arange(940.0, 899.0, -5.0) * RPM, start=upper_start())
    assert result.turns[0] == 1
    assert 2 in result.turns
    lost = [flag for orbit, flag in zip(result.orbits, result.flags) if orbit is None]
    assert lost
    assert all("limit of assembly" in flag or "no steady motion" in flag for flag in lost)
    assert result.amplitude.mask.sum() == len(lost)
    assert all(not flag for orbit, flag in zip(result.orbits, result.flags) if orbit is not None)


def upper_start() -> np.ndarray:
    """Start of the large motion of rig 1 with spring B at 940 rpm, met from above."""
    orbit = periodic.sweep(RIG["b"], np.arange(1100.0, 939.0, -10.0) * RPM).orbits[-1]
    assert orbit is not None
    return orbit.start


def test_friction_removes_the_coexistence() -> None:
    response = periodic.frequency_response(replace(RIG["b"], slider_coulomb_friction=20.0), 900.0 * RPM, 1200.0 * RPM)
    assert not response.problems
    assert not any(branch.special for branch in response.branches)


def test_approximations_hidden_under_the_true_motion_are_drawn_by_their_errors() -> None:
    near = periodic.frequency_response(RIG["c"], 500.0 * RPM, 700.0 * RPM)
    main, _, errors, *rest = figures.plot(near, beside=approximations(near, points=5)).axes
    assert rest[-1].get_xlabel() == "crank speed [rpm]"
    named = [text.get_text() for text in main.get_legend().get_texts()]
    assert named == ["stable motion", "avoid: resonance, above 0.71 of the peak"]
    drawn = {line.get_label(): line for line in errors.lines}
    assert list(drawn) == ["two harmonics", "ten harmonics"]
    x, error = drawn["two harmonics"].get_data()
    place = int(np.argmax(x > 600.0))
    orbit = periodic.find_orbit(RIG["c"], speed=float(x[place]) * RPM)
    linear = approximations(near, points=2).at(x[place] * RPM)["two harmonics"]
    assert error[place] == pytest.approx(100.0 * abs(linear / orbit.amplitude - 1.0), rel=1e-3)


@pytest.mark.slow
def test_approximations_that_can_be_seen_are_in_the_legend() -> None:
    far = periodic.frequency_response(RIG["b"], 900.0 * RPM, 1100.0 * RPM)
    main = figures.plot(far, beside=approximations(far, points=5)).axes[0]
    assert "approximation, two harmonics" in [text.get_text() for text in main.get_legend().get_texts()]
    assert "approximation, two harmonics" in [line.get_label() for line in main.lines]


def test_approximations_beside_the_true_motion() -> None:
    # rig 2 has a short crank: the linear equation is close to the true motion, that of rig 1 with spring B far from it
    near = periodic.frequency_response(RIG["c"], 300.0 * RPM, 700.0 * RPM)
    table = approximations(near, points=20)
    peak = max(near.maxima(), key=lambda e: e.amplitude)
    assert table.at(peak.parameter)["ten harmonics"] == pytest.approx(peak.amplitude, rel=5e-3)
    assert set(table.columns()) == {"drive.speed [rad/s]", *(f"{name} [m]" for name in table.amplitudes)}
    drive = periodic.Drive(speed=SETS["table-3.1"].crank_speed)
    with pytest.raises(InputError, match="over the speed"):
        approximations(periodic.frequency_response(TABLE_3_1, 900.0, 1000.0, vary="slider.stiffness", drive=drive))


def test_torque_drive_over_its_torque(tmp_path: Path) -> None:
    drive = periodic.Drive(torque=0.005)
    response = periodic.frequency_response(
        RIG["c"], 0.005, 0.06, vary="drive.torque", drive=drive, start=(0.0, 0.0, 54.0)
    )
    assert response.branches[0].special[0].kind is periodic.Crossing.FOLD
    rows = np.loadtxt(response.to_csv(tmp_path / "torque.csv"), delimiter=",", skiprows=1)
    assert len(rows) == sum(map(len, response.branches))
    assert set(rows[:, 0]) == set(range(1, len(response.branches) + 1))


def test_no_orbit_at_either_end_is_an_error() -> None:
    # a crank longer than coupler and rocker together cannot turn wherever the slider is
    with pytest.raises(periodic.OrbitError, match=r"limit of assembly|cannot be joined"):
        periodic.frequency_response(replace(TABLE_3_1, crank_length=0.5), 40.0, 41.0)


def test_a_curve_followed_from_both_ends_has_its_maximum_once() -> None:
    parameters = replace(RIG["c"], slider_damping=0.9)
    response = periodic.frequency_response(parameters, 540.0 * RPM, 620.0 * RPM, most_points=300)
    assert any("300 points" in problem for problem in response.problems)
    places = [round(e.parameter, 6) for e in response.maxima()]
    assert len(places) == len(set(places))


def test_an_interrupt_keeps_what_was_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    # Ctrl-C at the fortieth point
    count = 0

    @contextmanager
    def counting(*_: object) -> Iterator[Callable[[float], None]]:
        def show(_: float) -> None:
            nonlocal count
            count += 1
            if count == 40:
                os.kill(os.getpid(), signal.SIGINT)

        yield show

    monkeypatch.setattr(resonance, "show_progress", counting)
    with pytest.raises(periodic.ResponseInterrupted, match="1 branch followed") as stopped:
        periodic.frequency_response(RIG["a"], 100.0 * RPM, 1300.0 * RPM)
    (branch,) = stopped.value.response.branches
    assert len(branch) == 41
    assert "it was interrupted" in stopped.value.response.problems[0]


def test_a_search_that_is_interrupted_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    response = periodic.frequency_response(RIG["c"], 500.0 * RPM, 520.0 * RPM, doublings=0)

    def interrupted(*_: object, **__: object) -> SimpleNamespace:
        os.kill(os.getpid(), signal.SIGINT)
        return SimpleNamespace(orbits=())

    monkeypatch.setattr(resonance.motion, "search_orbits", interrupted)
    with pytest.raises(periodic.ResponseInterrupted) as stopped:
        periodic.with_isolas(response, places=2)
    assert stopped.value.response.sought == 0
    assert stopped.value.response.caution


def test_one_end_without_an_orbit_is_a_problem_that_is_reported() -> None:
    drive = periodic.Drive(speed=SETS["table-3.1"].crank_speed)
    response = periodic.frequency_response(TABLE_3_1, 0.04, 0.5, vary="crank.length", drive=drive, doublings=0)
    assert any("at crank.length = 0.5 m: no periodic motion found" in problem for problem in response.problems)
    assert response.branches[0].parameter[0] == 0.04


@pytest.mark.parametrize(
    ("speeds", "message"),
    [([], "at least one"), ([1.0, 1.0], "increase, or decrease"), ([-1.0, 1.0], "positive"), ([np.nan], "positive")],
)
def test_bad_sweeps_are_refused(speeds: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        periodic.sweep(TABLE_3_1, speeds)


def test_bad_ranges_are_refused() -> None:
    refused(InputError, "finite and increasing", periodic.frequency_response, TABLE_3_1, 2.0 * pi, pi)
    refused(
        ParameterError, r"low is \[\]: it must be a number in rad/s", periodic.frequency_response, TABLE_3_1, [], pi
    )
    refused(
        InputError, "say what drives the plant", periodic.frequency_response, TABLE_3_1, 1.0, 2.0, vary="slider.damping"
    )
