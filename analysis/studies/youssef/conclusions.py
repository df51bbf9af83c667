"""Verdicts on the conclusions of the thesis: each sentence of sections 8.0 and 9.1 that claims something.

Most of these sentences sum up statements that are judged in their chapters; here each is measured again as a whole.
"""

from __future__ import annotations

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
from ...synthesis import Search, SliderUnknown, evaluate
from ...units import RAD_S_PER_RPM
from ...youssef import HarmonicMotion, harmonic_balance, resonance, slider_equation
from ..rules import ABOUT, ABOUT_DEG, ALIKE, SEEN_FALL, SMALL
from ..statements import Case, Statement, at_least, at_most, near, text
from ..study import Study, StudyResult
from .chapter_3 import COLLINEAR_SINE, DAMPINGS, DRAWN_TURNS, apart_on_the_graph, drift
from .chapter_5 import closed, held
from .chapter_6 import TABLE, our_error, over_least, printed_error, share_of_stated
from .formulation import STEPS, integrated, multipliers
from .free_crank import TORQUES, Turns, accelerated, launch
from .linearised import with_crank
from .problems import PROBLEMS
from .regions import axis, hill, removing_estimate
from .rig_2 import RANGE, length, linear_motion
from .rigs import LOST, amplitude, dynamic_stiffness, overtones, turn
from .runs import SPEED, STIFFNESSES, plain, steady_turn, table_3_1
from .series_2 import error_of, out_of_reach, path_motion, reduced, reduced_further, shares_of_stated

NUMBER = "conclusions"
OMEGA_K = sqrt(SQUARE_OF_OMEGA_K)
#: Inertia ratios of chapters IV and V, dampers (1/s) and speeds (rad/s) of its resonance curves.
RATIOS, DAMPER, SPEEDS = (0.25, 0.5, 1.0, 1.5, 2.0), 0.45, np.arange(10.0, 45.0, 0.05)
#: Lengths of crank and coupler relative to the rocker's, in the ranges of Fig 5.2 and 5.3.
CRANKS, COUPLERS = (0.01, 0.03, 0.05, 0.07, 0.1), (0.8, 0.9, 1.0, 1.1, 1.2)
#: Amplitude u/l4 above which a speed counts as resonant.
LARGE = 0.1
#: Words for the equation behind the numbers of chapters IV and V, and for the speeds.
RIGHT = "by the right linear equation"
SPEEDS_WORDS = "10 to 45 rad/s (our choice: a third to nearly one and a half of omega_k = 31.6 rad/s)"
#: The damper of a launch (dyn.s/cm), and how long its free motion is followed (s): ten turns of the slowest.
DAMPED, FREE = {"with the damper": 3e4, "without": 0.0}, 3.0
#: Turns that are run at most without a spring.
MOST_TURNS = 80
SIGN = "none, the sign decides"


@cache
def short_crank(inertia_ratio: float, most: int) -> tuple[HarmonicMotion, ...]:
    """Return the motions u/l4 of chapter IV's mechanism at the `SPEEDS`, with the harmonics up to ``most``."""
    found = slider_equation(chapter_4(inertia_ratio), 1.0)
    return tuple(
        harmonic_balance(replace(found, spring=SQUARE_OF_OMEGA_K / w**2, damping=DAMPER / w), most)
        for w in SPEEDS.tolist()
    )


def harmonic(order: int, inertia_ratio: float, most: int = 2) -> NDArray[np.float64]:
    """Return the amplitude of a harmonic of u/l4 at the `SPEEDS`; see `short_crank`."""
    return np.array([motion.harmonic(order) for motion in short_crank(inertia_ratio, most)])


def unlike_oscillator(inertia_ratio: float) -> float:
    """Return the relative spread of F0/omega^2, F0 the force on a damped oscillator that gives the first harmonic."""
    force = harmonic(1, inertia_ratio) * dynamic_stiffness(chapter_4(inertia_ratio, DAMPER), SPEEDS) / SPEEDS**2
    return float(np.ptp(force) / force.mean())


