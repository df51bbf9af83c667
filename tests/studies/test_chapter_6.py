"""The figures of chapter VI: synthesis of four-bars; the quality functions of the thesis."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.studies.youssef.chapter_6 import pairing_area
from analysis.studies.youssef.packaging import nineteen_points
from analysis.studies.youssef.problems import PROBLEMS, packaging_path
from analysis.studies.youssef.quality import both, linkages
from analysis.synthesis import distance_to

from .results import check, every


@every("6.")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


@pytest.mark.slow
def test_the_combined_quality_function() -> None:
    check("quality")
    longest = max(PROBLEMS[name].linkage.largest_link for name in ("ellipse-a", "path-a"))
    found = linkages()["ours; combined"]
    assert found.largest_link <= longest
    assert both(found).combined == sum(both(found))


def circle(radius: float, n: int) -> np.ndarray:
    """Points of a circle about the origin at equal steps, shape (n, 2)."""
    angle = 2.0 * np.pi * np.arange(n) / n
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


class TestPairingArea:
    """The thesis's quality function of path generation."""

    @pytest.mark.parametrize("turned", [0, 5, 31])
    @pytest.mark.parametrize("reverse", [False, True])
    def test_the_ring_between_two_polygons(self, turned: int, reverse: bool) -> None:
        actual = np.roll(circle(1.2, 96), turned, axis=0)
        area = pairing_area(circle(1.0, 24), actual[::-1] if reverse else actual, window=3)
        assert area == pytest.approx(12.0 * np.sin(np.pi / 12.0) * (1.44 - 1.0), rel=1e-12)

    def test_a_curve_through_the_points_leaves_nothing(self) -> None:
        assert pairing_area(circle(1.0, 24), circle(1.0, 96), window=3) < 1e-15

    def test_a_window_that_is_too_narrow_lags_behind(self) -> None:
        wide, narrow = (pairing_area(circle(1.0, 24), circle(1.2, 96), window=window) for window in (1.0, 0.5))
        assert narrow > 2.0 * wide


def test_nineteen_points_on_the_desired_path() -> None:
    points = nineteen_points()
    assert len(points) == 19
    assert distance_to(packaging_path().points, points).max() < 1e-12
