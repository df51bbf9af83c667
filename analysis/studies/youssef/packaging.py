"""Fig 6.11: the packaging machine.

The coupler point pushes packages along a straight line within 120 degrees of crank rotation and returns past nineteen points.
The printed linkage travels 175.5 cm along a part that is flat to 5.5 cm, and comes within 10.5 degrees of a dead position. Our
linkage is flat to 2.5 cm over 144 cm, its quality function (an area) is less than half as large, and it stays 40 degrees away
from dead positions. The text does not say how flat the part must be.
"""

from __future__ import annotations

from dataclasses import replace
from math import degrees, pi

import numpy as np

from ...figures import Curve, Figure, Panel, plot_curves
from ...synthesis import Straightness, area_difference, hausdorff, straight_parts, turn
from ...units import CM_PER_METRE
from ..rules import ALIKE
from ..statements import Statement, at_most, text
from ..study import Study, StudyResult, padded
from .chapter_6 import (
    FOUND,
    PRINTED,
    TARGET,
    FloatArray,
    best,
    curves_panel,
    linkages_panel,
    pairing_area,
    path_columns,
    shape_curve,
)
from .problems import (
    CM2_PER_M2,
    PACKAGING_OFFSET_CM,
    PACKAGING_ROTATION,
    PROBLEMS,
    N,
    packaging_path,
)

NUMBER = "6.11"
#: Travel AB between the program's points (10, 0) and (164, 0) (cm).
TRAVEL_CM = 154.0


def nineteen_points() -> FloatArray:
    """Return the nineteen desired points, shape (19, 2) in m.

    They are the ten points of the listing and the midpoints of all sides of their polygon except the side of 4 cm.
    """
    corners = packaging_path().points
    ahead = np.roll(corners, -1, axis=0)
    middles = np.where(np.hypot(*(ahead - corners).T)[:, None] > 0.05, 0.5 * (corners + ahead), np.nan)
    points = np.stack([corners, middles], axis=1).reshape(-1, 2)
    return np.asarray(points[np.isfinite(points[:, 0])])


def region(distance: float) -> dict[str, FloatArray]:
    """Return the bounds of the region that lies within a distance (m) of the desired path, as columns in cm."""
    import shapely

    polygon = shapely.Polygon(packaging_path().points)
    rings = {"outer": polygon.buffer(distance), "inner": polygon.buffer(-distance)}
    columns: dict[str, FloatArray] = {}
    for name, shape in rings.items():
        xy = CM_PER_METRE * shapely.get_coordinates(shape.exterior)
        columns |= {f"{name} bound {axis} [cm]": xy[:, k] for k, axis in enumerate("xy")}
    return columns


def straightest(curve: FloatArray) -> tuple[Straightness, int]:
    """Return the part of a curve of N points (m) with the least flatness error per length, and the number of points in it.

    The parts compared lie within 120 degrees of crank rotation and are at least as long as the travel AB, along the line.
    """
    greatest = round(N * PACKAGING_ROTATION / (2.0 * pi)) + 1
    parts = ((part, count) for count in range(2, greatest + 1) for part in straight_parts(curve, count, direction=0.0))
    long_enough = (found for found in parts if CM_PER_METRE * found[0].travel >= TRAVEL_CM)
    return min(long_enough, key=lambda found: found[0].flatness / found[0].travel)


