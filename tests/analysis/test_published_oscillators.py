"""Periodic motions of the textbooks' oscillators: Mathieu, Duffing, the driven pendulum, against tables and other methods."""

from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from click.testing import Result
from scipy.integrate import solve_ivp
from scipy.special import mathieu_a, mathieu_b

from analysis import periodic
from analysis.numerics.boundaries import scan
from analysis.periodic.motion.drive import motion_scales
from analysis.periodic.response.advice import arcs, fold_jumps
from linkwork.errors import InputError, LinkworkError
from tests.mechanisms import torsion
from tests.oracles import oscillator
from tests.published import FEIGENBAUM, MATHIEU_A, MATHIEU_B, PENDULUM_DOUBLINGS

pytestmark = pytest.mark.usefixtures("registered")


# Mathieu: y'' + (a - 2 q cos 2t) y = 0, a turn of the crank for half a period of the solutions, 2t its angle

MATHIEU = periodic.Drive(speed=2.0)


def mathieu(a: float, q: float) -> torsion.Parameters:
    return torsion.Parameters(rotor_stiffness=a, rotor_modulation=-2.0 * q)


@pytest.mark.parametrize("q", MATHIEU_A)
def test_multipliers_pass_the_unit_circle_at_the_characteristic_values_of_mathieu(q: float) -> None:
    operation, (low, high) = (
        periodic.plane(mathieu(0.0, q), MATHIEU, "rotor.stiffness", "rotor.modulation"),
        (-2.0 * q, 30.0),
    )
    for multiplier, orders in ((1, (0, 2, 4)), (-1, (1, 3, 5))):
        test = periodic.orbit_test(operation, multiplier)
        roots = scan(lambda a, test=test: test(a, -2.0 * q), low, high).roots  # type: ignore[misc]
        expected = [mathieu_a(r, q) for r in orders] + [mathieu_b(r, q) for r in orders if r]
        assert roots == pytest.approx(sorted(a for a in expected if low < a < high), abs=1e-9)
        for table in (MATHIEU_A[q], MATHIEU_B[q]):
            for r, printed in table.items():
                if r in orders and low < printed < high:
                    assert np.abs(roots - printed).min() < 0.6e-8


def test_branches_and_boundaries_find_the_characteristic_values_of_mathieu() -> None:
    family = periodic.Family(parameters=mathieu(0.0, 1.0), drive=MATHIEU, vary="rotor.stiffness")
    branch = periodic.follow(family, periodic.newton_orbit(mathieu(-1.0, 1.0), MATHIEU), -1.0, low=-1.0, high=10.0)
    odd, even = (
        [s for s in branch.special if (s.kind is periodic.Crossing.PERIOD_DOUBLING) is own] for own in (True, False)
    )
    assert {special.kind for special in even} == {periodic.Crossing.BRANCH_POINT}
    expected = [mathieu_b(1, 1.0), mathieu_a(1, 1.0), mathieu_b(3, 1.0), mathieu_a(3, 1.0)]
    assert [special.parameter for special in odd] == pytest.approx(expected, abs=1e-9)
    # the second multiplier crosses with the first: its place is as uncertain as the root of rounding
    expected = [mathieu_a(0, 1.0), mathieu_b(2, 1.0), mathieu_a(2, 1.0)]
    assert [special.parameter for special in even] == pytest.approx(expected, abs=1e-6)
    # between b_r and a_r the equation has solutions that grow
    words = [branch.stability()[special.after + 1] for special in odd]
    assert words == [periodic.Stability.UNSTABLE, periodic.Stability.MARGINAL] * 2

    curve = periodic.follow_crossing(
        periodic.plane(mathieu(0.0, 1.0), MATHIEU, "rotor.modulation", "rotor.stiffness"),
        odd[1].orbit,
        periodic.Crossing.PERIOD_DOUBLING,
        (-2.0, odd[1].parameter),
        x=(-6.0, -1.0),
        y=(-5.0, 5.0),
    )
    q, a = -0.5 * curve.points[:, 0], curve.points[:, 1]
    assert np.ptp(q) > 2.4
    assert a == pytest.approx(mathieu_a(1, q), abs=1e-8)


