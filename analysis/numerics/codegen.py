"""Functions traced with CasADi as machine code in this process, and Numba kernels that call them by address.

A ``casadi.Function`` of symbols is a list of elementary instructions. They are written out as LLVM's and compiled in some
hundredths of a second; the machine code is kept on disk by a hash of the instructions, of the processor and of what writes
them, so that it cannot be out of date. Every function has the one form

    f(t, a, b, c, d, out)        t a float, the others arrays of floats

so that a kernel compiled once, in `kernel`, works with the functions of any mechanism. Kernels are kept on disk, in a folder
whose name is a hash of all that they are compiled from.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import errno
import hashlib
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
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
from platformdirs import user_cache_dir

from linkwork.errors import LinkworkError

from . import linking

VECTOR = float64[::1]
MATRIX = float64[:, ::1]
CUBE = float64[:, :, ::1]

_DOUBLE = ir.DoubleType()
_ARGUMENTS = [_DOUBLE, *[_DOUBLE.as_pointer()] * 5]

# Machine code of functions

#: Held while code is made, so that threads make it once and each finds it whole.
MAKING = RLock()
_ALIVE: list[Any] = []


class MachineCode:
    """Machine code of functions, which stays in the process for good: someone may hold an address.

    Parameters
    ----------
    functions : sequence of casadi.Function
        Of SX, with the inputs (t, a, b, c, d) and dense outputs, which follow one another in ``out``, matrices column by
        column.

    Attributes
    ----------
    addresses : dict of str to int
        Address of each function by its name.
    fingerprint : str
        Hash of the instructions, of the processor and of what writes them.

    Raises
    ------
    LinkworkError
        If an operation has no counterpart here, or an output is not dense.
    """

    def __init__(self, functions: Sequence[Any]) -> None:
        _prepare()
        triple, cpu = binding.get_default_triple(), binding.get_host_cpu_name()
        features = binding.get_host_cpu_features().flatten()
        digest = hashlib.sha256(f"{llvmlite.__version__} {triple} {cpu} {features}".encode() + _own_source())
        digest.update(" ".join(function.serialize() for function in functions).encode())
        self.fingerprint = digest.hexdigest()
        machine = binding.Target.from_default_triple().create_target_machine(
            opt=3, jit=True, cpu=cpu, features=features
        )
        code = _kept(self.fingerprint, lambda: _compile(functions, triple, machine))
        engine = binding.create_mcjit_compiler(binding.parse_assembly(f'target triple = "{triple}"'), machine)
        engine.add_object_file(binding.ObjectFileRef.from_data(code))
        engine.finalize_object()
        _ALIVE.append(engine)
        self.addresses = {f.name(): engine.get_function_address(f.name()) for f in functions}


def _compile(functions: Sequence[Any], triple: str, machine: Any) -> bytes:
    """An object file of functions."""
    module = ir.Module("linkwork")
    module.triple = triple
    for function in functions:
        _Writer(module, function).write()
    parsed = binding.parse_assembly(str(module))
    passes = binding.create_pass_builder(machine, binding.create_pipeline_tuning_options(speed_level=2))
    passes.getModulePassManager().run(parsed, passes)
    code: bytes = machine.emit_object(parsed)
    return code


@cache
def _own_source() -> bytes:
    return Path(__file__).read_bytes()


def _kept(key: str, make: Callable[[], bytes]) -> bytes:
    """The object file of a key from disk, or a new one, with a hash: LLVM ends the process over one that is damaged."""
    path = code_folder("llvm") / key
    with suppress(OSError):
        digest, code = (text := path.read_bytes())[:32], text[32:]
        if hashlib.sha256(code).digest() == digest:
            return code
    code = make()
    # where the disk is full or cannot be written to it is made again the next time
    part = path.with_suffix(f".{os.getpid()}")
    with suppress(OSError):
        try:
            part.write_bytes(hashlib.sha256(code).digest() + code)
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)
    return code


#: Functions of the C library by CasADi's operations.
_FUNCTIONS = {
    "OP_SIN": "sin",
    "OP_COS": "cos",
    "OP_TAN": "tan",
    "OP_ASIN": "asin",
    "OP_ACOS": "acos",
    "OP_ATAN": "atan",
    "OP_ATAN2": "atan2",
    "OP_SINH": "sinh",
    "OP_COSH": "cosh",
    "OP_TANH": "tanh",
    "OP_EXP": "exp",
    "OP_LOG": "log",
    "OP_POW": "pow",
    "OP_CONSTPOW": "pow",
    "OP_HYPOT": "hypot",
}
_INTRINSICS = {"OP_SQRT": "llvm.sqrt.f64", "OP_FABS": "llvm.fabs.f64"}


@cache
def _operations() -> dict[int, str]:
    """CasADi's names of its operations by their codes."""
    casadi = _casadi()
    return {getattr(casadi, name): name for name in dir(casadi) if name.startswith("OP_")}


@cache
def _prepare() -> None:
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else ctypes.util.find_library("m"))
    for name in set(_FUNCTIONS.values()):
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        if not address:
            raise LinkworkError(f"the C library of this machine has no function {name}")
        binding.add_symbol(name, address)


