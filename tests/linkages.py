"""Random linkages in the plane, every dimension general."""

from __future__ import annotations

from math import cos, hypot, pi, sqrt

import numpy as np
from hypothesis import strategies as st

from analysis.synthesis import Linkage


def drawn(random: np.random.Generator, *, least: float = 0.3) -> Linkage:
    """A four-bar whose crank turns fully, its transmission angle never within ``least`` (rad) of 0 or pi.

    Built backwards: ground link and crank, then two angles of the range; coupler and rocker follow from the law of cosines
    at the crank's two positions along the ground link.
    """
    l1 = random.uniform(0.5, 1.5)
    branch = int(random.choice([-1, 1]))
    # (l3 - l4)^2 + 2 l3 l4 (1 - cos mu) = d^2 at both: two equations for the product and the difference
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


def linkages() -> st.SearchStrategy[Linkage]:
    """As a hypothesis strategy."""
    return st.integers(0, 2**32 - 1).map(lambda seed: drawn(np.random.default_rng(seed)))
