"""What every slave of Linkwork shares: the XML of its interface, its lifecycle, its saved state, its log.

A concrete slave names its variables and makes its plant; the plant has ``inputs``, ``set_input``, ``outputs``, ``step``
and ``save``. pythonfmu by itself writes neither units nor dependencies nor InitialUnknowns: `to_xml` completes them.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Protocol
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String
from pythonfmu.enums import Fmi2Initial, Fmi2Status

from linkwork import __version__
from linkwork.errors import (
    AssemblyError,
    InputError,
    IntegrationError,
    LinkworkError,
    ParameterError,
    StateError,
    StepError,
)
from linkwork.variables import UNITS, Variable

STATUS_GOOD = 0
STATUS_NOT_INITIALISED = 5
STATUS_INTERNAL = 9
#: Value of solver.status for each kind of error.
STATUS = (
    (StepError, 1),
    (InputError, 2),
    (AssemblyError, 3),
    (IntegrationError, 4),
    (ParameterError, 6),
)

#: Namespace of the GUIDs, so that an interface of the same variables always has the same one.
GUID_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_URL, "urn:linkwork:fmi")

_TYPES = {"Real": Real, "Integer": Integer, "String": String}


class Plant(Protocol):
    """What a slave asks of its plant."""

    inputs: dict[str, float]

    def set_input(self, name: str, value: float) -> None: ...
    def outputs(self) -> Sequence[float]: ...
    def step(self, time: float, step: float) -> None: ...
    def save(self) -> dict[str, Any]: ...


class LinkworkSlave(Fmi2Slave):
    """A co-simulation slave around a plant.

    A step that cannot be taken is refused (fmi2Discard), logged in one sentence, and leaves the last good state readable;
    ``solver.status`` and ``solver.message`` say why. A bad parameter fails the initialisation.
    """

    variables: ClassVar[tuple[Variable, ...]]
    position_parameters: ClassVar[tuple[str, ...]]
    #: (start, stop, step, tolerance) of the default experiment: s, s, s, relative.
    experiment: ClassVar[tuple[float, float, float, float]]

    author = "The Linkwork developers"
    license = "MIT"
    copyright = "Copyright (c) 2026 The Linkwork developers"
    version = __version__

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._wrapped = "logger" in kwargs
        self._names = [v.name for v in self.variables]
        self._kinds = [v.kind for v in self.variables]
        self._causalities = [v.causality for v in self.variables]
        self._outputs = [i for i, v in enumerate(self.variables) if v.causality == "output" and v.kind == "Real"]
        self._status_at = self._names.index("solver.status")
        self._message_at = self._names.index("solver.message")
        self._values: list[Any] = [v.start for v in self.variables]
        self._plant: Plant | None = None
        self._running = False
        self._stale = True
        self._start_time = 0.0
        self._master_tolerance: float | None = None
        for index, variable in enumerate(self.variables):
            self.register_variable(self._declaration(index, variable), nested=False)

    # What a concrete slave adds

    def build(self, values: dict[str, Any], time: float, tolerance: float | None) -> Plant:
        """The plant for these parameters and inputs, at its start."""
        raise NotImplementedError

    def restore(self, saved: dict[str, Any]) -> Plant:
        """The plant that its ``save`` described."""
        raise NotImplementedError

    # Interface

    def _declaration(self, index: int, variable: Variable) -> Any:
        output = variable.causality == "output"
        fixed = variable.causality == "parameter"
        continuous = Fmi2Variability.continuous if variable.kind == "Real" else Fmi2Variability.discrete
        return _TYPES[variable.kind](
            variable.name,
            causality=Fmi2Causality[variable.causality],
            variability=Fmi2Variability.fixed if fixed else continuous,
            # approx, not calculated: only so may an output carry the start value that people look for in the XML
            initial=Fmi2Initial.approx if output else Fmi2Initial.exact if fixed else None,
            description=variable.description,
            getter=self._getter(index),
            setter=None,
        )

    def _getter(self, index: int) -> Callable[[], Any]:
        return lambda: self._values[index]

    def interface_guid(self) -> str:
        """GUID of the interface: it changes when a variable, its type, unit or start does, and only then."""
        lines = [
            "|".join((v.name, v.causality, v.kind, v.unit, repr(v.start), repr(v.minimum), repr(v.maximum)))
            for v in self.variables
        ]
        return str(uuid.uuid5(GUID_NAMESPACE, "\n".join([type(self).__name__, *lines])))

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Model description: pythonfmu's, completed by units, bounds, dependencies and InitialUnknowns."""
        root: Element = super().to_xml(model_options or {})
        root.set("guid", self.interface_guid())
        children = list(root)
        slave = next(c for c in children if c.tag == "CoSimulation")
        slave.set("needsExecutionTool", "false")
        slave.set("canHandleVariableCommunicationStepSize", "true")
        slave.set("canGetAndSetFMUstate", "true")
        slave.set("canSerializeFMUstate", "true")
        root.insert(children.index(slave) + 1, self._unit_definitions())
        start, stop, step, tolerance = self.experiment
        experiment = Element(
            "DefaultExperiment",
            {"startTime": repr(start), "stopTime": repr(stop), "stepSize": repr(step), "tolerance": repr(tolerance)},
        )
        listed = next(c for c in root if c.tag == "ModelVariables")
        root.insert(list(root).index(listed), experiment)
        self._refresh()
        for variable, value, scalar in zip(self.variables, self._values, listed):
            self._complete(variable, value, scalar[0])
        structure = next(c for c in root if c.tag == "ModelStructure")
        root.remove(structure)
        root.append(self._structure())
        return root

    def _unit_definitions(self) -> Element:
        definitions = Element("UnitDefinitions")
        for name in dict.fromkeys(v.unit for v in self.variables if v.unit):
            unit = UNITS[name]
            node = SubElement(definitions, "Unit", {"name": name})
            powers = {"kg": unit.kg, "m": unit.m, "s": unit.s, "rad": unit.rad}
            SubElement(node, "BaseUnit", {base: str(power) for base, power in powers.items() if power})
            for display, factor in unit.displays:
                SubElement(node, "DisplayUnit", {"name": display, "factor": repr(factor)})
        return definitions

    @staticmethod
    def _complete(variable: Variable, start: float | int | str, node: Element) -> None:
        if variable.unit:
            node.set("unit", variable.unit)
        if variable.display:
            node.set("displayUnit", variable.display)
        for bound, value in (("min", variable.minimum), ("max", variable.maximum)):
            if value is not None:
                node.set(bound, repr(value))
        # pythonfmu writes 16 digits; 17 are needed for the same number to come back
        node.set("start", str(start) if variable.kind == "String" else repr(start))

    def _structure(self) -> Element:
        index = {name: str(i + 1) for i, name in enumerate(self._names)}
        inputs = [v.name for v in self.variables if v.causality == "input"]
        on_inputs = {"state": [], "speed": [n for n in inputs if n == "drive.speed"], "all": inputs}
        at_start: dict[str, list[str] | None] = {
            "none": [],
            "position": list(self.position_parameters),
            "velocity": None,
            "all": None,
        }
        structure = Element("ModelStructure")
        outputs = SubElement(structure, "Outputs")
        initial = SubElement(structure, "InitialUnknowns")
        for variable in self.variables:
            if variable.causality != "output":
                continue
            SubElement(
                outputs,
                "Unknown",
                {
                    "index": index[variable.name],
                    "dependencies": " ".join(index[n] for n in on_inputs[variable.depends]),
                },
            )
            unknown = SubElement(initial, "Unknown", {"index": index[variable.name]})
            known = at_start[variable.level]
            if known is not None:
                unknown.set("dependencies", " ".join(sorted((index[n] for n in known), key=int)))
        return structure

    # Lifecycle

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        self._start_time = start_time
        self._master_tolerance = tolerance
        self._plant = None
        self._stale = True

    def enter_initialization_mode(self) -> None:
        pass

    def exit_initialization_mode(self) -> None:
        self._refresh()
        self._running = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        try:
            if not self._running or self._plant is None:
                return self._refuse(
                    STATUS_NOT_INITIALISED, f"a step at t = {current_time:.9g} s before the initialisation"
                )
            self._plant.step(current_time, step_size)
            self._values[self._status_at] = STATUS_GOOD
            self._values[self._message_at] = ""
            self._stale = True
            return True
        except LinkworkError as error:
            return self._refuse(_status(error), str(error))
        except (
            Exception
        ) as error:  # the wrapper frees an instance whose step raises: the master would be left with nothing
            return self._refuse(STATUS_INTERNAL, f"internal error at t = {current_time:.9g} s: {error!r}")

    def terminate(self) -> None:
        self._running = False

    def _refuse(self, status: int, sentence: str) -> bool:
        self._values[self._status_at] = status
        self._values[self._message_at] = sentence
        self._say(sentence, Fmi2Status.discard)
        return False

    def _say(self, sentence: str, status: Fmi2Status) -> None:
        # the wrapper hands messages on as printf formats
        self.log(sentence.replace("%", "%%"), status)

    def _fail(self, error: LinkworkError) -> LinkworkError:
        """Log the sentence of an error that must be raised, and keep the instance alive through the wrapper's clean-up.

        After an exception the wrapper drops its references to class, instance and log, and drops them again when the
        master frees the instance; one more reference each makes the second drop harmless.
        """
        self._values[self._status_at] = _status(error)
        self._values[self._message_at] = str(error)
        self._say(str(error), Fmi2Status.error)
        if self._wrapped:
            import ctypes

            for kept in (self, type(self), self.log_queue):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))
        return error

    def _refresh(self) -> None:
        """Bring the outputs up to date with state and inputs, making the plant first if need be."""
        if not self._stale:
            return
        try:
            if self._plant is None:
                values = dict(zip(self._names, self._values))
                self._plant = self.build(values, self._start_time, self._master_tolerance)
            outputs = self._plant.outputs()
        except LinkworkError as error:
            if self._running:
                # an input that is not finite: the last good outputs stay, the next step will be refused
                self._values[self._status_at] = _status(error)
                self._values[self._message_at] = str(error)
                return
            raise self._fail(error) from error
        for index, value in zip(self._outputs, outputs):
            self._values[index] = value
        self._stale = False

    # Values

    def _get(self, references: list[int], kind: str) -> list[Any]:
        if self._stale and any(self._causalities[r] == "output" for r in references):
            self._refresh()
        values, kinds = self._values, self._kinds
        for reference in references:
            if kinds[reference] != kind:
                raise TypeError(f"variable {self._names[reference]} is not of type {kind}")
        return [values[reference] for reference in references]

    def _set(self, references: list[int], values: list[Any], kind: str) -> None:
        for reference, value in zip(references, values):
            name = self._names[reference]
            if self._kinds[reference] != kind:
                raise TypeError(f"variable {name} is not of type {kind}")
            causality = self._causalities[reference]
            if causality == "output" and not self._running:
                continue  # a guess for the initialisation, which is solved without one
            if causality == "output" or (causality == "parameter" and self._running):
                why = "an output" if causality == "output" else "a fixed parameter, set after the initialisation"
                self._say(f"{name} is {why}: the value {value!r} was not taken", Fmi2Status.warning)
                continue
            self._values[reference] = value
            self._stale = True
            if causality == "parameter":
                self._plant = None
            elif self._plant is not None:
                if self._running:
                    self._plant.set_input(name, value)
                else:
                    self._plant = None

    def get_real(self, vrs: list[int]) -> list[float]:
        return self._get(vrs, "Real")

    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._get(vrs, "Integer")

    def get_string(self, vrs: list[int]) -> list[str]:
        return self._get(vrs, "String")

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self._set(vrs, values, "Real")

    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set(vrs, values, "Integer")

    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._set(vrs, values, "String")

    # Saved state

    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "model": type(self).__name__,
            "interface": self.interface_guid(),
            "values": list(self._values),
            "running": self._running,
            "stale": self._stale,
            "start_time": self._start_time,
            "master_tolerance": self._master_tolerance,
            "plant": None if self._plant is None else self._plant.save(),
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if state.get("interface") != self.interface_guid():
            raise self._fail(
                StateError(
                    f"the saved state belongs to {state.get('model')!r} with another interface, not to this "
                    f"{type(self).__name__}"
                )
            )
        try:
            plant = None if state["plant"] is None else self.restore(state["plant"])
        except LinkworkError as error:
            raise self._fail(error) from error
        self._plant = plant
        self._values = list(state["values"])
        self._running = state["running"]
        self._stale = state["stale"]
        self._start_time = state["start_time"]
        self._master_tolerance = state["master_tolerance"]

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        # repr of a float, as JSON writes it, comes back as the same float
        return json.dumps(state).encode("utf-8")

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        saved = json.loads(state.decode("utf-8"))
        if not isinstance(saved, dict):
            raise StateError("the serialised state is not one of a Linkwork slave")
        return saved


def _status(error: LinkworkError) -> int:
    return next((code for kind, code in STATUS if isinstance(error, kind)), STATUS_INTERNAL)
