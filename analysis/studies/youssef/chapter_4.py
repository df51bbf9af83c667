"""The figures of chapter IV: the slider's amplitude over the speed by the linearised equation, and its resonances.

The thesis balances two harmonics, eqs (4.30) to (4.35), of its equation (4.21). We do the same with the right coefficients;
beside them are its own, as printed and as listed, in the form of its appendix 2. Amplitudes are those of zeta = u/l4; the
spring with m4 + m5 alone has omega_k = 31.623 rad/s.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from linkwork.five_bar.published import SQUARE_OF_OMEGA_K, chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...youssef import (
    Form,
    HarmonicMotion,
    SliderEquation,
    Variant,
    hill_multipliers,
    nonlinear_harmonic_balance,
    resonance,
    slider_equation,
    two_harmonics,
)
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, listing, near, text

OMEGA_K = sqrt(SQUARE_OF_OMEGA_K)
#: Inertia ratios I4 whose resonances by appendix 2 are known.
INERTIA_RATIOS = (0.5, 1.0, 1.5)
#: Resonances (rad/s) by I4: by appendix 2 when run, and exact. The determinant vanishes at two speeds, the lower first; both
#: are compared at I4 = 1.5.
RESONANCES = {
    0.5: ((31.0763, 31.0975),),
    1.0: ((30.5572, 30.5979),),
    1.5: ((30.0632, 30.1220), (30.0645, 30.1392)),
}
#: Resonance (rad/s) at I4 = 1 by the printed coefficients.
PRINTED_RESONANCE = 30.6120
#: Variants that are compared, by their names in legends.
VARIANTS = {Variant.EXACT: "corrected", Variant.PRINTED: "(4.21) as printed", Variant.FORTRAN: "listing of appendix 2"}
#: The speeds of appendix 2 (rad/s), closer at the resonances.
SPEEDS = np.unique(
    np.concatenate([np.arange(9.0, 40.05, 0.1), np.arange(15.0, 15.8, 0.005), np.arange(30.0, 31.3, 0.005)]).round(3)
)
#: Mask of the speeds outside the regions of resonance.
APART = (np.abs(SPEEDS - 15.5) > 1.0) & (np.abs(SPEEDS - 31.0) > 2.0)
#: omega_c = mu/(m4 + m5) (1/s) of appendix 2: it raises mu by 200 dyn.s/cm after each curve, and m4 + m5 is 1000 g.
DAMPERS = tuple(0.2 * n for n in range(1, 7))
#: omega_c (1/s) of the comparison of second harmonics: the thesis's, which removes all instability.
COMPARED_AT = 0.45
#: Least amplitude in the region of resonance, and least distance of the outside from the resonance (rad/s): our choice.
LARGE, OUTSIDE = 0.1, 3.0
#: Our readings of "may be neglected" and "not affected on the scale of the graph".
NEGLIGIBLE, UNSEEN = 0.1, 0.01


@cache
def equation(inertia_ratio: float, variant: Variant) -> SliderEquation:
    """Return the linear equation at 1 rad/s: without gravity only its spring and its damper depend on the speed."""
    return slider_equation(chapter_4(inertia_ratio), 1.0, variant=variant, form=Form.RESONANCE)


def linear(
    speed: float, inertia_ratio: float, omega_c: float = 0.0, variant: Variant = Variant.EXACT
) -> HarmonicMotion:
    """Return zeta by the thesis's two harmonics."""
    once = equation(inertia_ratio, variant)
    return two_harmonics(replace(once, spring=SQUARE_OF_OMEGA_K / speed**2, damping=omega_c / speed))


def harmonic(
    n: int, speeds: NDArray[np.float64], inertia_ratio: float, omega_c: float = 0.0, variant: Variant = Variant.EXACT
) -> NDArray[np.float64]:
    """Return the amplitude of the n-th harmonic over the speed."""
    return np.array([linear(speed, inertia_ratio, omega_c, variant).harmonic(n) for speed in speeds.tolist()])


def peak(n: int, inertia_ratio: float, omega_c: float, variant: Variant = Variant.EXACT) -> tuple[float, float]:
    """Return speed (rad/s) and size of the greatest n-th harmonic near its resonance."""
    middle = 0.5 * sum(resonance(chapter_4(inertia_ratio), variant=variant, harmonic=n))
    found = minimize_scalar(
        lambda speed: -linear(speed, inertia_ratio, omega_c, variant).harmonic(n),
        bounds=(middle - 0.5, middle + 0.5),
        method="bounded",
        options={"xatol": 1e-7},
    )
    return float(found.x), -float(found.fun)


# Figures 4.3 and 4.4


