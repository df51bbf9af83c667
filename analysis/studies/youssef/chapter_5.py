"""Figures of chapter V: the first region of instability, without damping and with it.

The slider's motion doubles its period near lambda_k^2 = k/((m4 + m5) omega^2) = k0/4, where the crank turns at about twice the
natural frequency. The thesis analyses the stability about zeta = 0, which is no solution of its equation (4.21); this equation
lacks the term M' zeta'. We analyse the stability of the true periodic orbit. We compare it with the corrected linear equation,
by Hill's determinant, and with the thesis's own coefficients: as printed, by (5.16), and as appendix 3 evaluates them. The axis
A of a region is omega/omega_k in its middle.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.boundaries import Box, Chart, Test, chart
from ...numerics.fourier import FourierSeries
from ...periodic import Drive, Operation, Plane, RemovingDamping, orbit_test, removing_damping
from ...youssef import (
    Form,
    PeriodicEquation,
    Region,
    SliderEquation,
    Variant,
    boundary_stiffnesses,
    hill_multipliers,
    hill_regions,
    linear_test,
    slider_equation,
)
from ..rules import ABOUT, ALIKE, SMALL
from ..statements import Case, Statement, at_least, at_most, listing, near, text
from ..study import Study, StudyResult, padded
from .linearised import with_crank
from .regions import LOOKS, WAYS, appendix_3, axis, crank_speed, equation, first_order, hill, removing_estimate, right
from .runs import ALIKE_WORDS, SIGN

FINDINGS = """\
**Claims.** Chapter V takes the homogeneous equation (4.29), finds its first region of instability, near twice the
natural frequency, by perturbation and by a determinant, follows it over the rocker's inertia, the crank's and the
coupler's length, and removes it with a damper.

**What stands.** The formulas (5.13), (5.16), (5.26) and the determinant (5.35) agree with each other. The region is
narrow, widens with I4 and with the crank, and moves in proportion to I4 from A = 2. A damper narrows and removes it;
over I4 and the crank's length 0.45 1/s is more than twice what is needed.

**What does not.** The equation lacks M' zeta' and is taken about zeta = 0, which is no motion of the slider. The
missing M' zeta', a wrong K, the halved harmonics of the mass and the lost 1/k0 make the regions of the listing about two
and a half times too wide (2.7 at I4 = 0.5, 2.5 at 1.5): at I4 = 1 it has 0.26580 to 0.27054, the right linear equation
0.26663 to 0.26844, and the true periodic motion 0.26654 to 0.26837; and the damper that removes the region up to I4 =
1.5 is 0.167 1/s, where the listing needs 0.459. The second region is not negligible: the terms of first order largely
cancel in the first, so that the second is half as wide, and with the longest crank wider. The axes of Fig 5.2 and 5.3
are not those of I4 = 1 and 2, which the text has: 1.96 is what the listing gives at its I4 = 0.5 (1.9649; the true motion
1.9655), and 1.968 lies near the axis of I4 = 0.5 (1.967; by the listing 1.964). Fig 5.3 varies the coupler with the
angles held, to which another ground link belongs at each length; on one ground link the region is narrowest near equal
links. Nor is the region of Fig 5.3 narrower than that of Fig 5.2. Cut after nine terms, the determinant gives two regions,
not all, and without a damper (5.35) is met at every stable speed, not at the boundaries alone. The zeroth boundary does
not part two stable regions: beyond it, from 1565 rad/s at I4 = 0.5 and 908 rad/s at 1.5, the slider falls away, and a
damper only slows it."""

#: omega_c (1/s) that removes the region up to I4 = 1.5, as stated.
STATED = 0.45
#: Inertia ratios of appendix 3 whose regions are compared.
COMPARED = (0.5, 1.0, 1.5)
#: Names of the methods in the tables.
NAMES = {"linear equation": "linear equation", "true orbit": "true motion"}

# Figures 5.1 to 5.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Figure of the first region of instability over a parameter of the mechanism.

    ``symbol`` is the parameter's symbol, ``values`` are its values. ``mechanism`` builds the mechanism at a value, and
    ``judge`` judges the statements. ``further`` maps names to other mechanisms, for which only the region of the true orbit
    is computed.
    """

    number: str
    symbol: str
    label: str
    values: Sequence[float]
    mechanism: Callable[[float], FiveBarParameters]
    claim: str
    judge: Callable[[Mapping[str, Sequence[Region]]], tuple[Statement, ...]]
    assignment: str = ""
    further: Mapping[str, Callable[[float], FiveBarParameters]] | None = None


@cache
def regions(name: str) -> dict[str, list[Region]]:
    """Return the regions along a sweep, a list for each method and for each of the further mechanisms, by name."""
    sweep = SWEEPS[name]
    found = {way: [of(sweep.mechanism(x)) for x in sweep.values] for way, of in WAYS.items()}
    for way, mechanism in (sweep.further or {}).items():
        found[way] = [right(mechanism(x)) for x in sweep.values]
    return found


def widths(found: Iterable[Region]) -> NDArray[np.float64]:
    """Return the widths of the regions in lambda_k^2."""
    return np.array([region.width for region in found])


