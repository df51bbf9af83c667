"""The nonlinear program of a synthesis: exact derivatives by CasADi, solved by IPOPT.

Loop closure is that of the plant, traced (`analysis.numerics.symbolic`). The program is stated in normal form (`tasks.Normal`,
`constraints.Limits`); what a start decides - assembly, direction of travel, which triangle of a region, which link is the
shortest - comes as parameters, so that one program serves all starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import cos, inf, isfinite, pi
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..mechanisms import FIVE_BAR
from ..numerics import symbolic
from ..run import traced as equations
from .constraints import TURNING, UNKNOWNS, Limits, half_planes
from .linkage import BY_SHORTEST, transmission_excess
from .starts import Answer, CrankUnknown, PivotUnknown, SliderUnknown, Start, inside, pivot_bounds, pivot_size
from .tasks import Normal
from .user_functions import physical, traced

FloatArray = NDArray[np.float64]
Objective = Literal["squares", "area", "transmission"]

#: Crank rotations at which a moving pivot's assembly, speed and acceleration are held within their limits, and what is added
#: to the least transmission angle for what is between them (rad).
GRID, BETWEEN = 96, 2.5e-3
#: Margin of a Grashof type, as a share of the links' sum: at zero a four-bar is a change-point.
MARGIN = 1e-4
#: How IPOPT follows its barrier: freely from a start that is only near, with care from one that a first solution gave.
FOLLOWING: dict[str, dict[str, Any]] = {
    "squares": {"mu_strategy": "adaptive"},
    "transmission": {"mu_strategy": "adaptive"},
    "area": {"mu_strategy": "monotone", "mu_init": 1e-5, "bound_push": 1e-8, "bound_frac": 1e-8},
}
#: Iterations of IPOPT: most optima are reached in a hundred, or in many.
ITERATIONS = 250
#: Least rotation of the crank from one untimed station to the next, as a share of an even one.
ADVANCE = 1e-3
#: Greatest, in even ones: in a wider gap the coupler point could wander off unseen between two stations.
GAP = 8.0


class Program:
    """A synthesis as a nonlinear program.

    Parameters
    ----------
    normal : Normal
    limits : Limits
    pivot : PivotUnknown, optional
        Lengths in m, as the task; None of a fixed pivot.
    objective : "squares", "area" or "transmission"
        Weighted squared errors; the area between the curves, smoothed by ``blur`` of `solve`; or the least transmission angle,
        greatest, with the stations met exactly.
    """

    def __init__(
        self, normal: Normal, limits: Limits, pivot: PivotUnknown | None = None, objective: Objective = "squares"
    ) -> None:
        self.normal, self.limits, self.pivot, self.objective = normal, limits, pivot, objective
        casadi = self._casadi = symbolic.library()
        SX = casadi.SX
        self._unknowns: list[tuple[Any, FloatArray, FloatArray]] = []
        self._constraints: list[tuple[Any, float, float, str]] = []
        self._solvers: dict[int, Any] = {}
        # parameters: branch, direction, blur, factor of the objective, rows of Grashof's type, half-planes of the regions
        branch, direction, blur, gain = (SX.sym(name) for name in ("branch", "direction", "blur", "gain"))
        grashof = SX.sym("grashof", 6, 4)
        planes = [SX.sym(f"plane{k}", 3, 3) for k in range(len(limits.regions))]
        # unknowns: dimensions, motion of the pivot, crank rotations
        q = self._unknown("q", limits.low, limits.high)
        v = self._unknown("v", *pivot_bounds(pivot, normal.unit))
        if normal.timed:
            phi: Any = casadi.DM(normal.rotation)
        else:
            phi = self._unknown("phi", np.full(normal.n, -inf), np.full(normal.n, inf))
            self._ordered(phi, direction)
        p = SimpleNamespace(**{name: q[k] for k, name in enumerate(UNKNOWNS)})
        quality = self._quality(p, v, phi, branch, blur)
        tilt: Any = None
        if objective == "transmission":
            # the largest |cos mu| of all, which is made small
            tilt = self._unknown("tilt", np.zeros(1), np.array([cos(TURNING)]))
            quality = tilt + 1e-3 * casadi.sumsqr(q[2:6])
        self._assembled(p, v, phi, tilt)
        if limits.grashof:
            margin = MARGIN * casadi.sum1(q[2:6]) * casadi.sum2(casadi.fabs(grashof)) / 4.0
            self._at_most(casadi.mtimes(grashof, q[2:6]) + margin, f"Grashof type {limits.grashof}")
        for (name, _), plane in zip(limits.regions, planes):
            x, y = p.pivot_x, p.pivot_y
            if name == "D":
                x = x + p.ground_length * casadi.cos(p.ground_angle)
                y = y + p.ground_length * casadi.sin(p.ground_angle)
            self._at_most(casadi.mtimes(plane, casadi.vertcat(x, y, 1.0)), f"region of pivot {name}")
        for require in limits.requires:
            value = traced(require, physical(p, normal.unit, normal.origin)) / require.scale
            self._within(value, 0.0 if require.equal else -inf, 0.0, require.name)
        if isinstance(pivot, SliderUnknown):
            quality = quality + self._slider(pivot, p.ground_length, v)
        if isinstance(pivot, CrankUnknown) and isfinite(pivot.speed):
            x = casadi.DM(np.linspace(0.0, 2.0 * pi, GRID, endpoint=False))
            rate = _series(casadi, v[2:], x, mean=False, order=1)
            self._within(rate, -pivot.speed, pivot.speed, "speed of the second crank")
        parameters = casadi.vertcat(branch, direction, blur, gain, *(casadi.vec(x) for x in (grashof, *planes)))
        z, lows, highs = zip(*self._unknowns)
        self.low, self.high = np.concatenate(lows), np.concatenate(highs)
        self._g_low = np.concatenate([np.empty(0), *(np.full(e.numel(), a) for e, a, _, _ in self._constraints)])
        self._g_high = np.concatenate([np.empty(0), *(np.full(e.numel(), b) for e, _, b, _ in self._constraints)])
        self._labels = [name for e, _, _, name in self._constraints for _ in range(e.numel())]
        g = casadi.vertcat(SX(0, 1), *(casadi.vec(e) for e, _, _, _ in self._constraints))
        self._nlp = {"x": casadi.vertcat(*z), "f": gain * quality, "g": g, "p": parameters}
        self._extra = len(self.low) - len(UNKNOWNS) - v.numel() - (0 if normal.timed else normal.n)

    def _unknown(self, name: str, low: FloatArray, high: FloatArray) -> Any:
        """A new column of unknowns between bounds."""
        symbol = self._casadi.SX.sym(name, len(low))
        self._unknowns.append((symbol, low, high))
        return symbol

    # Objective

    def _closed(self, p: Any, v: Any, phi: Any, branch: Any) -> tuple[Any, Any]:
        """Directions of the links and the coupler point (x, y) at rotations, by the plant's own loop closure."""
        casadi = self._casadi
        c2, s2 = casadi.cos(phi + p.crank_phase), casadi.sin(phi + p.crank_phase)
        dx, dy = self._displacement(v, phi)
        g = equations(FIVE_BAR).joined(
            c2,
            s2,
            p.ground_length + dx - p.crank_length * c2,
            dy - p.crank_length * s2,
            p.coupler_length,
            p.rocker_length,
            branch,
        )
        ca, sa = casadi.cos(p.ground_angle), casadi.sin(p.ground_angle)
        px = p.point_distance * casadi.cos(p.ground_angle + p.point_angle)
        py = p.point_distance * casadi.sin(p.ground_angle + p.point_angle)
        x = p.pivot_x + p.crank_length * (ca * c2 - sa * s2) + px * g.c3 - py * g.s3
        y = p.pivot_y + p.crank_length * (sa * c2 + ca * s2) + py * g.c3 + px * g.s3
        return g, (x, y)

    def _displacement(self, v: Any, phi: Any) -> tuple[Any, Any]:
        casadi = self._casadi
        if self.pivot is None:
            return 0.0, 0.0
        if isinstance(self.pivot, SliderUnknown):
            u = _series(casadi, v[1:], phi)
            return u * casadi.cos(v[0]), u * casadi.sin(v[0])
        psi = self.pivot.ratio * phi + v[1] + _series(casadi, v[2:], phi, mean=False)
        return v[0] * casadi.cos(psi), v[0] * casadi.sin(psi)

    def _quality(self, p: Any, v: Any, phi: Any, branch: Any, blur: Any) -> Any:
        """The quality function; with it the constraints that belong to it."""
        casadi, normal = self._casadi, self.normal
        g, point = self._closed(p, v, phi, branch)
        weights = casadi.DM(normal.weights)
        quality: Any = 0.0
        ex: Any = None
        ey: Any = None
        if normal.points is not None:
            ex, ey = point[0] - casadi.DM(normal.points.real), point[1] - casadi.DM(normal.points.imag)
        turned: Any = None
        if normal.angle is not None:
            c, s = (g.c4, g.s4) if normal.of_rocker else (g.c3, g.s3)
            wanted = casadi.DM(normal.angle) - p.output_angle - (0.0 if normal.of_rocker else p.ground_angle)
            ct, st = casadi.cos(wanted), casadi.sin(wanted)
            # the difference of the angles, without a jump at half a turn
            turned = casadi.atan2(s * ct - c * st, c * ct + s * st)
        if self.objective == "transmission":
            for value in (ex, ey, turned):
                if value is not None:
                    self._within(value, 0.0, 0.0, "the stations")
            return quality
        normals = normal.normals
        if normals is not None:
            across = ex * casadi.DM(normals.real) + ey * casadi.DM(normals.imag)
            along = ex * casadi.DM(normals.imag) - ey * casadi.DM(normals.real)
        if self.objective == "area":
            # the strip between the curves, station by station along the target's normals
            self._within(along, 0.0, 0.0, "stations on their normals")
            quality = casadi.sum1(weights * casadi.DM(normal.arc) * (casadi.sqrt(across**2 + blur**2) - blur))
        else:
            if ex is not None:
                quality = casadi.sum1(weights * (ex**2 + ey**2))
            if turned is not None:
                quality = quality + normal.leverage**2 * casadi.sum1(weights * turned**2)
        straight, points = normal.straight, normal.points
        if straight is not None and points is not None:
            part = slice(straight.start, straight.end + 1)
            line = points[straight.end] - points[straight.start]
            line /= abs(line)
            off = (ey * line.real - ex * line.imag)[part]
            spent = phi[straight.end] - phi[straight.start]
            self._within(spent, -straight.rotation, straight.rotation, "crank rotation of the straight part")
            if straight.flatness is None:
                quality = quality + (straight.weight - 1.0) * casadi.sumsqr(off)
            else:
                level = self._unknown("level", np.array([-inf]), np.array([inf]))
                half = 0.5 * straight.flatness
                # along the straight line through the part's ends, at the stations and in between
                x, y = self._closed(p, v, self._way(phi[part])[0], branch)[1]
                begin = points[straight.start]
                away = (y - begin.imag) * line.real - (x - begin.real) * line.imag
                self._within(away - level, -half, half, "flatness of the straight part")
        return quality

    # Constraints

    def _within(self, value: Any, low: float, high: float, name: str) -> None:
        self._constraints.append((value, low, high, name))

    def _at_most(self, value: Any, name: str) -> None:
        self._within(value, -inf, 0.0, name)

    def _ordered(self, phi: Any, direction: Any) -> None:
        """The stations come one after the other, within a turn."""
        n = self.normal.n
        least = ADVANCE * 2.0 * pi / n
        steps = direction * (phi[1:] - phi[:-1])
        most = GAP * 2.0 * pi / n
        self._within(steps, least, most, "order of the stations")
        total = direction * (phi[n - 1] - phi[0])
        closing = (2.0 * pi - most, 2.0 * pi - least) if self.normal.closed else (-inf, 2.0 * pi)
        self._within(total, *closing, "stations within a turn")

    def _assembled(self, p: Any, v: Any, phi: Any, tilt: Any) -> None:
        """The transmission angle keeps its distance over the turn, over the way of the task, or both."""
        casadi, limits = self._casadi, self.limits
        l1, l2 = p.ground_length, p.crank_length
        if limits.turn is not None and self.pivot is None:
            # with a fixed pivot its extremes are where the crank lies along the ground link
            self._transmitting(p, (l1 - l2) ** 2, (l1 + l2) ** 2, limits.turn, tilt)
        elif limits.turn is not None:
            d2 = self._reach(p, v, casadi.DM(np.linspace(0.0, 2.0 * pi, GRID, endpoint=False)))
            self._transmitting(p, d2, d2, limits.turn + BETWEEN, tilt)
        if limits.way is not None or (tilt is not None and limits.turn is None):
            x, step = self._way(phi)
            d2 = self._reach(p, v, x)
            # an extreme between two of these rotations is where the crank lies along the ground link: no more than this off
            slack = 2.0 * l1 * l2 * (1.0 - casadi.cos(0.5 * step))
            self._transmitting(p, d2 - slack, d2 + slack, limits.way or 0.0, tilt)

    def _transmitting(self, p: Any, nearest: Any, farthest: Any, least: float, tilt: Any) -> None:
        """|cos mu| is at most cos(least), and at most the tilt: for squares of the distance BD, written without division."""
        for cosine in (cos(max(least, TURNING)), *([] if tilt is None else [tilt])):
            for excess in transmission_excess(p.coupler_length, p.rocker_length, nearest, farthest, cosine):
                self._at_most(excess, "transmission angle")

    def _reach(self, p: Any, v: Any, x: Any) -> Any:
        """Square of the distance from crank pin to rocker pivot at rotations."""
        casadi = self._casadi
        dx, dy = self._displacement(v, x)
        bx = p.ground_length + dx - p.crank_length * casadi.cos(x + p.crank_phase)
        by = dy - p.crank_length * casadi.sin(x + p.crank_phase)
        return bx * bx + by * by

    def _way(self, phi: Any) -> tuple[Any, Any]:
        """The stations' rotations and some in between, and how far from each the next one is."""
        steps = 0.25 * (phi[1:] - phi[:-1])
        between = [phi[:-1] + k * steps for k in (1, 2, 3)]
        casadi = self._casadi
        return casadi.vertcat(phi, *between), casadi.vertcat(steps, steps[-1], steps, steps, steps)

    def _slider(self, pivot: SliderUnknown, ground: Any, v: Any) -> Any:
        """Bounds of the slider's motion; what its smoothness adds to the quality."""
        casadi, unit = self._casadi, self.normal.unit
        count = max(GRID, 16 * pivot.harmonics)
        x = casadi.DM(np.linspace(0.0, 2.0 * pi, count, endpoint=False))
        u = _series(casadi, v[1:], x)
        # a trigonometric polynomial is nowhere larger than at these points but for this factor (Ehlich and Zeller 1964)
        share = cos(pi * pivot.harmonics / count)
        if pivot.position is None:
            self._at_most(u - ground, "slider position")
            self._at_most(-u - ground, "slider position")
        else:
            self._within(u, pivot.position[0] / unit, pivot.position[1] / unit, "slider position")
        if isfinite(pivot.stroke):
            middle = self._unknown("middle", np.array([-inf]), np.array([inf]))
            half = 0.5 * share * pivot.stroke / unit
            self._within(u - middle, -half, half, "stroke")
        for order, bound, name in ((1, pivot.speed, "slider speed"), (2, pivot.acceleration, "slider acceleration")):
            if isfinite(bound):
                most = share * bound / unit
                self._within(_series(casadi, v[1:], x, order=order), -most, most, name)
        if not pivot.smoothness:
            return 0.0
        return pivot.smoothness * casadi.sumsqr(_series(casadi, v[1:], x, order=2)) / count

    # Solution

    @cached_property
    def _value(self) -> Any:
        """Objective and constraints as a function, to see whether a start can be evaluated at all."""
        return self._casadi.Function("value", [self._nlp["x"], self._nlp["p"]], [self._nlp["f"], self._nlp["g"]])

    def _solver(self, iterations: int) -> Any:
        """IPOPT with this many iterations at most."""
        if iterations in self._solvers:
            return self._solvers[iterations]
        self._solvers[iterations] = symbolic.ipopt(
            "synthesis",
            self._nlp,
            max_iter=iterations,
            tol=1e-9,
            constr_viol_tol=1e-9,
            acceptable_tol=1e-7,
            acceptable_iter=8,
            bound_relax_factor=0.0,
            **FOLLOWING[self.objective],
        )
        return self._solvers[iterations]

    def nearest_pieces(self, q: FloatArray) -> list[list[int]]:
        """For each region its triangles, the one that the pivot is in, or least far outside of, first."""
        order = []
        for name, triangles in self.limits.regions:
            x, y = float(q[0]), float(q[1])
            if name == "D":
                x, y = x + float(q[2] * np.cos(q[7])), y + float(q[2] * np.sin(q[7]))
            outside = [float((half_planes(t) @ [x, y, 1.0]).max()) for t in triangles]
            order.append([int(k) for k in np.argsort(outside, kind="stable")])
        return order

    def value(self, start: Start) -> float:
        """The objective of a start, the area not smoothed; infinite where the links cannot be joined."""
        parts = [start.q, start.pivot if len(start.pivot) else np.zeros(pivot_size(self.pivot))]
        if start.rotation is not None:
            parts.append(start.rotation)
        parameters = np.zeros(self._nlp["p"].numel())
        parameters[[0, 1, 3]] = start.branch, 1.0, 1.0
        f = float(self._value(np.concatenate([*parts, np.zeros(self._extra)]), parameters)[0])
        return f if isfinite(f) else inf

    def solve(
        self,
        start: Start,
        *,
        blur: float = 1e-3,
        gain: float = 1.0,
        iterations: int = ITERATIONS,
        pieces: Sequence[int] | None = None,
    ) -> Answer:
        """Solve from a start.

        Parameters
        ----------
        start : Start
        blur : float
            Distance below which an area's absolute value is smooth (units).
        gain : float
            Factor on the objective, one over its magnitude.
        iterations : int
            At most.
        pieces : sequence of int, optional
            Which triangle of each region; the nearest by default.
        """
        limits = self.limits
        lower, upper = self.low, self.high
        size = pivot_size(self.pivot)
        pivot = np.zeros(size) if len(start.pivot) == 0 else start.pivot
        if len(pivot) != size:
            raise InputError(f"a start with {len(pivot)} unknowns of the pivot: there must be {size}")
        guess = [start.q, pivot]
        direction = 1.0
        if not self.normal.timed:
            if start.rotation is None:
                raise InputError("the start of an untimed task needs the crank rotations of its stations")
            guess.append(start.rotation)
            direction = float(np.sign(start.rotation[-1] - start.rotation[0]) or 1.0)
        guess[0] = inside(start.q, lower[: len(UNKNOWNS)], upper[: len(UNKNOWNS)])
        z0 = np.clip(np.concatenate([*guess, np.zeros(self._extra)]), lower, upper)
        parameters = [
            float(start.branch),
            direction,
            blur,
            gain,
            *_grashof_rows(limits.grashof, z0[2:6]).ravel(order="F"),
        ]
        chosen = [nearest[0] for nearest in self.nearest_pieces(z0)] if pieces is None else pieces
        for (_, triangles), k in zip(limits.regions, chosen):
            parameters += half_planes(triangles[k]).ravel(order="F").tolist()
        if not all(np.isfinite(np.asarray(value)).all() for value in self._value(z0, parameters)):
            return Answer.unjoined(start)
        solver = self._solver(iterations)
        result = solver(x0=z0, lbx=lower, ubx=upper, lbg=self._g_low, ubg=self._g_high, p=parameters)
        stats = solver.stats()
        z = np.asarray(result["x"]).ravel()
        # evaluated anew: where IPOPT ends at a number that is not one, CasADi returns zeros
        f, g = (np.asarray(value).ravel() for value in self._value(z, parameters))
        over = np.maximum(self._g_low - g, g - self._g_high) if np.isfinite(g).all() else np.full(len(g), inf)
        violation = float(over.max(initial=0.0))
        end = len(UNKNOWNS) + size
        answer = Start(
            q=z[: len(UNKNOWNS)],
            branch=start.branch,
            pivot=z[len(UNKNOWNS) : end],
            rotation=None if self.normal.timed else z[end : end + self.normal.n],
            quality=float(f[0]) / gain,
        )
        return Answer(
            start=answer,
            feasible=violation <= 1e-7 and bool(np.isfinite(z).all()) and isfinite(answer.quality),
            converged=bool(stats["success"]),
            violation=violation,
            worst=self._labels[int(np.argmax(over))] if len(over) else "",
            status=str(stats["return_status"]),
            iterations=int(stats["iter_count"]),
        )


def _series(casadi: Any, coefficients: Any, x: Any, *, mean: bool = True, order: int = 0) -> Any:
    """A Fourier series, or a derivative of it, at x: mean (where there is one), then cosine and sine of each harmonic."""
    value = (coefficients[0] if order == 0 else 0.0) + 0.0 * x if mean else 0.0 * x
    first = 1 if mean else 0
    for k in range((coefficients.numel() - first) // 2):
        harmonic = k + 1
        a, b = coefficients[first + 2 * k], coefficients[first + 2 * k + 1]
        for _ in range(order):
            a, b = harmonic * b, -harmonic * a
        value = value + a * casadi.cos(harmonic * x) + b * casadi.sin(harmonic * x)
    return value


def _grashof_rows(type_: str | None, links: FloatArray) -> FloatArray:
    """Rows r with r . (l1, l2, l3, l4) <= 0 that a four-bar of this type satisfies, shape (6, 4); zero rows ask nothing.

    Of a triple-rocker, whose links are not convex in their lengths, the shortest and the longest stay what they are.
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
