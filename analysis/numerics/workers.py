"""Parallel work by joblib, in the threads, processes or cluster that the caller has chosen."""

from __future__ import annotations

import os
import pickle
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor, as_completed
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from linkwork.errors import InputError, LinkworkError

Item = TypeVar("Item")
Made = TypeVar("Made")

#: How often workers are restarted after one was killed.
RETRIES = 3

#: Greatest pickled result (bytes) that goes through the pipe: with what joblib adds, a pipe takes it in one piece.
_PIECE = 2048

#: Work, number of an item, the item, the caller's process id, a folder for results. Number of an item, its result, its error.
_Task = tuple[Callable[[Any], Any], int, Any, int, str]
_Found = tuple[int, Any, Exception | None]

_WATCHED: set[int] = set()
#: Seconds between two checks that the caller is alive.
_INTERVAL = 0.5
#: Seconds without a result after which the scheduler of a cluster is asked whether it is there, and that it has to answer.
_PATIENCE = 60.0


class WorkersLost(LinkworkError):
    """The workers failed: they were killed again and again, or the scheduler of a cluster is gone."""


class Heard(list[bool]):
    """A list with an entry for each Ctrl-C; while ``waiting`` for other processes, Ctrl-C also raises KeyboardInterrupt."""

    waiting = False


