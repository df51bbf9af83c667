"""Define planar linkages: the four-bar of the thesis's chapter VI, the slider-crank, and the five-bar with two cranks.

Each linkage is a class; the search, the report and the drawing use its methods.

The coupler point is, with the thesis's symbols (appendix 5),

    x = X0 + l2 cos(th2 + a1) + r cos(th3 + a1 + a2),   y alike with sines,   th2 = phi + th20,

where phi is the crank's rotation from the start of the motion. Equation (6.17) as printed drops a1 in the second term.
Angles th2, th3, th4 are measured from the ground link, as in the five-bar model; a1 rotates the whole linkage. `kernels`
evaluates loop closure and derivatives. A slider-crank is a four-bar whose rocker pivot lies at infinity: it has no rocker, its
ground link is the perpendicular from the crank shaft to the guide of C, and l1 is the offset.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from math import cos, isfinite, pi, sin
from types import MappingProxyType, SimpleNamespace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, ParameterError
from linkwork.five_bar import kinematics

from ...mechanisms import FIVE_BAR
from ...numerics.fourier import FourierSeries
from ...run import symbolic_equations
from ...units import in_si
from .kernels import PLACES, close_slider_crank, coupler_path, coupler_path_jacobian, link_directions, link_jacobian

FloatArray = NDArray[np.float64]
#: Names of the dimensions: links, which are greater than zero; all lengths; angles.
LINKS = ("ground_length", "crank_length", "coupler_length", "rocker_length")
LENGTHS = ("pivot_x", "pivot_y", *LINKS, "point_distance")
ANGLES = ("ground_angle", "crank_phase", "point_angle", "output_angle")
#: SI unit of each dimension.
UNITS: Mapping[str, str] = MappingProxyType(dict.fromkeys(LENGTHS, "m") | dict.fromkeys(ANGLES, "rad"))
#: Grashof type of a four-bar with a link that can turn fully, if the shortest link is the first, second, ... of `LINKS`.
BY_SHORTEST = ("drag-link", "crank-rocker", "double-rocker", "rocker-crank")
#: Number of crank rotations at which a full turn is evaluated.
TURN = 360


def wrap_angles(angle: FloatArray) -> FloatArray:
    """Wrap angles (rad) to [-pi, pi)."""
    return (angle + pi) % (2.0 * pi) - pi


#: The kinds of linkages; a kind need not be one of the mechanisms that can be simulated.
Kind = Literal["four-bar", "slider-crank", "geared-five-bar"]
#: Greatest number of turns of either crank per period of a geared five-bar.
TEETH = 6


@dataclass(frozen=True, slots=True, eq=False)
class SliderMotion:
    """Motion of the rocker pivot D along a guide: a Fourier series of the crank's rotation phi.

    Attributes
    ----------
    series : FourierSeries
        Position u(phi) on the guide from the end E of the ground link (m); its order is the number of harmonics.
    guide_angle : float
        alpha, the guide's direction from the ground link (rad).

    Raises
    ------
    ParameterError
        If the guide's angle is not finite.
    """

    series: FourierSeries
    guide_angle: float = 0.0

    def __post_init__(self) -> None:
        if not isfinite(self.guide_angle):
            raise ParameterError("guide_angle", self.guide_angle, "be a finite number")

    def displacement(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return x and y of D from the end E of the ground link, in the frame of that link (m)."""
        u = self.series(rotation)
        return u * cos(self.guide_angle), u * sin(self.guide_angle)

    @property
    def stroke(self) -> float:
        """Return the distance between the ends of the slider's travel (m)."""
        return float(np.ptp(self.series(np.linspace(0.0, 2.0 * pi, 1440, endpoint=False))))


