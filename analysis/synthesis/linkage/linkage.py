"""A linkage in the plane: the four-bar of the thesis's chapter VI, its rocker pivot fixed, sliding, on a second crank, or at
infinity, which is a slider-crank.

The coupler point is, with the thesis's symbols (appendix 5),

    x = X0 + l2 cos(th2 + a1) + r cos(th3 + a1 + a2),   y alike with sines,   th2 = phi + th20,

where phi is the crank's rotation from the start of the motion. Equation (6.17) as printed drops a1 in the second term.
Angles th2, th3, th4 are those of the plant, from the ground link; a1 turns the whole linkage. Loop closure and derivatives are
evaluated by `kernels`. Of a slider-crank the ground link is the perpendicular from the crank shaft to the
guide of C, l1 the offset, and there is no rocker.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import atan2, cos, hypot, isfinite, pi, sin
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters

from ...numerics.fourier import FourierSeries
from ...units import in_si
from .kernels import PLACES, coupler_path, coupler_path_jacobian, link_directions, link_jacobian

FloatArray = NDArray[np.float64]
#: Of a linkage: what must be greater than zero, what is a length of any sign, what is an angle.
LINKS = ("ground_length", "crank_length", "coupler_length", "rocker_length")
LENGTHS = ("pivot_x", "pivot_y", *LINKS, "point_distance")
ANGLES = ("ground_angle", "crank_phase", "point_angle", "output_angle")
#: Links that need not be longer than zero of a slider-crank: its rocker, as it has none, and the offset, of either sign.
ABSENT = ("rocker_length", "ground_length")
#: Their units.
UNITS: Mapping[str, str] = MappingProxyType(dict.fromkeys(LENGTHS, "m") | dict.fromkeys(ANGLES, "rad"))
#: Grashof's types of a four-bar of which a link turns fully, by the shortest link in the order of `LINKS`.
BY_SHORTEST = ("drag-link", "crank-rocker", "double-rocker", "rocker-crank")
#: Crank rotations at which a full turn is evaluated.
TURN = 360
#: Greatest number of turns of either crank until a geared five-bar is as it was.
TEETH = 6


def wrapped(angle: FloatArray) -> FloatArray:
    """Angles within half a turn of zero, in [-pi, pi)."""
    value: FloatArray = (angle + pi) % (2.0 * pi) - pi
    return value


def transmission_excess(l3: Any, l4: Any, nearest: Any, farthest: Any, cosine: Any) -> tuple[Any, ...]:
    """Left sides of g <= 0 by which |cos mu| at C is at most a cosine, without division; of numbers, arrays and symbols.

    ``nearest`` and ``farthest`` are the squares of the least and the greatest distance from B to D; of a slider-crank, whose l4
    is None, to the guide.
    """
    if l4 is None:
        return (farthest - (l3 * cosine) ** 2,)
    joint, product = l3 * l3 + l4 * l4, 2.0 * l3 * l4 * cosine
    return joint - nearest - product, farthest - joint - product


@dataclass(frozen=True, slots=True, eq=False)
class SliderMotion:
    """The rocker pivot D moves along a guide as a Fourier series of the crank's rotation.

    Attributes
    ----------
    series : FourierSeries
        u(phi) in m: its order is the number of harmonics.
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
        """Displacement of D in the frame of the ground link (m)."""
        u = self.series(rotation)
        return u * cos(self.guide_angle), u * sin(self.guide_angle)

    @property
    def stroke(self) -> float:
        """Distance between the ends of the slider's travel (m)."""
        return float(np.ptp(self.series(np.linspace(0.0, 2.0 * pi, 1440, endpoint=False))))

    def scaled(self, factor: float) -> SliderMotion:
        """The motion of a linkage that is larger by the factor."""
        return replace(self, series=self.series * factor)


def geared(ratio: float) -> tuple[int, int]:
    """Turns k of the first crank and m of the second until both are where they were: the ratio is m/k.

    Raises ParameterError if it is not zero and no ratio of whole numbers up to six.
    """
    if isfinite(ratio):
        near = Fraction(ratio).limit_denominator(TEETH)
        if abs(near - Fraction(ratio)) <= 1e-9 and abs(near.numerator) <= TEETH:
            return near.denominator, near.numerator
    raise ParameterError("ratio of the second crank", ratio, f"be a ratio of whole numbers up to {TEETH}")


