"""Take a step of the integrator in all lanes of the processor at once, for ensembles and periodic motions.

The method is DOP853 as in `stepping`. Arrays are in lanes (`numerics.vectors`): states, scales, the rates k[s] at the stages,
the coefficients f[r] of the interpolant. Step sizes, errors and fractions are one number for each lane. A product is
added with one rounding instead of two (fused multiply-add), so that results differ from `stepping` in the last digits.
"""

from __future__ import annotations

import numpy as np

from linkwork import tableau

from ..numerics.codegen import inner
from ..numerics.vectors import LANES, absolute, greater, load, multiply_add, spread, square_root, store
from .stepping import STAGES

#: Replaces a sum of squares that is zero.
_LEAST = 1e-300
# the weights in stage s are _WEIGHT[_ROW[s]:_ROW[s + 1]], of the rates at the stages _FROM[_ROW[s]:_ROW[s + 1]]
_ROW = np.cumsum([0, *(len(row) for row in tableau.A)])
_FROM = np.array([stage for row in tableau.A for stage, _ in row])
_WEIGHT = np.array([weight for row in tableau.A for _, weight in row])
# numbers of the stages that the error and the interpolant use, and their weights
_OF_ERROR = np.flatnonzero(np.any([tableau.E3, tableau.E5], axis=0))
_E3, _E5 = np.array([tableau.E3, tableau.E5])[:, _OF_ERROR].copy()
_OF_CURVE = np.flatnonzero(np.any(tableau.D, axis=0))
_D0, _D1, _D2, _D3 = np.array(tableau.D)[:, _OF_CURVE].copy()


@inner
def stage_in_lanes(s, x, k, h, y):
    """Compute the states y at stage s of steps of sizes h from x, from the rates k; stage 12 is the end of the step."""
    step = load(h, 0)
    for i in range(x.shape[0] // LANES):
        total = 0.0 * step
        for j in range(_ROW[s], _ROW[s + 1]):
            total = multiply_add(_WEIGHT[j], load(k[_FROM[j]], i), total)
        store(y, i, multiply_add(step, total, load(x, i)))


@inner
def errors_in_lanes(x, y, k, h, scale, errors):
    """Write Hairer's error estimates of order 8 for steps from x to y, relative to scale plus state; NaN if y is not finite."""
    step = load(h, 0)
    sum3, sum5, valid = 0.0 * step, 0.0 * step, 0.0 * step
    n = x.shape[0] // LANES
    for i in range(n):
        e3, e5, end = 0.0 * step, 0.0 * step, load(y, i)
        for j in range(_OF_ERROR.shape[0]):
            rate = load(k[_OF_ERROR[j]], i)
            e3, e5 = multiply_add(_E3[j], rate, e3), multiply_add(_E5[j], rate, e5)
        weight = 1.0 / (load(scale, i) + greater(absolute(load(x, i)), absolute(end)))
        e3, e5, valid = e3 * weight, e5 * weight, multiply_add(0.0, end, valid)
        sum3, sum5 = multiply_add(e3, e3, sum3), multiply_add(e5, e5, sum5)
    bottom = greater(float(n) * (sum5 + 0.01 * sum3), 0.0 * step + _LEAST)
    store(errors, 0, step * sum5 / square_root(bottom) + valid)


@inner
def interpolants_in_lanes(x, y, k, h, f):
    """Compute the coefficients f of the interpolants between x and y (Hairer's contd8); k has the rates at all 16 stages."""
    step = load(h, 0)
    for i in range(x.shape[0] // LANES):
        delta, first = load(y, i) - load(x, i), step * load(k[0], i)
        store(f[0], i, delta)
        store(f[1], i, first - delta)
        store(f[2], i, 2.0 * delta - (step * load(k[STAGES], i) + first))
        a = b = c = d = 0.0 * step
        for j in range(_OF_CURVE.shape[0]):
            rate = load(k[_OF_CURVE[j]], i)
            a, b, c, d = (
                multiply_add(_D0[j], rate, a),
                multiply_add(_D1[j], rate, b),
                multiply_add(_D2[j], rate, c),
                multiply_add(_D3[j], rate, d),
            )
        store(f[3], i, step * a)
        store(f[4], i, step * b)
        store(f[5], i, step * c)
        store(f[6], i, step * d)


@inner
def interpolate_in_lanes(fractions, x, f, out):
    """Interpolate the states at fractions of the steps into the rows of ``out``, one for each lane."""
    after = load(fractions, 0)
    before = 1.0 - after
    for i in range(x.shape[0] // LANES):
        total = (load(f[6], i) * after + load(f[5], i)) * before
        total = ((total + load(f[4], i)) * after + load(f[3], i)) * before
        total = ((total + load(f[2], i)) * after + load(f[1], i)) * before
        spread(out, i, multiply_add(total + load(f[0], i), after, load(x, i)))
