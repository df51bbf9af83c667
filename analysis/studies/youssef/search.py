"""Search of section 6.3 as in the program of appendix 5, for ellipse (a) with bounds on the lengths; Fig 6.2 and 6.3.

The downhill simplex reflects its worst vertex, doubles the move if the new vertex is the best, contracts if it is poor, and
shrinks by half towards its best vertex if that does not help (L9480 to L9610). Starting sets of parameters follow (6.11). A set
outside its bounds is put onto them, and a set whose links do not close moves back by quarters (L9697). The bounds of the
lengths are printed; the bounds of place and angles are ours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import mannwhitneyu

from ...figures import COLOURS, Curve, Figure, Panel, plot_curves
from ...synthesis import RockerFunction, TargetPath, UntimedPath, area_difference, turn
from ...units import CM_PER_METRE
from ..rules import ALIKE, SMALL
from ..statements import Case, FloatArray, Statement, at_least, at_most, near, statement, unjudged
from ..study import Study, StudyResult, pad_columns, result_curves
from .chapter_6 import PRINTED, TARGET, our_error
from .problems import PROBLEMS, N, ellipse, pairing_area, rocker_angle_deg

PROBLEM = "ellipse-a-bounded"
#: Bounds of X0, Y0, l1 to l4, r (cm), a1, th20, a2 (rad).
LOW = np.array([-20.0, -20.0, 10.0, 0.1, 10.0, 10.0, 0.0, -pi, -pi, -pi])
HIGH = np.array([60.0, 60.0, 30.0, 10.0, 30.0, 30.0, 30.0, pi, pi, pi])
#: Relative difference at which a search stops, from the program (L8962); number of evaluations at which a search is given up.
EPS, MOST = 1e-2, 4000
#: Number of searches of each kind; number of known minima that a new search includes; number of points with which some searches
#: begin; indices of the parameters X0, Y0, l2, a1, th20 with which other searches begin.
SEARCHES, INCLUDED, FEWER_POINTS, FEWER = 20, 4, 12, [0, 1, 3, 7, 8]
#: Number of points, half of all, with which further searches begin.
HALF = N // 2
#: Indices of all parameters but a2, with which further searches begin.
NINE = list(range(9))
#: Number of searches of each kind whose errors and evaluations are compared by rank: twenty are too few to show a difference.
RANKED = 100
#: Bounds of a descent to a minimum: the bounds of the search, but without the angles, which are periodic.
FREE_LOW, FREE_HIGH = (np.append(bounds[:7], np.full(3, end)) for bounds, end in ((LOW, -np.inf), (HIGH, np.inf)))
#: Number of random sets from which descents begin; least difference of two minima (cm2); numbers of points for which the minima
#: are counted.
DESCENTS, APART, COUNTED = 40, 0.1, (5, FEWER_POINTS, N)
#: Number of random sets by (6.11), and probability below which a difference is not taken for chance.
SETS, CHANCE = 2000, 0.05
#: Kinds of searches: from random sets, and with minima already located among the sets.
PLAIN, KNOWN = "random sets", "with known minima"
#: Tolerances in words.
ALL, ALL_BEST = (
    f"all, to within {SMALL:g} of the {goal}'s error, the rule for *small*" for goal in ("minimum", "best end")
)
LEVEL = f"{CHANCE:g}, the usual level of significance"

Error = Callable[[FloatArray], float]


class Found(NamedTuple):
    """Result of a search: parameters, error (cm2) and number of evaluations."""

    parameters: FloatArray
    error: float
    evaluations: int


def both_closures(v: FloatArray, n: int) -> Iterator[tuple[NDArray[np.complex128], FloatArray]]:
    """Yield, for each of the two closures, the crank pin B (cm) and the coupler's angle (rad) at n crank angles."""
    l1, l2, l3, l4 = v[2:6]
    pin = l2 * np.exp(1j * (turn(n) + v[8]))
    reach = np.abs(l1 - pin)
    turned = np.arccos(np.clip((l3**2 + reach**2 - l4**2) / (2.0 * l3 * reach), -1.0, 1.0))
    for side in (1.0, -1.0):
        yield pin, np.angle(l1 - pin) + side * turned


