"""Verdicts on the conclusions of the thesis: on each sentence of sections 8.0 and 9.1 that makes a claim.

Most of these sentences sum up statements that are judged in the chapters; here each sentence is judged again as a whole.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from math import asin, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SQUARE_OF_OMEGA_K, chapter_4

from ...periodic import natural_frequency
from ...run import Event, Inputs, Trajectory, simulate
from ...slider import slider_motion
from ...synthesis import Search, SliderUnknown, UntimedPath, evaluate, path_from_formula
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ...youssef import HarmonicMotion, harmonic_balance, resonance, slider_equation
from ..rules import ABOUT, ABOUT_DEG, ALIKE, SEEN_FALL, SMALL
from ..statements import Case, Statement, at_least, at_most, near, text
from ..study import Study, StudyResult
from .chapter_3 import COLLINEAR_SINE, DAMPINGS, DRAWN_TURNS, FEWEST_TURNS, apart_on_the_graph, drift, from_rest
from .chapter_4 import DAMPERS
from .chapter_5 import closed, held
from .chapter_6 import TABLE, our_error, over_least, printed_error, share_of_stated
from .formulation import STEPS, integrated, multipliers, shown_by_closure
from .free_crank import TORQUES, Turns, accelerated, launch, run_peak
from .linearised import with_crank
from .problems import AREA_N, PROBLEMS
from .regions import axis, hill, removing_estimate
from .rig_2 import RANGE, length, linear_motion
from .rigs import LOST, amplitude, overtones, turn
from .runs import SPEED, STIFFNESSES, plain, steady_turn, table_3_1
from .series_2 import linkage_error, out_of_reach, path_motion, reduced, reduced_further, shares_of_stated

NUMBER = "conclusions"
OMEGA_K = sqrt(SQUARE_OF_OMEGA_K)
#: Inertia ratios of the stability, and of the resonance with its dampers omega_c (1/s) and speeds (rad/s).
RATIOS, RESONANT = (0.25, 0.5, 1.0, 1.5, 2.0), (0.5, 1.0, 1.5)
WEAK, STRONG = DAMPERS[0], DAMPERS[-1]
SPEEDS = np.arange(10.0, 45.0, 0.05)
#: Lengths of crank and coupler relative to the rocker's, in the ranges of Fig 5.2 and 5.3.
CRANKS, COUPLERS = (0.01, 0.03, 0.05, 0.07, 0.1), (0.8, 0.9, 1.0, 1.1, 1.2)
#: Amplitude u/l4 above which a speed counts as resonant.
LARGE = 0.05
#: Words for the equation behind the numbers of chapters IV and V, and for the speeds.
RIGHT = "by the right linear equation"
SPEEDS_WORDS = "10 to 45 rad/s in steps of 0.05 (our choice: a third to nearly one and a half of omega_k = 31.6 rad/s)"
DAMPERS_WORDS = f"omega_c = {WEAK:g} and {STRONG:g} 1/s, the weakest and the strongest damper of Fig 4.6"
OSCILLATOR = (
    "spread, relative to its mean, of F0/omega^2, as under an unbalance, F0 the force that gives one mass on the same spring "
    "and damper, with the means of M and K as at L3206, the first harmonic; greatest amplitude over that of this system under "
    f"the mean of F0/omega^2, as at L6970; {SPEEDS_WORDS}; the most of {DAMPERS_WORDS}"
)
REGIONS = "twice, once, two thirds and half of the natural frequency"
#: Longer semi-axes of the ellipses that links move along (cm): those of paths (a) and (b), and one between.
ELLIPSES = {"path (a), 10 cm": 10.0, "12.5 cm": 12.5, "path (b), 15 cm": 15.0}
#: Launches of Fig 3.6 and 3.9: torque (dyn.cm) and spring (dyn/cm); those that get collinear without a damper.
LAUNCHES = (*((torque, 1e6) for torque in TORQUES), (1e8, 5e5), (1e8, 2e6))
FOLDING = ((2e8, 1e6), (1e8, 5e5))
#: The damper of a launch (dyn.s/cm), and how long its free motion is followed (s): ten turns of the slowest.
DAMPED, FREE = {"with the damper": 3e4, "without": 0.0}, 3.0
#: Turns that are run at most without a spring.
MOST_TURNS = 80
SIGN = "none, the sign decides"


@cache
def short_crank(inertia_ratio: float, damper: float, most: int) -> tuple[HarmonicMotion, ...]:
    """Return the motion u/l4 of chapter IV's mechanism at each of the `SPEEDS`, with the harmonics up to ``most``."""
    found = slider_equation(chapter_4(inertia_ratio), 1.0)
    return tuple(
        harmonic_balance(replace(found, spring=SQUARE_OF_OMEGA_K / w**2, damping=damper / w), most)
        for w in SPEEDS.tolist()
    )


