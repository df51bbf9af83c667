"""Call the library of a native FMU function by function: every call returns its status, nothing is checked or hidden."""

from __future__ import annotations

import ctypes
import re
import weakref
import zipfile
from collections.abc import Iterator, Sequence
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_int32, c_size_t, c_uint32, c_void_p
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

OK, WARNING, DISCARD, ERROR = range(4)

LOG_2 = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)
LOG_3 = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)
UPDATE = ctypes.CFUNCTYPE(
    None, c_void_p, c_double, ctypes.c_bool, ctypes.c_bool, ctypes.c_bool, ctypes.c_bool,
    POINTER(ctypes.c_bool), POINTER(c_double),
)  # fmt: skip


class Callbacks(ctypes.Structure):
    """The structure ``fmi2CallbackFunctions``; log messages come as the argument of the format ``%s``."""

    _fields_ = (("logger", LOG_2), *((name, c_void_p) for name in ("allocate", "free", "step_finished", "environment")))


class Memory:
    """Memory functions of a host; after ``most`` requests they return no memory.

    ``asked`` is the number of requests, ``given`` the blocks that were not freed yet, by address.
    """

    def __init__(self, most: int = 1000) -> None:
        self.asked, self.given = 0, dict[int, Any]()

        def allocate(count: int, size: int) -> int | None:
            self.asked += 1
            if self.asked > most:
                return None
            block = ctypes.create_string_buffer(count * size)
            self.given[ctypes.addressof(block)] = block
            return ctypes.addressof(block)

        block, release = ctypes.CFUNCTYPE(c_void_p, c_size_t, c_size_t), ctypes.CFUNCTYPE(None, c_void_p)
        self._kept = (block(allocate), release(lambda address: self.given.pop(address) and None))
        self.functions = [ctypes.cast(function, c_void_p) for function in self._kept]


class Library:
    """A native FMU, unpacked and loaded.

    Attributes
    ----------
    fmi : int
        Major version of FMI.
    references : dict of str to int
        Value references by the names of the variables.
    token : str
        GUID or instantiation token.
    dll : ctypes.CDLL
    """

    def __init__(self, fmu: Path, folder: Path) -> None:
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.fmi = int(str(root.get("fmiVersion"))[0])
        self.token = str(root.get("guid") or root.get("instantiationToken"))
        listed = root.find("ModelVariables")
        assert listed is not None
        self.references = {str(v.get("name")): int(str(v.get("valueReference"))) for v in listed}
        self.archive, self.folder = fmu, folder
        (path,) = (folder / "binaries").rglob("*.so")
        self.path = path
        self.dll = ctypes.CDLL(str(path))
        text = (folder / "sources" / f"fmi{self.fmi}Functions.h").read_text(encoding="utf-8")
        #: names of all functions of the standard
        self.functions = sorted(set(re.findall(rf"\bfmi{self.fmi}[A-Z]\w+(?=TYPE\b)", text)))
        for name in self.functions:
            function = getattr(self.dll, name, None)
            if function is not None and name.startswith((f"fmi{self.fmi}Instantiate",)):
                function.restype = c_void_p

    def instance(self, interface: str = "cs", **options: Any) -> Instance:
        """Return a new instance."""
        return Instance(self, interface, **options)


