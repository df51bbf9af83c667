"""Compute mass, centre of mass and moment of inertia of rods, tubes, bars and plates from their sections.

The closed forms of uniform bodies are those of Meriam and Kraige, Engineering Mechanics: Dynamics, appendix D. Moments of
inertia are about an axis normal to the plane in which a planar linkage moves. Every quantity is a number in SI or a text with
its unit; a density may be the name of a material of `DENSITIES`. A dimension that is not positive raises ParameterError.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import pi
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import ParameterError

from .units import Amount, quantity

#: Densities by material (kg/m3): steel after EN 1993-1-2, 3.2.2; aluminium after EN 1999-1-1, 3.2.5; printed plastic is
#: solid PLA of specific gravity 1.24 (ASTM D792, data sheet of NatureWorks Ingeo 4043D): a part with infill is lighter.
DENSITIES: Mapping[str, float] = MappingProxyType({"steel": 7850.0, "aluminium": 2700.0, "printed": 1240.0})


def density(value: Amount, name: str = "density") -> float:
    """Return a density (kg/m3) from a number, a text such as ``"7.85 g/cm3"``, or a material of `DENSITIES`.

    Raises ParameterError if the value is neither a positive density nor a known material.
    """
    if isinstance(value, str) and value in DENSITIES:
        return DENSITIES[value]
    if isinstance(value, str) and not any(c.isdigit() for c in value):
        raise ParameterError(name, value, f"be one of {', '.join(DENSITIES)}, or a density such as '7.85 g/cm3'")
    return _check_positive(quantity(value, "kg/m3", name), name)


#: Upper bound of lengths (m): products of four lengths are still finite.
LONGEST = 1e60


def _check_positive(value: float, name: str) -> float:
    if value <= 0.0:
        raise ParameterError(name, value, "be greater than zero")
    return value


def _check_length(value: Amount) -> float:
    return _check_positive(quantity(value, "m", "length"), "length")


@dataclass(frozen=True, slots=True)
class _Section:
    """Base class of the sections: converts dimensions to SI and checks that they are positive."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            number = density(value) if field.name == "density" else quantity(value, "m", field.name)
            if field.name != "density" and number >= LONGEST:
                raise ParameterError(field.name, value, f"be less than {LONGEST:g} m")
            object.__setattr__(self, field.name, _check_positive(number, field.name))


@dataclass(frozen=True, slots=True)
class _Profile(_Section):
    """Base class of the sections of links with two pins, with the same section over the whole length."""

    def _mass_per_length(self) -> float:
        raise NotImplementedError

    def _width_squared(self) -> float:
        """Return the square of the width (m2) of the rectangular bar with the same radius of gyration."""
        raise NotImplementedError

    def mass(self, length: Amount) -> float:
        """Return the mass (kg) of a piece of given length (m)."""
        return float(self._mass_per_length() * _check_length(length))

    def inertia(self, length: Amount) -> float:
        """Return the moment of inertia (kg.m2) of a piece of given length (m) about a transverse axis through its centre."""
        return float(self.mass(length) * (self._width_squared() + _check_length(length) ** 2) / 12.0)


@dataclass(frozen=True, slots=True)
class Rod(_Profile):
    """A round rod with mass m, radius r and length L: moment of inertia m (3 r^2 + L^2)/12.

    Attributes
    ----------
    diameter : float
        Diameter (m).
    density : float
        Density (kg/m3), or the name of a material.
    """

    diameter: Amount
    density: Amount

    def _mass_per_length(self) -> float:
        return float(0.25 * pi * self.diameter**2 * self.density)

    def _width_squared(self) -> float:
        return float(0.75 * self.diameter**2)


