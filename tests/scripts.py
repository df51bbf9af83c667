"""Run programs, and load the scripts of docs/, which is not a package, as modules."""

import importlib.util
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType


def called(
    *words: object, cwd: Path | None = None, env: Mapping[str, str] | None = None, timeout: float = 600.0
) -> str:
    """Run a command, which must end well, and return its standard output."""
    command = [str(word) for word in words]
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=timeout, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def script_of_docs(name: str) -> ModuleType:
    """Load a script of docs/ by its name and return it as a new module."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).parents[1] / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
