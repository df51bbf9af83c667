"""Periodic motions of the full nonlinear plant, by shooting, with their Floquet multipliers.

At prescribed speed a periodic motion repeats itself after one turn of the crank, or after several; under a torque the mean
speed is part of the solution. `orbit_of` solves y(T) = y(0) by Newton's method with the exact monodromy matrix, which the
variational equations give on the way; that matrix's eigenvalues, the Floquet multipliers, go with every solution: an
unstable motion is found as easily as a stable one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError

from ...display import Shown, format_count
from ...mechanisms import Parameters, mechanism_of
from ...numerics.continuation import Evaluate, Evaluation
from ...run import outputs_of, takes_published
from ...units import RAD_S_PER_RPM
from . import kernels
from .discretisation import (
    INTEGRATOR_TOLERANCE,
    OrbitAssemblyError,
    OrbitError,
    Period,
    PeriodPath,
    Stations,
    failure,
    growths,
    section_of,
)
from .drive import Drive, is_smooth, scale_of, starts_of
from .floquet import TOLERANCE, StabilityVerdict, liouville, multipliers, verdict
from .flow import PLAIN, STATE, VARIATIONAL, Flow
from .kernels import Status
from .variables import Family


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Turn:
    """One period of an orbit at equal steps of the crank angle, its end left out.

    Attributes
    ----------
    angle : ndarray, shape (n,)
        Crank angle (rad), from 0.
    time : ndarray, shape (n,)
        s, from 0.
    period : float
        s.
    states, inputs : ndarray, shapes (n, states) and (n, channels)
        States of a run, no work done, and the channels in force.
    values : ndarray, shape (n, outputs)
        Outputs by `names`: all of the FMI interface but the energies that count from the start of a run.
    turns : int
        Turns of the crank in the period.
    modes : tuple of int
        Values of the mechanism's modes.
    names : tuple of str
    swing : str
        The output whose amplitude is meant where none is named: the first free coordinate, such as ``slider.position``, or
        the crank's speed where nothing else is free.

    Notes
    -----
    ``turn["slider.position"]`` is an output over the period, shape (n,).
    """

    angle: NDArray[np.float64]
    time: NDArray[np.float64]
    period: float
    states: NDArray[np.float64]
    inputs: NDArray[np.float64]
    values: NDArray[np.float64]
    turns: int
    modes: tuple[int, ...]
    names: tuple[str, ...]
    swing: str

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        if name not in self.names:
            raise InputError(f"an orbit has no output {name!r}: it has {', '.join(self.names)}")
        return self.values[:, self.names.index(name)]

    @property
    def amplitude(self) -> float:
        """Half the distance between the least and the greatest value of ``swing``, of a slider position (m).

        From the Fourier series of the turn on a grid eight times as fine, and the parabolas through its greatest and its least
        values: good to a millionth of itself, all the samples being enough for the series.
        """
        u = self[self.swing]
        n = 8 * len(u)
        fine = np.fft.irfft(np.fft.rfft(u), n) * (n / len(u))
        top = np.array([fine.argmax(), fine.argmin()])
        before, at, after = fine[top - 1], fine[top], fine[(top + 1) % n]
        bend = before - 2.0 * at + after
        beyond = np.divide((after - before) ** 2, -8.0 * bend, out=np.zeros(2), where=bend != 0.0)
        return 0.5 * float(np.ptp(at + beyond))

    def harmonic(self, name: str, order: float) -> float:
        """Amplitude of a harmonic of an output, its order counted in turns of the crank: 1/2 where the period is two turns.

        Raises
        ------
        InputError
            If the period does not hold the harmonic a whole number of times, or the samples are too few for it.
        """
        number = order * self.turns
        if number != int(number) or not 0 < number < len(self.angle) / 2:
            raise InputError(
                f"order {order} of an orbit of {self.turns} turn(s) with {len(self.angle)} samples: its orders are "
                f"multiples of 1/{self.turns} up to {(len(self.angle) - 1) // 2 / self.turns:g}"
            )
        return 2.0 * float(np.abs(np.fft.rfft(self[name])[int(number)])) / len(self.angle)


def times_of(speed: NDArray[np.float64], way: float) -> tuple[NDArray[np.float64], float]:
    """Time at equal steps of the crank angle over ``way``, and the period, by integrating the Fourier series of 1 / speed."""
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


#: Largest correction relative to the scale at which a solution counts as found.
ORBIT_TOLERANCE = 100.0 * INTEGRATOR_TOLERANCE

#: The same in the search for motions far from a guess, iterations at most there, and the greatest correction in the scale of
#: y; what is found is solved again.
SEARCH_TOLERANCE, SEARCH_ITERATIONS, REACH = 1e-6, 30, 1.0

#: Sets of starts of that search where Newton's method fails from the guess, and starts of each, a power of two:
#: near a resonance of small damping one in some forty leads to the motion.
SETS, STARTS = 4, 64

#: Newton iterations at most.
MOST_ITERATIONS = 40

#: Turns for which a motion is followed where Newton's method fails from the guess, and the change a turn that ends it.
SETTLING_TURNS, SETTLED = 200, 1e-4

#: Samples of a turn from which amplitudes and harmonics are taken.
SAMPLES = 256

#: Outputs that an orbit has none of: they count from the start of a run.
_OF_A_RUN = ("energy.dissipated", "energy.supplied", "energy.residual")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PeriodicOrbit(Shown):
    """A periodic motion of the full nonlinear plant.

    Attributes
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    turns : int
        Turns of the crank in one period.
    start : ndarray, shape (n,)
        y at crank angle 0: coordinates and rates of the freedoms that are free beside the crank, of a five-bar u (m) and u'
        (m/s), and under a torque the crank speed (rad/s).
    monodromy : ndarray, shape (n, n)
        Derivative of the map over one period on the section at the crank angle 0.
    residual : float
        ``|y(T) - y(0)|`` relative to `scale_of`, before the last correction.
    iterations : int
        Newton iterations taken.
    stations : Stations or None
        Where the motion was begun anew on the way, because it is too unstable to be followed over a whole period.
    others : int or None
        How many other periodic motions of the same period there are, as far as was sought; None where it was not asked.
    nearest : float or None
        How near the links come to the limit of assembly, as `clearance` has it, where that was computed on the way.
    """

    parameters: Parameters
    drive: Drive
    turns: int
    start: NDArray[np.float64]
    monodromy: NDArray[np.float64]
    residual: float
    iterations: int
    stations: Stations | None = None
    others: int | None = None
    nearest: float | None = None
    # `amplitude` and `multipliers`, once they have been asked for
    _amplitude: list[float] = field(default_factory=list, init=False)
    _multipliers: list[NDArray[np.complex128]] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        if not np.isfinite(self.monodromy).all():
            raise InputError("a monodromy matrix is not finite")

    def __repr__(self) -> str:
        try:
            turn, unit = self.turn(), self.swing[1]
            speed = self.flow.period * self.turns / turn.period
            said = f" at {speed:.4g} rad/s ({speed / RAD_S_PER_RPM:.4g} rpm), {self.verdict().stability.value}"
            swing = f"; amplitude of {turn.swing} {turn.amplitude:.4g} {unit}"
        except LinkworkError as error:
            said, swing = f" that cannot be followed ({error})", ""
        turns = format_count(self.turns, "turn")
        others = f"; {format_count(self.others, 'other motion')} there: find_orbits" if self.others else ""
        return f"<PeriodicOrbit: {turns}{said}, largest Floquet multiplier {self.largest:.4g}{swing}{others}>"

    @property
    def flow(self) -> Flow:
        """The mechanism as a flow, driven as it is: names and units of y."""
        return self.drive.flow(mechanism_of(self.parameters))

    @property
    def swing(self) -> tuple[str, str]:
        """What the amplitude is of, as messages call it, and its unit: ``("u", "m")`` of a five-bar."""
        return self.flow.labels[0], self.flow.components[0][1]

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, the largest first, shape (n,)."""
        if not self._multipliers:
            self._multipliers.append(multipliers(self.monodromy))
        return self._multipliers[0]

    @property
    def largest(self) -> float:
        """Largest modulus of the Floquet multipliers."""
        return float(abs(self.multipliers[0]))

    def verdict(self, tolerance: float = TOLERANCE) -> StabilityVerdict:
        """Whether small deviations die out, with the margin."""
        return verdict(self.multipliers, tolerance)

    def turn(self, samples: int = SAMPLES) -> Turn:
        """Outputs over one period at equal steps of the crank angle."""
        flow, mechanism = self.flow, mechanism_of(self.parameters)
        angles = np.linspace(0.0, flow.period * self.turns, samples, endpoint=False)
        rows = np.empty((samples, mechanism.size + flow.inputs))
        section = section_of(self.parameters, self.drive, self.start, PLAIN, STATE)
        stations, starts = (np.zeros(1), self.start[None, :].copy())
        if self.stations is not None:
            stations, starts = self.stations.angles[:-1].copy(), self.stations.starts
        status = kernels.sample(section, stations, starts, angles, rows)
        if status != Status.DONE:
            raise failure(status, flow, self.start)
        states, channels = rows[:, : mechanism.size], rows[:, mechanism.size :]
        values = outputs_of(mechanism, section.modes, np.array([*self.parameters.constants(), 0.0]), states, channels)
        keep = [n for n, name in enumerate(mechanism.output_names) if name not in _OF_A_RUN]
        time, period = times_of(states[:, len(mechanism.freedoms) + flow.crank], flow.period * self.turns)
        return Turn(
            angle=angles,
            time=time,
            period=period,
            states=states,
            inputs=channels,
            values=values[:, keep],
            turns=self.turns,
            modes=flow.modes,
            names=tuple(mechanism.output_names[n] for n in keep),
            swing=flow.components[0][0],
        )

    @property
    def amplitude(self) -> float:
        """Half the range of the first free coordinate over a period, of a slider position (m); see `Turn.amplitude`."""
        if not self._amplitude:
            self._amplitude.append(self.turn().amplitude)
        return self._amplitude[0]

    def clearance(self, samples: int = SAMPLES) -> float:
        """How near the links come to the limit of assembly over a period, in the measure of `linkwork.limits.LIMIT_SINE`."""
        mechanism, p = mechanism_of(self.parameters), self.parameters.constants()
        modes, turn = tuple(float(value) for value in self.flow.modes), self.turn(samples)
        return min(
            abs(mechanism.equations.clearance(x, mechanism.equations.applied(modes, u, p), p))
            for x, u in zip(turn.states.tolist(), turn.inputs.tolist())
        )

    def determinant_by_liouville(self, samples: int = 512) -> float:
        """Determinant of the monodromy matrix from the trace of the rates' Jacobian along the orbit.

        It does not use the variational equations, and so checks them. With Coulomb friction the trace peaks sharply where the
        slider turns round: it then takes some ten thousand samples.
        """
        flow, turn, mechanism = self.flow, self.turn(samples), mechanism_of(self.parameters)
        drive, p = self.drive.vector(mechanism), list(self.parameters.constants())
        y = turn.states[:, flow.places].T
        traces = flow.jacobian_trace(mechanism.switched(p)).map(samples)(
            turn.angle[None, :], y, list(flow.modes), drive, p
        )
        return liouville(np.asarray(traces).ravel(), flow.period * self.turns)


