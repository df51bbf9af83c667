"""All periodic motions at a point: what single guesses missed, and that two methods and the sum of indices agree."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from analysis import Function, InductionMotor, Inputs, find_orbit, find_orbits, periodic, simulate, variant
from analysis.linkages import linkage
from analysis.periodic import Crossing, Drive, OrbitError, Risk, Stability, basins, frequency_response, newton_orbit
from analysis.periodic.motion.drive import assembly_ranges, spread_starts
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import AssemblyError, ParameterError
from linkwork.five_bar.assembly import check_assembly
from linkwork.five_bar.published import SETS

RIG_1_B = SETS["rig-1-spring-b"].parameters
TABLE_3_1 = SETS["table-3.1"].parameters


def test_a_resonant_motion_that_newtons_method_misses() -> None:
    """Harmonic balance and 120 turns of an independent run gave an amplitude of 13.8 cm and a multiplier of 0.93546."""
    parameters, speed = replace(RIG_1_B, slider_damping=2.0), 1076.7 * RAD_S_PER_RPM
    orbit = find_orbit(parameters, speed=speed)
    assert orbit.amplitude == pytest.approx(0.138, abs=5e-4)
    assert orbit.largest == pytest.approx(0.93546, abs=5e-6)
    with pytest.raises(OrbitError):
        newton_orbit(parameters, Drive(speed=speed), settle=False)


def test_one_motion_is_found_where_all_of_them_are() -> None:
    """None of the first 64 starts leads to the only motion there is."""
    parameters, drive = replace(RIG_1_B, slider_damping=2.0), Drive(speed=1031.5 * RAD_S_PER_RPM)
    (only,) = find_orbits(parameters, speed=drive.speed)
    assert newton_orbit(parameters, drive).start == pytest.approx(only.start, rel=1e-8)


def test_starts_fill_a_range_that_is_wider_on_one_side() -> None:
    """With a coupler of 20 cm the slider goes from -6 to 24 cm: both sides are searched, not the nearer one alone."""
    parameters, guess = replace(TABLE_3_1, coupler_length=0.2), np.zeros(2)
    low, high = assembly_ranges(parameters, Drive(speed=40.0), guess)
    for end in (low[0], high[0]):
        check_assembly(0.0, end / 1.25, parameters.constants())
        with pytest.raises(AssemblyError):
            check_assembly(0.0, end, parameters.constants())
    starts = spread_starts(parameters, Drive(speed=40.0), guess, 64)
    assert starts[:, 0].min() < 0.7 * low[0]
    assert starts[:, 0].max() > 0.7 * high[0] > 2.0 * -low[0]
    assert np.ptp(starts[:, 1]) > 40.0 * (high[0] - low[0]) * 0.7


def test_starts_stay_where_a_stiffening_spring_is_not_too_stiff() -> None:
    """Also if links limit the room: the search there took minutes."""
    built = linkage("stiff", ground={"A": (0, 0), "O": (0.15, 0)}, assembly={"C": 1})
    built.body("crank", bar=("A", "B"), length=0.05, mass=0.1)
    built.body("coupler", bar=("B", "C"), length=0.15, mass=0.2).body("rocker", bar=("D", "C"), length=0.15, mass=0.2)
    built.body("block", points={"D": (0, 0)}, mass=0.6).slide("G", body="block", through="O")
    built.spring("spring", at="G", stiffness=1e3, damping=30.0, law="1e9*x**3")
    rig = built.freedom("crank", "A", speed=44.0).freedom("slider", "G").mechanism().first_set.parameters
    starts = spread_starts(rig, Drive(speed=44.0), np.zeros(2), 64)
    assert 0.02 < np.abs(starts[:, 0]).max() < 0.05  # 1e9 x^2 / 0.8 < (30 * 44)^2


def duffing(length: float, law: str = "2.5e6*x**3") -> str:
    """Describe an unbalanced rotor on a sprung carriage, Duffing's equation, with bodies of any length; return its name."""
    built = linkage(f"duffing-{length:.0f}", ground={"A": (0, 0)})
    built.body("carriage", points={"P": (0, 0), "C": (0, 0), "Q": (length, 0)}, mass=1.0)
    built.slide("guide", body="carriage", on="ground", through="A", direction=0)
    built.body("rotor", points={"C": (0, 0), "R": (length, 0)}, mass=0.05, cog=(0.01, 0), inertia=1e-4)
    built.spring("spring", at="guide", stiffness=900.0, damping=1.0, law=law)
    return built.freedom("carriage", "guide").freedom("rotor", "C", speed=36.0).mechanism().name


