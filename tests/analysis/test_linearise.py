"""Linear models: against complex steps of the plain functions, small nonlinear motions, and Floquet theory."""

import cmath
from dataclasses import replace
from functools import cache
from itertools import product
from math import pi
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import fsolve

from analysis import InductionMotor, Inputs, TorsionBar, figures, linear, ramp
from analysis.linear import EquilibriumError, find_equilibria, find_equilibrium, linearise, linearise_orbit
from analysis.linkages import linkage
from analysis.mechanisms import FIVE_BAR
from analysis.numerics.tracing import rebind_functions
from analysis.periodic import find_orbit
from linkwork import friction
from linkwork.errors import AssemblyError, InputError, UnknownNameError
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.published import SETS, TABLE_3_1
from tests.strategies import rough, seeded

pytest.importorskip("casadi")

SPEED = SETS["table-3.1"].crank_speed
TURNING = Inputs(speed=SPEED)
LINEAR_OUTPUTS = linear.linear_outputs(FIVE_BAR)
TORQUE_INPUTS = ("drive.torque", "slider.force", "load.fx", "load.fy")
SPEED_INPUTS = ("slider.force", "load.fx", "load.fy", "drive.acceleration", "drive.speed", "crank.angle")
#: Far below every value, so that a complex step has no error but rounding.
STEP = 1e-30
PLAIN_INPUTS = ("torque", "acceleration", "force", "load_x", "load_y")


def complex_atan2(y: complex, x: complex) -> complex:
    real = cmath.phase(complex(x.real, y.real))
    # the derivative, on the branch that the real parts are on
    slope = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return complex(real, slope)


@cache
def plain() -> SimpleNamespace:
    """The plant's functions for complex numbers, bound anew not by way of `analysis.numerics.symbolic`."""
    elementary = {name: getattr(cmath, name) for name in ("sin", "cos", "sqrt", "tanh")} | {
        "atan2": lambda y, x: complex_atan2(complex(y), complex(x))
    }

    return rebind_functions((friction, kinematics, dynamics), elementary)


def complex_step(f: Any, x: Any) -> np.ndarray:
    """Derivatives of f with respect to each component of x, a column each."""
    columns = []
    for j in range(len(x)):
        moved = [complex(value) for value in x]
        moved[j] += 1j * STEP
        columns.append(np.imag(np.array(f(moved), dtype=complex)) / STEP)
    return np.array(columns).T


def as_inputs(x: Any, i: dynamics.Inputs) -> Inputs:
    """The same as `Inputs`, at time 0."""
    forces = {"force": i.force, "load_x": i.load_x, "load_y": i.load_y}
    if i.speed_drive:
        return Inputs(speed=ramp(x[2], x[2] + i.acceleration, 0.0, 1.0), **forces)
    return Inputs(torque=i.torque, **forces)


def residual(q: Any, qd: Any, qdd: Any, i: Any, p: Any) -> tuple[complex, complex]:
    f = plain()
    g = f.position(q[0], q[1], p)
    k = f.coefficients(g, p)
    w3, w4 = k.k32 * qd[0] + k.k3u * qd[1], k.k42 * qd[0] + k.k4u * qd[1]
    m = f.inertia(g, k, p)
    b1, b2 = f.velocity_terms(g, k, qd[0], w3, w4, *f.centripetal(g, qd[0], w3, w4, p), p)
    q1, q2 = f.applied_forces(g, k, q[1], qd[1], i.load_x, i.load_y, p)
    return (m.m11 * qdd[0] + m.m12 * qdd[1] + b1 - q1 - i.torque, m.m12 * qdd[0] + m.m22 * qdd[1] + b2 - q2 - i.force)


def assert_near(actual: np.ndarray, exact: np.ndarray, tolerance: float = 1e-10) -> None:
    """To the tolerance, relative to the largest entry of each row."""
    assert actual.shape == exact.shape
    size = np.abs(exact).max(axis=1, keepdims=True)
    assert np.all(np.abs(actual - exact) <= tolerance * size + 1e-300), np.abs(actual - exact).max()


