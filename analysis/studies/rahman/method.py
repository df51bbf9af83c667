"""Rahman's method judged: loop closure and its iteration, rates, force equations in the plane, conclusions.

`printed` has the equations to the letter. They are compared with other formulations: dual matrices, difference quotients,
the model by Newton and Euler. The errata are numbered as in docs/rahman.md.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from linkwork.slider_crank.published import CRANK_SPEED, parameters

from ...figures import Curve, Figure, Panel, plot_curves
from ...numerics.dual import Dual, about_i, about_j, about_k, apply, axial
from ...slider_crank import Settled, assembly_margin, close, constant_shift, greatest_shift, settle
from ...slider_crank.closure import Rows, chain, equations, freedoms, planar, residuals
from ...slider_crank.dual_dynamics import Binor
from ...units import INCH
from ..rules import ABNORMAL, ABOUT_DEG, VERY_CLOSE_DEG
from ..statements import Case as Judged
from ..statements import Statement, at_least, at_most, near, text
from ..study import Study, StudyResult, padded
from ..variation import cache, unvaried
from .figures import (
    ALL,
    ANGLE,
    ANGLES_DEG,
    CRANK,
    FROM_DEAD,
    NOTHING,
    OFFSETS,
    ROUNDING,
    TORQUE,
    clear,
    dead_centres_deg,
    full_name,
    nothing,
    printed,
    printed_symbol,
    values,
)
from .printed import (
    CRANK_AT_SPEED,
    GENERAL,
    GRID_DEG,
    MAX_STEPS,
    ROD_X_SQUARE,
    SLIDER_SQUARE,
    STEP,
    STEP_DEG,
    Crank,
    Joints,
    Turn,
    bodies,
    crank_momentum,
    dependable,
    forward_momentum_rates,
    forward_rod_momentum,
    forward_rod_velocity,
    forward_slider_momentum,
    forward_slider_velocity,
    inertia_force,
    inertia_forces,
    joint_accelerations,
    joint_forces,
    joint_rates,
    later,
    loop_rates,
    mended_row,
    momenta,
    momentum_rates,
    on_crank,
    turn,
    velocities,
)
from .table import COMPONENTS, IDEAL, TWISTS_REACHED_DEG, Case

FloatArray = NDArray[np.float64]

#: Length of the rod (in).
ROD = CRANK_AT_SPEED.a2
#: The planar mechanism, and the cases out of the plane.
_PLANE = Case("in the plane, a4 = 10 in", 10.0, 0.0, 270.0)
OUT = tuple(case for case in ALL if case.shift_in or case.twist_deg != IDEAL.twist_deg)
#: Cases whose loops are followed.
OPEN = (
    Case("a4 = 10 in at S1 = 3.5 in", 10.0, 3.5, 270.0),
    Case("alpha4 = 232 deg", 20.0, 0.0, 232.0),
    Case("alpha4 = 310 deg", 20.0, 0.0, 310.0),
)
#: Cases for row 37f, which is judged where |sin theta2| is above `CLEAR_SINE`, since eq 41 divides by it.
ROW_F = (Case("a4 = 30 in at S1 = 9 in", 30.0, 9.0, 270.0), OPEN[2])
CLEAR_SINE = float(np.sin(np.radians(ABOUT_DEG)))
AWAY = f"where theta2 is over {ABOUT_DEG:g} deg from 0 and half a turn, the rule for *near*, since eq 41 divides by its sine"
#: What a second rate is compared with: the crank's acceleration (rad/s2) and that of the shift (in/s2), its rate (in/s).
MOVING = CRANK_AT_SPEED._replace(shift_rate=1.3, acceleration=3.0, shift_acceleration=0.7)
AT_RATES = "with S1' = 1.3 in/s, theta1'' = 3 rad/s2 and S1'' = 0.7 in/s2"
DOTS = "second dots lost in the scan are restored"
#: Distance g3 (in) at which the terms of the slider's moment of mass count; the thesis computes with 0.
G3 = 2.0
#: What is said of a slip of one character.
MAYBE = "so in our scan; the print may be right"
#: Step of difference quotients, and their largest relative error.
H, ROUGH = 1e-6, 1e-7
#: Weight of water (lb/in3), the reference of specific gravities.
WATER = 62.43 / 12.0**3


@cache
def followed(case: Case, rows: Rows = "printed", from_before: bool = True) -> Turn:
    """Run the iteration over a turn in a case."""
    return turn(parameters(case.offset_in, case.twist_deg), case.shift_in, rows, from_before=from_before)


def joints(unknowns: FloatArray) -> Joints:
    """Return the unknowns (..., 5) of the loop by name."""
    return Joints(*np.moveaxis(unknowns, -1, 0))


# ---------------------------------------------------------------- the loop


def _operators() -> float:
    """Return the greatest difference of eqs 2a to 4a, times the matrices, from difference quotients of the matrices."""
    th, eta = float(GENERAL.th2), float(GENERAL.eta2)
    about = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    tilting = np.array([[0.0, 0.0, np.cos(th)], [0.0, 0.0, np.sin(th)], [-np.cos(th), -np.sin(th), 0.0]])

    def ball(beyond: Dual, change: FloatArray) -> Dual:
        return cast(Dual, about_k(th + change[0]) @ about_j(eta + change[1]) @ about_i(beyond))

    def guide(change: float) -> Dual:
        return cast(Dual, about_k(Dual(0.0, 1.3 + change)) @ about_i(Dual(4.0, 20.0)))

    left = [Dual(0.0 * about, about) @ guide(0.0) - (guide(H) - guide(-H)) / (2.0 * H)]
    for beyond in (Dual(0.0, ROD), Dual(0.5 * np.pi, 0.0)):
        for operator, change in zip((about, tilting), H * np.eye(2)):
            quotient = (ball(beyond, change) - ball(beyond, -change)) / (2.0 * H)
            left.append(Dual(operator) @ ball(beyond, 0.0 * change) - quotient)
    return max(float(np.abs([lack.real, lack.dual / ROD]).max()) for lack in left)


def _joint_freedoms() -> tuple[int, ...]:
    """Return the freedoms that eqs 1 to 4 give joints 1 to 4: the ranks of their matrices' slopes in a general position."""

    def ball(th: float, eta: float) -> Dual:
        return cast(Dual, about_k(th) @ about_j(eta))

    ranks = []
    for joint, at in (
        (lambda th, s: about_k(Dual(th, s)), (0.9, 3.5)),
        (ball, (2.1, 0.35)),
        (ball, (-1.3, 0.2)),
        (lambda s: about_k(Dual(0.0, s)), (40.0,)),
    ):
        ways = H * np.eye(len(at))
        slopes = [(joint(*(at + way)) - joint(*(at - way))) / (2.0 * H) for way in ways]
        ranks.append(int(np.linalg.matrix_rank([np.append(x.real, x.dual) for x in slopes], tol=1e-6)))
    return tuple(ranks)


