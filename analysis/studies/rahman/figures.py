"""Rahman's figures 5 to 38: displacement and joint forces of the generalised slider-crank.

The mechanism of section 3.1 turns at 50 rpm under a crank torque of 100 lb.in. Each figure has three values of the offset a4,
the shift S1 or the twist alpha4, beside the ideal slider-crank (a4 = 0, S1 = 0, alpha4 = 270 deg). The unknown is the force on
the slider, and with it every joint force and moment. At the dead centres this force has no lever arm about the crank axis, so
that it is infinite: the curves leave the plot there, and dotted lines of their colour mark the angles. Greatest values are
therefore taken at whole degrees that are `CLEAR_DEG` or more from a dead centre.

Statements of sections 3.2 and 3.3 on several figures are judged with the first of these figures.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, POUND_FORCE, POUND_INCH, parameters

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.dual import Dual, about_i, about_j, about_k
from ...slider_crank import CLEAR_DEG, ConstantShift, ForceTurn, GrooveShift, constant_shift, force_turn, ranges
from ...units import INCH
from ..rules import ABOUT, ABOUT_DEG
from ..statements import Case as Judged
from ..statements import FloatArray, Statement, at_least, at_most, near, statement
from ..study import Study, StudyResult, pad_columns
from ..variation import cache, vary
from .printed import (
    CRANK_AT_SPEED,
    GENERAL,
    bearing_moments,
    bodies,
    crank_bearing_forces,
    joint_accelerations,
    joint_forces,
    joint_rates,
)
from .table import (
    COMPONENTS,
    CONSTANT,
    FAMILIES,
    FIGURES,
    IDEAL,
    INFERRED,
    QUANTITIES,
    SPIKES,
    SPIKES_DEG,
    Case,
    Component,
)

#: Crank angles of the curves (deg), in half degrees.
ANGLES_DEG = np.linspace(0.0, 360.0, 721)
ANGLE = "crank angle theta1 [deg]"
#: Largest force or moment (lb, lb.in) that counts as zero.
NOTHING = 1e-6
ROUNDING = f"{NOTHING:g}, for rounding errors"
#: Distance from a dead centre at which greatest values are taken, in words.
FROM_DEAD = f"{CLEAR_DEG:g} deg or more from a dead centre"
#: Torque on the crank (lb.in), and length of the crank (in).
TORQUE, CRANK = 100.0, 12.0
#: Ratio by which the values beside a spike exceed all values clear of the dead centres.
SPIKE = 2.0
#: The cases of variable offset, and all cases.
OFFSETS, ALL = FAMILIES["offset"].cases, FAMILIES["all"].cases
#: Numbers in words.
_COUNTS = {"no": 0, "one": 1, "two": 2}

_UNITS = {"lb": POUND_FORCE, "lb.in": POUND_INCH}


def mechanism(case: Case) -> SliderCrankParameters:
    """Return the parameters of the mechanism of a case, with the reader's changes."""
    return vary(parameters(case.offset_in, case.twist_deg))


@cache
def turn(case: Case) -> ForceTurn:
    """Compute the forces over a turn of the crank under the torque of 100 lb.in."""
    return force_turn(
        mechanism(case),
        crank_speed=CRANK_SPEED,
        shift=ConstantShift(case.shift_in * INCH),
        angles=np.radians(ANGLES_DEG),
        torque=CRANK_TORQUE,
    )


def dead_centres_deg(case: Case) -> FloatArray:
    """Return the crank angles of the dead centres (deg)."""
    return np.degrees([centre.crank_angle for centre in turn(case).dead_centres])


def values(case: Case, component: Component) -> FloatArray:
    """Return a component of the forces over the turn in the printed unit, NaN at a dead centre."""
    found = turn(case)
    if component.source in ("axial_force", "slider_force"):
        si = getattr(found, component.source)
    else:
        si = found.vector(component.source, component.frame)[:, component.axis]
    return np.asarray(component.sign * np.ma.filled(si, np.nan) / _UNITS[component.unit])


def position(case: Case) -> FloatArray:
    """Return the slider position over the turn (in)."""
    return turn(case).slider_position / INCH


@cache
def clear_mask(case: Case) -> NDArray[np.bool_]:
    """Return a mask over `ANGLES_DEG`, True at the whole degrees that are `CLEAR_DEG` or more from a dead centre."""
    # an angle at exactly this distance is clear, whatever its rounding
    return np.asarray((ANGLES_DEG % 1.0 == 0.0) & turn(case).clear(CLEAR_DEG - 1e-6))


