"""Fig 4.7: how far the linear equations are from the motion of the plant; I4 = 1.

The error is the greatest difference of u over the turn, relative to the amplitude. Two harmonics with the right coefficients
keep within half a per cent from below half the natural frequency on, but for the resonance, where amplitudes are large;
at a third of it the third harmonic is missing, a tenth. Second-order coefficients are out by half a per cent, the
printed ones by one to two, first-order ones by two thirds where the second harmonic resonates. What the linear equation
itself leaves out, seen with twelve harmonics, falls with the square of l2/l4. The captions are lost: that the comparison
stands under this number is our assignment.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.published import SIGMA2, chapter_4

from ...figures import Figure, Panel, plot_curves
from ...numerics.fourier import FourierSeries
from ...youssef import Variant, harmonic_balance, nonlinear_harmonic_balance, slider_equation
from ..study import ASSIGNED, OURS, Study, StudyResult, at_most, curves_of, near, padded
from ._chapter_4 import DAMPING, linear, name, true_motion

NUMBER = "4.7"
INERTIA_RATIO = 1.0
SPEEDS = np.concatenate([np.arange(8.0, 29.0, 0.2), np.arange(29.0, 33.0, 0.05), np.arange(33.0, 45.1, 0.2)])
VARIANTS = (Variant.FIRST_ORDER, Variant.FORTRAN, Variant.PRINTED, Variant.SECOND_ORDER, Variant.EXACT)
#: Harmonics of the linear equation that leave nothing but its own error.
MANY = 12
#: Ratios l2/l4, and the speed at which they are compared.
SIGMAS = SIGMA2 / 2.0 ** np.arange(4)
COMPARED_AT = 25.0
ANGLES = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)


def error(zeta: FourierSeries, speed: float) -> float:
    """Greatest difference from the plant's motion, relative to the amplitude of that."""
    true = true_motion(speed, INERTIA_RATIO, DAMPING)
    length = chapter_4(INERTIA_RATIO).rocker_length
    return float(np.abs(length * zeta(ANGLES) - true.position(ANGLES)).max()) / true.amplitude


def errors(variant: Variant) -> NDArray[np.float64]:
    """Those of two harmonics over the speed."""
    return np.array([error(linear(s, INERTIA_RATIO, DAMPING, variant).series, s) for s in SPEEDS.tolist()])


def compute() -> StudyResult:
    """Errors over the speed by variant, and over l2/l4."""
    columns = {"speed [rad/s]": SPEEDS}
    for variant in VARIANTS:
        columns[f"error of two harmonics; {name(variant)} [1]"] = errors(variant)
    parameters = chapter_4(INERTIA_RATIO, DAMPING)
    columns["error of twelve harmonics; all harmonics [1]"] = np.array(
        [error(harmonic_balance(slider_equation(parameters, s), MANY).series, s) for s in SPEEDS.tolist()]
    )
    left = []
    for sigma in SIGMAS:
        p = replace(parameters, crank_length=sigma * parameters.rocker_length)
        zeta = harmonic_balance(slider_equation(p, COMPARED_AT), MANY).series
        true = nonlinear_harmonic_balance(p, COMPARED_AT)
        left.append(np.abs(zeta(ANGLES) - true.position(ANGLES) / p.rocker_length).max())
    columns["l2/l4 [1]"] = SIGMAS
    columns[f"error of zeta; linear equation at {COMPARED_AT:g} rad/s [1]"] = np.array(left)
    exact, printed = (columns[f"error of two harmonics; {name(v)} [1]"] for v in (Variant.EXACT, Variant.PRINTED))
    away = (SPEEDS > 14.5) & (np.abs(SPEEDS - 30.6) > 3.0)
    return StudyResult(
        number=NUMBER,
        claim="Two harmonics of the linear equation describe the motion.",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=(
            at_most("error of two harmonics away from the resonances", OURS, 0.005, exact[away].max()),
            at_most(
                "error of twelve harmonics to that of two, median",
                OURS,
                1.0,
                np.median(columns["error of twelve harmonics; all harmonics [1]"] / exact),
            ),
            near(
                "exponent of l2/l4 in the error of the linear equation",
                OURS,
                2.0,
                np.log2(left[-2] / left[-1]),
                0.2,
            ),
            at_most(
                "error of the right equation to that of the printed one at 31 rad/s",
                OURS,
                1.0,
                np.interp(31.0, SPEEDS, exact) / np.interp(31.0, SPEEDS, printed),
            ),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Errors over the speed above, over l2/l4 below."""
    names = {c: f"two: {c.split('; ')[1].split(' [')[0]}" for c in result.columns if c.startswith("error of two")}
    names["error of twelve harmonics; all harmonics [1]"] = "twelve: all harmonics"
    panels = [
        Panel(
            x_label="crank speed [rad/s]",
            y_label="error relative to the amplitude",
            curves=curves_of(result, "speed [rad/s]", names),
            logarithmic="y",
            legend_at="outside",
            x_range=(8.0, 45.0),
        ),
        Panel(
            x_label="l2/l4",
            y_label="error of zeta, linear equation",
            curves=curves_of(result, "l2/l4 [1]", {f"error of zeta; linear equation at {COMPARED_AT:g} rad/s [1]": ""}),
            logarithmic="xy",
            x_range=(5e-3, 6e-2),
            x_ticks=SIGMAS.tolist(),
        ),
    ]
    return plot_curves(panels, title=result.heading)


STUDY = Study(NUMBER, compute, draw)
