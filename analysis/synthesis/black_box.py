"""Synthesis with the quality function as a black box: differential evolution, and the thesis's downhill simplex.

Neither knows a derivative, and neither needs CasADi. They are here as a fallback and for comparison: `synthesize` with its scan
and exact derivatives is faster and reaches more (chapter VI of the thesis has only the simplex).

The quality is that of the task in normal form. Where the crank rotations are not given, they follow from the linkage:

- a path is compared with the coupler curve at equal shares of both lengths, in both directions of travel, so that a curve
  that collapses onto a piece of the target, or makes detours, is far from it;
- a few points, or poses, are met by the nearest places of the coupler curve that come in their order.

Links that cannot be joined are stretched until they meet: C lies then on the line through B and D, where the circles of
coupler and rocker have equal power, so that the quality has no cliff there. How far they are apart is a violated constraint, as
is every other inequality, and counts in proportion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import cos, degrees, pi, sqrt
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, NonlinearConstraint, OptimizeResult, differential_evolution, minimize

from linkwork.five_bar import kinematics

from ..numerics import symbolic
from ..numerics.tracing import rebound
from .constraints import TURNING, UNKNOWNS, Along, Limits, Require, half_planes
from .linkage import BY_SHORTEST, transmission_excess
from .polish import Polished, kept_of, quality_of
from .search import USUAL_SEARCH, Search, over_cores
from .starts import Answer, Start
from .tasks import Normal
from .user_functions import physical

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
OneSearch = Callable[["BlackBox", np.random.Generator], OptimizeResult]

#: Points of a coupler curve that a path is compared with.
CURVE = 128
#: Chords of a coupler curve on which the nearest places to a few points are looked for.
CHORDS = 180
#: Least crank rotation over which an open path is traced (rad).
SPAN = 0.1
#: An equality counts as satisfied within this.
EQUAL = 1e-4
#: Generations of differential evolution, and members of a generation for each unknown.
GENERATIONS, MEMBERS = 400, 10
#: Random linkages of which the best is a simplex's first vertex; edge of that simplex (units, rad).
DRAWS, EDGE = 64, 0.2
#: Factor of violated constraints in the simplex's quality function, in mean squared sizes of the target.
PENALTY = 10.0
#: Violation of a requirement that has no value, in its scale.
NO_VALUE = 1e3
#: Evaluations that a simplex may take for each unknown.
EVALUATIONS = 600

#: The plant's loop closure over arrays, its square root zero where the links cannot be joined.
_joined = rebound((kinematics,), {"sqrt": lambda square: np.sqrt(np.maximum(square, 0.0))}).joined


def by_differential_evolution(normal: Normal, limits: Limits, search: Search = USUAL_SEARCH) -> Polished:
    """SciPy's differential evolution, with the inequalities as its constraints.

    Parameters
    ----------
    normal : Normal
    limits : Limits
    search : Search
        Its starts are populations, in turn of either assembly.
    """
    return _searched(evolve, normal, limits, search, "differential evolution")


def by_simplex(normal: Normal, limits: Limits, search: Search = USUAL_SEARCH) -> Polished:
    """The thesis's method: the downhill simplex of Nelder and Mead from many starts (`initial_simplex`).

    The constraints are bounds and, by loop closure at every crank angle (6.14), that the links can be joined; what violates one
    of these, or of the others, is charged in proportion to how far.

    Parameters
    ----------
    normal, limits, search
        As for `by_differential_evolution`; each start is the best of `DRAWS` random linkages.
    """
    return _searched(descend, normal, limits, search, "simplex")


def initial_simplex(first: FloatArray, edge: float) -> FloatArray:
    """The regular simplex of n + 1 vertices about a first one, all edges of one length; shape (n + 1, n).

    The thesis's rule (6.11). Its formula is not legible in the copy at hand; this is the regular simplex of Spendley, Hext and
    Himsworth (Technometrics 4 (1962), p 441), which its description fits: the vertex k is off by p in the unknown k and by q
    in every other,

        p = e (sqrt(n + 1) + n - 1) / (n sqrt 2),   q = e (sqrt(n + 1) - 1) / (n sqrt 2).
    """
    n = len(first)
    p = edge * (sqrt(n + 1.0) + n - 1.0) / (n * sqrt(2.0))
    q = edge * (sqrt(n + 1.0) - 1.0) / (n * sqrt(2.0))
    vertices: FloatArray = np.vstack([np.zeros(n), np.full((n, n), q) + (p - q) * np.eye(n)]) + first
    return vertices


def _searched(one: OneSearch, normal: Normal, limits: Limits, search: Search, what: str) -> Polished:
    work = partial(_one, one, normal, limits, search.seed)
    found, interrupted = over_cores(work, range(search.starts), search, what)
    return Polished.of(found, kept_of(found), interrupted)


def _one(one: OneSearch, normal: Normal, limits: Limits, seed: int, number: int) -> Answer:
    """One search, in turn of either assembly."""
    box = BlackBox(normal, limits, limits.branches[number % len(limits.branches)])
    if not len(box.low):
        # the one linkage there is where bounds fix every dimension
        return box.answer(OptimizeResult(x=box.low, success=True, message="every dimension is fixed", nit=0))
    return box.answer(one(box, np.random.default_rng([seed, number])))


def _value(require: Require, p: SimpleNamespace) -> float:
    """Left side of a requirement; where it has no value, as the root of something negative, it is violated by `NO_VALUE`."""
    try:
        with np.errstate(all="ignore"):
            if require.symbolic:
                rotation = (require.rotation,) if isinstance(require, Along) else ()
                value = float(np.max(require.function(p, *map(symbolic.library().DM, rotation))))
            else:
                value = require.function(p)
    except (ValueError, ZeroDivisionError, OverflowError):
        return NO_VALUE * require.scale
    # a power of something negative is complex
    return NO_VALUE * require.scale if isinstance(value, complex) or not np.isfinite(value) else float(value)


def evolve(
    box: BlackBox,
    random: np.random.Generator,
    callback: Callable[[OptimizeResult], bool | None] | None = None,
    quality: Callable[[FloatArray], FloatArray] | None = None,
    *,
    maxiter: int = GENERATIONS,
    tol: float = 1e-8,
) -> OptimizeResult:
    """SciPy's differential evolution of a quality, by default the box's, over whole generations.

    ``callback(intermediate_result)`` sees each, and ends it by a true answer.
    """
    measure = quality or box.quality

    def violations(x: FloatArray) -> FloatArray:
        # of one vector first, of a generation then
        return box.violations(np.atleast_2d(x.T)).T.reshape(-1, *x.shape[1:])

    return differential_evolution(
        # SciPy asks for none where no member of a generation keeps the constraints
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


def descend(
    box: BlackBox, random: np.random.Generator, score: Callable[[FloatArray], float] | None = None
) -> OptimizeResult:
    """Nelder and Mead's simplex on a score, by default `BlackBox.charge`, from the best of `DRAWS` random linkages."""
    draws = random.uniform(box.low, box.high, (DRAWS, len(box.low)))
    return descend_from(box, draws[np.argmin(box.charged(draws))], score or box.charge)


