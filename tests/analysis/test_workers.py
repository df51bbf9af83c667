"""Work over threads, processes and clusters: the same numbers, whatever happens to the workers."""

import os
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import joblib
import numpy as np
import pytest

from analysis import Inputs, simulate_many
from analysis.numerics import workers as workers_module
from analysis.numerics.workers import WorkersLost, _store_if_large, record_interrupts, run_in_parallel, worker_count
from analysis.periodic import Drive, grid, plane
from analysis.slider_crank import Tolerance, force_turn, monte_carlo
from analysis.synthesis import Search, TargetPath, TimedPath, UntimedPath, synthesize
from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar.published import SETS, TABLE_3_1

from ..linkages import ellipse

SPEED = SETS["table-3.1"].crank_speed
ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="which processes there are is read from /proc")

# Functions of workers


def square(value: int) -> int:
    return value * value


def fail(value: int) -> int:
    if value == 2:
        raise LinkworkError("two is no good")
    return value


def kill_own_worker(value: int, caller: int) -> int:
    if os.getpid() != caller:
        os.kill(os.getpid(), signal.SIGKILL)
    return value


def kill_once(value: int, caller: int, mark: Path) -> int:
    if os.getpid() != caller and value == 3:
        with suppress(FileExistsError):
            mark.touch(exist_ok=False)
            os.kill(os.getpid(), signal.SIGKILL)
    return square(value)


def dawdle(value: int, folder: Path) -> int:
    """Leave word of the process, and take a minute for every item but the first."""
    if value:
        (folder / str(os.getpid())).touch()
        time.sleep(60.0)
    return value


# Any backend


@pytest.mark.parametrize("backend", [None, "threading", "loky"])
@pytest.mark.parametrize("n_jobs", [None, 2])
def test_every_item_is_done_once(backend: str | None, n_jobs: int | None) -> None:
    with joblib.parallel_config(backend) if backend else warnings.catch_warnings():
        found = list(run_in_parallel(square, range(7), n_jobs=n_jobs))
    assert sorted(found) == [(n, n * n) for n in range(7)]


def test_the_backend_and_its_number_of_workers_are_those_of_joblib() -> None:
    assert worker_count(None) == worker_count(1) == 1
    assert worker_count(-1) == joblib.cpu_count()
    with joblib.parallel_config("loky", n_jobs=3):
        assert (worker_count(None), worker_count(2)) == (3, 2)
    here = os.getpid()
    for backend, alike in (("threading", True), ("loky", False)):
        with joblib.parallel_config(backend, n_jobs=2):
            assert (dict(run_in_parallel(process_of, [0, 1]))[0] == here) is alike
    # threads where nobody says otherwise
    assert dict(run_in_parallel(process_of, [0, 1], n_jobs=2, threads=True))[0] == here
    with pytest.raises(InputError, match="0 cores"):
        list(run_in_parallel(square, range(2), n_jobs=0))


def process_of(_: int) -> int:
    return os.getpid()


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_an_error_of_the_work_is_raised_as_it_is(n_jobs: int) -> None:
    with pytest.raises(LinkworkError, match=r"^two is no good$") as caught:
        list(run_in_parallel(fail, range(5), n_jobs=n_jobs))
    assert type(caught.value) is LinkworkError


def test_what_a_killed_worker_had_is_done_again(tmp_path: Path) -> None:
    work = partial(kill_once, caller=os.getpid(), mark=tmp_path / "killed")
    with pytest.warns(RuntimeWarning, match=r"a worker was killed: \d of 8 parts are repeated"):
        found = dict(run_in_parallel(work, range(8), n_jobs=2))
    assert found == {n: n * n for n in range(8)}


