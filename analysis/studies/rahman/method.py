"""Rahman's method judged: loop closure and its iteration, rates, force equations in the plane, conclusions.

`printed` has the equations to the letter. They are compared with other formulations: dual matrices, difference quotients,
the plant. The errata are numbered as in docs/rahman.md.
"""

from __future__ import annotations

from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from linkwork.slider_crank.published import CRANK_SPEED, parameters

from ...figures import Curve, Figure, Panel, plot_curves
from ...numerics.dual import Dual, about_i, about_j, about_k, apply, axial
from ...slider_crank import CLEAR_DEG, Settled, assembly_margin, constant_shift, greatest_shift, settle
from ...slider_crank.closure import Rows, chain, equations, freedoms, planar, residuals
from ...slider_crank.dual_dynamics import Binor
from ...units import INCH
from ..rules import ABOUT_DEG, SMALL
from ..statements import Case as Judged
from ..statements import Statement, at_least, at_most, near, text
from ..study import Study, StudyResult, padded
from ..variation import cache, unvaried
from .figures import (
    ALL,
    ANGLE,
    ANGLES_DEG,
    CRANK,
    NOTHING,
    ROUNDING,
    TORQUE,
    clear,
    dead_centres_deg,
    nothing,
    printed,
    printed_symbol,
    values,
)
from .printed import (
    GRID_DEG,
    MAX_STEPS,
    ROD_X_SQUARE,
    Crank,
    Joints,
    Turn,
    bodies,
    crank_momentum,
    dependable,
    forward_rod_momentum,
    forward_rod_velocity,
    inertia_force,
    joint_accelerations,
    joint_forces,
    joint_rates,
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

#: Length of the rod (in), and the crank as the equations have it.
ROD = 50.0
CRANK_AT_SPEED = Crank(CRANK, ROD, CRANK_SPEED)
#: Cases whose loops are followed.
OPEN = (
    Case("a4 = 10 in at S1 = 3.5 in", 10.0, 3.5, 270.0),
    Case("alpha4 = 232 deg", 20.0, 0.0, 232.0),
    Case("alpha4 = 310 deg", 20.0, 0.0, 310.0),
)
#: Cases for row 37f, which is judged where |sin theta2| is above `CLEAR_SINE`, since eq 41 divides by it.
ROW_F = (Case("a4 = 30 in at S1 = 9 in", 30.0, 9.0, 270.0), OPEN[2])
CLEAR_SINE = 0.15
#: A configuration in general position.
GENERAL = Joints(*(np.array(value) for value in (2.1, 0.35, -1.3, 0.2, 40.0)))
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


def _limits() -> tuple[Statement, ...]:
    """Judge the stated limits of the iteration, and what is inferred from them for the mechanism."""
    place = text("section 3.2, L1121")
    reached = {}
    for a4, stated in ((10.0, 3.5), (20.0, 3.5), (30.0, 9.0)):
        settled = turn(parameters(a4), stated + 0.5 * np.arange(9.0)).settled
        reached[a4] = stated + 0.5 * (int(np.cumprod(settled).sum()) - 1)
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
            "greatest S1, by halves of an inch, at which the printed iteration settles at every angle",
            f"0.5 in, the step of the limits; {own}",
            (
                near("a4 = 10 in", "3.5", reached[10.0], 0.5, "in"),
                near("a4 = 20 in, which is greater than 10 in", "3.5", reached[20.0], 0.5, "in"),
                near("a4 = 30 in", "9", reached[30.0], 0.5, "in"),
            ),
            "the limit grows from 10 in on, as the sentence's second half has it",
        ),
        Statement(
            "From this observation it can be inferred that in order for the mechanism to work, with the increase of "
            "crank axial shift, offset [a4] should be increased.",
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
            "limits of alpha4, by degrees, at which the printed iteration settles at every angle",
            f"1 deg, the step of the limits; {own}",
            tuple(twists),
            "the mechanism itself turns fully at every alpha4",
        ),
    )


