"""Work over cores and machines: by joblib, in the threads, processes or cluster that the caller has chosen."""

from __future__ import annotations

import os
import pickle
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor, as_completed
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, TypeVar

from linkwork.errors import InputError, LinkworkError

Item = TypeVar("Item")
Made = TypeVar("Made")

#: How often workers are started anew after one was killed; as often does Dask give an item to another worker.
RETRIES = 3

#: Bytes of a pickled result that go through the pipe itself: with what joblib adds, less than a pipe takes in one piece.
_PIECE = 2048

#: Work, number of an item, the item, the caller's process and a folder for results; number of an item, its result or error.
_Task = tuple[Callable[[Any], Any], int, Any, int, str]
_Found = tuple[int, Any, Exception | None]

_WATCHED: set[int] = set()
#: Seconds between two looks at who the caller is.
_INTERVAL = 0.5


class WorkersLost(LinkworkError):
    """The workers failed, as where they are killed again and again, or the scheduler of a cluster is gone."""


class Heard(list[bool]):
    """Has an entry for each Ctrl-C; ``waiting`` while others compute, and Ctrl-C may end the wait by an exception."""

    waiting = False


@contextmanager
def interruptible() -> Iterator[Heard]:
    """Hear Ctrl-C as an entry in a list, to be looked at between two steps or calls.

    An exception would strike wherever it finds the interpreter: inside an FMU, whose interpreter this is, or inside Numba,
    which may drop it.
    """
    heard = Heard()
    if threading.current_thread() is not threading.main_thread():
        yield heard
        return

    def hear(*_: object) -> None:
        heard.append(True)
        if heard.waiting:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, hear)
    try:
        yield heard
    finally:
        # None stands for a handler that was not set from Python
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)


def check_jobs(n_jobs: int | None) -> None:
    """Refuse no workers at all.

    Raises
    ------
    InputError
        If ``n_jobs`` is 0.
    """
    if n_jobs == 0:
        raise InputError("0 cores: it must be a number of them, or -1 for all")


def cores_of(n_jobs: int | None, *, threads: bool = False) -> int:
    """How many workers `over_workers` has: as `joblib.Parallel` counts them, on a cluster all of its cores."""
    return _workers(n_jobs, threads)[0]


def share_memory(n_jobs: int | None, *, threads: bool = False) -> bool:
    """Whether the workers that `over_workers` has are this process and its threads."""
    return not _workers(n_jobs, threads)[1]


def _workers(n_jobs: int | None, threads: bool) -> tuple[int, bool]:
    """Number of workers, and whether they are other processes."""
    import joblib

    check_jobs(n_jobs)
    backend, default = joblib.parallel.get_active_backend(prefer="threads" if threads else None)
    count = int(backend.effective_n_jobs((default or 1) if n_jobs is None else n_jobs))
    return count, count > 1 and not getattr(backend, "supports_sharedmem", False)


