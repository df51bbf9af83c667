"""Loop closure of the generalised slider-crank by 3x3 dual matrices and Newton's method (Rahman, chapter II).

Round the loop the displacements from joint to joint multiply to the identity, M1 L2 L3 M4 = I (eq 5), with

    M1 = Z(theta1 + eps S1) X(eps a1)       ground -> crank, at the crank pin
    L2 = B2 X(eps a2)                       crank -> rod, at the slider pin
    L3 = B3                                 rod -> guide, at the slider pin
    M4 = Z(eps S4) X(alpha4 + eps a4)       guide -> ground

where X and Z are screw displacements about and along i and k. B2 and B3 are the rotations in the ball joints. The thesis
gives each two angles, with which the loop cannot close for a given theta1 and S1 (`two_rotations`, erratum 1).
Here each is a general rotation, corrected in every step by a small rotation about three axes. With S4 these are seven
unknowns for six equations: the spin of the rod about its own line is idle. The convention that it has none, omega . u = 0,
is the seventh equation, in each step of Newton's method (the correction turns the rod about no axis with a component along
it) and for the rates (`dual_dynamics`). It fixes no angle but a change of angle, so that the spin found depends on where
the iteration starts; positions and forces do not depend on it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, cast

import numpy as np

from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.slider_crank.parameters import SliderCrankParameters

from ..numerics.dual import Array, Dual, about_i, about_k, axial, origin, skew, stack
from ..run import takes_published
from ..units import Amount, in_si
from .quantities import FloatArray

#: Largest residual of a closed loop: rotation in radians, and length as a share of the links' lengths together.
TOLERANCE = 1e-12
#: Newton's method doubles the digits in each step; only next to the limit of assembly does it gain one bit a step.
MAX_ITERATIONS = 60


class ClosureError(LinkworkError):
    """The iteration did not find the closed loop of the assembly that is sought, although the links can be joined."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Closure:
    """Closed loops, one for each of n given crank angles and shifts.

    ``crank_angle`` (rad) and ``shift`` (m) are the given theta1 and S1, shape (n,); ``crank_ball`` and ``slider_ball`` are
    the rotations B2 and B3 in the ball joints, shape (n, 3, 3); ``slider_position`` is S4 (m). ``rotation_residual`` (rad)
    and ``length_residual`` (m) say by how much the loops are not closed; ``iterations`` is the largest number of steps.
    """

    parameters: SliderCrankParameters
    crank_angle: FloatArray
    shift: FloatArray
    crank_ball: FloatArray
    slider_ball: FloatArray
    slider_position: FloatArray
    rotation_residual: FloatArray
    length_residual: FloatArray
    iterations: int

    def at(self, points: Any) -> Closure:
        """The loops of some of the points, by their indices (array_like of int): a start for others near them."""
        return replace(self, **{name: getattr(self, name)[points] for name in _POINTWISE})

    @property
    def crank_frame(self) -> Dual:
        """Frame 2, its origin on the crank axis, in frame 1: (n, 3, 3)."""
        return about_k(Dual(self.crank_angle, self.shift))

    @property
    def rod_frame(self) -> Dual:
        """A frame fixed to the rod, in frame 1, its origin in the crank pin and i along the rod: (n, 3, 3).

        It is not the frame 3 in which components of forces are given (`JointLoads.components`): its j and k are
        turned about the rod by the idle spin, as the start of the iteration has left it.
        """
        return self._frames[0]

    @property
    def guide_frame(self) -> Dual:
        """Frame 4, its origin in the slider pin, in frame 1: (n, 3, 3)."""
        return self._frames[1]

    @property
    def _frames(self) -> tuple[Dual, Dual]:
        return _frames(self.parameters, self.crank_angle, self.shift, self.crank_ball, self.slider_ball)

    @property
    def crank_pin(self) -> FloatArray:
        """Position of the crank pin in frame 1 (m): (n, 3)."""
        return origin(self.rod_frame)

    @property
    def slider_pin(self) -> FloatArray:
        """Position of the slider pin in frame 1 (m): (n, 3)."""
        return origin(self.guide_frame)


