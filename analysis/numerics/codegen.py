"""Machine code of functions traced with CasADi, and Numba kernels that call them by address.

A ``casadi.Function`` of symbols is a list of elementary instructions. The instructions are translated to LLVM's and compiled in
some hundredths of a second. The machine code is kept on disk under a hash of the instructions, the processor and this module,
so that it cannot be out of date. Every function has the form

    f(t, a, b, c, d, out)        t a float, the others arrays of floats

so that a kernel, compiled once, works with the functions of any mechanism. With several lanes each entry of an array is a
vector of doubles, one for each lane, and the functions of `lanes` replace those of the C library. Kernels are kept on disk in a
folder whose name is a hash of all their sources.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import errno
import hashlib
import shutil
import sys
import sysconfig
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from threading import RLock
from types import CodeType, ModuleType
from typing import Any, ClassVar

import llvmlite
import numba
import numpy as np
from llvmlite import binding, ir
from numba import float64, int64, njit, types
from numba.core import event
from numba.extending import intrinsic
from numba.np.unsafe.ndarray import to_fixed_tuple

from linkwork.errors import LinkworkError

from . import lanes as vectors
from . import linking
from .cache import code_folder, load_or_make, lock_folder, store_file
from .symbolic import ELEMENTARY, library

VECTOR = float64[::1]
MATRIX = float64[:, ::1]
CUBE = float64[:, :, ::1]

_DOUBLE = vectors.DOUBLE
_ARGUMENTS = [_DOUBLE, *[_DOUBLE.as_pointer()] * 5]

# Machine code of functions

#: Lock that is held while code is compiled, so that threads compile it once and each finds it complete.
MAKING = RLock()
_ALIVE: list[Any] = []


class MachineCode:
    """Machine code of CasADi functions, kept in memory until the process ends, because callers keep its addresses.

    Parameters
    ----------
    functions : sequence of casadi.Function
        Functions of SX symbols with the inputs (t, a, b, c, d) and dense outputs. The outputs follow one another in
        ``out``, matrices column by column.
    lanes : int
        Number of sets of arguments that a call evaluates at once. With several lanes each entry of an array is a vector, and t
        is the same for all lanes.
    rows : sequence of str
        Names of the functions whose outputs are read lane by lane: all outputs of the first lane are written first, then those
        of the next lane. On some processors gathering a lane's outputs afterwards takes longer than computing them.

    Attributes
    ----------
    addresses : dict of str to int
        Address of each function by its name.
    fingerprint : str
        Hash of the instructions, the processor and this module.

    Raises
    ------
    LinkworkError
        If an operation of CasADi is not supported, or an output is not dense.
    """

    def __init__(self, functions: Sequence[Any], lanes: int = 1, rows: Sequence[str] = ()) -> None:
        _prepare()
        triple, cpu = binding.get_default_triple(), binding.get_host_cpu_name()
        features = binding.get_host_cpu_features().flatten()
        digest = hashlib.sha256(
            f"{llvmlite.__version__} {triple} {cpu} {features} {lanes} {rows}".encode() + own_source()
        )
        digest.update(" ".join(function.serialize() for function in functions).encode())
        self.fingerprint = digest.hexdigest()
        machine = binding.Target.from_default_triple().create_target_machine(
            opt=3, jit=True, cpu=cpu, features=features
        )
        code = load_or_make(
            code_folder("llvm") / self.fingerprint,
            lambda: _compile(functions, lanes, rows, triple, machine),
        )
        engine = binding.create_mcjit_compiler(binding.parse_assembly(f'target triple = "{triple}"'), machine)
        engine.add_object_file(binding.ObjectFileRef.from_data(code))
        engine.finalize_object()
        _ALIVE.append(engine)
        self.addresses = {f.name(): engine.get_function_address(f.name()) for f in functions}


def _compile(functions: Sequence[Any], lanes: int, rows: Sequence[str], triple: str, machine: Any) -> bytes:
    """Compile functions; return the object file."""
    module = ir.Module("linkwork")
    module.triple = triple
    for function in functions:
        Writer(module, function, lanes, function.name() in rows).write()
    parsed = binding.parse_assembly(str(module))
    passes = binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(speed_level=2))
    passes.getModulePassManager().run(parsed, passes)
    code: bytes = machine.emit_object(parsed)
    return code


@cache
def own_source() -> bytes:
    """Return the sources of this module and of `lanes`, on which machine code depends."""
    return Path(__file__).read_bytes() + Path(vectors.__file__).read_bytes()


#: Functions of the C library by CasADi's operations.
_FUNCTIONS = {f"OP_{name.upper()}": name for name in ELEMENTARY} | {"OP_CONSTPOW": "pow"}
_INTRINSICS = {"sqrt": "llvm.sqrt.f64", "fabs": "llvm.fabs.f64"}


@cache
def _operations() -> dict[int, str]:
    """Return the names of CasADi's operations by code."""
    casadi = library()
    return {getattr(casadi, name): name for name in dir(casadi) if name.startswith("OP_")}


