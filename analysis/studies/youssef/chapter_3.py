"""Figures 3.4 and 3.5: the five-bar slider of Table 3.1 at 420 rpm with three springs.

Figures 3.2 and 3.3 are in `no_spring`, Figures 3.6 to 3.10 in `launches`, Figures 3.11 to 3.14 in `free_crank`. The arguments
``stiffness``, ``soft`` and ``stiff`` are stiffnesses of springs in dyn/cm.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from linkwork.five_bar.published import DYN_PER_CM_PER_NEWTON_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import mean_effective_mass
from ...run import Inputs, Trajectory, simulate
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ...youssef import balance
from ..rules import ABOUT, ABOUT_DEG, ALIKE, READ_DEG, SLIGHTLY
from ..statements import FloatArray, Statement, at_least, at_most, near, statement, within
from ..study import Study, StudyResult, pad_columns, result_curves
from ..variation import cache, compared_values
from . import free_crank, launches, no_spring, runs

ANGLE = "crank angle [deg]"
STIFFNESS_LEGEND = "stiffness k [dyn/cm]"


def _k(stiffness: float) -> str:
    return f"k = {runs.plain(stiffness)} dyn/cm"


@cache
def run_from_rest(stiffness: float) -> Trajectory:
    """Run three turns from the thesis's start, th2 = u = u' = 0."""
    inputs = Inputs(speed=runs.SPEED * RAD_S_PER_RPM)
    return simulate(runs.table_3_1(stiffness), inputs, stop_time=3.0 * runs.PERIOD, step=runs.PERIOD / 360.0)


def _steady(stiffness: float) -> runs.SteadyTurn:
    return runs.steady_turn(runs.table_3_1(stiffness), runs.SPEED)


def springs() -> tuple[float, ...]:
    """Return the spring stiffnesses (dyn/cm) that Fig 3.4 compares, or only the reader's stiffness if the reader has set it."""
    return compared_values("slider.stiffness", runs.STIFFNESSES, "N/m", DYN_PER_CM_PER_NEWTON_PER_METRE)


def transient(stiffness: float, number: int = 0) -> float:
    """Return the greatest distance of u from the steady motion in a turn after the start, relative to the range of u.

    ``number`` is the index of the turn; the first turn after the start has the index 0.
    """
    steady = _steady(stiffness).slider_cm
    started = CM_PER_METRE * run_from_rest(stiffness)["slider.position"][360 * number : 360 * (number + 1)]
    return float(np.abs(started - steady[:-1:4]).max() / np.ptp(steady))


def steady_result() -> StudyResult:
    """Compute the motion from rest and the steady turn with each spring."""
    turns = {k: _steady(k) for k in springs()}
    columns = {ANGLE: next(iter(turns.values())).angle_deg}
    columns |= {f"slider position u; {_k(k)} [cm]": turn.slider_cm for k, turn in turns.items()}
    starts = {k: run_from_rest(k) for k in turns}
    columns[runs.TURNS] = np.linspace(0.0, 3.0, len(next(iter(starts.values()))))
    columns |= {f"u from the start; {_k(k)} [cm]": CM_PER_METRE * run["slider.position"] for k, run in starts.items()}
    return StudyResult(
        assignment='The scan has "220" for the crank angle of the least position (L1962): read as 22 deg.',
        claim="After a transient of one turn the slider oscillates steadily between its start and the crank shaft. A "
        "stiffer spring moves the mean position towards the start, and the least position to a smaller crank angle.",
        columns=pad_columns(columns),
        # the statements compare the three springs
        statements=(*_steady_statements(), *_shape_statements()) if springs() == runs.STIFFNESSES else (),
    )


