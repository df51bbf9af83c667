"""A master for FMI 2.0 co-simulation that uses only the standard library: ctypes on the shared library of an FMU.

It hides nothing: every call returns the FMI status, and log messages of the FMU go through printf as in a master in C. The
tests use it in processes of their own, one of them a Python with no package installed.
"""

from __future__ import annotations

import ctypes
import sys
import zipfile
from ctypes import byref, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from xml.etree import ElementTree

OK, WARNING, DISCARD, ERROR, FATAL = range(5)

CO_SIMULATION = 1

#: The logger reads one argument after the format; the FMUs never pass more.
_LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_void_p)
_ALLOCATE = ctypes.CFUNCTYPE(c_void_p, c_size_t, c_size_t)
_FREE = ctypes.CFUNCTYPE(None, c_void_p)
_STEP_FINISHED = ctypes.CFUNCTYPE(None, c_void_p, c_int)

_C_TYPES = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
_libc = ctypes.CDLL(None)
_libc.calloc.restype = c_void_p
_libc.calloc.argtypes = [c_size_t, c_size_t]
_libc.free.argtypes = [c_void_p]


class _Callbacks(ctypes.Structure):
    _NAMES = ("logger", "allocateMemory", "freeMemory", "stepFinished", "componentEnvironment")
    _fields_ = tuple(zip(_NAMES, (_LOGGER, _ALLOCATE, _FREE, _STEP_FINISHED, c_void_p)))


class Variable:
    """A variable of the model description."""

    def __init__(self, node):
        self.name = node.get("name")
        self.reference = int(node.get("valueReference"))
        self.causality = node.get("causality")
        self.kind = node[0].tag


class Fmu:
    """An FMU that is unpacked into ``folder``, with its library loaded."""

    def __init__(self, path, folder):
        self.folder = Path(folder).resolve()
        with zipfile.ZipFile(path) as archive:
            archive.extractall(self.folder)
        self.root = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        self.identifier = self.root.find("CoSimulation").get("modelIdentifier")
        self.variables = {v.name: v for v in map(Variable, self.root.find("ModelVariables"))}
        self.outputs = [v.name for v in self.variables.values() if v.causality == "output" and v.kind == "Real"]
        system, suffix = ("win", "dll") if sys.platform == "win32" else ("linux", "so")
        self.library = ctypes.CDLL(str(self.folder / "binaries" / f"{system}64" / f"{self.identifier}.{suffix}"))

    def instantiate(self, name="slave", *, guid=None, logging=True, resources=None):
        """Return a new instance."""
        resources = resources or (self.folder / "resources").as_uri()
        return Instance(self, name, guid or self.root.get("guid"), logging, resources)


