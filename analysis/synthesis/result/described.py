"""Write a linkage as tables of a case file, from which it can be simulated, exported as an FMU and shown in the studio."""

from __future__ import annotations

from cmath import rect
from math import pi, remainder, tau
from typing import Any

import numpy as np

from ...units import with_unit
from ..linkage import linkage as geometry
from ..linkage.linkage import Linkage, SliderCrank, is_on_line
from ..linkage.machine import MachineSpec
from ..linkage.pivot import SecondCrank, SliderMotion

_NAME = "found-linkage"


def description(
    linkage: Linkage, make: MachineSpec, *, rotation: float = 0.0, direction: float = 1.0
) -> dict[str, Any]:
    """Return the table ``[linkage]`` with the description of a four-bar, a slider-crank or a five-bar.

    A rocker pivot that moves on a guide, or on a crank without gears, is a second degree of freedom. For such a linkage
    `drives` returns the speeds of crank and pivot.

    Parameters
    ----------
    linkage : Linkage
    make : MachineSpec
        Bars, gravity and the speed of the crank.
    rotation : float
        Rotation of the input shaft at the start (rad).
    direction : float
        Sense in which the crank turns: +1 counter-clockwise, -1 clockwise.
    """
    a1, shaft = linkage.ground_angle, complex(linkage.pivot_x, linkage.pivot_y)
    end = shaft + rect(linkage.ground_length, a1)
    bodies = {"crank": _bar_table("AB", linkage.crank_length, make, make.crank_mass)}
    bodies["coupler"] = _bar_table("BC", linkage.coupler_length, make, make.coupler_mass)
    if linkage.point_distance and not linkage.point_is_pin:
        point = rect(linkage.point_distance, linkage.point_angle)
        bodies["coupler"] |= {"points": {"P": _point_entry(point)}, **_coupler_masses(linkage, make)}
        del bodies["coupler"]["section"]
    # the angle is not wrapped to a turn, because the position of gears depends on whole turns
    start = a1 + float(linkage.crank_angle(rotation))
    crank = {"joint": "A", "start": with_unit(start, "rad"), "speed": with_unit(direction * make.speed, "rad/s")}
    tables: dict[str, Any] = {
        "name": _NAME,
        "source": "found by synthesis",
        "gravity": with_unit(make.gravity, "m/s2"),
        "ground": {
            "A": _point_entry(shaft),
            "E" if linkage.pivot or isinstance(linkage, SliderCrank) else "D": _point_entry(end),
        },
        "bodies": bodies,
        "freedoms": {"crank": crank},
        "assembly": {"C": linkage.branch},
    }
    if isinstance(linkage, SliderCrank):
        bodies["block"] = {"points": {"C": [0, 0]}, "mass": with_unit(make.block_mass, "kg")}
        tables["slides"] = {"guide": {"body": "block", "through": "E", "direction": with_unit(a1 + 0.5 * pi, "rad")}}
    else:
        bodies["rocker"] = _bar_table("DC", linkage.rocker_length, make, make.rocker_mass)
    second = linkage.pivot
    if isinstance(second, SliderMotion):
        along = with_unit(a1 + second.guide_angle, "rad")
        bodies["block"] = {"points": {"D": [0, 0]}, "mass": with_unit(make.block_mass, "kg")}
        tables["slides"] = {"guide": {"body": "block", "through": "E", "direction": along}}
        position = with_unit(float(second.series(rotation)), "m")
        tables["freedoms"]["pivot"] = {"joint": "guide", "start": position, "driven": True}
    elif second is not None:
        bodies["second"] = _bar_table("ED", second.length, make, None)
    if isinstance(second, SecondCrank) and second.series.order:
        angle = with_unit(a1 + float(second.angle(rotation)), "rad")
        tables["freedoms"]["pivot"] = {"joint": "E", "start": angle, "driven": True}
    elif isinstance(second, SecondCrank):
        # angle of the second crank while the first crank points along x
        phase = a1 + second.phase - second.ratio * (a1 + linkage.crank_phase)
        tables["gears"] = {
            "teeth": {
                "bodies": ["crank", "second"],
                "ratio": second.ratio,
                "phase": with_unit(remainder(phase, tau), "rad"),
            }
        }
    if acting := loads(linkage, make):
        tables["loads"] = list(acting)
    return tables


def loads(linkage: Linkage, make: MachineSpec) -> dict[str, Any]:
    """Return the table with the load of ``make``, by the name of the point on which it acts; empty without a load."""
    if not any(make.load):
        return {}
    # the coupler point may be one of the coupler's pins
    point = "C" if linkage.point_is_pin else "P" if linkage.point_distance else "B"
    return {point: {f"load_{axis}": with_unit(force, "N") for axis, force in zip("xy", make.load)}}


def drives(linkage: Linkage, make: MachineSpec, *, rotation: float = 0.0, direction: float = 1.0) -> dict[str, Any]:
    """Return the drive tables of a linkage whose pivot is a second degree of freedom: speeds of crank and pivot over time.

    The arguments are those of `description`. For any other linkage the result is empty, because `description` contains the
    crank speed.
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


def _coupler_masses(linkage: Linkage, make: MachineSpec) -> dict[str, Any]:
    """Return mass, centre of mass and moment of inertia of a coupler with an arm to its point; see `link_mass_properties`."""
    line = make.density * make.width * make.thickness
    r, a2 = linkage.point_distance, linkage.point_angle
    straight = is_on_line(linkage.coupler_length, r, a2)
    links = linkage.crank_length, linkage.coupler_length, linkage.rocker_length
    made = geometry.link_mass_properties(*links, r, a2, line, make.width, straight)
    made |= make.link_masses(made)
    centre = rect(made["coupler_cog_distance"], made["coupler_cog_angle"])
    return {
        "mass": with_unit(made["coupler_mass"], "kg"),
        "cog": _point_entry(centre),
        "inertia": with_unit(made["coupler_inertia"], "kg.m2"),
    }


def _point_entry(z: complex) -> list[Any]:
    """Return a point as a case file gives it, [x, y] with units; exact zeros are the number 0."""
    return [0 if c == 0.0 else with_unit(c, "m") for c in (z.real, z.imag)]


def _bar_table(ends: str, length: float, make: MachineSpec, mass: float | None) -> dict[str, Any]:
    """Return the table of a bar with the section of ``make``, and with ``mass`` (kg) if it is given."""
    section = {"kind": "bar", "width": with_unit(make.width, "m"), "thickness": with_unit(make.thickness, "m")}
    table = {"bar": list(ends), "length": with_unit(length, "m"), "section": section | {"material": make.density}}
    return table if mass is None else table | {"mass": with_unit(mass, "kg")}
