"""Dynamics of the generalised slider-crank in its two degrees of freedom, by vector mechanics.

With the coordinates (theta1, S1), w = theta1' and v = S1', the equations of motion are

    m11 w' + m12 v' + b1 = T + Q1        (crank)
    m12 w' + m22 v' + b2 = F + Q2        (axial shift)

where b are the velocity terms and Q gathers gravity, the slider's load, springs, dampers and friction. If the crank
speed or the shift is prescribed, its acceleration is given, and its equation yields the required torque T or axial force
F. The state of a run is the six-tuple (theta1, S1, w, v, dissipated work, supplied work).

A rigid rod without spin is replaced by the masses m22, m23, m33 of `parameters.Constants`, which multiply the accelerations of
its ends. Motion and end forces stay the same, because each point of the rod moves as a fixed weighted mean of the two ends. The
transverse moment of inertia I adds I/a2^2 to m22 and m33, and -I/a2^2 to m23.

The functions are arithmetic on floats without branches, like those of `kinematics`.
"""

from __future__ import annotations

from typing import NamedTuple

from ..friction import resistance
from .kinematics import (
    Coefficients,
    Position,
    assembly_margin,
    centripetal,
    closure_residual,
    coefficients,
    crank_pin,
    crank_pin_acceleration,
    crank_pin_velocity,
    from_guide_frame,
    groove,
    guide,
    position,
    rod,
    rod_angular_velocity,
    slider_pin,
    transmission_angle,
)
from .parameters import Constants
from .vectors import Vector, add, cross, dot, scale, subtract

State = tuple[float, float, float, float, float, float]


class Inputs(NamedTuple):
    """Inputs of the plant at one instant.

    ``speed_drive`` is 1.0 if the crank acceleration is prescribed and 0.0 if the torque is; ``shift_drive`` is 1.0 if the
    axial acceleration is prescribed and 0.0 if the axial force is; ``groove`` is 1.0 if a groove in the shaft makes the
    shift of eq 28, and then ``shift_drive`` is 0.0. Torque in N.m, accelerations in rad/s2 and m/s2, forces
    in N; the load acts on the slider in the direction in which its position increases.
    """

    speed_drive: float
    shift_drive: float
    groove: float
    torque: float
    acceleration: float
    force: float
    shift_acceleration: float
    load: float


class Inertia(NamedTuple):
    """Inertia matrix of the two degrees of freedom: m11 in kg.m2, m12 in kg.m, m22 in kg."""

    m11: float
    m12: float
    m22: float


class Motion(NamedTuple):
    """Accelerations, slider velocity, torque, axial forces and powers that follow from the state and the inputs.

    ``torque`` is the torque of the drive on the shaft, ``force`` the axial force that drives or holds the shift;
    ``groove_force`` is the part of ``force`` that a groove exerts.
    """

    crank_acceleration: float
    shift_acceleration: float
    slider_velocity: float
    slider_acceleration: float
    torque: float
    force: float
    groove_force: float
    power_dissipated: float
    power_supplied: float


class Reactions(NamedTuple):
    """Forces and moments in the joints (N, N.m), by their components in the ground frame.

    ``bearing`` is the force of the bearing on the crank, without axial component; ``axial`` is the whole axial force on the
    crank, of drive, groove, spring and damper; ``bearing_moment`` is about the origin O of the ground frame and includes the
    torques of drive and groove; ``crank_pin`` is the force of the crank on the rod, ``slider_pin`` that of the slider on the
    rod; ``guide`` is the force of the guide on the slider, without friction, spring and load; ``guide_moment`` is the moment
    of the guide about the slider pin.
    """

    bearing: Vector
    axial: float
    bearing_moment: Vector
    crank_pin: Vector
    slider_pin: Vector
    guide: Vector
    guide_moment: Vector


class Outputs(NamedTuple):
    """The real outputs of the FMI interface, in its order; SI units, vectors in the ground frame."""

    crank_angle: float
    crank_speed: float
    crank_acceleration: float
    shift_position: float
    shift_velocity: float
    shift_acceleration: float
    slider_position: float
    slider_velocity: float
    slider_acceleration: float
    crank_pin_x: float
    crank_pin_y: float
    crank_pin_z: float
    slider_pin_x: float
    slider_pin_y: float
    slider_pin_z: float
    rod_wx: float
    rod_wy: float
    rod_wz: float
    drive_applied_torque: float
    axial_applied_force: float
    bearing_fx: float
    bearing_fy: float
    bearing_fz: float
    bearing_mx: float
    bearing_my: float
    bearing_mz: float
    crank_pin_fx: float
    crank_pin_fy: float
    crank_pin_fz: float
    slider_pin_fx: float
    slider_pin_fy: float
    slider_pin_fz: float
    guide_fx: float
    guide_fy: float
    guide_fz: float
    guide_mx: float
    guide_my: float
    guide_mz: float
    energy_kinetic: float
    energy_potential: float
    energy_dissipated: float
    energy_supplied: float
    energy_residual: float
    closure_residual: float
    transmission_angle: float
    assembly_margin: float


