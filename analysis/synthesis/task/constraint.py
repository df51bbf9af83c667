"""Define constraints on a linkage: transmission angle, full turn, size, regions, time ratio, pin forces, any function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isfinite, pi, radians
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError, ParameterError

from ...numerics import symbolic
from ...units import Amount, in_si, quantity
from ..linkage.kernels import PLACES
from ..linkage.linkage import Linkage
from ..linkage.machine import PINS, USUAL_MAKE, MachineSpec, pin_functions
from .task import Normal

FloatArray = NDArray[np.float64]
GrashofType = Literal["crank-rocker", "drag-link", "double-rocker", "rocker-crank", "triple-rocker"]
#: The unknowns of every linkage, in their order: `kernels.PLACES` and the output angle.
UNKNOWNS = (*PLACES, "output_angle")
#: Name of the additional dimension of a geared five-bar.
SECOND_LENGTH = "second_crank_length"
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
        Over a full turn, so that the crank can turn fully, or only during the task.
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
        Function of a namespace with the dimensions of `Linkage` by name (SI). It may use arithmetic and the elementary
        functions of `math` or NumPy, but no branches. The search traces the function with symbols, to differentiate it exactly.
    equal : bool
        Whether the function must be zero, instead of at most zero.
    name : str
        Name in messages.
    scale : float
        Magnitude of the function's values, by which a search divides them.
    unit : str
        Unit of the values in messages.
    symbolic : bool
        Whether the function accepts CasADi symbols and numbers without tracing; it may then have several values.
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


class RotationRange(NamedTuple):
    """Properties of a search on which a constraint depends: the crank rotations at which it must hold, and the linkages.

    Attributes
    ----------
    turn : bool
        Whether the crank turns fully, so that the constraint must hold over a full turn.
    rotation : ndarray or None
        The task's crank rotations, if it has any.
    straight : bool
        Whether the bounds fix the coupler point on the line of B and C.
    linkage : type
        Type of the linkages.
    """

    turn: bool
    rotation: FloatArray | None
    straight: bool = False
    linkage: type[Linkage] = Linkage

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

        The error message begins with ``what``, the thing that needs the rotations.
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
    #: Grashof type that the constraint requires.
    grashof: ClassVar[GrashofType | None] = None
    #: Whether the constraint excludes a full turn of the crank.
    stops: ClassVar[bool] = False
    #: Whether the constraint is an objective that replaces the error.
    seeks: ClassVar[bool] = False

    @property
    def excludes_rest(self) -> bool:
        """Return whether the constraint excludes dead centres, in which rocker or slider rest."""
        return False

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        """Return the functions of the dimensions that must be at most zero, or equal to zero."""
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

    least: float = 1.0
    greatest: float = inf

    def __post_init__(self) -> None:
        if not 1.0 <= self.least <= self.greatest:
            raise ParameterError("time ratio", (self.least, self.greatest), "be two numbers in order, 1 or greater")

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        """Return the functions of the dimensions that must be at most zero."""

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
#: Default constraints: a least transmission angle of 40 degrees over a full turn.
USUAL: tuple[Constraint, ...] = (LeastTransmission(),)


def _constraint_names() -> list[str]:
    """Return the class names of all constraints."""
    found, below = [kind.__name__ for kind in get_args(Constraint)[1:]], [Demand]
    while below:
        below = [kind for one in below for kind in one.__subclasses__()]
        found += [kind.__name__ for kind in below if not kind.__name__.startswith("_")]
    return list(dict.fromkeys(found))


@in_si(least="m", greatest="m")
@dataclass(frozen=True, slots=True, kw_only=True)
class Stroke:
    """Constraint: the crank of a slider-crank turns fully, and the stroke of its slider is within bounds.

    Attributes
    ----------
    least, greatest : float
        Bounds of the stroke (m).
    """

    least: Amount = 0.0
    greatest: Amount = inf

    def __post_init__(self) -> None:
        if not (0.0 <= self.least <= self.greatest and self.greatest > 0.0 and isfinite(self.least)):
            raise ParameterError("stroke", (self.least, self.greatest), "be two lengths in order (m)")

    def requires(self) -> tuple[Require, ...]:
        """Return the functions of the dimensions that must be at most zero."""
        found = []
        if self.least > 0.0:
            low = self.least
            found.append(Require(function=lambda d: low - stroke(d), name="least stroke", scale=low, unit="m"))
        if isfinite(self.greatest):
            high = self.greatest
            found.append(Require(function=lambda d: stroke(d) - high, name="greatest stroke", scale=high, unit="m"))
        return tuple(found)


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


def _slider_time_ratio(asked: TimeRatio) -> tuple[Require, ...]:
    """Return the constraints on the time ratio of a slider-crank, (pi + advance)/(pi - advance)."""
    low, high = (
        pi * (ratio - 1.0) / (ratio + 1.0) if isfinite(ratio) else pi for ratio in (asked.least, asked.greatest)
    )
    found = [Require(function=lambda d: low - advance(d), name="least time ratio")] if asked.least > 1.0 else []
    if isfinite(asked.greatest):
        found.append(Require(function=lambda d: advance(d) - high, name="greatest time ratio"))
    return tuple(found)


def _check_pins(pins: str) -> None:
    if not pins or not set(pins) <= set(PINS):
        raise ParameterError("pins", pins, "be some of the letters ABCD")


class _Forces(Demand):
    """Base class of the constraints on pin forces."""

    __slots__ = ()
    make: MachineSpec
    pins: str

    def pin_force_function(self, way: RotationRange) -> RotationRequirement:
        """Return a function of dimensions and crank rotations: the magnitudes of the pin forces (N), with a column per pin."""
        ends, turn = way.ends("a force on the pins"), way.turn

        def magnitudes(d: Any, rotation: Any) -> Any:
            casadi = symbolic.library()
            th2 = rotation if turn else rotation + d.crank_phase
            found = pin_functions(d, self.make, th2, straight=way.straight, linkage=way.linkage)
            # the added number keeps the slope of a zero force finite
            chosen = [found[pin] for pin in self.pins]
            return casadi.horzcat(*(casadi.sqrt(x * x + y * y + 1e-18) for x, y in chosen))

        return RotationRequirement(
            function=magnitudes,
            name="force on the pins",
            unit="N",
            rotation=even_rotations(ends),
            ends=search_range(ends),
            symbolic=True,
        )


@in_si(force="N")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MaxPinForce(_Forces):
    """Constraint: no pin force exceeds ``force``, over a turn of the crank or, if it need not turn fully, during the task.

    Attributes
    ----------
    force : float
        Greatest force (N).
    make : MachineSpec
        Masses, gravity, load, and the constant speed of the crank.
    pins : str
        Letters of the pins whose forces count, of "ABCD".
    """

    force: Amount
    make: MachineSpec = USUAL_MAKE
    pins: str = PINS

    def __post_init__(self) -> None:
        if not (isfinite(self.force) and self.force > 0.0):
            raise ParameterError("greatest pin force", self.force, "be a finite number greater than zero (N)")
        _check_pins(self.pins)

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        """Return the functions of dimensions and crank rotation that must be at most zero."""
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
    make : MachineSpec
        Masses, gravity, load, and the constant speed of the crank.
    pins : str
        Letters of the pins whose forces count, of "ABCD".
    """

    seeks: ClassVar[bool] = True

    error: Amount
    make: MachineSpec = USUAL_MAKE
    pins: str = PINS

    def __post_init__(self) -> None:
        _check_pins(self.pins)

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        """Return no required functions, since the pin force is the objective."""
        return ()

    def least_function(self, way: RotationRange, normal: Normal) -> MinimisedFunction:
        """Return the objective: minimise the greatest pin force while the greatest error is within its bound."""
        error = quantity(self.error, "rad" if normal.of_rocker else "m", "greatest error")
        if not (isfinite(error) and error > 0.0):
            raise ParameterError("greatest error", self.error, "be a finite number greater than zero")
        return MinimisedFunction(self.pin_force_function(way), error / normal.unit)


#: The constraints on pin forces.
FORCES = (MaxPinForce, LeastPinForce)
#: Number of rotations at which a `RotationRequirement` is bounded from the beginning.
GRID = 48
#: Rotation by which the search for peaks extends a full turn at either end (rad).
BEYOND = 0.02


# Rotations at which functions are bounded


def even_rotations(ends: tuple[float, float]) -> FloatArray:
    """Return evenly spaced rotations between two angles, without the end of a full turn (rad)."""
    return np.linspace(*ends, GRID, endpoint=ends[1] - ends[0] < 2.0 * pi)


def search_range(ends: tuple[float, float]) -> tuple[float, float]:
    """Return the range in which peaks are sought (rad): a full turn is extended a little to find a peak at its end."""
    over = BEYOND if ends[1] - ends[0] >= 2.0 * pi else 0.0
    return ends[0] - over, ends[1] + over
