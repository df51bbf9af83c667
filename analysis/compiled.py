"""The plant's own functions under Numba: right-hand side, integrator, event location, outputs.

`linkwork` does not know Numba: its functions are registered from outside and compiled as they stand. Everything here has
an explicit signature, so that compiled code is kept on disk and a second process does not wait. Numba does not notice when
a called function changes; the folder of the cache therefore carries a hash of the plant's sources and of this file.

The integrator is DOP853 (`linkwork.tableau`) with its interpolant of order 7, the same method as the FMU's, written
again for arrays; inputs are evaluated inside the loop.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from math import cos, isnan, sin
from pathlib import Path

import numba
import numpy as np
from numba import boolean, float64, int64, njit, types
from numba.extending import register_jitable
from numba.np.unsafe.ndarray import to_fixed_tuple
from platformdirs import user_cache_dir

import linkwork
from linkwork import tableau
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.dynamics import Inputs
from linkwork.five_bar.kinematics import LIMIT_SINE
from linkwork.five_bar.parameters import Constants

# Status of a run, as the kernels return it
RUNNING = -1
FINISHED = 0
LIMIT = 3
NO_STEP = 4
EVENT = 10

# Places in the array that carries a run from one call to the next
TIME, STEP, SAMPLE, INTERVAL, EVENTS, STEPS, REJECTED, EVALUATIONS, FRESH = range(9)
CARRY = 9


def cache_folder() -> Path:
    """Folder of the compiled code: below LINKWORK_CACHE_DIR, else the user's cache, else a temporary folder."""
    digest = hashlib.sha256()
    root = Path(linkwork.__file__).parent
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    digest.update(Path(__file__).read_bytes())
    base = Path(os.environ.get("LINKWORK_CACHE_DIR") or user_cache_dir("linkwork", appauthor=False))
    folder = base / f"numba-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError:
        folder = Path(tempfile.gettempdir()) / f"linkwork-numba-{digest.hexdigest()[:16]}"
        folder.mkdir(parents=True, exist_ok=True)
    return folder


_FUNCTION = types.FunctionType(float64(float64, float64, float64, float64, float64))
_EVENT_FUNCTION = types.FunctionType(float64(int64, float64, float64, float64, float64, float64))
_CONSTANTS = types.NamedUniTuple(float64, len(Constants._fields), Constants)
_VECTOR = float64[::1]
_MATRIX = float64[:, ::1]
_CUBE = float64[:, :, ::1]
_FUNCTIONS = (_FUNCTION,) * 6

for _function in (
    kinematics.position,
    kinematics.coefficients,
    kinematics.centripetal,
    kinematics.coupler_angle,
    kinematics.rocker_angle,
    kinematics.transmission_angle,
    kinematics.coupler_point,
    kinematics.coupler_point_velocity,
    kinematics.closure_residual,
    kinematics.assembly_square,
    dynamics.inertia,
    dynamics.velocity_terms,
    dynamics.friction,
    dynamics.applied_forces,
    dynamics.motion,
    dynamics.derivative,
    dynamics.reactions,
    dynamics.kinetic_energy,
    dynamics.potential_energy,
    dynamics.mechanical_energy,
    dynamics.jump_speed,
    dynamics.outputs,
):
    register_jitable(_function)

_A = np.zeros((16, 16))
for _i, _row in enumerate(tableau.A):
    for _j, _weight in _row:
        _A[_i, _j] = _weight
_C = np.array(tableau.C)
_E3 = np.array(tableau.E3)
_E5 = np.array(tableau.E5)
_D = np.array(tableau.D)
_STAGES = tableau.STAGES
_EXPONENT = -1.0 / tableau.ORDER
_N = 6
_N_CONSTANTS = len(Constants._fields)

_saved_folder = numba.config.CACHE_DIR
numba.config.CACHE_DIR = str(cache_folder())


def _compile(*signature):  # type: ignore[no-untyped-def]
    return njit(*signature, cache=True, error_model="numpy", nogil=True)


