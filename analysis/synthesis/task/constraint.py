"""Define constraints on a linkage: transmission angle, full turn, size, regions, time ratio, pin forces, any function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import cos, inf, isfinite, pi, radians
from types import SimpleNamespace
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError, ParameterError

from ...numerics import symbolic
from ...units import Amount, in_si, quantity
from ..linkage.kernels import PLACES
from ..linkage.linkage import Linkage, SliderCrank
from ..linkage.machine import PINS, USUAL_MAKE, MachineSpec, pin_functions
from .task import Normal

FloatArray = NDArray[np.float64]
GrashofType = Literal["crank-rocker", "drag-link", "double-rocker", "rocker-crank", "triple-rocker"]
#: The unknowns of every linkage, in their order: `kernels.PLACES` and the output angle.
UNKNOWNS = (*PLACES, "output_angle")
#: Name of the additional dimension of a geared five-bar.
SECOND_LENGTH = "second_crank_length"
#: Number of rotations at which a `RotationRequirement` is bounded from the beginning.
GRID = 48
#: Number of rotations at which a function is evaluated to find its greatest values.
DENSE = 721
#: Rotation by which the search for peaks extends a full turn at either end (rad).
BEYOND = 0.02
#: Two collinear links: one extends the other, or lies over it.
InLine = Literal["stretched", "folded"]
#: Least transmission angle at which a crank still counts as turning fully (rad).
TURNING = 0.002


class InfeasibleError(LinkworkError):
    """No linkage meets all bounds and constraints."""


#: Least transmission angle by default (rad).
_LEAST_TRANSMISSION = radians(40.0)


@in_si(angle="rad")
@dataclass(frozen=True, slots=True, kw_only=True)
class LeastTransmission:
    """Constraint: the transmission angle, between coupler and rocker, deviates from 0 and pi by at least ``angle``.

    Attributes
    ----------
    angle : float
        Least deviation (rad).
    over : "turn" or "task"
        Where the angle is bounded: over a full turn, so that the crank can turn fully, or only during the task.
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
    """Constraint: the crank can turn fully, with any transmission angle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Grashof:
    """Constraint: the four-bar has this Grashof type; see `Linkage.grashof`."""

    type: GrashofType

    def __post_init__(self) -> None:
        if self.type not in get_args(GrashofType):
            raise ParameterError("Grashof type", self.type, f"be one of {', '.join(get_args(GrashofType))}")


@in_si(length="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class LargestLink:
    """Constraint: no link is longer than ``length`` (m), and the coupler point is at most this far from B."""

    length: Amount

    def __post_init__(self) -> None:
        if not (isfinite(self.length) and self.length > 0.0):
            raise ParameterError("largest link", self.length, "be a finite number greater than zero (m)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Assembly:
    """Constraint: C lies to the left (``branch`` +1) or to the right (-1) of the line from B to D."""

    branch: int

    def __post_init__(self) -> None:
        if self.branch not in (1, -1):
            raise ParameterError("branch", self.branch, "be +1 or -1")


@in_si(polygon="m")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PivotRegion:
    """Constraint: a pivot lies inside a polygon, which need not be convex.

    Attributes
    ----------
    pivot : "A" or "D"
        The crank shaft A, or the other end D of the ground link.
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
        """Cut the region into triangles, counter-clockwise, each shape (3, 2)."""
        from shapely import Polygon, constrained_delaunay_triangles
        from shapely.geometry.polygon import orient

        triangles = constrained_delaunay_triangles(Polygon(self.polygon))
        return [np.array(orient(t).exterior.coords)[:3] for t in triangles.geoms]


