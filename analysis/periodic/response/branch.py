"""Follow branches of periodic motions over a parameter, and locate the points where they lose stability or branch off.

The parameter is the speed, the torque, a force, any parameter of the FMI contract, or any number from which a function
computes mechanism and drive. A branch is followed by arclength, past its folds. Special points are located between the computed
points: there a Floquet multiplier crosses the unit circle at +1 (fold or branch point), at -1 (period doubling), or as a
complex pair (torus). At a branch point, `switch` changes to the branch that crosses; at a period doubling, to the motions of
twice the period.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
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
from ..motion.flow import TOLERANCE, Crossing, Stability, crossing_test, label, torus_pair
from ..motion.orbit import OrbitEquations, PeriodicOrbit, Turn
from ..motion.variables import Family
from ..stability.nonlinear import SpecialPoint

#: First step along a branch in scaled arc length; greatest step while the parameter hardly changes; angle between the tangents
#: of two points (rad) up to which steps grow: 0.04 gives about 150 points on a full circle.
_FIRST, _LONGEST, _ROUND = 5e-3, 2e-2, 0.04
#: Distance of a multiplier, or of the product of two multipliers, from 1 below which the distance is a rounding error.
_AT_CROSSING = 1e-8
#: Greatest distance between the point at which a branch begins and the first motion of the branch: in the parameter relative to
#: its range, in y relative to the scale of y.
BEGINNING = 0.05
#: For each kind of point at which a branch begins: period of the branch's motions relative to the period at the point, and
#: lengths of the first step from the point, in scaled arc length, that are tried in this order.
_BEGINNINGS = {
    Crossing.PERIOD_DOUBLING: (2, (2e-3, 8e-3, 5e-4, 3.2e-2)),
    Crossing.BRANCH_POINT: (1, (8e-3, 3.2e-2, 2e-3)),
}
#: Change of y over a part of the period, relative to the scale, below which the motion repeats itself after this part, and the
#: parts: the period divided by each of these numbers.
_REPEATED, _PARTS = 1e-6, (2, 3, 5, 7)
#: A branch ends when the clearance to the limit of assembly (a sine, as `LIMIT_SINE`) falls below the first value, or when its
#: largest multiplier exceeds the second value.
LEAST_SINE, GREATEST_MULTIPLIER = 1e-3, 1e8


@dataclass(frozen=True, eq=False, kw_only=True)
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
        Folds, branch points, period doublings and torus points on the branch.
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
        return dict(self._columns)

    @cached_property
    def _columns(self) -> dict[str, NDArray[np.float64]]:
        turns = [orbit.turn() for orbit in self.orbits]
        functions = _turn_columns(self.orbits[0], turns[0])
        unit = f" [{self.family.unit}]" if self.family.unit else ""
        largest = self.largest_multiplier
        signs = np.select([1.0 - largest > TOLERANCE, 1.0 - largest < -TOLERANCE], [1.0, -1.0], 0.0)
        columns = {
            f"{self.family.name}{unit}": self.parameter,
            "turns in a period [1]": np.full(len(self), float(self.crank_turns)),
            "largest multiplier [1]": largest,
            "stable (1), marginal (0), unstable (-1)": signs,
        }
        return columns | {name: np.array([value(turn) for turn in turns]) for name, value in functions.items()}

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
            columns[f"greatest {what} [N.m]"] = partial(_greatest_magnitude, parts=(name,))
    for joint, parts in mechanism.joints.items():
        columns[f"{FORCE}{joint.replace('.', ' ')} [N]"] = partial(_greatest_magnitude, parts=parts)
    for name in mechanism.names("guide force"):
        columns["greatest guide force [N]"] = partial(_greatest_magnitude, parts=(name,))
    for name in mechanism.names("transmission"):
        sine = "least sine of the transmission angle [1]"
        columns[sine] = lambda turn, name=name: float(np.abs(np.sin(turn[name])).min())  # type: ignore[misc]
    return columns


def _greatest_magnitude(turn: Turn, parts: Sequence[str]) -> float:
    """Return the greatest magnitude, over a period, of an output or of a force with several components."""
    return float(np.abs(reduce(np.hypot, (turn[part] for part in parts))).max())


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
    special: SpecialPoint,
    *,
    low: float,
    high: float,
    side: float = 1.0,
    greatest: float = 2e-2,
    largest: float = GREATEST_MULTIPLIER,
    most_points: int = 5000,
    stop: Callable[[PeriodicOrbit], bool] | None = None,
) -> Branch:
    """Follow the branch that begins at a period doubling, of twice the period, or at a branch point, of the same period.

    Parameters
    ----------
    family, low, high, greatest, most_points, stop
        See `follow`.
    special : SpecialPoint
    side : float
        +1 or -1: direction in which the new branch is followed; a branch leaves a branch point in both directions.
    largest : float
        The branch ends when its largest multiplier passes this value.

    Raises
    ------
    InputError
        If the point is neither a period doubling nor a branch point.
    ContinuationError
        If no point on the new branch is found.
    """
    if special.kind not in _BEGINNINGS:
        raise InputError(
            f"the point at {special.parameter:.9g} is a {special.kind.value}: only at a period doubling or a branch point does "
            "another branch begin"
        )
    orbit, (times, lengths) = special.orbit, _BEGINNINGS[special.kind]
    settings = _settings(low, high, greatest, most_points)
    power = np.linalg.matrix_power(orbit.monodromy, times)
    begun = replace(orbit, turns=times * orbit.turns, monodromy=power, stations=None)
    follower = _follower(family, begun, settings, sizes=motion_sizes(orbit, orbit.amplitudes))
    # the motions of the branch differ in the direction of the eigenvector, at a doubling every second period
    scale = follower.scale[:-1]
    scaled = (orbit.monodromy - (-1.0) ** (times - 1) * np.eye(len(scale))) * scale / scale[:, None]
    vector = side * np.linalg.svd(scaled)[2][-1] * scale
    base = follower.start_with_tangent(orbit.start, special.parameter, np.append(vector, 0.0))
    for length in lengths:
        taken = follower.step(base, length)
        if taken is None:
            continue
        away = (np.append(taken.y, taken.parameter) - np.append(orbit.start, special.parameter)) / follower.scale
        if np.abs(away).max() < BEGINNING and (times == 1 or np.linalg.norm(_half_shift(taken, scale)) > length):
            return _branch(family, begun.turns, follower, taken, None, stop, largest)
    motion = "of twice the period" if times > 1 else "that branches off"
    raise ContinuationError(f"no motion {motion} was found near {family.format_value(special.parameter)}")


def motion_sizes(orbit: PeriodicOrbit, amplitudes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each component of y the factor, at most 1, that adapts the scale of ``orbit`` to the size of the motion.

    The scale follows from the lengths of the links, and motions may be much smaller. The adapted scale of a coordinate is
    thirty times its amplitude, but never more than the scale, which is also kept if the amplitude is zero. A rate has the
    factor of its coordinate.
    """
    free = len(orbit.flow.free)
    shares = amplitudes[:free] / orbit.scale[:free]
    sizes = np.where(shares > 0.0, np.minimum(30.0 * shares, 1.0), 1.0)
    return np.concatenate([sizes, sizes, np.ones(orbit.flow.size - 2 * free)])


