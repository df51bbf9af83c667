"""Dyads of planar linkages: velocity columns and bias accelerations against differences of the positions.

Pins, lines and the arms of the bodies themselves all move with one coordinate, as they do where a dyad is part of a body.
"""

from collections.abc import Callable
from math import atan2, cos, sin
from typing import Any

import numpy as np
import pytest

from linkwork import planar
from linkwork.planar import Turn, Vector

RATE, STEP = 1.7, 1e-4
Place = tuple[float, float, float, float, float, float]


def moving(coefficients: Place, q: float) -> Vector:
    """A vector whose components are quadratic in the coordinate."""
    x, y, x1, y1, x2, y2 = coefficients
    slope = (x1 + x2 * q, y1 + y2 * q)
    at = (x + x1 * q + 0.5 * x2 * q * q, y + y1 * q + 0.5 * y2 * q * q)
    return Vector(*at, RATE * slope[0], RATE * slope[1], (slope, (x2 * RATE**2, y2 * RATE**2)))


def turning(coefficients: tuple[float, float, float], q: float) -> Turn:
    angle, rate, growth = coefficients
    at, slope = angle + rate * q + 0.5 * growth * q * q, rate + growth * q
    return Turn(cos(at), sin(at), RATE * slope, (slope, growth * RATE**2))


def drawn(random: np.random.Generator, middle: tuple[float, float]) -> Place:
    x, y = middle
    return (x, y, *random.uniform(-0.3, 0.3, 4).tolist())


def dyads(seed: int) -> dict[str, Callable[[float], tuple[Any, ...]]]:
    """Each dyad as a function of the coordinate."""
    random = np.random.default_rng(seed)
    p, q, a, b = (drawn(random, at) for at in ((0.0, 0.1), (1.0, 0.2), (0.8, 0.1), (-0.7, 0.2)))
    t, r = (random.uniform(-0.3, 0.3) + angle for angle in (0.2, 1.5))
    along, across = ((angle, *random.uniform(-0.4, 0.4, 2).tolist()) for angle in (t, r))
    v = (RATE,)

    def of(*values: Place) -> Callable[[float], list[Vector]]:
        return lambda s: [moving(value, s) for value in values]

    return {
        "RRR": lambda s: planar.pin_pin_pin(*of(p, q, a, b)(s), 1.0, v),
        "RRP": lambda s: planar.pin_pin_slide(
            *of(p, q)(s), turning(along, s), *of(a, (0.1, 0.2, *b[2:]))(s), -1.0, v
        ),
        "PRP": lambda s: planar.slide_pin_slide(
            *of(p)(s), turning(along, s), *of(a, q)(s), turning(across, s), *of(b)(s), v
        ),
        "RPR": lambda s: planar.pin_slide_pin(*of(p, q, (0.1, 0.1, *a[2:]), (0.2, -0.2, *b[2:]))(s), 1.0, v),
        "RPP": lambda s: planar.pin_slide_slide(
            *of(p, q)(s), turning(along, s), turning(across, s), *of(a, b)(s), v
        ),
    }  # fmt: skip


def value(part: Vector | Turn) -> np.ndarray:
    """The coordinates of a part: its angle, or its components."""
    return np.array([atan2(part.s, part.c)] if isinstance(part, Turn) else [part.x, part.y])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["RRR", "RRP", "PRP", "RPR", "RPP"])
def test_columns_and_biases_are_the_derivatives_of_the_positions(kind: str, seed: int) -> None:
    solve = dyads(seed)[kind]
    before, here, after = (solve(s) for s in (-STEP, 0.0, STEP))
    for number, part in enumerate(here[:2]):
        low, middle, high = (value(found[number]) for found in (before, here, after))
        slope, bend = (high - low) / (2.0 * STEP), (high - 2.0 * middle + low) / STEP**2
        columns = np.array(part.columns)
        rate = part.w if isinstance(part, Turn) else (part.vx, part.vy)
        np.testing.assert_allclose(columns[0], np.squeeze(slope), atol=1e-7)
        np.testing.assert_allclose(rate, RATE * np.squeeze(slope), atol=1e-6)
        np.testing.assert_allclose(columns[-1], RATE**2 * np.squeeze(bend), atol=2e-6 * (1.0 + np.abs(bend).max()))
