"""Compiled: all periodic motions of each of a row of mechanisms, and where starts end."""

from __future__ import annotations

import numpy as np
from numba import float64, int64, types

from ..numerics.codegen import CUBE, MATRIX, VECTOR, copy, inner, kernel
from .orbit_kernels import DONE, SECTION, advance, deflated, difference, magnitude, make_room, newton, numbered
from .starts import SAME

#: Periodic motions of a point at most that are kept.
MOST_ORBITS = 8


@inner
def _is_known(start, known, scale, away):
    """Whether a start is among the known ones."""
    found = False
    for k in range(known.shape[0]):
        difference(start, known[k], away)
        found = found or magnitude(away, scale) < SAME
    return found


@kernel(
    types.void(
        SECTION, types.UniTuple(MATRIX, 3), float64, int64, float64, VECTOR, MATRIX, types.UniTuple(CUBE, 3),
        int64[::1],
    ),
    purpose="grids of coexisting motions",
)  # fmt: skip
def solve_all(section, rows, end, most, loose, angles, guesses, found, counts):
    """All orbits of each of a row of mechanisms, as far as they are found: see `solve_row` for what is not said here.

    Each point's orbits are sought from those of the point before, then from every guess with the known ones divided out.

    Parameters
    ----------
    angles : ndarray, shape (samples,)
        Crank angles at which the first component of y is taken.
    found : tuple of ndarray, shapes (m, MOST_ORBITS, n), (m, MOST_ORBITS, n n) and (m, MOST_ORBITS, samples)
        Starts, monodromy matrices, and that component at these angles; written.
    counts : ndarray of int64, shape (m,)
        Orbits of each; written.
    """
    (parameters, drives, scales), (starts, monodromies, swings) = rows, found
    n = guesses.shape[1]
    z, single = np.empty(n * (1 + n)), np.empty(n)
    report, carry = np.zeros(3), np.array([0.1, 0.0])
    start = np.empty(n)
    for row in range(parameters.shape[0]):
        own = numbered(section, drives[row], parameters[row], scales[row], section.tolerance)
        wide = numbered(section, drives[row], parameters[row], scales[row], loose)
        room, plain = make_room(own, n), make_room(own, 0)
        count = 0
        before = counts[row - 1] if row > 0 else 0
        for place in range(before + guesses.shape[0]):
            while count < MOST_ORBITS:
                if place < before:
                    copy(starts[row - 1, place], start)
                else:
                    copy(guesses[place - before], start)
                    if deflated(wide, end, most, 1.0, start, starts[row, :count], z, room, carry) != DONE:
                        break
                if newton(own, end, most, start, z, room, carry, report) != DONE:
                    break
                if _is_known(start, starts[row, :count], own.scale, single):
                    break
                copy(start, starts[row, count])
                copy(z[n:], monodromies[row, count])
                copy(start, single)
                angle, carry[0] = 0.0, 0.1
                for i in range(angles.shape[0]):
                    if angles[i] > angle:
                        advance(own, angle, angles[i], single, plain, carry)
                        angle = angles[i]
                    swings[row, count, i] = single[0]
                count += 1
                if place < before:
                    break
        counts[row] = count


#: How a start ended that was followed until it stays with a motion: at the limit of assembly, or not within the turns.
LOST, UNSETTLED = -1, -2


@kernel(
    types.void(SECTION, float64, float64, int64, MATRIX, MATRIX, int64[::1]),
    purpose="basins of attraction",
)
def basins_of(section, turn, near, most, starts, known, ends):
    """Which of the known motions each start ends in, followed turn by turn.

    Parameters
    ----------
    turn : float
        Crank angle of a turn (rad).
    near : float
        Distance from a known start, relative to the scale, at which the motion counts as arrived.
    most : int
        Turns at most.
    starts, known : ndarray, shapes (m, n) and (k, n)
    ends : ndarray of int64, shape (m,)
        Number of the known motion, `LOST` where the links come to the limit of assembly, `UNSETTLED`; written.
    """
    room = make_room(section, 0)
    z, away, carry = np.empty(starts.shape[1]), np.empty(starts.shape[1]), np.array([0.1, 0.0])
    for row in range(starts.shape[0]):
        copy(starts[row], z)
        carry[0] = 0.1
        ends[row] = UNSETTLED
        for _ in range(most):
            for k in range(known.shape[0]):
                difference(z, known[k], away)
                if magnitude(away, section.scale) < near:
                    ends[row] = k
            if ends[row] >= 0:
                break
            if advance(section, 0.0, turn, z, room, carry) != DONE:
                ends[row] = LOST
                break
