"""Jobs of the studio: each takes the case of the page and options, and returns an answer for the page to show.

A request has numbers and names; no text of a request is used as a file path. An answer may have: ``words``; a ``table`` of
texts in display units, with ``files`` for each row; for each row of the table also ``pictures``, ``states`` of the page, and
``curves`` in the plane of the mechanism; ``charts``; ``outputs`` of a run of the first state; ``files`` for the browser to
save.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from linkwork.errors import InputError

from ..export import KINDS, NATIVE, PLATFORMS, PYTHON, build_native, this_platform, with_starts
from ..files import Choice, Many, Quantity, Whole, entry, flag, read, text
from ..mechanisms import find_mechanism
from ..periodic import motor_parameters, steady_drive
from ..run import Case, cosimulate
from ..studio import given_values, page_case, page_state, shown_unit
from ..tuning import Wish, tune
from .answers import Answer, file, folder
from .paths import Linkages, Moved, linkages, moved

#: Greatest number of rows of a run through the FMU.
_ROWS = 5000


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tuning:
    """Options of tuning.

    The range of speeds (rad/s), the parameters that may change, the largest relative change of a parameter, and the faults that
    the range must not contain.
    """

    speeds: tuple[float, float] = entry(Many(Quantity("rad/s", above=0.0), length=2))
    change: tuple[str, ...] = entry(Many(text, least=1))
    share: float = entry(Quantity("1", above=0.0))
    no_resonance: bool = entry(flag, True)
    no_jump: bool = entry(flag, False)
    no_unstable: bool = entry(flag, False)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """Options of a run of the FMU: number of equal steps, each of which gives a row of outputs."""

    rows: int = entry(Whole(1))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Export:
    """Options of an export: kind of native FMU, and whether it is for all platforms or only for this one."""

    kind: str = entry(Choice([name for name, kind in KINDS.items() if kind is not PYTHON]), "native")
    everywhere: bool = entry(flag, False)


def do(kind: str, request: Mapping[str, Any]) -> Answer:
    """Run a job of `JOBS` with the entries ``state`` and ``wanted`` (options) of a request, and return its answer."""
    wanted, work = JOBS[kind]
    state = request.get("state")
    if not isinstance(state, Mapping):
        raise InputError("a request has no state: it must have that of the page")
    return work(page_case(state), read(wanted, request.get("wanted", {}), ""))


def _tuned(case: Case, wanted: _Tuning) -> Answer:
    """Find the least change of parameters that meets the options; return a table and the changed state of the page."""
    low, high = wanted.speeds
    wish = Wish(
        parameters=case.parameters,
        drive=steady_drive(case.parameters, case.inputs, case.initial, speed=low),
        speeds=(low, high),
        change=dict.fromkeys(wanted.change, f"{100.0 * wanted.share!r} %"),
        no_resonance=wanted.no_resonance,
        no_jump=wanted.no_jump,
        no_unstable=wanted.no_unstable,
    )
    tuned = tune(wish)
    mechanism = find_mechanism(case.parameters)
    rows = []
    variables = {variable.name: variable for variable in mechanism.variables}
    for name, before, after in zip(wish.names, wish.present.tolist(), tuned.values.tolist()):
        unit, factor = shown_unit(variables[name])
        called = name.replace(".", " ").replace("_", " ")
        change = f"{100.0 * (after / before - 1.0):+.3g} %"
        rows.append(
            [f"{called} [{unit}]" if unit else called, f"{factor * before:.5g}", f"{factor * after:.5g}", change]
        )
    rows += [[r.name, r.before.text, r.after.text, "met" if r.met else "not met"] for r in tuned.requirements]
    title = f"{case.title}, tuned"
    changed = page_state(replace(case, title=title, parameters=tuned.parameters))
    words = f"Verified: {tuned.verification}." if tuned.met else " ".join(f"{sentence}." for sentence in tuned.missed)
    table = {"headings": ["what", "before", "after", "change"], "rows": rows}
    return {"words": words, "table": table, "states": [changed], "met": tuned.met}


def _run(case: Case, wanted: _Run) -> Answer:
    """Run the native FMU and return its outputs at the samples of the page."""
    if wanted.rows > _ROWS:
        raise InputError(f"{wanted.rows} rows are more than {_ROWS}: ask for fewer")
    mechanism = find_mechanism(case.parameters)
    with folder() as place:
        fmu = build_native(mechanism, NATIVE, place)
        run = cosimulate(
            fmu,
            case.parameters,
            case.inputs,
            initial=case.initial,
            stop_time=case.stop_time,
            step=case.stop_time / wanted.rows,
            tolerance=1e-10,
            # a motor follows the speed within a step
            interface="co-simulation" if case.inputs.held_exactly else "model-exchange",
        )
    words = f"{run.source}, run by FMPy, beside the page's own run" + (
        f"; it ended early: {run.message}" if run.status else ""
    )
    return {
        "words": f"{words}.",
        "states": [page_state(case)],
        "time": run.time.tolist(),
        "outputs": {name: run[name].tolist() for name in run.names},
    }


def _exported(case: Case, wanted: _Export) -> Answer:
    """Build a native FMU with the values of the page as start values."""
    mechanism = find_mechanism(case.parameters)
    values = given_values(mechanism, page_state(case)["values"])
    motor = motor_parameters(mechanism)
    if any(values[name] != 0.0 for name, (field, _) in motor.items() if field == "breakdown_torque"):
        raise InputError(
            "an FMU has no motor: remove the motor, and connect one to the FMU's torque in the system that contains the FMU"
        )
    values = {name: value for name, value in values.items() if name not in motor}
    platforms = tuple(PLATFORMS) if wanted.everywhere else None
    with folder() as place:
        made = build_native(with_starts(mechanism, values), KINDS[wanted.kind], place, platforms)
        hint = f"It runs on {', '.join(PLATFORMS)}." if platforms else f"It runs on {this_platform()} alone."
        return {"words": f"{made.name} starts with the values of the page. {hint}", "files": [file(made)]}


#: For each kind of job the class of its options, and the function that does it.
JOBS: dict[str, tuple[type, Callable[[Case, Any], Answer]]] = {
    "linkages": (Linkages, linkages),
    "slider": (Moved, moved),
    "tune": (_Tuning, _tuned),
    "run": (_Run, _run),
    "export": (_Export, _exported),
}
