"""Figures 3.6 to 3.14: the crank accelerated by a torque, and the crank in free motion.

In a launch T0 t^2 is nearly constant, not T0 t, and below a least T0 the crank falls back. In free motion the second
harmonic of the slider has a resonance near half the natural frequency; the damper lowers its speed and broadens it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import InitialState
from linkwork.five_bar.published import DYN_CM_PER_NEWTON_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import natural_frequency
from ...run import Event, Inputs, TorsionBar, Trajectory, simulate
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, near, padded, text, unjudged
from .runs import LINEAR, ON_THE_GRAPH, SPEED, STIFFNESSES, greatest_ratio, plain, scientific, table_3_1

#: Torques of Fig 3.6 to 3.8, and those of the curve of 3.7 (dyn.cm).
TORQUES = (1e7, 1e8, 2e8)
TORQUE_RANGE = np.geomspace(TORQUES[0], TORQUES[-1], 14)
#: Springs of the free motion (dyn/cm).
SOFT, STIFF = 5e5, 2e6
#: Crank speed near which the thesis sees higher harmonics, and the range that counts as near (rad/s).
HARMONIC_SPEED, ABOUT = 27.0, 2.7
#: Crank angles in a turn of a free crank.
SAMPLES = 256
#: Quantity of a plot: its name on the axis, output, factor to its unit, unit.
Quantity = tuple[str, str, float, str]
SLIDER: Quantity = ("slider position u", "slider.position", CM_PER_METRE, "cm")
CRANK_SPEED: Quantity = ("crank speed", "crank.speed", 1.0, "rad/s")
TIME = "time [s]"
#: Our choices in the launches.
UNSAID = (
    "The text gives neither the damper of the launches nor, with three torques, the spring: here the damper of Fig 3.4 and the "
    "middle one of its springs."
)


@cache
def launch(torque: float, stiffness: float = 1e6, stop_time: float = 1.0, samples: int = 2000) -> Trajectory:
    """Run Table 3.1 from rest under T = T0 (1 - th2) up to 1 rad, then without torque; an event marks the release."""
    return simulate(
        table_3_1(stiffness),
        Inputs(torque=TorsionBar(torque=torque / DYN_CM_PER_NEWTON_METRE)),
        stop_time=stop_time,
        step=stop_time / samples,
        events=(Event(name="release", output="crank.angle", level=1.0, direction=1),),
    )


def release_time(torque: float, stiffness: float = 1e6, stop_time: float = 1.0) -> float:
    """Return the time from rest to th2 = 1 rad (s); infinite if the crank falls back before."""
    events = launch(torque, stiffness, stop_time).events
    return events[0].time if events else np.inf


def accelerated(torque: float, stiffness: float = 1e6) -> Trajectory:
    """Return a launch up to the end of its torque."""
    return launch(torque, stiffness, release_time(torque, stiffness), 1000)


def least_torque() -> float:
    """Find the least T0 (dyn.cm) that turns the crank by 1 rad, to half a per cent."""
    low, high = 1e5, 1e7
    while high / low > 1.01:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if np.isfinite(release_time(middle, stop_time=3.0)) else (middle, high)
    return float(np.sqrt(low * high))


@cache
def coast(stiffness: float) -> Trajectory:
    """Run Table 3.1 without torque, from its steady motion at 420 rpm at crank angle 0."""
    period, speed = 60.0 / SPEED, SPEED * RAD_S_PER_RPM
    steady = simulate(table_3_1(stiffness), Inputs(speed=speed), stop_time=20.0 * period, step=period)
    u, v = (float(steady[name][-1]) for name in ("slider.position", "slider.velocity"))
    initial = InitialState(crank_speed=speed, slider_position=u, slider_velocity=v)
    return simulate(table_3_1(stiffness), initial=initial, stop_time=10.0, step=5e-4)


@dataclass(frozen=True, slots=True)
class Turns:
    """Statistics of each whole turn of a free crank, from samples at equal crank angles.

    Attributes
    ----------
    ends : ndarray
        Time at which each ends (s).
    speed, speed_range : ndarray
        Crank speed: 2 pi over the time of the turn, and its range (rad/s).
    slider, slider_range : ndarray
        Slider position: mean and range (cm).
    first, second : ndarray
        Harmonics of the crank's turn in the slider position (cm).
    energy_share : ndarray
        Relative range of the mechanical energy over that of the crank speed squared.
    """

    ends: NDArray[np.float64]
    speed: NDArray[np.float64]
    speed_range: NDArray[np.float64]
    slider: NDArray[np.float64]
    slider_range: NDArray[np.float64]
    first: NDArray[np.float64]
    second: NDArray[np.float64]
    energy_share: NDArray[np.float64]

    @classmethod
    def of(cls, run: Trajectory, start: float = 0.0) -> Turns:
        """Divide a run into turns from a crank angle (rad) on."""
        angle = run["crank.angle"]
        marks = np.arange(start, angle[-1], 2.0 * pi)
        times = np.interp(marks, angle, run.time)
        grid = marks[:-1, None] + np.linspace(0.0, 2.0 * pi, SAMPLES, endpoint=False)
        energy = run["energy.kinetic"] + run["energy.potential"]
        u, w, e = (np.interp(grid, angle, x) for x in (run["slider.position"], run["crank.speed"], energy))
        harmonics = 2.0 * CM_PER_METRE / SAMPLES * np.abs(np.fft.rfft(u, axis=1))
        return cls(
            ends=times[1:],
            speed=2.0 * pi / np.diff(times),
            speed_range=np.ptp(w, axis=1),
            slider=CM_PER_METRE * u.mean(axis=1),
            slider_range=CM_PER_METRE * np.ptp(u, axis=1),
            first=harmonics[:, 1],
            second=harmonics[:, 2],
            energy_share=np.ptp(e, axis=1) / e.mean(axis=1) / np.ptp(w * w, axis=1) * (w * w).mean(axis=1),
        )

    @property
    def transient(self) -> int:
        """Number of turns until the mean slider position is furthest from its start, after which it decays."""
        return int(np.abs(self.slider).argmax())

    @property
    def shown(self) -> int:
        """Number of turns until the mean crank speed falls below `HARMONIC_SPEED`."""
        return 1 + int(np.argmax(self.speed < HARMONIC_SPEED))


def half_natural_frequencies(stiffness: float) -> NDArray[np.float64]:
    """Return half the slider's natural frequency (rad/s) with the effective mass at each crank angle, at u = 0."""
    parameters = table_3_1(stiffness)
    p = parameters.constants()
    places = (kinematics.position(angle, 0.0, p) for angle in np.linspace(0.0, 2.0 * pi, 721).tolist())
    masses = [dynamics.inertia(g, kinematics.coefficients(g, p), p).m22 for g in places]
    return 0.5 * np.sqrt(parameters.slider_stiffness / np.array(masses))


