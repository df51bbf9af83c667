"""Figures 3.6 to 3.10: the crank accelerated from rest by a torque that falls to zero at the crank angle th2 = 1 rad.

u is the slider position.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import ceil, pi
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from linkwork.errors import AssemblyError
from linkwork.five_bar.published import DYN_CM_PER_NEWTON_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...run import Event, Inputs, TorsionBar, Trajectory, simulate
from ...units import CM_PER_METRE
from ..rules import ABOUT, ALIKE, SMALL
from ..statements import Case, FloatArray, Statement, at_least, at_most, near, statement, unjudged
from ..study import Study, StudyResult, pad_columns
from ..variation import cache
from .free_crank import LOSS, SAMPLES, UNDAMPED, Turns, coast, damper_cases, turn_by_turn, undamped_range
from .runs import (
    ALIKE_WORDS,
    SIGN,
    STIFFNESSES,
    distance_from_line,
    greatest,
    greatest_ratio,
    plain,
    scientific,
    table_3_1,
)

#: Torques of Fig 3.6 to 3.8, and torques along the curve of Fig 3.7 (dyn.cm).
TORQUES = (1e7, 1e8, 2e8)
TORQUE_RANGE = np.geomspace(TORQUES[0], TORQUES[-1], 14)
#: Speeds (rpm), by spring (dyn/cm), at which a steadily running crank is released for comparison: above those of the launches.
RELEASED = {5e5: 580.0, 1e6: 820.0, 2e6: 840.0}
#: Other such speeds with k = 1e6 dyn/cm; after the strongest launch the time to the steady decay depends on this choice.
OTHER_RELEASES = (780.0, 800.0)
#: Quantity of a plot: its name on the axis, output, factor to its unit, unit.
Quantity = tuple[str, str, float, str]
SLIDER: Quantity = ("slider position u", "slider.position", CM_PER_METRE, "cm")
CRANK_SPEED: Quantity = ("crank speed", "crank.speed", 1.0, "rad/s")
TIME = "time [s]"
#: Turns that `damper_cases` compares after a launch, in words; our choices in the launches.
FROM_RELEASE = (
    "in 3 s (our choice) or until the links become collinear. The turns are counted from 1 rad, where the torque ends"
)
UNSAID = (
    "The text does not give the damper of the launches, nor how long they are followed, nor the spring of the launches with "
    "three torques. We take the damper of Fig 3.4, 1 s, and the middle spring of Fig 3.4."
)


@cache
def launch(
    torque: float, stiffness: float = 1e6, stop_time: float = 1.0, samples: int = 2000, damping: float = 3e4
) -> Trajectory:
    """Simulate the mechanism of Table 3.1 from rest: the crank torque is T = T0 (1 - th2) up to th2 = 1 rad, then zero.

    ``torque`` is T0. Torque, stiffness and damping are in CGS units; an event marks the end of the torque.
    """
    return simulate(
        table_3_1(stiffness, damping),
        Inputs(torque=TorsionBar(torque=torque / DYN_CM_PER_NEWTON_METRE)),
        stop_time=stop_time,
        step=stop_time / samples,
        events=(Event(name="release", output="crank.angle", level=1.0, direction=1),),
    )


def release_time(torque: float, stiffness: float = 1e6, stop_time: float = 1.0) -> float:
    """Return the time from rest to th2 = 1 rad (s); infinite if the crank falls back before this angle."""
    events = launch(torque, stiffness, stop_time).events
    return events[0].time if events else np.inf


def run_acceleration(torque: float, stiffness: float = 1e6) -> Trajectory:
    """Run a launch up to th2 = 1 rad, where its torque ends."""
    return launch(torque, stiffness, release_time(torque, stiffness), 1000)


def least_torque() -> float:
    """Find the least T0 (dyn.cm) that turns the crank from rest by 1 rad, to four digits."""
    low, high = 1e5, 1e7
    while high / low > 1.0001:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if np.isfinite(release_time(middle, stop_time=3.0)) else (middle, high)
    return float(np.sqrt(low * high))


def last_crossing(values: FloatArray, level: float) -> float:
    """Return the index, with a fraction, after which the values stay below a level; 0 if they always do."""
    above = np.flatnonzero(values > level)
    if not above.size:
        return 0.0
    last = int(above[-1])
    after = values[min(last + 1, len(values) - 1)]
    return last + float((values[last] - level) / (values[last] - after)) if after < level else float(last + 1)


class Settling(NamedTuple):
    """Transition of the slider position u after a launch to the steady decay of a free crank.

    ``turns`` and ``time`` (s) pass from the end of the torque until u stays within `ALIKE` of the steady decay. ``first`` and
    ``last`` are the greatest distances of u from the steady decay in the first and in the last whole turn, relative to the
    range of the steady decay in this turn. ``decay`` is the greatest ratio, after ``turns``, of the mean of u in a turn to the
    mean in the turn before.
    """

    turns: float
    time: float
    first: float
    last: float
    decay: float


@cache
def settling(torque: float, stiffness: float, rpm: float) -> Settling:
    """Compare the slider position u after a launch with u of a free crank in steady decay, released at a speed (rpm).

    A turn after the launch is compared, at equal crank angles, with the steady decay at the same mean speed; if it is faster
    than all turns of the steady decay, with the fastest of them.
    """
    launched, steady = launch(torque, stiffness), coast(stiffness, rpm=rpm)
    (after, turns), (known, waves) = (
        (Turns.from_run(run, 1.0), turn_by_turn(run, "slider.position", 1.0)) for run in (launched, steady)
    )
    # in the steady decay the speed falls
    first = 1 + int(max(np.flatnonzero(np.diff(known.speed) >= 0.0), default=-1))
    speed, waves = known.speed[first:], waves[first:]
    steadily = CubicSpline(speed[::-1], waves[::-1])(np.minimum(after.speed, speed[0]))
    distances = np.abs(turns - steadily) / np.ptp(steadily, axis=1)[:, None]
    count = last_crossing(distances.ravel(), ALIKE) / SAMPLES
    end = float(np.interp(1.0 + 2.0 * pi * count, launched["crank.angle"], launched.time))
    decaying = after.slider[min(ceil(count), len(after.slider) - 2) :]
    return Settling(
        count, end - launched.events[0].time, distances[0].max(), distances[-1].max(), greatest_ratio(decaying)
    )


def _torque_runs() -> dict[str, Trajectory]:
    return {f"T0 = {plain(torque)} dyn.cm": launch(torque) for torque in TORQUES}


def _spring_runs() -> dict[str, Trajectory]:
    return {f"k = {plain(k)} dyn/cm": launch(1e8, k) for k in STIFFNESSES}


def _launch_result(
    claim: str, runs: Mapping[str, Trajectory], quantity: Quantity, *statements: Statement
) -> StudyResult:
    """Build the result of several launches: a quantity over time, and the times at which their torques end."""
    name, output, factor, unit = quantity
    columns = {TIME: next(iter(runs.values())).time}
    columns |= {f"{name}; {label} [{unit}]": factor * run[output] for label, run in runs.items()}
    columns |= {f"end of the torque; {label} [s]": np.array([run.events[0].time]) for label, run in runs.items()}
    return StudyResult(claim=claim, assignment=UNSAID, columns=pad_columns(columns), statements=statements)


def draw_launches(values: Sequence[float], legend: str, result: StudyResult) -> Figure:
    """Draw a quantity of several launches over time, with a circle at th2 = 1 rad, where the torque ends.

    ``values`` are the torques or springs of the launches, ``legend`` is the heading of the legend.
    """
    time, *columns = result.columns.values()
    name = list(result.columns)[1]
    curves, circles = [], []
    for colour, value, y, end in zip(COLOURS, values, columns[:3], columns[3:]):
        curves.append(Curve(x=time, y=y, label=scientific(value), colour=colour))
        circles.append(Curve(x=end[:1], y=np.interp(end[:1], time, y), colour=colour, line="", marker="o"))
    panel = Panel(
        x_label="time [s]",
        y_label=f"{name.partition(';')[0]} [{name.rpartition('[')[2]}",
        curves=[*curves, *circles, Curve(x=[], y=[], colour="0.3", line="", marker="o", label="1 rad")],
        legend=legend,
        legend_at="outside",
        x_range=(0.0, float(time[-1])),
    )
    return plot_curves([panel], title=result.heading)


#: How the rise of the crank speed is judged.
RISE = (
    "greatest distance of the crank speed, up to its peak while the torque acts, from the best line parallel to the "
    "chord from start to peak, relative to the peak. Then the crank angle of this peak, before the torque ends at 1 rad"
)


def _rise_cases(runs: Mapping[str, Trajectory]) -> tuple[Case, ...]:
    """Judge whether the crank speed rises linearly, and whether it peaks before the torque ends."""
    bows = [
        at_most(f"distance from a line; {label}", ALIKE, distance_from_line(*_rise_to_peak(run)))
        for label, run in runs.items()
    ]
    angle = max(run_peak(run).angle for run in runs.values())
    return (*bows, at_most("crank angle of the peak, greatest", 1.0, angle, "rad"))


class Peak(NamedTuple):
    """Greatest crank speed of a run: its time (s), crank angle (rad) and value (rad/s)."""

    time: float
    angle: float
    speed: float


def run_peak(run: Trajectory) -> Peak:
    """Return the greatest crank speed of a run, interpolated between the samples."""
    time, speed = greatest(run.time, run["crank.speed"])
    return Peak(time, float(np.interp(time, run.time, run["crank.angle"])), speed)


def _rise_to_peak(run: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return time and crank speed up to the peak of the speed, each divided by its value at the peak."""
    peak = run_peak(run)
    before = run.time < peak.time
    return np.append(run.time[before] / peak.time, 1.0), np.append(run["crank.speed"][before] / peak.speed, 1.0)


