"""Figures of chapter IV: the amplitude of the slider over the speed by the linearised equation, and its resonances.

The thesis balances two harmonics, eqs (4.30) to (4.35), of its equation (4.21). We do the same with the correct coefficients
and, for comparison, with the thesis's own, as printed and as listed in its program, all in the form of appendix 2. Amplitudes
are those of zeta = u/l4. The spring with the mass m4 + m5 alone has the natural frequency omega_k = 31.623 rad/s. An inertia
ratio is I4, the rocker's moment of inertia about D divided by m4 l4^2; a damper is given by omega_c = mu/(m4 + m5) (1/s).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise, product
from math import pi, sqrt

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from linkwork.five_bar.published import SQUARE_OF_OMEGA_K, chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...youssef import (
    Form,
    HarmonicMotion,
    SliderEquation,
    Variant,
    harmonic_balance,
    hill_multipliers,
    nonlinear_harmonic_balance,
    resonance,
    slider_equation,
)
from ..rules import ABOUT, ALIKE, SMALL
from ..statements import Case, FloatArray, Statement, at_least, at_most, listing, near, statement, unjudged
from ..study import Study, StudyResult
from .runs import ALIKE_WORDS, SIGN

OMEGA_K = sqrt(SQUARE_OF_OMEGA_K)
#: Inertia ratios I4 for which appendix 2 gives the resonance.
INERTIA_RATIOS = (0.5, 1.0, 1.5)
#: Variants of the equation that are compared, with their names in legends.
VARIANTS = {Variant.EXACT: "corrected", Variant.PRINTED: "(4.21) as printed", Variant.FORTRAN: "listing of appendix 2"}
#: The speeds of appendix 2 (rad/s), with smaller steps at the resonances.
SPEEDS = np.unique(
    np.concatenate([np.arange(9.0, 40.05, 0.1), np.arange(15.0, 15.8, 0.005), np.arange(30.0, 31.3, 0.005)]).round(3)
)
#: Mask of the speeds outside the regions of resonance.
APART = (np.abs(SPEEDS - 15.5) >= 1.0) & (np.abs(SPEEDS - 31.0) >= 2.0)
#: omega_c = mu/(m4 + m5) (1/s) of appendix 2, which raises mu by 200 dyn.s/cm after each curve; m4 + m5 is 1000 g.
DAMPERS = tuple(0.2 * n for n in range(1, 7))
#: omega_c (1/s) at which second harmonics are compared: the thesis's value, which removes all instability.
COMPARED_AT = 0.45
#: Order of the balance by which harmonics above the second are judged.
MANY = 10
#: Speeds (rad/s) at the resonances of the first three harmonics, so close to each other that peaks are right to 0.1 %;
#: speeds over the whole range, which include these.
AT_PEAKS = np.concatenate([np.arange(low, high, 0.002) for low, high in ((9.9, 10.7), (15.0, 15.8), (30.0, 31.3))])
EVERY = np.unique(np.append(np.arange(9.0, 40.05, 0.1), AT_PEAKS).round(3))
#: Amplitude above which a speed lies in the region of resonance, and distance (rad/s) from the peak beyond which it lies
#: outside this region: our choice.
LARGE, OUTSIDE = 0.1, 3.0
#: Peaks to which dampers limit the first harmonic, relative to its amplitude at a speed higher by `OUTSIDE`.
TIMES = (1.5, 2.0, 5.0)
#: Half the step in speed (rad/s) of appendix 2, to which its output locates a resonance.
HALF_STEP = 0.05
#: Inertia ratios of Fig 4.6 and 4.7.
DAMPED_RATIOS = (1.0, 0.5)


@cache
def equation(inertia_ratio: float, variant: Variant) -> SliderEquation:
    """Return the slider's linear equation at 1 rad/s.

    Without gravity only its spring and damper terms depend on the speed; `linear` sets them for other speeds.
    """
    return slider_equation(chapter_4(inertia_ratio), 1.0, variant=variant, form=Form.RESONANCE)


@cache
def linear(
    speed: float, inertia_ratio: float, omega_c: float = 0.0, variant: Variant = Variant.EXACT, harmonics: int = 2
) -> HarmonicMotion:
    """Return the periodic motion zeta at a crank speed (rad/s), by default by two harmonics, as in the thesis."""
    once = equation(inertia_ratio, variant)
    return harmonic_balance(replace(once, spring=SQUARE_OF_OMEGA_K / speed**2, damping=omega_c / speed), harmonics)


def harmonic(
    n: int,
    speeds: FloatArray,
    inertia_ratio: float,
    omega_c: float = 0.0,
    variant: Variant = Variant.EXACT,
    harmonics: int = 2,
) -> FloatArray:
    """Return the amplitude of the n-th harmonic of zeta at each speed (rad/s); see `linear`."""
    motions = (linear(speed, inertia_ratio, omega_c, variant, harmonics) for speed in speeds.tolist())
    return np.array([motion.harmonic(n) for motion in motions])


def peak(n: int, inertia_ratio: float, omega_c: float, variant: Variant = Variant.EXACT) -> tuple[float, float]:
    """Return the peak of the n-th harmonic near its resonance: the speed (rad/s) and the amplitude."""
    middle = 0.5 * sum(resonance(chapter_4(inertia_ratio), variant=variant, harmonic=n))
    found = minimize_scalar(
        lambda speed: -linear(speed, inertia_ratio, omega_c, variant).harmonic(n),
        bounds=(middle - 0.5, middle + 0.5),
        method="bounded",
        options={"xatol": 1e-7},
    )
    return float(found.x), -float(found.fun)


# Figures 4.3 and 4.4


def deviation(inertia_ratio: float, variant: Variant = Variant.EXACT) -> float:
    """Return how far the resonance lies below omega_k (rad/s); the resonance is the lower root of the determinant."""
    return OMEGA_K - resonance(chapter_4(inertia_ratio), variant=variant)[0]


@cache
def undamped_columns(n: int) -> dict[str, FloatArray]:
    """Return the amplitude of the n-th harmonic over the speed without a damper, as columns by name.

    The correct equation has three inertia ratios I4; the other variants have I4 = 1 only.
    """
    columns = {"speed [rad/s]": SPEEDS}
    for ratio in INERTIA_RATIOS:
        for variant, name in VARIANTS.items():
            if variant is Variant.EXACT or ratio == 1.0:
                columns[f"I4 = {ratio:g}; {name} [1]"] = harmonic(n, SPEEDS, ratio, 0.0, variant)
    return columns


def range_above(level: float, speeds: FloatArray, curve: FloatArray) -> float:
    """Return the width of the range between the first and the last of the speeds at which a curve crosses a level."""
    (at,) = np.nonzero((curve[:-1] > level) != (curve[1:] > level))
    crossed = speeds[at] + (level - curve[at]) / (curve[at + 1] - curve[at]) * np.diff(speeds)[at]
    return float(np.ptp(crossed))


def judge_growth(n: int) -> list[Case]:
    """Judge whether the amplitude of the n-th harmonic and the width of its resonance grow with I4."""
    columns, word = undamped_columns(n), ("first", "second")[n - 1]
    curves = [columns[f"I4 = {ratio:g}; corrected [1]"] for ratio in INERTIA_RATIOS]
    ratios = [np.min((larger / smaller)[APART]) for smaller, larger in pairwise(curves)]
    level = LARGE if n == 1 else 0.1 * LARGE
    speeds = np.arange(28.0, 34.0, 0.02) if n == 1 else np.arange(14.8, 16.2, 0.002)
    widths = [range_above(level, speeds, harmonic(n, speeds, ratio)) for ratio in INERTIA_RATIOS]
    return [
        at_least(f"{word} harmonic outside the resonances", 1.0, min(ratios)),
        at_least(
            f"width of the {word} harmonic's resonance, amplitudes above {level:g}",
            1.0,
            min(b / a for a, b in pairwise(widths)),
        ),
    ]


def listed_cases() -> tuple[Case, ...]:
    """Compare the equation of appendix 2 with the correct one: peaks of both harmonics with the listing's first damper."""
    cases = []
    for n, ratio in product((1, 2), DAMPED_RATIOS):
        (listed_speed, listed), (speed, correct) = (
            peak(n, ratio, DAMPERS[0], variant) for variant in (Variant.FORTRAN, Variant.EXACT)
        )
        word = ("first", "second")[n - 1]
        if n == 1:
            cases.append(near(f"speed of the peak; I4 = {ratio:g}", f"{listed_speed:.4f}", speed, HALF_STEP, "rad/s"))
        cases.append(near(f"peak of the {word} harmonic; I4 = {ratio:g}", f"{listed:.4g}", correct, ABOUT * listed))
    return tuple(cases)


