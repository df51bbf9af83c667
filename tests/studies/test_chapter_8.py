"""The figures of chapter VIII, on rigs 1 and 2: the orbits against runs, what friction does, and the page on rig 2."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from analysis import Inputs, simulate
from analysis.cli import main
from analysis.periodic import Crossing, natural_frequency
from analysis.studies.youssef import _friction, _rig_1, _rig_2, fig_8_15, fig_8_16, fig_8_21
from analysis.studies.youssef._orbits import between, columns_of, highest, orbit, rpm
from analysis.studies.youssef._runs import SteadyTurn, rig_1, steady_turn
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import SETS
from tests import published

from .results import check_plot_and_data, check_verdicts, every

PAGE = Path(__file__).parents[2] / "docs" / "rig-2.md"

#: What the thesis states and the right physics does not bear out.
REFUTED = {
    ("8.8", "speed of the local maximum"),
    ("8.12", "speed of the local maximum"),
    ("8.14", "natural frequency"),
    ("8.14", "speed of the local maximum"),
    ("8.14", "speed of the minimum"),
    ("8.15", "natural frequency"),
    ("8.15", "natural frequency relative to spring A's"),
    ("8.15", "speed of the local maximum"),
    ("8.17", "local maximum; spring A, with the friction that fits best"),
    ("8.17", "minimum; spring A, with the friction that fits best"),
    ("8.17", "local maximum; spring B, with the friction that fits best"),
    ("8.17", "local maximum; spring A, with the friction and damping that fit best"),
    ("8.17", "minimum; spring A, with the friction and damping that fit best"),
    ("8.17", "resonance; spring A, with the friction and damping that fit best"),
    ("8.17", "local maximum; spring B, with the friction and damping that fit best"),
    ("8.17", "misfit left by the friction that fits best"),
    ("8.17", "the same with the damping free"),
    ("8.17", "levels that bring one speed each, greatest less least"),
}
#: Studies whose results take more than a second or two.
LONG = {"8.15", "8.17", "8.18", "8.19", "8.20", "8.21"}


@every("8.", LONG)
def test_verdicts(number: str) -> None:
    check_verdicts(number, REFUTED)


@every("8.", LONG)
def test_plot_and_data(number: str) -> None:
    check_plot_and_data(number)


@pytest.mark.parametrize("name", published.NATURAL_RPM)
def test_natural_frequency(name: str) -> None:
    right = published.NATURAL_RPM[name].right
    # as many digits as are given
    half_digit = 0.05 if name.startswith("rig-2") else 0.5
    assert natural_frequency(SETS[name].parameters) / published.RPM == pytest.approx(right, abs=half_digit)


class TestRig1:
    """Fig 8.14 to 8.16."""

    def test_maxima_and_minimum_of_the_amplitude(self) -> None:
        for spring in ("a", "b"):
            assert _rig_1.local_maximum(spring) == pytest.approx(published.LOCAL_MAXIMUM_RPM[spring].right, abs=0.5)
        lowest = between(_rig_1.slow("a").minima(), 320.0, 420.0)[0]
        assert lowest == pytest.approx(published.MINIMUM_RPM["a"].right, abs=0.5)

    def test_runs_from_rest_jump_at_the_fold_of_spring_b(self) -> None:
        (fold,) = fig_8_15.speeds_of(Crossing.FOLD)
        below, above = (steady_turn(rig_1("b"), speed).amplitude for speed in (fold - 3.0, fold + 3.0))
        assert below < 4.0
        assert above > 10.0

    def test_three_motions_at_1000_rpm(self) -> None:
        lower, upper = orbit(rig_1("b"), 1000.0), fig_8_15.upper_orbit(1000.0)
        branch = _rig_1.resonant_b().branches[0]
        beyond = branch.special[0].after + 1
        middle = branch.orbits[beyond + int(np.argmin(np.abs(rpm(branch)[beyond:] - 1000.0)))]
        assert lower.largest < 1.0 < middle.largest
        assert upper.largest < 1.0
        assert lower.amplitude < middle.amplitude < upper.amplitude
        run = steady_turn(rig_1("b"), 1000.0, (0.9 * upper.start[0], 0.9 * upper.start[1]))
        assert run.amplitude == pytest.approx(100.0 * upper.amplitude, abs=1e-4)

    def test_sweeps_part_between_the_doubling_and_the_fold(self) -> None:
        rising, falling = fig_8_15.sweep_b(True).amplitude, fig_8_15.sweep_b(False).amplitude[::-1]
        speeds = fig_8_15.sweep_b(True).speed / published.RPM
        (fold,), doubling = fig_8_15.speeds_of(Crossing.FOLD), max(fig_8_15.speeds_of(Crossing.PERIOD_DOUBLING))
        both = (speeds > doubling) & (speeds < fold)
        assert (falling[both] > 2.0 * rising[both]).all()
        np.testing.assert_allclose(falling[speeds > fold], rising[speeds > fold], rtol=1e-9)

    def test_harmonics_end_at_the_fold(self) -> None:
        speeds, _ = fig_8_16.harmonics("b")
        assert (np.diff(speeds) >= -1e-9).all()
        assert speeds[-1] == pytest.approx(fig_8_15.speeds_of(Crossing.FOLD)[0], abs=1.0)


@pytest.mark.slow
class TestFriction:
    """Fig 8.17."""

    @pytest.mark.parametrize("friction", [0.0, 0.4, 0.8, 1.2, 1.5])
    def test_no_level_brings_the_speeds(self, friction: float) -> None:
        stated = np.array([feature.stated for feature in _friction.FITTED])
        assert sum(abs(_friction.speeds(friction) - stated) > 5.0) >= 2

    def test_the_fits_are_least_squares(self) -> None:
        (level,), (friction, damping) = _friction.fit(False).x, _friction.fit(True).x
        one, two = (_friction.size(_friction.fit(both).fun) for both in (False, True))
        assert two < one < _friction.size(_friction.misfit(_friction.speeds(0.0)))
        for other in (level - 0.3, level + 0.3):
            assert _friction.size(_friction.misfit(_friction.speeds(other))) > one
        for place in ((friction + 0.3, damping), (friction, damping - 1.5), (friction, damping + 1.5)):
            assert _friction.size(_friction.misfit(_friction.speeds(*place))) > two

    def test_the_fit_with_free_damping_wants_no_friction(self) -> None:
        friction, damping = _friction.fit(True).x
        assert friction < 0.1
        assert damping == pytest.approx(15.2, abs=0.3)

    def test_the_large_motion_dies_out_at_its_fold(self) -> None:
        branch = _friction.upper_motion()
        (fold,) = (s.parameter for s in branch.special if s.kind is Crossing.FOLD)
        start = tuple(branch.special[0].orbit.start.tolist())
        assert steady_turn(rig_1("b", fold - 2.0), 1000.0, start).amplitude > 10.0
        assert steady_turn(rig_1("b", fold + 2.0), 1000.0, start).amplitude < 3.0

    def test_level_between_samples(self) -> None:
        feature = replace(_friction.FITTED[0], stated=10.0)
        levels = np.array([0.0, 1.0, 3.0])
        assert feature.level(levels, np.array([8.0, 9.0, 13.0])) == 1.5
        assert feature.level(levels, np.array([11.0, 12.0, 13.0])) is None


class TestRig2:
    """Fig 8.18 to 8.21."""

    @pytest.mark.parametrize("spring", ["c", "d"])
    def test_the_measured_natural_frequencies_are_those_of_the_resonance(self, spring: str) -> None:
        measured = published.NATURAL_RPM[f"rig-2-spring-{spring}"].thesis
        assert _rig_2.resonance(spring)[0] == pytest.approx(measured, abs=5.0)

    def test_the_second_harmonic_makes_the_lower_maximum(self) -> None:
        turn = orbit(_rig_2.rig_2("c"), _rig_2.half_resonance("c")[0]).turn()
        assert turn.harmonic("slider.position", 2) > turn.harmonic("slider.position", 1)

    def test_pin_forces_of_a_run(self) -> None:
        parameters, speed = _rig_2.rig_2("c"), 580.0
        found = orbit(parameters, speed)
        period = 60.0 / speed
        run = simulate(
            parameters,
            Inputs(speed=speed * pi / 30.0),
            initial=InitialState(slider_position=found.start[0], slider_velocity=found.start[1]),
            stop_time=period,
            step=period / 256,
        )
        for pin in "ABCD":
            of_run, of_orbit = (np.hypot(x[f"pin.{pin}.fx"], x[f"pin.{pin}.fy"]).max() for x in (run, found.turn()))
            assert of_orbit == pytest.approx(of_run, rel=1e-7)

    @pytest.mark.parametrize("pin", "ACD")
    def test_forces_at_low_speed_grow_with_its_square(self, pin: str) -> None:
        branch = _rig_2.motions("d").branches[0]
        added = fig_8_21.amplification(branch, branch.columns()[f"greatest force in pin {pin} [N]"])
        assert added[rpm(branch) < 200.0] == pytest.approx(1.0, abs=0.015)


def test_place_of_the_greatest_of_uneven_samples() -> None:
    x = np.array([0.0, 0.4, 0.9, 1.0, 1.7, 2.0])
    assert highest(x, 3.0 - (x - 0.83) ** 2) == pytest.approx(0.83, abs=1e-12)


def test_the_parts_of_a_branch_meet() -> None:
    columns = columns_of(_rig_1.resonant_b().branches[0], "x")
    stable, unstable = (np.isfinite(columns[f"{part}; x [cm]"]) for part in ("stable", "unstable"))
    assert (stable | unstable).all()
    assert (stable & unstable).sum() == 1


@pytest.mark.slow
class TestPage:
    """docs/rig-2.md."""

    def test_its_python_prints_what_it_says(self) -> None:
        blocks = re.findall(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", PAGE.read_text(), flags=re.DOTALL)
        assert len(blocks) == 6
        space: dict[str, object] = {}
        for block, expected in blocks:
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                exec(block, space)
            assert output.getvalue() == expected

    def test_its_commands_run(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        commands = re.findall(r"```sh\nlinkwork (.*?)\n```", PAGE.read_text())
        assert len(commands) == 7
        for command in commands:
            done = CliRunner().invoke(main, shlex.split(command), catch_exceptions=False)
            assert done.exit_code == 0, command
        assert (tmp_path / "out" / "rig-2-spring-c-resonance.csv").exists()
        assert (tmp_path / "out" / "figures" / "fig_8_21.png").exists()

    def test_the_numbers_of_its_table(self) -> None:
        rows = re.findall(r"^\| (maximum|minimum) \| ([\d.]+) \| ([\d.]+) cm \|", PAGE.read_text(), flags=re.MULTILINE)
        response = _rig_2.motions("c")
        found = [(e, "maximum") for e in response.maxima()] + [(e, "minimum") for e in response.minima()]
        for kind, speed, amplitude in rows:
            assert any(
                kind == other
                and abs(e.parameter / published.RPM - float(speed)) < 0.02
                and abs(100.0 * e.amplitude - float(amplitude)) < 1e-4
                for e, other in found
            )
        assert len(rows) == 3


class TestSteadyMotion:
    """Fig 8.7 to 8.17."""

    @pytest.mark.parametrize(("spring", "rpm"), [("a", 592.0), ("b", 1133.0)])
    def test_natural_frequency(self, spring: str, rpm: float) -> None:
        assert _rig_1.natural_speed(spring) == pytest.approx(rpm, abs=0.5)

    def test_four_peaks_become_two(self) -> None:
        assert _rig_1.speed_of_fewer_peaks("a", 400.0, 500.0) == pytest.approx(451.0, abs=1.0)
        assert _rig_1.steady_turn(_rig_1.rig_1("a"), 440.0).peaks == 4
        assert _rig_1.steady_turn(_rig_1.rig_1("a"), 460.0).peaks == 2
        # with spring B too, at the same fraction of its natural frequency
        assert _rig_1.speed_of_fewer_peaks("b", 800.0, 900.0) == pytest.approx(847.0, abs=1.0)

    @pytest.mark.parametrize(("rpm", "peaks"), [(150.0, 8), (200.0, 6), (250.0, 4)])
    def test_peaks_at_low_speed(self, rpm: float, peaks: int) -> None:
        assert _rig_1.steady_turn(_rig_1.rig_1("a"), rpm).peaks == peaks

    def test_amplitude_is_half_of_peak_to_peak(self) -> None:
        turn = _rig_1.steady_turn(_rig_1.rig_1("a"), 600.0)
        assert turn.amplitude == (turn.slider_cm.max() - turn.slider_cm.min()) / 2.0

    def test_harmonic(self) -> None:
        angle = np.linspace(0.0, 2.0 * np.pi, 721)
        turn = SteadyTurn(np.degrees(angle), 0.3 + 2.0 * np.cos(angle + 0.4) + 0.7 * np.sin(2.0 * angle), angle, 0.0)
        assert turn.harmonic(1) == pytest.approx(2.0, rel=1e-12)
        assert turn.harmonic(2) == pytest.approx(0.7, rel=1e-12)
        assert turn.harmonic(3) == pytest.approx(0.0, abs=1e-12)
