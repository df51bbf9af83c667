"""Integrate a period with its variational equations, and find periodic motions by Newton's method: kernels of shooting.

The independent variable is the crank angle, so that the period is known beforehand, whatever drives the crank. The state y has
the coordinates of the free degrees of freedom other than the crank, their rates, and under a torque the crank's rate. The map
over a period is the Poincare map of the section at crank angle 0. The columns of dy/dy0, and if wanted dy/dlambda for a
parameter lambda, are integrated with y. The right-hand sides and their exact derivatives are traced from the equations
(`flow`). The integrator is that of `simulate`.

In all functions ``section`` is a `Section`; z is y followed by the columns of its derivatives; ``room`` is the work space
`Room`; ``carry`` has the step size to try next (rad) and the number of steps; ``hunt`` is a `Hunt`.
"""

from __future__ import annotations

from enum import IntEnum
from math import isfinite, isnan
from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64, types
from numpy.typing import NDArray

from linkwork.integrate import PROBE
from linkwork.limits import LIMIT_SINE, NEAR_LIMIT

from ...numerics.codegen import MATRIX, VECTOR, copy, evaluate, inner, kernel, part
from ...numerics.continuation import NOISE
from ...numerics.vectors import LANES
from ...run.compiled import write_lane
from ...run.stepping import (
    NODES,
    STAGES,
    Flow,
    attempt,
    bounded_step_size,
    interpolant,
    interpolate,
    leading_error,
    next_step_size,
    shorter_step_size,
    stage,
    step_short_of_limit,
)
from .flow import DIRECTIONAL, GAP, PLAIN, STATE, VARIATIONAL


class Status(IntEnum):
    """Result of an integration or a search: success, or the kind of failure."""

    DONE = 0
    LIMIT = 3
    NO_STEP = 4
    STALLED = 5
    DIVERGED = 6


# the statuses as plain integers, for the compiled code
DONE, LIMIT, NO_STEP, STALLED, DIVERGED = (int(status) for status in Status)
#: Least step of the integrator (rad), and the greatest number of steps per turn of the crank: without this limit the
#: integration from a start near a singular position, such as a slide at the pin of its guide, would not end.
LEAST_STEP, MOST_STEPS = 1e-12, 50000
#: Message for each status that is a failure.
REASONS = {
    Status.LIMIT: "the links come to the limit of assembly, or to where friction may jam them, within the period",
    Status.NO_STEP: f"the integrator cannot meet its tolerance, or only by more than {MOST_STEPS} steps per turn",
    Status.STALLED: "the crank comes to rest within the period",
    Status.DIVERGED: "Newton's method does not converge",
}
#: Greatest error of the columns of derivatives, relative to the tolerance, in a step across a kink.
_KINK = 1e6
#: Crank speed below which the crank counts as stalled, relative to its speed at the start.
STALL = 1e-3
#: Least fraction of a Newton correction that is tried: in Newton's method, and in the search for other motions.
_LEAST_FRACTION, _LEAST_SEARCHED = 1.0 / 4096.0, 1.0 / 64.0


class Section(NamedTuple):
    """Input of the kernels: functions and numbers of a flow, with their derivatives with respect to a parameter lambda."""

    equations: NDArray[np.int64]  # addresses of the flow's functions
    modes: NDArray[np.float64]
    drive: NDArray[np.float64]  # drive vector, then its derivatives by lambda
    p: NDArray[np.float64]  # constants of the equations, then their derivatives by lambda
    scale: NDArray[np.float64]  # magnitudes of y, shape (n,)
    angle_periods: NDArray[np.float64]  # whole turn of each component of y that is an angle, otherwise 0, shape (n,)
    along: float  # typical magnitude of lambda
    tolerance: float  # bound of the local error of a step
    torque: bool  # whether the crank's rate is the last component of y
    longest: float  # greatest step (rad)
    reach: NDArray[np.float64]  # greatest change of each free coordinate in a step, relative to its scale


SECTION = types.NamedTuple(
    (int64[::1], VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, float64, float64, boolean, float64, VECTOR), Section
)


