"""What Fig 6.4 to 6.11 share: the printed linkage of a problem and ours, side by side.

Lengths and errors in the units of print, cm and degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import degrees, inf, pi

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.published import CM_PER_METRE

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...synthesis import (
    LINKS,
    LargestLink,
    Linkage,
    RockerFunction,
    Search,
    Solution,
    evaluate,
    normal_form,
    synthesize,
    trade_off,
    turn,
)
from ...synthesis.published import PROBLEMS
from ..study import OURS, TEXT, StudyResult, Verdict, at_least, at_most, near, padded

FloatArray = NDArray[np.float64]

ASSIGNED = (
    "The captions of the thesis's figures are lost; which of its problems stands under which number is our assignment."
)
#: Least transmission angle that is asked of our linkages (deg).
TRANSMISSION = 40.0
#: A small search does: nearly every start of these problems ends at the same optimum.
STARTS, CANDIDATES = 4, 1 << 14
#: Colours of target, printed and our linkage.
TARGET, PRINTED, FOUND = "0.25", COLOURS[1], COLOURS[0]
COLOURED = (PRINTED, FOUND, COLOURS[2])
#: Least transmission angles of the trade-off (deg).
ANGLES = (0.0, 20.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0)


@cache
def best(name: str) -> Solution:
    """Our best linkage for a problem of chapter VI."""
    p = PROBLEMS[name]
    return synthesize(p.task, p.bounds, p.constraints, search=Search(starts=STARTS, candidates=CANDIDATES)).best


def error_verdicts(name: str, stated: float, tolerance: float, reference: float, digits: float) -> tuple[Verdict, ...]:
    """The printed linkage's error as the thesis states it and as it is, and ours against the goal.

    Parameters
    ----------
    name : str
        Problem.
    stated, tolerance : float
        By the thesis, and half its last digit.
    reference, digits : float
        The printed linkage's true error, and half the last digit of it.
    """
    p = PROBLEMS[name]
    printed, found = p.convert(evaluate(p.task, p.linkage).error), p.convert(best(name).error)
    return (
        near("error of the printed linkage", TEXT, stated, printed, tolerance, p.unit),
        near("error of the printed linkage", OURS, reference, printed, digits, p.unit),
        at_most("error of our linkage", OURS, p.goal, found, p.unit),
    )


def sound_verdicts(name: str) -> tuple[Verdict, ...]:
    """Our linkage has the transmission angle and the lengths that are asked, and no defect."""
    p, ours = PROBLEMS[name], best(name)
    caps = [c.length for c in p.constraints if isinstance(c, LargestLink)]
    largest = min(caps, default=max((p.bounds[link][1] for link in LINKS if link in p.bounds), default=inf))
    v = ours.verdicts
    return (
        at_least(
            "least transmission angle of our linkage",
            OURS,
            TRANSMISSION - 1e-3,
            degrees(ours.linkage.least_transmission),
            "deg",
        ),
        at_most(
            "longest link of our linkage",
            OURS,
            CM_PER_METRE * largest * (1.0 + 1e-6),
            CM_PER_METRE * ours.linkage.largest_link,
            "cm",
        ),
        at_most(
            "circuit, branch and order defects of our linkage", OURS, 0, [v.circuit, v.branch, v.order].count(False)
        ),
    )


def outline(linkage: Linkage) -> dict[str, FloatArray]:
    """Links at the start of the motion (cm): the line A B P C B, on to C and D, and the ground A D; shape (n, 2)."""
    at = {name: CM_PER_METRE * np.array(place) for name, place in linkage.pins(0.0).items()}
    return {
        "links": np.array([at[name] for name in "ABPCBCD"]),
        "ground": np.array([at["A"], at["D"]]),
    }


def path_columns(name: str) -> dict[str, FloatArray]:
    """Target, both coupler curves and both linkages: x and y in cm."""
    p = PROBLEMS[name]
    normal = normal_form(p.task)
    assert normal.points is not None
    stations = normal.origin + normal.unit * normal.points
    shapes = {"target": CM_PER_METRE * np.column_stack([stations.real, stations.imag])}
    rotation = np.linspace(0.0, 2.0 * pi, 361)
    for who, linkage in (("printed", p.linkage), ("ours", best(name).linkage)):
        shapes[f"{who} curve"] = CM_PER_METRE * linkage.path(rotation)
        shapes |= {f"{who} {part}": line for part, line in outline(linkage).items()}
    return {f"{shape} {axis} [cm]": xy[:, k] for shape, xy in shapes.items() for k, axis in enumerate("xy")}


def curve_of(result: StudyResult, shape: str, **look: str | float | None) -> Curve:
    """A shape of `path_columns` as a curve."""
    return Curve(x=result.columns[f"{shape} x [cm]"], y=result.columns[f"{shape} y [cm]"], **look)  # type: ignore[arg-type]


def curves_panel(result: StudyResult, *, marks: bool) -> Panel:
    """Target and coupler curves; the target's points as marks, or as a wide line under the curves."""
    x, y = (result.columns[f"target {axis} [cm]"] for axis in "xy")
    x, y = (np.append(v[np.isfinite(v)], v[0]) for v in (x, y))
    target = (
        Curve(x=x, y=y, label="target", colour=TARGET, line="", marker=".")
        if marks
        else Curve(x=x, y=y, label="target", colour="0.8", width=5.0)
    )
    return Panel(
        x_label="x [cm]",
        y_label="y [cm]",
        title="coupler curves",
        curves=[
            target,
            curve_of(result, "printed curve", label="printed linkage", colour=PRINTED),
            curve_of(result, "ours curve", label="our linkage", colour=FOUND),
        ],
        equal=True,
        legend_at="center",
    )


