"""Track a slider motion u(th2) with the full plant by feed-forward and feedback.

The force over a sampling period h is

    F2 = F_ff + feedback on (u - u_ref, u' - u_ref')

F_ff is computed by inverse dynamics of the model for half a period ahead, at th2 + w2 h/2. This force is held over the period.
It is exact in the middle of the period, so that the error is of order h^2; the force at the sample would give an error of
order h.
F_ff and u_ref' are computed at the measured crank angle. `analysis.linear` defines gains, integral and limit of the feedback.

The plant (the simulated five-bar slider) may differ from the model in friction, masses, and the load at P.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, pi
from pathlib import Path

import numpy as np

from linkwork.errors import InputError
from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import FiveBarParameters, InitialState

from ..linear import Design, LoopResult, SampledController, check_limit, check_period, control_loop, peak, rms, saturate
from ..numerics.fourier import FourierSeries
from ..run import Function, Inputs
from ..units import Amount, in_si
from .inverse import FloatArray, Load, check_speed, inverse_dynamics, load_at_angle, slider_force


class TrackingController:
    """Controller with feed-forward by inverse dynamics on a model, feedback by a design, or both.

    Parameters
    ----------
    parameters : FiveBarParameters
        Parameters of the model.
    slider : FourierSeries
        Reference u(th2) (m).
    period : float
        Sampling period (s).
    design : Design, optional
        Design of the feedback, on a model with prescribed crank speed; no feedback by default.
    feedforward : bool
        Whether there is a feed-forward; otherwise the holding force of the design's linear model takes its place.
    load : (float, float) or function of the crank angle
        Load at P (N) that the feed-forward takes into account.
    limit : float
        Largest magnitude of the force (N).

    Raises
    ------
    InputError
        If there is neither feed-forward nor feedback, or an argument is invalid.
    """

    channel = "slider.force"

    @in_si(period="s", limit="N")
    def __init__(
        self,
        parameters: FiveBarParameters,
        slider: FourierSeries,
        period: Amount,
        *,
        design: Design | None = None,
        feedforward: bool = True,
        load: Load = (0.0, 0.0),
        limit: Amount = inf,
    ) -> None:
        check_period(period)
        if design is None and not feedforward:
            raise InputError("there is neither feed-forward nor feedback: at least one of them is needed")
        if design is not None and "crank.angle" in design.model.state_names:
            raise InputError("the feedback was designed for a free crank: tracking needs a model in speed drive")
        check_limit(limit)
        self.parameters, self.slider, self.period, self.limit = parameters, slider, period, limit
        self.feedback = None if design is None else SampledController(design, period, limit=limit)
        self.feedforward = feedforward
        self.load = load
        self._p = parameters.constants()
        self._slope = slider.derivative()
        self._curvature = self._slope.derivative()

    @property
    def method(self) -> str:
        """Return the name of the control method: feed-forward, the method of the feedback, or both."""
        parts = ["feed-forward"] if self.feedforward else []
        return " + ".join(parts + ([self.feedback.method] if self.feedback else []))

    def reset(self) -> None:
        """Set the integral of the feedback to zero."""
        if self.feedback:
            self.feedback.reset()

    def force(self, measured: Sequence[float], reference: float) -> float:
        """Return the force (N) for the next period from the measured (th2, u, th2', u') in SI and the reference u_ref (m)."""
        th2, u, w2, v = measured
        if self.feedforward:
            forward = self._forward(th2 + 0.5 * w2 * self.period, w2)
        else:
            assert self.feedback is not None
            forward = self.feedback.holding_force(reference)
        if self.feedback is None:
            return saturate(forward, self.limit)
        return self.feedback.follow(forward, u - reference, v - w2 * float(self._slope(th2)))

    def _forward(self, th2: float, w2: float) -> float:
        u, v, a = float(self.slider(th2)), w2 * float(self._slope(th2)), w2 * w2 * float(self._curvature(th2))
        return slider_force(th2, u, w2, v, a, load_at_angle(self.load, th2), self._p)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingMetrics:
    """Tracking errors, force and power over the last crank turn of a run.

    Attributes
    ----------
    rms_error, peak_error : float
        Deviation of the slider from its reference (m).
    rms_point_error, peak_point_error : float
        Distance of the coupler point P from the model's P on the reference (m).
    rms_force, peak_force : float
        Slider force (N).
    mean_power, peak_power : float
        Power of the slider force (W); the peak is its greatest magnitude.
    """

    rms_error: float
    peak_error: float
    rms_point_error: float
    peak_point_error: float
    rms_force: float
    peak_force: float
    mean_power: float
    peak_power: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackingResult:
    """A run of the slider along its reference, at the controller's sampling times.

    Attributes
    ----------
    method : str
        Name of the control method.
    crank_speed : float
        Crank speed (rad/s).
    loop : LoopResult
        The run, with the plant's outputs in ``loop.trajectory``.
    error : ndarray, shape (n,)
        u - u_ref (m).
    point_error : ndarray, shape (n,)
        Distance of P from the model's P on the reference (m).
    power : ndarray, shape (n,)
        Mean power of the slider force over the period before each sample (W); zero at the first sample.
    """

    method: str
    crank_speed: float
    loop: LoopResult
    error: FloatArray
    point_error: FloatArray
    power: FloatArray

    def metrics(self) -> TrackingMetrics:
        """Compute tracking errors, force and power over the last turn.

        Raises
        ------
        InputError
            If the run ended early, or is shorter than a turn.
        """
        turn, length = 2.0 * pi / abs(self.crank_speed), float(self.loop.time[-1])
        last = self.loop.end(turn)
        if length < turn * (1.0 - 1e-9):
            raise InputError(f"the run of {length:.4g} s is shorter than a turn, {turn:.4g} s: it has no last turn")
        error, point_error, force, power = (
            values[last] for values in (self.error, self.point_error, self.loop.force, self.power)
        )
        return TrackingMetrics(
            rms_error=rms(error),
            peak_error=peak(error),
            rms_point_error=rms(point_error),
            peak_point_error=peak(point_error),
            rms_force=rms(force),
            peak_force=peak(force),
            mean_power=float(power.mean()),
            peak_power=peak(power),
        )


@in_si(crank_speed="rad/s")
def track(
    controller: TrackingController,
    *,
    crank_speed: Amount,
    revolutions: float = 10.0,
    plant: FiveBarParameters | None = None,
    load: Load = (0.0, 0.0),
    initial: InitialState | None = None,
    fmu: str | Path | None = None,
    tolerance: float = 1e-9,
) -> TrackingResult:
    """Run the full nonlinear plant under a tracking controller, in process or as its FMU.

    Parameters
    ----------
    controller : TrackingController
        Controller with the reference. Its feedback is designed by `analysis.linear` on a model with prescribed crank speed, for
        example the mean model along the reference: ``linearise_orbit(parameters, inverse_dynamics(...)).mean()``.
    crank_speed : float
        Constant prescribed speed (rad/s).
    revolutions : float
        Turns of the crank.
    plant : FiveBarParameters, optional
        Parameters of the plant; by default those of the controller's model.
    load : (float, float) or function of the crank angle
        Load on the plant at P (N), constant over each sampling period, with its value at the middle of the period; the
        feed-forward uses `controller.load`.
    initial : InitialState, optional
        Initial state; by default the slider is on the reference at crank angle 0.
    fmu : path, optional
        FiveBarSlider.fmu to be run instead of the plant in process.
    tolerance : float
        Tolerance of the plant's integrator.

    Returns
    -------
    TrackingResult
        If the plant reaches the limit of assembly, the run ends there, with a status, a message and all data up to that time.

    Raises
    ------
    InputError
        If an argument is invalid.
    AssemblyError
        If the links of the model cannot be joined somewhere on the reference, or those of the plant at the start.
    """
    check_speed(crank_speed)
    if not 0.0 < revolutions < inf:
        raise InputError(f"{revolutions} revolutions: they must be a finite number greater than zero")
    parameters, slider = controller.parameters, controller.slider
    inverse_dynamics(parameters, slider, crank_speed, load=controller.load)
    start = initial or InitialState(
        crank_speed=crank_speed,
        slider_position=float(slider(0.0)),
        slider_velocity=crank_speed * float(slider.derivative()(0.0)),
    )

    def angle(t: float) -> float:
        return float(start.crank_angle + crank_speed * t)

    def load_part(part: int) -> Function:
        return Function(lambda t, *state: load_at_angle(load, angle(t + 0.5 * controller.period))[part])

    loop = control_loop(
        plant or parameters,
        controller,
        lambda t: float(slider(angle(t))),
        Inputs(speed=crank_speed, load_x=load_part(0), load_y=load_part(1)),
        initial=start,
        stop_time=2.0 * pi * revolutions / abs(crank_speed),
        fmu=fmu,
        tolerance=tolerance,
    )
    return TrackingResult(
        method=controller.method,
        crank_speed=float(crank_speed),
        loop=loop,
        error=loop.position - loop.reference,
        point_error=_point_error(parameters, loop),
        power=np.append(0.0, loop.force[:-1] * np.diff(loop.position) / np.diff(loop.time)),
    )


def _point_error(parameters: FiveBarParameters, loop: LoopResult) -> FloatArray:
    """Return the distance of the plant's P from the P of the model on the reference (m), shape (n,)."""
    assert loop.trajectory is not None
    p = parameters.constants()
    wanted = [
        kinematics.coupler_point(kinematics.position(th2, u, p), p)
        for th2, u in zip(loop.states[:, 0].tolist(), loop.reference.tolist())
    ]
    there = np.column_stack([loop.trajectory["coupler.point.x"], loop.trajectory["coupler.point.y"]])
    return np.asarray(np.linalg.norm(there - np.array(wanted), axis=1))
