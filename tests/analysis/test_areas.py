"""Areas and distances between curves, and the flatness of straight parts; of published linkages see
`test_published_synthesis`.
"""

from math import cos, pi, sin

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.distance import directed_hausdorff

from analysis.synthesis import TargetPath, area_difference, curve_distance, hausdorff, path_from_formula, straightness
from linkwork.errors import InputError

FloatArray = NDArray[np.float64]


def circle(radius: float, n: int = 720, centre: tuple[float, float] = (0.0, 0.0)) -> FloatArray:
    t = np.linspace(0.0, 2.0 * pi, n, endpoint=False)
    return np.column_stack([centre[0] + radius * np.cos(t), centre[1] + radius * np.sin(t)])


def arc(radius: float, start: float, end: float, n: int = 2000) -> FloatArray:
    t = np.linspace(start, end, n)
    return np.column_stack([radius * np.cos(t), radius * np.sin(t)])


def open_target(*points: tuple[float, float]) -> TargetPath:
    return TargetPath(points=np.array(points), closed=False)


def closed_target(points: FloatArray) -> TargetPath:
    return TargetPath(points=points, closed=True)


# Area


def test_area_between_circles() -> None:
    assert area_difference(circle(1.0), closed_target(circle(2.0))) == pytest.approx(3.0 * pi, rel=1e-4)
    # the lens of two unit circles a distance 1 apart
    lens = 2.0 * pi / 3.0 - 3.0**0.5 / 2.0
    moved = closed_target(circle(1.0, centre=(1.0, 0.0)))
    assert area_difference(circle(1.0), moved) == pytest.approx(2.0 * (pi - lens), rel=1e-4)
    swapped = area_difference(moved.points, closed_target(circle(1.0)))
    assert area_difference(circle(1.0), moved) == pytest.approx(swapped, rel=1e-12)
    apart = closed_target(circle(1.0, centre=(5.0, 0.0)))
    assert area_difference(circle(1.0), apart) == pytest.approx(2.0 * pi, rel=1e-4)


def test_area_between_a_curve_and_itself_is_none() -> None:
    points = circle(0.3, 72, centre=(20.0, -7.0))
    assert area_difference(points, closed_target(points)) < 1e-15
    assert area_difference(np.roll(points[::-1], 5, axis=0), closed_target(points)) < 1e-15
    assert area_difference(points[:50], open_target(*points[:50].tolist()), closed=False) < 1e-12


@settings(max_examples=30)
@given(st.lists(st.floats(0.2, 1.0), min_size=12, max_size=12), st.lists(st.floats(0.2, 1.0), min_size=7, max_size=7))
def test_area_between_polygons_is_that_of_shapelys_overlay(first: list[float], second: list[float]) -> None:
    a, b = (np.array(r)[:, None] * circle(1.0, len(r)) + shift for r, shift in ((first, 0.0), (second, 0.1)))
    expected = shapely.symmetric_difference(shapely.Polygon(a), shapely.Polygon(b)).area
    assert area_difference(a, closed_target(b)) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("repeats", [70, 71, 300])
def test_a_curve_may_rest_and_go_to_and_fro(repeats: int) -> None:
    """Many points at one place, or many times along one side: both bound nothing, or one side; no memory is overwritten."""
    square = closed_target(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]))
    resting = np.array([(0.25, 0.0)] * repeats + [(1.0, 0.0), (1.0, 2.0), (0.0, 2.0)])
    expected = shapely.symmetric_difference(shapely.Polygon(resting), shapely.Polygon(square.points)).area
    assert area_difference(resting, square) == pytest.approx(expected, rel=1e-12)
    to_and_fro = np.array([(0.0, 0.0), (1.0, 0.0)] * repeats + [(1.0, 2.0), (0.0, 2.0)])
    assert area_difference(to_and_fro, square) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_area_does_not_depend_on_place_and_scale(scale: float) -> None:
    for end, closed in ((None, True), (300, False)):
        first, second = circle(1.0)[:end], (circle(1.0, centre=(0.3, 0.1)) * [1.0, 0.7])[:end]
        area, moved = (
            area_difference(a, TargetPath(points=b, closed=closed), closed=closed)
            for a, b in ((first, second), (scale * (first + 1e4), scale * (second + 1e4)))
        )
        assert moved == pytest.approx(scale**2 * area, rel=1e-7)


def test_area_between_parallel_open_curves_is_that_of_the_strip() -> None:
    flat = open_target((0.0, 0.0), (2.0, 0.0))
    assert area_difference([[2.0, 0.1], [0.0, 0.1]], flat, closed=False) == pytest.approx(0.2)
    inner = TargetPath(points=arc(1.0, 0.3, 2.5), closed=False)
    sector = 0.5 * 2.2 * (1.1**2 - 1.0)
    assert area_difference(arc(1.1, 0.3, 2.5), inner, closed=False) == pytest.approx(sector, rel=1e-5)