@part
def replace_numbers(section, drive, p, scale, tolerance):
    """Return the section with new drive vector, constants p, scale and tolerance, and with 1 for the magnitude of lambda."""
    return Section(
        section.equations, section.modes, drive, p, scale, section.angle_periods, 1.0, tolerance, section.torque,
        section.longest, section.reach,
    )  # fmt: skip


@inner
def write_mechanism(lane, section, work):
    """Write the modes, the drive and the constants of a section into one lane of the work space ``work``."""
    write_lane(lane, LANES, section.modes, work.modes)
    write_lane(lane, LANES, section.drive, work.drive)
    write_lane(lane, LANES, section.p, work.p)


class Room(NamedTuple):
    """Work space of the integrator for z, which is y followed by the columns of its derivatives."""

    k: NDArray[np.float64]  # rates at the stages, shape (16, z)
    y: NDArray[np.float64]  # z after a step
    sizes: NDArray[np.float64]  # magnitudes of z
    gap: NDArray[np.float64]  # clearance to the limit of assembly, shape (1,)
    ahead: NDArray[np.float64]  # y after a small part of a step, shape (n,)


@part
def make_room(section, columns):
    """Return the work space of the integrator for y and ``columns`` columns of derivatives."""
    n = section.scale.shape[0]
    sizes = np.empty(n * (1 + columns))
    for i in range(n):
        sizes[i] = section.scale[i]
        for j in range(columns):
            sizes[n + j * n + i] = section.scale[i] / (section.scale[j] if j < n else section.along)
    return Room(np.zeros((16, sizes.shape[0])), np.empty(sizes.shape[0]), sizes, np.empty(1), np.empty(n))


@inner
def _clearance(section, angle, z, room):
    evaluate(section.equations[GAP], angle, z, section.modes, section.drive, section.p, room.gap)
    return room.gap[0]


@inner
def passes_kink(section, error, h, z, y, k, sizes, tolerance, lane, lanes):
    """Return whether the least step may be taken from z to y although its error is too large.

    Where the force of a law has a kink, as at a stop, the rates of the columns of derivatives jump: the error of these columns
    falls only in proportion to the step. The state itself must be accurate. ``error`` is relative to the tolerance.
    """
    n = section.scale.shape[0]
    if not error < _KINK or z.shape[0] == n * lanes:
        return False
    return leading_error(n, z, y, k, h, sizes, lane, lanes) <= tolerance


@inner
def most_steps(way):
    """Return the greatest number of steps over a crank angle (rad): for less than a turn, the number for a whole turn."""
    return MOST_STEPS * max(1.0, way / (2.0 * np.pi))


@inner
def _bounded_size(section, size, angle, z, room):
    """Shorten a step size until the step skips no force that acts over a short way only, and no limit of assembly.

    ``room.gap`` has the clearance at z, and ``room.k[0]`` the rates of z.
    """
    size = bounded_step_size(min(size, section.longest), room.k[0], section.reach, section.scale, 0, 1)
    clearance = room.gap[0]
    for i in range(section.scale.shape[0]):
        room.ahead[i] = z[i] + PROBE * size * room.k[0, i]
    return step_short_of_limit(size, clearance, _clearance(section, angle + PROBE * size, room.ahead, room))


