"""The race of `benchmarks.race`: its targets, curves and scores, its results, and how they are counted."""

from collections import Counter
from itertools import pairwise
from math import inf, nan, radians
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from analysis.studies.youssef.problems import PROBLEMS
from analysis.synthesis import Linkage, turn
from analysis.synthesis.search.program import make_start
from benchmarks import contest as shared
from benchmarks import race
from benchmarks.contest import Contest, PlacedFourBar, PylinkageScore, TimeUp, Trace, run_search
from benchmarks.race import OURS, RACERS, TIMES, Row
from benchmarks.synthesis import curve_by_numpy
from benchmarks.targets import TARGETS, Target

pytest.importorskip("pylinkage")
pytest.importorskip("cma")


def target(kind: str, name: str) -> Target:
    return next(t for t in TARGETS if (t.kind, t.name) == (kind, name))


def row(search: str, *errors: float, name: str = "square", exact: float = 0.0) -> Row:
    """A row whose last error goes on until the end."""
    return Row("polygonal", name, search, exact, (*errors, *[errors[-1]] * (len(TIMES) - len(errors))))


def rows(ours: float, least: float, other: float = 9.0, name: str = "square", exact: float = 0.0) -> list[Row]:
    searches = [search for search in RACERS if search != OURS]
    errors = dict.fromkeys(searches, other) | {OURS: ours, searches[1]: least}
    return [row(search, error, name=name, exact=exact) for search, error in errors.items()]


def test_ten_targets_of_each_kind() -> None:
    assert Counter(t.kind for t in TARGETS) == dict.fromkeys(("timed", "untimed", "polygonal", "drawn", "function"), 10)
    assert len({(t.kind, t.name) for t in TARGETS}) == 50


def test_the_same_targets_every_time() -> None:
    from benchmarks.targets import hand_drawn, random_waves

    np.testing.assert_array_equal(hand_drawn(3).points, target("drawn", "seed 3").task.path.points)
    np.testing.assert_array_equal(random_waves(2).angle, target("function", "waves 2").task.angle)


@pytest.mark.parametrize(
    ("kind", "name"),
    [("timed", "line in a third of a turn"), ("timed", "18 points"), ("function", "sine"), ("function", "waves 1")],
)
def test_pylinkage_is_scored_as_the_others_over_any_rotation(kind: str, name: str) -> None:
    contest = Contest.from_target(target(kind, name))
    random = np.random.default_rng(1)
    compared = 0
    for box in contest.boxes:
        score = PylinkageScore(contest, box)
        for x in random.uniform(box.low, box.high, (200, len(box.low))):
            value = score(score.four_bar, x.tolist())
            # nearer to the limit of assembly pylinkage may go over to the other one
            if Linkage.from_vector(score.four_bar.q[:10], box.branch).least_transmission > radians(25.0):
                compared += 1
                assert value == pytest.approx(box.penalised_quality(x), rel=1e-9)
    assert compared > 20


@pytest.mark.slow
def test_an_area_is_scored_by_the_measure_of_the_task() -> None:
    contest = Contest.from_target(target("polygonal", "L"))
    assert contest.on_area
    random = np.random.default_rng(1)
    measured = charged = 0
    for box in contest.boxes:
        score = PylinkageScore(contest, box)
        for x in random.uniform(box.low, box.high, (300, len(box.low))):
            value, error = contest.penalised_area(box, x), contest.error(box, x)
            if not np.isfinite(value):
                continue
            if np.isfinite(error):
                measured += 1
                assert value * contest.normal.unit**2 == pytest.approx(error, rel=1e-9)
            if Linkage.from_vector(contest.unknowns(x)[:10], box.branch).least_transmission > radians(25.0):
                charged += 1
                assert score.penalised_area(score.four_bar, x.tolist()) == pytest.approx(value, rel=1e-9)
        assert contest.penalised_area(box, box.high + 1.0) == inf
    assert measured > 10
    assert charged > 10


@pytest.mark.parametrize("linkage", [pytest.param(problem.linkage, id=name) for name, problem in PROBLEMS.items()])
@pytest.mark.parametrize("branch", [1, -1])
def test_pylinkage_and_numpy_trace_our_curve(linkage: Linkage, branch: int) -> None:
    moved = Linkage.from_vector(linkage.vector, branch).translate(0.3, -0.2)
    ours = moved.path(turn(72)) @ [1.0, 1j]
    size = moved.largest_link
    np.testing.assert_allclose(PlacedFourBar.from_linkage(moved, 72).track()[:, 4], ours, rtol=0.0, atol=1e-9 * size)
    np.testing.assert_allclose(curve_by_numpy(moved, turn(72)), ours, rtol=0.0, atol=1e-12 * size)


def test_a_linkage_that_is_not_feasible_does_not_count() -> None:
    contest = Contest.from_target(target("timed", "ellipse-a"))
    # the printed linkage has a transmission angle below 40 degrees
    linkage = PROBLEMS["ellipse-a"].linkage
    box = next(b for b in contest.boxes if b.branch == linkage.branch)
    x = make_start(linkage, contest.normal).q[contest.limits.high > contest.limits.low]
    trace = Trace(contest, 10.0)
    trace.record_if_best(box, x)
    assert trace.points == []
    assert trace.best == inf
    # links that cannot be joined, or beyond the bounds
    score = PylinkageScore(contest, box)
    x[2], x[4], x[5] = box.high[2], 0.1 * box.high[4], 0.1 * box.high[5]
    assert score(score.four_bar, x.tolist()) == score(score.four_bar, (box.high + 1.0).tolist()) == inf


