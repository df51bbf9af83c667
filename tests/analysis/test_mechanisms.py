"""Adding a mechanism is adding a folder and one line: two of the tests' own, of two freedoms and of one, through everything."""

import pickle
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from math import acos, cos, pi, sin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from analysis import Inputs, compare, cosimulate, find_orbit, simulate
from analysis.export import build
from analysis.files import read_record
from analysis.linear import (
    PeriodicModel,
    SampledController,
    control_loop,
    design_lqr,
    design_pid,
    find_equilibria,
    find_equilibrium,
    largest_difference,
    linearise,
    linearise_orbit,
    predict_loop,
)
from analysis.mechanisms import FIVE_BAR, MECHANISMS, SLIDER_CRANK, MechanismError, check, register
from analysis.run import CASES, InductionMotor, expressions, simulate_many, standard_cases
from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.published import TABLE_3_1
from linkwork.mechanism import Link, Mechanism
from linkwork.plant import Plant
from linkwork.slider_crank.published import OFFSET_CASE
from tests.mechanisms import pendulum, rotor_on_cart

pytestmark = pytest.mark.usefixtures("registered")

ROTOR, PENDULUM = rotor_on_cart.MECHANISM, pendulum.MECHANISM


#: The rotor on the cart at its speed.
TURNING = Inputs(speed=20.0)


def demo(mechanism: Mechanism) -> Any:
    return next(iter(mechanism.published.values()))


#: How each is driven: mechanism, inputs.
DRIVES = {
    "rotor at a speed": (ROTOR, {"speed": 20.0}),
    "rotor under a torque": (ROTOR, {"torque": 0.5, "force": 2.0}),
    "pendulum": (PENDULUM, {"torque": 0.3}),
}


@pytest.fixture(params=DRIVES)
def driven(request: pytest.FixtureRequest) -> tuple[Mechanism, Any, Inputs]:
    mechanism, channels = DRIVES[request.param]
    return mechanism, demo(mechanism), Inputs(**channels)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("fmus")
    return {mechanism.name: build(mechanism, folder) for mechanism in (ROTOR, PENDULUM)}


def test_each_folder_is_short() -> None:
    for package in (rotor_on_cart, pendulum):
        folder = Path(str(package.__file__)).parent
        assert sum(len(path.read_text().splitlines()) for path in folder.glob("*.py")) < 250


def right_side(mechanism: Mechanism, p: Any, channels: dict[str, float]) -> Any:
    """The equations of motion solved by NumPy as a linear system of accelerations: written for the tests alone."""
    if mechanism is PENDULUM:
        torque = channels["torque"]
        return lambda t, x: [x[1], (torque - p.weight * cos(x[0]) - p.damping * x[1]) / p.inertia]

    def rotor(t: float, x: Any) -> Any:
        th, s, w, v = x
        m12 = -p.unbalance * sin(th)
        matrix = np.array([[p.inertia, m12, -1.0], [m12, p.mass, 0.0], [1.0, 0.0, 0.0]])
        force = channels.get("force", 0.0) - p.k * s - p.c * v + p.unbalance * cos(th) * w * w
        right = np.array([-p.weight * cos(th), force, 0.0])
        if "torque" in channels:
            matrix[2] = 0.0, 0.0, 1.0
            right[2] = channels["torque"]
        e, a, _ = np.linalg.solve(matrix, right)
        return [w, v, e, a]

    return rotor


def test_compiled_runs_are_those_of_scipy_on_other_equations(driven: tuple[Mechanism, Any, Inputs]) -> None:
    mechanism, published, inputs = driven
    run = simulate(published.parameters, inputs, initial=published.initial, stop_time=1.0, step=0.01, tolerance=1e-11)
    names = [f.coordinate for f in mechanism.freedoms] + [f.rate for f in mechanism.freedoms]
    channels = {name: getattr(inputs, name) for name in inputs}
    equations, start = right_side(mechanism, published.parameters.constants(), channels), published.initial
    tight = {"rtol": 1e-12, "atol": 1e-12, "method": "DOP853"}
    own = solve_ivp(equations, (0.0, 1.0), mechanism.state(start)[:-2], t_eval=run.time, **tight)
    assert run.status == 0
    for name, column in zip(names, own.y):
        np.testing.assert_allclose(run[name], column, atol=1e-8 * max(1.0, np.abs(column).max()))
    assert np.abs(run["energy.residual"]).max() < 1e-8


