"""Trace the equations of a mechanism with CasADi and compile them to machine code."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from functools import cache
from types import FunctionType, ModuleType, SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import LinkworkError
from linkwork.mechanism import Mechanism

from ..numerics import symbolic
from ..numerics.tracing import ReboundFunctions

if TYPE_CHECKING:
    from ..numerics.codegen import MachineCode

#: Indices in `Machine.addresses` of the functions that a run needs.
DERIVATIVE, OUTPUTS, CLEARANCE, JUMP = range(4)
_NAMES = ("derivative", "outputs", "clearance", "jump")
#: Functions that write the outputs of several lanes row by row.
_IN_ROWS = ("outputs", "chosen")

_ALLOWED = (
    "equations must be arithmetic without branches, of functions in the mechanism's modules, imported by name, and of "
    f"{', '.join(symbolic.ELEMENTARY)} of math"
)


@cache
def symbolic_equations(mechanism: Mechanism) -> ReboundFunctions:
    """Return the functions of the mechanism's modules, as copies that take CasADi symbols instead of floats."""
    return symbolic.symbolic_functions(mechanism.modules)


def constants(mechanism: Mechanism, switched: bool = False) -> tuple[Any, Any]:
    """Return symbols for the constants of the equations: as a column, and as the NamedTuple that the equations take.

    In the NamedTuple the mechanism's switch (`Mechanism.switch`) is a number, 1 if ``switched``, so that the equations can
    branch on it.
    """
    p = symbolic.library().SX.sym("p", len(mechanism.constants._fields))
    k = mechanism.constants(*symbolic.library().vertsplit(p))
    return p, k._replace(**{mechanism.switch: float(switched)}) if mechanism.switch else k


@cache
def inertia_and_stiffness(mechanism: Mechanism, cranks: tuple[int, ...], freedom: int) -> Any:
    """Return a CasADi function that computes inertia and stiffness of a degree of freedom at rest.

    Inertia and stiffness are the second derivatives of the energy with respect to the rate and to the coordinate of the
    degree of freedom. The arguments of the function are the angle of each of ``cranks``, the coordinate of the degree of
    freedom, and the constants as a column.
    """
    casadi = symbolic.library()
    s, v, *angles = (casadi.SX.sym(name) for name in ("s", "v", *(f"angle{n}" for n in cranks)))
    p, k = constants(mechanism)
    x = [casadi.SX(0.0)] * mechanism.size
    x[freedom], x[len(mechanism.freedoms) + freedom] = s, v
    for crank, angle in zip(cranks, angles):
        x[crank] = angle
    energy = symbolic_equations(mechanism).find(mechanism.equations.energy)(tuple(x), k)
    seconds = [casadi.densify(casadi.jacobian(casadi.jacobian(energy, z), z)) for z in (v, s)]
    resting = casadi.substitute(seconds, [v], [casadi.SX(0.0)])
    return casadi.Function("at_rest", [*angles, s, p], resting)


class ParameterSymbols(NamedTuple):
    """Symbols for the parameters of a mechanism, as a column and as an object; ``functions`` take this object."""

    own: Any
    parameters: Any
    functions: ReboundFunctions


def parameter_symbols(mechanism: Mechanism) -> ParameterSymbols:
    """Return symbols for the parameters, so that their ``constants`` and ``error_scale`` can be traced."""
    casadi = symbolic.library()
    functions = symbolic.symbolic_functions(
        equation_modules(mechanism), max=casadi.fmax, min=casadi.fmin, float=lambda value: value
    )
    names = [field.name for field in fields(mechanism.parameters)]
    own = casadi.SX.sym("own", len(names))
    parameters = parameters_class(mechanism, functions)(**dict(zip(names, casadi.vertsplit(own))))
    return ParameterSymbols(own, parameters, functions)


def parameters_class(mechanism: Mechanism, functions: ReboundFunctions) -> type[SimpleNamespace]:
    """Return a class with the methods of a mechanism's parameters, copied in ``functions``; fields are symbols or arrays."""
    own = vars(mechanism.parameters).items()
    methods = {name: functions.find(f) for name, f in own if isinstance(f, FunctionType) and name[:2] != "__"}
    return type("LikeParameters", (SimpleNamespace,), methods)


def equation_modules(mechanism: Mechanism) -> tuple[ModuleType, ...]:
    """Return the modules of the equations and the modules that compute constants and error scales."""
    of: Iterable[Callable[..., Any]] = (mechanism.parameters, mechanism.error_scale)
    further = {sys.modules[f.__module__]: None for f in of} | {sys.modules[Mechanism.__module__]: None}
    return tuple(dict.fromkeys((*further, *mechanism.modules)))


class Symbols(NamedTuple):
    """Columns of symbols: state, modes, channels, and constants followed by the mechanical energy at the start."""

    x: Any
    modes: Any
    u: Any
    p: Any


