"""The in-process solver: runs of the five-bar slider, one or many."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import isfinite
from typing import Any

import joblib
import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.progress import Progress, track
from scipy.integrate import OdeSolver, solve_ivp

from linkwork.errors import InputError, LinkworkError
from linkwork.five_bar import dynamics, kinematics
from linkwork.five_bar.parameters import FiveBarParameters, InitialState
from linkwork.five_bar.plant import check_assembly, check_tolerance, error_scale

from .inputs import Encoded, Inputs, StateFunction, encode
from .trajectory import OUTPUT_NAMES, Occurrence, Trajectory

#: Steps of one compiled call, between which progress is shown and an interrupt is heard: about a tenth of a second.
STEPS_PER_CALL = 50_000
#: Events that one run can record.
MOST_EVENTS = 100_000

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
        Instead of an output: ``f(t, th2, u, th2', u')`` of floats, compiled with Numba.
    direction : int
        +1 for rising, -1 for falling, 0 for both.
    stop : bool
        Whether the run ends there.
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
        if self.output is not None and self.output not in OUTPUT_NAMES:
            raise InputError(f"event {self.name!r} is on {self.output!r}: the outputs are {', '.join(OUTPUT_NAMES)}")
        if self.direction not in (-1, 0, 1):
            raise InputError(f"event {self.name!r} has direction {self.direction}: it must be -1, 0 or +1")
        if not isfinite(self.level):
            raise InputError(f"event {self.name!r} has level {self.level}: it must be a finite number")


class RunInterrupted(LinkworkError):
    """A run was interrupted from the keyboard; ``trajectory`` holds what it had computed."""

    def __init__(self, trajectory: Trajectory) -> None:
        self.trajectory = trajectory
        super().__init__(f"interrupted at t = {trajectory.time[-1]:.6g} s" if len(trajectory) else "interrupted")


def sample_times(stop_time: float, step: float, start_time: float = 0.0) -> NDArray[np.float64]:
    """Times start, start + step, ... up to and including the stop time, each computed as start + k step.

    Raises
    ------
    InputError
        If the stop time is not a positive whole number of steps after the start.
    """
    if not (isfinite(step) and step > 0.0):
        raise InputError(f"step is {step} s: it must be a finite number greater than zero")
    if not (isfinite(stop_time) and isfinite(start_time) and stop_time > start_time):
        raise InputError(f"a run from {start_time} s to {stop_time} s: it must end after it starts")
    ratio = (stop_time - start_time) / step
    count = max(1, round(ratio))
    if abs(ratio - count) > 1e-6 * max(1.0, ratio):
        # a last, shorter step
        count = int(np.floor(ratio + 1e-9))
        return np.append(start_time + step * np.arange(count + 1), stop_time)
    times = start_time + step * np.arange(count + 1)
    times[-1] = stop_time
    return times


def simulate(
    parameters: FiveBarParameters,
    inputs: Inputs | None = None,
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
    """Run a five-bar slider in process.

    Parameters
    ----------
    parameters : FiveBarParameters
    inputs : Inputs
        What acts on it; by default nothing does (torque drive without torque).
    initial : InitialState
        By default at rest with th2 = u = 0; in speed drive the commanded speed takes the place of ``crank_speed``.
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
        Steps after which the run ends with solver.status 4.
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
        If parameters or inputs are not usable, or the links cannot be joined at the start.
    RunInterrupted
        On Ctrl-C; carries what was computed.
    """
    inputs = inputs or Inputs()
    initial = initial or InitialState()
    check_tolerance(tolerance)
    times = _check_samples(sample_times(stop_time, step, start_time) if samples is None else np.asarray(samples, float))
    if hold is not None:
        _check_hold(hold, times)
    encoded = encode(inputs)
    _check_inputs(encoded, times)
    check_assembly(parameters, initial.crank_angle, initial.slider_position)
    run = _Run(parameters, inputs, encoded, initial, times, hold or 0.0, tolerance, tuple(events), max_steps)
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


def _check_inputs(encoded: Encoded, times: NDArray[np.float64]) -> None:
    """A cubic that overflows, or a function that is not finite at the start, is told before the run."""
    for function in encoded.functions:
        if function is not None:
            value = function(float(times[0]), 0.0, 0.0, 0.0, 0.0)
            if not isinstance(value, (int, float, np.floating)):
                raise InputError(f"an input function returned {value!r} at t = {times[0]} s: it must return a float")


def torque_law(encoded: Encoded) -> NDArray[np.float64]:
    """A law array of its own for a run, which overwrites it when the torsion bar is released."""
    return encoded.law.copy()


@lru_cache(maxsize=256)
def _compile_function(function: StateFunction) -> Any:
    import numba

    if isinstance(function, numba.core.registry.CPUDispatcher):
        function = function.py_func
    try:
        signature = numba.float64(*[numba.float64] * 5)
        return numba.njit(signature, error_model="numpy")(function)
    except numba.core.errors.NumbaError as error:
        raise InputError(
            f"function {getattr(function, '__name__', function)!r} cannot be compiled with Numba ({_first_line(error)}): "
            "choose one of SciPy's methods, such as method='DOP853'"
        ) from error


def _first_line(error: Exception) -> str:
    return next((line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__)


def compiled_functions(encoded: Encoded) -> tuple[tuple[Any, ...], NDArray[np.bool_]]:
    """The functions of the inputs compiled, with placeholders, and which of the six are in use."""
    from . import compiled

    used = np.array([f is not None for f in encoded.functions])
    return tuple(compiled.no_function if f is None else _compile_function(f) for f in encoded.functions), used


def _event_function(functions: Sequence[StateFunction]) -> Any:
    """One compiled function of (number, t, th2, u, w2, v) for all event functions."""
    import numba

    from . import compiled

    combined = compiled.no_event
    signature = numba.float64(numba.int64, *[numba.float64] * 5)
    for number, function in enumerate(functions):
        combined = _bind(number, _compile_function(function), combined, signature)
    return combined


def _bind(number: int, own: Any, other: Any, signature: Any) -> Any:
    import numba

    @numba.njit(signature)
    def chosen(i, t, th2, u, w2, v):  # type: ignore[no-untyped-def]
        if i == number:
            return own(t, th2, u, w2, v)
        return other(i, t, th2, u, w2, v)

    return chosen


def channels(
    encoded: Encoded, t: float, left: bool, x: NDArray[np.float64], law: NDArray[np.float64]
) -> tuple[float, float, float, float, float, float]:
    """Torque, speed, acceleration, slider force and load at time t and state x, for one who samples inputs in Python.

    ``left`` asks for the limit from the left where an input jumps. The user's functions are called as the Python they are.
    """
    from . import compiled as k

    e = encoded
    unused = np.zeros(6, dtype=bool)
    none = (k.no_function,) * 6
    torque, speed, acceleration, force, load_x, load_y = k.channels(
        t, left, x, e.breaks, e.coefficients, e.harmonics, law, unused, *none
    )
    added = [0.0 if f is None else float(f(t, x[0], x[1], x[2], x[3])) for f in e.functions]
    return (
        torque + added[0],
        speed + added[4],
        acceleration + added[5],
        force + added[1],
        load_x + added[2],
        load_y + added[3],
    )


@dataclass(slots=True)
class _Run:
    """One run, prepared: what both ways of solving it share."""

    parameters: FiveBarParameters
    inputs: Inputs
    encoded: Encoded
    initial: InitialState
    times: NDArray[np.float64]
    hold: float
    tolerance: float
    events: tuple[Event, ...]
    max_steps: int

    def start(self) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
        """State at the start, mechanical energy there, and the error scale."""
        p = self.parameters.constants()
        i = self.initial
        x = np.array([i.crank_angle, i.slider_position, i.crank_speed, i.slider_velocity, 0.0, 0.0])
        if self.inputs.speed_drive:
            x[2] = self.channels(float(self.times[0]), False, x, self.encoded.law)[1]
        if not np.all(np.isfinite(x)):
            raise InputError(f"the crank speed at the start is {x[2]}: it must be a finite number")
        scale = np.array(error_scale(self.parameters, float(x[2])))
        return x, dynamics.mechanical_energy(tuple(x), p), scale

    def channels(
        self, t: float, left: bool, x: NDArray[np.float64], law: NDArray[np.float64]
    ) -> tuple[float, float, float, float, float, float]:
        return channels(self.encoded, t, left, x, law)

    def compiled(self, progress: bool) -> Trajectory:
        from . import compiled as k

        begun = clock.perf_counter()
        p = self.parameters.constants()
        x, energy, scale = self.start()
        e = self.encoded
        functions, used = compiled_functions(e)
        callables = [event.function for event in self.events if event.function is not None]
        levels = np.zeros((len(self.events), 4))
        number = 0
        for row, event in zip(levels, self.events):
            if event.output is not None:
                row[:2] = OUTPUT_NAMES.index(event.output), event.level
            else:
                row[0] = -1 - number
                number += 1
            row[2:] = event.direction, event.stop
        f_event = _event_function(callables)
        n = len(self.times)
        states, forces = np.full((n, 6), np.nan), np.full((n, 6), np.nan)
        found = np.empty((MOST_EVENTS if self.events else 0, 8))
        carry = np.zeros(k.CARRY)
        carry[k.TIME] = self.times[0]
        law = torque_law(e)
        status = k.RUNNING
        interrupted = False
        with Progress(disable=not progress, transient=True) as bar:
            task = bar.add_task("simulate", total=self.times[-1] - self.times[0])
            try:
                while status == k.RUNNING and carry[k.STEPS] < self.max_steps:
                    status = k.run(
                        p, x, carry, self.times[-1], self.inputs.speed_drive, self.hold, e.steady, e.breaks,
                        e.coefficients, e.harmonics, law, used, *functions, self.tolerance, scale, self.times, states,
                        forces, levels, f_event, found, energy, min(STEPS_PER_CALL, self.max_steps),
                    )  # fmt: skip
                    bar.update(task, completed=carry[k.TIME] - self.times[0])
            except KeyboardInterrupt:
                interrupted = True
        done = int(carry[k.SAMPLE])
        t_end = float(carry[k.TIME])
        times = self.times[:done]
        states, forces = states[:done], forces[:done]
        if status not in (k.FINISHED, k.RUNNING) and (done == 0 or times[-1] < t_end):
            # the run ended between two samples: its last configuration is recorded too
            torque, _, acceleration, force, load_x, load_y = self.channels(t_end, True, x, law)
            last = np.array([float(self.inputs.speed_drive), torque, acceleration, force, load_x, load_y])
            times, states, forces = np.append(times, t_end), np.vstack([states, x]), np.vstack([forces, last])
        values = np.empty((len(times), len(OUTPUT_NAMES)))
        k.outputs(p, np.ascontiguousarray(states), np.ascontiguousarray(forces), energy, values)
        occurrences = tuple(
            Occurrence(self.events[int(row[0])].name, float(row[1]), (row[2], row[3], row[4], row[5]))
            for row in sorted(found[: int(carry[k.EVENTS])].tolist(), key=lambda row: row[1])
        )
        code, message = self._verdict(status, t_end, x)
        trajectory = Trajectory(
            time=times,
            values=values,
            status=code,
            message=message,
            events=occurrences,
            source="compiled DOP853",
            statistics={
                "steps": carry[k.STEPS] - carry[k.REJECTED],
                "rejected": carry[k.REJECTED],
                "evaluations": carry[k.EVALUATIONS],
                "seconds": clock.perf_counter() - begun,
            },
        )
        if interrupted:
            raise RunInterrupted(trajectory)
        if not np.all(np.isfinite(values)):
            lost = times[np.argmin(np.isfinite(values).all(axis=1))]
            raise InputError(f"an input is not finite: outputs are lost from t = {lost:.9g} s on")
        return trajectory

    def _verdict(self, status: int, t: float, x: NDArray[np.float64]) -> tuple[int, str]:
        from . import compiled as k

        where = f"crank angle {x[0]:.9g} rad ({np.degrees(x[0]):.4f} deg) and slider position {x[1]:.9g} m"
        if status == k.LIMIT:
            return 3, f"limit of assembly at t = {t:.9g} s, {where}"
        if status == k.NO_STEP:
            return 4, f"the step size fell below what t = {t:.9g} s can resolve, {where}"
        if status == k.RUNNING:
            return 4, f"{self.max_steps} steps did not suffice: stopped at t = {t:.9g} s, {where}"
        return 0, ""

    def scipy(self, method: str | type[OdeSolver], options: dict[str, Any], progress: bool) -> Trajectory:
        """The same run by `solve_ivp`, interval by interval of smooth inputs."""
        from . import compiled as k

        begun = clock.perf_counter()
        p = self.parameters.constants()
        x, energy, scale = self.start()
        e = self.encoded
        law = torque_law(e)
        speed_drive = float(self.inputs.speed_drive)
        end = self.times[-1]
        t = float(self.times[0])
        interval = 0
        first = True
        rows: list[NDArray[np.float64]] = []
        row_inputs: list[tuple[float, ...]] = []
        row_times: list[float] = []
        occurrences: list[Occurrence] = []
        evaluations = 0
        status = k.RUNNING
        interrupted = False

        with Progress(disable=not progress, transient=True) as bar:
            task = bar.add_task("simulate", total=end - t)
            try:
                while status == k.RUNNING:
                    if law[2] and x[0] >= law[1]:
                        law[2] = 0.0
                    torque, speed, acceleration, force, load_x, load_y = self.channels(t, False, x, law)
                    if self.hold:
                        stop = self.times[0] + (interval + 1) * self.hold
                        stop = end if stop > end - 1e-9 * self.hold else stop
                        ahead = stop if t < end else t + self.hold
                        if speed_drive:
                            acceleration = (self.channels(ahead, True, x, law)[1] - speed) / (ahead - t)
                    else:
                        later = e.breaks[1:-1][e.breaks[1:-1] > t]
                        stop = float(later[0]) if len(later) and later[0] < end else end
                    held = dynamics.Inputs(speed_drive, torque, acceleration, force, load_x, load_y)
                    if speed_drive:
                        x = np.array(
                            (x[0], x[1], speed, x[3], x[4], x[5]) if first else dynamics.jump_speed(tuple(x), speed, p)
                        )
                    first = False
                    if len(rows) < len(self.times) and self.times[len(rows)] <= t:
                        rows.append(x)
                        row_inputs.append(held)
                        row_times.append(t)
                    if t >= end:
                        status = k.FINISHED
                        break
                    constant = bool(self.hold) or e.steady

                    def inputs_at(
                        s: float,
                        y: NDArray[np.float64],
                        constant: bool = constant,
                        held: Any = held,
                        stop: float = stop,
                    ) -> dynamics.Inputs:
                        if constant:
                            return held  # type: ignore[no-any-return]
                        a = self.channels(s, s >= stop, y, law)
                        return dynamics.Inputs(speed_drive, a[0], a[2], a[3], a[4], a[5])

                    def rhs(s: float, y: NDArray[np.float64], inputs_at: Any = inputs_at) -> NDArray[np.float64]:
                        try:
                            return np.array(dynamics.derivative(tuple(y), inputs_at(s, y), p))
                        except (ArithmeticError, ValueError):
                            # not a configuration: with such an error the step is tried again shorter
                            return np.full(6, 1e200)

                    watched = self._scipy_events(p, energy, law, inputs_at)
                    inner = self.times[(self.times > t) & (self.times < stop)]
                    with np.errstate(over="ignore", invalid="ignore"):
                        solution = solve_ivp(
                            rhs,
                            (t, stop),
                            x,
                            method=method,
                            t_eval=np.append(inner, stop),
                            events=[function for _, function in watched],
                            rtol=max(self.tolerance, 3e-14),
                            atol=self.tolerance * scale,
                            **options,
                        )
                    evaluations += int(solution.nfev)
                    if solution.status < 0:
                        status = k.NO_STEP
                    here = [
                        (float(s), name, y)
                        for (name, _), ts, ys in zip(watched, solution.t_events, solution.y_events)
                        for s, y in zip(ts, ys)
                    ]
                    for s, name, y in sorted(here, key=lambda item: item[0]):
                        if isinstance(name, Event):
                            occurrences.append(Occurrence(name.name, s, tuple(y[:4])))
                    count = min(len(inner), int(np.sum(solution.t < stop)))
                    for s, y in zip(solution.t[:count], solution.y.T[:count]):
                        rows.append(y)
                        row_inputs.append(inputs_at(s, y))
                        row_times.append(float(s))
                    if solution.status == 1:
                        s, name, y = max(here, key=lambda item: item[0])
                        t, x = s, y.copy()
                        if name == "release":
                            x[0] = law[1]
                            law[2] = 0.0
                        else:
                            status = k.LIMIT if name == "limit" else k.EVENT
                            if not row_times or row_times[-1] < t:
                                rows.append(x)
                                row_inputs.append(inputs_at(t, x))
                                row_times.append(t)
                    elif solution.status == 0:
                        t, x = stop, solution.y[:, -1].copy()
                        interval += 1
                    bar.update(task, completed=t - self.times[0])
            except KeyboardInterrupt:
                interrupted = True
        values = np.array(
            [dynamics.outputs(tuple(y), dynamics.Inputs(*i), energy, p) for y, i in zip(rows, row_inputs)]
        ).reshape(-1, len(OUTPUT_NAMES))
        code, message = self._verdict(status, t, x)
        trajectory = Trajectory(
            time=np.array(row_times),
            values=values,
            status=code,
            message=message,
            events=tuple(occurrences),
            source=method if isinstance(method, str) else method.__name__,
            statistics={"evaluations": evaluations, "seconds": clock.perf_counter() - begun},
        )
        if interrupted:
            raise RunInterrupted(trajectory)
        return trajectory

    def _scipy_events(
        self, p: Any, energy: float, law: NDArray[np.float64], inputs_at: Callable[..., dynamics.Inputs]
    ) -> list[tuple[str | Event, Callable[[float, NDArray[np.float64]], float]]]:
        """Event functions for `solve_ivp`: the limit of assembly, the torsion bar's release, the user's."""

        def limit(t: float, y: NDArray[np.float64]) -> float:
            try:
                return float(p.branch * kinematics.position(y[0], y[1], p).s43 - kinematics.LIMIT_SINE)
            except (ArithmeticError, ValueError):
                return -1.0

        def release(t: float, y: NDArray[np.float64]) -> float:
            return float(y[0] - law[1])

        watched: list[tuple[str | Event, Any]] = [("limit", limit)]
        if law[2] and not self.hold:
            watched.append(("release", release))
        for _, function in watched:
            function.terminal = True
        release.direction = 1  # type: ignore[attr-defined]

        def of(event: Event) -> Callable[[float, NDArray[np.float64]], float]:
            if event.output is None:
                user = event.function
                assert user is not None

                def value(t: float, y: NDArray[np.float64]) -> float:
                    return float(user(t, y[0], y[1], y[2], y[3]))
            else:
                column = OUTPUT_NAMES.index(event.output)

                def value(t: float, y: NDArray[np.float64]) -> float:
                    return dynamics.outputs(tuple(y), inputs_at(t, y), energy, p)[column] - event.level

            value.terminal = event.stop  # type: ignore[attr-defined]
            value.direction = event.direction  # type: ignore[attr-defined]
            return value

        return watched + [(event, of(event)) for event in self.events]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ensemble:
    """Many runs over the same times.

    Attributes
    ----------
    time : ndarray, shape (n,)
    states : ndarray, shape (m, n, 6)
        (th2, u, th2', u', dissipated, supplied) of every run; NaN after a run that ended early, as ``counts`` tells.
    forces : ndarray, shape (m, n, 6)
        Inputs at the samples, as `linkwork.five_bar.dynamics.Inputs`.
    status : ndarray of int, shape (m,)
        solver.status of each run.
    counts : ndarray of int, shape (m,)
        Samples that each run reached.
    """

    time: NDArray[np.float64]
    states: NDArray[np.float64]
    forces: NDArray[np.float64]
    status: NDArray[np.int64]
    counts: NDArray[np.int64]
    parameters: tuple[FiveBarParameters, ...]
    energies: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.parameters)

    def __getitem__(self, index: int) -> Trajectory:
        """One run as a `Trajectory`."""
        from . import compiled as k

        n = int(self.counts[index])
        values = np.empty((n, len(OUTPUT_NAMES)))
        states = np.ascontiguousarray(self.states[index, :n])
        forces = np.ascontiguousarray(self.forces[index, :n])
        k.outputs(self.parameters[index].constants(), states, forces, self.energies[index], values)
        status = int(self.status[index])
        message = "" if status == 0 else f"run {index} ended after {n} of {len(self.time)} samples"
        return Trajectory(time=self.time[:n], values=values, status=status, message=message, source="compiled DOP853")

    def output(self, name: str) -> NDArray[np.float64]:
        """One output of all runs, shape (m, n), masked after the end of a run that ended early."""
        result = np.ma.masked_all((len(self), len(self.time)))
        for i in range(len(self)):
            run = self[i]
            result[i, : len(run)] = run[name]
        return result


def simulate_many(
    parameters: Sequence[FiveBarParameters],
    inputs: Inputs | Sequence[Inputs] | None = None,
    *,
    initial: InitialState | Sequence[InitialState] | None = None,
    stop_time: float,
    step: float = 1e-3,
    start_time: float = 0.0,
    hold: float | None = None,
    tolerance: float = 1e-9,
    batch: int = 64,
    n_jobs: int | None = None,
    progress: bool = False,
) -> Ensemble:
    """Run many mechanisms, or one under many inputs, in batches of one compiled call each.

    ``inputs`` and ``initial`` are one for all or as many as ``parameters``; all inputs must drive the same way and share
    their Python functions, if they have any. The batches go through joblib: ``n_jobs`` cores here, or, inside
    ``joblib.parallel_config(backend="dask")`` or ``"ray"``, the cores of a cluster.

    Raises
    ------
    InputError, ParameterError, AssemblyError
        As `simulate`; the sentence names the run.
    """
    m = len(parameters)
    all_inputs = _each(inputs or Inputs(), m, "inputs")
    starts = _each(initial or InitialState(), m, "initial states")
    if m == 0:
        raise InputError("an ensemble needs at least one set of parameters")
    check_tolerance(tolerance)
    times = _check_samples(sample_times(stop_time, step, start_time))
    if hold is not None:
        _check_hold(hold, times)
    if len({i.speed_drive for i in all_inputs}) > 1:
        raise InputError("an ensemble's inputs must all give the speed or all the torque")
    runs = []
    for number, (p, i, s) in enumerate(zip(parameters, all_inputs, starts)):
        try:
            check_assembly(p, s.crank_angle, s.slider_position)
            runs.append(_Run(p, i, encode(i), s, times, hold or 0.0, tolerance, (), 0))
        except LinkworkError as error:
            raise type(error)(f"run {number}: {error}") from error
    if len({tuple(map(id, r.encoded.functions)) for r in runs}) > 1:
        raise InputError("an ensemble's inputs must share their Python functions")
    batches = [runs[k : k + batch] for k in range(0, m, batch)]
    tasks = (joblib.delayed(_run_batch)(b) for b in batches)
    if progress:
        results = list(
            track(
                joblib.Parallel(n_jobs=n_jobs, return_as="generator")(tasks),
                total=len(batches),
                description="simulate",
                transient=True,
            )
        )
    else:
        results = joblib.Parallel(n_jobs=n_jobs)(tasks)
    states, forces, status, counts, energies = (np.concatenate(column) for column in zip(*results))
    return Ensemble(
        time=times,
        states=states,
        forces=forces,
        status=status,
        counts=counts,
        parameters=tuple(parameters),
        energies=energies,
    )


def _each(value: Any, count: int, what: str) -> list[Any]:
    if isinstance(value, (Inputs, InitialState)):
        return [value] * count
    if len(value) != count:
        raise InputError(f"{len(value)} {what} for {count} sets of parameters: give one, or as many")
    return list(value)


def _run_batch(runs: Sequence[_Run]) -> tuple[NDArray[Any], ...]:
    """One compiled call for a batch of prepared runs."""
    from . import compiled as k

    m, n = len(runs), len(runs[0].times)
    encoded = [run.encoded for run in runs]
    pieces = max(len(e.coefficients) for e in encoded)
    waves = max(len(e.harmonics) for e in encoded)
    breaks = np.empty((m, pieces + 1))
    coefficients = np.zeros((m, pieces, 5, 4))
    harmonics = np.zeros((m, waves, 4))
    laws = np.array([e.law for e in encoded])
    starts, energies, scales = np.empty((m, 6)), np.empty(m), np.empty((m, 6))
    for i, (run, e) in enumerate(zip(runs, encoded)):
        have = len(e.coefficients)
        # the last piece again and again, long after the run: breaks must increase
        far = max(e.breaks[-1], run.times[-1]) + 1.0 + np.arange(pieces + 1 - have - 1)
        breaks[i] = np.concatenate([e.breaks, far])
        coefficients[i, :have] = e.coefficients
        if have < pieces:
            coefficients[i, have:] = _on_late_breaks(e, breaks[i, have:-1])
        harmonics[i, : len(e.harmonics)] = e.harmonics
        starts[i], energies[i], scales[i] = run.start()
    functions, used = compiled_functions(encoded[0])
    states, forces = np.full((m, n, 6), np.nan), np.full((m, n, 6), np.nan)
    carries = np.zeros((m, k.CARRY))
    carries[:, k.TIME] = runs[0].times[0]
    status = np.empty(m, dtype=np.int64)
    k.run_many(
        np.array([run.parameters.constants() for run in runs]), starts, energies, runs[0].times[-1],
        runs[0].inputs.speed_drive, runs[0].hold, all(e.steady for e in encoded), breaks, coefficients, harmonics, laws,
        used, *functions, k.no_event, runs[0].tolerance, scales, runs[0].times, states, forces, carries, status, 2**62,
    )  # fmt: skip
    return states, forces, np.where(status == k.RUNNING, 4, status), carries[:, k.SAMPLE].astype(np.int64), energies


def _on_late_breaks(e: Encoded, left: NDArray[np.float64]) -> NDArray[np.float64]:
    """The last polynomials of ``e`` about later left ends."""
    c = e.coefficients[-1]
    return np.array(
        [
            np.column_stack(
                [
                    c[:, 0] + s * (c[:, 1] + s * (c[:, 2] + s * c[:, 3])),
                    c[:, 1] + s * (2.0 * c[:, 2] + 3.0 * s * c[:, 3]),
                    c[:, 2] + 3.0 * s * c[:, 3],
                    c[:, 3],
                ]
            )
            for s in left - e.breaks[-2]
        ]
    )
