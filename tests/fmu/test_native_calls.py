"""Every function of the standards, in every state of an instance, with and without its pointers, on the native FMUs.

The tables say what FMI 2.0.4 (3.2.3 and 4.2.4) and FMI 3.0.2 (2.3, 3.2 and 4.2) allow.
"""

import ctypes
import math
from collections.abc import Iterator
from ctypes import byref, c_bool, c_char, c_char_p, c_double, c_int, c_int32, c_int64, c_size_t, c_uint32, c_void_p
from itertools import product
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from .native import DISCARD, ERROR, LOG_3, OK, Callbacks, Instance, Library, Memory, phases

INITIAL, RUN = {"instantiated"}, {"step", "event", "continuous"}
READ = {"initialization", "terminated"} | RUN
ANY = INITIAL | READ
SET = {"instantiated", "initialization", "step", "event"}
WITH_STATES = {"initialization", "event", "continuous", "terminated"}
BOTH, ME, CS, NONE = {"cs", "me"}, {"me"}, {"cs"}, set[str]()

#: Functions, the interfaces and the states in which they are allowed, by version of FMI; in others each is an error.
TABLE: dict[int, tuple[tuple[str, set[str], set[str]], ...]] = {
    2: (
        ("SetDebugLogging Reset GetFMUstate SetFMUstate FreeFMUstate", BOTH, ANY),
        ("SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate", BOTH, ANY),
        ("SetupExperiment EnterInitializationMode", BOTH, INITIAL),
        ("ExitInitializationMode", BOTH, {"initialization"}),
        ("Terminate", BOTH, RUN),
        ("GetReal GetInteger GetString GetDirectionalDerivative", BOTH, READ),
        ("SetReal", BOTH, SET | {"continuous"}),
        ("SetInteger", BOTH, {"instantiated", "initialization"}),  # all integers are fixed parameters
        ("EnterEventMode SetTime", ME, {"event", "continuous"}),
        ("NewDiscreteStates EnterContinuousTimeMode", ME, {"event"}),
        ("CompletedIntegratorStep SetContinuousStates", ME, {"continuous"}),
        ("GetDerivatives GetEventIndicators GetContinuousStates", ME, WITH_STATES),
        ("GetNominalsOfContinuousStates", ME, INITIAL | WITH_STATES),
        ("SetRealInputDerivatives", CS, {"instantiated", "initialization", "step"}),
        ("GetRealOutputDerivatives", CS, {"step", "terminated"}),
        ("GetStatus GetRealStatus GetBooleanStatus GetStringStatus", CS, {"step", "terminated"}),
        ("DoStep", CS, {"step"}),
        ("CancelStep GetIntegerStatus", NONE, NONE),
    ),
    3: (
        ("SetDebugLogging Reset GetFloat64 GetInt32 GetString GetFMUState SetFMUState FreeFMUState", BOTH, ANY),
        ("SerializedFMUStateSize SerializeFMUState DeserializeFMUState", BOTH, ANY),
        ("EnterInitializationMode", BOTH, INITIAL),
        ("ExitInitializationMode", BOTH, {"initialization"}),
        ("Terminate", BOTH, RUN),
        ("SetFloat64", BOTH, SET | {"continuous"}),
        ("SetInt32", BOTH, {"instantiated", "initialization"}),
        ("GetDirectionalDerivative GetAdjointDerivative", BOTH, READ),
        ("EnterEventMode CompletedIntegratorStep SetTime SetContinuousStates", ME, {"continuous"}),
        ("UpdateDiscreteStates EnterContinuousTimeMode", ME, {"event"}),
        ("GetContinuousStateDerivatives GetEventIndicators", ME, WITH_STATES),
        ("GetContinuousStates GetNominalsOfContinuousStates", ME, WITH_STATES),
        ("GetNumberOfContinuousStates GetNumberOfEventIndicators", ME, ANY),
        ("GetOutputDerivatives", CS, {"step", "terminated"}),
        ("DoStep", CS, {"step"}),
        ("EnterConfigurationMode ExitConfigurationMode EvaluateDiscreteStates EnterStepMode", NONE, NONE),
        ("ActivateModelPartition GetNumberOfVariableDependencies GetVariableDependencies", NONE, NONE),
    ),
}
ALLOWED = {fmi: {name: row for names, *row in rows for name in names.split()} for fmi, rows in TABLE.items()}

