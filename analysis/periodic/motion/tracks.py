"""Integrate several motions at once, each in its own lane: functions of compiled kernels.

Each lane has its own mechanism, drive, start, tolerance, step size and end; all mechanisms have the same flow. A kernel starts
a motion in each lane, steps all lanes until one motion ends, and then starts another motion in the lane of this motion. The
integrator is that of `kernels.advance`. In all functions ``section`` is a `kernels.Section`, and v the work space `Tracks`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.integrate import PROBE
from linkwork.limits import LIMIT_SINE, NEAR_LIMIT

from ...numerics.codegen import evaluate, inner, part
from ...numerics.vectors import LANES, load, multiply_add, store
from ...run.compiled import write_lane
from ...run.stepping import NODES, STAGES, bounded_step_size, next_step_size, shorter_step_size, step_short_of_limit
from ...run.stepping_in_lanes import errors_in_lanes, stage_in_lanes
from .flow import GAP, IN_LANES, PLAIN, VARIATIONAL
from .kernels import (
    DONE,
    LEAST_STEP,
    LIMIT,
    NO_STEP,
    STALL,
    STALLED,
    most_steps,
    passes_kink,
    start_piece,
    write_mechanism,
)

#: Status of a lane whose motion has not ended, and of a lane without a motion; a motion ends with a `Status`.
RUNNING, IDLE = -1, -2


class Tracks(NamedTuple):
    """Work space of the integration in lanes; z is the state y followed by the columns of its derivatives.

    First there are arrays in lanes, then arrays with one entry per lane.
    """

    x: NDArray[np.float64]  # z at the beginning of a step
    y: NDArray[np.float64]  # z at a stage, then at the end of a step
    argument: NDArray[np.float64]  # arguments of the flow
    out: NDArray[np.float64]  # values of the flow
    k: NDArray[np.float64]  # rates at the stages
    sizes: NDArray[np.float64]  # magnitudes of z
    modes: NDArray[np.float64]  # this and the following two: those of `Section`
    drive: NDArray[np.float64]
    p: NDArray[np.float64]
    error: NDArray[np.float64]  # error of a step; this and the following have shape (LANES,)
    angle: NDArray[np.float64]  # crank angle (rad)
    end: NDArray[np.float64]  # crank angle at which the motion ends (rad)
    h: NDArray[np.float64]  # step (rad)
    step: NDArray[np.float64]  # proposed next step (rad)
    tolerance: NDArray[np.float64]  # bound of the error
    count: NDArray[np.float64]  # steps since the beginning of the motion
    slowest: NDArray[np.float64]  # crank speed below which the crank counts as stalled (rad/s)
    gap: NDArray[np.float64]  # clearance to the limit of assembly after a small part of a step, then at its end
    before: NDArray[np.float64]  # the same at the beginning of the step
    status: NDArray[np.int64]
    z: NDArray[np.float64]  # z of one lane


@part
def make_tracks(section, columns):
    """Return work space for the motions of a flow with ``columns`` columns of derivatives; all lanes are idle."""
    n = section.scale.shape[0]
    width = n * (1 + columns)
    lanes = width * LANES
    return Tracks(
        np.zeros(lanes), np.zeros(lanes), np.zeros((n + 1) * LANES), np.zeros(n * (1 + n) * LANES), np.zeros((STAGES, lanes)),
        np.zeros(lanes), np.zeros(section.modes.shape[0] * LANES), np.zeros(section.drive.shape[0] * LANES),
        np.zeros(section.p.shape[0] * LANES), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES),
        np.zeros(LANES), np.ones(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES),
        np.full(LANES, IDLE), np.zeros(width),
    )  # fmt: skip


@inner
def set_mechanism(lane, section, v):
    """Write the mechanism and the drive of ``section``, and the magnitudes of z, into a lane of the work space."""
    scale, n = section.scale, section.scale.shape[0]
    write_mechanism(lane, section, v)
    for i in range(n):
        v.z[i] = scale[i]
        for j in range(v.z.shape[0] // n - 1):
            v.z[n + j * n + i] = scale[i] / scale[j]
    write_lane(lane, LANES, v.z, v.sizes)


@inner
def begin(lane, section, start, end, tolerance, v):
    """Begin a motion in a lane, from the crank angle 0 to ``end``, and set its status: RUNNING, or a failure at the start.

    Mechanism and drive of the section must be those of the lane: see `set_mechanism`.
    """
    n = start.shape[0]
    start_piece(start, v.z)
    write_lane(lane, LANES, v.z, v.x)
    v.angle[lane], v.end[lane], v.tolerance[lane], v.count[lane] = 0.0, end, tolerance, 0.0
    v.slowest[lane] = STALL * start[n - 1] if section.torque else 0.0
    evaluate(section.equations[GAP], 0.0, v.z, section.modes, section.drive, section.p, v.out)
    v.before[lane] = v.out[0]
    if section.torque and not v.slowest[lane] > 0.0:
        v.status[lane] = STALLED
    elif not v.before[lane] > LIMIT_SINE:
        v.status[lane] = LIMIT
    else:
        v.status[lane] = RUNNING


@inner
def _set_argument(node, n, z, v):
    for i in range(n):
        store(v.argument, i, load(z, i))
    store(v.argument, n, load(v.angle, 0) + node * load(v.h, 0))


@inner
def _rates(section, s, z, v):
    """Compute the rates of z at stage s of a step, in all lanes."""
    n = section.scale.shape[0]
    columns = z.shape[0] // (n * LANES) - 1
    equation = section.equations[IN_LANES + (VARIATIONAL if columns else PLAIN)]
    _set_argument(NODES[s], n, z, v)
    evaluate(equation, 0.0, v.argument, v.modes, v.drive, v.p, v.out)
    for i in range(n):
        store(v.k[s], i, load(v.out, i))
        for j in range(columns):
            total = load(v.out, n + i) * load(z, n + j * n)
            for q in range(1, n):
                total = multiply_add(load(v.out, n + q * n + i), load(z, n + j * n + q), total)
            store(v.k[s], n + j * n + i, total)


@inner
def _evaluate_gap(section, node, v):
    """Write into ``v.gap`` the clearance at z in ``v.y``, at a fraction ``node`` of the step."""
    _set_argument(node, section.scale.shape[0], v.y, v)
    evaluate(section.equations[IN_LANES + GAP], 0.0, v.argument, v.modes, v.drive, v.p, v.gap)


@inner
def _choose_sizes(section, v):
    """Compute the rates in all lanes, and choose the step of each lane, as `kernels._bounded_size` does in one lane."""
    n = section.scale.shape[0]
    _rates(section, 0, v.x, v)
    for lane in range(LANES):
        v.h[lane] = 0.0
        if v.status[lane] == RUNNING:
            size = min(v.step[lane], section.longest)
            v.h[lane] = bounded_step_size(size, v.k[0], section.reach, v.sizes, lane, LANES)
    for i in range(n):
        store(v.y, i, multiply_add(PROBE, load(v.h, 0) * load(v.k[0], i), load(v.x, i)))
    _evaluate_gap(section, PROBE, v)
    for lane in range(LANES):
        if v.status[lane] == RUNNING:
            # the step after a shortened one grows from it
            v.step[lane] = step_short_of_limit(v.h[lane], v.before[lane], v.gap[lane])
            # avoid a tiny last step before the end
            rest = v.end[lane] - v.angle[lane]
            v.h[lane] = rest if 1.001 * v.step[lane] >= rest else v.step[lane]


@inner
def _attempt(section, v):
    """Try a step in all lanes from the rates in ``v.k[0]``; write z after it, its error and clearance into v."""
    for s in range(1, STAGES):
        stage_in_lanes(s, v.x, v.k, v.h, v.y)
        _rates(section, s, v.y, v)
    stage_in_lanes(STAGES, v.x, v.k, v.h, v.y)
    errors_in_lanes(v.x, v.y, v.k, v.h, v.sizes, v.error)
    _evaluate_gap(section, 1.0, v)


@inner
def _judge(lane, section, last, v):
    """Accept the step of a lane, or propose a shorter step; return whether the motion has ended.

    ``last`` tells whether the step reaches the end of the motion.
    """
    h, n = v.h[lane], section.scale.shape[0]
    error = v.error[lane] / v.tolerance[lane]
    v.count[lane] += 1.0
    if v.count[lane] > most_steps(v.end[lane]):
        v.status[lane] = NO_STEP
        return True
    if not error <= 1.0:
        # beyond the limit of assembly the error is NaN
        v.step[lane] = shorter_step_size(h, error)
        if v.step[lane] >= LEAST_STEP:
            return False
        if not passes_kink(section, error, h, v.x, v.y, v.k, v.sizes, v.tolerance[lane], lane, LANES):
            v.status[lane] = LIMIT if v.before[lane] < NEAR_LIMIT else NO_STEP
            return True
    v.step[lane] = next_step_size(h, v.step[lane], error)
    v.angle[lane] = v.end[lane] if last else v.angle[lane] + h
    v.before[lane] = v.gap[lane]
    for i in range(lane, v.x.shape[0], LANES):
        v.x[i] = v.y[i]
    if not v.gap[lane] > LIMIT_SINE:
        v.status[lane] = LIMIT
    elif section.torque and not v.y[LANES * (n - 1) + lane] > v.slowest[lane]:
        v.status[lane] = STALLED
    elif v.angle[lane] >= v.end[lane]:
        v.status[lane] = DONE
    return v.status[lane] != RUNNING


@inner
def advance_tracks(section, v):
    """Step all lanes until the motion in one lane has ended; return False at once if no lane is running.

    If the status of a lane is DONE, z at the end of its motion is in ``v.x``. The mechanism of ``section`` is not used.
    """
    ended = running = False
    while not ended:
        running = False
        for lane in range(LANES):
            running |= v.status[lane] == RUNNING
        if not running:
            return False
        _choose_sizes(section, v)
        _attempt(section, v)
        for lane in range(LANES):
            if v.status[lane] == RUNNING:
                ended |= _judge(lane, section, v.h[lane] == v.end[lane] - v.angle[lane], v)
    return True
