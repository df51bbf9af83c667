"""What a slave must do because of pythonfmu's wrapper, the library that calls it."""

from __future__ import annotations

import atexit
import ctypes
import sys
from pathlib import Path
from typing import Any

#: The states of a run: what is allowed in each, FMI 2.0.4 says in 4.2.4; the wrapper passes every call on.
INSTANTIATED, INITIALISING, RUNNING, TERMINATED = PHASES = (
    "instantiated",
    "in initialisation",
    "running",
    "terminated",
)

#: Libraries of FMUs that `end_library_in_order` has seen to.
_libraries: set[Path] = set()


def end_library_in_order(resources: str, model: str) -> None:
    """Make the wrapper's library release the interpreter when Python ends, not while the process is torn down.

    On Linux the library clears its pointer to the interpreter's state in a destructor that runs after the pointer itself
    was destroyed: a use after free that now and then aborts a process whose run was good. Cleared before, it is harmless.
    """
    library = Path(resources).parent / "binaries" / "linux64" / f"{model}.so"
    if not sys.platform.startswith("linux") or library in _libraries or not library.is_file():
        return
    _libraries.add(library)
    finalize = getattr(ctypes.CDLL(str(library)), "finalizePythonInterpreter", None)
    if finalize is not None:
        atexit.register(finalize)


def keep_namespace(kind: type) -> None:
    """Keep the names of a slave's module alive.

    To find the class the wrapper runs its module's source again, at every instantiation, and then gives up a reference to the
    module's namespace that it only borrowed: without one more each time the namespace dies with all its names.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(vars(sys.modules[kind.__module__])))


def outlive_exception(slave: Any) -> None:
    """Keep an instance usable over one more exception.

    After one the wrapper gives up its references to instance, class and log, and gives them up again when the master frees the
    instance; one more reference each, kept in reserve, makes the second time harmless. A slave takes them at its start, for an
    exception that it cannot catch, since an interrupt from the keyboard may come before the first statement of a method, and
    again before it raises one when they are used up.
    """
    if not _in_reserve(slave):
        for kept in (slave, type(slave), slave.log_queue):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))


def end_in_order(slave: Any) -> None:
    """Give up the references in reserve at the end of a run; an instance that is freed without one keeps them."""
    if _in_reserve(slave):
        for kept in (slave, type(slave), slave.log_queue):
            ctypes.pythonapi.Py_DecRef(ctypes.py_object(kept))


def _in_reserve(slave: Any) -> bool:
    # the log is known to the slave, the wrapper, the reserve and this call
    return sys.getrefcount(slave.log_queue) >= 4
