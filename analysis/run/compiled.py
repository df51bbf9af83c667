"""The plant's own functions under Numba: right-hand side, integrator, event location, outputs.

`linkwork` does not know Numba: its functions are registered from outside and compiled as they stand. Everything here has
an explicit signature, so that compiled code is kept on disk and a second process does not wait. Numba does not notice when
a called function changes; the folder of the cache therefore carries a hash of the plant's sources and of the modules here
that are compiled.

The integrator is DOP853 (`linkwork.tableau`) with its interpolant of order 7, the same method as the FMU's, written
again for arrays; inputs are evaluated inside the loop. It is written once for all mechanisms: which equations it integrates
follows from the type of the constants, and it is compiled for a mechanism the first time that one is run (`solver`). A run
goes from one interval of smooth inputs to the next, ends of intervals being breaks of the inputs, points at which they are
sampled and held, and the release of the torsion bar.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from functools import cache, cached_property
from math import cos, isfinite, isnan, sin
from pathlib import Path
from types import FunctionType
from typing import NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import boolean, float64, int64, njit, types
from numba.extending import intrinsic, overload, register_jitable
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray
from platformdirs import user_cache_dir

import linkwork
from linkwork import friction, tableau
from linkwork.five_bar import dynamics as five_bar_dynamics
from linkwork.five_bar import kinematics as five_bar_kinematics
from linkwork.five_bar.parameters import Constants as FiveBarConstants
from linkwork.limits import LIMIT_SINE, NEAR_LIMIT
from linkwork.slider_crank import dynamics as slider_crank_dynamics
from linkwork.slider_crank import kinematics as slider_crank_kinematics
from linkwork.slider_crank import vectors as slider_crank_vectors
from linkwork.slider_crank.parameters import Constants as SliderCrankConstants

from .inputs import FUNCTIONS, LAST, SPEED

# Status of a run, as the kernels return it: where the run has one, the solver.status of the FMI contract
RUNNING = -1
FINISHED = 0
BAD_INPUT = 2
LIMIT = 3
NO_STEP = 4
EVENT = 10

# Places in the array that carries a run from one call to the next: time at which the interval began and time since then,
# next step, next sample, number of the interval, events found, counts, whether the run has started and is inside an
# interval, the input that was not finite, and from HELD on the inputs in force
BEGIN, ELAPSED, STEP, SAMPLE, INTERVAL, EVENTS, STEPS, REJECTED, EVALUATIONS, STARTED, MIDWAY, LOST, HELD = range(13)
CARRY = HELD + 8

#: Modules of this package whose code or constants end up in compiled code.
COMPILED_MODULES = (
    "numerics/symbolic.py",
    "numerics/tracing.py",
    "periodic/orbit_kernels.py",
    "run/compiled.py",
    "run/inputs.py",
    "synthesis/kernels.py",
)
#: Events that one step can bring at most, and the beginning of an interval besides.
EVENTS_PER_STEP = 4
#: Fraction of a step within which an event counts as simultaneous with the end of the run or the release.
SAME = 1e-9


class Source(NamedTuple):
    """Inputs as the compiled code reads them: see `inputs.Encoded`; ``functions`` are addresses, or 0, shape (7,)."""

    breaks: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    harmonics: NDArray[np.float64]
    law: NDArray[np.float64]
    functions: NDArray[np.int64]


def cache_folder() -> Path:
    """Folder of the compiled code: below LINKWORK_CACHE_DIR, else the user's cache, else a temporary folder."""
    digest = hashlib.sha256()
    root = Path(linkwork.__file__).parent
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    for name in COMPILED_MODULES:
        digest.update((Path(__file__).parent.parent / name).read_bytes())
    name = f"numba-{digest.hexdigest()[:16]}"
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(os.environ.get("LINKWORK_CACHE_DIR") or user_cache_dir("linkwork", appauthor=False)) / name
    if _usable(folder):
        return folder
    folder = Path(tempfile.gettempdir()) / f"linkwork-{user}" / name
    # what others can write to could make us run their code
    if _usable(folder) and (os.name == "nt" or all(_private(f, user) for f in (folder.parent, folder))):
        return folder
    return Path(tempfile.mkdtemp(prefix="linkwork-"))


def _usable(folder: Path) -> bool:
    try:
        for path in (folder.parent, folder):
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _private(folder: Path, user: int) -> bool:
    status = folder.lstat()
    return status.st_uid == user and not status.st_mode & 0o022


def constants_type(constants):  # type: ignore[no-untyped-def]
    """Numba's type of a mechanism's constants."""
    return types.NamedUniTuple(float64, len(constants._fields), constants)


