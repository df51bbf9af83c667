"""Compute and constrain limit positions and mechanical advantage of four-bars and slider-cranks.

In a dead centre crank and coupler are collinear, and rocker or slider rest at the end of their travel. In a toggle coupler and
rocker are collinear, or the coupler is perpendicular to the guide, and the crank can turn no further. See R. L. Norton, Design
of Machinery, 6th ed., 2020, chapters 2, 3 and 6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import acos, cos, inf, isfinite, pi
from types import SimpleNamespace
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from linkwork.errors import ParameterError

from ...mechanisms import FIVE_BAR
from ...numerics import symbolic
from ...run import symbolic_equations
from ...units import Amount, in_si
from ..linkage.linkage import Linkage
from ..linkage.pivot import Kind
from .constraint import TURNING, Demand, Require, RotationRange, RotationRequirement, even_rotations, search_range

FloatArray = NDArray[np.float64]
#: Two collinear links: one extends the other, or lies over it.
InLine = Literal["stretched", "folded"]


class _FourBarConditions:
    """Conditions for the limit positions of a four-bar, for numbers and symbols; see `POSITIONS`."""

    @staticmethod
    def dead_cosine(l1: float, reach: float, l4: float) -> float:
        """Return the cosine of the angle at A between ground link and AC in a dead centre, at the distance AC of ``reach``."""
        return (l1 * l1 + reach * reach - l4 * l4) / (2.0 * l1 * reach)

    @staticmethod
    def dead_gap(d: Any, reach: Any, c: Any) -> Any:
        """Return the closure error of the triangle A, C, D, zero in a dead centre.

        ``reach`` is the distance AC, ``c`` the cosine of the angle at A, ``d`` has the dimensions.
        """
        l1, l3, l4 = d.ground_length, d.coupler_length, d.rocker_length
        return (l1**2 + reach**2 - l4**2 - 2.0 * l1 * reach * c) / (l1**2 + l3**2)

    @staticmethod
    def toggle_cosines(l1: float, l2: float, l3: float, l4: float) -> list[float]:
        """Return the cosines of the crank angle in the toggles."""
        return [(l1 * l1 + l2 * l2 - reach * reach) / (2.0 * l1 * l2) for reach in (l3 + l4, l3 - l4)]

    @staticmethod
    def toggle_gap(d: Any, c: Any, side: float) -> Any:
        """Return a value that is zero in a toggle; c is the cosine of the crank angle, side 1 for stretched, -1 for folded."""
        l1, l2, l3, l4 = d.ground_length, d.crank_length, d.coupler_length, d.rocker_length
        reach = l3 + l4 if side > 0.0 else l3 - l4
        return (l1**2 + l2**2 - 2.0 * l1 * l2 * c - reach**2) / (l1**2 + l3**2)

    @staticmethod
    def collinearity(d: Any, c: Any) -> Any:
        """Return values that are all negative unless coupler and rocker are almost collinear; c as in `toggle_gap`."""
        l1, l2, l3, l4 = d.ground_length, d.crank_length, d.coupler_length, d.rocker_length
        square = l1**2 + l2**2 - 2.0 * l1 * l2 * c
        both = Linkage.transmission_excess(l3, l4, square, square, cos(TURNING))
        return symbolic.library().horzcat(*both) / (2.0 * l3 * l4)

    @staticmethod
    def advantage_numerator(linkage: Linkage, c3: Any, s3: Any, c4: Any, s4: Any) -> Any:
        """Return the numerator of the mechanical advantage, zero in a toggle, from the directions of coupler and rocker."""
        return linkage.rocker_length * (s3 * c4 - c3 * s4) / linkage.crank_length

    @staticmethod
    def speed(g: Any, c2: Any, s2: Any, l2: Any, l3: Any, l4: Any) -> Any:
        """Return the speed of the driven link divided by the speed of the crank; ``g`` is the position of the closed loop."""
        return symbolic_equations(FIVE_BAR).coefficients(g, SimpleNamespace(l2=l2, l3=l3, l4=l4, ca=1.0, sa=0.0)).k42


class _SliderCrankConditions(_FourBarConditions):
    """Conditions for the limit positions of a slider-crank; in a toggle the coupler is perpendicular to the guide."""

    @staticmethod
    def dead_cosine(l1: float, reach: float, l4: float) -> float:
        return l1 / reach

    @staticmethod
    def dead_gap(d: Any, reach: Any, c: Any) -> Any:
        return (d.ground_length - reach * c) / d.coupler_length

    @staticmethod
    def toggle_cosines(l1: float, l2: float, l3: float, l4: float) -> list[float]:
        return [(l1 - l3) / l2, (l1 + l3) / l2]

    @staticmethod
    def toggle_gap(d: Any, c: Any, side: float) -> Any:
        return (d.ground_length - d.crank_length * c) / d.coupler_length - side

    @staticmethod
    def collinearity(d: Any, c: Any) -> Any:
        apart = (d.ground_length - d.crank_length * c) / d.coupler_length
        return apart * apart - cos(TURNING) ** 2

    @staticmethod
    def advantage_numerator(linkage: Linkage, c3: Any, s3: Any, c4: Any, s4: Any) -> Any:
        return s3

    @staticmethod
    def speed(g: Any, c2: Any, s2: Any, l2: Any, l3: Any, l4: Any) -> Any:
        return (g.s3 * c2 - g.c3 * s2) / g.s3


#: Conditions for each kind of linkage; a geared five-bar has no dead centres.
POSITIONS: Mapping[Kind, type[_FourBarConditions]] = {
    "four-bar": _FourBarConditions,
    "slider-crank": _SliderCrankConditions,
}


def dead_centres(linkage: Linkage) -> tuple[float, ...]:
    """Return the crank rotations of the dead centres, within a turn from 0 (rad), in increasing order; empty if there are none.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    """
    l1, l2, l3, l4 = _fixed_lengths(linkage)
    found = []
    # distance of C from A with coupler and crank in line, stretched and folded
    for reach in (l3 + l2, l3 - l2):
        if reach == 0.0:
            continue
        # cosine of the coupler's direction, which points to the side of the assembly
        cosine = POSITIONS[linkage.kind].dead_cosine(l1, reach, l4)
        if abs(cosine) > 1.0:
            continue
        th3 = linkage.branch * acos(cosine)
        found.append(th3 if reach == l3 + l2 else th3 + pi)
    return tuple(sorted((th2 - linkage.crank_phase) % (2.0 * pi) for th2 in found))


def toggles(linkage: Linkage) -> tuple[float, ...]:
    """Return the crank rotations of the toggles, within a turn from 0 (rad); empty if the crank can turn fully.

    With a moving rocker pivot the results are rotations of the input shaft, which turns once per period of the linkage.
    """
    if linkage.pivot is not None:
        return _toggles_by_roots(linkage)
    l1, l2, l3, l4 = _fixed_lengths(linkage)
    found = []
    for cosine in POSITIONS[linkage.kind].toggle_cosines(l1, l2, l3, l4):
        if abs(cosine) <= 1.0:
            found += [acos(cosine), -acos(cosine)]
    return tuple(sorted((th2 - linkage.crank_phase) % (2.0 * pi) for th2 in found))


def _toggles_by_roots(linkage: Linkage) -> tuple[float, ...]:
    """Find the rotations at which the cosine of the angle between coupler and rocker passes -1 or 1."""

    def excess_of_cosine(phi: Any) -> Any:
        return np.abs(linkage.cosine_at_c(linkage.reach(phi))) - 1.0

    phi = np.linspace(0.0, 2.0 * pi, 1441)
    off = excess_of_cosine(phi)
    passed = np.flatnonzero(np.sign(off[1:]) != np.sign(off[:-1]))
    return tuple(float(brentq(excess_of_cosine, phi[k], phi[k + 1], xtol=1e-13)) for k in passed)


def time_ratio(linkage: Linkage) -> float | None:
    """Return the duration of the slow swing or stroke divided by the duration of the quick one; at least 1.

    The crank turns at constant speed. The result is None if the crank cannot turn fully, or if the rocker turns fully, too.

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    """
    rests = dead_centres(linkage)
    if len(rests) != 2 or not linkage.turns_fully:
        return None
    way = rests[1] - rests[0]
    return max(way, 2.0 * pi - way) / min(way, 2.0 * pi - way)


def mechanical_advantage(linkage: Linkage, rotation: ArrayLike) -> FloatArray:
    """Return the torque on the rocker divided by the torque on the crank, without friction and masses.

    For a slider-crank the mechanical advantage is the force on the slider divided by the force on the crank pin perpendicular
    to the crank, which equals the speed of the pin divided by the speed of the slider. It is infinite in a dead centre, zero
    in a toggle, and NaN if the links cannot be joined. The result has the shape of ``rotation``, the crank rotations (rad).

    Raises
    ------
    ParameterError
        If the rocker pivot moves.
    """
    _fixed_lengths(linkage)
    phi = np.atleast_1d(np.asarray(rotation, dtype=float))
    c3, s3, c4, s4, _, _ = linkage.directions(phi)
    th2 = phi + linkage.crank_phase
    gained = POSITIONS[linkage.kind].advantage_numerator(linkage, c3, s3, c4, s4)
    given = s3 * np.cos(th2) - c3 * np.sin(th2)
    with np.errstate(divide="ignore"):
        ratio = np.where(given == 0.0, inf, gained / np.where(given == 0.0, 1.0, given))
    return np.where(np.isfinite(gained), ratio, np.nan).reshape(np.shape(rotation))


def _fixed_lengths(linkage: Linkage) -> tuple[float, float, float, float]:
    """Return l1 ... l4 of a four-bar or a slider-crank; raises ParameterError if the rocker pivot moves."""
    if linkage.pivot is not None:
        raise ParameterError("pivot", linkage.pivot, "be fixed: with a moving pivot no link rests in a dead centre")
    return linkage.ground_length, linkage.crank_length, linkage.coupler_length, linkage.rocker_length


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
        """Return whether the greatest advantage is bounded everywhere: it is infinite in a dead centre."""
        return self.at is None and isfinite(self.greatest)

    def requires(self, way: RotationRange) -> tuple[Require, ...]:
        """Return the functions of dimensions and crank rotation that must be at most zero."""
        all_the_way = self.at is None
        ends = way.ends("mechanical advantage") if all_the_way else None
        if ends is None:
            way.timed("mechanical advantage at crank rotations")
        rotation, turn = self.at if ends is None else even_rotations(ends), way.turn and all_the_way

        def speed(d: Any, rotation: Any) -> Any:
            casadi = symbolic.library()
            th2 = rotation if turn else rotation + d.crank_phase
            c2, s2 = casadi.cos(th2), casadi.sin(th2)
            l2, l3, l4 = d.crank_length, d.coupler_length, d.rocker_length
            g = way.linkage.closure()(c2, s2, d.ground_length - l2 * c2, -l2 * s2, l3, l4, d.branch)
            return POSITIONS[way.linkage.kind].speed(g, c2, s2, l2, l3, l4)

        def slow(d: Any, rotation: Any) -> Any:
            both = self.least * speed(d, rotation)
            return symbolic.library().horzcat(both - 1.0, -both - 1.0)

        def fast(d: Any, rotation: Any) -> Any:
            return 1.0 - (self.greatest * speed(d, rotation)) ** 2

        asked = {"least": (slow, self.least > 0.0), "greatest": (fast, isfinite(self.greatest))}
        return tuple(
            RotationRequirement(
                function=f,
                name=f"{which} mechanical advantage",
                rotation=rotation,
                ends=ends and search_range(ends),
                symbolic=True,
            )
            for which, (f, wanted) in asked.items()
            if wanted
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
        return Require(function=function, equal=equal, name=f"{self.position} {self._name}", symbolic=True)

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
        """Return the functions of the dimensions that must be at most zero, or equal to zero."""
        stretched = self.position == "stretched"

        def closes(d: Any, rotation: float) -> Any:
            reach = d.coupler_length + d.crank_length if stretched else d.coupler_length - d.crank_length
            # A -> C points along the crank, or against it
            c = symbolic.library().cos(rotation + d.crank_phase) * (1.0 if stretched else -1.0)
            return POSITIONS[way.linkage.kind].dead_gap(d, reach, c)

        def opposite(d: Any, rotation: float) -> Any:
            s = symbolic.library().sin(rotation + d.crank_phase)
            return -d.branch * s if stretched else d.branch * s

        sides = [self._require(partial(opposite, rotation=end)) for end in dict.fromkeys(self.at)]
        return (*self._require_sign_change(way, closes), *sides)


class Toggle(_LimitPosition):
    """Constraint, as `DeadCentre`: a toggle, in which the crank can turn no further, is at a rotation or in a range of them.

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
        """Return the functions of the dimensions that must be at most zero, or equal to zero."""

        def closes(d: Any, rotation: float) -> Any:
            c = symbolic.library().cos(rotation + d.crank_phase)
            return POSITIONS[way.linkage.kind].toggle_gap(d, c, 1.0 if self.position == "stretched" else -1.0)

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
        """Return the functions of dimensions and crank rotation that must be at most zero."""
        way.timed("a range of crank rotations without a toggle")

        def excess(d: Any, rotation: Any) -> Any:
            return POSITIONS[way.linkage.kind].collinearity(d, symbolic.library().cos(rotation + d.crank_phase))

        ends = self.between
        return (
            RotationRequirement(
                function=excess,
                name="range without a toggle",
                rotation=even_rotations(ends),
                ends=search_range(ends),
                symbolic=True,
            ),
        )
