"""The guard of the Python FMUs, ``fmu_src/guard.c``: a C library between the master and PythonFMU's library.

The guard corrects errors of PythonFMU's library that a slave in Python cannot correct.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

from .native_fmu import CODE, HEADERS, PLATFORMS, compile_library

#: Place of the guard's source in the archive.
SOURCE = "sources/guard.c"
#: Name of PythonFMU's library by the folder of its platform.
PYTHONFMU = {"linux64": "libpythonfmu-export.so", "win64": "pythonfmu-export.dll"}

#: Options in addition to `CODE`. On Windows the guard calls only the system: the C library takes a minute to compile.
_OPTIONS = {
    "linux64": ("-Os", "-ldl"),
    "win64": ("-Os", "-ffreestanding", "-nostdlib", "-lkernel32", "-Wl,--entry,DllMain"),
}


def add_guard(entries: Mapping[str, bytes], model: str, source: bytes) -> dict[str, bytes]:
    """Put the guard in the place of PythonFMU's libraries, which are renamed; return all files by path.

    The source of the guard is added, and a file with the FMU's GUID. The guard compares this GUID with the GUID that the master
    gives.

    Parameters
    ----------
    entries : mapping
        Content of the files by path in the archive, as PythonFMU's builder makes it.
    model : str
        Model identifier of the FMU.
    source : bytes
        C source of the guard.

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
def compile_guard(source: bytes, *, kept: bool = True) -> dict[str, bytes]:
    """Compile the guard for every platform of PythonFMU, or take it from the cache if ``kept``; return libraries by folder."""
    headers = resources.files("fmpy") / "c-code"
    made = {}
    with tempfile.TemporaryDirectory(prefix="linkwork-guard-") as folder:
        (Path(folder) / "guard.c").write_bytes(source)
        for name in HEADERS[2]:
            # the headers need only a type of the C library
            text = (headers / name).read_text(encoding="utf-8").replace("<stdlib.h>", "<stddef.h>")
            (Path(folder) / name).write_text(text, encoding="utf-8")
        for platform in PLATFORMS.values():
            if (place := platform.folder_fmi2) in PYTHONFMU:
                library = f"guard.{platform.suffix}"
                options = (*CODE, *_OPTIONS[place])
                compile_library(folder, ["guard.c"], library, platform.target, options, kept=kept)
                made[place] = (Path(folder) / library).read_bytes()
    return made
