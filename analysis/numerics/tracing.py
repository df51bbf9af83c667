"""The plant's own functions on other numbers than floats: the code objects as they stand, their globals bound anew.

The equations are straight lines of arithmetic that take ``sin``, ``cos``, ``sqrt``, ``atan2`` and ``tanh`` from `math`. With
these bound to those of another library the same code runs on CasADi's symbols, on NumPy's arrays, on dual numbers. The
modules themselves are not touched.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

#: What the plant's functions take from `math`.
ELEMENTARY = ("sin", "cos", "sqrt", "atan2", "tanh")


def rebound(modules: tuple[ModuleType, ...], elementary: Mapping[str, Any]) -> SimpleNamespace:
    """The functions of ``modules`` by name, on the numbers that ``elementary`` is for.

    Parameters
    ----------
    modules : tuple of modules
        Each may use the functions of those before it.
    elementary : mapping
        A function for each name of `ELEMENTARY`.
    """
    known: dict[str, Any] = dict(elementary)
    names: dict[str, Any] = {}
    for module in modules:
        space = dict(vars(module)) | {name: f for name, f in known.items() if name in vars(module)}
        for name, f in vars(module).items():
            if isinstance(f, FunctionType) and f.__module__ == module.__name__:
                space[name] = FunctionType(f.__code__, space, name, f.__defaults__)
                known[name] = space[name]
        names |= space
    return SimpleNamespace(**names)