def test_a_branch_has_the_unstable_windows_that_lie_within_one_of_its_steps() -> None:
    q, low = 0.05, 0.3
    family = periodic.Family(parameters=mathieu(0.0, q), drive=MATHIEU, vary="rotor.stiffness")
    branch = periodic.follow(family, periodic.newton_orbit(mathieu(low, q), MATHIEU), low, low=low, high=8.0)
    doublings, others = branch.special[:2], branch.special[2:]
    assert [s.kind for s in branch.special] == [periodic.Crossing.PERIOD_DOUBLING] * 2 + [
        periodic.Crossing.BRANCH_POINT
    ] * 2
    assert [s.parameter for s in doublings] == pytest.approx([mathieu_b(1, q), mathieu_a(1, q)], abs=1e-9)
    assert [s.parameter for s in others] == pytest.approx([mathieu_b(2, q), mathieu_a(2, q)], abs=1e-7)
    # of each window the branch has the one point that was inserted
    unstable = [n for n, word in enumerate(branch.stability()) if word is periodic.Stability.UNSTABLE]
    assert unstable == [special.after for special in branch.special[1::2]]
    assert (np.diff(branch.parameter) > 0.0).all()


# Duffing, hardening: x'' + 0.1 x' + x + 0.04 x^3 = cos w t

DUFFING = torsion.Parameters(rotor_damping=0.1, rotor_stiffness=1.0, rotor_cubic_stiffness=0.04, rotor_excitation=1.0)


@pytest.fixture(scope="module")
def hardening() -> periodic.Branch:
    orbit = periodic.find_orbit(DUFFING, speed=0.5)
    return periodic.follow(periodic.Family(parameters=DUFFING, drive=orbit.drive), orbit, 0.5, low=0.5, high=3.0)


def collocated(family: periodic.Family, special: periodic.SpecialPoint, samples: int) -> oscillator.Found:
    """The special point by Fourier collocation, begun at ours."""

    def law(value: float) -> tuple[float, torsion.Constants]:
        parameters, drive = family.operation(value)
        assert drive.speed is not None
        return drive.speed, parameters.constants()

    orbit = special.orbit
    angle, doubling = (
        orbit.turn(samples * orbit.turns)["rotor.angle"],
        special.kind is periodic.Crossing.PERIOD_DOUBLING,
    )
    return oscillator.special_point(law, angle, special.parameter, orbit.turns, antiperiodic=doubling)


def test_folds_of_duffing_are_those_of_fourier_collocation(hardening: periodic.Branch) -> None:
    assert hardening.reached
    assert [special.kind for special in hardening.special] == [periodic.Crossing.FOLD, periodic.Crossing.FOLD]
    for special in hardening.special:
        found = collocated(hardening.family, special, 128)
        assert found.residual < 1e-9
        assert special.parameter == pytest.approx(found.parameter, rel=1e-9)
    # the first harmonic alone: a^2 ((1 - w^2 + 3/4 0.04 a^2)^2 + 0.01 w^2) = 1, to the size of the third
    squares = np.linspace(0.5, 60.0, 400_000)
    middle = 1.0 + 0.03 * squares - 0.005
    inner = middle**2 - (1.0 + 0.03 * squares) ** 2 + 1.0 / squares
    speeds = np.sqrt((middle + np.sqrt(inner.clip(0.0)))[inner > 0.0])
    least = int(speeds.argmin())
    found = [special.parameter for special in hardening.special]
    assert found == pytest.approx([speeds[least:].max(), speeds[least]], rel=5e-3)


def test_between_the_folds_of_duffing_there_are_three_motions(hardening: periodic.Branch) -> None:
    upper, lower = (special.parameter for special in hardening.special)
    for speed, count in ((lower - 0.01, 1), (0.5 * (lower + upper), 3), (upper + 0.01, 1)):
        found = periodic.find_orbits(DUFFING, speed=speed)
        assert (len(found), found.agreed, found.index) == (count, True, 1)


