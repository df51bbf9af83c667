"""Plan the motion of the five-bar's slider for a task of the linkage, and compute the drive that the motion needs.

`variational_motion` finds the best position at every crank angle, `slider_motion` the best Fourier series, and
`simplest_mechanism` the simplest mechanism that is good enough. `inverse_dynamics` and `best_spring` compute the force of a
motion; `track` runs the full plant under control.
"""

from __future__ import annotations

from .cases import TABLES, SliderCase, linkage_from_csv, load_slider_case, read_slider_case, run_case
from .inverse import BestSpring, Load, SliderDrive, TurnBalance, best_spring, inverse_dynamics
from .motion import greatest_derivative, motion_of_plant, slider_motion
from .strategy import Step, Strategy, StrategyInterrupted, simplest_mechanism
from .tracking import TrackingController, TrackingMetrics, TrackingResult, track
from .variational import VariationalMotion, variational_motion

__all__ = [
    "TABLES",
    "BestSpring",
    "Load",
    "SliderCase",
    "SliderDrive",
    "Step",
    "Strategy",
    "StrategyInterrupted",
    "TrackingController",
    "TrackingMetrics",
    "TrackingResult",
    "TurnBalance",
    "VariationalMotion",
    "best_spring",
    "greatest_derivative",
    "inverse_dynamics",
    "linkage_from_csv",
    "load_slider_case",
    "motion_of_plant",
    "read_slider_case",
    "run_case",
    "simplest_mechanism",
    "slider_motion",
    "track",
    "variational_motion",
]
