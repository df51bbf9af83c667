"""Runs of the slider-crank by the in-process solver: every way of driving it, by independent integrators, and its balances."""

from dataclasses import replace
from math import cos, pi, sin
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from analysis import Event, Inputs, Trajectory, compare, simulate, simulate_many
from analysis.mechanisms import MECHANISMS, SLIDER_CRANK, output_units
from analysis.run import CASES as CHECKS
from analysis.run import Case, Function, Harmonics, TorsionBar, published_case, steps
from analysis.run.inputs import encode
from analysis.youssef import coupler_curve
from linkwork.errors import AssemblyError, InputError, ParameterError
from linkwork.five_bar.parameters import InitialState as FiveBarState
from linkwork.five_bar.published import TABLE_3_1
from linkwork.slider_crank import published
from linkwork.slider_crank.dynamics import inertia
from linkwork.slider_crank.kinematics import coefficients, position
from linkwork.slider_crank.parameters import InitialState, SliderCrankParameters
from tests.refusals import refused

CASES = {name: case for name, case in CHECKS.items() if name.startswith("slider-crank")}
PARAMETERS, INITIAL = published.OFFSET_CASE
SPEED = published.CRANK_SPEED


def run(case: Case, **options: Any) -> Trajectory:
    settings = {"initial": case.initial, "stop_time": case.stop_time, "step": case.step, "tolerance": 1e-10}
    return simulate(case.parameters, case.inputs, **settings | options)


# --- One motion, by every method


@pytest.mark.parametrize(
    ("name", "method"),
    [(name, method) for name in CASES for method in ("DOP853", "LSODA")]
    + [("slider-crank-general", "Radau"), ("slider-crank-shifted", "Radau")],
)
def test_methods_agree_in_every_output(name: str, method: str) -> None:
    tolerance = 1e-12 if method == "LSODA" else 1e-10
    result = compare(run(CASES[name]), run(CASES[name], method=method, tolerance=tolerance), tolerance=1e-6)
    assert result.agrees, result.worst


@pytest.mark.parametrize("name", CASES)
def test_held_inputs_by_an_independent_integrator(name: str) -> None:
    case = CASES[name]
    held = run(case, hold=case.step, tolerance=case.tolerance)
    result = compare(held, run(case, hold=case.step, method="DOP853", tolerance=1e-11), tolerance=1e-6)
    assert result.agrees, result.worst


def test_inputs_that_do_not_vary_are_held_without_loss() -> None:
    case = CASES["slider-crank-general"]
    assert case.inputs.held_exactly
    assert compare(run(case), run(case, hold=case.step), tolerance=1e-8).agrees
    assert not CASES["slider-crank-shifted"].inputs.held_exactly


@pytest.mark.parametrize("name", CASES)
def test_energy_balances_and_the_loop_stays_closed(name: str) -> None:
    result = run(CASES[name])
    assert result.status == 0
    size = max(np.abs(result[f"energy.{kind}"]).max() for kind in ("kinetic", "potential", "supplied", "dissipated"))
    assert size > 0.1
    assert np.abs(result["energy.residual"]).max() < 1e-8 * size
    assert result["closure.residual"].max() < 1e-14


# --- Balances over a run, from positions and forces alone


def _vectors(result: Trajectory, prefix: str) -> NDArray[np.float64]:
    return np.column_stack([result[f"{prefix}{axis}"] for axis in "xyz"])


