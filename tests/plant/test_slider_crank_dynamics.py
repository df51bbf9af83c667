"""Dynamics of the slider-crank: against Newton and Euler on each body in space, against the laws of mechanics on the
particles of the bodies, and against known numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, hypot, pi, radians, sin, sqrt, tanh
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.integrate import solve_ivp

from linkwork.friction import FRICTION_SPEED
from linkwork.slider_crank import dynamics as D
from linkwork.slider_crank import kinematics as K
from linkwork.slider_crank import published
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters
from linkwork.slider_crank.vectors import scale
from tests.plant.test_dynamics import along
from tests.published_rahman import INCH, POUND_FORCE, POUND_INCH, SPOTS, TORQUE_LB_IN, Spot
from tests.slider_cranks import DRIVES, Case, cases, seeded

SEEDS = range(40)
several = settings(max_examples=100, derandomize=True, deadline=None)
every_drive = pytest.mark.parametrize("drive", DRIVES)
REST = D.Inputs(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
AXIS = np.array([0.0, 0.0, 1.0])


class Evaluation(NamedTuple):
    """Everything the equations say about one state under one set of inputs."""

    q: K.Position
    k: K.Coefficients
    m: D.Inertia
    motion: D.Motion
    forces: D.Reactions


def evaluate(x: D.State, i: D.Inputs, p: Constants) -> Evaluation:
    q = K.position(x[0], x[1], p)
    k = K.coefficients(q, p)
    motion = D.motion(q, k, x, i, p)
    return Evaluation(q, k, D.inertia(q, k, p), motion, D.reactions(q, x, motion, i, p))


def time_step(x: D.State, e: Evaluation, p: Constants) -> float:
    """Step of the differences (s): short against the turning of the links and the way to the limit of assembly."""
    acceleration = max(abs(e.motion.crank_acceleration), abs(e.motion.shift_acceleration) / p.a1)
    return 2e-3 * (e.q.h / p.a2) ** 2 / max(abs(x[2]), abs(x[3]) / p.a1, acceleration**0.5, 1.0)


# ------------------------------------------------------------------ the bodies as particles


class Body(NamedTuple):
    """Particles of a rigid body: masses (n,), places and velocities in the ground frame (n, 3)."""

    masses: np.ndarray
    places: np.ndarray
    velocities: np.ndarray

    @property
    def mass(self) -> float:
        return float(self.masses.sum())

    @property
    def centre(self) -> np.ndarray:
        return self.masses @ self.places / self.mass

    def inertia(self) -> np.ndarray:
        """Tensor of inertia about the centre of mass (3, 3)."""
        r = self.places - self.centre
        return np.eye(3) * (self.masses @ (r * r).sum(axis=1)) - np.einsum("n,ni,nj->ij", self.masses, r, r)

    def kinetic_energy(self) -> float:
        return 0.5 * float(self.masses @ (self.velocities**2).sum(axis=1))

    def momentum(self) -> np.ndarray:
        return self.masses @ self.velocities

    def moment_of_momentum(self) -> np.ndarray:
        """About the origin of the ground frame."""
        return self.masses @ np.cross(self.places, self.velocities)


def crank_particles(par: SliderCrankParameters) -> tuple[np.ndarray, np.ndarray]:
    """Six particles in frame 2 with the crank's mass, centre of mass, inertia about the axis and products of inertia."""
    m = par.crank_mass
    cog = np.array([par.crank_cog_x, par.crank_cog_y, par.crank_cog_z])
    # integrals of x x, x y ... about the centre of mass; that of z z is free, and large enough for real particles
    square = 0.5 * (par.crank_inertia - m * (cog[0] ** 2 + cog[1] ** 2))
    xz, yz = par.crank_product_xz - m * cog[0] * cog[2], par.crank_product_yz - m * cog[1] * cog[2]
    second = np.array([[square, 0.0, xz], [0.0, square, yz], [xz, yz, 2.0 * (xz * xz + yz * yz) / square + square]])
    sizes, axes = np.linalg.eigh(second)
    arms = np.sqrt(3.0 * sizes / m) * axes
    return np.full(6, m / 6.0), cog + np.concatenate([arms.T, -arms.T])


