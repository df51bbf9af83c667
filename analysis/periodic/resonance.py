"""Where the slider resonates, how large, and which harmonics: the true periodic motion over the speed.

`frequency_response` follows the periodic motions of the full nonlinear plant over a range of speeds, past folds, from both
ends of the range, and switches to the motions of twice the period; `sweep` goes through the speeds as a machine would, up or
down, from one steady motion to the next, and tells where it jumps. `natural_frequency` is the classical estimate, from the
mean effective mass. The approximations by harmonic balance are in `analysis.youssef.harmonic_balance`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import find_peaks

from linkwork.errors import InputError, Interrupted, ParameterError
from linkwork.five_bar.parameters import FiveBarParameters

from ..files import write_csv
from ..mechanisms import require_five_bar
from ..numerics.continuation import ContinuationError
from ..run import interruptible, shown
from ..youssef.harmonic_balance import harmonic_balance
from ..youssef.slider_equation import Load, Variant, mean_effective_mass, slider_equation
from . import orbit_kernels
from .branches import Branch, Family, follow, switch
from .floquet import Crossing, Stability
from .orbits import Drive, OrbitError, PeriodicOrbit, guess_of, orbit_of, scale_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Turns for which a motion that has lost its stability is followed to the next steady one, and the change a turn that ends it.
JUMP_TURNS, SETTLED = 5000, 1e-9
#: Change of the amplitude from one speed to the next, relative, beyond which the step is halved, and how often it may be.
FAR, HALVINGS = 0.25, 6
#: Periods, in turns, that a steady motion is looked for with.
PERIODS = (1, 2, 3, 4)
#: How far a maximum of the amplitude stands out, relative to its height, to count as one.
PROMINENCE = 1e-3
#: Distance of two orbits' starts, relative to crank length and speed, below which they are the same.
SAME = 1e-6


def natural_frequency(parameters: FiveBarParameters) -> float:
    """Natural frequency of the slider on its spring (rad/s), from the mean over a turn of the effective mass m22 at u = 0.

    Raises
    ------
    ParameterError
        If there is no spring.
    AssemblyError
        If the four-bar u = 0 cannot make the turn.

    Examples
    --------
    >>> from math import pi
    >>> from linkwork.five_bar.published import SETS
    >>> round(natural_frequency(SETS["rig-1-spring-a"].parameters) * 30.0 / pi, 1)
    591.8
    """
    require_five_bar(parameters, "the natural frequency of the slider")
    if parameters.slider_stiffness <= 0.0:
        raise ParameterError("slider.stiffness", parameters.slider_stiffness, "be above zero for a natural frequency")
    return sqrt(parameters.slider_stiffness / mean_effective_mass(parameters))


@dataclass(frozen=True, slots=True, kw_only=True)
class Extremum:
    """A local maximum or minimum of the amplitude over the parameter.

    Attributes
    ----------
    parameter : float
        Speed (rad/s), or what else varies.
    amplitude : float
        m.
    stability : Stability
        Of the motion there.
    """

    parameter: float
    amplitude: float
    stability: Stability


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Response:
    """The periodic motions over a range of one parameter.

    Attributes
    ----------
    branches : tuple of Branch
        The one from the low end first, then, where it is another, the one from the high end, then those of twice the
        period.
    low, high : float
        The range asked for.
    problems : tuple of str
        What could not be followed, a sentence each with the last good parameter; empty where everything was.
    """

    branches: tuple[Branch, ...]
    low: float
    high: float
    problems: tuple[str, ...]

    @property
    def family(self) -> Family:
        """What varies."""
        return self.branches[0].family

    def maxima(self) -> tuple[Extremum, ...]:
        """Local maxima of the amplitude on the branches of the simple period, by parameter."""
        return self._extrema(1)

    def minima(self) -> tuple[Extremum, ...]:
        """Local minima of the amplitude on the branches of the simple period, by parameter."""
        return self._extrema(-1)

    def _extrema(self, sign: int) -> tuple[Extremum, ...]:
        found = [e for branch in self.branches if branch.turns == 1 for e in extrema(branch, sign)]
        found.sort(key=lambda e: (e.parameter, e.amplitude))
        # a curve that is followed from both ends and arrives at neither has its extrema on both branches
        reach = 1e-5 * (self.high - self.low)
        return tuple(
            e
            for before, e in zip([None, *found], found)
            if before is None
            or abs(e.parameter - before.parameter) > reach
            or abs(e.amplitude - before.amplitude) > 1e-6 * abs(e.amplitude)
        )

    def to_csv(self, path: str | Path) -> Path:
        """Write all branches as one table, numbered in the first column; see `Branch.columns`."""
        tables = [branch.columns() for branch in self.branches]
        columns = {"branch": np.concatenate([np.full(len(b), float(i + 1)) for i, b in enumerate(self.branches)])}
        columns |= {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
        return write_csv(path, columns)

    def plot(self, *, title: str = "", rpm: bool = False, beside: Approximations | None = None) -> Figure:
        """Amplitude, crank torque and pin force over the parameter; see `analysis.figures.plot_branches`."""
        from .. import figures

        others = {} if beside is None else {name: (beside.speed, a) for name, a in beside.amplitudes.items()}
        return figures.plot_branches(self.branches, title=title, rpm=rpm, beside=others)


class ResponseInterrupted(Interrupted):
    """Ctrl-C: the branches that had been followed are in ``response``."""

    def __init__(self, response: Response) -> None:
        self.response = response
        super().__init__(
            f"interrupted with {len(response.branches)} branches followed, the last in part; they are kept"
        )


def frequency_response(
    parameters: FiveBarParameters,
    low: float,
    high: float,
    *,
    drive: Drive | None = None,
    vary: str = "drive.speed",
    start: ArrayLike | None = None,
    doubled: bool = True,
    most_points: int = 5000,
    greatest_step: float = 5e-3,
    progress: bool = False,
) -> Response:
    """Follow the periodic motions of the full nonlinear plant over a range of speeds, or of another parameter.

    Parameters
    ----------
    parameters : FiveBarParameters
    low, high : float
        Range of the parameter: speed in rad/s, torque in N.m, else in the unit of the FMI contract.
    drive : Drive, optional
        What drives the plant; needed where another parameter than the speed varies.
    vary : str
        ``drive.speed``, ``drive.torque`` (the mean speed is then part of the solution: ``start`` is needed), or whatever
        `Family` can vary.
    start : array_like, optional
        Guess of the orbit's start at the low end; see `find_orbit`.
    doubled : bool
        Whether the motions of twice the period are followed from each period doubling.
    most_points : int
        Points of a branch at most.
    greatest_step : float
        Greatest step in scaled arc length: the range has length 1, and the crank's length counts as 1. Narrow resonances need
        small ones.
    progress : bool
        Show a progress bar.

    Returns
    -------
    Response
        What could not be followed is in ``problems``: never a silent gap.

    Raises
    ------
    OrbitError
        If there is no periodic motion to begin with at either end.
    InputError
        If the range is not one.
    ResponseInterrupted
        On Ctrl-C, with the branches that there are.
    """
    require_five_bar(parameters, "the frequency response")
    if drive is None:
        if vary != "drive.speed":
            raise InputError(
                f"{vary} varies: say what drives the plant with drive=Drive(speed=...) or Drive(torque=...)"
            )
        drive = Drive(speed=low)
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f"the range is {low} to {high}: it must be finite and increasing")
    family = Family(parameters=parameters, drive=drive, vary=vary)
    branches: list[Branch] = []
    problems: list[str] = []
    failures: list[OrbitError] = []
    done = 0.0
    with interruptible() as interrupted, shown(progress, high - low, "follow") as show:

        def watch(value: float) -> None:
            nonlocal done
            done = max(done, value - low)
            show(done)

        for value, direction, guess in ((low, 1, start), (high, -1, None)):
            try:
                at, driven = family.at(value)
                if direction < 0 and not driven.speed_drive and branches:
                    # no guess of the speed is to be had at the other end
                    break
                orbit = orbit_of(at, driven, start=guess)
            except OrbitError as error:
                failures.append(error)
                problems.append(f"at {family.tell(value)}: {error}")
                continue
            if any(_passes(branch, value, orbit) for branch in branches):
                continue
            branch = follow(
                family,
                orbit,
                value,
                low=low,
                high=high,
                direction=direction,
                greatest=greatest_step,
                most_points=most_points,
                watch=watch,
                stop=lambda: bool(interrupted),
            )
            branches.append(branch)
            if not branch.reached:
                problems.append(_lost(branch))
            if interrupted:
                break
        if doubled and not interrupted:
            _double(family, branches, problems, low, high, greatest_step, lambda: bool(interrupted))
    if not branches:
        raise failures[0]
    response = Response(branches=tuple(branches), low=low, high=high, problems=tuple(problems))
    if interrupted:
        raise ResponseInterrupted(response)
    return response


def _double(
    family: Family,
    branches: list[Branch],
    problems: list[str],
    low: float,
    high: float,
    greatest_step: float,
    stop: Callable[[], bool],
) -> None:
    """Append the branches of twice the period; one that ends at another doubling is not followed back from there."""
    ends: list[tuple[float, NDArray[np.float64]]] = []
    for special in [s for branch in list(branches) for s in branch.special if s.kind is Crossing.PERIOD_DOUBLING]:
        scale = scale_of(special.orbit.parameters, special.orbit.drive, special.orbit.start)
        reach = high - low
        if any(
            abs(value - special.parameter) < 1e-3 * reach and np.abs((y - special.orbit.start) / scale).max() < 0.1
            for value, y in ends
        ):
            continue
        try:
            branch = switch(family, special, low=low, high=high, greatest=greatest_step, stop=stop)
        except (OrbitError, ContinuationError) as error:
            problems.append(
                f"the branch of twice the period at {family.tell(special.parameter)} is not followed: {error}"
            )
            continue
        branches.append(branch)
        ends.append((float(branch.parameter[-1]), branch.orbits[-1].start))
        if not branch.reached:
            problems.append(_lost(branch))
        if stop():
            return


def _lost(branch: Branch) -> str:
    first, last = (branch.family.tell(float(branch.parameter[i])) for i in (0, -1))
    period = "" if branch.turns == 1 else f"with a period of {branch.turns} turns "
    return f"the branch {period}from {first} is followed to {last} only: {branch.reason}"


def _passes(branch: Branch, value: float, orbit: PeriodicOrbit) -> bool:
    """Whether a branch goes through an orbit at one of its ends."""
    scale = scale_of(orbit.parameters, orbit.drive, orbit.start)
    return any(
        abs(branch.parameter[i] - value) <= 1e-9 * abs(value)
        and float(np.abs((branch.orbits[i].start - orbit.start) / scale).max()) < SAME
        for i in (0, -1)
    )


def extrema(branch: Branch, sign: int = 1) -> tuple[Extremum, ...]:
    """Local maxima (sign +1) or minima (-1) of the amplitude along a branch, each brought to rest on the orbits between.

    The place is found by Brent's method on the orbits at fixed parameters, to 1e-6 of the parameter.
    """
    amplitude = sign * branch.amplitude
    peaks, properties = find_peaks(amplitude, prominence=0.0)
    found = []
    for i, prominence in zip(peaks.tolist(), properties["prominences"].tolist()):
        if prominence < PROMINENCE * abs(amplitude[i]):
            continue
        a, c = sorted((float(branch.parameter[i - 1]), float(branch.parameter[i + 1])))
        # at a fold the parameter turns back, and the greatest amplitude of the neighbours stands
        if not a < branch.parameter[i] < c:
            continue
        near = branch.orbits[i]

        def less(value: float, near: PeriodicOrbit = near) -> float:
            return -sign * _near(branch.family, value, near).amplitude

        try:
            best = minimize_scalar(less, bounds=(a, c), method="bounded", options={"xatol": 1e-6 * (c - a)})
            place, orbit = float(best.x), _near(branch.family, float(best.x), near)
        except OrbitError:
            # next to the limit of assembly a neighbour at a fixed parameter may not be found: the point itself stands
            place, orbit = float(branch.parameter[i]), near
        found.append(Extremum(parameter=place, amplitude=orbit.amplitude, stability=orbit.verdict().stability))
    return tuple(found)


def _near(family: Family, value: float, orbit: PeriodicOrbit) -> PeriodicOrbit:
    parameters, drive = family.at(value)
    return orbit_of(parameters, drive, turns=orbit.turns, start=orbit.start, settle=False)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Jump:
    """Where a sweep left one steady motion for another.

    Attributes
    ----------
    speed : float
        The first on the new motion (rad/s).
    amplitude_before, amplitude_after : float
        m.
    turns_before, turns_after : int
        Turns in a period: a motion that doubles its period changes its amplitude but little.
    """

    speed: float
    amplitude_before: float
    amplitude_after: float
    turns_before: int
    turns_after: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sweep:
    """The steady motions that a machine meets as its speed changes step by step.

    Attributes
    ----------
    speed : ndarray, shape (m,)
        rad/s, in the order of the sweep.
    orbits : tuple of (PeriodicOrbit or None)
        None where no steady motion with a period of 1 to 4 turns was met.
    flags : tuple of str
        Why there is none; empty where there is one.
    jumps : tuple of Jump
    """

    speed: NDArray[np.float64]
    orbits: tuple[PeriodicOrbit | None, ...]
    flags: tuple[str, ...]
    jumps: tuple[Jump, ...]

    @property
    def amplitude(self) -> np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]:
        """Half the range of the slider position (m), masked where there is no steady motion; shape (m,)."""
        values = [np.nan if orbit is None else orbit.amplitude for orbit in self.orbits]
        return np.ma.masked_invalid(np.array(values))

    @property
    def turns(self) -> NDArray[np.int64]:
        """Turns in a period; 0 where there is no steady motion. Shape (m,)."""
        return np.array([0 if orbit is None else orbit.turns for orbit in self.orbits])


def sweep(
    parameters: FiveBarParameters,
    speeds: ArrayLike,
    *,
    start: ArrayLike | None = None,
    watch: Callable[[float], None] | None = None,
) -> Sweep:
    """Go through crank speeds as a machine would, each begun from the steady motion of the last.

    Where that motion is lost or unstable at the new speed, the plant is followed for up to 5000 turns to the next steady one:
    a jump. Speeds upward and downward may meet different motions.

    Parameters
    ----------
    parameters : FiveBarParameters
    speeds : array_like, shape (m,)
        rad/s, increasing or decreasing.
    start : array_like, shape (2,), optional
        u (m) and u' (m/s) at crank angle 0 at the first speed; at rest at u = 0 without it.
    watch : callable, optional
        Told every speed.

    Raises
    ------
    InputError
        If the speeds are not positive or not in order.
    """
    require_five_bar(parameters, "a sweep of the speed")
    grid = np.asarray(speeds, dtype=float)
    steps = np.diff(grid)
    if grid.ndim != 1 or len(grid) == 0 or not (np.isfinite(grid).all() and (grid > 0.0).all()):
        raise InputError("speeds must be positive finite numbers, at least one")
    if not ((steps > 0.0).all() or (steps < 0.0).all()):
        raise InputError("speeds must increase, or decrease, from one to the next")
    orbits: list[PeriodicOrbit | None] = []
    flags: list[str] = []
    jumps: list[Jump] = []
    state = guess_of(Drive(speed=float(grid[0])), start)
    last: PeriodicOrbit | None = None
    for speed in grid.tolist():
        drive = Drive(speed=speed)
        orbit = None if last is None else _continued(parameters, speed, last)
        flag = ""
        if orbit is None:
            try:
                orbit = _settled(parameters, drive, state)
            except OrbitError as error:
                flag = str(error)
            if orbit is not None and last is not None:
                jumps.append(
                    Jump(
                        speed=speed,
                        amplitude_before=last.amplitude,
                        amplitude_after=orbit.amplitude,
                        turns_before=last.turns,
                        turns_after=orbit.turns,
                    )
                )
        orbits.append(orbit)
        flags.append(flag)
        last = orbit
        if orbit is not None:
            state = orbit.start
        if watch:
            watch(speed)
    return Sweep(speed=grid, orbits=tuple(orbits), flags=tuple(flags), jumps=tuple(jumps))


def _continued(
    parameters: FiveBarParameters, speed: float, last: PeriodicOrbit, halvings: int = HALVINGS
) -> PeriodicOrbit | None:
    """The stable motion that the last one becomes at another speed; None if it is lost on the way.

    A neighbour that differs much may be another motion that Newton's method fell upon: it is sought again in half steps.
    """
    assert last.drive.speed is not None
    try:
        orbit = orbit_of(parameters, Drive(speed=speed), turns=last.turns, start=last.start, settle=False)
    except OrbitError:
        orbit = None
    if orbit is not None:
        far = abs(orbit.amplitude - last.amplitude) > FAR * max(orbit.amplitude, last.amplitude)
        if not far and orbit.verdict(0.0).stability is Stability.STABLE:
            return orbit
    if halvings == 0:
        return None
    middle = _continued(parameters, 0.5 * (last.drive.speed + speed), last, halvings - 1)
    return None if middle is None else _continued(parameters, speed, middle, halvings - 1)


def _settled(
    parameters: FiveBarParameters, drive: Drive, state: Sequence[float] | NDArray[np.float64]
) -> PeriodicOrbit:
    """The steady motion that the plant goes to by itself from a state at crank angle 0."""
    start = np.array(state, dtype=float)
    scale = scale_of(parameters, drive, start)
    status = orbit_kernels.settle(
        drive.speed_drive, parameters.constants(), drive.vector(), 1e-9, scale, SETTLED, JUMP_TURNS, start
    )
    if status != orbit_kernels.DONE:
        raise OrbitError(orbit_kernels.REASONS[status], start, np.inf, 0)
    for turns in PERIODS:
        try:
            orbit = orbit_of(parameters, drive, turns=turns, start=start, settle=False)
        except OrbitError:
            continue
        if orbit.verdict(0.0).stability is Stability.STABLE and np.abs((orbit.start - start) / scale).max() < 1e-3:
            return orbit
    raise OrbitError(f"no steady motion with a period of 1 to 4 turns after {JUMP_TURNS} turns", start, np.inf, 0)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Approximations:
    """Amplitudes by the classical approximations over the speed, from the linear equation about u = 0.

    Attributes
    ----------
    parameters : FiveBarParameters
        Without Coulomb friction, which a linear equation cannot hold.
    load : Load
        Constant forces.
    speed : ndarray, shape (m,)
        rad/s.
    amplitudes : mapping
        Half the range of u (m) by the name of the approximation, each of shape (m,).
    """

    parameters: FiveBarParameters
    load: Load
    speed: NDArray[np.float64]
    amplitudes: Mapping[str, NDArray[np.float64]]

    def at(self, speed: float) -> dict[str, float]:
        """The approximations at a speed (rad/s), not interpolated."""
        return _approximate(self.parameters, speed, self.load)

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """As a table, by name with unit."""
        return {"drive.speed [rad/s]": self.speed} | {f"{name} [m]": v for name, v in self.amplitudes.items()}


def approximations(response: Response, points: int = 160) -> Approximations:
    """The classical approximations over the range of a response: two harmonics as printed and put right, and ten harmonics.

    Raises
    ------
    InputError
        If it is not the speed that varies.
    """
    if response.family.vary != "drive.speed":
        raise InputError(f"{response.family.name} varies: the approximations are over the speed")
    parameters = replace(response.family.parameters, slider_coulomb_friction=0.0)
    drive = response.family.drive
    load = Load(x=drive.load_x, y=drive.load_y, slider=drive.slider_force)
    speeds = np.linspace(response.low, response.high, points)
    rows = [_approximate(parameters, speed, load) for speed in speeds.tolist()]
    return Approximations(
        parameters=parameters,
        load=load,
        speed=speeds,
        amplitudes={name: np.array([row[name] for row in rows]) for name in rows[0]},
    )


#: Approximations by name: variant of the linear equation and harmonics balanced.
_APPROXIMATIONS = {
    "two harmonics, printed (4.21)": (Variant.PRINTED, 2),
    "two harmonics": (Variant.SECOND_ORDER, 2),
    "ten harmonics": (Variant.EXACT, 10),
}


def _approximate(parameters: FiveBarParameters, speed: float, load: Load) -> dict[str, float]:
    return {
        name: parameters.rocker_length
        * harmonic_balance(slider_equation(parameters, speed, variant=variant, load=load), order).amplitude
        for name, (variant, order) in _APPROXIMATIONS.items()
    }
