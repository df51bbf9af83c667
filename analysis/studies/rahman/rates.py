"""Verdicts on the velocities and accelerations of the joints: sections 2.7 and 2.8."""

from __future__ import annotations

import numpy as np

from linkwork.slider_crank.published import CRANK_SPEED, parameters

from ...numerics.dual import Dual, about_j, about_k, apply, axial
from ...slider_crank import settle
from ...slider_crank.closure import planar
from ...units import INCH
from ..rules import ABNORMAL, ABOUT_DEG, VERY_CLOSE_DEG
from ..statements import Statement, at_least, at_most, near, text
from ..study import Study, StudyResult, padded
from ..variation import unvaried
from .figures import (
    ALL,
    ANGLE,
    ANGLES_DEG,
    NOTHING,
    OFFSETS,
    ROUNDING,
    dead_centres_deg,
    full_name,
    nothing,
)
from .method import (
    AT_RATES,
    AWAY,
    CLEAR_SINE,
    MAYBE,
    MOVING,
    PLANE,
    ROW_F,
    FloatArray,
    H,
    difference,
    draw,
    followed,
    joints,
    links,
)
from .printed import (
    CRANK_AT_SPEED,
    GENERAL,
    GRID_DEG,
    MAX_STEPS,
    STEP_DEG,
    Crank,
    Joints,
    forward_rod_velocity,
    forward_slider_velocity,
    joint_accelerations,
    joint_rates,
    later,
    loop_rates,
    mended_row,
    separated_rates,
    velocities,
)
from .table import FAMILIES, IDEAL, Case


def row_f(case: Case) -> tuple[FloatArray, FloatArray]:
    """Return the residuals of eq 37f (in/s): as printed, NaN where eq 41 is unbounded, and with erratum 2 mended.

    Each residual has a value at every angle of the turn.
    """
    p, q = parameters(case.offset_in, case.twist_deg), joints(followed(case).unknowns[:, 0])
    lacking = loop_rates(CRANK_AT_SPEED, q, joint_rates(CRANK_AT_SPEED, q))[5]
    shift = np.full(GRID_DEG.size, case.shift_in * INCH)
    mended = mended_row(p, np.radians(GRID_DEG), shift, q, CRANK_SPEED)
    return np.where(np.abs(np.sin(q.th2)) > CLEAR_SINE, lacking, np.nan), mended


def _angular_velocity() -> float:
    """Return the error (rad/s) of eqs 30 and 31 as the angular velocity of Z(theta) Y(eta), by a difference quotient."""
    th, eta, th_rate, eta_rate = 0.8, 0.3, 1.7, -2.1
    before, now, after = (about_k(th + h * th_rate).real @ about_j(eta + h * eta_rate).real for h in (-H, 0.0, H))
    omega = axial(Dual((after - before) / (2.0 * H) @ now.T)).real
    return float(np.linalg.norm(omega - [0.0, eta_rate, th_rate]))


def _velocities() -> dict[str, float]:
    """Return the errors of eqs 33, 35, 36 and 45, by equation, compared with velocities transformed by matrices.

    The matrices are those of eqs 1 to 3, the velocities those of eqs 29 to 32.
    """
    r, (crank, rod, slider) = joint_rates(MOVING, GENERAL), links()
    of_crank, of_rod, _ = velocities(MOVING, GENERAL, r)
    forward = forward_rod_velocity(MOVING, GENERAL, r)
    first = Dual(np.array([0.0, 0.0, MOVING.speed]), np.array([0.0, 0.0, MOVING.shift_rate]))
    second, third = (Dual(np.array([0.0, eta, th])) for eta, th in ((r.eta2, r.th2), (r.eta3, r.th3)))
    back = Dual(np.zeros(3), np.array([0.0, 0.0, -float(r.s4)]))
    return {
        "eq 33": difference(of_crank, apply(crank.T, first)),
        "eqs 34, 35": difference(forward, apply(rod.T, of_crank + second)),
        "eq 36": difference(of_rod, apply(slider, back) - third),
        "eqs 44, 45": difference(forward_slider_velocity(MOVING, GENERAL, r), apply(slider.T, forward + third)),
    }


def _sinusoidal(ratio: float) -> tuple[float, float]:
    """Return the errors of eq 28a (in/s) and of eq 28b (in/s2) at alpha = ``ratio``.

    Eq 28a should be the rate of eq 28, and eq 28b the rate of eq 28a with its amplitude mended.
    """
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


def _rows(crank: Crank, q: Joints) -> tuple[FloatArray, FloatArray]:
    """Return the coefficients of the joint rates in eqs 37a to 37f, shape (6, 5), and the constant terms, shape (6,)."""
    right = loop_rates(crank, q, Joints(*np.zeros(5)))
    return np.stack([loop_rates(crank, q, Joints(*unit)) - right for unit in np.eye(5)], -1), right


