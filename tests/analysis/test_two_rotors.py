"""A mechanism with two cranks through every analysis: two unbalanced rotors on one sprung, damped cart.

At commanded speeds the cart is a linear oscillator under two harmonic forces, so that motion, multipliers and resonance are
known in closed form.
"""

from collections.abc import Callable
from fractions import Fraction
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy
from click.testing import Result

from analysis import (
    InductionMotor,
    Inputs,
    Wish,
    compare,
    cosimulate,
    figures,
    frequency_response,
    natural_modes,
    periodic,
    ramp,
    simulate,
    simulate_many,
    steps,
    tune,
)
from analysis.cli.vibration import _report_verdict
from analysis.export import NATIVE, NATIVE_FMI3, build, build_native
from analysis.linear import find_equilibrium, linearise, linearise_orbit
from analysis.mechanisms import register
from analysis.periodic.motion.orbit import first_guess
from analysis.run import load_case
from analysis.studio.tables import mechanism_tables
from linkwork.errors import InputError

from ..mechanisms.two_rotors import MECHANISM

DEMO = MECHANISM.published["two-rotors-demo"]
P = DEMO.parameters
K = P.constants()
RATIOS = [Fraction(1), Fraction(2), Fraction(3, 2), Fraction(-1)]


@pytest.fixture(scope="module", autouse=True)
def _registered() -> None:
    register(MECHANISM)


def _drive(speed: float, ratio: Fraction, phase: float = 0.0) -> periodic.Drive:
    return periodic.Drive(
        speeds={"left.speed": speed, "right.speed": float(ratio) * speed}, held={"right.angle": phase}
    )


def _cart(speeds: tuple[float, ...], phases: tuple[float, ...], t: Any) -> Any:
    """Return the steady position of the cart at times t: M s'' + c s' + k s = sum U w2 cos(w t + phase)."""
    s = np.zeros_like(np.asarray(t, dtype=float))
    for w, phase, unbalance in zip(speeds, phases, (K.unbalance1, K.unbalance2)):
        size = unbalance * w * w / (K.k - K.mass * w * w + 1j * K.c * w)
        s = s + (size * np.exp(1j * (w * t + phase))).real
    return s


@pytest.mark.parametrize("ratio", RATIOS, ids=str)
def test_the_motion_at_commanded_speeds_is_the_closed_form(ratio: Fraction) -> None:
    speed, phase = 21.0, 0.4
    orbit = periodic.newton_orbit(P, _drive(speed, ratio, phase))
    turns = ratio.denominator
    assert orbit.flow.period == pytest.approx(2.0 * pi * turns)
    turn = orbit.turn(256)
    assert turn.period == pytest.approx(2.0 * pi * turns / speed, rel=1e-12)
    wanted = _cart((speed, float(ratio) * speed), (0.0, phase), turn.time)
    np.testing.assert_allclose(turn["cart.position"], wanted, atol=1e-10 * np.abs(wanted).max())
    np.testing.assert_allclose(turn["right.angle"], phase + float(ratio) * turn["left.angle"], atol=1e-12)
    # the multipliers are those of the free oscillator over the common period
    roots = np.roots([K.mass, K.c, K.k])
    right = np.exp(roots * turn.period)
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), np.sort_complex(right), rtol=1e-8)
    assert orbit.determinant_by_liouville() == pytest.approx(np.exp(-K.c / K.mass * turn.period), rel=1e-8)


def test_the_search_for_a_motion_begins_with_the_other_crank_at_its_ratio() -> None:
    # on its motor the right rotor turns freely, one and a half times for each turn of the left one
    motor = InductionMotor(breakdown_torque=0.2, breakdown_slip=0.2, synchronous_speed=61.0)
    ratios, motors = {"right.speed": Fraction(3, 2)}, {"right.torque": motor}
    drive = periodic.Drive(speed=40.0, crank="left.speed", ratios=ratios, motors=motors)
    flow = drive.flow(MECHANISM)
    guess = first_guess(flow, drive, None)
    assert dict(zip((name for name, _ in flow.components), guess))["right.speed_out"] == pytest.approx(60.0)


def test_a_run_settles_on_it_and_the_balance_closes() -> None:
    speeds = {"left_speed": 20.0, "right_speed": 30.0}
    run = simulate(P, Inputs(**speeds), initial=DEMO.initial, stop_time=16.0, step=1e-3, tolerance=1e-11)
    late = run.time > 14.0
    wanted = _cart((20.0, 30.0), (0.0, 0.0), run.time[late])
    np.testing.assert_allclose(run["cart.position"][late], wanted, atol=1e-6 * np.abs(wanted).max())
    assert np.abs(run["energy.residual"]).max() < 1e-9


