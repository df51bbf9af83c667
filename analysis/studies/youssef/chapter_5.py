"""Figures 5.1 to 5.3: the first region of instability without damping; Fig 5.4 is in `analysis.studies.youssef.damping`.

The slider's motion doubles its period near lambda_k^2 = k/((m4 + m5) omega^2) = k0/4, where the crank turns at about twice the
natural frequency. The thesis analyses the stability about zeta = 0, which is no solution of its equation (4.21); this equation
lacks the term M' zeta'. We analyse the stability of the true periodic orbit. We compare it with the corrected linear equation,
by Hill's determinant, and with the thesis's own coefficients: as printed, by (5.16), and as appendix 3 evaluates them. The axis
A of a region is omega/omega_k in its middle.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import pi

import numpy as np
from scipy.integrate import solve_ivp

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...youssef import (
    Form,
    Region,
    SliderEquation,
    Variant,
    boundary_stiffnesses,
    hill_multipliers,
    hill_regions,
    slider_equation,
)
from ..rules import ABOUT, ALIKE, SMALL
from ..statements import Case, FloatArray, Statement, at_least, at_most, listing, near, statement
from ..study import Study, StudyResult
from .linearised import with_crank
from .regions import LOOKS, WAYS, appendix_3_region, axis, crank_speed, equation, hill_region, orbit_region
from .runs import SIGN

#: Inertia ratios of appendix 3 whose regions are compared.
COMPARED = (0.5, 1.0, 1.5)
#: Tolerance of the axis A, in words.
OF_AXIS = f"{ABOUT:g} of 2 - A, the rule for *approximately*, because {ABOUT:g} of A itself would admit any region"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Figure of the first region of instability over a parameter of the mechanism.

    ``symbol`` is the parameter's symbol, ``values`` are its values. ``mechanism`` builds the mechanism at a value, and
    ``judge`` judges the statements. ``further`` maps names to other mechanisms, for which only the region of the true orbit
    is computed.
    """

    symbol: str
    label: str
    values: Sequence[float]
    mechanism: Callable[[float], FiveBarParameters]
    claim: str
    judge: Callable[[Mapping[str, Sequence[Region]]], Iterable[Statement]]
    assignment: str = ""
    further: Mapping[str, Callable[[float], FiveBarParameters]] | None = None


@cache
def regions(name: str) -> dict[str, list[Region]]:
    """Return the regions along a sweep, a list for each method and for each of the further mechanisms, by name."""
    sweep = SWEEPS[name]
    found = {way: [method(sweep.mechanism(x)) for x in sweep.values] for way, method in WAYS.items()}
    for way, mechanism in (sweep.further or {}).items():
        found[way] = [orbit_region(mechanism(x)) for x in sweep.values]
    return found


def widths(found: Iterable[Region]) -> FloatArray:
    """Return the widths of the regions in lambda_k^2."""
    return np.array([region.width for region in found])


def axes(found: Iterable[Region]) -> FloatArray:
    """Return the axes A of the regions."""
    return np.array([axis(region) for region in found])


def compute_sweep(number: str) -> StudyResult:
    """Compute the first region of instability over the parameter of a sweep, by all methods."""
    sweep, found = SWEEPS[number], regions(number)
    columns = {f"{sweep.symbol} [1]": np.array(sweep.values)}
    for way, these in found.items():
        columns[f"lambda_k^2; {way}; low [1]"] = np.array([region.low for region in these])
        columns[f"lambda_k^2; {way}; high [1]"] = np.array([region.high for region in these])
    return StudyResult(
        claim=sweep.claim, assignment=sweep.assignment, columns=columns, statements=tuple(sweep.judge(found))
    )


