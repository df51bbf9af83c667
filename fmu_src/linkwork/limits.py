"""Limits at which the simulation of a linkage ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import asin, degrees
from typing import Any, NamedTuple

from .errors import AssemblyError

#: Least sine of the transmission angle at which a motion is still followed. Below it the mechanism is taken to be at the limit
#: of assembly, where the velocity coefficients grow without bound.
LIMIT_SINE = 1e-3
#: Sine of the transmission angle below which a failing integration has failed for the nearness of that limit.
NEAR_LIMIT = 0.05

#: What ends a motion there: the links, or friction in them.
ASSEMBLY = "limit of assembly"
JAMMING = "friction so strong that it may jam the links"


class Unjoined(NamedTuple):
    """What a mechanism says where its links cannot be joined, or hardly so: of its equations in Python, and as C.

    Attributes
    ----------
    fact : str
        Such as "the links cannot be joined".
    apart : str
        Said after the configuration; a field such as ``{:.9g}`` for each number of ``reach``.
    near : str
        Said after the limit of assembly and the configuration, with a field for the angle from it (deg).
    reach : callable or None
        ``reach(x, p)``: those numbers, by arithmetic like the equations'; None where ``apart`` has none.
    """

    fact: str
    apart: str
    near: str
    reach: Callable[..., tuple[float, ...]] | None = None

    def error(self, sine: float, x: Sequence[float], p: Any, where: str) -> AssemblyError:
        """Return the error for a configuration, by the sine of the angle from the limit, below zero beyond it."""
        if sine > 0.0:
            return AssemblyError(f"{ASSEMBLY} at {where}: {self.near.format(degrees(asin(min(1.0, sine))))}")
        return AssemblyError(f"{self.fact} at {where}: {self.apart.format(*(self.reach(x, p) if self.reach else ()))}")
