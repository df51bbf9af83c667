"""Linear models of the plant along a periodic motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from math import isfinite, pi
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from linkwork.errors import InputError
from linkwork.five_bar import dynamics
from linkwork.five_bar.parameters import FiveBarParameters

from ..numerics.fourier import trigonometric
from ..run import Inputs, simulate
from .model import (
    AT_REST,
    COORDINATES,
    RATES,
    FloatArray,
    LinearModel,
    LinearModelError,
    Matrices,
    checked_inputs,
    evaluate,
    six_states,
)

#: Least samples of a period that carry its harmonics.
LEAST_SAMPLES = 16
#: Newton steps at most from an angle to the time at which it is reached.
MOST_ITERATIONS = 60


class Turn(Protocol):
    """One period of a motion at equal steps of the crank angle from 0, its end left out, such as `orbits.Turn`."""

    @property
    def time(self) -> FloatArray: ...

    @property
    def period(self) -> float: ...

    @property
    def states(self) -> FloatArray: ...

    @property
    def inputs(self) -> FloatArray: ...


@runtime_checkable
class Orbit(Protocol):
    """A periodic motion that can be sampled, such as `analysis.periodic.PeriodicOrbit`."""

    def turn(self, samples: int, /) -> Turn: ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeriodicModel(Matrices):
    """The plant about a periodic motion: linear models at s evenly spaced times of a period; see `Matrices`.

    Attributes
    ----------
    period : float
        s.
    states : ndarray, shape (s, 6)
        The motion at the times k period / s, k = 0 ... s - 1.
    inputs : tuple of dynamics.Inputs
        In force there.

    Notes
    -----
    ``model[k]`` is the `LinearModel` at one of the times.
    """

    period: float
    states: FloatArray
    inputs: tuple[dynamics.Inputs, ...]

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, index: int) -> LinearModel:
        return self._model(lambda values: values[index], self.inputs[index])

    def _model(self, reduce: Callable[[FloatArray], FloatArray], inputs: dynamics.Inputs) -> LinearModel:
        arrays = {f.name: reduce(getattr(self, f.name)) for f in fields(Matrices) if f.name != "parameters"}
        return LinearModel(parameters=self.parameters, inputs=inputs, state=reduce(self.states), **arrays)

    @property
    def times(self) -> FloatArray:
        """Times of the samples, shape (s,), from 0 (s)."""
        return self.period * np.arange(len(self)) / len(self)

    def mean(self) -> LinearModel:
        """The time-averaged model: M, C, K, F, H and D are each the mean over the period.

        It foretells slow deviations of a motion whose M and K vary little; `monodromy` says what the motion does in truth.
        """
        average = dynamics.Inputs(*np.mean(np.array(self.inputs), axis=0).tolist())
        return self._model(lambda values: np.asarray(values.mean(axis=0)), average)

    def interpolated(self, values: FloatArray) -> Callable[[float], FloatArray]:
        """The trigonometric polynomial through values at the samples, shape (s, ...), as a function of time."""
        return trigonometric(values, self.period)

    def motion(self) -> Callable[[float], FloatArray]:
        """The motion itself as a function of time: (th2, u, th2', u')."""
        states = self.states[:, :4].copy()
        rate = 2.0 * pi * round(float(states[:, 2].mean()) * self.period / (2.0 * pi)) / self.period
        states[:, 0] -= rate * self.times
        periodic = self.interpolated(states)
        return lambda t: periodic(t) + np.array([rate * t, 0.0, 0.0, 0.0])

    def monodromy(self, tolerance: float = 1e-10) -> FloatArray:
        """What a period makes of the deviations (q, q'), shape (2 n, 2 n): Phi' = A(t) Phi from the unit matrix.

        A(t) is the trigonometric polynomial through its samples, integrated with SciPy. The eigenvalues are Floquet's
        multipliers; in torque drive one of them is 1 along a motion of the free plant.

        Raises
        ------
        LinearModelError
            If SciPy's method fails.
        """
        a = self.interpolated(self.A)
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
            raise LinearModelError(f"the monodromy matrix could not be integrated: {result.message}")
        matrix: FloatArray = result.y[:, -1].reshape(size, size)
        return matrix


def linearise_along(
    parameters: FiveBarParameters,
    motion: ArrayLike | Orbit,
    inputs: dynamics.Inputs | Sequence[dynamics.Inputs] | None = None,
    *,
    period: float | None = None,
    samples: int = 128,
) -> PeriodicModel:
    """Linear models along a periodic motion.

    Parameters
    ----------
    parameters : FiveBarParameters
    motion : array_like, shape (s, 4) or (s, 6), or an orbit
        States at evenly spaced times of one period, the end of it left out; or an object such as
        `analysis.periodic.PeriodicOrbit`.
    inputs : dynamics.Inputs or sequence of s of them
        In force along the motion of an array; by default nothing acts, in torque drive. A torque or force that follows
        the state by a law of its own, a motor's or a controller's, enters with its value: the slope of the law is none of
        the plant's.
    period : float, optional
        s. By default that of the orbit, and of an array at a constant prescribed speed one turn of the crank.
    samples : int
        Samples of an orbit; of an array there are as many as it has.

    Raises
    ------
    InputError
        If inputs or period are given for an orbit; if the samples are fewer than `LEAST_SAMPLES`, not finite, or not those
        of a periodic motion evenly spaced in time.
    AssemblyError
        If the links cannot be joined at one of them.
    """
    if isinstance(motion, Orbit):
        if inputs is not None or period is not None:
            raise InputError("inputs and period are those of the orbit: they cannot be given besides")
        states, inputs, period = _in_time(motion.turn(samples), parameters)
    else:
        states = six_states(motion)
    n = len(states)
    if n < LEAST_SAMPLES:
        raise InputError(f"{n} samples of a period: at least {LEAST_SAMPLES} are needed")
    each = (inputs,) * n if isinstance(inputs, dynamics.Inputs) else (AT_REST,) * n if inputs is None else tuple(inputs)
    if len(each) != n or len({checked_inputs(i).speed_drive for i in each}) != 1:
        raise InputError(f"{len(each)} inputs along {n} states: there must be one for each, all of one drive")
    speed = float(states[0, 2])
    if period is None:
        if each[0].speed_drive == 0.0 or np.ptp(states[:, 2]) > 1e-9 * abs(speed) or speed == 0.0:
            raise InputError(
                "the period must be given: it follows from the states at a constant prescribed speed alone"
            )
        period = 2.0 * pi / abs(speed)
    if not (isfinite(period) and period > 0.0):
        raise InputError(f"period is {period} s: it must be a finite number greater than zero")
    model = PeriodicModel(
        parameters=parameters, period=period, states=states, inputs=each, **evaluate(parameters, states, each)
    )
    _check_periodic(model)
    return model


def _in_time(turn: Turn, parameters: FiveBarParameters) -> tuple[FloatArray, tuple[dynamics.Inputs, ...], float]:
    """States and inputs of a turn at equal steps of time instead of the crank angle, and its period."""
    n, period = len(turn.time), turn.period
    angle = turn.states[:, 0] - turn.states[0, 0]
    way = angle[-1] * n / (n - 1)
    wanted = period * np.arange(n) / n
    lead = trigonometric(turn.time - wanted, way)
    columns = np.hstack([turn.states[:, 1:4], turn.inputs])
    p = parameters.constants()
    # the commanded speed is above zero where there is one
    mode = float(turn.inputs[0, 1] > 0.0)
    values = trigonometric(columns, way)
    states, inputs = np.empty((n, 6)), []
    for k, t in enumerate(wanted):
        x = angle[k]
        for _ in range(MOST_ITERATIONS):
            # dt/d(th2) = 1 / th2'
            step = (period * x / way + float(lead(x)) - t) * float(values(x)[1])
            x -= step
            if abs(step) <= 1e-13 * way:
                break
        here = values(x)
        states[k] = turn.states[0, 0] + x, here[0], here[1], here[2], 0.0, 0.0
        inputs.append(dynamics.applied((mode,), tuple(here[3:].tolist()), p))
    return states, tuple(inputs), period


def _check_periodic(model: PeriodicModel) -> None:
    """Make sure that the slider's velocity is the derivative of its position along the samples taken as periodic.

    Of a wrong period, an end sampled twice or an unsettled motion it is not.
    """
    u, v = model.states[:, 1], model.states[:, 3]
    n = len(u)
    c = np.fft.rfft(u) * 2j * pi / model.period * np.arange(n // 2 + 1)
    if n % 2 == 0:
        c[-1] = 0.0
    gap = float(np.abs(np.fft.irfft(c, n) - v).max())
    if gap > 1e-2 * float(np.abs(v).max()) + 1e-9 * model.parameters.crank_length / model.period:
        raise InputError(
            f"the {n} states are not evenly spaced over one period of {model.period:.9g} s, its end left out: the slider's "
            f"velocity differs from the derivative of its position by {gap:.3g} m/s"
        )


def settled_motion(
    parameters: FiveBarParameters, crank_speed: float, *, samples: int = 128, turns: int = 200, force: float = 0.0
) -> FloatArray:
    """The motion that the slider settles to at a constant crank speed, by running on until it repeats itself.

    Parameters
    ----------
    parameters : FiveBarParameters
    crank_speed : float
        rad/s, not zero.
    samples : int
        States of the last turn, evenly spaced from th2 = 0, its end left out.
    turns : int
        Turns of the crank from rest of the slider.
    force : float
        Constant slider force (N).

    Returns
    -------
    ndarray, shape (samples, 6)

    Raises
    ------
    LinearModelError
        If the run ends early, or the last two turns differ by more than 1e-7 of the crank's length.
    """
    if not (isfinite(crank_speed) and crank_speed != 0.0):
        raise InputError(f"crank speed is {crank_speed} rad/s: it must be finite and not zero")
    turn = 2.0 * pi / abs(crank_speed)
    last = turn * (turns - 2 + np.arange(2 * samples + 1) / samples)
    run = simulate(
        parameters,
        Inputs(speed=crank_speed, force=force),
        stop_time=float(last[-1]),
        samples=np.concatenate([[0.0], last]),
        tolerance=1e-12,
    )
    if run.status:
        raise LinearModelError(f"there is no steady motion at {crank_speed:g} rad/s: {run.message}")
    names = (*COORDINATES, *RATES, "energy.dissipated", "energy.supplied")
    before, after = np.split(np.column_stack([run[name] for name in names])[1:-1], 2)
    gap = float(np.abs(after[:, 1] - before[:, 1]).max())
    if gap > 1e-7 * parameters.crank_length:
        raise LinearModelError(
            f"the motion at {crank_speed:g} rad/s has not settled after {turns} turns: the slider is still {gap:.3g} m "
            "from where it was a turn before"
        )
    after[:, 0] -= 2.0 * pi * np.copysign(turns - 1, crank_speed)
    return after
