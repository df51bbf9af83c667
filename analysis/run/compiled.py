"""The compiled solver: integration of a run, its inputs, events and outputs.

The integrator is DOP853 (`linkwork.tableau`) with its interpolant of order 7, the same method as the FMU's, written again
for arrays; inputs are evaluated inside the loop. It knows no mechanism: the equations are functions of machine code that it
calls by their addresses (`equations.machine`), so that it is compiled once for all. A run goes from one interval of smooth
inputs to the next, ends of intervals being breaks of the inputs, points at which they are sampled and held, and the release
of the torsion bar.
"""

from __future__ import annotations

from math import isfinite, isnan
from typing import NamedTuple

import numpy as np
from numba import boolean, float64, from_dtype, int64, types
from numpy.typing import NDArray

from linkwork.integrate import LEAST_STEP
from linkwork.limits import LIMIT_SINE, NEAR_LIMIT

from ..numerics.codegen import CUBE, MATRIX, VECTOR, call_user, evaluate, inner, kernel, part
from .equations import CLEARANCE, DERIVATIVE, JUMP, OUTPUTS
from .sources import ADDRESSES, PLACES, SOURCE, Source, channels_at, find, hold
from .stepping import EXPONENT, NODES, STAGES, attempt, following, interpolant, interpolate, shorter, stage

# Status of a run, as the kernels return it: where the run has one, the solver.status of the FMI contract
RUNNING = -1
FINISHED = 0
BAD_INPUT = 2
LIMIT = 3
NO_STEP = 4
EVENT = 10

#: Events that one step can bring at most, and the beginning of an interval besides.
EVENTS_PER_STEP = 4
#: Fraction of a step within which an event counts as simultaneous with the end of the run or the release.
SAME = 1e-9
#: Share of the kinetic energy up to which the residual of the energy balance is taken out of it: a mechanism at rest has none.
GREATEST_SHARE = 1e-3

# Columns of the events' table
OUTPUT, LEVEL, DIRECTION, STOPS = range(4)
# What can cut a step short besides a user's event, which goes by its number
NOTHING = -3
RELEASE = -2
ASSEMBLY = -1


class Problem(NamedTuple):
    """What does not change in a run.

    ``equations`` are addresses, by `equations.DERIVATIVE` and its kin; ``p`` the constants and the mechanical energy at the
    start; ``commands``, shape (c, 3), for each commanded rate in force the numbers of its channel, of the state that it is,
    and of the channel of its own rate; ``hold`` the step (s) over which inputs are sampled at the samples' times and held,
    0 where they act continuously; ``steady`` whether they, but for the torsion bar, are constant between the breaks.
    """

    equations: NDArray[np.int64]
    modes: NDArray[np.float64]
    p: NDArray[np.float64]
    scale: NDArray[np.float64]
    commands: NDArray[np.int64]
    tolerance: float
    hold: float
    end: float
    steady: bool


class Watch(NamedTuple):
    """Events: a row each of OUTPUT, LEVEL, DIRECTION, STOPS; address of the function in the place of an output, or 0; last
    value; and rows of those found: number, time, state. Where the energy balance is to be kept, the numbers of the outputs
    that are its residual and the kinetic energy; else none."""

    table: NDArray[np.float64]
    addresses: NDArray[np.int64]
    gaps: NDArray[np.float64]
    found: NDArray[np.float64]
    balance: NDArray[np.int64]


class Work(NamedTuple):
    """Room to work in: stages, states at a stage's end and inside a step, coefficients of the interpolant, the inputs in
    force, those inside a step, those at the end of an interval, and outputs."""

    k: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    dense: NDArray[np.float64]
    f: NDArray[np.float64]
    held: NDArray[np.float64]
    inside: NDArray[np.float64]
    ahead: NDArray[np.float64]
    outputs: NDArray[np.float64]


#: What carries a run from one call to the next: the time at which the interval began and that since then, the step to try,
#: number of the next sample, of the interval and of events found, counts, whether the run has started and is inside an
#: interval, and the channel that was not finite.
CARRY = np.dtype(
    [
        ("begin", "f8"),
        ("elapsed", "f8"),
        ("step", "f8"),
        ("sample", "i8"),
        ("interval", "i8"),
        ("found", "i8"),
        ("steps", "i8"),
        ("rejected", "i8"),
        ("evaluations", "i8"),
        ("started", "i8"),
        ("midway", "i8"),
        ("lost", "i8"),
    ]
)

