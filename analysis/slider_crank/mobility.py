"""Find the mobility of the slider-crank: margin of assembly, ranges of the crank, dead centres, stroke.

The shift S1 is a function of theta1; a prime is a derivative with respect to theta1. With the crank pin's coordinates f and g
perpendicular to the guide, as in `kinematics`,

    D = a2^2 - f^2 - g^2       its square root is h: the rod reaches the guide where D >= 0
    A = D'/2                   A = 0 where the margin of assembly is least or greatest
    S4' = A/h - B,  B = a1 cos(theta1) sin(alpha4) + S1' cos(alpha4)

and the slider's dead centres are the zeros of h S4' = A - B h, which stays finite at the limit of assembly. To find the zeros,
the turn is halved repeatedly. The lengths and the bounds of the law's derivatives bound the change of each function over a
piece, and a piece is dropped only if this bound excludes a zero. In the remaining pieces zeros are bisected to the last digit.
No zero is missed except pairs closer together than `FINEST`; the slider moves by some 1e-10 of the crank's length between them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import cos, inf, isfinite, pi, sin, sqrt
from sys import float_info
from typing import NamedTuple

from linkwork.errors import AssemblyError, InputError, ParameterError
from linkwork.slider_crank import kinematics
from linkwork.slider_crank.assembly import check_assembly
from linkwork.slider_crank.parameters import Constants, SliderCrankParameters

from ..run import takes_published
from ..units import Amount, in_si

#: Width (rad) of a piece of the turn that is not divided further. Two zeros in one such piece are not found.
FINEST = 1e-3
#: Value relative to its scale below which a function counts as zero, so that rounding errors do not make a slider at rest turn
#: back.
_ROUNDING = 1e-13
#: Relative difference up to which the rod and its distance to the guide count as equal: the difference may be a rounding error.
_EQUAL = 8.0 * float_info.epsilon
#: Pieces into which the turn is divided first.
_PIECES = 32
#: Angle (rad) at which the search of a turn begins: an arbitrary one, at which a zero is unlikely.
_SEAM = -0.7390851332151607
#: Largest number of turns after which the law of a groove may repeat.
_MOST_TURNS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class PeriodicShift:
    """The axial shift as a function of the crank angle.

    Parameters
    ----------
    at : callable
        Function of the crank angle (rad) that returns the shift (m) and the derivative of the shift with respect to the angle
        (m/rad); further items of the result are ignored, so that `kinematics.groove` can be used.
    rate, curvature : float
        Upper bounds of the absolute values of the first and second derivatives of the shift with respect to the angle (m/rad,
        m/rad2), not necessarily sharp.
    turns : int
        Whole turns of the crank after which the law repeats.

    Raises
    ------
    InputError
        If a bound is negative or not finite, if ``turns`` is not a whole number above zero, or if the law does not repeat.
    """

    at: Callable[[float], Sequence[float]]
    rate: float
    curvature: float
    turns: int = 1

    def __post_init__(self) -> None:
        for name in ("rate", "curvature"):
            bound = getattr(self, name)
            if not (isfinite(bound) and bound >= 0.0):
                raise InputError(f"the shift law's {name} is {bound!r}: it must be a finite number, zero or greater")
        if isinstance(self.turns, bool) or not isinstance(self.turns, int) or self.turns < 1:
            raise InputError(f"the shift law's turns are {self.turns!r}: they must be a whole number above zero")
        first, last = self.at(0.0)[0], self.at(self.span)[0]
        if not abs(first - last) <= 1e-9 * (self.rate + abs(first)):
            raise InputError(
                f"the shift law is {first:.9g} m at 0 and {last:.9g} m after {self.turns} turns: it must repeat after them"
            )

    @property
    def span(self) -> float:
        """Return the crank rotation after which the law repeats (rad)."""
        return 2.0 * pi * self.turns


@in_si(shift="m")
def constant_shift(shift: Amount) -> PeriodicShift:
    """Return the law of a crank held at the shift S1 (m).

    Raises
    ------
    InputError
        If ``shift`` is not finite.
    """
    if not isfinite(shift):
        raise InputError(f"the shift is {shift!r} m: it must be a finite number")
    return PeriodicShift(at=lambda _: (shift, 0.0), rate=0.0, curvature=0.0)


@takes_published()
def groove_shift(parameters: SliderCrankParameters) -> PeriodicShift:
    """Return the law of the parameters' groove, S1 = SS1 sin(alpha theta1) of eq 28.

    Raises
    ------
    ParameterError
        If alpha is not a ratio of whole numbers with a denominator of at most 64. The law repeats after as many turns as the
        denominator says.
    """
    p = parameters.constants()
    ratio = Fraction(p.ratio).limit_denominator(_MOST_TURNS)
    if abs(float(ratio) - p.ratio) > 1e-12 * max(1.0, abs(p.ratio)):
        raise ParameterError("groove.ratio", p.ratio, f"repeat after at most {_MOST_TURNS} turns of the crank")
    rate, curvature, turns = abs(p.amplitude * p.ratio), abs(p.amplitude * p.ratio * p.ratio), ratio.denominator
    return PeriodicShift(at=lambda th: kinematics.groove(th, p), rate=rate, curvature=curvature, turns=turns)


class Margin(NamedTuple):
    """The least or the greatest margin of assembly over the turn, and the crank angle at which it occurs."""

    length: float  # rod length minus distance of the crank pin from the guide (m)
    crank_angle: float  # rad


class Place(NamedTuple):
    """Crank angle (rad), shift (m) and slider position (m) of a configuration."""

    crank_angle: float
    shift: float
    slider_position: float


class DeadCentre(NamedTuple):
    """A configuration in which the slider reverses: crank angle (rad), shift and slider position (m).

    ``outer`` is true at a maximum of the slider position on branch +1 and at a minimum on branch -1: the slider is then at the
    outer end of its travel.
    """

    crank_angle: float
    shift: float
    slider_position: float
    outer: bool


class Range(NamedTuple):
    """A range of crank angles in which the rod reaches the guide, and the slider positions in it.

    ``low`` (rad) is in [0, span), and ``high`` exceeds ``low`` by at most the span; all other crank angles are in [0, span).
    The span is the crank rotation after which the law of the shift repeats: one turn or more. ``greatest`` and ``least`` are
    the extreme slider positions; if the crank cannot turn fully, they may be at an end of the range.
    """

    low: float
    high: float
    dead_centres: tuple[DeadCentre, ...]
    greatest: Place
    least: Place

    def full(self, span: float) -> bool:
        """Return whether the range covers the whole ``span`` of the law and so has no ends."""
        return self.high - self.low >= span * (1.0 - 1e-12)

    @property
    def stroke(self) -> float:
        """Return the greatest minus the least slider position (m)."""
        return self.greatest.slider_position - self.least.slider_position


class _Change(NamedTuple):
    """D, A, B of the module docstring (``square``, ``pull``, ``along``) at the middle of a piece, and bounds of their changes.

    The bounds (``*_spread``) are for changes from the middle to any point of the piece.
    """

    square: float
    pull: float
    pull_spread: float
    along: float
    square_spread: float
    along_spread: float


def _change(middle: float, half: float, law: PeriodicShift, p: Constants, pitch: float) -> _Change:
    """Return D, A, B and bounds of their changes over ``middle`` +- ``half``; ``pitch`` (1 or 0) multiplies S1' in A and B."""
    s1, ds1 = law.at(middle)[:2]
    if not (isfinite(s1) and abs(ds1) <= law.rate * (1.0 + 1e-9)):
        raise InputError(
            f"the shift law is {s1:g} m with the derivative {ds1:g} m/rad at crank angle {middle:.9g} rad: it must be finite "
            f"and change by no more than its rate, {law.rate:g} m/rad"
        )
    c, s = cos(middle), sin(middle)
    most = abs(s1) + half * law.rate

    def pull(pitch: float) -> tuple[float, float]:
        # A with the squares of f and g taken together: they cancel where guide and crank axis are nearly parallel
        by_shift = p.a1 * p.ca * (c * s1 + pitch * s * ds1) - pitch * p.sa * s1 * ds1
        steepest = p.a1 * abs(p.a4) + abs(p.sa) * (
            p.a1 * p.a1 * abs(p.sa)
            + p.a1 * abs(p.ca) * (most + law.rate + pitch * (law.rate + law.curvature))
            + pitch * abs(p.sa) * (law.rate * law.rate + most * law.curvature)
        )
        return p.a1 * p.a4 * s + p.sa * (p.a1 * p.a1 * p.sa * s * c + by_shift), half * steepest

    total, total_spread = pull(1.0)
    value, spread = (total, total_spread) if pitch == 1.0 else pull(pitch)
    return _Change(
        kinematics.assembly_square(middle, s1, p),
        value,
        spread,
        p.a1 * c * p.sa + pitch * ds1 * p.ca,
        2.0 * half * (abs(total) + total_spread),
        half * (p.a1 * abs(p.sa) + pitch * law.curvature * abs(p.ca)),
    )