def _energy_verdict(*runs: Trajectory) -> Verdict:
    """Judge the residual of the energy balance relative to the largest energy of the runs."""
    worst = max(
        float(np.abs(run["energy.residual"]).max() / max(run["energy.supplied"].max(), run["energy.kinetic"].max()))
        for run in runs
    )
    return at_most("residual of the energy balance, relative to the energy in play", OURS, 1e-7, worst)


# --- Launches: 3.6 to 3.10


def _by_torque() -> dict[str, Trajectory]:
    return {f"T0 = {plain(torque)} dyn.cm": launch(torque) for torque in TORQUES}


def _by_spring() -> dict[str, Trajectory]:
    return {f"k = {plain(k)} dyn/cm": launch(1e8, k) for k in STIFFNESSES}


def _launch_result(
    number: str, claim: str, runs: Mapping[str, Trajectory], quantity: Quantity, *verdicts: Verdict
) -> StudyResult:
    """Build the result of launches: a quantity over time, and the times at which the torques end."""
    name, output, factor, unit = quantity
    columns = {TIME: next(iter(runs.values())).time}
    columns |= {f"{name}; {label} [{unit}]": factor * run[output] for label, run in runs.items()}
    columns |= {f"end of the torque; {label} [s]": np.array([run.events[0].time]) for label, run in runs.items()}
    every = (*verdicts, _energy_verdict(*runs.values()))
    return StudyResult(number=number, claim=claim, assignment=UNSAID, columns=padded(columns), verdicts=every)


