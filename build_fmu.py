"""Build and validate the FMUs of Linkwork.

    python build_fmu.py [--dest build] [FiveBarSlider ...]

Each FMU carries the plant, its slave and pythonfmu, and needs nothing but a Python 3 in the importing process. The plant
and the slave travel under names with a short hash of their content, because FMUs in one process share one interpreter:
so different mechanisms, builds and versions run side by side, each on its own equations. The exit code is 0 only if every
FMU was built, found valid, and run.
"""

from __future__ import annotations

import argparse
import hashlib
import html
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from fmpy.validation import validate_fmu
from pythonfmu.builder import FmuBuilder

import linkwork
from linkwork.errors import LinkworkError
from linkwork.five_bar import variables as five_bar_variables
from linkwork.slider_crank import variables as slider_crank_variables
from linkwork.variables import Variable

HERE = Path(__file__).resolve().parent
#: The source root: beside this file in a checkout, inside the analysis package where Linkwork is installed as a wheel.
SOURCES = next(
    (folder for folder in (HERE / "fmu_src", HERE / "analysis" / "_fmu_src") if folder.is_dir()), HERE / "fmu_src"
)
ICON = SOURCES / "icon.png"
LICENSE = next((path for path in (SOURCES / "LICENSE", HERE / "LICENSE") if path.is_file()), HERE / "LICENSE")
#: Modification time of every file in the zip, so that the same sources give the same archive.
EPOCH = (1980, 1, 1, 0, 0, 0)


class Model(NamedTuple):
    """An FMU that can be built: its slave, the plant it holds, and its interface."""

    slave: str
    plant: str
    title: str
    variables: tuple[Variable, ...]
    notes: tuple[str, ...]


#: What holds for all of them.
_EVERY_MODEL = (
    "A step that cannot be taken (not positive, out of order, an input that is not finite, the limit of assembly) is "
    "refused with fmi2Discard. The last good state stays readable and can be saved; solver.status and "
    "solver.message say why. Steps are integrated by a Runge-Kutta method of order 8 whose local error is held to "
    "solver.tolerance, or to the master's tolerance where that is tighter.",
    "The importing process needs a Python 3 whose symbols it exports. A master that is not itself Python must preload "
    "the Python library (on Linux: LD_PRELOAD=libpython3.x.so).",
)

MODELS = {
    "FiveBarSlider": Model(
        "five_bar_slave",
        "five_bar",
        "Five-bar slider",
        five_bar_variables.VARIABLES,
        (
            "A four-bar linkage whose rocker-to-ground pivot D is a slider on a straight guide, held by a spring, opposed by "
            "a damper and by friction, and driven by a control force. Crank angle and slider position are the two freedoms.",
            "x runs along the ground link from the crank shaft A to the slider's zero, y to its left; angles are "
            "counter-clockwise from x. Gravity is (-g sin, -g cos) of ground.inclination. A positive torque drives the crank "
            "counter-clockwise. Pin forces: A of the ground on the crank, B of the crank on the coupler, C of the rocker on "
            "the coupler, D of the slider on the rocker; slider.guide_force is the guide's force on the slider.",
            "drive.mode 0: drive.torque acts on the crank. drive.mode 1: over a step the crank turns at drive.speed + "
            "drive.acceleration (t - t_n), and drive.applied_torque is the torque that takes. Where the commanded speed jumps, "
            "the slider's generalised momentum is conserved and the slider velocity jumps with it; a slave that is not given "
            "drive.speed again starts the next step from the same drive.speed.",
            *_EVERY_MODEL,
        ),
    ),
    "SliderCrank": Model(
        "slider_crank_slave",
        "slider_crank",
        "Generalised slider-crank",
        slider_crank_variables.VARIABLES,
        (
            "A spatial slider-crank: the crank turns about its axis and shifts along it, a rod between two ball joints moves "
            "a slider on a straight guide that is offset from the crank axis and twisted against it. Crank angle and axial "
            "shift are the two freedoms; the rod's spin about its own line is idle and taken as none.",
            "z runs along the crank axis, x along the common normal of axis and guide, away from the guide where "
            "guide.offset is positive; the crank points along x at crank.angle 0 and turns about z. The guide passes through "
            "(-guide.offset, 0, 0); the slider position increases along (0, -sin, -cos) of guide.twist. bearing: all that "
            "the ground exerts on the crank, moments about the origin; crank_pin: force of the crank on the rod; slider_pin: "
            "of the slider on the rod; guide: of the guide on the slider. Vectors are in the ground frame.",
            "drive.mode 0: drive.torque acts on the crank. drive.mode 1: over a step the crank turns at drive.speed + "
            "drive.acceleration (t - t_n), and drive.applied_torque is the torque that takes. axial.mode 0: axial.force acts "
            "along the axis. axial.mode 1: over a step the crank shifts at axial.speed + axial.acceleration (t - t_n), from "
            "initial.shift_position; axial.applied_force is the force that takes. axial.mode 2: a groove in the shaft makes "
            "the shift groove.amplitude sin(groove.ratio crank.angle). Where a commanded speed jumps, the generalised momentum "
            "of the other freedom is conserved, if nothing drives that one; a slave that is not given a speed again starts "
            "the next step from the same one.",
            *_EVERY_MODEL,
        ),
    ),
}


