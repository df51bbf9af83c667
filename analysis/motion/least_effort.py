"""The motion of the slider that takes least effort within an error bound: an optimal control problem over one turn.

With the crank at a constant speed w2 and the crank angle as the independent variable, periodic in it,

    minimise    the mean over the turn of F2^2, of |F2 u'| or of the positive part of F2 u'
    dynamics    du/dth2 = u'/w2,   m22 u'' + b2 = F2 + Q2            (the plant's own functions)
    within      error(th2, u) <= bound, and bounds on u, u', F2 and the transmission angle

The error is the distance of the coupler point P from the point of the target that belongs to the crank angle, or the
difference of the rocker's angle from the target's. A spring can be designed along: the force is affine in k and k u0.

Transcription by direct collocation: on each of N intervals of the crank angle u, u' and F2 are polynomials that meet the
dynamics and all bounds at the collocation points of Radau or Gauss-Legendre; Biegler, Nonlinear Programming (SIAM 2010),
chapter 10. CasADi gives the exact derivatives, IPOPT solves. The solution is checked in two ways that do not rest on the
transcription: the plant is run under the force found, and the problem is solved again on intervals half as long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import degrees, inf, isfinite, pi, radians, sin
from typing import Any, Literal

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.kinematics import assembly_square
from linkwork.five_bar.parameters import FiveBarParameters, InitialState

from ..numerics import symbolic
from ..numerics.fourier import FourierSeries
from ..run.inputs import Inputs, Piecewise, table
from ..run.simulate import simulate
from .inverse import FloatArray, Load, inverse_dynamics, load_at, whole

#: Points over crank angles (rad): (n,) to (n, 2) for P (m), or to (n,) for the rocker's angle (rad).
Target = Callable[[FloatArray], ArrayLike] | ArrayLike
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
#: Quiet, and what is not found is told by an error of ours.
IPOPT = {
    "print_time": False,
    "error_on_fail": False,
    "show_eval_warnings": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 500},
}
#: Share of the scale of the effort below which it counts as none.
EFFORT_FLOOR = 1e-6
#: Polynomials of the force that `Piecewise` can carry.
HIGHEST_DEGREE = 4


class EffortError(LinkworkError):
    """No optimal motion was found; ``status`` is IPOPT's."""

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status


class UnattainableError(EffortError):
    """No motion keeps all the bounds."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeastEffort:
    """The motion of least effort, with what its checks say.

    Attributes
    ----------
    parameters : FiveBarParameters
        With the spring that was designed along, where one was.
    crank_speed : float
        rad/s.
    cost : str
        What was minimised.
    effort : float
        Its value: rms force (N), or the mean of the absolute or the positive power (W).
    crank_angle, position, velocity, force, error : ndarray, shape (n,)
        At the collocation points: rad, m, m/s, N, and m of P or rad of the rocker.
    intervals, degree : int
        Of the last transcription.
    status : str
        IPOPT's.
    iterations : int
        IPOPT's, in all.
    attained : float
        Largest error over the turn of the plant run under ``force`` from the start found (m or rad).
    deviation, deviation_velocity : float
        Of that run from the motion found, at most over the turn (m, m/s).
    mesh_effort : float
        Change of the effort when the intervals were last halved, relative to it or to `EFFORT_FLOOR` of its scale.
    mesh_position : float
        Largest change of the position then (m).
    """

    parameters: FiveBarParameters
    crank_speed: float
    cost: Effort
    effort: float
    crank_angle: FloatArray
    position: FloatArray
    velocity: FloatArray
    force: FloatArray
    error: FloatArray
    intervals: int
    degree: int
    status: str
    iterations: int
    attained: float
    deviation: float
    deviation_velocity: float
    mesh_effort: float
    mesh_position: float
    _mesh: _Mesh = field(repr=False)

    def at(self, crank_angle: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position (m), velocity (m/s) and force (N) at any crank angles (rad), by the polynomials of the intervals."""
        return self._mesh.at(np.asarray(crank_angle, float))

    def motion(self, order: int) -> FourierSeries:
        """The motion u(th2) as a Fourier series up to an order, for `inverse_dynamics` and `track`."""
        samples = max(8 * order, 4 * len(self.crank_angle))
        return FourierSeries.from_samples(self.at(2.0 * pi * np.arange(samples) / samples)[0], order)

    def inputs(self) -> Inputs:
        """Crank speed and slider force of one turn, for `simulate` from ``initial`` at t = 0; without the load."""
        return Inputs(speed=self.crank_speed, force=self._mesh.signal(self.crank_speed))

    @property
    def initial(self) -> InitialState:
        """The state at crank angle 0."""
        u, v, _ = self.at(0.0)
        return InitialState(crank_speed=self.crank_speed, slider_position=float(u), slider_velocity=float(v))


