"""Fig 6.11: the packaging machine.

The coupler point pushes packages along a straight line within 120 degrees of crank rotation and returns past nineteen points.
The text does not say how flat the straight part must be.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import NamedTuple

import numpy as np

from ...figures import Curve, Figure, Panel, plot_curves
from ...synthesis import straightness, turn
from ...units import CM_PER_METRE
from ..rules import ALIKE
from ..statements import FloatArray, at_most, statement
from ..study import Study, StudyResult, pad_columns
from .chapter_6 import FOUND, PRINTED, TARGET, best, curves_panel, linkages_panel, path_columns, shape_curve
from .problems import PACKAGING_OFFSET_CM, PACKAGING_ROTATION, PROBLEMS, N

#: Travel AB between the program's points (10, 0) and (164, 0) (cm).
TRAVEL_CM = 154.0


class Part(NamedTuple):
    """A part of a curve: travel and flatness along the x axis (m), index of its first point, and number of steps."""

    travel: float
    flatness: float
    start: int
    steps: int


def straightest(curve: FloatArray) -> Part:
    """Return the part of a closed curve of N points (m) with the least flatness error per length.

    The parts compared lie within 120 degrees of crank rotation and are at least as long as the travel AB, along the line.
    """
    greatest = round(N * PACKAGING_ROTATION / (2.0 * pi)) + 1
    laid = np.vstack([curve, curve[:greatest]])
    parts = (
        Part(*straightness(laid[start : start + count], 0.0), start, count - 1)
        for count in range(2, greatest + 1)
        for start in range(len(curve))
    )
    return min((part for part in parts if CM_PER_METRE * part.travel >= TRAVEL_CM), key=lambda p: p.flatness / p.travel)


def compute() -> StudyResult:
    """Compute the curves and the straight parts of both linkages, and judge the statements."""
    p, ours = PROBLEMS["packaging"], best("packaging")
    printed = straightest(p.linkage.path(turn(N)))
    rotation = 2.0 * pi * printed.steps / N
    part = ours.straight()
    assert part is not None
    columns = path_columns("packaging")
    parts = {
        "printed straight": p.linkage.path(turn(N)[printed.start] + np.linspace(0.0, rotation, 97)),
        "ours straight": ours.linkage.path(np.linspace(part.begin, part.end, 97)),
    }
    for name, points in parts.items():
        columns |= {f"{name} {axis} [cm]": CM_PER_METRE * points[:, k] for k, axis in enumerate("xy")}
    line, above = PACKAGING_OFFSET_CM[1], CM_PER_METRE * p.linkage.pivot_y
    return StudyResult(
        claim="A four-bar pushes packages along a straight line within 120 degrees of crank rotation and returns within a "
        "region: nineteen desired points, 72 actual ones.",
        assignment="The figure with region and points is missing in our copy. The target in the plot is the polygon of the ten "
        "points of the program (L9021).",
        columns=pad_columns(columns),
        statements=(
            statement(
                "A packaging machine in the form of a four bar is required to generate a path which is acceptable anywhere "
                "within the region bound by the dashed lines shown in Fig. (6.11a).",
                "6.4.3, L5097",
                why="the figure with the bounds is missing in our copy",
            ),
            statement(
                "The constraints are (1) the straight line travel AB should be achieved within the first 120° rotation of "
                "the crank and (2) the crank shaft should be below the line of travel of the package.",
                "6.4.3, L5103",
                "extent in y divided by extent in x, for the straightest travel of the printed linkage that is at least as "
                f"long as AB, {TRAVEL_CM:g} cm between the program's points, and lies within 120 deg of crank rotation, in "
                "steps of 5 deg. Then the height of the crank shaft",
                f"{ALIKE:g}, the rule for *straight*; [{line:g}] cm, the height of the program's line (L9022, its last digit "
                "illegible)",
                at_most(
                    f"extent in y over extent in x, {CM_PER_METRE * printed.travel:.0f} cm",
                    ALIKE,
                    printed.flatness / printed.travel,
                ),
                at_most("height of the crank shaft", line, above, "cm"),
                why="theta20 is not printed, so that any 120 deg count as the first. Of the two closures we take the better, "
                "see L4804",
            ),
            statement(
                "Optimisation is then performed to find the optimum linkage from which 72 actual output points are calculated.",
                "6.4.3, L5113",
                why="the figure with the nineteen points is missing in our copy",
            ),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Draw the curves (a), the straight parts with y enlarged, and the linkages (b)."""
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
            shape_curve(result, "printed straight", colour=PRINTED),
            shape_curve(result, "ours straight", colour=FOUND),
        ],
    )
    panels = [
        replace(
            curves_panel(result, marks=False),
            title="(a) coupler curves",
            # room above the curves for the legend
            y_range=(330.0, 490.0),
            legend_at="upper right",
        ),
        straight,
        replace(linkages_panel(result), title="(b) linkages to scale, ground dotted"),
    ]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.8))


#: The study by its number.
STUDIES = {"6.11": Study(compute, draw)}
