"""Define unknown motions of the rocker pivot; convert bounds and constraints to normal form, for each kind of linkage."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError

from ...files import Whole, unknown_name
from ...units import Amount, in_si
from ..linkage.linkage import ANGLES, LINKS, FiveBar, Kind, Linkage, SliderCrank, gear_turns
from .constraint import (
    SECOND_LENGTH,
    UNKNOWNS,
    Assembly,
    Constraint,
    Demand,
    FullTurn,
    Grashof,
    InfeasibleError,
    LargestLink,
    LeastTransmission,
    MinimisedFunction,
    PivotRegion,
    Require,
    RotationRange,
    RotationRequirement,
    Stroke,
)
from .task import Normal, RockerFunction, SliderFunction, Task

FloatArray = NDArray[np.float64]
#: Default upper bound of the links, relative to the size of the target; for a rocker function relative to the ground link.
LARGEST = 5.0
#: Ground link of a rocker function by default (m): its angles do not depend on the size.
GROUND = 0.1
#: Grashof types whose crank does not turn fully.
_SWINGING = ("double-rocker", "rocker-crank", "triple-rocker")


@in_si(guide_angle="rad", position="m", stroke="m", speed="m", acceleration="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class SliderUnknown:
    """A slider whose motion is unknown: a Fourier series with a given number of harmonics.

    Attributes
    ----------
    harmonics : int
        Number of harmonics; 0 for a slider that is adjusted once and does not move.
    guide_angle : (float, float)
        Bounds of the guide's direction from the ground link (rad); equal bounds fix it.
    position : (float, float), optional
        Least and greatest slider position (m); by default minus and plus the ground link's length.
    stroke : float
        Greatest length of the slider's travel (m).
    speed, acceleration : float
        Greatest ``|du/dphi|`` (m/rad) and ``|d2u/dphi2|`` (m/rad2).
    """

    harmonics: int
    guide_angle: tuple[Amount, Amount] = (-pi, pi)
    position: tuple[Amount, Amount] | None = None
    stroke: Amount = inf
    speed: Amount = inf
    acceleration: Amount = inf

    def __post_init__(self) -> None:
        Whole(least=0)(self.harmonics, "harmonics")
        low, high = self.guide_angle
        if not (isfinite(low) and isfinite(high) and low <= high):
            raise ParameterError("bounds of guide_angle", self.guide_angle, "be two finite angles in order (rad)")
        if self.position is not None:
            low, high = self.position
            if not (isfinite(low) and isfinite(high) and low < high):
                raise ParameterError(
                    "bounds of slider position", self.position, "be two finite lengths, increasing (m)"
                )
        for name in ("stroke", "speed", "acceleration"):
            if not getattr(self, name) > 0.0:
                raise ParameterError(f"greatest {name}", getattr(self, name), "be greater than zero")


@in_si(length="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class CrankUnknown:
    """A second crank whose length, phase and, with ``harmonics``, independent rotation are unknown.

    Attributes
    ----------
    ratio : float
        Turns of the second crank per turn of the first: see `SecondCrank`.
    length : (float, float)
        Bounds of the second crank's length (m).
    harmonics : int
        Number of harmonics of the rotation that is added to the rotation by the gears; 0 for gears alone.
    """

    ratio: float
    length: tuple[Amount, Amount]
    harmonics: int = 0

    def __post_init__(self) -> None:
        low, high = self.length
        if not (isfinite(low) and isfinite(high) and 0.0 < low <= high):
            raise ParameterError("bounds of the second crank", self.length, "be two lengths above zero, in order (m)")
        gear_turns(self.ratio)
        Whole(least=0)(self.harmonics, "harmonics")


PivotUnknown = SliderUnknown | CrankUnknown


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """Bounds and constraints in normal form: lengths in units of the target's size, coordinates relative to its centre.

    Attributes
    ----------
    low, high : ndarray, shape (11,)
        Bounds of `UNKNOWNS`.
    turn, way : float or None
        Least transmission angles (rad): ``turn`` over a full turn of the crank, ``way`` during the task. A ``turn`` of 0 only
        requires that the crank turns fully, a ``way`` of 0 that the links stay joined. None requires nothing.
    grashof : str or None
        Required Grashof type.
    branches : tuple of int
        Assemblies that are tried.
    regions : tuple
        For each region the pivot, "A" or "D", and the triangles, each shape (3, 2), in units.
    requires : tuple of Require
        Functions that must be at most zero, or equal to zero.
    linkage : type
        Type of the linkages.
    second : (float, float), optional
        Bounds of the second crank's length of a geared five-bar, in units.
    ratio : float
        Gear ratio of a geared five-bar.
    least : MinimisedFunction, optional
        The function that is minimised instead of an error.
    """

    low: FloatArray  # least values of `UNKNOWNS`, shape (11,)
    high: FloatArray  # greatest values of `UNKNOWNS`, shape (11,)
    # least transmission angles (rad) over a full turn of the crank and during the task: a `turn` of 0 only requires that the
    # crank turns fully, a `way` of 0 that the links stay joined, None requires nothing
    turn: float | None
    way: float | None
    grashof: str | None  # required Grashof type
    branches: tuple[int, ...]  # assemblies that are tried
    # for each region the pivot, "A" or "D", and the triangles, each shape (3, 2), in units
    regions: tuple[tuple[str, tuple[FloatArray, ...]], ...]
    requires: tuple[Require, ...]  # functions that must be at most zero, or equal to zero
    linkage: type[Linkage] = Linkage
    second: tuple[float, float] | None = None  # bounds of the second crank's length of a geared five-bar, in units
    ratio: float = 1.0  # gear ratio of a geared five-bar
    least: MinimisedFunction | None = None  # the function that is minimised instead of an error

    @property
    def gears(self) -> tuple[int, int]:
        """Return the turns of the first and of the second crank per turn of the input shaft; (1, 0) without a second crank."""
        return (1, 0) if self.second is None else gear_turns(self.ratio)

    def second_crank(self, unit: float) -> CrankUnknown | None:
        """Return the unknowns of the second crank; None for a linkage without one. ``unit`` is the target's size (m)."""
        if self.second is None:
            return None
        low, high = self.second
        return CrankUnknown(ratio=self.ratio, length=(unit * low, unit * high))

    def admits(self, linkage: Linkage) -> bool:
        """Return whether a search within these limits can start from a linkage, by its kind and gear ratio.

        A search for four-bars can also start from a linkage whose pivot moves on a guide or is carried by a second crank.
        """
        if self.linkage is FiveBar:
            return isinstance(linkage, FiveBar) and linkage.pivot.ratio == self.ratio
        return isinstance(linkage, SliderCrank) == (self.linkage is SliderCrank)

    @property
    def bounds_rotations(self) -> bool:
        """Return whether any constraint bounds a function of the crank rotation; see `RotationRequirement`."""
        return any(isinstance(require, RotationRequirement) for require in self.requires)

    def without_defects(self, normal: Normal) -> Limits | None:
        """Return these limits with defects excluded; None if they exclude defects already, or do not minimise an error."""
        if self.turn is not None or self.way is not None or self.least is not None:
            return None
        return replace(self, turn=0.0) if normal.whole_turn else replace(self, way=0.0)

    @property
    def bounds_only(self) -> bool:
        """Return whether there are only bounds and no constraints, so that a least squares method is sufficient."""
        none = all(limit is None for limit in (self.turn, self.way, self.grashof, self.least))
        return none and not (self.regions or self.requires)


