"""Differential evolution and the downhill simplex: their quality function against the exact one, and known linkages found."""

from __future__ import annotations

import math
from dataclasses import replace
from math import pi, radians
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.synthesis import (
    USUAL,
    Constraint,
    FullTurn,
    Grashof,
    InfeasibleError,
    LargestLink,
    LeastTransmission,
    Linkage,
    Motion,
    PivotRegion,
    PrecisionPoints,
    Require,
    RockerFunction,
    Search,
    SliderUnknown,
    SynthesisInterrupted,
    TargetPath,
    Task,
    TimedPath,
    UntimedPath,
    normal_form,
    synthesize,
    turn,
)
from analysis.synthesis import black_box as module
from analysis.synthesis.black_box import BlackBox, by_differential_evolution, by_simplex, initial_simplex
from analysis.synthesis.constraints import limits_of
from analysis.synthesis.polish import Polished, quality_of
from analysis.synthesis.starts import start_of
from linkwork.errors import InputError
from tests.linkages import drawn, ellipse

FloatArray = NDArray[np.float64]
ELLIPSE = ellipse(18)
TASK = TimedPath(points=ELLIPSE)
SMALL = LargestLink(length=0.5)


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorter searches than a user's."""
    monkeypatch.setattr(module, "GENERATIONS", 60)
    monkeypatch.setattr(module, "EVALUATIONS", 150)


def box(task: Task, *constraints: Constraint, branch: int = 1) -> BlackBox:
    normal = normal_form(task)
    return BlackBox(normal, limits_of(task, normal, None, constraints), branch)


def unknowns(black: BlackBox, linkage: Linkage, *more: float) -> FloatArray:
    """A linkage as a row of the black box's unknowns."""
    q = start_of(linkage, black.normal).q
    return np.array([[*q[black.limits.high > black.limits.low], *more]])


class TestInitialSimplex:
    @pytest.mark.parametrize("n", [2, 4, 10])
    def test_it_is_regular(self, n: int) -> None:
        first = np.random.default_rng(n).normal(size=n)
        vertices = initial_simplex(first, 0.3)
        assert vertices.shape == (n + 1, n)
        assert (vertices[0] == first).all()
        apart = np.linalg.norm(vertices[:, None] - vertices[None, :], axis=2)
        np.testing.assert_allclose(apart[~np.eye(n + 1, dtype=bool)], 0.3, rtol=1e-12)


