"""List calls that the FMI standards forbid: with wrong arguments, or of a function in a state where it is not allowed.

Each fault has the severity of the finding if the FMU accepts the call: `WRONG` if the standard demands an error, `QUESTIONABLE`
if the standard recommends care, `None` if only a crash or a hang is a finding. `ACCEPT` marks unusual calls that are allowed:
if the FMU returns an error, the finding is questionable.
"""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from fmpy import fmi2, fmi3

from .findings import QUESTIONABLE, WRONG
from .model import CONDITIONS, Model, Variable
from .walk import Walk, access, byte_array, references

ACCEPT = "accept"
NAN, INF = math.nan, math.inf

#: A function that turns a list of legal arguments into wrong arguments; it returns None if the fault does not apply.
Change = Callable[[Walk, str, list[Any]], list[Any] | None]


@dataclass(frozen=True, slots=True)
class Fault:
    """A kind of forbidden call of one function."""

    function: str  # name of the function without the prefix fmi2 or fmi3
    what: str  # what is wrong with the call
    accepted: str | None  # severity of the finding if the call is accepted, or `ACCEPT`
    change: Change  # makes the wrong arguments from legal ones
    state: str | None = None  # state in which the call is made; None: any state in which the function is allowed

    @property
    def key(self) -> str:
        return f"{self.function}{' in ' + self.state if self.state else ''}: {self.what}"


def swap_argument(position: int, value: Any) -> Change:
    """Return a change that replaces the argument at a position by ``value``; a negative position counts from the end.

    If ``value`` is a function, the argument is replaced by its result.
    """

    def change(walk: Walk, name: str, arguments: list[Any]) -> list[Any] | None:
        if len(arguments) <= position:
            return None
        arguments[position] = value(walk, arguments) if callable(value) else value
        return arguments

    return change


def _set_first_element(position: int, number: float) -> Change:
    def change(walk: Walk, name: str, arguments: list[Any]) -> list[Any] | None:
        arguments[position][0] = number
        return arguments

    return change


def _unknown_references(walk: Walk, arguments: Sequence[Any]) -> Any:
    used = {v.reference for v in walk.model.variables}
    free = next(n for n in (0xFFFFFFF0, 0x7FFFFFFF, 0x00FFFFFF) if n not in used)
    return (ctypes.c_uint * len(arguments[0]))(*[free] * len(arguments[0]))


def _references_of_other_type(walk: Walk, name: str, arguments: list[Any]) -> list[Any] | None:
    own = {v.reference for v in walk.model.variables if v.group == name[3:]}
    others = [v for v in walk.model.variables if v.reference not in own and v.size == 1]
    if not others:
        return None
    one = [references([walk.rng.choice(others)]), 1, (walk.model.c_types[name[3:]] * 1)()]
    return [*one, 1] if walk.model.version == 3 else one


def _set_forbidden_variable(walk: Walk, name: str, arguments: list[Any]) -> list[Any] | None:
    cell = walk.cell(name)
    allowed = CONDITIONS["5" if cell == "i" else cell]  # FMI 3.0 contradicts itself on states in continuous-time mode
    forbidden = [v for v in walk.model.variables if v.group == name[3:] and not allowed(v)]
    return _arguments_to_set(walk, forbidden)


def _arguments_to_set(walk: Walk, variables: list[Variable]) -> list[Any] | None:
    """Return the arguments of a call that sets one of ``variables``, chosen at random; None if there are no variables."""
    chosen = [walk.rng.choice(variables)] if variables else []
    return access(walk.model, chosen, walk.values(chosen)) if chosen else None


def _set_constant(walk: Walk, name: str, arguments: list[Any]) -> list[Any] | None:
    constants = [v for v in walk.model.variables if v.group == name[3:] and v.variability == "constant"]
    return _arguments_to_set(walk, constants)


def _lengthen_array(walk: Walk, name: str, arguments: list[Any]) -> list[Any]:
    """Return arguments with a count that is too large by one; the array has room for the further element."""
    array = arguments[-2]
    longer = (array._type_ * (len(array) + 1))()
    longer[: len(array)] = list(array)
    return [*arguments[:-2], longer, len(array) + 1]


def _change_bytes(data: Callable[[bytes], bytes]) -> Change:
    def change(walk: Walk, name: str, arguments: list[Any]) -> list[Any]:
        altered = data(bytes(arguments[0]))
        return [byte_array(walk.session, altered), len(altered), ctypes.c_void_p()]

    return change


def _shorten_buffer(walk: Walk, name: str, arguments: list[Any]) -> list[Any] | None:
    size = len(arguments[1]) - 1
    return [arguments[0], byte_array(walk.session, bytes(size)), size] if size >= 0 else None


def _use_unknown_category(walk: Walk, name: str, arguments: list[Any]) -> list[Any]:
    return [True, 1, (ctypes.c_char_p * 1)(b"no such category")]


