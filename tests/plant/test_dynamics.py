"""Dynamics: against the redundant form, against the laws of mechanics, and against known numbers."""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from math import cos, hypot, log, pi, radians, sin, tanh
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.integrate import solve_ivp

from linkwork.five_bar import dynamics as D
from linkwork.five_bar import kinematics as K
from linkwork.five_bar.parameters import Constants, FiveBarParameters
from linkwork.five_bar.published import SETS, TABLE_3_1
from linkwork.friction import FRICTION_SPEED
from tests import published
from tests.oracles.multipliers import FORCE_NAMES, assemble, rates, solve_multipliers
from tests.published import CM, DYN, DYN_CM, DYN_PER_CM, DYN_S_PER_CM
from tests.strategies import LEAST_SINE, Case, cases, seeded, sine

SEEDS = range(40)
several = settings(max_examples=100, derandomize=True, deadline=None)
REST = D.Inputs(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Evaluation(NamedTuple):
    """Everything the equations say about one state under one set of inputs."""

    g: K.Position
    k: K.Coefficients
    m: D.Inertia
    motion: D.Motion
    forces: D.Reactions


def evaluate(x: D.State, i: D.Inputs, p: Constants) -> Evaluation:
    g = K.position(x[0], x[1], p)
    k = K.coefficients(g, p)
    motion = D.motion(g, k, x, i, p)
    return Evaluation(g, k, D.inertia(g, k, p), motion, D.reactions(g, x, motion, i, p))


def along(f: Callable[[D.State], Sequence[float]], x: D.State, dx: Sequence[float], h: float) -> list[float]:
    """Derivative of ``f`` at ``x`` in the direction ``dx``: central differences of order 6 with the step ``h``."""
    weights = ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))

    def at(n: int) -> Sequence[float]:
        return f(tuple(a + n * h * b for a, b in zip(x, dx)))  # type: ignore[arg-type]

    pairs = [(w, at(n), at(-n)) for n, w in weights]
    return [sum(w * (a[j] - b[j]) for w, a, b in pairs) / h for j in range(len(pairs[0][1]))]


def time_step(x: D.State, e: Evaluation) -> float:
    """Step of the differences (s): short against the turning of the links and the way to the limit of assembly."""
    speed = max(abs(x[2]), abs(e.motion.w3), abs(e.motion.w4))
    acceleration = max(abs(e.motion.crank_acceleration), abs(e.motion.e3), abs(e.motion.e4))
    return 3e-3 * e.g.s43**2 / max(speed, acceleration**0.5, 1.0)


# ------------------------------------------------------------------ the other formulation: Lagrange multipliers


def assert_agrees_with_multipliers(case: Case, i: D.Inputs) -> None:
    p = case.parameters.constants()
    x = case.state
    e = evaluate(x, i, p)
    q = assemble(case.parameters, x[0], x[1])
    solution = solve_multipliers(
        case.parameters,
        q,
        rates(case.parameters, q, x[2], x[3]),
        torque=i.torque,
        slider_force=i.force,
        load=(i.load_x, i.load_y),
        crank_acceleration=i.acceleration if i.speed_drive else None,
    )
    # relative to the largest of the like quantities: those of the crank pin are what one of the slider compares with
    angular = solution.accelerations[:3]
    tolerance = 1e-12 * np.abs(angular).max()
    found = (e.motion.crank_acceleration, e.motion.e3, e.motion.e4)
    assert found == pytest.approx(tuple(angular), rel=0.0, abs=tolerance)
    slider = float(solution.accelerations[3])
    assert e.motion.slider_acceleration == pytest.approx(
        slider, rel=0.0, abs=max(1e-12 * abs(slider), p.l2 * tolerance)
    )
    forces = tuple(solution.forces[name] for name in FORCE_NAMES)
    tolerance = 1e-12 * max(abs(f) for f in forces)
    assert tuple(e.forces) == pytest.approx(forces, rel=0.0, abs=tolerance)
    assert e.motion.torque == pytest.approx(solution.torque, rel=1e-12, abs=p.l2 * tolerance)


@settings(max_examples=200, derandomize=True, deadline=None)
@given(case=cases())
def test_redundant_form_agrees_at_given_torque(case: Case) -> None:
    assert_agrees_with_multipliers(case, case.torque_inputs)


@settings(max_examples=200, derandomize=True, deadline=None)
@given(case=cases())
def test_redundant_form_agrees_at_given_speed(case: Case) -> None:
    assert_agrees_with_multipliers(case, case.speed_inputs)


