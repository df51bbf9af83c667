"""Write the picture of a described linkage."""

from __future__ import annotations

from typing import NamedTuple

from .description import is_given
from .parameters import Interface, length_and_mass
from .structure import FreedomStep, GearStep, Pin, carrier_joints, sliders
from .writing import function, quote


class PicturePoint(NamedTuple):
    """A point of the picture: its name, its label, the expression of its position, and whether it only positions parts."""

    name: str
    text: str
    place: str
    aid: bool = True


class Picture:
    """Writer of the picture of one linkage: its joints and parts."""

    def __init__(self, interface: Interface) -> None:
        self.description, self.structure, self.interface = interface.description, interface.structure, interface

    def points_and_parts(self) -> tuple[list[PicturePoint], list[str]]:
        """Return the points of the picture, and its parts from the back to the front."""
        d, parts, length = self.description, [], length_and_mass(self.interface)[0]
        points = dict.fromkeys(own for of in self.interface.points.values() for own in of)
        joints = [PicturePoint(own, f"point {own}", f"*(b.at_{own}.x, b.at_{own}.y, 0.0)", False) for own in points]
        lines = sliders(self.structure)
        for name, joint in lines.items():
            block = joint.bodies[1]
            line, start, origin = f"b.{name}_line", f"b.at_{joint.through}", f"{block}_frame.origin"
            end = f"*({start}.x + {length!r} * {line}.c, {start}.y + {length!r} * {line}.s, 0.0)"
            joints.append(PicturePoint(f"{name}Block", f"the {block}", f"*(b.{origin}.x, b.{origin}.y, 0.0)"))
            joints.append(PicturePoint(f"{name}End", f"direction of {name}", end))
            along = f'("{name}Block", "{joint.through}", "{name}End")'
            springs = [own for own, spring in d.springs.items() if spring.at == name and is_given(spring.stiffness)]
            parts.append(f'Part("guide", ("{joint.through}", "{name}End"), "line of {name}")')
            parts += [f'Part("spring", {along}, "{own}", "{own}.stiffness")' for own in springs]
            parts.append(f'Part("slider", {along}, "{block}")')
        for name, rack in d.racks.items():
            pin, slide, _ = carrier_joints(name, rack, self.structure.joints)
            side, line = "" if slide.bodies[1] == rack.rack else "-", f"b.{slide.name}_line"
            x, y = (f"b.at_{pin.name}.{c} {s} {side}p.{name}_radius * {line}.{t}" for c, s, t in ("x+s", "y-c"))
            joints.append(PicturePoint(f"{name}Pitch", f"pitch point of {name}", f"*({x}, {y}, 0.0)"))
            ends = f"{name}Line", f"{name}LineEnd"
            for end, sign in zip(ends, "-+"):
                place = f"{x} {sign} {0.5 * length!r} * {line}.c, {y} {sign} {0.5 * length!r} * {line}.s"
                joints.append(PicturePoint(end, f"pitch line of {rack.rack}", f"*({place}, 0.0)"))
            parts.append(f'Part("axis", {ends!r}, "pitch line of {rack.rack}")')
            tick = f"arm(b.{rack.gear}_frame.turn, p.{name}_radius, 0.0)"
            joints.append(self.tick(name, rack.gear, pin.name, tick))
            parts.append(f'Part("gear", ("{pin.name}", "{name}{rack.gear}Tick"), "pitch circle of {rack.gear}")')
        for name, gear in d.gears.items():
            carrier, pins = self.bearings(gear.bodies)
            (x0, y0), (x1, y1) = (self.interface.coordinates(carrier, pin) for pin in pins)
            # the pitch point divides the line of centres so that both gears have the same velocity there
            share = f"p.{name}_ratio * (p.{name}_ratio - 1.0) / ((p.{name}_ratio - 1.0) ** 2 + 1e-12)"
            for wheel, bearing, part in zip(gear.bodies, pins, (share, f"({share} - 1.0)"), strict=True):
                tick = f"arm({self.interface.turn(wheel, 'b.')}, {part} * ({x1} - {x0}), {part} * ({y1} - {y0}))"
                joints.append(self.tick(name, wheel, bearing, tick))
                parts.append(f'Part("gear", ("{bearing}", "{name}{wheel}Tick"), "pitch circle of {wheel}")')
        parts += [f'Part("pivot", ("{own}",), "bearing {own}")' for own in d.ground if own in self.structure.joints]
        parts += [f'Part("axis", {s.between!r}, "{name}")' for name, s in d.springs.items() if s.between]
        for name, body in d.bodies.items():
            blocks = [f"{own}Block" for own, joint in lines.items() if joint.bodies[1] == name]
            through = (*body.all_points, *(blocks if len(body.all_points) < 2 else ()))
            if len(through) > 1:
                parts.append(f'Part("link", {through!r}, "{name}")')
        return joints, parts

    def tick(self, pair: str, gear: str, pin: str, arm: str) -> PicturePoint:
        """Return a mark on the pitch circle of a gear; ``arm`` is the expression of the vector from the ``pin`` to the mark."""
        return PicturePoint(
            f"{pair}{gear}Tick", f"mark on {gear}", f"*(b.at_{pin}.x + {arm}.x, b.at_{pin}.y + {arm}.y, 0.0)"
        )

    def bearings(self, bodies: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
        """Return the name of the body that carries two gears, and the names of the pins that join the gears to this body."""
        step = next(s for s in self.structure.steps if isinstance(s, GearStep) and {s.body, s.mate} == set(bodies))
        return step.parent, tuple(self.structure.common_pin(own, step.parent) for own in bodies)

    def positions(self) -> str:
        """Write the function that computes the positions of the picture's points."""
        rows = ("b = places(x, p)", "return (", *(f"    {joint.place}," for joint in self.points_and_parts()[0]), ")")
        signature = "positions(x: tuple[float, ...], i: Applied, p: Constants) -> tuple[float, ...]"
        return function(signature, "Compute the places of the points of the picture.", rows)

    def drag_argument(self, point: PicturePoint) -> str:
        """Return the source of the argument `Joint.moves` of a point: up to two parameters that dragging it changes.

        A point that only positions parts cannot be dragged, and has the argument `Joint.aid` instead.
        """
        if point.aid:
            return "aid=True"
        own, names = point.name, {p.name for p in self.interface.parameters}
        moves: list[str] = []
        for body, points in self.interface.points.items():
            if own in points:
                bar = self.description.bodies[body].bar if body in self.description.bodies else ()
                found = [f"{body}.length"] if bar and own == bar[1] else [f"{body}.{own}_{axis}" for axis in "xy"]
                turned = [
                    f"initial.{self.interface.drives[step.freedom].name}_angle"
                    for step in self.structure.steps
                    if isinstance(step, FreedomStep)
                    and step.body == body
                    and isinstance(step.joint, Pin)
                    and bar
                    and own == bar[1]
                ]
                moves += [name for name in found if name in names] + turned
        return f"({''.join(f'{quote(name)}, ' for name in moves[:2])})"

    def paths(self) -> list[str]:
        """Return the points whose paths are drawn: all points of moving bodies that are not joints.

        If there are none, return the last pin between moving bodies.
        """
        moving = [own for body in self.description.bodies for own in self.interface.points[body]]
        alone = [own for own in dict.fromkeys(moving) if own not in self.structure.joints]
        return alone or [own for own in dict.fromkeys(moving) if own not in self.description.ground][-1:]
