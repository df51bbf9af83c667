"""Periods of neighbouring motions, each followed from what is known of the last: what a continuation asks for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..mechanisms import Parameters, mechanism_of
from . import collocation
from .drives import Drive
from .flows import DIRECTIONAL, PLAIN, VARIATIONAL, Flow
from .orbit_kernels import Section, Status
from .orbits import Direction, failure, pieces_from, section_of

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