@inner
def _take(section, equation, angle, end, slowest, z, room, carry):
    """Take one step from z, shortened until its error is accepted; return the status and the new crank angle.

    The step ends at ``end`` at the latest. The rates of z are in ``room.k[0]``, and its clearance in ``room.gap``. z after the
    step and its clearance are written into ``room.y`` and ``room.gap``. ``slowest`` is the crank speed below which the crank
    stalls; for ``carry`` see `advance`.
    """
    n = section.scale.shape[0]
    flow = Flow(equation, section.modes, section.p, room.sizes)
    # the step after a shortened one grows from it
    proposed = _bounded_size(section, carry[0], angle, z, room)
    while True:
        # avoid a tiny last step before the end
        last = angle + 1.001 * proposed >= end
        h = end - angle if last else proposed
        error = attempt(flow, 0.0, angle, h, z, room, section.drive, -1, None) / section.tolerance
        carry[1] += 1.0
        if error <= 1.0:
            break
        # beyond the limit of assembly the error is NaN
        proposed = shorter_step_size(h, error)
        if proposed < LEAST_STEP:
            if passes_kink(section, error, h, z, room.y, room.k, room.sizes, section.tolerance, 0, 1):
                break
            return (LIMIT if _clearance(section, angle, z, room) < NEAR_LIMIT else NO_STEP), angle
    carry[0] = next_step_size(h, proposed, error)
    angle = end if last else angle + h
    if not _clearance(section, angle, room.y, room) > LIMIT_SINE:
        return LIMIT, angle
    if section.torque and not room.y[n - 1] > slowest:
        return STALLED, angle
    return DONE, angle


@inner
def _enter(section, equation, angle, z, room):
    """Prepare an integration from z: write the rates of z at the crank angle into ``room.k[0]``.

    Return the status and the speed below which the crank stalls.
    """
    n = section.scale.shape[0]
    slowest = STALL * z[n - 1] if section.torque else 0.0
    if section.torque and not slowest > 0.0:
        return STALLED, slowest
    # a NaN, beyond the limit of assembly, compares as not positive
    if not _clearance(section, angle, z, room) > LIMIT_SINE:
        return LIMIT, slowest
    evaluate(equation, angle, z, section.modes, section.drive, section.p, room.k[0])
    return DONE, slowest


@inner
def advance(section, begin, end, z, room, carry):
    """Integrate z in place from one crank angle to another; return a `Status`.

    ``carry[0]`` is the first step size (rad) and becomes the proposed next step size; ``carry[1]`` counts steps.
    """
    n = section.scale.shape[0]
    size = z.shape[0]
    equation = section.equations[PLAIN if size == n else VARIATIONAL if size == n * (1 + n) else DIRECTIONAL]
    angle = begin
    status, slowest = _enter(section, equation, angle, z, room)
    most = carry[1] + most_steps(end - begin)
    while status == DONE and angle < end:
        if carry[1] > most:
            return NO_STEP
        status, angle = _take(section, equation, angle, end, slowest, z, room, carry)
        if status == DONE:
            copy(room.y, z)
            if angle < end:
                evaluate(equation, angle, z, section.modes, section.drive, section.p, room.k[0])
    return status


@inner
def start_piece(start, z):
    """Write the initial values of a piece of the period into z: y = ``start``, dy/dy0 the identity, dy/dlambda zero."""
    n = start.shape[0]
    for i in range(z.shape[0]):
        z[i] = 0.0
    for i in range(n):
        z[i] = start[i]
        if z.shape[0] > n:
            z[n + i * n + i] = 1.0


@inner
def difference(a, b, out):
    """Write a - b into ``out``, for as many components as ``out`` has."""
    for i in range(out.shape[0]):
        out[i] = a[i] - b[i]


@inner
def subtract_modulo_turns(a, b, periods, out):
    """Write a - b into ``out``, with whole turns removed from differences of angles."""
    for i in range(out.shape[0]):
        out[i] = a[i] - b[i]
        if periods[i] > 0.0:
            out[i] -= periods[i] * np.floor(out[i] / periods[i] + 0.5)


@inner
def move(start, fraction, correction, trial):
    """Write the start plus a fraction of a correction into ``trial``."""
    for i in range(start.shape[0]):
        trial[i] = start[i] + fraction * correction[i]


@inner
def magnitude(correction, scale):
    """Return the largest component of a correction relative to the scale; NaN if a component is NaN."""
    size = 0.0
    for i in range(scale.shape[0]):
        relative = abs(correction[i]) / scale[i]
        if isnan(relative):
            return relative
        size = max(size, relative)
    return size


