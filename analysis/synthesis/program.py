"""The nonlinear program of a synthesis: exact derivatives by CasADi, solved by IPOPT.

Loop closure is that of the plant, traced (`analysis.numerics.symbolic`). The program is stated in normal form (`tasks.Normal`,
`constraints.Limits`); what a start decides - assembly, direction of travel, which triangle of a region, which link is the
shortest - comes as parameters, so that one program serves all starts.
"""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import cos, inf, isfinite, pi
from types import CellType, CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, ParameterError

from ..numerics import symbolic
from ..numerics.fourier import FourierSeries
from .constraints import UNKNOWNS, Limits, Require
from .linkage import Linkage, SecondCrank, SliderMotion
from .tasks import Normal

FloatArray = NDArray[np.float64]
Objective = Literal["squares", "area", "transmission"]

#: Least transmission angle at which a crank still counts as turning fully (rad).
TURNING = 0.002
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
#: Amplitudes at which the motion of a pivot is started, as shares of the ground link.
AMPLITUDE = 0.1
#: What a function of the user's may take from `math` or NumPy.
TRACED = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh",
    "exp", "log", "sqrt", "hypot", "fabs",
)  # fmt: skip
#: And what CasADi has under another name, or not at all.
RENAMED: dict[str, Callable[..., Any]] = {
    "degrees": lambda x: x * (180.0 / pi),
    "radians": lambda x: x * (pi / 180.0),
    "pow": lambda x, y: x**y,
    "power": lambda x, y: x**y,
    "maximum": lambda x, y: symbolic.library().fmax(x, y),
    "minimum": lambda x, y: symbolic.library().fmin(x, y),
}
#: Iterations of IPOPT: most optima are reached in a hundred, or in many.
ITERATIONS = 250
#: Least rotation of the crank from one untimed station to the next, as a share of an even one.
ADVANCE = 1e-3
#: Greatest, in even ones: in a wider gap the coupler point could wander off unseen between two stations.
GAP = 8.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SliderUnknown:
    """A slider whose motion is sought: a Fourier series with this many harmonics.

    Attributes
    ----------
    harmonics : int
        0 is a slider set once.
    guide_angle : (float, float)
        Bounds (rad); equal ones fix it.
    position : (float, float), optional
        Least and greatest slider position (m); by default one ground link to either side of its end, beyond which it would be
        another linkage.
    stroke : float
        Greatest distance between the ends of its travel (m).
    speed, acceleration : float
        Greatest |du/dphi| (m/rad) and |d2u/dphi2| (m/rad2).
    smoothness : float
        Weight of the mean of (d2u/dphi2)^2 (1/rad4) added to the quality: trades error for smoothness.
    """

    harmonics: int
    guide_angle: tuple[float, float] = (-pi, pi)
    position: tuple[float, float] | None = None
    stroke: float = inf
    speed: float = inf
    acceleration: float = inf
    smoothness: float = 0.0

    def __post_init__(self) -> None:
        if self.harmonics < 0:
            raise ParameterError("harmonics", self.harmonics, "be zero or greater")
        low, high = self.guide_angle
        if not (isfinite(low) and isfinite(high) and low <= high):
            raise ParameterError("bounds of guide_angle", self.guide_angle, "be two finite angles in order (rad)")
        if self.position is not None:
            low, high = self.position
            if not (isfinite(low) and isfinite(high) and low < high):
                raise ParameterError(
                    "bounds of slider position", self.position, "be two finite lengths, increasing (m)"
                )
        for name in ("stroke", "speed", "acceleration"):
            if not getattr(self, name) > 0.0:
                raise ParameterError(f"greatest {name}", getattr(self, name), "be greater than zero")
        if not (isfinite(self.smoothness) and self.smoothness >= 0.0):
            raise ParameterError("smoothness", self.smoothness, "be a finite number, zero or greater")


@dataclass(frozen=True, slots=True, kw_only=True)
class CrankUnknown:
    """A second crank whose length, phase and, with ``harmonics``, independent rotation are sought.

    Attributes
    ----------
    ratio : int
        Turns for one of the first crank.
    length : (float, float)
        Bounds (m).
    harmonics : int
        Of the rotation added to the geared one; 0 of gears.
    speed : float
        Greatest deviation of d psi/d phi from the ratio.
    """

    ratio: int
    length: tuple[float, float]
    harmonics: int = 0
    speed: float = inf

    def __post_init__(self) -> None:
        low, high = self.length
        if not (isfinite(low) and isfinite(high) and 0.0 < low <= high):
            raise ParameterError("bounds of the second crank", self.length, "be two lengths above zero, in order (m)")
        if self.harmonics < 0 or self.ratio != int(self.ratio):
            raise ParameterError(
                "second crank", (self.ratio, self.harmonics), "have whole numbers of turns and harmonics"
            )


