"""Linear models of the plant about one state.

In the deviations q of (th2, u), or of u alone where the crank's motion is prescribed, and w of the inputs,

    M q'' + C q' + K q = F w

with the exact derivatives of the plant's own functions, traced with CasADi (`analysis.numerics.symbolic`). The residual that is
differentiated is m q'' + b - Q - (T, F2) of `linkwork.five_bar.dynamics`. Away from an equilibrium the accelerations are
not zero, and K holds the derivative of m times them. CasADi is an extra: ``pip install 'linkwork[symbolic]'``.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError, UnknownNameError
from linkwork.five_bar import dynamics
from linkwork.five_bar.assembly import check_assembly
from linkwork.five_bar.parameters import FiveBarParameters
from linkwork.five_bar.variables import INPUTS, OUTPUT_NAMES, OUTPUTS

from ..mechanisms import FIVE_BAR, require_five_bar
from ..numerics import symbolic
from ..run import constants, traced

FloatArray = NDArray[np.float64]

#: Outputs that a linear model does not have, and what they are.
WITHOUT: Mapping[str, str] = MappingProxyType(
    dict.fromkeys(
        ("energy.dissipated", "energy.supplied", "energy.residual"),
        "an integral over the run, no function of the state",
    )
    | {"closure.residual": "zero everywhere"}
)
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
AT_REST = dynamics.Inputs(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class LinearModelError(LinkworkError):
    """A linear model is asked for what it cannot give."""


def signal_name(name: str) -> str:
    """Name of an FMI variable as a signal of python-control, which keeps the dot for itself: ``slider_position``."""
    return name.replace(".", "_")


@cache
def _derivatives() -> Any:
    """State (4,), inputs (6,), constants -> outputs and their derivatives, M, C, K and the inputs' forces."""
    casadi, plant = symbolic.library(), traced(FIVE_BAR)
    x, i, a = casadi.SX.sym("x", 4), casadi.SX.sym("i", 6), casadi.SX.sym("a", 2)
    p, c = constants(FIVE_BAR)
    th2, u, w2, v = casadi.vertsplit(x)
    inputs = dynamics.Inputs(*casadi.vertsplit(i))
    g = plant.position(th2, u, c)
    k = plant.coefficients(g, c)
    w3, w4 = k.k32 * w2 + k.k3u * v, k.k42 * w2 + k.k4u * v
    m = plant.inertia(g, k, c)
    b1, b2 = plant.velocity_terms(g, k, w2, w3, w4, *plant.centripetal(g, w2, w3, w4, c), c)
    q1, q2 = plant.applied_forces(g, k, u, v, inputs.load_x, inputs.load_y, c)
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
    rates = plant.derivative(state, inputs, c)
    acceleration = casadi.vertcat(rates[2], rates[3])
    y = casadi.vertcat(*plant.outputs(state, inputs, 0.0, c))[_ROWS]
    results = [y, casadi.jacobian(y, x), casadi.jacobian(y, i), *second_order(x, acceleration, i, p)]
    return casadi.Function("derivatives", [x, i, p], [casadi.densify(r) for r in results], {"cse": True})


@cache
def _mapped(samples: int) -> Any:
    return _derivatives().map(samples)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Matrices:
    """The arrays of a linear model, or those of many stacked along the first axis.

    n is 2 in torque drive, with q = (crank angle, slider position), and 1 in speed drive, with q = (slider position);
    m is the number of inputs; l that of `LINEAR_OUTPUTS`. All are deviations from the operating point, in SI.

    Attributes
    ----------
    parameters : FiveBarParameters
    M, C, K : ndarray, shape (..., n, n)
        Inertia, damping and stiffness.
    F : ndarray, shape (..., n, m)
        Generalised forces of unit inputs.
    H : ndarray, shape (..., l, 2 n)
        Derivatives of the outputs with respect to (q, q').
    D : ndarray, shape (..., l, m)
        Derivatives of the outputs with respect to the inputs.
    outputs : ndarray, shape (..., l)
        The outputs at the operating point.
    acceleration : ndarray, shape (..., 2)
        th2'' and u'' there.
    """

    parameters: FiveBarParameters
    M: FloatArray
    C: FloatArray
    K: FloatArray
    F: FloatArray
    H: FloatArray
    D: FloatArray
    outputs: FloatArray
    acceleration: FloatArray

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
    """The plant about one state, or the mean of that along a periodic motion; see `Matrices`.

    Attributes
    ----------
    state : ndarray, shape (6,)
        Operating point (th2, u, w2, v, dissipated, supplied); of a mean model the mean over the period.
    inputs : dynamics.Inputs
        In force there.
    """

    state: FloatArray
    inputs: dynamics.Inputs

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
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A (1/s), by magnitude."""
        return by_magnitude(np.linalg.eigvals(self.A))

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
            If an output is one that a linear model does not have (`WITHOUT`).
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


def by_magnitude(values: ArrayLike) -> NDArray[np.complex128]:
    """Complex numbers in the order of their magnitudes, those of a pair by their imaginary parts."""
    whole = np.asarray(values, dtype=complex)
    return whole[np.lexsort((whole.imag, np.abs(whole)))]


def _index(name: str, known: tuple[str, ...]) -> int:
    if name in WITHOUT:
        raise LinearModelError(f"a linear model has no output {name}: it is {WITHOUT[name]}")
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        raise UnknownNameError(name, known, near[0] if near else None)
    return known.index(name)


def evaluate(
    parameters: FiveBarParameters, states: FloatArray, inputs: Sequence[dynamics.Inputs]
) -> dict[str, FloatArray]:
    """The arrays of `Matrices` at n states, stacked along the first axis."""
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


def six_states(states: ArrayLike) -> FloatArray:
    """States of shape (n, 4) or (n, 6) as (n, 6)."""
    array = np.array(states, dtype=float)
    if array.ndim != 2 or array.shape[1] not in (4, 6) or len(array) == 0:
        raise InputError(f"states of shape {array.shape}: each must be (th2, u, th2', u') or the plant's six-tuple")
    return np.hstack([array, np.zeros((len(array), 6 - array.shape[1]))])


def checked_inputs(inputs: dynamics.Inputs) -> dynamics.Inputs:
    if inputs.speed_drive not in (0.0, 1.0):
        raise InputError(f"speed_drive is {inputs.speed_drive}: it must be 0 (torque drive) or 1 (speed drive)")
    return inputs


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
    states = six_states(np.atleast_2d(np.asarray(state, dtype=float)))
    if len(states) != 1:
        raise InputError(f"{len(states)} states: one is linearised about here, many by linearise_along")
    arrays = evaluate(parameters, states, [checked_inputs(inputs)])
    return LinearModel(
        parameters=parameters, state=states[0], inputs=inputs, **{name: a[0] for name, a in arrays.items()}
    )