def draw_sweep(result: StudyResult) -> Figure:
    """Draw the regions over the parameter of a sweep, and their widths."""
    c, sweep = result.columns, SWEEPS[result.number]
    values = c[f"{sweep.symbol} [1]"]
    edges, sizes = [], []
    for (way, line), colour in zip((LOOKS | dict.fromkeys(sweep.further or (), "-")).items(), COLOURS):
        low, high = (c[f"lambda_k^2; {way}; {end} [1]"] for end in ("low", "high"))
        edges.append(Curve(x=values, y=low, label=way, colour=colour, line=line))
        edges.append(Curve(x=values, y=high, colour=colour, line=line))
        sizes.append(Curve(x=values, y=1e3 * (high - low), label=way, colour=colour, line=line))
    low, high = (c[f"lambda_k^2; true orbit; {end} [1]"] for end in ("low", "high"))
    region = np.column_stack([np.append(values, values[::-1]), np.append(low, high[::-1])])
    panels = [
        Panel(
            x_label=sweep.label,
            y_label=y_label,
            curves=curves,
            filled=filled,
            x_range=(values[0], values[-1]),
            legend_at="best",
        )
        for y_label, curves, filled in (
            (r"$\lambda_k^2$", edges, [[region]]),
            (r"width of the region in $\lambda_k^2$ [1e-3]", sizes, []),
        )
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.8, 4.0))


def judge_inertia(found: Mapping[str, Sequence[Region]]) -> Iterator[Statement]:
    """Judge the statements on Fig 5.1 and on the formulas behind it."""
    true, ratios = found["true orbit"], np.array(SWEEPS["5.1"].values)
    middles = np.array([0.5 * (region.low + region.high) for region in true]) - 0.25
    bent = np.abs(middles - middles[-1] / ratios[-1] * ratios).max() / middles[-1]
    listed, linear = appendix_3_region(chapter_4(0.5)), hill_region(chapter_4(0.5))
    shifts = [f"{shift_by_motion(ratio):.3f}" for ratio in COMPARED]
    yield statement(
        "As is clearly seen the region is narrow and its width increases with increase of I4.",
        "5.3.1, L3762-3764; the same in L3944-3946",
        "greatest width of the region in lambda_k^2 relative to its middle; least growth of the width from one I4 to the "
        "next; for the true periodic motion",
        f"{SMALL:g}, the rule for *small*, which we use for *narrow* too; {SIGN}",
        at_most("width", SMALL, (widths(true) / (middles + 0.25)).max()),
        at_least("growth", 0.0, np.diff(widths(true)).min()),
    )
    yield statement(
        "The region in [lambda_k^2] as a band also increases linearly with [I4] indicating that [insta]bility occurs "
        "when [omega]=A.[omega_k] with A=2 when [I4]=0 and decreasing with increase of I4.",
        "5.3.1, L3764-3770; the same in L3946-3950",
        "distance of the region's middle from the straight line between 1/4 at I4 = 0 and its value at I4 = 2, relative "
        "to the line's rise; axis A = omega/omega_k in the middle at I4 = 0; growth of A from one I4 to the next. For the "
        "true periodic motion, at I4 = 0 for the right linear equation",
        f"{ALIKE:g}, the rule for *linear*; 1e-5 for A = 2, above rounding errors; {SIGN}",
        at_most("distance from the line", ALIKE, bent),
        near("A at I4 = 0", "2", axis(hill_region(chapter_4(0.0))), 1e-5),
        at_most("growth of A, greatest", 0.0, np.diff(axes(true)).max()),
    )
    yield statement(
        "The stability of equation (4.29) may be investigated by considering the homogeneous part of it only.",
        "5.1, L3266-3268",
        "Floquet multipliers of the equation with its force, from solutions with three starts, minus those of its homogeneous "
        "part, in the middle of the first region at I4 = 1; for (4.29) as printed and for the right linear equation",
        "1e-6, the accuracy of the solutions",
        *judge_homogeneous_part(),
        why="for the mechanism, which is stable or not about the motion that the force causes (erratum 6), the region's "
        f"boundaries differ from those of the right linear equation by up to {', '.join(shifts[:-1])} and {shifts[-1]} of "
        "its width at I4 = 0.5, 1 and 1.5",
    )
    yield statement(
        "Also notice that a region was not obtained but merely a boundary of two stable regions.",
        "5.1.1 a, L3420-3424",
        "number of boundaries, below the second region, at which a Floquet multiplier is 1. Then the larger of the two "
        "multipliers at I4 = 0.5, 1 and 1.5: the greatest at 1.5 times lambda_k^2 of this boundary, and the least at "
        "half of it (our choice); right linear equation without a damper",
        "none for the number; 1 for stability, with 1e-9 for rounding errors",
        *judge_zeroth_boundary(),
        why="below the boundary, at higher speeds, the slider falls away. By (5.13) the boundary lies below lambda_k^2 = 0, "
        "which no spring gives; the mean of the right K, of second order in sigma2, puts it above 0",
    )
    yield statement(
        "Therefore from ([5].2), (5.4) and (5.12) we obtain [(5.13)] ... a region for [lambda_k^2] may be defined by "
        "[(5.16)] in which the system is unstable ... the second region of instability may now be defined by [(5.26)]",
        "5.1.1, eqs (5.13), (5.16), (5.26), L3404-3416, L3446-3464, L3555-3575",
        "boundaries by the formulas minus those by the determinant (5.35), for equation (4.29) as printed, relative to the "
        "region's width, and with (5.13) relative to the boundary itself; the greatest of I4 = 0.5, 1 and 1.5. Signs that our "
        "scan lacks or has wrong follow from (5.2), (5.11) and (5.23); h0 = 0, since the coupler has no mass",
        f"{SMALL:g}, the rule for *small*, for the next order",
        *judge_formulas(),
    )
    yield statement(
        "THIS PROG. INVISTIGATES STABILITY IN ABSENCE [O]F DAMPING",
        listing("appendix 3, L8638"),
        "*investigates* is read as finds right: boundaries in lambda_k^2 by the listing exactly as printed, at its I4 = "
        "0.5 and at sigma3 = 1 of its 0.8 to 1.2, and by the right linear equation",
        f"{SMALL:g} of the width by the right equation, the rule for *small*, for the next order, which (5.16) leaves out",
        *(
            near(side, f"{stated:.6f}", computed, SMALL * linear.width)
            for side, stated, computed in (("lower", listed.low, linear.low), ("upper", listed.high, linear.high))
        ),
        why="M' zeta' and 1/k0 are missing, and the harmonics of mass and stiffness are wrong (errata 2, 16, 18, 20)",
    )


