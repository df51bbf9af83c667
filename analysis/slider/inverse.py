"""Inverse dynamics: compute control force, crank torque and pin forces for a prescribed motion of the slider.

The slider follows u(th2) while the crank turns at a constant speed w2, so that u' = w2 du/dth2 and u'' = w2^2 d2u/dth2^2.
The second equation of motion then gives the force,

    F2 = m22 u'' + b2 - Q2

With F2 known, the plant's output equations give the torque on the crank (the first equation of motion) and the forces in the
pins and the guide. Spring, damper, guide friction, gravity and the load at P are all in Q2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import degrees, inf, isfinite, pi

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError, InputError
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.assembly import check_assembly
from linkwork.five_bar.parameters import Constants, FiveBarParameters

from ..files import unknown_name
from ..mechanisms import FIVE_BAR, output_units
from ..numerics.fourier import FourierSeries
from ..run import Inputs, complete_speed, compute_outputs, takes_published
from ..units import Amount, in_si
from ..youssef import require_no_contact_friction

FloatArray = NDArray[np.float64]
#: The two components of the force at P (N): constant, or a function of the crank angle (rad).
Load = tuple[float, float] | Callable[[float], tuple[float, float]]

#: Energies that are counted from the start of a run, so that a prescribed motion does not have them; and the other outputs.
_LEFT_OUT = ("energy.dissipated", "energy.supplied", "energy.residual")
NAMES = tuple(name for name in FIVE_BAR.output_names if name not in _LEFT_OUT)
_KEPT = [FIVE_BAR.output_names.index(name) for name in NAMES]
LEAST_SAMPLES = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnBalance:
    """Energy balance over one turn of a periodic motion (J): the work supplied equals the work dissipated.

    Attributes
    ----------
    force, torque, load : float
        Work of the slider force, of the crank torque, of the load at P.
    dissipated : float
        Work dissipated by damper and guide friction.
    """

    force: float
    torque: float
    load: float
    dissipated: float

    @property
    def residual(self) -> float:
        """Return the work supplied minus the work dissipated (J): zero apart from rounding if the samples are close enough."""
        return self.force + self.torque + self.load - self.dissipated


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SliderDrive:
    """One turn of the crank with a prescribed slider motion, sampled at n equally spaced crank angles.

    The end of the turn is not a sample, because the motion repeats there.

    Attributes
    ----------
    parameters : FiveBarParameters
    slider : FourierSeries
        Slider position u(th2) (m).
    crank_speed : float
        Crank speed (rad/s).
    load : (float, float) or function of the crank angle
        Load at the coupler point P (N).
    crank_angle, time : ndarray, shape (n,)
        Crank angle (rad) and time (s), both zero at the start.
    states, inputs : ndarray, shape (n, 6)
        States (th2, u, w2, v, 0, 0) of the plant, and its inputs.
    values : ndarray, shape (n, 24)
        Outputs of the plant, in the order of `NAMES`.

    Notes
    -----
    ``drive["pin.C.fx"]`` is an output over the turn, shape (n,). Peak values are the greatest among the samples.
    `linear.linearise_orbit` accepts a `SliderDrive` as the motion to linearise about.
    """

    parameters: FiveBarParameters
    slider: FourierSeries
    crank_speed: float
    load: Load
    crank_angle: FloatArray
    time: FloatArray
    states: FloatArray
    inputs: FloatArray
    values: FloatArray

    def __getitem__(self, name: str) -> FloatArray:
        if name not in NAMES:
            raise unknown_name(name, NAMES, f"output {name!r} of a prescribed motion")
        return self.values[:, NAMES.index(name)]

    def pin_force(self, pin: str) -> FloatArray:
        """Return the magnitude of the force in pin A, B, C or D (N), shape (n,)."""
        return np.hypot(self[f"pin.{pin}.fx"], self[f"pin.{pin}.fy"])

    def turn(self, samples: int) -> SliderDrive:
        """Return the drive of the same motion with another number of samples."""
        return inverse_dynamics(self.parameters, self.slider, self.crank_speed, load=self.load, samples=samples)

    @property
    def modes(self) -> tuple[int, ...]:
        """Return the mechanism's mode parameters: a single 1, because the crank speed is prescribed."""
        return (1,)

    @property
    def run_inputs(self) -> Inputs:
        """Return the inputs that drive the crank in a run; the control force is left out."""
        return Inputs(speed=self.crank_speed)

    @property
    def period(self) -> float:
        """Return the duration of one turn (s)."""
        return 2.0 * pi / abs(self.crank_speed)

    @property
    def force(self) -> FloatArray:
        """Return the control force on the slider (N), shape (n,)."""
        return self.inputs[:, 3]

    @property
    def torque(self) -> FloatArray:
        """Return the torque that keeps the crank's speed constant (N.m), shape (n,)."""
        return self["drive.applied_torque"]

    @property
    def power(self) -> FloatArray:
        """Return the power of the control force (W), shape (n,)."""
        return self.force * self.states[:, 3]

    @property
    def mean_power(self) -> float:
        """Return the mean of the power over the turn (W)."""
        return float(self.power.mean())

    @property
    def peak_power(self) -> float:
        """Return the greatest magnitude of the power (W)."""
        return float(np.abs(self.power).max())

    @property
    def positive_work(self) -> float:
        """Return the work of the control force over the parts of the turn with positive power (J)."""
        return float(np.maximum(self.power, 0.0).mean()) * self.period

    @property
    def negative_work(self) -> float:
        """Return the work of the control force over the parts of the turn with negative power (J), at most zero."""
        return float(np.minimum(self.power, 0.0).mean()) * self.period

    @property
    def rms_force(self) -> float:
        """Return the root mean square of the control force over the turn (N)."""
        return float(np.sqrt(np.mean(self.force**2)))

    @property
    def peak_force(self) -> float:
        """Return the greatest magnitude of the control force (N)."""
        return float(np.abs(self.force).max())

    @property
    def peak_torque(self) -> float:
        """Return the greatest magnitude of the crank torque (N.m)."""
        return float(np.abs(self.torque).max())

    @property
    def balance(self) -> TurnBalance:
        """Return the balance of energy over the turn."""
        p = self.parameters.constants()
        dissipated, load = 0.0, 0.0
        for x, i in zip(self.states.tolist(), self.inputs.tolist()):
            g = kinematics.position(x[0], x[1], p)
            k = kinematics.coefficients(g, p)
            px, py = kinematics.coupler_point_velocity(g, x[2], k.k32 * x[2] + k.k3u * x[3], p)
            dissipated += dynamics.friction(x[3], p) * x[3]
            load += i[4] * px + i[5] * py
        step = self.period / len(self.time)
        return TurnBalance(
            force=self.mean_power * self.period,
            torque=float(self.torque.mean()) * self.crank_speed * self.period,
            load=load * step,
            dissipated=dissipated * step,
        )

    def columns(self) -> Mapping[str, FloatArray]:
        """Return time, force, power and outputs by name with unit, as `analysis.files.write_csv` takes them."""
        own = {"time [s]": self.time, "slider.force [N]": self.force, "slider.power [W]": self.power}
        units = output_units()
        return own | {f"{name} [{units[name]}]": self[name] for name in NAMES}


