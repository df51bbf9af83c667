"""Write the description files of FMUs of every kind from the mechanism's table of variables.

The files are ``modelDescription.xml`` and, for FMI 3.0, ``buildDescription.xml``.
"""

from __future__ import annotations

import os
import struct
import uuid
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import linkwork
from linkwork.mechanism import Mechanism
from linkwork.plant import Plant
from linkwork.variables import UNITS, Variable

from ..numerics import symbolic
from ..run import expressions
from .interface import Entry, derivatives, indicator, interface, states

#: Namespace of the GUIDs, so that an interface with the same variables always has the same GUID.
GUID_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_URL, "urn:linkwork:fmi")

AUTHOR = "The Linkwork developers"

#: Categories of the log.
LOG_CATEGORIES = ("Warning", "Discard", "Error", "Fatal")

Attributes = Mapping[str, str]
References = frozenset[int]


class Kind(NamedTuple):
    """A kind of FMU.

    Attributes
    ----------
    fmi : int
        Major version of FMI.
    suffix : str
        End of the model identifier, after the name of the mechanism's FMU. The file name has hyphens in place of underscores.
    tool : str
        Program that generates the FMU.
    interfaces : mapping
        Interface types, each with its capability flags.
    """

    fmi: int
    suffix: str
    tool: str
    interfaces: Mapping[str, Attributes]

    @property
    def native(self) -> bool:
        """Return whether FMUs of this kind have model exchange, and with it all variables of `interface`."""
        return "ModelExchange" in self.interfaces

    def identifier(self, mechanism: Mechanism) -> str:
        """Return the model identifier."""
        return f"{mechanism.fmu}{self.suffix}"

    def file_name(self, mechanism: Mechanism) -> str:
        """Return the file name of the FMU."""
        return f"{self.identifier(mechanism).replace('_', '-')}.fmu"


def _true(*flags: str) -> dict[str, str]:
    return dict.fromkeys(flags, "true")


_STEPS = {"needsExecutionTool": "false"} | _true("canHandleVariableCommunicationStepSize")
_STATE_2 = {"canBeInstantiatedOnlyOncePerProcess": "false"} | _true("canGetAndSetFMUstate", "canSerializeFMUstate")
_NATIVE_2 = {"needsExecutionTool": "false"} | _STATE_2 | _true("providesDirectionalDerivative")
_NATIVE_3 = {"needsExecutionTool": "false", "canBeInstantiatedOnlyOncePerProcess": "false"} | _true(
    "canGetAndSetFMUState", "canSerializeFMUState", "providesDirectionalDerivatives", "providesAdjointDerivatives"
)

_EARLY_3 = _true("providesIntermediateUpdate", "mightReturnEarlyFromDoStep", "canReturnEarlyAfterIntermediateUpdate")
_SLOPES, _NO_DISCRETE_3 = {"maxOutputDerivativeOrder": "1"}, {"providesEvaluateDiscreteStates": "false"}

_PYTHON = _STEPS | {"canInterpolateInputs": "false"} | _STATE_2 | _true("canNotUseMemoryManagementFunctions")
_FMI2 = {
    "ModelExchange": _NATIVE_2 | _true("completedIntegratorStepNotNeeded"),
    "CoSimulation": _NATIVE_2 | _STEPS | _true("canInterpolateInputs") | _SLOPES,
}
_FMI3 = {
    "ModelExchange": _NATIVE_3 | {"needsCompletedIntegratorStep": "false"} | _NO_DISCRETE_3,
    "CoSimulation": _NATIVE_3 | _STEPS | _EARLY_3 | _SLOPES | {"hasEventMode": "false"} | _NO_DISCRETE_3,
}
PYTHON = Kind(2, "", f"PythonFMU {version('pythonfmu')}", {"CoSimulation": _PYTHON})
NATIVE = Kind(2, "_native", f"Linkwork {linkwork.__version__}", _FMI2)
NATIVE_FMI3 = Kind(3, "_native_fmi3", f"Linkwork {linkwork.__version__}", _FMI3)
KINDS = {"python": PYTHON, "native": NATIVE, "native-fmi3": NATIVE_FMI3}


