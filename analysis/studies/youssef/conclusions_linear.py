"""Verdicts on the conclusions of the thesis about the linear equation: section 8.0, and 9.1 on resonance and stability."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SQUARE_OF_OMEGA_K, chapter_4

from ...periodic import natural_frequency
from ...youssef import resonance, slider_equation
from ..rules import ABOUT, ALIKE, SMALL
from ..statements import Case, FloatArray, Statement, at_least, at_most, near, statement
from .chapter_4 import AT_PEAKS, DAMPERS, INERTIA_RATIOS, OMEGA_K, harmonic, linear, range_above
from .chapter_5 import with_held_angles, with_same_ground
from .linearised import with_crank
from .regions import axis, hill_region, removing_estimate
from .runs import SIGN

#: Inertia ratios of the stability; dampers omega_c (1/s) and speeds (rad/s) of the resonance.
RATIOS = (0.25, 0.5, 1.0, 1.5, 2.0)
WEAK, STRONG = DAMPERS[0], DAMPERS[-1]
SPEEDS = np.unique(np.append(np.arange(10.0, 45.0, 0.05), AT_PEAKS[AT_PEAKS > 10.0]).round(3))
#: Lengths of crank and coupler relative to the rocker's, in the ranges of Fig 5.2 and 5.3.
CRANKS, COUPLERS = (0.01, 0.03, 0.05, 0.07, 0.1), (0.8, 0.9, 1.0, 1.1, 1.2)
#: Amplitude u/l4 above which a speed counts as resonant.
LARGE = 0.05
#: Tolerances of a single region near twice the natural frequency, in words.
OF_REGION = (
    f"{ABOUT:g} of 2, the rule for *near*, which we use for *vicinity* too; {SMALL:g}, the rule for *negligible*: a narrower "
    "region would not count"
)
#: Words for the equation behind the numbers of chapters IV and V, for the speeds and for the dampers.
RIGHT = "right linear equation"
SPEEDS_WORDS = "10 to 45 rad/s in steps of 0.05, closer at the resonances (our choice)"
DAMPERS_WORDS = f"omega_c = {WEAK:g} and {STRONG:g} 1/s (Fig 4.6)"


def short_crank(order: int, inertia_ratio: float, damper: float, most: int = 2) -> FloatArray:
    """Return the amplitude of the harmonic ``order`` of u/l4 at each of the `SPEEDS`, by a balance of ``most`` harmonics.

    ``damper`` is omega_c (1/s).
    """
    return harmonic(order, SPEEDS, inertia_ratio, damper, harmonics=most)


@cache
def oscillator_differences(inertia_ratio: float) -> tuple[float, float]:
    """Compare the motion with that of a damped oscillator under a force that grows with the square of the speed.

    The oscillator has the mean values of M and K; its force is fitted to the first harmonic over all speeds. Returns the
    greatest difference of the first harmonic from the oscillator's amplitude, relative to the oscillator's amplitude,
    and the same difference for the amplitude of both harmonics together. Each is the greater of the results for two dampers.
    """
    found, compared = slider_equation(chapter_4(inertia_ratio), 1.0), []
    for damper in (WEAK, STRONG):
        mass = found.mass.mean - found.stiffness.mean
        stiffness = np.abs(SQUARE_OF_OMEGA_K / SPEEDS**2 - mass + 1j * damper / SPEEDS)
        first = short_crank(1, inertia_ratio, damper)
        both = np.array([linear(w, inertia_ratio, damper).amplitude for w in SPEEDS.tolist()])
        oscillator = np.average(first * stiffness, weights=np.gradient(SPEEDS)) / stiffness
        compared.append([np.abs(size / oscillator - 1.0).max() for size in (first, both)])
    one, two = np.max(compared, axis=0).tolist()
    return one, two


def judge_oscillator(why: str = "") -> tuple[Case, ...]:
    """Judge whether the slider moves as a damped oscillator does; see `oscillator_differences`."""
    found = np.max([oscillator_differences(i) for i in INERTIA_RATIOS], axis=0)
    return tuple(at_most(name, ABOUT, x, why=why) for name, x in zip(("first harmonic", "both harmonics"), found))


def width(parameters: FiveBarParameters, number: int = 1) -> float:
    """Return the width in lambda_k^2 of the region of instability with the given number, by Hill's determinant."""
    return hill_region(parameters, number).width


def removing_damping_ratio(mechanisms: Iterable[FiveBarParameters]) -> float:
    """Return the damping ratio that removes the first four regions of instability of all given mechanisms.

    It is relative to the critical damping of the mass m4 + m5 on the spring.
    """
    return max(removing_estimate(p, number) for p in mechanisms for number in range(1, 5)) / (2.0 * OMEGA_K)