def _swing_cases(runs: Mapping[str, Trajectory], start: float) -> tuple[Case, ...]:
    """Judge whether the speed of a free crank oscillates in each turn, and whether the mean speed falls from turn to turn."""
    turns = [Turns.from_run(run, start) for run in runs.values()]
    return (
        at_least("range over the mean in a turn, least", ALIKE, min((t.speed_range / t.speed).min() for t in turns)),
        at_most("mean relative to the turn before, greatest", 1.0, max(greatest_ratio(t.speed) for t in turns)),
    )


def _launches(torque: float, stiffness: float) -> tuple[Trajectory, Trajectory]:
    """Run a launch of 3 s without the damper and with it."""
    free, damped = (launch(torque, stiffness, 3.0, 6000, damping) for damping in (0.0, 3e4))
    return free, damped


#: What is measured by `_swing_cases`.
SWINGS = (
    "range of the crank speed in a turn divided by its mean; for the decay, the mean relative to that of the turn before. "
    "Free motions"
)


#: Label of the case on `Settling.decay`.
DECAY = "mean of u relative to the turn before, greatest"


def _settled() -> tuple[Case, ...]:
    """Judge whether the launch with the greatest torque takes longest to reach the steady decay, and whether u then decays."""
    try:
        found = [[settling(torque, 1e6, rpm) for torque in TORQUES] for rpm in (RELEASED[1e6], *OTHER_RELEASES)]
    except AssemblyError:
        return tuple(
            unjudged(label, "the steady motion of a free crank does not stay assembled")
            for label in ("time, least", DECAY)
        )
    ratio = min(last.time / max(x.time for x in sooner) for *sooner, last in found)
    return (at_least("time, least", 1.0, ratio), at_most(DECAY, 1.0, max(last.decay for *_, last in found)))


