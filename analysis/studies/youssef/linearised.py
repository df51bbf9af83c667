"""Sections 4.1 to 4.4: verdict on each of the linearised equations (4.1) to (4.35)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from math import cos, degrees, pi, sin

import numpy as np
from scipy.optimize import fsolve

from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SIGMA2, chapter_4

from ...figures import Figure, Panel, plot_curves
from ...numerics.fourier import FourierSeries
from ...units import RAD_S_PER_RPM
from ...youssef import Form, SliderEquation, Variant, nonlinear_harmonic_balance, slider_equation, two_harmonics
from ...youssef.printed_coefficients import DATUM, Coefficients, Datum, convert, listed, printed, ratios
from ..rules import ALIKE, SMALL
from ..statements import FloatArray, Statement, at_least, at_most, near, statement, unjudged
from ..study import Study, StudyResult, result_curves
from .chapter_4 import DAMPERS, peak
from .runs import ALIKE_WORDS, SPEED, table_3_1

#: Greatest rounding error, crank lengths sigma2 from which an order is computed, tolerance of a limit at the shorter length.
ROUNDING, SHORT, LIMIT = 1e-9, (0.002, 0.001), 0.01
TURN = np.linspace(0.0, 2.0 * pi, 361)
#: sigma3 of the linearised kinematics, the least in Fig 5.3: with sigma3 = 1 an error in its place in (4.8) would not show.
COUPLER = 0.8
#: Speeds (rad/s) and inertia ratios at which the recurrence is solved.
BALANCED_AT = tuple((speed, ratio) for speed in (10.0, 25.0, 40.0) for ratio in (0.5, 1.0, 1.5))


def with_crank(sigma2: float, inertia_ratio: float = 1.0, sigma3: float = 1.0) -> FiveBarParameters:
    """Return the mechanism of chapters IV and V with other crank and coupler lengths, sigma2 = l2/l4 and sigma3 = l3/l4."""
    mechanism = chapter_4(inertia_ratio)
    rocker = mechanism.rocker_length
    return replace(mechanism, crank_length=sigma2 * rocker, coupler_length=sigma3 * rocker)


def angles(parameters: FiveBarParameters, zeta: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return the angles of coupler and rocker (rad) over a turn with the slider held at u/l4 = ``zeta``."""
    p = parameters.constants()
    places = [kinematics.position(angle, zeta * p.l4, p) for angle in TURN.tolist()]
    coupler, rocker = np.array([kinematics.link_angles(g, p) for g in places]).T
    return coupler, rocker


@cache
def datum(sigma2: float, rocker: float | None = None, sigma3: float = 1.0) -> Datum:
    """Return the datum angles about which the equations are linearised.

    The rocker's angle follows from (4.1) unless it is given, the angles of crank and coupler from the closure (4.6).
    """
    swing = angles(with_crank(sigma2, sigma3=sigma3))[1]
    middle = 0.5 * (swing.max() + swing.min()) if rocker is None else rocker

    def closure(x: FloatArray) -> list[float]:
        gap = sigma2 * np.exp(1j * x[0]) - 1.0 - np.exp(1j * middle) + sigma3 * np.exp(1j * x[1])
        return [gap.real / sigma2, gap.imag / sigma2]

    crank, coupler = fsolve(closure, [DATUM.crank, 0.5 * middle], xtol=1e-11).tolist()
    return Datum(crank, coupler, middle)


def deviations(sigma2: float) -> tuple[float, float]:
    """Return the greatest errors of xi3 and xi4 (rad) by (4.8) over a turn, with the slider held at zeta = sigma2/2."""
    zeta = 0.5 * sigma2
    true = angles(with_crank(sigma2, sigma3=COUPLER), zeta)
    start = datum(sigma2, sigma3=COUPLER)
    errors = (np.abs(at + xi - x).max() for at, xi, x in zip(start[1:], _by_print(sigma2, zeta), true))
    first, second = map(float, errors)
    return first, second


