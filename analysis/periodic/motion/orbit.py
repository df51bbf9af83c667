"""Find periodic motions of the full nonlinear mechanism with their Floquet multipliers.

At prescribed speed a periodic motion repeats itself after one turn of the crank, or after several; under a torque the mean
speed is part of the solution. `newton_orbit` solves y(T) = y(0) for the state y by Newton's method, with the exact monodromy
matrix from the variational equations. The eigenvalues of this matrix, the Floquet multipliers, come with every solution.
Unstable motions are found as easily as stable motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, reduce
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError

from ...display import NotebookResult, format_count, format_rounds
from ...files import Whole, unknown_name
from ...mechanisms import Parameters, find_mechanism
from ...numerics.continuation import Evaluation
from ...run import Inputs, compute_outputs, takes_published
from ...units import RAD_S_PER_RPM
from . import discretisation, kernels
from .discretisation import Discretisation, Ends, OperatingPoint, OrbitError, Stations, operating_point, orbit_error
from .drive import Drive, mean_rates, spread_starts, start_ranges
from .flow import PLAIN, STATE, TOLERANCE, VARIATIONAL, Flow, StabilityVerdict, liouville, multipliers, verdict
from .kernels import Status
from .variables import Family

FloatArray = NDArray[np.float64]
#: Largest correction relative to the scale at which a solution counts as found.
ORBIT_TOLERANCE = 100.0 * discretisation.INTEGRATOR_TOLERANCE
#: Search for motions far from a guess: tolerance, iterations at most, and the greatest correction relative to the scale of y.
#: A motion that is found is solved again with the full tolerance.
SEARCH_TOLERANCE, SEARCH_ITERATIONS, REACH = 1e-6, 30, 1.0
#: Number of pieces of a common period in the search for motions near a uniform rotation.
EVEN_PIECES = 12
#: Number of sets of starts if Newton's method fails from the guess, and number of starts in each set, a power of two: near a
#: resonance with small damping about one start in forty leads to the motion.
SETS, STARTS = 4, 64
#: Newton iterations at most.
MOST_ITERATIONS = 40
#: Greatest number of turns for which a motion is followed if Newton's method fails from the guess, and change per turn below
#: which it is steady.
SETTLING_TURNS, SETTLED = 200, 1e-4
#: Number of samples of a turn for amplitudes and harmonics.
SAMPLES = 256
#: Greatest number of samples of a turn where a motion is sharp, as at a stop, and size of the highest harmonics,
#: relative to the greatest harmonic, above which there are more samples.
_MOST_SAMPLES, _SHARP = 8192, 1e-5
#: Error of an amplitude, relative to the scale of the coordinate: a little more than the error of the orbits.
_ROUNDING = 10.0 * ORBIT_TOLERANCE
#: Outputs that an orbit does not have: energies that accumulate from the start of a run.
OF_A_RUN = ("energy.dissipated", "energy.supplied", "energy.residual")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Turn:
    """One period of an orbit, sampled at equal steps of the crank angle; the end of the period is not a sample.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        Crank angle (rad), from 0.
    time : ndarray, shape (n,)
        Time (s), from 0.
    period : float
        Period (s).
    states, inputs : ndarray, shapes (n, states) and (n, channels)
        States as in a run, and values of the input channels. The dissipated and the supplied work in the states are zero.
    values : ndarray, shape (n, outputs)
        Outputs by `names`: those of the FMI interface except the energies that count from the start of a run.
    turns : int
        Turns of the crank in the period.
    modes : tuple of int
        Values of the mechanism's modes.
    names : tuple of str
    swings : tuple of str
        Outputs that have `amplitudes`: the free coordinates, such as ``slider.position``, or the crank's speed if
        nothing else is free.
    roundings : tuple of float
        Amplitudes of ``swings`` up to these sizes count as rounding errors.
    angles : frozenset of str
        Outputs that are angles.

    Notes
    -----
    ``turn["slider.position"]`` is an output over the period, shape (n,).
    """

    angle: FloatArray
    time: FloatArray
    period: float
    states: FloatArray
    inputs: FloatArray
    values: FloatArray
    turns: int
    modes: tuple[int, ...]
    names: tuple[str, ...]
    swings: tuple[str, ...]
    roundings: tuple[float, ...]
    angles: frozenset[str]

    def __repr__(self) -> str:
        sizes = ", ".join(f"{name} {size:.4g}" for name, size in zip(self.swings, self.amplitudes))
        turns = format_count(self.turns, "turn")
        return f"<Turn: {len(self.angle)} samples of {turns} in {self.period:.4g} s; amplitudes in SI: {sizes}>"

    def __getitem__(self, name: str) -> FloatArray:
        if name not in self.names:
            raise unknown_name(name, self.names, f"output {name!r} of an orbit")
        return self.values[:, self.names.index(name)]

    @property
    def amplitude(self) -> float:
        """The amplitude of the first of ``swings``."""
        return self.swing_amplitude(self.swings[0])

    @property
    def amplitudes(self) -> FloatArray:
        """The amplitude of each of ``swings``."""
        return np.array([self.swing_amplitude(name) for name in self.swings])

    def swing_amplitude(self, name: str) -> float:
        """Return half the distance between the least and the greatest value of one of ``swings``, such as a position (m).

        For a coordinate that goes round, the deviation from a uniform rotation is taken. An amplitude is zero if it is no more
        than a rounding error, as for a pendulum that hangs still.

        The Fourier series of the coordinate is evaluated on a grid eight times as fine, and parabolas are laid through the
        greatest and the least values. The relative error of an amplitude is about 1e-6 if there are enough samples for the
        series.
        """
        if name not in self.swings:
            raise unknown_name(name, self.swings, f"free coordinate {name!r}")
        u = self.oscillation(name)
        n = 8 * len(u)
        fine = np.fft.irfft(np.fft.rfft(u), n) * (n / len(u))
        top = np.array([fine.argmax(), fine.argmin()])
        before, at, after = fine[top - 1], fine[top], fine[(top + 1) % n]
        bend = before - 2.0 * at + after
        beyond = np.divide((after - before) ** 2, -8.0 * bend, out=np.zeros(2), where=bend != 0.0)
        size = 0.5 * float(np.ptp(at + beyond))
        return size if size > self.roundings[self.swings.index(name)] else 0.0

    def oscillation(self, name: str) -> FloatArray:
        """Return an output, shape (n,); for an angle that goes round, return the deviation from a uniform rotation."""
        values = self[name]
        if name not in self.angles:
            return values
        followed = np.unwrap(np.append(values, values[0]))
        increase = followed[-1] - followed[0]
        return followed[:-1] - increase * np.arange(len(values)) / len(values) if increase else values

    def harmonic(self, name: str, order: float) -> float:
        """Return the amplitude of a harmonic of an output; ``order`` is the number of cycles per turn of the crank.

        For a coordinate that goes round, the deviation from a uniform rotation is taken.

        Raises
        ------
        InputError
            If the period is not a whole number of cycles of the harmonic, or there are too few samples for the harmonic.
        """
        number = order * self.turns
        if number != int(number) or not 0 < number < len(self.angle) / 2:
            raise InputError(
                f"order {order} of an orbit of {self.turns} turn(s) with {len(self.angle)} samples: its orders are "
                f"multiples of 1/{self.turns} up to {(len(self.angle) - 1) // 2 / self.turns:g}"
            )
        return 2.0 * float(np.abs(np.fft.rfft(self.oscillation(name))[int(number)])) / len(self.angle)


def _is_sharp(samples: FloatArray, rounding: float) -> bool:
    """Return whether the highest harmonics of samples over a period are neither negligible nor rounding errors."""
    size = np.abs(np.fft.rfft(samples))[1:] * (2.0 / len(samples))
    return bool(size[3 * len(size) // 4 :].max() > max(_SHARP * size.max(), rounding))


def _time(speed: FloatArray, way: float) -> tuple[FloatArray, float]:
    """Integrate 1 / speed over the crank angle by its Fourier series; return the time at equal steps, and the period.

    ``speed`` are samples of the crank speed; ``way`` is the crank angle of a period (rad).
    """
    n = len(speed)
    c = np.fft.rfft(1.0 / speed) / n
    angle = np.arange(n) * (way / n)
    k = np.arange(len(c)) * (2.0 * pi / way)
    integral = np.zeros(len(c), dtype=complex)
    integral[1:] = c[1:] / (1j * k[1:])
    if n % 2 == 0:
        integral[-1] = 0.0
    wave = np.fft.irfft(integral * n, n)
    mean = float(c[0].real)
    return mean * angle + wave - wave[0], way * mean


@dataclass(frozen=True, eq=False, kw_only=True)
class PeriodicOrbit(NotebookResult):
    """A periodic motion of the full nonlinear mechanism.

    Attributes
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    turns : int
        Number of common periods, `Flow.period`, in one period of the motion; `crank_turns` is the number of turns of the crank.
    start : ndarray, shape (n,)
        State y at crank angle 0: first the coordinates, then the rates, of the free degrees of freedom other than the crank;
        last, if a torque drives the crank, the crank speed (rad/s). For a five-bar: u (m), u' (m/s).
    monodromy : ndarray, shape (n, n)
        Derivatives of y after one period with respect to y at crank angle 0.
    residual : float
        ``|y(T) - y(0)|`` relative to `motion_scales`, before the last correction.
    iterations : int
        Newton iterations taken.
    stations : Stations or None
        The pieces of the period, if the motion is too unstable to be followed in one piece.
    others : int or None
        Number of other periodic motions found with the same period; None if no other motions were sought.
    least_clearance : float or None
        Least clearance to the limit of assembly, see `clearance`; None if it was not computed together with the motion.
    """

    parameters: Parameters
    drive: Drive
    turns: int
    start: FloatArray
    monodromy: FloatArray
    residual: float
    iterations: int
    stations: Stations | None = None
    others: int | None = None
    least_clearance: float | None = None

    def __post_init__(self) -> None:
        if not np.isfinite(self.monodromy).all():
            raise InputError("a monodromy matrix is not finite")

    def __repr__(self) -> str:
        try:
            turn, unit = self.turn(), self.swing[1]
            speed = self.flow.period * self.turns / turn.period
            said = f" at {speed:.4g} rad/s ({speed / RAD_S_PER_RPM:.4g} rpm), {self.verdict().stability.value}"
            swing = f"; amplitude of {turn.swings[0]} {turn.amplitude:.4g} {unit}"
        except LinkworkError as error:
            said, swing = f" that cannot be followed ({error})", ""
        turns = format_count(self.crank_turns, "turn")
        swing += format_rounds(self.rounds, "; ")
        others = f"; {format_count(self.others, 'other motion')} there: find_orbits" if self.others else ""
        return f"<PeriodicOrbit: {turns}{said}, largest Floquet multiplier {self.largest:.4g}{swing}{others}>"

    @cached_property
    def point(self) -> OperatingPoint:
        """The mechanism and its drive as arrays for the kernels."""
        return operating_point(self.parameters, self.drive)

    @property
    def flow(self) -> Flow:
        """The mechanism with its drive as a flow, which has the names and units of y."""
        return self.point.flow

    @cached_property
    def scale(self) -> FloatArray:
        """Scale of each component of y, its typical magnitude, shape (n,): see `motion_scales`."""
        return self.point.scale(self.start)

    @property
    def periods(self) -> int:
        """Number of common periods of the cranks and gears in a period of the motion: several if links go round slowly."""
        return self.turns * self.flow.commons

    @property
    def crank_turns(self) -> int:
        """Number of turns of the crank in a period of the motion."""
        return self.turns * self.flow.turns

    @property
    def rounds(self) -> dict[str, int]:
        """Number of whole turns per period of each undriven link that goes round, by the FMI name of its coordinate."""
        flow, paces = self.flow, self.flow.paces(self.point.vector)
        way = flow.period * self.turns
        return {name: round(paces[name] * way / flow.turn(i)) for name, i in flow.swinging.items() if name in paces}

    @property
    def swing(self) -> tuple[str, str]:
        """Short name and unit of the coordinate to which `amplitude` refers: ``("u", "m")`` for a five-bar."""
        return self.swings[0]

    @property
    def swings(self) -> tuple[tuple[str, str], ...]:
        """Short names and units of the coordinates to which `amplitudes` refer: all that are free."""
        flow = self.flow
        return tuple((flow.labels[n], flow.components[n][1]) for n in range(flow.swing_count))

    @cached_property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, the largest modulus first, shape (n,)."""
        return multipliers(self.monodromy)

    def distance(self, start: FloatArray) -> float:
        """Return the greatest difference of a start y from this orbit's start, relative to the scale, without whole turns."""
        return float((np.abs(self.flow.remove_turns(start - self.start)) / self.scale).max())

    @property
    def largest(self) -> float:
        """Largest modulus of the Floquet multipliers."""
        return float(abs(self.multipliers[0]))

    def verdict(self, tolerance: float = TOLERANCE) -> StabilityVerdict:
        """Return the verdict on stability: whether small deviations die out, and with what margin; see `flow.verdict`."""
        return verdict(self.multipliers, tolerance)

    def sample(self, angles: ArrayLike) -> FloatArray:
        """Return the state of a run and the channels at increasing crank angles (rad), shape (m, states + inputs).

        Raises OrbitError if the integration fails.
        """
        places = np.array(angles, dtype=float, ndmin=1)
        rows = np.empty((len(places), self.point.mechanism.size + self.flow.inputs))
        stations, starts = (np.zeros(1), self.start[None, :].copy())
        if self.stations is not None:
            stations, starts = self.stations.angles[:-1].copy(), self.stations.starts
        section = self.point.section(self.start, PLAIN, STATE)
        status = kernels.sample(section, stations, starts, places, rows)
        if status != Status.DONE:
            raise orbit_error(status, self.flow, self.start)
        return rows

    @property
    def run_inputs(self) -> Inputs:
        """Inputs that give a run the drive of this motion."""
        return self.drive.inputs(self.point.mechanism)

    def turn(self, samples: int | None = None) -> Turn:
        """Return the outputs over one period at equal steps of the crank angle, by default `SAMPLES` per turn of the crank."""
        flow, mechanism = self.flow, self.point.mechanism
        samples = samples or SAMPLES * self.crank_turns
        angles = np.linspace(0.0, flow.period * self.turns, samples, endpoint=False)
        rows = self.sample(angles)
        states, channels = rows[:, : mechanism.size], rows[:, mechanism.size :]
        modes = np.array(flow.modes, dtype=float)
        values = compute_outputs(mechanism, modes, np.append(self.point.constants, 0.0), states, channels)
        keep = [n for n, name in enumerate(mechanism.output_names) if name not in OF_A_RUN]
        time, period = _time(states[:, len(mechanism.freedoms) + flow.crank], flow.period * self.turns)
        return Turn(
            angle=angles,
            time=time,
            period=period,
            states=states,
            inputs=channels,
            values=values[:, keep],
            turns=self.crank_turns,
            modes=flow.modes,
            names=tuple(mechanism.output_names[n] for n in keep),
            swings=tuple(name for name, _ in flow.components[: flow.swing_count]),
            roundings=tuple((_ROUNDING * self.scale[: flow.swing_count]).tolist()),
            angles=frozenset(v.name for v in mechanism.variables if v.unit == "rad"),
        )

    def resolved_turn(self, outputs: Sequence[str]) -> Turn:
        """Return the outputs as `turn` does, with as many samples as the Fourier series of the named outputs need."""
        turn, most = self.turn(), _MOST_SAMPLES * self.crank_turns
        roundings = dict(zip(turn.swings, turn.roundings))
        while len(turn.angle) < most and any(
            _is_sharp(turn.oscillation(name), roundings.get(name, 0.0)) for name in outputs
        ):
            turn = self.turn(2 * len(turn.angle))
        return turn

    @property
    def amplitude(self) -> float:
        """Half the range of the first free coordinate over a period, such as a slider position (m)."""
        return float(self.amplitudes[0])

    @cached_property
    def amplitudes(self) -> FloatArray:
        """Half the range of each free coordinate over a period, in the order of `swings`; see `Turn.amplitudes`."""
        names = [name for name, _ in self.flow.components[: self.flow.swing_count]]
        return self.resolved_turn(names).amplitudes

    def clearance(self, samples: int | None = None) -> float:
        """Return the least clearance to the limit of assembly over a period, as `linkwork.limits.LIMIT_SINE` measures it."""
        equations, p = self.point.mechanism.equations, self.parameters.constants()
        modes, turn = tuple(float(value) for value in self.flow.modes), self.turn(samples)
        pairs = zip(turn.states.tolist(), turn.inputs.tolist())
        return min(abs(equations.clearance(x, equations.apply_inputs(modes, u, p), p)) for x, u in pairs)

    def determinant_by_liouville(self, samples: int = 512) -> float:
        """Return the determinant of the monodromy matrix from the trace of the Jacobian of dy/dangle along the orbit.

        The result does not depend on the variational equations, and is therefore a check of the monodromy matrix. With Coulomb
        friction the trace has sharp peaks where the slider reverses: some ten thousand samples are then needed.
        """
        flow, turn, p = self.flow, self.turn(samples), self.point.constants
        y = flow.unknowns(turn.states, self.point.vector).T
        trace = flow.jacobian_trace(self.point.mechanism.is_switched_on(p.tolist())).map(samples)
        traces = trace(turn.angle[None, :], y, list(flow.modes), self.point.vector, p)
        return liouville(np.asarray(traces).ravel(), flow.period * self.turns)

    def passages(self) -> FloatArray:
        """Return y at the beginning of each common period of the cranks and gears; shape (periods, n).

        Each of these states can be taken as the start of the same motion.
        """
        passed, flow, paces = [self.start], self.flow, self.flow.paces(self.point.vector)
        angles = np.array([0.0, flow.period / flow.commons])
        # angles in y are relative to a uniform rotation, which has advanced by this angle
        ahead = angles[1] * np.array([paces.get(name, 0.0) for name, _ in flow.components])
        for _ in range(self.periods - 1):
            passed.append(self.point.shoot(angles, passed[-1][None, :]).y[0] + ahead)
        return np.array(passed)


