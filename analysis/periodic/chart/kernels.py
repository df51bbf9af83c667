"""Compiled: the periodic motions of a row of mechanisms, one of each or all, and where starts end."""

from __future__ import annotations

import numpy as np
from numba import boolean, float64, int64, types

from ...numerics.codegen import CUBE, MATRIX, VECTOR, copy, inner, kernel, part
from ..motion.collocation import NODES, close, make_desk, spread
from ..motion.drive import SAME
from ..motion.kernels import (
    DIVERGED,
    DONE,
    NO_STEP,
    SECTION,
    advance,
    deflated,
    difference,
    magnitude,
    make_room,
    newton,
    numbered,
)

#: Elements of a turn, from few to many.
COUNTS = np.array([6, 8, 12, 16, 24, 32, 48])

#: `collocation.tail_of` below which fewer elements of a turn are taken, relative to the root of the integrator's tolerance.
IDLE = 0.7

#: Orbits of a row without a look whether elements suffice, after one where they did not.
_PAUSE = 8

#: Binomial coefficients with signs: the next of so many equally spaced values of a polynomial, from the last on.
_NEXT = np.array([[1.0, 0.0, 0.0, 0.0], [2.0, -1.0, 0.0, 0.0], [3.0, -3.0, 1.0, 0.0], [4.0, -6.0, 4.0, -1.0]])

PASSED = len(_NEXT)


@part
def settle_on(section, end, turns, level, start, angles, path, desk, room):
    """Begin with the fewest elements that suffice, from the given level of `COUNTS` on; the level, -1 if there is none."""
    y, w = path
    while level < len(COUNTS):
        m = COUNTS[level] * turns
        for e in range(m + 1):
            angles[e] = end * e / m
        if spread(section, angles, start, y[:m], w[:m], room) != DONE:
            return -1
        status = close(section, angles, y[:m], w[:m], desk, room)
        if status == DONE:
            return level
        if status != NO_STEP:
            return -1
        level += 1
    return -1


@part
def from_guess(own, wide, end, most, start, z, room, carry, report):
    """Newton's method from far, at first to the tolerance of a search."""
    status = newton(wide, end, most, start, z, room, carry, report)
    return newton(own, end, most, start, z, room, carry, report) if status == DONE else status


@inner
def predict(known, size, path):
    """The next of a vector, of which ``size`` numbers count, into the first row from so many before it."""
    for i in range(size):
        path[0, i] = 0.0
        for old in range(known):
            path[0, i] += _NEXT[known - 1, old] * path[1 + old, i]


@inner
def make_way(size, path):
    """Move what is known of a vector, of which ``size`` numbers count, on by a row."""
    for old in range(PASSED, 0, -1):
        copy(path[old - 1, :size], path[old, :size])


