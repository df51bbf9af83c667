"""Compiled: one period of a mechanism with its variational equations, and Newton's method on the map over it.

The independent variable is the angle of the mechanism's cyclic freedom, the crank, so that a period is known beforehand
however it is driven. The state is y: the coordinates and the rates of the other freedoms, as far as they are free, and after
them the crank's rate where a torque drives it. The angle runs from 0, which makes the map over a period that of the Poincare
section there. With y are integrated the columns of dy/dy0 and, where asked for, dy/dlambda for a parameter. The right-hand
sides and their exact derivatives are traced from the equations (`flow`); the integrator is that of a run.
"""

from __future__ import annotations

from enum import IntEnum
from math import fabs, isfinite, isnan
from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64, types
from numpy.typing import NDArray

from linkwork.limits import LIMIT_SINE, NEAR_LIMIT

from ...numerics.codegen import MATRIX, VECTOR, copy, evaluate, inner, kernel, part
from ...run.stepping import NODES, STAGES, Flow, attempt, following, interpolant, interpolate, shorter, stage
from .flow import DIRECTIONAL, GAP, PLAIN, STATE, VARIATIONAL


class Status(IntEnum):
    """How an integration or a solution ended."""

    DONE = 0
    LIMIT = 3
    NO_STEP = 4
    STALLED = 5
    DIVERGED = 6


# as plain numbers, for the compiled code
DONE, LIMIT, NO_STEP, STALLED, DIVERGED = (int(status) for status in Status)

#: Each in words.
REASONS = {
    Status.LIMIT: "the links come to the limit of assembly, or to where friction may jam them, within the period",
    Status.NO_STEP: "the integrator cannot meet its tolerance",
    Status.STALLED: "the crank comes to rest within the period",
    Status.DIVERGED: "Newton's method does not converge",
}

#: Least fraction of a radian that a step may have.
_LEAST_STEP = 1e-9

#: Crank speed below which the crank counts as stalled, relative to that at the start.
_STALL = 1e-3

#: Least fraction of a Newton correction that is tried, and in the search for other motions.
_LEAST_FRACTION, _LEAST_SEARCHED = 1.0 / 4096.0, 1.0 / 64.0


class Section(NamedTuple):
    """A flow with numbers: addresses of its functions, modes, drive and constants with their directions after them, and
    magnitudes of y and of lambda; whether the crank's rate is the last of y."""

    equations: NDArray[np.int64]
    modes: NDArray[np.float64]
    drive: NDArray[np.float64]
    p: NDArray[np.float64]
    scale: NDArray[np.float64]
    along: float
    tolerance: float
    torque: bool


SECTION = types.NamedTuple((int64[::1], VECTOR, VECTOR, VECTOR, VECTOR, float64, float64, boolean), Section)


@part
def numbered(section, drive, p, scale, tolerance):
    """The same flow with other numbers."""
    return Section(section.equations, section.modes, drive, p, scale, 1.0, tolerance, section.torque)


class Room(NamedTuple):
    """Room to work in: stages, state at their end, magnitudes of z, the rate of one component."""

    k: NDArray[np.float64]
    y: NDArray[np.float64]
    sizes: NDArray[np.float64]
    gap: NDArray[np.float64]


@part
def make_room(section, columns):
    """Room for y and so many columns: magnitudes of y, of dy_i/dy0_j and of dy_i/dlambda."""
    n = section.scale.shape[0]
    sizes = np.empty(n * (1 + columns))
    for i in range(n):
        sizes[i] = section.scale[i]
        for j in range(columns):
            sizes[n + j * n + i] = section.scale[i] / (section.scale[j] if j < n else section.along)
    return Room(np.zeros((16, sizes.shape[0])), np.empty(sizes.shape[0]), sizes, np.empty(1))


@inner
def _clearance(section, angle, z, room):
    evaluate(section.equations[GAP], angle, z, section.modes, section.drive, section.p, room.gap)
    return room.gap[0]


@inner
def _take(section, equation, angle, end, slowest, z, room, carry):
    """A good step from z, its rates in room.k[0], as far as to ``end``: the status and the angle there; z there is room.y."""
    n = section.scale.shape[0]
    flow = Flow(equation, section.modes, section.p, room.sizes)
    proposed = carry[0]
    while True:
        # no sliver of a step before the end
        last = angle + 1.001 * proposed >= end
        h = end - angle if last else proposed
        error = attempt(flow, 0.0, angle, h, z, room, section.drive, -1, None) / section.tolerance
        carry[1] += 1.0
        if error <= 1.0:
            break
        # beyond the limit of assembly the error is NaN
        proposed = shorter(h, error)
        if proposed < _LEAST_STEP:
            return (LIMIT if _clearance(section, angle, z, room) < NEAR_LIMIT else NO_STEP), angle
    carry[0] = following(h, proposed, error)
    angle = end if last else angle + h
    if not _clearance(section, angle, room.y, room) > LIMIT_SINE:
        return LIMIT, angle
    if section.torque and not room.y[n - 1] > slowest:
        return STALLED, angle
    return DONE, angle


