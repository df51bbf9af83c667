"""Work around defects of pythonfmu's wrapper, the library that calls the slave of a Python FMU."""

from __future__ import annotations

import ctypes
import json
import sys
import zlib
from typing import Any

#: The states of a run. FMI 2.0.4, 4.2.4, says which calls are allowed in each; the wrapper does not check this.
INSTANTIATED, INITIALISING, RUNNING, TERMINATED = PHASES = (
    "instantiated",
    "in initialisation",
    "running",
    "terminated",
)


def keep_namespace(kind: type) -> None:
    """Keep the namespace of a slave's module alive; ``kind`` is the class of the slave.

    At every instantiation the wrapper runs the module's source again to find the class, and then releases a reference to the
    module's namespace that it only borrowed. Without one more reference each time, the namespace would be deleted.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(vars(sys.modules[kind.__module__])))


def outlive_exception(slave: Any) -> None:
    """Keep an instance usable after one more exception.

    After an exception the wrapper releases its references to instance, class and log, and it releases them again when the
    master frees the instance. One more reference to each, kept in reserve, makes the second release harmless. A slave takes
    this reserve when it starts, for exceptions that it cannot catch (Ctrl-C may come before the first statement of a method),
    and again before it raises an exception, if the reserve is used up.
    """
    if not _in_reserve(slave):
        for kept in (slave, type(slave), slave.log_queue):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))


def end_in_order(slave: Any) -> None:
    """Release the references in reserve when a run is terminated; without this call they would never be released."""
    if _in_reserve(slave):
        for kept in (slave, type(slave), slave.log_queue):
            ctypes.pythonapi.Py_DecRef(ctypes.py_object(kept))


def _in_reserve(slave: Any) -> bool:
    # with a reserve the log has four references: of the slave, the wrapper, the reserve and this call
    return sys.getrefcount(slave.log_queue) >= 4


def write_state(state: dict[str, Any]) -> bytes:
    """Return a saved state as JSON with a checksum."""
    # JSON writes a float as its repr, which is read back as the same float
    text = json.dumps(state).encode("utf-8")
    return text[:-1] + b', "check": "%08x"}' % zlib.crc32(text)


def read_state(state: bytes) -> dict[str, Any]:
    """Return the state that `write_state` wrote; if it is damaged, a dictionary with the reason under ``"damaged"``.

    This function has no instance to keep usable after an exception, and therefore raises none: a damaged state is refused when
    it is set.
    """
    text, _, check = state.rpartition(b', "check": "')
    if check != b'%08x"}' % zlib.crc32(text + b"}"):
        return {"damaged": "its checksum is not that of its text"}
    try:
        saved = json.loads(text.decode("utf-8") + "}")
    except (ValueError, RecursionError) as error:
        return {"damaged": repr(error)}
    return saved if isinstance(saved, dict) else {"damaged": "it is not the state of a Linkwork slave"}
