"""Rahman's figures 5 to 38: displacement and joint forces of the generalised slider-crank.

The mechanism of section 3.1 turns at 50 rpm under a crank torque of 100 lb.in, with three values of the offset a4, the
shift S1 or the twist alpha4, each beside the ideal slider-crank (a4 = 0, S1 = 0, alpha4 = 270 deg). The unknown is the
force on the slider, and with it every joint force and moment. It is infinite at the dead centres, where it has no lever
on the crank: the curves leave the plot there, and dotted lines of their colour mark the places. The greatest value of a
curve is therefore taken at whole degrees more than `CLEAR_DEG` from a dead centre.

Statements of sections 3.2 and 3.3 are judged with the figure that shows the quantity. All forces are computed a second
time by dual vectors, which share no equation with the plant.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, POUND_FORCE, POUND_INCH, parameters

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...slider_crank import (
    CLEAR_DEG,
    ConstantShift,
    ForceTurn,
    JointLoads,
    close,
    constant_shift,
    follow,
    force_turn,
    joint_loads,
    ranges,
)
from ...units import INCH
from .. import rows
from ..rules import ABOUT
from ..statements import Statement, at_least, at_most
from ..study import OURS, Study, StudyResult, Verdict, near, padded, text
from .table import (
    AXIAL_LB,
    COMPONENTS,
    CONSTANT,
    DEAD_CENTRES_DEG,
    FAMILIES,
    FIGURES,
    IDEAL,
    INFERRED,
    SPIKES,
    SPIKES_DEG,
    SPOTS,
    Case,
    Component,
)

FloatArray = NDArray[np.float64]

#: Crank angles of the curves (deg), in half degrees.
ANGLES_DEG = np.linspace(0.0, 360.0, 721)
ANGLE = "crank angle theta1 [deg]"
#: Step (deg) in which the loop is continued over the turn by dual matrices.
FOLLOW_DEG = 20.0
#: Largest force or moment (lb, lb.in) that counts as zero, and largest relative difference of two methods.
NOTHING, SAME = 1e-6, 1e-9
#: Torque on the crank (lb.in) and its length (in).
TORQUE, CRANK = 100.0, 12.0
#: Our range (deg) of "near" in "spikes near 100 and 300 degrees", and our largest departure from a sine, relative to half the
#: stroke, of a curve that is "almost" one. The source gives no range.
SPIKES_TO, ALMOST = 25.0, 0.2
#: Ratio by which the values beside a spike exceed all values clear of the dead centres.
SPIKE = 2.0

_UNITS = {"lb": POUND_FORCE, "lb.in": POUND_INCH}


@cache
def turn(case: Case, given: str = "torque") -> ForceTurn:
    """Compute a turn of the crank with a given ``torque`` and unknown slider force, or without ``load`` on the slider."""
    return force_turn(
        parameters(case.offset_in, case.twist_deg),
        crank_speed=CRANK_SPEED,
        shift=ConstantShift(case.shift_in * INCH),
        angles=np.radians(ANGLES_DEG),
        torque=CRANK_TORQUE if given == "torque" else None,
    )


def dead_centres_deg(case: Case) -> FloatArray:
    """Return the crank angles of the dead centres (deg)."""
    return np.degrees([centre.crank_angle for centre in turn(case).dead_centres])


def values(case: Case, component: Component, given: str = "torque") -> FloatArray:
    """Return a component over the turn in the printed unit, NaN at a dead centre."""
    found = turn(case, given)
    if component.source in ("axial_force", "slider_force"):
        si = getattr(found, component.source)
    else:
        si = found.vector(component.source, component.frame)[:, component.axis]
    return np.asarray(component.sign * np.ma.filled(si, np.nan) / _UNITS[component.unit])


def position(case: Case) -> FloatArray:
    """Return the slider position (in)."""
    return turn(case).slider_position / INCH


@cache
def clear(case: Case) -> NDArray[np.bool_]:
    """Return a mask of the whole degrees that are clear of the dead centres."""
    # an angle at exactly this distance is not clear, whatever its rounding
    return np.asarray((ANGLES_DEG % 1.0 == 0.0) & turn(case).clear(CLEAR_DEG + 1e-6))


def greatest(case: Case, quantity: FloatArray) -> float:
    """Return the greatest magnitude of a quantity over the turn, clear of the dead centres."""
    return float(np.abs(quantity[clear(case)]).max())


def spikes_deg(case: Case, component: Component) -> FloatArray:
    """Find the crank angles (deg) of the poles of a component, as zeros of its reciprocal."""
    value = values(case, component)
    (changes,) = np.nonzero(value[:-1] * value[1:] < 0.0)
    # a zero of the component changes its sign too, but between small values
    size = np.minimum(np.abs(value[changes]), np.abs(value[changes + 1]))
    found = []
    for at in changes[size > SPIKE * greatest(case, value)].tolist():
        near_it = slice(at - 1, at + 3)
        reciprocal = value[at] / value[near_it]
        found.append(np.polyfit(reciprocal, ANGLES_DEG[near_it], 3)[-1])
    return np.array(found)


@cache
def dual(case: Case) -> JointLoads:
    """Compute all joint forces by dual vectors at the angles that are clear of the dead centres.

    The loop is closed by continuation round the turn in steps of `FOLLOW_DEG`, and from these points in between.
    """
    mechanism, shift = parameters(case.offset_in, case.twist_deg), case.shift_in * INCH
    angles = ANGLES_DEG[clear(case)]
    turned = follow(mechanism, np.radians(np.arange(0.0, 361.0, FOLLOW_DEG)), shift)
    before = turned.at((angles // FOLLOW_DEG).astype(int))
    return joint_loads(close(mechanism, np.radians(angles), shift, before), speed=CRANK_SPEED, torque=CRANK_TORQUE)


def difference_from_dual(case: Case, component: Component) -> float:
    """Return the greatest difference of a component from dual vectors, clear of the dead centres, relative to T/a1 or T."""
    loads = dual(case)
    if component.source in ("axial_force", "slider_force"):
        si = loads.axial if component.source == "axial_force" else loads.slider_force
    else:
        si = loads.components(component.source, component.frame)[:, component.axis]
    other = component.sign * si / _UNITS[component.unit]
    scale = TORQUE if component.unit == "lb.in" else TORQUE / CRANK
    return float(np.abs(values(case, component)[clear(case)] - other).max()) / scale


def _motion() -> tuple[Statement, ...]:
    """Judge shape and stroke of the slider's motion, and its power."""
    offsets, shapes = FAMILIES["offset"].cases, []
    for case in FAMILIES["all"].cases:
        first = 2.0 * np.fft.rfft(position(case)[:-1])[1] / (ANGLES_DEG.size - 1)
        sine = (first * np.exp(1j * np.radians(ANGLES_DEG))).real
        away = np.abs(position(case) - np.mean(position(case)[:-1]) - sine).max() / (0.5 * _stroke(case))
        shapes.append(at_most(_name(case), ABOUT, away))
    strokes = [at_most(case.name, 1.0, _stroke(case) / _stroke(IDEAL)) for case in offsets]
    loads = (("no load on the slider", _torque), ("a torque of 100 lb.in", lambda case: turn(case).torque / POUND_INCH))
    power = {
        words: [float(np.mean(torque(c)[:-1]) * CRANK_SPEED) for c in (IDEAL, *offsets)] for words, torque in loads
    }
    saved = [at_least(words, NOTHING, first - min(rest), "lb.in/s") for words, (first, *rest) in power.items()]
    return (
        Statement(
            "Slider displacement curves are almost semi-sinusoidal type of graphs which seem to be quite reasonable.",
            text("section 3.3, L1125"),
            "greatest distance of S4 from its mean and first harmonic, relative to half the stroke, in Figs R5 to R7",
            f"{ABOUT:g}, the rule for *almost*",
            tuple(shapes),
        ),
        Statement(
            "When crank is placed at higher level than the plane on which slider is moving by providing positive offset "
            "distance [a4], the stroke of the engine is reduced.",
            text("section 3.3, L1125"),
            "stroke relative to the ideal one's",
            "none, the sign decides",
            tuple(strokes),
            "the offset lengthens the stroke",
        ),
        Statement(
            "So in that case, while consuming less power the same RPM of the engine can be obtained.",
            text("section 3.3, L1125"),
            "mean power at 50 rpm of the ideal case less the least of a4 = 10, 20, 30 in",
            "more than 1e-6 lb.in/s, the rounding",
            tuple(saved),
            "a motion without friction takes no power, and a given torque at a given speed takes the same at any offset",
        ),
    )