@_compile(float64(float64, float64, float64, float64, float64))
def no_function(t, th2, u, w2, v):  # type: ignore[no-untyped-def]
    return 0.0


@_compile(float64(int64, float64, float64, float64, float64, float64))
def no_event(i, t, th2, u, w2, v):  # type: ignore[no-untyped-def]
    return 0.0


@njit(inline="always")
def _find(t, breaks):  # type: ignore[no-untyped-def]
    """Piece of the polynomials in force from t on; the outer ones go on beyond the ends."""
    n = breaks.shape[0] - 1
    i = np.searchsorted(breaks, t, side="right") - 1
    return min(max(i, 0), n - 1)


@njit
def _channels(t, piece, th2, u, w2, v, breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6):  # type: ignore[no-untyped-def]
    """Torque, speed, acceleration, slider force and load at time t on a given piece."""
    s = t - breaks[piece]
    c = coefficients[piece]
    torque = c[0, 0] + s * (c[0, 1] + s * (c[0, 2] + s * c[0, 3]))
    speed = c[1, 0] + s * (c[1, 1] + s * (c[1, 2] + s * c[1, 3]))
    acceleration = c[1, 1] + s * (2.0 * c[1, 2] + s * 3.0 * c[1, 3])
    force = c[2, 0] + s * (c[2, 1] + s * (c[2, 2] + s * c[2, 3]))
    load_x = c[3, 0] + s * (c[3, 1] + s * (c[3, 2] + s * c[3, 3]))
    load_y = c[4, 0] + s * (c[4, 1] + s * (c[4, 2] + s * c[4, 3]))
    for k in range(harmonics.shape[0]):
        channel = int(harmonics[k, 0])
        phase = harmonics[k, 2] * t + harmonics[k, 3]
        value = harmonics[k, 1] * cos(phase)
        if channel == 0:
            torque += value
        elif channel == 1:
            speed += value
            acceleration -= harmonics[k, 1] * harmonics[k, 2] * sin(phase)
        elif channel == 2:
            force += value
        elif channel == 3:
            load_x += value
        else:
            load_y += value
    if law[2] != 0.0:
        torque += law[0] * (1.0 - th2 / law[1])
    if law[3] != 0.0:
        # Kloss: 2 Tb / (s / sb + sb / s), written so that it holds at synchronous speed
        slip = 1.0 - w2 / law[5]
        torque += 2.0 * law[3] * slip * law[4] / (slip * slip + law[4] * law[4])
    if used[0]:
        torque += f1(t, th2, u, w2, v)
    if used[1]:
        force += f2(t, th2, u, w2, v)
    if used[2]:
        load_x += f3(t, th2, u, w2, v)
    if used[3]:
        load_y += f4(t, th2, u, w2, v)
    if used[4]:
        speed += f5(t, th2, u, w2, v)
        acceleration += f6(t, th2, u, w2, v)
    return torque, speed, acceleration, force, load_x, load_y


@_compile(
    types.UniTuple(float64, 6)(float64, boolean, _VECTOR, _VECTOR, _CUBE, _MATRIX, _VECTOR, boolean[::1], *_FUNCTIONS)
)
def channels(t, left, x, breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6):  # type: ignore[no-untyped-def]
    """Torque, speed, acceleration, slider force and load at time t, as the limit from the left or from the right."""
    piece = _find(t, breaks)
    if left and t == breaks[piece] and piece > 0:
        piece -= 1
    return _channels(
        t, piece, x[0], x[1], x[2], x[3], breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6
    )


@njit(inline="always")
def _tuple(x):  # type: ignore[no-untyped-def]
    return (x[0], x[1], x[2], x[3], x[4], x[5])


@njit
def _interpolant(x, y, k, h, f):  # type: ignore[no-untyped-def]
    """Coefficients of the interpolant between x and y (Hairer's contd8); k holds all sixteen stages."""
    for i in range(_N):
        delta = y[i] - x[i]
        f[0, i] = delta
        f[1, i] = h * k[0, i] - delta
        f[2, i] = 2.0 * delta - h * (k[12, i] + k[0, i])
        for r in range(4):
            total = 0.0
            for j in range(16):
                total += _D[r, j] * k[j, i]
            f[3 + r, i] = h * total