def test_redundant_form_agrees_on_seeded_mechanisms() -> None:
    # hypothesis likes round numbers; these are general ones
    for seed in range(250):
        case = seeded(seed)
        assert_agrees_with_multipliers(case, case.torque_inputs)
        assert_agrees_with_multipliers(case, case.speed_inputs)


# ------------------------------------------------------------------ the laws of mechanics, on links one by one


class Bodies(NamedTuple):
    """Centres of mass of crank, coupler, rocker and slider, their velocities, and the links' turning speeds."""

    places: tuple[complex, ...]
    velocities: tuple[complex, ...]
    spins: tuple[float, ...]


def bodies(x: D.State, par: FiveBarParameters) -> Bodies:
    """The links one by one, from their angles; only the angles and rates are taken from the program."""
    th2, u, w2, v, _, _ = x
    p = par.constants()
    g = K.position(th2, u, p)
    k = K.coefficients(g, p)
    w3, w4 = k.k32 * w2 + k.k3u * v, k.k42 * w2 + k.k4u * v
    th3, th4 = K.coupler_angle(g), K.rocker_angle(g)
    guide = cmath.rect(1.0, par.slider_guide_angle)
    crank_pin = cmath.rect(par.crank_length, th2)
    slider_pin = par.ground_length + u * guide
    arms = (
        cmath.rect(par.crank_cog_distance, th2 + par.crank_cog_angle),
        cmath.rect(par.coupler_cog_distance, th3 + par.coupler_cog_angle),
        cmath.rect(par.rocker_cog_distance, th4 + par.rocker_cog_angle),
    )
    return Bodies(
        (arms[0], crank_pin + arms[1], slider_pin + arms[2], slider_pin),
        (1j * w2 * arms[0], 1j * (w2 * crank_pin + w3 * arms[1]), v * guide + 1j * w4 * arms[2], v * guide),
        (w2, w3, w4, 0.0),
    )


def masses(par: FiveBarParameters) -> tuple[float, float, float, float]:
    return par.crank_mass, par.coupler_mass, par.rocker_mass, par.slider_mass


def own_inertias(par: FiveBarParameters) -> tuple[float, float, float, float]:
    """Moments of inertia about the own centres of mass."""
    crank = par.crank_inertia - par.crank_mass * par.crank_cog_distance**2
    return crank, par.coupler_inertia, par.rocker_inertia, 0.0


def gravity(par: FiveBarParameters) -> complex:
    return -1j * par.gravity * cmath.exp(-1j * par.ground_inclination)


def cross(a: complex, b: complex) -> float:
    return (a.conjugate() * b).imag


def slider_resistance(x: D.State, par: FiveBarParameters) -> float:
    """Spring, damper and friction: their force on the slider along the guide."""
    spring = par.slider_stiffness * (x[1] - par.slider_spring_free_position)
    return -spring - par.slider_damping * x[3] - par.slider_coulomb_friction * tanh(x[3] / FRICTION_SPEED)


@several
@given(case=cases())
def test_kinetic_and_potential_energy_are_those_of_the_links(case: Case) -> None:
    par, x = case.parameters, case.state
    p = par.constants()
    b = bodies(x, par)
    g = K.position(x[0], x[1], p)
    kinetic = 0.5 * sum(m * abs(v) ** 2 for m, v in zip(masses(par), b.velocities))
    kinetic += 0.5 * sum(i * w**2 for i, w in zip(own_inertias(par), b.spins))
    assert D.kinetic_energy(D.inertia(g, K.coefficients(g, p), p), x[2], x[3]) == pytest.approx(kinetic, rel=1e-10)
    weights = [-m * (gravity(par).conjugate() * r).real for m, r in zip(masses(par), b.places)]
    spring = 0.5 * par.slider_stiffness * (x[1] - par.slider_spring_free_position) ** 2
    scale = sum(abs(w) for w in weights) + spring
    assert D.potential_energy(g, x[1], p) == pytest.approx(sum(weights) + spring, abs=1e-12 * scale)


