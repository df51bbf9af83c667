"""Derivatives by central differences of order 6."""

from collections.abc import Callable, Sequence
from typing import Any

WEIGHTS = ((1, 45 / 60), (2, -9 / 60), (3, 1 / 60))


def derivative(f: Callable[[float], Sequence[float]], h: float) -> list[float]:
    """Return the derivative of ``f`` at 0, by differences with the step ``h``."""
    pairs = [(w, f(n * h), f(-n * h)) for n, w in WEIGHTS]
    return [sum(w * (a[j] - b[j]) for w, a, b in pairs) / h for j in range(len(pairs[0][1]))]


def along(f: Callable[[Any], Sequence[float]], x: Sequence[float], dx: Sequence[float], h: float) -> list[float]:
    """Return the derivative of ``f`` at ``x`` in the direction ``dx``, by differences with the step ``h``."""
    return derivative(lambda t: f(tuple(a + t * b for a, b in zip(x, dx))), h)