def judge_single_region() -> tuple[Case, Case]:
    """Judge whether the only region of instability is near twice the natural frequency."""
    mechanisms = [chapter_4(i) for i in RATIOS]
    least = min(width(p, 2) / width(p) for p in mechanisms)
    speeds = [axis(hill_region(p)) * OMEGA_K / natural_frequency(p) for p in mechanisms]
    farthest = max(speeds, key=lambda x: abs(x - 2.0))
    return (
        near("speed of the region over the natural frequency", 2.0, farthest, 2.0 * ABOUT),
        at_most("region at the natural frequency", SMALL, least, why="without a damper there is one too"),
    )


def _listed(values: Iterable[float]) -> str:
    *first, last = (f"{value:g}" for value in values)
    return f"{', '.join(first)} and {last}"


def judge_introduction() -> Iterator[Statement]:
    """Judge the statements of section 8.0 on the theory."""
    removing = {
        "rocker's inertia": removing_damping_ratio(map(chapter_4, RATIOS)),
        "crank": removing_damping_ratio(map(with_crank, CRANKS)),
        "coupler, angles held": removing_damping_ratio(map(with_held_angles, COUPLERS)),
        "coupler, same ground link": removing_damping_ratio(map(with_same_ground, COUPLERS)),
    }
    yield statement(
        "The resonance analysis showed a behaviour similar to a second order system while the stability analysis showed "
        "instability in the second region, i. e. in the vicinity of twice the natural frequency only.",
        "8.0, L6057",
        "for the resonance, the difference of the amplitude from that of a single mass, as at L7102. For the stability, as "
        "at L7116: speed in the middle of the region near twice the natural frequency, relative to this frequency, and "
        "width of the region at the natural frequency, relative to that of this region",
        f"{ABOUT:g}, the rule for *similar*; {OF_REGION}",
        *judge_oscillator("near half the natural frequency the second harmonic has its own resonance"),
        *judge_single_region(),
    )
    yield statement(
        "The instability, however, disappeared completely by addition of a small value of damping.",
        "8.0, L6063",
        "omega_c that removes the regions near twice, once, two thirds and half of the natural frequency, relative to "
        "the critical value 2 omega_k: the greatest for I4 = 0.25 to 2, for l2/l4 = 0.01 to 0.1 at I4 = 1 and for l3/l4 "
        f"= 0.8 to 1.2 at I4 = 2; estimated by the {RIGHT} from the widths without a damper",
        f"{SMALL:g}, the rule for *small*",
        *(at_most(name, SMALL, share) for name, share in removing.items()),
        why="*the instability* is that of the sentence before; the slider's fall beyond the zeroth boundary is judged at L3952",
    )


def judge_linearised() -> Iterator[Statement]:
    """Judge the conclusions on the linear equation and its stability."""
    yield from _on_resonance()
    yield from _on_stability()