@inner
def eliminate(system, size):
    """Solve a linear system in place by elimination with pivoting; return whether the system has a solution.

    The columns of ``system`` after the first ``size`` are the right-hand sides; they become the solutions.
    """
    width = system.shape[1]
    for c in range(size):
        pivot = c
        for r in range(c + 1, size):
            if abs(system[r, c]) > abs(system[pivot, c]):
                pivot = r
        # a NaN is no pivot either
        if not abs(system[pivot, c]) > 0.0:
            return False
        if pivot != c:
            for j in range(c, width):
                system[c, j], system[pivot, j] = system[pivot, j], system[c, j]
        inverse = 1.0 / system[c, c]
        for r in range(c + 1, size):
            factor = system[r, c] * inverse
            if factor != 0.0:
                for j in range(c + 1, width):
                    system[r, j] -= factor * system[c, j]
    for c in range(size - 1, -1, -1):
        inverse = 1.0 / system[c, c]
        for j in range(size, width):
            system[c, j] *= inverse
        for r in range(c):
            factor = system[r, c]
            for j in range(size, width):
                system[r, j] -= factor * system[c, j]
    return True


@inner
def correct_start(start, end, z, system, correction):
    """Compute Newton's correction of a start for y(end) = y(0); return whether the linear system has a solution.

    ``z`` gives the derivatives dy/dy0, and ``end`` gives y at the end; they may come from different starts.
    """
    n = start.shape[0]
    for i in range(n):
        for j in range(n):
            system[i, j] = (1.0 if i == j else 0.0) - z[n + j * n + i]
        system[i, n] = end[i] - start[i]
    solved = eliminate(system, n)
    for i in range(n):
        correction[i] = system[i, n]
    return solved


#: Result of `continue_newton` and `continue_deflated_newton` if another integration is needed.
GOING = -1
# Indices into `Hunt.numbers`: iterations, fraction of the correction that is tried, size of the correction, residual
_ITERATION, _FRACTION, _SIZE, _RESIDUAL = range(4)


class Hunt(NamedTuple):
    """State of a search by Newton's method between two integrations over the period."""

    start: NDArray[np.float64]  # last accepted start
    trial: NDArray[np.float64]  # start of the next integration
    correction: NDArray[np.float64]  # correction of ``start``
    following: NDArray[np.float64]  # work space: the next correction
    system: NDArray[np.float64]  # work space: the linear system
    last: NDArray[np.float64]  # z at the end of the integration from ``start``
    numbers: NDArray[np.float64]  # see the indices above


@inner
def begin_hunt(start, hunt):
    """Begin a search: ``start`` becomes the start of the first integration."""
    copy(start, hunt.start)
    copy(start, hunt.trial)
    hunt.numbers[_ITERATION], hunt.numbers[_FRACTION] = 0.0, 1.0
    hunt.numbers[_SIZE], hunt.numbers[_RESIDUAL] = 0.0, np.inf


@part
def make_hunt(start):
    """Return the state of a search that begins at ``start``, y of n components."""
    n = start.shape[0]
    hunt = Hunt(
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((n, n + 1)), np.zeros(n * (1 + n)), np.zeros(4)
    )
    begin_hunt(start, hunt)
    return hunt