def test_a_branch_followed_to_both_sides_is_the_same_branch(hardening: periodic.Branch) -> None:
    middle = periodic.find_orbits(DUFFING, speed=1.4).orbits[1]
    both = periodic.follow_both(hardening.family, middle, 1.4, low=0.5, high=3.0)
    assert both.reached
    assert sorted([both.parameter[0], both.parameter[-1]]) == [0.5, 3.0]
    found = {special.parameter for special in both.special}
    assert sorted(found) == pytest.approx(sorted(special.parameter for special in hardening.special), rel=1e-10)
    for special in both.special:
        # the multiplier passes 1 after the point that it names
        before, after = both.largest_multiplier[special.after : special.after + 2]
        assert min(before, after) < 1.0 < max(before, after)
    # each end that was not reached is named
    short = periodic.follow_both(hardening.family, middle, 1.4, low=0.5, high=3.0, most_points=7)
    low, high = (hardening.family.format_value(short.parameter[end]) for end in (0, -1))
    assert periodic.describe_end(short).startswith(f"the branch is followed from {low} to {high} only: at {low} ")
    assert f", at {high} " in periodic.describe_end(short)


def test_the_arcs_of_duffing_end_at_its_folds(hardening: periodic.Branch) -> None:
    found = arcs([hardening])
    assert [arc.stable for arc in found] == [True, False, True]
    ends = [[float(arc.parameter[0]), float(arc.parameter[-1])] for arc in found]
    folds = sorted(special.parameter for special in hardening.special)
    assert ends[1] == pytest.approx(folds, rel=1e-10)
    assert sorted([ends[0][1], ends[2][0]], reverse=True) == pytest.approx(folds[::-1], rel=1e-10)
    assert [arc.cut for arc in found].count((True, True)) == 1
    # at a fold a stable motion ends
    assert sorted(jump.parameter for jump in fold_jumps([hardening])) == pytest.approx(folds, rel=1e-10)


def test_curvature_at_the_folds_of_duffing_is_that_of_the_series_of_the_map(hardening: periodic.Branch) -> None:
    words = ["both motions at lower values", "both motions at higher values"]
    for special, expected in zip(hardening.special, words):
        form = periodic.normal_form(hardening.family, special)
        exact = oscillator.curvature_at_fold(*of_a_map(special))
        assert form.words == expected
        assert abs(form.coefficient) == pytest.approx(abs(exact), rel=1e-6)


def of_a_map(special: periodic.SpecialPoint) -> tuple[torsion.Constants, float, np.ndarray, int, np.ndarray]:
    orbit = special.orbit
    assert orbit.drive.speed is not None
    scale = motion_scales(orbit.parameters, orbit.drive, orbit.start)
    return orbit.parameters.constants(), orbit.drive.speed, orbit.start, orbit.turns, scale


# The driven damped pendulum of Taylor's chapter 12

DRIVEN, NATURAL = 2.0 * pi, 3.0 * pi


def pendulum(strength: float) -> tuple[torsion.Parameters, periodic.Drive]:
    weight = NATURAL**2
    parameters = torsion.Parameters(
        rotor_damping=0.5 * NATURAL, rotor_weight=weight, rotor_excitation=strength * weight
    )
    return parameters, periodic.Drive(speed=DRIVEN)


@pytest.fixture(scope="module")
def cascade() -> list[periodic.Branch]:
    """Motions of 1, 2, 4 and 8 turns, each switched to from the one before."""
    parameters, drive = pendulum(1.06)
    family = periodic.Family(parameters=parameters, drive=drive, vary=pendulum, name="strength")
    found = periodic.find_orbits(parameters, speed=DRIVEN)
    # there is one in every well, and its mirror image
    orbit = min(found.stable, key=lambda orbit: abs(orbit.start[0] + 0.5 * pi))
    branches = [periodic.follow(family, orbit, 1.06, low=1.06, high=1.083)]
    for _ in range(3):
        branches.append(periodic.switch(family, branches[-1].special[0], low=1.06, high=1.083, greatest=5e-3))
    return branches


