"""Kinematics of the five-bar slider in closed form (Youssef, chapter II).

The coordinates are the crank angle ``th2`` and the slider position ``u``. Every angle is absolute, counter-clockwise from
the ground link; ``c4, s4`` belong to the direction from the slider pin D to the coupler-rocker pin C, so that the rocker
angle here is the thesis's theta4 + alpha.

The functions are arithmetic on floats: no branches on the state, no NumPy, no I/O. The same code runs as it is inside the
FMU, compiled under Numba, and traced with CasADi symbols.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, fabs, sin, sqrt
from typing import NamedTuple

from .parameters import Constants


class Position(NamedTuple):
    """Cosines and sines of the angles of crank (2), coupler (3) and rocker (4), and of rocker minus coupler angle (43)."""

    c2: float
    s2: float
    c3: float
    s3: float
    c4: float
    s4: float
    c43: float
    s43: float


class Coefficients(NamedTuple):
    """Velocity coefficients: w3 = k32 w2 + k3u u', w4 = k42 w2 + k4u u' (rad/rad and rad/m)."""

    k32: float
    k3u: float
    k42: float
    k4u: float


def assembly_square(th2: float, u: float, p: Constants) -> float:
    """Compute the square of the distance of C from the line BD, times BD squared (m4).

    The result is (l3 l4 sin(th4 - th3))^2: positive where the links can be joined, negative where they cannot.
    """
    dx = p.l1 + u * p.ca - p.l2 * cos(th2)
    dy = u * p.sa - p.l2 * sin(th2)
    d2 = dx * dx + dy * dy
    a = 0.5 * (d2 + p.l3 * p.l3 - p.l4 * p.l4)
    return p.l3 * p.l3 * d2 - a * a


def joint_distance(x: Sequence[float], p: Constants) -> tuple[float, float, float]:
    """Return the distance from crank pin to slider pin, and its least and greatest value that coupler and rocker allow (m)."""
    dx, dy = p.l1 + x[1] * p.ca - p.l2 * cos(x[0]), x[1] * p.sa - p.l2 * sin(x[0])
    return sqrt(dx * dx + dy * dy), fabs(p.l3 - p.l4), p.l3 + p.l4


def position(th2: float, u: float, p: Constants) -> Position:
    """Solve loop closure (2.1) as the intersection of two circles about B and D.

    ``p.branch`` is the sign of sin(th4 - th3) and stays the same in a motion. The "+ root" of the listing KINE (appendix 1)
    changes the assembly when B passes D.

    Raises
    ------
    ValueError
        If the links cannot be joined (square root of a negative number); NaN in compiled code.
    ZeroDivisionError
        If B coincides with D, so that the coupler's direction is undetermined.
    """
    c2 = cos(th2)
    s2 = sin(th2)
    return close_loop(c2, s2, p.l1 + u * p.ca - p.l2 * c2, u * p.sa - p.l2 * s2, p.l3, p.l4, p.branch)


def close_loop(c2: float, s2: float, dx: float, dy: float, l3: float, l4: float, branch: float) -> Position:
    """Return the position with C at the intersection of the circles about B and D, for the vector (dx, dy) from B to D.

    The crank's direction ``c2, s2`` is returned unchanged. D may be a point of any body; in `position` it is the slider pin.
    """
    d2 = dx * dx + dy * dy
    a = 0.5 * (d2 + l3 * l3 - l4 * l4)
    h = branch * sqrt(l3 * l3 * d2 - a * a)
    # C - B = (a d + h d_perp) / d2: C lies to the left of B -> D for branch +1
    x3 = (a * dx - h * dy) / d2
    y3 = (a * dy + h * dx) / d2
    c3 = x3 / l3
    s3 = y3 / l3
    c4 = (x3 - dx) / l4
    s4 = (y3 - dy) / l4
    return Position(c2, s2, c3, s3, c4, s4, c3 * c4 + s3 * s4, h / (l3 * l4))


def coefficients(g: Position, p: Constants) -> Coefficients:
    """Compute the velocity coefficients: loop closure differentiated once, projected on rocker and coupler."""
    r3 = 1.0 / (p.l3 * g.s43)
    r4 = 1.0 / (p.l4 * g.s43)
    return Coefficients(
        -p.l2 * (g.s4 * g.c2 - g.c4 * g.s2) * r3,
        (g.c4 * p.ca + g.s4 * p.sa) * r3,
        -p.l2 * (g.s3 * g.c2 - g.c3 * g.s2) * r4,
        (g.c3 * p.ca + g.s3 * p.sa) * r4,
    )


def centripetal(g: Position, w2: float, w3: float, w4: float, p: Constants) -> tuple[float, float]:
    """Compute the accelerations of coupler and rocker for w2' = u'' = 0 (rad/s2): loop closure differentiated twice."""
    a2 = p.l2 * w2 * w2
    a3 = p.l3 * w3 * w3
    a4 = p.l4 * w4 * w4
    return (
        (a2 * (g.c4 * g.c2 + g.s4 * g.s2) + a3 * g.c43 - a4) / (p.l3 * g.s43),
        (a2 * (g.c3 * g.c2 + g.s3 * g.s2) + a3 - a4 * g.c43) / (p.l4 * g.s43),
    )