_PROBLEM = types.NamedTuple((ADDRESSES, VECTOR, VECTOR, VECTOR, PLACES, float64, float64, float64, boolean), Problem)
_WATCH = types.NamedTuple((MATRIX, ADDRESSES, VECTOR, MATRIX, ADDRESSES), Watch)
_CARRIES = from_dtype(CARRY)[::1]


@inner
def _copy(source, target):
    for i in range(target.shape[0]):
        target[i] = source[i]


# Events


@inner
def _clearance(problem, x, u, out):
    evaluate(problem.equations[CLEARANCE], 0.0, x, problem.modes, u, problem.p, out)
    return out[0]


@inner
def _gap(e, t, x, u, problem, source, watch, out):
    """What is zero where something happens: the limit of assembly, the release, event e of the user."""
    if e == ASSEMBLY:
        return _clearance(problem, x, u, out) - LIMIT_SINE
    if e == RELEASE:
        return source.law[1] - x[source.law_places[1]]
    if watch.addresses[e] != 0:
        return call_user(watch.addresses[e], t, x)
    evaluate(problem.equations[OUTPUTS], t, x, problem.modes, u, problem.p, out)
    return out[int(watch.table[e, OUTPUT])] - watch.table[e, LEVEL]


@inner
def _crosses(before, after, direction):
    """Whether an event happens between two values; one that starts at zero does not."""
    return (before < 0.0 <= after and direction >= 0.0) or (before > 0.0 >= after and direction <= 0.0)


@inner
def _record(carry, watch, e, t, x):
    row = watch.found[carry.found]
    row[0] = e
    row[1] = t
    for i in range(x.shape[0]):
        row[2 + i] = x[i]
    carry.found += 1


@inner
def _inside(s, h, x, constant, piece, source, work, carry):
    """Write state and inputs at the fraction s of a step from x into ``work.dense`` and ``work.inside``."""
    interpolate(s, x, work.f, work.dense)
    if constant:
        _copy(work.held, work.inside)
    else:
        channels_at(carry.begin, carry.elapsed + s * h, piece, work.dense, source, work.inside)


@inner
def _locate(e, low, high, h, x, constant, piece, problem, source, watch, work, carry):
    """Fraction of the step at which e happens, by bisection of the interpolant between two fractions."""
    positive = False
    for n in range(55):
        s = low if n == 0 else 0.5 * (low + high)
        _inside(s, h, x, constant, piece, source, work, carry)
        # a NaN, beyond the limit of assembly, compares as not positive
        t = carry.begin + (carry.elapsed + s * h)
        sign = _gap(e, t, work.dense, work.inside, problem, source, watch, work.outputs) > 0.0
        if n == 0:
            positive = sign
        elif sign == positive:
            low = s
        else:
            high = s
    # the limit is approached, not passed: its own side must still be a configuration
    return low if e == ASSEMBLY else high


@inner
def _events_of_step(h, x, constant, piece, problem, source, watch, work, carry, cut):
    """Record the user's events inside a step, by fractions of it; returns what stops it first, and where.

    ``cut`` is what cuts the step short already, and where.
    """
    what, first = cut
    for e in range(watch.table.shape[0]):
        for quarter in range(EVENTS_PER_STEP):
            s0 = quarter / EVENTS_PER_STEP
            s1 = (quarter + 1) / EVENTS_PER_STEP
            t = carry.begin + (carry.elapsed + s1 * h)
            if s1 == 1.0:
                gap = _gap(e, t, work.y, work.held, problem, source, watch, work.outputs)
            else:
                _inside(s1, h, x, constant, piece, source, work, carry)
                gap = _gap(e, t, work.dense, work.inside, problem, source, watch, work.outputs)
            if _crosses(watch.gaps[e], gap, watch.table[e, DIRECTION]):
                s = _locate(e, s0, s1, h, x, constant, piece, problem, source, watch, work, carry)
                interpolate(s, x, work.f, work.dense)
                _record(carry, watch, e, s, work.dense)
                if watch.table[e, STOPS] != 0.0 and s < first:
                    what, first = e, s
            watch.gaps[e] = gap
    return what, first


# A run


