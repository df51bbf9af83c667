"""Branches of periodic motions: special points against what defines them, switching, and how a branch ends."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from numpy.typing import NDArray

from analysis import figures, periodic
from analysis.numerics.continuation import ContinuationError, Follower
from analysis.periodic import Branch, Crossing, Drive, Family, Stability, find_orbit, follow, switch
from analysis.periodic.response.branch import _repeats_early, _turn_columns
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SETS, TABLE_3_1

SPEED = SETS["table-3.1"].crank_speed
RPM = RAD_S_PER_RPM
RIG_1_B = SETS["rig-1-spring-b"].parameters


@pytest.fixture(scope="module")
def softened() -> Branch:
    """Table 3.1 with the spring varied: the branch turns back at a fold."""
    orbit = find_orbit(TABLE_3_1, speed=SPEED)
    family = Family(parameters=TABLE_3_1, drive=orbit.drive, vary="slider.stiffness")
    return follow(family, orbit, 1000.0, low=100.0, high=1200.0, direction=-1)


@pytest.fixture(scope="module")
def upper() -> Branch:
    """Rig 1 with spring B from above: the large motion, which doubles its period."""
    orbit = find_orbit(RIG_1_B, speed=1200.0 * RPM)
    family = Family(parameters=RIG_1_B, drive=orbit.drive)
    return follow(family, orbit, 1200.0 * RPM, low=850.0 * RPM, high=1300.0 * RPM, direction=-1)


def test_every_point_is_a_periodic_orbit(softened: Branch) -> None:
    for value, orbit in list(zip(softened.parameter, softened.orbits))[::10]:
        again = find_orbit(replace(TABLE_3_1, slider_stiffness=value), speed=SPEED, start=orbit.start, settle=False)
        assert again.start == pytest.approx(orbit.start, abs=1e-9)
        assert again.largest == pytest.approx(orbit.largest, rel=1e-6)


def test_a_branch_is_shown_in_a_line(softened: Branch) -> None:
    assert repr(softened).startswith(f"<Branch: {softened.family.vary} ")
    assert "fold" in repr(softened)


def test_fold_has_a_multiplier_of_one_and_no_orbit_beyond(softened: Branch) -> None:
    assert softened.reached
    (fold,) = softened.special
    assert fold.kind is Crossing.FOLD
    assert fold.orbit.multipliers[0].real == pytest.approx(1.0, abs=1e-6)
    assert fold.parameter == pytest.approx(softened.parameter.min(), rel=1e-3)
    beyond = replace(TABLE_3_1, slider_stiffness=0.999 * fold.parameter)
    with pytest.raises(periodic.OrbitError):
        find_orbit(beyond, speed=SPEED, start=fold.orbit.start, settle=False)
    # stable before it, unstable after it
    words = softened.stability()
    assert set(words[: fold.after]) == {Stability.STABLE}
    assert set(words[fold.after + 2 :]) == {Stability.UNSTABLE}


def test_a_branch_is_kept_without_a_special_point_that_cannot_be_located(softened, monkeypatch) -> None:
    def lose(*_: object) -> None:
        raise ContinuationError("no point there")

    monkeypatch.setattr(Follower, "locate", lose)
    orbit = softened.orbits[softened.special[0].after - 1]
    value = float(softened.parameter[softened.special[0].after - 1])
    branch = follow(softened.family, orbit, value, low=220.0, high=240.0, direction=-1)
    assert len(branch) > 5
    assert branch.special == ()
    (problem,) = [one for one in branch.problems if one.startswith("the fold between slider.stiffness = 23")]
    assert problem.endswith("is not located: no point there")


def test_the_unstable_motion_with_a_multiplier_of_1_154(softened: Branch) -> None:
    """It is that of k = 2.340e5 dyn/cm, on the far side of the fold at 2.322e5, below which this branch has no motion."""
    past = slice(softened.special[0].after + 1, None)
    multipliers = softened.largest_multiplier[past]
    assert (np.diff(multipliers) > 0.0).all()
    stiffness = np.interp(1.154, multipliers, softened.parameter[past])
    assert stiffness == pytest.approx(234.0, abs=0.2)
    assert softened.parameter.min() > 232.0


def test_fold_does_not_depend_on_the_steps(softened: Branch) -> None:
    orbit = find_orbit(TABLE_3_1, speed=SPEED)
    fine = follow(softened.family, orbit, 1000.0, low=200.0, high=1000.0, direction=-1, greatest=3e-3)
    assert fine.special[0].parameter == pytest.approx(softened.special[0].parameter, rel=1e-9)


def test_doubling_has_a_multiplier_of_minus_one(upper: Branch) -> None:
    doublings = [s for s in upper.special if s.kind is Crossing.PERIOD_DOUBLING]
    assert doublings
    for doubling in doublings:
        assert np.abs(doubling.orbit.multipliers + 1.0).min() < 1e-8


def test_the_doubled_branch_begins_there_and_is_stable_at_first(upper: Branch) -> None:
    doubling = next(s for s in upper.special if s.kind is Crossing.PERIOD_DOUBLING)
    doubled = switch(upper.family, doubling, low=850.0 * RPM, high=1300.0 * RPM)
    assert doubled.turns == 2
    assert doubled.parameter[0] == pytest.approx(doubling.parameter, rel=1e-4)
    assert doubled.stability()[1] is Stability.STABLE
    halves = [orbit.turn().harmonic("slider.position", 0.5) for orbit in doubled.orbits[:6]]
    # the half-order harmonic grows with the square root of the distance
    distance = np.abs(doubled.parameter[1:6] - doubling.parameter)
    slope = np.polyfit(np.log(distance), np.log(halves[1:]), 1)[0]
    assert slope == pytest.approx(0.5, abs=0.05)


def test_a_doubled_branch_ends_where_it_meets_that_of_half_the_period(upper: Branch) -> None:
    doubling = next(s for s in upper.special if s.kind is Crossing.PERIOD_DOUBLING)
    doubled = switch(upper.family, doubling, low=900.0 * RPM, high=1300.0 * RPM)
    (again,) = doubled.special
    end, ends = float(doubled.parameter[-1]), {"low": 890.0 * RPM, "high": 1300.0 * RPM}
    back = follow(upper.family, doubled.orbits[-1], end, **ends, direction=1)
    assert back.reached
    assert back.parameter[-1] == pytest.approx(doubling.parameter, rel=1e-3)
    assert [s.kind for s in back.special] == [Crossing.PERIOD_DOUBLING]
    assert back.special[0].parameter == pytest.approx(again.parameter, rel=1e-9)


def test_a_motion_of_one_turn_does_not_pass_for_one_of_several(upper: Branch) -> None:
    """A branch of 8 turns went on as the motion of one turn, which was then one of several stable motions."""
    doubling = next(s for s in upper.special if s.kind is Crossing.PERIOD_DOUBLING)
    doubled = switch(upper.family, doubling, low=850.0 * RPM, high=1300.0 * RPM, most_points=3).orbits[-1]
    assert not _repeats_early(doubled)
    assert all(_repeats_early(replace(upper.orbits[0], turns=turns)) for turns in (2, 3, 6))
    assert _repeats_early(replace(doubled, turns=4))


def test_a_motion_of_one_turn_is_followed_over_two_turns() -> None:
    orbit = find_orbit(TABLE_3_1, speed=SPEED, turns=2)
    assert orbit.turns == 2
    branch = follow(Family(parameters=TABLE_3_1, drive=orbit.drive), orbit, SPEED, low=0.9 * SPEED, high=1.1 * SPEED)
    assert branch.reached, branch.reason


def test_one_switches_at_period_doublings_and_branch_points_only(softened: Branch) -> None:
    with pytest.raises(InputError, match="is a fold: only at a period doubling or a branch point"):
        switch(softened.family, softened.special[0], low=100.0, high=1200.0)


def test_torus_has_a_complex_pair_on_the_unit_circle() -> None:
    orbit = find_orbit(TABLE_3_1, torque=0.2, start=(0.0, 0.0, 45.0))
    family = Family(parameters=TABLE_3_1, drive=orbit.drive, vary="drive.torque")
    branch = follow(family, orbit, 0.2, low=0.05, high=0.3, direction=-1)
    (torus,) = [s for s in branch.special if s.kind is Crossing.TORUS]
    assert abs(torus.orbit.multipliers[0]) == pytest.approx(1.0, abs=1e-9)
    assert abs(torus.orbit.multipliers[0].imag) > 0.1
    assert branch.orbits[0].largest > 1.0 > branch.orbits[torus.after + 2].largest


def test_the_motor_cannot_pass_the_resonance_where_the_torque_folds() -> None:
    """Sommerfeld's effect: with the torque raised the speed sticks below the resonance, up to a fold."""
    parameters = SETS["rig-2-spring-c"].parameters
    orbit = find_orbit(parameters, torque=0.01, start=(0.0, 0.0, 56.0))
    family = Family(parameters=parameters, drive=orbit.drive, vary="drive.torque")
    branch = follow(family, orbit, 0.01, low=0.002, high=0.06)
    fold = branch.special[0]
    assert fold.kind is Crossing.FOLD
    speeds = branch.columns()["mean crank speed [rad/s]"]
    natural = 585.5 * RPM
    assert speeds[0] < speeds[fold.after] < natural * 1.01
    # the torque there is what the speed drive needs at the same mean speed, all but for the fluctuation of the speed
    held = find_orbit(parameters, speed=float(speeds[fold.after])).turn()["drive.applied_torque"].mean()
    assert fold.parameter == pytest.approx(held, rel=0.05)


