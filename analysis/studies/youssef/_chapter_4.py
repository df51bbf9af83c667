"""What Fig 4.3 to 4.7 share: the mechanism of chapter IV, its linear equations and its true motion over the speed.

Amplitudes are those of zeta = u/l4, relative to the rocker's length, and speeds in rad/s: the spring with m4 + m5 alone
has omega_k = 31.623 rad/s.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.published import SQUARE_OF_OMEGA_K, chapter_4

from ...youssef import (
    HarmonicMotion,
    SliderEquation,
    SliderMotion,
    Variant,
    nonlinear_harmonic_balance,
    slider_equation,
    two_harmonics,
)

#: Inertia ratios I4 of which the thesis's resonances are known.
INERTIA_RATIOS = (0.5, 1.0, 1.5)
#: Damping omega_c = mu/(m4 + m5) (1/s) at which the amplitude reaches a tenth of the rocker's length at the resonance.
DAMPING = 2.0


def linear(speed: float, inertia_ratio: float, omega_c: float, variant: Variant = Variant.EXACT) -> HarmonicMotion:
    """zeta by the thesis's two harmonics with a variant of its equation."""
    once = _equation(inertia_ratio, variant)
    return two_harmonics(replace(once, spring=SQUARE_OF_OMEGA_K / speed**2, damping=omega_c / speed))


@cache
def _equation(inertia_ratio: float, variant: Variant) -> SliderEquation:
    """The equation at 1 rad/s: without gravity only its spring and its damper depend on the speed."""
    return slider_equation(chapter_4(inertia_ratio), 1.0, variant=variant)


@cache
def true_motion(speed: float, inertia_ratio: float, omega_c: float) -> SliderMotion:
    """Periodic motion of the plant."""
    return nonlinear_harmonic_balance(chapter_4(inertia_ratio, omega_c), speed)


def harmonic(
    n: int, speeds: Iterable[float], inertia_ratio: float, omega_c: float, variant: Variant = Variant.EXACT
) -> NDArray[np.float64]:
    """Amplitude of the n-th harmonic of zeta over the speed by the thesis's two harmonics."""
    return np.array([linear(speed, inertia_ratio, omega_c, variant).harmonic(n) for speed in speeds])


def true_harmonic(n: int, speeds: Iterable[float], inertia_ratio: float, omega_c: float) -> NDArray[np.float64]:
    """Amplitude of the n-th harmonic of zeta over the speed, of the plant."""
    length = chapter_4(inertia_ratio).rocker_length
    return np.array([true_motion(speed, inertia_ratio, omega_c).harmonic(n) for speed in speeds]) / length


def name(variant: Variant) -> str:
    """A variant in a legend."""
    return {
        Variant.EXACT: "all harmonics",
        Variant.FIRST_ORDER: "first order",
        Variant.SECOND_ORDER: "second order",
        Variant.PRINTED: "printed (no M' zeta')",
        Variant.FORTRAN: "FORTRAN (as far as known)",
    }[variant]
