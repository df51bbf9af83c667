"""Run an FMU through FMPy with the inputs of `simulate`, and compare two runs."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..files import unknown_name
from ..mechanisms import InitialState, Parameters, output_units, residual_outputs, wrapping_outputs
from ..numerics.workers import record_interrupts
from ..units import Amount, in_si
from .angles import coordinate_outputs
from .arguments import complete_initial_state, complete_inputs, require_kind, takes_published, usual_times
from .case_files import Case
from .cautions import output_cautions
from .events import RunInterrupted, show_progress
from .fmu import CosimulationError, FmuModel, FmuRun
from .inputs import Inputs
from .prepared import Run, Settings
from .sampling import name_channels, release, sample
from .simulation import sample_times
from .trajectory import Trajectory

#: Ways of running an FMU: co-simulation with inputs held over each step, co-simulation with inputs that change linearly over
#: each step, model exchange with CVode.
INTERFACES = ("co-simulation", "linear-co-simulation", "model-exchange")


@takes_published(inputs=complete_inputs, initial=complete_initial_state)
@in_si(stop_time="s", step="s", start_time="s")
def cosimulate(
    fmu: str | Path,
    parameters: Parameters,
    inputs: Inputs | None = None,
    *,
    initial: InitialState | None = None,
    stop_time: Amount = None,
    step: Amount = None,
    start_time: Amount = 0.0,
    tolerance: float = 1e-9,
    interface: str = "co-simulation",
    progress: bool = False,
) -> Trajectory:
    """Run an FMU of Linkwork, of any kind, with FMPy.

    Parameters
    ----------
    fmu : path
    parameters, inputs, initial, stop_time, start_time, tolerance, progress
        As for `simulate`.
    step : float or str, optional
        Communication step; the outputs at every communication point are recorded.
    interface : str
        ``co-simulation``: the inputs are sampled at each communication point and held over the step, commanded speeds change
        linearly; ``simulate(..., hold=step)`` does the same in process. ``linear-co-simulation``: the inputs change linearly
        over a step to their values at its end, which are predicted if they depend on the motion; commanded speeds change along
        a parabola. ``model-exchange``: FMPy's CVode integrates the FMU's derivatives, and the inputs act continuously, as in
        process without ``hold``. The Python FMU has only co-simulation; native FMUs have all three interfaces in FMI 2.0, and
        all but the linear one in FMI 3.0.

    Returns
    -------
    Trajectory
        If the FMU refuses a step, the run ends with the FMU's solver.status and solver.message and all data up to that time.

    Raises
    ------
    CosimulationError
        If the FMU cannot be loaded, has no such interface, or refuses to initialise.
    InputError
        If the times are not usable, or an input is not a finite number; the message names the input and the time.

    Examples
    --------
    With an FMU of ``python build_fmu.py``:

    >>> from analysis import compare, cosimulate, simulate
    >>> run = cosimulate("build/FiveBarSlider.fmu", "table-3.1", stop_time="0.1 s", step="1 ms")
    >>> compare(simulate("table-3.1", stop_time="0.1 s", step="1 ms", hold="1 ms"), run).agrees
    True
    """
    if interface not in INTERFACES:
        raise unknown_name(interface, INTERFACES, f"interface {interface!r}")
    begun = clock.perf_counter()
    stop_time, step = usual_times(parameters, inputs, stop_time, step)
    times = sample_times(stop_time, step, start_time)
    # the FMU itself checks the tolerance
    prepared = Run(parameters, inputs, initial, Settings(times=times, hold=step, tolerance=tolerance, max_steps=1))
    march = (
        _Continuous(prepared) if interface == "model-exchange" else _Stepwise(prepared, interface != "co-simulation")
    )
    recorded: list[tuple[float, list[float]]] = []
    instance = march.instance(
        fmu,
        parameters,
        prepared.initial,
        modes=prepared.encoded.modes,
        tolerance=tolerance,
        start_time=float(times[0]),
        inputs=march.first(),
    )
    with (
        instance,
        record_interrupts() as interrupted,
        show_progress(progress, times[-1] - times[0], "running the FMU") as show,
    ):
        for t, row in march.rows(instance):
            recorded.append((t, row))
            show(t - float(times[0]))
            if interrupted:
                break
    time, values = np.array([t for t, _ in recorded]), np.array([row for _, row in recorded])
    trajectory = Trajectory(
        time=time,
        values=values,
        status=march.status,
        message="; ".join(filter(None, (march.message, output_cautions(prepared.mechanism, time, values, None)))),
        names=prepared.mechanism.output_names,
        source=Path(fmu).name + march.title,
        parameters=prepared.parameters,
        statistics={"steps": float(len(recorded) - 1), "seconds": clock.perf_counter() - begun},
    )
    if interrupted:
        raise RunInterrupted(trajectory)
    return trajectory


def input_sampler(case: Case, steps: int) -> Callable[[int, Sequence[float] | None], dict[str, float]]:
    """Return a function that samples the inputs of a case, over ``case.stop_time`` in equal steps, for co-simulation.

    The function takes the index of a step and the outputs at its start, None at the start of the run; it must be called for
    the steps in order, and returns the inputs by name.
    """
    times = np.linspace(0.0, case.stop_time, steps + 1)
    settings = Settings(times=times, hold=float(times[1]), tolerance=case.tolerance, max_steps=1)
    march = _Stepwise(Run(case.parameters, case.inputs, case.initial, settings), False)

    def inputs(number: int, outputs: Sequence[float] | None) -> dict[str, float]:
        return march.inputs(number, march.start if outputs is None else march.state(list(outputs)))

    return inputs


class _Stepwise:
    """Co-simulation in communication steps over which inputs are held or linear."""

    instance = FmuRun

    def __init__(self, prepared: Run, linear: bool) -> None:
        self.encoded, self.linear, self.times = prepared.encoded, linear, prepared.settings.times
        self.title = ", linear inputs" if linear else ""
        self.mechanism = prepared.mechanism
        self.start = np.array(self.mechanism.state(prepared.initial))
        self.laws = self.encoded.source.laws.copy()
        self.status, self.message = 0, ""
        names = self.mechanism.output_names
        rate_of = {v.rate_of: v.name for v in self.mechanism.variables if v.rate_of}
        freedoms = self.mechanism.freedoms
        self.coordinates = coordinate_outputs(self.mechanism)
        self.rates = [names.index(f.rate) for f in freedoms]
        self.accelerations = [names.index(rate_of[f.rate]) for f in freedoms]

    def first(self) -> dict[str, float]:
        """Return the inputs at the start."""
        return self.inputs(0, self.start)

    def inputs(self, number: int, x: NDArray[np.float64]) -> dict[str, float]:
        """Return the inputs for the step that begins at the communication point ``number`` (an index) with the state x."""
        times, t = self.times, float(self.times[number])
        if self.linear:
            release(self.encoded, x, self.laws)
            ahead = -np.inf
        else:
            ahead = float(times[number + 1] if number + 1 < len(times) else t + times[1] - times[0])
        return name_channels(self.encoded, sample(self.encoded, t, x, self.laws, ahead=ahead))

    def slopes(self, number: int, row: list[float]) -> dict[str, float]:
        """Return the slopes of the inputs over the next step.

        The outputs ``row`` at the beginning of the step are used to predict the state at its end.
        """
        t, ahead = float(self.times[number]), float(self.times[number + 1])
        h, x = ahead - t, self.state(row)
        n, laws = len(self.rates), self.laws.copy()
        acceleration = np.array([row[i] for i in self.accelerations])
        there = x.copy()
        there[:n] += h * (x[n : 2 * n] + 0.5 * h * acceleration)
        there[n : 2 * n] += h * acceleration
        release(self.encoded, there, laws)
        change = sample(self.encoded, ahead, there, laws, left=True) - sample(self.encoded, t, x, self.laws)
        change[self.encoded.commands[:, 0]] = 0.0
        return name_channels(self.encoded, change / h)

    def state(self, row: list[float]) -> NDArray[np.float64]:
        """Return the state from a row of outputs; dissipated and supplied work are set to zero."""
        return np.array([*(row[n] for n in self.coordinates), *(row[n] for n in self.rates), 0.0, 0.0])

    def rows(self, run: Any) -> Iterator[tuple[float, list[float]]]:
        """Run the FMU; yield time and outputs at each communication point, until the end or a step that the FMU refuses."""
        if self.linear and not run.interpolates:
            raise CosimulationError(
                f"{run.name} does not take inputs that are linear over a step: it can only hold them"
            )
        row = run.outputs()
        yield float(self.times[0]), row
        for number, (t, t_next) in enumerate(pairwise(self.times)):
            if self.linear:
                run.set_slopes(self.slopes(number, row))
            self.status, self.message = run.step(float(t), float(t_next - t))
            if self.status:
                return
            # recorded outputs belong to the inputs that begin here: read the state, sample and set the inputs, read again
            run.set_inputs(self.inputs(number + 1, self.state(run.outputs())))
            row = run.outputs()
            yield float(t_next), row


class _Continuous:
    """Model exchange with inputs that act continuously."""

    instance = FmuModel
    title = ", model exchange"

    def __init__(self, prepared: Run) -> None:
        self.prepared = prepared
        self.status, self.message = 0, ""

    def first(self) -> dict[str, float]:
        """Return the inputs at the start."""
        prepared = self.prepared
        x, laws = np.array(prepared.mechanism.state(prepared.initial)), prepared.encoded.source.laws.copy()
        release(prepared.encoded, x, laws)
        return name_channels(prepared.encoded, sample(prepared.encoded, float(prepared.settings.times[0]), x, laws))

    def rows(self, model: Any) -> Iterator[tuple[float, list[float]]]:
        """Run the FMU; yield time and outputs at each sample, and at the limit of assembly if the run ends there."""
        from .exchange import Exchange, ExchangeError

        times = self.prepared.settings.times
        solver = Exchange(model, self.prepared.encoded, times, self.prepared.settings.tolerance)
        yield solver.time, model.outputs()
        for goal in times[1:].tolist():
            while solver.time < goal:
                try:
                    ended = solver.advance(goal)
                except ExchangeError as error:
                    self.status = 4
                    self.message = f"{error}, in the step from t = {solver.time:.9g} s"
                    return
                if ended:
                    where = self.prepared.mechanism.describe_state(solver.state.tolist())
                    limit = self.prepared.limit(np.asarray(solver.state))
                    self.status, self.message = 3, f"{limit} at t = {solver.time:.9g} s, {where}"
                    break
            yield solver.time, model.outputs()
            if self.status:
                return


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputDifference:
    """Difference of one output between two runs.

    ``largest`` and ``rms`` (root mean square) are in the output's unit; ``scale`` is the scale of the output, see `compare`.
    """

    name: str
    unit: str
    largest: float
    rms: float
    scale: float

    @property
    def relative(self) -> float:
        """Return the largest difference divided by the scale; zero if there is no difference."""
        return 0.0 if self.largest == 0.0 else self.largest / self.scale


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Differences of all outputs between two runs."""

    differences: tuple[OutputDifference, ...]
    tolerance: float

    @property
    def worst(self) -> OutputDifference:
        """Return the output with the largest relative difference."""
        return max(self.differences, key=lambda d: d.relative)

    @property
    def agrees(self) -> bool:
        """Return whether the relative difference of every output is within the tolerance."""
        return self.worst.relative <= self.tolerance

    def __repr__(self) -> str:
        worst, word = self.worst, "agree" if self.agrees else "differ"
        return (
            f"<Comparison: the runs {word} at a tolerance of {self.tolerance:g}; the largest relative difference is "
            f"{worst.relative:.2g}, of {worst.name}>"
        )

    def __getitem__(self, name: str) -> OutputDifference:
        for difference in self.differences:
            if difference.name == name:
                return difference
        raise unknown_name(name, [difference.name for difference in self.differences], f"output {name!r}")