def harmonic(order: int, inertia_ratio: float, damper: float, most: int = 2) -> NDArray[np.float64]:
    """Return the amplitude of one harmonic of u/l4 at each of the `SPEEDS`; see `short_crank`."""
    return np.array([motion.harmonic(order) for motion in short_crank(inertia_ratio, damper, most)])


@cache
def unlike_oscillator(inertia_ratio: float) -> tuple[float, float]:
    """Compare the motion with that of a damped oscillator under a force that grows with the square of the speed.

    The oscillator has the mean values of M and K, and F0 is the amplitude of the force that gives it the first harmonic of the
    motion. The first result is the range of F0/omega^2 over the speeds, relative to its mean. The second is the greatest ratio
    of the amplitude to the oscillator's amplitude under the mean of F0/omega^2. Each is the greater result of two dampers.
    """
    found, compared = slider_equation(chapter_4(inertia_ratio), 1.0), []
    for damper in (WEAK, STRONG):
        mass = found.mass.mean - found.stiffness.mean
        stiffness = np.abs(SQUARE_OF_OMEGA_K / SPEEDS**2 - mass + 1j * damper / SPEEDS)
        force = harmonic(1, inertia_ratio, damper) * stiffness
        amplitudes = np.array([motion.amplitude for motion in short_crank(inertia_ratio, damper, 2)])
        compared.append((np.ptp(force) / force.mean(), (amplitudes * stiffness).max() / force.mean()))
    spread, ratio = np.max(compared, axis=0).tolist()
    return spread, ratio


def amplitude_ratio(why: str = "") -> Case:
    """Judge the greatest amplitude relative to that of the damped oscillator; see `unlike_oscillator`."""
    greatest = max(unlike_oscillator(i)[1] for i in RESONANT)
    return at_most("amplitude over that of such a system", 1.0 + ABOUT, greatest, why=why)


def speeds_above(level: float, curve: NDArray[np.float64]) -> float:
    """Return the width (rad/s) of the speed range between the first and the last speed at which a curve crosses a level.

    ``curve`` has a value for each of the `SPEEDS`.
    """
    (at,) = np.nonzero((curve[:-1] > level) != (curve[1:] > level))
    passed = SPEEDS[at] + (level - curve[at]) / (curve[at + 1] - curve[at]) * np.diff(SPEEDS)[at]
    return float(np.ptp(passed))


def width(parameters: FiveBarParameters, number: int = 1) -> float:
    """Return the width in lambda_k^2 of the region of instability with the given number, by Hill's determinant."""
    return hill(parameters, number).width


def spacings(run: Trajectory) -> NDArray[np.float64]:
    """Return the crank angles (deg) between successive maxima of the slider position after th2 = 1 rad."""
    angle = run["crank.angle"]
    grid = np.arange(1.0, angle[-1], pi / 720.0)
    u = np.interp(grid, angle, run["slider.position"])
    tops = grid[1:-1][(u[1:-1] > u[:-2]) & (u[1:-1] >= u[2:])]
    return np.degrees(np.diff(tops))


def decay(torque: float, stiffness: float, damping: float) -> float:
    """Return the greatest range of u in the later half of the turns after a launch, relative to that in the earlier half."""
    swing = Turns.of(launch(torque, stiffness, FREE, 6000, damping), start=1.0).slider_range
    half = swing.size // 2
    return float(swing[half:].max() / swing[:half].max())


def collinear_turn(damping: float) -> float:
    """Return the turn at which the links become collinear without a spring, as in Fig 3.2, or NaN.

    The mechanism is Table 3.1 at 420 rpm with a damper (dyn.s/cm).
    """
    angle, period = asin(COLLINEAR_SINE), 60.0 / SPEED
    run = simulate(
        table_3_1(0.0, damping),
        Inputs(speed=SPEED * RAD_S_PER_RPM),
        stop_time=MOST_TURNS * period,
        step=period,
        events=tuple(
            Event(name=str(sign), output="transmission.angle", level=level, direction=sign)
            for level, sign in ((angle, -1), (pi - angle, 1))
        ),
    )
    return run.events[0].time / period if run.events else np.nan


def removed(mechanisms: Iterable[FiveBarParameters]) -> float:
    """Return the damping ratio that removes the first four regions of instability of all given mechanisms.

    It is relative to the critical damping of the mass m4 + m5 on the spring.
    """
    return max(removing_estimate(p, number) for p in mechanisms for number in range(1, 5)) / (2.0 * OMEGA_K)


