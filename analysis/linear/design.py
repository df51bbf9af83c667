"""Design controllers of one coordinate with a linear model; they act by the force (or torque) on the coordinate.

The operating point is the state x0 with the force F0. At a reference r of the coordinate u, the equilibrium of the linear model
is the state x0 + x_s (r - u0) with the force F0 + F_s (r - u0). Every design is a control law for the deviation of the state x
from this equilibrium:

    F = F0 + F_s (r - u0) - k (x - x0 - x_s (r - u0)) - k_i * integral of (u - r)

LQR determines k and k_i from weights; PID determines them from poles; PI, without gain on the velocity, determines them from
the crossover frequency and the phase margin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, pi
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError

from ..files import unknown_name
from ..libraries import lazy
from ..run import float_array, require_kind
from ..units import Amount, in_si
from .model import FloatArray, LinearModel, LinearModelError, as_names, signal_name, sort_by_magnitude

if TYPE_CHECKING:
    import control
else:
    control = lazy("control")


#: Model that a design needs, in messages.
_MODEL = "a LinearModel, such as linearise('table-3.1', rest.state, rest.inputs), rest = find_equilibrium('table-3.1')"


class DesignError(LinkworkError):
    """No controller can be designed for these requirements."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """A control law for a force, with poles and margins on the linear model; units are for a force and a position.

    Attributes
    ----------
    method : str
        LQR, PID or PI.
    model : LinearModel
        The linear model with which the controller was designed.
    channel : str
        FMI name of the force.
    freedom : int
        Index of the controlled degree of freedom, on which the force acts.
    gains : ndarray, shape (2 n,)
        Gains k of the model's state (q, q'), in N per unit of each component.
    integral_gain : float
        k_i (N/(m.s)); zero if there is no integral action.
    target, target_slope : ndarray, shape (2 n,)
        The state x0 of the operating point, and the change x_s of the equilibrium state per m of the reference.
    force, force_slope : float
        The force F0 of the operating point (N), and the change F_s of the equilibrium force per m of the reference (N/m).
    poles : ndarray
        Poles of the closed loop (1/s), by magnitude.
    gain_margin : float
        Factor by which the loop's gain can grow until the closed loop becomes unstable; infinite if the loop never does.
    phase_margin : float
        Phase margin (rad); infinite if the loop's gain is 1 at no frequency.
    crossover : float
        Highest frequency at which the loop's gain is 1 (rad/s); zero if there is none.
    delay_margin : float
        Dead time that makes the loop unstable (s). Sampling with a period h adds about h/2.
    """

    method: str
    model: LinearModel
    channel: str
    freedom: int
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

    def __repr__(self) -> str:
        integral = f", integral {self.integral_gain:.6g}" if self.integral_gain else ""
        margins = f"gain margin {self.gain_margin:.4g}, phase margin {np.degrees(self.phase_margin):.4g} deg"
        law = f"{self.method} from {self.channel} to {self.coordinate}"
        gains = f"gains {', '.join(f'{gain:.6g}' for gain in self.gains)}{integral}"
        return f"<{law}: {gains}; poles {self.poles.round(4).tolist()}; {margins}>"

    @property
    def coordinate(self) -> str:
        """FMI name of the controlled coordinate."""
        return self.model.mechanism.freedoms[self.freedom].coordinate

    @property
    def plant(self) -> _Plant:
        """Linear model with the force as the only input."""
        return _Plant(self.model, self.channel)

    @property
    def loop(self) -> control.StateSpace:
        """Return the open loop, from the force to the feedback signal."""
        return self.plant.loop(self.gains, self.integral_gain)

    def closed_loop(self, outputs: str | Sequence[str] | None = None) -> control.StateSpace:
        """Return the closed loop from a disturbing force to the outputs with the given FMI names.

        The default output is the controlled coordinate.
        """
        chosen = (self.coordinate,) if outputs is None else as_names(outputs)
        a, b, row = self.plant.feedback_matrices(self.gains, self.integral_gain)
        whole = self.model.to_state_space(chosen, (self.channel,))
        c = np.hstack([whole.C, np.zeros((len(chosen), a.shape[0] - whole.nstates))]) - whole.D @ row
        names = {"inputs": [signal_name(self.channel)], "outputs": [signal_name(name) for name in chosen]}
        return control.ss(a - b @ row, b, c, whole.D, **names)

    @in_si(period="s")
    def sampled_poles(self, period: Amount) -> NDArray[np.complex128]:
        """Compute the poles in z of the closed loop if the law is sampled every ``period`` seconds and the force is held."""
        check_period(period)
        a, b = self.plant.a, self.plant.b
        held = control.sample_system(control.ss(a, b, np.eye(len(a)), np.zeros((len(a), 1))), period, method="zoh")
        n = len(a)
        closed = np.zeros((n + 1, n + 1))
        closed[:n, :n] = held.A - held.B @ self.gains[None, :]
        closed[:n, n:] = -held.B * self.integral_gain
        closed[n, self.plant.place] = period
        closed[n, n] = 1.0
        # without integral action nothing depends on the integral
        kept = closed if self.integral_gain else closed[:n, :n]
        return sort_by_magnitude(np.linalg.eigvals(kept))

    def plant_values(self, values: FloatArray) -> FloatArray:
        """Extend an array over the model's state to all coordinates and rates of the plant; the other entries are zero."""
        whole = np.zeros(2 * len(self.model.mechanism.freedoms))
        whole[self.model.places] = values
        return whole