def undamped_columns(n: int) -> dict[str, NDArray[np.float64]]:
    """Return the n-th harmonic over the speed, for three I4 by the exact equation and for I4 = 1 by each variant."""
    columns = {"speed [rad/s]": SPEEDS}
    for ratio in INERTIA_RATIOS:
        for variant, name in VARIANTS.items():
            if variant is Variant.EXACT or ratio == 1.0:
                columns[f"I4 = {ratio:g}; {name} [1]"] = harmonic(n, SPEEDS, ratio, 0.0, variant)
    return columns


def growth_verdicts(columns: dict[str, NDArray[np.float64]], n: int, place: str) -> list[Verdict]:
    """Judge whether amplitudes and the width of the resonance grow with I4."""
    curves = [columns[f"I4 = {ratio:g}; corrected [1]"] for ratio in INERTIA_RATIOS]
    ratios = [np.min((larger / smaller)[APART]) for smaller, larger in pairwise(curves)]
    level = LARGE if n == 1 else 0.1 * LARGE
    near_it = np.arange(28.0, 34.0, 0.02) if n == 1 else np.arange(14.8, 16.2, 0.01)
    widths = [np.count_nonzero(harmonic(n, near_it, ratio) > level) for ratio in INERTIA_RATIOS]
    return [
        at_least(
            "amplitude outside the resonance to that at the next smaller I4, least", text(place), 1.0, min(ratios)
        ),
        at_least(
            f"width of the region of resonance, amplitudes above {level:g}, at I4 = 1.5 to that at 0.5",
            text(place),
            1.0,
            widths[2] / widths[0],
        ),
    ]


def compute_first() -> StudyResult:
    """Compute Fig 4.3, and the speeds at which the determinant vanishes."""
    columns = undamped_columns(1)
    verdicts = []
    for ratio, roots in RESONANCES.items():
        lower, upper = resonance(chapter_4(ratio))
        own = resonance(chapter_4(ratio), variant=Variant.FORTRAN)
        verdicts += [
            at_most(
                f"distance of the resonance below omega_k; I4 = {ratio:g}",
                text("L3139-3143"),
                1.0,
                OMEGA_K - lower,
                "rad/s",
                why="" if ratio < 1.0 else "reached at I4 = 0.97",
            ),
            at_most(f"resonance against omega_k; I4 = {ratio:g}", text("L3141, L3188"), OMEGA_K, upper, "rad/s"),
        ]
        for name, (listed, reference), found, transcribed in zip(
            ("resonance", "upper resonance"), roots, (lower, upper), own
        ):
            statement, by_listing = f"{name}; I4 = {ratio:g}", f"{name} by the listing as transcribed; I4 = {ratio:g}"
            why = "M' zeta' is missing, terms in the crank's length are halved"
            verdicts += [
                near(statement, listing("appendix 2"), listed, found, 5.1e-5, "rad/s", why=why),
                near(statement, OURS, reference, found, 5.1e-5, "rad/s"),
                near(by_listing, OURS, listed, transcribed, 5.1e-5, "rad/s"),
            ]
    printed, _ = resonance(chapter_4(1.0), variant=Variant.PRINTED)
    raw = slider_equation(chapter_4(1.0), 1.0, variant=Variant.PRINTED, form=Form.QUOTIENT)
    waves = [one.exponential for one in (raw.mass, raw.spring_factor, raw.stiffness)]
    verdicts += [
        at_least(
            "A1 or D1 to the greatest first harmonic of (4.21), whose factor cannot be read; I4 = 1",
            text("L2797-2801"),
            1.0,
            min(raw.mass.mean, raw.spring_factor.mean) / max(2.0 * abs(wave[-1]) for wave in waves),
        ),
        near("resonance by the printed coefficients; I4 = 1", OURS, PRINTED_RESONANCE, printed, 5.1e-5, "rad/s"),
        *growth_verdicts(columns, 1, "L3156-3162, L3197"),
    ]
    return StudyResult(
        number="4.3",
        claim="First harmonic over the crank speed without damping, for three inertia ratios.",
        assignment="The three inertia ratios are ours: those whose resonances by appendix 2 are known.",
        columns=columns,
        verdicts=tuple(verdicts),
    )


