"""Verdicts on Rahman's method: loop closure and its iteration, rates, force equations in the plane.

`printed` has the equations to the letter. They are compared with other formulations: dual matrices, difference quotients,
the plant. The errata are numbered as in docs/rahman.md.
"""

from __future__ import annotations

from functools import cache, partial
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.slider_crank.published import CRANK_SPEED, parameters

from ...figures import Curve, Figure, Panel, plot_curves
from ...numerics.dual import Dual, about_i, about_j, about_k, axial
from ...slider_crank import CLEAR_DEG, Settled, assembly_margin, constant_shift, greatest_shift, settle
from ...slider_crank.closure import Rows, chain, equations, freedoms, planar, residuals
from ...units import INCH
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, near, padded, text, unjudged
from .figures import ANGLE, ANGLES_DEG, CRANK, NOTHING, TORQUE, clear, dead_centres_deg, printed, printed_symbol, values
from .printed import (
    GRID_DEG,
    Crank,
    Joints,
    Turn,
    bodies,
    joint_accelerations,
    joint_forces,
    joint_rates,
    loop_rates,
    mended_row,
    on_crank,
    turn,
)
from .table import COMPONENTS, GREATEST_SHIFTS_IN, SHIFTS_REACHED_IN, TWISTS_REACHED_DEG, Case

FloatArray = NDArray[np.float64]

#: Length of the rod (in), and the crank as the equations have it.
ROD = 50.0
CRANK_AT_SPEED = Crank(CRANK, ROD, CRANK_SPEED)
#: Cases whose loops are followed, and what the iteration leaves by an independent reconstruction: rotation (deg), error (in).
OPEN = {
    Case("a4 = 10 in at S1 = 3.5 in", 10.0, 3.5, 270.0): (27.02, 5.88),
    Case("alpha4 = 232 deg", 20.0, 0.0, 232.0): (37.84, 3.78),
    Case("alpha4 = 310 deg", 20.0, 0.0, 310.0): (37.90, 2.74),
}
#: Results of other iterations for the first case: equations used, start from the previous angle or not, and digits given.
VARIANTS: tuple[tuple[str, Rows, bool, float, float, float], ...] = (
    ("from the planar estimate at every angle", "printed", False, 23.0, 4.62, 0.05),
    ("without the diagonal of eq 22", "upper", True, 20.3, 2.31, 0.05),
    ("by all eighteen equations", "all", True, 20.26, 1.71, 0.005),
)
#: Cases for row 37f, with its residuals (in/s) by an independent reconstruction: as printed where |sin theta2| is above
#: `CLEAR_SINE`, since eq 41 divides by it, and with erratum 2 mended.
ROW_F = {
    Case("a4 = 30 in at S1 = 9 in", 30.0, 9.0, 270.0): (84.0, 40.0),
    Case("alpha4 = 310 deg", 20.0, 0.0, 310.0): (215.0, 66.0),
}
CLEAR_SINE = 0.15
#: A configuration in general position, with its theta2' (rad/s) as printed and by an independent derivation.
GENERAL = Joints(*(np.array(value) for value in (2.1, 0.35, -1.3, 0.2, 40.0)))
THETA2_RATE_PRINTED, THETA2_RATE = -4.3389, -4.3743
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


def _nothing(name: str, size: ArrayLike, unit: str, place: str, why: str = "") -> Verdict:
    """Judge that a quantity vanishes, usually the difference between an equation and its correct value."""
    return near(name, text(place), 0.0, float(np.abs(size)), NOTHING, unit, why=why)


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