def make_limits(
    task: Task,
    normal: Normal,
    bounds: Mapping[str, tuple[float, float]] | None,
    constraints: Sequence[Constraint],
    *,
    linkage: type[Linkage] = Linkage,
) -> Limits:
    """Return bounds and constraints of a task in normal form, for one type of linkage.

    Raises InputError or ParameterError if a bound or constraint is not usable; InfeasibleError if the ends of a bound are in
    the wrong order, or bounds and constraints contradict one another.
    """
    bounds = check_bounds(bounds)
    check_sequence("constraints", constraints)
    # kinds of linkages without a second crank leave it out
    bounds = {name: ends for name, ends in bounds.items() if name != SECOND_LENGTH}
    for name in bounds:
        if name not in UNKNOWNS:
            raise unknown_name(name, sorted(UNKNOWNS), f"dimension {name!r}, which is to have bounds")
    for c in constraints:
        if not isinstance(c, Constraint):
            raise InputError(f"{c!r} is not a constraint: use one of analysis.synthesis, such as LeastTransmission")
    given = _dimension_ranges(task, normal, bounds, constraints, linkage)
    _check_reach(given, normal, constraints)
    lows, highs = (np.array([given[name][end] for name in UNKNOWNS]) for end in (0, 1))
    shift, scale = np.zeros(len(UNKNOWNS)), np.ones(len(UNKNOWNS))
    shift[:2] = normal.origin.real, normal.origin.imag
    scale[:7] = normal.unit
    turn, way, grashof = _transmission_limits(constraints, normal.whole_turn, linkage)
    if way is not None and normal.whole_turn and grashof not in _SWINGING:
        turn, way = max(turn or 0.0, way), None
    straight = given["point_distance"][1] == 0.0 or given["point_angle"] in ((0.0, 0.0), (pi, pi), (-pi, -pi))
    over = RotationRange(turn is not None, normal.rotation, straight, linkage, normal.of_slider)
    rests = linkage is SliderCrank or grashof == "crank-rocker"
    if over.turn and rests and any(isinstance(c, Demand) and c.excludes_rest for c in constraints):
        raise InfeasibleError(
            f"the {linkage.driven[0]} of a crank that turns fully rests twice in a turn, where the mechanical advantage is "
            "infinite: bound the greatest one at crank rotations"
        )
    least = [found for c in constraints if isinstance(c, Demand) and (found := c.least_function(over, normal))]
    if len(least) > 1:
        raise InputError("more than one constraint is to be minimised: a search has one objective")
    branches = {c.branch for c in constraints if isinstance(c, Assembly)}
    if len(branches) > 1:
        raise InfeasibleError("the constraints require both assemblies at once")
    return Limits(
        low=(lows - shift) / scale,
        high=(highs - shift) / scale,
        turn=turn,
        way=way,
        grashof=grashof,
        branches=tuple(branches) or (1, -1),
        regions=tuple(
            (c.pivot, tuple((piece - shift[:2]) / normal.unit for piece in c.pieces()))
            for c in constraints
            if isinstance(c, PivotRegion)
        ),
        requires=tuple(r for c in constraints for r in _required_functions(c, over)),
        linkage=linkage,
        least=least[0] if least else None,
    )


