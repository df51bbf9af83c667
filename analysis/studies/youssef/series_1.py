"""Series 1 of chapter VII: a moving slider keeps the coupler point near a desired curve at every crank angle.

The desired curve is lost with its figure. Our own curve, in Fig 7.4, shows how the methods work, but no statement is judged by
it. The variational motion (a) is nearest to the curve at every crank angle, but it has two vertical tangents, which no slider
can follow at speed. The direct search with eleven terms (b) has no vertical tangent; its squared error is an eighth greater.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from math import degrees, radians
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...numerics.fourier import FourierSeries
from ...slider import VariationalMotion, slider_motion, variational_motion
from ...synthesis import MachineSpec, Search, SliderUnknown, Solution, TimedPath, turn
from ...youssef import accessible
from ..statements import FloatArray, Statement, at_least, at_most, near, statement, unjudged
from ..study import Study, StudyResult, pad_columns
from .chapter_7 import FAMILY, LINKAGE, TARGET, TURN, coupler_point, path_curve, plane, pointing_positions, slider, xy

ComplexArray = NDArray[np.complex128]

#: Crank angles of the desired points, and a mask of the points on p1 p2.
ROTATION = turn(72)
P1, P2 = radians(150.0), radians(210.0)
WITHIN = (ROTATION > P1 - 1e-9) & (ROTATION < P2 + 1e-9)
#: Weight on p1 p2, relative to 1 elsewhere; number of harmonics in a series of eleven terms.
WEIGHT, HARMONICS = 5.0, 5
SERIES_1 = "The desired curve is ours, see Fig 7.4."
LOST = "the desired curve is lost with its figure"
#: Slider positions u of Fig 7.5 (l3).
POSITIONS = np.linspace(-3.0, 3.0, 24001)
#: Least sine of the angle of a rocker that is called upright.
UPRIGHT = 0.999


def desired_points(rotation: FloatArray = ROTATION) -> ComplexArray:
    """Return the desired points: P at U = 0.8 + 0.4 |sin th2|, with 0.05 sin th2 rad added to the crank rotation."""
    return coupler_point(rotation + 0.05 * np.sin(rotation), 0.4 * np.abs(np.sin(rotation)) - 0.2)


def task(weights: ArrayLike | None = None) -> TimedPath:
    """Return the desired points as a synthesis task."""
    return TimedPath(points=np.column_stack([desired_points().real, desired_points().imag]), weights=weights)


@cache
def variational(n: int = 72) -> VariationalMotion:
    """Return the variational motion: the slider positions of least error at n crank rotations."""
    wanted = desired_points(turn(n))
    return variational_motion(LINKAGE, turn(n), np.column_stack([wanted.real, wanted.imag]))


@cache
def search_directly(weight: float = 1.0) -> Solution:
    """Return the best series of eleven terms of the slider motion by the direct search, with a weight on p1 p2."""
    unknown = SliderUnknown(harmonics=HARMONICS, guide_angle=(0.0, 0.0))
    return slider_motion(task(np.where(WITHIN, weight, 1.0)), LINKAGE, unknown, search=Search(starts=4)).best


def squared_errors(found: Solution) -> tuple[float, float]:
    """Return the sums of the squared errors on p1 p2 and elsewhere."""
    squares = found.evaluation.errors**2
    return float(squares[WITHIN].sum()), float(squares[~WITHIN].sum())


def all_terms_excess(curves: int = 20, seed: int = 11) -> float:
    """Return the greatest value of e_F / e_V - 1 over random desired curves.

    e_F and e_V are the sums of squared errors of a Fourier series and of the variational motion. The series has as many terms
    as there are points and interpolates the variational motion. The desired curves are points scattered about random positions
    of P.
    """
    # off the axis, where the slider can come below the crank pin and the links then have no direction
    random, steps, found = np.random.default_rng(seed), turn(73), []
    rotation = steps + 0.02
    for _ in range(curves):
        places = coupler_point(rotation, random.uniform(-0.3, 0.3, rotation.size))
        wanted = places + 0.1 * (random.normal(size=rotation.size) + 1j * random.normal(size=rotation.size))
        best = variational_motion(LINKAGE, rotation, np.column_stack([wanted.real, wanted.imag]))
        u = FourierSeries.from_samples(best.u)(steps)
        found.append(float((np.abs(coupler_point(rotation, u) - wanted) ** 2).sum() / best.squared_error - 1.0))
    return max(found)


def vertical_tangents() -> list[float]:
    """Return the crank angles (deg) at which the square root in (7.14) is zero, so that U has a vertical tangent."""

    def square(angle: float) -> float:
        at = np.array([angle])
        return float(pointing_positions(at, desired_points(at))[1][0])

    return [
        degrees(brentq(square, *ends)) for ends in pairwise(TURN.tolist()) if square(ends[0]) * square(ends[1]) < 0.0
    ]


def solve_slider_equations(rotation: FloatArray, target: ComplexArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Solve eq (7.14) for U with both signs of its square root, or (7.15) where (7.14) has no real root.

    Returns U, shape (n, 2), and a mask of the points where (7.15) is used.
    """
    l2, l3, l4 = LINKAGE.crank_length, LINKAGE.coupler_length, LINKAGE.rocker_length
    first, square = pointing_positions(rotation, target)
    upright = square < 0.0
    # (7.15), the rocker at th4 = 90 deg
    second = l2 * np.cos(rotation)
    other = second**2 - (l2**2 + l4**2 - l3**2 - 2.0 * l2 * l4 * np.sin(rotation))
    centre, root = np.where(upright, second, first), np.sqrt(np.where(upright, other, square))
    return np.column_stack([centre + root, centre - root]), upright