def residuals(v: FloatArray, n: int = N, semi_axis: float = 10.0) -> tuple[FloatArray, FloatArray]:
    """Return the distances along x and y (cm) of P from n points of an ellipse, for each of the two closures.

    A closure is one of the two ways in which the links can be joined at every crank angle. ``v`` are the parameters in the
    order of `LOW`; ``semi_axis`` is the ellipse's semi-axis along x (cm), by default that of ellipse (a).
    """
    x0, y0 = v[:2]
    r, a1, _, a2 = v[6:]
    target = CM_PER_METRE * ellipse(semi_axis, n) @ np.array([1.0, 1j])
    points = (pin + r * np.exp(1j * (coupler + a2)) for pin, coupler in both_closures(v, n))
    first, second = (x0 + 1j * y0 + np.exp(1j * a1) * p - target for p in points)
    return np.concatenate([first.real, first.imag]), np.concatenate([second.real, second.imag])


def error(v: FloatArray, n: int = N, semi_axis: float = 10.0) -> float:
    """Return the sum of the squared distances (cm2) for the better of the two closures; see `residuals`."""
    return min(float(away @ away) for away in residuals(v, n, semi_axis))


def closes(v: FloatArray) -> bool:
    """Return whether the links close at all crank angles, by (6.14)."""
    l1, l2, l3, l4 = v[2:6]
    return all(4.0 * l4**2 * d**2 >= (l3**2 - l4**2 - d**2) ** 2 for d in (l1 + l2, l1 - l2))


def admit(v: FloatArray, towards: FloatArray) -> FloatArray:
    """Clip a set of parameters to its bounds; move it ``towards`` another set, a quarter each time, until its links close."""
    v = np.clip(v, LOW, HIGH)
    while not closes(v):
        v = np.clip(0.75 * v + 0.25 * towards, LOW, HIGH)
    return v


def draw_set(random: np.random.Generator) -> FloatArray:
    """Draw a random set of parameters by (6.11)."""
    return np.asarray(LOW + (HIGH - LOW) * np.sin(random.uniform(0.0, 2.0 * pi, LOW.size)) ** 2)


def starting_sets(random: np.random.Generator, first: list[FloatArray]) -> FloatArray:
    """Return starting sets, one more than there are parameters: the sets ``first``, then random sets by (6.11)."""
    sets = list(first)
    while not sets:
        sets = [v for v in [draw_set(random)] if closes(v)]
    while len(sets) <= LOW.size:
        sets.append(admit(draw_set(random), np.mean(sets, axis=0)))
    return np.array(sets)


def downhill(error_of: Error, sets: FloatArray, free: list[int] | None = None) -> Found:
    """Minimise an error by the downhill simplex from given vertices until (6.15) holds, or give up after `MOST` evaluations.

    For (6.15) each parameter is tested by itself, as in the program (L9669). ``free`` are the indices of the parameters that
    the search may change, by default all.
    """
    moves = np.arange(LOW.size) if free is None else np.array(free)
    v = sets[: moves.size + 1].copy()
    fixed = np.delete(np.arange(LOW.size), moves)
    v[:, fixed] = v[0, fixed]
    v[1:] = [admit(x, v[0]) for x in v[1:]]
    e = np.array([error_of(x) for x in v])
    count = len(e)
    while count < MOST:
        worst, least = int(e.argmax()), int(e.argmin())
        is_close = np.abs(v[worst] - v[least]) <= EPS * np.abs(v[least])
        if e[worst] - e[least] <= EPS * e[least] and is_close.all():
            break
        centre = (v.sum(axis=0) - v[worst]) / moves.size
        trial = admit(2.0 * centre - v[worst], v[worst])
        found = error_of(trial)
        count += 1
        if found < e[least]:
            far = admit(2.0 * trial - v[worst], trial)
            further = error_of(far)
            count += 1
            v[worst], e[worst] = (far, further) if further < found else (trial, found)
        elif found <= np.partition(e, -2)[-2]:
            v[worst], e[worst] = trial, found
        else:
            if found <= e[worst]:
                v[worst], e[worst] = trial, found
            trial = admit(0.5 * (centre + v[worst]), v[worst])
            found = error_of(trial)
            count += 1
            if found <= e[worst]:
                v[worst], e[worst] = trial, found
            else:
                v = np.array([admit(x, v[least]) for x in 0.5 * (v + v[least])])
                e = np.array([error_of(x) for x in v])
                count += len(e)
    return Found(v[e.argmin()], float(e.min()), count)


