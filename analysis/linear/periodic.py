"""Linearise a mechanism along a periodic motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from math import isfinite, lcm, pi
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import InputError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ..mechanisms import Parameters, find_mechanism
from ..numerics.fourier import trigonometric
from ..run import Inputs, check_run, speed_ratio, takes_published
from ..units import Amount, in_si
from . import model
from .model import FloatArray, LinearModel, Matrices, Modes, evaluate, full_states

#: Least number of samples of a period.
LEAST_SAMPLES = 16
#: Check of a model with dry friction by closer samples: how many for each sample of the model, and how many at least in all;
#: largest difference of the two mean decay rates, relative to the fastest pole of the mean model.
BETWEEN, IN_ALL, RESOLVED = 2, 2048, 1e-2
#: Newton steps at most to find the crank angle at a given time.
MOST_ITERATIONS = 60


class Turn(Protocol):
    """One period of a motion, sampled at equal steps of the crank angle, without the end point, such as `periodic.Turn`."""

    @property
    def time(self) -> FloatArray: ...

    @property
    def period(self) -> float: ...

    @property
    def states(self) -> FloatArray: ...

    @property
    def inputs(self) -> FloatArray:
        """Values of the mechanism's channels at the n samples, shape (n, channels)."""
        ...

    @property
    def modes(self) -> Modes:
        """Values of the mechanism's modes."""
        ...