def compute_first() -> StudyResult:
    """Compute Fig 4.3, and the speeds at which the determinant vanishes."""
    below = {ratio: deviation(ratio) for ratio in INERTIA_RATIOS}
    by_mean = {ratio: OMEGA_K - OMEGA_K / sqrt(equation(ratio, Variant.EXACT).mass.mean) for ratio in below}
    return StudyResult(
        claim="First harmonic over the crank speed without damping, for three inertia ratios.",
        assignment="The three inertia ratios are our choice: 1 and 0.5 of Fig 4.6 and 4.7, and 1.5. The motions of Figs 4.3, "
        "4.4, 4.6 and 4.7 are found with two harmonics, as in (4.30), unless a row says otherwise.",
        columns=undamped_columns(1),
        statements=(
            statement(
                "The figures show that resonance for the first harmonic occurs in the region of ([omega_k] - d) < "
                "[omega] < [omega_k] where d = 1 rad./sec.",
                "4.5.1, L3139-3143",
                "distance below omega_k = 31.623 rad/s of the resonance by the right equation, which is the lower of the "
                "two neighbouring roots of the determinant of (4.33); I4 as in Figs 4.6 and 4.7",
                f"above 0, and {100 * ABOUT:g} % of d, the rule for *in the region of*; half a unit of the one digit of d "
                "would allow more, 0.5",
                *(
                    Case(
                        label=f"I4 = {ratio:g}",
                        stated="1",
                        computed=below[ratio],
                        lower=0.0,
                        upper=1.0 + ABOUT,
                        unit="rad/s",
                    )
                    for ratio in sorted(DAMPED_RATIOS)
                ),
                unjudged("third ratio", "the text names no ratio for this figure"),
                why=f"at 1.5, our choice, the distance would be {below[1.5]:.2f} rad/s",
            ),
            statement(
                "[T]heir [the resonances'] deviation from the idealised spring-mass system accounts for the oscillating "
                "inertia of the rocker.",
                "4.5.1, L3143-3146",
                "distance of the resonance below omega_k that follows from the mean of M alone, divided by the distance of "
                "the lower root of the determinant. The mean of M exceeds 1 by the rocker's inertia. *Accounts for* is read as "
                "*is due to*, and *oscillating inertia of the rocker* as the inertia of the rocker, which oscillates",
                ALIKE_WORDS,
                *(near(f"I4 = {ratio:g}", 1.0, by_mean[ratio] / x, ALIKE) for ratio, x in below.items()),
            ),
            statement(
                "Fig. (4.3) and fig. (4.4) also show that the amplitude of oscillation decreases with decrease of [I4] "
                "and that as [I4] increases it widens the region of resonance.",
                "4.5.1, L3156-3162; the same in L3197-3201",
                "amplitudes by the right equation without a damper, from 9 to 40 rad/s except within 1 rad/s of 15.5 and 2 "
                "rad/s of 31 rad/s; then the range of speeds, near 31 rad/s for the first harmonic and near 15.5 rad/s for "
                "the second, in which the amplitudes exceed a level. Each is relative to its value at the next smaller I4, "
                "and the least ratio is listed. Speeds and levels are our choice",
                SIGN,
                *judge_growth(1),
                *judge_growth(2),
            ),
            statement(
                "THIS[ ]PROG. I[N]VISTIG[A]TES RESONANCE IN PRES[EN]CE [O]F DAMPING",
                listing("appendix 2, L8398"),
                "*investigates* is read as finds right: speed and height of the peak of the first harmonic, and height of "
                "the peak of the second, by the listing, but between its steps in speed, and by the right equation. omega_c = "
                f"{DAMPERS[0]:g} 1/s is the listing's first damper; I4 = 1 is the listing's, and 0.5 that of Fig 4.7",
                f"{HALF_STEP:g} rad/s, half a step of the listing; {ABOUT:g} of the amplitude, the rule for *about*",
                *listed_cases(),
                why="the force of the listing lacks most of its second harmonic (erratum 21)",
            ),
        ),
    )


