"""Compiled: one period of the plant with its variational equations, and Newton's method on the map over it.

The independent variable is the crank angle, so that a period is known beforehand in either drive. The state is y = (u, u')
at prescribed speed and y = (u, u', w2) under a torque; the angle runs from 0, which makes the map over a period that of the
Poincare section th2 = 0. With y are integrated the columns of dy/dy0 and, where asked for, dy/dlambda for a parameter. The
right-hand sides and their exact derivatives are those that `symbolic` traces from the plant; they are traced only where the
machine code is not in the cache. The integrator is DOP853 as in `compiled`, for any number of columns.
"""

from __future__ import annotations

from functools import cache
from math import cos, fabs, isfinite, pi, sin, sqrt, tanh
from typing import Any

import numpy as np
from numba import boolean, float64, int64, njit
from numba.extending import overload

from linkwork.five_bar import dynamics, kinematics
from linkwork.limits import LIMIT_SINE

from ..numerics import symbolic
from ..run.compiled import (
    CONSTANTS,
    EXPONENT,
    FROM,
    MATRIX,
    NODES,
    ROW,
    STAGES,
    VECTOR,
    WEIGHT,
    constants,
    inner,
    kernel,
    local_error,
)

# what Numba traces while it compiles would fail with an error of Numba's: say it here
symbolic.library()

#: What drives the plant over an orbit: the prescribed speed, or the torque and an induction motor's breakdown torque,
#: breakdown slip and synchronous speed (no motor with breakdown torque 0); slider force and load at P.
DRIVE = ("level", "breakdown_torque", "breakdown_slip", "synchronous_speed", "force", "load_x", "load_y")

# Status of an integration or a solution
DONE = 0
LIMIT = 3  # the links come to the limit of assembly
NO_STEP = 4  # the tolerance cannot be met
STALLED = 5  # the crank comes to rest
DIVERGED = 6  # Newton's method does not converge

#: Each in words.
REASONS = {
    LIMIT: "the links come to the limit of assembly within the period",
    NO_STEP: "the integrator cannot meet its tolerance",
    STALLED: "the crank comes to rest within the period",
    DIVERGED: "Newton's method does not converge",
}

#: Least fraction of a radian that a step may have.
_LEAST_STEP = 1e-9
#: Crank speed below which the crank counts as stalled, relative to that at the start.
_STALL = 1e-3
#: Least fraction of a Newton correction that is tried.
_LEAST_FRACTION = 1.0 / 4096.0


def _torque_of(drive: Any, w: Any) -> Any:
    """Torque of drive and motor (Kloss's formula as in `compiled`) at crank speed ``w``."""
    slip = 1.0 - w / drive[3]
    return drive[0] + 2.0 * drive[1] * slip * drive[2] / (slip * slip + drive[2] * drive[2])


@cache
def flow(speed_drive: bool, direction: bool) -> Any:
    """Rates dy/dth2 and their exact derivatives as a ``casadi.Function``.

    Parameters
    ----------
    speed_drive : bool
        y = (u, u') at the speed drive[0], else y = (u, u', w2).
    direction : bool
        Whether the derivative along a direction in drive and constants is an output too.

    Returns
    -------
    casadi.Function
        Of th2, y, drive (7), constants (29) and, with ``direction``, its components in both; outputs f (n), df/dy (n, n),
        and df/dlambda (n).
    """
    casadi = symbolic.library()
    plant = symbolic.plant()
    n = 2 if speed_drive else 3
    th2, y, drive = casadi.SX.sym("th2"), casadi.SX.sym("y", n), casadi.SX.sym("drive", len(DRIVE))
    p, k = symbolic.constants()
    w = drive[0] if speed_drive else y[2]
    torque = 0.0 if speed_drive else _torque_of(casadi.vertsplit(drive), w)
    inputs = dynamics.Inputs(float(speed_drive), torque, 0.0, drive[4], drive[5], drive[6])
    _, _, e2, a, _, _ = plant.derivative((th2, y[0], w, y[1], 0.0, 0.0), inputs, k)
    rates = [y[1] / w, a / w] if speed_drive else [y[1] / w, a / w, e2 / w]
    f = casadi.vertcat(*rates)
    arguments, results = [th2, y, drive, p], [f, casadi.densify(casadi.jacobian(f, y))]
    if direction:
        d_drive, d_p = casadi.SX.sym("d_drive", len(DRIVE)), casadi.SX.sym("d_p", p.numel())
        arguments += [d_drive, d_p]
        results.append(casadi.densify(casadi.jtimes(f, drive, d_drive) + casadi.jtimes(f, p, d_p)))
    return casadi.Function("flow", arguments, results, {"cse": True})