def _steady_statements() -> Iterator[Statement]:
    """Judge the statements on the transient, and on the mean and the least slider position."""
    turns = {k: _steady(k) for k in runs.STIFFNESSES}
    places = {k: runs.least(turn.angle_deg, turn.slider_cm)[0] for k, turn in turns.items()}
    means = {k: turn.slider_cm[:-1].mean() for k, turn in turns.items()}
    first, second = ({k: transient(k, number) for k in turns} for number in (0, 1))
    change = max(t.relative_change for t in turns.values())
    shaft = -CM_PER_METRE * runs.table_3_1(0.0).ground_length
    later = "with the softer springs the transient lasts longer"
    yield statement(
        "The figure shows that due to the initial condition assumptions that u and [u' = 0] a transient effect "
        "is shown over the first cycle.",
        "3.2.1, L1944-1948",
        "greatest distance of u from the steady motion in the first and the second cycle, relative to its range. For "
        "*due to*: change of u from cycle to cycle after a start in the steady motion, to one digit, since it is an error "
        "of the integration. *Over the first cycle* is read as no longer than that",
        runs.ALIKE_WORDS,
        at_least("first cycle, least of the springs", ALIKE, min(first.values())),
        at_most("started in the steady motion, greatest of the springs", ALIKE, change),
        *(at_most(f"second cycle; {_k(k)}", ALIKE, x, why=later) for k, x in second.items()),
    )
    yield statement(
        "The steady state motion is periodic and oscillates about a mean position between the initial position "
        "of the slider and the crank shaft.",
        "3.2.1, L1948-1954",
        "change of u from one cycle to the next, relative to its range, as in the row before; mean of u. The start is at "
        f"u = 0, the shaft at {shaft:g} cm",
        runs.ALIKE_WORDS,
        at_most("change, greatest of the springs", ALIKE, change),
        *(within(f"mean; {_k(k)}", shaft, 0.0, x, "cm") for k, x in means.items()),
    )
    yield statement(
        "This mean position shifts towards the slider initial position as the spring stiffness is increased.",
        "3.2.1, L1954-1958",
        "mean of u, which is negative, relative to the mean with the next softer spring; the greater of the two ratios",
        runs.SIGN,
        at_most("greatest", 1.0, runs.greatest_ratio(np.array(list(means.values())))),
    )
    yield statement(
        "The minimum value of the oscillation for the case of k=5[x 10^5] dyne/cm occurs at crank angle [theta2 = 22 deg].",
        "3.2.1, L1958-1962",
        "crank angle of the least u",
        f"{READ_DEG:g} deg, to which a graph can be read",
        near(_k(5e5), "22", places[5e5], READ_DEG, "deg"),
    )
    yield statement(
        "However, as k is increased this minimum oscillation occurs at smaller crank angle and eventually occurs "
        "at zero degrees for k=2[x 10^6 dyne/cm].",
        "3.2.1, L1962-1966",
        "crank angle of the least u: its change from each spring to the next stiffer one, and its value",
        f"{runs.SIGN}; {READ_DEG:g} deg, to which a graph can be read",
        at_most("growth to k = 1e6 dyn/cm", 0.0, places[1e6] - places[5e5], "deg"),
        at_most("growth from 1e6 to 2e6 dyn/cm", 0.0, places[2e6] - places[1e6], "deg"),
        near(_k(2e6), "0", places[2e6], READ_DEG, "deg", why="the minimum comes later"),
    )