@inner
def _end_of_interval(problem, source, samples, carry, piece):
    """Time up to which the inputs are smooth, or held."""
    if problem.hold > 0.0:
        return samples[carry.interval + 1] if carry.interval + 1 < samples.shape[0] else problem.end
    later = source.breaks[piece + 1]
    return later if piece + 1 < source.breaks.shape[0] - 1 and later < problem.end else problem.end


@inner
def _begin_interval(stop, piece, problem, source, watch, work, carry, x, samples, states, forces):
    """Sample the inputs, let commanded rates jump, record samples and what the jumps made happen; the status."""
    t, held = carry.begin, work.held
    law = source.law
    if law[2] != 0.0 and x[source.law_places[1]] >= law[1]:
        law[2] = 0.0
    channels_at(t, 0.0, piece, x, source, held)
    lost = _not_finite(held)
    if problem.hold > 0.0 and lost < 0:
        hold(t, stop if t < problem.end else t + problem.hold, x, source, problem.commands, held, work.ahead)
        for n in range(problem.commands.shape[0]):
            # a rate is then the secant of a command
            if not isfinite(held[problem.commands[n, 2]]):
                lost = problem.commands[n, 0]
    if lost >= 0:
        carry.lost = lost
        return BAD_INPUT
    # at the start the state has the commanded rates; after that a jump of them is an impulse
    jumps = False
    for n in range(problem.commands.shape[0]):
        jumps |= x[problem.commands[n, 1]] != held[problem.commands[n, 0]]
    if carry.started and jumps:
        evaluate(problem.equations[JUMP], t, x, problem.modes, held, problem.p, work.z)
        _copy(work.z, x)
    # samples at the beginning of the interval, with the inputs that begin here
    while carry.sample < samples.shape[0] and samples[carry.sample] <= t:
        _copy(x, states[carry.sample])
        _copy(held, forces[carry.sample])
        carry.sample += 1
    status = RUNNING
    for e in range(watch.table.shape[0]):
        before = watch.gaps[e]
        if carry.started and before == 0.0:
            # a zero marks an event that was just reported: wait until the value leaves zero
            continue
        watch.gaps[e] = _gap(e, t, x, held, problem, source, watch, work.outputs)
        if carry.started and _crosses(before, watch.gaps[e], watch.table[e, DIRECTION]):
            _record(carry, watch, e, t, x)
            if watch.table[e, STOPS] != 0.0:
                status = EVENT
    carry.started = 1
    return FINISHED if status == RUNNING and t >= problem.end else status


@inner
def _not_finite(u):
    """Number of a channel, or of another component, that is not finite; -1 if there is none."""
    for i in range(u.shape[0]):
        if not isfinite(u[i]):
            return i
    return -1


@inner
def _refused(h, piece, constant, problem, source, work, carry, x):
    """Status of a run whose step has become impossibly short."""
    status = LIMIT if abs(_clearance(problem, x, work.held, work.outputs)) < NEAR_LIMIT else NO_STEP
    if not constant:
        # an input may be what stops it
        for i in range(x.shape[0]):
            work.z[i] = x[i] + h * work.k[0, i]
        channels_at(carry.begin, carry.elapsed + h, piece, work.z, source, work.inside)
        lost = _not_finite(work.inside)
        if lost >= 0:
            carry.lost = lost
            status = BAD_INPUT
        channels_at(carry.begin, carry.elapsed, piece, x, source, work.held)
    return status


@inner
def _keep_balance(y, held, problem, watch, work):
    """Scale the rates of a state so that the energy balance is closed, but where it is nearly at rest."""
    evaluate(problem.equations[OUTPUTS], 0.0, y, problem.modes, held, problem.p, work.outputs)
    share = work.outputs[watch.balance[0]] / work.outputs[watch.balance[1]]
    if abs(share) < GREATEST_SHARE:
        freedoms = y.shape[0] // 2 - 1
        for i in range(freedoms, 2 * freedoms):
            y[i] *= np.sqrt(1.0 - share)


@inner
def _released(y, problem, source):
    """Whether the torsion bar is released in a step that ends at y."""
    law = source.law
    return law[2] != 0.0 and problem.hold == 0.0 and y[source.law_places[1]] >= law[1]