def of_ellipse(semi_axis: float, harmonics: int) -> float:
    """Return the least area between an ellipse and the coupler curve of path (b)'s links, relative to the ellipse's area.

    ``semi_axis`` is in cm. The rocker pivot moves with the given number of harmonics; with 0 it is fixed.
    """
    p = PROBLEMS["path-b"]
    formula = f"0.20 + {semi_axis / CM_PER_METRE:g}*cos(t)"
    task = UntimedPath(path=path_from_formula(formula, "0.15 + 0.05*sin(t)", n=AREA_N))
    unknown = SliderUnknown(harmonics=harmonics, stroke=0.25)
    error = (
        slider_motion(task, p.linkage, unknown, search=Search(starts=4)).best.error
        if harmonics
        else evaluate(task, p.linkage).error
    )
    return p.convert(error) / (5.0 * pi * semi_axis)


def second_region(inertia_ratio: float) -> tuple[float, float]:
    """Return the width of the second region of instability divided by that of the first: in lambda_k^2, and in speed.

    The second region lies at the natural frequency.
    """
    second, first = (hill(chapter_4(inertia_ratio), number) for number in (2, 1))
    of_speed, of_first = (region.low**-0.5 - region.high**-0.5 for region in (second, first))
    return second.width / first.width, of_speed / of_first


def twice_natural() -> float:
    """Return the speed in the middle of the first region divided by the natural frequency.

    The result is that of the inertia ratio in `RATIOS` for which it is farthest from 2.
    """
    found = [axis(hill(chapter_4(i))) * OMEGA_K / natural_frequency(chapter_4(i)) for i in RATIOS]
    return max(found, key=lambda x: abs(x - 2.0))


def _listed(values: Iterable[float]) -> str:
    *first, last = (f"{value:g}" for value in values)
    return f"{', '.join(first)} and {last}"


def introduction() -> tuple[Statement, ...]:
    """Judge the statements of section 8.0 on the theory."""
    second_width, of_speed = np.min([second_region(i) for i in RATIOS], axis=0)
    removing = {
        "rocker's inertia": removed(map(chapter_4, RATIOS)),
        "crank": removed(map(with_crank, CRANKS)),
        "coupler, angles held": removed(map(held, COUPLERS)),
        "coupler, same ground link": removed(map(closed, COUPLERS)),
    }
    return (
        Statement(
            "The resonance analysis showed a behaviour similar to a second order system while the stability analysis showed "
            "instability in the second region, i. e. in the vicinity of twice the natural frequency only.",
            text("8.0, L6057"),
            f"{OSCILLATOR}, and of I4 = 0.5, 1 and 1.5; speed in the middle of the first region over the natural "
            "frequency with the mean mass, the farthest from 2 of I4 = 0.25 to 2; for *only* as at L7116, width of the region "
            "at the natural frequency over that of the first, in lambda_k^2, the least, without a damper; what is called the "
            f"second region here is the first of chapter V (L3886); {RIGHT}",
            f"{ABOUT:g}, the rule for *similar*, and of 2 the rule for *near*, for *vicinity* too; {SMALL:g}, the rule for "
            "*negligible*, for a region that is not counted",
            (
                at_most("F0/omega^2", ABOUT, max(unlike_oscillator(i)[0] for i in RESONANT)),
                amplitude_ratio("near half the natural frequency the second harmonic has its own resonance, see L7102"),
                near("twice the natural frequency", 2.0, twice_natural(), 2.0 * ABOUT),
                at_most(
                    "region at the natural frequency",
                    SMALL,
                    second_width,
                    why=f"undamped, there is one too; as a range of speed its width is {of_speed:.3f} of the first's",
                ),
            ),
        ),
        Statement(
            "The instability, however, disappeared completely by addition of a small value of damping.",
            text("8.0, L6063"),
            f"omega_c that removes the regions near {REGIONS}, estimated from their widths without a damper, over 2 omega_k, "
            "the critical one of m4 + m5 alone: the most of I4 = 0.25 to 2, of l2/l4 = 0.01 to 0.1 at I4 = 1, and of l3/l4 = "
            "0.8 to 1.2 at I4 = 2 (L3919 to 3927 have I4 = 0 to 1.5 and l2/l4 from 0.001; the greatest decide); "
            f"{RIGHT}",
            f"{SMALL:g}, the rule for *small*",
            tuple(at_most(name, SMALL, share) for name, share in removing.items()),
            "the first region, of which the sentence before speaks, needs the most; beyond the zeroth boundary the slider "
            "falls away with a damper too, see L3952",
        ),
    )


