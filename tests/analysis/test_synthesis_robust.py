"""Targets that the methods were not made for: from the literature, noisy, scaled, moved, and such as no four-bar can trace."""

from dataclasses import replace
from functools import cache
from math import pi
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import analysis.synthesis as syn
from analysis.synthesis.task.target import formula

pytest.importorskip("casadi")
FloatArray = NDArray[np.float64]
T = syn.turn(80)


def best(task: syn.Task, *, candidates: int = 1 << 13, starts: int = 6, **more: Any) -> syn.Solution:
    solution = syn.synthesize(task, search=syn.Search(candidates=candidates, starts=starts), **more).best
    assert solution.verdicts.sound
    return solution


def traced(points: FloatArray, *, closed: bool = True, **more: Any) -> syn.UntimedPath:
    return syn.UntimedPath(path=syn.TargetPath(points=points, closed=closed), **more)


# the 18 points of a closed curve, 20 degrees of the crank apart, of Acharyya and Mandal (2009) and Cabrera et al.
EIGHTEEN = np.array(
    [
        (0.5, 1.1), (0.4, 1.1), (0.3, 1.1), (0.2, 1.0), (0.1, 0.9), (0.05, 0.75), (0.02, 0.6), (0.0, 0.5), (0.0, 0.4),
        (0.03, 0.3), (0.1, 0.25), (0.15, 0.2), (0.2, 0.3), (0.3, 0.4), (0.4, 0.5), (0.5, 0.7), (0.6, 0.9), (0.6, 1.0),
    ]
)  # fmt: skip
#: Sums of squares in that literature are given as 0.01 to 0.04; not checked against the papers themselves.
REPORTED = 0.0105
# six points on a vertical line, from the same literature
VERTICAL = np.array([(20.0, 20.0 + 5.0 * k) for k in range(6)])


class TestLiterature:
    def test_eighteen_timed_points(self) -> None:
        task = syn.TimedPath(points=EIGHTEEN, rotation=np.radians(20.0) * np.arange(18))
        # links up to 50, the crank turning fully
        loose = best(task, constraints=[syn.FullTurn(), syn.LargestLink(length=50.0)])
        assert loose.error < 0.0092 < REPORTED
        assert loose.verdicts.full_turn
        # and fit to be built
        usual = best(task)
        assert loose.error <= usual.error < REPORTED
        assert usual.linkage.least_transmission >= 0.698

    def test_six_points_of_a_vertical_line_are_met(self) -> None:
        limits = [syn.FullTurn(), syn.LargestLink(length=60.0)]
        solution = best(syn.PrecisionPoints(points=VERTICAL), constraints=limits, starts=12)
        assert solution.evaluation.worst < 1e-6