def launch_speeds() -> StudyResult:
    """Compute the crank speed after launches with the three torques."""
    runs = _torque_runs()
    undamped = {label: _launches(torque, 1e6) for label, torque in zip(runs, TORQUES)}
    rises = {label: run_acceleration(torque) for label, torque in zip(runs, TORQUES)}
    return _launch_result(
        "The speed rises linearly until the torque no longer accelerates the crank, then oscillates and decays.",
        runs,
        CRANK_SPEED,
        statement(
            "It is clear from the figure that during the time in which the torque T is acting the crank speed "
            "behaves in a linear manner up to the stage when the input torque becomes less than the torque "
            "sufficient to accelerate the mechanism. This stage occurs when the points [p1] and p2 are reached.",
            "3.2.2, L2124-2134",
            f"{RISE}; p1 and p2 are read as the peaks",
            ALIKE_WORDS,
            *_rise_cases(rises),
        ),
        statement(
            "The behaviour of the crank speed beyond [theta2] = 1 rad. in Fig. (3.6) is governed by the free motion "
            "equations of motion. However, it is oscillatory and decaying.",
            "3.2.2, L2142-2147",
            f"{SWINGS} after all three torques, up to 1 s; no torque acts there, by definition",
            f"{ALIKE:g}, the rule for *steady*; {SIGN}",
            *_swing_cases(runs, 1.0),
        ),
        statement(
            "The decaying aspect is due to the energy dissipation in the slider guide and will be studied in the next section.",
            "3.2.2, L2147-2151",
            f"{UNDAMPED} {FROM_RELEASE}",
            LOSS,
            *damper_cases(undamped, 1.0),
            why=undamped_range(undamped, 1.0),
        ),
    )