class Instance:
    """An instance of an FMU. The methods named after FMI functions return their status."""

    def __init__(self, fmu, name, guid, logging, resources):
        self.fmu = fmu
        self.log = []
        # the references keep the callbacks alive as long as the instance may call them
        functions = (_LOGGER(self._logged), _ALLOCATE(_libc.calloc), _FREE(_libc.free), _STEP_FINISHED())
        self._callbacks = _Callbacks(*functions, None)
        create = fmu.library.fmi2Instantiate
        create.restype = c_void_p
        given = (name.encode(), c_int(CO_SIMULATION), guid.encode(), resources.encode())
        component = create(*given, byref(self._callbacks), c_int(0), c_int(logging))
        if not component:
            raise RuntimeError(f"not instantiated: {self.log}")
        self.component = c_void_p(component)

    def _logged(self, environment, name, status, category, message, argument):
        # as a master in C does it: the message is a printf format
        buffer = ctypes.create_string_buffer(4096)
        _libc.snprintf(buffer, c_size_t(len(buffer)), message, c_void_p(argument))
        self.log.append([status, (category or b"").decode(), buffer.value.decode()])

    def _call(self, function, *arguments):
        return getattr(self.fmu.library, f"fmi2{function}")(self.component, *arguments)

    # Lifecycle

    def setup(self, start=0.0, stop=None, tolerance=None):
        bounded = (c_int(tolerance is not None), c_double(tolerance or 0.0))
        return self._call("SetupExperiment", *bounded, c_double(start), c_int(stop is not None), c_double(stop or 0.0))

    def enter(self):
        return self._call("EnterInitializationMode")

    def exit(self):
        return self._call("ExitInitializationMode")

    def start(self, values=None, **experiment):
        """Set values and initialise; return the instance, raise an error if a status is not OK."""
        statuses = [self.set(name, value) for name, value in (values or {}).items()]
        statuses += [self.setup(**experiment), self.enter(), self.exit()]
        if any(statuses):
            raise RuntimeError(f"initialisation failed: {statuses}, {self.log}")
        return self

    def step(self, time, size):
        return self._call("DoStep", c_double(time), c_double(size), c_int(1))

    def run(self, sizes, time=0.0):
        """Take steps of the given sizes from ``time``; return the end time, raise an error if a step is refused."""
        for size in sizes:
            if self.step(time, size) != OK:
                raise RuntimeError(f"step of {size} s refused at t = {time} s: {self.log}")
            time += size
        return time

    def rows(self, sizes, time=0.0):
        """Return the outputs before steps of the given sizes from ``time``, and after each of them."""
        found = [self.outputs()]
        for size in sizes:
            time = self.run([size], time)
            found.append(self.outputs())
        return found

    def terminate(self):
        return self._call("Terminate")

    def reset(self):
        return self._call("Reset")

    def free(self):
        free = self.fmu.library.fmi2FreeInstance
        free.restype = None
        free(self.component)
        self.component = None

    # Values

    def set(self, name, value, *, kind=None, reference=None):
        kind = kind or self.fmu.variables[name].kind
        c_type = _C_TYPES[kind]
        reference = self.fmu.variables[name].reference if reference is None else reference
        value = value.encode() if kind == "String" else value
        return self._call(f"Set{kind}", (c_uint * 1)(reference), c_size_t(1), (c_type * 1)(value))

    def read(self, names, *, kind=None, references=None):
        """Return the status and the values of variables of one type."""
        kind = kind or self.fmu.variables[names[0]].kind
        if references is None:
            references = [self.fmu.variables[name].reference for name in names]
        values = (_C_TYPES[kind] * len(references))()
        status = self._call(f"Get{kind}", (c_uint * len(references))(*references), c_size_t(len(references)), values)
        return status, [v.decode() if isinstance(v, bytes) else v for v in values]

    def get(self, name):
        status, values = self.read([name])
        if status != OK:
            raise RuntimeError(f"{name} cannot be read: {status}, {self.log}")
        return values[0]

    def outputs(self):
        """Return all real outputs by name."""
        status, values = self.read(self.fmu.outputs)
        if status != OK:
            raise RuntimeError(f"outputs cannot be read: {status}, {self.log}")
        return dict(zip(self.fmu.outputs, values))

    def trouble(self):
        """Return solver.status and solver.message."""
        return [self.get("solver.status"), self.get("solver.message")]

    # States

    def save(self):
        state = c_void_p()
        if self._call("GetFMUstate", byref(state)) != OK:
            raise RuntimeError(f"state not saved: {self.log}")
        return state

    def restore(self, state):
        return self._call("SetFMUstate", state)

    def free_state(self, state):
        return self._call("FreeFMUstate", byref(state))

    def serialize(self, state):
        size = c_size_t()
        if self._call("SerializedFMUstateSize", state, byref(size)) != OK:
            raise RuntimeError(f"no size of the state: {self.log}")
        data = (c_char * size.value)()
        if self._call("SerializeFMUstate", state, data, size) != OK:
            raise RuntimeError(f"state not serialised: {self.log}")
        return bytes(data)

    def deserialize(self, data):
        state = c_void_p()
        copied = (c_char * len(data)).from_buffer_copy(data)
        return self._call("DeSerializeFMUstate", copied, c_size_t(len(data)), byref(state)), state

    # Status of the last step

    def terminated(self):
        value = c_int()
        status = self._call("GetBooleanStatus", c_int(3), byref(value))
        return status, value.value
