"""Motion of the slider: what it must do, and what that takes.

The best position at every crank angle (`variational_motion`), the best Fourier series (`slider_motion`,
`smoothness_curve`), the simplest mechanism that is good enough (`simplest_mechanism`); then the force that produces a motion
(`inverse_dynamics`, `best_spring`), its control on the full plant (`track`), and the motion of least effort within an error
bound (`least_effort`).
"""

from __future__ import annotations

from .cases import TABLES, SliderCase, linkage_from_csv, load_slider_case, run_case, slider_case_from
from .collocation import Collocation, EffortError, MotionLimits, UnattainableError
from .inverse import BestSpring, Load, SliderDrive, TurnBalance, best_spring, inverse_dynamics
from .least_effort import LeastEffort, least_effort
from .motion import SmoothnessCurve, SmoothnessInterrupted, greatest, motion_of_plant, slider_motion, smoothness_curve
from .strategy import Step, Strategy, StrategyInterrupted, simplest_mechanism
from .tracking import TrackingController, TrackingMetrics, TrackingResult, track
from .variational import VariationalMotion, variational_motion

__all__ = [
    "TABLES",
    "BestSpring",
    "Collocation",
    "EffortError",
    "LeastEffort",
    "Load",
    "MotionLimits",
    "SliderCase",
    "SliderDrive",
    "SmoothnessCurve",
    "SmoothnessInterrupted",
    "Step",
    "Strategy",
    "StrategyInterrupted",
    "TrackingController",
    "TrackingMetrics",
    "TrackingResult",
    "TurnBalance",
    "UnattainableError",
    "VariationalMotion",
    "best_spring",
    "greatest",
    "inverse_dynamics",
    "least_effort",
    "linkage_from_csv",
    "load_slider_case",
    "motion_of_plant",
    "run_case",
    "simplest_mechanism",
    "slider_case_from",
    "slider_motion",
    "smoothness_curve",
    "track",
    "variational_motion",
]
