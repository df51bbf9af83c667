"""Take a step of the integrator DOP853 (`linkwork.tableau`) in compiled code, for runs and periodic motions."""

from __future__ import annotations

from math import isfinite, isnan, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork import tableau
from linkwork.integrate import GREATEST_FACTOR, LEAST_FACTOR, PROBE, SAFETY

from ..numerics.codegen import evaluate, inline, inner
from ..numerics.vectors import nonzero_weights, weighted_rows
from .sources import write_channels

NODES = np.array(tableau.C)
STAGES = tableau.STAGES
EXPONENT = -1.0 / tableau.ORDER

#: ``stage(s, x, k, h, y)`` computes the state y at stage s of a step of size h from x, from the rates k; stage 12 is the end.
stage = weighted_rows(tableau.A)
_error = weighted_rows([nonzero_weights(tableau.E3), nonzero_weights(tableau.E5)])
_E3, _E5 = np.array(tableau.E3[:STAGES]), np.array(tableau.E5[:STAGES])
_curve = weighted_rows([nonzero_weights(row) for row in tableau.D])


class Flow(NamedTuple):
    """Right-hand side of the equations: its address, modes, constants, and the magnitudes to which errors are relative."""

    equation: int
    modes: NDArray[np.float64]
    p: NDArray[np.float64]
    scale: NDArray[np.float64]


@inline
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
    # the rates at these stages are computed later
    e3, e5 = k[STAGES + 1], k[STAGES + 2]
    _error(0, None, k, 1.0, e3)
    _error(1, None, k, 1.0, e5)
    sum3 = sum5 = 0.0
    for i in range(x.shape[0]):
        if not isfinite(y[i]):
            return nan
        weight = scale[i] + max(abs(x[i]), abs(y[i]))
        a, b = e3[i] / weight, e5[i] / weight
        sum3 += a * a
        sum5 += b * b
    bottom = sum5 + 0.01 * sum3
    return 0.0 if bottom == 0.0 else h * sum5 / np.sqrt(bottom * x.shape[0])


@inner
def leading_error(n, x, y, k, h, scale, lane, lanes):
    """Return the error estimate of `_local_error` for the first n components alone, in lane number ``lane`` of ``lanes``."""
    sum3 = sum5 = 0.0
    for i in range(n):
        place, e3, e5 = i * lanes + lane, 0.0, 0.0
        for s in range(STAGES):
            e3 += _E3[s] * k[s, place]
            e5 += _E5[s] * k[s, place]
        weight = scale[place] + max(abs(x[place]), abs(y[place]))
        sum3 += (e3 / weight) ** 2
        sum5 += (e5 / weight) ** 2
    bottom = sum5 + 0.01 * sum3
    return 0.0 if bottom == 0.0 else h * sum5 / np.sqrt(bottom * n)


@inner
def bounded_step_size(h, rates, reach, scale, lane, lanes):
    """Shorten a step size until no component, at its present rate, changes by more than its reach times its scale."""
    for i in range(reach.shape[0]):
        rate, most = abs(rates[i * lanes + lane]), reach[i] * scale[i * lanes + lane]
        if h * rate > most:
            h = most / rate
    return h


@inner
def step_short_of_limit(h, clearance, ahead):
    """Shorten a step size until the clearance, at its present rate, falls by no more than half; see `PROBE`.

    ``ahead`` is the clearance that the rates at the beginning of the step give after the fraction `PROBE` of the step h.
    """
    fall = clearance - ahead
    if isnan(fall):  # beyond the limit
        return PROBE * h
    return 0.5 * PROBE * h * clearance / fall if fall > 0.5 * PROBE * clearance else h


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
        _curve(r, None, k, h, f[3 + r])


@inner
def interpolate(s, x, f, out):
    """Interpolate the state at the fraction s of a step from x with the coefficients f, into ``out``."""
    for i in range(x.shape[0]):
        y = 0.0
        for r in range(7):
            y += f[6 - r, i]
            y *= s if r % 2 == 0 else 1.0 - s
        out[i] = x[i] + y