@runtime_checkable
class Orbit(Protocol):
    """A periodic motion that can be sampled, such as `analysis.periodic.PeriodicOrbit`."""

    def turn(self, samples: int, /) -> Turn: ...

    @property
    def run_inputs(self) -> Inputs:
        """Inputs that drive the cranks in a run: motors among them are part of the linear model."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeriodicModel(Matrices):
    """Linear models of a mechanism at s evenly spaced times of a periodic motion; see `Matrices`.

    Attributes
    ----------
    period : float
        Period (s).
    states : ndarray, shape (s, size)
        States of the motion at the times k period / s, k = 0 ... s - 1.
    channels : ndarray, shape (s, channels)
        Values of the mechanism's channels at these times.
    inputs : Inputs or None
        Inputs whose motors and torsion bars are part of the model.

    Notes
    -----
    ``model[k]`` is the `LinearModel` at one of the times.
    """

    period: float
    states: FloatArray
    channels: FloatArray
    inputs: Inputs | None = None

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, index: int) -> LinearModel:
        return self._model(lambda values: values[index])

    def _model(self, reduce: Callable[[FloatArray], FloatArray]) -> LinearModel:
        own = ("parameters", "modes")
        arrays = {f.name: reduce(getattr(self, f.name)) for f in fields(Matrices) if f.name not in own}
        arrays |= {"state": reduce(self.states), "channels": reduce(self.channels)}
        return LinearModel(parameters=self.parameters, modes=self.modes, **arrays)

    @property
    def times(self) -> FloatArray:
        """Times of the samples, shape (s,), from 0 (s)."""
        return self.period * np.arange(len(self)) / len(self)

    def mean(self) -> LinearModel:
        """Return the time-averaged model: the means of M, C, K, F, H and D over the period.

        The mean model predicts slow deviations of a motion whose M and K vary little; `monodromy` is exact.
        """
        return self._model(lambda values: np.asarray(values.mean(axis=0)))

    def interpolate(self, values: FloatArray) -> Callable[[float], FloatArray]:
        """Return the trigonometric polynomial through values at the samples, shape (s, ...), as a function of time."""
        return trigonometric(values, self.period)

    def motion(self) -> Callable[[float], FloatArray]:
        """Return the motion as a function of time: all coordinates, then all rates."""
        n = len(self.mechanism.freedoms)
        rates = np.append(self._mean_rates(), np.zeros(n))
        periodic = self.interpolate(self.states[:, : 2 * n] - self.times[:, None] * rates)
        return lambda t: periodic(t) + t * rates

    def _mean_rates(self) -> FloatArray:
        """Return the mean rates of all f degrees of freedom: whole turns per period for cyclic ones, zero for the others."""
        freedoms = self.mechanism.freedoms
        way = self.states[:, len(freedoms) : 2 * len(freedoms)].mean(axis=0) * self.period
        turned = [f.period * round(w / f.period) if f.period else 0.0 for f, w in zip(freedoms, way)]
        return np.array(turned) / self.period

    def check(self) -> None:
        """Check that the free coordinates and their rates fit together: each rate is the derivative of its coordinate.

        The check fails if the period is wrong, the samples include the end of the period, or the motion has not settled.

        Raises
        ------
        InputError
            If a rate is not the derivative of its coordinate; the message names the coordinate.
        """
        mechanism, n, secular = self.mechanism, len(self), self._mean_rates()
        scale = mechanism.error_scale(self.parameters, tuple(self.states[0].tolist()))
        units = {v.name: v.unit for v in mechanism.variables}
        for k in self.layout.free:
            freedom, rate = mechanism.freedoms[k], self.states[:, len(mechanism.freedoms) + k]
            c = np.fft.rfft(self.states[:, k] - secular[k] * self.times) * 2j * pi / self.period * np.arange(n // 2 + 1)
            if n % 2 == 0:
                c[-1] = 0.0
            gap = float(np.abs(np.fft.irfft(c, n) + secular[k] - rate).max())
            if gap > 1e-2 * float(np.abs(rate).max()) + 1e-9 * scale[k] / self.period:
                raise InputError(
                    f"the {n} states are not evenly spaced over one period of {self.period:.9g} s, its end left out: "
                    f"{freedom.rate} differs from the derivative of {freedom.coordinate} by {gap:.3g} {units[freedom.rate]}"
                )

    def check_resolution(self) -> None:
        """Check that the samples resolve dry friction: compare their mean of the trace of A with that of many more samples.

        Friction makes A large for the short time in which a rate passes through zero, which a sample hits or misses. Minus the
        mean of the trace is the mean decay rate.

        Raises
        ------
        InputError
            If the mean decay rates differ.
        """
        if not any(getattr(self.parameters, field_name(name)) for name in self.mechanism.names("friction")):
            return
        count = max(BETWEEN * len(self), IN_ALL)
        times = self.period * np.arange(count) / count
        motion, channels = self.motion(), self.interpolate(self.channels)
        states = full_states(self.mechanism, [motion(t) for t in times])
        arrays = evaluate(self.parameters, self.modes, states, np.array([channels(t) for t in times]), self.inputs)
        closer = Matrices(parameters=self.parameters, modes=self.modes, **arrays)
        rates = [np.trace(one.A, axis1=-2, axis2=-1).mean() for one in (self, closer)]
        if abs(rates[0] - rates[1]) > RESOLVED * np.abs(self.mean().poles).max():
            raise InputError(
                f"{len(self)} samples do not resolve the linear model over the period: its mean decay rate is {-rates[0]:.4g} "
                f"1/s with them and {-rates[1]:.4g} 1/s with {count}; take more samples, or leave out dry friction"
            )

    def monodromy(self, tolerance: float = 1e-10) -> FloatArray:
        """Compute the monodromy matrix: integrate Phi' = A(t) Phi from the unit matrix over a period; shape (2 n, 2 n).

        A(t) is the trigonometric polynomial through its samples. The eigenvalues are the Floquet multipliers; in torque drive
        one multiplier is 1, that of a deviation along the motion.

        Raises
        ------
        LinearModelError
            If SciPy's method fails.
        """
        from scipy.integrate import solve_ivp  # takes a fifth of a second

        a = self.interpolate(self.A)
        size = self.A.shape[-1]
        result = solve_ivp(
            lambda t, y: (a(t) @ y.reshape(size, size)).ravel(),
            (0.0, self.period),
            np.eye(size).ravel(),
            method="DOP853",
            rtol=tolerance,
            atol=tolerance,
        )
        if not result.success:
            raise model.LinearModelError(f"the monodromy matrix could not be integrated: {result.message}")
        return result.y[:, -1].reshape(size, size)


@takes_published()
@in_si(period="s")
def linearise_orbit(
    parameters: Parameters,
    motion: ArrayLike | Orbit,
    inputs: Inputs | None = None,
    *,
    period: Amount = None,
    samples: int = 128,
) -> PeriodicModel:
    """Linearise a mechanism along a periodic motion.

    Parameters
    ----------
    parameters
        Parameters of the mechanism.
    motion : array_like, shape (s, states), or an orbit
        States at evenly spaced times of one period, without the end point: all coordinates, then all rates; or an object such
        as `analysis.periodic.PeriodicOrbit`.
    inputs : Inputs, optional
        Inputs along a motion given as an array, whose first state is at time 0; none by default. Motors and torsion bars are
        part of the model, as in `linearise`; of a Function, such as a controller, only the value is used.
    period : float, optional
        Period (s); by default the period of the orbit, or, for an array at a constant prescribed speed, the time of one turn.
    samples : int
        Number of samples if the motion is an orbit; ignored for an array.

    Raises
    ------
    InputError
        If inputs or period are given for an orbit; if there are fewer than `LEAST_SAMPLES` samples; or if the samples are not
        finite, not evenly spaced in time, not from a periodic motion, or too few for the changes of the model, as those of dry
        friction.
    AssemblyError
        If the links cannot be joined at one of the samples.
    """
    mechanism = find_mechanism(parameters)
    if isinstance(motion, Orbit):
        if inputs is not None or period is not None:
            raise InputError("an orbit has its own inputs and period: they cannot be given as well")
        turn = motion.turn(samples)
        states, channels = _resample(mechanism, turn)
        modes, period, inputs = turn.modes, turn.period, motion.run_inputs
    else:
        states = full_states(mechanism, motion)
        inputs, _ = check_run(mechanism, inputs, None)
        if period is None:
            period = _turn_time(mechanism, tuple(inputs.modes(mechanism).values()), states)
    if len(states) < LEAST_SAMPLES:
        raise InputError(f"{len(states)} samples of a period: at least {LEAST_SAMPLES} are needed")
    if not (isfinite(period) and period > 0.0):
        raise InputError(f"period is {period} s: it must be a finite number greater than zero")
    if not isinstance(motion, Orbit):
        modes, channels = model.sample_channels(
            mechanism, inputs, period * np.arange(len(states)) / len(states), states
        )
    arrays = evaluate(parameters, modes, states, channels, inputs)
    found = PeriodicModel(
        parameters=parameters, modes=modes, period=period, states=states, channels=channels, inputs=inputs, **arrays
    )
    found.check()
    found.check_resolution()
    return found


def _turn_time(mechanism: Mechanism, modes: Modes, states: FloatArray) -> float:
    """Return the time of one turn (s) of the first cyclic coordinate with a constant commanded speed."""
    for n in model.layout(mechanism, modes).commanded:
        rate, speed = states[:, len(mechanism.freedoms) + n], float(states[0, len(mechanism.freedoms) + n])
        if mechanism.freedoms[n].period and speed != 0.0 and np.ptp(rate) <= 1e-9 * abs(speed):
            return mechanism.freedoms[n].period / abs(speed)
    raise InputError("the period must be given: only at a constant prescribed speed does it follow from the states")


def _resample(mechanism: Mechanism, turn: Turn) -> tuple[FloatArray, FloatArray]:
    """Resample a period at equal time steps instead of equal steps of the crank angle; return the states and the channels."""
    n, count, period = len(turn.time), len(mechanism.freedoms), turn.period
    ways = (turn.states[:, :count] - turn.states[0, :count]).T
    # the crank is the cyclic freedom whose angle has equal steps
    crank = min(mechanism.cyclic_freedoms, key=lambda k: float(np.ptp(np.diff(ways[k]))))
    angle, way = ways[crank], ways[crank][-1] * n / (n - 1)
    wanted = period * np.arange(n) / n
    lead = trigonometric(turn.time - wanted, way)
    columns = np.hstack([turn.states[:, : 2 * count], turn.inputs])
    columns[:, crank] = 0.0
    # the angle of another crank, or of a link that goes round, is periodic after its mean increase is subtracted
    ratios = {
        k: mechanism.freedoms[k].period * round(ways[k][-1] * n / (n - 1) / mechanism.freedoms[k].period) / way
        for k, freedom in enumerate(mechanism.freedoms)
        if freedom.period and k != crank
    }
    for k, ratio in ratios.items():
        columns[:, k] -= ratio * angle
    values = trigonometric(columns, way)
    found = np.empty_like(columns)
    for place, t in enumerate(wanted):
        x = angle[place]
        for _ in range(MOST_ITERATIONS):
            # dt/d(angle) = 1 / rate
            step = (period * x / way + float(lead(x)) - t) * float(values(x)[count + crank])
            x -= step
            if abs(step) <= 1e-13 * way:
                break
        found[place] = values(x)
        found[place, crank] = turn.states[0, crank] + x
        for k, ratio in ratios.items():
            found[place, k] += ratio * x
    return full_states(mechanism, found[:, : 2 * count]), found[:, 2 * count :]


def common_period(mechanism: Mechanism, speeds: Mapping[int, float]) -> float:
    """Return the time (s) after which all turning cranks have made whole turns; 0 if none turns.

    ``speeds`` has the commanded speeds (rad/s) by the indices of their degrees of freedom.
    """
    turning = [k for k, speed in speeds.items() if speed and mechanism.freedoms[k].period]
    if not turning:
        return 0.0
    names = {channel.freedom: channel.argument for channel in mechanism.channels if channel.kind == "command"}
    first, *others = turning
    period, whole = mechanism.freedoms[first].period, [1]
    for k in others:
        ratio = speed_ratio(names[k], speeds[k], names[first], speeds[first])
        whole.append((ratio * Fraction(period / mechanism.freedoms[k].period).limit_denominator()).denominator)
    return lcm(*whole) * period / abs(speeds[first])
