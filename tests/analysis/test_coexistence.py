"""Coexisting motions over a plane, and which of them a start ends in."""

import signal
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from analysis import Inputs, Trajectory, periodic, simulate
from analysis.figures import plot
from analysis.linkages import linkage
from analysis.numerics.continuation import ContinuationError
from analysis.periodic import Basins, Drive, basins, coexistence, find_orbits, frequency_response, plane, with_isolas
from analysis.periodic.chart import chart as charts
from analysis.periodic.chart import kernels
from analysis.periodic.chart.boundary import line_branches
from analysis.periodic.chart.grid import grid_points
from analysis.periodic.chart.kernels import Motions, Points
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import InputError, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.published import SETS

#: The module, whose name in the package is that of its function.
coexistences = import_module("analysis.periodic.chart.coexistence")
RIG_1_B = SETS["rig-1-spring-b"].parameters
SPEED = 1000.0 * RAD_S_PER_RPM
OPERATION = plane(RIG_1_B, Drive(speed=SPEED), "drive.speed", "slider.damping")


def run_from(rig: FiveBarParameters, speed: float, start: Sequence[float], turns: Any) -> Trajectory:
    """Run from a position and a velocity of the slider; samples at numbers of turns."""
    initial = InitialState(slider_position=float(start[0]), slider_velocity=float(start[1]))
    times = 2.0 * np.pi / speed * np.array(turns)
    return simulate(rig, Inputs(speed=speed), initial=initial, stop_time=times[-1], samples=times)


@pytest.fixture(scope="module")
def picture() -> Basins:
    return basins(RIG_1_B, Drive(speed=SPEED), points=9, position=(-0.06, 0.06), rate=(-6.0, 6.0))


def test_texts_with_units_are_the_numbers(picture: Basins) -> None:
    texts: Any = {"position": ("-6 cm", "6 cm"), "rate": ("-6 m/s", 6.0)}
    same = basins(RIG_1_B, Drive(speed=SPEED), points=9, **texts)
    np.testing.assert_array_equal(same.position, picture.position)
    np.testing.assert_array_equal(same.ends, picture.ends)
    found = coexistence(OPERATION, ["1000 rpm"], "11 N.s/m")
    assert (found.x, found.y) == (pytest.approx([SPEED]), pytest.approx([11.0]))
    with pytest.raises(ParameterError, match=r"drive\.speed is '300 mm'"):
        coexistence(OPERATION, ["300 mm"], [11.0])
    with pytest.raises(InputError, match=r"the axis x of a grid is \['300 rpm'\]"):
        coexistence(lambda x, y: OPERATION(x, y), ["300 rpm"], [11.0])


def test_every_point_has_the_motions_that_are_found_there_alone() -> None:
    rpm = np.array([900.0, 1000.0, 1100.0])
    found = coexistence(OPERATION, rpm * RAD_S_PER_RPM, [11.0])
    for column, speed in enumerate(rpm * RAD_S_PER_RPM):
        alone = find_orbits(replace(RIG_1_B, slider_damping=11.0), speed=float(speed))
        assert found.count[0, column] == len(alone)
        assert found.stable[0, column] == len(alone.stable)
        assert found.amplitude[0, column].compressed() == pytest.approx([o.amplitude for o in alone.orbits], rel=1e-4)
        assert found.largest[0, column].compressed() == pytest.approx([o.largest for o in alone.orbits], rel=1e-6)
    assert found.stable.tolist() == [[1, 2, 1]]
    assert found.least[0, 1] < 0.03 < 0.1 < found.greatest[0, 1]


def test_a_start_ends_where_a_long_run_does(picture: Basins) -> None:
    """By the solver of runs, 300 turns from starts of each kind, but for those at the limit of assembly."""
    for end in (0, 1):
        row, column = np.argwhere(picture.ends == end)[3]
        run = run_from(RIG_1_B, SPEED, (picture.position[column], picture.rate[row]), [0.0, 300.0])
        last = run["slider.position"][-1], run["slider.velocity"][-1]
        assert last == pytest.approx(picture.motions[end].start.tolist(), abs=1e-3)


