"""Orbits of rows of mechanisms, each begun from its neighbour: what charts are made of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ..mechanisms import Parameters, mechanism_of
from . import row_kernels
from .drives import Drive
from .floquet import multipliers
from .flows import PLAIN, VARIATIONAL
from .orbit_kernels import Section, Status
from .orbits import INTEGRATOR_TOLERANCE, MOST_ITERATIONS, SEARCH_TOLERANCE, guess_of, section_of
from .starts import is_smooth, scale_of


class Row(NamedTuple):
    """A row of mechanisms as the kernels take it: what they share; constants, drives and magnitudes of y, each by rows."""

    section: Section
    constants: NDArray[np.float64]
    drives: NDArray[np.float64]
    scales: NDArray[np.float64]


def row_of(
    rows: Sequence[Parameters],
    drives: Sequence[Drive],
    start: NDArray[np.float64],
    *functions: int,
    tolerance: float = INTEGRATOR_TOLERANCE,
) -> Row:
    """What the kernels need of a row of mechanisms and their drives: see `section_of`."""
    mechanism = mechanism_of(rows[0])
    numbers = np.array([(*parameters.constants(),) for parameters in rows])
    vectors = np.array([drive.vector(mechanism) for drive in drives])
    return Row(
        section_of(rows[0], drives[0], start, *functions, tolerance=tolerance, beside=rows),
        np.hstack([numbers, np.zeros_like(numbers)]),
        np.hstack([vectors, np.zeros_like(vectors)]),
        np.array([scale_of(parameters, drive, start) for parameters, drive in zip(rows, drives)]),
    )


def largest_multipliers(
    rows: Sequence[Parameters],
    drives: Sequence[Drive],
    guesses: ArrayLike | None = None,
    *,
    turns: int = 1,
    tolerance: float = INTEGRATOR_TOLERANCE,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Largest Floquet multiplier of each of a row of mechanisms, every one on its own periodic orbit.

    Each is sought from its neighbour's start, so that they should be ordered along a line of a chart, then from the guesses.

    Parameters
    ----------
    rows, drives : sequences of m
    guesses : array_like, shape (n,) or (k, n), optional
        Start of the first, and others where nothing is found from there; see `find_orbit`.
    turns : int
    tolerance : float
        Bound of the integrator's local error.

    Returns
    -------
    values : ndarray, shape (m,)
        Largest modulus of the multipliers; NaN where there is none.
    starts : ndarray, shape (m, n)
        y at crank angle 0; NaN where there is none.
    status : ndarray of int, shape (m,)
        `orbit_kernels.Status`: 0 where an orbit was found.
    """
    mechanism = mechanism_of(rows[0])
    flow = drives[0].flow(mechanism)
    if any(drive.flow(mechanism).modes != flow.modes for drive in drives):
        raise InputError("a row has both drives by speed and by torque, or other modes: it must have one kind")
    given = (None,) if guesses is None else np.atleast_2d(np.asarray(guesses, dtype=float))
    starting = np.array([guess_of(flow, drives[0], guess) for guess in given])
    n, first = flow.size, starting[0]
    section, *points = row_of(rows, drives, first, PLAIN, VARIATIONAL, tolerance=tolerance)
    monodromies, starts = np.full((len(rows), n * n), np.nan), np.full((len(rows), n), np.nan)
    status = np.zeros(len(rows), dtype=np.int64)
    row_kernels.solve_row(
        section,
        tuple(points),
        flow.period * turns,
        turns,
        MOST_ITERATIONS,
        SEARCH_TOLERANCE,
        all(map(is_smooth, dict.fromkeys(rows))),
        starting,
        (starts, monodromies, status),
    )
    values = np.full(len(rows), np.nan)
    good = status == Status.DONE
    if good.any():
        values[good] = np.abs(multipliers(monodromies[good].reshape(-1, n, n)))[:, 0]
    return values, starts, status
