"""Fig 5.3: the first region of instability over the length of the coupler.

The thesis varies the coupler with the mean angles of coupler and rocker held at 60 and 120 degrees. With any other length
than the rocker's the loop then does not close: what it computes belongs to a mechanism with another ground link and the
guide inclined to it. Re-closed at u = 0 on the same ground link, a longer coupler makes the rocker turn faster with the
slider, and the region rises; it is narrowest near l3 = l4, where the thesis has its mechanism, and several times as wide on
either side, none of which is seen with the angles held. Both curves are by the right equation, so that they differ in the
closure alone. The captions are lost: that this chart stands under this number is our assignment.
"""

from __future__ import annotations

from cmath import phase, rect
from dataclasses import replace
from functools import cache
from math import pi

import numpy as np

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.boundaries import Box, Chart, chart
from ...periodic import Drive, Operation
from ..study import ASSIGNED, OURS, Study, StudyResult, Verdict, at_least, at_most
from ._chapter_5 import (
    MOTIONS,
    crank_speed,
    edges,
    hill_region,
    plain,
    ring,
    run_columns,
    run_verdicts,
    with_units,
)

NUMBER = "5.3"

INERTIA_RATIO = 1.0
#: Chart of lambda_k^2 and l3/l4.
BOX = Box(x=(0.25, 0.33), y=(0.6, 1.5))
#: Lengths at which the ways are compared, and those of the widths.
COMPARED = (0.7, 1.0, 1.3)
LENGTHS = np.linspace(0.6, 1.5, 19)


def closed(ratio: float) -> FiveBarParameters:
    """The mechanism with a coupler of ratio l4, closed at u = 0."""
    mechanism = chapter_4(INERTIA_RATIO)
    return replace(mechanism, coupler_length=ratio * mechanism.rocker_length)


def held(ratio: float) -> FiveBarParameters:
    """The mechanism to which the held angles belong: its ground link closes the loop, and the guide keeps its direction."""
    mechanism = closed(ratio)
    ground = rect(mechanism.coupler_length, pi / 3.0) - rect(mechanism.rocker_length, 2.0 * pi / 3.0)
    return replace(mechanism, ground_length=abs(ground), slider_guide_angle=-phase(ground))


@cache
def region(motion: str) -> Chart:
    """Boundaries in lambda_k^2 and l3/l4: of the true orbit, of the linear equation, and of that with the angles held."""
    mechanism = held if motion == "held" else closed

    def operation(lambda_k2: float, ratio: float) -> Operation:
        return mechanism(ratio), Drive(speed=crank_speed(lambda_k2))

    test = MOTIONS["linear" if motion == "held" else motion](operation, -1)
    return chart(test, BOX, lines=(0, 4), samples=100)


def places() -> list[tuple[str, FiveBarParameters, float]]:
    """Long runs at l3 = 1.3 l4: below the region, in its middle, and above it."""
    low, high = edges(region("orbit"), 1.3)
    points = (low - 0.3 * (high - low), 0.5 * (low + high), high + 0.3 * (high - low))
    return [(f"l3 = 1.3 l4, lambda_k^2 = {x:.4f}", closed(1.3), x) for x in points]


def compute() -> StudyResult:
    """Boundaries with and without closure, and three long runs."""
    charts = {name: region(name) for name in ("orbit", "linear", "held")}
    columns = {}
    for name, found in charts.items():
        for number, boundary in enumerate(found.boundaries, start=1):
            columns[f"l3/l4; {name}; boundary {number}"] = boundary.points[:, 1]
            columns[f"lambda_k^2; {name}; boundary {number}"] = boundary.points[:, 0]
    columns["l3/l4"] = LENGTHS
    columns["width; orbit"] = np.array([np.ptp(edges(charts["orbit"], x)) for x in LENGTHS.tolist()])
    columns["width; linear"] = np.array([hill_region(closed(x)).width for x in LENGTHS.tolist()])
    columns["width; held"] = np.array([hill_region(held(x)).width for x in LENGTHS.tolist()])
    chosen = places()
    columns["lambda_k^2; long runs at l3 = 1.3 l4"] = np.array([x for _, _, x in chosen])
    columns["long run grows"] = run_columns(chosen)
    mechanism = closed(1.3)
    hill = [hill_region(closed(ratio)) for ratio in COMPARED]
    floquet = [edges(charts["linear"], ratio) for ratio in COMPARED]
    difference = max(abs(value - side) for h, f in zip(hill, floquet) for value, side in zip((h.low, h.high), f))
    same = np.abs(np.subtract(edges(charts["held"], 1.0), edges(charts["linear"], 1.0))).max()
    verdicts: list[Verdict] = [
        at_most("linear equation: Hill's determinant less the monodromy matrix", OURS, 1e-10, difference),
        at_most("boundaries with the angles held less those closed; l3 = l4", OURS, 1e-10, float(same)),
        at_least(
            "ground link that the held angles would need, less the one there is; l3 = 1.3 l4, relative",
            OURS,
            0.1,
            abs(held(1.3).ground_length / mechanism.ground_length - 1.0),
        ),
        at_least(
            "width of the region relative to that with the angles held; l3 = 1.3 l4",
            OURS,
            1.5,
            hill_region(mechanism).width / hill_region(held(1.3)).width,
        ),
        *run_verdicts(chosen),
    ]
    return StudyResult(
        number=NUMBER,
        claim="The first region of instability as the coupler is varied, with the angles held.",
        assignment=ASSIGNED,
        columns=with_units(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The regions over the coupler's length, and their widths."""
    c = plain(result)
    looks = {
        "orbit": ("closed, true orbit", COLOURS[0], "-"),
        "linear": ("closed, linear equation", COLOURS[2], "--"),
        "held": ("angles held, as in the thesis", COLOURS[1], "-."),
    }
    curves, widths = [], []
    for name, (label, colour, line) in looks.items():
        for number in (1, 2):
            x, y = c[f"l3/l4; {name}; boundary {number}"], c[f"lambda_k^2; {name}; boundary {number}"]
            curves.append(Curve(x=x, y=y, label=label if number == 1 else "", colour=colour, line=line))
        widths.append(Curve(x=c["l3/l4"], y=1e3 * c[f"width; {name}"], label=label, colour=colour, line=line))
    runs, grows = c["lambda_k^2; long runs at l3 = 1.3 l4"][:3], c["long run grows"][:3]
    for state, marker, label in ((0.0, "o", "long run stays bounded"), (1.0, "x", "long run grows")):
        y = runs[grows == state]
        curves.append(Curve(x=np.full(len(y), 1.3), y=y, colour="0.1", line="", marker=marker, label=label))
    panels = [
        Panel(
            x_label="coupler's length l3/l4",
            y_label="lambda_k^2",
            curves=curves,
            filled=[[ring(region("orbit"))[:, ::-1]]],
            legend_at="upper left",
            x_range=BOX.y,
            y_range=BOX.x,
        ),
        Panel(
            x_label="coupler's length l3/l4",
            y_label="width of the region in lambda_k^2 [1e-3]",
            curves=widths,
            legend_at="upper left",
            x_range=BOX.y,
            y_range=(0.0, 34.0),
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.8, 4.0))


STUDY = Study(NUMBER, compute, draw)
