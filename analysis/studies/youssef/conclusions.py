"""Verdicts on the conclusions of the thesis: on each sentence of sections 8.0 and 9.1 that makes a claim.

Most of these sentences sum up statements that are judged in the chapters; here each sentence is judged again as a whole.
"""

from __future__ import annotations

from math import asin, degrees, pi

import numpy as np
from numpy.typing import NDArray

from ...run import Event, Inputs, simulate
from ...slider import slider_motion
from ...synthesis import Search, SliderUnknown, UntimedPath, path_from_formula
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import ABOUT, ABOUT_DEG, ALIKE, SEEN_FALL, SMALL
from ..statements import Case, Statement, at_least, at_most, near, text
from ..study import Study, StudyResult
from .chapter_3 import graph_distance, run_from_rest
from .chapter_6 import TABLE, ratios_to_least
from .conclusions_linear import judge_introduction, judge_linearised
from .formulation import judge_closure, judge_multipliers
from .free_crank import Turns
from .launches import TORQUES, launch, run_acceleration, run_peak
from .no_spring import COLLINEAR_SINE, DAMPINGS, FEWEST_TURNS, TRANSIENT_TURNS, drift
from .problems import AREA_N, PROBLEMS
from .rig_2 import RANGE, length, linear_motion
from .rigs import LOST, amplitude, overtones, turn
from .runs import PERIOD, SPEED, STIFFNESSES, plain, steady_turn, table_3_1
from .series_2 import best_error_ratios, error_ratios, out_of_reach, shares_of_stated
from .stated_errors import share_of_stated

NUMBER = "conclusions"
#: Longer semi-axes of the ellipses that links move along (cm): those of paths (a) and (b), and one between.
ELLIPSES = {"path (a), 10 cm": 10.0, "12.5 cm": 12.5, "path (b), 15 cm": 15.0}
#: Launches of Fig 3.6 and 3.9: torque (dyn.cm) and spring (dyn/cm); those that get collinear without a damper.
LAUNCHES = (*((torque, 1e6) for torque in TORQUES), (1e8, 5e5), (1e8, 2e6))
FOLDING = ((2e8, 1e6), (1e8, 5e5))
#: The damper of a launch (dyn.s/cm), and how long its free motion is followed (s): ten turns of the slowest.
DAMPED, FREE = 3e4, 3.0
#: Turns that are run at most without a spring.
MOST_TURNS = 80


