"""Stability of u = 0 by the linear equation, as in the thesis; `analysis.periodic` has the stability of the true motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.five_bar.parameters import FiveBarParameters, without_friction

from ..mechanisms import FIVE_BAR
from ..numerics.boundaries import Test
from ..periodic import Drive, Monodromy, Plane, StabilityVerdict, multipliers, plane_test, verdict
from ..run import takes_published
from .hill import PeriodicEquation, monodromy
from .linearisation import Load, Variant, slider_equation
from .premises import require_five_bar


def constant_load(drive: Drive) -> Load:
    """Return the constant forces (N) of a five-bar's drive."""
    x, y, slider = (drive.forces.get(name, 0.0) for name in ("load.fx", "load.fy", "slider.force"))
    return Load(x=x, y=y, slider=slider)


@takes_published()
def linear_equation(parameters: FiveBarParameters, drive: Drive, variant: Variant = Variant.EXACT) -> PeriodicEquation:
    """Return the homogeneous linear equation of the slider about u = 0, whose stability the thesis investigates.

    Raises
    ------
    InputError
        If the drive is by torque.
    """
    if drive.speed is None:
        raise InputError("the linear equation is at constant speed: the drive is by torque")
    require_five_bar(parameters, "the linear equation")
    equation = slider_equation(parameters, drive.speed, variant=variant, load=constant_load(drive))
    return equation.homogeneous().stiffened(equation.spring)


@takes_published()
def linear_verdict(parameters: FiveBarParameters, drive: Drive) -> StabilityVerdict:
    """Judge the stability of u = 0 by the linear equation; `PeriodicOrbit.verdict` judges the true motion."""
    return verdict(multipliers(monodromy(linear_equation(parameters, drive))))


def linear_monodromy(operation: Plane, *, variant: Variant = Variant.EXACT) -> Monodromy:
    """Return a function that computes, and caches, the linear equation's monodromy matrix at a point of a plane of parameters.

    ``operation`` returns parameters and drive at a point (x, y) of the plane.
    """

    @cache
    def matrix(x: float, y: float) -> NDArray[np.float64]:
        return monodromy(linear_equation(*operation(x, y), variant))

    return matrix


def linear_test(operation: Plane, multiplier: int, *, variant: Variant = Variant.EXACT) -> Test:
    """Return a function over a plane of parameters that is zero where the linear equation has the given multiplier, +1 or -1.

    See `linear_monodromy` and `analysis.periodic.plane_test`.
    """
    return plane_test(linear_monodromy(operation, variant=variant), multiplier)


@takes_published()
def linear_motion(
    parameters: FiveBarParameters, drive: Drive, names: tuple[str, str]
) -> Mapping[str, Callable[[Plane], Monodromy]]:
    """Return the linear equation as a second motion for a `stability_chart`, whose axes are the parameters ``names``.

    The mapping has `linear_monodromy` by the motion's name. The mapping is empty if there is no linear equation: if the drive
    is by torque, or if friction that is not viscous acts or is one of the axes.
    """
    rough = set(FIVE_BAR.names("friction"))
    friction = parameters != without_friction(parameters) or not rough.isdisjoint(names)
    return {"linear equation": linear_monodromy} if drive.speed_drive and not friction else {}
