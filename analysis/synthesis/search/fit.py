"""Fit linkages by SciPy: by least squares at the stations of a task, by SLSQP to the whole curve of an untimed path.

A least-squares fit at ordered stations cannot cut a corner, and its sum of squares is not an area. Here the curve is the same
polygon as in the evaluation of a solution. The measure is one of `task.target`: the area of the symmetric difference, the area
of the strip along an open path, or the Hausdorff distance. The areas have a continuous gradient, which follows from the
polygons and the exact derivatives of the coupler point. The Hausdorff distance becomes an unknown that bounds many distances.
SciPy's SLSQP starts from a least-squares optimum; a unit step in any of its scaled coordinates moves the curve equally far.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import copysign, inf, pi
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression, least_squares, minimize

from linkwork.errors import InputError

from ...numerics.overlap import find_nearest, symmetric_difference
from ..linkage.kernels import coupler_path_jacobian, link_jacobian
from ..linkage.linkage import wrap_angles
from ..result.solution import CURVE
from ..task.constraint import UNKNOWNS
from ..task.limits import Limits
from ..task.target import TargetPath, closed_vertices, hausdorff
from ..task.task import Normal
from .program import Answer, Program, Start, clip_to_bounds

FloatArray = NDArray[np.float64]
Made = TypeVar("Made")
#: Greatest number of iterations of SLSQP, and the change of the measure, relative to its first value, at which SLSQP ends.
ITERATIONS, CHANGE = 100, 1e-7
#: A direction is scaled by its mean square displacement. This fraction of the greatest displacement is added, to limit the
#: scaling.
STIFF = 1e-6
#: Least number of pieces of the target at which distances are computed.
PIECES = 360
#: To minimise the greatest distance, first every STRIDE-th distance is bounded, then all distances of at least GREAT times the
#: greatest distance.
STRIDE, GREAT = 3, 0.5
#: Greatest change of the first station's crank rotation, and least rotation between successive stations (rad).
WINDOW, APART = 0.6, 1e-10
#: Fraction by which the bound of the greatest distance may be exceeded: the points of the curve with the greatest distance
#: change from step to step.
WITHIN = 1e-5
#: Index of the crank phase, which does not affect a closed curve.
PHASE = UNKNOWNS.index("crank_phase")


def residuals(
    normal: Normal, branch: int, q: FloatArray, rotation: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute the weighted residuals of a linkage with a fixed pivot at crank rotations (rad), in normal form.

    ``q``, shape (11,), has the values of `UNKNOWNS`; ``branch`` is the assembly, +1 or -1.

    Returns
    -------
    residual : ndarray, shape (m,)
        n residuals of x, then n of y, then n of the angle, if the task has these targets.
    jacobian : ndarray, shape (m, 11)
        Derivatives with respect to `UNKNOWNS`.
    rate : ndarray, shape (m,)
        Derivatives with respect to the crank rotation at the residual's station.
    """
    n = normal.n
    c, s, zero = np.cos(rotation), np.sin(rotation), np.zeros(n)
    root = np.sqrt(normal.weights)
    parts, jacobians, rates = [], [], []
    if normal.points is not None:
        out, jacobian = np.empty((2, n)), np.empty((12, 2, n))
        coupler_path_jacobian(c, s, zero, zero, q[:10], float(branch), out, jacobian)
        for axis, wanted in enumerate((normal.points.real, normal.points.imag)):
            parts.append(root * (out[axis] - wanted))
            jacobians.append(root[:, None] * np.column_stack([jacobian[:10, axis].T, np.zeros(n)]))
            # a rotation of the crank is a change of its phase
            rates.append(root * jacobian[8, axis])
    if normal.angle is not None:
        out, jacobian = np.empty((2, n)), np.empty((12, 2, n))
        link_jacobian(c, s, zero, zero, q[:10], float(branch), out, jacobian)
        which = 1 if normal.of_rocker else 0
        turned = 0.0 if normal.of_rocker else q[7]
        left = out[which] + turned + q[10] - normal.angle
        own = np.column_stack([jacobian[:10, which].T, np.ones(n)])
        own[:, 7] += 0.0 if normal.of_rocker else 1.0
        factor = normal.leverage * root
        parts.append(factor * wrap_angles(left))
        jacobians.append(factor[:, None] * own)
        rates.append(factor * jacobian[8, which])
    return np.concatenate(parts), np.concatenate(jacobians), np.concatenate(rates)


