"""The optimal control problem of least effort, transcribed by direct collocation and solved by IPOPT; see `least_effort`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees, inf, isfinite, pi, radians, sin
from typing import Any, Literal, get_args

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.kinematics import assembly_square
from linkwork.five_bar.parameters import FiveBarParameters

from ..mechanisms import FIVE_BAR, require_no_contact_friction
from ..numerics import symbolic
from ..numerics.fourier import FourierSeries
from ..run import Piecewise, traced
from .inverse import FloatArray, Load, inverse_dynamics, load_at, whole

Effort = Literal["force", "power", "positive power"]
Points = Literal["radau", "legendre"]
Range = tuple[float, float]

#: Crank angles and slider positions over which the bound is tried before IPOPT is.
ANGLES, POSITIONS = 72, 2000
#: Slider positions between which the first guess finds its way, and its orders: the first along which the links stay joined.
WAYS = 200
GUESS_ORDERS = (4, 8, 16, 32)
#: |P| is sqrt(P^2 + (ROUNDING P0)^2), with P0 the product of the scales of force and speed: smooth where P changes sign.
ROUNDING = 1e-3
#: Weight of the mean square force, in its scale, beside a mean power: alone that leaves the force free where u' = 0.
FORCE_WEIGHT = 1e-4
#: Tolerance of IPOPT, and its iterations at most.
_TOLERANCE, _ITERATIONS = 1e-9, 500
#: Polynomials of the force that `Piecewise` can carry.
HIGHEST_DEGREE = 4


class EffortError(LinkworkError):
    """No optimal motion was found; ``status`` is IPOPT's."""

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status


