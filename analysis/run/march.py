"""Solve a run with an ODE method of SciPy, or another method with its interface, independently of the compiled solver."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import integrate
from scipy.integrate import BDF, LSODA, OdeSolver, Radau, solve_ivp

from linkwork.integrate import UNDEFINED
from linkwork.limits import LIMIT_SINE, NEAR_LIMIT

from . import records as k
from .cautions import output_cautions
from .events import Event, RunInterrupted, show_progress
from .locating import SAME
from .prepared import Run, verdict
from .sampling import NotFiniteError, release, sample
from .trajectory import Occurrence, Trajectory

#: Number of evaluations without a value, at almost the same time, after which an implicit method is stopped: LSODA itself would
#: never stop.
MOST_LOSSES = 300

#: What can end an interval early: an event of the user, the index of a torsion bar that is released, or None for the limit
#: of assembly.
What = Event | int | None


def solve(run: Run, method: str | type[OdeSolver], options: dict[str, Any], progress: bool) -> Trajectory:
    """Solve a run with `solve_ivp`, one interval of smooth inputs after the other."""
    begun = clock.perf_counter()
    march = March(run)
    interrupted = False
    with show_progress(progress, run.settings.times[-1] - run.settings.times[0]) as show:
        try:
            march.run(method, options, show if progress else None)
        except KeyboardInterrupt:
            interrupted = True
    names = run.mechanism.output_names
    rows = march.rows
    if rows and rows[-1][0] < march.t:
        rows = [*rows, (march.t, march.x, march.held)]
    values = [march.outputs(x, held) for _, x, held in rows]
    code, message = verdict(run.mechanism, run.settings, march.status, march.t, march.x, run.limit)
    if march.status == k.NO_STEP:
        message += f": {run.describe_failed_step(march.good[1])}"
    table = np.array(values).reshape(-1, len(names))
    time = np.array([t for t, _, _ in rows])
    caution = output_cautions(run.mechanism, time, table, None if code else run.settings.tolerance)
    message = "; ".join(filter(None, (message, caution)))
    trajectory = Trajectory(
        time=time,
        values=table,
        names=names,
        status=code,
        message=message,
        events=tuple(sorted(march.occurrences, key=lambda o: o.time)),
        parameters=run.parameters,
        source=method if isinstance(method, str) else method.__name__,
        statistics={"evaluations": float(march.evaluations), "seconds": clock.perf_counter() - begun},
    )
    if interrupted:
        raise RunInterrupted(trajectory)
    return trajectory


class March:
    """A run with `solve_ivp`: the loop of `compiled.run` over the intervals of smooth inputs, in Python.

    Equations and sampling of inputs are the same as in the compiled code, integrator and root finder are not.
    """

    def __init__(self, run: Run) -> None:
        self.of = run
        self.equations = run.mechanism.equations
        self.settings = run.settings
        start = run.start()
        self.x, self.energy, self.scale = start.x, start.energy, start.scale
        self.laws = run.encoded.source.laws.copy()
        #: components of the state that are the angles of torsion bars
        self.angles = run.encoded.source.law_places[:, 1].tolist()
        self.t = float(run.settings.times[0])
        #: inputs in force, in the form that the equations take
        self.held: Any = None
        self.rows: list[tuple[float, NDArray[np.float64], Any]] = []
        self.occurrences: list[Occurrence] = []
        self.evaluations = 0
        self.status = k.RUNNING
        #: index of the channel that was not finite inside a step (the step is then repeated with a shorter length), and how
        #: many evaluations had no value
        self._lost: int | None = None
        self.losses = 0
        #: times in the present interval count as equal if they differ by less than this (s)
        self.same = 0.0
        #: replaces a derivative without a value: 1e200 makes the error large, NaN ends the iterations of Radau and BDF
        self.nothing = 1e200
        #: latest time at which the derivative had a value, and the state there
        self.good = self.t, self.x
        #: value of each event at the end of the last interval; zero if the event happened there
        self._gaps: list[float] | None = None

    def _end_of_interval(self, interval: int) -> float:
        times, breaks = self.settings.times, self.of.encoded.source.breaks[1:-1]
        if self.settings.hold:
            return float(times[interval + 1] if interval + 1 < len(times) else times[-1])
        later = breaks[(breaks > self.t) & (breaks < times[-1])]
        return float(later[0] if len(later) else times[-1])

    def _sample(self, stop: float) -> NDArray[np.float64]:
        """Sample the inputs at the beginning of an interval that ends at ``stop``; return the channels."""
        e, t, end = self.of.encoded, self.t, self.settings.times[-1]
        if self.settings.hold:
            ahead = stop if t < end else t + self.settings.hold
            u = sample(e, t, self.x, self.laws, ahead=ahead)
        else:
            u = sample(e, t, self.x, self.laws)
        self.held = self.of.apply_inputs(u)
        return u

    def run(self, method: str | type[OdeSolver], options: dict[str, Any], show: Callable[[float], None] | None) -> None:
        """Integrate until the end, a stopping event, the limit of assembly, or a failure of the integrator."""
        times, end = self.settings.times, self.settings.times[-1]
        method, interval = self._with_early_end(method), 0
        while True:
            stop = self._end_of_interval(interval)
            release(self.of.encoded, self.x, self.laws)
            u = self._sample(stop)
            if len(self.of.encoded.commands) and self._gaps is not None:
                self.x = np.array(self.equations.jump(tuple(self.x), self.held, tuple(u), self.of.p))
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
        """Record events caused by jumps of the inputs."""
        gaps = [self._gap(event, self.t, self.x, self.held) for event in self.of.events]
        if self._gaps is not None:
            # a zero marks an event that was just reported: wait until the value leaves zero
            gaps = [before and gap for before, gap in zip(self._gaps, gaps)]
        for event, before, after in zip(self.of.events, self._gaps or gaps, gaps):
            up = before < 0.0 <= after and event.direction >= 0
            down = before > 0.0 >= after and event.direction <= 0
            if up or down:
                self.occurrences.append(Occurrence(event.name, self.t, tuple(self.x[:-2].tolist())))
                if event.stop:
                    self.status = k.EVENT
        self._gaps = gaps

    def _gap(self, event: Event, t: float, x: NDArray[np.float64], held: Any) -> float:
        if event.function is not None:
            return float(event.function(t, *x[:-2].tolist()))
        column = event.column(self.of.mechanism)
        return float(self.outputs(x, held)[column] - event.level)

    def _inputs(self, t: float, x: NDArray[np.float64], stop: float) -> Any:
        if self.settings.hold or (self.of.encoded.steady and not self.laws[:, 2].any()):
            return self.held
        return self.of.apply_inputs(sample(self.of.encoded, t, x, self.laws, left=t >= stop))

    def _derivative(self, t: float, x: NDArray[np.float64], stop: float) -> NDArray[np.float64]:
        # without a configuration or an input, such a derivative makes the method repeat the step with a shorter length
        nothing = np.full(len(x), self.nothing)
        try:
            held = self._inputs(t, x, stop)
        except NotFiniteError as error:
            self._lost = error.number
            self.losses += 1
            return nothing
        result = self._value(x, held)
        if result is None:
            self.losses += 1
            return nothing
        # a stage of a step that is too long may be anywhere
        if t > self.good[0] and np.abs(x).max() < 1e100:
            self.good = t, x.copy()
        return result

    def _value(self, x: NDArray[np.float64], held: Any) -> NDArray[np.float64] | None:
        """Return the derivative at a state, or None if the equations have no value there."""
        try:
            return np.array(self.equations.derivative(tuple(x), held, self.of.p))
        except UNDEFINED:
            return None

    def _with_early_end(self, method: str | type[OdeSolver]) -> str | type[OdeSolver]:
        """Return a method that fails as soon as it reaches a state at which the equations have no value.

        Only SciPy's implicit methods are changed: they might accept such a state, or repeat the step for ever.
        """
        kind = getattr(integrate, method) if isinstance(method, str) else method
        if not issubclass(kind, (BDF, LSODA, Radau)):
            return method
        march = self
        self.nothing = 1e200 if issubclass(kind, LSODA) else np.nan

        class Ending(kind):  # type: ignore[misc, valid-type]
            reached = -np.inf

            def _step_impl(self) -> tuple[bool, str | None]:
                try:
                    done, message = super()._step_impl()
                except ValueError:  # a Jacobian with NaN
                    return False, self.TOO_SMALL_STEP
                if self.t > self.reached + march.same:
                    self.reached, march.losses = self.t, 0
                value = march._value(self.y, march.held)
                if march.losses > MOST_LOSSES or value is None or not np.isfinite(value).all():
                    return False, self.TOO_SMALL_STEP
                return done, message

        return Ending

    def _clearance(self, x: NDArray[np.float64]) -> float:
        """Return how far a state is from the limit of assembly; it is negative beyond."""
        try:
            found = float(self.equations.clearance(tuple(x), self.held, self.of.p) - LIMIT_SINE)
        except UNDEFINED:
            return -1.0
        return -1.0 if np.isnan(found) else found

    def outputs(self, x: NDArray[np.float64], held: Any) -> tuple[float, ...]:
        """Return the outputs at a state; all are NaN if the equations have no value there, for example a spring's law."""
        try:
            found: tuple[float, ...] = self.equations.outputs(tuple(x), held, self.energy, self.of.p)
        except UNDEFINED:
            return (np.nan,) * len(self.of.mechanism.output_names)
        return found

    def _interval(
        self, stop: float, method: str | type[OdeSolver], options: dict[str, Any], show: Callable[[float], None] | None
    ) -> bool:
        """Integrate up to ``stop`` and return whether it was reached."""
        t0, x0 = self.t, self.x
        times = self.settings.times
        watched = self._event_functions(stop)
        self._lost, self.losses, self.good, self.same = None, 0, (t0, x0), SAME * (stop - t0)

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
                rtol=max(self.settings.tolerance, 3e-14),
                atol=self.settings.tolerance * self.scale,
                **options,
            )
        self.evaluations += int(solution.nfev)
        # `watched` has the limit and the releases first, so that they come first among simultaneous events
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
                self.occurrences.append(Occurrence(event.name, t, tuple(x[:-2].tolist())))
        # SciPy returns empty lists if an event comes before the first of the times
        for t, x in zip(solution.t, np.ascontiguousarray(np.asarray(solution.y).T)):
            if self._clearance(x) < 0.0:  # a step passed over the limit, and no event was seen
                self.t, self.x, self.status = *(self.rows[-1][:2] if self.rows[-1][0] > t0 else (t0, x0)), k.LIMIT
                return False
            if t < stop:
                self.rows.append((float(t), x, self._inputs(t, x, stop)))
        what: What = None
        if solution.status == 1:
            t_cut = happened[-1][0]
            ending = (
                item for item in happened if item[0] == t_cut and (not isinstance(item[1], Event) or item[1].stop)
            )
            _, what, self.x = next(ending)
            self.t, self.x = t_cut, self.x.copy()
            if isinstance(what, int):
                self.x[self.angles[what]] = self.laws[what, 1]
            else:
                self.status = k.EVENT if what else k.LIMIT
        elif solution.status == 0:
            self.t, self.x = stop, solution.y[:, -1].copy()
        else:
            if self.rows[-1][0] > t0:
                self.t, self.x = self.rows[-1][:2]
            if self._lost is not None:
                raise NotFiniteError(self.of.encoded, self._lost, *self.good)
            clearance = self.equations.clearance(tuple(self.x), self.held, self.of.p)
            self.status = k.LIMIT if abs(clearance) < NEAR_LIMIT else k.NO_STEP
        self.held = self._inputs(self.t, self.x, stop)
        # an event at the release or at the end of the interval must be reported exactly once: if it has not been reported
        # here, it is left to the beginning of the next interval
        same = SAME * (self.t - t0)
        just_now = [event for t, event, _ in happened if t >= self.t - same]
        before = self.x - same * self._derivative(self.t, self.x, stop)
        self._gaps = [
            0.0 if event in just_now else self._gap(event, self.t - same, before, self.held) for event in self.of.events
        ]
        if isinstance(what, int):
            self.laws[what, 2] = 0.0
        return bool(solution.status == 0)

    def _event_functions(self, stop: float) -> list[tuple[What, Callable[[float, NDArray[np.float64]], float]]]:
        """Return events and their functions for `solve_ivp`: limit of assembly, release of torsion bars, events of the user."""

        def limit(t: float, x: NDArray[np.float64]) -> float:
            return self._clearance(x)

        def unwound(n: int) -> Callable[[float, NDArray[np.float64]], float]:
            def value(t: float, x: NDArray[np.float64]) -> float:
                return float(x[self.angles[n]] - self.laws[n, 1])

            value.direction = 1  # type: ignore[attr-defined]
            return value

        watched: list[tuple[What, Any]] = [(None, limit)]
        if not self.settings.hold:
            watched += [(n, unwound(n)) for n in np.flatnonzero(self.laws[:, 2]).tolist()]
        for _, function in watched:
            function.terminal = True

        t0, x0 = self.t, self.x
        # SciPy reports an event whose function starts at zero: the first value gets the sign of the values that follow
        x1 = x0 + 1e-6 * (stop - t0) * self._derivative(t0, x0, stop)

        def watch(event: Event, start: float) -> Callable[[float, NDArray[np.float64]], float]:
            def value(t: float, x: NDArray[np.float64]) -> float:
                if t == t0:
                    gap = start or self._gap(event, t0 + 1e-6 * (stop - t0), x1, self._inputs(t0, x1, stop))
                else:
                    gap = self._gap(event, t, x, self._inputs(t, x, stop))
                return gap or 1e-300

            value.terminal = event.stop  # type: ignore[attr-defined]
            value.direction = event.direction  # type: ignore[attr-defined]
            return value

        return watched + [(event, watch(event, start)) for event, start in zip(self.of.events, self._gaps or [])]
