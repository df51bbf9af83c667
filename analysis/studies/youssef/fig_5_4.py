"""Fig 5.4: the first region over the length of the crank, and how narrow the higher regions are.

Without a crank there is nothing periodic and no region. The width of region N starts with the N-th power of sigma2 = l2/l4;
at the thesis's 0.05 the second region is half as wide as the first and the third a fifteenth. With damping the first region
begins at a crank of its own. The colours are the largest multiplier of the true orbit, each point's own; the boundaries are
traced. The captions are lost: that this chart stands under this number is our assignment.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ...figures import COLOURS, Curve, Figure, HeatMap, Panel, plot_charts
from ...numerics.boundaries import Box, Chart, chart
from ...periodic import Drive, Grid, Operation, grid
from ..study import ASSIGNED, OURS, Study, StudyResult, Verdict, at_most, near
from ._chapter_5 import (
    MOTIONS,
    crank_speed,
    hill_region,
    plain,
    run_columns,
    run_verdicts,
    with_crank,
    with_units,
)

NUMBER = "5.4"

INERTIA_RATIO = 1.0
#: Damping of the chart (1/s).
DAMPING = 0.1
#: Chart of lambda_k^2 and sigma2, and the points of its grid.
BOX = Box(x=(0.25, 0.33), y=(0.02, 0.3))
POINTS = (161, 113)
#: sigma2 of the widths, and the part of them from which the powers are taken.
CRANKS = np.geomspace(0.01, 0.2, 12)
SMALL = 5
#: Long runs: sigma2 and lambda_k^2.
RUNS = ((0.25, 0.28), (0.25, 0.291), (0.25, 0.302))
PLACES = [(f"sigma2 = {s:g}, lambda_k^2 = {x:g}", with_crank(INERTIA_RATIO, DAMPING, s), x) for s, x in RUNS]


def operation(lambda_k2: float, sigma2: float) -> Operation:
    """A point of the chart."""
    return with_crank(INERTIA_RATIO, DAMPING, sigma2), Drive(speed=crank_speed(lambda_k2))


@cache
def region(motion: str) -> Chart:
    """The boundary of the first region."""
    return chart(MOTIONS[motion](operation, -1), BOX, lines=(0, 3), samples=100)


@cache
def colours() -> Grid:
    """The largest multiplier of the true orbit."""
    return grid(operation, np.linspace(*BOX.x, POINTS[0]), np.linspace(*BOX.y, POINTS[1]))


def disagreements(found: Grid, true: Chart) -> int:
    """Points of the grid that its multiplier and the traced boundary judge differently."""
    (boundary,) = true.boundaries
    wrong = 0
    for y, row in zip(found.y.tolist(), found.largest):
        inside = np.zeros(len(row), dtype=bool)
        for crossing in boundary.crossings(1, y, true.box).tolist():
            inside ^= found.x > crossing
        wrong += int(np.count_nonzero((row > 1.0) != inside))
    return wrong


def compute() -> StudyResult:
    """Colours, boundaries, widths of the regions, and three long runs."""
    found, true, linear = colours(), region("orbit"), region("linear")
    columns = {}
    for name, of in (("true orbit", true), ("linear equation", linear)):
        (boundary,) = of.boundaries
        columns[f"lambda_k^2; {name}"], columns[f"sigma2; {name}"] = boundary.points.T
    columns["sigma2"] = CRANKS
    verdicts: list[Verdict] = []
    for number in (1, 2, 3):
        widths = np.array([hill_region(with_crank(INERTIA_RATIO, 0.0, s), number).width for s in CRANKS.tolist()])
        columns[f"width; region {number}"] = widths
        power = np.polyfit(np.log(CRANKS[:SMALL]), np.log(widths[:SMALL]), 1)[0]
        verdicts.append(near(f"power of sigma2 in the width of region {number}", OURS, number, power, 0.05))
    columns["sigma2; long runs"], columns["lambda_k^2; long runs"] = np.array(RUNS).T
    columns["long run grows"] = run_columns(PLACES)
    columns["largest multiplier; grid"] = found.largest.filled(np.nan).ravel()
    columns["lambda_k^2; grid"] = np.tile(found.x, len(found.y))
    columns["sigma2; grid"] = np.repeat(found.y, len(found.x))
    verdicts += [
        at_most("points of the grid without an orbit", OURS, 0, int(np.count_nonzero(found.status))),
        at_most("points of the grid on the wrong side of the traced boundary", OURS, 0, disagreements(found, true)),
        *run_verdicts(PLACES),
    ]
    return StudyResult(
        number=NUMBER,
        claim="The regions of instability depend on the length of the crank.",
        assignment=ASSIGNED,
        columns=with_units(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The chart in colours, and the widths."""
    c = plain(result)
    found = colours()
    curves = [
        Curve(x=c["lambda_k^2; true orbit"], y=c["sigma2; true orbit"], colour="0.1", label="boundary, true orbit"),
        Curve(
            x=c["lambda_k^2; linear equation"],
            y=c["sigma2; linear equation"],
            colour=COLOURS[2],
            line="--",
            label="boundary, linear equation",
        ),
    ]
    runs = [c[name][:3] for name in ("lambda_k^2; long runs", "sigma2; long runs", "long run grows")]
    for state, marker, label in ((0.0, "o", "long run decays"), (1.0, "x", "long run grows")):
        x, y = (values[runs[2] == state] for values in runs[:2])
        curves.append(Curve(x=x, y=y, colour="0.1", line="", marker=marker, label=label))
    labels = {1: "region 1", 2: "region 2", 3: "region 3"}
    widths = [Curve(x=c["sigma2"], y=c[f"width; region {n}"], label=labels[n], marker=".") for n in labels]
    charts: list[Panel | HeatMap] = [
        HeatMap(
            panel=Panel(
                x_label="lambda_k^2",
                y_label="crank's length sigma2 = l2/l4",
                title=f"omega_c = {DAMPING:g} 1/s, I4 = {INERTIA_RATIO:g}",
                curves=curves,
                legend_at="lower right",
                x_range=BOX.x,
                y_range=BOX.y,
            ),
            x=found.x,
            y=found.y,
            values=found.largest,
            label="largest Floquet multiplier",
            missing="no orbit",
        ),
        Panel(
            x_label="crank's length sigma2 = l2/l4",
            y_label="width of the region in lambda_k^2",
            title="linear equation, no damping",
            curves=widths,
            logarithmic="xy",
            legend_at="lower right",
            x_ticks=(0.01, 0.02, 0.05, 0.1, 0.2),
        ),
    ]
    return plot_charts(charts, title=result.heading, columns=2, size=(5.0, 4.0))


STUDY = Study(NUMBER, compute, draw)