@pytest.mark.parametrize("length", [0.1, 2.0])
def test_motions_much_smaller_than_the_bodies_are_found(length: float) -> None:
    """Amplitudes by harmonic balance."""
    speed = 36.0
    rest, bend, damping, force = 900.0 - 1.05 * speed**2, 0.75 * 2.5e6, 1.0 * speed, 0.05 * 0.01 * speed**2
    squares = np.roots([bend**2, 2.0 * rest * bend, rest**2 + damping**2, -(force**2)])
    found = find_orbits(duffing(length), speed=speed)
    assert [orbit.amplitude for orbit in found.orbits] == pytest.approx(sorted(np.sqrt(squares.real)), rel=0.01)


def test_doubled_branches_do_not_depend_on_the_length_of_the_bodies() -> None:
    found = []
    for length in (0.02, 2.0):
        rig = variant(duffing(length, "8e4*x**2 + 2.5e6*x**3"), spring_damping=0.5)
        response = frequency_response(rig, 45.0, 75.0, doublings=1)
        assert [branch.turns for branch in response.branches] == [1, 2]
        found.append([(a.risk, pytest.approx((a.low, a.high), abs=1e-4)) for a in response.speeds_to_avoid])
    assert [risk for risk, _ in found[0]] == [Risk.SEVERAL, Risk.DOUBLED]
    assert [(a.risk, (a.low, a.high)) for a in response.speeds_to_avoid] == found[0]


def test_two_motions_of_a_symmetric_machine_are_found_where_newtons_method_mostly_fails() -> None:
    """Each is the mirror image of the other, half a turn later."""
    rig = variant(duffing(0.1), rotor_cog_x=1.0, spring_damping=1.5)
    found = find_orbits(rig, speed=30.03)
    first, second = found.stable
    mirrored = -second.sample(pi)[0, list(second.flow.places)]
    assert mirrored == pytest.approx(first.start, rel=1e-6)
    assert (found.agreed, len(found)) == (True, 3)


def test_basins_do_not_depend_on_the_length_of_the_bodies() -> None:
    plane = {"position": (-0.025, 0.025), "rate": (-0.9, 0.9)}
    short, long = (basins(duffing(length), Drive(speed=36.0), points=6, **plane) for length in (0.1, 2.0))
    assert short.ends.tolist() == long.ends.tolist()
    assert set(short.ends.ravel()) == {0, 1}


def test_basins_of_vibrations_that_are_slow_beside_the_crank_are_those_of_a_runge_kutta_method() -> None:
    """Ten turns of an unbalance per vibration in one of two wells: there a rate of 1 % of the scale leaves the well."""
    built = linkage("wells", ground={"O": (0, 0)})
    built.body("carriage", points={"P": (0, 0)}, mass=1.0)
    built.body("rotor", bar=("P", "E"), length=0.1, mass=1.0, cog=(5e-4, 0), inertia=0.01)
    built.slide("rail", body="carriage", through="O")
    built.spring("wells", at="rail", law="4e6*x**3 - 100*x + 4*v")
    rig = built.freedom("rotor", "P", speed=100.0).freedom("across", "rail").mechanism().first_set.parameters
    found = basins(rig, Drive(speed=100.0), points=8, position=(-0.006, -0.004), rate=(-0.1, 0.1))

    def rates(angle: float, y: np.ndarray) -> np.ndarray:
        x, v = y
        force = 0.05 * 100.0 * np.cos(angle) - 4e6 * x**3 + 100.0 * x - 4.0 * v
        return np.array([v, 0.5 * force]) / 100.0

    y, h = np.array(np.meshgrid(found.position, found.rate)), 2.0 * pi / 32.0
    for n in range(32 * 150):
        a = rates(n * h, y)
        b = rates((n + 0.5) * h, y + 0.5 * h * a)
        c = rates((n + 0.5) * h, y + 0.5 * h * b)
        y = y + h / 6.0 * (a + 2.0 * (b + c) + rates((n + 1) * h, y + h * c))
    starts = np.array([motion.start for motion in found.motions])
    apart = np.abs(y[0] - starts[:, 0, None, None])
    assert apart.min(axis=0).max() < 1e-6
    assert found.ends.tolist() == apart.argmin(axis=0).tolist()
    assert len(set(found.ends.ravel())) == 2


