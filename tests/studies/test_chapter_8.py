"""The figures of chapter VIII, on rigs 1 and 2: the orbits against runs, what friction does, and the page on rig 2."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.numerics.decay import fit_decay
from analysis.periodic import Crossing, mean_effective_mass, natural_frequency
from analysis.studies import STUDIES
from analysis.studies.youssef import chapter_8, instruments, rig_1, rig_2, rigs
from analysis.studies.youssef.runs import steady_turn
from analysis.units import RAD_S_PER_RPM
from analysis.youssef import Variant
from linkwork.five_bar.published import SETS
from tests import published
from tests.scripts import linkwork

from .results import check, every


def speeds_of(kind: Crossing) -> list[float]:
    """Speeds of the special points of one kind with spring B (rpm)."""
    return [special.parameter / RAD_S_PER_RPM for special in rig_1.special_points() if special.kind is kind]


def peaks_of_run(speed: float) -> int:
    """Maxima and minima of the slider in a turn with spring A, from a run from rest."""
    return rigs.count_sign_changes(np.diff(steady_turn(rigs.rig("A"), speed).slider_cm))


@every("8.", "rig-")
def test_verdicts_plot_and_data(number: str) -> None:
    check(number)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spring", "speed"),
    [("A", 240.0), ("A", 420.0), ("A", 500.0), ("B", 500.0), ("B", 780.0), ("C", 586.0), ("D", 1300.0)],
)
def test_runs_from_rest_end_in_the_orbits(spring: str, speed: float) -> None:
    run = steady_turn(rigs.rig(spring), speed)
    assert run.change < 1e-4
    assert np.abs(run.slider_cm - rigs.slider(rigs.turn(spring, speed))).max() < 1e-4


class TestPulses:
    """Speed of the crank by the times between the holes of its disc."""

    @pytest.mark.parametrize("order", [1, 2, 8])
    def test_a_harmonic_is_averaged_over_the_pitch(self, order: int) -> None:
        angle = np.linspace(0.0, 2.0 * np.pi, 14401)
        pulses = instruments.pulse_speeds(44.0 * (1.0 + 1e-3 * np.cos(order * angle)))
        # sin(x)/x of half the pitch
        found = 2.0 * np.abs(np.fft.rfft(pulses)[order]) / len(pulses)
        assert found == pytest.approx(0.044 * np.sinc(order / 60.0), rel=1e-3)

    def test_its_error_is_what_the_average_takes_away(self) -> None:
        speed = 44.0 * (1.0 + 1e-3 * np.cos(12.0 * np.linspace(0.0, 2.0 * np.pi, 14401) + np.pi / 5.0))
        assert instruments.pulse_error(speed) == pytest.approx(1e-3 * (1.0 - np.sinc(12.0 / 60.0)), rel=0.1)

    def test_speed_by_the_energy(self) -> None:
        """Kinetic energy gained from the least to the greatest speed is the work of the torques in between."""
        inertia = 2e-2
        speed, torque = instruments.crank_speed(inertia), rigs.turn("A", instruments.PULSED)["drive.applied_torque"]
        low, high = int(speed[:-1].argmin()), int(speed[:-1].argmax())
        between = np.arange(low, high if high > low else high + len(torque)) % len(torque)
        work = (torque.mean() - torque[between]).sum() * 2.0 * np.pi / len(torque)
        assert 0.5 * inertia * (speed[high] ** 2 - speed[low] ** 2) == pytest.approx(work, rel=0.02)
        # by a program of its own, which integrates Fourier series
        assert np.ptp(instruments.pulse_speeds(speed)) / np.ptp(speed) == pytest.approx(0.995952, abs=2e-5)
        assert instruments.pulse_error(speed) == pytest.approx(7.2564e-5, rel=1e-3)


@pytest.mark.parametrize(("spring", "damping"), [("A", 9.0), ("C", 5.5)])
def test_dry_friction_is_told_from_damping(spring: str, damping: float) -> None:
    time = np.linspace(0.0, instruments.LENGTH, 4001)
    rubbed, mass = instruments.impulse_response(spring, time, instruments.DRY), rigs.rig(spring).slider_mass
    assert fit_decay(time, rubbed, friction=True).damping(mass)[0] == pytest.approx(damping, rel=0.01)
    assert fit_decay(time, rubbed).damping(mass)[0] > damping + 1.0


PAGE = Path(__file__).parents[2] / "docs" / "rig-2.md"


@pytest.mark.parametrize("name", published.NATURAL_RPM)
def test_natural_frequency(name: str) -> None:
    right = published.NATURAL_RPM[name].right
    # as many digits as are given
    half_digit = 0.05 if name.startswith("rig-2") else 0.5
    assert natural_frequency(SETS[name].parameters) / published.RPM == pytest.approx(right, abs=half_digit)


@pytest.mark.parametrize("friction", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("spring", ["A", "C"])
def test_impulse_response(spring: str, friction: float) -> None:
    """Against an integration of the disconnected slider that knows nothing of half swings."""
    p, time = rigs.rig(spring), np.linspace(0.0, 0.4, 401)

    def rates(_: float, y: list[float]) -> list[float]:
        force = p.slider_stiffness * y[0] + p.slider_damping * y[1] + friction * np.tanh(y[1] / 1e-5)
        return [y[1], -force / p.slider_mass]

    run = solve_ivp(rates, (0.0, 0.4), (0.0, instruments.KICK), t_eval=time, method="Radau", rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(instruments.impulse_response(spring, time, friction), run.y[0], atol=2e-6)


class TestRig1:
    """Fig 8.7 to 8.17, and rig-1-resonance."""

    @pytest.mark.parametrize("order", [2, 3])
    @pytest.mark.parametrize("spring", ["A", "B"])
    def test_a_harmonic_is_greatest_where_it_meets_the_natural_frequency(self, spring: str, order: int) -> None:
        branch = rigs.motions(spring).branches[0]
        ratio = order * rigs.rpm(branch) / rigs.natural_speed(spring)
        size = branch.columns()[f"harmonic {order} of u [m]"]
        within = abs(ratio - 1.0) < 0.2
        assert ratio[within][size[within].argmax()] == pytest.approx(1.0, abs=0.03)

    @pytest.mark.slow
    def test_rise_over_the_next_minimum(self) -> None:
        """With spring B: 0.4189 cm at 378 rpm and 0.2890 at 426, read off runs from rest."""
        top, low = (np.ptp(steady_turn(rigs.rig("B"), speed).slider_cm) for speed in (378.1, 426.2))
        assert rigs.peak_rise("B", 3) == pytest.approx(top / low - 1.0, rel=1e-3)

    def test_rise_within_four_rpm(self) -> None:
        """With spring A, 0.13241 cm at 152.3 rpm and 0.13221 at 155.6, by Runge-Kutta with equations derived anew."""
        assert rigs.peak_rise("A", 4) == pytest.approx(0.00153, abs=1e-5)

    def test_motions_of_spring_a_do_not_depend_on_the_history(self) -> None:
        up, down = (rig_1.sweep_speed("A", rising).amplitude for rising in (True, False))
        np.testing.assert_allclose(up, down[::-1], atol=1e-6)
        assert rigs.largest_multiplier("A", rigs.SLOWEST, rigs.FASTEST["A"]) < 1.0

    def test_sweeps_jump_at_the_fold_and_double_at_the_doubling(self) -> None:
        (fold,), doublings = speeds_of(Crossing.FOLD), speeds_of(Crossing.PERIOD_DOUBLING)
        (jump,) = (jump.speed / published.RPM for jump in rig_1.sweep_speed("B", True).jumps)
        falling = rig_1.sweep_speed("B", False)
        doubled = max(s for s, turns in zip(falling.speed / published.RPM, falling.turns) if turns == 2)
        assert jump == pytest.approx(fold, abs=rig_1.STEP)
        assert doubled == pytest.approx(max(doublings), abs=rig_1.STEP)

    def test_three_motions_at_1000_rpm(self) -> None:
        branch, above = rigs.resonant_b().branches[:2]
        start = above.orbits[int(np.argmin(np.abs(rigs.rpm(above) - 1000.0)))].start
        lower, upper = rigs.orbit(rigs.rig("B"), 1000.0), rigs.orbit(rigs.rig("B"), 1000.0, start)
        beyond = branch.special[0].after + 1
        middle = branch.orbits[beyond + int(np.argmin(np.abs(rigs.rpm(branch)[beyond:] - 1000.0)))]
        assert lower.largest < 1.0 < middle.largest
        assert upper.largest < 1.0
        assert lower.amplitude < middle.amplitude < upper.amplitude
        run = steady_turn(rigs.rig("B"), 1000.0, (0.9 * upper.start[0], 0.9 * upper.start[1]))
        assert 0.5 * np.ptp(run.slider_cm) == pytest.approx(100.0 * upper.amplitude, abs=1e-4)

    def test_sweeps_part_between_the_doubling_and_the_fold(self) -> None:
        rising, falling = rig_1.sweep_speed("B", True).amplitude, rig_1.sweep_speed("B", False).amplitude[::-1]
        speeds = rig_1.sweep_speed("B", True).speed / published.RPM
        (fold,), doubling = speeds_of(Crossing.FOLD), max(speeds_of(Crossing.PERIOD_DOUBLING))
        both = (speeds > doubling) & (speeds < fold)
        assert (falling[both] > 2.0 * rising[both]).all()
        np.testing.assert_allclose(falling[speeds > fold], rising[speeds > fold], rtol=1e-9)

    @pytest.mark.slow
    def test_four_peaks_become_two(self) -> None:
        assert rigs.speed_of_fewer_peaks("A", 400.0, 500.0) == pytest.approx(451.0, abs=1.0)
        assert peaks_of_run(440.0) == 4
        assert peaks_of_run(460.0) == 2
        # with spring B too, at the same fraction of its natural frequency
        assert rigs.speed_of_fewer_peaks("B", 800.0, 900.0) == pytest.approx(847.0, abs=1.0)

    def test_the_last_peak_of_a_turn_nears_the_first_of_the_next(self) -> None:
        """Angles (deg) from a program of its own, in cgs units, that shoots for the motion and has 7200 samples in a turn."""
        found = {580.0: 89.85, 600.0: 83.60, 620.0: 78.95, 660.0: 71.15, 680.0: 67.35, 720.0: 59.20, 780.0: 43.80}
        angles = [chapter_8._fall_angle(rigs.turn("B", speed)) for speed in found]
        assert angles == pytest.approx(list(found.values()), abs=0.06)

    @pytest.mark.parametrize(
        ("spring", "rpm", "cm"), [("A", 240.0, 0.3117468), ("A", 280.0, 0.6961297), ("B", 570.0, 1.4390278)]
    )
    def test_amplitude(self, spring: str, rpm: float, cm: float) -> None:
        """By collocation of the links' equations of Newton and Euler, with the extremes between the samples."""
        assert rigs.amplitude(rigs.turn(spring, rpm)) == pytest.approx(cm, abs=1e-6)

    @pytest.mark.parametrize(("rpm", "peaks"), [(150.0, 8), (200.0, 6), (250.0, 4), (500.0, 2)])
    def test_peaks(self, rpm: float, peaks: int) -> None:
        assert rigs.peaks(rigs.turn("A", rpm)) == peaks_of_run(rpm) == peaks