#: Functions for values of types that no variable has: good for none, an error for one.
EMPTY = {
    2: ("GetBoolean", "SetBoolean"),
    3: tuple(f"{verb}{what}" for verb in ("Get", "Set") for what in (
        "Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "Boolean", "Binary", "Clock",
        "IntervalDecimal", "IntervalFraction", "ShiftDecimal", "ShiftFraction",
    )),
}  # fmt: skip


@pytest.fixture(scope="module", params=["FiveBarSlider-native", "FiveBarSlider-native-fmi3", "SliderCrank-native-fmi3"])
def library(
    request: pytest.FixtureRequest, natives: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> Library:
    return Library(natives[request.param], tmp_path_factory.mktemp("library"))


class Good:
    """Arguments of every function with which it is good, pointers last so that they can be left out one by one."""

    def __init__(self, instance: Instance) -> None:
        self.c = c = instance
        self.kept: list[Any] = []
        one = c.library.references
        self.force, self.out = (c_uint32 * 1)(one["drive.torque"]), (c_uint32 * 1)(one["crank.acceleration"])
        self.number = (c_double * 1)(0.0)
        self.n = c_size_t(1)
        self.x = (c_double * 6)()

    def arguments(self, name: str) -> tuple[Any, ...]:
        if name.lower().endswith(("fmustate", "fmustatesize")):
            return self.arguments_of_state(name)
        n, three, size = self.n, self.c.library.fmi == 3, c_size_t()
        values, states = (n,) if three else (), (self.x, c_size_t(6))
        flag = c_bool(True) if three else 1
        get, put = (self.out, n, self.number, *values), (self.force, n, self.number, *values)
        mode, message = ((c_uint32 * 1)(self.c.library.references[of]) for of in ("drive.mode", "solver.message"))
        integer = (mode, n, (c_int32 * 1)(1), *values)
        derivative = (self.out, n, self.force, n, (c_double * 1)(1.0), *values, (c_double * 1)(), *values)
        slope = (n, (c_int * 1)(1), self.number, *values)
        reached = (*(byref(c_bool()) for _ in range(3)), byref(c_double())) if three else ()
        return {
            "SetDebugLogging": (flag, c_size_t(0), None),
            "SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
            "EnterInitializationMode": (c_bool(False), 0.0, 0.0, c_bool(False), 0.0) if three else (),
            **dict.fromkeys(("GetReal", "GetFloat64"), get),
            **dict.fromkeys(("SetReal", "SetFloat64"), put),
            **dict.fromkeys(("GetInteger", "SetInteger", "GetInt32", "SetInt32"), integer),
            "GetString": (message, n, (c_char_p * 1)(), *values),
            **dict.fromkeys(("GetDirectionalDerivative", "GetAdjointDerivative"), derivative),
            "SetRealInputDerivatives": (self.force, *slope),
            **dict.fromkeys(("GetRealOutputDerivatives", "GetOutputDerivatives"), (self.out, *slope)),
            "NewDiscreteStates": ((c_int * 8)(),),
            "UpdateDiscreteStates": (*(byref(c_bool()) for _ in range(5)), byref(c_double())),
            "CompletedIntegratorStep": (flag, byref(c_int()), byref(c_int())),
            "SetTime": (0.5,),
            **dict.fromkeys(("GetNumberOfContinuousStates", "GetNumberOfEventIndicators"), (byref(size),)),
            "GetNumberOfVariableDependencies": (c_uint32(0), byref(size)),
            "GetEventIndicators": ((c_double * 1)(), n),
            **dict.fromkeys(("SetContinuousStates", "GetContinuousStates", "GetNominalsOfContinuousStates"), states),
            **dict.fromkeys(("GetDerivatives", "GetContinuousStateDerivatives"), states),
            "DoStep": (0.0, 1e-3, flag, *reached),
            "GetStatus": (0, byref(c_int())),
            "GetRealStatus": (2, byref(c_double())),
            "GetBooleanStatus": (3, byref(c_int())),
            "GetStringStatus": (1, byref(c_char_p())),
            "GetIntegerStatus": (3, (c_int * 1)()),
            "ActivateModelPartition": (c_uint32(0), 0.0),
            "GetVariableDependencies": (c_uint32(0), None, None, None, None, c_size_t(0)),
        }.get(name, ())

    def arguments_of_state(self, name: str) -> tuple[Any, ...]:
        verb = name.lower().partition("fmu")[0]
        if verb == "get":
            return (byref(c_void_p()),)
        state, size = self.state(), c_size_t()
        if verb in ("set", "free"):
            return (state if verb == "set" else byref(state),)
        if verb == "serialized":
            return (state, byref(size))
        self.c(f"SerializedFMU{'S' if self.c.library.fmi == 3 else 's'}tateSize", state, byref(size))
        text = (c_char * size.value)()
        if verb == "serialize":
            return (state, text, size)
        assert self.c.with_state("Serialize", state, text, size) == OK
        return (text, size, byref(c_void_p()))

    def state(self) -> c_void_p:
        self.kept.append(self.c.saved())
        return self.kept[-1]


def every(library: Library) -> Iterator[tuple[str, str, str, Instance]]:
    """Each function with an instance in each state of each interface."""
    for name, interface in product(ALLOWED[library.fmi], ("cs", "me")):
        for phase, instance in phases(library, interface):
            yield name, interface, phase, instance


def test_the_tables_have_every_function_of_the_standard(library: Library) -> None:
    prefix = f"fmi{library.fmi}"
    known = {prefix + name for name in (*ALLOWED[library.fmi], *EMPTY[library.fmi], "FreeInstance", "GetVersion")}
    known |= {"fmi2Instantiate", "fmi2GetTypesPlatform", "fmi2SetString"} if library.fmi == 2 else {
        "fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange", "fmi3InstantiateScheduledExecution",
        "fmi3SetString",
    }  # fmt: skip
    assert set(library.functions) == known


def test_a_function_is_good_where_it_is_allowed_and_an_error_elsewhere(library: Library) -> None:
    wrong = []
    for name, interface, phase, c in every(library):
        interfaces, states = ALLOWED[library.fmi][name]
        arguments = Good(c).arguments(name)
        c.log.clear()
        status = c(name, *arguments)
        wanted = OK if interface in interfaces and phase in states else ERROR
        if status != wanted:
            wrong.append((name, interface, phase, status, c.log))
        if wanted == ERROR:
            # one sentence that names the function, though no logging was asked for, and an instance that goes on
            assert len(c.log) == 1, (name, phase, c.log)
            assert c.log[0][0] == ERROR
            assert f"fmi{library.fmi}{name}" in c.log[0][1] or "fixed parameter" in c.log[0][1]
            assert c("Reset") == OK
            assert c.enter() == OK
    assert wrong == []


def test_a_missing_pointer_is_an_error(library: Library) -> None:
    harmless = {"SetDebugLogging", "FreeFMUstate", "FreeFMUState", "GetVariableDependencies"}
    for name, (interfaces, states) in ALLOWED[library.fmi].items():
        for interface in interfaces:
            for phase, c in phases(library, interface):
                if phase in states and name not in harmless:
                    arguments = Good(c).arguments(name)
                    for place, argument in enumerate(arguments):
                        if isinstance(argument, ctypes.Array | c_void_p) or "CArgObject" in type(argument).__name__:
                            left_out = (*arguments[:place], None, *arguments[place + 1 :])
                            c.log.clear()
                            assert c(name, *left_out) == ERROR, (name, place)
                            assert "a pointer is missing" in c.log[0][1]


def test_no_instance_is_an_error(library: Library) -> None:
    c = library.instance()
    good = Good(c)
    calls = {name: good.arguments(name) for name in ALLOWED[library.fmi]}
    calls |= {name: (None, c_size_t(0), None, c_size_t(0)) for name in (*EMPTY[library.fmi], "SetString")}
    for name, arguments in calls.items():
        handle, c.handle = c.handle, None
        assert c(name, *arguments) == ERROR, name
        c.free()  # does nothing
        c.handle = handle


def test_types_that_no_variable_has(library: Library) -> None:
    c = library.instance().start()
    for name in EMPTY[library.fmi]:
        assert c(name, None, c_size_t(0), None, c_size_t(0), c_size_t(0)) == OK, name
        assert c(name, None, c_size_t(1), None, c_size_t(1), c_size_t(1)) == ERROR, name
        assert "nothing of the kind" in c.log[-1][1]


def test_references_and_types(library: Library) -> None:
    c = library.instance().start()
    references = library.references

    def get(name: str, reference: int) -> int:
        return c(name, (c_uint32 * 1)(reference), c_size_t(1), (c_int64 * 1)(), c_size_t(1))

    integer = "GetInteger" if library.fmi == 2 else "GetInt32"
    for name, wrong in (
        (c.real("Get"), ("solver.status", "drive.mode", "solver.message")),
        (integer, ("crank.angle", "solver.message")),
        ("GetString", ("crank.angle", "drive.mode", "solver.status")),
    ):
        for other in wrong:
            assert get(name, references[other]) == ERROR
            assert c.log[-1] == (ERROR, c.log[-1][1])
            assert other in c.log[-1][1]
        for outside in (len(references), 2**31, 2**32 - 1):
            assert get(name, outside) == ERROR
            assert f"no variable with the value reference {outside}" in c.log[-1][1]
    c("Reset")
    assert c.set(**{"solver.message": 1.0}) == ERROR
    assert c.set(**{"solver.status": 1}) == ERROR
    assert "solver.status is computed" in c.log[-1][1]
    c.start()
    assert get(integer, references["drive.mode"]) == OK
    assert c("SetString", *c.arrays(["solver.message"], (c_char_p * 1)(b"\xff"))) == ERROR
    assert c("SetString", None, c_size_t(1), None, c_size_t(1)) == ERROR
    assert c("SetString", None, c_size_t(0), None, c_size_t(0)) == OK
    assert c("SetString", *c.arrays(["crank.angle"], (c_char_p * 1)(b"\xff"))) == ERROR


def test_what_is_computed_or_fixed_cannot_be_set(library: Library) -> None:
    c = library.instance()
    assert c.set(crank__angle=1.0) == OK  # a guess, initial="approx": it is not needed
    for name in ("time", "power.supplied"):
        assert c.set(**{name: 1.0}) == ERROR
        assert f"{name} is computed, it cannot be set" in c.log[-1][1]
    assert c.enter() == OK
    assert c.set(crank__angle=1.0) == ERROR
    assert c.get("crank.angle") == [0.0]
    c = library.instance().start()
    before = c.get("crank.acceleration")
    assert c.set(crank__length=3.0) == ERROR
    assert "crank.length is a fixed parameter, it cannot be set in step mode" in c.log[-1][1]
    assert c.get("crank.acceleration") == before
    assert c.step(0.0, 1e-3) == OK


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"token": "{wrong}"}, "the GUID or token is {wrong}: that of this FMU is"),
        ({"token": ""}, "the GUID or token is missing"),
        ({"name": b""}, "an instance must have a name"),
        ({"name": None}, "an instance must have a name"),
    ],
)
def test_instances_that_are_refused(library: Library, options: dict[str, Any], sentence: str) -> None:
    for interface in ("cs", "me"):
        c = library.instance(interface, **options)
        assert c.handle is None
        ((status, logged),) = c.log
        assert (status, sentence in logged) == (ERROR, True)
        # and without anyone to say it to
        assert library.instance(interface, callbacks=False, **options).handle is None