def greatest(case: Case, quantity: FloatArray) -> float:
    """Return the greatest magnitude of a quantity over the turn, clear of the dead centres."""
    return float(np.abs(quantity[clear_mask(case)]).max())


def spikes_deg(case: Case, component: Component) -> FloatArray:
    """Find the crank angles (deg) of a component's poles, as zeros of its reciprocal."""
    value = values(case, component)
    # a dead centre at one of the angles has no value
    angle, value = ANGLES_DEG[np.isfinite(value)], value[np.isfinite(value)]
    (changes,) = np.nonzero(value[:-1] * value[1:] < 0.0)
    # the component changes sign at a zero too, but the values beside a zero are small
    size = np.minimum(np.abs(value[changes]), np.abs(value[changes + 1]))
    found = []
    for at in changes[size > SPIKE * greatest(case, values(case, component))].tolist():
        window = slice(at - 1, at + 3)
        reciprocal = value[at] / value[window]
        found.append(np.polyfit(reciprocal, angle[window], 3)[-1])
    return np.array(found)


def nothing(label: str, size: ArrayLike, unit: str = "", *, why: str = "") -> Judged:
    """Judge whether a quantity vanishes, usually the difference of an equation from its correct value."""
    return at_most(label, NOTHING, float(np.max(np.abs(size))), unit, why=why)


def _motion() -> Iterator[Statement]:
    """Judge the shape and the stroke of the slider's motion, and the mean power at the crank."""
    shapes = []
    for case in (IDEAL, *ALL):
        first = 2.0 * np.fft.rfft(position(case)[:-1])[1] / (ANGLES_DEG.size - 1)
        sine = (first * np.exp(1j * np.radians(ANGLES_DEG))).real
        away = np.abs(position(case) - np.mean(position(case)[:-1]) - sine).max() / (0.5 * _stroke(case))
        shapes.append(at_most(full_name(case), ABOUT, away))
    strokes = [at_most(full_name(case), 1.0, _stroke(case) / _stroke(IDEAL)) for case in OFFSETS]
    cases = (IDEAL, *OFFSETS)
    power = {
        "the torque of 100 lb.in": [float(np.mean(turn(c).torque[:-1]) / POUND_INCH * CRANK_SPEED) for c in cases],
        # over two strokes a turn
        "a load of 1 lb against the motion, ours": [2.0 * _stroke(c) * CRANK_SPEED / (2.0 * np.pi) for c in cases],
    }
    saved = [at_least(words, NOTHING, first - min(rest), "lb.in/s") for words, (first, *rest) in power.items()]
    yield statement(
        "Slider displacement curves are almost semi-sinusoidal type of graphs which seem to be quite reasonable.",
        "section 3.3, L1125",
        "greatest distance of S4 from the sum of its mean and its first harmonic, relative to half the stroke, in Figs "
        "R5 to R7. *Semi-sinusoidal* is read as sinusoidal; *reasonable* is not measured",
        f"{ABOUT:g}, the rule for *almost*",
        *shapes,
    )
    yield statement(
        "When crank is placed at higher level than the plane on which slider is moving by providing positive offset "
        "distance [a4], the stroke of the engine is reduced.",
        "section 3.3, L1125",
        "stroke of each case of variable offset, relative to the stroke of the ideal case",
        "none, the sign decides",
        *strokes,
        why="the offset lengthens the stroke; it does so at S1 = 0 as well",
    )
    yield statement(
        "So in that case [of a positive a4], while consuming less power the same RPM of the engine can be obtained.",
        "section 3.3, L1125",
        "mean power at 50 rpm in the ideal case, minus the least mean power at a4 = 10, 20, 30 in with S1 = 3.5 in",
        f"more than {NOTHING:g} lb.in/s, for rounding errors",
        *saved,
        why="at this speed the given torque takes the same power at any offset; a given load takes more, because the stroke "
        "is longer",
    )


def full_name(case: Case) -> str:
    """Return a name of a case that is unique among the cases of all families."""
    return f"{case.name}, S1 = {case.shift_in:g} in" if case.name.startswith("a4") else case.name


def _stroke(case: Case) -> float:
    """Return the stroke (in) of the mechanism of a case."""
    (whole,) = ranges(mechanism(case), constant_shift(case.shift_in * INCH))
    return whole.stroke / INCH


