"""Vectors in space as tuples of floats, and the few operations the equations need."""

from __future__ import annotations

from typing import NamedTuple


class Vector(NamedTuple):
    """Components of a vector in a frame: the ground frame unless another is stated."""

    x: float
    y: float
    z: float


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return Vector(a.x + b.x, a.y + b.y, a.z + b.z)


def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


def scale(factor: float, a: Vector) -> Vector:
    """Return factor times a."""
    return Vector(factor * a.x, factor * a.y, factor * a.z)


def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
