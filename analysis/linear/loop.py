"""Simulate a closed loop: a sampled controller with the nonlinear plant or with a linear model of the plant.

In `control_loop` the controller samples the plant, or the plant's FMU, and holds the force for each step, like a digital one.
`predict_loop` runs the same controller with the linear model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf, isfinite
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, IntegrationError
from linkwork.mechanism import Channel, Mechanism
from linkwork.plant import Plant

from ..mechanisms import InitialState, Parameters, find_mechanism, variable_unit
from ..run import (
    FmuRun,
    Inputs,
    Trajectory,
    align,
    check_run,
    complete_initial_state,
    complete_inputs,
    encode,
    float_array,
    require_kind,
    sample,
    sample_times,
    takes_published,
)
from ..units import Amount, in_si, si
from .design import Design, check_period
from .model import FloatArray, LinearModel, sample_channels
from .periodic import PeriodicModel

#: A constant reference, or a function of time (s) that is sampled with the controller.
Reference = Amount | Callable[[float], float]
#: Largest product of a step of the linear model's Runge-Kutta method with its fastest rate.
FINE_STEP = 0.03
#: Greatest rate and acceleration, relative to the mechanism's scales and stiffness, of the state of a model for `predict_loop`.
AT_REST = 1e-6


def saturate(force: float, limit: float) -> float:
    """Return a force clipped to the range from -limit to limit."""
    return min(max(force, -limit), limit)


def check_limit(limit: float) -> None:
    """Check that the limit of a force (N) is above zero.

    Raises
    ------
    InputError
        If the limit is not greater than zero.
    """
    if not limit > 0.0:
        raise InputError(f"limit of the force is {limit} N: it must be greater than zero")


def rms(values: FloatArray) -> float:
    """Return the root mean square of the values."""
    return float(np.sqrt(np.mean(values**2)))


def peak(values: FloatArray) -> float:
    """Return the largest magnitude of the values."""
    return float(np.abs(values).max())


class SampledController:
    """A design as a sampled controller: it measures the state, computes the force, and holds the force for a period.

    Parameters
    ----------
    design : Design
    period : float
        Sampling period (s).
    limit : float
        Largest magnitude of the force (N). While the force is at the limit, the integral does not grow further.
    """

    @in_si(period="s")
    def __init__(self, design: Design, period: Amount, *, limit: Amount = inf) -> None:
        require_kind(design, Design, "design", "what design_lqr, design_pid or design_pi returns")
        limit = si(limit, variable_unit(design.model.mechanism, design.channel), "limit")
        check_period(period)
        check_limit(limit)
        self.design = design
        self.period = period
        self.limit = limit
        self.integral = 0.0
        self.channel = design.channel
        self._place = design.freedom
        self._gains: list[float] = design.plant_values(design.gains).tolist()
        self._target: list[float] = design.plant_values(design.target).tolist()
        self._slope: list[float] = design.plant_values(design.target_slope).tolist()

    def reset(self) -> None:
        """Set the integral of the control error to zero."""
        self.integral = 0.0

    @property
    def method(self) -> str:
        """Name of the design method."""
        return self.design.method

    def force(self, measured: Sequence[float], reference: float) -> float:
        """Return the force for the next period; ``measured`` has all coordinates, then all rates."""
        step = reference - self._target[self._place]
        wanted = self.holding_force(reference)
        for gain, value, target, slope in zip(self._gains, measured, self._target, self._slope):
            wanted -= gain * (value - target - slope * step)
        return self._limit_force(wanted, measured[self._place] - reference)

    def holding_force(self, reference: float) -> float:
        """Return the force that, by the linear model, holds the coordinate at a reference."""
        return self.design.force + self.design.force_slope * (reference - self._target[self._place])

    def follow(self, feedforward: float, position_error: float, velocity_error: float) -> float:
        """Return the force for the next period along a moving reference, from the errors of the coordinate and its rate.

        ``feedforward`` replaces the holding force; the gains of other coordinates are not used.
        """
        k_u, k_v = self._gains[self._place], self._gains[len(self._gains) // 2 + self._place]
        return self._limit_force(feedforward - k_u * position_error - k_v * velocity_error, position_error)

    def _limit_force(self, wanted: float, error: float) -> float:
        """Add the integral part to the force, clip the force to the limit, and advance the integral by the error."""
        d = self.design
        wanted -= d.integral_gain * self.integral
        # beyond the limit the integral must not ask for an even larger force
        if abs(wanted) <= self.limit or wanted * d.integral_gain * error > 0.0:
            self.integral += self.period * error
        return saturate(wanted, self.limit)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMetrics:
    """Settling, overshoot, tracking error and force of a closed loop.

    Attributes
    ----------
    settling_time : float or None
        Time from the start until the coordinate stays within the band about the reference (s); None if it never does.
    overshoot : float
        Greatest excursion beyond the reference, relative to the initial distance from the reference.
    peak_force : float
        Largest magnitude of the force (N).
    rms_error, peak_error : float
        Deviation from the reference over the window at the end of the run (m).
    rms_force : float
        Root mean square of the force over this window (N).
    """

    settling_time: float | None
    overshoot: float
    peak_force: float
    rms_error: float
    peak_error: float
    rms_force: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopResult:
    """A run of a closed loop at the controller's sampling times.

    Attributes
    ----------
    time : ndarray, shape (n,)
        The n sampling times (s).
    states : ndarray, shape (n, 2 f)
        All coordinates, then all rates: for a five-bar (th2, u, th2', u').
    force, reference : ndarray, shape (n,)
        Force (N) and reference (m); each value holds until the next sample.
    freedom : int
        Index of the controlled degree of freedom; by default the last.
    trajectory : Trajectory or None
        All outputs of the plant; None for a linear model.
    status : int
        0 if the run reached its end, otherwise the value of ``solver.status`` in the FMI contract.
    message : str
        Reason why the run ended early; empty if the run reached its end.
    """

    time: FloatArray
    states: FloatArray
    force: FloatArray
    reference: FloatArray
    freedom: int = -1
    trajectory: Trajectory | None = None
    status: int = 0
    message: str = ""

    @property
    def position(self) -> FloatArray:
        """Controlled coordinate (m) at the sampling times, shape (n,)."""
        return self.states[:, : self.states.shape[1] // 2][:, self.freedom]

    @in_si(window="s")
    def end(self, window: Amount) -> NDArray[np.bool_]:
        """Return a mask of the samples in a window of given length (s) at the end of the run.

        Raises
        ------
        InputError
            If the run ended early.
        """
        if self.status:
            raise InputError(f"the run did not reach its end: {self.message}")
        return np.asarray(self.time > self.time[-1] - window * (1.0 - 1e-9))

    @in_si(band="m", start="s", window="s")
    def metrics(self, *, band: Amount, start: Amount = 0.0, window: Amount = None) -> LoopMetrics:
        """Compute settling time, overshoot, force and tracking error.

        Parameters
        ----------
        band : float
            Half width of the band about the reference in which the coordinate counts as settled (m).
        start : float
            Time at which the reference jumps, or control begins (s).
        window : float, optional
            Length of the window at the end (s), such as a period of the motion; by default a tenth of the run.

        Raises
        ------
        InputError
            If band or window is not greater than zero, the start is not within the run, or the run ended early.
        """
        if not band > 0.0:
            raise InputError(f"band of settling is {band} m: it must be greater than zero")
        length = self.time[-1] - self.time[0]
        window = 0.1 * length if window is None else window
        end = self.end(window)
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
        return LoopMetrics(
            settling_time=settled,
            overshoot=max(0.0, past) / abs(float(way)) if way else 0.0,
            peak_force=peak(self.force),
            rms_error=rms(error[end]),
            peak_error=peak(error[end]),
            rms_force=rms(self.force[end]),
        )


class Controller(Protocol):
    """A controller that is sampled every ``period`` s and sets the force ``channel``."""

    @property
    def period(self) -> float: ...

    @property
    def method(self) -> str: ...

    @property
    def channel(self) -> str: ...

    def reset(self) -> None: ...

    def force(self, measured: Sequence[float], reference: float, /) -> float: ...


class _Plant(Protocol):
    """Plant of a closed loop: the nonlinear plant, its FMU, or a linear model."""

    mechanism: Mechanism

    def measure(self) -> Sequence[float]: ...

    def act(self, time: float, ahead: float, measured: Sequence[float], force: float) -> None: ...

    def step(self, time: float, step: float) -> tuple[int, str]: ...


def _run_loop(
    plant: _Plant, controller: Controller, reference: Reference, times: FloatArray, freedom: int
) -> LoopResult:
    """Reset the controller and run a closed loop: at each sampling time measure, compute the force, and advance the plant."""
    controller.reset()
    mechanism = plant.mechanism
    unit = variable_unit(mechanism, mechanism.freedoms[freedom].coordinate)
    reference = si(reference, unit, "reference")
    rows: list[tuple[float, ...]] = []
    status, message = 0, ""
    ahead = [*times[1:].tolist(), float(times[-1]) + controller.period]
    for t, later in zip(times.tolist(), ahead):
        measured = tuple(plant.measure())
        wanted = reference(t) if callable(reference) else reference
        if not isfinite(wanted):
            raise InputError(f"the reference is {wanted} {unit} at t = {t:.9g} s: it must be a finite number")
        force = controller.force(measured, wanted)
        rows.append((*measured, force, wanted))
        plant.act(t, later, measured, force)
        if len(rows) < len(times):
            status, message = plant.step(t, later - t)
        if status:
            break
    table = np.array(rows)
    return LoopResult(
        time=times[: len(table)],
        states=table[:, :-2],
        force=table[:, -2],
        reference=table[:, -1],
        freedom=freedom,
        status=status,
        message=message,
    )


class _DrivenPlant:
    """Base class of the nonlinear plants; inputs other than the controller's force are held between the sampling times."""

    def __init__(self, mechanism: Mechanism, inputs: Inputs, channel: str, times: FloatArray) -> None:
        self.mechanism, self.channel = mechanism, channel
        self._encoded = align(encode(inputs, mechanism), times)
        self._laws = self._encoded.source.laws.copy()
        self.modes = self._encoded.modes
        self.rows: list[Sequence[float]] = []

    def inputs(self, time: float, ahead: float, measured: Sequence[float]) -> dict[str, float]:
        """Return all inputs for the step from ``time`` to ``ahead`` by FMI name, with 0 for the controller's force."""
        x = np.array([*measured, 0.0, 0.0])
        return dict(zip(self.mechanism.input_names, sample(self._encoded, time, x, self._laws, ahead=ahead).tolist()))


