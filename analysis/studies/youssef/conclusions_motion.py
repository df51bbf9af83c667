"""Verdicts on the conclusions of section 9.1 about the equations, the motion at constant speed, and launches.

Torque (dyn.cm), stiffness (dyn/cm) and damping (dyn.s/cm) of a launch are those of `launches.launch`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from math import asin, degrees

import numpy as np

from ..rules import ABOUT_DEG, ALIKE, SEEN_FALL, SMALL
from ..statements import FloatArray, Statement, at_least, at_most, near, statement
from .chapter_3 import graph_distance, transient
from .formulation import judge_closure
from .free_crank import Turns
from .launches import TORQUES, launch, run_acceleration, run_peak
from .multipliers import judge_multipliers
from .no_spring import COLLINEAR_SINE, DAMPINGS, DRIFT_TURNS, FEWEST_TURNS, NEAR_LINEAR, TRANSIENT_TURNS, drift
from .runs import SPEED, STIFFNESSES, SteadyTurn, plain, steady_turn, table_3_1

#: Launches of Fig 3.6 and 3.9: torque (dyn.cm) and spring (dyn/cm); launches whose links become collinear without a damper.
LAUNCHES = (*((torque, 1e6) for torque in TORQUES), (1e8, 5e5), (1e8, 2e6))
FOLDING = ((2e8, 1e6), (1e8, 5e5))
#: The damper of a launch (dyn.s/cm), and how long its free motion is followed (s): ten turns of the slowest launch.
DAMPED, FREE = 3e4, 3.0


def maxima_spacings(angle: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the crank angles (deg) between successive maxima of the slider position after th2 = 1 rad.

    The maxima are where the slider's ``rate`` falls through zero.
    """
    (at,) = np.nonzero((angle[:-1] > 1.0) & (rate[:-1] > 0.0) & (rate[1:] <= 0.0))
    tops = angle[at] + rate[at] / (rate[at] - rate[at + 1]) * np.diff(angle)[at]
    return np.degrees(np.diff(tops))


@cache
def ranges_of_turns(torque: float, stiffness: float, damping: float) -> FloatArray:
    """Return the range of u (cm) in each turn after a launch.

    The first two turns are left out: they have the transient of the launch, which also decays without a damper.
    """
    return Turns.from_run(launch(torque, stiffness, FREE, 6000, damping), start=1.0).slider_range[TRANSIENT_TURNS:]


def decay(torque: float, stiffness: float, damping: float) -> float:
    """Return the mean range of u in the later half of the turns after a launch, relative to that in the earlier half."""
    swing = ranges_of_turns(torque, stiffness, damping)
    half = swing.size // 2
    return float(swing[half:].mean() / swing[:half].mean())


def judge_equations() -> Iterator[Statement]:
    """Judge the conclusions on the equations of motion and their integration."""
    yield statement(
        "The multipliers were associated with the pin forces and suitable methods of solution of the equations of "
        "motion were discussed.",
        "9.1, L7049",
        "multipliers of (3.1) minus the force at pin C and the crank torque by our equations of motion, which have no "
        "multipliers, relative to the greatest value; the greatest difference of those at Fig 3.1",
        "1e-9, above rounding errors",
        at_most("multipliers", 1e-9, max(case.computed or 0.0 for case in judge_multipliers())),
        why="what is said about the methods is judged at L1334 to 1407",
    )
    yield statement(
        "It was found that, when performing the numerical integrations, it was better if all the derivatives of the "
        "generalised coordinates used in the multipliers method were integrated.",
        "9.1, L7053",
        "*better* is read as in 3.1 (L1744): the closure of the loop then shows the error. Greatest failure of closure "
        "divided by the greatest error of u, in 0.5 s by Hamming's method with a constant step, at 420 rpm and in a "
        "launch with T0 = 1e8 dyn.cm, as at L1744",
        "1 to 100, our choice as there: the closure must show the error, and must not be more than a hundred times as large",
        *judge_closure(),
    )


def compare_torques(soft: SteadyTurn, stiff: SteadyTurn) -> tuple[float, float]:
    """Compare the crank torques over steady turns with a soft and a stiff spring.

    The first result is the greatest distance between the curves on a graph, relative to the graph's size. The second is the
    greatest difference at the same crank angle, relative to the greatest torque with the soft spring.
    """
    torques = np.array([soft.torque, stiff.torque])
    seen = graph_distance(soft.angle_deg / 360.0, *torques / np.ptp(torques))
    return float(seen.max()), float(np.ptp(torques, axis=0).max() / np.abs(soft.torque).max())


