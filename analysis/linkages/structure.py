"""Split a described linkage into freedoms and dyads, pairs of bodies whose poses follow in closed form.

The solution begins at the ground. A body is known if its pose is determined. Each step adds a body whose joint with a known
body is a freedom, a gear or rack that meshes with a known one, or a dyad: two bodies joined to each other and each to a known
body (Assur group of class II).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice
from typing import Any, NamedTuple

from linkwork.errors import LinkworkError

from ..files import unknown_name
from .description import GROUND, Description, FreedomTable, LinkageError, Rack

MOST_FREEDOMS = 4


class Pin(NamedTuple):
    """A pin: it joins bodies at a point that all of them have."""

    name: str
    bodies: tuple[str, ...]


class Slider(NamedTuple):
    """A block on a line through a point of another body; ``inclined`` if the line is not parallel to that body's x axis."""

    name: str
    bodies: tuple[str, str]
    through: str
    inclined: bool

    @property
    def axes(self) -> str:
        """Return the name of the slide if its line is inclined, so that arms along it must be turned; else an empty text."""
        return self.name if self.inclined else ""


Joint = Pin | Slider


class FreedomStep(NamedTuple):
    """Step that adds a body whose joint with the known body ``parent`` is a freedom.

    ``sign`` is -1 if ``body`` is the first body of the joint, otherwise +1.
    """

    body: str
    parent: str
    joint: Joint
    freedom: int
    sign: int

    @property
    def bodies(self) -> tuple[str, ...]:
        """Return the one body that the step adds."""
        return (self.body,)


class GearStep(NamedTuple):
    """Step that adds a gear whose angle follows from the angle of its mate; both are pinned to ``parent``.

    ``gear`` is the name of the pair in the description; ``inverse`` says whether the mate is the second gear of the pair.
    """

    body: str
    parent: str
    pin: Pin
    gear: str
    mate: str
    inverse: bool


class RackStep(NamedTuple):
    """Step that adds a rack whose position follows from its gear, or a gear whose angle follows from its rack.

    ``body`` follows from ``mate``, and ``joint`` joins it to the carrier ``parent``. ``rack`` is the name of the pair in the
    description; ``pin`` joins the gear and ``slide`` the rack to the carrier. ``linear`` says whether the travel of the slide
    is linear in the coordinates.
    """

    body: str
    parent: str
    joint: Joint
    rack: str
    mate: str
    pin: Pin
    slide: Slider
    linear: bool

    @property
    def turns(self) -> bool:
        """Return whether the gear follows from the rack, instead of the rack from the gear."""
        return self.joint is self.pin


class Side(NamedTuple):
    """One side of a dyad: a body, its joint with the known body ``parent``, and steps that place more bodies relative to it."""

    body: str
    parent: str
    joint: Joint
    inside: tuple[FreedomStep | Dyad, ...]

    @property
    def bodies(self) -> tuple[str, ...]:
        """Return the names of the side's bodies, ``body`` first."""
        return (self.body, *(body for step in self.inside for body in step.bodies))


class Dyad(NamedTuple):
    """A dyad: two sides, each joined to a known body, and to each other by the inner joint of the bodies ``ends``.

    ``kind`` is RRR, RRP, PRP, RPR or RPP: R is a pin, P a slide, and the middle letter is the inner joint. If one side is
    pinned and the other slides, the pinned side is the first.
    """

    kind: str
    sides: tuple[Side, Side]
    inner: Joint
    ends: tuple[str, str]

    @property
    def bodies(self) -> tuple[str, ...]:
        """Return the bodies of both sides."""
        return (*self.sides[0].bodies, *self.sides[1].bodies)

    @property
    def inner_dyads(self) -> Iterator[Dyad]:
        """Yield the dyads inside the sides in their order, and this dyad last."""
        for side in self.sides:
            for step in side.inside:
                if isinstance(step, Dyad):
                    yield from step.inner_dyads
        yield self

    @property
    def has_two_assemblies(self) -> bool:
        """Return whether there are two assemblies to choose from."""
        return self.kind in ("RRR", "RRP", "RPR")


Step = FreedomStep | GearStep | RackStep | Dyad