def _limits() -> tuple[Statement, ...]:
    """Judge the stated limits of the iteration, and what is inferred from them for the mechanism."""
    place = text("section 3.2, L1121")
    reached = {}
    for a4, first, stated in ((10.0, 3.5, 3.5), (20.0, 3.5, 3.5), (30.0, 0.0, 9.0)):
        tried = np.arange(first, stated + 4.5, 0.5)
        settled = turn(parameters(a4), tried).settled
        reached[a4] = first + 0.5 * (int(np.cumprod(settled).sum()) - 1)
    below = float(settled[tried <= 9.0].mean())
    between = np.linspace(*TWISTS_REACHED_DEG, 4)
    within = float(np.mean([turn(parameters(20.0, twist), 0.0).settled.all() for twist in between]))
    twists = []
    for which, limit, way in zip(("least", "greatest"), TWISTS_REACHED_DEG, (-1.0, 1.0)):
        found = limit
        while turn(parameters(20.0, found + way), 0.0).settled.all():
            found += way
        twists.append(near(f"{which} alpha4", f"{limit:g}", found, 1.0, "deg"))
    shifts = {a4: (greatest_shift(parameters(a4)) or 0.0) / INCH for a4 in (0.0, 10.0, 20.0, 30.0)}
    beyond = [
        at_most(
            f"a4 = {a4:g} in, S1 = {shift + 1.0:.4g} in",
            0.0,
            assembly_margin(parameters(a4), constant_shift((shift + 1.0) * INCH)).length / INCH,
            "in",
        )
        for a4, shift in shifts.items()
    ]
    own = "the thesis gives neither the accuracy nor the number of corrections that it allows, on which the last step depends"
    return (
        Statement(
            "For the particular link lengths as mentioned before, when offset [a4] is zero, the program fails to "
            "converge if the term [S1] is greater than 1.5 inches.",
            place,
            why="where the iteration ends there depends on rounding: 1e-9 in more or less of S1 decide it",
        ),
        Statement(
            "When offset is increased to 10 inches or greater, the program fails to converge if the term [S1] is "
            "greater than 3.5 inches and when offset [a4] is 30 inches, the program converges as long as the term "
            "[S1] is less than or equal to 9 inches.",
            place,
            "greatest S1, by halves of an inch, up to which the printed iteration settles at every angle; share of S1 = 0 to 9 "
            "in by 0.5 in at which it settles, a4 = 30 in",
            f"0.5 in, the step of the limits; none of the share; {own}",
            (
                near("a4 = 10 in", "3.5", reached[10.0], 0.5, "in"),
                near("a4 = 20 in, which is greater than 10 in", "3.5", reached[20.0], 0.5, "in"),
                near("a4 = 30 in", "9", reached[30.0], 0.5, "in"),
                at_least("a4 = 30 in, S1 = 0 to 9 in", 1.0, below),
            ),
            "the limit grows from 10 in on, as the sentence's second half has it",
        ),
        Statement(
            "From this observation [of the limits of S1] it can be inferred that in order for the mechanism to work, with "
            "the increase of crank axial shift, offset [a4] should be increased.",
            place,
            "change of the greatest S1 at which the crank turns fully",
            "none, the sign decides",
            tuple(
                at_least(f"a4 = {before:g} to {after:g} in", 0.0, shifts[after] - shifts[before], "in")
                for before, after in pairwise(shifts)
            ),
            "the mechanism works up to S1 = sqrt(a2^2 - (a1 + a4)^2), which falls from 48.5 to 27.1 in; the limits "
            "are those of the iteration alone",
        ),
        Statement(
            "In the case of mechanism failure, it will either lose closure, i.e. one link or more will get detached "
            "from another at the joint or the slider will go to the opposite side.",
            place,
            "least margin of the rod's reach over a turn, 1 in beyond the greatest S1: negative where the loop "
            "cannot close",
            "none, the sign decides",
            tuple(beyond),
            "closure is lost",
        ),
        Statement(
            "When offset [a4] is 20 inches and crank axial displacement [S1] is zero, the program converges as long "
            "as offset [alpha4] is between 232 and 310 degrees.",
            place,
            "limits of alpha4, by degrees, at which the printed iteration settles at every angle; share of alpha4 = 232 to 310 "
            "deg by 26 deg at which it settles",
            f"1 deg, the step of the limits; none of the share; {own}",
            (*twists, at_least("232 to 310 deg", 1.0, within)),
            "the mechanism itself turns fully at every alpha4",
        ),
    )


def _detected() -> tuple[float, float]:
    """Return the shares of shifts at a4 = 0, 10, 20, 30 in, 0 to 50 in by 2 in, at which the iteration misses or errs.

    It runs at every 30 deg from the planar estimate. It misses a mechanism that turns fully where it does not settle at one of
    them, and errs where it settles at all on a loop that is open at one.
    """
    missed: list[bool] = []
    wrong: list[bool] = []
    for a4 in (0.0, 10.0, 20.0, 30.0):
        p = parameters(a4)
        shifts = np.arange(0.0, greatest_shift(p) or 0.0, 2.0 * INCH)
        angles, each = (x.ravel() for x in np.meshgrid(np.radians(GRID_DEG[::6]), shifts))
        found = settle(p, angles, each, rows="printed", max_steps=MAX_STEPS)
        settled = found.settled.reshape(shifts.size, -1).all(-1)
        is_open = found.rotation_residual.reshape(shifts.size, -1).max(-1) > NOTHING
        missed += np.logical_not(settled).tolist()
        wrong += np.logical_and(settled, is_open).tolist()
    return float(np.mean(missed)), float(np.mean(wrong))


def _ended(off: float, cases: tuple[Case, ...], step: int = 1) -> list[Settled]:
    """Run the iteration from planar estimates of theta2 and theta3 that are off by an angle (deg), one way and the other."""
    grid, away = np.radians(GRID_DEG[::step]), np.radians([off, 0.0, -off, 0.0, 0.0])
    ended = []
    for case in cases:
        p = parameters(case.offset_in, case.twist_deg)
        start = planar(p, grid) + away
        ended.append(settle(p, grid, case.shift_in * INCH, rows="printed", start=start, max_steps=MAX_STEPS))
    return ended


def _far_off(cases: tuple[Case, ...]) -> tuple[float, float]:
    """Return the shares of crank angles, by 30 deg, at which the iteration settles from far off, and on the closed loop."""
    ended = [found for off in (-120.0, -60.0, 60.0, 120.0, 180.0) for found in _ended(off, cases, 6)]
    closed = [(found.rotation_residual < NOTHING) & (found.position_error < NOTHING) for found in ended]
    return float(np.mean([found.settled for found in ended])), float(np.mean(closed))


def _estimate_error(case: Case) -> float:
    """Return the greatest difference (deg) of the planar estimate at theta1 = 0 from the angles of the closed loop.

    The closed loop has a third rotation in each ball joint, about i beyond theta and eta.
    """
    p, zero = parameters(case.offset_in, case.twist_deg), np.zeros(1)
    closed = close(p, zero, case.shift_in * INCH)
    (rod,), (slider,) = closed.crank_ball, closed.slider_ball
    th2, eta2 = np.arctan2(rod[1, 0], rod[0, 0]), -np.arcsin(rod[2, 0])
    turned = (about_k(th2) @ about_j(eta2)).real.T @ rod @ slider
    found = [th2, eta2, np.arctan2(turned[1, 0], turned[0, 0]), -np.arcsin(turned[2, 0])]
    apart = np.degrees(found - planar(p, zero)[0, :4])
    return float(np.abs((apart + 180.0) % 360.0 - 180.0).max())


def _estimates() -> float:
    """Return by how much the loop is open at the estimates of section 2.6.2, greatest of four offsets."""
    zero, worst = np.zeros(1), 0.0
    for a4 in (0.0, 10.0, 20.0, 30.0):
        s4 = np.sqrt(ROD**2 - (CRANK + a4) ** 2)
        th2 = np.pi - np.arctan(s4 / (CRANK + a4))
        estimate = np.array([[th2, 0.0, 2.0 * np.pi - th2, 0.0, s4 * INCH]])
        worst = max(worst, *(float(left[0]) for left in residuals(chain(parameters(a4), zero, zero, estimate)[0])))
    return worst