@several
@given(case=cases())
def test_inertia_matrix_is_positive_definite(case: Case) -> None:
    m = evaluate(case.state, case.torque_inputs, case.parameters.constants()).m
    assert m.m11 > 0.0
    assert m.m22 > 0.0
    assert m.m11 * m.m22 > m.m12**2


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_terms_take_no_power_beyond_the_change_of_inertia(seed: int) -> None:
    # M' - 2 C is skew: q' . b = q' M' q' / 2
    case = seeded(seed)
    x, p = case.state, case.parameters.constants()
    e = evaluate(x, REST, p)
    _, _, w2, v, _, _ = x

    def twice_energy(y: D.State) -> tuple[float]:
        m = evaluate(y, REST, p).m
        return (m.m11 * w2 * w2 + 2 * m.m12 * w2 * v + m.m22 * v * v,)

    (change,) = along(twice_energy, x, (w2, v, 0.0, 0.0, 0.0, 0.0), time_step(x, e))
    g3, g4 = K.centripetal(e.g, w2, e.motion.w3, e.motion.w4, p)
    b1, b2 = D.velocity_terms(e.g, e.k, w2, e.motion.w3, e.motion.w4, g3, g4, p)
    assert b1 * w2 + b2 * v == pytest.approx(0.5 * change, abs=1e-8 * (abs(b1 * w2) + abs(b2 * v)))


@pytest.mark.parametrize("seed", SEEDS)
def test_weights_and_spring_are_the_gradient_of_the_potential_energy(seed: int) -> None:
    case = seeded(seed)
    x, p = case.state, case.parameters.constants()
    e = evaluate(x, REST, p)

    def potential(y: D.State) -> tuple[float]:
        return (D.potential_energy(K.position(y[0], y[1], p), y[1], p),)

    step = 5e-3 * e.g.s43**2
    (by_angle,) = along(potential, x, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), step)
    (by_slider,) = along(potential, x, (0.0, p.l1, 0.0, 0.0, 0.0, 0.0), step)
    q1, q2 = D.applied_forces(e.g, e.k, x[1], 0.0, 0.0, 0.0, p)
    scale = abs(q1) + abs(q2) * p.l1
    assert (q1, q2 * p.l1) == pytest.approx((-by_angle, -by_slider), abs=1e-8 * scale)


@pytest.mark.parametrize("drive", ["torque", "speed"])
@pytest.mark.parametrize("seed", SEEDS)
def test_power_balance(seed: int, drive: str) -> None:
    # d(KE + PE)/dt = supplied - dissipated, and both are the powers of the forces named
    case = seeded(seed)
    par, x = case.parameters, case.state
    i = case.torque_inputs if drive == "torque" else case.speed_inputs
    p = par.constants()
    e = evaluate(x, i, p)
    dx = D.derivative(x, i, p)
    (change,) = along(lambda y: (D.mechanical_energy(y, p),), x, dx, time_step(x, e))
    assert change == pytest.approx(dx[5] - dx[4], abs=1e-7 * max(abs(dx[5]), abs(dx[4]), abs(change)))
    vx, vy = K.coupler_point_velocity(e.g, x[2], e.motion.w3, p)
    assert dx[5] == pytest.approx(e.motion.torque * x[2] + i.force * x[3] + i.load_x * vx + i.load_y * vy, rel=1e-12)
    assert dx[4] == pytest.approx(
        x[3] * (par.slider_damping * x[3] + par.slider_coulomb_friction * tanh(x[3] / FRICTION_SPEED)), rel=1e-12
    )
    assert dx[4] >= 0.0


@pytest.mark.parametrize("drive", ["torque", "speed"])
@pytest.mark.parametrize("seed", SEEDS)
def test_momentum_balance_of_the_whole_mechanism(seed: int, drive: str) -> None:
    # the forces of the ground (pin A, guide), spring, damper, control, load and weight make the change of momentum
    case = seeded(seed)
    par, x = case.parameters, case.state
    i = case.torque_inputs if drive == "torque" else case.speed_inputs
    p = par.constants()
    e = evaluate(x, i, p)

    def momentum(y: D.State) -> tuple[float, float, float]:
        b = bodies(y, par)
        total = sum(m * v for m, v in zip(masses(par), b.velocities))
        spin = sum(m * cross(r, v) for m, r, v in zip(masses(par), b.places, b.velocities))
        return total.real, total.imag, spin + sum(j * w for j, w in zip(own_inertias(par), b.spins))

    px, py, spin = along(momentum, x, D.derivative(x, i, p), time_step(x, e))
    f = e.forces
    b = bodies(x, par)
    guide = cmath.rect(1.0, par.slider_guide_angle)
    on_slider = guide * (i.force + slider_resistance(x, par)) + 1j * guide * f.guide
    load = complex(i.load_x, i.load_y)
    weights = [m * gravity(par) for m in masses(par)]
    external = complex(f.ax, f.ay) + on_slider + load + sum(weights)
    scale = max(abs(complex(f.ax, f.ay)), abs(on_slider), abs(load), abs(sum(weights)))
    assert (external.real, external.imag) == pytest.approx((px, py), abs=1e-7 * scale)
    # and their moments about A make the change of moment of momentum
    moment = e.motion.torque + cross(b.places[3], on_slider) + cross(complex(*K.coupler_point(e.g, p)), load)
    moment += sum(cross(r, w) for r, w in zip(b.places, weights))
    lever = max(abs(b.places[3]), abs(complex(*K.coupler_point(e.g, p))))
    assert moment == pytest.approx(spin, abs=1e-7 * scale * lever)