def test_what_varies_by_default_is_the_speed_of_the_crank_of_the_drive() -> None:
    drive = periodic.Drive(speed=30.0, crank="right.speed", ratios={"left.angle": 1})
    assert periodic.Family(parameters=P, drive=drive).vary == "right.speed"
    assert periodic.Family(parameters=P, drive=_drive(20.0, Fraction(1))).vary == "left.speed"


def test_linear_models_along_a_motion_go_through_the_common_period_of_both_cranks() -> None:
    """Of an orbit over the angle of either crank; the steady position is the closed form."""
    speed, ratio = 20.0, Fraction(3, 2)
    period = 2.0 * pi * ratio.denominator / speed
    wanted = _cart((speed, 30.0), (0.0, 0.0), np.arange(64) * period / 64)
    place = [f.coordinate for f in MECHANISM.freedoms].index("cart.position")
    for orbit in (
        periodic.newton_orbit(P, _drive(speed, ratio)),
        periodic.newton_orbit(P, periodic.Drive(speed=30.0, crank="right.speed", ratios={"left.angle": 1 / ratio})),
    ):
        model = linearise_orbit(P, orbit, samples=64)
        assert model.period == pytest.approx(period)
        np.testing.assert_allclose(model.states[:, place], wanted, atol=1e-8 * np.abs(wanted).max())
        angles = model.states[:, :2] - model.states[0, :2]
        np.testing.assert_allclose(angles[:, 1], 1.5 * angles[:, 0], atol=1e-9)
    with pytest.raises(InputError, match="no common period"):
        periodic.Drive(speeds={"left.speed": speed, "right.speed": 30.0001})


def _slope(t: float, x: np.ndarray, torque: Any) -> np.ndarray:
    """Return the rates of both angles, cart, by the mass matrix: the left rotor's speed is held, a torque drives the right."""
    th1, th2, s, w1, w2, v = x
    b2 = K.unbalance2 * np.sin(th2)
    mass = np.array([[K.inertia2, -b2], [-b2, K.mass]])
    force = K.unbalance1 * np.cos(th1) * w1**2 + K.unbalance2 * np.cos(th2) * w2**2 - K.k * s - K.c * v
    acceleration = np.linalg.solve(mass, [torque(w2), force])
    return np.array([w1, w2, v, 0.0, *acceleration])


