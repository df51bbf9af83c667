"""The figures of chapter III: the five-bar slider of Table 3.1 driven at 420 rpm, and those of `free_crank`.

What the thesis reads from its graphs is judged to `ON_THE_GRAPH` of what the graph shows, and what it calls linear to `LINEAR`,
unless it gives a number.

Without a spring (3.2, 3.3) the slider does not drift linearly: gravity and the mean of the inertia forces push it towards the
crank, and the nearer it comes the harder they push. Only with the two strongest dampers is the drift near enough to a line over
the first turns to have a rate. Gravity holds it back: without it, the drift is a quarter greater. With a spring (3.4, 3.5) the
steady motion is about what the text says, but the torque differs most where it reverses, not at its extremes, and not where the
slider's accelerations differ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import asin, log, pi

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.published import DYN_CM_PER_NEWTON_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import mean_effective_mass
from ...run import Event, Inputs, Trajectory, simulate
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, curves_of, near, padded, text
from . import free_crank
from .runs import (
    LINEAR,
    ON_THE_GRAPH,
    SPEED,
    STIFFNESSES,
    SteadyTurn,
    greatest,
    greatest_ratio,
    least,
    plain,
    scientific,
    steady_turn,
    table_3_1,
)

#: Dampings of Fig 3.2 and 3.3 (dyn.s/cm).
DAMPINGS = (1e4, 5e4, 1e5, 5e5, 1e6)
#: Time of a turn (s).
PERIOD = 60.0 / SPEED
#: Transmission at which the coupler and the rocker count as collinear: |sin(th4 - th3)|.
COLLINEAR_SINE = 0.3
#: Turns of a run without a spring.
DRIFT_TURNS = 40
SAMPLES_PER_DRIFT_TURN = 120
#: By damping (dyn.s/cm): turns at which coupler and rocker are collinear, and half a unit of the last figure given.
COLLINEAR = {1e4: (3.0, 0.05), 5e4: (4.9, 0.05), 1e5: (8.0, 0.05), 5e5: (36.0, 0.5)}
#: Dampers (dyn.s/cm) with which the drift is nearly linear.
NEAR_LINEAR = (5e5, 1e6)
#: By stiffness (dyn/cm): crank angle of the least position (deg) and mean position (cm).
STEADY = {5e5: (23.45, -0.611), 1e6: (17.5, -0.280), 2e6: (5.2, -0.142)}

TURNS, ANGLE = "turns of the crank [1]", "crank angle [deg]"
DAMPING_LEGEND, STIFFNESS_LEGEND = r"damping $\mu$ [dyn s/cm]", "stiffness k [dyn/cm]"


def _mu(damping: float) -> str:
    return f"mu = {plain(damping)} dyn.s/cm"


def _k(stiffness: float) -> str:
    return f"k = {plain(stiffness)} dyn/cm"


# --- 3.2 and 3.3: no spring


@dataclass(frozen=True, slots=True)
class Drift:
    """Motion of the slider without a spring: turns of the crank, slider position (cm), turn at which the links are collinear.

    ``collinear_turn`` is NaN if they never are.
    """

    turns: NDArray[np.float64]
    slider_cm: NDArray[np.float64]
    collinear_turn: float

    def turn(self, number: int) -> NDArray[np.float64]:
        """Return the slider position over a turn (cm), counted from 1, both ends included."""
        n = SAMPLES_PER_DRIFT_TURN
        return self.slider_cm[(number - 1) * n : number * n + 1]

    def per_turn(self, number: int) -> float:
        """Return the drift over a turn (cm)."""
        return float(self.turn(number)[-1] - self.turn(number)[0])

    @property
    def until_collinear(self) -> NDArray[np.float64]:
        """Slider position (cm), NaN from the moment the links are collinear."""
        return np.where(self.turns > self.collinear_turn, np.nan, self.slider_cm)

    @property
    def growth(self) -> float:
        """Drift over the third turn relative to the first: 1 if it is linear."""
        return self.per_turn(3) / self.per_turn(1)

    @property
    def unsteadiness(self) -> float:
        """Difference in shape between the motions over the fourth and the third turn, relative to the range of the fourth."""
        line = np.linspace(0.0, self.per_turn(4), SAMPLES_PER_DRIFT_TURN + 1)
        return float(np.ptp(self.turn(4) - self.turn(3)) / np.ptp(self.turn(4) - line))


@cache
def drift(damping: float, gravity: float = 9.81) -> Drift:
    """Run Table 3.1 at 420 rpm without a spring, up to the limit of assembly."""
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
    """Compute the drift with the five dampers, its departure from a line, and when the links become collinear."""
    runs = {mu: drift(mu) for mu in DAMPINGS}
    settling, shapes, drifts, folds = [], [], [], []
    for mu, run in runs.items():
        parameters = table_3_1(0.0, mu)
        turns = -log(ON_THE_GRAPH) * mean_effective_mass(parameters) / parameters.slider_damping / PERIOD
        statement, why = (
            f"turns of a transient down to 5 %; {_mu(mu)}",
            "" if mu == 1e4 else "the damper ends it sooner",
        )
        settling.append(near(statement, text("L1907"), 2.0, turns, 0.5, why=why))
        statement, why = f"third turn's drift relative to the first's; {_mu(mu)}", "" if mu >= 5e5 else "it accelerates"
        drifts.append(near(statement, text("L1911"), 1.0, run.growth, LINEAR, why=why))
        if mu > 1e4:
            statement = (
                f"change of the motion's shape from the third turn to the fourth, relative to its range; {_mu(mu)}"
            )
            shapes.append(at_most(statement, text("L1909"), LINEAR, run.unsteadiness, why=why))
        if mu in COLLINEAR:
            stated, tolerance = COLLINEAR[mu]
            folds.append(near(f"links collinear; {_mu(mu)}", OURS, stated, run.collinear_turn, tolerance, "turns"))
    rates = greatest_ratio(np.array([run.per_turn(3) for run in runs.values()]))
    # with the strongest damper the links never are collinear
    sooner = greatest_ratio(np.array([runs[mu].collinear_turn for mu in reversed(COLLINEAR)]))
    gain = min(abs(run.per_turn(3)) - abs(run.per_turn(1)) for run in runs.values())
    columns = {TURNS: max((run.turns for run in runs.values()), key=len)}
    columns |= {f"slider position u; {_mu(mu)} [cm]": run.until_collinear for mu, run in runs.items()}
    return StudyResult(
        number="3.2",
        claim="Without a spring the slider has a transient of two turns, then a steady motion about a linear drift; the "
        "weaker the damper, the sooner the links come collinear.",
        columns=padded(columns),
        verdicts=(
            *(*settling, *shapes, *drifts),
            at_most("third turn's drift relative to that with the next weaker damper", text("L1917"), 1.0, rates),
            at_most("turns until collinear relative to the next stronger damper", text("L1919"), 1.0, sooner),
            at_least("third turn's drift less the first's, least of all dampers", OURS, 0.0, gain, "cm"),
            *folds,
        ),
    )


def weightless_result() -> StudyResult:
    """Compute the drift with and without gravity for the five dampers."""
    columns = {TURNS: max((drift(mu).turns for mu in DAMPINGS), key=len)}
    for mu in DAMPINGS:
        columns[f"slider position u; {_mu(mu)} [cm]"] = drift(mu).until_collinear
        columns[f"slider position u without gravity; {_mu(mu)} [cm]"] = drift(mu, 0.0).until_collinear
    verdicts, why = [], "M is negative, and reduced only with its sign"
    for mu in NEAR_LINEAR:
        weighing, weightless = (sum(drift(mu, g).per_turn(n) for n in (1, 2, 3)) / 3.0 for g in (9.81, 0.0))
        ratio, statement = weightless / weighing, f"M without gravity less M with it; {_mu(mu)}"
        verdicts += [
            at_most(f"size of M without gravity over that with it; {_mu(mu)}", text("L1930"), 1.0, ratio, why=why),
            at_most(statement, text("L1930"), 0.0, weightless - weighing, "cm a turn"),
            near(f"drift over three turns without gravity over that with it; {_mu(mu)}", OURS, 1.25, ratio, 0.03),
        ]
    for words, g, stated in (("with gravity", 9.81, -1.93), ("without gravity", 0.0, -2.38)):
        u = drift(1e6, g).slider_cm[-1]
        verdicts.append(near(f"u after forty turns {words}; {_mu(1e6)}", OURS, stated, u, 0.005, "cm"))
    return StudyResult(
        number="3.3",
        claim="Without gravity M, the rate of the drift, is slightly reduced.",
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def draw_drift(result: StudyResult) -> Figure:
    """Draw the drift over the first turns and over many, with a cross at collinear links or dashed curves without gravity."""
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
        first, curves=[*curves, *others, key], legend=DAMPING_LEGEND, legend_at="lower center", x_range=(0.0, 40.0)
    )
    return plot_curves([first, second], title=result.heading, columns=2, size=(4.6, 3.7))


# --- 3.4 and 3.5: three springs


@cache
def from_rest(stiffness: float) -> Trajectory:
    """Run three turns from the thesis's start, th2 = u = u' = 0."""
    inputs = Inputs(speed=SPEED * RAD_S_PER_RPM)
    return simulate(table_3_1(stiffness), inputs, stop_time=3.0 * PERIOD, step=PERIOD / 360.0)


def _steady(stiffness: float) -> SteadyTurn:
    return steady_turn(table_3_1(stiffness), SPEED)


def steady_result() -> StudyResult:
    """Compute the motion from rest and the steady turn with each spring."""
    turns = {k: _steady(k) for k in STIFFNESSES}
    columns = {ANGLE: turns[1e6].angle_deg}
    columns |= {f"slider position u; {_k(k)} [cm]": turn.slider_cm for k, turn in turns.items()}
    starts = {k: from_rest(k) for k in STIFFNESSES}
    columns[TURNS] = np.linspace(0.0, 3.0, len(starts[1e6]))
    columns |= {f"u from the start; {_k(k)} [cm]": CM_PER_METRE * run["slider.position"] for k, run in starts.items()}
    return StudyResult(
        number="3.4",
        assignment='The scan has "220" for the crank angle of the least position (L1962): read as 22 deg.',
        claim="After a turn of transient the slider swings steadily between its start and the crank shaft; a stiffer spring "
        "moves the mean position towards the start, and the least position to a smaller crank angle.",
        columns=padded(columns),
        verdicts=(*_steady_verdicts(), *_shape_verdicts()),
    )


def _steady_verdicts() -> list[Verdict]:
    """Judge transient, mean and least position, and compare with reference numbers."""
    turns = {k: _steady(k) for k in STIFFNESSES}
    places = {k: least(turn.angle_deg, turn.slider_cm)[0] for k, turn in turns.items()}
    means = {k: turn.slider_cm[:-1].mean() for k, turn in turns.items()}
    verdicts = []
    for k, turn in turns.items():
        second = CM_PER_METRE * from_rest(k)["slider.position"][360:720]
        away = np.abs(second - turn.slider_cm[:-1:4]).max() / np.ptp(turn.slider_cm)
        statement = f"distance from the steady motion in the second turn, relative to its range; {_k(k)}"
        why = "" if k == 2e6 else "the transient goes on"
        verdicts.append(at_most(statement, text("L1948"), ON_THE_GRAPH, away, why=why))
    change, softer = (
        max(turn.change for turn in turns.values()),
        "{} relative to that with the next softer spring".format,
    )
    sooner, nearer = (greatest_ratio(np.array(list(x.values()))) for x in (places, means))
    verdicts += [
        at_most("change of u from one turn to the next", text("L1950"), 1e-7, change, "cm"),
        at_most("mean of u, greatest of the three springs", text("L1952"), 0.0, max(means.values()), "cm"),
        at_most(softer("mean of u"), text("L1954"), 1.0, nearer),
        # 22 and 0 were read from a figure
        near(f"crank angle of the least u; {_k(5e5)}", text("L1962"), 22.0, places[5e5], 2.0, "deg"),
        at_most(softer("crank angle of the least u"), text("L1964"), 1.0, sooner),
        near(
            f"crank angle of the least u; {_k(2e6)}", text("L1966"), 0.0, places[2e6], 2.0, "deg", why="it comes later"
        ),
    ]
    for k, (angle, mean) in STEADY.items():
        verdicts.append(near(f"place of the least u; {_k(k)}", OURS, angle, places[k], 0.05, "deg"))
        verdicts.append(near(f"mean of u; {_k(k)}", OURS, mean, means[k], 5e-4, "cm"))
    u = turns[1e6].slider_cm[0]
    return [*verdicts, near(f"u at crank angle 0; {_k(1e6)}", OURS, -0.89553115, u, 2e-8, "cm")]


def _shape_verdicts() -> list[Verdict]:
    """Judge the slopes between the least and the greatest position, and the width of the curves."""
    turns = [_steady(k) for k in STIFFNESSES]
    ends = np.array([[find(t.angle_deg, t.slider_cm)[0] for find in (least, greatest)] for t in turns])
    widths, ranges = np.diff(ends, axis=1)[:, 0] % 360.0, np.array([np.ptp(t.slider_cm) for t in turns])
    rise, fall = (each.max() / each.min() for each in (ranges / widths, ranges / (360.0 - widths)))
    stiff = _steady(1e7)
    high, low = int(stiff.slider_cm.argmax()), int(stiff.slider_cm.argmin())
    slope = np.diff(np.tile(stiff.slider_cm[:-1], 2))[high : high + (low - high) % (len(stiff.slider_cm) - 1)]
    varies = np.ptp(slope) / abs(slope.mean())
    same = "mean slope of u from the {} to the {}, greatest over least of the three springs".format
    width = "width of the curve {}, relative to that with the next softer spring".format
    steeper, wider, swings = (
        "steeper with a stiffer spring",
        "only the angle shrinks",
        "the slider swings on its spring",
    )
    return [
        near(same("least", "greatest"), text("L1968"), 1.0, rise, 0.2, why=steeper),
        near(same("greatest", "least"), text("L1968"), 1.0, fall, 0.2),
        at_most(width("in crank angle from least to greatest"), text("L1976"), 1.0, greatest_ratio(widths)),
        at_most(width("in u from least to greatest"), text("L1976"), 1.0, greatest_ratio(ranges), why=wider),
        near(f"range of the slope of the fall over its mean; {_k(1e7)}", text("L1980"), 0.0, varies, 0.2, why=swings),
    ]


def draw_steady(result: StudyResult) -> Figure:
    """Draw the motion from the start over three turns, and the steady turns with a cross at each least position."""
    columns = result.columns
    from_start = {f"u from the start; {_k(k)} [cm]": scientific(k) for k in STIFFNESSES}
    names = [f"slider position u; {_k(k)} [cm]" for k in STIFFNESSES]
    crosses = []
    for colour, name in zip(COLOURS, names):
        place, value = least(columns[ANGLE][:1441], columns[name][:1441])
        crosses.append(Curve(x=[place], y=[value], colour=colour, line="", marker="x"))
    first = Panel(
        x_label="turns of the crank",
        y_label="slider position u [cm]",
        curves=curves_of(result, TURNS, dict.fromkeys(from_start, "")),
        x_range=(0.0, 3.0),
        title="from the start",
    )
    second = Panel(
        x_label="crank angle [deg]",
        y_label="slider position u [cm]",
        curves=[
            *curves_of(result, ANGLE, dict(zip(names, from_start.values()))),
            *crosses,
            Curve(x=[], y=[], colour="0.3", line="", marker="x", label="least"),
        ],
        legend=STIFFNESS_LEGEND,
        x_range=(0.0, 360.0),
        x_ticks=range(0, 361, 90),
        title="steady",
    )
    return plot_curves([first, second], title=result.heading, columns=2, size=(4.6, 3.7))


def torque_result() -> StudyResult:
    """Compute the torque over the steady turn with each spring, and where it depends on the spring."""
    turns = {k: _steady(k) for k in STIFFNESSES}
    angle, torque = turns[1e6].angle_deg, turns[1e6].torque
    # in dyn.cm, as stated
    high_at, high = greatest(angle, DYN_CM_PER_NEWTON_METRE * torque)
    low_at, low = least(angle, DYN_CM_PER_NEWTON_METRE * torque)
    peak = np.abs(torque).max()
    spread = np.ptp([turn.torque for turn in turns.values()], axis=0) / peak
    away = np.min([np.abs((angle - at + 180.0) % 360.0 - 180.0) for at in (high_at, low_at)], axis=0)
    # in the last part of the turn the torque only falls
    reversal = np.interp(0.0, -torque[1320:], angle[1320:]) - 360.0
    rates = {k: np.gradient(turn.slider_cm / CM_PER_METRE, PERIOD / (len(angle) - 1)) for k, turn in turns.items()}
    # the differences at the ends are of first order only
    accelerations = np.ptp([np.gradient(rate) for rate in rates.values()], axis=0)[2:-2]
    losses = {
        k: table_3_1(k).slider_damping * (rate[:-1] ** 2).mean() * PERIOD / (2.0 * pi) for k, rate in rates.items()
    }
    unpaid = max(abs(turns[k].torque[:-1].mean() - losses[k]) for k in turns) / peak
    elsewhere, in_the_reversal = spread[away > 30.0].max(), "it is greatest in the reversal between them"
    nearest = "angle from the greatest difference of the {} to the nearer extreme of the torque".format
    columns = {ANGLE: angle}
    columns |= {f"crank torque; {_k(k)} [N.m]": turn.torque for k, turn in turns.items()}
    return StudyResult(
        number="3.5",
        claim="The torque that holds the speed reverses suddenly about crank angle 0, and depends on the spring only at its "
        "extremes, where the slider's accelerations differ.",
        columns=columns,
        verdicts=(
            near("crank angle of the sudden reversal", text("L1993"), 0.0, reversal, 10.0, "deg"),
            at_most("difference between springs 30 deg from extremes", text("L1995"), ON_THE_GRAPH, elsewhere),
            near(nearest("torque"), text("L1999, L2019"), 0.0, away[spread.argmax()], 10.0, "deg", why=in_the_reversal),
            near(
                nearest("slider's acceleration"),
                text("L2001, L2023"),
                0.0,
                away[2 + accelerations.argmax()],
                10.0,
                "deg",
                why="they differ most where the torque hardly does",
            ),
            at_most("mean torque beyond the damper's, over the peak", text("L2007-2017"), 1e-5, unpaid),
            near("difference between k = 5e5 and 2e6, relative to the peak", OURS, 0.096, spread.max(), 5e-4),
            near("greatest torque; k = 1e6 dyn/cm", OURS, 1.46e7, high, 0.005e7, "dyn.cm"),
            near("crank angle of the greatest torque", OURS, 327.0, high_at, 0.5, "deg"),
            near("least torque; k = 1e6 dyn/cm", OURS, -2.00e7, low, 0.005e7, "dyn.cm"),
            near("crank angle of the least torque", OURS, 16.0, low_at, 0.5, "deg"),
        ),
    )


def draw_torque(result: StudyResult) -> Figure:
    """Draw the three torques over a turn."""
    panel = Panel(
        x_label="crank angle [deg]",
        y_label="crank torque [N m]",
        curves=curves_of(result, ANGLE, {f"crank torque; {_k(k)} [N.m]": scientific(k) for k in STIFFNESSES}),
        legend=STIFFNESS_LEGEND,
        legend_at="upper center",
        x_range=(0.0, 360.0),
        x_ticks=range(0, 361, 45),
    )
    return plot_curves([panel], title=result.heading)


#: The studies by number.
STUDIES = {
    study.number: study
    for study in (
        Study("3.2", drift_result, draw_drift),
        Study("3.3", weightless_result, draw_drift),
        Study("3.4", steady_result, draw_steady),
        Study("3.5", torque_result, draw_torque),
        *free_crank.STUDIES,
    )
}
