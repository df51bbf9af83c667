"""The figures of chapter VI: four-bars for an ellipse and for a rocker function, as printed and ours.

The thesis prints a linkage and its error for each problem. Evaluated as they stand in print they mostly have another error,
three of them only once a misprint is mended, and under the same limits there are far better ones: the thesis's downhill
simplex did not find the optimum. Without a limit of the links the error of the ellipses goes to zero as they grow, so ours
are no longer than the longest printed one. Lengths and errors are in the units of print, cm and degrees. Fig 6.11 is in
`analysis.studies.youssef.packaging`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from itertools import product
from math import degrees, inf, pi, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...synthesis import (
    LINKS,
    LargestLink,
    Linkage,
    RockerFunction,
    Search,
    Solution,
    UntimedPath,
    evaluate,
    normal_form,
    synthesize,
    trade_off,
    turn,
)
from ...units import CM_PER_METRE
from ..study import OURS, Study, StudyResult, Verdict, at_least, at_most, near, padded, text
from .problems import DEG2_PER_RAD2, PROBLEMS, N, rocker_function

FloatArray = NDArray[np.float64]

#: Least transmission angle of our linkages (deg).
TRANSMISSION = 40.0
#: A small search is enough: nearly every start of these problems ends at the same optimum.
SEARCH = Search(starts=4, candidates=1 << 14)
#: Colours of target, printed and our linkage.
TARGET, PRINTED, FOUND = "0.25", COLOURS[1], COLOURS[0]
COLOURED = (PRINTED, FOUND, COLOURS[2])
#: Least transmission angles of the trade-off (deg).
ANGLES = (0.0, 20.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0)


class Printed(NamedTuple):
    """Problem of the thesis: name, claim and place, and the error of the printed linkage.

    Both errors come with half a unit of their last digit, in the unit of print: ``stated`` as printed, ``reference`` as the
    printed linkage evaluates. ``reading`` tells how an illegible place is read.
    """

    problem: str
    claim: str
    place: str
    stated: tuple[float, float]
    reference: tuple[float, float]
    why: str = ""
    reading: str = ""


TABLE = {
    "6.4": Printed(
        "ellipse-a",
        "A four-bar traces ellipse (a) at 72 crank angles with a sum of squared distances of 0.889 cm2.",
        "6.4.2 A, L4870",
        (0.889, 5e-4),
        (5.64, 5e-3),
        "4.86 to 6.54 over the rounding of its digits",
    ),
    "6.5": Printed(
        "ellipse-b",
        "A four-bar traces ellipse (b) at 72 crank angles with a sum of squared distances of 4.001 cm2.",
        "6.4.2 A, L4874",
        (4.001, 5e-4),
        (9.15, 5e-3),
    ),
    "6.6": Printed(
        "ellipse-a-bounded",
        "With bounds on its lengths a four-bar traces ellipse (a) with a sum of squared distances of 53.6 cm2.",
        "6.4.2 A, L4931",
        (53.6, 0.05),
        (30.4, 0.05),
        "with a1 = -93.8 deg, printed without its sign",
        'The scan has "10 2" for the bound of the crank (L4917): read as l2 < 10 cm.',
    ),
    "6.7": Printed(
        "rocker",
        "A four-bar makes the rocker function with a sum of squared errors of 700 deg2.",
        "6.4.2 B, L4969",
        (700.0, 0.5),
        (1059.9, 0.05),
        "at 72 crank angles, 721.2 at 48; their number is not stated",
    ),
    "6.8": Printed(
        "rocker-weighted",
        "Weighted by 1000 from 60 to 260 degrees the rocker function is made with an error of 35.0 deg2.",
        "6.4.2 B, L4969",
        (35.0, 0.05),
        (35.8, 0.05),
        "at 24 crank angles, divided by the weight",
    ),
    "6.9": Printed(
        "path-a",
        "A four-bar traces path (a), whatever its timing, with an area of 2.3 cm2 between the curves.",
        "6.4.3, L5053",
        (2.3, 0.05),
        (3.11, 5e-3),
        "with X0 = 15.485 cm, printed as 154.85",
    ),
    "6.10": Printed(
        "path-b",
        "A four-bar traces path (b), whatever its timing, with an area of 12.6 cm2 between the curves.",
        "6.4.3, L5053",
        (12.6, 0.05),
        (12.61, 5e-3),
        "with l4 = 184.443 cm, printed as 183.443",
    ),
}


@cache
def best(name: str) -> Solution:
    """Return our best linkage for a problem of chapter VI."""
    p = PROBLEMS[name]
    return synthesize(p.task, p.bounds, p.constraints, search=SEARCH).best


def printed_error(name: str) -> float:
    """Return the error of the printed linkage (unit of print)."""
    p = PROBLEMS[name]
    return p.convert(evaluate(p.task, p.linkage).error)


def our_error(name: str) -> float:
    """Return the error of our linkage (unit of print)."""
    return PROBLEMS[name].convert(best(name).error)


def error_verdicts(row: Printed) -> tuple[Verdict, ...]:
    """Judge the printed linkage's error as stated and as evaluated, and ours against the goal."""
    p, printed = PROBLEMS[row.problem], printed_error(row.problem)
    (stated, half), (reference, digits) = row.stated, row.reference
    return (
        near("error of the printed linkage", text(row.place), stated, printed, half, p.unit, why=row.why),
        near("error of the printed linkage", OURS, reference, printed, digits, p.unit),
        at_most("error of our linkage", OURS, p.goal, our_error(row.problem), p.unit),
    )


