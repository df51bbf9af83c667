"""The figures of the theses: every stated result of theirs, and what each study writes."""

from __future__ import annotations

import csv
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analysis import studies
from analysis.studies import _rig_1, _runs
from analysis.studies.study import BALANCE, REFERENCE, THESIS, StudyResult, at_least, at_most, near
from linkwork.errors import InputError
from tests import published


@cache
def result(number: str) -> StudyResult:
    return studies.load(number).compute()


def computed(number: str, statement: str, source: str = REFERENCE) -> float:
    """The computed value beside a statement."""
    (verdict,) = (v for v in result(number).verdicts if v.statement == statement and v.source == source)
    return verdict.computed


#: The cases of Rahman's figures R5 to R15, R16 to R26 and R27 to R37; with all of the last but the planar one.
OFFSETS = tuple(f"a4 = {a4} in" for a4 in (10, 20, 30))
SHIFTS = tuple(f"S1 = {s1} in" for s1 in (3, 6, 9))
TWISTS = tuple(f"alpha4 = {twist} deg" for twist in (232, 310))
SPATIAL = ((0, OFFSETS), (11, SHIFTS), (22, TWISTS))

#: What Rahman states and the right physics does not bear out.
RAHMAN_REFUTED = {
    *(("R5", f"stroke relative to the ideal one's; {case}") for case in OFFSETS),
    *(("R16", f"stroke relative to the ideal one's; {case}") for case in SHIFTS),
    ("R27", "stroke relative to the ideal one's; alpha4 = 270 deg"),
    ("R16", "greatest S1 to which the iteration converges, beside the least to which the crank turns fully"),
    ("R27", "range of alpha4 in which the iteration converges, beside that in which the crank turns fully"),
    *((f"R{8 + n}", f"greatest magnitude of 1F1k; {case}") for n, cases in SPATIAL for case in cases),
    *((f"R{13 + n}", f"greatest magnitude of 2F2k; {case}") for n, cases in SPATIAL for case in cases),
    *((f"R{9 + n}", f"greatest magnitude of 1T1i - (-1F1j S1); {case}") for n, cases in SPATIAL for case in cases),
    *((f"R{10 + n}", f"greatest magnitude of 1T1j - (1F1i S1); {case}") for n, cases in SPATIAL for case in cases),
    # of the joint forces 4F4i, 3F3j and 3F3k do grow
    *(
        (number, f"greatest magnitude of {symbol}, least gain from one a4 to the next; torque given")
        for number, symbol in (
            ("R6", "1F1i"),
            ("R7", "1F1j"),
            ("R8", "1F1k"),
            ("R11", "2F2i"),
            ("R13", "2F2k"),
            ("R14", "3F3i"),
            ("R15", "4F4j"),
            ("R15", "4F4k"),
        )
    ),
}
#: What the theses state and the right physics does not bear out.
REFUTED = {
    ("3.2", "third turn's drift relative to the first's; mu = 1e4 dyn.s/cm"),
    ("3.2", "third turn's drift relative to the first's; mu = 5e4 dyn.s/cm"),
    ("3.2", "third turn's drift relative to the first's; mu = 1e5 dyn.s/cm"),
    ("3.10", "exponent of T0 in the time to 1 rad"),
    *(("4.3", f"resonance; I4 = {ratio}") for ratio in ("0.5", "1", "1.5")),
    *(("4.6", f"shift by the crank; I4 = {ratio}") for ratio in ("0.5", "1", "1.5")),
    *(
        ("5.1", f"{side} boundary in lambda_k^2; I4 = {ratio}")
        for side in ("lower", "upper")
        for ratio in ("0.5", "1", "1.5")
    ),
    ("5.2", "damping that removes the region up to I4 = 1.5"),
    ("5.2", "the same, by the thesis's own equation"),
    *((number, "error of the printed linkage") for number in ("6.4", "6.5", "6.6", "6.7", "6.8", "6.9")),
    ("6.7", "error of the printed linkage; N = 48"),
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
    *RAHMAN_REFUTED,
}


def test_there_is_a_study_of_every_figure() -> None:
    chapters = {3: range(2, 15), 4: range(3, 8), 5: range(1, 5), 6: range(4, 12), 7: range(2, 13), 8: range(7, 22)}
    asked = [f"{chapter}.{n}" for chapter, numbers in chapters.items() for n in numbers] + ["linkage"]
    assert list(studies.YOUSSEF) == asked
    assert list(studies.RAHMAN) == [f"R{n}" for n in range(5, 39)]
    assert list(studies.STUDIES) == [*studies.YOUSSEF, *studies.RAHMAN]
    for number in studies.STUDIES:
        assert studies.load(number).number == number


