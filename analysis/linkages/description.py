"""Describe a planar linkage as data: bodies with named points, the joints between them, the forces on them.

Bodies with a point of the same name are pinned together there. Every other kind of joint has a table of its own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Any

from linkwork.errors import LinkworkError, ParameterError

from .. import files
from ..files import Kinds, Many, Quantity, Table, entry
from ..sections import LONGEST
from .laws import Law, constants, law
from .sections import SECTIONS

GROUND = "ground"
#: Frame of a load whose components are along the axes of the body on which it acts.
BODY = "body"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*")


class LinkageError(LinkworkError):
    """Error for a linkage that cannot move as described: its bodies, joints and freedoms do not fit together."""


def coordinate(value: Any, name: str) -> float:
    """Read a length; the whole number 0 means that the coordinate is always zero and is not a parameter."""
    if value == 0 and isinstance(value, int) and value is not False:
        return value
    if abs(number := Quantity("m")(value, name)) >= LONGEST:
        raise ParameterError(name, value, f"be within {LONGEST:g} m of zero")
    return number


def is_given(value: Any) -> bool:
    """Return whether an entry of a spring or freedom is given.

    The default, the whole number 0, means that it is not given; 0.0 and "0 N/m" are given values.
    """
    return value != 0 or not isinstance(value, int)


def _name(value: Any, name: str) -> str:
    """Read the name of a point, a body or a joint."""
    text = files.text(value, name)
    if not _NAME.fullmatch(text):
        raise ParameterError(name, value, "be a name of letters and digits that begins with a letter")
    return text


def _named_entries(reader: Any) -> Any:
    """Return the reader of a table whose entries have names chosen by the user; ``reader`` reads the value of an entry."""

    def read(value: Any, name: str) -> dict[str, Any]:
        return {
            _name(key, f"{name}.{key}"): reader(v, f"{name}.{key}") for key, v in files.as_table(value, name).items()
        }

    return read


_PLACE = Many(coordinate, length=2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A moving body, described in its own coordinate frame; see `Builder.body`."""

    points: Mapping[str, tuple[float, float]] = entry(_named_entries(_PLACE), factory=dict)
    bar: tuple[str, ...] = entry(Many(_name, length=2), ())
    length: float = entry(Quantity("m", above=0.0, below=LONGEST), 0.0)
    mass: float | None = entry(Quantity("kg", least=0.0), None)
    inertia: float | None = entry(Quantity("kg.m2", least=0.0), None)
    cog: tuple[float, ...] | None = entry(_PLACE, None)
    section: Any = entry(Kinds(SECTIONS), None)

    @property
    def all_points(self) -> dict[str, tuple[float, float]]:
        """Return all points, including those of the bar (m)."""
        ends = {self.bar[0]: (0, 0), self.bar[1]: (self.length, 0)} if self.bar else {}
        return {**ends, **self.points}


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A straight line of a body.

    Attributes
    ----------
    on : str
        The body.
    through : str
        A point of the body on the line, from which positions along the line are measured.
    direction : float
        Direction of the line in the body (rad).
    """

    on: str = entry(_name)
    through: str = entry(_name)
    direction: float = entry(Quantity("rad"), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slide(Line):
    """A block that slides along a line of another body, by default of the ground, without rotating relative to it.

    See `Builder.slide`.
    """

    on: str = entry(_name, GROUND)
    body: str = entry(_name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slot(Line):
    """A straight slot in a body, and a pin of another body in the slot; see `Builder.slot`."""

    pin: str = entry(_name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gear:
    """A pair of gears: two bodies, each pinned to the same third body; see `Builder.gear`."""

    bodies: tuple[str, str] = entry(Many(_name, length=2))
    ratio: float = entry(Quantity("1"))
    phase: float = entry(Quantity("rad"), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rack:
    """A toothed rack and its gear on a carrier body: the gear is pinned to the carrier; rack and carrier slide on each other.

    See `Builder.rack`.
    """

    gear: str = entry(_name)
    rack: str = entry(_name)
    radius: float = entry(Quantity("m"))
    offset: float = entry(Quantity("m"), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spring:
    """A spring with damper and dry friction: between two points, about a pin, along a slide, or as a shaft between two bodies.

    See `Builder.spring`. ``constants`` has the value and the unit of each constant in the formula of the law, by name.
    """

    between: tuple[str, ...] = entry(Many(_name, length=2), ())
    at: str = entry(_name, "")
    bodies: tuple[str, ...] = entry(Many(_name, length=2), ())
    stiffness: Any = entry(files.any_value, 0)
    damping: Any = entry(files.any_value, 0)
    free: Any = entry(files.any_value, 0)
    friction: Any = entry(files.any_value, 0)
    law: Law = entry(law, "")
    constants: Mapping[str, tuple[float, str]] = entry(constants, factory=dict)
    driven: bool = entry(files.flag, False)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointLoad:
    """An input force at a point.

    Attributes
    ----------
    point : str
        Name of the point, on a moving body; if several bodies are pinned there, the force acts on the first.
    frame : str
        Axes of the components: ``ground``, or ``body`` for the axes of the body on which the force acts.
    """

    point: str = entry(_name)
    frame: str = entry(files.Choice((GROUND, BODY)), GROUND)


def _load(value: Any, name: str) -> PointLoad:
    """Read a load from a table, or from the name of its point alone."""
    return files.read(PointLoad, {"point": value} if isinstance(value, str) else value, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreedomTable:
    """A degree of freedom: a joint whose coordinate is independent; see `Builder.freedom`."""

    joint: str = entry(_name)
    start: Any = entry(files.any_value, 0)
    speed: Any = entry(files.any_value, 0)
    driven: bool | None = entry(files.flag, None)


def _freedom(value: Any, name: str) -> FreedomTable:
    """Read a freedom from a table, or from the name of its joint alone."""
    return files.read(FreedomTable, {"joint": value} if isinstance(value, str) else value, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """A planar linkage.

    Attributes
    ----------
    name : str
        Letters, digits and hyphens.
    title, source : str
        Title, and source of the data.
    ground : mapping of str to (x, y)
        Points of the ground (m).
    bodies, slides, slots, gears, racks, springs : mapping
        Parts of the linkage, by name.
    freedoms : mapping of str to FreedomTable
        One to four degrees of freedom, by name; if none is given, they are chosen automatically.
    assembly : mapping of str to int
        Assembly of each dyad, +1 or -1, by the name of the joint between its two bodies; +1 by default.
    friction : mapping
        Coulomb friction proportional to the joint force, by the name of the joint: for a pin the friction radius (m), which is
        coefficient times pin radius; for a slide or a slot the coefficient.
    loads : tuple of PointLoad
        Forces that can act on points; in the axes of the ground if only the point is named.
    torques : tuple of str
        Bodies on which torques can act.
    gravity : float
        Acceleration of gravity (m/s2).
    gravity_direction : float
        Direction of gravity (rad).
    """

    name: str = entry(files.text)
    title: str = entry(files.text, "")
    source: str = entry(files.text, "described")
    ground: Mapping[str, tuple[float, float]] = entry(_named_entries(_PLACE))
    bodies: Mapping[str, Body] = entry(_named_entries(Table(Body)))
    slides: Mapping[str, Slide] = entry(_named_entries(Table(Slide)), factory=dict)
    slots: Mapping[str, Slot] = entry(_named_entries(Table(Slot)), factory=dict)
    gears: Mapping[str, Gear] = entry(_named_entries(Table(Gear)), factory=dict)
    racks: Mapping[str, Rack] = entry(_named_entries(Table(Rack)), factory=dict)
    springs: Mapping[str, Spring] = entry(_named_entries(Table(Spring)), factory=dict)
    freedoms: Mapping[str, FreedomTable] = entry(_named_entries(_freedom), factory=dict)
    assembly: Mapping[str, int] = entry(_named_entries(files.Whole()), factory=dict)
    friction: Mapping[str, Any] = entry(_named_entries(files.any_value), factory=dict)
    loads: tuple[PointLoad, ...] = entry(Many(_load), ())
    torques: tuple[str, ...] = entry(Many(_name), ())
    gravity: float = entry(Quantity("m/s2", least=0.0), 0.0)
    gravity_direction: float = entry(Quantity("rad"), -0.5 * pi)