def gear_turns(ratio: float) -> tuple[int, int]:
    """Return the least whole numbers k and m: the first crank turns k times while the second crank turns m times.

    The quotient m/k is the ratio.

    Raises ParameterError if the ratio is neither zero nor a quotient of whole numbers up to six.
    """
    if isfinite(ratio):
        near = Fraction(ratio).limit_denominator(TEETH)
        if abs(near - Fraction(ratio)) <= 1e-9 and abs(near.numerator) <= TEETH:
            return near.denominator, near.numerator
    raise ParameterError("ratio of the second crank", ratio, f"be a ratio of whole numbers up to {TEETH}")


def format_ratio(ratio: float) -> str:
    """Format a gear ratio, as in "2", "-1" or "1/2"."""
    return str(Fraction(ratio).limit_denominator(TEETH))


@dataclass(frozen=True, slots=True, eq=False)
class SecondCrank:
    """Motion of the rocker pivot D of a five-bar: on a second crank, geared to the first or turned independently.

    D = E + l5 exp(i psi) about the end E of the ground link, with psi = m phi + phase + series(phi), where m/k is the ratio.
    The input shaft, with the rotation phi, turns once per period of the linkage, in which the first crank turns k times.

    Attributes
    ----------
    length : float
        l5 (m).
    ratio : float
        Turns of the second crank per turn of the first: a quotient of whole numbers up to six.
    phase : float
        psi at phi = 0, without the series (rad).
    series : FourierSeries
        Rotation that is added to the rotation by the gears, a function of phi (rad); zero if gears alone turn the crank.

    Raises
    ------
    ParameterError
        If the length is not greater than zero, the ratio is not a quotient as above, or the phase is not finite.
    """

    length: float
    ratio: float = 1.0
    phase: float = 0.0
    series: FourierSeries = field(default_factory=lambda: FourierSeries.constant(0.0))

    def __post_init__(self) -> None:
        if not (isfinite(self.length) and self.length > 0.0):
            raise ParameterError("second_crank_length", self.length, "be a finite number greater than zero")
        gear_turns(self.ratio)
        if not isfinite(self.phase):
            raise ParameterError("second_crank_phase", self.phase, "be a finite number")

    def angle(self, rotation: ArrayLike) -> FloatArray:
        """Return psi, the angle of the second crank (rad)."""
        phi = np.asarray(rotation, dtype=float)
        return gear_turns(self.ratio)[1] * phi + self.phase + self.series(phi)

    def displacement(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return x and y of D from the end E of the ground link, in the frame of that link (m)."""
        psi = self.angle(rotation)
        return self.length * np.cos(psi), self.length * np.sin(psi)


@in_si(**UNITS)
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linkage:
    """A four-bar with a coupler point, placed in the plane; see also `SliderCrank` and `FiveBar`.

    Lengths in m, angles in rad.

    Attributes
    ----------
    pivot_x, pivot_y : float
        X0, Y0: the crank shaft A.
    ground_length, crank_length, coupler_length, rocker_length : float
        l1 ... l4.
    point_distance, point_angle : float
        r and a2: distance of the coupler point P from the crank pin B, and angle from B -> C to B -> P.
    ground_angle : float
        a1: direction of the ground link, from A to the rocker pivot.
    crank_phase : float
        th20: crank angle from the ground link at the start of the motion.
    output_angle : float
        Mounting angle of the output pointer on the rocker, or of the body on the coupler, relative to the link's direction.
    branch : int
        Assembly: +1 with C to the left of B -> D, -1 to the right.
    pivot : SliderMotion, optional
        Motion of the rocker pivot; None for a fixed pivot.

    Raises
    ------
    ParameterError
        If a value is not finite, a link is not longer than zero, the branch is not +1 or -1, or the pivot has a wrong type.
    """

    kind: ClassVar[Kind] = "four-bar"
    #: Links that must be longer than zero.
    links: ClassVar[tuple[str, ...]] = LINKS
    #: Types of the motion of the rocker pivot.
    pivots: ClassVar[tuple[type, ...]] = (SliderMotion, type(None))
    #: Words for reports: the driven link, its motions, and the meaning of its mechanical advantage.
    driven: ClassVar[tuple[str, str, str]] = ("rocker", "swings", "torque on the rocker per torque on the crank")
    #: Bars of a drawing as (layer, letters of the two pins); letters of the pins that are labelled.
    bars: ClassVar[tuple[tuple[str, str], ...]] = (("ground", "AE"), ("crank", "AB"), ("rocker", "DC"))
    letters: ClassVar[str] = "ABCD"

    pivot_x: float = 0.0
    pivot_y: float = 0.0
    ground_length: float
    crank_length: float
    coupler_length: float
    rocker_length: float
    point_distance: float = 0.0
    ground_angle: float = 0.0
    crank_phase: float = 0.0
    point_angle: float = 0.0
    output_angle: float = 0.0
    branch: int = 1
    pivot: SliderMotion | SecondCrank | None = None

    def __post_init__(self) -> None:
        for name in (*LENGTHS, *ANGLES):
            value = float(getattr(self, name))
            if not isfinite(value):
                raise ParameterError(name, value, "be a finite number")
            if name in self.links and value <= 0.0:
                raise ParameterError(name, value, "be greater than zero")
            object.__setattr__(self, name, value)
        if not isinstance(self.pivot, self.pivots):
            raise ParameterError("pivot", self.pivot, f"be None or a motion that a {self.kind} can have")
        if self.branch not in (1, -1):
            raise ParameterError("branch", self.branch, "be +1 or -1")

    @property
    def point_is_pin(self) -> bool:
        """Return whether the coupler point is the pin C of a slider."""
        return False

    @property
    def absent_dimensions(self) -> tuple[str, ...]:
        """Return the names of the dimensions that this type of linkage does not have."""
        return ()

    @property
    def turns(self) -> int:
        """Return the number of turns of the crank per turn of the input shaft: more than 1 with gear ratios such as 1/2."""
        return 1

    def crank_angle(self, rotation: ArrayLike) -> FloatArray:
        """Return th2, the crank angle from the ground link, at rotations of the input shaft (rad)."""
        return self.turns * np.asarray(rotation, dtype=float) + self.crank_phase

    @classmethod
    def from_vector(cls, q: ArrayLike, branch: int = 1, **more: Any) -> Linkage:
        """Build a linkage from its parameters in the order of `kernels.PLACES`; an eleventh value is the output angle.

        ``more`` are further fields, such as the pivot.
        """
        values = dict(zip((*PLACES, "output_angle"), np.asarray(q, dtype=float).tolist()))
        own = {f.name for f in fields(cls) if f.init}
        return cls(**{name: value for name, value in values.items() if name in own}, branch=branch, **more)

    @property
    def vector(self) -> FloatArray:
        """Return the ten parameters in the order of `kernels.PLACES`."""
        return np.array([getattr(self, name) for name in PLACES])

    def values(self) -> dict[str, float]:
        """Return the dimensions (m, rad) and the branch by name, without the pivot's motion."""
        return {name: getattr(self, name) for name in (*LENGTHS, *ANGLES)} | {"branch": self.branch}

    @property
    def largest_link(self) -> float:
        """Return the length of the longest link (m)."""
        return max(abs(self.ground_length), self.crank_length, self.coupler_length, self.rocker_length)

    def displacement(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the displacement of the rocker pivot from the end of the ground link, in the frame of that link (m)."""
        if self.pivot is None:
            zero = np.zeros(np.shape(rotation))
            return zero, zero
        return self.pivot.displacement(rotation)

    def _arguments(
        self, rotation: ArrayLike, displacement: tuple[ArrayLike, ArrayLike] | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, float]:
        phi = np.ascontiguousarray(rotation, dtype=float)
        dx, dy = (np.ascontiguousarray(d, dtype=float) for d in displacement or self.displacement(phi))
        turned = self.turns * phi
        return np.cos(turned), np.sin(turned), dx, dy, self.vector, float(self.branch)

    def path(self, rotation: ArrayLike, displacement: tuple[ArrayLike, ArrayLike] | None = None) -> FloatArray:
        """Return the coupler point at crank rotations, shape (n, 2) in m; NaN if the links cannot be joined.

        A given ``displacement`` of the rocker pivot (m) replaces the pivot's own motion.
        """
        out = np.empty((2, np.size(rotation)))
        coupler_path(*self._arguments(rotation, displacement), out)
        return out.T

    def path_jacobian(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the coupler point (n, 2) in m, and its derivatives with respect to `kernels.COLUMNS`, shape (12, 2, n)."""
        n = np.size(rotation)
        out, jacobian = np.empty((2, n)), np.empty((12, 2, n))
        coupler_path_jacobian(*self._arguments(rotation), out, jacobian)
        return out.T, jacobian

    def link_jacobian(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the angles of coupler and rocker from the ground link (2, n), and their derivatives, (12, 2, n)."""
        n = np.size(rotation)
        out, jacobian = np.empty((2, n)), np.empty((12, 2, n))
        link_jacobian(*self._arguments(rotation), out, jacobian)
        return out, jacobian

    def directions(self, rotation: ArrayLike) -> FloatArray:
        """Return cosine and sine of th3, of th4 and of th4 - th3, shape (6, n); angles from the ground link."""
        out = np.empty((6, np.size(rotation)))
        link_directions(*self._arguments(rotation), out)
        return out

    def coupler_angle(self, rotation: ArrayLike) -> FloatArray:
        """Return the direction of the coupler in the plane plus the output angle (rad), continuous over the rotations."""
        g = self.directions(rotation)
        return np.unwrap(np.arctan2(g[1], g[0])) + self.ground_angle + self.output_angle

    def rocker_angle(self, rotation: ArrayLike) -> FloatArray:
        """Return the rocker's angle th4 from the ground link plus the output angle (rad), continuous over the rotations."""
        g = self.directions(rotation)
        return np.unwrap(np.arctan2(g[3], g[2])) + self.output_angle

    def slider(self, rotation: ArrayLike) -> tuple[FloatArray, float] | None:
        """Return the position of the slider on its guide from E (m), and the guide's direction from the ground link (rad).

        The result is None for a linkage without a slider.
        """
        return (self.pivot.series(rotation), self.pivot.guide_angle) if isinstance(self.pivot, SliderMotion) else None

    def transmission(self, rotation: ArrayLike) -> FloatArray:
        """Return the acute angle between coupler and rocker (rad), 0 at the limit of assembly, NaN beyond."""
        g = self.directions(rotation)
        return np.arctan2(np.abs(g[5]), np.abs(g[4]))

    def pins(self, rotation: float) -> dict[str, tuple[float, float]]:
        """Return the positions of A, B, C, D, the end E of the ground link, and P in the plane (m) at one crank rotation.

        For a slider-crank D is the slider, at C.

        Raises AssemblyError if the links cannot be joined there.
        """
        g = self.directions([rotation])[:, 0]
        if not np.isfinite(g).all():
            raise AssemblyError(f"the links cannot be joined at a crank rotation of {rotation:.6g} rad")
        turn = np.exp(1j * self.ground_angle)
        a = complex(self.pivot_x, self.pivot_y)
        dx, dy = (float(d[0]) for d in self.displacement([rotation]))
        b = a + turn * self.crank_length * np.exp(1j * self.crank_angle(rotation))
        coupler = turn * complex(g[0], g[1])
        places = {
            "A": a,
            "B": b,
            "C": b + self.coupler_length * coupler,
            "D": a + turn * complex(self.ground_length + dx, dy),
            "E": a + turn * self.ground_length,
            "P": b + self.point_distance * np.exp(1j * self.point_angle) * coupler,
        }
        return {name: (float(z.real), float(z.imag)) for name, z in places.items()}

    def with_pivot(self, pivot: SliderMotion | SecondCrank | None) -> Linkage:
        """Return the linkage with another motion of its rocker pivot: a five-bar for a second crank, otherwise a four-bar."""
        made: Callable[..., Linkage] = FiveBar if isinstance(pivot, SecondCrank) else Linkage
        return made(**self.values(), pivot=pivot)

    def translate(self, x: float, y: float) -> Linkage:
        """Return the linkage shifted by (x, y) in the plane (m)."""
        return replace(self, pivot_x=self.pivot_x + x, pivot_y=self.pivot_y + y)

    @property
    def grashof(self) -> str:
        """Return the type of the four-bar by Grashof's criterion, with the rocker pivot at the end of the ground link.

        One of crank-rocker, drag-link (both turn), double-rocker (the coupler turns), rocker-crank (the rocker turns, the crank
        does not), triple-rocker, change-point; "slider-crank" for a slider-crank.
        """
        if self.links != LINKS:
            return self.kind
        lengths = [getattr(self, name) for name in LINKS]
        excess = 2.0 * (min(lengths) + max(lengths)) - sum(lengths)
        if abs(excess) <= 1e-12 * sum(lengths):
            return "change-point"
        return "triple-rocker" if excess > 0.0 else BY_SHORTEST[lengths.index(min(lengths))]

    @property
    def title(self) -> str:
        """Return Grashof's type; for a moving pivot, where the criterion does not hold, "four-bar with a moved pivot"."""
        return self.grashof if self.pivot is None else "four-bar with a moved pivot"

    def reach(self, rotation: ArrayLike) -> FloatArray:
        """Return the distance from B to D; for a slider-crank the distance from B to the guide (m)."""
        dx, dy = self.displacement(rotation)
        th2 = self.crank_angle(rotation)
        along = self.ground_length + dx - self.crank_length * np.cos(th2)
        return self.distance(along, dy - self.crank_length * np.sin(th2))

    @staticmethod
    def distance(along: Any, across: Any) -> Any:
        """Return `reach` from the components of B -> D along the ground link and across it."""
        return np.hypot(along, across)

    @staticmethod
    def closure() -> Callable[..., Any]:
        """Return the function that closes the loop, also for CasADi symbols.

        For a four-bar it is `close_loop` of the five-bar model; `SliderCrank` has its own.
        """
        return symbolic_equations(FIVE_BAR).close_loop

    @staticmethod
    def square(along: Any, across: Any) -> Any:
        """Return the square of `distance`, also for CasADi symbols."""
        return along * along + across * across

    @staticmethod
    def transmission_excess(l3: Any, l4: Any, nearest: Any, farthest: Any, cosine: Any) -> tuple[Any, ...]:
        """Return the values g of constraints g <= 0 that bound ``|cos mu|`` by ``cosine``; mu is the transmission angle at C.

        ``nearest`` and ``farthest`` are the squares of the least and the greatest `reach`. The arguments are numbers, arrays
        or symbols.
        """
        joint, product = l3 * l3 + l4 * l4, 2.0 * l3 * l4 * cosine
        return joint - nearest - product, farthest - joint - product

    @staticmethod
    def excess_slope(l3: Any, l4: Any, cosine: Any) -> Any:
        """Return minus the derivative of `transmission_excess` with respect to ``cosine``."""
        return 2.0 * l3 * l4

    @staticmethod
    def slack(l1: Any, l2: Any, cosine: Any) -> Any:
        """Return a bound on the change of `square` when the crank turns from a position in which `square` is extreme.

        ``cosine`` is the cosine of this rotation of the crank. For a four-bar the bound is exact.
        """
        return 2.0 * l1 * l2 * (1.0 - cosine)

    @staticmethod
    def dead_gap(d: Any, reach: Any, c: Any) -> Any:
        """Return a value that is zero in a dead centre: the closure error of the triangle A, C, D, also for CasADi symbols.

        ``reach`` is the distance AC, ``c`` the cosine of the angle at A, ``d`` has the dimensions.
        """
        l1, l3, l4 = d.ground_length, d.coupler_length, d.rocker_length
        return (l1**2 + reach**2 - l4**2 - 2.0 * l1 * reach * c) / (l1**2 + l3**2)

    @staticmethod
    def toggle_gap(d: Any, c: Any, side: float) -> Any:
        """Return a value that is zero in a toggle; c is the cosine of the crank angle, side 1 for stretched, -1 for folded."""
        l1, l2, l3, l4 = d.ground_length, d.crank_length, d.coupler_length, d.rocker_length
        reach = l3 + l4 if side > 0.0 else l3 - l4
        return (l1**2 + l2**2 - 2.0 * l1 * l2 * c - reach**2) / (l1**2 + l3**2)

    @staticmethod
    def driven_speed(g: Any, l2: Any, l3: Any, l4: Any) -> Any:
        """Return the speed of the rocker divided by that of the crank; ``g`` is the position of the closed loop.

        For a slider-crank it is the speed of the slider divided by that of the crank pin.
        """
        lengths: Any = SimpleNamespace(l2=l2, l3=l3, l4=l4, ca=1.0, sa=0.0)
        return kinematics.coefficients(g, lengths).k42

    def cosine_at_c(self, reach: FloatArray) -> FloatArray:
        """Return the cosine of the angle between coupler and rocker, from `reach`.

        The result is outside [-1, 1] if the links cannot be joined.
        """
        l3, l4 = self.coupler_length, self.rocker_length
        return (l3 * l3 + l4 * l4 - reach * reach) / (2.0 * l3 * l4)

    def transmission_range(self) -> tuple[float, float]:
        """Return the least and greatest angle between coupler and rocker at C over a turn (rad), in [0, pi].

        With a fixed pivot the extremes occur where the crank lies along the ground link; with a moving pivot they are sought
        at `TURN` rotations. If the crank cannot turn fully, an extreme is 0 or pi.
        """
        if self.pivot is None:
            d = np.array([self.ground_length - self.crank_length, self.ground_length + self.crank_length])
        else:
            d = self.reach(np.linspace(0.0, 2.0 * pi, TURN, endpoint=False))
        cosine = np.clip(self.cosine_at_c(d), -1.0, 1.0)
        angle = np.arccos(cosine)
        return float(angle.min()), float(angle.max())

    @property
    def least_transmission(self) -> float:
        """Return the transmission angle's least deviation from 0 and pi over a turn (rad); 0 if the crank cannot turn fully."""
        low, high = self.transmission_range()
        return min(low, pi - high)

    @property
    def turns_fully(self) -> bool:
        """Return whether the crank can turn fully, while a moving pivot follows its motion."""
        return self.least_transmission > 0.0


@in_si(**UNITS)
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SliderCrank(Linkage):
    """A slider-crank with a coupler point, placed in the plane: a guide, instead of a rocker, carries C.

    Attributes
    ----------
    ground_length : float
        l1, the offset: the distance of the guide from A (m), positive or negative.
    rocker_length : float
        Always 0.
    ground_angle : float
        a1: direction of the perpendicular from A to the guide (rad).
    """

    kind: ClassVar[Kind] = "slider-crank"
    links: ClassVar[tuple[str, ...]] = ("crank_length", "coupler_length")
    pivots: ClassVar[tuple[type, ...]] = (type(None),)
    driven: ClassVar[tuple[str, str, str]] = ("slider", "strokes", "force on the slider per force on the crank pin")
    bars: ClassVar[tuple[tuple[str, str], ...]] = (("ground", "AE"), ("crank", "AB"))
    letters: ClassVar[str] = "ABC"

    rocker_length: float = field(init=False, default=0.0)

    @property
    def point_is_pin(self) -> bool:
        """Return whether the coupler point is the slider's pin C."""
        return self.point_angle == 0.0 and self.point_distance == self.coupler_length

    @property
    def absent_dimensions(self) -> tuple[str, ...]:
        """Return the names of the dimensions that this slider-crank does not have.

        A slider-crank has no rocker length. If the coupler point is the pin C, the linkage also has no distance and no angle of
        this point.
        """
        return ("rocker_length", *(("point_distance", "point_angle") if self.point_is_pin else ()))

    def slider_position(self, rotation: ArrayLike) -> FloatArray:
        """Return the position of C on its guide (m): 0 at the foot E of the offset, positive to the left of A -> E."""
        position: FloatArray = self.crank_length * np.sin(self.crank_angle(rotation))
        position += self.coupler_length * self.directions(rotation)[1]
        return position

    def slider(self, rotation: ArrayLike) -> tuple[FloatArray, float]:
        """Return the position of C on its guide (m), and the guide's direction from the ground link (rad)."""
        return self.slider_position(rotation), 0.5 * pi

    def pins(self, rotation: float) -> dict[str, tuple[float, float]]:
        """Return the positions of the pins as `Linkage.pins` does, with D at the slider's pin C."""
        places = Linkage.pins(self, rotation)
        return places | {"D": places["C"]}

    @staticmethod
    def distance(along: Any, across: Any) -> Any:
        """Return the distance from B to the guide, which is the component ``along``."""
        return along

    @staticmethod
    def closure() -> Callable[..., Any]:
        """Return the function that closes the loop with C on its guide, also for CasADi symbols."""
        return close_slider_crank

    @staticmethod
    def square(along: Any, across: Any) -> Any:
        return along * along

    @staticmethod
    def transmission_excess(l3: Any, l4: Any, nearest: Any, farthest: Any, cosine: Any) -> tuple[Any, ...]:
        """Return the constraint g <= 0 as for a four-bar, with mu as the angle between coupler and guide normal."""
        return (farthest - (l3 * cosine) ** 2,)

    @staticmethod
    def excess_slope(l3: Any, l4: Any, cosine: Any) -> Any:
        return 2.0 * l3 * l3 * cosine

    @staticmethod
    def slack(l1: Any, l2: Any, cosine: Any) -> Any:
        return 2.0 * (l1 + l2) * l2 * (1.0 - cosine)

    @staticmethod
    def dead_gap(d: Any, reach: Any, c: Any) -> Any:
        return (d.ground_length - reach * c) / d.coupler_length

    @staticmethod
    def toggle_gap(d: Any, c: Any, side: float) -> Any:
        """Return a value that is zero in a toggle, in which the coupler is perpendicular to the guide."""
        return (d.ground_length - d.crank_length * c) / d.coupler_length - side

    @staticmethod
    def driven_speed(g: Any, l2: Any, l3: Any, l4: Any) -> Any:
        return (g.s3 * g.c2 - g.c3 * g.s2) / g.s3

    def cosine_at_c(self, reach: FloatArray) -> FloatArray:
        """Return the cosine of the angle between the coupler and the normal of the guide, from `reach`."""
        return -reach / self.coupler_length


@in_si(**UNITS)
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FiveBar(Linkage):
    """A five-bar with two cranks: a four-bar whose rocker pivot D is on a second crank about the end E of the ground link.

    Attributes
    ----------
    pivot : SecondCrank
        Motion of the second crank: geared to the first crank, or independent.
    """

    kind: ClassVar[Kind] = "geared-five-bar"
    pivots: ClassVar[tuple[type, ...]] = (SecondCrank,)
    bars: ClassVar[tuple[tuple[str, str], ...]] = (*Linkage.bars, ("crank", "ED"))
    letters: ClassVar[str] = "ABCDE"

    pivot: SecondCrank

    @property
    def title(self) -> str:
        """Return "five-bar", followed by the gear ratio if gears alone turn the second crank."""
        return "five-bar" if self.pivot.series.order else f"five-bar, gears {format_ratio(self.pivot.ratio)}"

    @property
    def turns(self) -> int:
        """Return the number of turns of the first crank per turn of the input shaft."""
        return gear_turns(self.pivot.ratio)[0]

    @property
    def largest_link(self) -> float:
        """Return the length of the longest link, including the second crank (m)."""
        return max(self.ground_length, self.crank_length, self.coupler_length, self.rocker_length, self.pivot.length)
