"""What Fig 5.1 to 5.4 share: the first region of instability of the mechanism of chapters IV and V.

A point of these charts is lambda_k^2 = k/((m4 + m5) omega^2) and another parameter: the spring stays, the crank speed omega
changes. The region is that of period doubling, multiplier -1, near lambda_k^2 = k0/4, where the crank runs at about twice
the natural frequency. The thesis takes it about zeta = 0, which is no solution; ours is that of the true periodic orbit,
and the linear equation about zeta = 0, with the right coefficients, is drawn beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import sqrt
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SQUARE_OF_OMEGA_K, chapter_4

from ...numerics.boundaries import Box, Chart, Test, chart
from ...periodic import (
    Confirmation,
    Drive,
    Operation,
    Plane,
    RemovingDamping,
    Stability,
    confirm,
    orbit_test,
    removing_damping,
)
from ...youssef import PeriodicEquation, Region, SliderEquation, Variant, hill_regions, linear_test, slider_equation
from ..study import OURS, StudyResult, Verdict, at_most, near, padded

#: First region in lambda_k^2 by I4: the right one, and the thesis's by its appendix 3.
RIGHT: Mapping[float, tuple[float, float]] = MappingProxyType(
    {0.5: (0.258298, 0.259203), 1.0: (0.266540, 0.268367), 1.5: (0.274727, 0.277501)}
)
APPENDIX_3: Mapping[float, tuple[float, float]] = MappingProxyType(
    {0.5: (0.25786, 0.26031), 1.0: (0.26580, 0.27054), 1.5: (0.27382, 0.28069)}
)
#: Chart of lambda_k^2 and I4 in which the first region lies.
BOX = Box(x=(0.25, 0.29), y=(0.25, 2.0))
#: Range of the damping omega_c = mu/(m4 + m5) (1/s) that removes it.
DAMPINGS = (0.0, 0.5)
#: Turns of a long run.
TURNS = 2000

#: By name: the test function of the true orbit and of the linear equation about zeta = 0.
MOTIONS: Mapping[str, Callable[[Plane, int], Test]] = MappingProxyType({"orbit": orbit_test, "linear": linear_test})


def crank_speed(lambda_k2: float) -> float:
    """Crank speed (rad/s) at a lambda_k^2."""
    return sqrt(SQUARE_OF_OMEGA_K / lambda_k2)


def with_damping(omega_c: float) -> Plane:
    """The plane of lambda_k^2 and I4 at a damping omega_c (1/s)."""

    def operation(lambda_k2: float, inertia_ratio: float) -> Operation:
        return chapter_4(inertia_ratio, omega_c), Drive(speed=crank_speed(lambda_k2))

    return operation


@cache
def first_region(motion: str, omega_c: float = 0.0) -> Chart:
    """Boundaries of the first region in lambda_k^2 and I4."""
    return chart(MOTIONS[motion](with_damping(omega_c), -1), BOX, lines=(0, 4), samples=100)


def edges(found: Chart, value: float) -> tuple[float, float]:
    """The two boundaries in lambda_k^2 at a value of the other parameter, from the test function itself."""
    low, high = found.across(value, samples=100).roots
    return float(low), float(high)


@cache
def equation(parameters: FiveBarParameters, variant: Variant = Variant.EXACT) -> SliderEquation:
    """The slider's equation about zeta = 0; without gravity its M and K are the same at any speed."""
    return slider_equation(parameters, crank_speed(0.25), variant=variant)


def hill_region(parameters: FiveBarParameters, number: int = 1, variant: Variant = Variant.EXACT) -> Region:
    """An undamped region of the linear equation by Hill's determinant."""
    found = equation(parameters, variant)
    a, b, _ = found.coefficients()
    return hill_regions(PeriodicEquation(a=a, b=b + -found.damping, c=found.stiffness), number)[number]


@cache
def removing(motion: str, inertia_ratio: float) -> RemovingDamping:
    """Damping omega_c (1/s) that removes the first region at an I4."""

    def test(lambda_k2: float, omega_c: float) -> float:
        return MOTIONS[motion](with_damping(omega_c), -1)(lambda_k2, inertia_ratio)

    return removing_damping(test, BOX.x, DAMPINGS, samples=8)


def with_crank(inertia_ratio: float, omega_c: float, sigma2: float) -> FiveBarParameters:
    """The mechanism with another crank, sigma2 = l2/l4."""
    mechanism = chapter_4(inertia_ratio, omega_c)
    return replace(mechanism, crank_length=sigma2 * mechanism.rocker_length)


@cache
def long_run(parameters: FiveBarParameters, lambda_k2: float) -> Confirmation:
    """A long run of the nonlinear mechanism from close to its periodic orbit."""
    return confirm(parameters, Drive(speed=crank_speed(lambda_k2)), turns=TURNS)


def run_verdicts(places: Sequence[tuple[str, FiveBarParameters, float]]) -> list[Verdict]:
    """What long runs at chosen points, each with a name, say: growth by the multiplier, or bounded."""
    verdicts = []
    for name, parameters, lambda_k2 in places:
        run = long_run(parameters, lambda_k2)
        if run.verdict.stability is Stability.MARGINAL:
            statement = f"long run, {name}: greatest deviation relative to the first"
            verdicts.append(at_most(statement, OURS, 2.0, run.deviations.max()))
        else:
            statement = f"long run, {name}: factor a turn, against the multiplier"
            multiplier = 1.0 - run.verdict.margin
            verdicts.append(near(statement, OURS, multiplier, run.growth, 1e-5))
    return verdicts


def run_columns(places: Sequence[tuple[str, FiveBarParameters, float]]) -> NDArray[np.float64]:
    """Whether each run grows, 1, or not, 0."""
    return np.array([float(long_run(p, x).verdict.stability is Stability.UNSTABLE) for _, p, x in places])


def with_units(columns: Mapping[str, ArrayLike]) -> dict[str, NDArray[np.float64]]:
    """Columns of one length, those without a unit marked as dimensionless."""
    return {name if name.endswith("]") else f"{name} [1]": values for name, values in padded(columns).items()}


def plain(result: StudyResult) -> dict[str, NDArray[np.float64]]:
    """The columns by the names they had before `with_units`."""
    return {name.removesuffix(" [1]"): values for name, values in result.columns.items()}


def ring(found: Chart) -> NDArray[np.float64]:
    """The region as one closed line, shape (n, 2): its boundaries one after the other, as each has it on its left."""
    return np.concatenate([boundary.points for boundary in found.boundaries])
