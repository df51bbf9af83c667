"""Assembly limits of the five-bar slider, and error scales of its state."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, degrees

from ..errors import AssemblyError
from ..limits import LIMIT_SINE
from ..mechanism import crank_scale
from . import kinematics
from .parameters import FiveBarParameters, reach


def check_assembly(parameters: FiveBarParameters, crank_angle: float, slider_position: float) -> None:
    """Make sure that the links can be joined at a configuration, clear of the limit of assembly.

    Raises
    ------
    AssemblyError
        With the configuration, the distance from crank pin to slider pin, and the range it would have to be in.
    """
    p = parameters.constants()
    square = kinematics.assembly_square(crank_angle, slider_position, p)
    least = LIMIT_SINE * p.l3 * p.l4
    if square >= least * least:
        return
    distance = reach(parameters, crank_angle, slider_position)
    low, high = abs(p.l3 - p.l4), p.l3 + p.l4
    where = configuration(crank_angle, slider_position)
    if square > 0.0:
        raise AssemblyError(
            f"limit of assembly at {where}: coupler and rocker are collinear to "
            f"{degrees(asin(square**0.5 / (p.l3 * p.l4))):.3f} deg"
        )
    raise AssemblyError(
        f"the links cannot be joined at {where}: crank pin and slider pin are {distance:.9g} m apart, "
        f"coupler and rocker span {low:.9g} m to {high:.9g} m"
    )


def configuration(crank_angle: float, slider_position: float) -> str:
    """Describe a configuration in words."""
    return f"crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and slider position {slider_position:.9g} m"


def error_scale(parameters: FiveBarParameters, x: Sequence[float]) -> tuple[float, ...]:
    """Return for each component of the state the magnitude below which its error counts as absolute, from the initial state."""
    mass = parameters.coupler_mass + parameters.rocker_mass + parameters.slider_mass
    return crank_scale(parameters.crank_length, mass, parameters.crank_inertia, x[2])
