"""Compute work and precision for several tolerances, and write them as a table in the documentation of each FMU.

``python -m analysis.export.accuracy`` rewrites `DATA` in some seconds; `tests/fmu/test_accuracy.py` checks that it is current.
"""

from __future__ import annotations

import html
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from linkwork.mechanism import Mechanism
from linkwork.plant import TOLERANCE_RANGE

from ..mechanisms import MECHANISMS, output_units
from ..run import Case, compare, simulate, standard_cases

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
    "Global error of the outputs on the standard cases, the largest of all cases and times, relative to the largest magnitude "
    "of the output in the case; an output that is small beside its like is compared with a thousandth of these. "
    "Evaluations of the equations are per second of simulated time, the most of all cases; shorter "
    "communication steps need more, and err less."
)


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
        for kind, of in KINDS.items():
            if units[difference.name] in of and not difference.name.endswith(".residual"):
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
    found: list[list[float]] = json.loads(DATA.read_text(encoding="utf-8")).get(mechanism.name, [])
    return found


def format_row(row: list[float]) -> list[str]:
    """Return the numbers of a row as they are printed."""
    return [f"{row[0]:.0e}", f"{row[1]:.0f}", *(f"{value:.1e}" for value in row[2:])]


def to_html(mechanism: Mechanism) -> str:
    """Return the table for the page of an FMU; an empty text for a mechanism without data."""
    body = [
        "<tr>" + "".join(f"<td>{cell}</td>" for cell in format_row(row)) + "</tr>" for row in stored_rows(mechanism)
    ]
    if not body:
        return ""
    head = "".join(f"<th>{html.escape(heading)}</th>" for heading in HEADINGS)
    return "\n".join(["<h2>Accuracy</h2>", f"<p>{CAPTION}</p>", "<table>", f"<tr>{head}</tr>", *body, "</table>", ""])


def main() -> None:
    """Compute the data of all mechanisms and write the file."""
    lines = (
        f' "{name}": [\n  ' + ",\n  ".join(map(json.dumps, rows(mechanism))) + "\n ]"
        for name, mechanism in MECHANISMS.items()
    )
    DATA.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