def sound_verdicts(name: str) -> tuple[Verdict, ...]:
    """Judge whether our linkage has the required transmission angle and lengths, and no defect."""
    p, ours = PROBLEMS[name], best(name)
    caps = [c.length for c in p.constraints if isinstance(c, LargestLink)]
    largest = min(caps, default=max((p.bounds[link][1] for link in LINKS if link in p.bounds), default=inf))
    links = CM_PER_METRE * ours.linkage.largest_link
    angle, v = degrees(ours.linkage.least_transmission), ours.verdicts
    defects = [v.circuit, v.branch, v.order].count(False)
    return (
        at_least("least transmission angle of our linkage", OURS, TRANSMISSION - 1e-3, angle, "deg"),
        at_most("longest link of our linkage", OURS, CM_PER_METRE * largest * (1.0 + 1e-6), links, "cm"),
        at_most("circuit, branch and order defects of our linkage", OURS, 0, defects),
    )


# Statements on single figures besides the error


def rounding_verdicts() -> tuple[Verdict, ...]:
    """Judge the range of the error of Fig 6.4 when the printed digits are rounded up or down."""
    p = PROBLEMS["ellipse-a"]
    half = np.array([0.005 / CM_PER_METRE] * 7 + [radians(0.005)] * 3)
    corners = (np.array(signs) for signs in product((-1.0, 1.0), repeat=len(half)))
    # the extremes of a nearly linear change are at the corners
    errors = [evaluate(p.task, Linkage.from_vector(p.linkage.vector + half * c, 1)).error for c in corners]
    least, greatest = p.convert(min(errors)), p.convert(max(errors))
    return (
        near("the printed one's, least over the rounding of its digits", OURS, 4.86, least, 5e-3, "cm2"),
        near("the printed one's, greatest over the rounding of its digits", OURS, 6.54, greatest, 5e-3, "cm2"),
    )


def harder_verdicts(harder: str, easier: str, place: str) -> tuple[Verdict, ...]:
    """Judge whether the longer ellipse has the larger least error."""
    ratio = our_error(harder) / our_error(easier)
    return (at_least("least error that we find, of that of ellipse (a)", text(place), 1.0, ratio),)


def bounded_verdicts() -> tuple[Verdict, ...]:
    """Judge the bounds of Fig 6.6 and the error that they add."""
    p = PROBLEMS["ellipse-a-bounded"]
    outside = sum(not low <= p.linkage.values()[name] <= high for name, (low, high) in p.bounds.items())
    cost = printed_error("ellipse-a-bounded") - printed_error("ellipse-a")
    return (
        near("lengths of the printed linkage out of their bounds", text("6.4.2 A, L4911"), 0, outside, 0),
        near("increase of the error by the bounds", text("6.4.2 A, L4935"), 52.7, cost, 0.05, "cm2"),
    )


