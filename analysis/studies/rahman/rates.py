"""Verdicts on the velocities and accelerations of the joints: sections 2.7 and 2.8."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from linkwork.slider_crank.published import CRANK_SPEED, parameters

from ...numerics.dual import Dual, about_j, about_k, apply, axial
from ...slider_crank import settle
from ...slider_crank.closure import planar
from ...units import INCH
from ..rules import ABNORMAL, ABOUT_DEG, VERY_CLOSE_DEG
from ..statements import FloatArray, Statement, at_least, at_most, near, statement
from ..study import Study, StudyResult, pad_columns
from ..variation import ignore_changes
from . import method, printed
from .figures import ANGLE, ANGLES_DEG, NOTHING, OFFSETS, ROUNDING, dead_centres_deg, full_name, nothing
from .table import IDEAL, SPIKES_DEG, Case


def row_f(case: Case) -> tuple[FloatArray, FloatArray]:
    """Return the residuals of eq 37f (in/s): as printed, NaN where eq 41 is unbounded, and with erratum 2 mended.

    Each residual has a value at every angle of the turn.
    """
    p, q = parameters(case.offset_in, case.twist_deg), method.joints(method.case_turn(case).unknowns[:, 0])
    lacking = printed.loop_rates(printed.CRANK_AT_SPEED, q, printed.joint_rates(printed.CRANK_AT_SPEED, q))[5]
    shift = np.full(printed.GRID_DEG.size, case.shift_in * INCH)
    mended = printed.mended_row(p, np.radians(printed.GRID_DEG), shift, q, CRANK_SPEED)
    return np.where(np.abs(np.sin(q.th2)) > method.CLEAR_SINE, lacking, np.nan), mended


def _angular_velocity() -> float:
    """Return the error (rad/s) of eqs 30 and 31 as the angular velocity of Z(theta) Y(eta), by a difference quotient."""
    th, eta, th_rate, eta_rate = 0.8, 0.3, 1.7, -2.1
    before, now, after = (
        about_k(th + h * th_rate).real @ about_j(eta + h * eta_rate).real for h in (-method.H, 0.0, method.H)
    )
    omega = axial(Dual((after - before) / (2.0 * method.H) @ now.T)).real
    return float(np.linalg.norm(omega - [0.0, eta_rate, th_rate]))


def _velocities() -> dict[str, float]:
    """Return the errors of eqs 33, 35, 36 and 45, by equation, compared with velocities transformed by matrices.

    The matrices are those of eqs 1 to 3, the velocities those of eqs 29 to 32.
    """
    r, (crank, rod, slider) = printed.joint_rates(method.MOVING, printed.GENERAL), method.links()
    of_crank, of_rod, _ = printed.velocities(method.MOVING, printed.GENERAL, r)
    forward = printed.forward_rod_velocity(method.MOVING, printed.GENERAL, r)
    first = Dual(np.array([0.0, 0.0, method.MOVING.speed]), np.array([0.0, 0.0, method.MOVING.shift_rate]))
    second, third = (Dual(np.array([0.0, eta, th])) for eta, th in ((r.eta2, r.th2), (r.eta3, r.th3)))
    back = Dual(np.zeros(3), np.array([0.0, 0.0, -float(r.s4)]))
    return {
        "eq 33": method.difference(of_crank, apply(crank.T, first)),
        "eqs 34, 35": method.difference(forward, apply(rod.T, of_crank + second)),
        "eq 36": method.difference(of_rod, apply(slider, back) - third),
        "eqs 44, 45": method.difference(
            printed.forward_slider_velocity(method.MOVING, printed.GENERAL, r), apply(slider.T, forward + third)
        ),
    }


def _sinusoidal() -> tuple[float, float]:
    """Return the errors of eq 28a (in/s) and of eq 28b (in/s2) at alpha = 2.

    Eq 28a should be the rate of eq 28, and eq 28b the rate of eq 28a with its amplitude mended.
    """
    ratio, amplitude, angle, speed, acceleration, h = 2.0, 2.0, method.AT, CRANK_SPEED, 3.0, 1e-20
    # derivatives along the motion by a complex step, which has no rounding error
    moved, quicker = angle + 1j * h * speed, speed + 1j * h * acceleration
    shift = amplitude * np.sin(ratio * moved)
    rate = ratio * amplitude * np.cos(ratio * moved) * quicker
    printed_rate = ratio * shift.real * np.cos(ratio * angle) * speed
    printed_second = (
        ratio * amplitude * (np.cos(ratio * angle) * acceleration - ratio * np.sin(ratio * angle) * speed**2)
    )
    return float(printed_rate - shift.imag / h), float(printed_second - rate.imag / h)


def _rows(crank: printed.Crank, q: printed.Joints) -> tuple[FloatArray, FloatArray]:
    """Return the coefficients of the joint rates in eqs 37a to 37f, shape (6, 5), and the constant terms, shape (6,)."""
    right = printed.loop_rates(crank, q, printed.Joints(*np.zeros(5)))
    return np.stack([printed.loop_rates(crank, q, printed.Joints(*unit)) - right for unit in np.eye(5)], -1), right


def _frame_velocities() -> Iterator[Statement]:
    """Judge the velocities of eqs 30 to 36, 44 and 45."""
    yield statement(
        "where symbols [eta2'] and [theta2'] denote rotational velocities about the [j2] and [k2] axes at joint 2 "
        "respectively.",
        "section 2.7, eqs 30, 31, L503-509",
        "angular velocity by eq 30 (eq 31 has the same form) minus that of the matrix Z(theta) Y(eta) of eq 2, at theta "
        "= 0.8 rad, eta = 0.3 rad, with rates of 1.7 and -2.1 rad/s",
        ROUNDING,
        nothing("angular velocity", _angular_velocity(), "rad/s"),
        why="erratum 2: eta turns about the axis j after theta has turned this axis",
    )
    yield statement(
        "The dual velocity of point 3 on the connecting rod relative to the frame in terms of the unit vectors of the "
        "system {3} is determined by using this equation [34] and the transpose of equation (2):",
        "section 2.7, eqs 33 to 36, 44, 45, L515-537, L587-591",
        "difference from the matrices of eqs 1 to 3, or their transposes, times the velocities of eqs 29 to 32 and 31a, "
        "32a, added as the thesis says, in a general position with S1' = 1.3 in/s",
        ROUNDING,
        *(nothing(label, size, "in/s") for label, size in _velocities().items()),
        why="with the velocities of eqs 30 and 31, which have erratum 2",
    )


def _solved() -> Iterator[Statement]:
    """Judge eqs 38 to 43 by comparison with eqs 37a to 37f, in a general position with the shift in motion."""
    matrix, right = _rows(method.MOVING, printed.GENERAL)
    found = printed.joint_rates(method.MOVING, printed.GENERAL)
    order = [printed.Joints._fields.index(name) for name in ("th2", "th3", "eta2", "eta3", "s4")]
    eq_38 = printed.separated_rates(method.MOVING, printed.GENERAL) - np.column_stack([matrix[:, order], -right])
    errors = [
        nothing(name, rate - solved, "in/s" if "S4" in name else "rad/s", why="erratum 4: no cos^2 eta2")
        for name, rate, solved in zip(
            ("theta2' by eq 39", "eta2' by eq 41", "theta3' by eq 40", "eta3' by eq 42", "S4' by eq 43"),
            found,
            np.linalg.solve(matrix[:5], -right[:5]),
        )
    ]
    yield statement(
        "Now separating the unknowns to form a column matrix and a coefficient matrix, the product of these two "
        "matrices must be equal to some column matrix as shown below:",
        "section 2.7, eq 38, L559-561",
        "coefficients and right side of eq 38 minus those of eqs 37a to 37f, in a general position with S1' = 1.3 in/s",
        ROUNDING,
        nothing("coefficients, and right side of rows 1 to 5", [*eq_38[:, :5].ravel(), *eq_38[:5, 5]]),
        method.unsure("right side of row 6", "sin theta2 for sin theta2 sin eta2", eq_38[5, 5], "in/s"),
    )
    yield statement(
        "Since rank of the coefficient matrix equals 5, the number of columns, a unique solution can be obtained.",
        "section 2.7, L563",
        "rank of the coefficients of eqs 37a to 37f without and with the right side, in a general position with S1' = "
        "1.3 in/s; a solution exists only if the two ranks are equal",
        "none, since counts are exact",
        near("coefficients", "5", np.linalg.matrix_rank(matrix), 0.0),
        near("coefficients with the right side", 5.0, np.linalg.matrix_rank(np.column_stack([matrix, right])), 0.0),
        why="erratum 3: there are six equations for five unknowns, and only five of them are solved",
    )
    yield statement(
        "The final solutions for all the unknowns are as follows:",
        "section 2.7, eqs 39 to 43, L563-573",
        "difference from the solution of eqs 37a to 37e, and what remains of eq 37f, in a general position with S1' = 1.3 in/s",
        ROUNDING,
        *errors,
        nothing(
            "row 37f",
            printed.loop_rates(method.MOVING, printed.GENERAL, found)[5],
            "in/s",
            why="erratum 3: it is left unsolved",
        ),
    )


def _derivatives() -> Iterator[Statement]:
    """Judge eqs 28a, 28b and 38a to 42a as derivatives."""
    of_28a, of_28b = _sinusoidal()
    found = printed.joint_rates(method.MOVING, printed.GENERAL)
    seconds = printed.joint_accelerations(method.MOVING, printed.GENERAL, found)
    quicker, moved, _ = printed.state_later(method.MOVING, printed.GENERAL, found, seconds)
    rough = max(abs(float(a - b.imag / 1e-20)) for a, b in zip(seconds, printed.joint_rates(quicker, moved)))
    yield statement(
        "S1' = alpha S1 cos(alpha theta1) theta1' [when S1 is sinusoidal] (28a)",
        "section 2.7, eq 28a, L581; L583, in brackets, says what it is the derivative of",
        "S1' by eq 28a minus the rate of eq 28, at theta1 = 0.9 rad with alpha = 2, an amplitude of 2 in and the "
        "50 rpm of L1075",
        ROUNDING,
        method.unsure("eq 28a", "S1 for its amplitude S_S1", of_28a, "in/s"),
    )
    yield statement(
        "S1'' = alpha S_S1 [cos(alpha theta1) theta1'' - alpha sin(alpha theta1) theta1'^2] (28b)",
        "section 2.8, eq 28b, L955; L957, in brackets, says what it is the derivative of",
        "S1'' by eq 28b minus the rate of eq 28a with its amplitude mended, at the values of the row before, with a "
        "crank acceleration of 3 rad/s2",
        ROUNDING,
        nothing("eq 28b", of_28b, "in/s2"),
    )
    yield statement(
        "Equations (69a) through (69q) involve acceleration terms which are obtained by differentiating "
        "equations (38) through (42) with respect to time. Hence the five acceleration equations are as follows:",
        "section 2.8, eqs 38a to 42a, L1035-1045",
        "greatest difference from the rates of eqs 39 to 43, which this sentence calls 38 to 42, in a general position "
        f"{method.AT_RATES}; {method.DOTS}",
        ROUNDING,
        nothing("eqs 38a to 42a", rough, "rad/s2 or in/s2"),
        why="38a is the rate of eq 39 as printed and has its erratum 4",
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


def _near_dead_centres(case: Case, q: printed.Joints, angles_deg: FloatArray) -> dict[str, float]:
    """Return the greatest second rate of each joint within 10 deg of a dead centre, relative to the greatest elsewhere.

    The second rates are those of eqs 38a to 42a.
    """
    found = printed.joint_accelerations(printed.CRANK_AT_SPEED, q, printed.joint_rates(printed.CRANK_AT_SPEED, q))
    is_close = np.min([np.abs(angles_deg - at) for at in dead_centres_deg(case)], axis=0) < ABOUT_DEG
    sizes = {name: np.abs(second) for name, second in found._asdict().items()}
    return {
        name: float(x[is_close].max() / x[~is_close].max()) for name, x in sizes.items() if x[~is_close].max() > NOTHING
    }


def _iteration_end(case: Case, angles_deg: FloatArray, start: FloatArray) -> FloatArray:
    """Return the unknowns (n, 5) at the end of the printed iteration at n crank angles, given a start for each angle."""
    p, unit = parameters(case.offset_in, case.twist_deg), [1.0, 1.0, 1.0, 1.0, INCH]
    shift = case.shift_in * INCH
    ended = settle(p, np.radians(angles_deg), shift, rows="printed", start=start * unit, max_steps=printed.MAX_STEPS)
    return np.asarray(ended.unknowns / unit)


def _iteration_end_on_turn(case: Case) -> FloatArray:
    """Return the unknowns at the end of the printed iteration at every half degree of a turn.

    The iteration starts from the solution at the last multiple of five degrees.
    """
    starts = np.repeat(method.case_turn(case).unknowns[:, 0], round(2.0 * printed.STEP_DEG), axis=0)
    return _iteration_end(case, ANGLES_DEG[:-1], starts)


def _zeros(case: Case, angles_deg: FloatArray, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the angles (deg) at which sin theta2 is zero in the printed iteration's results, and the unknowns there."""
    sine, step = np.sin(unknowns[:, 0]), np.diff(angles_deg).max()
    small = np.abs(sine) < method.CLEAR_SINE
    (at,) = np.nonzero((sine[:-1] * sine[1:] < 0.0) & small[:-1] & small[1:])
    zeros, start = angles_deg[at], unknowns[at]
    while step > 1e-5 * BESIDE_DEG:
        step *= 0.5
        before = np.sin(_iteration_end(case, zeros + step, start)[:, 0]) * sine[at] > 0.0
        zeros = np.where(before, zeros + step, zeros)
    return zeros, start


