"""The compiled solver: integration of a run, its inputs, events and outputs.

The integrator is DOP853 (`linkwork.tableau`) with its interpolant of order 7, the same method as the FMU's, written for arrays;
inputs are evaluated inside the loop. The solver knows no mechanism: it calls the equations, which are machine code, by their
addresses (`equations.machine`), and so is compiled only once for all mechanisms. A run is integrated over one interval of
smooth inputs after the other. An interval ends at a break of the inputs, at a point at which they are sampled and held, or at
the release of the torsion bar. In all functions ``motion`` is the run in progress, a `records.Motion`, and h a step size (s).
"""

from __future__ import annotations

from math import isfinite, isnan
from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64, types
from numpy.typing import NDArray

from linkwork.integrate import LEAST_STEP, PROBE
from linkwork.limits import LIMIT_SINE, NEAR_LIMIT

from ..numerics.codegen import CUBE, MATRIX, VECTOR, copy, evaluate, inline, inner, kernel, part
from ..numerics.references import refer
from .equations import DERIVATIVE, JUMP, OUTPUTS
from .locating import EVENTS_PER_STEP, NOTHING, end_step, locate_events, notice_jumps
from .records import (
    BAD_INPUT,
    FINISHED,
    LIMIT,
    NO_STEP,
    PROBLEM,
    RUNNING,
    SAMPLES,
    STATE,
    WATCH,
    Motion,
    Room,
    Samples,
    equation,
    is_bar_released,
    renew,
    state_clearance,
)
from .sources import SOURCE, Source, find, hold, is_bar_unwound, is_bar_wound, write_channels
from .stepping import (
    EXPONENT,
    STAGES,
    Flow,
    attempt,
    bounded_step_size,
    interpolate,
    next_step_size,
    shorter_step_size,
    step_short_of_limit,
)

#: Largest residual of the energy balance, as a fraction of the kinetic energy, that is corrected. A
#: larger one is left as it is: near rest the kinetic energy is small.
GREATEST_SHARE = 1e-3


# Begin an interval


@inner
def begin_interval(motion):
    """Begin an interval: sample the inputs, apply jumps of commanded rates, record samples and events; return the status."""
    problem, source, carry = motion.problem, motion.source, motion.carry
    x, u, t = motion.x, motion.u, motion.carry.begin
    piece = find(t, source.breaks)
    carry.stop = _end_of_interval(piece, motion)
    for n in range(source.laws.shape[0]):
        if is_bar_unwound(n, x, source):
            source.laws[n, 2] = 0.0
    write_channels(t, 0.0, piece, x, source, u)
    carry.piece = -1 if problem.hold > 0.0 or (motion.steady and not is_bar_wound(source.laws)) else piece
    lost = _not_finite(u)
    if problem.hold > 0.0 and lost < 0:
        ahead = carry.stop if t < problem.end else t + problem.hold
        hold(t, ahead, x, source, problem.commands, u, motion.room.inside)
        for n in range(problem.commands.shape[0]):
            # the derivative of a held command is the slope of its secant
            if not isfinite(u[problem.commands[n, 2]]):
                lost = problem.commands[n, 0]
    if lost >= 0:
        carry.lost = lost
        return BAD_INPUT
    # at the start the state already has the commanded rates; later a jump of a commanded rate is an impulse
    jumps = False
    for n in range(problem.commands.shape[0]):
        jumps |= x[problem.commands[n, 1]] != u[problem.commands[n, 0]]
    if carry.started and jumps:
        equation(JUMP, t, x, u, motion.room.z, motion)
        copy(motion.room.z, x)
    _sample_beginning(motion)
    status = notice_jumps(motion)
    carry.started = 1
    return FINISHED if status == RUNNING and t >= problem.end else status


@inner
def _end_of_interval(piece, motion):
    """Return the time at which an interval ends: the inputs are smooth, or held, up to this time.

    ``piece`` is the index of the polynomials of the inputs in this interval.
    """
    end, breaks = motion.problem.end, motion.source.breaks
    if motion.problem.hold > 0.0:
        later = motion.carry.interval + 1
        return motion.samples.times[later] if later < motion.samples.times.shape[0] else end
    later = breaks[piece + 1]
    return later if piece + 1 < breaks.shape[0] - 1 and later < end else end


@inner
def _not_finite(u):
    """Return the index of the first component of u that is not finite; -1 if there is none."""
    for i in range(u.shape[0]):
        if not isfinite(u[i]):
            return i
    return -1


@inner
def _first_step(motion):
    """Compute the rates at the beginning of the interval and, at the start of the run, the first step size."""
    carry = motion.carry
    equation(DERIVATIVE, carry.begin + carry.elapsed, motion.x, motion.u, motion.room.k[0], motion)
    carry.evaluations += 1
    choose_first_size(motion)


