"""Follow a curve of solutions of G(y, lambda) = 0, through its folds too, by predictor and corrector in arc length.

The module knows no mechanics. A step predicts a point along the tangent and corrects it in the plane normal to the tangent
(E. L. Allgower, K. Georg, Numerical Continuation Methods, Springer 1990). The step length is adapted to the number of
corrections and to the turn of the tangent. Unknowns and parameter are scaled, so that arc length does not depend on units.
The corrections are Newton's, or Broyden's (secant) if G alone is much cheaper than G with its derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError

#: Correction, relative to the scales, at which a point counts as on the curve.
TOLERANCE = 1e-10
#: Correction, relative to the scales, below which a point counts as on the curve if the correction is more than half the one
#: before. Newton's method converges much faster than that: such a correction is due to errors of the values of G.
NOISE = 1e-7
#: Largest number of corrections in a step; smallest number that makes a step hard: the next step is then not longer.
MOST_CORRECTIONS, HARD = 10, 5
#: Distance of a point from the end of the tangent, relative to the step, beyond which the point may lie on another curve.
REACH = 0.5
#: 1 / cos of the angle between old and new tangent above which the new tangent is computed without the old tangent.
_OBLIQUE = 1e3
#: Where two curves cross, the point is interpolated between two points before and after it: their distance from it, relative
#: to the step.
_ASIDE = 1e-3
#: Factors by which a step grows and shrinks.
GROWTH, SHRINKAGE = 1.4, 0.5

Vector = NDArray[np.float64]


class Evaluation(NamedTuple):
    """The value of G at a point, the derivatives of G, and data that the `Point` keeps.

    ``residual`` is G, shape (n,), ``jacobian`` its derivative with respect to y, shape (n, n), ``slope`` its derivative with
    respect to lambda, shape (n,).
    """

    residual: Vector
    jacobian: Vector
    slope: Vector
    data: Any


#: Function that computes G(y, lambda) and its derivatives; raises a `LinkworkError` where G is not defined.
Evaluate = Callable[[Vector, float], Evaluation]


class ContinuationError(LinkworkError):
    """Error: no point of a curve was found near the given point."""


class Reason(Enum):
    """Reason for the end of a curve."""

    BOX = "the end of the range is reached"
    CLOSED = "it is closed"
    TIP = "it turns too sharply to follow, or meets another boundary"
    NO_VALUE = "the test function has no value beyond"
    LENGTH = "it has more points than are followed"
    LEFT = "the caller stopped it"


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """An end of a curve in a plane: the reason, the last point, and further details of the reason, if there are any."""

    reason: Reason
    point: tuple[float, float]
    message: str = ""

    def __str__(self) -> str:
        return self.message if self.reason is Reason.LEFT else self.reason.value


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Point:
    """A point of a curve.

    Attributes
    ----------
    y : ndarray, shape (n,)
    parameter : float
    tangent : ndarray, shape (n + 1,)
        Direction of the curve in scaled unknowns and parameter, of length 1.
    derivatives : ndarray, shape (n, n + 1)
        Derivatives of G with respect to the unknowns and the parameter, scaled.
    data : object
        ``data`` of the `Evaluation` at this point.
    """

    y: Vector
    parameter: float
    tangent: Vector
    derivatives: Vector
    data: Any

    @property
    def orientation(self) -> float:
        """Sign of the determinant whose rows are the derivatives and the tangent; it changes where two curves cross."""
        return float(np.linalg.slogdet(np.vstack([self.derivatives, self.tangent]))[0])

    def with_opposite_tangent(self) -> Point:
        """Return the same point with the opposite tangent."""
        return replace(self, tangent=-self.tangent)


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A curve as far as it was followed.

    Attributes
    ----------
    points : tuple of Point
        Points in order; a closed curve ends with its first point.
    steps : tuple of float
        Scaled length of each step, measured along the tangent at its beginning.
    end : Reason
        Why the curve ended.
    reason : str
        Description of the end and its cause.
    message : str
        Error message of G if the curve ended because G has no value; else empty.
    """

    points: tuple[Point, ...]
    steps: tuple[float, ...]
    end: Reason
    reason: str
    message: str = ""

    def plane_end(self, message: str) -> End:
        """Return the end of the curve as an `End` with this message; its point is (last component of y, parameter)."""
        last = self.points[-1]
        return End(reason=self.end, point=(float(last.y[-1]), last.parameter), message=message)

    @property
    def closed(self) -> bool:
        """Whether the curve came back to its first point."""
        return self.end is Reason.CLOSED

    @property
    def reached(self) -> bool:
        """Whether the curve ended at an end of the range or at its first point."""
        return self.end in (Reason.BOX, Reason.CLOSED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Range and steps of a continuation.

    Attributes
    ----------
    low, high : float
        Range of the parameter.
    bounds : mapping
        Ranges (low, high) of unknowns, by index.
    first, least, greatest : float
        First, shortest and longest step in arc length, scaled so that the range of the parameter has length 1.
    widest : float
        Largest scaled change, in one step, of the parameter and of each unknown that has a range.
    most_points : int
        Largest number of points of the curve.
    greatest_turn, growing_turn : float
        Largest angle between the tangents at neighbouring points (rad), and the angle up to which the step grows (rad).
    oriented : bool
        Whether the curve ends where it crosses another curve. If so, no step jumps to the opposite boundary of a narrow region.

    Raises
    ------
    InputError
        If the range is empty, or the three steps are not positive and increasing in the order least, first, greatest.
    """

    low: float
    high: float
    bounds: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    first: float = 5e-3
    least: float = 1e-8
    greatest: float = 2e-2
    widest: float = np.inf
    most_points: int = 5000
    greatest_turn: float = 0.25
    growing_turn: float = 0.25
    oriented: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.low) and np.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"the range of the parameter is {self.low} to {self.high}: it must be finite and increasing"
            )
        if not 0.0 < self.least <= self.first <= self.greatest:
            raise InputError(f"steps {self.least}, {self.first}, {self.greatest}: they must be positive and increasing")


class _Failure(NamedTuple):
    """Reason why a step could not be taken (TIP or NO_VALUE), and its description."""

    reason: Reason
    text: str


class _Landing(NamedTuple):
    """A corrected point, scaled, with its evaluation and number of corrections."""

    z: Vector
    evaluation: Evaluation
    corrections: int


def _null_vector(derivatives: Vector, ahead: Vector) -> Vector:
    """Return the unit tangent of the curve, the null vector of the derivatives (n, n + 1), that points along ``ahead``."""
    try:
        vector = np.linalg.solve(np.vstack([derivatives, ahead]), np.append(np.zeros(len(derivatives)), 1.0))
        length = float(np.linalg.norm(vector))
    except np.linalg.LinAlgError:
        length = np.inf
    if length * float(np.linalg.norm(ahead)) < _OBLIQUE:
        return np.asarray(vector / length)
    # the tangent is nearly normal to ``ahead``: take the singular value decomposition, which costs more
    tangent: Vector = np.linalg.svd(derivatives)[2][-1]
    return -tangent if tangent @ ahead < 0.0 else tangent


class Follower:
    """Continuation of one curve.

    Parameters
    ----------
    evaluate : callable
        G with its derivatives; see `Evaluation`. It is not called outside the bounds: there G is extrapolated linearly.
    scale : array_like, shape (n,)
        Magnitudes of the unknowns.
    settings : Settings
    residual : callable, optional
        G alone, if the derivatives cost much more. Broyden's method then corrects the points, starting from the derivatives
        at the last point.
    foreign : callable, optional
        Receives the ``data`` of each new point; returns whether the point lies on another curve. The step is then shortened.
    """

    def __init__(
        self,
        evaluate: Evaluate,
        scale: ArrayLike,
        settings: Settings,
        residual: Callable[[Vector, float], Vector] | None = None,
        foreign: Callable[[Any], bool] | None = None,
    ) -> None:
        self.evaluate = evaluate
        self.settings = settings
        self.scale = np.append(np.asarray(scale, dtype=float), settings.high - settings.low)
        self.residual, self.foreign = residual, foreign
        self.low, self.high = np.full(len(self.scale), -np.inf), np.full(len(self.scale), np.inf)
        for number, (low, high) in (*settings.bounds.items(), (-1, (settings.low, settings.high))):
            self.low[number], self.high[number] = low, high

    def start(self, y: ArrayLike, parameter: float, direction: int, across: ArrayLike | None = None) -> Point:
        """Find the point of the curve at a parameter, near ``y``, with the tangent to higher (+1) or lower (-1) parameters.

        If ``across`` is given, a vector in scaled unknowns and parameter of shape (n + 1,), the point is sought in the plane
        normal to ``across`` through the guess (``y``, ``parameter``). ``direction`` is then the sign of the tangent's component
        along ``across``.

        Raises
        ------
        ContinuationError
            If Newton's method does not converge.
        """
        fixed = np.append(np.zeros(len(self.scale) - 1), 1.0) if across is None else np.asarray(across, dtype=float)
        z = np.append(np.asarray(y, dtype=float), parameter) / self.scale
        found = self._correct(z, fixed, None)
        if isinstance(found, _Failure):
            raise ContinuationError(
                f"no solution at the parameter {parameter:.9g} from the guess {np.asarray(y)}: {found.text}"
            )
        return self._point(found, direction * fixed)

    def start_with_tangent(self, y: ArrayLike, parameter: float, tangent: ArrayLike) -> Point:
        """Return a first `Point` at a given solution with a given tangent (unscaled, shape (n + 1,)), to switch branches."""
        direction = np.asarray(tangent, dtype=float) / self.scale
        evaluation = self.evaluate(np.asarray(y, dtype=float), parameter)
        return Point(
            y=np.asarray(y, dtype=float),
            parameter=parameter,
            tangent=direction / float(np.linalg.norm(direction)),
            derivatives=self._scaled_evaluation(evaluation)[1],
            data=evaluation.data,
        )

    def resume(self, y: ArrayLike, parameter: float, ahead: ArrayLike) -> Point:
        """Return a first `Point` at a known solution.

        Of the two opposite tangents, the point has the one nearer to ``ahead``, which is scaled and has shape (n + 1,).
        """
        whole = np.append(np.asarray(y, dtype=float), parameter)
        found = _Landing(whole / self.scale, self.evaluate(whole[:-1], parameter), 0)
        return self._point(found, np.asarray(ahead, dtype=float))

    def step(self, point: Point, length: float) -> Point | None:
        """Take a step of a given arc length along the tangent; return the new point, or None if the corrections fail."""
        found = self._step(point, length)
        return None if isinstance(found, _Failure) else self._point(found, point.tangent)

    def follow(
        self, first: Point, *, watch: Callable[[Point], None] | None = None, leave: Callable[[Point], str] | None = None
    ) -> Curve:
        """Follow the curve until it reaches an end of the range, comes back to its first point or cannot be continued.

        It also ends after ``most_points`` of the `Settings`. ``watch`` receives every new point; ``leave`` returns a reason to
        stop at a new point, or an empty text.
        """
        settings = self.settings
        points, steps = [first], list[float]()
        length = settings.first
        while len(points) < settings.most_points:
            last = points[-1]
            bend = (last.tangent - points[-2].tangent) / steps[-1] if steps else None
            taken = self._attempt(last, length, bend)
            if isinstance(taken, _Failure):
                length *= SHRINKAGE
                if length < settings.least:
                    message = taken.text if taken.reason is Reason.NO_VALUE else ""
                    stalled = f"no next point is found: {taken.text}"
                    return Curve(tuple(points), tuple(steps), taken.reason, stalled, message)
                continue
            point, count = taken
            end = None
            try:
                point, length = self._find_outer_turn(last, point, length)
                if out := self.is_beyond(point):
                    point, length = self._find_bound_point(last, point, length)
            except ContinuationError as error:
                return Curve(tuple(points), tuple(steps), Reason.TIP, f"no next point is found: {error}")
            if out:
                if length <= TOLERANCE:
                    return Curve(tuple(points), tuple(steps), Reason.BOX, Reason.BOX.value)
                end = Reason.BOX, Reason.BOX.value
            elif len(points) > 3 and self._passes(first, last, point):
                point, length = first, self.step_length(last, first)
                end = Reason.CLOSED, "the curve closes"
            points.append(point)
            steps.append(length)
            if watch:
                watch(point)
            if end is None and leave and (reason := leave(point)):
                end = Reason.LEFT, reason
            if end is not None:
                return Curve(tuple(points), tuple(steps), *end)
            if count < HARD and float(point.tangent @ last.tangent) > np.cos(settings.growing_turn):
                length = min(length * GROWTH, settings.greatest)
            widths = np.abs(point.tangent[[*settings.bounds, -1]])
            length = min(length, max(settings.widest / max(float(widths.max()), settings.least), settings.least))
        return Curve(
            tuple(points), tuple(steps), Reason.LENGTH, f"it is followed over {settings.most_points} points only"
        )

    def follow_both(
        self, first: Point, *, leave: Callable[[Point], str] | None = None
    ) -> tuple[list[Point], Curve, Curve]:
        """Follow the curve from a point in both directions; return all points in order, the backward and the forward curve."""
        forth = self.follow(first, leave=leave)
        if forth.closed:
            return [*forth.points], forth, forth
        back = self.follow(first.with_opposite_tangent(), leave=leave)
        return [*(point.with_opposite_tangent() for point in back.points[:0:-1]), *forth.points], back, forth

    def locate(self, point: Point, length: float, beyond: Point, test: Callable[[Point], float]) -> tuple[Point, float]:
        """Find the zero of a test function within a step; return its point and the distance from the beginning of the step.

        The step leads from ``point`` to ``beyond`` and has the given arc length; the test function has opposite signs at these
        points.
        """
        find_point = self._step_points(point, length, beyond)
        s = float(scipy.optimize.brentq(lambda s: test(find_point(s)), 0.0, length, xtol=1e-13, rtol=1e-14))
        return find_point(s), s

    def minimise(
        self, point: Point, length: float, beyond: Point, test: Callable[[Point], float], enough: float
    ) -> tuple[Point, float, float]:
        """Minimise a test function within a step (see `locate`), or find a value below ``enough``.

        Return the point, its distance from the beginning of the step and its value.
        """
        find_point = self._step_points(point, length, beyond)
        found = [(np.inf, 0.0)]

        def value(s: float) -> float:
            if found[-1][0] >= enough:
                found.append((test(find_point(s)), s))
            return found[-1][0]

        scipy.optimize.minimize_scalar(value, bounds=(0.0, length), method="bounded", options={"xatol": 1e-4 * length})
        least, s = min(found)
        return find_point(s), s, least

    def _step_points(self, point: Point, length: float, beyond: Point) -> Callable[[float], Point]:
        """Return a function that finds the point of the curve at a distance along the step from ``point`` to ``beyond``."""
        # the parabola through the end of the step
        bend = 2.0 * (self._scale_point(beyond) - self._scale_point(point) - length * point.tangent) / length**2

        def find_point(s: float) -> Point:
            if s in (0.0, length):
                return beyond if s else point
            found = self._step(point, s, bend)
            if isinstance(found, _Failure):
                found = self._interpolate_crossing(point, s, length, bend) or found
            if isinstance(found, _Failure):
                raise ContinuationError(
                    f"no point found {s:.3g} along the step from the parameter {point.parameter:.9g}: {found.text}"
                )
            return self._point(found, point.tangent)

        return find_point

    def step_length(self, point: Point, beyond: Point) -> float:
        """Return the length of the step between two points, along the tangent at the first."""
        return float((self._scale_point(beyond) - self._scale_point(point)) @ point.tangent)

    def _attempt(self, last: Point, length: float, bend: Vector | None) -> tuple[Point, int] | _Failure:
        """Take a step; return the new point and the number of corrections, or a failure if the step may have left the curve."""
        found = self._step(last, length, bend)
        if isinstance(found, _Failure):
            return found
        point = self._point(found, last.tangent)
        away = np.linalg.norm(found.z - self._scale_point(last) - length * last.tangent)
        if float(point.tangent @ last.tangent) < np.cos(self.settings.greatest_turn):
            return _Failure(Reason.TIP, "the curve turns too sharply")
        if self.settings.oriented and point.orientation != last.orientation:
            return _Failure(Reason.TIP, "the curve meets another")
        if found.corrections > HARD + 2 or away > REACH * length:
            return _Failure(Reason.TIP, "the corrections are many")
        if self.foreign is not None and self.foreign(point.data):
            return _Failure(Reason.TIP, "the corrections lead to another curve")
        return point, found.corrections

    def _step(self, point: Point, length: float, bend: Vector | None = None) -> _Landing | _Failure:
        """Take a step along the tangent, or along a parabola if ``bend``, the tangent's change per arc length, is given."""
        aside = np.zeros(len(point.tangent)) if bend is None else 0.5 * length**2 * bend
        aside = aside - (aside @ point.tangent) * point.tangent
        return self._correct(self._scale_point(point) + length * point.tangent, point.tangent, point, aside)

    def _interpolate_crossing(self, point: Point, s: float, length: float, bend: Vector) -> _Landing | None:
        """Return the point at which a curve crosses another: the middle of two points near it, None if it is no solution.

        At the crossing itself the corrections have no unique solution.
        """
        before, after = (self._step(point, s + side * _ASIDE * length, bend) for side in (-1.0, 1.0))
        if isinstance(before, _Failure) or isinstance(after, _Failure):
            return None
        z = 0.5 * (before.z + after.z)
        evaluation = self._evaluate(z)
        close = float(np.abs(self._scaled_evaluation(evaluation)[0]).max()) < NOISE
        return _Landing(z, evaluation, MOST_CORRECTIONS) if close else None

    def _correct(
        self, plane: Vector, normal: Vector, last: Point | None, aside: Vector | float = 0.0
    ) -> _Landing | _Failure:
        """Solve G = 0 in the plane through ``plane`` normal to ``normal``, starting at ``plane + aside``; all scaled."""
        n, z, before = len(plane) - 1, plane + aside, np.inf
        matrix = np.vstack([np.zeros((n, n + 1)), normal])
        secant = self.residual is not None and last is not None
        value = change = np.zeros(0)
        if secant and last is not None:
            matrix[:n] = last.derivatives
        for count in range(1, MOST_CORRECTIONS + 1):
            try:
                if not secant:
                    value, matrix[:n] = self._scaled_evaluation(evaluation := self._evaluate(z))
                else:
                    new = self._value(z)
                    if count > 1:
                        # Broyden's update: the derivatives must explain the change of G in the last correction
                        matrix[:n] += np.outer(new - value - matrix[:n] @ change, change) / (change @ change)
                    value = new
                change = -np.linalg.solve(matrix, np.append(value, normal @ (z - plane)))
                size = float(np.abs(change).max())
                if not np.isfinite(size) or (count > 3 and size > max(before, NOISE)):
                    break
                stalled, z, before = size > 0.5 * before, z + change, size
                if size < (NOISE if stalled else TOLERANCE):
                    return _Landing(z, self._evaluate(z) if secant else evaluation, count)
            except LinkworkError as error:
                return _Failure(Reason.NO_VALUE, str(error))
            except np.linalg.LinAlgError:
                return _Failure(Reason.TIP, "the tangent is not unique")
        return _Failure(Reason.TIP, "the corrections do not converge")

    def _clip_to_bounds(self, z: Vector) -> tuple[Vector, Vector]:
        """Return unknowns and parameter, unscaled and clipped to the bounds, and how far they lie beyond the bounds."""
        whole = z * self.scale
        inside = np.clip(whole, self.low, self.high)
        return inside, whole - inside

    def _evaluate(self, z: Vector) -> Evaluation:
        """Return G with its derivatives, extrapolated linearly beyond the bounds."""
        inside, beyond = self._clip_to_bounds(z)
        found = self.evaluate(inside[:-1], float(inside[-1]))
        further = found.jacobian @ beyond[:-1] + found.slope * beyond[-1]
        return found._replace(residual=found.residual + further)

    def _value(self, z: Vector) -> Vector:
        inside, beyond = self._clip_to_bounds(z)
        if self.residual is None or beyond.any():
            value = self._evaluate(z).residual
        else:
            value = self.residual(inside[:-1], float(inside[-1]))
        return np.asarray(value / self.scale[:-1])

    def _scaled_evaluation(self, evaluation: Evaluation) -> tuple[Vector, Vector]:
        """Return G, shape (n,), and its derivatives, shape (n, n + 1), in scaled unknowns and parameter."""
        n = len(self.scale) - 1
        derivatives = np.column_stack([evaluation.jacobian, evaluation.slope]) * self.scale / self.scale[:n, None]
        return evaluation.residual / self.scale[:n], derivatives

    def _point(self, found: _Landing, ahead: Vector) -> Point:
        derivatives = self._scaled_evaluation(found.evaluation)[1]
        tangent = _null_vector(derivatives, ahead)
        unscaled = found.z * self.scale
        return Point(
            y=unscaled[:-1],
            parameter=float(unscaled[-1]),
            tangent=tangent,
            derivatives=derivatives,
            data=found.evaluation.data,
        )

    def _scale_point(self, point: Point) -> Vector:
        return np.append(point.y, point.parameter) / self.scale

    def _find_outer_turn(self, last: Point, point: Point, length: float) -> tuple[Point, float]:
        """Find the outermost point of a step that leaves the bounds and comes back; return it and its distance along the step.

        For any other step, return the end of the step and the length of the step.
        """
        for axis in np.flatnonzero(last.tangent * point.tangent < 0.0).tolist():
            ahead, behind = abs(last.tangent[axis]), abs(point.tangent[axis])
            bound = (self.high if last.tangent[axis] > 0.0 else self.low)[axis] / self.scale[axis]
            # twice the height of the parabola with these slopes at its ends
            if abs(bound - self._scale_point(last)[axis]) < length * ahead**2 / (ahead + behind):
                turn, s = self.locate(last, length, point, lambda p, axis=axis: float(p.tangent[axis]))  # type: ignore[misc]
                if self.is_beyond(turn):
                    return turn, s
        return point, length

    def _find_bound_point(self, last: Point, beyond: Point, length: float) -> tuple[Point, float]:
        """Return the point at which a step meets a bound, and its distance from the beginning of the step."""
        here, there = self._scale_point(last), self._scale_point(beyond)
        low, high = self.low / self.scale, self.high / self.scale
        way = there - here
        with np.errstate(divide="ignore", invalid="ignore"):
            parts = np.where(there > high, (high - here) / way, np.where(there < low, (low - here) / way, np.inf))
        axis = int(np.argmin(parts))
        bound = float((self.high if way[axis] > 0.0 else self.low)[axis])
        if parts[axis] <= 0.0:
            return last, 0.0

        # the guess lies on the bound, and the corrections stay there
        guess, fixed = here + parts[axis] * way, np.eye(len(here))[axis]
        found = self._correct(guess, fixed, last)
        point = self._point(found, last.tangent) if isinstance(found, _Landing) else last
        # next to a fold the corrections may lead to the other side of the fold, where the curve comes back inside the bounds
        if isinstance(found, _Landing) and (
            np.linalg.norm(found.z - guess) < REACH * length and point.tangent[axis] * way[axis] > 0.0
        ):
            s = float((found.z - here) @ last.tangent)
        else:
            point, s = self.locate(last, length, beyond, lambda p: float(np.append(p.y, p.parameter)[axis]) - bound)
        whole = np.append(point.y, point.parameter)
        whole[axis] = bound
        point = replace(point, y=whole[:-1], parameter=float(whole[-1]))
        return self._find_bound_point(last, point, s) if self.is_beyond(point) else (point, s)

    def is_beyond(self, point: Point) -> bool:
        """Return whether a point lies outside the bounds."""
        whole = np.append(point.y, point.parameter)
        return bool((whole < self.low).any() or (whole > self.high).any())

    def _passes(self, first: Point, last: Point, point: Point) -> bool:
        """Return whether the step from ``last`` to ``point`` passes the first point of the curve in the same direction."""
        begin = self._scale_point(last)
        chord, way = self._scale_point(point) - begin, self._scale_point(first) - begin
        length = float(np.linalg.norm(chord))
        part = float(way @ chord) / length**2
        distance = float(np.linalg.norm(way - part * chord))
        return 0.0 < part <= 1.0 and distance < 0.2 * length and float(point.tangent @ first.tangent) > 0.9