def _detected() -> tuple[float, float]:
    """Return the shares of shifts at a4 = 0, 10, 20, 30 in, 0 to 50 in by 2 in, at which the iteration misses or errs.

    It runs at every 30 deg from the planar estimate. It misses a mechanism that turns fully where it does not settle at one of
    them, and errs where it settles at all on a loop that is open by a degree at one.
    """
    missed: list[bool] = []
    wrong: list[bool] = []
    for a4 in (0.0, 10.0, 20.0, 30.0):
        p = parameters(a4)
        shifts = np.arange(0.0, greatest_shift(p) or 0.0, 2.0 * INCH)
        angles, each = (x.ravel() for x in np.meshgrid(np.radians(GRID_DEG[::6]), shifts))
        found = settle(p, angles, each, rows="printed", max_steps=MAX_STEPS)
        settled = found.settled.reshape(shifts.size, -1).all(-1)
        is_open = found.rotation_residual.reshape(shifts.size, -1).max(-1) > np.radians(1.0)
        missed += np.logical_not(settled).tolist()
        wrong += np.logical_and(settled, is_open).tolist()
    return float(np.mean(missed)), float(np.mean(wrong))


def _ended(off: float) -> list[Settled]:
    """Run the iteration in the plane, at four offsets, from estimates of theta2 and theta3 that are off by an angle (deg)."""
    grid, away = np.radians(GRID_DEG), np.radians([off, 0.0, -off, 0.0, 0.0])
    planes = [parameters(a4) for a4 in (0.0, 10.0, 20.0, 30.0)]
    return [settle(p, grid, 0.0, rows="printed", start=planar(p, grid) + away) for p in planes]


def _estimates() -> float:
    """Return by how much the loop is open at the estimates of section 2.6.2, greatest of four offsets."""
    zero, worst = np.zeros(1), 0.0
    for a4 in (0.0, 10.0, 20.0, 30.0):
        s4 = np.sqrt(ROD**2 - (CRANK + a4) ** 2)
        th2 = np.pi - np.arctan(s4 / (CRANK + a4))
        estimate = np.array([[th2, 0.0, 2.0 * np.pi - th2, 0.0, s4 * INCH]])
        worst = max(worst, *(float(left[0]) for left in residuals(chain(parameters(a4), zero, zero, estimate)[0])))
    return worst


def _conditions(case: Case) -> tuple[float, float]:
    """Return A's least singular value relative to its greatest, and the greatest entry of V, where the iteration ends."""
    angle, shift = np.radians(GRID_DEG), np.full(GRID_DEG.size, case.shift_in * INCH)
    unknowns = followed(case).unknowns[:, 0] * [1.0, 1.0, 1.0, 1.0, INCH]
    matrix, right = equations(
        *chain(parameters(case.offset_in, case.twist_deg), angle, shift, unknowns), INCH, "printed"
    )
    singular = np.linalg.svd(matrix, compute_uv=False)
    return float(np.min(singular[:, -1] / singular[:, 0])), float(np.abs(right).max())


def _stretched() -> float:
    """Return the least singular value of A relative to its greatest with crank, rod and guide in line."""
    q = np.array([[0.0, 0.0, 0.0, 0.0, 40.0 * INCH]])
    matrix, _ = equations(*chain(parameters(10.0), np.zeros(1), np.zeros(1), q), INCH, "printed")
    singular = np.linalg.svd(matrix[0], compute_uv=False)
    return float(singular[-1] / singular[0])


