"""Verdicts on the loop closure: sections 2.2 to 2.6, 3.2 and 3.3; `iteration` judges how the iteration starts and ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from linkwork.slider_crank.published import parameters

from ...numerics.dual import Dual, about_i, about_j, about_k
from ...slider_crank import assembly_margin, constant_shift, greatest_shift
from ...slider_crank.closure import chain, equations, planar
from ...units import INCH
from ..statements import Case as Judged
from ..statements import FloatArray, Statement, at_least, at_most, near, statement
from ..study import Study, StudyResult, pad_columns
from ..variation import cache, ignore_changes
from .figures import ANGLE, CRANK, ROUNDING, nothing
from .iteration import judge_convergence, judge_detection, judge_ends
from .method import AT, OPEN, PLANE, ROD, ROUGH, SHIFT, H, case_turn, difference, draw, links
from .printed import GENERAL, GRID_DEG, MAX_STEPS, STEP, STEP_DEG, close_loop_combined, turn
from .table import TWISTS_REACHED_DEG, Case

#: Rows and columns of the entries 21, 31 and 32, the right sides of eqs 20.
_BELOW = ([1, 2, 2], [0, 0, 1])
#: Shifts (in) at which the iteration is tried, number of runs at each shift, and scatter of their starts (rad, in).
TRIED, RUNS, OFF = np.arange(0.0, 12.5, 0.5), 20, 1e-9
#: Differential operator of a rotation about k, eqs 2a and 3a.
_ABOUT = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def _eta_operator(th: float) -> FloatArray:
    """Return the differential operator of the rotation eta when theta is ``th`` (rad), eqs 2b and 3b."""
    return np.array([[0.0, 0.0, np.cos(th)], [0.0, 0.0, np.sin(th)], [-np.cos(th), -np.sin(th), 0.0]])


def _matrices_error() -> float:
    """Return the greatest difference between the matrices as printed in eqs 1 to 4 and the products of rotations."""
    th2, eta2, th3, eta3, s4 = (float(value) for value in GENERAL)
    a1, a4, twist = CRANK, 20.0, 4.0
    (s1, s2, se, s3, sh, sa), (c1, c2, ce, c3, ch, ca) = (
        f([AT, th2, eta2, th3, eta3, twist]) for f in (np.sin, np.cos)
    )
    printed = (
        (
            [[c1, -s1, 0.0], [s1, c1, 0.0], [0.0, 0.0, 1.0]],
            [[-SHIFT * s1, -SHIFT * c1, a1 * s1], [SHIFT * c1, -SHIFT * s1, -a1 * c1], [0.0, a1, 0.0]],
        ),
        (
            [[c2 * ce, -s2, c2 * se], [s2 * ce, c2, s2 * se], [-se, 0.0, ce]],
            [[0.0, ROD * c2 * se, ROD * s2], [0.0, ROD * s2 * se, -ROD * c2], [0.0, ROD * ce, 0.0]],
        ),
        ([[c3 * ch, c3 * sh, s3], [s3 * ch, s3 * sh, -c3], [-sh, ch, 0.0]], np.zeros((3, 3))),
        (
            [[1.0, 0.0, 0.0], [0.0, ca, -sa], [0.0, sa, ca]],
            [[0.0, -s4 * ca, s4 * sa], [s4, -a4 * sa, -a4 * ca], [0.0, a4 * ca, -a4 * sa]],
        ),
    )
    right = (*links(), about_k(Dual(0.0, s4)) @ about_i(Dual(twist, a4)))
    return max(difference(Dual(np.array(x), np.array(y)), m) for (x, y), m in zip(printed, right))


def _rotation_solving_22() -> FloatArray:
    """Return a rotation, not the identity, for which the right sides of eq 22 vanish."""

    def sides(vector: FloatArray) -> list[float]:
        b = Rotation.from_rotvec(vector).as_matrix()
        return [float(b[j, i] + b[i, i] + b[j, j] - 2.0) for i, j in ((0, 1), (0, 2), (1, 2))]

    found = root(sides, [0.5, -0.2, 0.5], tol=1e-14)
    return np.asarray(Rotation.from_rotvec(found.x).as_matrix())


def _operator_error() -> float:
    """Return the greatest error of the operators of eqs 2a to 4a: operator times matrix minus the derivative of the matrix."""
    th, eta = float(GENERAL.th2), float(GENERAL.eta2)

    def ball(beyond: Dual, change: FloatArray) -> Dual:
        return cast(Dual, about_k(th + change[0]) @ about_j(eta + change[1]) @ about_i(beyond))

    def guide(change: float) -> Dual:
        return cast(Dual, about_k(Dual(0.0, 1.3 + change)) @ about_i(Dual(4.0, 20.0)))

    left = [Dual(0.0 * _ABOUT, _ABOUT) @ guide(0.0) - (guide(H) - guide(-H)) / (2.0 * H)]
    for beyond in (Dual(0.0, ROD), Dual(0.5 * np.pi, 0.0)):
        for operator, change in zip((_ABOUT, _eta_operator(th)), H * np.eye(2)):
            quotient = (ball(beyond, change) - ball(beyond, -change)) / (2.0 * H)
            left.append(Dual(operator) @ ball(beyond, 0.0 * change) - quotient)
    return max(float(np.abs([lack.real, lack.dual / ROD]).max()) for lack in left)


def _nine_equations(case: Case, angle: float, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the coefficients (9, 10) and the right sides (3, 3, 2) of the nine dual equations 19a, by eqs 12 to 18.

    Each of the five unknowns has two columns of coefficients, the real and the dual parts. The last axis of the right sides
    has the real and the dual parts too. ``q`` are the unknowns at the crank angle ``angle`` (rad).
    """
    p, (th2, eta2, th3, eta3, s4) = parameters(case.offset_in, case.twist_deg), q.tolist()
    m1 = about_k(Dual(angle, case.shift_in * INCH)) @ about_i(Dual(0.0, p.crank_length))
    l2 = about_k(th2) @ about_j(eta2) @ about_i(Dual(0.0, p.rod_length))
    m4 = about_k(Dual(0.0, s4 * INCH)) @ about_i(Dual(p.guide_twist, p.guide_offset))
    rod, guide = m1 @ l2, m1 @ l2 @ about_k(th3) @ about_j(eta3) @ about_i(0.5 * np.pi)
    slide = Dual(0.0 * _ABOUT, _ABOUT * INCH)
    sides = [
        frame @ operator @ frame.T
        for frame, operator in (
            (m1, Dual(_ABOUT)),
            (m1, Dual(_eta_operator(th2))),
            (rod, Dual(_ABOUT)),
            (rod, Dual(_eta_operator(th3))),
            (guide, slide),
        )
    ]
    off = (guide @ m4).T
    right = np.stack([off.real - np.eye(3), off.dual / INCH], -1)
    return np.stack([part.ravel() for h in sides for part in (h.real, h.dual / INCH)], -1), right