@cache
def searches() -> dict[str, tuple[Found, ...]]:
    """Run all searches; return their results by the kind of search."""
    random = np.random.default_rng(62)
    plain = [downhill(error, starting_sets(random, [])) for _ in range(SEARCHES)]
    fresh, fewer_points, fewer = [], [], []
    for _ in range(SEARCHES):
        included = random.choice(SEARCHES, INCLUDED, replace=False)
        fresh.append(downhill(error, starting_sets(random, [plain[i].parameters for i in included])))
        fewer_points.append(_points_first(random))
        fewer.append(_parameters_first(random))
    kinds = {PLAIN: plain, KNOWN: fresh, "12 points first": fewer_points, "5 parameters first": fewer}
    return {name: tuple(found) for name, found in kinds.items()}


@cache
def run_ranked() -> tuple[tuple[Found, ...], ...]:
    """Run the searches that are compared by rank, and return the results of each kind.

    The kinds are: from random sets; with 12 points first; with five parameters first; with nine parameters first; with 36
    points first.
    """
    random = np.random.default_rng(62)
    plain = tuple(downhill(error, starting_sets(random, [])) for _ in range(RANKED))
    points, five = zip(*((_points_first(random), _parameters_first(random)) for _ in range(RANKED)))
    nine = tuple(_parameters_first(random, NINE) for _ in range(RANKED))
    return plain, points, five, nine, tuple(_points_first(random, HALF) for _ in range(RANKED))


def rocker_error(v: FloatArray) -> float:
    """Return the error (deg2) of the rocker function of Fig 6.7: the sum of squares at N crank angles.

    The links can be joined in two ways; the error is that of the better way, the same at all crank angles.
    """
    l1, _, l3, _ = v[2:6]
    wanted, errors = rocker_angle_deg(turn(N)), []
    for pin, coupler in both_closures(v, N):
        joint = pin + l3 * np.exp(1j * coupler)
        off = (np.degrees(np.angle(joint - l1)) - wanted + 180.0) % 360.0 - 180.0
        errors.append(float(off @ off))
    return min(errors)


def _points_first(random: np.random.Generator, n: int = FEWER_POINTS) -> Found:
    """Search with ``n`` points of the ellipse first, then with all points."""
    first = downhill(lambda v: error(v, n), starting_sets(random, []))
    return _second_search(first, n / N, random)


def _parameters_first(random: np.random.Generator, free: list[int] = FEWER) -> Found:
    """Search with only the parameters ``free`` first, then with all parameters."""
    return _second_search(downhill(error, starting_sets(random, []), free), 1.0, random)


def _second_search(first: Found, share: float, random: np.random.Generator) -> Found:
    """Search again from the end of a first search, and add the evaluations of the first search.

    Each evaluation of the first search counts as ``share`` evaluations.
    """
    then = downhill(error, starting_sets(random, [first.parameters]))
    return then._replace(evaluations=then.evaluations + round(share * first.evaluations))


def descend(v: FloatArray, side: int, n: int = N) -> tuple[FloatArray, float]:
    """Return the parameters and the error (cm2) at the end of a least-squares descent with n points.

    ``side`` is the index of the closure (0 or 1) in `both_closures`.
    """
    inside = np.clip(v, FREE_LOW + 1e-9, FREE_HIGH - 1e-9)
    end = least_squares(lambda v: residuals(v, n)[side], inside, bounds=(FREE_LOW, FREE_HIGH), xtol=1e-12, ftol=1e-12)
    return end.x, 2.0 * float(end.cost)


def minimum_error(found: Found) -> float:
    """Return the error (cm2) of the minimum near the end of a search; NaN if the descent ends where the links do not close."""
    v, error = descend(found.parameters, int(np.argmin([away @ away for away in residuals(found.parameters)])))
    return error if closes(v) else np.nan


@cache
def minima(n: int) -> FloatArray:
    """Return the errors (cm2) of the minima that descents from random sets reach with n points, each multiplied by N / n.

    Minima whose errors differ by less than `APART` count once.
    """
    random = np.random.default_rng(612)
    ends = [descend(v, side, n) for v in (draw_set(random) for _ in range(DESCENTS)) for side in (0, 1)]
    errors = np.sort([error * N / n for v, error in ends if closes(v)])
    return np.asarray(errors[np.append(True, np.diff(errors) > APART)])