class _InProcess(_DrivenPlant):
    """The nonlinear plant, simulated in this process."""

    plant: Plant

    def measure(self) -> Sequence[float]:
        return self.plant.state[:-2]

    def act(self, time: float, ahead: float, measured: Sequence[float], force: float) -> None:
        for name, value in (self.inputs(time, ahead, measured) | {self.channel: force}).items():
            self.plant.set_input(name, value)
        self.rows.append(self.plant.outputs())

    def step(self, time: float, step: float) -> tuple[int, str]:
        try:
            self.plant.step(time, step)
        except (AssemblyError, IntegrationError) as error:
            return (3 if isinstance(error, AssemblyError) else 4), str(error)
        return 0, ""


class _Fmu(_DrivenPlant):
    """The nonlinear plant, simulated by its FMU."""

    run: FmuRun

    def measure(self) -> Sequence[float]:
        values = dict(zip(self.mechanism.output_names, self.run.outputs()))
        freedoms = self.mechanism.freedoms
        return [values[f.coordinate] for f in freedoms] + [values[f.rate] for f in freedoms]

    def act(self, time: float, ahead: float, measured: Sequence[float], force: float) -> None:
        self.run.set_inputs(self.inputs(time, ahead, measured) | {self.channel: force})
        self.rows.append(self.run.outputs())

    def step(self, time: float, step: float) -> tuple[int, str]:
        return self.run.step(time, step)