def test_interfaces_that_there_are_not(library: Library) -> None:
    dll = library.dll
    token = library.token.encode()
    if library.fmi == 2:
        assert dll.fmi2Instantiate(b"x", 7, token, None, byref(Callbacks()), 0, 0) is None
        assert dll.fmi2Instantiate(b"x", 1, token, None, None, 0, 0) is None  # no callbacks
        return
    for refused, sentence in ((library.instance(event_mode=True), "no event mode"), (None, "no scheduled execution")):
        if refused is not None:
            assert refused.handle is None
            assert sentence in refused.log[0][1]
    said: list[bytes] = []
    log = LOG_3(lambda _, status, category, text: said.append(text))
    for logger in (log, None):
        head = (b"x", token, None, c_bool(False), c_bool(False), None, logger, None, None, None)
        assert dll.fmi3InstantiateScheduledExecution(*head) is None
    assert said == [b"this FMU has no scheduled execution"]


def test_no_callbacks_at_all(library: Library) -> None:
    c = library.instance(callbacks=False).start()
    assert c.step(5.0, 1e-3) == DISCARD
    assert c("ExitInitializationMode") == ERROR
    assert c.step(0.0, 1e-3) == OK


def test_memory_is_that_of_the_host_and_none_is_asked_for_in_a_step(library: Library) -> None:
    if library.fmi == 3:
        pytest.skip("FMI 3.0 has no such functions")
    memory = Memory()
    c = library.instance(memory=memory).start()
    asked = memory.asked
    assert asked > 0
    for k in range(10):
        assert c.step(1e-3 * k, 1e-3) == OK
    assert memory.asked == asked
    state = c_void_p()
    for _ in range(2):
        assert c("GetFMUstate", byref(state)) == OK
    assert memory.asked == asked + 1
    assert c("FreeFMUstate", byref(state)) == OK
    assert state.value is None
    assert c("FreeFMUstate", byref(state)) == OK
    assert len(memory.given) == asked
    c.free()
    assert memory.given == {}
    # one function alone is of no use
    memory = Memory()
    memory.functions[1] = c_void_p()
    assert library.instance(memory=memory).start().step(0.0, 1e-3) == OK
    assert memory.asked == 0