def make_orbit(point: OperatingPoint, **rest: Any) -> PeriodicOrbit:
    """Build a `PeriodicOrbit` that stores its operating point; ``rest`` are the other fields."""
    orbit = PeriodicOrbit(parameters=point.parameters, drive=point.drive, **rest)
    orbit.__dict__["point"] = point
    return orbit


@takes_published()
def newton_orbit(
    parameters: Parameters, drive: Drive, *, turns: int = 1, start: ArrayLike | None = None, settle: bool = True
) -> PeriodicOrbit:
    """Find the periodic motion to which Newton's method leads from a guess.

    Parameters
    ----------
    parameters, drive
    turns : int
        Turns of the crank in one period; if gears or other cranks have a longer common period, the number of common periods.
    start : array_like, shape (n,), optional
        Guess of y at crank angle 0; by default the coordinates with which the mechanism starts, at rest. If an undriven link
        goes round in the period after this guess, a motion in which the link goes round in each period is sought first.
    settle : bool
        Whether other starts are tried if Newton's method fails from the guess: the state to which the motion settles, and the
        states of `spread_starts`.

    Raises
    ------
    OrbitError
        If no periodic motion is found; `OrbitAssemblyError` if the links come to the limit of assembly in the search.
    InputError, ParameterError
        If an argument is not usable.
    """
    point = operating_point(parameters, drive)
    guess = first_guess(point.flow, drive, start)
    require_turns(turns, point, guess)
    _check_assembly(point, guess)
    try:
        return _solve_with_rounds(point, turns, guess)
    except OrbitError as error:
        if not settle:
            raise
        failure = error
    status, settled = settle_motion(point, guess, tolerance=1e-8, change=SETTLED, turns=SETTLING_TURNS)
    if status is Status.DONE:
        with suppress(OrbitError):
            return _solve_with_rounds(point, turns, settled)
    ranges = start_ranges(parameters, drive, guess)
    for number in range(SETS):
        for place in spread_starts(parameters, drive, guess, STARTS, number, ranges):
            if (found := approach_orbit(point, turns, place)) is not None:
                with suppress(OrbitError):
                    return solve_orbit(point, turns, found)
    raise failure


