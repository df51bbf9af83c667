"""Build the Python FMUs.

Each Python FMU contains the plant, its slave and pythonfmu, and needs only Python `OLDEST` or newer in the importing process.
All FMUs in one process share one interpreter. The names of plant and slave therefore contain a short hash of their content:
different mechanisms, builds and versions run side by side, each with its own equations.
"""

from __future__ import annotations

import hashlib
import re
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import import_module, resources
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from pythonfmu.builder import FmuBuilder

from linkwork import wrapper
from linkwork.mechanism import Mechanism

from ..mechanisms import check
from . import controllers
from .archive import SOURCES, BuildError, common_files, write
from .bill import add_bill
from .description import PYTHON, description, token
from .native_fmu import CODE, HEADERS, PLATFORMS, compile_library

#: The oldest Python on which the modules in the FMUs run.
OLDEST = (3, 10)

_NEEDS_PYTHON = (
    f"It needs a Python {OLDEST[0]}.{OLDEST[1]} or newer. A master that is not itself Python must find Python's library: on "
    "Linux libpython3.x.so.1.0 where the system looks for libraries, on Windows python3.dll on the path."
)


def build(mechanism: Mechanism, dest: Path | str = "build", sources: Path | str = SOURCES) -> Path:
    """Build the Python FMU of a mechanism and return its path.

    Parameters
    ----------
    mechanism : Mechanism
    dest : path
        Folder for the FMU; made if it is not there.
    sources : path
        Source root that contains ``linkwork`` and the slave.

    Raises
    ------
    BuildError
        If the sources are incomplete, or the FMU is not valid.
    MechanismError
        If the parts of the mechanism do not fit together.
    """
    check(mechanism)
    name = mechanism.fmu
    sources = Path(sources)
    for needed in ("slave.py", "guard.c", "linkwork/__init__.py"):
        if not (sources / needed).is_file():
            raise BuildError(f"{sources} contains no {needed}: FMUs are built from a checkout of the project")
    dest = Path(dest)
    dest.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="linkwork-fmu-") as folder:
        stage = Path(folder) / "stage"
        stage.mkdir()
        staged = _stage(mechanism, sources, stage)
        with _import_state():
            try:
                described = _describe(staged)
                raw = _run_builder(staged.script, [staged.package, staged.slave])
            except Exception as error:  # the sources run here, and may raise anything
                raise BuildError(f"{name}.fmu cannot be built from {sources}: {error!r}") from error
    raw["modelDescription.xml"] = described
    entries = add_guard(raw, name, (sources / "guard.c").read_bytes())
    made = f"FMI 2.0 co-simulation, made with {PYTHON.tool}"
    entries |= common_files(mechanism, mechanism.variables, made, (_NEEDS_PYTHON,))
    target = dest / PYTHON.file_name(mechanism)
    return write(add_bill(target.stem, entries, native=False, fmi=2), target)


def _run_builder(script: Path, files: list[Path], **options: str) -> dict[str, bytes]:
    """Run PythonFMU's builder on a script and the files that it imports; return the files of its archive by path."""
    raw = FmuBuilder.build_FMU(script, dest=script.parent / "raw", project_files=files, **options)
    with zipfile.ZipFile(raw) as archive:
        return {entry.replace("\\", "/"): archive.read(entry) for entry in archive.namelist()}


_SLAVE = """import sys

if sys.version_info < {oldest}:
    raise ImportError("{name}.fmu needs Python %d.%d or newer: this is %d.%d" % ({oldest} + sys.version_info[:2]))

from linkwork{package} import MECHANISM
from slave import LinkworkSlave


class {name}(LinkworkSlave):
    mechanism = MECHANISM
    guid_of_interface = ""
"""


class _StagedFiles(NamedTuple):
    """Files inside an FMU: script of the slave, package of the plant, module of all slaves; import name of the mechanism."""

    script: Path
    package: Path
    slave: Path
    mechanism: str


