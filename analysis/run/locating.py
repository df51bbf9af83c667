"""Locate events in the steps of a compiled run: the limit of assembly, the release of torsion bars, events of the user.

In all functions ``motion`` is the run in progress, a `records.Motion`, e the index of an event, and h a step size (s).
"""

from __future__ import annotations

import numpy as np

from linkwork.limits import LIMIT_SINE

from ..numerics.codegen import call_user, copy, inner
from .equations import DERIVATIVE, OUTPUTS
from .records import (
    DIRECTION,
    EVENT,
    LEVEL,
    LIMIT,
    OUTPUT,
    RUNNING,
    STOPS,
    equation,
    is_bar_released,
    look_inside,
    renew,
    state_clearance,
    step_time,
)
from .sources import is_bar_unwound
from .stepping import NODES, interpolant, interpolate, stage

#: Largest number of events of one kind in a step, each in its own part of the step; the beginning of an interval may add one.
EVENTS_PER_STEP = 4
#: Fraction of a step within which an event counts as simultaneous with the end of the run or the release.
SAME = 1e-9

# Indices of events besides the user's, whose indices begin at 0: NOTHING, ASSEMBLY, and RELEASE - n for torsion bar n. They
# are NumPy integers, as Numba would compile a function again for each constant Python integer that is passed.
RELEASE, NOTHING, ASSEMBLY = np.arange(-3, 0)


@inner
def _gap(e, t, x, u, motion):
    """Return the value, at time t, state x and inputs u, of the function that is zero when event e happens."""
    watch, source = motion.watch, motion.source
    if e == ASSEMBLY:
        return state_clearance(x, u, motion) - LIMIT_SINE
    if e <= RELEASE:
        return source.laws[RELEASE - e, 1] - x[source.law_places[RELEASE - e, 1]]
    if watch.addresses[e] != 0:
        return call_user(watch.addresses[e], t, x)
    equation(OUTPUTS, t, x, u, motion.room.outputs, motion)
    return motion.room.outputs[int(watch.table[e, OUTPUT])] - watch.table[e, LEVEL]


@inner
def _crosses(before, after, direction):
    """Return whether the function of an event crosses zero between two values; False if ``before`` is zero."""
    return (before < 0.0 <= after and direction >= 0.0) or (before > 0.0 >= after and direction <= 0.0)


@inner
def _record(e, t, x, motion):
    row = motion.watch.found[motion.carry.found]
    row[0] = e
    row[1] = t
    for i in range(x.shape[0]):
        row[2 + i] = x[i]
    motion.carry.found += 1


@inner
def notice_jumps(motion):
    """Record the events caused by jumps of the inputs at the beginning of an interval; return the status."""
    carry, watch, x = motion.carry, motion.watch, motion.x
    status = RUNNING
    for e in range(watch.table.shape[0]):
        before = watch.gaps[e]
        if carry.started and before == 0.0:
            # a zero marks an event that was just reported: wait until the value leaves zero
            continue
        watch.gaps[e] = _gap(e, carry.begin, x, motion.u, motion)
        if carry.started and _crosses(before, watch.gaps[e], watch.table[e, DIRECTION]):
            _record(e, carry.begin, x, motion)
            if watch.table[e, STOPS] != 0.0:
                status = EVENT
    return status


@inner
def _locate(e, low, high, h, motion):
    """Return the fraction of the step, between ``low`` and ``high``, at which event e happens, by bisection."""
    room = motion.room
    positive = False
    for n in range(55):
        s = low if n == 0 else 0.5 * (low + high)
        look_inside(s, h, motion)
        # NaN, beyond the limit of assembly, counts as not positive
        sign = _gap(e, step_time(s, h, motion), room.z, room.inside, motion) > 0.0
        if n == 0:
            positive = sign
        elif sign == positive:
            low = s
        else:
            high = s
    # just before the limit of assembly: beyond it there is no configuration
    return low if e == ASSEMBLY else high


