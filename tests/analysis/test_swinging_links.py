"""Linkages that start elsewhere than at zero, or have a link that swings: a pendulum on a yoke, by Mathieu's equation."""

import os
from dataclasses import replace
from importlib import import_module
from math import pi
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from analysis import periodic
from analysis.figures import plot
from analysis.linear import find_equilibria, find_equilibrium, linearise_orbit
from analysis.linkages import linkage, load_linkage
from analysis.mechanisms import PUBLISHED
from analysis.periodic.motion.discretisation import operating_point
from analysis.run import Inputs, load_case, load_parameters
from analysis.tuning import Wish, load_tuning_case, tune
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import InputError, LinkworkError, ParameterError
from linkwork.mechanism import PublishedSet
from tests.refusals import refused

coexistences = import_module("analysis.periodic.chart.coexistence")
EXAMPLES = Path(__file__).parents[2] / "examples"
STROKE, ARM, MASS, INERTIA, GRAVITY, DAMPING = 0.02, 0.15, 0.5, 4e-3, 9.81, 0.01


def yoke(name: str, *, hanging: float = 0.0, **spring: Any) -> PublishedSet[Any, Any]:
    """A crank moves a yoke up and down, and on that a pendulum hangs at this angle of its pin, half turns."""
    built = linkage(name, ground={"O": (0, 0)}, gravity=GRAVITY)
    built.body("crank", bar=("O", "B"), length=STROKE, mass=1.0, inertia=1e-3)
    built.body("yoke", points={"A": (0, 0)}, mass=1.0, inertia=1e-3)
    built.body("pendulum", bar=("A", "T"), length=2.0 * ARM, mass=MASS, inertia=INERTIA)
    # the yoke's x axis, from which the pin counts, is turned so that the pendulum hangs where it is wanted
    built.slide("G", body="yoke", on="ground", through="O", direction=-0.5 * pi - hanging)
    built.slot("S", pin="B", on="yoke", through="A", direction=0.5 * pi + hanging)
    built.spring("hinge", at="A", damping=DAMPING, **spring)
    built.freedom("crank", "O", speed="100 rpm").freedom("swing", "A", start=hanging)
    built.mechanism()
    return PUBLISHED[name]


def mathieu(speed: float, *, stiffness: float = 0.0, damping: float = DAMPING, upright: bool = False) -> Any:
    """Return the Floquet multipliers of the pendulum: J s'' + c s' + (k +- m l (g + y'')) s = 0, y = r sin(w t)."""
    inertia, sign = INERTIA + MASS * ARM**2, -1.0 if upright else 1.0

    def rates(t: float, x: Any) -> Any:
        lift = -STROKE * speed**2 * np.sin(speed * t)
        pull = stiffness + sign * MASS * ARM * (GRAVITY + lift)
        return np.concatenate([x[2:], -(damping * x[2:] + pull * x[:2]) / inertia])

    ends = solve_ivp(rates, (0.0, 2.0 * pi / speed), np.eye(2).ravel(), rtol=1e-11, atol=1e-13).y[:, -1]
    return np.sort_complex(np.linalg.eigvals(ends.reshape(2, 2)))


@pytest.mark.parametrize("hanging", [0.0, -pi, 3.0 * pi])
def test_a_motion_is_sought_from_where_the_linkage_starts(hanging: float) -> None:
    parameters = yoke(f"yoke-{abs(hanging):.0f}", hanging=hanging).parameters
    for speed in (100.0 * RAD_S_PER_RPM, 134.0 * RAD_S_PER_RPM):
        orbit = periodic.newton_orbit(parameters, periodic.Drive(speed=speed))
        np.testing.assert_allclose(np.sort_complex(orbit.multipliers), mathieu(speed), rtol=1e-7)
        assert orbit.amplitude == 0.0
        np.testing.assert_allclose(periodic.find_orbit(parameters, speed=speed).start, [hanging, 0.0], atol=1e-9)


