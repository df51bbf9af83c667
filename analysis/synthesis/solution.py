"""A linkage that was found, and everything a designer asks of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees, inf, pi, radians

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from .areas import area_between, distance_to
from .kernels import PLACES
from .linkage import LENGTHS, Linkage, SecondCrank, SliderMotion
from .tasks import PrecisionPoints, RockerFunction, Task, TimedPath, UntimedPath, normal_form

FloatArray = NDArray[np.float64]

#: Points of a coupler curve by which an untimed path is judged: the thesis's 360.
CURVE = 360


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluation:
    """How well a linkage does a task.

    Attributes
    ----------
    error : float
        The task's quality function: m2, of a rocker function rad2.
    errors : ndarray, shape (n,)
        At each target: distance (m), of an untimed path from the target's point to the curve; of a rocker function, angle
        (rad).
    angle_errors : ndarray, shape (n,), or None
        Of a motion (rad).
    rotation : ndarray, shape (n,), or None
        Crank rotations at which the targets are compared; None where the linkage was given without.
    """

    error: float
    errors: FloatArray
    angle_errors: FloatArray | None
    rotation: FloatArray | None

    @property
    def rms(self) -> float:
        """Root mean square of the errors (m or rad)."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def worst(self) -> float:
        """Largest error (m or rad)."""
        return float(np.abs(self.errors).max())


def evaluate(task: Task, linkage: Linkage, rotation: FloatArray | None = None) -> Evaluation:
    """How well a linkage does a task, by the task's own measure.

    Nothing of a search is used: an untimed path is compared as a polygon of `CURVE` points with the target's.

    Parameters
    ----------
    task : Task
    linkage : Linkage
    rotation : ndarray, optional
        Crank rotations of an untimed task's stations; needed but for closed paths.

    Raises
    ------
    InputError
        If rotations are needed and not given.
    """
    if isinstance(task, UntimedPath):
        return _of_path(task, linkage, rotation)
    given = task.rotation if task.rotation is not None else rotation
    if given is None:
        raise InputError("the task gives no crank rotations: say at which ones the linkage is to be compared")
    at = np.asarray(given, dtype=float)
    if isinstance(task, RockerFunction):
        left = linkage.rocker_angle(at) - np.asarray(task.angle)
        left = (left + pi) % (2.0 * pi) - pi
        error = float(np.asarray(task.weights) @ left**2)
        return Evaluation(error=error if np.isfinite(error) else inf, errors=left, angle_errors=None, rotation=at)
    points = np.asarray(task.points)
    distance = np.hypot(*(linkage.path(at) - points).T)
    weights = np.ones(len(points)) if isinstance(task, PrecisionPoints) else np.asarray(task.weights)
    squares = distance**2
    turned = None
    if not isinstance(task, TimedPath) and task.angle is not None:
        turned = linkage.coupler_angle(at) - np.asarray(task.angle)
        turned = (turned + pi) % (2.0 * pi) - pi
        squares = squares + (float(task.length or 0.0) * turned) ** 2
    error = float(weights @ squares)
    return Evaluation(error=error if np.isfinite(error) else inf, errors=distance, angle_errors=turned, rotation=at)


def _of_path(task: UntimedPath, linkage: Linkage, rotation: FloatArray | None) -> Evaluation:
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
        return Evaluation(error=inf, errors=np.full(len(points), inf), angle_errors=None, rotation=rotation)
    distance = distance_to(curve, points, closed=path.closed)
    if task.measure == "area":
        error = area_between(curve, path, closed=path.closed)
    else:
        normal = normal_form(task)
        assert normal.points is not None
        stations = normal.origin + normal.unit * normal.points
        apart = distance_to(curve, np.column_stack([stations.real, stations.imag]), closed=path.closed)
        error = float(normal.weights @ apart**2)
    return Evaluation(error=error, errors=distance, angle_errors=None, rotation=rotation)


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdicts:
    """Whether a linkage really does its task.

    Attributes
    ----------
    grashof : str
        Type of the four-bar; see `Linkage.grashof`.
    full_turn : bool
        The crank can turn fully.
    circuit : bool
        The links stay joined all the way through the task: every target is on one circuit.
    branch : bool
        Coupler and rocker never come to be collinear on the way.
    order : bool
        The targets come in their order, the crank turning one way.
    least_transmission, greatest_transmission : float
        Range of the angle between coupler and rocker over the way of the task (rad), over a turn where it is closed.
    """

    grashof: str
    full_turn: bool
    circuit: bool
    branch: bool
    order: bool
    least_transmission: float
    greatest_transmission: float

    @property
    def sound(self) -> bool:
        """No circuit, branch or order defect."""
        return self.circuit and self.branch and self.order

    def __str__(self) -> str:
        words = [self.grashof, "full turn" if self.full_turn else "no full turn"]
        words += [f"{name} defect" for name in ("circuit", "branch", "order") if not getattr(self, name)]
        angles = f"{degrees(self.least_transmission):.1f} to {degrees(self.greatest_transmission):.1f} deg"
        return ", ".join(words) + f", transmission angle {angles}"


