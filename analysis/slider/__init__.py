"""Planning the motion of the five-bar's slider, so that the linkage does its task; and the drive that the motion needs.

The best position at every crank angle (`variational_motion`), the best Fourier series (`slider_motion`), the simplest mechanism
that is good enough (`simplest_mechanism`); then the force that produces a motion (`inverse_dynamics`, `best_spring`), and a run
under control on the full plant (`track`).
"""

from __future__ import annotations

from .cases import TABLES, SliderCase, linkage_from_csv, load_slider_case, run_case, slider_case_from
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
    "run_case",
    "simplest_mechanism",
    "slider_case_from",
    "slider_motion",
    "track",
    "variational_motion",
]