def large_in_pieces(value: int, caller: int, mark: Path) -> np.ndarray[Any, Any]:
    """A large result; a worker that sends more than a pipe takes in one piece is killed half way, once."""
    send = Connection._send  # type: ignore[attr-defined]

    def halves(self: Connection, content: Any, *rest: Any) -> None:
        if len(content) > 4096 and not mark.exists():
            mark.touch()
            send(self, bytes(content)[: len(content) // 2], *rest)
            os.kill(os.getpid(), signal.SIGKILL)
        send(self, content, *rest)

    if os.getpid() != caller:
        Connection._send = halves  # type: ignore[attr-defined]
    return np.full(200_000, float(value))


@pytest.mark.timeout(120)
@pytest.mark.skipif(sys.platform == "win32", reason="pipes there send otherwise")
def test_large_results_do_not_go_through_a_pipe_that_a_killed_worker_stops(tmp_path: Path) -> None:
    work = partial(large_in_pieces, caller=os.getpid(), mark=tmp_path / "killed")
    found = dict(run_in_parallel(work, range(4), n_jobs=2))
    assert {n: (made.size, made[0], made[-1]) for n, made in found.items()} == {n: (200_000, n, n) for n in range(4)}
    assert not (tmp_path / "killed").exists()
    # joblib's processes go on to other tests
    (tmp_path / "killed").touch()


class KilledOnce:
    """A result whose worker is killed while it is pickled."""

    def __init__(self, caller: int, mark: Path) -> None:
        self.caller, self.mark = caller, mark

    def __reduce__(self) -> tuple[Any, ...]:
        if os.getpid() != self.caller and not self.mark.exists():
            self.mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return KilledOnce, (self.caller, self.mark)


def hand_over(_: int, caller: int, mark: Path) -> KilledOnce:
    return KilledOnce(caller, mark)


def test_a_worker_killed_as_it_hands_over_is_noticed(tmp_path: Path) -> None:
    work = partial(hand_over, caller=os.getpid(), mark=tmp_path / "killed")
    with pytest.warns(RuntimeWarning, match=r"a worker was killed: \d of 3 parts are repeated"):
        found = dict(run_in_parallel(work, range(3), n_jobs=2))
    assert sorted(found) == [0, 1, 2]


@pytest.mark.parametrize("content", [b"x" * 100_000, "lambda"])
def test_what_cannot_be_written_is_sent_as_before(content: Any, tmp_path: Path) -> None:
    found = (1, (lambda: 3) if content == "lambda" else content, None)
    assert _store_if_large(found, tmp_path / "none" / "1") is found
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_workers_that_are_killed_again_and_again_are_given_up() -> None:
    work = partial(kill_own_worker, caller=os.getpid())
    with (
        pytest.warns(RuntimeWarning, match="5 of 5 parts"),
        pytest.raises(WorkersLost, match=r"workers were killed 4 times, .* 5 of 5 parts are not done, 1, 2, 3, 4, 5"),
    ):
        list(run_in_parallel(work, range(5), n_jobs=2))


def running(number: int) -> bool:
    try:
        return "State:\tZ" not in Path(f"/proc/{number}/status").read_text()
    except OSError:
        return False


def until(reached: Callable[[], bool], seconds: float = 60.0) -> bool:
    end = time.monotonic() + seconds
    while not (done := reached()) and time.monotonic() < end:
        time.sleep(0.05)
    return done


@ON_LINUX
def test_ctrl_c_is_heard_at_once_and_leaves_no_worker_at_work(tmp_path: Path) -> None:
    def interrupt() -> None:
        until(lambda: len(list(tmp_path.iterdir())) == 2)
        begun.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    begun: list[float] = []
    thread = threading.Thread(target=interrupt)
    with record_interrupts() as interrupts:
        thread.start()
        found = list(run_in_parallel(partial(dawdle, folder=tmp_path), range(4), interrupts, n_jobs=2))
    assert time.monotonic() - begun[0] < 10.0
    thread.join()
    assert found == [(0, 0)]
    assert interrupts == [True]
    workers = [int(path.name) for path in tmp_path.iterdir()]
    assert until(lambda: not any(map(running, workers)), 10.0)


@pytest.mark.slow
@ON_LINUX
@pytest.mark.parametrize("backend", ["loky", "dask"])
def test_workers_end_with_a_process_that_is_killed(backend: str, tmp_path: Path) -> None:
    code = f"""
from functools import partial
from pathlib import Path
import joblib
from analysis.numerics.workers import run_in_parallel
from tests.analysis.test_workers import dawdle

def main():
    with joblib.parallel_config({backend!r}):
        list(run_in_parallel(partial(dawdle, folder=Path({str(tmp_path)!r})), range(4), n_jobs=2))

if __name__ == "__main__":
    if {backend!r} == "dask":
        from distributed import Client
        with Client(n_workers=2, threads_per_worker=1, dashboard_address=":0"):
            main()
    else:
        main()
"""
    if backend == "dask":
        pytest.importorskip("distributed")
    process = subprocess.Popen([sys.executable, "-c", code], start_new_session=True, cwd=Path(__file__).parents[2])
    try:
        assert until(lambda: len(list(tmp_path.iterdir())) == 2)
        workers = [int(path.name) for path in tmp_path.iterdir()]
        assert all(map(running, workers))
    finally:
        process.kill()
        process.wait()
    assert until(lambda: not any(map(running, workers)), 20.0)


# A cluster

ELLIPSE = ellipse(24)
SPRINGS = [replace(TABLE_3_1, slider_stiffness=500.0 + 20.0 * n) for n in range(24)]


def ensemble(_: Path) -> list[Any]:
    runs = simulate_many(SPRINGS, Inputs(speed=SPEED), stop_time=20.0, step=0.1, batch=2)
    return [runs.states, runs.counts, runs.energies]


def kept_ensemble(folder: Path) -> list[Any]:
    """Outputs of runs one of which cannot start, kept on disk by the workers."""
    starts = [{"slider_position": 1.0 if n == 5 else 0.0} for n in range(24)]
    runs = simulate_many(
        SPRINGS, Inputs(speed=SPEED), initial=starts, stop_time=100.0, step=0.1, batch=2,
        outputs=["slider.position"], folder=folder,
    )  # fmt: skip
    assert len(list(folder.glob("*.runs"))) == 12
    return [runs.values, runs.status, *runs.messages]


def chart(folder: Path) -> list[Any]:
    operation = plane(TABLE_3_1, Drive(speed=SPEED), "drive.speed", "slider.damping")
    found = grid(operation, np.linspace(20.0, 60.0, 80), np.linspace(10.0, 60.0, 12), folder=folder)
    assert len(list(folder.glob("*.row"))) == found.computed == 12
    return [found.largest.filled(), found.starts, found.status]


def timed_path(_: Path) -> list[Any]:
    search = Search(starts=36, candidates=1 << 12, seed=5)
    return [list(s.linkage.values().values()) for s in synthesize(TimedPath(points=ELLIPSE), search=search).solutions]


def least_area(_: Path) -> list[Any]:
    task = UntimedPath(path=TargetPath(points=ELLIPSE, closed=True), samples=24)
    search = Search(starts=12, candidates=1 << 12)
    return [list(s.linkage.values().values()) for s in synthesize(task, search=search).solutions]


def samples(_: Path) -> list[Any]:
    turn = force_turn("rahman-a4-10-s1-3.5", angles=np.linspace(0.0, 6.0, 40))
    names = ("slider.position", "crank_pin.fz")
    found = monte_carlo(turn, [Tolerance("rod.length", 5e-4), Tolerance("guide.offset", 5e-4)], quantities=names,
                        samples=50_000, seed=3)  # fmt: skip
    spreads = [found.spreads[name] for name in names]
    return [part for s in spreads for part in (s.mean.filled(), s.deviation.filled(), s.percentiles.filled(), s.counts)]


WORK = (ensemble, kept_ensemble, chart, timed_path, least_area, samples)


def assert_same(found: list[Any], expected: list[Any]) -> None:
    assert len(found) == len(expected)
    for ours, theirs in zip(found, expected):
        assert np.array_equal(ours, theirs, equal_nan=not isinstance(ours, str))


@contextmanager
def new_cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local,
        distributed.Client(local),
    ):
        yield local


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with new_cluster() as local:
        yield local


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Callable[[Path], list[Any]]], list[Any]]:
    made: dict[str, list[Any]] = {}

    def result(work: Callable[[Path], list[Any]]) -> list[Any]:
        if work.__name__ not in made:
            made[work.__name__] = work(tmp_path_factory.mktemp(work.__name__))
        return made[work.__name__]

    return result