@pytest.mark.parametrize("seed", range(25))
def test_second_order_form_is_that_of_complex_steps(seed: int) -> None:
    case = seeded(seed)
    p, x, i = case.parameters.constants(), case.state, case.torque_inputs
    q, qd = x[:2], x[2:4]
    qdd = dynamics.derivative(x, i, p)[2:4]
    model = linearise(case.parameters, x, as_inputs(x, i))
    assert max(map(abs, residual(q, qd, qdd, i, p))) < 1e-9
    assert_near(model.M, complex_step(lambda a: residual(q, qd, a, i, p), qdd))
    assert_near(model.C, complex_step(lambda r: residual(q, r, qdd, i, p), qd))
    assert_near(model.K, complex_step(lambda c: residual(c, qd, qdd, i, p), q))
    names = ("torque", "force", "load_x", "load_y")
    acting = [getattr(i, name) for name in names]
    forces = complex_step(lambda w: residual(q, qd, qdd, i._replace(**dict(zip(names, w))), p), acting)
    assert_near(model.F, -forces)
    assert model.M[0, 1] == model.M[1, 0]


def by_state(f: Any, x: Any, i: Any, p: Any) -> np.ndarray:
    return complex_step(lambda y: f((*y, 0.0, 0.0), i, p), x[:4])


def by_inputs(f: Any, x: Any, i: Any, p: Any) -> dict[str, np.ndarray]:
    columns = {}
    for name in PLAIN_INPUTS:
        columns[name] = complex_step(lambda w, name=name: f(x, i._replace(**{name: w[0]}), p), [getattr(i, name)])[:, 0]
    return columns


FUNCTIONS = {
    "derivative": lambda x, i, p: plain().derivative(x, i, p)[:4],
    "outputs": lambda x, i, p: [
        value for name, value in zip(FIVE_BAR.output_names, plain().outputs(x, i, 0.0, p)) if name in LINEAR_OUTPUTS
    ],
}


@pytest.mark.parametrize("drive", ["torque", "speed"])
@pytest.mark.parametrize("seed", range(25))
def test_first_order_form_and_outputs_are_those_of_complex_steps(seed: int, drive: str) -> None:
    case = rough(seed, drive) if seed % 2 else seeded(seed)
    p, x, i = case.parameters.constants(), case.state, case.inputs(drive)
    model = linearise(case.parameters, x, as_inputs(x, i))
    free, names = ([0, 1, 2, 3], TORQUE_INPUTS) if drive == "torque" else ([1, 3], SPEED_INPUTS)
    assert (2 * len(model.M), model.input_names) == (len(free), names)
    acting = ("force", "load_x", "load_y")
    acting = ("torque", *acting) if drive == "torque" else (*acting, "acceleration", "speed", "angle")
    for f, state, inputs in (("derivative", model.A, model.B), ("outputs", model.H, model.D)):
        whole = by_state(FUNCTIONS[f], x, i, p)
        columns = by_inputs(FUNCTIONS[f], x, i, p) | {"speed": whole[:, 2], "angle": whole[:, 0]}
        rows = free if f == "derivative" else slice(None)
        assert_near(state, whole[rows][:, free])
        assert_near(inputs, np.column_stack([columns[name] for name in acting])[rows])


def test_the_outputs_at_the_point_are_the_plants() -> None:
    case = seeded(3)
    model = linearise(case.parameters, case.state, as_inputs(case.state, case.torque_inputs))
    exact = dynamics.outputs(case.state, case.torque_inputs, 0.0, case.parameters.constants())
    named = dict(zip(FIVE_BAR.output_names, exact))
    assert model.outputs == pytest.approx([named[name] for name in LINEAR_OUTPUTS], rel=1e-11)
    assert model.acceleration == pytest.approx([named["crank.acceleration"], named["slider.acceleration"]], rel=1e-11)


# equilibria