def curve_wanted() -> StudyResult:
    """Compute Fig 7.4: the desired curve, and whether P can reach its points."""
    z = desired_points()
    reached = accessible(
        MachineSpec().sliding_five_bar(LINKAGE), (FAMILY[0] - 1.0 - 1e-9, FAMILY[-1] - 1.0 + 1e-9), z.real, z.imag
    )
    columns = {"crank rotation [deg]": np.degrees(ROTATION), **xy("desired", z)}
    for u in (FAMILY[0], FAMILY[-1]):
        columns |= xy(f"U = {u:g}", coupler_point(TURN, u - 1.0))
    assert reached.all()
    return StudyResult(
        claim="The desired curve is given by numbers, depends on time, and lies within the family of Fig 7.2.",
        assignment="The curve is lost. Ours consists of the places of P at U = 0.8 + 0.4 |sin th2| with the crank 0.05 sin th2 "
        "rad ahead, at 72 crank angles; p1 p2 is the part from 150 to 210 deg.",
        columns=pad_columns(columns),
        statements=(
            statement(
                "It is time dependent and is obtained from within the envelope shown in Fig. (7.2).",
                "7.3.1, L5569",
                why="the figure is lost, and no number of it is in the text",
            ),
        ),
    )


def draw_wanted(result: StudyResult) -> Figure:
    """Draw the desired points between the outermost coupler curves of the family."""
    z = desired_points()
    marks = {"p1": int(np.argmax(WITHIN)), "p2": int(np.nonzero(WITHIN)[0][-1])}
    curves = [
        path_curve(result, f"U = {u:g}", f"U = {u:g}", colour=colour, width=0.9)
        for u, colour in zip((FAMILY[0], FAMILY[-1]), (COLOURS[0], COLOURS[4]))
    ]
    curves.append(path_curve(result, "desired", "desired", colour=TARGET, line="", marker="."))
    for (name, k), marker in zip(marks.items(), "os"):
        curves.append(Curve(x=[z[k].real], y=[z[k].imag], label=name, line="", marker=marker, colour=COLOURS[1]))
    return plot_curves([plane(curves)], title=result.heading, size=(6.6, 4.4))


