"""Evaluate a linkage in a task: compute its errors, judge its defects; rank solutions, and group those that are alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees, inf, pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ...display import NotebookResult, format_count
from ...files import write_csv
from ..linkage.kernels import PLACES
from ..linkage.linkage import LINKS, Linkage, SecondCrank, SliderCrank, gear_turns, wrap_angles
from ..task.target import area_difference, curve_distance, half_lengths, hausdorff, straightness
from ..task.task import PrecisionPoints, RockerFunction, Task, TimedPath, UntimedPath, covers_turn, normal_form

FloatArray = NDArray[np.float64]
#: Fraction of the target's size squared below which an error is due to rounding.
EXACT = 1e-14
#: Number of points of a coupler curve with which an untimed path is evaluated: 360 as in the thesis.
CURVE = 360
#: Number of crank rotations, between the first and the last target, at which a linkage is judged.
CLOSELY = 1441
#: Length of a link relative to the longest below which the link can hardly be built.
SHORT = 0.01
#: Greatest differences of near copies: position of a pin, relative to the longest link; ratio of two lengths of one link.
SHARE, RATIO = 0.03, 1.25


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluation:
    """The errors of a linkage in a task.

    Attributes
    ----------
    error : float
        The task's quality function (m2, for a rocker function rad2).
    value : float
        The value of the task's objective: the quality function, or the greatest error (m, for a rocker function rad).
    errors : ndarray, shape (n,)
        Error at each target: a distance (m), or for a rocker function an angle (rad). For an untimed path it is the distance
        from the target point to the coupler curve.
    angle_errors : ndarray, shape (n,), or None
        Angular errors of a motion (rad).
    rotation : ndarray, shape (n,), or None
        Crank rotations at which the linkage is compared with the targets; None for a closed path without given rotations.
    length : float
        For a motion, the length by which an angular error is multiplied to count as an error of position (m); see `Motion`.
    hausdorff : float or None
        For an untimed path with the objective "worst", its Hausdorff distance from the coupler curve (m).
    """

    error: float
    value: float
    errors: FloatArray
    angle_errors: FloatArray | None = None
    rotation: FloatArray | None = None
    length: float = 0.0
    hausdorff: float | None = None

    @property
    def combined_errors(self) -> FloatArray:
        """Return the combined errors of position and angle, as they enter the quality function (m or rad), shape (n,)."""
        if self.angle_errors is None:
            return np.abs(self.errors)
        return np.hypot(self.errors, self.length * self.angle_errors)

    @property
    def rms(self) -> float:
        """Return the root mean square of the combined errors (m or rad)."""
        return float(np.sqrt(np.mean(self.combined_errors**2)))

    @property
    def worst(self) -> float:
        """Return the largest of the combined errors (m or rad); if `hausdorff` is known, return it instead.

        `hausdorff` also counts the points of the coupler curve that are far from the path.
        """
        return float(self.combined_errors.max()) if self.hausdorff is None else self.hausdorff


def evaluate(task: Task, linkage: Linkage, rotation: FloatArray | None = None) -> Evaluation:
    """Compute the errors and the quality function of a linkage in a task.

    The errors do not depend on the sampling of a search: for an untimed path the coupler curve is a polygon of `CURVE` points.

    Parameters
    ----------
    task : Task
    linkage : Linkage
    rotation : ndarray, optional
        Crank rotations (rad) of an untimed task's stations; required except for closed paths.

    Raises
    ------
    InputError
        If rotations are needed and not given.
    """
    if isinstance(task, UntimedPath):
        return _evaluate_path(task, linkage, rotation)
    given = task.rotation if task.rotation is not None else rotation
    if given is None:
        raise InputError("the task gives no crank rotations: say at which ones the linkage is to be compared")
    at = np.asarray(given, dtype=float)
    if isinstance(task, RockerFunction):
        left = wrap_angles(linkage.rocker_angle(at) - np.asarray(task.angle))
        error, value = _objective_values(task, np.asarray(task.weights) * left**2)
        return Evaluation(error=error, value=value, errors=left, rotation=at)
    points = np.asarray(task.points)
    distance = np.hypot(*(linkage.path(at) - points).T)
    weights = np.ones(len(points)) if isinstance(task, PrecisionPoints) else np.asarray(task.weights)
    squares = distance**2
    turned, length = None, 0.0
    if not isinstance(task, TimedPath) and task.angle is not None:
        turned, length = wrap_angles(linkage.coupler_angle(at) - np.asarray(task.angle)), float(task.length or 0.0)
        squares = squares + (length * turned) ** 2
    error, value = _objective_values(task, weights * squares)
    return Evaluation(error=error, value=value, errors=distance, angle_errors=turned, rotation=at, length=length)


def _objective_values(task: Task, squares: FloatArray) -> tuple[float, float]:
    """Return quality function and objective from the weighted squared errors; both infinite if an error is not finite."""
    error = float(squares.sum())
    if not np.isfinite(error):
        return inf, inf
    return error, error if task.objective == "error" else float(squares.max()) ** 0.5


def _evaluate_path(task: UntimedPath, linkage: Linkage, rotation: FloatArray | None) -> Evaluation:
    path = task.path
    if path.closed:
        phi = np.linspace(0.0, 2.0 * pi, CURVE, endpoint=False)
    elif rotation is None:
        raise InputError("an open path has no crank rotations of its own: say between which ones it is traced")
    else:
        phi = np.linspace(rotation[0], rotation[-1], CURVE)
    curve = linkage.path(phi)
    points = np.asarray(path.points)
    if not np.isfinite(curve).all():
        return Evaluation(error=inf, value=inf, errors=np.full(len(points), inf), rotation=rotation)
    distance = curve_distance(curve, points, closed=path.closed)
    weights = np.asarray(task.weights)
    normal = normal_form(task)
    stations = normal.places
    apart = curve_distance(curve, np.column_stack([stations.real, stations.imag]), closed=path.closed)
    if task.measure == "distance":
        error = float(normal.weights @ apart**2)
    elif (weights == weights[0]).all():
        error = float(weights[0]) * area_difference(curve, path, closed=path.closed)
    else:
        # a weighted area: half the integral along the target with its weights, half that along the curve with the weights of
        # the nearest stations
        traced = curve @ np.array([1.0, 1j])
        steps = np.abs(np.diff(np.append(traced, traced[0]) if path.closed else traced))
        nearest = np.abs(traced[:, None] - stations[None, :]).argmin(axis=1)
        back = half_lengths(steps, path.closed) * curve_distance(points, curve, closed=path.closed)
        error = 0.5 * float(normal.weights @ (normal.unit * normal.arc * apart) + normal.weights[nearest] @ back)
    farthest = None if task.objective == "error" else hausdorff(curve, path, closed=path.closed)
    value = error if farthest is None else farthest
    return Evaluation(error=error, value=value, errors=distance, rotation=rotation, hausdorff=farthest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdicts:
    """Verdicts on a linkage in its task: type, defects and transmission angle.

    Attributes
    ----------
    grashof : str
        Type of the linkage, see `Linkage.title`.
    full_turn : bool
        Whether the crank can turn fully.
    circuit : bool
        Whether the links stay joined throughout the task, so that all targets are on one circuit.
    branch : bool
        Whether coupler and rocker are never collinear during the task.
    order : bool
        Whether the targets are reached in order while the crank turns in one direction.
    least_transmission, greatest_transmission : float
        Range of the angle between coupler and rocker during the task (rad), or over a turn if the task takes a whole turn.
    """

    grashof: str
    full_turn: bool
    circuit: bool
    branch: bool
    order: bool
    least_transmission: float
    greatest_transmission: float

    @property
    def defects(self) -> tuple[str, ...]:
        """Return the names of the defects, such as "circuit defect"."""
        return tuple(f"{name} defect" for name in ("circuit", "branch", "order") if not getattr(self, name))

    @property
    def sound(self) -> bool:
        """Return whether there is no circuit, branch or order defect."""
        return not self.defects

    @property
    def transmission_margin(self) -> float:
        """Return the least difference of the transmission angle from 0 and pi (rad), where coupler and rocker are collinear."""
        return min(self.least_transmission, pi - self.greatest_transmission)

    def __str__(self) -> str:
        words = [self.grashof, "full turn" if self.full_turn else "no full turn", *self.defects]
        angles = f"{degrees(self.least_transmission):.1f} to {degrees(self.greatest_transmission):.1f} deg"
        return ", ".join(words) + f", transmission angle {angles}"


def judge(linkage: Linkage, rotation: FloatArray, *, closed: bool) -> Verdicts:
    """Check a linkage for defects between the least and the greatest of its crank rotations, or if ``closed`` over a turn.

    The distance from crank pin to rocker pivot determines the transmission angle. The distance is evaluated at closely spaced
    rotations and, with a fixed pivot, where the crank lies along the ground link.
    """
    steps = np.diff(rotation)
    order = bool(np.all(steps > 0.0) or np.all(steps < 0.0))
    begin, end = (0.0, 2.0 * pi) if closed else (float(rotation.min()), float(rotation.max()))
    way = np.linspace(begin, end, CLOSELY)
    if linkage.pivot is None:
        # rotations at which th2 is a multiple of pi
        first = np.ceil((begin + linkage.crank_phase) / pi)
        last = np.floor((end + linkage.crank_phase) / pi)
        way = np.concatenate([way, np.arange(first, last + 1) * pi - linkage.crank_phase])
    cosine = linkage.cosine_at_c(linkage.reach(way))
    joined = bool((np.abs(cosine) <= 1.0).all())
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return Verdicts(
        grashof=linkage.title,
        full_turn=linkage.turns_fully,
        circuit=joined,
        branch=joined and bool((np.abs(cosine) < 1.0).all()),
        order=order,
        least_transmission=float(angle.min()),
        greatest_transmission=float(angle.max()),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightPart:
    """Straight part of a path, as the linkage traces it; computed from closely spaced points.

    ``travel`` and ``flatness`` are the extents of the traced points (m): along the wanted line from the first point to the
    last, and across this line. ``begin`` and ``end`` are the crank rotations at the ends of the straight part (rad).
    """

    travel: float
    flatness: float
    begin: float
    end: float

    @property
    def rotation(self) -> float:
        """Return the angle by which the crank turns on the straight part (rad)."""
        return abs(self.end - self.begin)

    def __str__(self) -> str:
        angle = degrees(self.rotation)
        return f"straight part {1e3 * self.travel:.4g} mm long, {1e3 * self.flatness:.3g} mm off straight, in {angle:.1f} deg"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution(NotebookResult):
    """A linkage for a task, with its errors and verdicts.

    Attributes
    ----------
    task : Task
    linkage : Linkage
    evaluation : Evaluation
    verdicts : Verdicts
    variants : tuple of Solution
        Mirror images and near copies that the solution represents in a ranking, the best first.
    """

    task: Task
    linkage: Linkage
    evaluation: Evaluation
    verdicts: Verdicts
    variants: tuple[Solution, ...] = ()

    def __repr__(self) -> str:
        return f"<Solution of a {type(self.task).__name__}: {self.describe()}>"

    def describe(self) -> str:
        """Return error and verdicts in one line."""
        unit = "rad" if isinstance(self.task, RockerFunction) else "m"
        found = self.evaluation
        return (
            f"error {self.error:.4g} {unit}2, rms {found.rms:.4g} {unit}, worst {found.worst:.4g} {unit}; largest link "
            f"{self.largest_link:.4g} m; {self.verdicts}"
        )

    @classmethod
    def from_linkage(cls, task: Task, linkage: Linkage, rotation: FloatArray | None = None) -> Solution:
        """Evaluate and judge a linkage; see `evaluate`. Free crank rotations start within half a turn of 0."""
        if rotation is not None and linkage.pivot is None:
            rotation = rotation - 2.0 * pi * np.rint(rotation[0] / (2.0 * pi))
        evaluation = evaluate(task, linkage, rotation)
        closed = isinstance(task, UntimedPath) and task.path.closed
        at = np.array([0.0, 2.0 * pi]) if evaluation.rotation is None else evaluation.rotation
        closed = closed or whole_turn(task, at)
        return cls(task=task, linkage=linkage, evaluation=evaluation, verdicts=judge(linkage, at, closed=closed))

    @property
    def error(self) -> float:
        """Return the quality function (m2; for a rocker function rad2)."""
        return self.evaluation.error

    @property
    def value(self) -> float:
        """Return the objective of the task: `error`, or the greatest error (m; for a rocker function rad)."""
        return self.evaluation.value

    @property
    def measures_area(self) -> bool:
        """Return whether `error` is the unweighted area between two closed curves."""
        task = self.task
        if not (isinstance(task, UntimedPath) and task.path.closed and task.measure == "area"):
            return False
        return bool(np.all(np.asarray(task.weights) == 1.0))

    @property
    def share(self) -> float:
        """Return the error relative to the target.

        If `measures_area`, the result is the area between the curves divided by the area that the target encloses. Otherwise
        it is the rms error divided by the diagonal of the target's bounding box, or by the swing of a rocker function.
        """
        task = self.task
        if self.measures_area:
            assert isinstance(task, UntimedPath)
            return self.error / task.path.enclosed_area
        size = float(np.ptp(task.angle)) if isinstance(task, RockerFunction) else normal_form(task).unit
        return self.evaluation.rms / size if size > 0.0 else 0.0

    @property
    def rotation(self) -> FloatArray:
        """Return the crank rotations of the task's stations; for a closed untimed path, crank rotations over a whole turn."""
        if self.evaluation.rotation is not None and not (isinstance(self.task, UntimedPath) and self.task.path.closed):
            return self.evaluation.rotation
        return np.linspace(0.0, 2.0 * pi, CURVE, endpoint=False)

    @property
    def rotation_range(self) -> tuple[float, float] | None:
        """Return the least and the greatest crank rotation of the task; None if the crank can turn fully."""
        return None if self.verdicts.full_turn else (float(self.rotation.min()), float(self.rotation.max()))

    def station_rotations(self) -> FloatArray:
        """Return the crank rotations of the task's stations; if there are none, the rotations at which the curve is nearest."""
        normal = normal_form(self.task)
        given = normal.rotation if normal.rotation is not None else self.evaluation.rotation
        if given is not None and len(given) == normal.n:
            return given
        return nearest_rotations(self.linkage, normal.places, *self.traced_range())

    def traced_range(self) -> tuple[float, float]:
        """Return the crank rotations between which the linkage traces the path of an untimed task: a turn for a closed path."""
        at = self.evaluation.rotation
        if at is None or (isinstance(self.task, UntimedPath) and self.task.path.closed):
            return 0.0, 2.0 * pi
        return float(at.min()), float(at.max())

    def straight(self) -> StraightPart | None:
        """Return the straight part of the task as the linkage traces it; None if the task has none."""
        asked = normal_form(self.task).straight
        if asked is None or self.evaluation.rotation is None or not isinstance(self.task, UntimedPath):
            return None
        rotation = self.station_rotations()
        begin, end = float(rotation[asked.start]), float(rotation[asked.end])
        own = self.task.straight
        assert own is not None
        line = np.subtract(*self.task.path.points[[own.end, own.start]])
        traced = self.linkage.path(np.linspace(begin, end, 721))
        travel, flatness = straightness(traced, float(np.arctan2(line[1], line[0])))
        return StraightPart(travel=travel, flatness=flatness, begin=begin, end=end)

    def curve(self, n: int = CURVE) -> FloatArray:
        """Return n points of the traced path (m), shape (n, 2): over a turn, or from the first station to the last."""
        at = self.rotation
        if isinstance(self.task, UntimedPath) and not self.task.path.closed:
            return self.linkage.path(np.linspace(at[0], at[-1], n))
        return self.linkage.path(np.linspace(0.0, 2.0 * pi, n, endpoint=False))

    @property
    def largest_link(self) -> float:
        """Return the length that `LargestLink` bounds (m): the longest link or, for target points, B to P if that is longer."""
        point = 0.0 if target_points(self.task) is None else self.linkage.point_distance
        return max(self.linkage.largest_link, point)

    @property
    def short_links(self) -> dict[str, float]:
        """Return the links that are shorter than a hundredth of the longest link, by name (m)."""
        linkage = self.linkage
        return {n: x for n in linkage.links if (x := getattr(linkage, n)) < SHORT * linkage.largest_link}

    @property
    def direction(self) -> float:
        """Return the sense in which the crank turns during the task: 1 counter-clockwise, -1 clockwise."""
        at = self.evaluation.rotation
        return -1.0 if at is not None and len(at) > 1 and at[-1] < at[0] else 1.0

    def columns(self) -> dict[str, FloatArray]:
        """Return crank rotation, target, traced point or angle, error and transmission angle at each target, by name; SI.

        For an untimed path the traced point is the point of the curve nearest to the target point.
        """
        task = self.task
        at = self.evaluation.rotation
        if isinstance(task, UntimedPath):
            points = np.asarray(task.path.points)
            at = nearest_rotations(self.linkage, points @ np.array([1.0, 1j]), *self.traced_range())
        assert at is not None
        columns = {"crank rotation [rad]": at}
        if isinstance(task, RockerFunction):
            columns |= _angle_columns("rocker", task.angle, self.evaluation.errors)
        else:
            wanted = target_points(task)
            assert wanted is not None
            made = self.linkage.path(at)
            for name, both in (("target", wanted), ("path", made)):
                columns |= {f"{name} {axis} [m]": both[:, k] for k, axis in enumerate("xy")}
            columns["error [m]"] = self.evaluation.errors
        if self.evaluation.angle_errors is not None:
            columns |= _angle_columns("coupler", task.angle, self.evaluation.angle_errors)  # type: ignore[union-attr]
        columns["transmission angle [rad]"] = angle_at_c(self.linkage, at)
        return columns

    def to_csv(self, path: str | Path) -> Path:
        """Write `columns` to a CSV file."""
        return write_csv(path, self.columns())


