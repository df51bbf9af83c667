"""The five-bar slider in redundant coordinates with Lagrange multipliers (Youssef, chapter III, eqs 3.1-3.10).

This checks the reduced form in `linkwork.five_bar.dynamics` by another formulation of the same mechanism that shares no
algebra with the reduced form. The coordinates are q = (th2, th3, th4, u). All angles are absolute, so that the rocker's
th4 is the thesis's theta4 + alpha. With the loop closure phi (2.1), J = d phi / d q and the multipliers lam,

    M q'' + h = Q + J^T lam
    J q''     = -J' q'

is solved as one system of 6 equations. At prescribed speed a third constraint, th2'' = given, makes 7 equations; its
multiplier is the crank torque. The two loop multipliers are the force of the rocker on the coupler at C (2.3). The other
pin forces come from Newton's and Euler's laws of the separate links, a system of 11 equations. Torque, force along the
guide and force at C are unknowns of this system too; its solution for them must agree with the multipliers.

Plane vectors are complex numbers, x + i y: a point of the mechanism is ``origin + sum_j arm_j e^(i q_j) + arm_u u``, its
Jacobian and its centripetal acceleration follow by differentiation, term by term.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from math import acos, atan2, pi, tanh
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.friction import FRICTION_SPEED

Vector = NDArray[np.float64]
ComplexVector = NDArray[np.complex128]

#: Torque (N.m), force on the slider (N) and load at P (N, N) at time t and the redundant state q, q'.
InputFunction = Callable[[float, Vector, Vector], tuple[float, float, float, float]]

#: Names of the forces in `MultiplierSolution.forces`, as in the FMI contract.
FORCE_NAMES = (*(f"pin.{pin}.f{axis}" for pin in "ABCD" for axis in "xy"), "slider.guide_force")

#: Number of iterative refinements of the linear system; more give no further digit.
MOST_REFINEMENTS = 4

# rows of the table of points: centres of mass first
_G2, _G3, _G4, _G5, _B, _C_COUPLER, _C_ROCKER, _P = range(8)


class SpeedDrive(NamedTuple):
    """Prescribed motion of the crank: its speed at the start (rad/s) and its acceleration (rad/s2) over time."""

    initial: float
    acceleration: Callable[[float], float] = lambda t: 0.0


class MultiplierSolution(NamedTuple):
    """Accelerations and forces at one instant."""

    #: th2'', th3'', th4'' (rad/s2) and u'' (m/s2).
    accelerations: Vector
    #: Force of the rocker on the coupler at C (N, N); at prescribed speed then the crank torque (N.m).
    multipliers: Vector
    #: Crank torque (N.m): the given one, or the third multiplier.
    torque: float
    #: Pin forces and guide force (N). A, B, D and the guide force are from Newton's laws of the links, C from the multipliers.
    forces: Mapping[str, float]
    #: Length by which the loop fails to close (m).
    closure: float
    #: Largest difference between Newton's laws and the multipliers in the force at C, the torque (as a force at the crank
    #: pin) and the force on the slider, relative to the largest force of the mechanism.
    newton_mismatch: float
    #: Largest residual of the linear system after refinement, relative to the largest term of its row.
    residual: float


class RedundantRun(NamedTuple):
    """A motion integrated in all redundant coordinates, so that loop closure is a result and not an assumption."""

    #: Times (s), shape (n,).
    t: Vector
    #: th2, th3, th4 (rad) and u (m), shape (n, 4), and their rates.
    q: Vector
    qd: Vector
    #: Length by which the loop fails to close (m) and speed at which it opens (m/s), shape (n,).
    closure: Vector
    closure_rate: Vector

    @property
    def drift(self) -> float:
        """Return the largest failure of loop closure over the run (m)."""
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
    # the crank's inertia is given about its shaft: subtract m r^2 to have it about the centre of mass
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
    """Positions of the points (8,), their Jacobian (8, 4), and their accelerations at q'' = 0 (8,)."""

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


def _loop(x: ComplexVector) -> ComplexVector:
    """Return the difference of coupler and rocker at C, from positions, Jacobian or accelerations of all points."""
    return x[_C_COUPLER] - x[_C_ROCKER]


def _real(x: ComplexVector) -> Vector:
    """Convert complex numbers to x and y rows: shape (...,) to (2, ...)."""
    return np.stack([x.real, x.imag])


def assemble(parameters: FiveBarParameters, crank_angle: float, slider_position: float) -> Vector:
    """Return redundant coordinates that close the loop, by the law of cosines and Newton's iteration on (2.1)."""
    l3, l4 = parameters.coupler_length, parameters.rocker_length
    links = _links(parameters)
    state = _state(np.array([crank_angle, 0.0, 0.0, slider_position]), np.zeros(4), links)
    line = complex(state.points[_G5] - state.points[_B])
    d, beta = abs(line), atan2(line.imag, line.real)
    at_b = acos(min(1.0, (d * d + l3 * l3 - l4 * l4) / (2.0 * d * l3)))
    at_d = acos(min(1.0, (d * d + l4 * l4 - l3 * l3) / (2.0 * d * l4)))
    branch = parameters.assembly_branch
    q = np.array([crank_angle, beta + branch * at_b, beta + pi - branch * at_d, slider_position])
    for _ in range(3):
        state = _state(q, np.zeros(4), links)
        q[1:3] -= np.linalg.solve(_real(_loop(state.jacobian)[1:3]), _real(_loop(state.points)))
    return q