def half_planes(triangle: FloatArray) -> FloatArray:
    """Return rows r with r . (x, y, 1) <= 0 inside a counter-clockwise triangle, shape (3, 3)."""
    rows = np.zeros((3, 3))
    for k in range(3):
        (x0, y0), (x1, y1) = triangle[k], triangle[(k + 1) % 3]
        length = float(np.hypot(x1 - x0, y1 - y0))
        rows[k] = (y1 - y0) / length, (x0 - x1) / length, (y0 * x1 - x0 * y1) / length
    return rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Require:
    """Constraint: a function of the dimensions is at most zero, or equal to zero.

    Attributes
    ----------
    function : callable
        Function of a namespace with the dimensions of `Linkage` by name (SI). The search calls it with CasADi's symbols, to
        differentiate it exactly: it may use arithmetic and elementary functions of NumPy, but no branches.
    equal : bool
        Whether the function must be zero, instead of at most zero.
    name : str
        Name in messages.
    scale : float
        Magnitude of the function's values, by which a search divides them.
    unit : str
        Unit of the values in messages.
    """

    function: Callable[..., Any]
    equal: bool = False
    name: str = "required function"
    scale: float = 1.0
    unit: str = ""

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ParameterError(self.name, self.function, "be a function of the dimensions")
        if not (isfinite(self.scale) and self.scale > 0.0):
            raise ParameterError(f"scale of {self.name}", self.scale, "be a finite number greater than zero")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RotationRequirement(Require):
    """Constraint: a function of dimensions and crank rotation is at most zero at given rotations, or over a range.

    Attributes
    ----------
    rotation : ndarray, shape (n,)
        Crank rotations at which the function is bounded from the beginning (rad). ``function(d, rotation)``, with the
        dimensions d, returns a matrix of n rows, one for each rotation.
    ends : (float, float) or None
        Range of rotations in which the peaks of the function are found and bounded as well; None if only the given rotations
        count.
    """

    rotation: FloatArray
    ends: tuple[float, float] | None = None

    @classmethod
    def between(cls, ends: tuple[float, float], **more: Any) -> RotationRequirement:
        """Return a requirement between two crank rotations (rad); ``more`` are the other fields, such as the function."""
        turn = ends[1] - ends[0] >= 2.0 * pi
        # beyond a full turn, to find a peak at its end
        over = BEYOND if turn else 0.0
        return cls(rotation=np.linspace(*ends, GRID, endpoint=not turn), ends=(ends[0] - over, ends[1] + over), **more)

    def find_peaks(self, values: SimpleNamespace, count: int) -> FloatArray:
        """Find the ``count`` highest peaks of the n values of the function over the crank rotation, for given dimensions.

        Returns
        -------
        ndarray, shape (count, 1 + n)
            A row for each peak, the highest first; the ends of the range count as peaks. The first column is the crank rotation
            (rad). Column 1 + i belongs to value i: it is -1/(2 f''), with the second derivative f'', if value i has this peak,
            else 0. Near the peak, where value i is f and its slope f', the height of the peak is f - f'^2/(2 f''). If there are
            fewer peaks, the first row is repeated.
        """
        assert self.ends is not None
        rotation = np.linspace(*self.ends, DENSE)
        columns = np.asarray(self.function(values, symbolic.library().DM(rotation))).reshape(DENSE, -1)
        step, none = rotation[1] - rotation[0], [0.0] * columns.shape[1]
        found: list[tuple[float, list[float]]] = []
        for n, row in enumerate(np.nan_to_num(columns, nan=-np.inf).T):
            inner = row[1:-1]
            for k in np.nonzero((inner >= row[:-2]) & (inner > row[2:]) & np.isfinite(row[:-2] + row[2:]))[0]:
                before, now, after = row[k : k + 3]
                # the vertex of the parabola through three values
                curved = 2.0 * now - before - after
                off = 0.5 * (after - before) / curved
                bends = [*none[:n], 0.5 * step**2 / curved, *none[n + 1 :]]
                found.append((now + 0.25 * off * (after - before), [rotation[k + 1] + off * step, *bends]))
            found += [(row[end], [rotation[end], *none]) for end in (0, -1)]
        places = [place for _, place in sorted(found, reverse=True)[:count]]
        return np.array(places + places[:1] * (count - len(places)))