class TestQuality:
    KNOWN = replace(drawn(np.random.default_rng(5), least=0.6), branch=1)

    def tasks(self) -> dict[str, Task]:
        linkage, phi = self.KNOWN, np.linspace(0.0, 4.0, 7)
        points = linkage.path(phi) + 0.05 * np.random.default_rng(0).normal(size=(7, 2))
        angle = linkage.coupler_angle(phi) + 0.1 * np.sin(phi)
        weights = np.linspace(1.0, 2.0, 7)
        return {
            "timed": TimedPath(points=points, rotation=phi, weights=weights),
            "motion": Motion(points=points, angle=angle, rotation=phi, weights=weights),
            "rocker": RockerFunction(
                angle=linkage.rocker_angle(phi) + 0.1 * phi, rotation=phi, mounting=True, weights=weights
            ),
        }

    @pytest.mark.parametrize("kind", ["timed", "motion", "rocker"])
    def test_timed_it_is_that_of_the_exact_kernels(self, kind: str) -> None:
        black = box(self.tasks()[kind])
        # of a rocker function the ground link is given
        linkage = self.KNOWN.scaled(0.1 / self.KNOWN.ground_length) if kind == "rocker" else self.KNOWN
        expected = quality_of(black.normal, start_of(linkage, black.normal))
        x = unknowns(black, linkage)
        assert black.quality(np.vstack([x, x]))[1] == pytest.approx(expected, rel=1e-12)

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_a_closed_path_it_vanishes_on_the_curve_itself(self, way: int) -> None:
        points = self.KNOWN.path(turn(240))[::way]
        black = box(UntimedPath(path=TargetPath(points=points, closed=True)))
        # the crank's phase is where the path starts
        assert black.quality(unknowns(black, self.KNOWN))[0] < 1.5e-4 * black.normal.n
        assert black.quality(unknowns(black, self.KNOWN.moved(0.05, 0.0)))[0] > 3e-4 * black.normal.n

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_an_open_path_it_vanishes_on_the_piece_itself(self, way: int) -> None:
        points = self.KNOWN.path(np.linspace(0.0, 2.0, 60) * way)
        black = box(UntimedPath(path=TargetPath(points=points, closed=False)))
        assert black.quality(unknowns(black, self.KNOWN, 2.0))[0] < 1e-5 * black.normal.n
        # more or less of the curve than the target is no match
        for span in (1.0, 3.0):
            assert black.quality(unknowns(black, self.KNOWN, span))[0] > 1e-3 * black.normal.n

    def test_a_curve_that_collapses_onto_the_target_is_far_from_it(self) -> None:
        """One-sided, a point on the target would be perfect."""
        points = self.KNOWN.path(turn(120))
        black = box(UntimedPath(path=TargetPath(points=points, closed=True)))
        tiny = self.KNOWN.scaled(1e-3)
        tiny = tiny.moved(points[3, 0] - tiny.path([0.0])[0, 0], points[3, 1] - tiny.path([0.0])[0, 1])
        assert black.quality(unknowns(black, tiny))[0] > 0.05 * black.normal.n

    @pytest.mark.parametrize("poses", [False, True])
    def test_points_are_met_by_the_nearest_places_in_their_order(self, poses: bool) -> None:
        phi = np.array([0.1, 1.0, 2.5, 3.7, 5.0])
        task = PrecisionPoints(
            points=self.KNOWN.path(phi),
            angle=self.KNOWN.coupler_angle(phi) - self.KNOWN.output_angle if poses else None,
        )
        black = box(task)
        linkage = replace(self.KNOWN, output_angle=0.0)
        x = unknowns(black, linkage)
        assert black.quality(x)[0] < 1e-6
        np.testing.assert_allclose(black._rotations(x, black._linkages(x))[0], phi, atol=0.02)
        # backwards they come in order as well, shuffled they do not
        back = box(replace(task, points=task.points[::-1], angle=None if task.angle is None else task.angle[::-1]))
        assert back.quality(unknowns(back, linkage))[0] < 1e-6
        mixed = np.array([0, 3, 1, 4, 2])
        shuffled = box(
            replace(task, points=task.points[mixed], angle=None if task.angle is None else task.angle[mixed])
        )
        assert shuffled.quality(unknowns(shuffled, linkage))[0] > 1e-3

    def test_the_order_is_the_best_there_is(self) -> None:
        """Against all choices of places on a coarse curve."""
        from itertools import combinations

        task = PrecisionPoints(points=np.array([[0.0, 0.0], [1.0, 0.3], [0.2, 0.9]]))
        black = box(task)
        linkage = drawn(np.random.default_rng(11))
        linkage = replace(linkage, branch=1)
        x = unknowns(black, linkage)
        points = black.normal.origin + black.normal.unit * black.normal.points
        curve = linkage.path(2.0 * pi * np.arange(60) / 60) @ np.array([1.0, 1j])
        brute = min(
            float((np.abs(curve[list(chosen)][::way] - points) ** 2).sum())
            for chosen in combinations(range(60), 3)
            for way in (1, -1)
        )
        found = black.quality(x)[0] * black.normal.unit**2
        assert found <= brute * (1.0 + 1e-6)
        assert found > 0.9 * brute - 0.01


