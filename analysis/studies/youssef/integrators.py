"""Integration methods of section 3.1 on equations with known solutions: order, stable steps, and spurious roots."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import exp, factorial, log2
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from ...run import Hamming

#: Stages of the classical method: time as a fraction of the step, and weight in sixths. `SLIP` has a slip: its last
#: stage is at mid-step.
CLASSICAL = ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0))
SLIP = (*CLASSICAL[:3], (0.5, 1.0))


def runge_kutta(
    f: Callable[[float, NDArray[Any]], NDArray[Any]],
    y: ArrayLike,
    h: float,
    n: int,
    stages: tuple[tuple[float, float], ...] = CLASSICAL,
) -> NDArray[Any]:
    """Integrate y' = f(t, y) from t = 0 by n steps of length h of the classical Runge-Kutta method; return all states.

    ``stages`` gives for each stage its time as a fraction of the step, and its weight in sixths.
    """
    states = [np.asarray(y)]
    for i in range(n):
        y0 = states[-1]
        slope = total = np.zeros_like(y0)
        for at, weight in stages:
            slope = f((i + at) * h, y0 + at * h * slope)
            total = total + weight * slope
        states.append(y0 + h / 6.0 * total)
    return np.array(states)


@cache
def stable_steps(rate: complex, steps: int = 400) -> tuple[float, float]:
    """Return the greatest stable steps for y' = ``rate`` y by Runge-Kutta's and by Hamming's method.

    The rate 1j stands for y'' = -y. A step is stable if the solution does not grow at the end of ``steps`` steps.
    """

    def classical(h: float) -> NDArray[np.complex128]:
        return runge_kutta(lambda t, y: rate * y, np.ones(1, complex), h, steps)[:, 0]

    def hamming(h: float) -> NDArray[np.complex128]:
        options = {"method": Hamming, "first_step": h, "max_step": h, "rtol": 1e9, "atol": 1e99}
        y: NDArray[np.complex128]
        y = solve_ivp(lambda t, y: rate * y, (0.0, steps * h), np.ones(1, complex), **options).y[0]
        return y

    found = []
    for method in (classical, hamming):
        low, high = 0.1, 4.0
        while high - low > 1e-5:
            middle = 0.5 * (low + high)
            before, last = np.abs(method(middle)[-100:]).reshape(2, 50).max(axis=1)
            low, high = (middle, high) if last < before else (low, middle)
        found.append(low)
    return found[0], found[1]


def order_of_series(highest: int) -> float:
    """Return the order of the Taylor series method on y' = -y, from the errors with h = 0.1 and 0.05.

    The series has the derivatives of y' up to the order ``highest``.
    """
    errors = []
    for n in (10, 20):
        growth = sum((-1.0 / n) ** k / factorial(k) for k in range(highest + 2))
        errors.append(abs(growth**n - exp(-1.0)))
    return log2(errors[0] / errors[1])


def spurious_root(past: ArrayLike, rates: ArrayLike, h: float) -> float:
    """Return the greatest modulus of a corrector's spurious roots on y' = -y with a step h.

    The spurious roots are all but the one near exp(-h). ``past`` and ``rates`` are the corrector's coefficients of y and of y'.
    """
    roots = np.roots(np.asarray(past) + h * np.asarray(rates))
    return float(np.abs(np.delete(roots, np.abs(roots - np.exp(-h)).argmin())).max())
