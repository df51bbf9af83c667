"""What a linkage must satisfy besides tracing its target."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, pi, radians
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError, ParameterError

from ..units import Amount, in_si
from .kernels import PLACES
from .linkage import ANGLES, LINKS, geared
from .tasks import Normal, RockerFunction, Task

FloatArray = NDArray[np.float64]
GrashofType = Literal["crank-rocker", "drag-link", "double-rocker", "rocker-crank", "triple-rocker"]

#: The unknowns of every linkage, in their order: `kernels.PLACES` and the output angle.
UNKNOWNS = (*PLACES, "output_angle")
#: What only a geared five-bar has, besides.
SECOND_LENGTH = "second_crank_length"
#: Largest link by default, in sizes of the target; and, of a rocker function, in ground links.
LARGEST = 5.0
#: Least transmission angle at which a crank still counts as turning fully (rad).
TURNING = 0.002
#: Ground link of a rocker function by default (m): its angles do not depend on the size.
GROUND = 0.1


class InfeasibleError(LinkworkError):
    """Bounds and constraints leave no linkage."""


#: Least transmission angle by default (rad).
_LEAST_TRANSMISSION = radians(40.0)


@in_si(angle="rad")
@dataclass(frozen=True, slots=True, kw_only=True)
class LeastTransmission:
    """The angle between coupler and rocker stays at least this far from 0 and pi.

    Attributes
    ----------
    angle : float
        rad.
    over : "turn" or "task"
        Over a full turn, which makes the crank able to turn fully, or at the task's stations only.
    """

    angle: Amount = _LEAST_TRANSMISSION
    over: Literal["turn", "task"] = "turn"

    def __post_init__(self) -> None:
        if not 0.0 <= self.angle < 0.5 * pi:
            raise ParameterError("least transmission angle", self.angle, "be at least 0 and below pi/2 rad")
        if self.over not in ("turn", "task"):
            raise ParameterError("over", self.over, "be 'turn' or 'task'")


@dataclass(frozen=True, slots=True, kw_only=True)
class FullTurn:
    """The crank can turn fully, however near the links come to being collinear."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grashof:
    """The four-bar is of this type; see `Linkage.grashof`."""

    type: GrashofType

    def __post_init__(self) -> None:
        if self.type not in get_args(GrashofType):
            raise ParameterError("Grashof type", self.type, f"be one of {', '.join(get_args(GrashofType))}")