class TestShapes:
    def test_a_circle_is_that_of_the_crank_pin(self) -> None:
        circle = np.column_stack([np.cos(T), np.sin(T)])
        solution = best(traced(circle), candidates=1 << 12, starts=1)
        # a circle that cuts each side at a quarter and three quarters of it leaves a quarter of the sagitta all round
        assert solution.error < 0.2501 * 2.0 * pi * (1.0 - np.cos(pi / len(T)))
        assert solution.linkage.point_distance < 1e-3

    def test_a_straight_line(self) -> None:
        line = np.column_stack([np.linspace(0.0, 1.0, 21), np.zeros(21)])
        solution = best(traced(line, closed=False, measure="distance", samples=24), candidates=1 << 12, starts=4)
        assert solution.evaluation.worst < 2e-3
        assert solution.rotation[-1] != solution.rotation[0]

    def test_a_leaf_with_a_cusp(self) -> None:
        leaf = np.column_stack([np.cos(T), 0.8 * np.sin(T) * np.sin(T / 2.0) ** 2])
        task = traced(leaf, samples=48)
        solution = best(task)
        # of 1.26 inside, and hardly any of it in the tip
        assert solution.error < 0.015
        tip = best(replace(task, objective="worst"))
        assert tip.value < 0.06 < 0.1 < solution.evaluation.worst

    def test_a_figure_of_eight(self) -> None:
        eight = np.column_stack([np.sin(T), 0.5 * np.sin(2.0 * T)])
        task = traced(eight, samples=48)
        solution = best(task, constraints=[syn.FullTurn()])
        # of 1.33 inside
        assert solution.error < 0.3

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("x", "y", "span", "least"),
        [
            # an eight, closed in itself but asked as an open path; one with lobes of two sizes; a cycloid with a loop
            ("sin(t)", "0.5*sin(2*t)", (0.0, 2.0 * pi), 0.5301),
            ("(0.75+0.25*sign(sin(t)))*sin(t)", "(0.75+0.25*sign(sin(t)))*0.5*sin(2*t)", None, 0.1765),
            ("t/2 - 1.1*sin(t)", "-cos(t)", (-0.75 * pi, 0.75 * pi), 0.1246),
        ],
        ids=["open eight", "two lobes", "loop"],
    )
    def test_what_crosses_itself(self, x: str, y: str, span: tuple[float, float] | None, least: float) -> None:
        """What a descent on the area reaches from the starts themselves; of fits of squares, six gave 0.589, 0.187, 0.125."""
        n = 60 if span and span[0] else 81
        t = np.linspace(*span, n) if span else T
        points = np.column_stack([formula(text)(t) for text in (x, y)])
        solution = syn.synthesize(traced(points, closed=span is None)).best
        assert solution.verdicts.sound
        assert solution.error <= 1.01 * least

    def test_a_noisy_curve_drawn_by_hand_is_smoothed_first(self) -> None:
        clean = np.column_stack([1.2 * np.cos(T), 0.7 * np.sin(T) + 0.2 * np.cos(2.0 * T)])
        noisy = clean + 0.02 * np.random.default_rng(0).normal(size=clean.shape)
        task = syn.UntimedPath(path=syn.TargetPath(points=noisy, closed=True).smooth(72), samples=48)
        solution = best(task)
        assert solution.error < 0.05
        # nearer to what was meant than what was drawn is
        from analysis.synthesis import area_difference

        meant = syn.TargetPath(points=clean, closed=True)
        assert area_difference(solution.curve(), meant) < 1.5 * area_difference(noisy, meant)


def transformed(points: FloatArray, scale: float, turned: float, moved: complex) -> FloatArray:
    z = scale * np.exp(1j * turned) * (points @ [1.0, 1j]) + scale * moved
    return np.column_stack([z.real, z.imag])


class TestSimilarity:
    """The same shape in another size, place and direction is the same problem."""

    CURVE = np.column_stack([np.cos(syn.turn(24)), 0.5 * np.sin(syn.turn(24)) + 0.1 * np.cos(2.0 * syn.turn(24))])

    @classmethod
    @cache
    def done(cls, kind: str, scale: float, turned: float, moved: complex) -> float:
        """How well the curve is done in another size, place and direction, in its unit."""
        points = transformed(cls.CURVE, scale, turned, moved)
        task: syn.Task = syn.TimedPath(points=points)
        if kind == "closed":
            task = traced(points, measure="distance", samples=24)
        if kind == "open":
            task = traced(points[:10], closed=False, measure="distance", samples=24)
        solution = best(task, starts=4, candidates=1 << 12)
        return float(solution.error / syn.normal_form(task).unit ** 2)

    @pytest.mark.slow
    @pytest.mark.parametrize(("scale", "turned", "moved"), [(1e3, 0.0, 0.0), (1.0, 0.0, 1e6), (1e-3, 2.0, 1e3j)])
    @pytest.mark.parametrize("kind", ["timed", "closed", "open"])
    def test_it_is_done_as_well(self, kind: str, scale: float, turned: float, moved: complex) -> None:
        # the unit is the diagonal of the bounding box, which turns with the shape: compared in the size of the shape
        plain, other = transformed(self.CURVE, 1.0, 0.0, 0.0), transformed(self.CURVE, scale, turned, moved)
        size = [float(np.hypot(*np.ptp(p[:10] if kind == "open" else p, axis=0))) for p in (plain, other)]
        expected = self.done(kind, 1.0, 0.0, 0.0) * size[0] ** 2
        found = self.done(kind, scale, turned, moved) * (size[1] / scale) ** 2
        assert found <= expected * (1.0 + 1e-3) + 1e-12


class TestBeyondAFourBar:
    """What it cannot do is answered with the best there is, and how far off that is."""

    def test_a_star(self) -> None:
        z = np.where(np.arange(10) % 2 == 0, 1.0, 0.4) * np.exp(1j * pi * np.arange(10) / 5.0)
        solution = best(traced(np.column_stack([z.real, z.imag]), samples=40))
        assert 0.1 < solution.evaluation.worst < 0.6
        assert 0.3 < solution.error < 1.0
