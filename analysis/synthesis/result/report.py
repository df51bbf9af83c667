"""Compute the effect of each dimension on the error and the cost of rounding the dimensions; write the text report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, inf, isfinite, log10, pi, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ...units import ROUNDING
from ..linkage.kernels import PLACES
from ..linkage.linkage import (
    ANGLES,
    LENGTHS,
    LINKS,
    FiveBar,
    Linkage,
    SecondCrank,
    SliderCrank,
    SliderMotion,
    format_ratio,
    wrap_angles,
)
from ..linkage.machine import dead_centres, mechanical_advantage, time_ratio, toggles
from ..task import task as tasks
from ..task.constraint import SECOND_LENGTH, stroke
from .solution import (
    CLOSELY,
    CURVE,
    Solution,
    Verdicts,
    evaluate,
    format_variants,
    nearest_rotations,
    path_rate,
    whole_turn,
)

FloatArray = NDArray[np.float64]
#: Steps to which dimensions are rounded (m, rad): 0.1 mm, or less for small links (see `length_step`), and 0.1 degrees.
LENGTH_STEP, ANGLE_STEP = 1e-4, radians(0.1)
#: Names of the dimensions of a moving pivot that are angles.
PIVOT_ANGLES = ("guide_angle", "second_crank_phase")
#: Error relative to the target above which a solution is called poor; improvement to suggest for each kind of linkage.
POOR = 0.05
_IMPROVEMENTS = {
    "four-bar": "a geared five-bar (search.kinds) or a moved rocker pivot has more dimensions to fit it",
    "slider-crank": "a four-bar or a geared five-bar (search.kinds) has more dimensions to fit it",
    "geared-five-bar": "other ratios of its gears (search.gears), or a smoother or smaller target, may do better",
}
#: Step of the finite differences of exact derivatives, in rad or relative to the longest link.
DIFFERENCE = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rounding:
    """The cost of rounding the dimensions.

    Attributes
    ----------
    linkage : Linkage
        The rounded linkage, in which each link is at least one step long. The Fourier coefficients of the motion of a slider
        or a second crank are not rounded.
    error : float
        Quality function of the rounded linkage.
    expected : float
        Mean quality function if the dimensions have random errors, uniformly distributed within half a step to either side.
        For a sum of squares the mean is computed to second order, from exact first and finite-difference second derivatives
        of the errors. For an area the distances are taken as normally distributed. Infinite if derivatives do not exist.
    """

    linkage: Linkage
    error: float
    expected: float


def length_step(linkage: Linkage) -> float:
    """Return the step to which lengths are rounded (m): 0.1 mm, or less for a link below 1 mm."""
    least = min(getattr(linkage, name) for name in LINKS if _is_link(linkage, name))
    return min(LENGTH_STEP, float(10.0 ** np.floor(log10(0.1 * least) + 1e-9)))


def _residuals(
    linkage: Linkage, normal: tasks.Normal, rotation: FloatArray, across: bool
) -> tuple[FloatArray, FloatArray]:
    """Compute the derivatives of the m residuals by the k dimensions, (m, k), and the residuals, (m,), at rotations.

    The residuals of points come first, then the residuals of angles. The residuals of points are in x and y or, if ``across``,
    along the normals of the curve.
    """
    columns = [column for _, _, column in _pivot_dimensions(linkage, rotation)]
    angular = normal.angle is not None
    parts, blocks = [], []
    if normal.points is not None:
        points = normal.places
        place, jacobian = linkage.path_jacobian(rotation)
        left = place @ np.array([1.0, 1j]) - points
        both = jacobian[:, 0] + 1j * jacobian[:, 1]
        still = [np.zeros(len(rotation), dtype=complex)] if angular else []
        whole = np.vstack([both[: len(PLACES)], *still, *[bx * both[10] + by * both[11] for bx, by in columns]]).T
        if linkage.point_is_pin:
            # the coupler point is the pin C: the coupler's length moves it
            whole[:, PLACES.index("coupler_length")] += whole[:, PLACES.index("point_distance")]
        if across:
            rate = path_rate(linkage, rotation, both)
            normals = 1j * rate / np.abs(rate)
            parts, blocks = [(left * normals.conj()).real], [(whole * normals.conj()[:, None]).real]
        else:
            parts, blocks = [left.real, left.imag], [whole.real, whole.imag]
    if angular:
        which = 1 if normal.of_rocker else 0
        angles, jacobian = linkage.link_jacobian(rotation)
        turned = 0.0 if normal.of_rocker else linkage.ground_angle
        left_angle = angles[which] + linkage.output_angle + turned - normal.angle
        moved = [bx * jacobian[10, which] + by * jacobian[11, which] for bx, by in columns]
        own = np.vstack([jacobian[: len(PLACES), which], np.ones(len(rotation)), *moved]).T
        if not normal.of_rocker:
            own[:, PLACES.index("ground_angle")] += 1.0
        leverage = normal.leverage * normal.unit
        parts.append(leverage * wrap_angles(left_angle))
        blocks.append(leverage * own)
    return np.vstack(blocks), np.concatenate(parts)


def displacements(solution: Solution) -> dict[str, float]:
    """Compute how far each dimension, by name, moves the output: the rms displacement of the traced point per unit (m or rad).

    For a rocker function the result is the change of its angle (rad). For a motion the rotation of the body, times
    `Motion.length`, is included. For an untimed path, whose crank rotations adapt to the dimension, the displacement is across
    the curve.
    """
    task, linkage = solution.task, solution.linkage
    normal = tasks.normal_form(task)
    jacobian, _ = _residuals(linkage, normal, solution.station_rotations(), isinstance(task, tasks.UntimedPath))
    moved = np.sqrt((jacobian**2).sum(axis=0) / normal.n)
    # a rocker's angle depends neither on the position of the linkage nor on its coupler point
    idle = set(PLACES) - {*LINKS, "crank_phase"} if normal.of_rocker else set(linkage.absent_dimensions)
    return {name: float(off) for name, off in zip(_names(linkage, normal), moved) if name not in idle}


def round_dimensions(solution: Solution, length: float | None = None, angle: float = ANGLE_STEP) -> Rounding:
    """Round lengths and angles to whole steps, and compute the increase of the error.

    Parameters
    ----------
    length, angle : float
        Steps (m, rad); `length_step` and 0.1 degrees by default.

    Raises
    ------
    InputError
        If a step is not above zero.
    """
    length = length_step(solution.linkage) if length is None else length
    for what, step in (("length", length), ("angle", angle)):
        if not (np.isfinite(step) and step > 0.0):
            raise InputError(f"step of {what} is {step}: it must be greater than zero")
    linkage = solution.linkage
    steps = {name: angle if name in (*ANGLES, *PIVOT_ANGLES) else length for name in _manufactured_dimensions(linkage)}
    rounded = linkage
    for name, value in _manufactured_dimensions(linkage).items():
        whole = round(value / steps[name])
        # a link is not rounded to zero
        rounded = _replace_dimension(rounded, name, steps[name] * (max(whole, 1) if _is_link(linkage, name) else whole))
    error = evaluate(solution.task, rounded, solution.evaluation.rotation).error
    return Rounding(linkage=rounded, error=error, expected=_expected_error(solution, steps))


def _expected_error(solution: Solution, steps: Mapping[str, float]) -> float:
    """Return the mean quality function for random errors within half a step of each dimension; see `Rounding.expected`."""
    task, linkage = solution.task, solution.linkage
    area = isinstance(task, tasks.UntimedPath) and task.measure == "area"
    if isinstance(task, tasks.UntimedPath) and area:
        # at least as many stations as the evaluation has points
        task = replace(task, samples=max(task.samples, CURVE))
    normal = tasks.normal_form(task)
    given = normal.rotation if normal.rotation is not None else solution.evaluation.rotation
    names = _names(linkage, normal)

    def residuals(made: Linkage) -> tuple[FloatArray, FloatArray]:
        at = given
        if isinstance(task, tasks.UntimedPath):
            # the crank rotations adapt to the changed dimension
            at = nearest_rotations(made, normal.places, *solution.traced_range())
        assert at is not None
        return _residuals(made, normal, at, isinstance(task, tasks.UntimedPath))

    jacobian, left = residuals(linkage)
    square, shift = np.zeros(len(left)), np.zeros(len(left))
    for name, step in steps.items():
        if name not in names:
            continue
        k, variance = names.index(name), step**2 / 12.0
        square += variance * jacobian[:, k] ** 2
        if area:
            continue
        small = DIFFERENCE * (1.0 if name in (*ANGLES, *PIVOT_ANGLES) else linkage.largest_link)
        value = _manufactured_dimensions(linkage)[name]
        if _is_link(linkage, name):
            small = min(small, 0.1 * value)
        ahead, behind = (
            residuals(_replace_dimension(linkage, name, value + side * small))[0][:, k] for side in (1.0, -1.0)
        )
        shift += 0.5 * variance * (ahead - behind) / (2.0 * small)
    if area:
        # an area: each distance is a normal variable, with its value as the mean and its spread as the standard deviation
        grown = normal.weights * normal.arc * normal.unit @ (_mean_absolute(left, np.sqrt(square)) - np.abs(left))
    else:
        weights = np.tile(normal.weights, len(left) // normal.n)
        grown = weights @ (square + 2.0 * left * shift)
    return solution.error + float(grown) if np.isfinite(grown) else inf


def costs(solution: Solution, length: float, angle: float) -> dict[str, float]:
    """Compute, for each dimension, how much an error of one step in the worse direction increases the quality function.

    The changed linkages are evaluated, so that steps may have any size. The increase is infinite if the links cannot be joined.

    Parameters
    ----------
    length, angle : float
        Steps (m, rad).

    Returns
    -------
    dict
        Increase of the quality function by name of the dimension, without guide angle and Fourier coefficients of a motion.
    """
    linkage, grown = solution.linkage, {}
    for name, value in _manufactured_dimensions(linkage).items():
        if name == "guide_angle":
            continue
        step = angle if name in (*ANGLES, *PIVOT_ANGLES) else length
        # a link must stay longer than zero
        link = _is_link(linkage, name)
        ends = [value + side * step for side in (-1.0, 1.0) if not link or value + side * step > 0.0]
        grown[name] = max(
            evaluate(solution.task, _replace_dimension(linkage, name, end), solution.evaluation.rotation).error
            for end in ends
        )
    return {name: error - solution.error for name, error in grown.items()}


def _is_link(linkage: Linkage, name: str) -> bool:
    """Return whether a dimension is a length that must be above zero."""
    return name in (*linkage.links, SECOND_LENGTH)


def _mean_absolute(mean: FloatArray, spread: FloatArray) -> FloatArray:
    """Return the mean of |x| for normal variables x with the means ``mean`` and the standard deviations ``spread``."""
    from scipy.special import erf

    safe = np.maximum(spread, 1e-300)
    ratio = mean / safe
    return safe * np.sqrt(2.0 / pi) * np.exp(-0.5 * ratio**2) + mean * erf(ratio / np.sqrt(2.0))


def _names(linkage: Linkage, normal: tasks.Normal) -> list[str]:
    """Return the names of the dimensions in the columns of `_residuals`, in order."""
    mounted = [] if normal.angle is None else ["output_angle"]
    return [*PLACES, *mounted, *(name for name, _, _ in _pivot_dimensions(linkage, np.zeros(1)))]


def _pivot_dimensions(linkage: Linkage, rotation: FloatArray) -> list[tuple[str, float, tuple[FloatArray, FloatArray]]]:
    """Return name, value and derivatives of x and y of D, at crank rotations, for each dimension of a moving pivot."""
    pivot = linkage.pivot
    if isinstance(pivot, SliderMotion):
        c, s, u = np.cos(pivot.guide_angle), np.sin(pivot.guide_angle), pivot.series(rotation)
        own, first, along = "slider", 0, (c, s)
        found = [("guide_angle", pivot.guide_angle, (-s * u, c * u))]
    elif isinstance(pivot, SecondCrank):
        c, s = np.cos(pivot.angle(rotation)), np.sin(pivot.angle(rotation))
        # the mean of the series is part of the phase
        own, first, along = "second_crank", 1, (-pivot.length * s, pivot.length * c)
        found = [(SECOND_LENGTH, pivot.length, (c, s)), ("second_crank_phase", pivot.phase, along)]
    else:
        return []
    for k in range(first, pivot.series.order + 1):
        waves = (("cos", pivot.series.cos[k], np.cos(k * rotation)), ("sin", pivot.series.sin[k], np.sin(k * rotation)))
        for kind, value, wave in waves[: 1 if k == 0 else 2]:
            found.append((f"{own} {kind} {k}", float(value), (along[0] * wave, along[1] * wave)))
    return found


def _dimension_values(linkage: Linkage) -> dict[str, float]:
    return linkage.values() | {name: value for name, value, _ in _pivot_dimensions(linkage, np.zeros(1))}


def _manufactured_dimensions(linkage: Linkage) -> dict[str, float]:
    """Return the dimensions that are manufactured, by name; the coefficients of a commanded motion are not."""
    values = _dimension_values(linkage)
    made = (*LENGTHS, *ANGLES, SECOND_LENGTH, *PIVOT_ANGLES)
    return {name: values[name] for name in made if name in values and name not in linkage.absent_dimensions}


def _replace_dimension(linkage: Linkage, name: str, value: float) -> Linkage:
    """Return the linkage with another value of one dimension."""
    if name in (*LENGTHS, *ANGLES):
        changed: dict[str, Any] = {name: value}
        if name == "coupler_length" and linkage.point_is_pin:
            changed["point_distance"] = value
        return replace(linkage, **changed)
    assert linkage.pivot is not None
    own: Mapping[str, Any] = {{SECOND_LENGTH: "length", "second_crank_phase": "phase"}.get(name, name): value}
    return replace(linkage, pivot=replace(linkage.pivot, **own))


def quality_unit(task: tasks.Task) -> tuple[float, str]:
    """Return the factor from SI to the unit in which a task's quality function is written, and the name of this unit."""
    factor, unit = error_unit(task)
    return factor**2, f"{unit}²"