def _dimension_ranges(
    task: Task,
    normal: Normal,
    bounds: Mapping[str, tuple[float, float]],
    constraints: Sequence[Constraint],
    linkage: type[Linkage],
) -> dict[str, tuple[float, float]]:
    """Return the least and greatest value of every unknown (m, rad), as given or by default."""
    caps = [c.length for c in constraints if isinstance(c, LargestLink)]
    function = isinstance(task, RockerFunction)
    cap = min(caps, default=LARGEST * (GROUND if function else normal.unit))
    # with a required function angles stay within a turn, so that they are returned as the function was evaluated
    turns = 1.0 if any(isinstance(c, Require) for c in constraints) else 4.0
    usual = dict.fromkeys(ANGLES, (-turns * pi, turns * pi)) | dict.fromkeys(LINKS, (1e-3 * cap, cap))
    usual["point_distance"] = 0.0, cap
    for name, middle in (("pivot_x", normal.origin.real), ("pivot_y", normal.origin.imag)):
        usual[name] = middle - 4.0 * cap, middle + 4.0 * cap
    if not normal.mounting:
        usual["output_angle"] = 0.0, 0.0
    if function:
        usual |= dict.fromkeys(("pivot_x", "pivot_y", "point_distance", "ground_angle", "point_angle"), (0.0, 0.0))
        if not caps and not set(LINKS) & set(bounds):
            usual["ground_length"] = GROUND, GROUND
    ends = {name: complete_bounds(name, bounds.get(name, usual[name]), usual[name]) for name in UNKNOWNS}
    for name in (*LINKS, "point_distance"):
        low, high = ends[name]
        link = name in linkage.links
        if link:
            check_greatest_length(name, high)
        if caps and low > cap:
            raise InfeasibleError(
                f"{name} is to be at least {low:g} m, and no link longer than {cap:g} m: no linkage has both"
            )
        low, high = max(low, 1e-6 * cap if link else 0.0), min(high, cap) if caps else high
        if low > high:
            raise InfeasibleError(f"{name} is to be at most {high:g} m: it is a distance and cannot be below {low:g} m")
        ends[name] = low, high
    return ends