def link_angles(g: Position, p: Constants) -> tuple[float, float]:
    """Return the absolute angles of the coupler B -> C and the rocker D -> C (the thesis's theta4 + alpha), in (-2 pi, 2 pi).

    Each angle is the direction of the line B -> D plus a sum of angles of the triangle B, D, C, each at most pi in magnitude.
    Both angles change continuously unless the line B -> D comes to point opposite to the ground link, where B passes behind D.
    """
    dx = p.l3 * g.c3 - p.l4 * g.c4
    dy = p.l3 * g.s3 - p.l4 * g.s4
    th3 = atan2(dy, dx) + atan2(dx * g.s3 - dy * g.c3, dx * g.c3 + dy * g.s3)
    return th3, th3 + atan2(g.s43, g.c43)


def transmission_angle(g: Position, p: Constants) -> float:
    """Return the angle between coupler and rocker at C, in [0, pi]: 0 and pi are the limits of assembly."""
    return atan2(p.branch * g.s43, g.c43)


def coupler_point(g: Position, p: Constants) -> tuple[float, float]:
    """Compute the position of the coupler point P (m)."""
    return (
        p.l2 * g.c2 + p.xp * g.c3 - p.yp * g.s3,
        p.l2 * g.s2 + p.xp * g.s3 + p.yp * g.c3,
    )


def coupler_point_velocity(g: Position, w2: float, w3: float, p: Constants) -> tuple[float, float]:
    """Compute the velocity of the coupler point P (m/s)."""
    return (
        -p.l2 * g.s2 * w2 - (p.xp * g.s3 + p.yp * g.c3) * w3,
        p.l2 * g.c2 * w2 + (p.xp * g.c3 - p.yp * g.s3) * w3,
    )


def assembly_margin(th2: float, u: float, p: Constants) -> tuple[float, float]:
    """Compute the margins of BD to the limits of assembly (m): l3 + l4 - BD and BD - |l3 - l4|, positive within the limits."""
    dx = p.l1 + u * p.ca - p.l2 * cos(th2)
    dy = u * p.sa - p.l2 * sin(th2)
    distance = sqrt(dx * dx + dy * dy)
    return p.l3 + p.l4 - distance, distance - sqrt((p.l3 - p.l4) ** 2)


def closure_residual(th2: float, th3: float, th4: float, u: float, p: Constants) -> float:
    """Compute the closure error of the loop (2.1) at the given angles and slider position (m)."""
    x = p.l2 * cos(th2) + p.l3 * cos(th3) - p.l4 * cos(th4) - p.l1 - u * p.ca
    y = p.l2 * sin(th2) + p.l3 * sin(th3) - p.l4 * sin(th4) - u * p.sa
    return sqrt(x * x + y * y)
