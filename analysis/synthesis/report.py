"""Text report of a solution, in mm and degrees."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, isfinite, pi

import numpy as np
from numpy.typing import NDArray

from .kinds import stroke
from .limit_positions import dead_centres, mechanical_advantage, time_ratio, toggles
from .linkage import ANGLES, Linkage, SecondCrank, SliderMotion, format_ratio
from .sensitivity import ANGLE_STEP, PIVOT_ANGLES, costs, length_step, rounded, sensitivities
from .solution import Solution, Verdicts
from .tasks import RockerFunction, Task, UntimedPath
from .trading import OVER

#: Factor and unit in which a limit of a trade-off is written, by its SI unit.
SHOWN = {"m": (1e3, "mm"), "rad": (degrees(1.0), "deg"), "N": (1.0, "N")}


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


def format_limit(over: str, limit: float) -> str:
    """A limit of a trade-off with its unit."""
    factor, unit = SHOWN[OVER[over].unit]
    return f"{factor * limit:.6g} {unit}"


def _stations(solution: Solution) -> list[list[str]]:
    """Errors target by target, in mm and degrees."""
    columns = solution.columns()
    heads = [name.replace("[m]", "[mm]").replace("[rad]", "[deg]") for name in columns]
    factors = [1e3 if name.endswith("[m]") else 180.0 / pi for name in columns]
    values = np.column_stack([factor * column for factor, column in zip(factors, columns.values())])
    rows = [[str(k), *(f"{v:.4f}" for v in row)] for k, row in enumerate(values)]
    return [["target", *heads], *rows]
