"""Resonance curves of rig 2, figures 8.19 to 8.21, and the loads on its drive and pins."""

from __future__ import annotations

from functools import cache, partial
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import Branch
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ...youssef import HarmonicMotion, Variant, nonlinear_harmonic_balance, slider_equation, two_harmonics
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, near, padded, text, unjudged
from .rigs import (
    FASTEST,
    LOST,
    NOTICED,
    SAME,
    SLIGHT,
    SLOWEST,
    amplitude,
    harmonic,
    largest_multiplier,
    marks,
    motions,
    natural_speed,
    near_fraction,
    orbit,
    rig,
    rise,
    rise_at,
    rpm,
    runs_verdict,
    turn,
)

# --- 8.19 to 8.21: resonance curves

#: Natural frequencies (rpm) that the thesis sees, calculates, and right ones, by spring; and the speeds of the linear equation.
NATURAL = {"C": (585.0, 582.0, 585.5), "D": (825.0, 829.0, 828.0)}
CURVE = np.arange(SLOWEST, FASTEST["C"] + 1.0, 10.0)
#: Speed (rpm) beyond resonance at which the amplitude is compared, and a damper over the rig's.
BEYOND, STRONGER = 1000.0, 1.25


@cache
def linear_motion(spring: str, speed: float) -> HarmonicMotion:
    """Return u/l4 at a speed (rpm) by two harmonics of the corrected linear equation of chapter IV."""
    return two_harmonics(slider_equation(rig(spring), speed * RAD_S_PER_RPM, variant=Variant.SECOND_ORDER))


def length(spring: str) -> float:
    """Return the rocker's length (cm), the reference of amplitudes."""
    return CM_PER_METRE * rig(spring).rocker_length


def compute_resonance(number: str, spring: str) -> StudyResult:
    """Compute the amplitude over the speed by the full equations and by two harmonics of the linear one."""
    (branch,), l4 = motions(spring).branches, length(spring)
    place, peak = near_fraction(spring, 1)
    speeds = np.unique(np.append(CURVE, place)).tolist()
    columns = {
        "speed; full equations [rpm]": rpm(branch),
        "amplitude over l4; full equations [1]": CM_PER_METRE * branch.amplitude / l4,
        "speed; linear equation [rpm]": speeds,
        "amplitude over l4; linear equation [1]": [linear_motion(spring, speed).amplitude for speed in speeds],
    }
    checked = tuple(round(speed) for speed in (near_fraction(spring, 2)[0], place, FASTEST[spring]))
    apart = CM_PER_METRE * max(
        abs(orbit(rig(spring), w).amplitude - nonlinear_harmonic_balance(rig(spring), w * RAD_S_PER_RPM).amplitude)
        for w in checked
    )
    error, largest = (
        abs(l4 * linear_motion(spring, place).amplitude / peak - 1.0),
        largest_multiplier(spring, 0.0, np.inf),
    )
    return StudyResult(
        number=number,
        claim=f"Theory and experiment agree up to resonance, {NATURAL[spring][0]:g} rpm; beyond it theory is smaller.",
        columns=padded(columns),
        verdicts=(
            *_natural_frequencies(spring, place),
            *_beyond(spring),
            at_most("error of the linear equation at resonance, relative", text("8.4.2.2, L6976"), 0.01, error),
            at_most("difference between orbits and nonlinear harmonic balance", OURS, SAME, apart, "cm"),
            runs_verdict(spring, checked),
            at_most("largest Floquet multiplier over all speeds", OURS, 1.0, largest),
        ),
    )


def _natural_frequencies(spring: str, place: float) -> list[Verdict]:
    """Judge the natural frequencies that the thesis measures and calculates."""
    (seen, calculated, right), natural = NATURAL[spring], natural_speed(spring)
    why, section = "582 and 829 rpm are not as 1 to the root of 2", "8.4.2.2, L6867"
    verdicts = [
        near("speed of the greatest amplitude", text("8.4.2.2, L6861"), seen, place, 5.0, "rpm"),
        near("calculated natural frequency", text(section), calculated, natural, 0.5, "rpm", why=why),
        near("natural frequency from the mean effective mass", OURS, right, natural, 0.05, "rpm"),
    ]
    if spring == "C":
        return verdicts
    ratio, rounding = natural / natural_speed("C"), 0.5 / 582.0 + 0.5 / 829.0
    return [
        *verdicts,
        near("natural frequency over spring C's", text(section), 829.0 / 582.0, ratio, rounding, why="the root of 2"),
        near("natural frequency over spring C's, the root of 2", OURS, sqrt(2.0), ratio, 1e-9),
    ]