def _channel(mechanism: Mechanism, name: str) -> Channel:
    """Return the channel with an FMI name; raise InputError if the channel is not a force on a degree of freedom."""
    for channel in mechanism.channels:
        if channel.name == name and channel.kind == "force" and channel.freedom >= 0:
            return channel
    raise InputError(f"the controller acts by {name!r}, which is not a force on a freedom of the {mechanism.name}")


def _check_argument(channel: Channel, inputs: Inputs) -> None:
    """Raise InputError if the controller's channel is among the inputs."""
    if channel.argument in inputs:
        raise InputError(f"{channel.argument} is among the inputs, but the controller sets it")


@takes_published(inputs=complete_inputs, initial=complete_initial_state)
@in_si(stop_time="s")
def control_loop(
    parameters: Parameters,
    controller: Controller,
    reference: Reference,
    inputs: Inputs | None = None,
    *,
    initial: InitialState,
    stop_time: Amount,
    fmu: str | Path | None = None,
    tolerance: float = 1e-9,
) -> LoopResult:
    """Run a closed loop of a controller and the nonlinear plant; the plant runs in this process or as its FMU.

    Parameters
    ----------
    parameters
        Parameters of a mechanism.
    controller : Controller
        A controller such as a `SampledController`; it is reset first.
    reference : float or function of time
        Reference of the controlled coordinate, such as the slider position (m).
    inputs : Inputs, optional
        Inputs other than the controller's force, such as the speed of the crank (0 for a held crank); none by default. They
        are sampled and held at the controller's times.
    initial
        State at the start.
    stop_time : float
        End of the run (s).
    fmu : path, optional
        The mechanism's FMU, which is run instead of the plant in this process.
    tolerance : float
        Tolerance of the plant's integrator.

    Returns
    -------
    LoopResult
        If the motion reaches the limit of assembly, or cannot be followed, the result ends there, with a status and a message.

    Raises
    ------
    InputError
        If an argument is not usable, or the inputs contain the controller's force.
    AssemblyError
        If the links cannot be joined at the start.
    """
    mechanism = find_mechanism(parameters)
    inputs, initial = check_run(mechanism, inputs, initial)
    channel = _channel(mechanism, controller.channel)
    _check_argument(channel, inputs)
    # an argument that is given, even as 0, chooses the mode in which it acts
    inputs = inputs.replace(**{channel.argument: 0.0})
    times = sample_times(stop_time, controller.period)
    if fmu is None:
        inner = _InProcess(mechanism, inputs, controller.channel, times)
        first = inner.inputs(float(times[0]), float(times[1]), mechanism.state(initial)[:-2])
        modes = {name.replace(".", "_"): value for name, value in inner.modes.items()}
        inner.plant = Plant(mechanism, parameters, initial, tolerance=tolerance, inputs=first, **modes)
        result = _run_loop(inner, controller, reference, times, channel.freedom)
        rows, source = np.array(inner.rows), "plant in process"
    else:
        outer = _Fmu(mechanism, inputs, controller.channel, times)
        first = outer.inputs(float(times[0]), float(times[1]), mechanism.state(initial)[:-2])
        with FmuRun(
            fmu, parameters, initial, modes=outer.modes, inputs=first, start_time=0.0, tolerance=tolerance
        ) as outer.run:
            result = _run_loop(outer, controller, reference, times, channel.freedom)
        rows, source = np.array(outer.rows), str(fmu)
    trajectory = Trajectory(
        time=result.time,
        values=rows,
        names=mechanism.output_names,
        status=result.status,
        message=result.message,
        source=f"{source}, {controller.method} sampled",
        parameters=parameters,
    )
    return replace(result, trajectory=trajectory)


