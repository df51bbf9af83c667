"""The figures of chapter V: regions of instability."""

from cmath import phase, rect
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis import youssef
from analysis.numerics.fourier import FourierSeries
from analysis.studies.youssef.chapter_5 import SAME_GROUND, listed_boundaries, with_held_angles, with_same_ground
from analysis.studies.youssef.damping import determinant_errors, equation_without_factor, orbit_removing_damper
from analysis.studies.youssef.linearised import with_crank
from analysis.studies.youssef.regions import (
    appendix_3_region,
    axis,
    crank_speed,
    equation,
    first_order_region,
    hill_region,
    orbit_region,
)
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import chapter_4

from .results import check, every, result, statement


@every("5.")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


@pytest.mark.parametrize(("inertia_ratio", "known"), [(0.5, 2.71), (1.0, 2.59), (1.5, 2.48), (2.0, 2.36)])
def test_listing_makes_the_region_about_two_and_a_half_times_too_wide(inertia_ratio: float, known: float) -> None:
    mechanism = chapter_4(inertia_ratio)
    assert appendix_3_region(mechanism).width / orbit_region(mechanism).width == pytest.approx(known, abs=0.0051)


def test_the_printed_coefficients_make_the_region_four_times_too_wide() -> None:
    mechanism = chapter_4(1.0)
    printed = first_order_region(mechanism, youssef.Variant.PRINTED)
    assert printed.width / orbit_region(mechanism).width == pytest.approx(4.1, abs=0.1)
    # (5.16) against the determinant
    by_hill = hill_region(mechanism, variant=youssef.Variant.PRINTED)
    assert (printed.low, printed.high) == pytest.approx((by_hill.low, by_hill.high), abs=3e-5)


@pytest.mark.parametrize("inertia_ratio", [0.5, 1.0, 1.5])
def test_without_the_rate_of_the_mass_the_region_is_four_times_too_wide(inertia_ratio: float) -> None:
    """The right equation less M' zeta' alone."""
    whole = equation(chapter_4(inertia_ratio))
    bare = replace(whole, b=FourierSeries.constant(0.0))
    widths = [youssef.hill_regions(e, 1)[1].width for e in (bare, whole)]
    assert widths[0] / widths[1] == pytest.approx(4.0, abs=0.01)


def test_both_couplers_are_the_same_at_equal_links() -> None:
    one, other = (orbit_region(mechanism(1.0)) for mechanism in (with_held_angles, with_same_ground))
    assert (one.low, one.high) == pytest.approx((other.low, other.high), abs=1e-9)


@pytest.mark.slow
def test_on_the_same_ground_link_the_region_is_narrowest_at_equal_links() -> None:
    columns = result("5.3").columns
    low, high = (columns[f"lambda_k^2; {SAME_GROUND}; {end} [1]"] for end in ("low", "high"))
    assert columns["sigma3 [1]"][np.argmin(high - low)] == pytest.approx(1.0, abs=0.03)


@pytest.mark.slow
def test_varied_coupler_makes_the_widest_region_of_all_figures() -> None:
    cases = statement("5.3", "This region is narrower").cases
    assert [case.computed for case in cases] == pytest.approx([1.59, 1.18, 1.51], abs=0.005)


@pytest.mark.parametrize(
    ("mechanism", "known"),
    [(with_crank(0.1), 0.17856), (with_held_angles(0.8), 0.26130), (with_same_ground(1.2), 0.70063)],
)
def test_damper_that_removes_the_region_of_the_true_orbit(mechanism: FiveBarParameters, known: float) -> None:
    """The known values are from Lagrange's equation of the slider, integrated with its variation by other code."""
    assert orbit_removing_damper([mechanism]) == pytest.approx(known, abs=2e-5)


@pytest.mark.parametrize(("number", "power"), [(1, 1.0), (2, 2.0), (3, 3.0)])
def test_width_of_a_region_starts_with_its_power_of_the_crank(number: int, power: float) -> None:
    cranks = np.geomspace(0.01, 0.03, 5)
    widths = [hill_region(with_crank(sigma2), number).width for sigma2 in cranks.tolist()]
    assert np.polyfit(np.log(cranks), np.log(widths), 1)[0] == pytest.approx(power, abs=0.05)


