"""Linear models of the plant about an operating point, an equilibrium or a periodic motion.

In the deviations q of (th2, u), or of u alone where the crank's motion is prescribed, and w of the inputs,

    M q'' + C q' + K q = F w

with the exact derivatives of the plant's own functions, traced with CasADi (`analysis.numerics.symbolic`). The residual that is
differentiated is m q'' + b - Q - (T, F2) of `linkwork.five_bar.dynamics`. Away from an equilibrium the accelerations are
not zero, and K holds the derivative of m times them. CasADi is an extra: ``pip install 'linkwork[symbolic]'``.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import isfinite, pi
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from linkwork.errors import InputError, LinkworkError, UnknownNameError
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.assembly import check_assembly
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.variables import INPUTS, OUTPUT_NAMES, OUTPUTS
from linkwork.limits import LIMIT_SINE

from ..mechanisms import require_five_bar
from ..numerics import symbolic
from ..run import Inputs, simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

#: Outputs that a linear model has not: three are integrals over the run, no functions of its state, and the closure
#: residual is zero everywhere, but for rounding.
WITHOUT = ("energy.dissipated", "energy.supplied", "energy.residual", "closure.residual")
#: Outputs of a linear model, in the order of the FMI contract.
LINEAR_OUTPUTS = tuple(name for name in OUTPUT_NAMES if name not in WITHOUT)
_ROWS = [OUTPUT_NAMES.index(name) for name in LINEAR_OUTPUTS]

COORDINATES: tuple[str, ...] = ("crank.angle", "slider.position")
RATES: tuple[str, ...] = ("crank.speed", "slider.velocity")
TORQUE_INPUTS = ("drive.torque", "slider.force", "load.fx", "load.fy")
#: In speed drive the crank's motion acts on the slider through its angle, speed and acceleration.
SPEED_INPUTS = ("slider.force", "load.fx", "load.fy", "drive.acceleration", "drive.speed", "crank.angle")

#: Unit of every input and output, by name.
UNITS: Mapping[str, str] = MappingProxyType({v.name: v.unit for v in (*INPUTS, *OUTPUTS)})

#: Starts of the search for equilibria: crank angles over a turn, slider positions over its reach.
GRID = (48, 81)
#: Largest imbalance of an equilibrium, relative to the forces that balance.
BALANCE = 1e-12
MOST_ITERATIONS = 60

#: Least samples of a period that carry its harmonics.
LEAST_SAMPLES = 16


class EquilibriumError(LinkworkError):
    """There is no equilibrium, or none was found from where the search began."""


class LinearModelError(LinkworkError):
    """A linear model is asked for what it cannot give."""


class Turn(Protocol):
    """One period of a motion at equal steps of the crank angle from 0, its end left out, such as `orbits.Turn`."""

    @property
    def time(self) -> FloatArray: ...

    @property
    def period(self) -> float: ...

    @property
    def states(self) -> FloatArray: ...

    @property
    def inputs(self) -> FloatArray: ...


@runtime_checkable
class Orbit(Protocol):
    """A periodic motion that can be sampled, such as `analysis.periodic.orbits.PeriodicOrbit`."""

    def turn(self, samples: int, /) -> Turn: ...


def signal_name(name: str) -> str:
    """Name of an FMI variable as a signal of python-control, which keeps the dot for itself: ``slider_position``."""
    return name.replace(".", "_")


@cache
def _statics() -> Any:
    """(th2, u), (load_x, load_y), constants -> generalised forces at rest (2,), and less their derivative (2, 2)."""
    casadi, plant = symbolic.library(), traced(FIVE_BAR)
    q, load = casadi.SX.sym("q", 2), casadi.SX.sym("load", 2)
    p, constants = constants(FIVE_BAR)
    g = plant.position(q[0], q[1], constants)
    k = plant.coefficients(g, constants)
    forces = casadi.vertcat(*plant.applied_forces(g, k, q[1], 0.0, load[0], load[1], constants))
    return casadi.Function(
        "statics", [q, load, p], [forces, casadi.densify(-casadi.jacobian(forces, q))], {"cse": True}
    )


@cache
def _derivatives() -> Any:
    """State (4,), inputs (6,), constants -> outputs and their derivatives, M, C, K and the inputs' forces."""
    casadi, plant = symbolic.library(), traced(FIVE_BAR)
    x, i, a = casadi.SX.sym("x", 4), casadi.SX.sym("i", 6), casadi.SX.sym("a", 2)
    p, constants = constants(FIVE_BAR)
    th2, u, w2, v = casadi.vertsplit(x)
    inputs = dynamics.Inputs(*casadi.vertsplit(i))
    g = plant.position(th2, u, constants)
    k = plant.coefficients(g, constants)
    w3, w4 = k.k32 * w2 + k.k3u * v, k.k42 * w2 + k.k4u * v
    m = plant.inertia(g, k, constants)
    b1, b2 = plant.velocity_terms(g, k, w2, w3, w4, *plant.centripetal(g, w2, w3, w4, constants), constants)
    q1, q2 = plant.applied_forces(g, k, u, v, inputs.load_x, inputs.load_y, constants)
    residual = casadi.vertcat(
        m.m11 * a[0] + m.m12 * a[1] + b1 - q1 - inputs.torque,
        m.m12 * a[0] + m.m22 * a[1] + b2 - q2 - inputs.force,
    )
    by_state = casadi.jacobian(residual, x)
    second_order = casadi.Function(
        "second_order",
        [x, a, i, p],
        [casadi.jacobian(residual, a), by_state[:, 2:], by_state[:, :2], -casadi.jacobian(residual, i)],
    )
    state = (th2, u, w2, v, 0.0, 0.0)
    rates = plant.derivative(state, inputs, constants)
    acceleration = casadi.vertcat(rates[2], rates[3])
    y = casadi.vertcat(*plant.outputs(state, inputs, 0.0, constants))[_ROWS]
    results = [y, casadi.jacobian(y, x), casadi.jacobian(y, i), *second_order(x, acceleration, i, p)]
    return casadi.Function("derivatives", [x, i, p], [casadi.densify(r) for r in results], {"cse": True})


