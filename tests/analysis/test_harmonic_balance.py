"""Harmonic balance: thesis's two harmonics, any order, the nonlinear plant; against runs, differences and each other."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import pi, sqrt

import numpy as np
import pytest

pytest.importorskip("casadi")

from analysis import youssef
from analysis.numerics.fourier import FourierSeries
from analysis.studies.youssef.runs import steady_turn
from analysis.units import CM_PER_METRE, RAD_S_PER_RPM
from analysis.youssef import Load, Variant, harmonic_balance, nonlinear_harmonic_balance, resonance, slider_equation
from analysis.youssef import harmonics as hb
from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SETS, TABLE_3_1, chapter_4
from tests import published

RIG_1_A, RIG_1_B = (SETS[f"rig-1-spring-{spring}"].parameters for spring in "ab")

ONE = FourierSeries.constant(1.0)
UNDAMPED = youssef.SliderEquation(mass=ONE, stiffness=0.0 * ONE, force=ONE, spring=1.0, damping=0.0)
#: Upside down the rocker topples.
TOPPLING = replace(chapter_4(1.0), slider_stiffness=1e-3, gravity=500.0, coupler_mass=2.0, coupler_cog_distance=0.3)
ANGLES = np.linspace(0.0, 2.0 * pi, 60, endpoint=False)


class TestTwoHarmonics:
    """Eqs (4.30)-(4.35)."""

    @pytest.mark.parametrize("variant", Variant)
    def test_it_is_the_five_equations_written_out(self, variant: Variant) -> None:
        e = slider_equation(chapter_4(1.0, 0.45), 16.0, variant=variant)
        a, b, c = e.coefficients()
        # Galerkin: the equation times 1, cos, sin, cos 2, sin 2, over a turn
        x = np.linspace(0.0, 2.0 * pi, 64, endpoint=False)
        value = np.stack([np.ones(64), np.cos(x), np.sin(x), np.cos(2 * x), np.sin(2 * x)], axis=1)
        rate = np.stack([np.zeros(64), -np.sin(x), np.cos(x), -2 * np.sin(2 * x), 2 * np.cos(2 * x)], axis=1)
        bend = -value * np.array([0.0, 1.0, 1.0, 4.0, 4.0])
        left = a(x)[:, None] * bend + b(x)[:, None] * rate + c(x)[:, None] * value
        a0, a1, b1, a2, b2 = np.linalg.solve(value.T @ left, value.T @ e.force(x))
        zeta = youssef.two_harmonics(e).series
        assert zeta.cos == pytest.approx([a0, a1, a2], rel=1e-12)
        assert zeta.sin == pytest.approx([0.0, b1, b2], rel=1e-12)


class TestResonance:
    """Where the determinant vanishes."""

    @pytest.mark.parametrize("inertia_ratio", published.RESONANCE)
    def test_right_values(self, inertia_ratio: float) -> None:
        lower, upper = resonance(chapter_4(inertia_ratio))
        assert lower == pytest.approx(published.RESONANCE[inertia_ratio].right, abs=5.1e-5)
        assert lower < upper < lower * 1.001

    def test_the_determinant_vanishes_there(self) -> None:
        for speed in resonance(TABLE_3_1, harmonic=2, order=4):
            e = slider_equation(replace(TABLE_3_1, slider_damping=0.0), speed)
            values = np.linalg.svd(hb._operator(e, 4), compute_uv=False)
            assert values[-1] < 1e-10 * values[0]
            beside = slider_equation(replace(TABLE_3_1, slider_damping=0.0), 1.01 * speed)
            assert np.linalg.svd(hb._operator(beside, 4), compute_uv=False)[-1] > 1e-3 * values[0] / 100


class TestLinear:
    """Any order."""

    def test_the_residual_falls_with_the_order_to_rounding(self) -> None:
        e = slider_equation(TABLE_3_1, 420.0 * RAD_S_PER_RPM)
        residuals = [harmonic_balance(e, order).residual for order in (1, 2, 4, 8, 16, 48)]
        assert all(b < a for a, b in pairwise(residuals))
        assert residuals[-1] < 1e-12

    def test_constant_coefficients_in_closed_form(self) -> None:
        force = FourierSeries(np.array([0.3, 0.0, 2.0]), np.array([0.0, 1.0, 0.0]))
        e = youssef.SliderEquation(mass=ONE, stiffness=0.5 * ONE, force=force, spring=0.7, damping=0.2)
        motion = harmonic_balance(e, 5)
        assert motion.series.mean == pytest.approx(0.3 / 1.2, rel=1e-14)
        assert motion.harmonic(1) == pytest.approx(1.0 / np.hypot(0.2, 0.2), rel=1e-14)
        assert motion.harmonic(2) == pytest.approx(2.0 / np.hypot(2.8, 0.4), rel=1e-14)
        # sine lags by atan2(0.2, 0.2)
        assert motion.series.cos[1] == pytest.approx(-motion.series.sin[1], rel=1e-13)
        assert motion.series.cos[1] < 0.0
        assert motion.harmonic(3) == pytest.approx(0.0, abs=1e-15)
        assert motion.harmonic(6) == 0.0

    @pytest.mark.parametrize("variant", [Variant.EXACT, Variant.SECOND_ORDER])
    def test_amplitudes_at_many_speeds_are_those_of_each(self, variant: Variant) -> None:
        p = replace(RIG_1_B, ground_inclination=0.7, slider_damping=7.0)
        load, speeds = Load(x=3.0, slider=20.0), np.array([[20.0, 60.0], [90.0, 140.0]])
        many = hb.harmonic_amplitudes(p, speeds, 5, variant=variant, load=load)
        equations = [slider_equation(p, w, variant=variant, load=load) for w in speeds.ravel()]
        each = [p.rocker_length * harmonic_balance(equation, 5).amplitude for equation in equations]
        assert many == pytest.approx(np.reshape(each, (2, 2)), rel=1e-9)

    def test_amplitude_is_half_of_peak_to_peak(self) -> None:
        # sin x + sin 2x / 4: cos x + cos 2x / 2 = 0 at cos x = (sqrt 3 - 1)/2
        cosine = (sqrt(3.0) - 1.0) / 2.0
        series = FourierSeries(np.array([5.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.25]))
        greatest = sqrt(1.0 - cosine**2) * (1.0 + 0.5 * cosine)
        assert youssef.HarmonicMotion(series=series, residual=0.0).amplitude == pytest.approx(greatest, rel=1e-15)
        assert youssef.HarmonicMotion(series=FourierSeries.constant(3.0), residual=0.0).amplitude == 0.0


class TestNonlinear:
    """The plant's own equations."""

    @pytest.mark.parametrize(
        ("parameters", "rpm"),
        [(TABLE_3_1, 420.0), (RIG_1_A, 300.0), (RIG_1_A, 450.0), (RIG_1_B, 560.0)],
        ids=["table-3.1", "rig-1-a-300", "rig-1-a-450", "rig-1-b-560"],
    )
    def test_it_is_what_a_long_run_ends_in(self, parameters: FiveBarParameters, rpm: float) -> None:
        turn = steady_turn(parameters, rpm)
        motion = nonlinear_harmonic_balance(parameters, rpm * RAD_S_PER_RPM)
        angle = np.radians(turn.angle_deg)
        assert CM_PER_METRE * motion.position(angle) == pytest.approx(turn.slider_cm, abs=1e-6)
        assert motion.torque(angle) == pytest.approx(turn.torque, abs=1e-7)
        assert CM_PER_METRE * motion.amplitude == pytest.approx(0.5 * np.ptp(turn.slider_cm), abs=1e-5)
        second = np.abs(np.fft.rfft(turn.slider_cm[:-1])[2]) / 720.0
        assert CM_PER_METRE * motion.harmonic(2) == pytest.approx(second, abs=1e-6)
        assert motion.residual < 1e-14

    def test_the_adaptive_order_changes_nothing_any_more(self) -> None:
        motion = nonlinear_harmonic_balance(TABLE_3_1, 420.0 * RAD_S_PER_RPM)
        higher = nonlinear_harmonic_balance(TABLE_3_1, 420.0 * RAD_S_PER_RPM, motion.order + 30, start=motion.series)
        assert higher.position(ANGLES) == pytest.approx(motion.position(ANGLES), abs=1e-13)
        lower = nonlinear_harmonic_balance(TABLE_3_1, 420.0 * RAD_S_PER_RPM, 4)
        assert lower.order == 4
        assert np.abs(lower.position(ANGLES) - motion.position(ANGLES)).max() > 1e-6

    def test_a_constant_load_moves_the_slider(self) -> None:
        # the force on a spring that nothing else loads
        still = replace(chapter_4(1.0, 2.0), crank_length=1e-9)
        motion = nonlinear_harmonic_balance(still, 5.0, 2, load=Load(slider=1.5))
        assert motion.series.mean == pytest.approx(1.5 / still.slider_stiffness, rel=1e-6)

    def test_difference_from_the_linear_equation_falls_with_the_square_of_sigma2(self) -> None:
        differences = []
        for sigma2 in (0.05, 0.025, 0.0125):
            p = replace(chapter_4(1.0, 0.5), crank_length=0.3 * sigma2)
            linear = p.rocker_length * harmonic_balance(slider_equation(p, 25.0), 12).series(ANGLES)
            motion = nonlinear_harmonic_balance(p, 25.0).position(ANGLES)
            differences.append(np.abs(linear - motion).max())
        assert np.log2(differences[0] / differences[1]) == pytest.approx(2.0, abs=0.5)
        assert np.log2(differences[1] / differences[2]) == pytest.approx(2.0, abs=0.2)

    def test_the_jacobian_is_exact(self) -> None:
        # Newton's method with it doubles the digits: the last step but one is the square root of the last
        full = nonlinear_harmonic_balance(TABLE_3_1, 420.0 * RAD_S_PER_RPM, 24)
        off = full.series + FourierSeries(np.array([0.0, 1e-4]), np.zeros(2))
        assert nonlinear_harmonic_balance(TABLE_3_1, 420.0 * RAD_S_PER_RPM, 24, start=off).iterations <= 4

    def test_friction_in_the_guide_makes_it_smaller(self) -> None:
        # the friction's tanh(u'/v0) is a step to so few harmonics, and yet
        p = replace(RIG_1_A, slider_coulomb_friction=0.5)
        motion = nonlinear_harmonic_balance(p, 560.0 * RAD_S_PER_RPM, 12)
        free = nonlinear_harmonic_balance(RIG_1_A, 560.0 * RAD_S_PER_RPM, 12)
        assert 0.5 < motion.amplitude / free.amplitude < 0.99