@inner
def _cut_of_step(clearance, h, x, constant, piece, problem, source, watch, work, carry):
    """What cuts a good step short, and at which fraction of it; makes the interpolant and records the events."""
    _copy(work.held, work.inside)
    for s in range(13, 16):
        stage(s, x, work.k, h, work.z)
        if not constant:
            channels_at(carry.begin, carry.elapsed + NODES[s] * h, piece, work.z, source, work.inside)
        t = carry.begin + (carry.elapsed + NODES[s] * h)
        evaluate(problem.equations[DERIVATIVE], t, work.z, problem.modes, work.inside, problem.p, work.k[s])
    carry.evaluations += 3
    interpolant(x, work.y, work.k, h, work.f)
    what, cut = NOTHING, 2.0
    if clearance < LIMIT_SINE:
        what = ASSEMBLY
        cut = _locate(ASSEMBLY, 0.0, 1.0, h, x, constant, piece, problem, source, watch, work, carry)
    if _released(work.y, problem, source):
        s = _locate(RELEASE, 0.0, 1.0, h, x, constant, piece, problem, source, watch, work, carry)
        if s < cut:
            what, cut = RELEASE, s
    return _events_of_step(h, x, constant, piece, problem, source, watch, work, carry, (what, cut))


@inner
def _settle_events(before, cut, elapsed, h, watch, carry):
    """Make times of the fractions of a step; events after the cut did not happen."""
    kept = before
    for n in range(before, carry.found):
        s = watch.found[n, 1]
        if s <= cut + SAME:
            _copy(watch.found[n], watch.found[kept])
            watch.found[kept, 1] = carry.begin + (elapsed + s * h)
            kept += 1
    carry.found = kept


@inner
def _end_at(what, cut, t_new, h, x, constant, piece, problem, source, watch, work, carry, before):
    """End a step at the fraction where something cuts it short; the status."""
    interpolate(cut, x, work.f, work.dense)
    _copy(work.dense, x)
    if what == RELEASE:
        x[source.law_places[1]] = source.law[1]
    if not constant:
        channels_at(carry.begin, carry.elapsed + cut * h, piece, x, source, work.held)
    for e in range(watch.table.shape[0]):
        watch.gaps[e] = _gap(e, t_new, x, work.held, problem, source, watch, work.outputs)
    status = RUNNING if what == RELEASE else LIMIT if what == ASSEMBLY else EVENT
    for n in range(before, carry.found):
        # at the cut itself, but for rounding: it has happened
        e = int(watch.found[n, 0])
        if watch.found[n, 1] >= carry.begin + (carry.elapsed + (cut - SAME) * h):
            watch.gaps[e] = 0.0
            if watch.table[e, STOPS] != 0.0 and what == RELEASE:
                status = EVENT
    if what == RELEASE:
        source.law[2] = 0.0
    carry.begin = t_new
    carry.elapsed = 0.0
    return status


@inner
def _sample_step(t_new, h, x, constant, piece, source, work, carry, samples, states, forces):
    """Record the samples inside a step; one at its end waits for the next, or for the next interval's inputs."""
    while carry.sample < samples.shape[0] and samples[carry.sample] < t_new:
        n = carry.sample
        interpolate(((samples[n] - carry.begin) - carry.elapsed) / h, x, work.f, states[n])
        if constant:
            _copy(work.held, forces[n])
        else:
            channels_at(carry.begin, samples[n] - carry.begin, piece, states[n], source, forces[n])
        carry.sample += 1


