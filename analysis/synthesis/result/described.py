"""Write a solution as a described linkage, which can be simulated, exported as an FMU and shown in the studio."""

from __future__ import annotations

from cmath import rect
from math import pi, remainder, tau
from typing import Any

import numpy as np

from ...units import with_unit
from ..linkage.linkage import Linkage, SliderCrank
from ..linkage.machine import Make
from ..linkage.pivot import SecondCrank, SliderMotion

_NAME = "found-linkage"


def description(linkage: Linkage, make: Make, *, rotation: float = 0.0, direction: float = 1.0) -> dict[str, Any]:
    """Return the table ``[linkage]`` with the description of a four-bar, a slider-crank or a five-bar.

    A rocker pivot that moves on a guide, or on a crank without gears, is a second freedom: `drives` gives the speeds of both.

    Parameters
    ----------
    linkage : Linkage
    make : Make
        Bars, gravity and the speed of the crank.
    rotation : float
        Rotation of the input shaft at the start (rad).
    direction : float
        +1 or -1: sense in which the crank turns.
    """
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
        "ground": {"A": _place(shaft), "E" if linkage.pivot or isinstance(linkage, SliderCrank) else "D": _place(end)},
        "bodies": bodies,
        "freedoms": {"crank": crank},
        "assembly": {"C": linkage.branch},
    }
    if isinstance(linkage, SliderCrank):
        bodies["block"] = {"points": {"C": [0, 0]}, "mass": with_unit(make.block, "kg")}
        tables["slides"] = {"guide": {"body": "block", "through": "E", "direction": with_unit(a1 + 0.5 * pi, "rad")}}
    else:
        bodies["rocker"] = _bar("DC", linkage.rocker_length, make, make.rocker_mass)
    second = linkage.pivot
    if isinstance(second, SliderMotion):
        along = with_unit(a1 + second.guide_angle, "rad")
        bodies["block"] = {"points": {"D": [0, 0]}, "mass": with_unit(make.block, "kg")}
        tables["slides"] = {"guide": {"body": "block", "through": "E", "direction": along}}
        position = with_unit(float(second.series(rotation)), "m")
        tables["freedoms"]["pivot"] = {"joint": "guide", "start": position, "driven": True}
    elif second is not None:
        bodies["second"] = _bar("ED", second.length, make, None)
    if isinstance(second, SecondCrank) and second.series.order:
        angle = with_unit(a1 + float(second.angle(rotation)), "rad")
        tables["freedoms"]["pivot"] = {"joint": "E", "start": angle, "driven": True}
    elif isinstance(second, SecondCrank):
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


def drives(linkage: Linkage, make: Make, *, rotation: float = 0.0, direction: float = 1.0) -> dict[str, Any]:
    """Return the tables of the drives of a linkage whose rocker pivot is a freedom: the speeds of crank and pivot in time.

    The arguments are those of `description`. For other linkages the result is empty: the description has the crank speed.
    """
    pivot = linkage.pivot
    if pivot is None or not pivot.series.order:
        return {}
    speed = direction * make.speed
    rate = speed / linkage.turns
    slope, unit = pivot.series.derivative(), "m/s" if isinstance(pivot, SliderMotion) else "rad/s"
    k = np.arange(1, slope.order + 1)
    waves = {
        "kind": "harmonics",
        "amplitudes": [with_unit(rate * a, unit) for a in slope.amplitudes[1:]],
        "frequencies": [with_unit(w, "rad/s") for w in rate * k],
        "phases": [with_unit(a, "rad") for a in k * rotation - np.arctan2(slope.sin, slope.cos)[1:]],
    }
    if isinstance(pivot, SecondCrank):
        waves["mean"] = with_unit(speed * pivot.ratio, unit)
    return {"crankDrive": {"speed": with_unit(speed, "rad/s")}, "pivotDrive": {"speed": waves}}


def _place(z: complex) -> list[Any]:
    """Return a point in the form of a file; exact zeros stay the number 0."""
    return [0 if c == 0.0 else with_unit(c, "m") for c in (z.real, z.imag)]


def _bar(ends: str, length: float, make: Make, mass: float | None) -> dict[str, Any]:
    """Return the table of a bar with the section of ``make``, and its mass if it is given."""
    section = {"kind": "bar", "width": with_unit(make.width, "m"), "thickness": with_unit(make.thickness, "m")}
    table = {"bar": list(ends), "length": with_unit(length, "m"), "section": section | {"material": make.density}}
    return table if mass is None else table | {"mass": with_unit(mass, "kg")}