class BuildError(LinkworkError):
    """An FMU could not be built, or what was built is not valid."""


def build(name: str = "FiveBarSlider", dest: Path | str = "build", sources: Path | str = SOURCES) -> Path:
    """Build one FMU and return its path.

    Parameters
    ----------
    name : str
        A key of `MODELS`.
    dest : path
        Folder for the FMU; made if it is not there.
    sources : path
        Source root that holds ``linkwork`` and the slaves.

    Raises
    ------
    BuildError
        If the model is unknown, the sources are incomplete, or the FMU is not valid.
    """
    if name not in MODELS:
        raise BuildError(f"there is no model {name!r}: the models are {', '.join(MODELS)}")
    model = MODELS[name]
    sources = Path(sources)
    for needed in (f"{model.slave}.py", "slave.py", "linkwork/__init__.py", f"linkwork/{model.plant}/__init__.py"):
        if not (sources / needed).is_file():
            raise BuildError(f"{sources} holds no {needed}: FMUs are built from a checkout of the project")
    dest = Path(dest)
    dest.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="linkwork-fmu-") as folder:
        stage = Path(folder) / "stage"
        stage.mkdir()
        script, package, base = _stage(model, sources, stage)
        documentation = Path(folder) / "documentation"
        documentation.mkdir()
        (documentation / "index.html").write_text(_documentation(name, model), encoding="utf-8")
        (documentation / "licenses").mkdir()
        shutil.copy2(LICENSE, documentation / "licenses" / "license.txt")
        with _import_state():
            try:
                raw = FmuBuilder.build_FMU(
                    script,
                    dest=Path(folder) / "raw",
                    project_files=[package, base],
                    documentation_folder=documentation,
                    needsExecutionTool=False,
                    canGetAndSetFMUstate=True,
                    canSerializeFMUstate=True,
                )
            except Exception as error:  # the sources run here, and may raise anything
                raise BuildError(f"{name}.fmu cannot be built from {sources}: {error!r}") from error
        finished = Path(folder) / f"{name}.fmu"
        _repack(Path(raw), finished)
        problems = validate_fmu(str(finished))
        if problems:
            raise BuildError(f"{name}.fmu is not valid: " + "; ".join(problems))
        target = dest / f"{name}.fmu"
        # moved into place whole: a reader never sees half an FMU, and a failed build leaves the old one
        part = target.with_suffix(".fmu.part")
        shutil.copy2(finished, part)
        os.replace(part, target)
    return target