@pytest.mark.parametrize("seed", range(12))
def test_the_plant_rests_at_every_equilibrium(seed: int) -> None:
    case = seeded(seed)
    p = case.parameters
    i = dynamics.Inputs(0.0, 0.05, 0.0, case.torque_inputs.force / 10.0, 1.0, -2.0)
    found = find_equilibria(p, as_inputs(case.state, i))
    assert found
    assert list(found) == sorted(found, key=lambda one: one.potential)
    for one in found:
        if dynamics.clearance(one.state, i, p.constants()) < 0.01:
            continue  # rounding errors are large so close to the limit of assembly
        rates = dynamics.derivative(one.state, i, p.constants())
        model = linearise(p, one.state, one.inputs)
        assert np.abs(model.M @ rates[2:4]).max() < 1e-8
        assert_near(model.K, one.stiffness)
        # constant forces have a potential
        assert model.K[0, 1] == pytest.approx(model.K[1, 0], rel=1e-7, abs=1e-7)
        assert one.stable == (np.linalg.eigvalsh(one.stiffness)[0] > 0.0)
        assert (model.poles.real.max() > 1e-9 * np.abs(model.poles).max()) == (not one.stable)
        squares = eigh(model.K, model.M, eigvals_only=True)
        assert model.natural_frequencies == pytest.approx(np.sqrt(squares[squares > 0.0]), rel=1e-7)


def test_equilibria_of_table_3_1() -> None:
    found = find_equilibria(TABLE_3_1)
    assert [one.stable for one in found] == [True, False, False, False, False, False]
    hanging = find_equilibrium(TABLE_3_1)
    assert hanging["crank.angle"] == found[0]["crank.angle"]
    # a free crank without weight of its own hangs where the coupler's weight pulls it, near straight down
    assert -0.6 * pi < hanging["crank.angle"] < -0.5 * pi
    # and every configuration beside it is higher
    for d2, du in ((1e-3, 0.0), (-1e-3, 0.0), (0.0, 1e-4), (0.0, -1e-4)):
        moved = replace(hanging, coordinates=hanging.coordinates + np.array([d2, du]))
        assert moved.potential > hanging.potential


@pytest.mark.parametrize(("lower", "upper"), [(20.0, 10.0), (2.0, 3.0), (0.5, 0.5)])
def test_all_equilibria_of_two_bars_that_stand_on_torsion_springs(lower: float, upper: float) -> None:
    """They lean to either side; soft springs let them hang and wind up, more than a radian. Against roots of the moments."""
    column = linkage("column", ground={"A": (0, 0)}, gravity=9.81)
    for name, bar, mass in (("lower", ("A", "B"), 2.0), ("upper", ("B", "C"), 3.0)):
        column.body(name, bar=bar, length=0.5, mass=mass, cog=(0.25, 0), inertia=mass * 0.5**2 / 12.0)
    for name, at, stiffness, free in (("first", "A", lower, 0.5 * pi), ("second", "B", upper, 0.0)):
        column.freedom(name, at, start=free)
        column.spring(f"{name}Spring", at=at, stiffness=stiffness, free=free)
    column.mechanism()

    def moments(q: np.ndarray) -> list[float]:
        second = 3.0 * 9.81 * 0.25 * np.cos(q[0] + q[1])
        first = 9.81 * (2.0 * 0.25 + 3.0 * 0.5) * np.cos(q[0])
        return [first + second + lower * (q[0] - 0.5 * pi), second + upper * q[1]]

    turn = np.linspace(-2.0 * pi, 2.0 * pi, 17)
    roots = [fsolve(moments, start, full_output=True)[::2] for start in product(turn, turn)]
    wanted = [q for q, code in roots if code == 1 and np.abs(q).max() < 2.0 * pi and np.abs(moments(q)).max() < 1e-8]
    found = find_equilibria("column")
    assert np.abs([moments(one.coordinates) for one in found]).max() < 1e-8
    assert len(wanted) > 2
    for q in wanted:
        assert min(np.abs(one.coordinates - q).max() for one in found) < 1e-6


def test_each_equilibrium_of_a_chain_is_found_once() -> None:
    """Each of three pendulums hangs or stands, whether its angle comes out as half a turn to the left or to the right."""
    chain = linkage("chain", ground={"A": (0, 0)}, gravity=9.81)
    for name, pins in zip("abc", ("AB", "BC", "CD")):
        chain.body(f"{name}Bar", bar=tuple(pins), length=0.2, mass=0.3, inertia=1e-3)
        chain.freedom(name, pins[0], driven=False)
    chain.mechanism()
    found = {tuple(np.round(one.coordinates, 6)) for one in find_equilibria("chain")}
    straight = set(product((round(-0.5 * pi, 6), round(0.5 * pi, 6)), *2 * [(0.0, round(pi, 6))]))
    assert {tuple(value + 0.0 for value in q) for q in found} == straight
    assert len(find_equilibria("chain")) == 8