def judge(linkage: Linkage, rotation: FloatArray, *, closed: bool) -> Verdicts:
    """Verdicts over the crank rotations from the first to the last of ``rotation``, or over a turn.

    The distance from crank pin to rocker pivot, on which everything depends, is looked at densely and, with a fixed pivot,
    where the crank lies along the ground link.
    """
    steps = np.diff(rotation)
    order = bool(np.all(steps > 0.0) or np.all(steps < 0.0))
    begin, end = (0.0, 2.0 * pi) if closed else (float(rotation.min()), float(rotation.max()))
    way = np.linspace(begin, end, 1441)
    if linkage.pivot is None:
        # th2 a multiple of pi
        first = np.ceil((begin + linkage.crank_phase) / pi)
        last = np.floor((end + linkage.crank_phase) / pi)
        way = np.concatenate([way, np.arange(first, last + 1) * pi - linkage.crank_phase])
    dx, dy = linkage.displacement(way)
    th2 = way + linkage.crank_phase
    d = np.hypot(
        linkage.ground_length + dx - linkage.crank_length * np.cos(th2), dy - linkage.crank_length * np.sin(th2)
    )
    l3, l4 = linkage.coupler_length, linkage.rocker_length
    cosine = (l3 * l3 + l4 * l4 - d * d) / (2.0 * l3 * l4)
    joined = bool((np.abs(cosine) <= 1.0).all())
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return Verdicts(
        grashof=linkage.grashof,
        full_turn=linkage.turns_fully,
        circuit=joined,
        branch=joined and bool((np.abs(cosine) < 1.0).all()),
        order=order,
        least_transmission=float(angle.min()),
        greatest_transmission=float(angle.max()),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """A linkage for a task.

    Attributes
    ----------
    task : Task
    linkage : Linkage
    evaluation : Evaluation
    verdicts : Verdicts
    """

    task: Task
    linkage: Linkage
    evaluation: Evaluation
    verdicts: Verdicts

    @classmethod
    def of(cls, task: Task, linkage: Linkage, rotation: FloatArray | None = None) -> Solution:
        """Evaluate and judge a linkage; see `evaluate`."""
        evaluation = evaluate(task, linkage, rotation)
        closed = isinstance(task, UntimedPath) and task.path.closed
        at = np.array([0.0, 2.0 * pi]) if evaluation.rotation is None else evaluation.rotation
        return cls(task=task, linkage=linkage, evaluation=evaluation, verdicts=judge(linkage, at, closed=closed))

    @property
    def error(self) -> float:
        """The quality function (m2; of a rocker function, rad2)."""
        return self.evaluation.error

    @property
    def rotation(self) -> FloatArray:
        """Crank rotations over which the task is done: its stations, or a turn."""
        if self.evaluation.rotation is not None and not (isinstance(self.task, UntimedPath) and self.task.path.closed):
            return self.evaluation.rotation
        return np.linspace(0.0, 2.0 * pi, CURVE, endpoint=False)

    def curve(self, n: int = CURVE) -> FloatArray:
        """The traced path, shape (n, 2) in m: over a turn, or from the first station to the last."""
        at = self.rotation
        if isinstance(self.task, UntimedPath) and not self.task.path.closed:
            return self.linkage.path(np.linspace(at[0], at[-1], n))
        return self.linkage.path(np.linspace(0.0, 2.0 * pi, n, endpoint=False))

    def sensitivities(self) -> tuple[Sensitivity, ...]:
        """What each dimension does to the error, by exact derivatives.

        Of an untimed path, the squared distances to the curve at its stations, the crank rotations following.
        """
        from .sensitivity import sensitivities

        return sensitivities(self)

    def rounded(self, length: float = 1e-4, angle: float = radians(0.1)) -> Rounding:
        """What rounding lengths and angles to whole steps costs.

        Parameters
        ----------
        length, angle : float
            Steps (m, rad); 0.1 mm and 0.1 degrees by default.
        """
        from .sensitivity import rounded

        return rounded(self, length, angle)


def path_rate(linkage: Linkage, at: FloatArray, both: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """dP/dphi: by the crank's phase, and by the pivot's own motion."""
    step = 1e-6
    ahead, behind = linkage.displacement(at + step), linkage.displacement(at - step)
    vx, vy = ((a - b) / (2.0 * step) for a, b in zip(ahead, behind))
    rate: NDArray[np.complex128] = both[PLACES.index("crank_phase")] + vx * both[10] + vy * both[11]
    return rate


def nearest_rotations(linkage: Linkage, points: NDArray[np.complex128]) -> FloatArray:
    """Crank rotations at which the coupler point is nearest to points (complex, m), without jumps of a turn."""
    phi = np.linspace(0.0, 2.0 * pi, 4 * CURVE, endpoint=False)
    curve = linkage.path(phi) @ np.array([1.0, 1j])
    at: FloatArray = phi[np.abs(points[:, None] - curve[None, :]).argmin(axis=1)]
    for _ in range(3):
        place, jacobian = linkage.path_jacobian(at)
        both = jacobian[:, 0] + 1j * jacobian[:, 1]
        rate = path_rate(linkage, at, both)
        step = ((points - place @ np.array([1.0, 1j])) * rate.conj()).real / np.abs(rate) ** 2
        at += np.clip(step, -pi / CURVE, pi / CURVE)
    unwrapped: FloatArray = np.unwrap(at)
    return unwrapped


def ranked(solutions: Sequence[Solution]) -> tuple[Solution, ...]:
    """Sound ones first, then by error."""
    return tuple(sorted(solutions, key=lambda s: (not s.verdicts.sound, s.error)))
