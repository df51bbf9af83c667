"""Dynamics of the five-bar slider in its two degrees of freedom (Youssef, chapters II and III, reduced form).

With the coordinates (th2, u), w2 = th2' and v = u', the equations of motion are

    m11 w2' + m12 v' + b1 = T + Q1        (crank)
    m12 w2' + m22 v' + b2 = F2 + Q2       (slider)

where m is the inertia matrix, b the velocity terms, and Q gathers gravity, the load at P, spring, damper and friction.
At prescribed speed w2' is given and the first equation yields the crank torque T, which is the multiplier of the
thesis's third constraint. The state of a run is the six-tuple (th2, u, w2, v, dissipated work, supplied work).

The functions are arithmetic on floats without branches, like those of `kinematics`.
"""

from __future__ import annotations

from math import tanh
from typing import NamedTuple

from ..friction import FRICTION_RATE, FRICTION_SPEED, contact_forces, jamming_margin, lesser, resistance
from .kinematics import (
    Coefficients,
    Position,
    centripetal,
    closure_residual,
    coefficients,
    coupler_point,
    coupler_point_velocity,
    link_angles,
    position,
    transmission_angle,
)
from .parameters import Constants

State = tuple[float, float, float, float, float, float]


class Inputs(NamedTuple):
    """Inputs of the plant at one instant.

    ``speed_drive`` is 1.0 if the crank acceleration is prescribed and 0.0 if the torque is. Torque in N.m,
    acceleration in rad/s2, slider force and load in N.
    """

    speed_drive: float
    torque: float
    acceleration: float
    force: float
    load_x: float
    load_y: float


class Inertia(NamedTuple):
    """Inertia matrix of the two degrees of freedom: m11 in kg.m2, m12 in kg.m, m22 in kg."""

    m11: float
    m12: float
    m22: float


