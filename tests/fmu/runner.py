"""Run a function in a new process, so that nothing that an FMU leaves behind in an interpreter reaches the next test."""

from __future__ import annotations

import inspect
import json
import os
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent

_FRAME = """from __future__ import annotations
import json, sys
from pathlib import Path
sys.path.insert(0, {helpers!r})
from bare_master import DISCARD, ERROR, Fmu

{source}

arguments = json.loads(Path(sys.argv[1]).read_text())
Path(sys.argv[2]).write_text(json.dumps({name}(*arguments)))
"""


def run_in_process(
    code: Callable[..., Any],
    *args: Any,
    python: str | Path = sys.executable,
    timeout: float = 60.0,
    options: tuple[str, ...] = ("-W", "error"),
) -> Any:
    """Run the source of the function ``code`` with ``args`` in a new Python process, and return its result.

    The names json, sys, Path, and DISCARD, ERROR and `Fmu` of ``bare_master`` are imported for the function; it imports inside
    itself what else it needs. Arguments and result are sent as JSON, which represents floats without loss. If the process dies,
    the test fails with the output of the process.
    """
    source = _FRAME.format(helpers=str(HERE), source=textwrap.dedent(inspect.getsource(code)), name=code.__name__)
    with tempfile.TemporaryDirectory(prefix="linkwork-test-") as folder:
        script, given, result = (Path(folder) / name for name in ("script.py", "arguments.json", "result.json"))
        script.write_text(source)
        given.write_text(json.dumps([str(a) if isinstance(a, Path) else a for a in args]))
        done = subprocess.run(
            [str(python), "-X", "faulthandler", *options, str(script), str(given), str(result)],
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
            cwd=folder,
            # masters unpack FMUs into the folder for temporary files, and not all of them clean up
            env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1", "TMPDIR": folder},
        )
        message = f"{code.__name__} ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
        assert done.returncode == 0, message
        assert result.is_file(), message
        return json.loads(result.read_text())