def _change_start(position: int, value: float) -> Change:
    """Return a change of a time or the tolerance in the call of SetupExperiment (FMI 2) or EnterInitializationMode (FMI 3).

    ``position`` is the index of the argument, ``value`` the new value.
    """

    def change(walk: Walk, name: str, arguments: list[Any]) -> list[Any] | None:
        if len(arguments) != 5:
            return None
        arguments[0], arguments[3] = True, position == 4
        arguments[position] = value
        return arguments

    return change


_VECTORS = (
    "[GS]etContinuousStates|GetNominalsOfContinuousStates|GetDerivatives|Get.*StateDerivatives|GetEventIndicators"
)
_PARTIAL = "GetDirectionalDerivative|GetAdjointDerivative"
_SLOPES = "GetRealOutputDerivatives|GetOutputDerivatives|SetRealInputDerivatives"

#: Function (a pattern of names without prefix), what is wrong, severity if the call is accepted, change of the arguments
FAULTS: tuple[tuple[str, str, str | None, Change], ...] = (
    ("[GS]et{type}", "unknown value reference", WRONG, swap_argument(0, _unknown_references)),
    ("[GS]et{type}", "value reference of another type", WRONG, _references_of_other_type),
    ("[GS]et{type}", "NULL value references", WRONG, swap_argument(0, None)),
    ("[GS]et{type}", "NULL values", WRONG, swap_argument(2, None)),
    ("[GS]et{type}", "wrong number of values", WRONG, swap_argument(3, lambda walk, a: a[3] - 1)),
    ("Set{type}", "a variable that may not be set", WRONG, _set_forbidden_variable),
    ("Set{type}", "a constant", WRONG, _set_constant),
    ("SetReal|SetFloat64", "NaN", None, _set_first_element(2, NAN)),
    ("SetReal|SetFloat64", "infinity", None, _set_first_element(2, INF)),
    ("SetReal|SetFloat64", "1e300", None, _set_first_element(2, 1e300)),
    ("SetString", "NULL string", QUESTIONABLE, lambda walk, n, a: [a[0], a[1], (ctypes.c_char_p * a[1])(), *a[3:]]),
    ("SetString", "invalid UTF-8", QUESTIONABLE, _set_first_element(2, b"\xff\xfe\xc3(")),  # type: ignore[arg-type]
    ("SetString", "1 MB of text", None, _set_first_element(2, b"x" * 1_000_000)),  # type: ignore[arg-type]
    ("DoStep", "step of zero", QUESTIONABLE, swap_argument(1, 0.0)),
    ("DoStep", "negative step", WRONG, swap_argument(1, lambda walk, a: -a[1])),
    ("DoStep", "step of NaN", WRONG, swap_argument(1, NAN)),
    ("DoStep", "infinite step", WRONG, swap_argument(1, INF)),
    ("DoStep", "time of NaN", WRONG, swap_argument(0, NAN)),
    ("DoStep", "a gap in time", QUESTIONABLE, swap_argument(0, lambda walk, a: a[0] + 10 * a[1])),
    ("DoStep", "a time in the past", QUESTIONABLE, swap_argument(0, lambda walk, a: a[0] - 10 * a[1])),
    ("DoStep", "NULL results", QUESTIONABLE, swap_argument(3, None)),
    ("SetTime", "NaN", QUESTIONABLE, swap_argument(0, NAN)),
    ("SetTime", "infinity", QUESTIONABLE, swap_argument(0, INF)),
    ("SetTime", "before the start", QUESTIONABLE, swap_argument(0, lambda walk, a: walk.model.start_time - 1.0)),
    ("SetupExperiment|EnterInitializationMode", "start at NaN", QUESTIONABLE, _change_start(2, NAN)),
    ("SetupExperiment|EnterInitializationMode", "stop before start", QUESTIONABLE, _change_start(4, -1e9)),
    ("SetupExperiment|EnterInitializationMode", "tolerance of NaN", QUESTIONABLE, _change_start(1, NAN)),
    ("SetupExperiment|EnterInitializationMode", "negative tolerance", QUESTIONABLE, _change_start(1, -1.0)),
    ("GetFMU[sS]tate", "NULL", WRONG, swap_argument(0, None)),
    ("SetFMU[sS]tate", "NULL state", WRONG, swap_argument(0, None)),
    ("FreeFMU[sS]tate", "NULL pointer", ACCEPT, swap_argument(0, None)),
    ("FreeFMU[sS]tate", "pointer to NULL", ACCEPT, swap_argument(0, lambda walk, a: ctypes.c_void_p())),
    ("Serialize.*", "NULL state", WRONG, swap_argument(0, None)),
    ("SerializedFMU[sS]tateSize", "NULL size", WRONG, swap_argument(1, None)),
    ("SerializeFMU[sS]tate", "NULL bytes", WRONG, swap_argument(1, None)),
    ("SerializeFMU[sS]tate", "too little room", WRONG, _shorten_buffer),
    ("De[sS]erializeFMU[sS]tate", "NULL bytes", WRONG, swap_argument(0, None)),
    ("De[sS]erializeFMU[sS]tate", "NULL state", WRONG, swap_argument(2, None)),
    ("De[sS]erializeFMU[sS]tate", "no bytes", WRONG, _change_bytes(lambda data: b"")),
    ("De[sS]erializeFMU[sS]tate", "bytes of something else", WRONG, _change_bytes(lambda data: b"this is not a state" * 10)),
    ("De[sS]erializeFMU[sS]tate", "half of the bytes", WRONG, _change_bytes(lambda data: data[: len(data) // 2])),
    ("De[sS]erializeFMU[sS]tate", "a byte changed", None, _change_bytes(lambda data: data[:-9] + b"\x55" + data[-8:])),
    (_PARTIAL, "unknown unknown", WRONG, swap_argument(0, _unknown_references)),
    (_PARTIAL, "unknown known", WRONG, swap_argument(2, lambda w, a: _unknown_references(w, a[2:3]))),
    (_PARTIAL, "NULL seed", WRONG, swap_argument(4, None)),
    (_PARTIAL, "NaN seed", None, _set_first_element(4, NAN)),
    (_VECTORS, "one too many", WRONG, _lengthen_array),
    (_VECTORS, "NULL array", WRONG, swap_argument(0, None)),
    ("SetContinuousStates", "NaN", None, _set_first_element(0, NAN)),
    (_SLOPES, "order 0", WRONG, _set_first_element(2, 0)),
    (_SLOPES, "order 1000", WRONG, _set_first_element(2, 1000)),
    (_SLOPES, "unknown value reference", WRONG, swap_argument(0, _unknown_references)),
    ("GetStatus|GetRealStatus|GetBooleanStatus|GetStringStatus", "unknown kind", WRONG, swap_argument(0, 99)),
    ("GetStatus|GetRealStatus|GetBooleanStatus|GetStringStatus", "NULL value", WRONG, swap_argument(1, None)),
    ("CompletedIntegratorStep", "NULL results", WRONG, swap_argument(1, None)),
    ("NewDiscreteStates|UpdateDiscreteStates", "NULL results", WRONG, swap_argument(0, None)),
    ("SetDebugLogging", "unknown category", QUESTIONABLE, _use_unknown_category),
    ("SetDebugLogging", "NULL categories", WRONG, lambda walk, n, a: [True, 1, None]),
)  # fmt: skip


#: Faults that FMI 3.0 forbids explicitly and FMI 2.0 does not.
_DEMANDED_IN_3 = ("step of zero",)


def catalogue(walk: Walk) -> list[Fault]:
    """Return all faults that can be tried on the FMU of ``walk``, always in the same order."""
    model, machine = walk.model, walk.machine
    groups = "(" + "|".join(model.groups) + ")"
    faults = [
        Fault(name, what, WRONG if what in _DEMANDED_IN_3 and model.version == 3 else accepted, change)
        for pattern, what, accepted, change in FAULTS
        for name in walk.functions
        if re.fullmatch(pattern.replace("{type}", groups), name)
    ]
    faults += [Fault(name, "NULL instance", WRONG, lambda walk, n, a: a) for name in walk.functions]
    faults.append(Fault("FreeInstance", "NULL instance", ACCEPT, lambda walk, n, a: a))
    faults += [
        Fault(name, "out of order", WRONG, lambda walk, n, a: a, state)
        for name in machine.allowed
        if name in walk.functions or name in ("CancelStep", "GetIntegerStatus")
        for state in machine.states
        if machine.cell(name, state) == "." and machine.path(state) is not None
    ]
    return faults


@dataclass(frozen=True, slots=True)
class BadStart:
    """A forbidden or unusual instantiation, with a changed argument."""

    what: str  # what is wrong or unusual
    accepted: str | None  # severity of the finding if the FMU makes an instance, or `ACCEPT`
    position: int  # position of the changed argument
    value: Any  # value of the changed argument

    @property
    def key(self) -> str:
        return f"Instantiate: {self.what}"


def bad_starts(model: Model) -> list[BadStart]:
    """Return all forbidden or unusual instantiations that can be tried on an FMU."""
    two = model.version == 2
    token = {2: 2, 3: 1}[model.version]
    starts = [
        BadStart("wrong GUID" if two else "wrong token", WRONG if two else QUESTIONABLE, token, b"{0}"),
        BadStart("NULL GUID" if two else "NULL token", WRONG, token, None),
        BadStart("NULL name", WRONG, 0, None),
        BadStart("empty name", QUESTIONABLE, 0, b""),
        BadStart("name of invalid UTF-8", None, 0, b"\xff\xfe\xc3("),
    ]
    if two:
        other = fmi2.fmi2ModelExchange if model.interface == "cs" else fmi2.fmi2CoSimulation
        starts += [
            BadStart("NULL callbacks", QUESTIONABLE, 4, None),
            BadStart("unknown type", WRONG, 1, 99),
            *([] if model.other_interface else [BadStart("an interface that it does not have", WRONG, 1, other)]),
        ]
    else:
        stepped = model.interface == "cs"
        if stepped and not model.event_mode:
            starts.append(BadStart("event mode that it does not have", WRONG, 5, True))
        starts.append(BadStart("NULL logger", ACCEPT, 10 if stepped else 6, fmi3.fmi3LogMessageCallback()))
    return starts