@dataclass(frozen=True, slots=True)
class Tube(_Profile):
    """A round tube with mass m, radii ro and ri and length L: moment of inertia m (3 (ro^2 + ri^2) + L^2)/12.

    Attributes
    ----------
    outer, inner : float
        Diameters (m); the inner one must be less.
    density : float
        Density (kg/m3), or the name of a material.
    """

    outer: Amount
    inner: Amount
    density: Amount

    def __post_init__(self) -> None:
        super(Tube, self).__post_init__()
        if self.inner >= self.outer:
            raise ParameterError("inner", self.inner, f"be less than the outer diameter of {self.outer:g} m")

    def _mass_per_length(self) -> float:
        return float(0.25 * pi * (self.outer**2 - self.inner**2) * self.density)

    def _width_squared(self) -> float:
        return float(0.75 * (self.outer**2 + self.inner**2))


@dataclass(frozen=True, slots=True)
class Bar(_Profile):
    """A bar with mass m, length L and width w: moment of inertia m (L^2 + w^2)/12 about an axis normal to the plane of motion.

    Attributes
    ----------
    width, thickness : float
        Width in the plane of motion, and thickness normal to that plane (m).
    density : float
        Density (kg/m3), or the name of a material.
    """

    width: Amount
    thickness: Amount
    density: Amount

    def _mass_per_length(self) -> float:
        return float(self.width * self.thickness * self.density)

    def _width_squared(self) -> float:
        return float(self.width**2)


#: Section of a link with two pins.
Section = Rod | Tube | Bar


class MassProperties(NamedTuple):
    """Mass (kg), x and y of the centre of mass (m), and moment of inertia (kg.m2) about the axis through the centre of mass."""

    mass: float
    centre: tuple[float, float]
    inertia: float


@dataclass(frozen=True, slots=True)
class Plate(_Section):
    """A flat plate with straight edges, of given thickness (m) and density (kg/m3), or name of a material."""

    thickness: Amount
    density: Amount

    def properties(self, points: ArrayLike) -> MassProperties:
        """Return mass, centre of mass and moment of inertia of a plate with the given corners.

        By Green's theorem the integrals over the area become sums over the edges: C. Steger, On the calculation of arbitrary
        moments of polygons, report FGBV-96-05, TU Munich, 1996.

        Parameters
        ----------
        points : array_like
            Corners (m) in order, clockwise or counter-clockwise, without repeating the first, shape (n, 2), n >= 3.

        Raises
        ------
        ParameterError
            If there are fewer than three corners, they enclose no area, or edges cross.
        """
        corners = np.asarray(points, dtype=float)
        if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2 or not np.all(np.isfinite(corners)):
            raise ParameterError(
                "points", corners.tolist(), "be at least three corners with two finite coordinates each"
            )
        origin = corners.mean(axis=0)
        a = corners - origin
        b = np.roll(a, -1, axis=0)
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        area = 0.5 * float(cross.sum())
        across, along = np.linalg.svd(a, compute_uv=False)[::-1]
        if across <= 1e-12 * along:
            raise ParameterError("points", corners.tolist(), "enclose an area: they are on one line")
        if abs(area) <= 1e-12 * along**2 or _edges_cross(a, b):
            raise ParameterError("points", corners.tolist(), "be in order round the plate: its edges cross")
        centre = (cross[:, None] * (a + b)).sum(axis=0) / (6.0 * area)
        polar = float((cross * ((a * a) + a * b + b * b).sum(axis=1)).sum()) / (12.0 * area)
        mass = float(abs(area) * self.thickness * self.density)
        x, y = (origin + centre).tolist()
        return MassProperties(mass, (x, y), mass * (polar - float(centre @ centre)))


def _edges_cross(a: Any, b: Any) -> bool:
    """Return whether any two edges cross; edge i runs from a[i] to b[i], and a and b have shape (n, 2)."""

    def side(p: Any, q: Any, r: Any) -> Any:
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])

    p, q = a[:, None], b[:, None]
    apart = side(p, q, a[None]) * side(p, q, b[None])
    return bool(np.any((apart < 0.0) & (apart.T < 0.0)))