@takes_published()
def orbit_of(
    parameters: Parameters,
    drive: Drive,
    *,
    turns: int = 1,
    start: ArrayLike | None = None,
    settle: bool = True,
) -> PeriodicOrbit:
    """A periodic motion: the one that Newton's method leads to.

    Parameters
    ----------
    parameters, drive
    turns : int
        Turns of the crank in one period.
    start : array_like, shape (n,), optional
        Guess of y at crank angle 0; without it all at zero.
    settle : bool
        Whether other starts are tried where Newton's method fails from the guess: where the motion goes by itself, and those
        of `starts_of`.

    Raises
    ------
    OrbitError
        If none is found; `OrbitAssemblyError` if the links come to the limit of assembly on the way.
    InputError
        If what was given is not usable.
    """
    require_turns(turns)
    guess = guess_of(drive.flow(mechanism_of(parameters)), drive, start)
    _check_period(parameters, drive, guess, turns)
    _check_assembly(parameters, drive, guess)
    try:
        return _newton(parameters, drive, turns, guess)
    except OrbitError as failure:
        if not settle:
            raise
        first = failure
    status, settled = settle_from(parameters, drive, guess, tolerance=1e-8, change=SETTLED, turns=SETTLING_TURNS)
    if status is Status.DONE:
        try:
            return _newton(parameters, drive, turns, settled)
        except OrbitError:
            pass
    for number in range(SETS):
        for place in starts_of(parameters, drive, guess, STARTS, number):
            found = approach(parameters, drive, turns, place)
            if found is None:
                continue
            try:
                return _newton(parameters, drive, turns, found)
            except OrbitError:
                pass
    raise first


