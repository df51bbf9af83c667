"""Compiled kernels for rows of a chart: one or all periodic motions of each mechanism, and basins of attraction.

Along a row the orbits change smoothly: a polynomial through the previous orbits predicts the next orbit at every node, and
collocation corrects the prediction. Collocation may fail because of friction, a torque, the limit of assembly or a fold. The
orbit is then found by shooting: from the orbit of the neighbour on the left, of the neighbour on the right, or from other
guesses.

In all functions ``section`` is a `Section`, ``points`` are `Points`, ``search`` is a `Search`; work space is ``desk`` (of the
collocation), ``room`` and ``carry`` (of `advance`), v (`Tracks`) and ``tables`` (arrays that must stay alive).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import boolean, float64, int64, types
from numpy.typing import NDArray

from ...numerics.codegen import CUBE, MATRIX, VECTOR, copy, inline, inner, kernel, part
from ...numerics.references import refer
from ...numerics.vectors import LANES
from ...run.compiled import read_lane
from ..motion.collocation import NODES, close, integrate_elements, lay_elements, make_desk, repeat_last, row_count
from ..motion.drive import SAME
from ..motion.kernels import (
    DIVERGED,
    DONE,
    GOING,
    NO_STEP,
    SECTION,
    Hunt,
    advance,
    begin_hunt,
    continue_deflated_newton,
    continue_newton,
    deflated_newton,
    magnitude,
    make_room,
    newton,
    replace_numbers,
    subtract_modulo_turns,
)
from ..motion.tracks import IDLE, RUNNING, advance_tracks, begin, make_tracks, set_mechanism

#: Numbers of elements of a turn that are tried, from few to many.
COUNTS = np.array([8, 16, 24, 32, 48])
#: The next orbit gets fewer elements if the highest Legendre coefficients (see `collocation.close`), relative to the square
#: root of the tolerance, are smaller than this value.
FEWER = 0.7
#: If no number of elements suffices for an orbit, this number of following orbits in the row is solved by shooting alone.
_PAUSE = 8
#: Extrapolation by a polynomial through one to four equally spaced values: weights, the last value first.
_NEXT = np.array([[1.0, 0.0, 0.0, 0.0], [2.0, -1.0, 0.0, 0.0], [3.0, -3.0, 1.0, 0.0], [4.0, -6.0, 4.0, -1.0]])
PASSED = len(_NEXT)
#: Greatest number of periodic motions that are kept for one point of a chart.
MOST_ORBITS = 8


class Points(NamedTuple):
    """Arrays with the data of the m mechanisms in a row of a chart, in the form that `Section` uses."""

    constants: NDArray[np.float64]  # constants of the equations and their derivatives, shape (m, 2 constants)
    drives: NDArray[np.float64]  # drive vectors and their derivatives, (m, 2 drive)
    scales: NDArray[np.float64]  # magnitudes of y, (m, n)


class Search(NamedTuple):
    """Settings of the search for the periodic orbits of a row of a chart."""

    end: float  # crank angle at the end of the period (rad)
    turns: int  # number of common periods in a period of the orbit
    most: int  # greatest number of Newton iterations
    loose: float  # tolerance of the integrator in a search from a guess
    smooth: bool  # whether collocation can be used


class Row(NamedTuple):
    """Periodic orbits of the m mechanisms in one row of a chart.

    The start and monodromy matrix of an orbit are valid only if its status is DONE.
    """

    starts: NDArray[np.float64]  # y at crank angle 0, shape (m, n)
    monodromies: NDArray[np.float64]  # monodromy matrices by columns, (m, n * n)
    status: NDArray[np.int64]  # `Status` of the search for each orbit, (m,)


class Motions(NamedTuple):
    """All periodic orbits of the m mechanisms in one row of a chart, at most k = MOST_ORBITS of each mechanism."""

    starts: NDArray[np.float64]  # y at crank angle 0, shape (m, k, n)
    monodromies: NDArray[np.float64]  # monodromy matrices by columns, (m, k, n * n)
    swings: NDArray[np.float64]  # samples of the first component of y, (m, k, samples)
    counts: NDArray[np.int64]  # number of orbits of each mechanism, (m,)


POINTS = types.NamedUniTuple(MATRIX, 3, Points)
SEARCH = types.NamedTuple((float64, int64, int64, float64, boolean), Search)
ROW = types.NamedTuple((MATRIX, MATRIX, int64[::1]), Row)
MOTIONS = types.NamedTuple((CUBE, CUBE, CUBE, int64[::1]), Motions)


@part
def point_section(section, points, row, tolerance):
    """Return ``section`` with the data of the mechanism with the index ``row`` from ``points``."""
    return replace_numbers(section, points.drives[row], points.constants[row], points.scales[row], tolerance)


@part
def divide(section, search, level, start, path, desk, room):
    """Find an orbit by collocation with the least number of elements in `COUNTS` that suffices.

    ``level`` is the first index into `COUNTS` to try. Return the index of the number that suffices, or -1 if none does, and the
    relative size of the highest Legendre coefficients. ``start`` is a guess of y at crank angle 0. ``path`` = (y, w) receives y
    at the beginning of each element, and the slopes w.
    """
    y, w = path
    while level < len(COUNTS):
        m = COUNTS[level] * search.turns
        angles = np.linspace(0.0, search.end, m + 1)
        lay_elements(angles, desk)
        rows = row_count(m)
        if integrate_elements(section, angles, 0, start.copy(), y[:rows], w[:rows], room) != DONE:
            break
        repeat_last(m, y[:rows])
        repeat_last(m, w[:rows])
        status, tail = close(section, m, y[:rows], w[:rows], desk)
        if status == DONE:
            return level, tail
        if status != NO_STEP:
            break
        level += 1
    return -1, 0.0


@inner
def predict(known, size, path):
    """Predict the next orbit of a row, row 0 of ``path``, by extrapolation from the previous orbits.

    The ``known`` previous orbits are rows 1, 2, ... of ``path``, the latest first; each has ``size`` entries.
    """
    for i in range(size):
        path[0, i] = 0.0
        for old in range(known):
            path[0, i] += _NEXT[known - 1, old] * path[1 + old, i]


@inner
def shift(size, path):
    """Move each orbit in ``path`` one row down, so that row 0 can take the next orbit; an orbit has ``size`` entries."""
    for old in range(PASSED, 0, -1):
        copy(path[old - 1, :size], path[old, :size])


@part
def solve_from_left(section, points, search, guess, found, tables):
    """Find the orbits of a row of a chart from left to right: by collocation if it converges, otherwise by shooting.

    ``guess`` is a guess of y for the first orbit. ``tables`` is the work space made by `make_desk`; the caller must keep the
    arrays of the work space alive during the call.
    """
    starts, monodromies, status = found
    n = guess.shape[0]
    z = np.empty(n * (1 + n))
    carry = np.array([0.1, 0.0])
    report = np.zeros(3)
    start = np.empty(n)
    most_rows = row_count(COUNTS[-1] * search.turns)
    # row 0 is this orbit, rows 1, 2, ... are the previous orbits, the latest first; ys and ws have all numbers of an orbit in
    # one row; y and w are views of the same numbers by rows of elements, with the elements in lanes
    sizes = n * LANES, NODES * (n // 2) * LANES
    ys, ws = np.zeros((1 + PASSED, most_rows * sizes[0])), np.zeros((1 + PASSED, most_rows * sizes[1]))
    y, w = ys.reshape((1 + PASSED, most_rows, sizes[0])), ws.reshape((1 + PASSED, most_rows, sizes[1]))
    desk = refer(tables)
    level, known, pause = 0, 0, 0
    tail = 0.0
    passed = 0
    for row in range(status.shape[0]):
        own = point_section(section, points, row, section.tolerance)
        room = make_room(own, n)
        what = DIVERGED
        if known:
            m = COUNTS[level] * search.turns
            rows = row_count(m)
            predict(known, rows * sizes[0], ys)
            predict(known, rows * sizes[1], ws)
            what, tail = close(own, m, y[0, :rows], w[0, :rows], desk)
            if what == NO_STEP:
                # try more elements; the start is good enough to continue from
                read_lane(0, LANES, y[0, 0], start)
                more, tail = divide(own, search, level + 1, start, (y[0], w[0]), desk, room)
                level, known = max(more, 0), 0
                what = DONE if more >= 0 else NO_STEP
        by_collocation = what == DONE
        if not by_collocation:
            known = 0
            if passed > 1:
                # predict the start by the secant through the last two starts
                for i in range(n):
                    start[i] = 2.0 * starts[row - 1, i] - starts[row - 2, i]
            elif passed == 1:
                copy(starts[row - 1], start)
            if passed:
                what = newton(own, search.end, search.most, start, z, room, carry, report)
            if what != DONE:
                # from the guess, which may be far away: first with the loose tolerance of a search
                copy(guess, start)
                wide = point_section(section, points, row, search.loose)
                what = newton(wide, search.end, search.most, start, z, room, carry, report)
                if what == DONE:
                    what = newton(own, search.end, search.most, start, z, room, carry, report)
        status[row] = what
        if what != DONE:
            passed = 0
            continue
        passed += 1
        if by_collocation:
            read_lane(0, LANES, y[0, 0], starts[row])
            for j in range(n):
                for i in range(n):
                    monodromies[row, j * n + i] = desk.monodromy[i, j]
        else:
            copy(start, starts[row])
            copy(z[n:], monodromies[row])
            pause -= 1
            if search.smooth and pause < 0:
                more, tail = divide(own, search, level, start, (y[0], w[0]), desk, room)
                level, by_collocation = max(more, 0), more >= 0
                if not by_collocation:
                    pause = _PAUSE
        if by_collocation:
            rows = row_count(COUNTS[level] * search.turns)
            shift(rows * sizes[0], ys)
            shift(rows * sizes[1], ws)
            known = min(known + 1, PASSED)
            if level > 0 and tail < FEWER * np.sqrt(section.tolerance):
                # take fewer elements for the next orbit; shooting finds it first
                level -= 1
                known = 0


@part
def solve_from_right(section, points, search, found):
    """Find missing orbits of a row by Newton's method, each from the start of the orbit of the neighbour on the right."""
    starts, monodromies, status = found
    n = starts.shape[1]
    z, carry, report = np.empty(n * (1 + n)), np.array([0.1, 0.0]), np.zeros(3)
    for row in range(status.shape[0] - 2, -1, -1):
        if status[row] != DONE and status[row + 1] == DONE:
            own = point_section(section, points, row, section.tolerance)
            start = starts[row + 1].copy()
            if newton(own, search.end, search.most, start, z, make_room(own, n), carry, report) == DONE:
                status[row] = DONE
                copy(start, starts[row])
                copy(z[n:], monodromies[row])


