"""Write the parameters, inputs and freedoms of a described linkage as source text of its package."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import floor, log10, pi
from typing import NamedTuple

from linkwork.errors import ParameterError

from .description import is_given
from .equations import Twist
from .parameters import Drive, Interface, needs_turns
from .structure import sliders
from .writing import quote

#: Least speed at which the duration of a turn is still a number (rad/s).
_LEAST_SPEED = 1e-300
#: Greatest number of steps of the default experiment of an FMU.
_MOST_STEPS = 100_000


class Start(NamedTuple):
    """A field of the initial state: its name and unit, its value in the description, and its default."""

    name: str
    unit: str
    value: float
    rest: float


def display_argument(unit: str) -> str:
    """Return the argument that names a variable's display unit, deg or rpm; empty if there is no other display unit."""
    shown = {"rad": "deg", "rad/s": "rpm"}.get(unit)
    return f', display="{shown}"' if shown else ""


class Variables:
    """Writer of the variables of one linkage, except its outputs."""

    def __init__(self, interface: Interface, counted: Mapping[str, Twist]) -> None:
        self.description, self.structure, self.interface = interface.description, interface.structure, interface
        self.counted = counted
        #: angle in the described pose of each torsion spring of `Interface.centred_springs` (rad)
        self.middles = dict.fromkeys(interface.centred_springs(counted), 0.0)
        drives = interface.drives
        self.starts = [Start(_last(d, d.coordinate), d.unit, d.start, d.start) for d in drives]
        self.starts += [Start(_last(d, d.rate), f"{d.unit}/s", d.speed, 0.0) for d in drives]
        self.several = sum(bool(d.table) for d in drives) > 1

    # Parameters

    def constants(self) -> dict[str, str]:
        """Return the constants of the equations by name, each as an expression in the parameters ``self``.

        Names of constants of force laws have no capitals, so that no such name can end in ``COS``, ``SIN`` or ``MIDDLE``.
        """
        found = {p.field: f"self.{p.field}" for p in self.interface.parameters}
        for name, joint in sliders(self.structure).items():
            if joint.inclined:
                found |= {f"{name}_COS": f"cos(self.{name}_direction)", f"{name}_SIN": f"sin(self.{name}_direction)"}
        for name, spring in self.description.springs.items():
            wraps = self.interface.twisted_bodies(spring) and name not in self.counted
            if wraps and is_given(spring.free):
                found |= {f"{name}_COS": f"cos(self.{name}_free_angle)", f"{name}_SIN": f"sin(self.{name}_free_angle)"}
        for name, angle in self.middles.items():
            found |= {f"{name}_COS": f"cos({angle!r})", f"{name}_SIN": f"sin({angle!r})", f"{name}_MIDDLE": repr(angle)}
        if self.description.gravity:
            direction = "self.ground_gravity_direction"
            found |= {"gx": f"self.gravity * cos({direction})", "gy": f"self.gravity * sin({direction})"}
        if self.description.friction:
            levels = {f"{name}_friction" for name in self.description.springs}
            rough = [p.field for p in self.interface.parameters if p.role == "friction" and p.field not in levels]
            found["rough"] = " + ".join(f"self.{field}" for field in rough)
        return found or {"nothing": "0.0"}

    def rules(self) -> str:
        """Return the source of the arguments of the parameters' `Rules`."""

        def names(rule: str) -> str:
            return "".join(f'"{p.field}", ' for p in self.interface.parameters if p.rule == rule)

        signs = ", ".join(
            f'"{p.field}": "the sign of the assembly"' for p in self.interface.parameters if p.rule == "sign"
        )
        return f"positive=({names('positive')}), free_sign=({names('free')}), signs={{{signs}}}"

    def fields(self) -> Iterator[str]:
        """Yield the fields of the parameters, with their values in the description."""
        for p in self.interface.parameters:
            yield f"{p.field}: {'int' if p.rule == 'sign' else 'float'} = {p.value!r}"

    def parameters(self) -> Iterator[str]:
        """Yield the variables of the parameters, the modes and the initial state."""
        for p in self.interface.parameters:
            sign = quote(symbol(p.name, p.unit))
            if p.rule == "sign":
                yield f'Variable("{p.name}", "parameter", "", "{p.text}: +1 or -1", {sign}, {p.value}, "Integer", -1, 1)'
                continue
            least = "" if p.rule == "free" else ", minimum=0.0"
            role = f', role="{p.role}"' if p.role else ""
            of = f', of="{p.of}"' if p.of else ""
            rest = f"{least}{display_argument(p.unit)}{role}{of}"
            yield f'Variable("{p.name}", "parameter", "{p.unit}", {quote(p.text)}, {sign}, {p.value!r}{rest})'
        for d in self.interface.drives:
            if d.table:
                text = f"0: {d.table}.{d.load} acts; 1: the rate is {d.table}.speed"
                yield f'Variable("{d.table}.mode", "parameter", "", "{text}", "", {int(d.commanded)}, "Integer", 0, 1)'
        for s in self.starts:
            sign = quote(symbol(s.name.replace("_", "."), s.unit, "0"))
            own = f'"initial.{s.name}", "parameter", "{s.unit}", "At the start", {sign}'
            yield f"Variable({own}, {s.value!r}{display_argument(s.unit)})"
        yield "tolerance_parameter()"

    def position_parameters(self) -> list[str]:
        """Return the parameters that determine the poses of the bodies and the twists of the springs at the start."""
        units, roles = ("m", "rad", "1", ""), ("", "ratio", "spring")
        names = [p.name for p in self.interface.parameters if p.unit in units and p.role in roles]
        return [*names, *(f"initial.{s.name}" for s in self.starts[: len(self.interface.drives)])]

    def links(self) -> Iterator[str]:
        """Yield the `Link` of each bar whose mass may follow from a section."""
        names = {p.name for p in self.interface.parameters}
        for name, body in self.description.bodies.items():
            if body.bar and {f"{name}.mass", f"{name}.inertia", f"{name}.cog_x"} <= names:
                centre = "".join(f'"{name}.cog_{axis}", ' for axis in "xy" if f"{name}.cog_{axis}" in names)
                yield f'Link("{name}", "{name}.length", "{name}.mass", "{name}.inertia", ({centre}))'

    # Inputs

    def _argument(self, drive: Drive, name: str) -> str:
        argument = f"{drive.name}_{name}" if self.several or not drive.table else name
        taken = any(argument == load.field for load in self.interface.loads)
        return f"{drive.name}_drive_{name}" if taken else argument

    def commanded_rates(self) -> str:
        """Return the source of the entries of the published set's ``drive``: the commanded rates."""
        driven = [d for d in self.interface.drives if d.commanded]
        return ", ".join(f'"{self._argument(d, "speed")}": {d.speed!r}' for d in driven)

    def experiment(self) -> tuple[float, float, float, float]:
        """Return the default experiment of the FMU: start, stop and step (s), tolerance.

        It takes three turns of the slowest crank that turns at the start, rounded to two digits, in steps of at most one degree
        of the fastest crank, but at most `_MOST_STEPS` steps. If no crank turns, it takes 1 s in steps of 1 ms. Angles without
        a drive, such as that of a pendulum on a crank, count only if no other angle moves.
        """
        moving = [d for d in self.interface.drives if d.turns and d.speed]
        for d in moving:
            if abs(d.speed) < _LEAST_SPEED:
                raise ParameterError(
                    f"linkage.freedoms.{d.name}.speed", d.speed, f"be 0 or at least {_LEAST_SPEED:g} rad/s"
                )
        turns = [2.0 * pi / abs(d.speed) for d in [d for d in moving if d.table] or moving]
        if not turns:
            return 0.0, 1.0, 1e-3, 1e-9
        power = 10.0 ** floor(log10(min(turns) / 360.0))
        step = max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= min(turns) / 360.0 or digit == 1.0)
        return 0.0, float(f"{min(3.0 * max(turns), _MOST_STEPS * step):.2g}"), float(f"{step:.1g}"), 1e-9

    def origins(self) -> Iterator[str]:
        """Yield the entries that say where the mass properties come from."""
        for name, body in self.description.bodies.items():
            if body.section is not None:
                yield f'"{name}.mass": {quote(body.section.origin(body.mass is not None))}'
            elif body.mass is not None:
                still = ", without a moment of inertia" if body.bar and body.inertia is None else ""
                yield f'"{name}.mass": "as given{still}"'

    def freedoms(self) -> Iterator[str]:
        """Yield the source of each `Freedom`."""
        springs = self.description.springs
        wound = [twist.freedoms for name, twist in self.counted.items() if needs_turns(springs[name])]
        alone = {freedoms[0] for freedoms in wound if len(freedoms) == 1}
        for n, d in enumerate(self.interface.drives):
            back = 0 if n in alone else d.turns_back
            mode, period = "None", f"{2.0 * back} * pi" if back else "0.0"
            if d.table:
                arguments = f'("{self._argument(d, d.load)}", "{self._argument(d, "speed")}")'
                mode = f'Mode("{d.table}.mode", ("{d.load}", "speed"), {arguments}, {int(d.commanded)})'
            start = f'("{_last(d, d.coordinate)}", "{_last(d, d.rate)}")'
            swings = ", swings=True" if back and not d.table else ""
            coupled = ", coupled=True" if back and any(n in freedoms for freedoms in wound) else ""
            yield f'Freedom("{d.coordinate}", "{d.rate}", {start}, {mode}, {period}{swings}{coupled})'

    def channels(self) -> Iterator[str]:
        """Yield the source of each `Channel`."""
        for number, d in enumerate(self.interface.drives):
            table = d.table or d.name
            yield f'Channel("{table}.{d.load}", "{self._argument(d, d.load)}", "force", {number})'
            if d.table:
                yield f'Channel("{table}.speed", "{self._argument(d, "speed")}", "command", {number})'
                yield f'Channel("{table}.acceleration", "{self._argument(d, "acceleration")}", "rate", {number})'
        for load in self.interface.loads:
            yield f'Channel("{load.name}", "{load.field}", displacement="{load.displacement}")'

    def inputs(self) -> Iterator[str]:
        """Yield the variables of the inputs."""
        for d in self.interface.drives:
            table, what = d.table or d.name, "Torque" if d.turns else "Force"
            yield _input(f"{table}.{d.load}", d.load_unit, f"{what} along the freedom {d.name}")
            if d.table:
                rate = f"{d.unit}/s"
                shown = f", {d.speed!r}{display_argument(rate)}"
                yield _input(f"{table}.speed", rate, f"Commanded rate of {d.name}", d.rate, shown)
                text = "Time derivative of the commanded rate over a step"
                yield _input(f"{table}.acceleration", f"{rate}2", text, f"{d.name}.acceleration")
        for load in self.interface.loads:
            yield _input(load.name, load.unit, load.text)


