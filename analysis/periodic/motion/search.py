"""Search for periodic motions: all motions at an operating point, the motion that a machine reaches, or a sweep over speeds.

Newton's method finds one motion, which depends on the guess. `find_orbits` uses two methods that share only the map over a
period: many starts that fill the region in which the mechanism can be assembled, some of which are followed for some turns if
Newton's method fails; and, from fewer starts, deflation, which divides out each motion that was found. If both find the same
motions, and the sum of their indices is 1, it is unlikely that a motion was missed.

`find_orbit` returns the motion that a machine reaches when it is run up slowly from rest; `sweep` steps through speeds as a
machine does, including jumps between motions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, ParameterError

from ...display import NotebookResult, format_count
from ...files import Whole
from ...mechanisms import InitialState, Parameters, find_mechanism
from ...run import Inputs, complete_initial_state, complete_inputs, takes_published
from ...units import Amount, in_si
from .discretisation import OperatingPoint, OrbitError, operating_point, orbit_error
from .drive import SAME, Drive, Torque, mean_rates, spread_starts, start_ranges, steady_drive
from .flow import Stability, index
from .kernels import Status
from .orbit import (
    SEARCH_TOLERANCE,
    PeriodicOrbit,
    approach_orbit,
    approach_uniform_rotation,
    first_guess,
    newton_orbit,
    require_turns,
    settle_motion,
    solve_orbit,
)

FloatArray = NDArray[np.float64]
#: Greatest number of turns for which a motion is integrated to the next steady motion, and change per turn below which it is
#: steady.
JUMP_TURNS, SETTLED = 5000, 1e-9
#: Relative change of the amplitude from one speed to the next beyond which the step is halved, and greatest number of halvings.
FAR, HALVINGS = 0.25, 6
#: Periods, in turns, that a steady motion may have.
PERIODS = (1, 2, 3, 4)
#: Disturbance of an unstable motion, relative to the scale, with which the search for a steady motion starts again.
_DISTURBANCE = 1e-3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Jump:
    """A jump of a sweep from one steady motion to another.

    Attributes
    ----------
    speed : float
        First speed on the new motion (rad/s).
    amplitude_before, amplitude_after : float
        Amplitudes of the two motions (m, or rad for an angle).
    """

    speed: float
    amplitude_before: float
    amplitude_after: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sweep:
    """The steady motions that a machine meets as its speed changes step by step.

    Attributes
    ----------
    speed : ndarray, shape (m,)
        Speeds in the order of the sweep (rad/s).
    orbits : tuple of (PeriodicOrbit or None)
        The steady motion at each speed; None if there was none with a period of 1 to 4 turns, or common periods.
    flags : tuple of str
        For each speed the reason why there is no orbit; empty if there is one.
    jumps : tuple of Jump
    """

    speed: FloatArray
    orbits: tuple[PeriodicOrbit | None, ...]
    flags: tuple[str, ...]
    jumps: tuple[Jump, ...]

    @property
    def amplitude(self) -> np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]:
        """Half the range of the first free coordinate at each speed, shape (m,); masked where there is no steady motion.

        The unit is m for a slider, rad for an angle.
        """
        values = [np.nan if orbit is None else orbit.amplitude for orbit in self.orbits]
        return np.ma.masked_invalid(np.array(values))

    @property
    def turns(self) -> NDArray[np.int64]:
        """Turns of the crank in a period at each speed, shape (m,); 0 where there is no steady motion."""
        return np.array([0 if orbit is None else orbit.crank_turns for orbit in self.orbits])


@takes_published()
@in_si(speeds="rad/s")
def sweep(
    parameters: Parameters, speeds: Amount, *, drive: Drive | None = None, start: ArrayLike | None = None
) -> Sweep:
    """Step through crank speeds as a machine does: each steady motion starts from the steady motion at the last speed.

    Under an induction motor the speeds are the synchronous speeds of its field, set by a frequency converter. If the last
    motion is lost or unstable at the new speed, the mechanism jumps: it is integrated for up to 5000 turns to the next steady
    motion. Rising and falling speeds may lead to different motions.

    Parameters
    ----------
    parameters : parameters of a mechanism
    speeds : array_like, shape (m,) or ()
        Speeds (rad/s), increasing or decreasing.
    drive : Drive, optional
        Drive with the other inputs. The speed of the drive, or the synchronous speed of its motor, is replaced.
    start : array_like, shape (n,), optional
        Guess of y at crank angle 0 for the first speed: for a five-bar u (m) and u' (m/s). By default the coordinates with
        which the mechanism starts, at rest.

    Raises
    ------
    InputError
        If the speeds are not positive or not in order.
    """
    grid = np.array(speeds, dtype=float, ndmin=1)
    steps = np.diff(grid)
    if grid.ndim != 1 or len(grid) == 0 or not (np.isfinite(grid).all() and (grid > 0.0).all()):
        raise InputError("speeds must be positive finite numbers, at least one")
    if not ((steps > 0.0).all() or (steps < 0.0).all()):
        raise InputError("speeds must increase, or decrease, from one to the next")
    orbits: list[PeriodicOrbit | None] = []
    flags: list[str] = []
    jumps: list[Jump] = []
    drive = drive or Drive(speed=float(grid[0]))
    first = _with_speed(drive, float(grid[0]))
    state = first_guess(first.flow(find_mechanism(parameters)), first, start)
    last: PeriodicOrbit | None = None
    for speed in grid.tolist():
        orbit = None if last is None else _follow(parameters, speed, last)
        flag = ""
        if orbit is None:
            try:
                orbit = _settle(operating_point(parameters, _with_speed(drive, speed)), state)
            except OrbitError as error:
                flag = str(error)
            if orbit is not None and last is not None:
                jumps.append(Jump(speed=speed, amplitude_before=last.amplitude, amplitude_after=orbit.amplitude))
        orbits.append(orbit)
        flags.append(flag)
        last = orbit
        if orbit is not None:
            state = orbit.start
    return Sweep(speed=grid, orbits=tuple(orbits), flags=tuple(flags), jumps=tuple(jumps))


def _with_speed(drive: Drive, speed: float) -> Drive:
    """Return the drive with another prescribed speed; if the drive has a motor, with another synchronous speed of the motor."""
    if drive.speed is None and drive.motor is not None:
        return replace(drive, motor=replace(drive.motor, synchronous_speed=speed))
    return replace(drive, speed=speed, torque=0.0, motor=None)


def _speed_of_drive(drive: Drive) -> float | None:
    """Return the prescribed speed, or the synchronous speed of the motor; None under a constant torque."""
    if drive.speed is None and drive.motor is not None:
        return float(drive.motor.synchronous_speed)
    return None if drive.speed is None else float(drive.speed)


def _follow(
    parameters: Parameters, speed: float, last: PeriodicOrbit, halvings: int = HALVINGS
) -> PeriodicOrbit | None:
    """Follow a stable motion to another speed; return None if the motion is lost or becomes unstable.

    ``last`` is the stable motion. If the amplitude changes much, Newton's method may have jumped to another motion: the step is
    then halved, at most ``halvings`` times.
    """
    before = _speed_of_drive(last.drive)
    assert before is not None
    drive = _with_speed(last.drive, speed)
    try:
        orbit = newton_orbit(parameters, drive, turns=last.turns, start=last.start, settle=False)
    except OrbitError:
        orbit = None
    if orbit is not None:
        far = abs(orbit.amplitude - last.amplitude) > FAR * max(orbit.amplitude, last.amplitude)
        if not far and orbit.verdict(0.0).stability is Stability.STABLE:
            return orbit
    if halvings == 0:
        return None
    middle = _follow(parameters, 0.5 * (before + speed), last, halvings - 1)
    return None if middle is None else _follow(parameters, speed, middle, halvings - 1)


def _settle(point: OperatingPoint, state: FloatArray) -> PeriodicOrbit:
    """Return the steady motion on which the mechanism settles from a state at crank angle 0.

    If the steady motion is unstable, such as a pendulum at rest, the mechanism is disturbed and followed once more.
    """
    scale, disturbed = point.scale(state), state
    for _ in range(2):
        status, start = settle_motion(point, disturbed, tolerance=1e-9, change=SETTLED, turns=JUMP_TURNS)
        if status is not Status.DONE:
            raise orbit_error(status, point.flow, start)
        away = None
        for turns in PERIODS:
            try:
                orbit = newton_orbit(point.parameters, point.drive, turns=turns, start=start, settle=False)
            except OrbitError:
                continue
            if np.abs(point.flow.remove_turns(orbit.start - start) / scale).max() >= 1e-3:
                continue
            if orbit.verdict(0.0).stability is Stability.STABLE:
                return orbit
            if away is None:
                values, vectors = np.linalg.eig(orbit.monodromy)
                away = vectors[:, np.abs(values).argmax()].real / scale
        if away is None or not away.any():
            break
        disturbed = start + _DISTURBANCE * scale * away / np.abs(away).max()
    most, after = (n * point.flow.turns for n in (PERIODS[-1], JUMP_TURNS))
    reason = f"no steady motion with a period of up to {most} turns after {after} turns"
    residual = float(np.abs(point.flow.remove_turns(point.period(start, 1).shift) / scale).max())
    raise OrbitError(reason, point.flow, start, residual, 0)


#: Number of starts of each of the two methods in a round, and greatest number of rounds.
MANY, DEFLATED, ROUNDS = 64, 16, 2
#: Greatest number of starts in a round from which the motion is followed because Newton's method fails; greatest number of
#: turns.
_FOLLOWED, _TURNS = 8, 50
#: Distance, relative to the scale, below which a motion that a search without deflation approaches counts as known.
_NEAR = 1e-4
#: Speeds of a slow run up from rest: the first relative to the last, and their number.
_FIRST_SPEED, _SPEEDS = 0.2, 80
#: Distance between two motions, relative to the scale, above which they are different: see `_reached_motion`.
_ARRIVED = 1e-2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Orbits(NotebookResult):
    """The periodic motions found at an operating point.

    Attributes
    ----------
    orbits : tuple of PeriodicOrbit
        The motions in the order of their amplitudes, the smallest first.
    agreed : bool
        Whether the two methods found the same motions and ``index`` is ``index_of_all``; if not, there may be more motions.
    index : int
        Sum of the signs of det(I - monodromy matrix) over these motions and the motions whose period is a fraction of theirs;
        each motion counts once per turn. Motions appear and vanish in pairs of opposite signs: a sum other than
        ``index_of_all`` means that a motion was missed, or lost at the limit of assembly. If several numbers of turns were
        searched, ``index`` is the first sum that differs from ``index_of_all``.
    index_of_all : int
        Value of ``index`` if no motion is missing: 1; or 0 if a link may go round, because motions then come in pairs, like a
        hanging and an inverted pendulum.
    reason : str
        Why Newton's method found no motion from the first guess, such as a limit of assembly; empty if a motion was found.
    """

    orbits: tuple[PeriodicOrbit, ...]
    agreed: bool
    index: int
    index_of_all: int
    reason: str = ""

    def __len__(self) -> int:
        return len(self.orbits)

    def __iter__(self) -> Iterator[PeriodicOrbit]:
        return iter(self.orbits)

    def __repr__(self) -> str:
        if not self.orbits:
            return f"<Orbits: {self.reason or 'no periodic motions'}>"
        words = [orbit.verdict().stability.value for orbit in self.orbits]
        what = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
        sure = "" if self.agreed else "; there may be more"
        return f"<Orbits: {format_count(len(self), 'periodic motion')} ({what}){sure}>"

    @property
    def stable(self) -> tuple[PeriodicOrbit, ...]:
        """The motions that a machine can maintain: all motions that are not unstable."""
        return tuple(orbit for orbit in self.orbits if orbit.verdict().stability is not Stability.UNSTABLE)


@takes_published()
def unsought_hint(parameters: Parameters, drive: Drive) -> str:
    """Return the end of an error message, which says which motions with links that go round were not sought.

    The result is empty if no link can go round.
    """
    names = list(drive.flow(find_mechanism(parameters)).swinging)
    if not names:
        return ""
    also = " or in which several of them go round" if len(names) > 1 else ""
    return f"; motions in which {' or '.join(names)} goes round more than once in a turn{also} were not sought"


@takes_published(inputs=complete_inputs, initial=complete_initial_state)
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
    """Find a periodic motion of the full nonlinear mechanism; if there are several, the motion reached in a slow run-up.

    Parameters
    ----------
    parameters : parameters of a mechanism
        Parameters, a published set, or the name of a published set; a set also gives the crank speed, unless another drive is
        given.
    inputs : Inputs, optional
        Constant inputs; a motor may drive the crank.
    speed : float or str, optional
        Prescribed crank speed (rad/s, or text such as "420 rpm"); replaces the drive of the crank in the inputs.
    torque : float, InductionMotor, or both in a sequence, optional
        Torque on the crank (N.m), instead of a speed. The mean speed is then part of the solution.
    initial : state at the start, optional
        Positions of the degrees of freedom that are held: see `Drive`.
    turns : int
        Turns of the crank in one period, or common periods of gears or several cranks; if there is no such motion, a motion of
        fewer turns is returned.
    start : array_like, shape (n,), optional
        Guess of y at crank angle 0: coordinates and rates of the free degrees of freedom other than the crank, of a five-bar u
        (m) and u' (m/s), and under a torque the crank speed (rad/s), which is needed unless it follows from a motor's
        synchronous speed. If ``start`` is given, the result at prescribed speed is the motion to which Newton's method leads
        from this guess. Under a torque, the result is the stable motion on which the mechanism settles from this guess.
    settle : bool
        Whether other motions are sought, and other starts are tried if Newton's method fails from the guess; if False, the
        result is the motion to which Newton's method leads.

    Returns
    -------
    PeriodicOrbit
        If several motions are stable, the motion that a machine reaches when it is run up slowly from rest; under a motor, with
        slowly rising frequency of the field. ``others`` is the number of other motions: see `find_orbits`. The motion may be
        unstable: see ``verdict``.

    Raises
    ------
    OrbitError
        If no motion is found; `OrbitAssemblyError` if the links come to the limit of assembly in the search.
    InputError, ParameterError
        If an argument is not usable.

    Examples
    --------
    >>> from analysis import find_orbit
    >>> orbit = find_orbit("table-3.1", speed="420 rpm")
    >>> round(100.0 * float(orbit.start[0]), 8), orbit.verdict().stability.value, orbit.others
    (-0.89553115, 'stable', 0)
    """
    drive = steady_drive(parameters, inputs, initial, speed=speed, torque=torque)
    if not settle or (start is not None and drive.speed_drive):
        return newton_orbit(parameters, drive, turns=turns, start=start, settle=settle)
    return reached_orbit(parameters, drive, turns=turns, guess=start, start=start)


@takes_published()
def reached_orbit(
    parameters: Parameters,
    drive: Drive,
    *,
    turns: int = 1,
    guess: ArrayLike | None = None,
    start: ArrayLike | None = None,
) -> PeriodicOrbit:
    """Find the periodic motion that a machine reaches under a `Drive`: see `find_orbit`.

    The search begins at ``guess``. If ``start`` is given, the machine under a torque or a motor begins there; otherwise it is
    run up slowly, if that is possible.
    """
    try:
        first = newton_orbit(parameters, drive, turns=turns, start=guess)
    except OrbitError as error:
        failure, first = error, None
    found = search_orbits(parameters, drive, turns=turns, start=guess, known=() if first is None else (first,))
    if not found.orbits:
        if first is None:
            raise failure
        # the motion repeats itself after fewer turns than were asked for
        return replace(first, others=0)
    met = _reached_motion(found, drive, turns, first, guess, start)
    return replace(met, others=sum(orbit is not met for orbit in found.orbits))


@takes_published(inputs=complete_inputs, initial=complete_initial_state)
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
    """Find all periodic motions with a given number of turns in the period.

    Motions of several turns need not branch off motions of one turn: next to a weakly damped motion, motions of three or four
    turns may appear by a fold, in a range of speeds of some rpm (subharmonic resonance). Only motions with the numbers of turns
    in ``turns`` are found.

    Parameters
    ----------
    parameters, inputs, speed, torque, initial
        See `find_orbit`.
    turns : int or sequence of int
        Turns of the crank in one period, or common periods of gears or several cranks; or several numbers, such as
        (1, 2, 3, 4). A motion that repeats itself after fewer turns does not count.
    start : array_like, shape (n,), optional
        A further start of the search; under a torque ``start`` must give the crank speed, unless this follows from a motor.

    Returns
    -------
    Orbits
        Empty if none was found.

    Raises
    ------
    InputError, ParameterError
        If an argument is not usable.

    Examples
    --------
    >>> from analysis import find_orbits
    >>> found = find_orbits("rig-1-spring-b", speed="1000 rpm")
    >>> [f"{100.0 * orbit.amplitude:.2f} cm, {orbit.verdict().stability.value}" for orbit in found.orbits]
    ['2.02 cm, stable', '5.45 cm, unstable', '13.83 cm, stable']
    >>> found.agreed, found.index
    (True, 1)
    """
    return search_orbits(
        parameters, steady_drive(parameters, inputs, initial, speed=speed, torque=torque), turns=turns, start=start
    )


@takes_published()
def search_orbits(
    parameters: Parameters,
    drive: Drive,
    *,
    turns: int | Sequence[int] = 1,
    start: ArrayLike | None = None,
    known: Iterable[PeriodicOrbit] = (),
) -> Orbits:
    """Find all periodic motions under a `Drive`: see `find_orbits`.

    The motions ``known`` are included in the result, unless several numbers of turns are searched. Motions in which an undriven
    link goes round are sought, too: one link at a time, at most once per turn of the crank. If the drive has a ratio for the
    link, only motions with this ratio are sought.
    """
    if isinstance(turns, (list, tuple, range, set, np.ndarray)):
        numbers = sorted({Whole(least=1)(number, "turns") for number in turns})
        if not numbers:
            raise ParameterError("turns", turns, "have at least one number")
        return join_orbits([search_orbits(parameters, drive, turns=number, start=start) for number in numbers])
    turns = Whole(least=1)(turns, "turns")
    mechanism, known = find_mechanism(parameters), list(known)
    flow, ratios = drive.flow(mechanism), drive.ratios_by_freedom(mechanism)
    drives = [(drive, turns), *((orbit.drive, orbit.turns) for orbit in known)]
    drives += [
        drive.with_rounds(mechanism, {name: sign * times}, turns)
        for name, place in flow.swinging.items()
        if flow.free[place] not in ratios
        for times in range(1, turns * flow.turns + 1)
        for sign in (1, -1)
    ]
    parts: dict[Any, Orbits] = {}
    for each, own_turns in drives:
        kind = tuple(sorted(each.ratios.items()))
        if kind not in parts:
            alike = [orbit for orbit in known if orbit.drive.ratios == each.ratios]
            parts[kind] = _search_rounds(operating_point(parameters, each), own_turns, start, alike)
    return join_orbits(list(parts.values()))


def _search_rounds(
    point: OperatingPoint, turns: int, start: ArrayLike | None, known: Iterable[PeriodicOrbit] = ()
) -> Orbits:
    """Find the periodic motions in which an undriven link goes round if the drive has a ratio for it, and otherwise swings."""
    guess = first_guess(point.flow, point.drive, start)
    require_turns(turns, point, guess)
    ranges = start_ranges(point.parameters, point.drive, guess)
    many, deflated = (_FoundMotions(point, turns, guess, ranges) for _ in range(2))
    whole = point.flow.index_of_all
    for orbit in known:
        many.add(orbit)
    places = [guess, *many.places(MANY, 0)]
    if whole == 0:
        # motions near a uniform rotation may begin at other angles of the link
        even, free = guess.copy(), len(point.flow.free)
        even[free : 2 * free] = mean_rates(point.drive, point.flow, guess)
        near = (
            approach_uniform_rotation(point, turns, even + share * point.flow.angle_periods)
            for share in (0.0, 0.25, 0.5, 0.75)
        )
        places += [place for place in near if place is not None]
    many.follow(guess)
    for number in range(ROUNDS):
        for place in places:
            many.seek(place, divide=False)
        for place in many.failed[:_FOLLOWED]:
            many.follow(place)
        many.failed.clear()
        # starts that the first method does not use
        for place in (guess, *many.places(DEFLATED, ROUNDS + number), *deflated.intermediate_starts()):
            while deflated.seek(place, divide=True):
                pass
        agreed = len(many.orbits) == len(deflated.orbits) and all(deflated.knows(orbit.start) for orbit in many.orbits)
        if agreed and many.index == whole:
            break
        for orbit in (*deflated.orbits, *many.orbits):
            many.add(orbit)
            deflated.add(orbit)
        places = [*many.places(MANY, number + 1), *many.intermediate_starts()]
    orbits, reason = sorted(many.orbits, key=lambda orbit: orbit.amplitude), ""
    if not orbits:
        try:
            solve_orbit(point, turns, guess)
        except OrbitError as error:
            reason = str(error)
    sure = agreed and many.index == whole
    return Orbits(orbits=tuple(orbits), agreed=sure, index=many.index, index_of_all=whole, reason=reason)


def join_orbits(parts: Sequence[Orbits]) -> Orbits:
    """Join the results of several searches at one operating point into one result."""
    whole = parts[0].index_of_all
    return Orbits(
        orbits=tuple(sorted((o for part in parts for o in part.orbits), key=lambda orbit: orbit.amplitude)),
        agreed=all(part.agreed for part in parts),
        index=next((part.index for part in parts if part.index != whole), whole),
        index_of_all=whole,
        reason="" if any(part.orbits for part in parts) else parts[0].reason,
    )


class _FoundMotions:
    """The motions found at an operating point by one of the two methods of the search."""

    def __init__(
        self, point: OperatingPoint, turns: int, guess: FloatArray, ranges: tuple[FloatArray, FloatArray]
    ) -> None:
        self.point, self.turns, self.guess, self.scale = point, turns, guess, point.scale(guess)
        self._ranges = ranges
        self.orbits: list[PeriodicOrbit] = []
        #: Starts of all motions found, one for each turn of a motion; motions of shorter periods are included.
        self.known = np.empty((0, len(guess)))
        #: Sum of the indices of the motions found: see `Orbits.index`.
        self.index = 0
        #: Starts from which Newton's method without deflation failed.
        self.failed: list[FloatArray] = []

    def places(self, count: int, number: int) -> list[FloatArray]:
        """Return the starts in the set with the index ``number``: see `spread_starts`."""
        return list(spread_starts(self.point.parameters, self.point.drive, self.guess, count, number, self._ranges))

    def knows(self, start: FloatArray, near: float = SAME) -> bool:
        """Return whether a start belongs to a known motion, within a distance of ``near`` relative to the scale of y."""
        away = np.abs(self.point.flow.remove_turns(self.known - start)) / self.scale
        return bool((away.max(axis=1) < near).any()) if len(away) else False

    def seek(self, place: FloatArray, *, divide: bool) -> bool:
        """Search from a guess, with the known motions divided out if ``divide``; return whether a new motion was found."""
        start = approach_orbit(self.point, self.turns, place, self.known if divide else None)
        if start is None and not divide:
            self.failed.append(place)
        if start is None or (not divide and self.knows(start, _NEAR)):
            return False
        try:
            return self.add(solve_orbit(self.point, self.turns, self.point.flow.nearest_to_rest(start)))
        except OrbitError:
            return False

    def follow(self, place: FloatArray) -> None:
        """Let the mechanism run from a start for some turns, and search from its last state.

        This finds stable motions, since the mechanism comes close to one of them by itself.
        """
        status, start = settle_motion(self.point, place, tolerance=SEARCH_TOLERANCE, change=1e-4, turns=_TURNS)
        if status is Status.DONE:
            self.seek(start, divide=False)

    def add(self, orbit: PeriodicOrbit) -> bool:
        """Add a motion to the motions found; return whether it is new."""
        if self.knows(orbit.start):
            return False
        passed = orbit.passages()
        # a motion that is back at its start before the last turn has a shorter period
        away = np.abs(self.point.flow.remove_turns(passed - orbit.start)) / self.scale
        period = next((n for n in range(1, len(passed)) if away[n].max() < SAME), len(passed))
        self.known = np.vstack([self.known, passed[:period]])
        self.index += period * int(index(orbit.monodromy))
        if period == len(passed):
            self.orbits.append(orbit)
        return True

    def intermediate_starts(self) -> list[FloatArray]:
        """Return starts between every pair of known motions, where a third motion often lies, and around each known motion."""
        places = [
            a + share * (b - a) for n, a in enumerate(self.known) for b in self.known[:n] for share in (0.25, 0.5, 0.75)
        ]
        around = self.places(8, 2 * ROUNDS)
        return places + [a + share * (b - a) for a in self.known for b in around for share in (0.1, 0.3)]


def _reached_motion(
    found: Orbits,
    drive: Drive,
    turns: int,
    first: PeriodicOrbit | None,
    near: ArrayLike | None,
    start: ArrayLike | None,
) -> PeriodicOrbit:
    """Return the motion that a machine reaches: the stable motion nearest to the motion on which the machine settles.

    The machine begins at ``start``, or is run up slowly, or else settles from ``near``. ``first`` is the motion that Newton's
    method found from the first guess, or None. If no motion is stable, or if a link may go round and no stable motion is near,
    ``first`` is returned. If no motion is stable and ``first`` is None, the result is the motion of the smallest amplitude.
    If the machine settles on no motion, the result is the stable motion of the smallest amplitude. Without damping it settles
    on none: ``first`` is returned if it is marginal, else the marginal motion of the smallest amplitude.
    """
    stable = found.stable
    if not stable:
        return first if first is not None else found.orbits[0]
    if all(orbit.verdict().stability is Stability.MARGINAL for orbit in stable):
        return next((orbit for orbit in stable if orbit is first), stable[0])
    if len(stable) == 1 and (first is None or stable[0].rounds == first.rounds):
        return stable[0]
    point = operating_point(stable[0].parameters, drive)
    guess = first_guess(point.flow, drive, near)
    arrived, pace = None, _speed_of_drive(drive)
    # under a motor a given start is followed itself, without a run-up
    runs_up = drive.speed is not None or start is None
    if runs_up and pace is not None and pace > 0.0 and turns == 1:
        last = sweep(point.parameters, np.geomspace(_FIRST_SPEED * pace, pace, _SPEEDS), drive=drive).orbits[-1]
        if last is not None and last.periods == 1:
            arrived = last
    if arrived is None:
        with suppress(OrbitError):
            arrived = _settle(point, guess)
    if arrived is None:
        return stable[0]
    scale = point.scale(guess)
    away = (point.flow.remove_turns(orbit.passages() - arrived.start) / scale for orbit in stable)
    apart = [float(np.abs(differences).max(axis=1).min()) for differences in away]
    nearest = int(np.argmin(apart))
    if first is not None and turns == 1 and point.flow.angle_periods.any() and apart[nearest] > _ARRIVED:
        return first
    return stable[nearest]