def maxima_spacings(angle: NDArray[np.float64], rate: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the crank angles (deg) between successive maxima of the slider position after th2 = 1 rad.

    The maxima are where the slider's ``rate`` falls through zero.
    """
    (at,) = np.nonzero((angle[:-1] > 1.0) & (rate[:-1] > 0.0) & (rate[1:] <= 0.0))
    tops = angle[at] + rate[at] / (rate[at] - rate[at + 1]) * np.diff(angle)[at]
    return np.degrees(np.diff(tops))


def decay(torque: float, stiffness: float, damping: float) -> float:
    """Return the mean range of u in the later half of the turns after a launch, relative to that in the earlier half.

    The first two turns are left out: they have the transient of the launch, which also decays without a damper.
    """
    swing = Turns.from_run(launch(torque, stiffness, FREE, 6000, damping), start=1.0).slider_range[TRANSIENT_TURNS:]
    half = swing.size // 2
    return float(swing[half:].mean() / swing[:half].mean())


def collinear_turn(damping: float) -> float:
    """Return the turn at which the links become collinear without a spring, as in Fig 3.2, or NaN.

    The mechanism is Table 3.1 at 420 rpm with a damper (dyn.s/cm).
    """
    angle = asin(COLLINEAR_SINE)
    run = simulate(
        table_3_1(0.0, damping),
        Inputs(speed=SPEED * RAD_S_PER_RPM),
        stop_time=MOST_TURNS * PERIOD,
        step=PERIOD,
        events=tuple(
            Event(name=str(sign), output="transmission.angle", level=level, direction=sign)
            for level, sign in ((angle, -1), (pi - angle, 1))
        ),
    )
    return run.events[0].time / PERIOD if run.events else np.nan


def ellipse_error(semi_axis: float) -> float:
    """Return the least area between an ellipse and the coupler curve of path (b)'s links, relative to the ellipse's area.

    ``semi_axis`` is in cm. The rocker pivot moves with five harmonics.
    """
    p = PROBLEMS["path-b"]
    formula = f"0.20 + {semi_axis / CM_PER_METRE:g}*cos(t)"
    task = UntimedPath(path=path_from_formula(formula, "0.15 + 0.05*sin(t)", n=AREA_N))
    unknown = SliderUnknown(harmonics=5, stroke=0.25)
    return p.convert(slider_motion(task, p.linkage, unknown, search=Search(starts=4)).best.error) / (
        5.0 * pi * semi_axis
    )


def judge_second_input() -> tuple[Statement, ...]:
    """Judge the conclusions on the slider as a second input."""
    return (
        Statement(
            "The releasing of some constraints in linkage mechanisms and treating them as inputs that may be controlled "
            "yield versatile and powerful mechanisms.",
            text("9.1, L6993"),
            why="there is no measure of *versatile* and *powerful*",
        ),
        Statement(
            "For example the introduction of a second input to a four bar linkage gives a variety of outputs thus making "
            "the linkage a multipurpose mechanism which may be adapted to generate a family of [output] motions.",
            text("9.1, L6997"),
            "area between an ellipse and the curve of the links printed for path (b), mended, relative to the area of the "
            "ellipse. The family has three ellipses with longer semi-axes of 10 to 15 cm; the slider has five harmonics and "
            "a stroke of at most 25 cm (all our choice)",
            f"{ALIKE:g}, the rule for *the same*",
            tuple(at_most(name, ALIKE, ellipse_error(axis_cm)) for name, axis_cm in ELLIPSES.items()),
        ),
        Statement(
            "[A] proper control of the slider enabled modifications and more accurate generation of outputs than could "
            "otherwise be obtained.",
            text("9.1, L7012"),
            "error with the best two harmonics of the slider, relative to that with the pivot fixed and the same links, as "
            "we read *otherwise*: for the printed links, mended, in eight problems, and for our best links in seven. Stroke "
            "and packaging machine are as at L5935",
            SEEN_FALL,
            (
                at_most("printed links, the most of eight", 1.0 - ALIKE, max(error_ratios().values())),
                at_most("best links, the most of seven", 1.0 - ALIKE, max(best_error_ratios().values())),
            ),
        ),
        Statement(
            "However, the control of this second input produced changes that were limited by an envelope dictated by the "
            "linkage kinematics.",
            text("9.1, L7016"),
            "area of that part of path (b) which lies farther from the crank shaft than l2 + r, the reach of its printed "
            "links with any motion of the slider",
            "more than 0.01 cm2, which exceeds the error of the area",
            (at_least("out of reach", 0.01, out_of_reach(), "cm2"),),
        ),
        Statement(
            "Therefore it was logical firstly to find the linkage that would approximately generate the desired output and "
            "then secondly to introduce a second input and control it for more accurate generation.",
            text("9.1, L7020"),
            why="this is a choice; no other order is tried",
        ),
    )


def judge_synthesis() -> tuple[Statement, ...]:
    """Judge the conclusions on the synthesis of linkages."""
    ratios = ratios_to_least()
    shares = [*(share_of_stated(row.problem) for row in TABLE.values()), *shares_of_stated().values()]
    kept = sum(share <= 1.0 + ABOUT for share in shares)
    return (
        Statement(
            "As a result an optimisation method was developed, the output of which gave a planar linkage that minimised the "
            "errors involved in function or path generation.",
            text("9.1, L7026"),
            f"error of the {len(ratios)} printed linkages whose error the thesis states, mended, relative to the least that "
            "we find within our limits (see the head of chapter VI)",
            f"{1.0 + ALIKE:g}, the rule for *the same*",
            tuple(
                at_most(name, 1.0 + ALIKE, ratio, why="the other linkages do not have the least error")
                for name, ratio in ratios.items()
            ),
        ),
        Statement(
            "The method could be applied to any planar linkage and was implemented as a package of subroutines for general "
            "use.",
            text("9.1, L7030"),
            why="it is applied to four-bars and to one five-bar. That it is a package only tells what was done (appendix 5)",
        ),
        Statement(
            "The optimisation method was applied to a variety of examples and in most cases produced satisfactory results.",
            text("9.1, L7037"),
            "*satisfactory* is read as: the printed linkage has the error that the thesis states. Number of linkages whose "
            f"error is at most {1.0 + ABOUT:g} times the stated one, of {len(shares)}: {len(ratios)} of chapter VI, and two "
            "with the series of Figs 7.11 and 7.12. They are mended, and the series are in the best of their readings",
            f"more than half, as *most* says; {ABOUT:g}, the rule for *about*",
            (
                at_least("keep their error", 0.5 * len(shares), kept),
                Case(
                    label="the other examples",
                    computed=None,
                    why=(
                        "no error is stated for the packaging machine, for series 1 of chapter VII and for the others of "
                        "7.3.2 (L5935)"
                    ),
                ),
            ),
        ),
    )


def judge_equations() -> tuple[Statement, ...]:
    """Judge the conclusions on the equations of motion and their integration."""
    return (
        Statement(
            "The multipliers were associated with the pin forces and suitable methods of solution of the equations of "
            "motion were discussed.",
            text("9.1, L7049"),
            "multipliers of (3.1) minus the force at pin C and the crank torque by our equations of motion, which have no "
            "multipliers, relative to the greatest value; the greatest difference of those at Fig 3.1",
            "1e-9, above rounding errors",
            (at_most("multipliers", 1e-9, max(case.computed or 0.0 for case in judge_multipliers())),),
            "what is said about the methods is judged at L1334 to 1407",
        ),
        Statement(
            "It was found that, when performing the numerical integrations, it was better if all the derivatives of the "
            "generalised coordinates used in the multipliers method were integrated.",
            text("9.1, L7053"),
            "*better* is read as in 3.1 (L1744): the closure of the loop then shows the error. Greatest failure of closure "
            "divided by the greatest error of u, in 0.5 s by Hamming's method with a constant step, at 420 rpm and in a "
            "launch with T0 = 1e8 dyn.cm, as at L1744",
            "1 to 100, our choice as there: the closure must show the error, and must not be more than a hundred times as "
            "large",
            judge_closure(),
        ),
    )


def judge_constant_speed() -> tuple[Statement, ...]:
    """Judge the conclusions on the motion at a constant speed of the crank."""
    seen, differs = springs_on_torque()
    steady = {k: steady_turn(table_3_1(k), SPEED) for k in STIFFNESSES}
    starts = [
        np.abs(CM_PER_METRE * run_from_rest(k)["slider.position"][:360] - steady_k.slider_cm[:-1:4]).max()
        / np.ptp(steady_k.slider_cm)
        for k, steady_k in steady.items()
    ]
    return (
        Statement(
            "It was found that the spring stiffness had little effect on the torque required to drive the mechanism.",
            text("9.1, L7067"),
            "steady torque with the softest and the stiffest spring, k = 5e5 and 2e6 dyn/cm, at 420 rpm. First the greatest "
            "distance of the curves on a graph, perpendicular to them, as at L1995 but over the whole turn; then their "
            "greatest difference at the same crank angle, relative to the greatest size of the torque with the softest "
            "spring",
            f"{SMALL:g}, the rule for *small*, as *little effect* says",
            (at_most("on the graph", SMALL, seen), at_most("at the same crank angle", SMALL, differs)),
            "where the curves are steep they differ more at the same angle",
        ),
        Statement(
            "It was also found that when the slider was opposed by both spring and viscous damping its motion was a "
            "transient followed by periodic oscillations of period [2 pi] of the crank angle.",
            text("9.1, L7071"),
            "greatest distance of u in the first turn from the steady motion; difference of u from one turn of the crank to "
            "the next after 8 s; both relative to the range of the steady motion, at 420 rpm",
            f"{ALIKE:g}, the rule for *steady*: more than this for a transient, at most this for periodic oscillations",
            (
                at_least("transient, least of the springs", ALIKE, min(starts)),
                *(
                    at_most(f"periodic; k = {plain(k)} dyn/cm", ALIKE, steady_k.change / np.ptp(steady_k.slider_cm))
                    for k, steady_k in steady.items()
                ),
            ),
        ),
        Statement(
            "However, when the spring was eliminated the slider moved with periodic oscillations superimposed on a linear "
            "shift in its position thus making the linkage fall into a collinear configuration.",
            text("9.1, L7077"),
            "greatest change of the oscillation about the drift from turn to turn, as at L1907; distance of u at the ends "
            "of the turns from a line, as at L1911; number of turns until coupler and rocker are within "
            f"{degrees(asin(COLLINEAR_SINE)):.0f} deg of a straight line (our choice)",
            f"{ALIKE:g}, the rule for *steady* and *linear*; {FEWEST_TURNS} turns, two for the transient and two to compare; "
            f"{MOST_TURNS}, the number of turns that were run",
            (
                at_least(
                    f"oscillation and shift; mu = {plain(DAMPINGS[0])} dyn.s/cm, turns until collinear",
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
                    at_most(f"shift; mu = {plain(x)} dyn.s/cm", ALIKE, drift(x).bend, why="it accelerates")
                    for x in DAMPINGS[1:]
                ),
                at_most("turns until collinear, the most", MOST_TURNS, max(map(collinear_turn, DAMPINGS)), "turns"),
            ),
        ),
    )


def springs_on_torque() -> tuple[float, float]:
    """Compare the steady torques with the softest and the stiffest spring, at 420 rpm.

    The first result is the greatest distance between the curves on a graph, relative to its size. The second is the greatest
    difference at the same crank angle, relative to the greatest torque with the softest.
    """
    soft, stiff = (steady_turn(table_3_1(k), SPEED) for k in (STIFFNESSES[0], STIFFNESSES[-1]))
    torques = np.array([soft.torque, stiff.torque])
    seen = graph_distance(soft.angle_deg / 360.0, *torques / np.ptp(torques))
    return float(seen.max()), float(np.ptp(torques, axis=0).max() / np.abs(soft.torque).max())


def judge_launches() -> tuple[Statement, ...]:
    """Judge the conclusions on the motion after a launch by a torque."""
    runs = [launch(*which) for which in LAUNCHES]
    maxima = [maxima_spacings(run["crank.angle"], run["slider.velocity"]) for run in runs]
    fastest = max(run_peak(run_acceleration(*which)).angle for which in LAUNCHES)
    damped = max(decay(*which, DAMPED) for which in LAUNCHES)
    undamped = min(decay(*which, 0.0) for which in LAUNCHES if which not in FOLDING)
    return (
        Statement(
            "For a forced input (torsion bar input applied to the crank) it was found that the linkage accelerated until "
            "the input torque became smaller than the load offered by the linkage after which the slider executed periodic "
            "oscillations in [2 pi] of the crank angle.",
            text("9.1, L7083"),
            "launches of Figs 3.6 and 3.9: crank angle at which the speed is greatest while the torque acts, the greatest "
            "of the launches. Then the crank angle from one maximum of the slider to the next after the torque, for the "
            "first two maxima, and the mean for the last three within 1 s (our choice), each the farthest from 360 deg",
            f"below 1 rad, where the torque ends; {ABOUT_DEG:g} deg, the rule for *about*, since the oscillations decay",
            (
                at_most("greatest speed", 1.0, fastest, "rad"),
                *(
                    near(
                        f"period, {when} maxima",
                        360.0,
                        max((angles[part].mean() for angles in maxima), key=lambda x: abs(x - 360.0)),
                        ABOUT_DEG,
                        "deg",
                        why="a transient comes first",
                    )
                    for when, part in (("first", slice(1)), ("last", slice(-2, None)))
                ),
            ),
        ),
        Statement(
            "The oscillations, however, decayed due to the viscous dissipation of energy in the slider guide.",
            text("9.1, L7092"),
            "range of u over a turn after the launches of Figs 3.8 and 3.10, from the third turn on, since a transient "
            f"comes first: its mean in the later half of the turns within {FREE:g} s (our choice), relative to that in the "
            "earlier half. The greatest with the damper is listed, and the least without it, for launches in which the "
            "links do not become collinear",
            f"with the damper {SEEN_FALL}; without it no such fall",
            (
                at_most("with the damper, five launches", 1.0 - ALIKE, damped),
                at_least("without, three launches", 1.0 - ALIKE, undamped),
            ),
            "the slowest decay is that with T0 = 1e8 dyn.cm and k = 1e6 dyn/cm, whose range stays the same for ten turns",
        ),
    )


def judge_experiment() -> tuple[Statement, ...]:
    """Judge the conclusions on the experiment."""
    turns = {(s, w): turn(s, w) for s in "CD" for w in RANGE}
    error = max(
        abs(length(s) * linear_motion(s, w).amplitude / amplitude(found) - 1.0) for (s, w), found in turns.items()
    )
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
            "two assumptions of chapter IV: error of the amplitude by its linear equation, corrected, relative to that by "
            "the full equations; greatest of the harmonics 3 to 6, which it ignores, relative to the greater of the first "
            "two. The greatest values for springs C and D, 300 to 1000 rpm (L6812) in steps of 10",
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
        statements=(
            *judge_introduction(),
            *judge_second_input(),
            *judge_synthesis(),
            *judge_equations(),
            *judge_constant_speed(),
            *judge_launches(),
            *judge_linearised(),
            *judge_experiment(),
        ),
    )


#: The study by its name.
STUDIES = {NUMBER: Study(NUMBER, compute)}