def test_fmu_is_valid_and_does_as_the_solver(driven: tuple[Mechanism, Any, Inputs], fmus: dict[str, Path]) -> None:
    mechanism, published, inputs = driven
    fmu = fmus[mechanism.name]
    assert validate_fmu(str(fmu)) == []
    times: dict[str, Any] = {"initial": published.initial, "stop_time": 0.3, "step": 1e-3}
    through = cosimulate(fmu, published.parameters, inputs, **times)
    within = simulate(published.parameters, inputs, hold=1e-3, **times)
    assert through.names == mechanism.output_names
    assert compare(within, through, tolerance=1e-11).agrees


def test_parameters_and_states_are_named_after_the_interface() -> None:
    for mechanism in (ROTOR, PENDULUM):
        fields = {name.replace(".", "_", 1) for name in mechanism.mechanism_variables}
        assert fields == set(asdict(demo(mechanism).parameters))
        assert set(mechanism.initial_variables) == set(asdict(demo(mechanism).initial))


def test_inputs_of_another_mechanism_are_refused() -> None:
    with pytest.raises(InputError, match="a pendulum has no input 'force': its inputs are torque"):
        simulate(demo(PENDULUM).parameters, Inputs(force=1.0), stop_time=0.1)


# linear models, equilibria and control


def test_cart_under_a_turning_rotor_is_an_oscillator() -> None:
    """M s'' + c s' + k s = F; the rotor acts by m l sin(th) th'' + m l cos(th) th'^2, differentiated by hand."""
    published = demo(ROTOR)
    p, w, th = published.parameters.constants(), 20.0, 0.7
    model = linearise(published.parameters, (th, 0.01, w, 0.2), Inputs(speed=w))
    assert model.state_names == ("cart.position", "cart.velocity")
    assert model.input_names == ("cart.force", "drive.acceleration", "drive.speed", "rotor.angle")
    assert [float(matrix[0, 0]) for matrix in (model.M, model.C, model.K)] == pytest.approx([p.mass, p.c, p.k])
    by_hand = [1.0, p.unbalance * sin(th), 2.0 * p.unbalance * cos(th) * w, -p.unbalance * sin(th) * w * w]
    assert model.F[0] == pytest.approx(by_hand, rel=1e-12)
    assert model.natural_frequencies == pytest.approx([sqrt(p.k / p.mass)])
    assert -model.poles[0].real / abs(model.poles[0]) == pytest.approx(p.c / (2.0 * sqrt(p.k * p.mass)))
    system = model.to_state_space(("cart.position",), ("cart.force",))
    for omega in (1.0, 20.0, 90.0):
        exact = 1.0 / (p.k - p.mass * omega * omega + 1j * p.c * omega)
        assert complex(system(1j * omega)) == pytest.approx(exact, rel=1e-10)


def test_free_rotor_hangs_and_swings_with_the_cart() -> None:
    published = demo(ROTOR)
    p = published.parameters.constants()
    hanging, upright = find_equilibria(published.parameters, Inputs(torque=0.0, force=30.0))
    assert hanging.coordinates == pytest.approx([-pi / 2.0, 30.0 / p.k], abs=1e-9)
    assert upright.coordinates == pytest.approx([pi / 2.0, 30.0 / p.k], abs=1e-9)
    assert (hanging.stable, upright.stable) == (True, False)
    assert upright.potential - hanging.potential == pytest.approx(2.0 * p.weight)
    model = linearise(published.parameters, hanging.state, hanging.inputs)
    np.testing.assert_allclose(model.M, [[p.inertia, p.unbalance], [p.unbalance, p.mass]], rtol=1e-12)
    np.testing.assert_allclose(model.C, [[0.0, 0.0], [0.0, p.c]], atol=1e-12)
    np.testing.assert_allclose(model.K, [[p.weight, 0.0], [0.0, p.k]], rtol=1e-12, atol=1e-9)
    # held where it is, the rotor takes the moment of its weight
    held = find_equilibrium(published.parameters, held={"rotor.angle": 0.4})
    assert held.holding["rotor.angle"] == pytest.approx(p.weight * cos(0.4))