PivotUnknown = SliderUnknown | CrankUnknown


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Where a search starts, or ends, in normal form.

    Attributes
    ----------
    q : ndarray, shape (11,)
        Of `constraints.UNKNOWNS`.
    branch : int
    pivot : ndarray
        Unknowns of the moved pivot: guide angle, mean, cosines and sines in turn; or length, phase, cosines and sines.
    rotation : ndarray, shape (n,), or None
        Crank rotations of the stations where they are unknown.
    quality : float
        In units squared.
    """

    q: FloatArray
    branch: int
    quality: float = inf
    pivot: FloatArray = field(default_factory=lambda: np.empty(0))
    rotation: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What IPOPT says: where it ended, whether that satisfies every constraint, which it violates most, and its own word."""

    start: Start
    feasible: bool
    converged: bool
    violation: float
    worst: str
    status: str
    iterations: int

    @classmethod
    def unjoined(cls, start: Start) -> Answer:
        """Of a start whose links cannot be joined."""
        return cls(
            start=replace(start, quality=inf),
            feasible=False,
            converged=False,
            violation=inf,
            worst="loop closure",
            status="the links cannot be joined at the start",
            iterations=0,
        )


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
        casadi = symbolic.library()
        self._casadi = casadi
        SX = casadi.SX
        n = normal.n
        q = SX.sym("q", len(UNKNOWNS))
        z = [q]
        low, high = [limits.low], [limits.high]
        self._constraints: list[tuple[Any, float, float, str]] = []
        self._solvers: dict[int, Any] = {}
        # parameters: branch, direction, blur, factor of the objective, rows of Grashof's type, half-planes of the regions
        branch, direction, blur, gain = (SX.sym(name) for name in ("branch", "direction", "blur", "gain"))
        grashof = SX.sym("grashof", 6, 4)
        planes = [SX.sym(f"plane{k}", 3, 3) for k in range(len(limits.regions))]
        # unknowns of the pivot
        size = _size(pivot)
        v = SX.sym("v", size)
        v_low, v_high = _pivot_bounds(pivot, normal.unit)
        z.append(v)
        low.append(v_low)
        high.append(v_high)
        # crank rotations
        if normal.timed:
            phi: Any = casadi.DM(normal.rotation)
        else:
            phi = SX.sym("phi", n)
            z.append(phi)
            low.append(np.full(n, -inf))
            high.append(np.full(n, inf))
            self._ordered(phi, direction)
        p = SimpleNamespace(**{name: q[k] for k, name in enumerate(UNKNOWNS)})
        g, point = self._closed(p, v, phi, branch)
        quality = self._quality(p, v, g, point, phi, branch, blur, z, low, high)
        tilt: Any = None
        if objective == "transmission":
            # the largest |cos mu| of all, which is made small
            tilt = SX.sym("tilt")
            z.append(tilt)
            low.append(np.zeros(1))
            high.append(np.array([cos(TURNING)]))
            quality = tilt + 1e-3 * casadi.sumsqr(q[2:6])
        self._assembled(p, v, phi, tilt)
        if limits.grashof:
            margin = MARGIN * casadi.sum1(q[2:6]) * casadi.sum2(casadi.fabs(grashof)) / 4.0
            self._at_most(casadi.mtimes(grashof, q[2:6]) + margin, f"Grashof type {limits.grashof}")
        for (name, _), plane in zip(limits.regions, planes):
            x, y = p.pivot_x, p.pivot_y
            if name == "D":
                x, y = (
                    x + p.ground_length * casadi.cos(p.ground_angle),
                    y + p.ground_length * casadi.sin(p.ground_angle),
                )
            self._at_most(casadi.mtimes(plane, casadi.vertcat(x, y, 1.0)), f"region of pivot {name}")
        for require in limits.requires:
            value = traced(require, physical(p, self.normal.unit, self.normal.origin)) / require.scale
            self._within(value, 0.0 if require.equal else -inf, 0.0, require.name)
        if isinstance(pivot, SliderUnknown):
            quality = quality + self._slider(pivot, p.ground_length, v, z, low, high)
        if isinstance(pivot, CrankUnknown) and isfinite(pivot.speed):
            x = casadi.DM(np.linspace(0.0, 2.0 * pi, GRID, endpoint=False))
            rate = _series(casadi, v[2:], x, mean=False, order=1)
            self._within(rate, -pivot.speed, pivot.speed, "speed of the second crank")
        parameters = casadi.vertcat(
            branch, direction, blur, gain, casadi.vec(grashof), *(casadi.vec(x) for x in planes)
        )
        self.low, self.high = np.concatenate(low), np.concatenate(high)
        self._g_low = np.concatenate([np.full(e.numel(), a) for e, a, _, _ in self._constraints] or [np.empty(0)])
        self._g_high = np.concatenate([np.full(e.numel(), b) for e, _, b, _ in self._constraints] or [np.empty(0)])
        self._labels = [name for e, _, _, name in self._constraints for _ in range(e.numel())]
        g_all = casadi.vertcat(*(casadi.vec(e) for e, _, _, _ in self._constraints)) if self._constraints else SX(0, 1)
        self._nlp = {"x": casadi.vertcat(*z), "f": gain * quality, "g": g_all, "p": parameters}
        self._extra = self._nlp["x"].numel() - len(UNKNOWNS) - size - (0 if normal.timed else n)

    # Objective

    def _closed(self, p: Any, v: Any, phi: Any, branch: Any) -> tuple[Any, Any]:
        """Directions of the links and the coupler point (x, y) at rotations, by the plant's own loop closure."""
        casadi = self._casadi
        c2, s2 = casadi.cos(phi + p.crank_phase), casadi.sin(phi + p.crank_phase)
        dx, dy = self._displacement(v, phi)
        g = symbolic.plant().joined(
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

    def _quality(
        self,
        p: Any,
        v: Any,
        g: Any,
        point: Any,
        phi: Any,
        branch: Any,
        blur: Any,
        z: list[Any],
        low: list[Any],
        high: list[Any],
    ) -> Any:
        """The quality function; with it the constraints that belong to it."""
        casadi, normal = self._casadi, self.normal
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
        straight = normal.straight
        if straight is not None:
            part = slice(straight.start, straight.end + 1)
            line = normal.points[straight.end] - normal.points[straight.start]  # type: ignore[index]
            line /= abs(line)
            off = (ey * line.real - ex * line.imag)[part]
            spent = phi[straight.end] - phi[straight.start]
            self._within(spent, -straight.rotation, straight.rotation, "crank rotation of the straight part")
            if straight.flatness is None:
                quality = quality + (straight.weight - 1.0) * casadi.sumsqr(off)
            else:
                level = casadi.SX.sym("level")
                z.append(level)
                low.append(np.array([-inf]))
                high.append(np.array([inf]))
                half = 0.5 * straight.flatness
                # along the straight line through the part's ends, at the stations and in between
                x, y = self._closed(p, v, self._way(phi[part])[0], branch)[1]
                begin = normal.points[straight.start]  # type: ignore[index]
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
        l3, l4 = p.coupler_length, p.rocker_length
        joint = l3 * l3 + l4 * l4
        for cosine in (cos(max(least, TURNING)), *([] if tilt is None else [tilt])):
            product = 2.0 * l3 * l4 * cosine
            self._at_most(joint - nearest - product, "transmission angle")
            self._at_most(farthest - joint - product, "transmission angle")

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

    def _slider(self, pivot: SliderUnknown, ground: Any, v: Any, z: list[Any], low: list[Any], high: list[Any]) -> Any:
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
            middle = casadi.SX.sym("middle")
            z.append(middle)
            low.append(np.array([-inf]))
            high.append(np.array([inf]))
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
        options = {
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                "max_iter": iterations,
                "tol": 1e-9,
                "constr_viol_tol": 1e-9,
                "acceptable_tol": 1e-7,
                "acceptable_iter": 8,
                "bound_relax_factor": 0.0,
                **FOLLOWING[self.objective],
            },
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,
            "calc_lam_p": False,
        }
        self._solvers[iterations] = self._casadi.nlpsol("synthesis", "ipopt", self._nlp, options)
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
        parts = [start.q, start.pivot if len(start.pivot) else np.zeros(_size(self.pivot))]
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
        size = _size(self.pivot)
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


