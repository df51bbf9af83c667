"""A planar linkage as data: bodies with named points, what joins them, what acts on them.

Bodies that have a point of the same name are pinned to each other there. Whatever else joins them has a table of its own.
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
from .laws import constants, law
from .sections import SECTIONS

GROUND = "ground"
#: Frame of a load whose components are along the axes of the body on which it acts.
BODY = "body"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*")


class LinkageError(LinkworkError):
    """A described linkage is none that can be moved: its bodies, joints and freedoms do not fit together."""


def coordinate(value: Any, name: str) -> float:
    """Read a length; the whole number 0 stands for a coordinate that is always zero, and no parameter."""
    return value if value == 0 and isinstance(value, int) and value is not False else Quantity("m")(value, name)


def given(value: Any) -> bool:
    """Return whether an entry of a spring is there: the whole number 0 stands for none."""
    return value != 0 or not isinstance(value, int)


def _name(value: Any, name: str) -> str:
    """Read the name of a point, a body or a joint."""
    text = files.text(value, name)
    if not _NAME.fullmatch(text):
        raise ParameterError(name, value, "be a name of letters and digits that begins with a letter")
    return text


def _named(reader: Any) -> Any:
    """Return the reader of a table whose entries have names of the user's choice."""

    def read(value: Any, name: str) -> dict[str, Any]:
        return {
            _name(key, f"{name}.{key}"): reader(v, f"{name}.{key}") for key, v in files.as_table(value, name).items()
        }

    return read