@part
def solve_from_guesses(section, points, search, guesses, found):
    """Find orbits of a row that are still missing, from the orbit on the left, then from all guesses except the first."""
    starts, monodromies, status = found
    n = starts.shape[1]
    z, carry, report = np.empty(n * (1 + n)), np.array([0.1, 0.0]), np.zeros(3)
    none = np.empty((0, n))
    for row in range(status.shape[0]):
        if status[row] == DONE:
            continue
        own = point_section(section, points, row, section.tolerance)
        wide = point_section(section, points, row, search.loose)
        room = make_room(own, n)
        for guess in range(0 if row > 0 and status[row - 1] == DONE else 1, guesses.shape[0]):
            start = guesses[guess].copy() if guess else starts[row - 1].copy()
            if (
                deflated_newton(wide, search.end, search.most, 1.0, start, none, z, room, carry) == DONE
                and newton(own, search.end, search.most, start, z, room, carry, report) == DONE
            ):
                status[row] = DONE
                copy(start, starts[row])
                copy(z[n:], monodromies[row])
                break


@kernel(types.void(SECTION, POINTS, SEARCH, MATRIX, ROW), purpose="grids of periodic motions")
def solve_row(section, points, search, guesses, found):
    """Find one orbit of each mechanism in a row of a chart, starting from the orbit of its neighbour.

    Parameters
    ----------
    section : Section
        Flow and settings that the mechanisms share.
    points : Points
    search : Search
    guesses : ndarray, shape (k, n)
        Guesses of y. The first guess is used for the first mechanism and after each failure of Newton's method. If neither
        neighbour of a mechanism leads to its orbit, the other guesses are tried.
    found : Row
        The result; its arrays are written.
    """
    tables = make_desk(section, COUNTS[-1] * search.turns, False)
    solve_from_left(section, points, search, guesses[0].copy(), found, tables)
    solve_from_right(section, points, search, found)
    missing = False
    for what in found.status:
        missing |= what != DONE
    if missing:
        solve_from_guesses(section, points, search, guesses, found)
        solve_from_right(section, points, search, found)


