"""`synthesize` as a whole: determinism, displacements and rounding, trade-offs, precision points, bad input."""

import signal
import threading
from collections.abc import Iterator
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import analysis.synthesis as syn
from analysis.numerics.fourier import FourierSeries
from analysis.numerics.workers import run_in_parallel
from analysis.synthesis import synthesize
from analysis.synthesis.result.report import displacements
from analysis.synthesis.search.polish import Polished, polish
from analysis.synthesis.task.limits import make_limits
from linkwork.errors import InputError, ParameterError
from tests.linkages import drawn, ellipse, outline, scaled

pytest.importorskip("casadi")
FloatArray = NDArray[np.float64]

ELLIPSE = ellipse(24)
TASK = syn.TimedPath(points=ELLIPSE)
QUICK = syn.Search(candidates=1 << 12, starts=4)


class TestResult:
    def test_solutions_are_ranked_different_and_what_they_say(self) -> None:
        search, size = syn.Search(starts=12, candidates=1 << 13), syn.LargestLink(length=0.3)
        result = syn.synthesize(TASK, search=search, constraints=[*syn.USUAL, size])
        errors = [s.error for s in result.solutions]
        assert errors == sorted(errors)
        assert result.best is result.solutions[0]
        assert result.complete
        assert result.starts == 12
        assert len(errors) <= 6
        for solution in result.solutions:
            assert solution.verdicts.sound
            distance = np.hypot(*(solution.linkage.path(syn.turn(24)) - ELLIPSE).T)
            np.testing.assert_allclose(solution.evaluation.errors, distance, atol=1e-14)
            assert solution.error == pytest.approx(float(distance @ distance), rel=1e-12)
            assert solution.evaluation.worst == pytest.approx(distance.max())
            assert solution.evaluation.rms == pytest.approx(float(np.sqrt(np.mean(distance**2))))

    @pytest.mark.slow
    def test_the_same_seed_gives_the_same_bits_on_any_number_of_cores(self) -> None:
        tasks = (TASK, outline(ELLIPSE, samples=24))
        for task in tasks:
            one, again, two = (syn.synthesize(task, search=replace(QUICK, seed=5, n_jobs=n)) for n in (1, 1, 2))
            for other in (again, two):
                assert [s.linkage.values() for s in other.solutions] == [s.linkage.values() for s in one.solutions]

    def test_guesses_are_searched_from(self) -> None:
        task = syn.Motion(points=ELLIPSE[::4], angle=syn.turn(6))
        good = syn.synthesize(task, search=syn.Search(starts=12, candidates=1 << 12)).best
        poor = syn.synthesize(task, search=syn.Search(starts=1, candidates=16, seed=3))
        helped = syn.synthesize(task, search=syn.Search(starts=1, candidates=16, seed=3), guesses=[good])
        assert helped.starts == 2
        assert helped.best.error <= good.error * (1.0 + 1e-9)
        assert poor.best.error > 1.5 * good.error

    @pytest.mark.slow
    @pytest.mark.parametrize("n_jobs", [1, 2])
    def test_interrupted_it_hands_over_the_best_so_far(self, monkeypatch: pytest.MonkeyPatch, n_jobs: int) -> None:
        timer = threading.Timer(0.5, signal.raise_signal, [signal.SIGINT])

        def long(normal: Any, limits: Any, starts: Any, **more: Any) -> Polished:
            return polish(normal, limits, list(starts) * 200, **more)

        def interrupted(*arguments: Any, **more: Any) -> Iterator[Any]:
            for found in run_in_parallel(*arguments, **more):
                if not timer.ident:
                    timer.start()
                yield found

        monkeypatch.setattr("analysis.synthesis.search.solve.polish", long)
        monkeypatch.setattr("analysis.synthesis.search.polish.run_in_parallel", interrupted)
        with pytest.raises(syn.SynthesisInterrupted, match=r"stopped after \d+ of \d+ searches") as caught:
            syn.synthesize(TASK, search=replace(QUICK, n_jobs=n_jobs))
        timer.join()
        found = caught.value.synthesis
        assert found is not None
        assert not found.complete
        assert 0 < found.starts < 800
        assert found.best.error < 1e-3

    def test_interrupted_in_the_scan_there_is_none_yet(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def interrupted(*_: Any, **__: Any) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr("analysis.synthesis.search.solve.scan", interrupted)
        with pytest.raises(syn.SynthesisInterrupted, match="stopped after 0 of 7 searches") as caught:
            syn.synthesize(TASK, search=syn.Search(starts=7))
        assert caught.value.synthesis is None


def known(seed: int = 3) -> syn.Linkage:
    return drawn(np.random.default_rng(seed), least=0.7)


def off(points: FloatArray, scale: float = 0.02) -> FloatArray:
    return points + scale * np.random.default_rng(0).normal(size=points.shape)


def judged(kind: str) -> syn.Solution:
    """A solution that is not quite right, of every kind of task."""
    linkage = known()
    phi = np.linspace(0.0, 4.0, 9)
    weights = np.linspace(1.0, 3.0, 9)
    points = off(linkage.path(phi))
    timed = syn.TimedPath(points=points, rotation=phi, weights=weights)
    if kind == "slider":
        a = 0.05 * linkage.crank_length
        pivot = syn.SliderMotion(FourierSeries(np.array([a, 2.0 * a]), np.array([0.0, a])), 0.4)
        return syn.Solution.from_linkage(timed, linkage.with_pivot(pivot))
    if kind == "five-bar":
        series = FourierSeries(np.array([0.0, 0.2, -0.1]), np.array([0.0, 0.3, 0.1]))
        arm = syn.SecondCrank(0.1 * linkage.crank_length, ratio=2, phase=0.7, series=series)
        return syn.Solution.from_linkage(timed, linkage.with_pivot(arm))
    rocker, coupler = (angle(phi) + 0.02 * phi for angle in (linkage.rocker_angle, linkage.coupler_angle))
    task: Any = {
        "timed": lambda: timed,
        "rocker": lambda: syn.RockerFunction(angle=rocker, rotation=phi, weights=weights),
        "motion": lambda: syn.Motion(points=points, angle=coupler, rotation=phi, weights=weights),
        "poses": lambda: syn.Motion(points=points, angle=coupler, weights=weights),
        "precision": lambda: syn.PrecisionPoints(points=points),
        "closed": lambda: outline(1.02 * linkage.path(syn.turn(90)), measure="distance"),
        "open": lambda: outline(off(linkage.path(np.linspace(0.0, 4.0, 40)), 1e-3), closed=False, measure="distance"),
        "area": lambda: outline(1.02 * linkage.path(syn.turn(90))),
    }[kind]()
    rotation = phi if kind in ("poses", "precision") else None
    if kind == "open":
        from analysis.synthesis.result.solution import nearest_rotations

        normal = syn.normal_form(task)
        rotation = nearest_rotations(linkage, normal.origin + normal.unit * normal.points)
    return syn.Solution.from_linkage(task, linkage, rotation)


#: Kinds whose quality is a sum over stations of given rotations.
SUMS = ("timed", "rocker", "motion", "poses", "precision", "slider", "five-bar")


class TestErrors:
    @pytest.mark.parametrize("kind", ["motion", "poses"])
    def test_errors_of_angle_count_in_the_worst_and_the_mean(self, kind: str) -> None:
        solution = judged(kind)
        task, evaluation = solution.task, solution.evaluation
        assert isinstance(task, syn.Motion)
        made = solution.linkage.coupler_angle(evaluation.rotation)
        turned = task.length * (made - np.asarray(task.angle))
        apart = solution.linkage.path(evaluation.rotation) - np.asarray(task.points)
        squares = (apart**2).sum(axis=1) + turned**2
        assert evaluation.worst == pytest.approx(np.sqrt(squares.max()))
        assert evaluation.rms == pytest.approx(np.sqrt(squares.mean()))
        assert evaluation.worst > np.abs(evaluation.errors).max()
        assert solution.error == pytest.approx(float(np.asarray(task.weights) @ squares))


class TestDisplacements:
    @pytest.mark.parametrize("kind", SUMS)
    def test_they_are_limits_of_differences_of_the_output(self, kind: str) -> None:
        solution = judged(kind)
        task, at, normal = solution.task, solution.evaluation.rotation, syn.normal_form(solution.task)
        found = displacements(solution)
        assert len(found) == {"rocker": 6, "motion": 11, "poses": 11, "slider": 14, "five-bar": 16}.get(kind, 10)

        def output(linkage: syn.Linkage) -> np.ndarray:
            if normal.of_rocker:
                return linkage.rocker_angle(at)[:, None] + linkage.output_angle
            turned = linkage.coupler_angle(at) + linkage.output_angle if normal.angle is not None else np.zeros(len(at))
            return np.column_stack([linkage.path(at), (getattr(task, "length", None) or 0.0) * turned])

        for name, shift in found.items():
            if name == "output_angle":
                continue
            ahead, behind = (output(self.changed(solution.linkage, name, step)) for step in (1e-6, -1e-6))
            apart = (((ahead - behind) / 2e-6) ** 2).sum(axis=1)
            assert shift == pytest.approx(float(np.sqrt(apart.mean())), rel=1e-5, abs=1e-8), name

    def changed(self, linkage: syn.Linkage, name: str, step: float) -> syn.Linkage:
        pivot = linkage.pivot
        if name in linkage.values():
            return replace(linkage, **{name: getattr(linkage, name) + step})
        own = {"guide_angle": "guide_angle", "second_crank_length": "length", "second_crank_phase": "phase"}.get(name)
        if own is not None:
            return replace(linkage, pivot=replace(pivot, **{own: getattr(pivot, own) + step}))
        _, kind, k = name.split()
        cosines, sines = np.array(pivot.series.cos), np.array(pivot.series.sin)
        (cosines if kind == "cos" else sines)[int(k)] += step
        return replace(linkage, pivot=replace(pivot, series=FourierSeries(cosines, sines)))


class TestRounding:
    def test_dimensions_are_whole_steps(self) -> None:
        rounding = syn.round_dimensions(judged("timed"), length=1e-3, angle=radians(0.5))
        for name, value in rounding.linkage.values().items():
            step = radians(0.5) if "angle" in name or "phase" in name else 1e-3
            if name != "branch":
                assert value / step == pytest.approx(round(value / step), abs=1e-6)
        assert rounding.error == syn.evaluate(judged("timed").task, rounding.linkage).error

    @pytest.mark.parametrize("kind", ["timed", "motion", "rocker", "slider", "five-bar", "closed", "area"])
    def test_expected_is_the_mean_over_random_errors_of_make(self, kind: str) -> None:
        solution = judged(kind)
        length, angle = 0.004, radians(0.3)
        random = np.random.default_rng(2)
        errors = []

        def made(part: Any, names: tuple[str, ...]) -> Any:
            steps = {n: angle if "angle" in n or "phase" in n else length for n in names}
            return replace(part, **{n: getattr(part, n) + s * random.uniform(-0.5, 0.5) for n, s in steps.items()})

        for _ in range(1500):
            linkage = made(solution.linkage, (*syn.LENGTHS, *syn.ANGLES))
            if linkage.pivot is not None:
                own = ("guide_angle",) if kind == "slider" else ("length", "phase")
                linkage = replace(linkage, pivot=made(linkage.pivot, own))
            errors.append(syn.evaluate(solution.task, linkage, solution.evaluation.rotation).error)
            if kind in ("closed", "area") and len(errors) == 400:
                break
        # the sample's own uncertainty, and what the second derivatives of the residuals add
        spread = np.std(errors) / np.sqrt(len(errors))
        expected = syn.round_dimensions(solution, length=length, angle=angle).expected
        assert expected == pytest.approx(np.mean(errors), abs=4.0 * spread + 0.05 * (np.mean(errors) - solution.error))

    def test_expected_of_an_area_that_is_as_small_as_it_can_be(self) -> None:
        """Distances of either sign, few stations, and a target of few points: what is added starts from the area itself."""
        task = outline(ELLIPSE, samples=36)
        solution = syn.synthesize(task, search=QUICK).best
        random = np.random.default_rng(0)
        errors = []
        for _ in range(400):
            off = {n: radians(0.1) if n in syn.ANGLES else 1e-4 for n in (*syn.LENGTHS, *syn.ANGLES)}
            changed = {n: getattr(solution.linkage, n) + random.uniform(-0.5, 0.5) * step for n, step in off.items()}
            errors.append(syn.evaluate(task, replace(solution.linkage, **changed)).error)
        grown = float(np.mean(errors)) - solution.error
        spread = float(np.std(errors)) / np.sqrt(len(errors))
        expected = syn.round_dimensions(solution, length=1e-4, angle=radians(0.1)).expected - solution.error
        assert expected == pytest.approx(grown, abs=3.0 * spread)
        assert spread < 0.06 * grown

    def test_expected_knows_how_the_residuals_are_curved(self) -> None:
        """One dimension off, and a large error: by Simpson's rule, which integrates the cubic of it exactly."""
        solution = judged("rocker")
        task = replace(solution.task, angle=solution.linkage.rocker_angle(solution.task.rotation) + 0.5)
        solution = syn.Solution.from_linkage(task, solution.linkage)
        angle = radians(2.0)

        def mean(name: str) -> float:
            value = getattr(solution.linkage, name)
            changed = (replace(solution.linkage, **{name: value + d}) for d in (-angle / 2.0, angle / 2.0))
            ends = [syn.evaluate(task, linkage).error for linkage in changed]
            return (ends[0] + 4.0 * solution.error + ends[1]) / 6.0

        # of the angles, only these two turn the rocker
        grown = sum(mean(name) - solution.error for name in ("crank_phase", "output_angle"))
        expected = syn.round_dimensions(solution, length=1e-9, angle=angle).expected
        assert expected - solution.error == pytest.approx(grown, rel=1e-3)

    def test_output_angle_and_moved_pivot_are_rounded_the_commanded_motion_is_not(self) -> None:
        motion = judged("motion")
        mounted = replace(motion, linkage=replace(motion.linkage, output_angle=0.1234))
        assert syn.round_dimensions(mounted, angle=0.05).linkage.output_angle == pytest.approx(0.1)
        sliding, geared = judged("slider"), judged("five-bar")
        assert syn.round_dimensions(sliding, angle=0.25).linkage.pivot.guide_angle == pytest.approx(0.5)
        assert syn.round_dimensions(sliding, length=0.01).linkage.pivot.series is sliding.linkage.pivot.series
        pivot = syn.round_dimensions(geared, length=1.0, angle=0.5).linkage.pivot
        assert (pivot.length, pivot.phase) == (1.0, 0.5)

    @pytest.mark.parametrize("factor", [1.0, 1e-3, 1e-5])
    def test_small_linkages_by_themselves_are_rounded_to_finer_steps(self, factor: float) -> None:
        """A link is not rounded away, and the error stays in proportion to the linkage."""
        linkage = scaled(known(), factor)
        solution = syn.Solution.from_linkage(syn.TimedPath(points=off(known().path(syn.turn(9))) * factor), linkage)
        assert syn.round_dimensions(solution).error == pytest.approx(solution.error, rel=0.3)
        step = 10.0 * linkage.largest_link
        assert syn.round_dimensions(solution, length=step).linkage.crank_length == step

    @pytest.mark.parametrize("step", [0.0, -1.0, np.nan])
    def test_steps_are_above_zero(self, step: float) -> None:
        with pytest.raises(InputError, match="step of length"):
            syn.round_dimensions(judged("timed"), length=step)
        with pytest.raises(InputError, match="step of angle"):
            syn.round_dimensions(judged("timed"), angle=step)


class TestTradeOff:
    @pytest.mark.parametrize(
        ("over", "limits", "looser"),
        [("size", [0.3, 0.15, 0.6, 0.2], 1.0), ("transmission", [0.3, 0.6, 0.9, 1.2], -1.0)],
    )
    def test_the_error_only_grows_as_the_limit_is_tightened(
        self, over: Any, limits: list[float], looser: float
    ) -> None:
        constraints = [syn.LargestLink(length=0.25)] if over == "transmission" else syn.USUAL
        front = syn.trade_off(TASK, over, limits, constraints=constraints, search=syn.Search(starts=3))
        order = np.argsort(looser * np.array(limits))
        errors = front.error[order]
        assert np.all(np.diff(errors) <= 1e-9 * errors[0])
        assert errors[0] > 1.2 * errors[-1]
        for limit, solution in zip(limits, front.solutions):
            assert solution is not None
            if over == "size":
                assert solution.linkage.largest_link <= limit + 1e-9
            else:
                assert solution.linkage.least_transmission >= limit - 1e-6

    def test_on_the_way_back_the_tighter_solution_is_kept(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Where every search but that of the tightest limit comes to something poor, its solution serves them all."""
        poor = syn.Solution.from_linkage(TASK, known())
        calls = []

        def search(*arguments: Any, **more: Any) -> Any:
            calls.append(more)
            found = synthesize(*arguments, **more)
            return found if len(calls) == 3 else replace(found, solutions=(poor,))

        monkeypatch.setattr("analysis.synthesis.search.solve.synthesize", search)
        front = syn.trade_off(TASK, "size", [0.4, 0.6, 0.5], search=syn.Search(starts=1))
        assert len(calls) == 6
        assert front.solutions[0] is front.solutions[1] is front.solutions[2] is not poor

    @pytest.mark.parametrize("stop", [0, 1, 3])
    @pytest.mark.parametrize("by", ["search", "key"])
    def test_interrupted_it_keeps_what_it_has(self, monkeypatch: pytest.MonkeyPatch, stop: int, by: str) -> None:
        calls = []

        def search(*arguments: Any, **more: Any) -> Any:
            calls.append(more)
            if len(calls) <= stop:
                return synthesize(*arguments, **more)
            if by == "key":
                raise KeyboardInterrupt
            raise syn.SynthesisInterrupted(synthesize(*arguments, **more), 1, 2)

        monkeypatch.setattr("analysis.synthesis.search.solve.synthesize", search)
        with pytest.raises(syn.TradeOffInterrupted, match=f"stopped after {stop} of 4 problems") as caught:
            syn.trade_off(TASK, "size", [0.3, 0.6], search=syn.Search(starts=1))
        front = caught.value.trade_off
        there = [s is not None for s in front.solutions]
        # the looser limit is the first
        assert there == [stop + (by == "search") >= 2, stop + (by == "search") >= 1]
        assert front.limit.tolist() == [0.3, 0.6]

    def test_where_there_is_none_it_is_masked(self) -> None:
        bounds = {"ground_length": (0.2, 0.3), "crank_length": (0.05, 0.05)}
        front = syn.trade_off(TASK, "size", [0.1, 0.4], bounds=bounds, search=syn.Search(starts=2))
        assert front.solutions[0] is None
        assert front.error.mask.tolist() == [True, False]

    @pytest.mark.parametrize(
        ("over", "limits", "message"),
        [
            ("mass", [1.0, 2.0], "a trade-off over 'mass'"),
            ("size", [1.0], "at least two"),
            ("size", [1.0, np.nan], "finite numbers"),
        ],
    )
    def test_bad_ones(self, over: Any, limits: list[float], message: str) -> None:
        with pytest.raises(InputError, match=message):
            syn.trade_off(TASK, over, limits)


class TestPrecisionPoints:
    def met(self, task: syn.PrecisionPoints, starts: int = 30) -> syn.Solution:
        search = syn.Search(starts=starts, candidates=1 << 14)
        solution = syn.synthesize(task, constraints=[syn.FullTurn(), syn.LargestLink(length=6.0)], search=search).best
        assert solution.verdicts.sound
        return solution

    @pytest.mark.slow
    @pytest.mark.parametrize(("n", "end", "starts"), [(3, 3.5, 12), (5, 3.5, 12), (9, 5.5, 60)])
    def test_untimed_points_of_a_known_curve_are_met_exactly(self, n: int, end: float, starts: int) -> None:
        points = known(5).path(np.linspace(0.0, end, n))
        solution = self.met(syn.PrecisionPoints(points=points), starts=starts)
        assert solution.evaluation.worst < 1e-7
        rotation = solution.rotation
        np.testing.assert_allclose(solution.linkage.path(rotation), points, atol=1e-7)
        assert np.all(np.diff(rotation) > 0.0) or np.all(np.diff(rotation) < 0.0)

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("seed", "span"),  # one of each span, the others by `make test-long`
        [
            (1, 2.0),
            (3, 3.5),
            (4, 5.5),
            *(pytest.param(seed, span, marks=pytest.mark.long) for seed, span in ((2, 3.5), (5, 5.5), (6, 5.5))),
        ],
    )
    def test_nine_points_of_a_hidden_crank_rocker(self, seed: int, span: float) -> None:
        random = np.random.default_rng([9, seed])
        points = drawn(random, least=0.75).path(np.sort(random.uniform(0.0, span, 9)))
        found = syn.synthesize(syn.PrecisionPoints(points=points)).best
        assert found.verdicts.sound
        assert found.evaluation.worst < 5e-6 * np.hypot(*np.ptp(points, axis=0))

    def test_a_link_that_is_too_short_to_be_built_is_noted(self) -> None:
        """Points are met by many linkages; the best transmission angle draws the ground link to the end of its bounds."""
        task = syn.PrecisionPoints(points=[[0.0, 0.0], [0.05, 0.02], [0.1, 0.0]])
        best = syn.synthesize(task, search=QUICK).best
        length = best.linkage.ground_length
        assert length < 0.01 * best.linkage.largest_link
        assert f"ground_length of {1e3 * length:.3g} mm beside" in syn.report(best)
        held = syn.synthesize(task, {"ground_length": ("20 mm", "200 mm")}, search=QUICK).best
        assert held.evaluation.worst < 1e-9
        assert held.linkage.ground_length >= 0.02 - 1e-9
        assert "beside a link" not in syn.report(held)


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [2, pytest.param(4, marks=pytest.mark.long)])
def test_an_aerofoil_is_drawn_as_well_from_any_seed(seeds: int) -> None:
    """NACA 4415, by the formulas of NACA report 460."""
    x = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 60)))
    half = 0.75 * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
    fore = x < 0.4
    camber = np.where(fore, 0.25 * (0.8 * x - x * x), (0.2 + 0.8 * x - x * x) / 9.0)
    slope = np.arctan(np.where(fore, 0.5, 2.0 / 9.0) * (0.4 - x))
    middle, off = np.column_stack([x, camber]), half[:, None] * np.column_stack([-np.sin(slope), np.cos(slope)])
    path = syn.TargetPath(points=np.vstack([(middle + off)[::-1], (middle - off)[1:-1]]), closed=True)
    task = syn.UntimedPath(path=path)
    errors = [syn.synthesize(task, search=syn.Search(seed=seed)).best.error for seed in range(seeds)]
    assert max(errors) < 1.02 * min(errors)
    assert max(errors) < 0.00115


class TestStraight:
    def test_a_straight_part_is_flat_and_quick(self) -> None:
        points = np.array([[0, 0], [0.5, 0], [1, 0], [1.1, 0.25], [0.9, 0.4], [0.5, 0.45], [0.1, 0.4], [-0.1, 0.25]])
        straight = syn.Straight(start=0, end=2, rotation=2.2, flatness=0.02)
        task = outline(points, measure="distance", samples=36, straight=straight)
        search, limits = (
            syn.Search(starts=6, candidates=1 << 13),
            [syn.LeastTransmission(), syn.LargestLink(length=4.0)],
        )
        solution = syn.synthesize(task, search=search, constraints=limits).best
        rotation = solution.evaluation.rotation
        assert rotation is not None

        part = syn.normal_form(task).straight
        assert part is not None
        first, last = rotation[part.start], rotation[part.end]
        assert abs(last - first) <= 2.2 + 1e-6
        curve = solution.linkage.path(np.linspace(first, last, 50))
        assert np.ptp(curve[:, 1]) < 0.025
        traced = solution.straight()
        assert traced is not None
        assert traced.rotation == pytest.approx(abs(last - first))


def refused(message: str, error: type[Exception] = InputError) -> Any:
    return pytest.raises(error, match=message)


class TestBadInput:
    @pytest.mark.parametrize(
        ("points", "message"),
        [
            ([[0, 0]], "target points: 1 are too few, there must be at least [23]"),
            ([[0, 0, 0], [1, 1, 1]], r"target points: the shape is \(2, 3\)"),
            ([[0, 0], [1, np.nan]], "target points: 1 are not finite, the first at index 1"),
        ],
    )
    def test_points(self, points: list[list[float]], message: str) -> None:
        with refused(message):
            syn.TimedPath(points=points)
        with refused(message.replace("target", "precision")):
            syn.PrecisionPoints(points=points)

    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (lambda: syn.PrecisionPoints(points=[[0, 0], [1, 1], [1, 1]]), r"2 are the same, \[1.0, 1.0\] m;.* dwell"),
            (lambda: syn.Motion(points=[[0, 0], [1, 1], [1, 1]], angle=[0, 1, 1]), r"same, \[1.0, 1.0\] m at 1 rad"),
            (lambda: syn.TimedPath(points=[[0, 0], [1, 1]]), "2 are too few, there must be at least 3"),
            (lambda: syn.TimedPath(points=[[1, 2]] * 4), r"all target points are the same, \[1.0, 2.0\] m"),
            (lambda: syn.PrecisionPoints(points=[[1, 2]] * 3, rotation=[0, 1, 2]), "all precision points are the same"),
            (lambda: syn.RockerFunction(angle=np.full(8, 1.2)), "target angles are the same, 1.2 rad: .* no linkage"),
            (lambda: syn.TimedPath(points=ELLIPSE, objective="least"), "objective is 'least': .* 'error' or 'worst'"),
            (lambda: syn.TimedPath(points=ELLIPSE, rotation=syn.turn(5)), "one for each of the 24 targets"),
            (lambda: syn.TimedPath(points=ELLIPSE[:3], rotation=[0, 2, 1]), "1 and 2 are 2 and 1 rad: .* one way"),
            (lambda: syn.TimedPath(points=ELLIPSE[:3], rotation=[0, 1, 7]), "they may span one turn at most"),
            (lambda: syn.TimedPath(points=ELLIPSE[:3], weights=[1, -1, 1]), "weight 1 is -1: none may be below zero"),
            (lambda: syn.TimedPath(points=ELLIPSE[:3], weights=[0, 0, 0]), "weight 0 is 0: .* nor all be zero"),
            (lambda: syn.TimedPath(points=ELLIPSE[:3], weights=[1.0, 2.0]), r"weights have the shape \(2,\)"),
            (lambda: syn.RockerFunction(angle=[1.0, 2.0]), "must be a list of at least 3"),
            (lambda: syn.RockerFunction(angle=[1.0, 2.0, np.inf]), "target angles: number 2 is inf"),
            (lambda: syn.Motion(points=ELLIPSE[:3], angle=[1.0, 2.0]), "target angles have the shape"),
            (lambda: syn.Motion(points=ELLIPSE[:3], angle=[1, 2, 3], length=-1.0), "length is -1.0"),
            (lambda: outline(ELLIPSE, samples=4), "4 samples of a path"),
            (lambda: outline(ELLIPSE, measure="mean"), "measure is 'mean'"),
            (lambda: syn.Straight(start=3, end=3, rotation=1.0), "it must run forward"),
            (lambda: syn.Straight(start=0, end=3, rotation=0.0), "crank rotation of the straight part is 0.0"),
            (lambda: syn.Straight(start=0, end=3, rotation=6.3), "crank rotation of the straight part is 6.3"),
            (lambda: syn.Straight(start=0, end=3, rotation=1.0, flatness=0.0), "flatness is 0.0"),
        ],
    )
    def test_tasks(self, make: Any, message: str) -> None:
        with refused(message):
            make()

    @pytest.mark.parametrize(
        ("options", "error", "message"),
        [
            ({"search": {"starts": 0}}, InputError, "0 starts: there must be at least one"),
            ({"search": {"candidates": 0}}, InputError, "0 candidates"),
            ({"search": {"n_jobs": 0}}, InputError, "0 cores"),
            ({"constraints": ["short"]}, InputError, "'short' is not a constraint: use .*LeastTransmission"),
            ({"bounds": {"crank": (0, 1)}}, ParameterError, "no dimension 'crank'.* crank_length"),
            ({"bounds": {"crank_length": (0.2, 0.1)}}, syn.InfeasibleError, "at least 0.2 m and at most 0.1 m"),
            (
                {"constraints": [syn.LargestLink(length="5 mm")]},
                syn.InfeasibleError,
                "the coupler point cannot span the target, 200 mm across: .* keep it within 20 mm",
            ),
            ({"bounds": {"crank_length": (0.2, np.nan)}}, ParameterError, "bounds of crank_length"),
            ({"bounds": {"crank_length": 1.0}}, ParameterError, "be two numbers, the least and the greatest value"),
            ({"bounds": {"crank_length": (-2.0, -1.0)}}, ParameterError, "a link has a length"),
            (
                {"bounds": {"rocker_length": (2.0, 3.0)}, "constraints": [syn.LargestLink(length=1.0)]},
                syn.InfeasibleError,
                "rocker_length is to be at least 2 m, and no link longer than 1 m",
            ),
            (
                {"constraints": [syn.Assembly(branch=1), syn.Assembly(branch=-1)]},
                syn.InfeasibleError,
                "the constraints require both assemblies at once",
            ),
            (
                {"constraints": [syn.Grashof(type="drag-link"), syn.Grashof(type="crank-rocker")]},
                syn.InfeasibleError,
                "Grashof types crank-rocker, drag-link are asked for at once",
            ),
            ({"constraints": [*syn.USUAL, syn.Grashof(type="triple-rocker")]}, syn.InfeasibleError, "not turn fully"),
            (
                {"constraints": [syn.Toggle(at=1.0)]},
                syn.InfeasibleError,
                "a crank that is to come to a toggle cannot turn fully, which the task asks for",
            ),
            (
                {"bounds": {"ground_length": (1.0, 2.0), "coupler_length": (0.1, 0.3), "rocker_length": (0.1, 0.3)}},
                syn.InfeasibleError,
                "no shape of four-bar is within the bounds of the links and has a transmission angle of 40 deg over",
            ),
            (
                {
                    "bounds": {"pivot_x": (5.0, 5.0), "crank_length": (0.3, 0.5)},
                    "constraints": [syn.LargestLink(length=0.3)],
                },
                syn.InfeasibleError,
                r"the crank shaft is to be \d+ mm from it at least, and .* of at most 300 mm and 300 mm, reach 600 mm",
            ),
            ({"bounds": {"pivot_x": (2.0, 2.0)}}, None, ""),
        ],
    )
    def test_calls(self, options: dict[str, Any], error: type[Exception] | None, message: str) -> None:
        def called() -> syn.Synthesis:
            rest = {name: value for name, value in options.items() if name != "search"}
            return syn.synthesize(TASK, **rest, search=replace(QUICK, **options.get("search", {})))

        if error is None:
            # silly, and yet feasible: answered
            assert called().best.linkage.pivot_x == pytest.approx(2.0)
            return
        with refused(message, error):
            called()

    def test_an_infeasible_region_is_off_by_a_length(self) -> None:
        """The shaft is to be in two places: by how much it is off is said in mm."""
        far = syn.PivotRegion(pivot="A", polygon=[[0.9, 0.9], [1.0, 0.9], [0.9, 1.0]])
        near = syn.Require(function=lambda p: p.pivot_x - 0.5, name="near")
        with refused(r"violates the (near|region of pivot A) by [\d.e+]+( mm)? \(", syn.InfeasibleError):
            syn.synthesize(TASK, constraints=[*syn.USUAL, far, near], search=QUICK)
        with refused(r"no point in common: pivot_x is to be 0 to 500 mm, pivot_y", syn.InfeasibleError):
            syn.synthesize(TASK, {"pivot_x": (0.0, 0.5)}, constraints=[*syn.USUAL, far], search=QUICK)
        # a shaft on a line or at a point of the region
        for bounds in ({"pivot_x": (0.95, 0.95)}, {"pivot_x": (0.92, 0.92), "pivot_y": (0.95, 0.95)}):
            best = syn.synthesize(TASK, bounds, constraints=[*syn.USUAL, far], search=QUICK).best.linkage
            assert best.pivot_x == pytest.approx(bounds["pivot_x"][0])
            assert 0.9 - 1e-6 < best.pivot_y < 1.9 - best.pivot_x + 1e-6

    def test_an_open_path_needs_rotations_to_be_compared(self) -> None:
        task = outline(ELLIPSE[:9], closed=False)
        with refused("an open path has no crank rotations of its own"):
            syn.evaluate(task, known())
        with refused("say at which ones the linkage is to be compared"):
            syn.evaluate(syn.PrecisionPoints(points=ELLIPSE[:4]), known())

    def test_where_it_cannot_be_joined_the_error_is_infinite_not_nan(self) -> None:
        links = {"ground_length": 1.0, "crank_length": 0.5, "coupler_length": 0.6, "rocker_length": 0.7}
        linkage = syn.Linkage(**links, point_distance=0.3)
        assert syn.evaluate(TASK, linkage).error == np.inf
        assert syn.evaluate(outline(ELLIPSE), linkage).error == np.inf
        assert syn.evaluate(syn.RockerFunction(angle=syn.turn(8)), linkage).error == np.inf
        assert not syn.Solution.from_linkage(TASK, linkage).verdicts.sound


class TestLimits:
    """What is asked over the turn and over the way of the task, and what is returned keeps its bounds."""

    def test_an_open_end_is_the_usual_one(self) -> None:
        whole = syn.synthesize(TASK, {"crank_length": (None, None)}, search=QUICK)
        assert whole.best.error == syn.synthesize(TASK, search=QUICK).best.error
        assert syn.synthesize(TASK, {"crank_length": (0.04, np.inf)}, search=QUICK).best.linkage.crank_length >= 0.04

    def test_over_the_turn_and_over_the_task_are_two_limits(self) -> None:
        points = np.column_stack([np.linspace(0.0, 0.1, 6), np.zeros(6)])
        task = syn.TimedPath(points=points, rotation=np.linspace(0.0, 0.8, 6))
        both = (syn.LeastTransmission(angle=radians(15.0)), syn.LeastTransmission(angle=radians(60.0), over="task"))
        best = syn.synthesize(task, constraints=both, search=QUICK).best
        assert best.linkage.least_transmission >= radians(15.0) - 1e-6
        least, greatest = best.verdicts.least_transmission, best.verdicts.greatest_transmission
        assert min(least, np.pi - greatest) >= radians(60.0) - 1e-4
        normal = syn.normal_form(task)
        limits = make_limits(task, normal, None, both)
        assert (limits.turn, limits.way) == (radians(15.0), radians(60.0))
        only = make_limits(task, normal, None, (syn.FullTurn(), syn.LeastTransmission(angle=1.0, over="task")))
        assert (only.turn, only.way) == (0.0, 1.0)

    @pytest.mark.parametrize("low", [3.5, -3.5])
    def test_angles_are_returned_within_their_bounds(self, low: float) -> None:
        best = syn.synthesize(TASK, {"ground_angle": (low, low + 0.5)}, search=QUICK).best
        assert low <= best.linkage.ground_angle <= low + 0.5

    def test_a_required_angle_is_the_one_that_is_returned(self) -> None:
        asked = syn.Require(function=lambda p: p.ground_angle - 2.0, equal=True, name="ground angle")
        best = syn.synthesize(TASK, constraints=(*syn.USUAL, asked), search=QUICK).best
        assert best.linkage.ground_angle == pytest.approx(2.0, abs=1e-6)

    def test_a_region_that_is_not_convex_is_searched_through(self) -> None:
        # a box with a notch cut into it from below: as good as without, but for the notch
        x, y, half = -0.1, 0.1, 0.08
        notched = [
            (x - half, y - half), (x - 0.01, y - half), (x, y - 0.016), (x + 0.01, y - half),
            (x + half, y - half), (x + half, y + half), (x - half, y + half),
        ]  # fmt: skip
        usual, search = (*syn.USUAL, syn.LargestLink(length=1.1285)), syn.Search(starts=8, candidates=1 << 13)
        region = syn.PivotRegion(pivot="A", polygon=notched)
        best = syn.synthesize(TASK, constraints=(*usual, region), search=search).best
        boxes = [
            {"pivot_x": (x - half, x - 0.01), "pivot_y": (y - half, y + half)},
            {"pivot_x": (x + 0.01, x + half), "pivot_y": (y - half, y + half)},
            {"pivot_x": (x - half, x + half), "pivot_y": (y - 0.016, y + half)},
        ]
        inner = min(syn.synthesize(TASK, box, usual, search=search).best.error for box in boxes)
        assert best.error <= inner * (1.0 + 1e-6)

    def test_exact_points_are_ranked_by_their_transmission_angle(self) -> None:
        known = syn.synthesize(TASK, search=QUICK).best.linkage
        at = np.linspace(0.0, 4.0, 4)
        task = syn.PrecisionPoints(points=known.path(at), rotation=at)
        found = [s for s in syn.synthesize(task, search=QUICK).solutions if s.error < 1e-18]
        assert len(found) > 1
        angles = [s.linkage.least_transmission for s in found]
        assert angles == sorted(angles, reverse=True)

    def test_the_closing_step_of_a_turn_counts(self) -> None:
        links = {"ground_length": 1.0, "crank_length": 0.91687, "coupler_length": 1.00396, "rocker_length": 1.25461}
        linkage = syn.Linkage(**links, crank_phase=0.51262)
        assert not linkage.turns_fully
        solution = syn.Solution.from_linkage(syn.TimedPath(points=linkage.path(syn.turn(8))), linkage)
        assert not solution.verdicts.sound

    def test_weights_of_an_area_are_in_its_error(self) -> None:
        path = syn.TargetPath(points=ELLIPSE, closed=True)
        linkage = syn.synthesize(syn.UntimedPath(path=path, samples=24), search=QUICK).best.linkage
        shifted = replace(linkage, pivot_x=linkage.pivot_x + 1e-3)

        def error(weights: FloatArray) -> float:
            return syn.Solution.from_linkage(syn.UntimedPath(path=path, weights=weights), shifted).error

        even = np.ones(len(ELLIPSE))
        plain = error(even)
        assert error(2.0 * even) == pytest.approx(2.0 * plain, rel=1e-12)
        # all but even weights take the other way to nearly the same area
        assert error(even + 1e-9 * (np.arange(len(ELLIPSE)) == 0)) == pytest.approx(plain, rel=0.03)
        right = np.where(ELLIPSE[:, 0] > ELLIPSE[:, 0].mean(), 1.0, 0.0)
        assert error(1.0 - right) + error(right) == pytest.approx(plain, rel=0.05)