def test_a_mechanism_without_cases_is_checked_by_its_published_set() -> None:
    assert not PENDULUM.cases
    assert list(standard_cases(PENDULUM)) == ["pendulum-demo"]
    assert standard_cases(PENDULUM)["pendulum-demo"].parameters == demo(PENDULUM).parameters
    assert {"pendulum-demo", *FIVE_BAR.cases, *SLIDER_CRANK.cases} < {*CASES}


def test_pendulum_swings_as_by_hand() -> None:
    published = demo(PENDULUM)
    p = published.parameters.constants()
    hanging, upright = find_equilibria(published.parameters)
    assert [float(one.coordinates[0]) for one in (hanging, upright)] == pytest.approx([-pi / 2.0, pi / 2.0])
    model = linearise(published.parameters, hanging.state)
    assert model.natural_frequencies == pytest.approx([sqrt(p.weight / p.inertia)])
    assert np.poly(model.poles) == pytest.approx([1.0, p.damping / p.inertia, p.weight / p.inertia])
    pushed = find_equilibrium(published.parameters, Inputs(torque=0.5 * p.weight))
    assert pushed["pendulum.angle"] == pytest.approx(-acos(0.5))


def test_a_published_set_that_nothing_drives_runs_from_the_command_line(linkwork: Callable[..., Result]) -> None:
    linkwork("run", "--published", "pendulum-demo", "--no-plot")
    time, angle = read_record("out/pendulum-demo.csv", ("time", "pendulum.angle"))[1]
    equations = right_side(PENDULUM, demo(PENDULUM).parameters.constants(), {"torque": 0.0})
    swung = solve_ivp(equations, (0.0, 1.0), (0.0, 30.0), rtol=1e-9)
    # for as long as its FMU runs by default
    assert [time[-1], angle[-1]] == pytest.approx([1.0, swung.y[0, -1]], rel=1e-6)


def test_torque_balances_the_pendulum_upside_down() -> None:
    published = demo(PENDULUM)
    _, upright = find_equilibria(published.parameters)
    model = linearise(published.parameters, upright.state)
    controller = SampledController(design_pid(model, bandwidth=20.0), 2e-3)
    start = replace(upright.initial, pendulum_angle=upright["pendulum.angle"] + 0.1)
    loop = control_loop(published.parameters, controller, pi / 2.0, initial=start, stop_time=2.0)
    assert loop.position[0] == pytest.approx(pi / 2.0 + 0.1)
    assert loop.position[-1] == pytest.approx(pi / 2.0, abs=1e-6)
    linear = predict_loop(model, controller, pi / 2.0, stop_time=2.0, deviation=[0.1, 0.0])
    assert largest_difference(loop, linear) < 1e-3


@pytest.fixture(scope="module")
def shaken() -> PeriodicModel:
    """The linear models of the cart about the motion in which the rotor shakes it."""
    parameters = demo(ROTOR).parameters
    return linearise_orbit(parameters, find_orbit(parameters, TURNING))


def test_cart_is_held_in_process_and_through_the_fmu(shaken: PeriodicModel, fmus: dict[str, Path]) -> None:
    """The rotor shakes it: far less with control than without."""
    published = demo(ROTOR)
    controller = SampledController(design_pid(shaken.mean(), bandwidth=300.0), 1e-3)
    options: dict[str, Any] = {"initial": published.initial, "stop_time": 0.5}
    loop = control_loop(published.parameters, controller, 0.0, TURNING, **options)
    outside = control_loop(published.parameters, controller, 0.0, TURNING, fmu=fmus["rotor-on-cart"], **options)
    np.testing.assert_allclose(outside.states, loop.states, atol=1e-11)
    window = loop.metrics(band=1e-3, window=shaken.period)
    assert window.peak_error < 0.05 * np.ptp(shaken.states[:, 1])