class _Writer:
    """Writes one function of CasADi into a module of LLVM."""

    def __init__(self, module: ir.Module, function: Any) -> None:
        self.module = module
        self.source = function
        target = ir.Function(module, ir.FunctionType(ir.VoidType(), _ARGUMENTS), function.name())
        for argument in target.args[1:]:
            argument.add_attribute("noalias")
        self.arguments = target.args
        self.build = build = ir.IRBuilder(target.append_basic_block())
        self.plain: dict[str, Callable[..., Any]] = {
            "OP_ADD": build.fadd,
            "OP_SUB": build.fsub,
            "OP_MUL": build.fmul,
            "OP_DIV": build.fdiv,
            "OP_NEG": build.fneg,
            "OP_SQ": lambda a: build.fmul(a, a),
            "OP_TWICE": lambda a: build.fadd(a, a),
            "OP_INV": lambda a: build.fdiv(ir.Constant(_DOUBLE, 1.0), a),
            "OP_ASSIGN": lambda a: a,
            "OP_SIGN": self._sign,
        }

    def write(self) -> None:
        f, build = self.source, self.build
        sizes = [f.size1_out(i) * f.size2_out(i) for i in range(f.n_out())]
        if any(f.nnz_out(i) != size for i, size in enumerate(sizes)):
            raise LinkworkError(f"{f.name()}: an output has structural zeros; make it dense with casadi.densify")
        first = np.cumsum([0, *sizes])
        casadi = _casadi()
        values: dict[int, Any] = {}
        for k in range(f.n_instructions()):
            code, ins, outs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
            if code == casadi.OP_INPUT:
                which, place = ins
                argument = self.arguments[which]
                values[outs[0]] = argument if which == 0 else build.load(build.gep(argument, [_index(place)]))
            elif code == casadi.OP_OUTPUT:
                which, place = outs
                build.store(values[ins[0]], build.gep(self.arguments[5], [_index(int(first[which]) + place)]))
            elif code == casadi.OP_CONST:
                values[outs[0]] = ir.Constant(_DOUBLE, float(f.instruction_constant(k)))
            else:
                values[outs[0]] = self._operation(code, [values[i] for i in ins])
        build.ret_void()

    def _operation(self, code: int, operands: list[Any]) -> Any:
        operation = _operations().get(code, str(code))
        if operation in self.plain:
            return self.plain[operation](*operands)
        name = (_FUNCTIONS | _INTRINSICS).get(operation)
        if name is None:
            raise LinkworkError(
                f"{self.source.name()}: CasADi's operation {operation} has no counterpart in machine code; equations are "
                "straight lines of arithmetic and functions such as sin, sqrt, exp"
            )
        target = self.module.globals.get(name)
        if target is None:
            target = ir.Function(self.module, ir.FunctionType(_DOUBLE, [_DOUBLE] * len(operands)), name)
            target.attributes.add("nounwind")
        return self.build.call(target, operands)

    def _sign(self, a: Any) -> Any:
        zero, one, less = (ir.Constant(_DOUBLE, value) for value in (0.0, 1.0, -1.0))
        negative = self.build.select(self.build.fcmp_ordered("<", a, zero), less, zero)
        return self.build.select(self.build.fcmp_ordered(">", a, zero), one, negative)


def _index(place: int) -> Any:
    return ir.Constant(ir.IntType(32), place)


def _casadi() -> Any:
    from .symbolic import library

    return library()


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
    """Value of a user's C function f(t, x) of a float and an array of floats, by its address."""

    def generate(context, builder, signature, arguments):
        kind = ir.FunctionType(_DOUBLE, _ARGUMENTS[:2]).as_pointer()
        data = context.make_array(signature.args[2])(context, builder, arguments[2]).data
        return builder.call(builder.inttoptr(arguments[0], kind), [arguments[1], data])

    return float64(int64, float64, x), generate


def user_function(function: Any, size: int) -> Any:
    """A user's function f(t, x1, ..., x_size) as a C function of t and x, NaN where it raises, with its ``address``."""
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
    "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": linking.OfParts
}  # fmt: skip
#: Decorator of functions that kernels call; Python cannot.
part = njit(**_PART)
#: The same for functions that make no arrays: to count references to those they are handed would cost more than all they do.
inner = njit(**_PART, _nrt=False)


@inner
def copy(source, target):
    """Copy a vector. For ``target[:] = source`` Numba compiles what writes a message about shapes, which takes a second."""
    for i in range(target.shape[0]):
        target[i] = source[i]


