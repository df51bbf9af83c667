"""Compile and run the master in C, host.c: on this machine, or under an emulator for another one."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import subprocess
import sysconfig
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import pytest

from analysis.export import PLATFORMS, compile_library, this_platform

from .described import Scalar, read_scalars

SOURCE = Path(__file__).with_name("host.c")


def compile_host(folder: Path, platform: str | None = None) -> Path:
    """Compile the host into a folder, for a platform of `PLATFORMS`; return its path."""
    platform = platform or this_platform()
    name = "host.exe" if "windows" in platform else "host"
    headers = str(resources.files("fmpy") / "c-code")
    libraries = () if "windows" in platform else ("-lpthread", "-ldl")
    options = ("-std=c11", "-O2", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Werror", "-I", headers)
    # optimised as FMUs are: otherwise Zig compiles the C library again, which takes more than a minute for Windows
    options = (*options, *libraries, *PLATFORMS[platform].options)
    compile_library(folder, [str(SOURCE)], name, PLATFORMS[platform].target, options, kept=True)
    return folder / name


def python_path() -> dict[str, str]:
    """Return the environment in which a master in C finds this Python's library for the Python FMU.

    The test is skipped if there is no such library.
    """
    name = sysconfig.get_config_var("INSTSONAME") or ""
    try:
        ctypes.CDLL(name or "libpython3.so")
    except OSError:
        pytest.skip(f"there is no library {name} of this Python for a master in C to load")
    return {"LD_LIBRARY_PATH": str(sysconfig.get_config_var("LIBDIR"))}


def emulator(platform: str) -> list[str]:
    """Return the command that runs programs of a platform, empty on this one; skip the test if there is no emulator."""
    if platform == this_platform():
        return []
    wine = next((p for p in (shutil.which("wine64"), "/usr/lib/wine/wine64") if p and Path(p).is_file()), None)
    qemu, root = shutil.which("qemu-aarch64-static"), Path("/usr/aarch64-linux-gnu")
    if platform == "x86_64-windows" and wine:
        return [wine]
    if platform == "aarch64-linux" and qemu and root.is_dir():
        return [qemu, "-L", str(root)]
    pytest.skip(f"no emulator of {platform}")


def wine_settings(folder: Path) -> dict[str, str]:
    """Return the environment for a Wine installation of its own in a folder."""
    return {"WINEPREFIX": str(folder / "wine"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}


class Unpacked(NamedTuple):
    """An FMU as a master needs it: library, token and variables by name."""

    folder: Path
    library: Path
    fmi: int
    token: str
    scalars: dict[str, Scalar]
    states: int

    def reals(self, causality: str) -> list[Scalar]:
        """Return the real variables with a causality, such as "input"."""
        return [s for s in self.scalars.values() if s.kind == "Real" and s.attributes.get("causality") == causality]


def unpack(fmu: Path, folder: Path, platform: str | None = None) -> Unpacked:
    """Unpack an FMU into a folder, and read what a master needs."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    fmi = int(root.get("fmiVersion", "").partition(".")[0])
    at = PLATFORMS[platform or this_platform()]
    identifier = root.find("CoSimulation").get("modelIdentifier")
    library = folder / "binaries" / (at.folder_fmi2 if fmi == 2 else at.folder_fmi3) / f"{identifier}.{at.suffix}"
    structure = root.find("ModelStructure")
    states = structure.findall("Derivatives/Unknown") if fmi == 2 else structure.findall("ContinuousStateDerivative")
    scalars = {scalar.name: scalar for scalar in read_scalars(root)}
    token = root.get("guid" if fmi == 2 else "instantiationToken", "")
    return Unpacked(folder, library, fmi, token, scalars, len(states))


def run_host(
    host: Path,
    fmu: Unpacked,
    start: Mapping[str, float],
    *,
    inputs: Mapping[str, float] | None = None,
    change: tuple[str, float, int] | None = None,
    outputs: Sequence[str] | None = None,
    interface: str = "cs",
    steps: int = 100,
    step: float = 1e-3,
    instances: int = 1,
    threads: int = 1,
    resources: str | None = None,
    emulator: Sequence[str] = (),
    environment: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Run an FMU in the host, and return the numbers that it prints, with the outputs by name; see host.c.

    Parameters
    ----------
    start : mapping
        Values before the initialisation.
    inputs : mapping, optional
        Values that are set before every step.
    change : (name, value, number of a step), optional
        An input that is changed before that step.
    resources : str, optional
        URI of the resources; by default that of the folder in the FMU.
    emulator : sequence of str
        Command that runs the host.
    """
    outputs = [s.name for s in fmu.reals("output")] if outputs is None else outputs
    at = {name: scalar.reference for name, scalar in fmu.scalars.items()}
    kinds = {name: "r" if fmu.scalars[name].kind == "Real" else "m" for name in start}
    plan = [f"{kinds[name]} {at[name]} {value!r}" for name, value in start.items()]
    plan += [f"i {at[name]} {value!r}" for name, value in (inputs or {}).items()]
    plan += [f"c {at[change[0]]} {change[1]!r} {change[2]}"] if change else []
    plan += [f"o {at[name]}" for name in outputs]
    if resources is None:
        resources = (fmu.folder / "resources").as_uri() + ("/" if fmu.fmi == 3 else "")
    arguments = [fmu.library, fmu.fmi, interface, fmu.token, resources, fmu.states, steps, step, instances, threads]
    with tempfile.TemporaryDirectory(prefix="linkwork-host-") as folder:
        done = subprocess.run(
            [*emulator, str(host), *map(str, arguments)], input="\n".join(plan), capture_output=True, text=True,
            timeout=300, check=False, env=os.environ | (environment or {}), cwd=folder,
        )  # fmt: skip
    if done.returncode != 0:
        raise RuntimeError(f"the host ended with {done.returncode}: {done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout)
    found["end"] = dict(zip(outputs, found.pop("values")))
    return found