def impose_groove(x: State, in_groove: float, p: Constants) -> State:
    """Return the state with the shift and axial velocity of the groove if ``in_groove`` is 1, unchanged if it is 0."""
    th, s1, w, v, dissipated, supplied = x
    law = groove(th, p)
    free = 1.0 - in_groove
    return (th, free * s1 + in_groove * law.shift, w, free * v + in_groove * law.pitch * w, dissipated, supplied)


def inertia(q: Position, k: Coefficients, p: Constants) -> Inertia:
    """Compute the inertia matrix.

    The rod is replaced by masses at its ends, of which m23 couples the velocities of the two pins.
    """
    # direction of the guide times the velocities of the crank pin for w = 1 and for v = 1
    along = -p.a1 * q.c * p.sa
    m4 = p.m33 + p.m3
    return Inertia(
        p.iz + p.m22 * p.a1 * p.a1 + k.kth * (2.0 * p.m23 * along + m4 * k.kth),
        p.m23 * (along * k.ks - p.ca * k.kth) + m4 * k.kth * k.ks,
        p.m1 + p.m22 + k.ks * (m4 * k.ks - 2.0 * p.m23 * p.ca),
    )


def velocity_terms(q: Position, k: Coefficients, w: float, slide: float, p: Constants) -> tuple[float, float]:
    """Compute the velocity terms b1 (N.m) and b2 (N) of the equations of motion; ``slide`` comes from `centripetal`."""
    along = -p.a1 * q.c * p.sa
    pull = p.m23 * p.a1 * q.s * p.sa * w * w + (p.m33 + p.m3) * slide
    return (p.m23 * slide * along + pull * k.kth, -p.m23 * slide * p.ca + pull * k.ks)


def slider_resistance(s4: float, v4: float, load: float, p: Constants) -> float:
    """Compute the force on the slider along its guide (N): load, spring, damper and friction."""
    return load - p.k * (s4 - p.s0) - resistance(v4, p.mu, p.fc)


def shift_resistance(s1: float, v: float, p: Constants) -> float:
    """Compute the force of spring and damper on the crank along its axis (N)."""
    return -p.kx * (s1 - p.x0) - p.mux * v


def applied_forces(
    q: Position, k: Coefficients, s1: float, v: float, v4: float, load: float, p: Constants
) -> tuple[float, float]:
    """Compute the generalised forces Q1 (N.m) and Q2 (N) of gravity, load, springs, dampers and friction."""
    front = p.m2 * p.share
    rear = p.m2 - front
    push = slider_resistance(q.s4, v4, load, p) - (front + p.m3) * (p.gy * p.sa + p.gz * p.ca)
    t1 = p.gy * (p.mx1 * q.c - p.my1 * q.s) - p.gx * (p.mx1 * q.s + p.my1 * q.c)
    return (
        t1 + rear * p.a1 * (p.gy * q.c - p.gx * q.s) + k.kth * push,
        (p.m1 + rear) * p.gz + shift_resistance(s1, v, p) + k.ks * push,
    )


def motion(q: Position, k: Coefficients, x: State, i: Inputs, p: Constants) -> Motion:
    """Compute accelerations, torque, axial force and powers at state ``x`` under the inputs ``i``, for any drives."""
    th, s1, w, v, _, _ = x
    v4 = k.kth * w + k.ks * v
    m = inertia(q, k, p)
    slide = centripetal(q, k, w, v, p)
    b1, b2 = velocity_terms(q, k, w, slide, p)
    q1, q2 = applied_forces(q, k, s1, v, v4, i.load, p)
    r1 = q1 - b1 + i.torque
    r2 = q2 - b2 + i.force
    law = groove(th, p)
    pitch = i.groove * law.pitch
    # two linear equations; the drives choose each row. Row 1: equation of the crank (with the groove's force eliminated) or
    # prescribed crank acceleration. Row 2: equation of the shift, prescribed axial acceleration, or shift by the groove
    turning = 1.0 - i.speed_drive
    shifting = (1.0 - i.shift_drive) * (1.0 - i.groove)
    a11 = turning * (m.m11 + pitch * m.m12) + i.speed_drive
    a12 = turning * (m.m12 + pitch * m.m22)
    a21 = shifting * m.m12 - pitch
    a22 = shifting * m.m22 + (1.0 - shifting)
    c1 = turning * (r1 + pitch * r2) + i.speed_drive * i.acceleration
    c2 = shifting * r2 + i.shift_drive * i.shift_acceleration + i.groove * law.bend * w * w
    determinant = a11 * a22 - a12 * a21
    e = (c1 * a22 - a12 * c2) / determinant
    a = (a11 * c2 - a21 * c1) / determinant
    # the force that holds the shift, in addition to the given force; below likewise the torque
    hold = (1.0 - shifting) * (m.m12 * e + m.m22 * a - r2)
    groove_force = i.groove * hold
    torque = i.torque + i.speed_drive * (m.m11 * e + m.m12 * a - r1 + pitch * hold)
    force = i.force + hold
    return Motion(
        e,
        a,
        v4,
        k.kth * e + k.ks * a + slide,
        torque,
        force,
        groove_force,
        resistance(v4, p.mu, p.fc) * v4 + p.mux * v * v,
        # the groove adds no power: the power of its axial force and the power of its torque cancel
        torque * w + (force - groove_force) * v + i.load * v4,
    )


