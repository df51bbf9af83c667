"""What Fig 8.18 to 8.21 share: the periodic motion of rig 2 over the crank speed.

Rig 2 has a short crank, a twentieth of the other links, and lies in a horizontal plane: the slider swings by a few millimetres
at most but near resonance, where the thesis's two harmonics should do well. The text tells the measured natural frequencies,
585 rpm with spring C and 825 with spring D, in steps of 5 rpm by the look of them, and little else.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM, SETS

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...periodic import Response, natural_frequency
from ...youssef import HarmonicMotion, Variant, nonlinear_harmonic_balance, slider_equation, two_harmonics
from ..study import ASSIGNED, OURS, TEXT, StudyResult, at_most, near, padded
from ._orbits import SAME, between, columns_of, curves_over_speed, multiplier_verdict, orbit, response, runs_verdict

#: Speeds of the curves (rpm).
SLOWEST, FASTEST = 100.0, 1300.0
#: Natural frequencies (rpm), measured by the thesis and by reference, by spring.
MEASURED = {"c": 585.0, "d": 825.0}
NATURAL = {"c": 585.5, "d": 828.0}
#: The measured ones are whole multiples of 5 rpm.
MEASURED_TO = 5.0


def rig_2(spring: str) -> FiveBarParameters:
    """Rig 2 with spring ``c`` or ``d``."""
    parameters: FiveBarParameters = SETS[f"rig-2-spring-{spring}"].parameters
    return parameters


def natural_speed(spring: str) -> float:
    """Crank speed at the slider's natural frequency with the mean effective mass (rpm)."""
    return natural_frequency(rig_2(spring)) / RAD_S_PER_RPM


def motions(spring: str) -> Response:
    """Periodic motions over all speeds."""
    return response(rig_2(spring), SLOWEST, FASTEST)


def resonance(spring: str) -> tuple[float, float]:
    """Speed (rpm) and amplitude (cm) of the greatest amplitude."""
    natural = natural_speed(spring)
    return between(motions(spring).maxima(), 0.9 * natural, 1.1 * natural)


def half_resonance(spring: str) -> tuple[float, float]:
    """The same of the local maximum about half the natural frequency."""
    half = 0.5 * natural_speed(spring)
    return between(motions(spring).maxima(), 0.9 * half, 1.1 * half)


def thesis_motion(spring: str, speed: float) -> HarmonicMotion:
    """u/l4 at a speed (rpm) by two harmonics of the linear equation to second order in the crank, put right."""
    return two_harmonics(slider_equation(rig_2(spring), speed * RAD_S_PER_RPM, variant=Variant.SECOND_ORDER))


def thesis_amplitude(spring: str, speed: float) -> float:
    """Amplitude by two harmonics (cm)."""
    return CM_PER_METRE * rig_2(spring).rocker_length * thesis_motion(spring, speed).amplitude


def _balance_error(spring: str, speeds: tuple[float, ...]) -> float:
    """Greatest difference of the amplitude between orbits and the nonlinear harmonic balance (cm)."""
    return CM_PER_METRE * max(
        abs(
            orbit(rig_2(spring), speed).amplitude
            - nonlinear_harmonic_balance(rig_2(spring), speed * RAD_S_PER_RPM).amplitude
        )
        for speed in speeds
    )


def amplitude_result(number: str, spring: str) -> StudyResult:
    """Amplitude over the speed as the result of a study."""
    found, natural = motions(spring), natural_speed(spring)
    (place, peak), (half_place, half_peak) = resonance(spring), half_resonance(spring)
    speeds = np.unique(np.append(np.arange(SLOWEST, FASTEST + 1.0, 10.0), (place, half_place)))
    columns = columns_of(found.branches[0], "orbits") | {
        "speed; two harmonics [rpm]": speeds,
        "amplitude; two harmonics [cm]": np.array([thesis_amplitude(spring, speed) for speed in speeds.tolist()]),
    }
    errors = [
        abs(thesis_amplitude(spring, at) / amplitude - 1.0)
        for at, amplitude in ((place, peak), (half_place, half_peak))
    ]
    ratio = natural / natural_speed("c" if spring == "d" else "d")
    checked = tuple(round(speed) for speed in (half_place, place, FASTEST))
    return StudyResult(
        number=number,
        claim=f"The measured natural frequency is {MEASURED[spring]:g} rpm.",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=(
            near("natural frequency, measured", TEXT, MEASURED[spring], natural, MEASURED_TO, "rpm"),
            near("speed of the greatest amplitude", TEXT, MEASURED[spring], place, MEASURED_TO, "rpm"),
            near("natural frequency from the mean effective mass", OURS, NATURAL[spring], natural, 0.05, "rpm"),
            near(
                "natural frequency relative to the other spring's",
                OURS,
                sqrt(2.0) if spring == "d" else sqrt(0.5),
                ratio,
                1e-9,
            ),
            near(
                "speed of the local maximum, over half the natural frequency",
                OURS,
                1.0,
                2.0 * half_place / natural,
                0.01,
            ),
            at_most("error of two harmonics at the resonance and at half of it, relative", OURS, 0.01, max(errors)),
            at_most(
                "difference between orbits and nonlinear harmonic balance",
                OURS,
                SAME,
                _balance_error(spring, checked),
                "cm",
            ),
            runs_verdict(rig_2(spring), checked),
            multiplier_verdict(found),
        ),
    )


def draw_amplitude(result: StudyResult, spring: str) -> Figure:
    """Amplitude over the speed by the orbits and by two harmonics."""
    natural = natural_speed(spring)
    two = Curve(
        x=result.columns["speed; two harmonics [rpm]"],
        y=result.columns["amplitude; two harmonics [cm]"],
        label="two harmonics of the linear equation",
        line=":",
        colour=COLOURS[1],
        width=2.2,
    )
    panel = Panel(
        x_label="crank speed [rpm]",
        y_label="amplitude of u [cm]",
        curves=[*curves_over_speed(result, "orbits", COLOURS[0], "periodic motion"), two],
        verticals={f"half, {natural / 2:.0f}": natural / 2, f"natural, {natural:.1f}": natural},
        legend_at="lower right",
        x_range=(SLOWEST, FASTEST),
        y_range=(2e-3, 30.0),
        logarithmic="y",
    )
    return plot_curves([panel], title=result.heading)
