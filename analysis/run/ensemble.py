"""Ensembles: many runs over the same times, in batches of one compiled call each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError

from ..mechanisms import MECHANISMS, InitialState, Parameters, mechanism_of
from ..notebook import format_count
from ..units import Amount, in_si
from .arguments import driven, started, takes_published
from .inputs import Inputs, compiled_source, given
from .prepared import Run, outputs_of
from .simulation import sample_times, settings_of
from .trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """Many runs over the same times.

    Attributes
    ----------
    time : ndarray, shape (n,)
    states : ndarray, shape (m, n, states)
        State of every run, dissipated and supplied work included; NaN after a run that ended early, as ``counts`` tells.
    forces : ndarray, shape (m, n, inputs)
        Channels at the samples, in the order of the FMI inputs.
    status : ndarray of int, shape (m,)
        solver.status of each run; 2 where an input was not finite.
    messages : tuple of str
        Why a run ended early; empty if it did not.
    counts : ndarray of int, shape (m,)
        Samples that each run reached.
    parameters : tuple
        Those of the mechanism, one for each run.
    modes : ndarray
        Values of the mechanism's modes, the same for all.
    energies : ndarray, shape (m,)
        Mechanical energy of each at the start (J).
    """

    time: NDArray[np.float64]
    states: NDArray[np.float64]
    forces: NDArray[np.float64]
    status: NDArray[np.int64]
    messages: tuple[str, ...]
    counts: NDArray[np.int64]
    parameters: tuple[Parameters, ...]
    modes: NDArray[np.float64]
    energies: NDArray[np.float64]

    def __repr__(self) -> str:
        early = int(np.count_nonzero(self.status))
        over = f"{len(self.time)} samples from {self.time[0]:.4g} to {self.time[-1]:.4g} s"
        ended = "all complete" if not early else f"{early} of them ended early, as messages says"
        return f"<Ensemble: {format_count(len(self), 'run')} of {over}, {ended}>"

    def __len__(self) -> int:
        return len(self.parameters)

    def __getitem__(self, index: int) -> Trajectory:
        """One run as a `Trajectory`: its samples, without the last configuration of one that ended early."""
        n = int(self.counts[index])
        mechanism = mechanism_of(self.parameters[index])
        p = np.array([*self.parameters[index].constants(), self.energies[index]])
        values = outputs_of(mechanism, self.modes, p, self.states[index, :n], self.forces[index, :n])
        return Trajectory(
            time=self.time[:n],
            values=values,
            status=int(self.status[index]),
            message=self.messages[index],
            source="compiled DOP853",
            parameters=self.parameters[index],
            names=mechanism.output_names,
        )

    def output(self, name: str) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        """One output of all runs, shape (m, n), masked after the end of a run that ended early."""
        shape = (len(self), len(self.time))
        result = np.ma.MaskedArray(np.full(shape, np.nan), mask=np.ones(shape, dtype=bool))
        for i in range(len(self)):
            run = self[i]
            result[i, : len(run)] = run[name]
        return result


@takes_published(inputs=driven, initial=started)
@in_si(stop_time="s", step="s", start_time="s", hold="s")
def simulate_many(
    parameters: Sequence[Parameters],
    inputs: Inputs | Sequence[Inputs] | None = None,
    *,
    initial: InitialState | Sequence[InitialState] | None = None,
    stop_time: Amount,
    step: Amount = 1e-3,
    start_time: Amount = 0.0,
    hold: Amount = None,
    tolerance: float = 1e-9,
    max_steps: int = 100_000_000,
    batch: int = 64,
    n_jobs: int | None = None,
    progress: bool = False,
) -> Ensemble:
    """Run many mechanisms, or one under many inputs, in batches of one compiled call each.

    ``inputs`` and ``initial`` are one for all or as many as ``parameters``; all inputs must drive the same way and share
    their Python functions, if they have any. The batches go through joblib: ``n_jobs`` cores here, or, inside
    ``joblib.parallel_config(backend="dask")``, the cores of a Dask cluster; or of a Ray cluster, with ``backend="ray"``
    once ``ray.util.joblib.register_ray()`` has been called.

    Raises
    ------
    InputError, ParameterError, AssemblyError
        As `simulate`; the sentence names the run. An input that turns out not to be finite in the course of a run ends
        that run alone.

    Examples
    --------
    >>> from analysis import simulate_many, variant
    >>> springs = [variant("table-3.1", slider_stiffness=f"{k} N/m") for k in (800, 1000, 1200)]
    >>> runs = simulate_many(springs, stop_time="0.2 s")
    >>> runs.output("slider.position").shape
    (3, 201)
    """
    m = len(parameters)
    if m == 0:
        raise InputError("an ensemble needs at least one set of parameters")
    if batch < 1:
        raise InputError(f"batch is {batch}: it must be at least 1")
    mechanism = mechanism_of(parameters[0])
    if any(mechanism_of(p) is not mechanism for p in parameters):
        raise InputError("an ensemble's parameters must all be of one mechanism")
    all_inputs, starts = _each(inputs, m, "inputs"), _each(initial, m, "initial states")
    for i, s in zip(all_inputs, starts):
        given(mechanism, i, s)
    settings = settings_of(sample_times(stop_time, step, start_time), hold, tolerance, max_steps)
    runs: list[Run] = []
    for number, (p, i, s) in enumerate(zip(parameters, all_inputs, starts)):
        try:
            run = Run(p, i, s, settings)
            run.start()
        except LinkworkError as error:
            raise _of_run(number, error) from error
        runs.append(run)
    if len({run.modes for run in runs}) > 1:
        raise InputError("an ensemble's inputs must all drive the mechanism in the same way")
    if len({tuple(map(id, chain.from_iterable(run.encoded.functions))) for run in runs}) > 1:
        raise InputError("an ensemble's inputs must share their Python functions")
    # what cannot be compiled is reported here, and not by a worker
    compiled_source(runs[0].encoded)
    batches = [runs[k : k + batch] for k in range(0, m, batch)]
    import joblib

    results: Iterable[Any] = joblib.Parallel(n_jobs=n_jobs, return_as="generator")(
        joblib.delayed(_run_batch)(b) for b in batches
    )
    if progress:
        from rich.progress import track

        results = track(results, total=len(batches), description="simulate", transient=True)
    states, forces, status, counts, energies, messages = (list(column) for column in zip(*results))
    return Ensemble(
        time=settings.times,
        states=np.concatenate(states),
        forces=np.concatenate(forces),
        status=np.concatenate(status),
        messages=tuple(chain.from_iterable(messages)),
        counts=np.concatenate(counts),
        parameters=tuple(parameters),
        modes=np.array(runs[0].modes),
        energies=np.concatenate(energies),
    )


def _of_run(number: int, error: LinkworkError) -> LinkworkError:
    """The error with the number of its run before the sentence."""
    named = type(error).__new__(type(error))
    named.__dict__.update(error.__dict__)
    named.args = (f"run {number}: {error}",)
    return named


def _each(value: Any, count: int, what: str) -> list[Any]:
    if value is None or not isinstance(value, Sequence):
        return [value] * count
    if len(value) != count:
        raise InputError(f"{len(value)} {what} for {count} sets of parameters: give one, or as many")
    return list(value)


def _run_batch(runs: Sequence[Run]) -> tuple[Any, ...]:
    """One compiled call for a batch of prepared runs."""
    from . import compiled as k

    first, m, n = runs[0], len(runs), len(runs[0].settings.times)
    # a worker does not know a mechanism that the caller has registered
    MECHANISMS.setdefault(first.mechanism.name, first.mechanism)
    mechanism, encoded = first.mechanism, [run.encoded for run in runs]
    starts = [run.start() for run in runs]
    sizes = np.array([(len(e.coefficients), len(e.harmonics)) for e in encoded])
    pieces, waves = sizes.max(axis=0)
    batch = k.Batch(
        p=np.array([(*run.p, start.energy) for run, start in zip(runs, starts)]),
        scales=np.array([start.scale for start in starts]),
        steady=np.array([e.steady for e in encoded]),
        sizes=sizes,
        breaks=np.zeros((m, pieces + 1)),
        coefficients=np.zeros((m, pieces, *encoded[0].coefficients.shape[1:])),
        harmonics=np.zeros((m, waves, 4)),
        laws=np.array([e.law for e in encoded]),
        law_places=np.array([e.law_places for e in encoded]),
    )
    for i, e in enumerate(encoded):
        batch.breaks[i, : len(e.breaks)] = e.breaks
        batch.coefficients[i, : len(e.coefficients)] = e.coefficients
        batch.harmonics[i, : len(e.harmonics)] = e.harmonics
    # kept alive while their addresses are in use
    source, _kept = compiled_source(encoded[0])
    xs = np.array([start.x for start in starts])
    states = np.full((m, n, mechanism.size), np.nan)
    forces = np.full((m, n, len(mechanism.channels)), np.nan)
    carries = np.zeros(m, dtype=k.CARRY)
    carries["begin"] = first.settings.times[0]
    status = np.empty(m, dtype=np.int64)
    k.run_many(
        first.problem(starts[0]), source, batch, carries, xs, first.settings.times, states, forces, status,
        len(mechanism.output_names), first.settings.max_steps,
    )  # fmt: skip
    codes, messages = [], []
    for run, code, x, carry in zip(runs, status.tolist(), xs, carries):
        t = float(carry["begin"] + carry["elapsed"])
        bad = code == k.BAD_INPUT
        final, message = (code, str(run.lost(int(carry["lost"]), t, x))) if bad else run.verdict(code, t, x)
        codes.append(final)
        messages.append(message)
    return states, forces, np.array(codes), carries["sample"].copy(), [start.energy for start in starts], messages
