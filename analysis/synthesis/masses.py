"""Masses of a four-bar whose links are bars: one law for the plant's parameters and, traced, for derivatives by dimensions."""

from __future__ import annotations

from math import atan2, cos, hypot, sin
from typing import Any


def bar(length: Any, line: float, width: float) -> tuple[Any, Any]:
    """Mass of a rectangular bar between its pins (kg), and its moment of inertia about its centre (kg.m2)."""
    mass = line * length
    return mass, mass * (length * length + width * width) / 12.0


def bodies(l2: Any, l3: Any, l4: Any, r: Any, a2: Any, line: float, width: float, straight: bool) -> dict[str, Any]:
    """Masses, moments of inertia and centres of mass, by their names in `FiveBarParameters`.

    Crank and rocker are bars between their pins. The coupler is one from B to C and a second from B to P; where P is on the
    line of B and C, ``straight``, one over all of it.

    Parameters
    ----------
    l2, l3, l4, r, a2 : float
        Links, distance and direction of the coupler point (m, rad).
    line : float
        kg/m.
    width : float
        m.
    straight : bool
    """
    m2, i2 = bar(l2, line, width)
    m4, i4 = bar(l4, line, width)
    if straight:
        end = r * cos(a2)
        low, high = min(0.0, end), max(l3, end)
        m3, i3 = bar(high - low, line, width)
        x, y = 0.5 * (low + high), 0.0
    else:
        (along, own), (aside, inertia) = bar(l3, line, width), bar(r, line, width)
        bx, px, py = 0.5 * l3, 0.5 * r * cos(a2), 0.5 * r * sin(a2)
        m3 = along + aside
        x, y = (along * bx + aside * px) / m3, aside * py / m3
        i3 = own + along * ((bx - x) ** 2 + y**2) + inertia + aside * ((px - x) ** 2 + (py - y) ** 2)
    return {
        "crank_mass": m2,
        "crank_inertia": i2 + m2 * (0.5 * l2) ** 2,
        "crank_cog_distance": 0.5 * l2,
        "coupler_mass": m3,
        "coupler_inertia": i3,
        "coupler_cog_distance": hypot(x, y),
        "coupler_cog_angle": atan2(y, x),
        "rocker_mass": m4,
        "rocker_inertia": i4,
        "rocker_cog_distance": 0.5 * l4,
    }


def on_line(l3: float, r: float, a2: float) -> bool:
    """Whether the coupler point lies on the line of B and C."""
    return abs(sin(a2)) * r <= 1e-9 * l3
