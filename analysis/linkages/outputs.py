"""Write the outputs of a described linkage: their variables, and the function that computes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from .description import is_given
from .dynamics import Motion
from .parameters import needs_turns, spring_angle_name
from .structure import Dyad, Pin, Slider, sliders
from .variables import display_argument, symbol
from .writing import function, quote


class Output(NamedTuple):
    """An output: name, unit, meaning, further arguments of its variable (``rest``), and the expression of its value."""

    name: str
    unit: str
    text: str
    rest: str
    value: str

    @property
    def variable(self) -> str:
        """Return the source text that declares the output's variable."""
        known = f'"{self.name}", "{self.unit}", {quote(self.text)}, {quote(symbol(self.name, self.unit))}'
        return f"output({known}{self.rest and f', {self.rest}'})"


_DEGREES = 'display="deg"'
#: Arguments of the variable of an angle that leaps from pi to -pi: these are its bounds.
_WRAPPED = f"*POSITION, minimum=-pi, maximum=pi, {_DEGREES}"


class Outputs:
    """Writer of the outputs of one linkage."""

    def __init__(self, motion: Motion) -> None:
        self.motion, self.description = motion, motion.description
        self.structure, self.interface = motion.structure, motion.interface

    def names(self) -> list[str]:
        """Return the names of the outputs, without the energies."""
        return [output.name for output in self._outputs()]

    def variables(self) -> Iterator[str]:
        """Yield the source texts of the output variables, in their order."""
        yield from (output.variable for output in self._outputs())
        lost = "dampers and friction"
        if any(spring.law for spring in self.description.springs.values()):
            lost = "dampers and friction, and against force laws, which may give it back,"
        sources = ("springs and gravity", lost, "drives and loads")
        yield f"*energy_outputs({', '.join(map(quote, sources))})"

    def _outputs(self) -> Iterator[Output]:
        """Yield the outputs in their order, without the energies."""
        n = len(self.interface.drives)
        for k, drive in enumerate(self.interface.drives):
            turn, rate_unit = drive.turns, f"{drive.unit}/s"
            text = f"{'Angle' if turn else 'Position'} of the freedom {drive.name}, at {drive.joint}"
            shown = f"*POSITION, {_DEGREES}" if turn else "*POSITION"
            yield Output(drive.coordinate, drive.unit, text, shown, f"x[{k}]")
            shown = f'*RATE, rate_of="{drive.coordinate}"{display_argument(rate_unit)}'
            yield Output(drive.rate, rate_unit, f"Rate of the freedom {drive.name}", shown, f"x[{n + k}]")
            name, of = f"{drive.name}.acceleration", f'rate_of="{drive.rate}"'
            text = f"Acceleration of the freedom {drive.name}"
            yield Output(name, f"{rate_unit}2", text, of, f"m.accelerations[{k}]")
        for k, drive in enumerate(self.interface.drives):
            if drive.table:
                text = f"The {drive.load} that drives {drive.name}: given, or as the commanded rate requires"
                role = f'role="drive", of="{drive.coordinate}"'
                yield Output(f"{drive.table}.applied_{drive.load}", drive.load_unit, text, role, f"m.loads[{k}]")
        taken = {drive.coordinate for drive in self.interface.drives}
        for body in self.description.bodies:
            if f"{body}.angle" not in taken:
                value = f"turn_angle(b.{body}_frame.turn)"
                yield Output(f"{body}.angle", "rad", f"Direction of the {body}", _WRAPPED, value)
        moving = {own for body in self.description.bodies for own in self.interface.points[body]}
        for own in sorted(moving - set(self.description.ground)):
            for axis in "xy":
                yield Output(f"{own}.{axis}", "m", f"Point {own}, {axis}", "*POSITION", f"b.at_{own}.{axis}")
        for slide in self._dependent_slides():
            name, block = slide.name, slide.bodies[1]
            text = f"Position of the {block} on the line of {name}"
            yield Output(f"{name}.position", "m", text, "*POSITION", f"{name}_position")
            rest = f'*RATE, rate_of="{name}.position"'
            text = f"Velocity of the {block} on the line of {name}"
            yield Output(f"{name}.velocity", "m/s", text, rest, f"{name}_velocity")
        for name, spring in self.description.springs.items():
            shown = f"*POSITION, {_DEGREES}"
            if name not in self.motion.counted:
                shown = shown if name in self.motion.centred else _WRAPPED
                shown += f', role="twist", of="{name}"' if needs_turns(spring) else ""
            if spring.between:
                free = f" + p.{name}_free_length" if is_given(spring.free) else ""
                yield Output(f"{name}.length", "m", f"Length of {name}", "*POSITION", f"s.{name}_stretch{free}")
            elif spring.at and name not in self.motion.along and self.interface.twisted_bodies(spring):
                text = f"Angle of {spring.at} minus the angle at which {name} is free"
                yield Output(spring_angle_name(self.description, name), "rad", text, shown, f"s.{name}_stretch")
            elif spring.bodies:
                text = f"Angle by which {name} is twisted"
                yield Output(f"{name}.turn", "rad", text, shown, f"s.{name}_stretch")
        for dyad in self.structure.dyads:
            rest = f'*POSITION, minimum=0.0, maximum=pi, {_DEGREES}, role="transmission"'
            text, value = self._transmission(dyad)
            yield Output(f"{dyad.inner.name}.transmission_angle", "rad", text, rest, value)
        if self.structure.dyads:
            text = (
                "Clearance to the limit of assembly: least sine of the transmission angles of all dyads, 0 at the limit"
            )
            yield Output("assembly.clearance", "1", text, "*POSITION", "b.clearance")
        for name, spring in self.description.springs.items():
            if not spring.driven:
                turned = self.interface.twisted_bodies(spring)
                what, unit = ("torque", "N.m") if turned else ("force", "N")
                of = f", on the {turned[0]}" if turned else ""
                text = f"{what.title()} of {name} against its stretch{of}"
                role = f'role="spring force", of="{name}"'
                yield Output(f"{name}.exerted_{what}", unit, text, role, self.motion.tension(name, spring))
        yield from self._joint_forces()

    def _transmission(self, dyad: Dyad) -> tuple[str, str]:
        """Return description and expression of a dyad's transmission angle; at 0 and 180 deg the dyad locks."""
        c, (one, other) = dyad.inner.name, (side.body for side in dyad.sides)
        pins = [f"b.at_{side.joint.name}" for side in dyad.sides if isinstance(side.joint, Pin)]
        lines = [f"b.{side.joint.name}_line" for side in dyad.sides if isinstance(side.joint, Slider)]
        if dyad.kind == "RRR":
            return f"Angle between {one} and {other} at {c}", f"transmission({pins[0]}, b.at_{c}, {pins[1]})"
        if dyad.kind == "RRP":
            text = f"Angle between the {one} and the normal of the line of {dyad.sides[1].joint.name}"
            return text, f"transmission_to_normal({pins[0]}, b.at_{c}, {lines[0]})"
        if dyad.kind == "RPR":
            text = f"Angle between the line of {c} and the normal of the line from pin to pin"
            return text, f"transmission_to_normal({pins[0]}, {pins[1]}, b.{c}_line)"
        if isinstance(dyad.inner, Slider):
            lines.append(f"b.{c}_line")
        names = [
            joint.name for joint in (*(side.joint for side in dyad.sides), dyad.inner) if isinstance(joint, Slider)
        ]
        return f"Angle between the lines of {' and '.join(names)}", f"transmission_between_lines({', '.join(lines)})"

    def _joint_forces(self) -> Iterator[Output]:
        for r in self.motion.reactions:
            of, joint = f"of the {r.by} on the {r.on}", r.joint.name
            if isinstance(r.joint, Pin):
                for axis in "xy":
                    text, role = f"Force {of} in the pin {joint}, {axis}", f'role="joint force", of="{r.name}"'
                    yield Output(f"{r.name}.f{axis}", "N", text, role, f"f.in_{r.name}.{axis}")
                continue
            line = f"b.{joint}_line"
            normal = f"{line}.c * f.in_{r.name}.y - {line}.s * f.in_{r.name}.x"
            text = f"Force {of} across the line of {joint}, to the left of the line's direction"
            yield Output(f"{r.name}.force", "N", text, 'role="guide force"', normal)
            block = r.joint.bodies[1]
            text = f"Moment {of} in {joint}, about the origin of the {block}"
            yield Output(f"{r.name}.moment", "N.m", text, "", f"wrench_moment(f.in_{r.name}, b.{block}_frame.origin)")
        for pair in self.motion.geared:
            for axis in "xy":
                text = f"Force of the {pair.mate} on the {pair.body} in the pitch point of {pair.gear}, {axis}"
                role = f'role="joint force", of="{pair.gear}"'
                yield Output(f"{pair.gear}.f{axis}", "N", text, role, f"f.in_{pair.gear}.{axis}")
        for rack in self.motion.racked:
            line = f"b.{rack.slide.name}_line"
            sign, gear, bar = ("-", rack.body, rack.mate) if rack.turns else ("", rack.mate, rack.body)
            text = f"Force of the {gear} on the {bar} in the pitch point, along the line of {rack.slide.name}"
            along = f"{sign}({line}.c * f.in_{rack.rack}.x + {line}.s * f.in_{rack.rack}.y)"
            yield Output(f"{rack.rack}.force", "N", text, "", along)

    def _dependent_slides(self) -> list[Slider]:
        """Return the slides whose positions are not freedoms but follow from the freedoms."""
        freed = {drive.joint for drive in self.interface.drives}
        return [slide for name, slide in sliders(self.structure).items() if name not in freed]

    def function(self) -> str:
        """Write the function that computes all outputs."""
        s = "s, " if self.description.springs else ""
        rows = [
            "m = motion(x, i, p)",
            "f = forces(m.places, m.masses, m.wrenches, m.accelerations, p)",
            "b = m.places",
            *(["s = m.springs"] if s else []),
        ]
        rows += [f"{d.name}_position, {d.name}_velocity = {self.interface.travel(d)}" for d in self._dependent_slides()]
        rows += ["kinetic = kinetic_energy(m.masses)", f"potential = potential_energy(m.masses, {s}p)"]
        n = len(self.interface.drives)
        lost, supplied = f"x[{2 * n}]", f"x[{2 * n + 1}]"
        balance = f"kinetic + potential - start_energy + {lost} - {supplied}"
        values = (*(output.value for output in self._outputs()), "kinetic", "potential", lost, supplied, balance)
        rows += ["return (", *(f"    {value}," for value in values), ")"]
        signature = "outputs(x: tuple[float, ...], i: Applied, start_energy: float, p: Constants) -> tuple[float, ...]"
        return function(signature, "Compute all real outputs, in the order of the interface.", rows)
