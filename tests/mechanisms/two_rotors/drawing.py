"""Positions of the joints of two rotors on a cart."""

from __future__ import annotations

from math import cos, sin

from .equations import Applied, Constants, State


def positions(x: State, i: Applied, p: Constants) -> tuple[float, ...]:
    """Return x, y and z of every joint (m)."""
    s = x[2]
    r1, r2 = p.inertia1 / (11.0 * p.unbalance1), p.inertia2 / (11.0 * p.unbalance2)
    left, right = (s + r1 * cos(x[0]), r1 * sin(x[0]), 0.0), (s + r2 * cos(x[1]), r2 * sin(x[1]), 0.0)
    return (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, s, 0.0, 0.0, *left, *right)