class UnattainableError(EffortError):
    """No motion keeps all the bounds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLimits:
    """What a motion of the slider must keep besides its error.

    Attributes
    ----------
    stroke : (float, float)
        Least and greatest slider position (m).
    speed, force : float
        Largest slider speed (m/s) and control force (N) either way.
    transmission : float
        Least angle between coupler and rocker, and from pi (rad).
    """

    stroke: Range = (-inf, inf)
    speed: float = inf
    force: float = inf
    transmission: float = radians(5.0)

    def __post_init__(self) -> None:
        for name, value, unit in (("bound of the speed", self.speed, "m/s"), ("bound of the force", self.force, "N")):
            if not value > 0.0:
                raise InputError(f"{name} is {value} {unit}: it must be greater than zero")
        if not self.stroke[0] < self.stroke[1]:
            raise InputError(f"stroke from {self.stroke[0]} m to {self.stroke[1]} m: it must be two increasing numbers")
        if not 0.0 < self.transmission < 0.5 * pi:
            raise InputError(f"least transmission angle is {self.transmission} rad: it must be between 0 and pi/2")


@dataclass(frozen=True, slots=True, kw_only=True)
class Collocation:
    """How the problem is transcribed.

    Attributes
    ----------
    intervals, degree : int
        Of the first transcription; the degree is that of u and u', 1 to 4, that of the force one less.
    points : str
        ``radau`` or ``legendre``.
    halvings : int
        How often the intervals are halved and the problem is solved again; 0 leaves the mesh unchecked (the two mesh
        figures are then infinite). Corners of the target and guide friction, which turns round within some mm/s, ask for many
        intervals.
    """

    intervals: int = 40
    degree: int = 3
    points: Points = "radau"
    halvings: int = 1

    def __post_init__(self) -> None:
        for name, what in (("intervals", "intervals"), ("halvings", "halvings"), ("degree", "as the degree")):
            object.__setattr__(self, name, whole(getattr(self, name), what))
        if not 1 <= self.degree <= HIGHEST_DEGREE:
            raise InputError(f"degree of the collocation is {self.degree}: it must be 1 to {HIGHEST_DEGREE}")
        check_choice("points", self.points, get_args(Points))
        if self.intervals < 4 or self.halvings < 0:
            raise InputError(f"{self.intervals} intervals, {self.halvings} halvings: at least 4 and 0 are needed")


def check_choice(name: str, choice: str, known: Sequence[str]) -> None:
    """Make sure that a choice is one of those there are; raises InputError if it is not."""
    if choice not in known:
        raise InputError(f"{name} is {choice!r}: it must be one of {', '.join(known)}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Polynomials of u, u' and F2 on equal intervals of the crank angle, by their values, shapes (N, d + 1) and (N, d).

    Position (m) and velocity (m/s) have the start of the interval as their first node, the force (N) has the collocation
    points alone. ``spring`` is k (N/m) and k u0 (N).
    """

    tau: FloatArray
    u: FloatArray
    v: FloatArray
    f: FloatArray
    spring: tuple[float, float] = (0.0, 0.0)

    @property
    def angles(self) -> FloatArray:
        """Crank angles of the collocation points (rad), shape (N d,)."""
        n = len(self.u)
        return (2.0 * pi / n * (np.arange(n)[:, None] + self.tau)).ravel()

    @classmethod
    def of_motion(cls, problem: Problem, slider: FourierSeries, intervals: int) -> Mesh:
        """The mesh along a motion, with the force of inverse dynamics.

        Raises AssemblyError if the links cannot be joined along it.
        """
        p, w = problem.parameters, problem.crank_speed
        drive = inverse_dynamics(p, slider, w, load=problem.load, samples=max(256, 4 * slider.order))
        force = FourierSeries.from_samples(drive.force)
        theta = problem.angles(intervals)
        spring = (0.0, 0.0)
        if problem.spring is not None:
            spring = (p.slider_stiffness, p.slider_stiffness * p.slider_spring_free_position)
        return cls(
            tau=problem.tau, u=slider(theta), v=w * slider.derivative()(theta), f=force(theta[:, 1:]), spring=spring
        )

    def polynomials(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients of the powers of the share of the interval, shapes (N, d + 1) twice and (N, d)."""
        full = np.linalg.inv(np.vander(np.append(0.0, self.tau), increasing=True)).T
        reduced = np.linalg.inv(np.vander(self.tau, increasing=True)).T
        return self.u @ full, self.v @ full, self.f @ reduced

    def at(self, theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and force at crank angles, shapes of ``theta``."""
        n = len(self.u)
        place = np.mod(theta, 2.0 * pi) * (n / (2.0 * pi))
        piece = np.minimum(place.astype(int), n - 1)
        u, v, f = (
            polynomial.polyval(place - piece, np.moveaxis(c[piece], -1, 0), tensor=False) for c in self.polynomials()
        )
        return u, v, f

    def signal(self, crank_speed: float) -> Piecewise:
        """The force over the time of one turn."""
        n = len(self.u)
        step = 2.0 * pi / n / crank_speed
        c = self.polynomials()[2]
        powers = np.zeros((n, 4))
        powers[:, : c.shape[1]] = c / step ** np.arange(c.shape[1])
        return Piecewise(step * np.arange(n + 1, dtype=float), powers)


def shortest_way(miss: FloatArray, travel: FloatArray) -> NDArray[np.intp]:
    """Numbers of the positions, shape (n,), of the closed way of least miss and travel, by dynamic programming.

    ``miss`` has shape (n, m), and ``travel`` (m, m) is the cost from a position to the next. Of three turns the middle one is
    taken: the choice of the first and the last position does not reach it.
    """
    n = len(miss)
    cost, sources = np.zeros(miss.shape[1]), []
    for step in range(3 * n):
        ways = cost[:, None] + travel
        sources.append(ways.argmin(axis=0))
        cost = ways.min(axis=0) + miss[step % n]
    way = [int(cost.argmin())]
    for source in sources[:0:-1]:
        way.append(int(source[way[-1]]))
    return np.array(way[::-1][n : 2 * n])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Transcribed:
    """What IPOPT found on a mesh."""

    mesh: Mesh
    effort: float
    status: str
    iterations: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """The optimal control problem, before it is transcribed. Fields as the arguments of `least_effort`."""

    parameters: FiveBarParameters
    crank_speed: float
    target: Callable[[FloatArray], FloatArray]
    bound: float
    cost: Effort
    limits: MotionLimits
    spring: Range | None
    load: Load
    collocation: Collocation

    def __post_init__(self) -> None:
        for name, value, unit in (
            ("crank speed", self.crank_speed, "rad/s"),
            ("bound of the error", self.bound, "m or rad"),
        ):
            if not (isfinite(value) and value > 0.0):
                raise InputError(f"{name} is {value} {unit}: it must be finite and greater than zero")
        if self.spring is not None and not (-inf < self.spring[0] <= self.spring[1] < inf):
            raise InputError(f"free position between {self.spring} m: the bounds must be finite and in order")
        check_choice("cost", self.cost, get_args(Effort))
        if self.of_point and self.parameters.coupler_point_distance == 0.0:
            raise InputError("coupler.point_distance is 0: P is the crank pin, which no slider moves")

    @property
    def degree(self) -> int:
        """Of u and u' on an interval."""
        return self.collocation.degree

    @cached_property
    def tau(self) -> FloatArray:
        """Collocation points as shares of an interval, shape (d,)."""
        return np.array(symbolic.library().collocation_points(self.degree, self.collocation.points))

    @property
    def length(self) -> float:
        """Scale of the position (m)."""
        return self.parameters.crank_length

    @cached_property
    def force_scale(self) -> float:
        """Scale of the force (N): what moves coupler, rocker and slider by a crank's length once a turn."""
        p = self.parameters
        mass = p.coupler_mass + p.rocker_mass + p.slider_mass
        return mass * (self.length * self.crank_speed**2 + p.gravity)

    @property
    def effort_scale(self) -> float:
        """Scale of the effort (N or W)."""
        return self.force_scale * (1.0 if self.cost == "force" else self.length * self.crank_speed)

    @cached_property
    def instant(self) -> Any:
        """(th2, u, u', u'', F2, spring, load, target) -> unbalanced force, error, joint's margin, power; scaled but for th2.

        The spring is outside the plant: with k and k u0 the force is affine in what is designed.
        """
        casadi, plant = symbolic.library(), traced(FIVE_BAR)
        th2, s, r, a, f = (casadi.SX.sym(name) for name in ("th2", "s", "r", "a", "f"))
        spring, load, aim = casadi.SX.sym("spring", 2), casadi.SX.sym("load", 2), casadi.SX.sym("aim", 2)
        own = self.parameters if self.spring is None else replace(self.parameters, slider_stiffness=0.0)
        p = own.constants()
        require_no_contact_friction(p, "an optimal motion of the slider")
        w, length, scale = self.crank_speed, self.length, self.force_scale
        u, v = s * length, r * length * w
        g = plant.position(th2, u, p)
        k = plant.coefficients(g, p)
        w3, w4 = k.k32 * w + k.k3u * v, k.k42 * w + k.k4u * v
        _, b2 = plant.velocity_terms(g, k, w, w3, w4, *plant.centripetal(g, w, w3, w4, p), p)
        _, q2 = plant.applied_forces(g, k, u, v, load[0], load[1], p)
        drawn = f * scale - spring[0] * s * scale + spring[1] * scale
        unbalanced = (plant.inertia(g, k, p).m22 * a * length * w * w + b2 - q2 - drawn) / scale
        if self.of_point:
            px, py = plant.coupler_point(g, p)
            error = casadi.vertcat(px - aim[0], py - aim[1]) / self.bound
        else:
            error = casadi.atan2(g.s4 * aim[0] - g.c4 * aim[1], g.c4 * aim[0] + g.s4 * aim[1]) / self.bound
        joint = plant.assembly_square(th2, u, p) / (p.l3 * p.l4) ** 2
        return casadi.Function(
            "instant",
            [th2, s, r, a, f, spring, load, aim],
            [unbalanced, casadi.sumsqr(error), joint, f * r],
            {"cse": True},
        )

    @cached_property
    def of_point(self) -> bool:
        """Whether the target is one of P."""
        return self.target(np.zeros(1)).ndim == 2

    def aims(self, theta: FloatArray) -> FloatArray:
        """P's target (m) or the direction of the rocker's, shape (2, n)."""
        values = self.target(theta)
        return values.T if self.of_point else np.vstack([np.cos(values), np.sin(values)])

    def grid(self, theta: FloatArray, u: FloatArray) -> FloatArray:
        """Error (m or rad) over crank angles and slider positions, infinite where the links are not joined well enough."""
        th, s = (values.ravel()[None, :] for values in np.meshgrid(theta, u / self.length, indexing="ij"))
        zero, two = np.zeros_like(th), np.zeros((2, 1))
        aims = np.repeat(self.aims(theta), len(u), axis=1)
        found = self.instant(th, s, zero, zero, zero, two, two, aims)
        error, joint = (np.array(found[i]).reshape(len(theta), len(u)) for i in (1, 2))
        return np.asarray(self.bound * np.sqrt(np.where(joint >= sin(self.limits.transmission) ** 2, error, inf)))

    def within(self) -> FourierSeries:
        """A motion to start from: over a grid, the one of least travel that keeps the bound, or nearly.

        Raises UnattainableError if at some crank angle no slider position keeps the bound.
        """
        p = self.parameters
        theta = 2.0 * pi * np.arange(ANGLES) / ANGLES
        far = p.crank_length + p.coupler_length + p.rocker_length + p.ground_length
        u = np.linspace(max(self.limits.stroke[0], -far), min(self.limits.stroke[1], far), POSITIONS)
        error = self.grid(theta, u)
        # P moves by no more than r/(l3 sin(th4 - th3)) of the slider's way, the rocker turns by no more than 1/(l4 sin)
        leverage = p.coupler_point_distance / p.coupler_length if self.of_point else 1.0 / p.rocker_length
        between = leverage / sin(self.limits.transmission)
        least = error.min(axis=1, keepdims=True)
        near = np.flatnonzero((error <= np.maximum(least, self.bound) + between * (u[1] - u[0])).any(axis=0))
        u = np.linspace(u[max(near[0] - 1, 0)], u[min(near[-1] + 1, POSITIONS - 1)], WAYS)
        error = self.grid(theta, u)
        self._check_reach(theta, error.min(axis=1) - between * (u[1] - u[0]))
        slack = float(u[1] - u[0]) * leverage
        miss = np.maximum(error - np.maximum(self.bound, error.min(axis=1, keepdims=True)) - slack, 0.0)
        way = u[shortest_way(miss / slack, (np.subtract.outer(u, u) / self.length) ** 2)]
        for order in GUESS_ORDERS:
            series = FourierSeries.from_samples(way, order)
            if all(assembly_square(th, q, p.constants()) > 0.0 for th, q in zip(theta, series(theta))):
                break
        return series

    def _check_reach(self, theta: FloatArray, least: FloatArray) -> None:
        """Make sure that the least error at each crank angle is within the bound."""
        worst, least_angle = int(np.argmax(least)), degrees(self.limits.transmission)
        where = f"at crank angle {degrees(theta[worst]):.1f} deg"
        if not isfinite(least[worst]):
            raise UnattainableError(
                f"{where} the links cannot be joined with a transmission angle of {least_angle:g} deg wherever "
                "the slider is within its stroke",
                "",
            )
        if least[worst] > self.bound:
            unit = "m" if self.of_point else "rad"
            raise UnattainableError(
                f"the bound of {self.bound:g} {unit} cannot be kept: {where} the error is at least {least[worst]:.4g} {unit} "
                "wherever the slider is within its stroke",
                "",
            )

    @cached_property
    def scales(self) -> tuple[float, float, float, float, float]:
        """Of position (m), velocity (m/s), force (N), stiffness (N/m) and the spring's force at u = 0 (N)."""
        speed = self.length * self.crank_speed
        return self.length, speed, self.force_scale, self.force_scale / self.length, self.force_scale

    def angles(self, n: int) -> FloatArray:
        """Crank angles of the start and the collocation points of n intervals (rad), shape (n, d + 1)."""
        return np.asarray(2.0 * pi / n * (np.arange(n)[:, None] + np.append(0.0, self.tau)))

    def transcribe(self, n: int) -> tuple[dict[str, Any], FloatArray, FloatArray]:
        """The nonlinear programme on n intervals, with the lower and upper bounds of its constraints."""
        casadi, d = symbolic.library(), self.degree
        slope, end, quadrature = casadi.collocation_coeff(self.tau.tolist())
        h = 2.0 * pi / n
        theta = self.angles(n)[:, 1:].ravel()

        # unknowns, all scaled: u and u' with the start of each interval, F2, and the spring
        s, r, f = casadi.MX.sym("s", n, d + 1), casadi.MX.sym("r", n, d + 1), casadi.MX.sym("f", n, d)
        spring = casadi.MX.sym("spring", 2)

        # values at each collocation point, interval by interval
        def row(values: Any) -> Any:
            return casadi.reshape(values.T, 1, n * d)

        load = np.array([load_at(self.load, angle) for angle in theta.tolist()]).T
        unbalanced, error, joint, power = self.instant.map(n * d)(
            theta[None, :], row(s[:, 1:]), row(r[:, 1:]), row(casadi.mtimes(r, slope) / h), row(f),
            casadi.repmat(spring, 1, n * d), load, self.aims(theta),
        )  # fmt: skip

        # objective: means over the turn by the quadrature of the collocation points
        def mean(values: Any) -> Any:
            return casadi.mtimes(values, np.tile(np.array(quadrature).ravel(), n)) / n

        square = mean(row(f) ** 2)
        absolute = casadi.sqrt(power**2 + ROUNDING**2) - ROUNDING
        objective = {
            "force": square,
            "power": mean(absolute) + FORCE_WEIGHT * square,
            "positive power": 0.5 * mean(power + absolute) + FORCE_WEIGHT * square,
        }[self.cost]

        # dynamics, and continuity from each interval to the next, from the last to the first
        following = [*range(1, n), 0]
        equal = casadi.horzcat(
            unbalanced,
            row(casadi.mtimes(s, slope) / h - r[:, 1:]),
            (casadi.mtimes(s, end) - s[following, 0]).T,
            (casadi.mtimes(r, end) - r[following, 0]).T,
        )

        # constraints: error, transmission angle, and low k <= k u0 <= high k
        low, high = (bound / self.length for bound in self.spring or (0.0, 0.0))
        within = casadi.horzcat(error, joint, spring[1] - spring[0] * low, spring[0] * high - spring[1])
        lower = [*[0.0] * equal.numel(), *[-inf] * (n * d), *[sin(self.limits.transmission) ** 2] * (n * d), 0.0, 0.0]
        upper = [*[0.0] * equal.numel(), *[1.0] * (n * d), *[inf] * (n * d + 2)]

        unknowns = casadi.vertcat(*(casadi.vec(part) for part in (s, r, f)), spring)
        programme = {"x": unknowns, "f": objective, "g": casadi.horzcat(equal, within).T}
        return programme, np.array(lower), np.array(upper)

    def box(self, n: int, side: int) -> FloatArray:
        """Bounds of the unknowns on n intervals, the lower (side -1) or the upper ones (side 1)."""
        limits = self.limits
        stroke = limits.stroke[0] if side < 0 else limits.stroke[1]
        sizes = (n * (self.degree + 1), n * (self.degree + 1), n * self.degree)
        values = (stroke, side * limits.speed, side * limits.force)
        bounds = [np.full(size, value / scale) for size, value, scale in zip(sizes, values, self.scales)]
        most = 0.0 if self.spring is None else inf
        return np.concatenate([*bounds, [max(side * most, 0.0), side * most]])

    def pack(self, mesh: Mesh, n: int) -> FloatArray:
        """The unknowns on n intervals from what a mesh has there."""
        theta = self.angles(n)
        u, v, _ = mesh.at(theta)
        f = mesh.at(theta[:, 1:])[2]
        parts = [values.ravel(order="F") / scale for values, scale in zip((u, v, f), self.scales)]
        return np.concatenate([*parts, np.array(mesh.spring) / self.scales[3:]])

    def unpack(self, x: FloatArray, n: int) -> Mesh:
        """The mesh of the unknowns on n intervals."""
        nodes = n * (self.degree + 1)
        parts = np.split(x, [nodes, 2 * nodes, len(x) - 2])
        u, v, f = (part.reshape(-1, n).T * scale for part, scale in zip(parts[:3], self.scales))
        stiffness, preload = (parts[3] * self.scales[3:]).tolist()
        return Mesh(tau=self.tau, u=u, v=v, f=f, spring=(max(stiffness, 0.0), preload))

    def solve(self, start: Mesh, n: int) -> Transcribed:
        """The solution on n intervals that IPOPT comes to from ``start``."""
        programme, lower, upper = self.transcribe(n)
        solver = symbolic.ipopt("least_effort", programme, tol=_TOLERANCE, max_iter=_ITERATIONS)
        found = solver(x0=self.pack(start, n), lbx=self.box(n, -1), ubx=self.box(n, 1), lbg=lower, ubg=upper)
        self._check(solver.stats(), found, lower, upper)
        mesh = self.unpack(np.array(found["x"]).ravel(), n)
        return Transcribed(
            mesh=mesh,
            effort=self.effort(mesh),
            status=solver.stats()["return_status"],
            iterations=int(solver.stats()["iter_count"]),
        )

    def effort(self, mesh: Mesh) -> float:
        """Rms force (N) or mean power (W) by the quadrature of the collocation points."""
        weights = np.array(symbolic.library().collocation_coeff(self.tau.tolist())[2]).ravel() / len(mesh.f)
        power = mesh.f * mesh.v[:, 1:]
        values = {"force": mesh.f**2, "power": np.abs(power), "positive power": np.maximum(power, 0.0)}[self.cost]
        mean = float((values @ weights).sum())
        return float(np.sqrt(mean)) if self.cost == "force" else mean

    def _check(self, statistics: dict[str, Any], found: Any, lower: FloatArray, upper: FloatArray) -> None:
        """Make sure that IPOPT has a solution."""
        if statistics["success"]:
            return
        status = statistics["return_status"]
        values = np.array(found["g"]).ravel()
        violation = float(np.maximum(np.maximum(lower - values, values - upper), 0.0).max())
        ending = (
            f"IPOPT ended after {statistics['iter_count']} iterations with {status}, bounds violated by {violation:.2g}"
        )
        if status in ("Infeasible_Problem_Detected", "Restoration_Failed"):
            raise UnattainableError(
                f"no motion of the slider was found that keeps the error within {self.bound:g} and all other bounds: {ending}",
                status,
            )
        raise EffortError(f"no motion of least effort was found: {ending}; another guess may help", status)

    def errors(self, theta: FloatArray, u: FloatArray) -> FloatArray:
        """Error (m or rad) at configurations, shape (n,)."""
        zero, two = np.zeros((1, len(theta))), np.zeros((2, 1))
        found = self.instant(theta[None, :], u[None, :] / self.length, zero, zero, zero, two, two, self.aims(theta))
        return np.asarray(self.bound * np.sqrt(np.array(found[1], dtype=float).ravel()))