def token(mechanism: Mechanism, kind: Kind) -> str:
    """Return the GUID or instantiation token of an FMU.

    The result depends only on the kind and on the name, causality, type, unit, start value and bounds of every variable.
    """
    lines = [
        "|".join((v.name, v.causality, v.kind, v.unit, repr(v.start), repr(v.minimum), repr(v.maximum)))
        for v in (entry.variable for entry in _entries(mechanism, kind))
    ]
    return str(uuid.uuid5(GUID_NAMESPACE, "\n".join([kind.identifier(mechanism), *lines])))


def description(mechanism: Mechanism, kind: Kind, sources: Sequence[str] = ()) -> bytes:
    """Return ``modelDescription.xml`` of an FMU.

    The same mechanism gives the same bytes; the date of generation is written only if ``SOURCE_DATE_EPOCH`` sets it.
    ``sources`` are the files to compile, by their paths below ``sources/`` of the archive; FMI 2.0 lists them here, FMI 3.0 in
    `build_description`.
    """
    entries = _entries(mechanism, kind)
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{kind.fmi}.0",
            "modelName": mechanism.fmu,
            "guid" if kind.fmi == 2 else "instantiationToken": token(mechanism, kind),
            "generationTool": kind.tool,
            **_date(),
            "variableNamingConvention": "structured",
            "description": mechanism.description,
            "author": AUTHOR,
            "license": "MIT",
            "version": linkwork.__version__,
            "copyright": f"Copyright (c) 2026 {AUTHOR}",
        },
    )
    if kind.native and kind.fmi == 2:
        root.set("numberOfEventIndicators", "1")
    for name, flags in kind.interfaces.items():
        node = SubElement(root, name, {"modelIdentifier": kind.identifier(mechanism), **flags})
        if sources and kind.fmi == 2:
            listed = SubElement(node, "SourceFiles")
            for source in sources:
                SubElement(listed, "File", {"name": source})
    root.append(_unit_definitions(entries))
    categories = SubElement(root, "LogCategories")
    for status in LOG_CATEGORIES:
        text = f"Log messages with fmi{kind.fmi}{status} status."
        SubElement(categories, "Category", {"name": f"logStatus{status}", "description": text})
    SubElement(categories, "Category", {"name": "logAll", "description": "Log all messages."})
    names = ("startTime", "stopTime", "stepSize", "tolerance")
    SubElement(root, "DefaultExperiment", dict(zip(names, map(repr, mechanism.experiment))))
    root.append(_variables(mechanism, kind, entries))
    root.append(_structure(mechanism, kind, entries))
    return to_xml_bytes(root)


def _entries(mechanism: Mechanism, kind: Kind) -> tuple[Entry, ...]:
    entries = interface(mechanism)
    return entries if kind.native else entries[: len(mechanism.variables)]