def _limits() -> list[Verdict]:
    """Judge the stated limits of the iteration, and show that they are not limits of the mechanism."""
    place = "section 3.2, L1121"
    within = "the thesis does not say how many corrections it allows"
    rounding = "where the iteration ends there depends on rounding: 1e-9 in more or less of S1 decide it"
    verdicts = [
        unjudged(statement, text(place), rounding)
        for statement in (
            f"the iteration converges up to S1 = {SHIFTS_REACHED_IN[0.0]:g} in at a4 = 0",
            "beyond its limits closure is lost, or the slider goes to the opposite side",
        )
    ]
    for a4, stated in tuple(SHIFTS_REACHED_IN.items())[1:]:
        settled = turn(parameters(a4), stated + np.array([0.0, 0.5, 1.0])).settled
        reached = stated + 0.5 * (int(np.cumprod(settled).sum()) - 1)
        name = f"greatest S1, by halves, at which the printed iteration settles, to within 1 in; a4 = {a4:g} in"
        verdicts.append(near(name, text(place), stated, reached, 1.0, "in", why=within))
    for which, stated, way in zip(("least", "greatest"), TWISTS_REACHED_DEG, (-1.0, 1.0)):
        reached = stated
        while turn(parameters(20.0, reached + way), 0.0).settled.all():
            reached += way
        name = f"{which} alpha4, by degrees, at which the printed iteration settles, to within 1 deg"
        why = within if reached != stated else ""
        verdicts.append(near(name, text(place), stated, reached, 1.0, "deg", why=why))
    shifts = {a4: (greatest_shift(parameters(a4)) or 0.0) / INCH for a4 in GREATEST_SHIFTS_IN}
    for a4, stated in SHIFTS_REACHED_IN.items():
        name, why = f"greatest S1 at which the mechanism works; a4 = {a4:g} in", "a limit of the iteration alone"
        verdicts.append(near(name, text(place), stated, shifts[a4], 0.5, "in", why=why))
    gain = min(after - before for before, after in pairwise(shifts.values()))
    name = "gain of the greatest S1 from one a4 to the next, least of all"
    verdicts.append(at_least(name, text(place), 0.0, gain, "in", why="it falls with a4"))
    rest, (least, most) = constant_shift(0.0), TWISTS_REACHED_DEG
    margins = [assembly_margin(parameters(20.0, twist), rest).length / INCH for twist in range(0, 360, 5)]
    name, works = "range of alpha4 in which the mechanism works", 5.0 * sum(margin > 0.0 for margin in margins)
    why = "it turns fully at every alpha4"
    verdicts.append(near(name, text(place), most - least, works, 5.0, "deg", why=why))
    verdicts.append(at_least("least margin of assembly at every 5 deg of alpha4", OURS, 0.0, min(margins), "in"))
    return verdicts + [
        near(f"greatest S1 at which the crank turns fully; a4 = {a4:g} in", OURS, stated, shifts[a4], 5e-4, "in")
        for a4, stated in GREATEST_SHIFTS_IN.items()
    ]


