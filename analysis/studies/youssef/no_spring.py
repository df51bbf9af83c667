"""Figures 3.2 and 3.3: the drift of the slider without a spring; Table 3.1 at 420 rpm."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import asin, degrees, pi

import numpy as np
from numpy.typing import NDArray

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...run import Event, Inputs, simulate
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import ALIKE, SLIGHTLY
from ..statements import FloatArray, at_least, at_most, near, statement, within
from ..study import Study, StudyResult, pad_columns
from ..variation import cache
from .runs import ALIKE_WORDS, PERIOD, SIGN, SPEED, TURNS, plain, scientific, table_3_1

#: Dampings of Fig 3.2 and 3.3 (dyn.s/cm).
DAMPINGS = (1e4, 5e4, 1e5, 5e5, 1e6)
#: Sine |sin(th4 - th3)| of the transmission angle below which coupler and rocker count as collinear: our choice.
COLLINEAR_SINE = 0.3
#: Number of turns of a run without a spring.
DRIFT_TURNS = 80
SAMPLES_PER_DRIFT_TURN = 120
#: Dampers (dyn.s/cm) with which the drift is nearly linear.
NEAR_LINEAR = (5e5, 1e6)
#: Number of turns of the transient according to the thesis, and last of the turns over which the drift is compared with a line.
TRANSIENT_TURNS, DRAWN_TURNS = 2, 10
#: Least number of turns that shows the motion after the transient: two turns more than the transient.
FEWEST_TURNS = TRANSIENT_TURNS + 2

DAMPING_LEGEND = r"damping $\mu$ [dyn s/cm]"


def _mu(damping: float) -> str:
    return f"mu = {plain(damping)} dyn.s/cm"


@dataclass(frozen=True, slots=True)
class Drift:
    """Motion of the slider without a spring: crank rotation (turns), slider position (cm), and when the links become collinear.

    ``collinear_turn`` is the crank rotation at that moment (turns), NaN if the coupler and the rocker never become collinear.
    ``compared`` is the last turn that is compared with others and with a line.
    """

    turns: FloatArray
    slider_cm: FloatArray
    collinear_turn: float
    compared: int = DRAWN_TURNS

    def turn(self, number: int) -> FloatArray:
        """Return the slider position (cm) over the turn ``number``, counted from 1, both ends included."""
        n = SAMPLES_PER_DRIFT_TURN
        return self.slider_cm[(number - 1) * n : number * n + 1]

    @property
    def until_collinear(self) -> FloatArray:
        """Return the slider position (cm), NaN from the moment at which the links are collinear."""
        return np.where(self.turns > self.collinear_turn, np.nan, self.slider_cm)

    @property
    def _last(self) -> int:
        """Return the number of the last whole turn before the links are collinear, at most ``compared``."""
        return int(np.fmin(self.compared, self.collinear_turn))

    @property
    def _ends(self) -> tuple[NDArray[np.int64], FloatArray]:
        """Return numbers of turns from the end of the transient on, and the slider position (cm) after so many turns.

        If no turn follows the transient, the numbers begin at 0.
        """
        last = self._last
        turns = np.arange(TRANSIENT_TURNS if last > TRANSIENT_TURNS else 0, last + 1)
        return turns, self.slider_cm[turns * SAMPLES_PER_DRIFT_TURN]

    @property
    def line(self) -> tuple[float, float]:
        """Return the least-squares line of the drift after the transient: slope (cm per turn), value at crank angle 0 (cm)."""
        rate, start = np.polyfit(*self._ends, 1)
        return float(rate), float(start)

    @property
    def rate(self) -> float:
        """Return the drift per turn after the transient (cm); see `line`."""
        return self.line[0]

    @property
    def bend(self) -> float:
        """Return the greatest distance of the drift at the ends of turns from the least-squares line, relative to its range."""
        turns, ends = self._ends
        return float(np.abs(ends - np.polyval(np.polyfit(turns, ends, 1), turns)).max() / np.ptp(ends))

    def unsteadiness(self, number: int) -> float:
        """Return the greatest change of the motion from turn ``number`` to the next, relative to the range of the next turn.

        The mean drift of each turn is subtracted first; the change is the range of the difference of the two turns.
        """
        share = np.linspace(0.0, 1.0, SAMPLES_PER_DRIFT_TURN + 1)
        one, other = (u - share * (u[-1] - u[0]) for u in map(self.turn, (number, number + 1)))
        return float(np.ptp(other - one) / np.ptp(other))

    @property
    def unsteadiest(self) -> float:
        """Return the greatest `unsteadiness` of the turns after the transient, up to ``compared``."""
        return max(self.unsteadiness(n) for n in range(TRANSIENT_TURNS + 1, self._last))

    @property
    def transient(self) -> float:
        """Return the number of turns before the first turn that is like the next one.

        If the motion never becomes steady, return the turn at which the links become collinear, or else `DRAWN_TURNS`.
        """
        end = float(np.nan_to_num(self.collinear_turn, nan=DRAWN_TURNS))
        return next((n - 1 for n in range(1, int(end)) if self.unsteadiness(n) <= ALIKE), end)


@cache
def drift(damping: float, gravity: float = 9.81) -> Drift:
    """Simulate the mechanism of Table 3.1 at 420 rpm without a spring, up to `DRIFT_TURNS` turns or the limit of assembly.

    The links count as collinear where the sine of the transmission angle falls below `COLLINEAR_SINE`.
    """
    angle = asin(COLLINEAR_SINE)
    run = simulate(
        table_3_1(0.0, damping, gravity),
        Inputs(speed=SPEED * RAD_S_PER_RPM),
        stop_time=DRIFT_TURNS * PERIOD,
        step=PERIOD / SAMPLES_PER_DRIFT_TURN,
        events=(
            Event(name="folded", output="transmission.angle", level=angle, direction=-1),
            Event(name="stretched", output="transmission.angle", level=pi - angle, direction=1),
        ),
    )
    first = run.events[0].time / PERIOD if run.events else np.nan
    return Drift(run["crank.angle"] / (2.0 * pi), CM_PER_METRE * run["slider.position"], first)


def drift_result() -> StudyResult:
    """Compute the drift with each of the five dampers, its distance from a straight line, and when links become collinear."""
    runs = {mu: drift(mu) for mu in DAMPINGS}
    accelerates = "the drift accelerates, and the oscillation about it grows"
    none = at_least(
        f"{_mu(DAMPINGS[0])}, cycles until collinear",
        FEWEST_TURNS,
        runs[DAMPINGS[0]].collinear_turn,
        "cycles",
        why="there is no second region",
    )
    shapes = [at_most(_mu(mu), ALIKE, run.unsteadiest, why=accelerates) for mu, run in runs.items() if mu > DAMPINGS[0]]
    bends = [at_most(_mu(mu), ALIKE, run.bend, why=accelerates) for mu, run in runs.items() if mu > DAMPINGS[0]]
    folds = {mu: run.collinear_turn for mu, run in runs.items()}
    sooner = [
        at_most(f"{_mu(weak)} over {plain(strong)}", 1.0, folds[weak] / folds[strong])
        for weak, strong in zip(folds, list(folds)[1:])
    ]
    (rate, start), (other_rate, other_start) = runs[5e5].line, runs[1e6].line
    collinear = f"coupler and rocker are within {degrees(asin(COLLINEAR_SINE)):.2f} deg of a straight line (our choice)"
    columns = {TURNS: max((run.turns for run in runs.values()), key=len)}
    columns |= {f"slider position u; {_mu(mu)} [cm]": run.until_collinear for mu, run in runs.items()}
    return StudyResult(
        claim="Without a spring the slider has a transient of two turns, then a steady motion about a linear drift. The "
        "weaker the damper, the sooner the links become collinear.",
        columns=pad_columns(columns),
        statements=(
            statement(
                "The first of these is a transient region of duration approximately two cycles.",
                "3.2.1, L1905-1907",
                f"number of cycles before the first steady one or, if there is none, until {collinear}. In a steady cycle "
                f"the motion, minus the line from end to end of the cycle, changes to the next cycle by at most {ALIKE:g} of "
                "its range, the rule for *steady*",
                "half a cycle, the rule where whole cycles are counted",
                *(near(_mu(mu), "2", run.transient, unit="cycles") for mu, run in runs.items()),
                why="with the two strongest dampers the first cycle is already like the second; with the others the motion "
                "never gets steady",
            ),
            statement(
                "The second consists of a steady periodic motion superimposed upon a drift.",
                "3.2.1, L1907-1911",
                "range of the difference between the motions of one cycle and the next, relative to the range of the next, "
                "after the line from end to end of each cycle is subtracted: the greatest. Cycles 3 to "
                f"{DRAWN_TURNS} (our choice), or until the links are collinear as in the row before",
                f"{ALIKE_WORDS}; {FEWEST_TURNS} cycles, two for the transient and two to compare",
                none,
                *shapes,
            ),
            statement(
                "The drift is linear with crank angle and may be described by the equation u=M. [theta2]+[u0] (3.9) where [M] "
                "and [u0] are constants depending on [mu].",
                "3.2.1, L1911-1917",
                f"greatest distance of u at the ends of cycles {TRANSIENT_TURNS} to {DRAWN_TURNS} (our choice), or until the "
                "links are collinear, from their least-squares line, relative to the drift. Then the relative "
                f"decrease in size of M and u0 from {_mu(5e5)} to 1e6",
                f"{ALIKE_WORDS}; *depending* means by more than that; {FEWEST_TURNS} cycles, two for the transient and two "
                "for a line",
                none,
                *bends,
                at_least("M depending on mu", ALIKE, 1.0 - other_rate / rate),
                at_least("u0 depending on mu", ALIKE, 1.0 - other_start / start),
            ),
            statement(
                "This indicates that for a small viscous force the linkage tends to collapse quickly into a collinear "
                "configuration. However, as the viscous force is increased this tendency is counteracted.",
                "3.2.1, L1917-1925",
                f"number of cycles until {collinear}, relative to the number with the next stronger damper",
                f"{SIGN}; *quickly* is read as sooner than with the next stronger damper",
                *sooner,
            ),
        ),
    )


def weightless_result() -> StudyResult:
    """Compute the drift with and without gravity for the five dampers."""
    columns = {TURNS: max((drift(mu).turns for mu in DAMPINGS), key=len)}
    for mu in DAMPINGS:
        columns[f"slider position u; {_mu(mu)} [cm]"] = drift(mu).until_collinear
        columns[f"slider position u without gravity; {_mu(mu)} [cm]"] = drift(mu, 0.0).until_collinear
    ratios = {mu: drift(mu, 0.0).rate / drift(mu).rate for mu in NEAR_LINEAR}
    return StudyResult(
        claim="Without gravity the rate M of the drift is slightly reduced.",
        columns=pad_columns(columns),
        statements=(
            statement(
                "It is clear from this figure that because the gravitational forces are eliminated the value of M in "
                "equation (3.9) is slightly reduced.",
                "3.2.1, L1928-1932",
                f"M from the ends of cycles {TRANSIENT_TURNS} to {DRAWN_TURNS} without gravity, relative to M with gravity, "
                "for the two dampers with which the drift is nearly linear",
                f"from {1 - SLIGHTLY:g} to {1 - ALIKE:g}, the rule for *slightly*",
                *(within(_mu(mu), 1.0 - SLIGHTLY, 1.0 - ALIKE, x) for mu, x in ratios.items()),
                why="M is negative, and its size grows by a quarter. With its sign it is reduced, but not slightly",
            ),
        ),
    )


def draw_drift(result: StudyResult) -> Figure:
    """Draw the drift over the first turns and over many turns.

    A cross marks where the links become collinear; dashed curves are without gravity.
    """
    turns = result.columns[TURNS]
    curves, others = [], []
    for colour, mu in zip(COLOURS, DAMPINGS):
        u = result.columns[f"slider position u; {_mu(mu)} [cm]"]
        curves.append(Curve(x=turns, y=u, label=scientific(mu), colour=colour))
        weightless = result.columns.get(f"slider position u without gravity; {_mu(mu)} [cm]")
        last = np.flatnonzero(np.isfinite(u))[-1:]
        if weightless is not None:
            others.append(Curve(x=turns, y=weightless, colour=colour, line="--"))
        elif turns[last] < turns[-1]:
            others.append(Curve(x=turns[last], y=u[last], colour=colour, line="", marker="x"))
    words = "without gravity" if others[0].line else "links collinear"
    key = replace(others[0], x=[], y=[], colour="0.3", label=words)
    first = Panel(
        x_label="turns of the crank",
        y_label="slider position u [cm]",
        curves=[replace(curve, label="") for curve in (*curves, *others)],
        x_range=(0.0, 10.0),
        y_range=(-8.5, 2.0),
    )
    second = replace(
        first, curves=[*curves, *others, key], legend=DAMPING_LEGEND, legend_at="above", x_range=(0.0, 40.0)
    )
    return plot_curves([first, second], title=result.heading, columns=2, size=(4.6, 3.7))


#: The studies of 3.2 and 3.3.
STUDIES = {
    "3.2": Study(drift_result, draw_drift, sweeps=("slider.damping",)),
    "3.3": Study(weightless_result, draw_drift, sweeps=("slider.damping", "gravity")),
}
