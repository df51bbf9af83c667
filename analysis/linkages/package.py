"""Write a described linkage as a package of Python, in the form that a hand-written mechanism has, and import it."""

from __future__ import annotations

import hashlib
import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from linkwork import planar
from linkwork.mechanism import Mechanism

from ..mechanisms import MECHANISMS, register
from ..numerics.cache import code_folder
from .description import GROUND, Description, LinkageError
from .dynamics import Motion, drives_text, given, sliders
from .equations import Writer
from .parameters import Interface, interface, size
from .structure import Freed, Pin, Structure, analyse


class Output(NamedTuple):
    """An output: its variable as an expression of the package, and its value as an expression of the equations."""

    variable: str
    value: str


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'


class Package:
    """The text of the package of one linkage.

    Attributes
    ----------
    name : str
        Of the linkage, as Python spells it, with a hash of the texts.
    files : dict of str to str
        Texts by file name.
    """

    def __init__(self, description: Description) -> None:
        self.description = description
        self.structure: Structure = analyse(description)
        self.interface: Interface = interface(description, self.structure)
        self.motion = Motion(description, self.structure, self.interface)
        equations = self._equations()
        self.files = {"equations.py": equations, "__init__.py": self._mechanism()}
        digest = hashlib.sha256("\0".join((*self.files.values(), _library())).encode()).hexdigest()
        self.name = f"{re.sub(r'[^a-z0-9]', '_', description.name.lower())}_{digest[:12]}"

    # equations.py

    def _equations(self) -> str:
        d = self.interface.drives
        body = [
            *self._constants(),
            *self.motion.applied(),
            *("", ""),
            *Writer(self.description, self.structure, self.interface).places_function(),
            *("", ""),
            *self.motion.masses(),
        ]
        if self.description.springs:
            body += ["", "", *self.motion.springs()]
        body += ["", "", *self.motion.acting(), "", "", *self.motion.motion(), "", "", *self.motion.forces()]
        body += [*self._outputs_function(), *self._error_scale(), *self._positions()]
        text = "\n".join(body)
        used = [
            name
            for name in vars(planar)
            if re.search(rf"\b{name}\b", text) and getattr(vars(planar)[name], "__module__", "") == planar.__name__
        ]
        friction = [n for n in ("FRICTION_RATE", "FRICTION_SPEED", "lesser") if re.search(rf"\b{n}\b", text)]
        head = [
            f'"""Equations of the {self.description.name}, written from its description: freedom after freedom, dyad after dyad.',
            "",
            f"The state is {drives_text(d)}, then the work dissipated and supplied. `linkwork.planar` explains the functions.",
            '"""',
            "",
            "from __future__ import annotations",
            "",
            *(["from math import tanh"] if "tanh(" in text else []),
            "from typing import NamedTuple",
            "",
            *([f"from linkwork.friction import {', '.join(friction)}"] if friction else []),
            "from linkwork.planar import (",
            *(f"    {name}," for name in used),
            ")",
            "",
            "",
        ]
        return "\n".join((*head, text, ""))

    def _constants(self) -> Iterator[str]:
        yield from ("class Constants(NamedTuple):", '    """The parameters, and what follows from them."""', "")
        for name in self._constant_values():
            yield f"    {name}: float"
        yield from ("", "")

    def _constant_values(self) -> dict[str, str]:
        """Return the constants of the equations, as expressions in the parameters."""
        found = {p.field: f"self.{p.field}" for p in self.interface.parameters}
        for name, joint in sliders(self.structure).items():
            if joint.inclined:
                found |= {f"{name}_c": f"cos(self.{name}_direction)", f"{name}_s": f"sin(self.{name}_direction)"}
        for name, spring in self.description.springs.items():
            about = spring.at and isinstance(self.structure.joints[spring.at], Pin)
            if about and name not in self.motion.along and given(spring.free):
                found |= {f"{name}_c": f"cos(self.{name}_free_angle)", f"{name}_s": f"sin(self.{name}_free_angle)"}
        if self.description.gravity:
            direction = "self.ground_gravity_direction"
            found |= {"gx": f"self.gravity * cos({direction})", "gy": f"self.gravity * sin({direction})"}
        return found or {"nothing": "0.0"}

    # Outputs

    def _outputs(self) -> Iterator[Output]:
        """Yield the outputs in their order."""
        n = len(self.interface.drives)
        for k, drive in enumerate(self.interface.drives):
            turn = drive.turns
            unit, what = drive.unit, "Angle" if turn else "Position"
            rate_unit, deg = ("rad/s", ', display="deg"') if turn else ("m/s", "")
            rpm = ', display="rpm"' if turn else ""
            text = f"{what} of the freedom {drive.name}, at {drive.joint}"
            yield Output(f'output("{drive.coordinate}", "{unit}", {_quoted(text)}, "", *POSITION{deg})', f"x[{k}]")
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
                    f'output("{drive.table}.applied_{drive.load}", "{drive.load_unit}", {_quoted(text)}, role="drive", '
                    f'of="{drive.coordinate}")',
                    f"m.loads[{k}]",
                )
        taken = {drive.coordinate for drive in self.interface.drives}
        for body in self.description.bodies:
            if f"{body}.angle" not in taken:
                yield Output(
                    f'output("{body}.angle", "rad", "Direction of the {body}", "", *POSITION, minimum=-pi, maximum=pi, display="deg")',
                    f"angle_of(b.{body}_frame.turn)",
                )
        moving = {own for body in self.description.bodies for own in self.interface.points[body]}
        for own in sorted(moving - set(self.description.ground)):
            for axis in "xy":
                yield Output(f'output("{own}.{axis}", "m", "Point {own}, {axis}", "", *POSITION)', f"b.at_{own}.{axis}")
        freed = {drive.joint for drive in self.interface.drives}
        for name, joint in sliders(self.structure).items():
            if name not in freed:
                holder, block = joint.bodies
                x, y = self.interface.points[holder].get(joint.through, ("0.0", "0.0"))
                frame = f"b.{holder}_frame" if holder != GROUND else f"ground({n})"
                call = f"position_along({frame}, {x}, {y}, b.{name}_line, b.{block}_frame)"
                yield Output(
                    f'output("{name}.position", "m", "Position of the {block} on the line of {name}", "", *POSITION)',
                    f"{call}[0]",
                )
                yield Output(
                    f'output("{name}.velocity", "m/s", "Its rate", "", *RATE, rate_of="{name}.position")', f"{call}[1]"
                )
        for name, spring in self.description.springs.items():
            if spring.between:
                free = f" + p.{name}_free_length" if given(spring.free) else ""
                yield Output(
                    f'output("{name}.length", "m", "Length of {name}", "", *POSITION)', f"s.{name}_stretch{free}"
                )
            elif name not in self.motion.along and isinstance(self.structure.joints[spring.at], Pin):
                text = f"Angle of {spring.at} from that at which {name} is free"
                yield Output(f'output("{spring.at}.turn", "rad", {_quoted(text)}, "", *POSITION)', f"s.{name}_stretch")
        for dyad in self.structure.dyads:
            if dyad.kind == "RRR":
                p, q = (side.joint.name for side in dyad.sides)
                c = dyad.inner.name
                yield Output(
                    f'output("{c}.transmission_angle", "rad", "Angle between {dyad.sides[0].body} and {dyad.sides[1].body} at {c}", "", '
                    '*POSITION, minimum=0.0, maximum=pi, display="deg", role="transmission")',
                    f"transmission(b.at_{p}, b.at_{c}, b.at_{q})",
                )
        yield from self._joint_forces()
        yield from self._energy_outputs(n)

    def _joint_forces(self) -> Iterator[Output]:
        for r in self.motion.reactions:
            of = f"of the {r.by} on the {r.on}"
            if isinstance(r.joint, Pin):
                for axis in "xy":
                    yield Output(
                        f'output("{r.name}.f{axis}", "N", "Force {of} in the pin {r.joint.name}, {axis}", role="joint force", of="{r.name}")',
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

    def _energy_outputs(self, n: int) -> Iterator[Output]:
        sources = ("springs and gravity", "dampers and friction", "drives and loads")
        yield Output(f"*energy_outputs({', '.join(map(_quoted, sources))})", "kinetic")
        yield from (Output("", value) for value in ("potential", f"x[{2 * n}]", f"x[{2 * n + 1}]"))
        yield Output("", f"kinetic + potential - start_energy + x[{2 * n}] - x[{2 * n + 1}]")

    def _outputs_function(self) -> Iterator[str]:
        s = "s, " if self.description.springs else ""
        yield from (
            "",
            "",
            "def outputs(x: tuple[float, ...], i: Applied, start_energy: float, p: Constants) -> tuple[float, ...]:",
        )
        yield '    """Compute all real outputs, in the order of the interface."""'
        yield from ("    m = motion(x, i, p)", "    f = forces(m, p)", "    b = m.places")
        if s:
            yield "    s = springs(b, x, p)"
        yield "    kinetic = kinetic_energy(m.masses)"
        yield f"    potential = potential_energy(m.masses, {s}p)"
        yield "    return ("
        yield from (f"        {output.value}," for output in self._outputs())
        yield "    )"

    def _error_scale(self) -> Iterator[str]:
        length, drives = size(self.interface), self.interface.drives
        mass = sum(p.value for p in self.interface.parameters if p.unit == "kg") or 1.0
        rates = [f"{'' if d.turns else f'{length!r} * '}speed" for d in drives]
        speeds = (
            " + ".join(f"x[{len(drives) + k}] * x[{len(drives) + k}]" for k, d in enumerate(drives) if d.turns) or "0.0"
        )
        yield from ("", "", "def error_scale(parameters: object, x: tuple[float, ...]) -> tuple[float, ...]:")
        yield '    """Return magnitudes below which errors are absolute, from the size, the mass and the speed at the start."""'
        yield f"    speed = (1.0 + {speeds}) ** 0.5"
        yield f"    energy = {0.5 * mass * length * length!r} * speed * speed"
        yield f"    return ({', '.join('1.0' if d.turns else repr(length) for d in drives)}, {', '.join(rates)}, energy, energy)"

    # Drawing

    def _drawn(self) -> tuple[list[tuple[str, str, str]], list[str]]:
        """Return the joints of the picture, each with its name, what it is and its place, and the parts."""
        d, parts = self.description, []
        points = dict.fromkeys(own for of in self.interface.points.values() for own in of)
        joints = [(own, f"point {own}", f"*(b.at_{own}.x, b.at_{own}.y, 0.0)") for own in points]
        length = size(self.interface)
        for name, joint in sliders(self.structure).items():
            holder, block = joint.bodies
            line, start = f"b.{name}_line", f"b.at_{joint.through}"
            joints.append(
                (f"{name}Block", f"the {block}", f"*(b.{block}_frame.origin.x, b.{block}_frame.origin.y, 0.0)")
            )
            joints.append(
                (
                    f"{name}End",
                    f"direction of {name}",
                    f"*({start}.x + {length!r} * {line}.c, {start}.y + {length!r} * {line}.s, 0.0)",
                )
            )
            along = f'("{name}Block", "{joint.through}", "{name}End")'
            parts.append(f'Part("guide", ("{joint.through}", "{name}End"), "line of {name}")')
            parts += [
                f'Part("spring", {along}, "{s}", "{s}.stiffness")'
                for s, t in d.springs.items()
                if t.at == name and given(t.stiffness)
            ]
            parts.append(f'Part("slider", {along}, "{block}")')
        for own in d.ground:
            if own in self.structure.joints:
                parts.append(f'Part("pivot", ("{own}",), "bearing {own}")')
        for name, spring in d.springs.items():
            if spring.between:
                parts.append(f'Part("axis", {spring.between!r}, "{name}")')
        for name, body in d.bodies.items():
            owned = [own for own in body.all_points]
            blocks = [f"{s}Block" for s, joint in sliders(self.structure).items() if joint.bodies[1] == name]
            through = tuple(dict.fromkeys((*owned, *(blocks if len(owned) < 2 else ()))))
            if len(owned) > 1 or (owned and blocks):
                parts.append(f'Part("link", {through!r}, "{name}")')
        return joints, parts

    def _positions(self) -> Iterator[str]:
        joints, _ = self._drawn()
        yield from ("", "", "def positions(x: tuple[float, ...], i: Applied, p: Constants) -> tuple[float, ...]:")
        yield '    """Compute the places of the points of the picture."""'
        yield from ("    b = places(x, p)", "    return (", *(f"        {place}," for *_, place in joints), "    )")

    # __init__.py

    def _mechanism(self) -> str:
        d, drives, parameters = self.description, self.interface.drives, self.interface.parameters
        title = d.title or d.name
        rules = ", ".join(f'"{p.field}"' for p in parameters if p.rule == "positive")
        free = ", ".join(f'"{p.field}"' for p in parameters if p.rule == "free")
        signs = ", ".join(f'"{p.field}": "the assembly"' for p in parameters if p.rule == "sign")
        initial = [(f"{e.name}_{e.coordinate.rpartition('.')[2]}", e.start) for e in drives]
        initial += [(f"{e.name}_{e.rate.rpartition('.')[2]}", e.speed) for e in drives]
        units = [e.unit for e in drives] + [f"{e.unit}/s" for e in drives]
        channels, inputs = self._channels()
        joints, parts = self._drawn()
        outputs = [output.variable for output in self._outputs() if output.variable]
        moved = [e for e in drives]
        lines = [
            f'"""The linkage {d.name}: {_plain(title)}. Written from its description."""',
            "",
            "from __future__ import annotations",
            "",
            "from dataclasses import dataclass",
            "from math import cos, pi, sin",
            "from typing import ClassVar",
            "",
            "from linkwork import friction, planar",
            "from linkwork.mechanism import Channel, Drawing, Equations, Freedom, Joint, Mechanism, Mode, Part, PublishedSet",
            "from linkwork.parameters import Rules, check_initial, check_parameters",
            "from linkwork.variables import POSITION, RATE, Variable, energy_outputs, output, status_variables, tolerance_parameter",
            "",
            "from . import equations",
            "",
            "",
            "@dataclass(frozen=True, slots=True, kw_only=True)",
            "class Parameters:",
            '    """SI units."""',
            "",
            f"    RULES: ClassVar[Rules] = Rules(positive=({rules}{',' if rules else ''}), free_sign=({free}{',' if free else ''}), signs={{{signs}}})",
            "",
            *(f"    {p.field}: {'int' if p.rule == 'sign' else 'float'} = {p.value!r}" for p in parameters),
            "",
            "    def __post_init__(self) -> None:",
            "        check_parameters(self)",
            "",
            "    def constants(self) -> equations.Constants:",
            '        """Return what the equations use."""',
            "        return equations.Constants(",
            *(f"            {value}," for value in self._constant_values().values()),
            "        )",
            "",
            "",
            "@dataclass(frozen=True, slots=True, kw_only=True)",
            "class Initial:",
            '    """State at the start."""',
            "",
            *(
                f"    {name}: float = {value if 'angle' in name or 'position' in name else 0.0!r}"
                for name, value in initial
            ),
            "",
            "    def __post_init__(self) -> None:",
            "        check_initial(self)",
            "",
            "",
            "VARIABLES = (",
            *(f"    {self._parameter_text(p)}," for p in parameters),
            *(f"    {mode}," for mode in self._modes()),
            *(
                f'    Variable("initial.{name}", "parameter", "{unit}", "At the start", "", {value!r}{_display(unit)}),'
                for (name, value), unit in zip(initial, units)
            ),
            "    tolerance_parameter(),",
            *(f"    {text}," for text in inputs),
            *(f"    {text}," for text in outputs),
            "    *status_variables(),",
            ")",
            "",
            "",
            "def check_assembly(parameters: Parameters, x: tuple[float, ...]) -> None:",
            '    """Make sure that the bodies can be joined."""',
            "    planar.check_clearance(equations.places, x, parameters.constants(), MECHANISM.where(x))",
            "",
            "",
            "MECHANISM = Mechanism(",
            f"    name={_quoted(d.name)},",
            f"    fmu={_quoted(_camel(d.name))},",
            f"    title={_quoted(title)},",
            f"    description={_quoted(title)},",
            f"    notes=({_quoted(f'Source: {d.source}.')},),",
            "    parameters=Parameters,",
            "    initial=Initial,",
            "    published={",
            f"        {_quoted(d.name)}: PublishedSet(",
            f"            Parameters(), Initial({', '.join(f'{name}={value!r}' for name, value in initial)}), "
            f"{{{self._drive_text()}}}, {_quoted(d.source)}",
            "        )",
            "    },",
            "    freedoms=(",
            *(f"        {self._freedom_text(e)}," for e in moved),
            "    ),",
            "    channels=(",
            *(f"        {text}," for text in channels),
            "    ),",
            "    variables=VARIABLES,",
            f"    position_parameters=({''.join(f'{_quoted(name)}, ' for name in self._position_names(initial))}),",
            "    experiment=(0.0, 1.0, 1e-3, 1e-9),",
            "    modules=(friction, planar, equations),",
            "    equations=Equations(*(getattr(equations, name) for name in Equations._fields)),",
            "    check_assembly=check_assembly,",
            "    error_scale=equations.error_scale,",
            "    drawing=Drawing(",
            "        (",
            *(f"            Joint({_quoted(name)}, {_quoted(text)}{self._moves(name)})," for name, text, _ in joints),
            "        ),",
            "        equations.positions,",
            "        (",
            *(f"            {part}," for part in parts),
            "        ),",
            f"        ({''.join(f'{_quoted(name)}, ' for name in self._paths())}),",
            "    ),",
            ")",
            "",
        ]
        return "\n".join(lines)

    def _position_names(self, initial: list[tuple[str, float]]) -> list[str]:
        placing = [
            p.name
            for p in self.interface.parameters
            if p.unit in ("m", "") or p.name.endswith((".direction", ".ratio", ".phase"))
        ]
        placing = [name for name in placing if ".cog_" not in name and ".free_" not in name]
        return [*placing, *(f"initial.{name}" for name, _ in initial[: len(self.interface.drives)])]

    def _drive_text(self) -> str:
        many = sum(bool(e.table) for e in self.interface.drives) > 1
        return ", ".join(
            f'"{f"{e.name}_speed" if many else "speed"}": {e.speed!r}'
            for e in self.interface.drives
            if e.table and e.speed != 0.0
        )

    def _freedom_text(self, e: Any) -> str:
        many = sum(bool(other.table) for other in self.interface.drives) > 1
        prefix = f"{e.name}_" if many else ""
        mode, period = "None", "0.0"
        if e.table:
            mode = f'Mode("{e.table}.mode", ("{e.load}", "speed"), ("{prefix}{e.load}", "{prefix}speed"), {int(e.speed != 0.0)})'
            period = "2.0 * pi" if e.turns else "0.0"
        fields = f'("{e.name}_{e.coordinate.rpartition(".")[2]}", "{e.name}_{e.rate.rpartition(".")[2]}")'
        return f'Freedom("{e.coordinate}", "{e.rate}", {fields}, {mode}, {period})'

    def _modes(self) -> Iterator[str]:
        for e in self.interface.drives:
            if e.table:
                text = f"0: {e.table}.{e.load} acts; 1: the rate is {e.table}.speed"
                yield f'Variable("{e.table}.mode", "parameter", "", "{text}", "", {int(e.speed != 0.0)}, "Integer", 0, 1)'

    def _channels(self) -> tuple[list[str], list[str]]:
        """Return the channels and their variables."""
        many = sum(bool(e.table) for e in self.interface.drives) > 1
        channels, inputs = [], []
        for number, e in enumerate(self.interface.drives):
            table, prefix = (e.table, f"{e.name}_" if many else "") if e.table else (e.name, f"{e.name}_")
            what = "Torque" if e.turns else "Force"
            channels.append(f'Channel("{table}.{e.load}", "{prefix}{e.load}", "force", {number})')
            inputs.append(
                f'Variable("{table}.{e.load}", "input", "{e.load_unit}", "{what} along the freedom {e.name}")'
            )
            if e.table:
                channels.append(f'Channel("{table}.speed", "{prefix}speed", "command", {number})')
                channels.append(f'Channel("{table}.acceleration", "{prefix}acceleration", "rate", {number})')
                unit = f"{e.unit}/s"
                inputs.append(
                    f'Variable("{table}.speed", "input", "{unit}", "Commanded rate of {e.name}", "", {e.speed!r}{_display(unit)})'
                )
                inputs.append(
                    f'Variable("{table}.acceleration", "input", "{unit}2", "Rate of the commanded rate over a step")'
                )
        for own in self.description.loads:
            for axis in "xy":
                channels.append(f'Channel("{own}.f{axis}", "{own}_f{axis}", displacement="{own}.{axis}")')
                inputs.append(f'Variable("{own}.f{axis}", "input", "N", "Load on {own}, {axis}")')
        return channels, inputs

    def _parameter_text(self, p: Any) -> str:
        if p.rule == "sign":
            return f'Variable("{p.name}", "parameter", "", "{p.text}: +1 or -1", "", {p.value}, "Integer", -1, 1)'
        least = "" if p.rule == "free" else ", minimum=0.0"
        role = f', role="{p.role}"' if p.role else ""
        of = f', of="{p.of}"' if p.of else ""
        return f'Variable("{p.name}", "parameter", "{p.unit}", {_quoted(p.text)}, "", {p.value!r}{least}{_display(p.unit)}{role}{of})'

    def _moves(self, own: str) -> str:
        """Return the parameters that change where a point of the picture is dragged."""
        names = {p.name for p in self.interface.parameters}
        for body, points in self.interface.points.items():
            if own in points:
                bar = self.description.bodies[body].bar if body != GROUND else ()
                found = [f"{body}.length"] if bar and own == bar[1] else [f"{body}.{own}_{axis}" for axis in "xy"]
                turned = [
                    f"initial.{self.interface.drives[step.freedom].name}_angle"
                    for step in self.structure.steps
                    if isinstance(step, Freed)
                    and step.body == body
                    and isinstance(step.joint, Pin)
                    and bar
                    and own == bar[1]
                ]
                moves = [name for name in found if name in names] + turned
                if moves:
                    return f", ({''.join(f'{_quoted(name)}, ' for name in moves[:2])})"
        return ""

    def _paths(self) -> list[str]:
        """Return the points whose paths are drawn: those that are no joint, or else the pins between bodies that move."""
        moving = [own for body in self.description.bodies for own in self.interface.points[body]]
        alone = [own for own in dict.fromkeys(moving) if own not in self.structure.joints]
        return alone or [own for own in dict.fromkeys(moving) if own not in self.description.ground][-1:]


def _display(unit: str) -> str:
    shown = {"rad": "deg", "rad/s": "rpm"}.get(unit)
    return f', display="{shown}"' if shown else ""


def _plain(text: str) -> str:
    return text.replace('"', "'").replace("\\", "/").replace("\n", " ")


def _camel(name: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[^A-Za-z0-9]+", name))


def _library() -> str:
    return Path(str(planar.__file__)).read_text(encoding="utf-8")


def mechanism(description: Description, folder: Path | None = None) -> Mechanism:
    """Return the mechanism of a description, registered.

    Parameters
    ----------
    description : Description
    folder : path, optional
        Where its package is kept; by default below the user's cache.

    Raises
    ------
    LinkageError, ParameterError, MechanismError
    """
    package = Package(description)
    known = MECHANISMS.get(description.name)
    if known is not None and known.modules[-1].__package__ == package.name:
        return known
    place = code_folder("linkages") if folder is None else Path(folder)
    own = place / package.name
    own.mkdir(parents=True, exist_ok=True)
    for name, text in package.files.items():
        if not (own / name).is_file() or (own / name).read_text(encoding="utf-8") != text:
            (own / name).write_text(text, encoding="utf-8")
    if str(place) not in sys.path:
        sys.path.append(str(place))
    importlib.invalidate_caches()
    made: Mechanism = importlib.import_module(package.name).MECHANISM
    if known is not None:
        if not hasattr(sys.modules[str(known.modules[-1].__package__)], "check_assembly"):
            raise LinkageError(f"there is a mechanism {description.name} already: give the linkage another name")
        del MECHANISMS[description.name]
    register(made)
    return made