def _shape_statements() -> Iterator[Statement]:
    """Judge the statements on the slopes between the least and the greatest position, and on the width of the curves."""
    turns = [_steady(k) for k in runs.STIFFNESSES]
    ends = np.array([[find(t.angle_deg, t.slider_cm)[0] for find in (runs.least, runs.greatest)] for t in turns])
    widths, ranges = np.diff(ends, axis=1)[:, 0] % 360.0, np.array([np.ptp(t.slider_cm) for t in turns])
    rise, fall = (each.max() / each.min() for each in (ranges / widths, ranges / (360.0 - widths)))
    shares = np.array([spring_share(k) for k in runs.STIFFNESSES])
    varies = {}
    for k in (1e7, 1e8, 1e9):
        u = _steady(k).slider_cm
        high, low = int(u.argmax()), int(u.argmin())
        part = np.tile(u[:-1], 2)[high : high + (low - high) % (len(u) - 1) + 1]
        varies[k] = runs.distance_from_line(np.linspace(0.0, 1.0, len(part)), (part - part[0]) / (part[-1] - part[0]))
    yield statement(
        "The rate of change of the slider position is approximately the same for all the response curves between "
        "the minimum and maximum values.",
        "3.2.1, L1966-1972",
        "mean slope of u between the two values (our choice), the greatest of the three springs divided by the least",
        f"{ABOUT:g}, the rule for *approximately*",
        at_most(
            "from the least to the greatest u", 1.0 + ABOUT, rise, why="the slope is steeper with a stiffer spring"
        ),
        at_most("from the greatest to the least u", 1.0 + ABOUT, fall),
    )
    yield statement(
        "However, as the spring stiffness is increased the spring force becomes dominant and the width of the "
        "response curve is decreased.",
        "3.2.1, L1972-1976",
        "width, read as the crank angle from the least to the greatest u, relative to the width with the next softer "
        "spring. Then the range of the spring's force over the turn (our choice), divided by the greater of two ranges: "
        "that of the damper's force and that of the mean effective mass at u = 0 times the acceleration",
        f"{runs.SIGN}; at least 1, as *dominant* says",
        at_most("width, greatest", 1.0, runs.greatest_ratio(widths)),
        at_least("growth of the spring's share, least", 0.0, np.diff(shares).min()),
        at_least(f"spring's share; {_k(2e6)}", 1.0, shares[-1], why="the inertia force is greater than the spring's"),
    )
    yield statement(
        "Eventually, although not shown on this figure, as k increases further the slope of the response curve "
        "takes a constant value between the maximum and minimum values of the oscillation on the portions of the "
        "curve below the zero degree crank angle positions.",
        "3.2.1, L1976-1986",
        "greatest distance of u, on the way from its greatest to its least value, from the best line parallel to the chord "
        "between the two, relative to the range of u. The springs are our choice: with them the least value comes before "
        "360 deg",
        runs.ALIKE_WORDS,
        *(at_most(_k(k), ALIKE, x) for k, x in varies.items()),
        why="with k = 1e7 and 1e8 dyn/cm the slider also swings on the spring; in the limit u is the inertia force over k, "
        "which is not linear in the crank angle",
    )


def draw_steady(result: StudyResult) -> Figure:
    """Draw the motion over three turns from the start, and one steady turn per spring with a cross at its least position."""
    columns = result.columns
    from_start = {f"u from the start; {_k(k)} [cm]": runs.scientific(k) for k in springs()}
    names = [f"slider position u; {_k(k)} [cm]" for k in springs()]
    crosses = []
    for colour, name in zip(COLOURS, names):
        place, value = runs.least(columns[ANGLE][:1441], columns[name][:1441])
        crosses.append(Curve(x=[place], y=[value], colour=colour, line="", marker="x"))
    first = Panel(
        x_label="turns of the crank",
        y_label="slider position u [cm]",
        curves=result_curves(result, runs.TURNS, dict.fromkeys(from_start, "")),
        x_range=(0.0, 3.0),
        title="from the start",
    )
    second = Panel(
        x_label="crank angle [deg]",
        y_label="slider position u [cm]",
        curves=[
            *result_curves(result, ANGLE, dict(zip(names, from_start.values()))),
            *crosses,
            Curve(x=[], y=[], colour="0.3", line="", marker="x", label="least"),
        ],
        legend=STIFFNESS_LEGEND,
        x_range=(0.0, 360.0),
        x_ticks=range(0, 361, 90),
        title="steady",
    )
    return plot_curves([first, second], title=result.heading, columns=2, size=(4.6, 3.7))


@dataclass(frozen=True, slots=True)
class Parts:
    """Crank torque over a steady turn at constant speed (N.m), and its parts due to slider acceleration and to gravity."""

    whole: FloatArray
    acceleration: FloatArray
    gravity: FloatArray


def slider_motion(stiffness: float) -> list[FloatArray]:
    """Return u, u' and u'' over the steady turn (SI); the derivatives are computed from the Fourier series of u."""
    u = _steady(stiffness).slider_cm[:-1] / CM_PER_METRE
    waves = np.fft.rfft(u)
    order = 1j * runs.SPEED * RAD_S_PER_RPM * np.arange(len(waves))
    return [np.fft.irfft(order**n * waves, len(u)) for n in range(3)]