def judge_constant_speed() -> Iterator[Statement]:
    """Judge the conclusions on the motion at a constant speed of the crank."""
    steady = {k: steady_turn(table_3_1(k), SPEED) for k in STIFFNESSES}
    seen, differs = compare_torques(steady[STIFFNESSES[0]], steady[STIFFNESSES[-1]])
    whole = {mu: replace(drift(mu), compared=DRIFT_TURNS) for mu in DAMPINGS[1:]}
    ten = max(x for mu in NEAR_LINEAR for x in (drift(mu).unsteadiest, drift(mu).bend))
    yield statement(
        "It was found that the spring stiffness had little effect on the torque required to drive the mechanism.",
        "9.1, L7067",
        "steady torque with the softest and the stiffest spring, k = 5e5 and 2e6 dyn/cm, at 420 rpm. First the greatest "
        "distance of the curves on a graph, perpendicular to them, as at L1995 but over the whole turn; then their greatest "
        "difference at the same crank angle, relative to the greatest size of the torque with the softest spring",
        f"{SMALL:g}, the rule for *small*, as *little effect* says",
        at_most("on the graph", SMALL, seen),
        at_most("at the same crank angle", SMALL, differs),
        why="where the curves are steep they differ more at the same angle",
    )
    yield statement(
        "It was also found that when the slider was opposed by both spring and viscous damping its motion was a "
        "transient followed by periodic oscillations of period [2 pi] of the crank angle.",
        "9.1, L7071",
        "greatest distance of u in the first turn from the steady motion; difference of u from one turn of the crank to "
        "the next after 8 s (our choice), to one digit, since it is an error of the integration; both relative to the "
        "range of the steady motion, at 420 rpm",
        f"{ALIKE:g}, the rule for *steady*: more than this for a transient, at most this for periodic oscillations",
        at_least("transient, least of the springs", ALIKE, min(map(transient, STIFFNESSES))),
        *(
            at_most(f"periodic; k = {plain(k)} dyn/cm", ALIKE, steady_k.relative_change)
            for k, steady_k in steady.items()
        ),
    )
    yield statement(
        "However, when the spring was eliminated the slider moved with periodic oscillations superimposed on a linear "
        "shift in its position thus making the linkage fall into a collinear configuration.",
        "9.1, L7077",
        "greatest change of the oscillation about the drift from turn to turn, as at L1907, and distance of u at the ends "
        "of the turns from a line, as at L1911, but both until the links are collinear; number of turns until then, when "
        f"coupler and rocker are within {degrees(asin(COLLINEAR_SINE)):.2f} deg of a straight line (our choice)",
        f"{ALIKE:g}, the rule for *steady* and *linear*; {FEWEST_TURNS} turns, two for the transient and two to compare; "
        f"{DRIFT_TURNS} turns, as many as we run",
        at_least(
            f"oscillation and shift; mu = {plain(DAMPINGS[0])} dyn.s/cm, turns until collinear",
            FEWEST_TURNS,
            drift(DAMPINGS[0]).collinear_turn,
            "turns",
            why="the links are collinear in the third turn",
        ),
        *(
            at_most(f"oscillation; mu = {plain(mu)} dyn.s/cm", ALIKE, x.unsteadiest, why="it grows")
            for mu, x in whole.items()
        ),
        *(at_most(f"shift; mu = {plain(mu)} dyn.s/cm", ALIKE, x.bend, why="it accelerates") for mu, x in whole.items()),
        at_most(
            "turns until collinear, the most", DRIFT_TURNS, max(drift(x).collinear_turn for x in DAMPINGS), "turns"
        ),
        why=f"over the first ten turns, oscillation and shift with the two strongest dampers are within {ten:.3f}",
    )


def judge_launches() -> Iterator[Statement]:
    """Judge the conclusions on the motion after a launch by a torque."""
    runs = [launch(*which) for which in LAUNCHES]
    maxima = [maxima_spacings(run["crank.angle"], run["slider.velocity"]) for run in runs]
    fastest = max(run_peak(run_acceleration(*which)).angle for which in LAUNCHES)
    torque, stiffness = max(LAUNCHES, key=lambda which: decay(which[0], which[1], DAMPED))
    first, *_, last = ranges_of_turns(torque, stiffness, DAMPED)
    undamped = min(decay(*which, 0.0) for which in LAUNCHES if which not in FOLDING)
    yield statement(
        "For a forced input (torsion bar input applied to the crank) it was found that the linkage accelerated until "
        "the input torque became smaller than the load offered by the linkage after which the slider executed periodic "
        "oscillations in [2 pi] of the crank angle.",
        "9.1, L7083",
        "launches of Figs 3.6 and 3.9: crank angle at which the speed is greatest while the torque acts, the greatest "
        "of the launches. Then the crank angle from one maximum of the slider to the next after the torque, for the "
        "first two maxima, and the mean for the last three within 1 s (our choice), each the farthest from 360 deg",
        f"below 1 rad, where the torque ends; {ABOUT_DEG:g} deg, the rule for *about*, since the oscillations decay",
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
    )
    yield statement(
        "The oscillations, however, decayed due to the viscous dissipation of energy in the slider guide.",
        "9.1, L7092",
        "range of u over a turn after the launches of Figs 3.8 and 3.10, from the third turn on, since a transient "
        f"comes first: its mean in the later half of the turns within {FREE:g} s (our choice), relative to that in the "
        "earlier half. The greatest with the damper is listed, and the least without it, for launches in which the "
        "links do not become collinear",
        f"with the damper {SEEN_FALL}; without it no such fall",
        at_most("with the damper, five launches", 1.0 - ALIKE, decay(torque, stiffness, DAMPED)),
        at_least("without, three launches", 1.0 - ALIKE, undamped),
        why=f"the slowest decay is that with T0 = {plain(torque)} dyn.cm and k = {plain(stiffness)} dyn/cm: its range "
        f"stays the same for ten turns, and is {last / first:.2f} of this in the last",
    )
