"""Linearise a mechanism about one state.

With q the deviations of the free coordinates, and w the deviations of the inputs, the linear model is

    M q'' + C q' + K q = F w

Its matrices are exact derivatives of the mechanism's own equations, traced with CasADi (`analysis.run.expressions`). M is the
Hessian of the energy with respect to the rates. The accelerations a(q, q', w) give K = -M da/dq, C = -M da/dq' and F = M da/dw.
Away from an equilibrium the accelerations are not zero, and K = -d(M a)/dq + (dM/dq) a. A degree of freedom is free if its rate
is not commanded. A commanded degree of freedom is not part of q; it acts through three inputs: acceleration, speed and
coordinate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ..files import unknown_name
from ..libraries import lazy
from ..mechanisms import Parameters, find_mechanism
from ..numerics import symbolic
from ..run import Inputs, check_run, encode_once, expressions, float_array, law_slopes, sample, takes_published

if TYPE_CHECKING:
    import control
else:
    control = lazy("control")

FloatArray = NDArray[np.float64]
#: Values of a mechanism's modes, in the mechanism's order.
Modes = tuple[int, ...]

#: Largest difference between a commanded rate and the rate in the state, relative to the rate in the state or, if larger, to 1.
SAME_RATE = 1e-6
#: Real or imaginary part of a pole that counts as zero, relative to the largest pole: a neutral coordinate has a double pole at
#: zero, which rounding splits.
ROUNDING = 1e-7


class LinearModelError(LinkworkError):
    """The linear model does not have a requested input, output or force, or the model could not be computed."""


def signal_name(name: str) -> str:
    """Return the name of an FMI variable as a python-control signal, with underscores for dots: ``slider_position``."""
    return name.replace(".", "_")


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Free and commanded degrees of freedom of a mechanism, and the forces that act, in given modes.

    A degree of freedom that is tied to another one, as by a groove, is neither free nor commanded.
    """

    free: tuple[int, ...]  # indices of the degrees of freedom that forces move
    commanded: tuple[int, ...]  # indices of those with commanded rates
    forces: tuple[int, ...]  # indices of the channels whose forces act
    input_names: tuple[str, ...]  # the forces, then acceleration, speed and coordinate of each commanded one
    state_names: tuple[str, ...]  # the free coordinates, then their rates
    places: tuple[int, ...]  # indices of these in the plant's state


@cache
def layout(mechanism: Mechanism, modes: Modes) -> Layout:
    """Return the layout of a mechanism in given modes: free and commanded degrees of freedom, and acting forces."""
    names = {mode.name: mode.arguments[value] for mode, value in zip(mechanism.modes, modes)}
    channels = mechanism.channels

    def acts(number: int) -> bool:
        channel = channels[number]
        mode = mechanism.freedoms[channel.freedom].mode if channel.freedom >= 0 else None
        return mode is None or names[mode.name] == channel.argument

    acting = [n for n in range(len(channels)) if acts(n)]
    driven = {kind: {channels[n].freedom for n in acting if channels[n].kind == kind} for kind in ("force", "command")}
    freedoms = range(len(mechanism.freedoms))
    commanded = tuple(n for n in freedoms if n in driven["command"])
    free = tuple(
        n for n in freedoms if n not in commanded and (mechanism.freedoms[n].mode is None or n in driven["force"])
    )
    forces = tuple(n for n in acting if channels[n].kind == "force")
    inputs = [channels[n].name for n in forces]
    for n in commanded:
        inputs += [_channel_name(mechanism, n, "rate"), _channel_name(mechanism, n, "command")]
        inputs.append(mechanism.freedoms[n].coordinate)
    moving = [mechanism.freedoms[n] for n in free]
    states = tuple([f.coordinate for f in moving] + [f.rate for f in moving])
    places = (*free, *(len(freedoms) + n for n in free))
    return Layout(
        free=free, commanded=commanded, forces=forces, input_names=tuple(inputs), state_names=states, places=places
    )


def _channel_name(mechanism: Mechanism, freedom: int, kind: str) -> str:
    return next(c.name for c in mechanism.channels if c.kind == kind and c.freedom == freedom)