@dataclass(frozen=True, slots=True)
class Structure:
    """Order in which the poses of a linkage are computed.

    Attributes
    ----------
    bodies : tuple of str
        All moving bodies, including the massless pins of slots.
    joints : mapping of str to Joint
    freedoms : mapping of str to FreedomTable
    steps : tuple of Step
        In the order of the computation.
    """

    bodies: tuple[str, ...]
    joints: Mapping[str, Joint]
    freedoms: Mapping[str, FreedomTable]
    steps: tuple[Step, ...]

    def common_pin(self, one: str, other: str) -> str:
        """Return the name of the first pin that joins two bodies."""
        pins = (joint for joint in self.joints.values() if isinstance(joint, Pin))
        return next(pin.name for pin in pins if {one, other} <= set(pin.bodies))

    @property
    def dyads(self) -> tuple[Dyad, ...]:
        """Return the dyads in the order of the computation, inner dyads before those that contain them."""
        return tuple(dyad for step in self.steps if isinstance(step, Dyad) for dyad in step.inner_dyads)


def joints(description: Description) -> dict[str, Joint]:
    """Return the joints of a description by name.

    LinkageError is raised if a joint names a body or point that does not exist, or a body is joined to nothing.
    """
    owners: dict[str, list[str]] = {name: [GROUND] for name in description.ground}
    for name, body in description.bodies.items():
        for own in body.all_points:
            owners.setdefault(own, []).append(name)
    known = (GROUND, *description.bodies)
    for name, slide in description.slides.items():
        _check_line(f"linkage.slides.{name}", (slide.on, slide.body), slide.through, owners, known)
        if slide.body in (GROUND, slide.on):
            raise LinkageError(
                f"linkage.slides.{name}.body is {slide.body}: it must be a moving body other than the body with the line"
            )
    for name, slot in description.slots.items():
        _check_line(f"linkage.slots.{name}", (slot.on,), slot.through, owners, known)
    for name, slot in description.slots.items():
        if slot.pin not in owners:
            raise unknown_name(slot.pin, owners, f"point {slot.pin}, named in linkage.slots.{name}")
        owners[slot.pin].append(name)
    found: dict[str, Joint] = {name: Pin(name, tuple(of)) for name, of in owners.items() if len(of) > 1}
    lines = {name: Slider(name, (s.on, s.body), s.through, s.direction != 0) for name, s in description.slides.items()}
    lines |= {name: Slider(name, (s.on, name), s.through, s.direction != 0) for name, s in description.slots.items()}
    for name in lines:
        if name in found:
            table = "slides" if name in description.slides else "slots"
            raise LinkageError(
                f"linkage.{table}.{name} has the name of a point: each joint must have a name of its own"
            )
    found |= lines
    for name, gear in description.gears.items():
        for part in gear.bodies:
            if part not in known:
                raise unknown_name(part, known, f"body {part}, named in linkage.gears.{name}")
    for name, rack in description.racks.items():
        for part in (rack.gear, rack.rack):
            if part not in known:
                raise unknown_name(part, known, f"body {part}, named in linkage.racks.{name}")
        carrier_joints(name, rack, found)
    for own in description.bodies:
        if not any(own in joint.bodies for joint in found.values()):
            raise LinkageError(
                f"linkage.bodies.{own} is joined to nothing: it must share a point with another, or slide on one"
            )
    return found


def carrier_joints(name: str, rack: Rack, found: Mapping[str, Joint]) -> tuple[Pin, Slider, str]:
    """Return the pin of a gear, the slide of its rack, and the carrier: the body to which both are joined.

    LinkageError is raised if the gear is not pinned to the body on which its rack slides.
    """
    for slide in found.values():
        if isinstance(slide, Slider) and rack.rack in slide.bodies:
            carrier = slide.bodies[slide.bodies[0] == rack.rack]
            for pin in found.values():
                if isinstance(pin, Pin) and {rack.gear, carrier} <= set(pin.bodies) and rack.gear != carrier:
                    return pin, slide, carrier
    raise LinkageError(
        f"linkage.racks.{name} has the gear {rack.gear} and the rack {rack.rack}: there must be a body to which the gear is "
        "pinned, and on which the rack slides"
    )


def _check_line(
    where: str, bodies: tuple[str, ...], through: str, owners: Mapping[str, list[str]], known: tuple[str, ...]
) -> None:
    """Raise an error if the body of a line does not exist, or does not have the point of the line."""
    for body in bodies:
        if body not in known:
            raise unknown_name(body, known, f"body {body}, named in {where}")
    if bodies[0] not in owners.get(through, ()):
        raise LinkageError(f"{where}.through is {through!r}: it must be a point of {bodies[0]}")