def compute() -> StudyResult:
    """Compute the region, both linkages, the quality function of the nineteen points, and the straight part."""
    p, ours, desired = PROBLEMS["packaging"], best("packaging"), nineteen_points()
    curves = {"printed": p.linkage.path(turn(N)), "ours": ours.linkage.path(turn(N))}
    # with the window of 2 that the program has for its ten points the pairing lags behind on the long sides
    areas = {who: CM2_PER_M2 * pairing_area(desired, curve, window=3) for who, curve in curves.items()}
    reach = {who: CM_PER_METRE * hausdorff(curve, packaging_path()) for who, curve in curves.items()}
    printed, count = straightest(curves["printed"])
    other, _ = straightest(replace(p.linkage, branch=-p.linkage.branch).path(turn(N)))
    rotation = 2.0 * pi * (count - 1) / N
    part = ours.straight()
    assert part is not None
    columns = path_columns("packaging") | region(reach["ours"] / CM_PER_METRE)
    parts = {
        "nineteen points": desired,
        "printed straight": p.linkage.path(turn(N)[printed.start] + np.linspace(0.0, rotation, 97)),
        "ours straight": ours.linkage.path(np.linspace(part.begin, part.end, 97)),
    }
    for name, points in parts.items():
        columns |= {f"{name} {axis} [cm]": CM_PER_METRE * points[:, k] for k, axis in enumerate("xy")}
    line, above = PACKAGING_OFFSET_CM[1], CM_PER_METRE * p.linkage.pivot_y
    exact = CM2_PER_M2 * area_difference(curves["printed"], packaging_path())
    return StudyResult(
        number=NUMBER,
        claim=(
            "A four-bar pushes packages along a straight line within 120 degrees of crank rotation and returns within a "
            "region: nineteen desired points, 72 actual ones."
        ),
        assignment=(
            "The figure with region and points is missing in our copy. The points are our choice: the ten of the program in "
            "appendix 5 (L9021) and the middles of all sides but the one of 4 cm. The region drawn is the narrowest that our "
            "linkage keeps to."
        ),
        columns=padded(columns),
        statements=(
            Statement(
                "A packaging machine in the form of a four bar is required to generate a path which is acceptable anywhere "
                "within the region bound by the dashed lines shown in Fig. (6.11a).",
                text("6.4.3, L5097"),
                why="the figure with the bounds is missing in our copy",
            ),
            Statement(
                "The constraints are (1) the straight line travel AB should be achieved within the first 120° rotation of "
                "the crank and (2) the crank shaft should be below the line of travel of the package.",
                text("6.4.3, L5103"),
                "straightest travel of the printed linkage within 120 deg of crank rotation that is at least as long "
                f"as AB, read as the program's points (10, 0) and (164, 0), {TRAVEL_CM:g} cm apart: how far it is off "
                f"straight, its extent in y over that in x between two of {N} crank angles; height of the crank shaft",
                f"{ALIKE:g}, the rule for *straight*; [{line:g}] cm, the height of the program's line (L9022, its last digit "
                "illegible)",
                (
                    at_most(
                        f"off straight, on {CM_PER_METRE * printed.travel:.0f} cm",
                        ALIKE,
                        printed.flatness / printed.travel,
                    ),
                    at_most("height of the crank shaft", line, above, "cm"),
                ),
                f"{CM_PER_METRE * printed.flatness:.1f} cm off straight, within {degrees(rotation):.0f} deg; th20 is not "
                "printed, and any 120 deg are taken as the first; nor is the closure: by the other it would be "
                f"{other.flatness / other.travel:.2f} off straight",
            ),
            Statement(
                "Optimisation is then performed to find the optimum linkage from which 72 actual output points are "
                "calculated.",
                text("6.4.3, L5113"),
                why="the figure with the nineteen points is missing in our copy; with points of ours the printed linkage has "
                f"{areas['printed'] / areas['ours']:.2f} times the error of our linkage, whose straight travel, "
                f"{CM_PER_METRE * part.travel:.0f} cm, is less than AB; with the ten points of the program "
                f"{exact / p.convert(ours.error):.2f} times",
            ),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Draw the region, the points and the curves (a), the straight parts with y enlarged, and the linkages (b)."""
    bounds = [shape_curve(result, f"{name} bound", colour="0.55", line="--", width=0.8) for name in ("outer", "inner")]
    points = shape_curve(result, "nineteen points", label="nineteen points", colour=TARGET, line="", marker="o")
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
            curves_panel(result, points, *bounds, marks=False),
            title="(a) region dashed, our choice",
            # room above the curves for the legend
            y_range=(330.0, 490.0),
            legend_at="upper right",
        ),
        straight,
        replace(linkages_panel(result), title="(b) linkages to scale, ground dotted"),
    ]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.8))


#: The study by its number.
STUDIES = {NUMBER: Study(NUMBER, compute, draw)}
