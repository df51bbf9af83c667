"""Batches of an ensemble: many runs prepared together by array operations, solved by compiled calls, and saved in files."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.limits import LIMIT_SINE
from linkwork.mechanism import Mechanism

from ..files import load_array, save_array
from ..mechanisms import MECHANISMS, InitialState, Parameters
from .cautions import MANY_STEPS, is_too_slow
from .inputs import Encoded, Inputs, align, compile_source, encode
from .prepared import STEPS_PER_CALL, Run, Settings, compute_outputs, make_problem, verdict
from .sampling import NotFiniteError, function_values
from .varied import VariedSequence, array_functions, distinct_objects, varied_constants

#: solver.status of a run that was not begun, or was interrupted.
NOT_RUN = -1
#: solver.status of a run that cannot start, by the kind of error.
_STATUS = {AssemblyError: 3, InputError: 2}
#: Status, besides those of the compiled code, of a run that cannot start.
_NO_START = -2
#: Status of a run that was interrupted.
_PAUSED = -3
#: Status of a stiff run that was given up, see `cautions.is_too_slow`.
_GIVEN_UP = -4


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A batch of runs that are solved together: the parameters, inputs and initial state of each.

    Attributes
    ----------
    first : int
        Index in the ensemble of the first run of the batch.
    outputs : tuple of int or None
        Indices of the outputs to record; None to record states and channels.
    folder : path or None
        Folder in which the result is saved.
    code : str
        Hash of all code that the result depends on.
    device : str or None
        "cuda" to solve the runs on a graphics processor.
    """

    mechanism: Mechanism
    settings: Settings
    parameters: Sequence[Parameters]
    inputs: Sequence[Inputs]
    initial: Sequence[InitialState]
    first: int
    outputs: tuple[int, ...] | None
    folder: Path | None
    code: str
    device: str | None = None

    def run(self, i: int) -> Run:
        """Return run i of the batch as a single `Run`."""
        return Run(self.parameters[i], self.inputs[i], self.initial[i], self.settings)

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        """Return the shapes of the arrays ``ends`` and ``samples`` that `_integrate` fills."""
        m, n, size = len(self.parameters), len(self.settings.times), self.mechanism.size
        samples = (size, len(self.mechanism.channels)) if self.outputs is None else (len(self.outputs),)
        return [(m, 5 + size + len(self.mechanism.channels)), *((m, n, numbers) for numbers in samples)]

    def parts(self, flat: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Split a flat array into views that have the shapes `shapes`."""
        ends = np.cumsum([prod(shape) for shape in self.shapes])
        return [part.reshape(shape) for part, shape in zip(np.split(flat, ends[:-1]), self.shapes)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The results of the runs of a batch, with fields as in `ensemble.Ensemble`.

    ``first`` is the index of the first run in the ensemble. ``samples`` are states and channels, or the chosen outputs; the
    list is empty if the samples were written directly into the arrays of the ensemble.
    """

    first: int
    samples: list[NDArray[np.float64]]
    counts: NDArray[np.int64]
    energies: NDArray[np.float64]
    status: list[int]
    messages: list[str]


class PreparedBatch(NamedTuple):
    """A batch ready for the compiled solver.

    ``x`` are the states at the start. ``failures`` are the errors of the runs that cannot start, by their index in the batch.
    """

    encoded: Encoded
    batch: Any
    x: NDArray[np.float64]
    failures: dict[int, LinkworkError]

    def digest(self, task: Task) -> str:
        """Return a hash of everything on which the result depends."""
        settings, e = task.settings, self.encoded
        numbers = [settings.hold, settings.tolerance, settings.max_steps, task.device, *e.modes.values()]
        digest = hashlib.sha256(
            f"{task.code} {task.mechanism.name} {task.outputs} {numbers} {sorted(self.failures)}".encode()
        )
        for array in (*self.batch, self.x, settings.times, e.source.places, e.commands):
            digest.update(f"{array.shape}".encode() + array.tobytes())
        return digest.hexdigest()[:32]


def solve(task: Task, interrupts: Sequence[bool], into: Sequence[NDArray[np.float64]] | None = None) -> Result | None:
    """Solve a batch, or read its result from its file; return None if the ensemble was already interrupted.

    ``interrupts`` is checked between compiled calls: if it is not empty, the runs are interrupted. ``into`` are the sample
    arrays of the whole ensemble. The samples are written into them directly if this process has these arrays and the task
    has no folder.
    """
    if interrupts:
        return None
    # a worker does not know a mechanism that the caller has registered
    MECHANISMS.setdefault(task.mechanism.name, task.mechanism)
    prepared = prepare(task)
    samples: list[NDArray[np.float64]] = []
    if into is None:
        ends, *samples = task.parts(_load_or_solve(task, prepared, interrupts))
    else:
        ends, rows = np.empty(task.shapes[0]), slice(task.first, task.first + len(prepared.x))
        _integrate(task, prepared, interrupts, ends, [array[rows] for array in into])
    status, messages = _verdicts(task, prepared, ends)
    return Result(
        first=task.first,
        samples=samples,
        counts=ends[:, 1].astype(np.int64),
        energies=prepared.batch.p[:, -1],
        status=status,
        messages=messages,
    )


def _load_or_solve(task: Task, prepared: PreparedBatch, interrupts: Sequence[bool]) -> NDArray[np.float64]:
    """Return the arrays of `Task.shapes` as one flat array, read from the batch's file or computed and saved there."""
    path = None if task.folder is None else task.folder / f"{prepared.digest(task)}.runs"
    kept = None if path is None else load_array(path)
    if kept is None or kept.shape != (sum(map(prod, task.shapes)),):
        kept = np.empty(sum(map(prod, task.shapes)))
        ends, *samples = task.parts(kept)
        whole = _integrate(task, prepared, interrupts, ends, samples)
        if path is not None and whole:
            try:
                save_array(path, kept)
            except OSError as error:
                warnings.warn(
                    f"{path} cannot be written ({error}): its runs are only in memory", RuntimeWarning, stacklevel=3
                )
    return kept


def _verdicts(task: Task, prepared: PreparedBatch, ends: NDArray[np.float64]) -> tuple[list[int], list[str]]:
    """Return solver.status and solver.message of each run."""
    from . import records as k

    status, messages, size = [k.FINISHED] * len(ends), [""] * len(ends), task.mechanism.size
    for i in np.flatnonzero((ends[:, 0] != k.FINISHED) | (ends[:, 4] >= MANY_STEPS)).tolist():
        (code, samples, lost), t, x = ends[i, [0, 1, 3]].astype(int).tolist(), float(ends[i, 2]), ends[i, 5 : 5 + size]
        run = cache(partial(task.run, i))
        if i in prepared.failures:
            error = prepared.failures[i]
            status[i] = next(code for kind, code in _STATUS.items() if isinstance(error, kind))
            messages[i] = str(error)
        elif code == _PAUSED:
            status[i], messages[i] = NOT_RUN, f"interrupted at t = {t:.6g} s" if samples else "not run: interrupted"
        elif code == k.BAD_INPUT:
            status[i], messages[i] = code, str(NotFiniteError(run().encoded, lost, t, x))
        else:
            switched = task.mechanism.is_switched_on(prepared.batch.p[i])
            limit = run().limit if switched else None
            steps, passed, needed = float(ends[i, 4]), t - float(task.settings.times[0]), 0.0
            if code == _GIVEN_UP:
                code, needed = k.RUNNING, steps * float(np.ptp(task.settings.times)) / passed
            status[i], message = verdict(task.mechanism, task.settings, code, t, x, limit, needed)
            if code == k.NO_STEP:
                message += f": {run().describe_failed_step(x)}"
            stiff = run().stiffness_caution(x, ends[i, 5 + size :], steps, passed) if steps >= MANY_STEPS else ""
            messages[i] = "; ".join(filter(None, (message, stiff)))
    return status, messages


def _integrate(
    task: Task,
    prepared: PreparedBatch,
    interrupts: Sequence[bool],
    ends: NDArray[np.float64],
    samples: Sequence[NDArray[np.float64]],
) -> bool:
    """Solve the runs of a batch; return False if they were interrupted.

    Row i of ``ends`` receives for run i: the status of the compiled code, the number of samples reached, the time of the end
    (s), the index of a channel that was not finite, the number of steps, and the state and the channels at the end.
    ``samples`` receive states and channels, or the chosen outputs, at the sample times; NaN after the end of a run.
    """
    from ..numerics.vectors import LANES
    from . import compiled, lanes
    from . import records as k
    from .equations import machine

    mechanism, settings, encoded, batch = task.mechanism, task.settings, prepared.encoded, prepared.batch
    m, n = prepared.x.shape[0], len(settings.times)
    states, forces = (
        samples
        if task.outputs is None
        else (np.empty((m, n, mechanism.size)), np.empty((m, n, len(mechanism.channels))))
    )
    # kept alive while their addresses are in use
    source, _kept = compile_source(encoded)
    switched = _is_switched_on(mechanism, batch.p)
    problem = make_problem(encoded, settings, switched)
    state = k.State(np.zeros(m, dtype=k.CARRY), prepared.x.copy(), np.zeros((m, len(mechanism.channels))))
    carries = state.carries
    carries["begin"] = settings.times[0]
    status = np.full(m, k.RUNNING)
    status[list(prepared.failures)] = _NO_START
    own, recorded = batch._replace(laws=batch.laws.copy()), k.Samples(settings.times, states, forces)
    watch = k.watch_nothing(mechanism.size)
    todo, steps, span = status == k.RUNNING, carries["steps"], np.ptp(settings.times)
    code = machine(mechanism, switched, LANES).addresses
    runs = problem, source, own, watch, state, recorded, status, settings.max_steps
    there = None
    if task.device is not None and todo.any():
        from . import on_device

        there = on_device.DeviceBatch(on_device.solver(mechanism, switched), *runs)
    while todo.any() and not interrupts:
        if there is not None:
            there.advance()
        elif LANES > 1:
            lanes.run_in_lanes(code, *runs, STEPS_PER_CALL)
        else:
            compiled.run(*runs, STEPS_PER_CALL)
        todo = (status == k.RUNNING) & (steps < settings.max_steps)
        passed = carries["begin"] + carries["elapsed"] - settings.times[0]
        for i in np.flatnonzero(todo & is_too_slow(steps, passed, span, settings.max_steps)).tolist():
            if task.run(i).stiffness_caution(state.x[i], state.u[i], float(steps[i]), float(passed[i])):
                status[i], todo[i] = _GIVEN_UP, False
    if there is not None:
        there.fetch_samples()
    status[todo] = _PAUSED
    counts = carries["sample"]
    if task.outputs is not None:
        for i, count in enumerate(counts.tolist()):
            rows = (states[i, :count], forces[i, :count])
            samples[0][i, :count] = compute_outputs(mechanism, problem.modes, batch.p[i], *rows, task.outputs)
    for i in np.flatnonzero(counts < n).tolist():
        for part in samples:
            part[i, counts[i] :] = np.nan
    ended = carries["begin"] + carries["elapsed"]
    ends[:, :5] = np.column_stack([status, counts, ended, carries["lost"], steps])
    ends[:, 5:] = np.column_stack([state.x, state.u])
    return not todo.any()


# Start of a run


def prepare(task: Task) -> PreparedBatch:
    """Prepare the runs of a batch with array operations; the results equal those of `Run` and `Run.start` to the last bit.

    Runs near the limit of assembly or with a number that is not finite are prepared by `Run.start`, whose error says why a run
    cannot start.
    """
    from . import compiled

    mechanism, t = task.mechanism, float(task.settings.times[0])
    encoded, batch = _encode_inputs(task)
    x = np.array(_map_distinct(mechanism.state, task.initial))
    # constants, and the energy at the start as last column
    p = np.full((len(x), len(mechanism.constants._fields) + 1), np.nan)
    u = np.zeros((len(x), len(mechanism.channels)))
    # users' functions are called as Python functions, as in `sample`
    source = compile_source(replace(encoded, functions=((None, None),) * len(encoded.functions)))[0]
    compiled.channels_of_many(t, source, batch, x, u)
    doubtful: set[int] = set()
    if encoded.has_functions:
        for i in range(len(x)):
            try:
                u[i] += function_values(encoded, t, x[i])
            except InputError:
                doubtful.add(i)
    x[:, encoded.commands[:, 1]] = u[:, encoded.commands[:, 0]]
    scales = np.zeros_like(x)
    functions, equations = array_functions(mechanism)[0], mechanism.equations
    try:
        with np.errstate(all="ignore"):
            parameters, columns = varied_constants(mechanism, task.parameters)
            for n, column in enumerate(columns):
                p[:, n] = column
            if mechanism.switch:
                columns = columns._replace(**{mechanism.switch: float(_is_switched_on(mechanism, p))})
            applied = functions.find(equations.apply_inputs)(
                tuple(map(float, encoded.modes.values())), tuple(u.T), columns
            )
            state = functions.find(equations.start)(tuple(x.T), applied, columns)
            clearance = np.broadcast_to(functions.find(equations.clearance)(state, applied, columns), len(x))
            p[:, -1] = functions.find(equations.energy)(state, columns)
            for n, (column, scale) in enumerate(zip(state, functions.find(mechanism.error_scale)(parameters, state))):
                x[:, n], scales[:, n] = column, scale
        # near the limit of assembly the mechanism itself writes the error message
        sound = np.isfinite(np.column_stack([u, x, scales, p[:, -1]])).all(axis=1) & (clearance > 2 * LIMIT_SINE)
        doubtful |= set(np.flatnonzero(~sound).tolist())
    except (ArithmeticError, ValueError):
        # raised by a function of `math`: prepare each run by itself to find the runs that cause the error
        doubtful = set(range(len(x)))
    failures: dict[int, LinkworkError] = {}
    for i in sorted(doubtful):
        run = task.run(i)
        p[i, :-1] = run.p
        try:
            start = run.start()
        except (AssemblyError, InputError) as error:
            failures[i] = error
            x[i], p[i, -1], scales[i] = 0.0, np.nan, 0.0
        else:
            x[i], p[i, -1], scales[i] = start.x, start.energy, start.scale
    return PreparedBatch(encoded, batch._replace(p=p, scales=scales), x, failures)


def hash_code(mechanism: Mechanism, parameters: Sequence[Parameters], functions: Iterable[Any]) -> str:
    """Return hashes of the code on which results depend: equations, solver, users' functions."""
    from ..numerics.codegen import fingerprint
    from ..numerics.vectors import LANES
    from . import compiled, lanes, on_device
    from .equations import machine

    kernels = (
        compiled.run, lanes.run_in_lanes, compiled.channels_of_many, compiled.rows, on_device.run_thread, on_device.DeviceBatch,
    )  # fmt: skip
    switch, constants = mechanism.switch, varied_constants(mechanism, parameters)[1]
    switched = bool(switch) and bool(np.any(getattr(constants, switch)))
    ours = (machine(mechanism, switched, n).fingerprint for n in sorted({1, LANES}))
    compiled_code = (fingerprint(f) if f else "" for f in (*kernels, *functions))
    return " ".join([*ours, str(mechanism.reach), Path(__file__).read_text(encoding="utf-8"), *compiled_code])


def _is_switched_on(mechanism: Mechanism, p: NDArray[np.float64]) -> bool:
    """Return whether the mechanism's switch (a constant, `Mechanism.switch`) is on in any row of the constants p."""
    return mechanism.switch_index >= 0 and bool(p[:, mechanism.switch_index].any())


def _map_distinct(make: Callable[[Any], Any], items: Sequence[Any]) -> list[Any]:
    """Return ``make(item)`` for each item; if an object occurs several times, ``make`` is called for it only once."""
    made = {key: make(item) for key, item in {id(item): item for item in items}.items()}
    return [made[id(item)] for item in items]


def _encode_inputs(task: Task) -> tuple[Encoded, Any]:
    """Return the encoded inputs of the first run, and those of all runs as a `compiled.Batch` without constants and scales."""
    from . import compiled

    times, mechanism = task.settings.times, task.mechanism
    signals = [channel.argument for channel in mechanism.channels if channel.kind != "rate"]
    moved: dict[bytes, NDArray[np.float64]] = {}

    def encode_one(inputs: Inputs) -> Encoded:
        encoded = encode(inputs, mechanism)
        key = encoded.source.breaks.tobytes()
        if key not in moved:
            moved[key] = align(encoded, times).source.breaks
        return replace(encoded, source=encoded.source._replace(breaks=moved[key]))

    kinds: list[Encoded] = []
    constant = -1

    def encode_kind(inputs: Inputs) -> tuple[int, list[float] | None]:
        """Return the index of inputs in ``kinds``, the same for all constant inputs, and their values if they are constant."""
        nonlocal constant
        values = inputs.constants(signals)
        if values is None or constant < 0:
            kinds.append(encode_one(inputs))
        if values is None:
            return len(kinds) - 1, None
        constant = len(kinds) - 1 if constant < 0 else constant
        return constant, values

    varied = task.inputs.columns if isinstance(task.inputs, VariedSequence) else {}
    found = _map_distinct(encode_kind, distinct_objects(task.inputs) * len(task.inputs) if varied else task.inputs)
    which = np.array([kind for kind, _ in found])
    sources = [e.source for e in kinds]
    sizes = np.array([(len(e.coefficients), len(e.harmonics)) for e in sources])
    pieces, waves = sizes.max(axis=0)
    breaks = np.zeros((len(kinds), pieces + 1))
    coefficients = np.zeros((len(kinds), pieces, len(signals), 4))
    harmonics = np.zeros((len(kinds), waves, 4))
    for n, e in enumerate(sources):
        breaks[n, : len(e.breaks)] = e.breaks
        coefficients[n, : len(e.coefficients)] = e.coefficients
        harmonics[n, : len(e.harmonics)] = e.harmonics
    coefficients = coefficients[which]
    if constant >= 0:
        coefficients[which == constant, 0, :, 0] = [values for _, values in found if values is not None]
    for name, column in varied.items():
        coefficients[:, :, signals.index(name), 0] = column[:, None]
    return kinds[which[0]], compiled.Batch(
        p=np.empty((0, 0)),
        scales=np.empty((0, 0)),
        steady=np.array([e.steady for e in kinds])[which],
        sizes=sizes[which],
        breaks=breaks[which],
        coefficients=coefficients,
        harmonics=harmonics[which],
        laws=np.array([e.laws for e in sources])[which],
    )
