"""First region of instability of the mechanisms of chapters IV and V, by four methods.

The methods are the true orbit, the corrected linear equation, and the thesis's coefficients as printed and as listed in its
program.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from math import sqrt

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import SQUARE_OF_OMEGA_K

from ...numerics.boundaries import scan
from ...periodic import Drive, orbit_test
from ...youssef import (
    Form,
    PeriodicEquation,
    Region,
    Variant,
    hill_regions,
    perturbed_region,
    perturbed_removing_damping,
    slider_equation,
)


def crank_speed(lambda_k2: float) -> float:
    """Return the crank speed omega (rad/s) at lambda_k^2 = (omega_k/omega)^2."""
    return sqrt(SQUARE_OF_OMEGA_K / lambda_k2)


def axis(region: Region) -> float:
    """Return the axis A of a region: omega/omega_k in its middle."""
    return 1.0 / sqrt(0.5 * (region.low + region.high))


@cache
def equation(
    parameters: FiveBarParameters, variant: Variant = Variant.EXACT, form: Form = Form.STABILITY
) -> PeriodicEquation:
    """Return the slider's undamped linear equation; without gravity it is the same at any crank speed."""
    undamped = replace(parameters, slider_damping=0.0)
    return slider_equation(undamped, crank_speed(0.25), variant=variant, form=form).homogeneous()


def hill_region(parameters: FiveBarParameters, number: int = 1, variant: Variant = Variant.EXACT) -> Region:
    """Return the region of instability N = ``number`` by Hill's determinant, eq (5.35)."""
    return hill_regions(equation(parameters, variant), number)[number]


@cache
def orbit_region(parameters: FiveBarParameters) -> Region:
    """Return the first region of the true periodic orbit; the search starts near the region of the linear equation."""
    test = orbit_test(lambda lambda_k2, _: (parameters, Drive(speed=crank_speed(lambda_k2))), -1)
    linear = hill_region(parameters)
    found = scan(lambda x: test(x, 0.0), linear.low - 0.5 * linear.width, linear.high + 0.5 * linear.width, samples=8)
    low, high = found.roots.tolist()
    return Region(number=1, low=low, high=high)


def first_order_region(parameters: FiveBarParameters, variant: Variant) -> Region:
    """Return the first region by eq (5.16), with the coefficients of a variant of the equation."""
    region = perturbed_region(equation(parameters, variant, Form.SERIES), 1, order=1)
    assert region is not None, "there is no damping"
    return region


def appendix_3_region(parameters: FiveBarParameters) -> Region:
    """Return the first region by eq (5.16) as listed in appendix 3: no 1/k0 in the half width, and a sine for a cosine."""
    region = first_order_region(parameters, Variant.APPENDIX_3)
    middle = 0.5 * (region.low + region.high)
    half = 0.5 * region.width * equation(parameters, Variant.APPENDIX_3, Form.SERIES).factor.mean
    return Region(number=1, low=middle - half, high=middle + half)


#: Methods that compute the first region, by their names in columns and legends.
WAYS: Mapping[str, Callable[[FiveBarParameters], Region]] = {
    "true orbit": orbit_region,
    "linear equation": hill_region,
    "(4.21) as printed": partial(first_order_region, variant=Variant.PRINTED),
    "listing of appendix 3": appendix_3_region,
}
LOOKS = {"true orbit": "-", "linear equation": "--", "(4.21) as printed": ":", "listing of appendix 3": "-."}


def removing_estimate(parameters: FiveBarParameters, number: int = 1) -> float:
    """Estimate the damper omega_c (1/s) that removes a region of the corrected linear equation, from the region's width."""
    found = equation(parameters)
    return perturbed_removing_damping(found, number) * crank_speed(hill_region(parameters, number).low)