@inner
def _is_known(start, known, section, away):
    """Return whether a start equals one of the known starts, apart from whole turns of angles; ``away`` is work space."""
    found = False
    for k in range(known.shape[0]):
        subtract_modulo_turns(start, known[k], section.angle_periods, away)
        found = found or magnitude(away, section.scale) < SAME
    return found


class Seekers(NamedTuple):
    """Searches for periodic motions at the points of several rows of a chart, one search in each lane.

    In each row one point is searched after the other, in waves: from the motions of the previous point, then from every guess,
    then again from the guesses that led to a motion, until a wave finds nothing new. Only motions that were known before a wave
    are divided out during this wave, so that its results do not depend on the order in which its searches end.
    """

    row: NDArray[np.int64]  # row of a lane's search, -1 if the lane is free
    place: NDArray[np.int64]  # index of the start from which the lane's search began
    polishing: NDArray[np.bool_]  # whether Newton's method now refines a motion at the full tolerance
    hunts: Hunt  # states of Newton's method: each array has a row for each lane
    # each of the following has an entry for each row
    point: NDArray[np.int64]  # column of the point at which the row is searched
    guessing: NDArray[np.bool_]  # whether the wave begins at guesses
    begun: NDArray[np.int64]  # number of motions that were known when the wave began
    left: NDArray[np.int64]  # number of searches of the wave that have not ended
    following: NDArray[np.int64]  # index of the next start of the wave from which no search has begun
    todo: NDArray[np.bool_]  # whether the wave has a search from each start, shape (rows, starts)
    reached: NDArray[np.bool_]  # whether the search from each start has led to a motion, shape (rows, starts)
    ends: NDArray[np.float64]  # start and monodromy matrix of these motions, shape (rows, starts, n + n * n)


