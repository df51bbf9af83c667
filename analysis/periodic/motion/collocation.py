"""Compute a periodic motion by Gauss collocation, starting from a neighbouring motion: compiled kernels.

The period is divided into elements. At prescribed speed the coordinates are integrals of the rates, and the rates are integrals
of their slopes over the crank angle. The unknowns are therefore, for each element, the slopes w of the rates at the Gauss
nodes, and the state y (coordinates, then rates) at the beginning. Newton's method corrects all unknowns together. The slopes of
each element are eliminated first; small matrices, whose product is the monodromy matrix, then join the elements. With NODES
nodes the values at the ends of the elements are of order 2 NODES (E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary
Differential Equations I, section II.7). A neighbouring motion gives a good guess at every node; two or three corrections then
suffice. Collocation evaluates the right-hand side a sixth as often as an integrator of order 8. The decay of the Legendre
coefficients over each element is a measure of the error.

Vector instructions linearise LANES elements at once. In an array "in lanes", element e has lane ``e % LANES`` of row
``e // LANES``. Unused lanes of the last row repeat the last element.

In all functions ``section`` is a `kernels.Section`, ``desk`` the work space `Desk`; y and w are the unknowns in lanes, of all
elements, ``row`` is the index of a row, m the number of elements.
"""

from __future__ import annotations

from math import isnan
from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64, types
from numpy.typing import NDArray

from linkwork.limits import LIMIT_SINE

from ...numerics.codegen import MATRIX, VECTOR, copy, evaluate, inner, kernel, part
from ...numerics.gauss import gauss
from ...numerics.references import refer
from ...numerics.vectors import LANES, absolute, greater, load, multiply_add, store
from .flow import DIRECTIONAL, GAP, IN_LANES, PLAIN, VARIATIONAL
from .kernels import DIVERGED, DONE, LIMIT, NO_STEP, SECTION, advance, eliminate, make_room, write_mechanism

#: Number of nodes of an element.
NODES = 12
#: Nodes C and weights B on an element of length 1; A integrates the Lagrange polynomials up to each node, AA twice, and BA
#: integrates them twice up to the end.
C, B, A, _COEFFICIENTS = gauss(NODES)
AA = np.ascontiguousarray(A @ A)
BA = B @ A
#: Rows that compute the two highest Legendre coefficients from values at the nodes.
TAIL = np.ascontiguousarray(_COEFFICIENTS[-2:])
#: Greatest size of the highest Legendre coefficients, relative to the square root of the integrator's tolerance: the error at
#: the ends of the elements is about the square of that size.
DECAY = 200.0
#: Half the widest distance of two nodes on an element of length 1. At the nodes the clearance to the limit of assembly must
#: exceed BETWEEN times the length of the elements (rad): between the nodes the clearance is then above zero, if it changes by 1
#: per radian at most.
BETWEEN = 0.5 * float(np.diff(C).max())
#: Greatest number of corrections, and greatest size of the first correction relative to the scale: a larger one means that the
#: motion is not a neighbour.
_CORRECTIONS, _FAR = 8, 1.0


class Desk(NamedTuple):
    """Work space for the collocation of one period.

    The work space has arrays in lanes for all elements, arrays in lanes for one row of elements, and matrices that join the
    elements. f = n / 2 is the number of coordinates.
    """

    angles: NDArray[np.float64]  # beginnings of the elements (rad), shape (rows, LANES)
    lengths: NDArray[np.float64]  # lengths of the elements (rad), (rows, LANES)
    ends: NDArray[np.float64]  # y at the ends of the elements, with the slopes corrected, (rows, n LANES)
    matrices: NDArray[np.float64]  # derivatives of ``ends`` by y at the beginnings, (rows, n n LANES)
    slopes: NDArray[np.float64]  # derivatives of ``ends`` by lambda, (rows, n LANES)
    # corrections of the slopes w, and their derivatives by y and by lambda, (rows, NODES f (1 + n (+ 1)) LANES)
    moves: NDArray[np.float64]
    shifts: NDArray[np.float64]  # changes of y at the beginnings, (rows, n LANES)
    z: NDArray[np.float64]  # arguments of the flow
    out: NDArray[np.float64]  # values of the flow at each node
    modes: NDArray[np.float64]  # this and the following two: those of the section, the same in all lanes
    drive: NDArray[np.float64]
    p: NDArray[np.float64]
    single: NDArray[np.float64]  # a number for each element of a row, (LANES,)
    equations: NDArray[np.float64]  # linear equations for the corrections of the slopes
    along: NDArray[np.float64]  # derivatives by lambda of the coordinates' slopes at the nodes
    monodromy: NDArray[np.float64]  # (n, n)
    system: NDArray[np.float64]  # (n, n + 1)
    shift: NDArray[np.float64]  # change of y, (n,)
    column: NDArray[np.float64]  # (n,)