def compute_second() -> StudyResult:
    """Compute Fig 4.4: the second harmonic, its size beside the first, and the error of the listing."""
    columns = undamped_columns(2)
    step = 0.005
    resonant = np.arange(14.5, 16.5, step)
    exceeds = [np.count_nonzero(harmonic(2, resonant, r) > harmonic(1, resonant, r)) * step for r in INERTIA_RATIOS]
    fast = SPEEDS >= 20.0
    small = max(
        (columns[f"I4 = {ratio:g}; corrected [1]"] / harmonic(1, SPEEDS, ratio))[fast].max() for ratio in INERTIA_RATIOS
    )
    speed, right = peak(2, 1.0, COMPARED_AT)
    _, listed = peak(2, 1.0, COMPARED_AT, Variant.FORTRAN)
    plant = nonlinear_harmonic_balance(chapter_4(1.0, COMPARED_AT), speed).harmonic(2) / chapter_4(1.0).rocker_length
    verdicts = [
        at_most(
            "resonance of the second harmonic, highest of the three I4, against omega_k / 2",
            text("L3188-3195"),
            0.5 * OMEGA_K,
            max(resonance(chapter_4(ratio), harmonic=2)[1] for ratio in INERTIA_RATIOS),
            "rad/s",
        ),
        at_most(
            "second harmonic to the first, greatest from 20 to 40 rad/s", text("L3162-3168, L3210"), NEGLIGIBLE, small
        ),
        at_most(
            "range of speeds near omega_k / 2 in which the second harmonic is greater than the first, widest",
            text("L3162-3168, L3210"),
            0.0,
            max(exceeds),
            "rad/s",
            why="it resonates there",
        ),
        near(
            "second harmonic at its resonance; I4 = 1, omega_c = 0.45 1/s",
            listing("appendix 2"),
            listed,
            right,
            0.01 * listed,
            why="M' zeta' is missing, terms in the crank's length are halved",
        ),
        near("the same, right to that of the listing as transcribed", OURS, 7.0, right / listed, 0.5),
        near("the same, by two harmonics to the plant's", OURS, 1.0, right / plant, 0.005),
        *growth_verdicts(columns, 2, "L3156-3162, L3197"),
    ]
    return StudyResult(
        number="4.4",
        claim="Second harmonic over the crank speed without damping, for three inertia ratios.",
        assignment="The three inertia ratios are ours, those of Fig 4.3.",
        columns=columns,
        verdicts=tuple(verdicts),
    )


def draw_undamped(result: StudyResult, n: int) -> Figure:
    """Draw the three inertia ratios, and the variants close to the resonance."""
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
    """Compute Fig 4.5: the distance of the resonance below omega_k."""
    columns = {"inertia ratio I4 [1]": RATIOS}
    for variant, name in VARIANTS.items():
        columns[f"omega_k less resonance; {name} [rad/s]"] = np.array(
            [OMEGA_K - resonance(chapter_4(ratio), variant=variant)[0] for ratio in RATIOS.tolist()]
        )
    deviation = columns["omega_k less resonance; corrected [rad/s]"]
    shown = RATIOS <= 1.5
    slope = deviation[shown][-1] / 1.5
    bent = np.abs(deviation - slope * RATIOS)[shown].max() / deviation[shown].max()
    still = equation(0.0, Variant.EXACT)
    rest = max(np.abs(s.exponential).max() for s in (still.mass + -1.0, still.stiffness, still.force))
    return StudyResult(
        number="4.5",
        claim="The deviation of the resonance from omega_k falls linearly with the inertia ratio, to zero.",
        assignment="The range of I4 is ours.",
        columns=columns,
        verdicts=(
            at_most(
                "greatest distance of the deviation from a straight line through zero, of it; I4 up to 1.5",
                text("L3148-3150"),
                0.05,
                bent,
            ),
            near("deviation at I4 = 0", text("L3150"), 0.0, deviation[0], 1e-6, "rad/s"),
            at_most(
                "what the equation at I4 = 0 has beyond a mass on a spring, greatest coefficient",
                text("L3152-3156"),
                1e-12,
                rest,
            ),
        ),
    )


def draw_deviation(result: StudyResult) -> Figure:
    """Draw the deviation by each variant."""
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
    """Return the frequency of the free motion (rad/s), from the Floquet multipliers at 20 rad/s."""
    speed = 20.0
    found = slider_equation(chapter_4(inertia_ratio, omega_c), speed)
    multiplier = hill_multipliers(found.homogeneous().stiffened(found.spring))[0]
    turns = abs(np.angle(multiplier)) / (2.0 * pi)
    # between one and two cycles a turn
    return float(speed * (2.0 - turns))


def eliminating(inertia_ratio: float, amplitude: float) -> float:
    """Find the omega_c (1/s) that limits the peak of the first harmonic to an amplitude."""
    return float(brentq(lambda d: peak(1, inertia_ratio, d)[1] - amplitude, 0.1, 10.0, xtol=1e-6))