def test_what_is_written_and_drawn(picture: Basins, tmp_path: Path) -> None:
    rows = np.loadtxt(picture.to_csv(tmp_path / "basins.csv"), delimiter=",", skiprows=1)
    assert rows.shape == (81, 3)
    assert set(rows[:, 2]) <= {-1.0, 0.0, 1.0, 2.0}
    axis = plot(picture, title="basins").axes[0]
    assert axis.get_xlabel() == "slider position at crank angle 0 [mm]"
    assert [text.get_text() for text in axis.get_legend().get_texts()][:2] == ["stable motion", "unstable motion"]
    assert plot(picture.found).axes


def motions(folder: Path, damping: float = 11.0) -> periodic.Coexistence:
    return coexistence(OPERATION, [SPEED], [damping, 12.0, 13.0], folder=folder)


def ends(folder: Path, damping: float = 11.0) -> Basins:
    rig = replace(RIG_1_B, slider_damping=damping)
    return basins(rig, Drive(speed=SPEED), points=3, position=(-0.02, 0.02), rate=(-1.0, 1.0), folder=folder)


@pytest.mark.slow
@pytest.mark.parametrize(("of", "work", "others"), [(motions, "_compute_motions", 1), (ends, "_ends", 3)])
def test_rows_are_kept_and_an_interrupted_picture_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, of: Callable[..., Any], work: str, others: int
) -> None:
    compute = getattr(coexistences, work)
    calls = []

    def interrupted(*arguments: Any) -> Any:
        calls.append(arguments)
        if len(calls) == 2:
            signal.raise_signal(signal.SIGINT)
        return compute(*arguments)

    monkeypatch.setattr(coexistences, work, interrupted)
    monkeypatch.setattr(coexistences, "_TOGETHER", 1)
    with pytest.raises(periodic.GridInterrupted, match=r"2 of 3 rows done, which are kept in .*: call again to go on"):
        of(tmp_path)
    monkeypatch.setattr(coexistences, work, compute)
    last = of(tmp_path)
    assert last.computed == 1
    # of another mechanism there are as many rows anew as it is in
    assert of(tmp_path, 11.5).computed == others
    (whole := tmp_path / "alone").mkdir()
    # rows that are computed together are those computed one by one, to the last bit
    monkeypatch.setattr(coexistences, "_TOGETHER", 2)
    alone = of(whole)
    for name in ("largest", "starts", "ends"):
        np.testing.assert_array_equal(*(np.ma.filled(getattr(found, name, 0), np.nan) for found in (last, alone)))


def test_a_motion_missing_at_a_point_is_sought_from_those_beside_it(tmp_path, monkeypatch) -> None:
    compute = coexistences._compute_motions

    def losing(*arguments: Any) -> Any:
        made = compute(*arguments)
        made[0, 1, 1] = np.nan  # the unstable motion of the middle point
        made[0, 1, 1:] = made[0, 1, [*range(2, made.shape[2]), 1]]
        return made

    monkeypatch.setattr(coexistences, "_compute_motions", losing)
    monkeypatch.setattr(coexistences, "_TOGETHER", 1)
    found = coexistence(OPERATION, [0.99 * SPEED, SPEED, 1.01 * SPEED], [11.0], folder=tmp_path)
    assert found.count.tolist() == [[3, 3, 3]]
    assert found.index.tolist() == [[1, 1, 1]]
    alone = find_orbits(replace(RIG_1_B, slider_damping=11.0), speed=SPEED)
    assert found.amplitude[0, 1].compressed() == pytest.approx([o.amplitude for o in alone.orbits], rel=1e-4)
    assert found.largest[0, 1].compressed() == pytest.approx([o.largest for o in alone.orbits], rel=1e-4)


def test_no_stable_motion_is_a_sentence() -> None:
    doubled = replace(SETS["rig-2-spring-c"].parameters, slider_damping=0.5)
    with pytest.raises(InputError, match="no stable motion"):
        basins(doubled, Drive(speed=1170.0 * RAD_S_PER_RPM), points=2)
    with pytest.raises(InputError, match=r"range of the rate is 1.* to 0"):
        basins(RIG_1_B, Drive(speed=SPEED), points=2, rate=(1.0, 0.0))
    with pytest.raises(InputError, match="axis x"):
        coexistence(OPERATION, [], [1.0])


LIGHT = replace(RIG_1_B, slider_damping=2.0)
SUBHARMONIC = 1380.0 * RAD_S_PER_RPM


