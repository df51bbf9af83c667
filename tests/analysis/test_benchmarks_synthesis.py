"""The pieces of `benchmarks.synthesis`: every search sees the same curve, quality function and constraints."""

from __future__ import annotations

from itertools import pairwise
from math import inf, radians
from time import perf_counter, sleep

import numpy as np
import pytest
from scipy.optimize import minimize

from analysis.studies.youssef.problems import PROBLEMS
from analysis.synthesis import Linkage, Search, evaluate, turn
from analysis.synthesis.search.start import make_start
from benchmarks.contest import (
    SEARCHES,
    Contest,
    PlacedFourBar,
    PylinkageScore,
    TimeUp,
    Trace,
    meets_packaging,
    run_search,
)
from benchmarks.synthesis import curve_by_numpy

pytest.importorskip("pylinkage")

PUBLISHED = [pytest.param(problem.linkage, id=name) for name, problem in PROBLEMS.items()]


def unknowns(contest: Contest, linkage: Linkage) -> np.ndarray:
    free = contest.limits.high > contest.limits.low
    return make_start(linkage, contest.normal).q[free]


def good(name: str) -> Linkage:
    """A linkage that keeps the problem's bounds and constraints, from a few seconds of search."""
    from analysis.synthesis import synthesize

    problem = PROBLEMS[name]
    return synthesize(
        problem.task, problem.bounds, problem.constraints, search=Search(candidates=1 << 10, starts=4)
    ).best.linkage


@pytest.mark.parametrize("linkage", PUBLISHED)
@pytest.mark.parametrize("branch", [1, -1])
def test_pylinkage_and_numpy_trace_our_curve(linkage: Linkage, branch: int) -> None:
    moved = Linkage.from_vector(linkage.vector, branch).translate(0.3, -0.2)
    ours = moved.path(turn(72)) @ [1.0, 1j]
    size = moved.largest_link
    np.testing.assert_allclose(PlacedFourBar.from_linkage(moved, 72).track()[:, 4], ours, rtol=0.0, atol=1e-9 * size)
    np.testing.assert_allclose(curve_by_numpy(moved, turn(72)), ours, rtol=0.0, atol=1e-12 * size)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["path-a", "path-b", "packaging"])
def test_pylinkage_is_scored_as_our_simplex_on_paths(name: str) -> None:
    contest = Contest.from_problem(PROBLEMS[name])
    linkage = good(name)
    box = next(b for b in contest.boxes if b.branch == linkage.branch)
    score = PylinkageScore(contest, box)
    random = np.random.default_rng(2)
    first = unknowns(contest, linkage)
    # farther off than the difference of 360 points from 128, and violating what is asked of the straight part
    for x in first * (1.0 + 0.05 * random.standard_normal((20, len(first)))):
        value = score(score.four_bar, x.tolist())
        if value < inf:
            assert value == pytest.approx(float(box.penalised_qualities(x[None, :])[0]), rel=0.02), x


def test_what_pylinkage_cannot_join_is_infinite() -> None:
    contest = Contest.from_problem(PROBLEMS["ellipse-a"])
    box = contest.boxes[0]
    score = PylinkageScore(contest, box)
    apart = unknowns(contest, PROBLEMS["ellipse-a"].linkage)
    apart[2], apart[4], apart[5] = box.high[2], 0.1 * box.high[4], 0.1 * box.high[5]
    assert score(score.four_bar, apart.tolist()) == inf
    assert score(score.four_bar, (box.high + 1.0).tolist()) == inf


@pytest.mark.parametrize("name", ["ellipse-a", "rocker-weighted", "path-b", "packaging"])
def test_a_linkage_is_measured_by_the_task(name: str) -> None:
    problem = PROBLEMS[name]
    contest = Contest.from_problem(problem)
    linkage = good(name)
    box = next(b for b in contest.boxes if b.branch == linkage.branch)
    error = contest.error(box, unknowns(contest, linkage))
    assert error == pytest.approx(problem.convert(evaluate(problem.task, linkage).error), rel=1e-9)


@pytest.mark.slow
def test_the_printed_packaging_machine_is_not_flat_enough() -> None:
    # flatness 6.99 cm at a travel of 175.8 cm (notes on chapter VI); asked are 2.5 cm at 144 cm
    printed = PROBLEMS["packaging"].linkage
    assert not meets_packaging(printed)
    assert meets_packaging(good("packaging"))
    # the same, a third larger, has the travel but not the flatness; smaller, not the travel
    assert not meets_packaging(good("packaging").scale(1.33))
    assert not meets_packaging(good("packaging").scale(0.9))


def test_a_linkage_that_violates_a_constraint_does_not_count() -> None:
    # the printed linkage of ellipse a has a transmission angle below 40 degrees
    contest = Contest.from_problem(PROBLEMS["ellipse-a"])
    linkage = PROBLEMS["ellipse-a"].linkage
    assert linkage.least_transmission < radians(40.0)
    trace = Trace(contest, 10.0)
    trace.record_if_best(next(b for b in contest.boxes if b.branch == linkage.branch), unknowns(contest, linkage))
    assert trace.points == []
    assert trace.best == inf


def test_the_clock_stops_while_measuring(monkeypatch: pytest.MonkeyPatch) -> None:
    contest = Contest.from_problem(PROBLEMS["rocker"])
    box = contest.boxes[0]
    values = iter([5.0, 7.0, 3.0])

    def slow(*_: object) -> float:
        sleep(0.1)
        return next(values)

    monkeypatch.setattr(Contest, "error", slow)
    begun = perf_counter()
    trace = Trace(contest, 10.0, enough=3.0)
    trace.record_if_best(box, box.low)
    trace.record_if_best(box, box.low)
    with pytest.raises(TimeUp):
        trace.record_if_best(box, box.low)
    assert perf_counter() - begun >= 0.3
    assert [value for _, value in trace.points] == [5.0, 3.0]
    assert trace.reaching_time(4.0) < 0.1
    assert trace.reaching_time(1.0) == inf
    with pytest.raises(TimeUp):
        Trace(contest, 0.0).tick()


def test_what_improves_is_offered() -> None:
    contest = Contest.from_problem(PROBLEMS["rocker"])
    box = contest.boxes[0]
    trace = Trace(contest, 10.0)
    offered: list[float] = []
    trace.record_if_best = lambda box, x: offered.append(float(x[0]))
    score = trace.watch(box, lambda x: float(x[0] ** 2))
    minimize(score, [3.0], method="Nelder-Mead")
    assert offered[0] == 3.0
    assert all(abs(b) < abs(a) for a, b in pairwise(offered))
    assert abs(offered[-1]) < 1e-3


@pytest.mark.parametrize("search", SEARCHES.values(), ids=SEARCHES.keys())
def test_every_search_finds_a_rocker_function(search: object) -> None:
    contest = Contest.from_problem(PROBLEMS["rocker"])
    # a long way from the optimum of 1019, but no linkage at random does it
    trace = run_search(search, contest, 20.0, 3000.0)
    assert trace.best <= 3000.0
    assert all(b < a for (_, a), (_, b) in pairwise(trace.points))