def test_memory_that_runs_out(library: Library) -> None:
    if library.fmi == 3:
        pytest.skip("FMI 3.0 has no such functions")
    full = Memory()
    first = library.instance(memory=full)
    assert first.handle is not None
    for most in range(full.asked):
        memory = Memory(most)
        assert library.instance(memory=memory).handle is None
        assert memory.given == {}
    c = library.instance(memory=Memory(full.asked)).start()
    state, text = c_void_p(), b"{}"
    assert c("GetFMUstate", byref(state)) == ERROR
    assert c("DeSerializeFMUstate", text, c_size_t(len(text)), byref(state)) == ERROR
    assert [said for _, said in c.log] == 2 * ["there is no memory for a saved state"]
    assert c.step(0.0, 1e-3) == OK


def test_times_of_the_setup(library: Library) -> None:
    def setup(tolerance: float | None, start: float, stop: float | None) -> int:
        c = library.instance()
        given, ends = tolerance is not None, stop is not None
        numbers = (c_double(tolerance or 0.0), c_double(start), c_double(stop or 0.0))
        if library.fmi == 2:
            status = c("SetupExperiment", int(given), numbers[0], numbers[1], int(ends), numbers[2])
        else:
            status = c("EnterInitializationMode", c_bool(given), numbers[0], numbers[1], c_bool(ends), numbers[2])
        said.append(c.log[-1][1] if c.log else "")
        return status

    said: list[str] = []
    assert (setup(1e-6, 1.0, 2.0), setup(None, 1.0, 1.0)) == (OK, OK)
    for tolerance, start, stop, sentence in (
        (None, math.nan, None, "the time at the start is nan s: it must be a finite number"),
        (None, 0.0, -1.0, "the stop time is -1 s: it must not be before the start time"),
        (None, 1.0, math.nan, "the stop time is nan s"),
        (0.0, 0.0, None, "the tolerance is 0: it must be greater than zero"),
        (math.inf, 0.0, None, "the tolerance is inf"),
    ):
        assert setup(tolerance, start, stop) == ERROR
        assert sentence in said[-1]