@pytest.mark.parametrize("seed", SEEDS)
def test_newtons_law_of_each_link(seed: int) -> None:
    # pin by pin: which link a force acts on, and its sign
    case = seeded(seed)
    par, x, i = case.parameters, case.state, case.torque_inputs
    p = par.constants()
    e = evaluate(x, i, p)

    def momenta(y: D.State) -> list[float]:
        return [c for m, v in zip(masses(par), bodies(y, par).velocities) for c in (m * v.real, m * v.imag)]

    change = along(momenta, x, D.derivative(x, i, p), time_step(x, e))
    f = e.forces
    a, b, c, d = complex(f.ax, f.ay), complex(f.bx, f.by), complex(f.cx, f.cy), complex(f.dx, f.dy)
    guide = cmath.rect(1.0, par.slider_guide_angle)
    net = (
        a - b,  # ground on crank; crank on coupler
        b + c + complex(i.load_x, i.load_y),  # rocker on coupler
        d - c,  # slider on rocker
        guide * (i.force + slider_resistance(x, par)) + 1j * guide * f.guide - d,
    )
    scale = max(abs(z) for z in (a, b, c, d, *net))
    for link, (force, mass) in enumerate(zip(net, masses(par))):
        expected = complex(*change[2 * link : 2 * link + 2])
        assert abs(force + mass * gravity(par) - expected) < 1e-7 * scale


def test_rocker_weight_of_the_listing_has_the_wrong_sign() -> None:
    # appendix 1's FY45 turns the rocker's weight round: with it the force at D is wrong by twice the weight, at rest too
    x = (radians(40.0), 0.0, 0.0, 0.0, 0.0, 0.0)
    p = TABLE_3_1.constants()
    i = D.Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    e = evaluate(x, i, p)
    ay = along(lambda y: [bodies(y, TABLE_3_1).velocities[2].imag], x, D.derivative(x, i, p), 1e-5)[0]
    weight = TABLE_3_1.rocker_mass * TABLE_3_1.gravity
    # force at D from the rocker's vertical equation, with the weight downwards and as the listing has it
    right = TABLE_3_1.rocker_mass * ay + e.forces.cy + weight
    listing = TABLE_3_1.rocker_mass * ay + e.forces.cy - weight
    assert e.forces.dy == pytest.approx(right, rel=1e-9)
    assert e.forces.dy - listing == pytest.approx(2.0 * weight, rel=1e-8)


# ------------------------------------------------------------------ symmetries


def mirrored(case: Case) -> Case:
    """The case seen in a mirror along the ground link: every angle negated, the other assembly, gravity turned."""
    par, x = case.parameters, case.state

    def turn(i: D.Inputs) -> D.Inputs:
        return i._replace(torque=-i.torque, acceleration=-i.acceleration, load_y=-i.load_y)

    names = ("crank_cog_angle", "coupler_cog_angle", "rocker_cog_angle", "slider_guide_angle", "coupler_point_angle")
    parameters = replace(
        par,
        **{name: -getattr(par, name) for name in names},
        ground_inclination=pi - par.ground_inclination,
        assembly_branch=-par.assembly_branch,
    )
    state = (-x[0], x[1], -x[2], x[3], x[4], x[5])
    return Case(parameters, state, turn(case.torque_inputs), turn(case.speed_inputs))


#: Outputs that change their sign in the mirror.
TURNED = {
    "crank_angle",
    "crank_speed",
    "crank_acceleration",
    "coupler_angle",
    "rocker_angle",
    "coupler_point_y",
    "drive_applied_torque",
    "slider_guide_force",
    *(f"pin_{pin}_fy" for pin in "ABCD"),
}