def rates(parameters: FiveBarParameters, q: ArrayLike, crank_speed: float, slider_velocity: float) -> Vector:
    """Return the rates of the redundant coordinates, shape (4,), that keep the loop closed: J q' = 0 with two rates given."""
    loop = _real(_loop(_state(np.asarray(q, dtype=float), np.zeros(4), _links(parameters)).jacobian))
    w3, w4 = np.linalg.solve(loop[:, 1:3], -loop[:, [0, 3]] @ [crank_speed, slider_velocity])
    return np.array([crank_speed, w3, w4, slider_velocity])


def _mass_matrix(state: _State, links: _Links) -> Vector:
    jacobian = state.jacobian[:4]
    return np.real(jacobian.conj().T @ (links.masses[:, None] * jacobian)) + np.diag(links.inertias)


def _slider_resistance(u: float, v: float, p: FiveBarParameters) -> float:
    """Return the force of spring, damper and friction along the guide (N)."""
    return -(
        p.slider_stiffness * (u - p.slider_spring_free_position)
        + p.slider_damping * v
        + p.slider_coulomb_friction * tanh(v / FRICTION_SPEED)
    )


def _system(
    parameters: FiveBarParameters,
    q: Vector,
    qd: Vector,
    acting: tuple[float, float, float, float],
    crank_acceleration: float | None,
) -> tuple[Vector, Vector]:
    """Return matrix and right-hand side of the 6 or 7 equations; unknowns are q'' and minus the multipliers."""
    links = _links(parameters)
    state = _state(q, qd, links)
    torque, slider_force, *load = acting
    # M q'' + h = Q + J^T lam; gravity enters as an acceleration of every centre of mass
    applied = links.masses * (links.gravity - state.centripetal[:4])
    force = np.real(state.jacobian[:4].conj().T @ applied) + np.real(state.jacobian[_P].conj() * complex(*load))
    force[0] += torque if crank_acceleration is None else 0.0
    force[3] += slider_force + _slider_resistance(q[3], qd[3], parameters)
    loop, bias = _real(_loop(state.jacobian)), -_real(_loop(state.centripetal))
    if crank_acceleration is not None:
        loop = np.vstack([loop, [1.0, 0.0, 0.0, 0.0]])
        bias = np.append(bias, crank_acceleration)
    matrix = np.block([[_mass_matrix(state, links), loop.T], [loop, np.zeros((len(loop), len(loop)))]])
    return matrix, np.concatenate([force, bias])


def _refined_solve(matrix: Vector, rhs: Vector) -> tuple[Vector, float]:
    """Solve a symmetric system with iterative refinement; return the solution and its relative residual.

    Rows and columns are first scaled to similar size, since kg.m2, kg and m occur together in the matrix. The residuals are
    computed in extended precision, as in the thesis's subroutine.
    """
    scale: Vector = np.ones(len(rhs))
    for _ in range(3):
        scale /= np.sqrt(np.abs(matrix * np.outer(scale, scale)).max(axis=1))
    scale = np.asarray(np.ldexp(1.0, np.round(np.log2(scale)).astype(int)))  # powers of two: nothing is rounded
    a = matrix * np.outer(scale, scale)
    b = rhs * scale
    wide_a, wide_b = a.astype(np.longdouble), b.astype(np.longdouble)
    wide_x = np.linalg.solve(a, b).astype(np.longdouble)
    size = np.abs(a) @ np.abs(wide_x.astype(float)) + np.abs(b)
    size[size == 0.0] = 1.0
    wide_r = wide_b - wide_a @ wide_x
    for _ in range(MOST_REFINEMENTS):
        trial_x = wide_x + np.linalg.solve(a, wide_r.astype(float))
        trial_r = wide_b - wide_a @ trial_x
        if not np.abs(trial_r / size).max() < np.abs(wide_r / size).max():
            break
        wide_x, wide_r = trial_x, trial_r
    return wide_x.astype(float) * scale, float(np.abs(wide_r / size).max())