def width(parameters: FiveBarParameters, number: int = 1) -> float:
    """Return the width of a region of instability in lambda_k^2."""
    return hill(parameters, number).width


def spacings(run: Trajectory) -> NDArray[np.float64]:
    """Return the crank angles (deg) between successive maxima of the slider position after th2 = 1 rad."""
    angle = run["crank.angle"]
    grid = np.arange(1.0, angle[-1], pi / 720.0)
    u = np.interp(grid, angle, run["slider.position"])
    tops = grid[1:-1][(u[1:-1] > u[:-2]) & (u[1:-1] >= u[2:])]
    return np.degrees(np.diff(tops))


def decay(torque: float, damping: float) -> float:
    """Return the median range of u in the last five turns after a launch, divided by that in the first five."""
    swing = Turns.of(launch(torque, stop_time=FREE, samples=6000, damping=damping), start=1.0).slider_range
    return float(np.median(swing[-5:]) / np.median(swing[:5]))


def collinear_turn(damping: float) -> float:
    """Return the turn at which the links of Table 3.1 are collinear at 420 rpm without a spring, as in Fig 3.2, or NaN."""
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


def twice_natural() -> float:
    """Return the ratio of the speed in the middle of the first region to the natural frequency, farthest from 2 of `RATIOS`."""
    found = [axis(hill(chapter_4(i))) * OMEGA_K / natural_frequency(chapter_4(i)) for i in RATIOS]
    return max(found, key=lambda x: abs(x - 2.0))


def introduction() -> tuple[Statement, ...]:
    """Judge the statements of section 8.0 on the theory."""
    second = max(width(chapter_4(i), 2) / width(chapter_4(i)) for i in RATIOS)
    pairs = [[hill(chapter_4(i), number) for number in (2, 1)] for i in RATIOS]
    of_speed = max(np.divide(*(of.low**-0.5 - of.high**-0.5 for of in pair)) for pair in pairs)
    removing = {
        "near twice the natural frequency; I4": max(removing_estimate(chapter_4(i)) for i in RATIOS),
        "at the natural frequency; I4": max(removing_estimate(chapter_4(i), 2) for i in RATIOS),
        "near twice the natural frequency; crank": max(removing_estimate(with_crank(s)) for s in CRANKS),
        "near twice the natural frequency; coupler, angles held": max(removing_estimate(held(s)) for s in COUPLERS),
        "near twice the natural frequency; coupler, same ground link": max(
            removing_estimate(closed(s)) for s in COUPLERS
        ),
    }
    return (
        Statement(
            "The resonance analysis showed a behaviour similar to a second order system while the stability analysis showed "
            "instability in the second region, i. e. in the vicinity of twice the natural frequency only.",
            text("8.0, L6057"),
            "spread, relative to its mean, of F0/omega^2, F0 the force on a damped mass-spring system that gives the "
            f"first harmonic, {SPEEDS_WORDS}, I4 = 1, omega_c = {DAMPER:g} 1/s (L3921); speed in the middle of the "
            "first region over the natural frequency, the farthest from 2 of I4 = 0.25 to 2; width of the region at "
            "the natural frequency over that of the first, in lambda_k^2, the most, without a damper; what is called the "
            f"second region here is the first of chapter V (L3886); {RIGHT}",
            f"{ABOUT:g}, the rule for *similar*, and of 2 the rule for *near*, for *vicinity* too; {SMALL:g}, for *negligible*",
            (
                at_most("unlike a second order system", ABOUT, unlike_oscillator(1.0)),
                near("twice the natural frequency", 2.0, twice_natural(), 2.0 * ABOUT),
                at_most(
                    "another region",
                    SMALL,
                    second,
                    why="undamped, there is another at the natural frequency itself; as a range of speed the quotient is "
                    f"{of_speed:.3f}",
                ),
            ),
        ),
        Statement(
            "The instability, however, disappeared completely by addition of a small value of damping.",
            text("8.0, L6063"),
            "damping that removes a region, estimated from its width without a damper, over 2 omega_k, the critical one of "
            "m4 + m5 alone, the most of I4 = 0.25 to 2, of l2/l4 = 0.01 to 0.1, and of l3/l4 = 0.8 to 1.2, ours (L3917 to "
            f"3929 have I4 up to 1.5 and l2/l4 from 0.001; the greatest decide); {RIGHT}",
            f"{SMALL:g}, the rule for *small*",
            tuple(at_most(name, SMALL, damping / (2.0 * OMEGA_K)) for name, damping in removing.items()),
            "*the instability* is that of the sentence before, near twice the natural frequency; beyond the zeroth boundary "
            "the slider falls away with any damper, see L3952",
        ),
    )