def slider_force(
    th2: float, u: float, w2: float, v: float, acceleration: float, load: tuple[float, float], p: Constants
) -> float:
    """Return the slider force F2 (N) for a slider acceleration u'' (m/s2) at constant crank speed.

    ``th2`` is the crank angle (rad), ``u`` the slider position (m), ``w2`` the crank speed (rad/s), ``v`` the slider's velocity
    (m/s); ``load`` has the components of the force at P (N).

    Raises ValueError or ZeroDivisionError if the links cannot be joined at this position; InputError if the friction of
    the parameters depends on contact forces.
    """
    require_no_contact_friction(p, "a prescribed motion of the slider")
    g = kinematics.position(th2, u, p)
    k = kinematics.coefficients(g, p)
    w3, w4 = k.k32 * w2 + k.k3u * v, k.k42 * w2 + k.k4u * v
    _, b2 = dynamics.velocity_terms(g, k, w2, w3, w4, *kinematics.centripetal(g, w2, w3, w4, p), p)
    _, q2 = dynamics.applied_forces(g, k, u, v, *load, p)
    return dynamics.inertia(g, k, p).m22 * acceleration + b2 - q2


@takes_published(crank_speed=complete_speed)
@in_si(crank_speed="rad/s")
def inverse_dynamics(
    parameters: FiveBarParameters,
    slider: FourierSeries,
    crank_speed: Amount,
    *,
    load: Load = (0.0, 0.0),
    samples: int = 720,
) -> SliderDrive:
    """Compute the forces and the crank torque that move the slider along u(th2) while the crank turns at a constant speed.

    Parameters
    ----------
    parameters : FiveBarParameters
    slider : FourierSeries
        Slider position u (m) over the crank angle th2; `FourierSeries.from_samples` makes it from samples.
    crank_speed : float
        Crank speed (rad/s), not zero; if negative, the crank turns clockwise.
    load : (float, float) or function of the crank angle (rad)
        Force at the coupler point P (N).
    samples : int
        Number of samples of the turn, at equal steps of the crank angle from 0 on.

    Raises
    ------
    InputError
        If the speed is zero or not finite, the load is not two finite numbers, there are too few samples for the series, or
        the parameters have friction that depends on contact forces.
    AssemblyError
        If the links cannot be joined somewhere on the turn; the message gives the crank angle.
    """
    check_speed(crank_speed)
    if not float(samples).is_integer():
        raise InputError(f"{samples} samples of a turn: it must be a whole number")
    samples = int(samples)
    least = max(LEAST_SAMPLES, 2 * slider.order + 1)
    if samples < least:
        raise InputError(f"{samples} samples of a turn: a motion of order {slider.order} needs at least {least}")
    p = parameters.constants()
    time = 2.0 * pi / abs(crank_speed) * np.arange(samples) / samples
    angle = crank_speed * time
    slope = slider.derivative()
    states, inputs = np.zeros((samples, 6)), np.zeros((samples, 6))
    states[:, 0], states[:, 1], states[:, 2] = angle, slider(angle), crank_speed
    states[:, 3] = crank_speed * slope(angle)
    acceleration = crank_speed**2 * slope.derivative()(angle)
    inputs[:, 1] = crank_speed
    for x, i, a in zip(states.tolist(), inputs, acceleration.tolist()):
        _check_joined(parameters, x[0], x[1])
        at_p = load_at_angle(load, x[0])
        i[3], i[4], i[5] = slider_force(x[0], x[1], x[2], x[3], a, at_p, p), *at_p
    values = compute_outputs(FIVE_BAR, np.array([1.0]), np.array([*p, 0.0]), states, inputs)
    return SliderDrive(
        parameters=parameters,
        slider=slider,
        crank_speed=float(crank_speed),
        load=load,
        crank_angle=angle,
        time=time,
        states=states,
        inputs=inputs,
        values=values[:, _KEPT],
    )