def _name(case: Case) -> str:
    """Return what distinguishes a case among those of all families."""
    return f"{case.name}, S1 = {case.shift_in:g} in" if case.name.startswith("a4") else case.name


def _stroke(case: Case) -> float:
    """Return the stroke (in) of a mechanism of section 3.1 at its shift."""
    mechanism = parameters(case.offset_in, case.twist_deg)
    (whole,) = ranges(mechanism, constant_shift(case.shift_in * INCH))
    return whole.stroke / INCH


def _torque(case: Case) -> FloatArray:
    """Return the crank torque (lb.in) without a load on the slider."""
    return np.asarray(turn(case, "load").torque / POUND_INCH)


def _force_verdicts(family: str, component: Component) -> list[Verdict]:
    """Judge the spikes of a component, the influence of the offset, and its agreement with dual vectors."""
    cases, symbol = FAMILIES[family].cases, component.symbol
    verdicts = []
    found = [spikes_deg(case, component) for case in cases]
    if family != "all":
        stated, counts = SPIKES.get(symbol, 2), [spikes.size for spikes in found]
        count = max(counts, key=lambda n: abs(n - stated))
        why = "3F3j, 3F3k have none, the others two" if count != stated else ""
        verdicts.append(near(f"spikes of {symbol} in a turn", text("section 3.3, L1125"), stated, count, 0.0, why=why))
    if any(spikes.size for spikes in found):
        distance = max(float(np.abs(spikes - SPIKES_DEG).max()) for spikes in found)
        name = f"distance of the spikes of {symbol} from 100 and 300 deg"
        verdicts.append(rows.at_most(name, text("sections 3.2, 3.3, L1115, L1125"), SPIKES_TO, distance, "deg"))
        distance = max(float(np.abs(spikes - dead_centres_deg(case)).max()) for case, spikes in zip(cases, found))
        verdicts.append(
            rows.at_most(f"distance of the spikes of {symbol} from dead centres", OURS, 0.005, distance, "deg")
        )
    if family == "offset":
        name = f"greatest magnitude of {symbol}, least gain from one a4 to the next"
        gain, with_load = (_offsets_gain(component, given) for given in ("torque", "load"))
        why = "nearer to a dead centre than the others" if gain < 0.0 else ""
        verdicts.append(rows.at_least(name, text("section 3.3, L1125"), 0.0, gain, component.unit, why=why))
        # along the guide nothing acts without a load
        if component.source != "slider_force":
            verdicts.append(
                rows.at_least(f"{name}, with the slider's load given", OURS, 0.0, with_load, component.unit)
            )
    if "T" in symbol:
        verdicts += _bearing_moment(component, cases)
    if component.source == "slider_force":
        verdicts += _slider_force(component, cases)
    difference = max(difference_from_dual(case, component) for case in (IDEAL, *cases))
    scale = "T" if component.unit == "lb.in" else "T/a1"
    name = f"difference of {symbol} from that by dual vectors, relative to {scale}"
    return [*verdicts, rows.at_most(name, OURS, SAME, difference)]


