"""Model both mechanisms as particles: positions and velocities of the masses, and forces by Newton's and Euler's laws.

The five-bar takes the angles and rates of its links from the program; the slider-crank computes its slider position itself.
Energies, momenta and inertia tensors follow from the particles by summation. For the slider-crank the equations of
motion of its three bodies in space, the pins' accelerations and the drives make one linear system for all
accelerations, forces and moments at once: a formulation that shares no algebra with `linkwork.slider_crank.dynamics`.
"""

import cmath
from math import cos, sin, sqrt, tanh
from typing import Any, NamedTuple

import numpy as np

from linkwork.five_bar import dynamics as five_bar_dynamics
from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.friction import FRICTION_SPEED
from linkwork.slider_crank import dynamics
from linkwork.slider_crank.parameters import SliderCrankParameters
from tests.slider_cranks import Case

AXIS = np.array([0.0, 0.0, 1.0])


class Body(NamedTuple):
    """Particles of a rigid body: masses (n,), positions and velocities in the ground frame (n, 3)."""

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
        """Return the inertia tensor about the centre of mass, shape (3, 3)."""
        r = self.places - self.centre
        return np.eye(3) * (self.masses @ (r * r).sum(axis=1)) - np.einsum("n,ni,nj->ij", self.masses, r, r)

    def kinetic_energy(self) -> float:
        return 0.5 * float(self.masses @ (self.velocities**2).sum(axis=1))

    def momentum(self) -> np.ndarray:
        return self.masses @ self.velocities

    def moment_of_momentum(self) -> np.ndarray:
        """Return the angular momentum about the origin of the ground frame."""
        return self.masses @ np.cross(self.places, self.velocities)


# ------------------------------------------------------------------ five-bar


def in_plane(z: complex) -> np.ndarray:
    """Return a complex number as a vector in the plane, (x, y, 0)."""
    return np.array([z.real, z.imag, 0.0])


def planar_link(mass: float, inertia: float, place: complex, velocity: complex, spin: float) -> Body:
    """Return a link as two particles with its mass and its moment of inertia about the centre of mass."""
    arm = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]) * sqrt(inertia / mass)
    places, velocities = in_plane(place) + arm, in_plane(velocity) + spin * np.cross(AXIS, arm)
    return Body(np.array([0.5 * mass] * 2), places, velocities)


def five_bar(x: five_bar_dynamics.State, par: FiveBarParameters) -> tuple[Body, ...]:
    """Return crank, coupler, rocker and slider as particles; only the angles and rates are taken from the program."""
    th2, u, w2, v, _, _ = x
    p = par.constants()
    g = kinematics.position(th2, u, p)
    k = kinematics.coefficients(g, p)
    w3, w4 = k.k32 * w2 + k.k3u * v, k.k42 * w2 + k.k4u * v
    guide = cmath.rect(1.0, par.slider_guide_angle)
    crank_pin = cmath.rect(par.crank_length, th2)
    slider_pin = par.ground_length + u * guide
    arms = (
        cmath.rect(par.crank_cog_distance, th2 + par.crank_cog_angle),
        complex(g.c3, g.s3) * cmath.rect(par.coupler_cog_distance, par.coupler_cog_angle),
        complex(g.c4, g.s4) * cmath.rect(par.rocker_cog_distance, par.rocker_cog_angle),
    )
    # about its own centre of mass
    crank_inertia = par.crank_inertia - par.crank_mass * par.crank_cog_distance**2
    return (
        planar_link(par.crank_mass, crank_inertia, arms[0], 1j * w2 * arms[0], w2),
        planar_link(
            par.coupler_mass, par.coupler_inertia, crank_pin + arms[1], 1j * (w2 * crank_pin + w3 * arms[1]), w3
        ),
        planar_link(par.rocker_mass, par.rocker_inertia, slider_pin + arms[2], v * guide + 1j * w4 * arms[2], w4),
        planar_link(par.slider_mass, 0.0, slider_pin, v * guide, 0.0),
    )


def five_bar_gravity(par: FiveBarParameters) -> np.ndarray:
    return in_plane(-1j * par.gravity * cmath.exp(-1j * par.ground_inclination))


def slider_resistance(x: five_bar_dynamics.State, par: FiveBarParameters) -> float:
    """Return the force of spring, damper and friction on the slider along the guide."""
    spring = par.slider_stiffness * (x[1] - par.slider_spring_free_position)
    return -spring - par.slider_damping * x[3] - par.slider_coulomb_friction * tanh(x[3] / FRICTION_SPEED)


# ------------------------------------------------------------------ slider-crank


