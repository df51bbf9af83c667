"""Rahman's figures 5 to 38: displacement and all joint forces of the generalised slider-crank, one family of studies.

The mechanism of section 3.1 turns at 50 rpm under a crank torque of 100 lb.in, with the offset a4, the shift S1 or the twist
alpha4 in three sizes, each beside the ideal slider-crank (a4 = 0, S1 = 0, alpha4 = 270 deg). What is sought is the force on
the slider, and with it every joint force and moment. It has no finite value at the dead centres, where it has no lever on
the crank: the curves leave the plot there, and dotted lines of their colour mark the places. The greatest value of a curve
is therefore told at whole degrees that are more than `CLEAR_DEG` from a dead centre.

Our source tells which quantities and cases the figures show, but not which stands under which number: the numbering is our
assignment (`table`). What section 3.2 states is held against the computation where the quantity concerned is shown. All
forces are computed a second time by dual vectors, which share no equation with the plant.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import cache, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from linkwork.slider_crank.published import CRANK_SPEED, CRANK_TORQUE, INCH, POUND_FORCE, POUND_INCH, parameters

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...slider_crank import (
    CLEAR_DEG,
    ConstantShift,
    ForceTurn,
    JointLoads,
    assembly_margin,
    close,
    constant_shift,
    follow,
    force_turn,
    greatest_shift,
    joint_loads,
    ranges,
)
from ..study import OURS, TEXT, Study, StudyResult, Verdict, at_least, at_most, near, padded
from .table import (
    ASSIGNED,
    AXIAL_LB,
    DEAD_CENTRES_DEG,
    FAMILIES,
    FIGURES,
    GREATEST_SHIFTS_IN,
    IDEAL,
    QUANTITIES,
    SHIFTS_REACHED_IN,
    SLIDER_MOMENTS,
    SPIKES_DEG,
    SPOTS,
    STROKES_BY_TWIST_IN,
    STROKES_IN,
    TWISTS_REACHED_DEG,
    Case,
    Component,
)

FloatArray = NDArray[np.float64]

#: Crank angles of the curves (deg): half degrees, the whole ones among them.
ANGLES_DEG = np.linspace(0.0, 360.0, 721)
ANGLE = "crank angle theta1 [deg]"
#: Step (deg) in which the loop closed by dual matrices is followed round the turn.
FOLLOW_DEG = 20.0
#: Largest force or moment (lb, lb.in) that is taken for none, and largest relative difference of two ways of computing.
NOTHING, SAME = 1e-6, 1e-9
#: Torque on the crank (lb.in) and its length (in).
TORQUE, CRANK = 100.0, 12.0
#: How far (deg) "near" is taken to reach in "spikes near 100 and 300 deg": ours, the source gives no range.
SPIKES_TO = 25.0

_UNITS = {"lb": POUND_FORCE, "lb.in": POUND_INCH}
_RAISES = "The offset a4 raises the joint forces."
#: Stands for a claim where the text, as far as our source tells, says nothing of a quantity in these cases.
NO_CLAIM = "Nothing is stated of it in our source; it is computed in two ways."


@cache
def turn(case: Case, given: str = "torque") -> ForceTurn:
    """A turn of the crank, with the ``torque`` given and the slider's force sought, or with no ``load`` on the slider."""
    return force_turn(
        parameters(case.offset_in, case.twist_deg),
        crank_speed=CRANK_SPEED,
        shift=ConstantShift(case.shift_in * INCH),
        angles=np.radians(ANGLES_DEG),
        torque=CRANK_TORQUE if given == "torque" else None,
    )


def dead_centres_deg(case: Case) -> FloatArray:
    """Crank angles of the dead centres (deg)."""
    return np.degrees([centre.crank_angle for centre in turn(case).dead_centres])


def values(case: Case, component: Component, given: str = "torque") -> FloatArray:
    """A component over the turn in the unit as printed, NaN at a dead centre."""
    found = turn(case, given)
    if component.source in ("axial_force", "slider_force"):
        si = getattr(found, component.source)
    else:
        si = found.vector(component.source, component.frame)[:, component.axis]
    return np.asarray(component.sign * np.ma.filled(si, np.nan) / _UNITS[component.unit])


def position(case: Case) -> FloatArray:
    """Slider position (in)."""
    return turn(case).slider_position / INCH


@cache
def clear(case: Case) -> NDArray[np.bool_]:
    """Which of the angles are whole degrees and clear of the dead centres."""
    # an angle at just this distance is not clear, however it is rounded
    return np.asarray((ANGLES_DEG % 1.0 == 0.0) & turn(case).clear(CLEAR_DEG + 1e-6))