@inner
def choose_first_size(motion):
    """Choose the first step size of a run from the rates at its beginning."""
    carry, x, k = motion.carry, motion.x, motion.room.k
    if not carry.step > 0.0:
        ratio = 1e-300
        for i in range(x.shape[0]):
            ratio = max(ratio, abs(k[0, i]) / (motion.scale[i] + abs(x[i])))
        carry.step = min(carry.stop - carry.begin, motion.problem.tolerance**-EXPONENT / ratio)


# Attempt a step


@inner
def next_size(carry, size):
    """Return the size of the next step, which is at most ``size``, and whether it is the last of its interval."""
    remaining = (carry.stop - carry.begin) - carry.elapsed
    carry.step = size  # the step after a shortened one grows from it
    last = size >= remaining * (1.0 - 1e-10)
    return remaining if last else min(size, 0.5 * remaining), last


@inner
def _bounded_size(motion):
    """Return the proposed step size, or a shorter one so that the step skips no short force and no limit of assembly."""
    x, room = motion.x, motion.room
    h = bounded_step_size(motion.carry.step, room.k[0], motion.problem.reach, motion.scale, 0, 1)
    for i in range(x.shape[0]):
        room.z[i] = x[i] + PROBE * h * room.k[0, i]
    clearance = state_clearance(x, motion.u, motion)
    return step_short_of_limit(h, clearance, state_clearance(room.z, motion.u, motion))


@inner
def _attempt(h, motion):
    """Compute a step of size h and return its error relative to the tolerance."""
    problem, carry, room = motion.problem, motion.carry, motion.room
    carry.steps += 1
    carry.evaluations += STAGES - 1
    flow = Flow(problem.equations[DERIVATIVE], problem.modes, motion.p, motion.scale)
    error = attempt(flow, carry.begin, carry.elapsed, h, motion.x, room, motion.u, carry.piece, motion.source)
    return error / problem.tolerance


@inner
def _accept(h, last, t_new, motion):
    """Return whether to accept a step, whether an event or a sample may lie inside it, and the clearance at its end.

    The clearance is that to the limit of assembly.
    """
    watch, carry, samples, y, u = motion.watch, motion.carry, motion.samples, motion.room.y, motion.u
    renew(carry.elapsed + h, y, u, motion)
    if watch.balance.shape[0] > 0:
        _keep_balance(motion)
    clearance = state_clearance(y, u, motion)
    inside = (
        clearance < LIMIT_SINE
        or is_bar_released(y, motion)
        or (carry.sample < samples.times.shape[0] and samples.times[carry.sample] < t_new)
        or watch.table.shape[0] > 0
    )
    # the clearance is NaN beyond the limit of assembly
    good = not isnan(clearance)
    # the interpolant and the next step need the derivative at the end; after the last step it is not needed
    if inside or not last:
        equation(DERIVATIVE, t_new, y, u, motion.room.k[12], motion)
        carry.evaluations += 1
        good &= _not_finite(motion.room.k[12]) < 0
    return good, inside, clearance


@inner
def _keep_balance(motion):
    """Scale the rates at the end of a step so that the energy balance holds; do nothing if the mechanism is nearly at rest."""
    y, outputs, balance = motion.room.y, motion.room.outputs, motion.watch.balance
    equation(OUTPUTS, 0.0, y, motion.u, outputs, motion)
    share = outputs[balance[0]] / outputs[balance[1]]
    if abs(share) < GREATEST_SHARE:
        freedoms = y.shape[0] // 2 - 1
        for i in range(freedoms, 2 * freedoms):
            y[i] *= np.sqrt(1.0 - share)


@inner
def short_step_status(h, motion):
    """Return the status of a run whose step size h has become too short: LIMIT, BAD_INPUT or NO_STEP."""
    carry, room, x, u = motion.carry, motion.room, motion.x, motion.u
    status = LIMIT if abs(state_clearance(x, u, motion)) < NEAR_LIMIT else NO_STEP
    if carry.piece >= 0:
        # an input that is not finite may be the cause
        for i in range(x.shape[0]):
            room.z[i] = x[i] + h * room.k[0, i]
        copy(u, room.inside)
        renew(carry.elapsed + h, room.z, room.inside, motion)
        lost = _not_finite(room.inside)
        if lost >= 0:
            carry.lost = lost
            status = BAD_INPUT
        renew(carry.elapsed, x, u, motion)
    return status


# Record


@inner
def _sample_beginning(motion):
    """Record the samples at the beginning of the interval, with the inputs of this interval."""
    carry, samples = motion.carry, motion.samples
    while carry.sample < samples.times.shape[0] and samples.times[carry.sample] <= carry.begin:
        copy(motion.x, samples.states[carry.sample])
        copy(motion.u, samples.forces[carry.sample])
        carry.sample += 1