def _date() -> dict[str, str]:
    """Return the date of generation as an attribute if ``SOURCE_DATE_EPOCH`` sets it; else none, so that builds are equal."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return {}
    return {"generationDateAndTime": datetime.fromtimestamp(int(epoch), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")}


def layered_standard(tag: str, name: str, version: str, text: str) -> Element:
    """Return the root element of the manifest of a layered standard."""
    stated = {"name": name, "version": version, "description": text}
    space = {"xmlns:fmi-ls": "http://fmi-standard.org/fmi-ls-manifest"}
    return Element(tag, space | {f"fmi-ls:fmi-ls-{key}": value for key, value in stated.items()})


def to_xml_bytes(root: Element) -> bytes:
    """Return the content of an XML file with this root element."""
    indent(root, "\t")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'.encode()


def _unit_definitions(entries: Iterable[Entry]) -> Element:
    definitions = Element("UnitDefinitions")
    for name in dict.fromkeys(entry.variable.unit for entry in entries if entry.variable.unit):
        unit = UNITS[name]
        node = SubElement(definitions, "Unit", {"name": name})
        powers = {"kg": unit.kg, "m": unit.m, "s": unit.s, "rad": unit.rad}
        SubElement(node, "BaseUnit", {base: str(power) for base, power in powers.items() if power})
        for display, factor in unit.displays:
            SubElement(node, "DisplayUnit", {"name": display, "factor": repr(factor)})
    return definitions


#: Names of the types of variables in each version of FMI. Modes are integers, not enumerations: of the masters in the tests,
#: libcosim, ecos, CoFMUPy and PathSim can set no enumeration.
_TYPES = {
    2: {"Real": "Real", "Integer": "Integer", "String": "String"},
    3: {"Real": "Float64", "Integer": "Int32", "String": "String"},
}
# approx, not calculated: otherwise an output could not have the start value that people look for in the XML
_INITIAL = {"parameter": "exact", "output": "approx", "local": "calculated"}


def _variables(mechanism: Mechanism, kind: Kind, entries: Iterable[Entry]) -> Element:
    plant = start_plant(mechanism)
    starts = dict(zip(mechanism.output_names, plant.outputs()))
    scale = dict(zip(states(mechanism), mechanism.error_scale(plant.parameters, plant.state))) if kind.native else {}
    reinitialised = _states_that_jump(mechanism) if kind.native else ()
    listed = Element("ModelVariables")
    for entry in entries:
        variable = entry.variable
        attributes = {
            "name": variable.name,
            "valueReference": str(entry.reference),
            "description": variable.description,
            "causality": variable.causality,
            "variability": _variability(variable),
        }
        if variable.causality in _INITIAL:
            attributes["initial"] = _INITIAL[variable.causality]
        value = _value(variable, starts.get(variable.name, variable.start))
        if entry.derivative_of in scale:  # only for states: OMSimulator would take any other variable for a state, too
            value["derivative"] = _index_or_reference(kind, entry.derivative_of)
        nominal = scale.get(entry.reference, variable.nominal)
        if nominal is not None:
            value["nominal"] = repr(nominal)
        if entry.reference in reinitialised:
            value["reinit"] = "true"
        tag = _TYPES[kind.fmi][variable.kind]
        if kind.fmi == 2:
            SubElement(SubElement(listed, "ScalarVariable", attributes), tag, value)
            continue
        if attributes["variability"] == "continuous" and variable.causality != "independent":
            attributes["intermediateUpdate"] = "true"
        start = value.pop("start", None) if tag == "String" else None
        node = SubElement(listed, tag, attributes | value)
        if start is not None:
            SubElement(node, "Start", {"value": start})
    return listed


def _variability(variable: Variable) -> str:
    if variable.causality == "parameter":
        return "tunable" if variable.tunable else "fixed"
    return "continuous" if variable.kind == "Real" else "discrete"


def _value(variable: Variable, start: float | int | str) -> dict[str, str]:
    """Return the attributes of a variable that belong to its type."""
    kind = {"Real": float, "Integer": int, "String": str}[variable.kind]

    def text(value: Any) -> str:
        # 17 digits, so that the same number is read back
        return value if kind is str else repr(kind(value))

    value = {}
    if variable.causality not in ("local", "independent"):
        value["start"] = text(start)
    if variable.unit:
        value["unit"] = variable.unit
    if variable.display:
        value["displayUnit"] = variable.display
    for name, bound in (("min", variable.minimum), ("max", variable.maximum)):
        if bound is not None:
            value[name] = text(bound)
    return value


def start_plant(mechanism: Mechanism) -> Plant:
    """Return the plant of a mechanism at its start, with the start values of all parameters and inputs."""
    values = {v.name: v.start for v in mechanism.variables}
    return Plant.from_values(mechanism, values, time=mechanism.experiment[0])


# Structure


def _index_or_reference(kind: Kind, reference: int) -> str:
    """Return the number by which the model structure refers to a variable: index in FMI 2.0, value reference in FMI 3.0."""
    return str(reference + 1 if kind.fmi == 2 else reference)


def _structure(mechanism: Mechanism, kind: Kind, entries: Sequence[Entry]) -> Element:
    reference = {entry.variable.name: entry.reference for entry in entries}
    outputs = [entry.reference for entry in entries if entry.role == "output"]
    # the equations tell more than the table, which has one word for all outputs of a described linkage
    depends = traced_dependencies(mechanism) if kind.native else _declared_dependencies(mechanism)
    groups: list[tuple[str, Sequence[int]]] = [("Output", outputs)]
    initial = outputs
    if kind.native:
        groups.append(("ContinuousStateDerivative" if kind.fmi == 3 else "Derivative", derivatives(mechanism)))
        initial = sorted({*outputs, *states(mechanism), *derivatives(mechanism)})
    at_start: dict[str, Iterable[int] | None] = {
        "none": (),
        "position": sorted(reference[name] for name in mechanism.position_parameters),
    }
    structure = Element("ModelStructure")

    def add(group: str, references: Iterable[int], known: Mapping[int, Iterable[int] | None]) -> None:
        # FMI 2.0 has each group in an element of its own
        parent = structure if kind.fmi == 3 else SubElement(structure, f"{group}s")
        for number in references:
            name = "valueReference" if kind.fmi == 3 else "index"
            node = SubElement(parent, group if kind.fmi == 3 else "Unknown", {name: _index_or_reference(kind, number)})
            on = known[number]
            if on is not None:
                node.set("dependencies", " ".join(_index_or_reference(kind, each) for each in sorted(on)))

    for group, references in groups:
        add(group, references, depends)
    add("InitialUnknown", initial, {n: at_start.get(entries[n].variable.level) for n in initial})
    if kind.native and kind.fmi == 3:
        add("EventIndicator", [indicator(mechanism)], depends)
    return structure


def _declared_dependencies(mechanism: Mechanism) -> dict[int, References]:
    """Return the inputs on which each output depends according to the mechanism's table; all are value references."""
    reference = {entry.variable.name: entry.reference for entry in interface(mechanism)}
    inputs = {
        "state": frozenset[int](),
        "speed": frozenset(reference[c.name] for c in mechanism.channels if c.kind == "command"),
        "all": frozenset(reference[name] for name in mechanism.input_names),
    }
    return {reference[v.name]: inputs[v.depends] for v in mechanism.variables if v.causality == "output"}