def torque_over_time() -> StudyResult:
    """Compute the time to 1 rad for each torque, the exponent of the torque as a power of the time, and the least torque."""
    time = np.array([release_time(float(torque)) for torque in TORQUE_RANGE])
    slope = float(np.mean(np.diff(np.log(TORQUES)) / np.diff(np.log([release_time(torque) for torque in TORQUES]))))
    low, scale = least_torque(), TORQUES[-1]
    return StudyResult(
        claim="T0 is hyperbolic in the time to 1 rad, with the axes as asymptotes.",
        assignment=UNSAID,
        columns={"T0 [dyn.cm]": TORQUE_RANGE, "time to 1 rad [s]": time, "T0 t^2 [dyn.cm.s2]": TORQUE_RANGE * time**2},
        statements=(
            statement(
                "A plot of the initial torque T0 against the time taken to reach [theta2] = 1 rad. is shown in Fig. (3.7). It "
                "shows a hyperbolic relationship[ ]between T0 and T [the time] asymptotic to [T0 = 0 and T = 0].",
                "3.2.2, L2134-2142",
                "power of the time to which T0 is proportional, the mean of its values between the first two and the last two "
                f"torques; least T0 that turns the crank by 1 rad, relative to {plain(scale)} dyn.cm; time at 1e12 dyn.cm (our "
                f"choice), relative to the time at {plain(TORQUES[0])}",
                f"{ALIKE_WORDS}; {SMALL:g}, the rule for *small*, for the asymptotes",
                near(
                    "exponent, -1 in a hyperbola with these asymptotes",
                    -1.0,
                    slope,
                    ALIKE,
                    why="T0 t^2 is nearly constant, not T0 t",
                ),
                at_most("least T0", SMALL, low / scale),
                at_most("least time", SMALL, release_time(1e12) / release_time(TORQUES[0])),
            ),
        ),
    )


def draw_torque_over_time(result: StudyResult) -> Figure:
    """Draw the torque over the time to 1 rad, on linear and on logarithmic axes.

    Lines with the exponents -1 and -2 pass through the point of T0 = 1e8 dyn.cm.
    """
    torque, time = result.columns["T0 [dyn.cm]"], result.columns["time to 1 rad [s]"]
    hinge, three = float(np.interp(1e8, torque, time)), np.interp(TORQUES, torque, time)
    curves = [
        Curve(x=time, y=torque, label="computed"),
        Curve(x=three, y=TORQUES, line="", marker="o", colour=COLOURS[0], label="the thesis's torques"),
        Curve(x=time, y=1e8 * (hinge / time) ** 2, label=r"$T_0\,t^2$ constant", line="--", colour="#333333"),
        Curve(x=time, y=1e8 * hinge / time, label=r"$T_0\,t$ constant", line=":", colour="#333333"),
    ]
    x, y = "time to 1 rad [s]", r"$T_0$ [dyn cm]"
    left = Panel(x_label=x, y_label=y, curves=curves, x_range=(0.0, 0.075), y_range=(0.0, 2.2e8))
    right = Panel(x_label=x, y_label=y, curves=curves, logarithmic="xy", x_ticks=(0.015, 0.02, 0.03, 0.05, 0.07))
    return plot_curves([left, right], title=result.heading, columns=2, size=(4.4, 3.6))