def draw_launches(values: Sequence[float], legend: str, result: StudyResult) -> Figure:
    """Draw a quantity over time, with a circle at 1 rad, where the torque ends."""
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


def _rise_verdicts(runs: Sequence[Trajectory], place: str) -> list[Verdict]:
    """Judge whether the crank speed rises along a line, and whether it peaks before the torque ends."""
    bows, angles = [], []
    for run in runs:
        peak = int(run["crank.speed"].argmax())
        w, t = run["crank.speed"][: peak + 1], run.time[: peak + 1]
        bows.append(np.abs(w / w[-1] - t / t[-1]).max())
        angles.append(run["crank.angle"][peak])
    line, end = "crank speed's distance from a line up to its peak, over the peak", "crank angle of the peak, greatest"
    return [at_most(line, text(place), LINEAR, max(bows)), at_most(end, text(place), 1.0, max(angles), "rad")]


def _swing_verdicts(runs: Iterable[Trajectory], start: float, places: tuple[str, str, str]) -> list[Verdict]:
    """Judge whether a free crank swings in speed, slows down on average, and loses energy to the damper alone."""
    swings, falls, shares = [], [], []
    for run in runs:
        turns, free = Turns.of(run, start), run["crank.angle"] >= start
        energy = (run["energy.kinetic"] + run["energy.potential"])[free]
        swings.append((turns.speed_range / turns.speed).min())
        falls.append(greatest_ratio(turns.speed))
        shares.append(np.ptp(run["energy.dissipated"][free]) / (energy[0] - energy[-1]))
    swing, fall, share = min(swings), max(falls), min(shares)
    return [
        at_least("range of the crank speed over its mean, least of all turns", text(places[0]), 0.1, swing),
        at_most("mean crank speed relative to the turn before, greatest", text(places[1]), 1.0, fall),
        near("part of the energy's fall that the damper takes", text(places[2]), 1.0, share, 1e-6),
    ]


def _after(runs: Mapping[str, Trajectory]) -> list[Turns]:
    """Return the turns after the torque has ended."""
    return [Turns.of(run, start=1.0) for run in runs.values()]


def _decay_verdict(turns: Sequence[Turns], place: str) -> Verdict:
    """Judge whether the mean position decays after the transient."""
    decay = max(greatest_ratio(t.slider[t.transient :]) for t in turns)
    return at_most("mean of u relative to the turn before, after the transient", text(place), 1.0, decay)


def launch_speeds() -> StudyResult:
    """Compute the crank speed after launches with the three torques."""
    return _launch_result(
        "3.6",
        "The speed rises linearly until the torque no longer accelerates the crank, then swings and decays.",
        _by_torque(),
        CRANK_SPEED,
        *_rise_verdicts([accelerated(torque) for torque in TORQUES], "L2124-2134"),
        *_swing_verdicts(_by_torque().values(), 1.0, ("L2147", "L2147", "L2149")),
        near("crank speed at 0.25 s; T0 = 1e8", OURS, 72.7805553, launch(1e8)["crank.speed"][500], 5e-8, "rad/s"),
    )


