"""A graphics processor that is none: CuPy's functions, with the kernel compiled for this processor from the same code."""

import ctypes
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from llvmlite import binding

from analysis.numerics import device


class Processor:
    """The kernel and equations of a device compiled for this processor, called for one thread after the other."""

    def __init__(self, kernel: tuple[bytes, str], functions: Sequence[Any]) -> None:
        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        triple = binding.get_default_triple()
        cpu, features = binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()
        target = binding.Target.from_triple(triple)
        machine = target.create_target_machine(opt=3, jit=True, cpu=cpu, features=features)
        self.engine = binding.create_mcjit_compiler(device.link_kernel(*kernel, functions, triple, machine), machine)
        self.engine.finalize_object()
        address = self.engine.get_function_address(device.ENTRY)
        self.call = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p)(address)


class _Array:
    """An array in the memory of the device, a copy of the host's."""

    def __init__(self, array: np.ndarray) -> None:
        self.own = array.copy()
        self.data = SimpleNamespace(ptr=self.own.ctypes.data)

    def get(self) -> np.ndarray:
        return self.own.copy()

    def set(self, array: np.ndarray) -> None:
        self.own[:] = array


class Error(Exception):
    """An error of the driver."""


def cupy(functions: Any, *, available: bool = True) -> SimpleNamespace:
    """The module; ``functions`` are those of `Cuda`, and the kernel the one whose PTX is loaded."""

    class RawModule:
        def __init__(self, path: str) -> None:
            assert Path(path).read_text(encoding="utf-8").count(f".entry {device.ENTRY}(") == 1

        def get_function(self, name: str) -> Any:
            assert name == device.ENTRY

            def launch(grid: tuple[int], block: tuple[int], arguments: tuple[_Array]) -> None:
                for thread in range(grid[0] * block[0]):
                    functions.call(thread, arguments[0].data.ptr)

            return launch

    errors = SimpleNamespace(CUDARuntimeError=Error, CUDADriverError=Error, OutOfMemoryError=Error)
    cuda = SimpleNamespace(is_available=lambda: available, runtime=errors, driver=errors, memory=errors)
    return SimpleNamespace(cuda=cuda, RawModule=RawModule, asarray=_Array)
