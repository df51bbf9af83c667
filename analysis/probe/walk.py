"""Make random legal calls on one instance, and keep track of its state in the standard's state machine."""

from __future__ import annotations

import ctypes
import math
import random
from collections.abc import Callable, Sequence
from typing import Any

from fmpy import fmi2

from .findings import QUESTIONABLE, WRONG, Note
from .machines import MACHINES
from .model import TYPES, Model, Variable
from .session import DISCARD, ERROR, WARNING, Session, status_name

#: Weight with which a function is chosen, if it is not 1.
_WEIGHTS = {
    "Terminate": 0.1,
    "Reset": 0.2,
    "SetDebugLogging": 0.3,
    "DoStep": 6,
    "SetTime": 4,
    "CompletedIntegratorStep": 3,
}
#: Functions that may refuse a legal call, for example because they compute with values that the probe has chosen.
_MAY_REFUSE = (
    *("DoStep", "CompletedIntegratorStep"),
    *("NewDiscreteStates", "UpdateDiscreteStates", "EvaluateDiscreteStates"),
    *("GetDerivatives", "GetContinuousStateDerivatives", "GetEventIndicators"),
    *("GetStatus", "GetRealStatus", "GetBooleanStatus", "GetStringStatus"),  # useful only after Discard and Pending
)
#: States before the simulation, in which all variables are computed from start values that the probe has chosen.
_BEFORE = ("instantiated", "ready", "initialization")
_STATES = 3


def references(variables: Sequence[Variable]) -> Any:
    """Return the value references of variables as a C array."""
    return (ctypes.c_uint * len(variables))(*(v.reference for v in variables))


def value(rng: random.Random, variable: Variable) -> Any:
    """Return a random value that a variable should accept: its start value, or another value.

    Another value of a real variable is near its start and within its bounds. Of the others only inputs get other values, and
    strings that are not parameters.
    """
    if variable.group == "String":
        return (
            variable.start
            if variable.causality == "parameter"
            else rng.choice([b"", b"text", "äöü €".encode(), b"x" * 999])
        )
    if variable.group == "Boolean":
        return bool(rng.getrandbits(1)) if variable.causality == "input" else variable.start
    if not variable.is_real:
        if variable.causality == "input" and variable.maximum - variable.minimum < 1000:
            return rng.randint(int(variable.minimum), int(variable.maximum))
        return variable.start
    if rng.random() < 0.3:
        return variable.start
    scale = abs(variable.start) or min(abs(variable.nominal), 1.0)
    return min(max(variable.start + 0.03 * scale * rng.gauss(0, 1), variable.minimum), variable.maximum)