def compute() -> StudyResult:
    """Compute the results of all searches, and judge the statements on the search."""
    found = searches()
    columns = {"share of the searches [%]": 100.0 * (np.arange(SEARCHES) + 0.5) / SEARCHES}
    columns |= {f"error; {name} [cm2]": np.sort([end.error for end in ends]) for name, ends in found.items()}
    columns["least error [cm2]"] = np.full(SEARCHES, our_error(PROBLEM))
    return StudyResult(
        claim="The simplex starts from sets of random parameters within their bounds, and is repeated with the results among "
        "its sets.",
        assignment=f"We repeat the program of appendix 5 for ellipse (a) with bounds on the lengths, {SEARCHES} searches of "
        f"each kind, or {RANKED} where a row says so. The bounds of place, r and angles are ours. Our criterion tests the "
        "errors too, as (6.15) does (in the program this line is a comment, L9663), and each parameter by itself, as the "
        "program does.",
        columns=columns,
        statements=(
            *judge_located(found),
            judge_minima(),
            *judge_techniques(),
            judge_all_techniques(),
            judge_sets(),
            judge_time(found),
        ),
    )


def reaches_best(ends: tuple[Found, ...], plain: tuple[Found, ...], *, quickly: bool) -> NDArray[np.bool_]:
    """Return for each search whether it reaches the best end of the searches ``plain`` from random sets.

    With ``quickly`` it must also take no more evaluations than the median of ``plain``.
    """
    best = min(end.error for end in plain)
    usual = np.median([end.evaluations for end in plain]) if quickly else np.inf
    return np.array([end.error <= (1.0 + SMALL) * best and end.evaluations <= usual for end in ends])


def judge_located(found: Mapping[str, tuple[Found, ...]]) -> Iterator[Statement]:
    """Judge the statements on the minima that searches locate, and whether known minima help a new search."""
    plain = found[PLAIN]
    ends, bottoms = np.array([end.error for end in plain]), np.array([minimum_error(end) for end in plain])
    fewer = mannwhitneyu(
        *([end.evaluations for end in found[kind]] for kind in (KNOWN, PLAIN)), alternative="less"
    ).pvalue
    few = minima(COUNTED[0])
    yield statement(
        "The method stops when a convergence criterion is satisfied and is [said then] to have located a minimum[.]",
        "6.3.1, L4324",
        f"share of {SEARCHES} searches from random sets, stopped by (6.15) with the program's small number {EPS:g}, that "
        "end with the error of the minimum to which a descent with derivatives then leads",
        ALL,
        near("at a minimum", 1.0, np.mean(ends <= (1.0 + SMALL) * bottoms), 0.0),
        why="the searches stop before they reach the minimum",
    )
    yield statement(
        "It must be recognised, as in all optimisation methods, that this located minimum may not be a global minimum. It "
        "is therefore necessary to begin the optimisation from as many initial points as possible.",
        "6.3.1, L4328-4334",
        "greatest error divided by least error, first of the ends of these searches, which the thesis calls located "
        f"minima, then of the minima for {COUNTED[0]} points, found as in the row at L4345. Number of the searches that "
        f"miss the best of their ends by more than {100 * SMALL:g} %",
        f"{1.0 + ALIKE:g}, the rule for *the same*, where one case is enough for *may*; {100 * SMALL:g} %, the rule for "
        "*small*, where one search that misses is enough for *necessary*",
        at_least("ends of the searches", 1.0 + ALIKE, ends.max() / ends.min()),
        at_least(f"minima for {COUNTED[0]} points", 1.0 + ALIKE, few[-1] / few[0]),
        at_least("searches that miss the best end", 1.0, np.sum(~reaches_best(plain, plain, quickly=False))),
        why=f"with {N} points the greatest error of the minima to which descents lead from these ends is "
        f"{np.nanmax(bottoms) / np.nanmin(bottoms):.2f} times the least: the searches differ in how far from a minimum "
        "they stop",
    )
    yield statement(
        "It is found that the global optimum is always reached quickly if some of the minima already located are "
        "included as initial values in a fresh optimisation cycle.",
        "6.3.1, L4341-4345",
        f"share of {SEARCHES} fresh searches that reach the best of these ends, the thesis's global optimum (L4338); "
        "probability that they need so much fewer evaluations than those from random sets by chance (rank test). Each "
        f"search has {INCLUDED} of the ends (our number), drawn at random, among its sets",
        f"{ALL_BEST}; {LEVEL}",
        near("reached", 1.0, reaches_best(found[KNOWN], plain, quickly=False).mean(), 0.0),
        at_most("quickly; evaluations fewer by chance", CHANCE, fewer),
        why="the searches that miss it do not have it among their sets, since the simplex keeps its best set",
    )