_motor = inner(_torque_of)


def _written(speed_drive: bool, direction: bool) -> Any:
    """`flow` as a compiled function; traced only when Numba asks for its type."""
    space = {"sin": sin, "cos": cos, "sqrt": sqrt, "tanh": tanh, "fabs": fabs}
    exec(symbolic.source(flow(speed_drive, direction), "written"), space)
    return inner(space["written"])


def _speed_flow(th2: float, y: Any, drive: Any, p: Any) -> Any:
    """f (2) and df/dy (4, by columns) at prescribed speed."""


def _speed_flow_along(th2: float, y: Any, drive: Any, p: Any, d_drive: Any, d_p: Any) -> Any:
    """The same and df/dlambda (2)."""


def _torque_flow(th2: float, y: Any, drive: Any, p: Any) -> Any:
    """f (3) and df/dy (9, by columns) under a torque."""


def _torque_flow_along(th2: float, y: Any, drive: Any, p: Any, d_drive: Any, d_p: Any) -> Any:
    """The same and df/dlambda (3)."""


@overload(_speed_flow)
def _(th2, y, drive, p):  # type: ignore[no-untyped-def]
    written = _written(True, False)
    return lambda th2, y, drive, p: written(th2, y, drive, p)


@overload(_speed_flow_along)
def _(th2, y, drive, p, d_drive, d_p):  # type: ignore[no-untyped-def]
    written = _written(True, True)
    return lambda th2, y, drive, p, d_drive, d_p: written(th2, y, drive, p, d_drive, d_p)


@overload(_torque_flow)
def _(th2, y, drive, p):  # type: ignore[no-untyped-def]
    written = _written(False, False)
    return lambda th2, y, drive, p: written(th2, y, drive, p)


@overload(_torque_flow_along)
def _(th2, y, drive, p, d_drive, d_p):  # type: ignore[no-untyped-def]
    written = _written(False, True)
    return lambda th2, y, drive, p, d_drive, d_p: written(th2, y, drive, p, d_drive, d_p)


@inner
def _rate(speed_drive, columns, th2, z, drive, p, d_drive, d_p, out):  # type: ignore[no-untyped-def]
    """dz/dth2, z being y, then ``columns`` columns of derivatives; the last of n + 1 is that along lambda."""
    if speed_drive:
        if columns == 0:
            r = _speed_flow(th2, z, drive, p)
            out[0] = r[0]
            out[1] = r[1]
        elif columns == 2:
            r = _speed_flow(th2, z, drive, p)
            out[0] = r[0]
            out[1] = r[1]
            for j in range(2):
                c = 2 + 2 * j
                out[c] = r[2] * z[c] + r[4] * z[c + 1]
                out[c + 1] = r[3] * z[c] + r[5] * z[c + 1]
        else:
            q = _speed_flow_along(th2, z, drive, p, d_drive, d_p)
            out[0] = q[0]
            out[1] = q[1]
            for j in range(3):
                c = 2 + 2 * j
                out[c] = q[2] * z[c] + q[4] * z[c + 1]
                out[c + 1] = q[3] * z[c] + q[5] * z[c + 1]
            out[6] += q[6]
            out[7] += q[7]
    elif columns == 4:
        q = _torque_flow_along(th2, z, drive, p, d_drive, d_p)
        for i in range(3):
            out[i] = q[i]
        for j in range(4):
            c = 3 + 3 * j
            for i in range(3):
                out[c + i] = q[3 + i] * z[c] + q[6 + i] * z[c + 1] + q[9 + i] * z[c + 2]
        for i in range(3):
            out[12 + i] += q[12 + i]
    else:
        r = _torque_flow(th2, z, drive, p)
        for i in range(3):
            out[i] = r[i]
        for j in range(columns):
            c = 3 + 3 * j
            for i in range(3):
                out[c + i] = r[3 + i] * z[c] + r[6 + i] * z[c + 1] + r[9 + i] * z[c + 2]


@inner
def _stage(s, size, z, k, h, y):  # type: ignore[no-untyped-def]
    """State at stage s of a step of size h from z; stage 12 is its end."""
    for i in range(size):
        y[i] = 0.0
    for n in range(ROW[s], ROW[s + 1]):
        weight = WEIGHT[n]
        stage = FROM[n]
        for i in range(size):
            y[i] += weight * k[stage, i]
    for i in range(size):
        y[i] = z[i] + h * y[i]


