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
from math import inf, pi

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from linkwork.errors import InputError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState

from ..numerics.fourier import FourierSeries
from ..run import Inputs, at_its_speed, simulate, table, takes_published
from ..units import Amount, in_si
from .collocation import Collocation, Effort, EffortError, Mesh, MotionLimits, Problem, Range, Transcribed
from .inverse import FloatArray, Load, load_at

#: Points over crank angles (rad): (n,) to (n, 2) for P (m), or to (n,) for the rocker's angle (rad).
Target = Callable[[FloatArray], ArrayLike] | ArrayLike
NO_LIMITS, USUAL = MotionLimits(), Collocation()
#: Share of the scale of the effort below which it counts as none.
EFFORT_FLOOR = 1e-6


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
    _mesh: Mesh = field(repr=False)

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


@takes_published(crank_speed=at_its_speed)
@in_si(crank_speed="rad/s")
def least_effort(
    parameters: FiveBarParameters,
    crank_speed: Amount,
    target: Target,
    bound: float,
    *,
    cost: Effort = "force",
    limits: MotionLimits = NO_LIMITS,
    spring: Range | None = None,
    load: Load = (0.0, 0.0),
    collocation: Collocation = USUAL,
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
    limits : MotionLimits
        Of position, speed, force and transmission angle.
    spring : (float, float), optional
        Range of the free position (m) of a spring of any stiffness k >= 0 that is designed along, in place of the one of the
        parameters.
    load : (float, float) or function of the crank angle
        At P (N).
    collocation : Collocation
        Intervals, degree, points, halvings.
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
    """
    problem = Problem(
        parameters=parameters,
        crank_speed=crank_speed,
        target=_target(target),
        bound=bound,
        cost=cost,
        limits=limits,
        spring=spring,
        load=load,
        collocation=collocation,
    )
    guess = problem.within() if guess is None else guess
    start = Mesh.of_motion(problem, guess, collocation.intervals)
    solution = problem.solve(start, collocation.intervals)
    iterations, effort, moved = solution.iterations, inf, inf
    for _ in range(collocation.halvings):
        finer = problem.solve(solution.mesh, 2 * len(solution.mesh.u))
        theta = finer.mesh.angles
        moved = float(np.abs(finer.mesh.at(theta)[0] - solution.mesh.at(theta)[0]).max())
        effort = abs(finer.effort - solution.effort) / max(finer.effort, EFFORT_FLOOR * problem.effort_scale)
        iterations += finer.iterations
        solution = finer
    return _checked(problem, solution, iterations, effort, moved)


def _target(target: Target) -> Callable[[FloatArray], FloatArray]:
    """The target as a function of crank angles to P, shape (n, 2), or to the rocker's angle, shape (n,)."""
    if callable(target):

        def check(theta: FloatArray) -> FloatArray:
            values = np.asarray(target(theta), float)
            if values.shape not in ((len(theta),), (len(theta), 2)) or not np.isfinite(values).all():
                raise InputError(
                    f"the target gives values of shape {values.shape} for {len(theta)} crank angles: they must be finite, of "
                    f"shape ({len(theta)}, 2) for P or ({len(theta)},) for the rocker's angle"
                )
            return values

        return check
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

    def interpolate(theta: FloatArray) -> FloatArray:
        xy: FloatArray = spline(np.mod(theta, 2.0 * pi))
        return xy if values.ndim == 2 else np.asarray(np.arctan2(xy[:, 1], xy[:, 0]))

    return interpolate


def _checked(
    problem: Problem, solution: Transcribed, iterations: int, mesh_effort: float, mesh_position: float
) -> LeastEffort:
    """The solution with its run on the plant."""
    mesh, parameters = solution.mesh, problem.parameters
    if problem.spring is not None:
        k, preload = mesh.spring
        free = float(np.clip(preload / k, *problem.spring)) if k > 0.0 else 0.0
        parameters = replace(parameters, slider_stiffness=k, slider_spring_free_position=free)
    theta = np.linspace(0.0, 2.0 * pi, 8 * len(mesh.angles) + 1)
    time = theta / problem.crank_speed
    u, v, _ = mesh.at(theta)
    loads = np.array([load_at(problem.load, angle) for angle in theta.tolist()])
    run = simulate(
        parameters,
        Inputs(
            speed=problem.crank_speed,
            force=mesh.signal(problem.crank_speed),
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
        crank_speed=float(problem.crank_speed),
        cost=problem.cost,
        effort=solution.effort,
        crank_angle=mesh.angles,
        position=mesh.u[:, 1:].ravel(),
        velocity=mesh.v[:, 1:].ravel(),
        force=mesh.f.ravel(),
        error=problem.errors(mesh.angles, mesh.u[:, 1:].ravel()),
        intervals=len(mesh.u),
        degree=problem.degree,
        status=solution.status,
        iterations=iterations,
        attained=float(problem.errors(theta, run["slider.position"]).max()),
        deviation=float(np.abs(run["slider.position"] - u).max()),
        deviation_velocity=float(np.abs(run["slider.velocity"] - v).max()),
        mesh_effort=mesh_effort,
        mesh_position=mesh_position,
        _mesh=mesh,
    )