@in_si(length="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class LargestLink:
    """No link, nor the distance of the coupler point, is longer than this (m)."""

    length: Amount

    def __post_init__(self) -> None:
        if not (isfinite(self.length) and self.length > 0.0):
            raise ParameterError("largest link", self.length, "be a finite number greater than zero (m)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Assembly:
    """C lies to the left (+1) or to the right (-1) of B -> D."""

    branch: int

    def __post_init__(self) -> None:
        if self.branch not in (1, -1):
            raise ParameterError("branch", self.branch, "be +1 or -1")


@in_si(polygon="m")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PivotRegion:
    """A pivot lies within a polygon, convex or not.

    Attributes
    ----------
    pivot : "A" or "D"
        The crank shaft, or the end of the ground link.
    polygon : array_like, shape (n, 2)
        Corners in order (m).
    """

    pivot: Literal["A", "D"]
    polygon: ArrayLike

    def __post_init__(self) -> None:
        if self.pivot not in ("A", "D"):
            raise ParameterError("pivot", self.pivot, "be 'A' or 'D'")
        corners = np.array(self.polygon, dtype=float)
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
            raise InputError(f"the region of pivot {self.pivot} must be at least 3 finite corners, shape (n, 2)")
        from shapely import Polygon

        shape = Polygon(corners)
        if not shape.is_valid or not shape.area > 0.0:
            raise InputError(f"the region of pivot {self.pivot} crosses itself or has no area: {corners.tolist()} m")
        object.__setattr__(self, "polygon", corners)

    def pieces(self) -> list[FloatArray]:
        """The region as triangles, counter-clockwise, each shape (3, 2)."""
        from shapely import Polygon, constrained_delaunay_triangles
        from shapely.geometry.polygon import orient

        triangles = constrained_delaunay_triangles(Polygon(self.polygon))
        return [np.array(orient(t).exterior.coords)[:3] for t in triangles.geoms]


def half_planes(triangle: FloatArray) -> FloatArray:
    """Rows r with r . (x, y, 1) <= 0 inside a counter-clockwise triangle, shape (3, 3)."""
    rows = np.zeros((3, 3))
    for k in range(3):
        (x0, y0), (x1, y1) = triangle[k], triangle[(k + 1) % 3]
        length = float(np.hypot(x1 - x0, y1 - y0))
        rows[k] = (y1 - y0) / length, (x0 - x1) / length, (y0 * x1 - x0 * y1) / length
    return rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Require:
    """Any function of the dimensions is below zero, or zero.

    Attributes
    ----------
    function : callable
        Of a namespace with the dimensions of `Linkage` by name (SI), in arithmetic and the elementary functions of `math` or
        NumPy, without branches; it is traced, so that its derivatives are exact.
    equal : bool
        Whether it is to be zero, instead of at most zero.
    name : str
        For messages.
    scale : float
        Magnitude of its values.
    unit : str
        Theirs, for messages.
    symbolic : bool
        Whether it takes CasADi's symbols and numbers as it stands, and may have several values.
    """

    function: Callable[..., Any]
    equal: bool = False
    name: str = "required function"
    scale: float = 1.0
    unit: str = ""
    symbolic: bool = False

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ParameterError(self.name, self.function, "be a function of the dimensions")
        if not (isfinite(self.scale) and self.scale > 0.0):
            raise ParameterError(f"scale of {self.name}", self.scale, "be a finite number greater than zero")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Along(Require):
    """A function of the dimensions and of the crank's rotation is below zero at rotations, or all the way between two.

    Attributes
    ----------
    rotation : ndarray, shape (n,)
        Where it is held from the beginning (rad); ``function(d, rotation)`` has rows of n values each.
    ends : (float, float) or None
        Between which its greatest values are looked for, and held too; None where the rotations are all.
    """

    rotation: FloatArray
    ends: tuple[float, float] | None = None


class Way(NamedTuple):
    """Over what a constraint holds that is about the crank's rotation.

    Attributes
    ----------
    turn : bool
        Whether the crank turns fully.
    rotation : ndarray or None
        The task's crank rotations, where it gives any.
    straight : bool
        Whether the bounds hold the coupler point on the line of B and C.
    sliding : bool
        Whether it is about a slider-crank.
    """

    turn: bool
    rotation: FloatArray | None
    straight: bool = False
    sliding: bool = False

    def ends(self, what: str) -> tuple[float, float]:
        """First and last crank angle of a turn, or crank rotation of the task.

        Raises InputError if neither is known.
        """
        if self.turn:
            return 0.0, 2.0 * pi
        rotation = self.timed(f"{what}, where the crank need not turn fully,")
        return float(rotation.min()), float(rotation.max())

    def timed(self, what: str) -> FloatArray:
        """The task's crank rotations; raises InputError if it gives none."""
        if self.rotation is None:
            raise InputError(f"{what} needs crank rotations, and the task gives none")
        return self.rotation


class Least(NamedTuple):
    """What is made small in the place of an error: the greatest value of a function, the greatest error bounded (units)."""

    along: Along
    error: float


class Demand:
    """A constraint that is functions of the dimensions kept below zero; `limit_positions` and `forces` have such."""

    __slots__ = ()
    #: Type of four-bar that it is about.
    grashof: ClassVar[GrashofType | None] = None
    #: Whether the crank then cannot turn fully.
    stops: ClassVar[bool] = False
    #: Whether something is made small in the place of an error.
    seeks: ClassVar[bool] = False

    def requires(self, way: Way) -> tuple[Require, ...]:
        """The functions."""
        raise NotImplementedError

    def sought(self, way: Way, normal: Normal) -> Least | None:
        """What it makes small in the place of an error."""
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeRatio(Demand):
    """The four-bar is a crank-rocker whose slow swing takes this many times as long as its quick one.

    Attributes
    ----------
    least, greatest : float
        Bounds; 1 at least.
    """

    grashof: ClassVar[GrashofType | None] = "crank-rocker"

    least: float = 1.0
    greatest: float = inf

    def __post_init__(self) -> None:
        if not 1.0 <= self.least <= self.greatest:
            raise ParameterError("time ratio", (self.least, self.greatest), "be two numbers in order, 1 or greater")

    def requires(self, way: Way) -> tuple[Require, ...]:
        """Functions of how much the crank's way between the dead centres is off half a turn."""

        def differs(d: Any) -> Any:
            # directions of C from A with crank and coupler in line, by the law of cosines
            l1, l2, l3, l4 = d.ground_length, d.crank_length, d.coupler_length, d.rocker_length
            stretched, folded = ((l1**2 + r**2 - l4**2) / (2.0 * l1 * r) for r in (l3 + l2, l3 - l2))
            angles = [np.arctan2(np.sqrt(np.maximum(1.0 - c**2, 1e-12)), c) for c in (stretched, folded)]
            return angles[1] - angles[0]

        def advance(ratio: float) -> float:
            return pi * (ratio - 1.0) / (ratio + 1.0)

        found = []
        if self.least > 1.0:
            low = advance(self.least)
            found.append(Require(function=lambda d: low**2 - differs(d) ** 2, name="least time ratio"))
        if isfinite(self.greatest):
            high = advance(self.greatest)
            found.append(Require(function=lambda d: differs(d) ** 2 - high**2, name="greatest time ratio"))
        return tuple(found)


Constraint = Demand | LeastTransmission | FullTurn | Grashof | LargestLink | Assembly | PivotRegion | Require
#: A least transmission angle of 40 degrees over a full turn.
USUAL: tuple[Constraint, ...] = (LeastTransmission(),)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limits:
    """Bounds and constraints in normal form: lengths in units of the target's size, about its centre.

    Attributes
    ----------
    low, high : ndarray, shape (11,)
        Of `UNKNOWNS`.
    turn, way : float or None
        Least transmission angle (rad) over a turn and over the way of the task: 0 where the crank is only to turn fully, or
        the links only to stay joined; None where nothing is asked.
    grashof : str or None
    branches : tuple of int
        Assemblies to be tried.
    regions : tuple
        (pivot, triangles of complex corners), in units.
    requires : tuple of Require
    sliding : bool
        Whether it is of a slider-crank.
    second : (float, float), optional
        Bounds of a second crank's length, in units, of a geared five-bar.
    ratio : float
        Of its gears.
    least : Least, optional
        What is made small in the place of an error.
    """

    low: FloatArray
    high: FloatArray
    turn: float | None
    way: float | None
    grashof: str | None
    branches: tuple[int, ...]
    regions: tuple[tuple[str, tuple[FloatArray, ...]], ...]
    requires: tuple[Require, ...]
    sliding: bool = False
    second: tuple[float, float] | None = None
    ratio: float = 1.0
    least: Least | None = None

    @property
    def kind(self) -> str:
        """What it is of."""
        return "slider-crank" if self.sliding else "four-bar" if self.second is None else "geared five-bar"

    @property
    def turns(self) -> int:
        """Turns of the crank for one of the shaft whose rotation is searched."""
        return 1 if self.second is None else geared(self.ratio)[0]

    @property
    def along(self) -> bool:
        """Whether something holds along the crank's rotation."""
        return any(isinstance(require, Along) for require in self.requires)

    @property
    def bounds_only(self) -> bool:
        """Whether nothing but bounds is asked, so that a least squares method can do it."""
        return (
            self.turn is None
            and self.way is None
            and self.grashof is None
            and self.least is None
            and not (self.regions or self.requires)
        )


def limits_of(
    task: Task,
    normal: Normal,
    bounds: Mapping[str, tuple[float, float]] | None,
    constraints: Sequence[Constraint],
    *,
    sliding: bool = False,
) -> Limits:
    """Bounds and constraints of a task in normal form, of a four-bar or a slider-crank.

    Raises ParameterError if a bound does not have the name of a dimension, or its ends are in the wrong order; InfeasibleError
    if they contradict one another.
    """
    if not isinstance(bounds, Mapping | None):
        raise InputError(f"bounds are {bounds!r}: they must be a mapping from a dimension's name to its two ends")
    if not isinstance(constraints, Sequence):
        raise InputError(f"constraints are {constraints!r}: they must be a sequence, even of one")
    # kinds of linkages without a second crank leave it out
    bounds = {name: ends for name, ends in (bounds or {}).items() if name != SECOND_LENGTH}
    for name in bounds:
        if name not in UNKNOWNS:
            raise ParameterError(name, bounds[name], f"have the name of a dimension: {', '.join(sorted(UNKNOWNS))}")
    for c in constraints:
        if not isinstance(c, Constraint):
            raise InputError(f"constraint {c!r} is none: use {', '.join(_kinds())}")
    given = _ends(task, normal, bounds, constraints)
    _check_links(given, constraints, sliding)
    _check_reach(given, normal, constraints)
    lows, highs = (np.array([given[name][end] for name in UNKNOWNS]) for end in (0, 1))
    shift, scale = np.zeros(len(UNKNOWNS)), np.ones(len(UNKNOWNS))
    shift[:2] = normal.origin.real, normal.origin.imag
    scale[:7] = normal.unit
    turn, way, grashof = _turning(constraints)
    straight = given["point_distance"][1] == 0.0 or given["point_angle"] in ((0.0, 0.0), (pi, pi), (-pi, -pi))
    over = Way(turn is not None, normal.rotation, straight, sliding)
    least = [found for c in constraints if isinstance(c, Demand) and (found := c.sought(over, normal))]
    if len(least) > 1:
        raise InputError("more than one thing is to be made small: a search has one objective")
    branches = {c.branch for c in constraints if isinstance(c, Assembly)}
    if len(branches) > 1:
        raise InfeasibleError("both assemblies are asked for at once")
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
        requires=tuple(r for c in constraints for r in _required(c, over)),
        sliding=sliding,
        least=least[0] if least else None,
    )


def _kinds() -> list[str]:
    """Names of the constraints."""
    found, below = [kind.__name__ for kind in get_args(Constraint)[1:]], [Demand]
    while below:
        below = [kind for one in below for kind in one.__subclasses__()]
        found += [kind.__name__ for kind in below if not kind.__name__.startswith("_")]
    return list(dict.fromkeys(found))


def _ends(
    task: Task, normal: Normal, bounds: Mapping[str, tuple[float, float]], constraints: Sequence[Constraint]
) -> dict[str, tuple[float, float]]:
    """Least and greatest value of every unknown (m, rad): as asked, or what is usual."""
    caps = [c.length for c in constraints if isinstance(c, LargestLink)]
    function = isinstance(task, RockerFunction)
    cap = min(caps, default=LARGEST * (GROUND if function else normal.unit))
    # where a function is required, what is returned is what that function saw
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
    ends = {name: _ordered(name, bounds[name], usual[name]) if name in bounds else usual[name] for name in UNKNOWNS}
    for name in (*LINKS, "point_distance"):
        low, high = ends[name]
        if name in LINKS and high <= 0.0:
            raise ParameterError(f"bound of {name}", high, "be above zero (m): a link has a length")
        if caps and low > cap:
            raise InfeasibleError(
                f"{name} is to be at least {low:g} m, and no link longer than {cap:g} m: no linkage has both"
            )
        low, high = max(low, 1e-6 * cap if name in LINKS else 0.0), min(high, cap) if caps else high
        if low > high:
            raise InfeasibleError(f"{name} is to be at most {high:g} m: it is a distance and cannot be below {low:g} m")
        ends[name] = low, high
    return ends


def _required(constraint: Constraint, way: Way) -> tuple[Require, ...]:
    if isinstance(constraint, Demand):
        return constraint.requires(way)
    return (constraint,) if isinstance(constraint, Require) else ()


def _turning(constraints: Sequence[Constraint]) -> tuple[float | None, float | None, str | None]:
    """Least transmission angles over a turn and over the way of the task, and Grashof's type; see `Limits`."""
    turn, way = (
        max((c.angle for c in constraints if isinstance(c, LeastTransmission) and c.over == over), default=None)
        for over in ("turn", "task")
    )
    types: set[str] = {c.type for c in constraints if isinstance(c, Grashof)}
    demands = [c for c in constraints if isinstance(c, Demand)]
    types |= {c.grashof for c in demands if c.grashof is not None}
    if len(types) > 1:
        raise InfeasibleError(f"Grashof types {', '.join(sorted(types))} are asked for at once: a four-bar has one")
    type_ = types.pop() if types else None
    if turn is None and (any(isinstance(c, FullTurn) for c in constraints) or type_ in ("crank-rocker", "drag-link")):
        turn = 0.0
    if type_ in ("double-rocker", "rocker-crank", "triple-rocker"):
        if turn is not None:
            raise InfeasibleError(f"the crank of a {type_} does not turn fully, which another constraint asks for")
        # on its way it must stay joined all the same
        way = way or 0.0
    if turn is not None and any(c.stops for c in demands):
        raise InfeasibleError(
            "a crank that is to come to a toggle cannot turn fully, which another constraint asks for"
        )
    return turn, way, type_


def _ordered(name: str, ends: tuple[float | None, float | None], usual: tuple[float, float]) -> tuple[float, float]:
    """Bounds as given; an end that is None or infinite is the usual one."""
    try:
        low, high = (e if end is None or np.isinf(end) else float(end) for end, e in zip(ends, usual, strict=True))
    except (TypeError, ValueError):
        raise ParameterError(f"bounds of {name}", ends, "be two numbers, the least and the greatest value") from None
    if not np.isfinite([low, high]).all():
        raise ParameterError(f"bounds of {name}", ends, "be numbers, or None for an open end")
    if low > high:
        unit = "rad" if name in ANGLES else "m"
        raise InfeasibleError(f"{name} is to be at least {low:g} {unit} and at most {high:g} {unit}: no value is")
    return low, high


def _check_links(given: Mapping[str, tuple[float, float]], constraints: Sequence[Constraint], sliding: bool) -> None:
    """Make sure that bounds alone leave a linkage whose crank turns, where that is asked."""
    if not any(isinstance(c, FullTurn) or (isinstance(c, LeastTransmission) and c.over == "turn") for c in constraints):
        return
    l1, l2, l3, l4 = (given[name] for name in LINKS)
    # l1 + l2 <= l3 + l4 is needed for a full turn, of a slider-crank l1 + l2 <= l3
    least, most = l1[0] + l2[0], l3[1] + (0.0 if sliding else l4[1])
    if least > most:
        raise InfeasibleError(
            f"the crank cannot turn fully: {'offset' if sliding else 'ground link'} and crank are at least "
            f"{1e3 * least:.4g} mm together, {'the coupler' if sliding else 'coupler and rocker'} at most {1e3 * most:.4g} mm"
        )


def _check_reach(given: Mapping[str, tuple[float, float]], normal: Normal, constraints: Sequence[Constraint]) -> None:
    """Make sure that the coupler point, which stays within crank and point distance of the shaft, can span the target."""
    from shapely import MultiPoint, Polygon, box

    (left, right), (bottom, top) = given["pivot_x"], given["pivot_y"]
    room = box(left, bottom, right, top)
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
