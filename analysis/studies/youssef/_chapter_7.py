"""What Fig 7.3 to 7.12 share: the motions of the slider that improve the printed linkages of chapter VI.

Lengths and errors in the units of print, cm and degrees.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Panel
from ...motion import slider_motion
from ...synthesis import Linkage, Search, SliderMotion, SliderUnknown, Solution, UntimedPath, evaluate, turn
from ...synthesis.published import PROBLEMS
from ..study import OURS, StudyResult, Verdict, at_least, padded

FloatArray = NDArray[np.float64]

ASSIGNED = (
    "The captions of the thesis's figures are lost; which quantity stands under which number is our assignment, chosen so "
    "that the figures of chapter VII together show what its text discusses."
)
#: The problems whose printed linkages the thesis improves by a moved slider.
ROCKER, PATH = "rocker-weighted", "path-b"
TARGET, FIXED = "0.25", "0.55"
#: Starts of the searches: of the rocker function's, and by its harmonics of the path's, with the stroke that it may use (m).
ROCKER_STARTS = 24
PATH_SEARCHES = {2: (8, 0.25), 3: (8, 0.25), 5: (24, 0.18)}
#: Crank rotations of the curves (rad).
TURN = np.linspace(0.0, 2.0 * pi, 721)


@cache
def rocker_motion(harmonics: int) -> Solution:
    """The best Fourier series of the slider for the weighted rocker function, the printed links kept."""
    p = PROBLEMS[ROCKER]
    return slider_motion(
        p.task, p.linkage, SliderUnknown(harmonics=harmonics), search=Search(starts=ROCKER_STARTS)
    ).best


@cache
def path_motion(harmonics: int) -> Solution:
    """The best Fourier series of the slider for path (b), the printed links kept.

    The guide within a right angle from the ground link, and a bound of the stroke: among so many optima they bring the search
    to the better ones.
    """
    p = PROBLEMS[PATH]
    starts, stroke = PATH_SEARCHES[harmonics]
    unknown = SliderUnknown(harmonics=harmonics, guide_angle=(0.0, 0.5 * pi), stroke=stroke)
    return slider_motion(p.task, p.linkage, unknown, search=Search(starts=starts)).best


def slider(linkage: Linkage) -> SliderMotion:
    """The motion of its rocker pivot."""
    assert isinstance(linkage.pivot, SliderMotion)
    return linkage.pivot


def shown(name: str, solution: Solution) -> float:
    """Error of a solution in the unit of print, evaluated afresh."""
    p = PROBLEMS[name]
    return p.convert(evaluate(p.task, solution.linkage).error)


def wanted_angle(phi: ArrayLike) -> FloatArray:
    """The rocker function that is asked (deg) at crank rotations (rad)."""
    return np.asarray(70.0 + 100.0 * np.abs(np.sin(0.5 * np.asarray(phi))))


def angle_error(linkage: Linkage, phi: FloatArray) -> FloatArray:
    """Rocker angle less the one that is asked (deg), within half a turn."""
    return np.asarray((np.degrees(linkage.rocker_angle(phi)) - wanted_angle(phi) + 180.0) % 360.0 - 180.0)


def window() -> FloatArray:
    """Crank rotations (deg) between which the error of the rocker function counts a thousandfold."""
    task = PROBLEMS[ROCKER].task
    heavy = np.degrees(np.asarray(task.rotation)[np.asarray(task.weights) > 1.0])  # type: ignore[union-attr]
    return np.array([heavy.min(), heavy.max()])


def path_columns(linkages: Mapping[str, Linkage]) -> dict[str, FloatArray]:
    """Path (b) and what linkages, by name, make of it: coupler curves, distances from the target, positions of the slider."""
    task = PROBLEMS[PATH].task
    assert isinstance(task, UntimedPath)
    points = np.asarray(task.path.points)
    columns = {
        "crank rotation [deg]": np.degrees(TURN),
        "target x [cm]": CM_PER_METRE * np.append(points[:, 0], points[0, 0]),
        "target y [cm]": CM_PER_METRE * np.append(points[:, 1], points[0, 1]),
        "place on the ellipse [deg]": np.degrees(turn(len(points))),
    }
    for name, linkage in linkages.items():
        xy = CM_PER_METRE * linkage.path(TURN)
        columns |= {f"{name} x [cm]": xy[:, 0], f"{name} y [cm]": xy[:, 1]}
        columns[f"{name} distance [cm]"] = CM_PER_METRE * evaluate(task, linkage).errors
        if linkage.pivot is not None:
            columns[f"{name} slider [cm]"] = CM_PER_METRE * slider(linkage).series(TURN)
    return padded(columns)


def path_panels(result: StudyResult, names: Mapping[str, str]) -> list[Panel]:
    """What `path_columns` holds of some linkages, in three panels; ``names`` maps each to its label."""
    c = result.columns
    colours = dict(zip(names, (FIXED, *COLOURS)))
    curves, distances, sliders = (
        [Curve(x=c["target x [cm]"], y=c["target y [cm]"], label="target", colour=TARGET, line="--")],
        [],
        [],
    )
    for name, label in names.items():
        colour = colours[name]
        curves.append(Curve(x=c[f"{name} x [cm]"], y=c[f"{name} y [cm]"], label=label, colour=colour))
        place, distance = c["place on the ellipse [deg]"], c[f"{name} distance [cm]"]
        distances.append(Curve(x=place, y=distance, label=label, colour=colour))
        if f"{name} slider [cm]" in c:
            # the mean is a matter of where the guide's zero is
            u = c[f"{name} slider [cm]"]
            sliders.append(Curve(x=c["crank rotation [deg]"], y=u - np.nanmean(u[:-1]), label=label, colour=colour))
    ticks = range(0, 361, 60)
    return [
        Panel(x_label="x [cm]", y_label="y [cm]", curves=curves, equal=True, legend_at="outside"),
        Panel(
            x_label="place on the ellipse, its parameter [deg]",
            y_label="distance from the curve [cm]",
            curves=distances,
            x_ticks=ticks,
            legend_at="outside",
        ),
        Panel(
            x_label="crank rotation [deg]",
            y_label="slider from its mean [cm]",
            curves=sliders,
            x_ticks=ticks,
            legend_at="outside",
        ),
    ]


def sound(statement: str, *solutions: Solution) -> Verdict:
    """That none of the linkages has a circuit, branch or order defect."""
    return at_least(statement, OURS, 1.0, float(min(s.verdicts.sound for s in solutions)))


def over_turn(
    result: StudyResult,
    names: Mapping[str, str],
    y_label: str,
    *,
    title: str = "",
    colours: Sequence[str] = COLOURS,
    verticals: Mapping[str, float] | None = None,
) -> Panel:
    """Columns over the crank's rotation; ``names`` maps each to its label."""
    return Panel(
        x_label="crank rotation [deg]",
        y_label=y_label,
        title=title,
        curves=[
            Curve(x=result.columns["crank rotation [deg]"], y=result.columns[name], label=label, colour=colour)
            for (name, label), colour in zip(names.items(), colours)
        ],
        verticals=verticals,
        x_ticks=range(0, 361, 60),
        legend_at="outside",
    )
