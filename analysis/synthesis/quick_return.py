"""Slider-cranks of a given stroke and time ratio, in closed form: the one with the best transmission angle.

In the dead centres C is l3 + l2 and l3 - l2 away from A, the two directions advance = pi (Q - 1)/(Q + 1) apart, so that by the
laws of cosines and sines

    l2^2 (1 + cos advance) = H^2/2 - l3^2 (1 - cos advance),    l1 H = (l3^2 - l2^2) sin advance

with the stroke H, the time ratio Q and the offset l1. That leaves l3, for which (l1 + l2)/l3, the cosine of the least
transmission angle, is made small. See R. L. Norton, Design of Machinery, 6th ed., 2020, chapters 3 and 4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import acos, cos, degrees, inf, isfinite, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from linkwork.errors import InputError, ParameterError

from ..units import Amount, in_si
from .constraints import LARGEST, Assembly, FullTurn, InfeasibleError, LargestLink, LeastTransmission
from .linkage import Linkage
from .solution import Solution, ranked
from .tasks import SliderFunction

FloatArray = NDArray[np.float64]

#: Couplers that are looked at before the best is found exactly.
COUPLERS = 2001
#: Dimensions that bounds may be of.
BOUNDED = ("ground_length", "crank_length", "coupler_length")


@in_si(stroke="m")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class QuickReturn(SliderFunction):
    """The slider goes a stroke along the x axis in the slow part of a turn, and back in the quick one.

    Attributes
    ----------
    stroke : float
        m.
    time_ratio : float
        Time of the way out over that of the way back, the crank turning evenly: 1 at least.
    position, rotation : ndarray, shape (3,)
        Made of them: 0, the stroke, and 0 again.
    """

    stroke: Amount
    time_ratio: float = 1.0
    position: ArrayLike = field(init=False)
    rotation: ArrayLike | None = field(init=False)
    weights: ArrayLike | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        for name, value, least in (("stroke", float(self.stroke), 0.0), ("time ratio", self.time_ratio, 1.0)):
            if not isfinite(value) or value < least or value == 0.0:
                raise ParameterError(
                    name, value, "be a finite number " + ("of 1 or more" if least else "above zero (m)")
                )
        slow = pi + self.advance
        object.__setattr__(self, "position", np.array([0.0, float(self.stroke), 0.0]))
        object.__setattr__(self, "rotation", np.array([0.0, slow, 2.0 * pi]))
        SliderFunction.__post_init__(self)

    @property
    def advance(self) -> float:
        """By how much the slow part of a turn is more than half of one (rad)."""
        return pi * (self.time_ratio - 1.0) / (self.time_ratio + 1.0)


def quick_returns(
    task: QuickReturn, bounds: Mapping[str, tuple[float, float]] | None, constraints: Sequence[Any]
) -> tuple[Solution, ...]:
    """The slider-crank with the greatest least transmission angle, the slider to either side of the shaft.

    Raises
    ------
    InputError
        If a bound or a constraint is none that this can keep.
    InfeasibleError
        If there is none; it says what transmission angle can be had.
    """
    for c in constraints:
        if not isinstance(c, LeastTransmission | FullTurn | LargestLink | Assembly):
            raise InputError(f"a QuickReturn cannot keep {type(c).__name__}: leave it out, or ask for a SliderFunction")
    ends = _ends(task, bounds, constraints)
    asked = f"a stroke of {1e3 * float(task.stroke):g} mm and a time ratio of {task.time_ratio:g}"
    couplers = np.linspace(*ends["coupler_length"], COUPLERS)
    cosines = np.array([_cosine(float(l3), task, ends) for l3 in couplers])
    best = int(np.argmin(cosines))
    if not cosines[best] < 1.0:
        raise InfeasibleError(f"no slider-crank with {asked} has a crank that turns fully within these bounds")
    low, high = couplers[max(best - 1, 0)], couplers[min(best + 1, COUPLERS - 1)]
    found = minimize_scalar(
        _cosine, bounds=(low, high), args=(task, ends), method="bounded", options={"xatol": 1e-12 * high}
    )
    l3 = float(min((couplers[best], float(found.x)), key=lambda x: _cosine(x, task, ends)))
    angle = acos(_cosine(l3, task, ends))
    least = max((float(c.angle) for c in constraints if isinstance(c, LeastTransmission)), default=0.0)
    if angle < least:
        raise InfeasibleError(
            f"a transmission angle of {degrees(least):g} deg is asked for: with {asked} the best slider-crank has "
            f"{degrees(angle):.4g} deg"
        )
    branches = {c.branch for c in constraints if isinstance(c, Assembly)}
    if len(branches) > 1:
        raise InfeasibleError("both assemblies are asked for at once")
    return ranked([Solution.of(task, _linkage(task, l3, branch)) for branch in branches or (1, -1)])


def _ends(task: QuickReturn, bounds: Any, constraints: Sequence[Any]) -> dict[str, tuple[float, float]]:
    """Least and greatest offset, crank and coupler (m)."""
    cap = min(
        (float(c.length) for c in constraints if isinstance(c, LargestLink)), default=LARGEST * float(task.stroke)
    )
    ends = dict.fromkeys(BOUNDED, (0.0, cap))
    for name, (low, high) in dict(bounds or {}).items():
        if name not in BOUNDED:
            raise ParameterError(name, (low, high), f"be one of {', '.join(BOUNDED)}: the others follow")
        ends[name] = max(low or 0.0, 0.0), min(cap, inf if high is None else high)
    # the crank has a length, and l3 is at least that of an even stroke
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


def _lengths(l3: float, task: QuickReturn) -> tuple[float, float]:
    """Offset and crank for a coupler (m)."""
    turned, h = task.advance, float(task.stroke)
    l2 = sqrt(max(0.5 * h * h - l3 * l3 * (1.0 - cos(turned)), 0.0) / (1.0 + cos(turned)))
    return max(l3 * l3 - l2 * l2, 0.0) * sin(turned) / h, l2


def _cosine(l3: float, task: QuickReturn, ends: Mapping[str, tuple[float, float]]) -> float:
    """Cosine of the least transmission angle over a turn; 1 where that is none, or a bound is not kept."""
    l1, l2 = _lengths(l3, task)
    for name, value in (("ground_length", l1), ("crank_length", l2)):
        low, high = ends[name]
        if not low * (1.0 - 1e-12) <= value <= high * (1.0 + 1e-12) or l2 == 0.0:
            return 1.0
    return min(1.0, (l1 + l2) / l3)


def _linkage(task: QuickReturn, l3: float, branch: int) -> Linkage:
    """The slider-crank, its guide below the shaft: a crank that turns to the left goes slowly to the right."""
    l1, l2 = _lengths(l3, task)
    far, near = (sqrt(max((l3 + side * l2) ** 2 - l1 * l1, 0.0)) for side in (1.0, -1.0))
    # crank angle where the slider is at 0: folded, or on the other side of the shaft in line
    phase = pi + acos(l1 / (l3 - l2)) if branch > 0 else -acos(l1 / (l3 + l2))
    return Linkage(
        pivot_x=-near if branch > 0 else far,
        pivot_y=l1,
        ground_length=l1,
        crank_length=l2,
        coupler_length=l3,
        rocker_length=0.0,
        point_distance=l3,
        ground_angle=-0.5 * pi,
        crank_phase=phase,
        branch=branch,
    )