@pytest.mark.parametrize(
    ("sigma2", "inertia_ratio", "by_listing", "known"),
    [(0.01, 1.0, False, 1.936), (0.01, 0.5, False, 1.9674), (0.01, 0.5, True, 1.9638)],
)
def test_axis_of_a_short_crank(sigma2: float, inertia_ratio: float, by_listing: bool, known: float) -> None:
    of = appendix_3_region if by_listing else orbit_region
    assert axis(of(with_crank(sigma2, inertia_ratio))) == pytest.approx(known, abs=5e-4 if known == 1.936 else 5e-5)


@pytest.mark.parametrize(("inertia_ratio", "listed", "true"), [(2.0, 1.8697, 1.8727), (0.5, 1.9649, 1.9655)])
def test_axis_of_a_short_coupler_by_the_listing(inertia_ratio: float, listed: float, true: float) -> None:
    for of, known in ((appendix_3_region, listed), (orbit_region, true)):
        assert axis(of(with_held_angles(0.8, inertia_ratio))) == pytest.approx(known, abs=5.1e-5)


def test_angles_of_the_listing_hardly_change_the_axis() -> None:
    """The known value is from Lagrange's equation of the slider, integrated with its variation by other code."""
    crank, coupler, rocker = (rect(length, radians(deg)) for length, deg in ((0.05, 149.0), (0.8, 57.0), (1.0, 120.0)))
    held = with_held_angles(0.8)
    ground = held.rocker_length * (crank + coupler - rocker)
    listed = replace(held, ground_length=abs(ground), slider_guide_angle=-phase(ground))
    assert axis(orbit_region(listed)) == pytest.approx(1.87496, abs=1e-5)
    assert axis(orbit_region(listed)) - axis(orbit_region(held)) == pytest.approx(0.002, abs=5e-4)


def test_held_angles_need_another_ground_link() -> None:
    """The ground link is that from D to A in the closed loop: 1.1 and 0.173 l4 along and across the guide at sigma3 = 1.2."""
    for sigma3, along, across in ((1.2, 1.1, 0.1 * 3**0.5), (0.8, 0.9, -0.1 * 3**0.5)):
        held, same = with_held_angles(sigma3), with_same_ground(sigma3)
        assert held.ground_length / same.ground_length == pytest.approx(np.hypot(along, across))
        assert held.slider_guide_angle == pytest.approx(-np.arctan2(across, along))


def test_linear_equation_and_true_orbit_at_unit_inertia() -> None:
    one, other = hill_region(chapter_4(1.0)), orbit_region(chapter_4(1.0))
    assert (one.low, one.high) == pytest.approx((0.266630, 0.268436), abs=5.1e-7)
    assert (other.low, other.high) == pytest.approx((0.266540, 0.268367), abs=5.1e-7)


def test_formulas_of_the_perturbation_to_the_letter() -> None:
    """(5.16) and (5.24) to (5.26) with the coefficients of (4.29), whose h0 is 0."""
    e = youssef.slider_equation(chapter_4(1.0), 60.0, variant=youssef.Variant.PRINTED, form=youssef.Form.SERIES)
    zeroth, first, second = listed_boundaries(e)
    # (5.12) with its minus
    assert zeroth == pytest.approx(2 * (-2.605e-5,), abs=5.1e-9)
    assert zeroth[0] == pytest.approx(youssef.boundary_stiffnesses(e.homogeneous(), 1, count=1)[0].real, rel=1e-3)
    region = youssef.perturbed_region(e.homogeneous(), 1, order=1)
    assert region is not None
    assert (region.low, region.high) == pytest.approx(first, abs=1e-9)
    region = youssef.perturbed_region(e.homogeneous(), 2)
    assert region is not None
    # the next order
    assert (region.low, region.high) == pytest.approx(second, abs=1e-5)


