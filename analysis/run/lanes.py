"""Solve runs of an ensemble in lanes: one run in each lane of the processor's vectors, with its own time, step size and end.

The steps are those of `compiled`: the stages of all lanes are computed together, and each lane then accepts its step or tries
a shorter one. When a run ends, its lane takes the next run. The functions for single runs begin an interval of inputs, evaluate
inputs that change within it, and locate the limit of assembly and the release of a torsion bar.

Arrays in lanes are flat: number i of lane l is at ``LANES * i + l``. Arguments ``v`` are the work arrays `Lanes`, arguments
``w`` the `Work`.
"""

from __future__ import annotations

from math import isfinite, isnan
from typing import NamedTuple

import numpy as np
from numba import int64, types
from numpy.typing import NDArray

from linkwork.integrate import LEAST_STEP, PROBE
from linkwork.limits import LIMIT_SINE

from ..numerics.codegen import copy, evaluate, inline, inner, kernel, part
from ..numerics.references import refer
from ..numerics.vectors import LANES
from .compiled import (
    BATCH,
    Batch,
    begin_interval,
    choose_first_size,
    lane_motion,
    make_room,
    next_size,
    read_lane,
    run_source,
    sample_step,
    short_step_status,
    write_lane,
)
from .equations import CLEARANCE, DERIVATIVE
from .locating import end_step, locate_events
from .records import (
    PROBLEM,
    RUNNING,
    SAMPLES,
    STATE,
    WATCH,
    Problem,
    Room,
    Samples,
    State,
    Watch,
    is_bar_released,
    renew,
)
from .sources import ADDRESSES, SOURCE, Source, write_channels
from .stepping import NODES, STAGES, bounded_step_size, next_step_size, shorter_step_size, step_short_of_limit
from .stepping_in_lanes import errors_in_lanes, interpolants_in_lanes, interpolate_in_lanes, stage_in_lanes


class Lanes(NamedTuple):
    """Work arrays of all lanes.

    ``code`` are the addresses of the equations in lanes. For each lane: ``run`` is the index of its run or -1, ``phase`` and
    ``outcome`` are constants of this module, ``last`` is 1 if the step is the last of its interval. In lanes: state ``x``,
    state at the end of the step ``y`` and at a stage ``z``, modes, channels, constants, scales, step size, error, fraction of
    the step, stages, interpolant, clearance at the end of the step and after its fraction `PROBE`. Row l of ``between`` is
    the state of lane l at its fraction of the step.
    """

    code: NDArray[np.int64]
    run: NDArray[np.int64]
    phase: NDArray[np.int64]
    last: NDArray[np.int64]
    outcome: NDArray[np.int64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    modes: NDArray[np.float64]
    u: NDArray[np.float64]
    p: NDArray[np.float64]
    scale: NDArray[np.float64]
    h: NDArray[np.float64]
    error: NDArray[np.float64]
    fraction: NDArray[np.float64]
    k: NDArray[np.float64]
    f: NDArray[np.float64]
    clearance: NDArray[np.float64]
    ahead: NDArray[np.float64]
    between: NDArray[np.float64]


# Phase of a run: between intervals, in an interval whose first rates are not known, or in an interval with known rates
_BETWEEN, _ENTERED, _INSIDE = range(3)
# Outcome of a step: no step, rejected, accepted, accepted and its samples not yet recorded
_IDLE, _REJECTED, _ACCEPTED, _SAMPLED = range(4)


@part
def _make_lanes(code, states, modes, channels, constants):
    """Allocate the work arrays, with no run in any lane."""
    n = states * LANES
    return Lanes(
        code, np.full(LANES, -1), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES, np.int64),
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(modes * LANES), np.zeros(channels * LANES),
        np.zeros(constants * LANES), np.zeros(n), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros((16, n)),
        np.zeros((7, n)), np.zeros(LANES), np.zeros(LANES), np.zeros((LANES, states)),
    )  # fmt: skip


@inner
def _equation(which, x, out, v):
    evaluate(v.code[which], 0.0, x, v.modes, v.u, v.p, out)


@inner
def _end_of_step(lane, carry, v):
    return carry.stop if v.last[lane] else carry.begin + (carry.elapsed + v.h[lane])


@inner
def _finite(lane, states, many):
    for i in range(states):  # noqa: SIM110 - Numba compiles no generators
        if not isfinite(many[LANES * i + lane]):
            return False
    return True