@contextmanager
def killing(cluster: Any) -> Iterator[list[int]]:
    """Kill a worker of a cluster that has something to do, once; its process is in the list."""
    killed: list[int] = []
    over = threading.Event()

    def kill() -> None:
        while not over.is_set():
            with suppress(RuntimeError):  # the scheduler is changing its tables
                for nanny in cluster.workers.values():
                    state = cluster.scheduler.workers.get(nanny.worker_address)
                    if state is not None and state.processing and nanny.pid:
                        killed.append(nanny.pid)
                        os.kill(nanny.pid, signal.SIGKILL)
                        return
            time.sleep(1e-3)

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        yield killed
    finally:
        over.set()
        thread.join()


@pytest.mark.slow
@pytest.mark.parametrize("work", WORK)
def test_a_cluster_gives_what_one_process_does(
    work: Callable[[Path], list[Any]], cluster: Any, serial: Any, tmp_path: Path
) -> None:
    before = cluster.scheduler.transition_counter
    with joblib.parallel_config("dask"):
        found = work(tmp_path)
    # waited, was processed, was in memory, was released
    assert cluster.scheduler.transition_counter - before >= 3 * 4
    assert_same(found, serial(work))


@pytest.mark.slow
@pytest.mark.parametrize("work", [kept_ensemble, timed_path, samples])
def test_so_does_one_whose_worker_is_killed(work: Callable[[Path], list[Any]], serial: Any, tmp_path: Path) -> None:
    with new_cluster() as local, joblib.parallel_config("dask"), killing(local) as killed:
        found = work(tmp_path)
    assert len(killed) == 1
    assert_same(found, serial(work))


