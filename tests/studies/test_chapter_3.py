"""The figures of chapter III: drift, steady motion, launches, free motion."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.run import Inputs, simulate
from analysis.studies.study import TEXT
from analysis.studies.youssef import chapter_3, free_crank, runs
from linkwork.five_bar.parameters import InitialState
from tests import published

from .results import check, computed, every, result


@every("3.")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


class TestDrift:
    """Fig 3.2 and 3.3."""

    def test_it_accelerates(self) -> None:
        for mu in chapter_3.DAMPINGS:
            turns = [abs(chapter_3.drift(mu).per_turn(n)) for n in (1, 3)]
            assert turns[1] > turns[0]

    @pytest.mark.parametrize("gravity", published.U_AFTER_40_TURNS_CM)
    def test_how_far_the_strongest_damper_lets_it_go(self, gravity: float) -> None:
        last = chapter_3.drift(1e6, gravity).slider_cm[-1]
        assert last == pytest.approx(published.U_AFTER_40_TURNS_CM[gravity], abs=0.005)

    def test_it_is_near_linear_with_the_strong_dampers_only(self) -> None:
        for mu in chapter_3.DAMPINGS:
            assert (abs(chapter_3.drift(mu).growth - 1.0) < 0.1) == (mu >= 5e5)

    @pytest.mark.parametrize("mu", published.TURNS_TO_SINE_0_3)
    def test_coupler_and_rocker_come_collinear(self, mu: float) -> None:
        turns = published.TURNS_TO_SINE_0_3[mu]
        assert chapter_3.drift(mu).collinear_turn == pytest.approx(turns, abs=0.5 if turns > 10 else 0.05)

    def test_the_strongest_damper_keeps_them_apart(self) -> None:
        assert np.isnan(chapter_3.drift(1e6).collinear_turn)

    @pytest.mark.parametrize("mu", [5e5, 1e6])
    def test_without_gravity_it_grows_by_a_quarter(self, mu: float) -> None:
        for turn in (1, 2, 3):
            assert chapter_3.drift(mu, 0.0).per_turn(turn) / chapter_3.drift(mu).per_turn(turn) == pytest.approx(
                1.25, abs=0.03
            )


class TestSteadyMotion:
    """Fig 3.4 and 3.5."""

    @pytest.mark.parametrize("k", published.MEAN_STEADY_U_CM)
    def test_least_position_and_mean(self, k: float) -> None:
        turn = runs.steady_turn(runs.table_3_1(k), 420.0)
        least, _ = runs.least(turn.angle_deg, turn.slider_cm)
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
                "3.7",
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
        torque, time = (result("3.7").columns[name] for name in ("T0 [dyn.cm]", "time to 1 rad [s]"))
        squared, hyperbola = torque * time**2, torque * time
        assert squared.max() / squared.min() < 1.11
        assert hyperbola.max() / hyperbola.min() > 4.0


class TestFreeMotion:
    """Section 3.3."""

    def test_it_begins_in_the_steady_motion(self) -> None:
        u, v = (100.0 * free_crank.coast(1e6)[name][0] for name in ("slider.position", "slider.velocity"))
        assert u == pytest.approx(published.STEADY_U_CM, abs=1e-6)
        assert v == pytest.approx(published.STEADY_U_RATE_CM_S, abs=1e-4)

    def test_what_is_measured_over_a_turn(self) -> None:
        angle = np.linspace(0.5, 0.5 + 8.0 * np.pi, 20001)
        run = Recorded(
            {
                "crank.angle": angle,
                "crank.speed": 5.0 + 0.2 * np.sin(angle),
                "slider.position": 0.01 + 0.003 * np.cos(angle) + 0.001 * np.sin(2.0 * angle),
                "energy.kinetic": 2.0 + 0.04 * np.cos(angle),
                "energy.potential": np.ones_like(angle),
            },
            time=0.2 * (angle - 0.5) + 0.01 * np.cos(angle),
        )
        turns = free_crank.Turns.of(run, start=0.5)
        assert turns.speed == pytest.approx([5.0] * 3, rel=1e-6)
        assert turns.speed_range == pytest.approx([0.4] * 3, rel=1e-3)
        assert turns.slider == pytest.approx([1.0] * 3, rel=1e-6)
        assert turns.first == pytest.approx([0.3] * 3, rel=1e-6)
        assert turns.second == pytest.approx([0.1] * 3, rel=1e-6)
        # 0.08 of 3, and 5.2 squared less 4.8 squared of 25.02
        assert turns.energy_share == pytest.approx([(0.08 / 3.0) / (4.0 / 25.02)] * 3, rel=1e-3)

    @pytest.mark.parametrize("degrees", [0, 60, 200])
    def test_natural_frequency_with_the_crank_held(self, degrees: int) -> None:
        parameters = runs.table_3_1(2e6, 0.0, 0.0)
        start = InitialState(crank_angle=np.radians(degrees), slider_position=1e-5)
        run = simulate(parameters, Inputs(speed=0.0), initial=start, stop_time=0.5, step=1e-4)
        u = run["slider.position"]
        up = np.flatnonzero((u[:-1] < 0.0) & (u[1:] >= 0.0))
        crossings = run.time[up] - u[up] * 1e-4 / (u[up + 1] - u[up])
        frequency = 2.0 * np.pi / np.diff(crossings).mean()
        assert free_crank.half_natural_frequencies(2e6)[2 * degrees] == pytest.approx(0.5 * frequency, rel=1e-4)

    def test_with_the_mean_effective_mass(self) -> None:
        known = published.HALF_NATURAL_FREQUENCY_RAD_S
        statement = "half the natural frequency, with the mean effective mass of a turn"
        assert computed("3.14", statement, TEXT) == pytest.approx(known, abs=0.005)


class Recorded(dict[str, np.ndarray]):
    """A run that is made up: its columns and its time."""

    def __init__(self, columns: dict[str, np.ndarray], time: np.ndarray) -> None:
        super().__init__(columns)
        self.time = time


def test_parabola_through_samples() -> None:
    x = np.linspace(-1.0, 2.0, 31)
    place, value = runs.least(x, 3.0 * (x - 0.123) ** 2 - 4.0)
    assert place == pytest.approx(0.123, abs=1e-12)
    assert value == pytest.approx(-4.0, abs=1e-12)
    place, value = runs.greatest(x, 5.0 - (x - 0.77) ** 2)
    assert (place, value) == (pytest.approx(0.77, abs=1e-12), pytest.approx(5.0, abs=1e-12))


@pytest.mark.parametrize(
    ("value", "plain", "printed"), [(1e6, "1e6", "10⁶"), (5e5, "5e5", "5\N{MULTIPLICATION SIGN}10⁵")]
)
def test_values_in_words(value: float, plain: str, printed: str) -> None:
    assert runs.plain(value) == plain
    assert runs.scientific(value) == printed