class Work(NamedTuple):
    """The arguments of `run_in_lanes`, and the work arrays that the functions for single runs need."""

    problem: Problem
    source: Source
    batch: Batch
    watch: Watch
    state: State
    samples: Samples
    status: NDArray[np.int64]
    room: Room


@inline
def _motion(i, w):
    """Return a reference to run i as a `Motion`."""
    return lane_motion(i, w.problem, w.source, w.batch, w.watch, w.samples, w.room, w.state)


@inner
def _changing(v, w):
    """Return whether the inputs of a lane change within its interval."""
    for lane in range(LANES):  # noqa: SIM110 - Numba compiles no generators
        if v.run[lane] >= 0 and w.state.carries[v.run[lane]].piece >= 0:
            return True
    return False


@inner
def _renew(share, x, v, w):
    """Update the channels of all lanes to the states x at the fraction ``share`` of their steps."""
    for lane in range(LANES):
        i = v.run[lane]
        if i >= 0 and w.state.carries[i].piece >= 0:
            read_lane(lane, LANES, x, w.room.z)
            read_lane(lane, LANES, v.u, w.room.inside)
            carry = w.state.carries[i]
            source = refer(run_source(i, w.source, w.batch))
            write_channels(carry.begin, carry.elapsed + share * v.h[lane], carry.piece, w.room.z, source, w.room.inside)
            write_lane(lane, LANES, w.room.inside, v.u)


@inner
def _attempt(changing, v, w):
    """Take a step in all lanes, as `stepping.attempt` does, into ``v.y``; write the errors into ``v.error``.

    ``changing`` is the value of `_changing`.
    """
    for s in range(1, STAGES):
        stage_in_lanes(s, v.x, v.k, v.h, v.y)
        if changing:
            _renew(NODES[s], v.y, v, w)
        _equation(DERIVATIVE, v.y, v.k[s], v)
    stage_in_lanes(STAGES, v.x, v.k, v.h, v.y)
    errors_in_lanes(v.x, v.y, v.k, v.h, v.scale, v.error)
    if changing:
        _renew(1.0, v.y, v, w)


@inner
def _make_interpolants(changing, v, w):
    """Compute the interpolants of all lanes' steps."""
    for s in range(STAGES + 1, 16):
        stage_in_lanes(s, v.x, v.k, v.h, v.z)
        if changing:
            _renew(NODES[s], v.z, v, w)
        _equation(DERIVATIVE, v.z, v.k[s], v)
    interpolants_in_lanes(v.x, v.y, v.k, v.h, v.f)
    if changing:
        _renew(1.0, v.y, v, w)


@inner
def _sample(v, w):
    """Record the samples inside the accepted steps of all lanes."""
    samples, state = w.samples, w.state
    while True:
        more = False
        for lane in range(LANES):
            if v.outcome[lane] == _SAMPLED:
                carry = state.carries[v.run[lane]]
                if carry.sample < samples.times.shape[0] and samples.times[carry.sample] < _end_of_step(lane, carry, v):
                    elapsed = samples.times[carry.sample] - carry.begin
                    v.fraction[lane] = (elapsed - carry.elapsed) / v.h[lane]
                    more = True
                else:
                    v.outcome[lane] = _ACCEPTED
        if not more:
            return
        interpolate_in_lanes(v.fraction, v.x, v.f, v.between)
        for lane in range(LANES):
            if v.outcome[lane] == _SAMPLED:
                i = v.run[lane]
                carry = state.carries[i]
                n = carry.sample
                copy(v.between[lane], samples.states[i, n])
                copy(state.u[i], samples.forces[i, n])
                renew(samples.times[n] - carry.begin, v.between[lane], samples.forces[i, n], _motion(i, w))
                carry.sample += 1


@inner
def _judge(lane, error, carry, ends, samples, v):
    """Return the outcome of a lane's step; ``error`` is relative to the tolerance, ``ends`` says whether an event is inside."""
    states = v.x.shape[0] // LANES
    if not error <= 1.0 or isnan(v.clearance[lane]) or not _finite(lane, states, v.y):
        return _REJECTED
    inside = ends or (
        carry.sample < samples.times.shape[0] and samples.times[carry.sample] < _end_of_step(lane, carry, v)
    )
    if (inside or not v.last[lane]) and not _finite(lane, states, v.k[STAGES]):
        return _REJECTED
    return _SAMPLED if inside else _ACCEPTED


