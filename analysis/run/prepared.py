"""A prepared run: the data shared by all solvers, and its solution by the compiled solver."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from math import isfinite, nan, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError
from linkwork.integrate import UNDEFINED
from linkwork.limits import ASSEMBLY, MASSLESS
from linkwork.mechanism import Mechanism

from ..mechanisms import InitialState, Parameters, find_mechanism
from ..numerics.workers import record_interrupts
from .angles import WholeTurns
from .cautions import MANY_STEPS, disturbance_rates, is_too_slow, output_cautions, stiffness
from .equations import OUTPUTS, compile_outputs, machine
from .events import Event, RunInterrupted, show_progress
from .inputs import Encoded, Inputs, align, check_run, compile_function, compile_source, encode_once
from .sampling import NotFiniteError, sample
from .trajectory import Occurrence, Trajectory

#: Steps in one compiled call, about a tenth of a second; between calls progress is shown and Ctrl-C is checked.
STEPS_PER_CALL = 50_000
#: Number of times that each event of the user may happen in one compiled call, on average; if there are more, the call returns.
EVENTS_PER_CALL = 1_000
#: Energy (J) and magnitude of inputs above which energy and accelerations at the start are checked for overflow.
_GREAT = 1e100
#: Highest harmonic of the drive that is expected in a motion: a faster vibration is reported.
_HARMONICS = 30.0


@cache
def _solver() -> Any:
    """Return the module of the compiled solver: imported late, as Numba takes long, and once, as each import takes 1 us."""
    from . import compiled

    return compiled


@cache
def _records() -> Any:
    """Return the module of the compiled solver's records, imported as `_solver` is."""
    from . import records

    return records


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Solver settings of a run.

    Times of the samples (s), step over which inputs are held (s, 0 if they are not held), tolerance, largest number of steps.
    """

    times: NDArray[np.float64]
    hold: float
    tolerance: float
    max_steps: int


@dataclass(frozen=True, slots=True)
class Start:
    """The start of a run: state, mechanical energy (J), and magnitudes to which errors are relative."""

    x: NDArray[np.float64]
    energy: float
    scale: NDArray[np.float64]


@dataclass(slots=True)
class Run:
    """One run, checked and ready to be solved.

    Raises
    ------
    InputError
        If inputs or initial state belong to another mechanism.
    """

    parameters: Parameters
    inputs: Inputs | None
    initial: InitialState | None
    settings: Settings
    events: tuple[Event, ...] = ()
    mechanism: Mechanism = field(init=False)
    encoded: Encoded = field(init=False)
    p: Any = field(init=False)
    modes: tuple[float, ...] = field(init=False)

    def __post_init__(self) -> None:
        self.mechanism = find_mechanism(self.parameters)
        self.inputs, self.initial = check_run(self.mechanism, self.inputs, self.initial)
        self.encoded = align(encode_once(self.inputs, self.mechanism), self.settings.times)
        self.p = self.parameters.constants()
        self.modes = tuple(float(value) for value in self.encoded.modes.values())

    def start(self) -> Start:
        """Compute the state, energy and error scale at the start.

        Raises
        ------
        AssemblyError
            If the links cannot be joined at the start.
        InputError
            If an input is not a finite number, or energy or accelerations are not.
        """
        x = np.array(self.mechanism.state(self.initial))
        u = sample(self.encoded, float(self.settings.times[0]), x, self.encoded.source.laws)
        for channel, place, _ in self.encoded.commands:
            x[place] = u[channel]
        acting = self.apply_inputs(u)
        state = self.mechanism.equations.start(tuple(x.tolist()), acting, self.p)
        self.mechanism.check_state(state, acting, self.p)
        scale = np.array(self.mechanism.error_scale(self.parameters, state))
        energy = self.mechanism.equations.energy(state, self.p)
        # only such large values may overflow
        great = not (abs(energy) < _GREAT and max(map(abs, u.tolist()), default=0.0) < _GREAT)
        try:
            slope = self.mechanism.equations.derivative(state, acting, self.p) if great else ()
        except UNDEFINED:
            slope = (nan,)
        if not all(map(isfinite, (energy, *slope))):
            names = [name for freedom in self.mechanism.freedoms for name in (freedom.coordinate, freedom.rate)]
            values = dict(zip([*names[::2], *names[1::2]], state))
            name = max(values, key=lambda name: abs(values[name]))
            raise InputError(
                f"energy or accelerations at the start are not finite: {name} is {values[name]:g}; it, an input or a "
                "parameter must be far smaller"
            )
        return Start(np.array(state), energy, scale)

    def apply_inputs(self, u: NDArray[np.float64]) -> Any:
        """Return the inputs in the form that the equations take."""
        return self.mechanism.equations.apply_inputs(self.modes, tuple(u.tolist()), self.p)

    def limit(self, x: NDArray[np.float64]) -> str:
        """Return the message for a run that ended at a limit of the motion, at the state x."""
        idle = np.zeros(len(self.mechanism.channels))
        return self.mechanism.describe_limit(x.tolist(), self.apply_inputs(idle), self.p)

    def stiffness_caution(self, x: NDArray[np.float64], u: NDArray[np.float64], steps: float, passed: float) -> str:
        """Return a caution that the run is stiff or vibrates fast, or an empty text.

        ``x`` and ``u`` are state and input channels after ``steps`` steps, which covered the time ``passed`` (s).
        """
        times, mechanism, hold = self.settings.times, self.mechanism, self.settings.hold
        if steps < MANY_STEPS:
            return ""
        # a step ends at each break of the inputs, as at each point of a table
        breaks = (
            passed / hold
            if hold
            else np.ptp(np.searchsorted(self.encoded.source.breaks, (times[0], times[0] + passed)))
        )
        if steps - breaks < MANY_STEPS:
            return ""
        turning = [abs(x[len(mechanism.freedoms) + i]) for i in mechanism.cyclic_freedoms]
        usual = max([pi * (len(times) - 1) / float(np.ptp(times)), *(_HARMONICS * speed for speed in turning)])
        return stiffness(disturbance_rates(mechanism, x, self.apply_inputs(u), self.p), steps, passed, usual)

    def _records(self, times: NDArray[np.float64], x: NDArray[np.float64]) -> tuple[Any, Any]:
        """Return arrays for samples at the given times, and the solver's records at the start of the run from the state x."""
        k = _records()
        n, channels = len(times), len(self.mechanism.channels)
        samples = k.Samples(times, np.empty((1, n, self.mechanism.size)), np.empty((1, n, channels)))
        state = k.State(np.zeros(1, dtype=k.CARRY), x[None].copy(), np.zeros((1, channels)))
        state.carries["begin"] = times[0]
        return samples, state

    def solve_compiled(self, progress: bool, balanced: bool = False) -> Trajectory:
        """Solve the run with the compiled solver; ``balanced`` restores the energy balance after each step.

        Raises
        ------
        InputError
            As for `start`; or if ``balanced`` is not possible.
        """
        solver, k = _solver(), _records()
        begun = clock.perf_counter()
        turns = WholeTurns(self.mechanism, self.p, self.modes, self.encoded, self.events)
        start, laws = self.start(), self.encoded.source.laws
        if turns.has_many_turns(start.x):
            turns.subtract(start.x, sample(self.encoded, float(self.settings.times[0]), start.x, laws), laws, 0)
            # the energy at the start must be that of the reduced angles
            start = replace(start, energy=self.mechanism.equations.energy(tuple(start.x.tolist()), self.p))
        problem = make_problem(self.encoded, self.settings, self.mechanism.is_switched_on(self.p))
        source, kept = compile_source(self.encoded)
        batch = solver.single_batch(source, np.array([*self.p, start.energy]), start.scale, self.encoded.steady)
        watch, watching = self._watch(self._balance() if balanced else ())
        kept += watching
        times, most = self.settings.times, self.settings.max_steps
        samples, state = self._records(times, start.x)
        carry, x, u = state.carries[0], state.x[0], state.u[0]
        status, integrating = np.full(1, k.RUNNING), 0.0
        occurrences: list[list[float]] = []
        stiff, needed, span = "", 0.0, times[-1] - times[0]
        with record_interrupts() as interrupted, show_progress(progress, span) as show:
            try:
                while status[0] == k.RUNNING and carry["steps"] < most and not needed and not interrupted:
                    entered = clock.perf_counter()
                    # the arrays are all made here, and a short run takes 160 us
                    solver.run.unchecked(problem, source, batch, watch, state, samples, status, most, STEPS_PER_CALL)
                    integrating += clock.perf_counter() - entered
                    if carry["found"]:
                        found = watch.found[: carry["found"]]
                        found[:, 2:] += turns.subtracted
                        occurrences += found.tolist()
                        carry["found"] = 0
                    passed, steps = float(carry["begin"] + carry["elapsed"] - times[0]), float(carry["steps"])
                    show(passed)
                    stiff = self.stiffness_caution(x, u, steps, passed)
                    needed = steps * span / passed if stiff and is_too_slow(steps, passed, span, most) else 0.0
                    if status[0] == k.RUNNING:
                        turns.subtract(x, u, source.laws, int(carry["sample"]), watch)
            except KeyboardInterrupt:  # raised by the caller's code
                interrupted.append(True)
        last = dict(zip(k.CARRY.names, carry.item()))
        t, done = last["begin"] + last["elapsed"], last["sample"]
        if status[0] == k.BAD_INPUT:
            raise NotFiniteError(self.encoded, last["lost"], t, x + turns.subtracted)
        times, states, forces = times[:done], samples.states[0, :done], samples.forces[0, :done]
        if last["started"] and times[-1] < t:
            # the run ended between two samples: its last configuration is recorded too
            times, states, forces = np.append(times, t), np.vstack([states, x]), np.vstack([forces, u])
        code, message = verdict(
            self.mechanism, self.settings, int(status[0]), t, x + turns.subtracted, self.limit, needed
        )
        if status[0] == k.NO_STEP:
            message += f": {self.describe_failed_step(x)}"
        values = turns.put_back(compute_outputs(self.mechanism, problem.modes, batch.p[0], states, forces))
        caution = output_cautions(self.mechanism, times, values, None if code else self.settings.tolerance)
        message = "; ".join(filter(None, (message, stiff, caution)))
        trajectory = Trajectory(
            time=times,
            values=values,
            status=code,
            message=message,
            events=tuple(
                Occurrence(self.events[int(row[0])].name, row[1], tuple(row[2:-2]))
                for row in sorted(occurrences, key=lambda row: row[1])
            ),
            source="compiled DOP853" + balanced * ", energy balanced",
            parameters=self.parameters,
            names=self.mechanism.output_names,
            statistics={
                "steps": float(last["steps"] - last["rejected"]),
                "rejected": float(last["rejected"]),
                "evaluations": float(last["evaluations"]),
                "seconds_integrating": integrating,
                "seconds": clock.perf_counter() - begun,
            },
        )
        if interrupted:
            raise RunInterrupted(trajectory)
        return trajectory

    def describe_failed_step(self, x: NDArray[np.float64]) -> str:
        """Return why no step succeeds at the state x: springs whose law has no value just beyond it, or a missing mass.

        If neither is the case, the text gives the step size. The laws are evaluated at the positions 1 us and 1 ms after the
        state, extrapolated with constant rates.
        """
        springs = {v.name: v.of for v in self.mechanism.variables if v.role == "spring force"}
        n, states = len(self.mechanism.freedoms), np.tile(x, (2, 1))
        states[:, :n] += np.array([[1e-6], [1e-3]]) * x[n : 2 * n]
        names, idle = self.mechanism.output_names, np.zeros((2, len(self.mechanism.channels)))
        values = compute_outputs(self.mechanism, np.array(self.modes), np.array([*self.p, 0.0]), states, idle)
        if "assembly.clearance" in names:
            # beyond the limit of assembly no output has a value
            values = values[np.isfinite(values[:, names.index("assembly.clearance")])]
        finite = dict(zip(names, map(np.all, np.isfinite(values).T)))
        lost = [spring for name, spring in springs.items() if not finite[name]]
        words = "law of {} has" if len(lost) == 1 else "laws of {} have"
        if lost:
            return f"the {words.format(' and '.join(lost))} no value beyond"
        rates = [freedom.rate for freedom in self.mechanism.freedoms]
        moves = all(finite[v.name] for v in self.mechanism.variables if v.rate_of in rates)
        return "the step size fell below what the time can resolve" if moves else MASSLESS

    def _balance(self) -> tuple[int, int]:
        """Return the indices of the outputs for the energy balance residual and the kinetic energy."""
        names, inputs = self.mechanism.output_names, self.inputs or Inputs()
        commanded = [self.encoded.value_name(channel) for channel in self.encoded.commands[:, 0].tolist()]
        moved = [name for name in commanded if inputs.parts(name)]
        if moved:
            raise InputError(
                f"method 'balanced' changes the rates of all freedoms, but {', '.join(moved)} is commanded: choose 'compiled'"
            )
        for name in (wanted := ("energy.residual", "energy.kinetic")):
            if name not in names:
                raise InputError(
                    f"method 'balanced' needs the output {name}, which a {self.mechanism.name} does not have"
                )
        return names.index(wanted[0]), names.index(wanted[1])

    def _watch(self, balance: tuple[int, ...]) -> tuple[Any, list[Any]]:
        """Return the `Watch` of the compiled code (events and energy balance), and the objects to keep while it is used."""
        k = _records()
        if not (self.events or balance):
            return k.watch_nothing(self.mechanism.size), []
        n = len(self.events)
        table, addresses, kept = np.zeros((n, 4)), np.zeros(n, dtype=np.int64), []
        for i, event in enumerate(self.events):
            table[i] = 0.0, event.level, event.direction, event.stop
            if event.function is None:
                table[i, 0] = event.column(self.mechanism)
            else:
                kept.append(compile_function(event.function, len(self.mechanism.freedoms)))
                addresses[i] = kept[-1].address
        found = np.empty((EVENTS_PER_CALL * n, 2 + self.mechanism.size))
        return k.Watch(table, addresses, np.zeros(n), found, np.array(balance, dtype=np.int64)), kept


