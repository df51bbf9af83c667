"""Compiler classes with which Numba makes machine code once, of a kernel together with all functions that it calls.

By default Numba optimises each function with all that it calls, makes machine code of it, and does the same again for its
caller. Where Python calls only the kernel, nobody uses the code of the inner functions, and it takes a third of the time. Numba
has no public option for this: the classes below override private ones, hence the upper bound of its version. Nor does it
notice that a bit of machine code on disk has changed: here every file ends with a hash of its bytes.
"""

from __future__ import annotations

import ctypes
import io
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags

_HASH = hash(Flags())
_DIGEST = sha256().digest_size
_ALIVE: list[Any] = []


class _Options(Flags):
    """Numba's options with a fast comparison: Numba compares them at each call that it types."""

    def __eq__(self, other: object) -> bool:
        return self._values == other._values if isinstance(other, _Options) else bool(super().__eq__(other))

    def __hash__(self) -> int:
        return _HASH


class _Part(JITCodeLibrary):
    """Code of an inner function, which is optimised and turned into machine code only as part of a kernel."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True
        # Numba sets the address of a function's environment, though a function without Python objects does not read it
        engine = self.codegen._engine
        for variable in self._final_module.global_variables:
            if variable.name.startswith("_ZN08NumbaEnv") and not engine.is_symbol_defined(variable.name):
                _ALIVE.append(ctypes.c_void_p())
                engine.add_global_mapping(variable, ctypes.addressof(_ALIVE[-1]))


class KernelCompiler(Compiler):
    """Compiler of kernels, for `njit(pipeline_class=...)`."""

    def __init__(
        self, typing_context: Any, context: Any, library: Any, arguments: Any, result: Any, flags: Any, local: Any
    ) -> None:
        super().__init__(typing_context, context, library, arguments, result, _Options(flags), local)


class PartCompiler(KernelCompiler):
    """Compiler of the functions that kernels call, and Python cannot call."""

    def __init__(self, typing_context: Any, context: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing_context, context, library or _Part(context.codegen(), "part"), *rest)


class _Files(IndexDataCacheFile):
    """Files of a kernel's machine code, each with a hash of its bytes at its end, which is checked before Numba reads it."""

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[io.BytesIO]:
        with super()._open_for_write(path) as file:
            yield (content := io.BytesIO())
            file.write(content.getvalue() + sha256(content.getvalue()).digest())

    def _load_index(self) -> Any:
        if Path(self._index_path).exists():
            _check(Path(self._index_path))
        return super()._load_index()

    def _load_data(self, name: str) -> Any:
        _check(Path(self._data_path(name)))
        return super()._load_data(name)


def _check(path: Path) -> None:
    """Raise ValueError if the hash at the end of a file is not that of its bytes; Numba ignores the hash."""
    content = path.read_bytes()
    if sha256(content[:-_DIGEST]).digest() != content[-_DIGEST:]:
        raise ValueError(f"the bytes of {path.name} do not have their hash")


def keep(dispatcher: Any) -> None:
    """Keep the machine code of a dispatcher in files of Numba's cache folder, with hashes."""
    dispatcher.enable_caching()
    file = dispatcher._cache._cache_file
    file.__class__ = _Files
