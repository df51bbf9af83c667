"""Verdicts on the force equations, in the plane and out of it: momenta and joint forces, sections 2.8 and 3.1."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any, TypeVar

import numpy as np

from linkwork.slider_crank.published import parameters

from ...numerics.dual import Dual, about_i, about_j, about_k, apply
from ...slider_crank.closure import planar
from ...slider_crank.dual_dynamics import Binor
from ...units import INCH
from ..rules import ABNORMAL, ABOUT_DEG, VERY_CLOSE_DEG
from ..statements import Case as Judged
from ..statements import FloatArray, Statement, at_least, at_most, statement
from ..study import Study, StudyResult, pad_columns
from ..variation import ignore_changes
from . import printed
from .figures import ANGLE, ANGLES_DEG, CRANK, FROM_DEAD, NOTHING, ROUNDING, TORQUE, clear_mask, nothing, values
from .method import (
    AT,
    AT_RATES,
    CLEAR_SINE,
    DOTS,
    MOVING,
    PLANE,
    ROD,
    ROW_F,
    SHIFT,
    case_turn,
    difference,
    draw,
    joints,
    links,
    unsure,
)
from .table import COMPONENTS, Case

#: Distance g3 (in) for judging the terms of the slider's moment of mass; they vanish at g3 = 0, with which the thesis computes.
G3 = 2.0
#: Sines and cosines printed in eqs 50a and 51a, and in eqs 52a and 53a (L704-726, L744-748).
PRINTED_SINES = (24 + 114, 3)
#: Why the two paths give different momenta.
PATHS = "errata 3, 4: out of the plane the two paths give different velocities"
#: Weight of water (lb/in3), the reference of specific gravities.
WATER = 62.43 / 12.0**3
#: One of the named tuples of `printed`.
Named = TypeVar("Named", printed.Bodies, printed.Crank, printed.Joints)
#: Components of the joint forces in the plane.
PLANAR = ("1F1i", "1F1j", "2F2i", "2F2j", "3F3i", "3F3j", "4F4i", "4F4k")


def planar_forces(case: Case = PLANE, *, erratum_5: bool, erratum_6: bool, share: float = 1.0) -> dict[str, FloatArray]:
    """Return the joint forces (lb) of a planar mechanism by the printed equations; each switch mends one erratum.

    ``share`` multiplies the masses; 0 leaves the inertia out.
    """
    p, angle = parameters(case.offset_in), np.radians(ANGLES_DEG)
    q = joints(planar(p, angle) / [1.0, 1.0, 1.0, 1.0, INCH])
    b = printed.bodies(p, erratum_6=erratum_6)
    b = b._replace(masses=tuple(share * mass for mass in b.masses))
    # sin theta2 is 0 at a dead centre
    with np.errstate(divide="ignore", invalid="ignore"):
        r = printed.joint_rates(printed.CRANK_AT_SPEED, q)
        seconds = printed.joint_accelerations(printed.CRANK_AT_SPEED, q, r)
        found = printed.joint_forces(printed.CRANK_AT_SPEED, b, q, r, seconds, TORQUE, erratum_5=erratum_5)
    found["1F1i"], found["1F1j"] = printed.crank_bearing_forces(angle, found)
    return found


def _unequal() -> printed.Bodies:
    """Return the bodies of section 3.1 with unequal radii of gyration, so that an error in their indices shows."""
    return printed.bodies(parameters())._replace(rod_squares=(0.5, 600.0, 900.0), slider_squares=(1.0, 1.5, 2.0))


def _binors(b: printed.Bodies) -> tuple[Binor, Binor, Binor]:
    """Return the inertia binors of eqs 46 to 48 with g3 = `G3`, in pounds, inches and seconds."""
    first, second, third = (
        Binor(mass=m, moment=m * np.array([g, 0.0, 0.0]), inertia=m * np.diag(squares))
        for m, g, squares in zip(
            b.masses, (b.g1, b.g2, G3), ((0.0, 0.0, b.crank_square), b.rod_squares, b.slider_squares)
        )
    )
    return first, second, third


def _balances() -> tuple[float, ...]:
    """Return the greatest residuals (lb, lb.in) of eqs 62 to 64 with the correct forces in the plane, erratum 6 mended."""
    p, angle, b = parameters(PLANE.offset_in), np.radians(ANGLES_DEG), printed.bodies(parameters(), erratum_6=True)
    q = joints(planar(p, angle) / [1.0, 1.0, 1.0, 1.0, INCH])
    r = printed.joint_rates(printed.CRANK_AT_SPEED, q)
    inertia = printed.inertia_forces(
        printed.CRANK_AT_SPEED, b, q, r, printed.joint_accelerations(printed.CRANK_AT_SPEED, q, r)
    )
    first, second, third, fourth = (
        np.stack([values(PLANE, COMPONENTS[f"{n}F{n}{axis}"]) for axis in "ijk"], -1) for n in (1, 2, 3, 4)
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
    at = clear_mask(PLANE)
    return tuple(float(max(np.abs(x.real[at]).max(), np.abs(x.dual[at]).max())) for x in left)


def _clear_joints(case: Case) -> printed.Joints:
    """Return the joint values at the end of the printed iteration, at the angles where sin theta2 is not near 0."""
    q = joints(case_turn(case).unknowns[:, 0])
    return printed.Joints(*(x[np.abs(np.sin(q.th2)) > CLEAR_SINE] for x in q))


def velocity_paths() -> list[Judged]:
    """Compare the momenta of rod and slider by eqs 50a and 51a with those by eqs 52a and 53a, in the plane and out of it.

    Eqs 50a and 51a take the velocities from the joints on the crank's side (the forward path of the thesis), eqs 52a and 53a
    from the joints on the slider's side (the mixed path).
    """
    b, found = printed.bodies(parameters()), []
    for case in (PLANE, *ROW_F):
        q = _clear_joints(case)
        r = printed.joint_rates(printed.CRANK_AT_SPEED, q)
        pairs = zip(*_both_paths(printed.CRANK_AT_SPEED, b, q, r))
        apart = [float(np.abs(forward.real - mixed.real).max()) for forward, mixed in pairs]
        found.append(nothing(case.name, apart, "lb.s"))
    return found


def _both_paths(
    c: printed.Crank, b: printed.Bodies, q: printed.Joints, r: printed.Joints
) -> tuple[tuple[Dual, Dual], tuple[Dual, Dual]]:
    """Return the momenta of rod and slider by eqs 50a and 51a, and by eqs 52a and 53a."""
    rod = printed.forward_rod_momentum(c, b, q, r) * b.masses[1]
    _, *mixed = printed.momenta(c, b, q, r)
    return (rod, printed.forward_slider_momentum(c, b, q, r, 0.0)), (mixed[0], mixed[1])


def replacements() -> list[Judged]:
    """Judge eqs 57 and 58 by comparison with eqs 55 and 56, in the plane and out of it.

    All four equations are evaluated with the printed rates and accelerations.
    """
    b, found = printed.bodies(parameters()), []
    for case in (PLANE, *ROW_F):
        apart = []
        for q in map(printed.Joints._make, zip(*_clear_joints(case))):
            r = printed.joint_rates(printed.CRANK_AT_SPEED, q)
            a = printed.joint_accelerations(printed.CRANK_AT_SPEED, q, r)
            pairs = zip(
                printed.forward_momentum_rates(printed.CRANK_AT_SPEED, b, q, r, a, 0.0),
                printed.momentum_rates(printed.CRANK_AT_SPEED, b, q, r, a)[1:],
            )
            apart += [float(np.abs(forward.real - mixed.real).max()) for forward, mixed in pairs]
        found.append(nothing(f"57, 58 less 55, 56; {case.name}", max(apart), "lb"))
    return found


def _rounded(values: Named, kind: type[np.floating[Any]]) -> Named:
    """Round the numbers of a named tuple to single precision; return them as numbers of the type ``kind``."""
    singles = (np.asarray(x, np.float32).astype(kind) for x in values)
    numbers: Any = [tuple(x) if isinstance(old, tuple) else x[()] for x, old in zip(singles, values)]
    return type(values)(*numbers)


def body_momenta(kind: type[np.floating[Any]]) -> FloatArray:
    """Return the momenta over a turn in the plane, computed in the precision ``kind`` from numbers of single precision.

    The axes of the result are the path as in `_both_paths`, the body (rod, slider), the crank angle, and the component.
    """
    q = joints(planar(parameters(PLANE.offset_in), np.radians(ANGLES_DEG)) / [1.0, 1.0, 1.0, 1.0, INCH])
    c, b, q = _rounded(printed.CRANK_AT_SPEED, kind), _rounded(printed.bodies(parameters()), kind), _rounded(q, kind)
    paths = _both_paths(c, b, q, printed.joint_rates(c, q))
    return np.array([[np.concatenate([h.real, h.dual], -1) for h in path] for path in paths], dtype=kind)


def _roundoffs() -> list[Judged]:
    """Judge the roundoff errors of momenta in single precision in the plane: by eqs 50a, 51a and by eqs 52a, 53a."""
    short, long = body_momenta(np.float32), body_momenta(np.float64)
    by_forward, by_mixed = np.sqrt(np.mean((short - long) ** 2, axis=-2))
    names = [f"{part}component {axis}" for part in ("", "moment, ") for axis in "ijk"]
    judged = []
    for body, ones, others in zip(("rod", "slider"), by_forward, by_mixed):
        judged += [
            # two digits: the size depends on the order of the operations
            at_most(f"{body}, {name}", 1.0, float(f"{other / one:.2g}"))
            for name, one, other in zip(names, ones, others)
            if one or other
        ]
    return judged


def _momenta() -> Iterator[Statement]:
    """Judge eqs 49a to 53a in a general position by comparison with the momenta by the binors of eqs 46 to 48."""
    b, r = _unequal(), printed.joint_rates(MOVING, printed.GENERAL)
    of_crank, of_rod, of_slider = _binors(b)
    moving = printed.velocities(MOVING, printed.GENERAL, r)
    rod = printed.forward_rod_momentum(MOVING, b, printed.GENERAL, r)
    slider = printed.forward_slider_momentum(MOVING, b, printed.GENERAL, r, G3, slip=True)
    wrong = slider - of_slider.momentum(printed.forward_slider_velocity(MOVING, printed.GENERAL, r))
    # the thesis computes 52a with g3 = 0
    rod_52a, slider_53a = (
        printed.momenta(MOVING, b, printed.GENERAL, r, slip=True)[1],
        printed.momenta(MOVING, b, printed.GENERAL, r, g3=G3)[2],
    )
    yield statement(
        "Formulations for the dual momentum of link 1, i.e. the crank in terms of frame {2}, of link 2, i.e. the connecting "
        "rod, in terms frame {3} and of link 3, i.e. the slider, in terms of frame {4}, can respectively be obtained by "
        "modifying equations (49), (50) and (51) to 3\N{MULTIPLICATION SIGN}1 dual-number matrix equations as shown below",
        "section 2.8, eqs 49a to 51a, L700-728",
        "difference from the binors (inertia operators) of eqs 46 to 48 times the velocities of eqs 33, 35 and 45, in a "
        f"general position with unequal radii of gyration, S1' = 1.3 in/s and g3 = {G3:g} in",
        ROUNDING,
        nothing("eq 49a", difference(printed.crank_momentum(MOVING, b), of_crank.momentum(moving[0])), "lb.s"),
        nothing(
            "eq 50a",
            difference(rod * b.masses[1], of_rod.momentum(printed.forward_rod_velocity(MOVING, printed.GENERAL, r))),
            "lb.s",
        ),
        nothing("eq 51a, components i and k", [wrong.real[[0, 2]], wrong.dual[[0, 2]]], "lb.s"),
        unsure("eq 51a, component j", "cos theta3 for cos eta3", [wrong.real[1], wrong.dual[1]], "lb.s"),
    )
    yield statement(
        "Now, alternative expressions for (50a) and (51a) using the backward path are respectively",
        "section 2.8, eqs 52a, 53a, L744-748",
        f"difference from the binors times the velocities of eqs 36 and 32a, in a general position with S1' = 1.3 in/s, "
        f"and with g3 = {G3:g} in for eq 53a and 0 for eq 52a (L1089)",
        ROUNDING,
        unsure("eq 52a", "g3 for g2", difference(rod_52a, of_rod.momentum(moving[1])), "lb.s"),
        nothing("eq 53a", difference(slider_53a, of_slider.momentum(moving[2])), "lb.s"),
    )
    yield statement(
        "In either case [all by the forward path, or some by the backward path], the same numerical results are "
        "obtained, but mixed path equations set is much simpler than only the forward path equations set. ... Both the "
        "sets were tested by the program for a number of cases and resulted in same outcome.",
        "section 2.8, L637-639, L750",
        "greatest difference between the momenta of rod and slider (force parts) by eqs 50a and 51a and those by eqs "
        "52a and 53a, with erratum 9 mended, where the printed iteration ends. The turn is sampled at every "
        f"{printed.STEP_DEG:g} deg; angles where theta2 is within {ABOUT_DEG:g} deg of 0 or of half a turn are left out (our "
        "choice). Then the number of sines and cosines printed in 52a and 53a, relative to that in 50a and 51a",
        f"{ROUNDING}; one half for *much simpler*, our choice",
        *velocity_paths(),
        at_most("sines and cosines", 0.5, PRINTED_SINES[1] / PRINTED_SINES[0]),
        why=PATHS,
    )


def _rate(h: Dual) -> Dual:
    """Return the time derivative of a dual vector, given its value at the imaginary time of `state_later`."""
    return Dual(h.real.imag / 1e-20, h.dual.imag / 1e-20)


def _momentum_rates() -> Iterator[Statement]:
    """Judge eqs 54 to 58 as rates of momenta, and the accuracy of the two paths."""
    b, r = _unequal(), printed.joint_rates(MOVING, printed.GENERAL)
    # the rates of eqs 54 to 56, and the momenta whose rates they should be, a moment later
    seconds = printed.joint_accelerations(MOVING, printed.GENERAL, r)
    of_rates = printed.Crank(CRANK, ROD, MOVING.acceleration, MOVING.shift_acceleration)
    crank, q, rate = printed.state_later(MOVING, printed.GENERAL, r, seconds)
    rod_rate, slider_rate = printed.forward_momentum_rates(MOVING, b, printed.GENERAL, r, seconds, G3)
    forward = {
        "eq 54": (printed.crank_momentum(of_rates, b), printed.crank_momentum(crank, b)),
        "eq 55": (rod_rate, b.masses[1] * printed.forward_rod_momentum(crank, b, q, rate)),
        "eq 56": (slider_rate, printed.forward_slider_momentum(crank, b, q, rate, G3)),
    }
    backward = zip(
        ("eq 57", "eq 58"),
        printed.momentum_rates(MOVING, b, printed.GENERAL, r, seconds, g3=G3)[1:],
        printed.momenta(crank, b, q, rate, g3=G3)[1:],
    )
    yield statement(
        "Differentiating forward path equations (49a), (50a) and (51a) with respect to time the following "
        "equations are obtained respectively:",
        "section 2.8, eqs 54 to 56, L754-846",
        f"difference from the rates of eqs 49a to 51a, with erratum 9 mended, in a general position {AT_RATES} and g3 = "
        f"{G3:g} in; {DOTS}, and missing brackets are added",
        ROUNDING,
        *(nothing(label, difference(found, _rate(h)), "lb") for label, (found, h) in forward.items()),
    )
    yield statement(
        "Now, backward path equations (52a) and (53a) are differentiated with respect to time. The following "
        "equations are replacements for equations (55) and (56) respectively.",
        "section 2.8, eqs 57, 58, L848-857",
        "difference of eqs 57 and 58 from the rates of eqs 52a (erratum 9 mended) and 53a, in a general position "
        f"{AT_RATES} and g3 = {G3:g} in. Then the greatest difference of the force parts of 57 from 55 and of 58 from "
        f"56, at the angles at which the row at L637 compares the momenta; {DOTS}",
        ROUNDING,
        *(nothing(label, difference(found, _rate(h)), "lb") for label, found, h in backward),
        *replacements(),
        why=PATHS,
    )
    yield statement(
        "Finally the second set [the mixed path's] is used in the program to have better accuracy.",
        "section 2.8, L750; L730, L859",
        "roundoff of each component of the momenta in the plane, a4 = 10 in: its value in single precision minus that in "
        "double precision, as root mean square over the half degrees of a turn. The roundoff by 52a and 53a is divided "
        "by that by 50a and 51a; components without roundoff by either are left out",
        "none, the sign decides",
        *_roundoffs(),
        why="for component i of the rod, 52a has the roundoff of S4' in addition. The sizes depend on the order in which an "
        "equation is computed",
    )


def _inertia() -> Iterator[Statement]:
    """Judge the inertia forces of eqs 59 to 61, and the balances of eqs 62 to 64 that they enter."""
    b, r = _unequal(), printed.joint_rates(MOVING, printed.GENERAL)
    a = printed.joint_accelerations(MOVING, printed.GENERAL, r)
    accelerations = map(_rate, printed.velocities(*printed.state_later(MOVING, printed.GENERAL, r, a)))
    bodies_moving = zip(
        printed.velocities(MOVING, printed.GENERAL, r),
        printed.momenta(MOVING, b, printed.GENERAL, r, g3=G3),
        printed.momentum_rates(MOVING, b, printed.GENERAL, r, a, g3=G3),
    )
    inertia = [
        difference(printed.inertia_force(*momentum), binor.rate(momentum[0], acceleration))
        for momentum, binor, acceleration in zip(bodies_moving, _binors(b), accelerations)
    ]
    yield statement(
        "In this step, equations for the inertia forces of link 1 (i.e. the crank) relative to frame {2}, for link 2 (i.e. the "
        "connecting rod) relative to frame {3} and for link 3 (i.e. the slider) relative to frame {4} are derived.",
        "section 2.8, eqs 59 to 61, L863-881",
        "difference from the rate of change of the momentum in a frame at rest, computed with the binors, in a general "
        f"position {AT_RATES} and g3 = {G3:g} in; eq 52a has g2 in place of g3 (erratum 9)",
        ROUNDING,
        *(nothing(label, size, "lb") for label, size in zip(("eq 59", "eq 60", "eq 61"), inertia)),
        why="the sign of these forces is judged in the next row",
    )
    yield statement(
        "The force equations for links 1, 2 and 3 are respectively as follows:",
        "section 2.8, eqs 62 to 64, L885-891",
        "greatest residual with the joint forces by Newton and Euler (our model) and erratum 6 mended, in the plane, "
        f"a4 = 10 in, {FROM_DEAD}",
        ROUNDING,
        *(nothing(label, left, "lb") for label, left in zip(("eq 62", "eq 63", "eq 64"), _balances())),
        why="erratum 5: f1 and f3 have the wrong sign",
    )


def _solution_residuals() -> FloatArray:
    """Return the residuals (3, 2, 3) of eqs 62 to 64 with the forces by eqs 69a to 69q.

    The axes are the link, the real or dual part, and the coordinate axis.
    """
    crank, b = printed.CRANK_AT_SPEED, printed.bodies(parameters())
    r = printed.joint_rates(crank, printed.GENERAL)
    a = printed.joint_accelerations(crank, printed.GENERAL, r)
    f = printed.joint_forces(crank, b, printed.GENERAL, r, a, TORQUE)
    f |= dict(zip(("1F1i", "1F1j"), printed.crank_bearing_forces(np.array(AT), f)))
    f |= dict(zip(("1T1i", "1T1j"), printed.bearing_moments(np.array(AT), SHIFT, f))) | {"1T1k": np.array(TORQUE)}
    # 1F1k is 0, as are the moments in the ball joints
    joint = [Dual(*(np.array([f.get(f"{n}{x}{n}{axis}", 0.0) for axis in "ijk"]) for x in "FT")) for n in (1, 2, 3, 4)]
    inertia = printed.inertia_forces(crank, b, printed.GENERAL, r, a)
    left = [apply(m.T, before) + after + own for m, before, after, own in zip(links(), joint, joint[1:], inertia)]
    return np.array([[x.real, x.dual] for x in left])


def _expansion_differences() -> dict[str, FloatArray]:
    """Return the differences of eqs 62a to 64f, as printed, from eqs 62 to 64 for given forces, by the equations' names."""
    th1, shift, (th2, eta2, th3, eta3, _) = AT, SHIFT, (float(value) for value in printed.GENERAL)
    (s, s2, se, s3, sh), (c, c2, ce, c3, ch) = (f([th1, th2, eta2, th3, eta3]) for f in (np.sin, np.cos))
    i, j, k = force = np.array([30.0, -50.0, 70.0])
    ti, tj, tk = moment = np.array([110.0, 130.0, -170.0])
    crank, rod, slider = links()
    expanded = {
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
    apart = {eq: np.transpose(expanded[eq]) - np.transpose([f.real, f.dual]) for eq, f in zip(expanded, right)}
    slip = apart[62][1, 0]
    apart[62][1, 0] = 0.0
    return {"eq 62c": slip, **{f"eqs {eq}a to {eq}f{', but for 62c' * (eq == 62)}": left for eq, left in apart.items()}}


def _expansion(general: dict[str, FloatArray]) -> Iterator[Statement]:
    """Judge eqs 62a to 64f, and their solution by eqs 69a to 69q.

    ``general`` has the forces by this solution in a general position.
    """
    unsolved, (slip, *expanded) = _solution_residuals(), _expansion_differences().items()
    # 63d is the moment about j, 63e the force along k
    unmet = unsolved[1, [1, 0], [1, 2]]
    unsolved[1, [1, 0], [1, 2]] = 0.0
    yield statement(
        "Expanding equations (62), (63), (64) and separating primary and dual parts, the following equations are obtained:",
        "section 2.8, eqs 62a to 64f, L907-943",
        "difference from eqs 62 to 64, evaluated with the matrices of eqs 1 to 3 for arbitrary forces and moments in a "
        "general position, lengths in inches",
        ROUNDING,
        unsure(slip[0], "1F1j for 1F1i", slip[1], "lb"),
        *(nothing(words, size, "lb") for words, size in expanded),
    )
    yield statement(
        "There are eighteen equations out of which one does not give any solution (equation (63b)), since it is "
        "of the form 0=0; confirmation of this was done by evaluating it in the computer program.",
        "section 2.8, eq 63b, L923, L945",
        "f2xd by eqs 52a (with g2 for g3, erratum 9), 57 and 60, in a general position with K2y = K2z (L1105)",
        ROUNDING,
        nothing("f2xd", general["f2xd"], "lb.in"),
        why="if K2y and K2z were unequal, it would not be 0",
    )
    yield statement(
        "The details of the solution procedure are as follows:",
        "section 2.8, eqs 69a to 69q, L961-1033",
        "greatest residual of eqs 62a to 64f, with 62c mended, for the forces by eqs 69a to 69q in a general position "
        "with 1F1k = 0. The inertia forces are as printed, except for g2 in 52a",
        ROUNDING,
        nothing("eqs 62a to 62f", unsolved[0], "lb"),
        nothing("eqs 63a to 63f, but for 63d and 63e", unsolved[1], "lb"),
        nothing("eq 63d", unmet[0], "lb.in"),
        nothing("eq 63e", unmet[1], "lb"),
        nothing("eqs 64a to 64f", unsolved[2], "lb"),
        why="erratum 7: 69c satisfies only the difference of 63d and 63e; to satisfy both, the right 1F1k is needed",
    )


def _slider_force(right: dict[str, FloatArray]) -> Iterator[Statement]:
    """Judge 2F2i by eq 69h, and its improvement by eq 69k; ``right`` are the correct forces in the plane."""
    angle, at = np.radians(ANGLES_DEG), clear_mask(PLANE)
    s, c, inertia = np.sin(angle), np.cos(angle), -(right["along crank"] + right["2F2i"])
    wrong = dict(right)
    wrong["2F2i"] = right["2F2i"] + 1.0
    for _ in range(10):
        wrong["along crank"] = -(wrong["2F2i"] + inertia)
        i, j = printed.crank_bearing_forces(angle, wrong)
        off = i * c + j * s + wrong["2F2i"] + inertia
        wrong["2F2i"] = -i * c - j * s - inertia
    left = float(np.abs(wrong["2F2i"] - right["2F2i"])[at].max())
    th2 = planar(parameters(PLANE.offset_in), angle)[:, 0]
    near_zero = np.abs(np.sin(0.5 * th2)) < np.sin(0.5 * np.radians(VERY_CLOSE_DEG))
    high = np.abs(right["2F2i"][near_zero]).max() / np.abs(right["2F2i"][at]).max()
    yield statement(
        "This [division by sin theta2], in fact, resulted in some abnormal outcomes when values of angle [theta2] were "
        "very close to zero, while running the program.",
        "section 2.8, eq 69h, L995",
        f"greatest 2F2i by eq 69h at the half degrees of the crank at which theta2 is within {VERY_CLOSE_DEG:g} deg of "
        f"0, relative to the greatest at the whole degrees that are {FROM_DEAD}; in the plane, a4 = 10 in, with errata 5 "
        "and 6 mended",
        f"{VERY_CLOSE_DEG:g} deg, the rule for *very close*; {ABNORMAL:g} times, the rule for *abnormally*",
        at_least("2F2i", ABNORMAL, high),
        why="but this outcome is right: the force that a given torque causes is infinite there",
    )
    yield statement(
        "If that value [of 2F2i by eq 69h] is incorrect, equation (62a) involving with the terms [1F1i], [1F1j] and [2F2i] "
        "will not be satisfied by the values obtained from equations (69h), (69i) and (69j).",
        "section 2.8, L1007",
        "greatest residual of eq 62a with a 2F2i that is wrong by 1 lb, our choice, and the 1F1i and 1F1j that eqs 69i and "
        f"69j give with it; in the plane, a4 = 10 in, {FROM_DEAD}",
        f"more than {ROUNDING}",
        at_least("eq 62a", NOTHING, float(np.abs(off)[at].max()), "lb"),
        why="erratum 8: 69i and 69j satisfy 62a for any 2F2i",
    )
    yield statement(
        "If [equation (62a) is] not satisfied, then a better value of the force [2F2i] is found from the following equation "
        "(69k), using previously found values of the terms [1F1i] and [1F1j] from the equations (69i) and (69j) respectively.",
        "section 2.8, L1007-1009",
        "error of 2F2i after ten passes through eqs 69i, 69j and 69k that start from an error of 1 lb; in the plane, a4 "
        f"= 10 in, {FROM_DEAD}",
        ROUNDING,
        nothing("2F2i", left, "lb"),
        why="erratum 8: 69k returns the 2F2i that is put in",
    )


def _by_hand(general: dict[str, FloatArray]) -> Iterator[Statement]:
    """Judge what section 3.2 finds by hand, and the weight of the material; ``general`` as in `_expansion`."""
    b, volume = printed.bodies(parameters()), np.pi * 1.5**2 * CRANK
    gravity = 0.28 * WATER * volume / 386.4 / b.masses[0]
    yield statement(
        "Interestingly, by manual manipulation of the equation those components [4T4 and 2F2k] are also found to be zero.",
        "section 3.2, L1117",
        "values by the printed equations in a general position, with g3 = 0 (L1089)",
        ROUNDING,
        *(
            nothing(symbol, general[symbol], "lb.in" if "T" in symbol else "lb")
            for symbol in ("4T4i", "4T4j", "4T4k", "2F2k")
        ),
        why="4T4j is zero because g3 is zero; 2F2k is zero because the equations set 1F1k to zero (erratum 7)",
    )
    yield statement(
        "By manual manipulation that force component [2F2j] is found to be negative of the ratio of input torque (100 "
        "lb-in) and the crank length (12 inches).",
        "section 3.2, L1119; eq 69g, L989",
        "sum of 2F2j by eq 69g and T/a1, in a general position",
        ROUNDING,
        nothing("2F2j + T/a1", general["2F2j"] + TORQUE / CRANK, "lb"),
    )
    yield statement(
        "Specific gravity of the material (mild steel is used for all the links) d = 0.28,",
        "section 3.1, L1071",
        "mass of a crank of that specific gravity (water weighs 62.43 lb/ft3) minus m1, relative to m1",
        ROUNDING,
        nothing("m1", gravity - 1.0),
        why="erratum 9: 0.28 is the weight density in lb/in3",
    )


def forces() -> StudyResult:
    """Compute the joint forces in the plane by the equations as printed and as mended, and judge the force equations."""
    columns = {ANGLE: ANGLES_DEG, "4F4k right [lb]": values(PLANE, COMPONENTS["4F4k"])}
    errata = {
        "as printed": (False, False),
        "erratum 6 mended": (False, True),
        "erratum 5 mended": (True, False),
        "both mended": (True, True),
    }
    wrong = dict.fromkeys(errata, 0.0)
    planes = [Case("", a4, 0.0, 270.0) for a4 in (0.0, 10.0, 20.0, 30.0)]
    for case, (words, (five, six)) in product(planes, errata.items()):
        found = planar_forces(case, erratum_5=five, erratum_6=six)
        apart = [np.abs(found[s] - values(case, COMPONENTS[s]))[clear_mask(case)].max() for s in PLANAR]
        wrong[words] = max(wrong[words], *map(float, apart))
        if case.offset_in == PLANE.offset_in:
            columns[f"4F4k {words} [lb]"] = found["4F4k"]
            mended = found
    flat = max(float(np.max(case_turn(case).error_in)) for case in planes)
    worst = (
        "greatest difference of a joint force from that by Newton and Euler (our model) in the plane, a4 = 0, 10, 20, 30 in, "
        f"{FROM_DEAD}"
    )
    r = printed.joint_rates(printed.CRANK_AT_SPEED, printed.GENERAL)
    a = printed.joint_accelerations(printed.CRANK_AT_SPEED, printed.GENERAL, r)
    general = printed.joint_forces(printed.CRANK_AT_SPEED, printed.bodies(parameters()), printed.GENERAL, r, a, TORQUE)
    return StudyResult(
        claim="Rahman states: in the plane the program gives the same as the complex algebra method.",
        columns=pad_columns(columns),
        statements=(
            statement(
                "The program was first tested for the planar case and the results found to be same as that obtained "
                "by the complex algebra method, a widely used procedure for analyzing planar mechanisms.",
                "section 3.2, L1111",
                f"greatest error of S4 by the printed iteration, and {worst}, by the printed equations",
                ROUNDING,
                nothing("S4", flat, "in"),
                nothing("joint forces", wrong["as printed"], "lb"),
                why="errata 5 and 6; with both mended the forces are right",
            ),
            *_momenta(),
            *_momentum_rates(),
            *_inertia(),
            statement(
                "Location of center of the crank [g1 = a1/2], Location of center of mass of the connecting rod [g2 = a2/2],",
                "section 3.1, L1085-1087",
                f"{worst}, by the printed equations with erratum 5 mended",
                ROUNDING,
                nothing("joint forces", wrong["erratum 5 mended"], "lb"),
                why="erratum 6: measured from the distal joints (L601), both are negative along i; as lengths they are right",
            ),
            *_expansion(general),
            *_slider_force(mended),
            *_by_hand(general),
        ),
    )


#: The study by its name.
STUDIES = {"rahman-forces": Study(ignore_changes(forces), draw)}
