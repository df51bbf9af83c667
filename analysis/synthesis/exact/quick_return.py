"""Find the best slider-crank for a stroke, or crank-rocker for a swing, with a given time ratio, in closed form.

In the dead centres C is at the distances l3 + l2 and l3 - l2 from A. The angle between the two directions of A -> C is
advance = pi (Q - 1)/(Q + 1). The laws of cosines and sines give

    l2^2 (1 + cos advance) = H^2/2 - l3^2 (1 - cos advance),    l1 H = (l3^2 - l2^2) sin advance

with the stroke H, the time ratio Q and the offset l1. One unknown remains, l3: it is chosen so that (l1 + l2)/l3, the cosine
of the least transmission angle, is least. For a crank-rocker the same equations hold, with the chord H = 2 l4 sin(swing/2)
between the two extreme positions of C. D lies on A's side of that chord if, with a counter-clockwise crank, the slow
swing of the rocker is counter-clockwise, too. See R. L. Norton, Design of Machinery, 6th ed., 2020, chapters 3 and 4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import acos, cos, degrees, hypot, inf, isfinite, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from linkwork.errors import InputError, ParameterError

from ...units import Amount, in_si
from ..linkage.linkage import LINKS, Linkage, SliderCrank
from ..result.solution import Solution, rank_solutions
from ..task.constraint import Assembly, FullTurn, InfeasibleError, LargestLink, LeastTransmission
from ..task.limit_position import dead_centres
from ..task.limits import GROUND, LARGEST, check_bounds, check_greatest_length, check_sequence, complete_bounds
from ..task.task import RockerFunction, SliderFunction

FloatArray = NDArray[np.float64]
#: Number of coupler lengths that are tried before the best one is found exactly.
COUPLERS = 2001
#: Dimensions of a slider-crank that may have bounds.
BOUNDED = ("ground_length", "crank_length", "coupler_length")


@in_si(stroke="m")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuickReturn(SliderFunction):
    """Task: the slider moves by a stroke along the x axis in the slow part of a turn, and back in the quick part.

    Attributes
    ----------
    stroke : float
        Distance between the ends of the slider's travel (m).
    time_ratio : float
        Duration of the slow stroke divided by the duration of the quick stroke, at constant crank speed: at least 1.
    position, rotation : ndarray, shape (3,)
        Computed from stroke and time ratio: slider positions 0, stroke and 0 (m), and the crank rotations there (rad).
    """

    stroke: Amount
    time_ratio: float = 1.0
    position: ArrayLike = field(init=False)
    rotation: ArrayLike | None = field(init=False)
    weights: ArrayLike | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        if not (isfinite(float(self.stroke)) and float(self.stroke) > 0.0):
            raise ParameterError("stroke", float(self.stroke), "be a finite number above zero (m)")
        slow = pi + _advance(self.time_ratio)
        object.__setattr__(self, "position", np.array([0.0, float(self.stroke), 0.0]))
        object.__setattr__(self, "rotation", np.array([0.0, slow, 2.0 * pi]))
        SliderFunction.__post_init__(self)

    @property
    def advance(self) -> float:
        """Return the crank rotation of the slow part minus half a turn (rad)."""
        return _advance(self.time_ratio)


@in_si(swing="rad")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuickSwing(RockerFunction):
    """Task: the rocker of a crank-rocker swings by an angle in the slow part of a turn, and back in the quick part.

    Attributes
    ----------
    swing : float
        Swing of the rocker in the slow part (rad), less than half a turn: counter-clockwise, with a counter-clockwise crank.
        If the swing is negative, rocker and crank turn clockwise, which is the same linkage seen from behind.
    time_ratio : float
        See `QuickReturn`.
    angle, rotation : ndarray, shape (3,)
        Computed from swing and time ratio: rocker angles 0, swing and 0 (rad), relative to a free mounting angle, and the crank
        rotations there (rad).
    """

    swing: Amount
    time_ratio: float = 1.0
    angle: ArrayLike = field(init=False)
    rotation: ArrayLike | None = field(init=False)
    weights: ArrayLike | None = field(init=False, default=None)
    mounting: bool = field(init=False, default=True)

    def __post_init__(self) -> None:
        if not 0.0 < abs(float(self.swing)) < pi:
            raise ParameterError("swing", float(self.swing), "be an angle above zero and below half a turn (rad)")
        object.__setattr__(self, "angle", np.array([0.0, float(self.swing), 0.0]))
        way = 1.0 if float(self.swing) > 0.0 else -1.0
        object.__setattr__(self, "rotation", way * np.array([0.0, pi + _advance(self.time_ratio), 2.0 * pi]))
        RockerFunction.__post_init__(self)


def _advance(time_ratio: float) -> float:
    """Return the crank rotation of the slow part minus half a turn (rad).

    Raises ParameterError if the time ratio is not a finite number of 1 or more.
    """
    if not (isfinite(time_ratio) and time_ratio >= 1.0):
        raise ParameterError("time ratio", time_ratio, "be a finite number of 1 or more")
    return pi * (time_ratio - 1.0) / (time_ratio + 1.0)


def quick_returns(
    task: QuickReturn | QuickSwing, bounds: Mapping[str, tuple[float, float]] | None, constraints: Sequence[Any]
) -> tuple[Solution, ...]:
    """Find the linkage whose least transmission angle is greatest; return it in each allowed assembly.

    Raises InputError or ParameterError if a bound or a constraint is not supported here; InfeasibleError if there is no
    linkage, or no linkage has the required transmission angle: the message names the greatest possible angle.
    """
    check_sequence(constraints)
    for c in constraints:
        if not isinstance(c, LeastTransmission | FullTurn | LargestLink | Assembly):
            other = "SliderFunction" if isinstance(task, QuickReturn) else "RockerFunction"
            raise InputError(
                f"a {type(task).__name__} cannot keep {type(c).__name__}: leave it out, or ask for a {other}"
            )
    branches = {c.branch for c in constraints if isinstance(c, Assembly)}
    if len(branches) > 1:
        raise InfeasibleError("the constraints require both assemblies at once")
    cosine: Callable[[float], float]
    if isinstance(task, QuickReturn):
        ends = _dimension_ranges(task, bounds, constraints)
        asked, kind = f"a stroke of {1e3 * float(task.stroke):g} mm", "slider-crank"
        cosine, couplers = partial(_transmission_cosine, task=task, ends=ends), ends["coupler_length"]
    else:
        shape = _SwingShapes(task, bounds, constraints)
        asked, kind = f"a swing of {degrees(float(task.swing)):g} deg", "crank-rocker"
        cosine, couplers = shape.cosine, shape.couplers
    asked += f" and a time ratio of {task.time_ratio:g}"
    l3, least = _best_coupler(cosine, couplers), _least_angle(constraints)
    if not cosine(l3) < 1.0:
        raise InfeasibleError(f"no {kind} with {asked} has a crank that turns fully within these bounds")
    if acos(cosine(l3)) < least:
        raise InfeasibleError(
            f"a transmission angle of {degrees(least):g} deg is asked for: with {asked} the best {kind} has "
            f"{degrees(acos(cosine(l3))):.4g} deg"
        )
    made = [
        _make_slider_crank(task, l3, b) if isinstance(task, QuickReturn) else shape.linkage(l3, b)
        for b in branches or (1, -1)
    ]
    return rank_solutions([Solution.from_linkage(task, linkage) for linkage in made])


def _least_angle(constraints: Sequence[Any]) -> float:
    return max((float(c.angle) for c in constraints if isinstance(c, LeastTransmission)), default=0.0)


def _best_coupler(cosine: Callable[[float], float], ends: tuple[float, float]) -> float:
    """Find the coupler length, between two bounds, that minimises the cosine of the transmission angle."""
    couplers = np.linspace(*ends, COUPLERS)
    cosines = np.array([cosine(float(l3)) for l3 in couplers])
    best = int(np.argmin(cosines))
    low, high = couplers[max(best - 1, 0)], couplers[min(best + 1, COUPLERS - 1)]
    found = minimize_scalar(cosine, bounds=(low, high), method="bounded", options={"xatol": 1e-12 * high})
    return float(min((couplers[best], float(found.x)), key=cosine))


class _SwingShapes:
    """Crank-rockers with a given swing and time ratio. ``l3`` is the ratio of coupler to rocker; bounds determine the size."""

    def __init__(self, task: QuickSwing, bounds: Any, constraints: Sequence[Any]) -> None:
        self.task, self.advance = task, _advance(task.time_ratio)
        self.bounds = _read_bounds(bounds, LINKS, LINKS)
        self.cap = min((float(c.length) for c in constraints if isinstance(c, LargestLink)), default=inf)
        chord = 2.0 * sin(0.5 * abs(float(task.swing)))
        most = chord / (2.0 * sin(0.5 * self.advance)) if self.advance > 0.0 else inf
        self.couplers = 0.5 * chord, min(most, LARGEST)
        self.chord = chord

    def links(self, l3: float) -> tuple[float, float, float, float] | None:
        """Return l1 ... l4 (m) for a ratio l3; None if the dead centres need different assemblies, or a bound is violated."""
        e, l2 = _lengths(l3, self.advance, self.chord)
        far = sqrt(max((l3 + l2) ** 2 - e * e, 0.0))
        x, y = far - 0.5 * self.chord, sqrt(max(1.0 - 0.25 * self.chord**2, 0.0)) - e
        # side of A -> C on which D lies, for both positions of C
        sides = [x * -e - y * reach for reach in (far, far - self.chord)]
        if l2 <= 0.0 or sides[0] * sides[1] <= 0.0:
            return None
        found = dict(zip(LINKS, (hypot(x, y), l2, l3, 1.0)))
        least = max(low / found[name] for name, (low, _) in self.bounds.items())
        most = min(min(high, self.cap) / found[name] for name, (_, high) in self.bounds.items())
        if least > most * (1.0 + 1e-9):
            return None
        # a ground link of 100 mm, or as near to it as the bounds allow
        scale = min(max(GROUND / found["ground_length"], least), most)
        return tuple(scale * value for value in found.values())  # type: ignore[return-value]

    def cosine(self, l3: float) -> float:
        """Return the cosine of the least transmission angle over a turn; 1 if no linkage exists or a bound is violated."""
        links = self.links(l3)
        if links is None:
            return 1.0
        l1, l2, l3, l4 = links
        both = [abs(l3 * l3 + l4 * l4 - reach * reach) / (2.0 * l3 * l4) for reach in (l1 - l2, l1 + l2)]
        return min(1.0, max(both))

    def linkage(self, l3: float, branch: int) -> Linkage:
        """Build the crank-rocker for a ratio l3; the crank rotation is 0 in the dead centre at which the slow part begins."""
        links = self.links(l3)
        assert links is not None
        l1, l2, l3, l4 = links
        # a clockwise swing is a counter-clockwise one seen from behind
        side = 1 if float(self.task.swing) > 0.0 else -1
        made = Linkage(ground_length=l1, crank_length=l2, coupler_length=l3, rocker_length=l4, branch=side * branch)
        first, second = dead_centres(made)
        slow = [
            (abs((end - start) % (2.0 * pi) - pi - self.advance), start)
            for start, end in ((first, second), (second, first))
        ]
        begun = [replace(made, branch=branch, crank_phase=side * start) for off, start in slow if off < 1e-6]
        begun = [replace(one, output_angle=-float(one.rocker_angle([0.0])[0])) for one in begun]
        return min(begun, key=lambda one: Solution.from_linkage(self.task, one).error)


def _read_bounds(bounds: Any, names: Sequence[str], links: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the least and greatest length of each dimension in ``names`` (m): as given, or zero and infinity.

    ``links`` are the names of those that cannot be zero.
    """
    given = check_bounds(bounds)
    for name in given:
        if name not in names:
            raise ParameterError(name, given[name], f"bound one of {', '.join(names)}: the other dimensions follow")
    free = 0.0, inf
    both = {name: complete_bounds(name, given.get(name, free), free) for name in names}
    for name in links:
        check_greatest_length(name, both[name][1])
    return {name: (max(low, 0.0), high) for name, (low, high) in both.items()}


