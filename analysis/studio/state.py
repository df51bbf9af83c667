"""Convert cases to states of the page and back; make the opening state.

A state is a mapping with the mechanism, the title, the values in SI by FMI name, and the duration of a run (s).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from linkwork.errors import InputError, ParameterError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ..files import unknown_name
from ..mechanisms import FIVE_BAR, MECHANISMS, find_mechanism
from ..periodic import motor_parameters
from ..run import Case, InductionMotor, Inputs
from .tables import NO_MOTOR, fmi_starts, given_entries, published_values

#: Values that the opening state changes in the first published set of the five-bar: it has a coupler point.
OPENING = {"coupler.point_distance": 0.105, "coupler.point_angle": 0.55}


def opening_state() -> dict[str, Any]:
    """Return the state with which the page opens by default."""
    name, known = next(iter(FIVE_BAR.published.items()))
    return {
        "mechanism": FIVE_BAR.name,
        "title": f"{FIVE_BAR.title}, {name} with a coupler point",
        "values": published_values(FIVE_BAR, known) | OPENING,
    }


def page_state(case: Case) -> dict[str, Any]:
    """Return the state of the page for a case.

    Raises
    ------
    InputError
        If an input varies with time: the page has only constant inputs and a motor.
    """
    mechanism = find_mechanism(case.parameters)
    values = fmi_starts(mechanism, case.parameters, case.initial)
    values |= {name: float(value) for name, value in case.inputs.modes(mechanism).items()}
    for channel in (channel for channel in mechanism.channels if channel.kind != "rate"):
        parts = case.inputs.parts(channel.argument)
        motors = [part for part in parts if isinstance(part, InductionMotor)]
        others = [part for part in parts if part not in motors[:1]]
        for part in others:
            if not isinstance(part, (int, float, np.number)):
                raise InputError(
                    f"{channel.argument} is a {type(part).__name__}: the studio has only constant inputs, and one motor on "
                    "the crank; use linkwork run for this case"
                )
        values[channel.name] = float(sum(others))
        if motors:
            values |= {name: getattr(motors[0], field) for name, (field, _) in motor_parameters(mechanism).items()}
    return {"mechanism": mechanism.name, "title": case.title, "values": values, "duration": case.stop_time}


def page_case(state: Mapping[str, Any]) -> Case:
    """Return the case for a state of the page, which has only numbers and names, so that it cannot refer to a file.

    Raises
    ------
    UnknownNameError, ParameterError, InputError
        If the mechanism does not exist, has no variable of that name, or does not allow a value.
    """
    name = str(state.get("mechanism"))
    if name not in MECHANISMS:
        raise unknown_name(name, MECHANISMS, f"mechanism {name!r}")
    mechanism = MECHANISMS[name]
    values = given_values(mechanism, state.get("values"))
    whole = {v.name for v in mechanism.variables if v.kind == "Integer"}
    given = {name: int(value) if name in whole else value for name, value in values.items()}
    chosen = [mode.arguments[min(max(int(given[mode.name]), 0), len(mode.arguments) - 1)] for mode in mechanism.modes]
    others = {name for mode in mechanism.modes for name in mode.arguments} - set(chosen)
    channels: dict[str, Any] = {
        c.argument: given[c.name] for c in mechanism.channels if c.kind != "rate" and c.argument not in others
    }
    motor = {field: values[name] for name, (field, _) in motor_parameters(mechanism).items()}
    torque = next((c.argument for c in mechanism.channels if f"{c.name}.breakdown_torque" in values), None)
    if torque in channels and motor["breakdown_torque"] != 0.0:
        channels[torque] = (channels[torque], InductionMotor(**motor))
    return Case(
        title=str(state.get("title", "")),
        parameters=mechanism.parameters(**{field_name(n): given[n] for n in mechanism.mechanism_variables}),
        initial=mechanism.initial(**{n: given[v.name] for n, v in mechanism.initial_variables.items()}),
        inputs=Inputs(**dict.fromkeys(chosen, True) | channels),
        stop_time=_finite_number(state.get("duration", 1.0), "duration"),
    )


def given_values(mechanism: Mechanism, values: Any) -> dict[str, float]:
    """Return the values of all variables of a mechanism that the page can set, by FMI name.

    Variables that are not in ``values`` have their start values.

    Raises
    ------
    UnknownNameError, ParameterError, InputError
        If the mechanism has no variable of that name, or a value is not a finite number.
    """
    known = {entry.variable.name: float(entry.variable.start) for entry in given_entries(mechanism)}
    known |= {name: NO_MOTOR[field] for name, (field, _) in motor_parameters(mechanism).items()}
    if not isinstance(values, Mapping):
        raise InputError("a state has no values: it must have numbers by the names of the FMU's variables")
    for name in values:
        if name not in known:
            raise unknown_name(str(name), known)
    return {name: _finite_number(values.get(name, start), name) for name, start in known.items()}


def _finite_number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise ParameterError(name, value, "be a finite number")
    return float(value)
