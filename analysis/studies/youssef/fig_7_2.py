"""Fig 7.2: coupler curves and the accessible area.

With two freedoms a point P of the coupler is not bound to one curve: at each slider position it draws a coupler curve over
a turn of the crank, and the family of them covers the area that P can reach, within which any path can be traced by moving
the slider while the crank turns. The thesis shows this family to introduce the synthesis of paths. Its mechanism is not in
the text; Table 3.1 with P 12 cm from the crank pin and 30 degrees off the coupler, and 4 cm of slider to each side, is our
choice. We bound the area in closed form, for either assembly, and check it against configurations drawn at random.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi, radians

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import CM_PER_METRE

from ...figures import Curve, Figure, Panel, plot_curves
from ...youssef import AccessibleArea, accessible_area, coupler_curves
from ..study import OURS, Study, StudyResult, at_most, padded
from ._runs import table_3_1

NUMBER = "7.2"

POINT_DISTANCE, POINT_ANGLE = 0.12, radians(30.0)
#: Slider positions of the curves (cm); the outer two bound the area's range.
POSITIONS = (-4, -2, 0, 2, 4)
SAMPLES = 5000
#: The two assemblies: name, branch.
ASSEMBLIES = (("upper", 1), ("lower", -1))


def mechanism(branch: int) -> FiveBarParameters:
    """Table 3.1 with the coupler point, in one of its assemblies."""
    return replace(
        table_3_1(1e6), coupler_point_distance=POINT_DISTANCE, coupler_point_angle=POINT_ANGLE, assembly_branch=branch
    )


def farthest_outside(area: AccessibleArea, parameters: FiveBarParameters, seed: int = 72) -> float:
    """Distance from the area (m) of P in the worst of many random configurations; zero where all are inside."""
    random = np.random.default_rng(seed)
    p = parameters.constants()
    angles = random.uniform(0.0, 2.0 * pi, SAMPLES)
    slides = random.uniform(POSITIONS[0], POSITIONS[-1], SAMPLES) / CM_PER_METRE
    points = np.array([kinematics.coupler_point(kinematics.position(t, u, p), p) for t, u in zip(angles, slides)])
    outside = points[~area.contains(*points.T)]
    rings = np.concatenate([*area.outer, *area.holes])
    return max((float(np.hypot(*(rings - point).T).min()) for point in outside), default=0.0)


def compute() -> StudyResult:
    """Curves and area in both assemblies."""
    columns, verdicts = {}, []
    for name, branch in ASSEMBLIES:
        parameters = mechanism(branch)
        for position, curve in zip(POSITIONS, coupler_curves(parameters, [u / CM_PER_METRE for u in POSITIONS])):
            columns[f"{name} x at u = {position} cm [cm]"] = CM_PER_METRE * curve.arcs[0].x
            columns[f"{name} y at u = {position} cm [cm]"] = CM_PER_METRE * curve.arcs[0].y
        area = accessible_area(parameters, (POSITIONS[0] / CM_PER_METRE, POSITIONS[-1] / CM_PER_METRE), tolerance=2e-5)
        for kind, rings in (("boundary", area.outer), ("hole", area.holes)):
            for number, ring in enumerate(rings, start=1):
                columns[f"{name} {kind} {number} x [cm]"] = CM_PER_METRE * ring[:, 0]
                columns[f"{name} {kind} {number} y [cm]"] = CM_PER_METRE * ring[:, 1]
        verdicts += [
            at_most(
                f"accessible area, relative error; {name} assembly, {1e4 * area.area:.2f} cm2",
                OURS,
                1e-4,
                area.error / area.area,
            ),
            at_most(
                f"farthest of {SAMPLES} random configurations outside; {name} assembly",
                OURS,
                0.02,
                CM_PER_METRE * farthest_outside(area, parameters),
                "cm",
            ),
        ]
    return StudyResult(
        number=NUMBER,
        claim="The coupler curves at fixed slider positions cover an area in which P can follow any path.",
        assignment=(
            "The mechanism and the point of the thesis's figure are lost: Table 3.1, BP = 12 cm at 30 degrees to the "
            "coupler, u from -4 to 4 cm are our choice."
        ),
        columns=padded(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The area shaded, the curves in it, one panel an assembly."""

    def points(name: str) -> NDArray[np.float64]:
        ring = np.column_stack([result.columns[f"{name} {axis} [cm]"] for axis in "xy"])
        return ring[np.isfinite(ring[:, 0])]

    panels = []
    for assembly, _ in ASSEMBLIES:
        names = [n.removesuffix(" x [cm]") for n in result.columns if n.startswith(assembly) and n.endswith(" x [cm]")]
        panels.append(
            Panel(
                x_label="x [cm]",
                y_label="y [cm]",
                title=f"{assembly} assembly",
                curves=[
                    Curve(
                        x=result.columns[f"{assembly} x at u = {u} cm [cm]"],
                        y=result.columns[f"{assembly} y at u = {u} cm [cm]"],
                        label=f"{u:+d} cm".replace("-", "\N{MINUS SIGN}") if u else "0 cm",
                    )
                    for u in POSITIONS
                ],
                legend="slider position u",
                legend_at="outside",
                filled=[[points(name) for name in names]],
                equal=True,
            )
        )
    return plot_curves(panels, title=result.heading, columns=2, size=(4.9, 3.3))


STUDY = Study(NUMBER, compute, draw)