#: A function of the middle and the half width of a piece: returns its value in the middle, and a bound of its change.
_Bounded = Callable[[float, float], tuple[float, float]]


def _slider_slope(changes: Callable[[float, float], _Change], branch: float) -> _Bounded:
    """Return the function A - B h (A + B h on branch -1): its sign is that of S4' on branch +1, the opposite on branch -1."""

    def slope(middle: float, half: float) -> tuple[float, float]:
        change = changes(middle, half)
        h = sqrt(max(0.0, change.square))
        # |sqrt x - sqrt y| is at most sqrt |x - y|, and at most |x - y| / sqrt x
        spread = sqrt(change.square_spread)
        if change.square_spread < spread * h:
            spread = change.square_spread / h
        along = abs(change.along)
        return (
            change.pull - branch * change.along * h,
            change.pull_spread + along * spread + change.along_spread * (h + spread),
        )

    return slope


def _bisect(positive: Callable[[float], bool], low: float, high: float) -> float:
    """Find the angle between ``low`` and ``high`` at which ``positive`` changes its value, by bisection to the last digit."""
    at_low = positive(low)
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if positive(middle) == at_low:
            low = middle
        else:
            high = middle


def _zeros(function: _Bounded, low: float, high: float, scale: float) -> list[tuple[float, bool]]:
    """Find all sign changes of ``function`` between ``low`` and ``high``, in order: the angle, and whether the function falls.

    A stretch over which the function is zero, up to rounding errors of ``scale``, counts as one zero if the signs before and
    after the stretch differ; otherwise it does not count.
    """

    def positive(x: float) -> bool:
        return function(x, 0.0)[0] > 0.0

    floor = _ROUNDING * scale
    kept: list[float] = [low]

    def search(a: float, b: float) -> None:
        middle = 0.5 * (a + b)
        value, spread = function(middle, 0.5 * (b - a))
        if abs(value) > spread:
            return
        if b - a > FINEST and abs(value) + spread > floor:
            search(a, middle)
            search(middle, b)
        else:
            kept.extend((a, b) if a != kept[-1] else (b,))

    for a, b in pairwise([low + (high - low) * n / _PIECES for n in range(_PIECES)] + [high]):
        search(a, b)
    # look for sign changes only in the pieces that were kept
    found: list[tuple[float, bool]] = []
    last: float | None = None
    for x in kept:
        if abs(function(x, 0.0)[0]) <= floor:
            continue
        if last is not None and positive(x) != positive(last):
            found.append((_bisect(positive, last, x), positive(last)))
        last = x
    return found