def test_a_rotor_on_a_motor_locks_to_the_commanded_one_with_the_multipliers_of_an_independent_monodromy() -> None:
    motor = InductionMotor(breakdown_torque=0.05, breakdown_slip=0.2, synchronous_speed=24.1)
    drive = periodic.Drive(speed=24.0, crank="left.speed", ratios={"right.angle": 1}, motors={"right.torque": motor})
    initial, times = MECHANISM.initial(left_speed=24.0, right_speed=24.0), 2.0 * pi / 24.0 * np.arange(401)
    inputs = Inputs(left_speed=24.0, right_torque=motor)
    found = simulate(P, inputs, initial=initial, samples=times, stop_time=times[-1], tolerance=1e-11)
    last = [found[name][-1] for name in ("right.angle", "cart.position", "right.speed_out", "cart.velocity")]
    last[0] -= 400 * 2.0 * pi
    orbit = periodic.newton_orbit(P, drive, start=last)
    assert orbit.flow.components[0][0] == "right.angle"

    def torque(w: float) -> float:
        slip = (motor.synchronous_speed - w) / motor.synchronous_speed / motor.breakdown_slip
        return 2.0 * motor.breakdown_torque * slip / (1.0 + slip * slip)

    def turned(y: np.ndarray) -> np.ndarray:
        th2, s, w2, v = y
        tight, start = {"rtol": 1e-12, "atol": 1e-13, "args": (torque,)}, [0.0, th2, s, 24.0, w2, v]
        state = scipy.integrate.solve_ivp(_slope, (0.0, 2.0 * pi / 24.0), start, "DOP853", **tight).y[:, -1]
        return np.array([state[1] - 2.0 * pi, state[2], state[4], state[5]])

    np.testing.assert_allclose(turned(orbit.start), orbit.start, rtol=1e-8, atol=1e-9)
    step = 1e-5
    columns = [(turned(orbit.start + step * e) - turned(orbit.start - step * e)) / (2.0 * step) for e in np.eye(4)]
    ours, right = np.linalg.eigvals(np.column_stack(columns)), np.sort_complex(orbit.multipliers)
    np.testing.assert_allclose(np.sort_complex(ours), right, atol=1e-6)
    response = frequency_response(P, 23.95, 24.05, drive=drive, vary="left.speed", start=orbit.start, doublings=0)
    assert not response.problems
    at = min(response.branches[0].orbits, key=lambda point: abs(point.drive.speed - 24.0))
    again = periodic.newton_orbit(P, at.drive, start=at.start, settle=False)
    np.testing.assert_allclose(again.start, at.start, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize(("right", "ratio"), [(20.3, 1), (30.0, Fraction(3, 2)), (41.0, 2)])
def test_rotors_on_motors_have_the_ratio_of_their_first_speeds_and_are_held_for_natural_frequencies(
    right: float, ratio: Fraction
) -> None:
    motor = InductionMotor(breakdown_torque=0.05, breakdown_slip=0.2, synchronous_speed=24.1)
    initial = MECHANISM.initial(left_speed=20.0, right_speed=right)
    for inputs in (Inputs(left_torque=motor, right_torque=motor), Inputs(left_speed=20.0, right_torque=motor)):
        assert periodic.steady_drive(P, inputs, initial).ratios == {"right.angle": ratio}
        modes = natural_modes(P, inputs, initial=initial)
        assert modes.coordinates == ("cart.position",)
        np.testing.assert_allclose(modes.frequencies, sqrt(K.k / K.mass), rtol=1e-3)
        turned = np.ptp([rest.coordinates[1] for rest in modes.equilibria])
        assert turned == pytest.approx(2.0 * pi * ratio * Fraction(ratio).denominator * 35 / 36)
    with pytest.raises(InputError, match="constant"):  # a torque that varies in time is no motor
        natural_modes(P, Inputs(left_speed=20.0, right_torque=ramp(0.0, 0.1, "0 s", "1 s")), initial=initial)


def test_a_motor_is_reversed_by_two_of_its_numbers() -> None:
    motor = InductionMotor(breakdown_torque=0.05, breakdown_slip=0.2, synchronous_speed=24.0)
    drive = periodic.Drive(speed=24.0, crank="left.speed", ratios={"right.angle": -1}, motors={"right.torque": motor})
    back = {"right.torque.breakdown_torque": -0.05, "right.torque.synchronous_speed": -24.0}
    assert periodic.with_values(P, drive, back)[1].motors["right.torque"].synchronous_speed == -24.0


def test_speeds_without_a_common_period_and_drives_that_say_too_little_are_refused() -> None:
    with pytest.raises(InputError, match=r"left\.speed.*right\.speed"):
        periodic.Drive(speeds={"left.speed": 20.0, "right.speed": 20.0 * sqrt(2.0)})
    with pytest.raises(InputError, match=r"left\.angle, right\.angle"):
        periodic.newton_orbit(P, periodic.Drive(speed=20.0))
    with pytest.raises(InputError, match=r"right\.angle"):
        periodic.newton_orbit(P, periodic.Drive(speed=20.0, crank="left.speed", forces={"right.torque": 0.01}))


@pytest.mark.parametrize("ratio", [Fraction(1), Fraction(2), Fraction(3, 2)], ids=str)
def test_the_response_scales_all_commanded_speeds_together(ratio: Fraction) -> None:
    response = frequency_response(P, 18.0, 32.0, drive=_drive(20.0, ratio), vary="left.speed")
    for orbit in response.branches[0].orbits[::5]:
        speed = orbit.drive.speed
        t = np.linspace(0.0, 2.0 * pi * ratio.denominator / speed, 4001)
        wanted = _cart((speed, float(ratio) * speed), (0.0, 0.0), t)
        assert orbit.amplitude == pytest.approx(0.5 * np.ptp(wanted), rel=1e-5)
    low, high = 18.0 * float(ratio), 32.0 * float(ratio)
    over_right = frequency_response(P, low, high, drive=_drive(20.0, ratio), vary="right.speed")
    tops, others = response.maxima(), over_right.maxima()
    assert [top.amplitude for top in tops] == pytest.approx([top.amplitude for top in others], rel=1e-6)
    assert periodic.natural_frequency(P) == pytest.approx(sqrt(K.k / K.mass), rel=0.02)


def test_the_chart_has_the_multiplier_of_the_free_oscillator() -> None:
    ranges = {"ranges": ((18.0, 30.0), (5.0, 20.0)), "points": 5}
    chart = periodic.stability_chart(P, _drive(20.0, Fraction(3, 2)), ("left.speed", "cart.damping"), **ranges)
    for row, damping in enumerate(chart.grid.y):
        for column, speed in enumerate(chart.grid.x):
            wanted = np.exp(-0.5 * damping / K.mass * 4.0 * pi / speed)
            assert chart.grid.largest[row, column] == pytest.approx(wanted, rel=1e-6)
    assert not chart.boundaries


def test_every_search_finds_the_one_motion_there_is() -> None:
    ratio, turns = Fraction(3, 2), 2
    inputs = Inputs(left_speed=20.0, right_speed=30.0)
    met, (known,) = periodic.find_orbit(P, inputs), periodic.find_orbits(P, inputs).orbits
    for orbit in (met, known):
        turn = orbit.turn(256)
        wanted = _cart((20.0, 30.0), (0.0, 0.0), turn.time)
        np.testing.assert_allclose(turn["cart.position"], wanted, atol=1e-8 * np.abs(wanted).max())
    speeds = np.array([18.0, 19.0, 20.0])
    times = 2.0 * pi * turns / speeds[:, None] * np.linspace(0.0, 1.0, 100_001)
    pairs = [(w, float(ratio) * w) for w in speeds.tolist()]
    swings = [0.5 * np.ptp(_cart(pair, (0.0, 0.0), t)) for pair, t in zip(pairs, times, strict=True)]
    up = periodic.sweep(P, speeds, drive=_drive(18.0, ratio))
    assert [orbit.amplitude for orbit in up.orbits if orbit] == pytest.approx(swings, rel=1e-6)
    operation = periodic.plane(P, _drive(20.0, ratio), "left.speed", "cart.damping")
    found = periodic.coexistence(operation, speeds, [1.0, 2.0])
    assert found.count.tolist() == [[1, 1, 1], [1, 1, 1]]
    decay = np.exp(-np.array([[1.0], [2.0]]) * pi * turns / (speeds * K.mass))
    np.testing.assert_allclose(found.largest[:, :, 0], decay, rtol=1e-6)
    all_of_it = periodic.basins(P, _drive(20.0, ratio), points=10)
    assert [orbit.amplitude for orbit in all_of_it.motions] == pytest.approx(swings[2:], rel=1e-6)
    assert (all_of_it.ends == 0).all()


def test_a_common_period_of_many_turns_has_as_many_samples_in_each() -> None:
    """In 256 and in 64 samples of eleven turns the greatest values lie up to a hundredth lower."""
    speeds, drive = (20.0, 20.0 * 13 / 11), _drive(20.0, Fraction(13, 11))
    wanted = _cart(speeds, (0.0, 0.0), np.linspace(0.0, 22.0 * pi / 20.0, 100_001))
    turn = periodic.newton_orbit(P, drive).turn()
    swing = turn["cart.position"].max(), turn["cart.position"].min()
    assert swing == pytest.approx((wanted.max(), wanted.min()), rel=3e-4)
    found = periodic.coexistence(periodic.plane(P, drive, "left.speed", "cart.damping"), [20.0], [P.cart_damping])
    assert found.amplitude[0, 0, 0] == pytest.approx(0.5 * np.ptp(wanted), rel=1e-4)


def test_the_motion_changes_with_the_parameters_of_the_cart_and_of_both_rotors_as_its_closed_form_does() -> None:
    speeds, unbalances = np.array([20.0, 30.0]), np.array([K.unbalance1, K.unbalance2])
    motion = periodic.motion_gradient(periodic.newton_orbit(P, _drive(20.0, Fraction(3, 2))))
    stiff = K.k - K.mass * speeds**2 + 1j * K.c * speeds
    parts = unbalances * speeds**2 / stiff
    expected = {
        "left.radius": parts[0] / P.left_radius,
        "right.radius": parts[1] / P.right_radius,
        "cart.stiffness": (-parts / stiff).sum(),
        "cart.damping": (-1j * speeds * parts / stiff).sum(),
    }
    position = [name for name, _ in motion.orbit.flow.components].index("cart.position")
    for name, value in expected.items():
        assert motion.start[position, motion.names.index(name)] == pytest.approx(value.real, rel=1e-7)
    period = 2.0 * pi * 2 / 20.0
    largest = np.exp(-K.c * period / (2.0 * K.mass))
    assert motion.largest["cart.damping"] == pytest.approx(-largest * period / (2.0 * K.mass), rel=1e-8)


@pytest.mark.slow
def test_the_linear_model_has_the_poles_of_the_cart() -> None:
    rest = find_equilibrium(P)
    model = linearise(P, rest.state, rest.inputs)
    poles = model.poles[np.abs(model.poles) > 1e-6]  # the others are of the rotors, which nothing holds
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(np.roots([K.mass, K.c, K.k])), rtol=1e-9)