def make_problem(encoded: Encoded, settings: Settings, switched: bool) -> Any:
    """Return the `Problem` of the compiled code: the data common to all runs with the same kind of inputs."""
    return _records().Problem(
        machine(encoded.mechanism, switched).addresses,
        np.array(list(encoded.modes.values()), dtype=float),
        encoded.commands,
        len(encoded.mechanism.output_names),
        settings.tolerance,
        settings.hold,
        float(settings.times[-1]),
        np.array(encoded.mechanism.reach),
    )


def verdict(
    mechanism: Mechanism,
    settings: Settings,
    status: int,
    t: float,
    x: NDArray[np.float64],
    limit: Callable[[NDArray[np.float64]], str] | None = None,
    needed: float = 0.0,
) -> tuple[int, str]:
    """Return the solver.status and solver.message for a status of the compiled code at the time t and the state x.

    ``limit`` returns the message for a limit of the motion; by default the message is that of the limit of assembly. ``needed``
    is the number of steps that a run given up as stiff would have needed, else zero.
    """
    k = _records()
    if status not in (k.LIMIT, k.NO_STEP, k.RUNNING):
        return 0, ""
    # a microsecond, at any time
    at = f"t = {t:.9g} s" if abs(t) < 1e3 else f"t = {t:.6f} s"
    if status == k.LIMIT:
        return 3, f"{limit(x) if limit else ASSEMBLY} at {at}, {mechanism.describe_state(x.tolist())}"
    if status == k.NO_STEP:
        return 4, f"no step succeeds at {at}, {mechanism.describe_state(x.tolist())}"
    if status == k.RUNNING and needed:
        return 4, f"stopped at {at}, as about {needed:.2g} steps would be needed"
    return 4, f"{settings.max_steps} steps did not suffice: stopped at {at}, {mechanism.describe_state(x.tolist())}"


def compute_outputs(
    mechanism: Mechanism,
    modes: NDArray[np.float64],
    p: NDArray[np.float64],
    states: NDArray[np.float64],
    inputs: NDArray[np.float64],
    columns: tuple[int, ...] | None = None,
) -> NDArray[np.float64]:
    """Compute the real outputs of a mechanism, shape (n, outputs), from rows of states and inputs.

    Parameters
    ----------
    modes : ndarray
        Values of the mechanism's modes.
    p : ndarray
        Constants of the equations, and as last element the mechanical energy at the start (J).
    states, inputs : ndarray, shapes (n, states) and (n, channels)
    columns : tuple of int, optional
        Indices of the outputs to compute, in this order; by default all.
    """
    from ..numerics.lanes import width

    switched = mechanism.is_switched_on(p.tolist())
    if columns is None:
        outputs, count = machine(mechanism, switched, width()).addresses[OUTPUTS], len(mechanism.output_names)
    else:
        outputs, count = compile_outputs(mechanism, switched, columns, width()).addresses["chosen"], len(columns)
    values = np.empty((len(states), count))
    rows = [np.ascontiguousarray(given, dtype=float) for given in (states, inputs)]
    _solver().rows.unchecked(outputs, width(), modes, p, *rows, values)
    return values