def judge_homogeneous_part() -> tuple[Case, ...]:
    """Judge whether the force changes the multipliers of the linear equation, both as printed and corrected."""
    region = hill_region(chapter_4(1.0))
    speed = crank_speed(0.5 * (region.low + region.high))
    return tuple(
        at_most(name, 1e-6, change_by_force(slider_equation(chapter_4(1.0), speed, variant=variant, form=form)))
        for name, variant, form in (
            ("(4.29) as printed", Variant.PRINTED, Form.SERIES),
            ("right linear equation", Variant.EXACT, Form.STABILITY),
        )
    )


def change_by_force(with_force: SliderEquation) -> float:
    """Return the greatest change of a Floquet multiplier of a linear equation by its force, a modulus without unit."""
    without = with_force.homogeneous().stiffened(with_force.spring)

    def derivative(t: float, y: FloatArray) -> list[float]:
        a, b, c, force = (float(x(t)) for x in (without.a, without.b, without.c, with_force.force))
        return [y[1], (force - b * y[1] - c * y[0]) / a]

    starts = ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0])
    rest, *others = (solve_ivp(derivative, (0.0, 2.0 * pi), y, rtol=1e-10, atol=1e-12).y[:, -1] for y in starts)
    found = np.linalg.eigvals(np.transpose(others) - rest[:, None])
    return float(np.abs(np.sort_complex(found) - np.sort_complex(hill_multipliers(without))).max())


def shift_by_motion(ratio: float) -> float:
    """Return the shift of the first region's boundaries by the motion that the force causes, relative to the region's width.

    It is the greater distance of a boundary by the right linear equation from the same boundary of the true periodic motion.
    """
    linear, true = (method(chapter_4(ratio)) for method in (hill_region, orbit_region))
    return max(abs(linear.low - true.low), abs(linear.high - true.high)) / true.width