def least_distance(rotation: float, target: complex) -> tuple[float, float]:
    """Return the least distance of P from a target at a crank rotation, over the slider `POSITIONS` and both assemblies.

    The second result is the distance that P moves from this nearest point to the adjacent slider position.
    """
    crank, found = np.full(POSITIONS.size, rotation), []
    for branch in (1, -1):
        path = replace(LINKAGE, branch=branch).path(crank, (POSITIONS, np.zeros_like(POSITIONS))) @ np.array([1.0, 1j])
        distance = np.abs(path - target)
        k = int(np.nanargmin(distance))
        found.append((float(distance[k]), float(np.nanmax(np.abs(path[[k - 1, k + 1]] - path[k])))))
    return min(found)


def two_positions() -> StudyResult:
    """Compute Fig 7.5: both positions of the rocker at a crank angle. Judge (7.14) and (7.15) with random points."""
    found, (u, _) = variational(), solve_slider_equations(ROTATION, desired_points())
    k = 60
    pin = LINKAGE.crank_length * np.exp(1j * ROTATION[k])
    joint = pin + LINKAGE.coupler_length * np.exp(1j * np.angle(desired_points()[k] - pin))
    columns = {"crank rotation [deg]": np.degrees(ROTATION), "U [l3]": found.u + 1.0}
    columns |= xy("links", np.array([0.0, pin, joint])) | xy("desired", desired_points()[[k]])
    for name, end in zip(("U1", "U2"), u[k]):
        columns |= xy(name, np.array([joint, end + 0j]))
    return StudyResult(
        claim="The coupler points at the desired point, with the rocker in either of two positions; otherwise the rocker is "
        "upright.",
        assignment=f"{SERIES_1} The figure is drawn with the crank at {degrees(ROTATION[k]):.0f} deg. The statements are "
        f"judged with {ROTATION.size} random points, one for every {360 / ROTATION.size:g} deg of the crank, no "
        "farther from A than l3 along either axis.",
        columns=pad_columns(columns),
        statements=tuple(_positions()),
    )


def _upright_errors(rotation: FloatArray, places: ComplexArray) -> FloatArray:
    """Return how close (in units of l3) P comes to each point with the rocker upright, by (7.15); NaN if out of reach."""
    pins = LINKAGE.crank_length * np.exp(1j * rotation)[:, None]
    with np.errstate(invalid="ignore"):
        arms = solve_slider_equations(rotation, places)[0] + 1j * LINKAGE.rocker_length - pins
    reached = pins + LINKAGE.point_distance / LINKAGE.coupler_length * arms
    return np.asarray(np.abs(reached - places[:, None]).min(axis=1))