def test_cart_about_its_shaken_motion_is_time_invariant(shaken: PeriodicModel) -> None:
    assert shaken.period == pytest.approx(pi / 10.0)
    np.testing.assert_allclose(shaken.monodromy(), expm(shaken.mean().A * shaken.period), atol=1e-8)


#: The slider-crank of the FMU with a spring and a damper along the crank's axis.
SPRUNG = replace(OFFSET_CASE[0], shift_stiffness=2e4, shift_spring_free_position=0.05, shift_damping=150.0)


def differences(mechanism: Mechanism, parameters: Any, state: Any, places: list[int], **modes: float) -> np.ndarray:
    """Derivatives of the plant's derivative by some components of its state, the others left."""
    p, h = parameters.constants(), 1e-6
    applied = mechanism.equations.apply_inputs(tuple(modes.values()), (0.0,) * len(mechanism.channels), p)

    def rates(step: np.ndarray) -> np.ndarray:
        return np.array(mechanism.equations.derivative(tuple(np.array(state) + step), applied, p))[places]

    columns = np.eye(mechanism.size)[places] * h
    return np.array([(rates(column) - rates(-column)) / (2.0 * h) for column in columns]).T


@pytest.mark.parametrize("speed", [None, 0.0, 5.0])
def test_shift_of_the_slider_crank_is_that_of_differences(speed: float | None) -> None:
    drive = {} if speed is None else {"speed": speed}
    model = linearise(SPRUNG, (0.4, 0.06, speed or 0.0, 0.1), Inputs(axial_force=0.0, **drive))
    assert model.places == ([0, 1, 2, 3] if speed is None else [1, 3])
    exact = differences(SLIDER_CRANK, SPRUNG, model.state, model.places, drive=float(speed is not None), axial=0.0)
    size = np.abs(exact).max(axis=1, keepdims=True)
    assert np.all(np.abs(model.A - exact) < 1e-7 * size)
    ours, right = (np.sort_complex(np.linalg.eigvals(matrix)) for matrix in (model.A, exact))
    assert ours == pytest.approx(right, rel=1e-6)


def test_the_shift_of_the_slider_crank_is_held_where_nothing_acts_on_it() -> None:
    pushed = replace(SPRUNG, shift_spring_free_position=0.5)
    run = simulate(pushed, initial={"shift_position": 0.06}, stop_time=0.02, step=0.01)
    assert run["shift.position"].tolist() == [0.06] * 3


def test_a_groove_leaves_one_freedom() -> None:
    """The shift goes with the crank: its inertia is that of both, seen from the crank."""
    grooved = replace(SPRUNG, groove_amplitude=0.05, groove_ratio=2.0)
    model = linearise(grooved, (0.4, 0.0, 2.0, 0.0), Inputs(groove=True))
    assert model.state_names == ("crank.angle", "crank.speed")
    exact = differences(SLIDER_CRANK, grooved, model.state, model.places, drive=0.0, axial=2.0)
    np.testing.assert_allclose(model.A, exact, rtol=1e-6)
    assert model.F[0, model.input_names.index("drive.torque")] == pytest.approx(1.0)
    # at rest the spring along the axis is as near to its free length as the groove lets it
    rest = find_equilibrium(replace(grooved, shift_spring_free_position=0.06), Inputs(groove=True))
    assert rest.stable
    assert rest.coordinates[1] == rest["shift.position"] == pytest.approx(0.05, rel=1e-9)


