"""What each dimension of a solution does to its error, and what rounding the dimensions costs: by exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, inf, isfinite, log10, pi, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..linkage.kernels import PLACES
from ..linkage.linkage import ABSENT, ANGLES, LENGTHS, LINKS, Linkage, SecondCrank, SliderMotion, format_ratio, wrapped
from ..task.constraint import SECOND_LENGTH, stroke
from ..task.limit_position import dead_centres, mechanical_advantage, time_ratio, toggles
from ..task.task import Normal, RockerFunction, Task, UntimedPath, normal_form
from .solution import CURVE, Solution, Verdicts, evaluate, nearest_rotations, path_rate

FloatArray = NDArray[np.float64]
#: Steps to which dimensions are rounded (m, rad): 0.1 mm, or a tenth of a small link, and 0.1 degrees.
LENGTH_STEP, ANGLE_STEP = 1e-4, radians(0.1)
#: Angles of a moved pivot, besides the coefficients of its motion.
PIVOT_ANGLES = ("guide_angle", "second_crank_phase")
#: Step of the differences of exact derivatives, in rad or as a share of the longest link.
DIFFERENCE = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """What one dimension does to the error.

    Attributes
    ----------
    name : str
        Field of `Linkage`, or of its pivot's motion.
    value : float
        m or rad.
    slope : float
        Derivative with respect to it of the sum of weighted squared errors, which is the quality function, or of a path whose
        quality is an area stands in for it: zero at an optimum of it that no bound holds.
    shift : float
        Root mean square displacement of the traced point, or error of angle, per unit of it.
    """

    name: str
    value: float
    slope: float
    shift: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rounding:
    """What rounding the dimensions costs.

    Attributes
    ----------
    linkage : Linkage
        Rounded; a link to no less than one step, the coefficients of a slider's or a second crank's motion, which is commanded
        and not made, not at all.
    error : float
        Its quality function.
    expected : float
        Mean quality function of dimensions that are off by random amounts, evenly within half a step: a sum of squares to
        second order, by exact derivatives of the errors and their differences; an area by the spread of the distances, as of
        normal variables. Infinite where there are no derivatives.
    """

    linkage: Linkage
    error: float
    expected: float


def length_step(linkage: Linkage) -> float:
    """Step to which lengths are rounded (m): 0.1 mm; of a linkage with a link below 1 mm a power of ten below a tenth of it."""
    least = min(getattr(linkage, name) for name in LINKS if _is_link(linkage, name))
    return min(LENGTH_STEP, float(10.0 ** np.floor(log10(0.1 * least) + 1e-9)))


def derivatives(solution: Solution) -> tuple[list[str], FloatArray, FloatArray, FloatArray]:
    """Names, derivatives (m, k) of the residuals with respect to them, residuals (m,), and weights (m,).

    The residuals are those of the quality function; of an untimed path, the distances along the target's normals.
    """
    task, linkage = solution.task, solution.linkage
    normal = normal_form(task)
    at = normal.rotation if normal.rotation is not None else solution.evaluation.rotation
    if at is None:
        assert normal.points is not None
        at = nearest_rotations(linkage, normal.places)
    weights = np.tile(normal.weights, 1 if normal.points is None or isinstance(task, UntimedPath) else 2)
    if normal.points is not None and normal.angle is not None:
        weights = np.append(weights, normal.weights)
    return _names(linkage, normal), *_residuals(linkage, normal, at, isinstance(task, UntimedPath)), weights


def _residuals(linkage: Linkage, normal: Normal, at: FloatArray, across: bool) -> tuple[FloatArray, FloatArray]:
    """Derivatives (m, k) of the residuals, and residuals (m,): of points, ``across`` the curve or x and y; of angles."""
    columns = [column for _, _, column in _pivot(linkage, at)]
    angular = normal.angle is not None
    parts, blocks = [], []
    if normal.points is not None:
        points = normal.places
        place, jacobian = linkage.path_jacobian(at)
        left = place @ np.array([1.0, 1j]) - points
        both = jacobian[:, 0] + 1j * jacobian[:, 1]
        still = [np.zeros(len(at), dtype=complex)] if angular else []
        whole = np.vstack([both[: len(PLACES)], *still, *[bx * both[10] + by * both[11] for bx, by in columns]]).T
        if linkage.slider_is_point:
            # the pin and the point are one
            whole[:, PLACES.index("coupler_length")] += whole[:, PLACES.index("point_distance")]
        if across:
            rate = path_rate(linkage, at, both)
            normals = 1j * rate / np.abs(rate)
            parts, blocks = [(left * normals.conj()).real], [(whole * normals.conj()[:, None]).real]
        else:
            parts, blocks = [left.real, left.imag], [whole.real, whole.imag]
    if angular:
        which = 1 if normal.of_rocker else 0
        angles, jacobian = linkage.link_jacobian(at)
        turned = 0.0 if normal.of_rocker else linkage.ground_angle
        left_angle = angles[which] + linkage.output_angle + turned - normal.angle
        own = np.vstack(
            [
                jacobian[: len(PLACES), which],
                np.ones(len(at)),
                *[bx * jacobian[10, which] + by * jacobian[11, which] for bx, by in columns],
            ]
        ).T
        if not normal.of_rocker:
            own[:, PLACES.index("ground_angle")] += 1.0
        leverage = normal.leverage * normal.unit
        parts.append(leverage * wrapped(left_angle))
        blocks.append(leverage * own)
    return np.vstack(blocks), np.concatenate(parts)


def sensitivities(solution: Solution) -> tuple[Sensitivity, ...]:
    """What each dimension does to the error, by exact derivatives.

    Of an untimed path, the squared distances to the curve at its stations, the crank rotations following.
    """
    names, jacobian, residual, weights = derivatives(solution)
    slopes = 2.0 * jacobian.T @ (weights * residual)
    stations = len(normal_form(solution.task).weights)
    shifts = np.sqrt((jacobian**2).sum(axis=0) / stations)
    values = _values(solution.linkage)
    # a rocker's angle has nothing to do with where the linkage stands, nor with its coupler point
    idle = (
        set(PLACES) - {*LINKS, "crank_phase"}
        if isinstance(solution.task, RockerFunction)
        else _absent(solution.linkage)
    )
    return tuple(
        Sensitivity(name=name, value=float(values[name]), slope=float(slope), shift=float(shift))
        for name, slope, shift in zip(names, slopes, shifts)
        if name not in idle
    )


def rounded(solution: Solution, length: float | None = None, angle: float = ANGLE_STEP) -> Rounding:
    """What rounding lengths and angles to whole steps costs.

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
    steps = {name: angle if name in (*ANGLES, *PIVOT_ANGLES) else length for name in _made(linkage)}
    rounded_to = linkage
    for name, value in _made(linkage).items():
        whole = round(value / steps[name])
        # a link is not rounded away
        rounded_to = _with(rounded_to, name, steps[name] * (max(whole, 1) if _is_link(linkage, name) else whole))
    error = evaluate(solution.task, rounded_to, solution.evaluation.rotation).error
    return Rounding(linkage=rounded_to, error=error, expected=_expected(solution, steps))


