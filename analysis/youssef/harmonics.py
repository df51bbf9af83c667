"""Periodic motions of the slider at constant crank speed by harmonic balance (Youssef, chapter IV).

The thesis puts zeta = a0 + a1 cos + b1 sin + a2 cos 2 + b2 sin 2 into the linear equation and balances each harmonic, eqs
(4.30)-(4.35). `harmonic_balance` does this with any number of harmonics. `nonlinear_harmonic_balance` balances the
plant's equations: it samples the motion over a turn, evaluates the unbalanced force and its exact derivatives at the samples,
and transforms them to harmonics. A balance finds stable and unstable motions alike and does not tell them apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.five_bar.parameters import FiveBarParameters, without_friction

from ..numerics.fourier import FourierSeries
from ..periodic import Response
from ..run import takes_published
from ..units import Amount, in_si
from .hill import operator
from .linear_stability import constant_load
from .linearisation import NO_LOAD, Balance, Load, SliderEquation, Variant, balance, require_speed, slider_equation

#: Orders that the nonlinear balance tries in turn by default.
ORDERS = (8, 16, 32, 64, 128, 256)
#: Number of samples in a turn for each harmonic of the nonlinear balance.
SAMPLES_PER_HARMONIC = 8
#: Greatest numbers of Newton steps and of halvings of a step.
MOST_ITERATIONS, MOST_HALVINGS = 40, 12


class HarmonicBalanceError(LinkworkError):
    """The harmonic balance failed; the message states the speed, the order, the residual and the number of iterations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicMotion:
    """A periodic motion of the slider over the crank angle.

    Attributes
    ----------
    series : FourierSeries
        Solution zeta = u/l4 of a linear equation.
    residual : float
        Greatest unbalanced force over the turn, relative to (m4 + m5) l4 omega^2.
    """

    series: FourierSeries
    residual: float

    @property
    def order(self) -> int:
        """Order of the highest harmonic of the series."""
        return self.series.order

    @property
    def amplitude(self) -> float:
        """Half the distance between the least and the greatest value of the series."""
        return float(_half_ranges(self.series.cos[None, :], self.series.sin[None, :])[0])

    def harmonic(self, n: int) -> float:
        """Return the amplitude of the n-th harmonic, 0 if n is above the order; for n = 0 return the mean with its sign."""
        return float(self.series.amplitudes[n]) if n <= self.order else 0.0

    def position(self, angle: ArrayLike) -> NDArray[np.float64]:
        """Return the values of the series at crank angles (rad), as an array of the angles' shape."""
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
        Total number of Newton steps over all orders tried.
    speed : float
        Crank speed (rad/s).
    torque : FourierSeries
        Crank torque that holds the speed (N.m).
    """

    iterations: int
    speed: float
    torque: FourierSeries

    def velocity(self, angle: ArrayLike) -> NDArray[np.float64]:
        """Return the slider velocity u' (m/s) at crank angles (rad)."""
        return self.speed * self.series.derivative()(angle)

    def acceleration(self, angle: ArrayLike) -> NDArray[np.float64]:
        """Return the slider acceleration u'' (m/s2) at crank angles (rad)."""
        return self.speed**2 * self.series.derivative().derivative()(angle)


def two_harmonics(equation: SliderEquation) -> HarmonicMotion:
    """Return the slider motion with two harmonics: solve the thesis's equations (4.30)-(4.35) for a0, a1, b1, a2, b2."""
    return harmonic_balance(equation, 2)


def harmonic_balance(equation: SliderEquation, order: int) -> HarmonicMotion:
    """Return the periodic solution of a linear slider equation with the harmonics 0 to ``order``.

    Raises
    ------
    InputError
        If the order is negative.
    HarmonicBalanceError
        If the equations are singular, at an undamped resonance.
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


def harmonic_amplitudes(
    parameters: FiveBarParameters,
    speeds: ArrayLike,
    order: int,
    *,
    variant: Variant = Variant.EXACT,
    load: Load = NO_LOAD,
) -> NDArray[np.float64]:
    """Return the amplitudes (m) of `harmonic_balance` at many crank speeds (rad/s), as an array of the speeds' shape.

    Apart from the damping, each coefficient of a linear slider equation is a constant plus a multiple of 1/speed^2. The
    equations at two speeds therefore determine the equation at every speed.

    Raises InputError as `slider_equation` does, and HarmonicBalanceError if the equations are singular at one of the speeds.
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
    return (parameters.rocker_length * _half_ranges(*_coefficients(z))).reshape(np.shape(speeds))