def test_axial_force_holds_the_shift_elsewhere() -> None:
    """The crank held: LQR on axial.force, closed around the plant."""
    rest = find_equilibrium(SPRUNG, Inputs(axial_force=0.0), held={"crank.angle": 0.4}, guess=(0.0, 0.05))
    assert rest["shift.position"] == pytest.approx(0.05, abs=1e-2)
    plant = Plant(SLIDER_CRANK, SPRUNG, rest.initial, drive_mode=1, axial_mode=0)
    plant.step(0.0, 1.0)
    assert plant.state[1] == pytest.approx(rest["shift.position"], abs=1e-9)
    model = linearise(SPRUNG, rest.state, rest.inputs)
    design = design_lqr(model, {"shift.position": 1e8, "shift.velocity": 1e4}, integral=1e10)
    assert (design.channel, design.coordinate) == ("axial.force", "shift.position")
    target = rest["shift.position"] + 0.01
    controller = SampledController(design, 1e-3)
    loop = control_loop(SPRUNG, controller, target, Inputs(speed=0.0), initial=rest.initial, stop_time=1.5)
    assert loop.position[-1] == pytest.approx(target, abs=1e-6)
    linear = predict_loop(model, controller, target, stop_time=1.5)
    assert largest_difference(loop, linear) < 0.02 * 0.01


FORCES = {
    "five-bar": (FIVE_BAR, TABLE_3_1, (0.6, 0.01, 0.0, 0.0), {}),
    "slider-crank": (SLIDER_CRANK, SPRUNG, (0.4, 0.06, 0.0, 0.0), {"axial_force": 0.0}),
    "rotor": (ROTOR, demo(ROTOR).parameters, (0.6, 0.01, 0.0, 0.0), {"torque": 0.0}),
}


@pytest.mark.parametrize("name", FORCES)
def test_forces_act_along_their_displacements(name: str) -> None:
    """Generalised force of a unit force: the gradient of the displacement that its channel names."""
    mechanism, parameters, state, channels = FORCES[name]
    model = linearise(parameters, state, Inputs(**channels))
    n = len(mechanism.freedoms)
    for channel in mechanism.channels:
        if channel.kind == "force":
            where = mechanism.freedoms[channel.freedom].coordinate if channel.freedom >= 0 else channel.displacement
            gradient = model.H[model.output_names.index(where), :n]
            np.testing.assert_allclose(model.F[:, model.input_names.index(channel.name)], gradient, atol=1e-9)


def swapped(mechanism: Mechanism, name: str, **changes: Any) -> tuple[Any, ...]:
    """The variables with those of one changed."""
    return tuple(v._replace(**changes) if v.name == name else v for v in mechanism.variables)


