"""Two unbalanced rotors on one sprung and damped cart, in a horizontal plane: angles th1, th2 from the cart's direction, cart
position s, unbalances U = m r, moments of inertia I about the axes, total mass M.

    I_i th_i'' - U_i sin(th_i) s'' = T_i
    M s'' - sum U_i (sin(th_i) th_i'' + cos(th_i) th_i'2) = F - k s - c s'
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

State = tuple[float, ...]


class Constants(NamedTuple):
    """Constants of the equations: moments of inertia, unbalances, total mass, spring stiffness, damping."""

    inertia1: float
    inertia2: float
    unbalance1: float
    unbalance2: float
    mass: float
    k: float
    c: float


class Applied(NamedTuple):
    """Inputs: whether each rotor's speed is prescribed, its torque and angular acceleration; force on the cart."""

    speed1: float
    speed2: float
    torque1: float
    torque2: float
    acceleration1: float
    acceleration2: float
    force: float


def apply_inputs(modes: tuple[float, ...], u: tuple[float, ...], p: Constants) -> Applied:
    """Return what acts on the mechanism, from the modes and the channels."""
    m1, m2 = modes
    t1, _, a1, t2, _, a2, force = u
    return Applied(m1, m2, (1.0 - m1) * t1, (1.0 - m2) * t2, m1 * a1, m2 * a2, force)


def motion(x: State, i: Applied, p: Constants) -> tuple[float, float, float, float, float]:
    """Return both angular accelerations, the acceleration of the cart and both torques."""
    th1, th2, s, w1, w2, v = x[:6]
    b1, b2 = p.unbalance1 * sin(th1), p.unbalance2 * sin(th2)
    free1, free2 = 1.0 - i.speed1, 1.0 - i.speed2
    e1 = i.acceleration1 + free1 * i.torque1 / p.inertia1
    e2 = i.acceleration2 + free2 * i.torque2 / p.inertia2
    pull = p.unbalance1 * cos(th1) * w1 * w1 + p.unbalance2 * cos(th2) * w2 * w2
    moving = p.mass - free1 * b1 * b1 / p.inertia1 - free2 * b2 * b2 / p.inertia2
    a = (i.force - p.k * s - p.c * v + pull + b1 * e1 + b2 * e2) / moving
    e1 = e1 + free1 * b1 * a / p.inertia1
    e2 = e2 + free2 * b2 * a / p.inertia2
    return e1, e2, a, p.inertia1 * e1 - b1 * a, p.inertia2 * e2 - b2 * a


def derivative(x: State, i: Applied, p: Constants) -> State:
    """Return the time derivative of the state."""
    e1, e2, a, t1, t2 = motion(x, i, p)
    w1, w2, v = x[3], x[4], x[5]
    return (w1, w2, v, e1, e2, a, p.c * v * v, t1 * w1 + t2 * w2 + i.force * v)


def kinetic_energy(th1: float, th2: float, w1: float, w2: float, v: float, p: Constants) -> float:
    """Return the kinetic energy (J)."""
    coupling = (p.unbalance1 * sin(th1) * w1 + p.unbalance2 * sin(th2) * w2) * v
    return 0.5 * (p.inertia1 * w1 * w1 + p.inertia2 * w2 * w2 + p.mass * v * v) - coupling


def energy(x: State, p: Constants) -> float:
    """Return the mechanical energy (J)."""
    return kinetic_energy(x[0], x[1], x[3], x[4], x[5], p) + 0.5 * p.k * x[2] * x[2]


def outputs(x: State, i: Applied, start_energy: float, p: Constants) -> tuple[float, ...]:
    """Return all real outputs, in the order of the interface."""
    e1, e2, a, t1, t2 = motion(x, i, p)
    return (x[0], x[3], e1, x[1], x[4], e2, x[2], x[5], a, t1, t2, energy(x, p) - start_energy + x[6] - x[7])


def clearance(x: State, i: Applied, p: Constants) -> float:
    """Return 1: the mechanism can always be assembled."""
    return 1.0


def jump(x: State, i: Applied, u: tuple[float, ...], p: Constants) -> State:
    """Return the state after a jump of commanded speeds, which conserves the momenta of the cart and of free rotors."""
    th1, th2, s, w1, w2, v, dissipated, supplied = x
    b1, b2 = p.unbalance1 * sin(th1), p.unbalance2 * sin(th2)
    free1, free2 = 1.0 - i.speed1, 1.0 - i.speed2
    # changes of the commanded speeds, then of the cart's velocity and the free ones
    d1, d2 = i.speed1 * (u[1] - w1), i.speed2 * (u[4] - w2)
    dv = (b1 * d1 + b2 * d2) / (p.mass - free1 * b1 * b1 / p.inertia1 - free2 * b2 * b2 / p.inertia2)
    n1, n2 = w1 + d1 + free1 * b1 * dv / p.inertia1, w2 + d2 + free2 * b2 * dv / p.inertia2
    work = kinetic_energy(th1, th2, n1, n2, v + dv, p) - kinetic_energy(th1, th2, w1, w2, v, p)
    return (th1, th2, s, n1, n2, v + dv, dissipated, supplied + work)


def start(x: State, i: Applied, p: Constants) -> State:
    """Return the initial state unchanged."""
    return x


def error_scale(parameters, x):  # type: ignore[no-untyped-def]
    """Return the magnitudes of the states below which errors are absolute."""
    return (1.0, 1.0, 0.01, 10.0, 10.0, 1.0, 1.0, 1.0)
