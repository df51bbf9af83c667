"""Compute the frequency response: at which speeds the mechanism resonates, how strongly, and with which harmonics.

`frequency_response` follows the periodic motions of the full nonlinear mechanism over a range of speeds, past folds, from both
ends of the range. At branch points it switches to the branch that crosses, and at period doublings to the motions of twice the
period, repeatedly if wanted. `with_isolas` adds the motions to which none of these branches leads: closed curves over the
parameter, and branches that reach neither end. `natural_frequency` gives the classical estimate of the resonance from the mean
effective mass.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, Interrupted, ParameterError
from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ...display import NotebookResult, format_count
from ...files import Whole, write_csv
from ...mechanisms import Parameters, find_mechanism
from ...numerics import symbolic
from ...numerics.continuation import ContinuationError
from ...numerics.workers import record_interrupts
from ...run import inertia_and_stiffness, require_kind, show_progress, takes_published
from ...units import Amount, quantity
from .. import motion
from ..stability import SpecialPoint
from .advice import AvoidedRange, Extremum, FoldJump, extrema, fold_jumps, ranges_to_avoid
from .branch import GREATEST, GREATEST_MULTIPLIER, Branch, describe, follow, follow_both, has_motion, switch

#: Number of crank angles over which the effective mass is averaged.
MASS_SAMPLES = 1024
#: Generator of a lattice of MASS_SAMPLES points over the angles of several cranks: the odd number next to 0.618 MASS_SAMPLES,
#: where 0.618 is the golden ratio.
LATTICE = 633


def oscillating_freedoms(mechanism: Mechanism) -> tuple[int, ...]:
    """Return the indices of the degrees of freedom that are not cranks."""
    return tuple(number for number in range(len(mechanism.freedoms)) if number not in mechanism.cyclic_freedoms)


def first_freedom(mechanism: Mechanism) -> int:
    """Return the index of the first degree of freedom that is not a crank; raise ParameterError if there is none."""
    for number in oscillating_freedoms(mechanism):
        return number
    raise ParameterError("mechanism", mechanism.name, "have a second freedom for a natural frequency")


def stiffness_name(mechanism: Mechanism) -> str:
    """Return the FMI name of the stiffness of the spring of the only degree of freedom that is not a crank.

    The name is, for example, ``slider.stiffness``. It is empty if there is no such spring, or if the mechanism has several
    oscillating degrees of freedom or a spring with a force law, so that no natural frequency is that of this spring alone.
    """
    others = oscillating_freedoms(mechanism)
    if len(others) != 1 or mechanism.names("law"):
        return ""
    return next(iter(mechanism.names("stiffness", mechanism.freedoms[others[0]].coordinate)), "")


def free_position_name(mechanism: Mechanism, stiffness: str) -> str:
    """Return the FMI name of the position where the spring with the named stiffness exerts no force; empty if always 0."""
    owner = stiffness.rpartition(".")[0] + "."
    return next((name for name in mechanism.names("spring") if name.startswith(owner)), "")


@takes_published()
def mean_effective_mass(parameters: Parameters) -> float:
    """Return the effective mass of the first degree of freedom that is not a crank, averaged over a crank turn.

    The unit is kg, for an angle kg.m2.

    This degree of freedom is held where its spring exerts no force, or at 0 if `stiffness_name` finds no spring. For a five-bar
    the result is the mean of m22.

    Raises
    ------
    ParameterError, InputError
        If there is no such degree of freedom, or no crank.
    AssemblyError
        If the links cannot be joined over the whole turn with this degree of freedom held.
    """
    mechanism = find_mechanism(parameters)
    cranks, freedom = motion.find_cranks(mechanism), first_freedom(mechanism)
    if not cranks:
        raise InputError(f"a {mechanism.name} has no freedom that turns: it has no mean over a turn")
    own = stiffness_name(mechanism)
    free = free_position_name(mechanism, own) if own else ""
    position = float(getattr(parameters, field_name(free))) if free else 0.0
    # for several cranks: the points of a lattice, which fill all combinations of angles evenly
    turn = np.linspace(0.0, 1.0, MASS_SAMPLES, endpoint=False)
    angles = [
        mechanism.freedoms[crank.freedom].period * turn[np.arange(MASS_SAMPLES) * LATTICE**n % MASS_SAMPLES]
        for n, crank in enumerate(cranks)
    ]
    p = parameters.constants()
    for at in zip(*(each.tolist() for each in angles)):
        x = [0.0] * mechanism.size
        x[freedom] = position
        for crank, angle in zip(cranks, at):
            x[crank.freedom] = angle
        mechanism.check_assembly(x, p)
    resting = inertia_and_stiffness(mechanism, tuple(crank.freedom for crank in cranks), freedom)
    held = np.full(MASS_SAMPLES, position)
    mass, _ = symbolic.evaluate_arrays(resting, *angles, held, list(p))
    return float(mass.mean())


@takes_published()
def natural_frequency(parameters: Parameters) -> float:
    """Compute the natural frequency (rad/s) of the only degree of freedom that is not a crank, from its mean effective mass.

    Only the spring of this degree of freedom counts, such as ``slider.stiffness``. The mass is the mean over a turn while the
    coordinate is held where this spring exerts no force; gravity and all other forces are ignored.
    `analysis.linear.natural_modes` computes the natural frequencies of every mechanism about its equilibrium.

    Raises
    ------
    ParameterError
        If there is no spring; or if there are other springs or further degrees of freedom, on which the frequency depends.
    AssemblyError
        If the crank cannot make a turn while the coordinate is held.

    Examples
    --------
    >>> from math import pi
    >>> from analysis import natural_frequency
    >>> round(natural_frequency("rig-1-spring-a") * 30.0 / pi, 1)
    591.9
    """
    mechanism = find_mechanism(parameters)
    first_freedom(mechanism)
    name = stiffness_name(mechanism)
    if not name:
        raise ParameterError(
            "mechanism",
            mechanism.name,
            "have one freedom beside its cranks, with one spring along it, for the natural frequency of this spring alone: "
            "natural_modes has those of all freedoms and springs",
        )
    alone = f"be 0 for the natural frequency of {name} alone: natural_modes has that of all springs"
    for other in mechanism.names("stiffness"):
        if other != name and (stiffness := getattr(parameters, field_name(other))):
            raise ParameterError(other, stiffness, alone)
    spring = getattr(parameters, field_name(name))
    if spring <= 0.0:
        raise ParameterError(name, spring, "be above zero for a natural frequency")
    return sqrt(spring / mean_effective_mass(parameters))


#: Largest multiplier up to which a motion of several turns is followed, unless its branch begins at a motion of one turn.
#: Before a multiplier has grown so far, another period doubling or a fold occurs, and a machine changes to another motion.
GREATEST_OF_SEVERAL = 100.0


#: Warning about ranges to avoid if no motions off the branches were sought.
UNSOUGHT = "motions that no branch leads to were not sought"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Response(NotebookResult):
    """The periodic motions over a range of one parameter.

    Attributes
    ----------
    branches : tuple of Branch
        First the branch from the low end, then the branch from the high end if it is a different one, then branches of the same
        period that cross these, then the branches of twice the period, of four times the period and so on, then branches that
        are connected with none of these.
    low, high : float
        Range of the parameter.
    problems : tuple of str
        One sentence for each branch that could not be followed, with its last good parameter; empty if all were followed.
    sought : int
        Number of values of the parameter at which all motions were sought. If it is 0, there may be stable motions to which no
        branch leads and which `speeds_to_avoid` does not take into account: see `with_isolas`.
    """

    branches: tuple[Branch, ...]
    low: float
    high: float
    problems: tuple[str, ...]
    sought: int = 0

    def __repr__(self) -> str:
        parts = f"{format_count(len(self.branches), 'branch')}, {format_count(len(self.problems), 'problem')}"
        sought = f"{self.caution}: with_isolas" if self.caution else f"all motions sought at {self.sought_values} only"
        return f"<Response: {describe(self.branches)}; {parts}; {sought}>"

    @property
    def caution(self) -> str:
        """Warning that `speeds_to_avoid` may miss motions to which no branch leads; empty if these motions were sought."""
        return "" if self.sought else UNSOUGHT

    @property
    def sought_values(self) -> str:
        """Text that tells at how many values of the parameter all motions were sought; more values may find more motions."""
        return f"{format_count(self.sought, 'value')} of {self.family.name}"

    @property
    def family(self) -> motion.Family:
        """The family: mechanism and drive as functions of the parameter that varies."""
        return self.branches[0].family

    @property
    def speeds_to_avoid(self) -> tuple[AvoidedRange, ...]:
        """Ranges of the speed, or of another parameter that varies, that a machine should avoid, each with its reason.

        The ranges follow from the branches. Stable motions to which no branch leads are included only after `with_isolas`.
        """
        return ranges_to_avoid(self.branches, self.low, self.high)

    @property
    def jumps(self) -> tuple[FoldJump, ...]:
        """The jumps of the machine at the folds where a stable motion ends."""
        return fold_jumps(self.branches)

    def maxima(self) -> tuple[Extremum, ...]:
        """Return the local maxima of the amplitudes of all free coordinates, sorted by parameter.

        Motions with a multiplied period are left out.
        """
        return self._extrema(1)

    def minima(self) -> tuple[Extremum, ...]:
        """Return the local minima of the amplitudes of all free coordinates, sorted by parameter; see `maxima`."""
        return self._extrema(-1)

    def _extrema(self, sign: int) -> tuple[Extremum, ...]:
        found = [e for branch in self.branches if branch.periods == 1 for e in extrema(branch, sign)]
        found.sort(key=lambda e: (e.coordinate, e.parameter, e.amplitude))
        # if a curve was followed from both ends and did not reach the other end, both branches have the same extrema
        reach = 1e-5 * (self.high - self.low)
        once = (
            e
            for before, e in zip([None, *found], found)
            if before is None
            or e.coordinate != before.coordinate
            or abs(e.parameter - before.parameter) > reach
            or abs(e.amplitude - before.amplitude) > 1e-6 * abs(e.amplitude)
        )
        return tuple(sorted(once, key=lambda e: (e.parameter, e.coordinate, e.amplitude)))

    def to_csv(self, path: str | Path) -> Path:
        """Write all branches as one CSV table: the number of the branch, then the columns of `Branch.columns`."""
        tables = [branch.columns() for branch in self.branches]
        columns = {"branch": np.concatenate([np.full(len(b), float(i + 1)) for i, b in enumerate(self.branches)])}
        columns |= {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}
        return write_csv(path, columns)


class ResponseInterrupted(Interrupted):
    """The computation of a response was interrupted by Ctrl-C; ``response`` has the branches followed so far."""

    def __init__(self, response: Response) -> None:
        self.response = response
        super().__init__(
            f"interrupted with {format_count(len(response.branches), 'branch')} followed, the last in part; they are kept"
        )


@takes_published(drive=motion.published_drive)
def frequency_response(
    parameters: Parameters,
    low: Amount,
    high: Amount,
    *,
    drive: motion.Drive | None = None,
    vary: str = "",
    start: ArrayLike | None = None,
    doublings: int = 1,
    most_points: int = 5000,
    greatest_step: float = 5e-3,
    progress: bool = False,
) -> Response:
    """Follow the periodic motions of the full nonlinear mechanism over a range of speeds, or of another parameter.

    Parameters
    ----------
    parameters : parameters of a mechanism
        Parameters, a published set, or the name of a published set.
    low, high : float or str
        Range of the parameter: speed in rad/s, torque in N.m, other parameters in their FMI unit; or text such as "420 rpm".
    drive : Drive, optional
        Required if a parameter other than the speed varies. A published set is by default driven at its own speed.
    vary : str
        FMI name of the parameter that varies: by default the crank speed; ``drive.torque`` (the mean speed is then an unknown,
        and ``start`` is required); or any parameter that `Family` can vary.
    start : array_like, optional
        Guess of the orbit's start at the low end; see `find_orbit`.
    doublings : int
        Number of successive doublings of the period: 1 for the motions of twice the period from each period doubling, 2 for
        the motions of four times the period as well, and so on. Branches of four times the period and more end when their
        largest multiplier passes `GREATEST_OF_SEVERAL`.
    most_points : int
        Greatest number of points of a branch.
    greatest_step : float
        Greatest step of the parameter, relative to the range. Narrow resonances need small steps.
    progress : bool

    Returns
    -------
    Response
        ``problems`` names every branch that could not be followed. Motions to which no branch leads are not sought here but by
        `with_isolas`, which takes one to ten times as long.

    Raises
    ------
    OrbitError
        If no periodic motion is found at either end of the range.
    InputError, ParameterError
        If the range is not finite and increasing, or another argument is not usable.
    ResponseInterrupted
        On Ctrl-C, with the branches followed so far.

    Examples
    --------
    >>> from analysis import frequency_response
    >>> response = frequency_response("rig-2-spring-c", "500 rpm", "650 rpm", doublings=0)
    >>> [f"{100.0 * peak.amplitude:.3f} cm" for peak in response.maxima()]
    ['1.715 cm']
    """
    mechanism = find_mechanism(parameters)
    vary = vary or motion.default_variable(mechanism, drive)
    unit = motion.parameter_unit(mechanism, vary)
    low, high = quantity(low, unit, "low"), quantity(high, unit, "high")
    if drive is None:
        if vary not in motion.speed_names(mechanism):
            raise InputError(
                f"{vary} varies: say what drives the plant with drive=Drive(speed=...) or Drive(torque=...)"
            )
        drive = motion.Drive(speed=low)
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f"the range is {low} to {high}: it must be finite and increasing")
    doublings = Whole(least=0)(doublings, "doublings")
    family = motion.Family(parameters=parameters, drive=drive, vary=vary)
    with record_interrupts() as interrupted, show_progress(progress, high - low, "following the response") as show:
        search = _Search(family, low, high, greatest_step, lambda: bool(interrupted))
        search.follow_from_both_ends(start, most_points, show)
        if not interrupted:
            search.follow_branch_points(search.branches)
        if not interrupted:
            search.follow_doublings(doublings)
    if not search.branches:
        raise search.failures[0]
    response = Response(branches=tuple(search.branches), low=low, high=high, problems=tuple(search.problems))
    if interrupted:
        raise ResponseInterrupted(response)
    return response


@dataclass(slots=True)
class _Search:
    """State of a frequency response while its branches are followed: the branches so far, and the problems."""

    family: motion.Family
    low: float
    high: float
    greatest: float
    stop: Callable[[], bool]
    branches: list[Branch] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    failures: list[motion.OrbitError | ContinuationError] = field(default_factory=list)

    def _arguments(self, **more: Any) -> dict[str, Any]:
        """Return the arguments with which all branches are followed: see `follow`."""
        own = {"low": self.low, "high": self.high, "greatest": self.greatest, "stop": lambda _: self.stop()}
        return own | more

    def follow_from_both_ends(self, start: ArrayLike | None, most_points: int, show: Callable[[float], None]) -> None:
        """Follow the branch from the low end of the range, and the branch from the high end if it is a different branch.

        ``show`` is called with the length of the part of the range that is done.
        """
        done = 0.0

        def watch(value: float) -> None:
            nonlocal done
            done = max(done, value - self.low)
            show(done)

        for value, direction, guess in ((self.low, 1, start), (self.high, -1, None)):
            at, driven = self.family.operation(value)
            if direction < 0 and not driven.speed_drive and (self.branches or driven.motor is None):
                # under a torque there is no guess of the speed at the high end, or only the motor's
                break
            try:
                orbit = motion.newton_orbit(at, driven, start=guess)
                if any(_passes(branch, value, orbit) for branch in self.branches):
                    continue
                family = self.family.with_ratios(orbit.drive.ratios)
                how = self._arguments(direction=direction, most_points=most_points, watch=watch)
                branch = follow(family, orbit, value, **how)
            except (motion.OrbitError, ContinuationError) as error:
                self.failures.append(error)
                self.problems.append(f"at {self.family.format_value(value)}: {error}")
                continue
            self._keep(branch)
            if self.stop():
                break

    def follow_doublings(self, times: int) -> None:
        """Follow the branches of twice the period, four times the period and so on: the period is doubled ``times`` times.

        A branch that begins and ends at a period doubling is followed from one of these points only.
        """
        ends: list[tuple[int, float, NDArray[np.float64]]] = []

        def is_end(special: SpecialPoint) -> bool:
            orbit, reach = special.orbit, 1e-3 * (self.high - self.low)
            return any(
                turns == 2 * orbit.turns and abs(value - special.parameter) < reach and orbit.distance(y) < 0.1
                for turns, value, y in ends
            )

        doubled, without = self.branches, list[str]()
        for generation in range(times):
            largest = GREATEST_OF_SEVERAL if generation else GREATEST_MULTIPLIER
            points = [(b.family, s) for b in doubled for s in b.special if s.kind is motion.Crossing.PERIOD_DOUBLING]
            doubled = []
            for family, special in points:
                if is_end(special):
                    continue
                try:
                    branch = switch(family, special, **self._arguments(largest=largest))
                except motion.OrbitError as error:
                    place = self.family.format_value(special.parameter)
                    self.problems.append(f"the branch of twice the period at {place} is not followed: {error}")
                    continue
                except ContinuationError:
                    without.append(self.family.format_value(special.parameter))
                    continue
                strayed = largest < GREATEST_MULTIPLIER and branch.orbits[-1].largest > largest
                self._keep(branch, strayed=strayed)
                doubled.append(branch)
                ends.append((branch.turns, float(branch.parameter[-1]), branch.orbits[-1].start))
                if self.stop():
                    break
            else:
                self.follow_branch_points(doubled)
        if without:
            self.problems.append(f"no motion of twice the period was found near {', '.join(without)}")

    def follow_branch_points(self, branches: list[Branch]) -> None:
        """Follow the branches that leave ``branches`` at branch points, then the branches that leave the new branches.

        The new branches are added to the list. Only branch points count next to which a motion of the branch is stable or
        marginal.
        """
        failed: list[tuple[SpecialPoint, str]] = []
        for branch in branches:
            for special, side in product(branch.special, (1.0, -1.0)):
                least = min(orbit.largest for orbit in branch.orbits[special.after : special.after + 2])
                if special.kind is not motion.Crossing.BRANCH_POINT or least > 1.0 + motion.TOLERANCE:
                    continue
                follow_on = partial(switch, branch.family, special, **self._arguments(side=side))
                try:
                    if self._count_passages(branches, special) > 1:
                        continue
                    first = follow_on(most_points=1)
                    if self._knows(first.orbits[0], float(first.parameter[0])):
                        continue
                    found = follow_on()
                except (motion.OrbitError, ContinuationError) as error:
                    failed.append((special, str(error)))
                    continue
                self._keep(found)
                if branches is not self.branches:
                    branches.append(found)
                if self.stop():
                    return
        places = {
            self.family.format_value(special.parameter): error
            for special, error in failed
            if self._count_passages(branches, special) < 2
        }
        self.problems += [f"the branch that crosses at {place} is not followed: {places[place]}" for place in places]

    def _count_passages(self, branches: Iterable[Branch], special: SpecialPoint) -> int:
        """Return the number of branches that pass through a special point."""
        orbit, width = special.orbit, self.high - self.low

        def is_same(other: SpecialPoint) -> bool:
            near = abs(other.parameter - special.parameter) < _SAME_POINT * width
            return other.kind is special.kind and near and orbit.distance(other.orbit.start) < sqrt(_SAME_POINT)

        return sum(any(map(is_same, branch.special)) for branch in branches if branch.turns == orbit.turns)

    def seek(self, value: float, turns: int) -> None:
        """Find the motions of ``turns`` turns at a value of the parameter; follow each motion that lies on no known branch."""
        parameters, drive = self.family.operation(value)
        start = None
        if not drive.speed_drive:
            # under a torque only a known motion gives a guess of the speed
            simple = [b for b in self.branches if b.periods == 1]
            nearest = min(simple, key=lambda b: float(np.abs(b.parameter - value).min()))
            start = nearest.orbits[int(np.abs(nearest.parameter - value).argmin())].start
        limit = GREATEST if turns == 1 else GREATEST_OF_SEVERAL
        for orbit in motion.search_orbits(parameters, drive, turns=turns, start=start).orbits:
            if self.stop() or orbit.largest > limit or self._knows(orbit, value):
                continue
            how = self._arguments(stop=lambda orbit: self.stop() or (turns > 1 and orbit.largest > limit))
            try:
                branch = follow_both(self.family.with_ratios(orbit.drive.ratios), orbit, value, **how)
            except ContinuationError as error:
                place = self.family.format_value(value)
                self.problems.append(f"the branch through a further motion at {place} is not followed: {error}")
                continue
            strayed = turns > 1 and max(branch.orbits[end].largest for end in (0, -1)) > limit
            self._keep(branch, strayed=strayed)

    def _knows(self, orbit: motion.PeriodicOrbit, value: float) -> bool:
        """Return whether a known branch passes through a motion."""
        return has_motion(self.branches, orbit, value, self.high - self.low)

    def _keep(self, branch: Branch, *, strayed: bool = False) -> None:
        """Keep a branch with its problems; ``strayed`` tells that it ends where its motions become too unstable."""
        self.branches.append(branch)
        self.problems += branch.problems
        if not (branch.reached or strayed):
            self.problems.append(describe_end(branch))


def describe_end(branch: Branch) -> str:
    """Return a sentence on a branch that was not followed to its end: how far it was followed, and why not further."""
    first, last = (branch.family.format_value(float(branch.parameter[i])) for i in (0, -1))
    period = "" if branch.periods == 1 else f"with a period of {branch.crank_turns} turns "
    return f"the branch {period}is followed from {first} to {last} only: {branch.reason}"


def _passes(branch: Branch, value: float, orbit: motion.PeriodicOrbit) -> bool:
    """Return whether one of the two ends of a branch is the given orbit at the parameter ``value``."""
    return any(
        abs(branch.parameter[i] - value) <= 1e-9 * abs(value) and orbit.distance(branch.orbits[i].start) < motion.SAME
        for i in (0, -1)
    )


#: Distance of two special points in the parameter, relative to the range, below which they are the same point, if the distance
#: of their motions, relative to the scale, is also below the square root of this value.
_SAME_POINT = 1e-6


#: Distance of a maximum from an evenly spaced value, relative to the range, below which it is not searched as well.
_SAME_VALUE = 0.01


def _values_to_search(response: Response, places: int) -> list[float]:
    """Return the values of the parameter at which all motions are sought, in increasing order.

    They are evenly spaced values, and the values at the highest maximum of each free coordinate.
    """
    values = np.linspace(response.low, response.high, places + 2)[1:-1].tolist()
    reach = _SAME_VALUE * (response.high - response.low)
    # of each coordinate the last one stays, which is the highest
    highest = {top.coordinate: top for top in sorted(response.maxima(), key=lambda top: top.amplitude)}
    for top in highest.values():
        if all(abs(top.parameter - value) > reach for value in values):
            values.append(top.parameter)
    return sorted(values)


def with_isolas(
    response: Response, *, places: int = 5, turns: int = 1, greatest_step: float = 5e-3, progress: bool = False
) -> Response:
    """Return a response with further branches: motions that are not connected to any of its branches, such as isolas.

    All motions are sought at several values of the parameter, and at the highest resonance of each free coordinate, above which
    isolas often lie. Motions that exist only between these values are not found. From each motion that lies on no branch, a new
    branch is followed in both directions until it closes or ends. Motions whose deviations grow more than a thousandfold per
    turn are ignored.

    Motions of several turns are stable only in narrow ranges between a fold and a period doubling. Beyond the doubling these
    motions still exist, increasingly unstable, over a range about ten times as wide, where the search can find them. They are
    followed as long as deviations grow less than `GREATEST_OF_SEVERAL` times per period.

    Parameters
    ----------
    response : Response
    places : int
        Number of values of the parameter, evenly spaced inside the range, at which all motions are sought, in addition to
        the highest resonances.
    turns : int
        Greatest number of turns (common periods) in the period of the motions that are sought.
    greatest_step, progress
        See `frequency_response`.

    Raises
    ------
    InputError, ParameterError
        If ``response`` is not a `Response`, or ``places`` or ``turns`` is less than one.
    ResponseInterrupted
        On Ctrl-C, with the branches followed so far.

    Examples
    --------
    >>> from analysis import frequency_response, with_isolas
    >>> response = frequency_response("rig-2-spring-c", "500 rpm", "650 rpm", doublings=0)
    >>> len(with_isolas(response, places=2).branches)
    1
    """
    require_kind(response, Response, "response", "what frequency_response returns")
    if places < 1:
        raise InputError(f"places is {places}: motions must be sought at one value of the parameter at least")
    motion.require_turns(turns)
    branches, problems = list(response.branches), list(response.problems)
    values = _values_to_search(response, places)
    with (
        record_interrupts() as interrupted,
        show_progress(progress, float(len(values) * turns), "seeking closed branches") as show,
    ):
        search = _Search(
            response.family, response.low, response.high, greatest_step, lambda: bool(interrupted), branches, problems
        )
        for number, (value, period) in enumerate(product(values, range(1, turns + 1)), start=1):
            search.seek(value, period)
            show(float(number))
            if interrupted:
                break
    # a search that was interrupted does not count
    sought = response.sought + (number - bool(interrupted)) // turns
    result = replace(response, branches=tuple(branches), problems=tuple(problems), sought=sought)
    if interrupted:
        raise ResponseInterrupted(result)
    return result
