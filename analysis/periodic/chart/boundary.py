"""Trace boundaries of instability over two parameters, and find the damping that removes a region of instability.

A fold, a period doubling or a torus point of a branch becomes a curve when a second parameter varies: for example the speed at
which a machine jumps as a function of the damping. `follow_crossing` follows this curve by arclength in the space of the orbit
and the two parameters, so that the curve continues through the cusp where two folds meet and vanish. Such curves begin at
special points of branches; `line_branches` finds the branches on a line of a chart, including isolas.

A test function of the two parameters is negative in a region of instability and zero on its boundary, where a Floquet
multiplier of the mechanism's own periodic orbit is +1 or -1 (`orbit_test`). `numerics.boundaries` traces the zeros of a test
function, and `removing_damping` finds the damping at which a region of instability ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError

from ...numerics.boundaries import Test, find_minimum
from ...numerics.continuation import ContinuationError, End, Evaluate, Evaluation, Follower, Settings
from ..motion.discretisation import Discretisation, OrbitError, can_collocate, operating_point
from ..motion.flow import Crossing, crossing_test
from ..motion.orbit import PeriodicOrbit, newton_orbit, trial_orbit
from ..motion.variables import Family, Plane
from ..response.branch import GREATEST, Branch, follow_both, passes, reason_to_leave
from .coexistence import Coexistence, coexistence
from .grid import Grid

#: Step of the finite differences of `_evaluate`, relative to the scale of each unknown, for multipliers that are accurate to
#: about 1e-10. The differences are used only in Newton's method.
_DIFFERENCE = 1e-7


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CrossingCurve:
    """A curve of folds, period doublings or torus points over two parameters.

    Attributes
    ----------
    kind : Crossing
    points : ndarray, shape (m, 2)
        Values of the two parameters along the curve.
    orbits : tuple of PeriodicOrbit
        The orbit at each point.
    ends : (End, End)
        Why the curve ends at its first and at its last point.
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
    most_points: int = 300,
) -> CrossingCurve:
    """Follow a curve of folds, period doublings or torus points in both directions, up to the edges of a box in a plane.

    Parameters
    ----------
    at : callable
        Function that returns mechanism and drive at a point of the plane: see `plane`.
    orbit : PeriodicOrbit
        An orbit on the curve, or close to it.
    kind : Crossing
        Kind of the points on the curve: fold, period doubling or torus point, not branch point.
    place : (float, float)
        Values of the two parameters for this orbit.
    x, y : (float, float)
        Ranges of the two parameters, which form the box.
    most_points : int
        Greatest number of points in each direction.

    Raises
    ------
    InputError
        If the kind is a branch point: there the motion is not unique, and the equations of the curve are singular.
    ContinuationError
        If no point of the curve is near the orbit.
    """
    if kind is Crossing.BRANCH_POINT:
        raise InputError("kind is a branch point, whose curve has singular equations: stability_chart traces it")
    n = len(orbit.start)
    # steps in scaled arc length, in which each side of the box has length 1 and the crank's length counts as 1
    settings = Settings(
        low=y[0], high=y[1], bounds={n: x}, first=2e-3, greatest=0.3, widest=4e-2, most_points=most_points
    )
    unknowns = np.append(orbit.scale, x[1] - x[0])
    follower = Follower(_evaluate(at, orbit.turns, kind, unknowns, settings), unknowns, settings)
    begin = follower.start(np.append(orbit.start, place[0]), place[1], 1)
    points, *curves = follower.follow_both(begin, leave=reason_to_leave)
    first_end, last_end = (curve.plane_end("" if curve.reached else curve.reason) for curve in curves)
    return CrossingCurve(
        kind=kind,
        points=np.array([[p.y[-1], p.parameter] for p in points]),
        orbits=tuple(p.data for p in points),
        ends=(first_end, last_end),
    )