def _independent() -> tuple[int, float]:
    """Return the number of independent equations in 19a, and the order to which the other equations agree with them.

    The number is the rank of the left sides in a general position. Left sides on opposite sides of the diagonal add up to
    zero, so their right sides should too. The order is the power of the opening (rad, in) with which these sums of right sides
    decrease as a closed planar loop is opened less and less.
    """

    def odds(q: FloatArray) -> float:
        _, right = _nine_equations(PLANE, AT, q)
        return float(np.abs(right + np.swapaxes(right, 0, 1)).max())

    left, _ = _nine_equations(OPEN[0], AT, np.array([float(x) for x in GENERAL]))
    closed = planar(parameters(PLANE.offset_in), np.array([AT]))[0] / [1.0, 1.0, 1.0, 1.0, INCH]
    wide, narrow = (odds(closed + off * np.array([0.3, 0.5, -0.4, 0.6, 0.2])) for off in (2e-3, 1e-3))
    return int(np.linalg.matrix_rank(left)), float(np.log2(wide / narrow))


def _joint_freedoms() -> tuple[tuple[int, int], ...]:
    """Return the numbers of rotations and of translations of each joint 1 to 4 by eqs 1 to 4.

    The rank of the derivatives of a joint's matrix is the number of rotations and translations together; the rank of their
    real parts is the number of rotations.
    """

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
        rotations, both = (
            int(np.linalg.matrix_rank(rows, tol=1e-6))
            for rows in ([x.real.ravel() for x in slopes], [np.append(x.real, x.dual) for x in slopes])
        )
        ranks.append((rotations, both - rotations))
    return tuple(ranks)


