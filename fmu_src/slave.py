"""Base class of all slaves of Linkwork: lifecycle, values of variables, saved state and log.

A subclass names the mechanism. The variables are not registered with pythonfmu, which would use them only for the model
description: the archive contains its own model description.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partialmethod, wraps
from typing import Any, ClassVar

from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from linkwork.errors import (
    AssemblyError,
    InputError,
    IntegrationError,
    LinkworkError,
    ParameterError,
    StateError,
    StepError,
)
from linkwork.mechanism import Mechanism
from linkwork.plant import TOLERANCE_RANGE, Plant
from linkwork.variables import Variable
from linkwork.wrapper import (
    INITIALISING,
    INSTANTIATED,
    PHASES,
    RUNNING,
    TERMINATED,
    end_in_order,
    keep_namespace,
    outlive_exception,
    read_state,
    write_state,
)

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

#: Attributes of a slave that a saved state contains unchanged, besides values and plant.
_SAVED = ("phase", "stale", "cause", "start_time", "stop_time", "master_tolerance")

#: Reason why a new value is refused during a run, by causality of the variable.
_NOT_TAKEN = {
    "output": "an output",
    "local": "a local variable",
    "parameter": "a fixed parameter, set after the initialisation",
}


def _guarded(call: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a method of a slave: log an internal error, and keep the instance usable after any exception."""

    @wraps(call)
    def method(self: LinkworkSlave, *arguments: Any, **keywords: Any) -> Any:
        try:
            return call(self, *arguments, **keywords)
        except BaseException as error:
            if not isinstance(error, LinkworkError):
                self.log(f"internal error in {call.__name__}: {error!r}", Fmi2Status.fatal)
            if self._wrapped:
                outlive_exception(self)
            raise

    return method