@inner
def _cross_interval(stop, piece, problem, source, watch, work, carry, x, samples, states, forces, most):
    """Steps, until the interval is over or cut short, or ``most`` steps or a full table of events make a pause; the status.

    Where it pauses it leaves ``carry.midway`` set.
    """
    law = source.law
    derivative = problem.equations[DERIVATIVE]
    constant = problem.hold > 0.0 or (problem.steady and (law[2] == 0.0 or x[source.law_places[1]] >= law[1]))
    room = EVENTS_PER_STEP * watch.table.shape[0]
    carry.midway = 0
    k, y, held = work.k, work.y, work.held
    evaluate(derivative, carry.begin + carry.elapsed, x, problem.modes, held, problem.p, k[0])
    carry.evaluations += 1
    if not carry.step > 0.0:
        ratio = 1e-300
        for i in range(x.shape[0]):
            ratio = max(ratio, abs(k[0, i]) / (problem.scale[i] + abs(x[i])))
        carry.step = min(stop - carry.begin, problem.tolerance**-EXPONENT / ratio)
    while True:
        if carry.steps >= most or carry.found + room > watch.found.shape[0]:
            carry.midway = 1
            if not constant:
                # after a step that was refused they are those of one of its stages
                channels_at(carry.begin, carry.elapsed, piece, x, source, held)
            return RUNNING
        remaining = (stop - carry.begin) - carry.elapsed
        last = carry.step >= remaining * (1.0 - 1e-10)
        h = remaining if last else min(carry.step, 0.5 * remaining)
        carry.steps += 1
        carry.evaluations += STAGES - 1
        error = attempt(
            derivative, problem.modes, problem.p, problem.scale, carry.begin, carry.elapsed, h, x, k, y, constant, piece,
            source, held,
        )  # fmt: skip
        error /= problem.tolerance
        good = error <= 1.0
        t_new = stop if last else carry.begin + (carry.elapsed + h)
        # inside: whether something is to be found or recorded in the step
        clearance, inside = 0.0, False
        if good:
            if not constant:
                channels_at(carry.begin, carry.elapsed + h, piece, y, source, held)
            if watch.balance.shape[0] > 0:
                _keep_balance(y, held, problem, watch, work)
            clearance = _clearance(problem, y, held, work.outputs)
            inside = (
                clearance < LIMIT_SINE
                or _released(y, problem, source)
                or (carry.sample < samples.shape[0] and samples[carry.sample] < t_new)
                or watch.table.shape[0] > 0
            )
            # a NaN, beyond the limit of assembly
            good = not isnan(clearance)
            # the interpolant and the next step begin with the right-hand side at the end; after the last nobody asks for it
            if inside or not last:
                evaluate(derivative, t_new, y, problem.modes, held, problem.p, k[12])
                carry.evaluations += 1
                good &= _not_finite(k[12]) < 0
        if not good:
            carry.rejected += 1
            carry.step = shorter(h, error)
            if not carry.step >= LEAST_STEP * (problem.end - samples[0]):
                return _refused(h, piece, constant, problem, source, work, carry, x)
            continue
        carry.step = following(h, carry.step, error)
        before = carry.found
        what, cut = NOTHING, 2.0
        if inside:
            what, cut = _cut_of_step(clearance, h, x, constant, piece, problem, source, watch, work, carry)
        _settle_events(before, cut, carry.elapsed, h, watch, carry)
        if what != NOTHING:
            t_new = carry.begin + (carry.elapsed + cut * h)
        _sample_step(t_new, h, x, constant, piece, source, work, carry, samples, states, forces)
        if what != NOTHING:
            return _end_at(what, cut, t_new, h, x, constant, piece, problem, source, watch, work, carry, before)
        _copy(y, x)
        _copy(k[12], k[0])
        if last:
            carry.begin = stop
            carry.elapsed = 0.0
            carry.interval += 1
            return RUNNING
        carry.elapsed += h


@part
def _work(states, outputs, inputs):
    """Room for so many states, outputs and inputs."""
    return Work(
        np.zeros((16, states)),
        np.empty(states),
        np.empty(states),
        np.empty(states),
        np.empty((7, states)),
        np.zeros(inputs),
        np.zeros(inputs),
        np.zeros(inputs),
        np.empty(outputs),
    )


@part
def _run(problem, source, watch, work, carry, x, samples, states, forces, most):
    events = watch.table.shape[0]
    while True:
        piece = find(carry.begin, source.breaks)
        stop = _end_of_interval(problem, source, samples, carry, piece)
        if carry.midway == 0:
            if carry.found + (1 + EVENTS_PER_STEP) * events > watch.found.shape[0]:
                return RUNNING
            status = _begin_interval(stop, piece, problem, source, watch, work, carry, x, samples, states, forces)
            if status != RUNNING:
                return status
        status = _cross_interval(stop, piece, problem, source, watch, work, carry, x, samples, states, forces, most)
        if status != RUNNING or carry.midway != 0:
            return status


_RUN = (_PROBLEM, SOURCE, _WATCH, VECTOR, _CARRIES, VECTOR, VECTOR, MATRIX, MATRIX, int64, int64)


