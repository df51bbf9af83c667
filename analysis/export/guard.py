"""The guard of the Python FMUs: a library in C before PythonFMU's, which mends what no slave can (``fmu_src/guard.c``)."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

from .native_fmu import HEADERS, OPTIONS, PLATFORMS, compile_library

#: Place of the guard's source in the archive.
SOURCE = "sources/guard.c"
#: Name of PythonFMU's library by the folder of its platform.
PYTHONFMU = {"linux64": "libpythonfmu-export.so", "win64": "pythonfmu-export.dll"}

#: Options beside `OPTIONS`. For Windows the guard calls the system alone: the C library would take a minute to compile.
_OPTIONS = {
    "linux64": ("-Os", "-ldl"),
    "win64": ("-Os", "-ffreestanding", "-nostdlib", "-lkernel32", "-Wl,--entry,DllMain"),
}


def add_guard(entries: Mapping[str, bytes], model: str, source: bytes) -> dict[str, bytes]:
    """Give PythonFMU's libraries in the files of an FMU their own names, and their places to the guard.

    The source of the guard is added, and the GUID, which the guard compares with the master's.

    Parameters
    ----------
    entries : mapping
        Content of the files by path in the archive, as PythonFMU's builder makes it.
    model : str
        Model identifier of the FMU.
    source : bytes
        The guard's C.

    Raises
    ------
    BuildError
        If the source does not compile.
    """
    guid = ElementTree.fromstring(entries["modelDescription.xml"]).attrib["guid"]
    found = {**entries, SOURCE: source, "resources/guid.txt": guid.encode()}
    for folder, library in compile_guard(source).items():
        place = f"binaries/{folder}/{model}.{PYTHONFMU[folder].rpartition('.')[2]}"
        found[f"binaries/{folder}/{PYTHONFMU[folder]}"] = found.pop(place)
        found[place] = library
    return found


@cache
def compile_guard(source: bytes) -> dict[str, bytes]:
    """Compile the guard for every platform of PythonFMU and return the libraries by folder."""
    headers = resources.files("fmpy") / "c-code"
    made = {}
    with tempfile.TemporaryDirectory(prefix="linkwork-guard-") as folder:
        (Path(folder) / "guard.c").write_bytes(source)
        for name in HEADERS[2]:
            # of the C library they need a type alone
            text = (headers / name).read_text(encoding="utf-8").replace("<stdlib.h>", "<stddef.h>")
            (Path(folder) / name).write_text(text, encoding="utf-8")
        for platform in PLATFORMS.values():
            if (place := platform.folder_fmi2) in PYTHONFMU:
                library = f"guard.{platform.suffix}"
                compile_library(folder, ["guard.c"], library, platform.target, (*OPTIONS, *_OPTIONS[place]))
                made[place] = (Path(folder) / library).read_bytes()
    return made