@part
def from_left(section, rows, end, turns, most, loose, smooth, guess, found):
    """Orbits of a row from the left to the right: by collocation as far as it goes, else by shooting."""
    (parameters, drives, scales), (starts, monodromies, status) = rows, found
    n = guess.shape[0]
    z = np.empty(n * (1 + n))
    carry = np.array([0.1, 0.0])
    report = np.zeros(3)
    start = np.empty(n)
    most_elements = COUNTS[-1] * turns
    angles = np.zeros(most_elements + 1)
    # of this orbit and of those before it, the last first: all numbers of one in a row, and by elements
    ys, ws = np.zeros((1 + PASSED, most_elements * n)), np.zeros((1 + PASSED, most_elements * NODES * (n // 2)))
    y, w = ys.reshape((1 + PASSED, most_elements, n)), ws.reshape((1 + PASSED, most_elements, NODES, n // 2))
    desk = make_desk(n, most_elements)
    level, known, pause = 0, 0, 0
    passed = 0
    for row in range(parameters.shape[0]):
        own = numbered(section, drives[row], parameters[row], scales[row], section.tolerance)
        room = make_room(own, n)
        what = DIVERGED
        if known:
            m = COUNTS[level] * turns
            predict(known, y[0, :m].size, ys)
            predict(known, w[0, :m].size, ws)
            what = close(own, angles[: m + 1], y[0, :m], w[0, :m], desk, room)
            if what == NO_STEP:
                # more elements; the start is good enough to go on from
                copy(y[0, 0], start)
                more = settle_on(own, end, turns, level + 1, start, angles, (y[0], w[0]), desk, room)
                level, known = max(more, 0), 0
                what = DONE if more >= 0 else NO_STEP
        by_collocation = what == DONE
        if not by_collocation:
            known = 0
            if passed > 1:
                # the secant through the last two
                for i in range(n):
                    start[i] = 2.0 * starts[row - 1, i] - starts[row - 2, i]
            elif passed == 1:
                copy(starts[row - 1], start)
            if passed:
                what = newton(own, end, most, start, z, room, carry, report)
            if what != DONE:
                copy(guess, start)
                wide = numbered(section, drives[row], parameters[row], scales[row], loose)
                what = from_guess(own, wide, end, most, start, z, room, carry, report)
        status[row] = what
        if what != DONE:
            passed = 0
            continue
        passed += 1
        if by_collocation:
            copy(y[0, 0], starts[row])
            for j in range(n):
                for i in range(n):
                    monodromies[row, j * n + i] = desk.monodromy[i, j]
        else:
            copy(start, starts[row])
            copy(z[n:], monodromies[row])
            pause -= 1
            if smooth and not section.torque and pause < 0:
                more = settle_on(own, end, turns, level, start, angles, (y[0], w[0]), desk, room)
                level, by_collocation = max(more, 0), more >= 0
                if not by_collocation:
                    pause = _PAUSE
        if by_collocation:
            m = COUNTS[level] * turns
            make_way(y[0, :m].size, ys)
            make_way(w[0, :m].size, ws)
            known = min(known + 1, PASSED)
            if level > 0 and desk.report[0] < IDLE * np.sqrt(section.tolerance):
                # fewer elements the next time, which is begun by shooting
                copy(y[0, 0], start)
                level -= 1
                known = 0


@part
def from_right(section, rows, end, most, found):
    """What was not found from the left may be found from the right."""
    (parameters, drives, scales), (starts, monodromies, status) = rows, found
    n = starts.shape[1]
    z, carry, report = np.empty(n * (1 + n)), np.array([0.1, 0.0]), np.zeros(3)
    for row in range(parameters.shape[0] - 2, -1, -1):
        if status[row] != DONE and status[row + 1] == DONE:
            own = numbered(section, drives[row], parameters[row], scales[row], section.tolerance)
            start = starts[row + 1].copy()
            if newton(own, end, most, start, z, make_room(own, n), carry, report) == DONE:
                status[row] = DONE
                copy(start, starts[row])
                copy(z[n:], monodromies[row])


@part
def from_others(section, rows, end, most, loose, guesses, found):
    """What was not found from a neighbour is sought from the guesses but the first, once it is found from the left again."""
    (parameters, drives, scales), (starts, monodromies, status) = rows, found
    n = starts.shape[1]
    z, carry, report = np.empty(n * (1 + n)), np.array([0.1, 0.0]), np.zeros(3)
    none = np.empty((0, n))
    for row in range(parameters.shape[0]):
        if status[row] == DONE:
            continue
        own = numbered(section, drives[row], parameters[row], scales[row], section.tolerance)
        wide = numbered(section, drives[row], parameters[row], scales[row], loose)
        room = make_room(own, n)
        for guess in range(0 if row > 0 and status[row - 1] == DONE else 1, guesses.shape[0]):
            start = guesses[guess].copy() if guess else starts[row - 1].copy()
            if (
                deflated(wide, end, most, 1.0, start, none, z, room, carry) == DONE
                and newton(own, end, most, start, z, room, carry, report) == DONE
            ):
                status[row] = DONE
                copy(start, starts[row])
                copy(z[n:], monodromies[row])
                break


@kernel(
    types.void(
        SECTION,
        types.UniTuple(MATRIX, 3),
        float64,
        int64,
        int64,
        float64,
        boolean,
        MATRIX,
        types.Tuple((MATRIX, MATRIX, int64[::1])),
    ),
    purpose="grids of periodic motions",
)
def solve_row(section, rows, end, turns, most, loose, smooth, guesses, found):
    """Orbits of a row of mechanisms, each begun from the last: the rows of a chart.

    By collocation from the PASSED orbits before, as far as it goes; where it does not, by shooting.

    Parameters
    ----------
    rows : tuple of ndarray, shapes (m, constants), (m, drive) and (m, n)
        Parameters, drives and scales as in `Section`, which has the rest.
    turns : int
        In a period.
    loose : float
        Tolerance of the search from further starts.
    smooth : bool
        Whether collocation serves.
    guesses : ndarray, shape (k, n)
        Start of the first; where Newton's method fails from the neighbour it is begun anew from there. An orbit that is not
        found from a neighbour on either side is sought from the others.
    found : tuple of ndarray, shapes (m, n), (m, n n) and (m,)
        Starts, y at crank angle 0, and monodromy matrices by columns, written where the status is DONE; the `Status` of each,
        int64.
    """
    from_left(section, rows, end, turns, most, loose, smooth, guesses[0].copy(), found)
    from_right(section, rows, end, most, found)
    missing = False
    for what in found[2]:
        missing |= what != DONE
    if missing:
        from_others(section, rows, end, most, loose, guesses, found)
        from_right(section, rows, end, most, found)


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
