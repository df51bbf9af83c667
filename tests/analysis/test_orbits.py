"""Periodic motions by shooting: against published numbers, SciPy on the plain equations, and balances over a period."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis import InductionMotor, Inputs, periodic, ramp, simulate
from analysis.periodic.motion.kernels import eliminate
from analysis.units import RAD_S_PER_RPM
from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.five_bar import dynamics
from linkwork.five_bar.parameters import FiveBarParameters, InitialState, without_friction
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests import published

SPEED = SETS["table-3.1"].crank_speed
RIG_1_B = SETS["rig-1-spring-b"].parameters
MOTOR = InductionMotor(breakdown_torque=5.0, breakdown_slip=0.2, synchronous_speed=SPEED)
GENERAL = replace(
    TABLE_3_1, crank_mass=0.3, crank_cog_distance=0.01, crank_cog_angle=0.4, coupler_cog_angle=0.2,
    rocker_cog_angle=-0.3, slider_guide_angle=0.15, slider_spring_free_position=0.004,
    slider_coulomb_friction=0.4, coupler_point_distance=0.06, coupler_point_angle=0.5, ground_inclination=0.3,
)  # fmt: skip
#: A level five-bar whose coupler and rocker have no mass, so that the slider remains at rest. It passes a change point, where
#: the crank points away from D.
LIGHT = replace(
    TABLE_3_1, ground_length=0.2, crank_length=0.05, coupler_length=0.19, rocker_length=0.06, slider_mass=1.0,
    coupler_mass=0.0, coupler_inertia=0.0, rocker_mass=0.0, rocker_inertia=0.0,
)  # fmt: skip
#: Friction by contact forces in the place of that of a given level.
ROUGH = replace(
    GENERAL, slider_coulomb_friction=0.0, slider_friction_coefficient=0.1, pin_A_friction_radius=3e-4,
    pin_B_friction_radius=4e-4, pin_C_friction_radius=5e-4, pin_D_friction_radius=6e-4,
)  # fmt: skip


def plain_period(orbit: periodic.PeriodicOrbit, start: np.ndarray) -> np.ndarray:
    """y after a period by SciPy on the plain right-hand side in time, its end located at the crank angle."""
    p = orbit.parameters.constants()
    drive = orbit.drive

    def inputs(w: float) -> dynamics.Inputs:
        torque = drive.torque
        if drive.motor:
            slip = 1.0 - w / drive.motor.synchronous_speed
            ratio = slip / drive.motor.breakdown_slip
            torque += 2.0 * drive.motor.breakdown_torque * ratio / (1.0 + ratio * ratio)
        forces = (drive.forces.get(name, 0.0) for name in ("slider.force", "load.fx", "load.fy"))
        return dynamics.Inputs(float(drive.speed_drive), torque, 0.0, *forces)

    end = 2.0 * pi * orbit.turns

    def turned(t: float, x: np.ndarray) -> float:
        return x[0] - end

    turned.terminal = True  # type: ignore[attr-defined]
    speed = drive.speed if drive.speed is not None else float(start[2])

    def rates(t: float, x: np.ndarray) -> dynamics.State:
        return dynamics.derivative(tuple(x), inputs(x[2]), p)

    tight = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    first = [0.0, start[0], speed, start[1], 0.0, 0.0]
    solution = solve_ivp(rates, (0.0, 3.0 * end / speed), first, events=turned, **tight)
    x = solution.y_events[0][0]
    return np.array([x[1], x[3], x[2]][: len(start)])


def test_steady_motion_of_table_3_1_is_the_published_one() -> None:
    orbit = periodic.find_orbit(TABLE_3_1, speed=SPEED)
    assert 100.0 * orbit.start[0] == pytest.approx(published.STEADY_U_CM, abs=1e-8)
    assert 100.0 * orbit.start[1] == pytest.approx(published.STEADY_U_RATE_CM_S, abs=1e-7)
    assert orbit.residual < 1e-9
    assert orbit.verdict().stability is periodic.Stability.STABLE


ORBITS = {
    "Table 3.1": (TABLE_3_1, periodic.Drive(speed=SPEED), None),
    "general": (
        GENERAL,
        periodic.Drive(speed=30.0, forces={"slider.force": 2.0, "load.fx": 1.0, "load.fy": -3.0}),
        None,
    ),
    "unstable": (replace(TABLE_3_1, slider_stiffness=260.0), periodic.Drive(speed=SPEED), (-0.0475, -0.5)),
    "motor": (TABLE_3_1, periodic.Drive(motor=MOTOR), None),
    "torque": (SETS["rig-2-spring-c"].parameters, periodic.Drive(torque=0.01), (0.0, 0.0, 56.0)),
    "rough": (ROUGH, periodic.Drive(speed=30.0, forces={"slider.force": 2.0, "load.fx": 1.0, "load.fy": -3.0}), None),
    "rough torque": (ROUGH, periodic.Drive(motor=MOTOR, torque=-0.3), None),
    "general torque": (
        GENERAL,
        periodic.Drive(motor=MOTOR, torque=-0.3, forces={"slider.force": 2.0, "load.fy": -3.0}),
        None,
    ),
}


@pytest.fixture(
    params=[pytest.param(name, marks=pytest.mark.slow if name == "rough torque" else ()) for name in ORBITS],
    scope="module",
)
def orbit(request: pytest.FixtureRequest) -> periodic.PeriodicOrbit:
    parameters, drive, start = ORBITS[request.param]
    return periodic.newton_orbit(parameters, drive, start=start)


def test_motion_repeats_itself_on_the_plain_equations(orbit: periodic.PeriodicOrbit) -> None:
    scale = np.array([0.05, 2.0, 40.0])[: len(orbit.start)]
    assert np.abs((plain_period(orbit, orbit.start) - orbit.start) / scale).max() < 1e-8 * max(1.0, orbit.largest)


def test_monodromy_matrix_is_that_of_differences(orbit: periodic.PeriodicOrbit) -> None:
    for j, step in enumerate((1e-6, 4e-5, 1e-3)[: len(orbit.start)]):
        aside = np.zeros(len(orbit.start))
        aside[j] = step
        column = (plain_period(orbit, orbit.start + aside) - plain_period(orbit, orbit.start - aside)) / (2.0 * step)
        size = np.array([0.05, 2.0, 40.0])[: len(orbit.start)] / np.array([0.05, 2.0, 40.0])[j]
        assert np.abs((column - orbit.monodromy[:, j]) / size).max() < 2e-6 * max(1.0, orbit.largest)


def test_determinant_is_liouvilles(orbit: periodic.PeriodicOrbit) -> None:
    # with friction the trace has sharp peaks where the slider turns round
    samples, tolerance = (512, 1e-8) if orbit.parameters == without_friction(orbit.parameters) else (16384, 1e-6)
    exact = np.linalg.det(orbit.monodromy)
    assert orbit.determinant_by_liouville(samples) == pytest.approx(exact, rel=tolerance, abs=1e-12)


def test_work_over_a_period_is_what_is_dissipated(orbit: periodic.PeriodicOrbit) -> None:
    # constant slider force and load do no work over a period
    turn = orbit.turn(4096)
    p, w = orbit.parameters.constants(), turn["crank.speed"]
    modes = tuple(map(float, orbit.flow.modes))
    acting = [dynamics.apply_inputs(modes, tuple(u), p) for u in turn.inputs.tolist()]
    lost = np.mean([dynamics.derivative(tuple(x), i, p)[4] for x, i in zip(turn.states.tolist(), acting)] / w)
    assert turn["drive.applied_torque"].mean() == pytest.approx(lost, rel=1e-7)


def test_turn_is_that_of_a_run() -> None:
    orbit = periodic.find_orbit(GENERAL, torque=MOTOR)
    turn = orbit.turn(1024)
    u, v, w = orbit.start
    start = InitialState(crank_speed=w, slider_position=u, slider_velocity=v)
    times = {"stop_time": turn.period, "samples": np.append(turn.time, turn.period)}
    run = simulate(GENERAL, Inputs(torque=MOTOR), initial=start, tolerance=1e-12, **times)
    for name in ("crank.angle", "slider.position", "crank.speed", "drive.applied_torque", "pin.C.fx"):
        size = np.abs(turn[name]).max()
        assert np.abs(run[name][:-1] - turn[name]).max() < 1e-7 * size, name
    assert run["crank.angle"][-1] == pytest.approx(2.0 * pi, abs=1e-8)


def test_two_turns_have_the_square_of_the_monodromy_matrix() -> None:
    once, twice = (periodic.find_orbit(TABLE_3_1, speed=SPEED, turns=n) for n in (1, 2))
    assert twice.start == pytest.approx(once.start, abs=1e-10)
    assert twice.monodromy == pytest.approx(once.monodromy @ once.monodromy, abs=1e-9)
    assert twice.turn().harmonic("slider.position", 0.5) < 1e-12
    assert twice.turn().harmonic("slider.position", 1) == pytest.approx(once.turn().harmonic("slider.position", 1))


def test_amplitude_and_harmonics() -> None:
    turn = periodic.find_orbit(TABLE_3_1, speed=SPEED).turn(4096)
    u = turn["slider.position"]
    assert periodic.find_orbit(TABLE_3_1, speed=SPEED).amplitude == pytest.approx(0.5 * np.ptp(u), rel=1e-6)
    x = turn.angle
    cosine, sine = (u * np.cos(2 * x)).mean(), (u * np.sin(2 * x)).mean()
    assert turn.harmonic("slider.position", 2) == pytest.approx(2.0 * np.hypot(cosine, sine), rel=1e-12)
    with pytest.raises(InputError, match=r"order 0\.5"):
        turn.harmonic("slider.position", 0.5)
    with pytest.raises(InputError, match=r"no output 'energy\.supplied'"):
        turn["energy.supplied"]


def test_newton_converges_quadratically_from_afar() -> None:
    assert periodic.find_orbit(TABLE_3_1, speed=SPEED, start=(0.03, 1.0), settle=False).iterations < 8


def test_where_newton_fails_the_motion_itself_or_another_start_leads_there() -> None:
    soft = replace(TABLE_3_1, slider_stiffness=235.0)
    with pytest.raises(periodic.OrbitError):
        periodic.find_orbit(soft, speed=SPEED, start=(0.09, 3.0), settle=False)
    assert periodic.find_orbit(soft, speed=SPEED, start=(0.09, 3.0)).verdict().stability is periodic.Stability.STABLE


def test_where_none_is_found_the_error_says_where_it_ended() -> None:
    said = r"misses its start by .* after \d+ corrections, from slider.position = .* m, slider.velocity = .* m/s"
    with pytest.raises(periodic.OrbitError, match=said) as caught:
        periodic.find_orbit(replace(RIG_1_B, slider_damping=2.0), speed=1076.7 * RAD_S_PER_RPM, settle=False)
    assert len(caught.value.start) == 2
    assert caught.value.iterations > 0


def test_no_periodic_motion_passes_over_a_change_point() -> None:
    speed = 40.0
    with pytest.raises(periodic.OrbitAssemblyError, match="limit of assembly"):
        periodic.newton_orbit(LIGHT, periodic.Drive(speed=speed))
    assert not periodic.find_orbits(LIGHT, speed=speed).orbits
    assert "limit of assembly" in simulate(LIGHT, Inputs(speed=speed), stop_time=7.0 / speed).message
    # without a change point the slider remains at rest
    orbit = periodic.newton_orbit(replace(LIGHT, rocker_length=0.061), periodic.Drive(speed=speed))
    assert orbit.amplitude == 0.0
    assert orbit.clearance() > 0.05


def test_limit_of_assembly_is_an_error_of_its_own() -> None:
    with pytest.raises(periodic.OrbitAssemblyError, match="limit of assembly") as caught:
        periodic.find_orbit(replace(TABLE_3_1, slider_stiffness=0.0), speed=SPEED, settle=False, start=(0.1, 0.0))
    assert isinstance(caught.value, AssemblyError)
    with pytest.raises(periodic.OrbitAssemblyError, match="cannot be joined"):
        periodic.find_orbit(TABLE_3_1, speed=SPEED, start=(1.0, 0.0))


def test_a_crank_that_stalls_is_reported() -> None:
    with pytest.raises(periodic.OrbitError, match="comes to rest"):
        periodic.find_orbit(TABLE_3_1, torque=-2.0, start=(0.0, 0.0, 5.0), settle=False)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "neither a speed nor a torque"),
        ({"speed": 1.0, "torque": 1.0}, "both a speed and a torque"),
        ({"speed": -1.0}, "above zero"),
        ({"speed": []}, "speed is list: give a number"),
        ({"speed": float("nan")}, "above zero"),
        ({"torque": float("inf")}, "torque is inf"),
        ({"torque": 1.0}, "crank speed is needed"),
        ({"torque": [MOTOR, MOTOR]}, "2 motors"),
        ({"torque": 1.0, "start": (0.0, 0.0, 0.0)}, "crank speed at the start is 0"),
        ({"speed": 1.0, "start": (0.0,)}, "must be 2 finite numbers"),
        ({"speed": 1.0, "start": (0.0, float("nan"))}, "must be 2 finite numbers"),
        ({"speed": 1.0, "turns": 0}, "turns is 0"),
        ({"speed": 1.0, "turns": 1.5}, r"turns is 1\.5"),
        ({"speed": 1.0, "turns": "two"}, "turns is 'two'"),
        ({"speed": 1.0, "start": "rest"}, "must be 2 finite numbers"),
        ({"speed": 1.0, "initial": 3.0}, "initial is"),
        ({"inputs": Inputs(speed=1.0, shift_speed=1.0)}, "no input 'shift_speed'"),
        ({"inputs": Inputs(speed=1.0, force=ramp(0.0, 1.0, 0.0, 1.0))}, "force is a Piecewise"),
    ],
)
def test_bad_input(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(LinkworkError, match=message):
        periodic.find_orbit(TABLE_3_1, **arguments)  # type: ignore[arg-type]


def test_row_of_orbits_is_the_orbits_one_by_one() -> None:
    stiffnesses = np.linspace(2000.0, 180.0, 40)
    rows: list[FiveBarParameters] = [replace(TABLE_3_1, slider_stiffness=k) for k in stiffnesses]
    values, starts, status = periodic.largest_multipliers(rows, [periodic.Drive(speed=SPEED)] * len(rows))
    good = status == 0
    # below the fold at 232.2 N/m there is none on this branch
    assert good[stiffnesses > 240.0].all()
    for i in np.flatnonzero(good)[::7]:
        orbit = periodic.find_orbit(rows[i], speed=SPEED, start=starts[i])
        assert values[i] == pytest.approx(orbit.largest, abs=1e-9)
        assert starts[i] == pytest.approx(orbit.start, abs=1e-10)
    assert np.isnan(values[~good]).all()
    with pytest.raises(InputError, match="kind of drive"):
        periodic.largest_multipliers(rows[:2], [periodic.Drive(speed=SPEED), periodic.Drive(motor=MOTOR)])


def test_a_system_without_a_solution_is_said_to_have_none() -> None:
    singular = np.array([[1.0, 2.0, 1.0], [2.0, 4.0, 1.0]])
    assert not eliminate.py_func(singular, 2)
    assert not eliminate.py_func(np.array([[np.nan, 1.0]]), 1)
    solved = np.array([[0.0, 2.0, 1.0], [4.0, 1.0, 1.0]])
    assert eliminate.py_func(solved, 2)
    np.testing.assert_allclose(solved[:, 2], [0.125, 0.5])
