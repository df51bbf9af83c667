"""The simplest mechanism that meets a tolerance: where it stops, and what it says."""

from dataclasses import replace
from math import degrees, inf, radians
from typing import Any

import numpy as np
import pytest

from analysis import synthesis as syn
from analysis.numerics.fourier import FourierSeries
from analysis.slider import Step, Strategy, StrategyInterrupted, simplest_mechanism
from analysis.studies.youssef.problems import PROBLEMS
from linkwork.errors import InputError
from tests.linkages import BASE

pytest.importorskip("casadi")

MM2 = 1e-6
PHI = syn.turn(24)


def links_of(linkage: syn.Linkage, share: float = 0.0) -> dict[str, tuple[float, float]]:
    """Bounds about a linkage's dimensions: this share of the ground link, or that many radians, to either side."""
    spread = dict.fromkeys(syn.LENGTHS, share * linkage.ground_length) | dict.fromkeys(syn.ANGLES, share)
    return {n: (getattr(linkage, n) - d, getattr(linkage, n) + d) for n, d in spread.items() if n != "output_angle"}


def strategy(traced: syn.Linkage, tolerance: float, *, starts: int = 4, **options: Any) -> Strategy:
    """For the path of a linkage, its links known but for a few hundredths."""
    task = syn.TimedPath(points=traced.path(PHI))
    assert np.isfinite(task.points).all()
    usual = {"bounds": links_of(BASE, 0.02), "constraints": (syn.FullTurn(),), "harmonics": 2, "stroke": 0.08}
    return simplest_mechanism(task, tolerance, **usual | options, search=syn.Search(starts=starts))


def test_a_four_bar_is_enough_for_what_one_traces() -> None:
    found = strategy(BASE, 0.01 * MM2)
    assert [step.mechanism for step in found.steps] == ["four-bar"]
    assert found.met
    assert found.chosen.solution is not None
    assert found.chosen.solution.linkage.pivot is None
    assert found.chosen.value == found.chosen.solution.error <= 0.01 * MM2
    assert found.chosen.reason.endswith("is within 0.01 mm2: accepted")


def test_a_slider_where_a_four_bar_is_not_enough() -> None:
    """Two harmonics were used to trace it: four-bar, one harmonic, two, and there it stops."""
    series = FourierSeries(np.array([0.0, 0.012, 0.008]), np.array([0.0, 0.010, -0.009]))
    found = strategy(replace(BASE, pivot=syn.SliderMotion(series, 0.4)), 0.01 * MM2, bounds=links_of(BASE))
    sliding = ("four-bar with a moved slider, 1 harmonic", "four-bar with a moved slider, 2 harmonics")
    assert [step.mechanism for step in found.steps] == ["four-bar", *sliding]
    values = [step.value for step in found.steps]
    assert values[0] > values[1] > values[2]
    assert found.met
    assert found.chosen is found.steps[-1]
    linkage = found.chosen.solution.linkage
    assert isinstance(linkage.pivot, syn.SliderMotion)
    moved = np.array(linkage.displacement(PHI))
    right = replace(linkage, pivot=syn.SliderMotion(series, 0.4)).displacement(PHI)
    assert moved == pytest.approx(np.array(right), abs=1e-6)
    for step in found.steps[:-1]:
        ratio = step.value / (0.01 * MM2)
        assert f"is {ratio:.3g} times the tolerance 0.01 mm2: rejected" in step.reason


def test_gears_where_a_slider_is_not_enough() -> None:
    """The path of a five-bar with gears 2:1, the second crank's stroke wider than the slider's."""
    gear = syn.SecondCrank(length=0.03, ratio=2, phase=-0.8)
    found = strategy(BASE.with_pivot(gear), 0.01 * MM2, harmonics=1, ratios=(1, 2), bounds=links_of(BASE, 0.01))
    assert [step.mechanism for step in found.steps] == [
        "four-bar",
        "four-bar with a moved slider, 1 harmonic",
        "five-bar, second crank geared 1:1",
        "five-bar, second crank geared 2:1",
    ]
    assert found.met
    linkage = found.chosen.solution.linkage
    assert isinstance(linkage.pivot, syn.SecondCrank)
    assert linkage.pivot.ratio == 2
    assert linkage.pivot.length == pytest.approx(gear.length, rel=1e-3)
    assert (np.diff([found.steps[0].value, found.steps[1].value, found.steps[3].value]) < 0.0).all()