def ten_harmonics(inertia_ratio: float) -> FloatArray:
    """Return the amplitudes of harmonics 0 to `MANY` of zeta (no unit) with the damper `COMPARED_AT`.

    There is a row for each speed of `EVERY`.
    """
    motions = (linear(speed, inertia_ratio, COMPARED_AT, harmonics=MANY) for speed in EVERY.tolist())
    return np.array([motion.series.amplitudes for motion in motions])


def compute_second() -> StudyResult:
    """Compute Fig 4.4: the second harmonic, and its size relative to the first."""
    columns = undamped_columns(2)
    ten = [ten_harmonics(r) for r in INERTIA_RATIOS]
    seconds, highers = (
        {
            "greatest over greatest": max(x[:, n].max() / x[:, 1].max() for x in ten),
            "at the same speed": max((x[:, n].T / x[:, 1]).max() for x in ten),
        }
        for n in (slice(2, 3), slice(3, None))
    )
    below = {
        word: [OMEGA_K / n - resonance(chapter_4(r), harmonic=n)[1] for r in INERTIA_RATIOS]
        for n, word in ((1, "first"), (2, "second"))
    }
    return StudyResult(
        claim="Second harmonic over the crank speed without damping, for three inertia ratios.",
        assignment="The three inertia ratios are our choice, as in Fig 4.3.",
        columns=columns,
        statements=(
            statement(
                "Resonance occurs below the value of [omega] = [omega_k] and [omega] = [omega_k/2]. How much below depends on "
                "the value of I4.",
                "4.5.3 a, L3188-3195",
                "distance below omega_k, or below omega_k/2, of the upper of the two neighbouring roots of the determinant of "
                "(4.33) by the right equation, at I4 = 0.5, 1 and 1.5: the least; then the greatest divided by the least",
                f"{SIGN}; more than {1.0 + ALIKE:g}, the rule for *the same*, as *depends* says",
                *(at_least(f"{word} harmonic, least", 0.0, min(x), "rad/s") for word, x in below.items()),
                *(
                    at_least(f"{word} harmonic, greatest over least", 1.0 + ALIKE, max(x) / min(x))
                    for word, x in below.items()
                ),
            ),
            statement(
                "It is also clear by comparing the amplitude values in both figures that the first harmonic of the "
                "solution is dominant and the second harmonic may be neglected in comparison.",
                "4.5.1, L3162-3168; the same in L3210-3214",
                "second harmonic, and greatest of the third to the tenth (*higher*, L3212), divided by the first: the "
                "greatest values of each, and the values at the same speed. The largest ratio of the three I4 from 9 to 40 "
                f"rad/s (as in appendix 2) is listed, by the right equation with omega_c = {COMPARED_AT:g} 1/s, the value of "
                "5.3.2; without a damper the resonances have no bound",
                f"1, since the *dominant* harmonic is the greater; {SMALL:g}, the rule for *negligible*",
                *(at_most(f"first dominant; {words}", 1.0, share) for words, share in seconds.items()),
                *(at_most(f"second negligible; {words}", SMALL, share) for words, share in seconds.items()),
                *(at_most(f"higher negligible; {words}", SMALL, share) for words, share in highers.items()),
                why="near omega_k/2 the second harmonic has its own resonance, and near omega_k/3 the third",
            ),
        ),
    )


