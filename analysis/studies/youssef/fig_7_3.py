"""Fig 7.3: the slider position of least error at one crank angle, in closed form.

The links are given, the crank is held, and the slider is moved: the distance of the coupler point from its target is then a
function of one number. The thesis finds where it is stationary, eqs (7.6)-(7.15): the coupler points at the target, with the
rocker on either side; or the rocker is perpendicular to the guide, cos th4 = 0, either way and with the coupler on either
side. Which of them is least depends on the target: the coupler cannot turn to every angle, and where it cannot turn to the
target the perpendicular rocker is as far as it goes.

The thesis's figure and its data are lost. The printed linkage of the timed ellipse (a) and two targets, one of the ellipse
and one that its coupler cannot point at, are our choice. The stationary points are computed here from the thesis's equations,
and compared with the error over a dense range of positions, and with `analysis.motion.variational_motion`.
"""

from __future__ import annotations

from dataclasses import replace
from math import hypot, pi, radians
from typing import NamedTuple

import numpy as np

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...motion import variational_motion
from ...synthesis.published import PROBLEMS
from ..study import OURS, Study, StudyResult, at_least, at_most, near, padded
from ._chapter_7 import ASSIGNED, FloatArray

NUMBER = "7.3"
LINKAGE = PROBLEMS["ellipse-a"].linkage
#: Crank rotation at which the slider is moved (deg).
ROTATION = 60.0
#: Direction from the crank pin of a target that the coupler cannot point at, from its own at the ellipse's (deg).
TURNED = 25.0
ASSEMBLIES = (("C left of BD", 1), ("C right of BD", -1))
SAMPLES = 100_000
KINDS = ("coupler at the target", "cos th4 = 0, sin th4 = +1", "cos th4 = 0, sin th4 = -1")


class Stationary(NamedTuple):
    """A stationary point of the error: what makes it one, slider position and error (m), and whether the links meet there."""

    what: str
    u: float
    error: float
    branch: int


def pins() -> tuple[complex, complex]:
    """Crank shaft and crank pin in the plane (m)."""
    a = complex(LINKAGE.pivot_x, LINKAGE.pivot_y)
    return a, a + LINKAGE.crank_length * np.exp(1j * (radians(ROTATION) + LINKAGE.crank_phase + LINKAGE.ground_angle))


def targets() -> dict[str, complex]:
    """The two targets (m): the ellipse's at this rotation, and one about the crank pin from it."""
    points = np.asarray(PROBLEMS["ellipse-a"].task.points)  # type: ignore[union-attr]
    on_ellipse = complex(*points[round(ROTATION / 360.0 * len(points))])
    _, b = pins()
    return {
        "a target of the ellipse": on_ellipse,
        "one out of reach": b + (on_ellipse - b) * np.exp(1j * radians(TURNED)),
    }


def stationary(target: complex) -> list[Stationary]:
    """The candidates of eqs (7.6)-(7.15), the guide along the ground link."""
    k = LINKAGE
    a, b = pins()
    frame = np.exp(1j * k.ground_angle)
    pin = (b - a) / frame - k.ground_length
    wanted = float(np.angle((target - b) / frame)) - k.point_angle
    found: list[tuple[str, float, float]] = []
    sine = (k.coupler_length * np.sin(wanted) + pin.imag) / k.rocker_length
    if abs(sine) <= 1.0:
        found += [(KINDS[0], wanted, angle) for angle in (np.arcsin(sine), pi - np.arcsin(sine))]
    for name, way in zip(KINDS[1:], (1.0, -1.0)):
        sine = (way * k.rocker_length - pin.imag) / k.coupler_length
        if abs(sine) <= 1.0:
            found += [(name, angle, way * 0.5 * pi) for angle in (np.arcsin(sine), pi - np.arcsin(sine))]
    result = []
    for what, th3, th4 in found:
        u = pin.real + k.coupler_length * np.cos(th3) - k.rocker_length * np.cos(th4)
        point = b + k.point_distance * np.exp(1j * (th3 + k.point_angle)) * frame
        branch = 1 if np.sin(th4 - th3) > 0.0 else -1
        result.append(Stationary(what, float(u), abs(point - target), branch))
    return result


def swept(target: complex, branch: int, u: FloatArray) -> FloatArray:
    """Error over slider positions (m), by the linkage's own kinematics; NaN where the links cannot be joined."""
    phi = np.full(u.size, radians(ROTATION))
    x, y = replace(LINKAGE, branch=branch).path(phi, (u, np.zeros(u.size))).T
    return np.asarray(np.hypot(x - target.real, y - target.imag))


