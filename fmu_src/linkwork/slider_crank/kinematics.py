"""Kinematics of the generalised slider-crank in closed form (Rahman, chapter II, solved without iteration).

The coordinates are the crank angle ``th`` and the axial shift ``s1``. With the crank pin P2 = (a1 c, a1 s, S1) and the slider
pin P3 = (-a4, 0, 0) - S4 k4, k4 = (0, sin alpha4, cos alpha4), the rod's length a2 = |P3 - P2| gives S4: the position of the
foot of P2 on the guide plus the distance h of P3 from that foot.

The functions are arithmetic on floats: no branches on the state, no NumPy, no I/O. The same code runs as it is inside the
FMU, compiled under Numba, and on dual numbers and arrays (`analysis.numerics.tracing`).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, sin, sqrt
from typing import NamedTuple

from .parameters import Constants
from .vectors import Vector, cross, dot, scale


class Position(NamedTuple):
    """A configuration: cosine and sine of the crank angle, positions of the pins relative to the guide (m).

    ``f, g`` are the coordinates of the crank pin from the guide along i and j of frame 4; ``h`` is the distance along
    the guide between the slider pin and the point nearest to the crank pin, ``s4`` the slider position.
    """

    c: float
    s: float
    f: float
    g: float
    h: float
    s4: float


class Groove(NamedTuple):
    """Shift imposed by a groove (m), and its first and second derivatives with respect to the crank angle (m/rad, m/rad2)."""

    shift: float
    pitch: float
    bend: float


class Coefficients(NamedTuple):
    """Velocity coefficients: S4' = kth theta1' + ks S1' (m/rad and m/m)."""

    kth: float
    ks: float


def assembly_square(th: float, s1: float, p: Constants) -> float:
    """Compute the squared rod length minus the squared distance of the crank pin from the guide (m2).

    The result is h^2: positive where the rod reaches the guide, negative where it does not.
    """
    f = p.a1 * cos(th) + p.a4
    g = p.a1 * sin(th) * p.ca - s1 * p.sa
    return p.a2 * p.a2 - f * f - g * g


def joint_distance(x: Sequence[float], p: Constants) -> tuple[float, float, float]:
    """Return the distance of the crank pin from the guide, the rod's length, and by how much the rod is too short (m)."""
    distance = sqrt(p.a2 * p.a2 - assembly_square(x[0], x[1], p))
    return distance, p.a2, distance - p.a2


def position(th: float, s1: float, p: Constants) -> Position:
    """Compute the configuration from loop closure.

    ``p.branch`` says on which side of the crank pin's foot on the guide the slider is.

    Raises
    ------
    ValueError
        If the rod does not reach the guide (square root of a negative number); NaN in compiled code.
    """
    c = cos(th)
    s = sin(th)
    f = p.a1 * c + p.a4
    g = p.a1 * s * p.ca - s1 * p.sa
    h = p.branch * sqrt(p.a2 * p.a2 - f * f - g * g)
    return Position(c, s, f, g, h, h - p.a1 * s * p.sa - s1 * p.ca)


def guide(p: Constants) -> Vector:
    """Return the direction in which the slider position increases: -k4."""
    return Vector(0.0, -p.sa, -p.ca)


def crank_pin(q: Position, s1: float, p: Constants) -> Vector:
    """Compute the position of the crank pin P2 (m)."""
    return Vector(p.a1 * q.c, p.a1 * q.s, s1)


def slider_pin(q: Position, p: Constants) -> Vector:
    """Compute the position of the slider pin P3 (m)."""
    return Vector(-p.a4, -q.s4 * p.sa, -q.s4 * p.ca)


def rod(q: Position, p: Constants) -> Vector:
    """Compute the vector from crank pin to slider pin (m): -f i4 - g j4 - h k4 with the unit vectors of frame 4."""
    return Vector(-q.f, -q.g * p.ca - q.h * p.sa, q.g * p.sa - q.h * p.ca)


def coefficients(q: Position, p: Constants) -> Coefficients:
    """Compute the velocity coefficients: loop closure differentiated once."""
    return Coefficients(
        (q.f * p.a1 * q.s - q.g * p.a1 * q.c * p.ca) / q.h - p.a1 * q.c * p.sa,
        q.g * p.sa / q.h - p.ca,
    )