@inner
def row_count(elements):
    """Return the number of rows that hold ``elements`` elements, LANES in each row."""
    return (elements + LANES - 1) // LANES


@part
def make_desk(section, most, directional):
    """Return the work space for the motions of a flow and up to ``most`` elements.

    ``directional`` tells whether the work space has room for derivatives with respect to a parameter lambda.
    """
    n = section.scale.shape[0]
    f, columns = n // 2, n + 1 if directional else n
    unknowns, rows = NODES * f, row_count(most)
    return Desk(
        np.zeros((rows, LANES)),
        np.zeros((rows, LANES)),
        np.zeros((rows, n * LANES)),
        np.zeros((rows, n * n * LANES)),
        np.zeros((rows, n * LANES)),
        np.zeros((rows, unknowns * (1 + columns) * LANES)),
        np.zeros((rows, n * LANES)),
        np.zeros((n + 1) * LANES),
        np.zeros((NODES, n * (1 + columns) * LANES)),
        np.zeros(section.modes.shape[0] * LANES),
        np.zeros(section.drive.shape[0] * LANES),
        np.zeros(section.p.shape[0] * LANES),
        np.zeros(LANES),
        np.zeros(unknowns * (unknowns + 1 + columns) * LANES),
        np.zeros(unknowns * LANES),
        np.zeros((n, n)),
        np.zeros((n, n + 1)),
        np.zeros(n),
        np.zeros(n),
    )


