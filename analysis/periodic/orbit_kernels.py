"""Compiled: one period of a mechanism with its variational equations, and Newton's method on the map over it.

The independent variable is the angle of the mechanism's cyclic freedom, the crank, so that a period is known beforehand
however it is driven. The state is y: the coordinates and the rates of the other freedoms, as far as they are free, and after
them the crank's rate where a torque drives it. The angle runs from 0, which makes the map over a period that of the Poincare
section there. With y are integrated the columns of dy/dy0 and, where asked for, dy/dlambda for a parameter. The right-hand
sides and their exact derivatives are traced from the equations (`Flow`); the integrator is that of a run.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from math import fabs, isfinite
from typing import Any, NamedTuple

import numpy as np
from numba import boolean, float64, int64, types
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.limits import LIMIT_SINE, NEAR_LIMIT
from linkwork.mechanism import Mechanism
from linkwork.variables import Variable

from ..numerics import symbolic
from ..numerics.codegen import MATRIX, VECTOR, MachineCode, evaluate, inner, kernel, part
from ..run import constants, traced
from ..run.compiled import SOURCE, Source, attempt, following, shorter


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
    Status.LIMIT: "the links come to the limit of assembly within the period",
    Status.NO_STEP: "the integrator cannot meet its tolerance",
    Status.STALLED: "the crank comes to rest within the period",
    Status.DIVERGED: "Newton's method does not converge",
}

#: Parameters of an induction motor among those of a drive.
MOTOR = ("breakdown_torque", "breakdown_slip", "synchronous_speed")

#: Least fraction of a radian that a step may have.
_LEAST_STEP = 1e-9
#: Crank speed below which the crank counts as stalled, relative to that at the start.
_STALL = 1e-3
#: Least fraction of a Newton correction that is tried.
_LEAST_FRACTION = 1.0 / 4096.0

# Functions of a flow, by their numbers among its addresses
PLAIN, VARIATIONAL, DIRECTIONAL, GAP, STATE = range(5)
_NAMES = ("plain", "variational", "directional", "gap", "state")


class Crank(NamedTuple):
    """The cyclic freedom of a mechanism: its number, and those of the channels of its rate and of the torque on it, or None."""

    freedom: int
    command: int | None
    torque: int | None


@cache
def crank_of(mechanism: Mechanism) -> Crank:
    """The cyclic freedom of a mechanism.

    Raises
    ------
    InputError
        If it has none.
    """
    number = next((n for n, freedom in enumerate(mechanism.freedoms) if freedom.period > 0.0), None)
    if number is None:
        raise InputError(f"a {mechanism.name} has no freedom that turns: it has no periodic motions over an angle")

    def channel(kind: str) -> int | None:
        found = (n for n, c in enumerate(mechanism.channels) if c.kind == kind and c.freedom == number)
        return next(found, None)

    return Crank(number, channel("command"), channel("force"))


class Flow:
    """A mechanism as a flow over its crank's angle, driven in one way.

    Parameters
    ----------
    mechanism : Mechanism
    modes : tuple of int
        Values of its modes.

    Attributes
    ----------
    crank : int
        Number of the cyclic freedom.
    free : tuple of int
        Numbers of the other freedoms that are part of y; what is commanded is held where it is.
    torque : bool
        Whether the crank's rate is part of y.
    components : tuple of (str, str)
        FMI names and units of y.
    labels : tuple of str
        What messages call them: by symbols where there are short ones.
    places : tuple of int
        Components of the state of a run that make up y.
    size : int
        Number of components of y.
    """

    def __init__(self, mechanism: Mechanism, modes: tuple[int, ...]) -> None:
        self.mechanism = mechanism
        self.modes = modes
        self.crank = crank_of(mechanism).freedom
        by_name = {mode.name: value for mode, value in zip(mechanism.modes, modes)}
        commanded = {mechanism.channels[n].freedom: n for n in mechanism.commands(by_name)}
        forced = {c.argument for c in mechanism.channels if c.kind == "force"}
        self.command = commanded.get(self.crank)
        self.free = tuple(
            n
            for n, freedom in enumerate(mechanism.freedoms)
            if n != self.crank
            and (freedom.mode is None or freedom.mode.arguments[by_name[freedom.mode.name]] in forced)
        )
        self.torque = self.command is None
        rates = len(mechanism.freedoms)
        self.places = (*self.free, *(rates + n for n in self.free), *([rates + self.crank] * self.torque))
        variables = {v.name: v for v in mechanism.variables}
        freedoms = [mechanism.freedoms[n] for n in self.free]
        crank_rate = mechanism.freedoms[self.crank].rate
        names = [f.coordinate for f in freedoms] + [f.rate for f in freedoms] + [crank_rate] * self.torque
        labels = [label(variables[f.coordinate]) for f in freedoms]
        labels += [
            f"{name}'" if name == variables[f.coordinate].symbol else label(variables[f.rate])
            for f, name in zip(freedoms, labels)
        ]
        self.labels = (*labels, *[label(variables[crank_rate])] * self.torque)
        self.components = tuple((name, variables[name].unit) for name in names)
        self.size = len(names)
        #: numbers of the channels of the drive, and of motor and held coordinates after them
        self.inputs = len(mechanism.channels)
        self.drive_size = self.inputs + len(MOTOR) + len(mechanism.freedoms)
        self._code: dict[int, MachineCode] = {}
        self._addresses: NDArray[np.int64] = np.zeros(len(_NAMES), dtype=np.int64)

    @property
    def period(self) -> float:
        """Angle of one turn (rad)."""
        return self.mechanism.freedoms[self.crank].period

    def addresses(self, *which: int) -> NDArray[np.int64]:
        """Addresses of the machine code, of the functions of those numbers at least."""
        for n in which:
            if n not in self._code:
                self._code[n] = MachineCode([self.function(n)])
                self._addresses[n] = self._code[n].addresses[_NAMES[n]]
        return self._addresses

    def fingerprint(self, *which: int) -> str:
        """Of the machine code of the functions of those numbers."""
        self.addresses(*which)
        return " ".join(self._code[n].fingerprint for n in which)

    def state(self, y: NDArray[np.float64], drive: NDArray[np.float64]) -> tuple[float, ...]:
        """State of a run at the crank angle 0, from y and the numbers of the drive."""
        rates = len(self.mechanism.freedoms)
        x = [*drive[self.inputs + len(MOTOR) : self.drive_size].tolist(), *[0.0] * (rates + 2)]
        x[self.crank] = 0.0
        if self.command is not None:
            x[rates + self.crank] = float(drive[self.command])
        for place, value in zip(self.places, y.tolist()):
            x[place] = value
        return tuple(x)

    @cache  # noqa: B019 - flows are kept for good themselves
    def function(self, which: int) -> Any:
        """A function as a ``casadi.Function`` of angle, z, modes, drive with its direction, constants with theirs.

        ``plain``: dy/dangle. ``variational``: with the columns of dy/dy0. ``directional``: with that of dy/dlambda after
        them. ``gap``: how far the links are from the limit of assembly. ``state``: the state of a run and the channels.
        """
        casadi = symbolic.library()
        n, m = self.size, self.mechanism
        angle, modes = casadi.SX.sym("angle"), casadi.SX.sym("modes", len(m.modes))
        y, columns = casadi.SX.sym("y", n), casadi.SX.sym("columns", n, n + 1)
        drive, d_drive = (casadi.SX.sym(name, self.drive_size) for name in ("drive", "d_drive"))
        p, k = constants(m)
        d_p = casadi.SX.sym("d_p", p.numel())
        arguments = [
            angle,
            casadi.vertcat(y, casadi.vec(columns)),
            modes,
            casadi.vertcat(drive, d_drive),
            casadi.vertcat(p, d_p),
        ]
        x, u = self._state(angle, y, drive)
        functions = traced(m)
        applied = functions.__dict__[m.equations.applied.__name__](
            tuple(casadi.vertsplit(modes)) if m.modes else (), tuple(casadi.vertsplit(u)) if self.inputs else (), k
        )
        if which == GAP:
            settled = functions.__dict__[m.equations.start.__name__](x, applied, k)
            results = [casadi.SX(functions.__dict__[m.equations.clearance.__name__](settled, applied, k))]
        elif which == STATE:
            settled = functions.__dict__[m.equations.start.__name__](x, applied, k)
            results = [casadi.vertcat(*settled), u]
        else:
            rates = functions.__dict__[m.equations.derivative.__name__](x, applied, k)
            f = casadi.vertcat(*[rates[place] for place in self.places]) / x[len(m.freedoms) + self.crank]
            results = [f]
            if which != PLAIN:
                jacobian = casadi.jacobian(f, y)
                results.append(jacobian @ columns[:, :n])
            if which == DIRECTIONAL:
                along = casadi.jtimes(f, drive, d_drive) + casadi.jtimes(f, p, d_p)
                results.append(jacobian @ columns[:, n] + along)
        return casadi.Function(_NAMES[which], arguments, [casadi.densify(r) for r in results], {"cse": True})

    def jacobian_trace(self) -> Any:
        """Trace of the rates' Jacobian as a ``casadi.Function`` of angle, y, modes, drive and constants."""
        casadi = symbolic.library()
        plain = self.function(PLAIN)
        shapes = [plain.size1_in(i) for i in range(plain.n_in())]
        angle, y, modes, drive, p = (
            casadi.SX.sym(name, size)
            for name, size in zip(
                ("angle", "y", "modes", "drive", "p"), (1, self.size, shapes[2], self.drive_size, shapes[4] // 2)
            )
        )
        f = plain(
            angle,
            casadi.vertcat(y, casadi.DM.zeros(shapes[1] - self.size)),
            modes,
            casadi.vertcat(drive, casadi.DM.zeros(self.drive_size)),
            casadi.vertcat(p, casadi.DM.zeros(shapes[4] // 2)),
        )
        return casadi.Function("trace", [angle, y, modes, drive, p], [casadi.trace(casadi.jacobian(f, y))])

    def _state(self, angle: Any, y: Any, drive: Any) -> tuple[tuple[Any, ...], Any]:
        """State of a run and channels, as expressions."""
        casadi = symbolic.library()
        m, freedoms = self.mechanism, len(self.mechanism.freedoms)
        held = drive[self.inputs + len(MOTOR) :]
        x = [*casadi.vertsplit(held), *[casadi.SX(0.0)] * freedoms, casadi.SX(0.0), casadi.SX(0.0)]
        x[self.crank] = angle
        for component, place in enumerate(self.places):
            x[place] = y[component]
        u = drive[: self.inputs]
        if self.command is not None:
            x[freedoms + self.crank] = u[self.command]
        else:
            channel = crank_of(m).torque
            u = casadi.vertcat(u)
            u[channel] += _kloss(drive[self.inputs : self.inputs + len(MOTOR)], x[freedoms + self.crank])
        return tuple(x), u


def label(variable: Variable) -> str:
    """What messages and tables call a variable: its symbol if that is a short one, else its name with spaces."""
    symbol = variable.symbol
    return symbol if symbol and "\\" not in symbol else variable.name.replace(".", " ")


def _kloss(motor: Any, speed: Any) -> Any:
    """Torque of an induction motor (Kloss's formula, as in a run) at a crank speed."""
    slip = 1.0 - speed / motor[2]
    return 2.0 * motor[0] * slip * motor[1] / (slip * slip + motor[1] * motor[1])


@cache
def flow(mechanism: Mechanism, modes: tuple[int, ...]) -> Flow:
    """The flow of a mechanism driven in one way, made when it is first asked for."""
    return Flow(mechanism, modes)


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


_SECTION = types.NamedTuple((int64[::1], VECTOR, VECTOR, VECTOR, VECTOR, float64, float64, boolean), Section)

#: Inputs of a run that are not asked for: what drives an orbit is constant.
NO_SOURCE = Source(
    np.array([0.0, 1.0]),
    np.zeros((1, 0, 4)),
    np.zeros((0, 4)),
    np.zeros((0, 2), dtype=np.int64),
    np.zeros(6),
    np.zeros(3, dtype=np.int64),
    np.zeros((0, 2), dtype=np.int64),
)


class Room(NamedTuple):
    """Room to work in: stages, state at their end, magnitudes of z, the rate of one component."""

    k: NDArray[np.float64]
    y: NDArray[np.float64]
    sizes: NDArray[np.float64]
    gap: NDArray[np.float64]


@part
def _room(section, columns):  # type: ignore[no-untyped-def]
    """Room for y and so many columns: magnitudes of y, of dy_i/dy0_j and of dy_i/dlambda."""
    n = section.scale.shape[0]
    sizes = np.empty(n * (1 + columns))
    for i in range(n):
        sizes[i] = section.scale[i]
        for j in range(columns):
            sizes[n + j * n + i] = section.scale[i] / (section.scale[j] if j < n else section.along)
    return Room(np.zeros((13, sizes.shape[0])), np.empty(sizes.shape[0]), sizes, np.empty(1))


@inner
def _clearance(section, angle, z, room):  # type: ignore[no-untyped-def]
    evaluate(section.equations[GAP], angle, z, section.modes, section.drive, section.p, room.gap)
    return room.gap[0]


@inner
def _turn(section, source, begin, end, z, room, carry):  # type: ignore[no-untyped-def]
    """Integrate z over a range of crank angles; carry[0] is the step to begin with and to go on with, carry[1] counts."""
    n = section.scale.shape[0]
    size = z.shape[0]
    equation = section.equations[PLAIN if size == n else VARIATIONAL if size == n * (1 + n) else DIRECTIONAL]
    k, y = room.k, room.y
    angle = begin
    slowest = _STALL * z[n - 1] if section.torque else 0.0
    if section.torque and not slowest > 0.0:
        return STALLED
    # a NaN, beyond the limit of assembly, compares as not positive
    if not _clearance(section, angle, z, room) > LIMIT_SINE:
        return LIMIT
    evaluate(equation, angle, z, section.modes, section.drive, section.p, k[0])
    proposed = carry[0]
    while angle < end:
        # no sliver of a step before the end
        last = angle + 1.001 * proposed >= end
        h = end - angle if last else proposed
        error = attempt(
            equation, section.modes, section.p, room.sizes, angle, h, z, k, y, True, 0, source, section.drive
        )
        error /= section.tolerance
        carry[1] += 1.0
        if not error <= 1.0:
            # beyond the limit of assembly the error is NaN
            proposed = shorter(h, error)
            if proposed < _LEAST_STEP:
                return LIMIT if _clearance(section, angle, z, room) < NEAR_LIMIT else NO_STEP
            continue
        proposed = following(h, proposed, error)
        angle = end if last else angle + h
        if not _clearance(section, angle, y, room) > LIMIT_SINE:
            return LIMIT
        if section.torque and not y[n - 1] > slowest:
            return STALLED
        for i in range(size):
            z[i] = y[i]
        if not last:
            evaluate(equation, angle, z, section.modes, section.drive, section.p, k[0])
    carry[0] = proposed
    return DONE


@inner
def _begin(n, start, z):  # type: ignore[no-untyped-def]
    """z at the beginning of a period: the start, the identity, zeros along lambda."""
    for i in range(z.shape[0]):
        z[i] = 0.0
    for i in range(n):
        z[i] = start[i]
        if z.shape[0] > n:
            z[n + i * n + i] = 1.0


@kernel(int64(_SECTION, SOURCE, float64, VECTOR, VECTOR), purpose="the integrator of periodic motions")
def period(section, source, end, z, carry):  # type: ignore[no-untyped-def]
    """Integrate y and as many columns of derivatives as ``z`` has room for from crank angle 0 to ``end``.

    Parameters
    ----------
    section : Section
    source : Source
        `NO_SOURCE`.
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
    room = _room(section, z.shape[0] // n - 1)
    _begin(n, z.copy(), z)
    return _turn(section, source, 0.0, end, z, room, carry)


@part
def _size(correction, scale):  # type: ignore[no-untyped-def]
    """Largest component relative to the scale."""
    size = 0.0
    for i in range(scale.shape[0]):
        # a NaN must not get lost
        relative = abs(correction[i]) / scale[i]
        if not relative <= size:
            size = relative
    return size


@part
def _solve(section, source, end, most, start, z, room, carry, report):  # type: ignore[no-untyped-def]
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
            status = _turn(section, source, 0.0, end, z, room, carry)
            if iteration == 0 and status != DONE:
                return status
            if status == DONE:
                if iteration == 0:
                    break
                following[:] = z[:n] - trial
                solve_small(matrix.copy(), following)
                next_size = _size(following, scale)
                # near the solution corrections stop falling at the integrator's error
                if next_size <= (1.0 - 0.25 * fraction) * size or next_size <= 100.0 * tolerance:
                    break
            fraction *= 0.5
            if fraction < _LEAST_FRACTION:
                return status if status != DONE else DIVERGED
            trial[:] = start + fraction * correction
        report[1] = iteration + 1.0
        start[:] = trial
        correction[:] = z[:n] - trial
        report[0] = _size(correction, scale)
        for i in range(n):
            for j in range(n):
                matrix[i, j] = (1.0 if i == j else 0.0) - z[n + j * n + i]
        if not solve_small(matrix.copy(), correction):
            return DIVERGED
        size = _size(correction, scale)
        if not isfinite(size):
            return DIVERGED
        # what was taken in part is tried less cautiously the next time
        fraction = min(1.0, 4.0 * fraction)
        if size <= 100.0 * tolerance:
            fraction = 1.0
        trial[:] = start + fraction * correction
        if size <= 100.0 * tolerance:
            start[:] = trial
            return DONE
    return DIVERGED


@inner
def solve_small(a, b):  # type: ignore[no-untyped-def]
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


@kernel(int64(_SECTION, SOURCE, float64, int64, VECTOR, VECTOR, VECTOR), purpose="the search for periodic motions")
def solve(section, source, end, most, start, z, report):  # type: ignore[no-untyped-def]
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
    room = _room(section, section.scale.shape[0])
    carry = np.array([0.1, 0.0])
    status = _solve(section, source, end, most, start, z, room, carry, report)
    report[2] = carry[1]
    return status


@kernel(int64(_SECTION, SOURCE, float64, float64, int64, VECTOR), purpose="the settling of motions")
def settle(section, source, turn, change, most, start):  # type: ignore[no-untyped-def]
    """Follow the motion from ``start``, which is overwritten, turn by turn until one changes y by less than ``change``."""
    room = _room(section, 0)
    z = start.copy()
    carry = np.array([0.1, 0.0])
    for _ in range(most):
        status = _turn(section, source, 0.0, turn, z, room, carry)
        if status != DONE:
            return status
        size = _size(z - start, section.scale)
        start[:] = z
        if size < change:
            return DONE
    return DONE


@kernel(int64(_SECTION, SOURCE, VECTOR, VECTOR, MATRIX), purpose="the sampling of periodic motions")
def sample(section, source, start, angles, rows):  # type: ignore[no-untyped-def]
    """States of a run and channels, shape (m, states + inputs), at increasing crank angles, from ``start`` at 0."""
    room = _room(section, 0)
    z = start.copy()
    carry = np.array([0.1, 0.0])
    angle = 0.0
    for i in range(angles.shape[0]):
        if angles[i] > angle:
            status = _turn(section, source, angle, angles[i], z, room, carry)
            if status != DONE:
                return status
            angle = angles[i]
        evaluate(section.equations[STATE], angle, z, section.modes, section.drive, section.p, rows[i])
    return DONE


@kernel(
    types.void(_SECTION, SOURCE, MATRIX, MATRIX, MATRIX, float64, int64, VECTOR, MATRIX, MATRIX, int64[::1]),
    purpose="grids of periodic motions",
)
def solve_row(section, source, parameters, drives, scales, end, most, guess, starts, monodromies, status):  # type: ignore[no-untyped-def]
    """Orbits of a row of mechanisms, each begun from the last: the rows of a chart.

    Parameters
    ----------
    parameters, drives : ndarray, shapes (m, constants) and (m, drive)
        As in `Section`, which has the rest.
    scales : ndarray, shape (m, n)
    guess : ndarray, shape (n,)
        Start of the first.
    starts, monodromies : ndarray, shapes (m, n) and (m, n n)
        y at crank angle 0, and the monodromy matrix by columns; written where the status is DONE.
    status : ndarray of int64, shape (m,)
        `Status` of each; written. Where Newton's method fails from the neighbour it is begun anew from the guess.
    """
    n = guess.shape[0]
    z = np.empty(n * (1 + n))
    report = np.zeros(3)
    carry = np.array([0.1, 0.0])
    start = guess.copy()
    found = 0
    for row in range(parameters.shape[0]):
        own = Section(
            section.equations, section.modes, drives[row], parameters[row], scales[row], 1.0, section.tolerance, section.torque
        )  # fmt: skip
        room = _room(own, n)
        if found > 1:
            # the secant through the last two
            start[:] = 2.0 * starts[row - 1] - starts[row - 2]
        what = _solve(own, source, end, most, start, z, room, carry, report)
        if what != DONE:
            start[:] = guess
            what = _solve(own, source, end, most, start, z, room, carry, report)
        status[row] = what
        if what == DONE:
            found += 1
            starts[row] = start
            monodromies[row] = z[n:]
        else:
            found = 0
            start[:] = guess