def _forces() -> Iterator[Statement]:
    """Judge how the forces grow with the offset, and their spikes at the dead centres."""
    components = [COMPONENTS[symbol] for symbol in QUANTITIES[1:]]
    gains, spikes = [], []
    for c in components:
        peaks = [greatest(case, values(case, c)) for case in (IDEAL, *OFFSETS)]
        gains.append(at_least(c.symbol, 0.0, np.min(np.diff(peaks)), c.unit))
        stated = SPIKES.get(c.symbol, "two")
        counts = [spikes_deg(case, c).size for case in ALL if greatest(case, values(case, c)) > NOTHING]
        count = counts[int(np.argmax(np.abs(np.array(counts) - _COUNTS[stated])))]
        spikes.append(replace(near(f"spikes of {c.symbol}", float(_COUNTS[stated]), count, 0.0), stated=stated))
    for case in ALL:
        away = float(np.abs(dead_centres_deg(case) - SPIKES_DEG).max())
        spikes.append(at_most(f"{full_name(case)}: distance from 100 and 300 deg", ABOUT_DEG, away, "deg"))
    yield statement(
        "But with the increase of offset distance [a4], joint forces and torques also increase.",
        "section 3.3, L1125",
        "change of a component's greatest magnitude from each case to the next: the ideal case, then a4 = 10, 20, 30 in "
        f"with S1 = 3.5 in. The magnitude is taken {FROM_DEAD}, our choice. For each of the eleven components in the "
        "graphs, the least of the three changes is listed",
        "none, the sign decides",
        *gains,
        why="the other components decrease at one step at least. If the distance from the dead centres is 3, 5, 15, 20 or "
        "30 deg instead, two or three components increase. The grid of whole degrees decides the sizes, not the signs: at "
        "every 0.05 deg the change of 1T1i is -37.5 lb.in, and that of 4F4i 1.06 lb",
    )
    yield statement(
        "So proper design is necessary for the safe operation of the engine, considering that factor [the increase of "
        "forces and torques].",
        "section 3.3, L1125",
        why="advice, not a finding",
    )
    yield statement(
        "In most of the joint force and torque graphs (except for [3F3j] with no spike, [3F3k] with one spike and [4F4k] "
        "with one spike) two spikes are seen, one near 100 degrees and other near 300 degrees.",
        "section 3.3, L1125",
        "number of poles (spikes) of each component in a turn, in the nine cases other than the ideal one, except where "
        "the component vanishes; the number that differs most from the stated one is listed. Then, for each case, the "
        "greatest distance of its dead centres, where the poles lie, from 100 and 300 deg",
        f"none for a number of spikes; {ABOUT_DEG:g} deg, the rule for *near*",
        *spikes,
        why="3F3k is finite at both dead centres, and 4F4k at neither. The offset and the twist move the dead centres",
    )
    yield statement(
        "Hence [from the spikes] it is very obvious that with the increase of offset the chance of fatigue failure of "
        "the links at high speed is very large.",
        "section 3.3, L1125",
        why="the thesis gives neither a strength nor a number of cycles",
    )


