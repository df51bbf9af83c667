"""Records of a run in progress for compiled code: problem, state, work arrays, samples and events."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import float64, from_dtype, int64, types
from numpy.typing import NDArray

from ..numerics.codegen import CUBE, MATRIX, VECTOR, copy, evaluate, inner
from .equations import CLEARANCE
from .sources import ADDRESSES, PLACES, Source, is_bar_unwound, write_channels
from .stepping import interpolate

# Status of a run, as the kernels return it; from BAD_INPUT to NO_STEP the same as solver.status of the FMI contract
RUNNING = -1
FINISHED = 0
BAD_INPUT = 2
LIMIT = 3
NO_STEP = 4
EVENT = 10


class Problem(NamedTuple):
    """Data shared by the runs of a batch.

    ``equations`` are the addresses of the equations, with the indices `equations.DERIVATIVE` to `equations.JUMP`. A row of
    ``commands``, shape (c, 3), has for a commanded rate the indices of its channel, of the component of the state that it
    prescribes, and of the channel of its derivative. ``outputs`` is the number of outputs. ``hold`` is the step (s) over which
    inputs are held after they are sampled at the samples' times, 0 if they act continuously. ``end`` is the run's end (s), and
    ``reach`` is `Mechanism.reach`.
    """

    equations: NDArray[np.int64]
    modes: NDArray[np.float64]
    commands: NDArray[np.int64]
    outputs: int
    tolerance: float
    hold: float
    end: float
    reach: NDArray[np.float64]


class Watch(NamedTuple):
    """Events to look for, and those found.

    Each event has a row in ``table`` (columns OUTPUT, LEVEL, DIRECTION, STOPS), the address of its function in ``addresses``
    (0 if the event uses an output), and in ``gaps`` the last value of the function that is zero at the event. A row of
    ``found`` has the index of an event, its time and the state. ``balance`` are the indices of the outputs energy residual and
    kinetic energy if the energy balance is to be restored, else empty.
    """

    table: NDArray[np.float64]
    addresses: NDArray[np.int64]
    gaps: NDArray[np.float64]
    found: NDArray[np.float64]
    balance: NDArray[np.int64]


# Columns of the events' table
OUTPUT, LEVEL, DIRECTION, STOPS = range(4)


@cache
def watch_nothing(size: int) -> Watch:
    """Return a `Watch` without events, for states of a given size."""
    none = np.empty(0, dtype=np.int64)
    return Watch(np.empty((0, 4)), none, np.empty(0), np.empty((0, 2 + size)), none)


class Samples(NamedTuple):
    """Times of the samples (s), increasing; states and inputs at these times, of one run or of each run in a batch."""

    times: NDArray[np.float64]
    states: NDArray[np.float64]
    forces: NDArray[np.float64]


#: Data from which a run continues, besides state and inputs. Interval of smooth inputs: its begin and end (``stop``), the time
#: elapsed in it, its number, the number of the polynomial piece or -1 if the inputs are constant, and 1 in ``midway`` if the
#: run is inside it. Steps: the size to try next, numbers of steps, rejected steps and evaluations. Records: number of the next
#: sample, number of events found, and number found before the present step (``known``). Then 1 in ``started`` once the run has
#: started, and in ``lost`` the channel that was not finite.
CARRY = np.dtype(
    [(name, "f8") for name in ("begin", "stop", "elapsed", "step")]
    + [(name, "i8") for name in ("interval", "piece", "midway", "steps", "rejected", "evaluations")]
    + [(name, "i8") for name in ("sample", "found", "known", "started", "lost")],
    align=True,
)


class State(NamedTuple):
    """Progress of runs, one row for each: a record `CARRY`, the state, the inputs in force."""

    carries: NDArray[np.void]
    x: NDArray[np.float64]
    u: NDArray[np.float64]


class Room(NamedTuple):
    """Work arrays of a run.

    ``k`` are the rates at the stages of a step, ``y`` is the state at the end of the step, ``z`` a state inside the step,
    ``f`` the coefficients of the interpolant, ``inside`` the inputs inside the step or at the end of an interval.
    """

    k: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    f: NDArray[np.float64]
    inside: NDArray[np.float64]
    outputs: NDArray[np.float64]


class Motion(NamedTuple):
    """A run in progress.

    ``p`` are the constants and the mechanical energy at the start, ``scale`` the magnitudes to which errors are relative;
    ``steady`` is true if the inputs, except the torsion bar, are constant between the breaks; ``x`` and ``u`` are the state and
    the inputs in force.
    """

    problem: Problem
    p: NDArray[np.float64]
    scale: NDArray[np.float64]
    steady: bool
    source: Source
    watch: Watch
    samples: Samples
    room: Room
    carry: np.void
    x: NDArray[np.float64]
    u: NDArray[np.float64]


PROBLEM = types.NamedTuple((ADDRESSES, VECTOR, PLACES, int64, float64, float64, float64, VECTOR), Problem)
WATCH = types.NamedTuple((MATRIX, ADDRESSES, VECTOR, MATRIX, ADDRESSES), Watch)
CARRIES = from_dtype(CARRY)[::1]
SAMPLES = types.NamedTuple((VECTOR, CUBE, CUBE), Samples)
STATE = types.NamedTuple((CARRIES, MATRIX, MATRIX), State)


@inner
def equation(which, t, x, u, out, motion):
    """Evaluate the equation with the index ``which``, `equations.DERIVATIVE` to `equations.JUMP`, into ``out``."""
    problem = motion.problem
    evaluate(problem.equations[which], t, x, problem.modes, u, motion.p, out)


@inner
def state_clearance(x, u, motion):
    """Return the clearance to the limit of assembly at state x with inputs u; NaN beyond the limit."""
    equation(CLEARANCE, 0.0, x, u, motion.room.outputs, motion)
    return motion.room.outputs[0]


@inner
def step_time(s, h, motion):
    """Return the time at the fraction s of a step of size h."""
    return motion.carry.begin + (motion.carry.elapsed + s * h)


@inner
def renew(elapsed, x, u, motion):
    """Update the input channels u to the state x and the time ``elapsed`` in the interval, unless the channels are constant."""
    if motion.carry.piece >= 0:
        write_channels(motion.carry.begin, elapsed, motion.carry.piece, x, motion.source, u)


@inner
def look_inside(s, h, motion):
    """Write state and inputs at the fraction s of a step of size h into ``room.z`` and ``room.inside``."""
    room = motion.room
    interpolate(s, motion.x, room.f, room.z)
    copy(motion.u, room.inside)
    renew(motion.carry.elapsed + s * h, room.z, room.inside, motion)


@inner
def is_bar_released(y, motion):
    """Return whether a torsion bar is released in a step that ends at the state y; False if inputs are held."""
    if motion.problem.hold == 0.0:
        for n in range(motion.source.laws.shape[0]):
            if is_bar_unwound(n, y, motion.source):
                return True
    return False