def torque_over_time() -> StudyResult:
    """Compute the time to 1 rad over the torque, its exponent, and the least sufficient torque."""
    time = np.array([release_time(float(torque)) for torque in TORQUE_RANGE])
    slope = float(np.mean(np.diff(np.log(TORQUES)) / np.diff(np.log([release_time(torque) for torque in TORQUES]))))
    fitted = np.polyfit(np.log(time), np.log(TORQUE_RANGE), 1)[0]
    constant = TORQUE_RANGE * time**2
    nearly, falls = "T0 t^2 is nearly constant", "below it the crank falls back"
    return StudyResult(
        number="3.7",
        claim="T0 is hyperbolic in the time to 1 rad, with the axes as asymptotes.",
        assignment=UNSAID,
        columns={"T0 [dyn.cm]": TORQUE_RANGE, "time to 1 rad [s]": time, "T0 t^2 [dyn.cm.s2]": constant},
        verdicts=(
            near("exponent of T0 in the time to 1 rad", text("L2140"), -1.0, slope, 0.05, why=nearly),
            near("T0 as the time grows", text("L2142"), 0.0, least_torque(), 5e5, "dyn.cm", why=falls),
            near("time to 1 rad as T0 grows: 1e12 dyn.cm", text("L2142"), 0.0, release_time(1e12), 1e-3, "s"),
            near("exponent, mean of the two between the three torques", OURS, -1.95, slope, 0.005),
            near("exponent, fitted to all of the curve", OURS, -1.95, fitted, 0.02),
            at_most("spread of T0 t^2 over a factor of 20 in T0", OURS, 0.15, np.ptp(constant) / constant.mean()),
            near("time to 1 rad; T0 = 1e8 dyn.cm", OURS, 0.02137446194, release_time(1e8), 1e-10, "s"),
        ),
    )


def draw_torque_over_time(result: StudyResult) -> Figure:
    """Draw the torque over time, on linear and logarithmic axes, with lines of exponent -1 and -2 through T0 = 1e8."""
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


def _reference_position() -> Verdict:
    u = CM_PER_METRE * launch(1e8)["slider.position"][500]
    return near("u at 0.25 s; T0 = 1e8 dyn.cm, k = 1e6 dyn/cm", OURS, -0.611604, u, 5e-8, "cm")


def launch_positions() -> StudyResult:
    """Compute the slider position after launches with the three torques."""
    runs = _by_torque()
    turns = _after(runs)
    largest = max(float(np.abs(run["slider.position"]).max()) for run in runs.values())
    later = turns[2].transient - max(t.transient for t in turns[:2])
    shift = turns[2].slider.mean() / turns[1].slider.mean()
    verdicts = [
        at_least("turns until u decays, T0 = 2e8 less the lower ones", text("L2157"), 1.0, later, "turns"),
        at_least("mean of u, T0 = 2e8 relative to T0 = 1e8 dyn.cm", text("L2165"), 1.0, shift),
    ]
    for label, run in runs.items():
        u, within = CM_PER_METRE * run["slider.position"].max(), CM_PER_METRE * ON_THE_GRAPH * largest
        statement, why = f"greatest u; {label}", "" if u < within else "it swings to both sides"
        verdicts.append(near(statement, text("L2161"), 0.0, u, within, "cm", why=why))
    verdicts.append(_decay_verdict(turns, "L2159"))
    claim = "The harder the launch, the further the slider moves from its start, and the later it settles to a decay."
    return _launch_result("3.8", claim, runs, SLIDER, *verdicts, _reference_position())


def launch_speeds_by_spring() -> StudyResult:
    """Compute the crank speed after launches with the three springs."""
    rises = [accelerated(1e8, k) for k in STIFFNESSES]
    speeds = np.array([run["crank.speed"] for run in rises])
    apart, angle = np.ptp(speeds, axis=0).max() / speeds.max(), launch(1e8)["crank.angle"][500]
    return _launch_result(
        "3.9",
        "The speed rises linearly, with all springs alike, until the torque no longer accelerates the crank.",
        _by_spring(),
        CRANK_SPEED,
        *_rise_verdicts(rises, "L2175-2181"),
        at_most("spread of the crank speed while the torque acts", text("L2187"), ON_THE_GRAPH, apart),
        *_swing_verdicts(_by_spring().values(), 1.0, ("L2181", "L2183", "L2185")),
        near("crank angle at 0.25 s; T0 = 1e8 dyn.cm, k = 1e6 dyn/cm", OURS, 17.8051227, angle, 5e-8, "rad"),
    )