def test_a_function_can_vary_what_it_likes() -> None:
    def both(value: float) -> tuple[FiveBarParameters, Drive]:
        return replace(TABLE_3_1, slider_stiffness=value, slider_damping=0.03 * value), Drive(speed=SPEED)

    parameters, drive = both(1000.0)
    family = Family(parameters=parameters, drive=drive, vary=both, name="spring and damper")
    branch = follow(family, find_orbit(parameters, speed=SPEED), 1000.0, low=900.0, high=1100.0)
    assert branch.reached
    assert "spring and damper" in branch.columns()
    end = find_orbit(both(1100.0)[0], speed=SPEED)
    assert branch.orbits[-1].start == pytest.approx(end.start, abs=1e-9)


@pytest.mark.slow
def test_friction_by_contact_forces_can_be_added_to_a_motion_without() -> None:
    orbit = find_orbit(TABLE_3_1, speed=SPEED)
    family = Family(parameters=TABLE_3_1, drive=orbit.drive, vary="slider.friction_coefficient")
    # with its derivative from zero on
    first = periodic.OrbitEquations(family, 1, 0.0, 0.2)(orbit.start, 0.0)
    step = 1e-4
    moved = [find_orbit(replace(TABLE_3_1, slider_friction_coefficient=n * step), speed=SPEED).start for n in (1, 2)]
    slope = (4.0 * moved[0] - moved[1] - 3.0 * orbit.start) / (2.0 * step)
    assert np.linalg.solve(first.jacobian, -first.slope) == pytest.approx(slope, rel=1e-4)
    branch = follow(family, orbit, 0.0, low=0.0, high=0.2)
    assert branch.reached
    end = find_orbit(replace(TABLE_3_1, slider_friction_coefficient=0.2), speed=SPEED)
    assert branch.orbits[-1].start == pytest.approx(end.start, abs=1e-9)
    assert end.amplitude < 0.7 * orbit.amplitude


