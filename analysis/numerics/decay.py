"""Damping and natural frequency of a freedom on a spring from its free decay: the logarithmic decrement.

A freedom of mass m on a spring k with a damper c and dry friction F turns back at

    x_n = b + (-1)^n [(A + f) q^n - f],  f = r (1 + q) / (1 - q),  r = F / k,

every half period T/2 = pi / omega_d, where q = exp(-delta / 2) and delta = pi c / (m omega_d) is the logarithmic decrement of
a whole cycle. Dry friction shortens each swing by the same amount, the damper by the same part; friction does not change the
period.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import curve_fit

from linkwork.errors import InputError

#: Part of the record's range that a swing must have by default: smaller ones count as noise.
LEAST_SWING = 0.1
#: Part of a period about a turning point over which a parabola is fitted: a cosine is one to 0.03 % there.
_WINDOW = 1.0 / 6.0
#: Part of half a period by which turning points may be out of step.
_UNEVEN = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """What the turning points of a free decay show; ``*_error`` are standard errors.

    Attributes
    ----------
    time, position : ndarray, shape (n,)
        The turning points (s, and the record's unit).
    fitted : ndarray, shape (n,)
        The same by the fit.
    decrement : float
        Logarithmic decrement of a cycle.
    frequency : float
        Of the damped oscillation (rad/s).
    friction : float
        Dry friction over the stiffness of the spring, in the record's unit; 0 where it was not asked for.
    offset : float
        Where the motion comes to rest, but for friction.
    residual : float
        Root of the mean square of ``position - fitted``, relative to the first amplitude.
    """

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    fitted: NDArray[np.float64]
    decrement: float
    decrement_error: float
    frequency: float
    frequency_error: float
    friction: float
    friction_error: float
    offset: float
    residual: float

    @property
    def damping_ratio(self) -> float:
        """Damping relative to critical damping."""
        return self.decrement / self._phase

    @property
    def damping_ratio_error(self) -> float:
        return self.decrement_error * 4.0 * pi**2 / self._phase**3

    @property
    def natural_frequency(self) -> float:
        """Of the freedom without its damper (rad/s)."""
        return self.frequency * self._phase / (2.0 * pi)

    @property
    def natural_frequency_error(self) -> float:
        relative = self.frequency_error / self.frequency, self.decrement * self.decrement_error / self._phase**2
        return self.natural_frequency * sqrt(relative[0] ** 2 + relative[1] ** 2)

    @property
    def cycle_decrements(self) -> NDArray[np.float64]:
        """Logarithmic decrement of each cycle from its two swings alone: it grows from cycle to cycle under dry friction."""
        swings = np.abs(np.diff(self.position))
        return np.log(swings[:-2] / swings[2:])

    @property
    def _phase(self) -> float:
        """Length of (2 pi, decrement)."""
        return sqrt(4.0 * pi**2 + self.decrement**2)

    def damping(self, mass: float) -> tuple[float, float]:
        """Damping coefficient of a mass (kg), and its standard error (N.s/m)."""
        factor = mass / pi
        value = factor * self.decrement * self.frequency
        relative = self.decrement_error / self.decrement, self.frequency_error / self.frequency
        return value, abs(value) * sqrt(relative[0] ** 2 + relative[1] ** 2)

    def stiffness(self, mass: float) -> tuple[float, float]:
        """Stiffness of the spring of a mass (kg), and its standard error (N/m)."""
        value = mass * self.natural_frequency**2
        return value, 2.0 * value * self.natural_frequency_error / self.natural_frequency


def fit_decay(
    time: ArrayLike, position: ArrayLike, *, friction: bool = False, least_swing: float = LEAST_SWING
) -> Decay:
    """Logarithmic decrement, damping ratio and natural frequency of a freely decaying record.

    The turning points are fitted by least squares: where they lie in time, and how their distance from a constant offset
    shrinks. Each of them is the top of a parabola through the samples about it, which averages noise.

    Parameters
    ----------
    time, position : array_like, shape (n,)
        The record (s, and any unit), from after the impulse on; it need not begin at a turning point.
    friction : bool
        Fit dry friction beside the damper.
    least_swing : float
        Part of the record's range that the way from one turning point to the next must have. What is smaller counts as noise.

    Raises
    ------
    InputError
        If the record is no record, has too few swings, or does not decay.

    Examples
    --------
    >>> import numpy as np
    >>> from analysis.numerics.decay import fit_decay
    >>> t = np.linspace(0.0, 1.0, 2001)
    >>> decay = fit_decay(t, np.exp(-2.0 * t) * np.sin(40.0 * t))
    >>> round(decay.decrement / (2.0 * np.pi / 40.0), 2)
    2.0
    """
    t, x = _record(time, position)
    if not 0.0 < least_swing < 1.0:
        raise InputError(
            f"the least swing is {least_swing!r}: it must be between 0 and 1, a part of the record's range"
        )
    turns = _turning_points(x, least_swing * float(np.ptp(x)))
    needed = 6 if friction else 5
    if len(turns) < needed:
        raise InputError(
            f"the record has {len(turns)} turning points with swings above {least_swing:g} of its range: "
            f"{needed} are needed{' with friction' if friction else ''}; a longer record, or a smaller least swing, has more"
        )
    spaces = np.diff(t[turns])
    half = float(np.median(spaces))
    if np.abs(spaces / half - 1.0).max() > _UNEVEN:
        raise InputError(
            f"the record's turning points lie {spaces.min():.3g} to {spaces.max():.3g} s apart, which is no free oscillation: "
            "begin after the impulse, and where noise makes turning points of its own, ask for a greater least swing"
        )
    tops = np.array([_top(t, x, turn, half * _WINDOW) for turn in turns])
    return _fitted(tops, friction)


def _record(time: ArrayLike, position: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        t, x = np.asarray(time, dtype=float), np.asarray(position, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError("time and position must be numbers") from error
    if t.ndim != 1 or t.shape != x.shape:
        raise InputError(f"time has the shape {t.shape}, position {x.shape}: they must be lists of one length")
    if not len(t):
        raise InputError("the record has no times: is there nothing left of it?")
    for name, values in (("time", t), ("position", x)):
        if not np.isfinite(values).all():
            raise InputError(f"{name} has {int((~np.isfinite(values)).sum())} values that are not finite")
    if not (np.diff(t) > 0.0).all():
        at = int(np.argmax(np.diff(t) <= 0.0))
        raise InputError(f"time does not increase: {t[at]:g} s is followed by {t[at + 1]:g} s; is it the right column?")
    return t, x


def _turning_points(x: NDArray[np.float64], swing: float) -> list[int]:
    """Indices of highs and lows in turn, a swing or more on both sides of each."""
    found: list[int] = []
    low = high = 0
    sign = 0
    for i, value in enumerate(x.tolist()):
        high = i if value > x[high] else high
        low = i if value < x[low] else low
        if sign >= 0 and x[high] - value > swing:
            found += [high] if sign else []
            sign, low = -1, i
        elif sign <= 0 and value - x[low] > swing:
            found += [low] if sign else []
            sign, high = 1, i
    return found


def _top(t: NDArray[np.float64], x: NDArray[np.float64], turn: int, reach: float) -> tuple[float, float]:
    """Place and height of the parabola through the samples within a reach of a turning point, three at least."""
    first, last = np.searchsorted(t, (t[turn] - reach, t[turn] + reach))
    near = slice(max(min(int(first), turn - 1), 0), max(int(last), turn + 2))
    middle, scale = t[turn], t[turn + 1] - t[turn - 1]
    a, b, c = np.polyfit((t[near] - middle) / scale, x[near], 2)
    place = float(np.clip(-0.5 * b / a, -reach / scale - 1.0, reach / scale + 1.0)) if a else 0.0
    return middle + scale * place, (a * place + b) * place + c


def _fitted(tops: NDArray[np.float64], friction: bool) -> Decay:
    """The fit of the turning points."""
    place, height = tops.T
    n = np.arange(len(height), dtype=float)
    sides = np.where(n % 2 == 0, 1.0, -1.0)
    swings = np.abs(np.diff(height))
    start = -float(np.polyfit(n[:-1], np.log(swings), 1)[0])
    if start <= 0.0:
        raise InputError("the swings of the record do not decay: it must begin after the impulse, and run freely")

    def model(n: NDArray[np.float64], size: float, half: float, offset: float, dry: float = 0.0) -> NDArray[np.float64]:
        q = np.exp(-half)
        constant = dry / np.tanh(0.5 * half)
        return np.asarray(offset + sides * ((size + constant) * q**n - constant))

    size = (height[0] - height[1]) / (1.0 + exp(-start))
    guess = [size, start, height[0] - size]
    if friction:
        guess.append(0.0)
    try:
        values, covariance = curve_fit(model, n, height, guess, maxfev=4000)
    except RuntimeError as error:
        raise InputError("no decay fits the record's turning points") from error
    errors = np.sqrt(np.diag(covariance))
    if not values[1] > 0.0 or not np.isfinite(errors).all():
        raise InputError("no decaying motion fits the record's turning points: is there more friction than damping?")
    side = 1.0 if values[0] > 0.0 else -1.0
    fitted = model(n, *values)
    # the place of a flat top is as much less certain as the top is lower
    (half_period, _), spread = np.polyfit(n, place, 1, w=np.abs(fitted - values[2]), cov=True)
    return Decay(
        time=place,
        position=height,
        fitted=fitted,
        decrement=2.0 * float(values[1]),
        decrement_error=2.0 * float(errors[1]),
        frequency=pi / float(half_period),
        frequency_error=pi * sqrt(float(spread[0, 0])) / float(half_period) ** 2,
        friction=side * float(values[3]) if friction else 0.0,
        friction_error=float(errors[3]) if friction else 0.0,
        offset=float(values[2]),
        residual=float(np.sqrt(np.mean((height - fitted) ** 2)) / abs(values[0])),
    )
