"""Write the experiments inside every FMU: the mechanism's standard cases, with reference results of the plant in Python.

The files are those of the layered standard FMI-LS-REF; `analysis.run.experiments` reads and runs them.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from importlib import import_module
from math import ceil, floor, inf, log2, log10
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

import linkwork
from linkwork.errors import AssemblyError, IntegrationError
from linkwork.mechanism import Mechanism
from linkwork.parameters import fmi_name
from linkwork.plant import Plant

from ..mechanisms import MECHANISMS
from ..numerics.cache import code_folder, load_or_make
from ..run import ALLOWED, EXPERIMENTS, MANIFEST, STANDARD, Case, deviation_scales, input_sampler, standard_cases
from .bill import BILL, TYPE
from .description import layered_standard, to_xml_bytes

#: Communication steps of an experiment, rows of its reference after the start, and digits of its numbers.
STEPS, ROWS, DIGITS = 100, 10, 12
#: Greatest number of solver steps of the plant in a default experiment: more steps take seconds in plain Python.
LONGEST = 200
#: Number of times that the duration of a default experiment may be halved.
HALVINGS = 40
#: Tolerances of the reference and of the experiment; the greatest relative difference that is allowed between them.
REFERENCE, TOLERANCE, DIFFERENCE = 1e-12, 1e-10, 1e-6
_SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
_DESCRIPTION = "Layered Standard providing information on related files included in an FMU."
#: File of experiments: its name below the folder of the standard, and its type.
_EXPERIMENTS = ("smoke-tests.exp", "application/x-ma-hs-experiments")


@cache
def experiments(mechanism: Mechanism) -> dict[str, bytes]:
    """Return the files of a mechanism's experiments and their manifest, by their paths in the archive.

    A mechanism that is not registered or has no cases has only its default experiment. The duration of this experiment is
    halved until the motion does not reach the limit of assembly, the solver takes at most `LONGEST` steps, and a run at the
    tolerance of the experiment differs from the reference by at most a quarter of the allowed difference.

    The files of Linkwork's own mechanisms, whose references take many seconds in plain Python, are kept in the cache under a
    hash of all sources of Linkwork.
    """
    package = str(mechanism.modules[-1].__package__)
    if not package.startswith("linkwork.") or import_module(package).MECHANISM is not mechanism:
        return _make_experiments(mechanism)
    digest = hashlib.sha256(f"{sys.version} {package} {MECHANISMS.get(mechanism.name) is mechanism}".encode())
    for root in (Path(linkwork.__file__).parent, Path(__file__).parents[1]):
        for path in sorted(root.rglob("*.py")):
            digest.update(path.read_bytes())
    made = load_or_make(
        code_folder("experiments") / digest.hexdigest(),
        lambda: json.dumps({name: text.decode() for name, text in _make_experiments(mechanism).items()}).encode(),
    )
    return {name: text.encode() for name, text in json.loads(made).items()}


def _make_experiments(mechanism: Mechanism) -> dict[str, bytes]:
    """Return the files of `experiments`, newly made."""
    cases = standard_cases(mechanism) if mechanism.cases and mechanism.name in MECHANISMS else {}
    root = Element("Experiments", {"name": mechanism.fmu, "description": "Standard cases of Linkwork"})
    files: dict[str, bytes] = {}

    def add(
        name: str, title: str, values: Mapping[str, Any], end: float, inputs: _Inputs, longest: float = inf
    ) -> None:
        start, step = mechanism.experiment[0], (end - mechanism.experiment[0]) / STEPS
        times = [start + n * step for n in range(STEPS + 1)]
        stimuli, reference = _reference(mechanism, values, times, inputs, REFERENCE, longest)
        if longest < inf:
            _, found = _reference(mechanism, values, times, inputs, TOLERANCE, longest)
            apart = _deviations(mechanism, found, reference) > 0.25 * DIFFERENCE
            if apart.any():
                raise _TooLongError(reference[int(apart.argmax())][0])
        node = SubElement(root, "Experiment", {"name": name, "description": title, "tolerance": repr(TOLERANCE)})
        span = {"startTime": start, "stopTime": end, "stepSize": step}
        SubElement(node, "TransientSimulation", {key: repr(value) for key, value in span.items()})
        starts = {v.name: v.start for v in mechanism.variables if v.causality == "parameter"}
        changed = {key: value for key, value in values.items() if key in starts and value != starts[key]}
        if changed:
            files[f"{name}.ssv"] = _parameter_set(name, changed)
            SubElement(node, "Parameters", {"source": f"{name}.ssv"})
        constant = all(row[1:] == stimuli[0][1:] for row in stimuli)
        rows = [stimuli[0], stimuli[-1]] if constant else stimuli
        files[f"{name}-in.csv"] = format_csv(["time", *mechanism.input_names], rows).encode()
        results = [mechanism.output_names[place] for place in _result_indices(mechanism)]
        files[f"{name}-ref.csv"] = format_csv(["time", *results], reference).encode()
        SubElement(node, "Stimuli", {"source": f"{name}-in.csv"})
        SubElement(node, "References", {"source": f"{name}-ref.csv"})
        notes = SubElement(node, "Annotations")
        SubElement(notes, "Annotation", {"type": ALLOWED}).text = repr(DIFFERENCE)

    for name, case in cases.items():
        add(name, case.title, _values(mechanism, case), case.stop_time, input_sampler(case, STEPS))
    if not cases:
        starts = {v.name: v.start for v in mechanism.variables}
        constant = {name: float(starts[name]) for name in mechanism.input_names}
        start, end = mechanism.experiment[:2]
        halved, refused = 0, None
        while halved < HALVINGS:
            try:
                now = start + (end - start) * 0.5**halved
                longest = LONGEST if halved < HALVINGS - 1 else inf
                add("default", "default experiment", starts, now, lambda number, outputs: constant, longest)
                break
            except _TooLongError as error:
                halved = max(halved + 1, ceil(log2((end - start) / (error.time - start))))
            except (AssemblyError, IntegrationError) as error:
                # a communication step that takes more than the plant's 20,000 steps is at least a hundred times too long
                halved, refused = halved + (7 if isinstance(error, IntegrationError) else 1), refused or error
        else:
            assert refused is not None
            raise refused
    files[_EXPERIMENTS[0]] = to_xml_bytes(root)
    return {f"{EXPERIMENTS}/{name}": content for name, content in files.items()} | {MANIFEST: _manifest()}


def format_csv(names: Sequence[str], rows: Sequence[Sequence[float]]) -> str:
    """Return comma-separated values in the format of fmi-standard.org: names in quotes, numbers as in C."""
    text = io.StringIO()
    csv.writer(text, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow(names)
    csv.writer(text, lineterminator="\n").writerows([[repr(float(value)) for value in row] for row in rows])
    return text.getvalue()


def _manifest() -> bytes:
    """Return the manifest of FMI-LS-REF: the experiments, and the bill of materials."""
    root = layered_standard("fmiReferences", STANDARD, "1.0.0-alpha.1", _DESCRIPTION)
    own = (*_EXPERIMENTS, "experiment/smoke-test", "Standard cases with reference results")
    bill = (f"../{BILL.partition('/')[2]}", TYPE, "meta-data", "Bill of materials")
    for source, kind, role, text in (own, bill):
        SubElement(root, "Related", {"type": kind, "source": source, "role": role, "description": text})
    return to_xml_bytes(root)


#: Function that returns the inputs of a step by name, from the number of the step and the outputs at its start.
_Inputs = Callable[[int, Sequence[float] | None], Mapping[str, float]]


def _values(mechanism: Mechanism, case: Case) -> dict[str, Any]:
    """Return parameters, initial state and modes of a case by FMI name."""
    values = {fmi_name(name): value for name, value in asdict(case.parameters).items()}
    values |= {f"initial.{name}": value for name, value in asdict(case.initial).items()}
    return values | case.inputs.modes(mechanism)


def _result_indices(mechanism: Mechanism) -> list[int]:
    """Return the indices of the outputs that are results: all but residuals, which another solver does not reproduce."""
    return [n for n, name in enumerate(mechanism.output_names) if not name.endswith(".residual")]


class _TooLongError(Exception):
    """At a ``time`` (s) the plant's solver has taken too many steps, or the result depends too much on its tolerance."""

    def __init__(self, time: float) -> None:
        self.time = time