def _coefficients(z: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Convert coefficients of exp(i k theta), shape (..., 2 n + 1), to cosine and sine coefficients, each (..., n + 1)."""
    half = z[..., z.shape[-1] // 2 :]
    cos = 2.0 * np.real(half)
    cos[..., 0] *= 0.5
    return cos, -2.0 * np.imag(half)


def _half_ranges(cos: NDArray[np.float64], sin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half the range of values of each of m Fourier series, shape (m,).

    The series are given by their cosine and sine coefficients, each of shape (m, n + 1).
    """
    n = np.arange(cos.shape[-1])
    angle = np.linspace(0.0, 2.0 * pi, 32 * len(n), endpoint=False)
    phase = np.multiply.outer(n, angle)
    samples = cos @ np.cos(phase) + sin @ np.sin(phase)
    ends = angle[np.stack([samples.argmin(axis=1), samples.argmax(axis=1)], axis=1)]
    cos, sin = cos[:, None], sin[:, None]
    # the extreme samples are close enough to the extremes for Newton's method
    for _ in range(4):
        c, s = np.cos(ends[..., None] * n), np.sin(ends[..., None] * n)
        rate, bend = (n * (sin * c - cos * s)).sum(axis=2), (-(n**2) * (cos * c + sin * s)).sum(axis=2)
        ends = ends - np.divide(rate, bend, out=np.zeros_like(rate), where=bend != 0.0)
    c, s = np.cos(ends[..., None] * n), np.sin(ends[..., None] * n)
    return 0.5 * np.ptp(np.hstack([(cos * c + sin * s).sum(axis=2), samples]), axis=1)


def _require_order(order: int) -> None:
    if order < 0:
        raise InputError(f"order {order}: it must be zero or greater")


def _operator(equation: SliderEquation, order: int) -> NDArray[np.complex128]:
    """Return the matrix of the operator a zeta'' + b zeta' + c zeta in the basis exp(i n theta), n = -order ... order."""
    return operator(equation.homogeneous().stiffened(equation.spring), np.arange(-order, order + 1.0))


@takes_published()
def resonance(
    parameters: FiveBarParameters,
    *,
    variant: Variant = Variant.EXACT,
    harmonic: int = 1,
    order: int = 2,
    load: Load = NO_LOAD,
) -> tuple[float, float]:
    """Return the two crank speeds (rad/s) at which the undamped linear harmonic balance is singular, the lower first.

    For every harmonic the determinant of the balance vanishes at two neighbouring speeds, because the periodic mass and
    stiffness split one resonance into two. The thesis's resonance is the lower one with ``harmonic=1`` and ``order=2``.

    Parameters
    ----------
    parameters : FiveBarParameters
        Parameters of the five-bar; the damping is ignored.
    variant : Variant
    harmonic : int
        Resonating harmonic: 1 near the natural frequency, 2 near half the natural frequency; at most ``order``.
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
    # the matrix is S (natural/omega)^2 + D with spring, gravity, load and preload in S and inertia in D
    static = (once - twice) * 4.0 / 3.0
    squares = np.linalg.eigvals(np.linalg.solve(static, static - once))
    pair = squares[np.argsort(squares.real)][2 * harmonic - 1 : 2 * harmonic + 1]
    if not (np.all(pair.real > 0.0) and np.all(np.abs(pair.imag) < 1e-6 * pair.real)):
        raise HarmonicBalanceError(
            f"harmonic {harmonic} has no resonance: the squares of natural/omega would be {pair[0]:.6g} and {pair[1]:.6g}"
        )
    upper, lower = natural / np.sqrt(pair.real)
    return float(lower), float(upper)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Approximations:
    """Amplitudes of the slider against crank speed, approximated by the linear equation about u = 0.

    Attributes
    ----------
    parameters : FiveBarParameters
        Parameters without Coulomb friction, which has no linear form.
    load : Load
        Constant forces.
    speed : ndarray, shape (m,)
        Crank speeds (rad/s).
    amplitudes : mapping
        Half the range of u (m) at each speed, shape (m,), by the name of the approximation.
    """

    parameters: FiveBarParameters
    load: Load
    speed: NDArray[np.float64]
    amplitudes: Mapping[str, NDArray[np.float64]]

    def at(self, speed: ArrayLike) -> dict[str, NDArray[np.float64]]:
        """Return, for each approximation by its name, the amplitudes (m) at crank speeds (rad/s), in the shape of ``speed``."""
        return _approximate(self.parameters, speed, self.load)

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the speed and the amplitudes as columns of a table, by name with unit."""
        return {"drive.speed [rad/s]": self.speed} | {f"{name} [m]": v for name, v in self.amplitudes.items()}


def approximations(response: Response, points: int = 160) -> Approximations:
    """Approximate the amplitudes of a response by the corrected equation (4.21), with two and with ten harmonics.

    The amplitudes are computed at ``points`` evenly spaced speeds over the response's range.

    Raises
    ------
    InputError
        If the response is not over the crank speed.
    """
    if response.family.vary != "drive.speed":
        raise InputError(f"{response.family.name} varies: the approximations are over the speed")
    parameters = without_friction(response.family.parameters)
    load = constant_load(response.family.drive)
    speeds = np.linspace(response.low, response.high, points)
    return Approximations(
        parameters=parameters, load=load, speed=speeds, amplitudes=_approximate(parameters, speeds, load)
    )


#: Approximations by name: variant of the linear equation and harmonics balanced.
_APPROXIMATIONS = {"two harmonics": (Variant.SECOND_ORDER, 2), "ten harmonics": (Variant.EXACT, 10)}


def _approximate(parameters: FiveBarParameters, speed: ArrayLike, load: Load) -> dict[str, NDArray[np.float64]]:
    return {
        name: harmonic_amplitudes(parameters, speed, order, variant=variant, load=load)
        for name, (variant, order) in _APPROXIMATIONS.items()
    }


class _Basis(NamedTuple):
    """The functions 1, cos k x, sin k x at samples of x (``angle``, rad): values and first two derivatives.

    The arrays of values and derivatives have the shape (samples, 2 order + 1). ``projection``, shape (2 order + 1, samples),
    converts samples of a function to its coefficients.
    """

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
        angle, value, np.hstack([-k * np.sin(phase), k[1:] * cos[:, 1:]]), -value * square, weight[:, None] * value.T
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
    """Find a periodic motion of the plant at a crank speed by Newton's method on its harmonics.

    Parameters
    ----------
    parameters : FiveBarParameters
    speed : float
        Crank speed (rad/s), greater than zero.
    order : int, optional
        Highest harmonic; by default the first of `ORDERS` whose last two harmonics are below ``tolerance`` times the greatest.
    start : FourierSeries, optional
        Initial slider position (m); by default the solution of the linear equation, reduced until the links can follow it.
    tolerance : float
        Greatest change of a coefficient in the last Newton step, relative to the rocker's length, at which the iteration ends.
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
    """Solve the linear equation for the slider position (m); halve the result until the links can be joined at all angles."""
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
    """Solve the nonlinear balance with harmonics up to ``order`` by Newton's method from the slider position ``start`` (m)."""
    p = parameters.constants()
    basis = _basis(order)
    scale = p.l4 * (p.m45 * speed**2 + p.k)

    def residual(x: NDArray[np.float64]) -> tuple[Balance, NDArray[np.float64]]:
        """Return the plant's balance at the samples and the harmonics of the force; ``x`` has the position's coefficients."""
        u, v, a = basis.value @ x, speed * (basis.rate @ x), speed**2 * (basis.curvature @ x)
        plant = balance(basis.angle, u, v, a, speed, p, load)
        return plant, basis.projection @ plant.force

    first = start.to_order(order)
    x = np.append(first.cos, first.sin[1:])
    plant, unbalanced = residual(x)
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
                tried = residual(x + 0.5**halving * step)
            except AssemblyError:
                continue
            # the last step may only increase the residual by rounding
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
        f"{np.abs(unbalanced).max() / scale:.1e}, step {size:.1e} m after {iteration} iterations, mean position {x[0]:.6g} m"
    )