def closure() -> StudyResult:
    """Compute the iteration and the closure error at which it ends."""
    columns = {ANGLE: GRID_DEG}
    (first, *_), plane, sparse = OPEN, Case("in the plane, a4 = 10 in", 10.0, 0.0, 270.0), GRID_DEG[::2]
    p, unknowns = parameters(first.offset_in), followed(first).unknowns[4, 0] * [1.0, 1.0, 1.0, 1.0, INCH]
    left = freedoms(p, float(np.radians(GRID_DEG[4])), first.shift_in * INCH, unknowns)
    determined, combined = [], []
    for case in (plane, *OPEN):
        found = followed(case)
        mechanism = parameters(case.offset_in, case.twist_deg)
        rotation, error, _ = dependable(mechanism, case.shift_in)
        determined += [
            nothing(f"loop open, {case.name}", np.max(found.rotation_deg), "deg"),
            nothing(f"error of S4, {case.name}", np.max(found.error_in), "in"),
        ]
        combined += [
            nothing(f"loop open, {case.name}", np.max(rotation), "deg"),
            nothing(f"error of S4, {case.name}", np.max(error), "in"),
        ]
        if case != plane:
            columns[f"rotation left as printed; {case.name} [deg]"] = found.rotation_deg[:, 0]
            columns[f"error of S4 as printed; {case.name} [in]"] = found.error_in[:, 0]
            columns[f"rotation left with Davidon Fletcher Powell; {case.name} [deg]"] = np.interp(
                GRID_DEG, sparse, rotation
            )
            columns[f"error of S4 with Davidon Fletcher Powell; {case.name} [in]"] = np.interp(GRID_DEG, sparse, error)
    singular, unmet = np.transpose([_conditions(case) for case in OPEN])
    missed, wrong = _detected()
    close_by = np.concatenate([found.steps for found in _ended(20.0)])
    outside = np.concatenate([followed(case).steps[:, 0] for case in OPEN])
    settled = float(np.mean([found.settled for found in _ended(120.0)]))
    conclusions = text("section 3.3, L1131")
    statements = (
        Statement(
            "The approach is developed in such a manner that a digital computer can detect when a solution is "
            "possible and then solve the whole problem.",
            text("abstract, L45"),
            "shares of the shifts at which the crank turns fully, 0 to 48 in by 2 in at a4 = 0, 10, 20, 30 in; the iteration "
            "from the planar estimate at every 30 deg",
            "none",
            (
                at_most("a solution is possible, and the iteration does not settle", 0.0, missed),
                at_most("the iteration settles on a loop that is open by more than 1 deg", 0.0, wrong),
            ),
            "the iteration settles where its steps become small, which says nothing of the loop (erratum 1)",
        ),
        Statement(
            "Fig. 3 is the generalized slider crank in which joint 1 is cylindrical with one translational and one "
            "rotational degrees of freedom, joints 2 and 3 are ball joints, each of which has three rotational "
            "degrees of freedom, and joint 4 is prismatic, exactly the same as in the planar case.",
            text("section 2.3, L213; eqs 1 to 5"),
            "freedoms of the chain of eqs 1 to 4 in a general position, which must be those of theta1 and S1, both given",
            "none of a count",
            (near("freedoms", 2.0, left, 0.0),),
            "erratum 1: eqs 2 and 3 give each ball joint two rotations",
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
            "what the combination, as we read it, leaves of the rotation round the loop and of S4, greatest of the turn",
            f"{ROUNDING}; the closure with true ball joints leaves less",
            tuple(combined),
            "the thesis prints the Newton-Raphson half alone (eqs 7 to 26). The other half goes on to the "
            "least sum of squares of eq 25, but outside the plane the loop of eqs 2 and 3 cannot close (erratum 1)",
        ),
        Statement(
            "[Delta = (A'A)^-1 A'V] which is exactly same as [Delta = A^-1 V].",
            text("section 2.6.1, eq 23a, L457-463"),
            "greatest entry of A Delta - V where the iteration ends",
            ROUNDING,
            tuple(nothing(case.name, entry) for case, entry in zip(OPEN, unmet)),
            "erratum 1: there A'V = 0, and V is not",
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
            "share of the angles at which the iteration settles from estimates 120 deg off, in the plane",
            "none",
            (at_most("settles", 0.0, settled),),
            "it settles on another loop",
        ),
        Statement(
            "Usually the process converges in 3 to 6 iterations if estimates are within 20 degrees, which is quite "
            "possible by using the direct formula for the planar case.",
            conclusions,
            "share of the angles at which 3 to 6 corrections are made",
            "more than half, as *usually* says",
            (
                at_least("in the plane, from estimates 20 deg off", 0.5, np.mean((close_by >= 3) & (close_by <= 6))),
                at_least("outside the plane, from the angle before", 0.5, np.mean((outside >= 3) & (outside <= 6))),
            ),
            f"outside the plane up to {np.max(outside):.0f} corrections are made, since there is no loop to converge to",
        ),
        Statement(
            "Another great disadvantage is that matrix A may become singular. Fortunately it never happened while "
            "running the program.",
            conclusions,
            "least singular value of A relative to its greatest",
            ROUNDING,
            (
                nothing("may: crank, rod and guide in line", _stretched()),
                *(
                    at_least(f"never: over the turn, {case.name}", NOTHING, least)
                    for case, least in zip(OPEN, singular)
                ),
            ),
        ),
    )
    return StudyResult(
        number="rahman-closure",
        claim="The iteration of section 2.6.1 finds theta2, eta2, theta3, eta3 and S4 for given theta1 and S1.",
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
    """Judge eqs 28a to 31 and 37 to 43, 38a to 42a in the general position, with the shift at rest or at 1.3 in/s."""
    crank = CRANK_AT_SPEED._replace(shift_rate=1.3)
    right = loop_rates(crank, GENERAL, Joints(*np.zeros(5)))
    matrix = np.stack([loop_rates(crank, GENERAL, Joints(*unit)) - right for unit in np.eye(5)], -1)
    ranks = [int(np.linalg.matrix_rank(m)) for m in (matrix, np.column_stack([matrix, right]))]
    solved, rates = Joints(*np.linalg.solve(matrix[:5], -right[:5])), joint_rates(crank, GENERAL)
    # derivative along the motion by a complex step, which has no rounding error
    moved = Joints(*(q + 1e-20j * r for q, r in zip(GENERAL, rates)))
    seconds = joint_accelerations(crank, GENERAL, rates)
    rough = max(abs(float(a - b.imag / 1e-20)) for a, b in zip(seconds, joint_rates(crank, moved)))
    row_6 = CRANK_SPEED * CRANK * np.sin(GENERAL.th2) * (1.0 - np.sin(GENERAL.eta2))
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
            f"row 37f where abs(sin theta2) > {CLEAR_SINE:g}, {case.name}",
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
            "right side of row 6 less that of eq 37f in a general position",
            ROUNDING,
            (nothing("row 6", row_6, "in/s"),),
            "erratum 9: sin theta2 lacks sin eta2",
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
            "remains of eq 37f",
            ROUNDING,
            (*errors, *unsolved),
        ),
        Statement(
            "S1' = alpha S1 cos(alpha theta1) theta1' [when S1 is sinusoidal] (28a)",
            text("section 2.7, eq 28a, L581; L583, in brackets, says what it is the derivative of"),
            "S1' by eq 28a less the rate of eq 28, at theta1 = 0.9 rad with an amplitude of 2 in",
            ROUNDING,
            tuple(nothing(f"alpha = {ratio:g}", slip, "in/s") for ratio, (slip, _) in slips.items()),
            "erratum 9: S1 for its amplitude S_S1",
        ),
        Statement(
            "S1'' = alpha SS1 [cos(alpha theta1) theta1'' - alpha sin(alpha theta1) theta1'^2] (28b)",
            text("section 2.8, eq 28b, L955; L957, in brackets, says what it is the derivative of"),
            "S1'' by eq 28b less the rate of eq 28a with its amplitude mended, with a crank acceleration of 3 rad/s2",
            ROUNDING,
            tuple(nothing(f"alpha = {ratio:g}", slip, "in/s2") for ratio, (_, slip) in slips.items()),
        ),
        Statement(
            "Equations (69a) through (69q) involve acceleration terms which are obtained by differentiating "
            "equations (38) through (42) with respect to time. Hence the five acceleration equations are as follows:",
            text("section 2.8, eqs 38a to 42a, L1035-1045"),
            "greatest difference from the rates of eqs 39 to 43, which this sentence calls 38 to 42, in a general position",
            ROUNDING,
            (nothing("eqs 38a to 42a", rough, "rad/s2"),),
        ),
    )


