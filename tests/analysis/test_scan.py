"""The global scan: its projections against direct evaluation, and known linkages recovered."""

from dataclasses import replace
from math import log, pi

import numpy as np
import pytest
from numpy.typing import NDArray

import analysis.synthesis as syn
from analysis.synthesis.search.fit import sum_of_squares
from analysis.synthesis.search.program import make_linkage
from analysis.synthesis.search.scan import (
    SHAPES,
    Candidates,
    _allowed_shapes,
    _clip_sizes,
    _place_shapes,
    _place_timed,
    scan,
)
from analysis.synthesis.task.limits import Limits, make_limits
from analysis.synthesis.task.task import Normal
from tests.linkages import scaled

FloatArray = NDArray[np.float64]

KNOWN = syn.Linkage(
    pivot_x=0.3, pivot_y=-0.2, ground_length=0.4, crank_length=0.15, coupler_length=0.38, rocker_length=0.3,
    point_distance=0.25, ground_angle=0.5, crank_phase=1.1, point_angle=0.7, branch=1,
)  # fmt: skip


def stated(task: syn.Task, *constraints: syn.Constraint, **bounds: tuple[float, float]) -> tuple[Normal, Limits]:
    normal = syn.normal_form(task)
    return normal, make_limits(task, normal, bounds, constraints)


def shape(linkage: syn.Linkage, *, phase: float = 0.0, distance: float = 0.0, direction: float = 0.0) -> FloatArray:
    """A row of candidates with the shape of a linkage."""
    links = np.array([linkage.crank_length, linkage.coupler_length, linkage.rocker_length]) / linkage.ground_length
    return np.array([[*links, phase, distance, direction, 0.0, 0.0, 0.0]])


def first(candidates: Candidates, normal: Normal) -> syn.Linkage:
    """The first candidate's linkage."""
    from analysis.synthesis.search.program import Start

    return make_linkage(Start(q=candidates.q[0], branch=candidates.branch), normal)


def same(a: syn.Linkage, b: syn.Linkage) -> None:
    """Make sure that they are equal to rounding, angles to whole turns."""
    for name, value in a.values().items():
        left = value - b.values()[name]
        assert (left + pi) % (2.0 * pi) - pi == pytest.approx(0.0, abs=1e-6), name


def placed(row: FloatArray, task: syn.Task, *constraints: syn.Constraint) -> tuple[Candidates, Normal]:
    normal, limits = stated(task, *constraints)
    return _place_shapes(normal, limits, row, 1, 0), normal


class TestVariableProjection:
    ROW = shape(KNOWN, phase=1.1 / (2.0 * pi))

    def test_place_size_direction_and_coupler_point_follow_from_shape_and_phase(self) -> None:
        rotation = syn.turn(16)
        found, normal = placed(self.ROW, syn.TimedPath(points=KNOWN.path(rotation), rotation=rotation))
        assert found.quality[0] == pytest.approx(0.0, abs=1e-10)
        same(first(found, normal), KNOWN)

    def test_the_size_keeps_the_bound_of_the_coupler_point(self) -> None:
        rotation = syn.turn(16)
        task = syn.TimedPath(points=KNOWN.path(rotation), rotation=rotation)
        normal, limits = stated(task, point_distance=(0.0, 0.2))
        links, point = np.array([[1.0, 0.4, 0.9, 0.8, 0.0]]), np.array([0.5j])
        size, scale = _clip_sizes(np.array([50.0j]), links, point, limits)
        assert size[0] * 0.5 * normal.unit == pytest.approx(0.2)
        assert scale[0] == pytest.approx(1j * size[0])

    def test_the_coupler_angle_follows_as_well(self) -> None:
        rotation = np.linspace(0.0, 4.0, 9)
        angle = KNOWN.coupler_angle(rotation) + 0.9
        found, normal = placed(self.ROW, syn.Motion(points=KNOWN.path(rotation), angle=angle, rotation=rotation))
        assert found.quality[0] == pytest.approx(0.0, abs=1e-10)
        same(first(found, normal), replace(KNOWN, output_angle=0.9))

    def test_rotations_of_untimed_points_are_in_order_and_go_all_round(self) -> None:
        normal, limits = stated(syn.PrecisionPoints(points=KNOWN.path(syn.turn(5))))
        shapes = np.tile(shape(KNOWN), (200, 1))
        found = _place_timed(normal, limits, shapes, 1, np.random.default_rng(3)).rotation
        assert found is not None
        steps = np.diff(found, axis=1)
        assert ((steps > 0.0).all(axis=1) | (steps < 0.0).all(axis=1)).all()
        assert (steps[:, 0] > 0.0).any()
        assert (steps[:, 0] < 0.0).any()
        assert 1.9 * pi < np.abs(found).max() < 2.0 * pi

    def test_a_rocker_function_is_compared_at_its_mounting_angle(self) -> None:
        rotation = syn.turn(12)
        angle = KNOWN.rocker_angle(rotation) + 0.4
        found, _ = placed(self.ROW, syn.RockerFunction(angle=angle, rotation=rotation, mounting=True))
        assert found.quality[0] == pytest.approx(0.0, abs=1e-20)
        assert found.q[0, 10] == pytest.approx(0.4)
        found, _ = placed(self.ROW, syn.RockerFunction(angle=angle, rotation=rotation))
        assert found.quality[0] == pytest.approx(12 * 0.4**2)

    def test_it_is_the_weighted_least_squares_optimum(self) -> None:
        """Of a target no linkage meets: no small change of place, size, direction and coupler point is better."""
        random = np.random.default_rng(0)
        points = random.normal(size=(10, 2))
        weights = random.uniform(0.2, 3.0, 10)
        task = syn.TimedPath(points=points, weights=weights)
        found, normal = placed(shape(KNOWN, phase=0.3), task)
        best = first(found, normal)
        error = syn.evaluate(task, best).error
        assert error == pytest.approx(found.quality[0] * normal.unit**2, rel=1e-8)
        others = [
            best.translate(0.01, 0.0),
            best.translate(0.0, 0.01),
            scaled(best, 1.01),
            scaled(best, 0.99),
            replace(best, ground_angle=best.ground_angle + 0.01),
            replace(best, point_distance=best.point_distance + 0.01),
            replace(best, point_angle=best.point_angle + 0.01),
        ]
        assert all(syn.evaluate(task, other).error > error for other in others)

    def test_bounds_on_links_hold_and_the_rest_follows_once_more(self) -> None:
        rotation = syn.turn(16)
        task = syn.TimedPath(points=KNOWN.path(rotation), rotation=rotation)
        found, normal = placed(self.ROW, task, syn.LargestLink(length=0.3), syn.Assembly(branch=1))
        linkage = first(found, normal)
        assert linkage.largest_link == pytest.approx(0.3)
        assert linkage.point_distance <= 0.3
        assert found.quality[0] > 1e-4
        error = syn.evaluate(task, linkage).error
        assert error == pytest.approx(found.quality[0] * normal.unit**2, rel=1e-9)
        moved = [linkage.translate(0.01, 0.0), linkage.translate(0.0, 0.01)]
        assert all(syn.evaluate(task, other).error > error for other in moved)


