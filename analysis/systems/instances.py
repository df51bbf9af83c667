"""Instantiate and step the FMUs of a system through FMPy, in FMI 2.0 and 3.0."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from ctypes import c_void_p
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from fmpy import extract
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

from ..run import Messages, unpacking_folder
from .wiring import Part

Floats: TypeAlias = NDArray[np.float64]


@lru_cache(maxsize=64)
def _unpack(fmu: Path, changed: int, folder: str | None) -> tempfile.TemporaryDirectory[str]:
    """Unpack an FMU once per process into a folder that is removed when the process ends; return that folder.

    ``changed`` is the time of the file's last change: a changed file is unpacked anew.
    """
    place = tempfile.TemporaryDirectory(dir=folder, prefix="linkwork-", ignore_cleanup_errors=True)
    extract(str(fmu), place.name)
    return place


class Instance:
    """An FMI 2.0 instance of a part of a system; call `start_initialisation`, `finish_initialisation`, then `step`.

    It has the logged ``messages``, the names of the part's real ``outputs`` in the order of `read`, and ``goes_back``: whether
    the part can save and restore its state.
    """

    #: FMPy's class; last words of its methods that get and set real variables, and of its method that sets enumerations
    _running: type = FMU2Slave
    _reals, _enumerations = "Real", "Integer"

    def __init__(self, part: Part) -> None:
        self.part = part
        self.messages = Messages()
        self.outputs = part.real_variables("output")
        self._references = [part.ports[name].reference for name in self.outputs]
        interface = part.description.coSimulation
        self.goes_back = bool(interface.canGetAndSetFMUstate)
        wrapped = str(part.description.generationTool).startswith("PythonFMU")
        changed = part.fmu.stat().st_mtime_ns
        self._place = _unpack(part.fmu.resolve(), changed, unpacking_folder() if wrapped else None)
        self._fmu = self._running(
            guid=part.description.guid,
            unzipDirectory=self._place.name,
            modelIdentifier=interface.modelIdentifier,
            instanceName=part.name,
        )
        self._get_reals, self._set_reals = (getattr(self._fmu, f"{verb}{self._reals}") for verb in ("get", "set"))
        self._instantiate(interface)

    def _instantiate(self, interface: Any) -> None:
        self._interpolates = bool(interface.canInterpolateInputs)
        self._fmu.instantiate(callbacks=self.messages.callbacks(), loggingOn=True)

    def start_initialisation(self) -> None:
        """Set the start values and enter initialisation mode."""
        self._fmu.setupExperiment(startTime=0.0)
        self._set_start_values()
        self._fmu.enterInitializationMode()

    def _set_start_values(self) -> None:
        for name, value in self.part.values.items():
            port = self.part.ports[name]
            kind = {"Real": float, "Float64": float, "Boolean": bool}.get(port.type, int)
            setter = port.type if port.type != "Enumeration" else self._enumerations
            getattr(self._fmu, f"set{setter}")([port.reference], [kind(value)])

    def finish_initialisation(self) -> None:
        """Leave initialisation mode."""
        self._fmu.exitInitializationMode()

    def read(self) -> NDArray[np.float64]:
        """Return the values of all real outputs."""
        return np.array(self._get_reals(self._references))

    def set_inputs(
        self, names: Sequence[str], values: Floats, slopes: Floats | None, *, middle: float, updated: bool
    ) -> None:
        """Set inputs for a step to their values at its start, with their slopes over it; if ``slopes`` is None they are held.

        A part that accepts no slopes holds the inputs at their values ``middle`` (s) after the start of the step. ``updated``
        says whether an FMI 3.0 part follows the slopes by intermediate updates.
        """
        references = [self.part.ports[name].reference for name in names]
        lines = slopes is not None and self._interpolates
        if slopes is not None and not lines:
            values = values + middle * slopes
        self._values, self._slopes = values, slopes if slopes is not None and lines else np.zeros(len(values))
        if references:
            self._set_reals(references, values.tolist())
            if lines:
                self._fmu.setRealInputDerivatives(references, [1] * len(references), self._slopes.tolist())

    def end_values(self, step: float) -> Floats:
        """Return the values that the inputs have at the end of a step."""
        return self._values + step * self._slopes

    def step(self, time: float, step: float) -> None:
        """Take a step; raise FMPy's FMICallException if the part refuses it."""
        self._fmu.doStep(time, step)

    def save(self) -> Any:
        """Return a copy of the present state."""
        return self._fmu.getFMUState()

    def restore(self, state: Any) -> None:
        """Restore a saved state."""
        self._fmu.setFMUState(state)

    def forget(self, state: Any) -> None:
        """Free a saved state."""
        self._fmu.freeFMUState(c_void_p(getattr(state, "value", state)))

    def close(self) -> None:
        """Free the instance."""
        self._fmu.freeInstance()


class Instance3(Instance):
    """An FMI 3.0 instance of a part: inputs have no derivatives, but can be updated at each step of the part's integrator."""

    _running = FMU3Slave
    _reals, _enumerations = "Float64", "Int64"

    def _instantiate(self, interface: Any) -> None:
        self._begins, self._lines = 0.0, False
        self._references_set: list[int] = []
        update = self._update if interface.providesIntermediateUpdate else None
        self._fmu.instantiate(loggingOn=True, logMessage=self.messages.receive, intermediateUpdate=update)

    def _update(self, environment: Any, time: float, setting: bool, *_: Any) -> None:
        if setting and self._lines:
            self._last = self._values + (time - self._begins) * self._slopes
            self._set_reals(self._references_set, self._last.tolist())

    def start_initialisation(self) -> None:
        """Set the start values and enter initialisation mode."""
        self._set_start_values()
        self._fmu.enterInitializationMode(startTime=0.0)

    def set_inputs(
        self, names: Sequence[str], values: Floats, slopes: Floats | None, *, middle: float, updated: bool
    ) -> None:
        """Set inputs for a step as `Instance.set_inputs` does; if not ``updated``, hold their values at ``middle``."""
        references = [self.part.ports[name].reference for name in names]
        self._values, self._slopes = values, np.zeros(len(values)) if slopes is None else slopes
        self._lines = bool(references) and slopes is not None and updated
        self._last = values if updated else values + middle * self._slopes
        self._references_set = references
        if references:
            self._set_reals(references, self._last.tolist())

    def end_values(self, step: float) -> Floats:
        """Return the values of the inputs at the end of a step, from the last update or extrapolated with the slopes."""
        return self._last if self._lines else self._values + step * self._slopes

    def step(self, time: float, step: float) -> None:
        """Take a step as `Instance.step` does."""
        self._begins = time
        self._fmu.doStep(time, step)


def make_instance(part: Part) -> Instance:
    """Return an instance of a part of a system, for the FMI version of its FMU."""
    return (Instance3 if part.description.fmiVersion.startswith("3") else Instance)(part)
