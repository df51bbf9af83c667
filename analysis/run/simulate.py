"""The in-process solver: runs of a mechanism, one or many."""

from __future__ import annotations

import signal
import threading
import time as clock
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain
from math import isfinite
from typing import Any

import joblib
import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.progress import Progress, track
from scipy.integrate import OdeSolver, solve_ivp

from linkwork.errors import InputError, Interrupted, LinkworkError
from linkwork.limits import LIMIT_SINE, NEAR_LIMIT
from linkwork.plant import check_tolerance

from ..mechanisms import MECHANISMS, OUTPUT_UNITS, InitialState, Mechanism, Parameters, mechanism_of
from .inputs import FUNCTIONS, Channels, Encoded, StateFunction, align, encode, given
from .trajectory import Occurrence, Trajectory

#: Steps of one compiled call, between which progress is shown and an interrupt is heard: about a tenth of a second.
STEPS_PER_CALL = 50_000
#: Events of one kind that one compiled call can report before it hands them over.
EVENTS_PER_CALL = 1_000

#: Evaluations of inputs that are not finite after which one of SciPy's methods is stopped.
MOST_LOSSES = 300

#: What `channels` returns, in its order.
Values = tuple[float, float, float, float, float, float, float]

SCIPY_METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something to look out for in a run: an output that crosses a level, or a function that crosses zero.

    Parameters
    ----------
    name : str
        Name under which it is reported.
    output : str, optional
        An output of the FMI contract.
    level : float
        Level of the output, in its SI unit.
    function : callable, optional
        Instead of an output: a function of time, crank angle, second coordinate (slider position or axial shift) and their
        rates, all floats, compiled with Numba.
    direction : int
        +1 for rising, -1 for falling, 0 for both.
    stop : bool
        Whether the run ends there.

    Notes
    -----
    A value that jumps across the level because an input jumps counts as crossing it, at the time of the jump; one that
    starts on the level does not. What happens more than once within a quarter of an integrator's step may be missed.
    """

    name: str
    output: str | None = None
    level: float = 0.0
    function: StateFunction | None = None
    direction: int = 0
    stop: bool = False

    def __post_init__(self) -> None:
        if (self.output is None) == (self.function is None):
            raise InputError(f"event {self.name!r} needs either an output or a function")
        if self.output is not None and self.output not in OUTPUT_UNITS:
            raise self._no_output(tuple(OUTPUT_UNITS))
        if self.function is not None and not callable(self.function):
            raise InputError(f"event {self.name!r} has the function {self.function!r}: it must be callable")
        if self.direction not in (-1, 0, 1):
            raise InputError(f"event {self.name!r} has direction {self.direction}: it must be -1, 0 or +1")
        if not isfinite(self.level):
            raise InputError(f"event {self.name!r} has level {self.level}: it must be a finite number")

    def column(self, mechanism: Mechanism) -> int:
        """Number of the output among those of a mechanism.

        Raises
        ------
        InputError
            If the mechanism has no such output.
        """
        if self.output not in mechanism.output_names:
            raise self._no_output(mechanism.output_names)
        return mechanism.output_names.index(self.output)

    def _no_output(self, names: tuple[str, ...]) -> InputError:
        return InputError(f"event {self.name!r} is on {self.output!r}: the outputs are {', '.join(names)}")


class RunInterrupted(Interrupted):
    """A run was interrupted from the keyboard; ``trajectory`` holds what it had computed."""

    def __init__(self, trajectory: Trajectory) -> None:
        self.trajectory = trajectory
        super().__init__(f"interrupted at t = {trajectory.time[-1]:.6g} s" if len(trajectory) else "interrupted")


def sample_times(stop_time: float, step: float, start_time: float = 0.0) -> NDArray[np.float64]:
    """Times start, start + step, ... up to and including the stop time, each computed as start + k step.

    The last step is shorter where the run is not a whole number of steps long.

    Raises
    ------
    InputError
        If the step is not positive, or the run does not end after it starts.
    """
    if not (isfinite(step) and step > 0.0):
        raise InputError(f"step is {step} s: it must be a finite number greater than zero")
    if not (isfinite(stop_time) and isfinite(start_time) and stop_time > start_time):
        raise InputError(f"a run from {start_time} s to {stop_time} s: it must end after it starts")
    ratio = (stop_time - start_time) / step
    whole = round(ratio)
    # what is left over, but for rounding, makes a last, shorter step
    count = whole if whole > 0 and abs(ratio - whole) <= 1e-6 else int(ratio) + 1
    times: NDArray[np.float64] = start_time + step * np.arange(count + 1, dtype=float)
    times[-1] = stop_time
    return times


def simulate(
    parameters: Parameters,
    inputs: Channels | None = None,
    *,
    initial: InitialState | None = None,
    stop_time: float,
    step: float = 1e-3,
    start_time: float = 0.0,
    samples: ArrayLike | None = None,
    hold: float | None = None,
    method: str | type[OdeSolver] = "compiled",
    tolerance: float = 1e-9,
    events: Sequence[Event] = (),
    max_steps: int = 100_000_000,
    progress: bool = False,
    **options: Any,
) -> Trajectory:
    """Run a mechanism in process.

    Parameters
    ----------
    parameters : FiveBarParameters or SliderCrankParameters
    inputs : Inputs or SliderCrankInputs
        What acts on it; by default nothing does (torque drive without torque, and the slider-crank's shift held).
    initial : InitialState
        That of the mechanism; by default at rest with all coordinates zero. Commanded speeds take the place of the rates.
    stop_time, start_time : float
        End and start of the run (s).
    step : float
        Distance of the recorded samples (s).
    samples : array_like, shape (n,), optional
        Times to record instead (s), increasing; the first is the start of the run, the last its end.
    hold : float, optional
        Sample and hold the inputs at multiples of this step (s), as a co-simulation master does; the crank speed then
        goes along the secant between two samples. Must be the sampling step of the recorded times.
    method : str or OdeSolver class
        ``compiled`` (DOP853 under Numba, the default), one of SciPy's (``RK23 RK45 DOP853 Radau BDF LSODA``), ``Hamming``
        (the thesis's predictor-corrector), or a class of your own.
    tolerance : float
        Bound of the local error relative to state and size of the mechanism.
    events : sequence of Event
    max_steps : int
        Steps after which a compiled run ends with solver.status 4.
    progress : bool
        Show a progress bar.
    **options
        Passed on to SciPy's ``solve_ivp``.

    Returns
    -------
    Trajectory
        A run that reaches the limit of assembly, or whose step size underflows, ends there with a status, a message and
        all data up to it.

    Raises
    ------
    ParameterError, InputError, AssemblyError
        If parameters or inputs are not usable, or the links cannot be joined at the start. An input that turns out not to
        be a finite number in the course of the run is named with the time.
    RunInterrupted
        On Ctrl-C; carries what was computed.
    """
    mechanism = mechanism_of(parameters)
    inputs, initial = given(mechanism, inputs, initial)
    check_tolerance(tolerance)
    times = _check_samples(sample_times(stop_time, step, start_time) if samples is None else np.asarray(samples, float))
    if hold is not None:
        _check_hold(hold, times)
    if max_steps < 1:
        raise InputError(f"max_steps is {max_steps}: it must be at least 1")
    encoded = align(encode(inputs), times)
    run = _Run(mechanism, parameters, inputs, encoded, initial, times, hold or 0.0, tolerance, tuple(events), max_steps)
    if method == "compiled":
        if options:
            raise InputError(f"the compiled method takes no options, but was given {', '.join(options)}")
        return run.compiled(progress)
    return run.scipy(_solver(method), options, progress)


def _solver(method: str | type[OdeSolver]) -> str | type[OdeSolver]:
    if isinstance(method, str):
        if method == "Hamming":
            from .hamming import Hamming

            return Hamming
        if method not in SCIPY_METHODS:
            raise InputError(
                f"method is {method!r}: it must be 'compiled', 'Hamming' or one of {', '.join(SCIPY_METHODS)}"
            )
    return method


def _check_samples(times: NDArray[np.float64]) -> NDArray[np.float64]:
    if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0.0):
        raise InputError("the recorded times must be at least two finite numbers, increasing")
    return np.ascontiguousarray(times)


def _check_hold(hold: float, times: NDArray[np.float64]) -> None:
    grid = times[0] + hold * np.arange(len(times))
    if not hold > 0.0 or np.any(np.abs(grid[:-1] - times[:-1]) > 1e-9 * max(hold, 1e-3 * abs(times[-1]))):
        raise InputError(f"inputs held over {hold} s: the recorded times must be the same multiples of it")


@lru_cache(maxsize=256)
def compile_function(function: StateFunction) -> Any:
    """A user's function as a C function; its ``address`` is what the compiled code calls. NaN where it raises.

    Raises
    ------
    InputError
        If Numba cannot compile it.
    """
    import numba

    plain = function.py_func if isinstance(function, numba.core.registry.CPUDispatcher) else function
    signature = numba.float64(*[numba.float64] * 5)
    try:
        own = numba.njit(signature, error_model="numpy")(plain)

        @numba.cfunc(signature, error_model="numpy")
        def guarded(t, th2, u, w2, v):  # type: ignore[no-untyped-def]
            try:
                return own(t, th2, u, w2, v)
            except Exception:
                return np.nan

    except Exception as error:
        raise InputError(
            f"function {getattr(function, '__name__', function)!r} cannot be compiled with Numba: choose one of SciPy's "
            f"methods, such as method='DOP853', which take any function. Numba says: {_reason(error)}"
        ) from error
    return guarded


def compiled_source(encoded: Encoded) -> tuple[Any, list[Any]]:
    """The inputs as the compiled code reads them, with a law of their own, and what has to stay alive meanwhile."""
    from . import compiled as k

    kept = [f and compile_function(f) for f in encoded.functions]
    addresses = np.array([f.address if f else 0 for f in kept], dtype=np.int64)
    return k.Source(encoded.breaks, encoded.coefficients, encoded.harmonics, encoded.law.copy(), addresses), kept


def _reason(error: Exception) -> str:
    """The line of Numba's report that tells most."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(("Failed in nopython", "During", "File", "- During"))]
    return (telling or lines or [type(error).__name__])[0]


def channels(encoded: Encoded, t: float, left: bool, x: NDArray[np.float64], law: NDArray[np.float64]) -> Values:
    """Torque, speed, acceleration, force, load, last channel and its rate at time t and state x, sampled in Python.

    ``left`` asks for the limit from the left where an input jumps. The user's functions are called as the Python they are.

    Raises
    ------
    InputError
        If one of them is not a finite number.
    """
    from . import compiled as k

    e = encoded
    torque, speed, acceleration, force, load, last, rate = k.channels(
        t, left, np.ascontiguousarray(x), k.Source(e.breaks, e.coefficients, e.harmonics, law, _NO_FUNCTIONS)
    )
    added = [0.0 if f is None else _number(f(t, x[0], x[1], x[2], x[3]), t) for f in e.functions]
    values = (
        torque + added[0],
        speed + added[4],
        acceleration + added[5],
        force + added[1],
        load + added[2],
        last + added[3],
        rate + added[6],
    )
    for number, value in enumerate(values):
        if not isfinite(value):
            raise NotFiniteError(encoded, number, t, x)
    return values


def held_channels(
    encoded: Encoded,
    t: float,
    ahead: float,
    x: NDArray[np.float64],
    law: NDArray[np.float64],
    inputs: Channels,
) -> Values:
    """The channels at time t as one who samples them holds them until ``ahead``.

    Commanded speeds go along the secant; a torsion bar acts with the torque of the middle of the step, and ``law`` is
    overwritten once it is released.
    """
    from .compiled import held_bar

    if law[2] and x[0] >= law[1]:
        law[2] = 0.0
    torque, speed, acceleration, force, load, last, rate = channels(encoded, t, False, x, law)
    torque += held_bar(law, x[0], x[2], ahead - t)
    if inputs.speed_drive or inputs.axial_mode == 1:
        there = channels(encoded, ahead, True, x, law)
        acceleration = (there[1] - speed) / (ahead - t)
        rate = (there[5] - last) / (ahead - t)
    return torque, speed, acceleration, force, load, last, rate


class NotFiniteError(InputError):
    """An input, by its number among `Values`, is not a finite number at a time and a state."""

    def __init__(self, encoded: Encoded, number: int, t: float, x: NDArray[np.float64]) -> None:
        self.number = number
        where = MECHANISMS[encoded.kind.MECHANISM].where(x[0], x[1])
        super().__init__(f"the input {encoded.value_names[number]} is not a finite number at t = {t:.9g} s, {where}")


_NO_FUNCTIONS = np.zeros(FUNCTIONS, dtype=np.int64)


def _number(value: object, t: float) -> float:
    if not isinstance(value, (int, float, np.floating, np.integer)):
        raise InputError(f"an input function returned {value!r} at t = {t:.9g} s: it must return a float")
    return float(value)


def _verdict(status: int, t: float, x: NDArray[np.float64], steps: int, mechanism: Mechanism) -> tuple[int, str]:
    """solver.status and solver.message of a run that ended with a status of the compiled code."""
    from . import compiled as k

    where = mechanism.where(x[0], x[1])
    if status == k.LIMIT:
        return 3, f"limit of assembly at t = {t:.9g} s, {where}"
    if status == k.NO_STEP:
        return 4, f"the step size fell below what t = {t:.9g} s can resolve, {where}"
    if status == k.RUNNING:
        return 4, f"{steps} steps did not suffice: stopped at t = {t:.9g} s, {where}"
    return 0, ""


@contextmanager
def interruptible() -> Iterator[list[bool]]:
    """Hear Ctrl-C as an entry in a list, to be looked at between two steps or calls.

    An exception would strike wherever it finds the interpreter: inside an FMU, whose interpreter this is, or inside Numba,
    which may drop it.
    """
    heard: list[bool] = []
    if threading.current_thread() is not threading.main_thread():
        yield heard
        return
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, lambda *_: heard.append(True))
    try:
        yield heard
    finally:
        # None stands for a handler that was not set from Python
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)