@inner
def _take_run(lane, first, most, v, w):
    """Give a lane the next run, from index ``first`` on, that has steps to take; return the index after this run.

    ``most`` is the largest number of steps of a run.
    """
    i, end = first, w.status.shape[0]
    while i < end and not (w.status[i] == RUNNING and w.state.carries[i].steps < most):
        i += 1
    if i == end:
        return end
    v.run[lane] = i
    v.phase[lane] = _BETWEEN
    write_lane(lane, LANES, w.batch.p[i], v.p)
    write_lane(lane, LANES, w.batch.scales[i], v.scale)
    return i + 1


@inner
def _enter(lane, v, w):
    """Begin the next interval of a lane's run, or continue inside an interval; the lane becomes empty if the run ends."""
    i = v.run[lane]
    carry = w.state.carries[i]
    if carry.midway == 0:
        w.status[i] = begin_interval(_motion(i, w))
        if w.status[i] != RUNNING:
            v.run[lane] = -1
            return
        carry.midway = 1
    write_lane(lane, LANES, w.state.x[i], v.x)
    write_lane(lane, LANES, w.state.u[i], v.u)
    v.phase[lane] = _ENTERED


@inner
def _leave(lane, v, w):
    """Write the state and the inputs of a lane's run back into ``w.state``."""
    i = v.run[lane]
    read_lane(lane, LANES, v.x, w.state.x[i])
    renew(w.state.carries[i].elapsed, w.state.x[i], w.state.u[i], _motion(i, w))


@inner
def _fill(first, most, v, w):
    """Bring each lane to the beginning of a step of its run, or leave it empty if no runs are left.

    ``first`` is the index of the next run, ``most`` the greatest number of steps of a run, v the work space of the lanes.
    Return how many lanes are not empty, and the index of the next run then.
    """
    busy = 0
    for lane in range(LANES):
        v.outcome[lane] = _IDLE
        while True:
            if v.run[lane] < 0:
                first = _take_run(lane, first, most, v, w)
                if v.run[lane] < 0:
                    break
            if v.phase[lane] == _BETWEEN:
                _enter(lane, v, w)
            if v.run[lane] >= 0:
                if w.state.carries[v.run[lane]].steps < most:
                    busy += 1
                    break
                _leave(lane, v, w)
                v.run[lane] = -1
    return busy, first


@inner
def _choose_sizes(v, w):
    """Choose the step size of each lane; compute the first rates in lanes whose interval begins."""
    fresh = False
    for lane in range(LANES):
        fresh |= v.run[lane] >= 0 and v.phase[lane] == _ENTERED
    if fresh:
        _equation(DERIVATIVE, v.x, v.z, v)
    for lane in range(LANES):
        i = v.run[lane]
        v.h[lane] = 0.0
        if i >= 0:
            carry = w.state.carries[i]
            if v.phase[lane] == _ENTERED:
                v.phase[lane] = _INSIDE
                read_lane(lane, LANES, v.z, w.room.k[0])
                write_lane(lane, LANES, w.room.k[0], v.k[0])
                choose_first_size(_motion(i, w))
            v.h[lane] = bounded_step_size(carry.step, v.k[0], w.problem.reach, v.scale, lane, LANES)
            carry.steps += 1
    for j in range(v.x.shape[0]):
        v.z[j] = v.x[j] + PROBE * v.h[j % LANES] * v.k[0, j]
    _equation(CLEARANCE, v.x, v.clearance, v)
    _equation(CLEARANCE, v.z, v.ahead, v)
    for lane in range(LANES):
        if v.run[lane] >= 0:
            size = step_short_of_limit(v.h[lane], v.clearance[lane], v.ahead[lane])
            v.h[lane], v.last[lane] = next_size(w.state.carries[v.run[lane]], size)


