"""Instruments of chapter VIII: the crank speed by a photocell's pulses, and damping by the impulse response of the slider."""

from __future__ import annotations

from math import atan2, pi, sqrt

import numpy as np
from scipy.interpolate import CubicSpline

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...units import CM_PER_METRE, RAD_S_PER_RPM
from ..rules import READ
from ..statements import FloatArray, at_most, near, statement
from ..study import Study, StudyResult, pad_columns, result_curves
from .rigs import LOST, rig, turn

# --- 8.4: crank speed from the widths of the photocell's pulses

#: Number of holes in the disc, and moments of inertia (kg.m2) that we assume for the crank with its flywheels: none is printed.
HOLES, INERTIAS = 60, (5e-3, 2e-2)
#: Mean crank speed in the test of the photocell (rpm).
PULSED = 420.0


def crank_speed(inertia: float) -> FloatArray:
    """Return the crank speed (rad/s) over a turn under a constant drive torque, for a crank inertia (kg.m2).

    The torque that the links need is taken from the steady motion at `PULSED` rpm.
    """
    torque = turn("A", PULSED)["drive.applied_torque"]
    angle = np.linspace(0.0, 2.0 * pi, len(torque) + 1)
    energy = CubicSpline(angle, torque.mean() - np.append(torque, torque[0])).antiderivative()(angle)
    return np.asarray(np.sqrt((PULSED * RAD_S_PER_RPM) ** 2 + 2.0 * (energy - energy.mean()) / inertia))


def pulse_speeds(speed: FloatArray) -> FloatArray:
    """Return the mean speeds between successive holes (rad/s), from the times at which the holes pass the photocell."""
    time = CubicSpline(np.linspace(0.0, 2.0 * pi, len(speed)), 1.0 / speed).antiderivative()
    return np.asarray(2.0 * pi / HOLES / np.diff(time(np.linspace(0.0, 2.0 * pi, HOLES + 1))))


def pulse_error(speed: FloatArray) -> float:
    """Return the greatest relative error of the speeds by the pulses, compared with the speed midway between the holes."""
    between = np.interp(np.arange(HOLES) + 0.5, np.linspace(0.0, HOLES, len(speed)), speed)
    return float(np.abs(pulse_speeds(speed) / between - 1.0).max())


def compute_pulses() -> StudyResult:
    """Compute the crank speed over a turn, and the speed that the widths of the pulses give."""
    speeds = {inertia: crank_speed(inertia) for inertia in INERTIAS}
    pulses = {inertia: pulse_speeds(speed) for inertia, speed in speeds.items()}
    crank_angle = np.linspace(0.0, 360.0, len(speeds[INERTIAS[0]]))
    columns = {"crank angle [deg]": crank_angle, "place of a pulse [deg]": (np.arange(HOLES) + 0.5) * 360.0 / HOLES}
    for inertia in INERTIAS:
        columns[f"crank speed; {inertia:g} kg.m2 [rpm]"] = speeds[inertia] / RAD_S_PER_RPM
        columns[f"crank speed by the pulses; {inertia:g} kg.m2 [rpm]"] = pulses[inertia] / RAD_S_PER_RPM
    varies = {inertia: float(np.ptp(speed) / speed.mean()) for inertia, speed in speeds.items()}
    return StudyResult(
        claim="The widths of the pulses of a photocell behind sixty holes show whether the speed varies within a turn.",
        assignment="No moment of inertia of crank and flywheels is printed. We try two, driven by a constant torque, with "
        f"spring A about {PULSED:g} rpm; the torque of the links is that at this speed.",
        columns=pad_columns(columns),
        statements=(
            statement(
                "Since each pulse corresponds to a hole a comparison of the width of each shows whether the speed varies "
                "within the crank cycle. The crank speed may also be obtained from the width of the pulses and the speed of "
                "paper in the U. V. recorder or the time base of the scope.",
                "8.2.1.2, L6255",
                "range of the crank speed over a turn, computed from the times from hole to hole (our reading of *width*), "
                "relative to the true range. Then the greatest difference of this speed from the true one at the middle "
                "between two holes, relative to the true one",
                f"{READ:g}, the rule for what is read from a graph",
                *(
                    near(
                        f"{i:g} kg.m2, speed varies by {varies[i]:.1%}",
                        1.0,
                        np.ptp(pulses[i]) / np.ptp(speeds[i]),
                        READ,
                    )
                    for i in INERTIAS
                ),
                *(at_most(f"{i:g} kg.m2, speed", READ, pulse_error(speeds[i])) for i in INERTIAS),
            ),
            statement(
                "A further [flywheel] (4) is mounted on the shaft to ensure constant speed input.",
                "8.2.1.1, L6140-6142",
                why="no moment of inertia of crank and flywheels is printed",
            ),
        ),
    )