def test_a_chart_has_the_tongue_in_which_the_pendulum_swings_at_the_speed_of_the_crank() -> None:
    parameters, names = yoke("yoke-tongue").parameters, ("drive.speed", "hinge.damping")
    chart = periodic.stability_chart(parameters, periodic.Drive(speed=6.8), names, ((6.6, 7.2), (0.0, 1e-4)), points=3)
    own = [traced for traced in chart.boundaries if traced.motion == periodic.TRUE_ORBIT]
    assert [traced.kind for traced in own] == 2 * [periodic.Crossing.BRANCH_POINT]
    for traced in own:
        for speed, damping in traced.points[::10].tolist():
            assert abs(mathieu(speed, damping=damping) - 1.0).min() < 1e-5
    assert chart.problems == ()


def test_a_run_confirms_no_normal_form_where_the_motion_is_stable_again_nearby() -> None:
    narrow = replace(yoke("yoke-narrow").parameters, hinge_damping=1e-4)
    response = periodic.frequency_response(narrow, 6.9, 7.0, doublings=0)
    point = response.branches[0].special[0]
    with pytest.raises(LinkworkError, match="too narrow"):
        periodic.confirm_form(response.family, point, periodic.normal_form(response.family, point))


def test_from_a_start_that_goes_round_no_rotation_is_added_to_coexisting_motions() -> None:
    point = operating_point(yoke("yoke-added").parameters, periodic.Drive(speed=20.0))
    into = np.full((coexistences.MOST_ORBITS, 5), np.nan)
    assert coexistences._add_motions(point, np.array([[-0.91119805, 21.98298217]]), into, 1)
    np.testing.assert_allclose(into[0, 3:], 0.0, atol=1e-9)  # it hangs


def test_an_amplitude_of_zero_has_no_elasticities() -> None:
    still = replace(yoke("yoke-still").parameters, hinge_damping=1e-3)
    response = periodic.frequency_response(still, "120 rpm", "130 rpm", doublings=0)
    (doubling,) = response.branches[0].special
    assert periodic.special_gradient(response.family, doubling).amplitude.value == 0.0


def test_what_hangs_and_what_stands_are_two_motions_however_often_the_pin_has_turned() -> None:
    parameters, speed = yoke("yoke-free", hanging=-pi).parameters, 100.0 * RAD_S_PER_RPM
    found = periodic.find_orbits(parameters, speed=speed)
    assert sorted(orbit.start[0] for orbit in found.orbits) == pytest.approx([-pi, 0.0], abs=1e-9)
    (hangs,) = found.stable
    (stands,) = (orbit for orbit in found.orbits if orbit is not hangs)
    np.testing.assert_allclose(np.sort_complex(stands.multipliers), mathieu(speed, upright=True), rtol=1e-7)
    settled = periodic.basins(parameters, periodic.Drive(speed=speed), points=8)
    assert settled.share(0) > 0.9  # it comes to hang, from many starts after whole turns
    angles = [found.coordinates[1] for found in find_equilibria(parameters)]
    assert sorted(abs(angle) for angle in angles) == pytest.approx([0.0, pi], abs=1e-9)
    assert abs(find_equilibrium(parameters).coordinates[1]) == pytest.approx(pi)