@pytest.mark.parametrize("drive", ["torque", "speed"])
@pytest.mark.parametrize("seed", SEEDS)
def test_mirror_image_moves_as_the_mechanism_does(seed: int, drive: str) -> None:
    case = seeded(seed)
    image = mirrored(case)
    pick = (lambda c: c.torque_inputs) if drive == "torque" else (lambda c: c.speed_inputs)
    direct = D.outputs(case.state, pick(case), 0.0, case.parameters.constants())
    image_out = D.outputs(image.state, pick(image), 0.0, image.parameters.constants())
    for name, expected, value in zip(D.Outputs._fields, direct, image_out):
        sign = -1.0 if name in TURNED else 1.0
        assert sign * value == pytest.approx(expected, rel=1e-9, abs=1e-9), name


@pytest.mark.parametrize("seed", SEEDS)
def test_backwards_in_time_without_dissipation(seed: int) -> None:
    case = seeded(seed)
    p = replace(case.parameters, slider_damping=0.0, slider_coulomb_friction=0.0).constants()
    th2, u, w2, v, _, _ = case.state
    forth = D.derivative((th2, u, w2, v, 0.0, 0.0), case.torque_inputs, p)
    back = D.derivative((th2, u, -w2, -v, 0.0, 0.0), case.torque_inputs, p)
    assert back[2:4] == pytest.approx(forth[2:4], rel=1e-12)
    assert forth[4] == 0.0


@pytest.mark.parametrize("seed", range(10))
def test_other_units_give_the_same_motion(seed: int) -> None:
    # a model m times as heavy and l times as long, running t times as slowly
    case = seeded(seed)
    m, l, t = 3.0, 0.7, 1.9  # noqa: E741
    par, x, i = replace(case.parameters, slider_coulomb_friction=0.0), case.state, case.torque_inputs
    lengths = [n for n in FiveBarParameters.__slots__ if n.endswith(("_length", "_distance", "_position"))]
    factors = dict.fromkeys(lengths, l)
    factors |= dict.fromkeys((n for n in FiveBarParameters.__slots__ if n.endswith("_mass")), m)
    factors |= dict.fromkeys((n for n in FiveBarParameters.__slots__ if n.endswith("_inertia")), m * l**2)
    factors |= {"slider_stiffness": m / t**2, "slider_damping": m / t, "gravity": l / t**2}
    model = replace(par, **{name: factor * getattr(par, name) for name, factor in factors.items()})
    force = m * l / t**2
    motion = D.derivative(x, i, par.constants())
    scaled = D.derivative(
        (x[0], x[1] * l, x[2] / t, x[3] * l / t, 0.0, 0.0),
        D.Inputs(0.0, i.torque * force * l, 0.0, i.force * force, i.load_x * force, i.load_y * force),
        model.constants(),
    )
    power = force * l / t
    units = (1 / t, l / t, 1 / t**2, l / t**2, power, power)
    assert scaled == pytest.approx([a * unit for a, unit in zip(motion, units)], rel=1e-10)


def test_friction_is_odd_and_levels_off() -> None:
    p = replace(TABLE_3_1, slider_damping=20.0, slider_coulomb_friction=3.0).constants()
    assert D.friction(0.0, p) == 0.0
    assert D.friction(0.5, p) == pytest.approx(20.0 * 0.5 + 3.0, rel=1e-14)
    assert D.friction(-0.5, p) == -D.friction(0.5, p)
    # tanh(1) of the level at 1 mm/s
    assert D.friction(1e-3, p) == pytest.approx(20.0 * 1e-3 + 3.0 * 0.7615941559557649, rel=1e-14)


# ------------------------------------------------------------------ motions


def run(
    p: Constants, x0: Sequence[float], inputs: Callable[[D.State], D.Inputs], times: Sequence[float], **options: Any
) -> Any:
    """A motion integrated tightly with SciPy."""
    return solve_ivp(
        lambda t, x: D.derivative(tuple(x.tolist()), inputs(x), p),
        (times[0], times[-1]),
        x0,
        method="DOP853",
        t_eval=None if len(times) == 2 else times,
        rtol=1e-12,
        atol=1e-14,
        **options,
    )