def fewer_verdicts(n: int = 48) -> tuple[Verdict, ...]:
    """Judge Fig 6.7 at another number of crank angles that its printed error may refer to."""
    p, fewer = PROBLEMS["rocker"], rocker_function(n)
    printed = p.convert(evaluate(fewer, p.linkage).error)
    found = synthesize(fewer, p.bounds, p.constraints, search=Search(starts=4, candidates=1 << 13)).best.error
    return (
        near(f"error of the printed linkage; N = {n}", OURS, 721.0, printed, 0.5, p.unit),
        at_most(f"error of our linkage; N = {n}", OURS, 695.85, p.convert(found), p.unit),
    )


def triangle_verdicts(name: str) -> tuple[Verdict, ...]:
    """Judge that the program's triangles give the area between curves of 360 points and explain no difference."""
    p = PROBLEMS[name]
    assert isinstance(p.task, UntimedPath)
    target = np.asarray(p.task.path.points)
    area = p.convert(pairing_area(target, p.linkage.path(turn(len(target))), window=3))
    return (near("area by the program's triangles, of the area itself", OURS, 1.0, area / printed_error(name), 2e-3),)


# Paths


def pairing_area(desired: FloatArray, actual: FloatArray, *, window: float) -> float:
    """Return the thesis's quality function of path generation (section 6.4.1, listing at L9797), in the unit's square.

    Each desired point is paired with an actual one: the first with the nearest of all, each next one with the nearest of
    those from its predecessor's partner on, as many as ``window`` times the actual points for each desired one. The area is
    that of the two triangles between each two successive pairs, added up; the lesser of the two senses of rotation counts.
    """
    span = int(window * len(actual) / len(desired))
    areas = []
    for way in (actual, actual[::-1]):
        curve = np.roll(way, -int(np.argmin(np.hypot(*(way - desired[0]).T))), axis=0)
        partner = [0]
        for point in desired[1:]:
            ahead = curve[partner[-1] : partner[-1] + span + 1]
            partner.append(partner[-1] + int(np.argmin(np.hypot(*(ahead - point).T))))
        d, a = (np.vstack([points, points[:1]]) @ np.array([1.0, 1j]) for points in (desired, curve[partner]))
        triangles = ((a[:-1] - d[:-1], a[1:] - d[:-1]), (d[1:] - d[:-1], a[1:] - d[:-1]))
        areas.append(sum(0.5 * float(np.abs((p.conj() * q).imag).sum()) for p, q in triangles))
    return min(areas)


def path_columns(name: str) -> dict[str, FloatArray]:
    """Return target, coupler curves, linkages with their ground links, and distances from the target (cm)."""
    p = PROBLEMS[name]
    stations = normal_form(p.task).places
    shapes = {"target": CM_PER_METRE * np.column_stack([stations.real, stations.imag])}
    distances: dict[str, FloatArray] = {}
    for who, linkage in (("printed", p.linkage), ("ours", best(name).linkage)):
        at = {pin: CM_PER_METRE * np.array(place) for pin, place in linkage.pins(0.0).items()}
        shapes |= {
            f"{who} curve": CM_PER_METRE * linkage.path(np.linspace(0.0, 2.0 * pi, 361)),
            f"{who} links": np.array([at[pin] for pin in "ABPCBCD"]),
            f"{who} ground": np.array([at["A"], at["D"]]),
        }
        distances[f"{who} distance [cm]"] = CM_PER_METRE * evaluate(p.task, linkage).errors
    columns = {f"{shape} {axis} [cm]": xy[:, k] for shape, xy in shapes.items() for k, axis in enumerate("xy")}
    stations_deg = np.degrees(turn(len(distances["ours distance [cm]"])))
    return columns | {"place on the target [deg]": stations_deg} | distances


def curve_of(result: StudyResult, shape: str, **look: str | float | None) -> Curve:
    """Return a shape of `path_columns` as a curve."""
    return Curve(x=result.columns[f"{shape} x [cm]"], y=result.columns[f"{shape} y [cm]"], **look)  # type: ignore[arg-type]