def judge_minima() -> Statement:
    """Judge the statement on the number of minima."""
    numbers = [minima(n).size for n in COUNTED]
    apart = np.diff(minima(COUNTED[0])).min()
    return statement(
        "It is also found that the number of minima of the quality function increases with the number of specified "
        "output points.",
        "6.3.1, L4345",
        "increase of the number of minima for ellipse (a) with the number of points (our numbers). The minima are those to "
        f"which descents lead from {DESCENTS} random sets by (6.11), by either closure, with the angles free; they are "
        f"different if their errors per {N} points are more than {APART:g} cm2 apart (our choice; those found are at least "
        f"{apart:.1f} cm2 apart)",
        "at least one more, the rule for *increases*",
        *(
            at_least(f"from {few} to {many} points", 1.0, more - fewer)
            for (few, many), (fewer, more) in zip(pairwise(COUNTED), pairwise(numbers))
        ),
        why=f"there are {', '.join(map(str, numbers))} minima at {', '.join(map(str, COUNTED))} points",
    )


def judge_techniques() -> Iterator[Statement]:
    """Judge the techniques of beginning with fewer points or with fewer parameters, by rank tests."""
    plain, points, five, nine, half = (
        np.array([(end.error, end.evaluations) for end in ends]).T for ends in run_ranked()
    )

    def by_chance(technique: FloatArray, name: str) -> tuple[Case, ...]:
        """Judge whether a technique lowers the errors and the evaluations, compared with searches from random sets."""
        chances = (
            float(mannwhitneyu(improved, reference, alternative="less").pvalue)
            for improved, reference in zip(technique, plain)
        )
        return tuple(
            at_most(f"{name}; {what} by chance", CHANCE, chance)
            for what, chance in zip(("errors lower", "evaluations fewer"), chances)
        )

    yield statement(
        "A good technique is to find the optimum values of linkage parameters to yield a minimum error over a "
        "decreased number of specified output points. These values are then used again in the optimisation but this "
        "time taking all the specified output points into consideration.",
        "6.3.1, L4349-4359",
        f"rank test of {RANKED} searches that begin with {FEWER_POINTS} or {HALF} points (our numbers) against as many "
        "from random sets: probability that their errors are so much lower, and their evaluations so much fewer, by "
        f"chance. An evaluation at fewer points counts by their share of {N}",
        LEVEL,
        *by_chance(points, f"{FEWER_POINTS} points"),
        *by_chance(half, f"{HALF} points"),
        why=f"with {HALF} points the evaluations are not fewer",
    )
    yield statement(
        "Another useful technique is to perform the optimisation for a decreased number of linkage parameters and "
        "to use the values obtained in the initial guesses of the complete optimisation programme.",
        "6.3.1, L4359",
        f"rank test as at L4349, for {RANKED} searches that begin with X0, Y0, l2, alpha1 and theta20 alone, or with all "
        "ten parameters but alpha2 (our choice, since the thesis names neither which nor how many)",
        LEVEL,
        *by_chance(five, "five"),
        *by_chance(nine, "nine"),
        why="five gain nothing; with nine the errors are lower, for more evaluations",
    )


def judge_all_techniques() -> Statement:
    """Judge whether the techniques locate the global minimum quickly."""
    plain, *techniques = run_ranked()
    names = (f"{FEWER_POINTS} points first", "five parameters first", "nine parameters first", f"{HALF} points first")
    reached = ", ".join(str(reaches_best(ends, plain, quickly=False).sum()) for ends in techniques)
    return statement(
        "These techniques have, in all cases tried, located the global minimum quickly and efficiently.",
        "6.3.1, L4365-4369",
        f"share of the {RANKED} searches of each kind in the two rows before that reach the best end from random sets, the "
        "thesis's global optimum (L4338), with no more evaluations in both steps than the median from random sets",
        ALL_BEST,
        *(
            near(name, 1.0, reaches_best(ends, plain, quickly=True).mean(), 0.0)
            for name, ends in zip(names, techniques)
        ),
        why=f"in the order of the table, {reached} of {RANKED} reach it at all; which cases the thesis tried is not said, ours "
        "is one of its examples",
    )