def _in_the_plane() -> list[Verdict]:
    """Judge the planar mechanism, for which the chain is right."""
    offsets, grid, zero = (0.0, 10.0, 20.0, 30.0), np.radians(GRID_DEG), np.zeros(1)
    flat = [followed(Case("", a4, 0.0, 270.0)) for a4 in offsets]
    loops = []
    for a4 in offsets:
        s4 = np.sqrt(ROD**2 - (CRANK + a4) ** 2)
        th2 = np.pi - np.arctan(s4 / (CRANK + a4))
        estimate = np.array([[th2, 0.0, 2.0 * np.pi - th2, 0.0, s4 * INCH]])
        loops += [float(left[0]) for left in residuals(chain(parameters(a4), zero, zero, estimate)[0])]

    def ended(off: float) -> list[Settled]:
        """Run the iteration from estimates of theta2 and theta3 that are off by given angles (deg)."""
        away = np.radians([off, 0.0, -off, 0.0, 0.0])
        planes = [parameters(a4) for a4 in offsets]
        return [settle(p, grid, 0.0, rows="printed", start=planar(p, grid) + away) for p in planes]

    close_by, far = [np.concatenate([found.steps for found in ended(20.0)])], ended(120.0)
    settled = float(np.mean([found.settled for found in far]))
    place, many, what = "section 3.3, L1131", "corrections at an angle", "angles at which the iteration settles"
    outside, why = max(float(np.nanmax(followed(case).steps)) for case in OPEN), "there is no loop to converge to"
    rows = (
        ("loop open at the estimate for theta1 = 0", 1e-12, max(loops), "", "section 2.6.2, L485-491", ""),
        ("error of S4 in the plane", 1e-9, max(np.max(t.error_in) for t in flat), "in", "section 3.2, L1111", ""),
        (f"most {many}, in the plane", 6.0, max(np.max(t.steps) for t in flat), "", place, ""),
        (f"most {many}, in the plane, from estimates 20 deg off", 6.0, np.max(close_by), "", place, ""),
        (f"most {many}, outside the plane", 6.0, outside, "", place, why),
        (f"share of {what} from estimates 120 deg off", 0.0, settled, "", place, "it does, on another loop"),
    )
    least = f"fewest {many}, in the plane, from estimates 20 deg off"
    return [
        at_least(least, text(place), 3.0, np.min(close_by)),
        *(at_most(name, text(where), most, size, unit, why=why) for name, most, size, unit, where, why in rows),
    ]


def closure() -> StudyResult:
    """Compute the iteration and the closure error at which it ends."""
    columns, verdicts = {ANGLE: GRID_DEG}, []
    name, why = "freedoms of the chain, of which theta1 and S1 are given", "erratum 1: two rotations to a ball joint"
    (first, *_) = OPEN
    p, ended = parameters(first.offset_in), followed(first).unknowns[4, 0] * [1.0, 1.0, 1.0, 1.0, INCH]
    left = freedoms(p, float(np.radians(GRID_DEG[4])), first.shift_in * INCH, ended)
    verdicts.append(near(name, text("eqs 1 to 5, L193, L358, L465-471"), 2.0, left, 0.0, why=why))
    name = "operators times matrices less difference quotients"
    verdicts.append(at_most(name, text("eqs 2a to 4a, L320-352"), ROUGH, _operators()))
    smallest, unmet = np.inf, 0.0
    for case, reference in OPEN.items():
        found, mechanism = followed(case), parameters(case.offset_in, case.twist_deg)
        sizes = [float(np.max(x)) for x in (found.rotation_deg, found.error_in)]
        whats = ("loop open by a rotation", "error of S4")
        for what, size, stated, unit in zip(whats, sizes, reference, ("deg", "in")):
            name = f"{what} where the iteration ends; {case.name}"
            verdicts.append(_nothing(name, size, unit, "section 2.6.1, L465", "erratum 1"))
            verdicts.append(near(f"{name}, independent reconstruction", OURS, stated, size, 0.005, unit))
        columns[f"rotation left as printed; {case.name} [deg]"] = found.rotation_deg[:, 0]
        columns[f"error of S4 as printed; {case.name} [in]"] = found.error_in[:, 0]
        least = followed(case, "all")
        columns[f"rotation left by all eighteen equations; {case.name} [deg]"] = least.rotation_deg[:, 0]
        columns[f"error of S4 by all eighteen equations; {case.name} [in]"] = least.error_in[:, 0]
        angle, shift = np.radians(GRID_DEG), np.full(GRID_DEG.size, case.shift_in * INCH)
        product, screws = chain(mechanism, angle, shift, found.unknowns[:, 0] * [1.0, 1.0, 1.0, 1.0, INCH])
        matrix, right = equations(product, screws, INCH, "printed")
        singular = np.linalg.svd(matrix, compute_uv=False)
        smallest = min(smallest, float(np.min(singular[:, -1] / singular[:, 0])))
        unmet = max(unmet, float(np.abs(right).max()))
    name = "greatest entry of A Delta - V where the iteration ends"
    verdicts.append(_nothing(name, unmet, "", "eqs 23, 23a, L457-463", "erratum 1: there A'V = 0 alone"))
    name = "least singular value of A relative to its greatest, over the turns"
    verdicts.append(at_least(name, text("section 3.3, L1131"), NOTHING, smallest))
    for words, rows, from_before, rotation, error, digit in VARIANTS:
        other, name = followed(first, rows, from_before), f"loop open by a rotation, {words}"
        verdicts.append(near(name, OURS, rotation, np.max(other.rotation_deg), digit, "deg"))
        verdicts.append(near(f"error of S4, {words}", OURS, error, np.max(other.error_in), 0.005, "in"))
    return StudyResult(
        number="rahman-closure",
        claim="The iteration of section 2.6.1 finds theta2, eta2, theta3, eta3 and S4 for given theta1 and S1.",
        columns=padded(columns),
        verdicts=(*verdicts, *_in_the_plane(), *_limits()),
    )


