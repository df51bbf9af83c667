"""Points that fill a unit cube evenly: scrambled Sobol sequences."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Primitive polynomials (degree and coefficients as bits) and first direction numbers of the dimensions from the second on:
#: Joe and Kuo, SIAM Journal on Scientific Computing 30 (2008).
_DIRECTIONS = (
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
    (5, 4, (1, 1, 5, 5, 5)),
    (5, 7, (1, 1, 7, 11, 19)),
)
_BITS = 30


def sobol(size: int, count: int, number: int) -> NDArray[np.float64]:
    """The first points of the scrambled Sobol sequence with a number, shape (count, size).

    They are those of ``scipy.stats.qmc.Sobol(size, rng=number)``, whose import takes longer than finding all motions from
    them; it is asked where there are more dimensions than the table has.

    >>> sobol(2, 4, 0).shape
    (4, 2)
    """
    if size > len(_DIRECTIONS) + 1:
        from scipy.stats import qmc

        return np.asarray(qmc.Sobol(size, rng=number).random(count))
    generator = np.random.default_rng(number).spawn(1)[0]
    places = np.arange(_BITS)
    shift = generator.integers(2, size=(size, _BITS)) @ (1 << places)
    lower = np.tril(generator.integers(2, size=(size, _BITS, _BITS)), -1) + np.eye(_BITS, dtype=int)
    # bits of the direction numbers (dimension, number, bit), the highest first, and the same scrambled
    bits = np.stack([_direction_numbers(dimension) for dimension in range(size)])[..., None] >> places[::-1] & 1
    directions = np.einsum("dpk,djk->djp", lower, bits) % 2 @ (1 << places[::-1])
    # the number of a point in Gray code says which of them are combined
    points = np.arange(count)
    chosen = (points ^ points >> 1)[:, None] >> places & 1
    return np.asarray((np.bitwise_xor.reduce(chosen[:, None] * directions, axis=2) ^ shift) / 2.0**_BITS)


def _direction_numbers(dimension: int) -> NDArray[np.int64]:
    """Of a dimension, each with its highest bit at the same place."""
    degree, coefficients, first = _DIRECTIONS[dimension - 1] if dimension else (0, 0, ())
    m = list(first) or [1] * _BITS
    while len(m) < _BITS:
        value = m[-degree] ^ m[-degree] << degree
        for k in range(1, degree):
            value ^= (coefficients >> degree - 1 - k & 1) * m[-k] << k
        m.append(value)
    return np.array(m) << np.arange(_BITS)[::-1]