def axes(found: Iterable[Region]) -> NDArray[np.float64]:
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
        number=number,
        claim=sweep.claim,
        assignment=sweep.assignment,
        columns=columns,
        statements=sweep.judge(found),
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


def judge_inertia(found: Mapping[str, Sequence[Region]]) -> tuple[Statement, ...]:
    """Judge the statements on Fig 5.1 and on the formulas behind it."""
    true, ratios = found["true orbit"], np.array(SWEEPS["5.1"].values)
    middles = np.array([0.5 * (region.low + region.high) for region in true]) - 0.25
    bent = np.abs(middles - middles[-1] / ratios[-1] * ratios).max() / middles[-1]
    at_unity = equation(chapter_4(1.0))
    zeroth = boundary_stiffnesses(at_unity, 1, count=1)[0].real
    listed = []
    for ratio in COMPARED:
        by_listing = appendix_3(chapter_4(ratio))
        for way in ("linear equation", "true orbit"):
            region = WAYS[way](chapter_4(ratio))
            listed += [
                near(f"{side}; I4 = {ratio:g}; {NAMES[way]}", f"{x:.6f}", y, SMALL * region.width)
                for side, x, y in zip(("lower", "upper"), (by_listing.low, by_listing.high), (region.low, region.high))
            ]
    return (
        Statement(
            "As is clearly seen the region is narrow and its width increases with increase of I4.",
            text("5.3.1, L3762-3764; the same in L3944-3946"),
            "width of the region of the true periodic motion relative to its middle, greatest; growth of the width "
            "with I4, least",
            f"{SMALL:g}, the rule for *small*, for *narrow* too; {SIGN}",
            (
                at_most("width", SMALL, (widths(true) / (middles + 0.25)).max()),
                at_least("growth", 0.0, np.diff(widths(true)).min()),
            ),
        ),
        Statement(
            "The region in [lambda_k^2] as a band also increases linearly with [I4] indicating that [insta]bility occurs "
            "when [omega]=A.[omega_k] with A=2 when [I4]=0 and decreasing with increase of I4.",
            text("5.3.1, L3764-3770; the same in L3946-3950"),
            "distance of the middle of the region of the true periodic motion, which is read, by us, as what increases, from "
            "the straight line through 1/4 at I4 = 0 and its value at I4 = 2, relative to the line's rise; A = omega/omega_k "
            "in the middle, at I4 = 0, where the region has no width, by the right linear equation; growth of A with I4",
            f"{ALIKE_WORDS}; 1e-5 for A = 2, above rounding errors; {SIGN}",
            (
                at_most("distance from the line", ALIKE, bent),
                near("A at I4 = 0", "2", axis(hill(chapter_4(0.0))), 1e-5),
                at_most("growth of A, greatest", 0.0, np.diff(axes(true)).max()),
            ),
        ),
        Statement(
            "Also notice that a region was not obtained but merely a boundary of two stable regions.",
            text("5.1.1 a, L3420-3424"),
            "for the right linear equation at I4 = 0.5, 1 and 1.5: number of boundaries with the Floquet multiplier 1 below "
            "the second region, the most; greatest size of a multiplier at 1.5 times the zeroth boundary, the most, and at "
            "half of it, the least",
            "none: it is one boundary or it is not, and stability decides, but for rounding errors of 1e-9",
            zeroth_boundary(),
            f"below it the slider falls away; by (5.13) itself it lies below 0, where no speed is: the mean of K, of second "
            f"order, puts it at lambda_k^2 = {zeroth:.5f} at I4 = 1",
        ),
        Statement(
            "Therefore from ([5].2), (5.4) and (5.12) we obtain [(5.13)] ... a region for [lambda_k^2] may be defined by "
            "[(5.16)] in which the system is unstable ... the second region of instability may now be defined by [(5.26)]",
            text("5.1.1, eqs (5.13), (5.16), (5.26), L3404-3416, L3446-3464, L3555-3575"),
            "boundaries by the formulas less those by the determinant (5.35), for the printed equation (4.29) at I4 = 0.5, 1 "
            "and 1.5, relative to the width of the region, and (5.13) to the boundary itself, greatest; h0 = 0, as G1 "
            "vanishes; read, by us, where our scan has other or no signs: the factor -1/2 of (5.12), by (5.11), 1/k0 before "
            "the braces of (5.16), by (5.2), and (P - R)^2 under the root of (5.26), by (5.23)",
            f"{SMALL:g}, the rule for *small*: the next order",
            formulas(),
        ),
        Statement(
            "THIS PROG. INV[E]STIGATES STABILITY IN ABSENCE [O]F DAMPING",
            listing("appendix 3, L8638"),
            "boundaries in lambda_k^2: by the listing to the letter, with its sine for a cosine and 149 deg (errata 18, 19), "
            "run with each I4 and sigma3 = 1 (it has I4 = 0.5, sigma3 = 0.8 to 1.2), by the right linear equation, which the "
            "thesis is about, and by the true periodic motion",
            f"{SMALL:g} of the width by each of the latter, the rule for *small*: the next order, which (5.16) leaves out",
            tuple(listed),
            "M' zeta' is missing, the harmonics of the mass are halved, those of the stiffness are wrong, the sine even in "
            "sign, and (5.16) has lost 1/k0 (errata 2, 16, 18, 20)",
        ),
    )