@contextmanager
def shown(progress: bool, duration: float, what: str = "simulate") -> Iterator[Callable[[float], None]]:
    """A progress bar over the time of a run, as a function of the time done; nothing at all where it is not wanted."""
    if not progress:
        yield lambda done: None
        return
    with Progress(transient=True) as bar:
        task = bar.add_task(what, total=duration)
        yield lambda done: bar.update(task, completed=done)


@dataclass(slots=True)
class _Run:
    """One run, prepared: what both ways of solving it share."""

    mechanism: Mechanism
    parameters: Parameters
    inputs: Channels
    encoded: Encoded
    initial: Any
    times: NDArray[np.float64]
    hold: float
    tolerance: float
    events: tuple[Event, ...]
    max_steps: int
    p: Any = field(init=False)

    def __post_init__(self) -> None:
        # the equations' constants, once: with one of SciPy's methods every right-hand side asks for them
        self.p = self.parameters.constants()

    def start(self) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
        """State at the start, mechanical energy there, and the error scale.

        Raises
        ------
        AssemblyError
            If the links cannot be joined there.
        InputError
            If a commanded speed is not a finite number.
        """
        p = self.p
        x = np.array([*self.mechanism.state(self.initial), 0.0, 0.0])
        values = channels(self.encoded, float(self.times[0]), False, x, self.encoded.law)
        if self.inputs.speed_drive:
            x[2] = values[1]
        if self.inputs.axial_mode == 1:
            x[3] = values[5]
        dynamics = self.mechanism.dynamics
        x = np.array(dynamics.started(tuple(x.tolist()), self.applied(values), p))
        self.mechanism.check_assembly(self.parameters, x[0], x[1])
        scale = np.array(self.mechanism.error_scale(self.parameters, float(x[2])))
        return x, dynamics.mechanical_energy(tuple(x), p), scale

    def applied(self, values: Values) -> Any:
        """The channels as the inputs of the equations."""
        torque, _, acceleration, force, load, last, rate = values
        drive, axial = float(self.inputs.speed_drive), float(self.inputs.axial_mode)
        return self.mechanism.dynamics.applied(drive, axial, torque, acceleration, force, load, last, rate, self.p)

    @property
    def solver(self) -> Any:
        """The compiled code for the mechanism."""
        from . import compiled

        return compiled.solver(self.p)

    @property
    def n_inputs(self) -> int:
        """Number of inputs of the equations."""
        return len(self.mechanism.dynamics.Inputs._fields)

    def compiled(self, progress: bool) -> Trajectory:
        from . import compiled as k

        begun = clock.perf_counter()
        p = self.p
        x, energy, scale = self.start()
        source, kept = compiled_source(self.encoded)
        watch, addresses, watching = self._watch()
        kept += watching
        run, outputs = self.solver.run, self.solver.outputs
        n, n_events = len(self.times), len(self.events)
        states, forces = np.full((n, 6), np.nan), np.full((n, self.n_inputs), np.nan)
        gaps = np.zeros(n_events)
        found = np.empty((EVENTS_PER_CALL * n_events, 8))
        carry = np.zeros(k.CARRY)
        carry[k.BEGIN] = self.times[0]
        status = k.RUNNING
        integrating = 0.0
        occurrences: list[list[float]] = []
        with interruptible() as interrupted, shown(progress, self.times[-1] - self.times[0]) as show:
            try:
                while status == k.RUNNING and carry[k.STEPS] < self.max_steps and not interrupted:
                    entered = clock.perf_counter()
                    status = run(
                        p, x, carry, self.times[-1], self.inputs.speed_drive, float(self.inputs.axial_mode), self.hold,
                        self.encoded.steady, source, self.tolerance, scale, self.times, states, forces, watch, addresses,
                        gaps, found, energy,
                        min(STEPS_PER_CALL, self.max_steps - int(carry[k.STEPS])),
                    )  # fmt: skip
                    integrating += clock.perf_counter() - entered
                    occurrences += found[: int(carry[k.EVENTS])].tolist()
                    carry[k.EVENTS] = 0
                    show(carry[k.BEGIN] + carry[k.ELAPSED] - self.times[0])
            except KeyboardInterrupt:  # of one who raises it himself
                interrupted.append(True)
        t = float(carry[k.BEGIN] + carry[k.ELAPSED])
        if status == k.BAD_INPUT:
            raise NotFiniteError(self.encoded, int(carry[k.LOST]), t, x)
        done = int(carry[k.SAMPLE])
        times, states, forces = self.times[:done], states[:done], forces[:done]
        if carry[k.STARTED] and times[-1] < t:
            # the run ended between two samples: its last configuration is recorded too
            last = carry[k.HELD : k.HELD + self.n_inputs]
            times, states, forces = np.append(times, t), np.vstack([states, x]), np.vstack([forces, last])
        names = self.mechanism.output_names
        values = np.empty((len(times), len(names)))
        outputs(p, states, forces, energy, values)
        code, message = _verdict(status, t, x, self.max_steps, self.mechanism)
        trajectory = Trajectory(
            time=times,
            values=values,
            status=code,
            message=message,
            events=tuple(
                Occurrence(self.events[int(row[0])].name, row[1], (row[2], row[3], row[4], row[5]))
                for row in sorted(occurrences, key=lambda row: row[1])
            ),
            source="compiled DOP853",
            names=names,
            statistics={
                "steps": float(carry[k.STEPS] - carry[k.REJECTED]),
                "rejected": float(carry[k.REJECTED]),
                "evaluations": float(carry[k.EVALUATIONS]),
                "seconds_integrating": integrating,
                "seconds": clock.perf_counter() - begun,
            },
        )
        if interrupted:
            raise RunInterrupted(trajectory)
        return trajectory

    def _watch(self) -> tuple[NDArray[np.float64], NDArray[np.int64], list[Any]]:
        """The events as the compiled code reads them, and what has to stay alive meanwhile."""
        watch = np.zeros((len(self.events), 4))
        addresses = np.zeros(len(self.events), dtype=np.int64)
        kept = []
        for i, event in enumerate(self.events):
            watch[i] = 0.0, event.level, event.direction, event.stop
            if event.function is None:
                watch[i, 0] = event.column(self.mechanism)
            else:
                kept.append(compile_function(event.function))
                addresses[i] = kept[-1].address
        return watch, addresses, kept

    def scipy(self, method: str | type[OdeSolver], options: dict[str, Any], progress: bool) -> Trajectory:
        """The same run by `solve_ivp`, interval by interval of smooth inputs."""
        begun = clock.perf_counter()
        march = _March(self)
        interrupted = False
        with shown(progress, self.times[-1] - self.times[0]) as show:
            try:
                march.run(method, options, show if progress else None)
            except KeyboardInterrupt:
                interrupted = True
        p = self.p
        names, dynamics = self.mechanism.output_names, self.mechanism.dynamics
        rows = march.rows
        if rows and rows[-1][0] < march.t:
            rows = [*rows, (march.t, march.x, march.held)]
        values = [dynamics.outputs(tuple(x), held, march.energy, p) for _, x, held in rows]
        code, message = _verdict(march.status, march.t, march.x, self.max_steps, self.mechanism)
        trajectory = Trajectory(
            time=np.array([t for t, _, _ in rows]),
            values=np.array(values).reshape(-1, len(names)),
            names=names,
            status=code,
            message=message,
            events=tuple(sorted(march.occurrences, key=lambda o: o.time)),
            source=method if isinstance(method, str) else method.__name__,
            statistics={"evaluations": float(march.evaluations), "seconds": clock.perf_counter() - begun},
        )
        if interrupted:
            raise RunInterrupted(trajectory)
        return trajectory


