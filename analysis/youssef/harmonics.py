"""Periodic motions of the slider at constant crank speed by harmonic balance (Youssef, chapter IV).

The thesis puts zeta = a0 + a1 cos + b1 sin + a2 cos 2 + b2 sin 2 into the linear equation and balances what has the same
harmonics, eqs (4.30)-(4.35). `harmonic_balance` does this with any number of harmonics, `nonlinear_harmonic_balance` with
the plant's own equations: from the harmonics to samples over a turn, there the force, and back to its harmonics, with
exact derivatives. A balance finds unstable motions as readily as stable ones: it says nothing about stability.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.five_bar.parameters import FiveBarParameters

from ..numerics.fourier import FourierSeries
from ..run import takes_published
from ..units import Amount, in_si
from .equation import NO_LOAD, Balance, Load, SliderEquation, Variant, balance, require_speed, slider_equation

#: Orders that the nonlinear balance goes through where none is given.
ORDERS = (8, 16, 32, 64, 128, 256)
#: Samples of a turn per harmonic of the nonlinear balance.
SAMPLES_PER_HARMONIC = 8
#: Newton steps, and halvings of one, at most.
MOST_ITERATIONS, MOST_HALVINGS = 40, 12


class HarmonicBalanceError(LinkworkError):
    """The harmonics could not be balanced: the message says at which speed and order, with residual and iterations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicMotion:
    """A periodic motion of the slider over the crank angle.

    Attributes
    ----------
    series : FourierSeries
        zeta = u/l4 of a linear equation.
    residual : float
        Greatest force that is left unbalanced over the turn, relative to (m4 + m5) l4 omega^2.
    """

    series: FourierSeries
    residual: float

    @property
    def order(self) -> int:
        """Order of the highest harmonic."""
        return self.series.order

    @property
    def amplitude(self) -> float:
        """Half the distance between the least and the greatest position."""
        return float(_swings(self.series.cos[None, :], self.series.sin[None, :])[0])

    def harmonic(self, n: int) -> float:
        """Amplitude of the n-th harmonic; 0 beyond the order; the mean, with its sign, for n = 0."""
        return float(self.series.amplitudes[n]) if n <= self.order else 0.0

    def position(self, angle: ArrayLike) -> NDArray[np.float64]:
        """Position at crank angles (rad), of their shape."""
        return self.series(angle)


@dataclass(frozen=True, slots=True, kw_only=True)
class SliderMotion(HarmonicMotion):
    """A periodic motion of the plant at constant crank speed.

    Attributes
    ----------
    series : FourierSeries
        Slider position u (m).
    residual : float
        Greatest harmonic of the unbalanced force up to the order of the series, relative to l4 ((m4 + m5) omega^2 + k).
    iterations : int
        Newton steps, of all orders gone through.
    speed : float
        Crank speed (rad/s).
    torque : FourierSeries
        Crank torque that holds the speed (N.m).
    """

    iterations: int
    speed: float
    torque: FourierSeries

    def velocity(self, angle: ArrayLike) -> NDArray[np.float64]:
        """u' at crank angles (m/s)."""
        return self.speed * self.series.derivative()(angle)

    def acceleration(self, angle: ArrayLike) -> NDArray[np.float64]:
        """u'' at crank angles (m/s2)."""
        return self.speed**2 * self.series.derivative().derivative()(angle)


def two_harmonics(equation: SliderEquation) -> HarmonicMotion:
    """The thesis's form, eqs (4.30)-(4.35): five linear equations for a0, a1, b1, a2, b2."""
    return harmonic_balance(equation, 2)


def harmonic_balance(equation: SliderEquation, order: int) -> HarmonicMotion:
    """Periodic solution of a linear slider equation with harmonics up to an order.

    Raises
    ------
    InputError
        If the order is negative.
    HarmonicBalanceError
        If the equations are singular: an undamped resonance.
    """
    _require_order(order)
    try:
        z = np.linalg.solve(_operator(equation, order), equation.force.to_order(order).exponential)
    except np.linalg.LinAlgError:
        raise HarmonicBalanceError(
            f"the linear balance of order {order} is singular at lambda_k^2 = {equation.spring:.6g}, "
            f"lambda_c = {equation.damping:.6g}: a resonance without damping"
        ) from None
    zeta = FourierSeries(*_coefficients(z))
    a, b, c = equation.coefficients()
    rate = zeta.derivative()
    reach = order + max(a.order, c.order, equation.force.order)
    angle = np.linspace(0.0, 2.0 * pi, 4 * (reach + 1), endpoint=False)
    left = a(angle) * rate.derivative()(angle) + b(angle) * rate(angle) + c(angle) * zeta(angle)
    return HarmonicMotion(series=zeta, residual=float(np.abs(left - equation.force(angle)).max()))