def _stage(model: Model, sources: Path, stage: Path) -> tuple[Path, Path, Path]:
    """Copy plant and slave under names that carry a hash of their content."""
    package = sources / "linkwork"
    kept = [
        path
        for path in sorted(package.rglob("*.py"))
        if path.parent == package or path.relative_to(package).parts[0] == model.plant
    ]
    files = {path.relative_to(sources).as_posix(): path.read_text(encoding="utf-8") for path in kept}
    for module in ("slave", model.slave):
        files[f"{module}.py"] = (sources / f"{module}.py").read_text(encoding="utf-8")
    digest = hashlib.sha256()
    for name, text in sorted(files.items()):
        digest.update(f"{name}\0{text}\0".encode())
    tag = digest.hexdigest()[:8]

    def renamed(text: str) -> str:
        text = re.sub(r"^(from|import) linkwork\b", rf"\1 linkwork_{tag}", text, flags=re.MULTILINE)
        return re.sub(r"^from slave import", f"from slave_{tag} import", text, flags=re.MULTILINE)

    for name, text in files.items():
        parts = Path(name).parts
        if parts[0] == "linkwork":
            target = stage.joinpath(f"linkwork_{tag}", *parts[1:])
        else:
            target = stage / f"{Path(name).stem}_{tag}.py"
            text = renamed(text)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
    return stage / f"{model.slave}_{tag}.py", stage / f"linkwork_{tag}", stage / f"slave_{tag}.py"


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


def _repack(raw: Path, finished: Path) -> None:
    """Write the archive again: deflated, in order, with fixed times, the icon, and a reproducible date if asked for."""
    with (
        zipfile.ZipFile(raw) as source,
        zipfile.ZipFile(finished, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as target,
    ):
        entries = {name: source.read(name) for name in source.namelist()}
        entries["model.png"] = ICON.read_bytes()
        epoch = os.environ.get("SOURCE_DATE_EPOCH")
        if epoch is not None:
            stamp = datetime.fromtimestamp(int(epoch), UTC).isoformat(timespec="seconds").encode()
            entries["modelDescription.xml"] = re.sub(
                rb'generationDateAndTime="[^"]*"',
                b'generationDateAndTime="' + stamp + b'"',
                entries["modelDescription.xml"],
            )
        # the model description first, as FMI readers look for it first
        for name in sorted(entries, key=lambda entry: (entry != "modelDescription.xml", entry)):
            info = zipfile.ZipInfo(name.replace("\\", "/"), EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            target.writestr(info, entries[name])


def _documentation(name: str, model: Model) -> str:
    """The HTML page inside the FMU: what the model is, and the table of its variables."""
    rows = []
    for variable in model.variables:
        bounds = [
            f"{label} {value:g}"
            for label, value in (("min", variable.minimum), ("max", variable.maximum))
            if value is not None
        ]
        start = "" if variable.causality == "output" else f"{variable.start}"
        cells = (variable.name, variable.causality, variable.unit, start, ", ".join(bounds), variable.description)
        rows.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    notes = "\n".join(f"<p>{html.escape(note)}</p>" for note in model.notes)
    body = "\n".join(rows)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{name}</title>
<style>
body {{ font-family: sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; color: #222; }}
table {{ border-collapse: collapse; font-size: 90%; }}
th, td {{ text-align: left; padding: 0.2em 0.7em; border-bottom: 1px solid #ddd; vertical-align: top; }}
td:first-child {{ font-family: monospace; white-space: nowrap; }}
</style>
</head>
<body>
<h1><img src="../model.png" alt="" height="60"> {html.escape(model.title)}</h1>
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Build the models named on the command line, or all of them."""
    parser = argparse.ArgumentParser(description="Build and validate the FMUs of Linkwork.")
    parser.add_argument(
        "models", nargs="*", metavar="MODEL", help=f"which to build: {', '.join(MODELS)}; all by default"
    )
    parser.add_argument("--dest", default="build", help="folder for the FMUs (default: %(default)s)")
    options = parser.parse_args(arguments)
    for name in options.models or list(MODELS):
        try:
            fmu = build(name, options.dest)
            try_out(fmu)
        except LinkworkError as error:
            print(f"error: {error}", file=sys.stderr)
            return 1
        print(f"{fmu}: valid, {fmu.stat().st_size / 1024:.0f} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