def check_speed(crank_speed: float) -> None:
    """Raise InputError if a constant crank speed (rad/s) is zero or not finite."""
    if not (isfinite(crank_speed) and crank_speed != 0.0):
        raise InputError(f"crank speed is {crank_speed} rad/s: it must be finite and not zero")


def load_at_angle(load: Load, crank_angle: float) -> tuple[float, float]:
    """Return the load at P (N, N) at a crank angle (rad); raise InputError if it is not two finite numbers."""
    given = load(crank_angle) if callable(load) else load
    try:
        fx, fy = (float(part) for part in given)
    except (TypeError, ValueError):
        raise InputError(
            f"the load at P is {given!r} at crank angle {crank_angle:.9g} rad: it must be two numbers (N)"
        ) from None
    if not (isfinite(fx) and isfinite(fy)):
        raise InputError(f"the load at P is ({fx}, {fy}) N at crank angle {crank_angle:.9g} rad: it must be finite")
    return fx, fy


def _check_joined(parameters: FiveBarParameters, crank_angle: float, slider_position: float) -> None:
    try:
        check_assembly(crank_angle, slider_position, parameters.constants())
    except AssemblyError as error:
        raise AssemblyError(
            f"the motion of the slider cannot be followed beyond {degrees(crank_angle):.2f} deg of the turn: {error}"
        ) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class BestSpring:
    """The spring at the slider that minimises the rms control force of a motion.

    Attributes
    ----------
    parameters : FiveBarParameters
        Parameters of the mechanism with this spring.
    stiffness, free_position : float
        Stiffness (N/m) and free position (m) of the spring; a stiffness of zero means that it is best to have no spring.
    rms_force, rms_force_without : float
        Rms control force with this spring, and without any spring (N).
    """

    parameters: FiveBarParameters
    stiffness: float
    free_position: float
    rms_force: float
    rms_force_without: float