def _bearing_moments() -> Iterator[Statement]:
    """Judge whether the shift causes the moments 1T1i and 1T1j, and how they follow from the forces on the crank."""
    cases = (IDEAL, *ALL)
    moments = {symbol: {case: values(case, COMPONENTS[symbol]) for case in cases} for symbol in ("1T1i", "1T1j")}
    shifted = [case for case in ALL if case.shift_in]
    unshifted = [case for case in cases if not case.shift_in]
    none = [
        nothing(f"{symbol}; {case.name}", greatest(case, sizes[case]), "lb.in")
        for symbol, sizes in moments.items()
        for case in unshifted
    ]
    # eqs 69p and 69q with the printed inertia forces in a general position, at any crank angle and shift
    rates = joint_rates(CRANK_AT_SPEED, GENERAL)
    seconds = joint_accelerations(CRANK_AT_SPEED, GENERAL, rates)
    forces = joint_forces(CRANK_AT_SPEED, bodies(parameters()), GENERAL, rates, seconds, TORQUE)
    i, j = crank_bearing_forces(np.array(0.9), forces)
    about_i, about_j = bearing_moments(np.array(0.9), 3.5, forces)
    by_hand = (nothing("1T1i; 69q", about_i + j * 3.5, "lb.in"), nothing("1T1j; 69p", about_j - i * 3.5, "lb.in"))
    by_forces = [
        nothing(
            f"{symbol}; right forces",
            max(greatest(c, sizes[c] + sign * c.shift_in * values(c, COMPONENTS[force])) for c in shifted),
            "lb.in",
        )
        for (symbol, sizes), sign, force in zip(moments.items(), (1.0, -1.0), ("1F1j", "1F1i"))
    ]
    extra = [
        at_least(symbol, NOTHING, min(greatest(c, sizes[c]) for c in shifted), "lb.in")
        for symbol, sizes in moments.items()
    ]
    yield statement(
        "In the presence of offset distance [S1], two extra torque components [1T1i] and [1T1j] are acting at joint [1].",
        "section 3.3, L1125-1127",
        f"greatest magnitude {FROM_DEAD}, in each of the six cases with a shift; the least of the six is listed",
        f"more than {ROUNDING}",
        *extra,
    )
    yield statement(
        "So extra precaution should be taken by designer, so that engine does not fail, and the manufacturer should pay "
        "special attention to minimize this tolerance error [of S1].",
        "section 3.3, L1127",
        why="advice, not a finding",
    )
    yield statement(
        "Two torque components at joint [1], i.e. [1T1i] and [1T1j] reduce to zero, when there is no crank axial offset [S1].",
        "section 3.2, L1119",
        f"greatest magnitude {FROM_DEAD}, in the ideal case and in the three cases with S1 = 0, a4 = 20 in",
        ROUNDING,
        *none,
        why="with a twist, the axial force 1F1k has a lever arm about the bearing",
    )
    yield statement(
        "By manual manipulation it is found that [1T1i = -1F1j S1] and [1T1j = 1F1i S1].",
        "section 3.2, L1119",
        "difference of the two sides of each equation: first by the printed eqs 69p and 69q, in a general position at a "
        f"constant shift; then by the right forces, the greatest of the six cases with a shift, {FROM_DEAD}",
        ROUNDING,
        *by_hand,
        *by_forces,
        why="the thesis sets 1F1k to zero, but the right 1F1k (erratum 7) adds to both moments",
    )


def _constant() -> Iterator[Statement]:
    """Judge the components that section 3.2 finds constant or zero, and the axial force."""
    size = {
        symbol: {case: greatest(case, values(case, COMPONENTS[symbol])) for case in ALL} for symbol in ("1F1k", "2F2k")
    }
    guide = {
        s: max(float(np.abs(values(c, COMPONENTS[s])).max()) for c in (IDEAL, *ALL)) for s in ("4T4i", "4T4j", "4T4k")
    }
    pins = [values(case, COMPONENTS["2F2j"]) for case in ALL]
    equations = _equations()
    yield statement(
        "All the torque components at joint 4, i.e. [4T4i], [4T4j], and [4T4k] and the force components along joint axis "
        "(k) at joint 2, i.e. [2F2k] are found to be zero throughout one complete revolution of the crank at any offset.",
        "section 3.2, L1117",
        f"greatest magnitude, of 4T4 in all cases, of 2F2k {FROM_DEAD}",
        ROUNDING,
        *(nothing(symbol, moment, "lb.in") for symbol, moment in guide.items()),
        *(nothing(f"2F2k; {full_name(case)}", pin, "lb") for case, pin in size["2F2k"].items()),
        why="4T4 is zero since the slider's centre of mass is in its pin; 2F2k is zero in the plane alone",
    )
    yield statement(
        "Another force component along the j-axis of joint 2, i.e. [2F2j] is constant (-8.33 lbs) throughout one complete "
        "rotation of the crank at any offset.",
        "section 3.2, L1117-1119",
        "least and greatest value of the nine cases",
        "0.005 lb, half a unit of the last digit",
        *(
            near(which, "-8.33", pick([pick(pin) for pin in pins]), unit="lb")
            for which, pick in (("least", np.nanmin), ("greatest", np.nanmax))
        ),
    )
    yield statement(
        "Axial force [1F1k] acts on the crank at joint 1 and equals mass of the crank times its axial acceleration, and "
        "torque [1T1k] is applied constantly.",
        "section 2.8, L945",
        f"greatest difference of the axial force from m1 S1'', {FROM_DEAD}: in the nine cases of constant shift, and "
        "with a sinusoidal shift by eq 28, of which amplitude and alpha are our choice; its dead centres are where S4 at a "
        "constant S1 turns back",
        ROUNDING,
        *(nothing(full_name(case), force, "lb") for case, force in size["1F1k"].items()),
        nothing("a4 = 10 in, sinusoidal shift of 3.5 in, alpha = 1", sinusoidal_axial_force(), "lb"),
        why="erratum 7: S1 is given, so that the axial force is an unknown. The constant torque is an assumption, which is "
        "not judged",
    )
    yield statement(
        "There are sixteen unknowns, including both forces and torques and seventeen equations. Although one equation is "
        "redundant, all seventeen equations have been used to avoid sine or cosine functions in the denominator as much as "
        "possible, because small sine or cosine terms in the denominator sometimes results in inaccurate division.",
        "section 2.8, L961",
        "number of unknown components of the joint forces and moments, including 1F1k; number of eqs 62a to 64f without 63b "
        "and with 62c mended; their rank in these unknowns in a general position, which is 16 if one equation is redundant",
        "none, since counts are exact",
        replace(near("unknowns", 16.0, len(COMPONENTS) - 1, 0.0), stated="sixteen"),
        replace(near("equations", 17.0, len(equations), 0.0), stated="seventeen"),
        near("rank", 16.0, np.linalg.matrix_rank(equations), 0.0),
        why="erratum 7: with 1F1k unknown, no equation is redundant. The remark on sines and cosines is not measured",
    )