def launch_positions_by_spring() -> StudyResult:
    """Compute the slider position after launches with the three springs."""
    runs = _by_spring()
    apart = np.ptp([accelerated(1e8, k)["slider.position"] for k in STIFFNESSES], axis=0).max()
    apart /= np.ptp([run["slider.position"] for run in runs.values()])
    springs, torques = (np.ptp([t.transient for t in _after(each)]) for each in (runs, _by_torque()))
    longer = "turns until u decays, longest less shortest of the three {}".format
    return _launch_result(
        "3.10",
        "The slider moves alike with all springs while the torque acts; a transient follows, whose duration depends on spring "
        "and torque, and then a steady decay.",
        runs,
        SLIDER,
        at_most("spread of u while the torque acts, relative to the graph", text("L2191"), ON_THE_GRAPH, apart),
        _decay_verdict(_after(runs), "L2199"),
        at_least(longer("springs"), text("L2195-2205"), 1.0, springs, "turns"),
        at_least(longer("torques"), text("L2195-2205"), 1.0, torques, "turns"),
        _reference_position(),
    )


# --- Free motion: 3.11 to 3.14


def _coast_result(
    number: str, claim: str, run: Trajectory, columns: Mapping[str, NDArray[np.float64]], *verdicts: Verdict
) -> StudyResult:
    """Build the result of a free motion from its columns, cut where the figure ends."""
    turns = Turns.of(run)
    last = int(np.searchsorted(run.time, turns.ends[turns.shown - 1]))
    return StudyResult(
        number=number,
        claim=claim,
        assignment=(
            "The text does not say at which crank angle the torque is taken away, nor how long the motion is followed: here at "
            f"0 from the steady motion, until the mean crank speed falls below {HARMONIC_SPEED:g} rad/s, which the text names."
        ),
        columns={name: values[: last + 1] for name, values in columns.items()},
        verdicts=(*verdicts, _energy_verdict(run)),
    )


def free_speed(number: str, stiffness: float) -> StudyResult:
    """Compute the crank speed over the crank angle in free motion."""
    run = coast(stiffness)
    turns, label = Turns.of(run), f"k = {plain(stiffness)} dyn/cm"
    energy, ratio = run["energy.kinetic"] + run["energy.potential"], greatest_ratio(turns.speed_range)
    relative = "relative range of the energy in a turn over that of the crank speed squared, greatest"
    return _coast_result(
        number,
        "The speed of the crank that is left to itself swings; the swing and the mean decrease.",
        run,
        {
            "turns of the crank [1]": run["crank.angle"] / (2.0 * pi),
            f"crank speed; {label} [rad/s]": run["crank.speed"],
        },
        *_swing_verdicts([run], 0.0, ("L2243", "L2249", "L2255")),
        at_most("range of the crank speed relative to the turn before, greatest", text("L2245"), 1.0, ratio),
        at_most(relative, text("L2253"), 0.25, turns.energy_share.max()),
        at_most("rise of the mechanical energy between two samples", OURS, 1e-8, np.diff(energy).max(), "J"),
    )


def draw_free_speed(result: StudyResult) -> Figure:
    """Draw the crank speed over the crank angle."""
    turns, speed = result.columns.values()
    curve, across = Curve(x=turns, y=speed), (0.0, float(turns[-1]))
    panel = Panel(x_label="turns of the crank", y_label="crank speed [rad/s]", curves=[curve], x_range=across)
    return plot_curves([panel], title=result.heading)


def _phase_plane(number: str, stiffness: float, *verdicts: Verdict) -> StudyResult:
    """Compute the slider's phase plane in free motion, and judge what is stated for both springs."""
    run = coast(stiffness)
    turns, label = Turns.of(run), f"k = {plain(stiffness)} dyn/cm"
    # the first turns are the transient of the release
    swing, mean = (greatest_ratio(np.abs(x[2 : turns.shown])) for x in (turns.slider_range, turns.slider))
    second, drawing = (turns.second / turns.first).min(), "it is said of the drawing, which we do not have"
    return _coast_result(
        number,
        "The slider tends to u = 0 and u' = 0 with decreasing swings, a drift, and higher harmonics.",
        run,
        {
            f"slider position u; {label} [cm]": CM_PER_METRE * run["slider.position"],
            f"slider velocity; {label} [cm/s]": CM_PER_METRE * run["slider.velocity"],
        },
        at_most("range of u relative to the turn before, from the fourth on, greatest", text("L2281"), 1.0, swing),
        at_most("mean of u relative to the turn before, from the fourth on, greatest", text("L2283"), 1.0, mean),
        at_least("second harmonic of u relative to the first, least of all turns", text("L2293"), 0.1, second),
        *verdicts,
        unjudged("the curves are smooth but for the sampling", text("L2266-2276"), drawing),
    )