def _positions() -> Iterator[Statement]:
    """Judge (7.14) and (7.15) with random points."""
    targets = np.random.default_rng(75).uniform(-1.0, 1.0, (ROTATION.size, 2))
    places = targets @ np.array([1.0, 1j])
    missing = pointing_positions(ROTATION, places)[1] < 0.0
    pins = LINKAGE.crank_length * np.exp(1j * ROTATION)
    least, moved = np.transpose([least_distance(*at) for at in zip(ROTATION.tolist(), places.tolist())])
    off = np.abs(np.abs(places - pins) - LINKAGE.point_distance)[~missing] - least[~missing]
    anywhere = variational_motion(LINKAGE, ROTATION, targets, assemblies=(1, -1), closed=False)
    upright = np.sin(anywhere.rocker_angle[missing])
    above, standing = targets[missing, 1] > 0.0, upright > UPRIGHT
    pointing = (places - pins)[missing]
    heights = (
        np.abs((pins[missing] + LINKAGE.coupler_length * pointing / np.abs(pointing)).imag) / LINKAGE.rocker_length
    )
    by_7_15 = _upright_errors(ROTATION[missing], places[missing]) - least[missing]
    fine = "1e-3 l3: near the least error, P moves by at most {:.2g} l3 from one slider position to the next"
    lines = [
        f"{side.sum()} points {where}" for side, where in ((above, "above the slider's line"), (~above, "below it"))
    ]
    hangs = "below the line the rocker hangs, and no upright rocker can be assembled"
    yield statement(
        "[Equation (7.12)] corresponds to the relation that for minimum error the coupler takes the position of a "
        "straight line with the point p(x*, y*).",
        "7.3.1, L5628",
        f"error with the coupler pointing at the point minus the least error of {POSITIONS.size} slider positions (u "
        f"from {POSITIONS[0]:g} to {POSITIONS[-1]:g} l3) and both assemblies: the greatest difference at the {off.size} "
        "points where (7.14) has a real root",
        fine.format(moved[~missing].max()),
        at_most("greatest difference", 1e-3, off.max(), "l3"),
    )
    yield statement(
        "If the argument of the square root term in (7.14) is negative then [(7.11a)] is not true and [(7.11b)] is the "
        "correct solution of [(7.10b)]. In physical reality this is equivalent to the coupler being in a straight line "
        "with the desired point, then no matter how the rocker CD is positioned, point D never lies on U.",
        "7.3.1, L5675-5685",
        f"at the {standing.size} points where it is negative: least distance of C from the slider's line, relative to "
        "l4, with the coupler pointing at the point. Then, at the least error, the share of rockers perpendicular to "
        f"the line, as (7.11b), cos th4 = 0, says: size of sin th4 above {UPRIGHT:g}",
        "more than 1, since a rocker of length l4 then does not reach the line; none for the share",
        at_least("distance of C", 1.0, heights.min()),
        near("cos th4 = 0", 1.0, np.mean(np.abs(upright) > UPRIGHT), 0.0),
    )
    yield statement(
        "In these circumstances the optimum condition must surely be when the rocker CD is upright, i.e. [theta4 = "
        "pi/2] and the value of U is recomputed from (7.7) to give [(7.15)].",
        "7.3.1, L5685",
        f"at the {standing.size} points where (7.14) has no real root: share of upright rockers, sin th4 > {UPRIGHT:g}, "
        "at the least error. Then the greatest difference between the error with the better U of (7.15) and the least "
        "error of the slider positions above",
        f"none for the share, as *must surely be* says; {fine.format(moved[missing].max())}",
        near(f"upright, the {lines[0]}", 1.0, standing[above].mean(), 0.0),
        near(f"upright, the {lines[1]}", 1.0, standing[~above].mean(), 0.0, why=hangs),
        at_most("error by (7.15), above the line", 1e-3, by_7_15[above].max(), "l3"),
    )
    yield statement(
        "Now since a true global optimum may be found readily at first trial from the variational method, one may "
        "argue the philosophy behind the use of any other method.",
        "7.3.1, L5772-5776",
        "share of the points at which U gives the least error of the slider positions above. U is solved once by "
        "(7.14), or is the better U of (7.15) where (7.14) has no real root",
        f"{fine.format(moved.max())}; none for the share",
        at_least(f"(7.14), {off.size} points", 1.0, np.mean(off <= 1e-3)),
        at_least(
            f"(7.15), {standing.size} points",
            1.0,
            np.mean(by_7_15 <= 1e-3),
            why="below the slider's line (7.15) has no real U",
        ),
        why="*one may argue* is not judged, since it claims nothing",
    )


def draw_positions(result: StudyResult) -> Figure:
    """Draw the crank, the coupler, both rockers, the desired point, and the line of the slider."""
    reach = [result.columns[f"{name} x [l3]"][1] for name in ("U1", "U2")]
    curves = [
        Curve(x=[min(0.0, *reach) - 0.1, max(reach) + 0.1], y=[0.0, 0.0], colour="0.6", line=":"),
        path_curve(result, "links", "crank and coupler", colour="0.25", marker="o"),
        path_curve(result, "U1", "rocker at U1", colour=COLOURS[0], marker="o"),
        path_curve(result, "U2", "rocker at U2", colour=COLOURS[1], marker="o", line="--"),
        path_curve(result, "desired", "desired point", colour=COLOURS[2], marker="s", line=""),
    ]
    return plot_curves([plane(curves)], title=result.heading, size=(6.6, 3.6))


