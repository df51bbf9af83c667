"""The figures of chapter V: regions of instability."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.studies.youssef.chapter_5 import SAME_GROUND, closed, held, with_crank
from analysis.studies.youssef.regions import appendix_3, first_order, hill, removing_estimate, right
from analysis.youssef import Variant
from linkwork.five_bar.published import chapter_4
from tests import published

from .results import check, every, result


@every("5.")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


@pytest.mark.parametrize("inertia_ratio", published.FIRST_REGION)
def test_first_region(inertia_ratio: float) -> None:
    mechanism = chapter_4(inertia_ratio)
    for region, ends, tolerance in (
        (right(mechanism), published.FIRST_REGION[inertia_ratio], 5.5e-7),
        (appendix_3(mechanism), published.FIRST_REGION_THESIS[inertia_ratio], 5.5e-6),
    ):
        assert (region.low, region.high) == pytest.approx(ends, abs=tolerance)


def test_the_printed_coefficients_make_the_region_four_times_too_wide() -> None:
    mechanism = chapter_4(1.0)
    printed = first_order(mechanism, Variant.PRINTED)
    assert printed.width / right(mechanism).width == pytest.approx(4.1, abs=0.1)
    # (5.16) against the determinant
    by_hill = hill(mechanism, variant=Variant.PRINTED)
    assert (printed.low, printed.high) == pytest.approx((by_hill.low, by_hill.high), abs=3e-5)


def test_both_couplers_are_the_same_at_equal_links() -> None:
    one, other = (right(mechanism(1.0)) for mechanism in (held, closed))
    assert (one.low, one.high) == pytest.approx((other.low, other.high), abs=1e-9)


@pytest.mark.slow
def test_on_the_same_ground_link_the_region_is_narrowest_at_equal_links() -> None:
    columns = result("5.3").columns
    low, high = (columns[f"lambda_k^2; {SAME_GROUND}; {end} [1]"] for end in ("low", "high"))
    assert columns["sigma3 [1]"][np.argmin(high - low)] == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize(("number", "power"), [(1, 1.0), (2, 2.0), (3, 3.0)])
def test_width_of_a_region_starts_with_its_power_of_the_crank(number: int, power: float) -> None:
    cranks = np.geomspace(0.01, 0.03, 5)
    widths = [hill(with_crank(sigma2), number).width for sigma2 in cranks.tolist()]
    assert np.polyfit(np.log(cranks), np.log(widths), 1)[0] == pytest.approx(power, abs=0.05)


@pytest.mark.slow
def test_removing_damping_by_its_width() -> None:
    assert result("5.4").columns["removing omega_c; true orbit [1/s]"][5] == pytest.approx(
        removing_estimate(chapter_4(1.5)), rel=0.03
    )