def to_the_letter(given: SliderEquation) -> tuple[tuple[float, float], ...]:
    """Return the boundaries (low, high) in lambda_k^2 of regions 0 to 2 by (5.13), (5.16) and (5.26), with h0 = 0.

    Region 0 is the zeroth boundary, given twice.
    """
    s, k = given.spring_factor, given.stiffness.to_order(2)

    def amplitudes(n: int, at: float) -> tuple[float, float]:
        return at * s.cos[n] / s.mean + k.cos[n], at * s.sin[n] / s.mean + k.sin[n]

    (n1, n2), (m1, m2) = (amplitudes(n, 1.0) for n in (1, 2))
    p, r = (n2**2 - 5.0 * n1**2) / 12.0 + m1 / 2.0, (n1**2 - 5.0 * n2**2) / 12.0 - m1 / 2.0
    q = m2 / 2.0 - n1 * n2 / 2.0
    zeroth = -0.5 * np.hypot(*amplitudes(1, 0.0)) ** 2
    middles = zeroth, 0.25, 1.0 - 0.5 * (p + r)
    halves = 0.0, 0.5 * np.hypot(*amplitudes(1, 0.25)), 0.5 * np.sqrt((p - r) ** 2 + 4.0 * q**2)
    return tuple(((middle - half) / s.mean, (middle + half) / s.mean) for middle, half in zip(middles, halves))


def zeroth_boundary() -> tuple[Case, ...]:
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


def formulas() -> tuple[Case, ...]:
    """Judge the perturbation formulas by Hill's determinant: their greatest errors for the inertia ratios `COMPARED`."""
    errors: dict[str, list[float]] = {}
    for ratio in COMPARED:
        given = slider_equation(chapter_4(ratio), 1.0, variant=Variant.PRINTED, form=Form.SERIES)
        (zeroth, _), *regions = to_the_letter(given)
        right = hill_regions(given.homogeneous(), 2)
        below = boundary_stiffnesses(given.homogeneous(), 1, count=1)[0].real
        errors.setdefault("(5.13)", []).append(abs(zeroth / below - 1.0))
        for name, ends, region in zip(("(5.16)", "(5.26)"), regions, (right[1], right[2])):
            for end, x in zip(("low", "high"), ends):
                errors.setdefault(f"{name}, {end}", []).append(abs(x - getattr(region, end)) / region.width)
    return tuple(at_most(name, SMALL, max(values)) for name, values in errors.items())


def widest_by_inertia() -> dict[float, float]:
    """Return the greatest width (in lambda_k^2) of the regions of Fig 5.1, for two upper limits of I4.

    The limits are the keys: 1.5, as in Fig 5.4, and 2. The text does not say which range it means.
    """
    found = widths(regions("5.1")["true orbit"])
    return {most: float(found[np.array(SWEEPS["5.1"].values) <= most].max()) for most in (1.5, 2.0)}


def judge_crank(found: Mapping[str, Sequence[Region]]) -> tuple[Statement, ...]:
    """Judge the statements on Fig 5.2."""
    true = found["true orbit"]
    ends = [[axis(of(with_crank(s, 0.5))) for s in (0.01, 0.1)] for of in (right, appendix_3)]
    over = {most: widths(true).max() / x for most, x in widest_by_inertia().items()}
    return (
        Statement(
            "The width of the region increases with increase of [sigma2].",
            text("5.3.1, L3876; the same in L3938-3942"),
            "growth of the width from one sigma2 to the next, least; true periodic motion, sigma2 = 0.01 to 0.1 in steps of "
            "0.01",
            SIGN,
            (at_least("", 0.0, np.diff(widths(true)).min()),),
        ),
        Statement(
            "However the region diverges about an axis approximately given by [omega]=A.[omega_k] where A=1.968 when "
            "[sigma2] = 0.01 and increasing very slightly with increase of [sigma2].",
            text("5.3.1, L3878-3882"),
            "axis A = omega/omega_k in the middle of the region of the true periodic motion, at sigma2 = 0.01, and its growth "
            "up to 0.1; that the region diverges is the sentence before",
            f"{ABOUT:g} of the stated 2 - A, the rule for *approximately*, as A = 2 at I4 = 0 (within {ABOUT:g} of A itself "
            f"lies any axis of these figures); {SIGN}",
            (
                near(
                    "A",
                    "1.968",
                    axes(true)[0],
                    ABOUT * (2.0 - 1.968),
                    why="it is nearly that of I4 = 0.5, the value in the listing (L8641): "
                    f"{ends[0][0]:.4f} by the true motion, {ends[1][0]:.4f} by the "
                    "listing",
                ),
                at_least(
                    "growth of A",
                    0.0,
                    axes(true)[-1] - axes(true)[0],
                    why=f"in the listing, at I4 = 0.5, A grows by {ends[1][1] - ends[1][0]:.4f}",
                ),
            ),
        ),
        Statement(
            "The[ ]region is narrower than that of Fig. (5.1).",
            text("5.3.1, L3882-3884"),
            why="the range of I4 in Fig 5.1 is not said: the greatest width of Fig 5.2 is "
            + " and ".join(f"{x:.2f} of that of Fig 5.1 up to I4 = {most:g}" for most, x in over.items()),
        ),
    )