def soft_phase_plane() -> StudyResult:
    """Compute the phase plane with the soft spring, whose mean position lies further from u = 0."""
    turns = [Turns.of(coast(k)) for k in (SOFT, STIFF)]
    drift, distance = (a / b for a, b in zip(*((np.ptp(t.slider[: t.shown]), abs(t.slider[0])) for t in turns)))
    words = "{} relative to that with k = 2e6 dyn/cm".format
    return _phase_plane(
        "3.13",
        SOFT,
        at_least(words("drift of the mean of u"), text("L2289"), 1.0, drift),
        at_least(words("distance of the mean of u from 0 at the start"), text("L2291"), 1.0, distance),
    )


def stiff_phase_plane() -> StudyResult:
    """Compute the phase plane with the stiff spring, whose higher harmonics the thesis explains by a resonance."""
    soft, stiff = (Turns.of(coast(k)) for k in (SOFT, STIFF))
    # the mean speed falls from turn to turn
    seen = [float(np.interp(-HARMONIC_SPEED, -t.speed, t.second / t.first)) for t in (stiff, soft)]
    most, resonance = (stiff.speed[(stiff.second / by).argmax()] for by in (stiff.first, stiff.speed**2))
    parameters, over_turn = table_3_1(STIFF), half_natural_frequencies(STIFF)
    half = 0.5 * natural_frequency(parameters)
    # an oscillator with this damping ratio swings most at sqrt(1 - 2 ratio^2) of its natural frequency
    ratio = parameters.slider_damping * half / parameters.slider_stiffness
    lowered, broad = 1.0 - np.sqrt(1.0 - 2.0 * ratio**2), "the damper lowers the speed and makes it broad"
    compared = "second harmonic over the first at a mean crank speed of 27 rad/s, relative to that with k = 5e5 dyn/cm"
    greatest, squared = (
        "mean crank speed of the greatest second harmonic over the {}".format,
        "speed squared, over half of the natural",
    )
    with_mass = "half the natural frequency, with the {} effective mass of a turn".format
    return _phase_plane(
        "3.14",
        STIFF,
        at_least(compared, text("L2299"), 1.0, seen[0] / seen[1]),
        near(greatest("first"), text("L2301"), HARMONIC_SPEED, most, ABOUT, "rad/s", why=broad),
        near(with_mass("mean"), text("L2303"), HARMONIC_SPEED, half, ABOUT, "rad/s"),
        near(greatest(squared), text("L2305"), 1.0, resonance / half, lowered),
        at_least(with_mass("least"), text("L2309-2317"), HARMONIC_SPEED, over_turn.max(), "rad/s"),
        at_most(with_mass("greatest"), text("L2309-2317"), HARMONIC_SPEED, over_turn.min(), "rad/s"),
        near("half the natural frequency", OURS, 25.55, half, 0.005, "rad/s"),
    )


def draw_phase_plane(result: StudyResult) -> Figure:
    """Draw the velocity over the position, with the start S and the finish F."""
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


_by_torques = partial(draw_launches, TORQUES, r"$T_0$ [dyn cm]")
_by_springs = partial(draw_launches, STIFFNESSES, "stiffness k [dyn/cm]")
#: The studies of 3.6 to 3.14.
STUDIES = (
    Study("3.6", launch_speeds, _by_torques),
    Study("3.7", torque_over_time, draw_torque_over_time),
    Study("3.8", launch_positions, _by_torques),
    Study("3.9", launch_speeds_by_spring, _by_springs),
    Study("3.10", launch_positions_by_spring, _by_springs),
    Study("3.11", partial(free_speed, "3.11", SOFT), draw_free_speed),
    Study("3.12", partial(free_speed, "3.12", STIFF), draw_free_speed),
    Study("3.13", soft_phase_plane, draw_phase_plane),
    Study("3.14", stiff_phase_plane, draw_phase_plane),
)
