"""Solve the nonlinear program of a synthesis by IPOPT, with exact derivatives from CasADi.

The module `statement` states the program. This module converts a linkage into a start of a search, a start into unknowns and
parameters of the program, and back. It evaluates and solves the program, and checks whether the answer meets the constraints;
if the pivot moves, also at the extremes of its motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from math import cos, inf, isfinite, pi
from types import SimpleNamespace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ...numerics import symbolic
from ...numerics.fourier import FourierSeries
from ..linkage.linkage import BY_SHORTEST, FiveBar, Linkage, SecondCrank, SliderCrank, SliderMotion, wrap_angles
from ..result.solution import Solution, nearest_rotations
from ..task.constraint import UNKNOWNS, half_planes
from ..task.limits import CrankUnknown, Limits, PivotUnknown, SliderUnknown
from ..task.task import Normal
from .statement import FURTHER, GRID, SOUGHT, Statement, convert_to_si, pivot_size

FloatArray = NDArray[np.float64]
Item = TypeVar("Item")
#: Barrier strategy of IPOPT: adaptive from a rough start, monotone with small steps from a first solution. Adaptive small steps
#: are taken in two cases: for the greatest error of a linkage with a fixed pivot, where monotone steps stall at a degenerate
#: optimum; and for a function that is minimised in place of an error, if larger steps leave the bounds, within which the start
#: lies, and do not come back.
FOLLOWING: dict[str, dict[str, Any]] = {
    "squares": {"mu_strategy": "adaptive"},
    "transmission": {"mu_strategy": "adaptive"},
    "least": {"mu_strategy": "adaptive"},
    "small": {"mu_strategy": "adaptive", "bound_push": 1e-8, "bound_frac": 1e-8},
    "worst": {"mu_strategy": "monotone", "mu_init": 1e-5, "bound_push": 1e-8, "bound_frac": 1e-8},
}
#: Limit of iterations of IPOPT: most optima are reached within a hundred, the others only after many.
ITERATIONS = 250
#: Initial amplitude of the motion of a pivot, relative to the ground link.
AMPLITUDE = 0.1
#: Tolerance of a constraint: units, rad, or a fraction of the bound.
KEPT = 1e-7
#: Margin of the bounds of the pivot's motion at its extremes, and the greatest number of times that extremes are updated.
HELD, ROUNDS = 2e-7, 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Dimensions and assembly of a linkage at which a search starts or ends, in normal form (see `Normal`)."""

    q: FloatArray  # values of `UNKNOWNS`, shape (11,)
    branch: int  # assembly, as in `Linkage`
    quality: float = inf  # value of the objective, in `Normal.unit` squared; for a greatest error, in `Normal.unit`
    given: bool = False  # whether the start is a guess, not a candidate of the scan
    # unknowns of a moving pivot: guide angle and mean position, or length and phase of a second crank; then cosine and sine
    # coefficient of each harmonic
    pivot: FloatArray = field(default_factory=lambda: np.empty(0))
    rotation: FloatArray | None = None  # crank rotations of the stations if they are unknown, shape (n,)
    linkage: type[Linkage] = Linkage  # a five-bar is a `Linkage` with a second crank in `pivot`


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """Result of an optimisation: the linkage that it reached, as a `Start`, and whether it meets every constraint.

    ``worst`` is the name of the constraint that is violated most. ``violation`` is the amount of this violation (multiples of
    `Normal.unit`, rad, or a fraction of the bound), and ``excess`` is the amount as text with its unit. ``status`` is the
    solver's message.
    """

    start: Start
    feasible: bool
    converged: bool = False
    violation: float = 0.0
    worst: str = ""
    excess: str = ""
    status: str = ""
    iterations: int = 0

    @classmethod
    def for_unjoined_links(cls, start: Start) -> Answer:
        """Return an infeasible answer for a start whose links cannot be joined."""
        status = "the links cannot be joined at the start"
        nowhere = replace(start, quality=inf)
        return cls(start=nowhere, feasible=False, violation=inf, worst="loop closure", status=status)


