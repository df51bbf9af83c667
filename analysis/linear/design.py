"""Control of the slider by its force, designed on a linear model.

Every design is one law of the deviations x from an operating point x0 with the force F0, at a reference r of the slider's
position whose own operating point is x0 + x_s (r - u0), F0 + F_s (r - u0) on the linear model:

    F2 = F0 + F_s (r - u0) - k (x - x0 - x_s (r - u0)) - k_i * integral of (u - r)

LQR chooses k and k_i by weights, PID by poles, PI (no gain on the velocity) by crossover and phase margin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, pi

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError, UnknownNameError

from ..run import Function
from .model import COORDINATES, RATES, FloatArray, LinearModel, by_magnitude, signal_name

MEASURED = (*COORDINATES, *RATES)


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
        return by_magnitude(np.linalg.eigvals(kept))

    def continuous(self, reference: float) -> Function:
        """The law without sampling, as the ``force`` of `analysis.run.inputs.Inputs`.

        Raises
        ------
        DesignError
            If the law has integral action: its integral is no function of the plant's state.
        """
        if self.integral_gain:
            raise DesignError("a law with integral action is no function of the state: run it with control_loop")
        k_th2, k_u, k_w2, k_v = on_plant(self.model, self.gains)
        step = reference - float(self.target[len(self.target) // 2 - 1])
        th2_0, u_0, w2_0, v_0 = on_plant(self.model, self.target + step * self.target_slope)
        bias = self.force + step * self.force_slope

        def force(t: float, th2: float, u: float, w2: float, v: float) -> float:
            return bias - k_th2 * (th2 - th2_0) - k_u * (u - u_0) - k_w2 * (w2 - w2_0) - k_v * (v - v_0)

        return Function(force)


def on_plant(model: LinearModel, values: FloatArray) -> tuple[float, float, float, float]:
    """Values by the model's state as values by (th2, u, th2', u'), zero where the model has no such state."""
    named = dict(zip(model.state_names, values.tolist()))
    th2, u, w2, v = (named.get(name, 0.0) for name in MEASURED)
    return th2, u, w2, v


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
    poles = by_magnitude(np.linalg.eigvals(loop.A - loop.B @ loop.C))
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
        If a weight is for a state that the model does not have.
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