def test_a_branch_that_nears_the_limit_of_assembly_says_so() -> None:
    orbit = find_orbit(RIG_1_B, speed=1200.0 * RPM)
    family = Family(parameters=RIG_1_B, drive=orbit.drive)
    branch = follow(family, orbit, 1200.0 * RPM, low=100.0 * RPM, high=1300.0 * RPM, direction=-1)
    assert not branch.reached
    assert "limit of assembly" in branch.reason
    assert branch.parameter[-1] > 600.0 * RPM


def test_an_orbit_of_another_family_is_refused() -> None:
    orbit = find_orbit(TABLE_3_1, speed=SPEED)
    family = Family(parameters=replace(TABLE_3_1, slider_stiffness=200.0), drive=orbit.drive)
    with pytest.raises(ContinuationError, match="no solution"):
        follow(family, orbit, SPEED, low=0.5 * SPEED, high=2.0 * SPEED)


def test_without_damping_there_is_no_torus_at_prescribed_speed() -> None:
    # the multipliers' product is 1 all along, and its rounding crosses nothing
    parameters = replace(SETS["rig-2-spring-c"].parameters, slider_damping=0.0)
    orbit = find_orbit(parameters, speed=620.0 * RPM)
    family = Family(parameters=parameters, drive=orbit.drive)
    branch = follow(family, orbit, 620.0 * RPM, low=620.0 * RPM, high=1100.0 * RPM)
    assert not branch.special
    assert set(branch.stability()) == {Stability.MARGINAL}