class _March:
    """A run by `solve_ivp`: the loop of `compiled.run` over the intervals of smooth inputs, in Python.

    It shares the equations and the sampling of the inputs with the compiled code, and neither integrator nor root finder.
    """

    def __init__(self, run: _Run) -> None:
        from . import compiled as k

        self.run_ = run
        self.dynamics = run.mechanism.dynamics
        self.p = run.p
        self.x, self.energy, self.scale = run.start()
        self.law = run.encoded.law.copy()
        self.t = float(run.times[0])
        self.held = run.applied((0.0,) * 7)
        self.rows: list[tuple[float, NDArray[np.float64], Any]] = []
        self.occurrences: list[Occurrence] = []
        self.evaluations = 0
        self.status = k.RUNNING
        #: the input that was not finite inside a step, which is then tried again shorter, how often, and what went well
        self._lost: int | None = None
        self._losses = 0
        self._good = self.t, self.x
        #: value of each event at the end of the interval before; zero where it happened just there
        self._gaps: list[float] | None = None

    def _end_of_interval(self, interval: int) -> float:
        times, breaks = self.run_.times, self.run_.encoded.breaks[1:-1]
        if self.run_.hold:
            return float(times[interval + 1] if interval + 1 < len(times) else times[-1])
        later = breaks[(breaks > self.t) & (breaks < times[-1])]
        return float(later[0] if len(later) else times[-1])

    def _sample(self, stop: float) -> tuple[float, float]:
        """Sample the inputs at the beginning of an interval; returns the commanded speeds."""
        e, t, end = self.run_.encoded, self.t, self.run_.times[-1]
        if self.run_.hold:
            ahead = stop if t < end else t + self.run_.hold
            values = held_channels(e, t, ahead, self.x, self.law, self.run_.inputs)
        else:
            values = channels(e, t, False, self.x, self.law)
        self.held = self.run_.applied(values)
        return values[1], values[5]

    def run(self, method: str | type[OdeSolver], options: dict[str, Any], show: Callable[[float], None] | None) -> None:
        """March to the end, a stopping event, or where it goes no further."""
        from . import compiled as k

        times, end = self.run_.times, self.run_.times[-1]
        interval = 0
        while True:
            stop = self._end_of_interval(interval)
            if self.law[2] and self.x[0] >= self.law[1]:
                self.law[2] = 0.0
            speed, last = self._sample(stop)
            inputs = self.run_.inputs
            if (inputs.speed_drive or inputs.axial_mode == 1) and self._gaps is not None:
                self.x = np.array(self.dynamics.jump(tuple(self.x), self.held, speed, last, self.p))
            if len(self.rows) < len(times) and times[len(self.rows)] <= self.t:
                self.rows.append((self.t, self.x, self.held))
            self._notice_jumps()
            if self.t >= end:
                self.status = k.FINISHED
            if self.status != k.RUNNING:
                return
            reached = self._interval(stop, method, options, show)
            if self.status != k.RUNNING:
                return
            interval += reached

    def _notice_jumps(self) -> None:
        """Events that happen because the inputs jump."""
        from . import compiled as k

        gaps = [self._gap(event, self.t, self.x, self.held) for event in self.run_.events]
        if self._gaps is not None:
            # a zero stands for what has just been told, and is to be left before it counts
            gaps = [before and gap for before, gap in zip(self._gaps, gaps)]
        for event, before, after in zip(self.run_.events, self._gaps or gaps, gaps):
            up = before < 0.0 <= after and event.direction >= 0
            down = before > 0.0 >= after and event.direction <= 0
            if up or down:
                self.occurrences.append(Occurrence(event.name, self.t, tuple(self.x[:4].tolist())))
                if event.stop:
                    self.status = k.EVENT
        self._gaps = gaps

    def _gap(self, event: Event, t: float, x: NDArray[np.float64], held: Any) -> float:
        if event.function is not None:
            return float(event.function(t, x[0], x[1], x[2], x[3]))
        column = event.column(self.run_.mechanism)
        return float(self.dynamics.outputs(tuple(x), held, self.energy, self.p)[column] - event.level)

    def _inputs(self, t: float, x: NDArray[np.float64], stop: float) -> Any:
        if self.run_.hold or (self.run_.encoded.steady and not self.law[2]):
            return self.held
        return self.run_.applied(channels(self.run_.encoded, t, t >= stop, x, self.law))

    def _derivative(self, t: float, x: NDArray[np.float64], stop: float) -> NDArray[np.float64]:
        # where there is no configuration or no input, so large a derivative has the step tried again shorter
        nothing = np.full(6, 1e200)
        try:
            held = self._inputs(t, x, stop)
        except NotFiniteError as error:
            self._lost = error.number
            self._losses += 1
            if self._losses > MOST_LOSSES:
                # LSODA would go on for ever
                raise NotFiniteError(self.run_.encoded, error.number, *self._good) from None
            return nothing
        try:
            result = np.array(self.dynamics.derivative(tuple(x), held, self.p))
        except (ArithmeticError, ValueError):
            return nothing
        # a trial of a step too long may be anywhere
        if t > self._good[0] and np.abs(x).max() < 1e100:
            self._good = t, x.copy()
        return result

    def _interval(
        self, stop: float, method: str | type[OdeSolver], options: dict[str, Any], show: Callable[[float], None] | None
    ) -> bool:
        """Integrate up to ``stop``; whether it was reached."""
        from . import compiled as k

        t0, x0 = self.t, self.x
        times = self.run_.times
        watched = self._watched(stop)
        self._lost, self._losses, self._good = None, 0, (t0, x0)

        def right_side(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
            if show is not None:
                show(t - times[0])
            return self._derivative(t, x, stop)

        inner = times[(times > t0) & (times < stop)]
        with np.errstate(over="ignore", invalid="ignore"):
            solution = solve_ivp(
                right_side,
                (t0, stop),
                x0,
                method=method,
                t_eval=np.append(inner, stop),
                events=[function for _, function in watched],
                rtol=max(self.run_.tolerance, 3e-14),
                atol=self.run_.tolerance * self.scale,
                **options,
            )
        self.evaluations += int(solution.nfev)
        # in the order of `watched`: of what happens at one time, the limit and the release come first
        happened = sorted(
            (
                (float(t), what, x)
                for (what, _), ts, xs in zip(watched, solution.t_events, solution.y_events)
                for t, x in zip(ts, xs)
            ),
            key=lambda item: item[0],
        )
        for t, event, x in happened:
            if isinstance(event, Event):
                self.occurrences.append(Occurrence(event.name, t, tuple(x[:4].tolist())))
        # SciPy gives empty lists where an event comes before the first of the times
        for t, x in zip(solution.t, np.ascontiguousarray(np.asarray(solution.y).T)):
            if t < stop:
                self.rows.append((float(t), x, self._inputs(t, x, stop)))
        what: str | Event = ""
        if solution.status == 1:
            t_cut = happened[-1][0]
            _, what, self.x = next(item for item in happened if item[0] == t_cut and self._ends(item[1]))
            self.t, self.x = t_cut, self.x.copy()
            if what == "release":
                self.x[0] = self.law[1]
            else:
                self.status = k.LIMIT if what == "limit" else k.EVENT
        elif solution.status == 0:
            self.t, self.x = stop, solution.y[:, -1].copy()
        else:
            if self.rows[-1][0] > t0:
                self.t, self.x = self.rows[-1][:2]
            if self._lost is not None:
                raise NotFiniteError(self.run_.encoded, self._lost, *self._good)
            clearance = self.dynamics.clearance(tuple(self.x), self.held, self.p)
            self.status = k.LIMIT if abs(clearance) < NEAR_LIMIT else k.NO_STEP
        self.held = self._inputs(self.t, self.x, stop)
        # what happens together with the release or the end of the interval must neither be lost nor be told twice: what
        # has not been told by now is left to the beginning of the next one
        same = k.SAME * (self.t - t0)
        just_now = [event for t, event, _ in happened if t >= self.t - same]
        before = self.x - same * self._derivative(self.t, self.x, stop)
        self._gaps = [
            0.0 if event in just_now else self._gap(event, self.t - same, before, self.held)
            for event in self.run_.events
        ]
        if what == "release":
            self.law[2] = 0.0
        return bool(solution.status == 0)

    @staticmethod
    def _ends(what: str | Event) -> bool:
        return isinstance(what, str) or what.stop

    def _watched(self, stop: float) -> list[tuple[str | Event, Callable[[float, NDArray[np.float64]], float]]]:
        """Event functions for `solve_ivp`: the limit of assembly, the torsion bar's release, the user's."""

        def limit(t: float, x: NDArray[np.float64]) -> float:
            try:
                return float(self.dynamics.clearance(tuple(x), self.held, self.p) - LIMIT_SINE)
            except (ArithmeticError, ValueError):
                return -1.0

        def release(t: float, x: NDArray[np.float64]) -> float:
            return float(x[0] - self.law[1])

        watched: list[tuple[str | Event, Any]] = [("limit", limit)]
        if self.law[2] and not self.run_.hold:
            watched.append(("release", release))
        for _, function in watched:
            function.terminal = True
        release.direction = 1  # type: ignore[attr-defined]

        t0, x0 = self.t, self.x
        # SciPy reports an event that starts at zero: such a one is given the sign of what follows
        x1 = x0 + 1e-6 * (stop - t0) * self._derivative(t0, x0, stop)

        def of(event: Event, start: float) -> Callable[[float, NDArray[np.float64]], float]:
            def value(t: float, x: NDArray[np.float64]) -> float:
                if t == t0:
                    gap = start or self._gap(event, t0 + 1e-6 * (stop - t0), x1, self._inputs(t0, x1, stop))
                else:
                    gap = self._gap(event, t, x, self._inputs(t, x, stop))
                return gap or 1e-300

            value.terminal = event.stop  # type: ignore[attr-defined]
            value.direction = event.direction  # type: ignore[attr-defined]
            return value

        return watched + [(event, of(event, start)) for event, start in zip(self.run_.events, self._gaps or [])]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """Many runs over the same times.

    Attributes
    ----------
    time : ndarray, shape (n,)
    states : ndarray, shape (m, n, 6)
        State of every run, dissipated and supplied work included; NaN after a run that ended early, as ``counts`` tells.
    forces : ndarray, shape (m, n, number of inputs)
        Inputs at the samples, as the ``Inputs`` of the mechanism's ``dynamics``.
    status : ndarray of int, shape (m,)
        solver.status of each run; 2 where an input was not finite.
    messages : tuple of str
        Why a run ended early; empty if it did not.
    counts : ndarray of int, shape (m,)
        Samples that each run reached.
    parameters : tuple
        Those of the mechanism, one for each run.
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
    energies: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.parameters)

    def __getitem__(self, index: int) -> Trajectory:
        """One run as a `Trajectory`: its samples, without the last configuration of one that ended early."""
        from . import compiled as k

        n = int(self.counts[index])
        names = mechanism_of(self.parameters[index]).output_names
        values = np.empty((n, len(names)))
        p = self.parameters[index].constants()
        k.solver(p).outputs(p, self.states[index, :n], self.forces[index, :n], self.energies[index], values)
        return Trajectory(
            time=self.time[:n],
            values=values,
            status=int(self.status[index]),
            message=self.messages[index],
            source="compiled DOP853",
            names=names,
        )

    def output(self, name: str) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        """One output of all runs, shape (m, n), masked after the end of a run that ended early."""
        shape = (len(self), len(self.time))
        result = np.ma.MaskedArray(np.full(shape, np.nan), mask=np.ones(shape, dtype=bool))
        for i in range(len(self)):
            run = self[i]
            result[i, : len(run)] = run[name]
        return result


def simulate_many(
    parameters: Sequence[Parameters],
    inputs: Channels | Sequence[Channels] | None = None,
    *,
    initial: InitialState | Sequence[InitialState] | None = None,
    stop_time: float,
    step: float = 1e-3,
    start_time: float = 0.0,
    hold: float | None = None,
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
    """
    m = len(parameters)
    if m == 0:
        raise InputError("an ensemble needs at least one set of parameters")
    if batch < 1 or max_steps < 1:
        raise InputError(f"batch is {batch} and max_steps {max_steps}: both must be at least 1")
    mechanism = mechanism_of(parameters[0])
    if any(mechanism_of(p) is not mechanism for p in parameters):
        raise InputError("an ensemble's parameters must all be of one mechanism")
    all_inputs, starts = _each(inputs, m, "inputs"), _each(initial, m, "initial states")
    pairs = [given(mechanism, i, s) for i, s in zip(all_inputs, starts)]
    all_inputs, starts = [i for i, _ in pairs], [s for _, s in pairs]
    check_tolerance(tolerance)
    times = _check_samples(sample_times(stop_time, step, start_time))
    if hold is not None:
        _check_hold(hold, times)
    if len({(i.speed_drive, i.axial_mode) for i in all_inputs}) > 1:
        raise InputError(
            "an ensemble's inputs must all give the speed or all the torque, and all make the shift in one way"
        )
    runs = []
    for number, (p, i, s) in enumerate(zip(parameters, all_inputs, starts)):
        try:
            run = _Run(mechanism, p, i, align(encode(i), times), s, times, hold or 0.0, tolerance, (), max_steps)
            run.start()
        except LinkworkError as error:
            raise _of_run(number, error) from error
        runs.append(run)
    if len({tuple(map(id, run.encoded.functions)) for run in runs}) > 1:
        raise InputError("an ensemble's inputs must share their Python functions")
    # what cannot be compiled is told here, and not by a worker
    compiled_source(runs[0].encoded)
    batches = [runs[k : k + batch] for k in range(0, m, batch)]
    results: Iterable[Any] = joblib.Parallel(n_jobs=n_jobs, return_as="generator")(
        joblib.delayed(_run_batch)(b) for b in batches
    )
    if progress:
        results = track(results, total=len(batches), description="simulate", transient=True)
    states, forces, status, counts, energies, messages = (list(column) for column in zip(*results))
    return Ensemble(
        time=times,
        states=np.concatenate(states),
        forces=np.concatenate(forces),
        status=np.concatenate(status),
        messages=tuple(chain.from_iterable(messages)),
        counts=np.concatenate(counts),
        parameters=tuple(parameters),
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


def _run_batch(runs: Sequence[_Run]) -> tuple[Any, ...]:
    """One compiled call for a batch of prepared runs."""
    from . import compiled as k

    m, n = len(runs), len(runs[0].times)
    encoded = [run.encoded for run in runs]
    sizes = np.array([(len(e.coefficients), len(e.harmonics)) for e in encoded])
    pieces, waves = sizes.max(axis=0)
    breaks, coefficients = np.zeros((m, pieces + 1)), np.zeros((m, pieces, 5, 4))
    harmonics = np.zeros((m, waves, 4))
    starts, energies, scales = np.empty((m, 6)), np.empty(m), np.empty((m, 6))
    for i, (run, e) in enumerate(zip(runs, encoded)):
        breaks[i, : len(e.breaks)] = e.breaks
        coefficients[i, : len(e.coefficients)] = e.coefficients
        harmonics[i, : len(e.harmonics)] = e.harmonics
        starts[i], energies[i], scales[i] = run.start()
    # kept alive while their addresses are in use
    source, _kept = compiled_source(encoded[0])
    states, forces = np.full((m, n, 6), np.nan), np.full((m, n, runs[0].n_inputs), np.nan)
    carries = np.zeros((m, k.CARRY))
    carries[:, k.BEGIN] = runs[0].times[0]
    status = np.empty(m, dtype=np.int64)
    first = runs[0]
    first.solver.run_many(
        first.p, np.array([run.p for run in runs]), starts, energies,
        first.times[-1], first.inputs.speed_drive, float(first.inputs.axial_mode), first.hold,
        np.array([e.steady for e in encoded]), sizes, breaks, coefficients, harmonics, np.array([e.law for e in encoded]),
        source.functions, first.tolerance, scales, first.times, states, forces, carries, status, first.max_steps,
    )  # fmt: skip
    codes, messages = [], []
    for run, code, x, carry in zip(runs, status.tolist(), starts, carries):
        t = float(carry[k.BEGIN] + carry[k.ELAPSED])
        if code == k.BAD_INPUT:
            codes.append(code)
            messages.append(str(NotFiniteError(run.encoded, int(carry[k.LOST]), t, x)))
        else:
            verdict, message = _verdict(code, t, x, run.max_steps, run.mechanism)
            codes.append(verdict)
            messages.append(message)
    return states, forces, np.array(codes), carries[:, k.SAMPLE].astype(np.int64), energies, messages