def _wrap_angle(angle: float, law: PeriodicShift) -> float:
    """Return the angle reduced to [0, span); the remainder of a tiny negative number, which rounds to the span, becomes 0."""
    wrapped = angle % law.span
    return wrapped if wrapped < law.span else 0.0


def _assembly_square(angle: float, law: PeriodicShift, p: Constants) -> float:
    """Return squared rod length minus squared distance of crank pin from guide (m2); zero if it is a rounding error."""
    square = kinematics.assembly_square(angle, law.at(angle)[0], p)
    return 0.0 if abs(square) <= _EQUAL * p.a2 * p.a2 else square


def _extremes(law: PeriodicShift, p: Constants) -> list[float]:
    """Find the angles of local extremes of the margin of assembly, in order; one angle if the margin is the same everywhere."""

    def slope(middle: float, half: float) -> tuple[float, float]:
        """Return the function A: it is zero where the distance between crank pin and guide is extreme."""
        change = _change(middle, half, law, p, 1.0)
        return change.pull, change.pull_spread

    zeros = _zeros(slope, _SEAM, _SEAM + law.span, (p.a1 + law.rate) * p.a2)
    return [angle for angle, _ in zeros] or [0.0]


@takes_published()
def assembly_margin(parameters: SliderCrankParameters, law: PeriodicShift) -> Margin:
    """Find the least margin of assembly over the turn; it is negative if the crank cannot turn fully.

    The crank can turn fully if this margin is zero or greater. A simulation ends before the limit of assembly: it needs a
    margin of 5e-7 rod lengths, which follows from `linkwork.limits.LIMIT_SINE`.
    """
    return _margin(min, law, parameters.constants())