class RotationRange(NamedTuple):
    """Properties of a search on which a constraint depends: the crank rotations at which it must hold, and the linkages."""

    turn: bool  # whether the crank turns fully, so that the constraint must hold over a full turn
    rotation: FloatArray | None  # the task's crank rotations, if it has any
    straight: bool = False  # whether the bounds fix the coupler point on the line of B and C
    linkage: type[Linkage] = Linkage
    of_slider: bool = False  # whether the coupler point is the pin of a slider-crank's slider

    def ends(self, what: str) -> tuple[float, float]:
        """Return the ends of the range in which a constraint must hold (rad): a turn, or the range of the task's rotations.

        Raises InputError if the crank does not turn fully and the task gives no rotations; ``what`` is the constraint's name in
        the message.
        """
        if self.turn:
            return 0.0, 2.0 * pi
        rotation = self.timed(f"{what}, where the crank need not turn fully,")
        return float(rotation.min()), float(rotation.max())

    def timed(self, what: str) -> FloatArray:
        """Return the task's crank rotations; raise InputError if it has none.

        The error message begins with ``what``, which names the constraint that needs the rotations.
        """
        if self.rotation is None:
            raise InputError(f"{what} needs crank rotations, and the task gives none")
        return self.rotation


class MinimisedFunction(NamedTuple):
    """An objective: the greatest value of ``along`` is minimised, while the greatest error is at most ``error``.

    The length unit of ``error`` is `Normal.unit`.
    """

    along: RotationRequirement
    error: float


class Demand:
    """A constraint that is expressed by functions of the dimensions that must be at most zero."""

    __slots__ = ()
    #: Grashof type that the constraint requires of a four-bar.
    grashof: ClassVar[GrashofType | None] = None
    #: Whether the crank must turn fully.
    turns: ClassVar[bool] = False
    #: Whether the constraint excludes a full turn of the crank.
    stops: ClassVar[bool] = False
    #: Whether the constraint is an objective that replaces the error.
    seeks: ClassVar[bool] = False

    @property
    def excludes_rest(self) -> bool:
        """Return whether the constraint excludes dead centres, in which rocker or slider rest."""
        return False

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        """Return the functions of the dimensions that must be at most zero, or zero, for the crank rotations ``way``."""
        raise NotImplementedError

    def least_function(self, way: RotationRange, normal: Normal) -> MinimisedFunction | None:
        """Return the function that the search minimises in place of the error; None if it minimises the error."""
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeRatio(Demand):
    """Constraint: the four-bar is a crank-rocker whose slow swing lasts ``least`` to ``greatest`` times the quick swing.

    For a slider-crank the constraint bounds the same ratio of the slider's two strokes.

    Attributes
    ----------
    least, greatest : float
        Bounds of the time ratio, which is at least 1.
    """

    grashof: ClassVar[GrashofType | None] = "crank-rocker"
    turns: ClassVar[bool] = True

    least: float = 1.0
    greatest: float = inf

    def __post_init__(self) -> None:
        if not 1.0 <= self.least <= self.greatest:
            raise ParameterError("time ratio", (self.least, self.greatest), "be two numbers in order, 1 or greater")

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        low, high = crank_advance(self.least), crank_advance(self.greatest)
        if way.linkage is SliderCrank:
            below, above = (lambda d: low - advance(d)), (lambda d: advance(d) - high)
        else:
            below, above = (lambda d: low**2 - swing_advance(d) ** 2), (lambda d: swing_advance(d) ** 2 - high**2)
        found = [Require(function=below, name="least time ratio")] if self.least > 1.0 else []
        return (*found, *([Require(function=above, name="greatest time ratio")] if isfinite(self.greatest) else []))


def crank_advance(ratio: float) -> float:
    """Return the crank rotation during the slow part of a turn minus half a turn (rad), for a time ratio."""
    return pi * (ratio - 1.0) / (ratio + 1.0) if isfinite(ratio) else pi


def swing_advance(d: Any) -> Any:
    """Return plus or minus the `crank_advance` of a crank-rocker with the dimensions d, which may be numbers or symbols."""
    l1, l2, l3, l4 = d.ground_length, d.crank_length, d.coupler_length, d.rocker_length
    # directions of C from A with crank and coupler in line, by the law of cosines
    stretched, folded = ((l1**2 + r**2 - l4**2) / (2.0 * l1 * r) for r in (l3 + l2, l3 - l2))
    angles = [np.arctan2(np.sqrt(np.maximum(1.0 - c**2, 1e-12)), c) for c in (stretched, folded)]
    return angles[1] - angles[0]