def judge_sets() -> Statement:
    """Judge the statement on random sets by (6.11)."""
    random = np.random.default_rng(611)
    sets = np.array([draw_set(random) for _ in range(SETS)])
    return statement(
        "The remaining sets are then obtained using the following equation [(6.11)] where ... X is any real random number. "
        "This generates quickly and efficiently all the sets of required initial values and ensures that they satisfy all "
        "the explicit externally imposed constraints described in equation (6.10).",
        "6.3.1, L4377-4394",
        f"number of parameters outside their bounds in {SETS} sets by (6.11), with X uniform over a turn (our choice). Sin2X "
        "in our scan is read as the square of sin X, as in appendix 5 (L9766)",
        "none, since counts are exact",
        near("parameters outside", 0.0, np.sum((sets < LOW) | (sets > HIGH)), 0.0),
        unjudged("quickly and efficiently", "no time and no other way to obtain the sets is given"),
    )


def judge_time(found: Mapping[str, tuple[Found, ...]]) -> Statement:
    """Judge the statement on the times of compilation and of a run."""
    plain, known = ([end.evaluations for end in found[kind]] for kind in (PLAIN, KNOWN))
    chances = []
    for error_of in (rocker_error, partial(error, semi_axis=15.0)):
        # from the usual random sets
        random = np.random.default_rng(62)
        counts = [downhill(error_of, starting_sets(random, [])).evaluations for _ in range(SEARCHES)]
        chances.append(mannwhitneyu(counts, plain).pvalue)
    rocker, other = chances
    return statement(
        "The compilation time of the program is about 17 seconds and the running time depends on the form of the "
        "desired output and the quality of the initial guess of linkage parameters.",
        "6.5, L5158-5164",
        f"for the running time: probability that the numbers of evaluations of {SEARCHES} searches differ so much by chance "
        "from those of the searches from random sets above (rank test, two-sided). The searches are for the unweighted "
        "rocker function, with the same ten parameters, of which it uses five, and then for ellipse (a) with located minima "
        "among their sets",
        f"{LEVEL}; one other form and one other guess are enough for *depends*",
        at_most("form of the output", CHANCE, rocker),
        at_most("quality of the guess", CHANCE, mannwhitneyu(known, plain).pvalue),
        unjudged("compilation", "the machine, an IBM 360/67 (L1293), is not available"),
        why=f"ellipse (b) in place of (a) makes no difference beyond chance (probability {other:.2f})",
    )


def draw(result: StudyResult) -> Figure:
    """Draw the errors at the ends of the searches, in ascending order."""
    share, least = "share of the searches [%]", "least error [cm2]"
    names = [name for name in result.columns if name.startswith("error; ")]
    labels = {name: name.removeprefix("error; ").removesuffix(" [cm2]") for name in names}
    curves = result_curves(result, share, labels, marker=".")
    curves += result_curves(result, share, {least: "least error"}, colour=TARGET, line="--")
    panel = Panel(
        x_label="searches that end below, of all [%]",
        y_label="error at the end [cm$^2$]",
        curves=curves,
        logarithmic="y",
        legend_at="outside",
    )
    return plot_curves([panel], title=result.heading, size=(6.4, 3.4))


# --- 6.3: the area between curves, and the two closures

#: Change of the crank's phase (rad) under which an area must not change, and steps by which the first desired point is moved.
PHASE, FIRST = 0.6, 24


def compute_closures() -> StudyResult:
    """Compute the coupler curves by both closures, and judge the statements on the area and on the closures."""
    p = PROBLEMS["path-a"]
    shapes = {
        "target": np.asarray(target_path("path-a").points),
        "printed closure": p.linkage.path(turn(360)),
        "other closure": replace(p.linkage, branch=-1).path(turn(360)),
    }
    columns: dict[str, FloatArray] = {}
    for name, xy in shapes.items():
        columns |= {f"{name} {axis} [cm]": CM_PER_METRE * np.append(xy[:, k], xy[0, k]) for k, axis in enumerate("xy")}
    return StudyResult(
        claim="The area between curves is that of the triangles between their points. Of the two closures the better is taken.",
        assignment="The plot shows path (a) with the printed linkage.",
        columns=pad_columns(columns),
        statements=(*judge_area(), judge_closures()),
    )