#: Fields of `Closure` that have a value for each point.
_POINTWISE = tuple(x.name for x in fields(Closure) if x.name not in ("parameters", "iterations"))


def scale(p: SliderCrankParameters, shift: Array) -> float:
    """Length by which lengths are divided to compare them with angles (m): the links' lengths and the largest shift."""
    return p.crank_length + p.rod_length + abs(p.guide_offset) + float(np.max(np.abs(shift)))


def loop(p: SliderCrankParameters, th: Array, s1: Array, crank_ball: Array, slider_ball: Array, s4: Array) -> Dual:
    """The product M1 L2 L3 M4 (n, 3, 3) of eq 5, the identity where the loop is closed."""
    guide = _frames(p, th, s1, crank_ball, slider_ball)[1]
    return cast(Dual, guide @ about_k(Dual(np.zeros_like(s4), s4)) @ about_i(Dual(p.guide_twist, p.guide_offset)))


def estimate(p: SliderCrankParameters, th: Array, s1: Array) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where the iteration starts: the planar slider-crank of section 2.6.2, as (B2, B3, S4).

    The planar mechanism lies in the plane through the crank pin that the common normal i and the guide span. With
    alpha4 = 270 deg and S1 = 0 it is the thesis's and exact.
    """
    guide = about_i(-Dual(p.guide_twist, p.guide_offset))
    pin = (origin(_pin_frame(p, th, s1)) - origin(guide)) @ guide.real
    beyond = p.assembly_branch * np.sqrt(np.maximum(p.rod_length**2 - pin[:, 0] ** 2, 0.0))
    # the rod's axes in frame 4: i from pin to pin, j along that of frame 4
    i = np.stack([-pin[:, 0], np.zeros_like(beyond), -beyond], -1) / p.rod_length
    j = np.broadcast_to([0.0, 1.0, 0.0], i.shape)
    rod = np.stack([i, j, np.cross(i, j)], -1)
    return about_k(-th).real @ guide.real @ rod, np.swapaxes(rod, -1, -2), beyond - pin[:, 2]


@takes_published()
@in_si(crank_angle="rad", shift="m")
def close(
    parameters: SliderCrankParameters, crank_angle: Amount, shift: Amount, start: Closure | None = None
) -> Closure:
    """Close the loop at the given crank angles and shifts, each for itself, by Newton's method.

    Parameters
    ----------
    parameters : SliderCrankParameters
        The mechanism; its ``assembly_branch`` says which assembly is sought.
    crank_angle, shift : array_like
        theta1 (rad) and S1 (m); numbers, or arrays of shape (n,).
    start : Closure, optional
        Loops near those that are sought, as many or one, to start from; the rod first keeps its orientation in space. By
        default the planar `estimate`.

    Raises
    ------
    InputError
        If an angle or a shift is not a finite number, or their shapes or the number of loops in ``start`` do not agree.
    AssemblyError
        If the rod does not reach the guide, with the length that it lacks at the worst of the given angles.
    ClosureError
        If the iteration ends in a loop that is not closed or in the other assembly.
    """
    p = parameters
    th, s1 = points_of(crank_angle, shift)
    lacking = shortage(p, th, s1)
    worst = int(np.argmax(lacking))
    if lacking[worst] > TOLERANCE * scale(p, s1):
        raise AssemblyError(
            f"the rod of {p.rod_length:.6g} m does not reach the guide at theta1 = {th[worst]:.6g} rad, S1 = {s1[worst]:.6g} "
            f"m: the crank pin is {p.rod_length + lacking[worst]:.6g} m from it, {lacking[worst]:.3g} m too far"
        )
    if start is not None and start.crank_angle.size not in (1, th.size):
        raise InputError(
            f"start has {start.crank_angle.size} loops for {th.size} points: it must have one, or one for each point"
        )
    if start is None:
        crank_ball, slider_ball, s4 = estimate(p, th, s1)
    else:
        back = about_k(start.crank_angle - th).real
        crank_ball = back @ start.crank_ball
        slider_ball = np.broadcast_to(start.slider_ball, crank_ball.shape)
        s4 = np.broadcast_to(start.slider_position, th.shape)
    found = False
    iterations = 0
    while not found and iterations < MAX_ITERATIONS:
        iterations += 1
        product = loop(p, th, s1, crank_ball, slider_ball, s4)
        rotation, distance = residuals(product)
        # one more step from inside the tolerance, after which only rounding is left
        found = bool(np.all(rotation <= TOLERANCE) and np.all(distance <= TOLERANCE * scale(p, s1)))
        try:
            step = _correction(product, *_frames(p, th, s1, crank_ball, slider_ball), scale(p, s1))
        except np.linalg.LinAlgError:
            break
        crank_ball = crank_ball @ _turn(np.concatenate([np.zeros((th.size, 1)), step[:, :2]], -1))
        slider_ball = slider_ball @ _turn(step[:, 2:5])
        s4 = s4 + scale(p, s1) * step[:, 5]
    rotation, distance = residuals(loop(p, th, s1, crank_ball, slider_ball, s4))
    _check(p, th, s1, rotation, distance, slider_ball, iterations)
    return Closure(
        parameters=p,
        crank_angle=th,
        shift=s1,
        crank_ball=crank_ball,
        slider_ball=slider_ball,
        slider_position=s4,
        rotation_residual=rotation,
        length_residual=distance,
        iterations=iterations,
    )


@takes_published()
@in_si(crank_angle="rad", shift="m")
def follow(parameters: SliderCrankParameters, crank_angle: Amount, shift: Amount) -> Closure:
    """Close the loop by continuation: the first point from the planar estimate, every other from the one before it.

    The rod then turns from point to point without spin. The points must be close to each other, by 20 degrees or less.

    Parameters
    ----------
    parameters : SliderCrankParameters
        The mechanism.
    crank_angle, shift : array_like
        theta1 (rad) and S1 (m) in the order of the motion, numbers or arrays of shape (n,).

    Raises
    ------
    InputError, AssemblyError, ClosureError
        As `close`; a step that would change the assembly is a ClosureError.
    """
    th, s1 = points_of(crank_angle, shift)
    points: list[Closure] = []
    for angle, position in zip(th, s1):
        points.append(close(parameters, angle, position, points[-1] if points else None))
    joined: dict[str, Any] = {name: np.concatenate([getattr(x, name) for x in points]) for name in _POINTWISE}
    return Closure(parameters=parameters, iterations=max(x.iterations for x in points), **joined)


def residuals(product: Dual) -> tuple[FloatArray, FloatArray]:
    """By how much loops (..., 3, 3) are not closed: angle (rad) and length (unit of the loop), shape (...).

    The whole matrix is judged: its antisymmetric part alone, which the iteration makes zero, is zero as well where the loop
    closes but for half a turn.
    """
    # |R - I| is 2 sqrt2 |sin of half the angle|
    chord = np.linalg.norm(product.real - np.eye(3), axis=(-2, -1)) / np.sqrt(8.0)
    return 2.0 * np.arcsin(np.minimum(chord, 1.0)), np.linalg.norm(origin(product), axis=-1)


def points_of(crank_angle: Any, shift: Any) -> tuple[FloatArray, FloatArray]:
    """Crank angles and shifts of one shape (n,)."""
    try:
        th, s1 = np.broadcast_arrays(np.asarray(crank_angle, dtype=float), np.asarray(shift, dtype=float))
    except ValueError as error:
        raise InputError(f"crank angles and shifts must be numbers, or arrays of one length: {error}") from None
    th, s1 = np.atleast_1d(th), np.atleast_1d(s1)
    if th.ndim != 1 or th.size == 0:
        raise InputError(f"crank angles and shifts have the shape {th.shape}: one axis with a point or more is needed")
    for name, values in (("crank angle", th), ("shift", s1)):
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputError(f"{name} {bad[0]} is {values[bad[0]]}: it must be a finite number")
    return th, s1


def _pin_frame(p: SliderCrankParameters, th: Array, s1: Array) -> Dual:
    """M1: the crank's frame moved to the crank pin."""
    return cast(Dual, about_k(Dual(th, s1)) @ about_i(Dual(0.0, p.crank_length)))