def _expected(solution: Solution, steps: Mapping[str, float]) -> float:
    """Mean quality function of dimensions that are off by even random amounts of a variance of a twelfth of a step squared."""
    task, linkage = solution.task, solution.linkage
    area = isinstance(task, UntimedPath) and task.measure == "area"
    if isinstance(task, UntimedPath) and area:
        # as many stations as it is evaluated at
        task = replace(task, samples=max(task.samples, CURVE))
    normal = normal_form(task)
    given = normal.rotation if normal.rotation is not None else solution.evaluation.rotation
    names = _names(linkage, normal)

    def residuals(made: Linkage) -> tuple[FloatArray, FloatArray]:
        at = given
        if isinstance(task, UntimedPath):
            # the crank rotations follow
            assert normal.points is not None
            ends = () if normal.closed or given is None else (float(given.min()), float(given.max()))
            at = nearest_rotations(made, normal.places, *ends)
        assert at is not None
        return _residuals(made, normal, at, isinstance(task, UntimedPath))

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
        value = _made(linkage)[name]
        if _is_link(linkage, name):
            small = min(small, 0.1 * value)
        ahead, behind = (residuals(_with(linkage, name, value + side * small))[0][:, k] for side in (1.0, -1.0))
        shift += 0.5 * variance * (ahead - behind) / (2.0 * small)
    if area:
        # an area: the mean of the distances, as of a normal variable of that spread about what is there
        grown = normal.weights * normal.arc * normal.unit @ (_mean_absolute(left, np.sqrt(square)) - np.abs(left))
    else:
        weights = np.tile(normal.weights, len(left) // normal.n)
        grown = weights @ (square + 2.0 * left * shift)
    return solution.error + float(grown) if np.isfinite(grown) else inf


def costs(solution: Solution, length: float, angle: float) -> dict[str, float]:
    """What it costs if one dimension is off by a step: the greater growth of the quality function of the two directions.

    By evaluating the linkages, so that it holds of steps of any size; infinite where the links cannot be joined.

    Parameters
    ----------
    length, angle : float
        Steps (m, rad).

    Returns
    -------
    dict
        By the name of the dimension, without those of a slider's motion.
    """
    linkage, grown = solution.linkage, {}
    for name, value in _made(linkage).items():
        if name == "guide_angle":
            continue
        step = angle if name in (*ANGLES, *PIVOT_ANGLES) else length
        # a link cannot be shorter than nothing
        link = _is_link(linkage, name)
        ends = [value + side * step for side in (-1.0, 1.0) if not link or value + side * step > 0.0]
        grown[name] = max(
            evaluate(solution.task, _with(linkage, name, end), solution.evaluation.rotation).error for end in ends
        )
    return {name: error - solution.error for name, error in grown.items()}


def _is_link(linkage: Linkage, name: str) -> bool:
    """Whether a dimension is a length above zero; an offset may be none."""
    return name in (*LINKS, SECOND_LENGTH) and not (linkage.slides and name in ABSENT)


def _absent(linkage: Linkage) -> set[str]:
    """Dimensions that a slider-crank does not have: a rocker, and where the slider is the coupler point, another point."""
    point = {"point_distance", "point_angle"} if linkage.slider_is_point else set()
    return {"rocker_length", *point} if linkage.slides else set()


def _mean_absolute(mean: FloatArray, spread: FloatArray) -> FloatArray:
    """Mean of |x| of a normal variable."""
    from scipy.special import erf

    safe = np.maximum(spread, 1e-300)
    ratio = mean / safe
    value: FloatArray = safe * np.sqrt(2.0 / pi) * np.exp(-0.5 * ratio**2) + mean * erf(ratio / np.sqrt(2.0))
    return value


def _names(linkage: Linkage, normal: Normal) -> list[str]:
    """Dimensions that there are derivatives with respect to, in their order."""
    mounted = [] if normal.angle is None else ["output_angle"]
    return [*PLACES, *mounted, *(name for name, _, _ in _pivot(linkage, np.zeros(1)))]


def _pivot(linkage: Linkage, at: FloatArray) -> list[tuple[str, float, tuple[FloatArray, FloatArray]]]:
    """Dimensions of a moved pivot: name, value, and the derivatives of its displacement at crank rotations."""
    pivot = linkage.pivot
    if isinstance(pivot, SliderMotion):
        c, s, u = np.cos(pivot.guide_angle), np.sin(pivot.guide_angle), pivot.series(at)
        own, first, along = "slider", 0, (c, s)
        found = [("guide_angle", pivot.guide_angle, (-s * u, c * u))]
    elif isinstance(pivot, SecondCrank):
        c, s = np.cos(pivot.angle(at)), np.sin(pivot.angle(at))
        # the mean of the series is the phase's
        own, first, along = "second_crank", 1, (-pivot.length * s, pivot.length * c)
        found = [(SECOND_LENGTH, pivot.length, (c, s)), ("second_crank_phase", pivot.phase, along)]
    else:
        return []
    for k in range(first, pivot.series.order + 1):
        waves = (("cos", pivot.series.cos[k], np.cos(k * at)), ("sin", pivot.series.sin[k], np.sin(k * at)))
        for kind, value, wave in waves[: 1 if k == 0 else 2]:
            found.append((f"{own} {kind} {k}", float(value), (along[0] * wave, along[1] * wave)))
    return found


def _values(linkage: Linkage) -> dict[str, float]:
    return linkage.values() | {name: value for name, value, _ in _pivot(linkage, np.zeros(1))}


def _made(linkage: Linkage) -> dict[str, float]:
    """Dimensions that are made, and so are off by something: a commanded motion is not among them."""
    values = _values(linkage)
    made = (*LENGTHS, *ANGLES, SECOND_LENGTH, *PIVOT_ANGLES)
    return {name: values[name] for name in made if name in values and name not in _absent(linkage)}


def _with(linkage: Linkage, name: str, value: float) -> Linkage:
    """The linkage with another value of one of the dimensions that are made."""
    if name in (*LENGTHS, *ANGLES):
        changed: dict[str, Any] = {name: value}
        if name == "coupler_length" and linkage.slider_is_point:
            changed["point_distance"] = value
        return replace(linkage, **changed)
    assert linkage.pivot is not None
    own: Mapping[str, Any] = {{SECOND_LENGTH: "length", "second_crank_phase": "phase"}.get(name, name): value}
    return replace(linkage, pivot=replace(linkage.pivot, **own))


def quality_unit(task: Task) -> tuple[float, str]:
    """Factor from SI, and unit, in which a task's quality function is written."""
    return ((180.0 / pi) ** 2, "deg²") if isinstance(task, RockerFunction) else (1e6, "mm²")


def error_unit(task: Task) -> tuple[float, str]:
    """Factor from SI, and unit, in which a task's errors are written."""
    return (180.0 / pi, "deg") if isinstance(task, RockerFunction) else (1e3, "mm")


def quality_name(task: Task) -> str:
    """What a task's quality function is."""
    if isinstance(task, UntimedPath) and task.measure == "area":
        return "area between the curves"
    weighted = not np.all(np.asarray(getattr(task, "weights", 1.0)) == 1.0)
    what = "errors of angle" if isinstance(task, RockerFunction) else "errors"
    return f"sum of {'weighted ' if weighted else ''}squared {what}"


def format_dimension(name: str, value: float) -> str:
    """A dimension with its unit."""
    if name in (*ANGLES, *PIVOT_ANGLES) or name.startswith("second_crank "):
        # + 0.0: no minus before a zero
        return f"{round(degrees(value), 3) + 0.0:.3f} deg"
    return f"{value * 1e3:.6g} mm"


def headline(solution: Solution) -> str:
    """Error, size and transmission angle, and what is wrong, in two or three lines."""
    factor, unit = quality_unit(solution.task)
    scale, length = error_unit(solution.task)
    v = solution.verdicts
    low, high = degrees(v.least_transmission), degrees(v.greatest_transmission)
    return (
        f"{factor * solution.error:.4g} {unit}, worst {scale * solution.evaluation.worst:.3g} {length}\n"
        f"largest link {1e3 * solution.linkage.largest_link:.4g} mm, {low:.0f} to {high:.0f} deg"
        + (f"\n{straight}" if (straight := solution.straight()) else "")
        + (f"\n{', '.join(v.defects)}" if v.defects else "")
    )


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows in columns, the first to the left, the others to the right."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        "  ".join(cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths)))
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


def report(solution: Solution) -> str:
    """Verdicts, dimensions with what an error in each costs, rounding, errors target by target."""
    task, linkage, evaluation = solution.task, solution.linkage, solution.evaluation
    factor, unit = quality_unit(task)
    scale, length = error_unit(task)
    parts = [
        f"{solution.verdicts}\n"
        f"{quality_name(task)}: {factor * solution.error:.6g} {unit}; "
        f"rms error {scale * evaluation.rms:.4g} {length}, worst {scale * evaluation.worst:.4g} {length}\n"
        f"assembly: C lies to the {'left' if linkage.branch > 0 else 'right'} of B -> D; "
        f"largest link {1e3 * linkage.largest_link:.6g} mm"
    ]
    if linkage.pivot is None:
        parts[0] += (f"\n{slider_line(linkage)}" if linkage.slides else "") + _limits(linkage, solution.rotation)
    elif isinstance(linkage.pivot, SliderMotion):
        parts[0] += f"\nslider at D: stroke {1e3 * linkage.pivot.stroke:.6g} mm"
    elif isinstance(linkage.pivot, SecondCrank):
        parts[0] += f"\nsecond crank at D: {format_ratio(linkage.pivot.ratio)} turns for one of the first"
    if linkage.pivot is not None:
        parts[0] += _places("toggles", toggles(linkage))
    if straight := solution.straight():
        parts[0] += f"\n{straight}"
    parts += [table(dimension_rows(solution)), rounding_line(solution)]
    parts.append(table(_stations(solution)))
    return "\n\n".join(parts) + "\n"


def slider_line(linkage: Linkage) -> str:
    """Offset and stroke of a slider-crank."""
    line = f"slider at C on a guide {1e3 * abs(linkage.ground_length):.6g} mm from A"
    return line + (f": stroke {1e3 * float(stroke(linkage)):.6g} mm" if linkage.turns_fully else "")


def _limits(linkage: Linkage, rotation: NDArray[np.float64]) -> str:
    """Dead centres, toggles, time ratio and mechanical advantage of a four-bar or a slider-crank, a line each."""
    lines, last = "", "slider" if linkage.slides else "rocker"
    lines += _places(f"{last} at rest", dead_centres(linkage)) + _places("toggles", toggles(linkage))
    ratio = time_ratio(linkage)
    if ratio is not None:
        lines += f"\ntime ratio of the {last}'s {'strokes' if linkage.slides else 'swings'} {ratio:.4g}"
    gained = np.abs(mechanical_advantage(linkage, rotation))
    if np.isfinite(gained).any():
        what = (
            "force of the slider for one at the crank pin"
            if linkage.slides
            else "torque of the rocker for one of the crank"
        )
        lines += f"\n{what}: {np.nanmin(gained):.3g} at least on the way"
    return lines


def _places(what: str, places: Sequence[float]) -> str:
    """A line of crank rotations, if there are any."""
    return f"\n{what} at crank rotations of {', '.join(f'{degrees(at):.2f}' for at in places)} deg" if places else ""


def dimension_rows(solution: Solution) -> list[tuple[str, str, str, str, str]]:
    """Dimensions with their values, and what it does if one is off by 0.1 mm or 0.1 degrees; a heading first."""
    factor, unit = quality_unit(solution.task)
    scale, length = error_unit(solution.task)
    step = length_step(solution.linkage)
    dear = costs(solution, step, ANGLE_STEP)
    rows = [("dimension", "value", "off by", "moves the output by (rms)", "error grows by")]
    # where the crank's rotation is free, so is where it starts
    left_out = ("crank_phase",) if isinstance(solution.task, UntimedPath) else ()
    for s in sensitivities(solution):
        if s.name in left_out:
            continue
        if s.name not in dear:
            rows.append((s.name, format_dimension(s.name, s.value), "", "", ""))
            continue
        off = ANGLE_STEP if s.name in (*ANGLES, *PIVOT_ANGLES) else step
        cost = factor * max(dear[s.name], 0.0)
        grown = f"{cost:.3g} {unit}" if isfinite(cost) else "no assembly"
        moved = f"{scale * off * s.shift:.3g} {length}"
        rows.append((s.name, format_dimension(s.name, s.value), format_dimension(s.name, off), moved, grown))
    return rows


def rounding_line(solution: Solution) -> str:
    """What rounding costs."""
    factor, unit = quality_unit(solution.task)
    step = length_step(solution.linkage)
    rounding = rounded(solution, step)
    return (
        f"rounded to {1e3 * step:g} mm and {degrees(ANGLE_STEP):g} deg: {factor * rounding.error:.6g} {unit}; "
        f"mean over dimensions that are off by up to half as much: {factor * rounding.expected:.6g} {unit}"
    )


def format_transmission(verdicts: Verdicts) -> str:
    """Range of the transmission angle."""
    return f"{degrees(verdicts.least_transmission):.1f} to {degrees(verdicts.greatest_transmission):.1f}"


def _stations(solution: Solution) -> list[list[str]]:
    """Errors target by target, in mm and degrees."""
    columns = solution.columns()
    heads = [name.replace("[m]", "[mm]").replace("[rad]", "[deg]") for name in columns]
    factors = [1e3 if name.endswith("[m]") else 180.0 / pi for name in columns]
    values = np.column_stack([factor * column for factor, column in zip(factors, columns.values())])
    rows = [[str(k), *(f"{v:.4f}" for v in row)] for k, row in enumerate(values)]
    return [["target", *heads], *rows]


def columns_of(solutions: Sequence[Solution]) -> dict[str, list[float]]:
    """What `Synthesis.columns` tells, of any solutions; a linkage has no rocker, or no second crank, where its length is 0."""
    columns: dict[str, list[float]] = {}

    def put(name: str, value: float) -> None:
        columns.setdefault(name, []).append(float(value))

    for rank, s in enumerate(solutions, start=1):
        angular = isinstance(s.task, RockerFunction)
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
        if any(isinstance(other.linkage.pivot, SecondCrank) for other in solutions):
            second = s.linkage.pivot if isinstance(s.linkage.pivot, SecondCrank) else None
            put(f"{SECOND_LENGTH} [m]", 0.0 if second is None else second.length)
            put("second_crank_phase [rad]", 0.0 if second is None else second.phase)
            put("second_crank_ratio", 0.0 if second is None else second.ratio)
    return columns