def kinematics() -> tuple[Statement, ...]:
    """Judge the conclusions on synthesis and control."""
    better = reduced_further()
    beaten = [reduced()[n] * printed_error(n) > our_error(n) for n in better]
    ratios = over_least()
    shares = [*(share_of_stated(row.problem) for row in TABLE.values()), *shares_of_stated().values()]
    missed = sorted(share for share in shares if share > 1.0 + ABOUT)
    return (
        Statement(
            "The releasing of some constraints in linkage mechanisms and treating them as inputs that may be controlled "
            "yield versatile and powerful mechanisms.",
            text("9.1, L6993"),
            why="there is no measure of versatile and powerful",
        ),
        Statement(
            "For example the introduction of a second input to a four bar linkage gives a variety of outputs thus making "
            "the linkage a multipurpose mechanism which may be adapted to generate a family of [output] motions.",
            text("9.1, L6997"),
            "area between an ellipse and the curve of the links printed for path (b), mended, over that of the ellipse: three "
            "of a family, the longer semi-axis 10 to 15 cm; five harmonics of the slider and a stroke of at most 25 cm, all "
            "our choices",
            f"{ALIKE:g}, the rule for *the same*, as at Fig 6.9 (L5043)",
            tuple(at_most(name, ALIKE, of_ellipse(axis_cm, 5)) for name, axis_cm in ELLIPSES.items()),
            "with two harmonics, as many as the printed series have (7.3.2), the least that we find for path (a) is "
            f"{of_ellipse(ELLIPSES['path (a), 10 cm'], 2):.2f}, with the pivot fixed it is "
            f"{of_ellipse(ELLIPSES['path (a), 10 cm'], 0):.2f}",
        ),
        Statement(
            "[A] proper control of the slider enabled modifications and more accurate generation of outputs than could "
            "otherwise be obtained.",
            text("9.1, L7012"),
            "error with two harmonics of the slider over that with the pivot fixed: *otherwise* is read as with the same "
            "links, those printed for the eight problems of chapter VI, mended (the packaging machine's by the ten points of "
            "the listing, L9021-9044), and the best that we find for the other seven with the pivot fixed; stroke at most a "
            "fifth of the longest link, our choice",
            SEEN_FALL,
            (
                at_most("printed links, the most of eight", 1.0 - ALIKE, max(reduced().values())),
                at_most("best links, the most of seven", 1.0 - ALIKE, max(better.values())),
            ),
            f"in {sum(beaten)} of the seven problems the best links with the pivot fixed are more accurate than those printed "
            "with the slider; the series that the thesis prints for the rocker function raises the error, see L5935",
        ),
        Statement(
            "However, the control of this second input produced changes that were limited by an envelope dictated by the "
            "linkage kinematics.",
            text("9.1, L7016"),
            "area of path (b) that lies farther from the crank shaft than l2 + r, the reach of its printed links with any "
            "motion of the slider; area between this path and the curve with five harmonics, over the area out of reach",
            "more than 0.01 cm2, above the error of the area; at least 1: what cannot be reached is missed",
            (
                at_least("out of reach", 0.01, out_of_reach(), "cm2"),
                at_least(
                    "area with five harmonics, relative",
                    1.0,
                    linkage_error("path-b", path_motion(5).linkage) / out_of_reach(),
                ),
            ),
        ),
        Statement(
            "Therefore it was logical firstly to find the linkage that would approximately generate the desired output and "
            "then secondly to introduce a second input and control it for more accurate generation.",
            text("9.1, L7020"),
            why="it is a choice; no other order is tried",
        ),
        Statement(
            "As a result an optimisation method was developed, the output of which gave a planar linkage that minimised the "
            "errors involved in function or path generation.",
            text("9.1, L7026"),
            f"error of the {len(ratios)} printed linkages whose error the thesis states, mended where they are misprinted, "
            "over the least that we find within our limits, see the head of chapter VI",
            f"{1.0 + ALIKE:g}, the rule for *the same*",
            tuple(at_most(name, 1.0 + ALIKE, ratio) for name, ratio in ratios.items()),
            f"{sum(ratio > 1.0 + ALIKE for ratio in ratios.values())} of the {len(ratios)} do not have the least error",
        ),
        Statement(
            "The method could be applied to any planar linkage and was implemented as a package of subroutines for general "
            "use.",
            text("9.1, L7030"),
            why="it is applied to four-bars and to one five-bar; any other needs its own equations in the function of the "
            "error (L6030); that it is a package tells what was done (appendix 5)",
        ),
        Statement(
            "The optimisation method was applied to a variety of examples and in most cases produced satisfactory results.",
            text("9.1, L7037"),
            "*satisfactory* is read as: the printed linkage has the error that the thesis accepts. Number of printed linkages "
            f"whose error is at most {1.0 + ABOUT:g} times the stated one, of {len(shares)}: {len(ratios)} of chapter VI and "
            "the two of Figs 7.11 and 7.12 with their series, mended where they are misprinted; for the rocker functions in "
            "the nearest of the readings of Fig 6.7, with the series in the best of Fig 7.11",
            f"more than half, as *most* says; {ABOUT:g}, the rule for *about*",
            (
                at_least("keep their error", 0.5 * len(shares), len(shares) - len(missed)),
                Case(
                    label="the other examples",
                    computed=None,
                    why="for the packaging machine, series 1 of chapter VII and the others of 7.3.2 (L5935) no error is stated",
                ),
            ),
            f"the rest of the {len(shares)} have {missed[0]:.1f} to {missed[-1]:.1f} times the stated error",
        ),
    )