def test_a_second_crank_that_turns_by_itself_is_the_last_resort() -> None:
    psi = FourierSeries(np.array([0.0, 0.5]), np.array([0.0, -0.4]))
    arm = syn.SecondCrank(length=0.03, ratio=2, phase=0.9, series=psi)
    found = strategy(BASE.with_pivot(arm), 0.01 * MM2, harmonics=1, ratios=(1, 2), bounds=links_of(BASE))
    cranks = ["five-bar, second crank geared 2:1", "five-bar, second crank turned independently, 1 harmonic"]
    assert [step.mechanism for step in found.steps][-2:] == cranks
    assert found.met
    # it goes on from the better of the gears
    assert found.chosen.solution.linkage.pivot.ratio == 2
    pivot = found.chosen.solution.linkage.pivot
    assert pivot.length == pytest.approx(arm.length, rel=1e-4)
    assert pivot.series.amplitudes[1] == pytest.approx(psi.amplitudes[1], rel=1e-4)


@pytest.mark.slow
def test_what_none_can_do_is_answered_with_the_nearest() -> None:
    """A square, whose corners no series of two harmonics makes."""
    corners = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1], [0.0, 0.0]])
    s = np.linspace(0.0, 4.0, 24, endpoint=False)
    square = np.column_stack([np.interp(s, range(5), corners[:, k]) for k in (0, 1)])
    limits = (syn.LeastTransmission(), syn.LargestLink(length=0.4))
    options = {"harmonics": 1, "ratios": (-1,), "search": syn.Search(starts=3)}
    found = simplest_mechanism(syn.TimedPath(points=square), 1e-3 * MM2, constraints=limits, **options)
    assert not found.met
    assert len(found.steps) == 4
    assert all(step.reason.endswith("rejected") for step in found.steps)
    assert found.chosen.value == min(step.value for step in found.steps)
    assert found.chosen.value < found.steps[0].value
    # constraints hold for every mechanism
    for step in found.steps:
        assert step.solution.linkage.largest_link <= 0.4 * (1.0 + 1e-6)
        assert step.solution.linkage.least_transmission > radians(39.5)
        error = syn.evaluate(syn.TimedPath(points=square), step.solution.linkage).error
        assert step.solution.error == pytest.approx(error)
    assert str(found).splitlines() == [f"{step.mechanism}: {step.reason}" for step in found.steps]


def test_the_worst_error_as_the_criterion_and_the_angles_of_a_rocker() -> None:
    weighted = PROBLEMS["rocker-weighted"]
    task = replace(weighted.task, weights=None)
    options = {"bounds": links_of(weighted.linkage), "constraints": (syn.FullTurn(),)}
    found = simplest_mechanism(task, radians(14.0), criterion="worst", **options, search=syn.Search(starts=8))
    assert found.criterion == "worst"
    assert found.met
    assert len(found.steps) == 2
    for step in found.steps:
        assert step.value == step.solution.evaluation.worst
        assert f"worst {degrees(step.value):.4g} deg" in step.reason
    error = simplest_mechanism(task, 1.0, criterion="error", **options, search=syn.Search(starts=2))
    assert len(error.steps) == 1
    assert f"is within {degrees(degrees(1.0)):.4g} deg2: accepted" in str(error)


def test_the_stroke_is_kept() -> None:
    series = FourierSeries(np.array([0.0, 0.02]), np.array([0.0, 0.0]))
    traced = replace(BASE, pivot=syn.SliderMotion(series, 0.4))
    found = strategy(traced, 1e-6 * MM2, bounds=links_of(BASE), stroke=0.02, harmonics=1, ratios=())
    slider = found.steps[1].solution.linkage.pivot
    assert slider.stroke == pytest.approx(0.02, rel=0.005)
    assert not found.met
    wider = strategy(traced, 1e-6 * MM2, bounds=links_of(BASE), stroke=0.05, harmonics=1, ratios=())
    assert wider.met
    assert wider.chosen.solution.linkage.pivot.stroke == pytest.approx(0.04, rel=1e-3)


def test_without_a_solution_a_step_has_none() -> None:
    """A second crank of at least a thousandth of the stroke, 1 m, cannot be joined to these links."""
    series = FourierSeries(np.array([0.0, 0.02, 0.01, 0.01]), np.zeros(4))
    traced = replace(BASE, pivot=syn.SliderMotion(series, 0.4))
    second = {"ratios": (1, 2), "stroke": 1000.0, "second_crank": 2.0}
    found = strategy(traced, 1e-6 * MM2, bounds=links_of(BASE), harmonics=1, **second)
    assert [step.solution is None for step in found.steps] == [False, False, True, True, True]
    for step in found.steps[2:]:
        assert step.value == inf
        assert step.reason == "no solution satisfies the constraints: rejected"
    assert not found.met
    assert found.chosen is found.steps[1]


def test_constraints_without_even_a_four_bar() -> None:
    task = syn.RockerFunction(angle=1.2 + 0.4 * np.sin(PHI))
    bounds = {"crank_length": (0.3, 0.4), "coupler_length": (0.01, 0.1), "rocker_length": (0.01, 0.1)}
    with pytest.raises(syn.InfeasibleError, match="no shape of four-bar is within the bounds"):
        simplest_mechanism(task, 1e-3, bounds=bounds)