def _dimension_ranges(task: QuickReturn, bounds: Any, constraints: Sequence[Any]) -> dict[str, tuple[float, float]]:
    """Return the least and greatest length of offset, crank and coupler, by name (m)."""
    cap = min(
        (float(c.length) for c in constraints if isinstance(c, LargestLink)), default=LARGEST * float(task.stroke)
    )
    ends = {
        name: (low, min(cap, high)) for name, (low, high) in _read_bounds(bounds, BOUNDED, SliderCrank.links).items()
    }
    # the coupler is at least half the stroke, as with a time ratio of 1 and no offset
    low, high = ends["coupler_length"]
    turned = task.advance
    most = float(task.stroke) / (2.0 * sin(0.5 * turned)) if turned > 0.0 else inf
    ends["coupler_length"] = max(low, 0.5 * float(task.stroke)), min(high, most)
    if not ends["coupler_length"][0] <= ends["coupler_length"][1]:
        raise InfeasibleError(
            f"the coupler is to be {1e3 * low:g} to {1e3 * high:g} mm: with this stroke and time ratio it is "
            f"{500.0 * float(task.stroke):g} mm at least"
            + (f" and {1e3 * most:g} mm at most" if isfinite(most) else "")
        )
    return ends


def _lengths(l3: float, turned: float, h: float) -> tuple[float, float]:
    """Return offset and crank length (m) for a coupler length l3, a crank advance ``turned`` (rad) and a stroke or chord h."""
    l2 = sqrt(max(0.5 * h * h - l3 * l3 * (1.0 - cos(turned)), 0.0) / (1.0 + cos(turned)))
    return max(l3 * l3 - l2 * l2, 0.0) * sin(turned) / h, l2