def rod_particles(par: SliderCrankParameters, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two particles on the rod's line and a ring of four about it, from the centre of mass: half of the inertia each."""
    m, inertia = par.rod_mass, par.rod_inertia
    u = line / np.linalg.norm(line)
    j = np.cross(u, np.eye(3)[np.argmin(np.abs(u))])
    j /= np.linalg.norm(j)
    k = np.cross(u, j)
    half, radius = sqrt(inertia / m), sqrt(2.0 * inertia / m)
    arms = np.array([half * u, -half * u, radius * j, -radius * j, radius * k, -radius * k])
    return np.array([m / 4.0] * 2 + [m / 8.0] * 4), arms


def guide_frame(par: SliderCrankParameters) -> np.ndarray:
    """Axes of frame 4 by rows."""
    c, s = cos(par.guide_twist), sin(par.guide_twist)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


class Pins(NamedTuple):
    """Places and velocities of both pins, and the angular velocity of the rod without spin."""

    p2: np.ndarray
    p3: np.ndarray
    v2: np.ndarray
    v3: np.ndarray
    turn: np.ndarray


def pins(x: D.State, par: SliderCrankParameters) -> Pins:
    """The pins from the lengths; the slider's position and the rate that keeps the rod's length are solved for here."""
    th, s1, w, v, _, _ = x
    p2 = np.array([par.crank_length * cos(th), par.crank_length * sin(th), s1])
    v2 = w * np.cross(AXIS, p2) + v * AXIS
    way = -guide_frame(par)[2]
    arm = np.array([-par.guide_offset, 0.0, 0.0]) - p2
    # |arm + s4 way| = a2
    s4 = -arm @ way + par.assembly_branch * sqrt((arm @ way) ** 2 - arm @ arm + par.rod_length**2)
    p3 = np.array([-par.guide_offset, 0.0, 0.0]) + s4 * way
    rod = p3 - p2
    v3 = (v2 @ rod) / (way @ rod) * way
    return Pins(p2, p3, v2, v3, np.cross(rod, v3 - v2) / (rod @ rod))


def bodies(x: D.State, par: SliderCrankParameters) -> tuple[Body, Body, Body]:
    """Crank, rod and slider."""
    th, s1, w, v, _, _ = x
    at = pins(x, par)
    turned = np.array([[cos(th), -sin(th), 0.0], [sin(th), cos(th), 0.0], [0.0, 0.0, 1.0]])
    masses, places = crank_particles(par)
    places = places @ turned.T + s1 * AXIS
    crank = Body(masses, places, w * np.cross(AXIS, places) + v * AXIS)
    line = at.p3 - at.p2
    share = par.rod_cog_distance / par.rod_length
    masses, arms = rod_particles(par, line)
    velocity = at.v2 + share * (at.v3 - at.v2)
    rod = Body(masses, at.p2 + share * line + arms, velocity + np.cross(at.turn, arms))
    cog = at.p3 + np.array([par.slider_cog_x, par.slider_cog_y, par.slider_cog_z]) @ guide_frame(par)
    return crank, rod, Body(np.array([par.slider_mass]), cog[None, :], at.v3[None, :])


def gravity(par: SliderCrankParameters) -> np.ndarray:
    return np.array([par.gravity_x, par.gravity_y, par.gravity_z])


def slider_push(s4: float, v4: float, load: float, par: SliderCrankParameters) -> float:
    """Load, spring, damper and friction: their force on the slider along the guide."""
    spring = par.slider_stiffness * (s4 - par.slider_spring_free_position)
    return load - spring - par.slider_damping * v4 - par.slider_coulomb_friction * tanh(v4 / FRICTION_SPEED)


def shift_push(s1: float, v: float, par: SliderCrankParameters) -> float:
    """Spring and damper on the shift."""
    return -par.shift_stiffness * (s1 - par.shift_spring_free_position) - par.shift_damping * v


def slider_motion(at: Pins, par: SliderCrankParameters) -> tuple[float, float]:
    """Slider position and velocity."""
    way = -guide_frame(par)[2]
    return float(at.p3 @ way), float(at.v3 @ way)


@several
@given(case=cases())
def test_energies_are_those_of_the_particles(case: Case) -> None:
    par, x = case.parameters, case.state
    p = case.p
    parts = bodies(x, par)
    q = K.position(x[0], x[1], p)
    kinetic = sum(body.kinetic_energy() for body in parts)
    assert D.kinetic_energy(D.inertia(q, K.coefficients(q, p), p), x[2], x[3]) == pytest.approx(kinetic, rel=1e-9)
    weights = [-float(body.mass * gravity(par) @ body.centre) for body in parts]
    s4, _ = slider_motion(pins(x, par), par)
    springs = 0.5 * par.slider_stiffness * (s4 - par.slider_spring_free_position) ** 2
    springs += 0.5 * par.shift_stiffness * (x[1] - par.shift_spring_free_position) ** 2
    size = sum(map(abs, weights)) + springs
    assert D.potential_energy(q, x[1], p) == pytest.approx(sum(weights) + springs, abs=1e-12 * size)
    assert D.mechanical_energy(x, p) == pytest.approx(kinetic + sum(weights) + springs, abs=1e-9 * (kinetic + size))


def test_particles_have_the_inertia_of_the_parameters() -> None:
    # of the test's own particles: what they stand for
    for seed in range(10):
        case = seeded(seed)
        par = case.parameters
        masses, places = crank_particles(par)
        assert masses.sum() == pytest.approx(par.crank_mass)
        assert masses @ (places[:, 0] ** 2 + places[:, 1] ** 2) == pytest.approx(par.crank_inertia)
        assert masses @ (places[:, 0] * places[:, 2]) == pytest.approx(par.crank_product_xz)
        assert masses @ (places[:, 1] * places[:, 2]) == pytest.approx(par.crank_product_yz)
        assert masses @ places / masses.sum() == pytest.approx([par.crank_cog_x, par.crank_cog_y, par.crank_cog_z])
        _, rod, _ = bodies(case.state, par)
        at = pins(case.state, par)
        u = (at.p3 - at.p2) / par.rod_length
        across = np.eye(3) - np.outer(u, u)
        tensor = rod.inertia()
        assert across @ tensor @ across == pytest.approx(par.rod_inertia * across, abs=1e-12)
        assert u @ tensor @ u == pytest.approx(par.rod_inertia)  # an inertia about the line, of no effect


@several
@given(case=cases())
def test_inertia_matrix_is_that_of_the_particles_and_positive_definite(case: Case) -> None:
    par, (th, s1, *_) = case.parameters, case.state
    m = evaluate(case.state, REST, case.p).m

    def energy(w: float, v: float) -> float:
        return sum(body.kinetic_energy() for body in bodies((th, s1, w, v, 0.0, 0.0), par))

    a1 = par.crank_length
    assert m.m11 == pytest.approx(2.0 * energy(1.0, 0.0), rel=1e-9)
    assert m.m22 * a1 * a1 == pytest.approx(2.0 * energy(0.0, a1), rel=1e-9)
    assert m.m12 * a1 == pytest.approx(0.5 * (energy(1.0, a1) - energy(1.0, -a1)), abs=1e-9 * (m.m11 + m.m22 * a1 * a1))
    assert m.m11 > 0.0
    assert m.m22 > 0.0
    assert m.m11 * m.m22 > m.m12**2


# ------------------------------------------------------------------ the other formulation: Newton and Euler, body by body

#: Unknowns of the 29 equations: accelerations of the freedoms, of the rod's centre of mass and of the slider, the rod's
#: angular acceleration; forces in the pins, on bearing and guide, and their moments; what drives, holds and grooves supply.
UNKNOWNS = {
    "crank_acceleration": 1,
    "shift_acceleration": 1,
    "rod_acceleration": 3,
    "rod_turning": 3,
    "slider_acceleration": 1,
    "crank_pin": 3,
    "slider_pin": 3,
    "bearing": 3,
    "bearing_moment": 3,
    "guide": 2,
    "guide_moment": 3,
    "torque": 1,
    "force": 1,
    "groove_force": 1,
}


def skew(a: np.ndarray) -> np.ndarray:
    """Matrix of a x."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def solve_bodies(case: Case, drive: str) -> dict[str, np.ndarray]:
    """All unknowns from the equations of motion of three bodies in space, the pins' accelerations, and the drives."""
    par, x, i = case.parameters, case.under(drive), case.inputs(drive)
    th, s1, w, v, _, _ = x
    at = pins(x, par)
    crank, rod, slider = bodies(x, par)
    g = gravity(par)
    frame = guide_frame(par)
    way = -frame[2]
    s4, v4 = slider_motion(at, par)
    ends = np.cumsum(list(UNKNOWNS.values()))
    place = {name: slice(end - size, end) for (name, size), end in zip(UNKNOWNS.items(), ends)}
    rows: list[np.ndarray] = []
    right: list[np.ndarray] = []

    def equation(value: Any, **terms: Any) -> None:
        """The rows: the sum of each term's matrix times the unknown of its name is ``value``."""
        value = np.atleast_1d(np.asarray(value, dtype=float))
        row = np.zeros((len(value), ends[-1]))
        for name, matrix in terms.items():
            row[:, place[name]] = np.asarray(matrix, dtype=float).reshape(len(value), -1)
        rows.append(row)
        right.append(value)

    one = np.eye(3)
    # accelerations of the crank's particles: e k x r + a k - w^2 (r across the axis)
    turning = np.cross(AXIS, crank.places)
    inward = -w * w * (crank.places * np.array([1.0, 1.0, 0.0]))
    m = crank.masses
    equation(
        crank.mass * g - m @ inward,
        crank_acceleration=m @ turning,
        shift_acceleration=crank.mass * AXIS,
        bearing=-one,
        crank_pin=one,
    )
    equation(
        np.cross(crank.centre, crank.mass * g) - m @ np.cross(crank.places, inward),
        crank_acceleration=m @ np.cross(crank.places, turning),
        shift_acceleration=m @ np.cross(crank.places, AXIS),
        bearing_moment=-one,
        crank_pin=skew(at.p2),
    )
    equation(rod.mass * g, rod_acceleration=rod.mass * one, crank_pin=-one, slider_pin=-one)
    tensor = rod.inertia()
    arm2, arm3 = at.p2 - rod.centre, at.p3 - rod.centre
    equation(-np.cross(at.turn, tensor @ at.turn), rod_turning=tensor, crank_pin=-skew(arm2), slider_pin=-skew(arm3))
    equation(
        slider.mass * g + slider_push(s4, v4, i.load, par) * way,
        slider_acceleration=slider.mass * way,
        slider_pin=one,
        guide=-frame[:2].T,
    )
    cog = slider.centre - at.p3
    equation(np.cross(cog, slider.mass * g), slider_acceleration=slider.mass * np.cross(cog, way), guide_moment=-one)
    # the rod's ends go with crank and slider
    equation(
        -w * w * at.p2 * np.array([1.0, 1.0, 0.0]) - np.cross(at.turn, np.cross(at.turn, arm2)),
        rod_acceleration=one,
        rod_turning=-skew(arm2),
        crank_acceleration=-np.cross(AXIS, at.p2),
        shift_acceleration=-AXIS,
    )
    equation(
        -np.cross(at.turn, np.cross(at.turn, arm3)),
        rod_acceleration=one,
        rod_turning=-skew(arm3),
        slider_acceleration=-way,
    )
    # groove of eq 28: the shift's force in it turns the crank against its pitch
    amplitude, ratio = par.groove_amplitude, par.groove_ratio
    pitch = amplitude * ratio * cos(ratio * th)
    bend = -amplitude * ratio * ratio * sin(ratio * th)
    equation(0.0, bearing_moment=AXIS, torque=-1.0, groove_force=pitch if i.groove else 0.0)
    equation(shift_push(s1, v, par), bearing=AXIS, force=-1.0, groove_force=-1.0)
    if i.speed_drive:
        equation(i.acceleration, crank_acceleration=1.0)
    else:
        equation(i.torque, torque=1.0)
    if i.groove:
        equation(bend * w * w, shift_acceleration=1.0, crank_acceleration=-pitch)
        equation(i.force, force=1.0)
    else:
        equation(0.0, groove_force=1.0)
        if i.shift_drive:
            equation(i.shift_acceleration, shift_acceleration=1.0)
        else:
            equation(i.force, force=1.0)
    matrix = np.concatenate(rows)
    # rows and columns to a like size, for the sake of the condition
    row_size = np.abs(matrix).max(axis=1)
    column_size = np.abs(matrix / row_size[:, None]).max(axis=0)
    solution = np.linalg.solve(matrix / row_size[:, None] / column_size, np.concatenate(right) / row_size) / column_size
    return {name: solution[where] for name, where in place.items()}


def assert_agrees_with_bodies(case: Case, drive: str) -> None:
    p, i, x = case.p, case.inputs(drive), case.under(drive)
    e = evaluate(x, i, p)
    s = solve_bodies(case, drive)
    motion, f = e.motion, e.forces
    tolerance = 1e-9
    accelerations = [
        *s["crank_acceleration"] * p.a1,
        *s["shift_acceleration"],
        *s["slider_acceleration"],
    ]
    found = [motion.crank_acceleration * p.a1, motion.shift_acceleration, motion.slider_acceleration]
    size = max(map(abs, accelerations)) + (abs(x[2]) * p.a1 + abs(x[3])) ** 2 / p.a1
    assert found == pytest.approx(accelerations, rel=0.0, abs=tolerance * size)
    guide = s["guide"] @ guide_frame(case.parameters)[:2]
    pairs = [
        (f.crank_pin, s["crank_pin"]),
        (f.slider_pin, s["slider_pin"]),
        ((*f.bearing[:2], f.axial), s["bearing"]),
        (f.guide, guide),
        ((motion.force, motion.groove_force), (*s["force"] + s["groove_force"], *s["groove_force"])),
    ]
    size = max(np.abs(known).max() for _, known in pairs)
    for value, known in pairs:
        assert tuple(value) == pytest.approx(tuple(known), rel=0.0, abs=tolerance * size)
    assert f.bearing.z == 0.0
    size *= p.a1 + abs(x[1]) + abs(p.a4)
    assert f.bearing_moment == pytest.approx(tuple(s["bearing_moment"]), rel=0.0, abs=tolerance * size)
    assert f.guide_moment == pytest.approx(tuple(s["guide_moment"]), rel=0.0, abs=tolerance * size)
    assert motion.torque == pytest.approx(float(s["torque"][0]), rel=0.0, abs=tolerance * size)


@every_drive
@settings(max_examples=60, derandomize=True, deadline=None)
@given(case=cases())
def test_newton_and_euler_body_by_body_agree(drive: str, case: Case) -> None:
    assert_agrees_with_bodies(case, drive)


@every_drive
def test_newton_and_euler_agree_on_seeded_mechanisms(drive: str) -> None:
    # hypothesis likes round numbers; these are general ones
    for seed in range(60):
        assert_agrees_with_bodies(seeded(seed), drive)


# ------------------------------------------------------------------ Lagrange's equations from the energies


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_terms_and_forces_are_lagranges(seed: int) -> None:
    # b = M' q' - d(q' M q' / 2)/dq, and gravity and springs are -dV/dq
    case = seeded(seed)
    x, p = case.state, case.p
    e = evaluate(x, REST, p)
    _, s1, w, v, _, _ = x

    def inertia(y: D.State) -> D.Inertia:
        return evaluate(y, REST, p).m

    def potential(y: D.State) -> tuple[float]:
        return (D.potential_energy(K.position(y[0], y[1], p), y[1], p),)

    h = 3e-3 * (e.q.h / p.a2) ** 2
    by_angle = D.Inertia(*along(inertia, x, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), h))
    by_shift = D.Inertia(*along(inertia, x, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0), h * p.a1))
    rate = D.Inertia(*(a * w + b * v for a, b in zip(by_angle, by_shift)))
    expected = (
        rate.m11 * w + rate.m12 * v - D.kinetic_energy(by_angle, w, v),
        rate.m12 * w + rate.m22 * v - D.kinetic_energy(by_shift, w, v),
    )
    b1, b2 = D.velocity_terms(e.q, e.k, w, K.centripetal(e.q, e.k, w, v, p), p)
    size = abs(b1) + abs(b2) * p.a1
    assert (b1, b2 * p.a1) == pytest.approx((expected[0], expected[1] * p.a1), abs=1e-7 * size)
    (v1,) = along(potential, x, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), h)
    (v2,) = along(potential, x, (0.0, p.a1, 0.0, 0.0, 0.0, 0.0), h)
    q1, q2 = D.applied_forces(e.q, e.k, s1, 0.0, 0.0, 0.0, p)
    assert (q1, q2 * p.a1) == pytest.approx((-v1, -v2), abs=1e-7 * (abs(q1) + abs(q2) * p.a1))


