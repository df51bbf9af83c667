"""Figure 5.4: the first region of instability with a damper, and the thesis's ways to find regions with a damper.

A damper is given by omega_c = mu/(m4 + m5) (1/s).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from math import pi

import numpy as np

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.boundaries import Box, Chart, Test, chart
from ...numerics.fourier import FourierSeries
from ...periodic import Drive, Operation, Plane, RemovingDamping, orbit_test, removing_damping
from ...youssef import (
    PeriodicEquation,
    Region,
    Variant,
    boundary_stiffnesses,
    hill_multipliers,
    hill_regions,
    linear_test,
    slider_equation,
)
from ..rules import ALIKE, SMALL
from ..statements import Case, Statement, at_least, at_most, listing, near, statement
from ..study import Study, StudyResult, pad_columns
from .chapter_5 import COMPARED, SWEEPS, with_held_angles, with_same_ground
from .linearised import with_crank
from .regions import appendix_3_region, crank_speed, equation, first_order_region, hill_region, removing_estimate
from .runs import ALIKE_WORDS, SIGN

#: The stated damper: omega_c (1/s) that removes the region up to I4 = 1.5 according to the thesis.
STATED = 0.45
#: Range of the chart over lambda_k^2 and I4, dampers omega_c (1/s) of the regions, and search range of the removing damper.
BOX = Box(x=(0.25, 0.29), y=(0.25, 2.0))
DAMPERS = (0.0, 0.05, 0.1, 0.15)
RANGE = (0.0, 1.2)
#: Crank angles at which the coefficients are divided, and number of harmonics that represents the quotients fully.
ANGLES = np.linspace(0.0, 2.0 * pi, 256, endpoint=False)
ALL_HARMONICS = 64
#: Number of harmonics of the coefficients in (4.29) and in the listing of appendix 4.
LISTED_HARMONICS = 2
#: I4 at which the removing damper is computed.
RATIOS = np.linspace(0.25, 2.0, 8)
#: Test functions of the true orbit, and of the linear equations about zeta = 0.
MOTIONS: Mapping[str, Callable[[Plane, int], Test]] = {
    "true orbit": orbit_test,
    "(4.21) as printed": partial(linear_test, variant=Variant.PRINTED),
    "listing of appendix 4": partial(linear_test, variant=Variant.FORTRAN),
}


def with_damping(omega_c: float) -> Plane:
    """Return a function of lambda_k^2 and I4 that returns the mechanism and its drive, with a damper omega_c (1/s)."""

    def operation(lambda_k2: float, inertia_ratio: float) -> Operation:
        return chapter_4(inertia_ratio, omega_c), Drive(speed=crank_speed(lambda_k2))

    return operation


@cache
def removing_damper(motion: str, inertia_ratio: float) -> RemovingDamping:
    """Find the damper omega_c (1/s) that removes the first region at an inertia ratio, by one of the `MOTIONS`."""

    def test(lambda_k2: float, omega_c: float) -> float:
        return MOTIONS[motion](with_damping(omega_c), -1)(lambda_k2, inertia_ratio)

    return removing_damping(test, BOX.x, RANGE, samples=12)


def greatest_removing_damper(motion: str) -> float:
    """Return the greatest damper omega_c (1/s) by `removing_damper` that the first region needs up to I4 = 1.5."""
    return max(removing_damper(motion, x).damping for x in RATIOS.tolist() if x <= 1.5)


def orbit_removing_damper(mechanisms: Iterable[FiveBarParameters]) -> float:
    """Find the damper omega_c (1/s) that removes the first region of the true orbit, for the mechanism that needs the most.

    That mechanism is the one with the greatest `removing_estimate`.
    """
    parameters = max(mechanisms, key=removing_estimate)
    region, mass = hill_region(parameters), parameters.rocker_mass + parameters.slider_mass

    def test(lambda_k2: float, omega_c: float) -> float:
        operation = replace(parameters, slider_damping=omega_c * mass), Drive(speed=crank_speed(lambda_k2))
        return orbit_test(lambda *_: operation, -1)(lambda_k2, 0.0)

    across = region.low - 0.5 * region.width, region.high + 0.5 * region.width
    return removing_damping(test, across, RANGE, samples=12).damping


def multiplier(inertia_ratio: float, omega_c: float, speed: float) -> float:
    """Return the greatest modulus of the Floquet multipliers of the correct linear equation.

    ``omega_c`` is the damper (1/s), ``speed`` the crank speed (rad/s).
    """
    found = slider_equation(chapter_4(inertia_ratio, omega_c), speed)
    return float(np.abs(hill_multipliers(found.homogeneous().stiffened(found.spring))).max())


def divide_by_mass(found: PeriodicEquation, harmonics: int) -> PeriodicEquation:
    """Return an equation divided by its mass, as in (5.27), with the given number of harmonics kept in the quotients."""
    mass = found.a(ANGLES)
    b, c, factor = (FourierSeries.from_samples(x(ANGLES) / mass, harmonics) for x in (found.b, found.c, found.factor))
    return PeriodicEquation(a=FourierSeries.constant(1.0), b=b, c=c, factor=factor)


def equation_without_factor(inertia_ratio: float, lambda_c: float) -> PeriodicEquation:
    """Return the equation (5.29) of chi, derived from the correct linear equation.

    Here zeta is chi times the factor exp(-1/2 int psi1).
    """
    found = replace(slider_equation(chapter_4(inertia_ratio), crank_speed(0.25)), damping=lambda_c)
    whole = divide_by_mass(found.homogeneous(), ALL_HARMONICS)
    psi1, psi2 = whole.b, whole.c
    rest = psi2(ANGLES) - 0.5 * psi1.derivative()(ANGLES) - 0.25 * psi1(ANGLES) ** 2
    return replace(whole, b=FourierSeries.constant(0.0), c=FourierSeries.from_samples(rest, ALL_HARMONICS))


def judge_shifts() -> tuple[Case, ...]:
    """Judge how a damper of omega_c = `STATED` shifts regions 1 to 4 of (5.30) and changes their widths.

    The values of I4 are those of `COMPARED`.
    """
    found: list[tuple[float, float, float]] = []
    for ratio in COMPARED:
        for n, free in hill_regions(equation_without_factor(ratio, 0.0), 4).items():
            lambda_c = STATED / crank_speed(free.low)
            damped = equation_without_factor(ratio, lambda_c)
            region, k0 = hill_regions(damped, 4)[n], damped.factor.mean
            shift = 0.5 * (region.low + region.high - free.low - free.high)
            found.append((shift * k0 / (0.25 * lambda_c**2 * k0**2), shift / free.low, region.width / free.width))
    of_stated, relative, width = zip(*found)
    return (
        near("shift over the stated quantity", 1.0, farthest(of_stated), ALIKE),
        at_most("shift over lambda_k^2", SMALL, max(relative)),
        near("width over that without a damper", 1.0, farthest(width), ALIKE),
    )


def error_of_factor(inertia_ratio: float) -> float:
    """Return the greatest error of the multipliers by (5.28) and (5.29), with a damper of omega_c = `STATED`.

    The multipliers of (5.29), times the factor of (5.28), are compared with those of the whole equation.
    """
    region = hill_region(chapter_4(inertia_ratio))
    found = slider_equation(chapter_4(inertia_ratio, STATED), crank_speed(0.5 * (region.low + region.high)))
    psi1 = divide_by_mass(found.homogeneous(), ALL_HARMONICS).b
    bare = equation_without_factor(inertia_ratio, found.damping)
    by_factor = np.exp(-pi * psi1.mean) * hill_multipliers(bare.stiffened(found.spring))
    whole = hill_multipliers(found.homogeneous().stiffened(found.spring))
    return float(np.abs(np.sort_complex(by_factor) - np.sort_complex(whole)).max())


def farthest(values: Iterable[float]) -> float:
    """Return the value that is farthest from 1."""
    return max(values, key=lambda x: abs(x - 1.0))


def region_width(found: Chart, inertia_ratio: float) -> float:
    """Return the width in lambda_k^2 of the region in a chart at an inertia ratio I4, zero if there is no region."""
    roots = found.scan_line(inertia_ratio, samples=100).roots
    return float(np.ptp(roots)) if len(roots) else 0.0


def narrowing(charts: Mapping[float, Chart], inertia_ratio: float) -> float:
    """Return the greatest change of the region's width from one damper to the next, negative if each change narrows the region.

    Changes from a damper without a region do not count.
    """
    widths = np.array([region_width(found, inertia_ratio) for found in charts.values()])
    return float(np.diff(widths)[widths[:-1] > 0.0].max())


def growth_outside_region(omega_c: float) -> float:
    """Return the greatest real part s1 of Lambda (5.32) outside the first region, for a damper (1/s) and the I4 `COMPARED`."""
    sizes: list[float] = []
    for ratio in COMPARED:
        region = hill_region(chapter_4(ratio))
        places = 0.2, region.low - 0.5 * region.width, region.high + 0.5 * region.width, 0.35
        sizes += [multiplier(ratio, omega_c, crank_speed(lambda_k2)) for lambda_k2 in places]
    return float(np.log(max(sizes)) / (2.0 * pi))


def determinant_errors(harmonics: int, order: int = 2) -> dict[int, float]:
    """Return the errors of regions 1 to 4 by the determinant (5.35) at I4 = 1, relative to the regions' widths.

    The coefficients of the divided equation (5.27) are cut after the given number of harmonics, and the solution (5.31) after
    the harmonic ``order``; with order 2 it has nine terms. Each error is the greater of the region's two boundaries.
    """
    exact = equation(chapter_4(1.0))
    cut = divide_by_mass(exact, harmonics)
    # the first boundary with the multiplier 1 is the zeroth
    even, odd = (boundary_stiffnesses(cut, m, count=c, order=order).real for m, c in ((1, 5), (-1, 4)))
    ends = {1: odd[:2], 2: even[1:3], 3: odd[2:], 4: even[3:]}
    return {
        n: max(abs(ends[n][0] - whole.low), abs(ends[n][1] - whole.high)) / whole.width
        for n, whole in hill_regions(exact, 4).items()
    }


def judge_damper(charts: Mapping[float, Chart]) -> Iterator[Statement]:
    """Judge the statements on the regions with a damper, given their charts by omega_c (1/s)."""
    tips = [float(found.boundaries[0].points[:, 1].min()) for d, found in charts.items() if d > 0.0]
    growth = max(narrowing(charts, ratio) for ratio in (*COMPARED, 2.0))
    crank, coupler, mechanism = (0.001, *SWEEPS["5.2"].values), SWEEPS["5.3"].values, chapter_4(1.5)
    fast = crank_speed(0.5 * boundary_stiffnesses(equation(mechanism), 1, count=1)[0].real)
    yield statement(
        "It is clearly seen that regions of instability of the above system will resemble those obtained for the case of no "
        "damping but shifted by a small amount represented by the second order quantity of [1/4 lambda_c^2 k0^2] in (5[.]30). "
        "However, all solutions of this equation are multiplied by the factor [exp(-1/2 int psi1 dtheta)] as shown in (5.28).",
        "5.2.1, L3628-3639",
        f"regions 1 to 4 of (5.29) with omega_c = {STATED:g} 1/s and without a damper: shift of the middle in lambda_k^2 "
        "k0 divided by the stated quantity; shift divided by lambda_k^2; width divided by that without a damper. Then the "
        "Floquet multipliers of (5.29) times this factor over a turn, minus those of (5.27), in the middle of the first "
        "region. The largest deviation of I4 = 0.5, 1 and 1.5 is listed; right linear equation",
        f"{ALIKE_WORDS}; {SMALL:g} for the shift over lambda_k^2, the rule for *small*; 1e-6 for the multipliers, for "
        "rounding errors",
        *judge_shifts(),
        at_most("multipliers", 1e-6, max(map(error_of_factor, COMPARED))),
    )
    yield statement(
        "As would be expected the region is decreased in width as [omega_c] is increased.",
        "5.3.2, L3915-3917",
        "greatest growth of the width in lambda_k^2 from one damper to the next, up to the damper that removes the "
        "region, at I4 = 0.5, 1, 1.5 and 2; for the true periodic motion",
        SIGN,
        at_most("", 0.0, growth),
    )
    yield statement(
        "It is also shifted to the right with increase of [omega_c] and is completely eliminated anywhere within "
        "[I4 = 0] to 1.5 for the value of [omega_c] = 0.45.",
        "5.3.2, L3917-3921",
        "least growth of the I4 at which the region begins, from one damper to the next of 0.05, 0.1 and 0.15 1/s (*to the "
        "right* on a plot over I4, L3910; without a damper the region begins at I4 = 0); greatest omega_c that is needed to "
        "remove the region up to I4 = 1.5; for the true periodic motion",
        "none: the sign decides, and whether the region is removed",
        at_least("growth", 0.0, np.diff(tips).min()),
        at_most("omega_c", "0.45", greatest_removing_damper("true orbit"), "1/s"),
    )
    yield statement(
        "The instability regions shown in figs. (5.2) and (5.3) were also completely eliminated for the values "
        "of [omega_c] = 0.45 anywhere within [sigma2] = [0.]001 to 0.1 and [sigma3] = 0.8 to 1.2 respectively.",
        "5.3.2, L3923-3929",
        "omega_c that is needed to remove the region, for the true periodic motion, at the length that needs the most by "
        "the right linear equation: of sigma2 = 0.001 and 0.01 to 0.1 in steps of 0.01, and of sigma3 = 0.8 to 1.2 in "
        "steps of 0.025",
        "none: the region is removed or it is not",
        *(
            at_most(name, "0.45", orbit_removing_damper(mechanisms), "1/s")
            for name, mechanisms in (
                ("Fig 5.2", map(with_crank, crank)),
                ("Fig 5.3; angles held", map(with_held_angles, coupler)),
                ("Fig 5.3; same ground link", map(with_same_ground, coupler)),
            )
        ),
        why="on the same ground link the region is wider",
    )
    yield statement(
        "Viscous damping had a stabilising effect. It was also possible to choose a value for this damping "
        "making the linkage under study completely stable for all ranges of speeds.",
        "5.3.3 c, L3952-3958",
        "growth of the width as above. Then, by the right linear equation at I4 = 1.5: omega_c that removes regions 1 "
        f"to 4, estimated from their widths; greatest multiplier beyond the zeroth boundary, at {fast:.0f} rad/s, with "
        f"{STATED:g} 1/s (L3921) and with a thousand times as much",
        f"{STATED:g} 1/s, the value of L3921, for omega_c; otherwise none: the sign and the stability decide",
        at_most("growth of the width", 0.0, growth),
        at_most("omega_c", STATED, max(removing_estimate(mechanism, n) for n in range(1, 5)), "1/s"),
        *(at_most(f"multiplier; {d:g} 1/s", 1.0, multiplier(1.5, d, fast)) for d in (STATED, 1e3 * STATED)),
        why="beyond the zeroth boundary the slider falls away; a damper slows it but does not stop it",
    )


def judge_determinant() -> Iterator[Statement]:
    """Judge the statements on the method (5.31) to (5.35) and on its program."""
    dampers = {f"omega_c = {DAMPERS[2]:g} 1/s": DAMPERS[2], "without a damper, as in 5.3.3 e": 0.0}
    ways: dict[str, tuple[Variant, Callable[[FiveBarParameters], Region]]] = {
        "right equation": (Variant.EXACT, partial(first_order_region, variant=Variant.EXACT)),
        "listings": (Variant.FORTRAN, appendix_3_region),
    }
    apart, shares = {}, []
    for name, (variant, perturbed) in ways.items():
        pairs = [(hill_region(p, variant=variant), perturbed(p)) for p in map(chapter_4, COMPARED)]
        # at I4 = 0 the region begins at lambda_k^2 = 1/4
        scale = pairs[-1][0].high - 0.25
        for end in ("low", "high"):
            sizes = [abs(getattr(region, end) - getattr(other, end)) for region, other in pairs]
            apart[f"{name}; {end}"] = max(sizes) / scale
            shares += [size / region.width for size, (region, _) in zip(sizes, pairs)]
    yield statement(
        "The values of [omega] and s2 that satisfy equations (5.35) determine the boundaries of the unstable regions.",
        "5.2.2, eqs (5.33) to (5.35), L3717-3719",
        "greatest real part s1 of Lambda outside the first region: half a width away from it, and at lambda_k^2 = 0.2 "
        "and 0.35, for I4 = 0.5, 1 and 1.5; right linear equation. Where s1 is 0, some s2 satisfies (5.35)",
        "below 0 by more than 1e-9, above rounding errors",
        *(at_most(name, -1e-9, growth_outside_region(omega_c)) for name, omega_c in dampers.items()),
        why="without a damper s1 is 0 at every stable speed, not only at the boundaries",
    )
    yield statement(
        "For a particular mechanism the method is capable of giving all the boundaries of the unstable regions without "
        "any extra work.",
        "5.2.2, L3730-3734",
        "boundaries by (5.35) cut after the ninth term (L3930) minus those without any cut, relative to the region's "
        "width. The coefficients have two harmonics, as in (4.29), or all harmonics. The four regions that nine terms "
        "have; right linear equation, divided by M as (5.27), I4 = 1, without a damper",
        f"{SMALL:g}, the rule for *small*",
        *(
            at_most(f"region {n}; {name}", SMALL, x)
            for name, harmonics in (("as in (4.29)", LISTED_HARMONICS), ("all harmonics", ALL_HARMONICS))
            for n, x in determinant_errors(harmonics).items()
        ),
        why="it does need extra work: more harmonics for the third region, and more terms for the fourth",
    )
    yield statement(
        "The computer orientated method provided a fast method for solving the stability problem.",
        "5.3.3 d, L3960-3962",
        why="no times are given",
    )
    yield statement(
        "The computer orientated method gave results which are in good agreement with the perturbation method; "
        "see the outer boundary of fig. (5.4) and fig. (5.1).",
        "5.3.3 e, L3964-3968",
        "outer boundaries of the first region, those without a damper: by (5.35) minus by (5.16), relative to the least "
        "scale of their graph, from 1/4 at I4 = 0 to the highest boundary at I4 = 1.5. Right linear equation, and "
        "listings of appendices 4 and 3; the greatest difference of I4 = 0.5, 1 and 1.5",
        f"{ALIKE:g}, the rule for *the same*, which we use for *good agreement* as at L6865",
        *(at_most(name, ALIKE, x) for name, x in apart.items()),
        why=f"but relative to the region's width, the listings' boundaries differ by up to {max(shares):.2f} (errata 17, 18)",
    )
    yield statement(
        "THIS PROG. INVIST[I]GATES STABILITY IN[ ]PRESENCE [O]F DAMPING",
        listing("appendix 4, L8698"),
        "*investigates* is read as finds right: omega_c that removes the first region up to I4 = 1.5, by the equation "
        "of the listing (its cut after nine terms does not change these digits) and for the true periodic motion",
        "0.0005 1/s, the accuracy of the listing's value",
        near(
            "",
            f"{greatest_removing_damper('listing of appendix 4'):.3f}",
            greatest_removing_damper("true orbit"),
            unit="1/s",
        ),
        why="the listing's regions are too wide (errata 2, 16, 17, 20)",
    )


def compute() -> StudyResult:
    """Compute the boundaries of the first region with each damper, and the damper that removes the region at each I4."""
    charts = {d: chart(orbit_test(with_damping(d), -1), BOX, lines=(0, 4), samples=100) for d in DAMPERS}
    columns = {"I4 [1]": RATIOS}
    for motion in MOTIONS:
        columns[f"removing omega_c; {motion} [1/s]"] = np.array(
            [removing_damper(motion, x).damping for x in RATIOS.tolist()]
        )
    for omega_c, found in charts.items():
        for n, boundary in enumerate(found.boundaries, start=1):
            name = f"omega_c = {omega_c:g} 1/s; boundary {n} [1]"
            columns[f"lambda_k^2; {name}"], columns[f"I4; {name}"] = boundary.points.T
    return StudyResult(
        claim="omega_c = mu/(m4 + m5) narrows the region, and 0.45 1/s removes it up to I4 = 1.5.",
        assignment="The dampers of the regions, 0, 0.05, 0.1 and 0.15 1/s, are our choice. The damper that removes the "
        "region is found at I4 = 0.25 to 2 in steps of 0.25.",
        columns=pad_columns(columns),
        statements=(*judge_damper(charts), *judge_determinant()),
    )


def draw(result: StudyResult) -> Figure:
    """Draw the first region with each damper, and the damper that removes it over I4."""
    c = result.columns
    boundaries = []
    for colour, omega_c in zip(COLOURS, DAMPERS):
        for n in (1, 2):
            name = f"omega_c = {omega_c:g} 1/s; boundary {n} [1]"
            if f"I4; {name}" in c:
                label = f"{omega_c:g}" if n == 1 else ""
                boundaries.append(Curve(x=c[f"I4; {name}"], y=c[f"lambda_k^2; {name}"], colour=colour, label=label))
    removal = [
        Curve(x=RATIOS, y=c[f"removing omega_c; {motion} [1/s]"][: len(RATIOS)], label=motion, line=line)
        for motion, line in zip(MOTIONS, ("-", ":", "-."))
    ]
    removal.append(Curve(x=[0.0, 1.5], y=[STATED, STATED], colour="0.1", line="--", label="stated up to 1.5"))
    panels = [
        Panel(
            x_label="inertia ratio I4",
            y_label=y_label,
            curves=curves,
            legend=legend,
            legend_at="upper left",
            x_range=BOX.y,
            y_range=y_range,
        )
        for y_label, curves, legend, y_range in (
            (r"$\lambda_k^2$", boundaries, r"$\omega_c$ [1/s], true orbit", BOX.x),
            (r"damper $\omega_c$ that removes the region [1/s]", removal, "", (0.0, 1.0)),
        )
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.8, 4.0))


#: The study by its number.
STUDIES = {"5.4": Study(compute, draw)}