def descend_from(box: BlackBox, first: FloatArray, score: Callable[[FloatArray], float]) -> OptimizeResult:
    """Nelder and Mead's simplex from a linkage, regular at the start and away from the nearer bounds."""
    away = np.where(first > 0.5 * (box.low + box.high), -1.0, 1.0)
    simplex = first + away * initial_simplex(np.zeros(len(first)), EDGE)
    return minimize(
        score,
        first,
        method="Nelder-Mead",
        bounds=Bounds(box.low, box.high),
        options={"initial_simplex": simplex, "maxfev": EVALUATIONS * len(first), "xatol": 1e-7, "fatol": 1e-12},
    )


class BlackBox:
    """The quality function of one assembly, and how far each constraint is violated, over rows of unknowns.

    The unknowns are those of `constraints.UNKNOWNS` that are free, and of an open path the rotation over which it is traced.

    Attributes
    ----------
    low, high : ndarray, shape (k,)
        Bounds of the unknowns; angles within a turn.
    """

    def __init__(self, normal: Normal, limits: Limits, branch: int) -> None:
        self.normal, self.limits, self.branch = normal, limits, branch
        low, high = limits.low.copy(), limits.high.copy()
        whole = high[7:] - low[7:] >= 2.0 * pi
        low[7:][whole], high[7:][whole] = -pi, pi
        if normal.points is not None:
            # farther off no point of the coupler reaches the target
            reach = high[3] + high[6] + 1.0
            near, far = np.maximum(low[:2], -reach), np.minimum(high[:2], reach)
            sensible = near <= far
            low[:2][sensible], high[:2][sensible] = near[sensible], far[sensible]
        self._free = np.nonzero(high > low)[0]
        self._fixed = low
        self._dense = not normal.timed and normal.angle is None and not normal.exact
        self._open = self._dense and not normal.closed
        self.low, self.high = low[self._free], high[self._free]
        if self._open:
            self.low, self.high = np.append(self.low, SPAN), np.append(self.high, 2.0 * pi)

    def quality(self, x: FloatArray) -> FloatArray:
        """Sum of weighted squared errors at the stations, shape (m,), in units squared."""
        q = self._linkages(x)
        return self._errors(q, self._rotations(x, q))

    def charged(self, x: FloatArray) -> FloatArray:
        """The quality and, in proportion, every violated constraint, shape (m,)."""
        q = self._linkages(x)
        rotation = self._rotations(x, q)
        charge = sum(np.maximum(value, 0.0) for _, value in self._inequalities(q, rotation))
        charged: FloatArray = self._errors(q, rotation) + PENALTY * self.normal.weights.sum() * charge
        return charged

    def charge(self, x: FloatArray) -> float:
        """`charged` of one linkage."""
        return float(self.charged(x[None, :])[0])

    def violations(self, x: FloatArray) -> FloatArray:
        """Left sides of the inequalities g(x) <= 0, shape (m, number of them)."""
        q = self._linkages(x)
        # what holds over a turn does not ask for the stations' rotations, which take most of the time
        needed = self.limits.turn is None or self.normal.straight is not None
        rotation = self._rotations(x, q) if needed else np.zeros((len(q), 1))
        return np.column_stack([value for _, value in self._inequalities(q, rotation)])

    def answer(self, result: OptimizeResult) -> Answer:
        """Where a search ended."""
        x = np.asarray(result.x)[None, :]
        q = self._linkages(x)
        rotation = self._rotations(x, q)
        inequalities = self._inequalities(q, rotation)
        worst, violation = max(((name, float(value[0])) for name, value in inequalities), key=lambda pair: pair[1])
        start = Start(q=q[0], branch=self.branch, rotation=None if self.normal.timed else rotation[0])
        quality = quality_of(self.normal, start)
        # the simplex comes to lie on a constraint, not within it
        kept = violation <= EQUAL and bool(np.isfinite(quality))
        return Answer(
            start=replace(start, quality=quality),
            feasible=kept,
            converged=bool(result.success),
            violation=max(0.0, violation),
            worst=worst if violation > 0.0 else "",
            excess=self._excess(worst, violation),
            status=str(result.message),
            iterations=int(result.nit),
        )

    def _excess(self, name: str, violation: float) -> str:
        """By how much an inequality is violated, with its unit."""
        required = next((require for require in self.limits.requires if require.name == name), None)
        if required is not None:
            return f"{required.scale * violation:.3g} {required.unit}".strip()
        if name == "crank rotation of the straight part":
            return f"{degrees(violation):.3g} deg"
        return f"{1e3 * self.normal.unit * violation:.3g} mm"

    # Linkages and their curves

    def _linkages(self, x: FloatArray) -> FloatArray:
        q = np.repeat(self._fixed[None, :], len(x), axis=0)
        q[:, self._free] = x[:, : len(self._free)]
        return q

    def _pins(self, q: FloatArray, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Components of the vector from B to D, in the frame of the ground link; shape (m, n)."""
        th2 = rotation + q[:, 8, None]
        return q[:, 2, None] - q[:, 3, None] * np.cos(th2), -q[:, 3, None] * np.sin(th2)

    def _directions(self, q: FloatArray, rotation: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Directions of coupler and rocker, shape (m, n); of other length than one where the links are stretched."""
        dx, dy = self._pins(q, rotation)
        with np.errstate(divide="ignore", invalid="ignore"):
            g = _joined(0.0, 0.0, dx, dy, q[:, 4, None], q[:, 5, None], float(self.branch))
        coupler, rocker = g.c3 + 1j * g.s3, g.c4 + 1j * g.s4
        # B on D: any direction
        return np.nan_to_num(coupler, nan=1.0), np.nan_to_num(rocker, nan=1.0)

    def _traced(self, q: FloatArray, rotation: FloatArray, coupler: ComplexArray) -> ComplexArray:
        turn = np.exp(1j * q[:, 7])
        point = q[:, 6] * np.exp(1j * q[:, 9])
        crank = q[:, 3, None] * np.exp(1j * (rotation + q[:, 8, None]))
        traced: ComplexArray = (q[:, 0] + 1j * q[:, 1])[:, None] + turn[:, None] * (crank + point[:, None] * coupler)
        return traced

    def _errors(self, q: FloatArray, rotation: FloatArray) -> FloatArray:
        normal = self.normal
        coupler, rocker = self._directions(q, rotation)
        squares: FloatArray = np.zeros(rotation.shape)
        if normal.points is not None:
            squares = np.abs(self._traced(q, rotation, coupler) - normal.points) ** 2
        if normal.angle is not None:
            squares = squares + self._turned(q, rotation, coupler, rocker, normal.angle) ** 2
        weighted = squares * normal.weights
        errors: FloatArray = np.sqrt(weighted.max(axis=1)) if normal.quality == "worst" else weighted.sum(axis=1)
        return errors

    def _turned(
        self, q: FloatArray, rotation: FloatArray, coupler: ComplexArray, rocker: ComplexArray, angle: FloatArray
    ) -> FloatArray:
        """Errors of angle, as lengths; where a link is stretched, its error is that of its direction."""
        own = rocker if self.normal.of_rocker else coupler * np.exp(1j * q[:, 7])[:, None]
        left: FloatArray = self.normal.leverage * np.angle(own * np.exp(1j * (q[:, 10, None] - angle)))
        return left

    def _rotations(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """Crank rotations of the stations, shape (m, n)."""
        if self.normal.rotation is not None:
            return np.broadcast_to(self.normal.rotation, (len(q), self.normal.n))
        span = x[:, -1] if self._open else np.full(len(q), 2.0 * pi)
        found = [(self._paired if self._dense else self._met)(q, way * span) for way in (1.0, -1.0)]
        forward = self._errors(q, found[0]) <= self._errors(q, found[1])
        return np.where(forward[:, None], *found)

    def _paired(self, q: FloatArray, span: FloatArray) -> FloatArray:
        """Rotations at the stations' shares of the length of the curve."""
        normal = self.normal
        assert normal.points is not None
        steps = np.abs(np.diff(np.append(normal.points, normal.points[0]) if normal.closed else normal.points))
        shares = (np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum())[: normal.n]
        rotation = span[:, None] * np.linspace(0.0, 1.0, CURVE + 1)
        curve = self._traced(q, rotation, self._directions(q, rotation)[0])
        length = np.hstack([np.zeros((len(q), 1)), np.cumsum(np.abs(np.diff(curve, axis=1)), axis=1)])
        return np.array([np.interp(shares * s[-1], s, r) for s, r in zip(length, rotation)])

    def _met(self, q: FloatArray, span: FloatArray) -> FloatArray:
        """Rotations of the nearest places of the curve that come in the order of the stations, by dynamic programming."""
        normal = self.normal
        assert normal.points is not None
        rotation = span[:, None] * np.linspace(0.0, 1.0, CHORDS + 1)
        coupler, rocker = self._directions(q, rotation)
        curve = self._traced(q, rotation, coupler)
        begin, chord = curve[:, :-1], np.diff(curve, axis=1)
        rows = np.arange(len(q))
        total = np.zeros((len(q), CHORDS))
        shares = np.empty((normal.n, len(q), CHORDS))
        before = np.empty((normal.n, len(q), CHORDS), dtype=int)
        for k, point in enumerate(normal.points):
            off = point - begin
            share = np.clip((off * chord.conj()).real / np.maximum(np.abs(chord) ** 2, 1e-300), 0.0, 1.0)
            cost = normal.weights[k] * np.abs(off - share * chord) ** 2
            if normal.angle is not None:
                turned = self._turned(q, rotation, coupler, rocker, normal.angle[k : k + 1])
                cost += normal.weights[k] * ((1.0 - share) * turned[:, :-1] + share * turned[:, 1:]) ** 2
            # the cheapest way to be at an earlier chord than this one
            least = np.minimum.accumulate(total, axis=1)
            new = np.hstack([np.ones((len(q), 1), dtype=bool), total[:, 1:] < least[:, :-1]])
            place = np.maximum.accumulate(np.where(new, np.arange(CHORDS), 0), axis=1)
            shares[k] = share
            if k == 0:
                total = cost
                continue
            before[k, :, 1:], before[k, :, 0] = place[:, :-1], 0
            total = cost + np.hstack([np.full((len(q), 1), np.inf), least[:, :-1]])
        at = total.argmin(axis=1)
        found = np.empty((len(q), normal.n))
        for k in range(normal.n - 1, -1, -1):
            found[:, k] = (at + shares[k, rows, at]) / CHORDS * span
            if k:
                at = before[k, rows, at]
        return found

    # Constraints

    def _inequalities(self, q: FloatArray, rotation: FloatArray) -> list[tuple[str, FloatArray]]:
        """Names and left sides of the inequalities g <= 0, each shape (m,)."""
        limits, normal = self.limits, self.normal
        l1, l2, l3, l4 = (q[:, k] for k in range(2, 6))
        found: list[tuple[str, FloatArray]] = []
        # distances from crank pin to rocker pivot: over the turn, and over the way of the task
        spans: list[tuple[FloatArray, FloatArray, float | None]] = []
        if limits.turn is not None:
            spans.append((np.abs(l1 - l2), l1 + l2, limits.turn))
        if limits.turn is None or limits.way is not None:
            distance = np.hypot(*self._pins(q, rotation))
            spans.append((distance.min(axis=1), distance.max(axis=1), limits.way))
        for nearest, farthest, least in spans:
            found += [
                ("loop closure", farthest - (l3 + l4)),
                ("loop closure", np.abs(l3 - l4) - nearest),
            ]
            if least is not None:
                # as lengths, so that no constraint outweighs another
                both = transmission_excess(l3, l4, nearest**2, farthest**2, cos(max(least, TURNING)))
                found += [("transmission angle", excess / (l3 + l4)) for excess in both]
        if limits.grashof is not None:
            links = q[:, 2:6]
            order = np.sort(links, axis=1)
            excess = order[:, 0] + order[:, 3] - order[:, 1] - order[:, 2]
            name = f"Grashof type {limits.grashof}"
            if limits.grashof == "triple-rocker":
                found.append((name, -excess))
            else:
                shortest = BY_SHORTEST.index(limits.grashof)
                found += [(name, excess), (name, links[:, shortest] - order[:, 0])]
        for pivot, pieces in limits.regions:
            place = q[:, 0] + 1j * q[:, 1]
            if pivot == "D":
                place = place + l1 * np.exp(1j * q[:, 7])
            corner = np.vstack([place.real, place.imag, np.ones(len(q))])
            outside = np.min([(half_planes(piece) @ corner).max(axis=0) for piece in pieces], axis=0)
            found.append((f"region of pivot {pivot}", outside))
        for require in limits.requires:
            columns = [
                physical(
                    SimpleNamespace(**dict(zip(UNKNOWNS, row.tolist())), branch=self.branch), normal.unit, normal.origin
                )
                for row in q
            ]
            value = np.array([_value(require, p) for p in columns]) / require.scale
            found.append((require.name, np.abs(value) - EQUAL if require.equal else value))
        straight = normal.straight
        if straight is not None:
            assert normal.points is not None
            spent = np.abs(rotation[:, straight.end] - rotation[:, straight.start])
            found.append(("crank rotation of the straight part", spent - straight.rotation))
            if straight.flatness is not None:
                line = normal.points[straight.end] - normal.points[straight.start]
                traced = self._traced(q, rotation, self._directions(q, rotation)[0])
                off = (traced[:, straight.start : straight.end + 1] * line.conjugate()).imag / abs(line)
                found.append(("flatness of the straight part", np.ptp(off, axis=1) - straight.flatness))
        return found