@pytest.mark.parametrize("ratio", [Fraction(2), Fraction(3, 2)], ids=str)
def test_tuning_clears_the_range_of_the_resonance(ratio: Fraction) -> None:
    natural = sqrt(K.k / K.mass)
    asked = {"over": "left.speed", "between": (0.97 * natural, 1.03 * natural), "no_resonance": True}
    tuned = tune(Wish(parameters=P, drive=_drive(10.0, ratio), change={"cart.stiffness": "60 %"}, **asked))
    assert tuned.met
    moved = sqrt(tuned.parameters.cart_stiffness / K.mass)
    assert not 0.97 * natural < moved < 1.03 * natural


def test_a_case_file_an_ensemble_and_the_command_line(linkwork: Callable[..., Result], tmp_path: Path) -> None:
    (tmp_path / "rotors.toml").write_text(
        'mechanism = "two-rotors"\npublished = "two-rotors-demo"\n'
        '[left]\nspeed = "100 rpm"\n[right]\ntorque = "10 mN.m"\n[run]\nstop_time = 0.2\nstep = 1e-3\n'
    )
    case = load_case(tmp_path / "rotors.toml")
    inputs = Inputs(left_speed=100.0 * pi / 30.0, right_torque=0.01)
    one = simulate(P, inputs, initial=case.initial, stop_time=0.2, step=1e-3)
    own = simulate(case.parameters, case.inputs, initial=case.initial, stop_time=0.2, step=1e-3)
    np.testing.assert_allclose(own["right.angle"], one["right.angle"], rtol=1e-13)
    runs = simulate_many([P, P], inputs, initial=case.initial, stop_time=0.2, step=1e-3)
    np.testing.assert_allclose(runs.output("right.angle")[1], one["right.angle"], rtol=1e-12)
    for words in (
        ("run", "rotors.toml"),
        ("run", "--published", "two-rotors-demo", "--set", "run.stop_time=0.1"),
        ("resonance", "--published", "two-rotors-demo", "--vary", "left.speed", "--from", "18", "--to", "30"),
    ):
        done = linkwork(*words)
    # without --vary it is the first commanded crank; the other one keeps its ratio to it
    done = linkwork("resonance", "--published", "two-rotors-demo", "--from", "18", "--to", "20", "--places", "0")
    assert "at each left.speed" in done.output