def compare(a: Trajectory, b: Trajectory, *, tolerance: float = 1e-6) -> Comparison:
    """Compare two runs output by output.

    Differences are relative to the scale of an output: its largest magnitude in ``a``, but at least 1 rad for an angle, and
    for other outputs a thousandth of the magnitude usual for their unit. For lengths, forces and energies this is the largest
    in the run; for velocities, accelerations and torques it is a product of the largest length, the crank speed and the
    largest force. Small outputs (a force at one pin, the displacement of a stiff slider) may therefore have fewer equal
    digits. The scale of a residual is at least the size of its terms.

    If both runs ended early with the same status after the same sample, only the samples that both have are compared: a run in
    process also has its last configuration, whereas a run of an FMU ends at the last communication point.

    Raises
    ------
    InputError
        If ``a`` or ``b`` is not a run, or the times or the outputs of the runs differ.

    Examples
    --------
    >>> from analysis import compare, simulate
    >>> one, other = simulate("table-3.1"), simulate("table-3.1", method="DOP853")
    >>> compare(one, other).agrees
    True
    """
    for name, run in (("a", a), ("b", b)):
        require_kind(run, Trajectory, name, "a run, such as simulate('table-3.1')")
    if a.names != b.names:
        raise InputError("the runs cannot be compared: their outputs differ, because they are of different mechanisms")
    n = int(np.count_nonzero(np.isin(a.time, b.time)))
    if a.status == b.status != 0 and max(len(a), len(b)) <= n + 1:
        a, b = replace(a, time=a.time[:n], values=a.values[:n]), replace(b, time=b.time[:n], values=b.values[:n])
    if len(a) == 0 or len(a) != len(b) or not np.allclose(a.time, b.time, rtol=1e-12, atol=1e-15):
        ends = [f"{len(run)} samples" + (f" to t = {run.time[-1]:.9g} s" if len(run) else "") for run in (a, b)]
        raise InputError(f"the runs cannot be compared: {ends[0]}, and {ends[1]}")
    units, wrapped = output_units(), wrapping_outputs()
    largest = {name: float(np.max(np.abs(np.nan_to_num(a[name])), initial=0.0)) for name in a.names}
    scales = output_scales(largest, units)
    differences = []
    for name in a.names:
        with np.errstate(invalid="ignore"):
            difference = np.abs(a[name] - b[name])
            if name in wrapped:
                difference = np.abs(np.remainder(difference + pi, 2.0 * pi) - pi)
        # NaN differs from everything
        difference[np.isnan(difference)] = np.inf
        worst, rms = float(difference.max()), float(np.sqrt(np.mean(difference**2)))
        differences.append(OutputDifference(name=name, unit=units[name], largest=worst, rms=rms, scale=scales[name]))
    return Comparison(differences=tuple(differences), tolerance=tolerance)


def output_scales(largest: Mapping[str, float], units: Mapping[str, str]) -> dict[str, float]:
    """Return the scale of each output, as `compare` describes it, from the largest magnitude of each output."""
    residuals = residual_outputs()

    def like(unit: str) -> float:
        return max((size for n, size in largest.items() if units[n] == unit and n not in residuals), default=0.0)

    lengths, speed = like("m"), next((size for n, size in largest.items() if units[n] == "rad/s"), 0.0)
    floors = {
        "m": lengths,
        "m/s": lengths * speed,
        "m/s2": lengths * speed**2,
        "rad/s": speed,
        "rad/s2": speed**2,
        "N": like("N"),
        "N.m": like("N") * lengths,
        "J": like("J"),
    }
    # the size of a residual's terms; without energies among the outputs, a torque is of the same dimension
    terms = {"m": lengths, "J": like("J") or like("N.m") or 1.0}

    def floor(name: str, unit: str) -> float:
        if name in residuals and unit in terms:
            return terms[unit]
        return 1.0 if unit == "rad" else 1e-3 * floors.get(unit, 0.0)

    return {name: max(size, floor(name, units[name]), np.finfo(float).tiny) for name, size in largest.items()}