def amplitudes_over(
    parameters: FiveBarParameters,
    speeds: ArrayLike,
    order: int,
    *,
    variant: Variant = Variant.EXACT,
    load: Load = NO_LOAD,
) -> NDArray[np.float64]:
    """Amplitudes (m) of `harmonic_balance` at many crank speeds (rad/s), of their shape.

    All parts of a linear slider equation but its damping are constants and multiples of the inverse square of the speed, so
    that two speeds give them at all others.

    Raises InputError as `slider_equation` does; it takes the equation from samples, or in powers of the crank's length;
    HarmonicBalanceError if the equations are singular at one of the speeds.
    """
    _require_order(order)
    w = np.ravel(np.asarray(speeds, dtype=float))[:, None]
    require_speed(float(w.min()))
    reference = float(w.max())
    bare = replace(parameters, slider_damping=0.0)
    (once, one), (twice, two) = (
        (_operator(equation, order), equation.force.to_order(order).exponential)
        for equation in (slider_equation(bare, n * reference, variant=variant, load=load) for n in (1.0, 2.0))
    )
    damping = slider_equation(parameters, reference, variant=variant, load=load).damping
    share = (reference / w) ** 2 - 1.0
    matrix = once + share[..., None] * (once - twice) * 4.0 / 3.0
    matrix += np.diag(1j * np.arange(-order, order + 1)) * damping * (reference / w)[..., None]
    force = one + share * (one - two) * 4.0 / 3.0
    try:
        z = np.linalg.solve(matrix, force[..., None])[..., 0]
    except np.linalg.LinAlgError:
        raise HarmonicBalanceError(
            f"the linear balance of order {order} is singular at a speed from {w.min():.6g} to {w.max():.6g} rad/s: "
            "a resonance without damping"
        ) from None
    return (parameters.rocker_length * _swings(*_coefficients(z))).reshape(np.shape(speeds))