class Walk:
    """A walk through the states of one instance by random legal calls; findings are passed to ``note``."""

    def __init__(self, session: Session, rng: random.Random, note: Note) -> None:
        self.session, self.rng, self.note = session, rng, note
        self.model = session.model
        self.machine = MACHINES[self.model.version, self.model.interface]
        self.state = "instantiated"
        self.time = self.model.start_time
        self.next_event = math.inf
        self.forced: str | None = None
        self.saved: list[tuple[Any, str, float, float]] = []
        self.judged = self.logging = True
        self.functions = [name for name in self.machine.allowed if self._is_offered(name)]

    def _is_offered(self, name: str) -> bool:
        """Return whether the FMU offers a function: it declares the function, or has variables for it."""
        key, model = name.lower(), self.model
        if "serializ" in key:
            return model.can_serialize and model.can_save
        if "fmustate" in key:
            return model.can_save
        group = name[3:]
        if group in dict(TYPES[model.version].values()) and name[:3] in ("Get", "Set"):
            return group in model.groups
        return {
            "getdirectionalderivative": model.directional,
            "getadjointderivative": model.adjoint,
            "setrealinputderivatives": model.input_derivatives,
            "getrealoutputderivatives": model.output_order > 0,
            "getoutputderivatives": model.output_order > 0,
            "evaluatediscretestates": model.evaluates_discrete,
            "geteventindicators": model.indicators > 0,
            "getintegerstatus": False,  # the standard defines no status that is an Integer
            "cancelstep": False,
        }.get(key, "continuousstate" not in key or "number" in key or model.states > 0)

    def cell(self, name: str) -> str:
        """Return the cell of the standard's table for a function in the current state; after Fatal nothing is allowed."""
        if self.session.journal.fatal:
            return "."
        return self.machine.cell(name, self.state, self.session.event_mode)

    def step(self) -> None:
        """Make one random legal call, or the call that must follow now, such as EnterEventMode."""
        if self.forced is not None:
            name, self.forced = self.forced, None
            if self.cell(name) not in ".?" and self.call(name):
                return
        names = [name for name in self.functions if self.cell(name) not in ".?"]
        for _ in range(20 if names else 0):
            if self.call(self.rng.choices(names, [_WEIGHTS.get(name, 1.0) for name in names])[0]):
                return

    def go(self, target: str, most: int = 2) -> bool:
        """Walk to the state ``target``, with up to ``most`` random calls in each state passed; return whether it is reached."""
        if target == "ready" and self.model.version == 3:
            return False
        for function in self.machine.path(target, self.session.event_mode) or []:
            for _ in range(self.rng.randint(0, most)):
                names = [n for n in self.functions if self.cell(n) not in ".?" and self._keeps_state(n)]
                if names:
                    self.call(self.rng.choice(names))
            if self.cell(function) in ".?":
                return False
            while (
                self.call(function)
                and self.state == "event"
                and function in ("NewDiscreteStates", "UpdateDiscreteStates")
            ):
                if self.rng.random() < 0.05:
                    return False  # an event iteration that does not end
        return self.state == target

    def _keeps_state(self, name: str) -> bool:
        return self.machine.follow(name, "", True) == "" and name.lower() != "setfmustate"

    def call(self, name: str) -> bool:
        """Call a function with legal arguments, if there are any now; return whether the FMU accepted the call."""
        arguments = self.arguments(name)
        if arguments is None:
            return False
        before = self.state
        status = self.session.call(name, *arguments)
        self._judge(name, before, status)
        self.follow_call(name, arguments, status)
        return status <= WARNING

    def _judge(self, name: str, state: str, status: int) -> None:
        if not self.judged or state in ("error", "failed") or status <= WARNING:
            return
        full = self.session.prefix + name
        if status not in (DISCARD, ERROR):
            text = f"{full} returned {status_name(status)} for a legal call"
            self.note(WRONG, f"{name}: strange status", text)
        elif status == ERROR:
            may = name in _MAY_REFUSE or name.startswith("Set") or state in _BEFORE
            severity = QUESTIONABLE if may else WRONG
            said = f" ({self.session.messages[-1]})" if self.session.messages else ""
            self.note(
                severity,
                f"{name} in {state}: legal call refused",
                f"{full} returned Error for a legal call in the state {state!r}{said}",
            )

    def follow_call(self, name: str, arguments: Sequence[Any], status: int) -> None:
        """Update the state of the walk after a call, and keep results of the call such as saved states."""
        if status == ERROR:
            self.state = "error"
            return
        if status > WARNING:
            if name == "DoStep" and self.model.version == 2:
                self.state = "failed"
            return
        key = name.lower()
        if key in _AFTER:
            _AFTER[key](self, arguments)
        if key not in ("newdiscretestates", "updatediscretestates", "setfmustate"):
            self.state = self.machine.follow(name, self.state, self.session.event_mode)
        if self.state == "continuous" and self.time >= self.next_event and self.forced is None:
            self.forced = "EnterEventMode"

    def arguments(self, name: str, whatever: bool = False) -> list[Any] | None:
        """Return legal arguments of a function; None if there are none now.

        If ``whatever`` is true and no variable is allowed now, a call that gets or sets variables takes any variable.
        """
        group = name[3:]
        if name[:3] in ("Get", "Set") and group in self.model.c_types:
            return self._access(name[:3], group, whatever)
        make = _ARGUMENTS.get(name.lower())
        return make(self) if make else []

    def _access(self, verb: str, group: str, whatever: bool) -> list[Any] | None:
        cell = self.cell(verb + group)
        if cell in ".?":  # only for a call out of order
            cell = "x" if verb == "Get" else "3"
        variables = self.model.select_variables(group, cell)
        if not variables and whatever:
            variables = self.model.select_variables(group)
        if not variables:
            return None
        chosen = self.rng.sample(variables, min(len(variables), self.rng.randint(1, 4)))
        return access(self.model, chosen, self.values(chosen) if verb == "Set" else ())

    def values(self, variables: Sequence[Variable]) -> list[Any]:
        """Return a random legal value for each element of each variable."""
        return [value(self.rng, v) for v in variables for _ in range(v.size)]