def _evaluate(at: Plane, turns: int, kind: Crossing, scale: NDArray[np.float64], settings: Settings) -> Evaluate:
    """Return a function that evaluates G = (y(T) - y(0), test) and its derivatives at unknowns (y(0), p) and a parameter q.

    p and q are the two parameters of the plane; y(0) and y(T) are the state y of the orbit at the beginning and at the end of
    the period; test is `crossing_test` of ``kind``. ``scale`` has the scales of y(0) and p, and ``settings`` the ranges of p
    and q; the period has ``turns`` common periods.
    """
    n = len(scale) - 1
    (low, high), (bottom, top) = settings.bounds[n], (settings.low, settings.high)
    corners = [operating_point(*at(a, b)) for a in (low, high) for b in (bottom, top)]
    whole = np.array([0.0, corners[0].flow.period * turns])
    path = Discretisation(whole, can_collocate([c.drive for c in corners], [c.parameters for c in corners]))

    def values(z: NDArray[np.float64]) -> tuple[NDArray[np.float64], PeriodicOrbit]:
        point = operating_point(*at(float(z[n]), float(z[n + 1])))
        orbit, shift = trial_orbit(point, z[:n], turns, path)
        # the dimensionless test is multiplied by the scale of p, to which its row belongs
        return np.append(shift, scale[n] * crossing_test(orbit.monodromy, kind)), orbit

    steps = _DIFFERENCE * np.append(scale, settings.high - settings.low)
    most = np.append(np.full(n, np.inf), [high, top])

    def evaluation(unknowns: NDArray[np.float64], parameter: float) -> Evaluation:
        z = np.append(unknowns, parameter)
        here, orbit = values(z)
        columns = np.empty((n + 1, n + 2))
        for j, step in enumerate(steps):
            there = z.copy()
            # step into the box, in which the mechanism is known to exist
            there[j] += step if z[j] + step <= most[j] else -step
            columns[:, j] = (values(there)[0] - here) / (there[j] - z[j])
        columns[:n, :n] = orbit.monodromy - np.eye(n)
        return Evaluation(here, columns[:, :-1], columns[:, -1], orbit)

    return evaluation


#: Number of points of a line at which all motions are sought; greatest number of points of a branch in each direction; greatest
#: step of a branch, relative to the range of its parameter.
POINTS, BRANCH_POINTS, STEP = 17, 600, 5e-2


def line_branches(
    operation: Plane,
    x: tuple[float, float],
    y: float,
    *,
    name: str,
    unit: str,
    start: ArrayLike | None = None,
    watch: Callable[[float], None] = lambda share: None,
) -> tuple[list[Branch], Coexistence, list[str]]:
    """Follow all branches of motions along the line y = const of a plane, over a range of x, in both directions.

    All motions are sought at evenly spaced points of the line; a branch is followed from each motion through which no branch
    passes yet. A motion is followed as long as deviations grow less than a thousandfold per turn. Where they grow faster, next
    to the limit of assembly, folds and period doublings come in pairs; the ranges of stability between them are too narrow for
    any machine.

    ``name`` and ``unit`` are the name and the unit of x; for ``start`` see `coexistence`. ``watch`` is called with the share of
    the work that is done, from 0 to 1. Return the branches, the motions from which they were followed, and a sentence for each
    motion that could not be followed.
    """
    xs = np.linspace(*x, POINTS)
    found = coexistence(operation, xs, [y], start=start)
    branches: list[Branch] = []
    lost: list[str] = []
    how: dict[str, Any] = {"low": x[0], "high": x[1], "greatest": STEP, "most_points": BRANCH_POINTS}
    line = zip(xs.tolist(), found.starts[0], found.largest[0].filled(np.inf))
    for number, (value, starts, largest) in enumerate(line, start=1):
        parameters, drive = operation(value, y)
        family = Family(parameters=parameters, drive=drive, vary=lambda v: operation(v, y), name=name, unit=unit)
        for motion in starts[largest < GREATEST]:
            if any(passes(branch, value, motion, x[1] - x[0]) for branch in branches):
                continue
            try:
                orbit = newton_orbit(parameters, drive, start=motion, settle=False)
                branch = follow_both(family, orbit, value, stop=lambda orbit: orbit.largest > GREATEST, **how)
            except (OrbitError, ContinuationError) as error:
                lost.append(f"{family.format_value(value)}: {error}")
            else:
                branches.append(branch)
        watch(number / POINTS)
    return branches, found, lost


