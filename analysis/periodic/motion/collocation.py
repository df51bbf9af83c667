"""Solve a period by Gauss collocation from a neighbouring motion: compiled kernels.

At prescribed speed the coordinates follow from the rates, and the rates from their slopes over the crank angle. The unknowns
are therefore the slopes w at the Gauss nodes of each element of a period, and y at its beginning. Newton's method corrects all
of them together. The slopes of an element are eliminated first; small matrices, whose product is the monodromy matrix, then
join the elements. With NODES nodes the ends of the elements are of order 2 NODES (E. Hairer, S. P. Norsett, G. Wanner, Solving
Ordinary Differential Equations I, section II.7). From a good guess, which neighbours give at every node, two or three
corrections suffice, each with a sixth of the right-hand sides that an integrator of order 8 needs for a period. The decay of
the Legendre coefficients over each element tells the error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64, types
from numpy.typing import NDArray

from linkwork.limits import LIMIT_SINE

from ...numerics.codegen import CUBE, MATRIX, VECTOR, copy, evaluate, inner, kernel, part
from ...numerics.gauss import gauss
from .flow import DIRECTIONAL, GAP, PLAIN, VARIATIONAL
from .kernels import DIVERGED, DONE, LIMIT, NO_STEP, SECTION, advance, eliminate, make_room

#: Nodes of an element.
NODES = 12
#: Nodes and weights on an element of length 1, integrals of the Lagrange polynomials up to each node, and their integrals.
C, B, A, _COEFFICIENTS = gauss(NODES)
AA = np.ascontiguousarray(A @ A)
BA = B @ A
#: The two highest Legendre coefficients.
TAIL = np.ascontiguousarray(_COEFFICIENTS[-2:])
#: `tail` at most, relative to the root of the integrator's tolerance: the ends of the elements are good to about its square.
DECAY = 200.0
#: Corrections at most, and the greatest first one, relative to the scale: a motion farther away is no neighbour.
_CORRECTIONS, _FAR = 8, 1.0


class Bench(NamedTuple):
    """Work space of an element: arguments and values of the flow; derivatives of the rates' slopes by coordinates and by
    rates at the nodes; derivatives of the coordinates' slopes by lambda; the linear equations."""

    z: NDArray[np.float64]
    out: NDArray[np.float64]
    by_q: NDArray[np.float64]
    by_v: NDArray[np.float64]
    along: NDArray[np.float64]
    equations: NDArray[np.float64]


class Element(NamedTuple):
    """A linearised element, written by `condense`; its slopes w have the shape (NODES, f)."""

    end: NDArray[np.float64]  # y at its end with the slopes corrected, (n,)
    matrix: NDArray[np.float64]  # derivatives of the end by the beginning, (n, n)
    slope: NDArray[np.float64]  # derivatives of the end by lambda, (n,)
    moves: NDArray[np.float64]  # corrections of w, derivatives by y and lambda, (NODES f, 1 + n (+ 1))


@part
def make_bench(n, directional):
    """Make work space for y of n components."""
    f = n // 2
    size = NODES * f
    columns = n + 1 if directional else n
    return Bench(
        np.zeros(n * (1 + columns)),
        np.zeros(n * (1 + columns)),
        np.zeros((NODES, f, f)),
        np.zeros((NODES, f, f)),
        np.zeros((NODES, f)),
        np.zeros((size, size + 1 + columns)),
    )