@pytest.mark.parametrize("damping", [0.75, 0.8, 1.0])
def test_a_resonance_beside_a_fold_is_found(damping: float) -> None:
    """Peak by harmonic balance, where the backbone meets the amplitude that the damper allows; a fold is within 1e-4 of it."""
    rig = variant(duffing(0.1), spring_damping=damping)
    response = frequency_response(rig, 10.0, 90.0)
    (peak,) = response.maxima()
    ratio = 0.05 * 0.01 / damping
    speed = np.sqrt(900.0 / (1.05 - 0.75 * 2.5e6 * ratio**2))
    assert (peak.parameter, peak.amplitude) == (pytest.approx(speed, rel=0.06), pytest.approx(ratio * speed, rel=0.06))
    avoided = [a for a in response.speeds_to_avoid if a.risk is Risk.RESONANCE and a.high > 32.0]
    assert [a.high for a in avoided] == [pytest.approx(peak.parameter, rel=1e-4)]


def test_a_pitchfork_that_a_step_leaps_over_is_no_fold() -> None:
    """At 24.8806 rad/s mirror images end, by an independent monodromy matrix, without a jump."""
    built = linkage("mirrored", ground={"O": (0, 0)})
    built.body("carriage", points={"P": (0, 0)}, mass=1.0)
    built.body("rotor", bar=("P", "E"), length=0.1, mass=1.0, cog=(0.08, 0), inertia=0.01)
    built.slide("rail", body="carriage", through="O").spring("spring", at="rail", law="100*x + 4e6*x**3 + 2*v")
    rig = built.freedom("rotor", "P", speed=20.0).freedom("across", "rail").mechanism().first_set.parameters
    response = frequency_response(rig, 8.0, 60.0, doublings=0, greatest_step=1e-2)
    special = [s for branch in response.branches for s in branch.special]
    assert {s.kind for s in special} == {Crossing.FOLD, Crossing.BRANCH_POINT}
    for s in special:
        assert np.abs(s.orbit.multipliers - 1.0).min() < 1e-5
        assert s.kind is Crossing.FOLD or s.parameter == pytest.approx(24.8806, abs=1e-4)
    assert [(jump.direction, jump.parameter) for jump in response.jumps] == [
        (-1, pytest.approx(15.69128, abs=1e-4)), (1, pytest.approx(18.76291, abs=1e-4)),
    ]  # fmt: skip
    for jump in response.jumps:
        assert jump.after
        assert max(jump.after) < 0.99 * jump.before


def test_a_resonance_at_a_fold_has_a_gradient() -> None:
    def peak(damping: float) -> tuple[periodic.Extremum, periodic.Family]:
        response = frequency_response(variant(duffing(0.1), spring_damping=damping), 10.0, 90.0)
        return response.maxima()[0], response.family

    top, family = peak(0.75)
    high, low = peak(0.75075)[0], peak(0.74925)[0]
    found = periodic.special_gradient(family, top, ["spring.damping"])
    assert found.place.by == pytest.approx([(high.parameter - low.parameter) / 1.5e-3], rel=1e-3)
    assert found.amplitude.by == pytest.approx([(high.amplitude - low.amplitude) / 1.5e-3], rel=1e-3)


@pytest.mark.parametrize("rpm", [980.0, 1020.0])
def test_three_motions_where_the_response_bends_over(rpm: float) -> None:
    found = find_orbits(RIG_1_B, speed=rpm * RAD_S_PER_RPM)
    words = [orbit.verdict().stability for orbit in found.orbits]
    assert words == [Stability.STABLE, Stability.UNSTABLE, Stability.STABLE]
    assert found.agreed
    assert found.index == 1
    amplitudes = [orbit.amplitude for orbit in found.orbits]
    assert amplitudes == sorted(amplitudes)
    assert "2 stable, 1 unstable" in repr(found)


