"""Stability of u = 0 by the linear equation, as the thesis has it; that of the true motion is in `analysis.periodic`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.five_bar.parameters import FiveBarParameters, without_friction

from ..numerics.boundaries import Test
from ..periodic import TOLERANCE, Drive, Monodromy, Plane, StabilityVerdict, multipliers, test_of, verdict
from ..run import takes_published
from .equation import Load, Variant, slider_equation
from .hill import PeriodicEquation, monodromy
from .premises import require_five_bar


def load_of(drive: Drive) -> Load:
    """The constant forces of a drive of a five-bar."""
    x, y, slider = (drive.forces.get(name, 0.0) for name in ("load.fx", "load.fy", "slider.force"))
    return Load(x=x, y=y, slider=slider)


@takes_published()
def linear_equation(parameters: FiveBarParameters, drive: Drive, variant: Variant = Variant.EXACT) -> PeriodicEquation:
    """The slider's equation about u = 0, which is the motion only where nothing drives it: the thesis's.

    Raises
    ------
    InputError
        If the drive is by torque.
    """
    if drive.speed is None:
        raise InputError("the linear equation is at constant speed: the drive is by torque")
    require_five_bar(parameters, "the linear equation")
    equation = slider_equation(parameters, drive.speed, variant=variant, load=load_of(drive))
    return equation.homogeneous().stiffened(equation.spring)


@takes_published()
def linear_verdict(
    parameters: FiveBarParameters, drive: Drive, *, variant: Variant = Variant.EXACT, tolerance: float = TOLERANCE
) -> StabilityVerdict:
    """The verdict on u = 0 by the linear equation; that on the true motion is `PeriodicOrbit.verdict`."""
    return verdict(multipliers(monodromy(linear_equation(parameters, drive, variant))), tolerance)


def linear_monodromy(operation: Plane, *, variant: Variant = Variant.EXACT) -> Monodromy:
    """Monodromy matrix of the linear equation about u = 0 over a plane; points are remembered."""

    @cache
    def matrix(x: float, y: float) -> NDArray[np.float64]:
        return monodromy(linear_equation(*operation(x, y), variant))

    return matrix


def linear_test(operation: Plane, multiplier: int, *, variant: Variant = Variant.EXACT) -> Test:
    """`test_of` of `linear_monodromy`."""
    return test_of(linear_monodromy(operation, variant=variant), multiplier)


@takes_published()
def linear_motion(
    parameters: FiveBarParameters, drive: Drive, names: tuple[str, str]
) -> Mapping[str, Callable[[Plane], Monodromy]]:
    """The linear equation as a motion beside the true one, for `stability_chart` over parameters of these names.

    Empty where there is none: under a torque, and with friction that is not viscous.
    """
    friction = parameters != without_friction(parameters) or any("friction" in name for name in names)
    return {"linear equation": linear_monodromy} if drive.speed_drive and not friction else {}
