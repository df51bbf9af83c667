"""What can vary of a mechanism and its drive, by FMI name; planes of two such parameters, for charts and grids."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any

import numpy as np

from linkwork.errors import InputError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ..files import unknown_name
from ..mechanisms import Parameters, mechanism_of
from ..run import takes_published
from ..units import RAD_S_PER_RPM
from .drives import Drive, forces_of, require_acting
from .flows import crank_of

#: A mechanism and what drives it.
Operation = tuple[Parameters, Drive]
#: The operation at a point of a chart.
Plane = Callable[[float, float], Operation]


@cache
def _of_the_crank(mechanism: Mechanism) -> dict[str, str]:
    """FMI names of the crank's speed and torque: what of `Drive` each is."""
    crank = crank_of(mechanism)
    numbers = {"torque": crank.torque, "speed": crank.command}
    return {mechanism.channels[n].name: what for what, n in numbers.items() if n is not None}


@cache
def of_the_motor(mechanism: Mechanism) -> dict[str, tuple[str, str]]:
    """Names of what a motor on the crank has, in the order of `Drive.vector`: field and unit of each."""
    units = {"breakdown_torque": "N.m", "breakdown_slip": "1", "synchronous_speed": "rad/s"}
    torques = [name for name, what in _of_the_crank(mechanism).items() if what == "torque"]
    return {f"{name}.{field}": (field, unit) for name in torques for field, unit in units.items()}


def driving_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of what can vary of a drive: the crank's speed and torque, what a motor has, and forces."""
    return (*_of_the_crank(mechanism), *of_the_motor(mechanism), *forces_of(mechanism))


def speed_name(mechanism: Mechanism) -> str | None:
    """FMI name of the crank's prescribed speed, such as ``drive.speed``; None where it cannot be prescribed."""
    return next((name for name, what in _of_the_crank(mechanism).items() if what == "speed"), None)


@takes_published()
def require_variable(parameters: Parameters, drive: Drive, name: str) -> None:
    """Check that a parameter of this name can vary in this drive.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If it does not act in this drive: a speed under a torque, a torque at prescribed speed, a motor's where there is none.
    """
    mechanism = mechanism_of(parameters)
    unit_of(mechanism, name)
    what = _of_the_crank(mechanism).get(name)
    if what is not None and (what == "speed") != drive.speed_drive:
        raise InputError(f"{name} cannot vary: the drive is by {'speed' if drive.speed_drive else 'torque'}")
    if name in of_the_motor(mechanism) and drive.motor is None:
        raise InputError(f"{name} cannot vary: no motor drives the crank")
    if name in forces_of(mechanism):
        require_acting(drive, mechanism, forces_of(mechanism)[name])


def variable_names(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of what can vary of a mechanism and its drive: see `driving_names`; and parameters."""
    of_mechanism = [v.name for v in mechanism.mechanism_variables.values() if v.kind == "Real"]
    return (*driving_names(mechanism), *of_mechanism)


def unit_of(mechanism: Mechanism, name: str) -> str:
    """Unit of what can vary of a mechanism and its drive, by its FMI name.

    Raises
    ------
    UnknownNameError
        If there is no such thing.
    """
    names = variable_names(mechanism)
    if name not in names:
        raise unknown_name(name, names)
    if name in of_the_motor(mechanism):
        return of_the_motor(mechanism)[name][1]
    return next(v.unit for v in mechanism.variables if v.name == name)


@takes_published()
def value_of(parameters: Parameters, drive: Drive, name: str) -> float:
    """The value there is of what can vary; NaN of a speed under a torque, or of a motor that there is not."""
    mechanism = mechanism_of(parameters)
    what = _of_the_crank(mechanism).get(name)
    if what is not None:
        value = getattr(drive, what)
        return float("nan") if value is None else float(value)
    if name in of_the_motor(mechanism):
        return float(getattr(drive.motor, of_the_motor(mechanism)[name][0], np.nan))
    if name in forces_of(mechanism):
        return float(drive.forces.get(name, 0.0))
    return float(getattr(parameters, field_name(name)))


def format_value(name: str, value: float, unit: str) -> str:
    """A value with its name and unit; speeds in rpm too."""
    rpm = f" ({value / RAD_S_PER_RPM:.6g} rpm)" if unit == "rad/s" else ""
    return f"{name} = {value:.6g} {unit}".rstrip() + rpm


@lru_cache(maxsize=64)
def _replaced(parameters: Parameters, *values: tuple[str, float]) -> Parameters:
    """Parameters with others of these values; a row of a chart over the speed has one mechanism."""
    return replace(parameters, **dict(values))


@takes_published()
def with_values(parameters: Parameters, drive: Drive, values: Mapping[str, float]) -> Operation:
    """Mechanism and drive with other values of parameters by their FMI names."""
    mechanism = mechanism_of(parameters)
    of_crank, of_motor, forces = _of_the_crank(mechanism), of_the_motor(mechanism), forces_of(mechanism)
    of_drive: dict[str, Any] = {of_crank[name]: value for name, value in values.items() if name in of_crank}
    acting = {name: value for name, value in values.items() if name in forces}
    driving = {of_motor[name][0]: value for name, value in values.items() if name in of_motor}
    of_mechanism = {field_name(n): v for n, v in values.items() if n not in {*of_crank, *of_motor, *forces}}
    if acting:
        of_drive["forces"] = {**drive.forces, **acting}
    if driving and drive.motor is not None:
        of_drive["motor"] = replace(drive.motor, **driving)
    return (
        _replaced(parameters, *of_mechanism.items()) if of_mechanism else parameters,
        replace(drive, **of_drive) if of_drive else drive,
    )


@takes_published()
def plane(parameters: Parameters, drive: Drive, x: str, y: str) -> Plane:
    """The plane of two parameters; all else stays as it is.

    Parameters
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    x, y : str
        Parameters of mechanism or drive by their names in the FMI contract, such as ``slider.damping``, ``drive.speed`` or
        ``slider.force``; in SI.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If both axes are the same, or one does not act in this drive.
    """
    if x == y:
        raise InputError(f"both axes are {x!r}: a chart needs two parameters")
    for name in (x, y):
        require_variable(parameters, drive, name)

    def operation(first: float, second: float) -> Operation:
        return with_values(parameters, drive, {x: first, y: second})

    return operation