def settle_motion(
    point: OperatingPoint, start: FloatArray, *, tolerance: float, change: float, turns: int
) -> tuple[Status, FloatArray]:
    """Integrate from ``start`` until a turn changes y by less than ``change``, or for ``turns`` turns at most.

    A turn is here a common period, `Flow.period`; ``tolerance`` bounds the local error of the integrator. Whole turns of links
    do not count as a change. Return the status and the last y, without whole turns.
    """
    settled, flow = start.copy(), point.flow
    section = point.section(start, PLAIN, tolerance=tolerance)
    status = kernels.settle(section, flow.period, change, turns, settled)
    return Status(status), flow.nearest_to_rest(settled)


def _solve_with_rounds(point: OperatingPoint, turns: int, start: FloatArray) -> PeriodicOrbit:
    """Find by Newton's method a motion in which undriven links make as many full turns as in the period after ``start``.

    If no such motion is found, find a motion in which undriven links make only the full turns that the drive prescribes
    (``drive.ratios``).
    """
    rounds = _count_rounds(point, start, turns)
    if rounds:
        drive, own = point.drive.with_rounds(point.mechanism, rounds, turns)
        with suppress(OrbitError):
            return solve_orbit(operating_point(point.parameters, drive), own, start)
    return solve_orbit(point, turns, start)


