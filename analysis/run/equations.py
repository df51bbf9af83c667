"""The equations of a mechanism traced with CasADi, and from that trace their machine code."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.mechanism import Mechanism

from ..numerics import symbolic

#: The functions that a run needs, by their numbers among `Machine.addresses`.
DERIVATIVE, OUTPUTS, CLEARANCE, JUMP = range(4)
_NAMES = ("derivative", "outputs", "clearance", "jump")


@cache
def traced(mechanism: Mechanism) -> SimpleNamespace:
    """The functions of the mechanism's modules by name, for CasADi symbols in the place of floats."""
    return symbolic.traced(mechanism.modules)


def constants(mechanism: Mechanism, name: str = "p") -> tuple[Any, Any]:
    """A column of symbols for the constants of the equations, and the same as the NamedTuple that they take."""
    kind = _constants(mechanism)
    p = symbolic.library().SX.sym(name, len(kind._fields))
    return p, kind(*symbolic.library().vertsplit(p))


@cache
def _constants(mechanism: Mechanism) -> Any:
    return type(next(iter(mechanism.published.values())).parameters.constants())


class Symbols(NamedTuple):
    """Columns of symbols: state, modes, channels, and constants with the mechanical energy at the start after them."""

    x: Any
    modes: Any
    u: Any
    p: Any


class Traced(NamedTuple):
    """The equations as functions of `Symbols`: expressions of CasADi, each a column."""

    symbols: Symbols
    derivative: Any
    outputs: Any
    clearance: Any
    jump: Any
    energy: Any


@cache
def expressions(mechanism: Mechanism) -> Traced:
    """The equations as expressions in the channels and modes that a run knows."""
    casadi = symbolic.library()
    functions = traced(mechanism)
    x = casadi.SX.sym("x", mechanism.size)
    modes = casadi.SX.sym("modes", len(mechanism.modes))
    u = casadi.SX.sym("u", len(mechanism.channels))
    p, k = constants(mechanism)
    energy = casadi.SX.sym("start_energy")
    values, channels = tuple(casadi.vertsplit(x)), tuple(casadi.vertsplit(u)) if mechanism.channels else ()

    def of(what: str, *arguments: Any) -> Any:
        result = getattr(functions, getattr(mechanism.equations, what).__name__)(*arguments)
        return casadi.densify(casadi.vertcat(*result) if isinstance(result, tuple) else casadi.SX(result))

    applied = getattr(functions, mechanism.equations.applied.__name__)(
        tuple(casadi.vertsplit(modes)) if mechanism.modes else (), channels, k
    )
    return Traced(
        Symbols(x, modes, u, casadi.vertcat(p, energy)),
        of("derivative", values, applied, k),
        of("outputs", values, applied, energy, k),
        of("clearance", values, applied, k),
        of("jump", values, applied, channels, k),
        of("energy", getattr(functions, mechanism.equations.start.__name__)(values, applied, k), k),
    )


class Machine:
    """Machine code of a mechanism's equations, and what is derived once from parameters for it.

    Attributes
    ----------
    addresses : ndarray of int64
        Of the functions, by DERIVATIVE and its kin.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        from ..numerics.codegen import MachineCode

        casadi = symbolic.library()
        traces = expressions(mechanism)
        t = casadi.SX.sym("t")
        arguments = [t, *traces.symbols]
        self._code = MachineCode(
            [casadi.Function(name, arguments, [getattr(traces, name)], {"cse": True}) for name in _NAMES]
        )
        self.addresses: NDArray[np.int64] = np.array([self._code.addresses[name] for name in _NAMES], dtype=np.int64)
        self.fingerprint = self._code.fingerprint


_MACHINES: dict[Mechanism, Machine] = {}


def machine(mechanism: Mechanism) -> Machine:
    """The machine code of a mechanism's equations, made when it is first asked for, by one thread."""
    if mechanism not in _MACHINES:
        from ..numerics.codegen import MAKING

        with MAKING:
            if mechanism not in _MACHINES:
                _MACHINES[mechanism] = Machine(mechanism)
    return _MACHINES[mechanism]
