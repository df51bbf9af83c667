"""What each dimension of a solution does to its error, and what rounding the dimensions costs: by exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from .kernels import PLACES
from .linkage import ANGLES, LENGTHS, LINKS, Linkage, SecondCrank, SliderMotion
from .solution import Solution, evaluate, nearest_rotations, path_rate
from .tasks import RockerFunction, UntimedPath, normal_form

FloatArray = NDArray[np.float64]


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
        Derivative of the quality function with respect to it: zero at an optimum that no bound holds.
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
        Rounded.
    error : float
        Its quality function.
    expected : float
        Mean quality function of dimensions that are off by random amounts, evenly within half a step: to second order, by
        the exact derivatives.
    """

    linkage: Linkage
    error: float
    expected: float


def derivatives(solution: Solution) -> tuple[list[str], FloatArray, FloatArray, FloatArray]:
    """Names, derivatives (m, k) of the residuals with respect to them, residuals (m,), and weights (m,).

    The residuals are those of the quality function; of an untimed path, the distances along the target's normals.
    """
    task, linkage = solution.task, solution.linkage
    normal = normal_form(task)
    at = normal.rotation if normal.rotation is not None else solution.evaluation.rotation
    if at is None:
        assert normal.points is not None
        at = nearest_rotations(linkage, normal.origin + normal.unit * normal.points)
    columns, basis = _pivot_columns(linkage, at)
    names = [*PLACES, *columns]
    parts, blocks, weights = [], [], []
    if normal.points is not None:
        points = normal.origin + normal.unit * normal.points
        place, jacobian = linkage.path_jacobian(at)
        left = place @ np.array([1.0, 1j]) - points
        both = jacobian[:, 0] + 1j * jacobian[:, 1]
        whole = np.vstack([both[: len(PLACES)], *[bx * both[10] + by * both[11] for bx, by in basis]]).T
        if isinstance(task, UntimedPath):
            rate = path_rate(linkage, at, both)
            across = 1j * rate / np.abs(rate)
            parts, blocks = [(left * across.conj()).real], [(whole * across.conj()[:, None]).real]
            weights = [normal.weights]
        else:
            parts, blocks = [left.real, left.imag], [whole.real, whole.imag]
            weights = [normal.weights, normal.weights]
    if normal.angle is not None:
        which = 1 if normal.of_rocker else 0
        angles, jacobian = linkage.link_jacobian(at)
        turned = 0.0 if normal.of_rocker else linkage.ground_angle
        left_angle = angles[which] + linkage.output_angle + turned - normal.angle
        own = np.vstack(
            [
                jacobian[: len(PLACES), which],
                *[bx * jacobian[10, which] + by * jacobian[11, which] for bx, by in basis],
            ]
        ).T
        if not normal.of_rocker:
            own[:, PLACES.index("ground_angle")] += 1.0
        leverage = normal.leverage * normal.unit
        parts.append(leverage * ((left_angle + pi) % (2.0 * pi) - pi))
        blocks.append(leverage * own)
        weights.append(normal.weights)
    return names, np.vstack(blocks), np.concatenate(parts), np.concatenate(weights)


def sensitivities(solution: Solution) -> tuple[Sensitivity, ...]:
    """What each dimension does to the error, by exact derivatives.

    Of an untimed path, the squared distances to the curve at its stations, the crank rotations following.
    """
    names, jacobian, residual, weights = derivatives(solution)
    slopes = 2.0 * jacobian.T @ (weights * residual)
    stations = len(normal_form(solution.task).weights)
    shifts = np.sqrt((jacobian**2).sum(axis=0) / stations)
    values = solution.linkage.values() | _pivot_values(solution.linkage)
    return tuple(
        Sensitivity(name=name, value=float(values[name]), slope=float(slope), shift=float(shift))
        for name, slope, shift in zip(names, slopes, shifts)
        if not (isinstance(solution.task, RockerFunction) and name not in (*LINKS, "crank_phase", *names[10:]))
    )