def launch_positions() -> StudyResult:
    """Compute the slider position after launches with the three torques."""
    runs = _torque_runs()
    positions = {label: run["slider.position"] for label, run in runs.items()}
    # u is greatest at the start if the slider never passes it
    tops = {label: greatest(runs[label].time, u)[1] if u.argmax() else u[0] for label, u in positions.items()}
    largest = max(float(np.abs(u).max()) for u in positions.values())
    *lesser, shift = (abs(Turns.from_run(run, 1.0).slider.mean()) for run in runs.values())
    shaft = -CM_PER_METRE * table_3_1(0.0).ground_length
    return _launch_result(
        "The harder the launch, the further the slider moves from its start, and the later it settles into a decay.",
        runs,
        SLIDER,
        statement(
            "As would be expected the response for [T0 = 2 x 10^8] takes longer before it settles and then starts a "
            "steady state decay.",
            "3.2.2, L2155-2159",
            f"time from the end of the torque until u stays within {ALIKE:g} of the steady decay (as at Fig 3.10), relative "
            "to the longest such time with the other torques; from then on, mean of u relative to the turn before. The free "
            f"crank of Fig 3.10 is released at {OTHER_RELEASES[0]:g}, {OTHER_RELEASES[1]:g} and {RELEASED[1e6]:g} rpm (our "
            "choice), since its own transient affects the time",
            SIGN,
            *_settled(),
        ),
        statement(
            "The three responses show the slider oscillates between its initial position and the crank shaft and as "
            "would be expected the shift from its initial position is greatest in the highest input torque case.",
            "3.2.2, L2159-2167",
            "greatest u, relative to the greatest size of u in the graph; least u of the three responses (the shaft is at "
            f"{shaft:g} cm). For *shift*: size of the mean of u over the turns after the torque, up to 1 s, with T0 = 2e8 "
            "dyn.cm relative to the greater of the two others",
            f"{ALIKE_WORDS}; {SIGN}",
            *(
                at_most(
                    f"greatest u; {label}",
                    ALIKE,
                    top / largest,
                    why="after the weakest launch the slider moves to both sides of its start",
                )
                for label, top in tops.items()
            ),
            at_least(
                "least u of all", shaft, CM_PER_METRE * min(run["slider.position"].min() for run in runs.values()), "cm"
            ),
            at_least("mean of u", 1.0, shift / max(lesser)),
        ),
    )


def launch_speeds_by_spring() -> StudyResult:
    """Compute the crank speed after launches with the three springs."""
    rises = {label: run_acceleration(1e8, k) for label, k in zip(_spring_runs(), STIFFNESSES)}
    speeds = np.array([run["crank.speed"] for run in rises.values()])
    loads = np.array([np.hypot(run["pin.C.fx"], run["pin.C.fy"]) for run in rises.values()])
    undamped = {label: _launches(1e8, k) for label, k in zip(rises, STIFFNESSES)}
    return _launch_result(
        "The speed rises linearly, with all springs alike, until the torque no longer accelerates the crank.",
        _spring_runs(),
        CRANK_SPEED,
        statement(
            "The figure shows the crank speed increasing linearly up to the point when the torque input becomes "
            "smaller than the torque required to accelerate the mechanism.",
            "3.2.2, L2175-2181",
            RISE,
            ALIKE_WORDS,
            *_rise_cases(rises),
        ),
        statement(
            "The speed fluctuates when the torque is removed and then decays due to the viscous dissipation of "
            "energy in the slider guide.",
            "3.2.2, L2181-2185",
            f"least range of the crank speed in a turn divided by its mean, up to 1 s; then the {UNDAMPED} {FROM_RELEASE}",
            LOSS,
            _swing_cases(_spring_runs(), 1.0)[0],
            *damper_cases(undamped, 1.0),
            why=undamped_range(undamped, 1.0),
        ),
        statement(
            "Because the speed response is the same throughout the time region in which the torque acts, it suggests "
            "similar loads and movement of slider.",
            "3.2.2, L2187-2191",
            "spread between the springs of the crank speed and, for the loads, of the force at pin C, at equal fractions of "
            "the time to 1 rad, each relative to its peak. The slider's movement is judged at Fig 3.10",
            f"{ALIKE_WORDS}; {ABOUT:g}, the rule for *similar*",
            at_most("crank speed", ALIKE, np.ptp(speeds, axis=0).max() / speeds.max()),
            at_most("force", ABOUT, np.ptp(loads, axis=0).max() / loads.max()),
        ),
    )