AT_REST: State = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_INPUTS = Inputs(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Motion(NamedTuple):
    """Speeds and accelerations of the links, crank torque, powers (W), moments of pin friction on coupler and rocker (N.m)."""

    w3: float
    w4: float
    crank_acceleration: float
    slider_acceleration: float
    e3: float
    e4: float
    torque: float
    power_dissipated: float
    power_supplied: float
    coupler_friction: float
    rocker_friction: float


class Friction(NamedTuple):
    """Generalised forces of friction in pins and guide (N.m, N), moments on coupler and rocker (N.m), power lost (W)."""

    q1: float
    q2: float
    coupler: float
    rocker: float
    power: float


class Reactions(NamedTuple):
    """Forces (N): ground on crank (A), crank on coupler (B), rocker on coupler (C), slider on rocker (D), guide on slider."""

    ax: float
    ay: float
    bx: float
    by: float
    cx: float
    cy: float
    dx: float
    dy: float
    guide: float


class Outputs(NamedTuple):
    """The real outputs of the FMI contract, in its order; SI units."""

    crank_angle: float
    crank_speed: float
    crank_acceleration: float
    coupler_angle: float
    rocker_angle: float
    slider_position: float
    slider_velocity: float
    slider_acceleration: float
    coupler_point_x: float
    coupler_point_y: float
    drive_applied_torque: float
    pin_A_fx: float
    pin_A_fy: float
    pin_B_fx: float
    pin_B_fy: float
    pin_C_fx: float
    pin_C_fy: float
    pin_D_fx: float
    pin_D_fy: float
    slider_guide_force: float
    energy_kinetic: float
    energy_potential: float
    energy_dissipated: float
    energy_supplied: float
    energy_residual: float
    closure_residual: float
    transmission_angle: float


def inertia(g: Position, k: Coefficients, p: Constants) -> Inertia:
    """Compute the inertia matrix.

    The crank's moment of inertia about A includes m2 lG2^2; the moments of inertia of coupler and rocker are about B and D.
    """
    # m3 l2 e2.r3 with r3 = G3 - B, and m4 e_alpha.(J r4) with r4 = G4 - D; J turns by +90 degrees
    q3 = p.l2 * (p.mx3 * (g.c2 * g.c3 + g.s2 * g.s3) + p.my3 * (g.s2 * g.c3 - g.c2 * g.s3))
    q4 = p.sa * (p.mx4 * g.c4 - p.my4 * g.s4) - p.ca * (p.mx4 * g.s4 + p.my4 * g.c4)
    return Inertia(
        p.i2b + k.k32 * (2.0 * q3 + p.i3b * k.k32) + p.i4d * k.k42 * k.k42,
        k.k3u * (q3 + p.i3b * k.k32) + k.k42 * (q4 + p.i4d * k.k4u),
        p.m45 + p.i3b * k.k3u * k.k3u + k.k4u * (2.0 * q4 + p.i4d * k.k4u),
    )


def velocity_terms(
    g: Position, k: Coefficients, w2: float, w3: float, w4: float, g3: float, g4: float, p: Constants
) -> tuple[float, float]:
    """Compute the velocity terms b1 (N.m) and b2 (N) of the equations of motion; g3, g4 come from `centripetal`."""
    cc = g.c2 * g.c3 + g.s2 * g.s3
    sc = g.s2 * g.c3 - g.c2 * g.s3
    q3 = p.l2 * (p.mx3 * cc + p.my3 * sc)
    n3 = p.l2 * (p.my3 * cc - p.mx3 * sc)
    rx = p.mx4 * g.c4 - p.my4 * g.s4
    ry = p.mx4 * g.s4 + p.my4 * g.c4
    t3 = p.i3b * g3 + w2 * w2 * n3
    t4 = p.i4d * g4
    return (
        g3 * q3 - w3 * w3 * n3 + k.k32 * t3 + k.k42 * t4,
        k.k3u * t3 + k.k4u * t4 + g4 * (p.sa * rx - p.ca * ry) - w4 * w4 * (p.ca * rx + p.sa * ry),
    )


def friction(v: float, p: Constants) -> float:
    """Compute the force of damper and guide friction (N) against the slider's motion at speed v; odd in v."""
    return resistance(v, p.mu, p.fc)


def applied_forces(
    g: Position, k: Coefficients, u: float, v: float, load_x: float, load_y: float, p: Constants
) -> tuple[float, float]:
    """Compute the generalised forces Q1 (N.m) and Q2 (N) of gravity, load, spring, damper and friction."""
    # moments about B of the forces on the coupler, about D of the forces on the rocker
    t3 = (
        p.gy * (p.mx3 * g.c3 - p.my3 * g.s3)
        - p.gx * (p.mx3 * g.s3 + p.my3 * g.c3)
        + load_y * (p.xp * g.c3 - p.yp * g.s3)
        - load_x * (p.xp * g.s3 + p.yp * g.c3)
    )
    t4 = p.gy * (p.mx4 * g.c4 - p.my4 * g.s4) - p.gx * (p.mx4 * g.s4 + p.my4 * g.c4)
    t2 = p.gy * (p.mx2 * g.c2 - p.my2 * g.s2) - p.gx * (p.mx2 * g.s2 + p.my2 * g.c2)
    fx = p.m3 * p.gx + load_x
    fy = p.m3 * p.gy + load_y
    return (
        t2 + p.l2 * (fy * g.c2 - fx * g.s2) + k.k32 * t3 + k.k42 * t4,
        p.m45 * (p.gx * p.ca + p.gy * p.sa) + k.k3u * t3 + k.k4u * t4 - p.k * (u - p.u0) - friction(v, p),
    )


def accelerations(m: Inertia, r1: float, r2: float, speed_drive: float, acceleration: float) -> tuple[float, float]:
    """Compute the accelerations of crank and slider from the generalised forces r1, r2, or for a given crank acceleration."""
    free = 1.0 - speed_drive
    e2 = speed_drive * acceleration + free * (m.m22 * r1 - m.m12 * r2) / (m.m11 * m.m22 - m.m12 * m.m12)
    return e2, (r2 - m.m12 * e2) / m.m22


def motion(g: Position, k: Coefficients, x: State, i: Inputs, p: Constants) -> Motion:
    """Compute accelerations, crank torque and powers at state ``x`` under the inputs ``i``, for either drive."""
    _, u, w2, v, _, _ = x
    w3 = k.k32 * w2 + k.k3u * v
    w4 = k.k42 * w2 + k.k4u * v
    m = inertia(g, k, p)
    g3, g4 = centripetal(g, w2, w3, w4, p)
    b1, b2 = velocity_terms(g, k, w2, w3, w4, g3, g4, p)
    q1, q2 = applied_forces(g, k, u, v, i.load_x, i.load_y, p)
    lost, on_coupler, on_rocker = friction(v, p) * v, 0.0, 0.0
    if p.rough:
        f = contact_friction(g, k, m, x, i, p)
        q1, q2, lost, on_coupler, on_rocker = q1 + f.q1, q2 + f.q2, lost + f.power, f.coupler, f.rocker
    e2, a = accelerations(m, q1 - b1 + i.torque, q2 - b2 + i.force, i.speed_drive, i.acceleration)
    torque = (1.0 - i.speed_drive) * i.torque + i.speed_drive * (m.m11 * e2 + m.m12 * a + b1 - q1)
    px, py = coupler_point_velocity(g, w2, w3, p)
    return Motion(
        w3,
        w4,
        e2,
        a,
        k.k32 * e2 + k.k3u * a + g3,
        k.k42 * e2 + k.k4u * a + g4,
        torque,
        lost,
        torque * w2 + i.force * v + i.load_x * px + i.load_y * py,
        on_coupler,
        on_rocker,
    )


class Rubbing(NamedTuple):
    """Friction in one contact for a contact force of 1 N, and the changes of all joint forces that this friction causes."""

    friction: Friction
    response: Reactions


def unit_friction(
    g: Position, k: Coefficients, m: Inertia, w2: float, v: float, speed_drive: float, p: Constants
) -> tuple[Rubbing, ...]:
    """Compute the friction in the pins A to D and in the guide for contact forces of 1 N."""
    w3 = k.k32 * w2 + k.k3u * v
    w4 = k.k42 * w2 + k.k4u * v
    ra = p.ra * tanh(w2 / FRICTION_RATE)
    rb = p.rb * tanh((w3 - w2) / FRICTION_RATE)
    rc = p.rc * tanh((w3 - w4) / FRICTION_RATE)
    rd = p.rd * tanh(w4 / FRICTION_RATE)
    mug = p.mug * tanh(v / FRICTION_SPEED)
    weightless = p._replace(gx=0.0, gy=0.0)

    def rubbing(f: Friction) -> Rubbing:
        e2, a = accelerations(m, f.q1, f.q2, speed_drive, 0.0)
        e3, e4 = k.k32 * e2 + k.k3u * a, k.k42 * e2 + k.k4u * a
        change = Motion(0.0, 0.0, e2, a, e3, e4, 0.0, 0.0, 0.0, f.coupler, f.rocker)
        return Rubbing(f, reactions(g, AT_REST, change, NO_INPUTS, weightless))

    # the moments on the coupler at B and C, and on the rocker at C (the opposite one) and D
    return (
        rubbing(Friction(-ra, 0.0, 0.0, 0.0, ra * w2)),
        rubbing(Friction(-rb * (k.k32 - 1.0), -rb * k.k3u, -rb, 0.0, rb * (w3 - w2))),
        rubbing(Friction(-rc * (k.k32 - k.k42), -rc * (k.k3u - k.k4u), -rc, rc, rc * (w3 - w4))),
        rubbing(Friction(-rd * k.k42, -rd * k.k4u, 0.0, -rd, rd * w4)),
        rubbing(Friction(0.0, -mug, 0.0, 0.0, mug * v)),
    )


def contacts(f: Reactions) -> tuple[tuple[float, float], ...]:
    """Return the force in each contact as two components, in the order of `unit_friction`."""
    return (f.ax, f.ay), (f.bx, f.by), (f.cx, f.cy), (f.dx, f.dy), (f.guide, 0.0)


def contact_friction(g: Position, k: Coefficients, m: Inertia, x: State, i: Inputs, p: Constants) -> Friction:
    """Compute the friction in pins and guide together with the contact forces, which depend linearly on the friction."""
    smooth = p._replace(rough=0.0)
    without = contacts(reactions(g, x, motion(g, k, x, i, smooth), i, smooth))
    units = unit_friction(g, k, m, x[2], x[3], i.speed_drive, p)
    sizes = contact_forces(without, tuple(contacts(unit.response) for unit in units))
    return Friction(*(sum(size * unit.friction[n] for size, unit in zip(sizes, units)) for n in range(5)))


def derivative(x: State, i: Inputs, p: Constants) -> State:
    """Compute the time derivative of the state under constant inputs."""
    g = position(x[0], x[1], p)
    k = coefficients(g, p)
    m = motion(g, k, x, i, p)
    return (x[2], x[3], m.crank_acceleration, m.slider_acceleration, m.power_dissipated, m.power_supplied)


def reactions(g: Position, x: State, m: Motion, i: Inputs, p: Constants) -> Reactions:
    """Compute the forces in the pins and the guide by the Newton-Euler equations, from the outermost link inwards.

    The force at C is the pair of loop multipliers of the thesis (2.3).
    """
    w2 = x[2]
    e2 = m.crank_acceleration
    a = m.slider_acceleration
    # acceleration minus gravity: of B and D; multiplied by the mass, of the centres of mass of coupler and rocker
    bx = -p.l2 * (g.s2 * e2 + g.c2 * w2 * w2) - p.gx
    by = p.l2 * (g.c2 * e2 - g.s2 * w2 * w2) - p.gy
    rx3 = p.mx3 * g.c3 - p.my3 * g.s3
    ry3 = p.mx3 * g.s3 + p.my3 * g.c3
    fx3 = p.m3 * bx - ry3 * m.e3 - rx3 * m.w3 * m.w3
    fy3 = p.m3 * by + rx3 * m.e3 - ry3 * m.w3 * m.w3
    dx = a * p.ca - p.gx
    dy = a * p.sa - p.gy
    rx4 = p.mx4 * g.c4 - p.my4 * g.s4
    ry4 = p.mx4 * g.s4 + p.my4 * g.c4
    fx4 = p.m4 * dx - ry4 * m.e4 - rx4 * m.w4 * m.w4
    fy4 = p.m4 * dy + rx4 * m.e4 - ry4 * m.w4 * m.w4
    # moments about B and D: t3 = (C - B) x F_C, t4 = (C - D) x F_C, each divided by its link's length
    t3 = (
        p.i3b * m.e3
        + rx3 * by
        - ry3 * bx
        - i.load_y * (p.xp * g.c3 - p.yp * g.s3)
        + i.load_x * (p.xp * g.s3 + p.yp * g.c3)
        - m.coupler_friction
    ) / p.l3
    t4 = -(p.i4d * m.e4 + rx4 * dy - ry4 * dx - m.rocker_friction) / p.l4
    cx = (t3 * g.c4 - t4 * g.c3) / g.s43
    cy = (t3 * g.s4 - t4 * g.s3) / g.s43
    bpx = fx3 - cx - i.load_x
    bpy = fy3 - cy - i.load_y
    rx2 = p.mx2 * g.c2 - p.my2 * g.s2
    ry2 = p.mx2 * g.s2 + p.my2 * g.c2
    dpx = fx4 + cx
    dpy = fy4 + cy
    return Reactions(
        bpx - ry2 * e2 - rx2 * w2 * w2 - p.m2 * p.gx,
        bpy + rx2 * e2 - ry2 * w2 * w2 - p.m2 * p.gy,
        bpx,
        bpy,
        cx,
        cy,
        dpx,
        dpy,
        p.sa * (p.m5 * p.gx - dpx) - p.ca * (p.m5 * p.gy - dpy),
    )


def kinetic_energy(m: Inertia, w2: float, v: float) -> float:
    """Compute the kinetic energy of all links (J)."""
    return 0.5 * (m.m11 * w2 * w2 + 2.0 * m.m12 * w2 * v + m.m22 * v * v)


def potential_energy(g: Position, u: float, p: Constants) -> float:
    """Compute the potential energy of spring and gravity (J); gravity contributes zero if every centre of mass is at A."""
    x = (
        p.mx2 * g.c2
        - p.my2 * g.s2
        + p.m3 * p.l2 * g.c2
        + p.mx3 * g.c3
        - p.my3 * g.s3
        + p.m45 * (p.l1 + u * p.ca)
        + p.mx4 * g.c4
        - p.my4 * g.s4
    )
    y = (
        p.mx2 * g.s2
        + p.my2 * g.c2
        + p.m3 * p.l2 * g.s2
        + p.mx3 * g.s3
        + p.my3 * g.c3
        + p.m45 * u * p.sa
        + p.mx4 * g.s4
        + p.my4 * g.c4
    )
    stretch = u - p.u0
    return 0.5 * p.k * stretch * stretch - p.gx * x - p.gy * y


def energy(x: State, p: Constants) -> float:
    """Compute the kinetic plus potential energy (J)."""
    g = position(x[0], x[1], p)
    return kinetic_energy(inertia(g, coefficients(g, p), p), x[2], x[3]) + potential_energy(g, x[1], p)


def jump_speed(x: State, speed: float, p: Constants) -> State:
    """Return the state after a jump of the commanded crank speed to ``speed``.

    The jump is an impulse on the crank. No other impulse is applied, so that the generalised momentum of the slider position,
    m12 w2 + m22 v, is conserved; the work of the crank's impulse is the change of kinetic energy.
    """
    g = position(x[0], x[1], p)
    m = inertia(g, coefficients(g, p), p)
    v = x[3] + m.m12 / m.m22 * (x[2] - speed)
    work = kinetic_energy(m, speed, v) - kinetic_energy(m, x[2], x[3])
    return (x[0], x[1], speed, v, x[4], x[5] + work)


def jump(x: State, i: Inputs, u: tuple[float, ...], p: Constants) -> State:
    """Return the state after a jump of the commanded speed to its value in ``u``; under a torque the state is unchanged."""
    return jump_speed(x, (1.0 - i.speed_drive) * x[2] + i.speed_drive * u[1], p)


def apply_inputs(modes: tuple[float, ...], u: tuple[float, ...], p: Constants) -> Inputs:
    """Return the plant's inputs from drive.mode, in ``modes``, and the channels ``u`` in the order of the FMI inputs."""
    (drive,) = modes
    torque, _, acceleration, force, load_x, load_y = u
    return Inputs(drive, (1.0 - drive) * torque, drive * acceleration, force, load_x, load_y)


def start(x: State, i: Inputs, p: Constants) -> State:
    """Return the initial state unchanged, because its components do not depend on each other."""
    return x


def clearance(x: State, i: Inputs, p: Constants) -> float:
    """Compute the sine of the transmission angle; with friction, the margin to jamming if this margin is smaller."""
    g = position(x[0], x[1], p)
    sine = p.branch * g.s43
    if not p.rough:
        return sine
    k = coefficients(g, p)
    units = unit_friction(g, k, inertia(g, k, p), x[2], x[3], i.speed_drive, p)
    return lesser(sine, jamming_margin(tuple(contacts(unit.response) for unit in units)))


def outputs(x: State, i: Inputs, start_energy: float, p: Constants) -> Outputs:
    """Compute all real outputs of the FMI contract at state ``x`` under the inputs ``i``.

    ``start_energy`` is the mechanical energy at the start of the run (J), the reference of the energy balance.
    """
    th2, u, w2, v, dissipated, supplied = x
    g = position(th2, u, p)
    k = coefficients(g, p)
    m = motion(g, k, x, i, p)
    f = reactions(g, x, m, i, p)
    th3, th4 = link_angles(g, p)
    px, py = coupler_point(g, p)
    kinetic = kinetic_energy(inertia(g, k, p), w2, v)
    potential = potential_energy(g, u, p)
    energies = (kinetic, potential, dissipated, supplied, kinetic + potential - start_energy + dissipated - supplied)
    closure = (closure_residual(th2, th3, th4, u, p), transmission_angle(g, p))
    slider = (u, v, m.slider_acceleration)
    return Outputs(th2, w2, m.crank_acceleration, th3, th4, *slider, px, py, m.torque, *f, *energies, *closure)
