"""Find special points of a driven oscillator by Fourier collocation, and expand its map over a period as a Taylor series.

The analyses find where a multiplier passes the unit circle by integration over a period. Nothing here integrates to find it: a
motion of n turns is represented by its values at equal steps of the crank angle th, its derivatives are those of the
trigonometric polynomial through these values, and

    J W^2 x'' + c W x' + g(x, th) = 0

holds at every step. At a fold the linearised equation has a periodic solution v, at a period doubling an antiperiodic solution;
motion, v and parameter are solved for together. The series of the map, for the normal forms, follow from the equation itself
with x as a polynomial in the deviations at the start.
"""

from collections.abc import Callable
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tests.mechanisms.torsion.equations import Constants

Vector = NDArray[np.float64]
#: Function of the parameter's value that returns the crank speed and the constants of the equation.
Law = Callable[[float], tuple[float, Constants]]


class Found(NamedTuple):
    """A special point: parameter, motion at equal steps of the crank angle, residual."""

    parameter: float
    motion: Vector
    residual: float


def special_point(law: Law, motion: Vector, value: float, turns: int, *, antiperiodic: bool) -> Found:
    """Return the fold, or with ``antiperiodic`` the period doubling, near a motion.

    ``motion`` is given at equal steps of its period of ``turns`` turns; ``value`` is the parameter there.
    """
    n = len(motion)
    angle = 2.0 * pi * turns * np.arange(n) / n
    first, second = (_derivative(n, turns, order, 0.0) for order in (1, 2))
    across = [_derivative(n, turns, order, 0.5 if antiperiodic else 0.0) for order in (1, 2)]

    def equation(x: Vector, value: float) -> Vector:
        w, p = law(value)
        spring = (p.stiffness + p.modulation * np.cos(angle)) * x + p.cubic * x**3 + p.weight * np.sin(x)
        return p.inertia * w * w * second @ x + p.damping * w * first @ x + spring - p.excitation * np.cos(angle)

    def linear(x: Vector, value: float, first: Vector, second: Vector) -> Vector:
        w, p = law(value)
        slope = p.stiffness + p.modulation * np.cos(angle) + 3.0 * p.cubic * x**2 + p.weight * np.cos(x)
        return p.inertia * w * w * second + p.damping * w * first + np.diag(slope)

    def bend(x: Vector, value: float) -> Vector:
        p = law(value)[1]
        return 6.0 * p.cubic * x - p.weight * np.sin(x)

    x, step = motion.copy(), 1e-6 * abs(value)
    v = np.linalg.svd(linear(x, value, *across))[2][-1]
    residual = np.inf
    for _ in range(12):
        matrix = np.zeros((2 * n + 1, 2 * n + 1))
        matrix[:n, :n] = linear(x, value, first, second)
        matrix[:n, -1] = (equation(x, value + step) - equation(x, value - step)) / (2.0 * step)
        matrix[n:-1, :n] = np.diag(bend(x, value) * v)
        matrix[n:-1, n:-1] = linear(x, value, *across)
        beside = [linear(x, value + s, *across) @ v for s in (step, -step)]
        matrix[n:-1, -1] = (beside[0] - beside[1]) / (2.0 * step)
        matrix[-1, n:-1] = 2.0 * v
        right = np.concatenate([equation(x, value), linear(x, value, *across) @ v, [v @ v - 1.0]])
        change = np.linalg.solve(matrix, -right)
        x, v, value = x + change[:n], v + change[n:-1], value + float(change[-1])
        if abs(float(change[-1])) < 1e-13 * abs(value):
            residual = float(np.abs(change).max())
            break
    return Found(value, x, residual)


def _derivative(n: int, turns: int, order: int, shift: float) -> Vector:
    """Return the matrix of the derivative over the crank angle for values at n steps of a period.

    ``shift`` is 0 for periodic functions and 0.5 for antiperiodic ones.
    """
    wave = (np.fft.fftfreq(n, 1.0 / n) + shift) / turns
    twist = np.exp(2j * pi * shift * np.arange(n) / n)[:, None]
    spectrum = np.fft.fft(np.eye(n) * twist.conj(), axis=0)
    return (twist * np.fft.ifft((1j * wave[:, None]) ** order * spectrum, axis=0)).real