def listed_boundaries(given: SliderEquation) -> tuple[tuple[float, float], ...]:
    """Return the boundaries (low, high) in lambda_k^2 of regions 0 to 2 by (5.13), (5.16) and (5.26), with h0 = 0.

    Region 0 is the zeroth boundary, given twice.
    """
    s, k = given.spring_factor, given.stiffness.to_order(2)

    def amplitudes(n: int, lambda_k2: float) -> tuple[float, float]:
        return lambda_k2 * s.cos[n] / s.mean + k.cos[n], lambda_k2 * s.sin[n] / s.mean + k.sin[n]

    (n1, n2), (m1, m2) = (amplitudes(n, 1.0) for n in (1, 2))
    p, r = (n2**2 - 5.0 * n1**2) / 12.0 + m1 / 2.0, (n1**2 - 5.0 * n2**2) / 12.0 - m1 / 2.0
    q = m2 / 2.0 - n1 * n2 / 2.0
    zeroth = -0.5 * np.hypot(*amplitudes(1, 0.0)) ** 2
    middles = zeroth, 0.25, 1.0 - 0.5 * (p + r)
    halves = 0.0, 0.5 * np.hypot(*amplitudes(1, 0.25)), 0.5 * np.sqrt((p - r) ** 2 + 4.0 * q**2)
    return tuple(((middle - half) / s.mean, (middle + half) / s.mean) for middle, half in zip(middles, halves))


def judge_zeroth_boundary() -> tuple[Case, ...]:
    """Judge the number of boundaries near lambda_k^2 = 0, and the multipliers on both sides of the zeroth boundary."""
    counts: list[int] = []
    sides: dict[float, list[float]] = {1.5: [], 0.5: []}
    for ratio in COMPARED:
        found = equation(chapter_4(ratio))
        boundaries = boundary_stiffnesses(found, 1, count=3).real
        counts.append(int(np.count_nonzero(boundaries < 0.5)))
        for factor, sizes in sides.items():
            sizes.append(float(np.abs(hill_multipliers(found.stiffened(factor * boundaries[0]))).max()))
    return (
        near("boundaries", 1.0, max(counts), 0.0),
        at_most("multiplier above the boundary", 1.0 + 1e-9, max(sides[1.5])),
        at_most("multiplier below the boundary", 1.0 + 1e-9, min(sides[0.5])),
    )


def judge_formulas() -> tuple[Case, ...]:
    """Judge the perturbation formulas by Hill's determinant: their greatest errors for the inertia ratios `COMPARED`."""
    errors: dict[str, list[float]] = {}
    for ratio in COMPARED:
        given = slider_equation(chapter_4(ratio), 1.0, variant=Variant.PRINTED, form=Form.SERIES)
        (zeroth, _), *regions = listed_boundaries(given)
        right = hill_regions(given.homogeneous(), 2)
        below = boundary_stiffnesses(given.homogeneous(), 1, count=1)[0].real
        errors.setdefault("(5.13)", []).append(abs(zeroth / below - 1.0))
        for name, ends, region in zip(("(5.16)", "(5.26)"), regions, (right[1], right[2])):
            for end, x in zip(("low", "high"), ends):
                errors.setdefault(f"{name}, {end}", []).append(abs(x - getattr(region, end)) / region.width)
    return tuple(at_most(name, SMALL, max(values)) for name, values in errors.items())


#: Upper limits of I4 that Fig 5.1 may have, in words: the text does not say which range it means.
RANGES = {
    1.5: "I4 = 1.5, the end of Fig 5.4 (L3919), with which Fig 5.1 is compared (L3966)",
    2.0: "I4 = 2, the value of Fig 5.3",
}


def widest_by_inertia() -> dict[float, float]:
    """Return the greatest width (in lambda_k^2) of the regions of Fig 5.1 for the upper limits of I4 of `RANGES`."""
    found = widths(regions("5.1")["true orbit"])
    return {most: float(found[np.array(SWEEPS["5.1"].values) <= most].max()) for most in RANGES}