def rounded(solution: Solution, length: float, angle: float) -> Rounding:
    """What rounding lengths and angles to whole steps costs.

    Parameters
    ----------
    length, angle : float
        Steps (m, rad); 0.1 mm and 0.1 degrees by default.
    """
    for what, step in (("length", length), ("angle", angle)):
        if not (np.isfinite(step) and step > 0.0):
            raise InputError(f"step of {what} is {step}: it must be greater than zero")
    changed = {
        name: step * round(getattr(solution.linkage, name) / step)
        for names, step in ((LENGTHS, length), (ANGLES, angle))
        for name in names
    }
    linkage = replace(solution.linkage, **changed)
    names, jacobian, _, weights = derivatives(solution)
    variance = np.array([(length if name in LENGTHS else angle) ** 2 / 12.0 for name in names[: len(PLACES)]])
    squares = (weights[:, None] * jacobian[:, : len(PLACES)] ** 2).sum(axis=0)
    rotation = solution.evaluation.rotation
    error = evaluate(solution.task, linkage, rotation).error
    if isinstance(solution.task, UntimedPath) and solution.task.measure == "area":
        # an area: the mean of the distances, as of a normal variable of that spread about what is there
        normal = normal_form(solution.task)
        spread = np.sqrt(jacobian[:, : len(PLACES)] ** 2 @ variance)
        left = derivatives(solution)[2]
        expected = float(normal.weights * normal.arc * normal.unit @ _mean_absolute(left, spread))
    else:
        expected = solution.error + float(squares @ variance)
    return Rounding(linkage=linkage, error=error, expected=expected)


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
        By the name of the dimension, without those of a moved pivot.
    """
    grown: dict[str, float] = {}
    for names, step in ((LENGTHS, length), (ANGLES, angle)):
        for name in names:
            value = getattr(solution.linkage, name)
            # a link cannot be shorter than nothing
            ends = [value + side * step for side in (-1.0, 1.0) if name not in LINKS or value + side * step > 0.0]
            grown[name] = max(
                evaluate(solution.task, replace(solution.linkage, **{name: end}), solution.evaluation.rotation).error
                for end in ends
            )
    return {name: error - solution.error for name, error in grown.items()}


def _mean_absolute(mean: FloatArray, spread: FloatArray) -> FloatArray:
    """Mean of |x| of a normal variable."""
    from scipy.special import erf

    safe = np.maximum(spread, 1e-300)
    ratio = mean / safe
    value: FloatArray = safe * np.sqrt(2.0 / pi) * np.exp(-0.5 * ratio**2) + mean * erf(ratio / np.sqrt(2.0))
    return value


def _pivot_columns(linkage: Linkage, at: FloatArray) -> tuple[list[str], list[tuple[FloatArray, FloatArray]]]:
    """Dimensions of a moved pivot, and the derivatives of its displacement with respect to each."""
    pivot = linkage.pivot
    names: list[str] = []
    columns: list[tuple[FloatArray, FloatArray]] = []
    if isinstance(pivot, SliderMotion):
        c, s = np.cos(pivot.guide_angle), np.sin(pivot.guide_angle)
        u = pivot.series(at)
        names.append("guide_angle")
        columns.append((-s * u, c * u))
        for k in range(pivot.series.order + 1):
            for kind, value in (("cos", np.cos(k * at)), ("sin", np.sin(k * at)))[: 1 if k == 0 else 2]:
                names.append(f"slider {kind} {k}")
                columns.append((c * value, s * value))
    elif isinstance(pivot, SecondCrank):
        psi = pivot.angle(at)
        names += ["second_crank_length", "second_crank_phase"]
        columns += [(np.cos(psi), np.sin(psi)), (-pivot.length * np.sin(psi), pivot.length * np.cos(psi))]
    return names, columns


def _pivot_values(linkage: Linkage) -> dict[str, float]:
    pivot = linkage.pivot
    if isinstance(pivot, SliderMotion):
        values = {"guide_angle": pivot.guide_angle}
        for k in range(pivot.series.order + 1):
            values[f"slider cos {k}"] = float(pivot.series.cos[k])
            values[f"slider sin {k}"] = float(pivot.series.sin[k])
        return values
    if isinstance(pivot, SecondCrank):
        return {"second_crank_length": pivot.length, "second_crank_phase": pivot.phase}
    return {}
