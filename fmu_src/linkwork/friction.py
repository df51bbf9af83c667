"""Friction of a straight guide: viscous, and Coulomb's smooth about rest."""

from __future__ import annotations

from math import tanh

#: Slider speed (m/s) at which the regularised Coulomb friction F tanh(u'/v0) has reached 76 % of its level.
FRICTION_SPEED = 1e-3


def resistance(v: float, mu: float, fc: float) -> float:
    """Force against a motion at speed v (N): damper mu v and Coulomb friction of the level fc; odd in v."""
    return mu * v + fc * tanh(v / FRICTION_SPEED)