def derivative(x: State, i: Inputs, p: Constants) -> State:
    """Compute the time derivative of the state under constant inputs."""
    x = impose_groove(x, i.groove, p)
    q = position(x[0], x[1], p)
    k = coefficients(q, p)
    m = motion(q, k, x, i, p)
    return (x[2], x[3], m.crank_acceleration, m.shift_acceleration, m.power_dissipated, m.power_supplied)


def reactions(q: Position, x: State, m: Motion, i: Inputs, p: Constants) -> Reactions:
    """Compute the forces and moments in all joints by the Newton-Euler equations, from the slider inwards."""
    w = x[2]
    e = m.crank_acceleration
    g = Vector(p.gx, p.gy, p.gz)
    along = guide(p)
    a2 = crank_pin_acceleration(q, w, e, m.shift_acceleration, p)
    a3 = scale(m.slider_acceleration, along)
    # the forces that the rod's pins must exert for its motion, except for a pull along the rod
    front = p.m2 * p.share
    q2 = subtract(add(scale(p.m22, a2), scale(p.m23, a3)), scale(p.m2 - front, g))
    q3 = subtract(add(scale(p.m23, a2), scale(p.m33, a3)), scale(front, g))
    free = subtract(a3, g)
    pushed = slider_resistance(q.s4, m.slider_velocity, i.load, p)
    # the slider's motion along the guide gives this pull: m3 (a3 - g) = push - (q3 + pull r), r the rod's vector
    r = rod(q, p)
    pull = (pushed - p.m3 * dot(free, along) - dot(q3, along)) / q.h
    f3 = add(q3, scale(pull, r))
    f2 = subtract(q2, scale(pull, r))
    guiding = subtract(add(scale(p.m3, free), f3), scale(pushed, along))
    guide_moment = cross(from_guide_frame(Vector(p.mx4, p.my4, p.mz4), p), free)
    # moments on the crank about the origin of frame 2, which accelerates only along the axis
    rx = p.mx1 * q.c - p.my1 * q.s
    ry = p.mx1 * q.s + p.my1 * q.c
    px = p.pxz * q.c - p.pyz * q.s
    py = p.pxz * q.s + p.pyz * q.c
    heave = Vector(-p.gx, -p.gy, m.shift_acceleration - p.gz)
    spin = add(Vector(w * w * py - e * px, -w * w * px - e * py, p.iz * e), cross(Vector(rx, ry, p.mz1), heave))
    moment = add(spin, cross(Vector(p.a1 * q.c, p.a1 * q.s, 0.0), f2))
    fx = f2.x - ry * e - rx * w * w - p.m1 * p.gx
    fy = f2.y + rx * e - ry * w * w - p.m1 * p.gy
    return Reactions(
        Vector(fx, fy, 0.0),
        f2.z + p.m1 * (m.shift_acceleration - p.gz),
        add(moment, Vector(-x[1] * fy, x[1] * fx, 0.0)),
        f2,
        f3,
        guiding,
        guide_moment,
    )


def kinetic_energy(m: Inertia, w: float, v: float) -> float:
    """Compute the kinetic energy of all links (J)."""
    return 0.5 * (m.m11 * w * w + 2.0 * m.m12 * w * v + m.m22 * v * v)


def potential_energy(q: Position, s1: float, p: Constants) -> float:
    """Compute the potential energy of springs and gravity (J); gravity contributes zero if every centre of mass is at O."""
    front = p.m2 * p.share
    rear = p.m2 - front
    slider = from_guide_frame(Vector(p.mx4, p.my4, p.mz4), p)
    moved = add(
        add(scale(rear, crank_pin(q, s1, p)), scale(front + p.m3, slider_pin(q, p))),
        add(Vector(p.mx1 * q.c - p.my1 * q.s, p.mx1 * q.s + p.my1 * q.c, p.mz1 + p.m1 * s1), slider),
    )
    stretch = q.s4 - p.s0
    shift = s1 - p.x0
    return 0.5 * (p.k * stretch * stretch + p.kx * shift * shift) - dot(Vector(p.gx, p.gy, p.gz), moved)


