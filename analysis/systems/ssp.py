"""Systems as files of SSP 1.0 (System Structure and Parameterization), written and read with pyssp-standard.

What the library does not know is added here: the geometry of the diagram; and its units are put where the schema has them. It
reads no transformations of connections and no signal dictionaries: a file with one is refused.
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
from linkwork.variables import UNITS as MECHANICAL

from ..export.controllers import UNITS
from ..files import output
from ..libraries import lazy
from ..numerics.cache import code_folder, put
from .layout import boxes
from .wiring import End, Part, Wiring, WiringError

ssp = lazy("pyssp_standard.ssp")
ssd = lazy("pyssp_standard.ssd")
common = lazy("pyssp_standard.common_content_ssc")
unit = lazy("pyssp_standard.unit")
etree = lazy("lxml.etree")
_NAMESPACE = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
#: What the library would read past in silence.
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
                structure.name, structure.version = wiring.title or "system", "1.0"
                structure.system = ssd.System(None, "system")
                structure.system.elements = [
                    _component(part, sources[name], _ports(wiring, name)) for name, part in wiring.parts.items()
                ]
                for end, source in wiring.connections.items():
                    ends = {"start_element": source.part, "start_connector": source.port}
                    structure.add_connection(ssd.Connection(**ends, end_element=end.part, end_connector=end.port))
                structure.default_experiment = ssd.DefaultExperiment()
                structure.default_experiment.start_time, structure.default_experiment.stop_time = 0.0, wiring.stop_time
                for name in _units(wiring):
                    structure.units.add_unit(unit.Unit(name, unit.BaseUnit(_base(name))))
            _complete(archive.unpacked_path / "SystemStructure.ssd", wiring)
        shutil.copy(made, target)
    return final


def _source(parts: Mapping[str, Part], name: str) -> str:
    """Return the name of a part's FMU in the archive: that of its file, of two with one name that of the part."""
    file = parts[name].fmu
    rivals = {part.fmu for part in parts.values() if part.fmu.name == file.name}
    return file.name if len(rivals) == 1 else f"{name}.fmu"


def _ports(wiring: Wiring, name: str) -> dict[str, list[str]]:
    """Return the ports that are connected, by causality."""
    ends = {end.port for pair in wiring.connections.items() for end in pair if end.part == name}
    part = wiring.parts[name]
    return {kind: [port for port in part.named(kind) if port in ends] for kind in ("input", "output")}


def _units(wiring: Wiring) -> list[str]:
    found = [wiring.port(end).unit for pair in wiring.connections.items() for end in pair]
    return [name for name in dict.fromkeys(found) if name]


def _base(name: str) -> dict[str, int]:
    if name in UNITS:
        return UNITS[name]
    known = MECHANICAL.get(name)
    return {k: v for k in ("kg", "m", "s", "rad") if (v := getattr(known, k, 0))}


def _component(part: Part, source: str, ports: Mapping[str, Iterable[str]]) -> Any:
    """Return a part with its connectors and its start values."""
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


def _complete(path: Path, wiring: Wiring) -> None:
    """Add the places of connectors and parts, and bring the units before the experiment, where the schema has them."""
    tree = etree.parse(path)
    root, placed = tree.getroot(), boxes(wiring)
    found = {node.tag: node for node in root}
    if f"{_NAMESPACE}Units" in found:
        found[f"{_NAMESPACE}DefaultExperiment"].addprevious(found[f"{_NAMESPACE}Units"])
    for element in root.iter(f"{_NAMESPACE}Component"):
        box = placed[element.get("name")]
        for connector in element.iter(f"{_NAMESPACE}Connector"):
            name, across = connector.get("name"), 0.0 if connector.get("kind") == "input" else 1.0
            up = (box.height_of(name) - box.bottom) / (box.top - box.bottom)
            etree.SubElement(connector, f"{_NAMESPACE}ConnectorGeometry", x=repr(across), y=f"{up:.4f}")
        edges = {"x1": box.left, "y1": box.bottom, "x2": box.right, "y2": box.top}
        geometry = etree.Element(f"{_NAMESPACE}ElementGeometry", {key: repr(value) for key, value in edges.items()})
        element.find(f"{_NAMESPACE}Connectors").addnext(geometry)
    tree.write(path, xml_declaration=True, encoding="utf-8")


