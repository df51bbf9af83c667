"""Make copies of FMUs and archives that log the calls of masters; for Linux."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Callable
from importlib import resources
from pathlib import Path

from analysis.export import PLATFORMS, compile_library, this_platform

from .c_host import unpack

SOURCE = Path(__file__).with_name("spy.c")
OPTIONS = (
    "-std=c11", "-O2", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-lm",
    "-Wl,-rpath,$ORIGIN,--no-as-needed",
)  # fmt: skip


def watched(fmu: Path, target: Path) -> Path:
    """Write a copy of a native FMU that logs all calls into the file named by the environment variable LINKWORK_CALLS."""
    with tempfile.TemporaryDirectory() as folder:
        library = unpack(fmu, Path(folder)).library
        real = library.rename(library.with_name(f"real-{library.name}"))
        options = (*OPTIONS, "-I", str(resources.files("fmpy") / "c-code"), real.name)
        compile_library(library.parent, [str(SOURCE)], library.name, PLATFORMS[this_platform()].target, options)
        return packed(Path(folder), target)


def changed(archive: Path, target: Path, change: Callable[[Path], None]) -> Path:
    """Write a copy of an archive, such as of SSP; ``change`` is applied to the folder of its unpacked files."""
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(archive) as content:
        content.extractall(folder)
        change(Path(folder))
        return packed(Path(folder), target)


def packed(folder: Path, target: Path) -> Path:
    """Write the files of a folder into an archive."""
    with zipfile.ZipFile(target, "w") as content:
        for path in sorted(folder.rglob("*")):
            content.write(path, path.relative_to(folder))
    return target
