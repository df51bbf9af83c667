"""Hamming's modified predictor-corrector, the thesis's integrator (Youssef, eqs 2.28-2.31 and appendix 1).

With y' = f(t, y), f_n = f(t_n, y_n) and a constant step h,

    predictor    p_(n+1) = y_(n-3) + 4h/3 (2 f_n - f_(n-1) + 2 f_(n-2))                           (2.28)
    modifier     m_(n+1) = p_(n+1) - 112/121 (p_n - c_n)                                         (2.29)
    corrector    c_(n+1) = 1/8 (9 y_n - y_(n-2)) + 3h/8 (f(t_(n+1), m_(n+1)) + 2 f_n - f_(n-1))     (2.30)
    final value  y_(n+1) = c_(n+1) + 9/121 (p_(n+1) - c_(n+1))                                   (2.31)

Predictor and corrector are of order 4, with errors 14/45 h^5 y''''' and -1/40 h^5 y'''''. The difference p - c therefore
measures both errors: 9/121 |p - c| estimates the local error of the corrector, and sets the step. The modifier and the final
value correct p and c by their estimated errors, so that the motion converges with one order more than the error estimate.

To double the step, every second of seven stored back values is used. To halve the step, new back values are interpolated
(Hermite) between the last four. If two halvings do not suffice, or the right-hand side is not finite, the method starts again
from the last good point with the Runge-Kutta method of order 4 and error estimation by step doubling. These steps also begin
the run, and end it if the last step is shorter than the others.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import DenseOutput, OdeSolver
from scipy.interpolate import KroghInterpolator

Array = NDArray[Any]

ORDER = 4

#: Error relative to the tolerance below which the step is doubled: the error grows by 2^5 and must stay well below 1.
DOUBLE_BELOW = 1.0 / 64.0
#: Largest number of halvings in one step; after more the method starts again with Runge-Kutta steps.
MOST_HALVINGS = 2
#: Number of back values that are kept, as many as a doubling needs.
BACK_VALUES = 7


class Point(NamedTuple):
    """A back value: the state and its derivative, each of shape (n,)."""

    y: Array
    f: Array


class Hamming(OdeSolver):  # type: ignore[misc]
    """Hamming's modified predictor-corrector as a method of `scipy.integrate.solve_ivp`.

    A step takes two evaluations of the right-hand side. The step size is constant until the error requires half of this
    size or allows its double; ``first_step == max_step`` with a loose tolerance keeps it fixed.

    Parameters
    ----------
    fun : callable
        Right-hand side ``fun(t, y)``, shape (n,) to (n,).
    t0 : float
        Time at the start.
    y0 : array_like, shape (n,)
        State at the start, real or complex.
    t_bound : float
        Time at the end; before ``t0`` to integrate backwards.
    max_step : float
        Longest step allowed.
    rtol, atol : float or array_like, shape (n,)
        Tolerances: the local error of a step is kept below ``atol + rtol |y|``, as root mean square over the components.
    vectorized : bool
        Whether ``fun`` can take several states as columns.
    first_step : float, optional
        First step; by default chosen from the first two derivatives.

    Attributes
    ----------
    halvings, doublings, starts : int
        Numbers of halvings of the step, of doublings, and of starts with Runge-Kutta steps, the first one included.

    Raises
    ------
    ValueError
        If a step or a tolerance is not positive.
    """

    def __init__(
        self,
        fun: Callable[[float, Array], ArrayLike],
        t0: float,
        y0: ArrayLike,
        t_bound: float,
        max_step: float = np.inf,
        rtol: float | Array = 1e-3,
        atol: float | Array = 1e-6,
        vectorized: bool = False,
        first_step: float | None = None,
        **extraneous: Any,
    ) -> None:
        if extraneous:
            warnings.warn(f"Hamming's method has no option {', '.join(sorted(extraneous))}", stacklevel=2)
        super().__init__(fun, t0, y0, t_bound, vectorized, support_complex=True)
        if not max_step > 0.0:
            raise ValueError(f"max_step is {max_step}: it must be greater than zero")
        self.rtol, self.atol = np.asarray(rtol), np.asarray(atol)
        if not ((self.rtol >= 0.0).all() and (self.atol >= 0.0).all() and (self.rtol + self.atol > 0.0).all()):
            raise ValueError("rtol and atol must be zero or greater, and not both be zero")
        self.max_step = max_step
        #: back values, the newest first, at times ``h`` apart
        self._back = [Point(self.y, self.fun(self.t, self.y))]
        #: p_n - c_n of the newest point
        self._p_minus_c: Array = np.zeros_like(self.y)
        #: times are anchor + k h, so that they do not drift by rounding
        self._anchor, self._count = self.t, 0
        span = abs(t_bound - t0)
        if first_step is None:
            self.h = min(self._first_step(span), max_step, span)
        elif not 0.0 < first_step <= max(span, np.finfo(float).tiny):
            raise ValueError(f"first_step is {first_step}: it must be greater than zero and within the interval")
        else:
            self.h = min(first_step, max_step)
        self.halvings = self.doublings = 0
        self.starts = 1
        self._nodes: tuple[float, ...] = ()
        self._node_points: tuple[Point, ...] = ()

    def _norm(self, x: Array, size: Array) -> float:
        """Return the root mean square of x divided by the tolerance ``atol + rtol size``."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            return float(np.sqrt(np.mean(np.abs(x / (self.atol + self.rtol * size)) ** 2)))

    def _first_step(self, span: float) -> float:
        """Choose the first step from the magnitudes of y, y' and y'' (Hairer, Norsett and Wanner, section II.4)."""
        if self.n == 0 or span == 0.0:
            return span
        y, f = self._back[0]
        d0, d1 = self._norm(y, np.abs(y)), self._norm(f, np.abs(y))
        h0 = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, span)
        if h0 == 0.0:  # y' is infinite
            return h0
        f1 = self.fun(self.t + self.direction * h0, y + self.direction * h0 * f)
        d2 = self._norm(f1 - f, np.abs(y)) / h0
        largest = max(d1, d2)
        h1 = max(1e-6, 1e-3 * h0) if largest <= 1e-15 else (0.01 / largest) ** (1.0 / (ORDER + 1))
        return min(100.0 * h0, h1) if np.isfinite(h1) else h0

    def _step_impl(self) -> tuple[bool, str | None]:
        floor = 10.0 * abs(np.nextafter(self.t, self.direction * np.inf) - self.t)
        halvings = 0
        while self.h >= floor:
            t_new, last = self._next_time()
            if len(self._back) >= 4 and not (last and abs(t_new - self.t) < 0.999 * self.h):
                error, new, p_minus_c = self._hamming(t_new)
                if error <= 1.0:
                    self._nodes, self._node_points = (-1.0, 0.0, 1.0), (self._back[1], self._back[0], new)
                    self._accept(t_new, new)
                    self._p_minus_c = p_minus_c
                    if error < DOUBLE_BELOW:
                        self._double()
                    return True, None
                if np.isfinite(error) and halvings < MOST_HALVINGS and self._halve():
                    halvings += 1
                else:
                    self._restart(0.5 * self.h)
            else:
                h = abs(t_new - self.t)
                error, middle, new = self._runge_kutta(h)
                if error <= 1.0:
                    self._nodes, self._node_points = (0.0, 0.5, 1.0), (self._back[0], middle, new)
                    self._accept(t_new, new)
                    return True, None
                self._restart(0.5 * h)
        return False, self.TOO_SMALL_STEP

    def _next_time(self) -> tuple[float, bool]:
        """Return the time of the next point, and whether it is the end of the run (to within rounding errors)."""
        t_new = self._anchor + self.direction * self.h * (self._count + 1)
        slack = 16.0 * np.spacing(max(abs(self.t), abs(self.t_bound))) + 1e-12 * self.h
        if self.direction * (self.t_bound - t_new) <= slack:
            return self.t_bound, True
        return t_new, False

    def _accept(self, t_new: float, new: Point) -> None:
        self.t, self.y = t_new, new.y
        self._count += 1
        self._back = [new, *self._back[: BACK_VALUES - 1]]

    def _rescale(self, h: float) -> None:
        """Continue from the present point with another step size."""
        self.h = h
        self._anchor, self._count = self.t, 0

    def _restart(self, h: float) -> None:
        """Discard all back values but the newest and continue with Runge-Kutta steps of size ``h``."""
        if len(self._back) > 1:
            self.starts += 1
        self._back = self._back[:1]
        self._p_minus_c = np.zeros_like(self.y)
        self._rescale(h)

    def _hamming(self, t_new: float) -> tuple[float, Point, Array]:
        """Take one step (2.28-2.31); return its error relative to the tolerance, the new point, and p - c of that point."""
        h = self.direction * self.h
        (y0, f0), (_, f1), (y2, f2), (y3, _) = self._back[:4]
        with np.errstate(invalid="ignore", over="ignore"):
            p = y3 + 4.0 * h / 3.0 * (2.0 * f0 - f1 + 2.0 * f2)  # (2.28)
            m = p - 112.0 / 121.0 * self._p_minus_c  # (2.29)
            c = 0.125 * (9.0 * y0 - y2) + 0.375 * h * (self.fun(t_new, m) + 2.0 * f0 - f1)  # (2.30)
            y = c + 9.0 / 121.0 * (p - c)  # (2.31)
            error = self._norm(9.0 / 121.0 * (p - c), np.maximum(np.abs(y0), np.abs(y)))
        if not error <= 1.0:
            return error, self._back[0], p - c
        new = Point(y, self.fun(t_new, y))
        return (error if np.isfinite(new.f).all() else np.inf), new, p - c

    def _runge_kutta(self, length: float) -> tuple[float, Point, Point]:
        """Take two Runge-Kutta steps of half the length; return their error, and the points at the middle and at the end.

        The error, relative to the tolerance, is estimated from the difference to one step of the full length.
        """
        t, h = self.t, self.direction * length
        start = self._back[0]
        with np.errstate(invalid="ignore", over="ignore"):
            coarse = self._rk4(t, start, h)
            middle = self._point(t + 0.5 * h, self._rk4(t, start, 0.5 * h))
            y = self._rk4(t + 0.5 * h, middle, 0.5 * h)
            error = self._norm((y - coarse) / 15.0, np.maximum(np.abs(start.y), np.abs(y)))
        if not error <= 1.0:
            return error, middle, start
        new = self._point(t + h, y)
        return (error if np.isfinite(new.f).all() else np.inf), middle, new

    def _rk4(self, t: float, point: Point, h: float) -> Array:
        """Return the state after one classic Runge-Kutta step of size ``h`` from a point at time t."""
        y, k1 = point
        k2: Array = self.fun(t + 0.5 * h, y + 0.5 * h * k1)
        k3: Array = self.fun(t + 0.5 * h, y + 0.5 * h * k2)
        k4: Array = self.fun(t + h, y + h * k3)
        return np.asarray(y + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))

    def _point(self, t: float, y: Array) -> Point:
        return Point(y, self.fun(t, y))

    def _double(self) -> None:
        """Double the step and keep every second back value, if seven are stored and the longer step is allowed."""
        h = 2.0 * self.h
        room = abs(self.t_bound - self.t)
        if len(self._back) < BACK_VALUES or h > self.max_step * (1.0 + 1e-12) or h > room:
            return
        self._back = self._back[::2]
        self._rescale(h)
        self._p_minus_c = self._estimate()
        self.doublings += 1

    def _halve(self) -> bool:
        """Halve the step and interpolate the back values; return False if the derivatives there are not finite."""
        h = self.direction * self.h
        (y0, f0), (y1, f1), (y2, f2), (y3, _) = self._back[:4]
        # Hermite interpolation of degree 6 through y_n .. y_(n-3) and f_n .. f_(n-2)
        at_1 = (80.0 * y0 + 135.0 * y1 + 40.0 * y2 + y3) / 256.0 + h / 256.0 * (-15.0 * f0 + 90.0 * f1 + 15.0 * f2)
        at_3 = (12.0 * y0 + 135.0 * y1 + 108.0 * y2 + y3) / 256.0 + h / 256.0 * (-3.0 * f0 - 54.0 * f1 + 27.0 * f2)
        halves = [self._point(self.t - 0.5 * h, at_1), self._point(self.t - 1.5 * h, at_3)]
        if not all(np.isfinite(point.f).all() for point in halves):
            return False
        self._back = [self._back[0], halves[0], self._back[1], halves[1]]
        self._rescale(0.5 * self.h)
        self._p_minus_c = self._estimate()
        self.halvings += 1
        return True

    def _estimate(self) -> Array:
        """Estimate p_n - c_n for new back values: 242/27 times the error of the 3/8 rule over the last four of them."""
        h = self.direction * self.h
        (y0, f0), (_, f1), (_, f2), (y3, f3) = self._back[:4]
        return np.asarray(242.0 / 27.0 * (y0 - y3 - 0.375 * h * (f0 + 3.0 * (f1 + f2) + f3)))

    def _dense_output_impl(self) -> DenseOutput:
        return _Quintic(self.t_old, self.t, self._nodes, self._node_points)


class _Quintic(DenseOutput):  # type: ignore[misc]
    """Hermite interpolation of degree 5 through three equidistant points and their derivatives.

    The points are the ends and the middle of a Runge-Kutta step, or the ends of a Hamming step and the point before it.
    """

    def __init__(self, t_old: float, t: float, nodes: tuple[float, ...], points: tuple[Point, ...]) -> None:
        super().__init__(t_old, t)
        h = t - t_old
        x = np.repeat(nodes, 2)
        y = np.array([row for point in points for row in (point.y, h * point.f)])
        self._polynomial = KroghInterpolator(x, y)

    def _call_impl(self, t: Array) -> Array:
        return np.asarray(self._polynomial((t - self.t_old) / (self.t - self.t_old)).T)
