"""Where the amplitude is greatest or least along a branch, the resonances among these, and how special points move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import scipy

from linkwork.errors import InputError, LinkworkError

from ..numerics.peaks import peaks
from .branches import Branch, SpecialPoint
from .families import Family
from .floquet import Stability
from .gradients import PointGradient, crossing_gradient, extremum_gradient, extremum_orbit
from .orbits import OrbitError, PeriodicOrbit, orbit_of
from .planes import value_of

#: How far a maximum of the amplitude stands out, relative to its height, to count as one.
PROMINENCE = 1e-3
#: Error of an amplitude that is read from samples, relative to it.
_SAMPLED = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Extremum:
    """A local maximum or minimum of the amplitude over the parameter.

    Attributes
    ----------
    parameter : float
        Speed (rad/s), or what else varies.
    amplitude : float
        m.
    stability : Stability
        Of the motion there.
    orbit : PeriodicOrbit
        That motion.
    """

    parameter: float
    amplitude: float
    stability: Stability
    orbit: PeriodicOrbit


def extrema(branch: Branch, sign: int = 1) -> tuple[Extremum, ...]:
    """Local maxima (sign +1) or minima (-1) of the amplitude along a branch, each brought to rest.

    The place is that of `extremum_gradient`: where the derivative of the amplitude with respect to the parameter, which is
    exact, is zero. What varies by a function, or has a kink there, is searched by Brent's method on the orbits at fixed
    parameters: since the amplitude hardly changes there, the place is then good to 1e-4 of the parameter.
    """
    amplitude = sign * branch.amplitude
    found = []
    for i, prominence in peaks(amplitude):
        if prominence < PROMINENCE * abs(amplitude[i]):
            continue
        a, c = sorted((float(branch.parameter[i - 1]), float(branch.parameter[i + 1])))
        # at a fold the parameter turns back, and the greatest amplitude of the neighbours stands
        if not a < branch.parameter[i] < c:
            continue
        place, orbit = _at_rest(branch.family, branch.orbits[i], a, float(branch.parameter[i]), c, sign)
        found.append(
            Extremum(parameter=place, amplitude=orbit.amplitude, stability=orbit.verdict().stability, orbit=orbit)
        )
    return tuple(found)


def _at_rest(
    family: Family, orbit: PeriodicOrbit, a: float, begin: float, c: float, sign: int
) -> tuple[float, PeriodicOrbit]:
    """The extremum between a and c and the motion there, from a motion between them."""
    if isinstance(family.vary, str):
        try:
            rested = extremum_orbit(orbit, family.vary)
        except LinkworkError:
            pass
        else:
            place = value_of(rested.parameters, rested.drive, family.vary)
            if a < place < c and sign * (rested.amplitude - orbit.amplitude) > -_SAMPLED * orbit.amplitude:
                return place, rested

    def near(value: float) -> PeriodicOrbit:
        parameters, drive = family.at(value)
        return orbit_of(parameters, drive, turns=orbit.turns, start=orbit.start, settle=False)

    try:
        best = scipy.optimize.minimize_scalar(
            lambda value: -sign * near(value).amplitude,
            bounds=(a, c),
            method="bounded",
            options={"xatol": 1e-6 * (c - a)},
        )
        return float(best.x), near(float(best.x))
    except OrbitError:
        # next to the limit of assembly a neighbour at a fixed parameter may not be found: the point itself stands
        return begin, orbit


def special_gradient(
    family: Family, point: SpecialPoint | Extremum, names: Sequence[str] | None = None
) -> PointGradient:
    """How a special point of a branch, or a maximum or minimum of its amplitude, moves with the other parameters.

    Parameters
    ----------
    family : Family
        Over a parameter with an FMI name.
    point : SpecialPoint or Extremum
    names : sequence of str, optional
        Of the other parameters; by default all, see `gradient_names`.

    Raises
    ------
    InputError
        If the family's parameter is a function.
    LinkworkError
        If the place has no derivative, as where two folds meet.
    """
    if not isinstance(family.vary, str):
        raise InputError(f"{family.name} is a function: gradients are along a parameter with an FMI name")
    if isinstance(point, SpecialPoint):
        return crossing_gradient(point.orbit, point.kind, family.vary, names)
    return extremum_gradient(point.orbit, family.vary, names)