def held(sigma3: float, inertia_ratio: float = 2.0) -> FiveBarParameters:
    """Return the mechanism with sigma3 = l3/l4 and the thesis's link angles; its ground link and guide direction follow."""
    mechanism = closed(sigma3, inertia_ratio)
    ground = rect(mechanism.coupler_length, pi / 3.0) - rect(mechanism.rocker_length, 2.0 * pi / 3.0)
    return replace(mechanism, ground_length=abs(ground), slider_guide_angle=-phase(ground))


def closed(sigma3: float, inertia_ratio: float = 2.0) -> FiveBarParameters:
    """Return the mechanism with another coupler length, sigma3 = l3/l4, and an unchanged ground link."""
    mechanism = chapter_4(inertia_ratio)
    return replace(mechanism, coupler_length=sigma3 * mechanism.rocker_length)


#: Name of the sweep with a constant ground link.
SAME_GROUND = "true orbit on the same ground link"


def judge_coupler(found: Mapping[str, Sequence[Region]]) -> tuple[Statement, ...]:
    """Judge the statements on Fig 5.3, with constant angles as in the thesis, and with a constant ground link."""
    widest = float(widths(found["true orbit"]).max())
    over_crank = widest / float(widths(regions("5.2")["true orbit"]).max())
    over_inertia = " and ".join(f"{widest / x:.2f} up to I4 = {most:g}" for most, x in widest_by_inertia().items())
    follow = "the angles follow the coupler"
    listed, moving = (axis(of(held(0.8, 0.5))) for of in (appendix_3, right))
    at_half = f"at I4 = 0.5, its value there (L8641), the listing has {listed:.4f}, the true motion {moving:.4f}"
    half, *cranks = (
        max(hill(mechanism(x, inertia_ratio)).width for x in SWEEPS[number].values)
        for number, mechanism, inertia_ratio in (("5.3", held, 0.5), ("5.2", with_crank, 1.0), ("5.2", with_crank, 0.5))
    )
    halved = (
        f"at I4 = 0.5, which the listing has (L8641), it would be {half / cranks[0]:.2f} of that of Fig 5.2 at I4 = 1 and "
        f"{half / cranks[1]:.2f} of it at I4 = 0.5, by the right linear equation"
    )
    both = {"angles held": found["true orbit"], "same ground link": found[SAME_GROUND]}
    seconds, ranges, by_listing = {}, [], []
    for number in SWEEPS:
        mechanisms = [SWEEPS[number].mechanism(x) for x in SWEEPS[number].values]
        pairs = [(hill(p), hill(p, 2)) for p in mechanisms]
        thesis = (hill_regions(equation(p, Variant.APPENDIX_3, Form.SERIES), 2) for p in mechanisms)
        by_listing.append(max(of[2].width / of[1].width for of in thesis))
        seconds[number] = max(second.width / first.width for first, second in pairs)
        ranges.append(max(np.divide(*(of.low**-0.5 - of.high**-0.5 for of in pair[::-1])) for pair in pairs))
    return (
        Statement(
            "The width of the region decreases with increase of [sigma3].",
            text("5.3.1, L3892; the same in L3938-3942"),
            "growth of the width from one sigma3 to the next, greatest; true periodic motion, sigma3 = 0.8 to 1.2 in steps of "
            "0.025",
            SIGN,
            tuple(at_most(words, 0.0, np.diff(widths(of)).max()) for words, of in both.items()),
            "on the same ground link the angles follow the coupler: the region narrows up to about equal links and "
            "widens beyond",
        ),
        Statement(
            "It also converges about an axis given by [omega]=A.[omega_k] where A=1.96 when [sigma3] = 0.8 and stays "
            "approximately constant with increase of [sigma3].",
            text("5.3.1, L3892-3898"),
            "axis A of the true periodic motion at sigma3 = 0.8; its range over sigma3 = 0.8 to 1.2 relative to 2 - A at 0.8; "
            "that the region converges is the sentence before",
            f"half a unit of the last digit; {ABOUT:g}, the rule for *approximately*, of 2 - A as A = 2 at I4 = 0 (within "
            f"{ABOUT:g} of A itself lies any axis of these figures)",
            tuple(
                case
                for (words, of), why in zip(both.items(), (at_half, follow))
                for case in (
                    near(f"A; {words}", "1.96", axes(of)[0], why=why),
                    at_most(f"range; {words}", ABOUT, np.ptp(axes(of)) / (2.0 - axes(of)[0]), why=follow),
                )
            ),
        ),
        Statement(
            "This region is narrower than both regions of Figs. (5.1[)] and (5.2).",
            text("5.3.1, L3898-3900"),
            "greatest width of the region of the true periodic motion, angles held, relative to that of each; on the same "
            f"ground link it is {widths(found[SAME_GROUND]).max() / widest:.1f} times as great as with the angles held",
            SIGN,
            (
                Case(
                    label="Fig 5.1",
                    computed=None,
                    why=f"the range of I4 there is not said: it would be {over_inertia}",
                ),
                at_most("Fig 5.2", 1.0, over_crank, why=halved),
            ),
        ),
        Statement(
            "In all the above examples the second region of instability was so small within the values of [sigma2], "
            "[sigma3] and I4 it was negligible.",
            text("5.3.1, L3902-3906"),
            "width of the second region in lambda_k^2, as the figures have it, relative to that of the first, which they show, "
            "by the right linear equation, greatest of each figure, in Fig 5.3 with the angles held",
            f"{SMALL:g}, the rule for *negligible*",
            tuple(at_most(f"Fig {number}", SMALL, x) for number, x in seconds.items()),
            "the terms of first order largely cancel in the width of the first; as ranges of speed the quotients are "
            + ", ".join(f"{x:.3f}" for x in ranges)
            + "; by the coefficients of appendix 3 those of the widths are "
            + ", ".join(f"{x:.3f}" for x in by_listing)
            + ", negligible as the thesis says: the first region is too wide by them, the second too narrow",
        ),
    )


