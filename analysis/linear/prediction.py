"""Predict a closed loop: the sampled controller of `loop` with a linear model of the plant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import InputError

from ..run import float_array, sample_times
from ..units import Amount
from .loop import Controller, LoopResult, Reference, find_channel, run_loop
from .model import FloatArray, LinearModel
from .periodic import PeriodicModel

#: Largest product of a step of the linear model's Runge-Kutta method with its fastest rate.
FINE_STEP = 0.03
#: Greatest rate and acceleration, relative to the mechanism's scales and stiffness, at which a model's state counts as at rest.
AT_REST = 1e-6


class _Linear:
    """Linear model as the plant of a loop: simulates deviations from the model's equilibrium or periodic motion."""

    def __init__(self, model: LinearModel | PeriodicModel, channel: str, averaged: bool, deviation: FloatArray) -> None:
        one = model if isinstance(model, LinearModel) else model.mean()
        self.mechanism, self.places = one.mechanism, one.places
        n, forces = 2 * len(self.mechanism.freedoms), list(one.layout.forces)
        self.own = forces.index(self.mechanism.input_names.index(channel))
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
        self.t = self.force = 0.0

    def measure(self) -> Sequence[float]:
        values = self.motion(self.t).copy()
        values[self.places] += self.x
        return [float(value) for value in values]

    def act(self, time: float, ahead: float, measured: Sequence[float], force: float) -> None:
        self.force = force

    def step(self, time: float, step: float) -> tuple[int, str]:
        count = max(1, ceil(step * self.rate / FINE_STEP))
        h = step / count

        def rates(t: float, x: FloatArray) -> FloatArray:
            # all other forces are those of the motion
            return self.a(t) @ x + self.b(t)[:, self.own] * (self.force - self.acting(t)[self.own])

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
    stop_time: Amount,
    deviation: ArrayLike | None = None,
    averaged: bool = False,
) -> LoopResult:
    """Run a closed loop of a controller and the linear model, to predict the result of `control_loop`.

    Parameters
    ----------
    model : LinearModel or PeriodicModel
        Model about an equilibrium or about a periodic motion. The deviations are added to this equilibrium or motion; the run
        starts at the first sample of the motion. Inputs other than the controller's force are those of the operating point.
    controller, reference, stop_time
        As for `control_loop`.
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
    channel = find_channel(model.mechanism, controller.channel)
    if controller.channel not in model.input_names:
        raise InputError(f"the controller acts by {controller.channel}, which is not an input of the model")
    if isinstance(model, LinearModel):
        _check_rest(model)
    times = sample_times(stop_time, controller.period)
    plant = _Linear(model, controller.channel, averaged, start)
    return run_loop(plant, controller, reference, times, channel.freedom)


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