# Motions (a) and (b), unweighted (Fig 7.6 to 7.8) and with p1 p2 weighted (Fig 7.9, 7.10)

MOTIONS = {"variational": "(a) variational", "direct": "(b) eleven terms", "weighted": "eleven terms, p1 p2 weighted"}


@cache
def columns_of_motions() -> dict[str, FloatArray]:
    """Return U, the error and the path of each slider motion, and the desired points, as columns."""
    fine = variational(720)
    u = {"variational": np.append(fine.u, fine.u[0])}
    errors = {"variational": variational().error}
    for name, found in (("direct", search_directly()), ("weighted", search_directly(WEIGHT))):
        u[name], errors[name] = slider(found.linkage).series(TURN), found.evaluation.errors
    columns = {"rotation [deg]": np.degrees(TURN), "points' rotation [deg]": np.degrees(ROTATION)}
    for name in u:
        columns |= {
            f"U {name} [l3]": u[name] + 1.0,
            f"error {name} [l3]": errors[name],
            **xy(name, coupler_point(TURN, u[name])),
        }
    return pad_columns(columns | xy("desired", desired_points()))


def _unweighted() -> Iterator[Statement]:
    """Return the statements on Fig 7.6 to 7.8."""
    vertical = " and ".join(f"{at:.1f}" for at in vertical_tangents())
    excess = search_directly().error / variational().squared_error
    yield statement(
        "Different initial guesses of the coefficients produced different optima.",
        "7.3.1, L5743",
        why=f"{LOST}, and the guesses are not printed",
    )
    yield statement(
        "The variational method located the true global optimum which the direct search located as best as an "
        "eleven-term Fourier series could provide.",
        "7.3.1, L5764",
        why=f"{LOST}. With ours, the best eleven terms have {excess:.2f} times the squared error of the variational motion",
    )
    yield statement(
        "If an infinite number of terms were used the direct search would have led to the variational results.",
        "7.3.1, L5768",
        "squared error of the series with as many terms as there are desired points, divided by that of the variational "
        "method, less 1. This series takes the variational U at each point. The greatest value for 20 random curves of "
        "73 points (our choice)",
        "1e-9, for rounding errors",
        at_most("the best series", 1e-9, all_terms_excess()),
        unjudged("the series found", "no search has infinitely many coefficients"),
    )
    yield statement(
        "By studying curve (a) of Fig. (7.6) we find it very difficult, if not impossible, to accomplish at high speeds "
        "while curve (b) of the same figure is a more feasible task.",
        "7.3.1, L5789",
        why=f"{LOST}; with ours (a) has a vertical tangent at {vertical} deg, where its velocity has no bound",
    )
    yield statement(
        "The variational method requires the solution of (n+m) non-linear equations. In many cases this entails a far "
        "greater effort than would otherwise be needed with a direct search. In fact, in some cases, the direct search "
        "method is required to solve these equations.",
        "7.3.1, L5883-5891",
        "number of equations for this mechanism: three by (7.6), for theta3, theta4 and U, and the two of the closure (7.7)",
        "none, since counts are exact",
        replace(near("equations", 5.0, 3 + 2, 0.0), stated="n + m"),
        unjudged("effort", "the effort of neither method is stated"),
        unjudged("direct search required", "no such case is given"),
        why="one of the five, (7.10c), is linear: lambda1 = 0. The thesis then solves them one after another (L5607-5640). "
        "We read *non-linear* as said of the set",
    )


