"""Parameters of a described linkage: their FMI names, their values, and the expressions by which the equations use them."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import inf, isfinite, lcm
from typing import NamedTuple

from linkwork.errors import ParameterError
from linkwork.parameters import field_name

from ..files import Quantity, unknown_name
from .description import BODY, GROUND, Body, Description, LinkageError, Spring, is_given
from .laws import is_periodic
from .structure import Dyad, FreedomStep, GearStep, Pin, RackStep, Slider, Structure


class Parameter(NamedTuple):
    """A parameter of a linkage: FMI name, unit, meaning and value.

    ``rule`` is ``positive``, ``free`` (any sign), ``sign`` (+1 or -1), or empty for a value that must not be negative. ``role``
    and ``of`` are those of the parameter's `Variable`: ``of`` is the coordinate on which a stiffness or damping acts.
    """

    name: str
    unit: str
    text: str
    value: float
    rule: str = ""
    role: str = ""
    of: str = ""

    @property
    def field(self) -> str:
        """Return the name of the field in the dataclass of the parameters."""
        return field_name(self.name)


class Drive(NamedTuple):
    """A degree of freedom of a linkage: its FMI names, unit, and initial coordinate and rate.

    ``table`` is the prefix of the names of its inputs, empty if it cannot be driven. ``turns`` says whether it is an angle,
    and ``commanded`` whether its rate is commanded by default. ``turns_back`` is the number of turns after which all bodies are
    back in the same poses, or 0 if they never are.
    """

    name: str
    joint: str
    turns: bool
    coordinate: str
    rate: str
    start: float
    speed: float
    table: str
    commanded: bool
    turns_back: int

    @property
    def variable(self) -> str:
        """Return the name of the coordinate in the equations."""
        return f"q_{self.name}"

    @property
    def unit(self) -> str:
        """Return the unit of the coordinate."""
        return "rad" if self.turns else "m"

    @property
    def load(self) -> str:
        """Return the last part of the name of the torque or force input: ``torque`` or ``force``."""
        return "torque" if self.turns else "force"

    @property
    def load_unit(self) -> str:
        """Return the unit of the torque or force input."""
        return "N.m" if self.turns else "N"


class Load(NamedTuple):
    """An applied force or torque that drives no freedom: FMI name, unit, meaning, and output for its displacement, if any."""

    name: str
    unit: str
    text: str
    displacement: str

    @property
    def field(self) -> str:
        """Return the name of the field among the inputs of the equations."""
        return field_name(self.name)


@dataclass(frozen=True, slots=True)
class Interface:
    """The FMI interface of a described linkage: parameters, freedoms, loads, and the expressions of its points.

    Attributes
    ----------
    description : Description
    structure : Structure
    parameters : tuple of Parameter
    drives : tuple of Drive
        The degrees of freedom, in the order of the coordinates.
    loads : tuple of Load
    points : mapping
        Coordinates of each point in the frame of its body, as expressions in the parameters.
    centres : mapping
        Coordinates of the centre of mass of each body, also as expressions in the parameters; massless bodies are left out.
    """

    description: Description
    structure: Structure
    parameters: tuple[Parameter, ...]
    drives: tuple[Drive, ...]
    loads: tuple[Load, ...]
    points: Mapping[str, Mapping[str, tuple[str, str]]]
    centres: Mapping[str, tuple[str, str]]

    def coordinates(self, body: str, point: str) -> tuple[str, str]:
        """Return the coordinates of a point in the frame of its body; zero if the body has no such point."""
        return self.points[body].get(point, ("0.0", "0.0"))

    def frame(self, body: str, of: str = "") -> str:
        """Return the source text for the pose of a body; ``of`` is the name of the variable of poses, with its dot: "b."."""
        return f"{of}{body}_frame" if body != GROUND else f"ground({len(self.drives)})"

    def turn(self, body: str, of: str = "") -> str:
        """Return the source text for the direction of a body; for ``of`` see `frame`."""
        return f"{of}{body}_frame.turn" if body != GROUND else f"fixed_direction(1.0, 0.0, {len(self.drives)})"

    def twisted_bodies(self, spring: Spring) -> tuple[str, ...]:
        """Return the two bodies between which a spring is twisted; empty if it is not a torsion spring."""
        joint = self.structure.joints.get(spring.at)
        return spring.bodies or (joint.bodies if isinstance(joint, Pin) else ())

    def centred_springs(self, counted: Container[str]) -> list[str]:
        """Return the torsion springs that have a force law but no free angle, and whose whole turns are not counted.

        The angle x of such a law is kept within half a turn of the angle in the described pose, not of zero, so that the torque
        does not jump at 180 deg.
        """
        return [
            name
            for name, spring in self.description.springs.items()
            if self.twisted_bodies(spring) and name not in counted and not is_given(spring.free)
            if spring.law and needs_turns(spring)
        ]

    def travel(self, slide: Slider) -> str:
        """Return the source text for position and velocity of a block along its line; ``b`` is the variable of poses in it."""
        (holder, block), (x, y) = slide.bodies, self.coordinates(slide.bodies[0], slide.through)
        return f"block_position({self.frame(holder, 'b.')}, {x}, {y}, b.{slide.name}_line, b.{block}_frame)"


def freedoms(description: Description, structure: Structure) -> tuple[Drive, ...]:
    """Return the freedoms with their names in the FMI interface."""
    tables = structure.freedoms
    first, *later = tables
    if tables[first].driven is None and not is_given(tables[first].speed):
        first = next((n for n in later if tables[n].driven is None and is_given(tables[n].speed)), first)
    driven = [name for name, table in tables.items() if (name == first if table.driven is None else table.driven)]
    found: list[Drive] = []
    for name, table in tables.items():
        turns = isinstance(structure.joints[table.joint], Pin)
        unit, rate_unit = ("rad", "rad/s") if turns else ("m", "m/s")
        where = f"linkage.freedoms.{name}"
        inputs = "" if name not in driven else "drive" if len(driven) == 1 else f"{name}Drive"
        found.append(
            Drive(
                name,
                table.joint,
                turns,
                f"{name}.{'angle' if turns else 'position'}",
                f"{name}.{'speed' if turns else 'velocity'}",
                Quantity(unit)(table.start, f"{where}.start"),
                Quantity(rate_unit)(table.speed, f"{where}.speed"),
                inputs,
                bool(inputs) and is_given(table.speed),
                _returning_turns(description, structure, len(found)) if turns else 0,
            )
        )
    return tuple(found)


def needs_turns(spring: Spring) -> bool:
    """Return whether the torque of a torsion spring changes if it is twisted by a further whole turn."""
    return is_given(spring.stiffness) or bool(spring.law and not is_periodic(spring.law, spring.constants))


def _returning_turns(description: Description, structure: Structure, freedom: int) -> int:
    """Count the turns of a freedom after which all gears are back at their angles; 0 if never, or if a rack is displaced."""
    turns = 1
    for turned in rotations(description, structure, freedom).values():
        if not isfinite(turned):
            return 0
        share = Fraction(turned).limit_denominator(100)
        if abs(turned - share) > 1e-9:
            return 0
        turns = lcm(turns, share.denominator)
    return turns


def rotations(description: Description, structure: Structure, freedom: int) -> dict[str, float]:
    """Return the rotation of each body per rotation of a freedom, by name; infinite for a rack that is displaced.

    Bodies of dyads, whose rotations are not proportional to that of a freedom, are left out.
    """
    angles = {GROUND: 0.0}
    for step in structure.steps:
        carrier = angles.get(step.parent, 0.0) if not isinstance(step, Dyad) else 0.0
        if isinstance(step, FreedomStep):
            own = step.freedom == freedom and isinstance(step.joint, Pin)
            angles[step.body] = carrier + (step.sign if own else 0)
        elif isinstance(step, GearStep):
            ratio = description.gears[step.gear].ratio
            factor = 1.0 / ratio if step.inverse else ratio
            angles[step.body] = carrier + factor * (angles[step.mate] - carrier)
        elif isinstance(step, RackStep):
            angles[step.body] = carrier if step.turns or angles[step.mate] == carrier else inf
    return angles


def interface(description: Description, structure: Structure) -> Interface:
    """Return the parameters of a linkage and the expressions of its points.

    Raises
    ------
    LinkageError, ParameterError
        If a value is missing or of the wrong kind.
    """
    drives = freedoms(description, structure)
    found: list[Parameter] = []
    points: dict[str, dict[str, tuple[str, str]]] = {GROUND: {}}
    centres: dict[str, tuple[str, str]] = {}

    def expression(name: str, value: float, text: str, rule: str = "free", role: str = "") -> str:
        if value == 0 and isinstance(value, int):
            return "0.0"
        found.append(Parameter(name, "m", text, float(value), rule, role))
        return f"p.{found[-1].field}"

    def place(body: str, own: str, at: tuple[float, float]) -> tuple[str, str]:
        x, y = (
            expression(f"{body}.{own}_{axis}", value, f"Point {own} of the {body}, {axis}")
            for axis, value in zip("xy", at)
        )
        return x, y

    for own, at in description.ground.items():
        points[GROUND][own] = place(GROUND, own, at)
    for name, body in description.bodies.items():
        points[name] = {}
        if body.bar:
            if body.length <= 0.0:
                raise LinkageError(
                    f"linkage.bodies.{name} is a bar from {body.bar[0]} to {body.bar[1]}: it must have a length"
                )
            length = expression(
                f"{name}.length", body.length, f"Length of the {name}, {' to '.join(body.bar)}", "positive"
            )
            points[name] = {body.bar[0]: ("0.0", "0.0"), body.bar[1]: (length, "0.0")}
        for own, at in body.points.items():
            points[name][own] = place(name, own, at)
        mass = _mass(name, body)
        if mass is not None:
            found.append(Parameter(f"{name}.mass", "kg", f"Mass of the {name}", mass.mass))
            if mass.inertia is not None:
                text = f"Moment of inertia of the {name} about its centre of mass"
                found.append(Parameter(f"{name}.inertia", "kg.m2", text, mass.inertia))
            x, y = (
                expression(f"{name}.cog_{axis}", value, f"Centre of mass of the {name}, {axis}", role="centre of mass")
                for axis, value in zip("xy", mass.centre)
            )
            centres[name] = (x, y)
    for name in description.slots:
        points[name] = {description.slots[name].pin: ("0.0", "0.0")}
    found += _joint_parameters(description, structure)
    found += _friction(description, structure)
    by_joint = {drive.joint: drive for drive in drives}
    for name, spring in description.springs.items():
        found += _spring(name, description, structure, by_joint.get(spring.at))
    if description.gravity:
        found.append(Parameter("gravity", "m/s2", "Acceleration of gravity", description.gravity, role="gravity"))
        direction = description.gravity_direction
        found.append(Parameter("ground.gravity_direction", "rad", "Direction of gravity", direction, "free", "gravity"))
    found += _assemblies(description, structure)
    loads = tuple(_loads(description, structure, points))
    inputs = [*(f"{drive.table or drive.name}.{drive.load}" for drive in drives), *(load.name for load in loads)]
    for name in inputs:
        if inputs.count(name) > 1:
            places = "linkage.freedoms, linkage.torques and linkage.springs"
            raise LinkageError(f"two inputs would be called {name}: one of those in {places} must have another name")
    return Interface(description, structure, tuple(found), drives, loads, points, centres)


def _joint_parameters(description: Description, structure: Structure) -> Iterator[Parameter]:
    """Yield the parameters of slides, slots, gears and racks."""
    for joint in structure.joints.values():
        if isinstance(joint, Slider) and joint.inclined:
            table = (description.slides | description.slots)[joint.name]  # type: ignore[operator]
            text = f"Direction of the line of {joint.name} in the {joint.bodies[0]}"
            yield Parameter(f"{joint.name}.direction", "rad", text, table.direction, "free")
    for name, gear in description.gears.items():
        first, second = gear.bodies
        yield Parameter(
            f"{name}.ratio", "1", f"Speed of the {second} by that of the {first}", gear.ratio, "free", "ratio"
        )
        text = f"Angle of the {second} where that of the {first} is zero"
        yield Parameter(f"{name}.phase", "rad", text, gear.phase, "free")
    for name, rack in description.racks.items():
        yield Parameter(
            f"{name}.radius", "m", f"Travel of the {rack.rack} by the angle of the {rack.gear}", rack.radius, "free"
        )
        text = f"Position of the {rack.rack} where the angle of the {rack.gear} is zero"
        yield Parameter(f"{name}.offset", "m", text, rack.offset, "free")


def _friction(description: Description, structure: Structure) -> Iterator[Parameter]:
    """Yield the parameters of friction that grows with the forces in joints."""
    slots = {joint: slot for slot in description.slots for joint in structure.joints.values() if slot in joint.bodies}
    usable = [n for n, j in structure.joints.items() if len(j.bodies) == 2 and not (isinstance(j, Pin) and j in slots)]
    for name, value in description.friction.items():
        joint = structure.joints.get(name)
        if joint is None or name not in usable:
            of, reason = joint or structure.joints.get(name.rstrip("0123456789")), ""
            if of and len(of.bodies) > 2:
                reason = f"; {of.name} is of {', '.join(of.bodies)}: give the {of.bodies[-1]} a point of its own at the same "
                reason += f"place, such as {of.name}x"
            elif of in slots:
                reason = f"; the friction of the pin {of.name} is that of its slot {slots[of]}"
            raise LinkageError(
                f"linkage.friction has {name}: it must be a slot, or a joint of two bodies: {', '.join(usable)}{reason}"
            )
        if isinstance(joint, Pin):
            own, unit, text = "friction_radius", "m", f"Friction radius of the pin {name}: coefficient times its radius"
        else:
            own, unit, text = "friction_coefficient", "1", f"Coefficient of friction of {name}"
        number = Quantity(unit, least=0.0)(value, f"linkage.friction.{name}")
        yield Parameter(f"{name}.{own}", unit, text, number, role="friction")


def _assemblies(description: Description, structure: Structure) -> Iterator[Parameter]:
    """Yield the signs of the dyads that can be assembled in two ways."""
    dyads = {dyad.inner.name: dyad for dyad in structure.dyads if dyad.has_two_assemblies}
    for name in description.assembly:
        if name not in dyads:
            there = ", ".join(dyads) or "none here"
            raise LinkageError(f"linkage.assembly has {name}: the joints with two assemblies are {there}")
    for name, dyad in dyads.items():
        sign = description.assembly.get(name, 1)
        if sign not in (1, -1):
            raise ParameterError(f"linkage.assembly.{name}", sign, "be +1 or -1")
        one, other = (side.body for side in dyad.sides)
        yield Parameter(f"{name}.assembly", "", f"Assembly of {one} and {other}", sign, "sign")


def _loads(
    description: Description, structure: Structure, points: Mapping[str, Mapping[str, tuple[str, str]]]
) -> Iterator[Load]:
    """Yield the applied forces and torques that drive no freedom."""
    moving = {own for body in description.bodies for own in points[body]}
    for load in description.loads:
        own = load.point
        if own not in moving:
            raise unknown_name(own, sorted(moving), f"point {own}, named in linkage.loads")
        turns = load.frame == BODY
        of = f" of the {next(body for body in description.bodies if own in points[body])}" if turns else ""
        fixed = turns or own in description.ground
        for c in "xy":
            yield Load(f"{own}.load_{c}", "N", f"Load on {own}, {c}{of}", "" if fixed else f"{own}.{c}")
    for body in description.torques:
        if body not in description.bodies:
            raise unknown_name(body, description.bodies, f"body {body}, named in linkage.torques")
        yield Load(f"{body}.torque", "N.m", f"Torque on the {body}", "")
    for name, spring in description.springs.items():
        for own in spring.between:
            if own not in moving | set(description.ground):
                raise unknown_name(own, sorted(moving), f"point {own}, named in linkage.springs.{name}.between")
        if spring.driven and spring.between:
            yield Load(f"{name}.force", "N", f"Force that lengthens {name}", f"{name}.length")
        elif spring.driven:
            about = bool(spring.bodies) or isinstance(structure.joints[spring.at], Pin)
            yield Load(f"{name}.{'torque' if about else 'force'}", "N.m" if about else "N", f"Drive of {name}", "")


class _Mass(NamedTuple):
    """Mass, centre of mass and moment of inertia of a body; the moment of inertia may be None."""

    mass: float
    centre: tuple[float, float]
    inertia: float | None


def _mass(name: str, body: Body) -> _Mass | None:
    """Return the mass properties of a body, as given or from its section; None for a massless body."""
    where = f"linkage.bodies.{name}"
    if body.section is not None:
        if body.inertia is not None or body.cog is not None:
            raise LinkageError(
                f"{where} has a section: its centre of mass and inertia follow from it, and must not be given"
            )
        if not body.bar and not body.section.corners:
            raise LinkageError(f"{where}.section is not a plate: the body must have a bar and its length")
        try:
            mass, centre, inertia = body.section.properties(body.length)
        except ParameterError as error:
            raise ParameterError(f"{where}.section.corners", error.value, error.requirement) from None
        if not 0.0 < mass < inf:
            raise LinkageError(f"{where}.section has a mass of {mass:g} kg: it must be above zero and finite")
        x, y = (0 if abs(c) < 1e-12 else float(c) for c in centre)
        # a mass given together with a section was weighed; the radius of gyration remains that of the section
        own = mass if body.mass is None else body.mass
        return _Mass(float(own), (x, y), float(inertia * own / mass))
    if body.mass is None:
        if body.inertia is not None or body.cog is not None:
            raise LinkageError(f"{where} has an inertia or a centre of mass: it must have a mass, too")
        return None
    centre = body.cog if body.cog is not None else (0.5 * body.length, 0) if body.bar else (0, 0)
    return _Mass(body.mass, (centre[0], centre[1]), body.inertia)


def spring_angle_name(description: Description, name: str) -> str:
    """Return the name of the angle of a torsion spring, such as ``A.turn``.

    It begins with the name of the pin, or with that of the spring if the spring has no pin or the pin has several springs.
    """
    pin = description.springs[name].at
    alone = sum(spring.at == pin for spring in description.springs.values()) == 1
    return f"{pin if pin and alone else name}.turn"


def _spring(name: str, description: Description, structure: Structure, drive: Drive | None) -> Iterator[Parameter]:
    """Yield the parameters that the description gives for a spring; ``drive`` is the freedom at its joint, if any."""
    where, spring = f"linkage.springs.{name}", description.springs[name]
    if (bool(spring.between), bool(spring.at), bool(spring.bodies)).count(True) != 1:
        raise LinkageError(
            f"{where} is between {spring.between or 'nothing'}, at {spring.at or 'nothing'} and of the bodies "
            f"{spring.bodies or 'none'}: it must have exactly one of between, at and bodies"
        )
    joint = structure.joints.get(spring.at)
    if spring.at and (joint is None or len(joint.bodies) != 2):
        names = ", ".join(n for n, j in structure.joints.items() if len(j.bodies) == 2)
        raise LinkageError(f"{where} is at {spring.at}: it must be at a joint of two bodies, {names}")
    about = isinstance(joint, Pin) or bool(spring.bodies)
    kind, unit = ("angle", "rad") if about else ("length" if spring.between else "position", "m")
    if spring.between:
        of = f"{name}.length"
    elif drive:
        of = drive.coordinate
    else:
        of = spring_angle_name(description, name) if about else f"{spring.at}.position"
    rows = (
        ("stiffness", spring.stiffness, "N.m/rad" if about else "N/m", f"Stiffness of {name}", "", "stiffness"),
        ("damping", spring.damping, "N.m.s/rad" if about else "N.s/m", f"Viscous damping of {name}", "", "damping"),
        ("friction", spring.friction, "N.m" if about else "N", f"Level of Coulomb friction of {name}", "", "friction"),
        (f"free_{kind}", spring.free, unit, f"The {kind} at which {name} is free", "free", "spring"),
    )
    for own, value, in_unit, text, rule, role in rows:
        if is_given(value):
            reader = Quantity(in_unit) if rule else Quantity(in_unit, least=0.0)
            number = reader(value, f"{where}.{own.removesuffix(f'_{kind}')}")
            yield Parameter(
                f"{name}.{own}", in_unit, text, number, rule, role, of if role in ("stiffness", "damping") else ""
            )
    for own, (number, in_unit) in spring.constants.items():
        text = f"Constant {own.replace('_', ' ')} of the law of {name}"
        yield Parameter(f"{name}.{own}", in_unit, text, number, "free", "law")


def length_and_mass(found: Interface) -> tuple[float, float]:
    """Return the greatest length or coordinate (m), and the total mass of the bodies (kg); each 1 if it is zero."""
    lengths = [abs(p.value) for p in found.parameters if p.unit == "m" and p.role not in ("spring", "law", "friction")]
    masses = [p.value for p in found.parameters if p.unit == "kg"]
    return max(lengths, default=1.0) or 1.0, sum(masses) or 1.0