def test_the_clock_stops_while_measuring(monkeypatch: pytest.MonkeyPatch) -> None:
    contest = Contest.from_target(target("function", "rocker"))
    box, now, values = contest.boxes[0], [0.0], iter([5.0, 7.0, 3.0])

    def slow(*_: object) -> float:
        now[0] += 6.0
        return next(values)

    monkeypatch.setattr(shared, "process_time", lambda: now[0])
    monkeypatch.setattr(Contest, "error", slow)
    trace = Trace(contest, 10.0)
    for _ in range(3):
        now[0] += 1.0
        trace.record_if_best(box, box.low)
    assert trace.points == [(1.0, 5.0), (3.0, 3.0)]
    assert (trace.least_error(2.0), trace.least_error(0.5)) == (5.0, inf)
    now[0] += 8.0
    with pytest.raises(TimeUp):
        trace.tick()


def test_what_improves_is_offered() -> None:
    contest = Contest.from_target(target("function", "rocker"))
    box, trace = contest.boxes[0], Trace(contest, 10.0)
    offered: list[float] = []
    trace.record_if_best = lambda box, x: offered.append(float(x[0]))
    minimize(trace.watch(box, lambda x: float(x[0] ** 2)), [3.0], method="Nelder-Mead")
    assert offered[0] == 3.0
    assert all(abs(b) < abs(a) for a, b in pairwise(offered))
    assert abs(offered[-1]) < 1e-3


def test_results_are_kept_when_a_run_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, ran = tmp_path / "race.csv", []

    def run(target: Target, search: str, budget: float) -> Row:
        if len(ran) == 3:
            raise KeyboardInterrupt
        ran.append((target.name, search))
        return Row(target.kind, target.name, search, 1e-12, tuple(0.5 if t <= budget else nan for t in TIMES))

    monkeypatch.setattr(race, "run", run)
    monkeypatch.setattr(race, "prepare_searches", lambda: None)
    two, searches = [target("polygonal", "square"), target("timed", "eight")], [OURS, "CMA-ES"]
    with pytest.raises(KeyboardInterrupt):
        race.run_missing(path, two, searches, 1.0, lambda text: None)
    kept = race.read(path)
    assert len(kept) == 3
    assert race.last_time(kept) == 1.0
    race_on = ran.copy()
    ran.clear()
    race.run_missing(path, two, searches, 1.0, lambda text: None)
    assert ran == [("eight", "CMA-ES")]
    assert race_on + ran == [(t.name, s) for t in two for s in searches]
    # in the order of the targets, whatever the order of the runs
    assert [r.target for r in race.read(path)] == ["eight", "eight", "square", "square"]
    assert not list(tmp_path.glob("*.new"))


@pytest.mark.parametrize(
    ("ours", "least", "exact", "is_ahead", "is_level"),
    [
        (1.0, 2.0, 0.0, True, False),
        (1.0, 1.002, 0.0, True, False),
        (1.0, 1.0005, 0.0, True, True),
        (1.0005, 1.0, 0.0, True, True),
        (1.002, 1.0, 0.0, False, False),
        (1e-13, 1e-20, 1e-12, True, True),
        (inf, inf, 0.0, False, False),
        (1.0, inf, 0.0, True, False),
    ],
)
def test_who_is_ahead(ours: float, least: float, exact: float, is_ahead: bool, is_level: bool) -> None:
    of = race.rows_by_target(rows(ours, least, other=inf, exact=exact))["polygonal", "square"]
    assert race.is_ahead(of, TIMES[-1]) is is_ahead
    assert race.is_level(of, TIMES[-1]) is is_level


def test_the_tables_count() -> None:
    both = rows(1.0, 2.0) + rows(3.0, 2.0, name="L")
    # a target that not all have run for does not count
    both.append(row(OURS, 1.0, name="star"))
    *_, final = race.standings(both)
    assert final == ["10", "1 of 2", "0", "1", "0", "1", "0", "0"]
    assert race.list_losses(both) == ["- polygonal, L: 50.00% above CMA-ES"]
    page = race.markdown(both, "targets").splitlines()
    assert page[2] == "| polygonal | square | **1** | 9 | 2 | 9 | 9 |"
    assert page[3] == "| polygonal | L | 3 | 9 | **2** | 9 | 9 |"
    assert race.markdown(rows(1.0, 2.0), "lost") == "None."
    assert race.last_time([row(OURS, 1.0), row("CMA-ES", 1.0, 1.0, *[nan] * (len(TIMES) - 2))]) == TIMES[1]
    assert race.picture(both).axes


@pytest.mark.parametrize("search", [OURS, "SciPy DE", "CMA-ES", "pylinkage Nelder-Mead"])
def test_the_searches_end_on_the_area(search: str) -> None:
    # of 1 m2 inside; at equal shares of the length the best is a circle with 0.182
    contest = Contest.from_target(target("polygonal", "square"))
    # a slow or busy machine needs the longer time
    assert any(run_search(RACERS[search], contest, seconds).best <= 0.9 for seconds in (2.0, 10.0))
