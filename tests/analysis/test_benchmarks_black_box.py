"""Differential evolution and the downhill simplex: their quality function against the exact one, and their first simplex."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest
from numpy.typing import NDArray

import analysis.synthesis as syn
from analysis.synthesis.search.fit import sum_of_squares
from analysis.synthesis.search.program import make_start
from analysis.synthesis.task.limits import make_limits
from benchmarks.black_box import BlackBox, initial_simplex
from tests.linkages import drawn, ellipse, scaled

FloatArray = NDArray[np.float64]
ELLIPSE = ellipse(18)
TASK = syn.TimedPath(points=ELLIPSE)
SMALL = syn.LargestLink(length=0.5)


def box(task: syn.Task, *constraints: syn.Constraint, branch: int = 1) -> BlackBox:
    normal = syn.normal_form(task)
    return BlackBox(normal, make_limits(task, normal, None, constraints), branch)


def unknowns(black: BlackBox, linkage: syn.Linkage, *more: float) -> FloatArray:
    """A linkage as a row of the black box's unknowns."""
    q = make_start(linkage, black.normal).q
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

    def tasks(self) -> dict[str, syn.Task]:
        linkage, phi = self.KNOWN, np.linspace(0.0, 4.0, 7)
        points = linkage.path(phi) + 0.05 * np.random.default_rng(0).normal(size=(7, 2))
        angle, weights = linkage.rocker_angle(phi) + 0.1 * phi, np.linspace(1.0, 2.0, 7)
        return {
            "timed": syn.TimedPath(points=points, rotation=phi, weights=weights),
            "rocker": syn.RockerFunction(angle=angle, rotation=phi, mounting=True, weights=weights),
        }

    @pytest.mark.parametrize("kind", ["timed", "rocker"])
    def test_timed_it_is_that_of_the_exact_kernels(self, kind: str) -> None:
        black = box(self.tasks()[kind])
        # of a rocker function the ground link is given
        linkage = scaled(self.KNOWN, 0.1 / self.KNOWN.ground_length) if kind == "rocker" else self.KNOWN
        expected = sum_of_squares(black.normal, make_start(linkage, black.normal))
        x = unknowns(black, linkage)
        assert black.quality(np.vstack([x, x]))[1] == pytest.approx(expected, rel=1e-12)

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_a_closed_path_it_vanishes_on_the_curve_itself(self, way: int) -> None:
        points = self.KNOWN.path(syn.turn(240))[::way]
        black = box(syn.UntimedPath(path=syn.TargetPath(points=points, closed=True)))
        # the crank's phase is where the path starts
        assert black.quality(unknowns(black, self.KNOWN))[0] < 1.5e-4 * black.normal.n
        assert black.quality(unknowns(black, self.KNOWN.translate(0.05, 0.0)))[0] > 3e-4 * black.normal.n

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_an_open_path_it_vanishes_on_the_piece_itself(self, way: int) -> None:
        points = self.KNOWN.path(np.linspace(0.0, 2.0, 60) * way)
        black = box(syn.UntimedPath(path=syn.TargetPath(points=points, closed=False)))
        assert black.quality(unknowns(black, self.KNOWN, 2.0))[0] < 1e-5 * black.normal.n
        # more or less of the curve than the target is no match
        for span in (1.0, 3.0):
            assert black.quality(unknowns(black, self.KNOWN, span))[0] > 1e-3 * black.normal.n

    def test_a_curve_that_collapses_onto_the_target_is_far_from_it(self) -> None:
        """One-sided, a point on the target would be perfect."""
        points = self.KNOWN.path(syn.turn(120))
        black = box(syn.UntimedPath(path=syn.TargetPath(points=points, closed=True)))
        tiny = scaled(self.KNOWN, 1e-3)
        tiny = tiny.translate(points[3, 0] - tiny.path([0.0])[0, 0], points[3, 1] - tiny.path([0.0])[0, 1])
        assert black.quality(unknowns(black, tiny))[0] > 0.05 * black.normal.n


class TestGrading:
    APART = syn.Linkage(ground_length=0.4, crank_length=0.1, coupler_length=0.2, rocker_length=0.25, point_distance=0.1)

    def test_what_cannot_be_joined_is_graded(self) -> None:
        black = box(TASK, syn.FullTurn())
        charges, violations = [], []
        for length in np.linspace(0.15, 0.45, 30):
            x = unknowns(black, replace(self.APART, rocker_length=length))
            charges.append(black.penalised_qualities(x)[0])
            violations.append(float(np.maximum(black.violations(x), 0.0).sum()))
        assert np.isfinite(charges).all()
        # the nearer to joining, the less: no plateau, no cliff
        joined = np.array(violations) == 0.0
        assert joined.any()
        assert not joined.all()
        assert np.all(np.diff(np.array(violations)[~joined]) < 0.0)
        assert np.all(np.diff(np.array(charges)[~joined]) < 0.0)
        assert np.abs(np.diff(charges)).max() < 0.2 * np.ptp(charges)

    def test_at_the_limit_of_assembly_the_quality_is_continuous(self) -> None:
        # l1 + l2 = l3 + l4 at half a turn
        limit = replace(self.APART, rocker_length=0.3)
        black = box(TASK)
        near = [replace(limit, rocker_length=0.3 + step) for step in (-1e-9, 0.0, 1e-9)]
        values = [black.quality(unknowns(black, linkage))[0] for linkage in near]
        np.testing.assert_allclose(values, values[1], rtol=1e-3)

    def test_violations_are_those_of_the_constraints(self) -> None:
        good = syn.Linkage(
            pivot_x=0.3, pivot_y=0.4, ground_length=0.4, crank_length=0.1, coupler_length=0.35,
            rocker_length=0.3, ground_angle=0.5,
        )  # fmt: skip
        for constraint, bad in (
            (syn.LeastTransmission(angle=radians(50)), replace(good, crank_length=0.25)),
            (syn.LeastTransmission(angle=radians(50)), replace(good, coupler_length=0.25, rocker_length=0.28)),
            (syn.FullTurn(), replace(good, crank_length=0.3)),
        ):
            black = box(TASK, constraint)
            assert (black.violations(unknowns(black, good)) <= 0.0).all(), constraint
            assert (black.violations(unknowns(black, bad)) > 0.0).any(), constraint