def _frames(p: SliderCrankParameters, th: Array, s1: Array, crank_ball: Array, slider_ball: Array) -> tuple[Dual, Dual]:
    """Frames in frame 1 of the rod, at the crank pin, and of the guide, at the slider pin."""
    rod = _pin_frame(p, th, s1) @ crank_ball
    return cast(Dual, rod), cast(Dual, rod @ about_i(Dual(0.0, p.rod_length)) @ slider_ball)


def _correction(product: Dual, rod: Dual, guide: Dual, length: float) -> FloatArray:
    """Newton's step (n, 6): rotations about j, k of the rod, about i, j, k of the guide; slide as a share of ``length``.

    A joint's motion q along its screw s changes the loop E by [s]E q, and the vector of the antisymmetric part of that is
    (tr(E) I - E) s q / 2: the exact derivative, from closed or open loops.
    """
    trace = Dual(np.trace(product.real, axis1=-2, axis2=-1), np.trace(product.dual, axis1=-2, axis2=-1))
    slide = Dual(np.zeros_like(guide.real[..., 2]), guide.real[..., 2] * length)
    screws = stack([rod[..., 1], rod[..., 2], guide[..., 0], guide[..., 1], guide[..., 2], slide])
    columns = 0.5 * (trace[..., None, None] * np.eye(3) - product) @ screws
    matrix = np.concatenate([columns.real, columns.dual / length], -2)
    error = axial(product)
    return cast(
        FloatArray, np.linalg.solve(matrix, -np.concatenate([error.real, error.dual / length], -1)[..., None])[..., 0]
    )