class TracedEquations(NamedTuple):
    """The equations as CasADi expressions in `Symbols`, each a column."""

    symbols: Symbols
    derivative: Any
    outputs: Any
    clearance: Any
    jump: Any
    energy: Any


@cache
def expressions(mechanism: Mechanism, switched: bool = False) -> TracedEquations:
    """Return the equations as expressions in the channels and modes of a run, with the mechanism's switch on or off.

    Raises
    ------
    LinkworkError
        If the equations branch on a symbol, or call functions other than `symbolic.ELEMENTARY`.
    """
    casadi = symbolic.library()
    functions = symbolic_equations(mechanism)
    x = casadi.SX.sym("x", mechanism.size)
    modes = casadi.SX.sym("modes", len(mechanism.modes))
    u = casadi.SX.sym("u", len(mechanism.channels))
    p, k = constants(mechanism, switched)
    energy = casadi.SX.sym("start_energy")
    values, channels = tuple(casadi.vertsplit(x)), tuple(casadi.vertsplit(u)) if mechanism.channels else ()

    def trace(what: str, *arguments: Any) -> Any:
        result = call(what, *arguments)
        column = casadi.densify(casadi.vertcat(*result) if isinstance(result, tuple) else casadi.SX(result))
        # float(symbol), which the functions of math and NumPy call, is NaN
        for n, element in enumerate(casadi.vertsplit(column)):
            leaves = casadi.Function("leaves", [x, modes, u, casadi.vertcat(p, energy)], [element])
            codes = range(leaves.n_instructions())
            if any(
                leaves.instruction_id(i) == casadi.OP_CONST and np.isnan(leaves.instruction_constant(i)) for i in codes
            ):
                raise LinkworkError(
                    f"the {what} of {mechanism.name}, number {n}, is not an expression of its arguments: {_ALLOWED}"
                )
        return column

    def call(what: str, *arguments: Any) -> Any:
        try:
            return functions.find(getattr(mechanism.equations, what))(*arguments)
        except RuntimeError as error:
            raise LinkworkError(
                f"the {what} of {mechanism.name} cannot be traced, perhaps because it branches on its arguments: {_ALLOWED}"
            ) from error

    applied = call("apply_inputs", tuple(casadi.vertsplit(modes)) if mechanism.modes else (), channels, k)
    return TracedEquations(
        Symbols(x, modes, u, casadi.vertcat(p, energy)),
        trace("derivative", values, applied, k),
        trace("outputs", values, applied, energy, k),
        trace("clearance", values, applied, k),
        trace("jump", values, applied, channels, k),
        trace("energy", call("start", values, applied, k), k),
    )


def _functions(traces: TracedEquations, expressions: Mapping[str, Any]) -> list[Any]:
    """Return CasADi functions of the time and the symbols of ``traces``, by name, for `codegen.MachineCode`."""
    casadi = symbolic.library()
    arguments = [casadi.SX.sym("t"), *traces.symbols]
    return [casadi.Function(name, arguments, [e], {"cse": True}) for name, e in expressions.items()]


def run_functions(mechanism: Mechanism, switched: bool = False) -> list[Any]:
    """Return the equations that a run needs, as CasADi functions in the order of the indices DERIVATIVE to JUMP."""
    traces = expressions(mechanism, switched)
    return _functions(traces, {name: getattr(traces, name) for name in _NAMES})


class Machine:
    """Machine code of a mechanism's equations.

    Attributes
    ----------
    addresses : ndarray of int64
        Addresses of the functions, with the indices DERIVATIVE to JUMP.
    fingerprint : str
        Hash of the code.
    """

    def __init__(self, mechanism: Mechanism, switched: bool, lanes: int) -> None:
        from ..numerics.codegen import MachineCode

        self._code = MachineCode(run_functions(mechanism, switched), lanes, _IN_ROWS)
        self.addresses: NDArray[np.int64] = np.array([self._code.addresses[name] for name in _NAMES], dtype=np.int64)
        self.fingerprint = self._code.fingerprint


_MACHINES: dict[tuple[Mechanism, bool, int], Machine] = {}


def machine(mechanism: Mechanism, switched: bool = False, lanes: int = 1) -> Machine:
    """Return the machine code of a mechanism's equations for ``lanes`` states at once, compiled by the first call."""
    key = mechanism, switched, lanes
    if key not in _MACHINES:
        from ..numerics.codegen import MAKING

        with MAKING:
            if key not in _MACHINES:
                _MACHINES[key] = Machine(mechanism, switched, lanes)
    return _MACHINES[key]


@cache
def compile_outputs(mechanism: Mechanism, switched: bool, columns: tuple[int, ...], lanes: int) -> MachineCode:
    """Compile a function ``chosen`` that computes only the outputs with the indices ``columns``, which is faster."""
    from ..numerics.codegen import MAKING, MachineCode

    traces = expressions(mechanism, switched)
    with MAKING:
        return MachineCode(_functions(traces, {"chosen": traces.outputs[list(columns)]}), lanes, _IN_ROWS)