def dynamics() -> tuple[Statement, ...]:
    """Judge the conclusions on the equations of motion and their solutions."""
    soft, stiff = (steady_turn(table_3_1(k), SPEED) for k in (STIFFNESSES[0], STIFFNESSES[-1]))
    torques, angle = np.array([soft.torque, stiff.torque]), soft.angle_deg
    differs = np.ptp(torques, axis=0)[:-1] / np.abs(soft.torque).max()
    seen = apart_on_the_graph(angle / 360.0, *torques / np.ptp(torques))
    over, angle = differs > SMALL, angle[:-1]
    ends = angle[~over & np.roll(over, 1)]
    where = [f"{a:.0f} to {(min((ends - a) % 360.0) + a) % 360.0:.0f}" for a in angle[~over & np.roll(over, -1)]]
    reversal = (angle > angle[soft.torque[:-1].argmax()]) | (angle < ABOUT_DEG)
    steep = seen[:-1][over & reversal].max(initial=0.0)
    names = {(torque, k): f"T0 = {plain(torque)} dyn.cm, k = {plain(k)} dyn/cm" for torque, k in LAUNCHES}
    launches = {name: launch(*which) for which, name in names.items()}
    fastest = [accelerated(*which) for which in LAUNCHES]
    swings = {
        f"{words}; {name}": decay(*which, damping)
        for words, damping in DAMPED.items()
        for which, name in names.items()
        if damping or which not in FOLDING
    }
    steady = {k: steady_turn(table_3_1(k), SPEED) for k in STIFFNESSES}
    starts = [
        np.abs(CM_PER_METRE * from_rest(k)["slider.position"][:360] - of.slider_cm[:-1:4]).max() / np.ptp(of.slider_cm)
        for k, of in steady.items()
    ]
    runs = {step: integrated(step) for step in STEPS}
    return (
        Statement(
            "The multipliers were associated with the pin forces and suitable methods of solution of the equations of "
            "motion were discussed.",
            text("9.1, L7049"),
            "multipliers of (3.1) less the force at pin C and the crank torque by our equations of motion, which have no "
            "multipliers, relative to the greatest; the most of those at Fig 3.1",
            "1e-9, above rounding errors",
            (at_most("multipliers", 1e-9, max(case.computed or 0.0 for case in multipliers())),),
            "that methods were discussed tells what was done; what is said of them is judged at L1334 to 1407",
        ),
        Statement(
            "It was found that, when performing the numerical integrations, it was better if all the derivatives of the "
            "generalised coordinates used in the multipliers method were integrated.",
            text("9.1, L7053"),
            "*better* is read as in 3.1 (L1738 to 1798), where the closure of the loop then shows the error: greatest failure "
            "of closure over the greatest error of u, all derivatives integrated by Hamming's method with a constant step, as "
            "at Fig 3.1 (L1744)",
            "1 to 100, ours as at Fig 3.1: the check shows an error, and no more than a hundred times as large as it is",
            shown_by_closure(),
            "it is better as a check, as which the thesis uses it (L1784-1798), not more accurate: at 420 rpm its error of u "
            f"is {min(run.errors[0] / run.errors[1] for run in runs.values()):.0f} to "
            f"{max(run.errors[0] / run.errors[1] for run in runs.values()):.0f} times that with u alone",
        ),
        Statement(
            "It was found that the spring stiffness had little effect on the torque required to drive the mechanism.",
            text("9.1, L7067"),
            "steady torque with the softest and the stiffest spring, k = 5e5 and 2e6 dyn/cm, 420 rpm: greatest distance "
            "between the curves as it is seen, square to them, as at L1995, but over the whole turn; greatest difference at "
            "the same crank angle, relative to the greatest size of the torque with the softest",
            f"{SMALL:g}, the rule for *small*, as *little effect* says",
            (at_most("as seen", SMALL, seen.max()), at_most("at the same angle", SMALL, differs.max())),
            f"at the same angle it fails in {100.0 * np.mean(over):.0f} % of the turn, from {' and from '.join(where)} deg: at "
            "and after the least torque, and on the reversal, where the curves are steep and lie at most "
            f"{steep:.3f} apart as seen",
        ),
        Statement(
            "It was also found that when the slider was opposed by both spring and viscous damping its motion was a "
            "transient followed by periodic oscillations of period [2 pi] of the crank angle.",
            text("9.1, L7071"),
            "greatest distance of u in the first turn from the steady motion; difference of u from one turn of the crank to "
            "the next after 8 s; both over the range of the steady motion, 420 rpm",
            f"{ALIKE:g}, the rule for *steady*: more for a transient, at most that for periodic oscillations",
            (
                at_least("transient, least of the springs", ALIKE, min(starts)),
                *(
                    at_most(f"periodic; k = {plain(k)} dyn/cm", ALIKE, of.change / np.ptp(of.slider_cm))
                    for k, of in steady.items()
                ),
            ),
            "how long the transient lasts is judged at L1944",
        ),
        Statement(
            "However, when the spring was eliminated the slider moved with periodic oscillations superimposed on a linear "
            "shift in its position thus making the linkage fall into a collinear configuration.",
            text("9.1, L7077"),
            "greatest change of the oscillation about the drift from turn to turn, as at Fig 3.2 (L1907); distance of u from a "
            f"line at the ends of turns 2 to {DRAWN_TURNS}, or of those before the links are collinear, relative to the drift "
            "over them, as at Fig 3.2 (L1911); turns until they are collinear: "
            f"abs(sin(th4 - th3)) < {COLLINEAR_SINE:g}, our choice, as at Fig 3.2",
            f"{ALIKE:g}, the rule for *steady* and *linear*; {MOST_TURNS}, the turns that were run: collinear at all; "
            f"{FEWEST_TURNS} turns, two of the transient and two to compare",
            (
                at_least(
                    f"oscillation and line; mu = {plain(DAMPINGS[0])} dyn.s/cm, turns until collinear",
                    FEWEST_TURNS,
                    drift(DAMPINGS[0]).collinear_turn,
                    "turns",
                    why="the links are collinear in the third turn",
                ),
                *(
                    at_most(f"oscillation; mu = {plain(x)} dyn.s/cm", ALIKE, drift(x).unsteadiest, why="it grows")
                    for x in DAMPINGS[1:]
                ),
                *(
                    at_most(f"line; mu = {plain(x)} dyn.s/cm", ALIKE, drift(x).bend, why="the drift accelerates")
                    for x in DAMPINGS[1:]
                ),
                *(
                    at_most(f"collinear; mu = {plain(x)} dyn.s/cm", MOST_TURNS, collinear_turn(x), "turns")
                    for x in DAMPINGS
                ),
            ),
            "over 5 turns one line more is straight, over 20 one less, see L1911",
        ),
        Statement(
            "For a forced input (torsion bar input applied to the crank) it was found that the linkage accelerated until "
            "the input torque became smaller than the load offered by the linkage after which the slider executed periodic "
            "oscillations in [2 pi] of the crank angle.",
            text("9.1, L7083"),
            "crank angle of the greatest speed while the torque acts, up to which the speed only rises, in the launches of "
            "Figs 3.6 and 3.9; crank angle between the first two maxima of the slider after the torque, and between the last "
            "three of 1 s (ours), mean",
            f"below 1 rad, where the torque ends; {ABOUT_DEG:g} deg, the rule for *about*, as the oscillations decay",
            (
                at_most(
                    "crank angle of the greatest speed, the most",
                    1.0,
                    max(run_peak(run).angle for run in fastest),
                    "rad",
                ),
                *(
                    near(
                        f"{when}; {name}",
                        360.0,
                        spacings(run)[part].mean(),
                        ABOUT_DEG,
                        "deg",
                        why="a transient comes first",
                    )
                    for when, part in (("first maxima", slice(1)), ("last maxima", slice(-2, None)))
                    for name, run in launches.items()
                ),
            ),
        ),
        Statement(
            "The oscillations, however, decayed due to the viscous dissipation of energy in the slider guide.",
            text("9.1, L7092"),
            "range of u over a turn after the launches of Figs 3.8 and 3.10: the greatest in the second half of the turns "
            f"within {FREE:g} s (ours, ten turns of the slowest) over the greatest in the first; without the damper the links "
            "are collinear after four turns with 2e8 dyn.cm, and after five with k = 5e5 dyn/cm and 1e8",
            f"with the damper {SEEN_FALL}; without it at least that",
            tuple(
                (at_most if "with the" in name else at_least)(name, 1.0 - ALIKE, ratio)
                for name, ratio in swings.items()
            ),
        ),
    )