def _beyond(spring: str) -> list[Verdict]:
    """Judge whether the causes named in the thesis broaden the resonance and raise the amplitude beyond it."""
    base, damping = amplitude(turn(spring, BEYOND)), STRONGER * rig(spring).slider_damping
    rough, damped = (
        turn(spring, BEYOND, slider_friction_coefficient=SLIGHT),
        turn(spring, BEYOND, slider_damping=damping),
    )
    ratios = {
        "with the orders that it leaves out": base / length(spring) / linear_motion(spring, BEYOND).amplitude,
        f"with friction by {SLIGHT:g} of the guide's force": amplitude(rough) / base,
        f"with a damper {STRONGER:g} times as strong, for a wider resonance": amplitude(damped) / base,
    }
    words, section, why = f"amplitude at {BEYOND:g} rpm over that of the theory", "8.4.2.2, L6847", "it is lowered"
    return [
        unjudged("theory and experiment agree up to resonance", text("8.4.2.2, L6839"), LOST),
        unjudged("theory has a narrower resonance, smaller amplitudes beyond", text("8.4.2.2, L6841"), LOST),
        *(at_least(f"{words}, {name}", text(section), 1.0, r, why=why) for name, r in ratios.items()),
    ]


def draw_resonance(spring: str, result: StudyResult) -> Figure:
    """Draw the amplitude relative to l4 over the speed."""
    panel = Panel(
        x_label="crank speed [rpm]",
        y_label="amplitude of u / l4",
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
        verticals=marks(spring, 1, 2),
        legend_at="upper left",
        x_range=(SLOWEST, FASTEST[spring]),
        y_range=(1e-4, 1.0),
        logarithmic="y",
    )
    return plot_curves([panel], title=result.heading)


ORDERS = (1, 2, 3)


def compute_harmonics() -> StudyResult:
    """Compute three harmonics relative to l4 over the speed, and the second by the linear equation too."""
    columns: dict[str, NDArray[np.float64]] = {}
    verdicts: list[Verdict] = []
    points = CURVE[::3]
    for spring in "CD":
        (branch,), l4, name = motions(spring).branches, length(spring), f"spring {spring}"
        table = branch.columns()
        sizes = {n: CM_PER_METRE * table[f"harmonic {n} of u [m]"] / l4 for n in ORDERS}
        linear = np.array([linear_motion(spring, speed).harmonic(2) for speed in points.tolist()])
        full = np.array([harmonic(turn(spring, speed), 2) / l4 for speed in points.tolist()])
        columns[f"speed; {name} [rpm]"] = rpm(branch)
        columns |= {f"harmonic {n} over l4; {name} [1]": size for n, size in sizes.items()}
        columns[f"speed; linear equation; {name} [rpm]"] = points
        columns[f"harmonic 2 over l4; linear equation; {name} [1]"] = linear
        ratio, at, error = sizes[1].max() / sizes[2].max(), int(np.argmax(sizes[1])), np.abs(linear / full - 1.0).max()
        words, why = (
            "greatest harmonic 1 over greatest harmonic 2",
            f"{sizes[1][at] / sizes[2][at]:.0f} at resonance itself",
        )
        verdicts.append(near(f"{words}; {name}", text("8.4.2.2, L6881"), 50.0, ratio, 5.0, why=why))
        for n, part in ((2, "half"), (3, "a third"), (4, "a quarter")):
            above, words = rise_at(spring, n), f"rise of the amplitude at {part} of the natural frequency, relative"
            why = f"harmonic {n} makes {10.0 * near_fraction(spring, n)[1]:.2f} mm there" if above > NOTICED else ""
            verdicts.append(at_most(f"{words}; {name}", text("8.4.2.2, L6871"), NOTICED, above, why=why))
        words, left = f"the same at half with friction by {SLIGHT:g} of the guide's force", rise(spring, SLIGHT, 2)
        why = "more than linear bearings have does not hide it"
        verdicts.append(at_most(f"{words}; {name}", text("8.4.2.2, L6857, L6871"), NOTICED, left, why=why))
        verdicts.append(at_most(f"error of harmonic 2 by the linear equation, relative; {name}", OURS, 0.1, error))
    return StudyResult(
        number="8.21",
        claim="The second harmonic is smaller than the first by a factor of 50.",
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def draw_harmonics(result: StudyResult) -> Figure:
    """Draw the harmonics, one panel a spring, the second in front."""
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
            for n, colour in zip(ORDERS, COLOURS)
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
                y_label="amplitude of the harmonic / l4",
                title=f"rig 2, {name}",
                curves=[*curves, points],
                verticals=marks(spring, 1, 2, 3),
                legend_at="outside",
                logarithmic="y",
                x_range=(SLOWEST, FASTEST[spring]),
                y_range=(1e-6, 1.0),
            )
        )
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 4.0))


