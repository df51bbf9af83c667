"""Periodic motions of mechanisms other than the five-bar: closed forms, SciPy on other equations, and long runs."""

from collections.abc import Callable
from dataclasses import replace
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import root

from analysis import InductionMotor, Inputs, figures, simulate
from analysis.mechanisms import MECHANISMS
from analysis.periodic import (
    Crossing,
    Drive,
    PeriodicOrbit,
    Stability,
    confirm,
    find_orbit,
    frequency_response,
    grid,
    mean_effective_mass,
    natural_frequency,
    newton_orbit,
    plane,
    stability_chart,
    steady_drive,
)
from linkwork.errors import InputError, ParameterError, UnknownNameError
from linkwork.slider_crank import published as rahman
from linkwork.slider_crank.parameters import InitialState
from tests.mechanisms import pendulum, rotor_on_cart
from tests.refusals import refused

pytestmark = pytest.mark.usefixtures("registered")

ROTOR, PENDULUM = (next(iter(m.MECHANISM.published.values())).parameters for m in (rotor_on_cart, pendulum))
#: The slider-crank of section 3.1 with a spring on the axial shift.
SPRUNG = replace(rahman.parameters(20.0, 232.0), shift_stiffness=8000.0, shift_damping=60.0)
FREE = {"axial.force": 0.0}
SPEED = rahman.CRANK_SPEED


@pytest.mark.parametrize("force", [0.0, 3.0])
def test_rotor_at_a_speed_shakes_its_cart_as_a_harmonic_force_does(force: float) -> None:
    """At a constant speed the cart is a linear driven oscillator."""
    p, w = ROTOR.constants(), 35.0
    orbit = find_orbit(ROTOR, Inputs(force=force), speed=w)
    amplitude = p.unbalance * w * w / (p.k - p.mass * w * w + 1j * p.c * w)
    assert orbit.start == pytest.approx([amplitude.real + force / p.k, -w * amplitude.imag], abs=1e-11)
    assert orbit.amplitude == pytest.approx(abs(amplitude), rel=2e-6)
    exact = np.exp(np.roots([p.mass, p.c, p.k]) * 2.0 * pi / w)
    assert sorted(orbit.multipliers, key=np.imag) == pytest.approx(sorted(exact, key=np.imag), abs=1e-9)
    assert natural_frequency(ROTOR) == pytest.approx(np.sqrt(p.k / p.mass), rel=1e-14)
    assert orbit.turn()["cart.position"].mean() == pytest.approx(force / p.k, abs=1e-11)


MOTOR = InductionMotor(breakdown_torque=2.0, breakdown_slip=0.3, synchronous_speed=40.0)


def rotor(x: Any, torque: float) -> list[float]:
    """(angle, position, speed, velocity)': both equations of motion solved as a linear system."""
    p = ROTOR.constants()
    th, s, w, v = x
    m12 = -p.unbalance * sin(th)
    right = [torque - p.weight * cos(th), -p.k * s - p.c * v + p.unbalance * cos(th) * w * w]
    return [w, v, *np.linalg.solve([[p.inertia, m12], [m12, p.mass]], right)]


def swing(x: Any, torque: float) -> list[float]:
    p = PENDULUM.constants()
    return [x[1], (torque - p.weight * cos(x[0]) - p.damping * x[1]) / p.inertia]


def kloss(w: float) -> float:
    slip = (1.0 - w / MOTOR.synchronous_speed) / MOTOR.breakdown_slip
    return 2.0 * MOTOR.breakdown_torque * slip / (1.0 + slip * slip)


#: Parameters, inputs, guess; equations, torque at a speed, places of y among (coordinates, rates).
TORQUES: dict[str, tuple[Any, Inputs, Any, Callable[..., list[float]], Callable[[float], float], list[int]]] = {
    "rotor, motor": (ROTOR, Inputs(torque=(MOTOR, -0.1)), None, rotor, lambda w: kloss(w) - 0.1, [1, 3, 2]),
    "pendulum, torque": (PENDULUM, Inputs(torque=0.6), (30.0,), swing, lambda w: 0.6, [1]),
    "pendulum, motor": (PENDULUM, Inputs(torque=MOTOR), None, swing, kloss, [1]),
}


@pytest.fixture(params=TORQUES, scope="module")
def driven(request: pytest.FixtureRequest) -> tuple[PeriodicOrbit, Callable[[Any], Any]]:
    """The orbit, and the map over a turn by SciPy on equations of its own."""
    parameters, inputs, start, equations, torque, places = TORQUES[request.param]
    orbit = find_orbit(parameters, inputs, start=start)
    size = 4 if equations is rotor else 2

    def turned(y: Any) -> Any:
        x = np.zeros(size)
        x[places] = y

        def ended(t: float, x: Any) -> float:
            return x[0] - 2.0 * pi

        ended.terminal = True  # type: ignore[attr-defined]
        speed = size // 2
        right = lambda t, x: equations(x, torque(x[speed]))  # noqa: E731
        run = solve_ivp(right, (0.0, 10.0), x, events=ended, rtol=1e-12, atol=1e-13, method="DOP853")
        return run.y_events[0][0][places]

    return orbit, turned