@pytest.mark.parametrize("seed", range(6))
def test_energy_is_conserved_in_a_free_undamped_run(seed: int) -> None:
    case = seeded(seed)
    p = replace(case.parameters, slider_damping=0.0, slider_coulomb_friction=0.0).constants()

    def limit(t: float, x: np.ndarray) -> float:
        return sine(case, x[0], x[1]) - 0.5 * LEAST_SINE

    limit.terminal = True  # type: ignore[attr-defined]
    result = run(p, case.state, lambda x: REST, (0.0, 0.2), events=limit)
    energies = np.array([D.mechanical_energy(tuple(x), p) for x in result.y.T.tolist()])
    kinetic = [D.kinetic_energy(evaluate(tuple(x), REST, p).m, x[2], x[3]) for x in result.y.T.tolist()]
    assert len(energies) > 10
    assert np.ptp(energies) < 1e-10 * max(kinetic)
    assert np.ptp(kinetic) > 1e-3 * max(kinetic)  # it did move


@pytest.mark.parametrize("drive", ["torque", "speed"])
@pytest.mark.parametrize("seed", range(3))
def test_energy_residual_stays_at_rounding_with_everything_switched_on(seed: int, drive: str) -> None:
    case = seeded(seed)
    p = case.parameters.constants()
    i = case.torque_inputs if drive == "torque" else case.speed_inputs

    def limit(t: float, x: np.ndarray) -> float:
        return sine(case, x[0], x[1]) - 0.5 * LEAST_SINE

    limit.terminal = True  # type: ignore[attr-defined]
    result = run(p, case.state, lambda x: i, (0.0, 0.1), events=limit)
    start = D.mechanical_energy(case.state, p)
    ends = [D.outputs(tuple(x), i, start, p) for x in result.y.T.tolist()]
    assert max(abs(o.energy_residual) for o in ends) < 1e-9 * max(o.energy_kinetic for o in ends)
    assert ends[-1].energy_dissipated > 0.0


def test_jump_of_speed_conserves_the_momentum_of_the_slider() -> None:
    for seed in range(40):
        case = seeded(seed)
        x, p = case.state, case.parameters.constants()
        m = evaluate(x, REST, p).m
        y = D.jump_speed(x, x[2] + 10.0, p)
        assert y[:2] == x[:2]
        assert y[2] == x[2] + 10.0
        assert m.m12 * y[2] + m.m22 * y[3] == pytest.approx(m.m12 * x[2] + m.m22 * x[3], rel=1e-12, abs=1e-12)
        # the work of the impulse is the change of kinetic energy, and it is the impulse times the mean speed
        impulse = m.m11 * 10.0 + m.m12 * (y[3] - x[3])
        assert y[5] - x[5] == pytest.approx(impulse * (x[2] + 5.0), rel=1e-9, abs=1e-9)
        assert y[5] - x[5] == pytest.approx(D.mechanical_energy(y, p) - D.mechanical_energy(x, p), rel=1e-9, abs=1e-9)


# ------------------------------------------------------------------ known numbers (tests/published.py)

SPEED = D.Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def steady(
    stiffness_dyn_cm: float, damping_dyn_s_cm: float = 3e4, turns: int = 12
) -> tuple[np.ndarray, np.ndarray, Any]:
    """Table 3.1 at 420 rpm after ``turns``: angles in degrees over one more turn, and states of shape (361, 6)."""
    return _steady(stiffness_dyn_cm, damping_dyn_s_cm, turns)


@lru_cache(maxsize=8)
def _steady(stiffness_dyn_cm: float, damping_dyn_s_cm: float, turns: int) -> tuple[np.ndarray, np.ndarray, Any]:
    parameters = replace(
        TABLE_3_1,
        slider_stiffness=stiffness_dyn_cm * DYN_PER_CM,
        slider_damping=damping_dyn_s_cm * DYN_S_PER_CM,
    )
    w = SETS["table-3.1"].crank_speed
    degrees = np.arange(361.0)
    times = np.concatenate([[0.0], (np.radians(degrees) + 2 * pi * turns) / w])
    p = parameters.constants()
    result = run(p, (0.0, 0.0, w, 0.0, 0.0, 0.0), lambda x: SPEED, times)
    return degrees, result.y.T[1:], p


def test_slider_at_the_known_angles_of_table_3_1() -> None:
    angles = list(published.U_CM_AT_CRANK_DEG)
    w = SETS["table-3.1"].crank_speed
    assert w == pytest.approx(14.0 * pi, rel=1e-15)
    times = [0.0, *(radians(a) / w for a in angles)]
    p = TABLE_3_1.constants()
    result = run(p, (0.0, 0.0, w, 0.0, 0.0, 0.0), lambda x: SPEED, times)
    found = result.y[1, 1:] / CM
    assert found == pytest.approx(list(published.U_CM_AT_CRANK_DEG.values()), abs=2e-10)  # the tenth digit printed
    f = evaluate(tuple(result.y[:, 1 + angles.index(360)]), SPEED, p).forces
    assert f.cx / DYN == pytest.approx(published.FORCE_AT_C_AT_360_DEG_DYN[0], abs=2e-3)
    assert f.cy / DYN == pytest.approx(published.FORCE_AT_C_AT_360_DEG_DYN[1], abs=2e-3)


