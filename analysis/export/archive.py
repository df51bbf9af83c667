"""Write the archive of an FMU, with the files that every kind of FMU contains, and test the FMU by a short run."""

from __future__ import annotations

import html
import os
import subprocess
import sys
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import linkwork
from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.variables import Variable

from ..files import find_problems
from ..run import read_experiments
from .accuracy import to_html
from .experiments import experiments

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


#: Notes in the documentation of every FMU.
_EVERY_MODEL = (
    "A step that cannot be taken (not positive, out of order, an input that is not finite, the limit of assembly) is "
    "refused with fmi2Discard. The last good state stays readable and can be saved; solver.status and "
    "solver.message say why. Steps are integrated by a Runge-Kutta method of order 8 whose local error is held to "
    "solver.tolerance, or to the master's tolerance where that is tighter.",
)


class BuildError(LinkworkError):
    """An FMU could not be built, or what was built is not valid."""


def write(entries: Mapping[str, bytes], target: Path) -> Path:
    """Write an FMU as a compressed archive, with its files in a fixed order and with fixed time stamps, and return its path.

    If the FMU is not valid, BuildError is raised and an older file at this path stays.
    """
    # written under another name, then renamed: nobody reads half an FMU, and a failed build leaves the old one
    part = target.with_suffix(".part.fmu")
    try:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
            # the model description first, as FMI readers look for it first
            for name in sorted(entries, key=lambda entry: (entry != "modelDescription.xml", entry)):
                info = zipfile.ZipInfo(name, EPOCH)
                info.compress_type = zipfile.ZIP_DEFLATED
                info.external_attr, info.create_system = 0o644 << 16, 3  # attributes of Unix, on Windows too
                archive.writestr(info, entries[name])
        problems = find_problems(part)
        if problems:
            raise BuildError(f"{target.name} is not valid: " + "; ".join(problems))
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)
    return target


def common_files(
    mechanism: Mechanism, variables: Sequence[Variable], made: str, notes: Sequence[str], icon: str = "model.png"
) -> dict[str, bytes]:
    """Return experiments, icon, licence and the HTML page of an FMU by path in the archive.

    The page describes the model, says how the FMU is ``made``, and has tables of the accuracy and of the ``variables``.
    ``icon`` is the path of the icon.
    """
    files = experiments(mechanism)
    rows = []
    for variable in variables:
        bounds = [
            f"{label} {value:g}"
            for label, value in (("min", variable.minimum), ("max", variable.maximum))
            if value is not None
        ]
        start = "" if variable.causality in ("output", "local") else f"{variable.start}"
        cells = (variable.name, variable.causality, variable.unit, start, ", ".join(bounds), variable.description)
        rows.append("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>")
    paragraphs = "\n".join(f"<p>{html.escape(note)}</p>" for note in (*mechanism.notes, *_EVERY_MODEL, *notes))
    body = "\n".join(rows)
    page = f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{mechanism.title}</title>
<style>
body {{ font-family: sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; color: #222; }}
table {{ border-collapse: collapse; font-size: 90%; }}
th, td {{ text-align: left; padding: 0.2em 0.7em; border-bottom: 1px solid #ddd; vertical-align: top; }}
td:first-child {{ font-family: monospace; white-space: nowrap; }}
</style>
</head>
<body>
<h1><img src="../{icon}" alt="" height="60"> {html.escape(mechanism.title)}</h1>
<p>{html.escape(made)}, Linkwork {linkwork.__version__}. MIT licence.</p>
{paragraphs}
{to_html(mechanism, files)}<h2>Variables</h2>
<table>
<tr><th>name</th><th>causality</th><th>unit</th><th>start</th><th>range</th><th>description</th></tr>
{body}
</table>
</body>
</html>
"""
    return files | {
        icon: ICON.read_bytes(),
        "documentation/index.html": page.encode(),
        "documentation/licenses/license.txt": LICENSE.read_bytes(),
    }


#: Seconds by the clock after which a trial run counts as hung. A run takes two, but many times as long on a busy machine.
_PATIENCE = 600
_TRIAL = """
import sys
from fmpy import simulate_fmu
stop = float(sys.argv[2])
result = simulate_fmu(sys.argv[1], stop_time=stop, step_size=stop / 20.0, output_interval=stop / 20.0)
assert len(result) == 21, len(result)
"""


def run_trial(fmu: Path, script: str = _TRIAL, *arguments: str) -> None:
    """Run the FMU with FMPy in a separate process, by default in twenty steps to 20 ms or, if earlier, an experiment's end.

    Parameters
    ----------
    fmu : path
    script : str
        Python code that the process runs; its arguments are the path of the FMU and ``arguments``.

    Raises
    ------
    BuildError
        If the run fails; the message has what the run printed.
    """
    if script is _TRIAL:
        arguments = (repr(min(0.02, *(experiment.stop or 0.02 for experiment in read_experiments(fmu)))),)
    command = [sys.executable, "-c", script, str(fmu), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        raise BuildError(
            f"{fmu.name} was built but does not run as it should: it takes longer than {_PATIENCE} s"
        ) from None
    if done.returncode != 0:
        raise BuildError(f"{fmu.name} was built but does not run as it should:\n{done.stdout}{done.stderr}")
