"""What can vary of a mechanism and its drive, by FMI name; planes of two such parameters, for charts and grids."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from linkwork.errors import InputError, UnknownNameError
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import RAD_S_PER_RPM
from linkwork.five_bar.variables import INPUTS, PARAMETERS
from linkwork.parameters import field_name

from .orbits import Drive

#: A mechanism and what drives it.
Operation = tuple[FiveBarParameters, Drive]
#: The operation at a point of a chart.
Plane = Callable[[float, float], Operation]

#: Parameters of the drive that can vary, by FMI name.
OF_THE_DRIVE: Mapping[str, str] = {
    "drive.speed": "speed",
    "drive.torque": "torque",
    "slider.force": "slider_force",
    "load.fx": "load_x",
    "load.fy": "load_y",
}
#: Unit of each parameter that can vary.
UNITS_OF_VARIABLES = {
    variable.name: variable.unit
    for variable in (*INPUTS, *PARAMETERS)
    if variable.name in OF_THE_DRIVE
    or (field_name(variable.name) in FiveBarParameters.__dataclass_fields__ and variable.kind == "Real")
}


def require_variable(drive: Drive, name: str) -> None:
    """Check that a parameter of this name can vary in this drive.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If it does not act in this drive: a speed under a torque, a torque at prescribed speed.
    """
    unit_of(name)
    if name in ("drive.speed", "drive.torque") and (name == "drive.speed") != drive.speed_drive:
        raise InputError(f"{name} cannot vary: the drive is by {'speed' if drive.speed_drive else 'torque'}")


def unit_of(name: str) -> str:
    """Unit of a parameter or input by its FMI name.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    """
    if name not in UNITS_OF_VARIABLES:
        raise UnknownNameError(name, tuple(UNITS_OF_VARIABLES), None)
    return UNITS_OF_VARIABLES[name]


def format_value(name: str, value: float, unit: str) -> str:
    """A value with its name and unit; speeds in rpm too."""
    rpm = f" ({value / RAD_S_PER_RPM:.6g} rpm)" if unit == "rad/s" else ""
    return f"{name} = {value:.6g} {unit}".rstrip() + rpm


def with_values(
    parameters: FiveBarParameters, drive: Drive, values: Mapping[str, float]
) -> tuple[FiveBarParameters, Drive]:
    """Mechanism and drive with other values of parameters by their FMI names."""
    of_drive: dict[str, Any] = {OF_THE_DRIVE[name]: value for name, value in values.items() if name in OF_THE_DRIVE}
    of_mechanism: dict[str, Any] = {field_name(name): v for name, v in values.items() if name not in OF_THE_DRIVE}
    return (
        replace(parameters, **of_mechanism) if of_mechanism else parameters,
        replace(drive, **of_drive) if of_drive else drive,
    )


def plane(parameters: FiveBarParameters, drive: Drive, x: str, y: str) -> Plane:
    """The plane of two parameters; all else stays as it is.

    Parameters
    ----------
    parameters : FiveBarParameters
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
        require_variable(drive, name)

    def operation(first: float, second: float) -> Operation:
        return with_values(parameters, drive, {x: first, y: second})

    return operation
