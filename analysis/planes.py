"""Planes of two parameters, the crank speed among them: what charts and grids are made over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from linkwork.errors import InputError, UnknownNameError
from linkwork.five_bar.parameters import FiveBarParameters, field_name, fmi_name

#: Names under which the crank speed (rad/s) is an axis.
SPEED_NAMES = ("speed", "drive.speed")

#: A mechanism and its crank speed (rad/s).
Operation = tuple[FiveBarParameters, float]
#: The operation at a point of a chart.
Plane = Callable[[float, float], Operation]


def plane(parameters: FiveBarParameters, speed: float, x: str, y: str) -> Plane:
    """The plane of two parameters, all else as given.

    Parameters
    ----------
    parameters : FiveBarParameters
    speed : float
        Crank speed (rad/s).
    x, y : str
        Parameters by their names in the FMI contract or as fields, or ``"speed"``; in SI.

    Raises
    ------
    UnknownNameError
        If there is no parameter of that name.
    InputError
        If both axes are the same.
    """
    fields = [_axis(name) for name in (x, y)]
    if fields[0] == fields[1]:
        raise InputError(f"both axes are {x!r}: a chart needs two parameters")

    def operation(first: float, second: float) -> Operation:
        values: dict[str, Any] = dict(zip(fields, (first, second)))
        own_speed = float(values.pop("speed", speed))
        return replace(parameters, **values), own_speed

    return operation


def _axis(name: str) -> str:
    if name in SPEED_NAMES:
        return "speed"
    field = field_name(name) if "." in name else name
    known = tuple(k for k in FiveBarParameters.__dataclass_fields__ if k != "assembly_branch")
    if field not in known:
        raise UnknownNameError(name, ("speed", *map(fmi_name, known)), None)
    return field