#: Of the five-bar's.
CONSTANTS = constants_type(FiveBarConstants)
VECTOR = float64[::1]
MATRIX = float64[:, ::1]
CUBE = float64[:, :, ::1]
_ADDRESSES = int64[::1]
_SOURCE = types.NamedTuple((VECTOR, CUBE, MATRIX, VECTOR, _ADDRESSES), Source)

for _module in (
    friction,
    five_bar_kinematics,
    five_bar_dynamics,
    slider_crank_vectors,
    slider_crank_kinematics,
    slider_crank_dynamics,
):
    for _function in vars(_module).values():
        if isinstance(_function, FunctionType) and _function.__module__ == _module.__name__:
            register_jitable(_function)

#: The equations of each mechanism, by the class of its constants.
_EQUATIONS = {FiveBarConstants: five_bar_dynamics, SliderCrankConstants: slider_crank_dynamics}


def _equations(p):  # type: ignore[no-untyped-def]
    return _EQUATIONS[p.instance_class]


def _derivative(x, i, p):  # type: ignore[no-untyped-def]
    """Right-hand side of the mechanism that the constants belong to."""


@overload(_derivative, strict=False)
def _(x, i, p):  # type: ignore[no-untyped-def]
    return _equations(p).derivative


def _row(x, i, start_energy, p):  # type: ignore[no-untyped-def]
    """All outputs of the mechanism that the constants belong to."""


@overload(_row, strict=False)
def _(x, i, start_energy, p):  # type: ignore[no-untyped-def]
    return _equations(p).outputs


def _clearance(x, i, p):  # type: ignore[no-untyped-def]
    """Sine of the transmission angle, which falls to LIMIT_SINE at the limit of assembly."""


@overload(_clearance, strict=False)
def _(x, i, p):  # type: ignore[no-untyped-def]
    return _equations(p).clearance


def _commanded(x, i, speed, last, p):  # type: ignore[no-untyped-def]
    """The state after the commanded speeds have jumped."""


@overload(_commanded, strict=False)
def _(x, i, speed, last, p):  # type: ignore[no-untyped-def]
    return _equations(p).jump


def _applied(drive, axial, torque, acceleration, force, load, last, rate, p):  # type: ignore[no-untyped-def]
    """The channels as the inputs of the mechanism that the constants belong to."""


@overload(_applied, strict=False)
def _(drive, axial, torque, acceleration, force, load, last, rate, p):  # type: ignore[no-untyped-def]
    return _equations(p).applied


def _reader(kind):  # type: ignore[no-untyped-def]
    """A function that reads a NamedTuple of floats from a row that begins with them."""
    size = len(kind._fields)

    @njit(error_model="numpy")
    def read(row):  # type: ignore[no-untyped-def]
        return kind(*to_fixed_tuple(row, size))

    return read


#: Constants of the five-bar from a row of them.
constants = _reader(FiveBarConstants)


def _restored(row, p):  # type: ignore[no-untyped-def]
    """The inputs of the mechanism that the constants belong to, from a row that begins with them."""


@overload(_restored, strict=False)
def _(row, p):  # type: ignore[no-untyped-def]
    read = _reader(_equations(p).Inputs)
    return lambda row, p: read(row)


def _constants(row, p):  # type: ignore[no-untyped-def]
    """Constants like ``p`` from a row of them."""


@overload(_constants, strict=False)
def _(row, p):  # type: ignore[no-untyped-def]
    read = _reader(p.instance_class)
    return lambda row, p: read(row)


# DOP853: the weights of stage s are WEIGHT[ROW[s]:ROW[s + 1]], those of the stages FROM
ROW = np.cumsum([0, *(len(row) for row in tableau.A)])
FROM = np.array([stage for row in tableau.A for stage, _ in row])
WEIGHT = np.array([weight for row in tableau.A for _, weight in row])
NODES = np.array(tableau.C)
E3 = np.array(tableau.E3)
E5 = np.array(tableau.E5)
_D = np.array(tableau.D)
STAGES = tableau.STAGES
EXPONENT = -1.0 / tableau.ORDER
_N = 6

_FOLDER = str(cache_folder())


def kernel(*signature):  # type: ignore[no-untyped-def]
    """Decorator: compile a function for its explicit signature and keep the machine code in `cache_folder`."""

    def decorate(function):  # type: ignore[no-untyped-def]
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = _FOLDER
        try:
            return njit(*signature, cache=True, error_model="numpy", nogil=True)(function)
        finally:
            numba.config.CACHE_DIR = before

    return decorate