def linkages_panel(result: StudyResult) -> Panel:
    """Both linkages to scale, in the colours of `curves_panel`."""
    curves = []
    for who, colour in (("printed", PRINTED), ("ours", FOUND)):
        curves += [
            curve_of(result, f"{who} links", colour=colour, marker=".", width=1.6),
            curve_of(result, f"{who} ground", colour=colour, line=":", width=1.2),
            curve_of(result, f"{who} curve", colour=colour, width=0.9),
        ]
    return Panel(
        x_label="x [cm]", y_label="y [cm]", title="linkages to scale, ground dotted", curves=curves, equal=True
    )


def distance_columns(name: str) -> dict[str, FloatArray]:
    """Distance of the target's points from the coupler point at their time, or from the curve of an untimed one."""
    p = PROBLEMS[name]
    found: Mapping[str, FloatArray] = {
        "printed": evaluate(p.task, p.linkage).errors,
        "ours": best(name).evaluation.errors,
    }
    return {"place on the target [deg]": np.degrees(turn(len(found["ours"])))} | {
        f"{who} distance [cm]": CM_PER_METRE * distance for who, distance in found.items()
    }


def distance_panel(result: StudyResult, *, timed: bool) -> Panel:
    """The distances, on a logarithmic scale, in the colours of `curves_panel`."""
    return Panel(
        x_label="crank rotation [deg]" if timed else "ωt of the ellipse [deg]",
        y_label="distance from the target [cm]",
        title="error over a turn" if timed else "error round the target",
        curves=[
            Curve(
                x=result.columns["place on the target [deg]"], y=result.columns[f"{who} distance [cm]"], colour=colour
            )
            for who, colour in (("printed", PRINTED), ("ours", FOUND))
        ],
        logarithmic="y",
        y_range=None if timed else (1e-4, 1.0),
        x_ticks=range(0, 361, 90),
    )