def _count_rounds(point: OperatingPoint, start: FloatArray, turns: int) -> dict[str, int]:
    """Return the full turns that undriven links without a ratio in the drive make in the period after a start, by FMI name.

    Links that only swing are left out.
    """
    flow, ratios = point.flow, point.drive.ratios_by_freedom(point.mechanism)
    swinging = {name: i for name, i in flow.swinging.items() if flow.free[i] not in ratios}
    if not swinging:
        return {}
    shift = point.period(start, turns).shift
    return {name: times for name, i in swinging.items() if (times := round(shift[i] / flow.turn(i)))}


def approach_orbit(
    point: OperatingPoint, turns: int, place: FloatArray, known: FloatArray | None = None
) -> FloatArray | None:
    """Search for a periodic motion from a guess that may be far away; return the start of the motion, or None if none is found.

    The start is accurate only to `SEARCH_TOLERANCE`. ``place`` is the guess, shape (n,). ``known``, shape (m, n), are the
    starts of known motions, which deflation keeps the search from finding again: see `kernels.search`.
    """
    n, start = point.flow.size, place.copy()
    status = kernels.search(
        point.section(place, VARIATIONAL, tolerance=SEARCH_TOLERANCE),
        point.flow.period * turns,
        SEARCH_ITERATIONS,
        REACH,
        start,
        np.empty((0, n)) if known is None else known,
        np.empty(n * (1 + n)),
    )
    return start if status == Status.DONE else None


