"""Dimensional synthesis: from what is to be traced to ranked linkages that really do it.

>>> import numpy as np
>>> from analysis.synthesis import LargestLink, LeastTransmission, TimedPath, synthesize, turn
>>> phi = turn(72)
>>> ellipse = np.column_stack([0.20 + 0.10 * np.cos(phi), 0.15 + 0.05 * np.sin(phi)])
>>> result = synthesize(TimedPath(points=ellipse), constraints=[LargestLink(length=1.1285), LeastTransmission()])
>>> round(1e4 * result.best.error, 2)
0.44
"""

from __future__ import annotations

from .constraints import (
    USUAL,
    Assembly,
    FullTurn,
    Grashof,
    InfeasibleError,
    LargestLink,
    LeastTransmission,
    PivotRegion,
    Require,
)
from .linkage import Linkage, SecondCrank, SliderMotion
from .program import CrankUnknown, SliderUnknown
from .sensitivity import Rounding, Sensitivity
from .solution import Evaluation, Solution, Verdicts, evaluate, judge
from .solve import Synthesis, SynthesisInterrupted, TradeOff, TradeOffInterrupted, synthesize, trade_off
from .targets import TargetPath, function_from_formula, path_from_formula
from .tasks import Motion, PrecisionPoints, RockerFunction, Straight, TimedPath, UntimedPath, turn

__all__ = [
    "USUAL",
    "Assembly",
    "CrankUnknown",
    "Evaluation",
    "FullTurn",
    "Grashof",
    "InfeasibleError",
    "LargestLink",
    "LeastTransmission",
    "Linkage",
    "Motion",
    "PivotRegion",
    "PrecisionPoints",
    "Require",
    "RockerFunction",
    "Rounding",
    "SecondCrank",
    "Sensitivity",
    "SliderMotion",
    "SliderUnknown",
    "Solution",
    "Straight",
    "Synthesis",
    "SynthesisInterrupted",
    "TargetPath",
    "TimedPath",
    "TradeOff",
    "TradeOffInterrupted",
    "UntimedPath",
    "Verdicts",
    "evaluate",
    "function_from_formula",
    "judge",
    "path_from_formula",
    "synthesize",
    "trade_off",
    "turn",
]
