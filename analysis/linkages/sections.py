"""Read the cross-sections of links from files: tables with a kind, dimensions and a material."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from linkwork.errors import ParameterError

from ..files import Many, Quantity, Reader, Table
from ..sections import Bar, MassProperties, Plate, Rod, Section, Tube, density


@dataclass(frozen=True, slots=True)
class LinkBody:
    """Body of a link: a bar of constant section with an ``overhang`` (m) beyond each pin, or a plate with ``corners`` (m).

    ``words`` describe the body in messages.
    """

    section: Section | Plate
    words: str
    overhang: float = 0.0
    corners: tuple[tuple[float, float], ...] = ()

    def properties(self, length: float) -> MassProperties:
        """Return mass, centre of mass (along, across) from the first pin, and moment of inertia about the centre of mass."""
        if isinstance(self.section, Plate):
            return self.section.properties(self.corners)
        body = length + 2.0 * self.overhang
        return MassProperties(self.section.mass(body), (0.5 * length, 0.0), self.section.inertia(body))

    def origin(self, weighed: bool) -> str:
        """Return in words where the mass properties come from: the section, or weighing and the section if ``weighed``."""
        return f"{'weighed, shaped as a ' if weighed else 'of a '}{self.words}"


def format_millimetres(*lengths: float) -> str:
    """Format lengths, given in metres, as text in millimetres."""
    return " x ".join(f"{1e3 * length:g}" for length in lengths) + " mm"


def _bar(width: float, thickness: float, material: float, overhang: float = 0.0) -> LinkBody:
    return LinkBody(
        Bar(width, thickness, material), f"bar of {format_millimetres(width, thickness)}, {material:g} kg/m3", overhang
    )


def _rod(diameter: float, material: float, overhang: float = 0.0) -> LinkBody:
    return LinkBody(Rod(diameter, material), f"rod of {format_millimetres(diameter)}, {material:g} kg/m3", overhang)


def _tube(outer: float, inner: float, material: float, overhang: float = 0.0) -> LinkBody:
    return LinkBody(
        Tube(outer, inner, material), f"tube of {format_millimetres(outer, inner)}, {material:g} kg/m3", overhang
    )


def _plate(thickness: float, corners: tuple[Any, ...], material: float) -> LinkBody:
    words = f"plate of {format_millimetres(thickness)}, {len(corners)} corners, {material:g} kg/m3"
    return LinkBody(Plate(thickness, material), words, corners=corners)


#: The densest solid, osmium, has 22.6 g/cm3; a smaller number without a unit is probably in g/cm3, not kg/m3.
_DENSEST = 22.6


def _material(value: Any, name: str) -> float:
    """Return the density (kg/m3) of a material; raise ParameterError if it is a number that is probably in g/cm3."""
    number = density(value, name)
    if not isinstance(value, str) and number <= _DENSEST:
        raise ParameterError(name, value, f'have its unit, such as "{value:g} g/cm3"; a number alone is in kg/m3')
    return number


_LENGTH = Quantity("m", above=0.0)
_COMMON: Mapping[str, Reader] = {"material": _material, "overhang": Quantity("m", least=0.0)}
#: The kinds of a ``section`` with their entries.
SECTIONS: Mapping[str, Table] = {
    "bar": Table(_bar, {"width": _LENGTH, "thickness": _LENGTH, **_COMMON}),
    "rod": Table(_rod, {"diameter": _LENGTH, **_COMMON}),
    "tube": Table(_tube, {"outer": _LENGTH, "inner": _LENGTH, **_COMMON}),
    "plate": Table(
        _plate, {"thickness": _LENGTH, "corners": Many(Many(Quantity("m"), length=2), least=3), "material": _material}
    ),
}