def greatest(case: Case, quantity: FloatArray) -> float:
    """Greatest magnitude of a quantity over the turn, clear of the dead centres."""
    return float(np.abs(quantity[clear(case)]).max())


def spikes_deg(case: Case, component: Component) -> FloatArray:
    """Crank angles (deg) of the two poles of a component: where its reciprocal, which is smooth there, goes through zero."""
    value = values(case, component)
    (changes,) = np.nonzero(value[:-1] * value[1:] < 0.0)
    # a zero of the component changes its sign too, between small values
    size = np.minimum(np.abs(value[changes]), np.abs(value[changes + 1]))
    found = []
    for at in np.sort(changes[np.argsort(size)[-2:]]).tolist():
        near_it = slice(at - 1, at + 3)
        reciprocal = value[at] / value[near_it]
        found.append(np.polyfit(reciprocal, ANGLES_DEG[near_it], 3)[-1])
    return np.array(found)


@cache
def dual(case: Case) -> JointLoads:
    """All joint forces by dual vectors, at the angles that are clear of the dead centres.

    The loop is closed by continuation round the turn in steps of `FOLLOW_DEG`, and from these points in between.
    """
    mechanism, shift = parameters(case.offset_in, case.twist_deg), case.shift_in * INCH
    angles = ANGLES_DEG[clear(case)]
    turned = follow(mechanism, np.radians(np.arange(0.0, 361.0, FOLLOW_DEG)), shift)
    before = turned.at((angles // FOLLOW_DEG).astype(int))
    return joint_loads(close(mechanism, np.radians(angles), shift, before), speed=CRANK_SPEED, torque=CRANK_TORQUE)


def difference_from_dual(case: Case, component: Component) -> float:
    """Greatest difference between a component and that by dual vectors, clear of the dead centres, relative to T/a1 or T."""
    loads = dual(case)
    if component.source in ("axial_force", "slider_force"):
        si = loads.axial if component.source == "axial_force" else loads.slider_force
    else:
        si = loads.components(component.source, component.frame)[:, component.axis]
    other = component.sign * si / _UNITS[component.unit]
    scale = TORQUE if component.unit == "lb.in" else TORQUE / CRANK
    return float(np.abs(values(case, component)[clear(case)] - other).max()) / scale


def _offsets_gain(component: Component, given: str) -> float:
    """Least gain of a component's greatest magnitude from each case of family A to the next, the ideal one first."""
    peaks = [greatest(case, values(case, component, given)) for case in (IDEAL, *FAMILIES["A"].cases)]
    return min(after - before for before, after in pairwise(peaks))


def _force_verdicts(family: str, component: Component) -> list[Verdict]:
    """What is said of any component: the offset raises it, its spikes are the dead centres, it is computed twice."""
    cases, symbol = FAMILIES[family].cases, component.symbol
    verdicts = []
    if family == "A" and "F" in symbol:
        what = f"greatest magnitude of {symbol}, least gain from one a4 to the next"
        # along the guide nothing acts without a load, and 2F2j is settled by the torque
        if component.source != "slider_force":
            verdicts.append(
                at_least(f"{what}; slider load given", TEXT, 0.0, _offsets_gain(component, "load"), component.unit)
            )
        if symbol != "2F2j":
            verdicts.append(
                at_least(f"{what}; torque given", TEXT, 0.0, _offsets_gain(component, "torque"), component.unit)
            )
    spikes = [(case, spikes_deg(case, component)) for case in cases if _has_spikes(case, component)]
    if spikes:
        distance = max(float(np.abs(found - dead_centres_deg(case)).max()) for case, found in spikes)
        verdicts.append(at_most(f"distance of the spikes of {symbol} from dead centres", OURS, 0.005, distance, "deg"))
    difference = max(difference_from_dual(case, component) for case in (IDEAL, *cases))
    scale = "T" if component.unit == "lb.in" else "T/a1"
    verdicts.append(
        at_most(f"difference of {symbol} from that by dual vectors, relative to {scale}", OURS, SAME, difference)
    )
    return verdicts


def _has_spikes(case: Case, component: Component) -> bool:
    """Whether the slider's force has a part in a component: then that differs between the two force problems."""
    sought, given = (values(case, component, problem) for problem in ("torque", "load"))
    # 1T1k and, at constant speed, 2F2j are settled by the torque
    settled = np.ptp(sought[clear(case)]) < NOTHING
    return not settled and greatest(case, sought - given) > NOTHING


def _none(statement: str, source: str, case: Case, quantity: FloatArray, unit: str) -> Verdict:
    """A verdict on what is stated to be zero, told by its greatest magnitude clear of the dead centres."""
    return near(f"{statement}; {case.name}", source, 0.0, greatest(case, quantity), NOTHING, unit)


def _stroke(case: Case) -> float:
    """Stroke (in) of a mechanism of section 3.1 at its shift."""
    mechanism = parameters(case.offset_in, case.twist_deg)
    (whole,) = ranges(mechanism, constant_shift(case.shift_in * INCH))
    return whole.stroke / INCH


def _slider(family: str) -> tuple[str, list[Verdict]]:
    """Stroke and dead centres, and how far the mechanism can be assembled."""
    cases = FAMILIES[family].cases
    verdicts = [
        at_most(f"stroke relative to the ideal one's; {case.name}", TEXT, 1.0, _stroke(case) / _stroke(IDEAL))
        for case in cases
        if case.twist_deg == IDEAL.twist_deg
    ]
    claim = "The offset a4 reduces the stroke."
    if family == "A":
        for a4, stroke in STROKES_IN.items():
            planar = Case("", a4, 0.0, 270.0)
            verdicts.append(near(f"stroke; a4 = {a4:g} in with S1 = 0", OURS, stroke, _stroke(planar), 5e-4, "in"))
        for a4, stated in DEAD_CENTRES_DEG.items():
            found = dead_centres_deg(Case("", a4, 0.0, 270.0))
            verdicts += [
                near(f"{which} dead centre; a4 = {a4:g} in with S1 = 0", OURS, angle, at, 0.005, "deg")
                for which, angle, at in zip(("first", "second"), stated, found)
            ]
    elif family == "B":
        reached = SHIFTS_REACHED_IN[-1]
        claim += f" The iteration converges up to S1 = {', '.join(f'{shift:g}' for shift in SHIFTS_REACHED_IN)} in."
        shifts = {a4: (greatest_shift(parameters(a4)) or 0.0) / INCH for a4 in GREATEST_SHIFTS_IN}
        statement = "greatest S1 to which the iteration converges, beside the least to which the crank turns fully"
        verdicts.append(near(statement, TEXT, reached, min(shifts.values()), 0.5, "in"))
        verdicts += [
            near(f"greatest S1 at which the crank turns fully; a4 = {a4:g} in", OURS, stated, shifts[a4], 5e-4, "in")
            for a4, stated in GREATEST_SHIFTS_IN.items()
        ]
    else:
        least, most = TWISTS_REACHED_DEG
        claim += f" The iteration converges at twists alpha4 from {least:g} to {most:g} deg."
        step = 5
        margins = [_margin(float(twist)) for twist in range(0, 360, step)]
        width = step * sum(margin > 0.0 for margin in margins)
        statement = "range of alpha4 in which the iteration converges, beside that in which the crank turns fully"
        verdicts.append(near(statement, TEXT, most - least, width, step, "deg"))
        verdicts.append(
            at_least(f"least margin of assembly at every {step} deg of alpha4", OURS, 0.0, min(margins), "in")
        )
        verdicts += [
            near(f"stroke; {case.name}", OURS, STROKES_BY_TWIST_IN[case.twist_deg], _stroke(case), 0.005, "in")
            for case in cases
            if case.twist_deg in STROKES_BY_TWIST_IN
        ]
    return claim, verdicts


def _margin(twist_deg: float) -> float:
    """Least margin of assembly over the turn (in) at a4 = 20 in, S1 = 0."""
    case = FAMILIES["C"].cases[0]
    return assembly_margin(parameters(case.offset_in, twist_deg), constant_shift(case.shift_in * INCH)).length / INCH


def _axial(family: str) -> tuple[str, list[Verdict]]:
    """1F1k is not prescribed."""
    verdicts = []
    for case in FAMILIES[family].cases:
        found = values(case, _COMPONENTS["1F1k"])
        verdicts.append(_none("greatest magnitude of 1F1k", TEXT, case, found, "lb"))
        balance = f"greatest magnitude of 1F1k + 2F2k, the shift at rest; {case.name}"
        verdicts.append(at_most(balance, OURS, SAME, greatest(case, found + values(case, _COMPONENTS["2F2k"])), "lb"))
    return "The axial force on the crank is m1 S1'', none at a constant shift.", verdicts


def _bearing_moment(family: str, axis: str) -> tuple[str, list[Verdict]]:
    """1T1i or 1T1j by the forces."""
    angle = np.radians(ANGLES_DEG)
    verdicts = []
    for case in FAMILIES[family].cases:
        fi, fj, fk, moment = (values(case, _COMPONENTS[name]) for name in ("1F1i", "1F1j", "1F1k", f"1T1{axis}"))
        if axis == "i":
            printed, formula = -fj * case.shift_in, "-1F1j S1"
            whole, full = printed + fk * CRANK * np.sin(angle), "-1F1j S1 + 1F1k a1 sin(theta1)"
        else:
            printed, formula = fi * case.shift_in, "1F1i S1"
            whole, full = printed - fk * CRANK * np.cos(angle), "1F1i S1 - 1F1k a1 cos(theta1)"
        verdicts.append(_none(f"greatest magnitude of 1T1{axis} - ({formula})", TEXT, case, moment - printed, "lb.in"))
        verdicts.append(_none(f"greatest magnitude of 1T1{axis} - ({full})", OURS, case, moment - whole, "lb.in"))
    if axis == "j":
        about = [values(case, _COMPONENTS["1T1k"]) for case in FAMILIES[family].cases]
        verdicts += [
            near(
                f"{which} 1T1k, the torque that is given",
                OURS,
                TORQUE,
                pick([pick(v) for v in about]),
                NOTHING,
                "lb.in",
            )
            for which, pick in (("least", np.nanmin), ("greatest", np.nanmax))
        ]
    return f"1T1{axis} = {formula}.", verdicts


def _across_crank(family: str) -> tuple[str, list[Verdict]]:
    """2F2j is settled by the torque."""
    found = [values(case, _COMPONENTS["2F2j"]) for case in FAMILIES[family].cases]
    return "At constant speed 2F2j = -T/a1 = -8.33 lb.", [
        near(f"{which} 2F2j of all cases", TEXT, -8.33, pick([pick(v) for v in found]), 0.005, "lb")
        for which, pick in (("least", np.nanmin), ("greatest", np.nanmax))
    ]


def _along_crank_axis(family: str) -> tuple[str, list[Verdict]]:
    """2F2k is not zero."""
    component = _COMPONENTS["2F2k"]
    verdicts = []
    for case in FAMILIES[family].cases:
        found = values(case, component)
        verdicts.append(_none("greatest magnitude of 2F2k", TEXT, case, found, "lb"))
        if case[1:] in AXIAL_LB:
            stated, tolerance = AXIAL_LB[case[1:]]
            statement = f"greatest magnitude of 2F2k; {case.name}"
            verdicts.append(near(statement, OURS, stated, greatest(case, found), tolerance, "lb"))
    return "2F2k = 0.", verdicts


def _raises(family: str) -> str:
    """What is stated of a force: that the offset raises it, and nothing where the offset is the same in all cases."""
    return _RAISES if family == "A" else NO_CLAIM


def _slider_pin(family: str) -> tuple[str, list[Verdict]]:
    """Across the rod the slider's force has no part."""
    found = max(
        float(np.nanmax(np.abs(values(case, component) - values(case, component, "load"))))
        for case in FAMILIES[family].cases
        for component in (_COMPONENTS["3F3j"], _COMPONENTS["3F3k"])
    )
    statement = "greatest difference of 3F3j and 3F3k between torque given and load given"
    return _raises(family), [at_most(statement, OURS, NOTHING, found, "lb")]


def _slider_force(family: str) -> tuple[str, list[Verdict]]:
    """The spikes, and values from an independent derivation."""
    component = _COMPONENTS["4F4k"]
    verdicts = []
    for case in FAMILIES[family].cases:
        found = spikes_deg(case, component)
        verdicts += [
            near(f"{which} spike, to within {SPIKES_TO:g} deg; {case.name}", TEXT, stated, at, SPIKES_TO, "deg")
            for which, stated, at in zip(("first", "second"), SPIKES_DEG, found)
        ]
        if case.shift_in == 0.0 and case.twist_deg == IDEAL.twist_deg:
            verdicts += [
                near(f"{which} spike; {case.name}", OURS, stated, at, 0.005, "deg")
                for which, stated, at in zip(("first", "second"), DEAD_CENTRES_DEG[case.offset_in], found)
            ]
        for spot in SPOTS:
            if case[1:] == spot[:3]:
                (at_30,) = values(case, component)[ANGLES_DEG == 30.0]
                statement = f"4F4k at theta1 = 30 deg; {case.name}"
                # printed along -k4
                verdicts.append(near(statement, OURS, -spot.slider_force_lb, at_30, 5e-7, "lb"))
    return "There are spikes near 100 and 300 deg.", verdicts


def _slider_moments(family: str) -> tuple[str, list[Verdict]]:
    """4T4 is zero."""
    cases = (IDEAL, *FAMILIES[family].cases)
    return "The moments on the slider are zero.", [
        near(
            f"greatest magnitude of {component.symbol} in all cases",
            TEXT,
            0.0,
            max(float(np.abs(values(case, component)).max()) for case in cases),
            NOTHING,
            "lb.in",
        )
        for component in SLIDER_MOMENTS.components
    ]


def _joint_force(family: str) -> tuple[str, list[Verdict]]:
    """Nothing more is said of this one."""
    return _raises(family), []


_COMPONENTS = {component.symbol: component for quantity in QUANTITIES for component in quantity.components}

#: What is said of a figure's quantity, by its first component: the claim, and the verdicts that are this quantity's own.
_ARGUMENTS: dict[str, Callable[[str], tuple[str, list[Verdict]]]] = {
    "S4": _slider,
    "1F1i": _joint_force,
    "1F1j": _joint_force,
    "1F1k": _axial,
    "1T1i": partial(_bearing_moment, axis="i"),
    "1T1j": partial(_bearing_moment, axis="j"),
    "2F2i": _joint_force,
    "2F2j": _across_crank,
    "2F2k": _along_crank_axis,
    "3F3i": _slider_pin,
    "4F4i": _slider_force,
    "4T4i": _slider_moments,
}


def _curve_name(symbol: str, case: Case, unit: str) -> str:
    return f"{symbol}; {case.name} [{unit}]"


def _dead_centre_name(case: Case) -> str:
    return f"dead centre; {case.name} [deg]"


def compute(number: str) -> StudyResult:
    """Curves of all cases of a figure, their dead centres, and what is stated of them."""
    family, quantity = FIGURES[number]
    cases = (IDEAL, *FAMILIES[family].cases)
    columns = {ANGLE: ANGLES_DEG}
    if not quantity.components:
        columns |= {_curve_name("S4", case, "in"): position(case) for case in cases}
    for component in quantity.components:
        columns |= {_curve_name(component.symbol, case, component.unit): values(case, component) for case in cases}
    columns |= {_dead_centre_name(case): dead_centres_deg(case) for case in cases}
    first = quantity.components[0].symbol if quantity.components else "S4"
    claim, verdicts = _ARGUMENTS[first](family)
    for component in quantity.components:
        verdicts += _force_verdicts(family, component)
    return StudyResult(
        number=number, claim=claim, assignment=ASSIGNED, columns=padded(columns), verdicts=tuple(verdicts)
    )


def printed(text: str) -> str:
    """A case or a list of dimensions as it stands in a plot."""
    text = re.sub(r"\b([aS])(\d)", r"$\1_\2$", text.replace("alpha4", r"$\alpha_4$"))
    return re.sub(r" deg\b", "°", text)


def printed_symbol(symbol: str) -> str:
    """A symbol of the thesis, such as 1F1k, as it stands in a plot."""
    return re.sub(r"^(\d)([FT])(\d)([ijk])$", r"$^\1\2_{\3\4}$", symbol)


def _broken(result: StudyResult, case: Case, name: str) -> tuple[FloatArray, FloatArray]:
    """A curve that is interrupted at its dead centres."""
    centres = result.columns[_dead_centre_name(case)]
    centres = centres[np.isfinite(centres)]
    where = np.searchsorted(ANGLES_DEG, centres)
    return np.insert(ANGLES_DEG, where, centres), np.insert(result.columns[name], where, np.nan)


def _y_range(curves: Iterable[FloatArray]) -> tuple[float, float]:
    """Range in which all values lie that are clear of the dead centres, with some room; at least a lb or lb.in each way."""
    joined = np.concatenate(list(curves))
    low, high = float(joined.min()), float(joined.max())
    room = max(0.08 * (high - low), 1.0 if high - low < NOTHING else 0.0)
    return low - room, high + room


def draw(result: StudyResult) -> Figure:
    """A panel a component; the ideal case dashed over the others, dead centres dotted."""
    family, quantity = FIGURES[result.number]
    looks = [
        (case, printed(case.name), colour, line)
        for case, colour, line in zip(FAMILIES[family].cases, COLOURS * 2, ["-"] * len(COLOURS) + ["-."] * len(COLOURS))
    ]
    looks.append((IDEAL, printed("ideal, a4 = S1 = 0"), "0.15", "--"))
    shown = [(c.symbol, f"{printed_symbol(c.symbol)}, {c.meaning}", c.unit) for c in quantity.components]
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
