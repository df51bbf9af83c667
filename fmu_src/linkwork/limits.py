"""Limits at which the simulation of a linkage ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import asin, degrees
from typing import Any, NamedTuple

from .errors import AssemblyError

#: Least sine of the transmission angle at which a motion is still followed. Below it the mechanism is taken to be at the limit
#: of assembly, where the velocity coefficients grow without bound.
LIMIT_SINE = 1e-3
#: Sine of the transmission angle below which a failed integration is blamed on the limit of assembly.
NEAR_LIMIT = 0.05

#: Reasons why a motion ends, as messages name them.
ASSEMBLY = "limit of assembly"
JAMMING = "friction so strong that it may jam the links"
#: Reasons for accelerations or outputs that are not finite even with all inputs zero, as messages name them.
MASSLESS = "what a force moves has no mass or moment of inertia"
NO_ACCELERATION = f"{MASSLESS}, a force law has no value, or a speed or parameter is too large"

#: End of the message on a spring whose whole turns are not counted; it begins "the torque of SPRING at t = TIME s".
SLIPPED = (
    "jumps, because its angle passes plus or minus half a turn: whole turns of this angle are not counted; a freedom at the "
    "pin would count them"
)


class UnjoinedMessages(NamedTuple):
    """Messages for configurations at or near which the links cannot be joined; the same in Python and in C.

    Attributes
    ----------
    fact : str
        What is wrong, such as "the links cannot be joined".
    apart : str
        Text after the configuration; it has a field such as ``{:.9g}`` for each number of ``reach``.
    near : str
        Text after a configuration near the limit of assembly; its field is the angle from that limit (deg).
    reach : callable or None
        ``reach(x, p)`` returns the numbers in ``apart``, by arithmetic without branches; None if there are none.
    """

    fact: str
    apart: str
    near: str
    reach: Callable[..., tuple[float, ...]] | None = None

    def check(self, sine: float, x: Sequence[float], p: Any, where: Callable[[], str]) -> None:
        """Raise AssemblyError if state x is at the limit of assembly or beyond it; ``where()`` describes x in words.

        ``sine`` is the sine of the angle from the limit of assembly; if the links cannot be joined, it is not positive.
        """
        if sine >= LIMIT_SINE:
            return
        if sine > 0.0:
            raise AssemblyError(f"{ASSEMBLY} at {where()}: {self.near.format(degrees(asin(sine)))}")
        raise AssemblyError(f"{self.fact} at {where()}: {self.apart.format(*(self.reach(x, p) if self.reach else ()))}")
