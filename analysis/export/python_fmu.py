"""Making the Python FMUs.

Each carries the plant, its slave and pythonfmu, and needs nothing but a Python 3 in the importing process. The plant
and the slave travel under names with a short hash of their content, because FMUs in one process share one interpreter:
so different mechanisms, builds and versions run side by side, each on its own equations.
"""

from __future__ import annotations

import hashlib
import html
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from fmpy.validation import validate_fmu
from pythonfmu.builder import FmuBuilder

import linkwork
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism

from ..mechanisms import check
from .description import PYTHON, description, token

PACKAGE = Path(__file__).resolve().parents[1]
#: The source root: beside the analysis package in a checkout, inside it where Linkwork is installed as a wheel.
SOURCES = next(
    (folder for folder in (PACKAGE.parent / "fmu_src", PACKAGE / "_fmu_src") if folder.is_dir()),
    PACKAGE.parent / "fmu_src",
)
ICON = SOURCES / "icon.png"
LICENSE = next(
    (path for path in (SOURCES / "LICENSE", PACKAGE.parent / "LICENSE") if path.is_file()), SOURCES / "LICENSE"
)
#: Modification time of every file in the zip, so that the same sources give the same archive.
EPOCH = (1980, 1, 1, 0, 0, 0)


#: What holds for all of them.
_EVERY_MODEL = (
    "A step that cannot be taken (not positive, out of order, an input that is not finite, the limit of assembly) is "
    "refused with fmi2Discard. The last good state stays readable and can be saved; solver.status and "
    "solver.message say why. Steps are integrated by a Runge-Kutta method of order 8 whose local error is held to "
    "solver.tolerance, or to the master's tolerance where that is tighter.",
    "The importing process needs a Python 3 whose symbols it exports. A master that is not itself Python must preload "
    "the Python library (on Linux: LD_PRELOAD=libpython3.x.so).",
)


class BuildError(LinkworkError):
    """An FMU could not be built, or what was built is not valid."""


def build(mechanism: Mechanism, dest: Path | str = "build", sources: Path | str = SOURCES) -> Path:
    """Build the FMU of a mechanism and return its path.

    Parameters
    ----------
    mechanism : Mechanism
    dest : path
        Folder for the FMU; made if it is not there.
    sources : path
        Source root that holds ``linkwork`` and the slave.

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
    for needed in ("slave.py", "linkwork/__init__.py"):
        if not (sources / needed).is_file():
            raise BuildError(f"{sources} holds no {needed}: FMUs are built from a checkout of the project")
    dest = Path(dest)
    dest.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="linkwork-fmu-") as folder:
        stage = Path(folder) / "stage"
        stage.mkdir()
        staged = _stage(mechanism, sources, stage)
        documentation = Path(folder) / "documentation"
        documentation.mkdir()
        (documentation / "index.html").write_text(_documentation(mechanism), encoding="utf-8")
        (documentation / "licenses").mkdir()
        shutil.copy2(LICENSE, documentation / "licenses" / "license.txt")
        with _import_state():
            try:
                described = _describe(staged)
                raw = FmuBuilder.build_FMU(
                    staged.script,
                    dest=Path(folder) / "raw",
                    project_files=[staged.package, staged.slave],
                    documentation_folder=documentation,
                )
            except Exception as error:  # the sources run here, and may raise anything
                raise BuildError(f"{name}.fmu cannot be built from {sources}: {error!r}") from error
        finished = Path(folder) / f"{name}.fmu"
        _repack(Path(raw), finished, described)
        problems = validate_fmu(str(finished))
        if problems:
            raise BuildError(f"{name}.fmu is not valid: " + "; ".join(problems))
        target = dest / f"{name}.fmu"
        # moved into place whole: a reader never sees half an FMU, and a failed build leaves the old one
        part = target.with_suffix(".fmu.part")
        shutil.copy2(finished, part)
        os.replace(part, target)
    return target


_SLAVE = """from linkwork{package} import MECHANISM
from slave import LinkworkSlave


class {name}(LinkworkSlave):
    mechanism = MECHANISM
    guid_of_interface = ""
