"""The thesis's loop closure with two rotations in each ball joint, kept to show where and why it fails (erratum 1).

The thesis gives the ball joints the matrices

    L2 = Z(theta2) Y(eta2) X(eps a2)        crank -> rod
    L3 = Z(theta3) Y(eta3) X(90 deg)        rod -> guide

in place of general rotations: Hooke's joints. In the planar mechanism (S1 = 0, alpha4 = 270 deg) the loop closes with
eta2 = eta3 = 0. Elsewhere seven joint rates stand against six equations: the chain has one freedom, theta1 and S1 cannot both
be given, and the least-squares Newton iteration for (theta2, eta2, theta3, eta3, S4) settles on a loop that is not closed.
That its steps become small, on which the thesis accepts a solution, says nothing about closure; where they do not become
small, the published limits of "convergence" come from, while the mechanism itself can be assembled. And since what is least
is a sum of squares of angles and lengths, the result depends on the unit of length.

The thesis itself solves six of the eighteen equations, those of entries 12, 13 and 23 (eqs 20 to 26), and adds to the three
real ones what the diagonal lacks. Its steps become small where A'V = 0, which is no minimum of what is left of the loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from linkwork.slider_crank.parameters import SliderCrankParameters

from ..numerics.dual import Array, Dual, about_i, about_j, about_k, skew, stack
from ..run import takes_published
from ..units import INCH, Amount, in_si
from .closure import close, points_of, residuals
from .quantities import FloatArray

#: Which equations a step solves: all eighteen; the six of eqs 20 and 21; these with what eq 22 adds, as the thesis does.
Rows = Literal["all", "upper", "printed"]
#: Rows and columns of the entries 12, 13 and 23.
_UPPER = np.array([[0, 0, 1], [1, 2, 2]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Settled:
    """Where the iteration ends, for each of n crank angles.

    ``unknowns`` (n, 5) are theta2, eta2, theta3, eta3 (rad) and S4 (m); ``steps`` how many corrections were made and
    ``settled`` whether the last was below the tolerance, which the thesis takes for convergence. ``rotation_residual`` (rad)
    and ``length_residual`` (m) say by how much the loop is open then, ``position_error`` (m) by how much S4 differs from that
    of the loop with true ball joints.
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
    """The product M1 L2 L3 M4 (n, 3, 3) for the unknowns q (n, 5), and the screws of their rates in frame 1 (n, 3, 5)."""
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
    """The planar estimate of section 2.6.2 for the unknowns (n, 5), as for S1 = 0 and alpha4 = 270 deg."""
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
    """Run the thesis's iteration: least-squares Newton steps from an estimate until a step is small.

    Parameters
    ----------
    parameters : SliderCrankParameters
        The mechanism.
    crank_angle, shift : array_like
        theta1 (rad) and S1 (m), numbers or arrays of shape (n,).
    rows : str
        Which equations are solved: ``all`` eighteen, or of the upper triangle the six of eqs 20 and 21 (``upper``) or those
        with eq 22 in the place of eq 20 (``printed``).
    start : array_like, optional
        Estimates of the unknowns (n, 5), such as those at the angle before; by default those of the planar mechanism.
    unit : float
        Unit of length (m) in which lengths are weighed against angles; the thesis's is the inch.
    step_tolerance : float
        A step is small when no angle (rad) and not the slider (``unit``) changes by more.
    max_steps : int
        How many steps are made at most.

    Raises
    ------
    InputError, AssemblyError, ClosureError
        As `closure.close`, by which the truth is found.
    """
    th, s1 = points_of(crank_angle, shift)
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


def freedoms(parameters: SliderCrankParameters, crank_angle: float, shift: float, unknowns: Array) -> int:
    """Freedoms of the chain at a configuration: seven joint rates less the rank of their screws.

    The screws are those of theta1, S1 and the five unknowns; lengths are counted in rod lengths.
    """
    _, screws = chain(parameters, np.array([crank_angle]), np.array([shift]), np.asarray(unknowns)[None])
    crank = np.zeros((6, 2))
    crank[2, 0] = crank[5, 1] = 1.0
    loop = np.concatenate([screws.real[0], screws.dual[0] / parameters.rod_length])
    columns = np.concatenate([crank, loop], -1)
    return 7 - int(np.linalg.matrix_rank(columns / np.linalg.norm(columns, axis=0), tol=1e-9))


def equations(product: Dual, screws: Dual, unit: float, rows: Rows) -> tuple[FloatArray, FloatArray]:
    """The m equations of a step: their matrix (n, m, 5) and right side (n, m), the slide and all lengths in ``unit``.

    A joint's motion q along its screw s changes the loop B by [s]B q. All entries of this are to be those of I - B; the thesis
    writes [s] q = B' - I (eq 11), its matrix A and its right side V (eqs 23 to 25).
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