def _weighted() -> Iterator[Statement]:
    """Return the statements on Fig 7.9 and 7.10."""
    inside, outside = (
        new / old for new, old in zip(squared_errors(search_directly(WEIGHT)), squared_errors(search_directly()))
    )
    yield statement(
        "The direct search permits an easier use of stricter error conditions or constraints at some portion of a desired "
        "function.",
        "7.3.1, L5797-5799",
        why="there is no measure of *easier*",
    )
    yield statement(
        "It is clearly seen from Fig. (7.10) how a close generation of range [p1p2] is accomplished while larger errors "
        "are tolerated outside it.",
        "7.3.1, L5834",
        why=f"{LOST}. With ours, the weight changes the squared error on p1 p2 by a factor of {inside:.2f}, and on the "
        f"rest by a factor of {outside:.2f}",
    )
    yield statement(
        "Another interesting point is that if the requirements outside [p1p2] are very relaxed the controller motion U "
        "involved there, may be modified further to give a more favourable dynamic condition.",
        "7.3.1, L5838",
        why="there is no measure of *very relaxed* and *more favourable*",
    )


def draw_motions(result: StudyResult, names: tuple[str, ...], what: str) -> Figure:
    """Draw U or the error of the motions over the crank rotation, or draw their paths."""
    c = result.columns
    look = {name: {"label": MOTIONS[name], "colour": colour} for name, colour in zip(MOTIONS, COLOURS)}
    if what == "paths":
        target = path_curve(result, "desired", "desired", colour=TARGET, line="", marker=".")
        curves = [target, *(path_curve(result, name, **look[name]) for name in names)]
        ends = np.nonzero(WITHIN)[0][[0, -1]]
        z = desired_points()[ends]
        curves.append(Curve(x=z.real, y=z.imag, label="p1 and p2", line="", marker="s", colour=COLOURS[3]))
        return plot_curves([plane(curves)], title=result.heading, size=(6.6, 4.2))
    x = c["rotation [deg]" if what == "U" else "points' rotation [deg]"]
    panel = Panel(
        x_label="crank rotation [deg]",
        y_label="U / l3" if what == "U" else "distance from the desired point / l3",
        curves=[Curve(x=x, y=c[f"{what} {name} [l3]"], **look[name]) for name in names],  # type: ignore[arg-type]
        verticals={"p1": degrees(P1), "p2": degrees(P2)},
        x_ticks=range(0, 361, 60),
        legend_at="outside",
    )
    return plot_curves([panel], title=result.heading, size=(7.6, 3.4))


class Motions(NamedTuple):
    """Figure of slider motions: its claim, the motions, the drawn quantity, the statements, and our choices.

    ``see`` is the number of the figure that judges the statements, if they are not given here.
    """

    claim: str
    names: tuple[str, ...]
    what: str
    statements: Callable[[], Iterable[Statement]] = tuple
    see: str = ""
    assignment: str = SERIES_1


TABLE = {
    "7.6": Motions(
        "The variational motion comes as near to the curve as U allows; eleven terms come near this motion and can be "
        "followed at speed.",
        ("variational", "direct"),
        "U",
        _unweighted,
    ),
    "7.7": Motions("The error of the variational motion is least.", ("variational", "direct"), "error", see="7.6"),
    "7.8": Motions(
        "The output curves of both methods, superimposed on the desired curve.",
        ("variational", "direct"),
        "paths",
        see="7.6",
    ),
    "7.9": Motions(
        "With p1 p2 weighted five times, the slider moves differently.",
        ("direct", "weighted"),
        "U",
        _weighted,
        assignment=f'{SERIES_1} The weight reads "=. 5w 2" in the scan (L5815): we take {WEIGHT:g}, since p1 p2 is '
        "to be the closer part (L5807).",
    ),
    "7.10": Motions(
        "The weighted part p1 p2 is traced more closely, the rest less so.", ("direct", "weighted"), "paths", see="7.9"
    ),
}


def compute(number: str) -> StudyResult:
    """Compute the slider motions of a figure."""
    row = TABLE[number]
    return StudyResult(
        claim=row.claim,
        assignment=row.assignment,
        columns=columns_of_motions(),
        statements=tuple(row.statements()),
        see=row.see,
    )


#: The studies by number.
STUDIES = {"7.4": Study(curve_wanted, draw_wanted), "7.5": Study(two_positions, draw_positions)} | {
    number: Study(partial(compute, number), partial(draw_motions, names=row.names, what=row.what))
    for number, row in TABLE.items()
}