@takes_published()
def greatest_margin(parameters: SliderCrankParameters, law: PeriodicShift) -> Margin:
    """Find the greatest margin of assembly over the turn; it is negative if the mechanism can be assembled nowhere."""
    return _margin(max, law, parameters.constants())


def _margin(choose: Callable[..., float], law: PeriodicShift, p: Constants) -> Margin:
    """Return the least or greatest margin over the turn, chosen by ``choose``, which is min or max."""
    place = choose(_extremes(law, p), key=lambda angle: _assembly_square(angle, law, p))
    return Margin(p.a2 - sqrt(p.a2 * p.a2 - _assembly_square(place, law, p)), _wrap_angle(place, law))


@takes_published()
def greatest_shift(parameters: SliderCrankParameters) -> float | None:
    """Find the greatest constant shift ``|S1|`` (m) at which the crank turns fully; None if there is none.

    The crank turns fully at shifts of either sign up to this value. If the guide is parallel to the crank axis and the crank
    turns fully at one shift, it does so at every shift, and the result is infinite.
    """
    p = parameters.constants()
    room = p.a2 - p.a1 - abs(p.a4)
    if room < -_EQUAL * p.a2:
        return None
    # |S1 sin(alpha4) - a1 s cos(alpha4)| <= r = sqrt(a2^2 - f^2) at every angle: |S1 sin(alpha4)| is at most the least
    # value of a1 s |cos(alpha4)| + r, the position of a planar slider apart from the cosine

    def changes(middle: float, half: float) -> _Change:
        c, s = cos(middle), sin(middle)
        f = p.a1 * c + p.a4
        most = abs(f) + half * p.a1
        lean = p.a1 * abs(p.ca)
        spread = half * most * p.a1
        return _Change(
            p.a2 * p.a2 - f * f, f * p.a1 * s, spread + half * p.a1 * p.a1, -lean * c, 2.0 * spread, half * lean
        )

    def bound(angle: float) -> float:
        f = p.a1 * cos(angle) + p.a4
        return p.a1 * sin(angle) * abs(p.ca) + sqrt(max(0.0, p.a2 * p.a2 - f * f))

    least = 0.0
    if room > _EQUAL * p.a2:
        zeros = _zeros(_slider_slope(changes, 1.0), _SEAM, _SEAM + 2.0 * pi, p.a1 * p.a2)
        least = min(bound(angle) for angle, _ in zeros)
    # the sine of a twist of pi is a rounding error
    parallel = abs(p.sa) <= 4.0 * float_info.epsilon * max(1.0, abs(parameters.guide_twist))
    return inf if parallel else least / abs(p.sa)


def _place(angle: float, law: PeriodicShift, p: Constants, *, limit: bool = False) -> Place:
    """Return the configuration at a crank angle; if ``limit``, with the rod exactly perpendicular to the guide."""
    shift = law.at(angle)[0]
    # at the limit h is set to zero: the square root would magnify the rounding error of the angle
    h = 0.0 if limit else p.branch * sqrt(max(0.0, kinematics.assembly_square(angle, shift, p)))
    return Place(_wrap_angle(angle, law), shift, h - p.a1 * sin(angle) * p.sa - shift * p.ca)


def _dead_centres(low: float, high: float, law: PeriodicShift, p: Constants, pitch: float) -> tuple[DeadCentre, ...]:
    slope = _slider_slope(lambda middle, half: _change(middle, half, law, p, pitch), p.branch)
    zeros = _zeros(slope, low, high, (p.a1 + law.rate) * p.a2)
    return tuple(sorted(DeadCentre(*_place(angle, law, p), outer=falling) for angle, falling in zeros))