@takes_published(crank_speed=complete_speed)
@in_si(crank_speed="rad/s", free_position="m")
def best_spring(
    parameters: FiveBarParameters,
    slider: FourierSeries,
    crank_speed: Amount,
    *,
    free_position: Amount = None,
    load: Load = (0.0, 0.0),
    samples: int = 720,
) -> BestSpring:
    """Find stiffness and free position of the spring that minimise the rms control force of a motion.

    The force is affine in k and k u0, with the stiffness k and the free position u0 between the bounds low and high. The
    minimum is therefore a linear least-squares solution in the wedge k >= 0, low k <= k u0 <= high k: inside the wedge or
    on one of the two edges.

    Parameters
    ----------
    free_position : (float, float), optional
        Least and greatest free position (m); by default minus and plus the ground link's length. Bounds are needed because
        an arbitrarily soft spring with a far free position replaces any constant force.
    parameters, slider, crank_speed, load, samples
        As for `inverse_dynamics`; a spring in the parameters is ignored.

    Raises
    ------
    InputError, AssemblyError
        As for `inverse_dynamics`; also if the bounds are not finite and in order.
    """
    low, high = free_position or (-parameters.ground_length, parameters.ground_length)
    if not (-inf < low <= high < inf):
        raise InputError(f"free position between {low} m and {high} m: the bounds must be finite and in order")
    bare = replace(parameters, slider_stiffness=0.0, slider_spring_free_position=0.0)
    drive = inverse_dynamics(bare, slider, crank_speed, load=load, samples=samples)
    force, u = drive.force, drive.states[:, 1]

    def with_spring(k: float, free: float) -> tuple[float, float, float]:
        return float(np.sqrt(np.mean((force + k * (u - free)) ** 2))), k, free

    candidates = [with_spring(0.0, 0.0)]
    (k, preload), *_ = np.linalg.lstsq(np.column_stack([u, -np.ones_like(u)]), -force, rcond=None)
    if k > 0.0 and low <= preload / k <= high:
        candidates.append(with_spring(float(k), float(preload / k)))
    for edge in (low, high):
        stretch = u - edge
        if (soft := -float(force @ stretch)) > 0.0:
            candidates.append(with_spring(soft / float(stretch @ stretch), edge))
    rms, stiffness, free = min(candidates)
    return BestSpring(
        parameters=replace(parameters, slider_stiffness=stiffness, slider_spring_free_position=free),
        stiffness=stiffness,
        free_position=free,
        rms_force=rms,
        rms_force_without=candidates[0][0],
    )
