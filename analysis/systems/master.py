"""Running the parts of a system together, in equal communication steps.

Over a step the inputs are what the outputs were at its start. How much better that can be, four couplings tell apart.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Mapping
from ctypes import byref, c_void_p
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from fmpy import extract
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..files import unknown_name
from ..numerics.workers import interruptible
from ..run import CosimulationError, RunInterrupted, shown, unpacking_folder
from .wiring import Bond, End, Part, Wiring

#: How the inputs go over a step.
COUPLINGS = {
    "hold": "held at what the outputs were at its start",
    "derivatives": "on straight lines with the slopes that the outputs had there, where a part takes such inputs",
    "rollback": "on straight lines to what the outputs are at its end: the step is taken again from its start",
}


@dataclass(frozen=True, kw_only=True)
class SystemRun:
    """A run of a system.

    Attributes
    ----------
    time : (N,) float array
        Communication points (s).
    values : mapping of str to (N,) float array
        Every real output, as ``part.output``.
    powers : mapping of str to (N,) float array
        Of each power bond, named by its effort, the power residual: what the coupling has brought in at the end of the step,
        since either part knew the other only from its start (W).
    flows : mapping of str to (N,) float array
        Power that goes through each bond (W).
    status : int
        0, or 3 where a part refused a step: the data end before it.
    message : str
        What it said.
    notes : tuple of str
        What is perhaps not meant.
    title, coupling : str
    units : mapping of str to str
        Of the outputs.
    connected : tuple of str
        Outputs that another part has as an input.
    """

    time: NDArray[Any]
    values: Mapping[str, NDArray[np.float64]]
    powers: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    flows: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    status: int = 0
    message: str = ""
    notes: tuple[str, ...] = ()
    title: str = ""
    coupling: str = "hold"
    units: Mapping[str, str] = field(default_factory=dict)
    connected: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        if name not in self.values:
            raise unknown_name(name, self.values, f"output {name!r}")
        return self.values[name]

    def __len__(self) -> int:
        return len(self.time)

    def brought_in(self) -> float:
        """Return the work that the coupling brought in, as a share of the work that went through all bonds; 0 without bonds.

        Over a step a residual grows from 0, so that its mean is half of what it is at the end.
        """
        through = sum(float(np.abs(flow).sum()) for flow in self.flows.values())
        brought = 0.5 * sum(float(np.abs(power).sum()) for power in self.powers.values())
        return brought / through if through > 0.0 else 0.0


class _Instance:
    """An instance of a part, initialised by `start`."""

    def __init__(self, part: Part) -> None:
        self.part = part
        self.messages: list[str] = []
        self.outputs = part.named("output")
        self._references = [part.ports[name].reference for name in self.outputs]
        interface = part.description.coSimulation
        self.takes_slopes = bool(interface.canInterpolateInputs)
        self.goes_back = bool(interface.canGetAndSetFMUstate)
        wrapped = str(part.description.generationTool).startswith("PythonFMU")
        self._folder = tempfile.mkdtemp(dir=unpacking_folder() if wrapped else None)
        try:
            extract(str(part.fmu), self._folder)
            self._fmu = FMU2Slave(
                guid=part.description.guid,
                unzipDirectory=self._folder,
                modelIdentifier=interface.modelIdentifier,
                instanceName=part.name,
            )
            self._callbacks = fmi2CallbackFunctions()
            self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
            addLoggerProxy(byref(self._callbacks))
            self._fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        except BaseException:
            shutil.rmtree(self._folder, ignore_errors=True)
            raise

    def _log(self, *arguments: Any) -> None:
        self.messages.append(arguments[-1].decode("utf-8", errors="replace"))

    def begin(self) -> None:
        """Set the start values and enter the initialisation."""
        self._fmu.setupExperiment(startTime=0.0)
        for name, value in self.part.values.items():
            port = self.part.ports[name]
            set_as = {"Real": (self._fmu.setReal, float), "Boolean": (self._fmu.setBoolean, bool)}
            setter, kind = set_as.get(port.type, (self._fmu.setInteger, int))
            setter([port.reference], [kind(value)])
        self._fmu.enterInitializationMode()

    def begun(self) -> None:
        self._fmu.exitInitializationMode()

    def read(self) -> NDArray[np.float64]:
        """Return all real outputs."""
        return np.array(self._fmu.getReal(self._references))

    def put(self, values: Mapping[str, float], slopes: Mapping[str, float]) -> None:
        """Set inputs, and their slopes where it takes them."""
        references = [self.part.ports[name].reference for name in values]
        if references:
            self._fmu.setReal(references, list(values.values()))
            if slopes and self.takes_slopes:
                self._fmu.setRealInputDerivatives(references, [1] * len(references), [slopes[name] for name in values])

    def step(self, time: float, step: float) -> None:
        self._fmu.doStep(time, step)

    def saved(self) -> Any:
        return self._fmu.getFMUState()

    def restore(self, state: Any) -> None:
        self._fmu.setFMUState(state)

    def forget(self, state: Any) -> None:
        self._fmu.freeFMUState(c_void_p(getattr(state, "value", state)))

    def close(self) -> None:
        try:
            self._fmu.freeInstance()
        finally:
            shutil.rmtree(self._folder, ignore_errors=True)


class _Together:
    """All instances of a system, their inputs and outputs at the present communication point."""

    def __init__(self, wiring: Wiring) -> None:
        self.wiring = wiring
        self.instances: dict[str, _Instance] = {}
        try:
            for name, part in wiring.parts.items():
                self.instances[name] = _Instance(part)
            for instance in self.instances.values():
                instance.begin()
            # what depends directly on an input settles after as many rounds as there are parts
            for _ in self.instances:
                self.outputs = self._read()
                self._exchange(self.outputs, {})
            for instance in self.instances.values():
                instance.begun()
        except BaseException as error:
            said = [text for instance in self.instances.values() for text in instance.messages]
            self.close()
            if isinstance(error, FMICallException):
                raise CosimulationError("; ".join(said) or f"{wiring.title}: {error}") from error
            raise
        rates = {
            End(name, port.rate_of): End(name, port.name)
            for name, part in wiring.parts.items()
            for port in part.ports.values()
            if port.rate_of and port.causality == "output"
        }
        #: Of each connected input the output with its rate, or the source itself where none is known; None where there is no
        #: slope to be given: the rate is an input, too, or the source is held.
        self.rate = {
            target: None
            if wiring.port(source).held or wiring.rate_input(target) in wiring.connections
            else rates.get(source, source)
            for target, source in wiring.connections.items()
        }
        self.outputs = self.before = self._read()

    def _read(self) -> dict[End, float]:
        return {
            End(name, output): float(value)
            for name, instance in self.instances.items()
            for output, value in zip(instance.outputs, instance.read())
        }

    def _exchange(self, outputs: Mapping[End, float], slopes: Mapping[End, float], *, middle: float = 0.0) -> None:
        """Set all connected inputs; a part that takes no slopes gets the value after ``middle`` (s)."""
        for name, instance in self.instances.items():
            own = {t: source for t, source in self.wiring.connections.items() if t.part == name}
            ahead = 0.0 if instance.takes_slopes else middle
            values = {t.port: outputs[source] + ahead * slopes.get(t, 0.0) for t, source in own.items()}
            instance.put(values, {t.port: slopes.get(t, 0.0) for t in own} if slopes else {})

    def _slopes(self, step: float) -> dict[End, float]:
        """Return the slopes of all connected inputs, those without a known rate from the step before."""
        found = {}
        for target, rate in self.rate.items():
            source = self.wiring.connections[target]
            if rate is not None:
                found[target] = (
                    self.outputs[rate] if rate != source else (self.outputs[source] - self.before[source]) / step
                )
        return found

    def step(self, coupling: str, time: float, step: float) -> None:
        """Take a step."""
        before, slopes = self.outputs, {} if coupling == "hold" else self._slopes(step)
        states = {name: each.saved() for name, each in self.instances.items()} if coupling == "rollback" else {}
        try:
            self._exchange(before, slopes)
            self._go(time, step)
            if coupling == "rollback":
                there = self._read()
                for name, state in states.items():
                    self.instances[name].restore(state)
                for target, source in self.wiring.connections.items():
                    if self.rate[target] is not None:
                        slopes[target] = (there[source] - before[source]) / step
                self._exchange(before, slopes, middle=0.5 * step)
                self._go(time, step)
        finally:
            for name, state in states.items():
                self.instances[name].forget(state)
        self.given = {target: self._at_end(target, before, slopes, step) for target in self.wiring.connections}
        self.reached = self._read()
        self.before, self.outputs = before, self.reached
        if coupling != "hold":
            # what depends directly on inputs belongs to those that begin here; masters that hold inputs do not look again
            self._exchange(self.reached, {})
            self.outputs = self._read()

    def _at_end(self, target: End, before: Mapping[End, float], slopes: Mapping[End, float], step: float) -> float:
        """Return what an input came to at the end of a step."""
        value = before[self.wiring.connections[target]]
        rate = self.wiring.rate_input(target)
        if rate is not None and rate in self.wiring.connections:
            slope = before[self.wiring.connections[rate]] + 0.5 * step * slopes.get(rate, 0.0)
        else:
            slope = slopes.get(target, 0.0) * (1.0 if self.instances[target.part].takes_slopes else 0.5)
        return value + step * slope

    def _go(self, time: float, step: float) -> None:
        for name, instance in self.instances.items():
            self.stepping = name
            instance.step(time, step)

    def powers(self, bonds: Iterable[Bond]) -> dict[str, float]:
        """Return the power residual of each bond at the end of the last step (W)."""
        return {
            str(bond.effort): self.given[bond.effort_to] * self.reached[bond.flow]
            - self.reached[bond.effort] * self.given[bond.flow_to]
            for bond in bonds
        }

    def close(self) -> None:
        for instance in self.instances.values():
            instance.close()


def run_system(
    wiring: Wiring,
    *,
    coupling: str = "hold",
    step: float | None = None,
    stop_time: float | None = None,
    progress: bool = False,
) -> SystemRun:
    """Run the FMUs of a system together.

    Parameters
    ----------
    wiring : Wiring
    coupling : str
        One of `COUPLINGS`.
    step, stop_time : float, optional
        Communication step and end (s); by default the wiring's.
    progress : bool

    Returns
    -------
    SystemRun
        A refused step ends it, with all data before and what the part said.

    Raises
    ------
    CosimulationError
        If a part cannot be loaded or initialised.
    InputError
        If the step is not positive and below the stop time, or a part cannot go back to the start of a step.
    """
    if coupling not in COUPLINGS:
        raise unknown_name(coupling, COUPLINGS, f"coupling {coupling!r}")
    step, stop_time = wiring.step if step is None else step, wiring.stop_time if stop_time is None else stop_time
    if not 0.0 < step <= stop_time:
        raise InputError(
            f"the communication step is {step} s: it must be above 0 and at most the stop time, {stop_time} s"
        )
    together = _Together(wiring)
    rows: list[dict[End, float]] = [together.outputs]
    bonds = wiring.bonds()
    powers: list[dict[str, float]] = [{str(bond.effort): 0.0 for bond in bonds}]
    status, message, count = 0, "", round(stop_time / step)
    try:
        stuck = [name for name, each in together.instances.items() if not each.goes_back]
        if coupling == "rollback" and stuck:
            raise InputError(
                f"{stuck[0]} cannot go back to the start of a step: the coupling must be another than rollback"
            )
        with interruptible() as interrupted, shown(progress, stop_time, "running the system") as show:
            for number in range(count):
                try:
                    together.step(coupling, number * step, step)
                except FMICallException as error:
                    status, message = 3, _said(together, number * step, error)
                    break
                rows.append(together.outputs)
                powers.append(together.powers(bonds))
                show((number + 1) * step)
                if interrupted:
                    break
    finally:
        together.close()
    run = SystemRun(
        time=step * np.arange(len(rows)),
        values={str(end): np.array([row[end] for row in rows]) for end in rows[0]},
        powers={name: np.array([row[name] for row in powers]) for name in powers[0]},
        flows={str(b.effort): np.array([row[b.effort] * row[b.flow] for row in rows]) for b in bonds},
        status=status,
        message=message,
        notes=tuple(wiring.notes()),
        title=wiring.title,
        coupling=coupling,
        units={str(end): wiring.port(end).unit for end in rows[0]},
        connected=tuple(map(str, dict.fromkeys(wiring.connections.values()))),
    )
    if interrupted:
        raise RunInterrupted(run)
    return run


def _said(together: _Together, time: float, error: FMICallException) -> str:
    """Return that a part refused a step, and what was said last; FMPy tells the messages of all FMUs to one of them."""
    said = [text for instance in together.instances.values() for text in instance.messages]
    return f"{together.stepping} refused the step from t = {time:.9g} s: {said[-1] if said else error}"
