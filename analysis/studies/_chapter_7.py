"""What Fig 7.3 to 7.12 share: the motions of the slider that improve the printed linkages of chapter VI.

Lengths and errors in the units of print, cm and degrees.
"""

from __future__ import annotations

from functools import cache
from math import inf, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.five_bar.published import CM_PER_METRE

from ..control import slider_motion
from ..figures import COLOURS, Curve, Panel
from ..synthesis import Linkage, SliderMotion, SliderUnknown, Solution, evaluate
from ..synthesis.published import PROBLEMS
from .study import BALANCE, StudyResult, Verdict, at_least

FloatArray = NDArray[np.float64]

ASSIGNED = (
    "The captions of the thesis's figures are lost; which quantity stands under which number is our assignment, chosen so "
    "that the figures of chapter VII together show what its text discusses."
)
#: The problems whose printed linkages the thesis improves by a moved slider.
ROCKER, PATH = "rocker-weighted", "path-b"
TARGET, FIXED = "0.25", "0.55"
#: Starts of the searches; with them every search below ends at the same best motion for other seeds too.
ROCKER_STARTS, PATH_STARTS = 24, 6
#: Crank rotations of the curves (rad).
TURN = np.linspace(0.0, 2.0 * pi, 721)


@cache
def motion(name: str, harmonics: int, *, starts: int, stroke: float = inf, seed: int = 0) -> Solution:
    """The best Fourier series of the slider for a problem of chapter VI, the links of its printed linkage kept."""
    p = PROBLEMS[name]
    unknown = SliderUnknown(harmonics=harmonics, stroke=stroke)
    return slider_motion(p.task, p.linkage, unknown, starts=starts, seed=seed).best


def slider(linkage: Linkage) -> SliderMotion:
    """The motion of its rocker pivot."""
    assert isinstance(linkage.pivot, SliderMotion)
    return linkage.pivot


def shown(name: str, solution: Solution) -> float:
    """Error of a solution in the unit of print, evaluated afresh."""
    p = PROBLEMS[name]
    return p.shown(evaluate(p.task, solution.linkage).error)


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


def motion_columns(who: str, linkage: Linkage) -> dict[str, FloatArray]:
    """Position of the slider over `TURN`, about its mean where that is far off (cm)."""
    return {f"{who} slider [cm]": CM_PER_METRE * slider(linkage).series(TURN)}


def path_columns(who: str, linkage: Linkage) -> dict[str, FloatArray]:
    """Coupler curve over `TURN` (cm)."""
    xy = CM_PER_METRE * linkage.path(TURN)
    return {f"{who} x [cm]": xy[:, 0], f"{who} y [cm]": xy[:, 1]}


def target_columns(name: str) -> dict[str, FloatArray]:
    """The points of an untimed target, closed (cm)."""
    points = CM_PER_METRE * np.asarray(PROBLEMS[name].task.path.points)  # type: ignore[union-attr]
    points = np.vstack([points, points[:1]])
    return {"target x [cm]": points[:, 0], "target y [cm]": points[:, 1]}


def sound(statement: str, *solutions: Solution) -> Verdict:
    """That none of the linkages has a circuit, branch or order defect."""
    return at_least(statement, BALANCE, 1.0, float(min(s.verdicts.sound for s in solutions)))


def over_turn(
    result: StudyResult, names: dict[str, str], y_label: str, title: str, colours: tuple[str, ...] = COLOURS
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
        x_ticks=range(0, 361, 60),
        legend_at="best",
    )


def curves_panel(result: StudyResult, names: dict[str, str], title: str) -> Panel:
    """Target and coupler curves to scale; ``names`` maps the first part of each pair of columns to its label."""
    looks = {"target": (TARGET, "--"), "fixed": (FIXED, "-")}
    others = iter(COLOURS)
    curves = []
    for name, label in names.items():
        colour, line = looks[name] if name in looks else (next(others), "-")
        x, y = (result.columns[f"{name} {axis} [cm]"] for axis in "xy")
        curves.append(Curve(x=x, y=y, label=label, colour=colour, line=line))
    return Panel(x_label="x [cm]", y_label="y [cm]", title=title, curves=curves, equal=True, legend_at="center")