def test_a_stiff_spring_hides_no_equilibrium_of_a_crank() -> None:
    """Of a four-bar whose rocker shaft lies on a stiff spring: the crank has a place of least potential and one of greatest."""
    stiff = linkage("stiff-bearing", ground={"A": (0, 0), "O": (0.15, 0)}, gravity=9.81)
    stiff.body("crank", bar=("A", "B"), length=0.05, mass=0.1).body("coupler", bar=("B", "C"), length=0.15, mass=0.3)
    stiff.body("rocker", bar=("D", "C"), length=0.12, mass=0.2).body("bearing", points={"D": (0, 0)}, mass=1.5)
    stiff.slide("Y", body="bearing", through="O", direction=1.2).spring("k", at="Y", stiffness=4e3, free=-2e-3)
    stiff.freedom("crank", "A", driven=False).freedom("up", "Y", driven=False).mechanism()
    assert [one.stable for one in find_equilibria("stiff-bearing")] == [True, False]


@pytest.mark.parametrize("order", [("lower", "upper"), ("upper", "lower")])
@pytest.mark.parametrize(("thrust", "stable"), [(1.5, True), (2.08, True), (2.09, False)])
def test_zieglers_column_flutters_under_a_thrust_along_its_upper_bar(order: Any, thrust: float, stable: bool) -> None:
    """The critical thrust of masses 2 m and m on bars of length l with springs k is (7/2 - sqrt 2) k/l (Ziegler 1952)."""
    column = linkage("follower", ground={"A": (0, 0)}, loads=[{"point": "C", "frame": "body"}])
    for name, bar, mass in (("lower", ("A", "B"), 2.0), ("upper", ("B", "C"), 1.0)):
        column.body(name, bar=bar, length=1.0, mass=mass, cog=(1.0, 0), inertia=0.0)
        column.spring(f"{name}Spring", at=bar[0], stiffness=1.0)
    for name in order:
        column.freedom(name, {"lower": "A", "upper": "B"}[name], driven=False)
    column.mechanism()
    assert find_equilibrium("follower", Inputs(C_load_x=-thrust), guess=(0.0, 0.0)).stable is stable


def test_an_equilibrium_from_which_a_force_law_drives_vibrations_is_not_stable() -> None:
    block = linkage("driven-block", ground={"O": (0, 0)})
    block.body("block", points={"P": (0, 0)}, mass=1.0).slide("X", body="block", through="O")
    block.spring("belt", at="X", stiffness=100.0, law="-0.5*v").freedom("block", "X", driven=False).mechanism()
    assert not find_equilibrium("driven-block").stable


def test_equilibrium_with_the_crank_held() -> None:
    held = find_equilibrium(TABLE_3_1, Inputs(force=2.0), held={"crank.angle": 0.3})
    outputs = dynamics.outputs(held.state, dynamics.Inputs(1.0, 0.0, 0.0, 2.0, 0.0, 0.0), 0.0, TABLE_3_1.constants())
    assert abs(outputs.slider_acceleration) < 1e-10
    torque = held.holding["crank.angle"]
    assert torque == pytest.approx(outputs.drive_applied_torque, rel=1e-10)
    assert torque == pytest.approx(held["drive.applied_torque"], rel=1e-10)
    assert (held["crank.angle"], held.stable, held.inputs) == (0.3, True, Inputs(force=2.0, speed=0.0))
    # the same torque on a free crank keeps it there
    free = find_equilibrium(TABLE_3_1, Inputs(torque=torque, force=2.0), guess=(0.31, 0.0))
    assert free.coordinates == pytest.approx(held.coordinates, abs=1e-9)


def test_a_neutral_equilibrium_is_found_and_not_called_stable() -> None:
    horizontal = SETS["rig-2-spring-c"].parameters
    one = find_equilibrium(horizontal, guess=(0.4, 0.001))
    assert one["slider.position"] == pytest.approx(0.0, abs=1e-12)
    assert not one.stable


