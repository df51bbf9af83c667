"""Rig 2: its motion (Fig 8.18), its resonance curves (Fig 8.19 to 8.21), and the loads on its drive and pins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ...youssef import HarmonicMotion, Variant, harmonic_balance, slider_equation
from ..rules import ABOUT, ABOUT_DEG, ALIKE, SMALL
from ..statements import Case, FloatArray, Statement, at_least, at_most, near, statement, unjudged
from ..study import Study, StudyResult, pad_columns
from ..variation import cache
from . import rigs

#: Natural frequencies (rpm) that the thesis sees and calculates, as printed, by spring.
NATURAL = {"C": ("585", "582"), "D": ("825", "829")}
#: Speeds (rpm) at which the linear equation is solved, and speeds at which the rig was run.
CURVE = np.arange(rigs.SLOWEST, rigs.FASTEST["C"] + 1.0, 10.0)
RANGE = np.arange(300.0, 1001.0, 10.0).tolist()
#: Speeds (rpm) beyond resonance, by spring, at which the amplitude is compared, and dampers relative to the rig's.
BEYOND, DAMPERS = {"C": (650.0, 700.0, 800.0, 900.0, 1000.0), "D": (890.0, 950.0, 1000.0)}, (1.25, 0.8)
#: Friction radius of the pins B, C and D (m): a dry bearing of PTFE, coefficient 0.05 to 0.1, on a pin of 3 to 6 mm.
PIN_RADIUS = 3e-4
#: Orders of sigma2 to which the linear equation is taken; why the first is not enough.
ORDERS = {"first": Variant.FIRST_ORDER, "second": Variant.SECOND_ORDER}
LACKS = "near half the natural frequency it lacks most of the second harmonic"
#: Number of harmonics beyond which the amplitude by the linear equation no longer changes.
EXACT_HARMONICS = 8
#: How the width of a resonance is measured, in words.
WIDTH = (
    "width of the range of speeds at which the amplitude divided by the speed squared is at least 0.71 of its greatest "
    "value (our choice)"
)


# --- 8.18: the motion over the crank angle


def _unbalance_ratio(spring: str, speeds: FloatArray, unbalance: float) -> float:
    """Return the ratio of the amplitude to the amplitude of a single mass under an unbalance (cm.kg).

    The single mass is on the same spring and damper. Of the ratios at the speeds (rpm) the one farthest from 1 is returned.
    """
    rates = RAD_S_PER_RPM * speeds
    amplitudes = np.array([rigs.amplitude(rigs.turn(spring, w)) for w in speeds.tolist()])
    ratios = amplitudes * np.abs(rigs.complex_stiffness(rigs.rig(spring), rates)) / (unbalance * rates**2)
    return float(ratios[np.abs(ratios - 1.0).argmax()])


def judge_motion() -> Iterator[Statement]:
    """Return the statements on the motion of rig 2 over the crank angle, Fig 8.18."""
    section, speeds, span = "8.4.2.1", RANGE, (RANGE[0], RANGE[-1])
    sizes = {s: np.array([[rigs.harmonic(rigs.turn(s, w), n) for n in (1, 2)] for w in speeds]) for s in "CD"}
    ratios = {s: table[:, 1] / table[:, 0] for s, table in sizes.items()}
    # about the greatest ratio in steps of 1 rpm
    about = {s: np.clip(speeds[ratio.argmax()] + np.arange(-10.0, 11.0), *span).tolist() for s, ratio in ratios.items()}
    most = {
        s: max(rigs.harmonic(rigs.turn(s, w), 2) / rigs.harmonic(rigs.turn(s, w), 1) for w in harmonics)
        for s, harmonics in about.items()
    }
    higher = {s: max(rigs.overtones(rigs.turn(s, w)) for w in speeds) for s in "CD"}
    largest = max(rigs.largest_multiplier(s, *span) for s in "CD")
    first = {
        s: np.array([np.fft.rfft(rigs.slider(rigs.turn(s, w))[:-1])[1] / (0.5 * rigs.SAMPLES) for w in speeds])
        for s in "CD"
    }
    shift = {s: _phase_range(harmonics) for s, harmonics in first.items()}
    why = "near half the natural frequency the second harmonic has its resonance"
    almost = f"{ABOUT:g}, the rule for *almost*"
    yield statement(
        "Typical experimentally observed slider oscillations are shown in Fig. (8.18) which exhibit an almost "
        "sinusoidal behaviour with a phase shift and also periodic in one crank cycle.",
        f"{section}, L6804",
        f"share of the speeds from {span[0]:g} to {span[1]:g} rpm, in steps of 10, at which the second harmonic is at most "
        f"{ABOUT:g} of the first; largest Floquet multiplier of the motion of one cycle at all these speeds",
        f"{almost}; more than half of the speeds, as *typical* says; below 1, as at L6437",
        *(at_least(f"spring {s}", 0.5, np.mean(ratio <= ABOUT)) for s, ratio in ratios.items()),
        at_most("largest multiplier", 1.0, largest),
        why="the phase shift is judged in the next sentence",
    )
    yield statement(
        "Other results show that the sinusoidal behaviour is maintained throughout the range of speeds performed in "
        "this experiment, i.e. a range of 300 to 1000 RPM, and the phase shift varies with speed.",
        f"{section}, L6808",
        "greatest ratio of the second harmonic to the first over the range, in steps of 10 rpm, and of 1 rpm about the "
        "greatest; change of the phase of the first harmonic over the range",
        f"{almost}; 90 deg, our choice, half of the change of phase at a resonance",
        *(at_most(f"spring {s}, second over first", ABOUT, most[s], why=why) for s in "CD"),
        *(at_least(f"spring {s}, change of the phase", 90.0, shift[s], "deg") for s in "CD"),
    )
    yield statement(
        "This indicates that the basic and dominant harmonic in the slider motion is the first; the second is very "
        "small in comparison and no evidence of the third and higher harmonics exists.",
        f"{section}, L6814; again 8.4.2.2, L6968",
        "second harmonic relative to the first, as in the sentence before; greatest of the harmonics 3 to 6 relative to "
        f"the greater of the two, the most from {span[0]:g} to {span[1]:g} rpm in steps of 10",
        f"at most 1, as *dominant* says of the first; {SMALL:g}, the rule for *small*, which we use for *very small* and "
        "*no evidence* too",
        *(
            at_most(f"spring {s}, {words}", bound, ratio[s], why=why)
            for s in "CD"
            for words, bound, ratio in (
                ("the first dominant", 1.0, most),
                ("the second small", SMALL, most),
                ("the higher ones small", SMALL, higher),
            )
        ),
    )
    yield from _like_one_mass(first, np.array(speeds), about)


def _phase_range(harmonics: NDArray[np.complex128]) -> float:
    """Return the range of the phase (deg) of complex amplitudes over the speed."""
    return float(np.degrees(np.ptp(np.unwrap(np.angle(harmonics)))))


def _like_one_mass(
    first: Mapping[str, NDArray[np.complex128]], speeds: FloatArray, about: Mapping[str, Sequence[float]]
) -> Iterator[Statement]:
    """Compare the motion of rig 2 with that of a damped mass on a spring.

    ``first`` has the first harmonic (cm, complex) at the speeds (rpm) by spring; ``about`` has further speeds near half the
    natural frequency.
    """
    rates, constant, phase, spread, beyond = RAD_S_PER_RPM * speeds, [], [], [], []
    for s in "CD":
        force = first[s] * rigs.complex_stiffness(rigs.rig(s), rates)
        unbalance = np.abs(force) / rates**2
        constant.append(at_most(f"spring {s}, F0", 1.0 + ABOUT, np.abs(force).max() / np.abs(force).min()))
        phase.append(at_most(f"spring {s}, phi", ABOUT_DEG, _phase_range(force), "deg"))
        spread.append(at_most(f"spring {s}, F0 over the square", ABOUT, np.ptp(unbalance) / unbalance.mean()))
        ratio = _unbalance_ratio(s, np.unique([*speeds, *about[s]]), float(unbalance.mean()))
        beyond.append(near(f"spring {s}, amplitude", 1.0, ratio, ABOUT))
    yield statement(
        "It also indicates that the steady state behaviour is similar to a second order [damped] mass-spring system "
        "described by [m x'' + mu x' + k x = F0 Sin (wt + phi)].",
        "8.4.2.1, L6820",
        "amplitude F0 and phase phi of the force under which the mean effective mass, on this spring and damper, moves "
        "as the first harmonic of u does, from 300 to 1000 rpm in steps of 10: greatest F0 divided by the least, and "
        "range of phi. We read both as constant over the speed",
        f"{ABOUT:g} and {ABOUT_DEG:g} deg, the rule for *similar*",
        *constant,
        *phase,
        why="F0 grows with the square of the speed, as under an unbalance, see L6970",
    )
    yield statement(
        "The resonance and steady state behaviour is similar to a linear second order damped mass-spring system ...",
        "8.4.2.2, L6970",
        "F0 (L6820) divided by the square of the speed: its range relative to its mean. Then the amplitude of the "
        "slider, relative to that of such a system under an unbalance whose force is this mean times the square of the "
        "speed: the ratio farthest from 1, from 300 to 1000 rpm, as at L6808",
        f"{ABOUT:g}, the rule for *similar*",
        *spread,
        *beyond,
        why="near half the natural frequency the second harmonic adds to the first",
    )


# --- 8.19 to 8.21: resonance curves


@cache
def linear_motion(
    spring: str, speed: float, variant: Variant = Variant.SECOND_ORDER, harmonics: int = 2
) -> HarmonicMotion:
    """Return the motion u/l4 at a speed (rpm) by the corrected linear equation of chapter IV, up to harmonic ``harmonics``."""
    return harmonic_balance(slider_equation(rigs.rig(spring), speed * RAD_S_PER_RPM, variant=variant), harmonics)


def length(spring: str) -> float:
    """Return the rocker's length (cm), the reference of amplitudes."""
    return CM_PER_METRE * rigs.rig(spring).rocker_length