@pytest.mark.slow
class TestFriction:
    """rig-1-friction."""

    @pytest.mark.parametrize(("spring", "speed"), [("A", 300.0), ("B", 660.0)])
    def test_runs_from_rest_end_in_the_orbits(self, spring: str, speed: float) -> None:
        run = steady_turn(rigs.rig(spring, slider_friction_coefficient=0.1), speed)
        of = rigs.turn(spring, speed, slider_friction_coefficient=0.1)
        assert np.abs(run.slider_cm - rigs.slider(of)).max() < 1e-4

    def test_the_crank_supplies_what_damper_and_friction_take(self) -> None:
        of = rigs.turn("A", 420.0, slider_friction_coefficient=0.1)
        damper = rigs.rig("A").slider_damping * np.mean(of["slider.velocity"] ** 2)
        supplied = of["drive.applied_torque"].mean() * 420.0 * published.RPM
        friction = 0.1 * np.mean(np.abs(of["slider.guide_force"] * of["slider.velocity"]))
        assert friction / damper == pytest.approx(supplied / damper - 1.0, rel=2e-3)

    def test_amplitudes_without_friction_are_those_of_the_branch(self) -> None:
        branch = rigs.motions("A").branches[0]
        expected = 100.0 * np.interp(rigs.GRID["A"], rigs.rpm(branch), branch.amplitude)
        np.testing.assert_allclose(rigs.friction_amplitudes("A", 0.0), expected, rtol=1e-2)

    @pytest.mark.long
    @pytest.mark.parametrize("spring", ["A", "B"])
    def test_friction_lowers_the_amplitude(self, spring: str) -> None:
        sizes = [rigs.friction_amplitudes(spring, c).max() for c in rig_1.COEFFICIENTS]
        assert (np.diff(sizes) < 0.0).all()

    @pytest.mark.long
    def test_no_coefficient_moves_the_local_maximum_towards_290_rpm(self) -> None:
        half = (rigs.GRID["A"] > 250.0) & (rigs.GRID["A"] < 340.0)
        places = [rigs.GRID["A"][half][rigs.friction_amplitudes("A", c)[half].argmax()] for c in rig_1.COEFFICIENTS]
        assert (np.diff(places) >= 0.0).all()
        assert places[0] == pytest.approx(296.0, abs=2.5)

    def test_decrease_by_constant_friction_varies_with_the_speed_as_much(self) -> None:
        assert rig_1.spread_beyond_constant(0.05) == pytest.approx(1.0, abs=0.05)

    def test_lag(self) -> None:
        """About that of the peaks themselves."""
        smooth, rough = (rigs.slider(rigs.turn("A", 450.0, slider_friction_coefficient=c)) for c in (0.0, 0.2))
        tops = [360.0 * u.argmax() / rigs.SAMPLES for u in (smooth, rough)]
        assert rig_1.lag("A", 450.0, 0.2) == pytest.approx(tops[1] - tops[0], abs=6.0)
        assert rig_1.lag("A", 450.0, 0.0) == 0.0