def _dead_centres() -> tuple[Statement, ...]:
    """Judge the cause that section 3.2 gives for the spikes, in the plane."""
    cases = [Case(f"a4 = {a4:g} in, S1 = 0", a4, 0.0, 270.0) for a4 in (10.0, 20.0, 30.0)]
    worst, least, zeros, near_zero = 0.0, np.inf, [], []
    for case in cases:
        p, centres = parameters(case.offset_in), dead_centres_deg(case)
        q = joints(planar(p, np.radians(ANGLES_DEG)) / [1.0, 1.0, 1.0, 1.0, INCH])
        r = joint_rates(CRANK_AT_SPEED, q)
        seconds = joint_accelerations(CRANK_AT_SPEED, q, r)
        close_by = np.min([np.abs(ANGLES_DEG - at) for at in centres], axis=0) < CLEAR_DEG
        sizes = [np.abs(second) for second in (seconds.th2, seconds.th3, seconds.s4)]
        worst = max(worst, *(size[close_by].max() / size[~close_by].max() for size in sizes))
        least = min(least, float(np.abs(np.sin(q.th3)).min()))
        th2 = np.degrees(planar(p, np.radians(centres))[:, 0]) % 360.0
        zeros += [
            near(f"sin theta2 = 0, {case.name}, {which}", stated, at, ABOUT_DEG, "deg")
            for which, stated, at in zip(("first", "second"), ("100", "300"), centres)
        ]
        near_zero += [
            at_most(f"theta2 at the {which} spike, {case.name}", 1.0, float(min(angle, 360.0 - angle)), "deg")
            for which, angle in zip(("first", "second"), th2)
        ]
    place = text("section 3.2, L1115")
    return (
        Statement(
            "Although all the dynamic equations ((68a) through (68g) and (68i) through (68q)) are free from sine or "
            "cosine terms in the denominator, the expressions for acceleration (equation (38a) through (42a)) are "
            "not free from sine terms which become very very close to zero at some particular positions of the "
            "crank, i.e. near 100 degrees and 300 degrees.",
            place,
            "crank angles at which sin theta2 vanishes, which stands in the denominators of 40a and 41a; least "
            "magnitude of sin theta3, which stands in all five",
            f"{ABOUT_DEG:g} deg, the rule for *near*; {SMALL:g}, the rule for *small*",
            (*zeros, at_most("least of sin theta3", SMALL, least)),
            "theta2 is 0 or half a turn at the dead centres, which the offset moves; sin theta3 does not vanish, so "
            "that 38a, 39a and 42a stay finite, and in the plane 40a and 41a are zero",
        ),
        Statement(
            "Using the computer program it has been observed that near those particular values for input crank "
            "angle, the joint angle [theta2] goes very close to zero degrees and thus the calculated values of the "
            "acceleration terms, at those particular positions, go abnormally high on account of roundoff errors in "
            "the computer calculations, which is clearly inaccurate.",
            place,
            "distance of theta2 from 0 at the dead centres; greatest accelerations by eqs 38a, 39a, 42a within 10 "
            "deg of a dead centre relative to those elsewhere",
            "1 deg for *very close*; ten times for *abnormally high*",
            (*near_zero, at_least("accelerations", 10.0, worst)),
            "at the second spike theta2 is half a turn, and the accelerations are not high: the spikes are those of "
            "the forces, since the torque has no lever on the slider at a dead centre, not of roundoff",
        ),
    )