def error_unit(task: tasks.Task) -> tuple[float, str]:
    """Return the factor from SI to the unit in which a task's errors are written, and the name of this unit."""
    return (180.0 / pi, "deg") if isinstance(task, tasks.RockerFunction) else (1e3, "mm")


def quality_name(task: tasks.Task) -> str:
    """Return the name of a task's quality function."""
    weighted = not np.all(np.asarray(getattr(task, "weights", 1.0)) == 1.0)
    if isinstance(task, tasks.UntimedPath) and task.measure == "area":
        return f"{'weighted ' if weighted else ''}area between the curves"
    what = "errors of angle" if isinstance(task, tasks.RockerFunction) else "errors"
    return f"sum of {'weighted ' if weighted else ''}squared {what}"


def _meets_task(solution: Solution) -> bool:
    """Return whether a solution meets its task exactly, apart from rounding."""
    return error_unit(solution.task)[0] * solution.evaluation.worst < ROUNDING


def format_dimension(name: str, value: float) -> str:
    """Format a dimension with its unit."""
    # + 0.0 removes the minus sign of a zero
    if name in (*ANGLES, *PIVOT_ANGLES) or name.startswith("second_crank "):
        return f"{round(degrees(value), 3) + 0.0:.3f} deg"
    return f"{value * 1e3 + 0.0:.6g} mm"