# ------------------------------------------------------------------ balances of power and momentum


@every_drive
@pytest.mark.parametrize("seed", range(15))
def test_power_balance(seed: int, drive: str) -> None:
    # d(KE + PE)/dt = supplied - dissipated, and both are the powers of the forces named
    case = seeded(seed)
    par, p, x, i = case.parameters, case.p, case.under(drive), case.inputs(drive)
    e = evaluate(x, i, p)
    dx = D.derivative(x, i, p)
    assert dx[:4] == (x[2], x[3], e.motion.crank_acceleration, e.motion.shift_acceleration)
    (change,) = along(lambda y: (D.mechanical_energy(y, p),), x, dx, time_step(x, e, p))
    assert change == pytest.approx(dx[5] - dx[4], abs=1e-7 * (abs(dx[5]) + abs(dx[4]) + abs(change)))
    v4 = slider_motion(pins(x, par), par)[1]
    axial = e.motion.force - e.motion.groove_force
    assert dx[5] == pytest.approx(e.motion.torque * x[2] + axial * x[3] + i.load * v4, rel=1e-9)
    loss = par.slider_damping * v4**2 + par.slider_coulomb_friction * v4 * tanh(v4 / FRICTION_SPEED)
    assert dx[4] == pytest.approx(loss + par.shift_damping * x[3] ** 2, rel=1e-9)
    assert dx[4] >= 0.0