def sum_of_squares(normal: Normal, start: Start) -> float:
    """Return the sum of weighted squared errors of a start with a fixed pivot; infinite if the links cannot be joined."""
    rotation = normal.rotation if start.rotation is None else start.rotation
    assert rotation is not None
    residual = residuals(normal, start.branch, start.q, rotation)[0]
    value = float(residual @ residual)
    return value if np.isfinite(value) else inf


def fit_least_squares(normal: Normal, limits: Limits, start: Start) -> Answer:
    """Minimise the squared errors within bounds by SciPy's trust region method, with the exact Jacobian."""
    free = np.nonzero(limits.high > limits.low)[0]
    timed, n = normal.timed, normal.n
    base = clip_to_bounds(start.q, limits.low, limits.high)
    low, high = limits.low[free], limits.high[free]
    x0 = base[free]
    # strictly inside, as the method asks
    x0 = np.clip(x0, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
    rotation0 = normal.rotation if timed else start.rotation
    if rotation0 is None:
        raise InputError("the start of an untimed task needs the crank rotations of its stations")
    if not timed:
        x0 = np.append(x0, rotation0)
        low, high = np.append(low, np.full(n, -inf)), np.append(high, np.full(n, inf))
    size = len(free)
    blocks = (normal.points is not None) * 2 + (normal.angle is not None)

    def unpack(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        q = base.copy()
        q[free] = x[:size]
        return q, rotation0 if timed else x[size:]

    def value(x: FloatArray) -> FloatArray:
        found = residuals(normal, start.branch, *unpack(x))
        # beyond the limit of assembly: residuals larger than any others, so that the step is shortened
        return found[0] if all(np.isfinite(part).all() for part in found) else np.full(len(found[0]), 1e3)

    def derivative(x: FloatArray) -> FloatArray:
        _, jacobian, rate = residuals(normal, start.branch, *unpack(x))
        columns = jacobian[:, free]
        if timed:
            return columns
        own = np.zeros((blocks * n, n))
        for block in range(blocks):
            own[np.arange(block * n, (block + 1) * n), np.arange(n)] = rate[block * n : (block + 1) * n]
        return np.hstack([columns, own])

    if not all(np.isfinite(part).all() for part in residuals(normal, start.branch, *unpack(x0))):
        return Answer.for_unjoined_links(start)
    result = least_squares(
        value, x0, jac=derivative, bounds=(low, high), x_scale="jac", xtol=1e-12, ftol=1e-13, gtol=1e-13, max_nfev=400
    )
    q, rotation = unpack(result.x)
    ordered = timed or bool(np.all(np.sign(np.diff(rotation)) == np.sign(rotation[-1] - rotation[0])))
    ordered = ordered and abs(rotation[-1] - rotation[0]) <= 2.0 * pi + 1e-9
    ended = replace(start, q=q, rotation=None if timed else rotation)
    quality = sum_of_squares(normal, ended)
    return Answer(
        start=replace(ended, quality=quality),
        feasible=bool(np.isfinite(quality)) and ordered,
        converged=bool(result.success),
        violation=0.0 if ordered else inf,
        worst="" if ordered else "order of the stations",
        status=str(result.message),
        iterations=int(result.nfev),
    )


class Distances(NamedTuple):
    """Distances between points of curve and target (units of the target's size), shape (k,), with their derivatives.

    Each distance depends on two points of the curve with the indices ``before`` and ``after``; ``early`` and ``late``, shape
    (2, k), are its derivatives with respect to the coordinates of these points.
    """

    distance: FloatArray
    before: NDArray[np.int64]
    after: NDArray[np.int64]
    early: FloatArray
    late: FloatArray


class Refinement:
    """Minimisation of the measure (area or greatest distance) between a curve and its target path.

    ``program`` has the objective "curve" or "least curve"; see `Statement`. Lengths are in units of the target's size.
    """

    def __init__(self, program: Program) -> None:
        self.program, normal = program, program.normal
        self.normal = normal
        assert normal.outline is not None
        #: Bound of the greatest distance from the target (units) if another function is minimised; else None.
        self.limit = program.least.error if program.objective == "least curve" else None
        self._target = TargetPath(points=_coordinates(normal.outline).T, closed=normal.closed)
        self._shares = np.linspace(0.0, 1.0, CURVE, endpoint=not normal.closed)
        self._trace = program.trace.map(CURVE)
        weights = normal.outline_weights
        even = bool((weights == weights[0]).all())
        self._scale = float(weights[0]) if even else 1.0
        self._by_area = normal.closed and even
        self._outline = _coordinates(normal.outline)
        self._line, self._weights = cut_into_pieces(normal.outline, weights / self._scale, normal.closed)
        self.free = np.nonzero(program.high > program.low)[0]
        if normal.closed and program.pivot is None:
            self.free = self.free[self.free != PHASE]
        if self.limit is not None:
            self.free = self.free[self.free != program.greatest_value_index]

    # The measure

    def trace(self, z: FloatArray, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute the curve's points, shape (2, n), and their derivatives with respect to the unknowns, shape (2, n, k)."""
        place, slopes = self._trace(z, parameters, self._shares)
        return np.ascontiguousarray(place), np.asarray(slopes).reshape(2, CURVE, len(z))

    def measure(self, curve: FloatArray) -> float:
        """Return the area (units squared) or the Hausdorff distance (units) between curve and target."""
        if not np.isfinite(curve).all():
            return inf
        if self.normal.quality == "worst":
            return float(max(near.distance.max() for near in self.both_distances(curve)))
        return self.area(curve)[0]

    def area(self, curve: FloatArray) -> tuple[float, FloatArray]:
        """Return the area between curve and target (units squared), and its gradient with respect to the curve's points."""
        gradient = np.zeros_like(curve)
        if self._by_area:
            area = symmetric_difference(curve, self._outline, gradient)
            return self._scale * area, self._scale * gradient
        closed = self.normal.closed
        steps = np.diff(closed_vertices(curve.T, closed), axis=0).T
        lengths = np.maximum(np.hypot(*steps), 1e-300)
        missed, away = self.both_distances(curve)
        w = self._weights * np.hypot(*np.diff(closed_vertices(self._line.T, closed), axis=0).T)
        v = self._weights[_nearest(_midpoints(curve, closed), self._line, closed)[1]]
        for near, weight in ((missed, w), (away, v * lengths)):
            np.add.at(gradient.T, near.before, (weight * near.early).T)
            np.add.at(gradient.T, near.after, (weight * near.late).T)
        # derivative of the lengths of the pieces, by which the distances are weighted
        pull = (v * away.distance * steps / lengths).T
        np.add.at(gradient.T, away.after, pull)
        np.add.at(gradient.T, away.before, -pull)
        total = float(w @ missed.distance + (v * lengths) @ away.distance)
        return 0.5 * self._scale * total, 0.5 * self._scale * gradient

    def both_distances(self, curve: FloatArray) -> tuple[Distances, Distances]:
        """Compute the distances of the target's pieces from the curve, and of the curve's pieces from the target.

        A piece is represented by its middle; if the greatest distance is minimised, the target's corners count as well.
        """
        closed, n = self.normal.closed, curve.shape[1]
        middles = _midpoints(self._line, closed)
        if self.normal.quality == "worst":
            # the corners are farthest off
            middles = np.hstack([self._outline, middles])
        distance, before, share, foot = _nearest(middles, curve, closed)
        along = (foot - middles) / np.maximum(distance, 1e-300)
        missed = Distances(distance, before, (before + 1) % n, (1.0 - share) * along, share * along)
        middles = _midpoints(curve, closed)
        distance, _, _, foot = _nearest(middles, self._line, closed)
        half = 0.5 * (middles - foot) / np.maximum(distance, 1e-300)
        before = np.arange(len(distance))
        return missed, Distances(distance, before, (before + 1) % n, half, half)

    # Minimisation

    def value(self, z: FloatArray, parameters: FloatArray, curve: FloatArray) -> float:
        """Return the value that is minimised: the measure or, if the measure is only bounded, the program's objective.

        The result is infinite if the bound is exceeded.
        """
        if self.limit is None:
            return self.measure(curve)
        return self.program.evaluate(z, parameters)[0] if self.excess_over_bound(curve) <= WITHIN * self.limit else inf

    def excess_over_bound(self, curve: FloatArray) -> float:
        """Return by how much the greatest distance exceeds its bound (units); negative if it does not."""
        if self.limit is None or not np.isfinite(curve).all():
            return inf
        return hausdorff(curve.T, self._target, closed=self.normal.closed) - self.limit

    def refine(
        self,
        answer: Answer,
        *,
        iterations: int = ITERATIONS,
        places: Sequence[FloatArray] | None = None,
        size: float = 1.0,
    ) -> Answer:
        """Minimise the measure near an answer; return the best answer found that meets the constraints.

        If there is none, return the given answer, marked as infeasible. For ``places`` and ``size`` see `Program.solve`.
        """
        program = self.program
        z0, parameters = program.unknowns_and_parameters(answer.start, places=places, size=size)
        curve, slopes = self.trace(z0, parameters)
        first = self.value(z0, parameters, curve)
        if not (np.isfinite(self.measure(curve)) and np.isfinite(slopes).all()):
            return replace(answer, feasible=False)
        unchanged = program.judge_unknowns(z0, parameters, answer.start)
        best = [(first if unchanged.feasible else inf, z0)]

        def record(z: FloatArray) -> None:
            value = self.value(z, parameters, down.curve(z)[0])
            if value < best[0][0] and program.judge_unknowns(z, parameters, answer.start).feasible:
                best[0] = (value, z)

        for some in self._distance_choices():
            z = best[0][1]
            curve, slopes = self.trace(z, parameters)
            scale = max(self.measure(curve), 1e-9)
            if self.limit is not None:
                # the path is judged at other points of the curves: tighten the bound by the excess
                scale *= self.limit / (self.limit + self.excess_over_bound(curve))
            down = _Descent(self, z, parameters, self._scaled_directions(curve, slopes), scale, some(curve))
            found = minimize(
                down.value, down.begin(), jac=True, method="SLSQP", constraints=down.constraints(),
                callback=lambda y, down=down: record(down.unknowns(y)),
                options={"maxiter": iterations, "ftol": CHANGE},
            )  # fmt: skip
            record(down.unknowns(found.x))
        value, z = best[0]
        if not np.isfinite(value):
            more = {} if self.limit is None or not unchanged.feasible else program.excess(self.excess_over_bound(curve))
            return replace(unchanged, feasible=False, start=replace(answer.start, quality=first), **more)
        ended = program.judge_unknowns(z, parameters, answer.start)
        quality = value if self.limit is None else ended.start.quality
        start = replace(ended.start, rotation=self.met(ended.start, z, parameters), quality=quality)
        return replace(ended, start=start, converged=bool(found.success), iterations=int(found.nit))

    def _distance_choices(self) -> Sequence[Callable[[FloatArray], Sequence[Any]]]:
        """Return, for each round of `refine`, a function that chooses the distances of a curve that are bounded.

        The first round bounds a few distances, the later rounds the large distances. If the greatest distance is not minimised,
        there is one round, without bounded distances.
        """
        if self.normal.quality != "worst":
            return (lambda _: (),)

        def choose_large(curve: FloatArray) -> Sequence[Any]:
            both = self.both_distances(curve)
            most = max(float(near.distance.max()) for near in both)
            return [np.nonzero(near.distance >= GREAT * most)[0] for near in both]

        def choose_few(curve: FloatArray) -> Sequence[Any]:
            corners = self._outline.shape[1]
            missed, away = (np.arange(len(near.distance)) for near in self.both_distances(curve))
            return np.concatenate([missed[:corners], missed[corners::STRIDE]]), away[::STRIDE]

        return choose_few, choose_large, choose_large

    def _scaled_directions(self, curve: FloatArray, slopes: FloatArray) -> FloatArray:
        """Return scaled directions in the space of the k unknowns, shape (k, number of unknowns that are not fixed).

        A step of 1 along a direction moves the curve perpendicular to itself by 1, in the root mean square. ``slopes`` are the
        derivatives that `trace` returns.
        """
        tangent = np.roll(curve, -1, axis=1) - np.roll(curve, 1, axis=1)
        normal = np.array([-tangent[1], tangent[0]]) / np.maximum(np.hypot(*tangent), 1e-300)
        across = (slopes * normal[:, :, None]).sum(axis=0)[:, self.free]
        size, directions = np.linalg.eigh(np.einsum("ni,nj->ij", across, across) / CURVE)
        stretch = np.zeros((slopes.shape[2], len(self.free)))
        # if nothing moves the point across its curve, as at the crank pin, all directions are equally good
        stretch[self.free] = directions / np.sqrt(np.maximum(size, 0.0) + STIFF * (size.max() or 1.0))
        return stretch

    def met(self, start: Start, z: FloatArray, parameters: FloatArray) -> FloatArray:
        """Find, by dynamic programming, the crank rotations at which the curve is nearest to the stations.

        The rotations are in the order of the stations. With a straight part the program's own rotations are returned.
        """
        normal, program = self.normal, self.program
        assert normal.points is not None
        assert start.rotation is not None
        rotation, forward = program.stations(z, parameters), copysign(1.0, start.rotation[-1] - start.rotation[0])
        if normal.straight is not None:
            return rotation
        curve = self.trace(z, parameters)[0].T @ np.array([1.0, 1j])
        turn = self._shares * 2.0 * pi
        if normal.closed:
            # from the point nearest to the first station, all the way round
            off = np.abs(np.angle(np.exp(1j * (turn - start.rotation[0]))))
            first = int(np.argmin(np.where(off <= WINDOW, np.abs(curve - normal.points[0]), inf)))
            order = (first + int(forward) * np.arange(CURVE)) % CURVE
            curve, at = curve[order], turn[first] + forward * turn
        else:
            at = rotation[0] + (rotation[-1] - rotation[0]) * self._shares
        cost = np.abs(normal.points[:, None] - curve) ** 2
        total, back = np.where(np.arange(CURVE) == 0, cost[0], inf), np.zeros(cost.shape, dtype=int)
        for k in range(1, normal.n):
            least = np.minimum.accumulate(total)
            back[k] = np.maximum.accumulate(np.where(total == least, np.arange(CURVE), 0))
            total = cost[k] + least
        place = np.empty(normal.n, dtype=int)
        place[-1] = int(total.argmin()) if normal.closed else CURVE - 1
        for k in range(normal.n - 1, 0, -1):
            place[k - 1] = back[k, place[k]]
        # between the points of the curve: the nearest point of the chord about each
        before, after = np.maximum(place - 1, 0), np.minimum(place + 1, CURVE - 1)
        chord = curve[after] - curve[before]
        share = ((normal.points - curve[before]) * chord.conj()).real / np.maximum(np.abs(chord) ** 2, 1e-300)
        met = forward * (at[before] + np.clip(share, 0.0, 1.0) * (at[after] - at[before]))
        met[[0, -1]] = forward * at[place[[0, -1]]]
        inner = np.clip(isotonic_regression(met).x, met[0], met[-1])
        return forward * (inner + APART * np.arange(normal.n))


class _Descent:
    """The problem for SLSQP: minimise the measure, relative to its first value, over steps y along scaled directions.

    If the greatest distance is minimised, y has one more component: the bound of all distances.
    """

    def __init__(
        self,
        refinement: Refinement,
        z0: FloatArray,
        parameters: FloatArray,
        stretch: FloatArray,
        size: float,
        some: Sequence[Any],
    ) -> None:
        self._refinement, self._program = refinement, refinement.program
        self._z0, self._stretch, self._size = z0, size * stretch, size
        if refinement.limit is not None:
            # the unknown that is minimised is a direction of its own
            self._stretch = np.column_stack([self._stretch, np.eye(len(z0))[refinement.program.greatest_value_index]])
        self._chosen = some
        self._bounds_distances = refinement.normal.quality == "worst"
        self._bound_unknown = self._bounds_distances and refinement.limit is None
        # SLSQP evaluates the curve twice at the same unknowns: for the measure and for the constraints
        self.curve = _cache_last(lambda z: refinement.trace(z, parameters))
        self._evaluate = _cache_last(lambda z: refinement.program.evaluate(z, parameters))
        self._differentiate = _cache_last(lambda z: refinement.program.gradient_and_jacobian(z, parameters))

    def begin(self) -> FloatArray:
        y = np.zeros(self._stretch.shape[1] + self._bound_unknown)
        y[self._stretch.shape[1] :] = 1.0
        return y

    def unknowns(self, y: FloatArray) -> FloatArray:
        """Return the program's unknowns after steps y along the scaled directions, clipped to their bounds."""
        z = self._z0 + self._stretch @ y[: self._stretch.shape[1]]
        return np.clip(z, self._program.low, self._program.high)

    def value(self, y: FloatArray) -> tuple[float, FloatArray]:
        """Return the function that SLSQP minimises and its gradient, after steps y along the scaled directions.

        If the links cannot be joined, the value is large and the gradient zero.
        """
        if self._bound_unknown:
            return float(y[-1]), np.append(np.zeros(len(y) - 1), 1.0)
        z = self.unknowns(y)
        curve, slopes = self.curve(z)
        if not (np.isfinite(curve).all() and np.isfinite(slopes).all()):
            return 1e3, np.zeros(len(y))
        added, _ = self._evaluate(z)
        if self._refinement.limit is not None:
            return added, self._differentiate(z)[0] @ self._stretch
        area, gradient = self._refinement.area(curve)
        whole = np.einsum("an,ank->k", gradient, slopes) + self._differentiate(z)[0]
        return (area + added) / self._size, whole @ self._stretch / self._size

    def _bounded_distances(self, z: FloatArray) -> list[tuple[Distances, Any]]:
        """Return both sets of distances between curve and target, each with the indices of the distances that are bounded."""
        return list(zip(self._refinement.both_distances(self.curve(z)[0]), self._chosen))

    def constraints(self) -> list[dict[str, Any]]:
        """Return the constraints for SLSQP: the program's constraints, the bounds of its unknowns, and bounds of distances."""
        program = self._program
        low, high = program.g_low, program.g_high
        equal = low == high
        above, below = np.isfinite(low) & ~equal, np.isfinite(high) & ~equal
        free = self._refinement.free
        lower, upper = free[np.isfinite(program.low[free])], free[np.isfinite(program.high[free])]
        width = len(self.begin())

        def pad(rows: FloatArray) -> FloatArray:
            return np.pad(rows @ self._stretch, ((0, 0), (0, width - self._stretch.shape[1])))

        def values(y: FloatArray) -> FloatArray:
            z = self._z0 + self._stretch @ y[: self._stretch.shape[1]]
            g = self._evaluate(z)[1]
            parts = [(g - low)[above], (high - g)[below], (z - program.low)[lower], (program.high - z)[upper]]
            if self._bounds_distances:
                # if the bound is no unknown, the distances are bounded by the size
                bound = y[-1] if self._bound_unknown else 1.0
                parts += [bound - near.distance[k] / self._size for near, k in self._bounded_distances(z)]
            return np.nan_to_num(np.concatenate(parts), nan=-1e3, neginf=-1e3)

        def slopes(y: FloatArray) -> FloatArray:
            z = self._z0 + self._stretch @ y[: self._stretch.shape[1]]
            j = self._differentiate(z)[1]
            eye = np.eye(len(z))
            rows = pad(np.vstack([j[above], -j[below], eye[lower], -eye[upper]]))
            if not self._bounds_distances:
                return rows
            jacobian = self.curve(z)[1]
            parts = []
            for near, k in self._bounded_distances(z):
                grown = np.einsum("ak,akz->kz", near.early[:, k], jacobian[:, near.before[k]])
                grown += np.einsum("ak,akz->kz", near.late[:, k], jacobian[:, near.after[k]])
                part = pad(-grown / self._size)
                part[:, -1] = 1.0 if self._bound_unknown else part[:, -1]
                parts.append(part)
            return np.nan_to_num(np.vstack([rows, *parts]))

        found = [{"type": "ineq", "fun": values, "jac": slopes}]
        if equal.any():
            found.append(
                {
                    "type": "eq",
                    "fun": lambda y: (self._evaluate(self.unknowns(y))[1] - low)[equal],
                    "jac": lambda y: pad(self._differentiate(self.unknowns(y))[1][equal]),
                }
            )
        return found


def _cache_last(function: Callable[[FloatArray], Made]) -> Callable[[FloatArray], Made]:
    """Return ``function`` with a cache of its last value, for a second call with the same unknowns."""
    last: list[tuple[bytes, Made]] = []

    def cached(z: FloatArray) -> Made:
        key = z.tobytes()
        if not last or last[0][0] != key:
            last[:] = [(key, function(z))]
        return last[0][1]

    return cached


def _coordinates(points: NDArray[np.complex128]) -> FloatArray:
    return np.ascontiguousarray([points.real, points.imag])


def _midpoints(line: FloatArray, closed: bool) -> FloatArray:
    """Return the midpoints of a polyline's segments, shape (2, number of segments)."""
    both = 0.5 * (line + np.roll(line, -1, axis=1))
    return np.ascontiguousarray(both if closed else both[:, :-1])


def _nearest(
    points: FloatArray, line: FloatArray, closed: bool
) -> tuple[FloatArray, NDArray[np.int64], FloatArray, FloatArray]:
    """Return each point's distance from a polyline, the nearest segment, the fraction along it, and the nearest point."""
    count = points.shape[1]
    distance, piece, share = np.empty(count), np.empty(count, dtype=np.int64), np.empty(count)
    find_nearest(points, line, closed, distance, piece, share)
    foot = (1.0 - share) * line[:, piece] + share * line[:, (piece + 1) % line.shape[1]]
    return distance, piece, share, foot


def cut_into_pieces(
    outline: NDArray[np.complex128], weights: FloatArray, closed: bool
) -> tuple[FloatArray, FloatArray]:
    """Cut the segments of an outline into short pieces; return the ends of the pieces, shape (2, n), and their weights."""
    points = np.append(outline, outline[0]) if closed else outline
    around = np.append(weights, weights[0]) if closed else weights
    lengths = np.abs(np.diff(points))
    counts = np.maximum(1, np.ceil(PIECES * lengths / lengths.sum())).astype(int)
    begin = np.concatenate([k + np.arange(count) / count for k, count in enumerate(counts)])
    where = np.arange(len(points))
    middles = begin + 0.5 / np.repeat(counts, counts)
    ends = begin if closed else np.append(begin, len(lengths))
    return _coordinates(np.interp(ends, where, points)), np.interp(middles, where, around)