def _input(name: str, unit: str, text: str, of: str = "", rest: str = "") -> str:
    """Return the source of an input's variable; if ``of`` is given, the symbol is that of the variable ``of``.

    ``rest`` is the source of further arguments.
    """
    return f'Variable("{name}", "input", "{unit}", {quote(text)}, {quote(symbol(of or name, unit))}{rest})'


def _last(drive: Drive, name: str) -> str:
    return f"{drive.name}_{name.rpartition('.')[2]}"


#: Letter and further index by the last part of a name; for a force or a coordinate of a point the index is the axis.
_SYMBOLS = {
    "angle": (r"\theta", ""),
    "speed": (r"\dot\theta", ""),
    "position": ("s", ""),
    "velocity": (r"\dot s", ""),
    "turn": (r"\varphi", ""),
    "transmission_angle": (r"\mu", ""),
    "clearance": (r"\sin\mu", r"\min"),
    "length": ("l", ""),
    "mass": ("m", ""),
    "inertia": ("J", ""),
    "cog_x": ("x", "S"),
    "cog_y": ("y", "S"),
    "direction": (r"\beta", ""),
    "gravity_direction": (r"\beta", "g"),
    "gravity": ("g", ""),
    "ratio": ("i", ""),
    "phase": (r"\varphi", "0"),
    "radius": ("r", ""),
    "offset": ("s", "0"),
    "stiffness": ("k", ""),
    "damping": ("c", ""),
    "free_length": ("l", "0"),
    "free_position": ("s", "0"),
    "free_angle": (r"\varphi", "0"),
    "friction_radius": (r"\rho", ""),
    "friction_coefficient": ("f", ""),
    "assembly": (r"\sigma", ""),
    "force": ("F", ""),
    "applied_force": ("F", ""),
    "exerted_force": ("F", ""),
    "torque": ("T", ""),
    "applied_torque": ("T", ""),
    "exerted_torque": ("T", ""),
    "moment": ("M", ""),
    "fx": ("F", "x"),
    "fy": ("F", "y"),
    "load_x": ("P", "x"),
    "load_y": ("P", "y"),
    "x": ("x", ""),
    "y": ("y", ""),
}


