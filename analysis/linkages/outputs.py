"""Write the outputs of a described linkage: their variables, and the function that computes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from .description import given
from .dynamics import Motion
from .structure import Pin, Slider, sliders
from .writing import function, quoted


class Output(NamedTuple):
    """An output: its variable as an expression of the package, and its value as an expression of the equations."""

    variable: str
    value: str


class Outputs:
    """The outputs of one linkage."""

    def __init__(self, motion: Motion) -> None:
        self.motion, self.description = motion, motion.description
        self.structure, self.interface = motion.structure, motion.interface

    def all(self) -> Iterator[Output]:
        """Yield the outputs in their order."""
        n = len(self.interface.drives)
        for k, drive in enumerate(self.interface.drives):
            turn = drive.turns
            unit, what = drive.unit, "Angle" if turn else "Position"
            rate_unit, deg = ("rad/s", ', display="deg"') if turn else ("m/s", "")
            rpm = ', display="rpm"' if turn else ""
            text = f"{what} of the freedom {drive.name}, at {drive.joint}"
            yield Output(f'output("{drive.coordinate}", "{unit}", {quoted(text)}, "", *POSITION{deg})', f"x[{k}]")
            yield Output(
                f'output("{drive.rate}", "{rate_unit}", "Its rate", "", *RATE, rate_of="{drive.coordinate}"{rpm})',
                f"x[{n + k}]",
            )
            yield Output(
                f'output("{drive.name}.acceleration", "{rate_unit}2", "Its acceleration", rate_of="{drive.rate}")',
                f"m.accelerations[{k}]",
            )
        for k, drive in enumerate(self.interface.drives):
            if drive.table:
                text = f"The {drive.load} that drives {drive.name}: given, or what holds the commanded rate"
                yield Output(
                    f'output("{drive.table}.applied_{drive.load}", "{drive.load_unit}", {quoted(text)}, role="drive", '
                    f'of="{drive.coordinate}")',
                    f"m.loads[{k}]",
                )
        taken = {drive.coordinate for drive in self.interface.drives}
        for body in self.description.bodies:
            if f"{body}.angle" not in taken:
                yield Output(
                    f'output("{body}.angle", "rad", "Direction of the {body}", "", *POSITION, minimum=-pi, maximum=pi, '
                    'display="deg")',
                    f"angle_of(b.{body}_frame.turn)",
                )
        moving = {own for body in self.description.bodies for own in self.interface.points[body]}
        for own in sorted(moving - set(self.description.ground)):
            for axis in "xy":
                yield Output(f'output("{own}.{axis}", "m", "Point {own}, {axis}", "", *POSITION)', f"b.at_{own}.{axis}")
        for slide in self._following():
            name, block = slide.name, slide.bodies[1]
            yield Output(
                f'output("{name}.position", "m", "Position of the {block} on the line of {name}", "", *POSITION)',
                f"{name}_position",
            )
            yield Output(
                f'output("{name}.velocity", "m/s", "Its rate", "", *RATE, rate_of="{name}.position")',
                f"{name}_velocity",
            )
        for name, spring in self.description.springs.items():
            if spring.between:
                free = f" + p.{name}_free_length" if given(spring.free) else ""
                yield Output(
                    f'output("{name}.length", "m", "Length of {name}", "", *POSITION)', f"s.{name}_stretch{free}"
                )
            elif spring.at and name not in self.motion.along and self.motion.turned(spring):
                text = f"Angle of {spring.at} from that at which {name} is free"
                yield Output(f'output("{spring.at}.turn", "rad", {quoted(text)}, "", *POSITION)', f"s.{name}_stretch")
            elif spring.bodies:
                text = f"Angle by which {name} is twisted"
                yield Output(f'output("{name}.turn", "rad", {quoted(text)}, "", *POSITION)', f"s.{name}_stretch")
        for dyad in self.structure.dyads:
            if dyad.kind == "RRR":
                p, q = (side.joint.name for side in dyad.sides)
                c, (one, other) = dyad.inner.name, (side.body for side in dyad.sides)
                yield Output(
                    f'output("{c}.transmission_angle", "rad", "Angle between {one} and {other} at {c}", "", '
                    '*POSITION, minimum=0.0, maximum=pi, display="deg", role="transmission")',
                    f"transmission(b.at_{p}, b.at_{c}, b.at_{q})",
                )
        for name, spring in self.description.springs.items():
            if not spring.driven:
                turned = self.motion.turned(spring)
                what, unit = ("torque", "N.m") if turned else ("force", "N")
                of = f", on the {turned[0]}" if turned else ""
                text = f"{what.title()} of {name} against its stretch{of}"
                yield Output(
                    f'output("{name}.exerted_{what}", "{unit}", {quoted(text)})', self.motion.tension(name, spring)
                )
        yield from self._joint_forces()
        yield from self._energy_outputs(n)

    def _joint_forces(self) -> Iterator[Output]:
        for r in self.motion.reactions:
            of = f"of the {r.by} on the {r.on}"
            if isinstance(r.joint, Pin):
                for axis in "xy":
                    yield Output(
                        f'output("{r.name}.f{axis}", "N", "Force {of} in the pin {r.joint.name}, {axis}", role="joint force", '
                        f'of="{r.name}")',
                        f"f.in_{r.name}.{axis}",
                    )
                continue
            line = f"b.{r.joint.name}_line"
            normal = f"{line}.c * f.in_{r.name}.y - {line}.s * f.in_{r.name}.x"
            yield Output(
                f'output("{r.name}.force", "N", "Force {of} across the line of {r.joint.name}", role="guide force")',
                normal,
            )
            block = r.joint.bodies[1]
            yield Output(
                f'output("{r.name}.moment", "N.m", "Moment {of} in {r.joint.name}, about the origin of the {block}")',
                f"moment_about(f.in_{r.name}, b.{block}_frame.origin)",
            )

        for rack in self.motion.racked:
            line = f"b.{rack.slide.name}_line"
            sign, gear, bar = ("-", rack.body, rack.mate) if rack.turns else ("", rack.mate, rack.body)
            text = f"Force of the {gear} on the {bar} in the pitch point, along the line of {rack.slide.name}"
            along = f"{sign}({line}.c * f.in_{rack.rack}.x + {line}.s * f.in_{rack.rack}.y)"
            yield Output(f'output("{rack.rack}.force", "N", {quoted(text)})', along)

    def _energy_outputs(self, n: int) -> Iterator[Output]:
        sources = ("springs and gravity", "dampers and friction", "drives and loads")
        yield Output(f"*energy_outputs({', '.join(map(quoted, sources))})", "kinetic")
        yield from (Output("", value) for value in ("potential", f"x[{2 * n}]", f"x[{2 * n + 1}]"))
        yield Output("", f"kinetic + potential - start_energy + x[{2 * n}] - x[{2 * n + 1}]")

    def _following(self) -> list[Slider]:
        """Return the slides whose positions follow from the freedoms."""
        freed = {drive.joint for drive in self.interface.drives}
        return [slide for name, slide in sliders(self.structure).items() if name not in freed]

    def function(self) -> str:
        """Write the function of all outputs."""
        s = "s, " if self.description.springs else ""
        rows = [
            "m = motion(x, i, p)",
            "f = forces(m.places, m.masses, m.wrenches, m.accelerations, p)",
            "b = m.places",
            *(["s = m.springs"] if s else []),
        ]
        rows += [f"{d.name}_position, {d.name}_velocity = {self.interface.travel(d)}" for d in self._following()]
        rows += ["kinetic = kinetic_energy(m.masses)", f"potential = potential_energy(m.masses, {s}p)"]
        rows += ["return (", *(f"    {output.value}," for output in self.all()), ")"]
        signature = "outputs(x: tuple[float, ...], i: Applied, start_energy: float, p: Constants) -> tuple[float, ...]"
        return function(signature, "Compute all real outputs, in the order of the interface.", rows)