class TestGrading:
    APART = Linkage(ground_length=0.4, crank_length=0.1, coupler_length=0.2, rocker_length=0.25, point_distance=0.1)

    def test_what_cannot_be_joined_is_graded(self) -> None:
        black = box(TASK, FullTurn())
        charges, violations = [], []
        for length in np.linspace(0.15, 0.45, 30):
            x = unknowns(black, replace(self.APART, rocker_length=length))
            charges.append(black.charged(x)[0])
            violations.append(float(np.maximum(black.violations(x), 0.0).sum()))
        assert np.isfinite(charges).all()
        # the nearer to joining, the less: no plateau, no cliff
        joined = np.array(violations) == 0.0
        assert joined.any()
        assert not joined.all()
        assert np.all(np.diff(np.array(violations)[~joined]) < 0.0)
        assert np.all(np.diff(np.array(charges)[~joined]) < 0.0)
        assert np.abs(np.diff(charges)).max() < 0.2 * np.ptp(charges)

    def test_what_cannot_be_joined_is_stretched_along_the_line_from_b_to_d(self) -> None:
        black = box(TASK)
        q = black._linkages(unknowns(black, self.APART))
        phi = np.array([[2.5, 3.5]])
        coupler, rocker = black._directions(q, phi)
        dx, dy = black._pins(q, phi)
        c = q[0, 4] * coupler
        np.testing.assert_allclose((c * (dx - 1j * dy)).imag, 0.0, atol=1e-12)
        np.testing.assert_allclose(c - q[0, 5] * rocker, dx + 1j * dy, atol=1e-12)
        # equal power: |BC|^2 - l3^2 = |DC|^2 - l4^2
        power = [np.abs(link) ** 2 * q[0, k] ** 2 - q[0, k] ** 2 for link, k in ((coupler, 4), (rocker, 5))]
        np.testing.assert_allclose(power[0], power[1], atol=1e-12)

    def test_at_the_limit_of_assembly_the_quality_is_continuous(self) -> None:
        # l1 + l2 = l3 + l4 at half a turn
        limit = replace(self.APART, rocker_length=0.3)
        black = box(TASK)
        values = [
            black.quality(unknowns(black, replace(limit, rocker_length=0.3 + step)))[0] for step in (-1e-9, 0.0, 1e-9)
        ]
        np.testing.assert_allclose(values, values[1], rtol=1e-3)

    def test_violations_are_those_of_the_constraints(self) -> None:
        square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        good = Linkage(
            pivot_x=0.3,
            pivot_y=0.4,
            ground_length=0.4,
            crank_length=0.1,
            coupler_length=0.35,
            rocker_length=0.3,
            ground_angle=0.5,
        )
        for constraint, bad in (
            (LeastTransmission(angle=radians(50)), replace(good, crank_length=0.25)),
            (LeastTransmission(angle=radians(50)), replace(good, coupler_length=0.25, rocker_length=0.28)),
            (FullTurn(), replace(good, crank_length=0.3)),
            (Grashof(type="crank-rocker"), replace(good, crank_length=0.3)),
            (PivotRegion(pivot="A", polygon=square), replace(good, pivot_x=-0.2)),
            (PivotRegion(pivot="D", polygon=square), replace(good, pivot_x=0.9)),
            (Require(function=lambda p: math.sin(p.ground_angle) - 0.5), replace(good, ground_angle=1.0)),
            (Require(function=lambda p: p.pivot_x - 0.3, equal=True), replace(good, pivot_x=0.31)),
        ):
            black = box(TASK, constraint)
            assert (black.violations(unknowns(black, good)) <= 0.0).all(), constraint
            assert (black.violations(unknowns(black, bad)) > 0.0).any(), constraint


METHODS: dict[str, Any] = {"differential-evolution": by_differential_evolution, "simplex": by_simplex}


