"""Newton's and Euler's equations for each link of the five-bar slider with friction in pins and guide, solved numerically.

The 14 unknowns are the accelerations of all redundant coordinates, all pin forces, the guide's force and the crank torque. The
equations are eleven equations of motion of the links, two of the loop's acceleration and one of the drive. Friction enters them
by its law, so that they are not linear; a general root finder solves them. They share the geometry with `multipliers`, but use
no virtual work.
"""

from __future__ import annotations

from math import tanh
from typing import NamedTuple

import numpy as np
from scipy.optimize import root

from linkwork.five_bar.dynamics import Inputs, State
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.friction import FRICTION_FORCE, FRICTION_RATE, FRICTION_SPEED

from .multipliers import (
    _B,
    _C_COUPLER,
    _G5,
    _P,
    FORCE_NAMES,
    Vector,
    _cross,
    _links,
    _loop,
    _real,
    _state,
    assemble,
    rates,
)


class Solution(NamedTuple):
    """th2'', th3'', th4'' (rad/s2), u'' (m/s2), forces by FMI name (N), torque (N.m), and power lost by friction (W)."""

    accelerations: Vector
    forces: dict[str, float]
    torque: float
    lost: float


def magnitude(force: complex) -> float:
    return float(np.sqrt(abs(force) ** 2 + FRICTION_FORCE**2))


def solve(par: FiveBarParameters, x: State, i: Inputs) -> Solution:
    """Return all accelerations and forces at one instant."""
    q = assemble(par, x[0], x[1])
    qd = rates(par, q, x[2], x[3])
    links = _links(par)
    state = _state(q, qd, links)
    w2, w3, w4, v = qd
    # angular velocity in each pin of the first link relative to the second; friction opposes it
    turning = {"A": w2, "B": w3 - w2, "C": w3 - w4, "D": w4}
    load = complex(i.load_x, i.load_y)
    points = {"A": 0j, "B": state.points[_B], "C": state.points[_C_COUPLER], "D": state.points[_G5]}
    along = i.force - par.slider_stiffness * (q[3] - par.slider_spring_free_position) - par.slider_damping * v
    along -= par.slider_coulomb_friction * tanh(v / FRICTION_SPEED)

    def friction(pins: dict[str, complex], guide: float) -> tuple[dict[str, float], float]:
        """Return the friction moments on the first link of each pin, and the friction force on the slider."""
        moments = {
            name: -getattr(par, f"pin_{name}_friction_radius") * magnitude(pins[name]) * tanh(rate / FRICTION_RATE)
            for name, rate in turning.items()
        }
        return moments, -par.slider_friction_coefficient * magnitude(guide) * tanh(v / FRICTION_SPEED)

    def residual(unknown: Vector) -> Vector:
        accelerations, guide, torque = unknown[:4], unknown[12], unknown[13]
        pins = dict(zip("ABCD", unknown[4:12:2] + 1j * unknown[5:12:2]))
        moments, rub = friction(pins, guide)
        net = links.masses * (state.jacobian[:4] @ accelerations + state.centripetal[:4] - links.gravity)
        # signs of the pin forces on crank, coupler and rocker: A is the force of the ground on the crank, B of the crank on
        # the coupler, C of the rocker on the coupler, D of the slider on the rocker
        on = ({"A": 1, "B": -1}, {"B": 1, "C": 1}, {"C": -1, "D": 1})
        couples = (torque + moments["A"] - moments["B"], moments["B"] + moments["C"], moments["D"] - moments["C"])
        found: list[float] = []
        for n, (acting, couple) in enumerate(zip(on, couples)):
            force = sum(sign * pins[name] for name, sign in acting.items()) + (load if n == 1 else 0.0)
            arms = {name: points[name] - state.points[n] for name in acting}
            moment = couple + sum(sign * _cross(arms[name], pins[name]) for name, sign in acting.items())
            moment += _cross(state.points[_P] - state.points[n], load) if n == 1 else 0.0
            found += [*_real(np.array(force - net[n])), moment - links.inertias[n] * accelerations[n]]
        found += [*_real(np.array(-pins["D"] + (along + rub + 1j * guide) * links.guide - net[3]))]
        found += [*_real(_loop(state.jacobian) @ accelerations + _loop(state.centripetal))]
        found.append(accelerations[0] - i.acceleration if i.speed_drive else torque - i.torque)
        return np.array(found)

    # scale rows and columns to a similar size
    jacobian = np.column_stack([residual(unit) - residual(np.zeros(14)) for unit in np.eye(14)])
    rows = np.abs(jacobian).max(axis=1)
    columns = np.abs(jacobian / rows[:, None]).max(axis=0)

    def further(unknown: Vector) -> Vector:
        """Improve a solution by the root finder; the residual is scaled to a size near one."""
        size = 1.0 + np.abs(unknown * columns).max()

        def scaled(z: Vector) -> Vector:
            return residual(unknown + size * z / columns) / rows / size

        return unknown + size * root(scaled, np.zeros(14), method="hybr", tol=1e-15).x / columns

    unknown = further(further(np.zeros(14)))
    left = np.abs(residual(unknown) / rows).max() / np.abs(unknown * columns).max()
    assert left < 1e-11, left
    pins = dict(zip("ABCD", unknown[4:12:2] + 1j * unknown[5:12:2]))
    moments, rub = friction(pins, unknown[12])
    lost = -sum(moment * turning[name] for name, moment in moments.items()) - rub * v
    return Solution(unknown[:4], dict(zip(FORCE_NAMES, unknown[4:13])), float(unknown[13]), float(lost))