def _by_print(sigma2: float, zeta: float) -> tuple[FloatArray, FloatArray]:
    """Return xi3 and xi4 (rad) by (4.8) as printed, over a turn."""
    alpha, a3, a4 = datum(sigma2, sigma3=COUPLER)
    by_rocker, by_coupler = (cos(a) * zeta - sigma2 * np.cos(TURN - a) + sigma2 * cos(alpha - a) for a in (a4, a3))
    return by_rocker / (COUPLER * sin(a4 - a3)), by_coupler / sin(a4 - a3)


def elimination_residuals(sigma2: float) -> dict[str, float]:
    """Return the greatest residuals of (4.5) and (4.7) over a turn, relative to sigma2, for xi3 and xi4 by (4.8)."""
    zeta = 0.5 * sigma2
    (alpha, a3, a4), (xi3, xi4) = datum(sigma2, sigma3=COUPLER), _by_print(sigma2, zeta)
    x, y = sin(a4) * xi4 - COUPLER * sin(a3) * xi3 - zeta, COUPLER * cos(a3) * xi3 - cos(a4) * xi4
    crank = sigma2 * np.exp(1j * TURN)
    left = {
        "(4.5)": x + 1j * y - np.exp(1j * a4) + crank + COUPLER * np.exp(1j * a3) - 1.0,
        "(4.7)": x + 1j * y + crank - sigma2 * np.exp(1j * alpha),
    }
    return {name: float(np.abs(values).max()) / sigma2 for name, values in left.items()}