@inner
def _turn(speed_drive, columns, p, drive, d_drive, d_p, begin, end, tolerance, scale, z, k, y, carry):  # type: ignore[no-untyped-def]
    """Integrate z over a range of crank angles; carry[0] is the step to begin with and to go on with, carry[1] counts."""
    n = 2 if speed_drive else 3
    size = n * (1 + columns)
    th2 = begin
    slowest = _STALL * (drive[0] if speed_drive else z[2])
    if not slowest > 0.0:
        return STALLED
    g = kinematics.position(th2, z[0], p)
    # a NaN, beyond the limit of assembly, compares as not positive
    if not p.branch * g.s43 > LIMIT_SINE:
        return LIMIT
    _rate(speed_drive, columns, th2, z, drive, p, d_drive, d_p, k[0])
    h_next = carry[0]
    while th2 < end:
        h = h_next
        last = False
        # no sliver of a step before the end
        if th2 + 1.001 * h >= end:
            h = end - th2
            last = True
        for s in range(1, STAGES):
            _stage(s, size, z, k, h, y)
            _rate(speed_drive, columns, th2 + NODES[s] * h, y, drive, p, d_drive, d_p, k[s])
        _stage(STAGES, size, z, k, h, y)
        error = local_error(size, z, y, k, h, scale) / tolerance
        carry[1] += 1.0
        if not error <= 1.0:
            # beyond the limit of assembly the error is NaN
            h_next = h * (max(0.2, 0.9 * error**EXPONENT) if isfinite(error) else 0.1)
            if h_next < _LEAST_STEP:
                g = kinematics.position(th2, z[0], p)
                return LIMIT if p.branch * g.s43 < 0.05 else NO_STEP
            continue
        factor = 6.0 if error == 0.0 else min(6.0, 0.9 * error**EXPONENT)
        h_next = max(h_next, factor * h) if last else max(0.2, factor) * h
        th2 = end if last else th2 + h
        g = kinematics.position(th2, y[0], p)
        if not p.branch * g.s43 > LIMIT_SINE:
            return LIMIT
        if not speed_drive and not y[2] > slowest:
            return STALLED
        for i in range(size):
            z[i] = y[i]
        if not last:
            _rate(speed_drive, columns, th2, z, drive, p, d_drive, d_p, k[0])
    carry[0] = h_next
    return DONE


@inner
def _begin(n, columns, start, z):  # type: ignore[no-untyped-def]
    """z at the beginning of a period: the start, the identity, zeros along lambda."""
    for i in range(n * (1 + columns)):
        z[i] = 0.0
    for i in range(n):
        z[i] = start[i]
        if columns > 0:
            z[n + i * n + i] = 1.0


@njit(error_model="numpy")
def _scales(n, columns, scale, along):  # type: ignore[no-untyped-def]
    """Magnitudes of z: those of y, of dy_i/dy0_j and of dy_i/dlambda."""
    out = np.empty(n * (1 + columns))
    for i in range(n):
        out[i] = scale[i]
        for j in range(columns):
            out[n + j * n + i] = scale[i] / (scale[j] if j < n else along)
    return out


@kernel(int64(boolean, CONSTANTS, VECTOR, VECTOR, CONSTANTS, float64, float64, VECTOR, float64, VECTOR, VECTOR))
def period(speed_drive, p, drive, d_drive, d_p, end, tolerance, scale, along, z, carry):  # type: ignore[no-untyped-def]
    """Integrate y and as many columns of derivatives as ``z`` has room for from crank angle 0 to ``end``.

    Parameters
    ----------
    speed_drive : bool
    p : Constants
    drive : ndarray, shape (7,)
        See `DRIVE`.
    d_drive, d_p : ndarray, shape (7,), and Constants
        Derivatives of both with respect to lambda.
    end : float
        Crank angle at the end (rad): 2 pi times the turns of a period.
    tolerance : float
    scale : ndarray, shape (n,)
        Magnitudes of y.
    along : float
        Magnitude of lambda.
    z : ndarray, shape (n (1 + columns),)
        y at the start, and at the end when it returns; then dy/dy0 by columns (columns = n), then dy/dlambda (n + 1).
    carry : ndarray, shape (2,)
        Step to begin with (rad), the one to go on with when it returns; steps taken are added to the second.

    Returns
    -------
    int
        DONE, LIMIT, NO_STEP or STALLED.
    """
    n = 2 if speed_drive else 3
    columns = z.shape[0] // n - 1
    sizes = _scales(n, columns, scale, along)
    k = np.zeros((13, z.shape[0]))
    y = np.empty(z.shape[0])
    _begin(n, columns, z.copy(), z)
    return _turn(speed_drive, columns, p, drive, d_drive, d_p, 0.0, end, tolerance, sizes, z, k, y, carry)