def approach_uniform_rotation(point: OperatingPoint, turns: int, place: FloatArray) -> FloatArray | None:
    """Search by multiple shooting for a periodic motion near a uniform rotation; the motion may be very unstable.

    ``place``, shape (n,), is y of the uniform rotation, the same at all crank angles. Return the start, or None if none is
    found.
    """
    k, n = EVEN_PIECES * turns * point.flow.commons, point.flow.size
    angles, starts = np.linspace(0.0, point.flow.period * turns, k + 1), np.tile(place, (k, 1))
    scale = point.scale(place)
    for _ in range(SEARCH_ITERATIONS):
        try:
            gaps, jacobian = _close(point.shoot(angles, starts), starts)
            change = np.linalg.solve(jacobian, gaps.ravel()).reshape(k, n)
        except (OrbitError, np.linalg.LinAlgError):
            return None
        size = float(np.abs(change / scale).max())
        starts = starts - change * min(1.0, REACH / size) if size > 0.0 else starts
        if size < SEARCH_TOLERANCE:
            return np.array(starts[0])
    return None


def first_guess(flow: Flow, drive: Drive, start: ArrayLike | None, speed: float | None = None) -> FloatArray:
    """Return the first guess of y for Newton's method: ``start``, or else the mechanism's default coordinates with zero rates.

    In the default guess only cranks and links with a ratio turn. The drive's crank has the prescribed speed; under a torque the
    crank has ``speed`` (rad/s), or else a speed within the motor's range. The speed of another crank or link is its ratio times
    this speed.

    Raises InputError if ``start`` does not have the components of the state, if under a torque neither ``start``, ``speed``
    nor a motor is given, or if the crank's speed is then not above zero.
    """
    if start is None:
        guess = flow.rest.copy()
        if flow.torque:
            if speed is None:
                if drive.motor is None:
                    raise InputError(
                        f"under a torque alone the {flow.labels[-1]} is needed: give start = ({', '.join(flow.labels)})"
                    )
                speed = drive.motor.synchronous_speed * (1.0 - 0.5 * drive.motor.breakdown_slip)
            guess[-1] = speed
        free = len(flow.free)
        guess[free : 2 * free] = mean_rates(drive, flow, guess)
    else:
        try:
            guess = np.array(start, dtype=float)
        except (TypeError, ValueError):  # no numbers
            guess = np.empty(0)
        if guess.shape != (flow.size,) or not np.isfinite(guess).all():
            names = ", ".join(f"{label} [{unit}]" for label, (_, unit) in zip(flow.labels, flow.components))
            raise InputError(f"start is {start}: it must be {flow.size} finite numbers, {names}")
    if flow.torque and not guess[-1] > 0.0:
        raise InputError(f"{flow.labels[-1]} at the start is {guess[-1]} rad/s: it must be above zero")
    return guess