def kill_on_two(value: int) -> int:
    if value == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return square(value)


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_part_that_kills_every_worker_of_a_cluster_is_named() -> None:
    dask = pytest.importorskip("dask")
    found = []
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        new_cluster(),
        joblib.parallel_config("dask"),
        pytest.raises(WorkersLost, match="part 3 of 5 was killed"),
    ):
        found.extend(run_in_parallel(kill_on_two, range(5)))
    assert sorted(found) == [(n, n * n) for n in (0, 1, 3, 4)]


class Waiting:
    """A future that is never done."""

    def add_done_callback(self, _: Any) -> None: ...


class Silent:
    """A client of Dask whose tasks are never done, with a scheduler that answers with some workers, or with an error."""

    def __init__(self, workers: dict[str, Any] | None) -> None:
        self.scheduler, self.workers, self.cancelled = SimpleNamespace(identity=None), workers, 0

    def submit(self, *_: Any, **__: Any) -> Any:
        return Waiting()

    def sync(self, *_: Any, callback_timeout: float) -> dict[str, Any]:
        if self.workers is None:
            raise TimeoutError
        return {"workers": self.workers}

    def cancel(self, futures: list[Any]) -> None:
        self.cancelled += len(futures)


@pytest.mark.parametrize(
    ("workers", "said"),
    [(None, "the scheduler of the cluster has not answered"), ({}, "the cluster has had no worker")],
)
def test_a_cluster_that_does_not_answer_is_given_up(
    monkeypatch: pytest.MonkeyPatch, workers: dict[str, Any] | None, said: str
) -> None:
    monkeypatch.setattr(workers_module, "_PATIENCE", 0.05)
    client = Silent(workers)
    backend = SimpleNamespace(client=client, submit_kwargs={}, effective_n_jobs=lambda _: 2)
    monkeypatch.setattr(joblib.parallel, "get_active_backend", lambda **_: (backend, None))
    with pytest.raises(WorkersLost, match=said):
        list(run_in_parallel(square, range(3)))
    # a scheduler that is silent from the beginning has no tasks
    assert client.cancelled == (3 if workers is not None else 0)


@pytest.mark.slow
@pytest.mark.parametrize(("backend", "work"), [("threading", ensemble), ("threading", samples), ("loky", chart)])
def test_so_do_other_backends(backend: str, work: Callable[[Path], list[Any]], serial: Any, tmp_path: Path) -> None:
    with joblib.parallel_config(backend, n_jobs=2):
        assert_same(work(tmp_path), serial(work))


# The command line


@pytest.mark.slow
def test_the_command_line_joins_a_cluster(cluster: Any, linkwork: Callable[..., Any]) -> None:
    command = "slider-crank", "tolerances", "--samples", 2000, "--no-plot", "--out"
    before = cluster.scheduler.transition_counter
    for folder, options in (
        ("here", ()),
        ("processes", ("--jobs", 2)),
        ("there", ("--scheduler", cluster.scheduler_address)),
    ):
        linkwork(*command, folder, *options)
    assert cluster.scheduler.transition_counter > before
    names = sorted(path.name for path in Path("here").glob("*.csv"))
    assert len(names) == 2
    for name in names:
        assert len({Path(folder, name).read_bytes() for folder in ("here", "processes", "there")}) == 1


def test_a_scheduler_that_does_not_answer_is_a_sentence(
    linkwork: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("analysis.cli.common._PATIENCE", 0.2)
    result = linkwork("slider-crank", "tolerances", "--scheduler", "tcp://127.0.0.1:1", code=2)
    assert "no scheduler of Dask answers at tcp://127.0.0.1:1" in " ".join(result.stderr.split())
