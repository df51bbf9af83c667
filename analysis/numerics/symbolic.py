"""Functions traced with CasADi: exact derivatives of the one set of equations.

The code objects of the equations are called as they stand (`tracing`). What is traced can be differentiated to any order,
evaluated as a ``casadi.Function``, or turned into machine code (`codegen`).
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .tracing import Rebound, rebound

#: What equations may take from `math`.
ELEMENTARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "fabs", "hypot",
)  # fmt: skip


def library() -> Any:
    """CasADi, imported when it is first used: that takes a tenth of a second."""
    import casadi

    return casadi


def traced(modules: tuple[ModuleType, ...], **others: Any) -> Rebound:
    """The functions of ``modules`` for CasADi symbols in the place of floats; ``others`` are called by their names."""
    casadi = library()
    return rebound(modules, {name: getattr(casadi, name) for name in ELEMENTARY} | others)


def over(function: Any, *arguments: Any) -> tuple[NDArray[np.float64], ...]:
    """A ``casadi.Function`` with scalar outputs over arrays.

    Parameters
    ----------
    function : casadi.Function
    *arguments : array_like
        Arrays of one shape, or numbers, for its scalar inputs; columns for its columns, the same for all.

    Returns
    -------
    tuple of ndarray
        Its outputs, of that shape.
    """
    scalar = [function.numel_in(i) == 1 for i in range(function.n_in())]
    shape = np.broadcast_shapes(*(np.shape(a) for a, one in zip(arguments, scalar) if one))
    size = int(np.prod(shape))
    rows = [
        np.broadcast_to(np.asarray(a, float), shape).reshape(1, -1) if one else np.asarray(a, float).reshape(-1, 1)
        for a, one in zip(arguments, scalar)
    ]
    return tuple(np.asarray(out).reshape(shape) for out in function.map(size).call(rows))


def external(name: str, inputs: int, outputs: int, evaluate: Callable[..., tuple[Any, Any]]) -> Any:
    """A function of Python for CasADi, which does not trace it.

    Parameters
    ----------
    name : str
    inputs, outputs : int
        Lengths of its column and of what it returns.
    evaluate : callable
        ``evaluate(x, slopes)``: values (outputs,) and, with ``slopes``, derivatives (outputs, inputs); NaN where there are
        none.

    Returns
    -------
    casadi.Callback
        It must be kept as long as what is made of it.
    """
    casadi = library()

    class Slopes(casadi.Callback):  # type: ignore[misc, name-defined]
        def __init__(self, name: str, options: Any) -> None:
            casadi.Callback.__init__(self)
            self.construct(name, options)

        def get_n_in(self) -> int:
            return 2

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            return casadi.Sparsity.dense(inputs, 1) if i == 0 else casadi.Sparsity(outputs, 1)

        def get_sparsity_out(self, i: int) -> Any:
            return casadi.Sparsity.dense(outputs, inputs)

        def eval(self, arguments: Any) -> list[Any]:
            return [evaluate(np.asarray(arguments[0]).ravel(), True)[1]]

    class Values(casadi.Callback):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.slopes: Any = None
            self.construct(name, {})

        def get_n_in(self) -> int:
            return 1

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            return casadi.Sparsity.dense(inputs, 1)

        def get_sparsity_out(self, i: int) -> Any:
            return casadi.Sparsity.dense(outputs, 1)

        def eval(self, arguments: Any) -> list[Any]:
            return [evaluate(np.asarray(arguments[0]).ravel(), False)[0]]

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, name: str, _in: Any, _out: Any, options: Any) -> Any:
            self.slopes = Slopes(name, options)
            return self.slopes

    return Values()


def ipopt(name: str, program: dict[str, Any], **options: Any) -> Any:
    """IPOPT for a program of CasADi, without output of its own: where it finds nothing, its ``stats()`` say so."""
    return library().nlpsol(
        name,
        "ipopt",
        program,
        {
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,
            "calc_lam_p": False,
            "ipopt": {"print_level": 0, "sb": "yes", **options},
        },
    )