@njit
def _interpolate(s, x, f, out):  # type: ignore[no-untyped-def]
    """State at the fraction s of the step."""
    for i in range(_N):
        y = 0.0
        for r in range(7):
            y += f[6 - r, i]
            y *= s if r % 2 == 0 else 1.0 - s
        out[i] = x[i] + y


@njit
def _event_value(e, t, x, held, levels, f_event, start_energy, p):  # type: ignore[no-untyped-def]
    """Event e at a state: an output less its level, or a function; zero where the event happens."""
    which = int(levels[e, 0])
    if which >= 0:
        return dynamics.outputs(_tuple(x), held, start_energy, p)[which] - levels[e, 1]
    return f_event(-1 - which, t, x[0], x[1], x[2], x[3])


@njit
def _gap(e, t, x, held, levels, f_event, release, start_energy, p):  # type: ignore[no-untyped-def]
    if e == -1:
        return p.branch * kinematics.position(x[0], x[1], p).s43 - LIMIT_SINE
    if e == -2:
        return release - x[0]
    return _event_value(e, t, x, held, levels, f_event, start_energy, p)


@njit
def _locate(e, low, high, t, h, x, f, dense, held, levels, f_event, release, start_energy, p):  # type: ignore[no-untyped-def]
    """Fraction of the step at which event e happens, by bisection of the interpolant between two fractions."""
    _interpolate(low, x, f, dense)
    sign = _gap(e, t + low * h, dense, held, levels, f_event, release, start_energy, p) > 0.0
    for _ in range(54):
        middle = 0.5 * (low + high)
        _interpolate(middle, x, f, dense)
        # a NaN, beyond the limit of assembly, compares as not positive
        if (_gap(e, t + middle * h, dense, held, levels, f_event, release, start_energy, p) > 0.0) == sign:
            low = middle
        else:
            high = middle
    # the limit is approached, not passed: its own side must still be a configuration
    return low if e == -1 else high


