"""Gauss-Legendre collocation on an interval of length 1 (E. Hairer, S. P. Norsett, G. Wanner, Solving ODEs I, section II.7)."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Gauss(NamedTuple):
    """Nodes, weights and matrices of a collocation method with s nodes.

    Attributes
    ----------
    nodes, weights : ndarray, shape (s,)
    integrals : ndarray, shape (s, s)
        Matrix that maps values at the nodes to the integrals, from 0 to each node, of the polynomial through these values.
    coefficients : ndarray, shape (s, s)
        Matrix that maps values at the nodes to the coefficients of Legendre's polynomials on -1 to 1.
    """

    nodes: FloatArray
    weights: FloatArray
    integrals: FloatArray
    coefficients: FloatArray


@cache
def gauss(count: int) -> Gauss:
    """Compute the nodes, weights and matrices for a number of nodes."""
    roots, weights = legendre.leggauss(count)
    values = legendre.legvander(roots, count)
    coefficients = (np.arange(count)[:, None] + 0.5) * (values[:, :count] * weights[:, None]).T
    integrals = 0.5 * values @ legendre.legint(np.eye(count), lbnd=-1.0, axis=0) @ coefficients
    return Gauss(0.5 * (roots + 1.0), 0.5 * weights, np.ascontiguousarray(integrals), coefficients)