@part
def _make_seekers(n, rows, starts):
    hunts = Hunt(
        np.zeros((LANES, n)), np.zeros((LANES, n)), np.zeros((LANES, n)), np.zeros((LANES, n)),
        np.zeros((LANES, n, n + 1)), np.zeros((LANES, n * (1 + n))), np.zeros((LANES, 4)),
    )  # fmt: skip
    return Seekers(
        np.full(LANES, -1), np.zeros(LANES, np.int64), np.zeros(LANES, np.bool_), hunts, np.zeros(rows, np.int64),
        np.zeros(rows, np.bool_), np.zeros(rows, np.int64), np.zeros(rows, np.int64), np.zeros(rows, np.int64),
        np.zeros((rows, starts), np.bool_), np.zeros((rows, starts), np.bool_), np.zeros((rows, starts, n * (1 + n))),
    )  # fmt: skip


@inline
def _hunt(lane, hunts):
    """Return the state of Newton's method in one lane, a view of the arrays of all lanes."""
    return Hunt(
        hunts.start[lane], hunts.trial[lane], hunts.correction[lane], hunts.following[lane],
        hunts.system[lane], hunts.last[lane], hunts.numbers[lane],
    )  # fmt: skip


class Job(NamedTuple):
    """Arguments of `solve_all`."""

    section: Any
    points: Points
    search: Search
    columns: int
    angles: NDArray[np.float64]
    guesses: NDArray[np.float64]
    found: Motions


@part
def _record(at, end, job, carry):
    """Add a motion to the motions found at the point with the index ``at``, if it is new.

    ``end`` is the start of the motion, followed by its monodromy matrix.
    """
    found, count, n = job.found, job.found.counts[at], job.guesses.shape[1]
    own = point_section(job.section, job.points, at, job.section.tolerance)
    z = end[:n].copy()
    if count == MOST_ORBITS or _is_known(end[:n], found.starts[at, :count], own, z):
        return
    copy(end[:n], found.starts[at, count])
    copy(end[n:], found.monodromies[at, count])
    copy(end[:n], z)
    room = make_room(own, 0)
    angle, carry[0] = 0.0, 0.1
    for i in range(job.angles.shape[0]):
        if job.angles[i] > angle:
            advance(own, angle, job.angles[i], z, room, carry)
            angle = job.angles[i]
        found.swings[at, count, i] = z[0]
    found.counts[at] += 1


@inner
def _pass_start(row, seekers):
    """Go to the next start in a row's wave from which a search is to begin."""
    seekers.following[row] += 1
    while seekers.following[row] < seekers.todo.shape[1] and not seekers.todo[row, seekers.following[row]]:
        seekers.following[row] += 1


