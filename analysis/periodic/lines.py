"""A line of a chart: all motions on it, isolas among them, each followed along it to where it loses its stability.

A motion is followed, and begun from, as long as deviations grow less than a thousandfold in a turn. Folds and period doublings
beyond that, next to the limit of assembly, come in pairs with slivers of stability between them that no machine stays in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..numerics.continuation import ContinuationError
from .branches import Branch, follow_both
from .coexistence import Coexistence, coexistence
from .families import Family
from .orbits import OrbitError, orbit_of
from .planes import Plane
from .starts import scale_of

#: Points of a line at which all motions are sought; points of a branch at most to either side, and its greatest step.
POINTS, BRANCH_POINTS, STEP = 17, 600, 5e-2
#: Largest multiplier with which a motion is followed.
GREATEST = 1e3
#: Distance in scaled arc length at which a motion lies on a branch: the straight pieces are as near to it.
_ON = 2e-3


def branches_on(
    operation: Plane, x: tuple[float, float], y: float, *, name: str, unit: str, start: ArrayLike | None = None
) -> tuple[list[Branch], Coexistence, list[str]]:
    """Every motion that is found on the line y = const, followed to both sides until a branch passes each of them.

    Parameters
    ----------
    operation : callable
        See `plane`.
    x : (float, float)
        Range of the line.
    y : float
    name, unit : str
        Of x.
    start : array_like, shape (n,), optional
        See `coexistence`.

    Returns
    -------
    branches : list of Branch
    found : Coexistence
        The motions from which they were followed.
    lost : list of str
        Why one could not be followed, a sentence each.
    """
    xs = np.linspace(*x, POINTS)
    found = coexistence(operation, xs, [y], start=start)
    branches: list[Branch] = []
    lost: list[str] = []
    for value, starts, largest in zip(xs.tolist(), found.starts[0], found.largest[0].filled(np.inf)):
        parameters, drive = operation(value, y)
        family = Family(parameters=parameters, drive=drive, vary=lambda v: operation(v, y), name=name, unit=unit)
        for motion in starts[largest < GREATEST]:
            if any(passes(branch, value, motion, x[1] - x[0]) for branch in branches):
                continue
            try:
                orbit = orbit_of(parameters, drive, start=motion, settle=False)
                branch = follow_both(
                    family,
                    orbit,
                    value,
                    low=x[0],
                    high=x[1],
                    greatest=STEP,
                    most_points=BRANCH_POINTS,
                    stop=lambda orbit: orbit.largest > GREATEST,
                )
            except (OrbitError, ContinuationError) as error:
                lost.append(f"{family.format_value(value)}: {error}")
            else:
                branches.append(branch)
    return branches, found, lost


def distance(points: NDArray[np.float64], place: NDArray[np.float64]) -> float:
    """Least distance of a place, shape (n,), from the straight pieces between points, shape (m, n)."""
    s = points - place
    pieces = np.diff(s, axis=0)
    squares = np.maximum((pieces**2).sum(axis=1), 1e-300)
    along = np.clip(-(s[:-1] * pieces).sum(axis=1) / squares, 0.0, 1.0)
    feet = s[:-1] + along[:, None] * pieces
    return float(np.linalg.norm(np.vstack([s[:1], feet]), axis=1).min())


def passes(branch: Branch, value: float, motion: NDArray[np.float64], width: float) -> bool:
    """Whether a branch passes a motion, given by its start."""
    ends = [branch.orbits[i] for i in (branch.parameter.argmin(), branch.parameter.argmax())]
    scale = np.append(np.max([scale_of(o.parameters, o.drive, o.start) for o in ends], axis=0), width)
    points = np.column_stack([[orbit.start for orbit in branch.orbits], branch.parameter])
    return distance(points / scale, np.append(motion, value) / scale) < _ON