def _printed_rates() -> tuple[Statement, ...]:
    """Judge eqs 28a to 31, 37 to 43 and 38a to 42a in a general position, with the shift in motion."""
    crank = MOVING
    matrix, right = _rows(crank, GENERAL)
    flat = joints(planar(parameters(PLANE.offset_in), np.array([1.0])) / [1.0, 1.0, 1.0, 1.0, INCH])
    at_rest = _rows(CRANK_AT_SPEED, Joints(*(x[0] for x in flat)))
    ranks = [
        int(np.linalg.matrix_rank(m)) for m in (matrix, np.column_stack([matrix, right]), np.column_stack(at_rest))
    ]
    solved, rates = Joints(*np.linalg.solve(matrix[:5], -right[:5])), joint_rates(crank, GENERAL)
    seconds = joint_accelerations(crank, GENERAL, rates)
    quicker, moved, _ = later(crank, GENERAL, rates, seconds)
    rough = max(abs(float(a - b.imag / 1e-20)) for a, b in zip(seconds, joint_rates(quicker, moved)))
    order = [Joints._fields.index(name) for name in ("th2", "th3", "eta2", "eta3", "s4")]
    eq_38 = separated_rates(crank, GENERAL) - np.column_stack([matrix[:, order], -right])
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
            "angular velocity by eq 30, whose form eq 31 has, less that of the matrix Z(theta) Y(eta) of eq 2, at theta = "
            "0.8, eta = 0.3 rad, with rates of 1.7 and -2.1 rad/s",
            ROUNDING,
            (nothing("angular velocity", _angular_velocity(), "rad/s"),),
            "erratum 2: eta turns about the axis j that theta has turned",
        ),
        Statement(
            "The dual velocity of point 3 on the connecting rod relative to the frame in terms of the unit vectors of the "
            "system {3} is determined by using this equation [34] and the transpose of equation (2):",
            text("section 2.7, eqs 33 to 36, 44, 45, L515-537, L587-591"),
            "difference from the matrices of eqs 1 to 3, or their transposes, times the velocities of eqs 29 to 32 and 31a, "
            "32a, added as the thesis says, in a general position with S1' = 1.3 in/s",
            ROUNDING,
            tuple(nothing(label, size, "in/s") for label, size in _velocities().items()),
            "with the velocities of eqs 30 and 31, which have erratum 2",
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
            "ranks of eqs 37a to 37f in a general position with S1' = 1.3 in/s, and in the plane, a4 = 10 in, theta1 = 1 rad, "
            "at constant shift; a solution needs equal ones",
            "none of a count",
            (
                near("coefficients", "5", ranks[0], 0.0),
                near("coefficients with the right side", 5.0, ranks[1], 0.0),
                near("coefficients with the right side, in the plane", 5.0, ranks[2], 0.0),
            ),
            "erratum 3: six equations for five unknowns, of which five are solved; in the plane the sixth is met as well",
        ),
        Statement(
            "The final solutions for all the unknowns are as follows:",
            text("section 2.7, eqs 39 to 43, L563-573"),
            "difference from the solution of eqs 37a to 37e in a general position with S1' = 1.3 in/s, and what "
            f"remains of eq 37f with the joints at which the printed iteration ends at every fifth degree, {AWAY}",
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
            "S1'' by eq 28b less the rate of eq 28a with its amplitude mended, angle and amplitude as in the row before, with "
            "a crank acceleration of 3 rad/s2",
            ROUNDING,
            tuple(nothing(f"alpha = {ratio:g}", slip, "in/s2") for ratio, (_, slip) in slips.items()),
        ),
        Statement(
            "Equations (69a) through (69q) involve acceleration terms which are obtained by differentiating "
            "equations (38) through (42) with respect to time. Hence the five acceleration equations are as follows:",
            text("section 2.8, eqs 38a to 42a, L1035-1045"),
            "greatest difference from the rates of eqs 39 to 43, which this sentence calls 38 to 42, in a general position "
            f"{AT_RATES}; S1'' has one dot in our scan, once in each equation: two are read, and the print may have them",
            ROUNDING,
            (nothing("eqs 38a to 42a", rough, "rad/s2 or in/s2"),),
            "as a derivative; 38a is the rate of eq 39 as printed and has its erratum 4. That accelerations enter 69a to 69q, "
            "by f1, f2 and f3, is plain",
        ),
    )


#: Distance (deg) from a zero of sin theta2 at which accelerations are taken.
BESIDE_DEG = 1e-3
#: Labels of the accelerations with the printed equations that give them, by the joint's name.
EQUATIONS = {
    "th2": "theta2'' by 38a",
    "th3": "theta3'' by 39a",
    "eta2": "eta2'' by 40a",
    "eta3": "eta3'' by 41a",
    "s4": "S4'' by 42a",
}