def test_of_several_the_one_is_found_that_a_machine_meets_from_rest() -> None:
    speed = 1000.0 * RAD_S_PER_RPM
    met = find_orbit(RIG_1_B, speed=speed)
    # up slowly from below, step by step
    up = periodic.sweep(RIG_1_B, np.linspace(300.0, 1000.0, 36) * RAD_S_PER_RPM).orbits[-1]
    assert met.start == pytest.approx(up.start, abs=1e-9)
    assert met.others == 2
    assert "2 other motions there: find_orbits" in repr(met)


@pytest.mark.parametrize(
    ("name", "damping", "torque", "amplitude"),
    [("2-spring-d", 3.0, 0.06, 0.02161), ("2-spring-c", 5.5, 0.05, 0.01698), ("1-spring-b", 9.0, 1.5, 0.05048)],
)
def test_under_a_motor_whose_frequency_rises_slowly_the_crank_is_captured_at_the_resonance(
    name, damping, torque, amplitude
) -> None:
    """A run in time, from rest, with the field's speed rising over 60 s, ends on the motion that is found."""
    parameters = replace(SETS[f"rig-{name}"].parameters, slider_damping=damping)
    full = 1.3 * periodic.natural_frequency(parameters)
    motor = InductionMotor(breakdown_torque=torque, breakdown_slip=0.3, synchronous_speed=full)
    met = find_orbit(parameters, torque=motor)
    assert met.amplitude == pytest.approx(amplitude, abs=1e-5)

    def rising(t: float, angle: float, u: float, speed: float, v: float) -> float:
        slip = 1.0 - speed / (full * (0.1 + 0.9 * min(t / 60.0, 1.0)))
        return float(2.0 * torque * slip * 0.3 / (slip * slip + 0.3 * 0.3))

    run = simulate(parameters, Inputs(torque=Function(rising)), stop_time=90.0, step=5e-3)
    last = run["slider.position"][-1000:]
    assert 0.5 * np.ptp(last) == pytest.approx(amplitude, rel=2e-3)


def test_motions_far_from_the_zero_of_the_slider() -> None:
    """A mechanism whose crank cannot turn with the slider at zero turns with it elsewhere, as a long run confirms."""
    parameters = replace(TABLE_3_1, coupler_length=0.06)
    orbit = find_orbit(parameters, speed=40.0)
    assert orbit.verdict().stability is Stability.STABLE
    assert periodic.confirm(parameters, Drive(speed=40.0), start=orbit.start).agrees
    with pytest.raises(OrbitError):
        newton_orbit(parameters, Drive(speed=40.0), settle=False)


def test_no_motion_where_the_crank_is_longer_than_the_other_links() -> None:
    impossible = replace(TABLE_3_1, crank_length=0.5)
    assert len(find_orbits(impossible, speed=40.0)) == 0
    with pytest.raises(OrbitError, match="cannot be joined"):
        find_orbit(impossible, speed=40.0)


def test_a_motion_of_two_turns_is_counted_once_and_one_of_a_single_turn_not_at_all() -> None:
    parameters = replace(SETS["rig-2-spring-c"].parameters, slider_damping=0.5)
    speed = 1170.0 * RAD_S_PER_RPM
    simple, doubled = find_orbits(parameters, speed=speed), find_orbits(parameters, speed=speed, turns=np.array([2]))
    assert [orbit.verdict().stability for orbit in simple.orbits] == [Stability.UNSTABLE]
    (orbit,) = doubled.orbits
    assert orbit.verdict().stability is Stability.STABLE
    assert orbit.turn().harmonic("slider.position", 0.5) > 1e-3
    assert doubled.index == 1


def test_under_a_motor_the_crank_speed_is_found_too() -> None:
    speeds = [orbit.start[-1] for orbit in find_orbits(TABLE_3_1, torque=0.4, start=(0.0, 0.0, 44.0)).orbits]
    direct = find_orbit(TABLE_3_1, torque=0.4, start=(0.0, 0.0, 44.0), settle=False)
    assert any(speed == pytest.approx(direct.start[-1], rel=1e-9) for speed in speeds)


def test_turns_must_be_a_whole_number() -> None:
    for turns in (0, 1.5, "two", [1, 0], []):
        with pytest.raises(ParameterError, match="turns is"):
            find_orbits(TABLE_3_1, speed=14.0 * pi, turns=turns)