def _equations() -> FloatArray:
    """Return the coefficients of eqs 62a to 64f, except 63b, in a general position: one row each, with seventeen unknowns."""
    th2, eta2, th3, eta3, _ = (float(value) for value in GENERAL)
    crank = about_k(Dual(0.9, 3.5)) @ about_i(Dual(0.0, CRANK_AT_SPEED.a1))
    rod = about_k(th2) @ about_j(eta2) @ about_i(Dual(0.0, CRANK_AT_SPEED.a2))
    slider = about_k(th3) @ about_j(eta3) @ about_i(0.5 * np.pi)
    rows = np.zeros((3, 6, 4, 6))
    for n, matrix in enumerate((crank, rod, slider)):
        # force and moment in the joint before the link, then those in the joint after it
        turned = matrix.T
        rows[n, :3, n, :3] = rows[n, 3:, n, 3:] = turned.real
        rows[n, 3:, n, :3] = turned.dual
        rows[n, :, n + 1] = np.eye(6)
    equations = np.delete(rows.reshape(18, 24), 6 + 3, axis=0)
    # the ball joints carry no moment, and 1T1k is given
    return np.delete(equations, [5, *range(9, 12), *range(15, 18)], axis=1)


def sinusoidal_axial_force() -> float:
    """Return the greatest difference (lb) between 1F1k and m1 S1'' at a4 = 10 in with a shift of 3.5 in times sin(theta1)."""
    p, shift = mechanism(OFFSETS[0]), GrooveShift(3.5 * INCH, 1.0)
    found = force_turn(p, crank_speed=CRANK_SPEED, shift=shift, angles=np.radians(ANGLES_DEG), torque=CRANK_TORQUE)
    beyond = found.axial_force - p.crank_mass * found.shift_acceleration
    return float(np.abs(beyond[found.clear(CLEAR_DEG)]).max()) / POUND_FORCE


#: Functions that judge the statements, by the figure with which the statements are judged.
_JUDGED = {"R5": _motion, "R8": _forces, "R14": _bearing_moments, CONSTANT: _constant}


def _curve_name(symbol: str, case: Case, unit: str) -> str:
    return f"{symbol}; {case.name} [{unit}]"


def _dead_centre_name(case: Case) -> str:
    return f"dead centre; {case.name} [deg]"


def compute(number: str) -> StudyResult:
    """Compute the curves and dead centres of all cases of a figure, and judge its statements."""
    family, symbols, *_ = FIGURES[number]
    components = [COMPONENTS[symbol] for symbol in symbols]
    cases = (IDEAL, *FAMILIES[family].cases)
    columns = {ANGLE: ANGLES_DEG}
    if not components:
        columns |= {_curve_name("S4", case, "in"): position(case) for case in cases}
    for component in components:
        columns |= {_curve_name(component.symbol, case, component.unit): values(case, component) for case in cases}
    columns |= {_dead_centre_name(case): dead_centres_deg(case) for case in cases}
    shown = ", ".join(symbols) or "Slider displacement S4"
    if number == CONSTANT:
        claim = (
            "Rahman states: in every case and at every angle, 1F1k and 2F2k are zero, 2F2j is -T/a1, and the moments on the "
            "slider are zero."
        )
    else:
        claim = f"{shown} over a turn of the crank for variable {family}, beside the ideal case."
    assignment = "" if number == CONSTANT else INFERRED
    return StudyResult(
        claim=claim,
        assignment=assignment,
        columns=pad_columns(columns),
        statements=tuple(_JUDGED[number]()) if number in _JUDGED else (),
        see="" if number in ("R5", "R8", CONSTANT) else _judging_figures(number, symbols),
    )


