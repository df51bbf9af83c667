"""Ensembles: many runs over the same times, solved in batches on several cores, saved on disk and resumed."""

from __future__ import annotations

import mmap
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from math import prod
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Unpack, overload

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, Interrupted, LinkworkError
from linkwork.mechanism import Mechanism

from ..display import format_count
from ..files import Whole, unknown_name
from ..mechanisms import InitialState, Parameters, find_mechanism
from ..numerics.workers import WorkersLost, check_jobs, record_interrupts, run_in_parallel, share_memory
from ..units import Amount, in_si
from .arguments import complete_initial_state, complete_inputs, require_list, takes_options, takes_published
from .batches import NOT_RUN, Result, Task, hash_code, solve
from .events import show_progress
from .inputs import Inputs, check_run, compile_source, encode
from .prepared import compute_outputs
from .signals import Function
from .simulation import MOST_STEPS, RunOptions, check_settings, sample_times
from .trajectory import Trajectory
from .varied import VariedSequence, distinct_objects
from .varied import vary as varied_sets

#: Largest number of samples in a batch, if the caller does not choose the size of batches.
_SAMPLES_OF_BATCH = 1 << 16
#: Largest number of samples in a batch on a graphics processor, which needs thousands of runs at once to be fast.
_SAMPLES_ON_DEVICE = 1 << 22


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """Many runs over the same times.

    Attributes
    ----------
    time : ndarray, shape (n,)
    states : ndarray, shape (m, n, states)
        State of each run, with the dissipated and the supplied work; NaN after the last sample that the run reached. If
        outputs were chosen, n is 0 here.
    forces : ndarray, shape (m, n, inputs)
        Channels at the samples, in the order of the FMI inputs. If outputs were chosen, n is 0 here.
    values : ndarray, shape (m, n, k), or None
        The outputs ``names`` if outputs were chosen.
    names : tuple of str
        Names of the outputs.
    status : ndarray of int, shape (m,)
        solver.status of each run: 2 if an input was not usable, 3 if the links could not be joined, at the start or later;
        -1 if the run was interrupted or not begun.
    messages : tuple of str
        Why a run ended early or did not start; for a complete run a caution that it is stiff, or empty.
    counts : ndarray of int, shape (m,)
        Number of samples that each run reached; 0 if it did not start.
    parameters : sequence
        Parameters of the mechanism for each run.
    modes : ndarray
        Values of the mechanism's modes, the same for all runs.
    energies : ndarray, shape (m,)
        Mechanical energy of each run at the start (J); NaN if it did not start.
    """

    time: NDArray[np.float64]
    states: NDArray[np.float64]
    forces: NDArray[np.float64]
    values: NDArray[np.float64] | None
    names: tuple[str, ...]
    status: NDArray[np.int64]
    messages: tuple[str, ...]
    counts: NDArray[np.int64]
    parameters: Sequence[Parameters]
    modes: NDArray[np.float64]
    energies: NDArray[np.float64]

    def __repr__(self) -> str:
        missing = int(np.count_nonzero(self.status == NOT_RUN))
        early = int(np.count_nonzero(self.status)) - missing
        over = f"{len(self.time)} samples from {self.time[0]:.4g} to {self.time[-1]:.4g} s"
        ended = "all complete" if not early else f"{early} of them ended early: see messages"
        if missing:
            ended = f"{missing} of them interrupted before their end" + (f", {ended}" if early else "")
        return f"<Ensemble: {format_count(len(self), 'run')} of {over}, {ended}>"

    def __len__(self) -> int:
        return len(self.parameters)

    @overload
    def __getitem__(self, index: int) -> Trajectory: ...

    @overload
    def __getitem__(self, index: slice) -> list[Trajectory]: ...

    def __getitem__(self, index: int | slice) -> Trajectory | list[Trajectory]:
        """Return one run as a `Trajectory`, or the runs of a slice as a list.

        Unlike `simulate`, a run that ended early has no row for its last configuration.
        """
        if isinstance(index, slice):
            return [self[n] for n in range(*index.indices(len(self)))]
        n = int(self.counts[index])
        if self.values is not None:
            values = self.values[index, :n]
        else:
            mechanism = find_mechanism(self.parameters[index])
            p = np.array([*self.parameters[index].constants(), self.energies[index]])
            values = compute_outputs(mechanism, self.modes, p, self.states[index, :n], self.forces[index, :n])
        return Trajectory(
            time=self.time[:n],
            values=values,
            status=int(self.status[index]),
            message=self.messages[index],
            source="compiled DOP853",
            parameters=self.parameters[index],
            names=self.names,
        )

    @property
    def failures(self) -> dict[int, str]:
        """Return the messages of the runs that did not reach their end, by the index of the run."""
        return {i: self.messages[i] for i in np.flatnonzero(self.status != 0).tolist()}

    def output(self, name: str) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        """Return one output of all runs, shape (m, n), masked where a run had already ended."""
        shape = (len(self), len(self.time))
        if self.values is not None:
            ended = np.arange(len(self.time)) >= self.counts[:, None]
            return np.ma.MaskedArray(self.values[:, :, output_column(name, self.names)], mask=ended)
        result = np.ma.MaskedArray(np.full(shape, np.nan), mask=np.ones(shape, dtype=bool))
        for i in range(len(self)):
            run = self[i]
            result[i, : len(run)] = run[name]
        return result


