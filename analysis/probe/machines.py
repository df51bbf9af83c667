"""Define the state machines of the FMI standards: which function may be called in which state, and the state after it.

The tables for FMI 2 are those of FMI 2.0.4 (section 3.2.3 for model exchange, 4.2.4 for co-simulation). The tables for FMI 3
have the functions that sections 2.3, 3.2 and 4.2 of FMI 3.0 list as allowed in each state. Two states of the standard are
divided, as the text of the standard describes: `ready` is the state Instantiated after `SetupExperiment`, and `settled` is the
event mode after an update that needs no further update. In FMI 3.0 `error` is the state Terminated, to which an error leads.

A row with ``{type}`` holds for the functions of all types of variables of FMI 2: ``GetReal``, ``GetInteger`` and so on. The
cell of a function and a state is `x`: allowed; `.`: not allowed; `?`: not judged, because the standard does not decide; `e`:
allowed if the importer uses the event mode; another letter or a digit: allowed for some variables, see `model.CONDITIONS`,
where the digits are the standard's footnotes.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

_STATE = "GetFMUState SetFMUState FreeFMUState SerializedFMUStateSize SerializeFMUState DeserializeFMUState"
#: Functions that are allowed in every state. FMI 2 and FMI 3 spell some names differently.
_FMI3 = f"SetDebugLogging Reset {_STATE}"
_FMI2 = _FMI3.replace("FMUState", "FMUstate").replace("Deserialize", "DeSerialize")

_FMI2_CS = """
                             instantiated ready initialization step failed terminated error
SetupExperiment              x ? . . . . .
EnterInitializationMode      ? x . . . . .
ExitInitializationMode       . . x . . . .
Terminate                    . . . x x . .
Get{type}                    . . 2 x x x x
Set{type}                    1 1 3 6 . . .
GetDirectionalDerivative     . . x x x x x
SetRealInputDerivatives      x x x x . . .
GetRealOutputDerivatives     . . . x x x x
DoStep                       . . . x ? . .
CancelStep                   . . . . . . .
GetStatus                    . . . x x x .
Get{type}Status              . . . x x x .
"""

_FMI2_ME = """
                             instantiated ready initialization event settled continuous terminated error
SetupExperiment              x ? . . . . . .
EnterInitializationMode      ? x . . . . . .
ExitInitializationMode       . . x . . . . .
Terminate                    . . . x x x . .
Get{type}                    . . 2 x x x x x
SetReal                      1 1 3 4 4 5 . .
SetInteger                   1 1 3 4 4 . . .
SetBoolean                   1 1 3 4 4 . . .
SetString                    1 1 3 4 4 . . .
GetDirectionalDerivative     . . x x x x x x
EnterEventMode               . . . x x x . .
NewDiscreteStates            . . . x x . . .
EnterContinuousTimeMode      . . . ? x . . .
CompletedIntegratorStep      . . . . . x . .
SetTime                      . . . ? ? x . .
SetContinuousStates          . . . . . x . .
GetEventIndicators           . . x x x x x x
GetContinuousStates          . . x x x x x x
GetDerivatives               . . x x x x x x
GetNominalsOfContinuousStates x x x x x x x x
"""

_FMI3_CS = """
                             instantiated initialization event settled step error
EnterInitializationMode      x . . . . .
ExitInitializationMode       . x . . . .
Terminate                    . . x x x .
GetDirectionalDerivative     . x x x x x
GetAdjointDerivative         . x x x x x
EnterEventMode               . . . . e .
EvaluateDiscreteStates       . . x x . .
UpdateDiscreteStates         . . x x . .
EnterStepMode                . . ? x . .
GetOutputDerivatives         . . . . x x
DoStep                       . . . . x .
"""

_FMI3_ME = """
                             instantiated initialization event settled continuous error