_PLACE = Many(coordinate, length=2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A moving body, in coordinates of its own.

    Attributes
    ----------
    points : mapping of str to (x, y)
        Its points (m). Either these, or ``bar``, or a bar and further points.
    bar : tuple of str
        Two points: the first is the body's origin, the second lies at ``length`` along its x axis.
    length : float
        Of the bar (m).
    mass, inertia : float
        Mass (kg) and moment of inertia about the centre of mass (kg.m2).
    cog : tuple of float
        Centre of mass (m); by default the body's origin, of a bar its middle.
    section : table
        Section and material, from which mass, centre of mass and inertia follow: of a bar, or a plate with corners.
    """

    points: Mapping[str, tuple[float, float]] = entry(_named(_PLACE), factory=dict)
    bar: tuple[str, ...] = entry(Many(_name, length=2), ())
    length: float = entry(Quantity("m", above=0.0), 0.0)
    mass: float | None = entry(Quantity("kg", least=0.0), None)
    inertia: float | None = entry(Quantity("kg.m2", least=0.0), None)
    cog: tuple[float, ...] | None = entry(_PLACE, None)
    section: Any = entry(Kinds(SECTIONS), None)

    @property
    def all_points(self) -> dict[str, tuple[float, float]]:
        """The points with those of the bar (m)."""
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
        A point of the body on the line, the zero of positions along it.
    direction : float
        Of the line in the body (rad).
    """

    on: str = entry(_name)
    through: str = entry(_name)
    direction: float = entry(Quantity("rad"), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slide(Line):
    """A body that slides along a line of another, by default of the ground, without turning against it.

    Attributes
    ----------
    body : str
        The block: its origin is on the line, and its x axis along it.
    """

    on: str = entry(_name, GROUND)
    body: str = entry(_name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Slot(Line):
    """A straight slot of a body, and a pin of another in it.

    Attributes
    ----------
    pin : str
        The point in the slot.
    """

    pin: str = entry(_name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gear:
    """A pair of gears: two bodies, each pinned to the same third.

    Attributes
    ----------
    bodies : tuple of str
        The gears.
    ratio : float
        Speed of the second by that of the first, seen from the third body; negative for external gears.
    phase : float
        Angle of the second at which that of the first is zero, from the third body (rad).
    """

    bodies: tuple[str, str] = entry(Many(_name, length=2))
    ratio: float = entry(Quantity("1"))
    phase: float = entry(Quantity("rad"), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rack:
    """A toothed rack and its gear, on one body: the rack slides on it, or it on the rack, and the gear is pinned to it.

    Attributes
    ----------
    gear, rack : str
        The bodies.
    radius : float
        Pitch radius of the gear (m): travel of the slide by the angle of the gear, seen from the third body; of either sign.
    offset : float
        Position of the slide at which that angle is zero (m).
    """

    gear: str = entry(_name)
    rack: str = entry(_name)
    radius: float = entry(Quantity("m"))
    offset: float = entry(Quantity("m"), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spring:
    """A spring with a damper and dry friction: between two points, about a pin or along a slide, or a shaft of two bodies.

    Attributes
    ----------
    between : tuple of str
        Two points, or
    at : str
        a joint, or
    bodies : tuple of str
        two bodies: it is twisted by the angle of the second from the first, up to half a turn, wherever they are.
    stiffness, damping : float
        In N/m and N.s/m; about a pin in N.m/rad and N.m.s/rad.
    free : float
        Length, position (m) or angle (rad) at which the spring is free.
    friction : float
        Level of Coulomb friction (N, N.m), smooth about rest.
    law : str or list of (x, force)
        A further force against the stretch x, as a formula in x and its rate v such as "2e5*x**3 + 4*v", or as a table,
        between whose rows it is straight (SI). Its work counts as dissipated.
    constants : mapping of str to (float, str)
        Of the formula, by their names in it: values and units. They are parameters.
    driven : bool
        Whether an input drives it, as of a cylinder or a linear motor: a force that lengthens it, a torque that turns it.
    """

    between: tuple[str, ...] = entry(Many(_name, length=2), ())
    at: str = entry(_name, "")
    bodies: tuple[str, ...] = entry(Many(_name, length=2), ())
    stiffness: Any = entry(files.unchanged, 0)
    damping: Any = entry(files.unchanged, 0)
    free: Any = entry(files.unchanged, 0)
    friction: Any = entry(files.unchanged, 0)
    law: str = entry(law, "")
    constants: Mapping[str, tuple[float, str]] = entry(constants, factory=dict)
    driven: bool = entry(files.flag, False)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointLoad:
    """A force at a point, an input.

    Attributes
    ----------
    point : str
        Of a moving body; where several are pinned it acts on the first.
    frame : str
        Whose axes its components have: ``ground``, or ``body``, the one on which it acts.
    """

    point: str = entry(_name)
    frame: str = entry(files.Choice((GROUND, BODY)), GROUND)


def _load(value: Any, name: str) -> PointLoad:
    """Read a load: a table, or its point alone."""
    return files.read(PointLoad, {"point": value} if isinstance(value, str) else value, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class FreedomTable:
    """A joint whose coordinate is a freedom.

    Attributes
    ----------
    joint : str
        A pin: the angle of its second body from the first; or a slide: the position of its block.
    start : float
        At the start (rad, m).
    speed : float
        Commanded at the start and by default (rad/s, m/s), also where it is given as 0 with a unit; of a freedom that is not
        driven its rate at the start.
    driven : bool
        Whether its rate can be commanded; by default the first freedom's.
    """

    joint: str = entry(_name)
    start: Any = entry(files.unchanged, 0)
    speed: Any = entry(files.unchanged, 0)
    driven: bool | None = entry(files.flag, None)


def _freedom(value: Any, name: str) -> FreedomTable:
    """Read a freedom: a table, or the name of its joint alone."""
    return files.read(FreedomTable, {"joint": value} if isinstance(value, str) else value, name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """A planar linkage.

    Attributes
    ----------
    name : str
        Letters, digits and hyphens.
    title, source : str
        What it is, and where it is from.
    ground : mapping of str to (x, y)
        Points of the ground (m).
    bodies, slides, slots, gears, racks, springs : mapping
        By name.
    freedoms : mapping of str to FreedomTable
        By name, one to four; where none are given they are proposed.
    assembly : mapping of str to int
        +1 or -1 by the joint between the two bodies of a dyad, +1 by default.
    friction : mapping
        Friction that grows with the force in a joint, by its name: of a pin the friction radius (m), coefficient times its
        radius; of a slide or a slot the coefficient.
    loads : tuple of PointLoad
        Forces that can act on points, in the axes of the ground where only the point is named.
    torques : tuple of str
        Bodies on which torques can act.
    gravity : float
        Acceleration of gravity (m/s2).
    gravity_direction : float
        Direction in which it acts (rad).
    """

    name: str = entry(files.text)
    title: str = entry(files.text, "")
    source: str = entry(files.text, "described")
    ground: Mapping[str, tuple[float, float]] = entry(_named(_PLACE))
    bodies: Mapping[str, Body] = entry(_named(Table(Body)))
    slides: Mapping[str, Slide] = entry(_named(Table(Slide)), factory=dict)
    slots: Mapping[str, Slot] = entry(_named(Table(Slot)), factory=dict)
    gears: Mapping[str, Gear] = entry(_named(Table(Gear)), factory=dict)
    racks: Mapping[str, Rack] = entry(_named(Table(Rack)), factory=dict)
    springs: Mapping[str, Spring] = entry(_named(Table(Spring)), factory=dict)
    freedoms: Mapping[str, FreedomTable] = entry(_named(_freedom), factory=dict)
    assembly: Mapping[str, int] = entry(_named(files.Whole()), factory=dict)
    friction: Mapping[str, Any] = entry(_named(files.unchanged), factory=dict)
    loads: tuple[PointLoad, ...] = entry(Many(_load), ())
    torques: tuple[str, ...] = entry(Many(_name), ())
    gravity: float = entry(Quantity("m/s2", least=0.0), 0.0)
    gravity_direction: float = entry(Quantity("rad"), -0.5 * pi)
