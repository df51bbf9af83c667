"""Wire the FMUs of a system: parts with ports, connections between ports, and checks of the connections."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import inf, isclose
from pathlib import Path
from typing import Any, NamedTuple

from linkwork.errors import LinkworkError

from ..files import check_fmu, unknown_name
from ..run import read_description


class WiringError(LinkworkError):
    """Error for a system with a wrong part or connection; the message says what would be right."""


#: The types of real variables, in FMI 2.0 and 3.0.
REAL = ("Real", "Float64")
#: Attributes of a unit in base units.
BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")
DIMENSIONLESS = tuple(float(k == "factor") for k in BASE)


def exponents(unit: Any) -> tuple[float, ...]:
    """Return the exponents of the base units, the factor and the offset of a unit's definition, as FMPy reads it."""
    return tuple(1.0 if k == "factor" and getattr(unit, k) is None else getattr(unit, k) or 0 for k in BASE)


def same_unit(one: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    """Return whether two definitions of units agree up to the rounding of their factors; see `Part.base_unit`."""
    return one == other or (len(one) == len(other) > 1 and all(map(partial(isclose, rel_tol=1e-9), one, other)))


class Port(NamedTuple):
    """A variable of an FMU: its type, its unit, and the variable whose time derivative it is, if any.

    ``held`` says whether the variable changes only at discrete instants. For an enumeration, ``enumeration`` is the name of
    its type and ``items`` has the names of its values.
    """

    name: str
    reference: int
    causality: str
    type: str
    unit: str
    rate_of: str
    held: bool
    enumeration: str = ""
    items: tuple[tuple[int, str], ...] = ()


class End(NamedTuple):
    """End of a connection: the name of a part and the name of its port."""

    part: str
    port: str

    def __str__(self) -> str:
        return f"{self.part}.{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """An FMU of a system, for co-simulation with FMI 2.0 or 3.0.

    ``ports`` are all its variables. ``values`` are start values of some of them; the others have the start values of the FMU.
    ``feeds`` has the inputs on which an output depends directly, by the name of the output. ``description`` is the model
    description as read by FMPy.
    """

    name: str
    fmu: Path
    ports: Mapping[str, Port]
    values: Mapping[str, float]
    feeds: Mapping[str, tuple[str, ...]]
    description: Any

    @classmethod
    def from_fmu(cls, name: str, fmu: str | Path, values: Mapping[str, float]) -> Part:
        """Read a part from its FMU; raise InputError if the file is no FMU.

        WiringError is raised if the FMU is not for co-simulation with FMI 2.0 or 3.0, a name in ``values`` is no parameter or
        input of it, or a value is not of the type of its variable.
        """
        check_fmu(fmu)
        description = read_description(fmu)
        if description.coSimulation is None or not description.fmiVersion.startswith(("2", "3")):
            raise WiringError(
                f"{name}: {Path(fmu).name} is of FMI {description.fmiVersion}, with{'' if description.coSimulation else 'out'} "
                "co-simulation: a part must be for co-simulation of FMI 2.0 or 3.0"
            )
        ports = {
            v.name: Port(
                v.name,
                v.valueReference,
                v.causality,
                v.type,
                v.unit or "",
                v.derivative.name if v.derivative else "",
                v.variability in ("discrete", "constant", "fixed"),
                *((v.declaredType.name, _items(v)) if v.type == "Enumeration" else ()),
            )
            for v in description.modelVariables
            if not v.dimensions
        }
        settable = [port.name for port in ports.values() if port.causality in ("parameter", "input")]
        for known in values:
            if known not in settable:
                raise unknown_name(known, settable, f"parameter or input {known} of {name}")
            kind, value = ports[known].type, values[known]
            if kind in ("String", "Binary", "Clock"):
                raise WiringError(f"{name}.{known} is of type {kind}: only numbers can be start values")
            if kind not in REAL and not float(value).is_integer():
                raise WiringError(f"{name}.{known} starts with {value:g}: it must be a whole number")
        # an output without a list depends on all inputs; a Python FMU has no lists, and its outputs follow at the next step
        wrapped = str(description.generationTool).startswith("PythonFMU")
        inputs = [] if wrapped else [v for v in description.modelVariables if v.causality == "input"]
        feeds = {
            unknown.variable.name: tuple(v.name for v in on if v.causality == "input")
            for unknown in description.outputs
            if (on := inputs if unknown.dependencies is None else unknown.dependencies)
        }
        return cls(name=name, fmu=Path(fmu), ports=ports, values=values, feeds=feeds, description=description)

    def base_unit(self, port: str) -> tuple[Any, ...] | None:
        """Return the unit of a port in base units, with factor and offset; None if the FMU states no units.

        A port without a unit is dimensionless. A unit without a definition in base units is returned by its name.
        """
        known = self.description.unitDefinitions
        if not known:
            return None
        if not (name := self.ports[port].unit):
            return DIMENSIONLESS
        base = next((unit.baseUnit for unit in known if unit.name == name), None)
        return (name,) if base is None else exponents(base)

    def real_variables(self, causality: str) -> tuple[str, ...]:
        """Return the names of all real variables with a causality."""
        return tuple(p.name for p in self.ports.values() if p.causality == causality and p.type in REAL)


def _items(variable: Any) -> tuple[tuple[int, str], ...]:
    """Return values and names of an enumeration."""
    return tuple((int(item.value), str(item.name)) for item in variable.declaredType.items)


class Bond(NamedTuple):
    """Power bond: an effort and a flow whose product is a power, connected in opposite directions between two parts."""

    effort: End
    effort_to: End
    flow: End
    flow_to: End


def _table(name: str) -> str:
    """Return the table of an input, such as "drive" for "drive.speed"; the name itself if it has no dot."""
    return name.rpartition(".")[0] or name


#: Units whose product is a power, effort first.
_POWERS = (("N.m", "rad/s"), ("N", "m/s"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """The parts of a system and their connections.

    Attributes
    ----------
    title : str
    parts : mapping of str to Part
    connections : mapping of End to End
        For each connected input, the output to which it is connected.
    stop_time, step : float
        End of a run, and default communication step (s).
    remarks : tuple of str
        Sentences on entries of the system's file that have no effect.

    Raises
    ------
    WiringError, UnknownNameError
        If a connection is wrong.
    """

    title: str
    parts: Mapping[str, Part]
    connections: Mapping[End, End]
    stop_time: float
    step: float
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for target, source in self.connections.items():
            for end, causality in ((target, "input"), (source, "output")):
                if end.part not in self.parts:
                    raise unknown_name(end.part, self.parts, f"part {end.part}, of {source} -> {target}")
                part = self.parts[end.part]
                if end.port not in part.ports:
                    raise unknown_name(
                        end.port, part.real_variables(causality), f"{causality} {end}, of {source} -> {target}"
                    )
                port = part.ports[end.port]
                if port.causality != causality:
                    raise WiringError(
                        f"{source} -> {target}: {end} is of causality {port.causality}, it must be an {causality}"
                    )
                if port.type not in REAL:
                    raise WiringError(
                        f"{source} -> {target}: {end} is of type {port.type}: only real variables are connected"
                    )
            unit, other = (self.port(end).unit for end in (source, target))
            base, other_base = (self.parts[end.part].base_unit(end.port) for end in (source, target))
            if unit != other and base and other_base and not same_unit(base, other_base):
                said = " and ".join(name or "without a unit" for name in (unit, other))
                raise WiringError(f"{source} -> {target}: the units do not match, {said}; they must be the same")

    def port(self, end: End) -> Port:
        """Return the port at an end of a connection."""
        return self.parts[end.part].ports[end.port]

    def unit(self, end: End) -> str:
        """Return the unit of a port; if its FMU states no units, the unit of the port to which it is connected."""
        others = [t for t, source in self.connections.items() if source == end]
        others += [self.connections[end]] if end in self.connections else []
        return next((self.port(one).unit for one in (end, *others) if self.port(one).unit), "")

    def rate_input(self, end: End) -> End | None:
        """Return the input for the time derivative of a given input: in the same table, with the unit divided by seconds."""
        unit = {"rad/s": "rad/s2", "m/s": "m/s2"}.get(self.port(end).unit)
        inputs = (
            End(end.part, name)
            for name in self.parts[end.part].real_variables("input")
            if _table(name) == _table(end.port)
        )
        return next((other for other in inputs if self.port(other).unit == unit), None)

    def notes(self, step: float | None = None) -> list[str]:
        """Return the remarks and hints at possible mistakes.

        The hints are about unconnected inputs, ports without units, controllers without gains, controllers whose sample time is
        shorter than the communication step ``step`` (s; by default that of the system), and algebraic loops.
        """
        step = self.step if step is None else step
        found = [*self.remarks]
        for name, part in self.parts.items():
            inputs = part.real_variables("input")
            served = {_table(i) for i in inputs if End(name, i) in self.connections or i in part.values}
            free = [i for i in inputs if _table(i) not in served]
            if free:
                found.append(f"{name}: not connected, and at their start values: {', '.join(free)}")
            if not part.description.unitDefinitions:
                own = {
                    end.port: self.unit(end) for pair in self.connections.items() for end in pair if end.part == name
                }
                if said := ", ".join(f"{port} in {unit}" for port, unit in own.items() if unit):
                    found.append(f"{name}: its FMU gives no units; each is taken from the other end: {said}")
            gains = [own for own in part.real_variables("parameter") if f"_{own}".endswith("_gain")]
            asked = {*gains, "sample_time"}
            starts = {v.name: float(v.start or 0.0) for v in part.description.modelVariables if v.name in asked}
            if gains and not any(part.values.get(gain, starts[gain]) for gain in gains):
                found.append(f"{name}: its gains are 0: {', '.join(gains)}")
            period = part.values.get("sample_time", starts.get("sample_time", inf))
            if step > period * (1.0 + 1e-9):
                found.append(
                    f"{name}: {step:g} s between communication points are longer than its sample time, {period:g} s: the "
                    "samples in a step use the same inputs"
                )
        if loops := sorted(self.loops(), key=len):
            more = f", and {len(loops) - 1} more" if len(loops) > 1 else ""
            shortest = " -> ".join(map(str, loops[0]))
            found.append(f"algebraic loop {shortest}{more}: each step works with values of the step before")
        return found

    def loops(self) -> Iterator[list[End]]:
        """Yield the shortest algebraic loop through each connected output, each loop once.

        A loop is a chain of outputs that depend directly on one another.
        """
        connected = dict.fromkeys(self.connections.values())
        after: dict[End, list[End]] = {}
        for target, source in self.connections.items():
            for output, inputs in self.parts[target.part].feeds.items():
                if target.port in inputs and (end := End(target.part, output)) in connected:
                    after.setdefault(source, []).append(end)
        seen: set[frozenset[End]] = set()
        for first in connected:
            # extend chains of outputs from this one to outputs that no chain has reached yet: all chains can be too many
            chains, reached = [[first]], set[End]()
            for chain in chains:
                for end in after.get(chain[-1], ()):
                    if end not in reached:
                        reached.add(end)
                        chains.append([*chain, end])
            loop = next((chain for chain in chains[1:] if chain[-1] == first), [])
            if loop and frozenset(loop) not in seen:
                seen.add(frozenset(loop))
                yield loop

    def bonds(self) -> list[Bond]:
        """Return the power bonds: unique pairs of an effort and a flow in opposite directions between two parts."""
        # the names of a unit may differ at the ends of a connection, such as N.m and Nm
        found = [
            Bond(source, target, flow, flow_to)
            for target, source in self.connections.items()
            for flow_to, flow in self.connections.items()
            if (flow.part, flow_to.part) == (target.part, source.part)
            and any(
                pair in _POWERS
                for pair in product((self.unit(source), self.unit(target)), (self.unit(flow), self.unit(flow_to)))
            )
        ]
        efforts, flows = [bond.effort_to for bond in found], [bond.flow_to for bond in found]
        return [b for b in found if efforts.count(b.effort_to) == 1 and flows.count(b.flow_to) == 1]
