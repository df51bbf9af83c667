"""Run instances of Linkwork's FMUs with FMPy: any kind of FMU, in co-simulation and model exchange."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from contextlib import chdir
from ctypes import byref
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Self
from weakref import WeakValueDictionary
from xml.etree import ElementTree
from zipfile import ZipFile

from fmpy import extract, platform, platform_tuple, read_model_description
from fmpy.fmi1 import FMICallException, printLogMessage
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.logging import addLoggerProxy

from linkwork.errors import InputError, LinkworkError
from linkwork.parameters import fmi_name

from ..files import check_fmu
from ..mechanisms import InitialState, Parameters, find_mechanism
from .component import ComponentModel, ComponentSlave, component_path


class CosimulationError(LinkworkError):
    """Error for an FMU that could not be loaded or initialised; the message is that of the FMU if it gave one."""


def _description(fmu: str | Path) -> Any:
    """Read and validate the model description of an FMU; raise CosimulationError if the file is none."""
    if not Path(fmu).is_file():
        raise CosimulationError(f"there is no file {fmu}: build it with 'linkwork build'")
    try:
        check_fmu(fmu)
        return read_description(fmu, validate=True)
    except InputError as error:
        raise CosimulationError(str(error)) from error


def read_description(fmu: str | Path, *, validate: bool = False) -> Any:
    """Read the model description of an FMU with FMPy.

    Raises
    ------
    InputError
        If the description cannot be read, or a variable has no name.
    """
    try:
        with ZipFile(fmu) as archive:
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        description = read_model_description(str(fmu), validate=validate)
    except Exception as error:  # FMPy raises plain exceptions
        # the findings of a validation are below its first line
        lines = [line.strip("- ") for line in str(error).splitlines()] or [type(error).__name__]
        said = " ".join(lines[:2]) if lines[0].endswith(":") else lines[0]
        raise InputError(f"{fmu} is not an FMU: {said}") from error
    for variable in root.iterfind("ModelVariables/*"):
        if not variable.get("name"):  # FMPy skips such a variable, and numbers the others wrongly
            reference = variable.get("valueReference")
            raise InputError(f"{fmu} is not an FMU: the variable with the value reference {reference} has no name")
    return description


def list_interfaces(fmu: str | Path) -> dict[str, str]:
    """Return the interfaces of an FMU: a description of each, by the name that `cosimulate` takes.

    Raises
    ------
    CosimulationError
        If the file is not an FMU.
    """
    description = _description(fmu)
    kinds: dict[str, type[_Instance]] = {"co-simulation": FmuRun, "model-exchange": FmuModel}
    return {
        name: f"{kind.interface}, FMI {description.fmiVersion}"
        for name, kind in kinds.items()
        if getattr(description, kind.described)
    }


class _Instance:
    """An initialised instance of an FMU of Linkwork, run by FMPy. Use it as a context manager.

    The FMU must be of the mechanism to which the parameters belong; the file determines the version of FMI.

    Parameters
    ----------
    fmu : path
    parameters, initial
        Parameters and initial state of a mechanism.
    modes : dict
        Values of the mechanism's modes, by name.
    tolerance, start_time : float
    inputs : dict
        Inputs at the start, by name.

    Raises
    ------
    CosimulationError
        If the file is not such an FMU, or its initialisation fails.
    """

    interface: ClassVar[str]
    #: Attribute of FMPy's model description that describes the interface; FMPy's classes for it, by the version of FMI.
    described: ClassVar[str]
    _classes: ClassVar[Mapping[str, type]]
    _component: ClassVar[type]

    def __init__(
        self,
        fmu: str | Path,
        parameters: Parameters,
        initial: InitialState,
        *,
        modes: dict[str, int],
        tolerance: float,
        start_time: float,
        inputs: dict[str, float],
    ) -> None:
        mechanism = find_mechanism(parameters)
        self.input_names = mechanism.input_names
        self.output_names = mechanism.output_names
        self.name = Path(fmu).name
        self.messages = Messages()
        self._folder: str | None = None
        self.description = _description(fmu)
        self._variables = {v.name: v for v in self.description.modelVariables}
        described = getattr(self.description, self.described)
        missing = [] if described else [self.interface]
        missing += [n for n in (*self.input_names, *self.output_names, "solver.status") if n not in self._variables]
        if missing:
            named = ", ".join(missing[:3]) + (f" and {len(missing) - 3} others" if len(missing) > 3 else "")
            raise CosimulationError(
                f"{fmu} is not a {mechanism.fmu} for {self.interface}, which these parameters need, but "
                f"{self.description.modelName}: it has no {named}"
            )
        try:
            self._folder = tempfile.mkdtemp()
            extract(str(fmu), self._folder)
            with chdir("."):  # FMPy leaves the working folder changed if a library cannot be loaded
                self._fmu = self._instance_class(described.modelIdentifier)(
                    guid=self.description.guid,
                    unzipDirectory=self._folder,
                    modelIdentifier=described.modelIdentifier,
                    instanceName="linkwork",
                )
            values = {fmi_name(name): value for name, value in asdict(parameters).items()}
            values |= {f"initial.{name}": value for name, value in asdict(initial).items()}
            self._initialise(values | {"solver.tolerance": tolerance} | modes | inputs, tolerance, start_time)
        except BaseException as error:  # FMPy raises plain exceptions, too
            self.close()
            if not isinstance(error, Exception):
                raise
            reasons = [m for m in self.messages if not m.startswith("Fatal py exception")]
            raise CosimulationError("; ".join(reasons) or f"{fmu}: {error}") from error
        self._inputs = self._references(self.input_names)
        self._outputs = self._references(self.output_names)
        self._set_reals = getattr(self._fmu, f"set{self._real}")
        self._get_reals = getattr(self._fmu, f"get{self._real}")

    def _instance_class(self, identifier: str) -> type:
        """Return FMPy's class that runs the FMU, or the WebAssembly class if the FMU has no library for this platform."""
        assert self._folder is not None
        native = Path(self._folder) / "binaries" / (platform_tuple if self._fmi3 else platform)
        if native.is_dir() or not component_path(self._folder, identifier).is_file():
            return self._classes[self.description.fmiVersion[0]]
        return self._component

    @property
    def _fmi3(self) -> bool:
        return bool(self.description.fmiVersion.startswith("3"))

    @property
    def _real(self) -> str:
        return "Float64" if self._fmi3 else "Real"

    def _references(self, names: tuple[str, ...]) -> list[int]:
        return [self._variables[name].valueReference for name in names]

    def _initialise(self, values: Mapping[str, float], tolerance: float, start_time: float) -> None:
        if self._fmi3:
            self._fmu.instantiate(loggingOn=True, logMessage=self.messages.receive)
        else:
            self._fmu.instantiate(callbacks=self.messages.callbacks(), loggingOn=True)
            self._fmu.setupExperiment(tolerance=tolerance, startTime=start_time)
        groups: dict[str, dict[int, float]] = {}
        for name, value in values.items():
            variable = self._variables[name]
            groups.setdefault(variable.type, {})[variable.valueReference] = value
        for kind_of, group in groups.items():
            kind = float if kind_of == self._real else int
            getattr(self._fmu, f"set{kind_of}")(list(group), [kind(value) for value in group.values()])
        if self._fmi3:
            self._fmu.enterInitializationMode(tolerance=tolerance, startTime=start_time)
        else:
            self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def set_inputs(self, values: Mapping[str, float]) -> None:
        """Set all inputs, by name."""
        self._set_reals(self._inputs, [values[name] for name in self.input_names])

    def outputs(self) -> list[float]:
        """Return all real outputs, in the order of the mechanism's ``output_names``."""
        return list(self._get_reals(self._outputs))

    def trouble(self) -> tuple[int, str]:
        """Return the values of solver.status and solver.message."""
        found = []
        for name in ("solver.status", "solver.message"):
            variable = self._variables[name]
            found.append(getattr(self._fmu, f"get{variable.type}")([variable.valueReference])[0])
        status, message = found
        return int(status), message.decode() if isinstance(message, bytes) else str(message)

    def close(self) -> None:
        """Free the instance and remove the unpacked FMU."""
        fmu = self.__dict__.pop("_fmu", None)
        try:
            if fmu is not None and fmu.component:
                fmu.freeInstance()
        finally:
            if self._folder is not None:
                shutil.rmtree(self._folder, ignore_errors=True)