def settle_from(
    parameters: Parameters, drive: Drive, start: NDArray[np.float64], *, tolerance: float, change: float, turns: int
) -> tuple[Status, NDArray[np.float64]]:
    """Where the motion goes by itself from ``start``, until a turn changes y by less than ``change``, or for so many turns."""
    settled = start.copy()
    section = section_of(parameters, drive, start, PLAIN, tolerance=tolerance)
    status = kernels.settle(section, drive.flow(mechanism_of(parameters)).period, change, turns, settled)
    return Status(status), settled


def approach(
    parameters: Parameters,
    drive: Drive,
    turns: int,
    place: NDArray[np.float64],
    known: NDArray[np.float64] | None = None,
) -> NDArray[np.float64] | None:
    """Start of the motion that Newton's method leads to from a place, to the tolerance of a search; None if to none.

    Parameters
    ----------
    place : ndarray, shape (n,)
    known : ndarray, shape (m, n), optional
        Starts of motions that are divided out.
    """
    flow, start = drive.flow(mechanism_of(parameters)), place.copy()
    status = kernels.search(
        section_of(parameters, drive, place, VARIATIONAL, tolerance=SEARCH_TOLERANCE),
        flow.period * turns,
        SEARCH_ITERATIONS,
        REACH,
        start,
        np.empty((0, flow.size)) if known is None else known,
        np.empty(flow.size * (1 + flow.size)),
    )
    return start if status == Status.DONE else None


