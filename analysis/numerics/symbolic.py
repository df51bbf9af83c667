"""Functions traced with CasADi: exact derivatives of the one set of equations.

The code objects of the equations are called as they stand (`tracing`). What is traced can be differentiated to any order,
evaluated as a ``casadi.Function``, or turned into machine code (`codegen`).
"""

from __future__ import annotations

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