def compute_resonance(spring: str) -> StudyResult:
    """Compute the amplitude over the speed by the full equations and by two harmonics of the linear equation."""
    (branch,), l4 = rigs.motions(spring).branches, length(spring)
    place, _ = rigs.maximum_near_fraction(spring, 1)
    speeds = np.unique(np.append(CURVE, place)).tolist()
    columns = {
        "speed; full equations [rpm]": rigs.rpm(branch),
        "amplitude over l4; full equations [1]": CM_PER_METRE * branch.amplitude / l4,
        "speed; linear equation [rpm]": speeds,
        "amplitude over l4; linear equation [1]": [linear_motion(spring, speed).amplitude for speed in speeds],
    }
    return StudyResult(
        claim=f"Theory and experiment agree up to resonance, {NATURAL[spring][0]} rpm; beyond it theory is smaller.",
        columns=pad_columns(columns),
        statements=(*_beyond_resonance(), *_natural_frequencies()) if spring == "C" else (),
        see="" if spring == "C" else "8.19",
    )


@cache
def width(spring: str, linear: Variant | None = None, /, **changes: float) -> float:
    """Return the width of the resonance (rpm), defined in `WIDTH`.

    It follows from the full equations, with changes of the rig, or from the variant ``linear`` of the linear equation.
    """
    speeds = rigs.natural_speed(spring) + np.arange(-40.0, 40.1, 5.0)
    if linear:
        sizes = np.array([linear_motion(spring, speed, linear).amplitude for speed in speeds.tolist()])
    else:
        sizes = rigs.follow_amplitude(spring, speeds.tolist(), **changes)
    fine = np.linspace(speeds[0], speeds[-1], 80001)
    # the force on the slider grows with the square of the speed
    shape = CubicSpline(speeds, sizes / speeds**2)(fine)
    return float(np.ptp(fine[shape >= shape.max() / sqrt(2.0)]))


