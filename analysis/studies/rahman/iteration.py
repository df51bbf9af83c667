"""How the iteration of section 2.6 starts, converges and ends: sections 2.6.1, 2.6.2 and 3.3."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from linkwork.slider_crank.published import parameters

from ...numerics.dual import about_j, about_k
from ...slider_crank import Settled, close, greatest_shift, settle
from ...slider_crank.closure import chain, equations, planar, residuals
from ...units import INCH
from ..statements import FloatArray, Statement, at_least, at_most, statement
from .figures import ALL, CRANK, NOTHING, ROUNDING, full_name, nothing
from .method import OPEN, OUT, PLANE, ROD, case_turn
from .printed import GRID_DEG, MAX_STEPS, STEP, turn
from .table import IDEAL, Case

#: Planar mechanisms of section 3.1, and their names in the labels of cases.
PLANES = tuple(Case("", a4, 0.0, 270.0) for a4 in (0.0, 10.0, 20.0, 30.0))
IN_PLANE, OUT_OF_IT = "in the plane, a4 = 0, 10, 20, 30 in", f"out of the plane, the {len(OUT)} cases of the graphs"
#: A larger limit (rad, in) on a small step, for comparison: the thesis gives no limit.
LOOSE = 1e-3


def _detection_errors() -> tuple[float, float]:
    """Return the fractions of shifts at which the iteration fails, and at which it accepts an open loop.

    The crank turns fully at all of these shifts. They increase from 0 to the greatest such shift in steps of 2 in, at a4 = 0,
    10, 20 and 30 in. The iteration runs round the turn as in `turn`. It fails if it does not converge at one of the angles.
    It accepts an open loop if it converges at all angles and the loop is open at one of them.
    """
    missed: list[bool] = []
    wrong: list[bool] = []
    for a4 in (0.0, 10.0, 20.0, 30.0):
        p = parameters(a4)
        found = turn(p, np.arange(0.0, (greatest_shift(p) or 0.0) / INCH, 2.0))
        is_open = np.radians(found.rotation_deg).max(0) > NOTHING
        missed += np.logical_not(found.settled).tolist()
        wrong += np.logical_and(found.settled, is_open).tolist()
    return float(np.mean(missed)), float(np.mean(wrong))


def endings(cases: tuple[Case, ...], offs: tuple[float, ...] = (0.0,), small: float = STEP) -> list[Settled]:
    """Run the iteration for each case at every 30 deg, from planar estimates with errors in theta2 and theta3.

    The errors are all pairs of the ``offs`` (deg); the pair of zeros is left out if there are others. The iteration ends when
    a correction is below ``small`` (rad, in).
    """
    grid = np.radians(GRID_DEG[::6])
    pairs = [pair for pair in product(offs, offs) if any(pair) or len(offs) == 1]
    away = np.radians([[th2, 0.0, th3, 0.0, 0.0] for th2, th3 in pairs])
    ended = []
    for case in cases:
        p = parameters(case.offset_in, case.twist_deg)
        start = (planar(p, grid) + away[:, None]).reshape(-1, 5)
        angles, shift = np.tile(grid, len(pairs)), case.shift_in * INCH
        ended.append(settle(p, angles, shift, rows="printed", start=start, step_tolerance=small, max_steps=MAX_STEPS))
    return ended


def _steps_after_near_starts(case: Case, small: float) -> FloatArray:
    """Return the numbers of corrections at the crank angles where the iteration starts within 20 deg of its result."""
    found = case_turn(case, small)
    changes = np.degrees(np.abs(np.diff(found.unknowns[:, 0, :4], axis=0))).max(-1)
    return np.asarray(found.steps[1:, 0][changes <= 20.0])


def _estimate_error(case: Case) -> float:
    """Return the greatest difference (deg) between the planar estimate at theta1 = 0 and the angles of the closed loop.

    In the closed loop each ball joint has a third rotation, about i, after theta and eta.
    """
    p, zero = parameters(case.offset_in, case.twist_deg), np.zeros(1)
    closed = close(p, zero, case.shift_in * INCH)
    (rod,), (slider,) = closed.crank_ball, closed.slider_ball
    th2, eta2 = np.arctan2(rod[1, 0], rod[0, 0]), -np.arcsin(rod[2, 0])
    turned = (about_k(th2) @ about_j(eta2)).real.T @ rod @ slider
    found = [th2, eta2, np.arctan2(turned[1, 0], turned[0, 0]), -np.arcsin(turned[2, 0])]
    apart = np.degrees(found - planar(p, zero)[0, :4])
    return float(np.abs((apart + 180.0) % 360.0 - 180.0).max())


def _opening_of_estimates() -> float:
    """Return the greatest rotation (rad) or distance (m) by which the loop is open at the estimates of section 2.6.2."""
    zero, worst = np.zeros(1), 0.0
    for a4 in (0.0, 10.0, 20.0, 30.0):
        s4 = np.sqrt(ROD**2 - (CRANK + a4) ** 2)
        th2 = np.pi - np.arctan(s4 / (CRANK + a4))
        estimate = np.array([[th2, 0.0, 2.0 * np.pi - th2, 0.0, s4 * INCH]])
        worst = max(worst, *(float(left[0]) for left in residuals(chain(parameters(a4), zero, zero, estimate)[0])))
    return worst


def _condition(case: Case) -> float:
    """Return the least value, over the corrections of a turn, of the least singular value of A divided by the greatest.

    The corrections are those of `turn`, up to the first angle at which they do not become small.
    """
    p = parameters(case.offset_in, case.twist_deg)
    shift = np.array([case.shift_in * INCH])
    unit = np.array([1.0] * 4 + [INCH])
    unknowns, least = planar(p, np.radians(GRID_DEG[:1])), np.inf
    for angle in np.radians(GRID_DEG):
        for _ in range(MAX_STEPS):
            matrix, right = equations(*chain(p, np.array([angle]), shift, unknowns), INCH, "printed")
            singular = np.linalg.svd(matrix[0], compute_uv=False)
            least = min(least, float(singular[-1] / singular[0]))
            step = np.linalg.pinv(matrix[0]) @ right[0]
            unknowns = unknowns + step * unit
            if np.abs(step).max() <= STEP:
                break
        else:
            break
    return least


def judge_detection() -> Statement:
    """Judge whether the iteration detects that a solution is possible, as the abstract states."""
    missed, wrong = _detection_errors()
    return statement(
        "The approach is developed in such a manner that a digital computer can detect when a solution is "
        "possible and then solve the whole problem.",
        "abstract, L45",
        "shares of shifts at which the printed iteration fails, among the shifts at which the crank turns fully, in steps "
        "of 2 in from 0, at a4 = 0, 10, 20, 30 in. It starts from the planar estimate at theta1 = 0, and then from the "
        "solution at the previous angle (L465)",
        f"none for the shares; a loop is open above {NOTHING:g} rad, for rounding errors",
        # two digits: rounding errors change the second
        at_most("it fails to settle at some angle", 0.0, float(f"{missed:.2g}")),
        at_most("it settles, and a loop is open", 0.0, float(f"{wrong:.2g}")),
        why="the iteration settles where its steps become small, and this does not mean that the loop is closed (erratum 1). "
        "At a few of the shifts, such as 2 in at a4 = 0, rounding errors decide whether it settles, which changes the "
        "shares by up to 0.03",
    )


def _right_angle_condition() -> float:
    """Return the least singular value of A divided by the greatest, with the rod at right angles to the guide, a4 = a2 - a1."""
    p, zero = parameters(ROD - CRANK), np.zeros(1)
    matrix, _ = equations(*chain(p, zero, zero, planar(p, zero)), INCH, "printed")
    singular = np.linalg.svd(matrix[0], compute_uv=False)
    return float(singular[-1] / singular[0])


def judge_ends() -> Iterator[Statement]:
    """Judge the displacements at the end of the iteration, and the estimates at its start."""
    determined = []
    for case in (PLANE, *OPEN):
        found = case_turn(case)
        determined += [
            nothing(f"loop open, {case.name}", found.rotation_deg, "deg"),
            nothing(f"error of S4, {case.name}", found.error_in, "in"),
        ]
    yield statement(
        "The iterative process is continued until the absolute values of all error terms are less than or equal "
        "to the desired accuracy limits. At this point the displacements are determined only for the first "
        "position of the input link. ... This process is continued for a complete rotation of the input link, the crank.",
        "section 2.6.1, L465",
        "rotation by which the loop is open where the printed iteration ends, and error of S4 there, each the greatest of "
        "the turn",
        ROUNDING,
        *determined,
        why="erratum 1: small steps do not mean a closed loop",
    )
    yield statement(
        "From geometry the following formulas for the joint variables can be written.",
        "section 2.6.2, L483-491",
        "rotation (rad) and length (m) by which these formulas leave the planar loop open at theta1 = 0, a4 = 0, 10, 20, 30 in",
        "1e-12, for rounding errors",
        at_most("open", 1e-12, _opening_of_estimates()),
    )


def judge_convergence() -> Iterator[Statement]:
    """Judge what section 3.3 states about the starts, the number of iterations, and a singular matrix A."""
    poor, fair = (-120.0, -60.0, 60.0, 120.0, 180.0), (-20.0, -10.0, 0.0, 10.0, 20.0)
    flat, skew = endings(PLANES, poor), endings(OUT, poor)
    settled = {where: np.mean([x.settled for x in found]) for where, found in ((IN_PLANE, flat), (OUT_OF_IT, skew))}
    made = {
        f"{where}; to {small:g}": np.concatenate(steps)
        for small in (STEP, LOOSE)
        for where, steps in (
            (IN_PLANE, [found.steps for found in endings(PLANES, fair, small)]),
            (OUT_OF_IT, [_steps_after_near_starts(case, small) for case in OUT]),
        )
    }
    place = "section 3.3, L1131"
    yield statement(
        "The main disadvantage of this method is that if we can not make good initial estimates for joint "
        "displacements, ... the method will not converge.",
        place,
        "share of starts from which the iteration settles. The starts are planar estimates at every 30 deg of the "
        "crank, with theta2 and theta3 each changed by 60 or 120 deg either way or by 180 deg (our choice)",
        "none, since the sentence makes no exception",
        # two digits, here and in the next row: rounding errors change the second
        *(at_most(where, 0.0, float(f"{share:.2g}")) for where, share in settled.items()),
        why="it settles nevertheless, in the plane from about half of the starts on the wanted loop and from most others on "
        "that of the other assembly. Rounding errors decide at many starts: if the angles of all starts are changed by "
        "1e-10 deg, the iteration settles from 5% of those in the plane and 12% of those out of it only before or only "
        "after the change, and from about a quarter of all at another S4; the shares change by one or two hundredths",
    )
    yield statement(
        "Usually the process converges in 3 to 6 iterations if estimates are within 20 degrees, which is quite "
        "possible by using the direct formula for the planar case.",
        place,
        f"share of starts from which 3 to 6 corrections suffice, the last of them below {STEP:g} or {LOOSE:g} (rad, in; "
        "our choice). In the plane the starts are planar estimates at every 30 deg, with theta2 and theta3 each changed by "
        "0, 10 or 20 deg either way, but not both by 0; out of the plane they are the solutions at the previous angle, if "
        "within 20 deg. Then the greatest error of the planar estimates at theta1 = 0",
        "more than half of the starts, as *usually* says; 20 deg as stated",
        *(at_least(label, 0.5, float(f"{np.mean((steps >= 3) & (steps <= 6)):.2g}")) for label, steps in made.items()),
        *(at_most(f"estimates, {full_name(case)}", "20", _estimate_error(case), "deg") for case in OUT),
        why="out of the plane the result depends on the accuracy, which the thesis does not give. With a twist the planar "
        "estimate of eta2 is too far off. At a4 = 10 in, S1 = 3.5 in rounding errors decide a few of the counts, which "
        "changes the share to 0.001 by about a hundredth",
    )
    yield statement(
        "Another great disadvantage is that matrix A may become singular. Fortunately it never happened while "
        "running the program.",
        place,
        "least singular value of A divided by its greatest, with lengths in inches; the least over all corrections of a turn",
        ROUNDING,
        nothing("may: a4 = 38 in, rod at right angles to the guide", _right_angle_condition()),
        at_least("never: least of the ten cases of the graphs", NOTHING, min(map(_condition, (IDEAL, *ALL)))),
    )
