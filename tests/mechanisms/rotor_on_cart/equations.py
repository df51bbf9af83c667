"""A rotor with an unbalanced mass on a sprung and damped cart, in the vertical plane: angle th from the cart's direction, cart
position s.

    (J + m l2) th'' - m l sin(th) s'' = T - m g l cos(th)
    (M + m) s'' - m l sin(th) th'' - m l cos(th) th'2 = F - k s - c s'
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

State = tuple[float, float, float, float, float, float]


class Constants(NamedTuple):
    """Constants of the equations: J + m l2, m l, M + m, k, c, m g l."""

    inertia: float
    unbalance: float
    mass: float
    k: float
    c: float
    weight: float


class Applied(NamedTuple):
    """Inputs of the equations: whether the speed is prescribed, torque, angular acceleration, force."""

    speed_drive: float
    torque: float
    acceleration: float
    force: float


def apply_inputs(modes: tuple[float, ...], u: tuple[float, ...], p: Constants) -> Applied:
    """Return what acts on the mechanism, from drive.mode and the channels."""
    (drive,) = modes
    torque, _, acceleration, force = u
    return Applied(drive, (1.0 - drive) * torque, drive * acceleration, force)


def motion(x: State, i: Applied, p: Constants) -> tuple[float, float, float]:
    """Return the angular acceleration, the acceleration of the cart and the torque."""
    th, s, w, v, _, _ = x
    m12 = -p.unbalance * sin(th)
    r1 = i.torque - p.weight * cos(th)
    r2 = i.force - p.k * s - p.c * v + p.unbalance * cos(th) * w * w
    free = 1.0 - i.speed_drive
    e = i.speed_drive * i.acceleration + free * (p.mass * r1 - m12 * r2) / (p.inertia * p.mass - m12 * m12)
    a = (r2 - m12 * e) / p.mass
    return e, a, i.torque + i.speed_drive * (p.inertia * e + m12 * a - r1)


def derivative(x: State, i: Applied, p: Constants) -> State:
    """Return the time derivative of the state."""
    e, a, torque = motion(x, i, p)
    return (x[2], x[3], e, a, p.c * x[3] * x[3], torque * x[2] + i.force * x[3])


def kinetic_energy(th: float, w: float, v: float, p: Constants) -> float:
    """Return the kinetic energy (J)."""
    return 0.5 * (p.inertia * w * w + p.mass * v * v) - p.unbalance * sin(th) * w * v


def energy(x: State, p: Constants) -> float:
    """Return the mechanical energy (J)."""
    return kinetic_energy(x[0], x[2], x[3], p) + 0.5 * p.k * x[1] * x[1] + p.weight * sin(x[0])


def outputs(x: State, i: Applied, start_energy: float, p: Constants) -> tuple[float, ...]:
    """Return all real outputs, in the order of the interface."""
    e, a, torque = motion(x, i, p)
    return (x[0], x[2], e, x[1], x[3], a, torque, energy(x, p) - start_energy + x[4] - x[5])


def clearance(x: State, i: Applied, p: Constants) -> float:
    """Return 1: the mechanism can always be assembled."""
    return 1.0


def jump(x: State, i: Applied, u: tuple[float, ...], p: Constants) -> State:
    """Return the state after a jump of the commanded speed, which conserves the cart's momentum."""
    th, s, w, v, dissipated, supplied = x
    w_new = (1.0 - i.speed_drive) * w + i.speed_drive * u[1]
    v_new = v + p.unbalance * sin(th) * (w_new - w) / p.mass
    work = kinetic_energy(th, w_new, v_new, p) - kinetic_energy(th, w, v, p)
    return (th, s, w_new, v_new, dissipated, supplied + work)


def start(x: State, i: Applied, p: Constants) -> State:
    """Return the initial state unchanged."""
    return x


def error_scale(parameters, x):  # type: ignore[no-untyped-def]
    """Return the magnitudes of the states below which errors are absolute."""
    return (1.0, 0.05, 10.0, 1.0, 1.0, 1.0)
