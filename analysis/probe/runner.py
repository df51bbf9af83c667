"""Run a probe: start a process for each check, watch the process, and collect the findings that it has written."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from linkwork.errors import InputError

from ..files import check_fmu, find_problems, unknown_name
from . import journal
from .context import AFTER_FATAL, FAILED
from .findings import CRASH, WRONG, Finding, Outcome, Report
from .model import interfaces, read_model
from .session import ProbeError

#: Number of crashes after which a check ends. A forbidden call that has crashed is not tried again.
_CRASHES = 100


@dataclass(slots=True, kw_only=True)
class _Job:
    """One check on one interface, with its results so far."""

    check: str
    interface: str
    folder: Path
    work: Path
    seed: int
    calls: int
    seconds: float
    hang: float
    parent: subprocess.Popen[bytes] | None
    first: int = 0
    last: int = sys.maxsize
    done: int = 0
    crashes: dict[str, int] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    stopped: str = ""

    @property
    def journal(self) -> Path:
        return self.work / "journal"

    @property
    def records(self) -> Path:
        return self.work / "records"


def probe(
    fmu: str | Path,
    *,
    calls: int = 20_000,
    seed: int = 0,
    seconds: float = 600.0,
    interface: str | None = None,
    hang: float = 10.0,
    checks: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Report:
    """Probe an FMU: make all checks on each of its interfaces, and return a report of the findings.

    Parameters
    ----------
    fmu : path
        An FMU of FMI 2.0 or 3.0, with a library for this machine.
    calls : int
        Number of calls in random sequences for each interface.
    seed : int
        Seed of the random numbers: the same seed makes the same calls.
    seconds : float
        Time (s) after which no further cases with random sequences of calls are begun.
    interface : str, optional
        cs or me; by default all interfaces of the FMU.
    hang : float
        Time (s) after which a call that has not returned is considered to hang.
    checks : sequence of str
        Names of the checks, keys of `CHECKS`, to be made; by default all.
    progress : callable, optional
        Called with the name of each check before the check is made.

    Returns
    -------
    Report

    Raises
    ------
    InputError
        If a check is unknown, or ``seconds`` is not above zero.
    """
    from .checks import CHECKS

    if not seconds > 0.0:
        raise InputError(f"seconds is {seconds}: no random call would be made; it must be above 0")
    for check in checks:
        if check not in CHECKS:
            raise unknown_name(check, CHECKS, f"check {check!r}")
    with tempfile.TemporaryDirectory(prefix="probe-") as temporary, _parent_of_jobs(Path(temporary)) as parent:
        work = Path(temporary)
        description = _extract(Path(fmu), work / "fmu")
        report = Report(fmu=Path(fmu).name, fmi_version=description.fmiVersion, seed=seed)
        for problem in find_problems(fmu):
            text = f"model description: {problem}"
            report.add(Finding(severity=WRONG, key=f"static: {problem}", text=text, calls=[], replay=""))
        until = time.monotonic() + seconds
        for name in _select_interfaces(interface, interfaces(description)):
            model = read_model(work / "fmu", name)
            for check, about in CHECKS.items():
                if (checks and check not in checks) or (about.cases is not None and about.cases(model) == 0):
                    continue
                if progress is not None:
                    progress(f"{name}: {check}")
                share = int(calls * about.share) if about.share else sys.maxsize
                job = _Job(
                    check=check, interface=name, folder=work / "fmu", work=work, seed=seed, calls=share,
                    seconds=max(0.0, until - time.monotonic()) if about.share else 1e9, hang=hang,
                    parent=parent,
                )  # fmt: skip
                if not _run(job, report):
                    break
        return report


def replay(fmu: str | Path, case: str, *, hang: float = 10.0) -> tuple[list[str], list[Finding]]:
    """Run one case again, given by its name in a report; return the calls and the findings of this case."""
    from .checks import CHECKS

    seed, interface, check, number = (case.split("/") + [""] * 4)[:4]
    if check not in CHECKS or not number.isdigit() or not seed.lstrip("-").isdigit() or interface not in ("cs", "me"):
        raise InputError(f"there is no case {case!r}: it must be as in a report, such as 0/cs/forbidden/12")
    with tempfile.TemporaryDirectory(prefix="probe-") as temporary, _parent_of_jobs(Path(temporary)) as parent:
        work = Path(temporary)
        description = _extract(Path(fmu), work / "fmu")
        _select_interfaces(interface, interfaces(description))
        report = Report(fmu=Path(fmu).name, fmi_version=description.fmiVersion, seed=int(seed))
        for name in [*(["serialize"] if check == "deserialize" else []), check]:
            job = _Job(
                check=name, interface=interface, folder=work / "fmu", work=work, seed=int(seed), calls=sys.maxsize,
                seconds=1e9, hang=hang, parent=parent, first=int(number), last=int(number) + 1,
            )  # fmt: skip
            _run(job, report)
        entry = journal.read(job.journal)
        if entry.case < 0 and not report.findings:
            raise InputError(f"there is no case {case!r}: the check {check} has fewer cases, or skips this FMU")
        return entry.lines, report.findings


def _extract(fmu: Path, folder: Path) -> Any:
    """Extract an FMU to a folder and return its model description."""
    from fmpy import extract

    from ..run import read_description

    check_fmu(fmu)
    description = read_description(fmu)
    try:
        extract(str(fmu), str(folder))
    except (BadZipFile, OSError) as error:
        raise InputError(f"{fmu} is not an FMU: {error}") from error
    if not description.fmiVersion.startswith(("2.", "3.")):
        raise InputError(f"{fmu} is of FMI {description.fmiVersion}: the probe is for 2.0 and 3.0")
    return description


def _select_interfaces(interface: str | None, offered: Sequence[str]) -> Sequence[str]:
    if interface is not None and interface not in offered:
        raise InputError(
            f"the FMU has no interface {interface!r}: it has {', '.join(offered) or 'none that is probed'}"
        )
    return offered if interface is None else [interface]


def _run(job: _Job, report: Report) -> bool:
    """Run all cases of a check, in a new process after each crash; return whether the FMU can be loaded."""
    begun = time.monotonic()
    cases = loadable = 0
    while job.first < job.last and not job.stopped:
        loadable = _one_process(job, report, begun)
        cases = max(cases, job.first)
        if not loadable:
            break
    said = "; ".join(dict.fromkeys([*job.said, *([job.stopped] if job.stopped != "finished" else [])]))
    seconds = time.monotonic() - begun
    report.outcomes.append(
        Outcome(check=job.check, interface=job.interface, cases=cases, calls=job.done, seconds=seconds, said=said)
    )
    return bool(loadable)


def _one_process(job: _Job, report: Report, begun: float) -> bool:
    """Run the cases from number `job.first` in a process until the process ends; return whether the FMU can be loaded."""
    for path in (job.journal, job.records):
        path.unlink(missing_ok=True)
    order = {
        "folder": str(job.folder), "work": str(job.work), "journal": str(job.journal), "findings": str(job.records),
        "check": job.check, "interface": job.interface, "seed": job.seed, "first": job.first, "last": job.last,
        "calls": max(0, job.calls - job.done), "seconds": job.seconds - (time.monotonic() - begun),
        "avoided": list(job.crashes),
    }  # fmt: skip
    (job.work / "job.json").write_text(json.dumps(order), encoding="utf-8")
    code, hangs, errors = _watch(job)
    entry = journal.read(job.journal)
    job.done += entry.calls
    records = _records(job.records)
    subject = _collect(records, job, report)
    unloadable = [record["unloadable"] for record in records if "unloadable" in record]
    if unloadable:
        report.add(Finding(severity=WRONG, key="load", text=f"cannot be loaded: {unloadable[0]}", calls=[], replay=""))
        return False
    if code == FAILED:
        raise ProbeError(f"the probe itself failed in {job.check} ({job.interface}), case {entry.case}:\n{errors}")
    job.first = max(job.first, entry.case) + 1
    if any("finished" in record for record in records):
        job.stopped = "finished"
    elif code != AFTER_FATAL:
        _record_crash(job, report, entry, subject, "hangs" if hangs else f"ends with {_describe_end(code)}", errors)
    if sum(job.crashes.values()) >= _CRASHES:
        job.stopped = f"ended after {_CRASHES} crashes"
    return True


class _Forked:
    """A process that `child` has forked for a job; its methods are those of `subprocess.Popen`."""

    def __init__(self, parent: subprocess.Popen[bytes], job: Path) -> None:
        assert parent.stdin is not None
        assert parent.stdout is not None
        self._output = parent.stdout
        parent.stdin.write(f"{job}\n".encode())
        self._number = self._read()
        self.returncode: int | None = None

    def _read(self) -> int:
        if not (line := self._output.readline()):
            raise ProbeError("the process from which those of the jobs are forked has ended")
        return int(line)

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            if not select.select([self._output], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("fork", timeout or 0.0)
            self.returncode = self._read()
        return self.returncode

    def poll(self) -> int | None:
        return self.returncode

    def kill(self) -> None:
        with suppress(ProcessLookupError):  # it may have ended just before
            os.kill(self._number, signal.SIGKILL)


def _command(work: Path, *words: str) -> dict[str, Any]:
    """Return the arguments of a process that runs `child` in the folder of a probe."""
    paths = os.pathsep.join(dict.fromkeys(path or os.getcwd() for path in sys.path))
    # freed and uninitialised memory is filled with a pattern, so that reading it has a visible effect
    environment = {**os.environ, "PYTHONPATH": paths, "MALLOC_PERTURB_": "165"}
    return {"args": [sys.executable, "-m", f"{__package__}.child", *words], "env": environment, "cwd": work}


@contextmanager
def _parent_of_jobs(work: Path) -> Iterator[subprocess.Popen[bytes] | None]:
    """Yield a process that forks the processes of jobs; except on Linux yield None, as forking is not safe there."""
    if sys.platform != "linux":
        yield None
        return
    with (
        (work / "stderr").open("wb") as errors,
        subprocess.Popen(
            **_command(work), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, bufsize=0
        ) as parent,
    ):
        yield parent


def _watch(job: _Job) -> tuple[int, bool, str]:
    """Start the process of a job and wait until it ends; end the process if a call does not return.

    Return the exit code of the process, whether a call did not return, and the last part of the standard error.
    """
    stderr, path = job.work / "stderr", job.work / "job.json"
    process: _Forked | subprocess.Popen[bytes]
    if job.parent is not None:
        process = _Forked(job.parent, path)
    else:
        with stderr.open("wb") as errors:
            process = subprocess.Popen(**_command(job.work, str(path)), stdout=subprocess.DEVNULL, stderr=errors)
    calls, since, hangs = -1, time.monotonic(), False
    try:
        while True:
            try:
                process.wait(timeout=0.5)
                break
            except subprocess.TimeoutExpired:
                made = journal.read(job.journal).calls
                if made != calls:
                    calls, since = made, time.monotonic()
                elif time.monotonic() - since > job.hang:
                    hangs = True
                    process.kill()
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    code = process.returncode
    assert code is not None
    return code, hangs, stderr.read_text(encoding="utf-8", errors="replace")[-2000:]


def _records(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.endswith("}")]


def _collect(records: Sequence[dict[str, Any]], job: _Job, report: Report) -> str:
    """Add the findings that a process has written to the report; return the subject of the process's last case."""
    subject = ""
    for record in records:
        if "severity" in record:
            calls = record["calls"] or ["?"] * (1 << 20)  # never shorter than the calls that are known
            report.add(Finding(**{**record, "calls": calls, "key": f"{job.interface}: {record['key']}"}))
        elif "said" in record:
            job.said.append(record["said"])
        elif "subject" in record:
            subject = record["subject"]
    return subject


def _record_crash(job: _Job, report: Report, entry: journal.Entry, subject: str, how: str, errors: str) -> None:
    last = entry.lines[-1] if entry.lines else ""
    name = last.split("(")[0] or "the loading of the library"
    where = f"after {name}" if " -> " in last else f"in {name}"
    about = subject or name
    job.crashes[about] = job.crashes.get(about, 0) + 1
    said = errors.strip().splitlines()
    text = f"the process {how} {where}"
    text += f"; {subject}" if subject else ""
    text += f" ({said[-1][:200]})" if said else ""
    replay_name = f"{job.seed}/{job.interface}/{job.check}/{entry.case}"
    report.add(
        Finding(severity=CRASH, key=f"{job.interface}: {about}", text=text, calls=entry.lines, replay=replay_name)
    )
    if entry.case < 0:
        job.stopped = "ended: it crashes before the first case"


def _describe_end(code: int) -> str:
    try:
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"
    except ValueError:
        return f"signal {-code}"