def over_workers(
    work: Callable[[Item], Made],
    items: Sequence[Item],
    heard: Heard | None = None,
    *,
    n_jobs: int | None = None,
    threads: bool = False,
) -> Iterator[tuple[int, Made]]:
    """Number and result of each item, in the order in which they are done.

    The workers are ``n_jobs`` processes of this machine, threads if ``threads`` are preferred, or those of the backend that
    `joblib.parallel_config` has set: "dask", "loky", "threading" or another. One job is this process itself. An item whose
    worker was killed goes to another worker. Processes that were started here end with this one.

    Parameters
    ----------
    work : callable
        What it raises is raised here.
    items : sequence
    heard : Heard, optional
        Of `interruptible`. A Ctrl-C while others compute ends the iteration; without it, it is a KeyboardInterrupt.

    Raises
    ------
    WorkersLost
        If workers were killed more than `RETRIES` times, or fail otherwise.

    Notes
    -----
    Processes of this machine hand over what is large in files: joblib would wait for ever for the end of a message whose sender
    was killed within it.
    """
    count, elsewhere = _workers(n_jobs, threads)
    listening = Heard() if heard is None else heard
    todo = dict(enumerate(items))
    with (
        tempfile.TemporaryDirectory(prefix="linkwork-", ignore_cleanup_errors=True) if elsewhere else nullcontext("")
    ) as folder:
        for attempt in range(RETRIES + 1):
            tasks = [(work, number, item, os.getpid(), folder) for number, item in todo.items()]
            results = _in_processes(tasks, n_jobs) if elsewhere else _here(tasks, count)
            try:
                while todo:
                    listening.waiting = elsewhere
                    try:
                        number, made, error = _taken(next(results))
                    finally:
                        listening.waiting = False
                    if error is not None:
                        raise _OfWork(error)
                    del todo[number]
                    yield number, made
                return
            except KeyboardInterrupt:  # of this process, or of a worker
                if heard is None:
                    raise
                if not heard:
                    heard.append(True)
                return
            except _OfWork as caught:
                raise caught.error from None
            except LinkworkError:  # of what cannot be sent
                raise
            except BrokenExecutor as error:
                if attempt == RETRIES:
                    raise WorkersLost(f"workers were killed {attempt + 1} times, as where memory runs out") from error
                warnings.warn(
                    f"a worker was killed: {len(todo)} of {len(items)} parts are given out again",
                    RuntimeWarning,
                    stacklevel=2,
                )
            except Exception as error:  # of any backend
                raise WorkersLost(f"the workers failed: {type(error).__name__}: {error}") from error
            finally:
                with warnings.catch_warnings():
                    # that items were cancelled is what was asked for
                    warnings.filterwarnings("ignore", message=".*still being processed", category=UserWarning)
                    results.close()


def _in_processes(tasks: Sequence[_Task], n_jobs: int | None) -> Any:
    """What other processes send, as it comes: a generator."""
    import joblib

    # many small results together would be a large message
    parallel = joblib.Parallel(n_jobs=n_jobs, return_as="generator_unordered", batch_size=1)
    # in a tuple: Dask would keep a larger argument on one worker alone, and lose it with that
    return parallel(joblib.delayed(_one)(task) for task in tasks)


def _here(tasks: Sequence[_Task], count: int) -> Generator[Any, None, None]:
    """What is found in this process, or in threads of it: joblib would look for it a hundred times a second only."""
    if count == 1:
        yield from map(_one, tasks)
        return
    pool = ThreadPoolExecutor(count)
    try:
        for future in as_completed([pool.submit(_one, task) for task in tasks]):
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)


class _OfWork(Exception):
    """An error of the work, in contrast to one of the workers."""

    def __init__(self, error: Exception) -> None:
        self.error = error
        super().__init__()


def _one(task: _Task) -> _Found | Path:
    """What is found of an item, or the file that it is in."""
    work, number, item, caller, folder = task
    end_with(caller)
    found: _Found
    try:
        found = number, work(item), None
    except Exception as error:  # to be told from those of the workers
        found = number, None, error
    return _handed_over(found, Path(folder, str(number))) if folder and os.getppid() == caller else found


def _handed_over(found: _Found, path: Path) -> _Found | Path:
    """What a process of this machine sends: a message that a pipe takes in one piece, as far as that can be had."""
    try:
        content = pickle.dumps(found)
        if len(content) <= _PIECE:
            return found
        path.write_bytes(content)
    except Exception:  # what cannot be pickled or written goes as joblib sends it
        return found
    return path


def _taken(sent: _Found | Path) -> _Found:
    """What was found, out of its file where it is in one."""
    if not isinstance(sent, Path):
        return sent
    found: _Found = pickle.loads(sent.read_bytes())
    with suppress(OSError):  # the folder goes with it at the end
        sent.unlink()
    return found


def end_with(caller: int) -> None:
    """End this process soon after its parent, if that is ``caller``: called in a worker, first of all.

    A worker that nobody waits for would go on for minutes. Workers that somebody else started, of a cluster, are left alone,
    and so is the caller's own process; under Windows, which keeps the number of a parent that is gone, so are all.
    """
    if os.getppid() == caller and caller not in _WATCHED:
        _WATCHED.add(caller)
        threading.Thread(target=_watch, args=(caller,), daemon=True).start()


def _watch(caller: int) -> None:
    while os.getppid() == caller:
        time.sleep(_INTERVAL)
    os._exit(1)