def test_the_pendulum_breaks_its_symmetry_at_a_branch_point() -> None:
    weight, (parameters, drive) = NATURAL**2, pendulum(1.0)
    ends = weight, 1.01 * weight
    response = periodic.frequency_response(parameters, *ends, drive=drive, vary="rotor.excitation", doublings=0)
    (own,) = (special for branch in response.branches for special in branch.special)
    assert own.kind is periodic.Crossing.BRANCH_POINT
    form = periodic.normal_form(response.family, own)
    assert form.words == "supercritical"
    assert periodic.confirm_form(response.family, own, form).agrees(form)
    names = "rotor.excitation", "rotor.damping"
    with pytest.raises(LinkworkError, match="branches cross"):
        periodic.special_gradient(response.family, own)
    with pytest.raises(LinkworkError, match="branches cross"):
        periodic.boundary_gradient(own.orbit, own.kind, names)
    with pytest.raises(InputError, match="singular"):
        periodic.follow_crossing(
            periodic.plane(parameters, drive, *names), own.orbit, own.kind, (ends[0], 0.1), x=ends, y=(0.0, 1.0)
        )
    # half a period of a symmetric motion ends in its mirror image; it breaks where a deviation ends in itself
    p = own.orbit.parameters.constants()

    def rates(t: float, y: np.ndarray) -> list[float]:
        x, v, dx, dv, ex, ev = y.tolist()
        force = p.excitation * np.cos(DRIVEN * t) - p.damping * v - p.weight * np.sin(x)
        slope = -p.weight * np.cos(x)
        return [v, force, dv, slope * dx - p.damping * dv, ev, slope * ex - p.damping * ev]

    begin = [*own.orbit.start, 1.0, 0.0, 0.0, 1.0]
    end = solve_ivp(rates, (0.0, pi / DRIVEN), begin, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    assert end[:2] == pytest.approx(-own.orbit.start, abs=1e-5)
    assert np.linalg.det(end[2:].reshape(2, 2) - np.eye(2)) == pytest.approx(0.0, abs=1e-5)
    # the machine passes it without a jump, and two mirror images are stable beyond
    assert response.jumps == ()
    (avoided,) = response.speeds_to_avoid
    assert (avoided.risk, avoided.low, avoided.high) == (periodic.Risk.SEVERAL, own.parameter, ends[1])
    stable = [branch for branch in response.branches if set(branch.stability()) == {periodic.Stability.STABLE}]
    assert [branch.parameter[-1] for branch in stable] == 2 * [ends[1]]


@pytest.mark.slow
def test_the_pendulum_doubles_its_period_where_others_found(cascade: list[periodic.Branch]) -> None:
    assert [branch.turns for branch in cascade] == [1, 2, 4, 8]
    doublings = [branch.special[0] for branch in cascade]
    assert {special.kind for special in doublings} == {periodic.Crossing.PERIOD_DOUBLING}
    values = np.array([special.parameter for special in doublings])
    # to one in the last digit printed: the first is 1.06637
    assert values == pytest.approx(PENDULUM_DOUBLINGS, abs=1e-4)
    for special in doublings[:3]:
        found = collocated(cascade[0].family, special, 96)
        assert found.residual < 1e-8
        assert special.parameter == pytest.approx(found.parameter, rel=1e-9)
    steps = np.diff(values)
    assert steps[:-1] / steps[1:] == pytest.approx(FEIGENBAUM, rel=2e-3)


def test_the_pendulum_doubles_gently_by_the_series_of_the_map(cascade: list[periodic.Branch]) -> None:
    for branch in cascade:
        form = periodic.normal_form(branch.family, branch.special[0])
        exact = oscillator.cubic_coefficient(*of_a_map(branch.special[0]))
        assert form.words == "supercritical"
        # the map of eight turns has the largest third derivatives, and the most uncertain differences of them
        assert form.coefficient == pytest.approx(exact, rel=3e-3 if branch.turns < 8 else 2e-2)
        assert abs(form.coefficient - exact) < 2.0 * form.uncertainty + 1e-6 * exact


def test_each_doubled_motion_of_the_pendulum_is_stable_until_it_doubles(cascade: list[periodic.Branch]) -> None:
    for branch in cascade:
        after = branch.special[0].after
        assert set(branch.stability()[1 : after + 1]) == {periodic.Stability.STABLE}
        assert set(branch.stability()[after + 1 :]) == {periodic.Stability.UNSTABLE}


def test_frequency_response_doubles_again_as_often_as_asked() -> None:
    parameters, drive = pendulum(1.06)
    # the strength of the excitation by its FMI name
    low, high = 1.06 * NATURAL**2, 1.083 * NATURAL**2
    start = min(
        periodic.find_orbits(parameters, speed=DRIVEN).stable, key=lambda orbit: abs(orbit.start[0] + 0.5 * pi)
    ).start
    fine = {"doublings": 3, "greatest_step": 2e-2}
    response = periodic.frequency_response(
        parameters, low, high, drive=drive, vary="rotor.excitation", start=start, **fine
    )
    own = [branch for branch in response.branches if branch.orbits[0].start[0] < 0.0][:1]
    own += [branch for branch in response.branches if branch.turns > 1]
    assert [branch.turns for branch in own] == [1, 2, 4, 8]
    assert not response.problems
    values = [branch.special[0].parameter / NATURAL**2 for branch in own]
    assert values == pytest.approx(PENDULUM_DOUBLINGS, abs=1e-4)


# An isola: parametric resonance of a hardening spring, k + m cos w t, that a small torque T cos w t takes apart. Without the
# torque a motion and its mirror image leave the rest between two pitchforks and meet again; with it one of them is closed

TONGUE = torsion.Parameters(
    rotor_stiffness=1.0, rotor_damping=0.05, rotor_cubic_stiffness=0.2, rotor_modulation=0.8, rotor_excitation=0.02,
)  # fmt: skip


def test_the_motions_of_an_isola_are_found_and_followed_until_they_close() -> None:
    response = periodic.frequency_response(TONGUE, 0.8, 1.5, greatest_step=2e-2)
    assert not any(branch.closed for branch in response.branches)
    whole = periodic.with_isolas(response, places=1, greatest_step=2e-2)
    assert whole.branches[:-1] == response.branches
    isola = whole.branches[-1]
    assert isola.closed
    assert [special.kind for special in isola.special] == [periodic.Crossing.FOLD, periodic.Crossing.FOLD]
    for special in isola.special:
        found = collocated(isola.family, special, 128)
        assert special.parameter == pytest.approx(found.parameter, rel=1e-9)
    ends = sorted(special.parameter for special in isola.special)
    assert [isola.parameter.min(), isola.parameter.max()] == pytest.approx(ends, rel=1e-3)
    # nothing is left to be found, and what was there is not found twice
    assert len(periodic.with_isolas(whole, places=2, greatest_step=2e-2).branches) == len(whole.branches)
    with pytest.raises(InputError, match="places is 0"):
        periodic.with_isolas(response, places=0)


@pytest.mark.slow
def test_the_command_line_says_which_motions_are_closed(linkwork: Callable[..., Result]) -> None:
    settings = [("damping", 0.05), ("cubic_stiffness", 0.2), ("modulation", 0.8), ("excitation", 0.02)]
    about = ["--published", "torsion-demo", *(word for name, v in settings for word in ("--set", f"rotor.{name}={v}"))]
    ends = ["--from", "0.9 rad/s", "--to", "1.4 rad/s", "--doublings", "0", "--places", "1", "--no-plot"]
    result = linkwork("resonance", *about, *ends)
    assert result.output.count("closed") == 1