@takes_published()
def rest_guess(
    parameters: Parameters, drive: Drive, initial: Any, speed: float | None = None, *, other: str = ""
) -> list[float]:
    """Return a guess of y for a periodic motion: rest at the coordinates of ``initial``.

    Under a torque the crank has ``speed`` (rad/s). If ``speed`` is not given, the crank has the speed in ``initial`` if this is
    above zero, or else a speed within the motor's range.

    Raises InputError if there is none of these speeds; ``other`` ends the message: it tells where else a speed can be given.
    """
    mechanism = find_mechanism(parameters)
    flow, ratios, state = drive.flow(mechanism), drive.ratios_by_freedom(mechanism), mechanism.state(initial)
    if flow.torque and speed is None:
        begins = state[flow.places[-1]]
        speed = begins if begins > 0.0 else None
        if speed is None and drive.motor is None:
            name = mechanism.freedoms[flow.crank].initial[1]
            raise InputError(
                f"under a torque a guess of the crank's speed is needed: give initial.{name}, above zero{other}"
            )
    guess = first_guess(flow, drive, None, speed)
    # the angle of another crank minus its ratio times the crank angle
    guess[: len(flow.free)] = [state[n] - ratios.get(n, 0) * state[flow.crank] for n in flow.free]
    return [float(value) for value in guess]