def _near_dead_centres(case: Case, q: Joints, angles_deg: FloatArray) -> dict[str, float]:
    """Return the greatest second rate of each joint within 10 deg of a dead centre, relative to the greatest elsewhere.

    The second rates are those of eqs 38a to 42a.
    """
    found = joint_accelerations(CRANK_AT_SPEED, q, joint_rates(CRANK_AT_SPEED, q))
    close_by = np.min([np.abs(angles_deg - at) for at in dead_centres_deg(case)], axis=0) < ABOUT_DEG
    sizes = {name: np.abs(second) for name, second in found._asdict().items()}
    return {
        name: float(x[close_by].max() / x[~close_by].max()) for name, x in sizes.items() if x[~close_by].max() > NOTHING
    }


def _ended(case: Case, angles_deg: FloatArray, start: FloatArray) -> FloatArray:
    """Return the unknowns (n, 5) at the end of the printed iteration at n crank angles, given a start for each angle."""
    p, unit = parameters(case.offset_in, case.twist_deg), [1.0, 1.0, 1.0, 1.0, INCH]
    shift = case.shift_in * INCH
    ended = settle(p, np.radians(angles_deg), shift, rows="printed", start=start * unit, max_steps=MAX_STEPS)
    return np.asarray(ended.unknowns / unit)


def _ended_on_turn(case: Case) -> FloatArray:
    """Return the unknowns at the end of the printed iteration at every half degree of a turn.

    The iteration starts from the solution at the last multiple of five degrees.
    """
    starts = np.repeat(followed(case).unknowns[:, 0], round(2.0 * STEP_DEG), axis=0)
    return _ended(case, ANGLES_DEG[:-1], starts)


