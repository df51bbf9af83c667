"""Run the cases of one check in a separate process: ``python -m analysis.probe.child JOB``.

The process may crash; the parent process then reads the journal and the findings that this process has written. Without JOB
the program reads the paths of jobs from standard input and forks a process for each of them, which then need not load the
modules again.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from .context import AFTER_FATAL, FAILED, Context
from .journal import Journal
from .session import Library, ProbeError


def main(path: str) -> int:
    """Run the cases of the job that the JSON file ``path`` describes; return the exit code of the process."""
    job = json.loads(Path(path).read_text(encoding="utf-8"))
    _no_core_dump()
    context = _context(job)
    if context is None:
        return 0
    from .checks import CHECKS

    check = CHECKS[job["check"]]
    last = check.cases(context.model) if check.cases else sys.maxsize
    least, until = check.least(context), time.monotonic() + job["seconds"]
    for case in range(job["first"], min(last, job["last"])):
        spent = context.journal.calls >= job["calls"] or time.monotonic() > until
        if spent and case >= least:
            break
        context.journal.begin(case)
        try:
            check.run(context, case)
        except ProbeError as error:
            context.say(f"not made: {error}")
        if context.journal.fatal:
            return AFTER_FATAL
    context.finish()
    return 0


def _context(job: dict[str, Any]) -> Context | None:
    """Return the context of the check that a job describes; None if the FMU's library cannot be loaded."""
    from .model import read_model

    folder, work = Path(job["folder"]), Path(job["work"])
    journal = Journal(Path(job["journal"]))
    model = read_model(folder, job["interface"])
    common = {"seed": job["seed"], "check": job["check"], "avoided": frozenset(job["avoided"])}
    findings = Path(job["findings"])
    try:
        library = Library(model, folder)
    except Exception as error:  # FMPy raises Exception itself, and AttributeError for a function that is missing
        with findings.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"unloadable": str(error)}) + "\n")
        return None
    return Context(model=model, library=library, folder=folder, work=work, journal=journal, findings=findings, **common)


def _no_core_dump() -> None:
    try:
        import resource
    except ImportError:  # Windows
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _fork_for_jobs() -> str:
    """Fork a process for each path of a job on standard input; return the path in the new process.

    Standard output gets the id of each process, then its exit code, negative for a signal. This process ends when its standard
    input is closed, not at Ctrl-C; the process that reads its output must end the jobs' processes and wait for the codes.
    """
    interrupted = signal.signal(signal.SIGINT, signal.SIG_IGN)
    from . import checks as _checks  # noqa: F401  what every job needs is loaded once

    for line in iter(sys.stdin.readline, ""):
        path = str(line).removesuffix("\n")
        number = os.fork()
        if number == 0:
            signal.signal(signal.SIGINT, interrupted)
            for descriptor, place in enumerate((os.devnull, os.devnull, str(Path(path).with_name("stderr")))):
                file = os.open(place, os.O_RDONLY if descriptor == 0 else os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
                os.dup2(file, descriptor)
                os.close(file)
            return path
        os.write(1, f"{number}\n".encode())
        os.write(1, f"{os.waitstatus_to_exitcode(os.waitpid(number, 0)[1])}\n".encode())
    sys.exit(0)


if __name__ == "__main__":
    try:
        code = main(sys.argv[1] if len(sys.argv) > 1 else _fork_for_jobs())
    except Exception:  # the exit code distinguishes this from a crash of the FMU
        traceback.print_exc()
        code = FAILED
    sys.stderr.flush()
    sys.exit(code)
