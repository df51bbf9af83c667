"""Loops of a controller around the nonlinear plant, or around its linear model.

`control_loop` runs a law sampled and held over the steps of the plant or of its FMU, as a controller beside it does;
`predict_loop` runs the same controller on the linear model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf, isfinite
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import AssemblyError, InputError, IntegrationError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.variables import OUTPUT_NAMES
from linkwork.plant import Plant

from ..mechanisms import FIVE_BAR
from ..run import FmuRun, Trajectory, sample_times
from .design import MEASURED, SliderDesign, check_period, on_plant
from .model import FloatArray, LinearModel
from .periodic import PeriodicModel

#: A value, or a function of time (s) that is sampled with the controller.
Reference = float | Callable[[float], float]
Load = tuple[float, float] | Callable[[float], tuple[float, float]]
_COLUMNS = [OUTPUT_NAMES.index(name) for name in MEASURED]
#: Largest product of a step of the linear model's Runge-Kutta method with its fastest rate.
FINE_STEP = 0.03


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
        self._gains = on_plant(design.model, design.gains)
        self._target = on_plant(design.model, design.target)
        self._slope = on_plant(design.model, design.target_slope)

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
    mode = int(crank_speed is not None)
    inputs = {
        "drive.torque": crank_torque,
        "drive.speed": crank_speed or 0.0,
        "drive.acceleration": 0.0,
        "slider.force": 0.0,
        "load.fx": 0.0,
        "load.fy": 0.0,
    }
    if fmu is None:
        inner = _InProcess(Plant(FIVE_BAR, parameters, initial, drive_mode=mode, tolerance=tolerance, inputs=inputs))
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
        names=FIVE_BAR.output_names,
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
