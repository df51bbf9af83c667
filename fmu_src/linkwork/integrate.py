"""Adaptive explicit Runge-Kutta integration on tuples of floats; knows no mechanics.

The method is DOP853 of Hairer, Norsett and Wanner (see `tableau`), with their error estimate and step size control.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, sqrt
from typing import NamedTuple

from . import tableau
from .errors import IntegrationError

Vector = tuple[float, ...]

_A = tuple(tuple(weight for _, weight in row) for row in tableau.A)
_ERROR_STAGES = tuple(i for i in range(tableau.STAGES) if tableau.E5[i] != 0.0)
_E3 = tuple(tableau.E3[i] for i in _ERROR_STAGES)
_E5 = tuple(tableau.E5[i] for i in _ERROR_STAGES)

SAFETY = 0.9
LEAST_FACTOR = 0.2
GREATEST_FACTOR = 6.0
#: Shortest step as a fraction of the whole interval, below which the integration gives up.
LEAST_STEP = 1e-14
#: Fraction of a step over which the rate of the clearance is estimated.
PROBE = 1e-3
#: Exceptions that a right-hand side may raise where it is not defined; a shorter step is then tried.
UNDEFINED = (ArithmeticError, ValueError)


class Result(NamedTuple):
    """Result of an integration: final state, step size to continue with, numbers of tried steps and of evaluations of f."""

    x: Vector
    step: float
    steps: int
    evaluations: int


def rk_step(f: Callable[[Vector], Vector], x: Vector, k1: Vector, h: float, scale: Vector) -> tuple[Vector, float]:
    """Take a step of size ``h`` from ``x`` with ``k1 = f(x)``; return the new state and the norm of its relative error.

    The error of each component is divided by ``scale + |x|``.
    """
    (a1,) = _A[1]
    k2 = f(tuple([y + h * (a1 * p1) for y, p1 in zip(x, k1)]))
    a1, a2 = _A[2]
    k3 = f(tuple([y + h * (a1 * p1 + a2 * p2) for y, p1, p2 in zip(x, k1, k2)]))
    a1, a2 = _A[3]
    k4 = f(tuple([y + h * (a1 * p1 + a2 * p3) for y, p1, p3 in zip(x, k1, k3)]))
    a1, a2, a3 = _A[4]
    k5 = f(tuple([y + h * (a1 * p1 + a2 * p3 + a3 * p4) for y, p1, p3, p4 in zip(x, k1, k3, k4)]))
    a1, a2, a3 = _A[5]
    k6 = f(tuple([y + h * (a1 * p1 + a2 * p4 + a3 * p5) for y, p1, p4, p5 in zip(x, k1, k4, k5)]))
    a1, a2, a3, a4 = _A[6]
    k7 = f(tuple([y + h * (a1 * p1 + a2 * p4 + a3 * p5 + a4 * p6) for y, p1, p4, p5, p6 in zip(x, k1, k4, k5, k6)]))
    a1, a2, a3, a4, a5 = _A[7]
    new = [
        y + h * (a1 * p1 + a2 * p4 + a3 * p5 + a4 * p6 + a5 * p7)
        for y, p1, p4, p5, p6, p7 in zip(x, k1, k4, k5, k6, k7)
    ]
    k8 = f(tuple(new))
    a1, a2, a3, a4, a5, a6 = _A[8]
    new = [
        y + h * (a1 * p1 + a2 * p4 + a3 * p5 + a4 * p6 + a5 * p7 + a6 * p8)
        for y, p1, p4, p5, p6, p7, p8 in zip(x, k1, k4, k5, k6, k7, k8)
    ]
    k9 = f(tuple(new))
    a1, a2, a3, a4, a5, a6, a7 = _A[9]
    new = [
        y + h * (a1 * p1 + a2 * p4 + a3 * p5 + a4 * p6 + a5 * p7 + a6 * p8 + a7 * p9)
        for y, p1, p4, p5, p6, p7, p8, p9 in zip(x, k1, k4, k5, k6, k7, k8, k9)
    ]
    k10 = f(tuple(new))
    a1, a2, a3, a4, a5, a6, a7, a8 = _A[10]
    new = [
        y + h * (a1 * p1 + a2 * p4 + a3 * p5 + a4 * p6 + a5 * p7 + a6 * p8 + a7 * p9 + a8 * p10)
        for y, p1, p4, p5, p6, p7, p8, p9, p10 in zip(x, k1, k4, k5, k6, k7, k8, k9, k10)
    ]
    k11 = f(tuple(new))
    a1, a2, a3, a4, a5, a6, a7, a8, a9 = _A[11]
    new = [
        y + h * (a1 * p1 + a2 * p4 + a3 * p5 + a4 * p6 + a5 * p7 + a6 * p8 + a7 * p9 + a8 * p10 + a9 * p11)
        for y, p1, p4, p5, p6, p7, p8, p9, p10, p11 in zip(x, k1, k4, k5, k6, k7, k8, k9, k10, k11)
    ]
    k12 = f(tuple(new))
    a1, a2, a3, a4, a5, a6, a7, a8 = _A[12]
    new = [
        y + h * (a1 * p1 + a2 * p6 + a3 * p7 + a4 * p8 + a5 * p9 + a6 * p10 + a7 * p11 + a8 * p12)
        for y, p1, p6, p7, p8, p9, p10, p11, p12 in zip(x, k1, k6, k7, k8, k9, k10, k11, k12)
    ]
    x_new = tuple(new)
    # Hairer's estimate: |h| err5^2 / sqrt(err5^2 + 0.01 err3^2), a combination of order 8 in h
    e1, e2, e3, e4, e5, e6, e7, e8 = _E5
    d1, d2, d3, d4, d5, d6, d7, d8 = _E3
    sum5 = 0.0
    sum3 = 0.0
    for s, y, z, p1, p6, p7, p8, p9, p10, p11, p12 in zip(scale, x, x_new, k1, k6, k7, k8, k9, k10, k11, k12):
        weight = 1.0 / (s + abs(z if abs(z) > abs(y) else y))
        error5 = (e1 * p1 + e2 * p6 + e3 * p7 + e4 * p8 + e5 * p9 + e6 * p10 + e7 * p11 + e8 * p12) * weight
        error3 = (d1 * p1 + d2 * p6 + d3 * p7 + d4 * p8 + d5 * p9 + d6 * p10 + d7 * p11 + d8 * p12) * weight
        sum5 += error5 * error5
        sum3 += error3 * error3
    denominator = sum5 + 0.01 * sum3
    if denominator == 0.0:
        return x_new, 0.0
    return x_new, abs(h) * sum5 / sqrt(denominator * len(x))


def integrate(
    f: Callable[[Vector], Vector],
    x: Vector,
    duration: float,
    *,
    tolerance: float,
    scale: Vector,
    step: float = 0.0,
    reach: Vector = (),
    clearance: Callable[[Vector], float] | None = None,
    accept: Callable[[Vector], None] | None = None,
    max_steps: int = 20_000,
) -> Result:
    """Integrate x' = f(x) over an interval of length ``duration``; the last step ends exactly at the end of the interval.

    The right-hand side is not evaluated at the final state: ``accept`` must check whether f is defined there.

    Parameters
    ----------
    f : callable
        Right-hand side; may raise ArithmeticError or ValueError where it is not defined.
    x : tuple of float
        State at the start, finite.
    duration : float
        Length of the interval, greater than zero.
    tolerance : float
        Bound of the local error of each component relative to ``scale + |x|``.
    scale : tuple of float
        Magnitude of each component below which its error counts as absolute.
    step : float
        First step size to try, such as `Result.step` of the previous interval; if 0, the integrator chooses.
    reach : tuple of float
        Largest change of each component relative to its scale in a step, as far as its rate at the beginning of the step
        tells; any change if empty.
    clearance : callable, optional
        Distance of a state from a limit, which a step at most halves, as far as its rate at the beginning of the step tells.
    accept : callable, optional
        Called with each accepted state, which is finite; may raise to stop the integration.
    max_steps : int
        Greatest number of steps, accepted and refused.

    Raises
    ------
    IntegrationError
        If the step size underflows or ``max_steps`` do not suffice.
    """
    k1 = f(x)
    evaluations = 1
    if not step > 0.0:
        step = _first_step(x, k1, scale, duration, tolerance)
    done = 0.0
    steps = 0
    proposal = step
    while True:
        remaining = duration - done
        size = bounded_step(proposal, k1, reach, scale)
        if clearance is not None:
            size = _step_short_of_limit(size, x, k1, clearance)
        proposal = size  # the step after a shortened one grows from it
        last = size >= remaining * (1.0 - 1e-10)
        h = remaining if last else min(size, 0.5 * remaining)
        steps += 1
        if steps > max_steps:
            raise IntegrationError(
                f"{max_steps} steps did not suffice: stopped {done:g} s into an interval of {duration:g} s"
            )
        evaluations += 11
        k_new = k1
        try:
            x_new, error = rk_step(f, x, k1, h, scale)
            error /= tolerance
            if error <= 1.0 and not all(map(isfinite, x_new)):
                error = float("nan")
            # the next step needs the right-hand side at its start; after the last step it is not needed
            if error <= 1.0 and not last:
                evaluations += 1
                k_new = f(x_new)
        except UNDEFINED:
            error = float("nan")
        if error <= 1.0:
            if accept is not None:
                accept(x_new)
            factor = GREATEST_FACTOR if error == 0.0 else min(GREATEST_FACTOR, SAFETY * error ** (-1.0 / tableau.ORDER))
            # a step cut short by the end of the interval does not shorten the first step of the next interval
            proposal = max(proposal, factor * h) if h < proposal else max(LEAST_FACTOR, factor) * h
            x = x_new
            if last:
                return Result(x, proposal, steps, evaluations)
            done += h
            k1 = k_new
        else:
            shrink = max(LEAST_FACTOR, SAFETY * error ** (-1.0 / tableau.ORDER)) if isfinite(error) else 0.25
            proposal = h * shrink
            if proposal < LEAST_STEP * duration:
                raise IntegrationError(
                    f"the step size fell to {proposal:.3g} s, {done:g} s into an interval of {duration:g} s"
                )


def bounded_step(step: float, rates: Vector, reach: Vector, scale: Vector) -> float:
    """Shorten a step size until no component, at its present rate, changes by more than its reach times its scale."""
    for rate, most, size in zip(rates, reach, scale):
        if step * abs(rate) > most * size:
            step = most * size / abs(rate)
    return step


def _step_short_of_limit(step: float, x: Vector, rates: Vector, clearance: Callable[[Vector], float]) -> float:
    """Shorten a step size until the clearance, at its present rate, falls by no more than half."""
    now = clearance(x)
    try:
        fall = now - clearance(tuple(a + PROBE * step * rate for a, rate in zip(x, rates)))
    except UNDEFINED:  # beyond the limit
        return PROBE * step
    return 0.5 * PROBE * step * now / fall if fall > 0.5 * PROBE * now else step


def _first_step(x: Vector, k1: Vector, scale: Vector, duration: float, tolerance: float) -> float:
    """Return a first step size: tolerance^(1/8) times the time in which the state would change by its own magnitude."""
    ratio = max(abs(k) / (s + abs(y)) for k, s, y in zip(k1, scale, x))
    return duration if ratio == 0.0 else min(duration, tolerance ** (1.0 / tableau.ORDER) / ratio)
