"""Pseudo-arclength continuation: a curve of solutions of G(y, lambda) = 0, past its folds.

It knows no mechanics: G comes with its exact derivatives, in the unknowns and in the parameter. Each step goes along the
tangent and returns to the curve in the plane across it (E. L. Allgower, K. Georg, Numerical Continuation Methods,
Springer 1990); its length follows from the effort of the correction and the turn of the tangent. Unknowns and parameter
are scaled, so that an arc means the same whatever the units.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from linkwork.errors import InputError, LinkworkError

#: Correction, relative to the scales, at which a point counts as on the curve.
TOLERANCE = 1e-10
#: Corrections at most, and the number of them from which on a step counts as hard.
MOST_CORRECTIONS, HARD = 10, 5
#: Greatest angle between the tangents at two neighbouring points (rad).
GREATEST_TURN = 0.25
#: A step grows and shrinks by these.
GROWTH, SHRINKAGE = 1.4, 0.5


class Evaluation(NamedTuple):
    """G and its derivatives at a point: shapes (n,), (n, n), (n,); ``data`` goes into the `Point`."""

    residual: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    slope: NDArray[np.float64]
    data: Any


#: G(y, lambda); raises a `LinkworkError` where it is not defined.
Evaluate = Callable[[NDArray[np.float64], float], Evaluation]


class ContinuationError(LinkworkError):
    """A curve could not be begun: the point given does not lead to one on it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Point:
    """A point of a curve.

    Attributes
    ----------
    y : ndarray, shape (n,)
    parameter : float
    tangent : ndarray, shape (n + 1,)
        Direction of the curve in scaled unknowns and parameter, of length 1.
    data : object
        What the evaluation gave with it.
    """

    y: NDArray[np.float64]
    parameter: float
    tangent: NDArray[np.float64]
    data: Any


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Curve:
    """A curve as far as it was followed.

    Attributes
    ----------
    points : tuple of Point
    steps : tuple of float
        Scaled arc length from each point to the next, along the tangent of the former.
    reached : bool
        Whether it ended where it should: at an end of the range, or where it began.
    closed : bool
        Whether it came back to where it began.
    reason : str
        Why it ended, in words.
    """

    points: tuple[Point, ...]
    steps: tuple[float, ...]
    reached: bool
    closed: bool
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How a curve is followed.

    Attributes
    ----------
    low, high : float
        Range of the parameter.
    first, least, greatest : float
        Steps in scaled arc length, in which the range of the parameter has length 1.
    most_points : int

    Raises
    ------
    InputError
        If the range is empty or the steps are not in order.
    """

    low: float
    high: float
    first: float = 5e-3
    least: float = 1e-8
    greatest: float = 2e-2
    most_points: int = 5000

    def __post_init__(self) -> None:
        if not (np.isfinite(self.low) and np.isfinite(self.high) and self.low < self.high):
            raise InputError(
                f"the range of the parameter is {self.low} to {self.high}: it must be finite and increasing"
            )
        if not 0.0 < self.least <= self.first <= self.greatest:
            raise InputError(f"steps {self.least}, {self.first}, {self.greatest}: they must be positive and increasing")


class Follower:
    """One curve being followed.

    Parameters
    ----------
    evaluate : callable
        G with its derivatives; see `Evaluation`.
    scale : array_like, shape (n,)
        Magnitudes of the unknowns.
    settings : Settings
    """

    def __init__(self, evaluate: Evaluate, scale: ArrayLike, settings: Settings) -> None:
        self.evaluate = evaluate
        self.settings = settings
        self.scale = np.append(np.asarray(scale, dtype=float), settings.high - settings.low)
        self._why = ""

    def start(self, y: ArrayLike, parameter: float, direction: int) -> Point:
        """The point of the curve at a parameter, near ``y``, looking to higher (+1) or lower (-1) parameters.

        Raises
        ------
        ContinuationError
            If Newton's method at the fixed parameter does not lead to one.
        """
        fixed = np.zeros(len(self.scale))
        fixed[-1] = 1.0
        z = np.append(np.asarray(y, dtype=float), parameter) / self.scale
        found = self._correct(z, fixed, z)
        if found is None:
            raise ContinuationError(
                f"no solution at the parameter {parameter:.9g} from the guess {np.asarray(y)}: {self._why}"
            )
        z, evaluation, _ = found
        return self._point(z, evaluation, direction * fixed)

    def along(self, y: ArrayLike, parameter: float, tangent: ArrayLike) -> Point:
        """A point as the first of a curve in a given direction (unscaled, shape (n + 1,)): a branch to be switched to."""
        direction = np.asarray(tangent, dtype=float) / self.scale
        evaluation = self.evaluate(np.asarray(y, dtype=float), parameter)
        return Point(
            y=np.asarray(y, dtype=float),
            parameter=parameter,
            tangent=direction / float(np.linalg.norm(direction)),
            data=evaluation.data,
        )

    def step(self, point: Point, length: float) -> tuple[Point, int] | None:
        """The point an arc length further along the tangent, and the corrections it took; None if there is none."""
        here = self._scaled(point)
        ahead = here + length * point.tangent
        found = self._correct(ahead, point.tangent, ahead)
        if found is None:
            return None
        z, evaluation, count = found
        return self._point(z, evaluation, point.tangent), count

    def follow(
        self,
        first: Point,
        *,
        watch: Callable[[Point], None] | None = None,
        leave: Callable[[Point], str] | None = None,
    ) -> Curve:
        """Follow the curve from a point to an end of the range, back to the point, or as far as it goes.

        ``watch`` is told of every point on the way; ``leave`` gives a reason to stop there, or an empty text.
        """
        settings = self.settings
        points, length = [first], settings.first
        steps: list[float] = []
        begin = self._scaled(first)
        travelled = 0.0
        why = ""
        while len(points) < settings.most_points:
            last = points[-1]
            taken = self._attempt(last, length)
            if isinstance(taken, str):
                why = taken
                length *= SHRINKAGE
                if length < settings.least:
                    return self._curve(points, steps, reason=f"the continuation stalls: {why}")
                continue
            point, count = taken
            if not settings.low <= point.parameter <= settings.high:
                end = settings.low if point.parameter < settings.low else settings.high
                point, length = self.locate(last, length, _less(end))
                points.append(point)
                steps.append(length)
                if watch:
                    watch(point)
                return self._curve(points, steps, reached=True, reason="the end of the range is reached")
            points.append(point)
            steps.append(length)
            if watch:
                watch(point)
            reason = leave(point) if leave else ""
            if reason:
                return self._curve(points, steps, reason=reason)
            travelled += length
            away = np.linalg.norm(self._scaled(point) - begin)
            if travelled > 4.0 * length and away < 0.5 * length and float(point.tangent @ first.tangent) > 0.9:
                return self._curve(points, steps, reached=True, closed=True, reason="the curve closes")
            if count < HARD:
                length = min(length * GROWTH, settings.greatest)
        return self._curve(points, steps, reason=f"{settings.most_points} points, the most allowed, are reached")

    def locate(self, point: Point, length: float, test: Callable[[Point], float]) -> tuple[Point, float]:
        """The point within a step at which a test, of opposite signs at its ends, is zero, and its distance along the step."""

        def at(s: float) -> Point:
            if s == 0.0:
                return point
            found = self.step(point, s)
            if found is None:
                raise ContinuationError(
                    f"no point {s:.3g} beyond the parameter {point.parameter:.9g} within a step taken"
                )
            return found[0]

        s = float(brentq(lambda s: test(at(s)), 0.0, length, xtol=1e-13, rtol=1e-14))
        return at(s), s

    def _attempt(self, last: Point, length: float) -> tuple[Point, int] | str:
        taken = self.step(last, length)
        if taken is None:
            return self._why
        cosine = float(taken[0].tangent @ last.tangent)
        if cosine < np.cos(GREATEST_TURN):
            return "the curve turns too sharply"
        if taken[1] > HARD + 2:
            return "the corrections are many"
        return taken

    def _correct(
        self, z: NDArray[np.float64], normal: NDArray[np.float64], plane: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], Evaluation, int] | None:
        """Newton's method for G = 0 in the plane through ``plane`` across ``normal``; all scaled."""
        self._why = "the corrections do not converge"
        n = len(z) - 1
        matrix = np.empty((n + 1, n + 1))
        before = np.inf
        for count in range(1, MOST_CORRECTIONS + 1):
            try:
                evaluation = self.evaluate(z[:n] * self.scale[:n], float(z[n] * self.scale[n]))
            except LinkworkError as error:
                self._why = str(error)
                return None
            matrix[:n, :n] = evaluation.jacobian * self.scale[:n] / self.scale[:n, None]
            matrix[:n, n] = evaluation.slope * self.scale[n] / self.scale[:n]
            matrix[n] = normal
            residual = np.append(evaluation.residual / self.scale[:n], normal @ (z - plane))
            try:
                correction = np.linalg.solve(matrix, residual)
            except np.linalg.LinAlgError:
                self._why = "the tangent is not unique"
                return None
            size = float(np.abs(correction).max())
            if not np.isfinite(size) or (count > 3 and size > before):
                return None
            z = z - correction
            if size < TOLERANCE:
                return z, evaluation, count
            before = size
        return None

    def _point(self, z: NDArray[np.float64], evaluation: Evaluation, ahead: NDArray[np.float64]) -> Point:
        n = len(z) - 1
        matrix = np.empty((n, n + 1))
        matrix[:, :n] = evaluation.jacobian * self.scale[:n] / self.scale[:n, None]
        matrix[:, n] = evaluation.slope * self.scale[n] / self.scale[:n]
        # the null vector, by the singular value decomposition: defined at folds too
        tangent = np.linalg.svd(matrix)[2][-1]
        if tangent @ ahead < 0.0:
            tangent = -tangent
        unscaled = z * self.scale
        return Point(y=unscaled[:n], parameter=float(unscaled[n]), tangent=tangent, data=evaluation.data)

    def _scaled(self, point: Point) -> NDArray[np.float64]:
        scaled: NDArray[np.float64] = np.append(point.y, point.parameter) / self.scale
        return scaled

    @staticmethod
    def _curve(
        points: Sequence[Point], steps: Sequence[float], *, reached: bool = False, closed: bool = False, reason: str
    ) -> Curve:
        return Curve(points=tuple(points), steps=tuple(steps), reached=reached, closed=closed, reason=reason)


def _less(end: float) -> Callable[[Point], float]:
    return lambda point: point.parameter - end