def test_a_start_ends_in_a_motion_of_four_turns() -> None:
    """By the solver of runs it repeats itself after four turns, and after no fewer."""
    (simple,), (large,) = (find_orbits(LIGHT, speed=SUBHARMONIC, turns=turns).stable for turns in (1, 4))
    beside = [(float(value) - d, float(value) + d) for value, d in zip(large.start, (1e-4, 1e-2))]
    near = basins(LIGHT, Drive(speed=SUBHARMONIC), turns=4, points=2, position=beside[0], rate=beside[1])
    assert [orbit.turns for orbit in near.motions] == [1, 4]
    assert near.motions[0].start == pytest.approx(simple.start, rel=1e-8)
    assert (near.ends == 1).all()
    run = run_from(LIGHT, SUBHARMONIC, (beside[0][0], beside[1][0]), [0, *range(200, 205)])
    last = run["slider.position"][1:]
    assert last[4] == pytest.approx(last[0], abs=1e-5)
    assert np.abs(last[1:4] - last[0]).min() > 1e-3


def test_speeds_to_avoid_know_a_motion_that_no_branch_leads_to_or_say_that_none_was_sought() -> None:
    """At 950 rpm a stable motion of 14.5 cm lies beside one of 1.28 cm, and no branch from an end of the range leads to it."""
    damped, rpm = replace(LIGHT, slider_damping=12.0), RAD_S_PER_RPM
    assert max(orbit.amplitude for orbit in find_orbits(damped, speed=950.0 * rpm).stable) > 0.14
    response = frequency_response(damped, 900.0 * rpm, 1200.0 * rpm, doublings=0)
    whole = with_isolas(response, places=2)
    for found, known in ((response, False), (whole, True)):
        assert known == any(a.low < 950.0 * rpm < a.high for a in found.speeds_to_avoid)
        assert known != ("not sought" in repr(found))
        assert known == (f"all motions sought at {whole.sought} values of drive.speed only" in repr(found))
    assert "not sought" in plot(response).axes[0].get_legend().get_title().get_text()


def test_an_isola_above_the_resonance_is_found_between_evenly_spaced_speeds() -> None:
    """At resonance the damper alone balances the shaking: 4 V - 46 (3/4) V^3 + 120 (5/8) V^5 = 0.3 N, with V = w times the
    amplitude, has three roots, of which two are on a curve 0.7 rad/s wide."""
    built = linkage("falling-damping", ground={"A": (0, 0), "Q": (0.3, 0)})
    built.body("crank", bar=("A", "B"), length=0.003, mass=0.1, inertia=1e-5)
    built.body("yoke", points={"Y": (0, 0)}, mass=0.2)
    built.body("block", points={"K": (0, 0)}, mass=1.0)
    built.slide("G", body="yoke", on="ground", through="A").slide("H", body="block", on="ground", through="Q")
    built.slot("S", pin="B", on="yoke", through="Y", direction="90 deg")
    built.spring("shaking", between=("Y", "K"), stiffness=100.0, free=0.3)
    built.spring("home", at="H", stiffness=900.0, damping=4.0, law="120*v**5 - 46*v**3")
    built.freedom("crank", "A", speed=31.4).freedom("block", "H").mechanism()
    whole = with_isolas(frequency_response("falling-damping", 25.0, 40.0, greatest_step=2e-2), greatest_step=2e-2)
    (isola,) = (branch for branch in whole.branches if branch.closed)
    small, _, large = sorted(root.real for root in np.roots([75.0, 0.0, -34.5, 0.0, 4.0, -0.3]) if not root.imag)
    assert sorted(np.sqrt(1000.0) * top.amplitude for top in whole.maxima()) == pytest.approx([small, large], rel=5e-3)
    # by shooting with a Runge-Kutta method of order 4
    assert [isola.parameter.min(), isola.parameter.max()] == pytest.approx([31.2743, 31.9472], abs=2e-3)


