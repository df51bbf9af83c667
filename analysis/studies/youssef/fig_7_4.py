"""Fig 7.4: a curve of one's own choice traced exactly, the slider moving while the crank turns.

Within the accessible area of Fig 7.2 the coupler point can follow any path: at each of its points crank angle and slider
position follow in closed form, the crank pin as the intersection of two circles, the slider as that of a circle with the
guide. Whether the crank can keep turning is another question. P is never farther from the shaft A than l2 + r nor nearer than
r - l2, and at a point strictly between the crank has one angle to either side of AP. To pass from the one to the other, as a
full turn must, P has to be at one of the limits: so the crank turns fully along a closed curve that does not go round A only
if the curve touches both circles about A. Any other such curve makes the crank rock.

The data of the thesis's figure are lost. The mechanism of Fig 7.2, Table 3.1 with P, in its upper assembly, and an ellipse with
semi-axes of 6.1 and 2 cm at 48 degrees, placed so that it touches both circles, are our choice; so is the crank's constant
speed of 60 rpm.
"""

from __future__ import annotations

from functools import cache
from math import degrees, pi, radians
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import fsolve, minimize_scalar

from linkwork.five_bar import kinematics
from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.fourier import FourierSeries
from ...youssef import accessible_area, coupler_curves
from ..study import OURS, Study, StudyResult, at_least, at_most, near, padded
from ._chapter_7 import ASSIGNED, FloatArray
from .fig_7_2 import POSITIONS, mechanism

NUMBER = "7.4"

#: The curve: semi-axes (m) and direction of the longer one.
SEMI_AXES, TILT = (0.061, 0.02), radians(48.0)
#: rad/s.
SPEED = 2.0 * pi
SAMPLES = 1440
#: Distance from the curve that is asked of a Fourier series (m), and the highest that is tried.
TOLERANCE, HIGHEST = 1e-4, 24


def ellipse(s: FloatArray | float, centre: complex) -> FloatArray:
    """The curve as complex numbers (m)."""
    a, b = SEMI_AXES
    return np.asarray(centre + np.exp(1j * TILT) * (a * np.cos(s) + 1j * b * np.sin(s)))


def extreme(centre: complex, way: float) -> tuple[float, float]:
    """Where on the curve the distance from A is greatest (way 1) or least (way -1), and the distance (m)."""

    def lost(s: float) -> float:
        return -way * float(abs(ellipse(s, centre)))

    s = np.linspace(0.0, 2.0 * pi, 361)
    at = float(s[np.argmax(way * np.abs(ellipse(s, centre)))])
    found = minimize_scalar(lost, bracket=(at - 0.02, at, at + 0.02), tol=1e-14)
    return float(found.x) % (2.0 * pi), -way * float(found.fun)


@cache
def centre() -> complex:
    """Centre of the ellipse (m) that makes it touch both circles, upper left of A."""
    p = mechanism(1)
    limits = (p.coupler_point_distance + p.crank_length, p.coupler_point_distance - p.crank_length)

    def missed(place: FloatArray) -> list[float]:
        return [extreme(complex(*place), way)[1] - limit for way, limit in zip((1.0, -1.0), limits)]

    return complex(*fsolve(missed, [0.0145, 0.115], xtol=1e-13))


class Motion(NamedTuple):
    """The curve and what follows from it, at equal steps of the crank: shapes (n,), in rad and m."""

    crank_angle: FloatArray
    point: FloatArray
    u: FloatArray