def least_effort(
    parameters: FiveBarParameters,
    crank_speed: float,
    target: Target,
    bound: float,
    *,
    cost: Effort = "force",
    stroke: Range = (-inf, inf),
    speed: float = inf,
    force: float = inf,
    transmission: float = radians(5.0),
    spring: Range | None = None,
    load: Load = (0.0, 0.0),
    intervals: int = 40,
    degree: int = 3,
    points: Points = "radau",
    halvings: int = 1,
    guess: FourierSeries | None = None,
) -> LeastEffort:
    """The periodic motion of the slider of least effort that keeps the error within a bound.

    The optimum is a local one: another guess may lead to another.

    Parameters
    ----------
    parameters : FiveBarParameters
    crank_speed : float
        rad/s, above zero.
    target : array_like or function
        Of P: (n, 2) in m; of the rocker's angle: (n,) in rad. An array is at equal steps of the crank angle from 0 over one
        turn and joined by a periodic cubic spline; a function takes an array of crank angles (rad).
    bound : float
        Largest error (m or rad), above zero.
    cost : str
        ``force``: rms force. ``power``: mean absolute power. ``positive power``: mean of the power where it is positive. A
        power has its least with impulses of the force: give a bound on the force with it.
    stroke : (float, float)
        Least and greatest slider position (m).
    speed, force : float
        Largest slider speed (m/s) and control force (N) either way.
    transmission : float
        Least angle between coupler and rocker, and from pi (rad).
    spring : (float, float), optional
        Range of the free position (m) of a spring of any stiffness k >= 0 that is designed along, in place of the one of the
        parameters.
    load : (float, float) or function of the crank angle
        At P (N).
    intervals, degree : int
        Of the first transcription; the degree is that of u and u', 1 to 4, that of the force one less.
    points : str
        ``radau`` or ``legendre``.
    halvings : int
        How often the intervals are halved and the problem is solved again; 0 leaves the mesh unchecked (the two mesh
        figures are then infinite). Corners of the target and guide friction, which turns round within some mm/s, ask for many
        intervals.
    guess : FourierSeries, optional
        Motion to start from; by default a smooth one that keeps the bound about as well as one can.

    Raises
    ------
    InputError
        If something given is not usable.
    UnattainableError
        If no slider position within the stroke keeps the bound at some crank angle, which is named, or IPOPT finds that no
        motion keeps all bounds.
    EffortError
        If IPOPT ends in any other way without a solution.
    AssemblyError
        If the links cannot be joined along ``guess``.
    symbolic.MissingLibraryError
        If CasADi is not installed.
    """
    intervals, halvings = whole(intervals, "intervals"), whole(halvings, "halvings")
    problem = _Problem(
        parameters=parameters,
        crank_speed=crank_speed,
        target=_target(target),
        bound=bound,
        cost=cost,
        stroke=stroke,
        speed=speed,
        force=force,
        transmission=transmission,
        spring=spring,
        load=load,
        degree=whole(degree, "as the degree"),
        points=points,
    )
    if intervals < 4 or halvings < 0:
        raise InputError(f"{intervals} intervals, {halvings} halvings: at least 4 and 0 are needed")
    guess = problem.within() if guess is None else guess
    start = _Mesh.of_motion(problem, guess, intervals)
    solution = problem.solve(start, intervals)
    iterations, effort, moved = solution.iterations, inf, inf
    for _ in range(halvings):
        finer = problem.solve(solution.mesh, 2 * len(solution.mesh.u))
        theta = finer.mesh.angles
        moved = float(np.abs(finer.mesh.at(theta)[0] - solution.mesh.at(theta)[0]).max())
        effort = abs(finer.effort - solution.effort) / max(finer.effort, EFFORT_FLOOR * problem.effort_scale)
        iterations += finer.iterations
        solution = finer
    return problem.result(solution, iterations, effort, moved)