def sliders(structure: Structure) -> dict[str, Slider]:
    """Return the slides and slots by name."""
    return {name: joint for name, joint in structure.joints.items() if isinstance(joint, Slider)}


def lost_freedoms(description: Description, found: Mapping[str, Joint]) -> dict[str, int]:
    """Return the number of freedoms that each joint, gear pair and rack removes, by its name."""
    lost = {name: 2 * (len(joint.bodies) - 1) for name, joint in found.items()}
    return lost | dict.fromkeys((*description.gears, *description.racks), 1)


def _count_freedoms(description: Description) -> int:
    """Count the freedoms of a linkage by Gruebler's rule."""
    moving = len(description.bodies) + len(description.slots)
    return 3 * moving - sum(lost_freedoms(description, joints(description)).values())


def _removal_hint(description: Description) -> str:
    """Return a hint that names an entry whose removal would let an immobile linkage move; empty if there is none."""
    hints = []
    for table in ("racks", "gears", "slots", "slides", "bodies"):
        entries = getattr(description, table)
        for name in reversed(entries):
            others: Any = {table: {own: entry for own, entry in entries.items() if own != name}}
            try:
                count = _count_freedoms(replace(description, **others))
            except LinkworkError:  # another entry refers to the removed entry
                continue
            if 1 <= count <= MOST_FREEDOMS:
                hints.append((count, f"; without linkage.{table}.{name} it has {count}"))
    return min(hints, key=lambda hint: hint[0], default=(0, ""))[1]


def _check_pairs(found: Mapping[str, Joint]) -> None:
    """Raise LinkageError if two joints join the same two bodies."""
    joined: dict[tuple[str, ...], str] = {}
    for name, joint in found.items():
        for pair in combinations(sorted(joint.bodies), 2):
            if pair in joined:
                one, other = sorted(pair, key=lambda body: body == GROUND)
                raise LinkageError(
                    f"linkage.bodies.{one} is joined to {other} twice, by {joined[pair]} and by {name}: then neither can move "
                    "relative to the other; remove one of these joints"
                )
            joined[pair] = name


def analyse(description: Description) -> Structure:
    """Find the order in which the poses of all bodies follow in closed form from the freedoms.

    LinkageError is raised if the number of freedoms is wrong, or the bodies are not a chain of dyads with these freedoms; the
    error names the bodies whose poses do not follow, and other possible choices of freedoms.
    """
    if not description.bodies:
        raise LinkageError("linkage.bodies is empty: there must be at least one moving body")
    found = joints(description)
    lost, moving = lost_freedoms(description, found), len(description.bodies) + len(description.slots)
    count = _count_freedoms(description)
    freedoms = dict(description.freedoms)
    says = (
        f"{description.name} has {count} freedoms by Gruebler's count, 3 of each of {moving} bodies less "
        f"{', '.join(f'{taken} at {name}' for name, taken in lost.items())}"
    )
    if not 1 <= count <= MOST_FREEDOMS:
        hint = (
            _removal_hint(description)
            if count < 1
            else "; more joints in linkage.slides or common points take some away"
        )
        raise LinkageError(f"{says}: it must have 1 to {MOST_FREEDOMS}{hint}")
    _check_pairs(found)
    if not freedoms:
        # the first joints that will do, each freedom named after its joint's second body
        some = next(_choices(description, found, count), ())
        freedoms = {found[name].bodies[1]: FreedomTable(joint=name) for name in some}
        if not some:
            raise LinkageError(f"{description.name} is not a chain of dyads, whatever joints are taken as freedoms")
    if len(freedoms) != count:
        raise LinkageError(
            f"{says}, but linkage.freedoms has {len(freedoms)} ({', '.join(freedoms)}): the two numbers must be equal"
        )
    for name, freedom in freedoms.items():
        # the second force of a pin C of three bodies is called C2
        shared = (
            pin for pin in found if len(found[pin].bodies) > 2 and re.fullmatch(rf"{re.escape(pin)}\d+", freedom.joint)
        )
        of = freedom.joint if freedom.joint in found else next(shared, "")
        if not of:
            raise unknown_name(freedom.joint, found, f"joint {freedom.joint}, named in linkage.freedoms.{name}")
        if len(found[of].bodies) != 2:
            raise LinkageError(
                f"the freedom {name} is at the pin {of} of {', '.join(found[of].bodies)}: it must be at a joint of two bodies; "
                "give the other bodies a point of another name there"
            )
    steps, left = _solve(description, found, [f.joint for f in freedoms.values()])
    if left:
        others = [" and ".join(some) for some in islice(_choices(description, found, count), 3)]
        driven = "a driven spring drives another joint"
        hint = f"; possible freedoms are the joints {' or '.join(others)}; {driven}" if others else ""
        why = _teeth_hint(description, left) or "are not dyads: their poses do not follow one pair after the other"
        raise LinkageError(
            f"with {', '.join(f.joint for f in freedoms.values())} as freedoms the bodies {', '.join(left)} {why}"
            f"{hint or ', nor with any other joints as freedoms'}"
        )
    names = (*description.bodies, *description.slots)
    return Structure(names, found, freedoms, tuple(steps))


