"""Assembly limits of the five-bar slider, and error scales of its state."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, degrees, sqrt

from ..limits import UnjoinedMessages
from ..mechanism import crank_scale
from . import kinematics
from .parameters import Constants, FiveBarParameters

UNJOINED = UnjoinedMessages(
    "the links cannot be joined",
    "crank pin and slider pin are {:.9g} m apart, coupler and rocker span from {:.9g} m to {:.9g} m",
    "coupler and rocker are collinear to {:.3f} deg",
    kinematics.joint_distance,
)


def check_assembly(crank_angle: float, slider_position: float, p: Constants) -> None:
    """Check that the links can be joined at a configuration, with a clearance of at least `LIMIT_SINE`.

    Raises
    ------
    AssemblyError
        If the links cannot be joined; the message has the configuration and the distance from crank pin to slider pin,
        with the range that coupler and rocker allow.
    """
    square = kinematics.assembly_square(crank_angle, slider_position, p)
    sine = copysign(sqrt(abs(square)) / (p.l3 * p.l4), square)
    UNJOINED.check(
        sine,
        (crank_angle, slider_position),
        p,
        lambda: (
            f"crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and slider position {slider_position:.9g} m"
        ),
    )


def error_scale(parameters: FiveBarParameters, x: Sequence[float]) -> tuple[float, ...]:
    """Return for each state component the magnitude below which its error counts as absolute; x is the initial state."""
    mass = parameters.coupler_mass + parameters.rocker_mass + parameters.slider_mass
    return crank_scale(parameters.crank_length, mass, parameters.crank_inertia, x[2])