@inner
def _end_at_event(lane, v, w):
    """End a lane's step at the limit of assembly, which ends the run, or at the release of a torsion bar, inside the step."""
    i, h = v.run[lane], v.h[lane]
    read_lane(lane, LANES, v.x, w.state.x[i])
    read_lane(lane, LANES, v.u, w.state.u[i])
    for s in range(STAGES + 1):
        read_lane(lane, LANES, v.k[s], w.room.k[s])
    motion = _motion(i, w)
    what, cut = locate_events(v.clearance[lane], h, motion)
    sample_step(motion.carry.begin + (motion.carry.elapsed + cut * h), h, motion)
    w.status[i] = end_step(what, cut, h, motion)
    motion.carry.midway = 0
    v.phase[lane] = _BETWEEN
    if w.status[i] != RUNNING:
        v.run[lane] = -1
    v.outcome[lane] = _IDLE


@inner
def _decide(lane, least, v, w):
    """Decide on the outcome of a lane's step and choose the next step size; end the run if it cannot continue.

    ``least`` is the shortest step size with which a rejected step is tried again.
    """
    i, h = v.run[lane], v.h[lane]
    carry = w.state.carries[i]
    error = v.error[lane] / w.problem.tolerance
    read_lane(lane, LANES, v.y, w.room.y)
    ends = v.clearance[lane] < LIMIT_SINE or is_bar_released(w.room.y, _motion(i, w))
    v.outcome[lane] = _judge(lane, error, carry, ends, w.samples, v)
    if v.outcome[lane] != _REJECTED:
        carry.step = next_step_size(h, carry.step, error)
        if ends:
            _end_at_event(lane, v, w)
        return
    carry.rejected += 1
    carry.step = shorter_step_size(h, error)
    _leave(lane, v, w)
    write_lane(lane, LANES, w.state.u[i], v.u)
    if not carry.step >= least:
        read_lane(lane, LANES, v.k[0], w.room.k[0])
        w.status[i] = short_step_status(h, _motion(i, w))
        v.run[lane] = -1


@inner
def _accept_step(lane, v, w):
    """Move a lane to the end of its accepted step."""
    i = v.run[lane]
    carry = w.state.carries[i]
    for j in range(lane, v.x.shape[0], LANES):
        v.x[j] = v.y[j]
        v.k[0, j] = v.k[STAGES, j]
    if v.last[lane]:
        carry.begin = carry.stop
        carry.elapsed = 0.0
        carry.interval += 1
        carry.midway = 0
        read_lane(lane, LANES, v.x, w.state.x[i])
        v.phase[lane] = _BETWEEN
    else:
        carry.elapsed += v.h[lane]


@inner
def _run(lanes, work, most, budget):
    """Integrate as `run_in_lanes` describes; the caller keeps the arrays alive to which ``lanes`` and ``work`` refer."""
    v, w = refer(lanes), refer(work)
    least = LEAST_STEP * (w.problem.end - w.samples.times[0])
    first = 0
    while budget > 0:
        busy, first = _fill(first, most, v, w)
        if busy == 0:
            return
        budget -= busy
        changing = _changing(v, w)
        _choose_sizes(v, w)
        _attempt(changing, v, w)
        _equation(CLEARANCE, v.y, v.clearance, v)
        _equation(DERIVATIVE, v.y, v.k[STAGES], v)
        looking = False
        for lane in range(LANES):
            if v.run[lane] >= 0:
                _decide(lane, least, v, w)
                looking |= v.outcome[lane] == _SAMPLED
        if looking:
            _make_interpolants(changing, v, w)
            _sample(v, w)
        for lane in range(LANES):
            if v.outcome[lane] == _ACCEPTED:
                _accept_step(lane, v, w)
    for lane in range(LANES):
        if v.run[lane] >= 0:
            _leave(lane, v, w)


@kernel(
    types.void(ADDRESSES, PROBLEM, SOURCE, BATCH, WATCH, STATE, SAMPLES, int64[::1], int64, int64),
    purpose="the solver of ensembles",
)
def run_in_lanes(code, problem, source, batch, watch, state, samples, status, most, budget):
    """Integrate the runs of a batch whose status is RUNNING, several at once.

    ``code`` are the addresses of the equations in lanes, see `equations.machine`; the other arguments are those of
    `compiled.run`.
    """
    states, channels = state.x.shape[1], state.u.shape[1]
    room = make_room(states, problem.outputs, channels)
    v = _make_lanes(code, states, problem.modes.shape[0], channels, batch.p.shape[1])
    for lane in range(LANES):
        write_lane(lane, LANES, problem.modes, v.modes)
    _run(v, Work(problem, source, batch, watch, state, samples, status, room), most, budget)