# periodic motions


@pytest.fixture(scope="module")
def turning():
    return linearise_orbit(TABLE_3_1, find_orbit(TABLE_3_1, speed=SPEED))


def test_monodromy_is_that_of_the_variational_equations(turning) -> None:
    orbit = find_orbit(TABLE_3_1, speed=SPEED)
    assert turning.monodromy() == pytest.approx(orbit.monodromy, rel=1e-7)
    # as is that of states given at equal times
    again = linearise_orbit(TABLE_3_1, turning.states, TURNING)
    assert again.monodromy() == pytest.approx(turning.monodromy(), rel=1e-12)
    assert again.period == pytest.approx(turning.period, rel=1e-12)


def test_multipliers_of_a_motor_drive() -> None:
    """The crank's speed varies: equal angles are no equal times, and the motor's slope damps the speed."""
    motor = InductionMotor(breakdown_torque=6.0, breakdown_slip=0.2, synchronous_speed=40.0)
    orbit = find_orbit(TABLE_3_1, torque=motor)
    along = linearise_orbit(TABLE_3_1, orbit, samples=256)
    assert np.ptp(along.states[:, 2]) > 1.0

    def torque(w2: complex) -> complex:
        slip = 1.0 - w2 / 40.0
        return 12.0 / (slip / 0.2 + 0.2 / slip)

    w2 = along.states[:, 2]
    assert along.channels[:, 0] == pytest.approx(torque(w2), rel=1e-9)
    values = np.linalg.eigvals(along.monodromy(1e-11))
    values = values[np.argsort(np.abs(values - 1.0))]
    # along the motion nothing dies out; across it, the multipliers of the section
    assert values[0] == pytest.approx(1.0, abs=1e-6)
    expected = sorted(orbit.multipliers, key=lambda z: (abs(z), z.imag))
    assert np.array(sorted(values[1:], key=lambda z: (abs(z), z.imag))) == pytest.approx(np.array(expected), abs=1e-6)


@pytest.mark.parametrize(
    ("law", "torque"),
    [
        (
            InductionMotor(breakdown_torque=6.0, breakdown_slip=0.2, synchronous_speed=40.0),
            lambda angle, speed: 12.0 / ((1.0 - speed / 40.0) / 0.2 + 0.2 / (1.0 - speed / 40.0)),
        ),
        (TorsionBar(torque=10.0, release_angle=1.5), lambda angle, speed: 10.0 * (1.0 - angle / 1.5)),
    ],
)
def test_drives_that_depend_on_the_state_are_part_of_the_model(law: Any, torque: Any) -> None:
    """Rates and outputs of the plain functions under the law itself, by differences."""
    x, p = np.array([0.4, 0.002, 30.0, 0.1, 0.0, 0.0]), TABLE_3_1.constants()
    model = linearise(TABLE_3_1, x[:4], Inputs(torque=(1.0, law), force=2.0))

    def rates_and_outputs(y: np.ndarray) -> np.ndarray:
        applied = FIVE_BAR.equations.apply_inputs((0.0,), (1.0 + torque(y[0], y[2]), 0.0, 0.0, 2.0, 0.0, 0.0), p)
        outputs = FIVE_BAR.equations.outputs(tuple(y), applied, 0.0, p)
        kept = [outputs[FIVE_BAR.output_names.index(name)] for name in model.output_names]
        return np.array([*FIVE_BAR.equations.derivative(tuple(y), applied, p)[:4], *kept])

    steps = 1e-5 * np.eye(6)[:4]
    slopes = np.array([(rates_and_outputs(x + h) - rates_and_outputs(x - h)) / 2e-5 for h in steps]).T
    sizes = np.abs(slopes).max(axis=0)
    assert model.A / sizes == pytest.approx(slopes[:4] / sizes, abs=1e-6)
    assert model.H / sizes == pytest.approx(slopes[4:] / sizes, abs=1e-6)