@pytest.mark.slow
def test_motions_of_four_turns_are_met_in_a_range_far_wider_than_that_in_which_they_are_stable() -> None:
    """The range is 12 rpm; the branch is begun from an unstable motion some 80 rpm below it."""
    low, high = 1200.0 * RAD_S_PER_RPM, 1400.0 * RAD_S_PER_RPM
    response = frequency_response(LIGHT, low, high, doublings=0, greatest_step=2e-2)
    whole = with_isolas(response, places=1, turns=4, greatest_step=2e-2)
    (branch,) = (branch for branch in whole.branches if branch.turns == 4)
    stable = branch.parameter[[word is periodic.Stability.STABLE for word in branch.stability()]]
    assert [special.kind for special in branch.special] == [periodic.Crossing.FOLD, periodic.Crossing.PERIOD_DOUBLING]
    fold, doubling = (special.parameter for special in branch.special)
    assert doubling < stable.min() < SUBHARMONIC < stable.max() < fold < doubling + 13.0 * RAD_S_PER_RPM
    # beyond the fold there is none, within it there is
    words = [len(find_orbits(LIGHT, speed=fold * (1.0 + away), turns=4)) for away in (-1e-4, 1e-4)]
    assert words == [2, 0]
    with pytest.raises(ParameterError, match="turns is 0"):
        with_isolas(response, turns=0)


@pytest.mark.slow
def test_a_doubled_branch_is_not_followed_again_from_a_motion_found_far_along_it() -> None:
    """At 1920 rpm the motion of four turns, which doubles its period at 1998.63 rpm, has a multiplier between 4 and 100."""
    low, high = 1700.0 * RAD_S_PER_RPM, 2140.0 * RAD_S_PER_RPM
    whole = with_isolas(frequency_response(LIGHT, low, high, doublings=2), places=1, turns=4)
    doublings = [special.parameter for branch in whole.branches if branch.turns == 4 for special in branch.special]
    assert [f"{value / RAD_S_PER_RPM:.1f}" for value in doublings].count("1998.6") == 1


def test_doublings_without_a_branch_are_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def find_none(*_: Any, **__: Any) -> None:
        raise ContinuationError("none")

    monkeypatch.setattr(import_module("analysis.periodic.response.frequency"), "switch", find_none)
    response = frequency_response(LIGHT, 1800.0 * RAD_S_PER_RPM, 2200.0 * RAD_S_PER_RPM, greatest_step=2e-2)
    (sentence,) = response.problems
    assert [place for place in ("1903.88 rpm", "2139.15 rpm") if place in sentence] == ["1903.88 rpm", "2139.15 rpm"]


@pytest.mark.slow
def test_an_isola_is_found_that_the_branch_from_the_ends_does_not_pass() -> None:
    """Rig 2 with spring C and 1 N.s/m: some 20 cm beside a motion of a few, at no speed connected with it."""
    rig = replace(SETS["rig-2-spring-c"].parameters, slider_damping=1.0)
    low, high = 470.0 * RAD_S_PER_RPM, 600.0 * RAD_S_PER_RPM
    operation = plane(rig, Drive(speed=low), "drive.speed", "slider.damping")
    branches, found, lost = line_branches(operation, (low, high), 1.0, name="drive.speed", unit="rad/s")
    assert lost == []
    (isola,) = (branch for branch in branches if branch.closed)
    through = next(branch for branch in branches if branch.parameter[0] == low and branch.parameter[-1] == high)
    assert through.special == ()
    # the motions of a line's ends are all on the branch that passes
    assert found.count[0, [0, -1]].tolist() == [1, 1]
    folds = sorted(special.parameter for special in isola.special if special.kind is periodic.Crossing.FOLD)
    assert len(folds) == 2
    assert low < folds[0] < folds[1] < high
    # what is stable on it stays there in a run by the solver of runs; from rest the mechanism settles on the other branch
    stable = next(o for o in isola.orbits if o.verdict().stability is periodic.Stability.STABLE and o.amplitude > 0.1)
    swings = []
    for start in (stable.start, (0.0, 0.0)):
        run = run_from(rig, stable.drive.speed, start, [0.0, *np.linspace(300.0, 301.0, 200)])
        swings.append(0.5 * np.ptp(run["slider.position"][1:]))
    assert swings[0] == pytest.approx(stable.amplitude, rel=1e-3)
    assert swings[1] < 0.5 * swings[0]


