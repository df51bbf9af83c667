"""Figures 3.6 to 3.14: the crank accelerated from rest by a torque, and the crank in free motion.

A launch is a motion from rest under a torque that falls to zero at the crank angle th2 = 1 rad. u is the slider position.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from linkwork.errors import AssemblyError
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import DYN_CM_PER_NEWTON_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import natural_frequency
from ...run import Event, Inputs, TorsionBar, Trajectory, simulate
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import ABOUT, ALIKE, SMALL
from ..statements import Case, Statement, at_least, at_most, near, text
from ..study import Study, StudyResult, pad_columns
from ..variation import cache
from .runs import (
    ALIKE_WORDS,
    SIGN,
    SPEED,
    STIFFNESSES,
    distance_from_line,
    greatest,
    greatest_ratio,
    plain,
    scientific,
    table_3_1,
)

#: Torques of Fig 3.6 to 3.8, and those of the curve of 3.7 (dyn.cm).
TORQUES = (1e7, 1e8, 2e8)
TORQUE_RANGE = np.geomspace(TORQUES[0], TORQUES[-1], 14)
#: Springs of the free motion (dyn/cm).
SOFT, STIFF = 5e5, 2e6
#: Speeds (rpm), by spring (dyn/cm), at which a steadily running crank is released for comparison: above those of the launches.
RELEASED = {5e5: 600.0, 1e6: 840.0, 2e6: 840.0}
#: Crank speed near which the thesis sees higher harmonics (rad/s).
HARMONIC_SPEED = 27.0
#: Number of crank angles at which a turn of a free crank is sampled.
SAMPLES = 256
#: Quantity of a plot: its name on the axis, output, factor to its unit, unit.
Quantity = tuple[str, str, float, str]
SLIDER: Quantity = ("slider position u", "slider.position", CM_PER_METRE, "cm")
CRANK_SPEED: Quantity = ("crank speed", "crank.speed", 1.0, "rad/s")
TIME = "time [s]"
#: Our choices in the launches.
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
    """Find the least T0 (dyn.cm) that turns the crank from rest by 1 rad, to half a per cent."""
    low, high = 1e5, 1e7
    while high / low > 1.01:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if np.isfinite(release_time(middle, stop_time=3.0)) else (middle, high)
    return float(np.sqrt(low * high))


@cache
def coast(stiffness: float, damping: float = 3e4, rpm: float = SPEED) -> Trajectory:
    """Simulate the mechanism of Table 3.1 without torque, released at crank angle 0 from its steady motion at a speed (rpm).

    The steady motion has the thesis's damper, the free motion has ``damping`` (dyn.s/cm).
    """
    period, speed = 60.0 / rpm, rpm * RAD_S_PER_RPM
    steady = simulate(table_3_1(stiffness), Inputs(speed=speed), stop_time=20.0 * period, step=period)
    u, v = (float(steady[name][-1]) for name in ("slider.position", "slider.velocity"))
    initial = InitialState(crank_speed=speed, slider_position=u, slider_velocity=v)
    return simulate(table_3_1(stiffness, damping), initial=initial, stop_time=10.0 if damping else 4.0, step=5e-4)


@dataclass(frozen=True, slots=True)
class Turns:
    """Statistics of the whole turns of a free crank, from samples at evenly spaced crank angles.

    Attributes
    ----------
    ends : ndarray
        Time at which each turn ends (s).
    speed, speed_range : ndarray
        Mean crank speed, 2 pi divided by the time of the turn, and range of the crank speed (rad/s).
    slider, slider_range, velocity_range : ndarray
        Mean and range of the slider position (cm), and range of the slider velocity (cm/s).
    first, second : ndarray
        Amplitudes of the first and the second harmonic of the slider position over the crank angle (cm).
    energy_share : ndarray
        Relative range of the kinetic energy divided by the relative range of the squared crank speed.
    """

    ends: NDArray[np.float64]
    speed: NDArray[np.float64]
    speed_range: NDArray[np.float64]
    slider: NDArray[np.float64]
    slider_range: NDArray[np.float64]
    velocity_range: NDArray[np.float64]
    first: NDArray[np.float64]
    second: NDArray[np.float64]
    energy_share: NDArray[np.float64]

    @classmethod
    def from_run(cls, run: Trajectory, start: float = 0.0) -> Turns:
        """Divide a run into turns and return their statistics; the first turn begins at the crank angle ``start`` (rad)."""
        angle = run["crank.angle"]
        times = np.interp(np.arange(start, angle[-1], 2.0 * pi), angle, run.time)
        names = ("slider.position", "slider.velocity", "crank.speed", "energy.kinetic")
        u, v, w, e = (turn_by_turn(run, name, start) for name in names)
        harmonics = 2.0 * CM_PER_METRE / SAMPLES * np.abs(np.fft.rfft(u, axis=1))
        return cls(
            ends=times[1:],
            speed=2.0 * pi / np.diff(times),
            speed_range=np.ptp(w, axis=1),
            slider=CM_PER_METRE * u.mean(axis=1),
            slider_range=CM_PER_METRE * np.ptp(u, axis=1),
            velocity_range=CM_PER_METRE * np.ptp(v, axis=1),
            first=harmonics[:, 1],
            second=harmonics[:, 2],
            energy_share=np.ptp(e, axis=1) / e.mean(axis=1) / np.ptp(w * w, axis=1) * (w * w).mean(axis=1),
        )

    @property
    def shown(self) -> int:
        """Return the number of turns up to the first whose mean crank speed is below `HARMONIC_SPEED`, this turn included."""
        return 1 + int(np.argmax(self.speed < HARMONIC_SPEED))


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
def settling(torque: float, stiffness: float) -> Settling:
    """Compare the slider position u after a launch with u of a free crank in steady decay.

    They are compared at equal crank angles, in turns of equal mean speed.
    """
    launched, steady = launch(torque, stiffness), coast(stiffness, rpm=RELEASED[stiffness])
    (after, turns), (known, waves) = (
        (Turns.from_run(run, 1.0), turn_by_turn(run, "slider.position", 1.0)) for run in (launched, steady)
    )
    found = []
    for speed, turn in zip(after.speed, turns):
        # the speed falls in the steady decay, and np.interp needs rising abscissas
        wave = np.array([np.interp(-speed, -known.speed, column) for column in waves.T])
        found.append(np.abs(turn - wave) / np.ptp(wave))
    distances = np.array(found)
    count = float(np.append(0, 1 + np.flatnonzero(distances > ALIKE))[-1]) / SAMPLES
    end = float(np.interp(1.0 + 2.0 * pi * count, launched["crank.angle"], launched.time))
    decaying = after.slider[min(ceil(count), len(after.slider) - 2) :]
    return Settling(
        count, end - launched.events[0].time, distances[0].max(), distances[-1].max(), greatest_ratio(decaying)
    )


def turn_by_turn(run: Trajectory, output: str, start: float) -> NDArray[np.float64]:
    """Sample an output over each whole turn from the crank angle ``start`` (rad), shape (turns, SAMPLES)."""
    return sample_turns(run["crank.angle"], run[output], start)


def sample_turns(angle: NDArray[np.float64], values: NDArray[np.float64], start: float = 0.0) -> NDArray[np.float64]:
    """Sample values, given at crank angles (rad), over each whole turn from the angle ``start``, shape (turns, SAMPLES)."""
    marks = np.arange(start, angle[-1], 2.0 * pi)
    grid = marks[:-1, None] + np.linspace(0.0, 2.0 * pi, SAMPLES, endpoint=False)
    return np.interp(grid, angle, values)


def half_natural_frequencies(stiffness: float) -> NDArray[np.float64]:
    """Return half the slider's natural frequency (rad/s) with the effective mass at each crank angle of a turn, at u = 0."""
    parameters = table_3_1(stiffness)
    p = parameters.constants()
    places = (kinematics.position(angle, 0.0, p) for angle in np.linspace(0.0, 2.0 * pi, 721).tolist())
    masses = [dynamics.inertia(g, kinematics.coefficients(g, p), p).m22 for g in places]
    return 0.5 * np.sqrt(parameters.slider_stiffness / np.array(masses))