def test_crank_torque_at_the_start_of_table_3_1() -> None:
    w = SETS["table-3.1"].crank_speed
    e = evaluate((0.0, 0.0, w, 0.0, 0.0, 0.0), SPEED, TABLE_3_1.constants())
    assert e.motion.torque / DYN_CM == pytest.approx(published.CRANK_TORQUE_AT_START_DYN_CM, rel=5e-10)


def test_steady_state_of_table_3_1() -> None:
    _, states, _ = steady(1e6)
    assert states[0, 1] / CM == pytest.approx(published.STEADY_U_CM, abs=1e-8)
    assert states[0, 3] / CM == pytest.approx(published.STEADY_U_RATE_CM_S, abs=1e-7)
    assert states[-1, 1] == pytest.approx(states[0, 1], abs=1e-9)


@pytest.mark.parametrize("stiffness_dyn_cm", [5e5, 1e6, 2e6])
def test_least_and_mean_steady_slider_position(stiffness_dyn_cm: float) -> None:
    # fig. 3.4; k = 5e5 is the slowest to settle
    degrees, states, _ = steady(stiffness_dyn_cm, turns=20)
    u = states[:, 1] / CM
    n = int(u[:-1].argmin())
    before, least, after = u[:-1][[n - 1, n, (n + 1) % 360]]
    at = degrees[n] + 0.5 * (before - after) / (before - 2 * least + after)
    assert at == pytest.approx(published.LEAST_STEADY_U_AT_DEG[stiffness_dyn_cm], abs=0.06)
    assert u[:-1].mean() == pytest.approx(published.MEAN_STEADY_U_CM[stiffness_dyn_cm], abs=6e-4)


def steady_torque_dyn_cm(stiffness_dyn_cm: float) -> tuple[np.ndarray, np.ndarray]:
    degrees, states, p = steady(stiffness_dyn_cm, turns=20)
    return degrees, np.array([evaluate(tuple(x), SPEED, p).motion.torque / DYN_CM for x in states.tolist()])


def test_steady_torque_hardly_depends_on_the_spring() -> None:
    # fig. 3.5: relative to the peak at the middle one of the three springs
    (_, soft), (_, middle), (_, stiff) = (steady_torque_dyn_cm(k) for k in (5e5, 1e6, 2e6))
    difference = np.abs(soft - stiff).max() / np.abs(middle).max()
    assert difference == pytest.approx(published.TORQUE_DIFFERENCE_OF_PEAK, abs=6e-4)


def test_steady_torque_reverses_steeply() -> None:
    degrees, torque = steady_torque_dyn_cm(1e6)
    (high_deg, high), (low_deg, low) = published.TORQUE_REVERSAL_DEG_DYN_CM
    assert (degrees[torque.argmax()], degrees[torque.argmin()]) == pytest.approx((high_deg, low_deg), abs=1.0)
    assert (torque.max(), torque.min()) == pytest.approx((high, low), rel=5e-3)


def test_drift_grows_without_gravity() -> None:
    # fig. 3.3, over ten turns with the dampers under which the drift is near linear
    w = SETS["table-3.1"].crank_speed
    for damping_dyn_s_cm in (5e5, 1e6):
        drifts = []
        for gravity_m_s2 in (TABLE_3_1.gravity, 0.0):
            p = replace(
                TABLE_3_1, slider_stiffness=0.0, slider_damping=damping_dyn_s_cm * DYN_S_PER_CM, gravity=gravity_m_s2
            ).constants()
            result = run(p, (0.0, 0.0, w, 0.0, 0.0, 0.0), lambda x: SPEED, (0.0, 10 * 2 * pi / w))
            drifts.append(result.y[1, -1])
        assert drifts[1] / drifts[0] == pytest.approx(published.DRIFT_GROWTH_WITHOUT_GRAVITY, abs=0.01)