def clip_to_bounds(q: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the unknowns clipped to their bounds; angles outside their bounds are first shifted by whole turns."""
    q = q.copy()
    angles = slice(UNKNOWNS.index("ground_angle"), len(UNKNOWNS))
    middle = 0.5 * (low[angles] + high[angles])
    nearest = middle + wrap_angles(q[angles] - middle)
    outside = (q[angles] < low[angles]) | (q[angles] > high[angles])
    q[angles] = np.where(outside, nearest, q[angles])
    return np.clip(q, low, high)


def distances_from_bounds(normal: Normal, low: FloatArray, high: FloatArray, start: Start) -> FloatArray:
    """Return by how much each unknown of a start lies outside its bounds (multiples of `Normal.unit`, rad), shape (11,).

    The value is 0 for an unknown that does not affect the task.
    """
    q = clip_to_bounds(start.q, low[: len(UNKNOWNS)], high[: len(UNKNOWNS)])
    off = np.abs(wrap_angles(q - start.q))
    off[:7] = np.abs(q - start.q)[:7]
    idle: tuple[str, ...] = () if normal.angle is not None else ("output_angle",)
    if normal.of_rocker:
        idle = ("pivot_x", "pivot_y", "point_distance", "ground_angle", "point_angle")
    off[[UNKNOWNS.index(name) for name in idle]] = 0.0
    return off


def make_linkage(
    start: Start, normal: Normal, pivot: PivotUnknown | None = None, limits: Limits | None = None
) -> Linkage:
    """Build the linkage of a start, in SI; an angle is wrapped to [-pi, pi) if ``limits`` allow the wrapped angle."""
    q = start.q.copy()
    q[:7] *= normal.unit
    q[0] += normal.origin.real
    q[1] += normal.origin.imag
    angles = slice(UNKNOWNS.index("ground_angle"), len(UNKNOWNS))
    near = wrap_angles(q[angles])
    if limits is not None:
        outside = (near < limits.low[angles]) | (near > limits.high[angles])
        near = np.where(outside, q[angles], near)
    q[angles] = near
    v = start.pivot
    moved: SliderMotion | SecondCrank | None = None
    if isinstance(pivot, SliderUnknown) and len(v):
        cosines, sines = np.append(v[1], v[2::2]), np.append(0.0, v[3::2])
        moved = SliderMotion(FourierSeries(normal.unit * cosines, normal.unit * sines), float(v[0]))
    elif isinstance(pivot, CrankUnknown) and len(v):
        series = FourierSeries(np.append(0.0, v[2::2]), np.append(0.0, v[3::2]))
        moved = SecondCrank(normal.unit * float(v[0]), pivot.ratio, float(wrap_angles(v[1])), series)
    made: type[Linkage] = FiveBar if isinstance(moved, SecondCrank) else start.linkage
    return made.from_vector(q, start.branch, pivot=moved)


def make_start(
    linkage: Linkage, normal: Normal, pivot: PivotUnknown | None = None, rotation: FloatArray | None = None
) -> Start:
    """Convert a linkage to a start.

    The Fourier series of its pivot's motion is truncated, or padded with zeros, to the harmonics of ``pivot``. ``rotation`` has
    the crank rotations of the stations, if the task does not give them.
    """
    q = np.append(linkage.vector, linkage.output_angle)
    q[0] -= normal.origin.real
    q[1] -= normal.origin.imag
    q[:7] /= normal.unit
    v = np.zeros(pivot_size(pivot))
    if isinstance(pivot, SliderUnknown) and isinstance(linkage.pivot, SliderMotion):
        series = linkage.pivot.series.to_order(pivot.harmonics)
        v[0], v[1] = linkage.pivot.guide_angle, series.mean / normal.unit
        v[2::2], v[3::2] = series.cos[1:] / normal.unit, series.sin[1:] / normal.unit
    elif isinstance(pivot, CrankUnknown):
        v[0] = pivot.length[0] / normal.unit
        if isinstance(linkage.pivot, SecondCrank):
            series = linkage.pivot.series.to_order(pivot.harmonics)
            v[0], v[1] = linkage.pivot.length / normal.unit, linkage.pivot.phase
            v[2::2], v[3::2] = series.cos[1:], series.sin[1:]
    kind = SliderCrank if isinstance(linkage, SliderCrank) else Linkage
    return Start(q=q, branch=linkage.branch, pivot=v, rotation=rotation, given=True, linkage=kind)


def convert_to_start(given: Linkage | Solution, normal: Normal, pivot: PivotUnknown | None) -> Start:
    """Convert a linkage or solution to a start, with crank rotations for untimed stations.

    These are the rotations of the solution, or else the rotations at which the linkage is nearest to the stations. Raises
    InputError if the rotations are not known and the path is open: nearest rotations are found for closed paths only.
    """
    linkage, rotation = (given.linkage, given.evaluation.rotation) if isinstance(given, Solution) else (given, None)
    if normal.timed:
        rotation = None
    elif rotation is None or len(rotation) != normal.n:
        if normal.points is not None and normal.closed:
            rotation = nearest_rotations(linkage, normal.places)
        elif rotation is None:
            raise InputError("a start for an open path needs the crank rotations of its stations")
        else:
            rotation = np.interp(np.linspace(0.0, 1.0, normal.n), np.linspace(0.0, 1.0, len(rotation)), rotation)
    return make_start(linkage, normal, pivot, rotation)


def random_pivot(unknown: PivotUnknown, ground: float, unit: float, random: np.random.Generator) -> FloatArray:
    """Draw random unknowns of a moving pivot, within the bounds of the guide angle or of the second crank's length.

    ``unit`` is the size of the target (m), ``ground`` the ground link as a multiple of it. The coefficients of the harmonics
    decrease with their order. For a slider their size is a tenth of the ground link, or a quarter of the greatest stroke if
    this is less.
    """
    orders = np.repeat(np.arange(1, unknown.harmonics + 1), 2)
    waves = random.standard_normal(2 * unknown.harmonics) / (1.0 + orders)
    if isinstance(unknown, CrankUnknown):
        length = random.uniform(*unknown.length) / unit
        return np.array([length, random.uniform(-pi, pi), *(0.3 * waves)])
    low, high = unknown.guide_angle
    # a guide turned by pi is the same guide
    angle = low + min(high - low, pi) * random.random()
    size = min(AMPLITUDE * ground, 0.25 * unknown.stroke / unit)
    return np.array([angle, size * random.standard_normal(), *(size * waves)])


def keep_distinct(items: Iterable[Item], mark: Callable[[Item], FloatArray], distance: float, count: int) -> list[Item]:
    """Return the first ``count`` items that are distinct from one another.

    ``mark`` returns the vector that represents an item. Two items are distinct if a component of their vectors differs by at
    least ``distance``.
    """
    chosen: list[Item] = []
    marks: list[FloatArray] = []
    for item in items:
        own = mark(item)
        if any(np.abs(own - other).max() < distance for other in marks):
            continue
        marks.append(own)
        chosen.append(item)
        if len(chosen) == count:
            break
    return chosen


class Program(Statement):
    """A synthesis as a nonlinear program with its solver; the arguments are those of `Statement`."""

    @cached_property
    def _evaluate(self) -> Any:
        """Return a CasADi function of unknowns and parameters: the objective and the constraints.

        The values are finite if the links can be joined.
        """
        return self._casadi.Function("value", [self._nlp["x"], self._nlp["p"]], [self._nlp["f"], self._nlp["g"]])

    @cached_property
    def _initial_values(self) -> Any:
        """Return a function that computes the starting values of the auxiliary unknowns: greatest values, middles of ranges."""
        casadi, x, p = self._casadi, self._nlp["x"], self._nlp["p"]
        return casadi.Function("begin", [x, p], [casadi.vertcat(casadi.SX(0, 1), *self._initial)])

    @cached_property
    def _differentiate_motions(self) -> Any:
        """Return a function that computes the first two derivatives of the pivot's bounded motions at given extremes."""
        function = self._casadi.Function("curvature", [self._nlp["x"], self._nlp["p"]], self._peak_derivatives)
        return lambda z, parameters: function.call([z, parameters])

    @cached_property
    def _differentiate(self) -> Any:
        """Return a CasADi function: the gradient of the objective and the Jacobian of the constraints, both dense."""
        casadi, (x, p, f, g) = self._casadi, (self._nlp[name] for name in "xpfg")
        both = [casadi.densify(casadi.jacobian(e, x)) for e in (casadi.SX(f), g)]
        return casadi.Function("slopes", [x, p], both)

    def evaluate(self, z: FloatArray, parameters: FloatArray) -> tuple[float, FloatArray]:
        """Return objective and constraints at unknowns z and parameters; the constraints lie in [`g_low`, `g_high`] if met.

        The arguments are those that `unknowns_and_parameters` returns.
        """
        objective, constraints = self._evaluate(z, parameters)
        return float(objective), np.asarray(constraints).ravel()

    def gradient_and_jacobian(self, z: FloatArray, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the gradient of the objective, shape (k,), and the Jacobian of the constraints, shape (m, k)."""
        gradient, jacobian = (np.asarray(value) for value in self._differentiate(z, parameters))
        return gradient.ravel(), jacobian

    def stations(self, z: FloatArray, parameters: FloatArray) -> FloatArray:
        """Return the crank rotations of the stations at unknowns and parameters."""
        return np.asarray(self._station_rotations(z, parameters)).ravel()

    @cached_property
    def _station_rotations(self) -> Any:
        x, p = self._nlp["x"], self._nlp["p"]
        return self._casadi.Function("stations", [x, p], [self._casadi.SX(self._phi)])

    @cached_property
    def trace(self) -> Any:
        """Return a CasADi function of the unknowns, the parameters and a fraction (0 to 1) of the crank rotation of a path.

        The function computes the coupler point, shape (2, 1), and its derivatives with respect to the k unknowns, shape (2, k).
        """
        casadi, x, p = self._casadi, self._nlp["x"], self._nlp["p"]
        share = casadi.SX.sym("share")
        first, last = self._ends
        place = casadi.vertcat(*self._point(first + share * (last - first)))
        return casadi.Function("point", [x, p, share], [place, casadi.densify(casadi.jacobian(place, x))])

    def _solver(self, iterations: int, manner: str) -> Any:
        """Return an IPOPT solver with a limit of iterations and a strategy, a key of `FOLLOWING`."""
        if (iterations, manner) in self._solvers:
            return self._solvers[iterations, manner]
        self._solvers[iterations, manner] = symbolic.ipopt(
            "synthesis",
            self._nlp,
            max_iter=iterations,
            tol=1e-9,
            constr_viol_tol=1e-9,
            acceptable_tol=1e-7,
            acceptable_iter=8,
            bound_relax_factor=0.0,
            **FOLLOWING[manner],
        )
        return self._solvers[iterations, manner]

    def nearest_triangles(self, q: FloatArray) -> list[list[int]]:
        """Return, for each region, the indices of its triangles, the nearest to the pivot first."""
        order = []
        for name, triangles in self.limits.regions:
            x, y = float(q[0]), float(q[1])
            if name == "D":
                x, y = x + float(q[2] * np.cos(q[7])), y + float(q[2] * np.sin(q[7]))
            outside = [float((half_planes(t) @ [x, y, 1.0]).max()) for t in triangles]
            order.append([int(k) for k in np.argsort(outside, kind="stable")])
        return order

    def value(self, start: Start) -> float:
        """Return the value of the objective at a start; infinite if the links cannot be joined."""
        f = self.evaluate(*self.unknowns_and_parameters(start))[0]
        return f if isfinite(f) else inf

    @property
    def greatest_value_index(self) -> int:
        """Return the index of the unknown that bounds the minimised function, such as the greatest pin force, from above."""
        return len(self.low) - len(self._initial)

    def greatest_value(self, start: Start) -> float:
        """Return the greatest value over the rotations, at a start, of the minimised function, such as a pin force."""
        return float(np.asarray(self._initial_values(*self.unknowns_and_parameters(start))).ravel()[0])

    def unknowns_and_parameters(
        self,
        start: Start,
        *,
        size: float = 1.0,
        pieces: Sequence[int] | None = None,
        places: Sequence[FloatArray] | None = None,
        share: float | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """Convert a start to the unknowns and parameters of the program; for the other arguments see `solve`.

        ``share`` is the fraction of its bounds that the pivot's motion may use at the rotations at which it is bounded; by
        default it leaves the margin that `solve` needs.
        """
        count = pivot_size(self.pivot)
        pivot = np.zeros(count) if len(start.pivot) == 0 else start.pivot
        if len(pivot) != count:
            raise InputError(f"a start with {len(pivot)} unknowns of the pivot: there must be {count}")
        known = [clip_to_bounds(start.q, self.low[: len(UNKNOWNS)], self.high[: len(UNKNOWNS)]), pivot]
        direction = 1.0
        if not self.normal.timed:
            if start.rotation is None:
                raise InputError("the start of an untimed task needs the crank rotations of its stations")
            known.append(start.rotation[self.knots])
            direction = float(np.sign(start.rotation[-1] - start.rotation[0]) or 1.0)
        z = np.concatenate([*known, np.zeros(len(self._initial))])
        harmonics = 0 if self.pivot is None else self.pivot.harmonics
        count = len(self._peaks)
        along = [np.zeros(further.shape) for _, further in self._along_functions] if places is None else places[count:]
        if share is None:
            share = cos(pi * harmonics / max(GRID, 16 * harmonics)) if places is None else 1.0 - HELD
        held = [np.zeros(self._peak_count)] * count if places is None else places[:count]
        chosen = [nearest[0] for nearest in self.nearest_triangles(z)] if pieces is None else pieces
        parameters = np.concatenate(
            [
                [float(start.branch), direction, size, share],
                *(part for own in held for part in (own, np.zeros(self._peak_count))),
                *(own.ravel(order="F") for own in along),
                _grashof_rows(self.limits.grashof, z[2:6]).ravel(order="F"),
                *(half_planes(triangles[k]).ravel(order="F") for (_, triangles), k in zip(self.limits.regions, chosen)),
            ]
        )
        z = np.clip(z, self.low, self.high)
        if self._initial and (places is not None or self.objective != "squares"):
            # a first fit of squares starts farther away, and finds the middles itself
            z[-len(self._initial) :] = np.asarray(self._initial_values(z, parameters)).ravel()
        if self._peaks and places is not None:
            for number, derivatives in enumerate(self._differentiate_motions(z, parameters)):
                slope, bend = np.asarray(derivatives).reshape(-1, 2).T
                true = (np.abs(slope) < 1e-6) & (np.abs(bend) > 1e-3)
                begin = 4 + (2 * number + 1) * 2 * harmonics
                parameters[begin : begin + 2 * harmonics] = np.where(true, -0.5 / np.where(true, bend, 1.0), 0.0)
        return np.clip(z, self.low, self.high), parameters

    def solve(
        self,
        start: Start,
        *,
        size: float = 1.0,
        iterations: int = ITERATIONS,
        pieces: Sequence[int] | None = None,
        places: Sequence[FloatArray] | None = None,
        small: bool = False,
    ) -> Answer:
        """Solve the program from a start.

        Parameters
        ----------
        start : Start
        size : float
            Magnitude of the greatest error (units) or of the greatest value, if the program minimises one of these.
        iterations : int
            Limit of iterations.
        pieces : sequence of int, optional
            Index of the triangle of each region in which the pivot must lie; by default the nearest.
        places : sequence of ndarray, optional
            Crank rotations, from `extremes`, at which the bounds of the pivot's motion are imposed. Without these rotations the
            bounds are imposed on a grid, with a margin that guarantees the bounds everywhere.
        small : bool
            Whether the steps are small from the beginning.
        """
        z0, parameters = self.unknowns_and_parameters(start, size=size, pieces=pieces, places=places)
        if not all(np.isfinite(value).all() for value in self.evaluate(z0, parameters)):
            return Answer.for_unjoined_links(start)
        small = small or (self.objective == "worst" and self.pivot is None)
        solver = self._solver(iterations, "worst" if places is not None else "small" if small else self.objective)
        result = solver(x0=z0, lbx=self.low, ubx=self.high, lbg=self.g_low, ubg=self.g_high, p=parameters)
        stats = solver.stats()
        answer = self.judge_unknowns(np.asarray(result["x"]).ravel(), parameters, start)
        converged, status = bool(stats["success"]), str(stats["return_status"])
        return replace(answer, converged=converged, status=status, iterations=int(stats["iter_count"]))

    def judge_unknowns(self, z: FloatArray, parameters: FloatArray, start: Start) -> Answer:
        """Evaluate the program at unknowns z, reached from ``start``, and return the result as an answer.

        The values that CasADi returns with a solution are not used, because they are zero if IPOPT ends at NaN.
        """
        f, g = self.evaluate(z, parameters)
        over = np.maximum(self.g_low - g, g - self.g_high) if np.isfinite(g).all() else np.full(len(g), inf)
        violation = float(over.max(initial=0.0))
        worst = self.labels[int(np.argmax(over))] if len(over) else None
        size = float(parameters[2]) if self.objective in ("worst", *SOUGHT) else 1.0
        ended = self.recover_start(z, start, f * size)
        return Answer(
            start=ended,
            feasible=violation <= KEPT and bool(np.isfinite(z).all()) and isfinite(ended.quality),
            converged=True,
            violation=violation,
            worst=worst.name if worst else "",
            excess=worst.format_violation(violation, z) if worst else "",
        )

    def recover_start(self, z: FloatArray, start: Start, quality: float) -> Start:
        """Convert unknowns z to a start; ``start`` gives the rotations of the stations unless z has them all."""
        size = len(UNKNOWNS)
        end = size + pivot_size(self.pivot)
        rotation = None if self.normal.timed else start.rotation
        if not self.normal.timed and len(self.knots) == self.normal.n:
            rotation = z[end : end + self.normal.n]
        return replace(start, q=z[:size], pivot=z[size:end], rotation=rotation, quality=quality, given=False)

    def judge_start(self, start: Start) -> Answer:
        """Evaluate a start without optimising it; return an answer with its feasibility and its worst violation."""
        places = self.extremes(start)
        ways = product(*(range(len(triangles)) for _, triangles in self.limits.regions))
        best: Answer | None = None
        for way in ways:
            z, parameters = self.unknowns_and_parameters(start, pieces=way, places=places, share=1.0)
            answer = self.judge_unknowns(z, parameters, start)
            if best is None or answer.violation < best.violation:
                best = answer
        assert best is not None
        pivot = float(np.abs(best.start.pivot - start.pivot).max(initial=0.0))
        within = max(distances_from_bounds(self.normal, self.low, self.high, start).max(), pivot) <= KEPT
        return replace(best, feasible=best.feasible and within)

    def settle_extremes(self, answer: Answer, solve: Callable[[Start, Sequence[FloatArray]], Answer]) -> Answer:
        """Solve repeatedly, with bounds at the extremes of the previous solution, until the pivot's motion no longer changes.

        The extremes are the crank rotations that `extremes` returns. ``solve`` computes an answer from a start and its
        extremes.
        """
        if not (self._peaks or self._along_functions):
            return answer
        first = self.judge_start(answer.start) if self._along_functions else answer
        least = first if self.objective in SOUGHT else answer

        def better_answer(found: Answer) -> Answer:
            return found if not first.feasible or found.start.quality <= least.start.quality else answer

        now = answer
        for _ in range(ROUNDS):
            following = solve(now.start, self.extremes(now.start))
            if not following.feasible:
                return replace(answer, feasible=first.feasible)
            now, before = following, now
            kept = self.judge_start(now.start)
            if kept.feasible and np.abs(now.start.pivot - before.start.pivot).max(initial=0.0) <= KEPT:
                return better_answer(now)
        return better_answer(now) if kept.feasible else replace(answer, feasible=first.feasible)

    def extremes(self, start: Start) -> list[FloatArray]:
        """Return the crank rotations at which each bounded motion of the pivot, and each `RotationRequirement`, is extreme.

        The extremes of a motion, or of a derivative of it, are roots of the next derivative, a trigonometric polynomial.
        """
        if not self._peaks:
            return self._peak_rotations(start)
        harmonics = np.arange(1, self.pivot.harmonics + 1) if self.pivot else np.empty(0)
        waves = 0.5 * (start.pivot[2::2] - 1j * start.pivot[3::2])
        found = []
        for order, *_ in self._peaks:
            half = (1j * harmonics) ** (order + 1) * waves
            roots = np.roots(np.concatenate([half[::-1], [0.0], half.conj()]))
            places = np.zeros(2 * len(harmonics))
            places[: len(roots)] = np.angle(roots)
            found.append(places)
        return found + self._peak_rotations(start)

    def _peak_rotations(self, start: Start) -> list[FloatArray]:
        """Return the peaks of each `RotationRequirement`, as its method `find_peaks` returns them."""
        values = dict(zip(UNKNOWNS, start.q.tolist())) | {"branch": float(start.branch)}
        p = convert_to_si(SimpleNamespace(**values), self.normal.unit, self.normal.origin)
        return [along.find_peaks(p, FURTHER) for along, _ in self._along_functions]


def _grashof_rows(type_: str | None, links: FloatArray) -> FloatArray:
    """Return coefficients r of the conditions r . (l1, l2, l3, l4) <= 0 for a four-bar of this type, shape (6, 4).

    Unused rows are zero. The lengths of all triple-rockers do not form a convex set. For this type the conditions therefore
    also require that the shortest and the longest of ``links`` remain the shortest and the longest.
    """
    rows = np.zeros((6, 4))
    if type_ is None:
        return rows
    if type_ not in BY_SHORTEST:
        order = np.argsort(links)
        s, a, b, longest = (int(k) for k in order)
        rows[0, [a, b]], rows[0, [s, longest]] = 1.0, -1.0
        for k, other in enumerate((a, b)):
            rows[1 + k, s], rows[1 + k, other] = 1.0, -1.0
            rows[3 + k, other], rows[3 + k, longest] = 1.0, -1.0
        return rows
    shortest = BY_SHORTEST.index(type_)
    others = [k for k in range(4) if k != shortest]
    for k, other in enumerate(others):
        rows[k, shortest], rows[k, other] = 1.0, -1.0
        rows[3 + k] = [-1.0 if j != shortest and j != other else 1.0 for j in range(4)]
    return rows