@cache
def _mapped(samples: int) -> Any:
    return _derivatives().map(samples)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Equilibrium:
    """A configuration in which the plant stays at rest.

    Attributes
    ----------
    parameters : FiveBarParameters
    crank_angle, slider_position : float
        rad, m.
    inputs : dynamics.Inputs
        What acts on it; ``speed_drive`` is 1 where the crank is held.
    torque : float
        Torque on the crank (N.m): the one given, or that which holds it.
    stiffness : ndarray, shape (2, 2)
        Less the derivative of the generalised forces with respect to (th2, u).
    residual : float
        Largest imbalance, relative to the forces that balance.
    iterations : int
        Of Newton's method.
    """

    parameters: FiveBarParameters
    crank_angle: float
    slider_position: float
    inputs: dynamics.Inputs
    torque: float
    stiffness: FloatArray
    residual: float
    iterations: int

    @property
    def state(self) -> dynamics.State:
        """The state of the plant there."""
        return (self.crank_angle, self.slider_position, 0.0, 0.0, 0.0, 0.0)

    @property
    def stable(self) -> bool:
        """Whether it is a minimum of the potential energy of springs, gravity and constant forces in the free freedoms."""
        scale = np.array([1.0, self.parameters.crank_length])
        first = int(self.inputs.speed_drive)
        free = (scale[:, None] * self.stiffness * scale)[first:, first:]
        values = np.linalg.eigvalsh(free)
        return bool(values[0] > 1e-9 * np.abs(values).max())

    @property
    def potential(self) -> float:
        """Potential energy of springs, gravity and the constant forces (J); the torque's part counts from th2 = 0."""
        p = self.parameters.constants()
        g = kinematics.position(self.crank_angle, self.slider_position, p)
        x, y = kinematics.coupler_point(g, p)
        i = self.inputs
        work = i.torque * self.crank_angle + i.force * self.slider_position + i.load_x * x + i.load_y * y
        return dynamics.potential_energy(g, self.slider_position, p) - work