@cache
def missing_outputs(mechanism: Mechanism) -> Mapping[str, str]:
    """Return the outputs of a mechanism that its linear models do not have, by FMI name, each with the reason."""
    casadi, traces = symbolic.library(), expressions(mechanism)
    x, _, _, p = traces.symbols
    of_the_run = casadi.vertcat(x[2 * len(mechanism.freedoms) :], p[-1])
    integrals = casadi.which_depends(traces.outputs, of_the_run, 1, True)
    reason = "an integral over the run, not a function of the state"
    found = {name: reason for name, integral in zip(mechanism.output_names, integrals) if integral}
    return found | {name: "zero everywhere" for name in mechanism.output_names if name == "closure.residual"}


@cache
def linear_outputs(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the FMI names of the outputs of a linear model, in the order of the FMI contract."""
    return tuple(name for name in mechanism.output_names if name not in missing_outputs(mechanism))


@cache
def _derivatives(mechanism: Mechanism, modes: Modes, switched: bool) -> Any:
    """Return a CasADi function of state, channels and constants that gives the arrays of `Matrices`.

    The arrays are the outputs, the accelerations, M, C, K, F, and the derivatives of the outputs with respect to the state and
    to the inputs.
    """
    casadi, traces, its = symbolic.library(), expressions(mechanism, switched), layout(mechanism, modes)
    x, mode_symbols, u, p = traces.symbols
    n = len(mechanism.freedoms)
    coordinates, rates = [x[k] for k in its.free], [x[n + k] for k in its.free]
    state = casadi.vertcat(*coordinates, *rates)
    channels = dict(zip(mechanism.input_names, casadi.vertsplit(u)))
    acting = [channels[mechanism.channels[k].name] for k in its.forces]
    for k in its.commanded:
        acting += [channels[_channel_name(mechanism, k, "rate")], x[n + k], x[k]]
    w = casadi.vertcat(*acting)

    def in_modes(expression: Any) -> Any:
        return casadi.substitute(expression, mode_symbols, casadi.DM(list(map(float, modes))))

    accelerations = in_modes(traces.derivative[n : 2 * n])
    a = accelerations[list(its.free)]
    inertia = casadi.hessian(in_modes(traces.energy), casadi.vertcat(*rates))[0]
    by_state = -casadi.mtimes(inertia, casadi.jacobian(a, state))
    size = len(its.free)
    y = in_modes(traces.outputs)[[mechanism.output_names.index(name) for name in linear_outputs(mechanism)]]
    results = [
        y,
        accelerations,
        inertia,
        by_state[:, size:],
        by_state[:, :size],
        casadi.mtimes(inertia, casadi.jacobian(a, w)),
        casadi.jacobian(y, state),
        casadi.jacobian(y, w),
    ]
    return casadi.Function("derivatives", [x, u, p], [casadi.densify(r) for r in results], {"cse": True})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matrices:
    """Arrays of a linear model, or of many models stacked along the first axis.

    n is the number of free degrees of freedom. For a five-bar driven by a torque n is 2, with q = (crank angle, slider
    position); with commanded crank speed n is 1, with q = (slider position). m is the number of inputs, l the number of
    outputs, f the number of all degrees of freedom. States and inputs are deviations from the operating point, in SI.

    Attributes
    ----------
    parameters
        Parameters of a mechanism.
    modes : tuple of int
        Values of the mechanism's modes.
    M, C, K : ndarray, shape (..., n, n)
        Inertia, damping and stiffness.
    F : ndarray, shape (..., n, m)
        Generalised forces due to unit inputs.
    H : ndarray, shape (..., l, 2 n)
        Derivatives of the outputs with respect to (q, q').
    D : ndarray, shape (..., l, m)
        Derivatives of the outputs with respect to the inputs.
    outputs : ndarray, shape (..., l)
        The outputs at the operating point.
    acceleration : ndarray, shape (..., f)
        Accelerations of all degrees of freedom at the operating point.
    """

    parameters: Parameters
    modes: Modes
    M: FloatArray
    C: FloatArray
    K: FloatArray
    F: FloatArray
    H: FloatArray
    D: FloatArray
    outputs: FloatArray
    acceleration: FloatArray

    @property
    def mechanism(self) -> Mechanism:
        """Mechanism to which the parameters belong."""
        return find_mechanism(self.parameters)

    @property
    def layout(self) -> Layout:
        """Free and commanded degrees of freedom and acting forces, in the model's modes."""
        return layout(self.mechanism, self.modes)

    @property
    def input_names(self) -> tuple[str, ...]:
        """FMI names of the inputs; a commanded degree of freedom has three: acceleration, speed and coordinate."""
        return self.layout.input_names

    @property
    def state_names(self) -> tuple[str, ...]:
        """FMI names of the components of the first-order state (q, q')."""
        return self.layout.state_names

    @property
    def output_names(self) -> tuple[str, ...]:
        """FMI names of the outputs: all outputs of the mechanism except `missing_outputs`."""
        return linear_outputs(self.mechanism)

    @property
    def places(self) -> list[int]:
        """Indices of the components of (q, q') in the plant's state."""
        return list(self.layout.places)

    @property
    def A(self) -> FloatArray:
        """State matrix of (q, q')' = A (q, q') + B w, shape (..., 2 n, 2 n)."""
        n = self.M.shape[-1]
        a = np.zeros((*self.M.shape[:-2], 2 * n, 2 * n))
        a[..., :n, n:] = np.eye(n)
        a[..., n:, :n] = -np.linalg.solve(self.M, self.K)
        a[..., n:, n:] = -np.linalg.solve(self.M, self.C)
        return a

    @property
    def B(self) -> FloatArray:
        """Input matrix, shape (..., 2 n, m)."""
        return np.concatenate([np.zeros_like(self.F), np.linalg.solve(self.M, self.F)], axis=-2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearModel(Matrices):
    """Linear model of a mechanism about one state, or mean model along a periodic motion; see `Matrices`.

    Attributes
    ----------
    state : ndarray
        Operating point: all coordinates, all rates, work dissipated and supplied; for a mean model the mean over the period.
    channels : ndarray
        Values of the mechanism's channels at the operating point.
    """

    state: FloatArray
    channels: FloatArray

    def __repr__(self) -> str:
        states, inputs = (", ".join(names) for names in (self.layout.state_names, self.layout.input_names))
        return f"<LinearModel of {self.mechanism.name}: states {states}; inputs {inputs}; poles {self.poles.round(4).tolist()}>"

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A (1/s), by magnitude."""
        return sort_by_magnitude(np.linalg.eigvals(self.A))

    @property
    def natural_frequencies(self) -> FloatArray:
        """Undamped natural frequencies (rad/s), in rising order: square roots of the positive eigenvalues of M^-1 K."""
        squares = np.linalg.eigvals(np.linalg.solve(self.M, self.K))
        return np.sort(np.sqrt(squares.real[(squares.real > 0.0) & (squares.imag == 0.0)]))

    def force_channel(self, name: str | None = None) -> tuple[str, int]:
        """Return the FMI name of a force that acts on a free degree of freedom, and the index of this degree of freedom.

        Parameters
        ----------
        name : str, optional
            FMI name of the force; by default the force on the last free degree of freedom, for a five-bar ``slider.force``.

        Raises
        ------
        LinearModelError
            If there is no such force.
        """
        mechanism, its = self.mechanism, self.layout
        channels = [mechanism.channels[n] for n in its.forces if mechanism.channels[n].freedom in its.free]
        for channel in sorted(channels, key=lambda one: -one.freedom):
            if name in (None, channel.name):
                return channel.name, channel.freedom
        known = ", ".join(channel.name for channel in channels) or "none"
        raise LinearModelError(f"no force {name or ''} drives a freedom of this model; these do: {known}")

    def to_state_space(
        self, outputs: str | Sequence[str] | None = None, inputs: str | Sequence[str] | None = None
    ) -> control.StateSpace:
        """Convert the model to a state space of python-control.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            FMI names; by default the last free coordinate, such as ``slider.position``, and all inputs.

        Returns
        -------
        control.StateSpace
            Its signals have the FMI names with underscores for dots (`signal_name`), as python-control requires.

        Raises
        ------
        UnknownNameError
            If there is no such input or output.
        LinearModelError
            If a linear model does not have one of the outputs (`missing_outputs`).
        """
        chosen = self.input_names if inputs is None else as_names(inputs)
        wanted = [self.state_names[len(self.state_names) // 2 - 1]] if outputs is None else as_names(outputs)
        for name in wanted:
            if name in (missing := missing_outputs(self.mechanism)):
                raise LinearModelError(f"a linear model has no output {name}: it is {missing[name]}")
        rows = [_index(name, self.output_names) for name in wanted]
        columns = [_index(name, self.input_names) for name in chosen]
        return control.ss(
            self.A,
            self.B[:, columns],
            self.H[rows],
            self.D[np.ix_(rows, columns)],
            inputs=[signal_name(name) for name in chosen],
            outputs=[signal_name(name) for name in wanted],
            states=[signal_name(name) for name in self.state_names],
        )


def as_names(names: str | Sequence[str]) -> Sequence[str]:
    """Return names; a single name as a list of one."""
    return [names] if isinstance(names, str) else names


def sort_by_magnitude(values: ArrayLike) -> NDArray[np.complex128]:
    """Return complex numbers sorted by magnitude; numbers of equal magnitude are sorted by imaginary part."""
    whole = np.asarray(values, dtype=complex)
    return whole[np.lexsort((whole.imag, np.abs(whole)))]


def vibration_grows(poles: NDArray[np.complex128]) -> Any:
    """Return for each set of poles along the last axis whether any has a positive real part, apart from rounding."""
    return poles.real.max(axis=-1) > ROUNDING * np.abs(poles).max(axis=-1)


def without_dry_friction(parameters: Parameters) -> Parameters:
    """Return the parameters of a mechanism with zero dry friction, which would hold all bodies at rest."""
    names = find_mechanism(parameters).names("friction")
    return replace(parameters, **{field_name(name): 0.0 for name in names})


def _index(name: str, names: tuple[str, ...]) -> int:
    if name not in names:
        raise unknown_name(name, names)
    return names.index(name)


def evaluate(
    parameters: Parameters, modes: Modes, states: FloatArray, channels: FloatArray, inputs: Inputs | None = None
) -> dict[str, FloatArray]:
    """Return the arrays of `Matrices` by name, at states (s, size) with channels (s, channels), stacked along the first axis.

    The torques of motors and torsion bars among ``inputs`` are part of the model: K, C and H include their derivatives.

    Raises InputError if a state or a channel is not finite or no degree of freedom is free; AssemblyError if the links cannot
    be joined at a state.
    """
    mechanism = find_mechanism(parameters)
    its, p, n = layout(mechanism, modes), parameters.constants(), len(states)
    if not its.free:
        names = " and ".join(mechanism.freedoms[number].rate for number in its.commanded)
        raise InputError(
            f"no freedom of the {mechanism.name} is free, {names} being commanded: there is nothing to linearise; leave out a "
            "commanded speed"
        )
    for row, u in zip(states, channels):
        if not np.all(np.isfinite(row)):
            raise InputError(f"the state {row} is not finite")
        applied = mechanism.equations.apply_inputs(tuple(map(float, modes)), tuple(u.tolist()), p)
        mechanism.check_state(mechanism.equations.start(tuple(row.tolist()), applied, p), applied, p)
    constants = np.tile(np.array([*p, 0.0])[:, None], n)
    raw = _derivatives(mechanism, modes, mechanism.is_switched_on(p)).map(n)(states.T, channels.T, constants)

    def stack(value: Any, columns: int) -> FloatArray:
        array = np.asarray(value)
        return np.moveaxis(array.reshape(array.shape[0], n, columns), 1, 0)

    size, acting = len(its.free), len(its.input_names)
    order = ("outputs", "acceleration", "M", "C", "K", "F", "H", "D")
    arrays = dict(zip(order, map(stack, raw, (1, 1, size, size, size, acting, 2 * size, acting))))
    for name in ("outputs", "acceleration"):
        arrays[name] = arrays[name][:, :, 0]
    for channel, place, slope in law_slopes(encode_once(inputs, mechanism), states) if inputs else ():
        if channel in its.forces and place in its.places:
            state, column = its.places.index(place), its.forces.index(channel)
            arrays["CK"[state < size]][:, :, state % size] -= slope[:, None] * arrays["F"][:, :, column]
            arrays["H"][:, :, state] += slope[:, None] * arrays["D"][:, :, column]
    # adding 0.0 changes -0.0 to 0.0
    return arrays | {name: arrays[name] + 0.0 for name in ("C", "K")}


def full_states(mechanism: Mechanism, states: ArrayLike) -> FloatArray:
    """Extend states, shape (n, 2 f), to full states, (n, 2 f + 2), by zeros for work dissipated and supplied.

    Full states are returned unchanged.
    """
    message = f"the states are {states!r}: they must be numbers in SI, such as the state of an Equilibrium"
    array, n = np.atleast_2d(float_array(states, message)), 2 * len(mechanism.freedoms)
    if array.ndim != 2 or array.shape[1] not in (n, mechanism.size) or len(array) == 0:
        raise InputError(
            f"states of shape {array.shape}: each must be all coordinates and all rates of the {mechanism.name}, {n} numbers, "
            f"or its whole state of {mechanism.size}"
        )
    return np.hstack([array, np.zeros((len(array), mechanism.size - array.shape[1]))])


def sample_channels(
    mechanism: Mechanism, inputs: Inputs | None, times: FloatArray, states: FloatArray
) -> tuple[Modes, FloatArray]:
    """Return the values of the modes, and those of the channels at s times and states, shape (s, channels), for given inputs.

    Raises InputError if the inputs belong to another mechanism, a state is not finite, or the inputs command a rate that
    differs from the rate in a state.
    """
    inputs, _ = check_run(mechanism, inputs, None)
    encoded = encode_once(inputs, mechanism)
    for row in states:
        if not np.all(np.isfinite(row)):
            raise InputError(f"the state {row} is not finite")
    values = np.array([sample(encoded, float(t), x, encoded.source.laws) for t, x in zip(times, states)])
    for channel, place, _ in encoded.commands:
        gap = np.abs(values[:, channel] - states[:, place])
        if np.any(gap > SAME_RATE * np.maximum(1.0, np.abs(states[:, place]))):
            worst = int(np.argmax(gap))
            raise InputError(
                f"the inputs command {mechanism.channels[channel].name} {values[worst, channel]:g}, but in the state it is "
                f"{states[worst, place]:g}"
            )
    return tuple(encoded.modes.values()), values


@takes_published()
def linearise(parameters: Parameters, state: ArrayLike, inputs: Inputs | None = None) -> LinearModel:
    """Linearise a mechanism at a state.

    Parameters
    ----------
    parameters
        Parameters of the mechanism, or a published set or its name.
    state : array_like
        All coordinates, then all rates, such as `Equilibrium.state`: for a five-bar (th2, u, th2', u'). The state need not be
        an equilibrium. If it is none, the deviations are measured from the motion through this state, and the model holds at
        this instant.
    inputs : Inputs, optional
        Inputs at time 0, such as `Equilibrium.inputs`; they decide which degrees of freedom are free. By default no input acts.
        Motors and torsion bars are part of the model, which includes the derivatives of their torques. Of a Function only the
        value is used, as of a controller: the loop is not closed.

    Raises
    ------
    InputError
        If state or inputs are not finite, of the wrong shape, or do not match; or if no degree of freedom is free.
    AssemblyError
        If the links cannot be joined in this state.

    Examples
    --------
    >>> from analysis import find_equilibrium, linearise
    >>> rest = find_equilibrium("table-3.1", held={"crank.angle": "90 deg"})
    >>> model = linearise("table-3.1", rest.state, rest.inputs)
    >>> model.K.shape
    (1, 1)
    """
    mechanism = find_mechanism(parameters)
    states = full_states(mechanism, state)
    if len(states) != 1:
        raise InputError(f"{len(states)} states: linearise takes one state; linearise_orbit takes many")
    modes, channels = sample_channels(mechanism, inputs, np.zeros(1), states)
    arrays = {name: array[0] for name, array in evaluate(parameters, modes, states, channels, inputs).items()}
    return LinearModel(parameters=parameters, modes=modes, state=states[0], channels=channels[0], **arrays)
