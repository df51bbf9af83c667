"""Curves over two parameters along which a Floquet multiplier stays on the unit circle.

A fold, a period doubling or a torus point of a branch, with one more parameter set free, moves along a curve: the boundary of
the speeds at which a machine jumps, say, over the damping. The curve is followed by arclength in orbit and both parameters
together, so that it goes on through the cusp where two folds meet and vanish.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.parameters import FiveBarParameters

from ..numerics.continuation import Evaluate, Evaluation, Follower, Point, Settings
from .branches import crossing_value, orbit_from, reason_to_leave
from .floquet import Crossing
from .orbits import Drive, PeriodicOrbit, period_from, scale_of

#: Steps of the differences, relative to the scales: the multipliers are good to about 1e-10. They steer Newton's method only.
_DIFFERENCE = 1e-5

#: Ends of a curve that leave nothing to follow.
COMPLETE = ("it leaves the box", "it is closed")

#: Mechanism and drive at a point of the plane.
At = Callable[[float, float], tuple[FiveBarParameters, Drive]]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CrossingCurve:
    """A curve of folds, period doublings or torus points.

    Attributes
    ----------
    kind : Crossing
    points : ndarray, shape (m, 2)
        Values of the two parameters.
    orbits : tuple of PeriodicOrbit
    ends : (str, str)
        Why it ends, at the first and at the last point.
    """

    kind: Crossing
    points: NDArray[np.float64]
    orbits: tuple[PeriodicOrbit, ...]
    ends: tuple[str, str]


def follow_crossing(
    at: At,
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
    settings = Settings(low=y[0], high=y[1], first=first, greatest=greatest, most_points=most_points)
    unknowns = np.append(scale_of(orbit.parameters, orbit.drive, orbit.start), x[1] - x[0])
    follower = Follower(_evaluate(at, orbit.turns, kind, unknowns, x, y), unknowns, settings)
    begin = follower.start(np.append(orbit.start, place[0]), place[1], 1)

    def leave(point: Point) -> str:
        return reason_to_leave(point) if x[0] <= point.y[-1] <= x[1] else "it leaves the box"

    up = follower.follow(begin, leave=leave)
    backwards = Point(y=begin.y, parameter=begin.parameter, tangent=-begin.tangent, data=begin.data)
    down = None if up.closed else follower.follow(backwards, leave=leave)
    points = list(up.points) if down is None else [*reversed(down.points[1:]), *up.points]
    inside = [p for p in points if x[0] <= p.y[-1] <= x[1]]
    reasons = [_reason(curve.reason) for curve in (up if down is None else down, up)]
    return CrossingCurve(
        kind=kind,
        points=np.array([[p.y[-1], p.parameter] for p in inside]),
        orbits=tuple(p.data for p in inside),
        ends=(reasons[0], reasons[1]),
    )


def _reason(text: str) -> str:
    return "it leaves the box" if "end of the range" in text else "it is closed" if "closes" in text else text


def _evaluate(
    at: At,
    turns: int,
    kind: Crossing,
    scale: NDArray[np.float64],
    x: tuple[float, float],
    y: tuple[float, float],
) -> Evaluate:
    """G = (y(T) - y(0), test) in the unknowns (y(0), x) and the parameter y, with its derivatives.

    Beyond the box, where there may be no mechanism, it goes on in a straight line.
    """
    n = len(scale) - 1

    def values(z: NDArray[np.float64]) -> tuple[NDArray[np.float64], PeriodicOrbit]:
        parameters, drive = at(float(z[n]), float(z[n + 1]))
        period = period_from(parameters, drive, z[:n], turns)
        orbit = orbit_from(parameters, drive, z[:n], turns, period)
        # the test has no dimension; it is given that of x, whose row it stands in
        return np.append(period.shift, scale[n] * crossing_value(kind, orbit)), orbit

    steps = _DIFFERENCE * np.append(scale, y[1] - y[0])
    low, high = np.full(n + 2, -np.inf), np.full(n + 2, np.inf)
    low[n:], high[n:] = (x[0], y[0]), (x[1], y[1])

    def evaluation(unknowns: NDArray[np.float64], parameter: float) -> Evaluation:
        z = np.append(unknowns, parameter)
        inside = np.clip(z, low, high)
        here, orbit = values(inside)
        columns = np.empty((n + 1, n + 2))
        for j, step in enumerate(steps):
            there = inside.copy()
            # into the box, where there is a mechanism for certain
            there[j] += step if inside[j] + step <= high[j] else -step
            columns[:, j] = (values(there)[0] - here) / (there[j] - inside[j])
        columns[:n, :n] = orbit.monodromy - np.eye(n)
        return Evaluation(here + columns @ (z - inside), columns[:, :-1], columns[:, -1], orbit)

    return evaluation