def crank_pin_velocity(q: Position, w: float, v: float, p: Constants) -> Vector:
    """Compute the velocity of the crank pin (m/s) at crank speed w and axial velocity v."""
    return Vector(-p.a1 * q.s * w, p.a1 * q.c * w, v)


def crank_pin_acceleration(q: Position, w: float, e: float, a: float, p: Constants) -> Vector:
    """Compute the acceleration of the crank pin (m/s2) at crank speed w, crank and axial acceleration e and a."""
    return Vector(-p.a1 * (q.s * e + q.c * w * w), p.a1 * (q.c * e - q.s * w * w), a)


def centripetal(q: Position, k: Coefficients, w: float, v: float, p: Constants) -> float:
    """Compute the slider acceleration for theta1'' = S1'' = 0 (m/s2): loop closure differentiated twice."""
    # r.r'' + r'.r' = 0 with the rod's vector r and its rate r' = -S4' k4 - v2; written out by components for speed, since
    # every step of a run calls this function many times
    slide = k.kth * w + k.ks * v
    rate_x = p.a1 * q.s * w
    rate_y = -slide * p.sa - p.a1 * q.c * w
    rate_z = -slide * p.ca - v
    towards = p.a1 * w * w * (q.f * q.c + (q.g * p.ca + q.h * p.sa) * q.s)
    return (towards - rate_x * rate_x - rate_y * rate_y - rate_z * rate_z) / q.h


def groove(th: float, p: Constants) -> Groove:
    """Compute the shift S1 = SS1 sin(alpha theta1) of the groove, eq 28, and its first two derivatives by crank angle.

    Eq 28a prints S1 for SS1.
    """
    phase = p.ratio * th
    shift = p.amplitude * sin(phase)
    return Groove(shift, p.amplitude * p.ratio * cos(phase), -p.ratio * p.ratio * shift)


def rod_angular_velocity(r: Vector, rate: Vector, p: Constants) -> Vector:
    """Compute the angular velocity of the rod (rad/s) from its vector and the vector's rate, with no spin about the rod."""
    return scale(1.0 / (p.a2 * p.a2), cross(r, rate))


def transmission_angle(q: Position, p: Constants) -> float:
    """Return the angle between the rod and the plane normal to the guide, in [0, pi/2]: 0 is the limit of assembly."""
    return atan2(p.branch * q.h, sqrt(q.f * q.f + q.g * q.g))


def assembly_margin(q: Position, p: Constants) -> float:
    """Compute the rod length minus the crank pin's distance from the guide (m), positive where the links can be joined."""
    return p.a2 - sqrt(q.f * q.f + q.g * q.g)


def closure_residual(th: float, s1: float, s4: float, p: Constants) -> float:
    """Compute the closure error of the loop at the given crank angle, shift and slider position (m)."""
    x = p.a1 * cos(th) + p.a4
    y = p.a1 * sin(th) + s4 * p.sa
    z = s1 + s4 * p.ca
    return sqrt((sqrt(x * x + y * y + z * z) - p.a2) ** 2)


def to_crank_frame(a: Vector, q: Position) -> Vector:
    """Return the components in frame 2, which moves with the crank, of a vector in the ground frame."""
    return Vector(q.c * a.x + q.s * a.y, q.c * a.y - q.s * a.x, a.z)


def to_rod_frame(a: Vector, q: Position, p: Constants) -> Vector:
    """Return the components in frame 3, fixed to the rod's line, of a vector in the ground frame.

    i is along the rod from crank pin to slider pin, j perpendicular to the rod and to the crank axis.

    Raises
    ------
    ZeroDivisionError
        If the rod is parallel to the crank axis.
    """
    i = scale(1.0 / p.a2, rod(q, p))
    j = scale(1.0 / sqrt(i.x * i.x + i.y * i.y), Vector(-i.y, i.x, 0.0))
    return Vector(dot(a, i), dot(a, j), dot(a, cross(i, j)))


def to_guide_frame(a: Vector, p: Constants) -> Vector:
    """Return the components in frame 4 of a vector in the ground frame; the slider position increases along -k4."""
    return Vector(a.x, p.ca * a.y - p.sa * a.z, p.sa * a.y + p.ca * a.z)


def from_guide_frame(a: Vector, p: Constants) -> Vector:
    """Return the components in the ground frame of a vector in frame 4."""
    return Vector(a.x, p.ca * a.y + p.sa * a.z, p.ca * a.z - p.sa * a.y)