def _cross(a: complex, b: complex) -> float:
    """Return the moment of the force ``b`` with the lever arm ``a``."""
    return (a.conjugate() * b).imag


class _LinkForces(NamedTuple):
    """Forces at A, B, C, D (N), of the guide (N), crank torque (N.m) and total force on the slider along the guide (N)."""

    a: complex
    b: complex
    c: complex
    d: complex
    guide: float
    torque: float
    along: float


def _newton_euler(state: _State, accelerations: Vector, load: complex, links: _Links) -> _LinkForces:
    """Return all forces at known accelerations, from Newton's and Euler's laws of crank, coupler, rocker and slider.

    The 11 unknowns are the pin forces A, B, C, D, the guide's force, the crank torque and the force along the guide. There
    are three equations for each of crank, coupler and rocker about its own centre of mass, and two for the slider.
    """
    acceleration = state.jacobian[:4] @ accelerations + state.centripetal[:4]
    # right-hand sides: force and moment about the centre of mass that the unknown forces must supply on each link
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
    """Return accelerations, multipliers and pin forces at one instant, from the redundant form (3.1-3.10).

    ``q`` and ``qd`` are th2, th3, th4 (rad, absolute), u (m) and their rates, see `assemble` and `rates`; the inputs are the
    crank torque (N.m), the force on the slider (N) and the force at the coupler point P (N, N). With a prescribed
    ``crank_acceleration`` (rad/s2) its multiplier is the crank torque, and ``torque`` has no effect.
    """
    q, qd = np.asarray(q, dtype=float), np.asarray(qd, dtype=float)
    x, residual = _refined_solve(*_system(parameters, q, qd, (torque, slider_force, *load), crank_acceleration))
    accelerations, multipliers = x[:4], -x[4:]
    links = _links(parameters)
    newton = _newton_euler(_state(q, qd, links), accelerations, complex(*load), links)
    if crank_acceleration is not None:
        torque = float(multipliers[2])
    force_c = complex(multipliers[0], multipliers[1])
    along = slider_force + _slider_resistance(q[3], qd[3], parameters)
    largest = max(abs(newton.a), abs(newton.b), abs(force_c), abs(newton.d), abs(newton.guide), abs(along), 1e-300)
    mismatch = max(
        abs(newton.c - force_c), abs(newton.torque - torque) / parameters.crank_length, abs(newton.along - along)
    )
    pins = (part for force in (newton.a, newton.b, force_c, newton.d) for part in (force.real, force.imag))
    return MultiplierSolution(
        accelerations=accelerations,
        multipliers=multipliers,
        torque=float(torque),
        forces=dict(zip(FORCE_NAMES, (*pins, newton.guide))),
        closure=_closure(parameters, q, qd)[0],
        newton_mismatch=mismatch / largest,
        residual=residual,
    )


def _closure(parameters: FiveBarParameters, q: Vector, qd: Vector) -> tuple[float, float]:
    """Return the closure error (2.1) and its time derivative (m, m/s)."""
    state = _state(q, qd, _links(parameters))
    return float(abs(_loop(state.points))), float(abs(_loop(state.jacobian) @ qd))


def no_inputs(t: float, q: Vector, qd: Vector) -> tuple[float, float, float, float]:
    """Return inputs of zero: no torque, no control force, no load."""
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
) -> RedundantRun:
    """Integrate all four redundant accelerations, as the thesis recommends to do first, with a method of SciPy.

    Only the accelerations hold the loop closed: the closure error (2.1) that builds up measures the error of the equations
    and of the integration. With a prescribed ``speed`` its start replaces the initial crank speed, and the torque of
    ``inputs`` has no effect.
    """
    t = np.array(t_eval, dtype=float)
    q = assemble(parameters, initial.crank_angle, initial.slider_position)
    qd = rates(parameters, q, initial.crank_speed if speed is None else speed.initial, initial.slider_velocity)

    def derivative(t: float, y: Vector) -> Vector:
        q, qd = y[:4], y[4:]
        system = _system(parameters, q, qd, inputs(t, q, qd), None if speed is None else speed.acceleration(t))
        return np.concatenate([qd, _refined_solve(*system)[0][:4]])

    result = solve_ivp(
        derivative, (t[0], t[-1]), np.concatenate([q, qd]), method=method, t_eval=t, rtol=rtol, atol=atol
    )
    assert result.success, result.message
    q_run, qd_run = result.y[:4].T, result.y[4:].T
    closure = np.array([_closure(parameters, a, b) for a, b in zip(q_run, qd_run)])
    return RedundantRun(result.t, q_run, qd_run, closure[:, 0], closure[:, 1])
