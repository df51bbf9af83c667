"""The plant's own functions on other numbers than floats: the code objects as they stand, their globals bound anew.

The equations are straight lines of arithmetic that take what is not arithmetic from `math`. With that bound to the functions
of another library the same code runs on CasADi's symbols, on NumPy's arrays, on dual numbers. The modules themselves are not
touched.
"""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Mapping
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

from linkwork.errors import LinkworkError


class Rebound(SimpleNamespace):
    """Functions by name; of two of one name that of the later module. Methods of classes by `of` alone."""

    def __init__(self, functions: Mapping[Callable[..., Any], FunctionType]) -> None:
        super().__init__(**{f.__name__: f for f in functions.values() if "." not in f.__qualname__})
        self._functions = functions

    def of(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """What became of a function.

        Raises
        ------
        LinkworkError
            If it stands in none of the modules.
        """
        if function not in self._functions:
            name = f"{function.__module__}.{function.__qualname__}"
            raise LinkworkError(f"{name} is in none of the modules of the mechanism: its module must be one of them")
        return self._functions[function]


def rebound(modules: tuple[ModuleType, ...], elementary: Mapping[str, Any]) -> Rebound:
    """The functions of ``modules``, on the numbers that ``elementary`` is for.

    Parameters
    ----------
    modules : tuple of modules
        Their functions call each other's where they are imported by name.
    elementary : mapping
        Functions by the names that they have in `math`, or among the built-in ones.
    """
    spaces = [dict(vars(module)) for module in modules]
    functions: dict[Callable[..., Any], FunctionType] = {}
    for module, space in zip(modules, spaces):
        own = [value for value in vars(module).values() if getattr(value, "__module__", None) == module.__name__]
        methods = [f for value in own if isinstance(value, type) for f in vars(value).values()]
        for f in (*own, *methods):
            if isinstance(f, FunctionType) and f.__globals__ is vars(module) and f.__closure__ is None:
                functions[f] = FunctionType(f.__code__, space, f.__name__, f.__defaults__)
                functions[f].__kwdefaults__ = f.__kwdefaults__
                functions[f].__qualname__ = f.__qualname__
    for space in spaces:
        space |= {name: f for name, f in elementary.items() if hasattr(builtins, name)}
        for name, value in space.items():
            if value is math:
                space[name] = SimpleNamespace(**{**vars(math), **elementary})
            elif name in elementary:
                space[name] = elementary[name]
            elif isinstance(value, FunctionType) and value in functions:
                space[name] = functions[value]
    return Rebound(functions)