def guess_of(flow: Flow, drive: Drive, start: ArrayLike | None) -> NDArray[np.float64]:
    """Where Newton's method begins: ``start``, checked; without it all at zero, at a speed that a motor may have.

    Raises InputError if ``start`` does not have the components of the state, or is missing and needed.
    """
    if start is None:
        guess = np.zeros(flow.size)
        if flow.torque:
            if drive.motor is None:
                raise InputError(
                    f"under a torque alone the {flow.labels[-1]} is needed: give start = ({', '.join(flow.labels)})"
                )
            guess[-1] = drive.motor.synchronous_speed * (1.0 - 0.5 * drive.motor.breakdown_slip)
        return guess
    guess = np.array(start, dtype=float)
    if guess.shape != (flow.size,) or not np.isfinite(guess).all():
        names = ", ".join(f"{label} [{unit}]" for label, (_, unit) in zip(flow.labels, flow.components))
        raise InputError(f"start is {start}: it must be {flow.size} finite numbers, {names}")
    if flow.torque and not guess[-1] > 0.0:
        raise InputError(f"{flow.labels[-1]} at the start is {guess[-1]} rad/s: it must be above zero")
    return guess


def require_turns(turns: int) -> None:
    """Make sure that a period can have so many turns; raises InputError if it cannot."""
    if turns < 1 or turns != int(turns):
        raise InputError(f"turns is {turns}: a period has a whole number of them, at least one")


def _check_period(parameters: Parameters, drive: Drive, start: NDArray[np.float64], turns: int) -> None:
    """Make sure that a mechanism in which no input but a groove or the like drives a freedom repeats itself after the turns."""
    mechanism = mechanism_of(parameters)
    if set(drive.arguments(mechanism).values()) <= {channel.argument for channel in mechanism.channels}:
        return
    flow = drive.flow(mechanism)
    section, plain = (
        section_of(parameters, drive, start, PLAIN),
        flow.function(PLAIN, mechanism.switched(parameters.constants())),
    )
    z = np.append(start, np.zeros(flow.size * (flow.size + 1)))
    rates = [
        np.asarray(plain(angle + way, z, section.modes, section.drive, section.p)).ravel()
        for way in (0.0, flow.period * turns)
        for angle in (0.5, 2.0)
    ]
    if not np.allclose(rates[:2], rates[2:], rtol=1e-6, atol=0.0):
        raise InputError(
            f"the {mechanism.name} is not in the same configuration after {turns} turn(s): give another number"
        )


def _check_assembly(parameters: Parameters, drive: Drive, start: NDArray[np.float64]) -> None:
    mechanism = mechanism_of(parameters)
    flow, vector, p = drive.flow(mechanism), drive.vector(mechanism), parameters.constants()
    modes = tuple(float(value) for value in flow.modes)
    applied = mechanism.equations.applied(modes, tuple(vector[: flow.inputs].tolist()), p)
    x = mechanism.equations.start(flow.state(start, vector), applied, p)
    try:
        mechanism.check_state(parameters, x, applied, p)
    except AssemblyError as error:
        raise OrbitAssemblyError(str(error), flow, start, np.inf, 0) from None