def _values(path: Path, part: Part) -> Path:
    """Write the start values of a part."""
    with lazy("pyssp_standard.ssv").SSV(path, mode="w") as values:
        for name, value in part.values.items():
            port = part.ports[name]
            whole = port.type in ("Integer", "Enumeration")
            values.add_parameter(
                name, port.type, value=int(value) if whole else value, unit=(port.unit or None) if not whole else None
            )
        for name in dict.fromkeys(part.ports[n].unit for n in part.values if part.ports[n].type == "Real"):
            if name:
                values.units.add_unit(unit.Unit(name, unit.BaseUnit(_base(name))))
    return path


def read_ssp(path: str | Path) -> Wiring:
    """Read a system from an ``.ssp``: FMUs of FMI 2.0 on one level, connections, start values of ``.ssv``, through ``.ssm``.

    Raises
    ------
    InputError
        If the file is no ``.ssp``.
    MissingLibraryError
        If pyssp-standard is not installed.
    WiringError, UnknownNameError
        If it has what is not read, or a connection cannot be right.
    """
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path} is no .ssp: it must be an archive with a SystemStructure.ssd")
    with zipfile.ZipFile(path) as archive:
        if "SystemStructure.ssd" not in archive.namelist():
            raise InputError(f"{path} has no SystemStructure.ssd: it must be an archive of SSP")
        tags = {
            node.tag.rpartition("}")[2] for node in ElementTree.fromstring(archive.read("SystemStructure.ssd")).iter()
        }
    for tag in _UNREAD:
        if tag in tags:
            raise WiringError(
                f"{path} has a {tag}: systems are read without; give the part the factor, or a part that has it"
            )
    folder = code_folder("systems") / hashlib.sha256(Path(path).read_bytes()).hexdigest()[:12]
    folder.mkdir(parents=True, exist_ok=True)
    with ssp.SSP(path, mode="r") as archive, archive.system_structure as structure:
        system, parts = structure.system, {}
        for element in system.elements:
            if not getattr(element, "source", None):
                raise WiringError(f"{getattr(element, 'name', 'an element')} is no FMU: a system is read on one level")
            fmu = folder / Path(element.source).name
            put(fmu, (archive.unpacked_path / element.source).read_bytes())
            bindings = [*(element.parameter_bindings or ()), *(system.parameter_bindings or ())]
            values = _bound(archive.unpacked_path, bindings, element.name, own=len(element.parameter_bindings or ()))
            parts[element.name] = Part.of(element.name, fmu, values)
        connections = {
            End(c.end_element, c.end_connector): End(c.start_element, c.start_connector)
            for c in system.connections
            if c.start_element and c.end_element
        }
        twice = [c for c in system.connections if c.end_element]
        if len(connections) < len(twice):
            raise WiringError(
                f"{path}: an input has two connections, or one begins at the system's edge: it must have one"
            )
        experiment = structure.default_experiment
    stop_time = float(experiment.stop_time) if experiment is not None else 1.0
    return Wiring(
        title=structure.name, parts=parts, connections=connections, stop_time=stop_time, step=1e-3 * stop_time
    )


def _bound(folder: Path, bindings: Iterable[Any], name: str, own: int) -> dict[str, float]:
    """Return the start values of a part: those of its own bindings, and those of the system's with its name before them."""
    found: dict[str, float] = {}
    for number, binding in enumerate(bindings):
        inline, prefix = binding.ssv is not None, binding.prefix or ""
        values = binding.ssv if inline else lazy("pyssp_standard.ssv").SSV(folder / binding.source, mode="r")
        mapped = _mapping(folder, binding)
        for parameter in values.parameters:
            for target in mapped.get(parameter["name"], (parameter["name"],) if not mapped else ()):
                whole = f"{prefix}{target}"
                if number >= own and not whole.startswith(f"{name}."):
                    continue
                text = parameter["type_value"].parameter["value"]
                key = whole if number < own else whole.removeprefix(f"{name}.")
                found.setdefault(key, _as_number(text, f"{name}.{key}"))
    return found


def _mapping(folder: Path, binding: Any) -> dict[str, tuple[str, ...]]:
    """Return the targets of each parameter in the binding's ``.ssm``; nothing where it has none."""
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


def _as_number(text: str, name: str) -> float:
    if text in ("true", "false"):
        return float(text == "true")
    try:
        return float(text)
    except ValueError:
        raise WiringError(f"{name} starts with {text!r}: it must be a number") from None
