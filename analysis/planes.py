"""Planes of two parameters of a mechanism and its drive: what charts and grids are made over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from linkwork.errors import InputError, UnknownNameError
from linkwork.five_bar.parameters import FiveBarParameters, field_name, fmi_name

from .branches import OF_THE_DRIVE
from .orbits import Drive

#: A mechanism and what drives it.
Operation = tuple[FiveBarParameters, Drive]
#: The operation at a point of a chart.
Plane = Callable[[float, float], Operation]


def plane(parameters: FiveBarParameters, drive: Drive, x: str, y: str) -> Plane:
    """The plane of two parameters, all else as given.

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
        require_axis(drive, name)

    def operation(first: float, second: float) -> Operation:
        of_drive: dict[str, Any] = {}
        of_mechanism: dict[str, Any] = {}
        for name, value in ((x, first), (y, second)):
            if name in OF_THE_DRIVE:
                of_drive[OF_THE_DRIVE[name]] = value
            else:
                of_mechanism[field_name(name)] = value
        return replace(parameters, **of_mechanism), replace(drive, **of_drive)

    return operation


def require_axis(drive: Drive, name: str) -> None:
    """Raise an error for a parameter that is none, or does not act in this drive; see `plane`."""
    known = tuple(fmi_name(field) for field in FiveBarParameters.__dataclass_fields__ if field != "assembly_branch")
    if name not in OF_THE_DRIVE and name not in known:
        raise UnknownNameError(name, (*OF_THE_DRIVE, *known), None)
    if name in ("drive.speed", "drive.torque") and (name == "drive.speed") != drive.speed_drive:
        raise InputError(f"{name} cannot be an axis: the drive is by {'speed' if drive.speed_drive else 'torque'}")