# --- Launches: 3.6 to 3.10


def _torque_runs() -> dict[str, Trajectory]:
    return {f"T0 = {plain(torque)} dyn.cm": launch(torque) for torque in TORQUES}


def _spring_runs() -> dict[str, Trajectory]:
    return {f"k = {plain(k)} dyn/cm": launch(1e8, k) for k in STIFFNESSES}


def _launch_result(
    number: str, claim: str, runs: Mapping[str, Trajectory], quantity: Quantity, *statements: Statement
) -> StudyResult:
    """Build the result of several launches: a quantity over time, and the times at which their torques end."""
    name, output, factor, unit = quantity
    columns = {TIME: next(iter(runs.values())).time}
    columns |= {f"{name}; {label} [{unit}]": factor * run[output] for label, run in runs.items()}
    columns |= {f"end of the torque; {label} [s]": np.array([run.events[0].time]) for label, run in runs.items()}
    return StudyResult(
        number=number, claim=claim, assignment=UNSAID, columns=pad_columns(columns), statements=statements
    )


def draw_launches(values: Sequence[float], legend: str, result: StudyResult) -> Figure:
    """Draw a quantity of several launches over time, with a circle at th2 = 1 rad, where the torque ends."""
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
    "greatest distance of the crank speed, up to its peak while the torque acts, from the best line (its greatest distance "
    "from the curve is least), relative to the peak. Then the crank angle of this peak, before the torque ends at 1 rad"
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