@pytest.mark.parametrize("damping_dyn_s_cm", [1e4, 5e4, 1e5, 5e5])
def test_slider_without_spring_drifts_until_the_links_are_nearly_collinear(damping_dyn_s_cm: float) -> None:
    # fig. 3.2
    p = replace(TABLE_3_1, slider_stiffness=0.0, slider_damping=damping_dyn_s_cm * DYN_S_PER_CM).constants()
    w = SETS["table-3.1"].crank_speed

    def collinear(t: float, x: np.ndarray) -> float:
        return K.position(x[0], x[1], p).s43 - 0.3

    collinear.terminal = True  # type: ignore[attr-defined]
    result = run(p, (0.0, 0.0, w, 0.0, 0.0, 0.0), lambda x: SPEED, (0.0, 45 * 2 * pi / w), events=collinear)
    turns = result.t[-1] * w / (2 * pi)
    assert turns == pytest.approx(published.TURNS_TO_SINE_0_3[damping_dyn_s_cm], abs=0.5 if turns > 10 else 0.06)


def torque_run(torque_dyn_cm: float, end: float) -> tuple[float, np.ndarray]:
    """Fig. 3.6: T = T0 (1 - th2) from rest up to th2 = 1 rad, then none: the time of that, and the state at ``end``."""
    p = TABLE_3_1.constants()
    t0 = torque_dyn_cm * DYN_CM

    def one_radian(t: float, x: np.ndarray) -> float:
        return x[0] - 1.0

    one_radian.terminal = True  # type: ignore[attr-defined]
    one_radian.direction = 1.0  # type: ignore[attr-defined]
    first = run(p, [0.0] * 6, lambda x: REST._replace(torque=t0 * (1.0 - float(x[0]))), (0.0, 1.0), events=one_radian)
    t1 = float(first.t_events[0][0])
    if end <= t1:
        return t1, first.y_events[0][0]
    return t1, run(p, first.y_events[0][0], lambda x: REST, (t1, end)).y[:, -1]


def test_torque_driven_run_of_table_3_1() -> None:
    t1, x = torque_run(published.TORQUE_T0_DYN_CM, 0.25)
    assert t1 == pytest.approx(published.TORQUE_END_TIME_S, abs=1e-11)
    known = published.TORQUE_AT_0_25_S
    assert x[0] == pytest.approx(known["th2_rad"], abs=6e-8)
    assert x[1] / CM == pytest.approx(known["u_cm"], abs=6e-9)
    assert x[2] == pytest.approx(known["th2_rate_rad_s"], abs=6e-8)


def test_time_to_one_radian_goes_with_the_root_of_the_torque() -> None:
    # section 3.2.2: T0 t^2 is nearly constant, where the thesis has T0 t
    t_low, t_high = (torque_run(t0, 0.0)[0] for t0 in (1e7, 2e8))
    exponent = log(2e8 / 1e7) / log(t_high / t_low)
    assert exponent == pytest.approx(published.TORQUE_TIME_EXPONENT, abs=0.02)


def test_outputs_carry_the_configuration_and_the_forces() -> None:
    case = seeded(7)
    p, x, i = case.parameters.constants(), case.state, case.speed_inputs
    e = evaluate(x, i, p)
    o = D.outputs((*x[:4], 3.0, 5.0), i, 2.0, p)
    assert (o.crank_angle, o.slider_position, o.crank_speed, o.slider_velocity) == x[:4]
    assert (o.crank_acceleration, o.slider_acceleration) == e.motion[2:4]
    assert (o.pin_A_fx, o.pin_A_fy, o.pin_B_fx, o.pin_B_fy) == e.forces[:4]
    assert (o.pin_C_fx, o.pin_C_fy, o.pin_D_fx, o.pin_D_fy, o.slider_guide_force) == e.forces[4:]
    assert o.drive_applied_torque == e.motion.torque
    assert (cos(o.coupler_angle), sin(o.coupler_angle)) == pytest.approx((e.g.c3, e.g.s3), abs=1e-14)
    assert (cos(o.rocker_angle), sin(o.rocker_angle)) == pytest.approx((e.g.c4, e.g.s4), abs=1e-14)
    assert (o.coupler_point_x, o.coupler_point_y) == K.coupler_point(e.g, p)
    assert o.energy_kinetic + o.energy_potential == D.mechanical_energy(x, p)
    assert o.energy_residual == pytest.approx(o.energy_kinetic + o.energy_potential - 2.0 + 3.0 - 5.0, rel=1e-14)
    assert o.closure_residual < 1e-14
    assert sin(o.transmission_angle) == pytest.approx(abs(e.g.s43), abs=1e-14)
    assert hypot(o.pin_C_fx, o.pin_C_fy) > 0.0
