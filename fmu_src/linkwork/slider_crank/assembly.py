"""Assembly limits of the slider-crank, and error scales of its state."""

from __future__ import annotations

from collections.abc import Sequence
from math import copysign, degrees, sqrt

from ..limits import UnjoinedMessages
from ..mechanism import crank_scale
from . import kinematics
from .parameters import Constants, SliderCrankParameters

UNJOINED = UnjoinedMessages(
    "the rod does not reach the guide",
    "the crank pin is {:.9g} m from the guide, the rod is {:.9g} m long, {:.9g} m too short",
    "the rod is within {:.3f} deg of perpendicular to the guide",
    kinematics.joint_distance,
)


def check_assembly(crank_angle: float, shift: float, p: Constants) -> None:
    """Check that the rod reaches the guide at a crank angle (rad) and shift (m), with a clearance of at least `LIMIT_SINE`.

    Raises
    ------
    AssemblyError
        If the rod does not reach the guide; the message has the configuration, and by how much the rod is too short or how
        near the rod is to perpendicular to the guide.
    """
    square = kinematics.assembly_square(crank_angle, shift, p)
    sine = copysign(sqrt(abs(square)) / p.a2, square)
    UNJOINED.check(
        sine,
        (crank_angle, shift),
        p,
        lambda: f"crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and shift position {shift:.9g} m",
    )


def error_scale(parameters: SliderCrankParameters, x: Sequence[float]) -> tuple[float, ...]:
    """Return for each state component the magnitude below which its error counts as absolute; x is the initial state."""
    mass = parameters.crank_mass + parameters.rod_mass + parameters.slider_mass
    return crank_scale(parameters.crank_length, mass, parameters.crank_inertia, x[2])
