"""Follow branches of periodic motions over a parameter, and locate the points where they lose stability or branch off.

The parameter is the speed, the torque, a force, any parameter of the FMI contract, or any number from which a function
computes mechanism and drive. A branch is followed by arclength, past its folds. Special points are located between the computed
points: there a Floquet multiplier crosses the unit circle at +1 (fold), at -1 (period doubling), or as a complex pair (torus).
At a period doubling, `switch` changes to the branch of motions with twice the period.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ...display import NotebookResult, format_count, format_range
from ...files import write_csv
from ...mechanisms import find_mechanism
from ...numerics.continuation import ContinuationError, Curve, Follower, Point, Reason, Settings
from ..motion.discretisation import AIM, GROWTH, PLACES, OrbitError, choose_pieces
from ..motion.floquet import TOLERANCE, Crossing, Stability, crossing_test
from ..motion.flow import label
from ..motion.orbit import OrbitEquations, PeriodicOrbit, Turn
from ..motion.variables import Family
from ..stability.nonlinear import SpecialPoint

#: First step along a branch in scaled arc length; greatest step while the parameter hardly changes; angle between the tangents
#: of two points (rad) up to which steps grow: 0.04 gives about 150 points on a full circle.
_FIRST, _LONGEST, _ROUND = 5e-3, 2e-2, 0.04
#: Distance from a period doubling at which the branch of twice the period begins, relative to the crank's length.
_SWITCH = 2e-3
#: A branch ends when the links come this close to the limit of assembly (least sine, as `LIMIT_SINE`), or when its largest
#: multiplier passes this value.
LEAST_SINE, GREATEST_MULTIPLIER = 1e-3, 1e8


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Branch(NotebookResult):
    """A branch of periodic motions: the orbits along a curve over a parameter, in order.

    Attributes
    ----------
    family : Family
    turns : int
        Number of common periods in the period of the motions: see `PeriodicOrbit`.
    parameter : ndarray, shape (m,)
        Value of the parameter at each point.
    orbits : tuple of PeriodicOrbit
        The orbit at each point.
    special : tuple of SpecialPoint
        Folds, period doublings and torus points on the branch.
    reached : bool
        Whether the branch was followed to its end: to an end of the range, to its own beginning, or to a branch of half its
        period.
    closed : bool
        Whether the branch came back to its own beginning.
    reason : str
        Reason why the branch ended. If the branch was lost, its last point is the last for which an orbit was found.
    problems : tuple of str
        One sentence for each special point that could not be located between two points of the branch, and is missing.
    """

    family: Family
    turns: int
    parameter: NDArray[np.float64]
    orbits: tuple[PeriodicOrbit, ...]
    special: tuple[SpecialPoint, ...]
    reached: bool
    closed: bool
    reason: str
    problems: tuple[str, ...] = ()
    # cache of `columns`
    _table: dict[str, NDArray[np.float64]] = field(default_factory=dict, init=False, repr=False)

    def __repr__(self) -> str:
        special = "".join(f", {s.kind.value} at {self.family.format_value(s.parameter)}" for s in self.special)
        ended = "" if self.reached else f", ended early: {self.reason}"
        return f"<Branch: {describe((self,))}{special}{ended}>"

    def __len__(self) -> int:
        return len(self.orbits)

    @property
    def periods(self) -> int:
        """Number of common periods of the cranks and gears in a period of the motions: see `PeriodicOrbit.periods`."""
        return self.orbits[0].periods

    @property
    def crank_turns(self) -> int:
        """Number of crank turns in a period of the motions: see `PeriodicOrbit.crank_turns`."""
        return self.orbits[0].crank_turns

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """Half the range of the first free coordinate at each point, such as a slider position (m); shape (m,)."""
        return self.amplitudes[:, 0]

    @property
    def amplitudes(self) -> NDArray[np.float64]:
        """Half the range of each free coordinate at each point, shape (m, k), in the order of `PeriodicOrbit.swings`."""
        columns = self.columns()
        return np.column_stack([columns[f"amplitude of {label} [{unit}]"] for label, unit in self.orbits[0].swings])

    @property
    def largest_multiplier(self) -> NDArray[np.float64]:
        """Largest modulus of the Floquet multipliers at each point, shape (m,)."""
        return np.array([orbit.largest for orbit in self.orbits])

    def stability(self, tolerance: float = TOLERANCE) -> tuple[Stability, ...]:
        """Return the stability of each orbit on the branch."""
        return tuple(orbit.verdict(tolerance).stability for orbit in self.orbits)

    def columns(self) -> Mapping[str, NDArray[np.float64]]:
        """Return the quantities along the branch, by name with unit, each of shape (m,).

        The quantities are the parameter, the mean speed and the turns in a period; amplitude, mean and first three harmonics of
        each free coordinate (u of a five-bar); largest multiplier and stability; and, if the mechanism has these outputs,
        mean and greatest crank torque, greatest forces in pins, guide and bearings, and least sine of the transmission angle.
        """
        if not self._table:
            turns = [orbit.turn() for orbit in self.orbits]
            values = _turn_columns(self.orbits[0], turns[0])
            self._table.update({name: np.array([value(turn) for turn in turns]) for name, value in values.items()})
        unit = f" [{self.family.unit}]" if self.family.unit else ""
        largest = self.largest_multiplier
        signs = np.select([1.0 - largest > TOLERANCE, 1.0 - largest < -TOLERANCE], [1.0, -1.0], 0.0)
        first = {
            f"{self.family.name}{unit}": self.parameter,
            "turns in a period [1]": np.full(len(self), float(self.crank_turns)),
            "largest multiplier [1]": largest,
            "stable (1), marginal (0), unstable (-1)": signs,
        }
        return first | self._table

    def to_csv(self, path: str | Path) -> Path:
        """Write the branch as a CSV table with one row per point; the columns are those of `columns`."""
        return write_csv(path, self.columns())


#: Beginning of the name of each column of joint forces.
FORCE = "greatest force in "


def _turn_columns(orbit: PeriodicOrbit, first: Turn) -> dict[str, Callable[[Turn], float]]:
    """Return, by the name of each column, a function that computes the column's value from the outputs over one period.

    ``first`` are the outputs of ``orbit`` over a period; they tell which outputs the mechanism has.
    """
    mechanism = find_mechanism(orbit.parameters)
    rate = next(v for v in mechanism.variables if v.name == mechanism.freedoms[orbit.flow.crank].rate)
    columns: dict[str, Callable[[Turn], float]] = {
        f"mean {label(rate)} [rad/s]": lambda turn: orbit.flow.period * orbit.turns / turn.period
    }
    for swing, (name, unit) in zip(first.swings, orbit.swings):
        what = f"{name} [{unit}]"
        columns[f"amplitude of {what}"] = partial(Turn.swing_amplitude, name=swing)
        columns[f"mean of {what}"] = lambda turn, swing=swing: float(turn.oscillation(swing).mean())  # type: ignore[misc]
        for order in (1, 2, 3):
            columns[f"harmonic {order} of {what}"] = partial(Turn.harmonic, name=swing, order=order)
    for number in mechanism.cyclic_freedoms:
        freedom = mechanism.freedoms[number].coordinate
        what = "crank torque" if len(mechanism.cyclic_freedoms) == 1 else f"torque on {freedom.partition('.')[0]}"
        for name in mechanism.names("drive", freedom):
            columns[f"mean {what} [N.m]"] = lambda turn, name=name: float(turn[name].mean())  # type: ignore[misc]
            columns[f"greatest {what} [N.m]"] = lambda turn, name=name: float(  # type: ignore[misc]
                np.abs(turn[name]).max()
            )
    for joint, parts in mechanism.joints.items():
        columns[f"{FORCE}{joint.replace('.', ' ')} [N]"] = lambda turn, parts=parts: float(  # type: ignore[misc]
            reduce(np.hypot, (turn[part] for part in parts)).max()
        )
    for name in mechanism.names("guide force"):
        columns["greatest guide force [N]"] = lambda turn, name=name: float(np.abs(turn[name]).max())  # type: ignore[misc]
    for name in mechanism.names("transmission"):
        columns["least sine of the transmission angle [1]"] = lambda turn, name=name: float(  # type: ignore[misc]
            np.abs(np.sin(turn[name])).min()
        )
    return columns


def follow(
    family: Family,
    orbit: PeriodicOrbit,
    value: float,
    *,
    low: float,
    high: float,
    direction: int = 1,
    greatest: float = 2e-2,
    most_points: int = 5000,
    watch: Callable[[float], None] | None = None,
    stop: Callable[[PeriodicOrbit], bool] | None = None,
) -> Branch:
    """Follow the branch through an orbit to an end of the range of the parameter.

    Parameters
    ----------
    family : Family
    orbit : PeriodicOrbit
        An orbit on the branch.
    value : float
        Value of the parameter at the orbit, between ``low`` and ``high``.
    low, high : float
        Range of the parameter.
    direction : int
        +1 to begin towards higher values of the parameter, -1 towards lower values.
    greatest : float
        Greatest step of the parameter, relative to its range; narrow resonances need small steps.
    most_points : int
        Greatest number of points.
    watch : callable, optional
        Called with the parameter of every point.
    stop : callable, optional
        Called with the orbit of every point; the branch ends when ``stop`` returns true.

    Returns
    -------
    Branch
        The branch as far as it could be followed; ``reason`` says why it ended.

    Raises
    ------
    ContinuationError
        If the orbit does not belong to the family.
    """
    settings = _settings(low, high, greatest, most_points)
    follower = _follower(family, orbit, settings)
    return _branch(family, orbit.turns, follower, follower.start(orbit.start, value, direction), watch, stop)


def switch(
    family: Family,
    doubling: SpecialPoint,
    *,
    low: float,
    high: float,
    greatest: float = 2e-2,
    largest: float = GREATEST_MULTIPLIER,
    most_points: int = 5000,
    watch: Callable[[float], None] | None = None,
    stop: Callable[[PeriodicOrbit], bool] | None = None,
) -> Branch:
    """Follow the branch of motions with twice the period that begins at a period doubling.

    Parameters
    ----------
    family, low, high, greatest, most_points, watch, stop
        See `follow`.
    doubling : SpecialPoint
    largest : float
        The branch ends when its largest multiplier passes this value.

    Raises
    ------
    InputError
        If the point is not a period doubling.
    ContinuationError
        If no point on the new branch is found.
    """
    if doubling.kind is not Crossing.PERIOD_DOUBLING:
        raise InputError(
            f"the point at {doubling.parameter:.9g} is a {doubling.kind.value}: only a period doubling has a branch of twice "
            "the period"
        )
    orbit = doubling.orbit
    settings = _settings(low, high, greatest, most_points)
    doubled = replace(orbit, turns=2 * orbit.turns, monodromy=orbit.monodromy @ orbit.monodromy)
    follower = _follower(family, doubled, settings)
    # every second period differs in the direction of the eigenvector of the multiplier -1
    scale = follower.scale[:-1]
    scaled = (orbit.monodromy + np.eye(len(scale))) * scale / scale[:, None]
    vector = np.linalg.svd(scaled)[2][-1] * scale
    base = follower.start_with_tangent(orbit.start, doubling.parameter, np.append(vector, 0.0))
    for length in (_SWITCH, 4.0 * _SWITCH, 0.25 * _SWITCH, 16.0 * _SWITCH):
        taken = follower.step(base, length)
        # a step back to the undoubled branch does not count
        if taken is not None and abs(float((taken.y / scale - orbit.start / scale) @ (vector / scale))) > 0.5 * length:
            return _branch(family, doubled.turns, follower, taken, watch, stop, largest)
    raise ContinuationError(f"no motion of twice the period was found near {family.format_value(doubling.parameter)}")


def follow_both(family: Family, orbit: PeriodicOrbit, value: float, *, low: float, high: float, **how: Any) -> Branch:
    """Follow the whole branch through an orbit, in both directions: see `follow`."""
    up = follow(family, orbit, value, low=low, high=high, **how)
    if up.closed:
        return up
    down = follow(family, orbit, value, low=low, high=high, direction=-1, **how)
    before = len(down) - 1
    turned = [replace(special, after=before - 1 - special.after) for special in reversed(down.special)]
    return Branch(
        family=family,
        turns=orbit.turns,
        parameter=np.concatenate([down.parameter[:0:-1], up.parameter]),
        orbits=(*down.orbits[:0:-1], *up.orbits),
        special=(*turned, *(replace(special, after=special.after + before) for special in up.special)),
        reached=down.reached and up.reached,
        closed=False,
        reason=up.reason if down.reached else down.reason,
        problems=(*down.problems, *up.problems),
    )


def _settings(low: float, high: float, greatest: float, most_points: int) -> Settings:
    return Settings(
        low=low,
        high=high,
        first=min(_FIRST, greatest),
        greatest=max(_LONGEST, greatest),
        widest=greatest,
        most_points=most_points,
        growing_turn=_ROUND,
    )


def _follower(
    family: Family, orbit: PeriodicOrbit, settings: Settings, angles: NDArray[np.float64] | None = None
) -> Follower:
    equations = OrbitEquations(family, orbit.turns, settings.low, settings.high, angles)
    return Follower(equations, equations.scale(orbit.start), settings)


def _growth(orbit: PeriodicOrbit) -> float:
    """Return the greatest growth factor of a small deviation over the period.

    If the period is divided for multiple shooting, the result is the greatest growth factor over any one piece.
    """
    return orbit.largest if orbit.stations is None else orbit.stations.growth


def _divide_period(family: Family, last: Point, settings: Settings) -> tuple[Follower, Point]:
    """Return a follower that uses multiple shooting, and its first point: the last point of the branch so far.

    The pieces into which the period is divided are chosen from the orbit at this point.
    """
    orbit: PeriodicOrbit = last.data
    places = orbit.flow.unknowns(orbit.turn(PLACES * orbit.periods).states, orbit.point.vector)
    angles, starts = choose_pieces(orbit.point, places, orbit.turns)
    divided = _follower(family, orbit, settings, angles)
    n = len(orbit.start)
    ahead = np.zeros(starts.size + 1)
    ahead[:n], ahead[-1] = last.tangent[:n], last.tangent[-1]
    return divided, divided.resume(starts.ravel(), last.parameter, ahead)


def reason_to_leave(point: Point, largest: float = GREATEST_MULTIPLIER) -> str:
    """Return the reason why a branch must not be followed beyond a point; empty if there is none."""
    orbit = point.data
    if orbit.largest > largest:
        return f"beyond this point a disturbance grows more than {largest:g} times per period (the largest Floquet multiplier)"
    sine = orbit.clearance(64) if orbit.least_clearance is None else orbit.least_clearance
    if sine < LEAST_SINE:
        return f"the links come near to the limit of assembly (sine of the angle to it {sine:.3g})"
    return ""


def _branch(
    family: Family,
    turns: int,
    follower: Follower,
    first: Point,
    watch: Callable[[float], None] | None,
    stop: Callable[[PeriodicOrbit], bool] | None,
    largest: float = GREATEST_MULTIPLIER,
) -> Branch:
    pieces: list[tuple[Follower, Curve]] = []
    settings = follower.settings
    before, merged = first, False
    while True:
        refine = False

        def leave(point: Point) -> str:
            nonlocal refine, before, merged
            merged = _meets_half(before, point)
            if merged:
                return "it meets the branch of half the period"
            before = point
            if stop is not None and stop(point.data):
                return "it was interrupted"
            reason = reason_to_leave(point, largest)
            if not reason and _growth(point.data) > GROWTH:
                refine = True
                return "deviations grow too fast to be followed over a whole period"
            return reason

        curve = follower.follow(
            first, watch=None if watch is None else lambda point: watch(point.parameter), leave=leave
        )
        if merged:
            # beyond this point the branch passes through the same motions again, half a period later
            curve = replace(curve, points=curve.points[:-1], steps=curve.steps[:-1])
        pieces.append((follower, curve))
        last, left = curve.points[-1], settings.most_points - len(curve.points) + 1
        lost = curve.end in (Reason.TIP, Reason.NO_VALUE) and _growth(last.data) > AIM and last.data.stations is None
        if not (refine or lost) or left < 2 or (len(curve.points) == 1 and len(pieces) > 1):
            break
        settings = replace(settings, most_points=left)
        try:
            follower, first = _divide_period(family, last, settings)
        except OrbitError:
            break
    located = [_special_points(family, curve, own, pieces[:part]) for part, (own, curve) in enumerate(pieces)]
    # the first point of a piece is the last of the one before
    points = [p for part, (_, curve) in enumerate(pieces) for p in curve.points[min(part, 1) :]]
    return Branch(
        family=family,
        turns=turns,
        parameter=np.array([point.parameter for point in points]),
        orbits=tuple(point.data for point in points),
        special=tuple(special for found, _ in located for special in found),
        reached=curve.reached or merged,
        closed=curve.closed,
        reason=curve.reason,
        problems=tuple(problem for _, problems in located for problem in problems),
    )


def _meets_half(before: Point, after: Point) -> bool:
    """Return whether a branch meets, between two of its points, a branch of motions with half the period.

    Beyond the meeting point the followed branch passes through the same motions again, with the two halves of the period
    exchanged.
    """
    turns = after.data.turns
    if turns % 2 or not before.tangent[-1] * after.tangent[-1] < 0.0:
        return False
    try:
        halves = [o.point.period(o.start, turns // 2).shift / o.scale for o in (before.data, after.data)]
    except OrbitError:
        return False
    return bool(halves[0] @ halves[1] < 0.0)


def _tests(point: Point) -> dict[Crossing, float]:
    """Return the test function of each kind of crossing; its sign changes where a multiplier crosses the unit circle."""
    # det(M - 1) is also zero where two branches cross; the parameter's direction along the branch changes only at a fold
    return {
        kind: float(point.tangent[-1]) if kind is Crossing.FOLD else float(crossing_test(point.data.monodromy, kind))
        for kind in Crossing
    }


def _special_points(
    family: Family, curve: Curve, follower: Follower, pieces: Sequence[tuple[Follower, Curve]]
) -> tuple[list[SpecialPoint], list[str]]:
    """Locate the special points on one part of a branch, ``curve``; ``pieces`` are the parts of the branch before this part.

    Return the points, and a sentence on each point that cannot be located.
    """
    passed = sum(len(piece.points) - 1 for _, piece in pieces)
    found: list[tuple[int, float, SpecialPoint]] = []
    problems: list[str] = []
    values = [_tests(point) for point in curve.points]
    for i, length in enumerate(curve.steps):
        for kind in Crossing:
            # at prescribed speed the product of the two multipliers depends only on the damping: there is no torus point
            if (
                kind is Crossing.TORUS
                and curve.points[i].data.drive.speed_drive
                and len(curve.points[i].data.start) < 3
            ):
                continue
            if not values[i][kind] * values[i + 1][kind] < 0.0:
                continue
            before, after = curve.points[i : i + 2]
            try:
                point, s = follower.locate(before, length, after, lambda p, kind=kind: _tests(p)[kind])  # type: ignore[misc]
            except ContinuationError as error:
                span = " and ".join(family.format_value(p.parameter) for p in (before, after))
                problems.append(f"the {kind.value} between {span} is not located: {error}")
                continue
            # two real multipliers with the product 1 are not a torus point
            if kind is Crossing.TORUS and abs(point.data.multipliers[0].imag) < 1e-6:
                continue
            found.append((i, s, SpecialPoint(kind=kind, parameter=point.parameter, orbit=point.data, after=passed + i)))
    return [special for _, _, special in sorted(found, key=lambda entry: entry[:2])], problems


def describe(branches: Sequence[Branch]) -> str:
    """Describe branches of a family in one line: range, number of orbits, stability, and where amplitudes are greatest."""
    family, components = branches[0].family, branches[0].orbits[0].flow.components
    span = format_range(np.concatenate([branch.parameter for branch in branches]), family.unit)
    words = dict.fromkeys(word.value for branch in branches for word in branch.stability())
    found = [
        f"greatest amplitude of {name} {value:.4g} {unit} at {family.format_value(place)}"
        for (name, unit), (value, place) in zip(components, greatest_amplitudes(branches))
    ]
    count = format_count(sum(len(branch) for branch in branches), "orbit")
    return f"{family.name} {span}, {count}, {' and '.join(words)}; {', '.join(found)}"


def greatest_amplitudes(branches: Sequence[Branch]) -> list[tuple[float, float]]:
    """Return, for each free coordinate, the greatest amplitude on branches and the value of the parameter there."""
    amplitudes = np.concatenate([branch.amplitudes for branch in branches])
    parameter = np.concatenate([branch.parameter for branch in branches])
    return [(float(amplitudes[n, k]), float(parameter[n])) for k, n in enumerate(amplitudes.argmax(axis=0).tolist())]


#: Greatest modulus of the multipliers up to which a motion is followed.
GREATEST = 1e3
#: Distance from the polygonal line through the points of a branch, in scaled units, below which a motion lies on the branch.
_ON = 2e-3


def distance(points: NDArray[np.float64], place: NDArray[np.float64]) -> float:
    """Return the distance of a point ``place``, shape (n,), from the polygonal line through ``points``, shape (m, n)."""
    s = points - place
    pieces = np.diff(s, axis=0)
    squares = np.maximum((pieces**2).sum(axis=1), 1e-300)
    along = np.clip(-(s[:-1] * pieces).sum(axis=1) / squares, 0.0, 1.0)
    feet = s[:-1] + along[:, None] * pieces
    return float(np.linalg.norm(np.vstack([s[:1], feet]), axis=1).min())


def passes(branch: Branch, value: float, motion: NDArray[np.float64], width: float) -> bool:
    """Return whether a branch passes through a motion, apart from whole turns of links.

    ``motion`` is the start of the motion and ``value`` the value of the family's parameter; ``width`` is the scale of this
    parameter.
    """
    ends = [branch.orbits[i] for i in (branch.parameter.argmin(), branch.parameter.argmax())]
    scale = np.append(np.max([o.scale for o in ends], axis=0), width)
    points = np.column_stack([[orbit.start for orbit in branch.orbits], branch.parameter])
    away = ends[0].flow.remove_turns(points[:, :-1] - motion)
    near = np.abs(away / scale[:-1]).max(axis=1).argmin()
    return distance(points / scale, np.append(points[near, :-1] - away[near], value) / scale) < _ON