def velocity_paths() -> list[Judged]:
    """Judge the forward path against the mixed path by the rod's momentum, eqs 50 and 52, in the plane and out of it."""
    b, rod = bodies(parameters()), _binors()[1]
    found = []
    for case in (Case("in the plane, a4 = 10 in", 10.0, 0.0, 270.0), *ROW_F):
        q = joints(followed(case).unknowns[:, 0])
        q = Joints(*(x[np.abs(np.sin(q.th2)) > CLEAR_SINE] for x in q))
        r = joint_rates(CRANK_AT_SPEED, q)
        forward = rod.momentum(forward_rod_velocity(CRANK_AT_SPEED, q, r))
        _, mixed, _ = momenta(CRANK_AT_SPEED, b, q, r)
        found.append(nothing(case.name, forward.real - mixed.real, "lb.s"))
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
        claim="Eqs 39 to 43 give all velocities of the joints, and eqs 38a to 42a their accelerations.",
        columns=padded(columns),
        statements=(*_printed_rates(), *_dead_centres()),
    )


# ---------------------------------------------------------------- the forces

_PLANE = Case("a4 = 10 in, S1 = 0", 10.0, 0.0, 270.0)
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
    squares = ((0.0, b.crank_square), (ROD_X_SQUARE, b.rod_square), (0.0, 0.0))
    first, second, third = (
        Binor(mass=m, moment=m * np.array([g, 0.0, 0.0]), inertia=m * np.diag([x, yz, yz]))
        for m, g, (x, yz) in zip(b.masses, (b.g1, b.g2, 0.0), squares)
    )
    return first, second, third