@dataclass(frozen=True, slots=True)
class _Balance:
    """The equations of rest: forces over the freedoms that are free, made comparable by the crank's length."""

    parameters: FiveBarParameters
    inputs: dynamics.Inputs

    @property
    def free(self) -> slice:
        return slice(int(self.inputs.speed_drive), 2)

    @property
    def scale(self) -> FloatArray:
        return np.array([1.0, self.parameters.crank_length])[self.free]

    def size(self, u: float) -> float:
        """Magnitude of the generalised forces that have to balance (N.m)."""
        p, i = self.parameters, self.inputs
        moved = p.crank_mass + p.coupler_mass + p.rocker_mass + p.slider_mass
        forces = (
            p.slider_stiffness * (abs(u) + abs(p.slider_spring_free_position) + p.crank_length),
            moved * p.gravity,
            abs(i.force),
            abs(i.load_x),
            abs(i.load_y),
        )
        return p.crank_length * sum(forces) + abs(i.torque)

    def forces(self, th2: float, u: float) -> tuple[float, float]:
        """Generalised forces (N.m, N) at rest, torque and slider force included.

        Raises
        ------
        ValueError, ZeroDivisionError
            If the links cannot be joined there.
        """
        p, i = self.parameters.constants(), self.inputs
        g = kinematics.position(th2, u, p)
        q1, q2 = dynamics.applied_forces(g, kinematics.coefficients(g, p), u, 0.0, i.load_x, i.load_y, p)
        return q1 + i.torque, q2 + i.force

    def imbalance(self, th2: float, u: float) -> float:
        """Norm of the forces over the freedoms that are free (N.m); infinite where the links cannot be joined."""
        p = self.parameters.constants()
        if kinematics.assembly_square(th2, u, p) < (LIMIT_SINE * p.l3 * p.l4) ** 2:
            return float("inf")
        return float(np.linalg.norm(self.scale * np.array(self.forces(th2, u))[self.free]))

    def solve(self, th2: float, u: float) -> Equilibrium:
        """Newton's method with halved steps where the imbalance would grow.

        Raises
        ------
        EquilibriumError
            If it does not converge.
        """
        p, i = self.parameters.constants(), self.inputs
        q = np.array([th2, u])
        before = self.imbalance(*q)
        for iteration in range(MOST_ITERATIONS):
            _, slope = _statics()(q, [i.load_x, i.load_y], list(p))
            stiffness = np.asarray(slope)
            if before <= BALANCE * self.size(q[1]):
                force = self.forces(*q)[0] - i.torque
                torque = -force if i.speed_drive else i.torque
                residual = float(before / self.size(q[1]))
                return Equilibrium(
                    parameters=self.parameters, crank_angle=float(q[0]), slider_position=float(q[1]), inputs=i,
                    torque=float(torque), stiffness=stiffness, residual=residual, iterations=iteration,
                )  # fmt: skip
            scaled = self.scale[:, None] * stiffness[self.free, self.free] * self.scale
            right = self.scale * np.array(self.forces(*q))[self.free]
            # where the equilibrium is neutral the shortest of the steps that reach it is taken
            step = self.scale * np.linalg.lstsq(scaled, right, rcond=1e-10)[0]
            for halving in range(40):
                trial = q.copy()
                trial[self.free] += 0.5**halving * step
                after = self.imbalance(*trial)
                if after < before:
                    break
            else:
                break
            q, before = trial, after
        raise EquilibriumError(
            f"no equilibrium found from crank angle {th2:.9g} rad and slider position {u:.9g} m: an imbalance of "
            f"{before:.3g} N.m is left at crank angle {q[0]:.9g} rad and slider position {q[1]:.9g} m"
        )

    def starts(self, crank_angle: float | None) -> list[tuple[float, float]]:
        """Points of a grid over all configurations where the imbalance is less than at their neighbours."""
        p = self.parameters.constants()
        reach = p.l1 + p.l2 + p.l3 + p.l4
        angles = 2.0 * pi * np.arange(GRID[0]) / GRID[0] if crank_angle is None else np.array([crank_angle])
        positions = np.linspace(-reach, reach, GRID[1])
        values = np.array([[self.imbalance(th2, u) for u in positions] for th2 in angles])
        least = values.copy()
        for along in (-1, 0, 1):
            turned = np.roll(values, along, axis=0)
            padded = np.pad(turned, ((0, 0), (1, 1)), constant_values=np.inf)
            for across in (0, 1, 2):
                least = np.minimum(least, padded[:, across : across + len(positions)])
        rows, columns = np.nonzero(np.isfinite(values) & (values <= least))
        return [(float(angles[r]), float(positions[c])) for r, c in zip(rows, columns)]


def _static_inputs(
    crank_torque: float, slider_force: float, load: tuple[float, float], crank_angle: float | None
) -> dynamics.Inputs:
    named = {"crank torque": crank_torque, "slider force": slider_force, "load.fx": load[0], "load.fy": load[1]}
    for name, value in named.items():
        if not isfinite(value):
            raise InputError(f"{name} is {value}: it must be a finite number")
    if crank_angle is not None and not isfinite(crank_angle):
        raise InputError(f"crank angle is {crank_angle} rad: it must be a finite number")
    if crank_angle is not None and crank_torque != 0.0:
        raise InputError(f"crank torque is {crank_torque} N.m, but the crank is held: the torque is a result then")
    return dynamics.Inputs(float(crank_angle is not None), crank_torque, 0.0, slider_force, *load)