# inner functions make no arrays: to count the references to those they are handed would cost more than all they do
inner = njit(error_model="numpy", _nrt=False)


@intrinsic
def _call(typing_context, address, t, th2, u, w2, v):  # type: ignore[no-untyped-def]
    """Value of the function f(t, th2, u, w2, v) of floats at an address, which costs a call nothing to be handed."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        double = ir.DoubleType()
        function = builder.inttoptr(arguments[0], ir.FunctionType(double, [double] * 5).as_pointer())
        return builder.call(function, arguments[1:])

    return float64(int64, *[float64] * 5), generate


@inner
def _find(t, breaks):  # type: ignore[no-untyped-def]
    """Piece of the polynomials in force from t on; the outer ones go on beyond the ends."""
    n = breaks.shape[0] - 1
    i = np.searchsorted(breaks, t, side="right") - 1
    return min(max(i, 0), n - 1)


@inner
def _find_before(t, breaks):  # type: ignore[no-untyped-def]
    """Piece of the polynomials in force up to t."""
    piece = _find(t, breaks)
    return piece - 1 if piece > 0 and t == breaks[piece] else piece


@inner
def _channels(t, piece, x, source):  # type: ignore[no-untyped-def]
    """Torque, speed, acceleration, force, load, last channel and its rate at time t on a given piece."""
    s = t - source.breaks[piece]
    c = source.coefficients[piece]
    torque = c[0, 0] + s * (c[0, 1] + s * (c[0, 2] + s * c[0, 3]))
    speed = c[SPEED, 0] + s * (c[SPEED, 1] + s * (c[SPEED, 2] + s * c[SPEED, 3]))
    acceleration = c[SPEED, 1] + s * (2.0 * c[SPEED, 2] + s * 3.0 * c[SPEED, 3])
    force = c[2, 0] + s * (c[2, 1] + s * (c[2, 2] + s * c[2, 3]))
    load = c[3, 0] + s * (c[3, 1] + s * (c[3, 2] + s * c[3, 3]))
    last = c[LAST, 0] + s * (c[LAST, 1] + s * (c[LAST, 2] + s * c[LAST, 3]))
    rate = c[LAST, 1] + s * (2.0 * c[LAST, 2] + s * 3.0 * c[LAST, 3])
    harmonics = source.harmonics
    for k in range(harmonics.shape[0]):
        channel = int(harmonics[k, 0])
        phase = harmonics[k, 2] * t + harmonics[k, 3]
        value = harmonics[k, 1] * cos(phase)
        if channel == 0:
            torque += value
        elif channel == SPEED:
            speed += value
            acceleration -= harmonics[k, 1] * harmonics[k, 2] * sin(phase)
        elif channel == 2:
            force += value
        elif channel == 3:
            load += value
        else:
            last += value
            rate -= harmonics[k, 1] * harmonics[k, 2] * sin(phase)
    law = source.law
    if law[2] != 0.0:
        torque += law[0] * (1.0 - x[0] / law[1])
    if law[3] != 0.0:
        # Kloss: 2 Tb / (s / sb + sb / s), written so that it holds at synchronous speed
        slip = 1.0 - x[2] / law[5]
        torque += 2.0 * law[3] * slip * law[4] / (slip * slip + law[4] * law[4])
    f = source.functions
    if f[0] != 0:
        torque += _call(f[0], t, x[0], x[1], x[2], x[3])
    if f[1] != 0:
        force += _call(f[1], t, x[0], x[1], x[2], x[3])
    if f[2] != 0:
        load += _call(f[2], t, x[0], x[1], x[2], x[3])
    if f[3] != 0:
        last += _call(f[3], t, x[0], x[1], x[2], x[3])
    if f[4] != 0:
        speed += _call(f[4], t, x[0], x[1], x[2], x[3])
        acceleration += _call(f[5], t, x[0], x[1], x[2], x[3])
    if f[6] != 0:
        rate += _call(f[6], t, x[0], x[1], x[2], x[3])
    return torque, speed, acceleration, force, load, last, rate


@kernel(float64(VECTOR, float64, float64, float64))
def held_bar(law, th2, w2, step):  # type: ignore[no-untyped-def]
    """What to add to the torsion bar's torque at th2 where it is held over a step, at crank speed w2.

    The torque at the crank angle predicted for the middle of the step makes the impulse right to second order; that at the
    beginning would act half a step late. The bar does not pull back.
    """
    if law[2] == 0.0:
        return 0.0
    middle = th2 + 0.5 * step * w2
    return law[0] * (max(0.0, 1.0 - middle / law[1]) - (1.0 - th2 / law[1]))


@kernel(types.UniTuple(float64, FUNCTIONS)(float64, boolean, VECTOR, _SOURCE))
def channels(t, left, x, source):  # type: ignore[no-untyped-def]
    """Torque, speed, acceleration, force, load, last channel and its rate at time t, the limit from the left or the right."""
    return _channels(t, _find_before(t, source.breaks) if left else _find(t, source.breaks), x, source)


@inner
def _inputs(t, piece, x, drive, axial, source, p):  # type: ignore[no-untyped-def]
    a = _channels(t, piece, x, source)
    return _applied(drive, axial, a[0], a[2], a[3], a[4], a[5], a[6], p)


@inner
def _tuple(x):  # type: ignore[no-untyped-def]
    return (x[0], x[1], x[2], x[3], x[4], x[5])


@inner
def _copy(source, target):  # type: ignore[no-untyped-def]
    for i in range(_N):
        target[i] = source[i]


@inner
def _keep(held, target):  # type: ignore[no-untyped-def]
    """Write inputs into a row."""
    for i in range(len(held)):
        target[i] = held[i]


@inner
def _stage(s, x, k, h, y):  # type: ignore[no-untyped-def]
    """State at stage s of a step of size h from x; stage 12 is its end."""
    y0 = y1 = y2 = y3 = y4 = y5 = 0.0
    for n in range(ROW[s], ROW[s + 1]):
        w = WEIGHT[n]
        j = FROM[n]
        y0 += w * k[j, 0]
        y1 += w * k[j, 1]
        y2 += w * k[j, 2]
        y3 += w * k[j, 3]
        y4 += w * k[j, 4]
        y5 += w * k[j, 5]
    y[0] = x[0] + h * y0
    y[1] = x[1] + h * y1
    y[2] = x[2] + h * y2
    y[3] = x[3] + h * y3
    y[4] = x[4] + h * y4
    y[5] = x[5] + h * y5


@inner
def local_error(size, x, y, k, h, scale):  # type: ignore[no-untyped-def]
    """Hairer's estimate of the error of a step from x to y relative to the scale, of order 8 in h; components ``size``."""
    sum3 = sum5 = 0.0
    for i in range(size):
        e3 = e5 = 0.0
        for j in range(STAGES):
            e3 += E3[j] * k[j, i]
            e5 += E5[j] * k[j, i]
        weight = scale[i] + max(abs(x[i]), abs(y[i]))
        sum3 += (e3 / weight) ** 2
        sum5 += (e5 / weight) ** 2
    bottom = sum5 + 0.01 * sum3
    return 0.0 if bottom == 0.0 else h * sum5 / np.sqrt(bottom * size)