def follow_both(family: Family, orbit: PeriodicOrbit, value: float, *, low: float, high: float, **how: Any) -> Branch:
    """Follow the whole branch through an orbit, in both directions: see `follow`."""
    up = follow(family, orbit, value, low=low, high=high, **how)
    if up.closed:
        return up
    down = follow(family, orbit, value, low=low, high=high, direction=-1, **how)
    before = len(down) - 1
    early = (f"at {family.format_value(end.parameter[-1])} {end.reason}" for end in (down, up) if not end.reached)
    turned = [replace(special, after=before - 1 - special.after) for special in reversed(down.special)]
    return Branch(
        family=family,
        turns=orbit.turns,
        parameter=np.concatenate([down.parameter[:0:-1], up.parameter]),
        orbits=(*down.orbits[:0:-1], *up.orbits),
        special=(*turned, *(replace(special, after=special.after + before) for special in up.special)),
        reached=down.reached and up.reached,
        closed=False,
        reason=", ".join(early),
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
    family: Family,
    orbit: PeriodicOrbit,
    settings: Settings,
    angles: NDArray[np.float64] | None = None,
    sizes: NDArray[np.float64] | float = 1.0,
) -> Follower:
    equations = OrbitEquations(family, orbit.turns, settings.low, settings.high, angles)
    # a motion of one turn may be followed over two turns
    foreign = None if _repeats_early(orbit) else _repeats_early
    return Follower(equations, equations.scale(orbit.start) * sizes, settings, foreign=foreign)


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
    """Return the reason why a branch must not be followed beyond a point; empty if there is none.

    ``largest`` is the greatest modulus of the multipliers up to which a branch is followed.
    """
    orbit = point.data
    if orbit.largest > largest:
        return f"beyond this point a disturbance grows more than {largest:g} times per period (the largest Floquet multiplier)"
    sine = orbit.clearance(64 * orbit.crank_turns) if orbit.least_clearance is None else orbit.least_clearance
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
    pieces = [(own, _insert_dips(curve, own)) for own, curve in pieces]
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
        scale = after.data.scale
        return bool(_half_shift(before, scale) @ _half_shift(after, scale) < 0.0)
    except OrbitError:
        return False