@inner
def _events_of_step(what, cut, h, motion):
    """Record the user's events inside a step; return the first event that ends the step, and its time.

    Times are fractions of the step.

    If no event of the user ends the step earlier, it ends with the event ``what`` at the fraction ``cut`` of the step.
    """
    watch, room = motion.watch, motion.room
    for e in range(watch.table.shape[0]):
        for quarter in range(EVENTS_PER_STEP):
            s0 = quarter / EVENTS_PER_STEP
            s1 = (quarter + 1) / EVENTS_PER_STEP
            if s1 == 1.0:
                gap = _gap(e, step_time(s1, h, motion), room.y, motion.u, motion)
            else:
                look_inside(s1, h, motion)
                gap = _gap(e, step_time(s1, h, motion), room.z, room.inside, motion)
            if _crosses(watch.gaps[e], gap, watch.table[e, DIRECTION]):
                s = _locate(e, s0, s1, h, motion)
                interpolate(s, motion.x, room.f, room.z)
                _record(e, s, room.z, motion)
                if watch.table[e, STOPS] != 0.0 and s < cut:
                    what, cut = e, s
            watch.gaps[e] = gap
    return what, cut


@inner
def _make_interpolant(h, motion):
    """Compute the interpolant of a step of size h; stage 12 must already have the rates at the end of the step."""
    carry, room, x = motion.carry, motion.room, motion.x
    copy(motion.u, room.inside)
    for s in range(13, 16):
        stage(s, x, room.k, h, room.z)
        renew(carry.elapsed + NODES[s] * h, room.z, room.inside, motion)
        equation(DERIVATIVE, step_time(NODES[s], h, motion), room.z, room.inside, room.k[s], motion)
    carry.evaluations += 3
    interpolant(x, room.y, room.k, h, room.f)


@inner
def locate_events(clearance, h, motion):
    """Record the events in an accepted step; return the event that ends the step, and its time as a fraction of the step.

    If no event ends the step, these are NOTHING and 2.
    """
    carry, watch = motion.carry, motion.watch
    _make_interpolant(h, motion)
    what, cut = NOTHING, 2.0
    if clearance < LIMIT_SINE:
        what = ASSEMBLY
        cut = _locate(ASSEMBLY, 0.0, 1.0, h, motion)
    if is_bar_released(motion.room.y, motion):
        for n in range(motion.source.laws.shape[0]):
            if is_bar_unwound(n, motion.room.y, motion.source):
                s = _locate(RELEASE - n, 0.0, 1.0, h, motion)
                if s < cut:
                    what, cut = RELEASE - n, s
    what, cut = _events_of_step(what, cut, h, motion)
    # replace fractions by times; remove events after the end of the step
    kept = carry.known
    for n in range(carry.known, carry.found):
        s = watch.found[n, 1]
        if s <= cut + SAME:
            copy(watch.found[n], watch.found[kept])
            watch.found[kept, 1] = step_time(s, h, motion)
            kept += 1
    carry.found = kept
    return what, cut


@inner
def end_step(what, cut, h, motion):
    """End a step at the fraction ``cut`` at which event ``what`` happens; return the status of the run."""
    carry, watch, source = motion.carry, motion.watch, motion.source
    x, u = motion.x, motion.u
    t = step_time(cut, h, motion)
    interpolate(cut, x, motion.room.f, motion.room.z)
    copy(motion.room.z, x)
    if what <= RELEASE:
        x[source.law_places[RELEASE - what, 1]] = source.laws[RELEASE - what, 1]
    renew(carry.elapsed + cut * h, x, u, motion)
    for e in range(watch.table.shape[0]):
        watch.gaps[e] = _gap(e, t, x, u, motion)
    status = RUNNING if what <= RELEASE else LIMIT if what == ASSEMBLY else EVENT
    for n in range(carry.known, carry.found):
        # this event happened at the end of the step, to within rounding errors
        e = int(watch.found[n, 0])
        if watch.found[n, 1] >= step_time(cut - SAME, h, motion):
            watch.gaps[e] = 0.0
            if watch.table[e, STOPS] != 0.0 and what <= RELEASE:
                status = EVENT
    if what <= RELEASE:
        source.laws[RELEASE - what, 2] = 0.0
    carry.begin = t
    carry.elapsed = 0.0
    return status
