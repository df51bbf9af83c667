"""Publish an FMU as https://fmi-standard.org asks: with inputs, reference results and the importers that run it.

The files and their formats are those of "Compatibility information" in the contributing guide of that site.
"""

from __future__ import annotations

import shutil
import sys
from importlib import metadata
from pathlib import Path

import linkwork
from linkwork.mechanism import Mechanism

from .archive import run_trial
from .description import NATIVE_FMI3, PYTHON, Kind, start_plant
from .experiments import format_csv

#: Importers in which the tests of Linkwork run the FMUs, by package: the kinds of FMU and the interfaces.
IMPORTERS = {
    "FMPy": "all; co-simulation, and model exchange of the native ones",
    "libcosimpy": "those of FMI 2.0; co-simulation",
    "ecospy": "all; co-simulation",
    "cofmupy": "all; co-simulation",
    "pathsim-fmi": "all; co-simulation, and model exchange of the native ones",
}
#: Greatest number of variables in the reference results, and tolerances within which an importer should agree with them.
VARIABLES = 10
RELATIVE, ABSOLUTE = 1e-6, 1e-6


def publish(mechanism: Mechanism, kind: Kind, fmu: Path, folder: Path | str) -> Path:
    """Copy an FMU with its compatibility information into a subfolder of ``folder`` named after the FMU; return the subfolder.

    The files are the FMU `{name}.fmu`, the inputs `{name}_in.csv`, the reference results `{name}_ref.csv`, the options of
    their computation `{name}_ref.opt`, and `Readme.txt`. The plant in Python computes the reference results; FMPy must get
    the same results.

    Raises
    ------
    BuildError
        If FMPy's results differ from the reference.
    """
    place = Path(folder) / fmu.stem
    place.mkdir(parents=True, exist_ok=True)
    names, rows = reference_results(mechanism)
    start, stop, step, _ = mechanism.experiment
    starts = {v.name: float(v.start) for v in mechanism.variables if v.name in mechanism.input_names}
    inputs = [starts[name] for name in mechanism.input_names]
    shutil.copy2(fmu, place)
    written = {
        "_in.csv": format_csv(["time", *mechanism.input_names], [[start, *inputs], [stop, *inputs]]),
        "_ref.csv": format_csv(names, rows),
        "_ref.opt": format_options(mechanism),
    }
    for suffix, text in written.items():
        (place / f"{fmu.stem}{suffix}").write_text(text, encoding="utf-8")
    (place / "Readme.txt").write_text(readme_text(mechanism, kind), encoding="utf-8")
    run_trial(place / fmu.name, _COMPARISON, *map(str, (start, stop, step, RELATIVE, ABSOLUTE)))
    return place


_COMPARISON = """
import csv
import sys
import numpy as np
from fmpy import simulate_fmu
fmu = sys.argv[1]
start, stop, step, relative, absolute = map(float, sys.argv[2:])
with open(fmu.replace(".fmu", "_ref.csv"), newline="") as file:
    names, *rows = csv.reader(file)
reference = np.array(rows, dtype=float)
run = {"start_time": start, "stop_time": stop, "step_size": step, "output_interval": step, "output": names[1:]}
found = simulate_fmu(fmu, fmi_type="CoSimulation", **run)
assert len(found) == len(reference), (len(found), len(reference))
for place, name in enumerate(names):
    assert np.allclose(found[name], reference[:, place], rtol=relative, atol=absolute), f"{name} is not that of the reference"
"""


def reference_results(mechanism: Mechanism) -> tuple[list[str], list[list[float]]]:
    """Run the default experiment with the plant in Python; return the names and, for each step, time and the main outputs."""
    start, stop, step, _ = mechanism.experiment
    first = [name for freedom in mechanism.freedoms for name in (freedom.coordinate, freedom.rate)]
    names = list(dict.fromkeys([*first, *mechanism.output_names]))[: VARIABLES - 1]
    places = [mechanism.output_names.index(name) for name in names]
    plant = start_plant(mechanism)
    count = int((stop - start) / step * (1.0 + 1e-12))
    times = [start + n * step for n in range(count + 1)]
    # as in FMPy, the last step may be shorter
    if stop - times[-1] > 1e-6 * step:
        times.append(stop)
    rows = []
    for n, time in enumerate(times):
        if n:
            plant.step(times[n - 1], time - times[n - 1])
        outputs = plant.outputs()
        rows.append([time, *(outputs[place] for place in places)])
    return ["time", *names], rows


def format_options(mechanism: Mechanism) -> str:
    """Format the options of the reference and the tolerances for an importer, as lines of comma-separated values."""
    start, stop, step, _ = mechanism.experiment
    numbers = {"StartTime": start, "StopTime": stop, "StepSize": step, "RelTol": RELATIVE, "AbsTol": ABSOLUTE}
    values = {**numbers, "SolverType": "FixedStep", "OutputIntervalLength": step}
    return "".join(f"{name}, {value}\n" for name, value in values.items())


def readme_text(mechanism: Mechanism, kind: Kind) -> str:
    """Return the text of Readme.txt: the FMU, the features of FMI that can be tested with it, and the importers that run it."""
    features = {
        2: "saved and serialised states, directional derivatives, derivatives of inputs and outputs over time, a state event",
        3: "saved and serialised states, directional and adjoint derivatives, intermediate update, early return, terminals, "
        "a state event",
    }[kind.fmi]
    features = "saved and serialised states, variable steps" if kind is PYTHON else features
    version = "3.0" if kind is NATIVE_FMI3 else "2.0"
    importers = "\n".join(
        f"  {name} {installed}: {what}" for name, what in IMPORTERS.items() if (installed := _version(name))
    )
    notes = "\n".join(mechanism.notes)
    return f"""{mechanism.title}

FMI {version}, {" and ".join({"CoSimulation": "co-simulation", "ModelExchange": "model exchange"}[i] for i in kind.interfaces)}.
Made by Linkwork {linkwork.__version__}, {kind.tool}. Provided by the developers of Linkwork, not by the Modelica Association.

{notes}

Features of FMI that can be tested with it: {features}.
The reference is the default experiment with constant inputs, computed by the equations in Python.

Checked by FMPy's validation against the schemas and rules of FMI.
Importers that the tests of this version run it in, by kind of FMU:
{importers}
"""


def _version(package: str) -> str | None:
    """Return the version of an installed package, None if it is not installed; CoFMUPy is looked for in a folder of its own."""
    found = metadata.distributions(name=package, path=[*sys.path, f"{sys.prefix}/cofmupy"])
    return next((distribution.version for distribution in found), None)