def _target(target: Target) -> Callable[[FloatArray], FloatArray]:
    """The target as a function of crank angles to P, shape (n, 2), or to the rocker's angle, shape (n,)."""
    if callable(target):

        def given(theta: FloatArray) -> FloatArray:
            values = np.asarray(target(theta), float)
            if values.shape not in ((len(theta),), (len(theta), 2)) or not np.isfinite(values).all():
                raise InputError(
                    f"the target gives values of shape {values.shape} for {len(theta)} crank angles: they must be finite, of "
                    f"shape ({len(theta)}, 2) for P or ({len(theta)},) for the rocker's angle"
                )
            return values

        return given
    values = np.asarray(target, float)
    if values.ndim not in (1, 2) or values.shape[1:] not in ((), (2,)) or len(values) < 3:
        raise InputError(
            f"a target of shape {values.shape}: it must be (n, 2) for P or (n,) for the rocker's angle, n >= 3"
        )
    if not np.isfinite(values).all():
        raise InputError("a value of the target is not finite")
    # a rocker that turns fully has an angle that is not periodic, but a direction that is
    plane = values if values.ndim == 2 else np.column_stack([np.cos(values), np.sin(values)])
    angles = np.linspace(0.0, 2.0 * pi, len(values) + 1)
    spline = CubicSpline(angles, np.vstack([plane, plane[:1]]), bc_type="periodic")

    def joined(theta: FloatArray) -> FloatArray:
        xy: FloatArray = spline(np.mod(theta, 2.0 * pi))
        return xy if values.ndim == 2 else np.asarray(np.arctan2(xy[:, 1], xy[:, 0]))

    return joined


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Mesh:
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
    def of_motion(cls, problem: _Problem, slider: FourierSeries, intervals: int) -> _Mesh:
        """The mesh along a motion, with the force of inverse dynamics.

        Raises
        ------
        AssemblyError
            If the links cannot be joined along it.
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


def _shortest_way(miss: FloatArray, travel: FloatArray) -> NDArray[np.intp]:
    """Numbers of the positions, shape (n,), of the closed way of least miss and travel, by dynamic programming.

    ``miss`` has shape (n, m), and ``travel`` (m, m) is the cost from a position to the next. Of three turns the middle one is
    taken, which knows nothing of where they begin and end.
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
class _Solution:
    """What IPOPT found on a mesh."""

    mesh: _Mesh
    effort: float
    status: str
    iterations: int


