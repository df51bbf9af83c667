"""Stability of the periodic motion: test functions for charts, damping that removes a region, verdicts put to the test.

A test function of a point of a plane (`planes`) is negative in a region of instability and zero on its boundary, where a
Floquet multiplier of the mechanism's own periodic orbit is +1 or -1 (`orbit_test`). `boundaries` traces where it is zero,
`removing_damping` finds where a region ends, `grids` computes the largest multiplier of every point of a grid, and `confirm`
puts a verdict to the test of a long nonlinear run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import cache
from math import exp, log

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError

from ..mechanisms import Parameters, mechanism_of
from ..numerics.boundaries import Test, lowest
from ..run import simulate, takes_published
from .drives import Drive
from .floquet import TOLERANCE, Crossing, Stability, StabilityVerdict, crossing_test
from .grids import Grid
from .orbits import OrbitError, PeriodicOrbit, orbit_of, period_from
from .planes import Plane
from .starts import scale_of

#: Monodromy matrix at a point of a plane, shape (n, n).
Monodromy = Callable[[float, float], NDArray[np.float64]]


def orbit_monodromy(operation: Plane, *, start: ArrayLike | None = None, near: Grid | None = None) -> Monodromy:
    """Monodromy matrix of the mechanism's own periodic orbit of one turn over a plane; points are remembered.

    Each orbit is sought from the one found last, so that neighbouring points stay on one branch, then from those around it
    on a grid, then by all the ways of `orbit_of` from the first guess.

    Parameters
    ----------
    start : array_like, shape (n,), optional
        Guess of the first: see `find_orbit`.
    near : Grid, optional
        Of the same plane.
    """
    first = None if start is None else np.array(start, dtype=float)
    last = first

    @cache
    def matrix(x: float, y: float) -> NDArray[np.float64]:
        nonlocal last
        parameters, drive = operation(x, y)
        for place in (last, *(() if near is None else near.around(x, y))):
            try:
                orbit = orbit_of(parameters, drive, start=place, settle=False)
                break
            except OrbitError:
                continue
        else:
            orbit = orbit_of(parameters, drive, start=first)
        last = orbit.start
        return orbit.monodromy

    return matrix


def test_of(matrix: Monodromy, crossing: Crossing | int) -> Test:
    """Test function `crossing_test` of a monodromy matrix over a plane."""
    return lambda x, y: float(crossing_test(matrix(x, y), crossing))


def orbit_test(operation: Plane, multiplier: int, *, start: ArrayLike | None = None) -> Test:
    """`test_of` of `orbit_monodromy`."""
    return test_of(orbit_monodromy(operation, start=start), multiplier)


# Removing damping


class RemovalError(LinkworkError):
    """The damping asked for does not lie in the range given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RemovingDamping:
    """The damping at which a region vanishes, and the point at which it does last.

    Attributes
    ----------
    damping : float
        In the unit of the range given.
    x : float
        The other parameter at the tip of the region.
    residual : float
        The test function there.
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
    """Damping at which a region of instability vanishes: where the least value of its test function is zero.

    Parameters
    ----------
    test : callable
        Test function of (x, damping).
    x : (float, float)
        Range of the other parameter, with this region and no other in it.
    damping : (float, float)
        Range in which the region vanishes: it is there at the lower end and not at the upper one.
    samples : int
        Of x, from which the least value is sought.
    tolerance : float
        Of the damping, relative to its upper end.

    Raises
    ------
    RemovalError
        If the region is not there at the lower end, or still there at the upper one.
    LinkworkError
        As the test function.
    """

    def least(d: float) -> float:
        return lowest(lambda s: test(s, d), *x, samples=samples)[1]

    low, high = (least(d) for d in damping)
    if not low < 0.0:
        raise RemovalError(f"there is no region between {x[0]:g} and {x[1]:g} at the damping {damping[0]:g}")
    if not high > 0.0:
        raise RemovalError(f"the region between {x[0]:g} and {x[1]:g} is still there at the damping {damping[1]:g}")
    found = float(scipy.optimize.brentq(least, *damping, xtol=0.1 * tolerance * damping[1], rtol=1e-14))
    place, value = lowest(lambda s: test(s, found), *x, samples=samples)
    return RemovingDamping(damping=found, x=place, residual=value)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstDamping:
    """The greatest of the removing dampings over a further parameter: it removes the region everywhere.

    Attributes
    ----------
    damping, x, other : float
        The damping, and the point at which the region vanishes last.
    """

    damping: float
    x: float
    other: float


def removing_damping_over(
    test: Callable[[float, float, float], float],
    x: Callable[[float], tuple[float, float]],
    damping: tuple[float, float],
    other: tuple[float, float],
    *,
    samples: int = 5,
    tolerance: float = 1e-8,
) -> WorstDamping:
    """Damping that removes a region for every value of a further parameter.

    Parameters
    ----------
    test : callable
        Test function of (x, damping, other).
    x : callable
        Range of x at a value of the other parameter; see `removing_damping`.
    damping : (float, float)
    other : (float, float)
        Range of the further parameter.
    samples : int
        Of it, from which the worst is sought.
    tolerance : float
        See `removing_damping`.
    """

    def removing(value: float) -> RemovingDamping:
        return removing_damping(lambda s, d: test(s, d, value), x(value), damping, tolerance=tolerance)

    worst, _ = lowest(lambda value: -removing(value).damping, *other, samples=samples, tolerance=1e-4)
    found = removing(worst)
    return WorstDamping(damping=found.damping, x=found.x, other=worst)


# Long runs


class Outcome(Enum):
    """What a deviation did in a long run."""

    DECAYS = "decays"
    BOUNDED = "stays bounded"
    GROWS = "grows"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Confirmation:
    """A verdict beside a long run of the nonlinear mechanism from close to its periodic orbit.

    Attributes
    ----------
    verdict : StabilityVerdict
        By the multipliers of the orbit.
    outcome : Outcome
    growth : float
        Factor a turn of the deviation along the leading multiplier's direction, by regression over the turns up to the first
        at which it is lost in noise or greater than a hundredth of the crank.
    deviations : ndarray, shape (n,)
        Distance from the orbit at the crank angle 0 of each turn, relative to that at the start. It ends before the others
        if the run does.
    message : str
        Why the run ended early; empty if it did not.
    """

    verdict: StabilityVerdict
    outcome: Outcome
    growth: float
    deviations: NDArray[np.float64]
    message: str

    @property
    def agrees(self) -> bool:
        """Whether the run does what the verdict says; a marginal motion must neither decay nor grow.

        A margin too small for the turns that were run is judged by the measured growth, which must be that of the multiplier.
        """
        expected = {
            Stability.STABLE: Outcome.DECAYS,
            Stability.UNSTABLE: Outcome.GROWS,
            Stability.MARGINAL: Outcome.BOUNDED,
        }
        if self.outcome is expected[self.verdict.stability]:
            return True
        margin = abs(self.verdict.margin)
        return self.outcome is Outcome.BOUNDED and abs(self.growth - 1.0 + self.verdict.margin) < 0.1 * margin


#: Start of a long run: distance from the orbit relative to the crank's length, and the range over which growth is measured.
DISTURBANCE, NOISE, LINEAR = 1e-5, 1e-8, 1e-2
#: Margin from which on a long run distinguishes growth from decay with certainty.
MEASURABLE = 1e-2
#: Turns of a run at least, and at most.
FEWEST_TURNS, MOST_TURNS = 1000, 20_000
#: Growth or decay over a run, of the envelope, from which it counts.
NOTABLE = 3.0


@takes_published()
def confirm(
    parameters: Parameters,
    drive: Drive,
    *,
    turns: int | None = None,
    start: ArrayLike | None = None,
    disturbance: float = DISTURBANCE,
    tolerance: float = TOLERANCE,
) -> Confirmation:
    """Run the nonlinear mechanism for many turns from a slightly disturbed periodic orbit.

    Parameters
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    turns : int, optional
        At least 20. Without it 1000, and up to 20000 where the margin is too small to distinguish growth from decay.
    start : array_like, shape (n,), optional
        Guess of the orbit.
    disturbance : float
        Distance from the orbit at the start relative to the crank's length, in the direction that grows most.
    tolerance : float
        Of the verdict.

    Raises
    ------
    OrbitError
        If there is no periodic orbit.
    InputError
        If the number of turns or the disturbance is not usable.
    LinkworkError
        If the deviation grows or dies too fast to be measured.
    """
    if (turns is not None and turns < 20) or not NOISE < disturbance < LINEAR:
        raise InputError(
            f"{turns} turns from a disturbance of {disturbance}: 20 and more, and between {NOISE:g} and {LINEAR:g}"
        )
    orbit = orbit_of(parameters, drive, start=start)
    verdict = orbit.verdict(tolerance)
    if turns is None:
        # as many as change the deviation by more than NOTABLE, where that can be had
        turns = int(min(MOST_TURNS, max(FEWEST_TURNS, 2.0 * log(NOTABLE) / max(abs(verdict.margin), 1e-12))))
    scale = scale_of(parameters, drive, orbit.start)
    direction, measure = _leading(orbit, scale)
    begin = orbit.start + disturbance * scale * direction
    passed, message = _passages(parameters, drive, begin, turns)
    away = (passed - orbit.start) / scale
    size = np.linalg.norm(away, axis=1)
    outside = np.flatnonzero((size > LINEAR) | (size < NOISE))
    used = np.abs(away @ measure)[: outside[0] if len(outside) else None]
    growth = _growth(used)
    factor = growth ** len(used)
    if factor > NOTABLE or size.max() > NOTABLE * LINEAR:
        outcome = Outcome.GROWS
    else:
        outcome = Outcome.DECAYS if factor < 1.0 / NOTABLE else Outcome.BOUNDED
    return Confirmation(verdict=verdict, outcome=outcome, growth=growth, deviations=size / size[0], message=message)


def _passages(
    parameters: Parameters, drive: Drive, start: NDArray[np.float64], turns: int
) -> tuple[NDArray[np.float64], str]:
    """y at crank angle 0 of each turn, and why the run ended early, if it did."""
    if drive.speed is not None:
        mechanism = mechanism_of(parameters)
        flow = drive.flow(mechanism)
        x, count = flow.state(start, drive.vector(mechanism)), len(mechanism.freedoms)
        initial: dict[str, float] = {}
        for number, freedom in enumerate(mechanism.freedoms):
            initial |= dict(zip(freedom.initial, (x[number], x[count + number])))
        turn = flow.period / drive.speed
        run = simulate(
            parameters,
            drive.inputs(mechanism),
            initial=mechanism.initial(**initial),
            samples=turn * np.arange(turns + 1),
            stop_time=turn * turns,
            tolerance=1e-12,
        )
        return np.column_stack([run[name] for name, _ in flow.components]), run.message
    passed = [start]
    for _ in range(turns):
        try:
            passed.append(passed[-1] + period_from(parameters, drive, passed[-1], 1).shift)
        except OrbitError as error:
            return np.array(passed), str(error)
    return np.array(passed), ""


def points_to_confirm(found: Grid) -> list[tuple[int, int]]:
    """Three points of a grid that put it to the test: its most stable, its least stable, and the one nearest to a boundary.

    The last is the point of the least margin, to either side, that a long run can still measure, and none of the two others.

    Returns
    -------
    list of (int, int)
        Rows and columns; as many as have an orbit where these are fewer than three, none where the grid has none.
    """
    margin = 1.0 - found.largest
    if margin.count() == 0:
        return []
    places = list(dict.fromkeys((int(margin.argmax()), int(margin.argmin()))))
    size = np.ma.abs(margin)
    size.ravel()[places] = np.ma.masked
    near = np.ma.masked_where(size < MEASURABLE, size)
    if near.count():
        places.append(int(near.argmin()))
    row, column = np.unravel_index(places, margin.shape)
    return list(zip(row.tolist(), column.tolist()))


def _leading(orbit: PeriodicOrbit, scale: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Direction that grows most, of unit length, and what its growth is measured with, both in scaled components.

    The product with the left eigenvector of the largest multiplier takes that factor each turn, of a complex pair too, where
    the distance itself swings.
    """
    scaled = orbit.monodromy * scale / scale[:, None]
    values, left, right = scipy.linalg.eig(scaled, left=True)
    leading = int(np.argmax(np.abs(values)))
    direction = right[:, leading].real
    return direction / np.linalg.norm(direction), left[:, leading].conj()


def _growth(size: NDArray[np.float64]) -> float:
    """Factor a turn, by regression of the logarithms."""
    if len(size) < 2:
        raise LinkworkError("the deviation leaves the range of linear growth within a turn: take a smaller disturbance")
    return exp(float(np.polyfit(np.arange(len(size)), np.log(size), 1)[0]))
