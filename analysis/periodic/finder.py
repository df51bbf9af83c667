"""All periodic motions at a point, not one: from many starts, and by dividing out those that are known.

Newton's method finds the motion whose basin a guess happens to lie in. `find_orbits` seeks by two methods that share nothing
but the map over a period: from a set of starts that fills the region where the mechanism can be assembled, and from fewer
starts by deflation, where each motion that was found is divided out and sought no more. Where both find the same number, and
the indices of the motions add up, none was missed as far as can be said.

`find_orbit` returns the one that a machine meets which is run up slowly from rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..mechanisms import InitialState, Parameters, mechanism_of
from ..notebook import Shown, format_count
from ..run import Inputs, driven, started, takes_published
from ..units import Amount, in_si
from .drives import Drive, Torque, drive_of
from .floquet import Stability
from .orbit_kernels import Status
from .orbits import (
    SEARCH_TOLERANCE,
    OrbitError,
    PeriodicOrbit,
    approach,
    guess_of,
    orbit_of,
    period_from,
    require_turns,
    settle_from,
)
from .starts import SAME, scale_of, starts_of
from .sweeps import sweep

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