def kernel(*signature: Any, purpose: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorator: compile a function for its explicit signature when it is first called, and keep the machine code on disk.

    Parameters
    ----------
    *signature
        Numba's.
    purpose : str
        What it is for, as the end of "compiling ...", which is said once on standard error when it really is compiled.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        return Kernel(function, signature, purpose)

    return decorate


class Kernel:
    """A function that is compiled, or read from the cache, when it is first called."""

    def __init__(self, function: Any, signature: tuple[Any, ...], purpose: str) -> None:
        self.py_func = function
        self.signature = signature
        self.purpose = purpose
        self.__doc__ = function.__doc__
        self.__name__ = function.__name__
        self._compiled: Any = None

    @property
    def compiled(self) -> Any:
        """Numba's dispatcher."""
        with MAKING:
            if self._compiled is None:
                folder = cache_folder(fingerprint(self.py_func, self.signature))
                try:
                    self._compiled = self._compile(folder)
                except Exception as error:
                    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS):
                        sys.stderr.write(f"linkwork: {folder}: {error.strerror}: compiled code is not kept\n")
                        self._compiled = self._compile(None)
                        return self._compiled
                    if not any(folder.glob("**/*.nb[ic]")):
                        raise
                    # Numba reads what is damaged as whatever it happens to be
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
        """Compile, and keep the code in a folder if there is one."""
        before = numba.config.CACHE_DIR
        if folder is not None:
            numba.config.CACHE_DIR = str(folder)
        try:
            with _announced(self.purpose):
                return njit(
                    *self.signature, cache=folder is not None, error_model="numpy", nogil=True, no_cfunc_wrapper=True,
                    pipeline_class=linking.OfKernels,
                )(self.py_func)  # fmt: skip
        finally:
            numba.config.CACHE_DIR = before

    def __call__(self, *arguments: Any) -> Any:
        return (self._compiled or self.compiled)(*arguments)


class _Announcer(event.Listener):
    """Says what is compiled; what several functions are for, of the first of them."""

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
def _announced(purpose: str) -> Iterator[None]:
    with event.install_listener("numba:compile", _Announcer(purpose)):
        yield


# The cache of kernels


def fingerprint(function: Any, signature: Any = None) -> str:
    """Hash of everything that a compiled function is compiled from.

    That is its code and all functions and constants that it reads, how Numba is to compile them, and the sources of our
    modules in which they are, for what cannot be seen in a function alone, such as the fields of a NamedTuple.
    """
    digest = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {np.__version__} {signature}".encode())
    seen: set[int] = set()
    files = {Path(__file__), Path(linking.__file__)}

    def add(value: Any) -> None:
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
        """Remember the source of a module of ours."""
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
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names |= _names(constant)
    return names


def cache_root() -> Path:
    """Folder of all that is kept: LINKWORK_CACHE_DIR, else the user's cache folder."""
    return Path(os.environ.get("LINKWORK_CACHE_DIR") or user_cache_dir("linkwork", appauthor=False))


def cache_folder(key: str) -> Path:
    """Folder for machine code that belongs to ``key``, a hash."""
    return code_folder(f"numba-{key[:16]}")


def code_folder(name: str) -> Path:
    """Folder for what is loaded as code: below `cache_root` if nobody else can write there, else below a temporary one.

    What others can write to could make us run their code: that is said once on standard error, and not used.
    """
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = cache_root() / name
    if _usable(folder):
        if _ours(folder, user):
            return folder
        _say_shared(folder.parent)
    folder = Path(tempfile.gettempdir()) / f"linkwork-{user}" / name
    if _usable(folder) and _ours(folder, user):
        return folder
    return Path(tempfile.mkdtemp(prefix="linkwork-"))


@cache
def _say_shared(folder: Path) -> None:
    sys.stderr.write(
        f"linkwork: others can write to {folder}, or to a folder above it: compiled code is kept elsewhere; "
        "LINKWORK_CACHE_DIR can name a folder of yours alone\n"
    )


#: Bytes that must fit into a folder for code.
_LEAST = 1_000_000


def _usable(folder: Path) -> bool:
    try:
        for path in (folder.parent, folder):
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(_LEAST))  # on a full disk files can be made, but not filled
            file.flush()
            return True
    except OSError:
        return False


def _ours(folder: Path, user: int) -> bool:
    """Whether only ``user`` and root can change what is in a folder, or put another in its place."""
    if os.name == "nt":
        return True  # user_cache_dir is below the user's profile, which others cannot write to
    folder = folder.resolve()
    for path in (folder, *folder.parents):
        status = path.stat()
        shared = status.st_mode & 0o002 or (status.st_mode & 0o020 and not _of_one(status.st_gid, user))
        # in a folder with the sticky bit others can write, but not touch what is not theirs
        if status.st_uid not in (user, 0) or (shared and (path == folder or not status.st_mode & 0o1000)):
            return False
    with os.scandir(folder) as entries:
        return folder.stat().st_uid == user and all(_is_of(entry, user) for entry in entries)


def _is_of(entry: os.DirEntry[str], user: int) -> bool:
    """Whether a file is a user's; one that another process has renamed or removed meanwhile does no harm."""
    try:
        return entry.stat(follow_symlinks=False).st_uid == user
    except FileNotFoundError:
        return True


def _of_one(group: int, user: int) -> bool:
    """Whether a group is that of a user alone, of the user's name, as many systems make them."""
    import grp
    import pwd

    try:
        name = pwd.getpwuid(user).pw_name
        return grp.getgrgid(group).gr_name == name and not set(grp.getgrgid(group).gr_mem) - {name}
    except KeyError:
        return False
