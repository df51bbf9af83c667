"""A linkage that was found, written as a described linkage: it runs, becomes an FMU and moves in the studio."""

from __future__ import annotations

from cmath import rect
from math import pi, remainder, tau
from typing import Any

from linkwork.errors import InputError

from ...units import with_unit
from ..linkage.linkage import FiveBar, Linkage, SliderCrank
from ..linkage.machine import Make

_NAME = "found-linkage"


def description(linkage: Linkage, make: Make, *, rotation: float = 0.0, direction: float = 1.0) -> dict[str, Any]:
    """Return the table ``[linkage]`` with the description of a four-bar, a slider-crank or a geared five-bar.

    Parameters
    ----------
    linkage : Linkage
    make : Make
        Bars, gravity and the speed of the crank.
    rotation : float
        Rotation of the shaft at the start (rad).
    direction : float
        +1 or -1: sense in which the crank turns.

    Raises
    ------
    InputError
        If the rocker pivot moves by another rule than gears: it is the slider of a five-bar, or a crank of its own drive.
    """
    geared = isinstance(linkage, FiveBar) and not linkage.pivot.series.order
    if linkage.pivot is not None and not geared:
        raise InputError(
            f"the pivot of this {linkage.title} is driven: only linkages with a fixed or a geared pivot are described"
        )
    a1, shaft = linkage.ground_angle, complex(linkage.pivot_x, linkage.pivot_y)
    end = shaft + rect(linkage.ground_length, a1)
    bodies = {"crank": _bar("AB", linkage.crank_length, make, make.crank_mass)}
    bodies["coupler"] = _bar("BC", linkage.coupler_length, make, make.coupler_mass)
    if linkage.point_distance and not linkage.point_is_pin:
        point = rect(linkage.point_distance, linkage.point_angle)
        bodies["coupler"]["points"] = {"P": _place(point)}
    # not within a turn: gears would be at another tooth
    start = a1 + float(linkage.crank_angle(rotation))
    crank = {"joint": "A", "start": with_unit(start, "rad"), "speed": with_unit(direction * make.speed, "rad/s")}
    tables: dict[str, Any] = {
        "name": _NAME,
        "source": "found by synthesis",
        "gravity": with_unit(make.gravity, "m/s2"),
        "ground": {"A": _place(shaft), "E" if geared or isinstance(linkage, SliderCrank) else "D": _place(end)},
        "bodies": bodies,
        "freedoms": {"crank": crank},
        "assembly": {"C": linkage.branch},
    }
    if isinstance(linkage, SliderCrank):
        bodies["block"] = {"points": {"C": [0, 0]}, "mass": with_unit(make.block, "kg")}
        tables["slides"] = {"guide": {"body": "block", "through": "E", "direction": with_unit(a1 + 0.5 * pi, "rad")}}
    else:
        bodies["rocker"] = _bar("DC", linkage.rocker_length, make, make.rocker_mass)
    if isinstance(linkage, FiveBar):
        second = linkage.pivot
        bodies["second"] = _bar("ED", second.length, make, None)
        # where the first crank points along x
        phase = a1 + second.phase - second.ratio * (a1 + linkage.crank_phase)
        tables["gears"] = {
            "teeth": {
                "bodies": ["crank", "second"],
                "ratio": second.ratio,
                "phase": with_unit(remainder(phase, tau), "rad"),
            }
        }
    if any(make.load):
        tables["loads"] = ["P" if "points" in bodies["coupler"] else "C"]
    return tables


def _place(z: complex) -> list[Any]:
    """Return a point as a file has it; exact zeros stay zero."""
    return [0 if c == 0.0 else with_unit(c, "m") for c in (z.real, z.imag)]


def _bar(ends: str, length: float, make: Make, mass: float | None) -> dict[str, Any]:
    """Return a bar of the section of ``make``, weighed if its mass is given."""
    section = {"kind": "bar", "width": with_unit(make.width, "m"), "thickness": with_unit(make.thickness, "m")}
    table = {"bar": list(ends), "length": with_unit(length, "m"), "section": section | {"material": make.density}}
    return table if mass is None else table | {"mass": with_unit(mass, "kg")}
