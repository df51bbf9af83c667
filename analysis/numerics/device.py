"""Compile kernels together with the equations of a mechanism for graphics processors (CUDA).

A kernel for a device is a Numba function f(i, table). The number of the thread is i. The table holds the kernel's arguments
as integers: numbers, and the addresses of arrays. `pack` writes the table; the function that `reader` returns reads it.

Numba's code of the kernel, before LLVM optimises it, is linked with the equations, which are written for one lane without
calls of the C library (`lanes`), since a device has none. LLVM compiles both together. The arithmetic is that of IEEE 754 on
each device, so the same code compiled for this processor has the same results, which the tests use.
"""

from __future__ import annotations

import hashlib
import pickle
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import llvmlite
import numpy as np
from llvmlite import binding, ir
from numba import float64, int64, njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from linkwork.errors import LinkworkError

from . import lanes, linking
from .cache import code_folder, load_or_make, store_file
from .codegen import MAKING, Writer, fingerprint, own_source
from .lanes import DOUBLE, Vector

_LONG = ir.IntType(64)
_TABLE = _LONG.as_pointer()
#: The oldest devices for which code is made (Turing, the oldest that CUDA 13 supports), and their year.
ARCHITECTURE, _YEAR = "sm_75", 2018
_MEMORY = "if it lacks memory, a smaller batch may fit"
_TRIPLE = "nvptx64-nvidia-cuda"
#: Threads of a block: few, because a run needs many registers.
_THREADS = 64
#: Name of the function through which a kernel is called.
ENTRY = "linkwork_run"
#: Name, in the code of a kernel, of the array with the addresses of the equations.
_EQUATIONS = "linkwork_equations"


# Arguments of a kernel


def reader(kind: Any) -> Any:
    """Return a compiled function that reads a value of a Numba type from the table that `pack` has written.

    The type is made of tuples, arrays in the order of C, floats and integers.
    """

    @intrinsic
    def read(typing_context: Any, table: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            words = (builder.load(builder.gep(data, [_LONG(place)])) for place in range(1 << 30))
            return _read_value(context, builder, kind, words)

        return kind(table), generate

    return read


def _read_value(context: Any, builder: Any, kind: Any, words: Any) -> Any:
    if isinstance(kind, types.BaseTuple):
        return context.make_tuple(builder, kind, [_read_value(context, builder, k, words) for k in kind.types])
    if isinstance(kind, types.Array):
        address, *shape = (next(words) for _ in range(1 + kind.ndim))
        return _make_array(context, builder, kind, address, shape)
    return builder.bitcast(next(words), DOUBLE) if kind == float64 else next(words)


def _make_array(context: Any, builder: Any, kind: Any, address: Any, shape: Sequence[Any]) -> Any:
    array = context.make_array(kind)(context, builder)
    size = _LONG(context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [size]
    for count in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], count))
    context.populate_array(
        array,
        data=builder.inttoptr(address, array.data.type),
        shape=cgutils.pack_array(builder, shape),
        strides=cgutils.pack_array(builder, strides),
        itemsize=size,
        meminfo=None,
        parent=None,
    )
    return array._getvalue()


def pack(kind: Any, value: Any, place: Callable[[NDArray[Any]], int]) -> list[int]:
    """Return the table from which the function that `reader` returns reads ``value``; ``place`` gives an array's address."""
    if isinstance(kind, types.BaseTuple):
        return [word for k, v in zip(kind.types, value, strict=True) for word in pack(k, v, place)]
    if isinstance(kind, types.Array):
        return [place(value), *value.shape]
    return [struct.unpack("q", struct.pack("d", value))[0] if kind == float64 else int(value)]


@intrinsic
def equations(typing_context):
    """Return the addresses of the equations that the kernel is linked with, as an array."""

    def generate(context, builder, signature, arguments):
        if (array := builder.module.globals.get(_EQUATIONS)) is None:
            array = ir.GlobalVariable(builder.module, ir.ArrayType(_LONG, 0), _EQUATIONS)
        return _make_array(context, builder, int64[::1], builder.ptrtoint(array, _LONG), [_LONG(0)])

    return int64[::1](), generate


# Code of a kernel with equations


def compile_kernel(function: Any) -> tuple[bytes, str]:
    """Compile a function f(i, table) for any device; return its LLVM code and the name of the function there."""
    signature = types.void(int64, int64[::1])

    def make() -> bytes:
        made = njit(
            error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, pipeline_class=linking.LlvmCompiler
        )(function)
        made.compile(signature)
        return pickle.dumps(linking.llvm_code(made))

    with MAKING:
        code, name = pickle.loads(
            load_or_make(code_folder("llvm") / f"device-{fingerprint(function, signature)}", make)
        )
    return code, name