@every_drive
@pytest.mark.parametrize("seed", range(15))
def test_momentum_balance_of_the_whole_mechanism(seed: int, drive: str) -> None:
    # the forces of the ground, spring, damper, load and weight make the change of momentum, their moments that of its moment
    case = seeded(seed)
    par, p, x, i = case.parameters, case.p, case.under(drive), case.inputs(drive)
    e = evaluate(x, i, p)

    def momentum(y: D.State) -> np.ndarray:
        parts = bodies(y, par)
        moments = sum(body.moment_of_momentum() for body in parts)
        return np.concatenate([sum(body.momentum() for body in parts), moments])

    change = np.array(along(momentum, x, D.derivative(x, i, p), time_step(x, e, p)))  # type: ignore[arg-type]
    f = e.forces
    at = pins(x, par)
    s4, v4 = slider_motion(at, par)
    bearing = np.array([*f.bearing[:2], f.axial])
    on_slider = np.array(f.guide) - slider_push(s4, v4, i.load, par) * guide_frame(par)[2]
    weights = [(body.centre, body.mass * gravity(par)) for body in bodies(x, par)]
    force = bearing + on_slider + sum(weight for _, weight in weights)
    moment = np.array(f.bearing_moment) + np.cross(at.p3, on_slider) + f.guide_moment
    moment = moment + sum(np.cross(centre, weight) for centre, weight in weights)
    size = np.abs(bearing).max() + np.abs(on_slider).max() + np.abs(change[:3]).max()
    assert force == pytest.approx(change[:3], abs=1e-7 * size)
    assert moment == pytest.approx(change[3:], abs=1e-7 * size * np.abs([at.p2, at.p3]).max())