def draw_undamped(result: StudyResult, n: int) -> Figure:
    """Draw the n-th harmonic over the speed for three inertia ratios, and the variants close to the resonance."""
    c, word = result.columns, ("first", "second")[n - 1]
    three = {f"I4 = {ratio:g}": c[f"I4 = {ratio:g}; corrected [1]"] for ratio in INERTIA_RATIOS}
    variants = {name: c[f"I4 = 1; {name} [1]"] for name in VARIANTS.values()}
    ranges = {1: ((0.003, 30.0), (30.4, 30.8), (0.2, 60.0)), 2: ((5e-5, 1.0), (15.1, 15.5), (3e-4, 1.0))}[n]
    panels = [
        Panel(
            x_label="crank speed [rad/s]",
            y_label=f"{word} harmonic of u, relative to l4",
            curves=[Curve(x=SPEEDS, y=y, label=label) for label, y in shown.items()],
            legend=legend,
            logarithmic="y",
            legend_at="outside",
            x_range=x_range,
            y_range=y_range,
        )
        for shown, legend, x_range, y_range in (
            (three, "(4.21) corrected", (9.0, 40.0), ranges[0]),
            (variants, "I4 = 1", ranges[1], ranges[2]),
        )
    ]
    return plot_curves(panels, title=result.heading)


# Figure 4.5