class _Linear:
    """Linear model as the plant of a loop: simulates deviations from the model's equilibrium or periodic motion."""

    def __init__(
        self,
        model: LinearModel | PeriodicModel,
        channel: str,
        inputs: Inputs | None,
        averaged: bool,
        deviation: FloatArray,
    ) -> None:
        one = model if isinstance(model, LinearModel) else model.mean()
        self.mechanism, self.places = one.mechanism, one.places
        self.encoded = None if inputs is None else encode(check_run(self.mechanism, inputs, None)[0], self.mechanism)
        n, forces = 2 * len(self.mechanism.freedoms), list(one.layout.forces)
        self.forces, self.own = forces, forces.index(self.mechanism.input_names.index(channel))
        still, acting = one.state[:n], one.channels[forces]
        self.motion: Callable[[float], FloatArray] = lambda t: still
        self.acting: Callable[[float], FloatArray] = lambda t: acting
        if isinstance(model, PeriodicModel):
            self.motion, self.acting = model.motion(), model.interpolate(model.channels[:, forces])
        if isinstance(model, LinearModel) or averaged:
            a, b = one.A, one.B
            self.a: Callable[[float], FloatArray] = lambda t: a
            self.b: Callable[[float], FloatArray] = lambda t: b
        else:
            self.a, self.b = model.interpolate(model.A), model.interpolate(model.B)
        self.rate = float(np.abs(np.linalg.eigvals(model.A)).max())
        self.x = deviation
        self.t = 0.0
        self.held: dict[int, float] = {}

    def measure(self) -> Sequence[float]:
        values = self.motion(self.t).copy()
        values[self.places] += self.x
        return [float(value) for value in values]

    def act(self, time: float, ahead: float, measured: Sequence[float], force: float) -> None:
        if self.encoded is not None:
            x = np.array([*measured, 0.0, 0.0])
            self.held = dict(enumerate(sample(self.encoded, time, x, self.encoded.source.laws)[self.forces]))
        self.held[self.own] = force

    def step(self, time: float, step: float) -> tuple[int, str]:
        count = max(1, ceil(step * self.rate / FINE_STEP))
        h = step / count
        # forces that are not held are those of the motion
        held, forces = list(self.held), np.array(list(self.held.values()))

        def rates(t: float, x: FloatArray) -> FloatArray:
            change: FloatArray = self.a(t) @ x + self.b(t)[:, held] @ (forces - self.acting(t)[held])
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
    inputs: Inputs | None = None,
    *,
    stop_time: Amount,
    deviation: ArrayLike | None = None,
    averaged: bool = False,
) -> LoopResult:
    """Run a closed loop of a controller and the linear model, to predict the result of `control_loop`.

    Parameters
    ----------
    model : LinearModel or PeriodicModel
        Model about an equilibrium or about a periodic motion. The deviations are added to this equilibrium or motion; the run
        starts at the first sample of the motion.
    controller, reference, stop_time
        As for `control_loop`.
    inputs : Inputs, optional
        Forces that act; commanded degrees of freedom move as at the operating point. By default all forces are those of the
        operating point.
    deviation : array_like, shape (2 n,), optional
        Deviation of the model's state from its operating point at the start.
    averaged : bool
        Whether the time-averaged model of a periodic motion is used instead of the time-periodic model.

    Raises
    ------
    InputError
        If an argument is not usable, or the model is about a single state that is not an equilibrium.
    """
    n = model.A.shape[-1]
    wanted = f"a deviation {deviation!r}: it must be {n} finite numbers"
    start = np.zeros(n) if deviation is None else float_array(deviation, wanted)
    if start.shape != (n,) or not np.all(np.isfinite(start)):
        raise InputError(wanted)
    channel = _channel(model.mechanism, controller.channel)
    if controller.channel not in model.input_names:
        raise InputError(f"the controller acts by {controller.channel}, which is not an input of the model")
    if isinstance(model, LinearModel):
        _check_rest(model)
    if inputs is not None:
        _check_argument(channel, inputs)
        _check_inputs(model, inputs)
    times = sample_times(stop_time, controller.period)
    plant = _Linear(model, controller.channel, inputs, averaged, start)
    return _run_loop(plant, controller, reference, times, channel.freedom)