def reach() -> FloatArray:
    """Slider positions at which the links can be joined (m), crowded towards the limits of assembly; NaN between the ranges."""
    k = LINKAGE
    a, b = pins()
    pin = (b - a) / np.exp(1j * k.ground_angle) - k.ground_length
    far, near_by = (
        np.sqrt(d**2 - pin.imag**2) for d in (k.coupler_length + k.rocker_length, k.coupler_length - k.rocker_length)
    )
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, pi, SAMPLES))
    return np.concatenate(
        [pin.real - far + (far - near_by) * share, [np.nan], pin.real + near_by + (far - near_by) * share]
    )


def compute() -> StudyResult:
    """Error over the position, its stationary points, brute force and the engine's answer."""
    u = reach()
    shown = slice(None, None, 100)
    columns: dict[str, FloatArray] = {"u [cm]": CM_PER_METRE * u[shown]}
    verdicts = []
    for name, target in targets().items():
        least = np.inf
        for assembly, branch in ASSEMBLIES:
            error = swept(target, branch, u)
            columns[f"error; {name}; {assembly} [cm]"] = CM_PER_METRE * error[shown]
            least = min(least, float(np.nanmin(error)))
        points = stationary(target)
        columns[f"stationary u; {name} [cm]"] = CM_PER_METRE * np.array([p.u for p in points])
        columns[f"stationary error; {name} [cm]"] = CM_PER_METRE * np.array([p.error for p in points])
        best = min(points, key=lambda p: p.error)
        engine = variational_motion(
            LINKAGE,
            [radians(ROTATION)],
            [[target.real, target.imag]],
            assemblies=(1, -1),
            closed=False,
        )
        # brute force is above the least by no more than a step's share of it
        verdicts += [
            near(f"least of the candidates; {name}", OURS, CM_PER_METRE * least, CM_PER_METRE * best.error, 1e-6, "cm"),
            near(
                f"error of the variational motion; {name}",
                OURS,
                CM_PER_METRE * best.error,
                CM_PER_METRE * engine.error[0],
                1e-10,
                "cm",
            ),
            at_most(
                f"farthest candidate from the error over u; {name}",
                OURS,
                1e-10,
                max(abs(float(swept(target, p.branch, np.array([p.u]))[0]) - p.error) for p in points),
                "m",
            ),
        ]
        pointing = best.what == KINDS[0]
        expected = name == "a target of the ellipse"
        verdicts.append(at_least(f"the least is of the kind expected; {name}", OURS, 1.0, float(pointing == expected)))
    own = next(iter(targets().values()))
    fixed = LINKAGE.path([radians(ROTATION)])[0]
    at_rest = hypot(fixed[0] - own.real, fixed[1] - own.imag)
    moved = min(p.error for p in stationary(own))
    verdicts.append(at_most("error with the slider moved, of that with it held at zero", OURS, 1.0, moved / at_rest))
    return StudyResult(
        number=NUMBER,
        claim=(
            "At a crank angle the error is least with the coupler pointing at the target, or with the rocker perpendicular "
            "to the guide: (7.6)-(7.15)."
        ),
        assignment=f"{ASSIGNED} The linkage, the crank rotation of {ROTATION:g} degrees and the targets are our choice.",
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """Error over the slider position for both targets, the stationary points marked."""
    panels: list[Panel] = []
    for name, target in targets().items():
        first = not panels
        curves = [
            Curve(
                x=result.columns["u [cm]"],
                y=result.columns[f"error; {name}; {assembly} [cm]"],
                label=assembly if first else "",
                colour=colour,
            )
            for (assembly, _), colour in zip(ASSEMBLIES, COLOURS)
        ]
        points = stationary(target)
        for what, colour, marker in zip(KINDS, COLOURS[2:], "osd"):
            at = [p for p in points if p.what == what]
            curves.append(
                Curve(
                    x=[CM_PER_METRE * p.u for p in at],
                    y=[CM_PER_METRE * p.error for p in at],
                    label=what.replace("-", "\N{MINUS SIGN}") if first else "",
                    line="",
                    marker=marker,
                    colour=colour,
                )
            )
        best = min(points, key=lambda p: p.error)
        panels.append(
            Panel(
                x_label="slider position u [cm]",
                y_label="distance of P from its target [cm]",
                title=f"{name}: least {CM_PER_METRE * best.error:.3g} cm at u = {CM_PER_METRE * best.u:.1f} cm".replace(
                    "= -", "= \N{MINUS SIGN}"
                ),
                curves=curves,
                legend_at="best",
            )
        )
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 4.0))


STUDY = Study(NUMBER, compute, draw)