RATIOS = np.arange(0.0, 2.01, 0.25)


def compute_deviation() -> StudyResult:
    """Compute Fig 4.5: how far the resonance lies below omega_k."""
    columns = {"inertia ratio I4 [1]": RATIOS}
    for variant, name in VARIANTS.items():
        columns[f"omega_k less resonance; {name} [rad/s]"] = np.array(
            [deviation(ratio, variant) for ratio in RATIOS.tolist()]
        )
    found = columns["omega_k less resonance; corrected [rad/s]"]
    shown = RATIOS <= 1.5
    bent = np.abs(found - found[shown][-1] / 1.5 * RATIOS)[shown].max() / found[shown].max()
    still = equation(0.0, Variant.EXACT)
    rest = max(np.abs(s.exponential).max() for s in (still.mass + -1.0, still.stiffness, still.force))
    return StudyResult(
        claim="The deviation of the resonance from omega_k falls linearly with the inertia ratio, to zero.",
        assignment="The range of I4 is our choice.",
        columns=columns,
        statements=(
            statement(
                "However, as shown in fig. (4.5), this deviation decreases linearly with decrease of inertia ratio "
                "[I4] and becomes zero when [I4=0].",
                "4.5.1, L3146-3150",
                "deviation of the lower root from omega_k, by the right equation: its distance from the straight line "
                "through zero and its value at I4 = 1.5 (our choice), relative to that value; then the deviation at I4 = 0",
                f"{ALIKE_WORDS}; 1e-6 rad/s, above rounding errors",
                at_most("distance from the line", ALIKE, bent),
                near("at I4 = 0", 0.0, found[0], 1e-6, "rad/s"),
            ),
            statement(
                "In fact for the case [I4]=0 the equation of motion of the slider reduces to a second order linear "
                "differential equation describing an idealised spring-mass system.",
                "4.5.1, L3152-3156",
                "greatest harmonic or mean of M - 1, K and F of the right equation at I4 = 0",
                "1e-12, above rounding errors",
                at_most("", 1e-12, rest),
            ),
        ),
    )


def draw_deviation(result: StudyResult) -> Figure:
    """Draw the deviation of the resonance from omega_k over I4 by each variant of the equation."""
    names = (name for name in result.columns if name.startswith("omega_k"))
    curves = [
        Curve(x=RATIOS, y=result.columns[column], label=name, line=line)
        for column, name, line in zip(names, VARIANTS.values(), ("-", "--", ":"))
    ]
    panel = Panel(
        x_label="inertia ratio I4",
        y_label=r"$\omega_k$ less resonance [rad/s]",
        curves=curves,
        x_range=(0.0, 2.0),
        y_range=(0.0, 2.2),
    )
    return plot_curves([panel], title=result.heading)


# Figures 4.6 and 4.7

CLOSE = np.arange(27.0, 35.01, 0.02)
#: Damper (1/s) that limits the plant's amplitude to a fifth of the rocker's length, still a small motion.
STRONGEST = DAMPERS[-1]


def free_frequency(inertia_ratio: float, omega_c: float) -> float:
    """Return the frequency of the free motion (rad/s), from the Floquet multipliers at a crank speed of 20 rad/s."""
    speed = 20.0
    found = slider_equation(chapter_4(inertia_ratio, omega_c), speed)
    multiplier = hill_multipliers(found.homogeneous().stiffened(found.spring))[0]
    turns = abs(np.angle(multiplier)) / (2.0 * pi)
    # between one and two cycles a turn
    return float(speed * (2.0 - turns))


def flattening_damper(inertia_ratio: float, times: float) -> float:
    """Find the damper omega_c (1/s) that limits the peak of the first harmonic.

    The peak is then ``times`` the amplitude of this harmonic at a speed higher by `OUTSIDE`.
    """

    def excess(omega_c: float) -> float:
        at, height = peak(1, inertia_ratio, omega_c)
        return height / float(harmonic(1, np.array([at + OUTSIDE]), inertia_ratio, omega_c)[0]) - times

    return float(brentq(excess, 0.1, 12.0, xtol=1e-6))