class TestUntimed:
    #: What `_paths` makes of the coupler point: distance as a share of the logarithm's range, direction of a turn.
    ROW = shape(KNOWN, distance=(log(0.25 / 0.4) - log(0.1)) / log(30.0), direction=0.7 / (2.0 * pi))

    def placed(self, points: FloatArray, way: int, *, closed: bool) -> tuple[Candidates, Normal, float]:
        """What is found for a curve, and how far it is from the curve; its rotations go the curve's way."""
        task = syn.UntimedPath(path=syn.TargetPath(points=points[::way], closed=closed))
        found, normal = placed(self.ROW, task, syn.LargestLink(length=2.0))
        assert found.rotation is not None
        assert np.all(np.sign(np.diff(found.rotation[0])) == way)
        traced = first(found, normal).path(found.rotation[0]) @ [1.0, 1j]
        return found, normal, np.abs(traced - normal.origin - normal.unit * normal.points).max()

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("begin", [0, 17, 90])
    def test_a_closed_curve_is_laid_over_itself_whatever_its_start_and_direction(self, begin: int, way: int) -> None:
        points = np.roll(KNOWN.path(syn.turn(120)), -begin, axis=0)
        found, normal, apart = self.placed(points, way, closed=True)
        linkage = first(found, normal)
        # to the accuracy of polylines of 64 points
        assert found.quality[0] < 1e-3 * normal.n
        for name in ("pivot_x", "pivot_y", "ground_length", "point_distance", "point_angle", "ground_angle"):
            # angles to half a step of these
            wide = 0.06 if "angle" in name else 0.012
            assert getattr(linkage, name) == pytest.approx(getattr(KNOWN, name), abs=wide), name
        assert apart < 0.03 * normal.unit

    @pytest.mark.parametrize("way", [1, -1])
    def test_an_open_piece_is_found_on_the_curve(self, way: int) -> None:
        _, normal, apart = self.placed(KNOWN.path(np.linspace(1.0, 3.3, 40)), way, closed=False)
        assert apart < 0.05 * normal.unit

    def test_precision_points_come_in_order(self) -> None:
        normal, limits = stated(
            syn.PrecisionPoints(points=KNOWN.path(np.linspace(0.0, 3.0, 5))), syn.LeastTransmission()
        )
        for start in scan(normal, limits, seed=3, candidates=4096, starts=8):
            assert start.rotation is not None
            steps = np.diff(start.rotation)
            assert np.all(steps > 0.0) or np.all(steps < 0.0)
            assert abs(start.rotation[-1] - start.rotation[0]) < 2.0 * pi


def tried(*constraints: syn.Constraint, **bounds: tuple[float, float]) -> FloatArray:
    """The shapes that are tried for a path."""
    _, limits = stated(syn.TimedPath(points=KNOWN.path(syn.turn(8))), *constraints, **bounds)
    return np.vstack(list(_allowed_shapes(limits, 0, 300)))


