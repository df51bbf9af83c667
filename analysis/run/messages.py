"""Receive the log messages of FMUs of FMI 2.0 that run in FMPy."""

from __future__ import annotations

from ctypes import byref
from typing import Any
from weakref import WeakValueDictionary

from fmpy.fmi1 import printLogMessage
from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy


class Messages(list[str]):
    """The log messages of an FMU, in their order."""

    def receive(self, *arguments: Any) -> None:
        """Append a message, the last of the arguments in FMI 2.0 and in FMI 3.0."""
        self.append(arguments[-1].decode("utf-8", errors="replace"))

    def callbacks(self) -> Any:
        """Return the callbacks of FMI 2.0 for `instantiate` of FMPy; keep them as long as the instance lives."""
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


#: FMPy's proxy, which formats the messages, has one logger for all instances of the process, the last that it was given. This
#: one lives as long as the process and finds the instance by its environment; messages of others are printed, as FMPy does.
_LOGGER = fmi2CallbackLoggerTYPE(_receive)