@inner
def sample_step(t_new, h, motion):
    """Record the samples inside a step, before ``t_new``; a sample at its end is recorded with the next step or interval."""
    carry, samples = motion.carry, motion.samples
    while carry.sample < samples.times.shape[0] and samples.times[carry.sample] < t_new:
        n = carry.sample
        elapsed = samples.times[n] - carry.begin
        interpolate((elapsed - carry.elapsed) / h, motion.x, motion.room.f, samples.states[n])
        copy(motion.u, samples.forces[n])
        renew(elapsed, samples.states[n], samples.forces[n], motion)
        carry.sample += 1


# A run


@inner
def _cross_interval(motion, most):
    """Integrate to the end of the interval, or pause after ``most`` steps or when the event table is full; return the status.

    If the run pauses, ``carry.midway`` is 1.
    """
    carry, room, watch, x = motion.carry, motion.room, motion.watch, motion.x
    least = LEAST_STEP * (motion.problem.end - motion.samples.times[0])
    full = watch.found.shape[0] - EVENTS_PER_STEP * watch.table.shape[0]
    carry.midway = 0
    _first_step(motion)
    while True:
        if carry.steps >= most or carry.found > full:
            carry.midway = 1
            # after a rejected step the inputs are those of one of its stages
            renew(carry.elapsed, x, motion.u, motion)
            return RUNNING
        h, last = next_size(carry, _bounded_size(motion))
        t_new = carry.stop if last else carry.begin + (carry.elapsed + h)
        error = _attempt(h, motion)
        good, inside, clearance = False, False, 0.0
        if error <= 1.0:
            good, inside, clearance = _accept(h, last, t_new, motion)
        if not good:
            carry.rejected += 1
            carry.step = shorter_step_size(h, error)
            if not carry.step >= least:
                return short_step_status(h, motion)
            continue
        carry.step = next_step_size(h, carry.step, error)
        carry.known = carry.found
        if inside:
            what, cut = locate_events(clearance, h, motion)
            if what != NOTHING:
                sample_step(carry.begin + (carry.elapsed + cut * h), h, motion)
                return end_step(what, cut, h, motion)
            sample_step(t_new, h, motion)
        copy(room.y, x)
        copy(room.k[12], room.k[0])
        if last:
            carry.begin = carry.stop
            carry.elapsed = 0.0
            carry.interval += 1
            return RUNNING
        carry.elapsed += h


@part
def make_room(states, outputs, inputs):
    """Allocate the work arrays `Room` for given numbers of states, outputs and inputs."""
    return Room(
        np.empty((16, states)),
        np.empty(states),
        np.empty(states),
        np.empty((7, states)),
        np.empty(inputs),
        np.empty(outputs),
    )


@inner
def advance(motion, most):
    """Integrate interval by interval until the run ends or pauses; return the status."""
    carry, watch = motion.carry, motion.watch
    full = watch.found.shape[0] - (1 + EVENTS_PER_STEP) * watch.table.shape[0]
    while True:
        if carry.midway == 0:
            if carry.found > full:
                return RUNNING
            status = begin_interval(motion)
            if status != RUNNING:
                return status
        status = _cross_interval(motion, most)
        if status != RUNNING or carry.midway != 0:
            return status


class Batch(NamedTuple):
    """Data that differ between runs, one row for each run.

    ``p`` are the constants and the energy at the start, ``scales`` the magnitudes to which errors are relative, ``steady``
    whether the inputs are constant between breaks, ``sizes`` the numbers of polynomial pieces and of harmonics. The other
    fields are those of `signals.Source`.
    """

    p: NDArray[np.float64]
    scales: NDArray[np.float64]
    steady: NDArray[np.bool_]
    sizes: NDArray[np.int64]
    breaks: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    harmonics: NDArray[np.float64]
    laws: NDArray[np.float64]


BATCH = types.NamedTuple(
    (MATRIX, MATRIX, boolean[::1], int64[:, ::1], MATRIX, float64[:, :, :, ::1], CUBE, CUBE), Batch
)


def single_batch(source: Source, p: NDArray[np.float64], scale: NDArray[np.float64], steady: bool) -> Batch:
    """Return a single run as a batch of one; the batch shares the arrays of ``source``."""
    sizes = [[len(source.coefficients), len(source.harmonics)]]
    inputs = (source.breaks, source.coefficients, source.harmonics, source.laws)
    return Batch(p[None], scale[None], np.array([steady]), np.array(sizes), *(values[None] for values in inputs))


@inline
def run_source(i, source, batch):
    """Return the inputs of run i of a batch as a `Source`; ``source`` has the data common to all runs."""
    pieces, waves = batch.sizes[i]
    return Source(
        batch.breaks[i, : pieces + 1],
        batch.coefficients[i, :pieces],
        batch.harmonics[i, :waves],
        source.places,
        batch.laws[i],
        source.law_places,
        source.functions,
    )


