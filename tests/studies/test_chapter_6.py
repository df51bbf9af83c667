"""The figures of chapter VI: synthesis of four-bars; the quality functions of the thesis."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.studies.youssef.chapter_6 import pairing_area
from analysis.studies.youssef.packaging import nineteen_points
from analysis.studies.youssef.quality import both, linkages
from analysis.synthesis import distance_to
from analysis.synthesis.published import PROBLEMS, packaging_path

from .results import check_plot_and_data, check_verdicts, every

#: What the thesis states and the right physics does not bear out.
REFUTED = {
    *((number, "error of the printed linkage") for number in ("6.4", "6.5", "6.6", "6.7", "6.8", "6.9")),
    ("6.6", "increase of the error by the bounds"),
    ("6.11", "quality function of the nineteen points, printed linkage, of ours"),
    ("quality", "minima found at 72 points, more than at 12; timed ellipse (a)"),
    ("quality", "error of the printed linkage, of the least with no longer link; timed ellipse (a)"),
}
#: What cannot be judged.
UNJUDGED = {("6.11", "the path is within the region")}
#: Studies whose results take more than a second or two.
LONG = {"6.7", "6.8", "6.9", "6.10", "6.11", "quality"}


@every("6.", LONG)
def test_verdicts(number: str) -> None:
    check_verdicts(number, REFUTED, UNJUDGED)


@every("6.", LONG)
def test_plot_and_data(number: str) -> None:
    check_plot_and_data(number)


@pytest.mark.slow
def test_the_combined_quality_function() -> None:
    check_verdicts("quality", REFUTED)
    check_plot_and_data("quality")
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
