"""What the page opens with: a case, a published set, or a mechanism that shows what there is to see."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from linkwork.errors import InputError, ParameterError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ..files import unknown_name
from ..mechanisms import FIVE_BAR, MECHANISMS, mechanism_of
from ..periodic import of_the_motor
from ..run import Case, InductionMotor, Inputs
from .tables import NO_MOTOR, given_entries, published_values, values_of

#: What is changed in the first published set of the mechanism that the page opens with: a coupler point.
OPENING = {"coupler.point_distance": 0.105, "coupler.point_angle": 0.55}


def opening_state() -> dict[str, Any]:
    """Return the state with which the page opens by default."""
    name, known = next(iter(FIVE_BAR.published.items()))
    return {
        "mechanism": FIVE_BAR.name,
        "title": f"{FIVE_BAR.title}, {name} with a coupler point",
        "values": published_values(FIVE_BAR, known) | OPENING,
    }


def state_of(case: Case) -> dict[str, Any]:
    """Return the state of the page for a case.

    Raises
    ------
    InputError
        If an input varies: the page has constant ones, and a motor.
    """
    mechanism = mechanism_of(case.parameters)
    values = values_of(mechanism, case.parameters, case.initial)
    values |= {name: float(value) for name, value in case.inputs.modes(mechanism).items()}
    for channel in (channel for channel in mechanism.channels if channel.kind != "rate"):
        parts = case.inputs.parts(channel.argument)
        motors = [part for part in parts if isinstance(part, InductionMotor)]
        others = [part for part in parts if part not in motors[:1]]
        for part in others:
            if not isinstance(part, (int, float, np.number)):
                raise InputError(
                    f"{channel.argument} is a {type(part).__name__}: the studio has inputs that are constant, and one motor on "
                    "the crank; linkwork run takes the case as it is"
                )
        values[channel.name] = float(sum(others))
        if motors:
            values |= {name: getattr(motors[0], field) for name, (field, _) in of_the_motor(mechanism).items()}
    return {"mechanism": mechanism.name, "title": case.title, "values": values, "duration": case.stop_time}


def case_of(state: Mapping[str, Any]) -> Case:
    """Return the case for a state of the page; a state has numbers and names alone, so that a page can name no file.

    Raises
    ------
    UnknownNameError, ParameterError, InputError
        If there is no such mechanism, it has no such value, or a value is not one that it can have.
    """
    name = str(state.get("mechanism"))
    if name not in MECHANISMS:
        raise unknown_name(name, MECHANISMS, f"mechanism {name!r}")
    mechanism = MECHANISMS[name]
    values = given_values(mechanism, state.get("values"))
    whole = {v.name for v in mechanism.variables if v.kind == "Integer"}
    of = {name: int(value) if name in whole else value for name, value in values.items()}
    chosen = [mode.arguments[min(max(int(of[mode.name]), 0), len(mode.arguments) - 1)] for mode in mechanism.modes]
    others = {name for mode in mechanism.modes for name in mode.arguments} - set(chosen)
    channels: dict[str, Any] = {
        c.argument: of[c.name] for c in mechanism.channels if c.kind != "rate" and c.argument not in others
    }
    motor = {field: values[name] for name, (field, _) in of_the_motor(mechanism).items()}
    torque = next((c.argument for c in mechanism.channels if f"{c.name}.breakdown_torque" in values), None)
    if torque in channels and motor["breakdown_torque"] != 0.0:
        channels[torque] = (channels[torque], InductionMotor(**motor))
    return Case(
        title=str(state.get("title", "")),
        parameters=mechanism.parameters(**{field_name(n): of[n] for n in mechanism.mechanism_variables}),
        initial=mechanism.initial(**{n: of[v.name] for n, v in mechanism.initial_variables.items()}),
        inputs=Inputs(**dict.fromkeys(chosen, True) | channels),
        stop_time=_number(state.get("duration", 1.0), "duration"),
    )


def given_values(mechanism: Mechanism, values: Any) -> dict[str, float]:
    """Return the values that the page gives a mechanism by FMI name, with start values for the others.

    Raises
    ------
    UnknownNameError, ParameterError, InputError
        If the mechanism has no such value, or it is no finite number.
    """
    known = _given(mechanism)
    if not isinstance(values, Mapping):
        raise InputError("a state has no values: it must have numbers by the names of the FMU's variables")
    for name in values:
        if name not in known:
            raise unknown_name(str(name), known)
    return {name: _number(values.get(name, start), name) for name, start in known.items()}


def _given(mechanism: Mechanism) -> dict[str, float]:
    """Start values of all that the page gives a mechanism, a motor included."""
    given = (entry.variable for entry in given_entries(mechanism))
    motor = {name: NO_MOTOR[field] for name, (field, _) in of_the_motor(mechanism).items()}
    return {v.name: float(v.start) for v in given} | motor


def _number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise ParameterError(name, value, "be a finite number")
    return float(value)
