"""Build FMUs of the mechanisms."""

from .archive import SOURCES, BuildError, run_trial
from .builds import BuiltFmu, build_all
from .compatibility import publish
from .description import KINDS, NATIVE, NATIVE_FMI3, PYTHON, Kind
from .interface import Entry, interface, with_starts
from .native_fmu import PLATFORMS, WASM, build_native, compile_library, source_files, this_platform
from .python_fmu import build, build_controller
from .rebuild import Comparison, rebuild
from .web import build_web, crank_index

__all__ = [
    "KINDS",
    "NATIVE",
    "NATIVE_FMI3",
    "PLATFORMS",
    "PYTHON",
    "SOURCES",
    "WASM",
    "BuildError",
    "BuiltFmu",
    "Comparison",
    "Entry",
    "Kind",
    "build",
    "build_all",
    "build_controller",
    "build_native",
    "build_web",
    "compile_library",
    "crank_index",
    "interface",
    "publish",
    "rebuild",
    "run_trial",
    "source_files",
    "this_platform",
    "with_starts",
]