def _offsets_gain(component: Component, given: str) -> float:
    """Return the least gain of a component's greatest magnitude from one offset to the next, the ideal case first."""
    peaks = [greatest(case, values(case, component, given)) for case in (IDEAL, *FAMILIES["offset"].cases)]
    return min(after - before for before, after in pairwise(peaks))


def moment_by_forces(case: Case, axis: str) -> tuple[FloatArray, FloatArray]:
    """Return 1T1i or 1T1j (lb.in) from the forces on the crank, as in section 3.2 and with the axial force."""
    angle = np.radians(ANGLES_DEG)
    fi, fj, fk = (values(case, COMPONENTS[name]) for name in ("1F1i", "1F1j", "1F1k"))
    if axis == "i":
        return -fj * case.shift_in, -fj * case.shift_in + fk * CRANK * np.sin(angle)
    return fi * case.shift_in, fi * case.shift_in - fk * CRANK * np.cos(angle)


def _bearing_moment(component: Component, cases: Iterable[Case]) -> list[Verdict]:
    """Judge 1T1i or 1T1j against the forces, and whether the shift causes it."""
    symbol, axis, place = component.symbol, component.symbol[-1], "section 3.2, L1119"
    short, lacking = ("-1F1j S1", " + 1F1k a1 sin(theta1)") if axis == "i" else ("1F1i S1", " - 1F1k a1 cos(theta1)")
    verdicts = []
    for case in cases:
        moment = values(case, component)
        printed, full = (greatest(case, moment - formula) for formula in moment_by_forces(case, axis))
        name, why = f"greatest magnitude of {symbol} - ({short}); {case.name}", f"lacks{lacking}"
        verdicts.append(near(name, text(place), 0.0, printed, NOTHING, "lb.in", why=why))
        name = f"greatest magnitude of {symbol} - ({short}{lacking}); {case.name}"
        verdicts.append(near(name, OURS, 0.0, full, NOTHING, "lb.in"))
    least = min(greatest(case, values(case, component)) for case in cases)
    name = f"greatest magnitude of {symbol}, which S1 brings about, least of the cases"
    return [*verdicts, rows.at_least(name, text("section 3.3, L1125-1127"), NOTHING, least, "lb.in")]