def _required_functions(constraint: Constraint, way: RotationRange) -> tuple[Require, ...]:
    if isinstance(constraint, Demand):
        return constraint.requires(way)
    return (constraint,) if isinstance(constraint, Require) else ()


def _transmission_limits(
    constraints: Sequence[Constraint], whole_turn: bool, linkage: type[Linkage]
) -> tuple[float | None, float | None, str | None]:
    """Return the least transmission angles over a turn and during the task, and the Grashof type; see `Limits`.

    ``whole_turn`` tells whether the task takes a whole turn of the crank.
    """
    turn, way = (
        max((c.angle for c in constraints if isinstance(c, LeastTransmission) and c.over == over), default=None)
        for over in ("turn", "task")
    )
    types: set[str] = {c.type for c in constraints if isinstance(c, Grashof)}
    demands = [c for c in constraints if isinstance(c, Demand)]
    types |= {c.grashof for c in demands if c.grashof is not None and linkage is not SliderCrank}
    if len(types) > 1:
        raise InfeasibleError(f"Grashof types {', '.join(sorted(types))} are asked for at once: a four-bar has one")
    type_ = types.pop() if types else None
    turning = any(isinstance(c, FullTurn) or (isinstance(c, Demand) and c.turns) for c in constraints)
    if turn is None and (turning or type_ in ("crank-rocker", "drag-link")):
        turn = 0.0
    if type_ in _SWINGING:
        if turn is not None:
            raise InfeasibleError(f"the crank of a {type_} does not turn fully, which another constraint asks for")
        # even so, its links must stay joined during the task
        way = way or 0.0
    if (turn is not None or whole_turn) and any(c.stops for c in demands):
        raise InfeasibleError(
            "a crank that is to come to a toggle cannot turn fully, which "
            f"{'the task' if turn is None else 'another constraint'} asks for"
        )
    return turn, way, type_


def check_bounds(bounds: Mapping[str, tuple[float, float]] | None) -> Mapping[str, tuple[float, float]]:
    """Return the bounds, an empty mapping for None; raise InputError if they are no mapping."""
    if not isinstance(bounds, Mapping | None):
        raise InputError(f"bounds are {bounds!r}: they must be a mapping from a dimension's name to its two ends")
    return bounds or {}


def check_sequence(name: str, values: Any) -> None:
    """Raise InputError if an argument is no sequence, such as a single constraint or a text."""
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray):
        raise InputError(f"{name} are {values!r:.200}: they must be a sequence, even of one")


def check_greatest_length(name: str, high: float) -> None:
    """Raise ParameterError if the greatest length of a link is not above zero."""
    if high <= 0.0:
        raise ParameterError(f"bound of {name}", high, "be above zero (m): a link has a length")


def complete_bounds(
    name: str, ends: tuple[float | None, float | None], usual: tuple[float, float]
) -> tuple[float, float]:
    """Return the bounds of dimension ``name``: the given ``ends``; an end that is None or infinite is from ``usual``."""
    try:
        low, high = (e if end is None or np.isinf(end) else float(end) for end, e in zip(ends, usual, strict=True))
    except (TypeError, ValueError):
        raise ParameterError(f"bounds of {name}", ends, "be two numbers, the least and the greatest value") from None
    if np.isnan([low, high]).any():
        raise ParameterError(f"bounds of {name}", ends, "be numbers, or None for an open end")
    if low > high:
        unit = "rad" if name in ANGLES else "m"
        raise InfeasibleError(f"{name} is to be at least {low:g} {unit} and at most {high:g} {unit}: no value is")
    return low, high