def curves_panel(result: StudyResult, *more: Curve, marks: bool) -> Panel:
    """Build the panel of target and coupler curves; the target is drawn as marks or as a wide line."""
    x, y = (result.columns[f"target {axis} [cm]"] for axis in "xy")
    x, y = (np.append(v[np.isfinite(v)], v[0]) for v in (x, y))
    look = {"colour": TARGET, "line": "", "marker": "."} if marks else {"colour": "0.8", "width": 5.0}
    return Panel(
        x_label="x [cm]",
        y_label="y [cm]",
        title="coupler curves",
        curves=[
            Curve(x=x, y=y, label="target", **look),
            curve_of(result, "printed curve", label="printed linkage", colour=PRINTED),
            curve_of(result, "ours curve", label="our linkage", colour=FOUND),
            *more,
        ],
        equal=True,
        legend_at="center",
    )


def linkages_panel(result: StudyResult) -> Panel:
    """Build the panel of both linkages to scale, in the colours of `curves_panel`."""
    parts: dict[str, dict[str, str | float]] = {
        "links": {"marker": ".", "width": 1.6},
        "ground": {"line": ":", "width": 1.2},
        "curve": {"width": 0.9},
    }
    curves = [
        curve_of(result, f"{who} {part}", colour=colour, **look)
        for who, colour in (("printed", PRINTED), ("ours", FOUND))
        for part, look in parts.items()
    ]
    title = "linkages to scale, ground dotted"
    return Panel(x_label="x [cm]", y_label="y [cm]", title=title, curves=curves, equal=True)


def draw_path(result: StudyResult, *, timed: bool) -> Figure:
    """Draw target and both curves, their distances over the crank's rotation or along the target, and the linkages."""
    place = result.columns["place on the target [deg]"]
    distances = Panel(
        x_label="crank rotation [deg]" if timed else "ωt of the ellipse [deg]",
        y_label="distance from the target [cm]",
        title="error over a turn" if timed else "error round the target",
        curves=[
            Curve(x=place, y=result.columns[f"{who} distance [cm]"], colour=colour)
            for who, colour in (("printed", PRINTED), ("ours", FOUND))
        ],
        logarithmic="y",
        y_range=None if timed else (1e-4, 1.0),
        x_ticks=range(0, 361, 90),
    )
    panels = [curves_panel(result, marks=timed), distances, linkages_panel(result)]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.6))


# Rocker functions


def window_sums(linkage: Linkage, *, mounting: bool = False) -> tuple[float, float]:
    """Return the sums of the squared errors inside and outside the weighted window, at 72 crank angles (deg2)."""
    task = rocker_function(N, weighted=True, mounting=mounting)
    within, squares = np.asarray(task.weights) > 1.0, DEG2_PER_RAD2 * evaluate(task, linkage).errors ** 2
    return float(squares[within].sum()), float(squares[~within].sum())


@cache
def mounted() -> Solution:
    """Return our linkage for the weighted rocker function with the output mounted on the rocker at a free angle."""
    p = PROBLEMS["rocker-weighted"]
    task = rocker_function(N, weighted=True, mounting=True)
    return synthesize(task, p.bounds, p.constraints, search=SEARCH).best


def window_verdicts() -> tuple[Verdict, ...]:
    """Judge whether the weights reduce the error in the window at the expense of the rest, and what a mounting angle gains."""
    inside, outside = window_sums(PROBLEMS["rocker-weighted"].linkage)
    even_inside, even_outside = window_sums(PROBLEMS["rocker"].linkage)
    free, _ = window_sums(mounted().linkage, mounting=True)
    place = "6.4.2 B, L4977"
    return (
        at_most("error within the window, of that unweighted", text(place), 1.0, inside / even_inside),
        at_least("error out of the window, of that unweighted", text(place), 1.0, outside / even_outside),
        near(f"squared errors within the window, printed linkage; N = {N}", OURS, 104.9, inside, 0.05, "deg2"),
        at_most(f"the same with a free mounting angle; N = {N}", OURS, 3.5, free, "deg2"),
    )


