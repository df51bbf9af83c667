"""Linear models of the plant, and control of the slider designed on them."""

from __future__ import annotations

from .design import DesignError, SliderDesign, check_period, design_lqr, design_pi, design_pid
from .equilibrium import Equilibrium, EquilibriumError, find_equilibria, find_equilibrium
from .loop import Controller, LoopMetrics, LoopResult, SampledController, control_loop, largest_difference, predict_loop
from .model import (
    AT_REST,
    COORDINATES,
    LINEAR_OUTPUTS,
    RATES,
    SPEED_INPUTS,
    TORQUE_INPUTS,
    UNITS,
    WITHOUT,
    LinearModel,
    LinearModelError,
    linearise,
    signal_name,
)
from .periodic import LEAST_SAMPLES, Orbit, PeriodicModel, linearise_along, settled_motion

__all__ = [
    "AT_REST",
    "COORDINATES",
    "LEAST_SAMPLES",
    "LINEAR_OUTPUTS",
    "RATES",
    "SPEED_INPUTS",
    "TORQUE_INPUTS",
    "UNITS",
    "WITHOUT",
    "Controller",
    "DesignError",
    "Equilibrium",
    "EquilibriumError",
    "LinearModel",
    "LinearModelError",
    "LoopMetrics",
    "LoopResult",
    "Orbit",
    "PeriodicModel",
    "SampledController",
    "SliderDesign",
    "check_period",
    "control_loop",
    "design_lqr",
    "design_pi",
    "design_pid",
    "find_equilibria",
    "find_equilibrium",
    "largest_difference",
    "linearise",
    "linearise_along",
    "predict_loop",
    "settled_motion",
    "signal_name",
]