def _beyond_resonance() -> Iterator[Statement]:
    """Judge the statements on the amplitude of Fig 8.19 and 8.20 up to resonance and beyond it."""
    section, larger = "8.4.2.2", "above 1, the sign alone, as *smaller* says"
    over, exact = {}, []
    for s in "CD":
        orders = ORDERS.values()
        linear = {(w, v): length(s) * linear_motion(s, w, v).amplitude for w in BEYOND[s] for v in orders}
        over[f"spring {s}, amplitude"] = [rigs.amplitude(rigs.turn(s, w)) / size for (w, _), size in linear.items()]
        over[f"spring {s}, width"] = [width(s) / width(s, v) for v in orders]
        exact += [
            rigs.amplitude(rigs.turn(s, w))
            / (length(s) * linear_motion(s, w, Variant.EXACT, EXACT_HARMONICS).amplitude)
            for w in BEYOND[s]
        ]
    beyond = " and ".join(f"{', '.join(f'{w:g}' for w in speeds)} rpm with {s}" for s, speeds in BEYOND.items())
    yield statement(
        "The experimental and theoretical curves agree in the region of speed leading up to resonance at [omega = omega_n].",
        f"{section}, L6837",
        why=rigs.LOST,
    )
    yield statement(
        "However the width of the resonance region and the amplitude of vibration beyond resonance obtained from the "
        "theory is smaller than that of the experiment but, nevertheless, a reasonable agreement is evident.",
        f"{section}, L6841",
        why=rigs.LOST,
    )
    yield statement(
        "These differences may however be attributed to the fact that quantities involving the second and higher orders "
        "of [xi3, xi4] and [sigma2], and their derivatives are ignored in the theory.",
        f"{section}, L6847",
        f"amplitude beyond resonance, at {beyond} (our choice), and {WIDTH}. Each is taken by the full equations and "
        "divided by its value by two harmonics of the linear equation, corrected, with sigma2 to first or second order; "
        "the greatest ratio is listed",
        larger,
        *(at_least(label, 1.0, max(ratios)) for label, ratios in over.items()),
        why="what is ignored lowers the amplitude and narrows the resonance. The orders of xi alone raise the amplitude, by "
        f"{100.0 * (min(exact) - 1.0):.2f} to {100.0 * (max(exact) - 1.0):.2f} % of that by the linear equation with all "
        "orders of sigma2 and all harmonics",
    )
    yield statement(
        "Other factors contributing to the differences may, as before, be attributed to the presence of Coloumb friction in "
        "the guide and pin joints and to the fact that only an average value of the damping is considered in the theory.",
        f"{section}, L6853",
        "amplitude and width of the sentence before, by the full equations with one factor, divided by those without it; the "
        f"least ratio of both springs. The factors (our sizes): friction by {rigs.SLIGHT:g} of the guide's force, a friction "
        f"radius of {1e3 * PIN_RADIUS:g} mm in the pins, a damper {' or '.join(f'{d:g}' for d in DAMPERS)} times as strong",
        larger,
        *_factors(),
        why="no one factor does both",
    )