@in_si(least="m", greatest="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class Stroke(Demand):
    """Constraint: the crank of a slider-crank turns fully, and the stroke of its slider is within bounds.

    Attributes
    ----------
    least, greatest : float
        Bounds of the stroke (m).
    """

    turns: ClassVar[bool] = True

    least: Amount = 0.0
    greatest: Amount = inf

    def __post_init__(self) -> None:
        if not (0.0 <= self.least <= self.greatest and self.greatest > 0.0 and isfinite(self.least)):
            raise ParameterError("stroke", (self.least, self.greatest), "be two lengths in order (m)")

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        low, high = self.least, self.greatest
        least = Require(function=lambda d: low - stroke(d), name="least stroke", scale=low or 1.0, unit="m")
        if not isfinite(high):
            return (least,) if low > 0.0 else ()
        greatest = Require(function=lambda d: stroke(d) - high, name="greatest stroke", scale=high, unit="m")
        return (least, greatest) if low > 0.0 else (greatest,)


Constraint = Demand | LeastTransmission | FullTurn | Grashof | LargestLink | Assembly | PivotRegion | Require
#: Default constraints: a least transmission angle of 40 degrees over a full turn.
USUAL: tuple[Constraint, ...] = (LeastTransmission(),)


def stroke(d: Any) -> Any:
    """Return the stroke of a slider-crank (m) with the dimensions d, which may be numbers or symbols."""
    l1, l2, l3 = d.ground_length, d.crank_length, d.coupler_length
    ends = [np.sqrt(np.maximum((l3 + side * l2) ** 2 - l1**2, 1e-18)) for side in (1.0, -1.0)]
    return ends[0] - ends[1]


def advance(d: Any) -> Any:
    """Return by how much the crank rotation during the slow stroke of a slider-crank exceeds half a turn (rad).

    The dimensions d may be numbers or symbols.
    """
    l1, l2, l3 = d.ground_length, d.crank_length, d.coupler_length
    angles = [np.arctan2(np.sqrt(np.maximum((l3 + side * l2) ** 2 - l1**2, 1e-18)), l1) for side in (1.0, -1.0)]
    return angles[0] - angles[1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Forces(Demand):
    """Base class of the constraints on pin forces; ``pins`` has the letters of the pins whose forces count, of "ABCD".

    ``make`` has masses, gravity, load, and the constant speed of the crank.
    """

    make: MachineSpec = USUAL_MAKE
    pins: str = PINS

    def __post_init__(self) -> None:
        if not self.pins or not set(self.pins) <= set(PINS):
            raise ParameterError("pins", self.pins, "be some of the letters ABCD")

    def pin_force_function(self, way: RotationRange) -> RotationRequirement:
        """Return a function of dimensions and crank rotations: the magnitudes of the pin forces (N), with a column per pin."""
        ends, turn = way.ends("a force on the pins"), way.turn

        def magnitudes(d: Any, rotation: Any) -> Any:
            casadi = symbolic.library()
            th2 = rotation if turn else rotation + d.crank_phase
            found = pin_functions(
                d, self.make, th2, straight=way.straight, linkage=way.linkage, on_slider=way.of_slider
            )
            # the added number keeps the slope of a zero force finite
            chosen = [found[pin] for pin in self.pins]
            return casadi.horzcat(*(casadi.sqrt(x * x + y * y + 1e-18) for x, y in chosen))

        return RotationRequirement.between(ends, function=magnitudes, name="force on the pins", unit="N")


@in_si(force="N")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MaxPinForce(_Forces):
    """Constraint: no pin force exceeds ``force``, over a turn or, if the crank need not turn fully, during the task.

    Attributes
    ----------
    force : float
        Greatest force (N).
    make, pins
        Masses, gravity, load and speed; letters of the pins whose forces count, of "ABCD".
    """

    force: Amount

    def __post_init__(self) -> None:
        if not (isfinite(self.force) and self.force > 0.0):
            raise ParameterError("greatest pin force", self.force, "be a finite number greater than zero (N)")
        _Forces.__post_init__(self)

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        forces = self.pin_force_function(way)

        def excess(d: Any, rotation: Any) -> Any:
            return forces.function(d, rotation) - self.force

        return (replace(forces, function=excess, scale=self.force),)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeastPinForce(_Forces):
    """Objective: minimise the greatest pin force while the greatest error is at most ``error``.

    Attributes
    ----------
    error : float or str
        Bound of the greatest error, as defined by the objective "worst" (m; for a rocker function rad).
    make, pins
        Masses, gravity, load and speed; letters of the pins whose forces count, of "ABCD".
    """

    seeks: ClassVar[bool] = True

    error: Amount

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        return ()

    def least_function(self, way: RotationRange, normal: Normal) -> MinimisedFunction:
        error = quantity(self.error, "rad" if normal.of_rocker else "m", "greatest error")
        if not (isfinite(error) and error > 0.0):
            raise ParameterError("greatest error", self.error, "be a finite number greater than zero")
        return MinimisedFunction(self.pin_force_function(way), error / normal.unit)


#: The constraints on pin forces.
FORCES = (MaxPinForce, LeastPinForce)


# Limit positions and mechanical advantage


def _rotations(value: Any, name: str, longest: float = 2.0 * pi) -> tuple[float, float]:
    """Return the ends of a range of crank rotations (rad) from two numbers, or from one number for both ends.

    Raises ParameterError if the range is longer than ``longest``.
    """
    try:
        low, high = (float(end) for end in (value if isinstance(value, tuple | list) else (value, value)))
    except (TypeError, ValueError):
        raise ParameterError(name, value, "be a crank rotation, or the two ends of a range (rad)") from None
    if not (isfinite(low) and isfinite(high) and low <= high < low + longest):
        raise ParameterError(name, value, f"be crank rotations in order, less than {longest:.4g} rad apart")
    return low, high


@in_si(at="rad")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MechanicalAdvantage(Demand):
    """Constraint: the magnitude of the mechanical advantage is within bounds; see `mechanical_advantage`.

    Attributes
    ----------
    least, greatest : float
        Bounds of the magnitude.
    at : array_like, optional
        Crank rotations at which the bounds hold (rad). By default they hold everywhere: over a turn or, if the crank need not
        turn fully, from the first to the last of the task's rotations.
    """

    least: float = 0.0
    greatest: float = inf
    at: Any = None

    def __post_init__(self) -> None:
        if not (0.0 <= self.least <= self.greatest and isfinite(self.least) and self.greatest > 0.0):
            raise ParameterError(
                "mechanical advantage", (self.least, self.greatest), "be two numbers in order, 0 or above"
            )
        if self.at is not None:
            at = np.atleast_1d(np.asarray(self.at, dtype=float))
            if at.ndim != 1 or not len(at) or not np.isfinite(at).all():
                raise ParameterError("rotations of the mechanical advantage", self.at, "be finite numbers (rad)")
            object.__setattr__(self, "at", at)

    @property
    def excludes_rest(self) -> bool:
        """Return whether the greatest advantage is bounded everywhere: in a dead centre the advantage is infinite."""
        return self.at is None and isfinite(self.greatest)

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        made: Callable[..., RotationRequirement]
        if self.at is None:
            made, turn = partial(RotationRequirement.between, way.ends("mechanical advantage")), way.turn
        else:
            way.timed("mechanical advantage at crank rotations")
            made, turn = partial(RotationRequirement, rotation=self.at), False

        def speed(d: Any, rotation: Any) -> Any:
            casadi = symbolic.library()
            th2 = rotation if turn else rotation + d.crank_phase
            c2, s2 = casadi.cos(th2), casadi.sin(th2)
            l2, l3, l4 = d.crank_length, d.coupler_length, d.rocker_length
            g = way.linkage.closure()(c2, s2, d.ground_length - l2 * c2, -l2 * s2, l3, l4, d.branch)
            return way.linkage.driven_speed(g, l2, l3, l4)

        def slow(d: Any, rotation: Any) -> Any:
            both = self.least * speed(d, rotation)
            return symbolic.library().horzcat(both - 1.0, -both - 1.0)

        def fast(d: Any, rotation: Any) -> Any:
            return 1.0 - (self.greatest * speed(d, rotation)) ** 2

        asked = {"least": (slow, self.least > 0.0), "greatest": (fast, isfinite(self.greatest))}
        return tuple(
            made(function=f, name=f"{which} mechanical advantage") for which, (f, wanted) in asked.items() if wanted
        )


@in_si(at="rad")
@dataclass(frozen=True, slots=True, kw_only=True)
class _LimitPosition(Demand):
    """Base class of `DeadCentre` and `Toggle`, which describe its attributes."""

    _name: ClassVar[str]

    at: Amount
    position: InLine = "stretched"

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", _rotations(self.at, f"rotation of a {self._name}", pi))
        if self.position not in get_args(InLine):
            raise ParameterError("position", self.position, f"be one of {', '.join(get_args(InLine))}")

    def _require(self, function: Callable[[Any], Any], *, equal: bool = False) -> Require:
        return Require(function=function, equal=equal, name=f"{self.position} {self._name}")

    def _require_sign_change(self, way: RotationRange, distance: Callable[[Any, float], Any]) -> tuple[Require, ...]:
        """Return constraints by which ``distance`` has a zero, the limit position, within the range: its sign changes there."""
        way.timed(f"a {self._name} at crank rotations")
        low, high = self.at
        if low == high:
            return (self._require(lambda d: distance(d, low), equal=True),)
        return (self._require(lambda d: distance(d, low) * distance(d, high)),)


class DeadCentre(_LimitPosition):
    """Constraint: a dead centre, with crank and coupler collinear, is at a crank rotation or within a range of rotations.

    Attributes
    ----------
    at : float or (float, float)
        Crank rotation, or range of crank rotations, counted as in the task (rad).
    position : "stretched" or "folded"
        The coupler extends the crank, or lies over it.
    """

    __slots__ = ()
    _name: ClassVar[str] = "dead centre"

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        stretched = self.position == "stretched"

        def closes(d: Any, rotation: float) -> Any:
            reach = d.coupler_length + d.crank_length if stretched else d.coupler_length - d.crank_length
            # A -> C points along the crank, or against it
            c = symbolic.library().cos(rotation + d.crank_phase) * (1.0 if stretched else -1.0)
            return way.linkage.dead_gap(d, reach, c)

        def opposite(d: Any, rotation: float) -> Any:
            s = symbolic.library().sin(rotation + d.crank_phase)
            return -d.branch * s if stretched else d.branch * s

        sides = [self._require(partial(opposite, rotation=end)) for end in dict.fromkeys(self.at)]
        return (*self._require_sign_change(way, closes), *sides)


class Toggle(_LimitPosition):
    """Constraint, as `DeadCentre`: a toggle, in which the crank can turn no further, is at one rotation or in a range.

    In a slider-crank's toggle the coupler is perpendicular to the guide and points away from A, or towards it.

    Attributes
    ----------
    position : "stretched" or "folded"
        The coupler extends the rocker, or lies over it.
    at : float or (float, float)
        Crank rotation, or range of crank rotations, as of a dead centre (rad).
    """

    __slots__ = ()
    _name: ClassVar[str] = "toggle"
    stops: ClassVar[bool] = True

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        def closes(d: Any, rotation: float) -> Any:
            c = symbolic.library().cos(rotation + d.crank_phase)
            return way.linkage.toggle_gap(d, c, 1.0 if self.position == "stretched" else -1.0)

        return self._require_sign_change(way, closes)


@in_si(between="rad")
@dataclass(frozen=True, slots=True, kw_only=True)
class NoToggle(Demand):
    """Constraint: there is no toggle between two crank rotations, and the links stay joined.

    Attributes
    ----------
    between : (float, float)
        Crank rotations, counted as in the task (rad).
    """

    between: tuple[Amount, Amount]

    def __post_init__(self) -> None:
        object.__setattr__(self, "between", _rotations(self.between, "rotations without a toggle"))

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        way.timed("a range of crank rotations without a toggle")

        def excess(d: Any, rotation: Any) -> Any:
            casadi, kind, cosine = symbolic.library(), way.linkage, cos(TURNING)
            th2, l2, l3, l4 = rotation + d.crank_phase, d.crank_length, d.coupler_length, d.rocker_length
            square = kind.square(d.ground_length - l2 * casadi.cos(th2), l2 * casadi.sin(th2))
            both = kind.transmission_excess(l3, l4, square, square, cosine)
            return casadi.horzcat(*both) / kind.excess_slope(l3, l4, cosine)

        return (RotationRequirement.between(self.between, function=excess, name="range without a toggle"),)