def test_area_between_open_curves_is_symmetric_and_sees_missing_and_spare_length() -> None:
    flat, half = open_target((0.0, 0.0), (1.0, 0.0)), np.array([[0.0, 0.0], [0.5, 0.0]])
    # half of the integral of s ds from 0 to 1/2 that is missed
    for curve, target in ((half, flat), (flat.points, TargetPath(points=half, closed=False))):
        assert area_difference(curve, target, closed=False) == pytest.approx(0.0625, rel=1e-5)
    wave = path_from_formula("t", "0.2*sin(t)", n=300, end=5.0)
    other = path_from_formula("t + 0.1", "0.3*sin(t) + 0.05", n=200, end=4.5)
    area = area_difference(wave.points, other, closed=False)
    assert area_difference(other.points, wave, closed=False) == pytest.approx(area, rel=1e-12)
    assert area_difference(wave.points[::-1], other, closed=False) == pytest.approx(area, rel=1e-9)


def test_a_closed_curve_may_trace_an_open_target_on_part_of_its_way() -> None:
    target = TargetPath(points=arc(1.1, 0.0, pi), closed=False)
    assert area_difference(circle(1.0), target) == pytest.approx(0.1 * 1.1 * pi, rel=1e-4)
    # and an open curve of a closed target: both integrals
    part = arc(1.0, 0.0, pi)
    both = area_difference(part, closed_target(circle(1.0)), closed=False)
    missed = area_difference(circle(1.0), TargetPath(points=part, closed=False))
    assert missed == pytest.approx(0.0, abs=1e-4)
    # the lower half is 2 sin(phi / 2) from the nearer end, phi from 0 to pi/2 twice
    assert both == pytest.approx(0.5 * 2.0 * 4.0 * (1.0 - cos(pi / 4)), rel=1e-4)


# Distances


def test_distance_is_that_to_the_nearest_segment() -> None:
    rng = np.random.default_rng(2)
    curve, points = rng.normal(size=(40, 2)), rng.normal(size=(60, 2))
    for closed in (True, False):
        ends = np.roll(curve, -1, axis=0) if closed else curve[1:]
        starts = curve if closed else curve[:-1]
        expected = np.full(60, np.inf)
        for a, b in zip(starts, ends):
            s = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            expected = np.minimum(expected, np.linalg.norm(points - a - s[:, None] * (b - a), axis=1))
        assert curve_distance(curve, points, closed=closed) == pytest.approx(expected, abs=1e-13)
    assert curve_distance(curve, np.empty((0, 2))).shape == (0,)


def test_hausdorff_distance() -> None:
    square = closed_target(np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]))
    assert hausdorff(circle(1.0), square) == pytest.approx(2**0.5 - 1.0, abs=1e-4)
    # the other way round the circle is the one that sticks out
    assert hausdorff(circle(3.0), square) == pytest.approx(2.0, abs=1e-4)
    wave = path_from_formula("t", "0.2*sin(t)", n=2000, end=5.0)
    other = path_from_formula("t + 0.4", "0.3*cos(t)", n=2000, end=4.5)
    sampled = max(directed_hausdorff(wave.points, other.points)[0], directed_hausdorff(other.points, wave.points)[0])
    assert hausdorff(wave.points, other, closed=False) == pytest.approx(sampled, abs=3e-3)
    assert hausdorff(other.points, wave, closed=False) == pytest.approx(hausdorff(wave.points, other, closed=False))
    # of an open target only what the target misses
    assert hausdorff(circle(1.0), TargetPath(points=arc(1.2, 0.0, 1.0), closed=False)) == pytest.approx(0.2, abs=1e-4)


# Straight parts


def test_straightness_along_a_direction() -> None:
    line = np.array([[0.0, 0.0], [1.0, 0.1], [2.0, -0.2], [3.0, 0.0], [2.8, 0.05]])
    assert straightness(line, 0.0) == pytest.approx((2.8, 0.3))
    turned = line @ np.array([[cos(2.0), sin(2.0)], [-sin(2.0), cos(2.0)]]) + [50.0, -3.0]
    assert straightness(turned, 2.0) == pytest.approx((2.8, 0.3))
    # the line has no sense
    assert straightness(line[::-1], 0.0) == pytest.approx((2.8, 0.3))


@pytest.mark.parametrize("call", ["area", "hausdorff", "distance", "straightness"])
def test_bad_curves_are_refused(call: str) -> None:
    bad = np.array([[0.0, 0.0], [1.0, np.inf], [2.0, 1.0]])
    target = closed_target(circle(1.0))
    with pytest.raises(InputError, match="index 1"):
        {
            "area": lambda: area_difference(bad, target),
            "hausdorff": lambda: hausdorff(bad, target),
            "distance": lambda: curve_distance(target.points, bad),
            "straightness": lambda: straightness(bad, 0.0),
        }[call]()
