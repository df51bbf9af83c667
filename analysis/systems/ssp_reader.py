"""Read systems from SSP archives (System Structure and Parameterization), of this and of other tools.

What the standard has and a `Wiring` has not is refused: systems inside systems, signal dictionaries, and transformations of
connections.
"""

from __future__ import annotations

import hashlib
import posixpath
import zipfile
from collections.abc import Iterator, Mapping
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote
from xml.etree import ElementTree

from linkwork.errors import InputError

from ..numerics.cache import code_folder, store_file
from .ssp import STEP
from .wiring import BASE, End, Part, Port, Wiring, WiringError

_TRANSFORMATIONS = tuple(
    f"{kind}Transformation" for kind in ("Linear", *(f"{k}Mapping" for k in ("Boolean", "Integer", "Enumeration")))
)
_SETS, _MAPPINGS = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"
#: The two texts of each Boolean in XML.
_BOOLEANS = {"1": "true", "0": "false"}

Node = ElementTree.Element
Base = tuple[float, ...]


class Given(NamedTuple):
    """A start value as text, with its unit, the unit's definition in base units, and a transformation after its conversion."""

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
    """Return the file of an archive, or the file inside a component, at which the source of an element points."""
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
    """Return start values under the names of a mapping; those that it does not name are not applied."""
    found = {}
    for entry in _below(mapping, "MappingEntry"):
        if (name := entry.get("source", "")) in values:
            found[entry.get("target", "")] = values[name]._replace(
                converted=entry.get("suppressUnitConversion", "false") not in ("true", "1"),
                change=next((child for child in entry if _tag(child) in _TRANSFORMATIONS), None),
            )
    return found


def read_ssp(path: str | Path) -> Wiring:
    """Read a system from an ``.ssp``: FMUs on one level, connections, start values from ``.ssv`` with names mapped by ``.ssm``.

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
        (system,) = _below(root, "System")
        _check_supported(path, system)
        units, parts, remarks = _units(root), {}, []
        shared = _Source(archive, units, None).values(system)
        for name, value in shared.copy().items():
            # the value of a connector of the system is that of what it is connected to
            shared |= {str(end): value for end in _inside(system, name)}
        named = {element.get("name", "") for element in _below(system, "Elements", "Component")}
        for component in _below(system, "Elements", "Component"):
            name = component.get("name", "")
            fmu = _read(archive, component, f"the component {name}")
            place = folder / hashlib.sha256(fmu).hexdigest()[:12] / posixpath.basename(component.get("source", ""))
            place.parent.mkdir(parents=True, exist_ok=True)
            store_file(place, fmu)
            part = Part.from_fmu(name, place, {})
            _check_connectors(component, part, units)
            given = _Source(archive, units, fmu).values(component)
            # a value at a higher level takes precedence
            given |= {
                key.removeprefix(f"{name}."): value for key, value in shared.items() if key.startswith(f"{name}.")
            }
            remarks += [
                f"{name}: {key} of its parameters matches no variable, and is left out"
                for key in sorted(given.keys() - part.ports)
            ]
            values = {key: _number(part, key, given[key]) for key in given if key in part.ports}
            parts[name] = Part.from_fmu(name, place, values)
        connectors = {connector.get("name", "") for connector in _below(system, "Connectors", "Connector")}
        for key in shared:
            if key.partition(".")[0] not in named and key not in connectors:
                remarks.append(f"{key} of the system's parameters matches no variable, and is left out")
    stop_time, step = _experiment(path, root)
    return Wiring(
        title=root.get("name", ""),
        parts=parts,
        connections=_connections(path, system, parts),
        stop_time=stop_time,
        step=step,
        remarks=tuple(remarks),
    )


def _check_supported(path: str | Path, system: Node) -> None:
    for node in system.iter():
        if _tag(node) in ("SignalDictionaries", "SignalDictionaryReference"):
            raise WiringError(
                f"{path} has a {_tag(node)}, which is not supported: a part of the system must do what it does"
            )
    for connection in _below(system, "Connections", "Connection"):
        for change in connection:
            if _tag(change) in _TRANSFORMATIONS:
                raise WiringError(
                    f"{path} has a {_tag(change)} of a connection, which is not supported: a part of the system must do what "
                    "it does"
                )
    for element in _below(system, "Elements", "System"):
        raise WiringError(f"{element.get('name')} is no FMU: a system inside a system is not read")
    for component in _below(system, "Elements", "Component"):
        kind, name = component.get("type", "application/x-fmu-sharedlibrary"), component.get("name")
        if kind != "application/x-fmu-sharedlibrary":
            raise WiringError(f"{name} is of type {kind}, no FMU: a system inside a system is not read")
        if component.get("implementation") not in (None, "any", "CoSimulation"):
            raise WiringError(f"{name} asks for {component.get('implementation')}: a part must be for co-simulation")


def _check_connectors(component: Node, part: Part, units: Mapping[str, Base]) -> None:
    """Refuse a connector with another unit than its variable: connected values would be taken in the wrong unit."""
    for connector in _below(component, "Connectors", "Connector"):
        port, unit = (
            part.ports.get(connector.get("name", "")),
            next((c.get("unit", "") for c in connector if "unit" in c.attrib), ""),
        )
        if port is None or unit in ("", port.unit):
            continue
        base = part.base_unit(port.name)
        if base is not None and units.get(unit) != base:
            raise WiringError(
                f"the connector {part.name}.{port.name} is in {unit}: it must be in {port.unit or 'no unit'}, as the variable "
                "of the FMU is"
            )


def _ends(system: Node) -> Iterator[tuple[End, End]]:
    """Yield both ends of each connection; an end at the system's edge has no part."""
    for c in _below(system, "Connections", "Connection"):
        yield (
            End(c.get("startElement", ""), c.get("startConnector", "")),
            End(c.get("endElement", ""), c.get("endConnector", "")),
        )


def _inside(system: Node, connector: str) -> list[End]:
    """Return the ends inside a system to which one of its own connectors is connected."""
    edge = End("", connector)
    return [other for pair in _ends(system) for end, other in (pair, pair[::-1]) if end == edge and other.part]


def _connections(path: str | Path, system: Node, parts: Mapping[str, Part]) -> dict[End, End]:
    """Return the connections between parts; which end is the input follows from the FMUs, not from the order."""
    found: dict[End, End] = {}
    for source, target in _ends(system):
        if not (source.part and target.part):
            continue  # at the edge of the system, where nothing else is
        kinds = [
            parts[e.part].ports[e.port].causality
            for e in (source, target)
            if e.part in parts and e.port in parts[e.part].ports
        ]
        if kinds == ["input", "output"]:
            source, target = target, source
        if target in found:
            raise WiringError(f"{path}: {target} has two connections: each input must have one")
        found[target] = source
    return found


def _experiment(path: str | Path, root: Node) -> tuple[float, float]:
    """Return stop time and communication step (s)."""
    for experiment in _below(root, "DefaultExperiment"):
        if "stopTime" not in experiment.attrib:
            raise WiringError(f"{path} has a DefaultExperiment without stopTime: it must have one")
        given = {"startTime": "0"} | experiment.attrib
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
    return float((value * base[-2] + base[-1] - own[-1]) / own[-2])


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
