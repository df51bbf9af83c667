"""The figures of chapter IV: the linearised equation and its resonances."""

import numpy as np
import pytest

from analysis.studies.rules import SMALL
from analysis.studies.youssef import chapter_4 as study
from analysis.studies.youssef import conclusions_linear, linearised
from analysis.youssef import Variant, nonlinear_harmonic_balance, slider_equation
from linkwork.five_bar.published import chapter_4
from tests import published

from .results import check, every


@every("4.")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


def test_second_harmonic_is_the_plants() -> None:
    speed, right = study.peak(2, 1.0, study.COMPARED_AT)
    plant = nonlinear_harmonic_balance(chapter_4(1.0, study.COMPARED_AT), speed)
    assert right == pytest.approx(plant.harmonic(2) / chapter_4(1.0).rocker_length, rel=0.005)


def test_second_harmonic_is_negligible_above_22_rad_s_alone() -> None:
    for ratio, last in ((0.5, 22.3), (1.0, 22.1), (1.5, 21.9)):
        speeds = np.arange(16.5, 40.05, 0.1).round(1)
        shares = study.harmonic(2, speeds, ratio) / study.harmonic(1, speeds, ratio)
        assert shares[speeds >= last].max() < SMALL < shares[speeds < last].min()


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("ratio", study.INERTIA_RATIOS)
def test_peaks_lie_among_close_speeds(ratio: float, order: int) -> None:
    """The peak over a harmonic's resonance is missed by less than 0.1 % with the weakest damper of appendix 2."""
    at = study.OMEGA_K / np.sqrt(study.equation(ratio, Variant.EXACT).mass.mean) / order
    # half the width of the peak of this harmonic, where it is less by a factor of the root of 2
    half_width = 0.5 * study.DAMPERS[0] / order
    for speeds in (study.EVERY, conclusions_linear.SPEEDS):
        off = 0.5 * np.sort(np.abs(speeds - at))[:2].sum()
        assert 0.5 * (off / half_width) ** 2 < 1e-3


@pytest.mark.parametrize(("inertia_ratio", "near"), [(1.0, 0.03), (0.5, 0.01)])
def test_peaks(inertia_ratio: float, near: float) -> None:
    """The weakest damper's is F1/lambda_c, the strongest's that of the plant."""
    at, height = study.peak(1, inertia_ratio, study.DAMPERS[0])
    force = study.equation(inertia_ratio, Variant.EXACT).force.amplitudes[1]
    assert height == pytest.approx(force * at / study.DAMPERS[0], rel=0.02)
    at, height = study.peak(1, inertia_ratio, study.STRONGEST)
    mechanism = chapter_4(inertia_ratio, study.STRONGEST)
    plant = nonlinear_harmonic_balance(mechanism, at).harmonic(1) / mechanism.rocker_length
    assert plant == pytest.approx(height, rel=near)


class TestLinearised:
    """The equations of 4.1 to 4.4."""

    def test_a_motion_that_is_not_small(self) -> None:
        """Lagrange's equation of rocker and slider, integrated apart over 600 turns from zeta = 0.3, gives 0.68291 l4."""
        linear, found = linearised.peaks(study.DAMPERS[0])
        assert found == pytest.approx(0.68291, abs=2e-5)
        assert linear > 1.0

    def test_the_mended_recurrence_is_the_balance(self) -> None:
        """With 2 lambda_c k0 in place of 2 lambda_c (4.34) is the balance of (4.29); as printed it is not."""
        assert linearised.balance_error(1.2, as_printed=False) < 1e-12
        assert linearised.balance_error(1.2) > 1e-3

    def test_the_motion_of_the_plant_meets_all_equations_of_motion(self) -> None:
        met = linearised.residuals()
        assert set(met) == {"(4.10), (4.15)", "(4.11), (4.16)", "(4.12), (4.17)", "(4.13), (4.18)", "(4.19)", "(4.20)"}
        assert max(met.values()) < 1e-12

    def test_stiffness_as_printed(self) -> None:
        """H1 is three times the right one: p45 I4 sigma2 cos^2 alpha4 sin(2 alpha3) / sin^3 is right at 60 and 120 deg."""
        for inertia_ratio in (0.5, 1.0, 2.0):
            found = linearised.coefficient_ratios(1e-4, inertia_ratio)
            assert found["H1, stiffness"] == pytest.approx(3.0, abs=1e-3)
        right = slider_equation(linearised.with_crank(1e-4), 1.0).stiffness.cos[1]
        assert right == pytest.approx(1e-4 * published.P45 / 4.5, rel=1e-3)
