"""A damped pendulum driven by a torque, angle th from the horizontal: J th'' = T - m g l cos(th) - c th'."""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

State = tuple[float, float, float, float]


class Constants(NamedTuple):
    """Constants of the equation: J, c, m g l."""

    inertia: float
    damping: float
    weight: float


def apply_inputs(modes: tuple[float, ...], u: tuple[float, ...], p: Constants) -> float:
    """Return the torque on the pendulum (N.m)."""
    return u[0]


def acceleration(x: State, torque: float, p: Constants) -> float:
    """Return the angular acceleration."""
    return (torque - p.weight * cos(x[0]) - p.damping * x[1]) / p.inertia


def derivative(x: State, torque: float, p: Constants) -> State:
    """Return the time derivative of the state."""
    return (x[1], acceleration(x, torque, p), p.damping * x[1] * x[1], torque * x[1])


def energy(x: State, p: Constants) -> float:
    """Return the mechanical energy (J)."""
    return 0.5 * p.inertia * x[1] * x[1] + p.weight * sin(x[0])


def outputs(x: State, torque: float, start_energy: float, p: Constants) -> tuple[float, ...]:
    """Return all real outputs, in the order of the interface."""
    return (x[0], x[1], acceleration(x, torque, p), energy(x, p) - start_energy + x[2] - x[3])


def places(x: State, torque: float, p: Constants) -> tuple[float, ...]:
    """Return x, y and z of the pivot and of the end of a rod of 1 m."""
    return (0.0, 0.0, 0.0, cos(x[0]), sin(x[0]), 0.0)


def clearance(x: State, torque: float, p: Constants) -> float:
    """Return 1: the mechanism can always be assembled."""
    return 1.0


def jump(x: State, torque: float, u: tuple[float, ...], p: Constants) -> State:
    """Return the state unchanged, because no rate is commanded."""
    return x


def start(x: State, torque: float, p: Constants) -> State:
    """Return the initial state unchanged."""
    return x


def error_scale(parameters, x):  # type: ignore[no-untyped-def]
    """Return the magnitudes of the states below which errors are absolute."""
    return (1.0, 10.0, 1.0, 1.0)