def draw_pulses(result: StudyResult) -> Figure:
    """Draw the speed over the crank angle, with the speeds from the pulses as marks."""
    curves = []
    for inertia, colour in zip(INERTIAS, COLOURS):
        names = {"crank angle [deg]": "crank speed", "place of a pulse [deg]": "crank speed by the pulses"}
        for (place, name), look in zip(names.items(), ({}, {"line": "", "marker": "."})):
            label = f"{inertia:g} kg.m2{', pulses' if look else ''}"
            y = result.columns[f"{name}; {inertia:g} kg.m2 [rpm]"]
            curves.append(Curve(x=result.columns[place], y=y, label=label, colour=colour, **look))  # type: ignore[arg-type]
    panel = Panel(
        x_label="crank angle [deg]",
        y_label="crank speed [rpm]",
        curves=curves,
        legend_at="outside",
        x_ticks=range(0, 361, 45),
    )
    return plot_curves([panel], title=result.heading)


# --- 8.6: the damping coefficient from the slider's impulse response

#: Spring with which each rig is shown.
DECAYING = {1: "A", 2: "C"}
#: Velocity after the impulse (m/s), length of the record (s), and dry friction (N): our choices.
KICK, LENGTH, DRY = 1.0, 1.0, 0.5


def impulse_response(spring: str, time: FloatArray, friction: float = 0.0) -> FloatArray:
    """Return the position (m) over time (s) of the disconnected slider after an impulse.

    Dry friction (N) shifts the centre of each half swing.
    """
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
    """Compute records of the impulse response like those of the thesis, without and with dry friction."""
    time = np.linspace(0.0, LENGTH, 4001)
    columns = {"time [s]": time}
    for number, spring in DECAYING.items():
        for name, friction in (("", 0.0), (f" with {DRY:g} N of dry friction", DRY)):
            u = CM_PER_METRE * impulse_response(spring, time, friction)
            columns[f"slider position u{name}; rig {number}; spring {spring} [cm]"] = u
    return StudyResult(
        claim="The disconnected slider is struck, and its oscillation decays; the logarithmic decrement gives the damping "
        "coefficient.",
        assignment="The text does not say which response is shown. We compute those of both rigs, with springs A and C; the "
        f"blow gives the slider {KICK:g} m/s, and the dry friction is {DRY:g} N, our choices.",
        columns=columns,
        statements=(
            statement(
                "Average values of the coefficient were found to be [9 x 10^3 dyne.Sec/cm.] for Experimental Rig 1 and [5.5 "
                "x 10^3 dyne.Sec/cm.] for Experimental Rig 2 (linearised rig).",
                "8.3.3, L6401",
                why=LOST,
            ),
            statement(
                "Theoretical calculations of the stiffness, based on the number of coils, the wire and mean coil diameters "
                "and the modulus of rigidity of the material gave good agreement with the experimentally determined values.",
                "8.3.2, L6383",
                why="no number of coils, diameter or modulus is printed",
            ),
        ),
    )


def draw_decay(result: StudyResult) -> Figure:
    """Draw the records of the impulse response, one panel for each rig."""
    panels = []
    for number, spring in DECAYING.items():
        names = [name for name in result.columns if f"spring {spring}" in name]
        curves = result_curves(
            result, "time [s]", {n: f"{DRY:g} N of dry friction" if "dry" in n else "damper alone" for n in names}
        )
        title = f"rig {number}, spring {spring}"
        panels.append(
            Panel(x_label="time [s]", y_label="slider position u [cm]", title=title, curves=curves, x_range=(0.0, 0.6))
        )
    return plot_curves(panels, title=result.heading, columns=2, size=(4.8, 3.4))


#: The studies by number.
STUDIES = {"8.4": Study(compute_pulses, draw_pulses), "8.6": Study(compute_decay, draw_decay)}