def test_the_samples_are_models_and_their_mean_is_the_mean(turning) -> None:
    one = turning[5]
    alone = linearise(TABLE_3_1, turning.states[5], TURNING)
    for name in ("M", "C", "K", "F", "H", "D", "A", "B", "outputs"):
        assert getattr(one, name) == pytest.approx(getattr(alone, name), rel=1e-13, abs=1e-13)
    mean = turning.mean()
    assert pytest.approx(np.mean([m.K[0, 0] for m in map(turning.__getitem__, range(len(turning)))])) == mean.K[0, 0]
    assert turning.motion()(turning.times[7]) == pytest.approx(turning.states[7, :4], abs=1e-9)


# refusals

LOOSE, DRY = replace(TABLE_3_1, gravity=0.0, slider_stiffness=0.0), replace(TABLE_3_1, slider_coulomb_friction=0.5)
ZERO, PUSHED, AT = (0.0,) * 4, Inputs(force=5.0), {"crank.angle": 0.3}


@pytest.mark.parametrize(
    ("ask", "error", "said"),
    [
        (lambda _: find_equilibrium(LOOSE, PUSHED), EquilibriumError, r"under force 5"),
        (lambda _: find_equilibrium(LOOSE, PUSHED, held=AT), EquilibriumError, "angle = 0.3 under force"),
        (lambda _: find_equilibrium(LOOSE, PUSHED, held=AT, guess=(0.0, 0.0)), EquilibriumError, "0.25 N.m is left"),
        (lambda _: find_equilibrium(TABLE_3_1, Inputs(torque=1.0), held=AT), InputError, "both torque and speed"),
        (lambda _: find_equilibrium(TABLE_3_1, held={"crank.angle": np.inf}), InputError, r"crank\.angle is inf"),
        (lambda _: find_equilibrium(TABLE_3_1, held={"slider.position": 0.0}), InputError, r"slider\.p.*crank\.angle"),
        (lambda _: find_equilibrium(TABLE_3_1, Inputs(speed=4.0)), InputError, "speed 4, but in the state it is 0"),
        (lambda _: find_equilibrium(TABLE_3_1, Inputs(force=ramp(0.0, 1.0, 0.0, 1.0))), InputError, "constant"),
        (lambda _: find_equilibrium(TABLE_3_1, guess=(0.0,)), InputError, "2 finite numbers"),
        (lambda _: find_equilibrium(TABLE_3_1, guess=["30 deg", 0.0]), InputError, "2 finite numbers"),
        (lambda _: find_equilibrium(TABLE_3_1, guess=(0.0, 1.0)), AssemblyError, "cannot be joined"),
        (lambda a: a.mean().to_state_space(("slider.positon",)), UnknownNameError, r"slider\.position"),
        (lambda a: a.mean().to_state_space(inputs=("drive.torque",)), UnknownNameError, r"no drive\.torque"),
        (lambda a: a.mean().to_state_space(("energy.supplied",)), linear.LinearModelError, "an integral over"),
        (lambda a: a.mean().to_state_space(("closure.residual",)), linear.LinearModelError, "zero everywhere"),
        (lambda _: linearise(TABLE_3_1, (0.0, 0.0, 0.0)), InputError, "shape"),
        (lambda _: linearise(TABLE_3_1, (0.0, 0.0, np.nan, 0.0)), InputError, "not finite"),
        (lambda _: linearise(TABLE_3_1, ["30 deg", 0.0, 0.0, 0.0]), InputError, "must be numbers in SI"),
        (lambda _: linearise(TABLE_3_1, ZERO, Inputs(speed=1.0)), InputError, "speed 1, but in the state it is 0"),
        (lambda _: linearise(TABLE_3_1, ZERO, Inputs(axial_force=1.0)), InputError, "has no input 'axial_force'"),
        (lambda _: linearise(TABLE_3_1, (0.0, 1.0, 0.0, 0.0)), AssemblyError, "cannot be joined"),
        (lambda _: linearise(TABLE_3_1, np.zeros((2, 4))), InputError, "linearise_orbit"),
        (lambda a: linearise_orbit(TABLE_3_1, a.states[:5], TURNING), InputError, f"at least {linear.LEAST_SAMPLES}"),
        (lambda a: linearise_orbit(TABLE_3_1, a.states[[*range(len(a)), 0]], TURNING), InputError, "evenly"),
        (lambda a: linearise_orbit(TABLE_3_1, a.states, TURNING, period=2.0 * a.period), InputError, "evenly"),
        (lambda a: linearise_orbit(TABLE_3_1, a.states), InputError, "period must be given"),
        (lambda a: linearise_orbit(TABLE_3_1, a.states, TURNING, period=-1.0), InputError, r"period is -1\.0 s"),
        # dry friction passes between the samples, or is hit by one of them
        (lambda _: linearise_orbit(DRY, find_orbit(DRY, speed=SPEED)), InputError, "128 samples .* out dry friction"),
    ],
)
def test_what_is_not_usable_is_refused(turning, ask, error, said) -> None:
    with pytest.raises(error, match=said):
        ask(turning)