def test_basins_are_in_the_plane_that_the_motions_span() -> None:
    """A pendulum absorber on a spring, at rest in one motion and swinging at half the crank's speed in the other."""
    built = linkage("absorber", ground={"O": (0, 0), "A": (0, 0.5)}, gravity=GRAVITY)
    built.body("crank", bar=("A", "B"), length=0.008, mass=1.0, cog=(0, 0), inertia=0.01)
    built.body("yoke", points={"N": (0, 0)}, mass=0.5)
    built.body("table", points={"P": (0, 0), "T": (0, 0)}, mass=10.0)
    built.body("pendulum", points={"P": (0, 0)}, mass=1.2, cog=(0.25, 0), inertia=0.002)
    built.slide("Y", body="table", through="O", direction=0.5 * pi)
    built.slide("V", body="yoke", through="A", direction=0.5 * pi)
    built.slot("S", pin="B", on="yoke", through="N", direction=0.5 * pi)
    built.spring("foot", at="Y", stiffness=1600.0, free=0.084, damping=10.0)
    built.spring("exciter", between=("T", "N"), stiffness=300.0, free=0.58)
    built.spring("hinge", at="P", damping=0.008)
    built.freedom("crank", "A", speed="112 rpm").freedom("lift", "Y").freedom("swing", "P", start=-pi)
    built.mechanism()
    parameters, drive = PUBLISHED["absorber"].parameters, periodic.Drive(speed="112 rpm")
    found = periodic.join_orbits([periodic.find_orbits(parameters, speed="112 rpm", turns=turns) for turns in (1, 2)])
    swings = periodic.basins(parameters, drive, points=6, found=found)
    assert swings.labels == ("swing.angle [rad]", "swing.speed [rad/s]")
    assert swings.fixed == ("lift.position", "lift.velocity")
    assert min(swings.share(0), swings.share(1)) > 0.1
    # the pendulum also stands, unstable: a whole turn of it, and speeds such as those of the motions
    assert np.ptp(swings.position) == pytest.approx(2.0 * pi)
    rates = max(np.abs(orbit.turn()["swing.speed"]).max() for orbit in found.orbits)
    assert swings.rate[[0, -1]] == pytest.approx([-1.5 * rates, 1.5 * rates], rel=1e-2)
    # from a pendulum at rest the lift alone does not reach the motion in which it swings
    lifts = periodic.basins(parameters, drive, points=6, found=found, coordinate="lift.position")
    assert (lifts.ends == 0).all()
    size = max(np.ptp(orbit.turn()["lift.position"]) for orbit in found.orbits)
    assert size < np.ptp(lifts.position) < 2.0 * size
    same = periodic.basins(parameters, drive, points=2, found=found, position=("-10 mm", "10 mm"))
    assert same.labels[0] == "lift.position [m]"
    axis = plot(swings).axes[0]
    assert axis.get_xlabel() == "swing angle at crank angle 0, all else as in motion 1 [deg]"
    # the motion that hangs still is at an end of the axis, to rounding
    low, high = axis.get_xlim()
    for marks in axis.lines[:2]:
        assert all(low - 1e-9 <= x <= high + 1e-9 for x in np.asarray(marks.get_xdata()))
    with pytest.raises(InputError, match=r"free coordinate 'swing\.speed'"):
        periodic.basins(parameters, drive, points=2, found=found, coordinate="swing.speed")


def test_a_branch_is_the_same_after_whole_turns() -> None:
    hanging = yoke("yoke-of-a-response").parameters
    response = periodic.frequency_response(
        hanging, "100 rpm", "101 rpm", start=[2.0 * pi, 0.0], greatest_step=0.2, doublings=0
    )
    (branch,) = response.branches
    assert branch.orbits[0].start[0] == pytest.approx(2.0 * pi)
    assert len(periodic.with_isolas(response, places=1, greatest_step=0.2).branches) == 2  # and that on which it stands


@pytest.mark.slow
def test_where_the_amplitude_is_rounding_it_has_no_extremum_and_a_damping_is_found() -> None:
    """Parametric excitation: the pendulum hangs still until twice its natural frequency is near the crank's."""
    sprung = yoke("yoke-sprung", stiffness=1.0).parameters
    low, high = 190.0 * RAD_S_PER_RPM, 215.0 * RAD_S_PER_RPM
    response = periodic.frequency_response(sprung, low, high, doublings=0)
    assert response.maxima() == response.minima() == ()
    name = "hinge.damping"
    wish = Wish(parameters=sprung, speeds=(low, high), change={name: (0.002, 0.2)}, no_unstable=True, least=name)

    def excess(damping: float) -> float:
        speeds = np.linspace(low, high, 26).tolist()
        return float(max(abs(mathieu(speed, stiffness=1.0, damping=damping)).max() for speed in speeds)) - 1.0

    # the greatest of 26 speeds is that of all to the square of their distance
    assert tune(wish).values[0] == pytest.approx(brentq(excess, 0.01, 0.1, xtol=1e-5), rel=2e-3)