def inverse(s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Crank angle (rad) and slider position (m) at points of the curve, upper assembly, the crank turning forward."""
    p = mechanism(1)
    l2, r = p.crank_length, p.coupler_point_distance
    point = ellipse(s, centre())
    d = np.abs(point)
    cosine = np.clip((l2 * l2 + d * d - r * r) / (2.0 * l2 * d), -1.0, 1.0)
    far, near_by = (extreme(centre(), way)[0] for way in (1.0, -1.0))
    # the crank is before AP on the way out, behind it on the way back
    back = (s - far) % (2.0 * pi) < (near_by - far) % (2.0 * pi)
    crank = np.angle(point) + np.where(back, 1.0, -1.0) * np.arccos(cosine)
    b = l2 * np.exp(1j * crank)
    c = b + p.coupler_length * (point - b) / r * np.exp(-1j * p.coupler_point_angle)
    # the guide lies along x; in this assembly the slider is to the right of C
    u = c.real + np.sqrt(p.rocker_length**2 - c.imag**2) - p.ground_length
    return np.unwrap(crank), u


@cache
def motion() -> Motion:
    """One turn of the crank along the curve."""
    s = np.linspace(0.0, 2.0 * pi, 8 * SAMPLES + 1)
    crank, _ = inverse(s)
    turn = crank[0] + 2.0 * pi * np.arange(SAMPLES) / SAMPLES
    at = CubicSpline(crank, s)(turn)
    _, u = inverse(at)
    return Motion(turn, ellipse(at, centre()), u)


def traced(crank_angle: FloatArray, u: FloatArray) -> FloatArray:
    """P as complex numbers (m), by the plant's kinematics."""
    p = mechanism(1).constants()
    return np.array(
        [complex(*kinematics.coupler_point(kinematics.position(t, q, p), p)) for t, q in zip(crank_angle, u)]
    )


def series() -> FourierSeries:
    """u over the crank angle from 0 on (m)."""
    m = motion()
    order = np.argsort(m.crank_angle % (2.0 * pi))
    angle, u = (m.crank_angle % (2.0 * pi))[order], m.u[order]
    spline = CubicSpline(np.append(angle, angle[0] + 2.0 * pi), np.append(u, u[0]), bc_type="periodic")
    return FourierSeries.from_samples(spline(2.0 * pi * np.arange(SAMPLES) / SAMPLES))


def compute() -> StudyResult:
    """Crank and slider along the curve, checked through the plant's kinematics, and the harmonics that the motion needs."""
    m, p = motion(), mechanism(1)
    constants = p.constants()
    crank, _ = inverse(np.linspace(0.0, 2.0 * pi, 2881))
    whole = series()
    velocity = SPEED * whole.derivative()(m.crank_angle)
    point_velocity, transmission = [], []
    for t, u, v in zip(m.crank_angle.tolist(), m.u.tolist(), velocity.tolist()):
        g = kinematics.position(t, u, constants)
        k = kinematics.coefficients(g, constants)
        point_velocity.append(
            complex(*kinematics.coupler_point_velocity(g, SPEED, k.k32 * SPEED + k.k3u * v, constants))
        )
        gamma = kinematics.transmission_angle(g, constants)
        transmission.append(min(gamma, pi - gamma))
    speeds = np.array(point_velocity)
    # P's velocity from the curve alone: its derivative over the time of the turn
    along = np.fft.ifft(1j * np.fft.fftfreq(SAMPLES, 1.0 / SAMPLES) * np.fft.fft(m.point)) * SPEED
    misses = {
        n: float(np.abs(traced(m.crank_angle, whole.to_order(n)(m.crank_angle)) - m.point).max())
        for n in range(HIGHEST + 1)
    }
    needed = next(n for n, miss in misses.items() if miss <= TOLERANCE)
    held = min(
        float(max(np.abs(m.point - z).min() for z in curve.arcs[0].x + 1j * curve.arcs[0].y))
        for curve in coupler_curves(p, (np.linspace(POSITIONS[0], POSITIONS[-1], 41) / CM_PER_METRE).tolist(), n=360)
    )
    area = accessible_area(p, (POSITIONS[0] / CM_PER_METRE, POSITIONS[-1] / CM_PER_METRE), tolerance=1e-3)
    columns = {
        "crank angle [deg]": np.degrees(m.crank_angle - m.crank_angle[0]),
        "curve x [cm]": CM_PER_METRE * m.point.real,
        "curve y [cm]": CM_PER_METRE * m.point.imag,
        "slider [cm]": CM_PER_METRE * m.u,
        "slider velocity [cm/s]": CM_PER_METRE * velocity,
        "speed of P [cm/s]": CM_PER_METRE * np.abs(speeds),
        "harmonics [1]": np.array([float(n) for n in misses]),
        "greatest distance from the curve [cm]": CM_PER_METRE * np.array(list(misses.values())),
    }
    for kind, rings in (("boundary", area.outer), ("hole", area.holes)):
        for number, ring in enumerate(rings, start=1):
            columns[f"{kind} {number} x [cm]"] = CM_PER_METRE * ring[:, 0]
            columns[f"{kind} {number} y [cm]"] = CM_PER_METRE * ring[:, 1]
    for u, curve in zip(
        (POSITIONS[0], 0, POSITIONS[-1]),
        coupler_curves(p, [POSITIONS[0] / CM_PER_METRE, 0.0, POSITIONS[-1] / CM_PER_METRE]),
    ):
        columns[f"x at u = {u} cm [cm]"] = CM_PER_METRE * curve.arcs[0].x
        columns[f"y at u = {u} cm [cm]"] = CM_PER_METRE * curve.arcs[0].y
    verdicts = (
        near("rotation of the crank along the curve", OURS, 1.0, (crank[-1] - crank[0]) / (2.0 * pi), 1e-6, "turns"),
        at_least(
            "least rotation of the crank from point to point; it turns one way",
            OURS,
            0.0,
            np.diff(crank).min(),
            "rad",
        ),
        at_most(
            "greatest distance of P from the curve, by the plant's kinematics",
            OURS,
            1e-7,
            CM_PER_METRE * np.abs(traced(m.crank_angle, m.u) - m.point).max(),
            "cm",
        ),
        at_most("greatest slider position either way", OURS, POSITIONS[-1], CM_PER_METRE * np.abs(m.u).max(), "cm"),
        at_least("least transmission angle", OURS, 40.0, degrees(min(transmission)), "deg"),
        at_most(
            "velocity of P by the plant's coefficients against the curve's, relative",
            OURS,
            1e-4,
            float(np.abs(speeds - along).max() / np.abs(along).max()),
        ),
        at_least(
            "farthest point of the curve from the nearest coupler curve of a held slider",
            OURS,
            0.1,
            CM_PER_METRE * held,
            "cm",
        ),
        at_most(f"harmonics of the slider that keep P within {1e3 * TOLERANCE:g} mm", OURS, HIGHEST, needed),
    )
    return StudyResult(
        number=NUMBER,
        claim="Any path within the accessible area can be traced by moving the slider while the crank turns.",
        assignment=f"{ASSIGNED} The data of this one are lost: mechanism, curve and speed are our choice.",
        columns=padded(columns),
        verdicts=verdicts,
    )


def draw(result: StudyResult) -> Figure:
    """The curve in the area, the slider over the crank, velocities, and what a Fourier series leaves."""
    c = result.columns

    def points(name: str) -> FloatArray:
        ring = np.column_stack([c[f"{name} {axis} [cm]"] for axis in "xy"])
        return np.asarray(ring[np.isfinite(ring[:, 0])])

    rings = [n.removesuffix(" x [cm]") for n in c if n.startswith(("boundary", "hole")) and n.endswith(" x [cm]")]
    held = [(POSITIONS[0], "0.6"), (0, "0.45"), (POSITIONS[-1], "0.6")]
    turn = c["crank angle [deg]"]
    panels = [
        Panel(
            x_label="x [cm]",
            y_label="y [cm]",
            title="curve in the accessible area; slider held in grey",
            curves=[
                *(
                    Curve(x=c[f"x at u = {u} cm [cm]"], y=c[f"y at u = {u} cm [cm]"], colour=colour, width=0.8)
                    for u, colour in held
                ),
                Curve(x=c["curve x [cm]"], y=c["curve y [cm]"], colour=COLOURS[1], width=1.8),
            ],
            filled=[[points(name) for name in rings]],
            equal=True,
        ),
        Panel(
            x_label="crank angle from the start [deg]",
            y_label="slider position u [cm]",
            title="what the slider does",
            curves=[Curve(x=turn, y=c["slider [cm]"], colour=COLOURS[0])],
            x_ticks=range(0, 361, 60),
        ),
        Panel(
            x_label="crank angle from the start [deg]",
            y_label="velocity at 60 rpm [cm/s]",
            title="velocities",
            curves=[
                Curve(x=turn, y=c["slider velocity [cm/s]"], label="slider"),
                Curve(x=turn, y=c["speed of P [cm/s]"], label="P, along the curve"),
            ],
            x_ticks=range(0, 361, 60),
        ),
        Panel(
            x_label="harmonics of the slider's motion",
            y_label="greatest distance from the curve [cm]",
            title="the motion as a Fourier series",
            curves=[
                Curve(x=c["harmonics [1]"], y=c["greatest distance from the curve [cm]"], marker="o", colour=COLOURS[2])
            ],
            logarithmic="y",
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 3.4))


STUDY = Study(NUMBER, compute, draw)
