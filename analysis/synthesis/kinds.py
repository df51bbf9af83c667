"""The mechanisms that a task can be given to, each with its bounds and constraints: there is a search for each.

A slider-crank is the four-bar whose rocker pivot lies at infinity, a geared five-bar one whose pivot is on a second crank.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, pi
from typing import Any, get_args

import numpy as np

from linkwork.errors import InputError, ParameterError

from ..files import unknown_name
from ..mechanisms import Kind as Kind
from ..units import Amount, in_si
from .constraints import (
    SECOND_LENGTH,
    UNKNOWNS,
    Assembly,
    Constraint,
    Demand,
    FullTurn,
    LargestLink,
    LeastTransmission,
    Limits,
    PivotRegion,
    Require,
    TimeRatio,
    limits_of,
)
from .linkage import Linkage, SecondCrank
from .starts import CrankUnknown
from .tasks import Normal, RockerFunction, SliderFunction, Task

#: Ratios of the gears of a five-bar that are tried.
GEARS = (1.0, -1.0, 2.0, -2.0, 0.5, -0.5)


@in_si(least="m", greatest="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class Stroke:
    """The slider of a slider-crank, whose crank turns fully, travels this far from end to end.

    Attributes
    ----------
    least, greatest : float
        Bounds (m).
    """

    least: Amount = 0.0
    greatest: Amount = inf

    def __post_init__(self) -> None:
        if not (0.0 <= self.least <= self.greatest and self.greatest > 0.0 and isfinite(self.least)):
            raise ParameterError("stroke", (self.least, self.greatest), "be two lengths in order (m)")

    def requires(self) -> tuple[Require, ...]:
        """The same as functions of the dimensions."""
        found = []
        if self.least > 0.0:
            low = self.least
            found.append(Require(function=lambda d: low - stroke(d), name="least stroke", scale=low))
        if isfinite(self.greatest):
            high = self.greatest
            found.append(Require(function=lambda d: stroke(d) - high, name="greatest stroke", scale=high))
        return tuple(found)


def stroke(d: Any) -> Any:
    """Travel of the slider of a slider-crank (m), of numbers and symbols: between crank and coupler in line and folded."""
    l1, l2, l3 = d.ground_length, d.crank_length, d.coupler_length
    ends = [np.sqrt(np.maximum((l3 + side * l2) ** 2 - l1**2, 1e-18)) for side in (1.0, -1.0)]
    return ends[0] - ends[1]


def advance(d: Any) -> Any:
    """By how much the crank's way between the dead centres of a slider-crank is off half a turn (rad), as `stroke`."""
    l1, l2, l3 = d.ground_length, d.crank_length, d.coupler_length
    angles = [np.arctan2(np.sqrt(np.maximum((l3 + side * l2) ** 2 - l1**2, 1e-18)), l1) for side in (1.0, -1.0)]
    return angles[0] - angles[1]


def _time_ratio(asked: TimeRatio) -> tuple[Require, ...]:
    """The time ratio of a slider-crank as functions of the dimensions: (pi + advance)/(pi - advance)."""
    low, high = (
        pi * (ratio - 1.0) / (ratio + 1.0) if isfinite(ratio) else pi for ratio in (asked.least, asked.greatest)
    )
    found = [Require(function=lambda d: low - advance(d), name="least time ratio")] if asked.least > 1.0 else []
    if isfinite(asked.greatest):
        found.append(Require(function=lambda d: advance(d) - high, name="greatest time ratio"))
    return tuple(found)


#: Constraints that any linkage can keep, and those of a slider-crank.
_ANY: tuple[type, ...] = (LeastTransmission, FullTurn, LargestLink, Assembly, PivotRegion, Require)
_KEPT: Mapping[Kind, tuple[type, ...]] = {
    "four-bar": get_args(Constraint),
    "slider-crank": (*_ANY, Demand, Stroke),
    "geared-five-bar": _ANY,
}


#: Why a five-bar can keep none of the demands.
_NO_DEMANDS = "both its cranks turn, so that nothing of it rests, and the plant of the pin forces has no second crank"


def usual_kinds(task: Task) -> tuple[Kind, ...]:
    """The kinds that are tried where none are asked for."""
    return ("slider-crank",) if isinstance(task, SliderFunction) else ("four-bar",)


def limits_of_kinds(
    task: Task,
    normal: Normal,
    bounds: Mapping[str, tuple[float, float]] | None,
    constraints: Sequence[Constraint | Stroke],
    kinds: Sequence[Kind] | None = None,
    gears: Sequence[float] = GEARS,
) -> list[Limits]:
    """Bounds and constraints of the searches: one for each kind, or the usual one, of geared five-bars one for each ratio.

    Raises InputError if a kind is none, cannot do the task, or has no such constraint; ParameterError, InfeasibleError as
    `limits_of`.
    """
    kinds = usual_kinds(task) if kinds is None else kinds
    if isinstance(kinds, str) or not kinds:
        raise InputError(
            f"kinds are {kinds!r}: they must be a sequence of one or several of {', '.join(get_args(Kind))}"
        )
    found: list[Limits] = []
    for kind in kinds:
        if kind not in get_args(Kind):
            raise unknown_name(kind, get_args(Kind), f"kind {kind!r}")
        _check_task(kind, task)
        if isinstance(constraints, Sequence):
            _check_constraints(kind, constraints)
        if kind == "four-bar":
            own: Sequence[Any] = constraints
            found.append(limits_of(task, normal, bounds, own))
        elif kind == "slider-crank":
            found.append(_of_slider_crank(task, normal, bounds, constraints))
        else:
            if not gears:
                raise InputError("no ratio of gears: geared five-bars need at least one")
            found += _of_five_bars(task, normal, bounds, constraints, gears)
    return found