class EnsembleInterrupted(Interrupted):
    """Error of an interrupted ensemble; ``ensemble`` has the results so far, and status -1 for the other runs."""

    def __init__(self, ensemble: Ensemble, folder: Path | None) -> None:
        self.ensemble = ensemble
        super().__init__(f"interrupted with {_describe_progress(ensemble, folder)}")


class EnsembleBroken(LinkworkError):
    """Error of an ensemble whose workers failed, for example were killed; ``ensemble`` has the results so far."""

    def __init__(self, ensemble: Ensemble, folder: Path | None, error: WorkersLost) -> None:
        self.ensemble = ensemble
        super().__init__(f"{error}, with {_describe_progress(ensemble, folder)}")


def _describe_progress(ensemble: Ensemble, folder: Path | None) -> str:
    done = np.count_nonzero(ensemble.status != NOT_RUN)
    where = "" if folder is None else f"; whole batches are kept in {folder}: call again to go on"
    return f"{done} of {len(ensemble)} runs done{where}"


class EnsembleOptions(RunOptions, total=False):
    """Less common options of `simulate_many`."""

    batch: int | None
    device: str | None


@takes_published(inputs=complete_inputs, initial=complete_initial_state)
@takes_options(EnsembleOptions)
@in_si(stop_time="s", step="s", start_time="s", hold="s")
def simulate_many(
    parameters: Sequence[Parameters] | Parameters,
    inputs: Inputs | Sequence[Inputs] | None = None,
    *,
    vary: Mapping[str, Any] | None = None,
    initial: InitialState | Sequence[InitialState] | None = None,
    stop_time: Amount,
    step: Amount = 1e-3,
    hold: Amount = None,
    tolerance: float = 1e-9,
    outputs: Sequence[str] | None = None,
    folder: str | Path | None = None,
    n_jobs: int | None = None,
    **options: Unpack[EnsembleOptions],
) -> Ensemble:
    """Run many mechanisms, or one mechanism under many inputs, in batches of compiled calls.

    ``inputs`` and ``initial`` are one object for all runs, or a list with one object for each run. All inputs must drive the
    same degrees of freedom in the same way and have the same Python functions, if any. The batches are solved by ``n_jobs``
    threads of this process, or by the workers of the backend that `joblib.parallel_config` has set: "dask" for a Dask
    cluster, "loky" for processes.

    Runs are integrated side by side in the vector lanes of the processor.

    Parameters
    ----------
    vary : mapping, optional
        Values of parameters or of constant inputs by their names, one for each run, in SI or as texts with units;
        ``parameters`` and ``inputs`` are then what all runs have in common.
    outputs : sequence of str, optional
        Outputs of the FMI contract to keep; by default states and channels, from which `Ensemble` computes all outputs.
    folder : path, optional
        Folder in which each finished batch is saved. The file names are made from everything that the results depend on. The
        same call again therefore reads the finished batches, and computes only those that are missing or whose file is
        damaged. While the ensemble is in use, its arrays are also on this disk and take little memory.

    Other Parameters
    ----------------
    batch : int, optional
        Number of runs that are prepared and solved together: by default a quarter of all runs, at most 128, or a sixteenth, at
        most 256, whichever is more. It is smaller if the runs have many samples, but at least 16. On a device it is as large
        as 4 million samples allow.
    device : str, optional
        "cuda" to integrate all runs on a graphics processor of NVIDIA (extra ``cuda``), each in a thread of its own; inputs
        that are functions of Python cannot be evaluated there.
    start_time, max_steps, progress
        As for `simulate`, like all arguments that are not described here.

    Returns
    -------
    Ensemble
        A run that cannot start, ends early, or meets an input that is not finite has a status and a message; the other runs
        are not affected.

    Raises
    ------
    InputError, ParameterError
        If an argument that concerns all runs is not usable.
    EnsembleInterrupted
        On Ctrl-C; the error has the results so far.
    EnsembleBroken
        If workers are killed again and again, or a cluster is gone; the error has the results so far.

    Examples
    --------
    >>> import numpy as np
    >>> from analysis import simulate_many
    >>> runs = simulate_many("table-3.1", vary={"slider.stiffness": np.linspace(800.0, 1200.0, 3)}, stop_time="0.2 s")
    >>> runs.output("slider.position").shape
    (3, 201)
    """
    if vary is not None:
        if isinstance(parameters, Sequence):
            raise InputError("with vary there is one set of parameters, which all runs have in common")
        parameters, inputs = varied_sets(parameters, inputs, vary)
    elif not isinstance(parameters, Sequence):
        raise InputError(f"parameters is {parameters!r:.200}: it must be a list, or vary must say what differs")
    if len(parameters) == 0:
        raise InputError("an ensemble needs at least one set of parameters")
    batch = options.get("batch")
    if batch is not None:
        batch = Whole(least=1)(batch, "batch")
    check_jobs(n_jobs)
    mechanism = find_mechanism(parameters[0])
    if any(find_mechanism(p) is not mechanism for p in distinct_objects(parameters)):
        raise InputError("an ensemble's parameters must all be of one mechanism")
    require_list(outputs, "outputs")
    names = mechanism.output_names if outputs is None else tuple(outputs)
    columns = tuple(output_column(name, mechanism.output_names) for name in names)
    all_inputs, starts = _check_runs(mechanism, inputs, initial, len(parameters))
    times = sample_times(stop_time, step, options.get("start_time", 0.0))
    settings = check_settings(times, hold, tolerance, options.get("max_steps", MOST_STEPS))
    where = None if folder is None else Path(folder)
    # what cannot be compiled is reported here, and not by a worker
    encoded = encode(all_inputs[0], mechanism)
    compile_source(encoded)
    if on_device := _check_device(options.get("device"), n_jobs, encoded.has_functions):
        n_jobs, batch = 1, batch or max(16, _SAMPLES_ON_DEVICE // len(settings.times))
    usual = max(min(128, len(parameters) // 4), min(256, len(parameters) // 16))
    # a multiple of 8 fills whole vectors
    batch = batch or max(16, min(usual, _SAMPLES_OF_BATCH // len(settings.times)) // 8 * 8)
    code = "" if where is None else hash_code(mechanism, parameters, chain.from_iterable(encoded.functions))
    tasks = [
        Task(
            mechanism=mechanism,
            settings=settings,
            parameters=parameters[k : k + batch],
            inputs=all_inputs[k : k + batch],
            initial=starts[k : k + batch],
            first=k,
            outputs=None if outputs is None else columns,
            folder=where,
            code=code,
            device=on_device,
        )
        for k in range(0, len(parameters), batch)
    ]
    m = len(parameters)
    empty = Ensemble(
        time=settings.times,
        states=np.empty((m, 0, mechanism.size)),
        forces=np.empty((m, 0, len(mechanism.channels))),
        values=None,
        names=names,
        status=np.full(m, NOT_RUN),
        messages=(),
        counts=np.zeros(m, dtype=np.int64),
        parameters=parameters if isinstance(parameters, VariedSequence) else tuple(parameters),
        modes=np.array(list(encoded.modes.values()), dtype=float),
        energies=np.full(m, np.nan),
    )
    gathered = _Gathering(where, mechanism, outputs is not None, empty)
    return _solve_batches(tasks, gathered, where, n_jobs, options.get("progress", False))


def _solve_batches(
    tasks: Sequence[Task], gathered: _Gathering, folder: Path | None, n_jobs: int | None, progress: bool
) -> Ensemble:
    """Solve the batches of an ensemble in parallel and return it; if that fails, the error has the results so far."""
    m = len(gathered.messages)
    into = gathered.samples if folder is None and share_memory(n_jobs, threads=True) else None
    with record_interrupts() as interrupts, show_progress(progress, float(m)) as show:
        try:
            work = partial(solve, interrupts=interrupts, into=into)
            for _, result in run_in_parallel(work, tasks, interrupts, n_jobs=n_jobs, threads=True):
                if result is not None:
                    gathered.add(result)
                    show(float(gathered.done))
        except WorkersLost as error:
            raise EnsembleBroken(gathered.ensemble(), folder, error) from error
    if interrupts and gathered.done < m:
        raise EnsembleInterrupted(gathered.ensemble(), folder)
    return gathered.ensemble()


class _Gathering:
    """An ensemble whose arrays are allocated once, and filled with the results of batches as these arrive.

    If a folder is given, the arrays are mapped to unnamed files there, so that they take little memory.
    """

    def __init__(self, folder: Path | None, mechanism: Mechanism, chosen: bool, empty: Ensemble) -> None:
        m, n = empty.status.size, len(empty.time)
        sizes = (len(empty.names),) if chosen else (mechanism.size, len(mechanism.channels))
        self.maps: list[mmap.mmap] = []
        #: arrays that the batches fill: states and channels, or the chosen outputs
        self.samples = [self._allocate((m, n, size), folder) for size in sizes]
        self.messages = ["not run: interrupted"] * m
        arrays: dict[str, Any] = dict(zip(("values",) if chosen else ("states", "forces"), self.samples))
        self._empty = replace(empty, **arrays)

    def _allocate(self, shape: tuple[int, ...], folder: Path | None) -> NDArray[np.float64]:
        size = 8 * prod(shape)
        if folder is None or not size:
            return np.empty(shape)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=folder) as file:
                file.truncate(size)
                if hasattr(os, "posix_fallocate"):
                    # a full disk raises an error now, instead of a signal later
                    os.posix_fallocate(file.fileno(), 0, size)
                self.maps.append(mmap.mmap(file.fileno(), size))
        except OSError as error:
            no_room = f"{folder} has no room for {size / 1e6:.3g} MB ({error.strerror}): they are in memory"
            warnings.warn(no_room, RuntimeWarning, stacklevel=3)
            return np.empty(shape)
        return np.frombuffer(self.maps[-1]).reshape(shape)

    def add(self, result: Result) -> None:
        rows, own = slice(result.first, result.first + len(result.status)), self._empty
        for array, samples in zip(self.samples, result.samples):
            array[rows] = samples
        for mapped in self.maps:
            if hasattr(mmap, "MADV_DONTNEED"):
                mapped.madvise(mmap.MADV_DONTNEED)
        own.status[rows], own.counts[rows], own.energies[rows] = result.status, result.counts, result.energies
        self.messages[rows] = result.messages

    @property
    def done(self) -> int:
        """Return the number of runs that are done."""
        return int(np.count_nonzero(self._empty.status != NOT_RUN))

    def ensemble(self) -> Ensemble:
        for array in self.samples:
            array[self._empty.counts == 0] = np.nan
        return replace(self._empty, messages=tuple(self.messages))


def _check_device(device: str | None, n_jobs: int | None, functions: bool) -> str | None:
    """Check that an ensemble can run on the given device; return the device, or None if none is given.

    ``functions`` tells whether inputs are Python functions, which a device cannot evaluate.
    """
    if device is None:
        return None
    if device != "cuda":
        raise InputError(f"device is {device!r}: it must be 'cuda', or left out")
    if n_jobs not in (None, 1):
        raise InputError(f"n_jobs is {n_jobs}: with a device the batches are solved one after the other, leave it out")
    if functions:
        raise InputError(
            "inputs that are Python functions cannot be evaluated on a device: tabulate them, or leave out device"
        )
    return device


def _check_runs(
    mechanism: Mechanism, inputs: Any, initial: Any, count: int
) -> tuple[Sequence[Inputs], list[InitialState]]:
    """Check inputs and initial states, and return lists with those of each run; `simulate_many` says what inputs must share."""
    all_inputs, starts = _one_per_run(inputs, count, "inputs"), _one_per_run(initial, count, "initial states")
    nothing, rest = check_run(mechanism, None, None)
    if not isinstance(all_inputs, VariedSequence):
        all_inputs = [nothing if i is None else i for i in all_inputs]
    read = {
        id(s): rest if s is None else s if isinstance(s, mechanism.initial) else check_run(mechanism, None, s)[1]
        for s in distinct_objects(starts)
    }
    starts = [read[id(s)] for s in starts]
    accepted: set[tuple[str, ...]] = set()
    ways: set[Any] = set()
    for one in distinct_objects(all_inputs):
        names = tuple(one) if isinstance(one, Inputs) else ()
        if not names or names not in accepted:
            check_run(mechanism, one, None)
            accepted.add(names)
            ways.add(tuple(one.modes(mechanism).values()))
    if len(ways) > 1:
        raise InputError("an ensemble's inputs must all drive the mechanism in the same way")
    functions = {
        tuple((name, id(f.function), id(f.rate)) for name in i for f in i.parts(name) if isinstance(f, Function))
        for i in distinct_objects(all_inputs)
    }
    if len(functions) > 1:
        raise InputError("an ensemble's inputs must share their Python functions")
    return all_inputs, starts


def output_column(name: str, names: tuple[str, ...]) -> int:
    """Return the index of an output among ``names``; raise UnknownNameError if it is not there."""
    if name not in names:
        raise unknown_name(name, names, f"output {name!r}")
    return names.index(name)


def _one_per_run(value: Any, count: int, what: str) -> Any:
    if value is None or not isinstance(value, Sequence):
        return [value] * count
    if len(value) != count:
        raise InputError(f"{len(value)} {what} for {count} sets of parameters: give one, or one for each")
    return value if isinstance(value, VariedSequence) else list(value)