@inner
def continue_newton(section, most, status, z, hunt):
    """Continue Newton's method after an integration from ``hunt.trial`` to z; return GOING or a `Status`.

    A correction is taken only in part in two cases: if the next correction, computed with the same matrix, would not be smaller
    (Deuflhard's natural monotonicity test), and if the integration from the corrected start fails. ``most`` is the greatest
    number of iterations.
    """
    scale, close = section.scale, 100.0 * section.tolerance
    start, trial, correction, following, system, last, numbers = hunt
    first = numbers[_ITERATION] == 0.0
    if first and status != DONE:
        return status
    taken = first
    if status == DONE and not first:
        correct_start(trial, z, last, system, following)
        next_size = magnitude(following, scale)
        # near the solution corrections stop falling at the integrator's error
        taken = next_size <= (1.0 - 0.25 * numbers[_FRACTION]) * numbers[_SIZE] or next_size <= close
    if not taken:
        numbers[_FRACTION] *= 0.5
        if numbers[_FRACTION] < _LEAST_FRACTION:
            # corrections below NOISE stop falling at the integrator's error, under steep friction or at kinks of a force law
            if status == DONE and numbers[_SIZE] > NOISE:
                return DIVERGED
            return status
        move(start, numbers[_FRACTION], correction, trial)
        return GOING
    numbers[_ITERATION] += 1.0
    copy(trial, start)
    copy(z, last)
    difference(z, trial, correction)
    numbers[_RESIDUAL] = magnitude(correction, scale)
    if not correct_start(trial, z, z, system, correction):
        return DIVERGED
    numbers[_SIZE] = magnitude(correction, scale)
    if not isfinite(numbers[_SIZE]):
        return DIVERGED
    if numbers[_SIZE] <= close:
        move(start, 1.0, correction, start)
        return DONE
    # after a correction taken in part the next one is tried less cautiously
    numbers[_FRACTION] = min(1.0, 4.0 * numbers[_FRACTION])
    move(start, numbers[_FRACTION], correction, trial)
    return GOING if numbers[_ITERATION] < most else DIVERGED


@inner
def continue_deflated_newton(section, most, reach, status, known, z, hunt):
    """Continue Newton's method with the known orbits divided out, as `search` describes; return GOING or a `Status`."""
    scale, n = section.scale, section.scale.shape[0]
    start, trial, correction, _, system, _, numbers = hunt
    if status != DONE:
        numbers[_FRACTION] *= 0.5
        if numbers[_ITERATION] == 0.0 or numbers[_FRACTION] < _LEAST_SEARCHED:
            return status
        move(start, numbers[_FRACTION], correction, trial)
        return GOING
    copy(trial, start)
    if not correct_start(trial, z, z, system, correction):
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
        move(start, 1.0, correction, start)
        return DONE
    if nearest == 0.0 or slope == 1.0:
        return DIVERGED
    for i in range(n):
        correction[i] /= 1.0 - slope
    size = magnitude(correction, scale)
    if size > reach:
        for i in range(n):
            correction[i] *= reach / size
    numbers[_FRACTION] = 1.0
    numbers[_ITERATION] += 1.0
    move(start, 1.0, correction, trial)
    return GOING if numbers[_ITERATION] < most else DIVERGED


@part
def newton(section, end, most, start, z, room, carry, report):
    """Solve y(end) = y(0) by Newton's method.

    For parameters and result see `solve`, for ``room`` and ``carry`` see `advance`.
    """
    hunt = make_hunt(start)
    what = GOING
    while what == GOING:
        start_piece(hunt.trial, z)
        what = continue_newton(section, most, advance(section, 0.0, end, z, room, carry), z, hunt)
    copy(hunt.start, start)
    report[0], report[1] = hunt.numbers[_RESIDUAL], hunt.numbers[_ITERATION]
    return what


@kernel(int64(SECTION, float64, int64, VECTOR, VECTOR, VECTOR), purpose="the search for periodic motions")
def solve(section, end, most, start, z, report):
    """Find a periodic orbit by Newton's method with step control on the map over a period.

    Parameters
    ----------
    section : Section
    end : float
        Crank angle at the end of the period (rad).
    most : int
        Greatest number of iterations.
    start : ndarray, shape (n,)
        Guess of y at crank angle 0; overwritten, with the solution if the status is DONE.
    z : ndarray, shape (n (1 + n),)
        Output: y at the end of the period and the monodromy matrix by columns, of the last iterate.
    report : ndarray, shape (3,)
        Output: residual |y(end) - y(0)| relative to the scale before the last correction, iterations, steps.

    Returns
    -------
    int
        A `Status`.
    """
    room = make_room(section, section.scale.shape[0])
    carry = np.array([0.1, 0.0])
    status = newton(section, end, most, start, z, room, carry, report)
    report[2] = carry[1]
    return status