#: Powers (i, j) of the two deviations in the terms of a series, up to order 3.
POWERS = tuple((i, j) for i in range(4) for j in range(4 - i))


#: 1 where the product of two terms (last two indices) belongs to a term (first index), else 0: shape (terms, terms, terms).
_TIMES = np.array([[[(a + c, b + d) == e for c, d in POWERS] for a, b in POWERS] for e in POWERS], dtype=float)


def _product(a: Vector, b: Vector) -> Vector:
    """Return the product of two series."""
    result: Vector = _TIMES @ b @ a
    return result


def series(p: Constants, w: float, start: Vector, directions: Vector, turns: int) -> Vector:
    """Return x and x' after a period as series in two deviations of the start; shape (2, number of `POWERS`).

    Parameters
    ----------
    start : ndarray, shape (2,)
    directions : ndarray, shape (2, 2)
        The columns are the directions of the two deviations.
    """
    size = len(POWERS)
    initial = np.zeros((2, size))
    initial[:, POWERS.index((0, 0))] = start
    initial[:, POWERS.index((1, 0))], initial[:, POWERS.index((0, 1))] = directions.T
    zero = POWERS.index((0, 0))

    def rates(t: float, z: Vector) -> Vector:
        x, v = z.reshape(2, size)
        away = x.copy()
        away[zero] = 0.0
        square = _product(away, away)
        cube = _product(square, away)
        sine = np.sin(x[zero]) * (np.eye(size)[zero] - square / 2.0) + np.cos(x[zero]) * (away - cube / 6.0)
        force = -p.damping * v - (p.stiffness + p.modulation * np.cos(w * t)) * x - p.weight * sine
        force -= p.cubic * _product(_product(x, x), x)
        force[zero] += p.excitation * np.cos(w * t)
        return np.concatenate([v, force / p.inertia])

    span = (0.0, 2.0 * pi * turns / w)
    run = solve_ivp(rates, span, initial.ravel(), method="DOP853", rtol=1e-11, atol=1e-13)
    return run.y[:, -1].reshape(2, size)


def _in_eigenvectors(
    p: Constants, w: float, start: Vector, turns: int, scale: Vector, multiplier: float
) -> NDArray[np.float64]:
    """Return the series of the map in the coordinates along its eigenvectors, first the one whose eigenvalue is nearest."""
    linear = series(p, w, start, np.diag(scale), turns)[:, [POWERS.index(k) for k in ((1, 0), (0, 1))]] / scale[:, None]
    values, vectors = np.linalg.eig(linear)
    basis = vectors.real[:, np.argsort(np.abs(values.real - multiplier))]
    return np.linalg.solve(basis, series(p, w, start, scale[:, None] * basis, turns) / scale[:, None])


def cubic_coefficient(p: Constants, w: float, start: Vector, turns: int, scale: Vector) -> float:
    """Return the coefficient c of the normal form s -> -s + c s^3 of the map at a period doubling, with s scaled by ``scale``.

    The map is reduced to its centre manifold, the graph s -> s q + h s^2 r over the eigenvectors q of -1 and r of the other
    multiplier. The condition that the map takes the manifold to itself determines h and c.
    """
    after = _in_eigenvectors(p, w, start, turns, scale, -1.0)

    def part(row: int, i: int, j: int) -> float:
        return float(after[row, POWERS.index((i, j))])

    # r' = mu r + a s^2, s' = -s + ...: h (s')^2 = h s^2 = mu h s^2 + a s^2
    h = part(1, 2, 0) / (1.0 - part(1, 0, 1))
    # s' = -s + b s^2 + (C + d h) s^3; the square is removed by s -> s + e s^2 with e = b / 2
    b = part(0, 2, 0)
    return part(0, 3, 0) + part(0, 1, 1) * h + b * b


def curvature_at_fold(p: Constants, w: float, start: Vector, turns: int, scale: Vector) -> float:
    """Return half the second derivative of the map along the eigenvector of 1, projected onto it along the other eigenvector.

    Its sign depends on the sign of the eigenvector.
    """
    after = _in_eigenvectors(p, w, start, turns, scale, 1.0)
    return float(after[0, POWERS.index((2, 0))])
