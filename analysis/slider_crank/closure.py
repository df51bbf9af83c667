"""Close the loop of the generalised slider-crank by 3x3 dual matrices and Newton's method (Rahman, chapter II).

Around the loop the displacements from joint to joint multiply to the identity, M1 L2 L3 M4 = I (eq 5), with

    M1 = Z(theta1 + eps S1) X(eps a1)       ground -> crank, at the crank pin
    L2 = B2 X(eps a2)                       crank -> rod, at the slider pin
    L3 = B3                                 rod -> guide, at the slider pin
    M4 = Z(eps S4) X(alpha4 + eps a4)       guide -> ground

where X and Z are screw displacements about and along i and k. B2 and B3 are the rotations in the ball joints. The thesis
gives each rotation two angles, with which the loop cannot close for given theta1 and S1 (see `settle` below, erratum 1).
Here both are general rotations, corrected in every step by small rotations about three axes. With S4 these are seven
unknowns for six equations, because the rod can spin about its own line without effect. The seventh equation is a convention:
the rod does not spin, omega . u = 0. It holds in each step of Newton's method (the correction does not turn the rod about its
line) and for the rates (`dual_dynamics`). This convention determines only changes of the spin angle. The spin angle itself
therefore depends on the start of the iteration; positions and forces do not depend on the spin angle.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.slider_crank.parameters import SliderCrankParameters

from ..numerics.dual import Array, Dual, about_i, about_j, about_k, axial, origin, skew, stack
from ..run import takes_published
from ..units import INCH, Amount, in_si
from .quantities import FloatArray

#: Largest residual of a closed loop: rotation in radians, and length relative to `scale`.
TOLERANCE = 1e-12
#: Newton iterations at most: each doubles the number of correct digits, but next to the limit of assembly it gains only one
#: bit.
MAX_ITERATIONS = 60


class ClosureError(LinkworkError):
    """Error of an iteration that does not find the closed loop in the chosen assembly, although the links can be joined."""


def scale(p: SliderCrankParameters, shift: Array) -> float:
    """Return the length (m) by which lengths are divided to compare them with angles.

    It is the sum of crank length, rod length, magnitude of the guide offset, and largest ``|shift|``.
    """
    return p.crank_length + p.rod_length + abs(p.guide_offset) + float(np.max(np.abs(shift)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Loops:
    """Loops of the mechanism, closed or not, at n crank angles and shifts.

    ``crank_angle`` (rad) and ``shift`` (m) are theta1 and S1, shape (n,); ``crank_ball`` and ``slider_ball`` are the
    rotations B2 and B3 in the ball joints, shape (n, 3, 3); ``slider_position`` is S4 (m).
    """

    parameters: SliderCrankParameters
    crank_angle: FloatArray
    shift: FloatArray
    crank_ball: FloatArray
    slider_ball: FloatArray
    slider_position: FloatArray

    @property
    def crank_frame(self) -> Dual:
        """Return the dual matrix of frame 2 relative to frame 1, (n, 3, 3); the origin of frame 2 is on the crank axis."""
        return about_k(Dual(self.crank_angle, self.shift))

    @property
    def rod_frame(self) -> Dual:
        """Return the dual matrix of a frame fixed to the rod relative to frame 1, (n, 3, 3).

        The origin of the frame is the crank pin, and its axis i is along the rod. This frame is not frame 3, in which
        components of forces are given (`ForceTurn.vector`): the axes j and k are turned about the rod by the spin angle,
        which depends on the start of the iteration.
        """
        return cast(Dual, _pin_frame(self.parameters, self.crank_angle, self.shift) @ self.crank_ball)

    @property
    def guide_frame(self) -> Dual:
        """Return the dual matrix of frame 4 relative to frame 1, (n, 3, 3); the origin of frame 4 is the slider pin."""
        return cast(Dual, self.rod_frame @ about_i(Dual(0.0, self.parameters.rod_length)) @ self.slider_ball)

    @property
    def crank_pin(self) -> FloatArray:
        """Return the position of the crank pin in frame 1 (m), shape (n, 3)."""
        return origin(self.rod_frame)

    @property
    def slider_pin(self) -> FloatArray:
        """Return the position of the slider pin in frame 1 (m), shape (n, 3)."""
        return origin(self.guide_frame)

    @property
    def product(self) -> Dual:
        """Return the product M1 L2 L3 M4 of eq 5, (n, 3, 3): the identity where the loop is closed."""
        p, s4 = self.parameters, self.slider_position
        slide = about_k(Dual(np.zeros_like(s4), s4))
        return cast(Dual, self.guide_frame @ slide @ about_i(Dual(p.guide_twist, p.guide_offset)))

    def take_newton_step(self) -> Loops:
        """Return the loops after one step of Newton's method; raise LinAlgError if the equations of the step are singular."""
        length = scale(self.parameters, self.shift)
        step = _correction(self.product, self.rod_frame, self.guide_frame, length)
        return replace(
            self,
            crank_ball=self.crank_ball @ _rotation(np.concatenate([np.zeros((len(step), 1)), step[:, :2]], -1)),
            slider_ball=self.slider_ball @ _rotation(step[:, 2:5]),
            slider_position=self.slider_position + length * step[:, 5],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Closure(Loops):
    """Closed loops, one for each of n given crank angles and shifts; see `Loops`.

    ``rotation_residual`` (rad) and ``length_residual`` (m) are the closure errors, shape (n,); ``iterations`` is the largest
    number of Newton steps.
    """

    rotation_residual: FloatArray
    length_residual: FloatArray
    iterations: int

    def at(self, points: Any) -> Closure:
        """Return the loops of the points with given indices (array_like of int), for example to start near them."""
        return replace(self, **{name: getattr(self, name)[points] for name in _POINTWISE})


#: Fields of `Closure` that have a value for each point.
_POINTWISE = tuple(x.name for x in fields(Closure) if x.name not in ("parameters", "iterations"))


def planar_loops(p: SliderCrankParameters, th: Array, s1: Array) -> Loops:
    """Return the start of the iteration: the planar slider-crank of section 2.6.2.

    The planar mechanism lies in the plane through the crank pin that is parallel to the common normal i and the guide. With
    alpha4 = 270 deg and S1 = 0 the start is the thesis's planar slider-crank, and already the exact closed loop.
    """
    guide = about_i(-Dual(p.guide_twist, p.guide_offset))
    pin = (origin(_pin_frame(p, th, s1)) - origin(guide)) @ guide.real
    beyond = p.assembly_branch * np.sqrt(np.maximum(p.rod_length**2 - pin[:, 0] ** 2, 0.0))
    # the rod's axes in frame 4: i from pin to pin, j along that of frame 4
    i = np.stack([-pin[:, 0], np.zeros_like(beyond), -beyond], -1) / p.rod_length
    j = np.broadcast_to([0.0, 1.0, 0.0], i.shape)
    rod = np.stack([i, j, np.cross(i, j)], -1)
    return Loops(
        parameters=p,
        crank_angle=th,
        shift=s1,
        crank_ball=about_k(-th).real @ guide.real @ rod,
        slider_ball=np.swapaxes(rod, -1, -2),
        slider_position=beyond - pin[:, 2],
    )


def _start_nearby(start: Closure, th: Array, s1: Array) -> Loops:
    """Return start loops with the rod orientation of nearby closed loops: one loop for all points, or one for each point."""
    if start.crank_angle.size not in (1, th.size):
        raise InputError(
            f"start has {start.crank_angle.size} loops for {th.size} points: it must have one, or one for each point"
        )
    crank_ball = about_k(start.crank_angle - th).real @ start.crank_ball
    return Loops(
        parameters=start.parameters,
        crank_angle=th,
        shift=s1,
        crank_ball=crank_ball,
        slider_ball=np.broadcast_to(start.slider_ball, crank_ball.shape),
        slider_position=np.broadcast_to(start.slider_position, th.shape),
    )


@takes_published()
@in_si(crank_angle="rad", shift="m")
def close(
    parameters: SliderCrankParameters, crank_angle: Amount, shift: Amount, start: Closure | None = None
) -> Closure:
    """Close the loop at each of the given crank angles and shifts by Newton's method.

    Parameters
    ----------
    parameters : SliderCrankParameters
        The mechanism; its ``assembly_branch`` chooses the assembly.
    crank_angle, shift : array_like
        theta1 (rad) and S1 (m); numbers, or arrays of shape (n,).
    start : Closure, optional
        Closed loops near the wanted loops, one for all points or one for each point: the iteration starts with their rod
        orientation in space. By default it starts from the planar slider-crank.

    Raises
    ------
    InputError
        If an angle or a shift is not a finite number, or their shapes or the number of loops in ``start`` do not agree.
    AssemblyError
        If the rod does not reach the guide; the message gives the greatest missing length and its crank angle.
    ClosureError
        If the iteration ends in an open loop or in the other assembly.
    """
    p = parameters
    th, s1 = broadcast_points(crank_angle, shift)
    lacking, length = shortage(p, th, s1), scale(p, s1)
    worst = int(np.argmax(lacking))
    if lacking[worst] > TOLERANCE * length:
        raise AssemblyError(
            f"the rod of {p.rod_length:.6g} m does not reach the guide at theta1 = {th[worst]:.6g} rad, S1 = {s1[worst]:.6g} "
            f"m: the crank pin is {p.rod_length + lacking[worst]:.6g} m from it, {lacking[worst]:.3g} m too far"
        )
    loops = planar_loops(p, th, s1) if start is None else replace(_start_nearby(start, th, s1), parameters=p)
    iterations, found = 0, False
    while not found and iterations < MAX_ITERATIONS:
        iterations += 1
        rotation, distance = residuals(loops.product)
        # one more step from inside the tolerance, after which only rounding errors remain
        found = bool(np.all(rotation <= TOLERANCE) and np.all(distance <= TOLERANCE * length))
        try:
            loops = loops.take_newton_step()
        except np.linalg.LinAlgError:
            break
    rotation, distance = residuals(loops.product)
    own = {field.name: getattr(loops, field.name) for field in fields(Loops)}
    closed = Closure(rotation_residual=rotation, length_residual=distance, iterations=iterations, **own)
    _check(closed)
    return closed


@takes_published()
@in_si(crank_angle="rad", shift="m")
def follow(parameters: SliderCrankParameters, crank_angle: Amount, shift: Amount) -> Closure:
    """Close the loop by continuation: start the first point from the planar slider-crank, every other from the point before.

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
    th, s1 = broadcast_points(crank_angle, shift)
    points: list[Closure] = []
    for angle, position in zip(th, s1):
        points.append(close(parameters, angle, position, points[-1] if points else None))
    joined: dict[str, Any] = {name: np.concatenate([getattr(x, name) for x in points]) for name in _POINTWISE}
    return Closure(parameters=parameters, iterations=max(x.iterations for x in points), **joined)


def residuals(product: Dual) -> tuple[FloatArray, FloatArray]:
    """Return the closure errors of loops (..., 3, 3): angle (rad) and length (unit of the loop), shape (...).

    The whole matrix is used. Its antisymmetric part, which the iteration makes zero, is not enough: this part is also zero if
    the loop is open by half a turn.
    """
    # |R - I| is 2 sqrt2 |sin of half the angle|
    chord = np.linalg.norm(product.real - np.eye(3), axis=(-2, -1)) / np.sqrt(8.0)
    return 2.0 * np.arcsin(np.minimum(chord, 1.0)), np.linalg.norm(origin(product), axis=-1)


def broadcast_points(crank_angle: Any, shift: Any) -> tuple[FloatArray, FloatArray]:
    """Return crank angles and shifts broadcast to one shape (n,)."""
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
    """Return M1, the crank's frame moved to the crank pin."""
    return cast(Dual, about_k(Dual(th, s1)) @ about_i(Dual(0.0, p.crank_length)))


def _correction(product: Dual, rod: Dual, guide: Dual, length: float) -> FloatArray:
    """Return Newton's step (n, 6): rotations about the rod's j, k and the guide's i, j, k, and change of S4 / ``length``.

    A joint's motion q along its screw s changes the loop E by [s]E q. The vector of the antisymmetric part of this change is
    (tr(E) I - E) s q / 2, which is the exact derivative for closed and for open loops.
    """
    trace = Dual(np.trace(product.real, axis1=-2, axis2=-1), np.trace(product.dual, axis1=-2, axis2=-1))
    slide = Dual(np.zeros_like(guide.real[..., 2]), guide.real[..., 2] * length)
    screws = stack([rod[..., 1], rod[..., 2], guide[..., 0], guide[..., 1], guide[..., 2], slide])
    columns = 0.5 * (trace[..., None, None] * np.eye(3) - product) @ screws
    matrix = np.concatenate([columns.real, columns.dual / length], -2)
    error = axial(product)
    right = -np.concatenate([error.real, error.dual / length], -1)
    return cast(FloatArray, np.linalg.solve(matrix, right[..., None])[..., 0])


def _rotation(vector: Array) -> Array:
    """Return rotation matrices (n, 3, 3) of vectors (n, 3), which are the axis times twice tan(angle / 2) (Cayley)."""
    half = 0.5 * vector
    m = skew(half).real
    return np.eye(3) + 2.0 * (m + m @ m) / (1.0 + np.sum(half * half, -1))[:, None, None]


def _check(found: Closure) -> None:
    """Check that the loops are closed and in the chosen assembly; raise ClosureError if one is not."""
    p, rotation, distance = found.parameters, found.rotation_residual, found.length_residual
    error = np.maximum(rotation, distance / scale(p, found.shift))

    def place(i: int) -> str:
        return f"theta1 = {found.crank_angle[i]:.6g} rad, S1 = {found.shift[i]:.6g} m"

    worst = int(np.argmax(error))
    if not error[worst] <= TOLERANCE:
        raise ClosureError(
            f"loop closure residual {rotation[worst]:.1e} rad and {distance[worst]:.1e} m after {found.iterations} "
            f"iterations at {place(worst)}, though the rod reaches the guide: start nearer to the solution"
        )
    # the slider pin is beyond the crank pin's foot on the guide, in the direction -k4
    side = -p.assembly_branch * found.slider_ball[:, 0, 2]
    worst = int(np.argmin(side))
    if side[worst] < 0.0:
        raise ClosureError(
            f"the loop closes in assembly {-p.assembly_branch:+d} at {place(worst)}, not in {p.assembly_branch:+d} as asked: "
            "start nearer to it"
        )


def shortage(p: SliderCrankParameters, crank_angle: Any, shift: Any) -> FloatArray:
    """Return the distance of the crank pin from the guide minus the rod length (m); if positive, the loop cannot close."""
    guide = about_i(-Dual(p.guide_twist, p.guide_offset))
    pin = origin(_pin_frame(p, np.asarray(crank_angle), np.asarray(shift)))
    across = (pin - origin(guide)) @ guide.real[:, :2]
    return cast(FloatArray, np.linalg.norm(across, axis=-1) - p.rod_length)


# The thesis's closure with two rotations in each ball joint (erratum 1)
#
# The thesis gives the ball joints the matrices
#
#     L2 = Z(theta2) Y(eta2) X(eps a2)        crank -> rod
#     L3 = Z(theta3) Y(eta3) X(90 deg)        rod -> guide
#
# instead of general rotations: they are Hooke's joints. In the planar mechanism (S1 = 0, alpha4 = 270 deg) the loop closes with
# eta2 = eta3 = 0. Otherwise there are seven joint rates and six equations: the chain has one freedom, theta1 and S1 cannot
# both be given, and the least-squares Newton iteration for (theta2, eta2, theta3, eta3, S4) settles on an open loop. The
# thesis regards small steps as convergence, but they say nothing about closure. Its published limits of "convergence" are the
# angles at which the steps do not become small, although the mechanism can be assembled there. The sum of squares that is
# minimised adds angles and lengths, so that the result depends on the unit of length.
#
# The thesis solves six of the eighteen equations, the entries 12, 13 and 23 (eqs 20 to 26), and adds to the three real ones
# the deviation of the diagonal. Its steps become small where A'V = 0, which need not be a minimum of the loop's error.

#: The equations that a step solves: all eighteen; the six of eqs 20 and 21; or, as in the thesis, these six with eq 22.
Rows = Literal["all", "upper", "printed"]
#: Rows and columns of the entries 12, 13 and 23.
_UPPER = np.array([[0, 0, 1], [1, 2, 2]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Settled:
    """Result of the thesis's iteration for each of n crank angles.

    ``unknowns`` (n, 5) are theta2, eta2, theta3, eta3 (rad) and S4 (m). ``steps`` is the number of corrections; ``settled``
    says whether the last correction was below the tolerance, which the thesis regards as convergence. ``rotation_residual``
    (rad) and ``length_residual`` (m) are the closure errors of the result; ``position_error`` (m) is the
    magnitude of S4 minus the slider position of the loop with true ball joints.
    """

    crank_angle: FloatArray
    shift: FloatArray
    unknowns: FloatArray
    steps: NDArray[np.int_]
    settled: NDArray[np.bool_]
    rotation_residual: FloatArray
    length_residual: FloatArray
    position_error: FloatArray


def chain(p: SliderCrankParameters, th: Array, s1: Array, q: Array) -> tuple[Dual, Dual]:
    """Return the product M1 L2 L3 M4 (n, 3, 3) for unknowns q (n, 5), and the joint screws of the unknowns in frame 1.

    The screws have shape (n, 3, 5).
    """
    zero = np.zeros_like(th)
    pin = about_k(Dual(th, s1)) @ about_i(Dual(zero, p.crank_length))
    turned = pin @ about_k(q[:, 0])
    front = turned @ about_j(q[:, 1]) @ about_i(Dual(zero, p.rod_length))
    turned_front = front @ about_k(q[:, 2])
    guide = turned_front @ about_j(q[:, 3]) @ about_i(0.5 * np.pi)
    product = guide @ about_k(Dual(zero, q[:, 4])) @ about_i(Dual(p.guide_twist, p.guide_offset))
    # the rate of eta is about the axis j that theta has turned (erratum 2)
    slide = Dual(np.zeros_like(guide.real[..., 2]), guide.real[..., 2])
    return product, stack([pin[..., 2], turned[..., 1], front[..., 2], turned_front[..., 1], slide])


def planar(p: SliderCrankParameters, th: Array) -> FloatArray:
    """Return the planar estimate of section 2.6.2 for the unknowns (n, 5), exact for S1 = 0 and alpha4 = 270 deg."""
    across = p.crank_length * np.cos(th) + p.guide_offset
    beyond = p.assembly_branch * np.sqrt(p.rod_length**2 - across**2)
    rod = np.arctan2(beyond, -across)
    zero = np.zeros_like(th)
    return np.stack([rod - th, zero, -rod, zero, p.crank_length * np.sin(th) + beyond], -1)


@takes_published()
@in_si(crank_angle="rad", shift="m")
def settle(
    parameters: SliderCrankParameters,
    crank_angle: Amount,
    shift: Amount,
    *,
    rows: Rows = "all",
    start: Array | None = None,
    unit: float = INCH,
    step_tolerance: float = 1e-6,
    max_steps: int = 100,
) -> Settled:
    """Run the thesis's iteration to close the loop: least-squares Newton steps from an estimate until a step is small.

    Parameters
    ----------
    parameters : SliderCrankParameters
        The mechanism.
    crank_angle, shift : array_like
        theta1 (rad) and S1 (m), numbers or arrays of shape (n,).
    rows : str
        Equations that are solved in a step. ``all``: the eighteen of all matrix entries. ``upper``: the six of the upper
        triangle, eqs 20 and 21. ``printed``: as in the thesis, these six with eq 22 instead of eq 20.
    start : array_like, optional
        Estimates of the unknowns (n, 5), such as the solution at the previous angle; by default `planar`.
    unit : float
        Unit of length (m) in which lengths are compared with angles; the thesis uses the inch.
    step_tolerance : float
        A step counts as small if neither an angle (rad) nor the slider position (in ``unit``) changes by more than this.
    max_steps : int
        Largest number of steps.

    Raises
    ------
    InputError, AssemblyError, ClosureError
        As `closure.close`, which computes the true slider position.
    """
    th, s1 = broadcast_points(crank_angle, shift)
    truth = close(parameters, th, s1)
    q = planar(parameters, th) if start is None else np.array(start, dtype=float)
    steps = np.zeros(th.size, dtype=int)
    moving = np.ones(th.size, dtype=bool)
    while np.any(moving) and steps.max() < max_steps:
        product, screws = chain(parameters, th[moving], s1[moving], q[moving])
        columns, right = equations(product, screws, unit, rows)
        step = (np.linalg.pinv(columns) @ right[..., None])[..., 0]
        q[moving] += step * [1.0, 1.0, 1.0, 1.0, unit]
        steps[moving] += 1
        moving[moving] = np.max(np.abs(step), -1) > step_tolerance
    rotation, distance = residuals(chain(parameters, th, s1, q)[0])
    return Settled(
        crank_angle=th,
        shift=s1,
        unknowns=q,
        steps=steps,
        settled=~moving,
        rotation_residual=rotation,
        length_residual=distance,
        position_error=np.abs(q[:, 4] - truth.slider_position),
    )


def equations(product: Dual, screws: Dual, unit: float, rows: Rows) -> tuple[FloatArray, FloatArray]:
    """Return matrix (n, m, 5) and right side (n, m) of the m equations of a Newton step, with slide and lengths in ``unit``.

    A joint's motion q along its screw s changes the loop B by [s]B q, which is set equal to I - B. The thesis writes this as
    [s] q = B' - I (eq 11), with its matrix A and its right side V (eqs 23 to 25).
    """
    changes = [skew(screws[..., i]) for i in range(5)]
    if rows == "all":
        real, dual = np.eye(3) - product.real, -product.dual
        changes, places = [change @ product for change in changes], np.indices((3, 3)).reshape(2, 9)
    else:
        real, dual = (np.swapaxes(part, -1, -2) for part in (product.real - np.eye(3), product.dual))
        places = _UPPER
        if rows == "printed":
            diagonal = np.diagonal(real, axis1=-2, axis2=-1)
            real = real + diagonal[..., :, None] + diagonal[..., None, :]
    row, column = places
    columns = np.stack(
        [np.concatenate([x.real[..., row, column], x.dual[..., row, column] / unit], -1) for x in changes], -1
    )
    columns[..., 4] *= unit
    return columns, np.concatenate([real[..., row, column], dual[..., row, column] / unit], -1)