def format_ratio(ratio: float) -> str:
    """A ratio of gears, such as "2", "-1" or "1/2"."""
    return str(Fraction(ratio).limit_denominator(TEETH))


@dataclass(frozen=True, slots=True, eq=False)
class SecondCrank:
    """The rocker pivot D sits on a second crank, geared to the first or turned independently: a five-bar.

    D = E + l5 exp(i psi) about the end E of the ground link, with psi = m phi + phase + series(phi), where m/k is the ratio and
    the first crank turns k times as fast as phi: phi is the rotation of the shaft that turns once until all is as it was.

    Attributes
    ----------
    length : float
        l5 (m).
    ratio : float
        Turns of the second crank for one of the first: a ratio of whole numbers up to six.
    phase : float
        psi at the start (rad).
    series : FourierSeries
        What is added to the geared rotation (rad): zero with gears.

    Raises
    ------
    ParameterError
        If the length is not greater than zero, the ratio none of small whole numbers, or the phase not finite.
    """

    length: float
    ratio: float = 1.0
    phase: float = 0.0
    series: FourierSeries = field(default_factory=lambda: FourierSeries.constant(0.0))

    def __post_init__(self) -> None:
        if not (isfinite(self.length) and self.length > 0.0):
            raise ParameterError("second_crank_length", self.length, "be a finite number greater than zero")
        geared(self.ratio)
        if not isfinite(self.phase):
            raise ParameterError("second_crank_phase", self.phase, "be a finite number")

    def angle(self, rotation: ArrayLike) -> FloatArray:
        """psi (rad)."""
        phi = np.asarray(rotation, dtype=float)
        value: FloatArray = geared(self.ratio)[1] * phi + self.phase + self.series(phi)
        return value

    def displacement(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Displacement of D in the frame of the ground link (m)."""
        psi = self.angle(rotation)
        return self.length * np.cos(psi), self.length * np.sin(psi)

    def scaled(self, factor: float) -> SecondCrank:
        """The motion of a linkage that is larger by the factor."""
        return replace(self, length=self.length * factor)


@in_si(**UNITS)
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linkage:
    """A four-bar with a coupler point, placed in the plane. Lengths in m, angles in rad.

    Attributes
    ----------
    pivot_x, pivot_y : float
        X0, Y0: the crank shaft A.
    ground_length, crank_length, coupler_length, rocker_length : float
        l1 ... l4. A slider-crank has a rocker of length 0, and l1 is its offset: the distance of the guide of C from A.
    point_distance, point_angle : float
        r and a2: the coupler point from the crank pin B, and its direction from the coupler's.
    ground_angle : float
        a1: direction of the ground link, from A to the rocker pivot; of a slider-crank from A to the guide, at right angles.
    crank_phase : float
        th20: crank angle from the ground link at the start of the motion.
    output_angle : float
        Mounting angle of what is read on the rocker, or carried by the coupler, from the link's own direction.
    branch : int
        Assembly: +1 with C to the left of B -> D, -1 to the right.
    pivot : SliderMotion or SecondCrank, optional
        What moves the rocker pivot; it is fixed without.

    Raises
    ------
    ParameterError
        If a value is not finite, a link not longer than zero, the branch neither +1 nor -1, or a slider-crank's pivot moved.
    """

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
            if name in LINKS and value <= 0.0 and not (self.slides and name in ABSENT):
                raise ParameterError(name, value, "be greater than zero")
            object.__setattr__(self, name, value)
        if self.slides and self.pivot is not None:
            raise ParameterError("pivot", self.pivot, "be fixed: a slider-crank, whose rocker has no length, has none")
        if self.branch not in (1, -1):
            raise ParameterError("branch", self.branch, "be +1 or -1")

    @property
    def slides(self) -> bool:
        """Whether it is a slider-crank: C is on a guide instead of a rocker."""
        return self.rocker_length == 0.0

    @property
    def slider_is_point(self) -> bool:
        """Whether the coupler point is the slider's pin C of a slider-crank."""
        return self.slides and self.point_angle == 0.0 and self.point_distance == self.coupler_length

    @property
    def turns(self) -> int:
        """Turns of the crank for one of the shaft whose rotation is given: 1, but with gears of a ratio such as 1/2."""
        return geared(self.pivot.ratio)[0] if isinstance(self.pivot, SecondCrank) else 1

    def crank_angle(self, rotation: ArrayLike) -> FloatArray:
        """th2 from the ground link (rad)."""
        value: FloatArray = self.turns * np.asarray(rotation, dtype=float) + self.crank_phase
        return value

    @classmethod
    def from_vector(cls, q: ArrayLike, branch: int = 1, **more: Any) -> Linkage:
        """From the vector of `kernels.PLACES` (and the output angle as an eleventh, if it is there)."""
        values = np.asarray(q, dtype=float)
        return cls(**dict(zip((*PLACES, "output_angle"), values.tolist())), branch=branch, **more)

    @property
    def vector(self) -> FloatArray:
        """The ten parameters in the order of `kernels.PLACES`."""
        return np.array([getattr(self, name) for name in PLACES])

    def values(self) -> dict[str, float]:
        """Dimensions by name, without the pivot's motion (m, rad)."""
        return {name: getattr(self, name) for name in (*LENGTHS, *ANGLES)} | {"branch": self.branch}

    @property
    def largest_link(self) -> float:
        """The longest of the four links, and of a second crank (m)."""
        second = self.pivot.length if isinstance(self.pivot, SecondCrank) else 0.0
        return max(abs(self.ground_length), self.crank_length, self.coupler_length, self.rocker_length, second)

    def displacement(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Displacement of the rocker pivot from the end of the ground link, in the frame of that link (m)."""
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
        """Coupler point at rotations of the crank, shape (n, 2) in m; NaN where the links cannot be joined.

        ``displacement`` of the rocker pivot takes the place of what its own motion is, as in `directions`.
        """
        out = np.empty((2, np.size(rotation)))
        coupler_path(*self._arguments(rotation, displacement), out)
        return out.T

    def path_jacobian(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Coupler point (n, 2), and its derivatives with respect to `kernels.COLUMNS`, shape (12, 2, n)."""
        n = np.size(rotation)
        out, jacobian = np.empty((2, n)), np.empty((12, 2, n))
        coupler_path_jacobian(*self._arguments(rotation), out, jacobian)
        return out.T, jacobian

    def link_jacobian(self, rotation: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Angles of coupler and rocker from the ground link (2, n), and their derivatives as in `path_jacobian`, (12, 2, n)."""
        n = np.size(rotation)
        out, jacobian = np.empty((2, n)), np.empty((12, 2, n))
        link_jacobian(*self._arguments(rotation), out, jacobian)
        return out, jacobian

    def directions(self, rotation: ArrayLike, displacement: tuple[ArrayLike, ArrayLike] | None = None) -> FloatArray:
        """(c3, s3, c4, s4, c43, s43) of `kinematics.Position`, shape (6, n), in the frame of the ground link."""
        out = np.empty((6, np.size(rotation)))
        link_directions(*self._arguments(rotation, displacement), out)
        return out

    def coupler_angle(self, rotation: ArrayLike) -> FloatArray:
        """Direction of the coupler in the plane, with the output angle (rad), continuous over the rotations."""
        g = self.directions(rotation)
        turned: FloatArray = np.unwrap(np.arctan2(g[1], g[0])) + self.ground_angle + self.output_angle
        return turned

    def rocker_angle(self, rotation: ArrayLike) -> FloatArray:
        """th4 from the ground link, with the output angle (rad), continuous over the rotations (the thesis's th4)."""
        g = self.directions(rotation)
        turned: FloatArray = np.unwrap(np.arctan2(g[3], g[2])) + self.output_angle
        return turned

    def slider_position(self, rotation: ArrayLike) -> FloatArray:
        """Place of C along the guide of a slider-crank from the foot E of the offset, to the left of A -> E (m)."""
        of_b = self.crank_length * np.sin(self.crank_angle(rotation))
        value: FloatArray = of_b + self.coupler_length * self.directions(rotation)[1]
        return value

    def transmission(self, rotation: ArrayLike) -> FloatArray:
        """Acute angle between coupler and rocker (rad), 0 at the limit of assembly; NaN where there is no joining."""
        g = self.directions(rotation)
        angle: FloatArray = np.arctan2(np.abs(g[5]), np.abs(g[4]))
        return angle

    def pins(self, rotation: float) -> dict[str, tuple[float, float]]:
        """A, B, C, D, the end E of the ground link, and P in the plane (m) at one rotation of the crank.

        Of a slider-crank D, the slider, is where C is.

        Raises
        ------
        AssemblyError
            If the links cannot be joined there.
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
        if self.slides:
            places["D"] = places["C"]
        return {name: (float(z.real), float(z.imag)) for name, z in places.items()}

    def moved(self, x: float, y: float) -> Linkage:
        """The same linkage elsewhere (m)."""
        return replace(self, pivot_x=self.pivot_x + x, pivot_y=self.pivot_y + y)

    def scaled(self, factor: float) -> Linkage:
        """The linkage with every length, and the place of A, multiplied by the factor."""
        lengths = {name: factor * getattr(self, name) for name in LENGTHS}
        return replace(self, **lengths, pivot=None if self.pivot is None else self.pivot.scaled(factor))

    @property
    def grashof(self) -> str:
        """Type of the four-bar by Grashof's criterion, the rocker pivot at the end of the ground link; or slider-crank.

        One of crank-rocker, drag-link (both turn), double-rocker (the coupler turns), rocker-crank (the rocker turns, the crank
        does not), triple-rocker, change-point.
        """
        if self.slides:
            return "slider-crank"
        lengths = [getattr(self, name) for name in LINKS]
        excess = 2.0 * (min(lengths) + max(lengths)) - sum(lengths)
        if abs(excess) <= 1e-12 * sum(lengths):
            return "change-point"
        return "triple-rocker" if excess > 0.0 else BY_SHORTEST[lengths.index(min(lengths))]

    def reach(self, rotation: ArrayLike) -> FloatArray:
        """Distance from B to D, or along the ground link from B to the guide of a slider-crank (m)."""
        dx, dy = self.displacement(rotation)
        th2 = self.crank_angle(rotation)
        distance: FloatArray = self.ground_length + dx - self.crank_length * np.cos(th2)
        if not self.slides:
            distance = np.hypot(distance, dy - self.crank_length * np.sin(th2))
        return distance

    def cosine_at_c(self, reach: FloatArray) -> FloatArray:
        """Cosine of the angle between coupler and rocker, or the normal of the guide, for what `reach` is.

        It is beyond -1 and 1 where the links cannot be joined.
        """
        l3, l4 = self.coupler_length, self.rocker_length
        cosine: FloatArray = -reach / l3 if self.slides else (l3 * l3 + l4 * l4 - reach * reach) / (2.0 * l3 * l4)
        return cosine

    def transmission_range(self) -> tuple[float, float]:
        """Least and greatest angle between coupler and rocker at C over a turn (rad), in [0, pi].

        With a fixed pivot it is at its extremes with the crank along the ground link; with a moving one it is found over `TURN`
        rotations. Where the crank cannot turn fully the extremes are 0 or pi.
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
        """Least deviation of the transmission angle from 0 and pi over a turn (rad); 0 where the crank cannot turn fully."""
        low, high = self.transmission_range()
        return min(low, pi - high)

    @property
    def turns_fully(self) -> bool:
        """Whether the crank can turn fully, the pivot moving as it does."""
        return self.least_transmission > 0.0

    def to_five_bar(
        self,
        *,
        density: float = 7850.0,
        section: tuple[float, float] = (0.02, 0.005),
        slider_mass: float | None = None,
        slider_stiffness: float = 0.0,
        slider_damping: float = 0.0,
        slider_coulomb_friction: float = 0.0,
        gravity: float = 9.81,
    ) -> FiveBarParameters:
        """Parameters of the plant and its FMU, with masses from density and section.

        Crank and rocker are bars of a rectangular section between their pins; the coupler is one from B to C and, where the
        coupler point is off that line, a second from B to P. The plant's x axis is the ground link: gravity comes at the
        linkage's own inclination. A fixed rocker pivot becomes a slider held by a spring: give it one, or hold it by force.

        Parameters
        ----------
        density : float
            kg/m3; steel by default.
        section : (float, float)
            Width in the plane and thickness of every bar (m).
        slider_mass : float, optional
            kg; by default that of a block of four widths by two widths by four thicknesses.
        slider_stiffness, slider_damping, slider_coulomb_friction, gravity : float
            As in `FiveBarParameters`.

        Raises
        ------
        ParameterError
            If density or section are not greater than zero, it is a slider-crank, or the pivot is on a second crank.
        """
        width, thickness = section
        for name, value in (("density", density), ("section width", width), ("section thickness", thickness)):
            if not (isfinite(value) and value > 0.0):
                raise ParameterError(name, value, "be a finite number greater than zero")
        if self.slides:
            raise ParameterError("rocker_length", 0.0, "be greater than zero: the five-bar slider is no slider-crank")
        if isinstance(self.pivot, SecondCrank):
            raise ParameterError("pivot", self.pivot, "be fixed or a slider: the plant has no second crank")
        r, a2 = self.point_distance, self.point_angle
        straight = on_line(self.coupler_length, r, a2)
        made = bodies(
            self.crank_length,
            self.coupler_length,
            self.rocker_length,
            r,
            a2,
            density * width * thickness,
            width,
            straight,
        )
        return FiveBarParameters(
            ground_length=self.ground_length,
            crank_length=self.crank_length,
            coupler_length=self.coupler_length,
            rocker_length=self.rocker_length,
            slider_mass=density * 32.0 * width * width * thickness if slider_mass is None else slider_mass,
            **made,
            slider_guide_angle=0.0 if self.pivot is None else self.pivot.guide_angle,
            slider_stiffness=slider_stiffness,
            slider_damping=slider_damping,
            slider_coulomb_friction=slider_coulomb_friction,
            coupler_point_distance=r,
            coupler_point_angle=a2,
            gravity=gravity,
            ground_inclination=self.ground_angle,
            assembly_branch=self.branch,
        )


def bar(length: Any, line: float, width: float) -> tuple[Any, Any]:
    """Mass of a rectangular bar between its pins (kg), and its moment of inertia about its centre (kg.m2)."""
    mass = line * length
    return mass, mass * (length * length + width * width) / 12.0


def bodies(l2: Any, l3: Any, l4: Any, r: Any, a2: Any, line: float, width: float, straight: bool) -> dict[str, Any]:
    """Masses, moments of inertia and centres of mass, by their names in `FiveBarParameters`.

    Crank and rocker are bars between their pins. The coupler is one from B to C and a second from B to P; where P is on the
    line of B and C, ``straight``, one over all of it.

    Parameters
    ----------
    l2, l3, l4, r, a2 : float
        Links, distance and direction of the coupler point (m, rad).
    line : float
        kg/m.
    width : float
        m.
    straight : bool
    """
    m2, i2 = bar(l2, line, width)
    m4, i4 = bar(l4, line, width)
    if straight:
        end = r * cos(a2)
        low, high = min(0.0, end), max(l3, end)
        m3, i3 = bar(high - low, line, width)
        x, y = 0.5 * (low + high), 0.0
    else:
        (along, own), (aside, inertia) = bar(l3, line, width), bar(r, line, width)
        bx, px, py = 0.5 * l3, 0.5 * r * cos(a2), 0.5 * r * sin(a2)
        m3 = along + aside
        x, y = (along * bx + aside * px) / m3, aside * py / m3
        i3 = own + along * ((bx - x) ** 2 + y**2) + inertia + aside * ((px - x) ** 2 + (py - y) ** 2)
    return {
        "crank_mass": m2,
        "crank_inertia": i2 + m2 * (0.5 * l2) ** 2,
        "crank_cog_distance": 0.5 * l2,
        "coupler_mass": m3,
        "coupler_inertia": i3,
        "coupler_cog_distance": hypot(x, y),
        "coupler_cog_angle": atan2(y, x),
        "rocker_mass": m4,
        "rocker_inertia": i4,
        "rocker_cog_distance": 0.5 * l4,
    }


def on_line(l3: float, r: float, a2: float) -> bool:
    """Whether the coupler point lies on the line of B and C."""
    return abs(sin(a2)) * r <= 1e-9 * l3