def _teeth_hint(description: Description, left: list[str]) -> str:
    """Return why the first gear or rack does not follow although the pose of its mate is known; else an empty text."""
    pairs = {f"linkage.gears.{name}": gear.bodies for name, gear in description.gears.items()}
    pairs |= {f"linkage.racks.{name}": (rack.gear, rack.rack) for name, rack in description.racks.items()}
    for where, pair in pairs.items():
        for body, mate in (pair, pair[::-1]):
            if body in left and mate not in left:
                return (
                    f"do not follow: by {where} {body} meshes with {mate}, whose angle must follow directly from the freedoms, "
                    "like the angle of a crank or of a gear on a crank, and not through a dyad, like the angle of a rocker"
                )
    return ""


def _choices(description: Description, found: Mapping[str, Joint], count: int) -> Iterator[tuple[str, ...]]:
    """Yield the sets of ``count`` joints that, taken as freedoms, determine the poses of all bodies.

    Joints on the ground are tried first.
    """
    simple = [name for name, joint in found.items() if len(joint.bodies) == 2 and name not in description.slots]
    simple.sort(key=lambda name: GROUND not in found[name].bodies)
    return (some for some in combinations(simple, count) if not _solve(description, found, list(some))[1])


def _tree(root: str, found: Mapping[str, Joint], freed: list[str]) -> list[FreedomStep]:
    """Return the steps that place the bodies that freedoms connect to the body ``root``, each step after that of its parent."""
    steps: list[FreedomStep] = []
    there = {root}
    growing = True
    while growing:
        growing = False
        for number, name in enumerate(freed):
            first, second = found[name].bodies
            for parent, body, sign in ((first, second, 1), (second, first, -1)):
                if parent in there and body not in there:
                    steps.append(FreedomStep(body, parent, found[name], number, sign))
                    there.add(body)
                    growing = True
    return steps


def _solve(description: Description, found: Mapping[str, Joint], freed: list[str]) -> tuple[list[Step], list[str]]:
    """Return the steps of the solution, and the undetermined bodies; ``freed`` has the names of the joints of freedoms."""
    tree = _tree(GROUND, found, freed)
    steps: list[Step] = [*tree]
    #: bodies whose poses are known, in order; bodies whose angles, and slides whose positions, are linear in the coordinates
    known = dict.fromkeys((GROUND, *(step.body for step in tree)))
    linear, travels = set(known), set(freed)
    moving = [*description.bodies, *description.slots]
    fixed = [joint for name, joint in found.items() if name not in freed]
    step: Step | None
    while unknown := [body for body in moving if body not in known]:
        if step := next(_gear_steps(description, fixed, linear, unknown), None):
            new = [step.body]
            linear.add(step.body)
        elif racked := next(_rack_steps(description, found, fixed, known, linear, travels), None):
            step, new = racked, [racked.body]
            if racked.linear:
                linear.add(racked.body)
                travels.add(racked.slide.name)
        elif dyad := _next_dyad(fixed, {body: _tree(body, found, freed) for body in unknown}, known):
            step, new = dyad, list(dyad.bodies)
        else:
            return steps, unknown
        steps.append(step)
        known |= dict.fromkeys(new)
        if not isinstance(step, Dyad) and step.body in linear:
            # bodies that freedoms join to a gear or a rack follow with it
            hung = [own for own in _tree(step.body, found, freed) if own.body not in known]
            steps += hung
            known |= dict.fromkeys(own.body for own in hung)
            linear |= {own.body for own in hung}
    return steps, []


