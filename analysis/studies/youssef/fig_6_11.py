"""Fig 6.11: the packaging machine.

The coupler point is to go round ten points and to push along those of them that lie on a straight line, y = 350 cm, within 120
degrees of the crank's rotation, with the crank shaft below the line. The printed linkage travels 175.8 cm on a part that is 7
cm from flat, and comes within 10.5 degrees of a dead position. Ours is flat to 2.5 cm over 144 cm, has less than half the area
between its curve and the ten points, and keeps 40 degrees. How flat and how long the thesis wants it is not in the text. That
this problem stands under this number is our assignment.
"""

from __future__ import annotations

from math import degrees

import numpy as np

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import Curve, Figure, Panel, plot_curves
from ...synthesis import UntimedPath, area_between, straightest_part, turn
from ...synthesis.published import (
    CM2_PER_M2,
    PACKAGING_FLATNESS,
    PACKAGING_OFFSET_CM,
    PACKAGING_ROTATION,
    PACKAGING_TRAVEL,
    PROBLEMS,
    N,
)
from ..study import OURS, Study, StudyResult, at_least, at_most, near, padded
from ._chapter_6 import (
    ASSIGNED,
    FOUND,
    PRINTED,
    TARGET,
    best,
    curve_of,
    curves_panel,
    linkages_panel,
    path_columns,
    sound_verdicts,
)

NUMBER = "6.11"
PROBLEM = "packaging"
#: Points at 5 degrees on 120 degrees of rotation.
WINDOW = round(N * PACKAGING_ROTATION / (2.0 * np.pi)) + 1


def compute() -> StudyResult:
    """Curves and linkages, with their straight parts."""
    p, ours = PROBLEMS[PROBLEM], best(PROBLEM)
    assert isinstance(p.task, UntimedPath)
    curve = p.linkage.path(turn(N))
    printed = straightest_part(curve, WINDOW, direction=0.0, least_travel=PACKAGING_TRAVEL)
    part = ours.straight()
    assert part is not None
    columns = path_columns(PROBLEM)
    parts = {
        "printed straight": p.linkage.path(turn(N)[printed.start] + np.linspace(0.0, PACKAGING_ROTATION, 97)),
        "ours straight": ours.linkage.path(np.linspace(part.begin, part.end, 97)),
    }
    for name, points in parts.items():
        columns |= {f"{name} {axis} [cm]": CM_PER_METRE * points[:, k] for k, axis in enumerate("xy")}
    return StudyResult(
        number=NUMBER,
        claim="A four-bar pushes along a straight line within 120 degrees of crank rotation and returns round ten points.",
        assignment=ASSIGNED,
        columns=padded(columns),
        verdicts=(
            near("travel of the printed linkage", OURS, 175.8, CM_PER_METRE * printed.travel, 0.05, "cm"),
            near("flatness of the printed linkage", OURS, 6.99, CM_PER_METRE * printed.flatness, 5e-3, "cm"),
            near(
                "area between the printed linkage's curve and the ten points",
                OURS,
                1444.0,
                CM2_PER_M2 * area_between(curve, p.task.path),
                0.5,
                "cm2",
            ),
            near(
                "least transmission angle of the printed linkage",
                OURS,
                10.5,
                degrees(p.linkage.least_transmission),
                0.05,
                "deg",
            ),
            at_least("travel of ours", OURS, CM_PER_METRE * PACKAGING_TRAVEL, CM_PER_METRE * part.travel, "cm"),
            at_most("flatness of ours", OURS, CM_PER_METRE * PACKAGING_FLATNESS, CM_PER_METRE * part.flatness, "cm"),
            at_most(
                "crank rotation of our straight part",
                OURS,
                degrees(PACKAGING_ROTATION) + 1e-6,
                degrees(part.rotation),
                "deg",
            ),
            at_most("area between our curve and the ten points", OURS, p.goal, p.convert(ours.error), "cm2"),
            at_most(
                "height of our crank shaft",
                OURS,
                PACKAGING_OFFSET_CM[1],
                CM_PER_METRE * ours.linkage.pivot_y,
                "cm",
            ),
            *sound_verdicts(PROBLEM),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Target and curves, the straight parts with y enlarged, and the linkages."""
    line = Curve(
        x=np.array([10.0, 164.0]) + PACKAGING_OFFSET_CM[0],
        y=np.full(2, PACKAGING_OFFSET_CM[1]),
        colour=TARGET,
        line="--",
    )
    straight = Panel(
        x_label="x [cm]",
        y_label="y [cm]",
        title="straight parts, y enlarged",
        curves=[
            line,
            curve_of(result, "printed straight", colour=PRINTED),
            curve_of(result, "ours straight", colour=FOUND),
        ],
    )
    panels = [curves_panel(result, marks=False), straight, linkages_panel(result)]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.8))


STUDY = Study(NUMBER, compute, draw)
