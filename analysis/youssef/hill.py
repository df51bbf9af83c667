"""Linear equations with periodic coefficients, a y'' + b y' + (c + lambda s) y = 0 with period 2 pi (Youssef, chapter V).

Three methods determine their stability and share only the coefficients: integration of the monodromy matrix (`monodromies`),
Hill's infinite determinant truncated at an order (`hill_multipliers`, `boundary_stiffnesses`), and perturbation for small
harmonics (`perturbed_boundary`, `perturbed_region`).

A region of parametric instability has a number N. If the harmonics of the coefficients vanish, the region shrinks to the
stiffness at which the natural frequency is N/2 times the frequency of the coefficients. On its boundaries one Floquet
multiplier is (-1)^N.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import ceil, pi

import numpy as np
import scipy
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..numerics.fourier import FourierSeries
from ..numerics.gauss import gauss
from ..periodic import liouville, require_sign

#: Number of Gauss points of a step: the method is of order 12.
STAGES = 6
#: Greatest product of step (rad) and rate of the equation (1/rad) for which the error over a period is only rounding.
STEP_BY_RATE = 0.5
#: Least number of samples per period from which the rate of the equation is estimated.
JUDGED = 64
#: The default order of Hill's determinant is twice the order of the coefficients plus this number.
MORE_HARMONICS = 16
#: A boundary counts as real if its imaginary part is at most this times its magnitude, or at most this if the magnitude is
#: below 1. Two boundaries that nearly coincide are accurate only to the square root of the rounding error.
REAL = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeriodicEquation:
    """The equation a y'' + b y' + c y = 0, ' = d/dx, with coefficients of period 2 pi.

    Attributes
    ----------
    a, b, c : FourierSeries
        The coefficients; ``a`` must keep one sign and not be zero.
    factor : FourierSeries
        s, by which `stiffened` multiplies the stiffness lambda: 1, except in the thesis's equation, where s is periodic.
    """

    a: FourierSeries
    b: FourierSeries
    c: FourierSeries
    factor: FourierSeries = field(default=FourierSeries.constant(1.0))

    @classmethod
    def mathieu(cls, p: float, q: float, damping: float = 0.0) -> PeriodicEquation:
        """Return Mathieu's equation y'' + damping y' + (p - 2 q cos 2 t) y = 0 in x = 2 t, with coefficients of period 2 pi."""
        return cls(
            a=FourierSeries.constant(4.0),
            b=FourierSeries.constant(2.0 * damping),
            c=FourierSeries(np.array([p, -2.0 * q]), np.zeros(2)),
        )

    @property
    def order(self) -> int:
        """Order of the highest harmonic of the coefficients."""
        return max(series.order for series in (self.a, self.b, self.c, self.factor))

    def stiffened(self, stiffness: float) -> PeriodicEquation:
        """Return the equation with c + lambda s in place of c, where lambda is ``stiffness``."""
        return replace(self, c=self.c + stiffness * self.factor)


class SingularEquationError(InputError):
    """The coefficient of y'' passes through zero, where the equation is not of second order."""


# Floquet


@lru_cache(maxsize=32)
def _waves(points: tuple[float, ...], order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return cos(k x) and sin(k x) at points x for k = 0 to ``order``, two arrays of shape (order + 1, number of points)."""
    phase = np.multiply.outer(np.arange(order + 1), np.array(points))
    return np.cos(phase), np.sin(phase)


def _table(series: Sequence[FourierSeries], order: int) -> NDArray[np.float64]:
    """Return the cosine and sine coefficients of n series, padded with zeros to the same order; shape (2, n, order + 1)."""
    table = np.zeros((2, len(series), order + 1))
    for i, one in enumerate(series):
        table[0, i, : one.order + 1], table[1, i, : one.order + 1] = one.cos, one.sin
    return table