def test_a_branch_goes_down_to_the_least_value_there_may_be() -> None:
    orbit = find_orbit(replace(TABLE_3_1, slider_coulomb_friction=0.5), speed=SPEED)
    family = Family(parameters=orbit.parameters, drive=orbit.drive, vary="slider.coulomb_friction")
    branch = follow(family, orbit, 0.5, low=0.0, high=1.0, direction=-1)
    assert branch.reached
    assert branch.parameter[-1] == pytest.approx(0.0, abs=1e-12)
    assert branch.orbits[-1].start == pytest.approx(find_orbit(TABLE_3_1, speed=SPEED).start, abs=1e-9)


@pytest.mark.parametrize(
    ("vary", "drive", "message"),
    [
        ("slider.mess", Drive(speed=1.0), r"no slider\.mess; did you mean slider\.mass. \(the nearest of \d+ names"),
        ("assembly.branch", Drive(speed=1.0), "there is no assembly"),
        ("drive.torque", Drive(speed=1.0), "the drive is by speed"),
        ("drive.speed", Drive(torque=1.0), "the drive is by torque"),
    ],
)
def test_what_cannot_vary_is_refused(vary: str, drive: Drive, message: str) -> None:
    with pytest.raises(LinkworkError, match=message):
        Family(parameters=TABLE_3_1, drive=drive, vary=vary)


def test_columns_are_those_of_the_orbits(softened: Branch, tmp_path: pytest.TempPathFactory) -> None:
    columns = softened.columns()
    orbit = softened.orbits[20]
    turn = orbit.turn()
    assert columns["slider.stiffness [N/m]"][20] == softened.parameter[20]
    assert columns["amplitude of u [m]"][20] == orbit.amplitude
    assert columns["harmonic 2 of u [m]"][20] == turn.harmonic("slider.position", 2)
    assert columns["greatest force in pin C [N]"][20] == np.hypot(turn["pin.C.fx"], turn["pin.C.fy"]).max()
    # the greatest of either way: that of the turn with all signs reversed is the same
    of_a_turn, reversed_turn = _turn_columns(orbit, turn), replace(turn, values=-turn.values)
    for name, output in (("crank torque [N.m]", "drive.applied_torque"), ("guide force [N]", "slider.guide_force")):
        greatest = np.abs(turn[output]).max()
        assert of_a_turn[f"greatest {name}"](turn) == of_a_turn[f"greatest {name}"](reversed_turn) == greatest
        assert columns[f"greatest {name}"][20] == greatest
    path = softened.to_csv(tmp_path / "branch.csv")
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    assert rows.shape == (len(softened), len(columns))
    assert figures.plot(softened, title="softened").axes[0].get_ylabel() == "amplitude of slider position u [mm]"