def linear_error(spring: str, order: Variant) -> float:
    """Return the greatest relative error of the amplitude by a variant of the linear equation, over the speeds of `RANGE`."""
    return max(
        abs(length(spring) * linear_motion(spring, w, order).amplitude / rigs.amplitude(rigs.turn(spring, w)) - 1.0)
        for w in RANGE
    )


def _natural_frequencies() -> Iterator[Statement]:
    """Judge the statements on the natural frequencies of Fig 8.19 and 8.20, and on the linear theory as a whole."""
    section = "8.4.2.2"
    natural = {s: rigs.natural_speed(s) for s in "CD"}
    around = {s: [rigs.natural_speed(s, slider_stiffness=k) for k in rigs.stiffness_range(s)] for s in "CD"}
    yield statement(
        "Figs. (8.19) and (8.20) also show a natural frequency in the region of 585 RPM with spring C and in the region "
        "of 825 RPM with spring D.",
        f"{section}, L6861",
        "speed of the greatest amplitude by the full equations",
        f"{100 * ABOUT:g} %, the rule for *in the region of*",
        *(
            near(f"spring {s}", NATURAL[s][0], rigs.maximum_near_fraction(s, 1)[0], ABOUT * float(NATURAL[s][0]), "rpm")
            for s in "CD"
        ),
    )
    yield statement(
        "These are in good agreement with theoretical calculations based on the equivalent mass of the linkage which "
        "are 582 and 829 for springs C and D respectively.",
        f"{section}, L6865",
        "natural frequency by the mean effective mass, the nearest to the stated one that the rounding of the printed "
        "stiffness (one digit) allows. Then the printed frequency of the sentence before, relative to that with the "
        "stiffness as printed",
        f"0.5 rpm, half a unit of the last digit; {ALIKE:g}, the rule for *the same*, which we use for *good agreement*",
        *(
            near(
                f"spring {s}, calculated; rounding allows {' to '.join(f'{speed:.1f}' for speed in around[s])}",
                NATURAL[s][1],
                np.clip(float(NATURAL[s][1]), min(around[s]), max(around[s])),
                unit="rpm",
            )
            for s in "CD"
        ),
        *(near(f"spring {s}, shown over calculated", 1.0, float(NATURAL[s][0]) / natural[s], ALIKE) for s in "CD"),
        why=f"with the stiffness as printed, they are {natural['C']:.1f} and {natural['D']:.1f} rpm",
    )
    yield statement(
        "[T]he theoretical and experimental resonance curves are in good agreement indicating that the assumption in "
        "the theory that the second and higher orders of [xi3] and [xi4] and their derivatives are negligible is "
        "a reasonable assumption.",
        f"{section}, L6974",
        "greatest relative error of the amplitude by two harmonics of the linear equation of chapter IV, corrected, from "
        f"{RANGE[0]:g} to {RANGE[-1]:g} rpm in steps of 10: to first order of sigma2, as (4.21) has it, and to second",
        f"{SMALL:g}, the rule for *negligible*",
        *(
            at_most(f"spring {s}, {name} order", SMALL, linear_error(s, order), why=LACKS)
            for s in "CD"
            for name, order in ORDERS.items()
        ),
        unjudged("agreement with the experiment", rigs.LOST),
        why="L6887, that the results support chapter IV, rests on this row, L6814 and L6970",
    )