@pytest.mark.parametrize("number", ["3.1", "R4", "R39", "5", ""])
def test_a_figure_there_is_not(number: str) -> None:
    with pytest.raises(InputError, match=f"'{number}'"):
        studies.load(number)


#: Studies whose results take more than a second or two.
LONG = {
    "3.2", "4.4", "4.5", "4.7", "5.1", "5.2", "5.3", "5.4", "6.7", "6.8", "6.9", "6.10", "7.6", "7.7", "7.8", "7.9", "7.10",
    "7.11", "7.12", "8.15", "8.17", "8.18", "8.19", "8.20", "8.21",
}  # fmt: skip
every_study = pytest.mark.parametrize(
    "number", [pytest.param(n, marks=pytest.mark.slow) if n in LONG else n for n in studies.STUDIES]
)


@every_study
def test_verdicts(number: str) -> None:
    failed = {(number, v.statement) for v in result(number).verdicts if not v.holds}
    assert failed == {entry for entry in REFUTED if entry[0] == number}
    assert all(v.source == THESIS for v in result(number).verdicts if not v.holds)
    assert all(v.source in (THESIS, REFERENCE, BALANCE) for v in result(number).verdicts)
    assert all(np.isfinite(v.computed) for v in result(number).verdicts)


@every_study
def test_plot_and_data(number: str) -> None:
    study = studies.load(number)
    found = result(number)
    figure = study.draw(found)
    titles = (figure.get_suptitle(), figure.axes[0].get_title())
    assert found.heading.split() in [title.split() for title in titles], "but for the breaks of its lines"
    assert (found.heading == f"Fig {number}  {studies.STUDIES[number]}") == (number != "linkage")
    for axis in figure.axes if number != "linkage" else ():
        assert axis.get_xlabel()
        assert axis.get_ylabel()
        assert axis.lines
    assert len({len(column) for column in found.columns.values()}) == 1
    for name in found.columns:
        assert name.endswith("]"), f"{name} has no unit"
        assert "," not in name
    assert found.claim
    if number not in ("3.2", "3.3", "3.4", "3.5"):
        assert found.assignment
        assert "our" in sys.modules[studies.module_name(number)].__doc__


def test_written_files(tmp_path: Path) -> None:
    found, paths = studies.make("3.5", tmp_path / "out")
    assert paths == (tmp_path / "out" / "fig_3_5.png", tmp_path / "out" / "fig_3_5.csv")
    assert (tmp_path / "out" / "fig_3_5.png").stat().st_size > 10_000
    with (tmp_path / "out" / "fig_3_5.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == list(found.columns)
    np.testing.assert_array_equal(np.array(rows[1:], float), np.column_stack(list(found.columns.values())))


@pytest.mark.slow
def test_the_linkage_is_animated(tmp_path: Path) -> None:
    _, paths = studies.make("linkage", tmp_path)
    assert [path.name for path in paths] == ["linkage.png", "linkage.csv", "linkage.gif"]
    with Image.open(paths[2]) as image:
        assert image.n_frames == 72


def test_a_verdict_says_what_it_found() -> None:
    worse = near("length", THESIS, 2.0, 2.5, 0.1, "m")
    assert str(worse) == "length: 2 m (thesis), computed 2.5 m: DOES NOT HOLD"
    assert str(at_least("length", BALANCE, 2.0, 2.5)) == "length: at least 2 (check), computed 2.5: holds"
    assert not at_most("length", BALANCE, 2.0, 2.5).holds


def test_a_study_runs_as_a_module(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "analysis.studies.fig_3_4", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "holds" in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fig_3_4.csv", "fig_3_4.png"]


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


class TestRig1:
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
        turn = _runs.SteadyTurn(
            np.degrees(angle), 0.3 + 2.0 * np.cos(angle + 0.4) + 0.7 * np.sin(2.0 * angle), angle, 0.0
        )
        assert turn.harmonic(1) == pytest.approx(2.0, rel=1e-12)
        assert turn.harmonic(2) == pytest.approx(0.7, rel=1e-12)
        assert turn.harmonic(3) == pytest.approx(0.0, abs=1e-12)


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