class TestShapes:
    @pytest.mark.parametrize("type_", ["crank-rocker", "drag-link", "double-rocker", "rocker-crank", "triple-rocker"])
    def test_only_the_type_asked_for_is_tried(self, type_: str) -> None:
        rows = tried(syn.Grashof(type=type_))
        # about one in a hundred is a drag link
        assert len(rows) > 100
        for l2, l3, l4 in rows[:, :3]:
            linkage = syn.Linkage(ground_length=1.0, crank_length=l2, coupler_length=l3, rocker_length=l4)
            assert linkage.grashof == type_

    def test_only_transmission_angles_asked_for_are_tried_within_the_ranges(self) -> None:
        rows = tried(syn.LeastTransmission(angle=0.9))
        for l2, l3, l4 in rows[:, :3]:
            linkage = syn.Linkage(ground_length=1.0, crank_length=l2, coupler_length=l3, rocker_length=l4)
            assert linkage.least_transmission >= 0.9 - 1e-12
        for column, (low, high) in zip(rows.T, SHAPES):
            assert low <= column.min()
            assert column.max() <= high

    def test_shapes_that_no_size_can_fit_are_left_out(self) -> None:
        rows = tried(ground_length=(0.3, 0.5), crank_length=(0.2, 0.25))
        assert rows[:, 0].min() >= 0.4 - 1e-12
        assert rows[:, 0].max() <= 0.25 / 0.3 + 1e-12

    def test_where_none_is_left_it_says_so(self) -> None:
        task = syn.TimedPath(points=KNOWN.path(syn.turn(8)))
        links = {"crank_length": (0.3, 0.4), "coupler_length": (1.2, 1.3), "rocker_length": (0.05, 0.1)}
        normal, limits = stated(task, syn.FullTurn(), ground_length=(1.0, 1.1), **links)
        with pytest.raises(syn.InfeasibleError, match=r"no shape of four-bar is within the bounds .* turns fully"):
            scan(normal, limits, seed=0, candidates=256, starts=4)


class TestStarts:
    def test_they_are_what_their_quality_says_and_best_first(self) -> None:
        task = syn.TimedPath(points=KNOWN.path(syn.turn(18)) + 0.01 * np.random.default_rng(0).normal(size=(18, 2)))
        normal, limits = stated(task, syn.LeastTransmission())
        starts = scan(normal, limits, seed=1, candidates=4096, starts=10)
        assert len(starts) == 10
        qualities = [s.quality for s in starts]
        assert qualities == sorted(qualities)
        for start in starts:
            assert sum_of_squares(normal, start) == pytest.approx(start.quality, rel=1e-6)
            linkage = make_linkage(start, normal)
            assert syn.evaluate(task, linkage).error == pytest.approx(start.quality * normal.unit**2, rel=1e-6)

    @pytest.mark.parametrize("closed", [True, False])
    def test_more_than_could_be_placed_are_those_that_were(self, closed: bool) -> None:
        path = syn.TargetPath(points=KNOWN.path(syn.turn(36))[: None if closed else 12], closed=closed)
        normal, limits = stated(syn.UntimedPath(path=path), syn.LargestLink(length=2.0))
        starts = scan(normal, limits, seed=1, candidates=4096, starts=4096)
        assert 0 < len(starts) < 1000
        assert max(s.quality for s in starts) < 1e6
        assert all(np.isfinite(s.rotation).all() for s in starts if s.rotation is not None)

    def test_the_same_seed_gives_the_same_and_another_others(self) -> None:
        normal, limits = stated(syn.TimedPath(points=KNOWN.path(syn.turn(18))), syn.LeastTransmission())
        a, b, c = (scan(normal, limits, seed=seed, candidates=4096, starts=5) for seed in (1, 1, 2))
        assert all((x.q == y.q).all() for x, y in zip(a, b))
        assert not all((x.q == y.q).all() for x, y in zip(a, c))

    def test_none_is_near_another(self) -> None:
        normal, limits = stated(syn.TimedPath(points=KNOWN.path(syn.turn(18))), syn.LeastTransmission())
        starts = scan(normal, limits, seed=1, candidates=8192, starts=12)
        marks = [np.array([*np.log(s.q[3:6] / s.q[2]), np.cos(s.q[8]), np.sin(s.q[8]), 5.0 * s.branch]) for s in starts]
        apart = [np.abs(a - b).max() for i, a in enumerate(marks) for b in marks[:i]]
        assert min(apart) >= 0.08

    def test_both_assemblies_are_tried_or_one(self) -> None:
        task = syn.TimedPath(points=KNOWN.path(syn.turn(18)))
        normal, limits = stated(task, syn.LeastTransmission())
        assert {s.branch for s in scan(normal, limits, seed=1, candidates=4096, starts=30)} == {1, -1}
        normal, limits = stated(task, syn.LeastTransmission(), syn.Assembly(branch=-1))
        assert {s.branch for s in scan(normal, limits, seed=1, candidates=4096, starts=30)} == {-1}
