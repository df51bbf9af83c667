"""Compute damping and natural frequency of a mass on a spring from the logarithmic decrement of its free decay.

A mass m on a spring k with a damper c and dry friction F has its turning points at

    x_n = b + (-1)^n [(A + f) q^n - f],  f = r (1 + q) / (1 - q),  r = F / k,

every half period T/2 = pi / omega_d, where q = exp(-delta / 2) and delta = pi c / (m omega_d) is the logarithmic decrement of
a whole cycle. Dry friction shortens each swing by the same length, the damper by the same percentage; friction does not change
the period. Friction does change the acceleration at a turning point at the distance x from b: it is the acceleration due to
the spring, times 1 + r / x before the turning point, and times 1 - r / x after it.

A strongly damped motion has too few turning points: the whole curve x = b + exp(-s t) (C cos(omega_d t) + D sin(omega_d t)),
where s = delta omega_d / (2 pi), is then fitted to all samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, cos, exp, pi, sin, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import curve_fit

from linkwork.errors import InputError

#: Default of the smallest swing, as a fraction of the record's range: smaller swings count as noise.
LEAST_SWING = 0.1
#: Half width of the wave fitted at a turning point, as a fraction of half a period.
_WINDOW = 1.0 / 6.0
#: Rounds of the iteration between the friction and the waves, whose curvature jumps by an amount that depends on friction.
_ROUNDS = 4
#: Greatest residual of a fit of the whole curve, as a fraction of the record's range.
_MISFIT = 0.03
#: Greatest number of samples from which the fit of the whole curve gets its first guess.
_GUESSED = 400
#: Damping ratios that are tried for the first guess, each with this number of frequencies.
_RATIOS, _FREQUENCIES = (0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8), 80
#: Error of a record whose swings do not become smaller.
_GROWING = "the swings of the record do not decay: it must begin after the impulse, and run freely"
#: Largest deviation of the time between turning points from half a period, as a fraction of half a period.
_UNEVEN = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """Fit of a free decay; ``*_error`` are standard errors.

    Attributes
    ----------
    time, position : ndarray, shape (n,)
        Times (s) and positions (in the record's unit) of the turning points, or of all samples if ``whole``.
    fitted : ndarray, shape (n,)
        Positions at these times by the fit.
    decrement : float
        Logarithmic decrement of a cycle.
    frequency : float
        Frequency of the damped oscillation (rad/s).
    friction : float
        Dry friction divided by the spring's stiffness, in the record's unit; 0 if it was not fitted.
    offset : float
        Position of rest without friction, in the record's unit.
    residual : float
        Root mean square of ``position - fitted``, relative to the first amplitude.
    whole : bool
        Whether the whole curve was fitted, because a strongly damped motion has too few turning points.
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
    whole: bool = False

    def __repr__(self) -> str:
        return (
            f"<Decay: {len(self.time)} {'samples' if self.whole else 'turning points'}, "
            f"damping ratio {self.damping_ratio:.6g} +- "
            f"{self.damping_ratio_error:.2g}, natural frequency {self.natural_frequency:.6g} +- "
            f"{self.natural_frequency_error:.2g} rad/s>"
        )

    @property
    def damping_ratio(self) -> float:
        """Damping relative to critical damping."""
        return self.decrement / self._phase

    @property
    def damping_ratio_error(self) -> float:
        return self.decrement_error * 4.0 * pi**2 / self._phase**3

    @property
    def natural_frequency(self) -> float:
        """Natural frequency of the mass on its spring without the damper (rad/s)."""
        return self.frequency * self._phase / (2.0 * pi)

    @property
    def natural_frequency_error(self) -> float:
        relative = self.frequency_error / self.frequency, self.decrement * self.decrement_error / self._phase**2
        return self.natural_frequency * sqrt(relative[0] ** 2 + relative[1] ** 2)

    @property
    def cycle_decrements(self) -> NDArray[np.float64]:
        """Logarithmic decrement of each cycle by itself: with dry friction it grows from cycle to cycle.

        The array is empty if the whole curve was fitted.
        """
        if self.whole:
            return np.empty(0)
        swings = np.abs(np.diff(self.position))
        return np.log(swings[:-2] / swings[2:])

    @property
    def _phase(self) -> float:
        """Return the square root of (2 pi)^2 + decrement^2."""
        return sqrt(4.0 * pi**2 + self.decrement**2)

    def damping(self, mass: float) -> tuple[float, float]:
        """Return the damping coefficient (N.s/m) for a given mass (kg), and its standard error."""
        factor = mass / pi
        value = factor * self.decrement * self.frequency
        relative = self.decrement_error / self.decrement, self.frequency_error / self.frequency
        return value, abs(value) * sqrt(relative[0] ** 2 + relative[1] ** 2)

    def stiffness(self, mass: float) -> tuple[float, float]:
        """Return the stiffness of the spring (N/m) for a given mass (kg), and its standard error."""
        value = mass * self.natural_frequency**2
        return value, 2.0 * value * self.natural_frequency_error / self.natural_frequency


def fit_decay(
    time: ArrayLike, position: ArrayLike, *, friction: bool = False, least_swing: float = LEAST_SWING
) -> Decay:
    """Fit logarithmic decrement, damping ratio and natural frequency to a record of a free decay.

    The times of the turning points and the decay of their distances from a constant offset are fitted by least squares. Each
    turning point is the vertex of a sine wave fitted to the samples near it, which averages noise. If a record without friction
    has one to four turning points, as with damping ratios above 0.15, the whole curve is fitted to all samples instead.

    Parameters
    ----------
    time, position : array_like, shape (n,)
        The record after the impulse: times (s), and positions in any unit. It need not begin at a turning point.
    friction : bool
        Whether to fit dry friction besides the damper.
    least_swing : float
        Smallest distance between successive turning points, as a fraction of the record's range. Smaller distances count as
        noise.

    Raises
    ------
    InputError
        If the arrays do not form a record, or the record has too few swings or does not decay.

    Examples
    --------
    >>> import numpy as np
    >>> from analysis.numerics.decay import fit_decay
    >>> t = np.linspace(0.0, 1.0, 2001)
    >>> decay = fit_decay(t, np.exp(-2.0 * t) * np.sin(40.0 * t))
    >>> round(decay.decrement / (2.0 * np.pi / 40.0), 2)
    2.0
    """
    t, x = _check_record(time, position)
    if not 0.0 < least_swing < 1.0:
        raise InputError(
            f"the least swing is {least_swing!r}: it must be between 0 and 1, a part of the record's range"
        )
    turns = _turning_points(x, least_swing * float(np.ptp(x)))
    if not friction and 0 < len(turns) < 5:
        return _fit_curve(t, x)
    needed, too = (6, " with friction") if friction else (1, "")
    if len(turns) < needed:
        raise InputError(
            f"the record has {len(turns)} turning points with swings above {least_swing:g} of its range: "
            f"{needed} {'are' if friction else 'is'} needed{too}; a longer record, or a smaller least swing, has more"
            + ("; a strongly damped motion can be fitted without friction only" if friction and turns else "")
            + ("; is it the right column?" if not turns else "")
        )
    spaces = np.diff(t[turns])
    half = float(np.median(spaces))
    if np.abs(spaces / half - 1.0).max() > _UNEVEN:
        gap = int(np.argmax(np.diff(t)))
        raise InputError(
            f"the record's turning points are {spaces.min():.3g} to {spaces.max():.3g} s apart, so it is not a free "
            "oscillation: begin after the impulse and, if noise causes turning points, choose a greater least swing"
            + (
                f"; there is no sample from {t[gap]:.6g} to {t[gap + 1]:.6g} s"
                if t[gap + 1] - t[gap] > 0.5 * half
                else ""
            )
        )

    places, reach = range(len(turns)), half * _WINDOW
    order = min(3, len(turns) // 3)  # the period of a nonlinear oscillation changes with its amplitude
    found = _fit(np.array([_vertex(t, x, turn, reach) for turn in turns]), friction)
    for _ in range(_ROUNDS if friction else 1):
        # read at smoothed times: noise moves the vertex of a wave outwards, which would lessen the decrement
        smooth = np.polyval(np.polyfit(places, found.time, order, w=np.abs(found.fitted - found.offset)), places)
        jumps = np.clip(found.friction / np.abs(found.position - found.offset), -1.0, 1.0)
        tops = [
            (_vertex(t, x, turn, reach, jump)[0], _height(t, x, time, reach, jump))
            for turn, jump, time in zip(turns, jumps, smooth)
        ]
        found = _fit(np.array(tops), friction)
    return found


def _fit_curve(t: NDArray[np.float64], x: NDArray[np.float64]) -> Decay:
    """Fit a damped vibration to all samples of a record that has few turning points."""
    s, span, range_ = t - t[0], float(t[-1] - t[0]), float(np.ptp(x))

    def waves(s: NDArray[np.float64], rate: float, frequency: float) -> NDArray[np.float64]:
        fading = np.exp(-rate * s)
        return np.column_stack([np.ones_like(s), fading * np.cos(frequency * s), fading * np.sin(frequency * s)])

    def model(s: NDArray[np.float64], rate: float, frequency: float, *sizes: float) -> NDArray[np.float64]:
        return np.asarray(waves(s, rate / span, frequency / span) @ np.array(sizes))

    few = slice(None, None, 1 + len(s) // _GUESSED)
    best, guess = np.inf, np.zeros(5)
    for ratio in _RATIOS:
        for frequency in np.geomspace(pi, 0.25 * pi * min(len(s), _GUESSED), _FREQUENCIES):
            rate = ratio * frequency / sqrt(1.0 - ratio**2)
            columns = waves(s[few], rate / span, frequency / span)
            sizes = np.linalg.lstsq(columns, x[few] / range_, rcond=None)[0]
            misfit = float(np.mean((columns @ sizes - x[few] / range_) ** 2))
            if misfit < best:
                best, guess = misfit, np.array([rate, frequency, *sizes])
    try:
        values, spread = curve_fit(model, s, x / range_, guess, method="trf", x_scale="jac", max_nfev=4000)
    except RuntimeError as error:
        raise InputError("no damped vibration fits the record") from error
    rate, frequency, fitted = float(values[0]), float(values[1]), range_ * model(s, *values)
    residual = float(np.sqrt(np.mean((x - fitted) ** 2)))
    if not residual < _MISFIT * range_:
        raise InputError(
            f"the record has too few turning points for the decrement, and no damped vibration fits it within {_MISFIT:.0%} of "
            f"its range, but within {residual / range_:.2%} only: it must begin where the mass moves freely, after the impulse "
            "or the release"
        )
    if not (rate > 0.0 and np.isfinite(spread).all()):
        raise InputError(_GROWING)
    decrement = 2.0 * pi * rate / frequency
    slope = np.array([1.0 / rate, -1.0 / frequency])  # of log(decrement) over rate and frequency
    return Decay(
        time=t,
        position=x,
        fitted=fitted,
        decrement=decrement,
        decrement_error=decrement * sqrt(float(slope @ spread[:2, :2] @ slope)),
        frequency=frequency / span,
        frequency_error=sqrt(float(spread[1, 1])) / span,
        friction=0.0,
        friction_error=0.0,
        offset=range_ * float(values[2]),
        residual=residual / (range_ * float(np.hypot(*values[3:]))),
        whole=True,
    )


def _check_record(time: ArrayLike, position: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    try:
        t, x = np.asarray(time, dtype=float), np.asarray(position, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError("time and position must be numbers") from error
    if t.ndim != 1 or t.shape != x.shape:
        raise InputError(f"time has the shape {t.shape}, position {x.shape}: they must be lists of one length")
    if not len(t):
        raise InputError("the record is empty: does the chosen span of time contain samples?")
    for name, values in (("time", t), ("position", x)):
        if not np.isfinite(values).all():
            raise InputError(f"{name} has {int((~np.isfinite(values)).sum())} values that are not finite")
    if not (np.diff(t) > 0.0).all():
        at = int(np.argmax(np.diff(t) <= 0.0))
        raise InputError(f"time does not increase: {t[at]:g} s is followed by {t[at + 1]:g} s; is it the right column?")
    return t, x


def _turning_points(x: NDArray[np.float64], swing: float) -> list[int]:
    """Return the indices of alternating maxima and minima that differ by at least ``swing``."""
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


def _vertex(
    t: NDArray[np.float64], x: NDArray[np.float64], turn: int, reach: float, jump: float = 0.0
) -> tuple[float, float]:
    """Return the vertex (time, position) of the wave that fits the samples near a turning point: see `_wave`."""
    time, near, rate = t[turn], _samples_near(t, turn, t[turn], reach), pi * _WINDOW / reach
    height = 0.0
    for _ in range(_ROUNDS):
        a, b, height = _wave(rate * (t[near] - time), x[near], jump)
        step = atan(-b / a) if a else 0.0
        time, height = time + step / rate, height + a * (1.0 - cos(step)) + b * sin(step)
    return time, height


def _height(t: NDArray[np.float64], x: NDArray[np.float64], time: float, reach: float, jump: float) -> float:
    """Return the position at the known time of a turning point, by a wave that fits the samples near it."""
    turn = int(np.clip(np.abs(t - time).argmin(), 1, len(t) - 2))
    near = _samples_near(t, turn, time, reach)
    return _wave(pi * _WINDOW / reach * (t[near] - time), x[near], jump)[2]


def _samples_near(t: NDArray[np.float64], turn: int, middle: float, reach: float) -> slice:
    """Return the samples within ``reach`` of the time ``middle``, at least the sample ``turn`` and its neighbours."""
    first, last = np.searchsorted(t, (middle - reach, middle + reach))
    return slice(max(min(int(first), turn - 1), 0), max(int(last), turn + 2))


def _wave(phase: NDArray[np.float64], x: NDArray[np.float64], jump: float) -> list[float]:
    """Fit a (1 - cos(phase)) + b sin(phase) + c to positions x; return a, b and c.

    The curvature is the mean curvature times (1 + ``jump``) before phase 0, and times (1 - ``jump``) after it.
    """
    columns = np.column_stack(
        [(1.0 - np.cos(phase)) * (1.0 - jump * np.sign(phase)), np.sin(phase), np.ones_like(phase)]
    )
    return list(np.linalg.lstsq(columns, x, rcond=None)[0].tolist())


def _fit(tops: NDArray[np.float64], friction: bool) -> Decay:
    """Fit the decay to the turning points (time, position)."""
    place, height = tops.T
    n = np.arange(len(height), dtype=float)
    sides = np.where(n % 2 == 0, 1.0, -1.0)
    swings = np.abs(np.diff(height))
    start = -float(np.polyfit(n[:-1], np.log(swings), 1)[0])
    if start <= 0.0:
        raise InputError(_GROWING)

    def model(n: NDArray[np.float64], size: float, half: float, offset: float, dry: float = 0.0) -> NDArray[np.float64]:
        q = np.exp(-half)
        constant = dry / np.tanh(0.5 * half)
        return np.asarray(offset + sides * ((size + constant) * q**n - constant))

    size = (height[0] - height[1]) / (1.0 + exp(-start))
    # in units of the first amplitude, so that the tolerances of the fit are relative; MINPACK's Levenberg-Marquardt method is
    # not used, because it finds no covariance if the guess is already the result
    unit = np.array([abs(size), 1.0, abs(size), abs(size)])[: 4 if friction else 3]
    guess = np.array([size, start, height[0] - size, 0.0])[: unit.size] / unit
    try:
        scaled, covariance = curve_fit(model, n, height / abs(size), guess, method="trf", x_scale="jac", max_nfev=4000)
    except RuntimeError as error:
        raise InputError("no decay fits the record's turning points") from error
    values, errors = (scaled * unit).tolist(), (np.sqrt(np.diag(covariance)) * unit).tolist()
    (size, half, offset, *dry), (_, half_error, _, *dry_error) = values, errors
    if not half > 0.0 or not np.isfinite(errors).all():
        raise InputError("no decaying motion fits the record's turning points: is there more friction than damping?")
    fitted = model(n, *values)
    # the time of a turning point is the less certain, the smaller its distance from the offset
    (half_period, _), spread = np.polyfit(n, place, 1, w=np.abs(fitted - offset), cov=True)
    return Decay(
        time=place,
        position=height,
        fitted=fitted,
        decrement=2.0 * half,
        decrement_error=2.0 * half_error,
        frequency=pi / float(half_period),
        frequency_error=pi * sqrt(float(spread[0, 0])) / float(half_period) ** 2,
        friction=(dry[0] if size > 0.0 else -dry[0]) if dry else 0.0,
        friction_error=dry_error[0] if dry else 0.0,
        offset=offset,
        residual=float(np.sqrt(np.mean((height - fitted) ** 2)) / abs(size)),
    )
