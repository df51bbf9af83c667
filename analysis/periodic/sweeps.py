"""Steady motions as a machine meets them: through the speeds up or down, from one to the next, with the jumps between."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ..mechanisms import Parameters, mechanism_of
from ..run import takes_published
from ..units import Amount, in_si
from .drives import Drive
from .floquet import Stability
from .orbit_kernels import REASONS, Status
from .orbits import (
    OrbitError,
    PeriodicOrbit,
    guess_of,
    orbit_of,
    settle_from,
)
from .starts import scale_of

#: Turns for which a motion that has lost its stability is followed to the next steady one, and the change a turn that ends it.
JUMP_TURNS, SETTLED = 5000, 1e-9
#: Change of the amplitude from one speed to the next, relative, beyond which the step is halved, and how often it may be.
FAR, HALVINGS = 0.25, 6
#: Periods, in turns, that a steady motion is looked for with.
PERIODS = (1, 2, 3, 4)


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


@takes_published()
@in_si(speeds="rad/s")
def sweep(
    parameters: Parameters,
    speeds: Amount,
    *,
    drive: Drive | None = None,
    start: ArrayLike | None = None,
    watch: Callable[[float], None] | None = None,
) -> Sweep:
    """Go through crank speeds as a machine would, each begun from the steady motion of the last.

    Where that motion is lost or unstable at the new speed, the plant is followed for up to 5000 turns to the next steady one:
    a jump. Speeds upward and downward may meet different motions.

    Parameters
    ----------
    parameters : parameters of a mechanism
    speeds : array_like, shape (m,)
        rad/s, increasing or decreasing.
    drive : Drive, optional
        What acts beside the speed, which takes the place of its own.
    start : array_like, shape (n,), optional
        y at crank angle 0 at the first speed, of a five-bar u (m) and u' (m/s); at rest at zero without it.
    watch : callable, optional
        Called with every speed.

    Raises
    ------
    InputError
        If the speeds are not positive or not in order.
    """
    grid = np.asarray(speeds, dtype=float)
    steps = np.diff(grid)
    if grid.ndim != 1 or len(grid) == 0 or not (np.isfinite(grid).all() and (grid > 0.0).all()):
        raise InputError("speeds must be positive finite numbers, at least one")
    if not ((steps > 0.0).all() or (steps < 0.0).all()):
        raise InputError("speeds must increase, or decrease, from one to the next")
    orbits: list[PeriodicOrbit | None] = []
    flags: list[str] = []
    jumps: list[Jump] = []
    drive = drive or Drive(speed=float(grid[0]))
    state = guess_of(_at(drive, float(grid[0])).flow(mechanism_of(parameters)), drive, start)
    last: PeriodicOrbit | None = None
    for speed in grid.tolist():
        orbit = None if last is None else _continued(parameters, speed, last)
        flag = ""
        if orbit is None:
            try:
                orbit = _settled(parameters, _at(drive, speed), state)
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


def _at(drive: Drive, speed: float) -> Drive:
    """The drive at a prescribed speed."""
    return replace(drive, speed=speed, torque=0.0, motor=None)


def _continued(
    parameters: Parameters, speed: float, last: PeriodicOrbit, halvings: int = HALVINGS
) -> PeriodicOrbit | None:
    """The stable motion that the last one becomes at another speed; None if it is lost on the way.

    A neighbour that differs much may be another motion that Newton's method fell upon: it is sought again in half steps.
    """
    assert last.drive.speed is not None
    try:
        orbit = orbit_of(parameters, _at(last.drive, speed), turns=last.turns, start=last.start, settle=False)
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


def _settled(parameters: Parameters, drive: Drive, state: Sequence[float] | NDArray[np.float64]) -> PeriodicOrbit:
    """The steady motion that the plant goes to by itself from a state at crank angle 0."""
    start = np.array(state, dtype=float)
    scale, flow = scale_of(parameters, drive, start), drive.flow(mechanism_of(parameters))
    status, start = settle_from(parameters, drive, start, tolerance=1e-9, change=SETTLED, turns=JUMP_TURNS)
    if status is not Status.DONE:
        raise OrbitError(REASONS[status], flow, start, np.inf, 0)
    for turns in PERIODS:
        try:
            orbit = orbit_of(parameters, drive, turns=turns, start=start, settle=False)
        except OrbitError:
            continue
        if orbit.verdict(0.0).stability is Stability.STABLE and np.abs((orbit.start - start) / scale).max() < 1e-3:
            return orbit
    raise OrbitError(f"no steady motion with a period of 1 to 4 turns after {JUMP_TURNS} turns", flow, start, np.inf, 0)
