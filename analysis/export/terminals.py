"""Write terminals and icons of FMUs of FMI 3.0; a terminal groups the variables that a tool connects by one line."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping
from xml.etree.ElementTree import Element, SubElement

from linkwork.mechanism import Mechanism

from .description import to_xml_bytes

#: Size of an icon (pixels), and of the drawing that terminals are placed in.
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
