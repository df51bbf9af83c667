"""Figures of chapter VIII: the slider motion of both rigs, measured and computed.

The measured curves are lost with the figures; the text describes most of them. Theory is the periodic motion of the
full equations with the measured damping. The instruments (Fig 8.4, 8.6) are in `instruments`, the resonance curves of rig 2 in
`rig_2`, and friction and resonance of rig 1 in `rig_1`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import Turn
from ..rules import ABOUT, ALIKE, SMALL
from ..statements import FloatArray, Statement, at_least, at_most, near, statement
from ..study import Study, StudyResult
from . import rig_1, rig_2, rigs

# --- 8.7 to 8.18: the slider over the crank angle


@dataclass(frozen=True, slots=True)
class Turns:
    """Figure of the slider position over the crank angle: spring, speeds (rpm) and statements.

    ``see`` is the number of the figure that judges the statements, if they are not given here. ``rough`` adds the curve with
    friction in the guide; its coefficient is `SLIGHT`.
    """

    spring: str
    speeds: tuple[float, ...]
    claim: str
    statements: Callable[[], Iterable[Statement]] = tuple
    assignment: str = ""
    rough: bool = False
    see: str = ""

    def compute(self) -> StudyResult:
        """Compute a steady turn at each speed of the figure."""
        turns = {f"{speed:g} rpm": rigs.turn(self.spring, speed) for speed in self.speeds}
        if self.rough:
            (speed,) = self.speeds
            turns["friction"] = rigs.turn(self.spring, speed, slider_friction_coefficient=rigs.SLIGHT)
        columns = {"crank angle [deg]": np.linspace(0.0, 360.0, len(rigs.slider(next(iter(turns.values())))))}
        columns |= {f"slider position u; {name} [cm]": rigs.slider(found) for name, found in turns.items()}
        return StudyResult(
            claim=self.claim,
            assignment=self.assignment,
            columns=columns,
            statements=tuple(self.statements()),
            see=self.see,
        )

    def draw(self, result: StudyResult) -> Figure:
        """Draw the slider position over the crank angle, divided by its amplitude if the amplitudes differ much."""
        angle, *positions = result.columns.items()
        sizes = [0.5 * float(np.ptp(u)) for _, u in positions]
        relative = max(sizes) > 5.0 * min(sizes)
        curves = []
        for (name, u), size, colour in zip(positions, sizes, COLOURS):
            label = name.partition("; ")[2].removesuffix(" [cm]")
            label = f"with friction,\ncoefficient {rigs.SLIGHT:g}" if label == "friction" else label
            curves.append(Curve(x=angle[1], y=u / (size if relative else 1.0), label=label, colour=colour))
        panel = Panel(
            x_label="crank angle [deg]",
            y_label="slider position u / amplitude" if relative else "slider position u [cm]",
            title=f"rig {rigs.RIG[self.spring]}, spring {self.spring}",
            curves=curves,
            legend_at="outside",
            x_range=(0.0, 360.0),
            x_ticks=range(0, 361, 45),
        )
        return plot_curves([panel], title=result.heading)


#: Speeds of the figures (rpm).
SPEEDS = {"A": (240.0, 260.0, 280.0, 300.0, 360.0, 500.0), "B": (500.0, 540.0, 580.0, 620.0, 680.0, 780.0)}
#: All speeds of Fig 8.7 to 8.17 (rpm).
OF_FIGURES = {s: sorted({*SPEEDS[s], *rig_1.COMPARED[s]}) for s in "AB"}
#: Tolerance of a speed that is printed in tens of rpm.
TENS = "5 rpm, half a unit of the last digit of a speed in tens"
#: Choice of the speed that is compared with the stated one, in words.
NEAREST = "a stated speed is compared with the nearest speed that the rounding of the printed stiffness allows"


def _periodic() -> Iterator[Statement]:
    """Judge Fig 8.7: one cycle of the slider takes one turn of the crank, at the speed of the figure and at all others."""
    stable = "below 1: then the motion of one crank cycle exists, and every motion near it tends to it"
    largest = [
        at_most(
            f"spring {s}, to {rig_1.STOPPED[s]} rpm",
            1.0,
            rigs.largest_multiplier(s, rigs.SLOWEST, float(rig_1.STOPPED[s])),
        )
        for s in "AB"
    ]
    shown = [(s, w) for s in "AB" for w in OF_FIGURES[s]]
    here = max(rigs.orbit(rigs.rig(s), w).largest for s, w in shown)
    yield statement(
        "The theory predicts the steady state slider motion to be oscillatory and periodic with one crank cycle.",
        "8.4.1.1, L6437",
        "largest Floquet multiplier of the motion of one crank cycle, which is the factor by which a small departure "
        "from it grows in a turn, at the 18 speeds of Fig 8.7 to 8.17",
        stable,
        at_most("multiplier", 1.0, here),
        why="a motion that repeats itself, and is not at rest, is oscillatory",
    )
    yield statement(
        "This is verified experimentally as shown in Fig. (8.7) in which a typical experimentally observed steady state "
        "motion of the slider is shown against the crank angle.",
        "8.4.1.1, L6439",
        why=rigs.LOST,
    )
    yield statement(
        "However, for all other speeds, using this spring and also spring B, the motion was always periodic with one "
        "crank cycle.",
        "8.4.1.1, L6449",
        f"largest Floquet multiplier of the motion of one crank cycle, from {rigs.SLOWEST:g} rpm (our choice) to the "
        "greatest speed that was run with each spring (L6555)",
        stable,
        *largest,
    )


def _compared_a() -> Iterator[Statement]:
    """Judge the statements on Fig 8.8 to 8.10, which compare theory with lost measurements."""
    yield statement(
        "As may be seen from Figs. (8.8), (8.9) and (8.10) the theoretical and experimental results are in good "
        "agreement in both phase and amplitude.",
        "8.4.1.1, L6479",
        why=rigs.LOST,
    )
    yield statement(
        "It can however be observed that while the phase is almost in total agreement the amplitude shows slight variations.",
        "8.4.1.1, L6482",
        why=rigs.LOST,
    )


def _compared_b() -> Iterator[Statement]:
    """Judge the statements on Fig 8.11 to 8.13."""
    yield statement(
        "As may be seen the theoretical and experimental results are almost in total agreement in phase.",
        "8.4.1.1, L6524",
        why=rigs.LOST,
    )
    yield statement(
        "The agreement in amplitude is, however, not as good but nevertheless reasonable.",
        "8.4.1.1, L6526",
        why=rigs.LOST,
    )
    yield statement(
        "The experimental and theoretical results were compared for a number of other speeds below the natural frequencies "
        "with both springs A and B and in all cases the agreement in phase was good and in amplitude reasonable.",
        "8.4.1.1, L6533",
        why=f"{rigs.LOST}, and the other speeds are not named",
    )


def _fig_8_14() -> Iterator[Statement]:
    natural, shown = {"A": "580", "B": "1160"}, OF_FIGURES["A"]
    of_four = sum(rigs.peaks(rigs.turn("A", speed)) == 4 for speed in shown)
    second = min(rigs.harmonic(rigs.turn("A", w), 2) / rigs.harmonic(rigs.turn("A", w), 1) for w in shown)
    yield statement(
        "Theoretical calculations give the natural frequency with spring A to be in the region of 580 RPM and with "
        "spring B in the region of 1160 RPM.",
        "8.4.1.2, L6551",
        "crank speed at the natural frequency, by the stiffness and the effective mass of the slider with the links "
        "(its mean over a turn with u = 0)",
        f"{100 * ABOUT:g} %, the rule for *in the region of*",
        *(
            near(f"spring {s}", stated, rigs.natural_speed(s), ABOUT * float(stated), "rpm")
            for s, stated in natural.items()
        ),
    )
    yield statement(
        "They also show that a typical oscillation has four peaks indicating that, since the oscillations are periodic "
        "in the crank cycle, more than one harmonic is present in the solution.",
        "8.4.1.2, L6579",
        f"number of the {len(shown)} speeds of Fig 8.8 to 8.10, 8.14 and 8.15 at which u has four maxima and minima "
        "together in a turn, which is our reading of *peaks*. Then the second harmonic relative to the first, the least "
        "of all these speeds",
        f"more than half, as *typical* says; more than {SMALL:g}, the rule for *small*, so that the harmonic is seen",
        at_least("speeds with four peaks", 0.5 * len(shown), of_four),
        at_least("second harmonic over first", SMALL, second),
        why="that the oscillations are periodic is judged at L6449",
    )
    yield _amplitude_a()


def _amplitude_a() -> Statement:
    """Judge the amplitude over the speed with spring A."""
    tops, _ = np.transpose([rigs.extrema_near_half("A", stiffness) for stiffness in rigs.stiffness_range("A")])
    top, low = rigs.extrema_near_half("A", rigs.rig("A").slider_stiffness)
    # the stiffness that puts the maximum as low as its tolerance allows
    least = 290.0 - 5.0
    soft = brentq(
        lambda stiffness: rigs.extrema_near_half("A", stiffness)[0] - least, *rigs.stiffness_range("A"), xtol=1.0
    )
    return statement(
        "The amplitude of oscillations increases as the speed increases up to 290 RPM, i.e. half the natural frequency, "
        "where it reaches a maximum after which the amplitude decreases with increase of speed up to 345 RPM beyond "
        "which it increases with increase of speed.",
        "8.4.1.2, L6734",
        f"amplitude over the speed with spring A, from 240 rpm, the lowest speed of the figures; {NEAREST} (one digit)",
        f"{TENS}; 0.5 rpm for 345 rpm, by the same rule; {ALIKE:g}, the rule for *the same*; for rises the sign alone",
        at_least("least rise by 10 rpm, 240 to 290 rpm", 0.0, _least_rise("A", range(240, 291, 10)), "cm"),
        near(_rounded("speed of the maximum", tops), "290", np.clip(290.0, *tops), 5.0, "rpm"),
        near("maximum over half the natural frequency", 1.0, 2.0 * top / rigs.natural_speed("A"), ALIKE),
        at_most("greatest rise by 5 rpm, 300 to 345 rpm", 0.0, -_least_rise("A", range(345, 299, -5)), "cm"),
        near(
            f"speed of the minimum, the maximum at {least:g} rpm or more",
            "345",
            rigs.extrema_near_half("A", soft)[1],
            unit="rpm",
            why="no single stiffness gives both speeds",
        ),
        at_least("least rise by 10 rpm, 370 to 500 rpm", 0.0, _least_rise("A", range(370, 501, 10)), "cm"),
        why=f"with the stiffness as printed, the maximum is at {top:.0f} rpm and the minimum at {low:.0f}",
    )


def _rounded(what: str, speeds: FloatArray) -> str:
    """Return the name ``what`` of a speed, with the range of ``speeds`` (rpm) over the rounding of the printed stiffness."""
    return f"{what}; rounding allows {speeds.min():.0f} to {speeds.max():.0f}"


def _least_rise(spring: str, speeds: Sequence[float]) -> float:
    """Return the least growth of the amplitude (cm) from one speed to the next."""
    return float(np.diff([rigs.amplitude(rigs.turn(spring, speed)) for speed in speeds]).min())


def _fig_8_15() -> Iterator[Statement]:
    at_500 = rigs.turn("A", 500.0)
    shoulder = "the point of inflection has not reached the third peak; a shoulder is left"
    u = rigs.slider(at_500)
    yield statement(
        "At 240 RPM the slider oscillation has four peaks; however when the speed is 450 RPM the first and last peaks "
        "coincide and become an inflection point and as the speed is increased further this inflection point coincides "
        "with the third peak, thus resulting in a sinusoidal type oscillation as shown in the case of 500 RPM.",
        "8.4.1.2, L6724",
        "number of peaks in a turn, as at L6579; speed above which there are two instead of four. Then, at 500 rpm, the "
        "number of points of inflection in a turn (a sine has two), and the second harmonic relative to the first",
        f"none for the numbers; {TENS}; {ABOUT:g}, the rule for *nearly*, since we read *sinusoidal type* as nearly a sine",
        near("peaks at 240 rpm", "4", rigs.peaks(rigs.turn("A", 240.0)), 0.0),
        near(
            "speed at which first and last peak meet", "450", rigs.speed_of_fewer_peaks("A", 400.0, 500.0), 5.0, "rpm"
        ),
        near("peaks at 500 rpm", 2.0, rigs.peaks(at_500), 0.0),
        near(
            "points of inflection at 500 rpm",
            2.0,
            rigs.count_sign_changes(np.diff(u, 2, prepend=u[-2])),
            0.0,
            why=shoulder,
        ),
        at_most(
            "second harmonic over first at 500 rpm",
            ABOUT,
            rigs.harmonic(at_500, 2) / rigs.harmonic(at_500, 1),
            why=shoulder,
        ),
    )


def _fig_8_16() -> Iterator[Statement]:
    four = sum(rigs.peaks(rigs.turn("B", speed)) == 4 for speed in SPEEDS["B"])
    top = rigs.maximum_near_fraction("B", 2)[0]
    tops, _ = np.transpose([rigs.extrema_near_half("B", stiffness) for stiffness in rigs.stiffness_range("B")])
    fractions = [(s, order, part) for s in "AB" for order, part in ((3, "a third"), (4, "a quarter"))]
    higher = {s: {w: rigs.overtones(rigs.turn(s, w)) for w in OF_FIGURES[s]} for s in "AB"}
    yield statement(
        "As in the case of spring A the oscillations are periodic and each oscillation has four peaks.",
        "8.4.1.2, L6750",
        f"number of the {len(SPEEDS['B'])} speeds of Fig 8.16 and 8.17 at which a turn has four peaks, as at L6579",
        "none, since counts are exact",
        near("speeds with four peaks", float(len(SPEEDS["B"])), four, 0.0),
        why="that they are periodic is judged at L6449",
    )
    yield statement(
        "The amplitude of oscillations increases with speed up to 580 RPM, i.e. half the natural frequency, where it "
        "reaches a maximum after which the amplitude decreases and then increases with increase of speed.",
        "8.4.1.2, L6752",
        f"amplitude over the speed with spring B, from 500 rpm, the lowest speed of the figures; {NEAREST} (two digits)",
        f"{TENS}; {ALIKE:g}, the rule for *the same*; for rises and falls the sign alone",
        at_least("least rise by 10 rpm, 500 to 560 rpm", 0.0, _least_rise("B", range(500, 561, 10)), "cm"),
        near(_rounded("speed of the maximum", tops), "580", np.clip(580.0, *tops), 5.0, "rpm"),
        near("maximum over half the natural frequency", 1.0, 2.0 * top / rigs.natural_speed("B"), ALIKE),
        at_most("greatest rise by 10 rpm, 570 to 710 rpm", 0.0, -_least_rise("B", range(710, 569, -10)), "cm"),
        at_least("least rise by 10 rpm, 720 to 800 rpm", 0.0, _least_rise("B", range(720, 801, 10)), "cm"),
        why=f"with the stiffness as printed, the maximum is at {top:.0f} rpm",
    )
    yield statement(
        "In both cases of springs A and B it was [noticed] that no noticeable effects on the amplitude of vibrations "
        "were observed at [w = wn/4, wn/3], where wn is the natural frequency.",
        "8.4.1.2, L6770",
        "maximum of the amplitude there minus the minimum that follows at a higher speed, relative to this minimum",
        rigs.SEEN_IN_RECORDS,
        *(
            at_most(f"spring {s}, {part}, {rigs.natural_speed(s) / n:.0f} rpm", rigs.NOTICED, rigs.peak_rise(s, n))
            for s, n, part in fractions
        ),
        why="there the third and the fourth harmonic meet the natural frequency",
    )
    yield statement(
        "This suggested a slider solution based on the first and second[] harmonics, and that the third and higher "
        "harmonics are small in comparison.",
        "8.4.1.2, L6774-6779",
        "greatest of the harmonics 3 to 6, relative to the greater of the first and second: the most at the nine speeds "
        "of Fig 8.7 to 8.17 with each spring",
        f"{SMALL:g}, the rule for *small*",
        *(at_most(f"spring {s}, {max(x, key=x.__getitem__):g} rpm", SMALL, max(x.values())) for s, x in higher.items()),
        why="the greatest of them is the third harmonic; they are small only with spring A at 500 rpm, "
        f"{higher['A'][500.0]:.3f}",
    )


def _fig_8_17() -> Iterator[Statement]:
    meeting = {s: rigs.speed_of_fewer_peaks(s, *ends) for s, ends in {"A": (400.0, 500.0), "B": (800.0, 900.0)}.items()}
    of_natural = [speed / rigs.natural_speed(s) for s, speed in meeting.items()]
    late = [speed for speed in OF_FIGURES["B"] if speed >= 580.0]
    angles = [_fall_angle(rigs.turn("B", speed)) for speed in late]
    yield statement(
        "The four peaks in the oscillations show the same tendency as for spring A, i.e. the first and last peaks "
        "coinciding and becoming an inflection point.",
        "8.4.1.2, L6760",
        "speed at which first and last peak meet, so that two of the four are left, relative to the natural frequency "
        "(our measure): the value with spring B divided by that with spring A",
        f"{ALIKE:g}, the rule for *the same*",
        near("spring B over A", 1.0, of_natural[1] / of_natural[0], ALIKE),
    )
    yield statement(
        "Although it is not possible to show these peaks coinciding in this case the tendency may be predicted from "
        "Figs. (8.11) to (8.13) and (8.16) to (8.17).",
        "8.4.1.2, L6764",
        "speed at which first and last peak meet with spring B. Then the crank angle from the last peak of a turn to "
        f"the first of the next: its greatest change from one speed of the figures to the next, from {late[0]:g} rpm on, "
        "where these two are the first and the last",
        "above 800 rpm, the greatest speed that was run with this spring; for the change the sign alone",
        at_least("speed at which they meet", float(rig_1.STOPPED["B"]), meeting["B"], "rpm"),
        at_most("greatest change of the angle", 0.0, np.diff(angles).max(), "deg"),
    )


def _fall_angle(found: Turn) -> float:
    """Return the crank angle (deg) from the last maximum of the slider position in a turn to the minimum after it."""
    slope = np.diff(rigs.slider(found))
    after, rising = np.roll(slope, -1), slope > 0.0
    ends = (np.flatnonzero(x & ~np.roll(x, -1)) for x in (rising, ~rising))
    # between the samples, where the slope vanishes
    tops, lows = (at + slope[at] / (slope[at] - after[at]) for at in ends)
    return float(((lows - tops[-1]) % len(slope)).min()) * 360.0 / len(slope)


#: Speeds at which rig 2 is shown (rpm).
TYPICAL = (400.0, 585.0, 1000.0)

_TOGETHER = (
    "The text names the six speeds of both figures together. We show the first three in one figure, and the others in the "
    "next."
)
_AGREE_A = (
    "Theory and experiment agree well, almost totally in phase; friction explains the slight variations of amplitude."
)
_AGREE_B = "Theory and experiment agree almost totally in phase; in amplitude not as well, but reasonably."
TURNS = {
    "8.7": Turns("A", (360.0,), "The steady motion of the slider is periodic with one crank cycle.", _periodic),
    **{
        f"8.{n}": Turns(
            spring,
            (speed,),
            claim,
            statements if n == first else tuple,
            rough=True,
            see="" if n == first else f"8.{first}",
        )
        for spring, claim, first, statements in (("A", _AGREE_A, 8, _compared_a), ("B", _AGREE_B, 11, _compared_b))
        for n, speed in enumerate(rig_1.COMPARED[spring], first)
    },
    "8.14": Turns(
        "A",
        SPEEDS["A"][:3],
        "A typical oscillation has four peaks; its amplitude grows up to 290 rpm, half the natural frequency.",
        _fig_8_14,
        _TOGETHER,
    ),
    "8.15": Turns(
        "A",
        SPEEDS["A"][3:],
        "The amplitude falls up to 345 rpm and then grows. Four peaks become two, until at 500 rpm the motion is like a sine.",
        _fig_8_15,
        _TOGETHER,
    ),
    "8.16": Turns(
        "B",
        SPEEDS["B"][:3],
        "Each oscillation has four peaks; the amplitude grows up to 580 rpm, half the natural frequency.",
        _fig_8_16,
        _TOGETHER,
    ),
    "8.17": Turns(
        "B",
        SPEEDS["B"][3:],
        "Beyond 580 rpm the amplitude falls, then grows; the peaks tend to meet as with spring A.",
        _fig_8_17,
        _TOGETHER,
    ),
    "8.18": Turns(
        "C",
        TYPICAL,
        "The slider of rig 2 moves almost as a sine, with a phase that varies with the speed, from 300 to 1000 rpm.",
        rig_2.judge_motion,
        "The text names neither the spring nor the speeds of the typical oscillations. We show spring C below, at and above "
        "resonance.",
    ),
}

#: The studies by number.
STUDIES = {number: Study(row.compute, row.draw) for number, row in TURNS.items()}
