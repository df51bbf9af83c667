"""Records of a run in progress for compiled code: problem, state, work arrays, samples and events."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import float64, from_dtype, int64, types
from numpy.typing import NDArray

from ..numerics.codegen import CUBE, MATRIX, VECTOR, copy, evaluate, inner
from .equations import CLEARANCE
from .sources import ADDRESSES, PLACES, Source, channels_at, unwound
from .stepping import interpolate

# Status of a run, as the kernels return it: where the run has one, the solver.status of the FMI contract
RUNNING = -1
FINISHED = 0
BAD_INPUT = 2
LIMIT = 3
NO_STEP = 4
EVENT = 10


class Problem(NamedTuple):
    """Data shared by the runs of a batch.

    ``equations`` are addresses, by `equations.DERIVATIVE` and its kin; ``commands``, shape (c, 3), for each commanded rate in
    force the numbers of its channel, of the state that it is, and of the channel of its own rate; ``outputs`` their number;
    ``hold`` the step (s) over which inputs are sampled at the samples' times and held, 0 where they act continuously.
    """

    equations: NDArray[np.int64]
    modes: NDArray[np.float64]
    commands: NDArray[np.int64]
    outputs: int
    tolerance: float
    hold: float
    end: float


class Watch(NamedTuple):
    """Events: a row each of OUTPUT, LEVEL, DIRECTION, STOPS; address of the function in the place of an output, or 0; last
    value; and rows of those found: number, time, state. Where the energy balance is to be kept, the numbers of the outputs
    that are its residual and the kinetic energy; else none."""

    table: NDArray[np.float64]
    addresses: NDArray[np.int64]
    gaps: NDArray[np.float64]
    found: NDArray[np.float64]
    balance: NDArray[np.int64]


# Columns of the events' table
OUTPUT, LEVEL, DIRECTION, STOPS = range(4)


def watch_nothing(size: int) -> Watch:
    """Return an empty table of events for states of a given size."""
    none = np.empty(0, dtype=np.int64)
    return Watch(np.empty((0, 4)), none, np.empty(0), np.empty((0, 2 + size)), none)


class Samples(NamedTuple):
    """Times to record (s), increasing, the first one the start; states and inputs there, of a run or of each of a batch."""

    times: NDArray[np.float64]
    states: NDArray[np.float64]
    forces: NDArray[np.float64]


#: What a run goes on from beside its state and inputs. Of the interval of smooth inputs: the times of its beginning and its
#: end, the time since it began, its number, the piece of the polynomials or -1 where the inputs stay as they are, and whether
#: the run is inside it. Of the steps: the size to try, counts. Of what is recorded: the next sample, the events found, and
#: those before the step under way. Whether the run has started, and the channel that was not finite.
CARRY = np.dtype(
    [
        ("begin", "f8"),
        ("stop", "f8"),
        ("elapsed", "f8"),
        ("interval", "i8"),
        ("piece", "i8"),
        ("midway", "i8"),
        ("step", "f8"),
        ("steps", "i8"),
        ("rejected", "i8"),
        ("evaluations", "i8"),
        ("sample", "i8"),
        ("found", "i8"),
        ("known", "i8"),
        ("started", "i8"),
        ("lost", "i8"),
    ]
)


class State(NamedTuple):
    """The progress of runs, a row each: `CARRY`, state, inputs in force."""

    carries: NDArray[np.void]
    x: NDArray[np.float64]
    u: NDArray[np.float64]


class Room(NamedTuple):
    """Work arrays: stages, state at a step's end and one inside it, coefficients of the interpolant, inputs inside a step
    or at an interval's end, outputs."""

    k: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    f: NDArray[np.float64]
    inside: NDArray[np.float64]
    outputs: NDArray[np.float64]


class Motion(NamedTuple):
    """A run in progress.

    ``p`` are the constants and the mechanical energy at the start, ``scale`` magnitudes for the error; ``steady`` says whether
    the inputs, but for the torsion bar, are constant between the breaks; ``x`` and ``u`` are the state and the inputs in force.
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


PROBLEM = types.NamedTuple((ADDRESSES, VECTOR, PLACES, int64, float64, float64, float64), Problem)
WATCH = types.NamedTuple((MATRIX, ADDRESSES, VECTOR, MATRIX, ADDRESSES), Watch)
CARRIES = from_dtype(CARRY)[::1]
SAMPLES = types.NamedTuple((VECTOR, CUBE, CUBE), Samples)
STATE = types.NamedTuple((CARRIES, MATRIX, MATRIX), State)


@inner
def equation(which, t, x, u, out, motion):
    """Write one of the equations of the mechanism, by `equations.DERIVATIVE` and its kin, into ``out``."""
    problem = motion.problem
    evaluate(problem.equations[which], t, x, problem.modes, u, motion.p, out)


@inner
def clearance_at(x, u, motion):
    """Compute the clearance of a state from the limit of assembly; NaN beyond it."""
    equation(CLEARANCE, 0.0, x, u, motion.room.outputs, motion)
    return motion.room.outputs[0]


@inner
def time_at(s, h, motion):
    """Return the time at the fraction s of a step."""
    return motion.carry.begin + (motion.carry.elapsed + s * h)


@inner
def renew(elapsed, x, u, motion):
    """Write the channels at a time and a state of the interval into u, unless they are constant in it."""
    if motion.carry.piece >= 0:
        channels_at(motion.carry.begin, elapsed, motion.carry.piece, x, motion.source, u)


@inner
def look_inside(s, h, motion):
    """Write state and inputs at the fraction s of a step into ``room.z`` and ``room.inside``."""
    room = motion.room
    interpolate(s, motion.x, room.f, room.z)
    copy(motion.u, room.inside)
    renew(motion.carry.elapsed + s * h, room.z, room.inside, motion)


@inner
def released(y, motion):
    """Return whether a torsion bar is released in a step that ends at y."""
    if motion.problem.hold == 0.0:
        for n in range(motion.source.laws.shape[0]):
            if unwound(n, y, motion.source):
                return True
    return False