FILE = """
title = "a pendulum"
[linkage]
name = "named-pendulum"
source = "own"
gravity = 9.81
ground = { O = [0, 0] }
bodies.rod = { bar = ["O", "P"], length = "0.3 m", mass = "1 kg", inertia = "0.01 kg*m^2" }
springs.hinge = { at = "O", stiffness = "2 N*m/rad", damping = "0.1 N*m*s/rad" }
freedoms.swing = { joint = "O" }
[hinge]
stiffness = "3 N*m/rad"
damping = "0.2 N*m*s/rad"
[run]
stop_time = 0.1
step = 0.01
"""


def test_a_case_has_what_stands_in_the_file_of_its_linkage(tmp_path: Path) -> None:
    (tmp_path / "rod.toml").write_text(FILE)
    (tmp_path / "chain.toml").write_text('linkage = "rod.toml"\n[hinge]\ndamping = "0.5 N*m*s/rad"\n')
    case = tmp_path / "case.toml"
    case.write_text('linkage = "chain.toml"\n[run]\nstop_time = 0.3\n')
    found = load_case(case)
    assert (found.title, found.stop_time, found.step) == ("case", 0.3, 1e-3)
    assert (found.parameters.hinge_stiffness, found.parameters.hinge_damping) == (3.0, 0.5)
    case.write_text('linkage = "rod.toml"\npublished = "table-3.1"\n')
    refused(InputError, r"one mechanism: leave out linkage, or published = 'table-3.1'", load_case, case)
    case.write_text('linkage = "case.toml"\n')
    for load in (load_case, load_linkage):
        refused(InputError, "names itself as the file of its linkage", load, case)
    case.write_text("linkage = 7\n")
    refused(ParameterError, "linkage is 7: it must be the name of a file", load_case, case)
    case.write_text('mechanism = "not-loaded"\n')
    refused(InputError, "a linkage of your own is loaded first", load_parameters, case)
    (tmp_path / "chain.toml").write_text("[run]\n")
    case.write_text('linkage = "chain.toml"\n')
    refused(InputError, "describes no linkage", load_case, case)


def test_the_file_of_a_linkage_is_found_from_where_the_tuned_case_is_written(tmp_path: Path) -> None:
    file = EXAMPLES / "linkages" / "elastic-bearing.toml"
    case = tmp_path / "tuning.toml"
    wish = '[tune]\nspeeds = ["280 rpm", "320 rpm"]\nno_jump = true\nchange = { "coupler.mass" = "20 %" }\n'
    case.write_text(f"linkage = {Path(os.path.relpath(file, tmp_path)).as_posix()!r}\n{wish}")
    tables = load_tuning_case(case).tuned_tables(SimpleNamespace(values=np.array([0.4])), tmp_path / "out")  # type: ignore[arg-type]
    assert (tmp_path / "out" / tables["linkage"]).resolve() == file.resolve()