SWEEPS = {
    sweep.number: sweep
    for sweep in (
        Sweep(
            number="5.1",
            symbol="I4",
            label="inertia ratio I4",
            values=np.linspace(0.25, 2.0, 8).tolist(),
            mechanism=chapter_4,
            claim="The first region of instability in lambda_k^2 over I4; sigma2 = 0.05.",
            judge=judge_inertia,
            assignment="I4 = 0.25 to 2 in steps of 0.25 is our choice; stability in the remarks a and b (L3938-3946) is read, "
            "by us, as the width of the region. The true periodic motion is that of the mechanism itself; by the right linear "
            "equation the verdicts of Fig 5.1 to 5.3 are the same.",
        ),
        Sweep(
            number="5.2",
            symbol="sigma2",
            label="crank's length sigma2 = l2/l4",
            values=np.linspace(0.01, 0.1, 10).tolist(),
            mechanism=with_crank,
            claim="The first region of instability in lambda_k^2 over sigma2; I4 = 1.",
            judge=judge_crank,
        ),
        Sweep(
            number="5.3",
            symbol="sigma3",
            label="coupler's length sigma3 = l3/l4",
            values=np.linspace(0.8, 1.2, 17).tolist(),
            mechanism=held,
            claim="The first region of instability in lambda_k^2 over sigma3; sigma2 = 0.05, I4 = 2.",
            judge=judge_coupler,
            assignment=(
                "The program of appendix 3 keeps the angles of coupler and rocker (L8641-8688), to which another ground link "
                "and an inclined guide belong at every sigma3; the mechanism with the same ground link is ours."
            ),
            further={SAME_GROUND: closed},
        ),
    )
}


# Figure 5.4

#: Chart of lambda_k^2 and I4, dampers omega_c (1/s) of the regions, and search range of the removing damper.
BOX = Box(x=(0.25, 0.29), y=(0.25, 2.0))
DAMPERS = (0.0, 0.05, 0.1, 0.15)
RANGE = (0.0, 1.2)
#: Crank angles at which the coefficients are divided, and number of harmonics that represents the quotients fully.
ANGLES = np.linspace(0.0, 2.0 * pi, 256, endpoint=False)
ALL_HARMONICS = 64
#: Harmonics of the coefficients in (4.29) and in the listing of appendix 4.
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
def damped_region(omega_c: float) -> Chart:
    """Return the chart of the first region over lambda_k^2 and I4, with a damper omega_c (1/s)."""
    return chart(orbit_test(with_damping(omega_c), -1), BOX, lines=(0, 4), samples=100)


@cache
def removing(motion: str, inertia_ratio: float) -> RemovingDamping:
    """Find the damper omega_c (1/s) that removes the first region at an inertia ratio, by one of the `MOTIONS`."""

    def test(lambda_k2: float, omega_c: float) -> float:
        return MOTIONS[motion](with_damping(omega_c), -1)(lambda_k2, inertia_ratio)

    return removing_damping(test, BOX.x, RANGE, samples=12)


def region_width(found: Chart, value: float) -> float:
    """Return the width in lambda_k^2 of the region in a chart at I4 = ``value``, zero if there is no region."""
    roots = found.scan_line(value, samples=100).roots
    return float(np.ptp(roots)) if len(roots) else 0.0


def divided(found: PeriodicEquation, harmonics: int) -> PeriodicEquation:
    """Return an equation divided by its mass, as in (5.27), with the given number of harmonics kept in the quotients."""
    mass = found.a(ANGLES)
    b, c, factor = (FourierSeries.from_samples(x(ANGLES) / mass, harmonics) for x in (found.b, found.c, found.factor))
    return PeriodicEquation(a=FourierSeries.constant(1.0), b=b, c=c, factor=factor)