@inner
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


@inner
def _interpolate(s, x, f, out):  # type: ignore[no-untyped-def]
    """State at the fraction s of the step."""
    for i in range(_N):
        y = 0.0
        for r in range(7):
            y += f[6 - r, i]
            y *= s if r % 2 == 0 else 1.0 - s
        out[i] = x[i] + y


@inner
def _gap(e, t, x, held, watch, addresses, release, start_energy, p):  # type: ignore[no-untyped-def]
    """What is zero where something happens: the limit of assembly (-1), the release (-2), event e of the user."""
    if e == -1:
        return _clearance(_tuple(x), held, p) - LIMIT_SINE
    if e == -2:
        return release - x[0]
    if addresses[e] != 0:
        return _call(addresses[e], t, x[0], x[1], x[2], x[3])
    return _row(_tuple(x), held, start_energy, p)[int(watch[e, 0])] - watch[e, 1]


@inner
def _locate(
    e, low, high, t, h, x, f, dense, constant, held, drive, axial, piece, source, watch, addresses, start_energy, p
):  # type: ignore[no-untyped-def]
    """Fraction of the step at which e happens, by bisection of the interpolant between two fractions."""
    positive = False
    for n in range(55):
        s = low if n == 0 else 0.5 * (low + high)
        _interpolate(s, x, f, dense)
        if not constant:
            held = _inputs(t + s * h, piece, dense, drive, axial, source, p)
        # a NaN, beyond the limit of assembly, compares as not positive
        sign = _gap(e, t + s * h, dense, held, watch, addresses, source.law[1], start_energy, p) > 0.0
        if n == 0:
            positive = sign
        elif sign == positive:
            low = s
        else:
            high = s
    # the limit is approached, not passed: its own side must still be a configuration
    return low if e == -1 else high


