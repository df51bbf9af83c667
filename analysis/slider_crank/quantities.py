"""Define names, frames and units of the slider-crank's forces, and check arrays of values."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError
from linkwork.slider_crank.published import POUND_FORCE, POUND_INCH

from ..files import unknown_name
from ..run import float_array
from ..units import INCH

FloatArray: TypeAlias = NDArray[np.float64]
MaskedArray: TypeAlias = "np.ma.MaskedArray[Any, np.dtype[np.float64]]"

#: Value relative to the crank's length below which dS4/dtheta1 counts as zero: no torque then balances a force on the slider.
DEAD_CENTRE = 1e-9


class Joint(NamedTuple):
    """A force or moment in a joint: description and unit."""

    words: str
    unit: str


#: Forces and moments in the joints by name.
JOINTS: Mapping[str, Joint] = MappingProxyType(
    {
        "bearing": Joint("force of the bearing on the crank", "N"),
        "bearing_moment": Joint("moment of the bearing about O", "N.m"),
        "crank_pin": Joint("force of the crank on the rod", "N"),
        "slider_pin": Joint("force of the slider on the rod", "N"),
        "guide": Joint("force of the guide on the slider", "N"),
        "guide_moment": Joint("moment of the guide on the slider", "N.m"),
    }
)
#: Frames by number: of the ground, the crank, the rod and the guide.
FRAMES: Mapping[int, str] = MappingProxyType({1: "ground", 2: "crank", 3: "rod", 4: "guide"})

#: Units by system: for each SI unit, the name of the unit used instead and the factor from that unit to SI.
UNITS: Mapping[str, Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "SI": {unit: (unit, 1.0) for unit in ("rad", "m", "m/s", "m/s2", "N", "N.m")},
        "inch": {
            "rad": ("deg", pi / 180.0),
            "m": ("in", INCH),
            "m/s": ("in/s", INCH),
            "m/s2": ("in/s2", INCH),
            "N": ("lb", POUND_FORCE),
            "N.m": ("lb.in", POUND_INCH),
        },
    }
)


def unit_table(units: str) -> Mapping[str, tuple[str, float]]:
    """Return the units of the system ``units``, by SI unit: an entry of `UNITS`.

    Raises
    ------
    InputError
        If there are no such units.
    """
    if units not in UNITS:
        raise InputError(f"there are no units {units!r}: they are {' or '.join(UNITS)}")
    return UNITS[units]


def shown_units(units: str) -> Mapping[str, tuple[str, float]]:
    """Return the units of a system for tables and figures: those of `unit_table`, except that "SI" has lengths in mm.

    Raises
    ------
    InputError
        If there are no such units.
    """
    known = unit_table(units)
    return {**known, "m": ("mm", 1e-3), "m/s": ("mm/s", 1e-3)} if units == "SI" else known


def check_joint(name: str, frame: int) -> None:
    """Check that a force or moment of this name and a frame of this number exist; raise InputError if not."""
    if name not in JOINTS:
        raise unknown_name(name, JOINTS, f"joint force or moment {name!r}")
    if frame not in FRAMES:
        frames = ", ".join(f"{number} ({body})" for number, body in FRAMES.items())
        raise InputError(f"there is no frame {frame!r}: the frames are {frames}")


def masked_array(values: ArrayLike, where: NDArray[np.bool_]) -> MaskedArray:
    """Return values as a masked array; the mask ``where`` is broadcast to their shape. Masked values are NaN."""
    whole = np.asarray(values, dtype=float)
    mask = np.broadcast_to(where, whole.shape).copy()
    return np.ma.MaskedArray(np.where(mask, np.nan, whole), mask=mask, fill_value=np.nan)


def array_per_angle(name: str, value: ArrayLike, n: int) -> FloatArray:
    """Return an array with a finite value for each of n crank angles, from one value or n; raise InputError for others."""
    values = float_array(value, f"{name} is {value!r}: it must be a number in SI or an array of them")
    if values.shape not in ((), (1,), (n,)):
        raise InputError(f"{name} has the shape {values.shape}: it must be a number or have one for each of {n} angles")
    if not np.isfinite(values).all():
        raise InputError(f"{name} is {value!r}: it must be finite")
    return np.broadcast_to(values, (n,)).copy()
