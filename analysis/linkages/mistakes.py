"""Find mistakes in a description that involve several entries: duplicate names, and parts that join or move nothing."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import chain

from linkwork.errors import ParameterError

from .description import GROUND, Description, LinkageError, is_given
from .laws import check_law


def check_entries(description: Description) -> None:
    """Check that the entries of a description fit together.

    Raises
    ------
    LinkageError, ParameterError
        If an entry does not fit. The message says where it is in the file, and what would be right.
    """
    d = description
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9-]*", d.name):
        raise ParameterError("linkage.name", d.name, "have letters, digits and hyphens, and begin with a letter")
    owners: dict[str, set[str]] = {own: {GROUND} for own in d.ground}
    for name, body in d.bodies.items():
        for own in body.all_points:
            owners.setdefault(own, set()).add(name)
    checks = (_names, _bodies, _bodies_without_length, _gears, _slots, _springs, _freedoms, _duplicates)
    for where, wrong, right in chain.from_iterable(check(d, owners) for check in checks):
        raise LinkageError(f"linkage.{where} {wrong}: {right}")


#: Mistakes: where each one is, what is wrong, what would be right.
Found = Iterator[tuple[str, str, str]]


def _duplicates(d: Description, owners: Mapping[str, set[str]]) -> Found:
    for where, names in (("loads", [load.point for load in d.loads]), ("torques", d.torques)):
        for name in names:
            if names.count(name) > 1:
                yield where, f"has {name} twice", "once is enough"


#: Tables of variables that every linkage has.
_RESERVED = ("initial", "solver", "energy", "assembly")


def _names(d: Description, owners: Mapping[str, set[str]]) -> Found:
    for table in ("bodies", "slides", "slots", "gears", "racks", "springs", "freedoms"):
        for name in getattr(d, table):
            if name in _RESERVED:
                yield f"{table}.{name}", "has a name that is taken", f"no entry may be called {', '.join(_RESERVED)}"
    for table in ("slides", "slots"):
        for name in getattr(d, table):
            if name in owners:
                yield f"{table}.{name}", "has the name of a point", "it must have another"


def _bodies_without_length(d: Description, owners: Mapping[str, set[str]]) -> Found:
    """Yield the bodies whose pins all coincide, which may be a mistake.

    Left out are blocks and guides, since a block may carry several rods on one axis, and bodies all of whose pins are freedoms,
    such as a shaft that carries a second shaft on the same axis.
    """
    freed = {freedom.joint for freedom in d.freedoms.values()}
    sliding = {body for slide in d.slides.values() for body in (slide.body, slide.on)}
    for name, body in d.bodies.items():
        pins = {own: place for own, place in body.all_points.items() if len(owners[own]) > 1}
        if len(pins) > 1 and len(set(pins.values())) == 1 and name not in sliding and not pins.keys() <= freed:
            one, other = list(pins)[:2]
            yield f"bodies.{name}.points.{other}", f"is where {one} is", "the body must have a length between its pins"


def _bodies(d: Description, owners: Mapping[str, set[str]]) -> Found:
    if not d.ground:
        yield "ground", "has no points", "at least one body must be pinned to it or slide on it"
    for name, body in d.bodies.items():
        if name in (GROUND, *d.slots):
            yield f"bodies.{name}", "has a name that is taken", "ground and the slots cannot be names of bodies"
        if len(set(body.bar)) == 1:
            yield f"bodies.{name}.bar", f"is from {body.bar[0]} to {body.bar[0]}", "its ends must be two points"
        for own in body.bar:
            if own in body.points:
                yield f"bodies.{name}.points.{own}", "is an end of the bar", "each point must be given once"
    if d.bodies and not any(body.mass or body.section for body in d.bodies.values()):
        yield "bodies", "have no mass", "at least one of them must have a mass or a section"


def _gears(d: Description, owners: Mapping[str, set[str]]) -> Found:
    for name, gear in d.gears.items():
        if gear.bodies[0] == gear.bodies[1]:
            yield f"gears.{name}.bodies", f"are {gear.bodies[0]} twice", "they must be two"
        pair = " and ".join(gear.bodies)
        carriers = [set().union(*(of for of in owners.values() if body in of)) for body in gear.bodies]
        shared = carriers[0] & carriers[1] - set(gear.bodies)
        if set(gear.bodies) <= d.bodies.keys() and not shared:
            yield f"gears.{name}.bodies", f"are {pair}", "they must be pinned to the ground or to one third body"
        for carrier in sorted(shared):
            points = d.ground if carrier == GROUND else d.bodies[carrier].all_points
            axes = [{points[own] for own, of in owners.items() if {body, carrier} <= of} for body in gear.bodies]
            if axes[0] & axes[1]:
                right = "teeth need two axes; a countershaft on an axis of its own, with two pairs of gears, joins such shafts"
                yield f"gears.{name}.bodies", f"are {pair}, on one axis of the {carrier}", right
        if gear.ratio == 0.0:
            yield f"gears.{name}.ratio", "is 0", "it must not be zero"
    for name, rack in d.racks.items():
        if rack.radius == 0.0:
            yield f"racks.{name}.radius", "is 0", "it must not be zero"

    joints = {*owners, *d.slides, *d.slots}
    for table in ("gears", "racks"):
        for name in getattr(d, table):
            if name in joints:
                yield f"{table}.{name}", "has the name of a point, a slide or a slot", "it must have another"


def _slots(d: Description, owners: Mapping[str, set[str]]) -> Found:
    for name, slot in d.slots.items():
        if slot.on in owners.get(slot.pin, ()):
            yield f"slots.{name}.pin", f"is {slot.pin}, a point of {slot.on}", "it must be one of other bodies"


def _springs(d: Description, owners: Mapping[str, set[str]]) -> Found:
    for name, spring in d.springs.items():
        where = f"springs.{name}"
        ends = [owners.get(own, set()) for own in spring.between]
        if ends and ends[0] & ends[1]:
            body, pair = min(ends[0] & ends[1]), " and ".join(spring.between)
            yield f"{where}.between", f"has {pair}, both of {body}", "they must be points of two bodies"
        if spring.bodies and not (set(spring.bodies) <= {*d.bodies, GROUND} and len(set(spring.bodies)) == 2):
            known = ", ".join((*d.bodies, GROUND))
            yield f"{where}.bodies", f"are {' and '.join(spring.bodies)}", f"they must be two of {known}"
        check_law(spring.law, spring.constants, f"linkage.{where}.law")
        acts = map(is_given, (spring.stiffness, spring.damping, spring.friction))
        if not (any(acts) or spring.law or spring.driven):
            yield where, "does nothing", "it must have a stiffness, damping, friction or law, or be driven"


def _freedoms(d: Description, owners: Mapping[str, set[str]]) -> Found:
    taken: dict[str, str] = {}
    for name, freedom in d.freedoms.items():
        slide = d.slides.get(freedom.joint)
        joined = owners.get(freedom.joint, set()) if slide is None else {slide.on, slide.body}
        if freedom.joint in taken and len(joined) <= 2:
            yield (
                f"freedoms.{name}",
                f"is at {freedom.joint}, as {taken[freedom.joint]} is",
                "it must be at another joint",
            )
        taken[freedom.joint] = name
        if name in d.bodies and len(joined) == 2 and name not in joined:
            pair = " and ".join(sorted(joined))
            yield f"freedoms.{name}", f"is at {freedom.joint}, which joins {pair}", f"it must not be called {name}"