def _stage(mechanism: Mechanism, sources: Path, stage: Path) -> _StagedFiles:
    """Copy plant and slave under names with a hash of their content.

    A mechanism from another package is copied into the package of the plant.
    """
    shared = sources / "linkwork"
    package = str(mechanism.modules[-1].__package__)
    folder = package.rpartition(".")[2]
    own = shared / folder
    if package != f"linkwork.{folder}":
        own = Path(str(import_module(package).__file__)).parent
    if not (own / "__init__.py").is_file():
        raise BuildError(f"{sources} contains no linkwork/{folder}: FMUs are built from a checkout of the project")
    kept = {f"linkwork/{path.name}": path for path in sorted(shared.glob("*.py"))}
    kept |= {f"linkwork/{folder}/{path.relative_to(own).as_posix()}": path for path in sorted(own.rglob("*.py"))}
    files = {name: path.read_text(encoding="utf-8") for name, path in kept.items()}
    files["slave.py"] = (sources / "slave.py").read_text(encoding="utf-8")
    files[f"{folder}_slave.py"] = _SLAVE.format(package=f".{folder}", name=mechanism.fmu, oldest=OLDEST)
    digest = hashlib.sha256()
    for name, text in sorted(files.items()):
        digest.update(f"{name}\0{text}\0".encode())
    tag = digest.hexdigest()[:8]
    for name, text in files.items():
        text = re.sub(r"^(\s*)(from|import) linkwork\b", rf"\1\2 linkwork_{tag}", text, flags=re.MULTILINE)
        text = re.sub(r"^from slave import", f"from slave_{tag} import", text, flags=re.MULTILINE)
        parts = Path(name).parts
        inside = parts[0] == "linkwork"
        target = stage.joinpath(f"linkwork_{tag}", *parts[1:]) if inside else stage / f"{Path(name).stem}_{tag}.py"
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
    return _StagedFiles(
        stage / f"{folder}_slave_{tag}.py",
        stage / f"linkwork_{tag}",
        stage / f"slave_{tag}.py",
        f"linkwork_{tag}.{folder}",
    )


def _describe(staged: _StagedFiles) -> bytes:
    """Return the model description of the staged mechanism, not of the module imported here; write its GUID to the slave."""
    sys.path.insert(0, str(staged.script.parent))
    mechanism = import_module(staged.mechanism).MECHANISM
    guid = f'guid_of_interface = "{token(mechanism, PYTHON)}"'
    script = staged.script.read_text(encoding="utf-8").replace('guid_of_interface = ""', guid)
    staged.script.write_text(script, encoding="utf-8")
    return description(mechanism, PYTHON)


_CONTROLLER = "from {module} import {kind}\n\n\nclass {kind}Controller({kind}):\n    __doc__ = {kind}.__doc__\n"


def build_controller(name: str, dest: Path | str = "build") -> Path:
    """Build the Python FMU of a controller and return its path, in a subfolder named by the hash of its content.

    Parameters
    ----------
    name : str
        A key of `controllers.CONTROLLERS`.
    dest : path
        Folder in which the subfolder is made; an FMU that is already there is kept.
    """
    text, shared = (Path(str(module.__file__)).read_text(encoding="utf-8") for module in (controllers, wrapper))
    guard = (SOURCES / "guard.c").read_bytes()
    content = f"{text}\0{shared}\0".encode() + guard
    kind, tag = controllers.CONTROLLERS[name].__name__, hashlib.sha256(content).hexdigest()[:8]
    target = Path(dest) / tag / f"{kind}Controller.fmu"
    if target.is_file():
        return target
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="linkwork-fmu-") as stage, _import_state():
        package, module = Path(stage) / f"linkwork_{tag}", Path(stage) / f"controllers_{tag}.py"
        package.mkdir()
        (package / "__init__.py").touch()
        (package / "wrapper.py").write_text(shared, encoding="utf-8")
        module.write_text(text.replace("from linkwork.", f"from linkwork_{tag}."), encoding="utf-8")
        script = Path(stage) / f"{kind.lower()}_{tag}.py"
        script.write_text(_CONTROLLER.format(module=module.stem, kind=kind), encoding="utf-8")
        options = {"canGetAndSetFMUstate": "true", "canHandleVariableCommunicationStepSize": "true"}
        entries = _run_builder(script, [package, module], **options)
        write(add_guard(entries, target.stem, guard), target)
    return target


@contextmanager
def _import_state() -> Iterator[None]:
    """Restore at the end of the block the import state of this process, which pythonfmu's builder changes."""
    path, modules = list(sys.path), set(sys.modules)
    writes_bytecode = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        yield
    finally:
        sys.path[:] = path
        sys.dont_write_bytecode = writes_bytecode
        for name in set(sys.modules) - modules:
            if re.search(r"_[0-9a-f]{8}(\.|$)", name):
                del sys.modules[name]


# The guard, ``fmu_src/guard.c``: a C library between the master and PythonFMU's library, whose errors it corrects


#: Place of the guard's source in the archive.
SOURCE = "sources/guard.c"
#: Name of PythonFMU's library by the folder of its platform.
PYTHONFMU = {"linux64": "libpythonfmu-export.so", "win64": "pythonfmu-export.dll"}

#: Options in addition to `CODE`. On Windows the guard calls only the system, as the C library takes a minute to compile.
_OPTIONS = {
    "linux64": ("-Os", "-ldl"),
    "win64": ("-Os", "-ffreestanding", "-nostdlib", "-lkernel32", "-Wl,--entry,DllMain"),
}


def add_guard(entries: Mapping[str, bytes], model: str, source: bytes) -> dict[str, bytes]:
    """Put the guard in the place of PythonFMU's libraries, which are renamed; return all files by path.

    The guard is a C library that the master calls; it calls PythonFMU's library and corrects its errors. Its source is added,
    and a file with the FMU's GUID, which the guard compares with the GUID that the master gives.

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