def _half_shift(point: Point, scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the change of y, relative to a scale, over half of the period."""
    return _shift(point.data, point.data.turns // 2, scale)


def _shift(orbit: PeriodicOrbit, turns: int, scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the change of y, relative to a scale, over a number of common periods from the start of an orbit."""
    return np.asarray(orbit.point.period(orbit.start, turns).shift / scale)


def _repeats_early(orbit: PeriodicOrbit) -> bool:
    """Return whether a motion repeats itself after a fraction of its period, 1 / `_PARTS`, and so belongs to another branch."""
    try:
        return any(
            orbit.turns % part == 0 and np.abs(_shift(orbit, orbit.turns // part, orbit.scale)).max() < _REPEATED
            for part in _PARTS
        )
    except OrbitError:
        return False


def _test_values(points: Sequence[Point], kind: Crossing) -> NDArray[np.float64]:
    """Return a test function at points: the parameter's change along the branch for a fold, `crossing_test` for others."""
    if kind is Crossing.FOLD:
        return np.array([point.tangent[-1] for point in points])
    return crossing_test(np.array([point.data.monodromy for point in points]), kind)


def _test_value(point: Point, kind: Crossing, sign: float = 1.0) -> float:
    """Return ``sign`` times a test function at one point: see `_test_values`."""
    return sign * float(_test_values([point], kind)[0])


def _insert_dips(curve: Curve, follower: Follower) -> Curve:
    """Insert points where a test function passes zero and comes back within one step, as in a narrow unstable window.

    Such a function has the same sign at both ends of the step. If its absolute value is convex, it lies above two straight
    lines: one through the beginning of the step and the point before, the other through the end of the step and the point
    after. If these lines meet below zero, the least absolute value is computed. The first and the last step lack one of the
    lines.
    """
    points, steps = [*curve.points], [*curve.steps]
    if len(steps) < 3:
        return curve
    inside, found = np.array(steps[1:-1]), dict[int, tuple[Point, float]]()
    for kind in Crossing:
        tested = _test_values(points, kind)
        sign = np.sign(tested[1:-2])
        first, here, there, last = (sign * tested[k : len(inside) + k] for k in range(4))
        fall, rise = (here - first) / steps[:-2], (last - there) / steps[2:]
        # the least value by the lines, times the difference of their slopes
        least = here * rise - fall * (there - rise * inside)
        clear = np.min([first, here, there, last], axis=0) > _AT_CROSSING
        for i in (np.flatnonzero(clear & (fall < 0.0) & (rise > 0.0) & (least < 0.0)) + 1).tolist():
            test = partial(_test_value, kind=kind, sign=float(sign[i - 1]))
            with suppress(ContinuationError):
                dip, s, value = follower.minimise(points[i], steps[i], points[i + 1], test, -_AT_CROSSING)
                if value < -_AT_CROSSING:
                    found[i] = dip, s
    for i in sorted(found, reverse=True):
        dip, s = found[i]
        steps[i : i + 1] = [s, follower.step_length(dip, points[i + 1])]
        points.insert(i + 1, dip)
    return replace(curve, points=tuple(points), steps=tuple(steps))


def _crossings(before: Point, after: Point, changed: set[Crossing]) -> Iterator[tuple[Crossing, Crossing]]:
    """Yield the kind of each special point between two neighbouring points of a branch, and the kind of its test function.

    The special point lies where this test function is zero. The two kinds differ only at a branch point at which the
    parameter turns back: it is located by the test function of a fold. ``changed`` are the kinds whose test functions change
    their sign between the two points.
    """
    ends = before.data, after.data
    turned = Crossing.FOLD in changed
    # where two branches cross, either the parameter turns back or det(I - M) changes its sign; at a fold both do. Without
    # damping or stiffness a multiplier is 1 on the whole branch, and a change of sign by rounding means nothing
    crossed = turned != (Crossing.BRANCH_POINT in changed) and (
        max(float(np.abs(end.multipliers - 1.0).min()) for end in ends) > _AT_CROSSING
    )
    if turned:
        yield (Crossing.BRANCH_POINT if crossed else Crossing.FOLD), Crossing.FOLD
    elif crossed:
        yield Crossing.BRANCH_POINT, Crossing.BRANCH_POINT
    if Crossing.PERIOD_DOUBLING in changed:
        yield Crossing.PERIOD_DOUBLING, Crossing.PERIOD_DOUBLING
    if Crossing.TORUS in changed and max(torus_pair(end.multipliers)[1] for end in ends) > _AT_CROSSING:
        yield Crossing.TORUS, Crossing.TORUS


def _special_points(
    family: Family, curve: Curve, follower: Follower, pieces: Sequence[tuple[Follower, Curve]]
) -> tuple[list[SpecialPoint], list[str]]:
    """Locate the special points on one part of a branch, ``curve``; ``pieces`` are the parts of the branch before this part.

    Return the points, and a sentence on each point that cannot be located.
    """
    passed = sum(len(piece.points) - 1 for _, piece in pieces)
    found: list[tuple[int, float, SpecialPoint]] = []
    problems: list[str] = []
    values = {kind: _test_values(curve.points, kind) for kind in Crossing}
    for i, (before, after, length) in enumerate(zip(curve.points, curve.points[1:], curve.steps)):
        changed = {kind for kind, tested in values.items() if tested[i] * tested[i + 1] < 0.0}
        for kind, tested in _crossings(before, after, changed):
            try:
                point, s = follower.locate(before, length, after, partial(_test_value, kind=tested))
            except ContinuationError as error:
                span = " and ".join(family.format_value(p.parameter) for p in (before, after))
                problems.append(f"the {kind.value} between {span} is not located: {error}")
                continue
            # a step onto a branch that crosses, and back, turns the parameter at once: there is no fold
            ends = np.abs(values[Crossing.FOLD][i : i + 2])
            if tested is Crossing.FOLD and abs(point.tangent[-1]) > 0.5 * ends.min():
                continue
            # two real multipliers with the product 1 are not a torus point
            if kind is Crossing.TORUS and abs(torus_pair(point.data.multipliers)[0].imag) < 1e-6:
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

    ``motion`` is the start of the motion, and ``value`` the value of the family's parameter at the motion; ``width`` is the
    scale of this parameter.
    """
    ends = [branch.orbits[i] for i in (branch.parameter.argmin(), branch.parameter.argmax())]
    sizes = motion_sizes(branch.orbits[0], branch.amplitudes.max(axis=0))
    scale = np.append(np.max([o.scale for o in ends], axis=0) * sizes, width)
    points = np.column_stack([[orbit.start for orbit in branch.orbits], branch.parameter])
    away = ends[0].flow.remove_turns(points[:, :-1] - motion)
    near = np.abs(away / scale[:-1]).max(axis=1).argmin()
    return distance(points / scale, np.append(points[near, :-1] - away[near], value) / scale) < _ON


def has_motion(branches: Iterable[Branch], orbit: PeriodicOrbit, value: float, width: float) -> bool:
    """Return whether one of the branches passes through a motion, which may be taken to begin at any turn of its period.

    For ``value`` and ``width`` see `passes`.
    """
    starts = orbit.passages()
    return any(passes(b, value, start, width) for b in branches if b.turns == orbit.turns for start in starts)