# ---------------------------------------------------------------- the rates


def _row_f(case: Case) -> tuple[FloatArray, FloatArray]:
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


def _printed_rates() -> list[Verdict]:
    """Judge eqs 28a, 30, 31 and 38 to 43, 38a to 42a in the general position, with the shift at rest or at 1.3 in/s."""
    crank, still = CRANK_AT_SPEED._replace(shift_rate=1.3), CRANK_AT_SPEED
    right = loop_rates(crank, GENERAL, Joints(*np.zeros(5)))
    matrix = np.stack([loop_rates(crank, GENERAL, Joints(*unit)) - right for unit in np.eye(5)], -1)
    ranks = [int(np.linalg.matrix_rank(m)) for m in (matrix, np.column_stack([matrix, right]))]
    solved, rates = Joints(*np.linalg.solve(matrix[:5], -right[:5])), joint_rates(crank, GENERAL)
    as_printed, mended = (float(joint_rates(still, GENERAL, erratum_4=erratum).th2) for erratum in (False, True))
    left = abs(float(joint_rates(crank, GENERAL, erratum_4=True).th2 - solved.th2))
    # derivative along the motion by a complex step, which has no rounding error
    moved = Joints(*(q + 1e-20j * r for q, r in zip(GENERAL, rates)))
    seconds = joint_accelerations(crank, GENERAL, rates)
    rough = max(abs(float(a - b.imag / 1e-20)) for a, b in zip(seconds, joint_rates(crank, moved)))
    row_6 = CRANK_SPEED * CRANK * np.sin(GENERAL.th2) * (1.0 - np.sin(GENERAL.eta2))
    amplitude, ratio, angle = 2.0, 2.0, 0.9
    shift, shift_rate = amplitude * np.sin(ratio * angle), ratio * amplitude * np.cos(ratio * angle)
    slip = shift_rate - ratio * shift * np.cos(ratio * angle)
    coefficients, less = "rank of the coefficients of eq 38", "less the solution of 37a to 37e"
    verdicts = [
        near(name, text("eq 38, L561-563"), 5.0, rank, 0.0, why=why)
        for name, rank, why in (
            (coefficients, ranks[0], ""),
            (f"{coefficients} with its right side", ranks[1], "erratum 3: six equations, of which five are solved"),
        )
    ]
    why, turning = "erratum 4: no cos^2 eta2", "angular velocity by eqs 30, 31 less that of Z(theta) Y(eta)"
    accelerations = "accelerations by eqs 38a to 42a less the rates of 39 to 43"
    rows = (
        (turning, _angular_velocity(), "rad/s", "eqs 30, 31, L503-507", "erratum 2"),
        ("right side of row 6 of eq 38 less that of 37f", row_6, "in/s", "eq 38, L561", "erratum 9: no sin eta2"),
        ("S1' by eq 28a less the rate of eq 28", slip, "in/rad", "eq 28a, L581", "erratum 9: S1 for its amplitude"),
        (f"theta2' by eq 39 {less}", as_printed - mended, "rad/s", "eq 39, L565", why),
        (f"theta3' by eq 40 {less}", rates.th3 - solved.th3, "rad/s", "eq 40, L567"),
        (f"eta2' by eq 41 {less}", rates.eta2 - solved.eta2, "rad/s", "eq 41, L569"),
        (f"eta3' by eq 42 {less}", rates.eta3 - solved.eta3, "rad/s", "eq 42, L571"),
        (f"S4' by eq 43 {less}", rates.s4 - solved.s4, "in/s", "eq 43, L573"),
        (accelerations, rough, "rad/s2", "eqs 38a to 42a, L1037-1045"),
    )
    name = "with erratum 4 mended"
    return [
        *verdicts,
        *(_nothing(*row) for row in rows),
        near("theta2' as printed, independent derivation", OURS, THETA2_RATE_PRINTED, as_printed, 5e-5, "rad/s"),
        near(f"theta2' {name}, independent derivation", OURS, THETA2_RATE, mended, 5e-5, "rad/s"),
        at_most(f"theta2' {name} {less}", OURS, 1e-12, left, "rad/s"),
    ]


