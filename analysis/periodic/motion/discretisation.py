"""Discretised periods: y at the ends of their pieces with exact derivatives, by shooting and by collocation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError, LinkworkError

from ...mechanisms import Parameters, mechanism_of
from ...run import takes_published
from . import collocation, kernels
from .drive import Direction, Drive, scale_in
from .flow import DIRECTIONAL, GAP, PLAIN, VARIATIONAL, Flow
from .kernels import Section, Status

#: Bound of the local error of a step; the solution is good to about a hundred times as much.
INTEGRATOR_TOLERANCE = 1e-12


class Stations(NamedTuple):
    """Places of a period at which the motion is begun anew: multiple shooting.

    Attributes
    ----------
    angles : ndarray, shape (k + 1,)
        Crank angles (rad): the first 0, the last the end of the period.
    starts : ndarray, shape (k, n)
        y at all but the last.
    growth : float
        Greatest norm of the derivatives of y over a piece with respect to y at its beginning, scaled.
    """

    angles: NDArray[np.float64]
    starts: NDArray[np.float64]
    growth: float


class OrbitError(LinkworkError):
    """No periodic motion was found.

    Attributes
    ----------
    reason : str
        One sentence on why.
    start : tuple of float
        y at crank angle 0 at which it ended: see `PeriodicOrbit`.
    residual : float
        ``|y(T) - y(0)|`` relative to the scale there; infinite where not one period could be followed.
    iterations : int
    """

    def __init__(self, reason: str, flow: Flow, start: Iterable[float], residual: float, iterations: int) -> None:
        self.reason = reason
        self.start = tuple(float(value) for value in start)
        self.residual = residual
        self.iterations = iterations
        units = (unit for _, unit in flow.components)
        place = ", ".join(f"{n} = {value:.6g} {unit}" for n, value, unit in zip(flow.labels, self.start, units))
        super().__init__(
            f"no periodic motion found: {reason}; residual {residual:.2e} after {iterations} iterations at {place}"
        )


class OrbitAssemblyError(OrbitError, AssemblyError):
    """The motion that was followed comes to the limit of assembly."""


def section_of(
    parameters: Parameters,
    drive: Drive,
    start: NDArray[np.float64],
    *functions: int,
    tolerance: float = INTEGRATOR_TOLERANCE,
    direction: Direction | None = None,
    along: float = 1.0,
    beside: Sequence[Parameters] = (),
) -> Section:
    """What the kernels need of a mechanism and its drive.

    Parameters
    ----------
    start : ndarray, shape (n,)
        From which the magnitudes of y are taken.
    *functions : int
        Numbers of the flow's functions that are called, beside `kernels.GAP`.
    direction : Direction, optional
        With respect to a parameter lambda; zero without it.
    along : float
        Magnitude of lambda.
    beside : sequence of parameters
        Whose constants are to take the place of these: what is switched on in one is computed for all.
    """
    mechanism = mechanism_of(parameters)
    flow, vector, p = drive.flow(mechanism), drive.vector(mechanism), np.array(parameters.constants())
    d_drive, d_p = direction or (np.zeros_like(vector), np.zeros_like(p))
    # lambda may be what switches on
    switched = any(map(mechanism.switched, (p.tolist(), d_p.tolist(), *(other.constants() for other in beside))))
    return Section(
        flow.addresses(GAP, *functions, switched=switched),
        np.array(flow.modes, dtype=float),
        np.concatenate([vector, d_drive]),
        np.concatenate([p, d_p]),
        scale_in(flow, parameters, vector, start),
        along,
        tolerance,
        flow.torque,
    )


class Period(NamedTuple):
    """One period from a start: y(T) - y(0), shape (n,), its derivatives dy(T)/dy(0), (n, n), and dy(T)/dlambda, (n,)."""

    shift: NDArray[np.float64]
    monodromy: NDArray[np.float64]
    slope: NDArray[np.float64]


@takes_published()
def period_from(
    parameters: Parameters,
    drive: Drive,
    start: NDArray[np.float64],
    turns: int,
    direction: Direction | None = None,
    along: float = 1.0,
) -> Period:
    """Follow the plant over one period from a start that need not be on a periodic orbit.

    Parameters
    ----------
    start : ndarray, shape (n,)
        y at crank angle 0.
    direction : Direction, optional
        With respect to a parameter lambda; zero without it.
    along : float
        Magnitude of lambda.

    Raises
    ------
    OrbitError
        If the period cannot be followed.
    """
    flow = drive.flow(mechanism_of(parameters))
    n = flow.size
    z = np.zeros(n * (2 + n))
    z[:n] = start
    section = section_of(parameters, drive, start, DIRECTIONAL, direction=direction, along=along)
    status = kernels.period(section, flow.period * turns, z, np.array([0.1, 0.0]))
    if status != Status.DONE:
        raise failure(status, flow, start)
    return Period(z[:n] - start, z[n : n + n * n].reshape(n, n).T.copy(), z[n + n * n :].copy())


def pieces_from(
    parameters: Parameters,
    drive: Drive,
    angles: NDArray[np.float64],
    starts: NDArray[np.float64],
    direction: Direction | None = None,
    along: float = 1.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Follow the plant over the pieces of a period, each from its own start: see `period_from`.

    Parameters
    ----------
    angles, starts
        As in `Stations`.

    Returns
    -------
    ends : ndarray, shape (k, n)
        y at the end of each piece.
    matrices : ndarray, shape (k, n, n)
        Their derivatives with respect to the start.
    slopes : ndarray, shape (k, n)
        Their derivatives with respect to lambda.

    Raises
    ------
    OrbitError
        If a piece cannot be followed.
    """
    k, n = starts.shape
    rows = np.zeros((k, n * (2 + n)))
    section = section_of(parameters, drive, starts[0], DIRECTIONAL, direction=direction, along=along)
    status = kernels.segments(section, angles, np.ascontiguousarray(starts), rows)
    if status != Status.DONE:
        raise failure(status, drive.flow(mechanism_of(parameters)), starts[0])
    matrices = rows[:, n : n + n * n].reshape(k, n, n).transpose(0, 2, 1)
    return rows[:, :n], matrices, rows[:, n + n * n :]