def test_orbits_and_multipliers_under_a_torque_are_scipys(driven: tuple[PeriodicOrbit, Callable[[Any], Any]]) -> None:
    orbit, turned = driven
    shot = root(lambda y: turned(y) - y, orbit.start * 1.001, tol=1e-11)
    assert shot.x == pytest.approx(orbit.start, rel=1e-8, abs=1e-10)
    steps = 1e-5 * np.where(np.abs(orbit.start) > 1.0, np.abs(orbit.start), 1.0)
    columns = [(turned(orbit.start + d) - turned(orbit.start - d)) / (2.0 * d.max()) for d in np.diag(steps)]
    assert np.column_stack(columns) == pytest.approx(orbit.monodromy, rel=1e-5, abs=1e-5)
    assert np.linalg.det(orbit.monodromy) == pytest.approx(orbit.determinant_by_liouville(), rel=1e-8)
    assert orbit.verdict().stability is Stability.STABLE


def test_what_is_free_names_the_components_and_the_amplitude() -> None:
    slow = newton_orbit(PENDULUM, Drive(torque=0.6), start=(30.0,))
    assert slow.swing == ("pendulum speed", "rad/s")
    assert slow.amplitude == pytest.approx(0.5 * np.ptp(slow.turn(2048)["pendulum.speed"]), rel=1e-5)
    refused(InputError, r"pendulum speed is needed: give start = \(pendulum speed\)", find_orbit, PENDULUM, torque=0.6)
    refused(InputError, "no input for the speed", find_orbit, PENDULUM, speed=3.0)
    refused(ParameterError, "second freedom", natural_frequency, PENDULUM)
    refused(UnknownNameError, r"there is no load\.fx", newton_orbit, ROTOR, Drive(speed=3.0, forces={"load.fx": 1.0}))


def test_grid_over_cores_has_the_multipliers_of_the_linear_oscillator(tmp_path: Path) -> None:
    speeds, dampings = np.array([20.0, 30.0, 45.0]), np.array([2.0, 6.0])
    operation = plane(ROTOR, Drive(speed=30.0), "drive.speed", "cart.damping")
    found = grid(operation, speeds, dampings, folder=tmp_path, n_jobs=2)
    # both multipliers of a damped oscillation have the modulus exp(-c T / 2 M)
    exact = np.exp(-dampings[:, None] * pi / speeds / ROTOR.constants().mass)
    assert found.largest.filled(np.nan) == pytest.approx(exact, abs=1e-9)
    assert grid(operation, speeds, dampings, folder=tmp_path).computed == 0


# The slider-crank


@pytest.fixture(scope="module")
def shaken() -> PeriodicOrbit:
    return find_orbit(SPRUNG, Inputs(axial_force=0.0), speed=2.0 * SPEED)


def test_free_shift_of_the_slider_crank_repeats_itself_in_a_run(shaken: PeriodicOrbit) -> None:
    assert shaken.swing == ("S_1", "m")
    assert shaken.drive == Drive(speed=2.0 * SPEED, forces=FREE)
    assert shaken.amplitude > 1e-3
    position, velocity = shaken.start.tolist()
    run = simulate(
        SPRUNG,
        Inputs(speed=2.0 * SPEED, axial_force=0.0),
        initial=InitialState(shift_position=position, shift_velocity=velocity),
        stop_time=pi / SPEED,
        step=pi / SPEED / 256,
        tolerance=1e-12,
    )
    turn = shaken.turn()
    for name in ("shift.position", "slider.position", "bearing.fx", "drive.applied_torque"):
        assert run[name][:-1] == pytest.approx(turn[name], abs=1e-7 * np.abs(turn[name]).max())
    assert run["shift.position"][-1] == pytest.approx(position, abs=1e-9)


def test_multipliers_of_the_free_shift_are_those_of_a_long_run(shaken: PeriodicOrbit) -> None:
    found = confirm(SPRUNG, shaken.drive, turns=40)
    assert found.agrees
    assert found.growth == pytest.approx(shaken.largest, rel=1e-3)


#: How the shift is when it is not free, in inputs of a run.
DETERMINED = {"held": {}, "groove": {"groove": True}}


