"""A rotor on a torsion spring, excited by a crank: angle x of the rotor, angle th of the crank, whose speed is commanded.

    J x'' + c x' + (k + m cos(th)) x + b x^3 + w sin(x) = T cos(th)

With some of the constants zero it is Mathieu's equation, Duffing's equation, or that of the driven pendulum.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

State = tuple[float, float, float, float, float, float]


class Constants(NamedTuple):
    """Constants of the equation: J, c, k, b, m, w, T."""

    inertia: float
    damping: float
    stiffness: float
    cubic: float
    modulation: float
    weight: float
    excitation: float


class Applied(NamedTuple):
    """Inputs of the equations: angular acceleration of the crank, torque on the rotor."""

    acceleration: float
    torque: float


def apply_inputs(modes: tuple[float, ...], u: tuple[float, ...], p: Constants) -> Applied:
    """Return what acts on the mechanism, from the channels."""
    _, acceleration, torque = u
    return Applied(acceleration, torque)


def driving(x: State, i: Applied, p: Constants) -> float:
    """Return the torque on the rotor without the torques of spring, weight and damper."""
    return i.torque + (p.excitation - p.modulation * x[1]) * cos(x[0])


def acceleration(x: State, i: Applied, p: Constants) -> float:
    """Return the angular acceleration of the rotor."""
    s = x[1]
    return (driving(x, i, p) - p.damping * x[3] - p.stiffness * s - p.cubic * s * s * s - p.weight * sin(s)) / p.inertia


def derivative(x: State, i: Applied, p: Constants) -> State:
    """Return the time derivative of the state."""
    return (x[2], x[3], i.acceleration, acceleration(x, i, p), p.damping * x[3] * x[3], driving(x, i, p) * x[3])


def energy(x: State, p: Constants) -> float:
    """Return the mechanical energy (J)."""
    s = x[1]
    spring = 0.5 * p.stiffness * s * s + 0.25 * p.cubic * s * s * s * s
    return 0.5 * p.inertia * x[3] * x[3] + spring - p.weight * cos(s)


def outputs(x: State, i: Applied, start_energy: float, p: Constants) -> tuple[float, ...]:
    """Return all real outputs, in the order of the interface."""
    balance = energy(x, p) - start_energy + x[4] - x[5]
    return (x[0], x[2], i.acceleration, x[1], x[3], acceleration(x, i, p), balance)


def clearance(x: State, i: Applied, p: Constants) -> float:
    """Return 1: the mechanism can always be assembled."""
    return 1.0


def jump(x: State, i: Applied, u: tuple[float, ...], p: Constants) -> State:
    """Return the state after a jump of the commanded speed, which does not change the rotor's motion."""
    return (x[0], x[1], u[0], x[3], x[4], x[5])


def start(x: State, i: Applied, p: Constants) -> State:
    """Return the initial state unchanged."""
    return x


def error_scale(parameters, x):  # type: ignore[no-untyped-def]
    """Return the magnitudes of the states below which errors are absolute."""
    return (1.0, 1.0, max(1.0, abs(x[2])), max(1.0, abs(x[2])), 1.0, 1.0)