def _angle_columns(link: str, target: Any, error: FloatArray) -> dict[str, FloatArray]:
    """Return target and angle of a link, in the same turn, and their difference, by name (rad)."""
    wanted = np.asarray(target)
    return {
        "target angle [rad]": wanted, f"{link} angle [rad]": wanted + error, "error of angle [rad]": error,
    }  # fmt: skip


def whole_turn(task: Task, rotation: FloatArray) -> bool:
    """Return whether the crank rotations of a task's stations cover a whole turn.

    For untimed precision points the result is False, whatever the steps between their rotations.
    """
    if isinstance(task, PrecisionPoints) and task.rotation is None:
        return False
    return covers_turn(rotation)


def target_points(task: Task) -> FloatArray | None:
    """Return the target points of a task (m), shape (n, 2); None for a rocker function."""
    if isinstance(task, RockerFunction):
        return None
    return np.asarray(task.path.points if isinstance(task, UntimedPath) else task.points)


def angle_at_c(linkage: Linkage, rotation: FloatArray) -> FloatArray:
    """Return the angle between coupler and rocker at C (rad), from 0 to pi; NaN if the links cannot be joined."""
    g = linkage.directions(rotation)
    return np.arctan2(np.abs(g[5]), g[4])


def path_rate(linkage: Linkage, rotation: FloatArray, both: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the derivative of the coupler point with respect to the crank rotation, at crank rotations (m/rad).

    The motion of the pivot is included. ``both`` has the derivatives of the coupler point that `Linkage.path_jacobian` returns,
    as complex numbers x + iy; the result is complex, too.
    """
    step = 1e-6
    ahead, behind = linkage.displacement(rotation + step), linkage.displacement(rotation - step)
    vx, vy = ((a - b) / (2.0 * step) for a, b in zip(ahead, behind))
    return linkage.turns * both[PLACES.index("crank_phase")] + vx * both[10] + vy * both[11]


def nearest_rotations(
    linkage: Linkage, points: NDArray[np.complex128], begin: float = 0.0, end: float = 2.0 * pi
) -> FloatArray:
    """Return the crank rotation at which the coupler point is nearest to each of ``points`` (complex, m).

    Successive rotations are continued without jumps of a turn. The search covers rotations from ``begin`` to ``end`` (rad).
    """
    whole = end - begin >= 2.0 * pi - 1e-9
    phi = np.linspace(begin, end, 4 * CURVE, endpoint=not whole)
    curve = linkage.path(phi) @ np.array([1.0, 1j])
    distance = np.abs(points[:, None] - curve[None, :])
    at: FloatArray = phi[np.where(np.isfinite(distance), distance, inf).argmin(axis=1)]
    for _ in range(3):
        place, jacobian = linkage.path_jacobian(at)
        both = jacobian[:, 0] + 1j * jacobian[:, 1]
        rate = path_rate(linkage, at, both)
        step = ((points - place @ np.array([1.0, 1j])) * rate.conj()).real / np.abs(rate) ** 2
        at += np.clip(step, -pi / CURVE, pi / CURVE)
    if not whole:
        return np.clip(at, begin, end)
    return np.unwrap(at)


def rank_solutions(solutions: Sequence[Solution]) -> tuple[Solution, ...]:
    """Rank solutions: sound solutions first, then by the task's objective.

    Solutions that are exact to rounding are ranked by their transmission angles during the task: the one whose coupler and
    rocker stay farthest from collinear comes first.
    """

    def place(solution: Solution) -> tuple[bool, float, float]:
        exact, verdicts = solution.error <= EXACT * normal_form(solution.task).unit ** 2, solution.verdicts
        return not verdicts.sound, 0.0 if exact else solution.value, -verdicts.transmission_margin

    return tuple(sorted(solutions, key=place))


# Solutions that are practically the same linkage: mirror images and near copies


def group_similar(solutions: Sequence[Solution]) -> tuple[Solution, ...]:
    """Group similar solutions; return the first solution of each group, with the rest of the group as its ``variants``.

    Solutions count as similar if their linkages differ only in position in the plane, sense of rotation or start of the crank;
    for a rocker function they may also differ in size. Linkages with a commanded pivot are never grouped.
    """
    groups: list[list[Solution]] = []
    for solution in solutions:
        group = next((g for g in groups if _compare_linkages(g[0], solution) is not None), None)
        if group is None:
            groups.append([solution])
        else:
            group.append(solution)
    return tuple(replace(g[0], variants=(*g[0].variants, *g[1:])) for g in groups)


def format_variants(solution: Solution) -> str:
    """Format the number of mirror images and near copies that a solution represents, as in "2 mirror images, 1 near copy"."""
    mirrored = sum(_compare_linkages(solution, other) == -1 for other in solution.variants)
    counts = (("mirror image", mirrored), ("near copy", len(solution.variants) - mirrored))
    return ", ".join(format_count(count, name) for name, count in counts if count)


def _compare_linkages(one: Solution, other: Solution) -> int | None:
    """Return 1 if two linkages are near copies, -1 if one is near the other's mirror image, otherwise None."""
    a, b = one.linkage, other.linkage
    if a.kind != b.kind or _gear_ratio(a) is None or _gear_ratio(a) != _gear_ratio(b):
        return None
    links = [np.array([abs(getattr(x, name)) for name in x.links]) for x in (a, b)]
    if isinstance(one.task, RockerFunction):
        links = [lengths / lengths.max() for lengths in links]
    if (np.abs(np.log(links[0] / links[1])) > np.log(RATIO)).any():
        return None
    own, *_ = _coupler_sides(a)
    for side in _coupler_sides(b):
        if np.abs(_shape(a, own) - _shape(b, side)).max() <= SHARE:
            return own * side
    return None


def _gear_ratio(linkage: Linkage) -> float | None:
    """Return the gear ratio of a second crank, 0 for a fixed rocker pivot, None for a commanded pivot."""
    pivot = linkage.pivot
    if pivot is None:
        return 0.0
    return pivot.ratio if isinstance(pivot, SecondCrank) and pivot.series.order == 0 else None


def _coupler_sides(linkage: Linkage) -> tuple[int, ...]:
    """Return the sides of B -> D on which C can lie: +1 left, -1 right.

    The assembly determines one side. A slider-crank with almost no offset has both sides, the side of its assembly first.
    """
    if not isinstance(linkage, SliderCrank):
        return (linkage.branch,)
    offset = linkage.ground_length
    side = linkage.branch if offset >= 0.0 else -linkage.branch
    return (side, -side) if abs(offset) <= SHARE * linkage.largest_link else (side,)


def _shape(linkage: Linkage, side: int) -> NDArray[np.float64]:
    """Return links, coupler point and second crank relative to the longest link, mirrored so that C lies to the left."""
    point = linkage.point_distance * np.exp(1j * side * linkage.point_angle)
    second, pivot = 0j, linkage.pivot
    if isinstance(pivot, SecondCrank):
        # its angle while the first crank lies along the ground link, times the turns k so that whole turns do not matter
        k, m = gear_turns(pivot.ratio)
        second = pivot.length * np.exp(1j * side * (k * pivot.phase - m * linkage.crank_phase))
    links = (abs(getattr(linkage, name)) for name in LINKS)
    return np.array([*links, point.real, point.imag, second.real, second.imag]) / linkage.largest_link