def _slider_force(component: Component, cases: Iterable[Case]) -> list[Verdict]:
    """Compare the slider force with values from an independent derivation."""
    verdicts = []
    for case in cases:
        if case.shift_in == 0.0 and case.twist_deg == IDEAL.twist_deg:
            verdicts += [
                near(f"{which} spike; {case.name}", OURS, stated, at, 0.005, "deg")
                for which, stated, at in zip(
                    ("first", "second"), DEAD_CENTRES_DEG[case.offset_in], spikes_deg(case, component)
                )
            ]
        for spot in SPOTS:
            if case[1:] == spot[:3]:
                (at_30,) = values(case, component)[ANGLES_DEG == 30.0]
                name = f"4F4k at theta1 = 30 deg; {case.name}"
                # the spot is along -k4
                verdicts.append(near(name, OURS, -spot.slider_force_lb, at_30, 5e-7, "lb"))
    return verdicts


def _constant() -> list[Verdict]:
    """Judge the components that section 3.2 finds constant or zero, and the assumptions of the equations."""
    cases, place, verdicts = FAMILIES["all"].cases, "section 3.2, L1117", []
    about = {name: [values(case, COMPONENTS[name]) for case in cases] for name in ("1F1k", "2F2j", "2F2k", "1T1k")}

    def none(name: str, case: Case, size: float, unit: str, place: str, why: str) -> Verdict:
        what = f"greatest magnitude of {name}; {case.name}"
        return near(what, text(place), 0.0, size, NOTHING, unit, why=why if size > NOTHING else "")

    for case, axial, pin in zip(cases, about["1F1k"], about["2F2k"]):
        size, given = greatest(case, pin), "section 2.8, after eq 64, L945-949"
        verdicts.append(none("2F2k", case, size, "lb", place, "only in the plane"))
        verdicts.append(
            none("1F1k", case, greatest(case, axial), "lb", given, "erratum 7: an unknown, since S1 is given")
        )
        if case[1:] in AXIAL_LB:
            stated, tolerance = AXIAL_LB[case[1:]]
            name = f"greatest magnitude of 2F2k, independent derivation; {case.name}"
            verdicts.append(near(name, OURS, stated, size, tolerance, "lb"))
        if case.shift_in == 0.0:
            for symbol in ("1T1i", "1T1j"):
                size, why = greatest(case, values(case, COMPONENTS[symbol])), "1F1k has a lever"
                verdicts.append(none(f"{symbol}, where S1 = 0", case, size, "lb.in", "section 3.2, L1119", why))
    balance = max(greatest(case, a + b) for case, a, b in zip(cases, about["1F1k"], about["2F2k"]))
    verdicts.append(
        rows.at_most("greatest magnitude of 1F1k + 2F2k, the shift at rest, in all cases", OURS, SAME, balance, "lb")
    )
    for which, pick in (("least", np.nanmin), ("greatest", np.nanmax)):
        pin, torque = (pick([pick(found) for found in about[name]]) for name in ("2F2j", "1T1k"))
        verdicts.append(near(f"{which} 2F2j of all cases", text(place), -8.33, pin, 0.005, "lb"))
        given = "section 3.1, L1079"
        verdicts.append(near(f"{which} 1T1k of all cases", text(given), TORQUE, torque, NOTHING, "lb.in"))
    for symbol in ("4T4i", "4T4j", "4T4k"):
        size = max(float(np.abs(values(case, COMPONENTS[symbol])).max()) for case in (IDEAL, *cases))
        verdicts.append(near(f"greatest magnitude of {symbol} in all cases", text(place), 0.0, size, NOTHING, "lb.in"))
    return verdicts