def kinematics() -> tuple[Statement, ...]:
    """Judge the conclusions on synthesis and control."""
    a, b = PROBLEMS["path-a"], PROBLEMS["path-b"]
    still = a.convert(evaluate(a.task, b.linkage).error)
    fewer, other = (
        slider_motion(a.task, b.linkage, SliderUnknown(harmonics=n, stroke=0.25), search=Search(starts=4)).best
        for n in (2, 5)
    )
    ellipse = 50.0 * pi  # of semi-axes 10 and 5 cm
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
            "area between path (a) and the curve of the links printed for path (b), with five harmonics of the slider and a "
            "stroke of at most 25 cm, our choices, over that of its ellipse",
            f"{ALIKE:g}, the rule for *the same*, as at Fig 6.9 (L5043)",
            (at_most("path (a) by the links for path (b)", ALIKE, a.convert(other.error) / ellipse),),
            f"with two harmonics, as many as the printed series have (7.3.2), it is {a.convert(fewer.error) / ellipse:.2f}, "
            f"with the pivot fixed {still / ellipse:.2f}",
        ),
        Statement(
            "[A] proper control of the slider enabled modifications and more accurate generation of outputs than could "
            "otherwise be obtained.",
            text("9.1, L7012"),
            "error with two harmonics of the slider over that with the pivot fixed: *otherwise* is read as with the same "
            "links, those printed for the problems of chapter VI and the best that we find with the pivot fixed; stroke at "
            "most a fifth of the longest link, our choice",
            SEEN_FALL,
            (
                at_most("printed links, greatest of eight problems", 1.0 - ALIKE, max(reduced().values())),
                at_most("best links, greatest of seven problems", 1.0 - ALIKE, max(better.values())),
            ),
            f"in {sum(beaten)} of the seven problems the best links with the pivot fixed are more accurate than those printed "
            "with the slider",
        ),
        Statement(
            "However, the control of this second input produced changes that were limited by an envelope dictated by the "
            "linkage kinematics.",
            text("9.1, L7016"),
            "area of path (b) that lies farther from the crank shaft than the links reach; area between it and the curve "
            "with five harmonics, over it",
            "more than 0.01 cm2, above the error of the area; at least 1: what cannot be reached is missed",
            (
                at_least("out of reach", 0.01, out_of_reach(), "cm2"),
                at_least(
                    "area with five harmonics over it", 1.0, error_of("path-b", path_motion(5).linkage) / out_of_reach()
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
            "over the least that we find with no longer link",
            f"{1.0 + ALIKE:g}, the rule for *the same*",
            tuple(at_most(name, 1.0 + ALIKE, ratio) for name, ratio in ratios.items()),
            f"{sum(ratio > 1.0 + ALIKE for ratio in ratios.values())} of the {len(ratios)} do not have the least error",
        ),
        Statement(
            "The method could be applied to any planar linkage and was implemented as a package of subroutines for general "
            "use.",
            text("9.1, L7030"),
            why="it is applied to four-bars and to one five-bar; any other needs other equations in its function (L6030); that "
            "it is a package tells what was done (appendix 5)",
        ),
        Statement(
            "The optimisation method was applied to a variety of examples and in most cases produced satisfactory results.",
            text("9.1, L7037"),
            "*satisfactory* is read as: the printed linkage has the error that the thesis accepts. Printed linkages, of "
            f"{len(shares)}, {len(ratios)} of chapter VI and the two of Figs 7.11 and 7.12 with their series, mended where "
            f"they are misprinted, whose error is at most {1.0 + ABOUT:g} times the stated one; for the rocker functions in "
            "the nearest of the readings of Fig 6.7, with the series in the best of Fig 7.11; for the packaging machine and "
            "for series 1 of chapter VII no error is stated",
            f"more than half, as *most* says; {ABOUT:g}, the rule for *about*",
            (at_least("keep their error", 0.5 * len(shares), len(shares) - len(missed)),),
            f"the others have {missed[0]:.1f} to {missed[-1]:.1f} times the stated error",
        ),
    )


def dynamics() -> tuple[Statement, ...]:
    """Judge the conclusions on the equations of motion and their solutions."""
    soft, stiff = (steady_turn(table_3_1(k), 420.0) for k in (STIFFNESSES[0], STIFFNESSES[-1]))
    torques, angle = np.array([soft.torque, stiff.torque]), soft.angle_deg
    differs = np.ptp(torques, axis=0)[:-1] / np.abs(soft.torque).max()
    seen = apart_on_the_graph(angle / 360.0, *torques / np.ptp(torques))
    over, angle = differs > SMALL, angle[:-1]
    ends = angle[~over & np.roll(over, 1)]
    where = [f"{a:.0f} to {(min((ends - a) % 360.0) + a) % 360.0:.0f}" for a in angle[~over & np.roll(over, -1)]]
    reversal = (angle > angle[soft.torque[:-1].argmax()]) | (angle < ABOUT_DEG)
    steep = seen[:-1][over & reversal].max(initial=0.0)
    launches = {f"T0 = {plain(torque)} dyn.cm": launch(torque) for torque in TORQUES}
    fastest = {f"T0 = {plain(torque)} dyn.cm": accelerated(torque) for torque in TORQUES}
    swings = {
        f"{words}; T0 = {plain(torque)} dyn.cm": decay(torque, damping)
        for words, damping in DAMPED.items()
        for torque in TORQUES
        if damping or torque < TORQUES[-1]
    }
    runs = {step: integrated(step) for step in STEPS}
    return (
        Statement(
            "The multipliers were associated with the pin forces and suitable methods of solution of the equations of "
            "motion were discussed.",
            text("9.1, L7049"),
            "multipliers of (3.1) less the plant's force of the rocker on the coupler and its torque, relative to the "
            "greatest, the most of Fig 3.1",
            "1e-9, above rounding errors",
            (at_most("multipliers", 1e-9, max(case.computed or 0.0 for case in multipliers())),),
            "that methods were discussed tells what was done; Hamming's and Milne's are judged at L1379 and L1407",
        ),
        Statement(
            "It was found that, when performing the numerical integrations, it was better if all the derivatives of the "
            "generalised coordinates used in the multipliers method were integrated.",
            text("9.1, L7053"),
            "*better* since the closure of the loop then shows the error (3.1, L1738 to 1798): greatest failure of closure "
            "over the greatest error of u, all of them integrated by Hamming's method with a constant step, as in Fig 3.1",
            "1 to 100, ours as in Fig 3.1: the check shows an error, and no more than a hundred times as large as it is",
            tuple(
                Case(label=f"step {1e3 * step:g} ms", computed=run.gap.max() / run.errors[0], lower=1.0, upper=100.0)
                for step, run in runs.items()
            ),
            "as a check, for its own results are by the other approach (L1790-1796): it is not more accurate, its "
            f"error of u being {min(run.errors[0] / run.errors[1] for run in runs.values()):.0f} to "
            f"{max(run.errors[0] / run.errors[1] for run in runs.values()):.0f} times that with u alone",
        ),
        Statement(
            "It was found that the spring stiffness had little effect on the torque required to drive the mechanism.",
            text("9.1, L7067"),
            "steady torque with k = 5e5 and 2e6 dyn/cm, Table 3.1, 420 rpm: greatest distance between the curves as it is "
            "seen, square to them, as at L1995, but over the whole turn; greatest difference at the same crank angle, relative "
            "to the peak",
            f"{SMALL:g}, the rule for *small*, as *little effect* says",
            (at_most("as seen", SMALL, seen.max()), at_most("at the same angle", SMALL, differs.max())),
            f"by the angle it fails in {np.mean(over):.0%} of the turn, from {' and from '.join(where)} deg: at and after the "
            f"least torque, and on the reversal, where the curves are steep and lie at most {steep:.3f} apart as seen",
        ),
        Statement(
            "It was also found that when the slider was opposed by both spring and viscous damping its motion was a "
            "transient followed by periodic oscillations of period [2 pi] of the crank angle.",
            text("9.1, L7071"),
            "difference of u from one turn of the crank to the next after 8 s, 420 rpm",
            f"{ALIKE:g} of its range, the rule for *steady*",
            tuple(
                at_most(f"k = {plain(k)} dyn/cm", ALIKE, turn.change / np.ptp(turn.slider_cm))
                for k, turn in ((k, steady_turn(table_3_1(k), 420.0)) for k in STIFFNESSES)
            ),
            "the transient is judged at L1944",
        ),
        Statement(
            "However, when the spring was eliminated the slider moved with periodic oscillations superimposed on a linear "
            "shift in its position thus making the linkage fall into a collinear configuration.",
            text("9.1, L7077"),
            "change of the oscillation about the drift from turn to turn, as at Fig 3.2 (L1907); distance of u from a line at "
            f"the ends of turns 2 to {DRAWN_TURNS}, or of those before the links are collinear, relative to the drift over "
            "them, as at Fig 3.2 (L1911); turns until they are collinear: "
            f"abs(sin(th4 - th3)) < {COLLINEAR_SINE:g}, our choice, as at Fig 3.2",
            f"{ALIKE:g}, the rule for *steady* and *linear*; {MOST_TURNS}, the turns that were run: collinear at all",
            (
                *(
                    at_most(f"oscillation; mu = {plain(x)} dyn.s/cm", ALIKE, drift(x).unsteadiness(3), why="it grows")
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
            "with and without the transient of two turns the verdicts are the same; with the weakest damper the links are "
            "collinear in the turn after it",
        ),
        Statement(
            "For a forced input (torsion bar input applied to the crank) it was found that the linkage accelerated until "
            "the input torque became smaller than the load offered by the linkage after which the slider executed periodic "
            "oscillations in [2 pi] of the crank angle.",
            text("9.1, L7083"),
            "crank angle of the greatest speed while the torque acts, runs of Fig 3.6; crank angle between the first two "
            "maxima of the slider after the torque, and between the last three, mean",
            f"below 1 rad, where the torque ends; {ABOUT_DEG:g} deg, the rule for *about*, as the oscillations decay",
            (
                *(
                    at_most(f"greatest speed; {name}", 1.0, run["crank.angle"][run["crank.speed"].argmax()], "rad")
                    for name, run in fastest.items()
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
            f"range of u over a turn after the launches of Fig 3.8, median of the last five turns over that of the first five "
            f"within {FREE:g} s, ten turns of the slowest; without the damper the links are collinear after four turns with "
            "2e8 dyn.cm",
            f"with the damper {SEEN_FALL}; above it without",
            tuple(
                (at_most if "with the" in name else at_least)(name, 1.0 - ALIKE, ratio)
                for name, ratio in swings.items()
            ),
        ),
    )


def linearised() -> tuple[Statement, ...]:
    """Judge the conclusions on the linear equation and its stability."""
    ratios = (0.5, 1.0, 1.5)
    first, second = ({i: harmonic(n, i) for i in ratios} for n in (1, 2))
    five = {i: [harmonic(n, i, 5) for n in range(1, 6)] for i in ratios}
    speeds = np.array([resonance(chapter_4(i))[0] for i in RATIOS])
    bend = np.abs(speeds - np.polyval(np.polyfit(RATIOS, speeds, 1), RATIOS)).max() / np.ptp(speeds)
    tops = np.array([first[i].max() for i in ratios])
    wide = np.array([np.count_nonzero(first[i] > LARGE) for i in ratios])
    by_crank = [width(with_crank(s)) for s in CRANKS]
    by_coupler = [width(closed(s)) for s in COUPLERS]
    by_inertia = [width(chapter_4(i)) for i in RATIOS]
    narrow = max(width(chapter_4(i)) / hill(chapter_4(i)).low for i in RATIOS)
    return (
        Statement(
            "Results for a short crank showed similarity to a damped second order linear system behaviour.",
            text("9.1, L7102"),
            "spread, relative to its mean, of F0/omega^2, F0 the force on a damped mass-spring system that gives the first "
            "harmonic, "
            f"{SPEEDS_WORDS}, omega_c = {DAMPER:g} 1/s (L3921); {RIGHT}",
            f"{ABOUT:g}, the rule for *similar*",
            tuple(at_most(f"I4 = {i:g}", ABOUT, unlike_oscillator(i)) for i in ratios),
            "of the first harmonic; the second, judged next, has a peak of its own at half the natural frequency",
        ),
        Statement(
            "The major harmonic in the solution was the first harmonic; the remaining ones were almost negligible.",
            text("9.1, L7104"),
            f"second harmonic over the first, and greatest of the third to fifth over it, by five harmonics; omega_c = "
            f"{DAMPER:g} 1/s (L3921), the most of I4 = 0.5, 1, 1.5: greatest over greatest, and at the same speed, "
            f"{SPEEDS_WORDS}; {RIGHT}",
            f"{SMALL:g}, the rule for *negligible*",
            (
                at_most("second, greatest over greatest", SMALL, max(second[i].max() / first[i].max() for i in ratios)),
                at_most(
                    "second, at the same speed",
                    SMALL,
                    max((second[i] / first[i]).max() for i in ratios),
                    why="near half the natural frequency the second is the greater one",
                ),
                at_most(
                    "third to fifth, greatest over greatest",
                    SMALL,
                    max(np.max(higher) / one.max() for one, _, *higher in five.values()),
                ),
                at_most(
                    "third to fifth, at the same speed",
                    SMALL,
                    max((higher / one).max() for one, _, *higher in five.values()),
                    why="near a third of the natural frequency the third is more than half as large",
                ),
            ),
            "(4.30) has no higher ones than the second",
        ),
        Statement(
            "It was found that the increase in the rocker inertia decreased the natural frequency linearly, increased the "
            "amplitude of vibrations and widened the region of resonance.",
            text("9.1, L7110"),
            "distance of the resonant speeds without a damper for I4 = 0.25 to 2 from a line, relative to their range, and "
            f"their greatest growth; with omega_c = {DAMPER:g} 1/s (L3921) the least growth, from I4 = 0.5 to 1 and 1.5, of "
            f"the greatest amplitude and of the range of speeds with u/l4 above {LARGE:g} (our choice, as at Fig 4.3); {RIGHT}",
            f"{ALIKE:g}, the rule for *linear*; {SIGN}",
            (
                at_most("distance from a line", ALIKE, bend),
                at_most("growth of the resonant speed", 0.0, np.diff(speeds).max(), "rad/s"),
                at_least("growth of the amplitude", 0.0, np.diff(tops).min()),
                at_least("growth of the range", 0.0, 0.05 * np.diff(wide).min(), "rad/s"),
            ),
            "above half of its own peak the range is "
            + ", ".join(f"{0.05 * np.count_nonzero(first[i] > 0.5 * first[i].max()):.2f}" for i in ratios)
            + " rad/s: relative to this the resonance does not widen",
        ),
        Statement(
            "The stability analysis showed a narrow region of instability in the [vicinity of w = 2wn] only ...",
            text("9.1, L7116"),
            "width of the first region in lambda_k^2 relative to its lower end, the most of I4 = 0.25 to 2; speed in "
            "its middle over the natural frequency, the farthest from 2; width of the region at the natural "
            f"frequency itself over it, the least; without a damper, {RIGHT}",
            f"{SMALL:g}, the rule for *small*, for *narrow* too; {ABOUT:g} of 2, the rule for *near*, for *vicinity* too",
            (
                at_most("first region", SMALL, narrow),
                near("twice the natural frequency", 2.0, twice_natural(), 2.0 * ABOUT),
                at_most(
                    "region at the natural frequency",
                    SMALL,
                    min(width(chapter_4(i), 2) / width(chapter_4(i)) for i in RATIOS),
                    why="without a damper it is there too, nearly half as wide in lambda_k^2",
                ),
            ),
        ),
        Statement(
            "Instability of the slider motion was shown to increase with increase of crank length, decrease of coupler "
            "length and increase of output inertia.",
            text("9.1, L7120"),
            "least growth of the width of the first region in lambda_k^2 from one to the next of l2/l4 = 0.01 to "
            "0.1, I4 = 1; l3/l4 = 1 to 0.8 and 1.2 to 1 with the same ground link, 1.2 to 0.8 with the angles held "
            f"as in Fig 5.3, I4 = 2; I4 = 0.25 to 2; {RIGHT}",
            SIGN,
            (
                at_least("longer crank", 0.0, np.diff(by_crank).min()),
                at_least("shorter coupler, below 1", 0.0, -np.diff(by_coupler[:3]).max()),
                at_least(
                    "shorter coupler, above 1",
                    0.0,
                    -np.diff(by_coupler[2:]).max(),
                    why="on the same ground link the region is narrowest where coupler and rocker are equal",
                ),
                at_least("shorter coupler, angles held", 0.0, -np.diff([width(held(s)) for s in COUPLERS]).max()),
                at_least("larger inertia", 0.0, np.diff(by_inertia).min()),
            ),
        ),
    )


def experiment() -> tuple[Statement, ...]:
    """Judge the conclusions on the experiment."""
    turns = {(s, w): turn(s, w) for s in "CD" for w in RANGE[::5]}
    error = max(abs(length(s) * linear_motion(s, w).amplitude / amplitude(of) - 1.0) for (s, w), of in turns.items())
    return (
        Statement(
            "It was found that good agreement existed between the two in both phase and amplitude.",
            text("9.1, L7134"),
            why=LOST,
        ),
        Statement(
            "The assumptions were found to be reasonable and good agreement between theory and experiment was found in the "
            "resonance behaviour.",
            text("9.1, L7145"),
            "error of the amplitude by the linear equation of chapter IV, corrected, relative to that by the full "
            "equations; greatest of the harmonics 3 to 6, which may be ignored (L6788), over the greater of the "
            "first two; the most of springs C and D, 300 to 1000 rpm (L6812) in steps of 50",
            f"{SMALL:g}, the rule for *negligible*",
            (
                at_most("error", SMALL, error),
                at_most("third and higher harmonics", SMALL, max(map(overtones, turns.values()))),
                Case(label="agreement with the experiment", computed=None, why=LOST),
            ),
        ),
    )


def compute() -> StudyResult:
    """Judge the sentences of sections 8.0 and 9.1."""
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
