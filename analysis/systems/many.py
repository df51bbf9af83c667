"""Run a system many times with different values, on several processes or a cluster; interrupted studies can be continued."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, LinkworkError

from ..display import format_count
from ..files import unknown_name
from ..numerics.workers import WorkersLost, record_interrupts, run_in_parallel
from ..run import CosimulationError, float_array, require_kind, require_list, show_progress
from ..units import Amount, in_si
from .master import count_steps, run_system
from .wiring import End, Part, Wiring

#: Number of runs per batch.
_BATCH = 16


class SystemRunsEnded(LinkworkError):
    """Error for interrupted runs or lost workers; ``runs`` has the finished runs, and ``folder``, if given, keeps them."""

    def __init__(self, reason: str, runs: SystemRuns, folder: Path | None) -> None:
        self.runs = runs
        kept = f"; the same call with folder={str(folder)!r} goes on from there" if folder else ""
        super().__init__(f"{reason}: {np.count_nonzero(runs.lengths)} of {len(runs)} runs are done{kept}")


@dataclass(frozen=True, kw_only=True)
class SystemRuns:
    """Runs of a system with different values.

    Attributes
    ----------
    time : (M,) float array
        Times of the samples (s).
    names : tuple of str
        Outputs, as ``part.output``.
    samples : (N, K, M) float array
        Values of the outputs, by run, output and time; see `output`.
    lengths : (N,) int array
        Number of samples of each run; 0 if it has not begun or could not begin.
    messages : mapping of int to str
        Message of the part that ended a run early or could not begin, by the index of the run.
    """

    time: NDArray[Any]
    names: tuple[str, ...]
    samples: NDArray[np.float64]
    lengths: NDArray[np.int64]
    messages: Mapping[int, str]

    def __repr__(self) -> str:
        missing = len(self) - len(self.messages.keys() | {*np.flatnonzero(self.lengths).tolist()})
        early = f", {len(self.messages)} of them ended early, as messages says" if self.messages else ""
        rest = f", {missing} of them not run" if missing else ""
        return f"<SystemRuns: {format_count(len(self), 'run')} of {len(self.time)} samples{early}{rest}>"

    def __len__(self) -> int:
        return len(self.lengths)

    def output(self, name: str) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        """Return an output of all runs, shape (N, M), masked after the end of a run."""
        if name not in self.names:
            raise unknown_name(name, self.names, f"output {name!r}")
        after = np.arange(len(self.time)) >= self.lengths[:, None]
        return np.ma.masked_array(self.samples[:, self.names.index(name)], mask=after)


class _Task(NamedTuple):
    """A batch of runs: FMUs and values of the parts, connections, varied values, outputs, and settings of the run.

    ``varied`` has the names of the varied variables, and ``sets`` their values by run and variable. ``run`` is coupling,
    communication step (s), stop time (s) and number of steps per sample.
    """

    parts: tuple[tuple[str, Path, tuple[tuple[str, float], ...]], ...]
    connections: tuple[tuple[End, End], ...]
    varied: tuple[str, ...]
    sets: NDArray[np.float64]
    names: tuple[str, ...]
    run: tuple[str, float, float, int]


@in_si(step="s", stop_time="s")
def run_many(
    wiring: Wiring,
    vary: Mapping[str, ArrayLike],
    outputs: Sequence[str],
    *,
    coupling: str = "hold",
    step: Amount = None,
    stop_time: Amount = None,
    every: int = 1,
    folder: str | Path | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> SystemRuns:
    """Run a system many times, each time with different values.

    Parameters
    ----------
    wiring : Wiring
        The FMUs must lie in a folder that all workers can read.
    vary : mapping of str to array
        Values of parameters and inputs by ``part.variable``, one value for each run (SI).
    outputs : sequence of str
        Outputs to keep, as ``part.output``.
    coupling, step, stop_time
        See `run_system`.
    every : int
        Number of communication steps from one sample to the next.
    folder : path, optional
        Folder in which the runs are kept; runs that are finished in this folder are not repeated.
    n_jobs : int, optional
        Number of processes, -1 for one per core. The default is one process; inside `joblib.parallel_config` for a cluster the
        default is all cores of the cluster.
    progress : bool

    Raises
    ------
    InputError
        If two variables have different numbers of values, ``every`` or the step is not positive, the stop time is not finite
        or before the first step ends, or the folder has runs of another study.
    SystemRunsEnded
        On Ctrl-C, and if workers are lost.
    UnknownNameError
        If there is no such variable or output.
    """
    require_kind(wiring, Wiring, "wiring", "a Wiring, such as load_system(FILE).wiring()")
    require_list(outputs, "outputs")
    step, stop_time = wiring.step if step is None else step, wiring.stop_time if stop_time is None else stop_time
    sets = _value_rows(wiring, vary)
    known = [f"{name}.{output}" for name, part in wiring.parts.items() for output in part.real_variables("output")]
    for name in outputs:
        if name not in known:
            raise unknown_name(name, known, f"output {name!r}")
    if every < 1:
        raise InputError(f"every is {every} communication steps: it must be 1 or more")
    time = np.minimum(step * np.arange(0, count_steps(stop_time, step) + 1, every), stop_time)
    parts = tuple((name, part.fmu.resolve(), tuple(part.values.items())) for name, part in wiring.parts.items())
    task = _Task(
        parts, tuple(wiring.connections.items()), tuple(vary), sets, tuple(outputs), (coupling, step, stop_time, every)
    )
    kept = _Storage(task, len(time), None if folder is None else Path(folder))
    runs = SystemRuns(time=time, names=task.names, samples=kept.samples, lengths=kept.lengths, messages=kept.messages)
    todo = [n for n in range(len(sets)) if kept.lengths[n] == 0 and n not in kept.messages]
    batches = [todo[k : k + _BATCH] for k in range(0, len(todo), _BATCH)]
    tasks = [task._replace(sets=sets[batch]) for batch in batches]
    with record_interrupts() as interrupts, show_progress(progress, len(sets), "running the system") as show:
        try:
            for number, found in run_in_parallel(_batch, tasks, interrupts, n_jobs=n_jobs):
                kept.add(batches[number], found)
                show(float(np.count_nonzero(kept.lengths)))
        except WorkersLost as error:
            raise SystemRunsEnded(str(error), runs, kept.folder) from error
    if interrupts:
        raise SystemRunsEnded("stopped", runs, kept.folder)
    return runs


def _value_rows(wiring: Wiring, vary: Mapping[str, ArrayLike]) -> NDArray[np.float64]:
    """Check the varied values and return them as an array by run and variable."""
    arrays = {
        name: np.atleast_1d(
            float_array(values, f"{name} varies over {values!r:.200}: the values must be numbers in SI")
        )
        for name, values in vary.items()
    }
    known = [f"{n}.{v}" for n, p in wiring.parts.items() for k in ("parameter", "input") for v in p.real_variables(k)]
    for name in arrays:
        if name not in known:
            raise unknown_name(name, known, f"parameter or input {name!r}")
    if not arrays or len({array.shape for array in arrays.values()}) > 1 or next(iter(arrays.values())).ndim > 1:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items()) or "nothing"
        raise InputError(f"the values to vary are {shapes}: there must be one of each for every run")
    return np.column_stack(list(arrays.values()))


class _Storage:
    """Storage of samples, lengths and messages in memory or in a folder; finished runs in the folder are taken over."""

    def __init__(self, task: _Task, count: int, folder: Path | None) -> None:
        self.folder, self.messages = folder, dict[int, str]()
        shape = (len(task.sets), len(task.names), count)
        if folder is None:
            self.samples, self.lengths = np.zeros(shape), np.zeros(len(task.sets), dtype=np.int64)
            return
        key, mark = _key(task), folder / "runs.json"
        there = json.loads(mark.read_text(encoding="utf-8")) if mark.is_file() else None
        if there is not None and there["key"] != key:
            raise InputError(f"{folder} has runs of another system or with other values: give another folder")
        folder.mkdir(parents=True, exist_ok=True)
        mode = "w+" if there is None else "r+"
        self.samples = open_memmap(folder / "samples.npy", mode=mode, dtype=float, shape=shape)
        self.lengths = open_memmap(folder / "lengths.npy", mode=mode, dtype=np.int64, shape=shape[:1])
        if there is None:
            mark.write_text(json.dumps({"key": key, "outputs": task.names, "varied": task.varied}), encoding="utf-8")
        said = folder / "messages.jsonl"
        for line in said.read_text(encoding="utf-8").splitlines() if said.is_file() else ():
            with suppress(ValueError):  # a line that was cut off: its run is repeated
                number, message, self.lengths[number] = json.loads(line)
                self.messages[number] = message

    def add(self, numbers: Sequence[int], found: list[tuple[NDArray[np.float64], str]]) -> None:
        """Store the runs ``numbers`` of a batch: first samples, then messages and lengths, which mark runs as finished."""
        for number, (samples, _) in zip(numbers, found):
            self.samples[number, :, : samples.shape[1]] = samples
        said = [(number, message, samples.shape[1]) for number, (samples, message) in zip(numbers, found) if message]
        self.messages |= {number: message for number, message, _ in said}
        if self.folder is not None:
            self.samples.flush()  # type: ignore[attr-defined]  # a memmap here
            with (self.folder / "messages.jsonl").open("a", encoding="utf-8") as file:
                file.writelines(json.dumps(item) + "\n" for item in said)
        for number, (samples, _) in zip(numbers, found):
            self.lengths[number] = samples.shape[1]


def _key(task: _Task) -> str:
    """Return a hash of everything on which the runs depend."""
    digest = hashlib.sha256(task.sets.tobytes())
    for _, fmu, _ in task.parts:
        digest.update(fmu.read_bytes())
    named = [(name, values) for name, _, values in task.parts]
    digest.update(repr((named, task.connections, task.varied, task.names, task.run)).encode())
    return digest.hexdigest()


@lru_cache(maxsize=4)
def _parts(parts: tuple[tuple[str, Path, tuple[tuple[str, float], ...]], ...]) -> dict[str, Part]:
    return {name: Part.from_fmu(name, fmu, dict(values)) for name, fmu, values in parts}


def _batch(task: _Task) -> list[tuple[NDArray[np.float64], str]]:
    """Run a batch; return for each run its samples by output and time, and the message that ended it early."""
    coupling, step, stop_time, every = task.run
    found = []
    for values in task.sets.tolist():
        parts = dict(_parts(task.parts))
        for name, value in zip(task.varied, values):
            part, _, variable = name.partition(".")
            parts[part] = replace(parts[part], values={**parts[part].values, variable: value})
        wiring = Wiring(title="", parts=parts, connections=dict(task.connections), stop_time=stop_time, step=step)
        try:
            run = run_system(wiring, coupling=coupling, step=step, stop_time=stop_time)
        except CosimulationError as error:
            found.append((np.zeros((len(task.names), 0)), str(error)))
            continue
        found.append((np.array([run[name][::every] for name in task.names]), run.message))
    return found
