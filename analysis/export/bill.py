"""Bills of materials of FMUs and of the wheel, in CycloneDX: what is inside, what made it, and the hash of every file."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import sys
import uuid
from collections.abc import Mapping, Sequence
from copy import copy
from email import message_from_bytes
from importlib import metadata
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import linkwork

#: Place in the archive, and its type.
BILL = "extra/org.cyclonedx/bom.json"
TYPE = "application/vnd.cyclonedx+json"
#: Programs that shape the bytes of an FMU: those of every kind, and those of native ones.
_MAKERS = {"python": ("pythonfmu", "fmpy"), "native": ("casadi", "ziglang", "fmpy")}


def with_bill(name: str, entries: Mapping[str, bytes], *, native: bool, fmi: int) -> dict[str, bytes]:
    """Return the files of an FMU with their bill of materials.

    Parameters
    ----------
    name : str
        Of the FMU's file, without its ending.
    entries : mapping
        Content by place in the archive.
    native : bool
    fmi : int
        Version of the standard.
    """
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
        text = "the library that runs Python, and its modules"
        inside.append(_component("pythonfmu", metadata.version("pythonfmu"), "MIT", text=text))
    return {**entries, BILL: _bill(name, "fmu", made, inside, entries)}


def add_bill_to_wheel(wheel: Path) -> None:
    """Add a bill of materials to a wheel, where PEP 770 has it: the libraries that it asks for, and the hash of every file.

    Parameters
    ----------
    wheel : Path
        The file, which is replaced. A wheel that has a bill stays as it is.
    """
    with ZipFile(wheel) as archive:
        entries = {entry: archive.read(entry) for entry in archive.infolist()}
    files = {entry.filename: content for entry, content in entries.items()}
    folder = next(name for name in files if name.endswith(".dist-info/METADATA")).partition("/")[0]
    place, record = f"{folder}/sboms/linkwork.cdx.json", f"{folder}/RECORD"
    if place in files:
        return
    needs = [
        need for need in message_from_bytes(files[f"{folder}/METADATA"]).get_all("Requires-Dist", []) if ";" not in need
    ]
    inside = []
    for need in sorted(needs):
        library = re.split(r"[^\w.-]", need, maxsplit=1)[0]
        inside.append(_component(library, "", text=f"needed, not inside: {need}"))
    made = [_component("hatchling", metadata.version("hatchling"))]
    listed = {name: content for name, content in files.items() if name != record}
    bill = _bill("linkwork", "wheel", made, inside, listed)
    digest = base64.urlsafe_b64encode(hashlib.sha256(bill).digest()).rstrip(b"=").decode()
    line = f"{place},sha256={digest},{len(bill)}\n".encode()
    whole = wheel.with_suffix(".part")
    with ZipFile(whole, "w", ZIP_DEFLATED) as archive:
        for entry, content in entries.items():
            if entry.filename == record:
                dated = copy(entry)
                dated.filename = place
                archive.writestr(dated, bill)
                content = line + content
            archive.writestr(entry, content)
    whole.replace(wheel)


def _bill(
    name: str,
    reference: str,
    made: Sequence[dict[str, Any]],
    inside: Sequence[dict[str, Any]],
    entries: Mapping[str, bytes],
) -> bytes:
    """Return the text of a bill: programs that made it, components, and files by their places."""
    listed = [
        {
            "type": "file",
            "bom-ref": place,
            "name": place,
            "hashes": [{"alg": "SHA-256", "content": _digest(entries[place])}],
        }
        for place in sorted(entries)
    ]
    content: dict[str, Any] = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "tools": {"components": made},
            "component": {
                "type": "library",
                "bom-ref": reference,
                "name": name,
                "version": linkwork.__version__,
                "licenses": [{"license": {"id": "MIT"}}],
            },
        },
        "components": [*({"bom-ref": c["name"], **c} for c in inside), *listed],
        "dependencies": [{"ref": reference, "dependsOn": [c["name"] for c in inside]}],
    }
    # the same content has the same number
    number = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(content, sort_keys=True))
    content = {
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "serialNumber": f"urn:uuid:{number}",
        **content,
    }
    return f"{json.dumps(content, indent=1)}\n".encode()


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _component(name: str, version: str, licence: str = "", *, text: str = "", index: str = "pypi") -> dict[str, Any]:
    """Return a component; ``index`` is where its package is found."""
    component: dict[str, Any] = {"type": "library", "name": name, **({"version": version} if version else {})}
    if text:
        component["description"] = text
    if licence:
        component["licenses"] = [{"license": {"id": licence}}]
    if index:
        component["purl"] = f"pkg:{index}/{name}" + (f"@{version}" if version else "")
    return component


if __name__ == "__main__":
    for file in sys.argv[1:]:
        add_bill_to_wheel(Path(file))