def access(model: Model, variables: Sequence[Variable], values: Sequence[Any] = ()) -> list[Any]:
    """Return the arguments of a call that gets variables of one group, or sets them if there are ``values``."""
    size = sum(v.size for v in variables)
    array = (model.c_types[variables[0].group] * size)(*values)
    return [references(variables), len(variables), array, *([size] if model.version == 3 else [])]


def _setup_arguments(walk: Walk) -> list[Any]:
    return [walk.rng.random() < 0.5, 1e-6, walk.model.start_time, 0, 0.0]


def _step_arguments(walk: Walk) -> list[Any]:
    size = walk.model.step * (1.0 if walk.model.fixed_step else walk.rng.choice([1.0, 1.0, 0.1, 0.37, 2.0]))
    if walk.model.version == 2:
        return [walk.time, size, 0]
    return [walk.time, size, False, ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool(), ctypes.c_double()]


def _set_state(walk: Walk) -> list[Any] | None:
    return [walk.rng.choice(walk.saved)[0]] if walk.saved else None


def _get_state(walk: Walk) -> list[Any] | None:
    reuse = walk.saved and (len(walk.saved) >= _STATES or walk.rng.random() < 0.2)
    return [walk.rng.choice(walk.saved)[0]] if reuse else [ctypes.c_void_p()]


def serialize(session: Session, state: Any) -> bytes:
    """Return the bytes to which the FMU serializes a saved state."""
    size = ctypes.c_size_t()
    session.need("SerializedFMUStateSize", state, size)
    buffer = byte_array(session, bytes(size.value))
    session.need("SerializeFMUState", state, buffer, size.value)
    return bytes(buffer)


def byte_array(session: Session, data: bytes) -> Any:
    """Return bytes as a C array of the element type that the functions of the session's FMI version take."""
    kind = ctypes.c_char if session.model.version == 2 else ctypes.c_ubyte
    return (kind * len(data)).from_buffer_copy(data)


def _serialize(walk: Walk) -> list[Any] | None:
    if not walk.saved:
        return None
    state = walk.rng.choice(walk.saved)[0]
    size = ctypes.c_size_t()
    if walk.session.call("SerializedFMUStateSize", state, size) > WARNING:
        return None
    return [state, byte_array(walk.session, bytes(size.value)), size.value]


def _deserialize(walk: Walk) -> list[Any] | None:
    arguments = _serialize(walk)
    if arguments is None or walk.session.call("SerializeFMUState", *arguments) > WARNING:
        return None
    return [arguments[1], arguments[2], arguments[0]]


def _states(count: str) -> Callable[[Walk], list[Any] | None]:
    def arguments(walk: Walk) -> list[Any] | None:
        number = getattr(walk.model, count)
        return [(ctypes.c_double * number)(), number] if number else None

    return arguments


def _set_states(walk: Walk) -> list[Any] | None:
    arguments = _states("states")(walk)
    if arguments is None or walk.session.call("GetContinuousStates", *arguments) > WARNING:
        return None
    arguments[0][:] = [x + 1e-4 * walk.rng.gauss(0, 1) * (abs(x) or 1.0) for x in arguments[0]]
    return arguments