def _dead_centres() -> list[Verdict]:
    """Judge the cause that section 3.2 gives for the spikes, in the plane."""
    place, verdicts, worst = "section 3.2, L1115", [], 0.0
    for a4 in (10.0, 20.0, 30.0):
        case, p = Case("", a4, 0.0, 270.0), parameters(a4)
        q = joints(planar(p, np.radians(ANGLES_DEG)) / [1.0, 1.0, 1.0, 1.0, INCH])
        r = joint_rates(CRANK_AT_SPEED, q)
        seconds = joint_accelerations(CRANK_AT_SPEED, q, r)
        close_by = np.min([np.abs(ANGLES_DEG - at) for at in dead_centres_deg(case)], axis=0) < CLEAR_DEG
        sizes = [np.abs(second) for second in (seconds.th2, seconds.th3, seconds.s4)]
        worst = max(worst, *(size[close_by].max() / size[~close_by].max() for size in sizes))
    for which, at in zip(("first", "second"), dead_centres_deg(Case("", 10.0, 0.0, 270.0))):
        th2 = float(np.degrees(planar(parameters(10.0), np.radians([at]))[0, 0])) % 360.0
        away, why = min(th2, 360.0 - th2), "there it is half a turn"
        name = f"theta2 at the {which} spike; a4 = 10 in, S1 = 0"
        verdicts.append(_nothing(name, away, "deg", place, "" if away < 1.0 else why))
    name = (
        "greatest accelerations by eqs 38a, 39a, 42a within 10 deg of a spike relative to elsewhere, ten being abnormal"
    )
    why = "the spikes are not of roundoff: at dead centres the torque has no lever on the slider"
    return [*verdicts, at_least(name, text(place), 10.0, worst, why=why)]


def velocities() -> StudyResult:
    """Compute the rates as printed, and the residual of the unsolved row."""
    columns, verdicts = {ANGLE: GRID_DEG}, _printed_rates()
    for case, (stated, mended_stated) in ROW_F.items():
        lacking, mended = _row_f(case)
        columns[f"row 37f as printed; {case.name} [in/s]"] = lacking
        columns[f"row 37f mended; {case.name} [in/s]"] = mended
        size = float(np.nanmax(np.abs(lacking)))
        name = f"row 37f with the rates of eqs 39 to 43, where abs(sin theta2) > {CLEAR_SINE:g}; {case.name}"
        verdicts.append(_nothing(name, size, "in/s", "eq 37f, L557", "erratum 3"))
        name = f"velocity of point 3 by the forward path less the mixed path; {case.name}"
        verdicts.append(_nothing(name, size, "in/s", "section 2.8, L639, L750", "erratum 3"))
        verdicts.append(
            near(f"row 37f as printed, independent reconstruction; {case.name}", OURS, stated, size, 0.5, "in/s")
        )
        name = f"row 37f with erratum 2 mended, independent reconstruction; {case.name}"
        verdicts.append(near(name, OURS, mended_stated, float(np.abs(mended).max()), 0.5, "in/s"))
    lost = "the scan has lost the second dots; the thesis computes with eqs 57 and 58 in their place (L859)"
    verdicts.append(unjudged("eqs 55 and 56 are the rates of 50a and 51a", text("eqs 55, 56, L758-846"), lost))
    return StudyResult(
        number="rahman-rates",
        claim="Eqs 39 to 43 give all velocities of the joints, and eqs 38a to 42a their accelerations.",
        columns=padded(columns),
        verdicts=(*verdicts, *_dead_centres()),
    )