def without_factor(inertia_ratio: float, lambda_c: float) -> PeriodicEquation:
    """Return the equation (5.29) of chi, derived from the correct linear equation.

    Here zeta is chi times the factor exp(-1/2 int psi1).
    """
    found = replace(slider_equation(chapter_4(inertia_ratio), crank_speed(0.25)), damping=lambda_c)
    whole = divided(found.homogeneous(), ALL_HARMONICS)
    psi1, psi2 = whole.b, whole.c
    rest = psi2(ANGLES) - 0.5 * psi1.derivative()(ANGLES) - 0.25 * psi1(ANGLES) ** 2
    return replace(whole, b=FourierSeries.constant(0.0), c=FourierSeries.from_samples(rest, ALL_HARMONICS))


def shifts() -> tuple[Case, ...]:
    """Judge how a damper shifts regions 1 to 4 of (5.30) and changes their widths.

    The damper is the one that the thesis states; each result is that of the I4 with the worst agreement.
    """
    found: dict[str, list[float]] = {}
    for ratio in COMPARED:
        for n, free in hill_regions(without_factor(ratio, 0.0), 4).items():
            lambda_c = STATED / crank_speed(free.low)
            damped = without_factor(ratio, lambda_c)
            region, k0 = hill_regions(damped, 4)[n], damped.factor.mean
            shift = 0.5 * (region.low + region.high - free.low - free.high)
            for name, x in (
                (f"shift; region {n}", shift * k0 / (0.25 * lambda_c**2 * k0**2)),
                (f"shift over lambda_k^2; region {n}", shift / free.low),
                (f"width; region {n}", region.width / free.width),
            ):
                found.setdefault(name, []).append(x)
    return tuple(
        at_most(name, SMALL, max(values))
        if "over" in name
        else near(name, 1.0, max(values, key=lambda x: abs(x - 1.0)), ALIKE)
        for name, values in found.items()
    )


def narrowing(charts: Mapping[float, Chart], inertia_ratio: float) -> float:
    """Return the greatest change of the region's width from one damper to the next, negative if each change narrows the region.

    Changes from a damper without a region do not count.
    """
    at = np.array([region_width(found, inertia_ratio) for found in charts.values()])
    return float(np.diff(at)[at[:-1] > 0.0].max())


def outside(omega_c: float) -> float:
    """Return the greatest real part s1 of Lambda (5.32) outside the first region, for the I4 `COMPARED` and a damper (1/s)."""
    exponents = []
    for ratio in COMPARED:
        mechanism, region = chapter_4(ratio, omega_c), hill(chapter_4(ratio))
        for lambda_k2 in (0.2, region.low - 0.5 * region.width, region.high + 0.5 * region.width, 0.35):
            found = slider_equation(mechanism, crank_speed(lambda_k2))
            multipliers = hill_multipliers(found.homogeneous().stiffened(found.spring))
            exponents.append(np.log(np.abs(multipliers).max()) / (2.0 * pi))
    return float(max(exponents))


def nine_terms(found: PeriodicEquation) -> dict[int, Region]:
    """Return regions 1 to 4 by nine terms of the determinant; complex boundaries are replaced by their real parts."""
    # the first boundary with the multiplier 1 is the zeroth
    even, odd = (boundary_stiffnesses(found, m, count=c, order=2).real for m, c in ((1, 5), (-1, 4)))
    ends = np.append(odd, even[1:]).reshape(4, 2).tolist()
    return {n: Region(number=n, low=low, high=high) for n, (low, high) in zip((1, 3, 2, 4), ends)}


def cut_errors(*, harmonics: int, terms: Callable[[PeriodicEquation], Mapping[int, Region]]) -> dict[int, float]:
    """Return the boundary errors of regions 1 to 4 by the divided equation at I4 = 1, relative to the regions' widths.

    ``harmonics`` are kept in the divided equation; ``terms`` computes its regions. Each error is the greater of the region's
    two boundaries.
    """
    found = equation(chapter_4(1.0))
    cut = terms(divided(found, harmonics))
    return {
        n: max(abs(cut[n].low - whole.low), abs(cut[n].high - whole.high)) / whole.width
        for n, whole in hill_regions(found, 4).items()
    }


