"""Methods of sections 6.2 and 6.3 that have no figure: the combined quality function and the constraint of assembly.

The quality functions of a timed path and of the area between the curves may be added. Here the thesis's downhill simplex
minimises their sum for ellipse (a). No link may be longer than the longest link of the two linkages that the thesis prints for
this ellipse, one for the area and one for the timed path. The simplex is started from three linkages of ours: the best for the
area; the best for the timed path; and the best for the timed path if no link is longer than the longest link of the linkage
printed for it. The area does not depend on the crank phase th20. A linkage found for the area alone therefore gets the phase
that is best for the timed path; the thesis optimises th20 in this case too (L4700, a line of the scanned text).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from math import degrees, pi
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...figures.curves import Label
from ...synthesis import LINKS, USUAL, LargestLink, Linkage, UntimedPath, area_difference, evaluate, synthesize, turn
from ...units import CM_PER_METRE
from ..rules import ALIKE
from ..statements import FloatArray, Statement, at_least, at_most, near, statement, unjudged
from ..study import Study, StudyResult, pad_columns
from .chapter_6 import SEARCH, TABLE, TRANSMISSION, best
from .problems import AREA_N, AS_FOUND, CM2_PER_M2, PROBLEMS

TIMED, PATH = PROBLEMS["ellipse-a"], PROBLEMS["path-a"]
LONGEST = max(TIMED.linkage.largest_link, PATH.linkage.largest_link)
#: Evaluations of a simplex, number of its runs, and its size relative to the dimensions.
EVALUATIONS, ROUNDS, SIZE = 1500, 3, 0.01
#: Error of a linkage outside the limits (cm2); least length (m) and most steps of a descent.
REFUSED, SHORTEST, STEPS = 1e6, 1e-6, 60
#: Aims for which the linkages were found, in words.
AIMS = {"timed": "for points in time", "path": "for the curve alone", "combined": "for both"}
#: Number of random four-bars in the test of the constraint.
SAMPLES = 10_000


class Quality(NamedTuple):
    """Quality functions of a linkage (cm2): sum of squared distances of the timed path, and area between the curves."""

    timed: float
    area: float

    @property
    def combined(self) -> float:
        """Return the sum of both quality functions (cm2)."""
        return self.timed + self.area


def qualities(linkage: Linkage) -> Quality:
    """Return both quality functions of a linkage for ellipse (a)."""
    assert isinstance(PATH.task, UntimedPath)
    area = area_difference(linkage.path(turn(AREA_N)), PATH.task.path)
    return Quality(TIMED.convert(evaluate(TIMED.task, linkage).error), CM2_PER_M2 * area)


def with_best_phase(linkage: Linkage) -> Linkage:
    """Return the linkage with the crank phase that makes its error for the timed ellipse least."""

    def error(phase: float) -> float:
        return evaluate(TIMED.task, replace(linkage, crank_phase=phase)).error

    phases = turn(72)
    least = float(phases[np.argmin([error(phase) for phase in phases.tolist()])])
    step = 2.0 * pi / len(phases)
    return replace(linkage, crank_phase=float(minimize_scalar(error, bracket=(least - step, least, least + step)).x))


def least_combined(start: Linkage) -> Linkage:
    """Minimise the combined quality function by the downhill simplex from a linkage; return the linkage found."""
    unit = np.maximum(np.abs(start.vector), 0.05)

    def linkage(x: FloatArray) -> Linkage:
        return Linkage.from_vector(x * unit, start.branch)

    def error(x: FloatArray) -> float:
        if np.any(x[2:6] * start.vector[2:6] <= 0.0):
            return REFUSED
        found = linkage(x)
        if found.largest_link > LONGEST or degrees(found.least_transmission) < TRANSMISSION:
            return REFUSED
        return qualities(found).combined

    x = start.vector / unit
    for size in SIZE / 2.0 ** np.arange(ROUNDS):
        simplex = np.vstack([x, x - size * np.diag(np.sign(x))])
        x = minimize(error, x, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": EVALUATIONS}).x
    return linkage(x)


def descent_ratio(name: str) -> float:
    """Return the error of the printed linkage, relative to the error at the end of a descent from it.

    A rocker function is taken as in `AS_FOUND`.
    """
    p, longest = AS_FOUND.get(name, PROBLEMS[name]), PROBLEMS[name].linkage.largest_link
    unit = np.append(np.full(7, longest), np.ones(3))
    bounds = {**dict.fromkeys((*LINKS, "point_distance"), (SHORTEST, longest)), **p.bounds}
    limits = [tuple(np.array(bounds.get(d, (-np.inf, np.inf))) / u) for d, u in zip(p.linkage.values(), unit)]
    first = p.linkage_error(p.linkage)

    def error(x: FloatArray) -> float:
        found = p.linkage_error(Linkage.from_vector(x * unit, p.linkage.branch)) / first
        return found if np.isfinite(found) else REFUSED

    options = {"ftol": 1e-9, "maxiter": STEPS}
    return 1.0 / float(minimize(error, p.linkage.vector / unit, method="SLSQP", bounds=limits, options=options).fun)


@cache
def linkages() -> dict[str, Linkage]:
    """Return the linkages compared, by name.

    They are the printed linkages for the timed ellipse and for the path, and our linkages for the timed ellipse, for the path
    and for the sum of both quality functions.
    """
    limits = (*USUAL, LargestLink(length=LONGEST))
    timed = synthesize(TIMED.task, TIMED.bounds, limits, search=SEARCH).best.linkage
    ours = {"ours; timed": timed, "ours; path": with_best_phase(best("path-a").linkage)}
    starts = (*ours.values(), best("ellipse-a").linkage)
    found = min(map(least_combined, starts), key=lambda linkage: qualities(linkage).combined)
    return {
        "printed; timed": TIMED.linkage,
        "printed; path": with_best_phase(PATH.linkage),
        **ours,
        "ours; combined": found,
    }


def assembly_arguments(seed: int = 64) -> FloatArray:
    """Return the argument of the square root in (6.12) for random four-bars at 72 crank angles, shape (SAMPLES, 72)."""
    l1, l2, l3, l4 = np.random.default_rng(seed).uniform(0.1, 1.0, (4, SAMPLES, 1))
    span = l1**2 + l2**2 - 2.0 * l1 * l2 * np.cos(turn(72))
    return np.asarray(4.0 * l4**2 * span - (l3**2 - l4**2 - span) ** 2)


def compute() -> StudyResult:
    """Compute both quality functions of the linkages, and judge the statements."""
    q = {name: qualities(linkage) for name, linkage in linkages().items()}
    columns = {
        f"{name} {what} [cm2]": [getattr(value, what)] for name, value in q.items() for what in ("timed", "area")
    }
    return StudyResult(
        claim="The quality functions of function and path generation may be combined into one. The example is ellipse (a).",
        assignment="The thesis gives no example. Problem, equal weights and the limit of the links are our choice.",
        columns=pad_columns(columns),
        statements=tuple(judge_qualities(q["ours; timed"], q["ours; path"], q["ours; combined"])),
    )


def judge_qualities(timed: Quality, path: Quality, found: Quality) -> Iterator[Statement]:
    """Judge the statements on the quality functions, by our best linkages for the time, for the path, and for both."""
    ratios = {f"Fig {n}": descent_ratio(row.problem) for n, row in TABLE.items()}
    yield statement(
        "In path generation it is clear that minimisation of the above quality function would yield a [minimum] error. It "
        "does, however, impose the unnecessary condition that the mechanism pass the desired points at the specified times.",
        "6.2.2, L4205",
        "area between curve and ellipse (a) of the linkage with the least error (6.6), relative to the least area. "
        f"Both are the least that we find with a transmission angle of at least {TRANSMISSION:g} deg and no link "
        f"above {CM_PER_METRE * LONGEST:.2f} cm, the longest printed for this ellipse",
        f"above {1.0 + ALIKE:g}, the rule for *the same*, since a condition that costs nothing would leave the area unchanged",
        at_least("area", 1.0 + ALIKE, timed.area / path.area),
        why="that minimisation yields a minimum is not judged, since it claims nothing",
    )
    yield statement(
        "An approximation to the desired output may, therefore, be obtained by taking both function and path "
        "generation into consideration.",
        "6.2.2, L4243",
        "error in time (6.6) and area of the linkage that the downhill simplex finds for their sum, within the same limits",
        "at most the errors that the thesis states for linkages found for one of the two, and calls favourable (L4864) "
        "and tolerable (L5043)",
        at_most("error in time, as at Fig 6.4", str(TIMED.error), found.timed, "cm2"),
        at_most("area, as at Fig 6.9", str(PATH.error), found.area, "cm2"),
    )
    yield from _judge_constraint()
    yield statement(
        "The method described can find a planar linkage to generate a given output. It can [deal] with any type of "
        "planar linkage yielding in all cases a minimum.",
        "6.5, L5136",
        "error of the printed linkage, mended, relative to the error at the end of a descent from it. At Figs 6.7 and 6.8 it "
        "is the error in that reading of Fig 6.7 which we choose because both linkages are minima in it. The descent has at "
        f"most {STEPS} steps, makes no link longer than the longest printed one, and at Fig 6.6 stays within the printed "
        "bounds. Rounding changes its course: the ratios other than 1 differ by up to 4 % from machine to machine, and grow "
        "with more steps",
        f"{1.0 + ALIKE:g}, the rule for *the same*, since at a minimum there is no descent",
        *(at_most(name, 1.0 + ALIKE, ratio, why="it is not a minimum") for name, ratio in ratios.items()),
        unjudged("Fig 6.11", "its nineteen points are lost"),
        unjudged("other types of linkage", "none is given"),
        why="in most other readings of the weighted error the linkage of Fig 6.8 is no minimum; how well they generate the "
        "outputs is judged at Figs 6.4 to 6.9",
    )
    yield statement(
        "It [the method] can be made to follow a logical process in the choice of the type of linkage until it finds a "
        "satisfactory result.",
        "6.5, L5140",
        why="no example is given; the strategy of 7.4 is judged at L6026",
    )


def share_of_values(found: FloatArray) -> float:
    """Return the number of values of (6.12) in a test at 0 and 180 deg only, divided by the number in a test at all angles.

    ``found`` has the values of random four-bars at all angles; the test of each stops at the first negative value.
    """
    at_two, at_all = (
        np.where(bad.any(axis=1), bad.argmax(axis=1) + 1, bad.shape[1]).sum()
        for bad in (found[:, [0, 36]] < 0.0, found < 0.0)
    )
    return float(at_two / at_all)


def _judge_constraint() -> Iterator[Statement]:
    """Judge the statements on the constraint of assembly, (6.12) to (6.14), by random four-bars."""
    found = assembly_arguments()
    violated = found < 0.0
    # by (6.14) at 0 and 180 deg only
    extremes = found[:, [0, 36]]
    least_inside = np.sum(found.min(axis=1) < extremes.min(axis=1) - 1e-12)
    late = np.sum(~violated[:, 0] & violated.any(axis=1))
    wrong = np.sum((extremes < 0.0).any(axis=1) != violated.any(axis=1))
    yield statement(
        "The minimum occurs when either Coswt = [+-1] whichever yields the least value [...].",
        "6.3.2, L4514",
        f"number of {SAMPLES} random four-bars, with lengths from 0.1 to 1, for which C of (6.12) is less at one "
        "of 72 crank angles than at both angles with Coswt = +-1",
        "none, since counts are exact",
        near("least elsewhere", 0.0, least_inside, 0.0),
        why="this is so for all lengths, since C contains -4 l1^2 l2^2 times the square of Coswt",
    )
    yield statement(
        "It is clear that when (a) [the kinematics solved over a complete cycle] is used time may be wasted in solving the "
        "system equations if the constraints are violated at later stages in the crank cycle. However, (b) [the constraint "
        "(6.14)] is a straightforward evaluation of a constant relation and it is clearly preferable.",
        "6.3.2, L4541-4549",
        "of the same four-bars, the number that close at the first of the 72 crank angles but not at all of them, and the "
        "number for which (6.14) and these angles disagree. Then the number of values of C that (b) needs for all these "
        "four-bars, divided by the number that (a) needs; each stops at the first negative value",
        "one is enough for *may be*; none for a disagreement; at most 1, since (b) is called preferable",
        at_least("violated at later stages", 1.0, late),
        near("(6.14) disagrees", 0.0, wrong, 0.0),
        at_most("values of C", 1.0, share_of_values(found)),
    )


def draw(result: StudyResult) -> Figure:
    """Draw the area over the error of the timed path, one mark for each linkage."""
    looks = {"printed": COLOURS[1], "ours": COLOURS[0]}
    curves, labels = [], []
    for name, marker in zip(linkages(), "osos^"):
        owner, aim = name.split("; ")
        timed, area = (result.columns[f"{name} {error} [cm2]"] for error in ("timed", "area"))
        curves.append(Curve(x=timed, y=area, line="", marker=marker, colour=looks[owner]))
        labels.append(Label(x=float(timed[0]), y=float(area[0]), text=f"{owner}, {AIMS[aim]}"))
    panel = Panel(
        x_label="sum of squared distances in time [cm$^2$]",
        y_label="area between the curves [cm$^2$]",
        curves=curves,
        labels=labels,
        logarithmic="xy",
    )
    return plot_curves([panel], title=result.heading, size=(6.4, 3.4))


#: The study by its name.
STUDIES = {"quality": Study(compute, draw)}