# ---------------------------------------------------------------- the forces

_PLANE = Case("a4 = 10 in, S1 = 0", 10.0, 0.0, 270.0)
_PLANAR = ("1F1i", "1F1j", "2F2i", "2F2j", "3F3i", "3F3j", "4F4i", "4F4k")


def planar_forces(*, erratum_5: bool, erratum_6: bool) -> dict[str, FloatArray]:
    """Return the forces (lb) of the planar mechanism at a4 = 10 in by the printed equations, with errata mended or not."""
    p, angle = parameters(_PLANE.offset_in), np.radians(ANGLES_DEG)
    q = joints(planar(p, angle) / [1.0, 1.0, 1.0, 1.0, INCH])
    r = joint_rates(CRANK_AT_SPEED, q)
    seconds = joint_accelerations(CRANK_AT_SPEED, q, r)
    found = joint_forces(CRANK_AT_SPEED, bodies(p, erratum_6=erratum_6), q, r, seconds, TORQUE, erratum_5=erratum_5)
    found["1F1i"], found["1F1j"] = on_crank(angle, found)
    return found


def _slips(right: dict[str, FloatArray]) -> list[Verdict]:
    """Judge erratum 9 in the force equations, 63b and 69k."""
    angle, at = np.radians(ANGLES_DEG), clear(_PLANE)
    crank, b = CRANK_AT_SPEED, bodies(parameters())
    r = joint_rates(crank, GENERAL)
    general = joint_forces(crank, b, GENERAL, r, joint_accelerations(crank, GENERAL, r), TORQUE)
    across = CRANK * crank.speed * np.sin(GENERAL.th2) * np.sin(GENERAL.eta2) - ROD * r.eta2 * np.cos(GENERAL.th2)
    slider = b.masses[2] * (np.cos(GENERAL.th3) - np.cos(GENERAL.eta3)) * across
    rod = -b.masses[1] * b.g2 * r.eta3
    fj, pin = right["1F1j"], right["2F2j"]
    row = float(np.abs(-fj * np.sin(angle) + fj * np.cos(angle) + pin)[at].max())
    wrong = dict(right)
    wrong["2F2i"], inertia = right["2F2i"] + 1.0, -(right["along crank"] + right["2F2i"])
    for _ in range(10):
        wrong["along crank"] = -(wrong["2F2i"] + inertia)
        i, j = on_crank(angle, wrong)
        wrong["2F2i"] = -i * np.cos(angle) - j * np.sin(angle) - inertia
    left = float(np.abs(wrong["2F2i"] - right["2F2i"])[at].max())
    (crank_mass, *_), volume = b.masses, np.pi * 1.5**2 * CRANK
    gravity = 0.28 * WATER * volume / 386.4 / crank_mass
    mass, passes = (
        "mass of the crank of specific gravity 0.28 less m1, relative to it",
        "ten passes of eqs 69i, 69j, 69k",
    )
    rows = (
        ("f2xd in the general position", general["f2xd"], "lb.in", "eq 63b, L923, L945"),
        (f"error of 2F2i after {passes} from 1 lb", left, "lb", "section 2.8, L1007-1009", "erratum 8"),
        ("slider's momentum along j by eq 51a less 51", slider, "lb.s", "eq 51a, L717-727", "erratum 9: cos of theta3"),
        ("rod's momentum along k by eq 52a less 52", rod, "lb.s", "eq 52a, L746", "erratum 9: g3 for g2"),
        ("left side of eq 62c with the right forces", row, "lb", "eq 62c, L913", "erratum 9: 1F1j for 1F1i"),
        (mass, gravity - 1.0, "", "section 3.1, L1071", "erratum 9: 0.28 is lb/in3"),
    )
    return [_nothing(*row) for row in rows]


