"""Making FMUs of the mechanisms."""

from .python_fmu import SOURCES, BuildError, build, try_out

__all__ = ["SOURCES", "BuildError", "build", "try_out"]