def _drawn(axis: Axes, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x and y of the curve of a branch, put together of its stable and its unstable line, and where it is solid."""
    solid, dashed = (line for line in axis.lines if len(line.get_xdata()) == count and line.get_linestyle() in "--")
    assert (solid.get_linestyle(), dashed.get_linestyle()) == ("-", "--")
    y = solid.get_ydata()
    return solid.get_xdata(), np.where(np.isnan(y), dashed.get_ydata(), y), ~np.isnan(y)


def test_picture_has_the_columns_in_the_units_of_its_axes(softened: Branch) -> None:
    orbit = find_orbit(TABLE_3_1, speed=SPEED)
    family = Family(parameters=TABLE_3_1, drive=orbit.drive)
    over_speed = follow(family, orbit, SPEED, low=0.95 * SPEED, high=1.05 * SPEED)
    forces = [f"greatest force in pin {pin} [N]" for pin in "ABCD"]
    labels = {"slider stiffness [N/m]": (softened, 1.0), "crank speed [rpm]": (over_speed, 1.0 / RPM)}
    for label, (branch, factor) in labels.items():
        columns = branch.columns()
        figure = figures.plot(branch)
        expected = {
            "amplitude of slider position u [mm]": 1e3 * branch.amplitude,
            "greatest crank\ntorque [N.m]": columns["greatest crank torque [N.m]"],
            "greatest\npin force [N]": np.max([columns[name] for name in forces], axis=0),
        }
        assert figure.axes[-1].get_xlabel() == label
        main, harmonics, *loads = figure.axes
        assert [axis.get_ylabel() for axis in (main, *loads)] == list(expected)
        assert harmonics.get_ylabel() == "harmonics of u\n[mm]"
        drawn = [line.get_ydata() for line in harmonics.lines if len(line.get_xdata()) == len(branch)]
        for order in (1, 2, 3):
            pair = np.array(drawn[2 * order - 2 : 2 * order])
            assert np.nanmax(pair, axis=0) == pytest.approx(1e3 * columns[f"harmonic {order} of u [m]"])
        for axis, values in zip((main, *loads), expected.values()):
            x, y, solid = _drawn(axis, len(branch))
            assert x == pytest.approx(factor * branch.parameter)
            assert y == pytest.approx(values)
            assert (solid == (branch.columns()["stable (1), marginal (0), unstable (-1)"] > 0.0)).all()
    (fold,) = softened.special
    (mark,) = (line for line in figures.plot(softened).axes[0].lines if line.get_marker() == "s")
    assert mark.get_xydata()[0] == pytest.approx((fold.parameter, 1e3 * fold.orbit.amplitude))


def test_approximations_beside_are_in_the_same_units(softened: Branch) -> None:
    orbit = find_orbit(TABLE_3_1, speed=SPEED)
    branch = follow(Family(parameters=TABLE_3_1, drive=orbit.drive), orbit, SPEED, low=0.95 * SPEED, high=1.05 * SPEED)
    order = np.argsort(branch.parameter)

    def beside(speed: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        return {"a tenth more": 1.1 * np.interp(speed, branch.parameter[order], branch.amplitude[order])}

    main, _, errors, *_ = figures.plot_branches([branch], beside=beside).axes
    (line,) = (line for line in main.lines if line.get_label() == "approximation, a tenth more")
    x, y = line.get_data()
    assert y == pytest.approx(1100.0 * np.interp(x * RPM, branch.parameter[order], branch.amplitude[order]))
    assert errors.get_ylabel() == "relative error of\nthe amplitude [%]"
    assert errors.lines[0].get_ydata() == pytest.approx(10.0)
    assert main.get_ylim()[1] == pytest.approx(1150.0 * branch.amplitude.max())


def test_watch_receives_every_point() -> None:
    orbit = find_orbit(TABLE_3_1, speed=SPEED)
    seen: list[float] = []
    watch: Callable[[float], None] = seen.append
    family = Family(parameters=TABLE_3_1, drive=orbit.drive)
    branch = follow(family, orbit, SPEED, low=0.9 * SPEED, high=1.1 * SPEED, watch=watch)
    assert seen == pytest.approx(branch.parameter[1:].tolist())