def test_axial_force_is_that_of_drive_groove_spring_and_damper() -> None:
    for drive in DRIVES:
        for seed in range(10):
            case = seeded(seed)
            x, i = case.under(drive), case.inputs(drive)
            e = evaluate(x, i, case.p)
            assert e.forces.axial == pytest.approx(
                e.motion.force + shift_push(x[1], x[3], case.parameters), rel=1e-9, abs=1e-9
            )
            pitch = K.groove(x[0], case.p).pitch
            assert e.forces.bearing_moment.z == pytest.approx(
                e.motion.torque - pitch * e.motion.groove_force, rel=1e-9, abs=1e-9
            )


def test_prescribed_motions_are_the_motions_under_the_forces_they_take() -> None:
    # what a drive by speed, shift or groove supplies, given as torque and force, makes the same motion
    for drive in DRIVES:
        for seed in range(20):
            case = seeded(seed)
            p, x, i = case.p, case.under(drive), case.inputs(drive)
            motion = evaluate(x, i, p).motion
            pitch = K.groove(x[0], p).pitch
            torque = motion.torque - pitch * motion.groove_force
            free = REST._replace(torque=torque, force=motion.force, load=i.load)
            again = evaluate(x, free, p).motion
            size = max(abs(motion.crank_acceleration) * p.a1, abs(motion.shift_acceleration), p.a1 * x[2] ** 2)
            assert (again.crank_acceleration * p.a1, again.shift_acceleration) == pytest.approx(
                (motion.crank_acceleration * p.a1, motion.shift_acceleration), abs=1e-9 * size
            )
            if i.speed_drive:
                assert motion.crank_acceleration == pytest.approx(i.acceleration, rel=1e-12)
            if i.shift_drive:
                assert motion.shift_acceleration == pytest.approx(i.shift_acceleration, rel=1e-12)


def test_groove_makes_shift_velocity_and_acceleration() -> None:
    for seed in range(20):
        case = seeded(seed)
        p, par, (th, _, w, v, *_) = case.p, case.parameters, case.state
        for drive, (_, _, groove) in DRIVES.items():
            x = D.grooved((th, 0.123, w, v, 3.0, 5.0), groove, p)
            if not groove:
                assert x == (th, 0.123, w, v, 3.0, 5.0)
                continue
            phase = par.groove_ratio * th
            assert x == pytest.approx(
                (
                    th,
                    par.groove_amplitude * sin(phase),
                    w,
                    par.groove_amplitude * par.groove_ratio * cos(phase) * w,
                    3.0,
                    5.0,
                ),
                rel=1e-13,
            )
            e = evaluate(x, case.inputs(drive), p).motion.crank_acceleration

            def shift_velocity(
                t: float, e: float = e, th: float = th, w: float = w, par: SliderCrankParameters = par
            ) -> float:
                angle, speed = th + w * t + 0.5 * e * t * t, w + e * t
                return par.groove_amplitude * par.groove_ratio * cos(par.groove_ratio * angle) * speed

            h = 1e-4 / max(abs(w), abs(e) ** 0.5)
            change = (
                (8 * (shift_velocity(h) - shift_velocity(-h)) - shift_velocity(2 * h) + shift_velocity(-2 * h)) / 12 / h
            )
            found = evaluate(x, case.inputs(drive), p).motion.shift_acceleration
            assert found == pytest.approx(change, rel=1e-8, abs=1e-8 * abs(w) ** 2 * p.a1)
            # whatever shift the state carries, derivative and outputs see the groove's
            assert D.derivative((th, 9.0, w, 9.0, 0.0, 0.0), case.inputs(drive), p) == D.derivative(
                (*x[:4], 0.0, 0.0), case.inputs(drive), p
            )
            assert D.outputs((th, 9.0, w, 9.0, 0.0, 0.0), case.inputs(drive), 0.0, p) == D.outputs(
                (*x[:4], 0.0, 0.0), case.inputs(drive), 0.0, p
            )