def launch_positions_by_spring() -> StudyResult:
    """Compute the slider position after launches with the three springs."""
    runs = _spring_runs()
    apart = np.ptp([run_acceleration(1e8, k)["slider.position"] for k in STIFFNESSES], axis=0).max()
    apart /= np.ptp([run_acceleration(1e8, k)["slider.position"] for k in STIFFNESSES])
    settled = [settling(1e8, k, RELEASED[k]) for k in STIFFNESSES]
    by_torque = [settling(torque, 1e6, RELEASED[1e6]) for torque in TORQUES]
    times = {name: [x.time for x in settlings] for name, settlings in (("springs", settled), ("torques", by_torque))}
    return _launch_result(
        "The slider moves alike with all springs while the torque acts. A transient follows, whose duration depends on "
        "spring and torque, and then a steady decay.",
        runs,
        SLIDER,
        statement(
            "... similar loads and movement of slider. The latter is verified in Fig. (3.10) in which the slider response is "
            "shown.",
            "3.2.2, L2191-2195",
            "spread of u between the springs, at equal fractions of the time to 1 rad, relative to its range in that time",
            f"{ABOUT:g}, the rule for *similar*",
            at_most("greatest", ABOUT, apart),
        ),
        statement(
            "Fig. (3.10) also shows that as the torque is [r]emoved a transient free motion response prevails after "
            "which occurs a free motion steady state decay which is studied in the next section.",
            "3.2.2, L2195-2201",
            "distance of u from its steady decay, relative to the range of this decay in the turn, in the first turn after the "
            "torque and in the last turn within 1 s; the latter is rounded to 1e-05, the accuracy with which u of the decay is "
            "interpolated between its turns. The decay is u of a free crank that is released from its steady motion at "
            f"{', '.join(f'{rpm:g}' for rpm in RELEASED.values())} rpm with the three springs (our choice). The two are "
            "compared at equal crank angles, in turns of equal mean speed; where the launched crank is faster, with the "
            "fastest turn of the released one. Then the mean of u relative to the turn before, once u is within "
            f"{ALIKE:g} of that decay",
            f"{ALIKE_WORDS}; {SIGN}",
            *(
                case
                for label, x in zip(runs, settled)
                for case in (
                    at_least(f"{label}, first turn", ALIKE, x.first),
                    at_most(f"{label}, last turn", ALIKE, round(x.last, 5)),
                )
            ),
            at_most(DECAY, 1.0, max(x.decay for x in settled)),
        ),
        statement(
            "The duration of the transient free motion stage depends on the stiffness k and the initial input torque values.",
            "3.2.2, L2201-2205",
            f"time from the end of the torque until u stays within {ALIKE:g} of the steady decay, as in the row before; the "
            "longest time divided by the shortest",
            f"more than {1.0 + ALIKE:g}, the rule for *the same*",
            *(at_least(f"of the three {name}", 1.0 + ALIKE, max(x) / min(x)) for name, x in times.items()),
        ),
    )


_draw_by_torque = partial(draw_launches, TORQUES, r"$T_0$ [dyn cm]")
_draw_by_spring = partial(draw_launches, STIFFNESSES, "stiffness k [dyn/cm]")

#: The studies of 3.6 to 3.10.
STUDIES = {
    "3.6": Study(launch_speeds, _draw_by_torque),
    "3.7": Study(torque_over_time, draw_torque_over_time),
    "3.8": Study(launch_positions, _draw_by_torque),
    "3.9": Study(launch_speeds_by_spring, _draw_by_spring, sweeps=("slider.stiffness",)),
    "3.10": Study(launch_positions_by_spring, _draw_by_spring, sweeps=("slider.stiffness",)),
}