def rocker_columns(name: str) -> dict[str, FloatArray]:
    """Return target, rocker angles and errors over a turn (deg), and the least error over the transmission angle."""
    p = PROBLEMS[name]
    assert isinstance(p.task, RockerFunction)
    linkages, tasks = {"printed": p.linkage, "ours": best(name).linkage}, {"fixed": p.task}
    if name == "rocker-weighted":
        linkages["mounted"], tasks["mounted"] = mounted().linkage, replace(p.task, mounting=True)
    phi = np.linspace(0.0, 2.0 * pi, 361)
    target = 70.0 + 100.0 * np.abs(np.sin(0.5 * phi))
    columns = {"crank rotation [deg]": np.degrees(phi), "target angle [deg]": target}
    for who, linkage in linkages.items():
        angle = np.degrees(linkage.rocker_angle(phi))
        # into the same turn as the target
        angle -= 360.0 * np.round(np.mean(angle - target) / 360.0)
        columns |= {f"{who} angle [deg]": angle, f"{who} error [deg]": angle - target}
    columns["least transmission angle [deg]"] = np.array(ANGLES)
    for who, task in tasks.items():
        found = trade_off(task, "transmission", np.radians(ANGLES), constraints=p.constraints, search=Search(starts=3))
        columns[f"{who} least error [deg2]"] = p.per_si * np.asarray(found.error.filled(np.nan))
    return columns


def draw_rocker(result: StudyResult) -> Figure:
    """Draw rocker angles, errors, and the least error over the transmission angle."""
    c = result.columns
    labels = {"printed": "printed linkage", "ours": "our linkage", "mounted": "ours, mounting free"}
    look = dict(zip(labels, COLOURED))
    over_turn = {"x_label": "crank rotation [deg]", "x_ticks": range(0, 361, 60)}
    curves = {
        what: [
            Curve(x=c["crank rotation [deg]"], y=c[f"{who} {what} [deg]"], label=label, colour=look[who])
            for who, label in labels.items()
            if f"{who} {what} [deg]" in c
        ]
        for what in ("angle", "error")
    }
    target = Curve(x=c["crank rotation [deg]"], y=c["target angle [deg]"], label="target", colour=TARGET, line="--")
    trade_offs = [
        Curve(
            x=c["least transmission angle [deg]"],
            y=c[f"{who} least error [deg2]"],
            label=f"mounting {'free' if who == 'mounted' else 'fixed'}",
            colour=colour,
            marker=".",
        )
        for who, colour in (("fixed", FOUND), ("mounted", COLOURED[2]))
        if f"{who} least error [deg2]" in c
    ]
    panels = [
        Panel(
            y_label="rocker angle [deg]",
            title="rocker angle",
            curves=[target, *curves["angle"]],
            legend_at="lower center",
            **over_turn,  # type: ignore[arg-type]
        ),
        Panel(
            y_label="rocker angle less target [deg]",
            title="error over a turn",
            curves=curves["error"],
            **over_turn,  # type: ignore[arg-type]
        ),
        Panel(
            x_label="least transmission angle [deg]",
            y_label="least error [deg$^2$]",
            title="error against transmission angle",
            curves=trade_offs,
            logarithmic="y",
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=3, size=(3.9, 3.6))


# Fig 6.4 to 6.10

MORE: Mapping[str, Callable[[], tuple[Verdict, ...]]] = {
    "6.4": rounding_verdicts,
    "6.5": partial(harder_verdicts, "ellipse-b", "ellipse-a", "6.4.2 A, L4870"),
    "6.6": bounded_verdicts,
    "6.7": fewer_verdicts,
    "6.8": window_verdicts,
    "6.9": partial(triangle_verdicts, "path-a"),
    "6.10": lambda: (*triangle_verdicts("path-b"), *harder_verdicts("path-b", "path-a", "6.4.3, L5049")),
}


def compute(number: str) -> StudyResult:
    """Compute the printed linkage of a problem and ours."""
    row = TABLE[number]
    rocker = row.problem.startswith("rocker")
    verdicts = (*error_verdicts(row), *MORE[number]())
    return StudyResult(
        number=number,
        claim=row.claim,
        assignment=row.reading,
        columns=padded(rocker_columns(row.problem) if rocker else path_columns(row.problem)),
        # a rocker function determines the transmission angle
        verdicts=verdicts if rocker else (*verdicts, *sound_verdicts(row.problem)),
    )


DRAW: Mapping[str, Callable[[StudyResult], Figure]] = {
    "ellipse": partial(draw_path, timed=True),
    "path": partial(draw_path, timed=False),
    "rocker": draw_rocker,
}


#: The studies by number.
STUDIES = {
    number: Study(number, partial(compute, number), DRAW[row.problem.split("-")[0]]) for number, row in TABLE.items()
}
