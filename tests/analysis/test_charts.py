"""A stability chart as a whole: what it finds, tells, writes, and does where something is missing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis import InductionMotor, figures, periodic
from analysis.periodic import Crossing, Drive, Stability, StabilityChart, default_range, find_orbit, stability_chart
from analysis.periodic.chart import chart as charts
from analysis.periodic.chart import grid as grids
from analysis.periodic.chart.grid import Grid, grid_rows
from analysis.periodic.motion.discretisation import operating_point
from analysis.periodic.motion.orbit import first_guess
from analysis.periodic.motion.variables import parameter_value
from analysis.run import progress_listener
from analysis.units import RAD_S_PER_RPM
from analysis.youssef import linear_motion
from linkwork.errors import InputError, LinkworkError, ParameterError, UnknownNameError
from linkwork.five_bar.published import SETS, TABLE_3_1

RPM = RAD_S_PER_RPM
DRIVE = Drive(speed=60.0)
RIG_2 = SETS["rig-2-spring-c"].parameters
NAMES = ("drive.speed", "slider.damping")
SPEEDS, DAMPINGS = (1120.0 * RPM, 1220.0 * RPM), (0.0, 2.0)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> StabilityChart:
    """The first region of rig 2 with spring C."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(grids, "grid_folder", lambda: tmp_path_factory.mktemp("grids"))
        linear = linear_motion(RIG_2, DRIVE, NAMES)
        return stability_chart(RIG_2, DRIVE, ranges=(SPEEDS, DAMPINGS), points=41, beside=linear)


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few lines and samples: enough where only a sentence is asked for."""
    monkeypatch.setattr(charts, "LINES", (2, 2))
    monkeypatch.setattr(charts, "SAMPLES", 12)


@pytest.mark.slow
def test_region_is_traced_and_is_where_the_multipliers_are_great(found: StabilityChart) -> None:
    (region,) = [t for t in found.boundaries if t.motion == "true orbit"]
    assert region.kind is Crossing.PERIOD_DOUBLING
    # twice the natural frequency is inside it
    points = region.points
    assert points[:, 0].min() < 2.0 * periodic.natural_frequency(RIG_2) < points[:, 0].max()
    middle = 2.0 * periodic.natural_frequency(RIG_2)
    orbit = find_orbit(replace(RIG_2, slider_damping=0.1), speed=middle)
    assert orbit.verdict().stability is Stability.UNSTABLE
    # the grid agrees point by point
    for y, row in zip(found.grid.y, found.grid.largest):
        above = region.points[:, 1] > y
        cuts = [np.interp(y, *sorted_pair) for sorted_pair in pieces(region.points, above)]
        inside = np.zeros(len(row), dtype=bool)
        if len(cuts) == 2:
            inside = (found.grid.x > min(cuts)) & (found.grid.x < max(cuts))
        # but for the points within the straight pieces' distance from the boundary
        clear = np.abs(found.grid.x[:, None] - np.array(cuts or [np.inf])).min(axis=1) > 0.02 * RPM
        assert ((row > 1.0 + 1e-6) == inside)[clear].all()


def pieces(points: np.ndarray, above: np.ndarray) -> list[tuple[list[float], list[float]]]:
    """The pieces of a curve that cross a level, each as ((low y, high y), (its x's))."""
    found = []
    for i in np.flatnonzero(above[1:] != above[:-1]):
        (a, b) = sorted((points[i], points[i + 1]), key=lambda p: float(p[1]))
        found.append(([float(a[1]), float(b[1])], [float(a[0]), float(b[0])]))
    return found


@pytest.mark.slow
def test_removing_damping_is_the_top_of_the_region(found: StabilityChart) -> None:
    (doubling,) = found.removals
    (region,) = [t for t in found.boundaries if t.motion == "true orbit"]
    top = region.points[:, 1].max()
    value = float(doubling.partition("slider.damping = ")[2].split()[0])
    assert value == pytest.approx(top, abs=1e-3)
    for damping, word in ((0.99 * value, Stability.UNSTABLE), (1.01 * value, Stability.STABLE)):
        mechanism = replace(RIG_2, slider_damping=damping)
        worst = max(find_orbit(mechanism, speed=s).largest for s in np.linspace(1165.0, 1173.0, 41) * RPM)
        assert (worst > 1.0) == (word is Stability.UNSTABLE)


@pytest.mark.slow
def test_long_runs_confirm_three_points(found: StabilityChart) -> None:
    assert len(found.runs) == 3
    assert all(run.confirmation.agrees for run in found.runs)
    assert {run.confirmation.verdict.stability for run in found.runs} == {Stability.STABLE, Stability.UNSTABLE}
    margins = 1.0 - found.grid.largest
    rows = periodic.points_to_confirm(found.grid)
    assert float(margins[rows[0]]) == margins[4:-4, 4:-4].max()
    assert float(margins[rows[1]]) == margins[4:-4, 4:-4].min()


def test_long_runs_are_off_the_edges_unless_only_these_are_unstable() -> None:
    x = np.linspace(0.0, 1.0, 5)
    largest = np.ma.masked_array(0.5 + 0.1 * x[:, None] + 0.2 * x)
    starts, status = np.zeros((5, 5, 2)), np.zeros((5, 5), dtype=np.int64)
    found = Grid(x=x, y=x, largest=largest, starts=starts, status=status, computed=5)
    assert periodic.points_to_confirm(found)[:2] == [(1, 1), (3, 3)]
    assert all(0 < place < 4 for point in periodic.points_to_confirm(found) for place in point)
    largest[4, 4] = 1.5
    assert periodic.points_to_confirm(found)[1] == (4, 4)


@pytest.mark.slow
def test_files_and_plot(found: StabilityChart, tmp_path: Path) -> None:
    rows = np.loadtxt(found.to_csv(tmp_path / "chart.csv"), delimiter=",", skiprows=1)
    assert rows.shape == (41 * 41, 4)
    assert rows[:, 0].min() == pytest.approx(1120.0)
    traces = np.loadtxt(found.boundaries_to_csv(tmp_path / "boundaries.csv"), delimiter=",", skiprows=1)
    assert set(traces[:, 0]) == set(range(1, len(found.boundaries) + 1))
    figure = figures.plot(found, title="chart")
    assert figure.axes[0].get_xlabel() == "crank speed [rpm]"


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_crossings_of_other_motions_are_traced_under_their_own_name() -> None:
    rig = SETS["rig-1-spring-a"].parameters
    # the period doubling at 379 to 527 rpm belongs to a motion of some 8 cm, beside the small one that the grid has
    chart = stability_chart(rig, DRIVE, ranges=((460.0 * RPM, 530.0 * RPM), (5.0, 6.0)), points=5)
    doublings = [traced for traced in chart.boundaries if traced.kind is Crossing.PERIOD_DOUBLING]
    assert {traced.motion for traced in doublings} == {periodic.OTHER_ORBIT}
    assert (chart.grid.largest < 1.0).all()
    for traced in doublings:
        speed, damping = traced.points[len(traced.points) // 2]
        there = replace(rig, slider_damping=damping)
        orbit = periodic.newton_orbit(there, Drive(speed=speed), start=traced.starts[len(traced.points) // 2])
        assert np.abs(orbit.multipliers + 1.0).min() < 1e-6
        assert orbit.amplitude > 3.0 * find_orbit(there, speed=speed).amplitude


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_a_chart_under_a_torque_has_its_doublings_and_tori() -> None:
    # on the branch of one damper: torus at 0.1055 and 0.2644 N.m, period doubling at 0.3395 N.m
    drive = Drive(torque=0.2)
    orbit = find_orbit(TABLE_3_1, torque=0.2, start=(0.0, 0.0, 45.0))
    family = periodic.Family(parameters=TABLE_3_1, drive=drive, vary="drive.torque")
    branch = periodic.follow(family, orbit, 0.2, low=0.15, high=0.45)
    expected = {special.kind: special.parameter for special in branch.special}
    names, ranges = ("drive.torque", "slider.damping"), ((0.2, 0.45), (29.0, 31.0))
    chart = stability_chart(TABLE_3_1, drive, names, ranges, points=12, start=orbit.start)
    for kind in (Crossing.TORUS, Crossing.PERIOD_DOUBLING):
        (boundary,) = [traced for traced in chart.boundaries if traced.kind is kind]
        order = np.argsort(boundary.points[:, 1])
        torque = np.interp(30.0, boundary.points[order, 1], boundary.points[order, 0])
        assert torque == pytest.approx(expected[kind], rel=1e-3)
    # unstable beyond the doubling, by the grid too
    row = int(np.abs(chart.grid.y - 30.0).argmin())
    unstable = chart.grid.largest[row] > 1.0
    assert unstable[chart.grid.x > expected[Crossing.PERIOD_DOUBLING] + 0.03].all()
    low, high = expected[Crossing.TORUS] + 0.02, expected[Crossing.PERIOD_DOUBLING] - 0.02
    assert not unstable[(chart.grid.x > low) & (chart.grid.x < high)].any()


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_a_chart_of_mechanisms_that_cannot_turn_says_so_and_keeps_the_rest(tmp_path: Path) -> None:
    speed = SETS["table-3.1"].crank_speed
    names, ranges = ("crank.length", "rocker.length"), ((0.05, 0.5), (0.14, 0.16))
    chart = stability_chart(TABLE_3_1, Drive(speed=speed), names, ranges, points=2)
    # a crank longer than coupler and rocker together cannot turn wherever the slider is
    missing = np.ma.getmaskarray(chart.grid.largest)
    x, y = np.meshgrid(chart.grid.x, chart.grid.y)
    assert np.array_equal(missing, x > TABLE_3_1.coupler_length + y)
    assert missing.tolist() == [[False, True], [False, True]]
    for i in (0, 1):
        there = replace(TABLE_3_1, crank_length=chart.grid.x[0], rocker_length=chart.grid.y[i])
        assert chart.grid.largest[i, 0] == pytest.approx(find_orbit(there, speed=speed).largest, rel=1e-6)
    points, lines, *_ = chart.problems
    assert points.startswith(
        "a motion is not found at 2 of 4 points (grey), the first at crank.length = 0.5 m, rocker.length = 0.14 m: the links "
        "come to the limit of assembly"
    )
    assert lines.startswith("true orbit, period doubling: no value at ")
    # what is confirmed is where there is a motion
    assert [run.confirmation.agrees for run in chart.runs] == [True, True]
    assert all(run.x == 0.05 for run in chart.runs)
    # lengths are in mm in the picture and the text, in m in the file
    axis = figures.plot(chart).axes[0]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("crank length [mm]", "rocker length [mm]")
    assert axis.get_xlim() == pytest.approx((50.0, 500.0))
    assert "crank.length 50 to 500 mm" in repr(chart)
    head, first = chart.to_csv(tmp_path / "chart.csv").read_text(encoding="utf-8").splitlines()[:2]
    assert head.startswith("crank.length [m],rocker.length [m]")
    assert [float(value) for value in first.split(",")[:2]] == pytest.approx([0.05, 0.14])


def test_default_ranges() -> None:
    natural = periodic.natural_frequency(RIG_2)
    assert default_range(RIG_2, DRIVE, "drive.speed") == pytest.approx((0.3 * natural, 2.5 * natural))
    assert default_range(RIG_2, DRIVE, "slider.damping") == pytest.approx((0.55, 11.0))
    with pytest.raises(InputError, match=r"slider\.coulomb_friction is 0"):
        default_range(RIG_2, DRIVE, "slider.coulomb_friction")
    with pytest.raises(UnknownNameError, match=r"there is no slider\.mess"):
        default_range(RIG_2, DRIVE, "slider.mess")


@pytest.mark.parametrize(
    ("y", "across", "along"),
    [
        ("drive.speed", (1.0, 2.0), (1.0, 2.0)),
        ("slider.mess", (1.0, 2.0), (1.0, 2.0)),
        ("slider.damping", (2.0, 1.0), (1.0, 2.0)),
        ("slider.damping", (1.0, 2.0), (-1.0, 2.0)),
    ],
)
def test_bad_charts_are_refused(y: str, across: tuple[float, float], along: tuple[float, float]) -> None:
    with pytest.raises(LinkworkError):
        stability_chart(RIG_2, DRIVE, ("drive.speed", y), (across, along), points=3)


@pytest.mark.slow
def test_the_grid_is_shown_before_its_boundaries() -> None:
    seen: list[StabilityChart] = []
    ranges = ((550.0 * RPM, 560.0 * RPM), (50.0, 60.0))
    chart = stability_chart("rig-2-spring-c", ranges=ranges, points=3, first=seen.append)
    (early,) = seen
    assert early.grid is chart.grid
    assert not early.boundaries
    assert not early.runs
    assert chart.runs


@pytest.mark.usefixtures("coarse")
def test_progress_advances_within_a_line() -> None:
    heard: list[tuple[str, float]] = []
    with progress_listener(lambda what, share: heard.append((what, share))):
        stability_chart("rig-2-spring-c", ranges=((550.0 * RPM, 560.0 * RPM), (50.0, 60.0)), points=3)
    shares = [share for what, share in heard if "branches" in what]
    assert shares == sorted(shares)
    assert len(set(shares)) > 10
    assert shares[-1] == 1.0


MOTOR = Drive(motor=InductionMotor(breakdown_torque=0.06, breakdown_slip=0.3, synchronous_speed=60.0))


@pytest.mark.parametrize(
    ("drive", "x", "y", "across"),
    [
        (DRIVE, "drive.speed", "slider.damping", (40.0, 90.0)),
        (DRIVE, "slider.damping", "drive.speed", (0.5, 3.0)),
        (DRIVE, "slider.force", "slider.mass", (-2.0, 1.0)),
        (DRIVE, "coupler.length", "slider.force", (0.2, 0.21)),
        (DRIVE, "slider.coulomb_friction", "drive.speed", (0.0, 0.2)),
        (MOTOR, "drive.torque.synchronous_speed", "slider.damping", (50.0, 70.0)),
    ],
)
def test_a_row_of_named_parameters_has_the_numbers_of_its_points(drive, x, y, across) -> None:
    operation = periodic.plane(RIG_2, drive, x, y)
    xs, ys = np.linspace(*across, 5), np.array([parameter_value(RIG_2, drive, y) or 1.0])
    start = first_guess(operating_point(RIG_2, drive).flow, drive, None)
    (at_once,) = grid_rows(operation, xs, ys, start)
    (alone,) = grid_rows(lambda a, b: operation(a, b), xs, ys, start)
    for name in ("constants", "vectors", "scales"):
        assert (getattr(at_once, name) == getattr(alone, name)).all(), name
    assert (at_once.smooth, at_once.switched) == (alone.smooth, alone.switched)


def test_a_row_of_named_parameters_refuses_what_its_points_refuse() -> None:
    for names, x, y, said in (
        (("drive.speed", "slider.damping"), [10.0, -1.0], 1.0, "speed"),
        (("slider.mass", "drive.speed"), [1.0, -0.1], 50.0, r"mass.*-0\.1"),
    ):
        with pytest.raises((InputError, ParameterError), match=said):
            grid_rows(periodic.plane(RIG_2, DRIVE, *names), np.array(x), np.array([y]), np.zeros(2))