def _on_resonance() -> Iterator[Statement]:
    """Judge the conclusions on the motion of the slider with a short crank."""
    each = [(i, damper) for i in INERTIA_RATIOS for damper in (WEAK, STRONG)]
    first, second = ({which: short_crank(n, *which) for which in each} for n in (1, 2))
    five = {which: [short_crank(n, *which, 5) for n in range(1, 6)] for which in each}
    # of the second harmonic, and of the third to fifth, to the first
    of_greatest = (
        max(second[x].max() / first[x].max() for x in each),
        max(np.max(higher) / one.max() for one, _, *higher in five.values()),
    )
    of_each = (
        max((second[x] / first[x]).max() for x in each),
        max((higher / one).max() for one, _, *higher in five.values()),
    )
    speeds = np.array([resonance(chapter_4(i))[0] for i in RATIOS])
    bend = np.abs(speeds - np.polyval(np.polyfit(RATIOS, speeds, 1), RATIOS)).max() / np.ptp(speeds)
    # by damper, then by inertia
    curves = [[first[i, damper] for i in INERTIA_RATIOS] for damper in (WEAK, STRONG)]
    tops = np.array([[curve.max() for curve in row] for row in curves])
    wide = np.array([[range_above(LARGE, SPEEDS, curve) for curve in row] for row in curves])
    half = [range_above(0.5 * curve.max(), SPEEDS, curve) for curve in curves[-1]]
    yield statement(
        "Results for a short crank showed similarity to a damped second order linear system behaviour.",
        "9.1, L7102",
        "slider's amplitude, by the first harmonic and by both, minus that of a single damped mass on a spring under an "
        "unbalance, relative to the latter. The single mass has the means of M and K and the unbalance that fits the first "
        f"harmonic on average. The greatest difference for I4 = 0.5, 1 and 1.5, {DAMPERS_WORDS}, {SPEEDS_WORDS}; {RIGHT}",
        f"{ABOUT:g}, the rule for *similar*",
        *judge_oscillator(),
        why="near half the natural frequency the second harmonic, judged next, has its own resonance",
    )
    yield statement(
        "The major harmonic in the solution was the first harmonic; the remaining ones were almost negligible.",
        "9.1, L7104",
        "second harmonic, and greatest of the third to fifth, relative to the first: the greatest values of each, and "
        "the values at the same speed. The largest ratio is listed, for speeds, I4 and dampers of the row before",
        f"1, since the *major* harmonic is the greater; {SMALL:g}, the rule for *negligible*",
        *(
            at_most(f"{which}; {how}", bound, ratio)
            for how, ratios in (("greatest over greatest", of_greatest), ("at the same speed", of_each))
            for which, bound, ratio in (
                ("first major", 1.0, max(ratios)),
                ("second", SMALL, ratios[0]),
                ("third to fifth", SMALL, ratios[1]),
            )
        ),
        why="near half and a third of the natural frequency the second and the third harmonic have their own resonances",
    )
    yield statement(
        "It was found that the increase in the rocker inertia decreased the natural frequency linearly, increased the "
        "amplitude of vibrations and widened the region of resonance.",
        "9.1, L7110",
        f"resonant speeds without a damper, I4 = {_listed(RATIOS)}: distance from a line, relative to their range, and "
        "greatest growth with I4. Then the least growth, from I4 = 0.5 to 1 and 1.5, of the greatest first harmonic "
        f"of u/l4 and of the range of speeds at which it is above {LARGE:g} (our choice), {DAMPERS_WORDS}; {RIGHT}",
        f"{ALIKE:g}, the rule for *linear*; {SIGN}",
        at_most("distance from a line", ALIKE, bend),
        at_most("growth of the resonant speed", 0.0, np.diff(speeds).max(), "rad/s"),
        at_least("growth of the amplitude u/l4", 0.0, np.diff(tops).min()),
        at_least("growth of the range", 0.0, np.diff(wide).min(), "rad/s"),
        why=f"but the range above half of the peak shrinks: at {STRONG:g} 1/s from {half[0]:.2f} to {half[-1]:.2f} rad/s",
    )


def _on_stability() -> Iterator[Statement]:
    """Judge the conclusions on the regions of instability."""
    by_crank = [width(with_crank(s)) for s in CRANKS]
    by_coupler = [width(with_same_ground(s)) for s in COUPLERS]
    by_inertia = [width(chapter_4(i)) for i in RATIOS]
    narrow = max(2.0 * width(p) / (hill_region(p).low + hill_region(p).high) for p in map(chapter_4, RATIOS))
    yield statement(
        "The stability analysis showed a narrow region of instability in the [vicinity of w = 2wn] only, where [wn is "
        "the] natural frequency.",
        "9.1, L7116",
        "region near twice the natural frequency: greatest width in lambda_k^2 relative to its middle; speed in its "
        "middle relative to this frequency, with the mean mass, the farthest from 2. For *only*, the least width of the "
        f"region at the natural frequency, relative to that of this region. I4 = 0.25 to 2, without a damper, {RIGHT}",
        f"{SMALL:g}, the rule for *small*, which we use for *narrow* too; {OF_REGION}",
        at_most("width", SMALL, narrow),
        *judge_single_region(),
    )
    yield statement(
        "Instability of the slider motion was shown to increase with increase of crank length, decrease of coupler "
        "length and increase of output inertia.",
        "9.1, L7120",
        "*instability* is read as the width of the first region in lambda_k^2, which Figs 5.1 to 5.3 show: its least "
        f"growth between neighbouring values of l2/l4 = {_listed(CRANKS)} at I4 = 1, of l3/l4 = "
        f"{_listed(COUPLERS[::-1])} at I4 = 2, and of I4 = {_listed(RATIOS)}; without a damper, {RIGHT}",
        SIGN,
        at_least("longer crank", 0.0, np.diff(by_crank).min()),
        at_least(
            "shorter coupler, same ground link",
            0.0,
            -np.diff(by_coupler).max(),
            why="on the same ground link the region is narrowest where coupler and rocker are about equal",
        ),
        at_least("shorter coupler, angles held", 0.0, -np.diff([width(with_held_angles(s)) for s in COUPLERS]).max()),
        at_least("larger inertia", 0.0, np.diff(by_inertia).min()),
    )