def _settles_with_twist(twist_deg: float) -> bool:
    """Return whether the iteration converges at every angle of a turn at a4 = 20 in and S1 = 0 with a twist alpha4 (deg)."""
    return bool(case_turn(Case("", 20.0, 0.0, twist_deg)).settled.all())


def _settled_shares(a4: float) -> dict[float, float]:
    """Return the share of `RUNS` runs that settle at every angle, by the shifts of `TRIED`, at an offset a4 (in)."""
    off = OFF * np.random.default_rng(1991).standard_normal((TRIED.size * RUNS, 5))
    settled = turn(parameters(a4), np.repeat(TRIED, RUNS), off=off).settled.reshape(-1, RUNS)
    return dict(zip(TRIED.tolist(), settled.mean(-1).tolist()))


def _limits() -> Iterator[Statement]:
    """Judge the limits of S1 and alpha4 that section 3.2 states for the iteration."""
    shares = {a4: _settled_shares(a4) for a4 in (0.0, 10.0, 20.0, 30.0)}
    last = {a4: max(s1 for s1, share in settled.items() if share > 0.0) for a4, settled in shares.items()}
    always = max(s1 for s1 in shares[30.0] if all(share == 1.0 for less, share in shares[30.0].items() if less <= s1))
    within = float(np.mean([_settles_with_twist(twist) for twist in np.linspace(*TWISTS_REACHED_DEG, 7).tolist()]))
    twists = []
    for which, limit, way in zip(("least", "greatest"), TWISTS_REACHED_DEG, (-1.0, 1.0)):
        found = limit
        while _settles_with_twist(found + way):
            found += way
        twists.append(near(f"{which} alpha4", f"{limit:g}", found, 1.0, "deg"))
    place, step = "section 3.2, L1121", "0.5 in, the step in which S1 is tried and the stated limits are given"
    yield statement(
        "For the particular link lengths as mentioned before, when offset [a4] is zero, the program fails to "
        "converge if the term [S1] is greater than 1.5 inches.",
        place,
        f"greatest S1 at which the printed iteration settles at every angle in any of {RUNS} runs. S1 is tried in steps "
        f"of half an inch up to {TRIED[-1]:g} in. The starts of the runs differ by {OFF:g} (rad, in), as rounding errors "
        "would make them differ",
        step,
        near("a4 = 0", "1.5", last[0.0], 0.5, "in"),
        why="rounding errors decide: most of the runs settle at 0.5 and 1 in, about half at 1.5 in, and a few at 2 in. "
        f"With at most 50 corrections instead of {MAX_STEPS}, it settles at S1 = 0 alone",
    )
    yield statement(
        "When offset is increased to 10 inches or greater, the program fails to converge if the term [S1] is "
        "greater than 3.5 inches and when offset [a4] is 30 inches, the program converges as long as the term "
        "[S1] is less than or equal to 9 inches.",
        place,
        "limit as in the row before; for *converges as long as*, greatest S1 up to which every run settles",
        step,
        Judged(
            label="fails beyond, a4 = 10 in",
            stated="3.5",
            computed=None,
            unit="in",
            why="every run settles up to 4 in, about half of them at 4.5 in and none at 5 in: rounding errors decide "
            "whether the limit is 4 in, within the tolerance, or 4.5 in",
        ),
        near(
            "fails beyond, a4 = 20 in, which is greater than 10 in",
            "3.5",
            last[20.0],
            0.5,
            "in",
            why="every run settles up to 6 in, none at 6.5 in, and some of them at most of the shifts from 7 to 11 in",
        ),
        near("converges up to, a4 = 30 in", "9", always, 0.5, "in"),
        why="our choices matter: at a4 = 10 in the limit is 4 in with at most 100 corrections; with steps of 1 deg every "
        "run settles up to 2.5 in, none at 3 in, and some at 3.5 in; at a4 = 30 in some runs settle at 12 in with at most "
        "1000 corrections",
    )
    yield from _mechanism_limits()
    yield statement(
        "When offset [a4] is 20 inches and crank axial displacement [S1] is zero, the program converges as long "
        "as offset [alpha4] is between 232 and 310 degrees.",
        place,
        "least and greatest alpha4, in steps of 1 deg, up to which the printed iteration settles at every angle; share "
        "of seven twists, evenly spaced from 232 to 310 deg, at which it settles",
        "1 deg, the step of alpha4; none for the share",
        *twists,
        at_least("232 to 310 deg", 1.0, within),
        why="but the loops on which it settles are open (erratum 1). With at most 50 corrections instead of "
        f"{MAX_STEPS}, it settles from 234 to 307 deg",
    )


