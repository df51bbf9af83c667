"""The figures of chapter III: drift, steady motion, launches, free motion."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.studies.youssef import _runs
from tests import published

from .results import check_plot_and_data, check_verdicts, computed, every, result

#: What the thesis states and the right physics does not bear out.
REFUTED = {
    ("3.2", "third turn's drift relative to the first's; mu = 1e4 dyn.s/cm"),
    ("3.2", "third turn's drift relative to the first's; mu = 5e4 dyn.s/cm"),
    ("3.2", "third turn's drift relative to the first's; mu = 1e5 dyn.s/cm"),
    ("3.10", "exponent of T0 in the time to 1 rad"),
}
#: Studies whose results take more than a second or two.
LONG = {"3.2"}


@every("3.", LONG)
def test_verdicts(number: str) -> None:
    check_verdicts(number, REFUTED)


@every("3.", LONG)
def test_plot_and_data(number: str) -> None:
    check_plot_and_data(number)


class TestDrift:
    """Fig 3.2 and 3.3."""

    def test_it_accelerates(self) -> None:
        for mu in _runs.DAMPINGS:
            turns = [abs(_runs.drift(mu).per_turn(n)) for n in (1, 3)]
            assert turns[1] > turns[0]

    def test_it_is_near_linear_with_the_strong_dampers_only(self) -> None:
        for mu in _runs.DAMPINGS:
            assert (abs(_runs.drift(mu).growth - 1.0) < 0.1) == (mu >= 5e5)

    @pytest.mark.parametrize("mu", published.TURNS_TO_SINE_0_3)
    def test_coupler_and_rocker_come_collinear(self, mu: float) -> None:
        turns = published.TURNS_TO_SINE_0_3[mu]
        assert _runs.drift(mu).collinear_turn == pytest.approx(turns, abs=0.5 if turns > 10 else 0.05)

    def test_the_strongest_damper_keeps_them_apart(self) -> None:
        assert np.isnan(_runs.drift(1e6).collinear_turn)

    @pytest.mark.parametrize("mu", [5e5, 1e6])
    def test_without_gravity_it_grows_by_a_quarter(self, mu: float) -> None:
        for turn in (1, 2, 3):
            assert _runs.drift(mu, 0.0).per_turn(turn) / _runs.drift(mu).per_turn(turn) == pytest.approx(1.25, abs=0.03)


class TestSteadyMotion:
    """Fig 3.4 and 3.5."""

    @pytest.mark.parametrize("k", published.MEAN_STEADY_U_CM)
    def test_least_position_and_mean(self, k: float) -> None:
        turn = _runs.steady_turn(_runs.table_3_1(k), 420.0)
        least, _ = _runs.least(turn.angle_deg, turn.slider_cm)
        assert least == pytest.approx(published.LEAST_STEADY_U_AT_DEG[k], abs=0.05)
        assert turn.slider_cm[:-1].mean() == pytest.approx(published.MEAN_STEADY_U_CM[k], abs=5e-4)

    @pytest.mark.parametrize(
        ("number", "statement", "known", "tolerance"),
        [
            (
                "3.5",
                "difference between k = 5e5 and 2e6, relative to the peak",
                published.TORQUE_DIFFERENCE_OF_PEAK,
                5e-4,
            ),
            ("3.5", "crank angle of the greatest torque", published.TORQUE_REVERSAL_DEG_DYN_CM[0][0], 0.5),
            ("3.5", "greatest torque; k = 1e6 dyn/cm", published.TORQUE_REVERSAL_DEG_DYN_CM[0][1], 0.005e7),
            ("3.5", "crank angle of the least torque", published.TORQUE_REVERSAL_DEG_DYN_CM[1][0], 0.5),
            ("3.5", "least torque; k = 1e6 dyn/cm", published.TORQUE_REVERSAL_DEG_DYN_CM[1][1], 0.005e7),
            # section 3.2.2: T0 t^2 is nearly constant, where the thesis has T0 t
            (
                "3.10",
                "exponent, mean of the two between the three torques",
                published.TORQUE_TIME_EXPONENT,
                0.005,
            ),
        ],
    )
    def test_torques(self, number: str, statement: str, known: float, tolerance: float) -> None:
        assert computed(number, statement) == pytest.approx(known, abs=tolerance)


class TestLaunch:
    """Section 3.2.2."""

    def test_torque_times_time_squared_is_nearly_constant_and_torque_times_time_is_not(self) -> None:
        torque, time = (result("3.10").columns[name] for name in ("T0 [dyn.cm]", "time to 1 rad [s]"))
        squared, hyperbola = torque * time**2, torque * time
        assert squared.max() / squared.min() < 1.11
        assert hyperbola.max() / hyperbola.min() > 4.0


def test_parabola_through_samples() -> None:
    x = np.linspace(-1.0, 2.0, 31)
    place, value = _runs.least(x, 3.0 * (x - 0.123) ** 2 - 4.0)
    assert place == pytest.approx(0.123, abs=1e-12)
    assert value == pytest.approx(-4.0, abs=1e-12)
    place, value = _runs.greatest(x, 5.0 - (x - 0.77) ** 2)
    assert (place, value) == (pytest.approx(0.77, abs=1e-12), pytest.approx(5.0, abs=1e-12))


@pytest.mark.parametrize(
    ("value", "plain", "printed"), [(1e6, "1e6", "10⁶"), (5e5, "5e5", "5\N{MULTIPLICATION SIGN}10⁵")]
)
def test_values_in_words(value: float, plain: str, printed: str) -> None:
    assert _runs.plain(value) == plain
    assert _runs.scientific(value) == printed