def _zeros(case: Case, angles_deg: FloatArray, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the angles (deg) at which sin theta2 is zero in the printed iteration's results, and the unknowns there."""
    sine, step = np.sin(unknowns[:, 0]), np.diff(angles_deg).max()
    small = np.abs(sine) < CLEAR_SINE
    (at,) = np.nonzero((sine[:-1] * sine[1:] < 0.0) & small[:-1] & small[1:])
    zeros, start = angles_deg[at], unknowns[at]
    while step > 1e-5 * BESIDE_DEG:
        step *= 0.5
        before = np.sin(_ended(case, zeros + step, start)[:, 0]) * sine[at] > 0.0
        zeros = np.where(before, zeros + step, zeros)
    return zeros, start


def _beside_zeros(case: Case, angles_deg: FloatArray, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the angles (deg) `BESIDE_DEG` before and after each zero of sin theta2, and the unknowns there."""
    zeros, start = _zeros(case, angles_deg, unknowns)
    beside = np.concatenate([zeros - BESIDE_DEG, zeros + BESIDE_DEG])
    return beside, _ended(case, beside, np.tile(start, (2, 1)))


def _roundoff(q: Joints) -> float:
    """Return the greatest roundoff error of eqs 38a to 42a, relative to the greatest acceleration by the same equation.

    ``q`` are the joint values.
    """
    digit = np.spacing(2.0 * np.pi)
    short, long = (
        joint_accelerations(CRANK_AT_SPEED, at, joint_rates(CRANK_AT_SPEED, at))
        for at in (q, Joints(*(x.astype(np.longdouble) + digit for x in q)))
    )
    return max(float(np.abs(x - y).max() / np.abs(y).max()) for x, y in zip(short, long) if np.abs(y).max() > NOTHING)


def _dead_centres() -> tuple[Statement, ...]:
    """Judge the cause that section 3.2 gives for the spikes, in the plane and out of it."""
    cases = [Case(f"a4 = {a4:g} in, S1 = 0", a4, 0.0, 270.0) for a4 in (10.0, 20.0, 30.0)]
    twisted = [case for case in FAMILIES["twist"].cases if case.twist_deg != IDEAL.twist_deg]
    worst, least, rough, near_zero, high, whole = 0.0, np.inf, 0.0, [], [], []
    for case, shifted in zip(cases, OFFSETS):
        p, centres = parameters(case.offset_in), dead_centres_deg(case)
        q = joints(planar(p, np.radians(ANGLES_DEG)) / [1.0, 1.0, 1.0, 1.0, INCH])
        worst = max(worst, *_near_dead_centres(case, q, ANGLES_DEG).values())
        least = min(least, float(np.abs(np.sin(q.th3)).min()))
        th2 = np.degrees(planar(p, np.radians(centres))[:, 0]) % 360.0
        near_zero += [
            at_most(
                f"theta2 at the {which} spike, {case.name}", VERY_CLOSE_DEG, float(min(angle, 360.0 - angle)), "deg"
            )
            for which, angle in zip(("first", "second"), th2)
        ]
        angles, unknowns = ANGLES_DEG[:-1], _ended_on_turn(shifted)
        rough = max(rough, _roundoff(joints(unknowns)))
        whole.append(_near_dead_centres(shifted, joints(unknowns[::2]), angles[::2])["th2"])
        beside, closest = _beside_zeros(shifted, angles, unknowns)
        all_angles, q = np.append(angles, beside), joints(np.concatenate([unknowns, closest]))
        ratios = _near_dead_centres(shifted, q, all_angles)
        high += [
            at_least(f"{words}, {full_name(shifted)}", ABNORMAL, ratios[name]) for name, words in EQUATIONS.items()
        ]
    zeros = [
        near(f"sin theta2 = 0, {case.name}, {which}", stated, at, ABOUT_DEG, "deg")
        for case in (IDEAL, *cases, *twisted)
        for which, stated, at in zip(("first", "second"), ("100", "300"), dead_centres_deg(case))
    ]
    by_shift = max(np.abs(dead_centres_deg(case) - dead_centres_deg(case._replace(shift_in=0.0))).max() for case in ALL)
    by_iteration = [
        f"{first:.1f} and {second:.1f} deg with {case.name}"
        for case in twisted
        for first, second in [_zeros(case, ANGLES_DEG[:-1], _ended_on_turn(case))[0]]
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
            "which sin theta2 vanishes, which stands in the denominators of 40a and 41a, on the right mechanism, with a twist "
            "at a4 = 20 in, S1 = 0; least distance of theta3 from 0 or half a turn, since its sine stands in all five",
            f"none of a count; {ABOUT_DEG:g} deg, the rule for *near*; {VERY_CLOSE_DEG:g} deg, the rule for *very close*",
            (
                near("sines and cosines in denominators", 0.0, 0, 0.0),
                *zeros,
                at_most(
                    "theta3 from 0 or half a turn, a4 = 10, 20, 30 in, S1 = 0, least",
                    VERY_CLOSE_DEG,
                    np.degrees(np.arcsin(least)),
                    "deg",
                ),
            ),
            "theta2 is 0 or half a turn at the dead centres, which the offset and the twist move, and the shifts of the graphs "
            f"by at most {by_shift:.1f} deg; where the printed iteration ends with a twist, sin theta2 vanishes at "
            f"{' and at '.join(by_iteration)}, none of them near. "
            "Sin theta3 does not vanish, so that 39a and 42a stay finite. Out of the plane 40a and 41a are unbounded, and with "
            "them 38a, because eq 41 divides by sin theta2 and row 37f is left out "
            "(erratum 3); in the plane 40a and 41a are zero",
        ),
        Statement(
            "Using the computer program it has been observed that near those particular values for input crank "
            "angle, the joint angle [theta2] goes very close to zero degrees and thus the calculated values of the "
            "acceleration terms, at those particular positions, go abnormally high on account of roundoff errors in "
            "the computer calculations, which is clearly inaccurate.",
            place,
            "distance of theta2 from 0 at the dead centres; greatest accelerations, at half degrees, within "
            f"{ABOUT_DEG:g} deg of a dead centre relative to those elsewhere: in the plane, where 40a and 41a are zero, and "
            f"where the printed iteration ends, there {BESIDE_DEG:g} deg, our choice, before and after each zero of sin theta2 "
            "too; there, at half degrees, also the greatest share of the greatest acceleration that is roundoff, by numbers "
            "with three digits more and joints off by the last digit of a turn",
            f"{VERY_CLOSE_DEG:g} deg, the rule for *very close*; {ABNORMAL:g} times, the rule for *abnormally*; half of it, "
            "for *on account of*",
            (
                *near_zero,
                at_least("in the plane, by 38a, 39a, 42a", ABNORMAL, worst),
                *high,
                at_least("share that is roundoff", 0.5, rough),
            ),
            "at the second spike theta2 is half a turn. Out of the plane 40a and 41a grow without bound there, and with them "
            "38a, but not by roundoff, here in double precision (the thesis does not say which it used): eq 41 divides by sin "
            "theta2, and row 37f is left out (erratum 3); at whole degrees 38a is abnormal with a4 = 10 in alone of these "
            f"three ({whole[0]:.1f}; {whole[1]:.2f} and {whole[2]:.2f} with 20 and 30 in). 39a and 42a stay finite, as all "
            "five are in the plane: the spikes of the forces come from the torque, which has no lever on the slider there",
        ),
    )


def rates() -> StudyResult:
    """Compute the joint rates as printed, and the residual of the equation 37f that is not solved."""
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


#: The study by its name.
STUDIES = {"rahman-rates": Study("rahman-rates", unvaried(rates), draw)}
