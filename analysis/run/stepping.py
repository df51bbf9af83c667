"""Take a step of the integrator DOP853 (`linkwork.tableau`) in compiled code, for runs and periodic motions."""

from __future__ import annotations

from math import isfinite, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork import tableau
from linkwork.integrate import GREATEST_FACTOR, LEAST_FACTOR, SAFETY

from ..numerics.codegen import evaluate, inner
from .sources import write_channels

# DOP853: the weights in stage s are WEIGHT[ROW[s]:ROW[s + 1]], of the rates at the stages FROM[ROW[s]:ROW[s + 1]]
ROW = np.cumsum([0, *(len(row) for row in tableau.A)])
FROM = np.array([stage for row in tableau.A for stage, _ in row])
WEIGHT = np.array([weight for row in tableau.A for _, weight in row])
NODES = np.array(tableau.C)
E3 = np.array(tableau.E3)
E5 = np.array(tableau.E5)
_D = np.array(tableau.D)
STAGES = tableau.STAGES
EXPONENT = -1.0 / tableau.ORDER


@inner
def stage(s, x, k, h, y):
    """Compute the state y at stage s of a step of size h from x, from the rates k; stage 12 is the end of the step.

    Four components at a time are summed in the processor's registers, each in the order of the stages.
    """
    n = x.shape[0]
    first, end = ROW[s], ROW[s + 1]
    i = 0
    while i + 4 <= n:
        a = b = c = d = 0.0
        for j in range(first, end):
            weight, row = WEIGHT[j], FROM[j]
            a += weight * k[row, i]
            b += weight * k[row, i + 1]
            c += weight * k[row, i + 2]
            d += weight * k[row, i + 3]
        y[i] = x[i] + h * a
        y[i + 1] = x[i + 1] + h * b
        y[i + 2] = x[i + 2] + h * c
        y[i + 3] = x[i + 3] + h * d
        i += 4
    while i < n:
        a = 0.0
        for j in range(first, end):
            a += WEIGHT[j] * k[FROM[j], i]
        y[i] = x[i] + h * a
        i += 1


class Flow(NamedTuple):
    """Right-hand side of the equations: its address, modes, constants, and the magnitudes to which errors are relative."""

    equation: int
    modes: NDArray[np.float64]
    p: NDArray[np.float64]
    scale: NDArray[np.float64]


@inner
def attempt(flow, begin, elapsed, h, x, room, u, piece, source):
    """Take a step of size h from x at the time ``begin + elapsed`` into room.y; return its relative error (`_local_error`).

    The rates at the start of the step must be in room.k[0]. ``u`` are the input channels; if ``piece``, the index of a piece
    of the polynomials, is not negative, the channels are sampled from ``source`` at each stage.
    """
    k, y = room.k, room.y
    for s in range(1, STAGES):
        stage(s, x, k, h, y)
        # two conditions, since the first decides what Numba compiles
        if source is not None:  # noqa: SIM102
            if piece >= 0:
                write_channels(begin, elapsed + NODES[s] * h, piece, y, source, u)
        evaluate(flow.equation, begin + (elapsed + NODES[s] * h), y, flow.modes, u, flow.p, k[s])
    stage(STAGES, x, k, h, y)
    return _local_error(x, y, k, h, flow.scale)


@inner
def _local_error(x, y, k, h, scale):
    """Return Hairer's error estimate of order 8 for a step from x to y, relative to scale + state; NaN if y is not finite."""
    sum3 = sum5 = 0.0
    for i in range(x.shape[0]):
        e3 = e5 = 0.0
        for j in range(STAGES):
            e3 += E3[j] * k[j, i]
            e5 += E5[j] * k[j, i]
        if not isfinite(y[i]):
            return nan
        weight = scale[i] + max(abs(x[i]), abs(y[i]))
        sum3 += (e3 / weight) ** 2
        sum5 += (e5 / weight) ** 2
    bottom = sum5 + 0.01 * sum3
    return 0.0 if bottom == 0.0 else h * sum5 / np.sqrt(bottom * x.shape[0])


@inner
def shorter_step_size(h, error):
    """Return the step size to try after a step of size h was rejected; ``error`` is relative to the tolerance."""
    return h * (max(LEAST_FACTOR, SAFETY * error**EXPONENT) if 1.0 < error < 1e30 else 0.25)


@inner
def next_step_size(h, proposed, error):
    """Return the next step size after an accepted step of size h, from its error relative to the tolerance.

    If h was cut shorter than ``proposed``, as at the end of an interval, the next step is not shorter than ``proposed``.
    """
    factor = GREATEST_FACTOR if error == 0.0 else min(GREATEST_FACTOR, SAFETY * error**EXPONENT)
    return max(proposed, factor * h) if h < proposed else max(LEAST_FACTOR, factor) * h


@inner
def interpolant(x, y, k, h, f):
    """Compute the coefficients f of the interpolant between x and y (Hairer's contd8); k has the rates at all 16 stages."""
    for i in range(x.shape[0]):
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
def interpolate(s, x, f, out):
    """Interpolate the state at the fraction s of a step from x with the coefficients f, into ``out``."""
    for i in range(x.shape[0]):
        y = 0.0
        for r in range(7):
            y += f[6 - r, i]
            y *= s if r % 2 == 0 else 1.0 - s
        out[i] = x[i] + y