def linearised() -> tuple[Statement, ...]:
    """Judge the conclusions on the linear equation and its stability."""
    each = [(i, damper) for i in RESONANT for damper in (WEAK, STRONG)]
    first, second = ({which: harmonic(n, *which) for which in each} for n in (1, 2))
    five = {which: [harmonic(n, *which, 5) for n in range(1, 6)] for which in each}
    second_share = {which: (second[which] / first[which]).max() for which in each}
    higher_share = {which: (higher / one).max() for which, (one, _, *higher) in five.items()}
    strong = [(i, STRONG) for i in RESONANT]
    speeds = np.array([resonance(chapter_4(i))[0] for i in RATIOS])
    bend = np.abs(speeds - np.polyval(np.polyfit(RATIOS, speeds, 1), RATIOS)).max() / np.ptp(speeds)
    # by damper, then by inertia
    curves = [[first[i, damper] for i in RESONANT] for damper in (WEAK, STRONG)]
    tops = np.array([[of.max() for of in row] for row in curves])
    wide = np.array([[speeds_above(LARGE, of) for of in row] for row in curves])
    half = [speeds_above(0.5 * of.max(), of) for of in curves[-1]]
    by_crank = [width(with_crank(s)) for s in CRANKS]
    by_coupler = [width(closed(s)) for s in COUPLERS]
    by_inertia = [width(chapter_4(i)) for i in RATIOS]
    second_width, of_speed = np.min([second_region(i) for i in RATIOS], axis=0)
    narrow = max(2.0 * width(p) / (hill(p).low + hill(p).high) for p in map(chapter_4, RATIOS))
    return (
        Statement(
            "Results for a short crank showed similarity to a damped second order linear system behaviour.",
            text("9.1, L7102"),
            f"{OSCILLATOR}; {RIGHT}",
            f"{ABOUT:g}, the rule for *similar*",
            (
                *(at_most(f"F0/omega^2; I4 = {i:g}", ABOUT, unlike_oscillator(i)[0]) for i in RESONANT),
                amplitude_ratio(),
            ),
            "near half the natural frequency the second harmonic, judged next, has its own resonance",
        ),
        Statement(
            "The major harmonic in the solution was the first harmonic; the remaining ones were almost negligible.",
            text("9.1, L7104"),
            f"second harmonic over the first, and greatest of the third to fifth over it, by five harmonics; the most of I4 = "
            f"0.5, 1 and 1.5 and of {DAMPERS_WORDS}: greatest over greatest, and at the same speed, {SPEEDS_WORDS}; {RIGHT}",
            f"{SMALL:g}, the rule for *negligible*",
            (
                at_most("second, greatest over greatest", SMALL, max(second[x].max() / first[x].max() for x in each)),
                at_most(
                    "second, at the same speed",
                    SMALL,
                    max(second_share.values()),
                    why="near half the natural frequency the second is the greater one, with the strongest damper "
                    f"{min(second_share[x] for x in strong):.1f} times the first",
                ),
                at_most(
                    "third to fifth, greatest over greatest",
                    SMALL,
                    max(np.max(higher) / one.max() for one, _, *higher in five.values()),
                ),
                at_most(
                    "third to fifth, at the same speed",
                    SMALL,
                    max(higher_share.values()),
                    why="near a third of the natural frequency the third is the greater one, with the strongest damper "
                    f"{min(higher_share[x] for x in strong):.1f} of the first",
                ),
            ),
            "(4.30) has no higher ones than the second",
        ),
        Statement(
            "It was found that the increase in the rocker inertia decreased the natural frequency linearly, increased the "
            "amplitude of vibrations and widened the region of resonance.",
            text("9.1, L7110"),
            "distance of the resonant speeds without a damper for I4 = 0.25 to 2 from a line, relative to their range, and "
            "their greatest growth; the least growth, from I4 = 0.5 to 1 and 1.5, of the greatest amplitude and of the range "
            f"of speeds with u/l4 above {LARGE:g} (our choice, below every peak), with {DAMPERS_WORDS}; "
            f"speeds in steps of 0.05 rad/s; {RIGHT}",
            f"{ALIKE:g}, the rule for *linear*; {SIGN}",
            (
                at_most("distance from a line", ALIKE, bend),
                at_most("growth of the resonant speed", 0.0, np.diff(speeds).max(), "rad/s"),
                at_least("growth of the amplitude u/l4", 0.0, np.diff(tops).min()),
                at_least("growth of the range", 0.0, np.diff(wide).min(), "rad/s"),
            ),
            "relative to its peak the resonance does not widen: from I4 = 0.5 to 1.5 the range above half of it goes from "
            f"{half[0]:.2f} to {half[-1]:.2f} rad/s with the strongest damper",
        ),
        Statement(
            "The stability analysis showed a narrow region of instability in the [vicinity of w = 2wn] only, where [wn is "
            "the] natural frequency.",
            text("9.1, L7116"),
            "width of the first region in lambda_k^2 relative to its middle, the most of I4 = 0.25 to 2; speed in its middle "
            "over the natural frequency with the mean mass, the farthest from 2; for *only*, width of the region at the "
            "natural frequency itself over that of the first, in lambda_k^2, the least; without a damper, "
            f"{RIGHT}; the regions at lower speeds, and the slider's fall beyond the zeroth boundary (erratum 7), are not "
            "counted",
            f"{SMALL:g}, the rule for *small*, for *narrow* too; {ABOUT:g} of 2, the rule for *near*, for *vicinity* too",
            (
                at_most("first region", SMALL, narrow),
                near("twice the natural frequency", 2.0, twice_natural(), 2.0 * ABOUT),
                at_most(
                    "region at the natural frequency",
                    SMALL,
                    second_width,
                    why=f"undamped, there is one too; as a range of speed its width is {of_speed:.3f} of the first's",
                ),
            ),
        ),
        Statement(
            "Instability of the slider motion was shown to increase with increase of crank length, decrease of coupler "
            "length and increase of output inertia.",
            text("9.1, L7120"),
            "*instability* is read as the width of the first region in lambda_k^2, which Figs 5.1 to 5.3 show: its least "
            f"growth from one to the next of l2/l4 = {_listed(CRANKS)} at I4 = 1, of l3/l4 = {_listed(COUPLERS[::-1])} at I4 = "
            f"2, on the same ground link and with the angles held as in Fig 5.3, and of I4 = {_listed(RATIOS)}; without a "
            f"damper, {RIGHT}",
            SIGN,
            (
                at_least("longer crank", 0.0, np.diff(by_crank).min()),
                at_least("shorter coupler, same ground link, 1 to 0.8", 0.0, -np.diff(by_coupler[:3]).max()),
                at_least(
                    "shorter coupler, same ground link, 1.2 to 1",
                    0.0,
                    -np.diff(by_coupler[2:]).max(),
                    why="on the same ground link the region is narrowest where coupler and rocker are about equal",
                ),
                at_least("shorter coupler, angles held", 0.0, -np.diff([width(held(s)) for s in COUPLERS]).max()),
                at_least("larger inertia", 0.0, np.diff(by_inertia).min()),
            ),
        ),
    )