def _system(case: Case, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return A and V of eq 23 at the angles of the grid."""
    angle, shift = np.radians(GRID_DEG), np.full(GRID_DEG.size, case.shift_in * INCH)
    unknowns = unknowns * [1.0, 1.0, 1.0, 1.0, INCH]
    return equations(*chain(parameters(case.offset_in, case.twist_deg), angle, shift, unknowns), INCH, "printed")


def _condition(case: Case) -> float:
    """Return A's least singular value relative to its greatest where the iteration ends."""
    singular = np.linalg.svd(_system(case, followed(case).unknowns[:, 0])[0], compute_uv=False)
    return float(np.min(singular[:, -1] / singular[:, 0]))


def _unmet(case: Case) -> float:
    """Return the greatest entry of A Delta - V at the first correction from the angle before."""
    matrix, right = _system(case, np.roll(followed(case).unknowns[:, 0], 1, axis=0))
    delta = np.linalg.pinv(matrix) @ right[..., None]
    return float(np.abs(matrix @ delta - right[..., None]).max())


def _at_right_angles() -> float:
    """Return A's least singular value relative to its greatest with the rod at right angles to the guide, a4 = a2 - a1."""
    p, zero = parameters(ROD - CRANK), np.zeros(1)
    matrix, _ = equations(*chain(p, zero, zero, planar(p, zero)), INCH, "printed")
    singular = np.linalg.svd(matrix[0], compute_uv=False)
    return float(singular[-1] / singular[0])


def closure() -> StudyResult:
    """Compute the iteration and the closure error at which it ends."""
    columns = {ANGLE: GRID_DEG}
    (first, *_), sparse = OPEN, GRID_DEG[::2]
    p, unknowns = parameters(first.offset_in), followed(first).unknowns[4, 0] * [1.0, 1.0, 1.0, 1.0, INCH]
    left = freedoms(p, float(np.radians(GRID_DEG[4])), first.shift_in * INCH, unknowns)
    determined, combined = [], []
    for case in (_PLANE, *OPEN):
        found = followed(case)
        mechanism = parameters(case.offset_in, case.twist_deg)
        rotation, error, _ = dependable(mechanism, case.shift_in)
        determined += [
            nothing(f"loop open, {case.name}", np.max(found.rotation_deg), "deg"),
            nothing(f"error of S4, {case.name}", np.max(found.error_in), "in"),
        ]
        combined.append(f"{np.max(rotation):.2g} deg and {np.max(error):.2g} in ({case.name})")
        if case != _PLANE:
            columns[f"rotation left as printed; {case.name} [deg]"] = found.rotation_deg[:, 0]
            columns[f"error of S4 as printed; {case.name} [in]"] = found.error_in[:, 0]
            columns[f"rotation left with Davidon Fletcher Powell; {case.name} [deg]"] = np.interp(
                GRID_DEG, sparse, rotation
            )
            columns[f"error of S4 with Davidon Fletcher Powell; {case.name} [in]"] = np.interp(GRID_DEG, sparse, error)
    singular, unmet = np.transpose([(_condition(case), _unmet(case)) for case in (_PLANE, *OPEN)])
    missed, wrong = _detected()
    planes = tuple(Case("", a4, 0.0, 270.0) for a4 in (0.0, 10.0, 20.0, 30.0))
    close_by = np.concatenate([found.steps for found in _ended(20.0, planes)])
    outside = np.concatenate([followed(case).steps[:, 0] for case in OPEN])
    (settled, on_it), (settled_out, _) = _far_off(planes), _far_off(OPEN)
    within = "; ".join(case.name for case in OPEN)
    conclusions = text("section 3.3, L1131")
    statements = (
        Statement(
            "The approach is developed in such a manner that a digital computer can detect when a solution is "
            "possible and then solve the whole problem.",
            text("abstract, L45"),
            "shares of the shifts at which the crank turns fully, 0 to 48 in by 2 in at a4 = 0, 10, 20, 30 in; the iteration "
            "as printed, by Newton and Raphson, from the planar estimate at every 30 deg",
            f"none of a share; {NOTHING:g} rad, the rounding, of an open loop",
            (
                at_most("a solution is possible, and the iteration does not settle", 0.0, missed),
                at_most("the iteration settles on a loop that is open", 0.0, wrong),
            ),
            "the iteration settles where its steps become small, which says nothing of the loop (erratum 1)",
        ),
        Statement(
            "Fig. 3 is the generalized slider crank in which joint 1 is cylindrical with one translational and one "
            "rotational degrees of freedom, joints 2 and 3 are ball joints, each of which has three rotational "
            "degrees of freedom, and joint 4 is prismatic, exactly the same as in the planar case.",
            text("section 2.3, L213; eqs 1 to 5"),
            "freedoms that the matrices of eqs 1 to 4 give each joint: the rank of their slopes in a general position",
            "none of a count",
            tuple(
                replace(near(f"joint {n}", float(count), found, 0.0), stated=words)
                for n, (words, count, found) in enumerate(
                    zip(("one and one", "three", "three", "one"), (2, 3, 3, 1), _joint_freedoms()), start=1
                )
            ),
            "erratum 1: eqs 2 and 3 give each ball joint two rotations. So the chain of joints has "
            f"{left} freedom, and theta1 and S1 cannot both be given; with three it would have 2 + 3 + 3 + 1 - 6 = 3, of which "
            "one is the spin of the rod",
        ),
        Statement(
            "hence partial differential operator [Q_L eta_2] can be written as,",
            text("section 2.5, eqs 2a to 4a, L320-352"),
            "difference of the operators times the matrices from difference quotients of the matrices",
            f"{ROUGH:g}, the error of the quotients",
            (at_most("eqs 2a, 2b, 3a, 3b, 4a", ROUGH, _operators()),),
        ),
        Statement(
            "The numerical method being used to determine the displacements is based on the algorithm (12) introduced "
            "by Hall, Root & Sandgren (1977). This algorithm is the combination of Davidon-Fletcher-Powell optimization "
            "routine with the Newton-Raphson method as applied to kinematics by Uicker, Denavit and Hartenberg (1964).",
            text("section 2.6.1, L366; abstract, L45"),
            why="the thesis prints the Newton-Raphson half alone (eqs 7 to 26), and its program is missing. As we read the "
            "reference, a step by eq 23a is taken where it halves the sum of squares of eq 25, and a step of Davidon, Fletcher "
            "and Powell down that sum where it does not. This leaves of the rotation round the loop and of S4, greatest of the "
            f"turn: {', '.join(combined)}. Out of the plane the loop of eqs 2 and 3 cannot close (erratum 1)",
        ),
        Statement(
            "Hence the modified form of equation (23) is as follows: [Delta = (A'A)^-1 A'V] which is exactly same as [Delta = "
            "A^-1 V].",
            text("section 2.6.1, eq 23a, L457-463"),
            "whether Delta so found solves eq 23, A Delta = V, as it would by an inverse of A (L457 gives the name A^-1 to "
            "(A'A)^-1 A'): greatest entry of A Delta - V at the first correction from the angle before, greatest of the turn, "
            "lengths in inches",
            ROUNDING,
            tuple(nothing(case.name, entry) for case, entry in zip((_PLANE, *OPEN), unmet)),
            "six rows for five unknowns: in the plane eq 23 is met only once the loop is closed, out of it never (erratum 1)",
        ),
        Statement(
            "The iterative process is continued until the absolute values of all error terms are less than or equal "
            "to the desired accuracy limits. At this point the displacements are determined only for the first "
            "position of the input link.",
            text("section 2.6.1, L465"),
            "rotation round the loop and error of S4 where the printed iteration ends, greatest of the turn",
            ROUNDING,
            tuple(determined),
            "erratum 1: small steps are no closed loop",
        ),
        Statement(
            "From geometry the following formulas for the joint variables can be written.",
            text("section 2.6.2, L483-491"),
            "rotation (rad) and length (m) by which the planar loop is open at theta1 = 0, a4 = 0, 10, 20, 30 in",
            "1e-12, the rounding",
            (at_most("open", 1e-12, _estimates()),),
        ),
        *_limits(),
        Statement(
            "The main disadvantage of this method is that if we can not make good initial estimates for joint "
            "displacements, ... the method will not converge.",
            conclusions,
            "share of the angles, by 30 deg, at which the iteration settles from planar estimates of theta2 and theta3 that "
            "are off by 60, 120 and 180 deg, our choice: the one by as much as the other, the opposite way",
            "none of a share",
            (
                at_most("in the plane, a4 = 0, 10, 20, 30 in", 0.0, settled),
                at_most(f"out of the plane: {within}", 0.0, settled_out),
            ),
            f"in the plane it settles on the loop sought from {100.0 * on_it:.0f} % of these estimates, and from the others on "
            "another closed loop, with the slider on the other side; out of the plane on open loops",
        ),
        Statement(
            "Usually the process converges in 3 to 6 iterations if estimates are within 20 degrees, which is quite "
            "possible by using the direct formula for the planar case.",
            conclusions,
            "share of the angles at which 3 to 6 corrections are made, which depends on when a correction counts as small; "
            "greatest difference of the planar estimates (section 2.6.2, theta1 = 0) from the angles of the closed loop",
            "more than half, as *usually* says; 20 deg as stated",
            (
                at_least(
                    "in the plane, a4 = 0, 10, 20, 30 in, from estimates 20 deg off",
                    0.5,
                    np.mean((close_by >= 3) & (close_by <= 6)),
                ),
                at_least(
                    f"out of the plane, from the angle before: {within}", 0.5, np.mean((outside >= 3) & (outside <= 6))
                ),
                *(at_most(f"estimates, {full_name(case)}", "20", _estimate_error(case), "deg") for case in OUT),
            ),
            f"out of the plane up to {np.max(outside):.0f} corrections are made, since there is no loop to converge to, and "
            "with a twist the planar eta2 = 0 is off by more",
        ),
        Statement(
            "Another great disadvantage is that matrix A may become singular. Fortunately it never happened while "
            "running the program.",
            conclusions,
            "least singular value of A relative to its greatest, where the iteration ends",
            ROUNDING,
            (
                nothing(
                    "may: rod at right angles to the guide, which it reaches from a4 = 38 in on", _at_right_angles()
                ),
                *(
                    at_least(f"never: over the turn, {case.name}", NOTHING, least)
                    for case, least in zip((_PLANE, *OPEN), singular)
                ),
                at_least(
                    f"never: least of the {len(OUT)} cases of the figures out of the plane",
                    NOTHING,
                    min(map(_condition, OUT)),
                ),
            ),
        ),
    )
    return StudyResult(
        number="rahman-closure",
        claim="Rahman states: the iteration of section 2.6.1 finds theta2, eta2, theta3, eta3 and S4 for given theta1 and S1.",
        assignment=f"The iteration runs round the turn by {STEP_DEG:g} deg, from the planar estimate at theta1 = 0 and then "
        f"from the angle before. It settles where a correction is below {STEP:g} rad and {STEP:g} in, within {MAX_STEPS} "
        "corrections: our choice, since the thesis gives neither the step, the accuracy nor the number.",
        columns=padded(columns),
        statements=statements,
    )


# ---------------------------------------------------------------- the rates


def row_f(case: Case) -> tuple[FloatArray, FloatArray]:
    """Return the residual of row 37f (in/s) on the grid: as printed, NaN where eq 41 is unbounded, and by erratum 2."""
    p, q = parameters(case.offset_in, case.twist_deg), joints(followed(case).unknowns[:, 0])
    lacking = loop_rates(CRANK_AT_SPEED, q, joint_rates(CRANK_AT_SPEED, q))[5]
    shift = np.full(GRID_DEG.size, case.shift_in * INCH)
    mended = mended_row(p, np.radians(GRID_DEG), shift, q, CRANK_SPEED)
    return np.where(np.abs(np.sin(q.th2)) > CLEAR_SINE, lacking, np.nan), mended


def _angular_velocity() -> float:
    """Return the difference (rad/s) of eqs 30 and 31 from the angular velocity of Z(theta) Y(eta), by a difference quotient."""
    th, eta, th_rate, eta_rate = 0.8, 0.3, 1.7, -2.1
    before, now, after = (about_k(th + h * th_rate).real @ about_j(eta + h * eta_rate).real for h in (-H, 0.0, H))
    omega = axial(Dual((after - before) / (2.0 * H) @ now.T)).real
    return float(np.linalg.norm(omega - [0.0, eta_rate, th_rate]))


def _sinusoidal(ratio: float) -> tuple[float, float]:
    """Return the errors of eq 28a (in/s) and of eq 28b (in/s2) as rates of eqs 28 and 28a mended, at an alpha."""
    amplitude, angle, speed, acceleration, h = 2.0, 0.9, CRANK_SPEED, 3.0, 1e-20
    # derivatives along the motion by a complex step, which has no rounding error
    moved, quicker = angle + 1j * h * speed, speed + 1j * h * acceleration
    shift = amplitude * np.sin(ratio * moved)
    rate = ratio * amplitude * np.cos(ratio * moved) * quicker
    printed_rate = ratio * shift.real * np.cos(ratio * angle) * speed
    printed_second = (
        ratio * amplitude * (np.cos(ratio * angle) * acceleration - ratio * np.sin(ratio * angle) * speed**2)
    )
    return float(printed_rate - shift.imag / h), float(printed_second - rate.imag / h)


def _printed_rates() -> tuple[Statement, ...]:
    """Judge eqs 28a to 31 and 37 to 43, 38a to 42a in the general position, with the shift in motion."""
    crank = MOVING
    right = loop_rates(crank, GENERAL, Joints(*np.zeros(5)))
    matrix = np.stack([loop_rates(crank, GENERAL, Joints(*unit)) - right for unit in np.eye(5)], -1)
    ranks = [int(np.linalg.matrix_rank(m)) for m in (matrix, np.column_stack([matrix, right]))]
    solved, rates = Joints(*np.linalg.solve(matrix[:5], -right[:5])), joint_rates(crank, GENERAL)
    seconds = joint_accelerations(crank, GENERAL, rates)
    quicker, moved, _ = later(crank, GENERAL, rates, seconds)
    rough = max(abs(float(a - b.imag / 1e-20)) for a, b in zip(seconds, joint_rates(quicker, moved)))
    (s2, se, s3), (c2, ce, c3) = (f([GENERAL.th2, GENERAL.eta2, GENERAL.th3]) for f in (np.sin, np.cos))
    # eq 38 as printed, in the order theta2', theta3', eta2', eta3', S4'
    coefficients = np.array(
        [
            [-se, 0.0, s2 * ce, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, s3],
            [0.0, 0.0, c2, 1.0, 0.0],
            [ROD * ce, 0.0, ROD * s2 * se, 0.0, -c3],
            [ce, 1.0, s2 * se, 0.0, 0.0],
            [0.0, 0.0, -ROD * c2, 0.0, 0.0],
        ]
    )
    w, v = crank.speed, crank.shift_rate
    column = [
        w * se,
        -w * CRANK * s2 * ce + v * se,
        0.0,
        -w * (CRANK * c2 + ROD * ce),
        -w * ce,
        -w * CRANK * s2 - v * ce,
    ]
    order = [Joints._fields.index(name) for name in ("th2", "th3", "eta2", "eta3", "s4")]
    eq_38 = np.column_stack([coefficients, column]) - np.column_stack([matrix[:, order], -right])
    ratios = (0.5, 1.0, 2.0)
    slips = {ratio: _sinusoidal(ratio) for ratio in ratios}
    names = ("theta2' by eq 39", "eta2' by eq 41", "theta3' by eq 40", "eta3' by eq 42", "S4' by eq 43")
    reasons = ("erratum 4: no cos^2 eta2", "", "", "", "")
    errors = [
        nothing(name, a - b, "in/s" if "S4" in name else "rad/s", why=why)
        for name, a, b, why in zip(names, rates, solved, reasons)
    ]
    unsolved = [
        nothing(
            f"row 37f, {case.name}",
            np.nanmax(np.abs(row_f(case)[0])),
            "in/s",
            why=why,
        )
        for case, why in zip(ROW_F, 2 * ("erratum 3: it is left unsolved",))
    ]
    return (
        Statement(
            "where symbols [eta2'] and [theta2'] denote rotational velocities about the [j2] and [k2] axes at joint 2 "
            "respectively.",
            text("section 2.7, eqs 30, 31, L503-509"),
            "angular velocity by eq 30 less that of the matrix Z(theta) Y(eta) of eq 2, at theta = 0.8, eta = 0.3 "
            "rad, with rates of 1.7 and -2.1 rad/s",
            ROUNDING,
            (nothing("angular velocity", _angular_velocity(), "rad/s"),),
            "erratum 2: eta turns about the axis j that theta has turned",
        ),
        Statement(
            "Now separating the unknowns to form a column matrix and a coefficient matrix, the product of these two "
            "matrices must be equal to some column matrix as shown below:",
            text("section 2.7, eq 38, L559-561"),
            "coefficients and right side of eq 38 less those of eqs 37a to 37f, in a general position with S1' = 1.3 in/s",
            ROUNDING,
            (
                nothing("coefficients, and right side of rows 1 to 5", [*eq_38[:, :5].ravel(), *eq_38[:5, 5]]),
                nothing("right side of row 6", eq_38[5, 5], "in/s"),
            ),
            f"erratum 9: sin theta2 lacks sin eta2, {MAYBE}",
        ),
        Statement(
            "Since rank of the coefficient matrix equals 5, the number of columns, a unique solution can be obtained.",
            text("section 2.7, L563"),
            "ranks in a general position; a solution needs equal ones",
            "none of a count",
            (
                near("coefficients", "5", ranks[0], 0.0),
                near("coefficients with the right side", 5.0, ranks[1], 0.0),
            ),
            "erratum 3: six equations for five unknowns, of which five are solved",
        ),
        Statement(
            "The final solutions for all the unknowns are as follows:",
            text("section 2.7, eqs 39 to 43, L563-573"),
            "difference from the solution of eqs 37a to 37e in a general position with S1' = 1.3 in/s, and what "
            f"remains of eq 37f over the turn, {AWAY}",
            ROUNDING,
            (*errors, *unsolved),
        ),
        Statement(
            "S1' = alpha S1 cos(alpha theta1) theta1' [when S1 is sinusoidal] (28a)",
            text("section 2.7, eq 28a, L581; L583, in brackets, says what it is the derivative of"),
            "S1' by eq 28a less the rate of eq 28, at theta1 = 0.9 rad with an amplitude of 2 in",
            ROUNDING,
            tuple(nothing(f"alpha = {ratio:g}", slip, "in/s") for ratio, (slip, _) in slips.items()),
            f"erratum 9: S1 for its amplitude S_S1, {MAYBE}",
        ),
        Statement(
            "S1'' = alpha S_S1 [cos(alpha theta1) theta1'' - alpha sin(alpha theta1) theta1'^2] (28b)",
            text("section 2.8, eq 28b, L955; L957, in brackets, says what it is the derivative of"),
            "S1'' by eq 28b less the rate of eq 28a with its amplitude mended, with a crank acceleration of 3 rad/s2",
            ROUNDING,
            tuple(nothing(f"alpha = {ratio:g}", slip, "in/s2") for ratio, (_, slip) in slips.items()),
        ),
        Statement(
            "Equations (69a) through (69q) involve acceleration terms which are obtained by differentiating "
            "equations (38) through (42) with respect to time. Hence the five acceleration equations are as follows:",
            text("section 2.8, eqs 38a to 42a, L1035-1045"),
            "greatest difference from the rates of eqs 39 to 43, which this sentence calls 38 to 42, in a general position "
            f"{AT_RATES}; {DOTS}",
            ROUNDING,
            (nothing("eqs 38a to 42a", rough, "rad/s2"),),
            "as a derivative; 38a is the rate of eq 39 as printed and has its erratum 4",
        ),
    )


#: What the printed equations of the accelerations give.
EQUATIONS = {
    "th2": "theta2'' by 38a",
    "th3": "theta3'' by 39a",
    "eta2": "eta2'' by 40a",
    "eta3": "eta3'' by 41a",
    "s4": "S4'' by 42a",
}


def _near_dead_centres(case: Case, q: Joints, angles_deg: FloatArray) -> dict[str, float]:
    """Return the greatest second rates within 10 deg of a dead centre, relative to those elsewhere, by eqs 38a to 42a."""
    found = joint_accelerations(CRANK_AT_SPEED, q, joint_rates(CRANK_AT_SPEED, q))
    close_by = np.min([np.abs(angles_deg - at) for at in dead_centres_deg(case)], axis=0) < ABOUT_DEG
    sizes = {name: np.abs(second) for name, second in found._asdict().items()}
    return {
        name: float(x[close_by].max() / x[~close_by].max()) for name, x in sizes.items() if x[~close_by].max() > NOTHING
    }


def _roundoff(q: Joints) -> float:
    """Return the greatest roundoff of an acceleration by eqs 38a to 42a, relative to the greatest one of its equation."""
    digit = np.spacing(2.0 * np.pi)
    short, long = (
        joint_accelerations(CRANK_AT_SPEED, at, joint_rates(CRANK_AT_SPEED, at))
        for at in (q, Joints(*(x.astype(np.longdouble) + digit for x in q)))
    )
    return max(float(np.abs(x - y).max() / np.abs(y).max()) for x, y in zip(short, long) if np.abs(y).max() > NOTHING)


def _dead_centres() -> tuple[Statement, ...]:
    """Judge the cause that section 3.2 gives for the spikes, in the plane and where the printed iteration ends."""
    cases = [Case(f"a4 = {a4:g} in, S1 = 0", a4, 0.0, 270.0) for a4 in (10.0, 20.0, 30.0)]
    worst, least, rough, zeros, near_zero, high = 0.0, np.inf, 0.0, [], [], []
    for case, shifted in zip(cases, OFFSETS):
        p, centres = parameters(case.offset_in), dead_centres_deg(case)
        q = joints(planar(p, np.radians(ANGLES_DEG)) / [1.0, 1.0, 1.0, 1.0, INCH])
        worst = max(worst, *_near_dead_centres(case, q, ANGLES_DEG).values())
        least = min(least, float(np.abs(np.sin(q.th3)).min()))
        th2 = np.degrees(planar(p, np.radians(centres))[:, 0]) % 360.0
        zeros += [
            near(f"sin theta2 = 0, {case.name}, {which}", stated, at, ABOUT_DEG, "deg")
            for which, stated, at in zip(("first", "second"), ("100", "300"), centres)
        ]
        near_zero += [
            at_most(
                f"theta2 at the {which} spike, {case.name}", VERY_CLOSE_DEG, float(min(angle, 360.0 - angle)), "deg"
            )
            for which, angle in zip(("first", "second"), th2)
        ]
        # half degrees from the loops at every fifth
        start = np.repeat(followed(shifted).unknowns[:, 0], round(2.0 * STEP_DEG), axis=0) * [1.0, 1.0, 1.0, 1.0, INCH]
        angles, shift = np.radians(ANGLES_DEG[:-1]), shifted.shift_in * INCH
        ended = settle(p, angles, shift, rows="printed", start=start, max_steps=MAX_STEPS)
        q = joints(ended.unknowns / [1.0, 1.0, 1.0, 1.0, INCH])
        ratios = _near_dead_centres(shifted, q, ANGLES_DEG[:-1])
        rough = max(rough, _roundoff(q))
        high += [
            at_least(f"{words}, {full_name(shifted)}", ABNORMAL, ratios[name]) for name, words in EQUATIONS.items()
        ]
    place = text("section 3.2, L1115")
    return (
        Statement(
            "Although all the dynamic equations ((68a) through (68g) and (68i) through (68q)) are free from sine or "
            "cosine terms in the denominator, the expressions for acceleration (equation (38a) through (42a)) are "
            "not free from sine terms which become very very close to zero at some particular positions of the "
            "crank, i.e. near 100 degrees and 300 degrees.",
            place,
            "sines and cosines in the denominators of what is printed as 69a to 69g and 69i to 69q, counted; crank angles at "
            "which sin theta2 vanishes, which stands in the denominators of 40a and 41a; least distance of theta3 from 0 or "
            "half a turn, since its sine stands in all five",
            f"none of a count; {ABOUT_DEG:g} deg, the rule for *near*; {VERY_CLOSE_DEG:g} deg, the rule for *very close*",
            (
                near("sines and cosines in denominators", 0.0, 0, 0.0),
                *zeros,
                at_most("theta3 from 0 or half a turn", VERY_CLOSE_DEG, np.degrees(np.arcsin(least)), "deg"),
            ),
            "theta2 is 0 or half a turn at the dead centres, which the offset moves; sin theta3 does not vanish, so "
            "that 39a and 42a stay finite. Out of the plane 40a and 41a are unbounded, and with them 38a, because eq 41 "
            "divides by sin theta2 and row 37f is left out (erratum 3); in the plane 40a and 41a are zero",
        ),
        Statement(
            "Using the computer program it has been observed that near those particular values for input crank "
            "angle, the joint angle [theta2] goes very close to zero degrees and thus the calculated values of the "
            "acceleration terms, at those particular positions, go abnormally high on account of roundoff errors in "
            "the computer calculations, which is clearly inaccurate.",
            place,
            "distance of theta2 from 0 at the dead centres; greatest accelerations, at half degrees, within "
            f"{ABOUT_DEG:g} deg of a dead centre relative to those elsewhere: in the plane, where 40a and 41a are zero, and "
            "where the printed iteration ends; there also the greatest share of the greatest acceleration that is roundoff, by "
            "numbers with three digits more and joints off by the last digit of a turn",
            f"{VERY_CLOSE_DEG:g} deg, the rule for *very close*; {ABNORMAL:g} times, the rule for *abnormally*; half of it, "
            "for *on account of*",
            (
                *near_zero,
                at_least("in the plane, by 38a, 39a, 42a", ABNORMAL, worst),
                *high,
                at_least("share that is roundoff", 0.5, rough),
            ),
            "at the second spike theta2 is half a turn. Out of the plane 40a and 41a grow without bound there, and with them "
            "38a, but not by roundoff: eq 41 divides by sin theta2, and row 37f is left out (erratum 3). 39a and 42a stay "
            "finite, as all five are in the plane: the spikes of the forces come from the torque, which has no lever on the "
            "slider there",
        ),
    )


def velocity_paths() -> list[Judged]:
    """Judge the forward path against the mixed path by the rod's momentum, eqs 50 and 52, in the plane and out of it."""
    b, rod = bodies(parameters()), _binors()[1]
    found = []
    for case in (_PLANE, *ROW_F):
        q = joints(followed(case).unknowns[:, 0])
        q = Joints(*(x[np.abs(np.sin(q.th2)) > CLEAR_SINE] for x in q))
        r = joint_rates(CRANK_AT_SPEED, q)
        forward = rod.momentum(forward_rod_velocity(CRANK_AT_SPEED, q, r))
        _, mixed, _ = momenta(CRANK_AT_SPEED, b, q, r)
        found.append(nothing(case.name, forward.real - mixed.real, "lb.s"))
    return found


def replacements() -> list[Judged]:
    """Judge eqs 57 and 58 against 55 and 56, with rates and accelerations as printed, in the plane and out of it."""
    b, found = bodies(parameters()), []
    for case in (_PLANE, *ROW_F):
        apart = []
        for q in map(Joints._make, np.stack(joints(followed(case).unknowns[:, 0]), -1)):
            if np.abs(np.sin(q.th2)) > CLEAR_SINE:
                r = joint_rates(CRANK_AT_SPEED, q)
                a = joint_accelerations(CRANK_AT_SPEED, q, r)
                pairs = zip(forward_momentum_rates(CRANK_AT_SPEED, b, q, r, a, 0.0), momentum_rates(b, q, r, a)[1:])
                apart += [float(np.abs(forward.real - mixed.real).max()) for forward, mixed in pairs]
        found.append(nothing(f"57, 58 less 55, 56; {case.name}", max(apart), "lb"))
    return found


def rates() -> StudyResult:
    """Compute the rates as printed, and the residual of the unsolved row."""
    columns = {ANGLE: GRID_DEG}
    for case in ROW_F:
        lacking, mended = row_f(case)
        columns[f"opening of the loop as printed; {case.name} [in/s]"] = lacking
        columns[f"opening of the loop mended; {case.name} [in/s]"] = mended
    return StudyResult(
        number="rahman-rates",
        claim="Rahman states: eqs 39 to 43 give all velocities of the joints, and eqs 38a to 42a their accelerations.",
        columns=padded(columns),
        statements=(*_printed_rates(), *_dead_centres()),
    )


# ---------------------------------------------------------------- the forces

_PLANAR = ("1F1i", "1F1j", "2F2i", "2F2j", "3F3i", "3F3j", "4F4i", "4F4k")


def planar_forces(*, erratum_5: bool, erratum_6: bool, share: float = 1.0) -> dict[str, FloatArray]:
    """Return the forces (lb) of the planar mechanism at a4 = 10 in by the printed equations, with errata mended or not.

    ``share`` is that of the masses which is taken: 0 leaves the inertia out.
    """
    p, angle = parameters(_PLANE.offset_in), np.radians(ANGLES_DEG)
    q = joints(planar(p, angle) / [1.0, 1.0, 1.0, 1.0, INCH])
    r = joint_rates(CRANK_AT_SPEED, q)
    seconds = joint_accelerations(CRANK_AT_SPEED, q, r)
    b = bodies(p, erratum_6=erratum_6)
    b = b._replace(masses=tuple(share * mass for mass in b.masses))
    found = joint_forces(CRANK_AT_SPEED, b, q, r, seconds, TORQUE, erratum_5=erratum_5)
    found["1F1i"], found["1F1j"] = on_crank(angle, found)
    return found


def _binors() -> tuple[Binor, Binor, Binor]:
    """Return the inertia binors of eqs 46 to 48 of the bodies of section 3.1, in lb.s2 and inches."""
    b = bodies(parameters())
    squares = ((0.0, b.crank_square), (ROD_X_SQUARE, b.rod_square), (SLIDER_SQUARE, SLIDER_SQUARE))
    first, second, third = (
        Binor(mass=m, moment=m * np.array([g, 0.0, 0.0]), inertia=m * np.diag([x, yz, yz]))
        for m, g, (x, yz) in zip(b.masses, (b.g1, b.g2, 0.0), squares)
    )
    return first, second, third


def _balances() -> tuple[float, ...]:
    """Return the greatest residuals of eqs 62 to 64 with the right forces in the plane, erratum 6 mended (lb, lb.in)."""
    p, angle, b = parameters(_PLANE.offset_in), np.radians(ANGLES_DEG), bodies(parameters(), erratum_6=True)
    q = joints(planar(p, angle) / [1.0, 1.0, 1.0, 1.0, INCH])
    r = joint_rates(CRANK_AT_SPEED, q)
    inertia = inertia_forces(CRANK_AT_SPEED, b, q, r, joint_accelerations(CRANK_AT_SPEED, q, r))
    first, second, third, fourth = (
        np.stack([values(_PLANE, COMPONENTS[f"{n}F{n}{axis}"]) for axis in "ijk"], -1) for n in (1, 2, 3, 4)
    )
    zero, moment = np.zeros_like(angle), np.zeros_like(first)
    moment[:, 2] = TORQUE
    crank = about_k(Dual(angle, zero)) @ about_i(Dual(zero, CRANK))
    rod = about_k(q.th2) @ about_j(q.eta2) @ about_i(Dual(zero, ROD))
    slider = about_k(q.th3) @ about_j(q.eta3) @ about_i(zero + 0.5 * np.pi)
    left = [
        apply(matrix.T, before) + Dual(after) + force
        for matrix, before, after, force in zip(
            (crank, rod, slider), (Dual(first, moment), Dual(second), Dual(third)), (second, third, fourth), inertia
        )
    ]
    at = clear(_PLANE)
    return tuple(float(max(np.abs(x.real[at]).max(), np.abs(x.dual[at]).max())) for x in left)


def _apart(a: Dual, b: Dual) -> float:
    """Return the greatest difference of two dual vectors."""
    return float(max(np.abs(a.real - b.real).max(), np.abs(a.dual - b.dual).max()))


def _momenta() -> tuple[Statement, ...]:
    """Judge eqs 49a to 61 in the general position against the binors of eqs 46 to 48."""
    b, still = bodies(parameters()), CRANK_AT_SPEED
    r, unmoved = joint_rates(MOVING, GENERAL), joint_rates(still, GENERAL)
    of_crank, of_rod, of_slider = _binors()
    at_g3 = Binor(mass=of_slider.mass, moment=of_slider.mass * np.array([G3, 0.0, 0.0]), inertia=of_slider.inertia)
    moving = velocities(MOVING, GENERAL, r)
    rod = forward_rod_momentum(MOVING, b, GENERAL, r)
    slider = forward_slider_momentum(MOVING, b, GENERAL, r, G3, slip=True)
    wrong = slider - at_g3.momentum(forward_slider_velocity(MOVING, GENERAL, r))
    as_printed = momenta(MOVING, b, GENERAL, r, slip=True)
    # the rates of eqs 54 to 56, and what they are the rates of, a moment later
    seconds = joint_accelerations(MOVING, GENERAL, r)
    of_rates = Crank(CRANK, ROD, MOVING.acceleration, MOVING.shift_acceleration)
    to_come = later(MOVING, GENERAL, r, seconds)
    rod_rate, slider_rate = forward_momentum_rates(MOVING, b, GENERAL, r, seconds, G3)
    forward = {
        "eq 54": (crank_momentum(of_rates, b), crank_momentum(to_come[0], b)),
        "eq 55": (rod_rate, b.masses[1] * forward_rod_momentum(to_come[0], b, *to_come[1:])),
        "eq 56": (slider_rate, forward_slider_momentum(to_come[0], b, *to_come[1:], G3)),
    }
    a = joint_accelerations(still, GENERAL, unmoved)
    _, *moved = later(still, GENERAL, unmoved, a)
    printed_rates = momentum_rates(b, GENERAL, unmoved, a)
    steady, momentum = velocities(still, GENERAL, unmoved), momenta(still, b, GENERAL, unmoved)
    accelerations = [Dual(v.real.imag / 1e-20, v.dual.imag / 1e-20) for v in velocities(still, *moved)]
    inertia = [
        _apart(inertia_force(v, h, rate), binor.rate(v, acceleration))
        for v, h, rate, binor, acceleration in zip(steady, momentum, printed_rates, _binors(), accelerations)
    ]

    def turned(h: Dual) -> Dual:
        return Dual(h.real.imag / 1e-20, h.dual.imag / 1e-20)

    return (
        Statement(
            "Formulations for the dual momentum of link 1, i.e. the crank in terms of frame {2}, of link 2, i.e. the "
            "connecting rod, in terms frame {3} and of link 3, i.e. the slider, in terms of frame {4}, can "
            "respectively be obtained by modifying equations (49), (50) and (51) to 3\N{MULTIPLICATION SIGN}1 "
            "dual-number matrix equations as shown below",
            text("section 2.8, eqs 49a to 51a, L700-728"),
            "difference from the binors of eqs 46 to 48 times the velocities of eqs 33, 35 and 45, in a general position with "
            f"S1' = 1.3 in/s and g3 = {G3:g} in",
            ROUNDING,
            (
                nothing("eq 49a", _apart(crank_momentum(MOVING, b), of_crank.momentum(moving[0])), "lb.s"),
                nothing(
                    "eq 50a",
                    _apart(rod * b.masses[1], of_rod.momentum(forward_rod_velocity(MOVING, GENERAL, r))),
                    "lb.s",
                ),
                nothing("eq 51a, components i and k", [wrong.real[[0, 2]], wrong.dual[[0, 2]]], "lb.s"),
                nothing("eq 51a, component j", [wrong.real[1], wrong.dual[1]], "lb.s"),
            ),
            f"erratum 9: cos theta3 for cos eta3 in 51a, {MAYBE}",
        ),
        Statement(
            "Now, alternative expressions for (50a) and (51a) using the backward path are respectively",
            text("section 2.8, eqs 52a, 53a, L744-748"),
            "difference from the binors times the velocities of eqs 36 and 32a, in a general position",
            ROUNDING,
            (
                nothing("eq 52a", _apart(as_printed[1], of_rod.momentum(moving[1])), "lb.s"),
                nothing("eq 53a", _apart(as_printed[2], of_slider.momentum(moving[2])), "lb.s"),
            ),
            f"erratum 9: g3 for g2 in 52a, {MAYBE}",
        ),
        Statement(
            "In either case [all by the forward path, or some by the backward path], the same numerical results are "
            "obtained, but mixed path equations set is much simpler than only the forward path equations set. ... Both the "
            "sets were tested by the program for a number of cases and resulted in same outcome.",
            text("section 2.8, L637-639, L750"),
            "greatest difference of the force part of the rod's momentum by the forward path (eqs 35, 50) from that "
            f"by the mixed path (eqs 36, 52 with g2), over the turn, {AWAY}",
            ROUNDING,
            tuple(velocity_paths()),
            "erratum 3: the paths differ by the unsolved row 37f out of the plane; that the mixed set is simpler is plain",
        ),
        Statement(
            "Differentiating forward path equations (49a), (50a) and (51a) with respect to time the following "
            "equations are obtained respectively:",
            text("section 2.8, eqs 54 to 56, L754-846"),
            "difference from the rates of eqs 49a to 51a, the last with cos eta3 for cos theta3, in a general position "
            f"{AT_RATES}, g3 = {G3:g} in; {DOTS}, as are one bracket inside 56d and one inside 56e, and the last of 56c to 56f",
            ROUNDING,
            tuple(nothing(label, _apart(rate, turned(h)), "lb") for label, (rate, h) in forward.items()),
            "56 has cos eta3 where 51a has cos theta3 (erratum 9)",
        ),
        Statement(
            "Now, backward path equations (52a) and (53a) are differentiated with respect to time. The following "
            "equations are replacements for equations (55) and (56) respectively.",
            text("section 2.8, eqs 57, 58, L848-857"),
            "difference from the rates of eqs 52a, with g2 for g3, and 53a in a general position, speed and shift constant, "
            f"g3 = 0; greatest difference of the force parts of 57 from 55 and of 58 from 56 over the turn, {AWAY}; {DOTS}",
            ROUNDING,
            (
                *(
                    nothing(label, _apart(rate, turned(h)), "lb")
                    for label, rate, h in zip(("eq 57", "eq 58"), printed_rates[1:], momenta(still, b, *moved)[1:])
                ),
                *replacements(),
            ),
            "erratum 3: out of the plane they are no replacements, as the velocities differ that the two paths give",
        ),
        Statement(
            "In this step, equations for the inertia forces of link 1 (i.e. the crank) relative to frame {2}, for "
            "link 2 (i.e. the connecting rod) relative to frame {3} and for link 3 (i.e. the slider) relative to "
            "frame {4} are derived.",
            text("section 2.8, eqs 59 to 61, L863-881"),
            "difference from the rate of momentum in a frame at rest, by the binors, in a general position at constant speed "
            "and shift; the sign with which it enters is judged at eqs 62 to 64",
            ROUNDING,
            tuple(nothing(label, size, "lb") for label, size in zip(("eq 59", "eq 60", "eq 61"), inertia)),
        ),
    )


def _expanded() -> dict[str, FloatArray]:
    """Return by how much the joint forces in eqs 62a to 64f differ from those in eqs 62 to 64."""
    th1, shift, (th2, eta2, th3, eta3, _) = 0.9, 3.5, (float(value) for value in GENERAL)
    (s, s2, se, s3, sh), (c, c2, ce, c3, ch) = (f([th1, th2, eta2, th3, eta3]) for f in (np.sin, np.cos))
    i, j, k = force = np.array([30.0, -50.0, 70.0])
    ti, tj, tk = moment = np.array([110.0, 130.0, -170.0])
    crank = about_k(Dual(th1, shift)) @ about_i(Dual(0.0, CRANK))
    rod = about_k(th2) @ about_j(eta2) @ about_i(Dual(0.0, ROD))
    slider = about_k(th3) @ about_j(eta3) @ about_i(0.5 * np.pi)
    printed = {
        62: [
            (i * c + j * s, -j * s + j * c, k),
            (
                ti * c - i * shift * s + j * shift * c + tj * s,
                -ti * s - i * shift * c + tj * c - j * shift * s + CRANK * k,
                i * CRANK * s - j * CRANK * c + tk,
            ),
        ],
        63: [
            (i * c2 * ce + j * s2 * ce - k * se, -i * s2 + j * c2, i * c2 * se + j * s2 * se + k * ce),
            (0.0, i * ROD * c2 * se + j * ROD * s2 * se + ROD * k * ce, i * ROD * s2 - j * ROD * c2),
        ],
        64: [
            (i * c3 * ch + j * s3 * ch - k * sh, i * c3 * sh + j * s3 * sh + k * ch, i * s3 - j * c3),
            (0.0, 0.0, 0.0),
        ],
    }
    right = (apply(crank.T, Dual(force, moment)), apply(rod.T, Dual(force)), apply(slider.T, Dual(force)))
    apart = {eq: np.transpose(printed[eq]) - np.transpose([f.real, f.dual]) for eq, f in zip(printed, right)}
    slip = apart[62][1, 0]
    apart[62][1, 0] = 0.0
    return {"eq 62c": slip, **{f"eqs {eq}a to {eq}f{', but for 62c' * (eq == 62)}": left for eq, left in apart.items()}}


def _slips(right: dict[str, FloatArray]) -> tuple[Statement, ...]:
    """Judge eqs 62c, 63b, 69h and 69k, the manipulations of section 3.2, and the data of section 3.1."""
    angle, at = np.radians(ANGLES_DEG), clear(_PLANE)
    crank, b = CRANK_AT_SPEED, bodies(parameters())
    r = joint_rates(crank, GENERAL)
    general = joint_forces(crank, b, GENERAL, r, joint_accelerations(crank, GENERAL, r), TORQUE)
    s, c, inertia = np.sin(angle), np.cos(angle), -(right["along crank"] + right["2F2i"])
    wrong = dict(right)
    wrong["2F2i"] = right["2F2i"] + 1.0
    for _ in range(10):
        wrong["along crank"] = -(wrong["2F2i"] + inertia)
        i, j = on_crank(angle, wrong)
        wrong["2F2i"] = -i * c - j * s - inertia
    left = float(np.abs(wrong["2F2i"] - right["2F2i"])[at].max())
    high = [
        np.abs(right["2F2i"][np.abs(ANGLES_DEG - centre) < VERY_CLOSE_DEG]).max() / np.abs(right["2F2i"][at]).max()
        for centre in dead_centres_deg(_PLANE)
    ]
    (crank_mass, *_), volume = b.masses, np.pi * 1.5**2 * CRANK
    gravity = 0.28 * WATER * volume / 386.4 / crank_mass
    return (
        Statement(
            "Expanding equations (62), (63), (64) and separating primary and dual parts, the following equations are "
            "obtained:",
            text("section 2.8, eqs 62a to 64f, L907-943"),
            "difference from eqs 62 to 64 with the matrices of eqs 1 to 3, any forces and moments in a general position, "
            "lengths in inches",
            ROUNDING,
            tuple(nothing(words, size, "lb") for words, size in _expanded().items()),
            f"erratum 9: 1F1j for 1F1i in 62c, {MAYBE}",
        ),
        Statement(
            "There are eighteen equations out of which one does not give any solution (equation (63b)), since it is "
            "of the form 0=0; confirmation of this was done by evaluating it in the computer program.",
            text("section 2.8, eq 63b, L923, L945"),
            "f2xd in a general position",
            ROUNDING,
            (nothing("f2xd", general["f2xd"], "lb.in"),),
        ),
        Statement(
            "This [division by sin theta2], in fact, resulted in some abnormal outcomes when values of angle [theta2] were "
            "very close to zero, while running the program.",
            text("section 2.8, eq 69h, L995"),
            f"greatest 2F2i by eq 69h, at half degrees of the crank, within {VERY_CLOSE_DEG:g} deg of the dead centre at which "
            f"theta2 is 0, relative to that {FROM_DEAD}; in the plane, a4 = 10 in, errata 5 and 6 mended",
            f"{VERY_CLOSE_DEG:g} deg, the rule for *very close*; {ABNORMAL:g} times, the rule for *abnormally*",
            (at_least("2F2i", ABNORMAL, high[0]),),
            "it grows without bound, and the outcome is right: the force that a torque calls forth is infinite there. At the "
            f"second dead centre, where theta2 is 180 deg, it is so too, by {high[1]:.0f} times",
        ),
        Statement(
            "If [equation (62a) is] not satisfied, then a better value of the force [2F2i] is found from the following "
            "equation (69k), using previously found values of the terms [1F1i] and [1F1j] from the equations (69i) and (69j) "
            "respectively.",
            text("section 2.8, L1007-1009"),
            "error of 2F2i after ten passes of eqs 69i, 69j, 69k from an error of 1 lb",
            ROUNDING,
            (nothing("2F2i", left, "lb"),),
            "erratum 8: 69i and 69j satisfy 62a for any 2F2i",
        ),
        Statement(
            "Interestingly, by manual manipulation of the equation those components [4T4 and 2F2k] are also found to be zero.",
            text("section 3.2, L1117"),
            "by the printed equations in a general position",
            ROUNDING,
            tuple(
                nothing(symbol, general[symbol], "lb.in" if "T" in symbol else "lb")
                for symbol in ("4T4i", "4T4j", "4T4k", "2F2k")
            ),
            "the equations put 1F1k to zero, and with it 2F2k (erratum 7)",
        ),
        Statement(
            "By manual manipulation that force component [2F2j] is found to be negative of the ratio of input torque (100 "
            "lb-in) and the crank length (12 inches).",
            text("section 3.2, L1119; eq 69g, L989"),
            "2F2j by eq 69g plus T/a1 in a general position",
            ROUNDING,
            (nothing("2F2j + T/a1", general["2F2j"] + TORQUE / CRANK, "lb"),),
        ),
        Statement(
            "Specific gravity of the material (mild steel is used for all the links) d = 0.28,",
            text("section 3.1, L1071"),
            "mass of a crank of that specific gravity less m1, relative to m1",
            ROUNDING,
            (nothing("m1", gravity - 1.0),),
            "erratum 9: 0.28 is the weight density in lb/in3",
        ),
    )


def forces() -> StudyResult:
    """Compute the force equations in the plane, as printed and mended."""
    columns, at = {ANGLE: ANGLES_DEG}, clear(_PLANE)
    right = {symbol: values(_PLANE, COMPONENTS[symbol]) for symbol in _PLANAR}
    columns["4F4k right [lb]"] = right["4F4k"]
    found = {
        "as printed": planar_forces(erratum_5=False, erratum_6=False),
        "erratum 6 mended": planar_forces(erratum_5=False, erratum_6=True),
        "erratum 5 mended": planar_forces(erratum_5=True, erratum_6=False),
        "both mended": planar_forces(erratum_5=True, erratum_6=True),
    }
    columns |= {f"4F4k {words} [lb]": of["4F4k"] for words, of in found.items()}
    wrong = {words: max(float(np.abs(of[s] - right[s])[at].max()) for s in _PLANAR) for words, of in found.items()}
    flat = max(float(np.max(followed(Case("", a4, 0.0, 270.0)).error_in)) for a4 in (0.0, 10.0, 20.0, 30.0))
    worst = (
        "greatest difference of a joint force from that by Newton and Euler (our model) in the plane, a4 = 10 in, "
        f"{FROM_DEAD}"
    )
    unbalanced = zip(("eq 62", "eq 63", "eq 64"), _balances())
    return StudyResult(
        number="rahman-forces",
        claim="Rahman states: in the plane the program gives the same as the complex algebra method.",
        columns=padded(columns),
        statements=(
            Statement(
                "The program was first tested for the planar case and the results found to be same as that obtained "
                "by the complex algebra method, a widely used procedure for analyzing planar mechanisms.",
                text("section 3.2, L1111"),
                f"error of S4 by the printed iteration, a4 = 0, 10, 20, 30 in; {worst}, by the printed equations",
                ROUNDING,
                (nothing("S4", flat, "in"), nothing("joint forces", wrong["as printed"], "lb")),
                "errata 5 and 6; with both mended the forces are right",
            ),
            *_momenta(),
            Statement(
                "The force equations for links 1, 2 and 3 are respectively as follows:",
                text("section 2.8, eqs 62 to 64, L885-891"),
                "greatest residual with the joint forces by Newton and Euler (our model) and erratum 6 mended, in the plane, "
                f"a4 = 10 in, {FROM_DEAD}",
                ROUNDING,
                tuple(nothing(label, left, "lb") for label, left in unbalanced),
                "erratum 5: f1 and f3 have the wrong sign",
            ),
            Statement(
                "Location of center of the crank [g1 = a1/2], Location of center of mass of the connecting rod [g2 = "
                "a2/2],",
                text("section 3.1, L1085-1087"),
                f"{worst}, by the printed equations with erratum 5 mended",
                ROUNDING,
                (nothing("joint forces", wrong["erratum 5 mended"], "lb"),),
                "erratum 6: from the distal joints both are negative",
            ),
            *_slips(found["both mended"]),
        ),
    )


# ---------------------------------------------------------------- the conclusions


def conclusions() -> StudyResult:
    """Judge what section 3.3 says of the method as a whole."""
    ended = _ended(0.0, OUT, 6)
    cases = (
        f"the {len(ended)} cases of the figures that are out of the plane whose loop the printed iteration closes, from the "
        "planar estimate at every 30 deg"
    )
    closed = float(np.mean([found.rotation_residual.max() < NOTHING for found in ended]))
    numbers = float(np.mean([np.isfinite(found.unknowns).all() for found in ended]))
    right = {symbol: values(_PLANE, COMPONENTS[symbol]) for symbol in _PLANAR}
    static = planar_forces(erratum_5=True, erratum_6=True, share=0.0)
    at, errors = clear(_PLANE), []
    for mended in (False, True):
        found = planar_forces(erratum_5=mended, erratum_6=mended)
        errors.append(
            max(
                float(np.abs(found[s] - right[s])[at].max() / np.abs(right[s] - static[s])[at].max())
                for s in _PLANAR
                if np.abs(right[s] - static[s])[at].max() > NOTHING
            )
        )
    printed = planar_forces(erratum_5=False, erratum_6=False)
    sizing = max(float(np.abs(printed[s] - right[s])[at].max() / np.abs(right[s])[at].max()) for s in _PLANAR)
    shaking = {s: right[s] - static[s] for s in ("1F1i", "1F1j")}
    balancing = max(float(np.abs(printed[s] - right[s])[at].max() / np.abs(x)[at].max()) for s, x in shaking.items())
    varied = sum(len(set(values)) > 1 for values in list(zip(*ALL))[1:])
    kinds, place, last = "dimensions that are varied", text("section 3.3, L1129"), text("section 3.3, L1131")
    return StudyResult(
        number="rahman-conclusions",
        claim="Rahman states: the method serves the design of spatial mechanisms, and is general, concise and economical. What "
        "section 3.3 says of displacements, forces and convergence is judged at Figs R5, R8, R14 and in "
        "rahman-closure.",
        statements=(
            Statement(
                "This [agreement in the plane] verifies the feasibility of the method.",
                text("section 3.2, L1111"),
                f"share of {cases}",
                "all of them",
                (at_least("cases closed", 1.0, closed),),
                "the plane, in which eta2 = eta3 = 0, does not show erratum 1",
            ),
            Statement(
                "Since the present work investigates dynamic forces and torques at each joint of a slider crank with "
                "all kinds of manufacturing tolerances, the results provide information needed for the sizing and "
                "dynamic balancing of a high speed slider crank in the design stage.",
                place,
                f"{kinds}, of the five that the mechanism has: a1, a2, a4, S1, alpha4; greatest error by the printed equations "
                f"in the plane, a4 = 10 in, {FROM_DEAD}: for sizing, of a joint force relative to its greatest value, for "
                "balancing, of the force on the crank's bearing relative to the greatest part of it that inertia has",
                f"none of a count; {ROUNDING}",
                (
                    near(kinds, 5.0, varied, 0.0),
                    nothing("for sizing, joint forces", sizing),
                    nothing("for balancing, bearing", balancing),
                ),
                "the lengths of crank and rod are not varied, nor is clearance in the joints; errata 5 and 6",
            ),
            Statement(
                "This analysis can be used to determine the effect and significance of the inertia forces acting on "
                "each link due to its own mass and mass moment of inertia.",
                place,
                "greatest error of a joint force by the printed equations in the plane, a4 = 10 in, relative to the greatest "
                f"part of it that inertia has, {FROM_DEAD}",
                ROUNDING,
                (nothing("as printed", errors[0]),),
                f"errata 5 and 6; with both mended the error is {errors[1]:.1g}",
            ),
            Statement(
                "It is expected that this investigation will enable designers to have better insight into the "
                "designing and testing of high speed spatial mechanisms and robot manipulators.",
                place,
                why="an expectation, for which the thesis gives no measure",
            ),
            Statement(
                "Since this method is well adapted for digital computation, any complex system can be analyzed using this "
                "analytical tool.",
                last,
                f"share of {cases}",
                "all of them",
                (at_least("cases closed", 1.0, closed),),
                "it does not analyse its own mechanism out of the plane (erratum 1)",
            ),
            Statement(
                "The main advantages of this method are its generality and that all calculations can be performed on "
                "digital computer.",
                last,
                f"generality: share of {cases}; calculations: share of them in which it ends with numbers all over the turn",
                "all of them",
                (at_least("generality", 1.0, closed), at_least("calculations", 1.0, numbers)),
                "it is not general (erratum 1)",
            ),
            Statement(
                "Other advantages are that this method is concise, flexible, economical and its analytical approach "
                "is independent of visualization.",
                last,
                why="the thesis gives no measure of any of these",
            ),
        ),
    )


# ---------------------------------------------------------------- plots


#: Labels of the axes by the unit of their columns.
_SHOWN = {"[deg]": "rotation left", "[in]": "error of S4", "[in/s]": "opening of the loop", "[lb]": "4F4k"}
#: Columns drawn dashed, over the others.
_DASHED = ("loop mended", "both mended", "Davidon")


def draw(result: StudyResult) -> Figure:
    """Draw one panel for each unit of the columns, mended equations dashed."""
    panels: list[Panel] = []
    for unit, label in _SHOWN.items():
        shown = {name: column for name, column in result.columns.items() if name.endswith(unit) and name != ANGLE}
        # the forces are infinite at the dead centres
        inside = clear(_PLANE) if unit == "[lb]" else slice(None)
        limit = 1.05 * max((float(np.nanmax(np.abs(column[inside]))) for column in shown.values()), default=0.0)
        labels = {name: printed(name.removesuffix(f" {unit}").removeprefix(f"{label} ")) for name in shown}
        said = {curve.label for panel in panels for curve in panel.curves}
        curves = [
            Curve(
                x=result.columns[ANGLE],
                y=np.where(np.abs(column) < 2.0 * limit, column, np.nan),
                # one legend serves all panels
                label="" if labels[name] in said else labels[name],
                line="--" if any(words in name for words in _DASHED) else "-",
            )
            for name, column in shown.items()
        ]
        if curves:
            panels.append(
                Panel(
                    x_label="crank angle $\\theta_1$ [deg]",
                    y_label=f"{printed_symbol(label)} {unit}",
                    curves=curves,
                    legend_at="outside",
                    x_range=(0.0, 360.0),
                    y_range=(-limit if unit in ("[lb]", "[in/s]") else 0.0, limit),
                    x_ticks=np.arange(0.0, 361.0, 60.0).tolist(),
                )
            )
    return plot_curves(panels, title=result.heading, size=(8.0, 3.2))


#: The studies by their names.
STUDIES = {
    study.number: study
    for study in (
        Study("rahman-closure", unvaried(closure), draw),
        Study("rahman-rates", unvaried(rates), draw),
        Study("rahman-forces", unvaried(forces), draw),
        Study("rahman-conclusions", unvaried(conclusions)),
    )
}
