"""Read systems from SSP archives (System Structure and Parameterization), of this and of other tools.

Parts of the standard that a `Wiring` cannot represent are refused: systems in other files, signal dictionaries, and
transformations of connections.
"""

from __future__ import annotations

import hashlib
import posixpath
import zipfile
from collections.abc import Container, Iterator, Mapping, Sequence
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree import ElementTree

from linkwork.errors import InputError

from ..numerics.cache import code_folder, store_file
from .ssp import STEP
from .wiring import BASE, End, Part, Port, Wiring, WiringError, same_unit

_TRANSFORMATIONS = tuple(
    f"{kind}Transformation" for kind in ("Linear", *(f"{k}Mapping" for k in ("Boolean", "Integer", "Enumeration")))
)
_SETS, _MAPPINGS = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"
#: The two texts of each Boolean in XML.
_BOOLEANS = {"1": "true", "0": "false"}

Node = ElementTree.Element
Base = tuple[float, ...]


class Given(NamedTuple):
    """A start value as text, with its unit and the unit's definition in base units.

    ``converted`` tells whether the value is converted to the unit of its variable; ``change`` is a transformation after that.
    """

    text: str
    unit: str = ""
    base: Base | None = None
    converted: bool = True
    change: Node | None = None


def _tag(node: Node) -> str:
    return node.tag.rpartition("}")[2]


def _below(node: Node, *path: str) -> list[Node]:
    """Return all elements along a path of names, whatever their namespaces, which differ between versions of the standard."""
    found = [node]
    for name in path:
        found = [child for parent in found for child in parent if _tag(child) == name]
    return found


def _read(archive: zipfile.ZipFile, node: Node, what: str) -> bytes:
    """Return the content of the file of an archive that the attribute ``source`` of an element names."""
    source = node.get("source", "")
    try:
        return archive.read(posixpath.normpath(unquote(source)))
    except KeyError:
        raise WiringError(f"the source of {what} is {source!r}: it must be a file of the archive") from None


def _parse(content: bytes, what: str) -> Node:
    try:
        return ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise InputError(f"{what} is no XML: {error}") from None


def _units(node: Node) -> dict[str, Base]:
    """Return the units that a file defines, in base units."""
    return {
        unit.get("name", ""): tuple(float(base.get(name, name == "factor")) for name in BASE)
        for unit in _below(node, "Units", "Unit")
        for base in _below(unit, "BaseUnit")
    }


class _Source:
    """A component or system whose parameter bindings are read; ``fmu`` is that of a component."""

    def __init__(self, archive: zipfile.ZipFile, units: Mapping[str, Base], fmu: bytes | None) -> None:
        self.archive, self.units, self.fmu = archive, units, fmu

    def _content(self, node: Node, tag: str, kind: str) -> Node:
        """Return the root of the file to which an element refers, or of its inline content."""
        if node.get("type", kind) != kind:
            raise WiringError(f"a {_tag(node)} is of type {node.get('type')}: it must be of type {kind}")
        if node.get("source"):
            inside = node.get("sourceBase") == "component" and self.fmu is not None
            base = zipfile.ZipFile(BytesIO(self.fmu or b"")) if inside else self.archive
            return _parse(_read(base, node, f"a {_tag(node)}"), node.get("source", ""))
        inline = [child for child in node.iter() if child is not node and _tag(child) == tag]
        if not inline:
            raise WiringError(f"a {_tag(node)} has neither a source nor a {tag}: it must have one")
        return inline[0]

    def values(self, element: Node) -> dict[str, Given]:
        """Return the start values of an element by name; later bindings take precedence, as the standard says."""
        found: dict[str, Given] = {}
        for binding in _below(element, "ParameterBindings", "ParameterBinding"):
            given, prefix = self._content(binding, "ParameterSet", _SETS), binding.get("prefix", "")
            units = {**(self.units if not binding.get("source") else {}), **_units(given)}
            own = {}
            for parameter in _below(given, "Parameters", "Parameter"):
                value = next((child for child in parameter if "value" in child.attrib), Node("None"))
                unit, name = value.get("unit", ""), f"{prefix}{parameter.get('name', '')}"
                own[name] = Given(value.get("value", ""), unit, units.get(unit))
            for mapping in _below(binding, "ParameterMapping"):
                own = _map(own, self._content(mapping, "ParameterMapping", _MAPPINGS))
            found |= own
        return found


def _map(values: Mapping[str, Given], mapping: Node) -> dict[str, Given]:
    """Return start values under the names that a mapping gives them; values that it does not name are left out."""
    found = {}
    for entry in _below(mapping, "MappingEntry"):
        if (name := entry.get("source", "")) in values:
            found[entry.get("target", "")] = values[name]._replace(
                converted=entry.get("suppressUnitConversion", "false") not in ("true", "1"),
                change=next((child for child in entry if _tag(child) in _TRANSFORMATIONS), None),
            )
    return found