def require_turns(turns: int, point: OperatingPoint | None = None, start: FloatArray | None = None) -> None:
    """Raise InputError or ParameterError if a period cannot have this number of turns.

    A mechanism with a degree of freedom driven by a groove, for example, may need several turns to return to its configuration.
    This is checked if an operating point and a start are given.
    """
    Whole(least=1)(turns, "turns")
    if point is None or start is None:
        return
    mechanism, flow = point.mechanism, point.flow
    if set(point.drive.arguments(mechanism).values()) <= {channel.argument for channel in mechanism.channels}:
        return
    section = point.section(start, PLAIN)
    plain = flow.function(PLAIN, mechanism.is_switched_on(point.constants.tolist()))
    z = np.append(start, np.zeros(flow.size * (flow.size + 1)))
    numbers, way = (section.modes, section.drive, section.p), flow.period * turns
    rates = [np.asarray(plain(angle, z, *numbers)).ravel() for angle in (0.5, 2.0, 0.5 + way, 2.0 + way)]
    if not np.allclose(rates[:2], rates[2:], rtol=1e-6, atol=0.0):
        raise InputError(
            f"the {mechanism.name} is not in the same configuration after {turns * flow.turns} turn(s): give another number"
        )


def _check_assembly(point: OperatingPoint, start: FloatArray) -> None:
    """Raise OrbitAssemblyError if the links cannot be joined at the start."""
    mechanism, flow, p = point.mechanism, point.flow, point.parameters.constants()
    modes = tuple(float(value) for value in flow.modes)
    applied = mechanism.equations.apply_inputs(modes, tuple(point.vector[: flow.inputs].tolist()), p)
    x = mechanism.equations.start(flow.state(start, point.vector), applied, p)
    try:
        mechanism.check_state(x, applied, p)
    except AssemblyError as error:
        raise discretisation.OrbitAssemblyError(str(error), flow, start, np.inf, 0) from None


def solve_orbit(point: OperatingPoint, turns: int, guess: FloatArray) -> PeriodicOrbit:
    """Find a periodic motion by Newton's method from a guess; raise OrbitError if the method fails."""
    n, start = point.flow.size, guess.copy()
    z, report = np.empty(n * (1 + n)), np.zeros(3)
    section = point.section(guess, VARIATIONAL)
    status = kernels.solve(section, point.flow.period * turns, MOST_ITERATIONS, start, z, report)
    residual, iterations = float(report[0]), int(report[1])
    if status != Status.DONE:
        raise orbit_error(status, point.flow, start, residual, iterations)
    matrix = z[n:].reshape(n, n).T.copy()
    return make_orbit(point, turns=turns, start=start, monodromy=matrix, residual=residual, iterations=iterations)


def trial_orbit(
    point: OperatingPoint, start: FloatArray, turns: int, path: Discretisation | None = None
) -> tuple[PeriodicOrbit, FloatArray]:
    """Follow one period from a start; return an orbit, even if the motion is not periodic, and y(T) - y(0).

    ``path`` is a `Discretisation` with the period as one piece; by default a new one without collocation. Raises OrbitError if
    the integration fails.
    """
    path = path or Discretisation(np.array([0.0, point.flow.period * turns]), False)
    ends = path.ends(point, start[None, :])
    shift = ends.y[0] - start
    return _orbit_of_pieces(point, turns, start[None, :], ends, shift), shift