"""


class _Staged(NamedTuple):
    """What travels inside an FMU: the script with its slave, the package of the plant, what all slaves share."""

    script: Path
    package: Path
    slave: Path
    mechanism: str


def _stage(mechanism: Mechanism, sources: Path, stage: Path) -> _Staged:
    """Copy plant and slave under names that carry a hash of their content; a mechanism from elsewhere joins the plant."""
    shared = sources / "linkwork"
    package = str(mechanism.modules[-1].__package__)
    folder = package.rpartition(".")[2]
    own = shared / folder
    if package != f"linkwork.{folder}":
        own = Path(str(import_module(package).__file__)).parent
    if not (own / "__init__.py").is_file():
        raise BuildError(f"{sources} holds no linkwork/{folder}: FMUs are built from a checkout of the project")
    kept = {f"linkwork/{path.name}": path for path in sorted(shared.glob("*.py"))}
    kept |= {f"linkwork/{folder}/{path.relative_to(own).as_posix()}": path for path in sorted(own.rglob("*.py"))}
    files = {name: path.read_text(encoding="utf-8") for name, path in kept.items()}
    files["slave.py"] = (sources / "slave.py").read_text(encoding="utf-8")
    files[f"{folder}_slave.py"] = _SLAVE.format(package=f".{folder}", name=mechanism.fmu)
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
    return _Staged(
        stage / f"{folder}_slave_{tag}.py",
        stage / f"linkwork_{tag}",
        stage / f"slave_{tag}.py",
        f"linkwork_{tag}.{folder}",
    )


def _describe(staged: _Staged) -> bytes:
    """The model description of what was staged, not of what is imported here; its slave takes the GUID."""
    sys.path.insert(0, str(staged.script.parent))
    mechanism = import_module(staged.mechanism).MECHANISM
    guid = f'guid_of_interface = "{token(mechanism, PYTHON)}"'
    script = staged.script.read_text(encoding="utf-8").replace('guid_of_interface = ""', guid)
    staged.script.write_text(script, encoding="utf-8")
    return description(mechanism, PYTHON)


@contextmanager
def _import_state() -> Iterator[None]:
    """Undo what pythonfmu's builder does to the import state of this process."""
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


def _repack(raw: Path, finished: Path, described: bytes) -> None:
    """Write the archive again: deflated, in order, with fixed times, the icon, and our model description."""
    with (
        zipfile.ZipFile(raw) as source,
        zipfile.ZipFile(finished, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as target,
    ):
        entries = {name: source.read(name) for name in source.namelist()}
        entries |= {"model.png": ICON.read_bytes(), "modelDescription.xml": described}
        # the model description first, as FMI readers look for it first
        for name in sorted(entries, key=lambda entry: (entry != "modelDescription.xml", entry)):
            info = zipfile.ZipInfo(name.replace("\\", "/"), EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            target.writestr(info, entries[name])


def _documentation(mechanism: Mechanism) -> str:
    """The HTML page inside the FMU: what the model is, and the table of its variables."""
    rows = []
    for variable in mechanism.variables:
        bounds = [
            f"{label} {value:g}"
            for label, value in (("min", variable.minimum), ("max", variable.maximum))
            if value is not None
        ]
        start = "" if variable.causality in ("output", "local") else f"{variable.start}"
        cells = (variable.name, variable.causality, variable.unit, start, ", ".join(bounds), variable.description)
        rows.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    notes = "\n".join(f"<p>{html.escape(note)}</p>" for note in (*mechanism.notes, *_EVERY_MODEL))
    body = "\n".join(rows)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{mechanism.fmu}</title>
<style>
body {{ font-family: sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; color: #222; }}
table {{ border-collapse: collapse; font-size: 90%; }}
th, td {{ text-align: left; padding: 0.2em 0.7em; border-bottom: 1px solid #ddd; vertical-align: top; }}
td:first-child {{ font-family: monospace; white-space: nowrap; }}
</style>
</head>
<body>
<h1><img src="../model.png" alt="" height="60"> {html.escape(mechanism.title)}</h1>
<p>FMI 2.0 co-simulation, Linkwork {linkwork.__version__}, made with PythonFMU {version("pythonfmu")}. MIT licence.</p>
{notes}
<h2>Variables</h2>
<table>
<tr><th>name</th><th>causality</th><th>unit</th><th>start</th><th>range</th><th>description</th></tr>
{body}
</table>
</body>
</html>
"""


_TRIAL = """
import sys
from fmpy import simulate_fmu
result = simulate_fmu(sys.argv[1], stop_time=0.02, step_size=1e-3, output_interval=1e-3)
assert len(result) == 21, len(result)
"""


def try_out(fmu: Path) -> None:
    """Run twenty steps of the FMU through FMPy in a process of its own.

    Raises
    ------
    BuildError
        With what the run printed, if it failed.
    """
    done = subprocess.run(
        [sys.executable, "-c", _TRIAL, str(fmu)], capture_output=True, text=True, timeout=120, check=False
    )
    if done.returncode != 0:
        raise BuildError(f"{fmu.name} was built but does not run:\n{done.stdout}{done.stderr}")
