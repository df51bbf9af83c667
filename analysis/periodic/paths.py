"""Periods of neighbouring motions, each followed from what is known of the last: what a continuation asks for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..mechanisms import Parameters, mechanism_of
from . import collocation
from .drives import Drive
from .flows import DIRECTIONAL, PLAIN, VARIATIONAL
from .orbit_kernels import NO_SOURCE, Status
from .orbits import Direction, failure, pieces_from, section_of

#: Calls without collocation after one in which no number of elements sufficed.
_PAUSE = 16
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
    """

    def __init__(self, angles: NDArray[np.float64]) -> None:
        self.angles = angles
        self._level = self._pause = 0
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

        Raises
        ------
        OrbitError
            If a piece cannot be followed.
        """
        if not drive.speed_drive or self._pause > 0:
            self._pause -= 1
            return Ends(*pieces_from(parameters, drive, self.angles, starts, direction, along), None)
        k, n = starts.shape
        section = section_of(
            parameters, drive, starts[0], PLAIN, VARIATIONAL, DIRECTIONAL, direction=direction, along=along
        )
        rows, report = np.zeros((k, n * (2 + n))), np.zeros(2)
        while self._level < len(collocation.COUNTS):
            known = self._value is not None
            if not known:
                self._divide(drive.flow(mechanism_of(parameters)).period, n)
            status = collocation.walk(
                section,
                NO_SOURCE,
                self._mesh,
                self._firsts,
                np.ascontiguousarray(starts),
                0.0 if self._value is None else value - self._value,
                known,
                self._y,
                self._w,
                self._moves,
                rows,
                report,
            )
            if status == Status.DONE and report[1] < _NEAR:
                # between the nodes they may come nearer: the integrator looks at every step
                break
            if status == Status.DONE:
                self._value = value
                if self._level > 0 and report[0] < collocation.IDLE * section.tolerance**0.5:
                    self._level, self._value = self._level - 1, None
                matrices = rows[:, n : n + n * n].reshape(k, n, n).transpose(0, 2, 1)
                return Ends(rows[:, :n], matrices, rows[:, n + n * n :], float(report[1]))
            self._value = None
            if status == Status.LIMIT:
                raise failure(status, drive.flow(mechanism_of(parameters)), starts[0])
            # where it is not found from the neighbour, without it, and then with more elements
            self._level += status == Status.NO_STEP or not known
        else:
            self._level, self._pause = 0, _PAUSE
        return Ends(*pieces_from(parameters, drive, self.angles, starts, direction, along), None)

    def _divide(self, period: float, n: int) -> None:
        """Elements of about equal lengths, as many as the level says, each within a piece."""
        lengths = np.diff(self.angles)
        counts = np.ceil(lengths * collocation.COUNTS[self._level] / period - 1e-9).astype(np.int64)
        self._firsts = np.concatenate([[0], np.cumsum(counts)])
        parts = [a + h * np.arange(count) / count for a, h, count in zip(self.angles, lengths, counts)]
        self._mesh = np.concatenate([*parts, self.angles[-1:]])
        m = int(self._firsts[-1])
        self._y = np.zeros((m, n))
        self._w = np.zeros((m, collocation.NODES, n // 2))
        self._moves = np.zeros((m, collocation.NODES * (n // 2), 2 + n))