@kernel(int64(*_RUN), purpose="the solver")
def run(problem, source, watch, held, carries, x, samples, states, forces, outputs, most):
    """Integrate one run until its end, a stopping event, ``most`` steps in all, or a full table of events.

    Called again with what it left behind it goes on, with the same result as in one call.

    Parameters
    ----------
    problem : Problem
    source : Source
        The inputs; its ``law`` is overwritten when the torsion bar is released.
    watch : Watch
        Values and table of the events; overwritten.
    held : ndarray, shape (inputs,)
        Inputs in force; overwritten.
    carries : ndarray of CARRY, shape (1,)
        Overwritten. All zero but the time in ``begin`` at the start; the caller sets ``found`` to zero when it has taken
        the events.
    x : ndarray, shape (n,)
        State; overwritten.
    samples : ndarray, shape (m,)
        Times to record (s), increasing, the first one the start.
    states, forces : ndarray, shapes (m, n) and (m, inputs)
        State and inputs at the samples; written.
    outputs : int
        Number of outputs.
    most : int

    Returns
    -------
    int
        RUNNING, FINISHED, BAD_INPUT, LIMIT, NO_STEP or EVENT.
    """
    work = _work(x.shape[0], outputs, held.shape[0])
    _copy(held, work.held)
    status = _run(problem, source, watch, work, carries[0], x, samples, states, forces, most)
    _copy(work.held, held)
    return status


class Batch(NamedTuple):
    """What differs between many runs: constants with the energy at the start, scales, whether the inputs are steady, pieces
    and harmonics of each, and the inputs themselves, one row each."""

    p: NDArray[np.float64]
    scales: NDArray[np.float64]
    steady: NDArray[np.bool_]
    sizes: NDArray[np.int64]
    breaks: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    harmonics: NDArray[np.float64]
    laws: NDArray[np.float64]
    law_places: NDArray[np.int64]


_BATCH = types.NamedTuple(
    (MATRIX, MATRIX, boolean[::1], int64[:, ::1], MATRIX, float64[:, :, :, ::1], CUBE, MATRIX, PLACES), Batch
)


@part
def _own(i, source, batch):
    """The inputs of one run of a batch; ``source`` has what is common to all."""
    pieces, waves = batch.sizes[i]
    return Source(
        batch.breaks[i, : pieces + 1],
        batch.coefficients[i, :pieces],
        batch.harmonics[i, :waves],
        source.places,
        batch.laws[i],
        batch.law_places[i],
        source.functions,
    )


@kernel(types.void(float64, SOURCE, _BATCH, MATRIX, MATRIX), purpose="the inputs of ensembles")
def channels_of_many(t, source, batch, starts, u):
    """Write the channels of each run of a batch at time t and at its state into the rows of u."""
    for i in range(starts.shape[0]):
        own = _own(i, source, batch)
        channels_at(t, 0.0, find(t, own.breaks), starts[i], own, u[i])


@kernel(
    types.void(_PROBLEM, SOURCE, _BATCH, _CARRIES, MATRIX, MATRIX, VECTOR, CUBE, CUBE, int64[::1], int64, int64, int64),
    purpose="the solver of ensembles",
)
def run_many(problem, source, batch, carries, starts, held, samples, states, forces, status, outputs, most, budget):
    """Many runs one after the other: `run` for each row whose status is RUNNING, without events; ``problem`` and ``source``
    hold for all unless ``batch`` has its own.

    After ``budget`` steps over all of them it returns; called again with what it left behind it goes on.
    """
    none = np.empty(0, dtype=np.int64)
    watch = Watch(np.empty((0, 4)), none, np.empty(0), np.empty((0, 2 + starts.shape[1])), none)
    work = _work(starts.shape[1], outputs, forces.shape[2])
    for i in range(starts.shape[0]):
        before = carries[i].steps
        if status[i] != RUNNING or before >= most:
            continue
        if budget <= 0:
            return
        own = _own(i, source, batch)
        alike = Problem(
            problem.equations,
            problem.modes,
            batch.p[i],
            batch.scales[i],
            problem.commands,
            problem.tolerance,
            problem.hold,
            problem.end,
            batch.steady[i],
        )
        _copy(held[i], work.held)
        until = min(most, before + budget)
        status[i] = _run(alike, own, watch, work, carries[i], starts[i], samples, states[i], forces[i], until)
        _copy(work.held, held[i])
        budget -= carries[i].steps - before


@kernel(types.void(int64, VECTOR, VECTOR, MATRIX, MATRIX, MATRIX), purpose="the outputs")
def rows(equation, modes, p, states, forces, out):
    """A function of the equations for rows of states and inputs, shapes (n, states), (n, inputs); out has its values."""
    for i in range(states.shape[0]):
        evaluate(equation, 0.0, states[i], modes, forces[i], p, out[i])
