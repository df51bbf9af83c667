"""Synthesise four-bars by black-box searches: differential evolution, and the downhill simplex of the thesis.

Neither method uses derivatives.

The quality function is that of the task in normal form. For a path without crank rotations, it compares points of the path with
points of the coupler curve at equal shares of the two lengths, in both directions of travel. A coupler curve that collapses
onto a piece of the target, or makes detours, therefore has a large error. The constraints are those of the benchmarks: bounds,
transmission angle, full turn.

If the links cannot be joined, they are stretched until they meet: C then lies on the line through B and D, where the circles of
coupler and rocker have equal power, so that the quality stays continuous. The gap between the links is a violated constraint,
with a proportional penalty like every other inequality.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cos, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, NonlinearConstraint, OptimizeResult, differential_evolution, minimize

from analysis.numerics.tracing import rebind_functions
from analysis.synthesis.linkage.linkage import Linkage
from analysis.synthesis.search.fit import sum_of_squares
from analysis.synthesis.search.program import Answer, Start
from analysis.synthesis.task.constraint import TURNING
from analysis.synthesis.task.limits import Limits
from analysis.synthesis.task.task import Normal
from linkwork.five_bar import kinematics

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
#: Violation up to which a constraint counts as satisfied.
KEPT = 1e-4
#: Number of steps of a coupler curve that is compared with a path.
CURVE = 128
#: Least crank rotation over which an open path is traced (rad).
SPAN = 0.1
#: Generations of differential evolution, and number of members of a generation per unknown.
GENERATIONS, MEMBERS = 400, 10
#: Number of random linkages, the best of which is the first vertex of a simplex; edge of this simplex (units, rad).
DRAWS, EDGE = 64, 0.2
#: Factor of constraint violations in the penalised quality, in squares of the target's size.
PENALTY = 10.0
#: Greatest number of evaluations of a simplex search per unknown.
EVALUATIONS = 600
#: Loop closure of the five-bar model for arrays; square roots of negative numbers, where links cannot be joined, are zero.
_close_loop = rebind_functions((kinematics,), {"sqrt": lambda square: np.sqrt(np.maximum(square, 0.0))}).close_loop


def initial_simplex(first: FloatArray, edge: float) -> FloatArray:
    """Return the regular simplex with a given first vertex and edge length, shape (n + 1, n).

    This is the thesis's rule (6.11). Its formula is not legible in the copy at hand; the regular simplex of Spendley, Hext and
    Himsworth (Technometrics 4 (1962), p 441) fits its description: the vertex k is off by p in the unknown k and by q in every
    other unknown,

        p = e (sqrt(n + 1) + n - 1) / (n sqrt 2),   q = e (sqrt(n + 1) - 1) / (n sqrt 2).
    """
    n = len(first)
    p = edge * (sqrt(n + 1.0) + n - 1.0) / (n * sqrt(2.0))
    q = edge * (sqrt(n + 1.0) - 1.0) / (n * sqrt(2.0))
    return np.vstack([np.zeros(n), np.full((n, n), q) + (p - q) * np.eye(n)]) + first


def evolve(
    box: BlackBox,
    random: np.random.Generator,
    callback: Callable[[OptimizeResult], bool | None] | None = None,
    quality: Callable[[FloatArray], FloatArray] | None = None,
    *,
    maxiter: int = GENERATIONS,
    tol: float = 1e-8,
) -> OptimizeResult:
    """Minimise a quality function, by default that of the box, by SciPy's differential evolution on whole generations.

    ``callback(intermediate_result)`` is called after each generation, and ends the search if it returns true.
    """
    measure = quality or box.quality

    def violations(x: FloatArray) -> FloatArray:
        # SciPy passes one vector at first, then a generation
        return box.violations(np.atleast_2d(x.T)).T.reshape(-1, *x.shape[1:])

    return differential_evolution(
        # if no member of a generation satisfies the constraints, SciPy passes no vectors
        lambda x: measure(x.T) if x.size else np.empty(0),
        Bounds(box.low, box.high),
        maxiter=maxiter,
        popsize=MEMBERS,
        tol=tol,
        init="sobol",
        updating="deferred",
        vectorized=True,
        polish=False,
        constraints=(NonlinearConstraint(violations, -np.inf, 0.0),),
        callback=callback,
        rng=random,
    )


def minimise_score(box: BlackBox, first: FloatArray, score: Callable[[FloatArray], float]) -> OptimizeResult:
    """Minimise a score by Nelder and Mead's method from a regular simplex with its first vertex at the linkage ``first``.

    In each unknown the simplex extends away from the nearer bound.
    """
    away = np.where(first > 0.5 * (box.low + box.high), -1.0, 1.0)
    simplex = first + away * initial_simplex(np.zeros(len(first)), EDGE)
    options = {"initial_simplex": simplex, "maxfev": EVALUATIONS * len(first), "xatol": 1e-7, "fatol": 1e-12}
    return minimize(score, first, method="Nelder-Mead", bounds=Bounds(box.low, box.high), options=options)


class BlackBox:
    """Quality function and constraint violations of a task for one assembly of the linkage, as functions of the unknowns.

    The unknowns are the free ones of `constraints.UNKNOWNS` and, for an open path, the crank rotation over which it is traced.
    Methods take m linkages at once: ``x`` has the shape (m, k). ``low`` and ``high``, shape (k,), are the bounds of the
    unknowns; angles are within a turn.
    """

    def __init__(self, normal: Normal, limits: Limits, branch: int) -> None:
        self.normal, self.limits, self.branch = normal, limits, branch
        low, high = limits.low.copy(), limits.high.copy()
        whole = high[7:] - low[7:] >= 2.0 * pi
        low[7:][whole], high[7:][whole] = -pi, pi
        if normal.points is not None:
            # from a pivot farther away no point of the coupler reaches the target
            reach = high[3] + high[6] + 1.0
            near, far = np.maximum(low[:2], -reach), np.minimum(high[:2], reach)
            sensible = near <= far
            low[:2][sensible], high[:2][sensible] = near[sensible], far[sensible]
        self._free = np.nonzero(high > low)[0]
        self._fixed = low
        self._open = not normal.timed and not normal.closed
        self.low, self.high = low[self._free], high[self._free]
        if self._open:
            self.low, self.high = np.append(self.low, SPAN), np.append(self.high, 2.0 * pi)

    def quality(self, x: FloatArray) -> FloatArray:
        """Return the sum of weighted squared errors at the stations, shape (m,), with lengths in units of the normal form."""
        q = self._linkages(x)
        return self._errors(q, self._rotations(x, q))

    def penalised_qualities(self, x: FloatArray) -> FloatArray:
        """Return the quality plus proportional penalties for violated constraints, shape (m,)."""
        q = self._linkages(x)
        rotation = self._rotations(x, q)
        charge = sum(np.maximum(value, 0.0) for _, value in self._inequalities(q, rotation))
        return self._errors(q, rotation) + PENALTY * self.normal.weights.sum() * charge

    def penalised_quality(self, x: FloatArray) -> float:
        """Return the penalised quality of one linkage; see `penalised_qualities`."""
        return float(self.penalised_qualities(x[None, :])[0])

    def violations(self, x: FloatArray) -> FloatArray:
        """Return the left sides g of the inequalities g(x) <= 0, shape (m, number of inequalities)."""
        q = self._linkages(x)
        # constraints over a whole turn do not need the stations' rotations, which take most of the time
        rotation = self._rotations(x, q) if self.limits.turn is None else np.zeros((len(q), 1))
        return np.column_stack([value for _, value in self._inequalities(q, rotation)])

    def answer(self, result: OptimizeResult) -> Answer:
        """Convert the result of a search to an `Answer`."""
        x = np.asarray(result.x)[None, :]
        q = self._linkages(x)
        rotation = self._rotations(x, q)
        inequalities = self._inequalities(q, rotation)
        worst, violation = max(((name, float(value[0])) for name, value in inequalities), key=lambda pair: pair[1])
        start = Start(q=q[0], branch=self.branch, rotation=None if self.normal.timed else rotation[0])
        quality = sum_of_squares(self.normal, start)
        # the simplex may end at a constraint with a small violation
        kept = violation <= KEPT and bool(np.isfinite(quality))
        return Answer(
            start=replace(start, quality=quality),
            feasible=kept,
            converged=bool(result.success),
            violation=max(0.0, violation),
            worst=worst if violation > 0.0 else "",
            excess="",
            status=str(result.message),
            iterations=int(result.nit),
        )

    # Linkages and their curves

    def _linkages(self, x: FloatArray) -> FloatArray:
        q = np.repeat(self._fixed[None, :], len(x), axis=0)
        q[:, self._free] = x[:, : len(self._free)]
        return q

    def _pins(self, q: FloatArray, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the components of the vector from B to D in the frame of the ground link, shape (m, n)."""
        th2 = rotation + q[:, 8, None]
        return q[:, 2, None] - q[:, 3, None] * np.cos(th2), -q[:, 3, None] * np.sin(th2)

    def _directions(self, q: FloatArray, rotation: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the directions of coupler and rocker as complex numbers, shape (m, n).

        They are not unit vectors if the links are stretched.
        """
        dx, dy = self._pins(q, rotation)
        with np.errstate(divide="ignore", invalid="ignore"):
            g = _close_loop(0.0, 0.0, dx, dy, q[:, 4, None], q[:, 5, None], float(self.branch))
        coupler, rocker = g.c3 + 1j * g.s3, g.c4 + 1j * g.s4
        # if B is on D, take any direction
        return np.nan_to_num(coupler, nan=1.0), np.nan_to_num(rocker, nan=1.0)

    def _coupler_points(self, q: FloatArray, rotation: FloatArray, coupler: ComplexArray) -> ComplexArray:
        turn = np.exp(1j * q[:, 7])
        point = q[:, 6] * np.exp(1j * q[:, 9])
        crank = q[:, 3, None] * np.exp(1j * (rotation + q[:, 8, None]))
        return (q[:, 0] + 1j * q[:, 1])[:, None] + turn[:, None] * (crank + point[:, None] * coupler)

    def _errors(self, q: FloatArray, rotation: FloatArray) -> FloatArray:
        normal = self.normal
        coupler, rocker = self._directions(q, rotation)
        if normal.points is not None:
            errors = np.abs(self._coupler_points(q, rotation, coupler) - normal.points)
        else:
            # a stretched link counts by its direction
            assert normal.angle is not None
            errors = normal.leverage * np.angle(rocker * np.exp(1j * (q[:, 10, None] - normal.angle)))
        return (errors**2 * normal.weights).sum(axis=1)

    def _rotations(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """Return the crank rotations at the stations, shape (m, n)."""
        if self.normal.rotation is not None:
            return np.broadcast_to(self.normal.rotation, (len(q), self.normal.n))
        span = x[:, -1] if self._open else np.full(len(q), 2.0 * pi)
        found = [self._paired_rotations(q, way * span) for way in (1.0, -1.0)]
        forward = self._errors(q, found[0]) <= self._errors(q, found[1])
        return np.where(forward[:, None], *found)

    def _paired_rotations(self, q: FloatArray, span: FloatArray) -> FloatArray:
        """Return the crank rotations that pair points of each coupler curve with the stations by arc length, shape (m, n).

        At each rotation the coupler curve has covered the same fraction of its length as the target has at the station. ``q``
        has m linkages; ``span``, shape (m,), is the signed crank rotation over each whole curve.
        """
        normal = self.normal
        assert normal.points is not None
        steps = np.abs(np.diff(np.append(normal.points, normal.points[0]) if normal.closed else normal.points))
        shares = (np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum())[: normal.n]
        rotation = span[:, None] * np.linspace(0.0, 1.0, CURVE + 1)
        curve = self._coupler_points(q, rotation, self._directions(q, rotation)[0])
        length = np.hstack([np.zeros((len(q), 1)), np.cumsum(np.abs(np.diff(curve, axis=1)), axis=1)])
        return np.array([np.interp(shares * s[-1], s, r) for s, r in zip(length, rotation)])

    # Constraints

    def _inequalities(self, q: FloatArray, rotation: FloatArray) -> list[tuple[str, FloatArray]]:
        """Return the name and the left side g of each inequality g <= 0; each g has the shape (m,)."""
        limits = self.limits
        l1, l2, l3, l4 = (q[:, k] for k in range(2, 6))
        found: list[tuple[str, FloatArray]] = []
        # least and greatest distance from crank pin to rocker pivot: over the whole turn, and over the rotations of the task
        spans: list[tuple[FloatArray, FloatArray, float | None]] = []
        if limits.turn is not None:
            spans.append((np.abs(l1 - l2), l1 + l2, limits.turn))
        if limits.turn is None or limits.way is not None:
            distance = np.hypot(*self._pins(q, rotation))
            spans.append((distance.min(axis=1), distance.max(axis=1), limits.way))
        for nearest, farthest, least in spans:
            found += [("loop closure", farthest - (l3 + l4)), ("loop closure", np.abs(l3 - l4) - nearest)]
            if least is not None:
                # converted to lengths, so that no constraint outweighs another
                both = Linkage.transmission_excess(l3, l4, nearest**2, farthest**2, cos(max(least, TURNING)))
                found += [("transmission angle", excess / (l3 + l4)) for excess in both]
        return found
