"""The five-bar slider in redundant coordinates with Lagrange multipliers (Youssef, chapter III, eqs 3.1-3.10).

This is the check of the reduced form in `linkwork.five_bar.dynamics`: another formulation of the same mechanism, which
shares no algebra with it. The coordinates are q = (th2, th3, th4, u), all angles absolute, so that the rocker's th4 is
the thesis's theta4 + alpha. With phi the loop closure (2.1), J = d phi / d q and lam the multipliers,

    M q'' + h = Q + J^T lam
    J q''     = -J' q'

is solved as one system of 6 equations; at prescribed speed a third constraint th2'' = given makes it 7, and its
multiplier is the crank torque. The two loop multipliers are the force of the rocker on the coupler at C (2.3). The other
pin forces come from Newton's and Euler's laws of the separate links, as one system of 11 equations in which the torque
and the force along the guide are unknown too: what it finds for these, and for the force at C, must be what the
multipliers say.

Plane vectors are complex numbers, x + i y: a point of the mechanism is ``origin + sum_j arm_j e^(i q_j) + arm_u u``, its
Jacobian and its centripetal acceleration follow by differentiation, term by term.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import acos, atan2, degrees, hypot, pi, tanh
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from analysis.mechanisms import require_five_bar
from linkwork.errors import AssemblyError, InputError, IntegrationError
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.friction import FRICTION_SPEED

Vector = NDArray[np.float64]
ComplexVector = NDArray[np.complex128]

#: Torque (N.m), force on the slider (N) and load at P (N, N) at time t and the redundant state q, q'.
InputFunction = Callable[[float, Vector, Vector], tuple[float, float, float, float]]

#: Names of the forces in `MultiplierSolution.forces`, as in the FMI contract.
FORCE_NAMES = (
    "pin.A.fx",
    "pin.A.fy",
    "pin.B.fx",
    "pin.B.fy",
    "pin.C.fx",
    "pin.C.fy",
    "pin.D.fx",
    "pin.D.fy",
    "slider.guide_force",
)

#: Refinements of the linear system after which no further digit is to be had.
MOST_REFINEMENTS = 4

# rows of the table of points: centres of mass first
_G2, _G3, _G4, _G5, _B, _C_COUPLER, _C_ROCKER, _P = range(8)


class SpeedDrive(NamedTuple):
    """Prescribed motion of the crank: its speed at the start (rad/s) and its acceleration (rad/s2) over time."""

    initial: float
    acceleration: Callable[[float], float] = lambda t: 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MultiplierSolution:
    """Accelerations and forces at one instant, from the redundant form.

    Attributes
    ----------
    accelerations : ndarray, shape (4,)
        th2'', th3'', th4'' (rad/s2) and u'' (m/s2).
    multipliers : ndarray, shape (2,) or (3,)
        Force of the rocker on the coupler at C (N, N); at prescribed speed then the crank torque (N.m).
    torque : float
        Crank torque (N.m): the given one, or the third multiplier.
    forces : mapping
        Pin forces and guide force (N) by FMI name, see `FORCE_NAMES`. A, B, D and the guide are from Newton's laws of the
        links, C is the multipliers.
    closure : float
        Length by which the loop fails to close (m).
    closure_rate : float
        Speed at which it opens (m/s).
    newton_mismatch : float
        Largest difference between what Newton's laws and what the multipliers give for the force at C, the torque (as a
        force at the crank pin) and the force on the slider, relative to the largest force of the mechanism.
    residual : float
        Largest residual of the linear system after refinement, relative to the largest term of its row.
    refinements : int
        Refinements of the linear system that were made.
    """

    accelerations: Vector
    multipliers: Vector
    torque: float
    forces: Mapping[str, float]
    closure: float
    closure_rate: float
    newton_mismatch: float
    residual: float
    refinements: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RedundantRun:
    """A motion integrated in all redundant coordinates, so that loop closure is a result and not an assumption.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times (s).
    q : ndarray, shape (n, 4)
        th2, th3, th4 (rad) and u (m).
    qd : ndarray, shape (n, 4)
        Their rates (rad/s and m/s).
    closure : ndarray, shape (n,)
        Length by which the loop fails to close (m): the drift.
    closure_rate : ndarray, shape (n,)
        Speed at which it opens (m/s).
    evaluations : int
        Evaluations of the right-hand side.
    """

    t: Vector
    q: Vector
    qd: Vector
    closure: Vector
    closure_rate: Vector
    evaluations: int

    @property
    def drift(self) -> float:
        """Largest failure of loop closure over the run (m)."""
        return float(self.closure.max())


class _Links(NamedTuple):
    """Points of the mechanism as ``origin + arms[:, :3] e^(i angles) + arms[:, 3] u``, and the inertias of the links."""

    origin: ComplexVector
    arms: ComplexVector
    masses: Vector
    inertias: Vector
    gravity: complex
    guide: complex


@lru_cache(maxsize=256)
def _links(parameters: FiveBarParameters) -> _Links:
    p = parameters
    guide = complex(np.exp(1j * p.slider_guide_angle))
    l1, l2 = p.ground_length, p.crank_length
    arms = np.zeros((8, 4), dtype=complex)
    arms[_G2, 0] = p.crank_cog_distance * np.exp(1j * p.crank_cog_angle)
    arms[[_G3, _B, _C_COUPLER, _P], 0] = l2
    arms[_G3, 1] = p.coupler_cog_distance * np.exp(1j * p.coupler_cog_angle)
    arms[_C_COUPLER, 1] = p.coupler_length
    arms[_P, 1] = p.coupler_point_distance * np.exp(1j * p.coupler_point_angle)
    arms[_G4, 2] = p.rocker_cog_distance * np.exp(1j * p.rocker_cog_angle)
    arms[_C_ROCKER, 2] = p.rocker_length
    arms[[_G4, _G5, _C_ROCKER], 3] = guide
    origin = np.zeros(8, dtype=complex)
    origin[[_G4, _G5, _C_ROCKER]] = l1
    # the crank's inertia is given about its shaft: Steiner's part belongs to the motion of its centre of mass
    crank_inertia = p.crank_inertia - p.crank_mass * p.crank_cog_distance**2
    return _Links(
        origin,
        arms,
        np.array([p.crank_mass, p.coupler_mass, p.rocker_mass, p.slider_mass]),
        np.array([crank_inertia, p.coupler_inertia, p.rocker_inertia, 0.0]),
        complex(p.gravity * np.exp(-1j * (pi / 2 + p.ground_inclination))),
        guide,
    )


class _State(NamedTuple):
    """Points (8,), their Jacobian (8, 4), and their accelerations at q'' = 0 (8,)."""

    points: ComplexVector
    jacobian: ComplexVector
    centripetal: ComplexVector


def _state(q: Vector, qd: Vector, links: _Links) -> _State:
    turned = links.arms[:, :3] * np.exp(1j * q[:3])
    return _State(
        links.origin + turned.sum(axis=1) + links.arms[:, 3] * q[3],
        np.concatenate([1j * turned, links.arms[:, 3:]], axis=1),
        -(turned @ qd[:3] ** 2).astype(complex),
    )


def _real(x: ComplexVector) -> Vector:
    """A complex row, or number, as its x and y rows: shape (...,) to (2, ...)."""
    return np.stack([x.real, x.imag])


def assemble(parameters: FiveBarParameters, crank_angle: float, slider_position: float) -> Vector:
    """Redundant coordinates that close the loop, from the law of cosines and Newton's iteration on (2.1).

    Parameters
    ----------
    parameters : FiveBarParameters
    crank_angle, slider_position : float
        The two freedoms (rad, m).

    Returns
    -------
    ndarray, shape (4,)
        th2, th3, th4 (rad) and u (m).

    Raises
    ------
    AssemblyError
        If the links cannot be joined.
    """
    require_five_bar(parameters, "the redundant form")
    l3, l4 = parameters.coupler_length, parameters.rocker_length
    links = _links(parameters)
    state = _state(np.array([crank_angle, 0.0, 0.0, slider_position]), np.zeros(4), links)
    line = complex(state.points[_G5] - state.points[_B])
    d, beta = abs(line), atan2(line.imag, line.real)
    if not abs(l3 - l4) < d < l3 + l4:
        raise AssemblyError(
            f"the links cannot be joined at crank angle {crank_angle:.9g} rad ({degrees(crank_angle):.4f} deg) and slider "
            f"position {slider_position:.9g} m: crank pin and slider pin are {d:.9g} m apart"
        )
    at_b = acos(min(1.0, (d * d + l3 * l3 - l4 * l4) / (2.0 * d * l3)))
    at_d = acos(min(1.0, (d * d + l4 * l4 - l3 * l3) / (2.0 * d * l4)))
    branch = parameters.assembly_branch
    q = np.array([crank_angle, beta + branch * at_b, beta + pi - branch * at_d, slider_position])
    for _ in range(3):
        state = _state(q, np.zeros(4), links)
        loop = state.jacobian[_C_COUPLER] - state.jacobian[_C_ROCKER]
        gap = state.points[_C_COUPLER] - state.points[_C_ROCKER]
        q[1:3] -= np.linalg.solve(_real(loop[1:3]), _real(gap))
    return q


def rates(parameters: FiveBarParameters, q: ArrayLike, crank_speed: float, slider_velocity: float) -> Vector:
    """Rates of the redundant coordinates that keep the loop closed, shape (4,): J q' = 0 for the two given ones.

    Raises
    ------
    AssemblyError
        If coupler and rocker are collinear.
    """
    q = np.asarray(q, dtype=float)
    jacobian = _state(q, np.zeros(4), _links(parameters)).jacobian
    loop = _real(jacobian[_C_COUPLER] - jacobian[_C_ROCKER])
    try:
        w3, w4 = np.linalg.solve(loop[:, 1:3], -loop[:, [0, 3]] @ [crank_speed, slider_velocity])
    except np.linalg.LinAlgError as error:
        raise AssemblyError(f"coupler and rocker are collinear {_where(q)}") from error
    return np.array([crank_speed, w3, w4, slider_velocity])


def _where(q: Vector) -> str:
    return f"at crank angle {q[0]:.9g} rad ({degrees(q[0]):.4f} deg) and slider position {q[3]:.9g} m"


def mass_matrix(parameters: FiveBarParameters, q: ArrayLike) -> Vector:
    """Mass matrix of the redundant coordinates, shape (4, 4): sum over the links of m J_G^T J_G and I_G.

    Rows and columns th2, th3, th4 (rad) and u (m): entries in kg.m2, kg.m and kg.
    """
    links = _links(parameters)
    return _mass_matrix(_state(np.asarray(q, dtype=float), np.zeros(4), links), links)


def _mass_matrix(state: _State, links: _Links) -> Vector:
    jacobian = state.jacobian[:4]
    return np.real(jacobian.conj().T @ (links.masses[:, None] * jacobian)) + np.diag(links.inertias)


def _slider_resistance(u: float, v: float, p: FiveBarParameters) -> float:
    """Force (N) along the guide of spring, damper and friction."""
    return -(
        p.slider_stiffness * (u - p.slider_spring_free_position)
        + p.slider_damping * v
        + p.slider_coulomb_friction * tanh(v / FRICTION_SPEED)
    )


class _System(NamedTuple):
    """The linear system of 6 or 7 equations: symmetric matrix, right-hand side; unknowns q'' and minus the multipliers."""

    matrix: Vector
    rhs: Vector


def _system(
    parameters: FiveBarParameters,
    state: _State,
    q: Vector,
    qd: Vector,
    torque: float,
    slider_force: float,
    load: complex,
    crank_acceleration: float | None,
) -> _System:
    links = _links(parameters)
    jacobian = state.jacobian[:4]
    # M q'' + h = Q + J^T lam; gravity enters as an acceleration of every centre of mass
    applied = links.masses * (links.gravity - state.centripetal[:4])
    force = np.real(jacobian.conj().T @ applied) + np.real(state.jacobian[_P].conj() * load)
    force[0] += torque
    force[3] += slider_force + _slider_resistance(q[3], qd[3], parameters)
    loop = _real(state.jacobian[_C_COUPLER] - state.jacobian[_C_ROCKER])
    bias = -_real(state.centripetal[_C_COUPLER] - state.centripetal[_C_ROCKER])
    if crank_acceleration is not None:
        loop = np.vstack([loop, [1.0, 0.0, 0.0, 0.0]])
        bias = np.append(bias, crank_acceleration)
    n = 4 + len(loop)
    matrix = np.zeros((n, n))
    matrix[:4, :4] = _mass_matrix(state, links)
    matrix[:4, 4:] = loop.T
    matrix[4:, :4] = loop
    return _System(matrix, np.concatenate([force, bias]))


def _refined_solve(matrix: Vector, rhs: Vector) -> tuple[Vector, float, int]:
    """Solve a symmetric system with iterative refinement: the solution, its relative residual, the refinements.

    Rows and columns are first brought to like size (kg.m2, kg and m stand side by side in the matrix); the residuals are
    formed in extended precision, as the thesis's subroutine does.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the matrix is singular.
    """
    scale: Vector = np.ones(len(rhs))
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(3):
            scale /= np.sqrt(np.abs(matrix * np.outer(scale, scale)).max(axis=1))
    if not np.isfinite(scale).all():
        raise np.linalg.LinAlgError("a row of zeros, or an entry that is not finite")
    scale = np.asarray(np.ldexp(1.0, np.round(np.log2(scale)).astype(int)))  # powers of two: nothing is rounded
    a = matrix * np.outer(scale, scale)
    b = rhs * scale
    wide_a, wide_b = a.astype(np.longdouble), b.astype(np.longdouble)
    wide_x = np.linalg.solve(a, b).astype(np.longdouble)
    size = np.abs(a) @ np.abs(wide_x.astype(float)) + np.abs(b)
    size[size == 0.0] = 1.0
    refinements = 0
    wide_r = wide_b - wide_a @ wide_x
    while refinements < MOST_REFINEMENTS:
        trial_x = wide_x + np.linalg.solve(a, wide_r.astype(float))
        trial_r = wide_b - wide_a @ trial_x
        if not np.abs(trial_r / size).max() < np.abs(wide_r / size).max():
            break
        wide_x, wide_r = trial_x, trial_r
        refinements += 1
    return wide_x.astype(float) * scale, float(np.abs(wide_r / size).max()), refinements


def _cross(a: complex, b: complex) -> float:
    """Moment of the force ``b`` at the arm ``a``."""
    return (a.conjugate() * b).imag


class _LinkForces(NamedTuple):
    """Forces at A, B, C, D (N), of the guide (N), crank torque (N.m) and whole force on the slider along the guide (N)."""

    a: complex
    b: complex
    c: complex
    d: complex
    guide: float
    torque: float
    along: float


def _newton_euler(state: _State, accelerations: Vector, load: complex, links: _Links) -> _LinkForces:
    """All forces at known accelerations, from Newton's and Euler's laws of crank, coupler, rocker and slider.

    Unknown are the pin forces A, B, C, D, the guide's force, the crank torque and the force along the guide: 11, with
    three equations for each of crank, coupler and rocker about its own centre of mass, and two for the slider.
    """
    acceleration = state.jacobian[:4] @ accelerations + state.centripetal[:4]
    # what the unknown forces have to supply on each link, and in moment about its centre of mass
    net = links.masses * (acceleration - links.gravity)
    spin = links.inertias * accelerations
    net[_G3] -= load
    spin[1] -= _cross(state.points[_P] - state.points[_G3], load)

    points = {"A": 0j, "B": state.points[_B], "C": state.points[_C_COUPLER], "D": state.points[_G5]}
    #: (link, pin, sign) of every pin force: A on the crank, B on the coupler, C on the coupler, D on the rocker
    carried = (
        (_G2, "A", 1.0),
        (_G2, "B", -1.0),
        (_G3, "B", 1.0),
        (_G3, "C", 1.0),
        (_G4, "C", -1.0),
        (_G4, "D", 1.0),
        (_G5, "D", -1.0),
    )
    matrix = np.zeros((11, 11))
    for link, pin, sign in carried:
        column = 2 * "ABCD".index(pin)
        arm = points[pin] - state.points[link]
        matrix[2 * link, column] = sign
        matrix[2 * link + 1, column + 1] = sign
        if link != _G5:
            matrix[8 + link, column] = -sign * arm.imag
            matrix[8 + link, column + 1] = sign * arm.real
    normal = 1j * links.guide
    matrix[2 * _G5 : 2 * _G5 + 2, 8] = normal.real, normal.imag
    matrix[2 * _G5 : 2 * _G5 + 2, 10] = links.guide.real, links.guide.imag
    matrix[8 + _G2, 9] = 1.0
    x = np.linalg.solve(matrix, np.concatenate([_real(net).T.ravel(), spin[:3]]))
    pins = x[0:8:2] + 1j * x[1:8:2]
    a, b, c, d = (complex(force) for force in pins)
    return _LinkForces(a, b, c, d, float(x[8]), float(x[9]), float(x[10]))


def _checked(name: str, value: ArrayLike, size: int) -> Vector:
    array = np.array(value, dtype=float)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise InputError(f"{name} is {value!r}: it must be {size} finite numbers")
    return array


def solve_multipliers(
    parameters: FiveBarParameters,
    q: ArrayLike,
    qd: ArrayLike,
    *,
    torque: float = 0.0,
    slider_force: float = 0.0,
    load: tuple[float, float] = (0.0, 0.0),
    crank_acceleration: float | None = None,
) -> MultiplierSolution:
    """Accelerations, multipliers and pin forces at one instant, from the redundant form (3.1-3.10).

    Parameters
    ----------
    parameters : FiveBarParameters
    q : array_like, shape (4,)
        th2, th3, th4 (rad, absolute) and u (m); see `assemble`.
    qd : array_like, shape (4,)
        Their rates (rad/s, m/s); see `rates`.
    torque : float
        Crank torque (N.m); of no effect where ``crank_acceleration`` is given.
    slider_force : float
        Control force on the slider (N).
    load : tuple of float
        Force at the coupler point P (N, N).
    crank_acceleration : float, optional
        Prescribed crank acceleration (rad/s2); its multiplier is then the crank torque.

    Raises
    ------
    InputError
        If ``q``, ``qd`` or an input is not finite or of the wrong shape.
    AssemblyError
        If coupler and rocker are collinear, where the system is singular.
    """
    q, qd = _checked("q", q, 4), _checked("qd", qd, 4)
    _checked("(torque, slider force, load)", (torque, slider_force, *load), 4)
    if crank_acceleration is not None:
        _checked("crank_acceleration", [crank_acceleration], 1)
        torque = 0.0
    links = _links(parameters)
    state = _state(q, qd, links)
    at_p = complex(*load)
    system = _system(parameters, state, q, qd, torque, slider_force, at_p, crank_acceleration)
    try:
        x, residual, refinements = _refined_solve(*system)
        accelerations, multipliers = x[:4], -x[4:]
        newton = _newton_euler(state, accelerations, at_p, links)
    except np.linalg.LinAlgError as error:
        raise AssemblyError(f"coupler and rocker are collinear {_where(q)}") from error
    if crank_acceleration is not None:
        torque = float(multipliers[2])
    force_c = complex(multipliers[0], multipliers[1])
    along = slider_force + _slider_resistance(q[3], qd[3], parameters)
    largest = max(abs(newton.a), abs(newton.b), abs(force_c), abs(newton.d), abs(newton.guide), abs(along), 1e-300)
    mismatch = max(
        abs(newton.c - force_c), abs(newton.torque - torque) / parameters.crank_length, abs(newton.along - along)
    )
    forces = (
        *(newton.a.real, newton.a.imag),
        *(newton.b.real, newton.b.imag),
        *(force_c.real, force_c.imag),
        *(newton.d.real, newton.d.imag),
        newton.guide,
    )
    closure, closure_rate = _closure(q, qd, links)
    return MultiplierSolution(
        accelerations=accelerations,
        multipliers=multipliers,
        torque=float(torque),
        forces=MappingProxyType(dict(zip(FORCE_NAMES, forces))),
        closure=closure,
        closure_rate=closure_rate,
        newton_mismatch=mismatch / largest,
        residual=residual,
        refinements=refinements,
    )


def _closure(q: Vector, qd: Vector, links: _Links) -> tuple[float, float]:
    """Failure of (2.1) and of its first derivative (m, m/s)."""
    state = _state(q, qd, links)
    gap = complex(state.points[_C_COUPLER] - state.points[_C_ROCKER])
    rate = complex((state.jacobian[_C_COUPLER] - state.jacobian[_C_ROCKER]) @ qd)
    return hypot(gap.real, gap.imag), hypot(rate.real, rate.imag)


def no_inputs(t: float, q: Vector, qd: Vector) -> tuple[float, float, float, float]:
    """No torque, no control force, no load."""
    return 0.0, 0.0, 0.0, 0.0


def simulate_redundant(
    parameters: FiveBarParameters,
    initial: InitialState,
    inputs: InputFunction,
    t_eval: ArrayLike,
    rtol: float = 1e-10,
    atol: float = 1e-12,
    method: Any = "DOP853",
    speed: SpeedDrive | None = None,
    **options: Any,
) -> RedundantRun:
    """Integrate all four redundant accelerations, as the thesis recommends to do first.

    Nothing holds the loop closed but the accelerations themselves: the failure of (2.1) that builds up is a measure of
    the error of the equations and of the integration.

    Parameters
    ----------
    parameters : FiveBarParameters
    initial : InitialState
        Start, at ``t_eval[0]``; the loop is closed there, in position and velocity.
    inputs : callable
        ``inputs(t, q, qd) -> (torque, slider_force, load_x, load_y)``, in N.m and N; smooth over the run.
    t_eval : array_like, shape (n,)
        Times of the result (s), increasing.
    rtol, atol : float
        Tolerances of the integrator.
    method : str or OdeSolver
        Method of `scipy.integrate.solve_ivp`; `analysis.run.hamming.Hamming` is the thesis's.
    speed : SpeedDrive, optional
        Prescribed crank motion; its initial speed takes the place of ``initial.crank_speed`` and the torque of
        ``inputs`` has no effect.
    **options
        Further options of `scipy.integrate.solve_ivp`, such as ``first_step`` and ``max_step``.

    Raises
    ------
    InputError
        If ``t_eval`` is not increasing, or the inputs are not finite.
    AssemblyError
        If the links cannot be joined at the start, or become collinear.
    IntegrationError
        If the integrator gives up.
    """
    t = np.array(t_eval, dtype=float)
    if t.ndim != 1 or len(t) < 2 or not np.isfinite(t).all() or not (np.diff(t) > 0.0).all():
        raise InputError("t_eval must be two or more finite times in increasing order")
    links = _links(parameters)
    q = assemble(parameters, initial.crank_angle, initial.slider_position)
    qd = rates(parameters, q, initial.crank_speed if speed is None else speed.initial, initial.slider_velocity)

    latest = float(t[0])

    def derivative(t: float, y: Vector) -> Vector:
        nonlocal latest
        latest = float(t)
        q, qd = y[:4], y[4:]
        if not np.isfinite(y).all():
            return np.full(8, np.nan)  # a trial of the integrator went too far: it takes it shorter
        torque, slider_force, load_x, load_y = _checked(f"what the inputs return at t = {t:.9g} s", inputs(t, q, qd), 4)
        if speed is not None:
            torque = 0.0
        system = _system(
            parameters,
            _state(q, qd, links),
            q,
            qd,
            torque,
            slider_force,
            complex(load_x, load_y),
            None if speed is None else speed.acceleration(t),
        )
        try:
            x, _, _ = _refined_solve(*system)
        except np.linalg.LinAlgError as error:
            raise AssemblyError(f"coupler and rocker are collinear {_where(q)}, t = {t:.9g} s") from error
        return np.concatenate([qd, x[:4]])

    result = solve_ivp(
        derivative,
        (t[0], t[-1]),
        np.concatenate([q, qd]),
        method=method,
        t_eval=t,
        rtol=rtol,
        atol=atol,
        **options,
    )
    if not result.success:
        raise IntegrationError(f"the redundant form stopped at t = {latest:.9g} s: {result.message}")
    q_run, qd_run = result.y[:4].T, result.y[4:].T
    closure = np.array([_closure(a, b, links) for a, b in zip(q_run, qd_run)])
    return RedundantRun(
        t=result.t,
        q=q_run,
        qd=qd_run,
        closure=closure[:, 0],
        closure_rate=closure[:, 1],
        evaluations=int(result.nfev),
    )