def _factors() -> tuple[Case, ...]:
    """Judge how friction and other dampers change the amplitude beyond resonance and the width of the resonance."""
    factors: dict[str, dict[str, float]] = {
        "friction in the guide": {"slider_friction_coefficient": rigs.SLIGHT},
        "friction in the pins": {f"pin_{pin}_friction_radius": PIN_RADIUS for pin in "BCD"},
    }
    factors |= {f"damper {d:g} times as strong": {"slider_damping": d * rigs.rig("C").slider_damping} for d in DAMPERS}
    cases = []
    for name, changes in factors.items():
        beyond = [
            rigs.amplitude(rigs.turn(s, w, **changes)) / rigs.amplitude(rigs.turn(s, w))
            for s, speeds in BEYOND.items()
            for w in speeds
        ]
        cases += [
            at_least(f"{name}, amplitude", 1.0, min(beyond)),
            at_least(f"{name}, width", 1.0, min(width(s, **changes) / width(s) for s in "CD")),
        ]
    return tuple(cases)


def draw_resonance(spring: str, result: StudyResult) -> Figure:
    """Draw the amplitude relative to l4 over the speed."""
    panel = Panel(
        x_label="crank speed [rpm]",
        y_label="slider amplitude / $l_4$",
        title=f"rig 2, spring {spring}",
        curves=[
            Curve(
                x=result.columns[f"speed; {n} [rpm]"],
                y=result.columns[f"amplitude over l4; {n} [1]"],
                label=n,
                line=line,
                width=w,
            )
            for n, line, w in (("full equations", "-", None), ("linear equation", ":", 2.2))
        ],
        verticals=rigs.marks(spring, 1, 2),
        legend_at="upper left",
        x_range=(rigs.SLOWEST, rigs.FASTEST[spring]),
        y_range=(1e-4, 1.0),
        logarithmic="y",
    )
    return plot_curves([panel], title=result.heading)


HARMONICS = (1, 2, 3)


def _greatest(spring: str, n: int, part: int, order: Variant) -> float:
    """Return the greatest amplitude of the n-th harmonic of the linear equation, relative to l4.

    It is sought near the natural frequency divided by ``part``.
    """
    place = rigs.natural_speed(spring) / part
    found = minimize_scalar(
        lambda speed: -linear_motion(spring, float(speed), order).harmonic(n),
        bounds=(place - 10.0, place + 10.0),
        method="bounded",
        options={"xatol": 0.01},
    )
    return -float(found.fun)


