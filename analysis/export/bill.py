"""Bill of materials of an FMU, in CycloneDX: components in the FMU, programs that made it, and the hash of every file."""

from __future__ import annotations

import hashlib
import json
import uuid
from collections.abc import Mapping
from importlib import metadata
from typing import Any

import linkwork

#: Path of the bill in the archive, and its media type.
BILL = "extra/org.cyclonedx/bom.json"
TYPE = "application/vnd.cyclonedx+json"
#: Programs that determine the bytes of an FMU, by its kind.
_MAKERS = {"python": ("pythonfmu", "ziglang", "fmpy"), "native": ("casadi", "ziglang", "fmpy")}


def add_bill(name: str, entries: Mapping[str, bytes], *, native: bool, fmi: int) -> dict[str, bytes]:
    """Add the bill of materials to the files of an FMU; return all files by path.

    Parameters
    ----------
    name : str
        Name of the FMU's file, without its ending.
    entries : mapping
        Content of the files by path in the archive.
    native : bool
        Whether the FMU is native; else it is a Python FMU.
    fmi : int
        Major version of FMI.
    """
    files = {place: hashlib.sha256(content).hexdigest() for place, content in sorted(entries.items())}
    made = [_component("linkwork", linkwork.__version__, "MIT", index="")]
    made += [_component(tool, metadata.version(tool)) for tool in _MAKERS["native" if native else "python"]]
    inside = [_component("linkwork", linkwork.__version__, "MIT", text="the equations of the mechanism", index="")]
    if native:
        headers = f"headers of FMI {fmi}.0 of the Modelica Association"
        runtime = "support code of the compiler, and for Windows the start-up code of mingw-w64, inside the libraries"
        inside += [
            _component("fmi-headers", f"{fmi}.0", "BSD-2-Clause", text=headers, index=""),
            _component("zig", metadata.version("ziglang"), "MIT", text=runtime, index=""),
        ]
    else:
        text = "the library that runs Python, behind the guard, and its modules"
        inside.append(_component("pythonfmu", metadata.version("pythonfmu"), "MIT", text=text))
    listed = [
        {"type": "file", "bom-ref": place, "name": place, "hashes": [{"alg": "SHA-256", "content": digest}]}
        for place, digest in files.items()
    ]
    content: dict[str, Any] = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "tools": {"components": made},
            "component": {
                "type": "library",
                "bom-ref": "fmu",
                "name": name,
                "version": linkwork.__version__,
                "licenses": [{"license": {"id": "MIT"}}],
            },
        },
        "components": [*({"bom-ref": c["name"], **c} for c in inside), *listed],
        "dependencies": [{"ref": "fmu", "dependsOn": [c["name"] for c in inside]}],
    }
    # the same content has the same serial number
    number = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(content, sort_keys=True))
    content = {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "serialNumber": f"urn:uuid:{number}",
        **content,
    }
    return {**entries, BILL: f"{json.dumps(content, indent=1)}\n".encode()}


def _component(name: str, version: str, licence: str = "", *, text: str = "", index: str = "pypi") -> dict[str, Any]:
    """Return a component of the bill; ``index`` is the registry of the component's package, empty if there is none."""
    component: dict[str, Any] = {"type": "library", "name": name, "version": version}
    if text:
        component["description"] = text
    if licence:
        component["licenses"] = [{"license": {"id": licence}}]
    if index:
        component["purl"] = f"pkg:{index}/{name}@{version}"
    return component