EnterInitializationMode      x . . . . .
ExitInitializationMode       . x . . . .
Terminate                    . . x x x .
GetDirectionalDerivative     . x x x x x
GetAdjointDerivative         . x x x x x
EnterEventMode               . . . . x .
EvaluateDiscreteStates       . . x x . .
UpdateDiscreteStates         . . x x . .
EnterContinuousTimeMode      . . ? x . .
CompletedIntegratorStep      . . . . x .
SetTime                      . . . . x .
SetContinuousStates          . . . . x .
GetContinuousStateDerivatives . x x x x x
GetEventIndicators           . x x x x x
GetContinuousStates          . x x x x x
GetNominalsOfContinuousStates . x x x x x
GetNumberOfContinuousStates  x ? x x ? ?
GetNumberOfEventIndicators   x ? x x ? ?
"""

#: Types of variables of FMI 2.
_TYPES = ("Real", "Integer", "Boolean", "String")
#: Types of variables of FMI 3: those that can change continuously, and those that cannot.
FLOATS = ("Float32", "Float64")
DISCRETE = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String")

#: State to which a call of each function leads if it returns OK; other functions do not change the state.
LEADS_TO = {
    "SetupExperiment": "ready",
    "EnterInitializationMode": "initialization",
    "Terminate": "terminated",
    "Reset": "instantiated",
    "EnterEventMode": "event",
    "NewDiscreteStates": "settled",
    "UpdateDiscreteStates": "settled",
    "EnterContinuousTimeMode": "continuous",
    "EnterStepMode": "step",
}


@dataclass(frozen=True, slots=True)
class Machine:
    """The state machine of one interface of one FMI version."""

    version: int  # of FMI: 2 or 3
    interface: str  # cs or me
    states: tuple[str, ...]
    allowed: dict[str, dict[str, str]]  # the cell of each function and state

    def cell(self, function: str, state: str, event_mode: bool = False) -> str:
        """Return the cell of the table for a function and a state; `e` becomes `x` if ``event_mode``, else `.`."""
        cell = self.allowed[function][state]
        return ("x" if event_mode else ".") if cell == "e" else cell

    def follow(self, function: str, state: str, event_mode: bool = False) -> str:
        """Return the state to which a call of a function in ``state`` leads if the call returns OK."""
        if function == "ExitInitializationMode":
            return "event" if self.interface == "me" or event_mode else "step"
        following = LEADS_TO.get(function, state)
        return "error" if following == "terminated" and self.version == 3 else following

    def path(self, target: str, event_mode: bool = False) -> list[str] | None:
        """Return the shortest sequence of functions that leads from `instantiated` to a state; None if there is none."""
        reached: dict[str, list[str]] = {"instantiated": []}
        queue = deque(["instantiated"])
        while queue:
            state = queue.popleft()
            for function in (*LEADS_TO, "ExitInitializationMode"):
                if function in self.allowed and self.cell(function, state, event_mode) == "x":
                    following = self.follow(function, state, event_mode)
                    if following not in reached:
                        reached[following] = [*reached[state], function]
                        queue.append(following)
        return reached.get(target)


def _machine(version: int, interface: str, common: str, table: str) -> Machine:
    heading, *rows = table.strip().splitlines()
    states = tuple(heading.split())
    allowed = {
        name.replace("{type}", kind): dict(zip(states, cells, strict=True))
        for name, *cells in map(str.split, rows)
        for kind in _TYPES
    }
    allowed |= {function: dict.fromkeys(states, "x") for function in common.split()}
    if version == 3:
        # each type has its own functions; all variables can be read in every state, except that in Instantiated only variables
        # with a start value can be read
        last = {"cs": "6", "me": "i"}[interface]
        for kind in (*FLOATS, *DISCRETE):
            allowed["Get" + kind] = dict.fromkeys(states, "x") | {"instantiated": "s"}
            running = "." if interface == "me" and kind in DISCRETE else last
            allowed["Set" + kind] = dict(zip(states, ("1", "3", "4", "4", running, "."), strict=True))
    return Machine(version, interface, states, allowed)


#: The four state machines, by FMI version and interface.
MACHINES = {
    (2, "cs"): _machine(2, "cs", _FMI2, _FMI2_CS),
    (2, "me"): _machine(2, "me", _FMI2, _FMI2_ME),
    (3, "cs"): _machine(3, "cs", _FMI3, _FMI3_CS),
    (3, "me"): _machine(3, "me", _FMI3, _FMI3_ME),
}