@inner
def _enter(section, equation, angle, z, room):
    """Rates of z at the beginning of a range of crank angles, into room.k[0]; the status, and the speed of a stalled crank."""
    n = section.scale.shape[0]
    slowest = _STALL * z[n - 1] if section.torque else 0.0
    if section.torque and not slowest > 0.0:
        return STALLED, slowest
    # a NaN, beyond the limit of assembly, compares as not positive
    if not _clearance(section, angle, z, room) > LIMIT_SINE:
        return LIMIT, slowest
    evaluate(equation, angle, z, section.modes, section.drive, section.p, room.k[0])
    return DONE, slowest


@inner
def advance(section, begin, end, z, room, carry):
    """Integrate z over a range of crank angles; carry[0] is the step to begin with and to go on with, carry[1] counts."""
    n = section.scale.shape[0]
    size = z.shape[0]
    equation = section.equations[PLAIN if size == n else VARIATIONAL if size == n * (1 + n) else DIRECTIONAL]
    angle = begin
    status, slowest = _enter(section, equation, angle, z, room)
    while status == DONE and angle < end:
        status, angle = _take(section, equation, angle, end, slowest, z, room, carry)
        if status == DONE:
            copy(room.y, z)
            if angle < end:
                evaluate(equation, angle, z, section.modes, section.drive, section.p, room.k[0])
    return status


@inner
def _begin(n, start, z):
    """z at the beginning of a period: the start, the identity, zeros along lambda."""
    for i in range(z.shape[0]):
        z[i] = 0.0
    for i in range(n):
        z[i] = start[i]
        if z.shape[0] > n:
            z[n + i * n + i] = 1.0