def ellipse_result(
    number: str,
    name: str,
    claim: str,
    stated: tuple[float, float],
    reference: tuple[float, float],
    more: tuple[Verdict, ...] = (),
) -> StudyResult:
    """A problem of an ellipse: curves, linkages and distances of the printed linkage and ours.

    Parameters
    ----------
    number, name : str
        Of the figure and of the problem.
    claim : str
    stated, reference : (float, float)
        Error as printed, and as the printed linkage evaluates, each with its tolerance (cm2).
    more : tuple of Verdict
        Between those on the errors and those on our linkage.
    """
    return StudyResult(
        number=number,
        claim=claim,
        assignment=ASSIGNED,
        columns=padded(path_columns(name) | distance_columns(name)),
        verdicts=(*error_verdicts(name, *stated, *reference), *more, *sound_verdicts(name)),
    )


def draw_timed(result: StudyResult) -> Figure:
    """The target and both curves, their distances over the crank's rotation, and the linkages."""
    return _draw(result, timed=True)


def draw_untimed(result: StudyResult) -> Figure:
    """The target and both curves, their distances round the target, and the linkages."""
    return _draw(result, timed=False)


def _draw(result: StudyResult, *, timed: bool) -> Figure:
    panels = [curves_panel(result, marks=timed), distance_panel(result, timed=timed), linkages_panel(result)]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.6))


# Rocker functions


def angle_columns(linkages: Mapping[str, Linkage]) -> dict[str, FloatArray]:
    """Target, and rocker angles of linkages by name with their errors, over a turn (deg)."""
    phi = np.linspace(0.0, 2.0 * pi, 361)
    target = 70.0 + 100.0 * np.abs(np.sin(0.5 * phi))
    columns = {"crank rotation [deg]": np.degrees(phi), "target angle [deg]": target}
    for who, linkage in linkages.items():
        angle = np.degrees(linkage.rocker_angle(phi))
        # into the turn that the target is in
        angle -= 360.0 * np.round(np.mean(angle - target) / 360.0)
        columns[f"{who} angle [deg]"], columns[f"{who} error [deg]"] = angle, angle - target
    return columns


def trade_off_columns(name: str, tasks: Mapping[str, RockerFunction]) -> dict[str, FloatArray]:
    """Least error of tasks by name over the least transmission angle, in the unit of print; NaN where no linkage was found."""
    p = PROBLEMS[name]
    columns = {"least transmission angle [deg]": np.array(ANGLES)}
    for who, task in tasks.items():
        found = trade_off(task, "transmission", np.radians(ANGLES), constraints=p.constraints, search=Search(starts=3))
        columns[f"{who} least error [{p.unit}]"] = p.per_si * np.asarray(found.error.filled(np.nan))
    return columns


def rocker_panels(result: StudyResult, name: str, labels: Mapping[str, str], tasks: Mapping[str, str]) -> list[Panel]:
    """Angles, errors, and the trade-off: ``labels`` of linkages, ``tasks`` those of the trade-off, by name."""
    unit = PROBLEMS[name].unit
    rotation = result.columns["crank rotation [deg]"]
    look = dict(zip(labels, COLOURED))

    def curves(what: str) -> list[Curve]:
        return [
            Curve(x=rotation, y=result.columns[f"{who} {what} [deg]"], label=label, colour=look[who])
            for who, label in labels.items()
        ]

    target = Curve(x=rotation, y=result.columns["target angle [deg]"], label="target", colour=TARGET, line="--")
    ticks = range(0, 361, 60)
    return [
        Panel(
            x_label="crank rotation [deg]",
            y_label="rocker angle [deg]",
            title="rocker angle",
            curves=[target, *curves("angle")],
            x_ticks=ticks,
            legend_at="lower center",
        ),
        Panel(
            x_label="crank rotation [deg]",
            y_label="rocker angle less target [deg]",
            title="error over a turn",
            curves=curves("error"),
            x_ticks=ticks,
        ),
        Panel(
            x_label="least transmission angle [deg]",
            y_label=f"least error [{unit}]",
            title="error against transmission angle",
            curves=[
                Curve(
                    x=result.columns["least transmission angle [deg]"],
                    y=result.columns[f"{who} least error [{unit}]"],
                    label=label,
                    colour=colour,
                    marker=".",
                )
                for (who, label), colour in zip(tasks.items(), COLOURED[1:])
            ],
            logarithmic="y",
        ),
    ]