def _reference(
    mechanism: Mechanism,
    values: Mapping[str, Any],
    times: Sequence[float],
    inputs: _Inputs,
    tolerance: float,
    longest: float,
) -> tuple[list[list[float]], list[list[float]]]:
    """Return the rows of inputs for all ``times``, and rows of results at the start and at `ROWS` later times.

    Each row begins with the time. Results are taken before the inputs of the next step are set. Raises `_TooLongError`
    after about ``longest`` steps of the plant's solver.
    """

    def rounded_inputs(number: int, outputs: Sequence[float] | None) -> dict[str, float]:
        return {name: float(f"{value:.{DIGITS}g}") for name, value in inputs(number, outputs).items()}

    first = rounded_inputs(0, None)
    starts = {v.name: v.start for v in mechanism.variables}
    plant = Plant.from_values(mechanism, {**starts, **values, **first}, tolerance=tolerance, time=times[0])
    stimuli = [[times[0], *(first[name] for name in mechanism.input_names)]]
    outputs = list(plant.outputs())
    places = _result_indices(mechanism)
    rows = [[times[0], *(outputs[place] for place in places)]]
    taken = 0.0
    for n, time in enumerate(times[1:], start=1):
        plant.step(times[n - 1], time - times[n - 1])
        taken += max(1.0, (time - times[n - 1]) / plant.next_step)
        if taken > longest:
            raise _TooLongError(time)
        outputs = list(plant.outputs())
        if n * ROWS % STEPS == 0:
            rows.append([time, *(outputs[place] for place in places)])
        now = rounded_inputs(n, outputs)
        stimuli.append([time, *(now[name] for name in mechanism.input_names)])
        for name, value in now.items():
            plant.set_input(name, value)
    return stimuli, _round_results(mechanism, rows)