def spring_share(stiffness: float) -> float:
    """Return the range of the spring force divided by the greater of the ranges of damper force and inertia force.

    All ranges are those over the steady turn; the inertia force is the mean effective mass times the acceleration.
    """
    p = runs.table_3_1(stiffness)
    factors = (p.slider_stiffness, p.slider_damping, mean_effective_mass(p))
    spring, *others = (np.ptp(factor * x) for factor, x in zip(factors, slider_motion(stiffness)))
    return float(spring / max(others))


def parts(stiffness: float) -> Parts:
    """Return the crank torque over the steady turn, and its parts."""
    parameters, speed = runs.table_3_1(stiffness), runs.SPEED * RAD_S_PER_RPM
    angle, (u, v, a) = np.radians(_steady(stiffness).angle_deg[:-1]), slider_motion(stiffness)
    whole, unaccelerated, weightless = (
        balance(angle, u, v, x, speed, p.constants()).torque
        for x, p in ((a, parameters), (0.0 * a, parameters), (a, replace(parameters, gravity=0.0)))
    )
    return Parts(whole, whole - unaccelerated, whole - weightless)


def position_torque(soft: float, stiff: float) -> FloatArray:
    """Return the part (N.m) of the difference in steady torque between two springs that only the slider's position causes.

    It is the mean of two differences in which only the position changes: one with u' and u'' of the softer spring, the other
    with those of the stiffer spring.
    """
    angle, p = np.radians(_steady(soft).angle_deg[:-1]), runs.table_3_1(soft).constants()
    motions = [slider_motion(soft), slider_motion(stiff)]
    torques = [
        balance(angle, u, v, a, runs.SPEED * RAD_S_PER_RPM, p).torque for _, v, a in motions for u, *_ in motions
    ]
    return np.array((torques[1] - torques[0] + torques[3] - torques[2]) / 2.0)


def damper_torque(stiffness: float) -> FloatArray:
    """Return the crank torque (N.m) over a steady turn that supplies the power lost in the damper."""
    return runs.table_3_1(stiffness).slider_damping * slider_motion(stiffness)[1] ** 2 / (runs.SPEED * RAD_S_PER_RPM)