def _range(low: float, high: float, law: PeriodicShift, p: Constants) -> Range:
    dead = _dead_centres(low, high, law, p, 1.0)
    # a full turn is searched from `_SEAM` on, and reported from zero on
    full = low == _SEAM
    places = [_place(low, law, p, limit=not full), _place(high, law, p, limit=not full)]
    places += [Place(*centre[:3]) for centre in dead]
    places.sort(key=lambda place: place.slider_position)
    start, end = (0.0, law.span) if full else (_wrap_angle(low, law), _wrap_angle(low, law) + (high - low))
    return Range(start, end, dead, places[-1], places[0])


def _find_ranges(law: PeriodicShift, p: Constants) -> list[tuple[float, float]]:
    """Find the ranges (low, high) of crank angles in which the rod reaches the guide."""
    extremes = _extremes(law, p)
    reached = [_assembly_square(angle, law, p) >= 0.0 for angle in extremes]
    if all(reached):
        return [(_SEAM, _SEAM + law.span)]
    # between two extremes D is monotonic; the last interval ends at the first extreme plus a span
    closed = [*extremes, extremes[0] + law.span]
    starts: list[float] = []
    ends: list[float] = []
    for (a, b), at_a, at_b in zip(pairwise(closed), reached, [*reached[1:], reached[0]]):
        if at_a != at_b:
            crossing = _bisect(lambda x: _assembly_square(x, law, p) >= 0.0, a, b)
            (ends if at_a else starts).append(crossing)
    # a range that contains the seam ends at the first crossing after it, plus a span
    if ends and ends[0] < starts[0]:
        ends.append(ends.pop(0) + law.span)
    return sorted(zip(starts, ends), key=lambda pair: _wrap_angle(pair[0], law))


@takes_published()
def ranges(parameters: SliderCrankParameters, law: PeriodicShift) -> tuple[Range, ...]:
    """Find the ranges of crank angles in which the rod reaches the guide, with dead centres and stroke.

    There is one range, from 0 to the span, if the crank turns fully; none if the mechanism cannot be assembled at all; at most
    two at a constant shift. At the ends of a range rod and guide are exactly perpendicular; a simulation stops earlier,
    where the cosine of the angle between them falls below `linkwork.limits.LIMIT_SINE`.
    """
    p = parameters.constants()
    return tuple(_range(low, high, law, p) for low, high in _find_ranges(law, p))


@takes_published()
def assembled_ranges(parameters: SliderCrankParameters, law: PeriodicShift) -> tuple[Range, ...]:
    """Find the `ranges` of crank angles in which a mechanism can be assembled; there is at least one.

    Raises
    ------
    AssemblyError
        If there is no such range; the message gives the least missing length of the rod.
    """
    found = ranges(parameters, law)
    if not found:
        nearest = greatest_margin(parameters, law).crank_angle
        try:
            check_assembly(nearest, law.at(nearest)[0], parameters.constants())
        except AssemblyError as error:
            raise AssemblyError(
                f"it cannot be assembled at any crank angle; where it comes nearest to it, {error}"
            ) from None
    return found


@takes_published()
def dead_centres(parameters: SliderCrankParameters, law: PeriodicShift) -> tuple[DeadCentre, ...]:
    """Find all configurations in which the slider reverses, dS4/dtheta1 = 0 along the law, in the order of their angles.

    If the slider stands still at every angle, there is no dead centre. At a constant shift there are two dead centres if the
    crank turns fully, and at most four on the two branches together.

    If the crank torque is given and the slider force sought, these configurations are singular at a constant shift, or if a
    groove in the shaft makes the shift. If the shift has a drive of its own, `singularities` finds the singular configurations.
    """
    return tuple(sorted(centre for part in ranges(parameters, law) for centre in part.dead_centres))


@takes_published()
def singularities(parameters: SliderCrankParameters, law: PeriodicShift) -> tuple[DeadCentre, ...]:
    """Find the configurations along the law in which the crank torque does not determine the slider force: kth = 0.

    kth is the derivative of the slider position with respect to the crank angle at constant shift. If the shift has a drive of
    its own, kth multiplies the slider force in the crank's equation of motion (the thesis's force problem), whatever the rate
    of the shift. The slider itself stops in these configurations only if the shift is constant. ``outer`` is true if, at
    constant shift, the slider position would have a maximum (on branch +1) or a minimum (on branch -1).
    """
    p = parameters.constants()
    found = (_dead_centres(low, high, law, p, 0.0) for low, high in _find_ranges(law, p))
    return tuple(sorted(centre for part in found for centre in part))