@njit(error_model="numpy")
def _solve(speed_drive, p, drive, end, tolerance, scale, most, start, z, k, y, sizes, carry, report):  # type: ignore[no-untyped-def]
    """Newton's method for y(end) = y(0); see `solve`.

    A correction is taken in part where the next one, found with the same matrix, would not be smaller (Deuflhard's natural
    monotonicity test), or where it leads out of the domain.
    """
    n = 2 if speed_drive else 3
    trial = start.copy()
    correction = np.zeros(n)
    following = np.empty(n)
    matrix = np.empty((n, n))
    work = np.empty((n, n))
    size = 0.0
    fraction = 1.0
    report[0] = np.inf
    report[1] = 0.0
    for iteration in range(most):
        while True:
            _begin(n, n, trial, z)
            status = _turn(speed_drive, n, p, drive, drive, p, 0.0, end, tolerance, sizes, z, k, y, carry)
            if iteration == 0 and status != DONE:
                return status
            if status == DONE:
                if iteration == 0:
                    break
                for i in range(n):
                    following[i] = z[i] - trial[i]
                work[:] = matrix
                _solve_small(work, following)
                next_size = 0.0
                for i in range(n):
                    next_size = max(next_size, abs(following[i]) / scale[i])
                # near the solution corrections stop falling at the integrator's error
                if next_size <= (1.0 - 0.25 * fraction) * size or next_size <= 100.0 * tolerance:
                    break
            fraction *= 0.5
            if fraction < _LEAST_FRACTION:
                return status if status != DONE else DIVERGED
            for i in range(n):
                trial[i] = start[i] + fraction * correction[i]
        report[0] = 0.0
        report[1] = iteration + 1.0
        for i in range(n):
            start[i] = trial[i]
            correction[i] = z[i] - trial[i]
            report[0] = max(report[0], abs(correction[i]) / scale[i])
            for j in range(n):
                matrix[i, j] = (1.0 if i == j else 0.0) - z[n + j * n + i]
        work[:] = matrix
        if not _solve_small(work, correction):
            return DIVERGED
        size = 0.0
        for i in range(n):
            size = max(size, abs(correction[i]) / scale[i])
        if not isfinite(size):
            return DIVERGED
        # what was taken in part is tried less cautiously the next time
        fraction = min(1.0, 4.0 * fraction)
        if size <= 100.0 * tolerance:
            fraction = 1.0
        for i in range(n):
            trial[i] = start[i] + fraction * correction[i]
        if size <= 100.0 * tolerance:
            for i in range(n):
                start[i] = trial[i]
            return DONE
    return DIVERGED


@inner
def _solve_small(a, b):  # type: ignore[no-untyped-def]
    """Solve a x = b in place by elimination with pivots; whether it could be."""
    n = b.shape[0]
    for c in range(n):
        pivot = c
        for r in range(c + 1, n):
            if abs(a[r, c]) > abs(a[pivot, c]):
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