def judge_crank(found: Mapping[str, Sequence[Region]]) -> Iterator[Statement]:
    """Judge the statements on Fig 5.2."""
    true = found["true orbit"]
    at_half, listed = (
        [axis(of(with_crank(sigma2, 0.5))) for sigma2 in (0.01, 0.1)] for of in (orbit_region, appendix_3_region)
    )
    over = {most: widths(true).max() / x for most, x in widest_by_inertia().items()}
    yield statement(
        "The width of the region increases with increase of [sigma2].",
        "5.3.1, L3876; for crank and coupler again in L3938-3942",
        "least growth of the width from one sigma2 to the next, from 0.01 to 0.1 in steps of 0.01; for the true periodic "
        "motion",
        SIGN,
        at_least("", 0.0, np.diff(widths(true)).min()),
    )
    yield statement(
        "However the region diverges about an axis approximately given by [omega]=A.[omega_k] where A=1.968 when "
        "[sigma2] = 0.01 and increasing very slightly with increase of [sigma2].",
        "5.3.1, L3878-3882",
        "axis A = omega/omega_k in the middle of the region at sigma2 = 0.01; growth of A up to sigma2 = 0.1; for the "
        "true periodic motion. That the region diverges is judged in the row above",
        f"{OF_AXIS}; {SIGN}",
        near("A", "1.968", axes(true)[0], ABOUT * (2.0 - 1.968)),
        at_least("growth of A", 0.0, axes(true)[-1] - axes(true)[0]),
        why=f"at I4 = 0.5, which the listing has (L8641), A is {at_half[0]:.4f} at sigma2 = 0.01 and {at_half[1]:.4f} at 0.1; "
        f"only by the listing does it grow, from {listed[0]:.4f} to {listed[1]:.4f}",
    )
    yield statement(
        "The[ ]region is narrower than that of Fig. (5.1).",
        "5.3.1, L3882-3884",
        why="the range of I4 in Fig 5.1 is not stated. In the true periodic motion the greatest width, up to sigma2 = "
        "0.1 (L3927), is "
        + ", and ".join(f"{x:.2f} of that of Fig 5.1 up to {RANGES[most]}" for most, x in over.items()),
    )


def with_held_angles(sigma3: float, inertia_ratio: float = 2.0) -> FiveBarParameters:
    """Return the mechanism with sigma3 = l3/l4 and the thesis's link angles; its ground link and guide direction follow."""
    mechanism = with_same_ground(sigma3, inertia_ratio)
    ground = rect(mechanism.coupler_length, pi / 3.0) - rect(mechanism.rocker_length, 2.0 * pi / 3.0)
    return replace(mechanism, ground_length=abs(ground), slider_guide_angle=-phase(ground))


def with_same_ground(sigma3: float, inertia_ratio: float = 2.0) -> FiveBarParameters:
    """Return the mechanism with another coupler length, sigma3 = l3/l4, and an unchanged ground link."""
    mechanism = chapter_4(inertia_ratio)
    return replace(mechanism, coupler_length=sigma3 * mechanism.rocker_length)


#: Name of the sweep with a constant ground link.
SAME_GROUND = "true orbit on the same ground link"


