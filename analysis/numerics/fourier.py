"""Fourier series of real periodic functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError


@dataclass(frozen=True, slots=True, eq=False)
class FourierSeries:
    """Fourier series f(x) = sum over k of cos[k] cos(k x) + sin[k] sin(k x), k = 0, 1, ..., with period 2 pi.

    Attributes
    ----------
    cos, sin : ndarray, shape (n + 1,)
        Coefficients; ``cos[0]`` is the mean, ``sin[0]`` is zero.

    Raises
    ------
    InputError
        If the lengths differ, or a coefficient is not finite.
    """

    cos: NDArray[np.float64]
    sin: NDArray[np.float64]

    def __post_init__(self) -> None:
        cos, sin = (np.array(values, dtype=float, ndmin=1) for values in (self.cos, self.sin))
        if cos.ndim != 1 or cos.shape != sin.shape or len(cos) == 0:
            raise InputError(f"cosines of shape {cos.shape} and sines of shape {sin.shape}: both must be (n + 1,)")
        if not (np.isfinite(cos).all() and np.isfinite(sin).all()):
            raise InputError("a Fourier coefficient is not finite")
        sin[0] = 0.0
        object.__setattr__(self, "cos", cos)
        object.__setattr__(self, "sin", sin)

    @classmethod
    def constant(cls, value: float) -> FourierSeries:
        """Return the series of a constant."""
        return cls(np.array([value]), np.zeros(1))

    @classmethod
    def from_samples(cls, samples: ArrayLike, order: int | None = None) -> FourierSeries:
        """Compute the series from n samples at equal steps over one period, the first at x = 0.

        The default of ``order`` is the highest that the samples determine, (n - 1) // 2; the series then passes through the
        samples if n is odd. In all other cases its mean square difference from the samples is the least of this order.

        Raises
        ------
        InputError
            If ``order`` is higher than (n - 1) // 2.
        """
        values = np.asarray(samples, dtype=float)
        c = np.fft.rfft(values) / len(values)
        highest = (len(values) - 1) // 2
        if order is not None and order > highest:
            raise InputError(f"order {order} from {len(values)} samples, which determine no more than order {highest}")
        c = c[: (highest if order is None else order) + 1]
        cos, sin = 2.0 * c.real, -2.0 * c.imag
        cos[0] = c[0].real
        return cls(cos, sin)

    @property
    def order(self) -> int:
        """Order of the highest harmonic."""
        return len(self.cos) - 1

    @property
    def mean(self) -> float:
        """Mean over a period."""
        return float(self.cos[0])

    @property
    def amplitudes(self) -> NDArray[np.float64]:
        """Mean, with its sign, and amplitude of each harmonic, shape (n + 1,)."""
        size = np.hypot(self.cos, self.sin)
        size[0] = self.cos[0]
        return size

    @property
    def exponential(self) -> NDArray[np.complex128]:
        """Coefficients c[k + n] of exp(i k x), k = -n ... n, shape (2 n + 1,)."""
        half = 0.5 * (self.cos - 1j * self.sin)
        half[0] = self.cos[0]
        return np.concatenate([half[:0:-1].conj(), half])

    def __call__(self, x: ArrayLike) -> NDArray[np.float64]:
        phase = np.multiply.outer(np.asarray(x, dtype=float), np.arange(len(self.cos)))
        return np.cos(phase) @ self.cos + np.sin(phase) @ self.sin

    def __add__(self, other: FourierSeries | float) -> FourierSeries:
        if not isinstance(other, FourierSeries):
            other = FourierSeries.constant(float(other))
        n = max(len(self.cos), len(other.cos))
        a, b = self.to_order(n - 1), other.to_order(n - 1)
        return FourierSeries(a.cos + b.cos, a.sin + b.sin)

    __radd__ = __add__

    def __mul__(self, factor: float) -> FourierSeries:
        return FourierSeries(factor * self.cos, factor * self.sin)

    __rmul__ = __mul__

    def derivative(self) -> FourierSeries:
        """Return df/dx."""
        k = np.arange(len(self.cos))
        return FourierSeries(k * self.sin, -k * self.cos)

    def to_order(self, order: int) -> FourierSeries:
        """Return the series truncated to an order, or padded with zeros up to it."""
        n = order + 1
        pad = max(0, n - len(self.cos))
        return FourierSeries(*(np.append(values[:n], np.zeros(pad)) for values in (self.cos, self.sin)))


def trigonometric(values: NDArray[np.float64], period: float) -> Callable[[float], NDArray[np.float64]]:
    """Return the trigonometric polynomial f(t) of order (n - 1) // 2 nearest to values at n equal steps of a period.

    ``values``, shape (n, ...), begin at t = 0. If n is odd, the polynomial passes through them.
    """
    n = len(values)
    order = (n - 1) // 2
    c = np.fft.rfft(values, axis=0)[: order + 1] / n
    c[1:] *= 2.0
    turn = 2j * pi / period * np.arange(order + 1)
    return lambda t: np.asarray(np.tensordot(np.exp(turn * t), c, axes=1).real)
