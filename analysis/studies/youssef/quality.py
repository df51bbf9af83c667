"""Methods of sections 6.2 and 6.3 without a figure: the combined quality function and the constraint of assembly.

The quality functions of a path in time and of the area between the curves may be added. For ellipse (a) the sum is
minimised with no link longer than the longest of either printed linkage, by the thesis's downhill simplex from our two
optima. A linkage found for the path alone gets its best crank phase: the thesis keeps th20 there although the area
does not depend on it (L4700).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import degrees, pi
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...synthesis import Linkage, Search, TimedPath, UntimedPath, area_between, evaluate, synthesize, turn
from ..study import OURS, Study, StudyResult, at_least, at_most, near, padded, text
from .chapter_6 import TRANSMISSION, FloatArray, best, our_error, printed_error
from .problems import AREA_N, CM2_PER_M2, PROBLEMS, ellipse

NUMBER = "quality"
TIMED, PATH = PROBLEMS["ellipse-a"], PROBLEMS["path-a"]
LONGEST = max(TIMED.linkage.largest_link, PATH.linkage.largest_link)
#: Evaluations of a simplex, number of restarts, and its size relative to the dimensions.
EVALUATIONS, ROUNDS, SIZE = 1500, 3, 0.01
#: Error of a linkage outside the limits (cm2).
REFUSED = 1e6
#: Number of random four-bars in the test of the constraint.
SAMPLES = 10_000


class Quality(NamedTuple):
    """Quality functions of a linkage: sum of squared distances in time, and area between the curves (cm2)."""

    timed: float
    area: float

    @property
    def combined(self) -> float:
        """Their sum."""
        return self.timed + self.area


def both(linkage: Linkage) -> Quality:
    """Return both quality functions of a linkage for ellipse (a)."""
    assert isinstance(PATH.task, UntimedPath)
    area = area_between(linkage.path(turn(AREA_N)), PATH.task.path)
    return Quality(TIMED.convert(evaluate(TIMED.task, linkage).error), CM2_PER_M2 * area)


def in_time(linkage: Linkage) -> Linkage:
    """Return the linkage with the crank phase of least error for the timed ellipse."""

    def error(phase: float) -> float:
        return evaluate(TIMED.task, replace(linkage, crank_phase=phase)).error

    phases = turn(72)
    least = float(phases[np.argmin([error(phase) for phase in phases.tolist()])])
    step = 2.0 * pi / len(phases)
    return replace(linkage, crank_phase=float(minimize_scalar(error, bracket=(least - step, least, least + step)).x))


def least_combined(start: Linkage) -> Linkage:
    """Minimise the combined error by the downhill simplex from a linkage."""
    unit = np.maximum(np.abs(start.vector), 0.05)

    def linkage(x: FloatArray) -> Linkage:
        return Linkage.from_vector(x * unit, start.branch)

    def error(x: FloatArray) -> float:
        if np.any(x[2:6] * start.vector[2:6] <= 0.0):
            return REFUSED
        found = linkage(x)
        if found.largest_link > LONGEST or degrees(found.least_transmission) < TRANSMISSION:
            return REFUSED
        return both(found).combined

    x = start.vector / unit
    for size in SIZE / 2.0 ** np.arange(ROUNDS):
        simplex = np.vstack([x, x - size * np.diag(np.sign(x))])
        x = minimize(error, x, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": EVALUATIONS}).x
    return linkage(x)


@cache
def linkages() -> dict[str, Linkage]:
    """Return the linkages to compare: printed for the timed ellipse and for the path, ours for each, and for both."""
    ours = {"ours; timed": best("ellipse-a").linkage, "ours; path": in_time(best("path-a").linkage)}
    found = min((least_combined(start) for start in ours.values()), key=lambda linkage: both(linkage).combined)
    return {"printed; timed": TIMED.linkage, "printed; path": in_time(PATH.linkage), **ours, "ours; combined": found}


def least_away_from_ends(seed: int = 64) -> int:
    """Count the random four-bars whose square root (6.12) has its least argument at another angle than 0 or 180 deg."""
    l1, l2, l3, l4 = np.random.default_rng(seed).uniform(0.1, 1.0, (4, SAMPLES, 1))
    cosine = np.cos(turn(72))
    span = l1**2 + l2**2 - 2.0 * l1 * l2 * cosine
    argument = 4.0 * l4**2 * span - (l3**2 - l4**2 - span) ** 2
    ends = argument[:, [0, 36]].min(axis=1)
    return int((argument.min(axis=1) < ends - 1e-12).sum())


def minima(n: int) -> int:
    """Return the different optima that 24 starts find for ellipse (a) timed at n points."""
    task = TimedPath(points=ellipse(10.0, n))
    return len(
        synthesize(task, TIMED.bounds, TIMED.constraints, search=Search(starts=24, candidates=1 << 13)).solutions
    )


def compute() -> StudyResult:
    """Compute both quality functions of the linkages."""
    q = {name: both(linkage) for name, linkage in linkages().items()}
    found, timed, path = q["ours; combined"], q["ours; timed"], q["ours; path"]
    columns = {
        f"{name} {what} [cm2]": [getattr(value, what)] for name, value in q.items() for what in ("timed", "area")
    }
    place = "6.2.2, L4241"
    least = min(timed.combined, path.combined)
    return StudyResult(
        number=NUMBER,
        claim="The quality functions of function and path generation may be combined into one; ellipse (a).",
        assignment="The thesis gives no example: problem, equal weights and the limit of the links are our choice.",
        columns=padded(columns),
        verdicts=(
            at_most("timed error of the combined optimum, of the path's", text(place), 1.0, found.timed / path.timed),
            at_most("area of the combined optimum, of the timed one's", text(place), 1.0, found.area / timed.area),
            at_most("combined error, of the lesser of the two optima's", OURS, 1.0, found.combined / least),
            at_least("its timed error, of the timed optimum's", OURS, 1.0, found.timed / timed.timed),
            at_least("its area, of the path's optimum's", OURS, 1.0, found.area / path.area),
            near(
                f"four-bars of {SAMPLES} whose constraint (6.12) is least away from cos wt = 1 and -1",
                text("6.3.2, L4514"),
                0,
                least_away_from_ends(),
                0,
            ),
            at_least(
                "minima found at 72 points, more than at 12; timed ellipse (a)",
                text("6.3.1, L4348"),
                1,
                minima(72) - minima(12),
                why="the same four at either",
            ),
            at_most(
                "error of the printed linkage, of the least with no longer link; timed ellipse (a)",
                text("6.3.1, L4366"),
                1.0,
                printed_error("ellipse-a") / our_error("ellipse-a"),
                why="the simplex did not locate the global minimum",
            ),
        ),
    )


def draw(result: StudyResult) -> Figure:
    """Draw the area over the timed error of each linkage."""
    c = result.columns
    looks = {"printed": COLOURS[1], "ours": COLOURS[0]}
    curves = [
        Curve(
            x=c[f"{name} timed [cm2]"],
            y=c[f"{name} area [cm2]"],
            label=name.replace(";", ","),
            line="",
            marker=marker,
            colour=looks[name.split(";")[0]],
        )
        for name, marker in zip(linkages(), "osos^")
    ]
    panel = Panel(
        x_label="sum of squared distances in time [cm$^2$]",
        y_label="area between the curves [cm$^2$]",
        curves=curves,
        legend="found for",
        legend_at="outside",
        logarithmic="xy",
    )
    return plot_curves([panel], title=result.heading, size=(6.4, 3.4))


#: The study by its name.
STUDIES = {NUMBER: Study(NUMBER, compute, draw)}