def read_ssp(path: str | Path) -> Wiring:
    """Read a system from an ``.ssp``: FMUs, connections, start values from ``.ssv`` with names mapped by ``.ssm``.

    The parts of a system inside the system are parts like the others; their names begin with the name of the inner system, as
    in ``drive_motor``.
    Start values that match no variable are named in the notes of the wiring.

    Raises
    ------
    InputError
        If the file is no ``.ssp``.
    WiringError, UnknownNameError
        If the system has an element that is not supported, or a connection is wrong.
    """
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path} is no .ssp: it must be an archive with a SystemStructure.ssd")
    folder = code_folder("systems") / hashlib.sha256(Path(path).read_bytes()).hexdigest()[:12]
    with zipfile.ZipFile(path) as archive:
        if "SystemStructure.ssd" not in archive.namelist():
            raise InputError(f"{path} has no SystemStructure.ssd: it must be an archive of SSP")
        root = _parse(archive.read("SystemStructure.ssd"), f"the SystemStructure.ssd of {path}")
        if not (tops := _below(root, "System")):
            raise InputError(f"the SystemStructure.ssd of {path} has no System: it must have one")
        _check_supported(path, tops[0])
        units, systems, parts = _units(root), dict(_systems(tops[0])), {}
        given: dict[str, Given] = {}
        for inside, system in systems.items():
            for component in _below(system, "Elements", "Component"):
                name = _join(inside, component.get("name", ""))
                fmu = _read(archive, component, f"the component {name}")
                place = folder / hashlib.sha256(fmu).hexdigest()[:12] / posixpath.basename(component.get("source", ""))
                place.parent.mkdir(parents=True, exist_ok=True)
                store_file(place, fmu)
                parts[name] = Part.from_fmu(name.replace(".", "_") if inside else name, place, {})
                _check_connectors(component, parts[name], units)
                given |= {f"{name}.{key}": v for key, v in _Source(archive, units, fmu).values(component).items()}
        for inside, system in reversed(systems.items()):  # values at a higher level take precedence
            within = list(_links(dict(_systems(system, inside))))
            for key, value in _Source(archive, units, None).values(system).items():
                # that of a connector of the system is that of the inputs and parameters in it to which it is connected
                ends = [e for e in _reach(within, End(inside, key), systems) if _causality(parts, e) != "output"]
                given |= dict.fromkeys([f"{e.part}.{e.port}" for e in ends] or [_join(inside, key)], value)
    for name in (names := [part.name for part in parts.values()]):
        if names.count(name) > 1:
            raise WiringError(
                f"{path} has two parts {name}: names must be unique, and those of inner systems stand before a _"
            )
    known = {f"{name}.{port}": (name, port) for name, part in parts.items() for port in part.ports}
    values: dict[str, dict[str, float]] = {name: {} for name in parts}
    for key in given.keys() & known:
        name, port = known[key]
        values[name][port] = _number(parts[name], port, given[key])
    stop_time, step = _experiment(path, root)
    return Wiring(
        title=root.get("name", ""),
        parts={part.name: Part.from_fmu(part.name, part.fmu, values[name]) for name, part in parts.items()},
        connections=_connections(path, list(_links(systems)), systems, parts),
        stop_time=stop_time,
        step=step,
        remarks=tuple(
            f"the parameter {key} matches no variable, and is left out" for key in sorted(given.keys() - known)
        ),
    )


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path and name else path or name


def _systems(system: Node, path: str = "") -> Iterator[tuple[str, Node]]:
    """Yield a system and all systems inside it, each with its path of names from the first system."""
    yield path, system
    for inner in _below(system, "Elements", "System"):
        yield from _systems(inner, _join(path, inner.get("name", "")))


def _links(systems: Mapping[str, Node]) -> Iterator[tuple[End, End]]:
    """Yield both ends of each connection by their paths; an end at the edge of a system has the path of the system."""
    for path, system in systems.items():
        for c in _below(system, "Connections", "Connection"):
            yield (
                End(_join(path, c.get("startElement", "")), c.get("startConnector", "")),
                End(_join(path, c.get("endElement", "")), c.get("endConnector", "")),
            )


def _reach(links: Sequence[tuple[End, End]], start: End, systems: Container[str]) -> list[End]:
    """Return the ends at parts that are connected to the end ``start``, directly or through edges of systems."""
    seen, found = [start], []
    for end in seen:
        for other in (there for pair in links for here, there in (pair, pair[::-1]) if here == end):
            if other.part in systems and other not in seen:
                seen.append(other)
            elif other.part not in systems and other != start:
                found.append(other)
    return found


def _causality(parts: Mapping[str, Part], end: End) -> str:
    return parts[end.part].ports[end.port].causality if end.part in parts and end.port in parts[end.part].ports else ""


def _check_supported(path: str | Path, system: Node) -> None:
    for node in system.iter():
        if _tag(node) in ("SignalDictionaries", "SignalDictionaryReference"):
            raise WiringError(
                f"{path} has a {_tag(node)}, which is not supported: a part of the system must do what it does"
            )
        for change in node if _tag(node) == "Connection" else ():
            if _tag(change) in _TRANSFORMATIONS:
                raise WiringError(
                    f"{path} has a {_tag(change)} of a connection, which is not supported: a part of the system must do what "
                    "it does"
                )
        if _tag(node) != "Component":
            continue
        kind, name = node.get("type", "application/x-fmu-sharedlibrary"), node.get("name")
        if kind != "application/x-fmu-sharedlibrary":
            raise WiringError(f"{name} is of type {kind}, no FMU: systems in other files are not read")
        if node.get("implementation") not in (None, "any", "CoSimulation"):
            raise WiringError(f"{name} asks for {node.get('implementation')}: a part must be for co-simulation")