class TestSearch:
    @pytest.mark.parametrize("method", METHODS)
    def test_a_rocker_function_of_a_known_linkage_is_found(self, method: Any) -> None:
        linkage = Linkage(
            ground_length=0.1, crank_length=0.03, coupler_length=0.09, rocker_length=0.07, crank_phase=0.8
        )
        task = RockerFunction(angle=linkage.rocker_angle(turn(24)))
        result = synthesize(task, search=Search(method=method, starts=8))
        assert result.best.evaluation.worst < 0.02
        assert result.method == method
        assert result.starts == 8
        assert result.best.linkage.least_transmission > radians(39.9)

    @pytest.mark.parametrize("method", METHODS)
    def test_a_seed_gives_the_same_on_any_number_of_cores(self, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
        # another process has the module as it is
        monkeypatch.undo()
        task = RockerFunction(angle=1.2 + 0.4 * np.sin(turn(12)))
        normal = normal_form(task)
        limits = limits_of(task, normal, None, USUAL)
        one, again, two, other = (
            METHODS[method](normal, limits, Search(seed=seed, starts=2, n_jobs=n))
            for seed, n in ((1, 1), (1, 1), (1, 2), (2, 1))
        )

        def found(p: Polished) -> list[list[float]]:
            return [a.start.q.tolist() for a in (*p.kept, *p.others)]

        assert found(again) == found(one)
        assert found(two) == found(one)
        assert found(other) != found(one)

    @pytest.mark.slow
    @pytest.mark.parametrize("method", METHODS)
    @pytest.mark.parametrize(
        "task",
        [
            UntimedPath(path=TargetPath(points=ELLIPSE, closed=True), samples=24),
            UntimedPath(path=TargetPath(points=ELLIPSE[:8], closed=False), samples=12),
            PrecisionPoints(points=ELLIPSE[:8:2]),
            Motion(points=ELLIPSE[:5], angle=np.linspace(0.0, 0.5, 5)),
        ],
        ids=["closed", "open", "points", "poses"],
    )
    def test_untimed_tasks_are_answered(self, method: Any, task: Task) -> None:
        solution = synthesize(task, search=Search(method=method, starts=2), constraints=[FullTurn(), SMALL]).best
        assert solution.evaluation.worst < 0.1
        assert solution.verdicts.order

    def test_convergence_is_counted(self) -> None:
        linkage = Linkage(
            ground_length=0.1, crank_length=0.03, coupler_length=0.09, rocker_length=0.07, crank_phase=0.8
        )
        task = RockerFunction(angle=linkage.rocker_angle(turn(24)) + 0.01 * np.sin(3.0 * turn(24)))
        normal = normal_form(task)
        done = by_simplex(normal, limits_of(task, normal, None, USUAL), search=Search(seed=0, starts=6))
        best = done.kept[0].start.quality
        assert 1 <= done.reaching(best) <= 6
        assert done.reaching(0.5 * best) == 0
        assert done.reaching(np.inf) == len(done.kept)
        assert all(a.iterations > 10 for a in done.kept)

    @pytest.mark.parametrize("method", METHODS)
    def test_what_cannot_be_is_said_by_name(self, method: Any) -> None:
        impossible = Require(function=lambda p: 2.0 - math.cos(p.point_angle), name="a cosine of two")
        with pytest.raises(InfeasibleError, match="violates the a cosine of two by 1"):
            synthesize(TASK, search=Search(method=method, starts=2), constraints=[impossible])

    @pytest.mark.parametrize("method", METHODS)
    @pytest.mark.parametrize(
        "function",
        [
            lambda p: 0.2 - math.sqrt(p.crank_length - 0.05),
            lambda p: 0.2 - (p.crank_length - 0.05) ** 0.5,
            lambda p: 0.2 - np.sqrt(p.crank_length - 0.05),
            lambda p: 1.0 / max(p.crank_length - 0.09, 0.0) - 1e6,
            lambda p: math.exp(1e4 * (0.1 - p.crank_length)) - 2.0,
        ],
    )
    def test_a_requirement_without_a_value_is_violated(self, method: Any, function: Any) -> None:
        """Crank lengths from 90 mm on have one: what is below is no error, and no solution."""
        constraints = [SMALL, Require(function=function, name="own")]
        found = synthesize(TASK, search=Search(method=method, starts=2), constraints=constraints)
        assert found.best.linkage.crank_length > 0.0899

    @pytest.mark.parametrize("method", METHODS)
    def test_a_linkage_whose_every_dimension_is_fixed_is_evaluated(self, method: Any) -> None:
        linkage = drawn(np.random.default_rng(3), least=0.7)
        bounds = {n: (v, v) for n, v in linkage.values().items() if n not in ("branch", "output_angle")}
        task = TimedPath(points=linkage.path(turn(9)) + 1e-3)
        found = synthesize(task, bounds, (), search=Search(method=method, starts=2))
        assert found.best.error == pytest.approx(9 * 2e-6, rel=1e-9)

    @pytest.mark.parametrize("method", METHODS)
    def test_interrupted_it_hands_over_the_best_so_far(self, method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        import signal

        real = module.BlackBox.answer

        def answer(self: BlackBox, result: Any) -> Any:
            signal.raise_signal(signal.SIGINT)
            return real(self, result)

        monkeypatch.setattr(module.BlackBox, "answer", answer)
        with pytest.raises(SynthesisInterrupted, match="stopped after 1 of 50 searches") as caught:
            synthesize(TASK, search=Search(method=method, starts=50), constraints=[SMALL])
        assert caught.value.synthesis is not None
        assert not caught.value.synthesis.complete

    def test_bad_calls(self) -> None:
        with pytest.raises(InputError, match="searches linkages with a fixed pivot: use 'scan'"):
            synthesize(TASK, search=Search(method="simplex"), pivot=SliderUnknown(harmonics=1))
        with pytest.raises(InputError, match="0 cores"):
            synthesize(TASK, search=Search(method="simplex", n_jobs=0))
