"""Call the functions of an FMU's library for one instance; each call is written to the journal before it is made.

FMPy declares the types of the functions' arguments.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fmpy import calloc, fmi2, fmi3, free

from linkwork.errors import LinkworkError

from .journal import Journal
from .model import Model

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")


def status_name(status: int) -> str:
    """Return the name of a status, or the number if it is none of the standard's."""
    return STATUS[status] if 0 <= status < len(STATUS) else str(status)


class ProbeError(LinkworkError):
    """A check could not be made: the FMU refused a call that the check needs, or a process of the probe failed."""


_LOGGER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_void_p
)
_CLASSES = {(2, "cs"): fmi2.FMU2Slave, (2, "me"): fmi2.FMU2Model, (3, "cs"): fmi3.FMU3Slave, (3, "me"): fmi3.FMU3Model}


class Library:
    """The shared library of an extracted FMU."""

    def __init__(self, model: Model, folder: Path) -> None:
        made = _CLASSES[model.version, model.interface](
            guid=model.token, modelIdentifier=model.identifier, unzipDirectory=str(folder), instanceName="probe"
        )
        self._dll = made.dll  # its functions carry the argument types that FMPy declares
        self._prefix = f"fmi{model.version}"
        self.messages: list[str] = []
        #: Callbacks, the same for all instances, so that the probe keeps no data of any instance.
        self.callbacks: Any
        if model.version == 2:
            # the logger is variadic: a further argument is declared for the message "%s", which FMPy's type lacks
            self._logger = _LOGGER(lambda _e, _n, status, _c, message, more: self._log(message, more))
            self.callbacks = fmi2.fmi2CallbackFunctions(
                logger=ctypes.cast(self._logger, fmi2.fmi2CallbackLoggerTYPE),
                allocateMemory=ctypes.cast(calloc, fmi2.fmi2CallbackAllocateMemoryTYPE),
                freeMemory=ctypes.cast(free, fmi2.fmi2CallbackFreeMemoryTYPE),
            )
        else:
            self.callbacks = fmi3.fmi3LogMessageCallback(lambda _e, status, _c, message: self._log(message))

    def _log(self, message: bytes | None, more: int | None = None) -> None:
        if len(self.messages) < 100:
            if message == b"%s" and more:
                message = ctypes.cast(more, ctypes.c_char_p).value
            self.messages.append((message or b"").decode("utf-8", "replace"))

    def function(self, name: str) -> Any:
        """Return a function of the library; ``name`` is without the prefix fmi2 or fmi3."""
        return getattr(self._dll, self._prefix + name)


class Session:
    """An instance of an FMU, which may not exist if the FMU refused to make it; ``folder`` has the extracted FMU."""

    def __init__(self, library: Library, model: Model, journal: Journal, folder: Path) -> None:
        self.library, self.model, self.journal, self.folder = library, model, journal, folder
        self.instance: Any = None
        self.messages = library.messages
        self.messages.clear()
        self.prefix = f"fmi{model.version}"
        self.event_mode = False

    def instantiation(self, *, event_mode: bool = False, early_return: bool = False) -> tuple[str, list[Any]]:
        """Return the name of the function that makes an instance, and a list of legal arguments for this function."""
        model = self.model
        token = model.token.encode()
        self.event_mode = event_mode and model.event_mode
        if model.version == 2:
            kind = fmi2.fmi2CoSimulation if model.interface == "cs" else fmi2.fmi2ModelExchange
            return "Instantiate", [b"probe", kind, token, uri(self.folder / "resources"), self.library.callbacks, 0, 1]
        path = f"{self.folder / 'resources'}/".encode()
        if model.interface == "me":
            return "InstantiateModelExchange", [b"probe", token, path, False, True, None, self.library.callbacks]
        update = fmi3.fmi3IntermediateUpdateCallback()
        more = [self.event_mode, early_return, None, 0, None, self.library.callbacks, update]
        return "InstantiateCoSimulation", [b"probe", token, path, False, True, *more]

    def instantiate(self, arguments: Iterable[Any] | None = None, **options: bool) -> bool:
        """Make the instance, by default with legal arguments; return whether the FMU returned an instance."""
        name, legal = self.instantiation(**options)
        self.instance = self._make(name, legal if arguments is None else list(arguments))
        self.journal.write(" -> an instance" if self.instance else " -> NULL")
        return bool(self.instance)

    def call(self, name: str, *arguments: Any) -> int:
        """Call a function with the instance as first argument; return its status."""
        return self.call_instance(self.instance, name, *arguments)

    def call_instance(self, instance: Any, name: str, *arguments: Any) -> int:
        """Call a function with ``instance`` as first argument, None for NULL; return its status."""
        status = self._make(name, [instance, *arguments], shown=1 if instance else 0)
        if status is None:
            return OK
        self.journal.fatal |= status == FATAL
        self.journal.write(f" -> {status_name(status)}")
        return int(status)

    def need(self, name: str, *arguments: Any) -> None:
        """Call a function that a check needs; raise ProbeError if the FMU refuses the call."""
        status = self.call(name, *arguments)
        if status > WARNING:
            said = f": {self.messages[-1]}" if self.messages else ""
            self.journal.write(f"\n# the check ends here{said}")
            raise ProbeError(f"{self.prefix}{name} returned {status_name(status)}{said}")

    def free(self) -> None:
        """Free the instance, if there is one."""
        if self.instance:
            self.call("FreeInstance")
            self.instance = None

    def _make(self, name: str, arguments: list[Any], shown: int = 0) -> Any:
        if self.model.version == 2:  # FMI 2 spells some names differently
            name = name.replace("FMUState", "FMUstate").replace("Deserialize", "DeSerialize")
        text = ", ".join(show(argument) for argument in arguments[shown:])
        self.journal.call(f"{self.prefix}{name}({text})")
        return self.library.function(name)(*arguments)


def uri(folder: Path) -> bytes:
    """Return the URI of a folder, with reserved characters percent-encoded."""
    return (
        "file://" + quote(("" if folder.as_posix().startswith("/") else "/") + folder.as_posix(), safe="/:")
    ).encode()


def show(argument: Any) -> str:
    """Return an argument of a call as text, for the list of calls."""
    if argument is None:
        return "NULL"
    if isinstance(argument, bytes):
        return repr(argument)[1:] if len(argument) < 80 else f"{argument[:20]!r}... ({len(argument)} bytes)"
    if isinstance(argument, ctypes.Array):
        if len(argument) > 100 or issubclass(argument._type_, (ctypes.c_char, ctypes.c_ubyte)):
            return f"[{len(argument)} values]"
        values = [repr(v)[1:] if isinstance(v, bytes) else str(v) for v in argument[:6]]
        return f"[{', '.join(values)}{', ...' if len(argument) > len(values) else ''}]"
    if isinstance(argument, ctypes.Structure):
        return f"&{type(argument).__name__}"
    if isinstance(argument, ctypes.c_void_p):
        return "state" if argument.value else "&NULL"
    if isinstance(argument, ctypes._SimpleCData):
        return f"&{argument.value}"
    return repr(argument) if isinstance(argument, (int, float, bool)) else type(argument).__name__