@pytest.mark.parametrize("how", DETERMINED)
def test_slider_crank_with_a_determined_shift_under_a_motor(how: str) -> None:
    motor = InductionMotor(breakdown_torque=60.0, breakdown_slip=0.3, synchronous_speed=SPEED)
    parameters = replace(SPRUNG, groove_amplitude=0.05, slider_damping=40.0)
    inputs, initial = Inputs(torque=motor, **DETERMINED[how]), InitialState(shift_position=0.0889)
    orbit = find_orbit(parameters, inputs, initial=initial)
    assert orbit.drive.held == {"shift.position": 0.0889}
    assert len(orbit.start) == 1
    start = float(orbit.start[0])
    period = orbit.turn().period
    times = {"stop_time": 6.5 * period, "step": period / 2000}
    faster = replace(initial, crank_speed=start * 1.001)
    run = simulate(parameters, inputs, initial=faster, **times, tolerance=1e-12)
    angle, speed = run["crank.angle"], run["crank.speed"]
    over = CubicHermiteSpline(angle, speed, run["crank.acceleration"] / speed)
    away = over(2.0 * pi * np.arange(3)) - start
    assert away[1] / away[0] == pytest.approx(orbit.multipliers[0].real, rel=1e-2, abs=1e-5)


def test_what_cannot_be_periodic_is_refused() -> None:
    refused(InputError, r"no freedom of the slider-crank is free .* axial\.force = 0", find_orbit, SPRUNG, speed=SPEED)
    with pytest.raises(InputError, match=r"shift_speed is 0\.1: with this constant speed"):
        find_orbit(SPRUNG, Inputs(shift_speed=0.1), torque=1.0, start=(5.0,))
    grooved = replace(SPRUNG, groove_amplitude=0.05, groove_ratio=0.5)
    with pytest.raises(InputError, match="not in the same configuration after 1 turn"):
        find_orbit(grooved, Inputs(groove=True), torque=1.0, start=(5.0,))
    for given, message in (
        ({"forces": FREE, "modes": {"axial.mode": 1}}, r"axial\.force does not act: axial\.mode is speed"),
        ({"held": {"crank.angle": 1.0}}, r"crank\.angle is not a coordinate .* that is held"),
        ({"modes": {"axial.mode": 3}}, r"axial\.mode = 3 is not a mode"),
        ({"modes": {"drive.mode": 0}}, r"drive\.mode = 0 is not a mode"),
    ):
        refused(InputError, message, newton_orbit, SPRUNG, Drive(torque=1.0, **given), start=(5.0,))


def test_drive_and_inputs_are_each_others() -> None:
    for inputs in (Inputs(speed=3.0, axial_force=1.0, load=2.0), Inputs(torque=3.0, groove=True)):
        drive = steady_drive(SPRUNG, inputs)
        assert steady_drive(SPRUNG, drive.inputs(MECHANISMS["slider-crank"])) == drive


def test_frequency_response_of_the_shift() -> None:
    natural = natural_frequency(SPRUNG)
    assert natural == pytest.approx(np.sqrt(SPRUNG.shift_stiffness / mean_effective_mass(SPRUNG)))
    response = frequency_response(SPRUNG, 0.7 * natural, 1.3 * natural, drive=Drive(speed=natural, forces=FREE))
    assert not response.problems
    (peak,) = response.maxima()
    assert peak.parameter == pytest.approx(natural, rel=0.15)
    columns = response.branches[0].columns()
    assert "amplitude of S_1 [m]" in columns
    turn = response.branches[0].orbits[3].turn()
    across = np.sqrt(sum(turn[f"crank_pin.f{axis}"] ** 2 for axis in "xyz"))
    assert columns["greatest force in crank_pin [N]"][3] == pytest.approx(across.max())
    assert figures.plot(response).axes[0].get_ylabel() == "amplitude of shift position S_1 [mm]"


def test_stability_chart_of_the_shift() -> None:
    natural = natural_frequency(SPRUNG)
    drive = Drive(speed=natural, forces=FREE)
    ranges = ((1.5 * natural, 2.5 * natural), (5.0, 100.0))
    chart = stability_chart(SPRUNG, drive, ranges=ranges, points=6)
    assert [axis.name for axis in chart.axes] == ["drive.speed", "shift.damping"]
    for row, column in ((0, 0), (5, 3)):
        x, y = chart.grid.x[column], chart.grid.y[row]
        damped = replace(SPRUNG, shift_damping=y)
        orbit = newton_orbit(damped, replace(drive, speed=x), start=chart.grid.starts[row, column])
        assert chart.grid.largest[row, column] == pytest.approx(orbit.largest, abs=1e-9)
    assert len(chart.runs) >= 2
    assert all(run.confirmation.agrees for run in chart.runs)
    assert all(b.kind in Crossing for b in chart.boundaries)


def test_command_line_follows_the_shift(linkwork: Callable[..., Result], tmp_path: Path) -> None:
    about = ["--published", "rahman-a4-20-alpha4-232", "--set", "shift.stiffness=8000", "--set", "shift.damping=60"]
    about += ["--set", "axial.force=0"]
    result = linkwork("resonance", *about, "--from", "100 rpm", "--to", "200 rpm")
    assert "where the amplitude of S_1 is largest" in " ".join(result.output.split())
    names = {path.name for path in (tmp_path / "out").glob("[!.]*")}
    assert names == {f"rahman-a4-20-alpha4-232-resonance.{ending}" for ending in ("csv", "png")}
    result = linkwork("stability", *about, "--no-chart")
    assert "stable" in result.output