@njit
def _run(
    p,
    x,
    carry,
    end,
    speed_drive,
    hold,
    steady,
    breaks,
    coefficients,
    harmonics,
    law,
    used,
    f1,
    f2,
    f3,
    f4,
    f5,
    f6,
    tolerance,
    scale,
    samples,
    states,
    forces,
    levels,
    f_event,
    found,
    start_energy,
    max_steps,
):  # type: ignore[no-untyped-def]
    """Integrate until ``end``, a stopping event, or ``max_steps``; see `run` for the arguments."""
    drive = 1.0 if speed_drive else 0.0
    k = np.zeros((16, _N))
    y = np.empty(_N)
    z = np.empty(_N)
    f = np.empty((7, _N))
    dense = np.empty(_N)
    n_events = levels.shape[0]
    before = np.empty(n_events)
    after = np.empty(n_events)
    held = Inputs(drive, 0.0, 0.0, 0.0, 0.0, 0.0)
    t = carry[TIME]
    h_next = carry[STEP]
    sample = int(carry[SAMPLE])
    interval = int(carry[INTERVAL])
    n_found = int(carry[EVENTS])
    first_time = carry[FRESH] == 0.0
    origin = samples[0]
    steps = 0
    status = RUNNING
    constant = steady or hold > 0.0
    paused = False
    while status == RUNNING:
        # an interval on which the inputs are smooth begins: find its end, and the inputs if they stay as they are
        piece = _find(t, breaks)
        if hold > 0.0:
            stop = origin + (interval + 1) * hold
            # the end of the run falls on the grid, but for rounding
            if stop > end - 1e-9 * hold:
                stop = end
            torque, speed, acceleration, force, load_x, load_y = _channels(
                t, piece, x[0], x[1], x[2], x[3], breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6
            )
            ahead = stop if t < end else t + hold
            if speed_drive:
                piece_ahead = _find(ahead, breaks)
                if ahead == breaks[piece_ahead] and piece_ahead > 0:
                    piece_ahead -= 1
                # the secant: the speed meets the command again at the next point of the grid
                there = _channels(
                    ahead, piece_ahead, x[0], x[1], x[2], x[3], breaks, coefficients, harmonics, law, used,
                    f1, f2, f3, f4, f5, f6,
                )[1]  # fmt: skip
                acceleration = (there - speed) / (ahead - t)
            if law[2] != 0.0 and x[0] >= law[1]:
                torque -= law[0] * (1.0 - x[0] / law[1])
                law[2] = 0.0
        else:
            stop = end
            if piece + 1 < breaks.shape[0] - 1 and breaks[piece + 1] < end:
                stop = breaks[piece + 1]
            if law[2] != 0.0 and x[0] >= law[1]:
                law[2] = 0.0
            torque, speed, acceleration, force, load_x, load_y = _channels(
                t, piece, x[0], x[1], x[2], x[3], breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6
            )
        held = Inputs(drive, torque, acceleration, force, load_x, load_y)
        if speed_drive and x[2] != speed:
            if first_time:
                x[2] = speed
            else:
                jumped = dynamics.jump_speed(_tuple(x), speed, p)
                for i in range(_N):
                    x[i] = jumped[i]
        first_time = False
        # samples at the beginning of the interval, with the inputs that begin here
        while sample < samples.shape[0] and samples[sample] <= t:
            for i in range(_N):
                states[sample, i] = x[i]
            for i in range(6):
                forces[sample, i] = held[i]
            sample += 1
        if t >= end:
            status = FINISHED
            break
        d = dynamics.derivative(_tuple(x), held, p)
        carry[EVALUATIONS] += 1
        for i in range(_N):
            k[0, i] = d[i]
        for e in range(n_events):
            before[e] = _event_value(e, t, x, held, levels, f_event, start_energy, p)
        if not h_next > 0.0:
            ratio = 1e-300
            for i in range(_N):
                ratio = max(ratio, abs(k[0, i]) / (scale[i] + abs(x[i])))
            h_next = min(stop - t, tolerance ** (-_EXPONENT) / ratio)
        begin = t
        switched = False
        while not switched:
            remaining = stop - t
            last = h_next >= remaining * (1.0 - 1e-10)
            if last:
                h = remaining
            elif h_next > 0.5 * remaining:
                h = 0.5 * remaining
            else:
                h = h_next
            # between two calls the inputs of a held interval would be sampled anew: it is always finished
            if steps >= max_steps and (hold == 0.0 or t == begin):
                paused = True
                break
            steps += 1
            # the twelve stages
            for s in range(1, _STAGES + 1):
                for i in range(_N):
                    total = 0.0
                    for j in range(s):
                        total += _A[s, j] * k[j, i]
                    y[i] = x[i] + h * total
                if s < _STAGES:
                    if not constant:
                        ts = t + _C[s] * h
                        a = _channels(
                            ts, piece, y[0], y[1], y[2], y[3], breaks, coefficients, harmonics, law, used,
                            f1, f2, f3, f4, f5, f6,
                        )  # fmt: skip
                        held = Inputs(drive, a[0], a[2], a[3], a[4], a[5])
                    d = dynamics.derivative(_tuple(y), held, p)
                    for i in range(_N):
                        k[s, i] = d[i]
            carry[EVALUATIONS] += _STAGES - 1
            sum3 = 0.0
            sum5 = 0.0
            for i in range(_N):
                e3 = 0.0
                e5 = 0.0
                for j in range(_STAGES):
                    e3 += _E3[j] * k[j, i]
                    e5 += _E5[j] * k[j, i]
                weight = scale[i] + max(abs(x[i]), abs(y[i]))
                sum3 += (e3 / weight) ** 2
                sum5 += (e5 / weight) ** 2
            bottom = sum5 + 0.01 * sum3
            error = 0.0 if bottom == 0.0 else h * sum5 / np.sqrt(bottom * _N) / tolerance
            good = error <= 1.0
            if good:
                t_new = stop if last else t + h
                if not constant:
                    a = _channels(
                        t_new, piece, y[0], y[1], y[2], y[3], breaks, coefficients, harmonics, law, used,
                        f1, f2, f3, f4, f5, f6,
                    )  # fmt: skip
                    held = Inputs(drive, a[0], a[2], a[3], a[4], a[5])
                d = dynamics.derivative(_tuple(y), held, p)
                carry[EVALUATIONS] += 1
                for i in range(_N):
                    k[12, i] = d[i]
                    if isnan(d[i]):
                        good = False
            if not good:
                carry[REJECTED] += 1
                h_next = h * (max(0.2, 0.9 * error**_EXPONENT) if error < 1e30 else 0.25)
                if h_next < 1e-14 * max(abs(t), end - origin):
                    g = kinematics.position(x[0], x[1], p)
                    status = LIMIT if abs(g.s43) < 0.05 else NO_STEP
                    break
                continue
            # accepted; what happens inside the step needs the interpolant
            factor = 6.0 if error == 0.0 else min(6.0, 0.9 * error**_EXPONENT)
            h_next = max(h_next, factor * h) if h < h_next else max(0.2, factor) * h
            bar = law[2] != 0.0 and hold == 0.0
            limit = p.branch * kinematics.position(y[0], y[1], p).s43 < LIMIT_SINE
            wanted = sample < samples.shape[0] and (samples[sample] < t_new)
            inside = wanted or n_events > 0 or limit or (bar and y[0] >= law[1])
            if inside:
                for s in range(13, 16):
                    for i in range(_N):
                        total = 0.0
                        for j in range(s):
                            total += _A[s, j] * k[j, i]
                        z[i] = x[i] + h * total
                    if not constant:
                        a = _channels(
                            t + _C[s] * h, piece, z[0], z[1], z[2], z[3], breaks, coefficients, harmonics, law, used,
                            f1, f2, f3, f4, f5, f6,
                        )  # fmt: skip
                        held = Inputs(drive, a[0], a[2], a[3], a[4], a[5])
                    d = dynamics.derivative(_tuple(z), held, p)
                    for i in range(_N):
                        k[s, i] = d[i]
                carry[EVALUATIONS] += 3
                _interpolant(x, y, k, h, f)
            # the earliest of: limit of assembly (-1), release of the torsion bar (-2), a stopping event (its number)
            cut = 2.0
            what = -9
            if limit:
                cut = _locate(-1, 0.0, 1.0, t, h, x, f, dense, held, levels, f_event, law[1], start_energy, p)
                what = -1
            if bar and y[0] >= law[1]:
                s_bar = _locate(-2, 0.0, 1.0, t, h, x, f, dense, held, levels, f_event, law[1], start_energy, p)
                if s_bar < cut:
                    cut = s_bar
                    what = -2
            for e in range(n_events):
                g0 = before[e]
                s0 = 0.0
                first = 2.0
                for quarter in range(1, 5):
                    s1 = 0.25 * quarter
                    _interpolate(s1, x, f, dense)
                    if not constant:
                        a = _channels(
                            t + s1 * h, piece, dense[0], dense[1], dense[2], dense[3],
                            breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6,
                        )  # fmt: skip
                        held = Inputs(drive, a[0], a[2], a[3], a[4], a[5])
                    g1 = _event_value(e, t + s1 * h, dense, held, levels, f_event, start_energy, p)
                    up = g0 < 0.0 and g1 >= 0.0
                    down = g0 > 0.0 and g1 <= 0.0
                    if (up and levels[e, 2] >= 0.0) or (down and levels[e, 2] <= 0.0):
                        # the inputs of the quarter's end serve to locate: outputs that depend on them vary slowly in it
                        s_e = _locate(e, s0, s1, t, h, x, f, dense, held, levels, f_event, law[1], start_energy, p)
                        # an event at the cut itself, but for rounding, still happens
                        if s_e <= cut + 1e-9:
                            if n_found < found.shape[0]:
                                _interpolate(s_e, x, f, dense)
                                found[n_found, 0] = e
                                found[n_found, 1] = t + s_e * h
                                for i in range(_N):
                                    found[n_found, 2 + i] = dense[i]
                                n_found += 1
                            if levels[e, 3] != 0.0 and first > 1.0:
                                first = s_e
                    g0 = g1
                    s0 = s1
                after[e] = g0
                if first < cut:
                    cut = first
                    what = e
            if cut <= 1.0:
                # events after the cut did not happen
                kept = 0
                for e in range(n_found):
                    if found[e, 1] <= t + (cut + 1e-9) * h:
                        for i in range(2 + _N):
                            found[kept, i] = found[e, i]
                        kept += 1
                n_found = kept
                t_new = t + cut * h
            # samples inside the step; one at its end waits for the next, or for the next interval's inputs
            while sample < samples.shape[0] and (samples[sample] < t_new):
                s_sample = (samples[sample] - t) / h
                _interpolate(s_sample, x, f, dense)
                if not constant:
                    a = _channels(
                        samples[sample], piece, dense[0], dense[1], dense[2], dense[3],
                        breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6,
                    )  # fmt: skip
                    held = Inputs(drive, a[0], a[2], a[3], a[4], a[5])
                for i in range(_N):
                    states[sample, i] = dense[i]
                for i in range(6):
                    forces[sample, i] = held[i]
                sample += 1
            if cut <= 1.0:
                _interpolate(cut, x, f, dense)
                for i in range(_N):
                    x[i] = dense[i]
                if what == -2:
                    x[0] = law[1]
                    law[2] = 0.0
                elif what == -1:
                    status = LIMIT
                else:
                    status = EVENT
                t = t_new
                switched = True
                break
            for i in range(_N):
                x[i] = y[i]
                k[0, i] = k[12, i]
            for e in range(n_events):
                before[e] = after[e]
            t = t_new
            if last:
                interval += 1
                switched = True
        if paused:
            break
    carry[TIME] = t
    carry[STEP] = h_next
    carry[SAMPLE] = sample
    carry[INTERVAL] = interval
    carry[EVENTS] = n_found
    carry[STEPS] += steps
    carry[FRESH] = 1.0
    return status