def forces() -> StudyResult:
    """Compute the force equations in the plane, as printed and mended."""
    columns, verdicts, at = {ANGLE: ANGLES_DEG}, [], clear(_PLANE)
    right = {symbol: values(_PLANE, COMPONENTS[symbol]) for symbol in _PLANAR}
    columns["4F4k right [lb]"] = right["4F4k"]
    errors = "greatest difference of a joint force from the right one in the plane"
    mended = planar_forces(erratum_5=True, erratum_6=True)
    for words, five, six, place, why in (
        ("as printed", False, False, "section 3.2, L1111", "errata 5 and 6"),
        ("erratum 6 mended", False, True, "eqs 62, 64, L887-891", "erratum 5: signs of f1 and f3"),
        ("erratum 5 mended", True, False, "section 3.1, L1085-1087", "erratum 6: signs of g1 and g2"),
        ("both mended", True, True, "", ""),
    ):
        found = planar_forces(erratum_5=five, erratum_6=six)
        columns[f"4F4k {words} [lb]"] = found["4F4k"]
        worst = max(float(np.abs(found[symbol] - right[symbol])[at].max()) for symbol in _PLANAR)
        if place:
            verdicts.append(_nothing(f"{errors}; {words}", worst, "lb", place, why))
        else:
            verdicts.append(at_most(f"{errors}; {words}", OURS, 6e-10, worst, "lb"))
    strength = "neither strength nor number of cycles are given"
    return StudyResult(
        number="rahman-forces",
        claim="In the plane the program gives the same as the complex algebra method.",
        columns=padded(columns),
        verdicts=(
            *verdicts,
            *_slips(mended),
            unjudged("with an offset fatigue failure is likely at high speed", text("section 3.3, L1125"), strength),
        ),
    )


# ---------------------------------------------------------------- plots


#: Labels of the axes by the unit of their columns.
_SHOWN = {"[deg]": "rotation left", "[in]": "error of S4", "[in/s]": "row 37f", "[lb]": "4F4k"}
#: Columns drawn dashed, over the others.
_DASHED = ("37f mended", "both mended", "all eighteen")


def draw(result: StudyResult) -> Figure:
    """Draw one panel for each unit of the columns, mended equations dashed."""
    panels = []
    for unit, label in _SHOWN.items():
        shown = {name: column for name, column in result.columns.items() if name.endswith(unit) and name != ANGLE}
        # the forces are infinite at the dead centres
        inside = clear(_PLANE) if unit == "[lb]" else slice(None)
        limit = 1.05 * max((float(np.nanmax(np.abs(column[inside]))) for column in shown.values()), default=0.0)
        curves = [
            Curve(
                x=result.columns[ANGLE],
                y=np.where(np.abs(column) < 2.0 * limit, column, np.nan),
                label=printed(name.removesuffix(f" {unit}").removeprefix(f"{label} ")),
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


_COMPUTE = {"rahman-closure": closure, "rahman-rates": velocities, "rahman-forces": forces}
#: The studies by their names.
STUDIES = {name: Study(name, partial(compute), draw) for name, compute in _COMPUTE.items()}