class _Plant:
    """A linear model with one force as its input: A, the force's column of B, and the index of the driven coordinate."""

    def __init__(self, model: LinearModel, channel: str | None) -> None:
        try:
            self.channel, self.freedom = model.force_channel(channel)
        except LinearModelError as error:
            raise DesignError(str(error)) from None
        self.a: FloatArray = model.A
        self.b: FloatArray = model.B[:, [model.input_names.index(self.channel)]]
        self.place = model.layout.free.index(self.freedom)

    def feedback_matrices(self, gains: FloatArray, integral_gain: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A, B and the gains as a row, shape (1, states); the last state is the integral if its gain is not zero."""
        if not integral_gain:
            return self.a, self.b, gains[None, :]
        n = len(self.a)
        whole = np.zeros((n + 1, n + 1))
        whole[:n, :n] = self.a
        whole[n, self.place] = 1.0
        return whole, np.vstack([self.b, [[0.0]]]), np.append(gains, integral_gain)[None, :]

    def loop(self, gains: FloatArray, integral_gain: float) -> control.StateSpace:
        a, b, row = self.feedback_matrices(gains, integral_gain)
        return control.ss(a, b, row, 0.0, inputs=[signal_name(self.channel)], outputs=["feedback"])


def _design(method: str, model: LinearModel, channel: str | None, gains: FloatArray, integral_gain: float) -> Design:
    """Check that the closed loop with these gains is stable, and return the design; raise DesignError if it is unstable."""
    plant, freedoms = _Plant(model, channel), model.mechanism.freedoms
    for n in model.layout.free:
        if freedoms[n].period and model.state[len(freedoms) + n] != 0.0:
            raise DesignError(
                f"{method}: {freedoms[n].coordinate} is free and turns at {model.state[len(freedoms) + n]:.4g} rad/s: "
                "linearise the mechanism about an equilibrium instead"
            )
    if not (np.all(np.isfinite(gains)) and isfinite(integral_gain)):
        raise DesignError(f"{method}: the gains {gains} and {integral_gain} are not finite")
    loop = plant.loop(gains, integral_gain)
    poles = sort_by_magnitude(np.linalg.eigvals(loop.A - loop.B @ loop.C))
    if poles.real.max() >= -1e-9 * np.abs(poles).max():
        raise DesignError(
            f"{method}: the closed loop is not stable, its poles are {np.array2string(poles, precision=4)} 1/s"
        )
    # equilibrium of the linear model with the coordinate at 1
    n = len(plant.a)
    border = np.zeros((n + 1, n + 1))
    border[:n, :n], border[:n, n:], border[n, plant.place] = plant.a, plant.b, 1.0
    try:
        still = np.linalg.solve(border, np.append(np.zeros(n), 1.0))
    except np.linalg.LinAlgError:
        raise DesignError(
            f"{method}: no constant {plant.channel} holds {freedoms[plant.freedom].coordinate} at another position"
        ) from None
    gain, phase, _, _, crossings, _ = control.stability_margins(loop, returnall=True)
    phase, crossings = np.atleast_1d(np.radians(phase)), np.atleast_1d(crossings)
    # a delay can only lower the phase: 2 pi is added to a negative margin
    delays = np.where(phase > 0.0, phase, phase + 2.0 * pi) / crossings
    # where the loop gain is a billionth of its largest, it and its sign are rounding errors, as of a gain that should be zero
    least = 1e-9 * np.abs(loop(1j * np.abs(poles))).max()
    gains_up = [float(value) for value in np.atleast_1d(gain) if value > 1.0 and least * value < 1.0]
    return Design(
        method=method,
        model=model,
        channel=plant.channel,
        freedom=plant.freedom,
        gains=gains,
        integral_gain=integral_gain,
        target=model.state[model.places],
        target_slope=still[:n],
        force=float(model.channels[model.mechanism.input_names.index(plant.channel)]),
        force_slope=float(still[n]),
        poles=poles,
        gain_margin=min(gains_up, default=inf),
        phase_margin=float(np.abs(phase).min(initial=inf)),
        crossover=float(crossings.max(initial=0.0)),
        delay_margin=float(delays.min(initial=inf)),
    )


def design_lqr(
    model: LinearModel,
    q: Mapping[str, float] | ArrayLike,
    r: float = 1.0,
    *,
    integral: float = 0.0,
    channel: str | None = None,
) -> Design:
    """Design a state feedback that minimises the time integral of x' Q x + r F^2 (+ integral * (integral of u)^2).

    Parameters
    ----------
    model : LinearModel
        Model of an equilibrium, or mean model of a periodic motion.
    q : mapping or array_like
        Weights of the states by name, zero for states left out; or the diagonal of Q; or Q. With the weight 1e6 r for a
        position, a deviation of 1 mm costs as much as a force of 1 N.
    r : float
        Weight of the force.
    integral : float
        Weight of the integral of the coordinate, in the unit of the coordinate's weight over s2; if it is above zero, the law
        has integral action.
    channel : str, optional
        FMI name of the force; by default the force on the last degree of freedom that is not commanded:
        see `LinearModel.force_channel`.

    Raises
    ------
    UnknownNameError
        If a weight is for a state that the model does not have.
    DesignError
        If a weight is not usable, or the force cannot stabilise the model.

    Examples
    --------
    >>> from analysis import design_lqr, find_equilibrium, linearise
    >>> rest = find_equilibrium("table-3.1", held={"crank.angle": "90 deg"})
    >>> law = design_lqr(linearise("table-3.1", rest.state, rest.inputs), {"slider.position": 1e6})
    >>> bool((law.poles.real < 0.0).all())
    True
    """
    require_kind(model, LinearModel, "model", _MODEL)
    names = model.state_names
    if isinstance(q, Mapping):
        for name in q:
            if name not in names:
                raise unknown_name(name, names)
        q = [q.get(name, 0.0) for name in names]
    weights = float_array(q, f"weights {q!r}: they must be numbers")
    if weights.ndim == 1:
        weights = np.diag(weights)
    n = len(names)
    if weights.shape != (n, n):
        raise DesignError(
            f"weights of shape {weights.shape}: they must be {n} numbers, for {', '.join(names)}, or an {n} by {n} matrix"
        )
    # only the symmetric part of Q affects x' Q x; zeros of a product H' H, such as a weight of outputs, are rounded
    weights = 0.5 * (weights + weights.T)
    if not np.all(np.isfinite(weights)) or np.linalg.eigvalsh(weights)[0] < -1e-12 * np.abs(weights).max():
        raise DesignError(f"weights {weights.tolist()}: they must be finite and none below zero")
    if not (isfinite(r) and r > 0.0):
        raise DesignError(f"weight of the force is {r}: it must be finite and greater than zero")
    if not (isfinite(integral) and integral >= 0.0):
        raise DesignError(f"weight of the integral is {integral}: it must be finite and not below zero")
    plant = _Plant(model, channel)
    if integral:
        weights = np.block([[weights, np.zeros((n, 1))], [np.zeros((1, n)), np.array([[integral]])]])
    a, b, _ = plant.feedback_matrices(np.zeros(n), integral)
    try:
        gains = np.asarray(control.lqr(a, b, weights, [[r]])[0])[0]
    except (np.linalg.LinAlgError, ValueError, control.ControlArgument) as error:
        raise DesignError(f"LQR: {plant.channel} cannot stabilise this model under these weights ({error})") from error
    return _design("LQR", model, plant.channel, gains[:n], float(gains[n]) if integral else 0.0)


@in_si(bandwidth="rad/s", damping="1")
def design_pid(
    model: LinearModel,
    *,
    poles: Sequence[complex] | None = None,
    bandwidth: Amount = None,
    damping: Amount = 0.7,
    channel: str | None = None,
) -> Design:
    """Design a PID controller from the three poles of the closed loop; the derivative part acts on the measured velocity.

    Parameters
    ----------
    model : LinearModel
        A model with one degree of freedom that is not commanded, such as a five-bar with commanded crank speed.
    poles : sequence of 3 complex, optional
        Poles (1/s), real or in conjugate pairs, with negative real parts.
    bandwidth, damping : float
        Instead of poles: bandwidth in rad/s and damping ratio. The poles are -bandwidth and
        -bandwidth (damping +- i sqrt(1 - damping^2)).
    channel : str, optional
        As for `design_lqr`.

    Raises
    ------
    DesignError
        If the model has more than one degree of freedom that is not commanded, or the poles are not usable.

    Examples
    --------
    >>> from analysis import design_pid, find_equilibrium, linearise
    >>> rest = find_equilibrium("table-3.1", held={"crank.angle": "90 deg"})
    >>> law = design_pid(linearise("table-3.1", rest.state, rest.inputs), bandwidth="60 rad/s")
    >>> law.poles.round(2).tolist()
    [(-42-42.85j), (-42+42.85j), (-60+0j)]
    """
    require_kind(model, LinearModel, "model", _MODEL)
    if len(model.layout.free) != 1:
        raise DesignError(
            f"a PID places the three poles of one freedom, but {len(model.layout.free)} freedoms are free here: use design_lqr"
        )
    if (poles is None) == (bandwidth is None):
        raise DesignError("a PID needs either its poles or its bandwidth")
    if bandwidth is not None:
        _check_positive("bandwidth", bandwidth, "rad/s")
        if not 0.0 < damping <= 1.0:
            raise DesignError(f"damping is {damping}: it must be above 0 and at most 1")
        pair = bandwidth * complex(-damping, (1.0 - damping**2) ** 0.5)
        poles = [-bandwidth, pair, pair.conjugate()]
    try:
        wanted = np.array(poles, dtype=complex)
    except (TypeError, ValueError):
        raise DesignError(f"poles {poles!r}: they must be three complex numbers (1/s)") from None
    polynomial = np.poly(wanted) if wanted.shape == (3,) else np.array([1j])
    if not np.all(np.isreal(polynomial)) or wanted.real.max() >= 0.0:
        raise DesignError(
            f"poles {wanted.tolist()}: there must be three, real or conjugate, left of the imaginary axis"
        )
    _, a2, a1, a0 = polynomial.real.tolist()
    # m s^3 + (c + f k_d) s^2 + (k + f k_p) s + f k_i = m (s^3 + a2 s^2 + a1 s + a0), with f the force per unit of the channel
    plant = _Plant(model, channel)
    m, c, k = (float(matrix[0, 0]) for matrix in (model.M, model.C, model.K))
    f = float(model.F[0, model.input_names.index(plant.channel)])
    return _design("PID", model, plant.channel, np.array([m * a1 - k, m * a2 - c]) / f, m * a0 / f)


@in_si(bandwidth="rad/s", phase_margin="rad")
def design_pi(
    model: LinearModel, *, bandwidth: Amount, phase_margin: Amount = pi / 3.0, channel: str | None = None
) -> Design:
    """Design a PI controller with the crossover frequency ``bandwidth`` and at least a given phase margin.

    If integral action alone gives more than this phase margin, there is no proportional part.

    Parameters
    ----------
    model : LinearModel
    bandwidth : float
        Crossover frequency (rad/s).
    phase_margin : float
        Least phase margin (rad).
    channel : str, optional
        As for `design_lqr`.

    Raises
    ------
    DesignError
        If no PI controller meets the requirements: a PI controller gives no phase lead, which a sprung mass needs near its
        resonance and above.

    Examples
    --------
    >>> from analysis import design_pi, find_equilibrium, linearise
    >>> rest = find_equilibrium("table-3.1", held={"crank.angle": "90 deg"})
    >>> law = design_pi(linearise("table-3.1", rest.state, rest.inputs), bandwidth="5 rad/s", phase_margin="60 deg")
    >>> law.phase_margin > 1.04
    True
    """
    require_kind(model, LinearModel, "model", _MODEL)
    _check_positive("bandwidth", bandwidth, "rad/s")
    if not 0.0 < phase_margin < pi:
        raise DesignError(f"phase margin is {phase_margin} rad: it must be between 0 and pi")
    plant = _Plant(model, channel)
    coordinate = model.state_names[plant.place]
    system = model.to_state_space((coordinate,), (plant.channel,))
    response = complex(system(1j * bandwidth))
    needed = np.exp(1j * (phase_margin - pi)) / response
    if needed.imag >= 0.0:
        raise DesignError(
            f"PI: at {bandwidth:g} rad/s {coordinate} lags by {np.degrees(-np.angle(response)) % 360.0:.1f} deg, which leaves "
            f"no phase margin of {np.degrees(phase_margin):.1f} deg without phase lead: use design_pid, or a bandwidth "
            "further below the resonance"
        )
    proportional, integral = float(needed.real), float(-bandwidth * needed.imag)
    if proportional < 0.0:
        proportional, integral = 0.0, bandwidth / abs(response)
    gains = np.array([proportional if name == coordinate else 0.0 for name in model.state_names])
    design = _design("PI", model, plant.channel, gains, integral)
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
    """Check that a sampling period (s) is finite and above zero.

    Raises
    ------
    InputError
        If the period is not a finite number greater than zero.
    """
    if not (isfinite(period) and period > 0.0):
        raise InputError(f"sampling period is {period} s: it must be a finite number greater than zero")