def damped_statements(charts: Mapping[float, Chart]) -> tuple[Statement, ...]:
    """Judge the statements on the regions with damping, given their charts by omega_c (1/s)."""
    tips = [float(found.boundaries[0].points[:, 1].min()) for d, found in charts.items() if d > 0.0]
    worst = {motion: max(removing(motion, x).damping for x in RATIOS.tolist() if x <= 1.5) for motion in MOTIONS}
    mechanisms = [chapter_4(x) for x in COMPARED]
    apart = {
        end: max(
            abs(getattr(hill(p), end) - getattr(first_order(p, Variant.EXACT), end)) / hill(p).width for p in mechanisms
        )
        for end in ("low", "high")
    }
    by_both = [(appendix_3(p), hill(p, variant=Variant.FORTRAN)) for p in mechanisms]
    off = [(abs(getattr(a, end) - getattr(b, end)), a) for a, b in by_both for end in ("low", "high")]
    listed, parts = max(x / a.width for x, a in off), max(x / a.low for x, a in off)
    narrowed = {ratio: narrowing(charts, ratio) for ratio in (*COMPARED, 2.0)}
    crank, coupler = (0.001, *SWEEPS["5.2"].values), SWEEPS["5.3"].values
    zeroth = boundary_stiffnesses(equation(mechanisms[-1]), 1, count=1)[0].real
    falling = {}
    for omega_c in (STATED, 1e3 * STATED):
        fast = slider_equation(chapter_4(1.5, omega_c), crank_speed(0.5 * zeroth))
        falling[omega_c] = np.abs(hill_multipliers(fast.homogeneous().stiffened(fast.spring))).max()
    by_listing = worst["listing of appendix 4"]
    nine = cut_errors(harmonics=LISTED_HARMONICS, terms=nine_terms)
    all_harmonics = cut_errors(harmonics=ALL_HARMONICS, terms=nine_terms)
    more_terms = cut_errors(harmonics=LISTED_HARMONICS, terms=partial(hill_regions, count=4))
    return (
        Statement(
            "It is clearly seen that regions of instability of the above system will resemble those obtained for the "
            "case of no damping but shifted by a small amount represented by the second order quantity of [1/4 "
            "lambda_c^2 k0^2] in (5[.]30).",
            text("5.2.1, L3628-3635"),
            f"regions 1 to 4 of (5.29), from the right linear equation, with omega_c = {STATED:g} 1/s and without a damper: "
            "shift of the middle in lambda_k^2 k0 relative to the stated quantity; shift relative to lambda_k^2; width "
            "relative to that without a damper; each at that of I4 = 0.5, 1 and 1.5 where it fits least",
            f"{ALIKE_WORDS}; {SMALL:g} for the shift over lambda_k^2, the rule for *small*",
            shifts(),
        ),
        Statement(
            "As would be expected the region is decreased in width as [omega_c] is increased.",
            text("5.3.2, L3915-3917"),
            "growth of the width in lambda_k^2 from one damper to the next, up to that which removes the region, greatest; "
            "true periodic motion, at four I4 of ours",
            SIGN,
            tuple(at_most(f"I4 = {ratio:g}", 0.0, x) for ratio, x in narrowed.items()),
        ),
        Statement(
            "It is also shifted to the right with increase of [omega_c] and is completely eliminated anywhere within "
            "[I4 = 0] to 1.5 for the value of [omega_c] = 0.45.",
            text("5.3.2, L3917-3921"),
            "growth of the I4 at which the region begins, from one damper to the next, least, as *to the right* is read, by "
            "us, on a plot over I4 (L3910); omega_c that removes the region, the most up to I4 = 1.5; true periodic motion",
            "none: the sign decides, and whether the region is removed",
            (
                at_least("growth", 0.0, np.diff(tips).min()),
                at_most("omega_c", "0.45", worst["true orbit"], "1/s"),
            ),
        ),
        Statement(
            "The instability regions shown in figs. (5.2) and (5.3) were also completely eliminated for the values "
            "of [omega_c] = 0.45 anywhere within [sigma2] = [0.]001 to 0.1 and [sigma3] = 0.8 to 1.2 respectively.",
            text("5.3.2, L3923-3929"),
            "omega_c that removes the region, the most over sigma2 = 0.001 and 0.01 to 0.1 in steps of 0.01 and over sigma3 = "
            "0.8 to 1.2 in steps of 0.025; by the right linear equation, estimated from the width without a damper",
            "none: it is removed or it is not",
            (
                at_most("Fig 5.2", "0.45", max(removing_estimate(with_crank(x)) for x in crank), "1/s"),
                at_most("Fig 5.3; angles held", "0.45", max(removing_estimate(held(x)) for x in coupler), "1/s"),
                at_most(
                    "Fig 5.3; same ground link",
                    "0.45",
                    max(removing_estimate(closed(x)) for x in coupler),
                    "1/s",
                    why="the angles follow the coupler",
                ),
            ),
        ),
        Statement(
            "Viscous damping had a stabilising effect. It was also possible to choose a value for this damping "
            "making the linkage under study completely stable for all ranges of speeds.",
            text("5.3.3 c, L3952-3958"),
            "growth of the width of the first region from one damper to the next, greatest, as above; omega_c that removes "
            "regions 1 to 4, those of higher number needing less, estimated by the right linear equation from their widths "
            f"without a damper; greatest multiplier of this equation with {STATED:g} 1/s (L3921) and a thousand times as much "
            f"beyond the zeroth boundary, at {crank_speed(0.5 * zeroth):.0f} rad/s; all at I4 = 1.5",
            "none: the sign and the stability decide",
            (
                at_most("growth of the width", 0.0, narrowed[1.5]),
                at_most("omega_c", STATED, max(removing_estimate(mechanisms[-1], n) for n in range(1, 5)), "1/s"),
                *(
                    at_most(
                        f"multiplier; {omega_c:g} 1/s",
                        1.0,
                        x,
                        why="beyond the zeroth boundary the slider falls away, which a damper slows but does not stop",
                    )
                    for omega_c, x in falling.items()
                ),
            ),
        ),
        Statement(
            "The values of [omega] and s2 that satisfy equations (5.35) determine the boundaries of the unstable regions.",
            text("5.2.2, eqs (5.33) to (5.35), L3717-3719"),
            "greatest real part s1 of Lambda outside the first region, half a width from it and at lambda_k^2 = 0.2 and 0.35, "
            "I4 = 0.5, 1 and 1.5, by the right linear equation; where it is zero, some s2 satisfies (5.35) at a speed that is "
            "no boundary",
            "below 0 by more than 1e-9, above rounding errors",
            tuple(
                at_most(
                    name,
                    -1e-9,
                    outside(omega_c),
                    why="without a damper s1 is zero at every stable speed, so that s2 must "
                    "be given: 0, as the series has half harmonics",
                )
                for name, omega_c in (
                    (f"omega_c = {DAMPERS[2]:g} 1/s", DAMPERS[2]),
                    ("without a damper, as in 5.3.3 e", 0.0),
                )
            ),
        ),
        Statement(
            "For a particular mechanism the method is capable of giving all the boundaries of the unstable regions without "
            "any extra work.",
            text("5.2.2, L3730-3734"),
            "boundaries by (5.35) cut after the ninth term, as the thesis has it (L3930), less those with more terms and all "
            "harmonics, of the region's width; right equation without a damper, I4 = 1, divided by M as (5.27) is, its "
            "coefficients cut after the second harmonic as in (4.29) and in the listing (L8849, L8854); the boundaries of the "
            "fourth are then a complex pair, of which the real part is taken",
            f"{SMALL:g}, the rule for *small*",
            tuple(at_most(f"region {n}", SMALL, x) for n, x in nine.items()),
            "the third region needs more harmonics of the coefficients: nine terms with all of them leave "
            f"{all_harmonics[3]:.3f}, more terms with two {more_terms[3]:.2f}; the fourth needs more of both: either alone "
            f"leaves {all_harmonics[4]:.1f} or {more_terms[4]:.2f}; that is extra work, as the listing writes out each element "
            "(L8821-8864)",
        ),
        Statement(
            "The computer orientated method provided a fast method for solving the stability problem.",
            text("5.3.3 d, L3960-3962"),
            why="no times are given",
        ),
        Statement(
            "The computer orientated method gave results which are in good agreement with the perturbation method; "
            "see the outer boundary of fig. (5.4) and fig. (5.1).",
            text("5.3.3 e, L3964-3968"),
            "boundaries without a damper, the outer ones, by (5.35) less those by (5.16), both with the right coefficients, "
            "relative to the width; greatest of I4 = 0.5, 1 and 1.5",
            f"{SMALL:g}, the rule for *small*: the next order",
            tuple(at_most(end, SMALL, x) for end, x in apart.items()),
            f"by the coefficients of the listings (errata 17, 18) they are up to {listed:.2f} of the width, "
            f"{100.0 * parts:.1f} % of lambda_k^2, apart",
        ),
        Statement(
            "THIS PROG. INV[E]STIGATES STABILITY IN PRESENCE [O]F DAMPING",
            listing("appendix 4, L8698"),
            "omega_c that removes the first region up to I4 = 1.5: by the equation of the listing, solved without its cut "
            "after nine terms, and by the true periodic motion",
            "0.0005 1/s, to which the listing's value is found",
            (near("", f"{by_listing:.3f}", worst["true orbit"], unit="1/s"),),
            "its regions are too wide (errata 2, 16, 17, 20)",
        ),
    )


