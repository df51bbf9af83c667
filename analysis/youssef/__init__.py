"""Youssef's theory of the five-bar slider: linear equation, harmonic balance, Hill, workspace."""

from __future__ import annotations

from .classical import Approximations, approximations
from .equation import NO_LOAD, Balance, Load, SliderEquation, Variant, balance, slider_equation
from .harmonics import (
    HarmonicBalanceError,
    HarmonicMotion,
    SliderMotion,
    harmonic_balance,
    nonlinear_harmonic_balance,
    resonance,
    two_harmonics,
)
from .hill import (
    PeriodicEquation,
    Region,
    SingularEquationError,
    Truncation,
    boundary_stiffnesses,
    determinant,
    hill_determinant,
    hill_multipliers,
    hill_regions,
    monodromies,
    monodromy,
    perturbed_operator,
    perturbed_region,
    perturbed_removing_damping,
)
from .stability import linear_equation, linear_monodromy, linear_motion, linear_test, linear_verdict
from .workspace import AccessibleArea, Arc, CouplerCurve, accessible, accessible_area, coupler_curve, coupler_curves

__all__ = [
    "NO_LOAD",
    "AccessibleArea",
    "Approximations",
    "Arc",
    "Balance",
    "CouplerCurve",
    "HarmonicBalanceError",
    "HarmonicMotion",
    "Load",
    "PeriodicEquation",
    "Region",
    "SingularEquationError",
    "SliderEquation",
    "SliderMotion",
    "Truncation",
    "Variant",
    "accessible",
    "accessible_area",
    "approximations",
    "balance",
    "boundary_stiffnesses",
    "coupler_curve",
    "coupler_curves",
    "determinant",
    "harmonic_balance",
    "hill_determinant",
    "hill_multipliers",
    "hill_regions",
    "linear_equation",
    "linear_monodromy",
    "linear_motion",
    "linear_test",
    "linear_verdict",
    "monodromies",
    "monodromy",
    "nonlinear_harmonic_balance",
    "perturbed_operator",
    "perturbed_region",
    "perturbed_removing_damping",
    "resonance",
    "slider_equation",
    "two_harmonics",
]