def test_messages_have_a_decimal_point_in_every_locale(library: Library) -> None:
    libc = ctypes.CDLL(None)
    libc.setlocale.restype = c_char_p
    numeric = 1
    before = libc.setlocale(numeric, None)
    if libc.setlocale(numeric, b"de_DE.UTF-8") is None:
        pytest.skip("there is no locale with a decimal comma on this machine")
    try:
        c = library.instance().start()
        assert c.step(0.25, 1e-3) == DISCARD
        assert "it starts at t = 0.25 s" in c.text()
    finally:
        libc.setlocale(numeric, before)


def test_categories_of_the_log(library: Library) -> None:
    root = ElementTree.parse(library.folder / "modelDescription.xml").getroot()
    declared = [str(node.get("name")).encode() for node in root.findall("LogCategories/Category")]
    assert len(declared) == 5
    c = library.instance().start()

    def ask(on: bool, *names: bytes | None) -> int:
        flag: Any = c_bool(on) if library.fmi == 3 else int(on)
        return c("SetDebugLogging", flag, c_size_t(len(names)), (c_char_p * max(len(names), 1))(*names))

    def logged() -> int:
        c.log.clear()
        assert c.step(5.0, 1e-3) == DISCARD
        return len(c.log)

    assert c("SetDebugLogging", c_bool(True) if library.fmi == 3 else 1, c_size_t(1), None) == ERROR
    assert ask(True, b"logStatusWarning", b"logStatusError") == OK
    assert logged() == 0
    for name in (b"logStatusDiscard", b"logAll"):
        assert ask(True, name) == OK
        assert logged() == 1
        assert ask(False, name) == OK
        assert logged() == 0
    assert ask(True, *declared) == OK
    for name, word in ((b"logStatusDscard", "logStatusDscard"), (None, "without a name")):
        assert ask(True, b"logStatusFatal", name) == ERROR
        assert f"there is no category {word}" in c.log[-1][1]


