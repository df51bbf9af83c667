"""Run an FMU in the ordinary way, step by step, for the checks that compare runs."""

from __future__ import annotations

import ctypes
import math
import random
from collections.abc import Mapping, Sequence
from typing import Any

from .model import CONDITIONS, Variable
from .session import ProbeError, Session
from .walk import access, read_update, update_arguments, value

#: Values of all variables at one time: the bytes of the variables of each group, such as Real or Float64.
Values = dict[str, bytes]
#: Values of inputs for one step.
Inputs = Mapping[Variable, Any]

_EVENT_ITERATIONS = 100


class Run:
    """A run of one instance, from its initialization on.

    The constructor sets the values ``start`` and initializes the instance; with ``finish`` false it stays in initialization
    mode. With ``instantiate`` false the session already has an instance, for example one that was reset. A step is a
    communication step (co-simulation) or a step of Euler's method (model exchange).
    """

    def __init__(
        self,
        session: Session,
        *,
        instantiate: bool = True,
        start: Inputs | None = None,
        stop: float | None = None,
        finish: bool = True,
    ) -> None:
        self.session, self.model = session, session.model
        self.time = self.model.start_time
        self.next_event = math.inf
        if instantiate and not session.instantiate():
            raise ProbeError(": ".join(["no instance is made", *session.messages[-1:]]))
        if start:
            self.set(start)
        self._initialize(stop)
        if finish:
            session.need("ExitInitializationMode")
            if self.model.interface == "me":
                self._iterate()

    def _initialize(self, stop: float | None) -> None:
        setup = [False, 0.0, self.time, stop is not None, stop or 0.0]
        if self.model.version == 2:
            self.session.need("SetupExperiment", *setup)
            setup = []
        self.session.need("EnterInitializationMode", *setup)

    def _iterate(self) -> None:
        for _ in range(_EVENT_ITERATIONS):
            if not self._update():
                break
        self.session.need("EnterContinuousTimeMode")

    def _update(self) -> bool:
        """Update the discrete states once; return whether another update is needed."""
        arguments = update_arguments(self.model.version)
        self.session.need("NewDiscreteStates" if self.model.version == 2 else "UpdateDiscreteStates", *arguments)
        needed, _, self.next_event = read_update(self.model.version, arguments)
        return needed

    def set(self, values: Inputs) -> None:
        """Set the scalar variables among ``values`` to their values in this mapping; leave out arrays."""
        for group in dict.fromkeys(variable.group for variable in values):
            chosen = [variable for variable in values if variable.group == group and variable.size == 1]
            if chosen:
                self.session.need("Set" + group, *access(self.model, chosen, [values[v] for v in chosen]))

    def get(self, variables: Sequence[Variable]) -> Any:
        """Return the values of variables, which must be of one group such as Real, as a C array."""
        arguments = access(self.model, variables)
        self.session.need("Get" + variables[0].group, *arguments)
        return arguments[2]

    def values(self) -> Values:
        """Return the values of all variables, and the continuous states, as bytes."""
        found = {}
        for group in self.model.groups:
            array = self.get(self.model.select_variables(group))
            found[group] = b"\0".join(text or b"" for text in array) if group == "String" else bytes(array)
        if self.model.interface == "me" and self.model.states:
            found["states"] = bytes(self.states("GetContinuousStates"))
        return found

    def states(self, name: str) -> Any:
        """Return the continuous states or their derivatives as a C array; ``name`` is the FMI function that returns them."""
        array = (ctypes.c_double * self.model.states)()
        if self.model.states:
            self.session.need(name, array, self.model.states)
        return array

    def step(self, size: float, inputs: Inputs | None = None) -> None:
        """Set the inputs and make one step of the given size (s), or a shorter one to the next time event (model exchange)."""
        if self.model.interface == "cs":
            self.set(inputs or {})
            self._do_step(size)
        else:
            self._euler(size, inputs or {})

    def _do_step(self, size: float) -> None:
        if self.model.version == 2:
            self.session.need("DoStep", self.time, size, 0)
        else:
            flags = [ctypes.c_bool() for _ in range(3)]
            self.session.need("DoStep", self.time, size, False, *flags, ctypes.c_double())
        self.time += size

    def _euler(self, size: float, inputs: Inputs) -> None:
        """Make one step of the explicit Euler method, with event mode if a time event is due or a discrete input changes."""
        continuous = {v: x for v, x in inputs.items() if CONDITIONS["5"](v)}
        others = {v: x for v, x in inputs.items() if v not in continuous}
        self.set(continuous)
        new, old = self.states("Get" + self._derivatives), self.states("GetContinuousStates")
        target = min(self.time + size, self.next_event)
        size, self.time = target - self.time, target
        self.session.need("SetTime", target)
        if self.model.states:
            new[:] = [x + size * dx for x, dx in zip(old, new)]
            self.session.need("SetContinuousStates", new, self.model.states)
        kind = ctypes.c_int if self.model.version == 2 else ctypes.c_bool
        event, end = kind(), kind()
        self.session.need("CompletedIntegratorStep", 0, event, end)
        if event.value or others or target >= self.next_event:
            self.session.need("EnterEventMode")
            self.set(others)
            self._iterate()

    @property
    def _derivatives(self) -> str:
        return "Derivatives" if self.model.version == 2 else "ContinuousStateDerivatives"

    def save(self) -> Any:
        """Save the state of the FMU and return a pointer to it."""
        state = ctypes.c_void_p()
        self.session.need("GetFMUState", state)
        return state

    def restore(self, state: Any, time: float, next_event: float = math.inf) -> None:
        """Restore a saved state of the FMU, with the time of that state and the time of the next event."""
        self.session.need("SetFMUState", state)
        self.time, self.next_event = time, next_event

    def forget(self, state: Any) -> None:
        """Free a saved state."""
        self.session.need("FreeFMUState", state)


def random_inputs(rng: random.Random, model: Any, count: int) -> list[dict[Variable, Any]]:
    """Return random values of inputs for each of ``count`` steps: Real inputs at every step, others at every seventh step."""
    inputs = [v for v in model.variables if v.causality == "input" and v.size == 1]
    steps = []
    for number in range(count):
        changing = [v for v in inputs if v.is_real or number % 7 == 3]
        steps.append({v: value(rng, v) for v in changing})
    return steps


def step_size(model: Any) -> float:
    """Return the step size of a run (s): the model's step; for Euler's method in model exchange a tenth of the step."""
    return float(model.step if model.interface == "cs" else model.step / 10)


def first_difference(one: Values, other: Values, model: Any) -> str:
    """Return the first variable that differs between two sets of values: its name and both values; empty if all are equal.

    If strings or continuous states differ, return only the name of the group, String or states.
    """
    for group, data in one.items():
        if data == other[group]:
            continue
        if group in ("states", "String"):
            return group
        size = ctypes.sizeof(model.c_types[group])
        position = next(i for i in range(0, len(data), size) if data[i : i + size] != other[group][i : i + size])
        kind = model.c_types[group]
        a, b = (kind.from_buffer_copy(d[position : position + size]).value for d in (data, other[group]))
        count = position // size
        for variable in model.select_variables(group):
            if count < variable.size:
                return f"{variable.name} ({a!r} and {b!r})"
            count -= variable.size
    return ""