class Instance:
    """An instance; ``log`` has the pairs (status, message) that it has logged.

    ``update`` is called in intermediate updates, with the instance and the arguments of the standard after it.
    """

    def __init__(
        self,
        library: Library,
        interface: str,
        *,
        token: str | None = None,
        name: bytes | None = b"test",
        logging: bool = False,
        callbacks: bool = True,
        memory: Memory | None = None,
        early: bool = False,
        event_mode: bool = False,
        update: Any = None,
    ) -> None:
        self.library, self.interface = library, interface
        self.log: list[tuple[int, str]] = []
        dll = library.dll
        key = (library.token if token is None else token).encode() if token != "" else None
        if library.fmi == 2:
            self._logger: Any = LOG_2(lambda _, name, status, category, form, text: self._say(status, text, form))
            self._callbacks = Callbacks(logger=self._logger) if callbacks else Callbacks()
            if memory is not None:
                self._callbacks.allocate, self._callbacks.free = memory.functions
            given = (key, b"file:/nowhere", byref(self._callbacks), 0, int(logging))
            self.handle = dll.fmi2Instantiate(name, int(interface == "cs"), *given)
        else:
            self._logger = LOG_3(lambda _, status, category, text: self._say(status, text))
            logger = self._logger if callbacks else None
            me = weakref.proxy(self)
            self._update = None if update is None else UPDATE(lambda _, *arguments: update(me, *arguments) and None)
            head = (name, key, None, ctypes.c_bool(False), ctypes.c_bool(logging))
            if interface == "me":
                self.handle = dll.fmi3InstantiateModelExchange(*head, None, logger)
            else:
                flags = (ctypes.c_bool(event_mode), ctypes.c_bool(early), None, c_size_t(0))
                self.handle = dll.fmi3InstantiateCoSimulation(*head, *flags, None, logger, self._update)

    def _say(self, status: int, text: bytes, form: bytes = b"%s") -> None:
        assert form == b"%s"
        self.log.append((status, text.decode("ascii")))

    def __call__(self, function: str, *arguments: Any) -> int:
        """Call a function, named without its prefix, and return its status.

        Python floats are passed as doubles; all other arguments as ctypes passes them.
        """
        converted = [c_double(a) if isinstance(a, float) else a for a in arguments]
        return int(getattr(self.library.dll, f"fmi{self.library.fmi}{function}")(c_void_p(self.handle), *converted))

    def free(self) -> None:
        """Free the instance; this also happens when nothing refers to it any more."""
        getattr(self.library.dll, f"fmi{self.library.fmi}FreeInstance")(c_void_p(self.handle))
        self.handle = None

    def __del__(self) -> None:
        if getattr(self, "handle", None) is not None:
            self.free()

    # Values

    def get(self, *names: str) -> list[float]:
        """Return the values of real variables."""
        values = (c_double * len(names))()
        assert self(self.real("Get"), *self.arrays(names, values)) == OK
        return list(values)

    def set(self, **values: float) -> int:
        """Set variables and return the worst status; ``__`` in a name stands for a dot. An int sets an integer variable."""
        status = OK
        for key, value in values.items():
            name = key.replace("__", ".")
            if isinstance(value, float):
                status = max(status, self(self.real("Set"), *self.arrays([name], (c_double * 1)(value))))
            else:
                function = "SetInteger" if self.library.fmi == 2 else "SetInt32"
                status = max(status, self(function, *self.arrays([name], (c_int32 * 1)(value))))
        return status

    def text(self, name: str = "solver.message") -> str:
        """Return the value of a string variable."""
        values = (c_char_p * 1)()
        assert self("GetString", *self.arrays([name], values)) == OK
        return (values[0] or b"").decode()

    def status(self) -> int:
        """Return the value of ``solver.status``."""
        values = (c_int32 * 1)()
        name = "GetInteger" if self.library.fmi == 2 else "GetInt32"
        assert self(name, *self.arrays(["solver.status"], values)) == OK
        return values[0]

    def real(self, verb: str) -> str:
        """Return the name of the function that gets or sets real values."""
        return f"{verb}Real" if self.library.fmi == 2 else f"{verb}Float64"

    def arrays(self, names: Sequence[str], values: Any) -> tuple[Any, ...]:
        """Return the arguments of a function that gets or sets values."""
        references = (c_uint32 * len(names))(*(self.library.references[name] for name in names))
        given = (references, c_size_t(len(names)), values)
        return given if self.library.fmi == 2 else (*given, c_size_t(len(values)))

    # Life

    def enter(self, start: float = 0.0, tolerance: float | None = None) -> int:
        """Set up the experiment and enter initialisation mode; return the status."""
        given = tolerance is not None
        limits = (c_double(tolerance or 0.0), c_double(start))
        if self.library.fmi == 2:
            status = self("SetupExperiment", int(given), *limits, 0, c_double(0.0))
            return max(status, self("EnterInitializationMode"))
        return self("EnterInitializationMode", ctypes.c_bool(given), *limits, ctypes.c_bool(False), c_double(0.0))

    def start(self, **values: float) -> Instance:
        """Set values and pass through initialisation mode; return the instance itself."""
        assert self.set(**values) == OK
        assert self.enter() == OK
        assert self("ExitInitializationMode") == OK
        return self

    def continuous(self, **values: float) -> Instance:
        """Start, and enter continuous-time mode; return the instance itself."""
        self.start(**values)
        assert self("EnterContinuousTimeMode") == OK
        return self

    def put_states(self, *x: float) -> int:
        """Set the continuous states; return the status."""
        return self("SetContinuousStates", (c_double * len(x))(*x), c_size_t(len(x)))

    def step(self, time: float, step: float) -> int:
        """Take a communication step and return its status."""
        if self.library.fmi == 2:
            return self("DoStep", time, step, 1)
        flags = (ctypes.c_bool * 3)()
        self.reached = c_double()
        refs = [byref(flags, i) for i in range(3)]
        status = self("DoStep", time, step, ctypes.c_bool(True), *refs, byref(self.reached))
        self.event, self.terminate, self.early = list(flags)
        return status

    def discrete(self) -> tuple[bool, bool]:
        """Update the discrete states; return whether the simulation is to end, and whether states have changed."""
        if self.library.fmi == 2:
            info = (c_int * 8)()
            assert self("NewDiscreteStates", info) == OK
            return bool(info[1]), bool(info[3])
        flags = (ctypes.c_bool * 5)()
        time = c_double()
        refs = [byref(flags, i) for i in range(5)]
        assert self("UpdateDiscreteStates", *refs, byref(time)) == OK
        return flags[1], flags[3]

    def with_state(self, verb: str, *arguments: Any) -> int:
        """Call a function of saved states, such as "Get" for ``GetFMUState``, and return its status."""
        return self(f"{verb}FMU{'s' if self.library.fmi == 2 else 'S'}tate", *arguments)

    def saved(self) -> c_void_p:
        """Return a saved FMU state."""
        state = c_void_p()
        assert self.with_state("Get", byref(state)) == OK
        return state

    def rates(self) -> list[float]:
        """Return the derivatives of the continuous states."""
        return self.states("Derivatives" if self.library.fmi == 2 else "ContinuousStateDerivatives")

    def states(self, which: str = "ContinuousStates", count: int = 6) -> list[float]:
        """Return the continuous states, or their derivatives or nominal values."""
        values = (c_double * count)()
        assert self(f"Get{which}", values, c_size_t(count)) == OK
        return list(values)


def phases(library: Library, interface: str) -> Iterator[tuple[str, Instance]]:
    """Yield an instance in each state of the FMI state machine of an interface, except states during a callback."""
    names = ["instantiated", "initialization", "step" if interface == "cs" else "event"]
    names += ["continuous"] if interface == "me" else []
    for name in (*names, "terminated"):
        instance = library.instance(interface)
        if name != "instantiated":
            assert instance.enter() == OK
        if name not in ("instantiated", "initialization"):
            assert instance("ExitInitializationMode") == OK
        if name == "continuous":
            assert instance("EnterContinuousTimeMode") == OK
        if name == "terminated":
            assert instance("Terminate") == OK
        yield name, instance