@dataclass(frozen=True, kw_only=True, eq=False)
class _Problem:
    """The optimal control problem, before it is transcribed. Fields as the arguments of `least_effort`."""

    parameters: FiveBarParameters
    crank_speed: float
    target: Callable[[FloatArray], FloatArray]
    bound: float
    cost: Effort
    stroke: Range
    speed: float
    force: float
    transmission: float
    spring: Range | None
    load: Load
    degree: int
    points: Points

    def __post_init__(self) -> None:
        for name, value, unit in (
            ("crank speed", self.crank_speed, "rad/s"),
            ("bound of the error", self.bound, "m or rad"),
        ):
            if not (isfinite(value) and value > 0.0):
                raise InputError(f"{name} is {value} {unit}: it must be finite and greater than zero")
        for name, value, unit in (("bound of the speed", self.speed, "m/s"), ("bound of the force", self.force, "N")):
            if not value > 0.0:
                raise InputError(f"{name} is {value} {unit}: it must be greater than zero")
        if not self.stroke[0] < self.stroke[1]:
            raise InputError(f"stroke from {self.stroke[0]} m to {self.stroke[1]} m: it must be two increasing numbers")
        if not 0.0 < self.transmission < 0.5 * pi:
            raise InputError(f"least transmission angle is {self.transmission} rad: it must be between 0 and pi/2")
        if self.spring is not None and not (-inf < self.spring[0] <= self.spring[1] < inf):
            raise InputError(f"free position between {self.spring} m: the bounds must be finite and in order")
        if not 1 <= self.degree <= HIGHEST_DEGREE:
            raise InputError(f"degree of the collocation is {self.degree}: it must be 1 to {HIGHEST_DEGREE}")
        for name, choice, known in (
            ("cost", self.cost, ("force", "power", "positive power")),
            ("points", self.points, ("radau", "legendre")),
        ):
            if choice not in known:
                raise InputError(f"{name} is {choice!r}: it must be one of {', '.join(known)}")
        if self.of_point and self.parameters.coupler_point_distance == 0.0:
            raise InputError("coupler.point_distance is 0: P is the crank pin, which no slider moves")

    @cached_property
    def tau(self) -> FloatArray:
        """Collocation points as shares of an interval, shape (d,)."""
        return np.array(symbolic.library().collocation_points(self.degree, self.points))

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
        casadi, plant = symbolic.library(), symbolic.plant()
        th2, s, r, a, f = (casadi.SX.sym(name) for name in ("th2", "s", "r", "a", "f"))
        spring, load, aim = casadi.SX.sym("spring", 2), casadi.SX.sym("load", 2), casadi.SX.sym("aim", 2)
        own = self.parameters if self.spring is None else replace(self.parameters, slider_stiffness=0.0)
        p = own.constants()
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
        return np.asarray(self.bound * np.sqrt(np.where(joint >= sin(self.transmission) ** 2, error, inf)))

    def within(self) -> FourierSeries:
        """A motion to start from: over a grid, the one of least travel that keeps the bound, or nearly.

        Raises
        ------
        UnattainableError
            If at some crank angle no slider position keeps the bound.
        """
        p = self.parameters
        theta = 2.0 * pi * np.arange(ANGLES) / ANGLES
        far = p.crank_length + p.coupler_length + p.rocker_length + p.ground_length
        u = np.linspace(max(self.stroke[0], -far), min(self.stroke[1], far), POSITIONS)
        error = self.grid(theta, u)
        # P moves by no more than r/(l3 sin(th4 - th3)) of the slider's way, the rocker turns by no more than 1/(l4 sin)
        leverage = p.coupler_point_distance / p.coupler_length if self.of_point else 1.0 / p.rocker_length
        between = leverage / sin(self.transmission)
        least = error.min(axis=1, keepdims=True)
        near = np.flatnonzero((error <= np.maximum(least, self.bound) + between * (u[1] - u[0])).any(axis=0))
        u = np.linspace(u[max(near[0] - 1, 0)], u[min(near[-1] + 1, POSITIONS - 1)], WAYS)
        error = self.grid(theta, u)
        self._check_reach(theta, error.min(axis=1) - between * (u[1] - u[0]))
        slack = float(u[1] - u[0]) * leverage
        miss = np.maximum(error - np.maximum(self.bound, error.min(axis=1, keepdims=True)) - slack, 0.0)
        way = u[_shortest_way(miss / slack, (np.subtract.outer(u, u) / self.length) ** 2)]
        for order in GUESS_ORDERS:
            series = FourierSeries.from_samples(way, order)
            if all(assembly_square(th, q, p.constants()) > 0.0 for th, q in zip(theta, series(theta))):
                break
        return series

    def _check_reach(self, theta: FloatArray, least: FloatArray) -> None:
        """Make sure that the least error at each crank angle is within the bound."""
        worst = int(np.argmax(least))
        where = f"at crank angle {degrees(theta[worst]):.1f} deg"
        if not isfinite(least[worst]):
            raise UnattainableError(
                f"{where} the links cannot be joined with a transmission angle of {degrees(self.transmission):g} deg wherever "
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

        # what there is at each collocation point, interval by interval
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
        lower = [*[0.0] * equal.numel(), *[-inf] * (n * d), *[sin(self.transmission) ** 2] * (n * d), 0.0, 0.0]
        upper = [*[0.0] * equal.numel(), *[1.0] * (n * d), *[inf] * (n * d + 2)]

        unknowns = casadi.vertcat(*(casadi.vec(part) for part in (s, r, f)), spring)
        programme = {"x": unknowns, "f": objective, "g": casadi.horzcat(equal, within).T}
        return programme, np.array(lower), np.array(upper)

    def box(self, n: int, side: int) -> FloatArray:
        """Bounds of the unknowns on n intervals, the lower (side -1) or the upper ones (side 1)."""
        stroke = self.stroke[0] if side < 0 else self.stroke[1]
        sizes = (n * (self.degree + 1), n * (self.degree + 1), n * self.degree)
        values = (stroke, side * self.speed, side * self.force)
        bounds = [np.full(size, value / scale) for size, value, scale in zip(sizes, values, self.scales)]
        most = 0.0 if self.spring is None else inf
        return np.concatenate([*bounds, [max(side * most, 0.0), side * most]])

    def pack(self, mesh: _Mesh, n: int) -> FloatArray:
        """The unknowns on n intervals from what a mesh has there."""
        theta = self.angles(n)
        u, v, _ = mesh.at(theta)
        f = mesh.at(theta[:, 1:])[2]
        parts = [values.ravel(order="F") / scale for values, scale in zip((u, v, f), self.scales)]
        return np.concatenate([*parts, np.array(mesh.spring) / self.scales[3:]])

    def unpack(self, x: FloatArray, n: int) -> _Mesh:
        """The mesh of the unknowns on n intervals."""
        nodes = n * (self.degree + 1)
        parts = np.split(x, [nodes, 2 * nodes, len(x) - 2])
        u, v, f = (part.reshape(-1, n).T * scale for part, scale in zip(parts[:3], self.scales))
        stiffness, preload = (parts[3] * self.scales[3:]).tolist()
        return _Mesh(tau=self.tau, u=u, v=v, f=f, spring=(max(stiffness, 0.0), preload))

    def solve(self, start: _Mesh, n: int) -> _Solution:
        """The solution on n intervals that IPOPT comes to from ``start``."""
        programme, lower, upper = self.transcribe(n)
        solver = symbolic.library().nlpsol("least_effort", "ipopt", programme, IPOPT)
        found = solver(x0=self.pack(start, n), lbx=self.box(n, -1), ubx=self.box(n, 1), lbg=lower, ubg=upper)
        self._check(solver.stats(), found, lower, upper)
        mesh = self.unpack(np.array(found["x"]).ravel(), n)
        return _Solution(
            mesh=mesh,
            effort=self.effort(mesh),
            status=solver.stats()["return_status"],
            iterations=int(solver.stats()["iter_count"]),
        )

    def effort(self, mesh: _Mesh) -> float:
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

    def result(self, solution: _Solution, iterations: int, mesh_effort: float, mesh_position: float) -> LeastEffort:
        """The solution with its run on the plant."""
        mesh, parameters = solution.mesh, self.parameters
        if self.spring is not None:
            k, preload = mesh.spring
            free = float(np.clip(preload / k, *self.spring)) if k > 0.0 else 0.0
            parameters = replace(parameters, slider_stiffness=k, slider_spring_free_position=free)
        theta = np.linspace(0.0, 2.0 * pi, 8 * len(mesh.angles) + 1)
        time = theta / self.crank_speed
        u, v, _ = mesh.at(theta)
        loads = np.array([load_at(self.load, angle) for angle in theta.tolist()])
        run = simulate(
            parameters,
            Inputs(
                speed=self.crank_speed,
                force=mesh.signal(self.crank_speed),
                load_x=table(time, loads[:, 0], "cubic"),
                load_y=table(time, loads[:, 1], "cubic"),
            ),
            initial=InitialState(slider_position=float(u[0]), slider_velocity=float(v[0])),
            stop_time=float(time[-1]),
            samples=time,
            tolerance=1e-11,
        )
        if run.status:
            raise EffortError(f"the plant does not follow the motion found: {run.message}", solution.status)
        return LeastEffort(
            parameters=parameters,
            crank_speed=float(self.crank_speed),
            cost=self.cost,
            effort=solution.effort,
            crank_angle=mesh.angles,
            position=mesh.u[:, 1:].ravel(),
            velocity=mesh.v[:, 1:].ravel(),
            force=mesh.f.ravel(),
            error=self.errors(mesh.angles, mesh.u[:, 1:].ravel()),
            intervals=len(mesh.u),
            degree=self.degree,
            status=solution.status,
            iterations=iterations,
            attained=float(self.errors(theta, run["slider.position"]).max()),
            deviation=float(np.abs(run["slider.position"] - u).max()),
            deviation_velocity=float(np.abs(run["slider.velocity"] - v).max()),
            mesh_effort=mesh_effort,
            mesh_position=mesh_position,
            _mesh=mesh,
        )