def graph_distance(x: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the distance of each point of the curve ``one`` from the nearest point of the curve ``other``.

    Both curves have the abscissas ``x`` and the period 1.
    """
    import shapely

    line = [np.column_stack([x[:-1] + shift, other[:-1]]) for shift in (-1.0, 0.0, 1.0)]
    return np.asarray(shapely.distance(shapely.points(x, one), shapely.LineString(np.concatenate(line))))


def torque_result() -> StudyResult:
    """Compute the torque over the steady turn with each spring, and judge the statements on Fig 3.5."""
    turns = {k: _steady(k) for k in runs.STIFFNESSES}
    columns = {ANGLE: turns[1e6].angle_deg}
    columns |= {f"crank torque; {_k(k)} [N.m]": turn.torque for k, turn in turns.items()}
    return StudyResult(
        claim="The torque that holds the speed reverses suddenly about crank angle 0. It depends on the spring only at its "
        "extremes, where the slider's accelerations differ.",
        columns=columns,
        statements=(*_torque_curves(), *_torque_causes(), _torque_conclusion()),
    )


def _torques() -> tuple[FloatArray, FloatArray, dict[str, float]]:
    """Return crank angles (deg), the torques with three springs, and the extremes of the torque with 1e6 dyn/cm.

    The extremes are the crank angles (deg) at which this torque is greatest and least.
    """
    angle, torque = _steady(1e6).angle_deg, np.array([_steady(k).torque for k in runs.STIFFNESSES])
    return angle, torque, {"greatest": runs.greatest(angle, torque[1])[0], "least": runs.least(angle, torque[1])[0]}


def _torque_curves() -> Iterator[Statement]:
    """Judge the statements on the shape of the curves and on their distance from each other."""
    angle, torque, places = _torques()
    away = np.min([np.abs((angle - at + 180.0) % 360.0 - 180.0) for at in places.values()], axis=0)
    # in the last part of the turn the torques only fall
    reversals = [np.interp(0.0, -curve[1320:], angle[1320:]) - 360.0 for curve in torque]
    between = 0.5 * (angle[:-1] + angle[1:])
    steepest = [(runs.greatest(between, np.abs(np.diff(curve)))[0] + 180.0) % 360.0 - 180.0 for curve in torque]
    curves = torque / np.ptp(torque)
    seen = [graph_distance(angle / 360.0, curves[i], curves[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    extremes = {"greatest": torque.max(axis=1), "least": torque.min(axis=1)}
    yield statement(
        "The striking feature of the figure is the sudden reversal in torque in the region of [theta2 = 0 deg].",
        "3.2.1, L1991-1993",
        "crank angle at which the torque passes zero between its greatest and its least value; for *sudden*, crank "
        "angle of its steepest change in the whole turn",
        f"{ABOUT_DEG:g} deg, the rule for *in the region of* an angle",
        *(
            near(f"{words}; {_k(k)}", "0", at, ABOUT_DEG, "deg")
            for words, found in (("zero", reversals), ("steepest", steepest))
            for k, at in zip(runs.STIFFNESSES, found)
        ),
    )
    yield statement(
        "The other feature is that on the scale of the graph this torque is independent of the spring stiffness k. The "
        "exception is at the maximum and minimum values where a slight variation is recorded.",
        "3.2.1, L1995-2001",
        "distance between the curves, perpendicular to them, on a graph as wide as it is high (our choice), relative to "
        "the size of the graph, at angles farther than 10 deg, the rule for *near*, from an extreme. Then the spread of "
        f"each extreme between the springs, relative to the extreme with {_k(1e6)}",
        f"{runs.ALIKE_WORDS}; {ALIKE:g} to {SLIGHTLY:g}, the rule for *slight*",
        at_most("distance of the curves", ALIKE, np.max(seen, axis=0)[away > 10.0].max()),
        *(
            within(
                f"spread of the {name} torque",
                ALIKE,
                SLIGHTLY,
                np.ptp(x) / abs(x[1]),
                why=f"at the {name} torque the springs differ by less than that",
            )
            for name, x in extremes.items()
        ),
    )


def _torque_causes() -> Iterator[Statement]:
    """Judge the causes that the thesis gives for the differences in the torque between the springs."""
    angle, torque, places = _torques()
    soft, stiff = parts(runs.STIFFNESSES[0]), parts(runs.STIFFNESSES[-1])
    whole = (torque[-1] - torque[0])[:-1]
    differences = {
        "acceleration": stiff.acceleration - soft.acceleration,
        "inertial loads": whole - (stiff.gravity - soft.gravity),
        "position": position_torque(runs.STIFFNESSES[0], runs.STIFFNESSES[-1]),
        "damper": damper_torque(runs.STIFFNESSES[-1]) - damper_torque(runs.STIFFNESSES[0]),
    }
    shares = {
        part: {
            f"{name} torque": float(np.interp(place, angle[:-1], x) / np.interp(place, angle[:-1], whole))
            for name, place in places.items()
        }
        for part, x in differences.items()
    }
    to_shaft = CM_PER_METRE * runs.table_3_1(0.0).ground_length
    moved = np.ptp([_steady(k).slider_cm for k in runs.STIFFNESSES], axis=0).max() / to_shaft
    difference = f"the difference of the torque between {_k(5e5)} and 2e6, at the extremes with {_k(1e6)}"
    yield statement(
        "These variations are due to the differences in the slider accelerations at these instances.",
        "3.2.1, L2001-2005",
        f"share of the slider's acceleration in {difference}",
        "more than half, as *due to* says",
        *(at_least(name, 0.5, x) for name, x in shares["acceleration"].items()),
        why="the difference comes from the terms with squares and products of the velocities, because the slider has another "
        "position and another velocity",
    )
    yield statement(
        "The independence of [the] torque of the stiffness k may be explained by the fact that the spring "
        "presents no external load on the mechanism. The only effect results from the slight change in the "
        "geometry which leads to changes in inertial loads.",
        "3.2.1, L2005-2013",
        "shares in the difference of the row before: of the inertial loads (all but the weight), and of the slider's position "
        "alone, as we read *geometry* (the mean of its effects at the rates of the one spring and of the other). Then the "
        f"greatest spread of u between the springs, relative to the {to_shaft:.2f} cm from start to shaft (our choice)",
        f"{ALIKE:g}, the rule for *the same*, as *only* says; {ALIKE:g} to {SLIGHTLY:g}, the rule for *slight*",
        *(
            near(f"{part}; {name}", 1.0, x, ALIKE)
            for part in ("inertial loads", "position")
            for name, x in shares[part].items()
        ),
        within("change in the geometry", ALIKE, SLIGHTLY, moved),
        why="the slider's rates cancel part of the effect of its position. *No external load* is not judged, since it can mean "
        "that the spring exerts no force, which is wrong, or that it does no work over a turn, which is so of every spring",
    )
    yield statement(
        "The energy dissipation in the slider guide due to viscous friction also accounts for variations in torque.",
        "3.2.1, L2013-2017",
        f"difference of the torque that supplies the damper's power, as a share of {difference}. The rest changes the "
        "energies of links and spring. The shares of the rows before are of another kind: parts of the crank's equation, "
        "in which the damper does not occur",
        f"more than {ALIKE:g}, the rule for *the same*",
        *(at_least(name, ALIKE, x) for name, x in shares["damper"].items()),
    )


def _torque_conclusion() -> Statement:
    """Judge whether the torques differ only where the slider's accelerations differ."""
    torque = _torques()[1]
    peak = np.abs(torque[1]).max()
    accelerations = np.array([slider_motion(k)[2] for k in runs.STIFFNESSES])
    apart, unequal = np.ptp(torque[:, :-1], axis=0) / peak, np.ptp(accelerations, axis=0) / np.abs(accelerations).max()
    inertial = np.ptp([parts(k).acceleration for k in runs.STIFFNESSES], axis=0).max() / peak
    return statement(
        "However, the overall conclusion is that the only appreciable difference in the torque requirements for "
        "different springs for this particular mechanism occurs only at the instances when appreciable differences in "
        "the slider accelerations leading to different inertial loads are present.",
        "3.2.1, L2017-2029",
        "among the crank angles at which the torques of the springs differ, the share at which the slider's accelerations "
        "differ too. For *leading to different inertial loads*: greatest difference of the part of the torque that the "
        f"acceleration causes. All differences are relative to the greatest size of the torque with {_k(1e6)}, or of the "
        "acceleration with any of the springs",
        f"all; {runs.ALIKE_WORDS}",
        near("torques differ where accelerations do", 1.0, np.mean(unequal[apart > ALIKE] > ALIKE), 0.0),
        at_least("acceleration's part", ALIKE, inertial),
        why=f"the accelerations differ by more than {ALIKE:g} at every crank angle, and most where the torques hardly differ",
    )


def draw_torque(result: StudyResult) -> Figure:
    """Draw the torque over a turn with each of the three springs."""
    panel = Panel(
        x_label="crank angle [deg]",
        y_label="crank torque [N m]",
        curves=result_curves(
            result, ANGLE, {f"crank torque; {_k(k)} [N.m]": runs.scientific(k) for k in runs.STIFFNESSES}
        ),
        legend=STIFFNESS_LEGEND,
        legend_at="upper center",
        x_range=(0.0, 360.0),
        x_ticks=range(0, 361, 45),
    )
    return plot_curves([panel], title=result.heading)


#: The studies by number.
STUDIES = {
    "3.4": Study(steady_result, draw_steady),
    "3.5": Study(torque_result, draw_torque, sweeps=("slider.stiffness",)),
    **no_spring.STUDIES,
    **launches.STUDIES,
    **free_crank.STUDIES,
}
