"""Periodic motions of the full nonlinear plant, by shooting, with their Floquet multipliers.

At prescribed speed a periodic motion repeats itself after one turn of the crank, or after several; under a torque the mean
speed is part of the solution. `find_orbit` solves y(T) = y(0) by Newton's method with the exact monodromy matrix, which the
variational equations give on the way; that matrix's eigenvalues, the Floquet multipliers, go with every solution: an
unstable motion is found as easily as a stable one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import AssemblyError, InputError, LinkworkError
from linkwork.five_bar import kinematics
from linkwork.five_bar.parameters import Constants, FiveBarParameters
from linkwork.five_bar.variables import OUTPUT_NAMES
from linkwork.limits import LIMIT_SINE

from ..mechanisms import require_five_bar
from ..run import InductionMotor, compiled
from ..run import inputs as inputs_module
from . import orbit_kernels
from .floquet import TOLERANCE, StabilityVerdict, liouville, multipliers, verdict

#: Bound of the local error of a step; the solution is good to about a hundred times as much.
INTEGRATOR_TOLERANCE = 1e-12
#: Largest correction relative to the scale at which a solution counts as found.
ORBIT_TOLERANCE = 100.0 * INTEGRATOR_TOLERANCE
#: Newton iterations at most.
MOST_ITERATIONS = 40
#: Turns for which a motion is followed where Newton's method fails from the guess, and the change a turn that ends it.
SETTLING_TURNS, SETTLED = 200, 1e-4
#: Steps at most by which the spring is brought down from where the slider hardly moves.
SOFTENING_STEPS = 200
#: Samples of a turn from which amplitudes and harmonics are taken.
SAMPLES = 256

#: Outputs that an orbit has: all but the energies that count from the start of a run.
NAMES = tuple(name for name in OUTPUT_NAMES if name not in ("energy.dissipated", "energy.supplied", "energy.residual"))


class OrbitError(LinkworkError):
    """No periodic motion was found.

    Attributes
    ----------
    reason : str
        One sentence on why.
    start : tuple of float
        (u, u') at crank angle 0 (m, m/s), and w2 (rad/s) under a torque, at which it ended.
    residual : float
        |y(T) - y(0)| relative to the scale there; infinite where not one period could be followed.
    iterations : int
    """

    def __init__(self, reason: str, start: Iterable[float], residual: float, iterations: int) -> None:
        self.reason = reason
        self.start = tuple(float(value) for value in start)
        self.residual = residual
        self.iterations = iterations
        place = ", ".join(f"{name} = {value:.6g} {unit}" for (name, unit), value in zip(_COMPONENTS, self.start))
        super().__init__(
            f"no periodic motion found: {reason}; residual {residual:.2e} after {iterations} iterations at {place}"
        )


class VaryingInputError(InputError):
    """An input varies in time, and so there is no periodic motion under it; ``channel`` is its name."""

    def __init__(self, channel: str, value: object) -> None:
        self.channel = channel
        super().__init__(
            f"{channel} is a {type(value).__name__}: what acts on a periodic motion must be constant, or an induction motor"
        )


class OrbitAssemblyError(OrbitError, AssemblyError):
    """The motion that was followed comes to the limit of assembly."""


_COMPONENTS = (("u", "m"), ("u'", "m/s"), ("crank speed", "rad/s"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """What drives the plant over an orbit: a speed, or a torque; and forces that stay the same.

    Attributes
    ----------
    speed : float or None
        Prescribed crank speed (rad/s), above zero; None for a drive by torque.
    torque : float
        Constant torque on the crank (N.m): the mean torque.
    motor : InductionMotor or None
        A motor whose torque is added.
    slider_force, load_x, load_y : float
        Constant forces on the slider and at P (N).

    Raises
    ------
    InputError
        If a value is not finite, the speed is not above zero, or there are both a speed and a torque.
    """

    speed: float | None = None
    torque: float = 0.0
    motor: InductionMotor | None = None
    slider_force: float = 0.0
    load_x: float = 0.0
    load_y: float = 0.0

    def __post_init__(self) -> None:
        if self.speed is not None and not (isfinite(self.speed) and self.speed > 0.0):
            raise InputError(f"speed is {self.speed} rad/s: it must be a finite number above zero")
        for name in ("torque", "slider_force", "load_x", "load_y"):
            if not isfinite(getattr(self, name)):
                raise InputError(f"{name} is {getattr(self, name)}: it must be a finite number")
        if self.speed is not None and (self.torque != 0.0 or self.motor is not None):
            raise InputError("both a speed and a torque are given: an orbit has either")
        if self.speed is None and self.torque == 0.0 and self.motor is None:
            raise InputError("neither a speed nor a torque is given: an orbit needs one of them")

    @property
    def speed_drive(self) -> bool:
        """Whether the speed is prescribed."""
        return self.speed is not None

    @property
    def size(self) -> int:
        """Number of components of the state on the section th2 = 0."""
        return 2 if self.speed_drive else 3

    def vector(self) -> NDArray[np.float64]:
        """As `orbit_kernels.DRIVE` has it, shape (7,)."""
        motor = self.motor or InductionMotor(breakdown_torque=0.0, breakdown_slip=1.0, synchronous_speed=1.0)
        return np.array(
            [
                self.torque if self.speed is None else self.speed,
                motor.breakdown_torque,
                motor.breakdown_slip,
                motor.synchronous_speed,
                self.slider_force,
                self.load_x,
                self.load_y,
            ]
        )


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
    states, inputs : ndarray, shapes (n, 6)
        States (th2, u, w2, v, 0, 0) and what acts on the plant, as `linkwork.five_bar.dynamics` has them.
    values : ndarray, shape (n, 24)
        Outputs by `names`: all of the FMI contract but the energies that count from the start of a run.
    turns : int
        Turns of the crank in the period.

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
    names: tuple[str, ...] = NAMES

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        if name not in self.names:
            raise InputError(f"an orbit has no output {name!r}: it has {', '.join(self.names)}")
        return self.values[:, self.names.index(name)]

    @property
    def amplitude(self) -> float:
        """Half the distance between the least and the greatest slider position (m).

        From the Fourier series of the turn on a grid eight times as fine: good to a millionth of itself, all the samples
        being enough for the series.
        """
        u = self["slider.position"]
        n = 8 * len(u)
        fine = np.fft.irfft(np.fft.rfft(u), n) * (n / len(u))
        return 0.5 * float(np.ptp(fine))

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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PeriodicOrbit:
    """A periodic motion of the full nonlinear plant.

    Attributes
    ----------
    parameters : FiveBarParameters
    drive : Drive
    turns : int
        Turns of the crank in one period.
    start : ndarray, shape (2,) or (3,)
        u (m) and u' (m/s) at crank angle 0, and under a torque the crank speed (rad/s).
    monodromy : ndarray, shape (n, n)
        Derivative of the map over one period on the section th2 = 0.
    residual : float
        |y(T) - y(0)| relative to crank length and speed, before the last correction.
    iterations : int
        Newton iterations taken.
    multipliers : ndarray of complex, shape (n,)
        Floquet multipliers, the largest first.
    """

    parameters: FiveBarParameters
    drive: Drive
    turns: int
    start: NDArray[np.float64]
    monodromy: NDArray[np.float64]
    residual: float
    iterations: int
    multipliers: NDArray[np.complex128] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "multipliers", multipliers(self.monodromy))

    @property
    def largest(self) -> float:
        """Largest modulus of the Floquet multipliers."""
        return float(abs(self.multipliers[0]))

    def verdict(self, tolerance: float = TOLERANCE) -> StabilityVerdict:
        """Whether small deviations die out, with the margin."""
        return verdict(self.multipliers, tolerance)

    def turn(self, samples: int = SAMPLES) -> Turn:
        """Outputs over one period at equal steps of the crank angle."""
        angles = np.linspace(0.0, 2.0 * pi * self.turns, samples, endpoint=False)
        p = self.parameters.constants()
        drive, states, forces = self.drive.vector(), np.empty((samples, 6)), np.empty((samples, 6))
        scale = scale_of(self.parameters, self.drive, self.start)
        status = orbit_kernels.sample(
            self.drive.speed_drive, p, drive, INTEGRATOR_TOLERANCE, scale, self.start.copy(), angles, states, forces
        )
        if status != orbit_kernels.DONE:
            raise failure(status, self.start)
        values = np.empty((samples, len(OUTPUT_NAMES)))
        compiled.solver(p).outputs(p, states, forces, 0.0, values)
        keep = [OUTPUT_NAMES.index(name) for name in NAMES]
        time, period = _times(states[:, 2], self.turns)
        return Turn(
            angle=angles,
            time=time,
            period=period,
            states=states,
            inputs=forces,
            values=values[:, keep],
            turns=self.turns,
        )

    @property
    def amplitude(self) -> float:
        """Half the distance between the least and the greatest slider position (m)."""
        return self.turn().amplitude

    def determinant_by_liouville(self, samples: int = 512) -> float:
        """Determinant of the monodromy matrix from the trace of the rates' Jacobian along the orbit.

        It does not use the variational equations, and so checks them. With Coulomb friction the trace peaks sharply where the
        slider turns round: it then takes some ten thousand samples.
        """
        flow = orbit_kernels.flow(self.drive.speed_drive, False).map(samples)
        turn = self.turn(samples)
        n = self.drive.size
        y = turn.states[:, [1, 3, 2][:n]].T
        jacobians = flow(turn.angle[None, :], y, self.drive.vector(), list(self.parameters.constants()))[1]
        traces = np.trace(np.asarray(jacobians).reshape(n, samples, n), axis1=0, axis2=2)
        return liouville(traces, 2.0 * pi * self.turns)


def scale_of(parameters: FiveBarParameters, drive: Drive, start: ArrayLike) -> NDArray[np.float64]:
    """Magnitudes of y: the crank's length, its speed at the pin, and the crank speed."""
    speed = drive.speed if drive.speed is not None else float(np.asarray(start)[2])
    length = parameters.crank_length
    return np.array([length, length * speed, speed][: drive.size])


def find_orbit(
    parameters: FiveBarParameters,
    *,
    speed: float | None = None,
    torque: float | InductionMotor | Sequence[float | InductionMotor] | None = None,
    slider_force: float = 0.0,
    load: tuple[float, float] = (0.0, 0.0),
    turns: int = 1,
    start: ArrayLike | None = None,
    settle: bool = True,
) -> PeriodicOrbit:
    """Find a periodic motion of the full nonlinear plant.

    Parameters
    ----------
    parameters : FiveBarParameters
    speed : float, optional
        Prescribed crank speed (rad/s).
    torque : float, InductionMotor, or both in a sequence, optional
        Torque on the crank (N.m), in the place of a speed. The mean speed is then part of the solution.
    slider_force : float
        Constant control force on the slider (N).
    load : (float, float)
        Constant load at P (N).
    turns : int
        Turns of the crank in one period.
    start : array_like, shape (2,) or (3,), optional
        Guess of u (m) and u' (m/s) at crank angle 0, and under a torque of the crank speed (rad/s), which is needed there
        unless it follows from a motor's synchronous speed.
    settle : bool
        Whether other ways are tried where Newton's method fails from the guess: from where the motion goes by itself, and,
        at prescribed speed, by bringing down the spring from where the slider hardly moves.

    Returns
    -------
    PeriodicOrbit
        Which of several is found depends on the guess; its stability is not asked for here: see ``verdict``.

    Raises
    ------
    OrbitError
        If none is found; `OrbitAssemblyError` if the links come to the limit of assembly on the way.
    InputError
        If what was given is not usable.

    Examples
    --------
    >>> from linkwork.five_bar.published import SETS
    >>> table = SETS["table-3.1"]
    >>> orbit = find_orbit(table.parameters, speed=table.crank_speed)
    >>> round(100.0 * orbit.start[0], 8), orbit.verdict().stability.value
    (-0.89553115, 'stable')
    """
    require_five_bar(parameters, "a periodic motion")
    if len(load) != 2:
        raise InputError(f"load is {load}: it must be two numbers, its components along x and y")
    parts = () if torque is None else tuple(torque) if isinstance(torque, Sequence) else (torque,)
    motors = [part for part in parts if isinstance(part, InductionMotor)]
    if len(motors) > 1:
        raise InputError(f"{len(motors)} motors: an orbit has one at most")
    drive = Drive(
        speed=speed,
        torque=sum(float(part) for part in parts if not isinstance(part, InductionMotor)),
        motor=motors[0] if motors else None,
        slider_force=slider_force,
        load_x=load[0],
        load_y=load[1],
    )
    return orbit_of(parameters, drive, turns=turns, start=start, settle=settle)


def orbit_of(
    parameters: FiveBarParameters,
    drive: Drive,
    *,
    turns: int = 1,
    start: ArrayLike | None = None,
    settle: bool = True,
) -> PeriodicOrbit:
    """The same as `find_orbit`, from a `Drive`."""
    if turns < 1 or turns != int(turns):
        raise InputError(f"turns is {turns}: a period has a whole number of them, at least one")
    guess = guess_of(drive, start)
    _check_assembly(parameters, guess)
    try:
        return _newton(parameters, drive, turns, guess)
    except OrbitError as failure:
        if not settle:
            raise
        first = failure
    settled = guess.copy()
    status = orbit_kernels.settle(
        drive.speed_drive,
        parameters.constants(),
        drive.vector(),
        1e-8,
        scale_of(parameters, drive, guess),
        SETTLED,
        SETTLING_TURNS,
        settled,
    )
    if status == orbit_kernels.DONE:
        try:
            return _newton(parameters, drive, turns, settled)
        except OrbitError:
            pass
    if drive.speed_drive:
        softened = _soften(parameters, drive, turns)
        if softened is not None:
            return softened
    raise first


def _soften(parameters: FiveBarParameters, drive: Drive, turns: int) -> PeriodicOrbit | None:
    """The orbit met as an added stiffness goes down to nothing, from where the slider hardly moves; None if it is lost."""
    assert drive.speed is not None
    mass = parameters.coupler_mass + parameters.rocker_mass + parameters.slider_mass
    added, guess, ratio = 400.0 * mass * drive.speed**2, np.zeros(2), 0.5
    least = 1e-4 * (parameters.slider_stiffness + mass * drive.speed**2)
    orbit = None
    for _ in range(SOFTENING_STEPS):
        stiffer = replace(parameters, slider_stiffness=parameters.slider_stiffness + added)
        try:
            orbit = _newton(stiffer, drive, turns, guess)
        except OrbitError:
            if orbit is None or ratio > 0.999:
                return None
            # back to the last one that was found, and on in a smaller step
            added /= ratio
            ratio = ratio**0.5
        else:
            if added == 0.0:
                return orbit
            guess = orbit.start
        added = added * ratio if added * ratio > least else 0.0
    return None


def drive_of(inputs: inputs_module.Inputs) -> Drive:
    """The drive of an orbit under the inputs of a run, which must not vary in time.

    Raises
    ------
    InputError
        If an input varies, or nothing drives the crank.
    """
    if not isinstance(inputs, inputs_module.Inputs):
        raise InputError(
            f"the inputs are {type(inputs).__name__}: periodic motions are of five-bars, whose inputs are Inputs"
        )
    constant: dict[str, float] = {}
    motors: list[InductionMotor] = []
    for channel in inputs.CHANNELS:
        for part in inputs.parts(channel):
            if isinstance(part, InductionMotor):
                motors.append(part)
            elif isinstance(part, (int, float, np.floating, np.integer)):
                constant[channel] = constant.get(channel, 0.0) + float(part)
            else:
                raise VaryingInputError(channel, part)
    return Drive(
        speed=constant.get("speed"),
        torque=constant.get("torque", 0.0),
        motor=motors[0] if motors else None,
        slider_force=constant.get("force", 0.0),
        load_x=constant.get("load_x", 0.0),
        load_y=constant.get("load_y", 0.0),
    )


def guess_of(drive: Drive, start: ArrayLike | None) -> NDArray[np.float64]:
    """Where Newton's method begins: ``start``, checked; without it u = u' = 0, at a speed that a motor may have.

    Raises
    ------
    InputError
        If ``start`` does not have the components of the state, or is missing and needed.
    """
    if start is None:
        if drive.speed_drive:
            return np.zeros(2)
        if drive.motor is None:
            raise InputError("under a torque alone the crank speed is needed: give start = (u, u', crank speed)")
        motor = drive.motor
        return np.array([0.0, 0.0, motor.synchronous_speed * (1.0 - 0.5 * motor.breakdown_slip)])
    guess = np.array(start, dtype=float)
    if guess.shape != (drive.size,) or not np.isfinite(guess).all():
        names = ", ".join(f"{name} [{unit}]" for name, unit in _COMPONENTS[: drive.size])
        raise InputError(f"start is {start}: it must be {drive.size} finite numbers, {names}")
    if not drive.speed_drive and not guess[2] > 0.0:
        raise InputError(f"crank speed at the start is {guess[2]} rad/s: it must be above zero")
    return guess


def _check_assembly(parameters: FiveBarParameters, start: NDArray[np.float64]) -> None:
    p = parameters.constants()
    if kinematics.assembly_square(0.0, float(start[0]), p) <= (LIMIT_SINE * p.l3 * p.l4) ** 2:
        raise OrbitAssemblyError(
            f"at crank angle 0 and slider position {start[0]:.6g} m the links cannot be joined", start, np.inf, 0
        )


def _newton(parameters: FiveBarParameters, drive: Drive, turns: int, guess: NDArray[np.float64]) -> PeriodicOrbit:
    n = drive.size
    start, z, report = guess.copy(), np.empty(n * (1 + n)), np.zeros(3)
    scale = scale_of(parameters, drive, guess)
    status = orbit_kernels.solve(
        drive.speed_drive,
        parameters.constants(),
        drive.vector(),
        2.0 * pi * turns,
        INTEGRATOR_TOLERANCE,
        scale,
        MOST_ITERATIONS,
        start,
        z,
        report,
    )
    if status != orbit_kernels.DONE:
        raise failure(status, start, report[0], int(report[1]))
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


def period_from(
    parameters: FiveBarParameters,
    drive: Drive,
    start: NDArray[np.float64],
    turns: int,
    direction: tuple[NDArray[np.float64], Constants] | None = None,
    along: float = 1.0,
) -> Period:
    """Follow the plant over one period from a start that need not be on a periodic orbit.

    Parameters
    ----------
    start : ndarray, shape (n,)
        y at crank angle 0.
    direction : (ndarray of shape (7,), Constants), optional
        Derivatives of `Drive.vector` and of the constants with respect to a parameter lambda; zero without it.
    along : float
        Magnitude of lambda.

    Raises
    ------
    OrbitError
        If the period cannot be followed.
    """
    n = drive.size
    d_drive, d_p = direction or (np.zeros(len(orbit_kernels.DRIVE)), Constants(*[0.0] * len(Constants._fields)))
    z = np.zeros(n * (2 + n))
    z[:n] = start
    status = orbit_kernels.period(
        drive.speed_drive,
        parameters.constants(),
        drive.vector(),
        d_drive,
        d_p,
        2.0 * pi * turns,
        INTEGRATOR_TOLERANCE,
        scale_of(parameters, drive, start),
        along,
        z,
        np.array([0.1, 0.0]),
    )
    if status != orbit_kernels.DONE:
        raise failure(status, start)
    return Period(z[:n] - start, z[n : n + n * n].reshape(n, n).T.copy(), z[n + n * n :].copy())


def failure(status: int, start: NDArray[np.float64], residual: float = np.inf, iterations: int = 0) -> OrbitError:
    """The error that says what a status of `orbit_kernels` means."""
    kind = OrbitAssemblyError if status == orbit_kernels.LIMIT else OrbitError
    return kind(orbit_kernels.REASONS[status], start, float(residual), iterations)


def _times(speed: NDArray[np.float64], turns: int) -> tuple[NDArray[np.float64], float]:
    """Time at equal steps of the crank angle, and the period, by integration of the Fourier series of 1 / w2."""
    n = len(speed)
    c = np.fft.rfft(1.0 / speed) / n
    angle = np.arange(n) * (2.0 * pi * turns / n)
    k = np.arange(len(c)) / turns
    integral = np.zeros(len(c), dtype=complex)
    integral[1:] = c[1:] / (1j * k[1:])
    if n % 2 == 0:
        integral[-1] = 0.0
    wave = np.fft.irfft(integral * n, n)
    mean = float(c[0].real)
    return mean * angle + wave - wave[0], 2.0 * pi * turns * mean


def largest_multipliers(
    rows: Sequence[FiveBarParameters],
    drives: Sequence[Drive],
    guess: ArrayLike | None = None,
    *,
    turns: int = 1,
    tolerance: float = INTEGRATOR_TOLERANCE,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Largest Floquet multiplier of each of a row of mechanisms, every one on its own periodic orbit.

    Each is sought from its neighbours' starts, so that they should be ordered along a line of a chart.

    Parameters
    ----------
    rows, drives : sequences of m
    guess : array_like, shape (n,), optional
        Start of the first; see `find_orbit`.
    turns : int
    tolerance : float
        Bound of the integrator's local error.

    Returns
    -------
    values : ndarray, shape (m,)
        Largest modulus of the multipliers; NaN where there is none.
    starts : ndarray, shape (m, n)
        y at crank angle 0; NaN where there is none.
    status : ndarray of int, shape (m,)
        0 where an orbit was found, else one of `orbit_kernels`: LIMIT, NO_STEP, STALLED, DIVERGED.
    """
    n = drives[0].size
    if any(drive.size != n for drive in drives):
        raise InputError("a row has both drives by speed and by torque: it must have one kind")
    first = guess_of(drives[0], guess)
    monodromies, starts = np.full((len(rows), n * n), np.nan), np.full((len(rows), n), np.nan)
    status = orbit_kernels.solve_row(
        drives[0].speed_drive,
        np.array([tuple(parameters.constants()) for parameters in rows]),
        np.array([drive.vector() for drive in drives]),
        2.0 * pi * turns,
        tolerance,
        np.array([scale_of(parameters, drive, first) for parameters, drive in zip(rows, drives)]),
        MOST_ITERATIONS,
        first,
        starts,
        monodromies,
    )
    values = np.full(len(rows), np.nan)
    good = status == orbit_kernels.DONE
    if good.any():
        values[good] = np.abs(multipliers(monodromies[good].reshape(-1, n, n)))[:, 0]
    return values, starts, status
