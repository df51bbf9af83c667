"""Periodic motions of the full nonlinear plant, by shooting, with their Floquet multipliers.

At prescribed speed a periodic motion repeats itself after one turn of the crank, or after several; under a torque the mean
speed is part of the solution. `orbit_of` solves y(T) = y(0) by Newton's method with the exact monodromy matrix, which the
variational equations give on the way; that matrix's eigenvalues, the Floquet multipliers, go with every solution: an
unstable motion is found as easily as a stable one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError

from ..mechanisms import Parameters, mechanism_of
from ..notebook import Shown, format_count
from ..run import outputs_of, takes_published
from ..units import RAD_S_PER_RPM
from . import orbit_kernels
from .drives import Drive
from .floquet import TOLERANCE, StabilityVerdict, liouville, multipliers, verdict
from .flows import DIRECTIONAL, GAP, PLAIN, STATE, VARIATIONAL, Flow
from .orbit_kernels import Section, Status
from .starts import scale_in, starts_of
from .turns import Turn, times_of

#: Bound of the local error of a step; the solution is good to about a hundred times as much.
INTEGRATOR_TOLERANCE = 1e-12
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


class Direction(NamedTuple):
    """Derivatives of `Drive.vector` and of the constants with respect to a parameter lambda."""

    drive: NDArray[np.float64]
    constants: NDArray[np.float64]


class Stations(NamedTuple):
    """Places of a period at which the motion is begun anew: multiple shooting.

    Attributes
    ----------
    angles : ndarray, shape (k + 1,)
        Crank angles (rad): the first 0, the last the end of the period.
    starts : ndarray, shape (k, n)
        y at all but the last.
    growth : float
        Greatest norm of the derivatives of y over a piece with respect to y at its beginning, scaled.
    """

    angles: NDArray[np.float64]
    starts: NDArray[np.float64]
    growth: float


class OrbitError(LinkworkError):
    """No periodic motion was found.

    Attributes
    ----------
    reason : str
        One sentence on why.
    start : tuple of float
        y at crank angle 0 at which it ended: see `PeriodicOrbit`.
    residual : float
        ``|y(T) - y(0)|`` relative to the scale there; infinite where not one period could be followed.
    iterations : int
    """

    def __init__(self, reason: str, flow: Flow, start: Iterable[float], residual: float, iterations: int) -> None:
        self.reason = reason
        self.start = tuple(float(value) for value in start)
        self.residual = residual
        self.iterations = iterations
        units = (unit for _, unit in flow.components)
        place = ", ".join(f"{n} = {value:.6g} {unit}" for n, value, unit in zip(flow.labels, self.start, units))
        super().__init__(
            f"no periodic motion found: {reason}; residual {residual:.2e} after {iterations} iterations at {place}"
        )


class OrbitAssemblyError(OrbitError, AssemblyError):
    """The motion that was followed comes to the limit of assembly."""


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
        status = orbit_kernels.sample(section, stations, starts, angles, rows)
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


def section_of(
    parameters: Parameters,
    drive: Drive,
    start: NDArray[np.float64],
    *functions: int,
    tolerance: float = INTEGRATOR_TOLERANCE,
    direction: Direction | None = None,
    along: float = 1.0,
    beside: Sequence[Parameters] = (),
) -> Section:
    """What the kernels need of a mechanism and its drive.

    Parameters
    ----------
    start : ndarray, shape (n,)
        From which the magnitudes of y are taken.
    *functions : int
        Numbers of the flow's functions that are called, beside `orbit_kernels.GAP`.
    direction : Direction, optional
        With respect to a parameter lambda; zero without it.
    along : float
        Magnitude of lambda.
    beside : sequence of parameters
        Whose constants are to take the place of these: what is switched on in one is computed for all.
    """
    mechanism = mechanism_of(parameters)
    flow, vector, p = drive.flow(mechanism), drive.vector(mechanism), np.array(parameters.constants())
    d_drive, d_p = direction or (np.zeros_like(vector), np.zeros_like(p))
    # lambda may be what switches on
    switched = any(map(mechanism.switched, (p.tolist(), d_p.tolist(), *(other.constants() for other in beside))))
    return Section(
        flow.addresses(GAP, *functions, switched=switched),
        np.array(flow.modes, dtype=float),
        np.concatenate([vector, d_drive]),
        np.concatenate([p, d_p]),
        scale_in(flow, parameters, vector, start),
        along,
        tolerance,
        flow.torque,
    )


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
    status = orbit_kernels.settle(section, drive.flow(mechanism_of(parameters)).period, change, turns, settled)
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
    status = orbit_kernels.search(
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
    status = orbit_kernels.solve(section, flow.period * turns, MOST_ITERATIONS, start, z, report)
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


class Period(NamedTuple):
    """One period from a start: y(T) - y(0), shape (n,), its derivatives dy(T)/dy(0), (n, n), and dy(T)/dlambda, (n,)."""

    shift: NDArray[np.float64]
    monodromy: NDArray[np.float64]
    slope: NDArray[np.float64]


@takes_published()
def period_from(
    parameters: Parameters,
    drive: Drive,
    start: NDArray[np.float64],
    turns: int,
    direction: Direction | None = None,
    along: float = 1.0,
) -> Period:
    """Follow the plant over one period from a start that need not be on a periodic orbit.

    Parameters
    ----------
    start : ndarray, shape (n,)
        y at crank angle 0.
    direction : Direction, optional
        With respect to a parameter lambda; zero without it.
    along : float
        Magnitude of lambda.

    Raises
    ------
    OrbitError
        If the period cannot be followed.
    """
    flow = drive.flow(mechanism_of(parameters))
    n = flow.size
    z = np.zeros(n * (2 + n))
    z[:n] = start
    section = section_of(parameters, drive, start, DIRECTIONAL, direction=direction, along=along)
    status = orbit_kernels.period(section, flow.period * turns, z, np.array([0.1, 0.0]))
    if status != Status.DONE:
        raise failure(status, flow, start)
    return Period(z[:n] - start, z[n : n + n * n].reshape(n, n).T.copy(), z[n + n * n :].copy())


def pieces_from(
    parameters: Parameters,
    drive: Drive,
    angles: NDArray[np.float64],
    starts: NDArray[np.float64],
    direction: Direction | None = None,
    along: float = 1.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Follow the plant over the pieces of a period, each from its own start: see `period_from`.

    Parameters
    ----------
    angles, starts
        As in `Stations`.

    Returns
    -------
    ends : ndarray, shape (k, n)
        y at the end of each piece.
    matrices : ndarray, shape (k, n, n)
        Their derivatives with respect to the start.
    slopes : ndarray, shape (k, n)
        Their derivatives with respect to lambda.

    Raises
    ------
    OrbitError
        If a piece cannot be followed.
    """
    k, n = starts.shape
    rows = np.zeros((k, n * (2 + n)))
    section = section_of(parameters, drive, starts[0], DIRECTIONAL, direction=direction, along=along)
    status = orbit_kernels.segments(section, angles, np.ascontiguousarray(starts), rows)
    if status != Status.DONE:
        raise failure(status, drive.flow(mechanism_of(parameters)), starts[0])
    matrices = rows[:, n : n + n * n].reshape(k, n, n).transpose(0, 2, 1)
    return rows[:, :n], matrices, rows[:, n + n * n :]


def failure(
    status: int, flow: Flow, start: NDArray[np.float64], residual: float = np.inf, iterations: int = 0
) -> OrbitError:
    """The error that says what a status of `orbit_kernels` means."""
    kind = OrbitAssemblyError if status == Status.LIMIT else OrbitError
    return kind(orbit_kernels.REASONS[Status(status)], flow, start, float(residual), iterations)