#: Monodromy matrix at a point of a plane, shape (n, n).
Monodromy = Callable[[float, float], NDArray[np.float64]]


def orbit_monodromy(operation: Plane, *, start: ArrayLike | None = None, near: Grid | None = None) -> Monodromy:
    """Return a function that gives the monodromy matrix of the periodic orbit of one turn at a point of a plane.

    Each orbit is sought from the orbit found last, so that neighbouring points stay on one branch, then from the orbits at the
    nearest points of the grid ``near``, then from all starts of `newton_orbit`. Results are cached.

    Parameters
    ----------
    operation : callable
        See `plane`.
    start : array_like, shape (n,), optional
        Guess of the first orbit: see `find_orbit`.
    near : Grid, optional
        A grid over the same plane, whose orbits are further guesses.
    """
    first = None if start is None else np.array(start, dtype=float)
    last = first

    @cache
    def matrix(x: float, y: float) -> NDArray[np.float64]:
        nonlocal last
        parameters, drive = operation(x, y)
        for place in (last, *(() if near is None else near.nearby_starts(x, y))):
            try:
                orbit = newton_orbit(parameters, drive, start=place, settle=False)
                break
            except OrbitError:
                continue
        else:
            orbit = newton_orbit(parameters, drive, start=first)
        last = orbit.start
        return orbit.monodromy

    return matrix


def plane_test(matrix: Monodromy, crossing: Crossing | int) -> Test:
    """Return a function that gives the `crossing_test` of the monodromy matrix at a point (x, y) of a plane."""
    return lambda x, y: float(crossing_test(matrix(x, y), crossing))


def orbit_test(operation: Plane, multiplier: int) -> Test:
    """Return the test function of the mechanism's periodic orbit of one turn over a plane: see `plane_test`.

    ``multiplier`` is +1 or -1: the test function is zero where a Floquet multiplier of the orbit has this value.
    """
    return plane_test(orbit_monodromy(operation), multiplier)


# Removing damping


class RemovalError(LinkworkError):
    """The damping that removes a region of instability is not in the given range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RemovingDamping:
    """Damping at which a region of instability vanishes.

    ``x`` is the other parameter where the region vanishes, and ``residual`` the test function's value at this point.
    """

    damping: float
    x: float
    residual: float


def removing_damping(
    test: Callable[[float, float], float],
    x: tuple[float, float],
    damping: tuple[float, float],
    *,
    samples: int = 40,
    tolerance: float = 1e-8,
) -> RemovingDamping:
    """Find the damping at which a region of instability vanishes: the least value of its test function over x is then zero.

    Parameters
    ----------
    test : callable
        Test function of (x, damping), negative inside the region.
    x : (float, float)
        Range of the other parameter x; it contains this region and no other region.
    damping : (float, float)
        Range of damping in which the region vanishes: the region exists at the lower end and not at the upper end.
    samples : int
        Number of samples of x from which the search for the least value begins.
    tolerance : float
        Tolerance of the damping, relative to the upper end of its range.

    Raises
    ------
    RemovalError
        If the region does not exist at the lower end, or still exists at the upper end.
    LinkworkError
        If the test function raises it.
    """

    def least(d: float) -> float:
        return find_minimum(lambda s: test(s, d), *x, samples=samples)[1]

    low, high = (least(d) for d in damping)
    if not low < 0.0:
        raise RemovalError(f"there is no region between {x[0]:g} and {x[1]:g} at the damping {damping[0]:g}")
    if not high > 0.0:
        raise RemovalError(f"the region between {x[0]:g} and {x[1]:g} is still there at the damping {damping[1]:g}")
    found = float(scipy.optimize.brentq(least, *damping, xtol=0.1 * tolerance * damping[1], rtol=1e-14))
    place, value = find_minimum(lambda s: test(s, found), *x, samples=samples)
    return RemovingDamping(damping=found, x=place, residual=value)
