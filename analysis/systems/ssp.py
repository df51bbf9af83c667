"""Write and read systems as SSP archives (System Structure and Parameterization), with pyssp-standard.

An archive follows SSP 1.0, which supports FMI 2.0; with an FMI 3.0 part it follows SSP 2.0. This module adds the geometry of
the diagram, which the library does not write, and moves the units to where the schema requires them. The library ignores
transformations of connections and signal dictionaries: a file that has one is refused.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from linkwork.errors import InputError

from ..files import output
from ..libraries import lazy
from ..numerics.cache import code_folder, store_file
from .layout import boxes
from .wiring import BASE, REAL, End, Part, Port, Wiring, WiringError, exponents

ssp = lazy("pyssp_standard.ssp")
ssd = lazy("pyssp_standard.ssd")
common = lazy("pyssp_standard.common_content_ssc")
unit = lazy("pyssp_standard.unit")
etree = lazy("lxml.etree")
_NAMESPACE = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
#: Type of the experiment's annotation with the communication step, for which the standard has no place.
_STEP = "linkwork.communication-step"
#: Elements that the library ignores silently.
_UNREAD = ("LinearTransformation", "BooleanMappingTransformation", "IntegerMappingTransformation", "SignalDictionaries")


def write_ssp(wiring: Wiring, path: str | Path) -> Path:
    """Write a system as an ``.ssp``: its FMUs, connections with units, start values of each part as ``.ssv``, and the diagram.

    Raises
    ------
    MissingLibraryError
        If pyssp-standard is not installed.
    """
    with output(path) as (target, final), tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "system.ssp"
        with ssp.SSP(made, mode="w") as archive:
            sources = {name: _source(wiring.parts, name) for name in wiring.parts}
            for name, part in wiring.parts.items():
                stored = Path(folder) / sources[name]
                if not stored.exists():
                    shutil.copy(part.fmu, stored)
                    archive.add_resource(stored)
                archive.add_resource(_values(Path(folder) / f"{name}.ssv", part))
            with archive.system_structure as structure:
                newer = any(part.description.fmiVersion.startswith("3") for part in wiring.parts.values())
                structure.name, structure.version = wiring.title or "system", "2.0" if newer else "1.0"
                structure.system = ssd.System(None, "system")
                structure.system.elements = [
                    _component(part, sources[name], _ports(wiring, name)) for name, part in wiring.parts.items()
                ]
                for end, source in wiring.connections.items():
                    ends = {"start_element": source.part, "start_connector": source.port}
                    structure.add_connection(ssd.Connection(**ends, end_element=end.part, end_connector=end.port))
                structure.default_experiment = ssd.DefaultExperiment()
                structure.default_experiment.start_time, structure.default_experiment.stop_time = 0.0, wiring.stop_time
                connected = [end for pair in wiring.connections.items() for end in pair]
                for made_unit in _units((wiring.parts[end.part], end.port) for end in connected):
                    structure.units.add_unit(made_unit)
            _complete_structure(archive.unpacked_path / "SystemStructure.ssd", wiring)
        shutil.copy(made, target)
    return final


def _source(parts: Mapping[str, Part], name: str) -> str:
    """Return the name of a part's FMU in the archive: its file name, or the part's name if two files have the same name."""
    file = parts[name].fmu
    rivals = {part.fmu for part in parts.values() if part.fmu.name == file.name}
    return file.name if len(rivals) == 1 else f"{name}.fmu"


def _ports(wiring: Wiring, name: str) -> dict[str, list[str]]:
    """Return the connected ports of a part, by causality."""
    ends = {end.port for pair in wiring.connections.items() for end in pair if end.part == name}
    part = wiring.parts[name]
    return {kind: [port for port in part.real_variables(kind) if port in ends] for kind in ("input", "output")}


def _units(ports: Iterable[tuple[Part, str]]) -> list[Any]:
    """Return the units of ports, each name once, as their FMUs define them."""
    found: dict[str, dict[str, float]] = {}
    for part, port in ports:
        base = part.base_unit(port) or ()
        known = dict(zip(BASE, base)) if len(base) == len(BASE) else {}
        found.setdefault(part.ports[port].unit, {k: v for k, v in known.items() if v != (k == "factor")})
    return [unit.Unit(name, unit.BaseUnit(base)) for name, base in found.items() if name]


def _component(part: Part, source: str, ports: Mapping[str, Iterable[str]]) -> Any:
    """Return the SSP component of a part, with its connectors and start values."""
    component = ssd.Component()
    component.name, component.component_type = part.name, "application/x-fmu-sharedlibrary"
    component.source, component.implementation = f"resources/{source}", "CoSimulation"
    component.connectors = [
        ssd.Connector(None, name, kind, common.TypeReal(part.ports[name].unit or None))
        for kind, names in ports.items()
        for name in names
    ]
    component.parameter_bindings = [ssd.ParameterBinding(source=f"resources/{part.name}.ssv")]
    return component


def _complete_structure(path: Path, wiring: Wiring) -> None:
    """Add communication step and geometry to the file, and move the units before the experiment, as the schema requires."""
    tree = etree.parse(path)
    root, placed = tree.getroot(), boxes(wiring)
    found = {node.tag: node for node in root}
    if f"{_NAMESPACE}Units" in found:
        found[f"{_NAMESPACE}DefaultExperiment"].addprevious(found[f"{_NAMESPACE}Units"])
    common = f"{{{root.nsmap['ssc']}}}"
    annotations = etree.SubElement(found[f"{_NAMESPACE}DefaultExperiment"], f"{_NAMESPACE}Annotations")
    note = etree.SubElement(annotations, f"{common}Annotation", type=_STEP)
    etree.SubElement(note, "step", unit="s").text = repr(wiring.step)
    for element in root.iter(f"{_NAMESPACE}Component"):
        box = placed[element.get("name")]
        for connector in element.iter(f"{_NAMESPACE}Connector"):
            name, across = connector.get("name"), 0.0 if connector.get("kind") == "input" else 1.0
            up = (box.port_height(name) - box.bottom) / (box.top - box.bottom)
            etree.SubElement(connector, f"{_NAMESPACE}ConnectorGeometry", x=repr(across), y=f"{up:.4f}")
        edges = {"x1": box.left, "y1": box.bottom, "x2": box.right, "y2": box.top}
        geometry = etree.Element(f"{_NAMESPACE}ElementGeometry", {key: repr(value) for key, value in edges.items()})
        connectors = element.find(f"{_NAMESPACE}Connectors")
        # a part without connected ports has no connectors
        element.insert(0 if connectors is None else element.index(connectors) + 1, geometry)
    tree.write(path, xml_declaration=True, encoding="utf-8")


def _values(path: Path, part: Part) -> Path:
    """Write the start values of a part to ``path``, values of enumerations by their names, and return the path."""
    ports = [part.ports[name] for name in part.values]
    with lazy("pyssp_standard.ssv").SSV(path, mode="w") as values:
        for port in ports:
            value = part.values[port.name]
            if port.type in REAL:
                values.add_parameter(port.name, "Real", value=float(value), unit=port.unit)
            elif port.type == "Boolean":
                values.add_parameter(port.name, "Boolean", value=str(bool(value)).lower())
            elif port.items:
                name = dict(port.items).get(int(value), str(int(value)))
                values.add_parameter(port.name, "Enumeration", value=name, name=port.enumeration)
            else:
                values.add_parameter(port.name, "Integer", value=int(value))
        for made in _units((part, port.name) for port in ports if port.type in REAL):
            values.units.add_unit(made)
        for name, items in {port.enumeration: port.items for port in ports if port.items}.items():
            rows = [common.Item(text, number) for number, text in items]
            values.enumerations.add_enumeration(common.Enumeration(name, rows))
    tree = etree.parse(path)
    root = tree.getroot()
    for node in root.findall(f"{{{root.nsmap['ssc']}}}Enumerations"):
        # the library puts enumerations last, and into another namespace than the schema
        node.tag = f"{{{root.nsmap['ssv']}}}Enumerations"
        root.insert(1, node)
    for node in root.iterfind(".//*[@unit='']"):
        # the library writes no value without a unit
        del node.attrib["unit"]
    tree.write(path, xml_declaration=True, encoding="utf-8")
    return path


def read_ssp(path: str | Path) -> Wiring:
    """Read a system from an ``.ssp``: FMUs on one level, connections, start values from ``.ssv`` with names mapped by ``.ssm``.

    Raises
    ------
    InputError
        If the file is no ``.ssp``.
    MissingLibraryError
        If pyssp-standard is not installed.
    WiringError, UnknownNameError
        If the system has an element that is not supported, or a connection is wrong.
    """
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path} is no .ssp: it must be an archive with a SystemStructure.ssd")
    with zipfile.ZipFile(path) as archive:
        if "SystemStructure.ssd" not in archive.namelist():
            raise InputError(f"{path} has no SystemStructure.ssd: it must be an archive of SSP")
        nodes = list(ElementTree.fromstring(archive.read("SystemStructure.ssd")).iter())
    tags = {node.tag.rpartition("}")[2] for node in nodes}
    for tag in _UNREAD:
        if tag in tags:
            raise WiringError(f"{path} has a {tag}, which is not supported: a part of the system must do what it does")
    for node in nodes:
        if node.tag.endswith("}DefaultExperiment") and {"startTime", "stopTime"} - {*node.keys()}:
            raise WiringError(f"{path} has a DefaultExperiment without startTime or stopTime: give both")
    folder = code_folder("systems") / hashlib.sha256(Path(path).read_bytes()).hexdigest()[:12]
    folder.mkdir(parents=True, exist_ok=True)
    with ssp.SSP(path, mode="r") as archive, archive.system_structure as structure:
        system, parts = structure.system, {}
        for element in system.elements:
            if not getattr(element, "source", None):
                raise WiringError(
                    f"{getattr(element, 'name', 'an element')} is no FMU: a system inside a system is not read"
                )
            fmu = folder / Path(element.source).name
            store_file(fmu, (archive.unpacked_path / element.source).read_bytes())
            bindings = [*(element.parameter_bindings or ()), *(system.parameter_bindings or ())]
            texts = _start_values(
                archive.unpacked_path, bindings, element.name, own=len(element.parameter_bindings or ())
            )
            part = Part.from_fmu(element.name, fmu, {})
            values = {
                key: _convert(_as_number(text, part.ports.get(key), f"{element.name}.{key}"), part, key, unit, base)
                for key, (text, unit, base) in texts.items()
            }
            parts[element.name] = Part.from_fmu(element.name, fmu, values)
        connections = {
            End(c.end_element, c.end_connector): End(c.start_element, c.start_connector)
            for c in system.connections
            if c.start_element and c.end_element
        }
        twice = [c for c in system.connections if c.end_element]
        if len(connections) < len(twice):
            raise WiringError(
                f"{path}: an input has two connections, or a connection begins at the system's edge: each input must have one, "
                "from a part"
            )
        experiment = structure.default_experiment
    if experiment is not None and experiment.start_time:
        raise WiringError(f"{path} starts at {experiment.start_time} s: it must start at 0 s")
    stop_time = experiment.stop_time if experiment is not None else 1.0
    steps = [str(node[0].text) for node in nodes if node.get("type") == _STEP and len(node)]
    step = _as_number(steps[0], None, f"{path}: the communication step") if steps else 1e-3 * stop_time
    return Wiring(title=structure.name, parts=parts, connections=connections, stop_time=stop_time, step=step)


def _start_values(
    folder: Path, bindings: Iterable[Any], name: str, own: int
) -> dict[str, tuple[str, str, tuple[float, ...] | None]]:
    """Return the start values of the part ``name`` as texts, with unit and its definition in base units, by variable.

    The first ``own`` bindings belong to the part. The other bindings belong to the system; there the names of the part's
    variables begin with the name of the part. If a variable has several values, the first one is taken.
    """
    found: dict[str, tuple[str, str, tuple[float, ...] | None]] = {}
    for number, binding in enumerate(bindings):
        inline, prefix = binding.ssv is not None, binding.prefix or ""
        values = binding.ssv if inline else lazy("pyssp_standard.ssv").SSV(folder / binding.source, mode="r")
        mapped = _mapping(folder, binding)
        for parameter in values.parameters:
            for target in mapped.get(parameter["name"], (parameter["name"],) if not mapped else ()):
                whole = f"{prefix}{target}"
                if number >= own and not whole.startswith(f"{name}."):
                    continue
                given = parameter["type_value"].parameter
                unit = given.get("unit") or ""
                defined = values.units.units.get(unit) if values.units is not None else None
                base = None if defined is None or defined.base_unit is None else exponents(defined.base_unit)
                key = whole if number < own else whole.removeprefix(f"{name}.")
                found.setdefault(key, (given["value"], unit, base))
    return found


def _convert(value: float, part: Part, key: str, unit: str, base: tuple[float, ...] | None) -> float:
    """Return a start value in the unit of its variable; ``unit`` is the unit in which it is given, ``base`` its definition."""
    port = part.ports.get(key)
    own = None if port is None else part.base_unit(key)
    if port is None or own is None or unit in ("", port.unit):
        return value
    if base is None or len(own) != len(base) or own[:-2] != base[:-2]:
        raise WiringError(f"{part.name}.{key} starts with {value:g} {unit}: it must be in {port.unit or 'no unit'}")
    return float((value * base[-2] + base[-1] - own[-1]) / own[-2])


def _mapping(folder: Path, binding: Any) -> dict[str, tuple[str, ...]]:
    """Return the targets of each parameter in the ``.ssm`` of a binding; empty if the binding has no ``.ssm``."""
    mapping = binding.parameter_mapping
    if mapping is None:
        return {}
    ssm = lazy("pyssp_standard.ssm")
    inline = mapping.ssm is not None
    entries = (ssm.SSMElem.from_xml(mapping.ssm) if inline else ssm.SSM(folder / mapping.source, mode="r")).entries
    found: dict[str, tuple[str, ...]] = {}
    for entry in entries:
        found[entry.source] = (*found.get(entry.source, ()), entry.target)
    return found


def _as_number(text: str, port: Port | None, name: str) -> float:
    """Return a start value as a number: 0 or 1 for a Boolean, the value of the item for an enumeration."""
    names = {item: float(value) for value, item in port.items} if port is not None else {}
    names |= {"true": 1.0, "false": 0.0}
    if text in names:
        return names[text]
    try:
        return float(text)
    except ValueError:
        raise WiringError(f"{name} starts with {text!r}: it must be a number") from None