def test_the_fmus_run_as_the_solver_does(tmp_path: Path) -> None:
    inputs = Inputs(left_speed=steps([0.0, 0.1], [10.0, 14.0]), right_torque=0.02)
    run = simulate(P, inputs, initial=DEMO.initial, stop_time=0.2, step=1e-3, tolerance=1e-11)
    native = [build_native(MECHANISM, kind, tmp_path) for kind in (NATIVE, NATIVE_FMI3)]
    for file in (build(MECHANISM, tmp_path), *native):
        other = cosimulate(file, P, inputs, initial=DEMO.initial, stop_time=0.2, step=1e-3, tolerance=1e-11)
        assert compare(run, other).worst.relative < 1e-8, file.name


def test_the_studio_and_the_pictures_show_both_rotors() -> None:
    tables = mechanism_tables(MECHANISM)
    starts = {row["name"]: row["start"] for row in tables["given"]}
    assert (starts["left.speed"], starts["right.speed"]) == (20.0, 30.0)
    figures.plot(periodic.newton_orbit(P, _drive(20.0, Fraction(2))))
    figures.plot(frequency_response(P, 18.0, 32.0, drive=_drive(20.0, Fraction(2)), vary="left.speed"))


def test_the_verdict_is_said_of_the_speed_of_the_crank_of_the_drive(capsys: pytest.CaptureFixture[str]) -> None:
    _report_verdict("both", P, _drive(4.0 * pi, Fraction(3, 2)), None)
    assert "both at 120 rpm: stable" in capsys.readouterr().out