def experiment() -> tuple[Statement, ...]:
    """Judge the conclusions on the experiment."""
    turns = {(s, w): turn(s, w) for s in "CD" for w in RANGE}
    error = max(abs(length(s) * linear_motion(s, w).amplitude / amplitude(of) - 1.0) for (s, w), of in turns.items())
    return (
        Statement(
            "It was found that good agreement existed between the two in both phase and amplitude [of the numerical solutions "
            "of chapter III and the experiments on rig 1].",
            text("9.1, L7134"),
            why=LOST,
        ),
        Statement(
            "The assumptions were found to be reasonable and good agreement between theory and experiment was found in the "
            "resonance behaviour.",
            text("9.1, L7145"),
            "two assumptions of chapter IV: error of the amplitude by its linear equation, corrected, relative to that by the "
            "full equations; greatest of the harmonics 3 to 6, which are ignored (L6788), over the greater of the first two; "
            "the most of springs C and D, 300 to 1000 rpm (L6812) in tens",
            f"{SMALL:g}, the rule for *negligible*",
            (
                at_most("error of the linear equation", SMALL, error),
                at_most("third and higher harmonics", SMALL, max(map(overtones, turns.values()))),
                Case(label="agreement with the experiment", computed=None, why=LOST),
            ),
        ),
    )


def compute() -> StudyResult:
    """Judge the sentences of sections 8.0 and 9.1 that make a claim."""
    return StudyResult(
        number=NUMBER,
        claim="What the introduction to the experiments says of the theory (8.0), and what the thesis concludes (9.1).",
        assignment=(
            "Sentences that only tell what was done claim nothing and have no verdict: L6045 to 6053, 6067 to 6096, 7005, "
            "7034, 7041, 7045, 7061, 7065, 7096, 7108, 7128, 7130, 7136, 7140."
        ),
        statements=(*introduction(), *kinematics(), *dynamics(), *linearised(), *experiment()),
    )


#: The study by its name.
STUDIES = {NUMBER: Study(NUMBER, compute)}
