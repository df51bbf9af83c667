"""The figures of chapter III: drift, steady motion, launches, free motion."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.periodic import natural_frequency
from analysis.run import Inputs, simulate
from analysis.studies.youssef import (
    chapter_3,
    formulation,
    free_crank,
    integrators,
    launches,
    multipliers,
    no_spring,
    runs,
)
from linkwork.errors import InputError
from linkwork.five_bar.parameters import InitialState
from tests import published

from .results import check, every, result, statement


@every("3.")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


class TestDrift:
    """Fig 3.2 and 3.3."""

    @staticmethod
    def per_turn(drift: no_spring.Drift) -> NDArray[np.float64]:
        return np.diff(drift.slider_cm[: 3 * no_spring.SAMPLES_PER_DRIFT_TURN + 1 : no_spring.SAMPLES_PER_DRIFT_TURN])

    @pytest.mark.parametrize("gravity", published.U_AFTER_40_TURNS_CM)
    def test_how_far_the_strongest_damper_lets_it_go(self, gravity: float) -> None:
        last = no_spring.drift(1e6, gravity).slider_cm[40 * no_spring.SAMPLES_PER_DRIFT_TURN]
        assert last == pytest.approx(published.U_AFTER_40_TURNS_CM[gravity], abs=0.005)

    def test_it_is_near_linear_with_the_strong_dampers_only(self) -> None:
        for mu in no_spring.DAMPINGS:
            drifts = self.per_turn(no_spring.drift(mu))
            assert (abs(drifts[2] / drifts[0] - 1.0) < 0.1) == (mu >= 5e5)

    def test_the_motion_is_steady_from_the_start_or_never(self) -> None:
        steady = {mu: no_spring.drift(mu).transient for mu in no_spring.DAMPINGS}
        assert {mu for mu, turns in steady.items() if turns == 0} == {5e5, 1e6}
        for mu in (1e4, 5e4, 1e5):
            assert steady[mu] == no_spring.drift(mu).collinear_turn

    @pytest.mark.parametrize("mu", published.TURNS_TO_SINE_0_3)
    def test_coupler_and_rocker_come_collinear(self, mu: float) -> None:
        turns = published.TURNS_TO_SINE_0_3[mu]
        assert no_spring.drift(mu).collinear_turn == pytest.approx(turns, abs=0.5 if turns > 10 else 0.05)

    @pytest.mark.parametrize("mu", [5e5, 1e6])
    def test_without_gravity_it_grows_by_a_quarter(self, mu: float) -> None:
        without, drift = (no_spring.drift(mu, gravity) for gravity in (0.0, 9.81))
        assert self.per_turn(without) / self.per_turn(drift) == pytest.approx([1.25] * 3, abs=0.03)
        assert without.rate / drift.rate == pytest.approx(1.242, abs=0.003)


class TestSteadyMotion:
    """Fig 3.4 and 3.5."""

    @pytest.mark.parametrize("k", published.MEAN_STEADY_U_CM)
    def test_least_position_and_mean(self, k: float) -> None:
        turn = runs.steady_turn(runs.table_3_1(k), 420.0)
        least, _ = runs.least(turn.angle_deg, turn.slider_cm)
        assert least == pytest.approx(published.LEAST_STEADY_U_AT_DEG[k], abs=0.05)
        assert turn.slider_cm[:-1].mean() == pytest.approx(published.MEAN_STEADY_U_CM[k], abs=5e-4)

    def test_torques(self) -> None:
        turns = [runs.steady_turn(runs.table_3_1(k), 420.0) for k in runs.STIFFNESSES]
        torque = published.DYN_CM**-1 * turns[1].torque
        apart = np.ptp([turn.torque for turn in turns], axis=0).max() / np.abs(turns[1].torque).max()
        assert apart == pytest.approx(published.TORQUE_DIFFERENCE_OF_PEAK, abs=5e-4)
        for find, (angle, value) in zip((runs.greatest, runs.least), published.TORQUE_REVERSAL_DEG_DYN_CM):
            assert find(turns[1].angle_deg, torque) == (
                pytest.approx(angle, abs=0.5),
                pytest.approx(value, abs=0.005e7),
            )

    @pytest.mark.parametrize("k", runs.STIFFNESSES)
    def test_the_mean_torque_pays_the_damper_alone(self, k: float) -> None:
        turn, parameters = runs.steady_turn(runs.table_3_1(k), 420.0), runs.table_3_1(k)
        rate = np.gradient(turn.slider_cm / 100.0, runs.PERIOD / 1440)
        loss = parameters.slider_damping * (rate[:-1] ** 2).mean() * runs.PERIOD / (2.0 * np.pi)
        means = chapter_3.damper_torque(k).mean(), turn.torque[:-1].mean()
        assert means == pytest.approx((loss, loss), abs=1e-5 * np.abs(turn.torque).max())

    def test_parts_of_the_torque(self) -> None:
        """The weights by virtual work, the whole by the multiplier of 3.1."""
        turn, found, p = runs.steady_turn(runs.table_3_1(1e6), 420.0), chapter_3.parts(1e6), multipliers.TABLE

        def potential(crank: float, u: float) -> float:
            q, _ = multipliers.closed_loop_state(crank, u, 0.0, 0.0)
            coupler = p.crank_length * np.sin(crank) + p.coupler_cog_distance * np.sin(q[1])
            return p.gravity * (p.coupler_mass * coupler + p.rocker_mass * p.rocker_cog_distance * np.sin(q[2]))

        rate = np.gradient(turn.slider_cm / 100.0, runs.PERIOD / 1440)
        for i in range(20, 1440, 140):
            crank, u = np.radians(turn.angle_deg[i]), turn.slider_cm[i] / 100.0
            weight = (potential(crank + 1e-5, u) - potential(crank - 1e-5, u)) / 2e-5
            assert found.gravity[i] == pytest.approx(weight, abs=1e-8)
            w = multipliers.solve_multipliers(*multipliers.closed_loop_state(crank, u, multipliers.OMEGA, rate[i]))
            assert found.whole[i] == pytest.approx(w[0], abs=1e-3)

    def test_distance_on_a_graph_is_square_to_the_curve(self) -> None:
        x = np.linspace(0.0, 1.0, 401)
        steep = np.sin(2.0 * np.pi * x)
        apart = chapter_3.graph_distance(x, steep, np.sin(2.0 * np.pi * (x - 0.01)))
        assert apart[0] == pytest.approx(0.01 * np.sin(np.arctan(2.0 * np.pi)), rel=0.02)
        assert apart[100] < 0.003


class TestLaunch:
    """Section 3.2.2."""

    def test_torque_times_time_squared_is_nearly_constant_and_torque_times_time_is_not(self) -> None:
        torque, time = (result("3.7").columns[name] for name in ("T0 [dyn.cm]", "time to 1 rad [s]"))
        squared, hyperbola = torque * time**2, torque * time
        assert squared.max() / squared.min() < 1.11
        assert hyperbola.max() / hyperbola.min() > 4.0
        (exponent, *_) = statement("3.7", "A plot of the initial torque").cases
        assert exponent.computed == pytest.approx(published.TORQUE_TIME_EXPONENT, abs=0.005)
        assert np.polyfit(np.log(time), np.log(torque), 1)[0] == pytest.approx(published.TORQUE_TIME_EXPONENT, abs=0.02)

    @pytest.mark.parametrize(
        ("values", "place"), [([3, 2, 1, 3, 1, 0], 3.75), ([1, 1, 1], 0.0), ([1, 2, 3], 3.0), ([3, 1.5, 1], 1.0)]
    )
    def test_last_place_above_a_level(self, values: list[float], place: float) -> None:
        assert launches.last_crossing(np.array(values, float), 1.5) == pytest.approx(place)

    def test_time_to_the_steady_decay_does_not_depend_on_the_release_of_the_free_crank(self) -> None:
        times = [launches.settling(1e8, 1e6, rpm).time for rpm in (780.0, 820.0)]
        assert times[0] == pytest.approx(times[1], rel=1e-5)

    def test_last_distances_from_the_steady_decay(self) -> None:
        """The known values are by other code, from a free crank that has exactly the mean speed of the launched one."""
        cases = statement("3.10", "Fig. (3.10) also shows").cases
        last = [case.computed for case in cases if case.label.endswith("last turn")]
        assert last == pytest.approx([7.34e-5, 5.0e-8, 1.04e-7], abs=1e-5)
        assert last == [round(distance, 5) for distance in last]

    def test_slider_passes_its_start(self) -> None:
        """After T0 = 1e8 dyn.cm by 0.024684 cm, by Runge-Kutta steps of 0.01 ms; after the strongest launch it does not."""
        tops = {case.label: case.computed for case in statement("3.8", "The three responses").cases}
        assert tops["greatest u; T0 = 1e8 dyn.cm"] == pytest.approx(0.024684 / 3.407018, rel=1e-4)
        assert tops["greatest u; T0 = 2e8 dyn.cm"] == 0.0

    def test_least_torque_to_four_digits(self) -> None:
        least = launches.least_torque()
        assert np.isfinite(launches.release_time(1.0001 * least, stop_time=3.0))
        assert np.isinf(launches.release_time(0.9999 * least, stop_time=3.0))


class TestFreeMotion:
    """Section 3.3."""

    def test_it_begins_in_the_steady_motion(self) -> None:
        u, v = (100.0 * free_crank.coast(1e6)[name][0] for name in ("slider.position", "slider.velocity"))
        assert u == pytest.approx(published.STEADY_U_CM, abs=1e-6)
        assert v == pytest.approx(published.STEADY_U_RATE_CM_S, abs=1e-4)

    @pytest.mark.parametrize("quarter", [1, 2, 3])
    def test_release_at_another_angle_of_the_steady_motion(self, quarter: int) -> None:
        """A run at constant speed, sampled every quarter of a turn, passes through the state of the release."""
        speed = 14.0 * np.pi
        times = {"stop_time": 20.0 / 7.0 + 1.0 / 7.0, "step": 1.0 / 28.0}
        steady = simulate(runs.table_3_1(free_crank.STIFF), Inputs(speed=speed), **times)
        free = free_crank.coast(free_crank.STIFF, release=0.5 * np.pi * quarter)
        assert free["crank.angle"][0] == pytest.approx(0.5 * np.pi * quarter)
        for name, tolerance in (("slider.position", 1e-6), ("slider.velocity", 1e-4)):
            assert free[name][0] == pytest.approx(steady[name][80 + quarter], abs=tolerance)

    def test_what_is_measured_over_a_turn(self) -> None:
        angle = np.linspace(0.5, 0.5 + 8.0 * np.pi, 20001)
        run = Recorded(
            {
                "crank.angle": angle,
                "crank.speed": 5.0 + 0.2 * np.sin(angle),
                "slider.position": 0.01 + 0.003 * np.cos(angle) + 0.001 * np.sin(2.0 * angle),
                "slider.velocity": 0.02 * np.sin(angle),
                "energy.kinetic": 3.0 + 0.04 * np.cos(angle),
            },
            time=0.2 * (angle - 0.5) + 0.01 * np.cos(angle),
        )
        turns = free_crank.Turns.from_run(run, start=0.5)
        assert turns.speed == pytest.approx([5.0] * 3, rel=1e-6)
        assert turns.speed_range == pytest.approx([0.4] * 3, rel=1e-5)
        assert turns.velocity_range == pytest.approx([4.0] * 3, rel=1e-5)
        assert turns.slider == pytest.approx([1.0] * 3, rel=1e-6)
        assert turns.first == pytest.approx([0.3] * 3, rel=1e-6)
        assert turns.second == pytest.approx([0.1] * 3, rel=1e-6)
        # 0.08 of 3, and 5.2 squared less 4.8 squared of 25.02
        assert turns.energy_share == pytest.approx([(0.08 / 3.0) / (4.0 / 25.02)] * 3, rel=1e-3)

    def test_mean_of_a_turn_that_does_not_end_where_it_begins(self) -> None:
        angle = np.linspace(0.0, 5.0 * np.pi, 5001)
        names = ("slider.velocity", "crank.speed", "energy.kinetic")
        run = Recorded(
            {"crank.angle": angle, "slider.position": angle, **dict.fromkeys(names, 1.0 + angle)}, time=angle
        )
        assert free_crank.Turns.from_run(run).slider == pytest.approx([100.0 * np.pi, 300.0 * np.pi], rel=1e-9)

    def test_too_few_turns_to_compare(self) -> None:
        with pytest.raises(InputError, match="1 turn to compare"):
            runs.greatest_ratio(np.array([3.0]))

    def test_turns_end_where_the_crank_turns_back(self) -> None:
        angle = np.concatenate([np.linspace(0.0, 14.0, 1401), np.linspace(13.99, 0.0, 1400)])
        turns = free_crank.sample_turns(angle, np.sin(angle))
        assert turns.shape[0] == 2
        assert np.abs(np.fft.rfft(turns, axis=1)[:, 2:]).max() < 1e-5 * free_crank.SAMPLES

    def test_speed_of_the_greatest_value_between_turns(self) -> None:
        turns = free_crank.Turns(*[np.array([])] * 9)
        turns = replace(turns, speed=np.array([50.0, 40.0, 32.0, 26.0]))
        # a parabola over the turns, greatest 0.7 turns after the first
        assert turns.speed_of_greatest(2.0 - (np.arange(4.0) - 0.7) ** 2) == pytest.approx(43.0)

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

    def test_without_the_damper_the_mean_speed_falls_and_rises_again(self) -> None:
        assert "between 0.64 and 1.04 of" in statement("3.12", "The oscillatory behaviour of the speed").why

    def test_launch_without_a_damper_that_ends_early(self) -> None:
        assert "T0 = 2e8 dyn.cm the links become collinear after 4 turns" in statement("3.6", "The decaying aspect").why

    def test_with_the_mean_effective_mass(self) -> None:
        half = 0.5 * natural_frequency(runs.table_3_1(free_crank.STIFF))
        assert half == pytest.approx(published.HALF_NATURAL_FREQUENCY_RAD_S, abs=0.005)

    @pytest.mark.parametrize("k", [free_crank.SOFT, free_crank.STIFF])
    def test_linear_motion_is_that_of_a_slider_that_stays_near_its_start(self, k: float) -> None:
        """It follows the free motion the better, the less the slider moves: at the end better than at the start."""
        angle, u = free_crank.linear_motion(k)
        of = free_crank.coast(k)["slider.position"][: len(angle)]
        apart = np.abs(free_crank.sample_turns(angle, u - of)).max(axis=1) / np.ptp(of)
        assert apart[-1] < 0.2 * apart[:5].max()
        assert apart.max() < 0.2


class TestFormulation:
    """Chapter II and section 3.1."""

    def test_start_is_that_of_the_independent_derivation(self) -> None:
        w = multipliers.solve_multipliers(*multipliers.closed_loop_state(0.0, 0.0, multipliers.OMEGA, 0.0))
        assert w[0] == pytest.approx(published.CRANK_TORQUE_AT_START_DYN_CM * published.DYN_CM, rel=1e-9)

    def test_multipliers_of_the_loop_broken_at_b_and_at_c_carry_the_coupler(self) -> None:
        """Their difference is the mass of the coupler times its acceleration, and its weight."""
        p, where = multipliers.TABLE, multipliers.closed_loop_state(0.7, -0.01, multipliers.OMEGA, 0.2)
        _, at_b, at_c, _ = multipliers.broken_loop_forces(*where)
        (th2, th3, *_), (w2, w3, *_), rate = *where, multipliers.solve_multipliers(*where)[5]
        crank, arm = p.crank_length * np.exp(1j * th2), p.coupler_cog_distance * np.exp(1j * th3)
        acceleration = -(w2**2) * crank + (1j * rate - w3**2) * arm
        assert at_c - at_b == pytest.approx(p.coupler_mass * (acceleration + 1j * p.gravity), rel=1e-9)

    def test_equations_of_chapter_2_but_for_a_cosine(self) -> None:
        found = multipliers.chapter_2_residuals()
        assert len(found) == 10
        assert [name for name, residual in found.items() if residual > 1e-12] == ["(2.20)"]

    def test_closure_shows_nothing_where_kinematics_close_the_loop(self) -> None:
        run = formulation.integrate_both(4e-3)
        assert run.errors[1] > 1e-3
        assert run.unseen < 1e-12
        assert run.gap.max() > run.errors[0]

    def test_closure_shows_the_error_of_a_launch_if_the_torque_ends_smoothly(self) -> None:
        smooth, kinked = (gap / errors[0] for gap, errors in (formulation.integrate_launch(1e-3, n) for n in (5, 1)))
        assert 1.0 < smooth < 100.0
        assert kinked < 0.1

    def test_estimate_of_hamming_tells_the_truncation_and_no_error_of_the_start(self) -> None:
        estimates, errors, _ = formulation.estimated_errors()
        assert np.corrcoef(estimates, errors)[0, 1] > 0.95
        assert formulation.estimated_errors(1e-5)[0] == pytest.approx(estimates, abs=1e-11)

    @pytest.mark.parametrize(("highest", "order"), [(2, 3), (3, 4)])
    def test_series_of_order_four_needs_the_third_derivative(self, highest: int, order: int) -> None:
        assert integrators.order_of_series(highest) == pytest.approx(order, abs=0.1)

    def test_stable_steps_by_the_roots_of_the_methods(self) -> None:
        """On y' = iy the roots of (2.28) to (2.31), and of Runge-Kutta's polynomial, have a modulus of 1 at the limits."""

        def hamming(z: complex) -> float:
            columns = []
            for y, y1, y2, y3, apart in np.eye(5):
                p = y3 + 4.0 / 3.0 * z * (2.0 * y - y1 + 2.0 * y2)
                c = (9.0 * y - y2 + 3.0 * z * (p - 112.0 / 121.0 * apart + 2.0 * y - y1)) / 8.0
                columns.append([c + 9.0 / 121.0 * (p - c), y, y1, y2, p - c])
            return float(np.abs(np.linalg.eigvals(np.transpose(columns))).max())

        classical, found = integrators.stable_steps(1j)
        assert classical == pytest.approx(np.sqrt(8.0), rel=1e-4)
        assert hamming(0.999j * found) < 1.0 < hamming(1.001j * found)

    @pytest.mark.parametrize(("modified", "final", "order"), [(1, 1, 5), (0, 1, 5), (1, 0, 4), (0, 0, 4)])
    def test_the_final_value_adds_an_order(self, modified: int, final: int, order: int) -> None:
        """(2.28) to (2.31) on y' = -y from exact values, with the modifier and the final value or without them."""
        errors = []
        for h in (0.05, 0.025):
            y, apart = np.exp(-h * np.arange(4.0)).tolist(), 0.0
            while len(y) <= round(1.0 / h):
                p = y[-4] - 4.0 * h / 3.0 * (2.0 * y[-1] - y[-2] + 2.0 * y[-3])
                m = p - modified * 112.0 / 121.0 * apart
                c = (9.0 * y[-1] - y[-3] - 3.0 * h * (m + 2.0 * y[-1] - y[-2])) / 8.0
                apart = p - c
                y.append(c + final * 9.0 / 121.0 * apart)
            errors.append(abs(y[-1] - np.exp(-1.0)))
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)

    def test_milne_grows_where_hamming_decays(self) -> None:
        """Milne's corrector by steps on y' = -y from a start that is off by 1e-8."""
        h, y = 0.1, [1.0, np.exp(-0.1) + 1e-8]
        for _ in range(400):
            y.append((y[-2] * (1.0 - h / 3.0) - 4.0 * h / 3.0 * y[-1]) / (1.0 + h / 3.0))
        growth = integrators.spurious_root((1, 0, -1), (1 / 3, 4 / 3, 1 / 3), h)
        assert abs(y[-1] / y[-2]) == pytest.approx(growth, rel=1e-6)
        assert growth > 1.0


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