def failure(
    status: int, flow: Flow, start: NDArray[np.float64], residual: float = np.inf, iterations: int = 0
) -> OrbitError:
    """The error that says what a status of `kernels` means."""
    kind = OrbitAssemblyError if status == Status.LIMIT else OrbitError
    return kind(kernels.REASONS[Status(status)], flow, start, float(residual), iterations)


#: Calls without collocation after one in which no number of elements sufficed.
_PAUSE = 16

#: Elements of a turn to begin with; elements at most, for each piece and beside eight times as many as that; calls after which
#: they are chosen anew.
_ELEMENTS, _MOST, _RENEWED = 6, 8, 64

#: How near to the limit of assembly collocation is left.
_NEAR = 1e-2


class Ends(NamedTuple):
    """The ends of the pieces of a period: y there, shape (k, n), its derivatives by the beginnings, (k, n, n), and by lambda,
    (k, n); how near the links come to the limit of assembly, None where it is not known."""

    y: NDArray[np.float64]
    matrices: NDArray[np.float64]
    slopes: NDArray[np.float64]
    clearance: float | None


class PeriodPath:
    """The plant over the pieces of a period, by collocation from the last such path, and where that fails by the integrator.

    Parameters
    ----------
    angles : ndarray, shape (k + 1,)
        As in `Stations`.
    smooth : bool
        Whether all mechanisms are, see `is_smooth`; others are left to the integrator.
    """

    def __init__(self, angles: NDArray[np.float64], smooth: bool) -> None:
        self.angles, self.smooth = angles, smooth
        self._calls = self._pause = 0
        self._value: float | None = None
        self._mesh = self._firsts = self._y = self._w = self._moves = np.empty(0)

    def follow(
        self,
        parameters: Parameters,
        drive: Drive,
        starts: NDArray[np.float64],
        value: float,
        direction: Direction,
        along: float,
    ) -> Ends:
        """Follow the plant from the beginnings of the pieces, at a value of lambda: see `pieces_from`.

        Raises OrbitError if a piece cannot be followed.
        """
        self._pause -= 1
        if drive.speed_drive and self.smooth and self._pause < 0:
            section = section_of(
                parameters, drive, starts[0], PLAIN, VARIATIONAL, DIRECTIONAL, direction=direction, along=along
            )
            ends = self._collocated(section, drive.flow(mechanism_of(parameters)), starts, value)
            if ends is not None:
                return ends
        return Ends(*pieces_from(parameters, drive, self.angles, starts, direction, along), None)

    def _collocated(self, section: Section, flow: Flow, starts: NDArray[np.float64], value: float) -> Ends | None:
        k, n = starts.shape
        rows, nearest = np.zeros((k, n * (2 + n))), np.zeros(1)
        self._calls += 1
        if self._calls % _RENEWED == 1:
            lengths = np.diff(self.angles)
            counts = np.ceil(lengths * _ELEMENTS / flow.period - 1e-9).astype(np.int64)
            parts = [a + h * np.arange(count) / count for a, h, count in zip(self.angles, lengths, counts)]
            self._divide(np.concatenate([*parts, self.angles[-1:]]), n)
        most = _MOST * len(self.angles) + 8 * _ELEMENTS * (self.angles[-1] / flow.period)
        while len(self._mesh) <= most:
            known = self._value is not None
            tails = np.zeros(len(self._mesh) - 1)
            status = collocation.walk(
                section,
                self._mesh,
                self._firsts,
                np.ascontiguousarray(starts),
                0.0 if self._value is None else value - self._value,
                known,
                (self._y, self._w, self._moves),
                (rows, tails, nearest),
            )
            self._value = None
            if status == Status.LIMIT:
                raise failure(status, flow, starts[0])
            if status == Status.DONE:
                if nearest[0] < _NEAR:
                    # between the nodes they may come nearer: the integrator looks at every step
                    return None
                self._value = value
                matrices = rows[:, n : n + n * n].reshape(k, n, n).transpose(0, 2, 1)
                return Ends(rows[:, :n], matrices, rows[:, n + n * n :], float(nearest[0]))
            if status == Status.NO_STEP:
                long = tails > collocation.DECAY * np.sqrt(section.tolerance)
            elif known:
                # not found from the neighbour: without it
                continue
            else:
                long = np.ones(len(tails), dtype=bool)
            halves = 0.5 * (self._mesh[:-1] + self._mesh[1:])
            self._divide(np.sort(np.concatenate([self._mesh, halves[long]])), n)
        self._calls, self._pause = 0, _PAUSE
        return None

    def _divide(self, mesh: NDArray[np.float64], n: int) -> None:
        """Take other elements, of which nothing is known."""
        self._value = None
        self._mesh = mesh
        self._firsts = np.searchsorted(mesh, self.angles).astype(np.int64)
        m = len(mesh) - 1
        self._y = np.zeros((m, n))
        self._w = np.zeros((m, collocation.NODES, n // 2))
        self._moves = np.zeros((m, collocation.NODES * (n // 2), 2 + n))


def growths(matrices: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Greatest growth of a deviation, scaled, over each piece of a period; shape (k,)."""
    growths: NDArray[np.float64] = np.linalg.norm(matrices * scale / scale[:, None], ord=2, axis=(1, 2))
    return growths
