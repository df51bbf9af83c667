"""Solve runs of an ensemble on a graphics processor: each thread integrates a run, with the functions for single runs."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import int64, types

from linkwork.mechanism import Mechanism

from ..libraries import MissingLibraryError
from ..numerics import device
from ..numerics.codegen import CUBE, MATRIX
from .compiled import BATCH, Batch, advance, lane_motion
from .equations import run_functions
from .records import PROBLEM, RUNNING, SAMPLES, STATE, WATCH, Problem, Room, Samples, State, Watch
from .signals import Source
from .sources import SOURCE

#: Steps of each run in a launch: the driver may end a launch of seconds on a device that also draws the screen.
STEPS_PER_LAUNCH = 1000
#: Types of the arguments of `run_thread`; the last is the `Room` of all threads.
_ARGUMENTS = types.Tuple((
    PROBLEM, SOURCE, BATCH, WATCH, STATE, SAMPLES, int64[::1], int64, int64,
    types.NamedTuple((CUBE, MATRIX, MATRIX, CUBE, MATRIX, MATRIX), Room),
))  # fmt: skip
_read_arguments = device.reader(_ARGUMENTS)


def run_thread(i, table):
    """Integrate run i as `compiled.run` does; ``table`` has the arguments of `compiled.run`, and room for each run."""
    given, source, batch, watch, state, samples, status, most, budget, rooms = _read_arguments(table)
    if i >= status.shape[0] or status[i] != RUNNING or state.carries[i].steps >= most:
        return
    problem = Problem(
        device.equations(),
        given.modes,
        given.commands,
        given.outputs,
        given.tolerance,
        given.hold,
        given.end,
        given.reach,
    )
    room = Room(rooms.k[i], rooms.y[i], rooms.z[i], rooms.f[i], rooms.inside[i], rooms.outputs[i])
    motion = lane_motion(i, problem, source, batch, watch, samples, room, state)
    status[i] = advance(motion, min(most, state.carries[i].steps + budget))


@cache
def solver(mechanism: Mechanism, switched: bool) -> device.Cuda:
    """Return the solver of a mechanism's runs on the graphics processor, for `run_on_device`; see `device.Cuda`.

    Raises
    ------
    MissingLibraryError
        If CuPy is not installed.
    """
    try:
        return device.Cuda(run_thread, run_functions(mechanism, switched))
    except ImportError:
        # CuPy has a distribution for each version of CUDA
        raise MissingLibraryError("cupy_cuda12x") from None


class DeviceBatch:
    """The runs of a batch on a device, which keeps their arrays until they are fetched.

    ``on`` is a `solver`; the other arguments are those of `compiled.run`.
    """

    def __init__(
        self,
        on: device.Cuda,
        problem: Problem,
        source: Source,
        batch: Batch,
        watch: Watch,
        state: State,
        samples: Samples,
        status: Any,
        most: int,
    ) -> None:
        runs, n = state.x.shape
        inputs = state.u.shape[1]
        room = Room(
            np.empty((runs, 16, n)), np.empty((runs, n)), np.empty((runs, n)), np.empty((runs, 7, n)),
            np.empty((runs, inputs)), np.empty((runs, problem.outputs)),
        )  # fmt: skip
        arguments = problem, source, batch, watch, state, samples, status, most, STEPS_PER_LAUNCH, room
        self._state, self._samples, self._status = state, samples, status
        self._loaded = on.load(_ARGUMENTS, arguments)

    def advance(self) -> None:
        """Integrate the runs whose status is RUNNING, up to `STEPS_PER_LAUNCH` steps of each."""
        self._loaded.send(self._status)
        self._loaded.run(len(self._status))
        self._loaded.fetch(*self._state, self._status)

    def fetch_samples(self) -> None:
        """Copy the samples from the device."""
        self._loaded.fetch(self._samples.states, self._samples.forces)
