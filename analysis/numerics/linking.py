"""How Numba compiles the functions that kernels call: machine code is made once, of a kernel with all that it calls.

Numba optimises each function with all that it calls, makes machine code of that, and does the same again for its caller. That
code is for nobody, where only a kernel is called from Python: it took a third of a kernel's compilation.
"""

from __future__ import annotations

import ctypes
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags

_HASH = hash(Flags())
_ALIVE: list[Any] = []


class _Options(Flags):
    """Numba's options, which it compares whenever it looks for the type of a call: by what is set, not one after the other."""

    def __eq__(self, other: object) -> bool:
        return self._values == other._values if isinstance(other, _Options) else bool(super().__eq__(other))

    def __hash__(self) -> int:
        return _HASH


class _Part(JITCodeLibrary):
    """Code that is neither optimised nor made machine code of where it stands, but where it is linked into a kernel."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True
        # Numba writes the address of a function's environment, which a function without Python objects does not read
        engine = self.codegen._engine
        for variable in self._final_module.global_variables:
            if variable.name.startswith("_ZN08NumbaEnv") and not engine.is_symbol_defined(variable.name):
                _ALIVE.append(ctypes.c_void_p())
                engine.add_global_mapping(variable, ctypes.addressof(_ALIVE[-1]))


class OfKernels(Compiler):
    """Numba's compiler, for `njit(pipeline_class=...)`."""

    def __init__(
        self, typing_context: Any, context: Any, library: Any, arguments: Any, result: Any, flags: Any, local: Any
    ) -> None:
        super().__init__(typing_context, context, library, arguments, result, _Options(flags), local)


class OfParts(OfKernels):
    """The same for the functions that kernels call, which Python cannot."""

    def __init__(self, typing_context: Any, context: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing_context, context, library or _Part(context.codegen(), "part"), *rest)