def _newton(parameters: Parameters, drive: Drive, turns: int, guess: NDArray[np.float64]) -> PeriodicOrbit:
    flow = drive.flow(mechanism_of(parameters))
    n, start = flow.size, guess.copy()
    z, report = np.empty(n * (1 + n)), np.zeros(3)
    section = section_of(parameters, drive, guess, VARIATIONAL)
    status = kernels.solve(section, flow.period * turns, MOST_ITERATIONS, start, z, report)
    if status != Status.DONE:
        raise failure(status, flow, start, report[0], int(report[1]))
    return PeriodicOrbit(
        parameters=parameters,
        drive=drive,
        turns=turns,
        start=start,
        monodromy=z[n:].reshape(n, n).T.copy(),
        residual=float(report[0]),
        iterations=int(report[1]),
    )


def orbit_from(
    parameters: Parameters,
    drive: Drive,
    start: NDArray[np.float64],
    turns: int,
    period: Period,
    nearest: float | None = None,
) -> PeriodicOrbit:
    """The orbit that one period from its start is, as far as it closes."""
    return PeriodicOrbit(
        parameters=parameters,
        drive=drive,
        turns=turns,
        start=start.copy(),
        monodromy=period.monodromy,
        residual=float(np.abs(period.shift / scale_of(parameters, drive, start)).max()),
        iterations=1,
        nearest=nearest,
    )


def orbit_equations(
    family: Family, turns: int, low: float, high: float, angles: NDArray[np.float64] | None = None
) -> Evaluate:
    """y(T) - y(0) with its derivatives over a range, as `continuation` follows it; its data are the `PeriodicOrbit`.

    With ``angles``, shape (k + 1,), the unknowns are y at the beginning of each piece between them, and what is to vanish
    is the difference of each end from the next beginning: multiple shooting.
    """

    (mechanism, drive), (other, _) = family.at(low), family.at(high)
    whole = np.array([0.0, drive.flow(mechanism_of(mechanism)).period * turns])
    path = PeriodPath(whole if angles is None else angles, is_smooth(mechanism) and is_smooth(other))
    # what varies is a number of the drive: all of them are linear in it
    same = family.direction(high, low, high) if mechanism is other else None

    def evaluation(y: NDArray[np.float64], value: float) -> Evaluation:
        parameters, drive = family.at(value)
        direction = same or family.direction(value, low, high)
        ends = path.follow(parameters, drive, y[None, :], value, direction, high - low)
        period = Period(ends.y[0] - y, ends.matrices[0].copy(), ends.slopes[0])
        orbit = orbit_from(parameters, drive, y, turns, period, ends.clearance)
        return Evaluation(period.shift, period.monodromy - np.eye(len(y)), period.slope, orbit)

    def in_pieces(y: NDArray[np.float64], value: float) -> Evaluation:
        assert angles is not None
        parameters, drive = family.at(value)
        k = len(angles) - 1
        starts = y.reshape(k, -1).copy()
        n = starts.shape[1]
        direction = same or family.direction(value, low, high)
        ends, matrices, slopes, clearance = path.follow(parameters, drive, starts, value, direction, high - low)
        gaps = ends - np.roll(starts, -1, axis=0)
        jacobian = np.zeros((k, n, k, n))
        pieces = np.arange(k)
        jacobian[pieces, :, pieces] = matrices
        jacobian[pieces, :, (pieces + 1) % k] -= np.eye(n)
        scale = scale_of(parameters, drive, starts[0])
        orbit = PeriodicOrbit(
            parameters=parameters,
            drive=drive,
            turns=turns,
            start=starts[0].copy(),
            monodromy=reduce(lambda product, matrix: matrix @ product, matrices),
            residual=float(np.abs(gaps / scale).max()),
            iterations=1,
            stations=Stations(angles, starts, float(growths(matrices, scale).max())),
            nearest=clearance,
        )
        return Evaluation(gaps.ravel(), jacobian.reshape(k * n, k * n), slopes.ravel(), orbit)

    return evaluation if angles is None else in_pieces
