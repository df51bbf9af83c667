"""Simulate a closed loop: a controller samples the plant, or the plant's FMU, and holds the force for each step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError, InputError, IntegrationError
from linkwork.mechanism import Channel, Mechanism
from linkwork.plant import Plant

from .. import run
from ..mechanisms import InitialState, Parameters, find_mechanism, variable_unit
from ..run import FmuRun, Inputs, Trajectory, takes_published
from ..units import Amount, in_si, si
from .design import Design, check_period
from .model import FloatArray

#: A constant reference, or a function of time (s) that is sampled with the controller.
Reference = Amount | Callable[[float], float]


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
        run.require_kind(design, Design, "design", "what design_lqr, design_pid or design_pi returns")
        limit = si(limit, variable_unit(design.model.mechanism, design.channel), "limit")
        check_period(period)
        check_limit(limit)
        self.design = design
        self.period = period
        self.limit = limit
        self.integral = 0.0
        self.channel, self.method = design.channel, design.method
        self._place = design.freedom
        self._gains: list[float] = design.plant_values(design.gains).tolist()
        self._target: list[float] = design.plant_values(design.target).tolist()
        self._slope: list[float] = design.plant_values(design.target_slope).tolist()

    def reset(self) -> None:
        """Set the integral of the control error to zero."""
        self.integral = 0.0

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
    """Settling, overshoot, tracking error and force of a closed loop; units are for a position and a force.

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
        Force (N, or N.m on an angle) and reference (in ``unit``); each value holds until the next sample.
    freedom : int
        Index of the controlled degree of freedom; by default the last.
    unit : str
        SI unit of the controlled coordinate.
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
    unit: str = "m"
    trajectory: Trajectory | None = None
    status: int = 0
    message: str = ""

    @property
    def position(self) -> FloatArray:
        """Controlled coordinate (in ``unit``) at the sampling times, shape (n,)."""
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

    @in_si(start="s", window="s")
    def metrics(self, *, band: Amount, start: Amount = 0.0, window: Amount = None) -> LoopMetrics:
        """Compute settling time, overshoot, force and tracking error.

        Parameters
        ----------
        band : float
            Half width of the band about the reference in which the coordinate counts as settled (m, or rad for an angle).
        start : float
            Time at which the reference jumps, or control begins (s).
        window : float, optional
            Length of the window at the end (s), such as a period of the motion; by default a tenth of the run.

        Raises
        ------
        InputError
            If band or window is not greater than zero, the start is not within the run, or the run ended early.
        """
        band = si(band, self.unit, "band")
        if not band > 0.0:
            raise InputError(f"band of settling is {band} {self.unit}: it must be greater than zero")
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


def run_loop(
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
        wanted = si(reference(t), unit, "reference") if callable(reference) else reference
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
        unit=unit,
        status=status,
        message=message,
    )


class _DrivenPlant:
    """Base class of the nonlinear plants; inputs other than the controller's force are held between the sampling times."""

    def __init__(self, mechanism: Mechanism, inputs: Inputs, channel: str, times: FloatArray) -> None:
        self.mechanism, self.channel = mechanism, channel
        self._encoded = run.align(run.encode(inputs, mechanism), times)
        self._laws = self._encoded.source.laws.copy()
        self.modes = self._encoded.modes
        self.rows: list[Sequence[float]] = []

    def inputs(self, time: float, ahead: float, measured: Sequence[float]) -> dict[str, float]:
        """Return all inputs for the step from ``time`` to ``ahead`` by FMI name, with 0 for the controller's force."""
        x = np.array([*measured, 0.0, 0.0])
        values = run.sample(self._encoded, time, x, self._laws, ahead=ahead)
        return dict(zip(self.mechanism.input_names, values.tolist()))


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


def find_channel(mechanism: Mechanism, name: str) -> Channel:
    """Return the channel with an FMI name; raise InputError if the channel is not a force on a degree of freedom."""
    for channel in mechanism.channels:
        if channel.name == name and channel.kind == "force" and channel.freedom >= 0:
            return channel
    raise InputError(f"the controller acts by {name!r}, which is not a force on a freedom of the {mechanism.name}")


@takes_published(inputs=run.complete_inputs, initial=run.complete_initial_state)
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
    inputs, initial = run.check_run(mechanism, inputs, initial)
    channel = find_channel(mechanism, controller.channel)
    if channel.argument in inputs:
        raise InputError(f"{channel.argument} is among the inputs, but the controller sets it")
    # an argument that is given, even as 0, chooses the mode in which it acts
    inputs = inputs.replace(**{channel.argument: 0.0})
    times = run.sample_times(stop_time, controller.period)
    if fmu is None:
        inner = _InProcess(mechanism, inputs, controller.channel, times)
        first = inner.inputs(float(times[0]), float(times[1]), mechanism.state(initial)[:-2])
        modes = {name.replace(".", "_"): value for name, value in inner.modes.items()}
        inner.plant = Plant(mechanism, parameters, initial, tolerance=tolerance, inputs=first, **modes)
        result = run_loop(inner, controller, reference, times, channel.freedom)
        rows, source = np.array(inner.rows), "plant in process"
    else:
        outer = _Fmu(mechanism, inputs, controller.channel, times)
        first = outer.inputs(float(times[0]), float(times[1]), mechanism.state(initial)[:-2])
        with FmuRun(
            fmu, parameters, initial, modes=outer.modes, inputs=first, start_time=0.0, tolerance=tolerance
        ) as outer.run:
            result = run_loop(outer, controller, reference, times, channel.freedom)
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


def largest_difference(first: LoopResult, second: LoopResult) -> float:
    """Return the largest difference (m, or rad for an angle) between the controlled coordinates of two runs of one length."""
    if first.time.shape != second.time.shape:
        raise InputError(f"runs of {len(first.time)} and {len(second.time)} samples: both must have the same number")
    return float(np.abs(first.position - second.position).max())