def test_an_arm_that_hangs_on_a_crank_turns_back_in_its_pin() -> None:
    built = linkage("hanging-arm", ground={"O": (0, 0)}, gravity=GRAVITY)
    built.body("crank", bar=("O", "B"), length=0.03, mass=0.2, inertia=1e-4)
    built.body("arm", bar=("B", "T"), length=0.15, mass=0.2, inertia=4e-4)
    built.spring("hinge", at="B", damping=4e-4)
    built.freedom("crank", "O", speed="100 rpm").freedom("swing", "B", start=-0.5 * pi)
    built.mechanism()
    speed, inertia, arm = 100.0 * RAD_S_PER_RPM, 4e-4 + 0.2 * 0.075**2, 0.2 * 0.075

    def rates(t: float, x: Any) -> Any:
        """Of the arm's angle to the horizontal, whose pin goes round."""
        pull = -GRAVITY * np.cos(x[0]) + 0.03 * speed**2 * np.sin(speed * t - x[0])
        return [x[1], (arm * pull - 4e-4 * (x[1] - speed)) / inertia]

    # till it has settled
    period = 2.0 * pi / speed
    hangs = solve_ivp(rates, (0.0, 300.0 * period), [-0.5 * pi, 0.0], rtol=1e-10, atol=1e-12, method="DOP853").y[:, -1]
    orbit = periodic.find_orbit("hanging-arm", speed=speed)
    assert orbit.rounds == {"swing.angle": -1}
    np.testing.assert_allclose(orbit.start, hangs - [0.0, speed], atol=1e-8)
    assert periodic.basins("hanging-arm", periodic.Drive(speed=speed), points=4).share(0) > 0.0
    # it is the stable one of two where the hinge has hardly any damping, too
    slack = replace(PUBLISHED["hanging-arm"].parameters, hinge_damping=2e-5)
    assert periodic.find_orbit(slack, speed="200 rpm").verdict().stability is periodic.Stability.STABLE
    found = periodic.find_orbits("hanging-arm", speed=speed)
    assert (found.agreed, found.index) == (True, 0)  # the arm that stands on the pin is among them
    # a motion of three turns in which the arm goes round once is one motion, whichever turn comes first
    orbits = periodic.find_orbits("hanging-arm", speed=speed, turns=3).orbits
    thirds = [orbit for orbit in orbits if abs(orbit.rounds["swing.angle"]) == 1]
    starts = [orbit.passages() for orbit in thirds]
    assert [len(passed) for passed in starts] == [3] * len(thirds)
    flow, everything = orbit.flow, np.vstack(starts)
    apart = np.abs(flow.remove_turns(everything[:, None] - everything)).max(axis=2)
    assert apart[~np.eye(len(apart), dtype=bool)].min() > 1e-3


def test_what_is_not_sought_of_links_that_go_round_is_said() -> None:
    assert "swing.angle" in periodic.unsought_hint(yoke("yoke-unsought").parameters, periodic.Drive(speed=10.0))
    assert periodic.unsought_hint(PUBLISHED["table-3.1"].parameters, periodic.Drive(speed=10.0)) == ""


def test_turns_in_a_period_are_those_of_the_crank() -> None:
    """A wheel at half the crank's speed is back after two turns, and so is the pendulum on its rim."""
    built = linkage("two-wheels", ground={"A": (0, 0), "E": (0.1, 0)}, gravity=GRAVITY)
    built.body("one", points={"A": (0, 0)}, mass=1.0, inertia=2e-3)
    built.body("two", points={"E": (0, 0), "F": (0.06, 0)}, mass=2.0, inertia=5e-3)
    built.body("bob", bar=("F", "H"), length=0.1, mass=0.3, inertia=1e-5)
    built.gear("mesh", bodies=("one", "two"), ratio=-0.5)
    built.spring("hinge", at="F", stiffness=4.0, damping=0.02)
    built.freedom("one", "A", speed="300 rpm").freedom("bob", "F")
    built.mechanism()
    orbit = periodic.find_orbit("two-wheels", speed="300 rpm")
    assert orbit.turn().period == pytest.approx(0.4)
    assert "2 turns at" in repr(orbit)
    response = periodic.frequency_response("two-wheels", "300 rpm", "302 rpm", doublings=0)
    assert (response.branches[0].columns()["turns in a period [1]"] == 2.0).all()
    columns = response.branches[0].columns()
    (speeds,) = (v for name, v in columns.items() if name.startswith("mean ") and "[rad/s]" in name)
    assert speeds == pytest.approx(response.branches[0].parameter)
    assert (periodic.sweep("two-wheels", "300 rpm").turns == 2).all()
    # order 1 is once in each turn of the crank, as the second of the common period
    turn = orbit.turn()
    twice = 2.0 * abs(np.fft.rfft(turn["bob.angle"])[1:3]) / len(turn.angle)
    assert [turn.harmonic("bob.angle", order) for order in (0.5, 1)] == pytest.approx(twice)
    part = replace(response.branches[0], reason="it ends")
    doubled = replace(part, turns=2, orbits=tuple(replace(o, turns=2) for o in part.orbits))
    assert periodic.describe_end(doubled).startswith("the branch with a period of 4 turns")
    assert periodic.describe_turns(orbit.flow, 1) == "2 turns"


