"""Do one job after another in a process; the process is killed, with all processes that it started, if a job is cancelled."""

from __future__ import annotations

import io
import json
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Mapping
from contextlib import redirect_stderr, suppress
from math import inf
from typing import Any

from linkwork.errors import InputError, LinkworkError
from linkwork.mechanism import Mechanism

from ..mechanisms import MECHANISMS
from ..numerics.workers import end_when_orphaned
from ..run import progress_listener

#: Seconds between two reports of progress; seconds to wait for a killed process.
_INTERVAL, _PATIENCE = 0.1, 5.0
_NOTE = "linkwork: "
_LOST = "the process that did the job ended, for example because memory ran out"


class Busy(InputError):
    """Error for a new job while another one is running."""


class Worker:
    """Worker that runs one job at a time in a separate process. Its methods may be called from several threads.

    The process is started with the first job, or by `start`; its temporary files are in a folder that is deleted with it.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._process: Any = None
        self._pipe: Any = None
        self._folder = ""
        self._job: dict[str, Any] = {"state": "idle"}
        self._number = 0

    def start(self) -> None:
        """Start the process if there is none, so that the next job does not wait for its imports.

        Raises
        ------
        LinkworkError
            If the system cannot start a process.
        """
        with self._lock:
            if self._process is not None and self._process.is_alive():
                return
            self._end()
            spawn = multiprocessing.get_context("spawn")
            self._folder = tempfile.mkdtemp(prefix="linkwork-studio-")
            self._pipe, other = spawn.Pipe()
            process = spawn.Process(target=_work, args=(other, os.getpid(), self._folder), daemon=True)
            try:
                process.start()
            except (OSError, RuntimeError) as error:
                self._end()
                raise LinkworkError(f"no process for the job can be started: {error}") from error
            finally:
                other.close()
            self._process = process

    def give(self, kind: str, request: Mapping[str, Any]) -> dict[str, Any]:
        """Begin a job and return it as `look` does.

        Raises
        ------
        Busy
            If a job is running.
        """
        with self._lock:
            if self.look()["state"] == "running":
                raise Busy("a job is running already: wait for it, or cancel it")
            self._number += 1
            self._job = {"state": "running", "job": self._number, "kind": kind, "what": "starting", "share": 0.0}
            try:
                self.start()
                self._pipe.send((self._number, kind, dict(request), _mechanism(request)))
            except OSError:
                self._lost(_LOST)
            except LinkworkError as error:
                self._lost(str(error))
            return self._job

    def look(self) -> dict[str, Any]:
        """Return the last job: its ``state`` (idle, running, done, failed or cancelled), and if done its ``answer`` as JSON."""
        with self._lock:
            try:
                while self._job["state"] == "running" and self._pipe.poll():
                    number, news = self._pipe.recv()
                    if number == self._number:
                        self._job = self._job | news
            except (EOFError, OSError):
                self._lost(_LOST)
            return self._job

    def cancel(self) -> dict[str, Any]:
        """Kill the running job, and return the last job as `look` does."""
        with self._lock:
            if self.look()["state"] == "running":
                self._end()
                self._job = {"state": "cancelled", "job": self._number, "kind": self._job["kind"]}
                with suppress(LinkworkError):  # the next job reports it
                    self.start()
            return self._job

    def stop(self) -> None:
        """End the process and its job."""
        with self._lock:
            self._end()

    def _lost(self, sentence: str) -> None:
        self._job = {"state": "failed", "job": self._number, "kind": self._job["kind"], "sentence": sentence}
        self._end()

    def _end(self) -> None:
        if self._process is not None:
            if os.name == "posix":
                # its process group contains the compilers that it started; there is none before it has made one
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(self._process.pid, signal.SIGKILL)
            self._process.kill()
            self._process.join(_PATIENCE)
            self._process = None
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
        if self._folder:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = ""


def _mechanism(request: Mapping[str, Any]) -> Mechanism | None:
    """Return the mechanism of a job's state, which the worker's process needs if it is described; None if it is unknown."""
    state = request.get("state")
    name = state.get("mechanism") if isinstance(state, Mapping) else None
    return MECHANISMS.get(name) if isinstance(name, str) else None


def _work(pipe: Any, caller: int, folder: str) -> None:
    """Run one job after another in the worker's process until it is killed."""
    end_when_orphaned(caller)
    if os.name == "posix":
        os.setsid()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)
    tempfile.tempdir = folder
    from .jobs import do

    with suppress(EOFError, OSError):
        while True:
            number, kind, request, mechanism = pipe.recv()
            if mechanism is not None:
                MECHANISMS.setdefault(mechanism.name, mechanism)
            pipe.send((number, _answer(do, kind, request, _Teller(pipe, number))))


class _Teller:
    """Function that sends the progress of a job, at most every `_INTERVAL` seconds."""

    def __init__(self, pipe: Any, number: int) -> None:
        self.pipe, self.number, self.last = pipe, number, -1.0

    def __call__(self, what: str, share: float) -> None:
        now = time.monotonic()
        if now - self.last > _INTERVAL:
            self.last = now
            self.pipe.send((self.number, {"what": what, "share": min(max(share, 0.0), 1.0)}))


class _Terminal(io.TextIOBase):
    """Standard error of a job; notes in it, for example that equations are compiled, are also sent as progress."""

    def __init__(self, teller: _Teller) -> None:
        self.teller = teller

    def write(self, text: str) -> int:
        if text.startswith(_NOTE):
            self.teller.last = -inf
            self.teller(text.removeprefix(_NOTE).strip().removesuffix(" ..."), 0.0)
        return sys.__stderr__.write(text) if sys.__stderr__ else len(text)


def _answer(do: Any, kind: str, request: Mapping[str, Any], teller: _Teller) -> dict[str, Any]:
    """Run a job; return its end state with the answer as JSON, or with a sentence on the error."""
    try:
        with progress_listener(teller), redirect_stderr(_Terminal(teller)):
            return {"state": "done", "answer": json.dumps(do(kind, request), allow_nan=False)}
    except LinkworkError as error:
        return {"state": "failed", "sentence": str(error)}
    except Exception as error:  # nothing that is wrong with one job may end the process
        traceback.print_exc(file=sys.stderr)
        return {"state": "failed", "sentence": f"the job failed: {type(error).__name__}: {error}"}
