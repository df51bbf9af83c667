"""The plant's own functions traced with CasADi: exact derivatives of the one set of equations.

The code objects of `linkwork.five_bar.kinematics` and `linkwork.five_bar.dynamics` are called as they stand
(`tracing`). What is traced can be differentiated to any order, evaluated as a ``casadi.Function``, or written out
again as straight-line Python (`source`) for Numba to compile. CasADi is an extra: ``pip install 'linkwork[symbolic]'``.
"""

from __future__ import annotations

from types import ModuleType, SimpleNamespace
from typing import Any

from linkwork.errors import LinkworkError

from .tracing import ELEMENTARY, rebound


class MissingLibraryError(LinkworkError):
    """A library that is an extra is not installed."""


def library() -> Any:
    """CasADi.

    Raises
    ------
    MissingLibraryError
        If it is not installed.
    """
    try:
        import casadi
    except ImportError:
        raise MissingLibraryError(
            "exact derivatives need CasADi, which is not installed: pip install 'linkwork[symbolic]'"
        ) from None
    return casadi


def traced(modules: tuple[ModuleType, ...]) -> SimpleNamespace:
    """The functions of ``modules``, each of which may use those before it, for CasADi symbols in the place of floats."""
    casadi = library()
    return rebound(modules, {name: getattr(casadi, name) for name in ELEMENTARY})


def source(function: Any, name: str) -> str:
    """A ``casadi.Function`` of SX as straight-line Python that returns a tuple of floats.

    Parameters
    ----------
    function : casadi.Function
        Its inputs are the arguments, each a scalar or a column; columns become sequences with constant indices. Its outputs,
        which must be dense, follow one another in the result, matrices column by column.
    name : str
        Name of the Python function.

    Returns
    -------
    str
        Source that needs ``sin``, ``cos``, ``sqrt``, ``atan2``, ``tanh`` and ``fabs`` in its globals.

    Raises
    ------
    LinkworkError
        If an operation has no counterpart here.
    """
    casadi = library()
    binary = {
        casadi.OP_ADD: "{} + {}",
        casadi.OP_SUB: "{} - {}",
        casadi.OP_MUL: "{} * {}",
        casadi.OP_DIV: "{} / {}",
        casadi.OP_ATAN2: "atan2({}, {})",
    }
    unary = {
        casadi.OP_NEG: "-{}",
        casadi.OP_SQ: "{0} * {0}",
        casadi.OP_TWICE: "2.0 * {}",
        casadi.OP_INV: "1.0 / {}",
        casadi.OP_SIN: "sin({})",
        casadi.OP_COS: "cos({})",
        casadi.OP_SQRT: "sqrt({})",
        casadi.OP_TANH: "tanh({})",
        casadi.OP_FABS: "fabs({})",
        casadi.OP_ASSIGN: "{}",
    }
    arguments = [f"a{i}" for i in range(function.n_in())]
    sizes = [function.size1_out(i) * function.size2_out(i) for i in range(function.n_out())]
    if any(function.nnz_out(i) != size for i, size in enumerate(sizes)):
        raise LinkworkError(f"{name}: an output has structural zeros; make it dense with casadi.densify")
    first = [sum(sizes[:i]) for i in range(len(sizes))]
    results = [""] * sum(sizes)
    lines = [f"def {name}({', '.join(arguments)}):"]
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        ins, outs = function.instruction_input(k), function.instruction_output(k)
        if code == casadi.OP_INPUT:
            which, place = ins
            scalar = function.numel_in(which) == 1
            value = arguments[which] if scalar else f"{arguments[which]}[{place}]"
        elif code == casadi.OP_OUTPUT:
            which, place = outs
            results[first[which] + place] = f"r{first[which] + place}"
            lines.append(f"    r{first[which] + place} = w{ins[0]}")
            continue
        elif code == casadi.OP_CONST:
            value = repr(float(function.instruction_constant(k)))
        elif code in binary:
            value = binary[code].format(f"w{ins[0]}", f"w{ins[1]}")
        elif code in unary:
            value = unary[code].format(f"w{ins[0]}")
        else:
            raise LinkworkError(f"{name}: operation {code} of CasADi has no counterpart in straight-line Python")
        lines.append(f"    w{outs[0]} = {value}")
    lines.append(f"    return ({', '.join(results)},)")
    return "\n".join(lines) + "\n"