@every_drive
def test_jump_of_speeds_conserves_the_momentum_that_no_impulse_acts_on(drive: str) -> None:
    for seed in range(30):
        case = seeded(seed)
        p, i = case.p, case.inputs(drive)
        x = case.under(drive)
        y = D.jump((*x[:4], 3.0, 5.0), i, x[2] + 10.0, x[3] - 0.7, p)
        m = evaluate(x, i, p).m
        dw, dv = y[2] - x[2], y[3] - x[3]
        first, second = m.m11 * dw + m.m12 * dv, m.m12 * dw + m.m22 * dv
        assert y[:2] == x[:2]
        assert y[4] == 3.0
        # the impulses work at the mean of the speeds before and after, which is the change of kinetic energy
        work = first * (x[2] + 0.5 * dw) + second * (x[3] + 0.5 * dv)
        size = D.kinetic_energy(m, x[2], x[3]) + D.kinetic_energy(m, y[2], y[3])
        assert y[5] - 5.0 == pytest.approx(work, abs=1e-9 * size)
        assert y[5] - 5.0 == pytest.approx(D.mechanical_energy(y, p) - D.mechanical_energy(x, p), abs=1e-8 * size)
        if i.speed_drive:
            assert dw == pytest.approx(10.0, rel=1e-12)
        elif i.groove:
            assert (dw, dv) == pytest.approx((0.0, 0.0), abs=1e-14)
        else:
            assert first == pytest.approx(0.0, abs=1e-9 * (m.m11 * abs(dw) + abs(m.m12 * dv)))
        if i.shift_drive:
            assert dv == pytest.approx(-0.7, rel=1e-12)
        elif i.groove:
            assert y[3] == pytest.approx(K.groove(x[0], p).pitch * y[2], rel=1e-12)
        else:
            assert second == pytest.approx(0.0, abs=1e-9 * (abs(m.m12 * dw) + m.m22 * abs(dv)))


# ------------------------------------------------------------------ symmetries


#: Components of forces that change their sign in a mirror normal to y or z, and of moments and turning, that do not.
MIRRORS = {"y": ("y", "xz"), "z": ("z", "xy")}


def mirrored(case: Case, mirror: str) -> Case:
    """The case seen in the mirror y = 0 (the crank turns the other way) or z = 0 (the shift is the other way)."""
    par, (th, s1, w, v, _, _) = case.parameters, case.state

    def negated(*names: str) -> dict[str, float]:
        return {name: -getattr(par, name) for name in names}

    if mirror == "y":
        fields = negated(
            "crank_cog_y", "crank_product_yz", "slider_cog_y", "gravity_y", "groove_amplitude", "guide_twist"
        )
        return case._replace(
            parameters=replace(par, **fields),
            state=(-th, s1, -w, v, 0.0, 0.0),
            torque=-case.torque,
            acceleration=-case.acceleration,
        )
    fields = negated(
        "crank_cog_z",
        "crank_product_xz",
        "crank_product_yz",
        "slider_cog_y",
        "gravity_z",
        "groove_amplitude",
        "shift_spring_free_position",
    )
    return case._replace(
        parameters=replace(par, **fields, guide_twist=pi - par.guide_twist),
        state=(th, -s1, w, -v, 0.0, 0.0),
        force=-case.force,
        shift_acceleration=-case.shift_acceleration,
    )


def mirror_sign(name: str, mirror: str) -> float:
    """Sign of an output in the mirror."""
    polar, axial = MIRRORS[mirror]
    if name.startswith("rod_w") or name.startswith(("bearing_m", "guide_m")):
        return -1.0 if name[-1] in axial else 1.0
    if name[-2:] in ("_x", "_y", "_z", "fx", "fy", "fz"):
        return -1.0 if name[-1] in polar else 1.0
    flips = {
        "y": ("crank_angle", "crank_speed", "crank_acceleration", "drive_applied_torque"),
        "z": ("shift_position", "shift_velocity", "shift_acceleration", "axial_applied_force"),
    }
    return -1.0 if name in flips[mirror] else 1.0


@pytest.mark.parametrize("mirror", MIRRORS)
@every_drive
def test_mirror_image_moves_as_the_mechanism_does(drive: str, mirror: str) -> None:
    for seed in range(15):
        case = seeded(seed)
        image = mirrored(case, mirror)
        direct = D.outputs(case.state, case.inputs(drive), 0.0, case.p)
        seen = D.outputs(image.state, image.inputs(drive), 0.0, image.p)
        for name, expected, value in zip(D.Outputs._fields, direct, seen):
            assert mirror_sign(name, mirror) * value == pytest.approx(expected, rel=1e-8, abs=1e-8), name


