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

from .areas import Straightness, area_between, distance_to, hausdorff, straightest_part, straightness
from .burmester import Dyad, Guidance, GuidanceMap, guidance
from .case_tasks import KINDS
from .cases import BOUNDS, TABLES, SynthesisCase, load_synthesis_case, synthesis_case_from
from .cognates import alternatives, cognates, has_cognates
from .constraints import (
    USUAL,
    Assembly,
    Constraint,
    FullTurn,
    Grashof,
    InfeasibleError,
    LargestLink,
    LeastTransmission,
    PivotRegion,
    Require,
    TimeRatio,
)
from .drawing import drawing, plates
from .forces import LeastPinForce, MaxPinForce, PinForces, pin_forces
from .formulas import chebyshev_spacing, function_from_formula, path_from_formula
from .functions import Generators, function_generators
from .kinds import GEARS, Kind, Stroke, kind_of
from .limit_positions import (
    DeadCentre,
    MechanicalAdvantage,
    NoToggle,
    Toggle,
    dead_centres,
    mechanical_advantage,
    time_ratio,
    toggles,
)
from .linkage import ANGLES, LENGTHS, LINKS, UNITS, Linkage, SecondCrank, SliderMotion
from .making import Make, direction
from .quick_return import QuickReturn, QuickSwing
from .report import (
    SHOWN,
    dimension_rows,
    error_unit,
    format_limit,
    format_transmission,
    headline,
    quality_name,
    quality_unit,
    report,
    rounding_line,
)
from .scene import LinkageScene
from .search import QUICK_SEARCH, USUAL_SEARCH, Search
from .sensitivity import Rounding, Sensitivity, costs, length_step, rounded, sensitivities
from .solution import Evaluation, Solution, Verdicts, evaluate, judge, ranked
from .solve import Synthesis, SynthesisInterrupted, columns_of, improve, synthesize
from .starts import CrankUnknown, PivotUnknown, SliderUnknown
from .targets import TargetPath
from .tasks import (
    Motion,
    PrecisionPoints,
    RockerFunction,
    SliderFunction,
    Straight,
    Task,
    TimedPath,
    UntimedPath,
    normal_form,
    turn,
)
from .trading import OVER, TradeOff, TradeOffInterrupted, there_and_back, trade_off

__all__ = [
    "ANGLES",
    "BOUNDS",
    "GEARS",
    "KINDS",
    "LENGTHS",
    "LINKS",
    "OVER",
    "QUICK_SEARCH",
    "SHOWN",
    "TABLES",
    "UNITS",
    "USUAL",
    "USUAL_SEARCH",
    "Assembly",
    "Constraint",
    "CrankUnknown",
    "DeadCentre",
    "Dyad",
    "Evaluation",
    "FullTurn",
    "Generators",
    "Grashof",
    "Guidance",
    "GuidanceMap",
    "InfeasibleError",
    "Kind",
    "LargestLink",
    "LeastPinForce",
    "LeastTransmission",
    "Linkage",
    "LinkageScene",
    "Make",
    "MaxPinForce",
    "MechanicalAdvantage",
    "Motion",
    "NoToggle",
    "PinForces",
    "PivotRegion",
    "PivotUnknown",
    "PrecisionPoints",
    "QuickReturn",
    "QuickSwing",
    "Require",
    "RockerFunction",
    "Rounding",
    "Search",
    "SecondCrank",
    "Sensitivity",
    "SliderFunction",
    "SliderMotion",
    "SliderUnknown",
    "Solution",
    "Straight",
    "Straightness",
    "Stroke",
    "Synthesis",
    "SynthesisCase",
    "SynthesisInterrupted",
    "TargetPath",
    "Task",
    "TimeRatio",
    "TimedPath",
    "Toggle",
    "TradeOff",
    "TradeOffInterrupted",
    "UntimedPath",
    "Verdicts",
    "alternatives",
    "area_between",
    "chebyshev_spacing",
    "cognates",
    "columns_of",
    "costs",
    "dead_centres",
    "dimension_rows",
    "direction",
    "distance_to",
    "drawing",
    "error_unit",
    "evaluate",
    "format_limit",
    "format_transmission",
    "function_from_formula",
    "function_generators",
    "guidance",
    "has_cognates",
    "hausdorff",
    "headline",
    "improve",
    "judge",
    "kind_of",
    "length_step",
    "load_synthesis_case",
    "mechanical_advantage",
    "normal_form",
    "path_from_formula",
    "pin_forces",
    "plates",
    "quality_name",
    "quality_unit",
    "ranked",
    "report",
    "rounded",
    "rounding_line",
    "sensitivities",
    "straightest_part",
    "straightness",
    "synthesis_case_from",
    "synthesize",
    "there_and_back",
    "time_ratio",
    "toggles",
    "trade_off",
    "turn",
]