class LinkworkSlave(Fmi2Slave):
    """Base of the co-simulation slaves: a slave simulates one mechanism with a `Plant`.

    A step that fails returns fmi2Discard and is logged in one sentence. The last good outputs stay readable;
    ``solver.status`` and ``solver.message`` give the reason. With an invalid parameter the initialisation fails.
    """

    mechanism: ClassVar[Mechanism]
    variables: ClassVar[tuple[Variable, ...]]
    #: GUID in the model description, which saved states carry
    guid_of_interface: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.variables = cls.mechanism.variables
        keep_namespace(cls)

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._wrapped = "logger" in kwargs
        if self._wrapped:
            # the wrapper adds this folder at each instantiation; all modules are imported by now
            if self.resources in sys.path:
                sys.path.remove(self.resources)
            outlive_exception(self)
        self._names = [v.name for v in self.variables]
        self._kinds = [v.kind for v in self.variables]
        self._causalities = [v.causality for v in self.variables]
        self._computed = [v.causality in ("output", "local") for v in self.variables]
        self._outputs = [i for i, v in enumerate(self.variables) if v.causality == "output" and v.kind == "Real"]
        self._status_at = self._names.index("solver.status")
        self._message_at = self._names.index("solver.message")
        self._values: list[Any] = [v.start for v in self.variables]
        self._plant: Plant | None = None
        self._phase = INSTANTIATED
        self._stale = True
        #: status and message of a failure since the last good step; a call that is refused as out of order does not set it
        self._cause: tuple[int, str] | None = None
        self._start_time = 0.0
        self._stop_time: float | None = None
        self._master_tolerance: float | None = None

    def _build(self) -> Plant:
        """Build the plant from the present parameters and inputs, in its initial state."""
        values = dict(zip(self._names, self._values))
        own, master = values["solver.tolerance"], self._master_tolerance
        tolerance = own if master is None else min(own, max(master, TOLERANCE_RANGE[0]))
        return Plant.from_values(self.mechanism, values, tolerance=tolerance, time=self._start_time)

    # Lifecycle

    def _expect(self, call: str, phase: str) -> None:
        """Raise StepError if the slave is not in the ``phase`` in which FMI allows the ``call``."""
        if self._phase != phase:
            raise self._fail(StepError(f"{call} out of order: the slave is {self._phase}, not {phase}"))

    @_guarded
    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        self._expect("fmi2SetupExperiment", INSTANTIATED)
        if stop_time is not None and not stop_time >= start_time:
            raise self._fail(StepError(f"the stop time is {stop_time:.9g} s: it must not be before the start time"))
        self._start_time = start_time
        self._stop_time = stop_time
        self._master_tolerance = tolerance
        self._plant = None
        self._stale = True

    @_guarded
    def enter_initialization_mode(self) -> None:
        self._expect("fmi2EnterInitializationMode", INSTANTIATED)
        self._phase = INITIALISING

    @_guarded
    def exit_initialization_mode(self) -> None:
        self._expect("fmi2ExitInitializationMode", INITIALISING)
        error = self._refresh()
        if error is not None:
            raise self._fail(error) from error
        self._values[self._status_at] = STATUS_GOOD
        self._values[self._message_at] = ""
        self._cause = None
        self._phase = RUNNING

    @_guarded
    def do_step(self, current_time: float, step_size: float) -> bool:
        try:
            if self._phase == TERMINATED:
                raise StepError(f"a step at t = {current_time:.9g} s after the end of the run")
            if self._phase != RUNNING or self._plant is None:
                why = f": {self._cause[1]}" if self._cause else ""
                return self._refuse(
                    STATUS_NOT_INITIALISED, f"a step at t = {current_time:.9g} s before the initialisation{why}"
                )
            end, stop = current_time + step_size, self._stop_time
            if stop is not None and end > stop + 1e-6 * step_size + 1e-12 * abs(current_time):
                raise StepError(f"a step to t = {end:.9g} s: the stop time is {stop:.9g} s")
            self._plant.step(current_time, step_size)
            self._values[self._status_at] = STATUS_GOOD
            self._values[self._message_at] = ""
            self._cause = None
            self._stale = True
            return True
        except StepError as error:
            if self._cause is None:
                return self._refuse(_status(error), str(error))
            # the master went on after a refused step: the message must also say why that step was refused
            return self._refuse(self._cause[0], f"{error}; before that, {self._cause[1]}")
        except LinkworkError as error:
            self._cause = (_status(error), str(error))
            return self._refuse(*self._cause)
        except Exception as error:
            # the wrapper frees an instance whose step raises: the master could not even read the reason
            self._cause = (STATUS_INTERNAL, f"internal error at t = {current_time:.9g} s: {error!r}")
            return self._refuse(*self._cause)

    def terminate(self) -> None:
        # allowed in every phase, because masters clean up after errors
        if self._wrapped and self._phase != TERMINATED:
            end_in_order(self)
        self._phase = TERMINATED

    def _refuse(self, status: int, sentence: str) -> bool:
        self._values[self._status_at] = status
        self._values[self._message_at] = sentence
        self.log(sentence, Fmi2Status.discard)
        return False

    def _fail(self, error: LinkworkError) -> LinkworkError:
        """Log an error, store it in ``solver.status`` and ``solver.message``, and return it, for the caller to raise.

        The error is logged because the message of the wrapper may leave out its text.
        """
        said = self._values[self._status_at], self._values[self._message_at] = (_status(error), str(error))
        if not isinstance(error, StepError):
            self._cause = said
        self.log(str(error), Fmi2Status.error)
        return error

    def _refresh(self) -> LinkworkError | None:
        """Compute the outputs for the present state and inputs; build the plant first if there is none.

        Returns the error if the computation failed, else None. After an error the outputs keep their last values.
        """
        if not self._stale:
            return None
        try:
            if self._plant is None:
                self._plant = self._build()
            outputs = self._plant.outputs()
        except LinkworkError as error:
            return error
        except Exception as error:
            return LinkworkError(f"internal error in the outputs: {error!r}")
        for index, value in zip(self._outputs, outputs):
            self._values[index] = value
        self._stale = False
        return None

    # Values

    @_guarded
    def _get(self, references: list[int], kind: str) -> list[Any]:
        for reference in references:
            self._check_reference(reference, kind)
        if self._stale and any(self._computed[r] for r in references):
            # an error here does not fail the read, because some masters use the values all the same: the last good outputs
            # stay, and the initialisation or the next step will be refused
            error = self._refresh()
            refused = self._phase in (RUNNING, TERMINATED) and self._values[self._status_at] != STATUS_GOOD
            if error is not None and not refused:
                self._values[self._status_at] = _status(error)
                self._values[self._message_at] = str(error)
        values = self._values
        return [values[reference] for reference in references]

    def _check_reference(self, reference: int, kind: str) -> None:
        # a value reference is unsigned in FMI, but the wrapper passes a signed number
        if not 0 <= reference < len(self._names):
            raise self._fail(LinkworkError(f"there is no variable with the value reference {reference}"))
        if self._kinds[reference] != kind:
            raise self._fail(LinkworkError(f"variable {self._names[reference]} is not of type {kind}"))

    @_guarded
    def _set(self, references: list[int], values: list[Any], kind: str) -> None:
        if self._phase == TERMINATED:
            self._expect(f"fmi2Set{kind}", RUNNING)
        running = self._phase == RUNNING
        for reference, value in zip(references, values):
            self._check_reference(reference, kind)
            causality = self._causalities[reference]
            if running and causality != "input" and not self.variables[reference].tunable:
                why = f"{self._names[reference]} is {_NOT_TAKEN[causality]}: the value {value!r} was not taken"
                raise self._fail(StepError(why))
        if running and self._plant is not None and any(self.variables[r].tunable for r in references):
            try:
                self._plant.tune(
                    dict(zip(self._names, self._values)) | {self._names[r]: v for r, v in zip(references, values)}
                )
            except LinkworkError as error:
                raise self._fail(error) from error
        for reference, value in zip(references, values):
            name = self._names[reference]
            causality = self._causalities[reference]
            if self._computed[reference]:
                continue  # a guess of an output; the initialisation needs no guess
            self._values[reference] = value
            self._stale = True
            if causality == "parameter" and not running:
                self._plant = None
            elif causality == "input" and self._plant is not None:
                if running:
                    self._plant.set_input(name, value)
                else:
                    self._plant = None

    get_real = partialmethod(_get, kind="Real")
    set_real = partialmethod(_set, kind="Real")
    get_integer = partialmethod(_get, kind="Integer")
    set_integer = partialmethod(_set, kind="Integer")
    get_string = partialmethod(_get, kind="String")
    set_string = partialmethod(_set, kind="String")
    get_boolean = partialmethod(_get, kind="Boolean")
    set_boolean = partialmethod(_set, kind="Boolean")

    # Saved state

    @_guarded
    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            **{name: getattr(self, f"_{name}") for name in _SAVED},
            "model": type(self).__name__,
            "interface": self.guid_of_interface,
            "values": list(self._values),
            "plant": None if self._plant is None else self._plant.save(),
        }

    @_guarded
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        try:
            if "damaged" in state:
                raise StateError(f"the serialised state is damaged: {state['damaged']}")
            if state.get("interface") != self.guid_of_interface:
                raise StateError(
                    f"the saved state belongs to {state.get('model')!r} with another interface, not to this "
                    f"{type(self).__name__}"
                )
            plant = None if state["plant"] is None else Plant.restore(self.mechanism, state["plant"])
            restored = {name: state[name] for name in _SAVED} | {"values": list(state["values"]), "plant": plant}
            if state["phase"] not in PHASES or (state["phase"] == RUNNING and plant is None):
                raise StateError(f"the saved state is damaged: a slave that is {state['phase']!r} without a plant")
        except LinkworkError as error:
            raise self._fail(error) from error
        except (KeyError, TypeError) as error:
            raise self._fail(StateError(f"the saved state is damaged: {error!r}")) from error
        for name, value in restored.items():
            setattr(self, f"_{name}", value)

    _fmu_state_to_bytes, _fmu_state_from_bytes = staticmethod(write_state), staticmethod(read_state)


def _status(error: LinkworkError) -> int:
    return next((code for kind, code in STATUS if isinstance(error, kind)), STATUS_INTERNAL)