@pytest.mark.parametrize(
    ("tolerance", "options", "words"),
    [
        (0.0, {}, "tolerance is 0.0"),
        (float("nan"), {}, "tolerance is nan"),
        ("-1 mm^2", {}, "tolerance is -1e-06"),
        ("-1 mm", {"criterion": "worst"}, "tolerance is -0.001"),
        (1.0, {"stroke": "-5 mm"}, "stroke is -0.005 m"),
        (1.0, {"criterion": "best"}, "criterion 'best'"),
        (1.0, {"harmonics": 0}, "0 harmonics"),
        (1.0, {"search": syn.Search(starts=0)}, "starts"),
        (1.0, {"stroke": -0.1}, "stroke"),
        (1.0, {"second_crank": 0.0}, "second crank"),
        (1.0, {"ratios": (1, 0.5)}, "0.5"),
        (1.0, {"ratios": (float("nan"),)}, "ratio nan"),
        (1.0, {"harmonics": 1.5}, "1.5 harmonics"),
        (1.0, {"search": syn.Search(starts=2.5)}, "2.5 starts"),
    ],
)
def test_bad_input_is_named_before_anything_is_searched(
    monkeypatch: pytest.MonkeyPatch, tolerance: float | str, options: dict[str, Any], words: str
) -> None:
    monkeypatch.setattr(syn, "synthesize", lambda *_, **__: pytest.fail("searched"))
    task = syn.TimedPath(points=BASE.path(PHI) + 0.01 * np.column_stack([np.cos(5.0 * PHI), np.sin(4.0 * PHI)]))
    with pytest.raises(InputError, match=words):
        simplest_mechanism(task, tolerance, **options)


def step_of(verdicts: dict[str, bool], error: float) -> Step:
    solution = syn.Solution.from_linkage(syn.TimedPath(points=BASE.path(PHI)), BASE)
    solution = replace(solution, verdicts=replace(solution.verdicts, **verdicts))
    return Step(mechanism="one", solution=solution, value=error, reason="")


def test_defects_are_named_and_what_is_sound_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    real = syn.synthesize

    def defective(*arguments: Any, **more: Any) -> Any:
        found = real(*arguments, **more)
        if more["pivot"] is not None:
            return found
        broken = [replace(s, verdicts=replace(s.verdicts, circuit=False, branch=False)) for s in found.solutions]
        return replace(found, solutions=tuple(broken))

    monkeypatch.setattr(syn, "synthesize", defective)
    found = strategy(BASE, 0.01 * MM2, harmonics=1, ratios=(), starts=2)
    assert found.steps[0].reason.endswith("is within 0.01 mm2, with a circuit defect and a branch defect: rejected")
    assert len(found.steps) == 2
    steps = (step_of({"circuit": False}, 1.0), step_of({}, 3.0), step_of({}, 2.0))
    assert Strategy(steps=steps, met=False, tolerance=0.1, criterion="error").chosen is steps[2]


@pytest.mark.parametrize("stop", [0, 1, 2])
@pytest.mark.parametrize("best", [True, False])
def test_interrupted_it_keeps_its_steps(monkeypatch: pytest.MonkeyPatch, stop: int, best: bool) -> None:
    series = FourierSeries(np.array([0.0, 0.012, 0.008]), np.array([0.0, 0.010, -0.009]))
    real, calls = syn.synthesize, []

    def stopped(*arguments: Any, **more: Any) -> Any:
        calls.append(more)
        if len(calls) <= stop:
            return real(*arguments, **more)
        if not best:
            raise KeyboardInterrupt
        raise syn.SynthesisInterrupted(replace(real(*arguments, **more), complete=False), 1, 4)

    monkeypatch.setattr(syn, "synthesize", stopped)
    with pytest.raises(StrategyInterrupted, match=f"stopped after {stop + best or 'no'} mechanism") as caught:
        strategy(replace(BASE, pivot=syn.SliderMotion(series, 0.4)), 1e-20 * MM2, starts=1, bounds=links_of(BASE))
    kept = caught.value.strategy
    if stop + best == 0:
        assert kept is None
        return
    assert len(kept.steps) == stop + best
    assert all(step.solution is not None for step in kept.steps)
    assert kept.steps[-1].reason.endswith("stopped" if best else "rejected")
    assert kept.chosen.value == min(step.value for step in kept.steps)


@pytest.mark.slow
def test_a_short_second_crank_may_be_asked_for() -> None:
    """Even one below a thousandth of the stroke."""
    found = strategy(BASE, 1e-30, harmonics=1, ratios=(1,), starts=2, second_crank=1e-5)
    lengths = [s.solution.linkage.pivot.length for s in found.steps[2:] if s.solution is not None]
    assert lengths
    assert max(lengths) <= 1e-5 * (1.0 + 1e-6)