def _orbit_of_pieces(
    point: OperatingPoint,
    turns: int,
    starts: FloatArray,
    ends: Ends,
    gaps: FloatArray,
    stations: Stations | None = None,
) -> PeriodicOrbit:
    """Build an orbit from y at the beginnings and the ends of the pieces of a period; for ``gaps`` see `_close`."""
    return make_orbit(
        point,
        turns=turns,
        start=starts[0].copy(),
        monodromy=reduce(lambda product, matrix: matrix @ product, ends.matrices).copy(),
        residual=float(np.abs(gaps / point.scale(starts[0])).max()),
        iterations=1,
        stations=stations,
        least_clearance=ends.clearance,
    )


def _close(ends: Ends, starts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the gaps between the pieces of a period, shape (k, n), and their Jacobian, (k n, k n).

    A gap is y at the end of a piece minus y at the beginning of the next piece.
    """
    (k, n), pieces = starts.shape, np.arange(len(starts))
    following = (pieces + 1) % k
    jacobian: FloatArray = np.zeros((k, n, k, n))
    jacobian[pieces, :, following] = -np.eye(n)
    jacobian[pieces, :, pieces] += ends.matrices
    return ends.y - starts[following], jacobian.reshape(k * n, k * n)


class OrbitEquations:
    """Equations of a family's periodic motions over a range, in the form for `numerics.continuation`.

    The unknowns are the states y at the beginnings of the pieces of a period. The residual is y at the end of each piece minus
    y at the beginning of the next piece. Each evaluation also returns the `PeriodicOrbit`.

    Parameters
    ----------
    family : Family
    turns : int
        Number of common periods, `Flow.period`, in a period of the motion.
    low, high : float
        Range of the family's parameter.
    angles : ndarray, shape (k + 1,), optional
        As in `Stations`; by default the period is one piece.
    """

    def __init__(self, family: Family, turns: int, low: float, high: float, angles: FloatArray | None = None) -> None:
        self.family, self.turns, self.low, self.high = family, turns, low, high
        self._bounds = [family.operation(value) for value in (low, high)]
        (first, drive), (last, last_drive) = self._bounds
        flow = drive.flow(find_mechanism(first))
        self.angles = np.array([0.0, flow.period * turns]) if angles is None else angles
        self._shape = len(self.angles) - 1, flow.size
        collocated = discretisation.can_collocate((drive, last_drive), (first, last))
        self._discretised = Discretisation(self.angles, collocated)
        # if only the drive varies, its numbers are linear in the parameter: one derivative serves all values
        self._direction = family.direction(high, low, high) if first is last else None

    def scale(self, start: FloatArray) -> FloatArray:
        """Return the scale of each unknown: the larger of its typical magnitudes at the two ends of the range.

        The magnitudes of k pieces are multiplied by the square root of k, so that distances do not depend on k.
        """
        scale = np.max([operating_point(*bound).scale(start) for bound in self._bounds], axis=0)
        # arc length is measured by the mean square over the pieces
        pieces = len(self.angles) - 1
        return np.asarray(np.tile(scale * np.sqrt(pieces), pieces))

    def __call__(self, unknowns: FloatArray, value: float) -> Evaluation:
        """Evaluate the residual with its exact derivatives; raise OrbitError if the integration over a piece fails.

        ``unknowns`` are the states of all pieces in one vector, ``value`` is the value of the family's parameter.
        """
        point = operating_point(*self.family.operation(value))
        starts = unknowns.reshape(self._shape).copy()
        direction = self._direction or self.family.direction(value, self.low, self.high)
        ends = self._discretised.ends(point, starts, value, direction, self.high - self.low)
        gaps, jacobian = _close(ends, starts)
        stations = None
        if len(starts) > 1:
            growth = discretisation.growth_factors(ends.matrices, point.scale(starts[0])).max()
            stations = Stations(self.angles, starts, float(growth))
        orbit = _orbit_of_pieces(point, self.turns, starts, ends, gaps, stations)
        return Evaluation(gaps.ravel(), jacobian, ends.slopes.ravel(), orbit)
