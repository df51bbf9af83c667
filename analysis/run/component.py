"""Run FMUs that are WebAssembly components (FMI-LS-WASM) with wasmtime; instances have the methods of FMPy's instances."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

from fmpy.fmi1 import FMICallException

from ..libraries import require

#: Folder of the component in an FMU, and names of the interfaces in the draft of FMI-LS-WASM, with package and version.
FOLDER = "wasm32-wasip2"
_INTERFACE = "fmi:fmi3/{}@3.0.0"


def component_path(folder: str | Path, identifier: str) -> Path:
    """Return the path of the component with a model identifier in the folder of an unpacked FMU."""
    return Path(folder) / "binaries" / FOLDER / f"{identifier}.wasm"


class _Component:
    """An instance of the WebAssembly component of an unpacked FMU.

    Methods that are not defined here are those of the component's interface, under FMPy's names: ``getFloat64`` calls
    ``get-float64``.
    """

    _interface: ClassVar[str]
    _further_arguments: ClassVar[tuple[Any, ...]]

    def __init__(self, guid: str, unzipDirectory: str, modelIdentifier: str, instanceName: str) -> None:
        require("wasmtime")
        from wasmtime import Engine, Store
        from wasmtime.component import Component, Linker

        engine = Engine()
        self._named, self._store = (instanceName, guid), Store(engine)
        #: the instance, under the name that FMPy uses; None before `instantiate` and after `freeInstance`
        self.component: Any = None
        self._log: Callable[..., None] = lambda *_: None
        made = Component.from_file(engine, str(component_path(unzipDirectory, modelIdentifier)))
        linker = Linker(engine)
        with linker.root() as root, root.add_instance(_INTERFACE.format("callbacks")) as callbacks:
            callbacks.add_func("log-message", self._receive_log)
        self._instance = linker.instantiate(self._store, made)
        self._interface_index = self._instance.get_export_index(self._store, _INTERFACE.format(self._interface))
        self._functions: dict[str, Any] = {}

    def _receive_log(self, store: Any, name: str, status: str, category: str, message: str) -> None:
        self._log(message.encode())

    def call(self, method: str, *values: Any, kind: str = "method") -> Any:
        """Call a method of the component's interface; raise FMICallException if it fails."""
        if method not in self._functions:
            name = f"[{kind}]{self._interface}-instance.{method}"
            index = self._instance.get_export_index(self._store, name, self._interface_index)
            assert index is not None, name
            function: Any = self._instance.get_func(self._store, index)
            # wasmtime looks up the types of a function in every call, which takes a third of the call's time
            kind_of = function.type(self._store)
            kept = SimpleNamespace(params=kind_of.params, result=kind_of.result)
            function.type = lambda store: kept
            self._functions[method] = function
        own = (self.component,) if kind == "method" else ()
        found = self._functions[method](self._store, *own, *values)
        if isinstance(found, str) and found != "ok" and found != "warning":
            raise FMICallException(method, ("ok", "warning", "discard", "error", "fatal").index(found))
        return found

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        method = re.sub(r"(?<!^)([A-Z])", r"-\1", name).lower().replace("u-int", "uint")
        return lambda *values: self.call(method, *values)

    def instantiate(self, loggingOn: bool = False, logMessage: Callable[..., None] | None = None) -> None:
        self._log = logMessage or self._log
        name, token = self._named
        making = f"instantiate-{self._interface}"
        self.component = self.call(making, name, token, "", False, loggingOn, *self._further_arguments, kind="static")
        if self.component is None:
            raise FMICallException(making, 3)

    def enterInitializationMode(self, tolerance: float | None = None, startTime: float = 0.0) -> None:
        self.call("enter-initialization-mode", tolerance, startTime, None)

    def freeInstance(self) -> None:
        self.component.drop(self._store)
        self.component = None


class ComponentSlave(_Component):
    """An instance of a component for co-simulation."""

    _interface, _further_arguments = "co-simulation", (False, False, [])

    def doStep(self, time: float, step: float) -> tuple[bool, bool, bool, float]:
        done = self.call("do-step", time, step, True)
        names = ("event-handling-needed", "terminate-simulation", "early-return", "last-successful-time")
        event, terminate, early, last = (getattr(done, name) for name in names)
        return event, terminate, early, last


class ComponentModel(_Component):
    """An instance of a component for model exchange; arrays of states are arrays of ctypes, as in FMPy."""

    _interface, _further_arguments = "model-exchange", ()

    def updateDiscreteStates(self) -> tuple[Any, ...]:
        return tuple(vars(self.call("update-discrete-states")).values())

    def setContinuousStates(self, x: Any, count: int) -> None:
        self.call("set-continuous-states", x[:count])

    def getContinuousStates(self, x: Any, count: int) -> None:
        self._write("get-continuous-states", x)

    def getContinuousStateDerivatives(self, x: Any, count: int) -> None:
        self._write("get-continuous-state-derivatives", x)

    def getNominalsOfContinuousStates(self, x: Any, count: int) -> None:
        self._write("get-nominals-of-continuous-states", x)

    def getEventIndicators(self, z: Any, count: int) -> None:
        self._write("get-event-indicators", z)

    def _write(self, method: str, array: Any) -> None:
        for number, value in enumerate(self.call(method)):
            array[number] = value