# --- rig-2-forces: what the crank's drive and the pins of rig 2 carry

PINS = "ACD"
TORQUES = ("greatest crank torque", "mean crank torque")


def compute_forces() -> StudyResult:
    """Compute crank torque and pin forces along the motions, and their departure from the law of low speeds."""
    columns: dict[str, NDArray[np.float64]] = {}
    verdicts: list[Verdict] = []
    for spring in "CD":
        name, branch = f"spring {spring}", motions(spring).branches[0]
        table, speeds = branch.columns(), rpm(branch)
        columns[f"speed; {name} [rpm]"] = speeds
        for torque in TORQUES:
            columns[f"{torque}; {name} [N.m]"] = table[f"{torque} [N.m]"]
        added = {pin: amplification(branch, table[f"greatest force in pin {pin} [N]"]) for pin in PINS}
        for pin in PINS:
            columns[f"greatest force in pin {pin}; {name} [N]"] = table[f"greatest force in pin {pin} [N]"]
        near_resonance = np.abs(speeds / natural_speed(spring) - 1.0) < 0.1
        at_d = added["D"][near_resonance].max()
        others = max(added[pin][near_resonance].max() for pin in "AC")
        verdicts += [
            at_least(f"pin D at resonance over the law of low speeds; {name}", OURS, 1.0, at_d),
            at_most(f"the same of pins A and C; {name}", OURS, at_d, others),
            at_most(f"pin D at {speeds[-1]:.0f} rpm over the law of low speeds; {name}", OURS, 1.0, added["D"][-1]),
            at_most(
                f"mean crank power less what the damper takes, relative; {name}", OURS, 1e-8, power_balance(branch)
            ),
        ]
    return StudyResult(
        number="rig-2-forces",
        claim="Every force of this horizontal machine grows with the square of the speed; resonance adds most to pin D.",
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def amplification(branch: Branch, force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a force along a branch relative to one that grows with the square of the speed from the branch's low end."""
    return np.asarray(force / (force[0] * (branch.parameter / branch.parameter[0]) ** 2))


def power_balance(branch: Branch) -> float:
    """Return the greatest difference of mean crank and damper power along a branch, relative to that of the greatest torque."""
    damping = branch.family.parameters.slider_damping
    worst = 0.0
    for speed, of in zip(branch.parameter, (motion.turn() for motion in branch.orbits)):
        torque = of["drive.applied_torque"]
        taken = damping * float(np.mean(of["slider.velocity"] ** 2))
        worst = max(worst, abs(float(torque.mean()) - taken / speed) / float(np.abs(torque).max()))
    return worst


def draw_forces(result: StudyResult) -> Figure:
    """Draw the torque above and the pin forces below, one column a spring, with the law of low speeds dotted."""
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
    return Panel(
        x_label="crank speed [rpm]",
        y_label=y_label,
        title=f"spring {spring}",
        curves=lines,
        verticals=marks(spring, 1),
        legend=legend,
        legend_at="upper left",
        x_range=(SLOWEST, FASTEST[spring]),
        y_range=(0.0, top),
    )


STUDIES = (
    *(
        Study(n, partial(compute_resonance, n, s), partial(draw_resonance, s))
        for n, s in (("8.19", "C"), ("8.20", "D"))
    ),
    Study("8.21", compute_harmonics, draw_harmonics),
    Study("rig-2-forces", compute_forces, draw_forces),
)