def headline(solution: Solution) -> str:
    """Return the lines at the head of a report: error, size, transmission angle and defects, in three to six lines."""
    factor, unit = quality_unit(solution.task)
    scale, length = error_unit(solution.task)
    v = solution.verdicts
    low, high = degrees(v.least_transmission), degrees(v.greatest_transmission)
    error, worst = (0.0, 0.0) if _meets_task(solution) else (factor * solution.error, scale * solution.evaluation.worst)
    return (
        f"{quality_name(solution.task)} {f'{error:.4g}' if error < 1e4 else f'{error:.0f}'} {unit}\n"
        f"worst error {worst:.3g} {length}, largest link {1e3 * solution.largest_link:.4g} mm\n"
        f"transmission angle {low:.0f} to {high:.0f} deg"
        + (f"\n{straight}" if (straight := solution.straight()) else "")
        + (f"\n{', '.join(v.defects)}" if v.defects else "")
        + (f"\nalso found: {format_variants(solution)}" if solution.variants else "")
    )


def format_poor(solution: Solution) -> str:
    """Return a note on a poor solution: the error relative to the target, and possible improvements; empty for a good one.

    A solution is poor if `Solution.share` is greater than `POOR`.
    """
    task, share = solution.task, solution.share
    if not POOR < share < inf:
        return ""
    if solution.measures_area:
        said = f"{100.0 * share:.2g} % of the target's area is wrong"
    else:
        extent = "swing" if isinstance(task, tasks.RockerFunction) else "size"
        said = f"the rms error is {100.0 * share:.2g} % of the target's {extent}"
    better = _IMPROVEMENTS[solution.linkage.kind]
    if solution.linkage.pivot is not None and solution.linkage.kind == "four-bar":
        better = "more harmonics of its pivot's motion, or a smoother or smaller target, may do better"
    elif isinstance(task, tasks.SliderFunction):
        better = "a smaller stroke or swing of the crank may do better"
    elif isinstance(task, tasks.PrecisionPoints):
        better = "fewer points may be met exactly"
    return f"a poor answer: {said}; {better}"