@cache
def _prepare() -> None:
    """Start LLVM, and give it the addresses of the C library's functions."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else ctypes.util.find_library("m"))
    for name in set(_FUNCTIONS.values()):
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        if not address:
            raise LinkworkError(f"the C library of this machine has no function {name}")
        binding.add_symbol(name, address)


class Writer:
    """Translator of one CasADi function into LLVM code, added to a module.

    The arguments are those of `MachineCode`; ``own`` is true if the functions of `lanes` replace those of the C library even
    with one lane.
    """

    def __init__(
        self,
        module: ir.Module,
        function: Any,
        lanes: int = 1,
        in_rows: bool = False,
        *,
        own: bool = False,
    ) -> None:
        self.module = module
        self.source = function
        self.lanes = lanes
        self.in_rows = in_rows and lanes > 1
        self.own = own or lanes > 1
        self.kind = vectors.vector(lanes)
        self.reciprocals: dict[int, tuple[Any, Any]] = {}
        target = ir.Function(module, ir.FunctionType(ir.VoidType(), _ARGUMENTS), function.name())
        for argument in target.args[1:]:
            argument.add_attribute("noalias")
        self.arguments = target.args
        self.build = build = ir.IRBuilder(target.append_basic_block())
        self.plain: dict[str, Callable[..., Any]] = {
            "OP_ADD": build.fadd,
            "OP_SUB": build.fsub,
            "OP_MUL": build.fmul,
            "OP_DIV": self._quotient,
            "OP_NEG": build.fneg,
            "OP_SQ": lambda a: build.fmul(a, a),
            "OP_TWICE": lambda a: build.fadd(a, a),
            "OP_INV": self._reciprocal,
            "OP_ASSIGN": lambda a: a,
            "OP_SIGN": self._sign,
            "OP_FMAX": lambda a, b: build.select(build.fcmp_ordered("<", a, b), b, a),
        }

    def write(self) -> None:
        """Translate all instructions."""
        f, build = self.source, self.build
        sizes = [f.size1_out(i) * f.size2_out(i) for i in range(f.n_out())]
        if any(f.nnz_out(i) != size for i, size in enumerate(sizes)):
            raise LinkworkError(f"{f.name()}: an output has structural zeros; make it dense with casadi.densify")
        first = np.cumsum([0, *sizes])
        casadi = library()
        values: dict[int, Any] = {}
        for k in range(f.n_instructions()):
            code, ins, outs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
            if code == casadi.OP_INPUT:
                values[outs[0]] = self._input(*ins)
            elif code == casadi.OP_OUTPUT:
                which, place = outs
                self._store(values[ins[0]], int(first[which]) + place, int(first[-1]))
            elif code == casadi.OP_CONST:
                values[outs[0]] = self._constant(f.instruction_constant(k))
            else:
                values[outs[0]] = self._operation(code, [values[i] for i in ins])
        build.ret_void()

    def _place(self, which: int, place: int) -> Any:
        """Return a pointer to entry ``place`` of argument ``which`` (indices), or to the vector of its values in all lanes."""
        pointer = self.build.gep(self.arguments[which], [_index(place * self.lanes)])
        return self.build.bitcast(pointer, self.kind.as_pointer())

    def _store(self, value: Any, place: int, count: int) -> None:
        """Write ``value`` as output number ``place`` of ``count`` outputs."""
        if not self.in_rows:
            self.build.store(value, self._place(5, place), align=8)
            return
        for lane in range(self.lanes):
            target = self.build.gep(self.arguments[5], [_index(count * lane + place)])
            self.build.store(self.build.extract_element(value, _index(lane)), target)

    def _input(self, which: int, place: int) -> Any:
        """Return entry ``place`` of argument ``which`` (indices) in each lane."""
        if which == 0:
            return self._repeat(self.arguments[0])
        return self.build.load(self._place(which, place), align=8)

    def _repeat(self, number: Any) -> Any:
        """Return a vector with the same number in each lane."""
        return vectors.repeat_number(self.build, number, self.lanes)

    def _constant(self, value: float) -> Any:
        return vectors.constant(self.kind, float(value))

    def _operation(self, code: int, operands: list[Any]) -> Any:
        operation = _operations().get(code, str(code))
        if operation in self.plain:
            return self.plain[operation](*operands)
        name = _FUNCTIONS.get(operation)
        if name is None:
            raise LinkworkError(
                f"{self.source.name()}: CasADi's operation {operation} cannot be compiled; equations consist of "
                "arithmetic and functions such as sin, sqrt, exp"
            )
        if self.own:
            return vectors.FUNCTIONS[name](*(vectors.Vector(self.build, value) for value in operands)).value
        name = _INTRINSICS.get(name, name)
        return self.build.call(vectors.declare_function(self.module, name, self.kind, len(operands)), operands)

    def _quotient(self, a: Any, b: Any) -> Any:
        if not self.own:
            return self.build.fdiv(a, b)
        # a division takes as long as sixteen products, and equations often divide by the same value again
        return self.build.fmul(a, self._reciprocal(b))

    def _reciprocal(self, a: Any) -> Any:
        if id(a) not in self.reciprocals:
            # keep a, so that no other value gets its id
            self.reciprocals[id(a)] = a, self.build.fdiv(self._constant(1.0), a)
        return self.reciprocals[id(a)][1]

    def _sign(self, a: Any) -> Any:
        zero, one, less = map(self._constant, (0.0, 1.0, -1.0))
        negative = self.build.select(self.build.fcmp_ordered("<", a, zero), less, zero)
        return self.build.select(self.build.fcmp_ordered(">", a, zero), one, negative)


def _index(place: int) -> Any:
    return ir.Constant(ir.IntType(32), place)


# Calls from kernels


@intrinsic
def evaluate(typing_context, address, t, a, b, c, d, out):
    """Call a function of `MachineCode` by its address."""

    def generate(context, builder, signature, arguments):
        pointers = [
            context.make_array(kind)(context, builder, array).data
            for kind, array in zip(signature.args[2:], arguments[2:])
        ]
        kind = ir.FunctionType(ir.VoidType(), _ARGUMENTS).as_pointer()
        builder.call(builder.inttoptr(arguments[0], kind), [arguments[1], *pointers])
        return context.get_dummy_value()

    return types.void(int64, float64, a, b, c, d, out), generate


@intrinsic
def call_user(typing_context, address, t, x):
    """Return the value of a user's C function f(t, x) of a float and an array of floats, given by its address."""

    def generate(context, builder, signature, arguments):
        kind = ir.FunctionType(_DOUBLE, _ARGUMENTS[:2]).as_pointer()
        data = context.make_array(signature.args[2])(context, builder, arguments[2]).data
        return builder.call(builder.inttoptr(arguments[0], kind), [arguments[1], data])

    return float64(int64, float64, x), generate