@part
def deflated_newton(section, end, most, reach, start, known, z, room, carry):
    """Run Newton's method with the known orbits divided out.

    For parameters and result see `search`, for ``room`` and ``carry`` see `advance`.
    """
    hunt = make_hunt(start)
    what = GOING
    while what == GOING:
        start_piece(hunt.trial, z)
        status = advance(section, 0.0, end, z, room, carry)
        what = continue_deflated_newton(section, most, reach, status, known, z, hunt)
    copy(hunt.start, start)
    return what


@kernel(
    int64(SECTION, float64, int64, float64, VECTOR, MATRIX, VECTOR),
    purpose="the search for coexisting motions",
)
def search(section, end, most, reach, start, known, z):
    """Find a periodic orbit that is not among the known orbits, by Newton's method with the known orbits divided out.

    The residual is multiplied by 1 + 1/d^2 for each known orbit at the distance d, so that the known orbits are no longer zeros
    (deflation: Brown and Gearhart 1971; Farrell, Birkisson and Funke 2015). The Newton correction of this product is a multiple
    of the correction of the residual itself.

    Parameters
    ----------
    reach : float
        Greatest size of a correction relative to the scale; larger corrections are shortened to this size.
    start : ndarray, shape (n,)
        Guess of y at crank angle 0; overwritten, with the solution to the tolerance of the search if the status is DONE.
    known : ndarray, shape (m, n)
        Starts of the known orbits; if m is 0, the search is plain Newton's method.
    z : ndarray, shape (n (1 + n),)
        Work space.

    For the other parameters and the result see `solve`.
    """
    room = make_room(section, section.scale.shape[0])
    return deflated_newton(section, end, most, reach, start, known, z, room, np.array([0.1, 0.0]))


@kernel(int64(SECTION, float64, float64, int64, VECTOR), purpose="the settling of motions")
def settle(section, turn, change, most, start):
    """Follow a motion until y changes by less than ``change`` over a turn, or for ``most`` turns; return a `Status`.

    ``turn`` is the crank angle (rad) of a turn or a common period. Whole turns of links do not count as a change. ``start`` is
    overwritten with y after the last turn.
    """
    room = make_room(section, 0)
    z = start.copy()
    carry = np.array([0.1, 0.0])
    for _ in range(most):
        status = advance(section, 0.0, turn, z, room, carry)
        if status != DONE:
            return status
        subtract_modulo_turns(z, start, section.angle_periods, start)
        size = magnitude(start, section.scale)
        copy(z, start)
        if size < change:
            return DONE
    return DONE


@kernel(int64(SECTION, VECTOR, MATRIX, VECTOR, MATRIX), purpose="the sampling of periodic motions")
def sample(section, stations, starts, angles, rows):
    """Sample a period at increasing crank angles by the integrator's interpolant; return a `Status`.

    Parameters
    ----------
    stations, starts : ndarray, shapes (k,) and (k, n)
        Increasing crank angles at which the pieces begin, the first 0, and the values of y at these angles.
    angles : ndarray, shape (m,)
        Crank angles of the samples.
    rows : ndarray, shape (m, states + inputs)
        Output: state of a run and channels at each angle.
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


@kernel(int64(SECTION, VECTOR, MATRIX, MATRIX), purpose="the integrator of periodic motions")
def segments(section, angles, starts, rows):
    """Integrate y with its derivatives over each piece of a period.

    Parameters
    ----------
    angles : ndarray, shape (k + 1,)
        Crank angles at which the pieces begin, and the end of the last (rad).
    starts : ndarray, shape (k, n)
        y at the beginning of each piece.
    rows : ndarray, shape (k, n (1 + columns))
        Output: y at the end of each piece; if columns is n or more, dy/dy0 by columns; if columns is n + 1, dy/dlambda.

    Returns
    -------
    int
        A `Status` other than DIVERGED.
    """
    room = make_room(section, rows.shape[1] // starts.shape[1] - 1)
    carry = np.array([0.1, 0.0])
    for piece in range(starts.shape[0]):
        start_piece(starts[piece], rows[piece])
        status = advance(section, angles[piece], angles[piece + 1], rows[piece], room, carry)
        if status != DONE:
            return status
    return DONE
