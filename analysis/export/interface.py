"""The variables of a native FMU: those of the mechanism's table, and further ones for model exchange.

The mechanism's variables come first, in their order, so that the value reference of each is the same in every kind of FMU.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import NamedTuple

from linkwork.errors import LinkworkError
from linkwork.limits import LIMIT_SINE
from linkwork.mechanism import Mechanism
from linkwork.variables import UNITS, Variable

from ..files import unknown_name

#: Name of the event indicator.
MARGIN = "assembly.margin_to_limit"
#: The last two components of the state: name, name of the derivative, and descriptions of both.
WORKS = (
    ("energy.dissipated", "power.dissipated", "Work lost since the start", "Power lost"),
    ("energy.supplied", "power.supplied", "Work of drives and loads since the start", "Power of drives and loads"),
)


class Entry(NamedTuple):
    """A variable of an FMU.

    Attributes
    ----------
    variable : Variable
        Its causality may also be ``independent``.
    reference : int
        Value reference, which is the index among the entries, from 0. The index of FMI 2.0 is greater by one.
    derivative_of : int or None
        Value reference of the variable whose time derivative this variable is.
    role : str
        Where the value comes from: ``parameter`` (a field of the mechanism's parameters), ``mode``, ``initial`` (a field of
        the state at the start), ``tolerance``, ``input`` (a channel), ``output`` (a component of ``equations.outputs``),
        ``status``, ``time``, ``state`` (a component of the state that is no output), ``derivative`` (a component of
        ``equations.derivative`` that is no output) or ``indicator``.
    """

    variable: Variable
    reference: int
    derivative_of: int | None
    role: str


def with_starts(mechanism: Mechanism, values: Mapping[str, float]) -> Mechanism:
    """Return a mechanism with other start ``values`` by FMI name; `build_native` then builds an FMU with these values.

    Raises
    ------
    UnknownNameError
        If the mechanism has no such parameter or input.
    """
    known = [v.name for v in mechanism.variables if v.causality in ("parameter", "input")]
    for name in values:
        if name not in known:
            raise unknown_name(name, known)
    return replace(
        mechanism,
        variables=tuple(
            v._replace(start=type(v.start)(values[v.name])) if v.name in values else v for v in mechanism.variables
        ),
    )


@cache
def interface(mechanism: Mechanism) -> tuple[Entry, ...]:
    """Return all variables of a native FMU of the mechanism, in the order of their value references."""
    table = [*((v, _role(mechanism, v)) for v in mechanism.variables), *_additions(mechanism)]
    reference = {variable.name: number for number, (variable, _) in enumerate(table)}
    return tuple(
        Entry(variable, number, reference[variable.rate_of] if variable.rate_of else None, role)
        for number, (variable, role) in enumerate(table)
    )


def states(mechanism: Mechanism) -> tuple[int, ...]:
    """Return the value references of the components of the state, in their order."""
    reference = {entry.variable.name: entry.reference for entry in interface(mechanism)}
    return tuple(reference[name] for name in _state_names(mechanism))


def derivatives(mechanism: Mechanism) -> tuple[int, ...]:
    """Return the value references of the time derivatives of the components of the state, in their order."""
    derivative = {entry.derivative_of: entry.reference for entry in interface(mechanism)}
    return tuple(derivative[reference] for reference in states(mechanism))


def indicator(mechanism: Mechanism) -> int:
    """Return the value reference of the event indicator."""
    return next(entry.reference for entry in interface(mechanism) if entry.role == "indicator")


def _state_names(mechanism: Mechanism) -> list[str]:
    freedoms = mechanism.freedoms
    return [*(f.coordinate for f in freedoms), *(f.rate for f in freedoms), *(work for work, *_ in WORKS)]


def _role(mechanism: Mechanism, variable: Variable) -> str:
    if variable.causality != "parameter":
        return "status" if variable.causality == "local" else variable.causality
    if variable.name == "solver.tolerance":
        return "tolerance"
    if variable.name in (mode.name for mode in mechanism.modes):
        return "mode"
    return "initial" if variable.name.startswith("initial.") else "parameter"


def _additions(mechanism: Mechanism) -> list[tuple[Variable, str]]:
    """Return the variables that a native FMU has in addition to those of the mechanism, each with its role."""
    units = {v.name: v.unit for v in mechanism.variables}
    differentiated = {v.rate_of for v in mechanism.variables}
    added = [(Variable("time", "independent", "s", "Time"), "time")]
    added += [(Variable(work, "local", "J", text), "state") for work, _, text, _ in WORKS if work not in units]
    rates = [(work, power, text) for work, power, _, text in WORKS]
    rates += [(f.rate, f"der({f.rate})", f"Time derivative of {f.rate}") for f in mechanism.freedoms]
    added += [
        (Variable(name, "local", _unit_of_rate(units.get(variable, "J")), text, rate_of=variable), "derivative")
        for variable, name, text in rates
        if variable not in differentiated
    ]
    text = (
        f"Event indicator: the sine that measures how far the links are from the limit of assembly, less {LIMIT_SINE:g}; "
        "a motion is followed while it is positive"
    )
    return [*added, (Variable(MARGIN, "local", "1", text), "indicator")]


def _unit_of_rate(unit: str) -> str:
    """Return the unit of the time derivative of a variable in ``unit``."""
    base = UNITS[unit]
    wanted = base._replace(s=base.s - 1, displays=())
    for name, candidate in UNITS.items():
        if candidate._replace(displays=()) == wanted:
            return name
    raise LinkworkError(f"there is no unit for the time derivative of a variable in {unit}: add it to UNITS")
