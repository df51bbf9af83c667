"""Read model descriptions of FMI 2.0 and 3.0 in one form."""

from __future__ import annotations

from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

#: Names in FMI 2.0 of types and of parts of the model structure, by their names in FMI 3.0.
_TYPES = {"Float64": "Real", "Int32": "Integer"}
_PARTS = {"Output": "Outputs", "ContinuousStateDerivative": "Derivatives", "InitialUnknown": "InitialUnknowns"}


class Scalar(NamedTuple):
    """A variable; ``kind`` is its type as named in FMI 2.0, ``attributes`` are those of the variable and of its type."""

    name: str
    reference: int
    kind: str
    attributes: dict[str, str]


def root_of(xml: bytes | Element) -> Element:
    """Return the root of an XML document."""
    return xml if isinstance(xml, Element) else ElementTree.fromstring(xml)


def read_scalars(xml: bytes | Element) -> list[Scalar]:
    """Return the variables, in the order of the model description."""
    found = []
    for node in root_of(xml).find("ModelVariables"):
        if node.tag == "ScalarVariable":
            kind, attributes = node[0].tag, node.attrib | node[0].attrib
        else:
            start = node.find("Start")
            kind, given = _TYPES.get(node.tag, node.tag), {} if start is None else {"start": start.get("value")}
            attributes = node.attrib | given
        found.append(Scalar(node.get("name"), int(node.get("valueReference")), kind, attributes))
    return found


def read_unknowns(xml: bytes | Element, part: str) -> dict[str, set[str] | None]:
    """Return the names of the variables on which each unknown of a part of the model structure depends; None if on all.

    ``part`` is the name of the part's elements in FMI 3.0.
    """
    root = root_of(xml)
    scalars = read_scalars(root)
    structure = root.find("ModelStructure")
    if root.get("fmiVersion") == "2.0":
        key, names = "index", {n + 1: scalar.name for n, scalar in enumerate(scalars)}
        listed = structure.find(_PARTS[part]) if part in _PARTS else None
        nodes = [] if listed is None else list(listed)
    else:
        key, names = "valueReference", {scalar.reference: scalar.name for scalar in scalars}
        nodes = structure.findall(part)
    found: dict[str, set[str] | None] = {}
    for node in nodes:
        on = node.get("dependencies")
        name = names[int(node.get(key))]
        assert name not in found, f"{name} is listed twice in {part}"
        found[name] = None if on is None else {names[int(known)] for known in on.split()}
    return found
