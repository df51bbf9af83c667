"""Evaluate and sort the samples of a Monte Carlo analysis: compiled kernels."""

from __future__ import annotations

import numpy as np
from numba import boolean, float64, int64, types

from ..numerics.codegen import MATRIX, VECTOR, evaluate, inner, kernel

_PURPOSE = "the Monte Carlo analysis"


@inner
def _repeat(numbers, lanes, target):
    """Write each number once for each lane."""
    for i in range(numbers.shape[0] * lanes):
        target[i] = numbers[i // lanes]


@kernel(types.UniTuple(int64, 2)(int64, int64, VECTOR, VECTOR, MATRIX, float64, MATRIX), purpose=_PURPOSE)
def evaluate_samples(code, lanes, nominal, values, errors, least_lever, out):
    """Evaluate samples at one crank angle, ``lanes`` at once; write the results of usable samples into ``out``.

    ``code`` is the address of a function of the motion ``nominal``, the errors of a sample (a column of ``errors``) and the
    parameters ``values``. Its results become a column of ``out``. The last result is not negative if the sample can be
    assembled; the result before it is the lever arm. A sample is usable if it can be assembled and the magnitude of its
    lever arm is above ``least_lever``. Returns the number of samples that cannot be assembled, and the number of the others
    that are not usable.
    """
    m, n, k = errors.shape[0], errors.shape[1], out.shape[0]
    a, b, c = np.empty(nominal.shape[0] * lanes), np.zeros(m * lanes), np.empty(values.shape[0] * lanes)
    results = np.empty(k * lanes)
    _repeat(nominal, lanes, a)
    _repeat(values, lanes, c)
    count = missed = dead = 0
    for start in range(0, n, lanes):
        used = min(lanes, n - start)
        for e in range(m):
            for lane in range(used):
                b[e * lanes + lane] = errors[e, start + lane]
        evaluate(code, 0.0, a, b, c, c, results)
        for lane in range(used):
            # not "< 0", so that NaN counts as not assembled
            if not results[(k - 1) * lanes + lane] >= 0.0:
                missed += 1
            elif not abs(results[(k - 2) * lanes + lane]) > least_lever:
                dead += 1
            else:
                for q in range(k):
                    out[q, count] = results[q * lanes + lane]
                count += 1
    return missed, dead


@kernel((VECTOR, float64, float64, int64[::1]), purpose=_PURPOSE)
def count_in_bins(values, low, high, counts):
    """Count the values in equal bins from ``low`` to ``high``, both included; values outside are left out."""
    bins = counts.shape[0]
    width = (high - low) / bins
    for x in values:
        if low <= x <= high:
            counts[min(int((x - low) / width), bins - 1)] += 1


@kernel(int64(VECTOR, float64, float64, boolean[::1], VECTOR), purpose=_PURPOSE)
def collect_bins(values, low, high, wanted, out):
    """Copy the values in the wanted bins into ``out``; return their number. The bins are those of `count_in_bins`."""
    count, bins = 0, wanted.shape[0]
    width = (high - low) / bins
    for x in values:
        if wanted[min(int((x - low) / width), bins - 1)]:
            out[count] = x
            count += 1
    return count