class TestRig2:
    """Fig 8.18 to 8.21, and rig-2-forces."""

    @pytest.mark.parametrize("spring", ["C", "D"])
    def test_the_measured_natural_frequencies_are_those_of_the_resonance(self, spring: str) -> None:
        measured = published.NATURAL_RPM[f"rig-2-spring-{spring.lower()}"].thesis
        assert rigs.maximum_near_fraction(spring, 1)[0] == pytest.approx(measured, abs=5.0)

    def test_the_second_harmonic_makes_the_lower_maximum(self) -> None:
        of = rigs.turn("C", rigs.maximum_near_fraction("C", 2)[0])
        assert rigs.harmonic(of, 2) > rigs.harmonic(of, 1)

    @staticmethod
    def added(spring: str, pin: str) -> tuple[np.ndarray, np.ndarray]:
        """Speed over the natural one, and the greatest force over one that grows with the square of the speed."""
        branch = rigs.motions(spring).branches[0]
        force = branch.columns()[f"greatest force in pin {pin} [N]"]
        law = force[0] * (branch.parameter / branch.parameter[0]) ** 2
        return rigs.rpm(branch) / rigs.natural_speed(spring), force / law

    @pytest.mark.parametrize("pin", "ACD")
    def test_forces_at_low_speed_grow_with_its_square(self, pin: str) -> None:
        ratio, added = self.added("D", pin)
        assert added[ratio < 0.24] == pytest.approx(1.0, abs=0.015)

    @pytest.mark.parametrize("spring", "CD")
    def test_resonance_adds_most_to_pin_d(self, spring: str) -> None:
        top = {}
        for pin in "ACD":
            ratio, added = self.added(spring, pin)
            top[pin] = added[np.abs(ratio - 1.0) < 0.1].max()
        assert top["D"] > max(top["A"], top["C"], 2.0)
        assert self.added(spring, "D")[1][-1] < 1.0

    @pytest.mark.parametrize("spring", "CD")
    def test_second_harmonic_of_the_linear_equation(self, spring: str) -> None:
        for speed in (200.0, 400.0, 700.0, 1000.0):
            full = rigs.harmonic(rigs.turn(spring, speed), 2) / rig_2.length(spring)
            assert rig_2.linear_motion(spring, speed).harmonic(2) == pytest.approx(full, rel=0.1)

    @pytest.mark.parametrize(("spring", "rise"), [("C", 1.72e-4), ("D", 4.69e-4)])
    def test_what_the_orders_of_xi_alone_add(self, spring: str, rise: float) -> None:
        """At 1000 rpm; from a separate integration and balance. With two harmonics it would be 5e-4 more."""
        linear = rig_2.linear_motion(spring, 1000.0, Variant.EXACT, rig_2.EXACT_HARMONICS).amplitude
        full = rigs.amplitude(rigs.turn(spring, 1000.0)) / rig_2.length(spring)
        assert full / linear - 1.0 == pytest.approx(rise, abs=3e-6)

    def test_place_of_the_greatest_second_harmonic(self) -> None:
        """To first order of sigma2 it is the natural frequency, to second order half of it."""
        speeds = np.arange(280.0, 601.0, 10.0)
        for part, order in enumerate(rig_2.ORDERS.values(), start=1):
            sizes = [rig_2.linear_motion("C", speed, order).harmonic(2) for speed in speeds.tolist()]
            assert speeds[np.argmax(sizes)] == pytest.approx(rigs.natural_speed("C") / part, abs=10.0)
            assert max(rig_2._greatest("C", 2, n, order) for n in (1, 2)) == pytest.approx(max(sizes), rel=0.05)

    def test_the_ratio_to_a_single_mass_is_that_farthest_from_one(self) -> None:
        """With C, the second harmonic raises the amplitude at 300 rpm, and at 700 rpm there is the first alone."""
        low, high = np.array([300.0]), np.array([700.0])
        both = np.append(low, high)
        alone = rig_2._unbalance_ratio("C", high, 1.0)
        assert rig_2._unbalance_ratio("C", both, alone) == rig_2._unbalance_ratio("C", low, alone) > 1.5
        assert rig_2._unbalance_ratio("C", both, 3.0 * alone) == pytest.approx(1.0 / 3.0)

    def test_a_damper_widens_the_resonance_in_proportion(self) -> None:
        """That of a lightly damped mass on a spring is mu / m."""
        p = rigs.rig("C")
        expected = p.slider_damping / mean_effective_mass(p) / published.RPM
        assert rig_2.width("C") == pytest.approx(expected, abs=2.0)


