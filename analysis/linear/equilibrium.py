"""Find equilibria of a mechanism, with no degree of freedom held in place, or with some of them held.

Newton's method makes the generalised forces at rest, M a, zero, with exact derivatives by CasADi (`analysis.run.expressions`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from math import isfinite, tau
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import InputError, LinkworkError
from linkwork.limits import LIMIT_SINE
from linkwork.mechanism import Mechanism
from linkwork.parameters import fmi_name

from ..files import unknown_name
from ..mechanisms import InitialState, Parameters, find_mechanism, variable_units
from ..numerics import symbolic
from ..run import Inputs, check_run, expressions, float_array, takes_published
from ..units import Amount, in_si
from . import model
from .model import FloatArray, Modes, layout, sample_channels

#: Grid points of the search for equilibria: over a turn of a cyclic freedom, and over the reach of any other freedom. The reach
#: of an angle that a spring winds up is a turn to either side. With four free coordinates the grid is coarser.
GRID = (48, 81)
MOST_POINTS = 600_000
#: Largest imbalance of an equilibrium, relative to the forces that balance each other.
BALANCE = 1e-12
MOST_ITERATIONS = 60


class EquilibriumError(LinkworkError):
    """No equilibrium was found."""


@cache
def _statics(mechanism: Mechanism, modes: Modes) -> tuple[Any, Any]:
    """Return two CasADi functions of coordinates, channels and constants: statics alone, and statics with derivatives.

    Both functions first return the generalised forces at rest on the free degrees of freedom. The first function also returns
    the clearance from the limit of assembly. The second function also returns the negative derivatives of these forces with
    respect to the free coordinates, and their derivatives with respect to the forces of the channels. Friction, which a
    mechanism's switch turns on, does not act at rest.
    """
    casadi, traces, its = symbolic.library(), expressions(mechanism), layout(mechanism, modes)
    x, mode_symbols, u, p = traces.symbols
    n, free = len(mechanism.freedoms), list(its.free)
    q = casadi.SX.sym("q", n)

    def at_rest(expression: Any) -> Any:
        still = casadi.vertcat(q, casadi.SX.zeros(mechanism.size - n))
        values = casadi.DM(list(map(float, modes)))
        return casadi.substitute(casadi.substitute(expression, mode_symbols, values), x, still)

    inertia = casadi.hessian(traces.energy, x[n : 2 * n])[0][free, free]
    forces = casadi.mtimes(at_rest(inertia), at_rest(traces.derivative[n : 2 * n][free]))
    derivatives = [-casadi.jacobian(forces, q)[:, free], casadi.jacobian(forces, u)[:, list(its.forces)]]

    def function(*results: Any) -> Any:
        return casadi.Function("statics", [q, u, p], [casadi.densify(r) for r in results], {"cse": True})

    return function(forces, at_rest(traces.clearance)), function(forces, *derivatives)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Equilibrium:
    """A configuration in which a mechanism stays at rest.

    Attributes
    ----------
    parameters
        Parameters of the mechanism.
    coordinates : ndarray
        Coordinates of all degrees of freedom (rad, m).
    inputs : Inputs
        Acting inputs; a held degree of freedom has the commanded rate 0.
    holding : dict
        Generalised force (N.m or N) that keeps each held degree of freedom in place, by the name of its coordinate.
    stiffness : ndarray
        Negative derivatives of the generalised forces on the free and the held degrees of freedom, with respect to the
        coordinates of these degrees of freedom.
    residual : float
        Norm of the imbalance, relative to the forces that balance each other.
    iterations : int
        Iterations of Newton's method.

    Notes
    -----
    ``rest["slider.position"]`` is an output of the mechanism in this configuration.
    """

    parameters: Parameters
    coordinates: FloatArray
    inputs: Inputs
    holding: dict[str, float]
    stiffness: FloatArray
    residual: float
    iterations: int

    def __repr__(self) -> str:
        return f"<Equilibrium: {find_mechanism(self.parameters).describe_state(self.coordinates.tolist())}>"

    def __getitem__(self, name: str) -> float:
        mechanism, p = find_mechanism(self.parameters), self.parameters.constants()
        if name not in mechanism.output_names:
            raise unknown_name(name, mechanism.output_names, f"output {name!r}")
        modes, channels = sample_channels(mechanism, self.inputs, np.zeros(1), np.array([self.state]))
        applied = mechanism.equations.apply_inputs(tuple(map(float, modes)), tuple(channels[0].tolist()), p)
        outputs = mechanism.equations.outputs(self.state, applied, 0.0, p)
        return float(outputs[mechanism.output_names.index(name)])

    @property
    def state(self) -> tuple[float, ...]:
        """State of the plant in this configuration."""
        return find_mechanism(self.parameters).state(self.initial)

    @property
    def initial(self) -> InitialState:
        """Initial state of a run that starts in this configuration."""
        mechanism = find_mechanism(self.parameters)
        names = [freedom.initial[0] for freedom in mechanism.freedoms]
        return mechanism.initial(**dict(zip(names, self.coordinates.tolist())))

    @property
    def stable(self) -> bool:
        """Whether no small deviation of the free coordinates grows, dry friction left out; a neutral equilibrium is not stable.

        The stiffness must be positive, as at a minimum of the potential energy. A load in the axes of a body or a force law
        that drives may still let a vibration grow; therefore no pole may have a positive real part either.
        """
        balance = _Balance(self.parameters, self.inputs)
        free = (balance.scale[:, None] * self.stiffness * balance.scale)[np.ix_(balance.free, balance.free)]
        # loads in the axes of a body make the stiffness unsymmetric
        values = np.linalg.eigvals(free)
        if values.real.min() <= 1e-9 * np.abs(values).max():
            return False
        return not model.vibration_grows(
            model.linearise(model.without_dry_friction(self.parameters), self.state, self.inputs).poles
        )

    @property
    def potential(self) -> float:
        """Potential energy (J) of springs, gravity and constant forces; the energy of a force is zero at zero displacement.

        Left out are force laws of springs, loads in the axes of a body, torques on bodies, and drives of joints that are no
        degrees of freedom.
        """
        mechanism = find_mechanism(self.parameters)
        work = 0.0
        for channel in mechanism.channels:
            force = getattr(self.inputs, channel.argument) if channel.kind == "force" else None
            where = mechanism.freedoms[channel.freedom].coordinate if channel.freedom >= 0 else channel.displacement
            if force and where:
                work += force * self[where]
        return mechanism.equations.energy(self.state, self.parameters.constants()) - work


class _Balance:
    """Equilibrium equations: generalised forces on the free degrees of freedom, times the scales of their coordinates (N.m).

    In ``modes`` held degrees of freedom count as free, with no applied force: the unbalanced forces on them are the holding
    forces.
    """

    def __init__(self, parameters: Parameters, inputs: Inputs) -> None:
        self.mechanism = mechanism = find_mechanism(parameters)
        check_run(mechanism, inputs, None)
        if not inputs.held_exactly:
            raise InputError(f"{inputs}: at an equilibrium all of them must be constant")
        still = np.zeros((1, mechanism.size))
        modes, channels = sample_channels(mechanism, inputs, np.zeros(1), still)
        forces = {channel.argument for channel in mechanism.channels if channel.kind == "force"}
        held = layout(mechanism, modes).commanded
        loose = list(modes)
        for place, mode in enumerate(mechanism.modes):
            if any(mechanism.freedoms[n].mode is mode for n in held):
                loose[place] = next((k for k, name in enumerate(mode.arguments) if name in forces), modes[place])
        self.parameters, self.inputs, self.channels, self.modes = parameters, inputs, channels[0], tuple(loose)
        #: Layout in these modes; ``its.free`` has the free and the held degrees of freedom.
        self.its = layout(mechanism, self.modes)
        #: Indices, in ``its.free``, of the degrees of freedom that are not held.
        self.free = [place for place, n in enumerate(self.its.free) if n not in held]
        if not self.free:
            mode = mechanism.modes[0]
            raise InputError(
                f"no freedom of the {mechanism.name} is free: there is no equilibrium to be found; "
                f"{mode.arguments[0]}=0.0 instead of {mode.arguments[1]} frees one"
            )
        #: Scales of the coordinates of ``its.free``.
        self.scale = np.array(mechanism.error_scale(parameters, tuple(still[0].tolist())))[list(self.its.free)]
        self.constants = np.array([*parameters.constants(), 0.0])

    def imbalance(self, coordinates: FloatArray) -> FloatArray:
        """Return the norms of the scaled forces on the free degrees of freedom at n configurations, shape (n,).

        ``coordinates`` has the shape (freedoms, n). A norm is infinite beyond the limit of assembly.
        """
        n = coordinates.shape[1]
        columns = (np.tile(value[:, None], n) for value in (self.channels, self.constants))
        forces, clearance = map(np.asarray, _statics(self.mechanism, self.modes)[0].map(n)(coordinates, *columns))
        norms = np.linalg.norm(self.scale[self.free, None] * forces[self.free], axis=0)
        joined = np.isfinite(norms) & (clearance[0] >= LIMIT_SINE)
        return np.where(joined, norms, np.inf)

    def solve(self, guess: FloatArray) -> Equilibrium:
        """Find an equilibrium by Newton's method; a step is halved while the imbalance would grow.

        Raises EquilibriumError if the method does not converge.
        """
        q, moved = guess.copy(), np.array(self.its.free)[self.free]
        before = self.imbalance(q[:, None])[0]
        for iteration in range(MOST_ITERATIONS):
            forces, stiffness, of_inputs = map(
                np.asarray, _statics(self.mechanism, self.modes)[1](q, self.channels, self.constants)
            )
            size = self._size(q, stiffness, of_inputs)
            scale = self.scale[self.free]
            scaled = scale[:, None] * stiffness[np.ix_(self.free, self.free)] * scale
            # if the equilibrium is neutral, the shortest step that reaches it is taken
            step = scale * np.linalg.lstsq(scaled, scale * forces[self.free, 0], rcond=1e-10)[0]
            trials = np.tile(q[:, None], 40)
            trials[moved] += step[:, None] * 0.5 ** np.arange(40)
            after = self.imbalance(trials)
            # continue as long as a step still reduces the imbalance considerably
            if before <= BALANCE * size and not np.any(after < 0.1 * before):
                return self._make_equilibrium(q, forces[:, 0], stiffness, before / size if size else 0.0, iteration)
            if not np.any(after < before):
                break
            first = int(np.argmax(after < before))
            q, before = trials[:, first].copy(), after[first]
        raise EquilibriumError(
            f"no equilibrium found from {self._words(guess)}: an imbalance of {before:.3g} N.m is left at {self._words(q)}"
        )

    def _size(self, q: FloatArray, stiffness: FloatArray, of_inputs: FloatArray) -> float:
        """Return the sum of the magnitudes of all generalised forces near q times the scales of their coordinates (N.m).

        An imbalance is small or large relative to this value. ``of_inputs`` are the forces due to unit inputs.
        """
        # a cyclic freedom has no displacement that loads a spring
        far = [0.0 if self.mechanism.freedoms[n].period else abs(q[n]) for n in self.its.free]
        elastic = self.scale @ np.abs(stiffness) @ (self.scale + far)
        return float(elastic + self.scale @ np.abs(of_inputs) @ np.abs(self.channels[list(self.its.forces)]))

    def _make_equilibrium(
        self, q: FloatArray, forces: FloatArray, stiffness: FloatArray, residual: float, iterations: int
    ) -> Equilibrium:
        # `start` sets a freedom that is tied to another
        equations, p = self.mechanism.equations, self.parameters.constants()
        applied = equations.apply_inputs(tuple(map(float, self.modes)), tuple(self.channels.tolist()), p)
        state = equations.start(self.state(q), applied, p)
        held = [(self.mechanism.freedoms[n].coordinate, k) for k, n in enumerate(self.its.free) if k not in self.free]
        return Equilibrium(
            parameters=self.parameters, coordinates=np.array(state[: len(q)]), inputs=self.inputs, stiffness=stiffness,
            holding={name: -float(forces[k]) for name, k in held}, residual=float(residual), iterations=iterations,
        )  # fmt: skip

    def _words(self, q: FloatArray) -> str:
        return self.mechanism.describe_state(self.state(q))

    def state(self, q: FloatArray) -> tuple[float, ...]:
        """Return the state of the plant at rest with the coordinates q."""
        return (*q.tolist(), *[0.0] * (self.mechanism.size - len(q)))

    def starts(self, held: FloatArray) -> list[FloatArray]:
        """Return points of a grid from which Newton's method starts, as arrays of all coordinates.

        They are the local minima of the imbalance and, at some angles of the cyclic freedoms, the point of least imbalance.
        """
        from scipy.ndimage import minimum_filter  # takes a quarter of a second

        units = {variable.name: variable.unit for variable in self.mechanism.variables}
        names = [field.name for field in fields(self.parameters)]
        lengths = [abs(getattr(self.parameters, name)) for name in names if units[fmi_name(name)] == "m"]
        turn, other = (min(most, int(MOST_POINTS ** (1.0 / len(self.free)))) for most in GRID)
        axes, ends = [], []
        for k in self.free:
            freedom = self.mechanism.freedoms[self.its.free[k]]
            period, is_angle = freedom.period, units[freedom.coordinate] == "rad"
            reach = tau if is_angle else max(sum(lengths), self.scale[k])
            axes.append(period * np.arange(turn) / turn if period else np.linspace(-reach, reach, other))
            ends.append("wrap" if period else "constant")
        points = np.meshgrid(*axes, indexing="ij")
        columns = np.tile(held[:, None], points[0].size)
        columns[np.array(self.its.free)[self.free]] = [axis.ravel() for axis in points]
        values = self.imbalance(columns).reshape(points[0].shape)
        chosen = values <= minimum_filter(values, size=3, mode=ends, cval=np.inf)
        others = tuple(n for n, end in enumerate(ends) if end == "constant")
        if 0 < len(others) < len(ends):
            # a stiff spring along another coordinate hides what a turn changes: at several angles its best place is taken, too
            few = tuple(slice(None, None, 4 * ends.count("wrap") if end == "wrap" else None) for end in ends)
            chosen[few] |= values[few] == values[few].min(axis=others, keepdims=True)
        return list(columns[:, (np.isfinite(values) & chosen).ravel()].T)


def _balance_with_held(
    parameters: Parameters, inputs: Inputs | None, held: Mapping[str, float] | None
) -> tuple[_Balance, FloatArray]:
    """Return the equilibrium equations, and all coordinates: given values for held degrees of freedom, zero for the others."""
    mechanism = find_mechanism(parameters)
    inputs, _ = check_run(mechanism, inputs, None)
    coordinates = np.zeros(len(mechanism.freedoms))
    commands = {mechanism.freedoms[c.freedom].coordinate: c for c in mechanism.channels if c.kind == "command"}
    for name, value in (held or {}).items():
        if name not in commands:
            raise InputError(f"{name} cannot be held; these can: {', '.join(commands) or 'none'}")
        if not isfinite(value):
            raise InputError(f"{name} is {value}: it must be a finite number")
        inputs = inputs.replace(**{commands[name].argument: 0.0})
        coordinates[commands[name].freedom] = value
    return _Balance(parameters, inputs), coordinates


@takes_published()
@in_si(held=variable_units)
def find_equilibria(
    parameters: Parameters, inputs: Inputs | None = None, *, held: Mapping[str, Amount] | None = None
) -> tuple[Equilibrium, ...]:
    """Find the equilibria of a mechanism, starting from a grid over all configurations; sort them by `Equilibrium.potential`.

    Parameters
    ----------
    parameters
        Parameters of the mechanism.
    inputs : Inputs, optional
        Constant forces; by default none. A degree of freedom with a commanded rate is held; the rate must be 0.
    held : mapping, optional
        Coordinates (rad, m) of held degrees of freedom, such as ``{"crank.angle": "30 deg"}``; 0 for a degree of freedom held
        by the inputs alone.

    Returns
    -------
    tuple of Equilibrium
        The equilibria; the coordinate of a free cyclic degree of freedom is within half its period of zero, usually in
        (-pi, pi]. If the equilibria are not isolated, only some of them are found.

    Raises
    ------
    InputError
        If a force is not constant, a held degree of freedom moves or is driven by a force, or no degree of freedom is free.
    """
    balance, coordinates = _balance_with_held(parameters, inputs, held)
    found: list[Equilibrium] = []
    for start in balance.starts(coordinates):
        try:
            one = balance.solve(start)
        except EquilibriumError:
            continue
        turned = one.coordinates.copy()
        for n in (balance.its.free[k] for k in balance.free):
            if period := balance.mechanism.freedoms[n].period:
                # half a turn to either side is the same, whatever its rounding error
                turned[n] -= period * np.ceil(turned[n] / period - 0.5 - 1e-6)
        one = balance.solve(turned)
        places = list(balance.its.free)
        gaps = (np.sum(np.abs(one.coordinates - other.coordinates)[places] / balance.scale) for other in found)
        if min(gaps, default=1.0) > 1e-6:
            found.append(one)
    return tuple(sorted(found, key=lambda one: one.potential))


@takes_published()
@in_si(held=variable_units)
def find_equilibrium(
    parameters: Parameters,
    inputs: Inputs | None = None,
    *,
    held: Mapping[str, Amount] | None = None,
    guess: ArrayLike | None = None,
) -> Equilibrium:
    """Find an equilibrium of a mechanism, with no degree of freedom held in place, or with some of them held.

    Parameters
    ----------
    parameters, inputs, held
        As for `find_equilibria`.
    guess : array_like, optional
        All coordinates (rad, m) to start from; the values for held degrees of freedom are ignored. If no guess is given,
        the stable equilibrium of least `Equilibrium.potential` is returned or, if none is stable, the equilibrium of least
        potential. The potential leaves out some forces, such as the laws of springs: if these act, choose one of several stable
        equilibria by a guess.

    Raises
    ------
    InputError
        As `find_equilibria`.
    AssemblyError
        If the links cannot be joined at the guess.
    EquilibriumError
        If there is no equilibrium, or Newton's method finds none from the guess; the message then states the imbalance left and
        the configuration.

    Examples
    --------
    >>> from analysis import Inputs, find_equilibrium
    >>> rest = find_equilibrium("table-3.1", Inputs(force="5 N"), held={"crank.angle": "90 deg"})
    >>> f"{1e3 * rest['slider.position']:.3f} mm"
    '5.557 mm'
    """
    if guess is not None:
        balance, coordinates = _balance_with_held(parameters, inputs, held)
        wanted = f"a guess {guess}: it must be {len(coordinates)} finite numbers"
        start = float_array(guess, wanted)
        if start.shape != coordinates.shape or not np.all(np.isfinite(start)):
            raise InputError(wanted)
        fixed = layout(balance.mechanism, tuple(balance.inputs.modes(balance.mechanism).values())).commanded
        start[list(fixed)] = coordinates[list(fixed)]
        balance.mechanism.check_assembly(balance.state(start), parameters.constants())
        return balance.solve(start)
    found = find_equilibria(parameters, inputs, held=held)
    if not found:
        given_words = [f"{name} = {value:g}" for name, value in (held or {}).items()]
        under = ", ".join(f"{name} {getattr(inputs, name)}" for name in inputs or ()) or "no force"
        raise EquilibriumError(
            f"there is no equilibrium{' with ' * bool(held) + ', '.join(given_words)} under {under}, as far as a "
            "search over a grid of configurations shows"
        )
    return next((one for one in found if one.stable), found[0])