def _mechanism_limits() -> Iterator[Statement]:
    """Judge what section 3.2 infers from the limits of the iteration about the mechanism itself."""
    shifts = {a4: (greatest_shift(parameters(a4)) or 0.0) / INCH for a4 in (0.0, 10.0, 20.0, 30.0)}

    def margin(a4: float, shift: float) -> float:
        return float(assembly_margin(parameters(a4), constant_shift(shift * INCH)).length / INCH)

    place = "section 3.2, L1121"
    yield statement(
        "From this observation [of the limits of S1] it can be inferred that in order for the mechanism to work, with "
        "the increase of crank axial shift, offset [a4] should be increased.",
        place,
        "change of the greatest S1 at which the crank turns fully with alpha4 = 270 deg, from one offset to the next",
        "none, the sign decides",
        *(
            at_least(f"a4 = {before:g} to {after:g} in", 0.0, shifts[after] - shifts[before], "in")
            for before, after in pairwise(shifts)
        ),
        why="the mechanism works up to S1 = sqrt(a2^2 - (a1 + a4)^2), which falls with a4. The limits that the thesis found "
        "belong to its iteration, not to the mechanism",
    )
    yield statement(
        "In the case of mechanism failure, it will either lose closure, i.e. one link or more will get detached "
        "from another at the joint or the slider will go to the opposite side.",
        place,
        "margin of the rod's reach (rod length minus distance of the crank pin from the guide), the least over a turn. "
        "First with S1 larger than its greatest value by 1 in, our choice: the margin is negative where the loop cannot "
        "close. Then at the greatest S1, the greatest margin of the four offsets: it is zero where the two assemblies "
        "meet, so that the slider can go to the opposite side",
        f"none, the sign decides; for zero {ROUNDING}",
        *(
            at_most(f"a4 = {a4:g} in, S1 = {shift + 1.0:.4g} in", 0.0, margin(a4, shift + 1.0), "in")
            for a4, shift in shifts.items()
        ),
        nothing("a4 = 0, 10, 20, 30 in, greatest S1", [margin(*at) for at in shifts.items()], "in"),
        why="but where the thesis's program fails, the mechanism does not fail (row before)",
    )