def one_mass(inertia_ratio: float, omega_c: float) -> NDArray[np.float64]:
    """Return the first harmonic of a single mass on a spring, with the means of M and K alone."""
    found = equation(inertia_ratio, Variant.EXACT)
    stiffness = SQUARE_OF_OMEGA_K / CLOSE**2 + found.stiffness.mean - found.mass.mean
    amplitude: NDArray[np.float64] = found.force.amplitudes[1] / np.abs(stiffness + 1j * omega_c / CLOSE)
    return amplitude


def compute_damped(number: str, inertia_ratio: float) -> StudyResult:
    """Compute Fig 4.6 or 4.7: the first harmonic with the dampers of the listing."""
    columns = {"speed [rad/s]": CLOSE}
    for omega_c in (0.0, *DAMPERS):
        columns[f"omega_c = {omega_c:g} 1/s; corrected [1]"] = harmonic(1, CLOSE, inertia_ratio, omega_c)
    for variant, name in list(VARIANTS.items())[1:]:
        columns[f"omega_c = {STRONGEST:g} 1/s; {name} [1]"] = harmonic(1, CLOSE, inertia_ratio, STRONGEST, variant)
    mechanism = chapter_4(inertia_ratio, STRONGEST)
    plant = [nonlinear_harmonic_balance(mechanism, speed).harmonic(1) for speed in CLOSE.tolist()]
    columns[f"omega_c = {STRONGEST:g} 1/s; plant [1]"] = np.array(plant) / mechanism.rocker_length
    weak, strong, none = (columns[f"omega_c = {d:g} 1/s; corrected [1]"] for d in (DAMPERS[0], STRONGEST, 0.0))
    tallest = peak(1, inertia_ratio, DAMPERS[0])
    outside = np.abs(CLOSE - tallest[0]) > OUTSIDE
    shift = peak(1, inertia_ratio, STRONGEST)[0] - tallest[0]
    alone = equation(inertia_ratio, Variant.EXACT).force.amplitudes[1] * tallest[0] / DAMPERS[0]
    verdicts = [
        at_most(
            f"change of the amplitude by omega_c = {STRONGEST:g} 1/s farther than {OUTSIDE:g} rad/s from the resonance, of the "
            f"peak at {DAMPERS[0]:g}",
            text("L3176-3178, L3203"),
            UNSEEN,
            np.abs(strong - none)[outside].max() / tallest[1],
        ),
        at_most(
            f"shift of the peak from omega_c = {DAMPERS[0]:g} to {STRONGEST:g} 1/s",
            text("L3178-3180"),
            0.0,
            1e3 * shift,
            "mrad/s",
            why="the force grows with the square of the speed",
        ),
        at_most(
            f"shift of the frequency of the free motion from omega_c = {DAMPERS[0]:g} to {STRONGEST:g} 1/s",
            text("L3178-3180"),
            0.0,
            1e3 * (free_frequency(inertia_ratio, STRONGEST) - free_frequency(inertia_ratio, DAMPERS[0])),
            "mrad/s",
        ),
        at_most(
            f"amplitude less that of one mass on a spring, of the peak; omega_c = {DAMPERS[0]:g} 1/s",
            text("L3206-3208"),
            0.05,
            np.abs(weak - one_mass(inertia_ratio, DAMPERS[0])).max() / tallest[1],
        ),
        near(f"peak relative to F1/lambda_c; omega_c = {DAMPERS[0]:g} 1/s", OURS, 1.0, tallest[1] / alone, 0.02),
        near(
            f"peak of the plant relative to the linear one; omega_c = {STRONGEST:g} 1/s",
            OURS,
            1.0,
            max(plant) / mechanism.rocker_length / strong.max(),
            0.03,
        ),
    ]
    if inertia_ratio < 1.0:
        level = 2.0 * LARGE
        verdicts.append(
            at_most(
                f"damper that keeps the amplitude below {level:g}, to that at I4 = 1",
                text("L3182-3184"),
                1.0,
                eliminating(inertia_ratio, level) / eliminating(1.0, level),
            )
        )
    return StudyResult(
        number=number,
        claim=f"First harmonic over the crank speed with dampers, I4 = {inertia_ratio:g}.",
        assignment="The dampers are those of the listing of appendix 2; that the amplitude is the first harmonic's is ours.",
        columns=columns,
        verdicts=tuple(verdicts),
    )


def draw_damped(result: StudyResult) -> Figure:
    """Draw all dampers by the exact equation, and the strongest by each variant and the plant."""
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
    study.number: study
    for study in (
        Study("4.3", compute_first, partial(draw_undamped, n=1)),
        Study("4.4", compute_second, partial(draw_undamped, n=2)),
        Study("4.5", compute_deviation, draw_deviation),
        Study("4.6", partial(compute_damped, "4.6", 1.0), draw_damped),
        Study("4.7", partial(compute_damped, "4.7", 0.5), draw_damped),
    )
}
