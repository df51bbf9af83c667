"""Planar linkages and a target for the tests: a fixed linkage, and random linkages with general values of all dimensions."""

from dataclasses import replace
from math import cos, hypot, pi, sqrt
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from analysis.synthesis import LENGTHS, Linkage, TargetPath, UntimedPath, turn

#: A crank-rocker for tests that move its rocker pivot.
BASE = Linkage(
    pivot_x=0.02, pivot_y=-0.03, ground_length=0.20, crank_length=0.06, coupler_length=0.18,
    rocker_length=0.16, point_distance=0.12, ground_angle=0.3, crank_phase=0.7, point_angle=0.8,
)  # fmt: skip


def ellipse(n: int) -> NDArray[np.float64]:
    """Return the thesis's first target, an ellipse of 20 cm by 10 cm, at n equal steps of the crank; shape (n, 2) in m."""
    phi = turn(n)
    return np.column_stack([0.20 + 0.10 * np.cos(phi), 0.15 + 0.05 * np.sin(phi)])


def outline(points: Any, *, closed: bool = True, **settings: Any) -> UntimedPath:
    """Return the task of a path without times through the points, closed unless it is said otherwise."""
    return UntimedPath(path=TargetPath(points=points, closed=closed), **settings)


def drawn(random: np.random.Generator, *, least: float = 0.3) -> Linkage:
    """Return a random four-bar whose crank turns fully, with transmission angles at least ``least`` (rad) from 0 and pi.

    Ground link and crank are drawn first, then the least and greatest transmission angle. Coupler and rocker follow from
    the law of cosines at the crank's two positions along the ground link.
    """
    l1 = random.uniform(0.5, 1.5)
    branch = int(random.choice([-1, 1]))
    # (l3 - l4)^2 + 2 l3 l4 (1 - cos mu) = d^2 at both positions: two equations for l3 l4 and (l3 - l4)^2
    while True:
        l2 = l1 * random.uniform(0.1, 0.6)
        near, far = (l1 - l2) ** 2, (l1 + l2) ** 2
        low, high = np.sort(random.uniform(least, pi - least, 2))
        if cos(low) - cos(high) < 0.05:
            continue
        product = 0.5 * (far - near) / (cos(low) - cos(high))
        square = near - 2.0 * product * (1.0 - cos(low))
        if square >= 0.0:
            break
    difference = sqrt(square) * random.choice([-1.0, 1.0])
    l4 = 0.5 * (-difference + sqrt(square + 4.0 * product))
    l3 = l4 + difference
    return Linkage(
        pivot_x=random.uniform(-2.0, 2.0),
        pivot_y=random.uniform(-2.0, 2.0),
        ground_length=l1,
        crank_length=l2,
        coupler_length=l3,
        rocker_length=l4,
        point_distance=hypot(l3, l2) * random.uniform(0.2, 1.5),
        ground_angle=random.uniform(-pi, pi),
        crank_phase=random.uniform(-pi, pi),
        point_angle=random.uniform(-pi, pi),
        output_angle=random.uniform(-pi, pi),
        branch=branch,
    )


def scaled(linkage: Linkage, factor: float) -> Linkage:
    """Return a four-bar with every length, and the position of A, multiplied by the factor."""
    return replace(linkage, **{name: factor * getattr(linkage, name) for name in LENGTHS})


def linkages() -> st.SearchStrategy[Linkage]:
    """Return a hypothesis strategy of the linkages of `drawn`."""
    return st.integers(0, 2**32 - 1).map(lambda seed: drawn(np.random.default_rng(seed)))