def _inverse_difference(case: Case) -> float:
    """Return the greatest difference of Delta by eq 23a from A^-1 V, over the first corrections of a turn.

    A^-1 is the pseudo-inverse of A that line L457 defines, here computed from singular values. A first correction is one from
    the solution at the previous angle.
    """
    angle, shift = np.radians(GRID_DEG), np.full(GRID_DEG.size, case.shift_in * INCH)
    start = np.roll(case_turn(case).unknowns[:, 0], 1, axis=0) * [1.0, 1.0, 1.0, 1.0, INCH]
    loop = chain(parameters(case.offset_in, case.twist_deg), angle, shift, start)
    matrix, right = equations(*loop, INCH, "printed")
    transposed, right = np.swapaxes(matrix, -1, -2), right[..., None]
    delta = np.linalg.solve(transposed @ matrix, transposed @ right)
    return float(np.abs(delta - np.linalg.pinv(matrix) @ right).max())


def _matrices() -> Iterator[Statement]:
    """Judge the freedoms of the joints, the matrices of eqs 1 to 4, and the operators of eqs 2a to 4a."""
    (turning, sliding), (before, _), (after, _), (_, guided) = _joint_freedoms()
    joints = (
        ("joint 1, rotations", "one", 1.0, turning),
        ("joint 1, translations", "one", 1.0, sliding),
        ("joint 2, rotations", "three", 3.0, before),
        ("joint 3, rotations", "three", 3.0, after),
        ("joint 4, translations", "one", 1.0, guided),
    )
    yield statement(
        "Fig. 3 is the generalized slider crank in which joint 1 is cylindrical with one translational and one "
        "rotational degrees of freedom, joints 2 and 3 are ball joints, each of which has three rotational "
        "degrees of freedom, and joint 4 is prismatic, exactly the same as in the planar case.",
        "section 2.3, L213; eqs 1 to 4",
        "freedoms that the matrices of eqs 1 to 4 give each joint, in a general position. The rotations are the rank of "
        "the derivatives of the matrix's real part by the joint's variables; the translations are what the dual part "
        "adds to this rank",
        "none, since counts are exact",
        *(replace(near(label, count, found, 0.0), stated=word) for label, word, count, found in joints),
        why="erratum 1: eqs 2 and 3 give each ball joint two rotations",
    )
    yield statement(
        "Therefore, the transformation matrix, specifying the location of coordinate frame {2} with respect to frame {1}, "
        "can be written as",
        "section 2.4, eqs 1 to 4, L261-306",
        "difference between the matrices of eqs 1 to 4 and the products of the rotations and translations that the text "
        "names, in a general position, with lengths in inches",
        ROUNDING,
        nothing("eqs 1 to 4", _matrices_error()),
    )
    yield statement(
        "hence partial differential operator [Q_L eta_2] can be written as,",
        "section 2.5, eqs 2a to 4a, L320-352",
        "operators times matrices, minus difference quotients of the matrices, in a general position, with lengths "
        "relative to the rod's length",
        f"{ROUGH:g}, the error of the difference quotients",
        at_most("eqs 2a, 2b, 3a, 3b, 4a", ROUGH, _operator_error()),
    )


@cache
def _combined(case: Case) -> tuple[FloatArray, FloatArray, bool]:
    return close_loop_combined(parameters(case.offset_in, case.twist_deg), case.shift_in)