def link_kernel(code: bytes, name: str, functions: Sequence[Any], triple: str, machine: Any) -> Any:
    """Link the code of a kernel with CasADi functions of the form that `codegen.MachineCode` takes, and optimise it.

    Parameters
    ----------
    code, name
        As `compile_kernel` returns them.
    functions : sequence of casadi.Function
        The equations, in the order in which the kernel numbers them.
    triple : str
        LLVM's name of the device.
    machine : llvmlite.binding.TargetMachine

    Returns
    -------
    llvmlite.binding.ModuleRef
        Its function `ENTRY` is the kernel: for CUDA a function of the table, elsewhere of the thread's number and the table.
    """
    layout = str(machine.target_data)
    text = str(binding.parse_bitcode(code))
    for function in ("pow", "sin", "cos"):
        text = text.replace(f"@llvm.{function}.f64", f"@linkwork.{function}")
    module = binding.parse_assembly(text)
    module.triple, module.data_layout = triple, layout
    module.link_in(binding.parse_assembly(str(_write_equations(functions, name, triple, layout))))
    for n, found in enumerate((*module.functions, *module.global_variables)):
        if not found.is_declaration and found.name != ENTRY and not found.name.startswith("llvm."):
            # devices refuse long names
            found.linkage, found.name = "internal", f"part{n}"
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = options.loop_vectorization = options.loop_unrolling = False
    passes = binding.create_pass_builder(machine, options)
    passes.getModulePassManager().run(module, passes)
    return module


def _write_equations(functions: Sequence[Any], kernel: str, triple: str, layout: str) -> ir.Module:
    """Write the equations, their addresses, the elementary functions and the entry to the kernel."""
    module = ir.Module("equations")
    module.triple, module.data_layout = triple, layout
    for function in functions:
        Writer(module, function, own=True).write()
    _write_elementary_functions(module)
    addresses = [module.globals[function.name()].ptrtoint(_LONG) for function in functions]
    table = ir.GlobalVariable(module, ir.ArrayType(_LONG, len(addresses)), _EQUATIONS)
    table.initializer, table.global_constant = ir.Constant(table.type.pointee, addresses), True
    _write_entry(module, kernel)
    return module


def _write_elementary_functions(module: ir.Module) -> None:
    """Write the functions that the kernel and the equations call by the names of the C library or of LLVM."""

    def write(name: str, count: int, value: Callable[..., Vector]) -> None:
        kind = ir.FunctionType(DOUBLE, [DOUBLE] * count)
        function = module.globals.get(name) or ir.Function(module, kind, name)
        build = ir.IRBuilder(function.append_basic_block())
        build.ret(value(*(Vector(build, argument) for argument in function.args)).value)

    for name in ("sin", "cos"):
        write(f"linkwork.{name}", 1, lanes.FUNCTIONS[name])
        # angles that cannot be reduced exactly, see `lanes.GREATEST_ANGLE`
        write(name, 1, lambda x: Vector(x.build, lanes.constant(DOUBLE, float("nan"))))
    write("pow", 2, lanes.power)
    write("linkwork.pow", 2, lanes.FUNCTIONS["pow"])
    write("sqrt", 1, Vector.square_root)
    # no array on a device is Numba's own: there are no references to count
    pointer = ir.IntType(8).as_pointer()
    for name in ("NRT_incref", "NRT_decref"):
        function = ir.Function(module, ir.FunctionType(ir.VoidType(), [pointer]), name)
        ir.IRBuilder(function.append_basic_block()).ret_void()


def _write_entry(module: ir.Module, kernel: str) -> None:
    """Write the function `ENTRY`, which calls the kernel with the thread's number and the table, passed as Numba's array."""
    pointer, status = ir.IntType(8).as_pointer(), ir.IntType(32)
    cuda = module.triple == _TRIPLE
    array = [pointer, pointer, _LONG, _LONG, _TABLE, _LONG, _LONG]
    called = ir.Function(module, ir.FunctionType(status, [pointer, pointer, _LONG, *array]), kernel)
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [_TABLE] if cuda else [_LONG, _TABLE]), ENTRY)
    build = ir.IRBuilder(entry.append_basic_block())
    if cuda:
        parts = [
            lanes.declare_function(module, f"llvm.nvvm.read.ptx.sreg.{register}.x", status, 0)
            for register in ("ctaid", "ntid", "tid")
        ]
        block, threads, own = (build.zext(build.call(part, []), _LONG) for part in parts)
        thread = build.add(build.mul(block, threads), own)
        note = [entry, ir.MetaDataString(module, "kernel"), status(1)]
        module.add_named_metadata("nvvm.annotations", module.add_metadata(note))
    else:
        thread = entry.args[0]
    none, size, room = pointer(None), _LONG(8), [build.bitcast(build.alloca(pointer), pointer) for _ in range(2)]
    build.call(called, [*room, thread, none, none, _LONG(0), size, entry.args[-1], _LONG(0), size])
    build.ret_void()