def energy(x: State, p: Constants) -> float:
    """Compute the kinetic plus potential energy (J)."""
    q = position(x[0], x[1], p)
    return kinetic_energy(inertia(q, coefficients(q, p), p), x[2], x[3]) + potential_energy(q, x[1], p)


def jump(x: State, i: Inputs, u: tuple[float, ...], p: Constants) -> State:
    """Return the state after a jump of the commanded speeds, if there are any, to their values in the channels ``u``.

    A jump is an impulse on the driven coordinate. No impulse acts on the other coordinate, so that its generalised momentum is
    conserved, unless a groove couples the shift to the crank. The work of the impulses is the change of kinetic energy.
    """
    speed, shift_velocity = u[1], u[4]
    x = impose_groove(x, i.groove, p)
    th, s1, w, v, dissipated, supplied = x
    q = position(th, s1, p)
    m = inertia(q, coefficients(q, p), p)
    w_new = (
        w + i.speed_drive * (speed - w) + (1.0 - i.speed_drive) * i.shift_drive * m.m12 / m.m11 * (v - shift_velocity)
    )
    follows = v + i.speed_drive * m.m12 / m.m22 * (w - w_new)
    shifted = i.shift_drive * shift_velocity + (1.0 - i.shift_drive) * follows
    v_new = (1.0 - i.groove) * shifted + i.groove * groove(th, p).pitch * w_new
    work = kinetic_energy(m, w_new, v_new) - kinetic_energy(m, w, v)
    return (th, s1, w_new, v_new, dissipated, supplied + work)


def apply_inputs(modes: tuple[float, ...], u: tuple[float, ...], p: Constants) -> Inputs:
    """Return the inputs of the plant from drive.mode, axial.mode and the channels in the order of the FMI inputs.

    ``axial.mode`` is 0 if the axial force is given, 1 if the axial speed is given, 2 if a groove makes the shift.
    """
    drive, axial = modes
    torque, _, acceleration, force, _, rate, load = u
    # 1, 0, 0 and 0, 1, 0 and 0, 0, 1 for the three modes
    pushed = 0.5 * (1.0 - axial) * (2.0 - axial)
    shift_drive = axial * (2.0 - axial)
    groove = 0.5 * axial * (axial - 1.0)
    return Inputs(
        drive,
        shift_drive,
        groove,
        (1.0 - drive) * torque,
        drive * acceleration,
        pushed * force,
        shift_drive * rate,
        load,
    )


def start(x: State, i: Inputs, p: Constants) -> State:
    """Return the initial state of a run, with the shift and axial velocity that a groove imposes, if there is one."""
    return impose_groove(x, i.groove, p)


def clearance(x: State, i: Inputs, p: Constants) -> float:
    """Compute the sine of the transmission angle, which is the cosine of the angle between rod and guide."""
    s = impose_groove(x, i.groove, p)
    return p.branch * position(s[0], s[1], p).h / p.a2


def outputs(x: State, i: Inputs, start_energy: float, p: Constants) -> Outputs:
    """Compute all real outputs of the FMI interface at state ``x`` under the inputs ``i``.

    ``start_energy`` is the mechanical energy at the start of the run (J), the reference of the energy balance.
    """
    x = impose_groove(x, i.groove, p)
    th, s1, w, v, dissipated, supplied = x
    q = position(th, s1, p)
    k = coefficients(q, p)
    m = motion(q, k, x, i, p)
    f = reactions(q, x, m, i, p)
    p2 = crank_pin(q, s1, p)
    p3 = slider_pin(q, p)
    rate = subtract(scale(m.slider_velocity, guide(p)), crank_pin_velocity(q, w, v, p))
    turn = rod_angular_velocity(rod(q, p), rate, p)
    kinetic = kinetic_energy(inertia(q, k, p), w, v)
    potential = potential_energy(q, s1, p)
    energies = (kinetic, potential, dissipated, supplied, kinetic + potential - start_energy + dissipated - supplied)
    closure = (closure_residual(th, s1, q.s4, p), transmission_angle(q, p), assembly_margin(q, p))
    crank, shift = (th, w, m.crank_acceleration), (s1, v, m.shift_acceleration)
    slider = (q.s4, m.slider_velocity, m.slider_acceleration)
    bearing = (f.bearing.x, f.bearing.y, f.axial, *f.bearing_moment)
    joints = (*bearing, *f.crank_pin, *f.slider_pin, *f.guide, *f.guide_moment)
    return Outputs(*crank, *shift, *slider, *p2, *p3, *turn, m.torque, m.force, *joints, *energies, *closure)