def compute_damped() -> StudyResult:
    """Compute the boundaries of the first region with each damper, and the damper that removes the region at each I4."""
    charts = {omega_c: damped_region(omega_c) for omega_c in DAMPERS}
    columns = {"I4 [1]": RATIOS}
    for motion in MOTIONS:
        columns[f"removing omega_c; {motion} [1/s]"] = np.array([removing(motion, x).damping for x in RATIOS.tolist()])
    for omega_c, found in charts.items():
        for n, boundary in enumerate(found.boundaries, start=1):
            name = f"omega_c = {omega_c:g} 1/s; boundary {n} [1]"
            columns[f"lambda_k^2; {name}"], columns[f"I4; {name}"] = boundary.points.T
    return StudyResult(
        number="5.4",
        claim="omega_c = mu/(m4 + m5) narrows the region, and 0.45 1/s removes it up to I4 = 1.5.",
        assignment="The dampers of the regions, 0, 0.05, 0.1 and 0.15 1/s, are ours; the damper that removes the region is "
        "found at I4 = 0.25 to 2 in steps of 0.25.",
        columns=padded(columns),
        statements=damped_statements(charts),
    )


def draw_damped(result: StudyResult) -> Figure:
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


#: The studies by number.
STUDIES = {number: Study(number, partial(compute_sweep, number), draw_sweep) for number in SWEEPS} | {
    "5.4": Study("5.4", compute_damped, draw_damped)
}
