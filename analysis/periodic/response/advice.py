"""Derive advice for a machine from branches: values of the parameter to avoid, jumps at folds, and greatest amplitudes.

An arc is a part of a branch along which the parameter only rises or only falls and the stability does not change. At a fold
where a stable arc ends, the machine jumps to another arc. If several stable arcs overlap, the machine's history decides which
of them the machine follows. Where there is no stable arc, no motion on the branches is stable.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import combinations, pairwise, product
from math import inf, isfinite, prod, sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from linkwork.errors import InputError, LinkworkError

from ...numerics.peaks import peaks
from ..motion.discretisation import OrbitError
from ..motion.flow import TOLERANCE, Crossing, Stability
from ..motion.orbit import PeriodicOrbit, newton_orbit
from ..motion.variables import Family, parameter_value
from ..stability.nonlinear import SpecialPoint
from ..stability.sensitivity import PointGradient, crossing_gradient, extremum_gradient, extremum_orbit
from .branch import BEGINNING, Branch

#: A resonance extends to the half-power points, at which the amplitude is this share of the peak.
HALF_POWER = 1.0 / sqrt(2.0)
#: Least prominence, relative to the height, at which a peak counts.
_PROMINENCE = 1e-3
#: Relative difference up to which two arcs are one curve that was followed twice; share of the scale that counts as an error.
_SAME, _NOISE = 1e-2, 1e-7
#: Relative rounding error of the parameter; share of the range below which an interval does not count: such a short interval
#: arises because a doubled branch begins a step beyond its doubling.
_ROUNDING, _SLIVER = 1e-6, 1e-4
#: Amplitude at the end of a branch, relative to the scale, above which the resonance counts as unlimited.
_UNBOUNDED = 10.0
FloatArray = NDArray[np.float64]
Interval = tuple[float, float]


class Risk(Enum):
    """Reason to avoid a value of the parameter."""

    RESONANCE = "resonance, above 0.71 of the peak"
    SEVERAL = "several stable motions, jumps between them"
    DOUBLED = "stable only with a period of several turns"
    UNSTABLE = "no stable motion found"
    UNBOUNDED = "resonance that no damping limits"


@dataclass(frozen=True, slots=True, kw_only=True)
class AvoidedRange:
    """A range of the parameter (rad/s if it is a speed) that a machine should avoid, and the reason.

    ``coordinate`` is the short name of the coordinate that resonates; it is empty if only one coordinate is free.
    """

    low: float
    high: float
    risk: Risk
    coordinate: str = ""

    @property
    def words(self) -> str:
        """The reason in words."""
        name = f"resonance of {self.coordinate}" if self.coordinate else "resonance"
        return self.risk.value.replace("resonance", name)


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldJump:
    """The jump of a machine at a fold at which its stable motion ends.

    ``parameter`` is the value of the parameter at the fold, ``before`` the amplitude of the motion that ends.

    Attributes
    ----------
    direction : int
        +1 if the motion exists below the fold and ends as the parameter rises, -1 if the motion ends as the parameter falls.
    after : tuple of float
        Amplitudes of the stable motions to which the machine may jump; empty if no such motion was followed.
    """

    parameter: float
    direction: int
    before: float
    after: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Arc:
    """A part of a branch along which the parameter only rises or only falls and the stability does not change.

    Attributes
    ----------
    turns : int
        Number of common periods in a period of the motion: see `Branch.periods`.
    stable : bool
        Whether the motions on the arc are stable.
    parameter : ndarray, shape (m,)
        Values along the arc, rising.
    amplitudes : ndarray, shape (m, k)
        Amplitudes of the k free coordinates.
    start : ndarray, shape (m, n)
        Starts of the orbits.
    scale : ndarray, shape (n,)
        Typical magnitudes of a start: `PeriodicOrbit.scale`.
    cut : (bool, bool)
        Whether the branch continues on another arc beyond the low end, and beyond the high end.
    """

    turns: int
    stable: bool
    parameter: FloatArray
    amplitudes: FloatArray
    start: FloatArray
    scale: FloatArray
    cut: tuple[bool, bool]

    @property
    def amplitude(self) -> FloatArray:
        """Amplitude of the first free coordinate, shape (m,)."""
        return self.amplitudes[:, 0]

    @property
    def span(self) -> Interval:
        """The least and the greatest value of the parameter on the arc."""
        return float(self.parameter[0]), float(self.parameter[-1])

    def is_same_curve(self, other: Arc) -> bool:
        """Return whether two arcs are the same curve where they overlap, as when a branch was followed from both ends."""
        low, high = _overlap(self, other)
        if self.turns != other.turns or low >= high:
            return False
        places = np.linspace(low, high, 7)[1:-1]
        # a period of several turns may begin with any turn: compare amplitudes
        own, others = (a.start if a.turns == 1 else a.amplitudes for a in (self, other))
        size = np.maximum(np.abs(own).max(axis=0), _NOISE * self.scale[: own.shape[1]])
        apart = [
            np.abs(np.interp(places, self.parameter, a) - np.interp(places, other.parameter, b)) / s
            for a, b, s in zip(own.T, others.T, size)
        ]
        return bool(np.median(np.max(apart, axis=0)) < _SAME)


def find_beginning(
    branches: Iterable[Branch], kind: Crossing, orbit: PeriodicOrbit, value: float, width: float
) -> SpecialPoint | None:
    """Return the special point near a motion at which the motion's branch begins; None if there is none.

    ``kind`` is the kind of the point, a period doubling or a branch point; ``value`` is the value of the parameter at the
    motion, ``width`` the range of the parameter.
    """
    times = 2 if kind is Crossing.PERIOD_DOUBLING else 1
    points = [s for b in branches if times * b.turns == orbit.turns for s in b.special if s.kind is kind]
    for point in sorted(points, key=lambda point: abs(point.parameter - value)):
        if abs(point.parameter - value) < BEGINNING * width and point.orbit.distance(orbit.start) < BEGINNING:
            return point
    return None


def arcs(branches: Iterable[Branch]) -> tuple[Arc, ...]:
    """Return the arcs into which branches divide, in the order of the branches."""
    branches = tuple(branches)
    values = np.concatenate([branch.parameter for branch in branches]) if branches else np.zeros(1)
    low, high = float(values.min()), float(values.max())
    return tuple(arc for branch in branches for arc in _branch_arcs(branch, branches, low, high))


def _branch_arcs(branch: Branch, branches: Sequence[Branch], low: float, high: float) -> list[Arc]:
    """Return the arcs into which one of the branches divides; ``low`` and ``high`` are the range of their parameter."""
    passed = [(s.after + 1, s) for s in branch.special]
    # a branch that begins inside the range begins a step beyond a point of another one
    others = [b for b in branches if b is not branch]
    for place, end in ((0, 0), (len(branch), -1)):
        value = float(branch.parameter[end])
        if branch.closed or not low < value < high:
            continue
        for kind in (Crossing.PERIOD_DOUBLING, Crossing.BRANCH_POINT):
            begun = find_beginning(others, kind, branch.orbits[end], value, high - low)
            if begun is not None:
                passed.append((place, begun))
                break
    passed.sort(key=lambda entry: entry[0])
    places = [place for place, _ in passed]
    special = [point.orbit for _, point in passed]
    parameter = np.insert(branch.parameter, places, [point.parameter for _, point in passed])
    amplitudes, start = branch.amplitudes, np.array([orbit.start for orbit in branch.orbits])
    if special:
        amplitudes = np.insert(amplitudes, places, [orbit.amplitudes for orbit in special], axis=0)
        start = np.insert(start, places, [orbit.start for orbit in special], axis=0)
    # at a special point a multiplier is on the unit circle: stability is taken from the neighbouring points
    holds = np.insert(branch.largest_multiplier <= 1.0 + TOLERANCE, places, True)
    stable = holds[1:] & holds[:-1]
    if len(places) > 1:
        own = np.insert(np.zeros(len(branch), dtype=bool), places, True)
        stable &= ~(own[1:] & own[:-1])
    signs = np.sign(np.diff(parameter))
    changes = np.flatnonzero((stable[1:] != stable[:-1]) | (signs[1:] != signs[:-1])) + 1
    bounds = [0, *changes.tolist(), len(stable)]
    found = []
    for first, last in pairwise(bounds):
        if last == first or parameter[first] == parameter[last]:
            continue
        way = slice(first, last + 1)
        cut = first > 0, last < len(stable)
        order = 1 if parameter[last] > parameter[first] else -1
        found.append(
            Arc(
                turns=branch.periods,
                stable=bool(stable[first]),
                parameter=parameter[way][::order],
                amplitudes=amplitudes[way][::order],
                start=start[way][::order],
                scale=branch.orbits[0].scale,
                cut=cut if order > 0 else (cut[1], cut[0]),
            )
        )
    return found


def fold_jumps(branches: Sequence[Branch]) -> tuple[FoldJump, ...]:
    """Return the jumps at the folds at which a stable motion ends, sorted by parameter."""
    stable = [arc for arc in arcs(branches) if arc.stable]
    found: list[FoldJump] = []
    # a motion of twice the period begins at a doubling: its branch turns back there like at a fold, but no motion ends
    born = [s.parameter for branch in branches for s in branch.special if s.kind is Crossing.PERIOD_DOUBLING]
    for branch, special in ((b, s) for b in branches for s in b.special if s.kind is Crossing.FOLD):
        if branch.periods > 1 and any(abs(special.parameter - value) < _ROUNDING * abs(value) for value in born):
            continue
        value, amplitude = special.parameter, special.orbit.amplitude
        for arc, (end, direction) in product(stable, ((-1, 1), (0, -1))):
            if arc.parameter[end] != value or arc.amplitude[end] != amplitude:
                continue
            beyond: list[Arc] = []
            # a mirror image ends at the same value
            near = _ROUNDING * abs(value)
            for other in (o for o in stable if o.span[0] + near < value < o.span[1] - near):
                # a motion that was followed twice counts once
                if not any(other.is_same_curve(known) for known in (arc, *beyond)):
                    beyond.append(other)
            after = sorted(float(np.interp(value, other.parameter, other.amplitude)) for other in beyond)
            # a fold that was found from both sides counts once
            if not any(
                abs(value - other.parameter) < _ROUNDING * abs(value)
                and abs(amplitude - other.before) < _SAME * amplitude
                for other in found
            ):
                found.append(FoldJump(parameter=value, direction=direction, before=amplitude, after=tuple(after)))
    return tuple(sorted(found, key=lambda jump: jump.parameter))


def ranges_to_avoid(branches: Sequence[Branch], low: float, high: float) -> tuple[AvoidedRange, ...]:
    """Return the ranges of the parameter that a machine should avoid: resonance, jump, doubled period, or no stable motion.

    ``low`` and ``high`` bound the range of the parameter over which the branches were followed.
    """
    least = _SLIVER * (high - low)
    stable = [arc for arc in arcs(branches) if arc.stable]
    without = _gaps(_union((arc.span for arc in stable if arc.turns == 1), least), low, high)
    several = _union((arc.span for arc in stable if arc.turns > 1), least)
    doubled = [part for gap in without for part in _clip_intervals(several, *gap)]
    found = {
        (Risk.SEVERAL, ""): _union(
            (_overlap(a, b) for a, b in combinations(stable, 2) if not a.is_same_curve(b)), least
        ),
        (Risk.DOUBLED, ""): doubled,
    }
    for part in (part for gap in without for part in _gaps(several, *gap)):
        unbounded = any(_grows_towards(arc, *part) for arc in stable if arc.turns == 1)
        found.setdefault((Risk.UNBOUNDED if unbounded else Risk.UNSTABLE, ""), []).append(part)
    swings = branches[0].orbits[0].swings
    for n, (name, _) in enumerate(swings):
        bands = (band for arc in stable for band in _resonances(arc, n))
        found[Risk.RESONANCE, name if len(swings) > 1 else ""] = _union(bands, least)
    ranges = [
        AvoidedRange(low=a, high=b, risk=risk, coordinate=name)
        for (risk, name), parts in found.items()
        for a, b in parts
        if b - a > least
    ]
    return tuple(sorted(ranges, key=lambda avoided: (avoided.low, avoided.high)))


def _overlap(a: Arc, b: Arc) -> Interval:
    """Return the range of the parameter in which two arcs overlap; if they do not overlap, its end lies below its beginning."""
    return max(a.span[0], b.span[0]), min(a.span[1], b.span[1])


def _grows_towards(arc: Arc, low: float, high: float) -> bool:
    """Return whether an arc ends at ``low``, or begins at ``high``, because its amplitude grows without limit."""
    size = np.abs(arc.amplitudes / arc.scale[: arc.amplitudes.shape[1]]).max(axis=1)
    ends = [(arc.cut[0], arc.span[0] == high, size[0]), (arc.cut[1], arc.span[1] == low, size[-1])]
    return any(meets and not cut and last == size.max() > _UNBOUNDED for cut, meets, last in ends)


def _resonances(arc: Arc, coordinate: int) -> list[Interval]:
    """Return the half-power bands of the peaks of a coordinate's amplitude along an arc, as ranges of the parameter.

    An end of the arc at which the branch continues on another arc also counts as a peak if the amplitude is greatest at this
    end, or just before it, as beside a fold, and falls to half power on the arc; but not for a period of several turns.
    """
    a = arc.amplitudes[:, coordinate]
    tops = [top for top, prominence in peaks(a) if prominence > _PROMINENCE * a[top]]
    bands = [tuple(_band_end(arc.parameter, a, top, way) for way in (-1, 1)) for top in tops]
    # an end counts only if the amplitude falls below half power on the arc; otherwise it may be a point on a slope
    for end, cut, way in ((0, arc.cut[0], 1), (len(a) - 1, arc.cut[1], -1)):
        top = int(a.argmax())
        if arc.turns == 1 and cut and a[end] >= (1.0 - _PROMINENCE) * a[top] and a.min() < HALF_POWER * a[top]:
            bands.append(tuple(sorted((float(arc.parameter[end]), _band_end(arc.parameter, a, top, way)))))
    return [(low, high) for low, high in bands if isfinite(low) and isfinite(high)]


def _band_end(x: FloatArray, a: FloatArray, top: int, way: int) -> float:
    """Return the parameter at the half-power point on one side of a peak, or at the end of the arc.

    The result is infinite if the amplitude exceeds the peak before it falls to half power. Along the arc ``x`` is the parameter
    and ``a`` the amplitude; ``top`` is the index of the peak; ``way`` is -1 for the side of lower parameters, +1 for the other.
    """
    level, i = HALF_POWER * a[top], top
    while 0 <= i + way < len(a):
        i += way
        if a[i] > a[top]:
            return inf
        if a[i] < level:
            # interpolate by a cubic through the four points around the crossing, but stay between the two nearest points
            about = slice(max(min(i, i - way) - 1, 0), max(i, i - way) + 2)
            places = a[about].tolist()
            weights = [prod((level - b) / (c - b) for b in places if b != c) for c in places]
            return float(np.clip(np.dot(weights, x[about]), *sorted((x[i - way], x[i]))))
    return float(x[i])


def _union(intervals: Iterable[Interval], least: float) -> list[Interval]:
    """Return the union of intervals, sorted; intervals that overlap or are closer than ``least`` are joined."""
    joined: list[Interval] = []
    for low, high in sorted((low, high) for low, high in intervals if low < high):
        if joined and low <= joined[-1][1] + least:
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return joined


def _gaps(intervals: Sequence[Interval], low: float, high: float) -> list[Interval]:
    """Return the parts of the range from ``low`` to ``high`` that sorted intervals do not cover."""
    ends = [low, *(v for interval in _clip_intervals(intervals, low, high) for v in interval), high]
    return [(a, b) for a, b in zip(ends[::2], ends[1::2]) if a < b]


def _clip_intervals(intervals: Iterable[Interval], low: float, high: float) -> list[Interval]:
    """Return the parts of intervals that lie in the range from ``low`` to ``high``."""
    return [(max(a, low), min(b, high)) for a, b in intervals if max(a, low) < min(b, high)]


#: Relative error of an amplitude that is computed from samples.
_SAMPLED = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Extremum:
    """A local maximum or minimum of the amplitude over the parameter of a family.

    Attributes
    ----------
    parameter : float
        Value of the parameter at the extremum, such as the speed (rad/s).
    amplitude : float
        Amplitude of the coordinate (m for a slider).
    stability : Stability
        Stability of the motion at the extremum.
    orbit : PeriodicOrbit
        The motion at the extremum.
    coordinate : int
        Index of the free coordinate in `PeriodicOrbit.swings`.
    """

    parameter: float
    amplitude: float
    stability: Stability
    orbit: PeriodicOrbit
    coordinate: int = 0


def extrema(branch: Branch, sign: int = 1) -> tuple[Extremum, ...]:
    """Find the local maxima (sign +1) or minima (-1) of the amplitude of each free coordinate along a branch.

    `extremum_orbit` locates each extremum: there the exact derivative of the amplitude with respect to the parameter is zero.
    If the parameter of the family is not an FMI name but a function, or if the amplitude has a kink, Brent's method locates the
    extremum with a relative error of 1e-4 of the parameter.
    """
    found = []
    for number, amplitude in enumerate(sign * branch.amplitudes.T):
        for i, prominence in peaks(amplitude):
            if prominence < _PROMINENCE * abs(amplitude[i]):
                continue
            located = _locate_extremum(branch, i, sign, number)
            if located is None:
                continue
            place, orbit = located
            size, stability = float(orbit.amplitudes[number]), orbit.verdict().stability
            top = Extremum(parameter=place, amplitude=size, stability=stability, orbit=orbit, coordinate=number)
            found.append(top)
    return tuple(found)


def _locate_extremum(branch: Branch, point: int, sign: int, coordinate: int) -> tuple[float, PeriodicOrbit] | None:
    """Find an extremum of a coordinate's amplitude; return the value of the parameter, and the motion there.

    The search starts from the motion with the index ``point`` on the branch, and stays between the values of the parameter at
    its neighbours. If the parameter turns back there, the extremum lies beside a fold, often too near to be told from the fold:
    the result is then the fold, or None if there is no fold, as at a branch point. ``sign`` is +1 for a maximum, -1 for a
    minimum.
    """
    family, orbit, begin = branch.family, branch.orbits[point], float(branch.parameter[point])
    a, c = sorted((float(branch.parameter[point - 1]), float(branch.parameter[point + 1])))
    folded = not a < begin < c

    def nearby_orbit(value: float, near: FloatArray = orbit.start) -> PeriodicOrbit:
        return newton_orbit(*family.operation(value), turns=orbit.turns, start=near, settle=False)

    if isinstance(family.vary, str):
        try:
            if folded:
                reach = max(abs(a - begin), abs(c - begin))
                a, c = begin - reach, begin + reach
                orbit = nearby_orbit(*_interpolate_extremum(branch, point, coordinate))
            rested = extremum_orbit(orbit, family.vary, coordinate)
        except LinkworkError:
            pass
        else:
            place = parameter_value(rested.parameters, rested.drive, family.vary)
            was, now = branch.amplitudes[point, coordinate], rested.amplitudes[coordinate]
            if a < place < c and sign * (now - was) > -_SAMPLED * was:
                return place, rested
    if folded:
        folds = (s for s in branch.special if s.kind is Crossing.FOLD and s.after in (point - 1, point))
        return next(((fold.parameter, fold.orbit) for fold in folds), None)
    try:
        best = scipy.optimize.minimize_scalar(
            lambda value: -sign * float(nearby_orbit(value).amplitudes[coordinate]),
            bounds=(a, c),
            method="bounded",
            options={"xatol": 1e-6 * (c - a)},
        )
        return float(best.x), nearby_orbit(float(best.x))
    except OrbitError:
        # near the limit of assembly a neighbour at a fixed parameter may not be found: keep the point itself
        return begin, orbit


def _interpolate_extremum(branch: Branch, point: int, coordinate: int) -> tuple[float, FloatArray]:
    """Return parameter and start of a motion at the vertex of the parabola through the amplitudes of three points of a branch.

    The amplitude is a function of the length along the curve of amplitude and parameter, which passes a fold smoothly.
    """
    places = slice(point - 1, point + 2)
    amplitude, parameter = branch.amplitudes[places, coordinate], branch.parameter[places]
    steps = np.hypot(np.diff(amplitude) / np.ptp(amplitude), np.diff(parameter) / np.ptp(parameter))
    length = np.array([-steps[0], 0.0, steps[1]])
    curve, slope, _ = np.polyfit(length, amplitude, 2)
    others = np.column_stack([parameter, *np.array([orbit.start for orbit in branch.orbits[places]]).T])
    vertex = np.polyfit(length, others, 2).T @ np.array([(slope / (2.0 * curve)) ** 2, -slope / (2.0 * curve), 1.0])
    return float(vertex[0]), vertex[1:]


def special_gradient(
    family: Family, point: SpecialPoint | Extremum, names: Sequence[str] | None = None
) -> PointGradient:
    """Compute how a special point of a branch, or an extremum of the amplitude, moves when other parameters change.

    Parameters
    ----------
    family : Family
        A family over a parameter with an FMI name.
    point : SpecialPoint or Extremum
    names : sequence of str, optional
        FMI names of the other parameters; by default all, see `gradient_names`.

    Raises
    ------
    InputError
        If the parameter of the family is not an FMI name but a function.
    LinkworkError
        If the value of the family's parameter at the point has no derivative, for example where two folds meet.
    """
    if not isinstance(family.vary, str):
        raise InputError(f"{family.name} is a function: gradients are along a parameter with an FMI name")
    if isinstance(point, SpecialPoint):
        return crossing_gradient(point.orbit, point.kind, family.vary, names)
    return extremum_gradient(point.orbit, family.vary, names, point.coordinate)