@inner
def identity(matrix):
    """Write the identity matrix."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[0]):
            matrix[i, j] = 1.0 if i == j else 0.0


@inner
def pace(section, y, bench):
    """Return the time per radian: the derivative of a coordinate's slope by its rate."""
    n = y.shape[0]
    bench.z[:] = 0.0
    for i in range(n):
        bench.z[i] = y[i]
        bench.z[n + i * n + i] = 1.0
    evaluate(section.equations[VARIATIONAL], 0.0, bench.z, section.modes, section.drive, section.p, bench.out)
    return bench.out[n + n // 2 * n]


@inner
def at_node(s, h, unit, y, w, z):
    """Write y at a node of an element into z."""
    f = w.shape[1]
    for i in range(f):
        q, v = C[s] * y[f + i], y[f + i]
        for j in range(NODES):
            q += h * AA[s, j] * w[j, i]
            v += h * A[s, j] * w[j, i]
        z[i] = y[i] + h * unit * q
        z[f + i] = v


@inner
def condense(section, angle, h, unit, y, w, bench, into):
    """Linearise an element about the slopes w, shape (NODES, f), and eliminate them; return whether that was possible.

    The result is written to ``into``, an `Element`.
    """
    end, matrix, slope, moves = into
    n = y.shape[0]
    f = n // 2
    size = NODES * f
    z, out, system = bench.z, bench.out, bench.equations
    directional = z.shape[0] > n * (1 + n)
    equation = section.equations[DIRECTIONAL if directional else VARIATIONAL]
    z[:] = 0.0
    for i in range(n):
        z[n + i * n + i] = 1.0
    for s in range(NODES):
        at_node(s, h, unit, y, w, z)
        evaluate(equation, angle + C[s] * h, z, section.modes, section.drive, section.p, out)
        for i in range(f):
            system[s * f + i, size] = out[f + i] - w[s, i]
            for j in range(f):
                bench.by_q[s, i, j] = out[n + j * n + f + i]
                bench.by_v[s, i, j] = out[n + (f + j) * n + f + i]
            if directional:
                bench.along[s, i] = out[n + n * n + i]
                system[s * f + i, size + 1 + n] = out[n + n * n + f + i]
    for s in range(NODES):
        for i in range(f):
            row = s * f + i
            for j in range(f):
                by_q, by_v = h * unit * bench.by_q[s, i, j], bench.by_v[s, i, j]
                for t in range(NODES):
                    system[row, t * f + j] = -h * (A[s, t] * by_v + AA[s, t] * by_q)
                system[row, size + 1 + j] = bench.by_q[s, i, j]
                system[row, size + 1 + f + j] = by_v + C[s] * by_q
                if directional:
                    for t in range(NODES):
                        system[row, size + 1 + n] += h * A[s, t] * bench.by_q[s, i, j] * bench.along[t, j]
            system[row, row] += 1.0
    if not eliminate(system, size):
        return False
    for row in range(size):
        for j in range(moves.shape[1]):
            moves[row, j] = system[row, size + j]
    for i in range(f):
        end[i] = y[i] + h * unit * y[f + i]
        end[f + i] = y[f + i]
        for j in range(n):
            matrix[i, j] = 0.0
            matrix[f + i, j] = 0.0
        matrix[i, i] = 1.0
        matrix[i, f + i] = h * unit
        matrix[f + i, f + i] = 1.0
        slope[i] = 0.0
        slope[f + i] = 0.0
        for s in range(NODES):
            row = s * f + i
            far, near = h * h * unit * BA[s], h * B[s]
            value = w[s, i] + moves[row, 0]
            end[i] += far * value
            end[f + i] += near * value
            for j in range(n):
                matrix[i, j] += far * moves[row, 1 + j]
                matrix[f + i, j] += near * moves[row, 1 + j]
            if directional:
                slope[i] += far * moves[row, 1 + n] + near * bench.along[s, i]
                slope[f + i] += near * moves[row, 1 + n]
    return True


@inner
def tail(h, scale, along, w, moves):
    """Return the size of the last Legendre coefficients of the slopes and of their derivatives, relative to the greatest."""
    f = w.shape[1]
    n = 2 * f
    worst = 0.0
    for i in range(f):
        for j in range(-1, moves.shape[1] - 1):
            weight = scale[f + i] / (1.0 if j < 0 else scale[j] if j < n else along)
            last = before = greatest = 0.0
            for s in range(NODES):
                value = h * (moves[s * f + i, 1 + j] if j >= 0 else w[s, i])
                greatest = max(greatest, abs(value))
                before += TAIL[0, s] * value
                last += TAIL[1, s] * value
            worst = max(worst, max(abs(before), abs(last)) / (weight + greatest))
    return worst


@inner
def correct_period(section, angles, y, w, desk):
    """Correct beginnings y, shape (m, n), and slopes w, (m, NODES, f), of a period once; return the size of the correction.

    Written on the desk are each `Element`, the monodromy matrix before the correction, and the decay of the Legendre
    coefficients into ``report[0]``. The size is relative to the scale, and NaN if there is no correction.
    """
    bench, ends, matrices, slopes, moves, monodromy, report = desk
    m, n = y.shape
    f = n // 2
    scale = section.scale
    shift, column = bench.z, bench.out
    report[0] = 0.0
    unit = pace(section, y[0], bench)
    identity(monodromy)
    for e in range(m):
        h = angles[e + 1] - angles[e]
        into = Element(ends[e], matrices[e], slopes[e], moves[e])
        if not condense(section, angles[e], h, unit, y[e], w[e], bench, into):
            return np.nan
        report[0] = max(report[0], tail(h, scale, section.along, w[e], moves[e]))
        after = y[(e + 1) % m]
        for i in range(n):
            ends[e, i] -= after[i]
        _chain(matrices[e], monodromy, column)
    # carry the gaps between the elements to the end of the period
    for i in range(n):
        shift[i] = 0.0
    for e in range(m):
        _carry(matrices[e], ends[e], shift, column)
    system = bench.equations
    for i in range(n):
        for j in range(n):
            system[i, j] = (1.0 if i == j else 0.0) - monodromy[i, j]
        for j in range(n, system.shape[1]):
            system[i, j] = shift[i]
    if not eliminate(system, n):
        return np.nan
    for i in range(n):
        shift[i] = system[i, n]
    size = 0.0
    for e in range(m):
        h = angles[e + 1] - angles[e]
        for row in range(moves.shape[1]):
            change = moves[e, row, 0]
            for j in range(n):
                change += moves[e, row, 1 + j] * shift[j]
            w[e, row // f, row % f] += change
            size = max(size, abs(h * change) / scale[f + row % f])
        for i in range(n):
            y[e, i] += shift[i]
            size = max(size, abs(shift[i]) / scale[i])
            if not np.isfinite(shift[i]):
                return np.nan
        _carry(matrices[e], ends[e], shift, column)
    return size


@inner
def _chain(matrix, product, column):
    """Multiply a product of matrices by the next one from the left, in place."""
    n = product.shape[0]
    for j in range(n):
        for i in range(n):
            column[i] = 0.0
            for k in range(n):
                column[i] += matrix[i, k] * product[k, j]
        for i in range(n):
            product[i, j] = column[i]


@inner
def _carry(matrix, gap, shift, column):
    """Carry a deviation at the beginning of an element to the beginning of the next."""
    n = gap.shape[0]
    for i in range(n):
        column[i] = gap[i]
        for k in range(n):
            column[i] += matrix[i, k] * shift[k]
    for i in range(n):
        shift[i] = column[i]


@inner
def least_gap(section, angles, y, w, bench, gap):
    """Return the least clearance to the limit of assembly at the nodes; NaN beyond it."""
    least = np.inf
    unit = pace(section, y[0], bench)
    for e in range(y.shape[0]):
        h = angles[e + 1] - angles[e]
        for s in range(NODES):
            at_node(s, h, unit, y[e], w[e], bench.z)
            evaluate(
                section.equations[GAP], angles[e] + C[s] * h, bench.z, section.modes, section.drive, section.p, gap
            )
            if not gap[0] >= least:
                least = gap[0]
    return least


class Desk(NamedTuple):
    """Work space of a period: for one element, for the results of `condense` on each, and for those of `correct_period`."""

    bench: Bench
    ends: NDArray[np.float64]
    matrices: NDArray[np.float64]
    slopes: NDArray[np.float64]
    moves: NDArray[np.float64]
    monodromy: NDArray[np.float64]
    report: NDArray[np.float64]


@part
def make_desk(n, most):
    """Make work space for y of n components and at most ``most`` elements."""
    return Desk(
        make_bench(n, False),
        np.zeros((most, n)),
        np.zeros((most, n, n)),
        np.zeros((most, n)),
        np.zeros((most, NODES * (n // 2), 1 + n)),
        np.zeros((n, n)),
        np.zeros(1),
    )


@part
def close(section, angles, y, w, desk, room):
    """Solve the beginnings y and slopes w of a closed period by Newton's method; return a `Status`.

    NO_STEP means that the elements are too few.
    """
    before = 0.0
    for count in range(_CORRECTIONS):
        size = correct_period(section, angles, y, w, desk)
        if not size <= (0.5 * before if count else _FAR):
            return DIVERGED
        if size <= 100.0 * section.tolerance:
            if desk.report[0] > DECAY * np.sqrt(section.tolerance):
                return NO_STEP
            return DONE if least_gap(section, angles, y, w, desk.bench, room.gap) > LIMIT_SINE else LIMIT
        before = size
    return DIVERGED


@part
def spread(section, angles, start, y, w, room):
    """Compute beginnings y and slopes w of the elements of a period from its start by the integrator; return a `Status`."""
    n = start.shape[0]
    z, out = start.copy(), np.empty(n)
    carry = np.array([0.1, 0.0])
    for e in range(y.shape[0]):
        angle, h = angles[e], angles[e + 1] - angles[e]
        copy(z, y[e])
        for s in range(NODES + 1):
            following = angles[e] + C[s] * h if s < NODES else angles[e + 1]
            status = advance(section, angle, following, z, room, carry)
            if status != DONE:
                return status
            angle = following
            if s < NODES:
                evaluate(section.equations[PLAIN], angle, z, section.modes, section.drive, section.p, out)
                copy(out[n // 2 :], w[e, s])
    return DONE


@inner
def solve_element(section, angle, h, unit, y, w, bench, into):
    """Solve the slopes of an element from its beginning by Newton's method; return whether they were found."""
    f = w.shape[1]
    before = 0.0
    for count in range(_CORRECTIONS):
        if not condense(section, angle, h, unit, y, w, bench, into):
            return False
        size = 0.0
        for row in range(into.moves.shape[0]):
            w[row // f, row % f] += into.moves[row, 0]
            size = max(size, abs(h * into.moves[row, 0]) / section.scale[f + row % f])
        if not size <= (0.5 * before if count else _FAR):
            return False
        before = size
        if size <= 100.0 * section.tolerance:
            return True
    return False


class Neighbour(NamedTuple):
    """A neighbouring motion: its parameter, y and slopes at the nodes of each element."""

    y: NDArray[np.float64]  # beginnings, shape (m, n)
    w: NDArray[np.float64]  # slopes, (m, NODES, f)
    moves: NDArray[np.float64]  # see `Element`, (m, NODES f, 2 + n)


class Walked(NamedTuple):
    """The result of `walk`."""

    rows: NDArray[np.float64]  # ends of the pieces, as `kernels.segments` writes them
    tails: NDArray[np.float64]  # decay of the Legendre coefficients, shape (m,)
    clearance: NDArray[np.float64]  # least clearance to the limit of assembly, (1,)


@kernel(
    int64(
        SECTION,
        VECTOR,
        int64[::1],
        MATRIX,
        float64,
        boolean,
        types.NamedTuple((MATRIX, CUBE, CUBE), Neighbour),
        types.NamedTuple((MATRIX, VECTOR, VECTOR), Walked),
    ),
    purpose="the collocation of periodic motions",
)
def walk(section, angles, firsts, starts, change, known, neighbour, found):
    """Solve y with its derivatives over each piece of a period, starting from a neighbouring motion.

    Parameters
    ----------
    angles : ndarray, shape (m + 1,)
        Crank angles at which the elements begin, and the end of the last.
    firsts : ndarray of int64, shape (k + 1,)
        Number of the first element of each piece, and m.
    starts : ndarray, shape (k, n)
        y at the beginning of each piece.
    change : float
        Change of lambda from the neighbour.
    known : bool
        Whether there is a neighbour; if not, the integrator gives the first guess.
    neighbour : Neighbour
        Overwritten with this motion.
    found : Walked
        Written.

    Returns
    -------
    int
        A `Status`; NO_STEP if elements are too long, DIVERGED if the slopes were not found.
    """
    (y, w, moves), (rows, tails, clearance) = neighbour, found
    n = starts.shape[1]
    f = n // 2
    scale = section.scale
    bench, room = make_bench(n, True), make_room(section, 0)
    start, end, column = np.empty(n), np.empty(n), np.empty(n)
    matrix, whole, slope, along = np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty(n)
    clearance[0] = np.inf
    unit = pace(section, starts[0], bench)
    for piece in range(starts.shape[0]):
        first, last = firsts[piece], firsts[piece + 1]
        copy(starts[piece], start)
        identity(whole)
        along[:] = 0.0
        if not known:
            status = spread(section, angles[first : last + 1], start, y[first:last], w[first:last], room)
            if status != DONE:
                return status
            moves[first:last] = 0.0
        for e in range(first, last):
            h = angles[e + 1] - angles[e]
            for row in range(moves.shape[1]):
                ahead = moves[e, row, 1 + n] * change
                for i in range(n):
                    ahead += moves[e, row, 1 + i] * (start[i] - y[e, i])
                w[e, row // f, row % f] += ahead
            copy(start, y[e])
            if not solve_element(section, angles[e], h, unit, y[e], w[e], bench, Element(end, matrix, slope, moves[e])):
                return DIVERGED
            tails[e] = tail(h, scale, section.along, w[e], moves[e])
            _chain(matrix, whole, column)
            _carry(matrix, slope, along, column)
            copy(end, start)
        for i in range(n):
            rows[piece, i] = start[i]
            rows[piece, n + n * n + i] = along[i]
            for j in range(n):
                rows[piece, n + j * n + i] = whole[i, j]
    for e in range(tails.shape[0]):
        if tails[e] > DECAY * np.sqrt(section.tolerance):
            return NO_STEP
    clearance[0] = least_gap(section, angles, y, w, bench, room.gap)
    return DONE if clearance[0] > LIMIT_SINE else LIMIT