def _transmission_cosine(l3: float, task: QuickReturn, ends: Mapping[str, tuple[float, float]]) -> float:
    """Return the cosine of the least transmission angle over a turn; 1 if no linkage exists or a bound is violated."""
    l1, l2 = _lengths(l3, task.advance, float(task.stroke))
    for name, value in (("ground_length", l1), ("crank_length", l2)):
        low, high = ends[name]
        if not low * (1.0 - 1e-12) <= value <= high * (1.0 + 1e-12) or l2 == 0.0:
            return 1.0
    return min(1.0, (l1 + l2) / l3)


def _make_slider_crank(task: QuickReturn, l3: float, branch: int) -> SliderCrank:
    """Build the slider-crank, its guide below the shaft: with a counter-clockwise crank the stroke to the right is slow."""
    l1, l2 = _lengths(l3, task.advance, float(task.stroke))
    far, near = (sqrt(max((l3 + side * l2) ** 2 - l1 * l1, 0.0)) for side in (1.0, -1.0))
    # crank angle with the slider at 0: crank and coupler folded, or stretched on the other side of the shaft
    phase = pi + acos(l1 / (l3 - l2)) if branch > 0 else -acos(l1 / (l3 + l2))
    return SliderCrank(
        pivot_x=-near if branch > 0 else far,
        pivot_y=l1,
        ground_length=l1,
        crank_length=l2,
        coupler_length=l3,
        point_distance=l3,
        ground_angle=-0.5 * pi,
        crank_phase=phase,
        branch=branch,
    )
