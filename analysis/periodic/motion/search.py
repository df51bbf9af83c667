"""All periodic motions at a point, not one: from many starts, and by dividing out those that are known.

Newton's method finds the motion whose basin a guess happens to lie in. `find_orbits` seeks by two methods that share nothing
but the map over a period: from a set of starts that fills the region where the mechanism can be assembled, and from fewer
starts by deflation, where each motion that was found is divided out and sought no more. Where both find the same number, and
the indices of the motions add up, none was missed as far as can be said.

`find_orbit` returns the one that a machine meets which is run up slowly from rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ...display import Shown, format_count
from ...mechanisms import InitialState, Parameters, mechanism_of
from ...run import Inputs, driven, started, takes_published
from ...units import Amount, in_si
from .discretisation import OrbitError, period_from
from .drive import SAME, Drive, Torque, drive_of, scale_of, starts_of
from .floquet import Stability
from .kernels import REASONS, Status
from .orbit import SEARCH_TOLERANCE, PeriodicOrbit, approach, guess_of, orbit_of, require_turns, settle_from

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


#: Starts of the two methods in a round, and rounds at most.
MANY, DEFLATED, ROUNDS = 64, 16, 2

#: Distance, relative to the scale, at which what a search that divides nothing out comes to is taken for a known motion.
_NEAR = 1e-4

#: Speeds of a slow run up from rest: the first relative to the last, and their number.
_FIRST_SPEED, _SPEEDS = 0.2, 80


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Orbits(Shown):
    """The periodic motions at a point.

    Attributes
    ----------
    orbits : tuple of PeriodicOrbit
        By amplitude, the smallest first.
    agreed : bool
        Whether the two methods found the same motions; if not, there may be more.
    index : int
        Sum of the signs of det(I - monodromy matrix) over these motions and those of a period that goes into theirs, each as
        often as it has turns. It is 1 where every motion stays clear of the limit of assembly, since motions come and go in
        pairs of opposite signs: another sum says that one was missed, or lost at that limit. Where motions of several numbers
        of turns were sought, it is the first that is not 1.
    """

    orbits: tuple[PeriodicOrbit, ...]
    agreed: bool
    index: int

    def __len__(self) -> int:
        return len(self.orbits)

    def __repr__(self) -> str:
        words = [orbit.verdict().stability.value for orbit in self.orbits]
        what = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
        sure = "" if self.agreed else "; there may be more"
        return f"<Orbits: {format_count(len(self), 'periodic motion')} ({what}){sure}>"

    @property
    def stable(self) -> tuple[PeriodicOrbit, ...]:
        """Those that a machine can stay in."""
        return tuple(orbit for orbit in self.orbits if orbit.verdict().stability is not Stability.UNSTABLE)


@takes_published(inputs=driven, initial=started)
@in_si(speed="rad/s", torque="N.m")
def find_orbit(
    parameters: Parameters,
    inputs: Inputs | None = None,
    *,
    speed: Amount = None,
    torque: Torque | Amount = None,
    initial: InitialState | None = None,
    turns: int = 1,
    start: ArrayLike | None = None,
    settle: bool = True,
) -> PeriodicOrbit:
    """Find a periodic motion of the full nonlinear plant: of several, the one that a machine meets.

    Parameters
    ----------
    parameters : parameters of a mechanism
        Or a published set or its name, which brings its crank speed, unless another drive is given.
    inputs : Inputs, optional
        What acts, all of it constant; a motor may drive the crank.
    speed : float or str, optional
        Prescribed crank speed (rad/s, or text such as "420 rpm"), in the place of what drives the crank in the inputs.
    torque : float, InductionMotor, or both in a sequence, optional
        Torque on the crank (N.m), in the place of a speed. The mean speed is then part of the solution.
    initial : state at the start, optional
        Where freedoms are held that are neither free nor the crank's: see `Drive`.
    turns : int
        Turns of the crank in one period; where no motion has it, one that repeats itself after fewer is found.
    start : array_like, shape (n,), optional
        Guess of y at crank angle 0: coordinates and rates of what is free beside the crank, of a five-bar u (m) and u' (m/s),
        and under a torque the crank speed (rad/s), which is needed there unless it follows from a motor's synchronous speed.
        At prescribed speed the motion is then the one that Newton's method leads to from there.
    settle : bool
        Whether other motions are sought, and other ways are tried where Newton's method fails from the guess; without it the
        motion is the one that Newton's method leads to.

    Returns
    -------
    PeriodicOrbit
        The one that a machine meets which is run up slowly from rest, if several are stable; ``others`` says how many others
        there are: see `find_orbits`. Whether it is stable is not asked for here: see ``verdict``.

    Raises
    ------
    OrbitError
        If none is found; `OrbitAssemblyError` if the links come to the limit of assembly on the way.
    InputError
        If what was given is not usable.

    Examples
    --------
    >>> from analysis import find_orbit
    >>> orbit = find_orbit("table-3.1", speed="420 rpm")
    >>> round(100.0 * float(orbit.start[0]), 8), orbit.verdict().stability.value, orbit.others
    (-0.89553115, 'stable', 0)
    """
    drive = drive_of(parameters, inputs, initial, speed=speed, torque=torque)
    if not settle or (start is not None and drive.speed_drive):
        return orbit_of(parameters, drive, turns=turns, start=start, settle=settle)
    try:
        first = orbit_of(parameters, drive, turns=turns, start=start)
    except OrbitError as error:
        failure, first = error, None
    found = orbits_of(parameters, drive, turns=turns, start=start, known=() if first is None else (first,))
    if not found.orbits:
        if first is None:
            raise failure
        # it repeats itself after fewer turns, and so after these
        return replace(first, others=0)
    return replace(_met(parameters, drive, found, first, start), others=len(found) - 1)


@takes_published(inputs=driven, initial=started)
@in_si(speed="rad/s", torque="N.m")
def find_orbits(
    parameters: Parameters,
    inputs: Inputs | None = None,
    *,
    speed: Amount = None,
    torque: Torque | Amount = None,
    initial: InitialState | None = None,
    turns: int | Sequence[int] = 1,
    start: ArrayLike | None = None,
) -> Orbits:
    """Find all periodic motions of a period of so many turns.

    Motions of several turns need not branch off those of one: beside a weakly damped motion there may be some of three or four
    turns that appear by a fold, in a range of speeds of some rpm (subharmonic resonance). They are found only where ``turns``
    asks for them.

    Parameters
    ----------
    parameters, inputs, speed, torque, initial
        See `find_orbit`.
    turns : int or sequence of int
        Turns of the crank in one period, or several numbers, such as (1, 2, 3, 4). A motion that repeats itself after fewer
        turns is none of these.
    start : array_like, shape (n,), optional
        A further start; under a torque one is needed for the crank speed, unless it follows from a motor.

    Returns
    -------
    Orbits
        Empty where none was found.

    Raises
    ------
    InputError
        If what was given is not usable.

    Examples
    --------
    >>> from analysis import find_orbits
    >>> found = find_orbits("rig-1-spring-b", speed="1000 rpm")
    >>> [f"{100.0 * orbit.amplitude:.2f} cm, {orbit.verdict().stability.value}" for orbit in found.orbits]
    ['2.02 cm, stable', '5.45 cm, unstable', '13.83 cm, stable']
    >>> found.agreed, found.index
    (True, 1)
    """
    return orbits_of(
        parameters, drive_of(parameters, inputs, initial, speed=speed, torque=torque), turns=turns, start=start
    )


@takes_published()
def orbits_of(
    parameters: Parameters,
    drive: Drive,
    *,
    turns: int | Sequence[int] = 1,
    start: ArrayLike | None = None,
    known: Iterable[PeriodicOrbit] = (),
) -> Orbits:
    """The same as `find_orbits`, from a `Drive`; the ``known`` motions are among them."""
    if not isinstance(turns, int):
        parts = [orbits_of(parameters, drive, turns=number, start=start) for number in sorted(set(turns))]
        return Orbits(
            orbits=tuple(sorted((o for part in parts for o in part.orbits), key=lambda orbit: orbit.amplitude)),
            agreed=all(part.agreed for part in parts),
            index=next((part.index for part in parts if part.index != 1), 1),
        )
    require_turns(turns)
    guess = guess_of(drive.flow(mechanism_of(parameters)), drive, start)
    many, deflated = (_Found(parameters, drive, turns, guess) for _ in range(2))
    for orbit in known:
        many.add(orbit)
    places = [guess, *many.places(MANY, 0)]
    settled = settle_from(parameters, drive, guess, tolerance=SEARCH_TOLERANCE, change=1e-4, turns=50)
    if settled[0] is Status.DONE:
        places.append(settled[1])
    for number in range(ROUNDS):
        for place in places:
            many.seek(place, divide=False)
        # other starts than those of the first method
        for place in (guess, *many.places(DEFLATED, ROUNDS + number), *deflated.between()):
            while deflated.seek(place, divide=True):
                pass
        agreed = many.same_as(deflated)
        if agreed and many.index == 1:
            break
        for orbit in (*deflated.orbits, *many.orbits):
            many.add(orbit)
            deflated.add(orbit)
        places = [*many.places(MANY, number + 1), *many.between()]
    orbits = sorted(many.orbits, key=lambda orbit: orbit.amplitude)
    return Orbits(orbits=tuple(orbits), agreed=agreed, index=many.index)


def passages(orbit: PeriodicOrbit) -> NDArray[np.float64]:
    """y at the beginning of each turn of a period, any of which may be its start; shape (turns, n)."""
    passed = [orbit.start]
    for _ in range(orbit.turns - 1):
        passed.append(passed[-1] + period_from(orbit.parameters, orbit.drive, passed[-1], 1).shift)
    return np.array(passed)


class _Found:
    """The motions that one method has found at a point, from its starts."""

    def __init__(self, parameters: Parameters, drive: Drive, turns: int, guess: NDArray[np.float64]) -> None:
        self.parameters, self.drive, self.turns, self.guess = parameters, drive, turns, guess
        self.scale = scale_of(parameters, drive, guess)
        self.orbits: list[PeriodicOrbit] = []
        #: Starts of all of them: of a motion of several turns one for each, those of shorter periods too.
        self.known = np.empty((0, len(guess)))
        #: See `Orbits`.
        self.index = 0

    def places(self, count: int, number: int) -> list[NDArray[np.float64]]:
        """Starts of a set: see `starts_of`."""
        return list(starts_of(self.parameters, self.drive, self.guess, count, number))

    def knows(self, start: NDArray[np.float64], near: float = SAME) -> bool:
        """Whether a start is of a known motion."""
        away = np.abs(self.known - start) / self.scale
        return bool((away.max(axis=1) < near).any()) if len(away) else False

    def seek(self, place: NDArray[np.float64], *, divide: bool) -> bool:
        """Search from a place; whether a new motion was found."""
        start = approach(self.parameters, self.drive, self.turns, place, self.known if divide else None)
        if start is None or (not divide and self.knows(start, _NEAR)):
            return False
        try:
            return self.add(orbit_of(self.parameters, self.drive, turns=self.turns, start=start, settle=False))
        except OrbitError:
            return False

    def add(self, orbit: PeriodicOrbit) -> bool:
        """Add a motion; whether it is new."""
        if self.knows(orbit.start):
            return False
        passed = passages(orbit)
        # back at the start before its last turn, it is of a shorter period
        away = np.abs(passed - orbit.start) / self.scale
        period = next((n for n in range(1, orbit.turns) if away[n].max() < SAME), orbit.turns)
        self.known = np.vstack([self.known, passed[:period]])
        self.index += period * int(np.sign(np.linalg.det(np.eye(len(orbit.start)) - orbit.monodromy)))
        if period == orbit.turns:
            self.orbits.append(orbit)
        return True

    def same_as(self, other: _Found) -> bool:
        """Whether both have the same motions."""
        if len(self.orbits) != len(other.orbits):
            return False
        return all(other.knows(orbit.start) for orbit in self.orbits)

    def between(self) -> list[NDArray[np.float64]]:
        """Places between each two motions, and around each: where a pair is, the third is often between."""
        places = [
            a + share * (b - a) for n, a in enumerate(self.known) for b in self.known[:n] for share in (0.25, 0.5, 0.75)
        ]
        around = self.places(8, 2 * ROUNDS)
        return places + [a + share * (b - a) for a in self.known for b in around for share in (0.1, 0.3)]


def _met(
    parameters: Parameters, drive: Drive, found: Orbits, first: PeriodicOrbit | None, start: ArrayLike | None
) -> PeriodicOrbit:
    """The motion that a machine meets; where it meets none, the one that Newton's method leads to, else the smallest."""
    stable = found.stable
    if len(stable) == 1:
        return stable[0]
    if not stable:
        return first if first is not None else found.orbits[0]
    guess = guess_of(drive.flow(mechanism_of(parameters)), drive, start)
    arrived = None
    if drive.speed is not None and found.orbits[0].turns == 1:
        speeds = np.geomspace(_FIRST_SPEED * drive.speed, drive.speed, _SPEEDS)
        last = sweep(parameters, speeds, drive=drive).orbits[-1]
        if last is not None and last.turns == 1:
            arrived = last.start
    if arrived is None:
        status, settled = settle_from(parameters, drive, guess, tolerance=1e-8, change=1e-6, turns=2000)
        arrived = settled if status is Status.DONE else None
    if arrived is None:
        return stable[0]
    scale = scale_of(parameters, drive, guess)
    nearest = min(stable, key=lambda orbit: float(np.abs((orbit.start - arrived) / scale).max()))
    return nearest