def random_pivot(unknown: PivotUnknown, ground: float, unit: float, random: np.random.Generator) -> FloatArray:
    """Unknowns of a pivot at random: harmonics that fall off with their order, within the bounds of stroke and length.

    Parameters
    ----------
    ground : float
        Ground link (units).
    unit : float
        m.
    """
    orders = np.repeat(np.arange(1, unknown.harmonics + 1), 2)
    waves = random.standard_normal(2 * unknown.harmonics) / (1.0 + orders)
    if isinstance(unknown, CrankUnknown):
        length = random.uniform(*unknown.length) / unit
        return np.array([length, random.uniform(-pi, pi), *(0.3 * waves)])
    low, high = unknown.guide_angle
    # a guide is the same one from its other end
    angle = low + min(high - low, pi) * random.random()
    size = min(AMPLITUDE * ground, 0.25 * unknown.stroke / unit)
    return np.array([angle, size * random.standard_normal(), *(size * waves)])


def _size(pivot: PivotUnknown | None) -> int:
    """Number of the pivot's unknowns."""
    if pivot is None:
        return 0
    return 2 + 2 * pivot.harmonics


def _pivot_bounds(pivot: PivotUnknown | None, unit: float) -> tuple[FloatArray, FloatArray]:
    if pivot is None:
        return np.empty(0), np.empty(0)
    low, high = np.full(_size(pivot), -inf), np.full(_size(pivot), inf)
    if isinstance(pivot, SliderUnknown):
        low[0], high[0] = pivot.guide_angle
    else:
        low[0], high[0] = pivot.length[0] / unit, pivot.length[1] / unit
    return low, high


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