CRANK, CART = ROTOR.freedoms
#: What a mechanism's author may get wrong: the field with its wrong value, and what is said.
FAULTS: dict[str, tuple[str, Any, str]] = {
    "unit": ("variables", swapped(ROTOR, "cart.position", unit="metre"), "cart.position has unit = 'metre'"),
    "causality": ("variables", swapped(ROTOR, "cart.position", causality="out"), "has causality = 'out'"),
    "local": ("variables", swapped(ROTOR, "cart.position", causality="local"), "must be parameter or input or output"),
    "status": ("variables", swapped(ROTOR, "solver.status", causality="output"), "'output': it must be local"),
    "rate of nothing": ("variables", swapped(ROTOR, "cart.acceleration", rate_of="cart.speed"), "rate of 'cart.speed'"),
    "rate of a freedom": ("variables", swapped(ROTOR, "cart.velocity", rate_of=""), "must be that of cart.position"),
    "depends": ("variables", swapped(ROTOR, "cart.position", depends="stat"), "has depends = 'stat'"),
    "left out": ("variables", tuple(v for v in ROTOR.variables if v.name != "drive.applied_torque"), "outputs gives"),
    "output": ("freedoms", (CRANK._replace(rate="crank.sped"), CART), "no output crank.sped"),
    "no field": ("freedoms", (CRANK, CART._replace(initial=("postion", "cart_velocity"))), "start has no postion"),
    "kind": ("channels", (ROTOR.channels[0]._replace(kind="comand"), *ROTOR.channels[1:]), "is a 'comand'"),
    "order of channels": ("channels", ROTOR.channels[::-1], "must be the inputs in their order"),
    "link": ("links", (Link("cart", "cart.length", "cart.mass", "cart.inertia", ()),), "link cart has 'cart.length'"),
    "no published set": ("published", {}, "no published set"),
    "length": ("equations", ROTOR.equations._replace(derivative=lambda x, i, p: (0.0,)), "derivative gives 1 numbers"),
    "mode": (
        "freedoms",
        (CRANK._replace(mode=CRANK.mode._replace(arguments=("torque", "rate"))), CART),
        "is chosen by torque, rate",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_parts_that_do_not_fit_are_named(fault: str, tmp_path: Path) -> None:
    field, wrong, said = FAULTS[fault]
    broken = replace(ROTOR, **{field: wrong})
    with pytest.raises(MechanismError, match=f"mechanism {ROTOR.name}: .*{said}"):
        check(broken)
    with pytest.raises(MechanismError):
        build(broken, tmp_path)


def test_only_what_can_be_imported_goes_to_another_process() -> None:
    assert pickle.loads(pickle.dumps(ROTOR)) is ROTOR
    with pytest.raises(LinkworkError, match=r"is not the MECHANISM of tests\.mechanisms\.rotor_on_cart"):
        pickle.dumps(replace(ROTOR, title="another"))


def test_no_mechanism_takes_the_name_of_another() -> None:
    with pytest.raises(MechanismError, match="five-bar with the FMU FiveBarSlider already"):
        register(replace(PENDULUM, name="five-bar"))
    assert MECHANISMS["five-bar"] is FIVE_BAR


def branching(x: Any, i: Any, p: Any) -> Any:
    return (x[0], 1.0 if x[0] > 0.0 else 0.0, *x[2:])


def by_numpy(x: Any, i: Any, p: Any) -> Any:
    return (float(x[0]), *x[1:])


@pytest.mark.parametrize(("derivative", "said"), [(branching, "branches on"), (by_numpy, "is not an expression")])
def test_equations_that_cannot_be_traced_are_named(derivative: Any, said: str) -> None:
    modules, equations = (sys.modules[__name__], *PENDULUM.modules), PENDULUM.equations._replace(derivative=derivative)
    own = replace(PENDULUM, equations=equations, modules=modules)
    with pytest.raises(LinkworkError, match=f"the derivative of {PENDULUM.name},? .*{said}.* of math"):
        expressions(own)
    with pytest.raises(LinkworkError, match="is in none of the modules"):
        expressions(replace(own, modules=PENDULUM.modules))


def test_ensemble_of_inputs_that_differ_in_kind() -> None:
    """A motor acts where it is and nowhere else, in whatever order the runs come."""
    motor = InductionMotor(breakdown_torque=0.5, breakdown_slip=0.2, synchronous_speed=30.0)
    driven, plain = Inputs(torque=(0.2, motor)), Inputs(torque=0.2)
    p = demo(PENDULUM).parameters
    alone = {n: simulate(p, inputs, stop_time=0.5, step=0.01) for n, inputs in enumerate((driven, plain))}
    for order in ((0, 1), (1, 0)):
        found = simulate_many([p, p], [(driven, plain)[n] for n in order], stop_time=0.5, step=0.01)
        for run, n in zip(found, order):
            np.testing.assert_allclose(run.values, alone[n].values, rtol=1e-11, atol=1e-13)


def test_a_balance_without_kinetic_energy_is_refused() -> None:
    with pytest.raises(InputError, match=r"needs the output energy\.kinetic, which a pendulum does not have"):
        simulate(demo(PENDULUM).parameters, initial=demo(PENDULUM).initial, stop_time=0.1, step=0.1, method="balanced")


@pytest.mark.parametrize("mechanism", MECHANISMS.values(), ids=MECHANISMS)
def test_the_default_experiment_is_run_accurately(mechanism: Mechanism) -> None:
    start, stop, step, tolerance = mechanism.experiment
    assert 0.0 <= start < stop
    assert 0.0 < step <= 0.01 * (stop - start)
    assert 1e-12 <= tolerance <= 1e-6