def compute_harmonics() -> StudyResult:
    """Compute the first three harmonics relative to l4 over the speed, and the second by the linear equation too."""
    columns: dict[str, FloatArray] = {}
    points = CURVE[::3]
    # the second harmonic is greatest at the natural frequency or at half of it, by the order of sigma2
    first, second = (
        {s: [_greatest(s, 1, 1, order) / _greatest(s, 2, part, order) for part in (1, 2)] for s in "CD"}
        for order in ORDERS.values()
    )
    for spring in "CD":
        (branch,), l4, name = rigs.motions(spring).branches, length(spring), f"spring {spring}"
        table = branch.columns()
        sizes = {n: CM_PER_METRE * table[f"harmonic {n} of u [m]"] / l4 for n in HARMONICS}
        columns[f"speed; {name} [rpm]"] = rigs.rpm(branch)
        columns |= {f"harmonic {n} over l4; {name} [1]": size for n, size in sizes.items()}
        columns[f"speed; linear equation; {name} [rpm]"] = points
        columns[f"harmonic 2 over l4; linear equation; {name} [1]"] = np.array(
            [linear_motion(spring, speed).harmonic(2) for speed in points.tolist()]
        )
    return StudyResult(
        claim="The second harmonic is smaller than the first by a factor of 50.",
        columns=pad_columns(columns),
        statements=(
            statement(
                "There were no experimentally observable changes in the amplitude of oscillations at quarter, third and "
                "half the natural frequency, which again indicated a slider motion based on the first harmonic.",
                "8.4.2.2, L6871",
                "maximum of the amplitude there minus the minimum that follows at a higher speed, relative to this minimum; "
                "0 if the curve, in steps of at most 3 rpm there, has no maximum",
                rigs.SEEN_IN_RECORDS,
                *(
                    at_most(f"spring {spring}, {part}", rigs.NOTICED, rigs.peak_rise(spring, n))
                    for spring in "CD"
                    for n, part in ((4, "quarter"), (3, "third"), (2, "half"))
                ),
                why=f"of these places only half the natural frequency with D, {rigs.natural_speed('D') / 2.0:.0f} rpm, lies "
                "within the range that was run (L6808). How far the motion is the first harmonic is judged at L6814",
            ),
            statement(
                "The theoretical resonance curves corresponding to the second harmonic for both springs C and D are shown in "
                "Fig. (8.21). These are smaller than those corresponding to the first harmonic by a factor in magnitude of 50 "
                "and hence are in agreement with the experiment.",
                "8.4.2.2, L6877-6885",
                "greatest first harmonic divided by the greatest second harmonic, each at its own speed, by two harmonics of "
                "the linear equation, corrected, to second order of sigma2, because the terms of (4.21) for a coupler with "
                "mass are illegible in our scan. What the experiment showed is judged at L6871",
                f"{100 * ABOUT:g} %, the rule for *about*, since no digit after 50 is given",
                *(near(f"spring {s}", "50", min(second[s]), ABOUT * 50.0) for s in "CD"),
                why="the second harmonic is about 1.5 times as large as a fiftieth of the first. To first order of sigma2, as "
                "(4.21) has it, the second harmonic is greatest at the natural frequency, and the factor is "
                f"{min(first['C']):.0f} with C and {min(first['D']):.0f} with D; by its maximum at half this frequency it is "
                f"{first['C'][1]:.0f} and {first['D'][1]:.0f}",
            ),
        ),
    )


def draw_harmonics(result: StudyResult) -> Figure:
    """Draw the harmonics, one panel for each spring, the second harmonic in front."""
    panels = []
    for spring in "CD":
        name = f"spring {spring}"
        speed = result.columns[f"speed; {name} [rpm]"]
        curves = [
            Curve(
                x=speed,
                y=result.columns[f"harmonic {n} over l4; {name} [1]"],
                label=f"harmonic {n}" if spring == "D" else "",
                colour=colour,
                line="-" if n == 2 else "--",
                width=1.8 if n == 2 else 1.0,
            )
            for n, colour in zip(HARMONICS, COLOURS)
        ]
        points = Curve(
            x=result.columns[f"speed; linear equation; {name} [rpm]"],
            y=result.columns[f"harmonic 2 over l4; linear equation; {name} [1]"],
            label="2, linear equation" if spring == "D" else "",
            line="",
            marker="o",
            colour=COLOURS[1],
        )
        panels.append(
            Panel(
                x_label="crank speed [rpm]",
                y_label="amplitude of the harmonic / $l_4$",
                title=f"rig 2, {name}",
                curves=[*curves, points],
                verticals=rigs.marks(spring, 1, 2, 3),
                legend_at="outside",
                logarithmic="y",
                x_range=(rigs.SLOWEST, rigs.FASTEST[spring]),
                y_range=(1e-6, 1.0),
            )
        )
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 4.0))


