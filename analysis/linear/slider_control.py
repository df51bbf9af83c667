"""Control of the slider by its force: designed on a linear model, closed around the nonlinear plant.

Every design is one law of the deviations x from an operating point x0 with the force F0, at a reference r of the slider's
position whose own operating point is x0 + x_s (r - u0), F0 + F_s (r - u0) on the linear model:

    F2 = F0 + F_s (r - u0) - k (x - x0 - x_s (r - u0)) - k_i * integral of (u - r)

LQR chooses k and k_i by weights, PID by poles, PI (no gain on the velocity) by crossover and phase margin. `control_loop`
runs the law sampled and held over the steps of the plant or of its FMU, as a controller beside it does; `predict_loop` runs
the same controller on the linear model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf, isfinite, pi
from pathlib import Path
from typing import Protocol

import control
import numpy as np
from linkwork.five_bar.GONE import SPEED_DRIVE, TORQUE_DRIVE
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, IntegrationError, LinkworkError, UnknownNameError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.variables import OUTPUT_NAMES
from linkwork.plant import Plant

from ..run import FmuRun, Function, Trajectory, sample_times
from .linearise import COORDINATES, RATES, LinearModel, PeriodicModel, signal_name

FloatArray = NDArray[np.float64]
#: A value, or a function of time (s) that is sampled with the controller.
Reference = float | Callable[[float], float]
Load = tuple[float, float] | Callable[[float], tuple[float, float]]

MEASURED = (*COORDINATES, *RATES)
_COLUMNS = [OUTPUT_NAMES.index(name) for name in MEASURED]

#: Largest product of a step of the linear model's Runge-Kutta method with its fastest rate.
FINE_STEP = 0.03


class DesignError(LinkworkError):
    """A controller cannot be designed as asked."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SliderDesign:
    """A control law for the slider force, with what the linear model says of it.

    Attributes
    ----------
    method : str
        LQR, PID or PI.
    model : LinearModel
        On which it was designed.
    gains : ndarray, shape (2 n,)
        k: of the model's state (q, q'), in N per rad, m, rad/s, m/s.
    integral_gain : float
        k_i (N/(m.s)); zero if there is no integral action.
    target, target_slope : ndarray, shape (2 n,)
        x0, and x_s per m of the reference.
    force, force_slope : float
        F0 (N), and F_s (N/m).
    poles : ndarray
        Of the closed loop (1/s), by magnitude.
    gain_margin : float
        Factor on the force up to which the loop stays stable, infinite if there is none.
    phase_margin : float
        rad; infinite if the loop's gain nowhere crosses 1.
    crossover : float
        Highest frequency at which the loop's gain is 1 (rad/s); zero if there is none.
    delay_margin : float
        Dead time that makes the loop unstable (s). Sampling with a period h adds about h/2.
    """

    method: str
    model: LinearModel
    gains: FloatArray
    integral_gain: float
    target: FloatArray
    target_slope: FloatArray
    force: float
    force_slope: float
    poles: NDArray[np.complex128]
    gain_margin: float
    phase_margin: float
    crossover: float
    delay_margin: float

    @property
    def loop(self) -> control.StateSpace:
        """The open loop, from the slider force to what the controller takes from it."""
        return _loop(self.model, self.gains, self.integral_gain)

    def closed(self, outputs: Sequence[str] = ("slider.position",)) -> control.StateSpace:
        """The closed loop, from a force that disturbs the slider to outputs by their FMI names."""
        a, b = _integrating(self.model)
        row = np.append(self.gains, self.integral_gain)[None, :]
        whole = self.model.to_state_space(outputs, ("slider.force",))
        c = np.hstack([whole.C, np.zeros((len(outputs), 1))]) - whole.D @ row
        if not self.integral_gain:
            a, b, row, c = a[:-1, :-1], b[:-1], row[:, :-1], c[:, :-1]
        return control.ss(
            a - b @ row, b, c, whole.D, inputs=["slider_force"], outputs=[signal_name(name) for name in outputs]
        )

    def sampled_poles(self, period: float) -> NDArray[np.complex128]:
        """Poles (in z) of the linear model under the law sampled every ``period`` s and held: inside the unit circle or not."""
        check_period(period)
        a, b = _plant(self.model)
        held = control.sample_system(control.ss(a, b, np.eye(len(a)), np.zeros((len(a), 1))), period, method="zoh")
        n = len(a)
        closed = np.zeros((n + 1, n + 1))
        closed[:n, :n] = held.A - held.B @ self.gains[None, :]
        closed[:n, n:] = -held.B * self.integral_gain
        closed[n, n // 2 - 1] = period
        closed[n, n] = 1.0
        # without integral action nothing depends on the integral
        kept = closed if self.integral_gain else closed[:n, :n]
        return _by_size(np.linalg.eigvals(kept))

    def continuous(self, reference: float) -> Function:
        """The law without sampling, as the ``force`` of `analysis.run.inputs.Inputs`.

        Raises
        ------
        DesignError
            If the law has integral action: its integral is no function of the plant's state.
        """
        if self.integral_gain:
            raise DesignError("a law with integral action is no function of the state: run it with control_loop")
        k_th2, k_u, k_w2, k_v = _on_plant(self.model, self.gains)
        step = reference - float(self.target[len(self.target) // 2 - 1])
        th2_0, u_0, w2_0, v_0 = _on_plant(self.model, self.target + step * self.target_slope)
        bias = self.force + step * self.force_slope

        def force(t: float, th2: float, u: float, w2: float, v: float) -> float:
            return bias - k_th2 * (th2 - th2_0) - k_u * (u - u_0) - k_w2 * (w2 - w2_0) - k_v * (v - v_0)

        return Function(force)


def _on_plant(model: LinearModel, values: FloatArray) -> tuple[float, float, float, float]:
    """Values by the model's state as values by (th2, u, th2', u'), zero where the model has no such state."""
    named = dict(zip(model.state_names, values.tolist()))
    th2, u, w2, v = (named.get(name, 0.0) for name in MEASURED)
    return th2, u, w2, v


def _by_size(values: ArrayLike) -> NDArray[np.complex128]:
    whole = np.asarray(values, dtype=complex)
    return whole[np.lexsort((whole.imag, np.abs(whole)))]


def _plant(model: LinearModel) -> tuple[FloatArray, FloatArray]:
    """A, and the column of B that belongs to the slider force."""
    column = model.input_names.index("slider.force")
    return model.A, model.B[:, [column]]


def _integrating(model: LinearModel) -> tuple[FloatArray, FloatArray]:
    """The same with the integral of the slider's position as the last state."""
    a, b = _plant(model)
    n = len(a)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n] = a
    whole[n, n // 2 - 1] = 1.0
    return whole, np.vstack([b, [[0.0]]])


def _loop(model: LinearModel, gains: FloatArray, integral_gain: float) -> control.StateSpace:
    a, b = _integrating(model)
    row = np.append(gains, integral_gain)[None, :]
    if not integral_gain:
        a, b, row = a[:-1, :-1], b[:-1], row[:, :-1]
    return control.ss(a, b, row, 0.0, inputs=["slider_force"], outputs=["feedback"])


def _design(method: str, model: LinearModel, gains: FloatArray, integral_gain: float) -> SliderDesign:
    """The design of these gains, once it is seen to be stable."""
    a, b = _plant(model)
    n = len(a)
    if not model.speed_drive and model.state[2] != 0.0:
        raise DesignError(
            f"{method}: the free crank turns at {model.state[2]:.4g} rad/s: a law that holds its angle needs an equilibrium"
        )
    if not (np.all(np.isfinite(gains)) and isfinite(integral_gain)):
        raise DesignError(f"{method}: the gains {gains} and {integral_gain} are not finite")
    loop = _loop(model, gains, integral_gain)
    poles = _by_size(np.linalg.eigvals(loop.A - loop.B @ loop.C))
    if poles.real.max() >= -1e-9 * np.abs(poles).max():
        raise DesignError(
            f"{method}: the closed loop is not stable, its poles are {np.array2string(poles, precision=4)} 1/s"
        )
    # where the linear model stays with the slider 1 m further on
    border = np.zeros((n + 1, n + 1))
    border[:n, :n], border[:n, n:], border[n, n // 2 - 1] = a, b, 1.0
    try:
        still = np.linalg.solve(border, np.append(np.zeros(n), 1.0))
    except np.linalg.LinAlgError:
        raise DesignError(f"{method}: no slider force holds the slider at another position") from None
    gain, phase, _, _, crossings, _ = control.stability_margins(loop, returnall=True)
    phase, crossings = np.atleast_1d(np.radians(phase)), np.atleast_1d(crossings)
    # a margin below zero is one of a loop that needs its gain: as a delay it is a turn less that
    delays = np.where(phase > 0.0, phase, phase + 2.0 * pi) / crossings
    gains_up = [float(value) for value in np.atleast_1d(gain) if value > 1.0]
    return SliderDesign(
        method=method,
        model=model,
        gains=gains,
        integral_gain=integral_gain,
        target=_values(model),
        target_slope=still[:n],
        force=model.inputs.force,
        force_slope=float(still[n]),
        poles=poles,
        gain_margin=min(gains_up, default=inf),
        phase_margin=float(np.abs(phase).min(initial=inf)),
        crossover=float(crossings.max(initial=0.0)),
        delay_margin=float(delays.min(initial=inf)),
    )


def _values(model: LinearModel) -> FloatArray:
    """The operating point by the model's state."""
    named = dict(zip(MEASURED, model.state[:4].tolist()))
    return np.array([named[name] for name in model.state_names])


def design_lqr(
    model: LinearModel, q: Mapping[str, float] | ArrayLike, r: float = 1.0, *, integral: float = 0.0
) -> SliderDesign:
    """State feedback that minimises the integral of x' Q x + r F^2 (+ integral * (integral of u)^2) on the linear model.

    Parameters
    ----------
    model : LinearModel
        Of an equilibrium, or the mean one of a periodic motion.
    q : mapping or array_like
        Weights by name of the state, those left out zero; or the diagonal of Q, or Q. Of a deviation of 1 mm that may
        cost as much as a force of 1 N it is 1e6 r.
    r : float
        Weight of the force.
    integral : float
        Weight of the integral of the slider's position (1/s2); above zero the law has integral action.

    Raises
    ------
    UnknownNameError
        If a weight is for a state that the model has not.
    DesignError
        If a weight is not usable, or the force cannot stabilise the model.
    """
    names = model.state_names
    if isinstance(q, Mapping):
        for name in q:
            if name not in names:
                raise UnknownNameError(name, names, None)
        q = [q.get(name, 0.0) for name in names]
    weights = np.array(q, dtype=float)
    if weights.ndim == 1:
        weights = np.diag(weights)
    n = len(names)
    if weights.shape != (n, n):
        raise DesignError(
            f"weights of shape {weights.shape}: there must be {n}, of {', '.join(names)}, or a square of them"
        )
    if not np.all(np.isfinite(weights)) or np.linalg.eigvalsh(0.5 * (weights + weights.T))[0] < 0.0:
        raise DesignError(f"weights {weights.tolist()}: they must be finite and none below zero")
    if not (isfinite(r) and r > 0.0):
        raise DesignError(f"weight of the force is {r}: it must be finite and greater than zero")
    if not (isfinite(integral) and integral >= 0.0):
        raise DesignError(f"weight of the integral is {integral}: it must be finite and not below zero")
    a, b = _integrating(model)
    if integral:
        weights = np.block([[weights, np.zeros((n, 1))], [np.zeros((1, n)), np.array([[integral]])]])
    else:
        a, b = a[:-1, :-1], b[:-1]
    try:
        gains = np.asarray(control.lqr(a, b, weights, [[r]])[0])[0]
    except (np.linalg.LinAlgError, ValueError, control.ControlArgument) as error:
        raise DesignError(f"LQR: the slider force cannot stabilise this model under these weights ({error})") from error
    return _design("LQR", model, gains[:n], float(gains[n]) if integral else 0.0)


def design_pid(
    model: LinearModel,
    *,
    poles: Sequence[complex] | None = None,
    bandwidth: float | None = None,
    damping: float = 0.7,
) -> SliderDesign:
    """PID with the derivative on the measured velocity, by the three poles of the closed loop.

    Parameters
    ----------
    model : LinearModel
        In speed drive, where the slider is the one freedom.
    poles : sequence of 3 complex, optional
        1/s, real or in conjugate pairs, left of the imaginary axis.
    bandwidth, damping : float
        Instead of poles (rad/s): they are -bandwidth times 1 and damping +- i sqrt(1 - damping^2).

    Raises
    ------
    DesignError
        If the model has more than one freedom, or the poles are not usable.
    """
    if not model.speed_drive:
        raise DesignError("a PID places the three poles of one freedom: with a free crank use design_lqr")
    if (poles is None) == (bandwidth is None):
        raise DesignError("a PID needs either its poles or its bandwidth")
    if bandwidth is not None:
        _check_positive("bandwidth", bandwidth, "rad/s")
        if not 0.0 < damping <= 1.0:
            raise DesignError(f"damping is {damping}: it must be above 0 and at most 1")
        pair = bandwidth * complex(-damping, (1.0 - damping**2) ** 0.5)
        poles = [-bandwidth, pair, pair.conjugate()]
    wanted = np.array(poles, dtype=complex)
    polynomial = np.poly(wanted) if wanted.shape == (3,) else np.array([1j])
    if not np.all(np.isreal(polynomial)) or wanted.real.max() >= 0.0:
        raise DesignError(
            f"poles {wanted.tolist()}: there must be three, real or conjugate, left of the imaginary axis"
        )
    _, a2, a1, a0 = polynomial.real.tolist()
    # m s^3 + (c + k_d) s^2 + (k + k_p) s + k_i = m (s^3 + a2 s^2 + a1 s + a0)
    m, c, k = (float(matrix[0, 0]) for matrix in (model.M, model.C, model.K))
    return _design("PID", model, np.array([m * a1 - k, m * a2 - c]), m * a0)


def design_pi(model: LinearModel, *, bandwidth: float, phase_margin: float = pi / 3.0) -> SliderDesign:
    """PI whose loop has the gain 1 at ``bandwidth``, and there at least the phase margin.

    Where the slider itself lags so little that an integral alone leaves more than the margin, there is no proportional part.

    Parameters
    ----------
    model : LinearModel
    bandwidth : float
        Crossover (rad/s).
    phase_margin : float
        rad.

    Raises
    ------
    DesignError
        If a PI cannot: it has no phase lead to give, and so none where a sprung slider needs it, near its resonance and
        above.
    """
    _check_positive("bandwidth", bandwidth, "rad/s")
    if not 0.0 < phase_margin < pi:
        raise DesignError(f"phase margin is {phase_margin} rad: it must be between 0 and pi")
    system = model.to_state_space(("slider.position",), ("slider.force",))
    response = complex(system(1j * bandwidth))
    needed = np.exp(1j * (phase_margin - pi)) / response
    if needed.imag >= 0.0:
        raise DesignError(
            f"PI: at {bandwidth:g} rad/s the slider lags by {np.degrees(-np.angle(response)) % 360.0:.1f} deg, which leaves "
            f"no phase margin of {np.degrees(phase_margin):.1f} deg without phase lead: use design_pid, or a bandwidth "
            "further below the resonance"
        )
    proportional, integral = float(needed.real), float(-bandwidth * needed.imag)
    if proportional < 0.0:
        proportional, integral = 0.0, bandwidth / abs(response)
    gains = np.array([proportional if name == "slider.position" else 0.0 for name in model.state_names])
    design = _design("PI", model, gains, integral)
    if design.phase_margin < phase_margin - 1e-6:
        raise DesignError(
            f"PI: the gain of the loop comes back to 1 at {design.crossover:.4g} rad/s, near the resonance, and leaves a "
            f"phase margin of {np.degrees(design.phase_margin):.2f} deg: use design_pid, or a smaller bandwidth"
        )
    return design


def _check_positive(name: str, value: float, unit: str) -> None:
    if not (isfinite(value) and value > 0.0):
        raise DesignError(f"{name} is {value} {unit}: it must be finite and greater than zero")


def check_period(period: float) -> None:
    """Make sure that a sampling period (s) is usable.

    Raises
    ------
    InputError
        If it is not a finite number greater than zero.
    """
    if not (isfinite(period) and period > 0.0):
        raise InputError(f"sampling period is {period} s: it must be a finite number greater than zero")


class SampledController:
    """A design as a controller runs it: measures, computes the force, which then holds for a period.

    Parameters
    ----------
    design : SliderDesign
    period : float
        s.
    limit : float
        Largest force either way (N). At the limit the integral does not grow further against it.
    """

    def __init__(self, design: SliderDesign, period: float, *, limit: float = inf) -> None:
        check_period(period)
        if not limit > 0.0:
            raise InputError(f"limit of the force is {limit} N: it must be greater than zero")
        self.design = design
        self.period = period
        self.limit = limit
        self.integral = 0.0
        self._gains = _on_plant(design.model, design.gains)
        self._target = _on_plant(design.model, design.target)
        self._slope = _on_plant(design.model, design.target_slope)

    def reset(self) -> None:
        """Forget the integral."""
        self.integral = 0.0

    @property
    def method(self) -> str:
        """How it was designed."""
        return self.design.method

    def force(self, measured: Sequence[float], reference: float) -> float:
        """The force (N) for the next period, from (th2, u, th2', u') and the reference (m)."""
        step = reference - self._target[1]
        wanted = self.holding_force(reference)
        for gain, value, target, slope in zip(self._gains, measured, self._target, self._slope):
            wanted -= gain * (value - target - slope * step)
        return self._limited(wanted, measured[1] - reference)

    def holding_force(self, reference: float) -> float:
        """The force (N) that holds the slider at a reference (m) on the linear model."""
        return self.design.force + self.design.force_slope * (reference - self._target[1])

    def follow(self, feedforward: float, position_error: float, velocity_error: float) -> float:
        """The force (N) for the next period along a moving reference, from the slider's errors (m, m/s) against it.

        ``feedforward`` (N) takes the place of the holding force; no gain acts on the crank.
        """
        _, k_u, _, k_v = self._gains
        return self._limited(feedforward - k_u * position_error - k_v * velocity_error, position_error)

    def _limited(self, wanted: float, error: float) -> float:
        """The force wanted, integral added, within the limit; the integral goes on by the error (m)."""
        d = self.design
        wanted -= d.integral_gain * self.integral
        # a force beyond the limit is not asked for still louder
        if abs(wanted) <= self.limit or wanted * d.integral_gain * error > 0.0:
            self.integral += self.period * error
        return min(max(wanted, -self.limit), self.limit)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMetrics:
    """What a closed loop achieved.

    Attributes
    ----------
    settling_time : float or None
        From the start to when the slider stays within the band about the reference (s); None if it does not.
    overshoot : float
        How far the slider goes past the reference, as a share of the way to it.
    peak_force : float
        Largest force either way (N).
    rms_error, peak_error : float
        Of the slider against the reference over the window at the end (m).
    rms_force : float
        Over that window (N).
    """

    settling_time: float | None
    overshoot: float
    peak_force: float
    rms_error: float
    peak_error: float
    rms_force: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopResult:
    """A run of a closed loop, at the times at which the controller sampled.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s.
    states : ndarray, shape (n, 4)
        (th2, u, th2', u').
    force, reference : ndarray, shape (n,)
        N, m; each holds until the next sample.
    trajectory : Trajectory or None
        All outputs of the plant; a linear model has none.
    status : int
        0 if the run reached its end, else the solver.status of the FMI contract.
    message : str
        Why it ended early; empty if it did not.
    """

    time: FloatArray
    states: FloatArray
    force: FloatArray
    reference: FloatArray
    trajectory: Trajectory | None = None
    status: int = 0
    message: str = ""

    @property
    def position(self) -> FloatArray:
        """Slider position (m), shape (n,)."""
        return self.states[:, 1]

    def metrics(self, *, band: float, start: float = 0.0, window: float | None = None) -> LoopMetrics:
        """Settling, overshoot, force and tracking error.

        Parameters
        ----------
        band : float
            Of settling, either way (m).
        start : float
            When the reference steps, or control begins (s).
        window : float, optional
            Length of the window at the end (s), such as a period of the motion; by default a tenth of the run.

        Raises
        ------
        InputError
            If band or window is not greater than zero, the start is not within the run, or the run ended early.
        """
        if self.status:
            raise InputError(f"the loop did not reach its end: {self.message}")
        if not band > 0.0:
            raise InputError(f"band of settling is {band} m: it must be greater than zero")
        length = self.time[-1] - self.time[0]
        window = 0.1 * length if window is None else window
        if not 0.0 < window <= length * (1.0 + 1e-9) or not self.time[0] <= start < self.time[-1]:
            raise InputError(
                f"a window of {window} s and a start at {start} s: both must lie within the run from {self.time[0]:g} s to "
                f"{self.time[-1]:g} s"
            )
        first = int(np.searchsorted(self.time, start - 1e-9 * length))
        error = self.position - self.reference
        outside = np.nonzero(np.abs(error[first:]) > band)[0]
        settled: float | None = 0.0
        if len(outside):
            after = first + int(outside[-1]) + 1
            settled = float(self.time[after] - self.time[first]) if after < len(self.time) else None
        way = self.reference[first] - self.position[first]
        past = float((np.sign(way) * error[first:]).max())
        end = self.time > self.time[-1] - window * (1.0 - 1e-9)
        return LoopMetrics(
            settling_time=settled,
            overshoot=max(0.0, past) / abs(float(way)) if way else 0.0,
            peak_force=float(np.abs(self.force).max()),
            rms_error=float(np.sqrt(np.mean(error[end] ** 2))),
            peak_error=float(np.abs(error[end]).max()),
            rms_force=float(np.sqrt(np.mean(self.force[end] ** 2))),
        )


class Controller(Protocol):
    """What closes a loop every ``period`` s."""

    @property
    def period(self) -> float: ...

    @property
    def method(self) -> str: ...

    def reset(self) -> None: ...

    def force(self, measured: Sequence[float], reference: float, /) -> float: ...


class _Plant(Protocol):
    """What a loop is closed around."""

    def measure(self) -> Sequence[float]: ...

    def act(self, force: float, load: tuple[float, float]) -> None: ...

    def step(self, time: float, step: float) -> tuple[int, str]: ...


def _run_loop(plant: _Plant, controller: Controller, reference: Reference, load: Load, times: FloatArray) -> LoopResult:
    """Measure, compute, hold, step; the controller starts afresh."""
    controller.reset()
    rows: list[tuple[float, ...]] = []
    status, message = 0, ""
    for index, t in enumerate(times.tolist()):
        measured = tuple(plant.measure())
        wanted = reference(t) if callable(reference) else reference
        if not isfinite(wanted):
            raise InputError(f"the reference is {wanted} m at t = {t:.9g} s: it must be a finite number")
        force = controller.force(measured, wanted)
        rows.append((*measured, force, wanted))
        plant.act(force, load(t) if callable(load) else load)
        if index + 1 < len(times):
            status, message = plant.step(t, float(times[index + 1]) - t)
        if status:
            break
    table = np.array(rows)
    return LoopResult(
        time=times[: len(table)],
        states=table[:, :4],
        force=table[:, 4],
        reference=table[:, 5],
        status=status,
        message=message,
    )


class _InProcess:
    """The plant in this process."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.rows: list[tuple[float, ...]] = []

    def measure(self) -> Sequence[float]:
        return self.plant.state[:4]

    def act(self, force: float, load: tuple[float, float]) -> None:
        for name, value in (("slider.force", force), ("load.fx", load[0]), ("load.fy", load[1])):
            self.plant.set_input(name, value)
        self.rows.append(self.plant.outputs())

    def step(self, time: float, step: float) -> tuple[int, str]:
        try:
            self.plant.step(time, step)
        except (AssemblyError, IntegrationError) as error:
            return (3 if isinstance(error, AssemblyError) else 4), str(error)
        return 0, ""


class _Fmu:
    """The plant's FMU."""

    def __init__(self, run: FmuRun, inputs: dict[str, float]) -> None:
        self.run = run
        self.inputs = inputs
        self.rows: list[list[float]] = []

    def measure(self) -> Sequence[float]:
        values = self.run.outputs()
        return [values[column] for column in _COLUMNS]

    def act(self, force: float, load: tuple[float, float]) -> None:
        self.inputs |= {"slider.force": force, "load.fx": load[0], "load.fy": load[1]}
        self.run.set_inputs(self.inputs)
        self.rows.append(self.run.outputs())

    def step(self, time: float, step: float) -> tuple[int, str]:
        return self.run.step(time, step)


def control_loop(
    parameters: FiveBarParameters,
    controller: Controller,
    reference: Reference,
    *,
    initial: InitialState,
    stop_time: float,
    crank_speed: float | None = None,
    crank_torque: float = 0.0,
    load: Load = (0.0, 0.0),
    fmu: str | Path | None = None,
    tolerance: float = 1e-9,
) -> LoopResult:
    """Close a controller around the nonlinear plant, in process or as its FMU.

    Parameters
    ----------
    parameters : FiveBarParameters
    controller : Controller
        Such as a `SampledController`; starts with its integral at zero.
    reference : float or function of time
        Slider position to hold (m).
    initial : InitialState
    stop_time : float
        s.
    crank_speed : float, optional
        Constant prescribed speed (rad/s), 0 of a crank that is held; by default the crank is free.
    crank_torque : float
        On a free crank (N.m).
    load : (float, float) or function of time
        On the coupler point P (N), sampled and held with the controller.
    fmu : path, optional
        FiveBarSlider.fmu to be run instead of the plant in process.
    tolerance : float
        Of the plant's integrator.

    Returns
    -------
    LoopResult
        A loop in which the motion reaches the limit of assembly, or cannot be followed, ends there with a status, a message
        and all data up to it.

    Raises
    ------
    InputError
        If something given is not usable.
    AssemblyError
        If the links cannot be joined at the start.
    """
    if crank_speed is not None and crank_torque:
        raise InputError("both crank speed and torque are given: the crank can be driven by one of them only")
    times = sample_times(stop_time, controller.period)
    mode = TORQUE_DRIVE if crank_speed is None else SPEED_DRIVE
    inputs = {
        "drive.torque": crank_torque,
        "drive.speed": crank_speed or 0.0,
        "drive.acceleration": 0.0,
        "slider.force": 0.0,
        "load.fx": 0.0,
        "load.fy": 0.0,
    }
    if fmu is None:
        inner = _InProcess(Plant(parameters, initial, drive_mode=mode, tolerance=tolerance, inputs=inputs))
        result = _run_loop(inner, controller, reference, load, times)
        rows, source = np.array(inner.rows), "plant in process"
    else:
        modes = {"drive.mode": mode}
        with FmuRun(fmu, parameters, initial, modes=modes, inputs=inputs, start_time=0.0, tolerance=tolerance) as run:
            outer = _Fmu(run, inputs)
            result = _run_loop(outer, controller, reference, load, times)
            rows, source = np.array(outer.rows), str(fmu)
    trajectory = Trajectory(
        time=result.time,
        values=rows,
        status=result.status,
        message=result.message,
        source=f"{source}, {controller.method} sampled",
    )
    return replace(result, trajectory=trajectory)


class _Linear:
    """Deviations of a linear model from the motion that it is about."""

    def __init__(self, model: LinearModel | PeriodicModel, averaged: bool, deviation: FloatArray) -> None:
        one = model if isinstance(model, LinearModel) else model.mean()
        self.names = one.state_names
        self.free = [MEASURED.index(name) for name in self.names]
        self.columns = [one.input_names.index(name) for name in ("slider.force", "load.fx", "load.fy")]
        self.acting = np.array([one.inputs.force, one.inputs.load_x, one.inputs.load_y])
        still = one.state[:4]
        self.motion: Callable[[float], FloatArray] = lambda t: still
        if isinstance(model, PeriodicModel):
            self.motion = model.motion()
        if isinstance(model, LinearModel) or averaged:
            a, b = one.A, one.B
            self.a: Callable[[float], FloatArray] = lambda t: a
            self.b: Callable[[float], FloatArray] = lambda t: b
        else:
            self.a, self.b = model.interpolated(model.A), model.interpolated(model.B)
        self.rate = float(np.abs(np.linalg.eigvals(model.A)).max())
        self.x = deviation
        self.t = 0.0
        self.w = np.zeros(3)

    def measure(self) -> Sequence[float]:
        values = self.motion(self.t).copy()
        values[self.free] += self.x
        return [float(value) for value in values]

    def act(self, force: float, load: tuple[float, float]) -> None:
        self.w = np.array([force, *load]) - self.acting

    def step(self, time: float, step: float) -> tuple[int, str]:
        count = max(1, ceil(step * self.rate / FINE_STEP))
        h = step / count

        def rates(t: float, x: FloatArray) -> FloatArray:
            change: FloatArray = self.a(t) @ x + self.b(t)[:, self.columns] @ self.w
            return change

        for number in range(count):
            t = time + number * h
            k1 = rates(t, self.x)
            k2 = rates(t + 0.5 * h, self.x + 0.5 * h * k1)
            k3 = rates(t + 0.5 * h, self.x + 0.5 * h * k2)
            k4 = rates(t + h, self.x + h * k3)
            self.x = self.x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        self.t = time + step
        return 0, ""


def predict_loop(
    model: LinearModel | PeriodicModel,
    controller: Controller,
    reference: Reference,
    *,
    stop_time: float,
    deviation: ArrayLike | None = None,
    load: Load = (0.0, 0.0),
    averaged: bool = False,
) -> LoopResult:
    """The same loop around the linear model: what the design foretells of `control_loop`.

    Parameters
    ----------
    model : LinearModel or PeriodicModel
        About an equilibrium; or about a periodic motion, to which the deviations are then added, from its first sample on.
    controller, reference, stop_time, load
        As for `control_loop`.
    deviation : array_like, shape (2 n,), optional
        Of the model's state from its operating point at the start.
    averaged : bool
        Take the time-averaged model of a periodic motion instead of the time-periodic one.

    Raises
    ------
    InputError
        If something given is not usable, or the model is about a single state that is no equilibrium.
    """
    n = model.A.shape[-1]
    start = np.zeros(n) if deviation is None else np.array(deviation, dtype=float)
    if start.shape != (n,) or not np.all(np.isfinite(start)):
        raise InputError(f"a deviation of shape {start.shape}: it must be {n} finite numbers")
    if isinstance(model, LinearModel):
        p = model.parameters
        moving = np.abs([*(p.crank_length * model.acceleration[:1]), *model.acceleration[1:], *model.state[2:4]]).max()
        if moving > 1e-6 * max(p.gravity, 1.0):
            raise InputError(
                f"the model is about a state that moves (u'' = {model.acceleration[1]:.3g} m/s2): predict about an "
                "equilibrium, or about a periodic motion by its PeriodicModel"
            )
    times = sample_times(stop_time, controller.period)
    return _run_loop(_Linear(model, averaged, start), controller, reference, load, times)


def largest_difference(first: LoopResult, second: LoopResult) -> float:
    """Largest difference of the slider's position between two runs of as many samples (m)."""
    if first.time.shape != second.time.shape:
        raise InputError(f"runs of {len(first.time)} and {len(second.time)} samples: there must be as many in both")
    return float(np.abs(first.position - second.position).max())