@part
def _begin_wave(row, job, seekers, carry):
    """End the wave of a row, and begin the next wave that has searches, at this point or at one of the following points."""
    counts, todo, reached = job.found.counts, seekers.todo[row], seekers.reached[row]
    while seekers.left[row] == 0 and seekers.point[row] < job.columns:
        at = row * job.columns + seekers.point[row]
        for place in range(reached.shape[0]):
            if reached[place]:
                _record(at, seekers.ends[row, place], job, carry)
        again = seekers.begun[row] < counts[at] < MOST_ORBITS
        if seekers.guessing[row] and not again:
            seekers.point[row] += 1
            seekers.guessing[row] = False
            for place in range(todo.shape[0]):
                todo[place] = place < counts[at] and seekers.point[row] < job.columns
            seekers.begun[row] = 0
        else:
            for place in range(todo.shape[0]):
                todo[place] = reached[place] if seekers.guessing[row] else place < job.guesses.shape[0]
            seekers.guessing[row] = True
            seekers.begun[row] = counts[at]
        for place in range(todo.shape[0]):
            reached[place] = False
            seekers.left[row] += todo[place]
        seekers.following[row] = -1
        _pass_start(row, seekers)


@inner
def _integrate(lane, job, seekers, v):
    """Begin the next integration of a lane's search."""
    row = seekers.row[lane]
    tolerance = job.section.tolerance if seekers.polishing[lane] else job.search.loose
    own = point_section(job.section, job.points, row * job.columns + seekers.point[row], tolerance)
    begin(lane, own, seekers.hunts.trial[lane], job.search.end, tolerance, v)


@inner
def _take_search(lane, job, seekers, v):
    """Begin a search in a free lane, in the row that is least advanced; return whether there is a search to begin."""
    row = -1
    for other in range(seekers.point.shape[0]):
        if seekers.following[other] < seekers.todo.shape[1] and (row < 0 or seekers.point[other] < seekers.point[row]):
            row = other
    if row < 0:
        return False
    at, place = row * job.columns + seekers.point[row], seekers.following[row]
    _pass_start(row, seekers)
    seekers.row[lane], seekers.place[lane], seekers.polishing[lane] = row, place, not seekers.guessing[row]
    set_mechanism(lane, point_section(job.section, job.points, at, job.section.tolerance), v)
    v.step[lane] = 0.1
    hunt = _hunt(lane, seekers.hunts)
    begin_hunt(job.guesses[place] if seekers.guessing[row] else job.found.starts[at - 1, place], hunt)
    _integrate(lane, job, seekers, v)
    return True


@inner
def _continue_search(lane, job, seekers, v, carry):
    """Continue the search of a lane after its integration: begin the next integration, or end the search."""
    hunt, most, status = _hunt(lane, seekers.hunts), job.search.most, v.status[lane]
    row, place = seekers.row[lane], seekers.place[lane]
    at, n = row * job.columns + seekers.point[row], job.guesses.shape[1]
    read_lane(lane, LANES, v.x, v.z)
    if seekers.polishing[lane]:
        own = point_section(job.section, job.points, at, job.section.tolerance)
        what = continue_newton(own, most, status, v.z, hunt)
    else:
        wide = point_section(job.section, job.points, at, job.search.loose)
        known = job.found.starts[at, : seekers.begun[row]]
        what = continue_deflated_newton(wide, most, 1.0, status, known, v.z, hunt)
        if what == DONE:
            seekers.polishing[lane], what = True, GOING
            begin_hunt(hunt.start, hunt)
    if what == GOING:
        _integrate(lane, job, seekers, v)
        return
    if what == DONE:
        seekers.reached[row, place] = True
        copy(hunt.start, seekers.ends[row, place, :n])
        copy(v.z[n:], seekers.ends[row, place, n:])
    seekers.row[lane] = -1
    seekers.left[row] -= 1
    _begin_wave(row, job, seekers, carry)


@part
def _search_rows(job, seekers, tables, carry):
    """Search in all lanes until the searches of all rows have ended."""
    v = refer(tables)
    for row in range(seekers.point.shape[0]):
        _begin_wave(row, job, seekers, carry)
    running = True
    while running:
        for lane in range(LANES):
            while v.status[lane] != RUNNING:
                if seekers.row[lane] >= 0:
                    _continue_search(lane, job, seekers, v, carry)
                elif not _take_search(lane, job, seekers, v):
                    v.status[lane] = IDLE
                    break
        running = advance_tracks(job.section, v)