_RUN_ARGUMENTS = (
    boolean,  # speed_drive
    float64,  # hold
    boolean,  # steady
    _VECTOR,  # breaks
    _CUBE,  # coefficients
    _MATRIX,  # harmonics
    _VECTOR,  # law
    boolean[::1],  # used
    *_FUNCTIONS,
    float64,  # tolerance
    _VECTOR,  # scale
    _VECTOR,  # samples
    _MATRIX,  # states
    _MATRIX,  # forces
    _MATRIX,  # levels
    _EVENT_FUNCTION,
    _MATRIX,  # found
    float64,  # start_energy
    int64,  # max_steps
)


@_compile(int64(_CONSTANTS, _VECTOR, _VECTOR, float64, *_RUN_ARGUMENTS))
def run(
    p, x, carry, end, speed_drive, hold, steady, breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6,
    tolerance, scale, samples, states, forces, levels, f_event, found, start_energy, max_steps,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Integrate one run until ``end``, a stopping event, or ``max_steps`` steps; can be called again to go on.

    Parameters
    ----------
    p : Constants
    x : ndarray, shape (6,)
        State; overwritten.
    carry : ndarray, shape (CARRY,)
        Time, next step, next sample, number of the held interval, events found, counts; overwritten. All zero but the time
        at the start.
    end : float
        Time at the end (s).
    speed_drive : bool
    hold : float
        Step (s) at whose multiples from ``samples[0]`` the inputs are sampled and held, as a master does; 0 lets them act
        continuously.
    steady : bool
        Whether the inputs are constant between the breaks.
    breaks, coefficients, harmonics, law : ndarray
        See `analysis.inputs.Encoded`; ``law`` is overwritten when the torsion bar is released.
    used : ndarray of bool, shape (6,)
        Which of the functions f1 to f6 are in use.
    tolerance : float
    scale : ndarray, shape (6,)
    samples : ndarray, shape (n,)
        Times to record (s), increasing, the first one the start.
    states, forces : ndarray, shapes (n, 6)
        State and inputs at the samples; written.
    levels : ndarray, shape (m, 4)
        Events: output number (or -1 - number of the event function), level, direction, whether it stops the run.
    f_event : function
    found : ndarray, shape (k, 8)
        Events found: number, time, state; written.
    start_energy : float
    max_steps : int

    Returns
    -------
    int
        RUNNING, FINISHED, LIMIT, NO_STEP or EVENT.
    """
    return _run(
        p, x, carry, end, speed_drive, hold, steady, breaks, coefficients, harmonics, law, used, f1, f2, f3, f4, f5, f6,
        tolerance, scale, samples, states, forces, levels, f_event, found, start_energy, max_steps,
    )  # fmt: skip


@njit
def _constants(row):  # type: ignore[no-untyped-def]
    return Constants(*to_fixed_tuple(row, _N_CONSTANTS))


@_compile(
    types.void(
        _MATRIX,  # parameters
        _MATRIX,  # starts
        _VECTOR,  # scales' tolerance
        float64,
        boolean,
        float64,
        boolean,
        _MATRIX,  # breaks
        float64[:, :, :, ::1],
        _CUBE,  # harmonics
        _MATRIX,  # laws
        boolean[::1],
        *_FUNCTIONS,
        _EVENT_FUNCTION,
        float64,
        _MATRIX,  # scales
        _VECTOR,  # samples
        _CUBE,  # states
        _CUBE,  # forces
        _MATRIX,  # carries
        int64[::1],  # status
        int64,
    )
)
def run_many(
    parameters, starts, energies, end, speed_drive, hold, steady, breaks, coefficients, harmonics, laws, used,
    f1, f2, f3, f4, f5, f6, f_event, tolerance, scales, samples, states, forces, carries, status, max_steps,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Many runs one after the other: `run` for each row, without events."""
    levels = np.empty((0, 4))
    found = np.empty((0, 8))
    for i in range(parameters.shape[0]):
        status[i] = _run(
            _constants(parameters[i]), starts[i], carries[i], end, speed_drive, hold, steady, breaks[i], coefficients[i],
            harmonics[i], laws[i], used, f1, f2, f3, f4, f5, f6, tolerance, scales[i], samples, states[i], forces[i],
            levels, f_event, found, energies[i], max_steps,
        )  # fmt: skip


@_compile(types.void(_CONSTANTS, _MATRIX, _MATRIX, float64, _MATRIX))
def outputs(p, states, forces, start_energy, out):  # type: ignore[no-untyped-def]
    """All real outputs of the contract for rows of states and inputs: ``out`` has shape (n, 27)."""
    for i in range(states.shape[0]):
        u = forces[i]
        row = dynamics.outputs(_tuple(states[i]), Inputs(u[0], u[1], u[2], u[3], u[4], u[5]), start_energy, p)
        for j in range(len(row)):
            out[i, j] = row[j]


@_compile(types.void(_CONSTANTS, _MATRIX, _MATRIX, _MATRIX))
def derivatives(p, states, forces, out):  # type: ignore[no-untyped-def]
    """Right-hand side for rows of states and inputs: the bare cost of an evaluation, for the benchmark."""
    for i in range(states.shape[0]):
        u = forces[i]
        row = dynamics.derivative(_tuple(states[i]), Inputs(u[0], u[1], u[2], u[3], u[4], u[5]), p)
        for j in range(_N):
            out[i, j] = row[j]


numba.config.CACHE_DIR = _saved_folder