@cache
def traced_dependencies(mechanism: Mechanism) -> dict[int, References]:
    """Return the states and inputs on which each output, derivative and event indicator depends; all are value references.

    The dependencies follow from the equations: direct ones, and those through the jump of a commanded rate.
    """
    casadi = symbolic.library()
    traced = expressions(mechanism, bool(mechanism.switch))
    x, u = traced.symbols.x, traced.symbols.u
    reference = {entry.variable.name: entry.reference for entry in interface(mechanism)}
    known = [(x, states(mechanism)), (u, [reference[name] for name in mechanism.input_names])]
    found: dict[int, set[int]] = {}
    for column, unknowns in (
        (traced.outputs, [reference[name] for name in mechanism.output_names]),
        (traced.derivative, derivatives(mechanism)),
        (traced.clearance, [indicator(mechanism)]),
    ):
        for on, references in known:
            for expression in (column, casadi.substitute(column, x, traced.jump)):
                pattern = casadi.jacobian_sparsity(expression, on)
                for row, col in zip(*pattern.get_triplet()):
                    found.setdefault(unknowns[row], set()).add(references[col])
        for unknown in unknowns:
            found.setdefault(unknown, set())
    return {unknown: frozenset(on) for unknown, on in found.items()}


def _states_that_jump(mechanism: Mechanism) -> tuple[int, ...]:
    """Return the value references of the states that a jump of a commanded rate changes."""
    casadi = symbolic.library()
    traced = expressions(mechanism)
    before, after = casadi.vertsplit(traced.symbols.x), casadi.vertsplit(traced.jump)
    return tuple(state for state, old, new in zip(states(mechanism), before, after) if not casadi.is_equal(old, new))


# FMI 3.0