@inner
def lay_elements(angles, desk):
    """Write the beginnings and lengths of the elements into ``desk``.

    ``angles`` are the crank angles at which the elements begin, and the end of the last element.
    """
    m = angles.shape[0] - 1
    for place in range(row_count(m) * LANES):
        e = min(place, m - 1)
        desk.angles[place // LANES, place % LANES] = angles[e]
        desk.lengths[place // LANES, place % LANES] = angles[e + 1] - angles[e]


@inner
def _set_mechanism(section, desk):
    """Write the mechanism and the drive of a section into all lanes."""
    for lane in range(LANES):
        write_mechanism(lane, section, desk)


@inner
def _identity(matrix):
    """Set a matrix to the identity; columns beyond the square are set to zero."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 1.0 if i == j else 0.0


@inner
def _equation(section, desk):
    """Return the address of the function that gives the rates and their derivatives.

    The derivatives with respect to lambda are included if ``desk`` has room for them.
    """
    n = desk.shift.shape[0]
    directional = desk.out.shape[1] > n * (1 + n) * LANES
    return section.equations[IN_LANES + (DIRECTIONAL if directional else VARIATIONAL)]


@inner
def _pace(section, y, desk):
    """Return dt/dtheta, the time per radian of crank rotation.

    As dq/dtheta = qd dt/dtheta for a coordinate q with the rate qd, dt/dtheta is the derivative of dq/dtheta with respect to
    qd, which the flow's derivatives contain.
    """
    n = desk.shift.shape[0]
    for i in range(n):
        store(desk.z, i, load(y[0], i))
    store(desk.z, n, load(desk.angles[0], 0))
    out = desk.out[0]
    evaluate(_equation(section, desk), 0.0, desk.z, desk.modes, desk.drive, desk.p, out)
    return out[LANES * (n + n // 2 * n)]


@inner
def _evaluate_node(s, row, unit, y, w, desk):
    """Compute y and the crank angle at node s of each element in a row from the slopes, and write them into ``desk.z``.

    ``unit`` is the time per radian of crank rotation.
    """
    n = desk.shift.shape[0]
    f = n // 2
    h = load(desk.lengths[row], 0)
    for i in range(f):
        rate = load(y[row], f + i)
        twice, once = 0.0 * rate, 0.0 * rate
        for j in range(NODES):
            slope = load(w[row], j * f + i)
            twice, once = multiply_add(AA[s, j], slope, twice), multiply_add(A[s, j], slope, once)
        store(desk.z, i, load(y[row], i) + h * unit * (C[s] * rate + h * twice))
        store(desk.z, f + i, rate + h * once)
    store(desk.z, n, load(desk.angles[row], 0) + C[s] * h)


@inner
def _linearise_row(section, row, unit, y, w, desk):
    """Linearise the collocation equations of a row of elements about y and w, and eliminate the slopes.

    The results are written into the work space ``desk``; ``unit`` is the time per radian of crank rotation.
    """
    n = desk.shift.shape[0]
    f = n // 2
    system, unknowns = desk.equations, NODES * f
    width = system.shape[0] // (unknowns * LANES)
    directional = width > unknowns + 1 + n
    h = load(desk.lengths[row], 0)
    for s in range(NODES):
        _evaluate_node(s, row, unit, y, w, desk)
        evaluate(_equation(section, desk), 0.0, desk.z, desk.modes, desk.drive, desk.p, desk.out[s])
        if directional:
            for i in range(f):
                store(desk.along, s * f + i, load(desk.out[s], n + n * n + i))
    for s in range(NODES):
        out = desk.out[s]
        for i in range(f):
            line = (s * f + i) * width
            store(system, line + unknowns, load(out, f + i) - load(w[row], s * f + i))
            if directional:
                store(system, line + unknowns + 1 + n, load(out, n + n * n + f + i))
            for j in range(f):
                by_coordinate, by_rate = load(out, n + j * n + f + i), load(out, n + (f + j) * n + f + i)
                store(system, line + unknowns + 1 + j, by_coordinate)
                store(system, line + unknowns + 1 + f + j, by_rate + C[s] * (h * unit * by_coordinate))
                once, twice = -1.0 * h * by_rate, -1.0 * h * h * unit * by_coordinate
                for t in range(NODES):
                    store(system, line + t * f + j, multiply_add(A[s, t], once, AA[s, t] * twice))
                if directional:
                    total = load(system, line + unknowns + 1 + n)
                    for t in range(NODES):
                        total = multiply_add(A[s, t] * h, by_coordinate * load(desk.along, t * f + j), total)
                    store(system, line + unknowns + 1 + n, total)
            store(system, line + s * f + i, 1.0 + load(system, line + s * f + i))
    _eliminate(system, unknowns, width)
    columns = width - unknowns
    for line in range(unknowns):
        for j in range(columns):
            store(desk.moves[row], line * columns + j, load(system, line * width + unknowns + j))
    _close_row(row, unit, y, w, desk)


@inner
def _eliminate(system, unknowns, width):
    """Solve linear equations in lanes by elimination without pivoting; the last columns of ``system`` become the solutions.

    ``unknowns`` is the number of unknowns, ``width`` the number of columns. The matrix is the identity minus a multiple of the
    element's length: pivoting is not needed while elements are short. If the matrix is far from the identity, the corrections
    do not converge.
    """
    for c in range(unknowns):
        inverse = 1.0 / load(system, c * width + c)
        for r in range(c + 1, unknowns):
            factor = load(system, r * width + c) * inverse
            for j in range(c + 1, width):
                store(system, r * width + j, load(system, r * width + j) - factor * load(system, c * width + j))
    for c in range(unknowns - 1, -1, -1):
        inverse = 1.0 / load(system, c * width + c)
        for j in range(unknowns, width):
            store(system, c * width + j, load(system, c * width + j) * inverse)
        for r in range(c):
            factor = load(system, r * width + c)
            for j in range(unknowns, width):
                store(system, r * width + j, load(system, r * width + j) - factor * load(system, c * width + j))


@inner
def _close_row(row, unit, y, w, desk):
    """Compute y and its derivatives at the end of each element of a row from the corrections of the slopes."""
    n = desk.shift.shape[0]
    f = n // 2
    moves = desk.moves[row]
    columns = moves.shape[0] // (NODES * f * LANES)
    h = load(desk.lengths[row], 0)
    for i in range(f):
        for j in range(columns):
            twice, once = 0.0 * h, 0.0 * h
            for s in range(NODES):
                value = load(moves, (s * f + i) * columns + j)
                if j == 0:
                    value = value + load(w[row], s * f + i)
                twice, once = multiply_add(BA[s], value, twice), multiply_add(B[s], value, once)
            coordinate, rate = h * h * unit * twice, h * once
            if j == 0:
                start = load(y[row], f + i)
                store(desk.ends[row], i, load(y[row], i) + h * unit * start + coordinate)
                store(desk.ends[row], f + i, start + rate)
            elif j <= n:
                # the part that constant rates give: the identity, and h unit for a coordinate with respect to its rate
                k = j - 1
                store(desk.matrices[row], i * n + k, coordinate + (1.0 if k == i else 0.0))
                if k == f + i:
                    store(desk.matrices[row], i * n + k, coordinate + h * unit)
                store(desk.matrices[row], (f + i) * n + k, rate + (1.0 if k == f + i else 0.0))
            else:
                for s in range(NODES):
                    coordinate = multiply_add(B[s] * h, load(desk.along, s * f + i), coordinate)
                store(desk.slopes[row], i, coordinate)
                store(desk.slopes[row], f + i, rate)


@inner
def linearise(section, y, w, desk):
    """Linearise the collocation equations of all elements about y and w; the results are written into ``desk``."""
    unit = _pace(section, y, desk)
    for row in range(y.shape[0]):
        _linearise_row(section, row, unit, y, w, desk)


@inner
def _carry(e, y, following, desk):
    """Replace ``desk.shift``, the change of y at the beginning of element e, by the change at the beginning of the next one.

    ``following`` is the index of the next element; if it is -1, ``desk.shift`` becomes y at the end of element e. The change at
    the beginning of element e is written into ``desk.shifts``, in the lane of the element and the later lanes of the row.
    """
    shift, column = desk.shift, desk.column
    row, lane, n = e // LANES, e % LANES, shift.shape[0]
    for i in range(n):
        for other in range(lane, LANES):
            desk.shifts[row, LANES * i + other] = shift[i]
        column[i] = desk.ends[row, LANES * i + lane]
        if following >= 0:
            column[i] -= y[following // LANES, LANES * i + following % LANES]
        for k in range(n):
            column[i] += desk.matrices[row, LANES * (i * n + k) + lane] * shift[k]
    copy(column, shift)


@inner
def _chain(e, product, desk):
    """Multiply ``product``, in place, from the left by the transition matrix of element e: see `Desk.matrices`."""
    row, lane, n, column = e // LANES, e % LANES, product.shape[0], desk.column
    for j in range(product.shape[1]):
        for i in range(n):
            column[i] = 0.0
            for k in range(n):
                column[i] += desk.matrices[row, LANES * (i * n + k) + lane] * product[k, j]
        for i in range(n):
            product[i, j] = column[i]


@inner
def _greatest(values, so_far):
    """Return the greatest of ``values`` and ``so_far``, which are not negative; NaN if one of them is NaN."""
    for value in values:
        if not (value <= so_far or isnan(so_far)):
            so_far = value
    return so_far


@inner
def _move(section, y, w, desk):
    """Correct y and the slopes of all elements by ``desk.shifts``; return the greatest correction, relative to the scale."""
    n = desk.shift.shape[0]
    f = n // 2
    columns = desk.moves.shape[1] // (NODES * f * LANES)
    result = 0.0
    for row in range(y.shape[0]):
        moves, shifts, h = desk.moves[row], desk.shifts[row], load(desk.lengths[row], 0)
        worst, valid = 0.0 * h, 0.0 * h
        for s in range(NODES):
            for i in range(f):
                line = s * f + i
                change = load(moves, line * columns)
                for j in range(n):
                    change = multiply_add(load(moves, line * columns + 1 + j), load(shifts, j), change)
                store(w[row], line, load(w[row], line) + change)
                worst = greater(worst, absolute(h * change) * (1.0 / section.scale[f + i]))
                valid = multiply_add(0.0, change, valid)
        for i in range(n):
            change = load(shifts, i)
            store(y[row], i, load(y[row], i) + change)
            worst = greater(worst, absolute(change) * (1.0 / section.scale[i]))
        # comparisons lose a NaN, this sum keeps it
        store(desk.single, 0, worst + valid)
        result = _greatest(desk.single, result)
    return result


@inner
def _correct_period(section, m, y, w, desk):
    """Correct y and w of a closed period of m elements by one Newton step; return the greatest correction.

    The greatest correction is relative to the scale of y; it is NaN if the linear system has no solution. The monodromy matrix
    before the correction is written into ``desk``.
    """
    n = desk.shift.shape[0]
    linearise(section, y, w, desk)
    _identity(desk.monodromy)
    # the gaps between the elements, carried to the end of the period
    desk.shift[:] = 0.0
    for e in range(m):
        _chain(e, desk.monodromy, desk)
        _carry(e, y, (e + 1) % m, desk)
    for i in range(n):
        for j in range(n):
            desk.system[i, j] = (1.0 if i == j else 0.0) - desk.monodromy[i, j]
        desk.system[i, n] = desk.shift[i]
    if not eliminate(desk.system, n):
        return np.nan
    for i in range(n):
        desk.shift[i] = desk.system[i, n]
    for e in range(m):
        _carry(e, y, (e + 1) % m, desk)
    return _move(section, y, w, desk)


@inner
def _tails(section, row, w, desk):
    """Compute the size of the two highest Legendre coefficients of the slopes and of their derivatives.

    The size is a measure of the error, relative to the greatest value plus the scale. The size for each element of the row is
    written into ``desk.single``.
    """
    scale = section.scale
    n = scale.shape[0]
    f = n // 2
    moves, h = desk.moves[row], load(desk.lengths[row], 0)
    columns = moves.shape[0] // (NODES * f * LANES)
    worst, valid = 0.0 * h, 0.0 * h
    for i in range(f):
        for j in range(columns):
            # of the slopes themselves, then of their derivatives
            weight = scale[f + i] / (1.0 if j == 0 else scale[j - 1] if j <= n else section.along)
            before, last, most = 0.0 * h, 0.0 * h, 0.0 * h
            for s in range(NODES):
                line = s * f + i
                value = h * (load(w[row], line) if j == 0 else load(moves, line * columns + j))
                before, last = multiply_add(TAIL[0, s], value, before), multiply_add(TAIL[1, s], value, last)
                most, valid = greater(most, absolute(value)), multiply_add(0.0, value, valid)
            worst = greater(worst, greater(absolute(before), absolute(last)) / (weight + most))
    store(desk.single, 0, worst + valid)


@inner
def _least_gap(section, y, w, desk):
    """Return the least clearance to the limit of assembly at the nodes; NaN if a node is beyond the limit."""
    least = np.inf
    unit = _pace(section, y, desk)
    for row in range(y.shape[0]):
        for s in range(NODES):
            _evaluate_node(s, row, unit, y, w, desk)
            evaluate(section.equations[IN_LANES + GAP], 0.0, desk.z, desk.modes, desk.drive, desk.p, desk.single)
            for gap in desk.single:
                if not (gap >= least or isnan(least)):
                    least = gap
    return least


@part
def close(section, m, y, w, desk):
    """Find y and w of a periodic motion on m equal elements by Newton's method; the arrays y and w are in lanes.

    Return a `Status` and the relative size of the highest Legendre coefficients. NO_STEP means that this size is too large:
    more elements are needed. LIMIT means that the limit of assembly may lie between the nodes: shooting must decide.
    """
    before = tail = 0.0
    _set_mechanism(section, desk)
    for count in range(_CORRECTIONS):
        change = _correct_period(section, m, y, w, desk)
        if not change <= (0.5 * before if count else _FAR):
            return DIVERGED, tail
        if change <= 100.0 * section.tolerance:
            for row in range(y.shape[0]):
                _tails(section, row, w, desk)
                tail = _greatest(desk.single, tail)
            if not tail <= DECAY * np.sqrt(section.tolerance):
                return NO_STEP, tail
            near = LIMIT_SINE + BETWEEN * desk.lengths[0, 0]
            return (DONE if _least_gap(section, y, w, desk) > near else LIMIT), tail
        before = change
    return DIVERGED, tail


@part
def integrate_elements(section, angles, first, start, y, w, room):
    """Integrate over elements, beginning with element ``first``, and write their y and w; return a `Status`.

    ``start`` is y at the beginning of the first element, and becomes y at the end of the last element. ``angles`` are the crank
    angles at which these elements begin, and the end of the last element.
    """
    n = start.shape[0]
    out = np.empty(n)
    carry = np.array([0.1, 0.0])
    for e in range(first, first + angles.shape[0] - 1):
        angle, h = angles[e - first], angles[e - first + 1] - angles[e - first]
        row, lane = e // LANES, e % LANES
        for i in range(n):
            y[row, LANES * i + lane] = start[i]
        for s in range(NODES + 1):
            following = angles[e - first] + C[s] * h if s < NODES else angles[e - first + 1]
            status = advance(section, angle, following, start, room, carry)
            if status != DONE:
                return status
            angle = following
            if s < NODES:
                evaluate(section.equations[PLAIN], angle, start, section.modes, section.drive, section.p, out)
                for i in range(n // 2):
                    w[row, LANES * (s * (n // 2) + i) + lane] = out[n // 2 + i]
    return DONE


@inner
def repeat_last(m, many):
    """Copy the values of the last of m elements into the unused lanes of the last row; ``many`` is an array in lanes."""
    row, lane = (m - 1) // LANES, (m - 1) % LANES
    for i in range(many.shape[1] // LANES):
        for other in range(lane + 1, LANES):
            many[row, LANES * i + other] = many[row, LANES * i + lane]


class Neighbour(NamedTuple):
    """A neighbouring motion, from which the collocation starts, as arrays in lanes."""

    y: NDArray[np.float64]  # y at the beginnings of the elements, shape (rows, n LANES)
    w: NDArray[np.float64]  # slopes at the nodes, (rows, NODES f LANES)
    moves: NDArray[np.float64]  # as in `Desk`


def neighbour(m: int, n: int) -> Neighbour:
    """Return an empty `Neighbour` for a motion of m elements and y of n components."""
    sizes = np.array([n, NODES * (n // 2), NODES * (n // 2) * (2 + n)]) * LANES
    return Neighbour(*(np.zeros((-(-m // LANES), size)) for size in sizes))


class PieceSolution(NamedTuple):
    """The result of `solve_pieces`."""

    rows: NDArray[np.float64]  # ends of the pieces, as `kernels.segments` writes them
    tails: NDArray[np.float64]  # size of the highest Legendre coefficients of each element, shape (m,)
    clearance: NDArray[np.float64]  # least clearance to the limit of assembly, (1,)


@inner
def _predict(firsts, starts, change, unit, neighbour, desk):
    """Extrapolate a neighbouring motion, in place, to the states ``starts`` at the beginnings of the pieces and another lambda.

    The extrapolation is of first order; ``change`` is the change of lambda. For ``firsts`` see `solve_pieces`; ``unit`` is the
    time per radian of crank rotation.
    """
    y, w, moves = neighbour
    n = desk.shift.shape[0]
    f = n // 2
    start = desk.shift
    for piece in range(starts.shape[0]):
        copy(starts[piece], start)
        for e in range(firsts[piece], firsts[piece + 1]):
            row, lane = e // LANES, e % LANES
            for line in range(NODES * f):
                for j in range(n + 1):
                    by = change if j == n else start[j] - y[row, LANES * j + lane]
                    w[row, LANES * line + lane] += moves[row, LANES * (line * (2 + n) + 1 + j) + lane] * by
            h = desk.lengths[row, lane]
            for i in range(n):
                y[row, LANES * i + lane] = start[i]
            for i in range(f):
                twice = once = 0.0
                for s in range(NODES):
                    twice += BA[s] * w[row, LANES * (s * f + i) + lane]
                    once += B[s] * w[row, LANES * (s * f + i) + lane]
                start[i] += h * unit * (start[f + i] + h * twice)
                start[f + i] += h * once


@inner
def _correct_pieces(section, firsts, starts, y, w, desk, rows):
    """Correct y and w of pieces with given starts by one Newton step; return the greatest correction.

    The greatest correction is relative to the scale of y. y at the ends of the pieces is written into ``rows``. For ``firsts``
    see `solve_pieces`.
    """
    linearise(section, y, w, desk)
    n = desk.shift.shape[0]
    for piece in range(starts.shape[0]):
        first, last = firsts[piece], firsts[piece + 1]
        for i in range(n):
            desk.shift[i] = starts[piece, i] - y[first // LANES, LANES * i + first % LANES]
        for e in range(first, last):
            _carry(e, y, e + 1 if e + 1 < last else -1, desk)
        for i in range(n):
            rows[piece, i] = desk.shift[i]
    return _move(section, y, w, desk)


@inner
def _write_derivatives(firsts, rows, desk):
    """Write into ``rows`` the derivatives of y at the end of each piece with respect to y at its beginning and to lambda."""
    n = desk.shift.shape[0]
    whole = desk.system
    for piece in range(rows.shape[0]):
        _identity(whole)
        for e in range(firsts[piece], firsts[piece + 1]):
            _chain(e, whole, desk)
            for i in range(n):
                whole[i, n] += desk.slopes[e // LANES, LANES * i + e % LANES]
        for i in range(n):
            for j in range(n + 1):
                rows[piece, n + j * n + i] = whole[i, j]


@part
def _solve_pieces(section, angles, firsts, starts, change, known, neighbour, found, tables):
    """Do the work of `solve_pieces`; ``tables`` is the work space `Desk`.

    `solve_pieces` makes the work space and keeps its arrays alive while this function refers to them.
    """
    y, w, moves = neighbour
    m, desk, room = angles.shape[0] - 1, refer(tables), make_room(section, 0)
    lay_elements(angles, desk)
    _set_mechanism(section, desk)
    if known:
        _predict(firsts, starts, change, _pace(section, y, desk), neighbour, desk)
    else:
        for piece in range(starts.shape[0]):
            first, last = firsts[piece], firsts[piece + 1]
            status = integrate_elements(section, angles[first : last + 1], first, starts[piece].copy(), y, w, room)
            if status != DONE:
                # shorter elements would not help the integrator to find a step
                return LIMIT if status == LIMIT else DIVERGED
    repeat_last(m, y)
    repeat_last(m, w)
    before = 0.0
    for count in range(_CORRECTIONS):
        moved = _correct_pieces(section, firsts, starts, y, w, desk, found.rows)
        if not moved <= (0.5 * before if count else _FAR):
            return DIVERGED
        if moved <= 100.0 * section.tolerance:
            break
        before = moved
    else:
        return DIVERGED
    _write_derivatives(firsts, found.rows, desk)
    for row in range(y.shape[0]):
        copy(desk.moves[row], moves[row])
        _tails(section, row, w, desk)
        for lane in range(min(LANES, m - LANES * row)):
            found.tails[LANES * row + lane] = desk.single[lane]
    for tail in found.tails:
        if not tail <= DECAY * np.sqrt(section.tolerance):
            return NO_STEP
    found.clearance[0] = _least_gap(section, y, w, desk)
    return DONE if found.clearance[0] > LIMIT_SINE else LIMIT


@kernel(
    int64(
        SECTION,
        VECTOR,
        int64[::1],
        MATRIX,
        float64,
        boolean,
        types.NamedUniTuple(MATRIX, 3, Neighbour),
        types.NamedTuple((MATRIX, VECTOR, VECTOR), PieceSolution),
    ),
    purpose="the collocation of periodic motions",
)
def solve_pieces(section, angles, firsts, starts, change, known, neighbour, found):
    """Compute y and its derivatives over each piece of a period by collocation, starting from a neighbouring motion.

    Parameters
    ----------
    angles : ndarray, shape (m + 1,)
        Crank angles (rad) at which the m elements begin, and the end of the last element.
    firsts : ndarray of int64, shape (k + 1,)
        Index of the first element of each of the k pieces, and m.
    starts : ndarray, shape (k, n)
        y at the beginning of each piece.
    change : float
        Change of lambda from the neighbour.
    known : bool
        Whether there is a neighbour; if not, the integrator gives the first guess.
    neighbour : Neighbour
        The neighbouring motion; overwritten with the new motion.
    found : PieceSolution
        Overwritten with the result.

    Returns
    -------
    int
        A `Status`; NO_STEP if elements are too long, DIVERGED if Newton's method did not find the slopes.
    """
    m = angles.shape[0] - 1
    return _solve_pieces(section, angles, firsts, starts, change, known, neighbour, found, make_desk(section, m, True))
