"""Run the command line and other programs, and load the scripts of docs/, which is not a package, as modules."""

import importlib.util
import shlex
import subprocess
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

from click.testing import CliRunner, Result

from analysis import cli


def called(
    *words: object, cwd: Path | None = None, env: Mapping[str, str] | None = None, timeout: float = 600.0
) -> str:
    """Run a command, which must end well, and return its standard output."""
    command = [str(word) for word in words]
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=timeout, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def linkwork(typed: str, *words: object, code: int = 0) -> Result:
    """Call the command line, which must exit with ``code``.

    ``typed`` is a line as it is typed in a shell; each of ``words`` is passed as one more argument.
    """
    done = CliRunner().invoke(cli.main, [*shlex.split(typed), *map(str, words)], catch_exceptions=False)
    assert done.exit_code == code, done.output
    return done


def script_of_docs(name: str) -> ModuleType:
    """Load a script of docs/ by its name and return it as a new module."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).parents[1] / "docs" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