def _next_dyad(fixed: list[Joint], trees: Mapping[str, list[FreedomStep]], known: Mapping[str, None]) -> Dyad | None:
    """Return the next dyad that is joined to known bodies; None if there is none.

    Each side is a body with the bodies that freedoms join to it. If there is no such dyad, sides may also contain dyads.
    """
    if dyad := next(_dyads(fixed, trees, known), None):
        return dyad
    groups: dict[str, list[FreedomStep | Dyad]] = {}
    for body, tree in trees.items():
        if not any(_connecting_joints(fixed, set(known), {body})):
            continue
        own: list[FreedomStep | Dyad] = list(tree)
        there = dict.fromkeys((body, *(step.body for step in tree)))
        while inner := next(
            (
                dyad
                for dyad in _dyads(fixed, {b: trees[b] for b in trees if b not in there}, there)
                if dyad.kind == "RRR" and not there.keys() & set(dyad.bodies)
            ),
            None,
        ):
            own.append(inner)
            there |= dict.fromkeys(inner.bodies)
        groups[body] = own
    return next(_dyads(fixed, groups, known), None)


def _gear_steps(
    description: Description, fixed: list[Joint], linear: set[str], unknown: list[str]
) -> Iterator[GearStep]:
    """Yield a step for each unknown gear whose mate and carrier have angles that are linear in the coordinates."""
    pins = [joint for joint in fixed if isinstance(joint, Pin)]
    for name, gear in description.gears.items():
        for (mate, body), inverse in ((gear.bodies, False), (gear.bodies[::-1], True)):
            if mate not in linear or body not in unknown:
                continue
            for pin in pins:
                carriers = [c for c in pin.bodies if body in pin.bodies and c in linear and c != mate]
                if carriers:
                    yield GearStep(body, carriers[0], pin, name, mate, inverse)


def _rack_steps(
    description: Description,
    found: Mapping[str, Joint],
    fixed: list[Joint],
    known: Mapping[str, None],
    linear: set[str],
    travels: set[str],
) -> Iterator[RackStep]:
    """Yield a step for each rack whose gear is known, and for each gear whose rack is known.

    ``travels`` are the slides whose positions are linear in the coordinates.
    """
    for name, rack in description.racks.items():
        pin, slide, carrier = carrier_joints(name, rack, found)
        if rack.rack not in known and slide in fixed and {rack.gear, carrier} <= linear:
            yield RackStep(rack.rack, carrier, slide, name, rack.gear, pin, slide, True)
        if rack.gear not in known and pin in fixed and {rack.rack, carrier} <= known.keys():
            all_linear = slide.name in travels and carrier in linear
            yield RackStep(rack.gear, carrier, pin, name, rack.rack, pin, slide, all_linear)


def _connecting_joints(fixed: list[Joint], first: set[str], second: set[str]) -> Iterator[tuple[Joint, str, str]]:
    """Yield each joint between a body of ``first`` and a body of ``second``, with these two bodies."""
    for joint in fixed:
        ends = [next((body for body in joint.bodies if body in some), "") for some in (first, second)]
        if all(ends):
            yield joint, ends[0], ends[1]


def _dyads(
    fixed: list[Joint], trees: Mapping[str, Sequence[FreedomStep | Dyad]], known: Mapping[str, None]
) -> Iterator[Dyad]:
    """Yield the dyads that are joined to known bodies.

    ``trees`` has, for each unknown body, the steps that place further bodies relative to this body.
    """
    base = set(known)
    sides = [
        Side(body, parent, joint, tuple(inside))
        for body, inside in trees.items()
        for joint, parent, _ in _connecting_joints(fixed, base, {body})
    ]
    for one, other in combinations(sides, 2):
        if set(one.bodies) & set(other.bodies) or one.joint.name == other.joint.name:
            continue
        pair = (one, other) if isinstance(one.joint, Pin) else (other, one)
        for inner, first, second in _connecting_joints(fixed, set(pair[0].bodies), set(pair[1].bodies)):
            if inner.name in (one.joint.name, other.joint.name):
                continue
            kind = _dyad_kind(pair, inner)
            # an inner slide must join the two bodies that are joined to known ones, not bodies inside the sides
            if kind and (isinstance(inner, Pin) or (first, second) == (pair[0].body, pair[1].body)):
                yield Dyad(kind, pair, inner, (first, second))


def _dyad_kind(sides: tuple[Side, Side], inner: Joint) -> str:
    """Return the kind of a dyad from its three joints; empty if the joints do not determine the dyad's pose."""
    pinned = sum(isinstance(side.joint, Pin) for side in sides)
    if isinstance(inner, Pin):
        return ("PRP", "RRP", "RRR")[pinned]
    return ("", "RPP", "RPR")[pinned]