@kernel(types.void(SECTION, POINTS, SEARCH, int64, VECTOR, MATRIX, MOTIONS), purpose="grids of coexisting motions")
def solve_all(section, points, search, columns, angles, guesses, found):
    """Find all orbits of each mechanism in several rows of a chart.

    Newton's method starts from each orbit of the previous mechanism in the row, then from every guess, with the known orbits
    divided out. The result of a row does not depend on the other rows.

    Parameters
    ----------
    columns : int
        Number of mechanisms in a row; ``points`` and ``found`` have one row after the other.
    angles : ndarray, shape (samples,)
        Crank angles at which the first component of y is sampled.
    found : Motions
        The result; its arrays are written.

    For the other parameters see `solve_row`.
    """
    n = guesses.shape[1]
    seekers = _make_seekers(n, found.counts.shape[0] // columns, max(MOST_ORBITS, guesses.shape[0]))
    job = Job(section, points, search, columns, angles, guesses, found)
    tables = make_tracks(section, n)
    _search_rows(job, seekers, tables, np.array([0.1, 0.0]))


#: Results for a start that settles on no known motion: the links reach the limit of assembly, or the turns are used up.
LOST, UNSETTLED = -1, -2


@inner
def _find_known(z, known, measures, section, away):
    """Return the index of the known motion on which the state z has settled, or UNSETTLED if there is none.

    Whole turns of angles are ignored. For ``measures`` see `settle_starts`; ``away`` is work space.
    """
    end = UNSETTLED
    for k in range(known.shape[0]):
        subtract_modulo_turns(z, known[k], section.angle_periods, away)
        square = 0.0
        for i in range(away.shape[0]):
            part = 0.0
            for j in range(away.shape[0]):
                part += measures[k, i, j] * away[j]
            square += part * part
        if square < 1.0:
            end = k
    return end


@part
def _settle(section, turn, most, starts, known, measures, ends, tables):
    """Do the work of `settle_starts`; ``tables`` is work space whose arrays the caller must keep alive during the call."""
    v, away = refer(tables), np.empty(starts.shape[1])
    # for each lane: the index of its start, or -1, and the number of turns that have been computed
    rows, turns = np.full(LANES, -1), np.zeros(LANES, np.int64)
    following, running = 0, True
    while running:
        for lane in range(LANES):
            while v.status[lane] != RUNNING:
                if rows[lane] >= 0:
                    read_lane(lane, LANES, v.x, v.z)
                elif following < starts.shape[0]:
                    rows[lane], turns[lane] = following, 0
                    following += 1
                    copy(starts[rows[lane]], v.z)
                    v.status[lane], v.step[lane] = DONE, 0.1
                else:
                    break
                row = rows[lane]
                ends[row] = _find_known(v.z, known, measures, section, away) if v.status[lane] == DONE else LOST
                if ends[row] != UNSETTLED or turns[lane] == most:
                    rows[lane], v.status[lane] = -1, IDLE
                else:
                    turns[lane] += 1
                    copy(v.z, away)
                    begin(lane, section, away, turn, section.tolerance, v)
        running = advance_tracks(section, v)


@kernel(types.void(SECTION, float64, int64, MATRIX, MATRIX, CUBE, int64[::1]), purpose="basins of attraction")
def settle_starts(section, turn, most, starts, known, measures, ends):
    """Simulate the motion from each start, turn by turn, until it settles on one of the known motions.

    Parameters
    ----------
    turn : float
        Crank angle of a turn (rad).
    most : int
        Greatest number of turns.
    starts, known : ndarray, shapes (m, n) and (k, n)
        y at crank angle 0 of each start, and of the known motions.
    measures : ndarray, shape (k, n, n)
        The motion has settled on a known motion if its difference from the known start, multiplied by this matrix, is shorter
        than 1.
    ends : ndarray of int64, shape (m,)
        The result, written: for each start the index of the known motion on which the mechanism settles, or `LOST` or
        `UNSETTLED`.
    """
    tables = make_tracks(section, 0)
    for lane in range(LANES):
        set_mechanism(lane, section, tables)
    _settle(section, turn, most, starts, known, measures, ends, tables)
