"""Trace functions with CasADi, for exact derivatives of the equations without writing the equations a second time.

The code of the equations runs unchanged on symbols (`tracing`). The result can be differentiated to any order, evaluated
as a ``casadi.Function``, or compiled to machine code (`codegen`).
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .tracing import ReboundFunctions, rebind_functions

#: Functions of `math` that equations may use.
ELEMENTARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "fabs", "hypot",
    "pow",
)  # fmt: skip


def library() -> Any:
    """Return CasADi; the first call imports it, as the import takes a tenth of a second."""
    import casadi

    return casadi


def symbolic_functions(modules: tuple[ModuleType, ...], **others: Any) -> ReboundFunctions:
    """Return copies of the functions of ``modules`` for CasADi symbols; ``others`` replace further functions, by name."""
    casadi = library()
    functions = {name: _power if name == "pow" else getattr(casadi, name) for name in ELEMENTARY}
    return rebind_functions(modules, functions | others)


def _power(base: Any, exponent: Any) -> Any:
    """Return the power of a symbol; at base zero all derivatives of a positive power are zero, where CasADi's own are NaN.

    ``max(x, 0)**1.5`` then has its derivatives, which are zero, at every x below zero, too. Powers 1, 2 and 3 keep
    their true derivatives.
    """
    casadi = library()
    if isinstance(exponent, float | int) and float(exponent).is_integer():
        return casadi.power(base, exponent)
    none = (1.0 - casadi.fabs(casadi.sign(base))) * casadi.fmax(casadi.sign(exponent), 0.0)
    whole = sum((1.0 - casadi.fabs(casadi.sign(exponent - n))) * base**n for n in (1, 2, 3))
    return (1.0 - none) * casadi.power(base + none, exponent) + none * whole


def evaluate_arrays(function: Any, *arguments: Any) -> tuple[NDArray[np.float64], ...]:
    """Evaluate a ``casadi.Function`` with scalar outputs over arrays.

    Parameters
    ----------
    function : casadi.Function
    *arguments : array_like
        For a scalar input, a number or an array, all arrays of one shape; for a column input, one column used at all points.

    Returns
    -------
    tuple of ndarray
        One array for each output, of the shape of the argument arrays.
    """
    scalar = [function.numel_in(i) == 1 for i in range(function.n_in())]
    shape = np.broadcast_shapes(*(np.shape(a) for a, one in zip(arguments, scalar) if one))
    size = int(np.prod(shape))
    rows = [
        np.broadcast_to(np.asarray(a, float), shape).reshape(1, -1) if one else np.asarray(a, float).reshape(-1, 1)
        for a, one in zip(arguments, scalar)
    ]
    return tuple(np.asarray(out).reshape(shape) for out in function.map(size).call(rows))


def wrap_function(name: str, inputs: int, outputs: int, evaluate: Callable[..., tuple[Any, Any]]) -> Any:
    """Return a CasADi function that calls a Python function which cannot be traced.

    Parameters
    ----------
    name : str
    inputs, outputs : int
        Lengths of the columns that the function takes and returns.
    evaluate : callable
        ``evaluate(x, slopes)`` returns values (outputs,) and, if ``slopes`` is true, derivatives (outputs, inputs); both are
        NaN where the function has no value.

    Returns
    -------
    casadi.Callback
        The caller must keep a reference to this object as long as an expression contains it.
    """
    casadi = library()

    dense = casadi.Sparsity.dense

    class Slopes(casadi.Callback):  # type: ignore[misc, name-defined]
        def __init__(self, name: str, options: Any) -> None:
            casadi.Callback.__init__(self)
            self.construct(name, options)

        def get_n_in(self) -> int:
            return 2

        def get_sparsity_in(self, i: int) -> Any:
            return dense(inputs, 1) if i == 0 else casadi.Sparsity(outputs, 1)

        def get_sparsity_out(self, i: int) -> Any:
            return dense(outputs, inputs)

        def eval(self, arguments: Any) -> list[Any]:
            return [evaluate(np.asarray(arguments[0]).ravel(), True)[1]]

    class Values(casadi.Callback):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.slopes: Any = None
            self.construct(name, {})

        def get_sparsity_in(self, i: int) -> Any:
            return dense(inputs, 1)

        def get_sparsity_out(self, i: int) -> Any:
            return dense(outputs, 1)

        def eval(self, arguments: Any) -> list[Any]:
            return [evaluate(np.asarray(arguments[0]).ravel(), False)[0]]

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, name: str, _in: Any, _out: Any, options: Any) -> Any:
            self.slopes = Slopes(name, options)
            return self.slopes

    return Values()


def ipopt(name: str, program: dict[str, Any], **options: Any) -> Any:
    """Return an IPOPT solver, which prints nothing, for a nonlinear program given as CasADi expressions.

    The solver's ``stats()`` say whether it found a solution.
    """
    settings = {
        "print_time": False,
        "error_on_fail": False,
        "show_eval_warnings": False,
        "calc_lam_p": False,
        "ipopt": {"print_level": 0, "sb": "yes", **options},
    }
    return library().nlpsol(name, "ipopt", program, settings)