class FmuRun(_Instance):
    """An instance of an FMU for co-simulation: set inputs, step, read outputs."""

    interface = "co-simulation"
    described = "coSimulation"
    _classes = MappingProxyType({"2": FMU2Slave, "3": FMU3Slave})
    _component = ComponentSlave

    def step(self, time: float, step: float) -> tuple[int, str]:
        """Take one communication step; return 0 and an empty text or, if it is refused, solver.status and solver.message."""
        try:
            self._fmu.doStep(time, step)
        except FMICallException:
            return self.trouble()
        return 0, ""

    @property
    def interpolates(self) -> bool:
        """Return whether the FMU accepts inputs that change linearly over a step."""
        return bool(getattr(self.description.coSimulation, "canInterpolateInputs", False))

    def set_slopes(self, values: Mapping[str, float]) -> None:
        """Set the time derivatives of all inputs over the next step, by name."""
        self._fmu.setRealInputDerivatives(self._inputs, [1] * len(values), [values[name] for name in self.input_names])


class FmuModel(_Instance):
    """An instance of an FMU for model exchange, in continuous-time mode: states, derivatives, events.

    Attributes
    ----------
    states, indicators : int
        Number of continuous states, and number of event indicators.
    """

    interface = "model exchange"
    described = "modelExchange"
    _classes = MappingProxyType({"2": FMU2Model, "3": FMU3Model})
    _component = ComponentModel

    def _initialise(self, values: Mapping[str, float], tolerance: float, start_time: float) -> None:
        super()._initialise(values, tolerance, start_time)
        self.states = int(self.description.numberOfContinuousStates)
        self.indicators = int(self.description.numberOfEventIndicators)
        fmu = self._fmu
        self._derivatives = fmu.getContinuousStateDerivatives if self._fmi3 else fmu.getDerivatives
        self._update = fmu.updateDiscreteStates if self._fmi3 else fmu.newDiscreteStates
        self.update()

    def put(self, time: float, x: Any) -> None:
        """Set the time and the states; ``x`` is an array of ctypes."""
        self._fmu.setTime(time)
        self._fmu.setContinuousStates(x, self.states)

    def get_states(self, x: Any) -> None:
        """Write the states into an array of ctypes; the getters below write their values in the same way."""
        self._fmu.getContinuousStates(x, self.states)

    def get_nominals(self, x: Any) -> None:
        self._fmu.getNominalsOfContinuousStates(x, self.states)

    def get_derivatives(self, rates: Any) -> None:
        self._derivatives(rates, self.states)

    def get_indicators(self, z: Any) -> None:
        self._fmu.getEventIndicators(z, self.indicators)

    def event(self, inputs: Mapping[str, float]) -> bool:
        """Set new inputs in event mode; return whether the FMU requests the end of the run."""
        self._fmu.enterEventMode()
        self.set_inputs(inputs)
        return self.update()

    def update(self) -> bool:
        """Update discrete states and enter continuous-time mode; return whether the FMU requests the end of the run."""
        again, terminate = True, False
        while again and not terminate:
            again, terminate, *_ = self._update()
        self._fmu.enterContinuousTimeMode()
        return terminate


# Log messages


class Messages(list[str]):
    """The log messages of one instance of an FMU, in the order in which they came."""

    def receive(self, *arguments: Any) -> None:
        """Append a message to the list: the last of the ``arguments``, in FMI 2.0 and in FMI 3.0."""
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