def _derivative(transposed: bool) -> Callable[[Walk], list[Any] | None]:
    def arguments(walk: Walk) -> list[Any] | None:
        if not walk.model.dependencies:
            return None
        unknown, knowns = walk.rng.choice(walk.model.dependencies)
        if walk.model.interface == "cs":  # in co-simulation only inputs are knowns
            knowns = tuple(known for known in knowns if known.causality == "input")
        known = [walk.rng.choice(knowns)] if knowns else []
        if not known or walk.state in _BEFORE:
            return None
        return derivative_arguments(walk.model.version, [unknown], known, [1.0], transposed)

    return arguments


def derivative_arguments(
    version: int,
    unknowns: Sequence[Variable],
    knowns: Sequence[Variable],
    seed: Sequence[float],
    transposed: bool = False,
) -> list[Any]:
    """Return the arguments of a call for the directional derivative along a seed, or the adjoint one if ``transposed``.

    The call writes the result into the last argument (FMI 2) or the last but one (FMI 3).
    """
    given = (ctypes.c_double * len(seed))(*seed)
    result = (ctypes.c_double * len(knowns if transposed else unknowns))()
    about = [references(unknowns), len(unknowns), references(knowns), len(knowns)]
    return [*about, given, result] if version == 2 else [*about, given, len(given), result, len(result)]


def _time_derivatives(causality: str) -> Callable[[Walk], list[Any] | None]:
    """Return a function that makes the arguments of a call to get an output's time derivative, or to set an input's."""

    def arguments(walk: Walk) -> list[Any] | None:
        known = walk.model.variables
        known = tuple(v for v in known if v.causality == causality and v.is_real and v.variability == "continuous")
        if not known:
            return None
        slope = walk.rng.gauss(0, 1) if causality == "input" else 0.0
        extra = [1] if causality == "output" and walk.model.version == 3 else []
        return [references([walk.rng.choice(known)]), 1, (ctypes.c_int * 1)(1), (ctypes.c_double * 1)(slope), *extra]

    return arguments


def update_arguments(version: int) -> list[Any]:
    """Return the arguments of a call that updates the discrete states."""
    return [fmi2.fmi2EventInfo()] if version == 2 else [*(ctypes.c_bool() for _ in range(5)), ctypes.c_double()]


def read_update(version: int, arguments: Sequence[Any]) -> tuple[bool, bool, float]:
    """Return what an update says: whether another is needed, whether the run must end, and the time of the next event."""
    info = arguments[0]
    values = [getattr(info, name) for name, _ in info._fields_] if version == 2 else [a.value for a in arguments]
    needed, terminate, _, _, defined, time = values
    return bool(needed), bool(terminate), time if defined else math.inf


def _completed_step_arguments(walk: Walk) -> list[Any]:
    kind = ctypes.c_int if walk.model.version == 2 else ctypes.c_bool
    return [0, kind(), kind()]