def _check_reach(given: Mapping[str, tuple[float, float]], normal: Normal, constraints: Sequence[Constraint]) -> None:
    """Check that the coupler point can span the target: its distance from A is at most crank plus point distance."""
    from shapely import MultiPoint, Polygon

    (left, right), (bottom, top) = given["pivot_x"], given["pivot_y"]
    # a line or a point where bounds fix the place
    room = MultiPoint([(x, y) for x in (left, right) for y in (bottom, top)]).convex_hull
    for c in constraints:
        if isinstance(c, PivotRegion) and c.pivot == "A":
            room = room.intersection(Polygon(c.polygon))
    if room.is_empty:
        raise InfeasibleError(
            "the regions of pivot A and the bounds of its place have no point in common: pivot_x is to be "
            f"{1e3 * left:.4g} to {1e3 * right:.4g} mm, pivot_y {1e3 * bottom:.4g} to {1e3 * top:.4g} mm"
        )
    points = normal.points if normal.outline is None else normal.outline
    if points is None:
        return
    across = normal.unit * float(max(np.ptp(points.real), np.ptp(points.imag)))
    reach = given["crank_length"][1] + given["point_distance"][1]
    ends = f"{1e3 * given['crank_length'][1]:.4g} mm and {1e3 * given['point_distance'][1]:.4g} mm"
    if 2.0 * reach < across:
        raise InfeasibleError(
            f"the coupler point cannot span the target, {1e3 * across:.4g} mm across: crank and point distance, of at most "
            f"{ends}, keep it within {2e3 * reach:.4g} mm"
        )
    places = normal.origin + normal.unit * points
    away = room.distance(MultiPoint(np.column_stack([places.real, places.imag])))
    if away > reach:
        raise InfeasibleError(
            f"the coupler point cannot come to the target: the crank shaft is to be {1e3 * away:.4g} mm from it at least, and "
            f"crank and point distance, of at most {ends}, reach {1e3 * reach:.4g} mm"
        )


#: Default gear ratios of five-bars.
GEARS = (1.0, -1.0, 2.0, -2.0, 0.5, -0.5)
#: Constraints that apply to any linkage, and all that apply to each kind.
_ANY: tuple[type, ...] = (LeastTransmission, FullTurn, LargestLink, Assembly, PivotRegion, Require)
_SUPPORTED: Mapping[Kind, tuple[type, ...]] = {
    "four-bar": (*_ANY, Demand, Grashof),
    "slider-crank": (*_ANY, Demand),
    "geared-five-bar": _ANY,
}
#: Reason why a `Demand` does not apply to a five-bar.
_NO_DEMANDS = "both its cranks turn, so that no link rests, and the plant of the pin forces has no second crank"


def usual_kinds(task: Task) -> tuple[Kind, ...]:
    """Return the kinds of linkages that are tried for a task by default."""
    return ("slider-crank",) if isinstance(task, SliderFunction) else ("four-bar",)


def limits_by_kind(
    task: Task,
    normal: Normal,
    bounds: Mapping[str, tuple[float, float]] | None,
    constraints: Sequence[Constraint],
    kinds: Sequence[Kind] | None = None,
    gears: Sequence[float] = GEARS,
) -> list[Limits]:
    """Return the bounds and constraints of a task: one `Limits` for each kind of linkage, or gear ratio of a five-bar.

    By default the kinds are those of `usual_kinds`.

    Raises InputError if a kind cannot do the task or does not support a constraint; ParameterError, InfeasibleError as
    `make_limits` does.
    """
    kinds, bounds = usual_kinds(task) if kinds is None else kinds, check_bounds(bounds)
    check_sequence("constraints", constraints)
    found: list[Limits] = []
    for kind in kinds:
        check_task(kind, task)
        _check_constraints(kind, constraints)
        if kind == "four-bar":
            found.append(make_limits(task, normal, bounds, constraints))
        elif kind == "slider-crank":
            found.append(_slider_crank_limits(task, normal, bounds, constraints))
        else:
            if not len(gears):
                raise InputError("no gear ratio is given: geared five-bars need at least one")
            found += _five_bar_limits(task, normal, bounds, constraints, gears)
    return found