@pytest.mark.parametrize("drive", ["torque-force", "torque-groove"])
def test_backwards_in_time_without_dissipation(drive: str) -> None:
    for seed in range(20):
        case = seeded(seed)
        par = replace(case.parameters, slider_damping=0.0, slider_coulomb_friction=0.0, shift_damping=0.0)
        th, s1, w, v, _, _ = case.state
        forth = D.derivative((th, s1, w, v, 0.0, 0.0), case.inputs(drive), par.constants())
        back = D.derivative((th, s1, -w, -v, 0.0, 0.0), case.inputs(drive), par.constants())
        assert back[2:4] == pytest.approx(forth[2:4], rel=1e-9)
        assert forth[4] == 0.0


@every_drive
@pytest.mark.parametrize("seed", range(5))
def test_other_units_give_the_same_motion(seed: int, drive: str) -> None:
    # a model m times as heavy and l times as long, running t times as slowly
    case = seeded(seed)
    m, l, t = 3.0, 0.7, 1.9  # noqa: E741
    par = replace(case.parameters, slider_coulomb_friction=0.0)
    force = m * l / t**2

    def factor(name: str) -> float:
        if name in ("groove_ratio", "guide_twist", "assembly_branch"):
            return 1
        kinds = {
            "_mass": m,
            "_inertia": m * l * l,
            "product_xz": m * l * l,
            "product_yz": m * l * l,
            "_stiffness": m / t**2,
            "_damping": m / t,
        }
        kinds |= dict.fromkeys(("gravity_x", "gravity_y", "gravity_z"), l / t**2)
        return next((value for end, value in kinds.items() if name.endswith(end)), l)

    model = replace(par, **{name: factor(name) * getattr(par, name) for name in SliderCrankParameters.__slots__})
    x, i = case.state, case.inputs(drive)
    motion = D.derivative(x, i, par.constants())
    scaled = D.derivative(
        (x[0], x[1] * l, x[2] / t, x[3] * l / t, 0.0, 0.0),
        i._replace(
            torque=i.torque * force * l,
            acceleration=i.acceleration / t**2,
            force=i.force * force,
            shift_acceleration=i.shift_acceleration * l / t**2,
            load=i.load * force,
        ),
        model.constants(),
    )
    power = force * l / t
    units = (1 / t, l / t, 1 / t**2, l / t**2, power, power)
    assert scaled == pytest.approx([a * unit for a, unit in zip(motion, units)], rel=1e-9)


# ------------------------------------------------------------------ the thesis's relations and numbers


@pytest.mark.parametrize("spot", SPOTS)
def test_spot_values_of_both_force_problems(spot: Spot) -> None:
    p = published.parameters(spot.offset_in, spot.twist_deg).constants()
    x = (radians(30.0), spot.shift_in * INCH, published.CRANK_SPEED, 0.0, 0.0, 0.0)
    i = REST._replace(speed_drive=1.0, shift_drive=1.0)
    e = evaluate(x, i, p)
    assert e.motion.torque / POUND_INCH == pytest.approx(spot.torque_lb_in, abs=6e-6)
    # the slider's load that leaves 100 lb.in to the crank
    load = (e.motion.torque - TORQUE_LB_IN * POUND_INCH) / e.k.kth
    assert load / POUND_FORCE == pytest.approx(spot.slider_force_lb, abs=6e-7)
    loaded = evaluate(x, i._replace(load=load), p)
    assert loaded.motion.torque / POUND_INCH == pytest.approx(TORQUE_LB_IN, rel=1e-12)


@pytest.mark.parametrize("angle_deg", [10.0, 75.0, 160.0, 250.0, 340.0])
def test_relations_of_the_thesis_that_hold_and_what_they_lack(angle_deg: float) -> None:
    par = published.parameters(20.0, 310.0)
    p = par.constants()
    shift = 3.5 * INCH
    x = (radians(angle_deg), shift, published.CRANK_SPEED, 0.0, 0.0, 0.0)
    e = evaluate(x, REST._replace(speed_drive=1.0, shift_drive=1.0, load=17.0), p)
    f, q = e.forces, e.q
    size = hypot(*f.bearing_moment)
    # the full relations: the thesis leaves the axial force out
    assert f.bearing_moment.x == pytest.approx(-f.bearing.y * shift + f.axial * p.a1 * q.s, abs=1e-12 * size)
    assert f.bearing_moment.y == pytest.approx(f.bearing.x * shift - f.axial * p.a1 * q.c, abs=1e-12 * size)
    assert abs(f.axial * p.a1) > 0.01 * size
    # 4T4 = 0, and at constant speed the rod's force across the crank balances the torque: 2F2j = -T/a1
    assert f.guide_moment == (0.0, 0.0, 0.0)
    on_crank = K.to_crank_frame(scale(-1.0, f.crank_pin), q)
    assert on_crank.y == pytest.approx(-e.motion.torque / p.a1, rel=1e-12)
    # 2F2k = 0 does not hold
    assert abs(on_crank.z) > 0.1
    # with the slider's centre of mass off the pin there is a moment
    moved = replace(par, slider_cog_y=0.01).constants()
    assert hypot(*evaluate(x, REST._replace(speed_drive=1.0), moved).forces.guide_moment) > 1e-3