def physical(p: SimpleNamespace, unit: float, origin: complex) -> SimpleNamespace:
    """Dimensions in SI, from those in normal form, for functions of the user's."""
    values = dict(vars(p))
    for name in UNKNOWNS[:7]:
        values[name] = unit * values[name]
    values["pivot_x"], values["pivot_y"] = values["pivot_x"] + origin.real, values["pivot_y"] + origin.imag
    return SimpleNamespace(**values)


def traced(require: Require, values: SimpleNamespace) -> Any:
    """Value of a function of the user's for CasADi symbols, what it takes from `math` or NumPy replaced by CasADi's.

    Raises
    ------
    InputError
        If it branches on its argument, or calls what CasADi cannot.
    """
    casadi = symbolic.library()
    try:
        value = casadi.SX(_rebound(require.function, {})(values))
    except Exception as error:
        raise InputError(
            f"{require.name} cannot be traced ({type(error).__name__}: {error}): it must be arithmetic and functions of math, "
            "without branches"
        ) from error
    if value.numel() != 1 or value.is_constant():
        # what turns a symbol into a float by itself has lost it: NaN
        raise InputError(
            f"{require.name} cannot be traced (its value is {value}): it must be one number, by arithmetic and functions of "
            "math from the dimensions"
        )
    return value


def _rebound(value: Any, seen: dict[int, Any]) -> Any:
    """What a function of the user's takes from elsewhere, `math` and NumPy replaced by CasADi, his own functions likewise."""
    casadi = symbolic.library()
    if isinstance(value, ModuleType) and value.__name__ in ("math", "numpy"):
        known = {n: getattr(casadi, n) for n in TRACED} | RENAMED
        return SimpleNamespace(**vars(value) | {n: f for n, f in known.items() if hasattr(value, n)})
    if any(getattr(module, getattr(value, "__name__", ""), None) is value for module in (math, np)):
        name = value.__name__
        return RENAMED.get(name, getattr(casadi, name) if name in TRACED else value)
    if not isinstance(value, FunctionType):
        return value
    if id(value) not in seen:
        cells = [CellType() for _ in value.__closure__ or ()]
        space: dict[str, Any] = {}
        f = FunctionType(value.__code__, space, value.__name__, value.__defaults__, tuple(cells))
        f.__kwdefaults__ = value.__kwdefaults__
        seen[id(value)] = f
        space.update(
            {name: _rebound(x, seen) for name, x in value.__globals__.items() if name in _names(value.__code__)}
        )
        space["__builtins__"] = value.__globals__.get("__builtins__", builtins)
        for cell, old in zip(cells, value.__closure__ or ()):
            cell.cell_contents = _rebound(old.cell_contents, seen)
    return seen[id(value)]