def _check_task(kind: Kind, task: Task) -> None:
    if isinstance(task, SliderFunction) and kind != "slider-crank":
        raise InputError(f"a {type(task).__name__} is of a slider: a {kind} has none, kinds must be ('slider-crank',)")
    if isinstance(task, RockerFunction) and kind == "slider-crank":
        raise InputError(
            "a RockerFunction is of a rocker: a slider-crank has none; ask for a SliderFunction of its slider"
        )


def _check_constraints(kind: Kind, constraints: Sequence[Any]) -> None:
    for c in constraints:
        known = isinstance(c, Constraint | Stroke)
        if (known and not isinstance(c, _KEPT[kind])) or (kind == "slider-crank" and getattr(c, "pivot", None) == "D"):
            name = "a region of pivot D" if isinstance(c, PivotRegion) else type(c).__name__
            able = [other for other, kept in _KEPT.items() if isinstance(c, kept) and other != kind]
            why = "" if kind == "slider-crank" or not isinstance(c, Demand) else f" ({_NO_DEMANDS})"
            raise InputError(f"a {kind} cannot keep {name}{why}: leave it out, or ask for {' or '.join(able)} alone")


def _of_slider_crank(task: Task, normal: Normal, bounds: Any, constraints: Sequence[Any]) -> Limits:
    own: list[Constraint] = []
    for c in constraints:
        if isinstance(c, Stroke):
            own += c.requires()
        elif isinstance(c, TimeRatio):
            own += _time_ratio(c)
        else:
            own.append(c)
    if any(isinstance(c, Stroke | TimeRatio) for c in constraints):
        own.append(FullTurn())
    if isinstance(task, SliderFunction):
        own += (
            # the guide is the x axis, from either side of it, and the coupler point the slider
            Require(function=lambda d: np.cos(d.ground_angle), equal=True, name="direction of the guide"),
            Require(
                function=lambda d: d.point_distance - d.coupler_length, equal=True, name="slider", scale=normal.unit
            ),
        )
        bounds = {"point_angle": (0.0, 0.0)} | dict(bounds or {})
    given = {"ground_length": (0.0, None)} | {n: ends for n, ends in dict(bounds or {}).items() if n != "rocker_length"}
    limits = limits_of(task, normal, given, own, sliding=True)
    low, high = limits.low.copy(), limits.high.copy()
    low[UNKNOWNS.index("rocker_length")] = high[UNKNOWNS.index("rocker_length")] = 0.0
    offset = UNKNOWNS.index("ground_length")
    asked = given["ground_length"][0]
    low[offset] = (asked or 0.0) / normal.unit
    return replace(limits, low=low, high=high)


def _of_five_bars(
    task: Task, normal: Normal, bounds: Any, constraints: Sequence[Any], gears: Sequence[float]
) -> list[Limits]:
    limits = limits_of(task, normal, bounds, constraints)
    links = slice(UNKNOWNS.index("ground_length"), UNKNOWNS.index("point_distance"))
    longest = float(limits.high[links].max())
    second = 1e-3 * longest, longest
    if isinstance(bounds, Mapping) and SECOND_LENGTH in bounds:
        low, high = bounds[SECOND_LENGTH]
        unknown = CrankUnknown(ratio=1, length=(low, high))
        second = unknown.length[0] / normal.unit, unknown.length[1] / normal.unit
    # a ratio of gears is refused where it is made one
    made = [CrankUnknown(ratio=ratio, length=(1.0, 1.0)).ratio for ratio in gears]
    return [replace(limits, second=second, ratio=float(ratio)) for ratio in made]


def second_crank(limits: Limits, unit: float) -> CrankUnknown | None:
    """The second crank that a search varies; None but for a geared five-bar."""
    if limits.second is None:
        return None
    low, high = limits.second
    return CrankUnknown(ratio=limits.ratio, length=(unit * low, unit * high))


def kind_of(linkage: Linkage) -> Kind:
    """Of what kind a linkage is; a pivot that is moved by no gears counts as a four-bar's."""
    if isinstance(linkage.pivot, SecondCrank):
        return "geared-five-bar"
    return "slider-crank" if linkage.slides else "four-bar"


def is_of(linkage: Linkage, limits: Limits) -> bool:
    """Whether a linkage is of the kind that is searched for; a pivot that is moved otherwise counts as a four-bar's."""
    geared = isinstance(linkage.pivot, SecondCrank) and linkage.pivot.ratio == limits.ratio
    return linkage.slides == limits.sliding and (geared or limits.second is None)


def as_asked(task: Task, linkage: Linkage) -> Linkage:
    """A slider-crank with its guide on the x axis and the slider as its coupler point, exactly, where that is asked."""
    if not isinstance(task, SliderFunction):
        return linkage
    side = 1.0 if linkage.ground_angle > 0.0 else -1.0
    return replace(
        linkage,
        pivot_y=-side * linkage.ground_length,
        point_distance=linkage.coupler_length,
        point_angle=0.0,
        ground_angle=0.5 * pi * side,
    )