def _result_units(mechanism: Mechanism) -> list[str]:
    """Return the units of the results."""
    units = [v.unit for v in mechanism.variables if v.name in mechanism.output_names]
    return [units[place] for place in _result_indices(mechanism)]


def _deviations(mechanism: Mechanism, found: list[list[float]], reference: list[list[float]]) -> NDArray[np.float64]:
    """Return for each row of results the largest relative difference from a reference, as `analysis.run.verify` measures it."""
    wanted = np.array(reference)[:, 1:]
    scales = deviation_scales(wanted.T, _result_units(mechanism))
    return (np.abs(np.array(found)[:, 1:] - wanted) / scales).max(axis=1)


def _round_results(mechanism: Mechanism, rows: list[list[float]]) -> list[list[float]]:
    """Round results, so that another C library gives the same texts.

    In each unit the largest result gets `DIGITS` significant digits, all others as many decimal places as this result.
    """
    units = ["", *_result_units(mechanism)]
    largest: dict[str, float] = {}
    for unit, column in zip(units, zip(*rows)):
        largest[unit] = max(*map(abs, column), largest.get(unit, 0.0))
    places = {unit: DIGITS - 1 - floor(log10(size)) if size > 0.0 else 0 for unit, size in largest.items()}
    # adding zero makes -0.0 zero
    return [[row[0], *(round(v, places[unit]) + 0.0 for v, unit in zip(row[1:], units[1:]))] for row in rows]


def _parameter_set(name: str, values: Mapping[str, Any]) -> bytes:
    """Return a parameter set of the standard SSP as XML; ``values`` are by FMI name."""
    root = Element("ssv:ParameterSet", {"xmlns:ssv": _SSV, "version": "1.0", "name": name})
    listed = SubElement(root, "ssv:Parameters")
    for key, value in values.items():
        tag = "ssv:Integer" if isinstance(value, int) else "ssv:Real"
        SubElement(SubElement(listed, "ssv:Parameter", {"name": key}), tag, {"value": repr(value)})
    return to_xml_bytes(root)
