"""Compute the work and the errors of simulations for several tolerances, as a table for the documentation of each FMU.

For a mechanism with standard cases the table is in `DATA`, which ``python -m analysis.export.accuracy`` rewrites in some
seconds; `tests/fmu/test_accuracy.py` checks that it is current. For any other mechanism the table is computed when the FMU is
built.
"""

from __future__ import annotations

import csv
import html
import json
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.plant import TOLERANCE_RANGE, Plant

from ..mechanisms import MECHANISMS, output_units
from ..run import EXPERIMENTS, Case, compare, output_scales, simulate, standard_cases

DATA = Path(__file__).with_name("accuracy.json")
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
#: Kinds of outputs, by their units.
KINDS = {
    "positions": ("m", "rad"),
    "velocities": ("m/s", "rad/s"),
    "accelerations": ("m/s2", "rad/s2"),
    "forces, moments": ("N", "N.m"),
    "energies": ("J",),
}
HEADINGS = ("solver.tolerance", "evaluations per second", *KINDS)
CAPTION = (
    "Largest global error of the outputs over all times of {}, relative to the largest magnitude of the output, or to a "
    "thousandth of the largest output of its unit if that is more. Evaluations of the equations are per second of "
    "simulated time{}; shorter communication steps need more evaluations, and have smaller errors."
)
#: Words for the two gaps in the caption, for the standard cases and for the default experiment.
STANDARD_CASES = ("all standard cases", ", the most of all cases")
DEFAULT = ("the default experiment in ten communication steps", "")


def measure_work_and_errors(case: Case, tolerance: float) -> tuple[float, dict[str, float]]:
    """Return evaluations of the equations per simulated second, and the largest relative error of each kind of output.

    The reference is a run at the tightest tolerance. Residuals are left out.
    """

    def run(tolerance: float) -> Any:
        return simulate(
            case.parameters, case.inputs, initial=case.initial, stop_time=case.stop_time, step=case.step,
            tolerance=tolerance,
        )  # fmt: skip

    right, found = run(TOLERANCE_RANGE[0]), run(tolerance)
    units = output_units()
    errors = dict.fromkeys(KINDS, 0.0)
    for difference in compare(right, found).differences:
        for kind, own in KINDS.items():
            if units[difference.name] in own and not difference.name.endswith(".residual"):
                errors[kind] = max(errors[kind], difference.relative)
    return found.statistics["evaluations"] / case.stop_time, errors


def rows(mechanism: Mechanism) -> Iterator[list[float]]:
    """Yield a row of the table for each tolerance: the tolerance, then the largest work and errors of all standard cases."""
    for tolerance in TOLERANCES:
        cases = [measure_work_and_errors(case, tolerance) for case in standard_cases(mechanism).values()]
        worst = np.max([[work, *errors.values()] for work, errors in cases], axis=0)
        yield [tolerance, *(float(f"{value:.2g}") for value in worst)]


def stored_rows(mechanism: Mechanism) -> list[list[float]]:
    """Return the rows of a mechanism in `DATA`; an empty list if the mechanism is not there."""
    return json.loads(DATA.read_text(encoding="utf-8")).get(mechanism.name, [])


@cache
def default_rows(mechanism: Mechanism, reference: str) -> list[list[float]]:
    """Return the rows of the table for the default experiment of a mechanism, computed by the plant in plain Python.

    A tolerance has no row if the run with this tolerance ends early. ``reference`` is the text of the reference results as
    CSV: a heading, and columns with the time and all outputs except residuals.
    """
    heading, *lines = csv.reader(reference.splitlines())
    right = np.array(lines, dtype=float)
    time, right = right[:, 0], right[:, 1:]
    places = [mechanism.output_names.index(name) for name in heading[1:]]
    unit_of = {v.name: v.unit for v in mechanism.variables}
    units = np.array([unit_of[name] for name in heading[1:]])
    starts = {v.name: v.start for v in mechanism.variables}
    largest = dict(zip(heading[1:], np.abs(right).max(axis=0).tolist()))
    scale = np.array(list(output_scales(largest, unit_of).values()))
    found = []
    for tolerance in TOLERANCES:
        try:
            plant = Plant.from_values(mechanism, starts, tolerance=tolerance, time=time[0])
            values = [plant.outputs()]
            for now, end in pairwise(time):
                plant.step(now, end - now)
                values.append(plant.outputs())
        except LinkworkError:
            continue
        difference = np.abs(np.array(values)[:, places] - right)
        # angles of bodies jump by 2 pi
        angles = units == "rad"
        difference[:, angles] = np.abs(np.remainder(difference[:, angles] + pi, 2.0 * pi) - pi)
        worst = (difference / scale).max(axis=0)
        errors = [max(worst[np.isin(units, own)], default=0.0) for own in KINDS.values()]
        row = [plant.evaluations / (time[-1] - time[0]), *errors]
        found.append([tolerance, *(float(f"{value:.2g}") for value in row)])
    return found


def format_row(row: list[float]) -> list[str]:
    """Return the numbers of a row of the table as texts."""
    return [f"{row[0]:.0e}", f"{row[1]:.0f}", *(f"{value:.1e}" for value in row[2:])]


def to_html(mechanism: Mechanism, files: Mapping[str, bytes]) -> str:
    """Return the table as HTML for the page of an FMU; ``files`` are those of the FMU's `experiments`, by path."""
    rows, words = stored_rows(mechanism), STANDARD_CASES
    if not rows:
        rows, words = default_rows(mechanism, files[f"{EXPERIMENTS}/default-ref.csv"].decode()), DEFAULT
    head = "".join(f"<th>{html.escape(heading)}</th>" for heading in HEADINGS)
    body = ["<tr>" + "".join(f"<td>{cell}</td>" for cell in format_row(row)) + "</tr>" for row in rows]
    caption = CAPTION.format(*words)
    return "\n".join(["<h2>Accuracy</h2>", f"<p>{caption}</p>", "<table>", f"<tr>{head}</tr>", *body, "</table>", ""])


def main() -> None:
    """Compute the tables of all mechanisms and write them to `DATA`."""
    lines = (
        f' "{name}": [\n  ' + ",\n  ".join(map(json.dumps, rows(mechanism))) + "\n ]"
        for name, mechanism in MECHANISMS.items()
    )
    DATA.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
