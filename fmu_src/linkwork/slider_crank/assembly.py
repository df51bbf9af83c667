"""Assembly limits of the slider-crank, and error scales of its state."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, degrees, sqrt

from ..errors import AssemblyError
from ..limits import LIMIT_SINE
from ..mechanism import crank_scale
from . import kinematics
from .parameters import SliderCrankParameters


def check_assembly(parameters: SliderCrankParameters, crank_angle: float, shift: float) -> None:
    """Make sure that the rod reaches the guide at a configuration, clear of the limit of assembly.

    Parameters
    ----------
    parameters : SliderCrankParameters
    crank_angle : float
        Crank angle theta1 (rad).
    shift : float
        Axial shift S1 (m).

    Raises
    ------
    AssemblyError
        With the configuration, and by how much the rod is too short or how near it is to perpendicular to the guide.
    """
    p = parameters.constants()
    square = kinematics.assembly_square(crank_angle, shift, p)
    least = LIMIT_SINE * p.a2
    if square >= least * least:
        return
    where = f"crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and shift {shift:.9g} m"
    if square >= 0.0:
        raise AssemblyError(
            f"limit of assembly at {where}: the rod is within {degrees(asin(sqrt(square) / p.a2)):.3f} deg of "
            f"perpendicular to the guide"
        )
    distance = sqrt(p.a2 * p.a2 - square)
    raise AssemblyError(
        f"the rod does not reach the guide at {where}: the crank pin is {distance:.9g} m from the guide, the rod is "
        f"{p.a2:.9g} m long, {distance - p.a2:.9g} m too short"
    )


def error_scale(parameters: SliderCrankParameters, x: Sequence[float]) -> tuple[float, ...]:
    """Return for each component of the state the magnitude below which its error counts as absolute, from the initial state."""
    mass = parameters.crank_mass + parameters.rod_mass + parameters.slider_mass
    return crank_scale(parameters.crank_length, mass, parameters.crank_inertia, x[2])