def user_function(function: Any, size: int) -> Any:
    """Compile a user's function f(t, x1, ..., x_size) to a C function of t and x; an exception becomes the value NaN."""
    own = njit(error_model="numpy")(getattr(function, "py_func", function))

    @njit(error_model="numpy")
    def spread(t, x):
        return own(t, *to_fixed_tuple(numba.carray(x, (size,)), size))

    @numba.cfunc(float64(float64, types.CPointer(float64)), error_model="numpy")
    def guarded(t, x):
        try:
            return spread(t, x)
        except Exception:
            return np.nan

    return guarded


# Kernels

_PART: dict[str, Any] = {
    "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": linking.PartCompiler
}  # fmt: skip
#: Decorator of functions that kernels call, and Python cannot call.
part = njit(**_PART)
#: As `part`, for functions that make no arrays: counting the references to their arguments would cost more than their work.
inner = njit(**_PART, _nrt=False)
#: As `part`, for functions whose value is valid only within their caller: Numba inlines them before it infers types.
inline = njit(**_PART, _nrt=False, inline="always")


@inner
def copy(source, target):
    """Copy a vector; ``target[:] = source`` takes a second longer to compile, because of its error message about shapes."""
    for i in range(target.shape[0]):
        target[i] = source[i]


def kernel(*signature: Any, purpose: str) -> Callable[[Callable[..., Any]], Kernel]:
    """Return a decorator that compiles a function when it is first called, and keeps the machine code on disk.

    Parameters
    ----------
    *signature
        Types of the arguments, or Numba's signature.
    purpose : str
        End of the message "compiling ...", printed once on standard error when the function is not found on disk.
    """

    def decorate(function: Callable[..., Any]) -> Kernel:
        return Kernel(function, signature, purpose)

    return decorate