# --- rig-2-forces: what the crank's drive and the pins of rig 2 carry

PINS = "ACD"
TORQUES = ("greatest crank torque", "mean crank torque")


def compute_forces() -> StudyResult:
    """Compute the crank torque and the pin forces over the speed."""
    columns: dict[str, FloatArray] = {}
    for spring in "CD":
        name, branch = f"spring {spring}", rigs.motions(spring).branches[0]
        table, speeds = branch.columns(), rigs.rpm(branch)
        columns[f"speed; {name} [rpm]"] = speeds
        for torque in TORQUES:
            columns[f"{torque}; {name} [N.m]"] = table[f"{torque} [N.m]"]
        for pin in PINS:
            columns[f"greatest force in pin {pin}; {name} [N]"] = table[f"greatest force in pin {pin} [N]"]
    return StudyResult(
        claim="At low speed every force of this horizontal machine grows with the square of the speed. Resonance increases "
        "the force in pin D most.",
        columns=pad_columns(columns),
    )


def draw_forces(result: StudyResult) -> Figure:
    """Draw the torque above and the pin forces below, one column for each spring; the square of the speed is dotted."""
    torques, forces = [], []
    for spring in "CD":
        name = f"spring {spring}"
        speed = result.columns[f"speed; {name} [rpm]"]
        law = (speed / speed[0]) ** 2
        carried = {torque: result.columns[f"{torque}; {name} [N.m]"] for torque in TORQUES}
        lines = [
            Curve(x=speed, y=values, label=torque.split()[0], colour=colour)
            for (torque, values), colour in zip(carried.items(), COLOURS)
        ]
        greatest = carried[TORQUES[0]][0] * law
        lines.append(Curve(x=speed, y=greatest, label="speed squared", line=":", colour=COLOURS[0]))
        torques.append(_panel(spring, "crank torque [N.m]", lines, 0.9))
        lines = []
        for pin, colour in zip(PINS, COLOURS):
            force = result.columns[f"greatest force in pin {pin}; {name} [N]"]
            lines.append(Curve(x=speed, y=force, label="A and B" if pin == "A" else pin, colour=colour))
            lines.append(Curve(x=speed, y=force[0] * law, line=":", colour=colour))
        lines.append(Curve(x=[], y=[], label="speed squared", line=":", colour="0.35"))
        forces.append(_panel(spring, "greatest pin force [N]", lines, 150.0, "pin"))
    return plot_curves([*torques, *forces], title=result.heading, columns=2, size=(4.9, 3.5))


def _panel(spring: str, y_label: str, lines: list[Curve], top: float, legend: str = "") -> Panel:
    """Build the panel with the curves ``lines`` over the speed for one spring; that of spring D has the legend for both."""
    first = spring == "C"
    return Panel(
        x_label="crank speed [rpm]",
        y_label=y_label,
        title=f"spring {spring}",
        curves=[replace(line, label="") for line in lines] if first else lines,
        verticals=rigs.marks(spring, 1),
        legend=legend,
        legend_at="outside",
        x_range=(rigs.SLOWEST, rigs.FASTEST[spring]),
        y_range=(0.0, top),
    )


#: The studies by number and name.
STUDIES = {
    "8.19": Study(partial(compute_resonance, "C"), partial(draw_resonance, "C")),
    "8.20": Study(partial(compute_resonance, "D"), partial(draw_resonance, "D")),
    "8.21": Study(compute_harmonics, draw_harmonics),
    "rig-2-forces": Study(compute_forces, draw_forces),
}