@kernel(int64(boolean, CONSTANTS, VECTOR, float64, float64, VECTOR, int64, VECTOR, VECTOR, VECTOR))
def solve(speed_drive, p, drive, end, tolerance, scale, most, start, z, report):  # type: ignore[no-untyped-def]
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

    The others, and what it returns, as for `period`; also DIVERGED.
    """
    n = 2 if speed_drive else 3
    sizes = _scales(n, n, scale, 1.0)
    k = np.zeros((13, z.shape[0]))
    y = np.empty(z.shape[0])
    carry = np.array([0.1, 0.0])
    status = _solve(speed_drive, p, drive, end, tolerance, scale, most, start, z, k, y, sizes, carry, report)
    report[2] = carry[1]
    return status


@kernel(int64(boolean, CONSTANTS, VECTOR, float64, VECTOR, float64, int64, VECTOR))
def settle(speed_drive, p, drive, tolerance, scale, change, most, start):  # type: ignore[no-untyped-def]
    """Follow the motion from ``start``, which is overwritten, turn by turn until one changes y by less than ``change``."""
    n = 2 if speed_drive else 3
    sizes = _scales(n, 0, scale, 1.0)
    k = np.zeros((13, n))
    y = np.empty(n)
    z = start.copy()
    carry = np.array([0.1, 0.0])
    for _ in range(most):
        status = _turn(speed_drive, 0, p, drive, drive, p, 0.0, 2.0 * pi, tolerance, sizes, z, k, y, carry)
        if status != DONE:
            return status
        size = 0.0
        for i in range(n):
            size = max(size, abs(z[i] - start[i]) / scale[i])
            start[i] = z[i]
        if size < change:
            return DONE
    return DONE


@kernel(int64(boolean, CONSTANTS, VECTOR, float64, VECTOR, VECTOR, VECTOR, MATRIX, MATRIX))
def sample(speed_drive, p, drive, tolerance, scale, start, angles, states, forces):  # type: ignore[no-untyped-def]
    """States of the plant, shape (m, 6), and what acts on it, (m, 6), at increasing crank angles, from ``start`` at 0."""
    n = 2 if speed_drive else 3
    sizes = _scales(n, 0, scale, 1.0)
    k = np.zeros((13, n))
    y = np.empty(n)
    z = start.copy()
    carry = np.array([0.1, 0.0])
    th2 = 0.0
    for i in range(angles.shape[0]):
        if angles[i] > th2:
            status = _turn(speed_drive, 0, p, drive, drive, p, th2, angles[i], tolerance, sizes, z, k, y, carry)
            if status != DONE:
                return status
            th2 = angles[i]
        w = drive[0] if speed_drive else z[2]
        states[i, 0] = th2
        states[i, 1] = z[0]
        states[i, 2] = w
        states[i, 3] = z[1]
        states[i, 4] = 0.0
        states[i, 5] = 0.0
        forces[i, 0] = 1.0 if speed_drive else 0.0
        forces[i, 1] = 0.0 if speed_drive else _motor(drive, w)
        forces[i, 2] = 0.0
        forces[i, 3] = drive[4]
        forces[i, 4] = drive[5]
        forces[i, 5] = drive[6]
    return DONE


@kernel(int64[::1](boolean, MATRIX, MATRIX, float64, float64, MATRIX, int64, VECTOR, MATRIX, MATRIX))
def solve_row(speed_drive, parameters, drives, end, tolerance, scales, most, guess, starts, monodromies):  # type: ignore[no-untyped-def]
    """Orbits of a row of mechanisms, each begun from the last: the rows of a chart.

    Parameters
    ----------
    parameters, drives : ndarray, shapes (m, 29) and (m, 7)
    scales : ndarray, shape (m, n)
    guess : ndarray, shape (n,)
        Start of the first.
    starts, monodromies : ndarray, shapes (m, n) and (m, n n)
        y at crank angle 0, and the monodromy matrix by columns; written where the status is DONE.

    Returns
    -------
    ndarray of int64, shape (m,)
        Status of each. Where Newton's method fails from the neighbour it is begun anew from the guess.
    """
    n = 2 if speed_drive else 3
    m = parameters.shape[0]
    status = np.empty(m, dtype=np.int64)
    size = n * (1 + n)
    z = np.empty(size)
    k = np.zeros((13, size))
    y = np.empty(size)
    report = np.zeros(3)
    carry = np.array([0.1, 0.0])
    start = guess.copy()
    found = 0
    for row in range(m):
        p = constants(parameters[row])
        sizes = _scales(n, n, scales[row], 1.0)
        for i in range(n):
            # the secant through the last two
            start[i] = 2.0 * starts[row - 1, i] - starts[row - 2, i] if found > 1 else start[i]
        what = _solve(
            speed_drive, p, drives[row], end, tolerance, scales[row], most, start, z, k, y, sizes, carry, report
        )
        if what != DONE:
            for i in range(n):
                start[i] = guess[i]
            what = _solve(
                speed_drive, p, drives[row], end, tolerance, scales[row], most, start, z, k, y, sizes, carry, report
            )
        status[row] = what
        if what == DONE:
            found += 1
            for i in range(n):
                starts[row, i] = start[i]
            for i in range(n * n):
                monodromies[row, i] = z[n + i]
        else:
            found = 0
            for i in range(n):
                start[i] = guess[i]
    return status
