"""The analysis API of Linkwork: simulate, check against the FMU, and study linkages with two degrees of freedom.

>>> from linkwork.five_bar.published import SETS
>>> from analysis import Inputs, simulate
>>> table = SETS["table-3.1"]
>>> run = simulate(table.parameters, Inputs(speed=table.crank_speed), stop_time=0.4, step=1e-3)
>>> run["slider.position"].shape
(401,)
"""

from __future__ import annotations

from .run.cosimulate import Comparison, CosimulationError, FmuRun, OutputDifference, compare, cosimulate
from .run.inputs import (
    Function,
    Harmonics,
    InductionMotor,
    Inputs,
    Piecewise,
    SliderCrankInputs,
    TorsionBar,
    ramp,
    steps,
    table,
)
from .run.simulate import Ensemble, Event, RunInterrupted, sample_times, simulate, simulate_many
from .run.trajectory import Occurrence, Trajectory

__all__ = [
    "Comparison",
    "CosimulationError",
    "Ensemble",
    "Event",
    "FmuRun",
    "Function",
    "Harmonics",
    "InductionMotor",
    "Inputs",
    "Occurrence",
    "OutputDifference",
    "Piecewise",
    "RunInterrupted",
    "SliderCrankInputs",
    "TorsionBar",
    "Trajectory",
    "compare",
    "cosimulate",
    "ramp",
    "sample_times",
    "simulate",
    "simulate_many",
    "steps",
    "table",
]
