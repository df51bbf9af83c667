"""Numba compilers that make machine code only once, for a kernel together with all functions that it calls.

By default Numba optimises each function together with the functions that it calls, makes machine code, and does the same again
for its caller. If Python calls only the kernel, the separate machine code of the inner functions is never used, but takes a
third of the compile time. Numba has no public option to omit it: the classes below override private classes of Numba, hence
the upper bound of its version. Numba also does not notice damaged machine code on disk: here every file ends with a hash of
its bytes.

An installation may carry kernels *for any processor* whose lanes have the same width: Numba's output before LLVM optimises it.
This saves Numba's type inference, which takes most of the time. The final machine code is the same as if the kernel were
compiled from its source on that processor.
"""

from __future__ import annotations

import ctypes
import io
import os
import pickle
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

from llvmlite import binding
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

_HASH = hash(Flags())
_DIGEST = sha256().digest_size
#: Index of the type annotation in Numba's cache entry of a kernel, not counting the code.
_ANNOTATION = 5
_ALIVE: list[Any] = []


class _Options(Flags):
    """Numba's options with a fast comparison: Numba compares options at every call whose types it infers."""

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


class _Whole(JITCodeLibrary):
    """Code of a kernel with all functions that it calls, optimised without copies of loop bodies.

    LLVM copies the body of a loop, unrolled and with vectors, for the case that the loop is long. Loops of kernels are short,
    as long as a state or a row of elements, and kernels use vectors explicitly where these help. The copies take a third of
    the compile time and do not make kernels faster.
    """

    def _optimize_final_module(self) -> None:
        codegen = self._codegen
        cheap = codegen._module_pass_manager(loop_vectorize=False, slp_vectorize=False, opt=0, cost="cheap")
        options = binding.create_pipeline_tuning_options(speed_level=3)
        options.slp_vectorization, options.loop_vectorization, options.loop_unrolling = True, False, False
        builder = binding.create_pass_builder(codegen._tm, options)
        full = builder.getModulePassManager()
        full.add_refprune_pass()
        for passes, of in (cheap, (full, builder)):
            passes.run(self._final_module, of)


class KernelCompiler(Compiler):
    """Compiler of kernels, for `njit(pipeline_class=...)`."""

    def __init__(
        self, typing_context: Any, context: Any, library: Any, arguments: Any, result: Any, flags: Any, local: Any
    ) -> None:
        if library is None:
            library = _Whole(context.codegen(), "kernel")
            library.enable_object_caching()
        super().__init__(typing_context, context, library, arguments, result, _Options(flags), local)


class PartCompiler(KernelCompiler):
    """Compiler of functions that only kernels call; Python cannot call them."""

    def __init__(self, typing_context: Any, context: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing_context, context, library or _Part(context.codegen(), "part"), *rest)


class _Portable(_Whole):
    """Code of a kernel together with its form before optimisation, which is valid for any processor."""

    def _optimize_final_module(self) -> None:
        self.noted = self._final_module.as_bitcode()
        super()._optimize_final_module()


class PortableCompiler(KernelCompiler):
    """Compiler of kernels that also keeps their code for any processor."""

    def __init__(self, typing_context: Any, context: Any, library: Any, *rest: Any) -> None:
        library = _Portable(context.codegen(), "kernel")
        library.enable_object_caching()
        super().__init__(typing_context, context, library, *rest)


class _Unfinished(_Part):
    """Code of a kernel for another device, kept in its form before optimisation; no machine code of this processor is made."""

    def _optimize_final_module(self) -> None:
        self.noted = self._final_module.as_bitcode()


class LlvmCompiler(KernelCompiler):
    """Compiler of kernels for another device."""

    def __init__(self, typing_context: Any, context: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing_context, context, _Unfinished(context.codegen(), "kernel"), *rest)


def llvm_code(dispatcher: Any) -> tuple[bytes, str]:
    """Return the LLVM code of a kernel that `LlvmCompiler` has compiled, and the name of its function there."""
    (result,) = dispatcher.overloads.values()
    return result.library.noted, result.fndesc.llvm_func_name


def portable_code(dispatcher: Any) -> bytes:
    """Return the code for any processor of a kernel that `PortableCompiler` has compiled."""
    (result,) = dispatcher.overloads.values()
    (name, *_), *rest = result._reduce()
    rest[_ANNOTATION] = ""  # a text with the paths of the sources
    return _with_hash(zlib.compress(dumps((name, result.library.noted, *rest))))


def _read_portable_code(content: bytes) -> tuple[Any, ...]:
    """Return the entry of a kernel in Numba's cache, made from the kernel's code for any processor."""
    name, noted, *rest = pickle.loads(zlib.decompress(content))
    library = _Whole(cpu_target.target_context.codegen(), name)
    library.enable_object_caching()
    library._final_module = binding.parse_bitcode(noted)
    library._optimize_final_module()
    library._finalize_final_module()
    return library.serialize_using_object_code(), *rest


class _Files(IndexDataCacheFile):
    """Files of a kernel's machine code, each with a hash of its bytes at its end, which is checked before Numba reads it."""

    #: The kernel's code for any processor, from which the first files are made; there may be none.
    source: Path

    def load(self, key: Any) -> Any:
        found = super().load(key)
        if found is None and os.path.exists(self.source):
            try:
                found = _read_portable_code(_read_verified(self.source))
            except Exception as error:  # of the file, of pickle, zlib or LLVM
                warnings.warn(
                    f"{self.source} is not used ({error!r}): the kernel is compiled", RuntimeWarning, stacklevel=2
                )
                return None
            self.save(key, found)
        return found

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[io.BytesIO]:
        with super()._open_for_write(path) as file:
            yield (content := io.BytesIO())
            file.write(_with_hash(content.getvalue()))

    def _load_index(self) -> Any:
        if Path(self._index_path).exists():
            _read_verified(Path(self._index_path))
        return super()._load_index()

    def _load_data(self, name: str) -> Any:
        _read_verified(Path(self._data_path(name)))
        return super()._load_data(name)


def _with_hash(content: bytes) -> bytes:
    return content + sha256(content).digest()


def _read_verified(path: Path) -> bytes:
    """Return the content of a file without the hash at its end; raise ValueError if the hash does not match the content."""
    whole = path.read_bytes()
    content = whole[:-_DIGEST]
    if sha256(content).digest() != whole[-_DIGEST:]:
        raise ValueError(f"{path.name} is damaged: its bytes do not match the hash at its end")
    return content


class _Cache(FunctionCache):
    """Cache of a dispatcher from which code is read without Numba's types and functions, which only compiling needs.

    Loading them takes a third of a second, as Numba then also imports the linear algebra of SciPy.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


def keep(dispatcher: Any, source: Path) -> None:
    """Make Numba keep the machine code of a dispatcher in files with hashes; for ``source`` see `_Files`."""
    dispatcher.enable_caching()
    dispatcher._cache.__class__ = _Cache
    file = dispatcher._cache._cache_file
    file.__class__ = _Files
    file.source = source
