"""Fig 5.1: the first region of instability over the inertia ratio of the rocker, without damping.

Near lambda_k^2 = k0/4, with the crank at about twice the natural frequency, the periodic effective mass unsettles the
motion. The thesis's appendix 3 draws the region from second-order boundaries (5.16); its regions are two and a half times
too wide. The equation as printed would make them four times too wide: it leaves out M' zeta', which turns the sign with
which the harmonics of M enter. Its listing departs from the printed formulas in K; with the first harmonic of K halved, and
divided by k0, the printed equation gives its widths to half a percent, which is our reading of it. The right boundaries are
where a Floquet multiplier of the true periodic orbit is -1; the linear equation about zeta = 0, with M' zeta' restored,
gives them to 2e-4, and for it Hill's determinant and the monodromy matrix agree. The captions are lost: that this chart
stands under this number is our assignment.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.published import chapter_4

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.fourier import FourierSeries
from ...youssef import Truncation, Variant, perturbed_region
from ..study import ASSIGNED, OURS, TEXT, Study, StudyResult, Verdict, at_most, near
from ._chapter_5 import (
    APPENDIX_3,
    RIGHT,
    edges,
    equation,
    first_region,
    hill_region,
    plain,
    ring,
    run_columns,
    run_verdicts,
    with_units,
)

NUMBER = "5.1"

#: lambda_k^2 of the long runs at I4 = 1: below the region, in it, above it, all three in the thesis's.
RUNS = (0.2662, 0.26745, 0.2695)
#: I4 of the widths.
RATIOS = np.linspace(0.25, 2.0, 15)
PLACES = [(f"I4 = 1, lambda_k^2 = {x:g}", chapter_4(1.0), x) for x in RUNS]


def listing_width(parameters: FiveBarParameters) -> float:
    """Width of the region as appendix 3 seems to compute it: without M' zeta', half the first harmonic of K, over k0."""
    found = equation(parameters)
    halves = np.where(np.arange(found.stiffness.order + 1) == 1, 0.5, 1.0)
    stiffness = FourierSeries(halves * found.stiffness.cos, halves * found.stiffness.sin)
    region = perturbed_region(found.mass, stiffness, 1, truncation=Truncation.PRINTED)
    assert region is not None, "there is no damping"
    return region.width / found.mass.mean


def thesis_boundaries(ratios: NDArray[np.float64]) -> NDArray[np.float64]:
    """Appendix 3's boundaries, shape (2, n): a cubic through the three I4 it is known at and 1/4 at I4 = 0."""
    known = np.array([0.0, *APPENDIX_3])
    values = np.array([(0.25, 0.25), *APPENDIX_3.values()])
    return np.array([np.polyval(np.polyfit(known, side, 3), ratios) for side in values.T])


def compute() -> StudyResult:
    """Boundaries by every way, and three long runs."""
    true, linear = first_region("orbit"), first_region("linear")
    verdicts: list[Verdict] = []
    for ratio in RIGHT:
        for side, right, thesis, value in zip(("lower", "upper"), RIGHT[ratio], APPENDIX_3[ratio], edges(true, ratio)):
            name = f"{side} boundary in lambda_k^2; I4 = {ratio:g}"
            # half a unit of the last digit printed
            verdicts += [
                near(name, OURS, right, value, 5.5e-7),
                near(name, TEXT, thesis, value, 5.5e-6),
            ]
    hill = [hill_region(chapter_4(ratio)) for ratio in RIGHT]
    floquet = [edges(linear, ratio) for ratio in RIGHT]
    difference = max(abs(value - side) for h, f in zip(hill, floquet) for value, side in zip((h.low, h.high), f))
    verdicts += [
        at_most("linear equation: Hill's determinant less the monodromy matrix", OURS, 1e-10, difference),
        at_most(
            "distance of a traced point from its boundary, of the box",
            OURS,
            1e-9,
            max(boundary.residual for found in (true, linear) for boundary in found.boundaries),
        ),
        at_most(
            "thesis's widths less those by our reading of its listing, relative",
            OURS,
            0.005,
            max(abs(listing_width(chapter_4(x)) / (high - low) - 1.0) for x, (low, high) in APPENDIX_3.items()),
        ),
        *run_verdicts(PLACES),
    ]
    columns = {}
    for name, found in (("true orbit", true), ("linear equation", linear)):
        for number, boundary in enumerate(found.boundaries, start=1):
            columns[f"I4; {name}; boundary {number}"] = boundary.points[:, 1]
            columns[f"lambda_k^2; {name}; boundary {number}"] = boundary.points[:, 0]
    columns["I4"] = RATIOS
    columns["width; true orbit"] = np.array([np.ptp(edges(true, ratio)) for ratio in RATIOS.tolist()])
    mechanisms = [chapter_4(ratio) for ratio in RATIOS.tolist()]
    columns["width; linear equation"] = np.array([hill_region(p).width for p in mechanisms])
    for truncation, name in ((Truncation.RIGHT, "second order"), (Truncation.PRINTED, "second order; as printed")):
        regions = [
            perturbed_region(e.mass, e.stiffness, 1, truncation=truncation)
            for e in (equation(p, Variant.SECOND_ORDER) for p in mechanisms)
        ]
        columns[f"width; {name}"] = np.array([region.width for region in regions if region is not None])
    columns["width; listing; our reading"] = np.array([listing_width(p) for p in mechanisms])
    columns["lambda_k^2; thesis joined; lower"], columns["lambda_k^2; thesis joined; upper"] = thesis_boundaries(RATIOS)
    columns["lambda_k^2; long runs at I4 = 1"] = np.array(RUNS)
    columns["long run grows"] = run_columns(PLACES)
    columns["I4; thesis"] = np.array(list(APPENDIX_3))
    columns["lambda_k^2; thesis; lower"], columns["lambda_k^2; thesis; upper"] = np.array(list(APPENDIX_3.values())).T
    return StudyResult(
        number=NUMBER,
        claim="The first region of instability over I4, by the boundaries of second order (5.16).",
        assignment=ASSIGNED,
        columns=with_units(columns),
        verdicts=tuple(verdicts),
    )