def galerkin(inertia_ratio: float, harmonics: int) -> NDArray[np.float64]:
    """Return boundaries 1 and 3 in lambda_k^2 by (5.27) with four terms of half the crank angle, the coefficients cut."""
    e = youssef.slider_equation(chapter_4(inertia_ratio), 60.0)
    x = np.linspace(0.0, 4.0 * np.pi, 512, endpoint=False)

    def cut(values: NDArray[np.float64]) -> NDArray[np.float64]:
        c = np.fft.rfft(values)
        c[2 * harmonics + 1 :] = 0.0
        return np.fft.irfft(c, len(x))

    psi1, rest, factor = (cut(v / e.mass(x)) for v in (e.mass.derivative()(x), e.stiffness(x), 1.0))
    k = np.array([[0.5], [1.5]])
    cos, sin = np.cos(k * x), np.sin(k * x)
    terms = np.vstack([cos, sin])
    slopes = np.vstack([-k * sin, k * cos])
    curvatures = np.vstack([-(k**2) * cos, -(k**2) * sin])
    left = terms @ (curvatures + psi1 * slopes + rest * terms).T
    return np.sort(np.linalg.eigvals(np.linalg.solve(terms @ (factor * terms).T, -left)).real)


def test_cut_after_the_ninth_term() -> None:
    """(5.35) as the thesis cuts it, less Hill's determinant."""
    for ratio in (0.5, 1.0, 1.5):
        whole = hill_region(chapter_4(ratio))
        assert galerkin(ratio, 2)[:2] == pytest.approx([whole.low, whole.high], abs=1e-6)


def test_by_determinant_of_the_divided_equation() -> None:
    """The third region needs the third harmonic of the coefficients, the fourth more terms."""
    wholes = youssef.hill_regions(equation(chapter_4(1.0)), 3)
    for harmonics, first, third in ((2, 4.88e-5, 0.479), (64, 4.89e-5, 0.0281)):
        ends, errors = galerkin(1.0, harmonics).reshape(2, 2), determinant_errors(harmonics)
        for number, found, known in ((1, ends[0], first), (3, ends[1], third)):
            whole = wholes[number]
            error = np.abs(found - (whole.low, whole.high)).max() / whole.width
            assert error == pytest.approx(known, rel=2e-3)
            assert errors[number] == pytest.approx(error, rel=1e-4)
    assert determinant_errors(64)[4] > 1.0
    assert determinant_errors(64, order=3)[4] < 0.01
    assert determinant_errors(2, order=8)[3] > 0.4


def test_equation_without_the_factor_has_the_same_multipliers_but_for_the_factor() -> None:
    found = youssef.slider_equation(chapter_4(1.5, 0.45), crank_speed(0.27))
    whole = youssef.monodromy(found.homogeneous().stiffened(found.spring))
    bare = youssef.monodromy(equation_without_factor(1.5, found.damping).stiffened(found.spring))
    # (5.28): the determinant of the one is that of the factor, squared
    factor = np.sqrt(np.linalg.det(whole))
    ours, right = np.linalg.eigvals(whole), factor * np.linalg.eigvals(bare)
    assert np.sort_complex(ours) == pytest.approx(np.sort_complex(right), rel=1e-7)


def test_zeroth_boundary_parts_a_stable_region_from_falling_away() -> None:
    exact = equation(chapter_4(1.0))
    zeroth = youssef.boundary_stiffnesses(exact, 1, count=1)[0].real
    below, above = (np.abs(np.linalg.eigvals(youssef.monodromy(exact.stiffened(x * zeroth)))).max() for x in (0.5, 1.5))
    assert below == pytest.approx(1.13041, abs=1e-5)
    assert above == pytest.approx(1.0, abs=1e-9)
    # the mean of K puts it above 0
    assert zeroth == pytest.approx(0.00081, abs=5e-6)
    bare = replace(exact, c=exact.c + (-exact.c.mean))
    assert youssef.boundary_stiffnesses(bare, 1, count=1)[0].real < 0.0
