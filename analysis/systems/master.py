"""Co-simulate the parts of a system, with equal communication steps or with steps that a power error controls.

Over a communication step the inputs are constant or linear in time: see `COUPLINGS`. If two parts exchange power, the work
that the coupling adds over a step is known at its end (S. Sadjina, L. T. Kyllingstad, S. Skjong and E. Pedersen, Energy
conservation and power bonds in co-simulations, Engineering with Computers 33, 2017). This work measures the error of a run. It
gives the step that is needed for a wanted error, and it can control the step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, inf
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from linkwork.errors import InputError

from ..files import unknown_name
from ..numerics.workers import record_interrupts
from ..run import CosimulationError, RunInterrupted, require_kind, show_progress, unwrap
from ..units import Amount, in_si
from .instances import Floats, make_instance
from .wiring import Bond, End, Wiring

#: The inputs over a communication step, by coupling.
COUPLINGS = {
    "hold": "constant: the outputs at the start of the step",
    "derivatives": "linear, with the outputs' slopes at the start; FMI 3.0: constant, the linear value in the middle",
    "updates": "linear, as before; an FMI 3.0 part receives the value at each step of its own integrator",
    "rollback": "linear between the outputs at start and end, so that each step is taken twice",
}
#: Controller of the communication step: proportional and integral gain; least and greatest growth of a step; least and greatest
#: step relative to the first one (Sadjina et al., section 5).
_GAINS, _GROWTH, _STEPS = (0.2, 0.15), (0.2, 1.5), (1e-3, 1e2)
#: Residuals are compared with the transmitted power, or with its last greater value, which decays by this factor in each step:
#: at an instant without power the value of up to some fifty steps ago counts.
_MEMORY = 0.98
#: Largest number of rounds in which the values of algebraic loops may settle at the start.
_ROUNDS = 100


@dataclass(frozen=True, kw_only=True)
class SystemRun:
    """Result of a run of a system.

    Attributes
    ----------
    time : (N,) float array
        Communication points (s).
    values : mapping of str to (N,) float array
        Values of every real output, by the name ``part.output``.
    powers : mapping of str to (N,) float array
        Power residual of each power bond, named by its effort: the power that the coupling adds at the end of the step, because
        each part knew the other only from the start of the step (W).
    flows : mapping of str to (N,) float array
        Power transmitted by each bond (W).
    status : int
        0, or 3 if a part refused a step: the data end before it.
    message : str
        Message of that part.
    notes : tuple of str
        Hints at possible mistakes.
    title, coupling : str
    units : mapping of str to str
        Units of the outputs.
    connected : tuple of str
        Outputs that are connected to another part's input.
    """

    time: NDArray[Any]
    values: Mapping[str, Floats]
    powers: Mapping[str, Floats] = field(default_factory=dict)
    flows: Mapping[str, Floats] = field(default_factory=dict)
    status: int = 0
    message: str = ""
    notes: tuple[str, ...] = ()
    title: str = ""
    coupling: str = "hold"
    units: Mapping[str, str] = field(default_factory=dict)
    connected: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Floats:
        if name not in self.values:
            raise unknown_name(name, self.values, f"output {name!r}")
        return self.values[name]

    def __len__(self) -> int:
        return len(self.time)

    def unwrapped(self, name: str) -> Floats:
        """Return an output without leaps by a full turn, if it is an angle of a link; see `Trajectory.unwrapped`."""
        return unwrap(name.partition(".")[2], self[name])

    def added_work(self) -> float:
        """Return the work that the coupling added, as a fraction of the work that all bonds transmitted; 0 without bonds.

        Over a step a power residual grows from 0, so that the mean residual is half of the residual at the end.
        """
        steps = np.diff(self.time)
        through = sum(float(steps @ np.abs(flow[1:])) for flow in self.flows.values())
        brought = 0.5 * sum(float(steps @ np.abs(power[1:])) for power in self.powers.values())
        return brought / through if through > 0.0 else 0.0

    def suggested_step(self, share: float) -> float | None:
        """Return the communication step (s) with which the coupling would add a given share of the transmitted work.

        The step is valid if the steps of the run are equal, and so small that a residual is proportional to the step, or to the
        square of the step if the inputs are linear in time. The result is None if the coupling added no work, as without power
        bonds, and for couplings whose error the residuals do not measure.
        """
        brought = self.added_work()
        orders = {"hold": 1.0, "derivatives": 2.0}
        if self.coupling not in orders or brought == 0.0:
            return None
        return float(self.time[1] * (share / brought) ** (1.0 / orders[self.coupling]))


class _Instances:
    """All instances of a system, with their inputs and outputs at the current communication point."""

    def __init__(self, wiring: Wiring, bonds: Sequence[Bond]) -> None:
        self.wiring = wiring
        self.instances: dict[str, Any] = {}
        try:
            for name, part in wiring.parts.items():
                self.instances[name] = make_instance(part)
            self.ends = [End(name, output) for name, each in self.instances.items() for output in each.outputs]
            index = {end: number for number, end in enumerate(self.ends)}
            self.targets = targets = {target: number for number, target in enumerate(wiring.connections)}
            #: For each connected input the index of the output to which it is connected; for each part the names and indices of
            #: its connected inputs.
            self.sources = np.array([index[source] for source in wiring.connections.values()], dtype=int)
            self.own = {
                name: ([target.port for target in self.targets if target.part == name],
                       np.array([n for target, n in self.targets.items() if target.part == name], dtype=int))
                for name in self.instances
            }  # fmt: skip
            #: Parts whose outputs change only at discrete instants.
            self.sampled = {
                name
                for name, part in wiring.parts.items()
                if all(part.ports[output].held for output in part.real_variables("output"))
            }
            for instance in self.instances.values():
                instance.start_initialisation()
            self._settle()
            for instance in self.instances.values():
                instance.finish_initialisation()
        except BaseException as error:
            said = [text for instance in self.instances.values() for text in instance.messages]
            self.close()
            if isinstance(error, FMICallException):
                raise CosimulationError("; ".join(said) or f"{wiring.title}: {error}") from error
            raise
        rates = {
            End(name, port.rate_of): index[End(name, port.name)]
            for name, part in wiring.parts.items()
            for port in part.ports.values()
            if port.rate_of and port.causality == "output"
        }
        #: For each connected input the output that is the rate of its source, or the source itself if none is known.
        self.rates = np.array([rates.get(s, index[s]) for s in wiring.connections.values()], dtype=int)
        #: Whether each connected input has a slope: not if its rate is connected, too, or its source has discrete values.
        self.moving = np.array(
            [
                not (wiring.port(source).held or wiring.rate_input(target) in wiring.connections)
                for target, source in wiring.connections.items()
            ],
            dtype=bool,
        )
        #: For each connected input the connected input that is its rate over a step, or itself if there is none.
        self.partner = np.array(
            [self.targets.get(wiring.rate_input(end) or end, n) for end, n in self.targets.items()], dtype=int
        )
        #: For each power bond the indices of the outputs effort and flow, and of the inputs to which they are connected.
        numbers = [(index[b.effort], index[b.flow], targets[b.effort_to], targets[b.flow_to]) for b in bonds]
        self.bonds = np.array(numbers, dtype=int).reshape(-1, 4).T
        self.outputs = self.before = self._read()
        self.last = 1.0

    def _settle(self) -> None:
        """Exchange outputs until they no longer change; if there is no algebraic loop, this takes at most one round per part.

        If an algebraic loop does not settle, its values of the last round are kept.
        """
        self.outputs, changes, turn = self._read(), [inf], len(self.instances)
        while len(changes) <= _ROUNDS and changes[-1] > 0.0:
            self._exchange(self.outputs)
            before, self.outputs = self.outputs, self._read()
            changes.append(float(np.max(np.abs(self.outputs - before), initial=0.0)))
            # a change goes round a loop in as many rounds as there are parts, at most
            if len(changes) > turn + 1 and not changes[-1] < changes[-1 - turn]:
                break
        self._exchange(self.outputs)

    def _read(self) -> Floats:
        return np.concatenate([instance.read() for instance in self.instances.values()])

    def _exchange(
        self, outputs: Floats, slopes: Floats | None = None, *, middle: float = 0.0, updated: bool = False
    ) -> None:
        """Set all connected inputs from ``outputs``, the values at the start of a step, and the inputs' slopes over time.

        A part that accepts no slopes receives the values extrapolated by the time ``middle`` (s). With ``updated`` an FMI 3.0
        part receives the extrapolated value at each step of its own integrator.
        """
        values = outputs[self.sources]
        for name, (ports, numbers) in self.own.items():
            own = None if slopes is None else slopes[numbers]
            # sampled parts take their inputs at the start of a step
            later = middle if name not in self.sampled else 0.0
            self.instances[name].set_inputs(ports, values[numbers], own, middle=later, updated=updated)

    def _slopes(self) -> Floats:
        """Return the slopes of all connected inputs over time; if a rate is not known, the slope of the last step is used."""
        found = self.outputs[self.rates]
        unknown = self.rates == self.sources
        found[unknown] = (self.outputs - self.before)[self.sources[unknown]] / self.last
        return np.where(self.moving, found, 0.0)

    def step(self, coupling: str, time: float, step: float) -> None:
        """Take a communication step of length ``step`` (s) from ``time`` (s) with all parts."""
        before, slopes = self.outputs, None if coupling == "hold" else self._slopes()
        states = {name: each.save() for name, each in self.instances.items()} if coupling == "rollback" else {}
        try:
            self._exchange(before, slopes, middle=0.5 * step, updated=coupling == "updates")
            self._step_all(time, step)
            if coupling == "rollback":
                there = self._read()
                for name, state in states.items():
                    self.instances[name].restore(state)
                slopes = np.where(self.moving, (there - before)[self.sources] / step, 0.0)
                self._exchange(before, slopes, middle=0.5 * step)
                self._step_all(time, step)
        finally:
            for name, state in states.items():
                self.instances[name].forget(state)
        self._keep_end_values(before, slopes, step)
        self.reached = self._read()
        self.before, self.outputs, self.last = before, self.reached, step
        if coupling != "hold":
            # outputs that depend directly on inputs are read again with the new inputs; masters that hold inputs do not do this
            self._exchange(self.reached)
            self.outputs = self._read()

    def _keep_end_values(self, before: Floats, slopes: Floats | None, step: float) -> None:
        """Store the values of the inputs at the end of a step.

        If the rate of an input is connected, too, the input changes at this rate.
        """
        values = before[self.sources]
        self.given = values.copy()
        for name, (_, numbers) in self.own.items():
            self.given[numbers] = self.instances[name].end_values(step)
        paired = self.partner != np.arange(len(values))
        rates = values if slopes is None else values + 0.5 * step * slopes
        self.given[paired] = (values + step * rates[self.partner])[paired]

    def _step_all(self, time: float, step: float) -> None:
        for name, instance in self.instances.items():
            self.stepping = name
            instance.step(time, step)

    def powers(self) -> tuple[Floats, Floats]:
        """Return the power residual of each bond at the end of the last step, and the power that it transmits then (W)."""
        effort, flow, effort_to, flow_to = self.bonds
        through = self.reached[effort] * self.reached[flow]
        return self.given[effort_to] * self.reached[flow] - self.reached[effort] * self.given[flow_to], through

    def close(self) -> None:
        for instance in self.instances.values():
            instance.close()


def count_steps(stop_time: float, step: float) -> int:
    """Return the number of steps in a run, all equal or with a shorter last one; raise InputError if the step is invalid."""
    if not 0.0 < step <= stop_time < inf:
        raise InputError(
            f"the communication step is {step} s: it must be above 0 and at most the stop time, {stop_time} s, which must be "
            "finite"
        )
    return ceil(stop_time / step * (1.0 - 1e-12))


class _Stepper:
    """Controller that keeps the communication step constant, or adapts it so that the coupling adds a wanted share of power."""

    def __init__(self, step: float, stop_time: float, share: float | None) -> None:
        self.step, self.stop_time, self.share = step, stop_time, share
        self.first, self.number, self.before, self.scale = step, 0, 0.0, 0.0
        self.count = count_steps(stop_time, step)

    def next_step(self, time: float) -> tuple[float, float]:
        """Return the length of the next step, and the time at its end."""
        if self.share is None:
            # the last step is shorter where the steps do not fill the run
            end = (self.number + 1) * self.step if self.number + 1 < self.count else self.stop_time
        else:
            # the last two steps share the remaining time
            left = self.stop_time - time
            end = self.stop_time if left <= 1.0001 * self.step else time + min(self.step, 0.5 * left)
        self.number += 1
        return end - time, end

    def adapt(self, powers: Floats, flows: Floats) -> None:
        """Adapt the step to the power residuals and transmitted powers of the last step, by PI control of the added work."""
        if self.share is None:
            return
        self.scale = max(_MEMORY * self.scale, float(np.sqrt(np.mean(flows**2))))
        error = 0.5 * float(np.sqrt(np.mean(powers**2))) / (self.share * self.scale) if self.scale > 0.0 else 0.0
        proportional, integral = _GAINS
        if error > 0.0:
            before = self.before or error
            growth = error ** -(proportional + integral) * before**proportional
            low, high = (bound * self.first for bound in _STEPS)
            self.step = float(np.clip(self.step * np.clip(growth, *_GROWTH), low, min(high, self.stop_time)))
        self.before = error


@in_si(step="s", stop_time="s")
def run_system(
    wiring: Wiring,
    *,
    coupling: str = "hold",
    step: Amount = None,
    stop_time: Amount = None,
    share: float | None = None,
    progress: bool = False,
) -> SystemRun:
    """Run the FMUs of a system together.

    Parameters
    ----------
    wiring : Wiring
    coupling : str
        One of `COUPLINGS`.
    step, stop_time : float, optional
        Communication step and end of the run (s); by default those of the wiring. If the steps do not fill the run, the last
        one is shorter.
    share : float, optional
        Wanted error of the coupling, such as 1e-3: the power that the coupling adds, as a fraction of the greatest power that
        the bonds have transmitted recently. It controls the length of the steps; ``step`` is then the first step.
    progress : bool

    Returns
    -------
    SystemRun
        If a part refuses a step, the run ends there and has the part's message.

    Raises
    ------
    CosimulationError
        If a part cannot be loaded or initialised.
    InputError
        If the step is not positive or exceeds the stop time, if the stop time is not finite, if ``rollback`` is chosen and a
        part cannot restore its state, if ``share`` is not positive or there is no power bond for it, or if a part needs equal
        steps and does not get them.
    """
    require_kind(wiring, Wiring, "wiring", "a Wiring, such as load_system(FILE).wiring()")
    if coupling not in COUPLINGS:
        raise unknown_name(coupling, COUPLINGS, f"coupling {coupling!r}")
    step, stop_time = wiring.step if step is None else step, wiring.stop_time if stop_time is None else stop_time
    stepper, bonds = _Stepper(step, stop_time, share), wiring.bonds()
    if share is not None and not (share > 0.0 and bonds):
        raise InputError(
            f"the share is {share:g} and the system has {len(bonds)} power bonds: the share must be above 0, and there must be "
            "at least one bond"
        )
    if share is not None or abs(stepper.count * step - stop_time) > 1e-9 * step:
        for name, part in wiring.parts.items():
            if not part.description.coSimulation.canHandleVariableCommunicationStepSize:
                raise InputError(
                    f"{name} accepts only equal communication steps: they cannot follow a share, and {step:g} s must "
                    f"divide the stop time, {stop_time:g} s"
                )
    together = _Instances(wiring, bonds)
    times, rows = [0.0], [together.outputs]
    effort, flow = together.bonds[:2]
    powers, flows = [np.zeros(len(bonds))], [together.outputs[effort] * together.outputs[flow]]
    status, message = 0, ""
    try:
        stuck = [name for name, each in together.instances.items() if not each.goes_back]
        if coupling == "rollback" and stuck:
            raise InputError(f"{stuck[0]} cannot go back to the start of a step: choose another coupling than rollback")
        with record_interrupts() as interrupted, show_progress(progress, stop_time, "running the system") as show:
            while times[-1] < stop_time * (1.0 - 1e-12) and not interrupted:
                length, end = stepper.next_step(times[-1])
                try:
                    together.step(coupling, times[-1], length)
                except FMICallException as error:
                    status, message = 3, _refusal(together, times[-1], error)
                    break
                times.append(end)
                rows.append(together.outputs)
                residual, through = together.powers()
                powers.append(residual)
                flows.append(through)
                stepper.adapt(residual, through)
                show(end)
    finally:
        together.close()
    table, residuals, passing = np.array(rows), np.array(powers), np.array(flows)
    run = SystemRun(
        time=np.array(times),
        values={str(end): table[:, number] for number, end in enumerate(together.ends)},
        powers={str(bond.effort): residuals[:, number] for number, bond in enumerate(bonds)},
        flows={str(bond.effort): passing[:, number] for number, bond in enumerate(bonds)},
        status=status,
        message=message,
        notes=tuple(wiring.notes(step)),
        title=wiring.title,
        coupling=coupling,
        units={str(end): wiring.unit(end) for end in together.ends},
        connected=tuple(map(str, dict.fromkeys(wiring.connections.values()))),
    )
    if interrupted:
        raise RunInterrupted(run)
    return run


def _refusal(together: _Instances, time: float, error: FMICallException) -> str:
    """Return the message on a refused step, with the last message that any FMU logged.

    FMPy passes the messages of all FMUs to one of them, so the message may be found at an FMU that did not log it.
    """
    said = [text for instance in together.instances.values() for text in instance.messages]
    return f"{together.stepping} refused the step from t = {time:.9g} s: {said[-1] if said else error}"