def _check_connectors(component: Node, part: Part, units: Mapping[str, Base]) -> None:
    """Refuse a connector with another unit than its variable: connected values would be taken in the wrong unit."""
    for connector in _below(component, "Connectors", "Connector"):
        port = part.ports.get(connector.get("name", ""))
        unit = next((child.get("unit", "") for child in connector if "unit" in child.attrib), "")
        if port is None or unit in ("", port.unit):
            continue
        base = part.base_unit(port.name)
        if base is not None and not same_unit(units.get(unit, ()), base):
            raise WiringError(
                f"the connector {part.name}.{port.name} is in {unit}: it must be in {port.unit or 'no unit'}, as the variable "
                "of the FMU is"
            )


def _connections(
    path: str | Path, links: Sequence[tuple[End, End]], systems: Container[str], parts: Mapping[str, Part]
) -> dict[End, End]:
    """Return the connections between parts; which end is the input follows from the FMUs, not from the order."""
    pairs = [pair for pair in links if not any(end.part in systems for end in pair)]
    pairs = [pair[::-1] if [_causality(parts, e) for e in pair] == ["input", "output"] else pair for pair in pairs]
    for pair in links:
        for target, edge in (pair, pair[::-1]):
            if edge.part in systems and _causality(parts, target) == "input":
                through = _reach(links, edge, systems)
                pairs += [(source, target) for source in through if _causality(parts, source) == "output"]
    found: dict[End, End] = {}
    for source, target in pairs:
        if target in found:
            raise WiringError(f"{path}: {target} has two connections: each input must have one")
        found[target] = source
    names = {name: part.name for name, part in parts.items()}
    return {End(names.get(t.part, t.part), t.port): End(names.get(s.part, s.part), s.port) for t, s in found.items()}


def _experiment(path: str | Path, root: Node) -> tuple[float, float]:
    """Return stop time and communication step (s)."""
    for experiment in _below(root, "DefaultExperiment"):
        given = {"startTime": "0", "stopTime": "1"} | experiment.attrib
        start, stop_time = (_as_number(given[name], None, f"{path}: {name}") for name in ("startTime", "stopTime"))
        if start:
            raise WiringError(f"{path} starts at {start} s: it must start at 0 s")
        for note in experiment.iter():
            if note.get("type") == STEP and len(note):
                return stop_time, _as_number(str(note[0].text), None, f"{path}: the communication step")
        return stop_time, 1e-3 * stop_time
    return 1.0, 1e-3


def _number(part: Part, key: str, given: Given) -> float:
    """Return a start value in the unit of its variable, transformed as its mapping says."""
    port, change, name = part.ports[key], given.change, f"{part.name}.{key}"
    if change is not None and _tag(change) != "LinearTransformation":
        text = _BOOLEANS.get(given.text, given.text) if "Boolean" in _tag(change) else given.text
        pairs = {e.get("source", ""): e.get("target", "") for e in _below(change, "MapEntry")}
        if "Boolean" in _tag(change):
            pairs = {_BOOLEANS.get(source, source): target for source, target in pairs.items()}
        if text not in pairs:
            raise WiringError(
                f"{name} starts with {given.text!r}: its mapping must have it, and has {', '.join(pairs)}"
            )
        return _as_number(pairs[text], port, name)
    value = _as_number(given.text, port, name)
    if given.converted:
        value = _convert(value, part, key, given.unit, given.base)
    if change is not None:
        value = value * float(change.get("factor", 1.0)) + float(change.get("offset", 0.0))
    return value


def _convert(value: float, part: Part, key: str, unit: str, base: Base | None) -> float:
    """Return a start value in the unit of its variable; ``unit`` is the unit in which it is given, ``base`` its definition."""
    port, own = part.ports[key], part.base_unit(key)
    if own is None or unit in ("", port.unit):
        return value
    if base is None or len(own) != len(base) or own[:-2] != base[:-2]:
        raise WiringError(f"{part.name}.{key} starts with {value:g} {unit}: it must be in {port.unit or 'no unit'}")
    (factor, offset), (own_factor, own_offset) = base[-2:], own[-2:]
    return float((value * factor + offset - own_offset) / own_factor)


def _as_number(text: str, port: Port | None, name: str) -> float:
    """Return a start value as a number: 0 or 1 for a Boolean, the value of the item for an enumeration."""
    names = {item: float(value) for value, item in port.items} if port is not None else {}
    names |= {"true": 1.0, "false": 0.0}
    if text in names:
        return names[text]
    try:
        if isfinite(value := float(text)):
            return value
    except ValueError:
        pass
    raise WiringError(f"{name} starts with {text!r}: it must be a number")