#: Code of kernels for any processor, which an installation carries: see `linking`.
CARRIED = Path(__file__).parent / "kernels"


class Kernel:
    """A function that is compiled, or read from the cache, when it is first called."""

    #: All kernels.
    known: ClassVar[list[Kernel]] = []

    def __init__(self, function: Any, signature: tuple[Any, ...], purpose: str) -> None:
        self.known.append(self)
        self.py_func = function
        self.signature = signature
        self.purpose = purpose
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self._compiled: Any = None

    @property
    def compiled(self) -> Any:
        """Numba's dispatcher, compiled or read from disk."""
        with MAKING:
            if self._compiled is None:
                folder = code_folder(f"numba-{self._fingerprint()}")
                try:
                    self._compiled = self._compile(folder)
                except Exception as error:
                    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS):
                        sys.stderr.write(f"linkwork: {folder}: {error.strerror}: compiled code is not kept\n")
                        self._compiled = self._compile(None)
                        return self._compiled
                    # an error of `linking`, or of any kind where a file is too short
                    with lock_folder(folder):
                        if not any(folder.glob("**/*.nb[ic]")):
                            raise
                        warnings.warn(
                            f"the compiled code in {folder} is damaged ({error!r}): it is compiled again",
                            RuntimeWarning,
                            stacklevel=3,
                        )
                        shutil.rmtree(folder)
                        folder.mkdir(mode=0o700)
                        self._compiled = self._compile(folder)
        return self._compiled

    def _compile(self, folder: Path | None) -> Any:
        """Compile the kernel, and keep its code in a folder unless the folder is None."""
        before = numba.config.CACHE_DIR
        if folder is not None:
            numba.config.CACHE_DIR = str(folder)
        try:
            with _announce(self.purpose):
                made = self._dispatcher(linking.KernelCompiler)
                if folder is not None:
                    linking.keep(made, self.carried_path)
                made.compile(*self.signature)
                made.disable_compile()
                return made
        finally:
            numba.config.CACHE_DIR = before

    def carry(self) -> Path:
        """Compile the kernel for any processor, write the code to `carried_path`, and return that path."""
        made, path = self._dispatcher(linking.PortableCompiler), self.carried_path
        made.compile(*self.signature)
        path.parent.mkdir(exist_ok=True)
        store_file(path, linking.portable_code(made))
        return path

    def _dispatcher(self, compiler: type) -> Any:
        return njit(error_model="numpy", nogil=True, no_cfunc_wrapper=True, pipeline_class=compiler)(self.py_func)

    def _fingerprint(self) -> str:
        return fingerprint(self.py_func, self.signature)[:16]

    @property
    def carried_path(self) -> Path:
        """Path of the code for any processor, which is valid for one build of Python, one LLVM and one operating system."""
        build = sysconfig.get_config_var("SOABI") or sysconfig.get_config_var("EXT_SUFFIX")
        kind = f"{build}-llvm{binding.llvm_version_info[0]}-{binding.get_process_triple()}"
        return CARRIED / f"{self.__name__}-{self._fingerprint()}-{kind}"

    def __call__(self, *arguments: Any) -> Any:
        return (self._compiled or self.compiled)(*arguments)

    @cached_property
    def unchecked(self) -> Callable[..., Any]:
        """Return the machine code, which does not check the types of its arguments and misreads arguments of other types.

        Numba's check of the types takes 7 us; in the tests it is made here, too. Finding the machine code takes 26 us, and is
        therefore done once.
        """
        (made,) = self.compiled.overloads.values()
        return made.entry_point  # type: ignore[no-any-return]