def _step() -> Iterator[Statement]:
    """Judge the equations of a step of the iteration, eqs 19a to 23a."""
    rank, order = _independent()
    least = min(float(_combined(case)[0].max()) for case in OPEN)
    half_turn, open_22 = np.diag([1.0, -1.0, -1.0]), _rotation_solving_22()
    open_deg = np.degrees(Rotation.from_matrix(open_22).magnitude())
    yield statement(
        "The numerical method being used to determine the displacements is based on the algorithm (12) introduced "
        "by Hall, Root & Sandgren (1977). This algorithm is the combination of Davidon-Fletcher-Powell optimization "
        "routine with the Newton-Raphson method as applied to kinematics by Uicker, Denavit and Hartenberg (1964).",
        "section 2.6.1, L366; abstract, L45",
        why="the thesis prints only the Newton-Raphson half (eqs 7 to 26), and its program is missing. When we combine "
        f"the two in our own way, the loop stays open by {least:.0f} deg or more somewhere in the turn in each of the "
        f"cases {', '.join(case.name for case in OPEN)}",
    )
    yield statement(
        "So from equation (19a) nine dual equations can be written from this matrix equation, out of which only three are "
        "independent.",
        "section 2.6.1, eqs 19a, 19b, L416",
        "rank of the nine left sides, by eqs 12 to 16, in a general position. Then the sums of right sides on opposite sides "
        "of the diagonal, which vanish if three equations imply the other six: the order (power) with which these sums "
        "decrease as an open planar loop is closed. On the diagonal of 19a, B11^-1 in our scan is read as B11 - 1 by eq 19",
        "none for the rank; order 2, as eq 11 neglects the second order; 0.05, since an order is a whole number",
        replace(near("independent left sides", 3.0, rank, 0.0), stated="three"),
        at_least("order of the sums of right sides", 1.95, order),
    )
    yield statement(
        "Equation set (20) does not include the constraint that the each diagonal element must be equal to unity at "
        "closure. This constraint is included through modification of the current set of equations as discussed in Sandor "
        "and Erdman (1984).",
        "section 2.6.1, eqs 20, 22, L429-436",
        "right sides of eqs 20 for a loop that is open by half a turn about i. Then, for an open loop for which the "
        "right sides of eqs 22 vanish, the greatest difference of a diagonal element from unity",
        ROUNDING,
        nothing("not in eqs 20: half a turn", half_turn[_BELOW]),
        nothing(f"in eqs 22: a loop open by {open_deg:.1f} deg", np.diag(open_22) - 1.0),
        why="eqs 22 exclude an opening of half a turn, but not every open loop",
    )
    yield statement(
        "Hence the modified form of equation (23) is as follows: [Delta = (A'A)^-1 A'V] which is exactly same as [Delta = "
        "A^-1 V].",
        "section 2.6.1, eq 23a, L459-463",
        "greatest difference of Delta by eq 23a from A^-1 V, with A^-1 (by L457 the pseudo-inverse) from singular values, "
        f"over the first corrections of a turn; {OPEN[0].name}, lengths in inches",
        ROUNDING,
        nothing("the two sides", _inverse_difference(OPEN[0])),
        why="A is 6 x 5, so that Delta need not satisfy eq 23 itself",
    )


def closure() -> StudyResult:
    """Compute the closure error at the end of the iteration over a turn, and judge the statements on the loop closure."""
    columns = {ANGLE: GRID_DEG}
    for case in OPEN:
        found = case_turn(case)
        columns[f"rotation left as printed; {case.name} [deg]"] = found.rotation_deg[:, 0]
        columns[f"error of S4 as printed; {case.name} [in]"] = found.error_in[:, 0]
        rotation, error, _ = _combined(case)
        for what, unit, values in (("rotation left", "deg", rotation), ("error of S4", "in", error)):
            name = f"{what} with Davidon Fletcher Powell; {case.name} [{unit}]"
            columns[name] = np.interp(GRID_DEG, GRID_DEG[::2], values)
    return StudyResult(
        claim="Rahman states: the iteration of section 2.6.1 finds theta2, eta2, theta3, eta3 and S4 for given theta1 and S1.",
        assignment=f"The iteration goes round the turn in steps of {STEP_DEG:g} deg. It starts from the planar estimate at "
        "theta1 = 0, and then from the solution at the previous angle. It settles when a correction is below "
        f"{STEP:g} rad and {STEP:g} in, within {MAX_STEPS} corrections. These numbers are our choice, since the "
        "thesis gives neither the step, the accuracy nor the number of corrections.",
        columns=pad_columns(columns),
        statements=(judge_detection(), *_matrices(), *_step(), *judge_ends(), *_limits(), *judge_convergence()),
    )


#: The study by its name.
STUDIES = {"rahman-closure": Study(ignore_changes(closure), draw)}