def residuals() -> dict[str, float]:
    """Return the greatest residual of each equation (4.10) to (4.20) in a motion of the plant, relative to the largest term.

    The plant is the mechanism of Table 3.1 without gravity, with a coupler that has mass and a rocker that is not balanced.
    """
    par, w = table_3_1(1e6, gravity=0.0), SPEED * RAD_S_PER_RPM
    p, worst = par.constants(), dict[str, float]()
    m3, m4, r3, r4 = par.coupler_mass, par.rocker_mass, par.coupler_cog_distance, par.rocker_cog_distance
    # (4.14)
    i3, i4, mr3 = (x / (m4 * p.l4**2) for x in (p.i3b, p.i4d, m3 * p.l2 * r3))
    s2, s3, s4, p45, k, c = p.l2 / p.l4, p.l3 / p.l4, r4 / p.l4, m4 / p.m45, p.k / (p.m45 * w**2), p.mu / (p.m45 * w)
    for th in TURN[::15].tolist():
        u, v = 0.01 * cos(2.0 * th), 0.3 * sin(th + 1.0)
        state, inputs = (th, u, w, v, 0.0, 0.0), dynamics.Inputs(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        g = kinematics.position(th, u, p)
        m = dynamics.motion(g, kinematics.coefficients(g, p), state, inputs, p)
        pins = dynamics.reactions(g, state, m, inputs, p)
        z, dz, ddz = u / p.l4, v / (p.l4 * w), m.slider_acceleration / (p.l4 * w**2)
        d3, d4, dd3, dd4 = m.w3 / w, m.w4 / w, m.e3 / w**2, m.e4 / w**2
        f1, f2, f3 = (x / (m4 * w**2 * p.l4) for x in (pins.cx, pins.cy, m.torque / p.l4))
        y23, x23 = g.s2 * g.c3 - g.c2 * g.s3, g.c2 * g.c3 + g.s2 * g.s3
        terms = {
            "(4.10), (4.15)": (mr3 * x23 * dd3, s2 * g.s2 * f1, -s2 * g.c2 * f2, -f3, mr3 * y23 * d3**2),
            "(4.11), (4.16)": (i3 * dd3, s3 * g.s3 * f1, -s3 * g.c3 * f2, -mr3 * y23),
            "(4.12), (4.17)": (i4 * dd4, -s4 * g.s4 * ddz, -g.s4 * f1, g.c4 * f2),
            "(4.13), (4.18)": (ddz, -p45 * s4 * g.s4 * dd4, c * dz, k * z, p45 * f1, -p45 * s4 * g.c4 * d4**2),
            "(4.19)": (s3 * g.s3 * dd3, -g.s4 * dd4, ddz, s2 * g.c2, s3 * g.c3 * d3**2, -g.c4 * d4**2),
            "(4.20)": (s3 * g.c3 * dd3, -g.c4 * dd4, -s2 * g.s2, -s3 * g.s3 * d3**2, g.s4 * d4**2),
        }
        for name, parts in terms.items():
            worst[name] = max(worst.get(name, 0.0), abs(sum(parts)) / max(map(abs, parts)))
    return worst


def coefficient_ratios(sigma2: float, inertia_ratio: float = 1.0) -> dict[str, float]:
    """Return the coefficients of (4.21) as printed, each divided by the correct coefficient of first order.

    The printed coefficients are evaluated at the datum of (4.1).
    """
    mechanism = with_crank(sigma2, inertia_ratio)
    right = slider_equation(mechanism, 1.0, variant=Variant.FIRST_ORDER)
    parts = printed(ratios(mechanism), datum(sigma2))
    found = {
        name: _first_order_quotient(getattr(parts, name), parts.spring) for name in ("inertia", "stiffness", "force")
    }
    wanted = {"inertia": right.mass, "stiffness": right.stiffness, "force": right.force}
    names = {"inertia": ("D1", "E1", "F1"), "stiffness": ("G1", "H1", "P1"), "force": ("Q1", "R1", "S1")}
    return {
        f"{symbol}, {name}": value / true
        for name, symbols in names.items()
        for symbol, value, true in zip(
            symbols, found[name], (wanted[name].mean, wanted[name].cos[1], wanted[name].sin[1])
        )
        if abs(true) > ROUNDING
    }


def constant_parts() -> dict[str, float]:
    """Return |h0|/k0 and |g0|/k0 of the correct equation, for mechanisms of chapter V."""
    found = {}
    for words, mechanism in (
        ("I4 = 2", chapter_4(2.0)),
        ("sigma2 = 0.1, I4 = 1", with_crank(0.1)),
        ("sigma3 = 1.2, I4 = 2", with_crank(SIGMA2, 2.0, 1.2)),
    ):
        equation = slider_equation(mechanism, 25.0)
        for name, part in (("h0", equation.stiffness), ("g0", equation.force)):
            found[f"{name}; {words}"] = abs(part.mean) / equation.spring_factor.mean
    return found


def _first_order_quotient(part: FourierSeries, divisor: FourierSeries) -> tuple[float, float, float]:
    """Return the mean and the first cosine and sine coefficients of the quotient of two series, to first order."""
    mean = part.mean / divisor.mean
    return mean, *((x[1] - mean * y[1]) / divisor.mean for x, y in ((part.cos, divisor.cos), (part.sin, divisor.sin)))


def expansion_errors(sigma2: float) -> dict[str, FloatArray]:
    """Return the errors of the expansions (4.23) to (4.28) of the quotients in (4.21), as printed, by name.

    Each error is given by the magnitudes of its complex Fourier coefficients: mean, first and second harmonic; shape (3,).
    """
    parts = printed(ratios(with_crank(sigma2)))
    kept, angle = convert(parts, Form.SERIES), np.linspace(0.0, 2.0 * pi, 64, endpoint=False)
    found = {}
    for name, words in (("spring", "(4.23), S"), ("stiffness", "(4.25), K"), ("force", "(4.27), F")):
        quotient = getattr(parts, name)(angle) / parts.inertia(angle)
        left = FourierSeries.from_samples(quotient - getattr(kept, name)(angle), 2)
        found[words] = np.abs(left.exponential[2:])
    return found


def recurrence(equation: SliderEquation, mean: float) -> tuple[FloatArray, FloatArray]:
    """Return the matrix A and the right side B of (4.33) by (4.34) and (4.35), with ``mean`` in place of lambda_c.

    Without a damper this is (4.32).
    """
    s = equation.spring_factor
    d = equation.damping_factor
    k = equation.stiffness.to_order(2)
    f = equation.force.to_order(2)
    b00 = equation.spring * s.mean + k.mean
    (b11, b13) = equation.spring * s.cos[1:3] + k.cos[1:]
    (b12, b14) = equation.spring * s.sin[1:3] + k.sin[1:]
    (d11, d13), (d12, d14) = equation.damping * d.cos[1:3], equation.damping * d.sin[1:3]
    a = [
        [2 * b00, b11 - d12, b12 + d11, b13 - 2 * d14, b14 + 2 * d13],
        [2 * b11, -2 + 2 * b00 + b13 - d14, 2 * mean + b14 + d13, b11 - 2 * d12, b12 + 2 * d11],
        [2 * b12, -2 * mean + b14 + d13, -2 + 2 * b00 - b13 + d14, -b12 - 2 * d11, b11 - 2 * d12],
        [2 * b13, b11 + d12, -b12 + d11, -8 + 2 * b00, 4 * mean],
        [2 * b14, b12 - d11, b11 + d12, -4 * mean, -8 + 2 * b00],
    ]
    right = [2 * f.mean, 2 * f.cos[1], 2 * f.sin[1], 2 * f.cos[2], 2 * f.sin[2]]
    return np.array(a), np.array(right)


def balance_error(omega_c: float, as_printed: bool = True) -> float:
    """Return the greatest relative error of the solution of (4.34), compared with the balance of (4.29), at `BALANCED_AT`.

    If ``as_printed`` is False, (4.34) has lambda_c k0 in place of lambda_c.
    """
    errors = []
    for speed, ratio in BALANCED_AT:
        equation = slider_equation(chapter_4(ratio, omega_c), speed, variant=Variant.PRINTED, form=Form.SERIES)
        mean = equation.damping * (1.0 if as_printed else equation.damping_factor.mean)
        found = np.linalg.solve(*recurrence(equation, mean))
        series = two_harmonics(equation).series
        true = np.array([series.cos[0], series.cos[1], series.sin[1], series.cos[2], series.sin[2]])
        errors.append(float(np.abs(found - true).max() / np.abs(true).max()))
    return max(errors)


def compute() -> StudyResult:
    """Judge the equations, and compute the coefficients of (4.21) over the crank angle."""
    mechanism = chapter_4(1.0)
    right = slider_equation(mechanism, 1.0)
    ways: dict[str, tuple[FourierSeries, ...]] = {
        "right": (right.mass, right.stiffness, right.force),
        "(4.21) as printed": _first_order_series(printed(ratios(mechanism))),
        "listing of appendix 2": _first_order_series(listed(ratios(mechanism))),
    }
    columns = {"crank angle [deg]": np.degrees(TURN)}
    for i, name in enumerate(("inertia M", "stiffness K", "force F")):
        columns |= {f"{name}; {way} [1]": parts[i](TURN) for way, parts in ways.items()}
    return StudyResult(
        claim="Equations (4.1) to (4.35), one by one, each compared with our model or with the equations before it.",
        assignment="The right linear equation is (M zeta')' + lambda_c zeta' + (lambda_k^2 + K) zeta = F. It is the "
        "equation of the mechanism, linearised exactly about zeta = u/l4 = 0, with ' = d/d(theta). M, K and F "
        "have the period of the crank; lambda_k = omega_k/omega, omega_k^2 = k/(m4 + m5), lambda_c = "
        "omega_c/omega and omega_c = mu/(m4 + m5). Unless a row says otherwise, (4.21) and (4.29) as printed are "
        "evaluated at the angles of the listings, alpha = 149, alpha3 = 57 and alpha4 = 120 deg.",
        columns=columns,
        statements=(_small_motion(), *_kinematics(), *_equation(), *_simplification(), *_balance()),
    )


def peaks(omega_c: float) -> tuple[float, float]:
    """Return the first harmonic at the peak of the right linear equation with a damper (1/s) at I4 = 1, relative to l4.

    The first value is that of the linear equation, the second that of the mechanism at the same speed.
    """
    (speed, linear), mechanism = peak(1, 1.0, omega_c), chapter_4(1.0, omega_c)
    return linear, nonlinear_harmonic_balance(mechanism, speed).harmonic(1) / mechanism.rocker_length


def _small_motion() -> Statement:
    """Judge the condition of the linearisation."""
    (large, of_large), (small, of_small) = (peaks(omega_c) for omega_c in (DAMPERS[0], DAMPERS[-1]))
    return statement(
        "It must, however, be appreciated that in order that the results are true and meaningful the motion of the movable "
        "pivot must be small.",
        "IV, L2373-2377",
        "first harmonic of u in the motion of the mechanism, not linearised, divided by that of the right linear equation: "
        f"difference from 1 at the speed of the latter's peak; I4 = 1. omega_c = {DAMPERS[-1]:g} and {DAMPERS[0]:g} 1/s are "
        "the greatest and the least damper of appendix 2",
        f"{ALIKE_WORDS}; for a motion that is not small the difference is greater",
        at_most(f"motion of {small:.2f} l4, omega_c = {DAMPERS[-1]:g} 1/s", ALIKE, abs(of_small / small - 1.0)),
        at_least(f"motion of {large:.2f} l4, omega_c = {DAMPERS[0]:g} 1/s", ALIKE, abs(of_large / large - 1.0)),
        why=f"with the least damper the mechanism has {of_large:.2f} l4 there",
    )


def _kinematics() -> Iterator[Statement]:
    """Judge section 4.1: the datum and the linearised kinematics, eqs (4.1) to (4.8)."""
    small, smaller = (deviations(s) for s in SHORT)
    orders = [float(np.log2(x / y)) for x, y in zip(small, smaller)]
    rounded = degrees(datum(SIGMA2, DATUM.rocker).crank)
    yield statement(
        "The angles [alpha] and [alpha3] are then calculated accordingly.",
        "4.1, eqs (4.1), (4.6), L2404-2417; (4.6) at L2452-2458",
        "datum by (4.1) and (4.6), compared with ALF, ALF3, ALF4 of appendices 2 to 4 (L8404; 120.99. is read as 120.,9.), for "
        "sigma2 = 0.05, sigma3 = 1 and a ground link as long as the rocker, sigma = 1, which the thesis does not state",
        "half a degree, since the listings have whole degrees",
        *(
            near(
                name,
                f"{degrees(x):.0f}",
                degrees(y),
                unit="deg",
                why=f"if alpha4 is rounded to 120 deg before (4.6) is solved, alpha is {rounded:.1f} deg",
            )
            for name, x, y in zip(("alpha", "alpha3", "alpha4"), DATUM, datum(SIGMA2))
        ),
    )
    yield statement(
        "Substituting equations (4.6[)] into equations (4.5) we obtain: [(4.7)] and hence [(4.8)]",
        "4.1, eqs (4.2) to (4.8), L2459-2477",
        f"residuals of (4.5) and (4.7) with xi3 and xi4 by (4.8), relative to sigma2 = {SHORT[0]:g}. Then the order in "
        f"sigma2, from {SHORT[0]:g} to {SHORT[1]:g}, of the errors of xi3 and xi4 compared with the closed linkage. The "
        f"greatest values over a turn, at zeta = sigma2/2, sigma = 1 and sigma3 = {COUPLER:g} (our choice)",
        f"{ROUNDING:g}, above rounding errors; 2, the first order that is neglected in (4.4), and 0.05, as an order is "
        "a whole number",
        *(at_most(f"residual of {name}", ROUNDING, x) for name, x in elimination_residuals(SHORT[0]).items()),
        *(near(f"order of the error of {name}", 2.0, x, 0.05) for name, x in zip(("xi3", "xi4"), orders)),
    )


def _equation() -> Iterator[Statement]:
    """Judge section 4.2: the equations of motion and the linearised equation, eqs (4.9) to (4.21)."""
    yield statement(
        "Assuming a constant crank angular speed [omega], i.e. [(4.9)] and no gravitational forces, then by application of the "
        "Lagrangian multiplier method stated in equation (2.5) the following equations are obtained.",
        "4.2.1, eqs (4.9) to (4.20), L2495-2613",
        "residual of each equation divided by its greatest term, with accelerations, pin force at C and crank torque by "
        "our equations of motion, for Table 3.1 without gravity, at 25 crank angles with slider positions and "
        "velocities of ours. The damper's term of (4.18), illegible in the scan, is taken from (4.13)",
        f"{ROUNDING:g}, above rounding errors",
        *(at_most(name, ROUNDING, x) for name, x in residuals().items()),
    )
    yield statement(
        "If equations (4.3a) and (4.8) are substituted into this slider equation, and second and higher order "
        "multiples of [zeta] and its derivatives[ ]are ignored the following linearised equation of motion of the slider "
        "may be obtained. [(4.21)]",
        "4.2.1, eq (4.21), L2620-2794",
        "coefficients after division by A1 + B1 cos + C1 sin, the factor of the spring, relative to those of the right "
        f"equation, to first order, at I4 = 1, sigma2 = {SHORT[1]:g}, with the datum by (4.1) and the conditions of 4.5. "
        "Without a damper, the factor of zeta' is divided by M'",
        f"{LIMIT:g}, which exceeds the terms of second order, a few sigma2",
        *(
            unjudged(name, "its sign cannot be read; its size is right")
            if name.startswith("P1")
            else near(name, 1.0, x, LIMIT, why="three times too large")
            for name, x in coefficient_ratios(SHORT[1]).items()
        ),
        near("zeta' without a damper", 1.0, 0.0, LIMIT, why="M' zeta' is missing"),
        why="R1 and S1 are read from appendix 2 (L8449-8450); in the scan their term with I4 stands in Q1 (L2781), which is "
        "therefore not judged. Nor are G1 and the terms with r4 and with the coupler's mass, which are zero in 4.5",
    )


def _simplification() -> Iterator[Statement]:
    """Judge section 4.3: the expansion in epsilon, eqs (4.22) to (4.28)."""
    longer, shorter = (expansion_errors(x) for x in SHORT)
    left = {name: np.log2(longer[name] / shorter[name]) for name in longer}
    parts = printed(ratios(chapter_4(1.0)))
    series = (parts.spring, parts.inertia, parts.stiffness)
    # B1 to F1
    varying = max(abs(x) for one in series for x in (one.cos[1], one.sin[1]))
    yield statement(
        "The coefficients B1, C1, H1, P1, [...], E1 and F1 are much smaller than those of A1 a[nd] D1 by at "
        "least a factor [...] in the worst cases.",
        "4.3, L2797-2801",
        why="the fifth coefficient cannot be read, nor the factor, which says how much smaller they are. With the conditions "
        f"of 4.5 and I4 = 1 the greatest of the coefficients as printed, E1, is {varying / parts.spring.mean:.2f} of A1",
    )
    yield statement(
        "Therefore we may write : [(4.22)] where [epsilon] is a small parameter and [h0], g0 << k0.",
        "4.3, eq (4.22), L2801-2837",
        "size of the means of K and F of the right linear equation, in which the factor of the spring, k0 in the thesis, is "
        "1, at the end of each of Figs 5.1 to 5.3 where they are greatest; sigma2 = 0.05 and sigma3 = 1 unless the row "
        "names another value, and then on the same ground link",
        f"{SMALL:g}, the rule for *small*, as *<<* says",
        *(at_most(name, SMALL, x) for name, x in constant_parts().items()),
        why="the smallness of epsilon is not judged, since epsilon has no value",
    )
    yield statement(
        "[W]hich, if terms in the order of third and higher powers of [epsilon] are ignored, may be written "
        "[(4.23)] ... Similarly the stiffness term may be written : [(4.25)] ... In a similar manner the right hand "
        "side may be written : [(4.27)]",
        "4.3, eqs (4.22) to (4.28), L2853-2916",
        f"order in sigma2 (which we take for epsilon) of the error of (4.23) to (4.28), from sigma2 = {SHORT[0]:g} to "
        f"{SHORT[1]:g} at I4 = 1. The error is the difference from the exact quotients of (4.21) by D1 + E1 cos + "
        "F1 sin, which are S (the factor of damper and spring), K and F. (4.21) is taken as printed, with the sign of H1 "
        "for P1; b4 has k3 k6 + k4 k5, as in the listing (L8448)",
        "order 3; 0.05, since an order is a whole number",
        *(
            at_least(f"{part}; {name}", 2.95, x, why="the mean has a part of second order too, which is left out")
            for part, orders in left.items()
            for name, x in zip(("mean", "first harmonic", "second harmonic"), orders)
        ),
    )


def _balance() -> Iterator[Statement]:
    """Judge section 4.4: the balance of two harmonics, eqs (4.29) to (4.35)."""

    def solution(coefficients: str) -> str:
        return (
            f"difference of X0 to Y2 by {coefficients} from those by our own balance of two harmonics of (4.29), relative to "
            "the greatest of them; the greatest difference at 10, 25 and 40 rad/s with I4 = 0.5, 1 and 1.5 (our choice)"
        )

    yield statement(
        "Equating constant terms and coefficients of Cos[theta], Sin[theta], Cos2[theta] and Sin2[theta] on "
        "both sides of equation (4.31) we obtain the [f]ollowing recurrence relationships.",
        "4.4.1, eqs (4.30) to (4.33), L2988-3049",
        f"{solution('(4.32)')}; without a damper; signs that the scan of (4.32) has lost are those of (4.34)",
        f"{ROUNDING:g}, above rounding errors",
        at_most("", ROUNDING, balance_error(0.0)),
    )
    yield statement(
        "Assuming a solution of [zeta] as described in (4.30) and substituting it in equation (4.29), then multiplying "
        "and equating the coefficients of the trig[o]nometric functions of [theta] on both sides of that equation in a "
        "similar manner to the preceding section, we obtain ... [(4.34)]",
        "4.4.2, eqs (4.34), (4.35), L3053-3099",
        f"{solution('(4.34)')}; with omega_c = 1.2 1/s, the greatest of appendix 2",
        f"{ROUNDING:g}, above rounding errors",
        at_most("", ROUNDING, balance_error(1.2)),
        why="2 lambda_c and 4 lambda_c stand for 2 lambda_c k0 and 4 lambda_c k0",
    )


def _first_order_series(parts: Coefficients) -> tuple[FourierSeries, ...]:
    """Return the series of M, K and F: the thesis's coefficients of inertia, stiffness and force, divided by the spring's.

    The quotients are taken to first order and have one harmonic.
    """
    return tuple(
        FourierSeries(np.array([mean, c]), np.array([0.0, s]))
        for mean, c, s in (
            _first_order_quotient(part, parts.spring) for part in (parts.inertia, parts.stiffness, parts.force)
        )
    )


def draw(result: StudyResult) -> Figure:
    """Draw M, K and F over the crank angle."""
    angle, *names = result.columns
    panels: list[Panel] = []
    for name in dict.fromkeys(column.partition(";")[0] for column in names):
        chosen = {c: "" if panels else c.partition("; ")[2].partition(" [")[0] for c in names if c.startswith(name)}
        curves = [
            replace(curve, line=line) for curve, line in zip(result_curves(result, angle, chosen), ("-", "--", ":"))
        ]
        panels.append(
            Panel(
                x_label=angle, y_label=f"{name}, I4 = 1", curves=curves, x_range=(0.0, 360.0), x_ticks=range(0, 361, 90)
            )
        )
    return plot_curves(panels, title=result.heading, columns=2, size=(3.9, 2.9))


#: The studies by number.
STUDIES = {"4.2": Study(compute, draw)}
