"""Compute velocities, accelerations and joint forces of the generalised slider-crank by dual vectors (Rahman, eqs 29 to 69).

The velocity of a body is a dual vector, omega + eps v, where v is the velocity of the point of the body at the origin of
the frame; forces are F + eps M and momenta p + eps H in the same way. The dual matrices of `closure` transform all of them
from frame to frame. Each body's momentum is its inertia binor applied to its velocity (eqs 46 to 48). The rate of the
momentum is the rate in the body's frame plus the cross product with the velocity (eqs 49 to 58); it equals the sum of the
dual forces on the body (eqs 59 to 64). These are 18 scalar equations. The moment equation of the rod about its own line is
always satisfied: forces at the pins have no moment about this line, and a symmetric rod without spin needs none. The
other 17 equations have 17 unknowns (eqs 69): force (2) and moment (2) of the bearing, the axial force on the crank (erratum
7: it is an unknown, because S1 is prescribed), three components of the force in each ball joint, force (2) and moment (3)
of the guide, and the crank's torque or the force on the slider.

The plant's equations (`linkwork.slider_crank.kinematics`, `dynamics`) are not used here, only the plant's parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.slider_crank.parameters import SliderCrankParameters

from ..numerics.dual import Dual, about_i, apply, cross, join, stack
from .closure import Closure, close, scale
from .forces import NO_LEVER, SLIDER_FORCE, ForceTurn
from .quantities import DEAD_CENTRE, JOINTS, FloatArray, array_per_angle
from .shifts import has_shaft_groove, plant_functions

#: Cosine of the angle between rod and guide below which the loop is at the limit of assembly.
LIMIT_COSINE = 1e-9


class DeadCentreError(LinkworkError):
    """Error at a dead centre, dS4/dtheta1 = 0, where the crank torque does not determine the slider force."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Binor:
    """Inertia binor of a body in a body-fixed frame (eqs 46 to 48): maps its dual velocity to its dual momentum.

    ``mass`` is in kg; ``moment`` (3,) is the mass times the coordinates of the centre of mass, in kg.m; ``inertia`` (3, 3) is
    the inertia matrix about the frame's origin, in kg.m2.
    """

    mass: float
    moment: FloatArray
    inertia: FloatArray

    def momentum(self, velocity: Dual) -> Dual:
        """Return p + eps H for omega + eps v, shape (..., 3): p = m v + omega x m c, H = I omega + m c x v."""
        omega, v = velocity.real, velocity.dual
        return Dual(self.mass * v + np.cross(omega, self.moment), omega @ self.inertia.T + np.cross(self.moment, v))

    def rate(self, velocity: Dual, acceleration: Dual) -> Dual:
        """Return the rate of the dual momentum (eqs 49 to 58); ``acceleration`` is the rate of the velocity's components."""
        return cast(Dual, self.momentum(acceleration) + cross(velocity, self.momentum(velocity)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Rates:
    """Dual velocities of the links in frame 1, their time derivatives, and velocity and acceleration of the slider.

    Dual vectors have shape (n, 3): omega + eps v, where v is the velocity of the body's point at O. ``slider_velocity`` and
    ``slider_acceleration`` are S4' (m/s) and S4'' (m/s2), ``ratio`` is dS4/dtheta1 (m/rad), each of shape (n,).
    """

    crank: Dual
    rod: Dual
    slider: Dual
    crank_rate: Dual
    rod_rate: Dual
    slider_rate: Dual
    slider_velocity: FloatArray
    slider_acceleration: FloatArray
    ratio: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class JointLoads:
    """Forces and moments in all joints, as components in frame 1; arrays of shape (n, 3) and (n,), N and N.m.

    ``bearing`` is the force of the bearing on the crank, without axial component; ``axial`` is the total force on the
    crank along its axis, which drives or holds the shift; ``bearing_moment`` is about O and includes the drive's ``torque``.
    ``crank_pin`` is the force of the crank on the rod, ``slider_pin`` the force of the slider on the rod; ``guide`` is the
    force of the guide on the slider and ``guide_moment`` its moment about the slider pin. ``slider_force`` is the sum of all
    forces on the slider along the guide (load, spring, damper, friction), positive in the direction in which the slider
    position increases.

    ``residual`` is the residual of the one equation that is not solved, the moment of the rod about its line (N.m).
    """

    closure: Closure
    torque: FloatArray
    axial: FloatArray
    slider_force: FloatArray
    bearing: FloatArray
    bearing_moment: FloatArray
    crank_pin: FloatArray
    slider_pin: FloatArray
    guide: FloatArray
    guide_moment: FloatArray
    residual: FloatArray


def rates(
    closure: Closure, *, speed: Any, shift_velocity: Any = 0.0, acceleration: Any = 0.0, shift_acceleration: Any = 0.0
) -> Rates:
    """Compute dual velocities (eqs 29 to 45) and their time derivatives from the motion of crank and shift.

    The arguments are theta1' (rad/s), S1' (m/s), theta1'' (rad/s2) and S1'' (m/s2).

    The screws of the joints times the joint rates add up to zero around the loop. These are six equations, all of which are
    used (the thesis drops the last, erratum 3). The seventh is omega . u = 0 for the rod's spin. The time derivative of the
    equations, in which each screw moves with the body that carries it, gives the accelerations.

    Raises
    ------
    InputError
        If a rate is not finite, or is neither one value nor one for each point of the closure.
    AssemblyError
        At the limit of assembly, where the rod is perpendicular to the guide.
    """
    n = closure.crank_angle.size
    w, v = array_per_angle("speed", speed, n), array_per_angle("shift_velocity", shift_velocity, n)
    e = array_per_angle("acceleration", acceleration, n)
    a = array_per_angle("shift_acceleration", shift_acceleration, n)
    k = np.array([0.0, 0.0, 1.0])
    rod, guide = closure.rod_frame, closure.guide_frame
    cosine = np.abs(np.sum(rod.real[..., 0] * guide.real[..., 2], -1))
    if np.min(cosine) < LIMIT_COSINE:
        worst = int(np.argmin(cosine))
        raise AssemblyError(
            f"the rod is perpendicular to the guide at theta1 = {closure.crank_angle[worst]:.6g} rad, S1 = "
            f"{closure.shift[worst]:.6g} m: there, at the limit of assembly, the slider has no finite velocity"
        )
    slide = Dual(np.zeros((n, 3)), guide.real[..., 2])
    # columns: the ball joints' relative rotations about the axes of rod and guide, the slide
    screws = stack([*(rod[..., i] for i in range(3)), *(guide[..., i] for i in range(3)), slide])
    length = scale(closure.parameters, closure.shift)
    matrix = np.zeros((n, 7, 7))
    matrix[:, :3] = screws.real
    matrix[:, 3:6] = screws.dual / length
    # no spin: the rotations of the crank and of the first ball joint have no component along the rod's line in total
    matrix[:, 6, 0] = 1.0

    def solve(known: Dual, turning: Dual) -> FloatArray:
        """Solve the seven equations for the joint rates or their derivatives, shape (n, 7).

        ``known`` is the sum of the loop's known terms; the real part of ``turning`` is the known part of the rod's rotation.
        """
        spin = np.sum(turning.real * rod.real[..., 0], -1)
        right = np.concatenate([known.real, known.dual / length, spin[:, None]], -1)
        return cast(FloatArray, -np.linalg.solve(matrix, right[..., None])[..., 0])

    crank = Dual(w[:, None] * k, v[:, None] * k)
    q = solve(crank, crank)
    rod_relative, slider_relative = apply(rod, q[:, :3]), apply(guide, q[:, 3:6])
    rod_velocity = crank + rod_relative
    # the slider's velocity from the ground's side of the loop
    slider = -(slide * q[:, 6:])
    # rates of the screws: the first ball joint's screws move with the rod, the second's with the slider; the slide's rate is 0
    crank_rate = Dual(e[:, None] * k, a[:, None] * k)
    rod_moving = crank_rate + cross(rod_velocity, rod_relative)
    qq = solve(rod_moving + cross(slider, slider_relative), rod_moving)
    unit = Dual(np.broadcast_to(k, (n, 3)))
    return Rates(
        crank=crank,
        rod=rod_velocity,
        slider=slider,
        crank_rate=crank_rate,
        rod_rate=rod_moving + apply(rod, qq[:, :3]),
        slider_rate=-(slide * qq[:, 6:]),
        slider_velocity=q[:, 6],
        slider_acceleration=qq[:, 6],
        ratio=solve(unit, unit)[:, 6],
    )


def binors(p: SliderCrankParameters) -> tuple[Binor, Binor, Binor]:
    """Return the inertia binors of crank (in frame 2), rod (in its frame at the crank pin) and slider (in frame 4 at its pin).

    The inertia matrices have only the elements that have an effect: the crank's moment of inertia about its axis and products
    of inertia with this axis, and the rod's moment of inertia about transverse axes. The slider does not rotate.
    """
    crank = np.zeros((3, 3))
    crank[2] = crank[:, 2] = -p.crank_product_xz, -p.crank_product_yz, p.crank_inertia
    transverse = p.rod_inertia + p.rod_mass * p.rod_cog_distance**2

    def body(mass: float, *centre: float, inertia: FloatArray) -> Binor:
        return Binor(mass=mass, moment=mass * np.array(centre), inertia=inertia)

    return (
        body(p.crank_mass, p.crank_cog_x, p.crank_cog_y, p.crank_cog_z, inertia=crank),
        body(p.rod_mass, p.rod_cog_distance, 0.0, 0.0, inertia=np.diag([0.0, transverse, transverse])),
        body(p.slider_mass, p.slider_cog_x, p.slider_cog_y, p.slider_cog_z, inertia=np.zeros((3, 3))),
    )


def joint_loads(closure: Closure, *, torque: Any = None, slider_force: Any = None, **motion: Any) -> JointLoads:
    """Compute all joint forces and moments of a motion (eqs 62 to 69) for a given crank torque or slider force.

    Parameters
    ----------
    closure : Closure
        The positions.
    torque : array_like, optional
        Torque on the crank about its axis (N.m), if the slider's force is sought.
    slider_force : array_like, optional
        Force on the slider along the guide, positive where S4 increases (N), if the torque is sought.
    **motion : array_like
        Arguments of `rates`: ``speed``, and others that are not zero; one value, or one for each point.

    Raises
    ------
    InputError
        If not exactly one of ``torque`` and ``slider_force`` is given, or if a value is not finite or has the wrong shape.
    AssemblyError
        At the limit of assembly.
    DeadCentreError
        If the torque is given at a dead centre.
    """
    if (torque is None) == (slider_force is None):
        raise InputError("give either the torque (the slider's force is then computed) or the slider's force, not both")
    p = closure.parameters
    n = closure.crank_angle.size
    moving = rates(closure, **motion)
    if torque is not None:
        _check_dead_centres(closure, moving)
    length = scale(p, closure.shift)
    pin, front = _ball_frames(closure)
    matrix, load = _equations(closure, moving, length)
    # the moment equation of the rod about its own line is always satisfied
    kept = np.delete(np.arange(18), 9)
    if torque is not None:
        given, known = 5, array_per_angle("torque", torque, n) / length
    else:
        given, known = 17, array_per_angle("slider_force", slider_force, n)
    free = np.delete(np.arange(18), given)
    right = load[:, kept] - known[:, None] * matrix[:, kept, given]
    unknown = np.linalg.solve(matrix[:, kept[:, None], free], right[..., None])[..., 0]
    f = np.insert(unknown, given, known, axis=-1)
    guide = closure.guide_frame.real
    return JointLoads(
        closure=closure,
        torque=f[:, 5] * length,
        axial=f[:, 4],
        slider_force=f[:, 17],
        bearing=np.concatenate([f[:, :2], np.zeros((n, 1))], -1),
        bearing_moment=f[:, [2, 3, 5]] * length,
        crank_pin=np.einsum("nij,nj->ni", pin.real, f[:, 6:9]),
        slider_pin=np.einsum("nij,nj->ni", front.real, f[:, 9:12]),
        guide=np.einsum("nij,nj->ni", guide[..., :2], f[:, 12:14]),
        guide_moment=np.einsum("nij,nj->ni", guide, f[:, 14:17]) * length,
        residual=(np.einsum("ni,ni->n", matrix[:, 9], f) - load[:, 9]) * length,
    )


def _ball_frames(closure: Closure) -> tuple[Dual, Dual]:
    """Return the crank's frame moved to the crank pin, and the rod's frame moved to the slider pin."""
    p = closure.parameters
    pin = closure.crank_frame @ about_i(Dual(0.0, p.crank_length))
    return cast(Dual, pin), cast(Dual, closure.rod_frame @ about_i(Dual(0.0, p.rod_length)))


def _equations(closure: Closure, motion: Rates, length: float) -> tuple[FloatArray, FloatArray]:
    """Return matrix (n, 18, 18) and right side (n, 18) of eqs 62 to 64; moments and lever arms are divided by ``length``.

    The columns of the matrix are the screws of the unknown forces (F) and moments (T), in this order: bearing 1Fi, 1Fj, 1Ti,
    1Tj; axial force 1Fk; torque 1Tk; crank pin 2F; slider pin 3F; guide 4Fi, 4Fj, 4T; force on the slider.
    """
    p, n = closure.parameters, closure.crank_angle.size
    axes = np.broadcast_to(np.eye(3), (n, 3, 3))
    forces, moments = Dual(axes), Dual(np.zeros_like(axes), axes * length)
    # bodies' frames in frame 1, and momentum rates minus gravity in them: D'Alembert (eqs 62 to 64), with the signs of f1
    # and f3 (erratum 5) and the centres of mass (erratum 6) as Newton's law has them
    frames = (closure.crank_frame, closure.rod_frame, closure.guide_frame)
    gravity = Dual(np.zeros(3), np.array([p.gravity_x, p.gravity_y, p.gravity_z]))
    velocities = motion.crank, motion.rod, motion.slider
    changes = motion.crank_rate, motion.rod_rate, motion.slider_rate
    needed = [
        binor.rate(apply(body.T, velocity), apply(body.T, rate)) - binor.momentum(apply(Dual(body.real).T, gravity))
        for binor, body, velocity, rate in zip(binors(p), frames, velocities, changes)
    ]
    pin, front = _ball_frames(closure)
    ground = join(forces[..., :2], moments[..., :2], forces[..., 2:], moments[..., 2:])
    guiding = join(frames[2][..., :2], frames[2] @ moments, -frames[2][..., 2:])
    nothing = Dual(np.zeros((n, 3, 6)))
    on_crank = join(ground, -pin, nothing[..., :3], nothing)
    on_rod = join(nothing, pin, front, nothing)
    on_slider = join(nothing, nothing[..., :3], -front, guiding)
    rows, right = [], []
    for body, screws, rate in zip(frames, (on_crank, on_rod, on_slider), needed):
        local = cast(Dual, body.T @ screws)
        rows.append(np.concatenate([local.real, local.dual / length], -2))
        right.append(np.concatenate([rate.real, rate.dual / length], -1))
    return np.concatenate(rows, -2), np.concatenate(right, -1)


def _check_dead_centres(closure: Closure, motion: Rates) -> None:
    dead = np.flatnonzero(np.abs(motion.ratio) < DEAD_CENTRE * closure.parameters.crank_length)
    if dead.size:
        i = int(dead[0])
        raise DeadCentreError(
            f"theta1 = {closure.crank_angle[i]:.9g} rad is a dead centre (dS4/dtheta1 = {motion.ratio[i]:.1e} m/rad): the "
            "torque does not determine the slider's force there; give the slider's force, or leave the point out"
        )


# Comparison with vector mechanics


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Largest difference of a quantity between the two methods, in SI.

    ``largest`` is the greatest magnitude of the quantity; ``relative`` is the difference divided by the greatest magnitude of
    any quantity of the same unit.
    """

    quantity: str
    unit: str
    largest: float
    difference: float
    relative: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Differences between the dual-number method and vector mechanics.

    Attributes
    ----------
    differences : tuple of Difference
    angles : int
        Number of crank angles that were compared: those at which all quantities are determined.
    rotation_residual, length_residual : float
        Largest closure errors of the loop (rad, m).
    iterations : int
        Largest number of iterations that closing the loop took.
    rod_moment : float
        Greatest moment on the rod about its line (N.m): it should be zero, although this equation is not solved.
    """

    differences: tuple[Difference, ...]
    angles: int
    rotation_residual: float
    length_residual: float
    iterations: int
    rod_moment: float


def compare(turn: ForceTurn) -> Comparison:
    """Compute motion and forces of a turn again by dual matrices and compare them with vector mechanics.

    Raises
    ------
    InputError
        If the slider's force is sought for a crank that a groove in its shaft shifts (the dual method does not cover this
        case), or if the slider's force is determined at none of the angles.
    """
    sought = turn.sought == SLIDER_FORCE
    if sought and has_shaft_groove(turn.law):
        raise InputError(
            "the dual-number method computes the slider's force only if the shift has a drive of its own: give the load, "
            "or a groove that is not in the shaft"
        )
    good = ~np.ma.getmaskarray(turn.slider_force)
    if not good.any():
        none = "the slider's force has no lever on the crank at any of the angles, which are all dead centres"
        raise InputError(f"there is nothing to compare: {NO_LEVER if turn.without_lever else none}; give the load")
    closure = close(turn.parameters, turn.angle[good], turn.shift[good])
    moving: dict[str, Any] = {
        "speed": turn.speed[good],
        "acceleration": turn.acceleration[good],
        "shift_velocity": turn.shift_velocity[good],
        "shift_acceleration": turn.shift_acceleration[good],
    }
    motion = rates(closure, **moving)
    # the slider force of the dual method is the whole force along the guide, with spring, damper and friction
    p = turn.parameters.constants()
    pushed = plant_functions().slider_resistance(closure.slider_position, motion.slider_velocity, 0.0, p)
    if sought:
        loads = joint_loads(closure, torque=turn.torque.data[good], **moving)
    else:
        loads = joint_loads(closure, slider_force=pushed + turn.slider_force.data[good], **moving)
    pairs: list[tuple[str, str, Any, Any]] = [
        ("slider position", "m", closure.slider_position, turn.slider_position),
        ("slider velocity", "m/s", motion.slider_velocity, turn.slider_velocity),
        ("slider acceleration", "m/s2", motion.slider_acceleration, turn.slider_acceleration),
        ("slider force", "N", loads.slider_force - pushed, turn.slider_force),
        ("axial force on the crank", "N", loads.axial, turn.axial_force),
    ]
    pairs += [(joint.words, joint.unit, getattr(loads, name), turn.vector(name)) for name, joint in JOINTS.items()]
    found = [
        (words, unit, float(np.abs(b[good]).max()), float(np.abs(a - np.ma.getdata(b)[good]).max()))
        for words, unit, a, b in pairs
    ]
    scales = {unit: max(size for _, other, size, _ in found if other == unit) or 1.0 for _, unit, _, _ in found}
    return Comparison(
        differences=tuple(
            Difference(
                quantity=words, unit=unit, largest=size, difference=difference, relative=difference / scales[unit]
            )
            for words, unit, size, difference in found
        ),
        angles=int(good.sum()),
        rotation_residual=float(closure.rotation_residual.max()),
        length_residual=float(closure.length_residual.max()),
        iterations=closure.iterations,
        rod_moment=float(np.abs(loads.residual).max()),
    )