def format_short(solution: Solution) -> str:
    """Return a note on links that are too short to be built; empty if there are none."""
    short = [f"{name} of {1e3 * length:.3g} mm" for name, length in solution.short_links.items()]
    if not short:
        return ""
    longest = 1e3 * solution.linkage.largest_link
    return f"{' and '.join(short)} beside a link of {longest:.4g} mm: a lower bound of the length makes it possible to build"


def format_sense(task: tasks.Task) -> str:
    """Return a note on a clockwise path that is timed by equal steps of a counter-clockwise crank; empty for other tasks."""
    if not isinstance(task, tasks.TimedPath):
        return ""
    (x, y), steps = np.asarray(task.points).T, np.asarray(task.rotation)
    clockwise = 0.5 * float(np.roll(x, -1) @ y - x @ np.roll(y, -1))
    # a path like an eight has no sense
    if clockwise <= 0.1 * float(np.ptp(x) * np.ptp(y)) or not np.allclose(steps, tasks.turn(len(steps))):
        return ""
    return (
        "the points run clockwise while the crank turns counter-clockwise; with rotation = { from = '0 deg', to = '-360 deg' } "
        "in [task] the crank turns clockwise, too, which may fit better"
    )


def table(rows: Sequence[Sequence[str]]) -> str:
    """Format rows as a table: the first column aligned left, the others right."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        "  ".join(cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths)))
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assessment:
    """The cost of errors in the dimensions of a solution, computed once for command line, report and drawing sheet.

    Attributes
    ----------
    solution : Solution
    dimensions : list of tuple
        Headings, then a row for each dimension: name, value, an error of the dimension, and the effect of this error on the
        output and on the quality function.
    rounding : str
        The cost of rounding the dimensions, in one line.
    poor : str
        The note of `format_poor` on the solution.
    """

    solution: Solution
    dimensions: list[tuple[str, str, str, str, str]]
    rounding: str
    poor: str

    @property
    def report(self) -> str:
        """Return the text report: verdicts, dimensions with the cost of errors, rounding, and the error at each target."""
        solution, linkage = self.solution, self.solution.linkage
        task, pivot = solution.task, linkage.pivot
        error, rms, worst = quality_cells(solution, digits=6)
        seen = "B, seen along ground_angle" if isinstance(linkage, SliderCrank) else "B -> D"
        head = (
            f"{solution.verdicts}\n"
            f"{quality_name(task)}: {error} {quality_unit(task)[1]}; "
            f"rms error {rms} {error_unit(task)[1]}, worst {worst} {error_unit(task)[1]}\n"
            f"assembly: C lies to the {'left' if linkage.branch > 0 else 'right'} of {seen}; "
            f"largest link {1e3 * solution.largest_link:.6g} mm"
        )
        if pivot is None:
            head += _slider_line(linkage) + _limit_lines(solution)
        elif isinstance(pivot, SliderMotion):
            head += f"\nslider at D: stroke {1e3 * pivot.stroke:.6g} mm"
        else:
            head += f"\nsecond crank at D: {format_ratio(pivot.ratio)} turns for one of the first"
        if pivot is not None:
            head += _rotation_line("toggles", toggles(linkage), solution.direction)
        if straight := solution.straight():
            head += f"\n{straight}"
        if solution.variants:
            head += f"\nalso found: {format_variants(solution)}"
        for note in filter(None, (self.poor, format_short(solution))):
            head += f"\n{note}"
        return "\n\n".join([head, table(self.dimensions), self.rounding, table(_station_rows(solution))]) + "\n"


def assess(solution: Solution, violated: Callable[[Solution], str] | None = None) -> Assessment:
    """Compute the cost of errors in the dimensions of a solution.

    ``violated`` is a function that returns the name of the constraint that a solution violates, or "" if it meets all.
    """
    factor, unit = quality_unit(solution.task)
    step = length_step(solution.linkage)
    rounding = round_dimensions(solution, step)
    words = (
        f"rounded to {1e3 * step:g} mm and {degrees(ANGLE_STEP):g} deg: {factor * rounding.error:.6g} {unit}; "
        f"mean over dimensions that are off by up to half as much: {factor * rounding.expected:.6g} {unit}"
    )
    if violated and not violated(solution):
        broken = violated(Solution.from_linkage(solution.task, rounding.linkage, solution.evaluation.rotation))
        words += f"; rounded so, it violates a constraint: {broken}" if broken else ""
    rows, poor = _dimension_rows(solution, step), format_poor(solution)
    return Assessment(solution=solution, dimensions=rows, rounding=words, poor=poor)


def report(solution: Solution) -> str:
    """Return the text report of a solution, in mm and degrees; see `Assessment`."""
    return assess(solution).report


def quality_headings(task: tasks.Task) -> tuple[str, str, str]:
    """Return the headings of `quality_cells`, with their units."""
    length = error_unit(task)[1]
    return f"{quality_name(task)} [{quality_unit(task)[1]}]", f"rms error [{length}]", f"worst [{length}]"


def quality_cells(solution: Solution, digits: int = 5) -> tuple[str, str, str]:
    """Return quality function, rms error and greatest error of a solution as texts; "0" for errors due to rounding.

    ``digits`` is the number of significant digits of the quality function.
    """
    factor, scale = quality_unit(solution.task)[0], error_unit(solution.task)[0]
    found = solution.evaluation
    if _meets_task(solution):
        return "0", "0", "0"
    return f"{factor * solution.error:.{digits}g}", f"{scale * found.rms:.4g}", f"{scale * found.worst:.4g}"


def _slider_line(linkage: Linkage) -> str:
    """Return a line with the offset and the stroke of a slider-crank; empty for any other linkage."""
    if not isinstance(linkage, SliderCrank):
        return ""
    line = f"\nslider at C on a guide {1e3 * abs(linkage.ground_length):.6g} mm from A"
    return line + (f": stroke {1e3 * float(stroke(linkage)):.6g} mm" if linkage.turns_fully else "")


def _limit_lines(solution: Solution) -> str:
    """Return lines with dead centres, toggles, time ratio and mechanical advantage of a four-bar or slider-crank.

    The mechanical advantage is the least over closely spaced crank rotations: the targets may be dead centres.
    """
    linkage, at = solution.linkage, solution.rotation
    begin, end = (0.0, 2.0 * pi) if whole_turn(solution.task, at) else (float(at.min()), float(at.max()))
    last, motions, what = linkage.driven
    lines = _rotation_line(f"{last} at rest", dead_centres(linkage), solution.direction)
    lines += _rotation_line("toggles", toggles(linkage), solution.direction)
    ratio = time_ratio(linkage)
    if ratio is not None:
        lines += f"\ntime ratio of the {last}'s {motions} {ratio:.4g}"
    gained = np.abs(mechanical_advantage(linkage, np.linspace(begin, end, CLOSELY)))
    if np.isfinite(gained).any():
        # if the links cannot be joined throughout, the range contains a toggle
        least = 0.0 if np.isnan(gained).any() else gained.min()
        lines += f"\n{what}: at least {least:.3g} during the task"
    return lines


def _rotation_line(what: str, places: Sequence[float], direction: float) -> str:
    """Return a line with the title ``what`` and the crank rotations ``places`` (rad) in degrees; empty if there are none.

    They are written within a turn in the crank's ``direction`` (+1 or -1): as negative numbers if it turns clockwise.
    """
    if not places:
        return ""
    # rounded first: a rotation of 0 that came out just below it would be 360
    within = sorted(round(degrees(direction * at), 2) % 360.0 for at in places)
    return f"\n{what} at crank rotations of {', '.join(f'{direction * at + 0.0:.2f}' for at in within)} deg"


def _dimension_rows(solution: Solution, step: float) -> list[tuple[str, str, str, str, str]]:
    """Return the rows of `Assessment.dimensions`: the effect of an error of one step, or of 0.1 degrees, in each dimension."""
    factor, unit = quality_unit(solution.task)
    scale, length = error_unit(solution.task)
    dear = costs(solution, step, ANGLE_STEP)
    rows = [("dimension", "value", "off by", "moves the output by (rms)", "error grows by")]
    # an untimed path leaves the crank's rotation free, and its start, too
    left_out = ("crank_phase",) if isinstance(solution.task, tasks.UntimedPath) else ()
    values = _dimension_values(solution.linkage)
    for name, shift in displacements(solution).items():
        if name in left_out:
            continue
        value = format_dimension(name, values[name])
        if name not in dear:
            rows.append((name, value, "", "", ""))
            continue
        off = ANGLE_STEP if name in (*ANGLES, *PIVOT_ANGLES) else step
        cost = factor * max(dear[name], 0.0)
        grown = f"{cost:.3g} {unit}" if isfinite(cost) else "no assembly"
        moved = scale * off * shift
        rows.append(
            (name, value, format_dimension(name, off), f"{moved if moved >= ROUNDING else 0.0:.3g} {length}", grown)
        )
    return rows


def format_transmission(verdicts: Verdicts) -> str:
    """Format the range of the transmission angle in degrees, without the unit."""
    return f"{degrees(verdicts.least_transmission):.1f} to {degrees(verdicts.greatest_transmission):.1f}"


def _station_rows(solution: Solution) -> list[list[str]]:
    """Return the rows of the table of errors, one for each target, in mm and degrees."""
    columns = solution.columns()
    heads = [name.replace("[m]", "[mm]").replace("[rad]", "[deg]") for name in columns]
    factors = [1e3 if name.endswith("[m]") else 180.0 / pi for name in columns]
    values = np.column_stack([factor * column for factor, column in zip(factors, columns.values())])
    rows = [[str(k), *(f"{v:.4f}" for v in row)] for k, row in enumerate(values)]
    return [["target", *heads], *rows]


def solution_columns(solutions: Sequence[Solution]) -> dict[str, list[float]]:
    """Return the columns of `Synthesis.columns`, with one row for each given solution; a missing link has the length 0."""
    columns: dict[str, list[float]] = {}

    def put(name: str, value: float) -> None:
        columns.setdefault(name, []).append(float(value))

    for rank, s in enumerate(solutions, start=1):
        angular = isinstance(s.task, tasks.RockerFunction)
        unit, length = ("rad2", "rad") if angular else ("m2", "m")
        put("rank", rank)
        put(f"quality [{unit}]", s.error)
        put(f"rms error [{length}]", s.evaluation.rms)
        put(f"worst error [{length}]", s.evaluation.worst)
        for name in ("full_turn", "circuit", "branch", "order"):
            put(f"{name.replace('_', ' ')} (1 or 0)", getattr(s.verdicts, name))
        put("least transmission angle [rad]", s.verdicts.least_transmission)
        put("greatest transmission angle [rad]", s.verdicts.greatest_transmission)
        for name, value in s.linkage.values().items():
            put(name if name == "branch" else f"{name} [{'rad' if name in ANGLES else 'm'}]", value)
        if any(isinstance(other.linkage, FiveBar) for other in solutions):
            second = s.linkage.pivot if isinstance(s.linkage, FiveBar) else None
            put(f"{SECOND_LENGTH} [m]", 0.0 if second is None else second.length)
            put("second_crank_phase [rad]", 0.0 if second is None else second.phase)
            put("second_crank_ratio", 0.0 if second is None else second.ratio)
    return columns