def _check_inputs(model: LinearModel | PeriodicModel, inputs: Inputs) -> None:
    """Raise InputError if an input does not act in a model, or commands another speed than that of the operating point."""
    mechanism, its = model.mechanism, model.layout
    for number, channel in enumerate(mechanism.channels):
        acts = channel.freedom in its.commanded if channel.kind == "command" else number in its.forces
        if channel.argument in inputs and not acts:
            coordinate = mechanism.freedoms[channel.freedom].coordinate
            how = "commanded" if channel.freedom in its.commanded else "not commanded"
            raise InputError(
                f"{channel.argument} is among the inputs, but {coordinate} is {how} in the model: leave it out"
            )
    times, states = (np.zeros(1), [model.state]) if isinstance(model, LinearModel) else (model.times, model.states)
    sample_channels(mechanism, inputs, times, np.array(states))


def _check_rest(model: LinearModel) -> None:
    """Raise InputError if a model is not about an equilibrium."""
    mechanism, n = model.mechanism, len(model.mechanism.freedoms)
    scale = np.array(mechanism.error_scale(model.parameters, (0.0,) * mechanism.size))[:n]
    free, size = list(model.layout.free), len(model.layout.free)
    stiffness = np.abs(model.A[size:, :size] * scale[free] / scale[free, None]).max()
    moving = np.maximum(np.abs(model.acceleration), np.abs(model.state[n : 2 * n])) / scale
    if moving.max() > AT_REST * max(1.0, stiffness):
        raise InputError(
            f"the model is about a state that is not at rest, most of all in {mechanism.freedoms[int(moving.argmax())].rate}: "
            "use a model about an equilibrium, or the PeriodicModel of a periodic motion"
        )


def largest_difference(first: LoopResult, second: LoopResult) -> float:
    """Return the largest difference (m) between the controlled coordinates of two runs of the same length."""
    if first.time.shape != second.time.shape:
        raise InputError(
            f"runs of {len(first.time)} and {len(second.time)} samples: both runs must have the same number"
        )
    return float(np.abs(first.position - second.position).max())