def symbol(name: str, unit: str, at: str = "") -> str:
    r"""Return the symbol of a variable: a letter for the quantity, with the body as index; empty if there is none.

    ``at`` is a further index, such as 0 for an initial value.

    >>> symbol("crank.length", "m"), symbol("coupler.P_x", "m"), symbol("crank.acceleration", "rad/s2")
    ('l_{\\mathrm{crank}}', 'x_{\\mathrm{coupler},P}', '\\ddot\\theta_{\\mathrm{crank}}')
    """
    owner, _, last = name.rpartition(".")
    if last == "acceleration":
        letter, index = r"\ddot\theta" if unit == "rad/s2" else r"\ddot s", ""
    elif last == "friction":
        letter, index = "F" if unit == "N" else "T", "R"
    elif last not in _SYMBOLS and unit == "m" and last[-2:] in ("_x", "_y"):
        letter, index = last[-1], last[:-2]
    elif last in _SYMBOLS and not name.startswith("energy."):
        letter, index = _SYMBOLS[last]
    else:
        return ""
    whose = "" if last in ("clearance", "gravity_direction") else owner
    indices = [part if len(part) == 1 or "\\" in part else rf"\mathrm{{{part}}}" for part in (whose, index, at) if part]
    return f"{letter}_{{{','.join(indices)}}}" if indices else letter