def draw(result: StudyResult) -> Figure:
    """The regions over I4, and their widths."""
    c = plain(result)
    lower, upper = c["lambda_k^2; thesis; lower"], c["lambda_k^2; thesis; upper"]
    curves = []
    for name, colour, line in (("true orbit", COLOURS[0], "-"), ("linear equation", COLOURS[2], "--")):
        curves += [
            Curve(
                x=c[f"I4; {name}; boundary {number}"],
                y=c[f"lambda_k^2; {name}; boundary {number}"],
                colour=colour,
                line=line,
                label=name if number == 1 else "",
            )
            for number in (1, 2)
        ]
    for side, ends in (("lower", lower), ("upper", upper)):
        label = "thesis, appendix 3" if side == "lower" else ""
        curves += [
            Curve(x=c["I4; thesis"][:3], y=ends[:3], colour=COLOURS[1], line="", marker="s", label=label),
            Curve(x=c["I4"], y=c[f"lambda_k^2; thesis joined; {side}"], colour=COLOURS[1], line=":"),
        ]
    runs, grows = c["lambda_k^2; long runs at I4 = 1"][:3], c["long run grows"][:3]
    for state, marker, label in ((0.0, "o", "long run stays bounded"), (1.0, "x", "long run grows")):
        chosen = runs[grows == state]
        curves.append(Curve(x=np.ones(len(chosen)), y=chosen, colour="0.1", line="", marker=marker, label=label))
    widths = [
        Curve(x=c["I4"], y=1e3 * c["width; true orbit"], label="true orbit", colour=COLOURS[0]),
        Curve(x=c["I4"], y=1e3 * c["width; linear equation"], label="linear equation", colour=COLOURS[2], line="--"),
        Curve(x=c["I4"], y=1e3 * c["width; second order"], label="second order, ours", colour=COLOURS[3], line=":"),
        Curve(
            x=c["I4"],
            y=1e3 * c["width; second order; as printed"],
            label="second order without M' zeta'",
            colour=COLOURS[4],
            line="-.",
        ),
        Curve(x=c["I4"], y=1e3 * c["width; listing; our reading"], label="listing, our reading", colour=COLOURS[1]),
        Curve(
            x=c["I4; thesis"][:3],
            y=1e3 * (upper - lower)[:3],
            label="thesis, appendix 3",
            colour=COLOURS[1],
            line="",
            marker="s",
        ),
    ]
    region = ring(first_region("orbit"))[:, ::-1]
    panels = [
        Panel(
            x_label="inertia ratio I4",
            y_label="lambda_k^2",
            curves=curves,
            filled=[[region]],
            legend_at="upper left",
            x_range=(0.25, 2.0),
            y_range=(0.25, 0.29),
        ),
        Panel(
            x_label="inertia ratio I4",
            y_label="width of the region in lambda_k^2 [1e-3]",
            curves=widths,
            legend_at="upper left",
            x_range=(0.25, 2.0),
            y_range=(0.0, 20.0),
        ),
    ]
    return plot_curves(panels, title=result.heading, columns=2, size=(4.8, 4.0))


STUDY = Study(NUMBER, compute, draw)
