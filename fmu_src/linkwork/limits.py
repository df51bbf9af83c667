"""Limits at which the simulation of a linkage ends."""

from __future__ import annotations

#: Least sine of the transmission angle at which a motion is still followed. Below it the mechanism is taken to be at the limit
#: of assembly, where the velocity coefficients grow without bound.
LIMIT_SINE = 1e-3
#: Sine of the transmission angle below which a failing integration has failed for the nearness of that limit.
NEAR_LIMIT = 0.05

#: What ends a motion there: the links, or friction in them.
ASSEMBLY = "limit of assembly"
JAMMING = "friction so strong that it may jam the links"