# The device


def compile_to_ptx(kernel: tuple[bytes, str], functions: Sequence[Any]) -> bytes:
    """Compile a kernel with equations to PTX, which the driver of the device makes into its machine code."""

    def make() -> bytes:
        binding.initialize_all_targets()
        binding.initialize_all_asmprinters()
        machine = binding.Target.from_triple(_TRIPLE).create_target_machine(cpu=ARCHITECTURE, opt=3)
        module = link_kernel(*kernel, functions, _TRIPLE, machine)
        ptx: str = machine.emit_assembly(module)
        return ptx.encode()

    sources = own_source() + Path(__file__).read_bytes() + kernel[0]
    digest = hashlib.sha256(f"{llvmlite.__version__} {[f.serialize() for f in functions]}".encode() + sources)
    with MAKING:
        return load_or_make(code_folder("llvm") / f"ptx-{digest.hexdigest()}", make)


class Cuda:
    """A kernel with equations on a graphics processor, which CuPy drives.

    Parameters
    ----------
    function
        The kernel, as for `compile_kernel`.
    equations : sequence of casadi.Function

    Raises
    ------
    ImportError
        If CuPy is not installed.
    LinkworkError
        If there is no device, or the device does not take the code.
    """

    def __init__(self, function: Any, equations: Sequence[Any]) -> None:
        import cupy

        if not cupy.cuda.is_available():
            raise LinkworkError("there is no graphics processor that CUDA's driver can use: leave out device='cuda'")
        self._cupy = cupy
        with TemporaryDirectory() as folder:
            path = Path(folder, "kernel.ptx")
            store_file(path, compile_to_ptx(compile_kernel(function), equations))
            with _errors(cupy, f"it must be from {_YEAR} or later, with a driver that is not older"):
                self._run = cupy.RawModule(path=str(path)).get_function(ENTRY)

    def load(self, kind: Any, arguments: Any) -> LoadedKernel:
        """Copy the arguments, which have the Numba type ``kind``, to the device."""
        with _errors(self._cupy, _MEMORY):
            return LoadedKernel(self._cupy, self._run, kind, arguments)


class LoadedKernel:
    """A kernel with its arguments on the device, where the arrays stay; its methods raise LinkworkError if the device fails."""

    def __init__(self, cupy: Any, run: Any, kind: Any, arguments: Any) -> None:
        self._cupy, self._run = cupy, run
        self._copies: dict[int, Any] = {}

        def place(array: NDArray[Any]) -> int:
            self._copies[id(array)] = cupy.asarray(_as_bytes(array))
            return int(self._copies[id(array)].data.ptr)

        # the addresses in it are those of the copies, and arrays are told apart by their ids: all must stay alive
        self._table, self._arguments = cupy.asarray(np.array(pack(kind, arguments, place), dtype=np.int64)), arguments

    def run(self, threads: int) -> None:
        """Run ``threads`` threads of the kernel."""
        with _errors(self._cupy, _MEMORY):
            self._run((-(-threads // _THREADS),), (_THREADS,), (self._table,))

    def send(self, array: NDArray[Any]) -> None:
        """Copy an array of the arguments to the device again."""
        with _errors(self._cupy, _MEMORY):
            self._copies[id(array)].set(_as_bytes(array))

    def fetch(self, *arrays: NDArray[Any]) -> None:
        """Copy arrays, which are arguments of the kernel, back from the device."""
        with _errors(self._cupy, _MEMORY):
            for array in arrays:
                _as_bytes(array)[:] = self._copies[id(array)].get()


@contextmanager
def _errors(cupy: Any, advice: str) -> Iterator[None]:
    """Raise LinkworkError for errors of CUDA."""
    cuda = cupy.cuda
    try:
        yield
    except (cuda.runtime.CUDARuntimeError, cuda.driver.CUDADriverError, cuda.memory.OutOfMemoryError) as error:
        raise LinkworkError(f"the graphics processor failed ({error}): {advice}") from error


def _as_bytes(array: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the bytes of a contiguous array, not copied: CuPy has no arrays of records."""
    return array.reshape(-1).view(np.uint8)