def check_task(kind: Kind, task: Task) -> None:
    """Raise InputError if linkages of a kind cannot do a task, because they have no slider, or no rocker."""
    if isinstance(task, SliderFunction) and kind != "slider-crank":
        raise InputError(
            f"a {type(task).__name__} needs a slider at C, and a {kind} has none: it is for a slider-crank"
        )
    if isinstance(task, RockerFunction) and kind == "slider-crank":
        raise InputError("a RockerFunction needs a rocker, and a slider-crank has none: ask for a SliderFunction")


def _check_constraints(kind: Kind, constraints: Sequence[Any]) -> None:
    for c in constraints:
        if isinstance(c, Constraint) and not _supports(kind, c):
            name = "a region of pivot D" if isinstance(c, PivotRegion) else type(c).__name__
            able = [other for other in _SUPPORTED if _supports(other, c)]
            why = "" if kind == "slider-crank" or not isinstance(c, Demand) else f" ({_NO_DEMANDS})"
            raise InputError(f"a {kind} cannot keep {name}{why}: leave it out, or ask for {' or '.join(able)} alone")


def _supports(kind: Kind, c: Constraint) -> bool:
    if isinstance(c, Stroke) or (isinstance(c, PivotRegion) and c.pivot == "D"):
        return (kind == "slider-crank") == isinstance(c, Stroke)
    return isinstance(c, _SUPPORTED[kind])


def _slider_crank_limits(task: Task, normal: Normal, bounds: Any, constraints: Sequence[Any]) -> Limits:
    if isinstance(task, SliderFunction):
        # the guide is the x axis, with the shaft on either side, and the coupler point is the slider
        places: Mapping[str, Callable[[Any], Any]] = {
            "place of the guide": lambda d: d.pivot_y + d.ground_length * np.sin(d.ground_angle),
            "slider": lambda d: d.point_distance - d.coupler_length,
        }
        constraints = (
            *constraints,
            Require(function=lambda d: np.cos(d.ground_angle), equal=True, name="direction of the guide"),
            *(Require(function=f, equal=True, name=name, scale=normal.unit, unit="m") for name, f in places.items()),
        )
        bounds = {"point_angle": (0.0, 0.0)} | dict(bounds)
    given = {n: ends for n, ends in bounds.items() if n != "rocker_length"}
    least, most = complete_bounds("ground_length", bounds.get("ground_length", (None, None)), (0.0, inf))
    limits = make_limits(task, normal, given | {"ground_length": (least, most)}, constraints, linkage=SliderCrank)
    if least < 0.0:
        raise ParameterError(
            "bound of ground_length",
            least,
            "be zero or above: the offset of a slider-crank is a distance, ground_angle gives the side of its guide",
        )
    low, high = limits.low.copy(), limits.high.copy()
    low[UNKNOWNS.index("rocker_length")] = high[UNKNOWNS.index("rocker_length")] = 0.0
    return replace(limits, low=low, high=high)


def _five_bar_limits(
    task: Task, normal: Normal, bounds: Any, constraints: Sequence[Any], gears: Sequence[float]
) -> list[Limits]:
    limits = make_limits(task, normal, bounds, constraints)
    links = slice(UNKNOWNS.index("ground_length"), UNKNOWNS.index("point_distance"))
    longest = float(limits.high[links].max())
    second = 1e-3 * longest, longest
    if isinstance(bounds, Mapping) and SECOND_LENGTH in bounds:
        low, high = bounds[SECOND_LENGTH]
        unknown = CrankUnknown(ratio=1, length=(low, high))
        second = unknown.length[0] / normal.unit, unknown.length[1] / normal.unit
    # CrankUnknown refuses a number that is no ratio of gears
    made = [CrankUnknown(ratio=ratio, length=(1.0, 1.0)).ratio for ratio in gears]
    return [replace(limits, linkage=FiveBar, second=second, ratio=float(ratio)) for ratio in made]


def place_as_task(task: Task, linkage: Linkage) -> Linkage:
    """Return a linkage placed as the task asks: for a slider function, with the guide exactly on the x axis.

    The coupler point is then the pin of the slider. For other tasks the linkage is returned unchanged.
    """
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