class TestErrors:
    """What is refused, and how."""

    @pytest.mark.parametrize(
        ("refused", "error", "said"),
        [
            (lambda: resonance(chapter_4(1.0), harmonic=0, order=2), InputError, "harmonic"),
            (lambda: resonance(chapter_4(1.0), harmonic=3, order=2), InputError, "harmonic"),
            (lambda: resonance(replace(chapter_4(1.0), slider_stiffness=0.0)), InputError, "stiffness"),
            (lambda: resonance(TOPPLING), youssef.HarmonicBalanceError, "resonance"),
            (lambda: harmonic_balance(slider_equation(TABLE_3_1, 44.0), -1), InputError, "order -1"),
            (lambda: harmonic_balance(UNDAMPED, 2), youssef.HarmonicBalanceError, r"singular at lambda_k\^2 = 1"),
            (lambda: nonlinear_harmonic_balance(TABLE_3_1, 44.0, 4, start=5.0 * ONE), AssemblyError, "position 5 m"),
            (lambda: nonlinear_harmonic_balance(TABLE_3_1, 44.0, -2), InputError, "order -2"),
            (lambda: nonlinear_harmonic_balance(TABLE_3_1, 44.0, tolerance=0.0), InputError, "tolerance"),
            # next to a resonance without damping there may be none
            (
                lambda: nonlinear_harmonic_balance(chapter_4(1.0), 0.999 * resonance(chapter_4(1.0))[0]),
                youssef.HarmonicBalanceError,
                "does not converge: residual",
            ),
        ],
    )
    def test_what_is_refused(self, refused: Callable[[], object], error: type[Exception], said: str) -> None:
        with pytest.raises(error, match=said):
            refused()

    def test_too_few_iterations(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(hb, "MOST_ITERATIONS", 2)
        with pytest.raises(youssef.HarmonicBalanceError, match=r"order 8 at 44 rad/s .* residual .* 2 iterations"):
            nonlinear_harmonic_balance(TABLE_3_1, 44.0)

    def test_harmonics_that_do_not_die_away(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(hb, "ORDERS", (2, 4))
        with pytest.raises(youssef.HarmonicBalanceError, match="harmonic 4 is still"):
            nonlinear_harmonic_balance(TABLE_3_1, 44.0)

    def test_a_linear_start_out_of_reach_is_made_smaller(self) -> None:
        # without a damper, a little above the resonance, the linear amplitude is longer than the rocker
        p = chapter_4(1.0)
        lower, _ = resonance(p)
        linear = harmonic_balance(slider_equation(p, 1.003 * lower), 8)
        assert linear.amplitude > 1.0
        motion = nonlinear_harmonic_balance(p, 1.003 * lower)
        assert motion.amplitude == pytest.approx(0.63 * p.rocker_length, rel=0.02)
        assert motion.residual < 1e-13

    @pytest.mark.parametrize("speed", [0.0, -1.0, float("nan")])
    def test_speed(self, speed: float) -> None:
        for start in (None, 0.0 * ONE):
            with pytest.raises(InputError, match="crank speed"):
                nonlinear_harmonic_balance(TABLE_3_1, speed, start=start)


class TestSecondHarmonic:
    """Near half the natural frequency, I4 = 1."""

    SPEED = 15.2

    def ratio(self, variant: Variant) -> float:
        """The right second harmonic relative to a variant's."""
        p = chapter_4(1.0, 0.45)
        right = nonlinear_harmonic_balance(p, self.SPEED).harmonic(2) / p.rocker_length
        return right / youssef.two_harmonics(slider_equation(p, self.SPEED, variant=variant)).harmonic(2)

    def test_the_second_order_force_makes_it(self) -> None:
        assert self.ratio(Variant.SECOND_ORDER) == pytest.approx(1.0, abs=0.01)
        # first-order coefficients have no second harmonic in the force
        assert 20.0 < self.ratio(Variant.FIRST_ORDER) < 30.0


def test_the_iterations_of_all_orders_are_counted() -> None:
    speed = 420.0 * RAD_S_PER_RPM
    whole = nonlinear_harmonic_balance(TABLE_3_1, speed)
    start, each = None, []
    for order in hb.ORDERS:
        found = nonlinear_harmonic_balance(TABLE_3_1, speed, order, start=start)
        each.append(found.iterations)
        start = found.series
        if len(found.series.amplitudes) == len(whole.series.amplitudes):
            break
    assert len(each) > 1
    assert whole.iterations == sum(each)