class _Announcer(event.Listener):
    """Listener that announces a compilation: once for all functions with the same purpose."""

    said: ClassVar[set[str]] = set()

    def __init__(self, purpose: str) -> None:
        self.purpose = purpose

    def on_start(self, event: Any) -> None:
        if self.purpose not in self.said:
            sys.stderr.write(f"linkwork: compiling {self.purpose}, once on this machine ...\n")
            self.said.add(self.purpose)

    def on_end(self, event: Any) -> None:
        pass


@contextmanager
def _announce(purpose: str) -> Iterator[None]:
    with event.install_listener("numba:compile", _Announcer(purpose)):
        yield


def fingerprint(function: Any, signature: Any = None) -> str:
    """Return a hash of all that a compiled function depends on.

    The hash covers the function's code, all functions and constants that the function uses, and Numba's options. It also covers
    the sources of Linkwork's modules that define them, since the code does not show the fields of a NamedTuple, for instance.
    """
    digest = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {np.__version__} {signature}".encode())
    seen: set[int] = set()
    files = {Path(__file__), Path(linking.__file__)}

    def add(value: Any) -> None:
        """Add a value to the hash, and all objects to which the value refers."""
        digest.update(repr(sorted(getattr(value, "targetoptions", {}).items(), key=str)).encode())
        value = getattr(value, "py_func", getattr(value, "_defn", value))
        if isinstance(value, ModuleType):
            digest.update(value.__name__.encode())
            note(value.__name__)
        elif isinstance(value, np.ndarray):
            digest.update(f"{value.dtype} {value.shape}".encode() + value.tobytes())
        elif isinstance(value, (tuple, list)):
            for item in value:
                add(item)
        elif isinstance(value, (set, frozenset)):
            add(sorted(value, key=str))
        elif isinstance(value, type):
            digest.update(f"{value.__qualname__} {getattr(value, '_fields', '')}".encode())
            note(value.__module__)
        elif hasattr(value, "__code__"):
            if id(value) in seen:
                return
            seen.add(id(value))
            note(value.__module__)
            add_code(value.__code__)
            add(value.__defaults__)
            for name in sorted(_names(value.__code__)):
                if name in value.__globals__:
                    digest.update(name.encode())
                    add(value.__globals__[name])
            for cell in value.__closure__ or ():
                add(cell.cell_contents)
        else:
            digest.update(repr(value).encode())

    def note(module: str | None) -> None:
        """Add the source of a module, if the module is part of Linkwork."""
        if module is not None and module.partition(".")[0] in ("analysis", "linkwork") and module in sys.modules:
            files.add(Path(str(sys.modules[module].__file__)))

    def add_code(code: CodeType) -> None:
        digest.update(code.co_code)
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                add_code(constant)
            else:
                add(constant)
        digest.update(" ".join((*code.co_names, *code.co_varnames)).encode())

    add(function)
    for path in sorted(files):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _names(code: CodeType) -> set[str]:
    """Return the global names that code reads, those of functions inside it included."""
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names |= _names(constant)
    return names