def _slope(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Differentiate the series of a table (see `_table`); return the table of the derivatives."""
    k = np.arange(table.shape[2])
    return np.array([k * table[1], -k * table[0]])


def _sample_series(table: NDArray[np.float64], points: tuple[float, ...]) -> NDArray[np.float64]:
    """Return the values of the n series of a table (see `_table`) at given points, shape (n, number of points)."""
    cos, sin = _waves(points, table.shape[2] - 1)
    return table[0] @ cos + table[1] @ sin


def _tables(equations: Sequence[PeriodicEquation]) -> list[NDArray[np.float64]]:
    """Return the coefficient tables of a, a', b and c, each for all equations (see `_table`)."""
    order = max(e.order for e in equations)
    a, b, c = (_table([getattr(e, name) for e in equations], order) for name in "abc")
    return [a, _slope(a), b, c]


def _even_steps(count: int) -> tuple[float, ...]:
    return tuple((2.0 * pi / count * np.arange(count)).tolist())


def _steps(tables: Sequence[NDArray[np.float64]]) -> int:
    """Return the number of steps per period (2 pi) that reduces the integration error to rounding."""
    k = np.arange(tables[0].shape[2])
    points = _even_steps(max(JUDGED, 4 * len(k)))
    a, slope, b, c = (_sample_series(table, points) for table in tables)
    sign = np.sign(a[:, :1])
    if not (a * sign > 0.0).all():
        worst = int(np.argmin((a * sign).min(axis=1)))
        raise SingularEquationError(
            f"the coefficient of y'' passes zero in equation {worst}: its order is not 2 throughout"
        )
    # a harmonic k of relative size e leaves an error of e (k h)^12
    sizes = [np.hypot(*table).max(axis=0) for table in (tables[0], *tables[2:])]
    harmonics = max(float((k * (size / size.max()) ** (0.5 / STAGES)).max()) for size in sizes if size.max() > 0.0)
    fastest: float = max(np.sqrt(np.abs(c / a)).max(), np.abs((slope - b) / a).max(), harmonics, 1.0)
    return ceil(2.0 * pi * fastest / STEP_BY_RATE)


def monodromies(equations: Sequence[PeriodicEquation], *, steps: int | None = None) -> NDArray[np.float64]:
    """Return the monodromy matrices of n equations, which map (y, y') at x = 0 to (y, y') at x = 2 pi.

    The integration by Gauss-Legendre collocation of order 12 on (y, a y') keeps the determinant at 1 if the equation is
    self-adjoint (b = a').

    Parameters
    ----------
    equations : sequence of PeriodicEquation
    steps : int, optional
        Steps per period; by default enough to reduce the error to rounding.

    Returns
    -------
    ndarray, shape (n, 2, 2)

    Raises
    ------
    InputError
        If there is no equation, or the number of steps is not positive.
    SingularEquationError
        If a coefficient of y'' passes through zero.
    """
    if not equations:
        raise InputError("at least one equation is needed")
    if steps is not None and steps < 1:
        raise InputError(f"steps is {steps}: it must be at least 1")
    tables = _tables(equations)
    least = _steps(tables)
    count = least if steps is None else steps
    nodes, weights, matrix, _ = gauss(STAGES)
    h = 2.0 * pi / count
    points = tuple((h * np.add.outer(np.arange(count), nodes)).ravel().tolist())
    shape = (len(equations), count, STAGES)
    a, slope, b, c = (_sample_series(table, points).reshape(shape) for table in tables)
    # z = (y, a y'): z' = A z
    system = np.zeros((*shape, 2, 2))
    system[..., 0, 1] = 1.0 / a
    system[..., 1, 0] = -c
    system[..., 1, 1] = (slope - b) / a
    # stages Y_i = 1 + h sum_j a_ij A_j Y_j of a step, solved together
    turned = np.moveaxis(system, 2, 3)[:, :, None]
    blocks = np.eye(2 * STAGES).reshape(STAGES, 2, STAGES, 2) - h * matrix[:, None, :, None] * turned
    right = np.broadcast_to(np.tile(np.eye(2), (STAGES, 1)), (*shape[:2], 2 * STAGES, 2))
    stages = np.linalg.solve(blocks.reshape(*shape[:2], 2 * STAGES, 2 * STAGES), right).reshape(*shape, 2, 2)
    passed = np.eye(2) + h * (weights[:, None, None] * (system @ stages)).sum(axis=2)
    result = passed[:, 0]
    for step in range(1, count):
        result = passed[:, step] @ result
    # back to (y, y'): a has the same value at both ends
    ends = tables[0][0].sum(axis=1)
    result = np.array(result, dtype=float)
    result[:, 0, 1] *= ends
    result[:, 1, 0] /= ends
    return result


def monodromy(equation: PeriodicEquation, *, steps: int | None = None) -> NDArray[np.float64]:
    """Return the monodromy matrix of one equation, shape (2, 2); see `monodromies`."""
    return monodromies([equation], steps=steps)[0]


def determinant(equation: PeriodicEquation) -> float:
    """Return the determinant of the monodromy matrix by Liouville's formula, exp(-integral of b/a)."""
    points = _even_steps(max(4 * JUDGED, 16 * equation.order))
    a, b = _sample_series(_table([equation.a, equation.b], equation.order), points)
    return liouville(-b / a)


# Hill


def _toeplitz(series: FourierSeries, size: int) -> NDArray[np.complex128]:
    """Return the matrix that multiplies a function, given by its coefficients of exp(i k x), by a series.

    Entry (n, k) is coefficient n - k of the series; the shape is (size, size).
    """
    index = np.arange(size)
    return series.to_order(size).exponential[size + index[:, None] - index]


def _harmonics(multiplier: int, order: int) -> NDArray[np.float64]:
    """Return the harmonic numbers k, symmetric about 0, up to ``order``.

    They are whole numbers for the multiplier +1 (period 2 pi), half-integers for the multiplier -1 (period 4 pi).
    """
    count, first = (2 * order + 1, -order) if multiplier == 1 else (2 * order, -order + 0.5)
    return first + np.arange(count, dtype=float)


def _order(equation: PeriodicEquation, order: int | None, more: int = 0) -> int:
    """Return the highest harmonic of Hill's determinant: ``order`` if given, otherwise the equation's default plus ``more``."""
    if order is None:
        return 2 * equation.order + MORE_HARMONICS + more
    if order < 1:
        raise InputError(f"order is {order}: it must be at least 1")
    return order


def operator(equation: PeriodicEquation, k: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the matrix of the operator a D^2 + b D + c in the basis exp(i k x), k in steps of 1; shape (len(k), len(k))."""
    a, b, c = (_toeplitz(series, len(k)) for series in (equation.a, equation.b, equation.c))
    return -a * k**2 + 1j * b * k + c


def hill_multipliers(equation: PeriodicEquation, *, order: int | None = None) -> NDArray[np.complex128]:
    """Return both Floquet multipliers from Hill's quadratic eigenvalue problem, the larger modulus first.

    y = exp(s x) sum over k of y_k exp(i k x) gives (s^2 A + s B + C) y_k = 0. If s is an eigenvalue of the infinite problem, so
    is s + i n for every whole n, with the same multiplier exp(2 pi s). Truncation spoils the eigenvectors that reach the
    highest harmonics; the multipliers are therefore taken from eigenvectors centred on low harmonics.

    Parameters
    ----------
    equation : PeriodicEquation
    order : int, optional
        Highest harmonic.

    Returns
    -------
    ndarray of complex, shape (2,)
    """
    n = _order(equation, order)
    k = _harmonics(1, n)
    mass, rate = (_toeplitz(series, len(k)) for series in (equation.a, equation.b))
    linear = 2j * mass * k + rate
    companion = np.block(
        [
            [np.zeros_like(mass), np.eye(len(k))],
            [-np.linalg.solve(mass, operator(equation, k)), -np.linalg.solve(mass, linear)],
        ]
    )
    exponents, vectors = np.linalg.eig(companion)
    weights = np.abs(vectors[: len(k)]) ** 2
    centres = np.abs(k @ weights / weights.sum(axis=0))
    order_of_centres = np.argsort(centres)
    values = np.exp(2.0 * pi * exponents)
    first = values[order_of_centres[0]]
    # the eigenvectors in the middle have only two different multipliers
    middle = values[centres <= max(0.25 * n, np.sort(centres)[3])]
    second = middle[np.argmax(np.abs(middle - first))]
    pair = np.array([first, second])
    return pair[np.argsort(-np.abs(pair), kind="stable")]


def boundary_stiffnesses(
    equation: PeriodicEquation, multiplier: int, *, count: int, order: int | None = None
) -> NDArray[np.complex128]:
    """Return the stiffnesses lambda at which one Floquet multiplier is +1 or -1, as eigenvalues; eq (5.35).

    Parameters
    ----------
    equation : PeriodicEquation
        Equation with a > 0. Damping that removes a region turns the region's two boundaries into a complex pair.
    multiplier : int
        +1 or -1.
    count : int
        Number of stiffnesses to return: those with the least real parts.
    order : int, optional
        Highest harmonic.

    Returns
    -------
    ndarray of complex, shape (count,)
        Sorted by their real parts.

    Raises
    ------
    InputError
        If the multiplier is neither +1 nor -1, or the order is too low for the count.
    """
    require_sign(multiplier)
    k = _harmonics(multiplier, _order(equation, order, count))
    if not 1 <= count <= len(k):
        raise InputError(f"count is {count}: {len(k)} harmonics give 1 to {len(k)} boundaries")
    matrix = -operator(equation, k)
    if equation.factor.order:
        found = scipy.linalg.eigvals(matrix, _toeplitz(equation.factor, len(k)))
    else:
        matrix = matrix / equation.factor.mean
        hermitian = np.abs(matrix - matrix.conj().T).max() <= 1e-13 * np.abs(matrix).max()
        found = np.linalg.eigvalsh(matrix) if hermitian else np.linalg.eigvals(matrix)
    values: NDArray[np.complex128] = found.astype(np.complex128)
    return values[np.argsort(values.real, kind="stable")][:count]


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """A region of parametric instability on the axis of the stiffness lambda.

    Attributes
    ----------
    number : int
        N; the multiplier on the boundaries is (-1)^N.
    low, high : float
        Stiffnesses of the boundaries.
    """

    number: int
    low: float
    high: float

    @property
    def width(self) -> float:
        """Difference of the stiffnesses of the two boundaries."""
        return self.high - self.low


def hill_regions(equation: PeriodicEquation, count: int) -> Mapping[int, Region]:
    """Return the regions of instability N = 1 to ``count`` that damping has not removed, by their number N.

    Parameters
    ----------
    equation : PeriodicEquation
        Equation with a > 0.
    count : int
        Number of the last region.
    """
    found = {}
    for multiplier in (1, -1):
        # the least boundary of the multiplier +1 is single: below it the motion diverges
        alone = 1 if multiplier == 1 else 0
        values = boundary_stiffnesses(equation, multiplier, count=count + 2 + alone)[alone:]
        for pair in range((count + 1) // 2 if multiplier == -1 else count // 2):
            low, high = values[2 * pair : 2 * pair + 2]
            number = 2 * pair + (1 if multiplier == -1 else 2)
            if max(abs(low.imag), abs(high.imag)) <= REAL * max(1.0, abs(high)):
                found[number] = Region(number=number, low=float(low.real), high=float(high.real))
    return dict(sorted(found.items()))


# Perturbation


def _perturb_boundaries(equation: PeriodicEquation, number: int, order: int) -> NDArray[np.complex128]:
    """Return the boundaries of the region N: one for N = 0, else two.

    The two boundaries are a complex pair if damping has removed the region.

    On the harmonics exp(i k x) the equation is (V - lambda S) y = 0. To first order only the harmonics k = +-N/2 matter. To
    second order the other harmonics q subtract the sum of (V_jq - lambda S_jq) (V_qk - lambda S_qk) / (V_qq - lambda S_qq), in
    which lambda is the solution for constant coefficients equal to the means.
    """
    if order not in (1, 2):
        raise InputError(f"region {number} to order {order}: the order is 1 or 2")
    if not (equation.a.mean > 0.0 and equation.factor.mean > 0.0):
        raise InputError(
            f"the means of M and S are {equation.a.mean} and {equation.factor.mean}: they must be positive"
        )
    n, size = 0.5 * number, equation.order
    k = np.arange(-(size + number), size + 1.0) + n
    v, s = -operator(equation, k), _toeplitz(equation.factor, len(k))
    k0, s0 = equation.a.mean, equation.factor.mean
    start = (k0 * n * n - equation.c.mean) / s0
    inside = np.abs(k) == n
    left = v - start * s
    if order == 1:
        # a harmonic of S is multiplied by lambda for constant coefficients
        near, weight = left[np.ix_(inside, inside)] / s0 + start * np.eye(inside.sum()), None
    else:
        others = ~inside
        through = left[np.ix_(inside, others)] / (k0 * (k[others] ** 2 - n * n)) @ left[np.ix_(others, inside)]
        near, weight = v[np.ix_(inside, inside)] - through, s[np.ix_(inside, inside)]
    return scipy.linalg.eigvals(near, weight)


def perturbed_boundary(equation: PeriodicEquation, *, order: int = 2) -> float:
    """Return the stiffness of boundary 0, below which the motion diverges, by perturbation for small harmonics.

    This is eq (5.13) to second order.

    Raises
    ------
    InputError
        If the order is neither 1 nor 2, or the mean of a or of the factor is not positive.
    """
    return float(_perturb_boundaries(equation, 0, order)[0].real)


def perturbed_region(equation: PeriodicEquation, number: int, *, order: int = 2) -> Region | None:
    """Return the region N, for small harmonics of the coefficients, by perturbation.

    For (M y')' + lambda_c y' + (lambda + K) y = 0 to first order::

        lambda = k0 N^2/4 - K0 -+ sqrt(|N^2/4 M_N + K_N|^2 - (N lambda_c/2)^2),

    where k0 and K0 are the means of M and K, and M_N and K_N their complex coefficients of exp(i N x). Without damping this is
    eq (5.16) for N = 1; to second order it is eq (5.26) for N = 2. The thesis derives these equations by Lindstedt's method;
    the degenerate perturbation of Hill's matrix used here gives the same series.

    Parameters
    ----------
    equation : PeriodicEquation
        The damping is assumed to be of the same order as half the width of the region.
    number : int
        N, from 1; for N = 0 see `perturbed_boundary`.
    order : int
        Order of the perturbation, 1 or 2.

    Returns
    -------
    Region or None
        None where the damping has removed the region.

    Raises
    ------
    InputError
        As for `perturbed_boundary`, or if the number is not positive.
    """
    if number < 1:
        raise InputError(f"region {number}: regions count from 1")
    ends = np.sort_complex(_perturb_boundaries(equation, number, order))
    if np.abs(ends.imag).max() > REAL * max(1.0, float(np.abs(ends).max())):
        return None
    return Region(number=number, low=float(ends[0].real), high=float(ends[1].real))


def perturbed_removing_damping(equation: PeriodicEquation, number: int) -> float:
    """Return the damping lambda_c that removes the region N of an undamped equation: the region's width divided by N.

    The factor of lambda_c in the equation is assumed to have the same mean as s, the factor of the stiffness.
    """
    region = perturbed_region(equation, number)
    return region.width / number if region else 0.0
