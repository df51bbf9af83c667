"""Parallel work by joblib, in the threads, processes or cluster that the caller has chosen."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor, as_completed
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from numbers import Integral
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from linkwork.errors import InputError, LinkworkError

Item = TypeVar("Item")
Made = TypeVar("Made")

#: How often workers are restarted after one was killed.
RETRIES = 3

#: Size of a pickled result (bytes) up to which it is sent through the pipe: with joblib's additions it passes in one piece.
_PIECE = 2048

#: A task: function, number of the item, item, process id of the caller, folder for results.
_Task = tuple[Callable[[Any], Any], int, Any, int, str]
#: A result: number of the item, value of the function, error that the function raised.
_Found = tuple[int, Any, Exception | None]

_WATCHED: set[int] = set()
#: `signal.signal` without its search for the handler's name, which took 8 us of the 160 us of a short run.
_set_handler = getattr(sys.modules.get("_signal"), "signal", signal.signal)
#: Seconds between two checks that the caller is alive.
_INTERVAL = 0.5
#: Seconds without a result after which the scheduler of a cluster is asked whether it is alive; also its time to answer.
_PATIENCE = 60.0


class WorkersLost(LinkworkError):
    """Error for workers that failed: they were killed again and again, or the scheduler of a cluster is gone."""


class Interrupts(list[bool]):
    """A list with an entry for each Ctrl-C; while ``waiting`` for other processes, Ctrl-C also raises KeyboardInterrupt."""

    waiting = False


@contextmanager
def record_interrupts() -> Iterator[Interrupts]:
    """Record each Ctrl-C in a list, which the caller checks between two steps.

    If Ctrl-C raised an exception instead, this could happen inside an FMU that runs in this interpreter, or inside Numba, which
    may drop the exception.
    """
    interrupts = Interrupts()
    if threading.current_thread() is not threading.main_thread():
        yield interrupts
        return

    def hear(*_: object) -> None:
        interrupts.append(True)
        if interrupts.waiting:
            raise KeyboardInterrupt

    before = _set_handler(signal.SIGINT, hear)
    try:
        yield interrupts
    finally:
        # None is a handler that was not set from Python
        _set_handler(signal.SIGINT, signal.SIG_DFL if before is None else before)


def check_jobs(n_jobs: Any) -> None:
    """Check that a number of workers is a whole number, not 0.

    Raises
    ------
    InputError
        If it is not.
    """
    if n_jobs is not None and (isinstance(n_jobs, bool) or not isinstance(n_jobs, Integral)):
        raise InputError(f"n_jobs is {n_jobs!r}: it must be a whole number of cores, or -1 for all")
    if n_jobs == 0:
        raise InputError("0 cores: give a number of cores, or -1 for all")


def worker_count(n_jobs: int | None) -> int:
    """Return how many workers `run_in_parallel` uses, as `joblib.Parallel` counts them; on a cluster, all of its cores."""
    return _workers(n_jobs, threads=False)[0]


def share_memory(n_jobs: int | None, *, threads: bool = False) -> bool:
    """Return whether `run_in_parallel` does the work in this process and its threads, not in other processes."""
    return not _workers(n_jobs, threads)[1]


def _workers(n_jobs: int | None, threads: bool) -> tuple[int, bool, Any]:
    """Return the number of workers, whether the workers are other processes, and the backend of joblib."""
    import joblib

    check_jobs(n_jobs)
    backend, default = joblib.parallel.get_active_backend(prefer="threads" if threads else None)
    if hasattr(backend, "client"):
        _ask_scheduler(backend.client)  # joblib would wait for ever for a scheduler that is gone
    try:
        count = int(backend.effective_n_jobs((default or 1) if n_jobs is None else n_jobs))
    except TimeoutError as error:
        raise WorkersLost(f"the cluster has no worker: {error}") from error
    return count, count > 1 and not getattr(backend, "supports_sharedmem", False), backend


def run_in_parallel(
    work: Callable[[Item], Made],
    items: Sequence[Item],
    interrupts: Interrupts | None = None,
    *,
    n_jobs: int | None = None,
    threads: bool = False,
) -> Iterator[tuple[int, Made]]:
    """Apply a function to items in parallel; yield index and result of each item as soon as it is done.

    The workers are processes of this machine, or threads of this process if ``threads`` is true; or those of the backend that
    `joblib.parallel_config` has set, such as "dask", "loky" or "threading". With one worker the work is done in this process.
    An item whose worker was killed goes to another worker. Worker processes of this machine end when this process ends.

    Parameters
    ----------
    work : callable
        Function of an item; its exceptions are raised in this process.
    items : sequence
    interrupts : Interrupts, optional
        From `record_interrupts`. With it, Ctrl-C ends the iteration; without it, Ctrl-C raises KeyboardInterrupt.
    n_jobs : int, optional
        Number of workers, -1 for one per core; by default the number that `joblib.parallel_config` has set, else 1.
    threads : bool
        Whether threads are preferred to processes.

    Raises
    ------
    WorkersLost
        If workers were killed more than `RETRIES` times or fail in another way, or the scheduler of a cluster does not answer.
        If an item kills every worker of a cluster, the message names it; the results of all other items are yielded first.

    Notes
    -----
    Processes of this machine pass large results in files: if a process is killed in the middle of a message, joblib waits for
    ever for the rest of the message.
    """
    count, elsewhere, backend = _workers(n_jobs, threads)
    listening = Interrupts() if interrupts is None else interrupts
    todo = dict(enumerate(items))
    with (
        tempfile.TemporaryDirectory(prefix="linkwork-", ignore_cleanup_errors=True) if elsewhere else nullcontext("")
    ) as folder:
        for attempt in range(RETRIES + 1):
            tasks = [(work, number, item, os.getpid(), folder) for number, item in todo.items()]
            if not elsewhere:
                results = _run_in_this_process(tasks, count)
            elif hasattr(backend, "client"):
                results = _run_in_cluster(tasks, backend)
            else:
                results = _run_in_processes(tasks, n_jobs)
            try:
                while todo:
                    listening.waiting = elsewhere
                    try:
                        number, made, error = _read_result(next(results))
                    finally:
                        listening.waiting = False
                    if error is not None:
                        raise _WorkError(error)
                    del todo[number]
                    yield number, made
                return
            except KeyboardInterrupt:  # in this process, or in a worker
                if interrupts is None:
                    raise
                if not interrupts:
                    interrupts.append(True)
                return
            except _WorkError as caught:
                raise caught.error from None
            except LinkworkError:  # from an item that cannot be sent
                raise
            except BrokenExecutor as error:
                if attempt == RETRIES:
                    numbers = ", ".join(str(number + 1) for number in list(todo)[:5])
                    raise WorkersLost(
                        f"workers were killed {attempt + 1} times, perhaps for lack of memory: {len(todo)} of {len(items)} "
                        f"parts are not done, {numbers}{' ...' if len(todo) > 5 else ''}"
                    ) from error
                warnings.warn(
                    f"a worker was killed: {len(todo)} of {len(items)} parts are repeated", RuntimeWarning, stacklevel=2
                )
            except Exception as error:  # from any backend
                raise WorkersLost(f"the workers failed: {type(error).__name__}: {error}") from error
            finally:
                with warnings.catch_warnings():
                    # the remaining items are cancelled on purpose
                    warnings.filterwarnings("ignore", message=".*still being processed", category=UserWarning)
                    results.close()


def _run_in_processes(tasks: Sequence[_Task], n_jobs: int | None) -> Generator[Any, None, None]:
    """Yield the results of processes of this machine in the order in which they arrive."""
    import joblib

    # small results in one batch would make a large message
    parallel = joblib.Parallel(n_jobs=n_jobs, return_as="generator_unordered", batch_size=1)
    yield from parallel(joblib.delayed(_do_task)(task) for task in tasks)


def _run_in_cluster(tasks: Sequence[_Task], backend: Any) -> Generator[Any, None, None]:
    """Yield the results of the workers of a Dask cluster in the order in which they arrive.

    Raises WorkersLost if the scheduler does not answer or has no worker. If tasks kill their workers, the error is raised after
    all other tasks are done; joblib itself would wait for such a task for ever.
    """
    suspects = yield from _run_round(tasks, backend)
    # a cluster also gives up tasks that waited on the killed worker: run one by one, the task that killed it shows
    guilty = suspects if len(suspects) < 2 else []
    for task in suspects[len(guilty) :]:
        guilty += yield from _run_round([task], backend)
    if guilty:
        numbers = ", ".join(str(number + 1) for _, number, *_ in guilty)
        raise WorkersLost(
            f"every worker that began part {numbers} of {len(tasks)} was killed, perhaps for lack of memory"
        )


def _run_round(tasks: Sequence[_Task], backend: Any) -> Generator[Any, None, list[_Task]]:
    """Submit tasks to a cluster and yield their results; return the tasks given up because their workers were killed."""
    client, done = backend.client, SimpleQueue[Any]()
    # as one tuple: Dask would keep a large argument on one worker only, and lose it with that worker
    futures = {client.submit(_do_task, task, pure=False, **backend.submit_kwargs): task for task in tasks}
    for future in futures:
        future.add_done_callback(done.put)
    given_up = []
    try:
        for _ in tasks:
            future = _wait_for_cluster(client, partial(done.get, timeout=_PATIENCE))
            error = _wait_for_cluster(client, partial(future.exception, timeout=_PATIENCE))
            if type(error).__name__ == "KilledWorker":
                given_up.append(futures[future])
            elif error is not None:
                raise error
            else:
                yield _wait_for_cluster(client, partial(future.result, timeout=_PATIENCE))
    finally:
        with suppress(Exception):  # the scheduler may be gone
            client.cancel(list(futures))
    return given_up


def _ask_scheduler(client: Any) -> Mapping[str, Any]:
    """Ask the scheduler of a cluster for its workers; raise WorkersLost if it does not answer in time."""
    try:
        workers: Mapping[str, Any] = client.sync(client.scheduler.identity, callback_timeout=_PATIENCE)["workers"]
    except Exception as error:
        raise WorkersLost(f"the scheduler of the cluster has not answered for {_PATIENCE:g} s") from error
    return workers


def _wait_for_cluster(client: Any, wait: Callable[[], Any]) -> Any:
    """Call ``wait`` until it returns, and return its value; raise WorkersLost if the cluster is gone or has no workers."""
    while True:
        try:
            return wait()
        except (Empty, TimeoutError):
            if not _ask_scheduler(client):
                raise WorkersLost(f"the cluster has had no worker for {_PATIENCE:g} s") from None


def _run_in_this_process(tasks: Sequence[_Task], count: int) -> Generator[Any, None, None]:
    """Do tasks in this process or its threads and yield the results; joblib would look for results every 10 ms only."""
    if count == 1:
        yield from map(_do_task, tasks)
        return
    pool = ThreadPoolExecutor(count)
    try:
        for future in as_completed([pool.submit(_do_task, task) for task in tasks]):
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)


class _WorkError(Exception):
    """An error raised by the work, not by the workers."""

    def __init__(self, error: Exception) -> None:
        self.error = error
        super().__init__()


def _do_task(task: _Task) -> _Found | Path:
    """Do the work of a task; return its result, or the file that holds the result."""
    work, number, item, caller, folder = task
    end_when_orphaned(caller)
    found: _Found
    try:
        found = number, work(item), None
    except Exception as error:  # returned, as one that is raised would count as an error of the workers
        found = number, None, error
    return _store_if_large(found, Path(folder, str(number))) if folder and os.getppid() == caller else found


def _store_if_large(found: _Found, path: Path) -> _Found | Path:
    """Return a result if it is small enough for a pipe; else write it to a file and return the path."""
    try:
        content = pickle.dumps(found)
        if len(content) <= _PIECE:
            return found
        path.write_bytes(content)
    except Exception:  # cannot be pickled or written: joblib sends it
        return found
    return path


def _read_result(sent: _Found | Path) -> _Found:
    """Return a result that a worker sent, read from its file if the worker sent a path."""
    if not isinstance(sent, Path):
        return sent
    found: _Found = pickle.loads(sent.read_bytes())
    with suppress(OSError):  # a file that stays is deleted with its folder
        sent.unlink()
    return found


def end_when_orphaned(caller: int) -> None:
    """Start a thread that ends this worker process when its parent, the process ``caller``, is gone.

    Without the thread a worker would go on for minutes. If this process has another parent, as in a cluster or in the caller
    itself, nothing is done. Under Windows the thread has no effect: the process id of the parent stays when the parent is gone.
    """
    if os.getppid() == caller and caller not in _WATCHED:
        _WATCHED.add(caller)
        threading.Thread(target=_watch, args=(caller,), daemon=True).start()


def _watch(caller: int) -> None:
    while os.getppid() == caller:
        time.sleep(_INTERVAL)
    os._exit(1)
