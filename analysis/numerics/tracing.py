"""Run the plant's functions on symbols, arrays or dual numbers: copies with the same code and other elementary functions.

The equations consist of arithmetic and functions of `math`, without branches. With another library's functions in place of
`math`, the same code runs on CasADi's symbols, NumPy's arrays and dual numbers. The plant's modules are not changed.
"""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Mapping
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

from linkwork.errors import LinkworkError


class ReboundFunctions(SimpleNamespace):
    """Copies of functions that calculate with symbols, arrays or dual numbers instead of floats, as attributes by name.

    If two modules have a function of the same name, the attribute is that of the later module. Methods are found by `find`
    only.
    """

    def __init__(self, functions: Mapping[Callable[..., Any], FunctionType]) -> None:
        super().__init__(**{f.__name__: f for f in functions.values() if "." not in f.__qualname__})
        self._functions = functions

    def find(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the copy of an original function or method.

        Raises
        ------
        LinkworkError
            If the function is in none of the modules.
        """
        if function not in self._functions:
            name = f"{function.__module__}.{function.__qualname__}"
            raise LinkworkError(f"{name} is in none of the modules of the mechanism: its module must be one of them")
        return self._functions[function]


def rebind_functions(modules: tuple[ModuleType, ...], elementary: Mapping[str, Any]) -> ReboundFunctions:
    """Return copies of the functions of ``modules`` that calculate with symbols, arrays or dual numbers instead of floats.

    Parameters
    ----------
    modules : tuple of modules
        Modules whose functions are copied. A function that one of these modules imports by name from another of them is
        replaced by its copy.
    elementary : mapping
        Replacements, for symbols, arrays or dual numbers, of functions of `math` and of built-in functions, by their names.
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
    return ReboundFunctions(functions)