def _coefficients(z: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosines and sines, shape (..., n + 1), of the coefficients of exp(i n theta), (..., 2 n + 1)."""
    half = z[..., z.shape[-1] // 2 :]
    cos = 2.0 * np.real(half)
    cos[..., 0] *= 0.5
    return cos, -2.0 * np.imag(half)


def _swings(cos: NDArray[np.float64], sin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half the distance between the least and the greatest value of each of some Fourier series, shape (m, n + 1)."""
    n = np.arange(cos.shape[-1])
    angle = np.linspace(0.0, 2.0 * pi, 32 * len(n), endpoint=False)
    phase = np.multiply.outer(n, angle)
    samples = cos @ np.cos(phase) + sin @ np.sin(phase)
    ends = angle[np.stack([samples.argmin(axis=1), samples.argmax(axis=1)], axis=1)]
    cos, sin = cos[:, None], sin[:, None]
    # the samples are close enough for Newton steps to the places where the slider rests
    for _ in range(4):
        c, s = np.cos(ends[..., None] * n), np.sin(ends[..., None] * n)
        rate, bend = (n * (sin * c - cos * s)).sum(axis=2), (-(n**2) * (cos * c + sin * s)).sum(axis=2)
        ends = ends - np.divide(rate, bend, out=np.zeros_like(rate), where=bend != 0.0)
    c, s = np.cos(ends[..., None] * n), np.sin(ends[..., None] * n)
    swings: NDArray[np.float64] = 0.5 * np.ptp(np.hstack([(cos * c + sin * s).sum(axis=2), samples]), axis=1)
    return swings


def _require_order(order: int) -> None:
    if order < 0:
        raise InputError(f"order {order}: it must be zero or greater")


def _operator(equation: SliderEquation, order: int) -> NDArray[np.complex128]:
    """Matrix of a zeta'' + b zeta' + c zeta between the coefficients of exp(i n theta), n = -order ... order."""
    n = np.arange(-order, order + 1)
    apart = np.subtract.outer(n, n) + 2 * order
    a, b, c = (series.to_order(2 * order).exponential[apart] for series in equation.coefficients())
    matrix: NDArray[np.complex128] = -a * n**2 + 1j * b * n + c
    return matrix


@takes_published()
def resonance(
    parameters: FiveBarParameters,
    *,
    variant: Variant = Variant.EXACT,
    harmonic: int = 1,
    order: int = 2,
    load: Load = NO_LOAD,
) -> tuple[float, float]:
    """Crank speeds at which the undamped balance of the linear equation has no solution (rad/s), the lower first.

    The determinant vanishes at two speeds near each other for every harmonic, because the mechanism's periodic mass and
    stiffness split what would be one; the thesis's resonance is the lower one with ``harmonic=1`` and ``order=2``.

    Parameters
    ----------
    parameters : FiveBarParameters
        Its damping is left out.
    variant : Variant
    harmonic : int
        That resonates: 1 at the natural frequency, 2 near half of it; at most ``order``.
    order : int
        Highest harmonic of the balance.
    load : Load

    Raises
    ------
    InputError
        If the harmonic is not from 1 to the order, or there is no spring.
    HarmonicBalanceError
        If there is no such speed.
    """
    if not 1 <= harmonic <= order:
        raise InputError(f"harmonic {harmonic}: it must be from 1 to the order of the balance, {order}")
    if not parameters.slider_stiffness > 0.0:
        raise InputError("slider.stiffness must be greater than zero for a resonance")
    natural = sqrt(parameters.slider_stiffness / parameters.constants().m45)
    once, twice = (
        _operator(slider_equation(replace(parameters, slider_damping=0.0), w, variant=variant, load=load), order)
        for w in (natural, 2.0 * natural)
    )
    # the matrix is S (natural/omega)^2 + D: spring, gravity, load and preload in S, inertia in D
    static = (once - twice) * 4.0 / 3.0
    squares = np.linalg.eigvals(np.linalg.solve(static, static - once))
    pair = squares[np.argsort(squares.real)][2 * harmonic - 1 : 2 * harmonic + 1]
    if not (np.all(pair.real > 0.0) and np.all(np.abs(pair.imag) < 1e-6 * pair.real)):
        raise HarmonicBalanceError(
            f"harmonic {harmonic} has no resonance: the squares of natural/omega would be {pair[0]:.6g} and {pair[1]:.6g}"
        )
    upper, lower = natural / np.sqrt(pair.real)
    return float(lower), float(upper)


class _Basis(NamedTuple):
    """Values of 1, cos k x, sin k x and their derivatives at the samples, shape (samples, 2 order + 1), and projection."""

    angle: NDArray[np.float64]
    value: NDArray[np.float64]
    rate: NDArray[np.float64]
    curvature: NDArray[np.float64]
    projection: NDArray[np.float64]


def _basis(order: int) -> _Basis:
    samples = SAMPLES_PER_HARMONIC * (order + 1)
    angle = np.linspace(0.0, 2.0 * pi, samples, endpoint=False)
    k = np.arange(order + 1)
    phase = np.multiply.outer(angle, k)
    cos, sin = np.cos(phase), np.sin(phase)[:, 1:]
    value = np.hstack([cos, sin])
    square = np.append(k, k[1:]) ** 2
    weight = np.full(2 * order + 1, 2.0 / samples)
    weight[0] = 1.0 / samples
    return _Basis(
        angle,
        value,
        np.hstack([-k * np.sin(phase), k[1:] * cos[:, 1:]]),
        -value * square,
        weight[:, None] * value.T,
    )


@takes_published()
@in_si(speed="rad/s")
def nonlinear_harmonic_balance(
    parameters: FiveBarParameters,
    speed: Amount,
    order: int | None = None,
    *,
    start: FourierSeries | None = None,
    tolerance: float = 1e-12,
    load: Load = NO_LOAD,
) -> SliderMotion:
    """Periodic motion of the plant at a crank speed by Newton's method on its harmonics.

    Parameters
    ----------
    parameters : FiveBarParameters
    speed : float
        Crank speed (rad/s), greater than zero.
    order : int, optional
        Highest harmonic. Without it `ORDERS` are gone through until the last two harmonics are below ``tolerance`` times the
        greatest.
    start : FourierSeries, optional
        Slider position (m) to start from; without it the solution of the linear equation, made smaller if the links
        cannot follow it.
    tolerance : float
        Last Newton step relative to the rocker's length.
    load : Load

    Raises
    ------
    InputError
        If the speed, the order or the tolerance is out of range.
    AssemblyError
        If the links cannot be joined over the whole turn with the slider held at u = 0, or in ``start``.
    HarmonicBalanceError
        If Newton's method does not converge, or the harmonics do not die away.
    """
    if not tolerance > 0.0:
        raise InputError(f"tolerance {tolerance!r}: it must be greater than zero")
    if order is not None:
        _require_order(order)
    require_speed(speed)
    if start is None:
        start = _linear_start(parameters, speed, ORDERS[0] if order is None else order, load)
    iterations = 0
    for n in ORDERS if order is None else (order,):
        found = _newton(parameters, speed, n, start, tolerance, load)
        iterations += found.iterations
        size = np.abs(found.series.amplitudes)
        if order is not None or size[-2:].max() <= tolerance * size.max():
            return replace(found, iterations=iterations)
        start = found.series
    raise HarmonicBalanceError(
        f"at {speed:.6g} rad/s harmonic {ORDERS[-1]} is still {size[-1] / size.max():.1e} of the greatest, "
        f"residual {found.residual:.1e} after {iterations} iterations"
    )


def _linear_start(parameters: FiveBarParameters, speed: float, order: int, load: Load) -> FourierSeries:
    """Slider position (m) by the linear equation, halved until the links can follow it, as they can u = 0."""
    equation = slider_equation(replace(parameters, slider_coulomb_friction=0.0), speed, load=load)
    start = parameters.rocker_length * harmonic_balance(equation, order).series
    angle = np.linspace(0.0, 2.0 * pi, 256, endpoint=False)
    while True:
        try:
            balance(angle, start(angle), 0.0, 0.0, speed, parameters.constants())
            return start
        except AssemblyError:
            start = 0.5 * start


def _newton(
    parameters: FiveBarParameters, speed: float, order: int, start: FourierSeries, tolerance: float, load: Load
) -> SliderMotion:
    """The balance of one order."""
    p = parameters.constants()
    basis = _basis(order)
    scale = p.l4 * (p.m45 * speed**2 + p.k)

    def at(x: NDArray[np.float64]) -> tuple[Balance, NDArray[np.float64]]:
        """The plant at the samples, and the harmonics of the unbalanced force."""
        u, v, a = basis.value @ x, speed * (basis.rate @ x), speed**2 * (basis.curvature @ x)
        plant = balance(basis.angle, u, v, a, speed, p, load)
        return plant, basis.projection @ plant.force

    first = start.to_order(order)
    x = np.append(first.cos, first.sin[1:])
    plant, unbalanced = at(x)
    size = np.inf
    for iteration in range(1, MOST_ITERATIONS + 1):
        jacobian = basis.projection @ (
            plant.by_acceleration[:, None] * (speed**2 * basis.curvature)
            + plant.by_velocity[:, None] * (speed * basis.rate)
            + plant.by_position[:, None] * basis.value
        )
        try:
            step = np.linalg.solve(jacobian, -unbalanced)
        except np.linalg.LinAlgError:
            break
        size = float(np.abs(step).max())
        last = size <= tolerance * p.l4
        for halving in range(MOST_HALVINGS + 1):
            try:
                tried = at(x + 0.5**halving * step)
            except AssemblyError:
                continue
            # rounding is all that the last step may make worse
            if last or np.linalg.norm(tried[1]) < np.linalg.norm(unbalanced):
                break
        else:
            break
        x = x + 0.5**halving * step
        plant, unbalanced = tried
        if last:
            return SliderMotion(
                series=FourierSeries(x[: order + 1], np.append(0.0, x[order + 1 :])),
                residual=float(np.abs(unbalanced).max()) / scale,
                iterations=iteration,
                speed=speed,
                torque=FourierSeries.from_samples(plant.torque, order),
            )
    raise HarmonicBalanceError(
        f"the balance of order {order} at {speed:.6g} rad/s does not converge: residual "
        f"{np.abs(unbalanced).max() / scale:.1e}, step {size:.1e} m after {iteration} iterations, "
        f"mean position {x[0]:.6g} m"
    )