def _momentum(p: SliderCrankParameters, result: Trajectory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Linear momentum of all links, and the forces on them from outside, at the samples."""
    angle, shift = result["crank.angle"], result["shift.position"]
    c, s = np.cos(angle), np.sin(angle)
    crank = np.column_stack(
        [c * p.crank_cog_x - s * p.crank_cog_y, s * p.crank_cog_x + c * p.crank_cog_y, shift + p.crank_cog_z]
    )
    pins = _vectors(result, "crank_pin."), _vectors(result, "slider_pin.")
    rod = pins[0] + p.rod_cog_distance / p.rod_length * (pins[1] - pins[0])
    moment = p.crank_mass * crank + p.rod_mass * rod + p.slider_mass * pins[1]
    momentum = CubicSpline(result.time, moment).derivative()(result.time)
    along = np.array([0.0, -sin(p.guide_twist), -cos(p.guide_twist)])
    velocity = result["slider.velocity"]
    push = (
        -p.slider_stiffness * (result["slider.position"] - p.slider_spring_free_position)
        - p.slider_damping * velocity
        - p.slider_coulomb_friction * np.tanh(velocity / 1e-3)
    )
    weight = (p.crank_mass + p.rod_mass + p.slider_mass) * np.array([p.gravity_x, p.gravity_y, p.gravity_z])
    return momentum, _vectors(result, "bearing.f") + _vectors(result, "guide.f") + np.outer(push, along) + weight


@pytest.mark.parametrize("name", ["slider-crank-general", "slider-crank-free-shift", "slider-crank-groove"])
def test_momentum_gained_is_the_impulse_of_the_forces_from_outside(name: str) -> None:
    case = CASES[name]
    result = run(case, step=2e-4, tolerance=1e-11)
    momentum, force = _momentum(case.parameters, result)
    impulse = CubicSpline(result.time, force).antiderivative()(result.time)
    gained = momentum - momentum[200]
    # away from the ends, where the spline's derivative is good
    inner = slice(200, -200)
    size = np.abs(impulse).max()
    assert np.abs(gained - (impulse - impulse[200]))[inner].max() < 1e-7 * size


def test_power_of_the_drives_is_what_the_energy_gains() -> None:
    inputs = Inputs(speed=Harmonics(4.0, [1.0], [3.0], [0.2]), shift_speed=Harmonics(0.0, [0.2], [8.0], [0.0]))
    result = simulate(PARAMETERS, inputs, initial=INITIAL, stop_time=1.2, step=2e-4, tolerance=1e-11)
    torque = result["drive.applied_torque"]
    power = torque * result["crank.speed"] + result["axial.applied_force"] * result["shift.velocity"]
    work = CubicSpline(result.time, power).antiderivative()(result.time)
    energy = result["energy.kinetic"] + result["energy.potential"]
    assert np.abs(energy - energy[0] - work).max() < 1e-9 * np.ptp(energy)


# --- Drives


def test_shift_is_held_where_nothing_is_said() -> None:
    result = simulate(PARAMETERS, Inputs(torque=5.0), initial=INITIAL, stop_time=1.0, step=0.05)
    assert np.all(result["shift.position"] == INITIAL.shift_position)
    assert np.all(result["shift.velocity"] == 0.0)
    assert np.abs(result["axial.applied_force"]).max() > 0.1


def test_groove_makes_the_shift_of_equation_28() -> None:
    p = replace(PARAMETERS, groove_amplitude=0.1, groove_ratio=1.7)
    result = simulate(p, Inputs(torque=5.0, groove=True), stop_time=2.0, step=0.02)
    phase = 1.7 * result["crank.angle"]
    assert result["shift.position"] == pytest.approx(0.1 * np.sin(phase), abs=1e-15)
    assert result["shift.velocity"] == pytest.approx(0.17 * np.cos(phase) * result["crank.speed"], abs=1e-14)
    assert result["crank.angle"][-1] > pi


def test_commanded_shift_follows_its_speed() -> None:
    inputs = Inputs(speed=SPEED, shift_speed=Harmonics(0.0, [0.3], [5.0], [0.0]))
    result = simulate(PARAMETERS, inputs, initial=INITIAL, stop_time=1.0, step=0.05)
    t = result.time
    assert result["shift.velocity"] == pytest.approx(0.3 * np.cos(5.0 * t), abs=1e-8)
    assert result["shift.position"] == pytest.approx(INITIAL.shift_position + 0.06 * np.sin(5.0 * t), abs=1e-8)
    assert result["shift.acceleration"] == pytest.approx(-1.5 * np.sin(5.0 * t), abs=1e-12)


@pytest.mark.parametrize("method", ["compiled", "DOP853"])
def test_jump_of_the_axial_speed_moves_the_free_crank(method: str) -> None:
    # the generalised momentum of the crank, m11 w + m12 v, is conserved across the jump
    inputs = Inputs(torque=0.0, shift_speed=steps([0.0, 0.5], [0.0, 0.4]))
    options: dict[str, Any] = {"initial": INITIAL, "method": method, "tolerance": 1e-11}
    at = {"samples": [0.0, 0.5 - 1e-9, 0.5, 0.6]}
    result = simulate(PARAMETERS, inputs, stop_time=0.6, **at, **options)
    before, after = result["crank.speed"][1:3]
    p = PARAMETERS.constants()
    q = position(result["crank.angle"][2], result["shift.position"][2], p)
    m = inertia(q, coefficients(q, p), p)
    assert after != before
    assert m.m11 * (after - before) + m.m12 * 0.4 == pytest.approx(0.0, abs=1e-7)
    assert np.abs(result["energy.residual"]).max() < 1e-7


def test_events_are_found_on_outputs_of_the_slider_crank() -> None:
    turn = Event(name="turn", function=lambda t, th, s, w, v: th - 2.0 * pi, stop=True)
    events = [Event(name="dead centre", output="slider.velocity", direction=-1), turn]
    planar = published.parameters(10.0)
    result = simulate(planar, Inputs(speed=SPEED), stop_time=3.0, step=0.1, events=events)
    assert [event.name for event in result.events] == ["dead centre", "turn"]
    # Rahman's a4 = 10 in: 99.28 deg
    assert np.degrees(result.events[0].state[0]) == pytest.approx(99.28, abs=5e-3)
    assert result.time[-1] == pytest.approx(1.2, rel=1e-9)
    with pytest.raises(InputError, match=r"no output 'pin.A.fx' for event 'pin'.* \(the nearest of \d+ names are"):
        simulate(planar, Inputs(), stop_time=1.0, events=[Event(name="pin", output="pin.A.fx")])


def test_ensemble_is_its_runs_one_by_one() -> None:
    parameters = [published.parameters(a4) for a4 in (0.0, 10.0, 20.0)]
    inputs = Inputs(torque=3.0, axial_force=0.1)
    ensemble = simulate_many(parameters, inputs, initial=INITIAL, stop_time=0.5, step=0.01, n_jobs=1)
    for p, one in zip(parameters, ensemble):
        alone = simulate(p, inputs, initial=INITIAL, stop_time=0.5, step=0.01)
        assert one.values == pytest.approx(alone.values, rel=1e-9, abs=1e-11)
        assert one.names == alone.names
    assert ensemble.output("shift.position").shape == (3, 51)
    with pytest.raises(InputError, match="of one mechanism"):
        simulate_many([parameters[0], TABLE_3_1], stop_time=0.5)


def test_a_run_that_leaves_the_range_of_assembly_ends_at_its_limit() -> None:
    inputs = Inputs(speed=SPEED, shift_speed=2.0)
    result = simulate(PARAMETERS, inputs, initial=INITIAL, stop_time=3.0, step=0.01)
    other = simulate(PARAMETERS, inputs, initial=INITIAL, stop_time=3.0, step=0.01, method="DOP853")
    for ended in (result, other):
        assert ended.status == 3
        assert "limit of assembly at t = " in ended.message
        assert " and shift position " in ended.message
    assert result.time[-1] == pytest.approx(other.time[-1], rel=1e-7)
    assert np.sin(result["transmission.angle"][-1]) == pytest.approx(1e-3, rel=1e-6)


# --- What is refused


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        ({"inputs": Inputs(load_x=1.0)}, InputError, "a slider-crank has no input 'load_x': its inputs are torque"),
        ({"initial": FiveBarState()}, InputError, "initial is linkwork.five_bar.*must be linkwork.slider_crank"),
        ({"initial": InitialState(shift_position=1.2)}, AssemblyError, r"crank pin is .* m from the guide"),
        ({"tolerance": 1.0}, ParameterError, "solver.tolerance"),
        (
            {"inputs": Inputs(load=Function(lambda t, th, s, w, v: float("nan")))},
            InputError,
            "the input load is not a finite number at t = 0 s, crank angle 0 rad .* and shift position",
        ),
        (
            {"inputs": Inputs(shift_speed=Harmonics(0.0, [1e200], [1e200], [0.0]), torque=1.0)},
            InputError,
            "the input (shift_speed|rate of shift_speed)",
        ),
    ],
)
def test_what_is_not_usable_is_refused(arguments: dict[str, Any], error: type, said: str) -> None:
    settings: dict[str, Any] = {"inputs": Inputs(), "initial": INITIAL} | arguments
    with pytest.raises(error, match=said):
        simulate(PARAMETERS, settings.pop("inputs"), stop_time=0.5, hold=1e-3, **settings)


def test_a_freedom_has_one_drive() -> None:
    refused(InputError, "both shift_speed and groove are given", Inputs, shift_speed=1.0, groove=True)
    refused(InputError, "both shift_speed and axial_force", Inputs, shift_speed=1.0, axial_force=1.0)
    refused(InputError, "both speed and torque", Inputs, speed=1.0, torque=1.0)
    with pytest.raises(InputError, match="a shift_speed given as a Function needs its rate"):
        Inputs(shift_speed=Function(lambda t, th, s, w, v: 0.0))
    with pytest.raises(InputError, match="load has more than one Function"):
        Inputs(load=(Function(lambda *x: 0.0), Function(lambda *x: 0.0)))
    assert Inputs(torque=TorsionBar(torque=1.0)).modes(SLIDER_CRANK) == {"drive.mode": 0, "axial.mode": 1}
    names = [encode(Inputs(), SLIDER_CRANK).value_name(n) for n in range(3, 7)]
    assert names == ["axial_force", "shift_speed", "rate of shift_speed", "load"]


def test_analyses_of_five_bars_refuse_it() -> None:
    with pytest.raises(InputError, match=r"a coupler curve .*SliderCrankParameters"):
        coupler_curve(PARAMETERS, 0.0)


def test_a_case_is_of_one_mechanism() -> None:
    assert isinstance(Case(title="own", parameters=PARAMETERS, stop_time=1.0).initial, InitialState)


def test_outputs_of_one_name_have_one_unit() -> None:
    for mechanism in MECHANISMS.values():
        units = {v.name: v.unit for v in mechanism.variables if v.causality == "output" and v.kind == "Real"}
        assert units == {name: output_units()[name] for name in mechanism.output_names}


# --- Published cases


@pytest.mark.parametrize("name", published.SETS)
def test_published_cases_run(name: str) -> None:
    case = published_case(name)
    result = run(case)
    assert result.status == 0
    assert result.time[-1] == pytest.approx(3.6)
    assert result["crank.angle"][-1] == pytest.approx(6.0 * pi)