def test_a_part_with_stable_motions_that_no_line_meets_gets_a_line() -> None:
    """Two motions in the cells (3..4, 3..5) of a plane of 8 x 8 points, one elsewhere."""
    axis = np.arange(8.0)
    largest = np.full((8, 8, 2), 0.5)
    largest[..., 1] = np.nan
    largest[3:5, 3:6, 1] = 0.9
    masked = np.ma.masked_invalid(largest)
    beside = periodic.Coexistence(
        x=axis,
        y=axis,
        largest=masked,
        amplitude=masked,
        starts=np.zeros((8, 8, 2, 2)),
        index=np.ones((8, 8), dtype=int),
        index_of_all=1,
        swing=("slider.position", "m"),
        computed=0,
    )
    assert charts.unmet_lines(beside, [0.0, 7.0], []) == [3.0]
    assert charts.unmet_lines(beside, [0.0, 3.5, 7.0], []) == []
    around, away = np.array([[2.5, 3.5], [5.5, 3.5]]), np.array([[0.5, 6.5], [0.5, 0.5]])
    assert charts.unmet_lines(beside, [0.0, 7.0], [around]) == []
    assert charts.unmet_lines(beside, [0.0, 7.0], [away]) == [3.0]


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few lines and samples of a chart."""
    monkeypatch.setattr(charts, "LINES", (2, 2))
    monkeypatch.setattr(charts, "SAMPLES", 6)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_a_chart_with_the_motions_beside(tmp_path: Path) -> None:
    chart = periodic.stability_chart(
        "rig-1-spring-b", ranges=(("990 rpm", "1010 rpm"), ("10 N.s/m", "12 N.s/m")), points=3, coexisting=True
    )
    assert (chart.beside.stable == 2).all()
    assert [axis.get_ylabel() for axis in plot(chart).axes][:3] == ["slider damping [N.s/m]"] * 3
    assert len(np.loadtxt(chart.beside.to_csv(tmp_path / "motions.csv"), delimiter=",", skiprows=1)) == 9


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_a_chart_finds_the_motions_that_newtons_method_misses() -> None:
    """At small damping near resonance: 37 of 900 such points had no motion, one of them stable with 13.8 cm."""
    chart = periodic.stability_chart(
        "rig-1-spring-b", ranges=(("1060 rpm", "1090 rpm"), ("2 N.s/m", "3 N.s/m")), points=4
    )
    assert chart.grid.largest.count() == 16
    orbit = periodic.newton_orbit(replace(RIG_1_B, slider_damping=2.0), Drive(speed="1070 rpm"))
    assert chart.grid.largest[0, 1] == pytest.approx(orbit.largest, rel=1e-8)


@pytest.mark.slow
def test_the_command(linkwork: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    search = import_module("analysis.periodic.motion.search")
    sought: list[int] = []
    ready = search.require_turns
    monkeypatch.setattr(search, "require_turns", lambda turns, *at: (sought.append(turns), ready(turns, *at)))
    done = linkwork("basins --published rig-1-spring-b --speed '1000 rpm' --points 4 --html --out .")
    assert sought == [1, 2, 3, 4]
    assert "two methods found the same motions" in done.output
    assert "of 16 starts end" in done.output
    written = sorted(path.name for path in tmp_path.glob("rig*"))
    assert written == [f"rig-1-spring-b-basins.{kind}" for kind in ("csv", "html", "png")]
    assert "ends in motion 1" in (tmp_path / "rig-1-spring-b-basins.html").read_text(encoding="utf-8")


def test_a_row_of_a_chart_ends_with_its_last_point() -> None:
    """A mechanism after the last one, here in memory beyond the arrays, is not searched: its spring would take hours."""
    operation = plane(RIG_1_B, Drive(speed=SPEED), "drive.speed", "slider.stiffness")
    _, _, (row,), guesses = grid_points(operation, [SPEED, SPEED], [RIG_1_B.slider_stiffness], None, 16)
    _, _, (stiff,), _ = grid_points(operation, [SPEED, SPEED], [1e13], None, 16)
    within = Points(*(np.vstack(each)[:2] for each in zip(row.points(), stiff.points())))
    section = row.first.section(guesses[0], *coexistences._SEARCHED)
    found = Motions(np.empty((2, 8, 2)), np.empty((2, 8, 4)), np.empty((2, 8, 1)), np.zeros(2, dtype=np.int64))
    began = process_time()
    kernels.solve_all(section, within, row.search(), 2, np.zeros(1), guesses, found)
    assert found.counts.tolist() == [3, 3]
    assert process_time() - began < 10.0