def target_path(name: str) -> TargetPath:
    """Return the desired path of a problem of chapter VI."""
    task = PROBLEMS[name].task
    assert isinstance(task, UntimedPath)
    return task.path


def judge_area() -> Iterator[Statement]:
    """Judge the statements on the area between curves by triangles, and on the crank's phase."""
    phases, triangles = [], []
    for name in ("path-a", "path-b"):
        linkage, path = PROBLEMS[name].linkage, target_path(name)
        points = np.asarray(path.points)
        curve, finer = (linkage.path(turn(n * len(points))) for n in (1, 2))
        area = area_difference(curve, path)
        moved = replace(linkage, crank_phase=linkage.crank_phase + PHASE).path(turn(len(points)))
        phases.append(near(name, 1.0, area_difference(moved, path) / area, ALIKE))
        for how, actual in (("chosen", finer), ("in order", curve)):
            firsts = range(0, len(points), len(points) // FIRST)
            shares = [pairing_area(np.roll(points, -k, axis=0), actual, window=2) / area for k in firsts]
            triangles.append(near(f"{name}, {how}", 1.0, max(shares, key=lambda share: abs(share - 1.0)), ALIKE))
    same = f"{ALIKE:g}, the rule for *the same*"
    yield statement(
        "A finite approximation of this relation is obtained by taking a large and equal number of points on the "
        "desired and actual curves.",
        "6.2.2, L4230",
        "area of the triangles divided by the area between the curves, with 360 points on each, for the printed "
        "linkages, mended. The actual points are chosen from 720 (our number) with ICP = 2 (L8973), or paired in order "
        f"(L9894-9898). Of {FIRST} first points, {360 // FIRST} deg apart, the ratio farthest from 1 is listed",
        same,
        *triangles,
        why="paired in order, partners lie far apart with some of the first points",
    )
    yield statement(
        "The linkage parameters sufficient for the optimisation in coupler path generation are the same as "
        "mentioned earlier for coupler function generation although the parameter [theta20] is redundant; in this "
        "case, it will be retained to maintain a consistency in presentation of results.",
        "6.4.1, L4696",
        f"area with theta20 greater by {PHASE:g} rad, divided by the area as printed, for the printed linkages, mended; number "
        "of the three linkages printed for paths that retain theta20. That the parameters suffice follows from (6.17)",
        f"{same}; none for the number",
        *phases,
        near("linkages with theta20", 3.0, 2.0, 0.0),
        why="the linkage of the packaging machine has no theta20 (L5127)",
    )


def judge_closures() -> Statement:
    """Judge the statement on the two closures."""
    paths = [p for p in PROBLEMS.values() if not isinstance(p.task, RockerFunction)]
    ratios = [p.linkage_error(replace(p.linkage, branch=-p.linkage.branch)) / p.linkage_error(p.linkage) for p in paths]
    branches = [p.linkage.branch for p in paths]
    return statement(
        "Therefore in evaluating the quality function we must explore both closures and note the closure "
        "corresponding to the minimum error in output generation.",
        "6.4.1, L4804",
        "error by the other closure divided by that by the better one, the least ratio of the printed linkages with a "
        "coupler point, mended; for the packaging machine by the ten points of the program (L9021). Then the number of "
        "these linkages with each closure as the better one",
        f"at least {1.0 + ALIKE:g}, more than *the same*; one linkage of each closure is enough for *must explore both*",
        at_least("other closure over the better", 1.0 + ALIKE, min(ratios)),
        at_least("linkages with C to the left of BD", 1.0, branches.count(1)),
        at_least("linkages with C to the right of BD", 1.0, branches.count(-1)),
    )


def draw_closures(result: StudyResult) -> Figure:
    """Draw the target and the coupler curves of both closures."""
    looks = {"target": TARGET, "printed closure": PRINTED, "other closure": COLOURS[2]}
    c = result.columns
    curves = [Curve(x=c[f"{n} x [cm]"], y=c[f"{n} y [cm]"], label=n, colour=colour) for n, colour in looks.items()]
    panel = Panel(x_label="x [cm]", y_label="y [cm]", curves=curves, equal=True, legend_at="outside")
    return plot_curves([panel], title=result.heading, size=(6.4, 3.4))


#: The studies by number.
STUDIES = {"6.2": Study(compute, draw), "6.3": Study(compute_closures, draw_closures)}
