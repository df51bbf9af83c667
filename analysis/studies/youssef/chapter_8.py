"""Figures of chapter VIII: the slider motion of both rigs, measured and computed.

The measured curves are lost with the figures; the text describes most of them. Theory is the periodic motion of the
full equations with the measured damping. The resonance curves of rig 2 are in `rig_2`; our own studies are in `rig_1`
and `rig_2`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import atan2, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.decay import fit_decay
from ...periodic import mean_effective_mass
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, curves_of, near, text, unjudged
from . import rig_1, rig_2
from .rigs import (
    LOST,
    NOTICED,
    RIG,
    SAME,
    SLIGHT,
    SLOWEST,
    amplitude,
    between,
    harmonic,
    largest_multiplier,
    motions,
    natural_speed,
    near_fraction,
    peaks,
    rig,
    rise_at,
    runs_verdict,
    slider,
    speed_of_fewer_peaks,
    turn,
    turns_of_sign,
)
from .runs import steady_turn

# --- 8.6: the damping coefficient from the slider's impulse response

#: Damping coefficients that the thesis found (N.s/m), by rig, and a spring of each to show them with.
FOUND = {1: (9.0, "A"), 2: (5.5, "C")}
#: Velocity after the impulse (m/s), length of the record (s), scatter of a reading and dry friction (N) that are tried out.
KICK, LENGTH, SCATTER, DRY = 1.0, 1.0, 0.005, 0.5


def impulse_response(spring: str, time: NDArray[np.float64], friction: float = 0.0) -> NDArray[np.float64]:
    """Return the position (m) of the disconnected slider after an impulse; dry friction (N) shifts the centre of each swing."""
    p = rig(spring)
    decay = 0.5 * p.slider_damping / p.slider_mass
    frequency = sqrt(p.slider_stiffness / p.slider_mass - decay**2)
    u = np.zeros(len(time))
    begin, x, v, side = 0.0, 0.0, KICK, 1.0
    while begin <= time[-1]:
        centre = -side * friction / p.slider_stiffness
        a = x - centre
        b = (v + decay * a) / frequency
        # the slider turns back at zero velocity, or stays there if the spring is weaker than the friction
        last = (atan2(v, decay * b + frequency * a) if v else pi) / frequency
        s = np.append(time - begin, last)
        swing = centre + np.exp(-decay * s) * (a * np.cos(frequency * s) + b * np.sin(frequency * s))
        u = np.where(time >= begin, swing[:-1], u)
        begin, x, v, side = begin + last, float(swing[-1]), 0.0, -side
        if abs(x) * p.slider_stiffness <= friction:
            return np.where(time >= begin, x, u)
    return u


def compute_decay() -> StudyResult:
    """Compute records like those of the thesis, and the damping that their logarithmic decrement gives."""
    time = np.linspace(0.0, LENGTH, 4001)
    columns, verdicts = {"time [s]": time}, []
    for number, (stated, spring) in FOUND.items():
        mass, name = rig(spring).slider_mass, f"rig {number}; spring {spring}"
        clean, rubbed = impulse_response(spring, time), impulse_response(spring, time, DRY)
        columns[f"slider position u; {name} [cm]"] = CM_PER_METRE * clean
        columns[f"slider position u with {DRY:g} N of dry friction; {name} [cm]"] = CM_PER_METRE * rubbed
        scatter = SCATTER * clean.max() * np.random.default_rng(number).standard_normal(len(time))
        found, error = fit_decay(time, clean + scatter).damping(mass)
        natural, right = fit_decay(time, clean).natural_frequency, sqrt(rig(spring).slider_stiffness / mass)
        added, left = (fit_decay(time, rubbed, friction=f).damping(mass)[0] - stated for f in (False, True))
        dry = f"what {DRY:g} N of dry friction adds to the coefficient"
        verdicts += [
            unjudged(f"average damping coefficient of rig {number}", text("8.3.3, L6401"), LOST),
            near(f"coefficient from a record with scatter; {name}", OURS, stated, found, 4.0 * error, "N.s/m"),
            near(f"natural frequency of the disconnected slider; {name}", OURS, right, natural, 1e-3 * right, "rad/s"),
            at_least(f"{dry} if it counts as damping; {name}", OURS, 0.0, added, "N.s/m"),
            near(f"{dry} if it is fitted beside it; {name}", OURS, 0.0, left, 0.05 * stated, "N.s/m"),
        ]
    return StudyResult(
        number="8.6",
        claim="The slider, disconnected and struck, swings out; its logarithmic decrement gives the damping coefficient.",
        assignment="The text does not say whose response is shown: both rigs', computed, with springs A and C.",
        columns=columns,
        verdicts=tuple(verdicts),
    )


def draw_decay(result: StudyResult) -> Figure:
    """Draw the records, one panel a rig."""
    panels = []
    for number, (_, spring) in FOUND.items():
        names = [name for name in result.columns if f"spring {spring}" in name]
        curves = curves_of(
            result, "time [s]", {n: f"{DRY:g} N of dry friction" if "dry" in n else "damper alone" for n in names}
        )
        title = f"rig {number}, spring {spring}"
        panels.append(
            Panel(x_label="time [s]", y_label="slider position u [cm]", title=title, curves=curves, x_range=(0.0, 0.6))
        )
    return plot_curves(panels, title=result.heading, columns=2, size=(4.8, 3.4))


# --- 8.7 to 8.18: the slider over the crank angle


@dataclass(frozen=True, slots=True)
class Turns:
    """Figure of the slider position over the crank angle: spring, speeds (rpm), and its verdicts.

    ``rough`` adds each curve with friction in the guide, by the coefficient `SLIGHT`.
    """

    number: str
    spring: str
    speeds: tuple[float, ...]
    claim: str
    statements: Callable[[], Sequence[Verdict]]
    assignment: str = ""
    rough: bool = False

    def compute(self) -> StudyResult:
        """Compute the steady turns at the speeds of a figure."""
        turns = {f"{speed:g} rpm": turn(self.spring, speed) for speed in self.speeds}
        if self.rough:
            (speed,) = self.speeds
            turns["friction"] = turn(self.spring, speed, slider_friction_coefficient=SLIGHT)
        columns = {"crank angle [deg]": np.linspace(0.0, 360.0, len(slider(next(iter(turns.values())))))}
        columns |= {f"slider position u; {name} [cm]": slider(of) for name, of in turns.items()}
        verdicts = (*self.statements(), runs_verdict(self.spring, self.speeds))
        return StudyResult(
            number=self.number, claim=self.claim, assignment=self.assignment, columns=columns, verdicts=verdicts
        )

    def draw(self, result: StudyResult) -> Figure:
        """Draw the turns over the crank angle, relative to their amplitudes if these differ much."""
        angle, *positions = result.columns.items()
        sizes = [0.5 * float(np.ptp(u)) for _, u in positions]
        relative = max(sizes) > 5.0 * min(sizes)
        curves = []
        for (name, u), size, colour in zip(positions, sizes, COLOURS):
            label = name.partition("; ")[2].removesuffix(" [cm]")
            label = f"with friction,\ncoefficient {SLIGHT:g}" if label == "friction" else label
            curves.append(Curve(x=angle[1], y=u / (size if relative else 1.0), label=label, colour=colour))
        panel = Panel(
            x_label="crank angle [deg]",
            y_label="slider position u / amplitude" if relative else "slider position u [cm]",
            title=f"rig {RIG[self.spring]}, spring {self.spring}",
            curves=curves,
            legend_at="outside",
            x_range=(0.0, 360.0),
            x_ticks=range(0, 361, 45),
        )
        return plot_curves([panel], title=result.heading)

    @property
    def study(self) -> Study:
        """Return the row as a study."""
        return Study(self.number, self.compute, self.draw)


#: Speeds up to which each spring was run, since the guide was too short for more, and those of the figures (rpm).
STOPPED = {"A": 500.0, "B": 800.0}
SPEEDS = {"A": (240.0, 260.0, 280.0, 300.0, 360.0, 500.0), "B": (500.0, 540.0, 580.0, 620.0, 680.0, 780.0)}
#: What the thesis states, and what is right: natural frequency, speed of the local maximum (rpm).
STATED = {"A": ((580.0, 592.0), (290.0, 296.0)), "B": ((1160.0, 1133.0), (580.0, 564.0))}


def _periodic() -> list[Verdict]:
    """Judge Fig 8.7: one cycle of the slider takes one cycle of the crank, at this speed and at all others."""
    change = steady_turn(rig("A"), 360.0).change
    words = "largest multiplier of the motion of one cycle at all speeds run"
    largest = {s: largest_multiplier(s, SLOWEST, STOPPED[s]) for s in "AB"}
    return [
        at_most("change of the steady u from one crank cycle to the next", text("8.4.1.1, L6437"), SAME, change, "cm"),
        unjudged("the motion observed at 360 rpm has the period of a crank cycle", text("8.4.1.1, L6441"), LOST),
        *(at_most(f"{words}; spring {s}", text("8.4.1.1, L6449"), 1.0, largest[s]) for s in "AB"),
    ]


def _compared(spring: str, speed: float) -> list[Verdict]:
    """Return the verdicts of Fig 8.8 to 8.13, which compare theory with lost measurements."""
    words, line = {"A": ("slightly other amplitudes", "L6479"), "B": ("reasonable agreement in amplitude", "L6524")}[
        spring
    ]
    why = f"{LOST}; what friction does to the theory is in rig-1-friction"
    verdicts = [unjudged(f"almost total agreement in phase, {words}", text(f"8.4.1.1, {line}"), why)]
    if speed == 450.0:
        found, words = (
            speed_of_fewer_peaks("A", 400.0, 500.0),
            "speed at which first and last peak meet in a point of inflection",
        )
        verdicts.append(near(words, text("8.4.1.2, L6726"), 450.0, found, 5.0, "rpm"))
        verdicts.append(near(words, OURS, 451.0, found, 1.0, "rpm"))
    if speed == 720.0:
        words = "agreement at other speeds, good in phase and reasonable in amplitude"
        verdicts.append(unjudged(words, text("8.4.1.1, L6533"), LOST))
    return verdicts


def _peaks(spring: str, speeds: Sequence[float], line: str, stated: int = 4) -> list[Verdict]:
    """Judge the number of maxima and minima together at each speed."""
    counted = {speed: peaks(turn(spring, speed)) for speed in speeds}
    words, place = "peaks of the oscillation at", f"8.4.1.2, {line}"
    return [near(f"{words} {speed:g} rpm", text(place), stated, n, 0.0) for speed, n in counted.items()]


def _rises(spring: str, speeds: Sequence[float]) -> float:
    """Judge the growth of the amplitude from one speed to the next (cm)."""
    return float(np.diff([amplitude(turn(spring, speed)) for speed in speeds]).min())


def _natural_and_half(spring: str, speeds: Sequence[float], line: str) -> list[Verdict]:
    """Judge the calculated natural frequency, and the rise of the amplitude up to its half."""
    (natural, right), (half, right_half) = STATED[spring]
    found, at_half, rise = natural_speed(spring), near_fraction(spring, 2)[0], _rises(spring, speeds)
    why, why_half, place = (
        "from the mean effective mass",
        f"half the natural frequency is {found / 2:.0f} rpm",
        f"8.4.1.2, {line}",
    )
    rising = f"least rise of the amplitude from one speed to the next, {speeds[0]:g} to {speeds[-1]:g} rpm"
    return [
        near("calculated natural frequency", text("8.4.1.2, L6551"), natural, found, 5.0, "rpm", why=why),
        near("natural frequency from the mean effective mass", OURS, right, found, 0.5, "rpm"),
        at_least(rising, text(place), 0.0, rise, "cm"),
        near("speed of the local maximum", text(place), half, at_half, 5.0, "rpm", why=why_half),
        near("speed of the local maximum", OURS, right_half, at_half, 0.5, "rpm"),
    ]


def _harmonics(spring: str) -> list[Verdict]:
    """Judge that there is more than one harmonic but no resonance of any beyond the second."""
    sizes = np.array([[harmonic(turn(spring, speed), n) for n in (1, 2, 3)] for speed in SPEEDS[spring]])
    second, third = (sizes[:, 1] / sizes[:, 0]).min(), (sizes[:, 2] / sizes[:, :2].max(axis=1)).max()
    verdicts = [
        at_least("harmonic 2 over harmonic 1, least of six speeds", text("8.4.1.2, L6583"), NOTICED, second),
        at_most("harmonic 3 over the greater of 1 and 2, most of six", text("8.4.1.2, L6777"), 2.0 * NOTICED, third),
    ]
    for order, part in ((3, "a third"), (4, "a quarter")):
        rise, words = rise_at(spring, order), f"rise of the amplitude at {part} of the natural frequency, relative"
        why = f"harmonic {order} meets the natural frequency there" if rise > NOTICED else ""
        verdicts.append(at_most(words, text("8.4.1.2, L6770"), NOTICED, rise, why=why))
    return verdicts


def _travel(spring: str) -> Verdict:
    """Judge whether the greatest displacement occurs at the speed at which the rig had to be stopped."""
    last = STOPPED[spring]
    *before, there = (
        float(np.abs(slider(turn(spring, w))).max()) for w in np.arange(SPEEDS[spring][0], last + 1.0, 5.0)
    )
    words = f"greatest displacement at {last:g} rpm, where the guide was too short, over that at all speeds below"
    why = "" if there > max(before) else f"{there:.2f} cm; {max(before):.2f} near half the natural frequency"
    return at_least(words, text("8.4.1.2, L6555"), 1.0, there / max(before), why=why)


def _fig_8_14() -> list[Verdict]:
    rising = _natural_and_half("A", (*SPEEDS["A"][:3], 290.0), "L6734")
    return [*rising, *_peaks("A", SPEEDS["A"][:3], "L6579, L6724"), *_harmonics("A")]


def _fig_8_15() -> list[Verdict]:
    (lowest, _), u = between(motions("A").minima(), 320.0, 420.0), slider(turn("A", 500.0))
    bends, rise = turns_of_sign(np.diff(u, 2, prepend=u[-2])), _rises("A", range(370, 501, 10))
    words, shoulder = "speed of the minimum", "a shoulder is left"
    return [
        *_peaks("A", (300.0, 360.0), "L6579"),
        *_peaks("A", (500.0,), "L6732", stated=2),
        near("points of inflection at 500 rpm, as of a sine", text("8.4.1.2, L6728"), 2, bends, 0, why=shoulder),
        near(words, text("8.4.1.2, L6740"), 345.0, lowest, 5.0, "rpm", why="0.62 of the natural frequency"),
        near(words, OURS, 367.0, lowest, 0.5, "rpm"),
        at_least("least rise of the amplitude by 10 rpm, 370 to 500", text("8.4.1.2, L6740"), 0.0, rise, "cm"),
        _travel("A"),
    ]


def _fig_8_16() -> list[Verdict]:
    ratio, why = natural_speed("B") / natural_speed("A"), "the springs are as 11 to 3"
    return [
        *_natural_and_half("B", SPEEDS["B"][:3], "L6754"),
        near("natural frequency over spring A's", text("8.4.1.2, L6551"), 2.0, ratio, 0.01, why=why),
        near("natural frequency over spring A's, sqrt(11/3)", OURS, sqrt(11.0 / 3.0), ratio, 1e-9),
        *_peaks("B", SPEEDS["B"][:3], "L6752"),
        *_harmonics("B"),
    ]


def _fig_8_17() -> list[Verdict]:
    place, (before, least, after) = "8.4.1.2, L6756", (amplitude(turn("B", speed)) for speed in (620.0, 680.0, 800.0))
    meeting = speed_of_fewer_peaks("B", 800.0, 900.0)
    words = "speed at which first and last peak meet, out of the rig's reach"
    return [
        *_peaks("B", SPEEDS["B"][3:], "L6752"),
        at_least("fall of the amplitude from 620 to 680 rpm", text(place), 0.0, before - least, "cm"),
        at_least("rise of the amplitude from 680 to 800 rpm", text(place), 0.0, after - least, "cm"),
        at_least(words, text("8.4.1.2, L6762"), STOPPED["B"], meeting, "rpm"),
        _travel("B"),
    ]


#: Speeds at which rig 2 is shown, and the range it was run over (rpm).
TYPICAL, RUN = (400.0, 585.0, 1000.0), (300.0, 1000.0)


def _fig_8_18() -> list[Verdict]:
    section, speeds = "8.4.2.1", np.arange(RUN[0], RUN[1] + 1.0, 10.0).tolist()
    sizes = {s: np.array([[harmonic(turn(s, w), n) for n in (1, 2, 3)] for w in speeds]) for s in "CD"}
    ratios = {s: (table[:, 1:] / table[:, :1]).max(axis=0) for s, table in sizes.items()}
    shown = max(harmonic(turn("C", w), 2) / harmonic(turn("C", w), 1) for w in TYPICAL)
    largest = max(largest_multiplier(s, *RUN) for s in "CD")
    shift = np.degrees(np.ptp(np.unwrap([np.angle(np.fft.rfft(slider(turn("C", w))[:-1])[1]) for w in speeds])))
    # by its inertia each link moves the slider as a force does that grows with the square of the speed
    p, mass, rates = rig("C"), mean_effective_mass(rig("C")), RAD_S_PER_RPM * np.array(speeds)
    force = sizes["C"][:, 0] * np.abs(p.slider_stiffness / rates**2 - mass + 1j * p.slider_damping / rates)
    spread = np.ptp(force) / force.mean()
    why = "near half the natural frequency it is as large, though both are below 1 mm"
    range_of, oscillator = (
        "greatest from 300 to 1000 rpm",
        "spread of the force over speed squared on a damped mass-spring system",
    )
    return [
        at_most("harmonic 2 over harmonic 1, greatest at the speeds shown", text(f"{section}, L6806"), 0.1, shown),
        at_most("largest multiplier of the motion of one cycle", text(f"{section}, L6808"), 1.0, largest),
        at_least("change of the phase, 300 to 1000 rpm", text(f"{section}, L6812"), 90.0, shift, "deg"),
        *(
            verdict
            for s, (second, third) in ratios.items()
            for verdict in (
                at_most(f"harmonic 2 over 1, {range_of}; spring {s}", text(f"{section}, L6810"), 0.1, second, why=why),
                at_most(f"harmonic 3 over 1, {range_of}; spring {s}", text(f"{section}, L6820, L6968"), NOTICED, third),
            )
        ),
        at_most(f"{oscillator} that gives harmonic 1, relative", text(f"{section}, L6822, L6970"), NOTICED, spread),
    ]


_TOGETHER = (
    "The text names the six speeds of both figures together: the first three are shown in one, the others in the next."
)
_AGREE_A = (
    "Theory and experiment agree well, almost totally in phase; friction explains the slight variations of amplitude."
)
_AGREE_B = "Theory and experiment agree almost totally in phase; in amplitude not as well, but reasonably."
TURNS = (
    Turns("8.7", "A", (360.0,), "The steady motion of the slider is periodic with one crank cycle.", _periodic),
    *(
        Turns(f"8.{n}", spring, (speed,), claim, partial(_compared, spring, speed), rough=True)
        for spring, claim, first in (("A", _AGREE_A, 8), ("B", _AGREE_B, 11))
        for n, speed in enumerate(rig_1.COMPARED[spring], first)
    ),
    Turns(
        "8.14",
        "A",
        SPEEDS["A"][:3],
        "A typical oscillation has four peaks; its amplitude grows up to 290 rpm, half the natural frequency.",
        _fig_8_14,
        _TOGETHER,
    ),
    Turns(
        "8.15",
        "A",
        SPEEDS["A"][3:],
        "The amplitude falls up to 345 rpm and then grows; four peaks become two, until at 500 rpm it is like a sine.",
        _fig_8_15,
        _TOGETHER,
    ),
    Turns(
        "8.16",
        "B",
        SPEEDS["B"][:3],
        "Each oscillation has four peaks; the amplitude grows up to 580 rpm, half the natural frequency.",
        _fig_8_16,
        _TOGETHER,
    ),
    Turns(
        "8.17",
        "B",
        SPEEDS["B"][3:],
        "Beyond 580 rpm the amplitude falls, then grows; the peaks tend to meet as with spring A.",
        _fig_8_17,
        _TOGETHER,
    ),
    Turns(
        "8.18",
        "C",
        TYPICAL,
        "The slider of rig 2 moves almost as a sine, with a phase that varies with the speed, from 300 to 1000 rpm.",
        _fig_8_18,
        "The text names neither spring nor speeds of the typical oscillations: spring C below, at and above resonance.",
    ),
)

STUDIES = {
    study.number: study
    for study in (
        Study("8.6", compute_decay, draw_decay),
        *(row.study for row in TURNS),
        *rig_2.STUDIES,
        *rig_1.STUDIES,
    )
}