def one_mass_amplitude(speeds: FloatArray, inertia_ratio: float, omega_c: float) -> FloatArray:
    """Return the amplitude of a single mass on a spring at the speeds (rad/s), under the first harmonic of the force.

    The mass and the spring follow from the mean values of M and K.
    """
    found = equation(inertia_ratio, Variant.EXACT)
    stiffness = SQUARE_OF_OMEGA_K / speeds**2 + found.stiffness.mean - found.mass.mean
    amplitude: FloatArray = found.force.amplitudes[1] / np.abs(stiffness + 1j * omega_c / speeds)
    return amplitude


def one_mass_difference(inertia_ratio: float, omega_c: float) -> float:
    """Return the greatest difference between the first harmonic and `one_mass_amplitude`, relative to the peak."""
    at, height = peak(1, inertia_ratio, omega_c)
    # closer about the peak, where the difference is greatest
    speeds = np.append(CLOSE, at + np.arange(-0.2, 0.2, 0.002))
    apart = harmonic(1, speeds, inertia_ratio, omega_c) - one_mass_amplitude(speeds, inertia_ratio, omega_c)
    return float(np.abs(apart).max() / height)


@cache
def damper_effects(inertia_ratio: float) -> dict[str, float]:
    """Return the effects of the dampers at an inertia ratio, by name; `_curves` and `_dampers` judge these effects."""
    (at, height), (at_strong, _) = (peak(1, inertia_ratio, d) for d in (DAMPERS[0], STRONGEST))
    at_second, second_height = peak(2, inertia_ratio, DAMPERS[0])
    # with the limits of the range outside the resonances, at which the change is greatest
    limits = at + np.array([-OUTSIDE, OUTSIDE])
    outside = np.append(SPEEDS[np.abs(SPEEDS - at) > OUTSIDE], limits)
    outside_both = outside[np.abs(outside - at_second) > OUTSIDE]
    firsts, seconds = (
        [harmonic(n, speeds, inertia_ratio, d) for d in (DAMPERS[0], STRONGEST)]
        for n, speeds in ((1, outside), (2, outside_both))
    )
    return {
        "first harmonic": np.abs(firsts[1] - firsts[0]).max() / height,
        "second harmonic": np.abs(seconds[1] - seconds[0]).max() / second_height,
        "of the free motion": free_frequency(inertia_ratio, STRONGEST) - free_frequency(inertia_ratio, DAMPERS[0]),
        "of the peak": at_strong - at,
        "one mass": max(one_mass_difference(inertia_ratio, d) for d in DAMPERS),
    }


def compute_damped(inertia_ratio: float) -> StudyResult:
    """Compute Fig 4.6 or 4.7: the first harmonic with the dampers of the program in appendix 2."""
    columns = {"speed [rad/s]": CLOSE}
    for omega_c in (0.0, *DAMPERS):
        columns[f"omega_c = {omega_c:g} 1/s; corrected [1]"] = harmonic(1, CLOSE, inertia_ratio, omega_c)
    for variant, name in list(VARIANTS.items())[1:]:
        columns[f"omega_c = {STRONGEST:g} 1/s; {name} [1]"] = harmonic(1, CLOSE, inertia_ratio, STRONGEST, variant)
    mechanism = chapter_4(inertia_ratio, STRONGEST)
    plant = [nonlinear_harmonic_balance(mechanism, speed).harmonic(1) for speed in CLOSE.tolist()]
    columns[f"omega_c = {STRONGEST:g} 1/s; plant [1]"] = np.array(plant) / mechanism.rocker_length
    return StudyResult(
        claim=f"First harmonic over the crank speed with dampers, I4 = {inertia_ratio:g}.",
        assignment="The dampers are those of the listing of appendix 2. We take the amplitude to be that of the first "
        "harmonic.",
        columns=columns,
        statements=tuple(_curves() if inertia_ratio == 1.0 else _dampers()),
    )


