"""Operating points at rest: equilibria of the plant, hanging freely or with the crank held.

They are found by Newton's method on the generalised forces at rest, whose exact derivatives CasADi traces from the plant's own
functions (`analysis.numerics.symbolic`). CasADi is an extra: ``pip install 'linkwork[symbolic]'``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import isfinite, pi
from typing import Any

import numpy as np

from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.assembly import check_assembly
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.limits import LIMIT_SINE

from ..mechanisms import FIVE_BAR, require_five_bar
from ..numerics import symbolic
from ..run import constants, traced
from .model import FloatArray

#: Starts of the search for equilibria: crank angles over a turn, slider positions over its reach.
GRID = (48, 81)
#: Largest imbalance of an equilibrium, relative to the forces that balance.
BALANCE = 1e-12
MOST_ITERATIONS = 60


class EquilibriumError(LinkworkError):
    """There is no equilibrium, or none was found from where the search began."""


@cache
def _statics() -> Any:
    """(th2, u), (load_x, load_y), constants -> generalised forces at rest (2,), and less their derivative (2, 2)."""
    casadi, plant = symbolic.library(), traced(FIVE_BAR)
    q, load = casadi.SX.sym("q", 2), casadi.SX.sym("load", 2)
    p, c = constants(FIVE_BAR)
    g = plant.position(q[0], q[1], c)
    k = plant.coefficients(g, c)
    forces = casadi.vertcat(*plant.applied_forces(g, k, q[1], 0.0, load[0], load[1], c))
    return casadi.Function(
        "statics", [q, load, p], [forces, casadi.densify(-casadi.jacobian(forces, q))], {"cse": True}
    )


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