def test_the_parts_of_a_branch_meet() -> None:
    columns = rigs.branch_columns(rigs.resonant_b().branches[0], "x")
    stable, unstable = (np.isfinite(columns[f"{part}; x [cm]"]) for part in ("stable", "unstable"))
    assert (stable | unstable).all()
    assert (stable & unstable).sum() == 1


@pytest.mark.slow
class TestPage:
    """docs/rig-2.md."""

    def test_its_python_prints_what_it_says(self) -> None:
        blocks = re.findall(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", PAGE.read_text(), flags=re.DOTALL)
        assert len(blocks) == 8
        space: dict[str, object] = {}
        for block, expected in blocks:
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                exec(block, space)
            assert output.getvalue() == expected

    def test_its_commands_run(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        commands = re.findall(r"```sh\nlinkwork (.*?)\n```", PAGE.read_text())
        assert len(commands) == 8
        for command in commands:
            name, *numbers = command.split()
            if name == "figures":  # their results are checked above
                assert set(numbers) <= set(STUDIES)
            else:
                linkwork(command)
        assert (tmp_path / "out" / "rig-2-spring-c-resonance.csv").exists()

    def test_the_numbers_of_its_table(self) -> None:
        rows = re.findall(r"^\| (maximum|minimum) \| ([\d.]+) \| ([\d.]+) mm \|", PAGE.read_text(), flags=re.MULTILINE)
        response = rigs.motions("C")
        found = [(e, "maximum") for e in response.maxima()] + [(e, "minimum") for e in response.minima()]
        for kind, speed, amplitude in rows:
            near = [(e, other) for e, other in found if abs(e.parameter / published.RPM - float(speed)) < 0.02]
            assert any(kind == other and abs(1e3 * e.amplitude - float(amplitude)) < 1e-3 for e, other in near)
        assert len(rows) == 3
