"""The five-bar slider as a described linkage, in all coordinates of its bodies with Lagrange multipliers: see `planar`.

All angles are absolute, so that the rocker's th4 is the thesis's theta4 + alpha.
"""

import math
from cmath import exp, phase
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from analysis.linkages import read_description
from linkwork.five_bar.dynamics import Inputs
from linkwork.five_bar.parameters import FiveBarParameters

from .planar import Multipliers

#: Names of the forces in `Known.forces`, as in the FMI contract.
FORCE_NAMES = (*(f"pin.{pin}.f{axis}" for pin in "ABCD" for axis in "xy"), "slider.guide_force")


class Known(NamedTuple):
    """th2'', th3'', th4'' (rad/s2), u'' (m/s2), forces by FMI name (N), torque (N.m), and power lost by friction (W)."""

    accelerations: np.ndarray
    forces: dict[str, float]
    torque: float
    lost: float


def polar(distance: float, angle: float) -> list[float]:
    return [distance * math.cos(angle) or 0, distance * math.sin(angle) or 0]


def spring(p: Any) -> dict[str, Any]:
    return {
        "at": "G", "stiffness": p.slider_stiffness, "damping": p.slider_damping,
        "free": p.slider_spring_free_position, "friction": p.slider_coulomb_friction,
    }  # fmt: skip


def described(p: Any) -> dict[str, Any]:
    """The five-bar slider in words, of the parameters of the hand-written one."""
    inertia = p.crank_inertia - p.crank_mass * p.crank_cog_distance**2
    friction = {joint: getattr(p, f"pin_{joint}_friction_radius") for joint in "ABCD"}
    friction["G"] = p.slider_friction_coefficient
    return {
        "friction": {joint: value for joint, value in friction.items() if value},
        "name": "five-bar-described",
        "ground": {"A": [0, 0], "O": [p.ground_length, 0]},
        "bodies": {
            "crank": {
                "bar": ["A", "B"], "length": p.crank_length, "mass": p.crank_mass, "inertia": inertia,
                "cog": polar(p.crank_cog_distance, p.crank_cog_angle),
            },
            "coupler": {
                "bar": ["B", "C"], "length": p.coupler_length, "mass": p.coupler_mass, "inertia": p.coupler_inertia,
                "points": {"P": polar(p.coupler_point_distance, p.coupler_point_angle)},
                "cog": polar(p.coupler_cog_distance, p.coupler_cog_angle),
            },
            "rocker": {
                "bar": ["D", "C"], "length": p.rocker_length, "mass": p.rocker_mass, "inertia": p.rocker_inertia,
                "cog": polar(p.rocker_cog_distance, p.rocker_cog_angle),
            },
            "block": {"points": {"D": [0, 0]}, "mass": p.slider_mass},
        },
        "slides": {"G": {"body": "block", "through": "O", "direction": p.slider_guide_angle}},
        "freedoms": {"crank": {"joint": "A", "speed": 44.0}, "slider": "G"},
        "springs": {"spring": spring(p)},
        "assembly": {"C": p.assembly_branch},
        "loads": ["P"],
        "gravity": p.gravity,
        "gravity_direction": -0.5 * math.pi - p.ground_inclination,
    }  # fmt: skip


def assemble(p: FiveBarParameters, crank_angle: float, slider_position: float) -> np.ndarray:
    """Return th2, th3, th4 (rad) and u (m) that close the loop, by the law of cosines."""
    b_to_d = p.ground_length + slider_position * exp(1j * p.slider_guide_angle) - p.crank_length * exp(1j * crank_angle)
    d, l3 = abs(b_to_d), p.coupler_length
    at_b = math.acos(min(1.0, (d * d + l3 * l3 - p.rocker_length**2) / (2.0 * d * l3)))
    th3 = phase(b_to_d) + p.assembly_branch * at_b
    return np.array([crank_angle, th3, phase(l3 * exp(1j * th3) - b_to_d), slider_position])


@lru_cache(maxsize=4)
def oracle(p: FiveBarParameters) -> Multipliers:
    return Multipliers(read_description(described(p)))


def solve(p: FiveBarParameters, x: Any, i: Inputs) -> Known:
    """Return accelerations and forces in a state (th2, u and their rates, first) under the inputs of the plant."""
    th2, th3, th4, u = assemble(p, x[0], x[1])
    b, d = p.crank_length * exp(1j * th2), p.ground_length + u * exp(1j * p.slider_guide_angle)
    q = np.array([0, 0, th2, b.real, b.imag, th3, d.real, d.imag, th4, d.real, d.imag, p.slider_guide_angle])
    assert oracle(p).residual(q) < 1e-14
    commanded = {0: i.acceleration} if i.speed_drive else {}
    loads = np.array([i.torque, i.force])
    found = oracle(p).solve(q, np.array(x[2:4]), loads, commanded, {"P": (i.load_x, i.load_y)}, {})
    # on the crank by the ground, on the coupler by the crank and by the rocker, on the rocker by the slider
    pins = [sign * part for pin, sign in zip("ABCD", (-1.0, -1.0, 1.0, 1.0)) for part in found.forces[pin]]
    forces = dict(zip(FORCE_NAMES, (*pins, found.forces["G"][0])))
    return Known(np.append(found.places[[2, 5, 8]], found.accelerations[1]), forces, float(found.loads[0]), found.lost)