@inner
def _crosses(before, after, direction):  # type: ignore[no-untyped-def]
    """Whether an event happens between two values; one that starts at zero does not."""
    return (before < 0.0 <= after and direction >= 0.0) or (before > 0.0 >= after and direction <= 0.0)


@inner
def _record(found, n, e, t, x):  # type: ignore[no-untyped-def]
    found[n, 0] = e
    found[n, 1] = t
    for i in range(_N):
        found[n, 2 + i] = x[i]


@njit(error_model="numpy")
def _run(
    p, x, carry, end, speed_drive, axial, hold, steady, source, tolerance, scale, samples, states, forces, watch, addresses,
    gaps, found, start_energy, max_steps,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Integrate until ``end``, a stopping event, or ``max_steps``; see `run` for the arguments."""
    drive = 1.0 if speed_drive else 0.0
    breaks = source.breaks
    law = source.law
    n_samples = samples.shape[0]
    n_events = watch.shape[0]
    k = np.zeros((16, _N))
    y = np.empty(_N)
    z = np.empty(_N)
    dense = np.empty(_N)
    f = np.empty((7, _N))
    begin = carry[BEGIN]
    elapsed = carry[ELAPSED]
    h_next = carry[STEP]
    sample = int(carry[SAMPLE])
    interval = int(carry[INTERVAL])
    n_found = int(carry[EVENTS])
    started = carry[STARTED] != 0.0
    midway = carry[MIDWAY] != 0.0
    held = _restored(carry[HELD:], p)
    steps = 0
    paused = False
    status = RUNNING
    while status == RUNNING:
        # an interval on which the inputs are smooth begins, or is gone on with: find its end
        piece = _find(begin, breaks)
        constant = hold > 0.0 or (steady and (law[2] == 0.0 or x[0] >= law[1]))
        stop = end
        if hold > 0.0:
            if interval + 1 < n_samples:
                stop = samples[interval + 1]
        elif piece + 1 < breaks.shape[0] - 1 and breaks[piece + 1] < end:
            stop = breaks[piece + 1]
        if not midway:
            if n_found + (1 + EVENTS_PER_STEP) * n_events > found.shape[0]:
                paused = True
                break
            if law[2] != 0.0 and x[0] >= law[1]:
                law[2] = 0.0
            now = _channels(begin, piece, x, source)
            acceleration = now[2]
            torque = now[0]
            rate = now[6]
            if hold > 0.0:
                ahead = stop if begin < end else begin + hold
                torque += held_bar(law, x[0], x[2], ahead - begin)
                if speed_drive:
                    # the secant: the speed meets the command again at the next point of the grid
                    there = _channels(ahead, _find_before(ahead, breaks), x, source)
                    acceleration = (there[1] - now[1]) / (ahead - begin)
                if axial == 1.0:
                    there = _channels(ahead, _find_before(ahead, breaks), x, source)
                    rate = (there[5] - now[5]) / (ahead - begin)
            held = _applied(drive, axial, torque, acceleration, now[3], now[4], now[5], rate, p)
            if not isfinite(acceleration):
                # by name, the speed at the next point of the grid
                status = BAD_INPUT
                carry[LOST] = 1
            if not isfinite(rate):
                status = BAD_INPUT
                carry[LOST] = 5
            for i in range(len(now)):
                if not isfinite(now[i]):
                    status = BAD_INPUT
                    carry[LOST] = i
            if status != RUNNING:
                break
            # at the start the state has the commanded speeds; after that a jump of them is an impulse
            if started and ((speed_drive and x[2] != now[1]) or (axial == 1.0 and x[3] != now[5])):
                _copy(_commanded(_tuple(x), held, now[1], now[5], p), x)
            # samples at the beginning of the interval, with the inputs that begin here
            while sample < n_samples and samples[sample] <= begin:
                _copy(x, states[sample])
                _keep(held, forces[sample])
                sample += 1
            # what the inputs' jump made happen; a zero stands for what has just been told, and is to be left before it counts
            for e in range(n_events):
                before = gaps[e]
                if started and before == 0.0:
                    continue
                gaps[e] = _gap(e, begin, x, held, watch, addresses, law[1], start_energy, p)
                if _crosses(before, gaps[e], watch[e, 2]):
                    _record(found, n_found, e, begin, x)
                    n_found += 1
                    if watch[e, 3] != 0.0:
                        status = EVENT
            started = True
            if status == RUNNING and begin >= end:
                status = FINISHED
            if status != RUNNING:
                break
        midway = False
        _copy(_derivative(_tuple(x), held, p), k[0])
        carry[EVALUATIONS] += 1
        if not h_next > 0.0:
            ratio = 1e-300
            for i in range(_N):
                ratio = max(ratio, abs(k[0, i]) / (scale[i] + abs(x[i])))
            h_next = min(stop - begin, tolerance ** (-EXPONENT) / ratio)
        # steps, until the interval is over or cut short
        while True:
            if steps >= max_steps or n_found + EVENTS_PER_STEP * n_events > found.shape[0]:
                paused = midway = True
                if not constant:
                    # after a step that was refused they are those of one of its stages
                    held = _inputs(begin + elapsed, piece, x, drive, axial, source, p)
                break
            t = begin + elapsed
            remaining = (stop - begin) - elapsed
            last = h_next >= remaining * (1.0 - 1e-10)
            h = remaining if last else min(h_next, 0.5 * remaining)
            steps += 1
            for s in range(1, STAGES):
                _stage(s, x, k, h, y)
                if not constant:
                    held = _inputs(t + NODES[s] * h, piece, y, drive, axial, source, p)
                _copy(_derivative(_tuple(y), held, p), k[s])
            _stage(STAGES, x, k, h, y)
            carry[EVALUATIONS] += STAGES - 1
            error = local_error(_N, x, y, k, h, scale) / tolerance
            good = error <= 1.0
            if good:
                t_new = stop if last else begin + (elapsed + h)
                if not constant:
                    held = _inputs(t_new, piece, y, drive, axial, source, p)
                _copy(_derivative(_tuple(y), held, p), k[12])
                carry[EVALUATIONS] += 1
                for i in range(_N):
                    if isnan(k[12, i]):
                        good = False
            if not good:
                carry[REJECTED] += 1
                h_next = h * (max(0.2, 0.9 * error**EXPONENT) if 1.0 < error < 1e30 else 0.25)
                if not h_next >= 1e-14 * max(abs(t), end - samples[0]):
                    status = LIMIT if abs(_clearance(_tuple(x), held, p)) < NEAR_LIMIT else NO_STEP
                    if not constant:
                        # where a step is impossible however short, an input may be what stops it
                        for i in range(_N):
                            z[i] = x[i] + h * k[0, i]
                        now = _channels(t + h, piece, z, source)
                        for i in range(len(now)):
                            if not isfinite(now[i]):
                                status = BAD_INPUT
                                carry[LOST] = i
                        held = _inputs(t, piece, x, drive, axial, source, p)
                    break
                continue
            factor = 6.0 if error == 0.0 else min(6.0, 0.9 * error**EXPONENT)
            # a step cut short by the end of the interval does not shorten the one carried over
            h_next = max(h_next, factor * h) if h < h_next else max(0.2, factor) * h
            # what happens inside the step needs the interpolant
            limit = _clearance(_tuple(y), held, p) < LIMIT_SINE
            release = law[2] != 0.0 and hold == 0.0 and y[0] >= law[1]
            if limit or release or n_events > 0 or (sample < n_samples and samples[sample] < t_new):
                inside = held
                for s in range(13, 16):
                    _stage(s, x, k, h, z)
                    if not constant:
                        inside = _inputs(t + NODES[s] * h, piece, z, drive, axial, source, p)
                    _copy(_derivative(_tuple(z), inside, p), k[s])
                carry[EVALUATIONS] += 3
                _interpolant(x, y, k, h, f)
            # the earliest of: limit of assembly (-1), release of the torsion bar (-2), a stopping event (its number)
            cut = 2.0
            what = 0
            if limit:
                what = -1
                cut = _locate(
                    -1, 0.0, 1.0, t, h, x, f, dense, constant, held, drive, axial, piece, source, watch, addresses,
                    start_energy, p,
                )  # fmt: skip
            if release:
                s = _locate(
                    -2, 0.0, 1.0, t, h, x, f, dense, constant, held, drive, axial, piece, source, watch, addresses,
                    start_energy, p,
                )  # fmt: skip
                if s < cut:
                    cut = s
                    what = -2
            n_before = n_found
            for e in range(n_events):
                for quarter in range(EVENTS_PER_STEP):
                    s0 = quarter / EVENTS_PER_STEP
                    s1 = (quarter + 1) / EVENTS_PER_STEP
                    if s1 == 1.0:
                        gap = _gap(e, t_new, y, held, watch, addresses, law[1], start_energy, p)
                    else:
                        _interpolate(s1, x, f, dense)
                        inside = held if constant else _inputs(t + s1 * h, piece, dense, drive, axial, source, p)
                        gap = _gap(e, t + s1 * h, dense, inside, watch, addresses, law[1], start_energy, p)
                    if _crosses(gaps[e], gap, watch[e, 2]):
                        s = _locate(
                            e, s0, s1, t, h, x, f, dense, constant, held, drive, axial, piece, source, watch,
                            addresses, start_energy, p,
                        )  # fmt: skip
                        _interpolate(s, x, f, dense)
                        _record(found, n_found, e, s, dense)
                        n_found += 1
                        if watch[e, 3] != 0.0 and s < cut:
                            cut = s
                            what = e
                    gaps[e] = gap
            # fractions of the step become times; events after the cut did not happen
            kept = n_before
            for n in range(n_before, n_found):
                s = found[n, 1]
                if s <= cut + SAME:
                    found[kept] = found[n]
                    found[kept, 1] = begin + (elapsed + s * h)
                    kept += 1
            n_found = kept
            if cut <= 1.0:
                t_new = begin + (elapsed + cut * h)
            # samples inside the step; one at its end waits for the next, or for the next interval's inputs
            while sample < n_samples and samples[sample] < t_new:
                _interpolate(((samples[sample] - begin) - elapsed) / h, x, f, states[sample])
                inside = held if constant else _inputs(samples[sample], piece, states[sample], drive, axial, source, p)
                _keep(inside, forces[sample])
                sample += 1
            if cut <= 1.0:
                _interpolate(cut, x, f, dense)
                _copy(dense, x)
                if what == -2:
                    x[0] = law[1]
                if not constant:
                    held = _inputs(t_new, piece, x, drive, axial, source, p)
                for e in range(n_events):
                    gaps[e] = _gap(e, t_new, x, held, watch, addresses, law[1], start_energy, p)
                for n in range(n_before, n_found):
                    # at the cut itself, but for rounding: it has happened
                    e = int(found[n, 0])
                    if found[n, 1] >= begin + (elapsed + (cut - SAME) * h):
                        gaps[e] = 0.0
                        if watch[e, 3] != 0.0 and what == -2:
                            status = EVENT
                if what == -2:
                    law[2] = 0.0
                else:
                    status = LIMIT if what == -1 else EVENT
                begin = t_new
                elapsed = 0.0
                break
            _copy(y, x)
            _copy(k[12], k[0])
            if last:
                begin = stop
                elapsed = 0.0
                interval += 1
                break
            elapsed += h
        if paused:
            break
    carry[BEGIN] = begin
    carry[ELAPSED] = elapsed
    carry[STEP] = h_next
    carry[SAMPLE] = sample
    carry[INTERVAL] = interval
    carry[EVENTS] = n_found
    carry[STEPS] += steps
    carry[STARTED] = started
    carry[MIDWAY] = midway
    for i in range(len(held)):
        carry[HELD + i] = held[i]
    return status


_RUN_ARGUMENTS = (
    float64,  # tolerance
    VECTOR,  # scale
    VECTOR,  # samples
    MATRIX,  # states
    MATRIX,  # forces
    MATRIX,  # watch
    _ADDRESSES,  # addresses
    VECTOR,  # gaps
    MATRIX,  # found
    float64,  # start_energy
    int64,  # max_steps
)


def run(
    p, x, carry, end, speed_drive, axial, hold, steady, source, tolerance, scale, samples, states, forces, watch, addresses,
    gaps, found, start_energy, max_steps,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Integrate one run until ``end``, a stopping event, ``max_steps`` steps or a full table of events.

    Called again with what it left behind it goes on, with the same result as in one call.

    Parameters
    ----------
    p : Constants
    x : ndarray, shape (6,)
        State; overwritten.
    carry : ndarray, shape (CARRY,)
        See `BEGIN` and its kin; overwritten. All zero but the time in BEGIN at the start.
    end : float
        Time at the end (s).
    speed_drive : bool
    axial : float
        What moves the second coordinate: 0 a force, 1 a commanded speed, 2 a groove.
    hold : float
        Where it is not 0, the inputs are sampled at ``samples`` and held, as a master does; it is then the step (s) that
        follows the last one. 0 lets the inputs act continuously.
    steady : bool
        Whether the inputs, but for the torsion bar, are constant between the breaks.
    source : Source
        The inputs; its ``law`` is overwritten when the torsion bar is released.
    tolerance : float
    scale : ndarray, shape (6,)
    samples : ndarray, shape (n,)
        Times to record (s), increasing, the first one the start.
    states, forces : ndarray, shapes (n, 6) and (n, number of inputs)
        State and inputs at the samples; written.
    watch : ndarray, shape (m, 4)
        Events: output number, level, direction, whether it stops the run.
    addresses : ndarray of int64, shape (m,)
        Events: address of the function that takes the place of the output, or 0.
    gaps : ndarray, shape (m,)
        Last values of the events; overwritten.
    found : ndarray, shape (k, 8)
        Events found since the caller last set the count of them to zero: number, time, state; written. A step can bring
        EVENTS_PER_STEP of each.
    start_energy : float
    max_steps : int

    Returns
    -------
    int
        RUNNING, FINISHED, BAD_INPUT, LIMIT, NO_STEP or EVENT.
    """
    return _run(
        p, x, carry, end, speed_drive, axial, hold, steady, source, tolerance, scale, samples, states, forces, watch, addresses,
        gaps, found, start_energy, max_steps,
    )  # fmt: skip


def run_many(
    p, parameters, starts, energies, end, speed_drive, axial, hold, steady, sizes, breaks, coefficients, harmonics, laws,
    functions, tolerance, scales, samples, states, forces, carries, status, max_steps,
):  # type: ignore[no-untyped-def]  # fmt: skip
    """Many runs one after the other: `run` for each row, without events; ``sizes`` counts its pieces and harmonics.

    ``p`` are constants of the mechanism, any: what counts is their kind.
    """
    watch = np.empty((0, 4))
    addresses = np.empty(0, dtype=np.int64)
    gaps = np.empty(0)
    found = np.empty((0, 8))
    for i in range(parameters.shape[0]):
        pieces, waves = sizes[i]
        source = Source(breaks[i, : pieces + 1], coefficients[i, :pieces], harmonics[i, :waves], laws[i], functions)
        status[i] = _run(
            _constants(parameters[i], p), starts[i], carries[i], end, speed_drive, axial, hold, steady[i], source, tolerance,
            scales[i], samples, states[i], forces[i], watch, addresses, gaps, found, energies[i], max_steps,
        )  # fmt: skip


def outputs(p, states, forces, start_energy, out):  # type: ignore[no-untyped-def]
    """All real outputs of the contract for rows of states and inputs: ``out`` has shape (n, number of outputs)."""
    for i in range(states.shape[0]):
        row = _row(_tuple(states[i]), _restored(forces[i], p), start_energy, p)
        for j in range(len(row)):
            out[i, j] = row[j]


def derivatives(p, states, forces, out):  # type: ignore[no-untyped-def]
    """Right-hand side for rows of states and inputs: the bare cost of an evaluation, for the benchmark."""
    for i in range(states.shape[0]):
        row = _derivative(_tuple(states[i]), _restored(forces[i], p), p)
        for j in range(_N):
            out[i, j] = row[j]


class Solver:
    """`run`, `run_many`, `outputs` and `derivatives` for one mechanism, each compiled the first time that it is asked for."""

    def __init__(self, constants):  # type: ignore[no-untyped-def]
        self._p = constants_type(constants)

    @cached_property
    def run(self):  # type: ignore[no-untyped-def]
        arguments = (VECTOR, VECTOR, float64, boolean, float64, float64, boolean, _SOURCE, *_RUN_ARGUMENTS)
        return kernel(int64(self._p, *arguments))(run)

    @cached_property
    def run_many(self):  # type: ignore[no-untyped-def]
        return kernel(types.void(self._p, *_RUN_MANY_ARGUMENTS))(run_many)

    @cached_property
    def outputs(self):  # type: ignore[no-untyped-def]
        return kernel(types.void(self._p, MATRIX, MATRIX, float64, MATRIX))(outputs)

    @cached_property
    def derivatives(self):  # type: ignore[no-untyped-def]
        return kernel(types.void(self._p, MATRIX, MATRIX, MATRIX))(derivatives)


_RUN_MANY_ARGUMENTS = (
    MATRIX,  # parameters
    MATRIX,  # starts
    VECTOR,  # energies
    float64,  # end
    boolean,  # speed_drive
    float64,  # axial
    float64,  # hold
    boolean[::1],  # steady
    int64[:, ::1],  # sizes
    MATRIX,  # breaks
    float64[:, :, :, ::1],  # coefficients
    CUBE,  # harmonics
    MATRIX,  # laws
    _ADDRESSES,  # functions
    float64,  # tolerance
    MATRIX,  # scales
    VECTOR,  # samples
    CUBE,  # states
    CUBE,  # forces
    MATRIX,  # carries
    int64[::1],  # status
    int64,  # max_steps
)


def solver(p: NamedTuple) -> Solver:
    """The compiled code of the mechanism whose constants ``p`` are."""
    return _solver(type(p))


_solver = cache(Solver)