def test_planar_mechanism_has_the_textbooks_forces() -> None:
    # in line, light rod, at constant speed: T = (push of the slider) times the velocity ratio, all in the plane
    par = SliderCrankParameters(
        crank_length=0.1,
        rod_length=0.4,
        guide_twist=1.5 * pi,
        crank_mass=1.0,
        crank_inertia=0.01,
        slider_mass=2.0,
    )
    p = par.constants()
    for th in np.linspace(0.1, 6.1, 13).tolist():
        x = (th, 0.0, 10.0, 0.0, 0.0, 0.0)
        e = evaluate(x, REST._replace(speed_drive=1.0, shift_drive=1.0, load=-30.0), p)
        lean = np.arcsin(0.1 * cos(th) / 0.4)
        acceleration = e.motion.slider_acceleration
        thrust = (2.0 * acceleration + 30.0) / cos(lean)  # along the rod
        assert e.forces.crank_pin == pytest.approx((-thrust * sin(lean), thrust * cos(lean), 0.0), abs=1e-12)
        assert e.motion.torque == pytest.approx(0.1 * thrust * cos(th - lean), abs=1e-12)
        assert e.forces.guide == pytest.approx((thrust * sin(lean), 0.0, 0.0), abs=1e-11)


# ------------------------------------------------------------------ motions


def run(case: Case, drive: str, par: SliderCrankParameters, i: D.Inputs, end: float) -> np.ndarray:
    """States (n, 6) of a motion integrated tightly with SciPy, up to the nearness of the limit of assembly."""
    p = par.constants()

    def limit(t: float, x: np.ndarray) -> float:
        th, s1, *_ = D.grooved(tuple(x.tolist()), i.groove, p)
        return K.assembly_square(th, s1, p) / p.a2**2 - 0.03

    limit.terminal = True  # type: ignore[attr-defined]
    result = solve_ivp(
        lambda t, x: D.derivative(tuple(x.tolist()), i, p),
        (0.0, end),
        np.array(case.under(drive)),
        method="DOP853",
        rtol=1e-11,
        atol=1e-13,
        events=limit,
    )
    return np.array([D.grooved(tuple(x), i.groove, p) for x in result.y.T.tolist()])


@pytest.mark.parametrize("drive", ["torque-force", "torque-groove"])
@pytest.mark.parametrize("seed", range(3))
def test_energy_is_conserved_in_a_free_undamped_run(seed: int, drive: str) -> None:
    case = seeded(seed)
    par = replace(case.parameters, slider_damping=0.0, slider_coulomb_friction=0.0, shift_damping=0.0)
    states = run(case, drive, par, REST._replace(groove=DRIVES[drive][2]), 0.3)
    p = par.constants()
    energies = [D.mechanical_energy(tuple(x), p) for x in states.tolist()]
    kinetic = [sum(body.kinetic_energy() for body in bodies(tuple(x), par)) for x in states.tolist()]
    assert len(energies) > 5
    assert np.ptp(energies) < 1e-9 * (max(kinetic) + max(map(abs, energies)))
    assert np.ptp(kinetic) > 1e-3 * max(kinetic)  # it did move


@every_drive
@pytest.mark.parametrize("seed", range(2))
def test_energy_residual_stays_at_rounding_with_everything_switched_on(seed: int, drive: str) -> None:
    case = seeded(seed)
    p, i = case.p, case.inputs(drive)
    states = run(case, drive, case.parameters, i, 0.1)
    start = D.mechanical_energy(case.under(drive), p)
    ends = [D.outputs(tuple(x), i, start, p) for x in states.tolist()]
    size = max(o.energy_kinetic + abs(o.energy_potential) + abs(o.energy_supplied) for o in ends)
    assert max(abs(o.energy_residual) for o in ends) < 1e-8 * size
    assert ends[-1].energy_dissipated > 0.0


def test_outputs_carry_the_configuration_and_the_forces() -> None:
    case = seeded(7)
    par, p, x = case.parameters, case.p, case.state
    i = case.inputs("speed-shift")
    e = evaluate(x, i, p)
    o = D.outputs((*x[:4], 3.0, 5.0), i, 2.0, p)
    at = pins(x, par)
    s4, v4 = slider_motion(at, par)

    def triple(prefix: str) -> Sequence[float]:
        return [getattr(o, f"{prefix}{axis}") for axis in "xyz"]

    assert (o.crank_angle, o.shift_position, o.crank_speed, o.shift_velocity) == x[:4]
    assert (o.crank_acceleration, o.shift_acceleration) == e.motion[:2]
    assert (o.slider_position, o.slider_velocity) == pytest.approx((s4, v4), rel=1e-12)
    assert o.slider_acceleration == e.motion.slider_acceleration
    assert (o.drive_applied_torque, o.axial_applied_force) == (e.motion.torque, e.motion.force)
    assert triple("crank_pin_") == pytest.approx(at.p2, rel=1e-12)
    assert triple("slider_pin_") == pytest.approx(at.p3, rel=1e-12)
    assert triple("rod_w") == pytest.approx(at.turn, rel=1e-10)
    assert triple("bearing_f") == [*e.forces.bearing[:2], e.forces.axial]
    assert triple("bearing_m") == list(e.forces.bearing_moment)
    assert triple("crank_pin_f") == list(e.forces.crank_pin)
    assert triple("slider_pin_f") == list(e.forces.slider_pin)
    assert triple("guide_f") == list(e.forces.guide)
    assert triple("guide_m") == list(e.forces.guide_moment)
    assert o.energy_kinetic + o.energy_potential == D.mechanical_energy(x, p)
    assert (o.energy_dissipated, o.energy_supplied) == (3.0, 5.0)
    assert o.energy_residual == pytest.approx(o.energy_kinetic + o.energy_potential - 2.0 + 3.0 - 5.0, rel=1e-14)
    assert o.closure_residual < 1e-14
    assert o.transmission_angle == K.transmission_angle(e.q, p)
    assert o.assembly_margin == K.assembly_margin(e.q, p)