def find_equilibria(
    parameters: FiveBarParameters,
    *,
    crank_torque: float = 0.0,
    slider_force: float = 0.0,
    load: tuple[float, float] = (0.0, 0.0),
    crank_angle: float | None = None,
) -> tuple[Equilibrium, ...]:
    """All equilibria that a search from a grid over the configurations finds, the one of least potential energy first.

    Parameters
    ----------
    parameters : FiveBarParameters
    crank_torque, slider_force : float
        N.m, N.
    load : (float, float)
        On the coupler point P (N).
    crank_angle : float, optional
        Angle at which the crank is held (rad); by default it is free.

    Returns
    -------
    tuple of Equilibrium
        Crank angles of a free crank in (-pi, pi]. Where the equilibria are not isolated, some of them.

    Raises
    ------
    InputError
        If a force is not finite, or a torque is given for a crank that is held.
    """
    require_five_bar(parameters, "an equilibrium")
    inputs = _static_inputs(crank_torque, slider_force, load, crank_angle)
    balance = _Balance(parameters, inputs)
    found: list[Equilibrium] = []
    for start in balance.starts(crank_angle):
        try:
            one = balance.solve(*start)
        except EquilibriumError:
            continue
        if crank_angle is None:
            th2 = pi - (pi - one.crank_angle) % (2.0 * pi)
            one = balance.solve(th2, one.slider_position)
        gaps = (
            abs(one.crank_angle - other.crank_angle)
            + abs(one.slider_position - other.slider_position) / parameters.crank_length
            for other in found
        )
        if min(gaps, default=1.0) > 1e-6:
            found.append(one)
    return tuple(sorted(found, key=lambda one: one.potential))


