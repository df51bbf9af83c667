"""Write systems as SSP archives (System Structure and Parameterization), with pyssp-standard.

An archive follows SSP 1.0, which supports FMI 2.0; with an FMI 3.0 part it follows SSP 2.0. This module adds the geometry of
the diagram, which the library does not write, and moves the units to where the schema requires them.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..files import output
from ..libraries import lazy
from .layout import boxes
from .wiring import BASE, REAL, Part, Wiring

ssp = lazy("pyssp_standard.ssp")
ssd = lazy("pyssp_standard.ssd")
common = lazy("pyssp_standard.common_content_ssc")
unit = lazy("pyssp_standard.unit")
etree = lazy("lxml.etree")
_NAMESPACE = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
#: Type of the annotation of an experiment that gives the communication step; the standard has no entry for this step.
STEP = "linkwork.communication-step"


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
    note = etree.SubElement(annotations, f"{common}Annotation", type=STEP)
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