def _judging_figures(number: str, symbols: tuple[str, ...]) -> str:
    """Return the numbers of the figures whose statements are also about this figure.

    ``symbols`` are the components that this figure shows.
    """
    if not symbols:
        return "R5"
    return "R8" if "T" not in symbols[0] else "R8 and below" if number in _JUDGED else "R8 and R14"


def printed(text: str) -> str:
    """Format the text of a case or of a list of dimensions for a plot."""
    text = re.sub(r"\b([aS])(\d)", r"$\1_\2$", text.replace("alpha4", r"$\alpha_4$"))
    return re.sub(r" deg\b", "°", text)


def printed_symbol(symbol: str) -> str:
    """Format a symbol of the thesis, such as 1F1k, for a plot."""
    return re.sub(r"^(\d)([FT])(\d)([ijk])$", r"$^\1\2_{\3\4}$", symbol)


def _interrupted_curve(result: StudyResult, case: Case, name: str) -> tuple[FloatArray, FloatArray]:
    """Return the angles and values of a curve, with a NaN at each of its dead centres to interrupt the drawn line."""
    centres = result.columns[_dead_centre_name(case)]
    centres = centres[np.isfinite(centres)]
    where = np.searchsorted(ANGLES_DEG, centres)
    return np.insert(ANGLES_DEG, where, centres), np.insert(result.columns[name], where, np.nan)


def _y_range(curves: Iterable[FloatArray]) -> tuple[float, float]:
    """Return a range of y that contains the curves and a margin; the margin is 1 lb or 1 lb.in if they are constant."""
    joined = np.concatenate(list(curves))
    low, high = float(joined.min()), float(joined.max())
    room = max(0.08 * (high - low), 1.0 if high - low < NOTHING else 0.0)
    return low - room, high + room


def draw(result: StudyResult) -> Figure:
    """Draw one panel for each component, the ideal case dashed over the others, dead centres dotted."""
    family, symbols, *_ = FIGURES[result.number]
    looks = [
        (case, printed(case.name), colour, line)
        for case, colour, line in zip(FAMILIES[family].cases, COLOURS * 2, ["-"] * len(COLOURS) + ["-."] * len(COLOURS))
    ]
    looks.append((IDEAL, printed("ideal, a4 = S1 = 0"), "0.15", "--"))
    shown = [(c.symbol, f"{printed_symbol(c.symbol)}, {c.meaning}", c.unit) for c in map(COMPONENTS.get, symbols) if c]
    panels: list[Panel] = []
    for symbol, label, unit in shown or [("S4", "slider position $S_4$", "in")]:
        names = {case: _curve_name(symbol, case, unit) for case, *_ in looks}
        low, high = _y_range(result.columns[name][clear_mask(case)] for case, name in names.items())
        curves = []
        for case, legend, colour, line in looks:
            x, y = _interrupted_curve(result, case, names[case])
            # one legend serves all panels
            curves.append(Curve(x=x, y=y, label="" if panels else legend, colour=colour, line=line))
            curves += [
                Curve(x=[centre, centre], y=[low, high], colour=colour, line=":", width=0.8)
                for centre in dead_centres_deg(case)
            ]
        panels.append(
            Panel(
                x_label="crank angle $\\theta_1$ [deg]; dotted: dead centres",
                y_label=f"{label} [{unit}]",
                curves=curves,
                legend=printed(FAMILIES[family].legend),
                legend_at="outside",
                x_range=(0.0, 360.0),
                y_range=(low, high),
                x_ticks=np.arange(0.0, 361.0, 60.0).tolist(),
            )
        )
    return plot_curves(panels, title=result.heading, size=(6.4, 3.7 if len(panels) == 1 else 2.7))


#: The studies by the figure's number with an R before it.
STUDIES = {number: Study(partial(compute, number), draw, sweeps=("guide.offset", "guide.twist")) for number in FIGURES}