def _apart(a: Dual, b: Dual) -> float:
    """Return the greatest difference of two dual vectors."""
    return float(max(np.abs(a.real - b.real).max(), np.abs(a.dual - b.dual).max()))


def _momenta() -> tuple[Statement, ...]:
    """Judge eqs 49a to 61 in the general position against the binors of eqs 46 to 48."""
    crank, b = CRANK_AT_SPEED._replace(shift_rate=1.3), bodies(parameters())
    still = CRANK_AT_SPEED
    r, unmoved = joint_rates(crank, GENERAL), joint_rates(still, GENERAL)
    a = joint_accelerations(still, GENERAL, unmoved)
    of_crank, of_rod, of_slider = _binors()
    moving = velocities(crank, GENERAL, r)
    across = CRANK * crank.speed * np.sin(GENERAL.th2) * np.sin(GENERAL.eta2) - ROD * r.eta2 * np.cos(GENERAL.th2)
    slip_51a = b.masses[2] * (np.cos(GENERAL.th3) - np.cos(GENERAL.eta3)) * across
    rod = forward_rod_momentum(crank, b, GENERAL, r)
    as_printed = momenta(crank, b, GENERAL, r, slip=True)
    # rates along the motion by a complex step; speed 3 rad/s2, shift 0.7 in/s2 for the crank
    seconds = Crank(CRANK, ROD, 3.0, 0.7)
    speeds = (first + 1e-20j * second for first, second in zip(crank[2:], seconds[2:]))
    quicker = Crank(CRANK, ROD, *cast("tuple[float, float]", tuple(speeds)))
    crank_rate = crank_momentum(quicker, b)
    moved = (Joints(*(x + 1e-20j * y for x, y in zip(*pair))) for pair in ((GENERAL, unmoved), (unmoved, a)))
    later = momenta(still, b, *moved)
    printed_rates = momentum_rates(b, GENERAL, unmoved, a)
    steady, momentum = velocities(still, GENERAL, unmoved), momenta(still, b, GENERAL, unmoved)
    accelerations = [Dual(v.real.imag / 1e-20, v.dual.imag / 1e-20) for v in velocities(still, *_complex(unmoved, a))]
    inertia = [
        _apart(inertia_force(v, h, rate), binor.rate(v, acceleration))
        for v, h, rate, binor, acceleration in zip(steady, momentum, printed_rates, _binors(), accelerations)
    ]
    lost = "the scan has lost the second dots; the thesis computes with eqs 57 and 58 in their place (L859)"

    def turned(h: Dual) -> Dual:
        return Dual(h.real.imag / 1e-20, h.dual.imag / 1e-20)

    return (
        Statement(
            "Formulations for the dual momentum of link 1, i.e. the crank in terms of frame {2}, of link 2, i.e. the "
            "connecting rod, in terms frame {3} and of link 3, i.e. the slider, in terms of frame {4}, can "
            "respectively be obtained by modifying equations (49), (50) and (51) to 3\N{MULTIPLICATION SIGN}1 "
            "dual-number matrix equations as shown below",
            text("section 2.8, eqs 49a to 51a, L700-742"),
            "difference from the binors of eqs 46 to 48 times the velocities of eqs 33, 35 and 45, in a general position",
            ROUNDING,
            (
                nothing("eq 49a", _apart(crank_momentum(crank, b), of_crank.momentum(moving[0])), "lb.s"),
                nothing(
                    "eq 50a",
                    _apart(rod * b.masses[1], of_rod.momentum(forward_rod_velocity(crank, GENERAL, r))),
                    "lb.s",
                ),
                nothing("eq 51a, component j", slip_51a, "lb.s"),
            ),
            "erratum 9: cos theta3 for cos eta3 in 51a",
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
            "erratum 9: g3 for g2 in 52a",
        ),
        Statement(
            "In either case, the same numerical results are obtained, but mixed path equations set is much simpler "
            "than only the forward path equations set. ... Both the sets were tested by the program for a number of "
            "cases and resulted in same outcome.",
            text("section 2.8, L637-639, L750"),
            "greatest difference of the rod's momentum by the forward path (eqs 35, 50) from that by the mixed path "
            f"(eqs 36, 52 with g2), over the turn where abs(sin theta2) > {CLEAR_SINE:g}",
            ROUNDING,
            tuple(velocity_paths()),
            "erratum 3: the paths differ by the unsolved row 37f out of the plane",
        ),
        Statement(
            "Differentiating forward path equations (49a), (50a) and (51a) with respect to time the following "
            "equations are obtained respectively:",
            text("section 2.8, eqs 54 to 56, L754-846"),
            "difference from the rate of eq 49a, with theta1'' = 3 rad/s2 and S1'' = 0.7 in/s2",
            ROUNDING,
            (
                nothing("eq 54", _apart(crank_momentum(seconds, b), turned(crank_rate)), "lb"),
                *(Judged(label=label, computed=None, why=lost) for label in ("eq 55", "eq 56")),
            ),
        ),
        Statement(
            "Now, backward path equations (52a) and (53a) are differentiated with respect to time. The following "
            "equations are replacements for equations (55) and (56) respectively.",
            text("section 2.8, eqs 57, 58, L848-857"),
            "difference from the rates of eqs 52a, with g2 for g3, and 53a in a general position",
            ROUNDING,
            tuple(
                nothing(label, _apart(rate, turned(h)), "lb")
                for label, rate, h in zip(("eq 57", "eq 58"), printed_rates[1:], later[1:])
            ),
        ),
        Statement(
            "In this step, equations for the inertia forces of link 1 (i.e. the crank) relative to frame {2}, for "
            "link 2 (i.e. the connecting rod) relative to frame {3} and for link 3 (i.e. the slider) relative to "
            "frame {4} are derived.",
            text("section 2.8, eqs 59 to 61, L863-881"),
            "difference from the rate of momentum in a frame at rest, by the binors, in a general position",
            ROUNDING,
            tuple(nothing(label, size, "lb") for label, size in zip(("eq 59", "eq 60", "eq 61"), inertia)),
        ),
    )