def find_equilibrium(
    parameters: FiveBarParameters,
    *,
    crank_torque: float = 0.0,
    slider_force: float = 0.0,
    load: tuple[float, float] = (0.0, 0.0),
    crank_angle: float | None = None,
    guess: tuple[float, float] | None = None,
) -> Equilibrium:
    """An equilibrium of the plant at rest: hanging freely, or with the crank held.

    Parameters
    ----------
    parameters, crank_torque, slider_force, load, crank_angle
        As for `find_equilibria`.
    guess : (float, float), optional
        Crank angle (rad) and slider position (m) from where to search; of a crank that is held the angle is not used. By
        default the stable equilibrium of least potential energy is taken, or, where there is none, the lowest of all.

    Raises
    ------
    InputError
        If a force is not finite, or a torque is given for a crank that is held.
    AssemblyError
        If the links cannot be joined at the guess.
    EquilibriumError
        If there is no equilibrium, or none is found from the guess; says what is left, and where.
    """
    require_five_bar(parameters, "an equilibrium")
    inputs = _static_inputs(crank_torque, slider_force, load, crank_angle)
    if guess is not None:
        th2 = float(guess[0]) if crank_angle is None else crank_angle
        check_assembly(parameters, th2, float(guess[1]))
        return _Balance(parameters, inputs).solve(th2, float(guess[1]))
    found = find_equilibria(
        parameters, crank_torque=crank_torque, slider_force=slider_force, load=load, crank_angle=crank_angle
    )
    if not found:
        held = "" if crank_angle is None else f" with the crank held at {crank_angle:.9g} rad"
        raise EquilibriumError(
            f"there is no equilibrium{held} under the crank torque {crank_torque:g} N.m, the slider force "
            f"{slider_force:g} N and the load ({load[0]:g}, {load[1]:g}) N, as far as a grid of {GRID[0]} crank angles "
            f"and {GRID[1]} slider positions shows"
        )
    return next((one for one in found if one.stable), found[0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearModel:
    """The plant about one state, or the mean of that along a periodic motion.

    n is 2 in torque drive, with q = (crank angle, slider position), and 1 in speed drive, with q = (slider position);
    m is the number of inputs; l that of `LINEAR_OUTPUTS`. All are deviations from the operating point, in SI.

    Attributes
    ----------
    parameters : FiveBarParameters
    state : ndarray, shape (6,)
        Operating point (th2, u, w2, v, dissipated, supplied); of a mean model the mean over the period.
    inputs : dynamics.Inputs
        In force there.
    M, C, K : ndarray, shape (n, n)
        Inertia, damping and stiffness.
    F : ndarray, shape (n, m)
        Generalised forces of unit inputs.
    H : ndarray, shape (l, 2 n)
        Derivatives of the outputs with respect to (q, q').
    D : ndarray, shape (l, m)
        Derivatives of the outputs with respect to the inputs.
    outputs : ndarray, shape (l,)
        The outputs at the operating point.
    acceleration : ndarray, shape (2,)
        th2'' and u'' there.
    """

    parameters: FiveBarParameters
    state: FloatArray
    inputs: dynamics.Inputs
    M: FloatArray
    C: FloatArray
    K: FloatArray
    F: FloatArray
    H: FloatArray
    D: FloatArray
    outputs: FloatArray
    acceleration: FloatArray

    @property
    def speed_drive(self) -> bool:
        """Whether the crank's motion is prescribed."""
        return self.inputs.speed_drive == 1.0

    @property
    def input_names(self) -> tuple[str, ...]:
        """FMI names of the inputs. In speed drive ``crank.angle`` is one of them: what the crank does, in three parts."""
        return SPEED_INPUTS if self.speed_drive else TORQUE_INPUTS

    @property
    def state_names(self) -> tuple[str, ...]:
        """FMI names of the first-order state (q, q')."""
        free = slice(int(self.speed_drive), 2)
        return COORDINATES[free] + RATES[free]

    @property
    def A(self) -> FloatArray:
        """State matrix of (q, q')' = A (q, q') + B w, shape (2 n, 2 n)."""
        return _first_order(self.M, self.C, self.K)

    @property
    def B(self) -> FloatArray:
        """Input matrix, shape (2 n, m)."""
        return np.vstack([np.zeros_like(self.F), np.linalg.solve(self.M, self.F)])

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A (1/s), by magnitude."""
        values = np.linalg.eigvals(self.A).astype(complex)
        return values[np.lexsort((values.imag, np.abs(values)))]

    @property
    def natural_frequencies(self) -> FloatArray:
        """Undamped natural frequencies (rad/s): square roots of the positive eigenvalues of M^-1 K, rising."""
        squares = np.linalg.eigvals(np.linalg.solve(self.M, self.K))
        return np.sort(np.sqrt(squares.real[(squares.real > 0.0) & (squares.imag == 0.0)]))

    def to_state_space(
        self, outputs: Sequence[str] = ("slider.position",), inputs: Sequence[str] | None = None
    ) -> control.StateSpace:
        """The model for python-control.

        Parameters
        ----------
        outputs, inputs : sequence of str
            FMI names; by default all inputs of the drive.

        Returns
        -------
        control.StateSpace
            Its signals carry the FMI names with underscores for dots (`signal_name`), as python-control wants them.

        Raises
        ------
        UnknownNameError
            If there is no such input or output.
        LinearModelError
            If an output is one that a linear model has not (`WITHOUT`).
        """
        chosen = self.input_names if inputs is None else inputs
        rows = [_index(name, LINEAR_OUTPUTS) for name in outputs]
        columns = [_index(name, self.input_names) for name in chosen]
        return control.ss(
            self.A,
            self.B[:, columns],
            self.H[rows],
            self.D[np.ix_(rows, columns)],
            inputs=[signal_name(name) for name in chosen],
            outputs=[signal_name(name) for name in outputs],
            states=[signal_name(name) for name in self.state_names],
        )

    def plot_bode(self, output: str = "slider.position", input: str = "slider.force", **options: Any) -> Figure:
        """Magnitude and phase from one input to one output; see `analysis.figures.plot_bode`."""
        from .. import figures

        system = self.to_state_space((output,), (input,))
        return figures.plot_bode(
            {"": system},
            unit=f"{UNITS[output]}/{UNITS[input]}" if "." not in UNITS[input] else f"{UNITS[output]}/({UNITS[input]})",
            **options,
        )

    def plot_poles(self, output: str = "slider.position", input: str = "slider.force", **options: Any) -> Figure:
        """Poles and zeros from one input to one output; see `analysis.figures.plot_poles`."""
        from .. import figures

        return figures.plot_poles({"": self.to_state_space((output,), (input,))}, **options)


def _index(name: str, known: tuple[str, ...]) -> int:
    if name in WITHOUT:
        raise LinearModelError(
            f"a linear model has no output {name}: it is "
            + (
                "zero everywhere"
                if name == "closure.residual"
                else "an integral over the run, no function of the state"
            )
        )
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        raise UnknownNameError(name, known, near[0] if near else None)
    return known.index(name)


def _first_order(m: FloatArray, c: FloatArray, k: FloatArray) -> FloatArray:
    """A of one model or of a stack of them, shape (..., 2 n, 2 n)."""
    n = m.shape[-1]
    a = np.zeros((*m.shape[:-2], 2 * n, 2 * n))
    a[..., :n, n:] = np.eye(n)
    a[..., n:, :n] = -np.linalg.solve(m, k)
    a[..., n:, n:] = -np.linalg.solve(m, c)
    return a


def _evaluate(
    parameters: FiveBarParameters, states: FloatArray, inputs: Sequence[dynamics.Inputs]
) -> dict[str, FloatArray]:
    """The arrays of `LinearModel` at n states, stacked along the first axis."""
    n = len(states)
    for row, (th2, u) in enumerate(states[:, :2]):
        if not np.all(np.isfinite(states[row])):
            raise InputError(f"the state {states[row]} is not finite")
        check_assembly(parameters, float(th2), float(u))
    i = np.array(inputs, dtype=float)
    if not np.all(np.isfinite(i)):
        raise InputError(f"the inputs {i[~np.isfinite(i).all(axis=1)][0]} are not finite")
    p = np.array(parameters.constants())
    raw = _mapped(n)(states[:, :4].T, i.T, np.tile(p[:, None], n))

    def stack(value: Any) -> FloatArray:
        array = np.asarray(value)
        return np.moveaxis(array.reshape(array.shape[0], n, -1), 1, 0)

    y, h, d, m, c, k, f = map(stack, raw)
    rows = [LINEAR_OUTPUTS.index(name) for name in ("crank.acceleration", "slider.acceleration")]
    # columns of the inputs: speed_drive, torque, acceleration, force, load_x, load_y
    if i[0, 0] == 0.0:
        forces, feedthrough, free, seen = f[:, :, [1, 3, 4, 5]], d[:, :, [1, 3, 4, 5]], slice(0, 2), [0, 1, 2, 3]
    else:
        crank = -np.concatenate([m[:, 1:, :1], c[:, 1:, :1], k[:, 1:, :1]], axis=2)
        forces, free, seen = np.concatenate([f[:, 1:, [3, 4, 5]], crank], axis=2), slice(1, 2), [1, 3]
        feedthrough = np.concatenate([d[:, :, [3, 4, 5, 2]], h[:, :, [2, 0]]], axis=2)
    return {
        "M": m[:, free, free],
        "C": c[:, free, free],
        "K": k[:, free, free],
        "F": forces,
        "H": h[:, :, seen],
        "D": feedthrough,
        "outputs": y[:, :, 0],
        "acceleration": y[:, rows, 0],
    }


def _six(states: ArrayLike) -> FloatArray:
    """States of shape (n, 4) or (n, 6) as (n, 6)."""
    array = np.array(states, dtype=float)
    if array.ndim != 2 or array.shape[1] not in (4, 6) or len(array) == 0:
        raise InputError(f"states of shape {array.shape}: each must be (th2, u, th2', u') or the plant's six-tuple")
    return np.hstack([array, np.zeros((len(array), 6 - array.shape[1]))])


def _checked(inputs: dynamics.Inputs) -> dynamics.Inputs:
    if inputs.speed_drive not in (0.0, 1.0):
        raise InputError(f"speed_drive is {inputs.speed_drive}: it must be 0 (torque drive) or 1 (speed drive)")
    return inputs


AT_REST = dynamics.Inputs(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def linearise(parameters: FiveBarParameters, state: ArrayLike, inputs: dynamics.Inputs = AT_REST) -> LinearModel:
    """The linear model at a state of the plant.

    Parameters
    ----------
    parameters : FiveBarParameters
    state : array_like, shape (4,) or (6,)
        (th2, u, th2', u'), such as `Equilibrium.state`. It need be no equilibrium: the deviations are then those from
        the motion through it, and the model holds at that instant.
    inputs : dynamics.Inputs
        In force there, such as `Equilibrium.inputs`; their ``speed_drive`` chooses the freedoms.

    Raises
    ------
    InputError
        If state or inputs are not finite or of the wrong shape.
    AssemblyError
        If the links cannot be joined there.
    symbolic.MissingLibraryError
        If CasADi is not installed.
    """
    require_five_bar(parameters, "a linear model")
    states = _six(np.atleast_2d(np.asarray(state, dtype=float)))
    if len(states) != 1:
        raise InputError(f"{len(states)} states: one is linearised about here, many by linearise_along")
    arrays = _evaluate(parameters, states, [_checked(inputs)])
    return LinearModel(
        parameters=parameters, state=states[0], inputs=inputs, **{name: a[0] for name, a in arrays.items()}
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeriodicModel:
    """The plant about a periodic motion: linear models at evenly spaced times of a period.

    Attributes
    ----------
    parameters : FiveBarParameters
    period : float
        s.
    states : ndarray, shape (s, 6)
        The motion at the times k period / s, k = 0 ... s - 1.
    inputs : tuple of dynamics.Inputs
        In force there.
    M, C, K, F, H, D, outputs, acceleration : ndarray
        Those of `LinearModel`, stacked along the first axis.

    Notes
    -----
    ``model[k]`` is the `LinearModel` at one of the times.
    """

    parameters: FiveBarParameters
    period: float
    states: FloatArray
    inputs: tuple[dynamics.Inputs, ...]
    M: FloatArray
    C: FloatArray
    K: FloatArray
    F: FloatArray
    H: FloatArray
    D: FloatArray
    outputs: FloatArray
    acceleration: FloatArray

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, index: int) -> LinearModel:
        return self._model(lambda values: values[index], self.inputs[index])

    def _model(self, reduce: Callable[[FloatArray], FloatArray], inputs: dynamics.Inputs) -> LinearModel:
        return LinearModel(
            parameters=self.parameters,
            inputs=inputs,
            state=reduce(self.states),
            M=reduce(self.M),
            C=reduce(self.C),
            K=reduce(self.K),
            F=reduce(self.F),
            H=reduce(self.H),
            D=reduce(self.D),
            outputs=reduce(self.outputs),
            acceleration=reduce(self.acceleration),
        )

    @property
    def times(self) -> FloatArray:
        """Times of the samples, shape (s,), from 0 (s)."""
        return self.period * np.arange(len(self)) / len(self)

    @property
    def A(self) -> FloatArray:
        """State matrices, shape (s, 2 n, 2 n)."""
        return _first_order(self.M, self.C, self.K)

    @property
    def B(self) -> FloatArray:
        """Input matrices, shape (s, 2 n, m)."""
        return np.concatenate([np.zeros_like(self.F), np.linalg.solve(self.M, self.F)], axis=1)

    def mean(self) -> LinearModel:
        """The time-averaged model: M, C, K, F, H and D are each the mean over the period.

        It foretells slow deviations of a motion whose M and K vary little; `monodromy` says what the motion does in truth.
        """
        average = dynamics.Inputs(*np.mean(np.array(self.inputs), axis=0).tolist())
        return self._model(lambda values: np.asarray(values.mean(axis=0)), average)

    def interpolated(self, values: FloatArray) -> Callable[[float], FloatArray]:
        """The trigonometric polynomial through values at the samples, shape (s, ...), as a function of time."""
        return trigonometric(values, self.period)

    def motion(self) -> Callable[[float], FloatArray]:
        """The motion itself as a function of time: (th2, u, th2', u')."""
        states = self.states[:, :4].copy()
        rate = 2.0 * pi * round(float(states[:, 2].mean()) * self.period / (2.0 * pi)) / self.period
        states[:, 0] -= rate * self.times
        periodic = self.interpolated(states)
        return lambda t: periodic(t) + np.array([rate * t, 0.0, 0.0, 0.0])

    def monodromy(self, tolerance: float = 1e-10) -> FloatArray:
        """What a period makes of the deviations (q, q'), shape (2 n, 2 n): Phi' = A(t) Phi from the unit matrix.

        A(t) is the trigonometric polynomial through its samples, integrated with SciPy. The eigenvalues are Floquet's
        multipliers; in torque drive one of them is 1 along a motion of the free plant.

        Raises
        ------
        LinearModelError
            If SciPy's method fails.
        """
        a = self.interpolated(self.A)
        size = self.A.shape[-1]
        result = solve_ivp(
            lambda t, y: (a(t) @ y.reshape(size, size)).ravel(),
            (0.0, self.period),
            np.eye(size).ravel(),
            method="DOP853",
            rtol=tolerance,
            atol=tolerance,
        )
        if not result.success:
            raise LinearModelError(f"the monodromy matrix could not be integrated: {result.message}")
        matrix: FloatArray = result.y[:, -1].reshape(size, size)
        return matrix


def linearise_along(
    parameters: FiveBarParameters,
    motion: ArrayLike | Orbit,
    inputs: dynamics.Inputs | Sequence[dynamics.Inputs] | None = None,
    *,
    period: float | None = None,
    samples: int = 128,
) -> PeriodicModel:
    """Linear models along a periodic motion.

    Parameters
    ----------
    parameters : FiveBarParameters
    motion : array_like, shape (s, 4) or (s, 6), or an orbit
        States at evenly spaced times of one period, the end of it left out; or an object such as
        `analysis.periodic.orbits.PeriodicOrbit`.
    inputs : dynamics.Inputs or sequence of s of them
        In force along the motion of an array; by default nothing acts, in torque drive. A torque or force that follows
        the state by a law of its own, a motor's or a controller's, enters with its value: the slope of the law is none of
        the plant's.
    period : float, optional
        s. By default that of the orbit, and of an array at a constant prescribed speed one turn of the crank.
    samples : int
        Samples of an orbit; of an array there are as many as it has.

    Raises
    ------
    InputError
        If inputs or period are given for an orbit; if the samples are fewer than `LEAST_SAMPLES`, not finite, or not those
        of a periodic motion evenly spaced in time.
    AssemblyError
        If the links cannot be joined at one of them.
    """
    if isinstance(motion, Orbit):
        if inputs is not None or period is not None:
            raise InputError("inputs and period are those of the orbit: they cannot be given besides")
        states, inputs, period = _in_time(motion.turn(samples))
    else:
        states = _six(motion)
    n = len(states)
    if n < LEAST_SAMPLES:
        raise InputError(f"{n} samples of a period: at least {LEAST_SAMPLES} are needed")
    each = (inputs,) * n if isinstance(inputs, dynamics.Inputs) else (AT_REST,) * n if inputs is None else tuple(inputs)
    if len(each) != n or len({_checked(i).speed_drive for i in each}) != 1:
        raise InputError(f"{len(each)} inputs along {n} states: there must be one for each, all of one drive")
    speed = float(states[0, 2])
    if period is None:
        if each[0].speed_drive == 0.0 or np.ptp(states[:, 2]) > 1e-9 * abs(speed) or speed == 0.0:
            raise InputError(
                "the period must be given: it follows from the states at a constant prescribed speed alone"
            )
        period = 2.0 * pi / abs(speed)
    if not (isfinite(period) and period > 0.0):
        raise InputError(f"period is {period} s: it must be a finite number greater than zero")
    model = PeriodicModel(
        parameters=parameters, period=period, states=states, inputs=each, **_evaluate(parameters, states, each)
    )
    _check_periodic(model)
    return model


def _in_time(turn: Turn) -> tuple[FloatArray, tuple[dynamics.Inputs, ...], float]:
    """States and inputs of a turn at equal steps of time instead of the crank angle, and its period."""
    n, period = len(turn.time), turn.period
    angle = turn.states[:, 0] - turn.states[0, 0]
    way = angle[-1] * n / (n - 1)
    wanted = period * np.arange(n) / n
    lead = trigonometric(turn.time - wanted, way)
    columns = np.hstack([turn.states[:, 1:4], turn.inputs])
    values = trigonometric(columns, way)
    states, inputs = np.empty((n, 6)), []
    for k, t in enumerate(wanted):
        x = angle[k]
        for _ in range(MOST_ITERATIONS):
            # dt/d(th2) = 1 / th2'
            step = (period * x / way + float(lead(x)) - t) * float(values(x)[1])
            x -= step
            if abs(step) <= 1e-13 * way:
                break
        here = values(x)
        states[k] = turn.states[0, 0] + x, here[0], here[1], here[2], 0.0, 0.0
        inputs.append(dynamics.Inputs(float(turn.inputs[0, 0]), *here[4:].tolist()))
    return states, tuple(inputs), period


def trigonometric(values: FloatArray, period: float) -> Callable[[float], FloatArray]:
    """The trigonometric polynomial through values at n equal steps of a period, shape (n, ...), as a function."""
    n = len(values)
    order = (n - 1) // 2
    c = np.fft.rfft(values, axis=0)[: order + 1] / n
    c[1:] *= 2.0
    turn = 2j * pi / period * np.arange(order + 1)
    return lambda t: np.asarray(np.tensordot(np.exp(turn * t), c, axes=1).real)


def _check_periodic(model: PeriodicModel) -> None:
    """Make sure that the slider's velocity is the derivative of its position along the samples taken as periodic.

    Of a wrong period, an end sampled twice or an unsettled motion it is not.
    """
    u, v = model.states[:, 1], model.states[:, 3]
    n = len(u)
    c = np.fft.rfft(u) * 2j * pi / model.period * np.arange(n // 2 + 1)
    if n % 2 == 0:
        c[-1] = 0.0
    gap = float(np.abs(np.fft.irfft(c, n) - v).max())
    if gap > 1e-2 * float(np.abs(v).max()) + 1e-9 * model.parameters.crank_length / model.period:
        raise InputError(
            f"the {n} states are not evenly spaced over one period of {model.period:.9g} s, its end left out: the slider's "
            f"velocity differs from the derivative of its position by {gap:.3g} m/s"
        )


def settled_motion(
    parameters: FiveBarParameters, crank_speed: float, *, samples: int = 128, turns: int = 200, force: float = 0.0
) -> FloatArray:
    """The motion that the slider settles to at a constant crank speed, by running on until it repeats itself.

    Parameters
    ----------
    parameters : FiveBarParameters
    crank_speed : float
        rad/s, not zero.
    samples : int
        States of the last turn, evenly spaced from th2 = 0, its end left out.
    turns : int
        Turns of the crank from rest of the slider.
    force : float
        Constant slider force (N).

    Returns
    -------
    ndarray, shape (samples, 6)

    Raises
    ------
    LinearModelError
        If the run ends early, or the last two turns differ by more than 1e-7 of the crank's length.
    """
    if not (isfinite(crank_speed) and crank_speed != 0.0):
        raise InputError(f"crank speed is {crank_speed} rad/s: it must be finite and not zero")
    turn = 2.0 * pi / abs(crank_speed)
    last = turn * (turns - 2 + np.arange(2 * samples + 1) / samples)
    run = simulate(
        parameters,
        Inputs(speed=crank_speed, force=force),
        stop_time=float(last[-1]),
        samples=np.concatenate([[0.0], last]),
        tolerance=1e-12,
    )
    if run.status:
        raise LinearModelError(f"there is no steady motion at {crank_speed:g} rad/s: {run.message}")
    names = (*COORDINATES, *RATES, "energy.dissipated", "energy.supplied")
    before, after = np.split(np.column_stack([run[name] for name in names])[1:-1], 2)
    gap = float(np.abs(after[:, 1] - before[:, 1]).max())
    if gap > 1e-7 * parameters.crank_length:
        raise LinearModelError(
            f"the motion at {crank_speed:g} rad/s has not settled after {turns} turns: the slider is still {gap:.3g} m "
            "from where it was a turn before"
        )
    after[:, 0] -= 2.0 * pi * np.copysign(turns - 1, crank_speed)
    return after