def _curves() -> Iterator[Statement]:
    """Judge the statements on the curves of Fig 4.6 and 4.7."""
    both = {f"I4 = {ratio:g}": damper_effects(ratio) for ratio in DAMPED_RATIOS}
    yield statement(
        "The amplitude of oscillation is not affected, on the scale of the graph, outside the resonance region.",
        "4.5.2, L3176-3178; the same in L3203-3206",
        f"change of the harmonics from omega_c = {DAMPERS[0]:g} to {STRONGEST:g} 1/s, relative to the peak at "
        f"{DAMPERS[0]:g} 1/s, by the right equation from 9 to 40 rad/s, farther than {OUTSIDE:g} rad/s (our choice) from "
        "the peaks. The second harmonic is included, since L3203 speaks of *the solution*",
        ALIKE_WORDS,
        *(
            at_most(f"{name}; {label}", ALIKE, found[name])
            for label, found in both.items()
            for name in ("first harmonic", "second harmonic")
        ),
    )
    yield statement(
        "The resonance curves are similar to a second order linear system",
        "4.5.3 d, L3206-3208",
        "greatest distance of the first harmonic, in Figs 4.6 and 4.7, from the amplitude of a single mass on a spring, "
        "relative to the peak. The single mass has the means of M and K and the first harmonic of F. Right equation, 27 "
        f"to 35 rad/s (our choice), omega_c = {DAMPERS[0]:g} to {STRONGEST:g} 1/s",
        f"{ABOUT:g}, the rule for *similar*",
        *(at_most(label, ABOUT, found["one mass"]) for label, found in both.items()),
        why="but near half the natural frequency the second harmonic has its own resonance, see L7102",
    )


def _dampers() -> Iterator[Statement]:
    """Judge the statements on the dampers of Fig 4.6 and 4.7."""
    both = {f"I4 = {inertia:g}": damper_effects(inertia) for inertia in DAMPED_RATIOS}
    high, low = ([flattening_damper(inertia, times) for times in TIMES] for inertia in DAMPED_RATIOS)
    ratio = 0.5 * STRONGEST / OMEGA_K
    yield statement(
        "The natural frequency decreases slightly with increase of damping.",
        "4.5.2, L3178-3180",
        f"change of the frequency from omega_c = {DAMPERS[0]:g} to {STRONGEST:g} 1/s by the right equation: of the free "
        "motion, by its multipliers at 20 rad/s (our choice); and of the peak of the curves, which the figures show",
        f"{SIGN}: a damper of {100 * ratio:.1f} % of the critical one cannot lower a frequency by 5 %, as the rule for "
        "*slightly* would require",
        *(
            at_most(
                f"{name}; {label}",
                0.0,
                1e3 * found[name],
                "mrad/s",
                why="the peak rises because the force grows with the square of the speed",
            )
            for label, found in both.items()
            for name in ("of the free motion", "of the peak")
        ),
    )
    yield statement(
        "It also shows that a smaller value of damping eliminated resonance for the case of [I4]=0.5 than that for [I4] = 1.",
        "4.5.2, L3182-3184",
        f"damper that lowers the peak of the first harmonic to 1.5, 2 or 5 times its amplitude {OUTSIDE:g} rad/s above the "
        "peak, which is our reading of *eliminated*; its value at I4 = 0.5 relative to that at I4 = 1; right equation",
        SIGN,
        *(at_most(f"{times:g} times", 1.0, less / more) for times, less, more in zip(TIMES, low, high)),
    )


def draw_damped(result: StudyResult) -> Figure:
    """Draw the first harmonic with each damper by the correct equation.

    With the strongest damper also draw it by the variants of the equation and by the plant.
    """
    c = result.columns
    dampers = [Curve(x=CLOSE, y=c[f"omega_c = {d:g} 1/s; corrected [1]"], label=f"{d:g}") for d in DAMPERS]
    strongest = [
        Curve(x=CLOSE, y=c[f"omega_c = {STRONGEST:g} 1/s; {name} [1]"], label=name, colour=colour, line=line)
        for name, colour, line in zip([*VARIANTS.values(), "plant"], [*COLOURS[:3], "0.1"], ("-", "-", "--", ":"))
    ]
    panels = [
        Panel(
            x_label="crank speed [rad/s]",
            y_label="first harmonic of u, relative to l4",
            curves=curves,
            legend=legend,
            legend_at="outside",
            x_range=x_range,
        )
        for curves, legend, x_range in (
            (dampers, r"corrected, $\omega_c$ [1/s]", (27.0, 35.0)),
            (strongest, rf"$\omega_c$ = {STRONGEST:g} 1/s", (29.0, 33.0)),
        )
    ]
    return plot_curves(panels, title=result.heading)


#: The studies by number.
STUDIES = {
    "4.3": Study(compute_first, partial(draw_undamped, n=1)),
    "4.4": Study(compute_second, partial(draw_undamped, n=2)),
    "4.5": Study(compute_deviation, draw_deviation),
    "4.6": Study(partial(compute_damped, 1.0), draw_damped),
    "4.7": Study(partial(compute_damped, 0.5), draw_damped),
}