def _beside_zeros(case: Case, angles_deg: FloatArray, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the angles (deg) `BESIDE_DEG` before and after each zero of sin theta2, and the unknowns there."""
    zeros, start = _zeros(case, angles_deg, unknowns)
    beside = np.concatenate([zeros - BESIDE_DEG, zeros + BESIDE_DEG])
    return beside, _iteration_end(case, beside, np.tile(start, (2, 1)))


def _roundoff(q: printed.Joints) -> float:
    """Return the greatest roundoff error of eqs 38a to 42a, relative to the greatest acceleration by the same equation.

    ``q`` are the joint values.
    """
    digit = np.spacing(2.0 * np.pi)
    short, long = (
        printed.joint_accelerations(printed.CRANK_AT_SPEED, at, printed.joint_rates(printed.CRANK_AT_SPEED, at))
        for at in (q, printed.Joints(*(x.astype(np.longdouble) + digit for x in q)))
    )
    return max(float(np.abs(x - y).max() / np.abs(y).max()) for x, y in zip(short, long) if np.abs(y).max() > NOTHING)


def _denominators() -> Statement:
    """Judge where the sines in the denominators of eqs 38a to 42a vanish, in the plane."""
    planes = (IDEAL, *(Case(f"a4 = {a4:g} in, S1 = 0", a4, 0.0, 270.0) for a4 in (10.0, 20.0, 30.0)))
    zeros = [
        near(f"sin theta2 = 0, {case.name}, {which}", stated, at, ABOUT_DEG, "deg")
        for case in planes
        for which, stated, at in zip(("first", "second"), ("100", "300"), dead_centres_deg(case))
    ]
    sines = [np.sin(planar(parameters(case.offset_in), np.radians(ANGLES_DEG))[:, 2]) for case in planes]
    return statement(
        "Although all the dynamic equations ((68a) through (68g) and (68i) through (68q)) are free from sine or "
        "cosine terms in the denominator, the expressions for acceleration (equation (38a) through (42a)) are "
        "not free from sine terms which become very very close to zero at some particular positions of the "
        "crank, i.e. near 100 degrees and 300 degrees.",
        "section 3.2, L1115",
        "number of sines and cosines in the denominators of the equations printed as 69a to 69g and 69i to 69q. Then, in "
        "the plane, the crank angles at which sin theta2, a divisor in 40a and 41a, vanishes. Then the least distance of "
        "theta3, whose sine is a divisor in all five, from 0 or half a turn, over the whole turn in the plane",
        f"none for a count; {ABOUT_DEG:g} deg, the rule for *near*; {VERY_CLOSE_DEG:g} deg, the rule for *very close*",
        near("sines and cosines in denominators", 0.0, 0, 0.0),
        *zeros,
        at_most("theta3 from 0 or half a turn", VERY_CLOSE_DEG, np.degrees(np.arcsin(np.abs(sines).min())), "deg"),
        why="theta2 is 0 or half a turn at the dead centres, and the offset moves the dead centres. The only divisor "
        "printed in 38a, 39a and 42a is sin theta3, which is never close to zero",
    )


def _abnormal() -> Statement:
    """Judge the cause that section 3.2 gives for the spikes, in the case whose dead centres lie near 100 and 300 deg."""
    case, angles = OFFSETS[1], ANGLES_DEG[:-1]
    unknowns = _iteration_end_on_turn(case)
    beside, closest = _beside_zeros(case, angles, unknowns)
    ratios = _near_dead_centres(case, method.joints(np.concatenate([unknowns, closest])), np.append(angles, beside))
    th2 = np.abs((np.degrees(closest[: closest.shape[0] // 2, 0]) + 180.0) % 360.0 - 180.0)
    return statement(
        "Using the computer program it has been observed that near those particular values for input crank "
        "angle, the joint angle [theta2] goes very close to zero degrees and thus the calculated values of the "
        "acceleration terms, at those particular positions, go abnormally high on account of roundoff errors in "
        "the computer calculations, which is clearly inaccurate.",
        "section 3.2, L1115",
        f"{full_name(case)}, where the printed iteration ends. First theta2 at {BESIDE_DEG:g} deg (our choice) before the "
        f"angles at which its sine vanishes. Then the greatest acceleration within {ABOUT_DEG:g} deg of a dead centre, "
        f"relative to the greatest elsewhere, at every half degree and at {BESIDE_DEG:g} deg before and after those angles. "
        "Last the greatest roundoff of an acceleration in double precision, at every half degree, relative to the greatest "
        "acceleration by the same equation",
        f"{VERY_CLOSE_DEG:g} deg, the rule for *very close*; {ABNORMAL:g} times, the rule for *abnormally*; a share of one "
        "half, our choice, for *on account of*",
        *(at_most(f"theta2 near {spike:g} deg", VERY_CLOSE_DEG, at, "deg") for spike, at in zip(SPIKES_DEG, th2)),
        *(at_least(words, ABNORMAL, ratios[name]) for name, words in EQUATIONS.items()),
        at_least("share that is roundoff", 0.5, _roundoff(method.joints(unknowns))),
        why="38a, 40a and 41a are unbounded because eqs 41 and 42 divide by sin theta2; roundoff is not the cause",
    )


def rates() -> StudyResult:
    """Compute the joint rates as printed, and the residual of the equation 37f that is not solved."""
    columns = {ANGLE: printed.GRID_DEG}
    for case in method.ROW_F:
        lacking, mended = row_f(case)
        columns[f"opening of the loop as printed; {case.name} [in/s]"] = lacking
        columns[f"opening of the loop mended; {case.name} [in/s]"] = mended
    return StudyResult(
        claim="Rahman states: eqs 39 to 43 give all velocities of the joints, and eqs 38a to 42a their accelerations.",
        columns=pad_columns(columns),
        statements=(*_frame_velocities(), *_solved(), *_derivatives(), _denominators(), _abnormal()),
    )


#: The study by its name.
STUDIES = {"rahman-rates": Study(ignore_changes(rates), method.draw)}
