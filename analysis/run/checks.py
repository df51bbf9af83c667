"""Check FMUs against the in-process solver on standard cases; each mechanism has its own standard cases."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from linkwork.errors import InputError
from linkwork.mechanism import Mechanism

from ..mechanisms import OfAll
from .case_files import Case, published_case, read_case
from .cosimulation import Comparison, compare, cosimulate
from .simulation import simulate
from .trajectory import Trajectory

#: Interfaces that can be compared with a run in process.
CHECKED = ("co-simulation", "model-exchange")


@cache
def standard_cases(mechanism: Mechanism) -> Mapping[str, Case]:
    """Return the standard cases of a mechanism by name; if it has none, the case of its first published set."""
    if not mechanism.cases:
        name = next(iter(mechanism.published))
        return {name: published_case(name)}
    return {name: read_case(tables, folder=Path()) for name, tables in mechanism.cases.items()}


#: Standard cases by name; they cover all ways of driving and loading the mechanisms.
CASES: Mapping[str, Case] = OfAll("standard cases", standard_cases)


def check(
    fmu: str | Path,
    case: Case,
    *,
    interface: str = "co-simulation",
    method: str = "compiled",
    tolerance: float = 1e-6,
    progress: bool = False,
) -> tuple[Trajectory, Trajectory, Comparison]:
    """Run a case in process and through an FMU, with the same inputs, and compare every output.

    In co-simulation both runs hold the inputs, and the compiled solver takes the same steps as the FMU's solver: the results
    may agree to the last bit, and a difference shows a fault of packaging or interfaces. With a method of SciPy or Hamming's
    method the integrators are independent too. In model exchange CVode integrates the FMU with a hundredth of the case's
    tolerance, and the run in process has a ten-thousandth of it: where friction reverses, the error of a run may be thousands
    of times its tolerance.

    Returns
    -------
    in_process, through_fmu : Trajectory
    comparison : Comparison

    Raises
    ------
    InputError
        If ``interface`` is not one of `CHECKED`.
    LinkworkError
        As for `simulate` and `cosimulate`.
    """
    if interface not in CHECKED:
        raise InputError(f"interface is {interface!r}: it must be {' or '.join(CHECKED)}")
    held = interface == "co-simulation"
    common: dict[str, Any] = {"initial": case.initial, "stop_time": case.stop_time, "step": case.step}
    common["progress"] = progress
    own, others = (case.tolerance if held else max(share * case.tolerance, 1e-13) for share in (1e-4, 0.01))
    in_process = simulate(
        case.parameters, case.inputs, hold=case.step if held else None, method=method, tolerance=own, **common
    )
    through_fmu = cosimulate(fmu, case.parameters, case.inputs, interface=interface, tolerance=others, **common)
    return in_process, through_fmu, compare(in_process, through_fmu, tolerance=tolerance)
