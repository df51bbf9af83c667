"""Receive the log messages of FMUs that FMPy runs."""

from __future__ import annotations

from ctypes import byref
from typing import Any
from weakref import WeakValueDictionary

from fmpy.fmi1 import printLogMessage
from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy


class Messages(list[str]):
    """The log messages of one instance of an FMU, in the order in which they came."""

    def receive(self, *arguments: Any) -> None:
        """Append a message to the list; it is the last argument in FMI 2.0 and in FMI 3.0."""
        self.append(arguments[-1].decode("utf-8", errors="replace"))

    def callbacks(self) -> Any:
        """Return the FMI 2.0 callbacks for FMPy's `instantiate`; keep a reference to them as long as the instance lives."""
        found = fmi2CallbackFunctions(logger=_LOGGER, componentEnvironment=id(self))
        addLoggerProxy(byref(found))
        _listeners[id(self)] = self
        return found


_listeners: WeakValueDictionary[int, Messages] = WeakValueDictionary()


def _receive(environment: int | None, *arguments: Any) -> None:
    listener = _listeners.get(environment or 0)
    if listener is None:
        printLogMessage(environment, *arguments)
    else:
        listener.receive(*arguments)


#: Logger for all instances. FMPy's proxy, which formats the messages, calls only the logger that it was given last. This logger
#: therefore lives as long as the process and finds each instance by its environment; messages of other FMUs are printed.
_LOGGER = fmi2CallbackLoggerTYPE(_receive)