# for python-control, and drawn


def test_state_space_has_the_names_and_poles_of_the_model() -> None:
    rest = find_equilibrium(TABLE_3_1)
    model = linearise(TABLE_3_1, rest.state, rest.inputs)
    system = model.to_state_space(("slider.position", "pin.C.fx"))
    assert system.input_labels == ["drive_torque", "slider_force", "load_fx", "load_fy"]
    assert system.output_labels == ["slider_position", "pin_C_fx"]
    assert system.state_labels == ["crank_angle", "slider_position", "crank_speed", "slider_velocity"]
    assert np.sort_complex(system.poles()) == pytest.approx(np.sort_complex(model.poles), rel=1e-10)


@pytest.mark.parametrize("gain", [2.0, 20.0])
def test_margins_are_marked_where_the_loop_has_them(gain: float) -> None:
    """g/(s + 1)^3 turns by 180 deg at sqrt(3), where it is g/8; above g = 8 the closed loop is not stable."""
    loop = control.tf([gain], [1.0, 3.0, 3.0, 1.0])
    above, below = figures.plot_bode({"loop": loop}, margins=True).axes
    bars = {line.get_gid(): line.get_xydata() for line in (*above.lines, *below.lines) if line.get_gid()}
    (words,) = [text.get_text() for text in above.get_legend().get_texts()]
    if gain > 8.0:
        assert bars == {}
        assert words == "loop: the closed loop is not stable"
        return
    assert bars["gain margin"] == pytest.approx(np.array([[3.0**0.5, gain / 8.0], [3.0**0.5, 1.0]]))
    crossing = (gain ** (2.0 / 3.0) - 1.0) ** 0.5
    phase = -3.0 * np.degrees(np.arctan(crossing))
    assert bars["phase margin"] == pytest.approx(np.array([[crossing, phase], [crossing, -180.0]]), rel=1e-4)
    assert words == f"loop: gain margin 4, phase margin {180.0 + phase:.1f} deg"


def test_the_plot_of_a_design_has_its_margins(turning) -> None:
    design = linear.design_pid(turning.mean(), bandwidth=150.0)
    above, _ = figures.plot(design, title="PID").axes
    (words,) = [text.get_text() for text in above.get_legend().get_texts()]
    assert f"phase margin {np.degrees(design.phase_margin):.1f} deg" in words


def test_bode_and_pole_plots(turning) -> None:
    model = turning.mean()
    above, below = figures.plot(model, frequencies=[1.0, 10.0, 100.0], title="one").axes
    assert (above.get_ylabel(), below.get_xlabel()) == ("magnitude [m/N]", "frequency [rad/s]")
    m, c, k = model.M[0, 0], model.C[0, 0], model.K[0, 0]
    exact = [1.0 / (k - m * w * w + 1j * c * w) for w in (1.0, 10.0, 100.0)]
    assert above.lines[0].get_ydata() == pytest.approx(np.abs(exact), rel=1e-9)
    assert below.lines[0].get_ydata() == pytest.approx(np.degrees(np.angle(exact)), rel=1e-9)
    axis = figures.plot_poles({"": model.to_state_space(("slider.acceleration",), ("slider.force",))}).axes[0]
    curves = {line.get_label(): line for line in axis.lines}
    assert np.abs(curves["poles"].get_xdata()) == pytest.approx(np.abs(model.poles.real))
    # force to acceleration: two zeros at nothing
    assert curves["zeros"].get_ydata() == pytest.approx([0.0, 0.0], abs=1e-6)