def _complex(*pairs: Joints) -> tuple[Joints, Joints]:
    """Return the general position and its rates, moved along the motion by a complex step."""
    unmoved, a = pairs
    return (
        Joints(*(x + 1e-20j * y for x, y in zip(GENERAL, unmoved))),
        Joints(*(x + 1e-20j * y for x, y in zip(unmoved, a))),
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
    dead = np.min([np.abs(ANGLES_DEG - centre) for centre in dead_centres_deg(_PLANE)], axis=0) < 1.0
    high = np.abs(right["2F2i"][dead]).max() / np.abs(right["2F2i"][at]).max()
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
            "erratum 9: 1F1j for 1F1i in 62c",
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
            "This, in fact, resulted in some abnormal outcomes when values of angle [theta2] were very close to "
            "zero, while running the program.",
            text("section 2.8, eq 69h, L995"),
            "greatest 2F2i by eq 69h within 1 deg of a dead centre relative to that 10 deg or more from it, a4 = 10 in",
            "ten times for *abnormal*",
            (at_least("2F2i", 10.0, high),),
            "but the outcome is right: the force that a torque calls forth is infinite there",
        ),
        Statement(
            "If not satisfied, then a better value of the force [2F2i] is found from the following equation (69k), using "
            "previously found values of the terms [1F1i] and [1F1j] from the equations (69i) and (69j) respectively.",
            text("section 2.8, L1007-1009"),
            "error of 2F2i after ten passes of eqs 69i, 69j, 69k from an error of 1 lb",
            ROUNDING,
            (nothing("2F2i", left, "lb"),),
            "erratum 8: 69i and 69j satisfy 62a for any 2F2i",
        ),
        Statement(
            "Interestingly, by manual manipulation of the equation those components are also found to be zero.",
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
            "By manual manipulation that force component is found to be negative of the ratio of input torque (100 "
            "lb-in) and the crank length (12 inches).",
            text("section 3.2, L1117; eq 69g, L991"),
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
    worst = "greatest difference of a joint force from the plant's in the plane, a4 = 10 in, 10 deg or more from a dead centre"
    return StudyResult(
        number="rahman-forces",
        claim="In the plane the program gives the same as the complex algebra method.",
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
                f"{worst}, by the printed equations with erratum 6 mended",
                ROUNDING,
                (nothing("joint forces", wrong["erratum 6 mended"], "lb"),),
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
    ended = [
        settle(
            parameters(case.offset_in, case.twist_deg), np.radians(GRID_DEG[::6]), case.shift_in * INCH, rows="printed"
        )
        for case in ALL
        if case.shift_in or case.twist_deg != IDEAL.twist_deg
    ]
    cases = f"the {len(ended)} cases out of the plane whose loop the printed iteration closes"
    closed = float(np.mean([found.rotation_residual.max() < NOTHING for found in ended]))
    numbers = float(np.mean([np.isfinite(found.unknowns).all() for found in ended]))
    right = {symbol: values(_PLANE, COMPONENTS[symbol]) for symbol in _PLANAR}
    static = planar_forces(erratum_5=True, erratum_6=True, share=0.0)
    at, errors = clear(_PLANE), {}
    for words, mended in (("as printed", False), ("with errata 5 and 6 mended", True)):
        found = planar_forces(erratum_5=mended, erratum_6=mended)
        errors[words] = max(
            float(np.abs(found[s] - right[s])[at].max() / np.abs(right[s] - static[s])[at].max())
            for s in _PLANAR
            if np.abs(right[s] - static[s])[at].max() > NOTHING
        )
    varied = sum(len(set(values)) > 1 for values in list(zip(*ALL))[1:])
    kinds, place, last = "dimensions that are varied", text("section 3.3, L1129"), text("section 3.3, L1131")
    return StudyResult(
        number="rahman-conclusions",
        claim="The method serves the design of spatial mechanisms, and is general, concise and economical. What "
        "section 3.3 says of displacements, forces and convergence is judged at Figs R5, R8, R14 and in "
        "rahman-closure.",
        statements=(
            Statement(
                "This verifies the feasibility of the method.",
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
                f"{kinds}, of the five that the mechanism has: a1, a2, a4, S1, alpha4",
                "none of a count",
                (near(kinds, 5.0, varied, 0.0),),
                "the lengths of crank and rod are not varied, nor is clearance in the joints; and for balancing the "
                "forces on the bearing are wrong (errata 5 to 7)",
            ),
            Statement(
                "This analysis can be used to determine the effect and significance of the inertia forces acting on "
                "each link due to its own mass and mass moment of inertia.",
                place,
                "greatest error of a joint force in the plane, relative to the greatest part of it that inertia has",
                ROUNDING,
                tuple(nothing(words, error) for words, error in errors.items()),
                "errata 5 and 6",
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