def crank_particles(par: SliderCrankParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return six particles in frame 2 with the crank's mass, centre of mass, axial inertia and products of inertia."""
    m = par.crank_mass
    cog = np.array([par.crank_cog_x, par.crank_cog_y, par.crank_cog_z])
    # second moments x x, x y ... about the centre of mass; z z is arbitrary, but large enough for real positions of particles
    square = 0.5 * (par.crank_inertia - m * (cog[0] ** 2 + cog[1] ** 2))
    xz, yz = par.crank_product_xz - m * cog[0] * cog[2], par.crank_product_yz - m * cog[1] * cog[2]
    second = np.array([[square, 0.0, xz], [0.0, square, yz], [xz, yz, 2.0 * (xz * xz + yz * yz) / square + square]])
    sizes, axes = np.linalg.eigh(second)
    arms = np.sqrt(3.0 * sizes / m) * axes
    return np.full(6, m / 6.0), cog + np.concatenate([arms.T, -arms.T])


def rod_particles(par: SliderCrankParameters, line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rod's particles relative to its centre of mass: two on its line and a ring of four about it.

    Each of these two groups has half of the moment of inertia.
    """
    m, inertia = par.rod_mass, par.rod_inertia
    u = line / np.linalg.norm(line)
    j = np.cross(u, np.eye(3)[np.argmin(np.abs(u))])
    j /= np.linalg.norm(j)
    k = np.cross(u, j)
    half, radius = sqrt(inertia / m), sqrt(2.0 * inertia / m)
    arms = np.array([half * u, -half * u, radius * j, -radius * j, radius * k, -radius * k])
    return np.array([m / 4.0] * 2 + [m / 8.0] * 4), arms


def guide_frame(par: SliderCrankParameters) -> np.ndarray:
    """Return the axes of frame 4 as rows."""
    c, s = cos(par.guide_twist), sin(par.guide_twist)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


class Pins(NamedTuple):
    """Positions and velocities of both pins, and the rod's angular velocity without its spin about its own line."""

    p2: np.ndarray
    p3: np.ndarray
    v2: np.ndarray
    v3: np.ndarray
    turn: np.ndarray


def pins(x: dynamics.State, par: SliderCrankParameters) -> Pins:
    """Return the pins; the slider's position and rate are solved from the condition that the rod's length is constant."""
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


def slider_crank(x: dynamics.State, par: SliderCrankParameters) -> tuple[Body, Body, Body]:
    """Return crank, rod and slider as particles."""
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
    """Return the force of load, spring, damper and friction on the slider along the guide."""
    spring = par.slider_stiffness * (s4 - par.slider_spring_free_position)
    return load - spring - par.slider_damping * v4 - par.slider_coulomb_friction * tanh(v4 / FRICTION_SPEED)


def shift_push(s1: float, v: float, par: SliderCrankParameters) -> float:
    """Return the force of spring and damper on the shift."""
    return -par.shift_stiffness * (s1 - par.shift_spring_free_position) - par.shift_damping * v


def slider_motion(at: Pins, par: SliderCrankParameters) -> tuple[float, float]:
    """Return position and velocity of the slider along the guide."""
    way = -guide_frame(par)[2]
    return float(at.p3 @ way), float(at.v3 @ way)


# ------------------------------------------------------------------ Newton and Euler, body by body

#: Unknowns of the 29 equations with their numbers of components: accelerations of the freedoms, of the rod's centre of mass and
#: of the slider, and the rod's angular acceleration; forces in the pins, forces and moments of bearing and guide; torque and
#: axial force of the drives, and the force of the groove.
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
    """Return the matrix of the cross product a x."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def solve_bodies(case: Case, drive: str) -> dict[str, np.ndarray]:
    """Solve the equations of motion of three bodies in space, the pins' accelerations and the drives; return the unknowns."""
    par, x, i = case.parameters, case.under(drive), case.inputs(drive)
    th, s1, w, v, _, _ = x
    at = pins(x, par)
    crank, rod, slider = slider_crank(x, par)
    g = gravity(par)
    frame = guide_frame(par)
    way = -frame[2]
    s4, v4 = slider_motion(at, par)
    ends = np.cumsum(list(UNKNOWNS.values()))
    place = {name: slice(end - size, end) for (name, size), end in zip(UNKNOWNS.items(), ends)}
    rows: list[np.ndarray] = []
    right: list[np.ndarray] = []

    def equation(value: Any, **terms: Any) -> None:
        """Add equations: the sum over ``terms`` of matrix times unknown of that name equals ``value``."""
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
    accelerations = {"crank_acceleration": m @ turning, "shift_acceleration": crank.mass * AXIS}
    equation(crank.mass * g - m @ inward, **accelerations, bearing=-one, crank_pin=one)
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
    # the rod's ends have the accelerations of the pins on crank and slider
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
    # groove of eq 28: its force on the shift also acts as a torque on the crank, in proportion to the groove's pitch
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
    # scale rows and columns to a similar size, for a better condition number
    row_size = np.abs(matrix).max(axis=1)
    column_size = np.abs(matrix / row_size[:, None]).max(axis=0)
    solution = np.linalg.solve(matrix / row_size[:, None] / column_size, np.concatenate(right) / row_size) / column_size
    return {name: solution[where] for name, where in place.items()}