def test_no_step_past_the_stop_time(library: Library) -> None:
    for interface in ("cs", "me"):
        c = library.instance(interface)
        numbers = (c_double(0.0), c_double(1.0), c_double(2.0))
        if library.fmi == 2:
            assert c("SetupExperiment", 0, *numbers[:2], 1, numbers[2]) == OK
            assert c("EnterInitializationMode") == OK
        else:
            assert c("EnterInitializationMode", c_bool(False), *numbers[:2], c_bool(True), numbers[2]) == OK
        assert c("ExitInitializationMode") == OK
        if interface == "cs":
            assert c.step(1.0, 1.1) == ERROR
            assert c.text() == c.log[-1][1] == "a step to t = 2.1 s: the stop time is 2 s"
            assert c.step(1.0, 0.1) == OK
            assert c.step(1.1, 0.9 + 1e-9) == OK
        else:
            assert c("EnterContinuousTimeMode") == OK
            for time in (0.9, math.nan, math.inf):
                assert c("SetTime", time) == ERROR
                assert "it must be finite and not before the start" in c.log[-1][1]
            # solvers try what is beyond the end, and come back
            assert c("SetTime", 2.1) == OK


def test_debug_logging_says_what_is_refused(library: Library) -> None:
    quiet, loud = library.instance().start(), library.instance(logging=True).start()
    for c, times in ((quiet, 0), (loud, 1)):
        assert c.step(5.0, 1e-3) == DISCARD
        assert [status for status, _ in c.log] == [DISCARD] * times
    on = (c_bool(True) if library.fmi == 3 else 1, c_size_t(0), None)
    assert quiet("SetDebugLogging", *on) == OK
    assert quiet.step(5.0, 1e-3) == DISCARD
    assert "a step over a gap" in quiet.log[-1][1]