@inline
def lane_motion(i, problem, source, batch, watch, samples, room, state):
    """Return a reference to run i of a batch as a `Motion`."""
    return refer(Motion(
        problem, batch.p[i], batch.scales[i], batch.steady[i], run_source(i, source, batch), watch,
        Samples(samples.times, samples.states[i], samples.forces[i]), room, state.carries[i], state.x[i], state.u[i],
    ))  # fmt: skip


@kernel(types.void(float64, SOURCE, BATCH, MATRIX, MATRIX), purpose="the inputs of ensembles")
def channels_of_many(t, source, batch, x, u):
    """Compute the input channels of each run of a batch at time t: row i of u receives those at the state in row i of x."""
    for i in range(x.shape[0]):
        own = run_source(i, source, batch)
        write_channels(t, 0.0, find(t, own.breaks), x[i], own, u[i])


@kernel(types.void(PROBLEM, SOURCE, BATCH, WATCH, STATE, SAMPLES, int64[::1], int64, int64), purpose="the solver")
def run(problem, source, batch, watch, state, samples, status, most, budget):
    """Integrate the runs of a batch whose status is RUNNING, one after the other.

    Each run is integrated until its end, a stopping event, ``most`` steps in all, or a full table of events. The function
    returns after ``budget`` steps of all runs together. Called again with the same arrays it continues, with the same result
    as in one call.

    Parameters
    ----------
    problem : Problem
        Data common to all runs.
    source : Source
        Only ``places``, ``law_places`` and ``functions`` are used, which all runs have in common.
    batch : Batch
        Data of each run; its ``laws`` are overwritten when a torsion bar is released.
    watch : Watch
        Table and values of the events if the batch is a single run, else empty; overwritten.
    state : State
        Overwritten. At the start all fields of ``carries`` are zero except ``begin``, the start time; the caller sets
        ``found`` to zero after reading the events.
    samples : Samples
        Samples of each run; written.
    status : ndarray, shape (runs,)
        Status of each run; written: RUNNING, FINISHED, BAD_INPUT, LIMIT, NO_STEP or EVENT.
    most, budget : int
        Largest number of steps of a run in all, and of all runs in this call.
    """
    room = make_room(state.x.shape[1], problem.outputs, state.u.shape[1])
    for i in range(state.x.shape[0]):
        carry = state.carries[i]
        before = carry.steps
        if status[i] != RUNNING or before >= most:
            continue
        if budget <= 0:
            return
        motion = lane_motion(i, problem, source, batch, watch, samples, room, state)
        status[i] = advance(motion, min(most, before + budget))
        budget -= carry.steps - before


@inner
def write_lane(lane, lanes, values, many):
    """Write values into one lane of an array in lanes: value i is ``many[lanes * i + lane]``."""
    for i in range(values.shape[0]):
        many[lanes * i + lane] = values[i]


@inner
def read_lane(lane, lanes, many, values):
    """Read the values of one lane of an array in lanes: value i is ``many[lanes * i + lane]``."""
    for i in range(values.shape[0]):
        values[i] = many[lanes * i + lane]


@kernel(types.void(int64, int64, VECTOR, VECTOR, MATRIX, MATRIX, MATRIX), purpose="the outputs")
def rows(equation, lanes, modes, p, states, forces, out):
    """Evaluate the equation at an address for each row of states and inputs, and write the results into the rows of ``out``.

    Shapes are (n, states) for ``states``, (n, inputs) for ``forces``, and (n, results) for ``out``. The machine code of the
    equation evaluates ``lanes`` rows at once, and writes their results one row after the other.
    """
    modes_of, p_of = np.empty(lanes * modes.shape[0]), np.empty(lanes * p.shape[0])
    x, u = np.empty(lanes * states.shape[1]), np.empty(lanes * forces.shape[1])
    y = np.empty(lanes * out.shape[1])
    for lane in range(lanes):
        write_lane(lane, lanes, modes, modes_of)
        write_lane(lane, lanes, p, p_of)
    for first in range(0, states.shape[0], lanes):
        count = min(lanes, states.shape[0] - first)
        for lane in range(lanes):
            # the last row also fills lanes without a row
            row = first + min(lane, count - 1)
            write_lane(lane, lanes, states[row], x)
            write_lane(lane, lanes, forces[row], u)
        if count == lanes:
            evaluate(equation, 0.0, x, modes_of, u, p_of, out[first:])
        else:
            evaluate(equation, 0.0, x, modes_of, u, p_of, y)
            for lane in range(count):
                copy(y[lane * out.shape[1] :], out[first + lane])