@kernel(int64(SECTION, float64, VECTOR, VECTOR), purpose="the integrator of periodic motions")
def period(section, end, z, carry):
    """Integrate y and as many columns of derivatives as ``z`` has room for from crank angle 0 to ``end``.

    Parameters
    ----------
    section : Section
    end : float
        Crank angle at the end (rad): the turns of a period times that of one.
    z : ndarray, shape (n (1 + columns),)
        y at the start, and at the end when it returns; then dy/dy0 by columns (columns = n), then dy/dlambda (n + 1).
    carry : ndarray, shape (2,)
        Step to begin with (rad), the one to go on with when it returns; steps taken are added to the second.

    Returns
    -------
    int
        A `Status` but DIVERGED.
    """
    n = section.scale.shape[0]
    room = make_room(section, z.shape[0] // n - 1)
    _begin(n, z.copy(), z)
    return advance(section, 0.0, end, z, room, carry)


@inner
def difference(a, b, out):
    """a - b, as many components as ``out`` has."""
    for i in range(out.shape[0]):
        out[i] = a[i] - b[i]


@inner
def moved(start, fraction, correction, trial):
    """A fraction of a correction added to a start."""
    for i in range(start.shape[0]):
        trial[i] = start[i] + fraction * correction[i]


@inner
def magnitude(correction, scale):
    """Largest component relative to the scale."""
    size = 0.0
    for i in range(scale.shape[0]):
        relative = abs(correction[i]) / scale[i]
        if isnan(relative):
            return relative
        size = max(size, relative)
    return size


@part
def newton(section, end, most, start, z, room, carry, report):
    """Newton's method for y(end) = y(0); see `solve`.

    A correction is taken in part where the next one, found with the same matrix, would not be smaller (Deuflhard's natural
    monotonicity test), or where it leads out of the domain.
    """
    scale, tolerance = section.scale, section.tolerance
    n = scale.shape[0]
    trial = start.copy()
    correction = np.zeros(n)
    following = np.empty(n)
    matrix = np.empty((n, n))
    size = 0.0
    fraction = 1.0
    report[0] = np.inf
    report[1] = 0.0
    for iteration in range(most):
        while True:
            _begin(n, trial, z)
            status = advance(section, 0.0, end, z, room, carry)
            if iteration == 0 and status != DONE:
                return status
            if status == DONE:
                if iteration == 0:
                    break
                difference(z, trial, following)
                solve_small(matrix.copy(), following)
                next_size = magnitude(following, scale)
                # near the solution corrections stop falling at the integrator's error
                if next_size <= (1.0 - 0.25 * fraction) * size or next_size <= 100.0 * tolerance:
                    break
            fraction *= 0.5
            if fraction < _LEAST_FRACTION:
                return status if status != DONE else DIVERGED
            moved(start, fraction, correction, trial)
        report[1] = iteration + 1.0
        copy(trial, start)
        difference(z, trial, correction)
        report[0] = magnitude(correction, scale)
        for i in range(n):
            for j in range(n):
                matrix[i, j] = (1.0 if i == j else 0.0) - z[n + j * n + i]
        if not solve_small(matrix.copy(), correction):
            return DIVERGED
        size = magnitude(correction, scale)
        if not isfinite(size):
            return DIVERGED
        # what was taken in part is tried less cautiously the next time
        fraction = min(1.0, 4.0 * fraction)
        if size <= 100.0 * tolerance:
            fraction = 1.0
        moved(start, fraction, correction, trial)
        if size <= 100.0 * tolerance:
            copy(trial, start)
            return DONE
    return DIVERGED


@inner
def solve_small(a, b):
    """Solve a x = b in place by elimination with pivots; whether it could be."""
    n = b.shape[0]
    for c in range(n):
        pivot = c
        for r in range(c + 1, n):
            if fabs(a[r, c]) > fabs(a[pivot, c]):
                pivot = r
        if a[pivot, c] == 0.0:
            return False
        for j in range(n):
            a[c, j], a[pivot, j] = a[pivot, j], a[c, j]
        b[c], b[pivot] = b[pivot], b[c]
        for r in range(c + 1, n):
            f = a[r, c] / a[c, c]
            for j in range(c, n):
                a[r, j] -= f * a[c, j]
            b[r] -= f * b[c]
    for c in range(n - 1, -1, -1):
        for j in range(c + 1, n):
            b[c] -= a[c, j] * b[j]
        b[c] /= a[c, c]
    return True


@kernel(int64(SECTION, float64, int64, VECTOR, VECTOR, VECTOR), purpose="the search for periodic motions")
def solve(section, end, most, start, z, report):
    """Periodic orbit by Newton's method with step control on the map over a period.

    Parameters
    ----------
    most : int
        Iterations at most.
    start : ndarray, shape (n,)
        Guess of y at crank angle 0; the solution when it returns DONE.
    z : ndarray, shape (n (1 + n),)
        y at the end of the period and the monodromy matrix by columns, of the last iterate; written.
    report : ndarray, shape (3,)
        Residual |y(end) - y(0)| relative to the scale before the last correction, iterations, steps; written.

    The others as for `period`. Returns a `Status`.
    """
    room = make_room(section, section.scale.shape[0])
    carry = np.array([0.1, 0.0])
    status = newton(section, end, most, start, z, room, carry, report)
    report[2] = carry[1]
    return status


@part
def deflated(section, end, most, reach, start, known, z, room, carry):
    """See `search`."""
    scale = section.scale
    n = scale.shape[0]
    trial = start.copy()
    correction = np.zeros(n)
    matrix = np.empty((n, n))
    for iteration in range(most):
        fraction = 1.0
        while True:
            _begin(n, trial, z)
            status = advance(section, 0.0, end, z, room, carry)
            if status == DONE:
                break
            fraction *= 0.5
            if iteration == 0 or fraction < _LEAST_SEARCHED:
                return status
            moved(start, fraction, correction, trial)
        copy(trial, start)
        difference(z, trial, correction)
        for i in range(n):
            for j in range(n):
                matrix[i, j] = (1.0 if i == j else 0.0) - z[n + j * n + i]
        if not solve_small(matrix, correction):
            return DIVERGED
        size = magnitude(correction, scale)
        if not isfinite(size):
            return DIVERGED
        # derivative of the logarithm of the factor along the correction
        slope = 0.0
        nearest = np.inf
        for k in range(known.shape[0]):
            square = along = 0.0
            for i in range(n):
                away = (start[i] - known[k, i]) / scale[i]
                square += away * away
                along += away * correction[i] / scale[i]
            nearest = min(nearest, square)
            if square > 0.0:
                slope -= 2.0 * along / (square * (1.0 + square))
        if size <= 100.0 * section.tolerance and nearest > 1e-6:
            moved(start, 1.0, correction, start)
            return DONE
        if nearest == 0.0 or slope == 1.0:
            return DIVERGED
        for i in range(n):
            correction[i] /= 1.0 - slope
        size = magnitude(correction, scale)
        if size > reach:
            for i in range(n):
                correction[i] *= reach / size
        moved(start, 1.0, correction, trial)
    return DIVERGED


@kernel(
    int64(SECTION, float64, int64, float64, VECTOR, MATRIX, VECTOR),
    purpose="the search for coexisting motions",
)
def search(section, end, most, reach, start, known, z):
    """Newton's method for a periodic orbit that is none of the known ones: each of these is divided out.

    The residual is multiplied by 1 + 1/d^2 for each known orbit at the distance d, so that the known ones are no zeros any more
    (deflation: Brown and Gearhart 1971; Farrell, Birkisson and Funke 2015). Its Newton correction is that of the residual
    itself times a number.

    Parameters
    ----------
    most : int
        Iterations at most.
    reach : float
        Greatest correction relative to the scale.
    start : ndarray, shape (n,)
        Guess of y at crank angle 0; the solution, to the tolerance of the search, when it returns DONE.
    known : ndarray, shape (m, n)
        Starts of the known orbits; with none it is Newton's method.
    z : ndarray, shape (n (1 + n),)
        Room to work in.

    The others as for `period`. Returns a `Status`.
    """
    room = make_room(section, section.scale.shape[0])
    return deflated(section, end, most, reach, start, known, z, room, np.array([0.1, 0.0]))


@kernel(int64(SECTION, float64, float64, int64, VECTOR), purpose="the settling of motions")
def settle(section, turn, change, most, start):
    """Follow the motion from ``start``, which is overwritten, turn by turn until one changes y by less than ``change``."""
    room = make_room(section, 0)
    z = start.copy()
    carry = np.array([0.1, 0.0])
    for _ in range(most):
        status = advance(section, 0.0, turn, z, room, carry)
        if status != DONE:
            return status
        difference(z, start, start)
        size = magnitude(start, section.scale)
        copy(z, start)
        if size < change:
            return DONE
    return DONE


@kernel(int64(SECTION, VECTOR, MATRIX, VECTOR, MATRIX), purpose="the sampling of periodic motions")
def sample(section, stations, starts, angles, rows):
    """States of a run and channels, shape (m, states + inputs), at increasing crank angles, by the integrator's interpolant.

    Parameters
    ----------
    stations, starts : ndarray, shapes (k,) and (k, n)
        Increasing crank angles, the first 0, at each of which y is begun anew, and y there.
    """
    n = starts.shape[1]
    room = make_room(section, 0)
    z, f, inside = starts[0].copy(), np.empty((7, n)), np.empty(n)
    carry = np.array([0.1, 0.0])
    k, equation, done = room.k, section.equations[PLAIN], 0
    for piece in range(stations.shape[0]):
        angle, end = stations[piece], angles[-1]
        if piece + 1 < stations.shape[0]:
            end = min(end, stations[piece + 1])
        copy(starts[piece], z)
        status, slowest = _enter(section, equation, angle, z, room)
        if status == DONE and done < angles.shape[0] and angles[done] <= angle:
            evaluate(section.equations[STATE], angle, z, section.modes, section.drive, section.p, rows[done])
            done += 1
        while status == DONE and angle < end:
            before = angle
            status, angle = _take(section, equation, angle, end, slowest, z, room, carry)
            h = angle - before
            evaluate(equation, angle, room.y, section.modes, section.drive, section.p, k[STAGES])
            if angles[done] <= angle:
                for s in range(STAGES + 1, k.shape[0]):
                    stage(s, z, k, h, inside)
                    evaluate(equation, before + NODES[s] * h, inside, section.modes, section.drive, section.p, k[s])
                interpolant(z, room.y, k, h, f)
            while done < angles.shape[0] and angles[done] <= angle:
                interpolate((angles[done] - before) / h, z, f, inside)
                evaluate(
                    section.equations[STATE], angles[done], inside, section.modes, section.drive, section.p, rows[done]
                )
                done += 1
            for i in range(n):
                z[i] = room.y[i]
                k[0, i] = k[STAGES, i]
        if status != DONE:
            return status
    return DONE


@kernel(int64(SECTION, VECTOR, MATRIX, MATRIX), purpose="multiple shooting")
def segments(section, angles, starts, rows):
    """Integrate y with its derivatives over each of the pieces of a period: see `period`.

    Parameters
    ----------
    angles : ndarray, shape (k + 1,)
        Crank angles at which the pieces begin, and the end of the last.
    starts : ndarray, shape (k, n)
        y at the beginning of each.
    rows : ndarray, shape (k, n (2 + n))
        y at the end of each, dy/dy there by columns, dy/dlambda; written.
    """
    room = make_room(section, rows.shape[1] // starts.shape[1] - 1)
    carry = np.array([0.1, 0.0])
    for piece in range(starts.shape[0]):
        _begin(starts.shape[1], starts[piece], rows[piece])
        status = advance(section, angles[piece], angles[piece + 1], rows[piece], room, carry)
        if status != DONE:
            return status
    return DONE
