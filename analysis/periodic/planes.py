"""Planes of two parameters of a mechanism and its drive: what charts and grids are made over."""

from __future__ import annotations

from collections.abc import Callable

from linkwork.errors import InputError, UnknownNameError
from linkwork.five_bar.parameters import FiveBarParameters

from .branches import UNITS_OF_VARIABLES, require_drive, with_values
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
        return with_values(parameters, drive, {x: first, y: second})

    return operation


def require_axis(drive: Drive, name: str) -> None:
    """Raise an error for a parameter that is none, or does not act in this drive; see `plane`."""
    if name not in UNITS_OF_VARIABLES:
        raise UnknownNameError(name, tuple(UNITS_OF_VARIABLES), None)
    require_drive(drive, name)
