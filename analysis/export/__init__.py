"""Making FMUs of the mechanisms."""

from .python_fmu import BuildError, build, try_out

__all__ = ["BuildError", "build", "try_out"]
