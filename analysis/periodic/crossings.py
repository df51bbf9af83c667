"""Curves over two parameters along which a Floquet multiplier stays on the unit circle.

A fold, a period doubling or a torus point of a branch, with one more parameter set free, moves along a curve: the boundary of
the speeds at which a machine jumps, say, over the damping. The curve is followed by arclength in orbit and both parameters
together, so that it goes on through the cusp where two folds meet and vanish.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..numerics.continuation import Curve, End, Evaluate, Evaluation, Follower, Settings
from .branches import reason_to_leave
from .families import orbit_from
from .floquet import Crossing, crossing_test
from .orbits import (
    PeriodicOrbit,
    period_from,
)
from .planes import Plane
from .starts import scale_of

#: Steps of the differences, relative to the scales: the multipliers are good to about 1e-10. They steer Newton's method only.
_DIFFERENCE = 1e-5


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CrossingCurve:
    """A curve of folds, period doublings or torus points.

    Attributes
    ----------
    kind : Crossing
    points : ndarray, shape (m, 2)
        Values of the two parameters.
    orbits : tuple of PeriodicOrbit
    ends : (End, End)
        At the first and at the last point.
    """

    kind: Crossing
    points: NDArray[np.float64]
    orbits: tuple[PeriodicOrbit, ...]
    ends: tuple[End, End]


def follow_crossing(
    at: Plane,
    orbit: PeriodicOrbit,
    kind: Crossing,
    place: tuple[float, float],
    *,
    x: tuple[float, float],
    y: tuple[float, float],
    first: float = 2e-3,
    greatest: float = 4e-2,
    most_points: int = 300,
) -> CrossingCurve:
    """Follow a crossing of the unit circle through a plane, to both sides, to the edges of a box.

    Parameters
    ----------
    at : callable
        Mechanism and drive at a point of the plane.
    orbit : PeriodicOrbit
        On the curve, or close to it.
    kind : Crossing
    place : (float, float)
        Where the orbit is.
    x, y : (float, float)
        The box.
    first, greatest : float
        Steps in scaled arc length: each side of the box has length 1, and the crank's length counts as 1.
    most_points : int
        To either side.

    Raises
    ------
    ContinuationError
        If no point of the curve is near the orbit.
    """
    n = len(orbit.start)
    settings = Settings(low=y[0], high=y[1], bounds={n: x}, first=first, greatest=greatest, most_points=most_points)
    unknowns = np.append(scale_of(orbit.parameters, orbit.drive, orbit.start), x[1] - x[0])
    follower = Follower(_evaluate(at, orbit.turns, kind, unknowns, settings), unknowns, settings)
    begin = follower.start(np.append(orbit.start, place[0]), place[1], 1)

    up = follower.follow(begin, leave=reason_to_leave)
    down = up if up.closed else follower.follow(begin.turned(), leave=reason_to_leave)
    points = [*up.points] if up.closed else [*reversed(down.points[1:]), *up.points]
    return CrossingCurve(
        kind=kind,
        points=np.array([[p.y[-1], p.parameter] for p in points]),
        orbits=tuple(p.data for p in points),
        ends=(_end(down), _end(up)),
    )


def _end(curve: Curve) -> End:
    last = curve.points[-1]
    message = "" if curve.reached else curve.reason
    return End(reason=curve.end, point=(float(last.y[-1]), last.parameter), message=message)


def _evaluate(at: Plane, turns: int, kind: Crossing, scale: NDArray[np.float64], settings: Settings) -> Evaluate:
    """G = (y(T) - y(0), test) in the unknowns (y(0), x) and the parameter y, with its derivatives."""
    n = len(scale) - 1

    def values(z: NDArray[np.float64]) -> tuple[NDArray[np.float64], PeriodicOrbit]:
        parameters, drive = at(float(z[n]), float(z[n + 1]))
        period = period_from(parameters, drive, z[:n], turns)
        orbit = orbit_from(parameters, drive, z[:n], turns, period)
        # the test has no dimension; it is given that of x, whose row it stands in
        return np.append(period.shift, scale[n] * crossing_test(orbit.monodromy, kind)), orbit

    steps = _DIFFERENCE * np.append(scale, settings.high - settings.low)
    high = np.append(np.full(n, np.inf), [settings.bounds[n][1], settings.high])

    def evaluation(unknowns: NDArray[np.float64], parameter: float) -> Evaluation:
        z = np.append(unknowns, parameter)
        here, orbit = values(z)
        columns = np.empty((n + 1, n + 2))
        for j, step in enumerate(steps):
            there = z.copy()
            # into the box, where there is a mechanism for certain
            there[j] += step if z[j] + step <= high[j] else -step
            columns[:, j] = (values(there)[0] - here) / (there[j] - z[j])
        columns[:n, :n] = orbit.monodromy - np.eye(n)
        return Evaluation(here, columns[:, :-1], columns[:, -1], orbit)

    return evaluation