@contextmanager
def interruptible() -> Iterator[Heard]:
    """Record Ctrl-C as an entry in a list, for the caller to look at between two steps.

    An exception could arise anywhere: inside an FMU that runs in this interpreter, or inside Numba, which may drop it.
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
        # None is a handler that was not set from Python
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)


def check_jobs(n_jobs: int | None) -> None:
    """Check a number of workers.

    Raises
    ------
    InputError
        If ``n_jobs`` is 0.
    """
    if n_jobs == 0:
        raise InputError("0 cores: give a number of cores, or -1 for all")


def worker_count(n_jobs: int | None, *, threads: bool = False) -> int:
    """Return the number of workers of `over_workers`, as `joblib.Parallel` counts them; on a cluster all of its cores."""
    return _workers(n_jobs, threads)[0]


def share_memory(n_jobs: int | None, *, threads: bool = False) -> bool:
    """Return whether the workers of `over_workers` are this process and its threads."""
    return not _workers(n_jobs, threads)[1]


def _workers(n_jobs: int | None, threads: bool) -> tuple[int, bool, Any]:
    """Return the number of workers, whether they are other processes, and the backend of joblib."""
    import joblib

    check_jobs(n_jobs)
    backend, default = joblib.parallel.get_active_backend(prefer="threads" if threads else None)
    if hasattr(backend, "client"):
        _ask(backend.client)  # joblib would wait for ever
    try:
        count = int(backend.effective_n_jobs((default or 1) if n_jobs is None else n_jobs))
    except TimeoutError as error:
        raise WorkersLost(f"the cluster has no worker: {error}") from error
    return count, count > 1 and not getattr(backend, "supports_sharedmem", False), backend


def over_workers(
    work: Callable[[Item], Made],
    items: Sequence[Item],
    heard: Heard | None = None,
    *,
    n_jobs: int | None = None,
    threads: bool = False,
) -> Iterator[tuple[int, Made]]:
    """Yield number and result of each item as soon as it is done.

    The workers are ``n_jobs`` processes of this machine, threads if ``threads`` are preferred, or those of the backend that
    `joblib.parallel_config` has set, such as "dask", "loky" or "threading". One job runs in this process. An item
    whose worker was killed goes to another worker. Processes that are started here end with this one.

    Parameters
    ----------
    work : callable
        An exception that it raises is raised here.
    items : sequence
    heard : Heard, optional
        From `interruptible`. With it, Ctrl-C ends the iteration; without it, Ctrl-C raises KeyboardInterrupt.

    Raises
    ------
    WorkersLost
        If workers were killed more than `RETRIES` times, or fail otherwise, or the scheduler of a cluster does not answer. A
        part that ends every worker of a cluster is named, after the others have been yielded.

    Notes
    -----
    Processes of this machine pass large results in files: if a sender is killed in the middle of a message, joblib waits for
    ever for the rest.
    """
    count, elsewhere, backend = _workers(n_jobs, threads)
    listening = Heard() if heard is None else heard
    todo = dict(enumerate(items))
    with (
        tempfile.TemporaryDirectory(prefix="linkwork-", ignore_cleanup_errors=True) if elsewhere else nullcontext("")
    ) as folder:
        for attempt in range(RETRIES + 1):
            tasks = [(work, number, item, os.getpid(), folder) for number, item in todo.items()]
            if not elsewhere:
                results = _here(tasks, count)
            elif hasattr(backend, "client"):
                results = _in_cluster(tasks, backend)
            else:
                results = _in_processes(tasks, n_jobs)
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
            except KeyboardInterrupt:  # in this process, or in a worker
                if heard is None:
                    raise
                if not heard:
                    heard.append(True)
                return
            except _OfWork as caught:
                raise caught.error from None
            except LinkworkError:  # from an item that cannot be sent
                raise
            except BrokenExecutor as error:
                if attempt == RETRIES:
                    numbers = ", ".join(str(number + 1) for number in list(todo)[:5])
                    raise WorkersLost(
                        f"workers were killed {attempt + 1} times, as where memory runs out: {len(todo)} of {len(items)} "
                        f"parts are not done, {numbers}{' ...' if len(todo) > 5 else ''}"
                    ) from error
                warnings.warn(
                    f"a worker was killed: {len(todo)} of {len(items)} parts are given out again",
                    RuntimeWarning,
                    stacklevel=2,
                )
            except Exception as error:  # from any backend
                raise WorkersLost(f"the workers failed: {type(error).__name__}: {error}") from error
            finally:
                with warnings.catch_warnings():
                    # the remaining items are cancelled on purpose
                    warnings.filterwarnings("ignore", message=".*still being processed", category=UserWarning)
                    results.close()


def _in_processes(tasks: Sequence[_Task], n_jobs: int | None) -> Generator[Any, None, None]:
    """Yield what other processes send, as it comes; they may be lost before the first of it."""
    import joblib

    # small results in one batch would make a large message
    parallel = joblib.Parallel(n_jobs=n_jobs, return_as="generator_unordered", batch_size=1)
    yield from parallel(joblib.delayed(_one)(task) for task in tasks)


def _in_cluster(tasks: Sequence[_Task], backend: Any) -> Generator[Any, None, None]:
    """Yield what the workers of a Dask cluster send, as it comes; joblib would wait for ever for a part that ends its worker.

    Raises WorkersLost for such a part when the others are done, and if the scheduler does not answer or has no worker.
    """
    suspects = yield from _round(tasks, backend)
    # a cluster gives up parts that waited on a worker that was killed, too: one after the other it is clear which it was
    guilty = suspects if len(suspects) < 2 else []
    for task in suspects[len(guilty) :]:
        guilty += yield from _round([task], backend)
    if guilty:
        numbers = ", ".join(str(number + 1) for _, number, *_ in guilty)
        raise WorkersLost(
            f"every worker that began part {numbers} of {len(tasks)} was killed, as where memory runs out"
        )


def _round(tasks: Sequence[_Task], backend: Any) -> Generator[Any, None, list[_Task]]:
    """Yield the results of tasks given to a cluster; return the tasks that it gave up as their workers were killed."""
    client, done = backend.client, SimpleQueue[Any]()
    # as one tuple: Dask would keep a large argument on one worker only, and lose it with that worker
    futures = {client.submit(_one, task, pure=False, **backend.submit_kwargs): task for task in tasks}
    for future in futures:
        future.add_done_callback(done.put)
    given_up = []
    try:
        for _ in tasks:
            future = _patiently(client, partial(done.get, timeout=_PATIENCE))
            error = _patiently(client, partial(future.exception, timeout=_PATIENCE))
            if type(error).__name__ == "KilledWorker":
                given_up.append(futures[future])
            elif error is not None:
                raise error
            else:
                yield _patiently(client, partial(future.result, timeout=_PATIENCE))
    finally:
        with suppress(Exception):  # of a scheduler that is gone
            client.cancel(list(futures))
    return given_up


def _ask(client: Any) -> Mapping[str, Any]:
    """Return the workers that the scheduler of a cluster knows; raises WorkersLost if it does not answer in time."""
    try:
        workers: Mapping[str, Any] = client.sync(client.scheduler.identity, callback_timeout=_PATIENCE)["workers"]
    except Exception as error:
        raise WorkersLost(f"the scheduler of the cluster has not answered for {_PATIENCE:g} s") from error
    return workers


def _patiently(client: Any, wait: Callable[[], Any]) -> Any:
    """Return what ``wait`` waits for, as long as the scheduler of a cluster answers and has workers."""
    while True:
        try:
            return wait()
        except (Empty, TimeoutError):
            if not _ask(client):
                raise WorkersLost(f"the cluster has had no worker for {_PATIENCE:g} s") from None


def _here(tasks: Sequence[_Task], count: int) -> Generator[Any, None, None]:
    """Yield results from this process or its threads; joblib would look for them only a hundred times a second."""
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
    """An error raised by the work, not by the workers."""

    def __init__(self, error: Exception) -> None:
        self.error = error
        super().__init__()


def _one(task: _Task) -> _Found | Path:
    """Return the result of an item, or the file that holds it."""
    work, number, item, caller, folder = task
    end_with(caller)
    found: _Found
    try:
        found = number, work(item), None
    except Exception as error:  # is passed on, to be told from errors of the workers
        found = number, None, error
    return _handed_over(found, Path(folder, str(number))) if folder and os.getppid() == caller else found


def _handed_over(found: _Found, path: Path) -> _Found | Path:
    """Return a result that a pipe takes in one piece: itself if it is small, else the file that it is written to."""
    try:
        content = pickle.dumps(found)
        if len(content) <= _PIECE:
            return found
        path.write_bytes(content)
    except Exception:  # cannot be pickled or written: joblib sends it
        return found
    return path


def _taken(sent: _Found | Path) -> _Found:
    """Return a result, read from its file if it is in one."""
    if not isinstance(sent, Path):
        return sent
    found: _Found = pickle.loads(sent.read_bytes())
    with suppress(OSError):  # the folder goes with it at the end
        sent.unlink()
    return found


def end_with(caller: int) -> None:
    """End this process soon after its parent, if that is ``caller``; a worker calls it first.

    Without it a worker would go on for minutes after its caller is gone. Workers that others started, as in a cluster, and the
    caller's own process are left alone. It has no effect under Windows, which keeps the process id of a parent that is gone.
    """
    if os.getppid() == caller and caller not in _WATCHED:
        _WATCHED.add(caller)
        threading.Thread(target=_watch, args=(caller,), daemon=True).start()


def _watch(caller: int) -> None:
    while os.getppid() == caller:
        time.sleep(_INTERVAL)
    os._exit(1)
