"""The natural frequency of a mechanism's first freedom beside the crank, on its spring."""

from __future__ import annotations

from math import sqrt

import numpy as np

from linkwork.errors import ParameterError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ..mechanisms import Parameters, mechanism_of
from ..numerics import symbolic
from ..run import at_rest, takes_published
from .flows import crank_of

#: Crank angles over which the effective mass is averaged.
MASS_SAMPLES = 1024


def first_freedom(mechanism: Mechanism) -> int:
    """Number of the first freedom that is not the crank's; raises ParameterError if there is none."""
    crank = crank_of(mechanism).freedom
    for number in range(len(mechanism.freedoms)):
        if number != crank:
            return number
    raise ParameterError("mechanism", mechanism.name, "have a second freedom for a natural frequency")


def stiffness_name(mechanism: Mechanism) -> str:
    """FMI name of the stiffness of the first freedom's spring, as it is where the mechanism has one: ``slider.stiffness``."""
    return mechanism.freedoms[first_freedom(mechanism)].coordinate.partition(".")[0] + ".stiffness"


def _means(parameters: Parameters) -> tuple[float, float]:
    """Effective mass (kg) and stiffness (N/m) of the first freedom at its zero, as means over a turn."""
    mechanism = mechanism_of(parameters)
    crank = crank_of(mechanism).freedom
    angles = np.linspace(0.0, mechanism.freedoms[crank].period, MASS_SAMPLES, endpoint=False)
    for angle in angles.tolist():
        x = [0.0] * mechanism.size
        x[crank] = angle
        mechanism.check_assembly(parameters, x)
    mass, stiffness = symbolic.over(
        at_rest(mechanism, crank, first_freedom(mechanism)), angles, list(parameters.constants())
    )
    return float(mass.mean()), float(stiffness.mean())


@takes_published()
def mean_effective_mass(parameters: Parameters) -> float:
    """Mean over a turn of what moves with the first freedom beside the crank, at its zero (kg): a five-bar's m22 at u = 0.

    Raises
    ------
    AssemblyError
        If the links cannot be joined there over the whole turn.
    """
    return _means(parameters)[0]


@takes_published()
def natural_frequency(parameters: Parameters) -> float:
    """Natural frequency of the first freedom beside the crank on its spring (rad/s), from the mean effective mass over a turn.

    A spring's stiffness is that of the parameter of this name, such as ``slider.stiffness``; where the mechanism has none, it
    is the mean over a turn of the second derivative of the energy.

    Raises
    ------
    ParameterError
        If there is no spring.
    AssemblyError
        If the mechanism, that freedom held at its zero, cannot make the turn.

    Examples
    --------
    >>> from math import pi
    >>> from analysis import natural_frequency
    >>> round(natural_frequency("rig-1-spring-a") * 30.0 / pi, 1)
    591.9
    """
    mechanism = mechanism_of(parameters)
    name = stiffness_name(mechanism)
    spring = getattr(parameters, field_name(name), None)
    if spring is not None and spring <= 0.0:
        raise ParameterError(name, spring, "be above zero for a natural frequency")
    mass, stiffness = _means(parameters)
    stiffness = stiffness if spring is None else spring
    if stiffness <= 0.0:
        raise ParameterError(name, stiffness, "be above zero for a natural frequency")
    return sqrt(stiffness / mass)