def build_description(identifier: str, sources: Sequence[str]) -> bytes:
    """Return ``buildDescription.xml``: the files below ``sources/`` are to be compiled as C11 without options."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier})
    files = SubElement(configuration, "SourceFileSet", {"language": "C11"})
    for source in sources:
        SubElement(files, "SourceFile", {"name": source})
    return to_xml_bytes(root)


# Terminals and icons of FMI 3.0; a terminal groups the variables that a tool connects by one line


#: Width of an icon (pixels), and half the width of the drawing in which terminals are placed.
_PIXELS, _SIZE = 32, 100
#: Icons of terminals (a shaft, a slider, a loaded point): whether the point (x, y) in [-1, 1] is black.
_ICONS: Mapping[str, Callable[[float, float], bool]] = {
    "rotational": lambda x, y: x * x + y * y < 1.0,
    "translational": lambda x, y: max(abs(x), abs(y)) < 0.9,
    "planar": lambda x, y: min(abs(x), abs(y)) < 0.2,
}


def terminal_files(mechanism: Mechanism) -> dict[str, bytes]:
    """Return ``terminalsAndIcons.xml`` and its icons, by their paths in the archive."""
    files = {"terminalsAndIcons.xml": terminals(mechanism)}
    files |= {f"{kind}.png": _icon(inside) for kind, inside in _ICONS.items()}
    return {f"terminalsAndIcons/{name}": content for name, content in files.items()}


def terminals(mechanism: Mechanism) -> bytes:
    """Return ``terminalsAndIcons.xml`` with the terminals of shafts, sliders and loaded points.

    Each degree of freedom has a terminal with coordinate, rate, acceleration, inputs, and the torque or force applied. Each
    loaded point has a terminal with its load inputs, its displacement and the angle of its body. Forces and torques are
    inflows; all other variables are signals.
    """
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    picture = SubElement(root, "GraphicalRepresentation")
    extent = dict(zip(("x1", "y1", "x2", "y2"), map(str, (-_SIZE, -_SIZE, _SIZE, _SIZE))))
    SubElement(picture, "CoordinateSystem", extent | {"suggestedScalingFactorTo_mm": "0.1"})
    SubElement(picture, "Icon", extent)
    listed = SubElement(root, "Terminals")
    forces = {channel.name for channel in mechanism.channels if channel.kind == "force"}
    units = {v.name: v.unit for v in mechanism.variables}
    found = _terminals(mechanism)
    for number, (name, (text, members)) in enumerate(found.items()):
        lengths = [v for v in members.values() if units[v] == "m"]
        kind = "planar" if len(lengths) > 1 else "translational" if lengths else "rotational"
        terminal = {"name": name, "matchingRule": "bus", "terminalKind": f"linkwork.{kind}", "description": text}
        node = SubElement(listed, "Terminal", terminal)
        for member, variable in members.items():
            flow = "inflow" if variable in forces else "signal"
            places = {"variableName": variable, "memberName": member, "variableKind": flow}
            SubElement(node, "TerminalMemberVariable", places)
        # one below the other at the left edge
        top = _SIZE - round(2 * _SIZE * (number + 0.5) / len(found))
        place = dict(zip(("x1", "y1", "x2", "y2"), map(str, (-_SIZE - 10, top - 10, -_SIZE + 10, top + 10))))
        colour = {"defaultConnectionColor": "0 0 0", "defaultConnectionStrokeSize": "1", "iconBaseName": kind}
        SubElement(node, "TerminalGraphicalRepresentation", colour | place)
    return to_xml_bytes(root)


def _terminals(mechanism: Mechanism) -> dict[str, tuple[str, dict[str, str]]]:
    """Return by name each terminal's description, and the terminal's variables by the name that they have in the terminal."""
    rate = {v.rate_of: v.name for v in mechanism.variables if v.rate_of}
    found: dict[str, tuple[str, dict[str, str]]] = {}

    def leaf(name: str) -> str:
        return name.rpartition(".")[2]

    def table(name: str) -> str:
        return name.rpartition(".")[0]

    def motion(name: str) -> dict[str, str]:
        return {leaf(name): name} | (motion(rate[name]) if name in rate else {})

    for number, freedom in enumerate(mechanism.freedoms):
        members = motion(freedom.coordinate)
        channels = [channel for channel in mechanism.channels if channel.freedom == number]
        for channel in channels:
            members[leaf(channel.name) if channel.kind == "force" else f"commanded_{leaf(channel.name)}"] = channel.name
        applied = tuple({f"{table(channel.name)}.applied_" for channel in channels})
        members |= {leaf(name): name for name in mechanism.output_names if name.startswith(applied)}
        found[table(freedom.coordinate)] = (f"Motion of {freedom.coordinate} and what drives it", members)
    for channel in mechanism.channels:
        if channel.freedom < 0:
            _, members = found.setdefault(table(channel.name), ("Load, and motion of the point that it acts on", {}))
            members[leaf(channel.name)] = channel.name
            members |= motion(channel.displacement) if channel.displacement else {}
            # angle of the body on which the point lies, if the body's name is in the name of the displacement
            angle = f"{table(table(channel.displacement))}.angle"
            members |= {"angle": angle} if angle in mechanism.output_names else {}
    return found


def _icon(inside: Callable[[float, float], bool]) -> bytes:
    """Return a PNG image (ISO/IEC 15948) that is black at the points ``inside`` and transparent elsewhere."""
    places = [(2 * n + 1) / _PIXELS - 1.0 for n in range(_PIXELS)]
    rows = b"".join(b"\0" + b"".join(b"\0\xff" if inside(x, y) else b"\0\0" for x in places) for y in places)

    def chunk(name: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))

    header = struct.pack(">IIBBBBB", _PIXELS, _PIXELS, 8, 4, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