def judge_coupler(found: Mapping[str, Sequence[Region]]) -> Iterator[Statement]:
    """Judge the statements on Fig 5.3, with constant angles as in the thesis, and with a constant ground link."""
    widest = float(widths(found["true orbit"]).max())
    over_crank = widest / float(widths(regions("5.2")["true orbit"]).max())
    at_half = axis(orbit_region(with_held_angles(0.8, 0.5)))
    both = {"angles held": found["true orbit"], "same ground link": found[SAME_GROUND]}
    seconds, listed = (
        {
            number: max(
                hill_region(p, 2, variant).width / hill_region(p, 1, variant).width
                for p in map(sweep.mechanism, sweep.values)
            )
            for number, sweep in SWEEPS.items()
        }
        for variant in (Variant.EXACT, Variant.FORTRAN)
    )
    yield statement(
        "The width of the region decreases with increase of [sigma3].",
        "5.3.1, L3892; for crank and coupler again in L3938-3942",
        "greatest growth of the width from one sigma3 to the next, from 0.8 to 1.2 in steps of 0.025; for the true "
        "periodic motion",
        SIGN,
        *(at_most(words, 0.0, np.diff(widths(found_regions)).max()) for words, found_regions in both.items()),
        why="on the same ground link, the region widens when the coupler is longer than about sigma3 = 1",
    )
    yield statement(
        "It also converges about an axis given by [omega]=A.[omega_k] where A=1.96 when [sigma3] = 0.8 and stays "
        "approximately constant with increase of [sigma3].",
        "5.3.1, L3892-3898",
        "axis A at sigma3 = 0.8; its range over sigma3 = 0.8 to 1.2, relative to 2 - A at 0.8; for the true periodic "
        "motion. That the region converges is judged in the row above",
        f"half a unit of the last digit; {OF_AXIS}",
        *(
            case
            for words, found_regions in both.items()
            for case in (
                near(f"A; {words}", "1.96", axes(found_regions)[0]),
                at_most(f"range; {words}", ABOUT, np.ptp(axes(found_regions)) / (2.0 - axes(found_regions)[0])),
            )
        ),
        why=f"at I4 = 0.5, which the listing has (L8641), A is {at_half:.4f} with the angles held",
    )
    yield statement(
        "This region is narrower than both regions of Figs. (5.1[)] and (5.2).",
        "5.3.1, L3898-3900",
        "greatest width of the region, with the angles held, relative to that of each other figure; for the true "
        "periodic motion. The range of I4 in Fig 5.1 is not stated; we take the two ranges of the row at L3882",
        SIGN,
        *(
            at_most(
                f"Fig 5.1, up to I4 = {most:g}",
                1.0,
                widest / width,
                why=("I4 is 2 here, and " if most < 2.0 else "") + "a shorter coupler widens the region",
            )
            for most, width in widest_by_inertia().items()
        ),
        at_most("Fig 5.2", 1.0, over_crank, why="I4 is 2 here and 1 there, and a greater I4 widens the region"),
    )
    yield statement(
        "In all the above examples the second region of instability was so small within the values of [sigma2], "
        "[sigma3] and [I4] it was negligible.",
        "5.3.1, L3902-3906",
        "width of the second region in lambda_k^2 relative to that of the first, the greatest of each figure, in Fig "
        "5.3 with the angles held; right linear equation",
        f"{SMALL:g}, the rule for *negligible*, relative to the first region; relative to its middle even the first "
        "region would be negligible",
        *(at_most(f"Fig {number}", SMALL, x) for number, x in seconds.items()),
        why="in the width of the first region the terms of first order largely cancel. By the listing of appendix 4 they do "
        f"not, and the ratio is at most {max(listed.values()):.3f} (errata 2, 16, 17, 20)",
    )


SWEEPS = {
    "5.1": Sweep(
        symbol="I4",
        label="inertia ratio I4",
        values=np.linspace(0.25, 2.0, 8).tolist(),
        mechanism=chapter_4,
        claim="The first region of instability in lambda_k^2 over I4; sigma2 = 0.05.",
        judge=judge_inertia,
        assignment="I4 = 0.25 to 2 in steps of 0.25 is our choice. Remarks a and b (L3938-3946) speak of stability, "
        "which we read as a narrow region. The true periodic motion is the motion of the mechanism itself.",
    ),
    "5.2": Sweep(
        symbol="sigma2",
        label="crank's length sigma2 = l2/l4",
        values=np.linspace(0.01, 0.1, 10).tolist(),
        mechanism=with_crank,
        claim="The first region of instability in lambda_k^2 over sigma2; I4 = 1.",
        judge=judge_crank,
    ),
    "5.3": Sweep(
        symbol="sigma3",
        label="coupler's length sigma3 = l3/l4",
        values=np.linspace(0.8, 1.2, 17).tolist(),
        mechanism=with_held_angles,
        claim="The first region of instability in lambda_k^2 over sigma3; sigma2 = 0.05, I4 = 2.",
        judge=judge_coupler,
        assignment="The text does not say what else changes with sigma3. The program of appendix 3 holds the angles of coupler "
        "and rocker (L8641-8688), which requires another ground link and an inclined guide at every sigma3. We hold 60 and "
        "120 deg, the angles with B at the crank shaft; the listing has 57 and 120 deg at a crank angle of 149 deg, which "
        "changes A at sigma3 = 0.8 by 0.002. We also vary the coupler on the same ground link.",
        further={SAME_GROUND: with_same_ground},
    ),
}


#: The studies by number.
STUDIES = {number: Study(partial(compute_sweep, number), draw_sweep) for number in SWEEPS}