def _turn(vector: Array) -> Array:
    """Rotation matrices (n, 3, 3) of the vectors (n, 3): axis times tangent of half the angle times two (Cayley)."""
    half = 0.5 * vector
    m = skew(half).real
    turn: Array = np.eye(3) + 2.0 * (m + m @ m) / (1.0 + np.sum(half * half, -1))[:, None, None]
    return turn


def _check(
    p: SliderCrankParameters,
    th: Array,
    s1: Array,
    rotation: Array,
    distance: Array,
    slider_ball: Array,
    iterations: int,
) -> None:
    """Accept loops that are closed and in the assembly that is sought, or say what is wrong."""
    error = np.maximum(rotation, distance / scale(p, s1))
    worst = int(np.argmax(error))
    if not error[worst] <= TOLERANCE:
        raise ClosureError(
            f"loop closure residual {rotation[worst]:.1e} rad and {distance[worst]:.1e} m after {iterations} iterations at "
            f"theta1 = {th[worst]:.6g} rad, S1 = {s1[worst]:.6g} m, though the rod reaches the guide: start nearer "
            "to the loop that is sought"
        )
    # the slider pin is beyond the crank pin's foot on the guide, against k4
    side = -p.assembly_branch * slider_ball[:, 0, 2]
    worst = int(np.argmin(side))
    if side[worst] < 0.0:
        raise ClosureError(
            f"the loop closes in assembly {-p.assembly_branch:+d} at theta1 = {th[worst]:.6g} rad, S1 = {s1[worst]:.6g} m, "
            f"where {p.assembly_branch:+d} is sought: start nearer to it"
        )


def shortage(p: SliderCrankParameters, crank_angle: Any, shift: Any) -> FloatArray:
    """By how much the rod is too short (m), negative where the loop can be closed: the distance of the crank pin from the
    guide's line less the length of the rod.
    """
    guide = about_i(-Dual(p.guide_twist, p.guide_offset))
    pin = origin(_pin_frame(p, np.asarray(crank_angle), np.asarray(shift)))
    across = (pin - origin(guide)) @ guide.real[:, :2]
    return cast(FloatArray, np.linalg.norm(across, axis=-1) - p.rod_length)