def going_round(speed: float, start: Any, damping: float = DAMPING) -> Any:
    """Return the start and Floquet multipliers of the pendulum that goes round with the crank, by shooting with SciPy."""
    inertia = INERTIA + MASS * ARM**2

    def rates(t: float, x: Any) -> Any:
        pull = MASS * ARM * (GRAVITY - STROKE * speed**2 * np.sin(speed * t))
        bent = np.append(-damping * x[1] - pull * np.sin(x[0]), -damping * x[4:] - pull * np.cos(x[0]) * x[2:4])
        return np.concatenate([[x[1], bent[0] / inertia], x[4:], bent[1:] / inertia])

    found, rounds = np.array(start), np.sign(start[1])
    for _ in range(8):
        tight = {"rtol": 1e-12, "atol": 1e-13, "method": "DOP853"}
        over = solve_ivp(rates, (0.0, 2.0 * pi / speed), [*found, 1.0, 0.0, 0.0, 1.0], **tight)
        end = over.y[:, -1]
        matrix = end[2:].reshape(2, 2)
        found = found + np.linalg.solve(np.eye(2) - matrix, end[:2] - [2.0 * pi * rounds, 0.0] - found)
    return found, np.sort_complex(np.linalg.eigvals(matrix))


def test_a_pendulum_that_goes_round_with_the_crank_is_found() -> None:
    parameters, speed = yoke("yoke-round").parameters, 300.0 * RAD_S_PER_RPM
    found = periodic.find_orbits(parameters, speed=speed)
    assert (found.agreed, found.index, found.index_of_all) == (True, 0, 0)
    round_it = [orbit for orbit in found.orbits if orbit.rounds]
    # to both sides a stable and an unstable one, mirror images
    assert sorted(orbit.rounds["swing.angle"] for orbit in round_it) == [-1, -1, 1, 1]
    assert [sum(orbit.start[1] * sign > 1.0 for orbit in found.stable) for sign in (1.0, -1.0)] == [1, 1]
    for orbit in round_it:
        start, multipliers = going_round(speed, orbit.start + np.array([0.01, 0.1]))
        np.testing.assert_allclose(orbit.start, start, rtol=1e-8)
        np.testing.assert_allclose(np.sort_complex(orbit.multipliers), multipliers, rtol=1e-7)
        turn = orbit.turn()
        away = turn["swing.angle"] - orbit.rounds["swing.angle"] * turn.angle
        assert orbit.amplitude == pytest.approx(0.5 * np.ptp(away), rel=1e-3)
        # the angle of the body jumps by a whole turn, where that of the pin goes on
        assert turn.harmonic("pendulum.angle", 1) == pytest.approx(turn.harmonic("swing.angle", 1), rel=1e-9)
        along = linearise_orbit(parameters, orbit).monodromy()
        np.testing.assert_allclose(along, orbit.monodromy, rtol=1e-6)


