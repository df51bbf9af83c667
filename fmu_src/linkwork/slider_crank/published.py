"""Data of Rahman's section 3.1 in SI, from the printed inches, pounds and seconds.

Crank and rod are round bars with their centres of mass at mid-length; the slider is a cube. The printed "specific gravity" of
0.28 is a weight density in lb/in3. No gravity acts: the thesis uses g only to convert weights to masses.
"""

from __future__ import annotations

from math import radians
from types import MappingProxyType
from typing import Mapping

from ..mechanism import PublishedSet
from ..units import INCH, RAD_S_PER_RPM
from .parameters import InitialState, SliderCrankParameters

POUND_FORCE = 4.4482216152605
#: Unit of mass of the printed data, lb.s2/in.
POUND_S2_PER_INCH = POUND_FORCE / INCH
POUND_INCH = POUND_FORCE * INCH

CRANK_SPEED = 50.0 * RAD_S_PER_RPM
CRANK_TORQUE = 100.0 * POUND_INCH

#: Lengths in inches, masses in lb.s2/in.
_CRANK, _ROD = 12.0, 50.0
_CRANK_RADIUS, _ROD_RADIUS = 1.5, 1.0
_CRANK_MASS, _ROD_MASS, _SLIDER_MASS = 0.06146594, 0.11382582, 0.01956522


def parameters(offset_in: float = 0.0, twist_deg: float = 270.0) -> SliderCrankParameters:
    """Return the mechanism of section 3.1 with an offset a4 given in inches and a twist alpha4 given in degrees."""
    unit = POUND_S2_PER_INCH * INCH * INCH
    return SliderCrankParameters(
        crank_length=_CRANK * INCH,
        rod_length=_ROD * INCH,
        guide_offset=offset_in * INCH,
        guide_twist=radians(twist_deg),
        crank_mass=_CRANK_MASS * POUND_S2_PER_INCH,
        rod_mass=_ROD_MASS * POUND_S2_PER_INCH,
        slider_mass=_SLIDER_MASS * POUND_S2_PER_INCH,
        # the printed radii of gyration are about the link's end: K^2 = r^2/4 + a^2/3
        crank_inertia=_CRANK_MASS * (_CRANK_RADIUS**2 / 4.0 + _CRANK**2 / 3.0) * unit,
        crank_cog_x=0.5 * _CRANK * INCH,
        rod_inertia=_ROD_MASS * (_ROD_RADIUS**2 / 4.0 + _ROD**2 / 12.0) * unit,
        rod_cog_distance=0.5 * _ROD * INCH,
    )


def initial(shift_in: float = 0.0) -> InitialState:
    """Return the initial state at 50 rpm with a shift S1 given in inches."""
    return InitialState(crank_speed=CRANK_SPEED, shift_position=shift_in * INCH)


def _case(offset_in: float, shift_in: float, twist_deg: float) -> PublishedSet:
    source = f"Rahman, section 3.1: a4 = {offset_in:g} in, S1 = {shift_in:g} in, alpha4 = {twist_deg:g} deg"
    return PublishedSet(parameters(offset_in, twist_deg), initial(shift_in), {"speed": CRANK_SPEED}, source)


#: The ideal slider-crank and the cases of figures 5 to 38, by name: offset and shift in inches, twist in degrees.
SETS: Mapping[str, PublishedSet] = MappingProxyType(
    {"rahman-ideal": _case(0.0, 0.0, 270.0)}
    | {f"rahman-a4-{a4}-s1-3.5": _case(a4, 3.5, 270.0) for a4 in (10, 20, 30)}
    | {f"rahman-a4-30-s1-{s1}": _case(30, s1, 270.0) for s1 in (3, 6, 9)}
    | {f"rahman-a4-20-alpha4-{twist}": _case(20, 0.0, twist) for twist in (232, 270, 310)}
)

#: The case that the FMU starts from: a4 = 10 in, S1 = 3.5 in, alpha4 = 270 deg.
OFFSET_CASE = (parameters(10.0), initial(3.5))
