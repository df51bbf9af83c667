"""Build the binaries of an FMU of Linkwork again from the sources in the FMU, and compare them with the binaries in the FMU."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from importlib import metadata, resources
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from zipfile import ZipFile

from ..files import check_fmu, first_line
from .archive import BuildError
from .bill import BILL
from .description import NATIVE, NATIVE_FMI3
from .native_fmu import EVERYWHERE, compile_binaries
from .python_fmu import PYTHONFMU, compile_guard
from .python_fmu import SOURCE as GUARD

_FAT, _X86, _ARM = b"\xca\xfe\xba\xbe", b"\x07\x00\x00\x01", b"\x0c\x00\x00\x01"


class Comparison(NamedTuple):
    """Result of one comparison: the files compared, whether they are the same, and a text on differences or versions."""

    what: str
    same: bool
    text: str


def rebuild(fmu: Path | str) -> Iterator[Comparison]:
    """Compare an FMU with its bill of materials, and its libraries with libraries compiled here from its sources.

    The libraries of a native FMU and the guard of a Python FMU are compiled again. PythonFMU's libraries and modules in a
    Python FMU are compared with the installed package. All bytes are the same if the programs installed here have the
    versions named in the bill.

    Yields
    ------
    Comparison

    Raises
    ------
    BuildError
        If the FMU has no bill of materials of Linkwork, or its sources do not compile.
    InputError
        If the file is not an FMU.
    """
    check_fmu(fmu)
    with ZipFile(fmu) as archive:
        if BILL not in archive.namelist():
            raise BuildError(f"{fmu} has no {BILL}: only FMUs of Linkwork that carry it can be built again")
        try:
            files = {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
            bill = json.loads(files[BILL])
            stated = {c["name"]: c["hashes"][0]["content"] for c in bill["components"] if c["type"] == "file"}
            tools = {c["name"]: c["version"] for c in bill["metadata"]["tools"]["components"]}
        except Exception as error:  # zipfile and zlib raise exceptions of their own
            raise BuildError(f"{fmu}: {BILL} cannot be read: {first_line(error)}") from error
    found = {name: hashlib.sha256(content).hexdigest() for name, content in files.items() if name != BILL}
    wrong = sorted(name for name in {*stated, *found} if stated.get(name) != found.get(name))
    text = "SHA-256 of every file" if not wrong else f"differing, missing or not listed: {', '.join(wrong[:5])}"
    yield Comparison(f"{len(found)} files, with the bill of materials", not wrong, text)
    yield from _compare_libraries(files, tools) if "casadi" in tools else _compare_pythonfmu(files, tools)


def _versions(tools: dict[str, str], name: str) -> str:
    """Return a text on the version of a program that made the FMU, and on the version installed here."""
    here = metadata.version(name)
    return f"{name} {here}" if tools.get(name) == here else f"made by {name} {tools.get(name)}, here is {here}"


def _compare_libraries(files: dict[str, bytes], tools: dict[str, str]) -> Iterator[Comparison]:
    """Compile the sources for every platform of the FMU's binaries and compare the results with these binaries."""
    root = ElementTree.fromstring(files["modelDescription.xml"])
    kind = NATIVE_FMI3 if root.get("fmiVersion", "").startswith("3") else NATIVE
    part = root.find("CoSimulation")
    identifier = "" if part is None else part.get("modelIdentifier", "")
    sources = {
        name.removeprefix("sources/"): content.decode()
        for name, content in files.items()
        if name.startswith("sources/") and name.endswith((".c", ".h"))
    }
    for place in sorted(name for name in files if name.startswith("binaries/")):
        wanted = [
            name
            for name, platform in EVERYWHERE.items()
            if place.split("/")[1] == (platform.folder_fmi2 if kind.fmi == 2 else platform.folder_fmi3)
        ]
        head = files[place][:8]
        if len(wanted) > 1 and head[:4] != _FAT:  # only one of the two architectures of macOS
            wanted = [name for name in wanted if head[4:] == (_ARM if name.startswith("aarch64") else _X86)]
        if not wanted:
            yield Comparison(place, False, "is for none of the platforms that Linkwork compiles for")
            continue
        made = compile_binaries(identifier, kind, sources, wanted, kept=False)
        yield Comparison(place, made.get(place) == files[place], _versions(tools, "ziglang"))


def _compare_pythonfmu(files: dict[str, bytes], tools: dict[str, str]) -> Iterator[Comparison]:
    """Compare PythonFMU's libraries and modules with the installed package, and the guard with a guard compiled again."""
    package: Any = resources.files("pythonfmu")
    for folder, name in PYTHONFMU.items():
        content = (package / "resources" / "binaries" / folder / name).read_bytes()
        place = f"binaries/{folder}/{name}"
        yield Comparison(place, files.get(place) == content, _versions(tools, "pythonfmu"))
    guards = compile_guard(files[GUARD], kept=False) if GUARD in files else {}
    for place in (p for p in files if p.startswith("binaries/") and Path(p).name not in PYTHONFMU.values()):
        yield Comparison(place, files[place] == guards.get(place.split("/")[1]), _versions(tools, "ziglang"))
    prefix = "resources/pythonfmu/"
    modules = {place.removeprefix(prefix): text for place, text in files.items() if place.startswith(prefix)}
    same = all((package / name).is_file() and (package / name).read_bytes() == text for name, text in modules.items())
    yield Comparison(prefix, same, _versions(tools, "pythonfmu"))