def _rise_to_peak(run: Trajectory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return time and crank speed up to the peak of the speed, each divided by its value at the peak."""
    peak = run_peak(run)
    before = run.time < peak.time
    return np.append(run.time[before] / peak.time, 1.0), np.append(run["crank.speed"][before] / peak.speed, 1.0)


def _swing_cases(runs: Mapping[str, Trajectory], start: float) -> tuple[Case, ...]:
    """Judge whether the speed of a free crank oscillates within each turn and its mean falls from turn to turn."""
    turns = [Turns.from_run(run, start) for run in runs.values()]
    return (
        at_least("range over the mean in a turn, least", ALIKE, min((t.speed_range / t.speed).min() for t in turns)),
        at_most("mean relative to the turn before, greatest", 1.0, max(greatest_ratio(t.speed) for t in turns)),
    )


def _second_halves(runs: Sequence[Trajectory], start: float) -> list[NDArray[np.float64]]:
    """Return the mean speeds of the turns in the second half of each run (the same turns), relative to its first turn."""
    speeds = [Turns.from_run(run, start).speed for run in runs]
    count = min(map(len, speeds))
    return [speed[count // 2 : count] / speed[0] for speed in speeds]


def _damper_cases(pairs: Mapping[str, tuple[Trajectory, Trajectory]], start: float) -> tuple[Case, ...]:
    """Judge whether a free crank loses mean speed only if it has a damper.

    Each pair has a run without the damper and a run with it.
    """
    cases = []
    for label, runs in pairs.items():
        free, damped = (half.max() for half in _second_halves(runs, start))
        cases.append(at_least(f"without the damper; {label}", 1.0 - ALIKE, free))
        cases.append(at_most(f"with it; {label}", 1.0 - ALIKE, damped))
    return tuple(cases)


def _undamped_range(pairs: Mapping[str, tuple[Trajectory, Trajectory]], start: float) -> str:
    """Return the range of the mean speed of a turn without the damper, in the runs of `_damper_cases`, in words."""
    free = np.concatenate([_second_halves(runs, start)[0] for runs in pairs.values()])
    return (
        f"without the damper, the mean speed of a turn varies between {free.min():.2f} and {free.max():.2f} of that of the "
        "first turn"
    )


def _launches(torque: float, stiffness: float) -> tuple[Trajectory, Trajectory]:
    """Run a launch of 3 s without the damper and with it."""
    free, damped = (launch(torque, stiffness, 3.0, 6000, damping) for damping in (0.0, 3e4))
    return free, damped


#: What is measured by `_swing_cases` and `_damper_cases`.
SWINGS = (
    "range of the crank speed in a turn divided by its mean; for the decay, the mean relative to that of the turn before. "
    "Free motions"
)
UNDAMPED = (
    "greatest mean crank speed of a turn in the second half of the free motion, relative to that of the first turn, without "
    "the damper and with it, over the turns that both motions have"
)
#: The tolerance of `_damper_cases`.
LOSS = f"{ALIKE_WORDS}; a loss is more than that, and lasts"


#: Label of the case on `Settling.decay`.
DECAY = "mean of u relative to the turn before, greatest"


def _settled() -> tuple[Case, ...]:
    """Judge whether the launch with the greatest torque takes longest to reach the steady decay, and whether u then decays."""
    try:
        *sooner, last = (settling(torque, 1e6) for torque in TORQUES)
    except AssemblyError:
        return tuple(
            Case(label=label, computed=None, why="the steady motion of a free crank does not stay assembled")
            for label in ("time", DECAY)
        )
    return (
        at_least("time", 1.0, last.time / max(x.time for x in sooner)),
        at_most(DECAY, 1.0, last.decay),
    )


def launch_speeds() -> StudyResult:
    """Compute the crank speed after launches with the three torques."""
    runs = _torque_runs()
    undamped = {label: _launches(torque, 1e6) for label, torque in zip(runs, TORQUES)}
    rises = {label: run_acceleration(torque) for label, torque in zip(runs, TORQUES)}
    return _launch_result(
        "3.6",
        "The speed rises linearly until the torque no longer accelerates the crank, then oscillates and decays.",
        runs,
        CRANK_SPEED,
        Statement(
            "It is clear from the figure that during the time in which the torque T is acting the crank speed "
            "behaves in a linear manner up to the stage when the input torque becomes less than the torque "
            "sufficient to accelerate the mechanism. This stage occurs when the points [p1] and p2 are reached.",
            text("3.2.2, L2124-2134"),
            f"{RISE}; p1 and p2 are read as the peaks",
            ALIKE_WORDS,
            _rise_cases(rises),
        ),
        Statement(
            "The behaviour of the crank speed beyond [theta2] = 1 rad. in Fig. (3.6) is governed by the free motion "
            "equations of motion. However, it is oscillatory and decaying.",
            text("3.2.2, L2142-2147"),
            f"{SWINGS} after all three torques, up to 1 s; no torque acts there, by definition",
            f"{ALIKE:g}, the rule for *steady*; {SIGN}",
            _swing_cases(runs, 1.0),
        ),
        Statement(
            "The decaying aspect is due to the energy dissipation in the slider guide and will be studied in the "
            "next section.",
            text("3.2.2, L2147-2151"),
            f"{UNDAMPED}; runs of 3 s (our choice)",
            LOSS,
            _damper_cases(undamped, 1.0),
            _undamped_range(undamped, 1.0),
        ),
    )


def torque_over_time() -> StudyResult:
    """Compute the time to 1 rad for each torque, the exponent of the torque as a power of the time, and the least torque."""
    time = np.array([release_time(float(torque)) for torque in TORQUE_RANGE])
    slope = float(np.mean(np.diff(np.log(TORQUES)) / np.diff(np.log([release_time(torque) for torque in TORQUES]))))
    low, scale = least_torque(), TORQUES[-1]
    return StudyResult(
        number="3.7",
        claim="T0 is hyperbolic in the time to 1 rad, with the axes as asymptotes.",
        assignment=UNSAID,
        columns={"T0 [dyn.cm]": TORQUE_RANGE, "time to 1 rad [s]": time, "T0 t^2 [dyn.cm.s2]": TORQUE_RANGE * time**2},
        statements=(
            Statement(
                "A plot of the initial torque T0 against the time taken to reach [theta2] = 1 rad. is shown in Fig. (3.7). It "
                "shows a hyperbolic relationship[ ]between T0 and T [the time] asymptotic to [T0 = 0 and T = 0].",
                text("3.2.2, L2134-2142"),
                "exponent of the time in T0, the mean of the two exponents between the three torques; least T0 that turns "
                f"the crank by 1 rad, relative to {plain(scale)} dyn.cm; time at 1e12 dyn.cm (our choice), relative to the "
                f"time at {plain(TORQUES[0])}",
                f"{ALIKE_WORDS}; {SMALL:g}, the rule for *small*, for the asymptotes",
                (
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
    largest = max(float(np.abs(run["slider.position"]).max()) for run in runs.values())
    *lesser, shift = (abs(Turns.from_run(run, 1.0).slider.mean()) for run in runs.values())
    shaft = -CM_PER_METRE * table_3_1(0.0).ground_length
    return _launch_result(
        "3.8",
        "The harder the launch, the further the slider moves from its start, and the later it settles into a decay.",
        runs,
        SLIDER,
        Statement(
            "As would be expected the response for [T0 = 2 x 10^8] takes longer before it settles and then starts a "
            "steady state decay.",
            text("3.2.2, L2155-2159"),
            f"time from the end of the torque until u stays within {ALIKE:g} of the steady decay (as at Fig 3.10), relative "
            "to the longest such time with the other torques; from then on, mean of u relative to the turn before",
            SIGN,
            _settled(),
        ),
        Statement(
            "The three responses show the slider oscillates between its initial position and the crank shaft and as "
            "would be expected the shift from its initial position is greatest in the highest input torque case.",
            text("3.2.2, L2159-2167"),
            "greatest u, relative to the greatest size of u in the graph; least u of the three responses (the shaft is at "
            f"{shaft:g} cm). For *shift*: size of the mean of u over the turns after the torque, up to 1 s, with T0 = 2e8 "
            "dyn.cm relative to the greater of the two others",
            f"{ALIKE_WORDS}; {SIGN}",
            (
                *(
                    at_most(
                        f"greatest u; {label}",
                        ALIKE,
                        run["slider.position"].max() / largest,
                        why="after the weakest launch the slider moves to both sides of its start",
                    )
                    for label, run in runs.items()
                ),
                at_least(
                    "least u of all",
                    shaft,
                    CM_PER_METRE * min(run["slider.position"].min() for run in runs.values()),
                    "cm",
                ),
                at_least("mean of u", 1.0, shift / max(lesser)),
            ),
        ),
    )


def launch_speeds_by_spring() -> StudyResult:
    """Compute the crank speed after launches with the three springs."""
    rises = {label: run_acceleration(1e8, k) for label, k in zip(_spring_runs(), STIFFNESSES)}
    speeds = np.array([run["crank.speed"] for run in rises.values()])
    loads = np.array([np.hypot(run["pin.C.fx"], run["pin.C.fy"]) for run in rises.values()])
    undamped = {label: _launches(1e8, k) for label, k in zip(rises, STIFFNESSES)}
    return _launch_result(
        "3.9",
        "The speed rises linearly, with all springs alike, until the torque no longer accelerates the crank.",
        _spring_runs(),
        CRANK_SPEED,
        Statement(
            "The figure shows the crank speed increasing linearly up to the point when the torque input becomes "
            "smaller than the torque required to accelerate the mechanism.",
            text("3.2.2, L2175-2181"),
            RISE,
            ALIKE_WORDS,
            _rise_cases(rises),
        ),
        Statement(
            "The speed fluctuates when the torque is removed and then decays due to the viscous dissipation of "
            "energy in the slider guide.",
            text("3.2.2, L2181-2185"),
            "least range of the crank speed in a turn divided by its mean, up to 1 s; greatest mean speed of a turn in the "
            "second half of 3 s (our choice), relative to that of the first turn, without the damper and with it, as at Fig "
            "3.6",
            LOSS,
            (_swing_cases(_spring_runs(), 1.0)[0], *_damper_cases(undamped, 1.0)),
            _undamped_range(undamped, 1.0),
        ),
        Statement(
            "Because the speed response is the same throughout the time region in which the torque acts, it suggests "
            "similar loads and movement of slider.",
            text("3.2.2, L2187-2191"),
            "spread between the springs of the crank speed and, for the loads, of the force at pin C, at equal fractions of "
            "the time to 1 rad, each relative to its peak. The slider's movement is judged at Fig 3.10",
            f"{ALIKE_WORDS}; {ABOUT:g}, the rule for *similar*",
            (
                at_most("crank speed", ALIKE, np.ptp(speeds, axis=0).max() / speeds.max()),
                at_most("force", ABOUT, np.ptp(loads, axis=0).max() / loads.max()),
            ),
        ),
    )


def launch_positions_by_spring() -> StudyResult:
    """Compute the slider position after launches with the three springs."""
    runs = _spring_runs()
    apart = np.ptp([run_acceleration(1e8, k)["slider.position"] for k in STIFFNESSES], axis=0).max()
    apart /= np.ptp([run_acceleration(1e8, k)["slider.position"] for k in STIFFNESSES])
    settled, by_torque = [settling(1e8, k) for k in STIFFNESSES], [settling(torque, 1e6) for torque in TORQUES]
    times = {name: [x.time for x in settlings] for name, settlings in (("springs", settled), ("torques", by_torque))}
    return _launch_result(
        "3.10",
        "The slider moves alike with all springs while the torque acts. A transient follows, whose duration depends on "
        "spring and torque, and then a steady decay.",
        runs,
        SLIDER,
        Statement(
            "... similar loads and movement of slider. The latter is verified in Fig. (3.10) in which the slider response is "
            "shown.",
            text("3.2.2, L2191-2195"),
            "spread of u between the springs, at equal fractions of the time to 1 rad, relative to its range in that time",
            f"{ABOUT:g}, the rule for *similar*",
            (at_most("greatest", ABOUT, apart),),
        ),
        Statement(
            "Fig. (3.10) also shows that as the torque is [r]emoved a transient free motion response prevails after "
            "which occurs a free motion steady state decay which is studied in the next section.",
            text("3.2.2, L2195-2201"),
            "distance of u from its steady decay, relative to the range in a turn, in the first turn after the torque and "
            "in the last turn within 1 s. The steady decay is u of a free crank at equal crank angle and mean speed, "
            f"released at {RELEASED[STIFF]:g} rpm, or with k = 5e5 dyn/cm at {RELEASED[SOFT]:g} (our choice). Then the mean "
            f"of u relative to the turn before, once u is within {ALIKE:g} of that decay",
            f"{ALIKE_WORDS}; {SIGN}",
            (
                *(
                    case
                    for label, x in zip(runs, settled)
                    for case in (
                        at_least(f"{label}, first turn", ALIKE, x.first),
                        at_most(f"{label}, last turn", ALIKE, x.last),
                    )
                ),
                at_most(DECAY, 1.0, max(x.decay for x in settled)),
            ),
        ),
        Statement(
            "The duration of the transient free motion stage depends on the stiffness k and the initial input torque "
            "values.",
            text("3.2.2, L2201-2205"),
            f"time from the end of the torque until u stays within {ALIKE:g} of the steady decay, as in the row before; the "
            "longest time divided by the shortest",
            f"more than {1.0 + ALIKE:g}, the rule for *the same*",
            tuple(at_least(f"of the three {name}", 1.0 + ALIKE, max(x) / min(x)) for name, x in times.items()),
        ),
    )


# --- Free motion: 3.11 to 3.14


BOTH = {f"k = {plain(k)} dyn/cm": k for k in (SOFT, STIFF)}


def _coast_result(
    number: str, claim: str, run: Trajectory, columns: Mapping[str, NDArray[np.float64]], *statements: Statement
) -> StudyResult:
    """Build the result of a free motion from its columns, up to the last turn that the figure shows."""
    turns = Turns.from_run(run)
    last = int(np.searchsorted(run.time, turns.ends[turns.shown - 1]))
    return StudyResult(
        number=number,
        claim=claim,
        assignment=(
            "The text does not say at which crank angle the torque is removed, nor how long the motion is followed. We "
            "remove it at 0 from the steady motion, and follow the motion until the mean crank speed falls below "
            f"{HARMONIC_SPEED:g} rad/s, which the text names."
        ),
        columns={name: values[: last + 1] for name, values in columns.items()},
        statements=statements,
    )


def free_speed(number: str, stiffness: float) -> StudyResult:
    """Compute the crank speed over the crank angle in free motion."""
    run = coast(stiffness)
    return _coast_result(
        number,
        "The speed of the free crank oscillates; the oscillation and the mean decrease.",
        run,
        {
            "turns of the crank [1]": run["crank.angle"] / (2.0 * pi),
            f"crank speed; k = {plain(stiffness)} dyn/cm [rad/s]": run["crank.speed"],
        },
        _free_swings() if stiffness == SOFT else _free_causes(),
    )


def _free_swings() -> Statement:
    """Judge what Fig 3.11 and 3.12 show according to the thesis."""
    turns = {label: Turns.from_run(coast(k)) for label, k in BOTH.items()}
    return Statement(
        "Both figures show that (1) The crank speed behaviour is oscillatory (2) The amplitude of oscillations "
        "decreases with crank angle and (3) The mean position of oscillation reduces with crank angle.",
        text("3.3, L2241-2251"),
        "least range of the crank speed in a turn, divided by its mean; range and mean relative to the turn before, each at "
        "its greatest; all turns in 10 s (our choice)",
        f"{ALIKE:g}, the rule for *steady*; {SIGN}",
        tuple(
            case
            for label, t in turns.items()
            for case in (
                at_least(f"range over the mean; {label}", ALIKE, (t.speed_range / t.speed).min()),
                at_most(f"range, turn to turn; {label}", 1.0, greatest_ratio(t.speed_range)),
                at_most(f"mean, turn to turn; {label}", 1.0, greatest_ratio(t.speed)),
            )
        ),
    )


def _free_causes() -> Statement:
    """Judge the causes that the thesis gives for what Fig 3.11 and 3.12 show."""
    undamped = {label: (coast(k, 0.0), coast(k)) for label, k in BOTH.items()}
    swings = [
        at_most(f"change of the kinetic energy; {label}", 0.5, t.energy_share[: t.shown].max())
        for label, t in ((label, Turns.from_run(coast(k))) for label, k in BOTH.items())
    ]
    return Statement(
        "The oscillatory behaviour of the speed is due to the non-linearities of the system and the reduction in "
        "speed is due to viscous dissipation of energy in the slider.",
        text("3.3, L2253-2259"),
        "*the non-linearities* are read as the change of the inertia with the position. First the relative range of the "
        f"kinetic energy in a turn divided by that of the crank speed squared, the greatest down to {HARMONIC_SPEED:g} "
        "rad/s: this is the part of the oscillation that they do not explain. Then the greatest mean speed of a turn in the "
        "second half of 4 s (our choice), relative to that of the first turn, without the damper and with it, as at Fig 3.6",
        f"at most half, as *due to* says; {LOSS}",
        (*swings, *_damper_cases(undamped, 0.0)),
        _undamped_range(undamped, 0.0),
    )


def draw_free_speed(result: StudyResult) -> Figure:
    """Draw the crank speed over the crank angle."""
    turns, speed = result.columns.values()
    curve, across = Curve(x=turns, y=speed), (0.0, float(turns[-1]))
    panel = Panel(x_label="turns of the crank", y_label="crank speed [rad/s]", curves=[curve], x_range=across)
    return plot_curves([panel], title=result.heading)


def _phase_plane(number: str, stiffness: float, *statements: Statement) -> StudyResult:
    """Compute the slider's phase plane in free motion."""
    run, label = coast(stiffness), f"k = {plain(stiffness)} dyn/cm"
    return _coast_result(
        number,
        "The slider tends to u = 0 and u' = 0 with decreasing oscillations, a drift, and higher harmonics.",
        run,
        {
            f"slider position u; {label} [cm]": CM_PER_METRE * run["slider.position"],
            f"slider velocity; {label} [cm/s]": CM_PER_METRE * run["slider.velocity"],
        },
        *statements,
    )


def order_of_chords(run: Trajectory) -> float:
    """Return the order, in the sampling step, with which the distance between phase-plane curve and chords decreases."""
    turns = Turns.from_run(run)
    shown = run.time < turns.ends[turns.shown - 1]
    u, v = (run[f"slider.{name}"][shown] for name in ("position", "velocity"))
    z = u / np.ptp(u) + 1j * v / np.ptp(v)
    coarse, fine = (float(np.abs(z[n::n] + z[:-n:n] - 2.0 * z[n // 2 : -n // 2 : n]).max()) for n in (4, 2))
    return float(np.log2(coarse / fine))


def soft_phase_plane() -> StudyResult:
    """Compute the phase plane with the soft spring, and judge the statements on Fig 3.13 and 3.14."""
    turns = {label: Turns.from_run(coast(k)) for label, k in BOTH.items()}
    drift, distance = (
        a / b for a, b in zip(*((np.ptp(t.slider[: t.shown]), abs(t.slider[0])) for t in turns.values()))
    )
    tending = [
        at_most(f"{name}; {label}", 1.0, greatest_ratio(np.abs(x[2 : t.shown])))
        for label, t in turns.items()
        for name, x in (("range", t.slider_range), ("mean", t.slider), ("range of u'", t.velocity_range))
    ]
    drifts = [
        at_least(f"drift; {label}", ALIKE, np.ptp(t.slider[: t.shown]) / t.slider_range[: t.shown].max())
        for label, t in turns.items()
    ]
    return _phase_plane(
        "3.13",
        SOFT,
        Statement(
            "Due to sampling of output data straight-line segments appear on the curves. These segments should in "
            "fact be smooth curves following the line pattern of the curves and appear as straight lines only because no "
            "points were sampled between the end points of each segment.",
            text("3.3, L2266-2276"),
            "order, in the time between samples, of the greatest distance of the curve from the middle of a straight "
            "segment, with u and u' relative to their ranges; samples 2 and 1 ms apart (our choice)",
            "order 2, as for a smooth curve (at a corner it is 1); 0.05, since an order is a whole number",
            (
                Case(
                    label="straight segments",
                    computed=None,
                    why="the segments are in the drawing, which our copy lacks",
                ),
                *(near(f"smooth; {label}", 2.0, order_of_chords(coast(k)), 0.05) for label, k in BOTH.items()),
            ),
        ),
        Statement(
            "Both figures show the tendency of the phase plane plot towards the region u=[0, u'=0]. In so doing the "
            "amplitude of the oscillation decreases and a superimposed shift on the slider position, in the form of "
            "a drift towards u=[0], is noticeable.",
            text("3.3, L2276-2287"),
            "range of u and u' and distance of the mean of u from 0, relative to the turn before: the greatest values from "
            "the fourth turn on (our choice), since the release causes a transient. Then the drift of the mean of u over "
            "the turns drawn, relative to the greatest range of u in a turn",
            f"{SIGN}; more than {ALIKE:g}, the rule for what is seen on a graph",
            (*tending, *drifts),
        ),
        Statement(
            "Th[e] drift is greater in Fig. (3.13) due to the value of k being smaller which puts the mean position "
            "of oscillation further away from u=[0].",
            text("3.3, L2287-2293"),
            "drift of the mean of u over the turns drawn, and distance of this mean from 0 in the first turn, relative to "
            "those with k = 2e6 dyn/cm",
            SIGN,
            (at_least("drift", 1.0, drift), at_least("distance", 1.0, distance)),
        ),
        Statement(
            "Non-linear effects leading to higher harmonics in the slider motion are clearly shown in both figures.",
            text("3.3, L2293-2297"),
            "higher harmonics of u (root of the sum of their squares) divided by the first harmonic, the least of the turns "
            "drawn. Then this ratio divided by the ratio that the equation linear in u gives for the same motion of the "
            "crank, the greatest: *non-linear* is read as non-linear in u, since chapter IV linearises in u (L2361)",
            f"more than {SMALL:g}, the rule for *small*; more than {1.0 + ALIKE:g}, the rule for *the same*, for a non-linear "
            "effect",
            (
                *(at_least(label, SMALL, drawn_harmonics(k).min()) for label, k in BOTH.items()),
                *(at_least(f"non-linear; {label}", 1.0 + ALIKE, harmonics_over_linear(k)) for label, k in BOTH.items()),
            ),
            "the equation linear in u has these harmonics too, because the geometry of the linkage forces them",
        ),
    )


@cache
def linear_motion(stiffness: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Integrate the slider's equation, linearised about u = u' = 0, along the free crank's motion; return th2 (rad), u (m)."""
    run, p, turns = coast(stiffness), table_3_1(stiffness).constants(), Turns.from_run(coast(stiffness))
    # half a turn beyond those that are drawn
    n = int(np.searchsorted(run["crank.angle"], 2.0 * pi * (turns.shown + 0.5)))
    time, crank = run.time[:n], [run[f"crank.{name}"][:n] for name in ("angle", "speed", "acceleration")]

    def acceleration(crank_state: Sequence[float], u: float, v: float) -> float:
        angle, speed, rate = crank_state
        g = kinematics.position(angle, u, p)
        inputs = dynamics.NO_INPUTS._replace(speed_drive=1.0, acceleration=rate)
        return dynamics.motion(
            g, kinematics.coefficients(g, p), (angle, u, speed, v, 0.0, 0.0), inputs, p
        ).slider_acceleration

    du, dv = 1e-6, 1e-5
    terms = CubicSpline(
        time,
        [
            (
                acceleration(at, 0.0, 0.0),
                (acceleration(at, du, 0.0) - acceleration(at, -du, 0.0)) / (2.0 * du),
                (acceleration(at, 0.0, dv) - acceleration(at, 0.0, -dv)) / (2.0 * dv),
            )
            for at in np.transpose(crank).tolist()
        ],
    )

    def derivative(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        force, by_position, by_velocity = terms(t)
        return np.array([y[1], force + by_position * y[0] + by_velocity * y[1]])

    start = [run["slider.position"][0], run["slider.velocity"][0]]
    found = solve_ivp(derivative, (0.0, time[-1]), start, t_eval=time, rtol=1e-8, atol=1e-10, max_step=2e-3)
    return crank[0], found.y[0]


def higher_harmonics(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the root sum square of the second and all higher harmonics, relative to the first, for each row of samples."""
    sizes = np.abs(np.fft.rfft(turns, axis=1))
    ratios: NDArray[np.float64] = np.linalg.norm(sizes[:, 2:], axis=1) / sizes[:, 1]
    return ratios


def drawn_harmonics(stiffness: float) -> NDArray[np.float64]:
    """Return the `higher_harmonics` of u in each turn that the figure shows."""
    run = coast(stiffness)
    return higher_harmonics(turn_by_turn(run, "slider.position", 0.0))[: Turns.from_run(run).shown]


def harmonics_over_linear(stiffness: float) -> float:
    """Return the greatest ratio of `drawn_harmonics` to the higher harmonics of the linear motion in the same turn."""
    found = drawn_harmonics(stiffness)
    return float((found / higher_harmonics(sample_turns(*linear_motion(stiffness)))[: len(found)]).max())


def stiff_phase_plane() -> StudyResult:
    """Compute the phase plane with the stiff spring, whose higher harmonics the thesis explains by a resonance."""
    soft, stiff = (Turns.from_run(coast(k)) for k in (SOFT, STIFF))
    # the mean speed falls from turn to turn
    seen = [float(np.interp(-HARMONIC_SPEED, -t.speed, t.second / t.first)) for t in (stiff, soft)]
    # the speeds at which the second harmonic is greatest: over the first, and over its force
    most, resonance = (stiff.speed[(stiff.second / by).argmax()] for by in (stiff.first, stiff.speed**2))
    parameters, over_turn = table_3_1(STIFF), half_natural_frequencies(STIFF)
    half = 0.5 * natural_frequency(parameters)
    # an oscillator with this damping ratio swings most at sqrt(1 - 2 ratio^2) of its natural frequency
    ratio = parameters.slider_damping * half / parameters.slider_stiffness
    lowered = 1.0 - np.sqrt(1.0 - 2.0 * ratio**2)
    return _phase_plane(
        "3.14",
        STIFF,
        Statement(
            "However, these non-linearities are more manifested in Fig. (3.14) around the crank angular speed of 27 "
            "rad/sec.",
            text("3.3, L2297-2301"),
            "second harmonic of u divided by the first (our measure) at a mean crank speed of 27 rad/s, relative to that "
            "with k = 5e5 dyn/cm. Then the speeds at which this ratio, and the second harmonic divided by the speed "
            f"squared, are greatest; the motion is followed beyond the plot, down to {stiff.speed[-1]:.1f} rad/s",
            f"{SIGN}; {100 * ABOUT:g} %, the rule for *around*",
            (
                at_least("at 27 rad/s", 1.0, seen[0] / seen[1]),
                near("speed, over the speed squared", "27", resonance, ABOUT * HARMONIC_SPEED, "rad/s"),
                near(
                    "speed, over the first",
                    "27",
                    most,
                    ABOUT * HARMONIC_SPEED,
                    "rad/s",
                    why=(
                        f"the ratio goes on growing down to {most:.0f} rad/s, because the damper lowers and broadens the "
                        "resonance"
                    ),
                ),
            ),
        ),
        Statement(
            "This speed is in fact an approximation to half the natural frequency of the system.",
            text("3.3, L2301-2305"),
            "half the natural frequency, computed with the mean effective mass of a turn, at u = 0; k = 2e6 dyn/cm",
            f"{ABOUT:g}, the rule for *approximately*",
            (near("", "27", half, 27.0 * ABOUT, "rad/s"),),
        ),
        Statement(
            "This suggests that the non-linearity is a second subharmonic resonance.",
            text("3.3, L2305-2307"),
            "*subharmonic* is read as a resonance of the second harmonic at half the natural frequency. First the mean "
            "crank speed at which this harmonic divided by the speed squared is greatest, relative to the frequency of the "
            "row before; the force of the harmonic grows with the speed squared. Then the higher harmonics relative to "
            "those by the equation linear in u, as at Fig 3.13",
            f"{lowered:.3f} below 1, by which the damper of the thesis lowers the peak of an oscillator; more than "
            f"{1.0 + ALIKE:g}, the rule for *the same*, for a non-linearity",
            (
                Case(label="resonance", computed=resonance / half, lower=1.0 - lowered, upper=1.0),
                at_least("non-linearity", 1.0 + ALIKE, harmonics_over_linear(STIFF)),
            ),
            "the equation linear in u has this resonance too: the second harmonic of the force meets the natural frequency",
        ),
        Statement(
            "It is however appreciated that a natural frequency of the mechanism in study is not a sharply defined "
            "value but extends over a range. This is due to the variable mass and inertia of the mechanism "
            "experienced by the slider.",
            text("3.3, L2307-2317"),
            "natural frequency with the least effective mass of a turn, divided by that with the greatest, at u = 0; k = "
            "2e6 dyn/cm",
            f"more than {ALIKE:g}, the rule for *the same*",
            (at_least("", 1.0 + ALIKE, over_turn.max() / over_turn.min()),),
        ),
    )


def draw_phase_plane(result: StudyResult) -> Figure:
    """Draw the slider velocity over the position, with the start S and the finish F."""
    u, v = result.columns.values()
    start = Curve(x=u[:1], y=v[:1], colour="black", line="", marker="s", label="S, start")
    finish = Curve(x=u[-1:], y=v[-1:], colour="black", line="", marker="o", label="F, finish")
    panel = Panel(
        x_label="slider position u [cm]",
        y_label="slider velocity [cm/s]",
        curves=[Curve(x=u, y=v, width=0.7), start, finish],
        legend_at="outside",
    )
    return plot_curves([panel], title=result.heading, size=(6.4, 4.6))


_draw_by_torque = partial(draw_launches, TORQUES, r"$T_0$ [dyn cm]")
_draw_by_spring = partial(draw_launches, STIFFNESSES, "stiffness k [dyn/cm]")
#: The studies of 3.6 to 3.14.
STUDIES = (
    Study("3.6", launch_speeds, _draw_by_torque),
    Study("3.7", torque_over_time, draw_torque_over_time),
    Study("3.8", launch_positions, _draw_by_torque),
    Study("3.9", launch_speeds_by_spring, _draw_by_spring, sweeps=("slider.stiffness",)),
    Study("3.10", launch_positions_by_spring, _draw_by_spring, sweeps=("slider.stiffness",)),
    Study("3.11", partial(free_speed, "3.11", SOFT), draw_free_speed),
    Study("3.12", partial(free_speed, "3.12", STIFF), draw_free_speed),
    Study("3.13", soft_phase_plane, draw_phase_plane),
    Study("3.14", stiff_phase_plane, draw_phase_plane),
)