def _curve_name(symbol: str, case: Case, unit: str) -> str:
    return f"{symbol}; {case.name} [{unit}]"


def _dead_centre_name(case: Case) -> str:
    return f"dead centre; {case.name} [deg]"


def compute(number: str) -> StudyResult:
    """Compute the curves of all cases of a figure, their dead centres, and the verdicts."""
    family, symbols, *_ = FIGURES[number]
    components = [COMPONENTS[symbol] for symbol in symbols]
    cases = (IDEAL, *FAMILIES[family].cases)
    columns = {ANGLE: ANGLES_DEG}
    if not components:
        columns |= {_curve_name("S4", case, "in"): position(case) for case in cases}
    for component in components:
        columns |= {_curve_name(component.symbol, case, component.unit): values(case, component) for case in cases}
    columns |= {_dead_centre_name(case): dead_centres_deg(case) for case in cases}
    verdicts = _constant() if number == CONSTANT else []
    for component in components:
        verdicts += _force_verdicts(family, component)
    shown = ", ".join(symbols) or "displacement S4"
    if number == CONSTANT:
        claim = "1F1k and 2F2k are zero, 2F2j is -T/a1, the moments on the slider are zero, in every case and at every angle."
    else:
        claim = f"The {shown} over a turn of the crank for variable {family}, beside the ideal case."
    assignment = "" if number == CONSTANT else INFERRED
    return StudyResult(
        number=number,
        claim=claim,
        assignment=assignment,
        columns=padded(columns),
        statements=_motion() if number == "R5" else (),
        see="R5" if number in ("R6", "R7") else "",
        verdicts=tuple(verdicts),
    )


def printed(text: str) -> str:
    """Format a case or a list of dimensions for a plot."""
    text = re.sub(r"\b([aS])(\d)", r"$\1_\2$", text.replace("alpha4", r"$\alpha_4$"))
    return re.sub(r" deg\b", "°", text)


def printed_symbol(symbol: str) -> str:
    """Format a symbol of the thesis, such as 1F1k, for a plot."""
    return re.sub(r"^(\d)([FT])(\d)([ijk])$", r"$^\1\2_{\3\4}$", symbol)


def _broken(result: StudyResult, case: Case, name: str) -> tuple[FloatArray, FloatArray]:
    """Return a curve that is interrupted at its dead centres."""
    centres = result.columns[_dead_centre_name(case)]
    centres = centres[np.isfinite(centres)]
    where = np.searchsorted(ANGLES_DEG, centres)
    return np.insert(ANGLES_DEG, where, centres), np.insert(result.columns[name], where, np.nan)


def _y_range(curves: Iterable[FloatArray]) -> tuple[float, float]:
    """Return a range with all values clear of the dead centres, at least 1 lb or 1 lb.in each way."""
    joined = np.concatenate(list(curves))
    low, high = float(joined.min()), float(joined.max())
    room = max(0.08 * (high - low), 1.0 if high - low < NOTHING else 0.0)
    return low - room, high + room


def draw(result: StudyResult) -> Figure:
    """Draw one panel a component, the ideal case dashed over the others, dead centres dotted."""
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
        low, high = _y_range(result.columns[name][clear(case)] for case, name in names.items())
        curves = []
        for case, legend, colour, line in looks:
            x, y = _broken(result, case, names[case])
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
STUDIES = {number: Study(number, partial(compute, number), draw) for number in FIGURES}