def test_damping_ends_what_goes_round_where_the_mean_torque_says() -> None:
    parameters, speed = yoke("yoke-damped").parameters, 2000.0 * RAD_S_PER_RPM
    # to first order m l r w^2 / 2 sin(phase) drives it, and c w holds it back
    most = 0.5 * MASS * ARM * STROKE * speed
    for share, count in ((0.97, 4), (1.03, 0)):
        damped = replace(parameters, hinge_damping=share * most)
        assert len([orbit for orbit in periodic.find_orbits(damped, speed=speed).orbits if orbit.rounds]) == count


def test_a_machine_that_starts_to_go_round_goes_on() -> None:
    parameters, speed = yoke("yoke-started").parameters, 300.0 * RAD_S_PER_RPM
    round_it = max(periodic.find_orbits(parameters, speed=speed).stable, key=lambda orbit: orbit.start[1])
    near = round_it.start + np.array([0.05, 0.5])
    assert periodic.newton_orbit(parameters, periodic.Drive(speed=speed), start=near).rounds == {"swing.angle": 1}
    swept = periodic.sweep(parameters, np.linspace(300.0, 400.0, 5) * RAD_S_PER_RPM, start=near)
    assert [orbit and orbit.rounds for orbit in swept.orbits] == [{"swing.angle": 1}] * 5
    assert periodic.find_orbit(parameters, speed=speed).rounds == {}  # run up from rest it hangs
    settled = periodic.basins(
        parameters, periodic.Drive(speed=speed), points=12, rate=(-40.0, 40.0), position=(-3.0, 3.0)
    )
    shares = {orbit.rounds.get("swing.angle", 0): settled.share(n) for n, orbit in enumerate(settled.motions)}
    assert set(shares) == {-1, 0, 1}
    assert min(shares.values()) > 0.02
    assert sum(shares.values()) == pytest.approx(1.0)


def test_a_response_has_the_branch_that_goes_round() -> None:
    parameters = yoke("yoke-response").parameters
    response = periodic.with_isolas(periodic.frequency_response(parameters, "280 rpm", "320 rpm"), places=1)
    rounds = sorted(branch.orbits[0].rounds.get("swing.angle", 0) for branch in response.branches)
    assert {-1, 0, 1} <= set(rounds)
    for branch in response.branches:
        way = [np.unwrap(orbit.turn()["swing.angle"]) for orbit in (branch.orbits[0], branch.orbits[-1])]
        goes = [round((turn[-1] - turn[0]) / (2.0 * pi)) for turn in way]
        assert goes == [branch.orbits[0].rounds.get("swing.angle", 0)] * 2


def test_a_sweep_leaves_what_hangs_still_where_that_is_unstable() -> None:
    parameters, speed = yoke("yoke-swept").parameters, 134.0 * RAD_S_PER_RPM
    *_, last = periodic.sweep(parameters, np.linspace(110.0, 134.0, 9) * RAD_S_PER_RPM).orbits
    inertia, period = INERTIA + MASS * ARM**2, 2.0 * pi / speed

    def rates(t: float, x: Any) -> Any:
        pull = MASS * ARM * (GRAVITY - STROKE * speed**2 * np.sin(speed * t)) * np.sin(x[0])
        return [x[1], -(DAMPING * x[1] + pull) / inertia]

    times = np.linspace(400.0, 402.0, 1001) * period
    swings = solve_ivp(rates, (0.0, times[-1]), [1e-3, 0.0], t_eval=times, rtol=1e-9, atol=1e-12, method="DOP853").y[0]
    assert last is not None
    assert last.crank_turns == 2
    assert last.amplitude == pytest.approx(0.5 * np.ptp(swings), rel=1e-4)


@pytest.mark.slow
def test_an_undamped_crank_is_not_run_up_to_settle() -> None:
    """Which took minutes, since nothing dies out."""
    made = load_linkage(Path(__file__).parents[2] / "examples" / "linkages" / "two-crank-five-bar.toml")
    orbit = periodic.find_orbit(made.first_set.parameters, Inputs(left_speed="120 rpm", right_torque=0.0))
    assert orbit.verdict().stability is periodic.Stability.MARGINAL
    assert orbit.others == 5