#: Functions that make legal arguments, by the name of an FMI function in lower case; other functions have no arguments.
_ARGUMENTS: dict[str, Callable[[Walk], list[Any] | None]] = {
    "setdebuglogging": lambda walk: [walk.rng.random() < 0.9, 0, None],
    "setupexperiment": _setup_arguments,
    "enterinitializationmode": lambda walk: _setup_arguments(walk) if walk.model.version == 3 else [],
    "dostep": _step_arguments,
    "getfmustate": _get_state,
    "setfmustate": _set_state,
    "freefmustate": _set_state,
    "serializedfmustatesize": lambda walk: [*_s, ctypes.c_size_t()] if (_s := _set_state(walk)) else None,
    "serializefmustate": _serialize,
    "deserializefmustate": _deserialize,
    "getcontinuousstates": _states("states"),
    "getderivatives": _states("states"),
    "getcontinuousstatederivatives": _states("states"),
    "getnominalsofcontinuousstates": _states("states"),
    "geteventindicators": _states("indicators"),
    "getnumberofcontinuousstates": lambda walk: [ctypes.c_size_t()],
    "getnumberofeventindicators": lambda walk: [ctypes.c_size_t()],
    "setcontinuousstates": _set_states,
    "settime": lambda walk: [min(walk.time + walk.model.step * walk.rng.random(), walk.next_event)],
    "getdirectionalderivative": _derivative(False),
    "getadjointderivative": _derivative(True),
    "getrealoutputderivatives": _time_derivatives("output"),
    "getoutputderivatives": _time_derivatives("output"),
    "setrealinputderivatives": _time_derivatives("input"),
    "newdiscretestates": lambda walk: update_arguments(walk.model.version),
    "updatediscretestates": lambda walk: update_arguments(walk.model.version),
    "completedintegratorstep": _completed_step_arguments,
    "getstatus": lambda walk: [fmi2.fmi2DoStepStatus, ctypes.c_int()],
    "getrealstatus": lambda walk: [fmi2.fmi2LastSuccessfulTime, ctypes.c_double()],
    "getbooleanstatus": lambda walk: [fmi2.fmi2Terminated, ctypes.c_int()],
    "getstringstatus": lambda walk: [fmi2.fmi2PendingStatus, ctypes.c_char_p()],
    "getintegerstatus": lambda walk: [fmi2.fmi2LastSuccessfulTime, ctypes.c_int()],
}  # fmt: skip


def _follow_step(walk: Walk, arguments: Sequence[Any]) -> None:
    walk.time += arguments[1]
    if walk.model.version == 3:
        event, terminate, early, reached = (argument.value for argument in arguments[3:])
        if early:
            walk.time = reached
        walk.forced = "Terminate" if terminate else "EnterEventMode" if event else None


def _follow_save(walk: Walk, arguments: Sequence[Any]) -> None:
    walk.saved = [entry for entry in walk.saved if entry[0] is not arguments[-1]]
    if walk.state not in ("error", "failed"):
        walk.saved.append((arguments[-1], walk.state, walk.time, walk.next_event))


def _follow_restore(walk: Walk, arguments: Sequence[Any]) -> None:
    walk.forced = None
    for state, *rest in walk.saved:
        if state is arguments[0]:
            walk.state, walk.time, walk.next_event = rest  # type: ignore[assignment]


def _follow_free(walk: Walk, arguments: Sequence[Any]) -> None:
    if arguments[0].value:
        walk.note(
            QUESTIONABLE,
            "FreeFMUState: pointer kept",
            f"{walk.session.prefix}FreeFMUstate does not set the pointer to NULL",
        )
    walk.saved = [entry for entry in walk.saved if entry[0] is not arguments[0]]


def _follow_update(walk: Walk, arguments: Sequence[Any]) -> None:
    needed, terminate, walk.next_event = read_update(walk.model.version, arguments)
    walk.state = "event" if needed else "settled"
    walk.forced = "Terminate" if terminate else None


def _follow_integrator_step(walk: Walk, arguments: Sequence[Any]) -> None:
    walk.forced = "Terminate" if arguments[2].value else "EnterEventMode" if arguments[1].value else None


def _follow_time(walk: Walk, arguments: Sequence[Any]) -> None:
    walk.time = arguments[0]


def _follow_reset(walk: Walk, arguments: Sequence[Any]) -> None:
    walk.time, walk.next_event, walk.forced = walk.model.start_time, math.inf, None


def _follow_logging(walk: Walk, arguments: Sequence[Any]) -> None:
    walk.logging = bool(arguments[0])


_AFTER: dict[str, Callable[[Walk, Sequence[Any]], None]] = {
    "dostep": _follow_step,
    "getfmustate": _follow_save,
    "setfmustate": _follow_restore,
    "freefmustate": _follow_free,
    "newdiscretestates": _follow_update,
    "updatediscretestates": _follow_update,
    "completedintegratorstep": _follow_integrator_step,
    "settime": _follow_time,
    "reset": _follow_reset,
    "setdebuglogging": _follow_logging,
}