def _names(code: CodeType) -> set[str]:
    """Global names that code, or code within it, may ask for."""
    return {*code.co_names}.union(*(_names(c) for c in code.co_consts if isinstance(c, CodeType)))


def _grashof_rows(type_: str | None, links: FloatArray) -> FloatArray:
    """Rows r with r . (l1, l2, l3, l4) <= 0 that a four-bar of this type satisfies, shape (6, 4); zero rows ask nothing.

    Of a triple-rocker, whose links are not convex in their lengths, the shortest and the longest stay what they are.
    """
    rows = np.zeros((6, 4))
    if type_ is None:
        return rows
    shortest = {"drag-link": 0, "crank-rocker": 1, "double-rocker": 2, "rocker-crank": 3}.get(type_)
    if shortest is None:
        order = np.argsort(links)
        s, a, b, longest = (int(k) for k in order)
        rows[0, [a, b]], rows[0, [s, longest]] = 1.0, -1.0
        for k, other in enumerate((a, b)):
            rows[1 + k, s], rows[1 + k, other] = 1.0, -1.0
            rows[3 + k, other], rows[3 + k, longest] = 1.0, -1.0
        return rows
    others = [k for k in range(4) if k != shortest]
    for k, other in enumerate(others):
        rows[k, shortest], rows[k, other] = 1.0, -1.0
        rows[3 + k] = [-1.0 if j != shortest and j != other else 1.0 for j in range(4)]
    return rows


def half_planes(triangle: FloatArray) -> FloatArray:
    """Rows r with r . (x, y, 1) <= 0 inside a counter-clockwise triangle, shape (3, 3)."""
    rows = np.zeros((3, 3))
    for k in range(3):
        (x0, y0), (x1, y1) = triangle[k], triangle[(k + 1) % 3]
        length = float(np.hypot(x1 - x0, y1 - y0))
        rows[k] = (y1 - y0) / length, (x0 - x1) / length, (y0 * x1 - x0 * y1) / length
    return rows


def inside(q: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Unknowns within their bounds, angles by whole turns where that is enough."""
    q = q.copy()
    angles = slice(UNKNOWNS.index("ground_angle"), len(UNKNOWNS))
    middle = 0.5 * (low[angles] + high[angles])
    nearest = middle + (q[angles] - middle + pi) % (2.0 * pi) - pi
    outside = (q[angles] < low[angles]) | (q[angles] > high[angles])
    q[angles] = np.where(outside, nearest, q[angles])
    return np.clip(q, low, high)


def linkage_of(
    start: Start, normal: Normal, pivot: PivotUnknown | None = None, limits: Limits | None = None
) -> Linkage:
    """The linkage of a start, in SI; its angles within a half turn of zero, or else within their limits."""
    q = start.q.copy()
    q[:7] *= normal.unit
    q[0] += normal.origin.real
    q[1] += normal.origin.imag
    angles = slice(UNKNOWNS.index("ground_angle"), len(UNKNOWNS))
    wrapped = (q[angles] + pi) % (2.0 * pi) - pi
    if limits is not None:
        outside = (wrapped < limits.low[angles]) | (wrapped > limits.high[angles])
        wrapped = np.where(outside, q[angles], wrapped)
    q[angles] = wrapped
    v = start.pivot
    moved: SliderMotion | SecondCrank | None = None
    if isinstance(pivot, SliderUnknown) and len(v):
        cosines, sines = np.append(v[1], v[2::2]), np.append(0.0, v[3::2])
        moved = SliderMotion(FourierSeries(normal.unit * cosines, normal.unit * sines), float(v[0]))
    elif isinstance(pivot, CrankUnknown) and len(v):
        series = FourierSeries(np.append(0.0, v[2::2]), np.append(0.0, v[3::2]))
        moved = SecondCrank(normal.unit * float(v[0]), pivot.ratio, float(v[1]), series)
    return Linkage.from_vector(q, start.branch, pivot=moved)


def start_of(
    linkage: Linkage, normal: Normal, pivot: PivotUnknown | None = None, rotation: FloatArray | None = None
) -> Start:
    """A linkage as a start; the pivot's motion is cut off after, or filled up to, the harmonics sought."""
    q = np.append(linkage.vector, linkage.output_angle)
    q[0] -= normal.origin.real
    q[1] -= normal.origin.imag
    q[:7] /= normal.unit
    v = np.zeros(_size(pivot))
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
    return Start(q=q, branch=linkage.branch, pivot=v, rotation=rotation)
