"""How far a linkage can move: where its bodies can be joined as one freedom runs through its range."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from linkwork.limits import LIMIT_SINE
from linkwork.mechanism import Mechanism


class Reach(NamedTuple):
    """The range of a freedom about its start in which the bodies can be joined, the other freedoms at their start.

    Attributes
    ----------
    freedom : int
    unit : str
        Of its coordinate, rad or m.
    low, high : float
        Ends of the range (rad, m): dead centres, or the ends of a turn.
    turns : bool
        Whether the freedom can make a whole turn.
    least : float
        Least clearance of any dyad in the range, the sine of its transmission angle.
    """

    freedom: int
    unit: str
    low: float
    high: float
    turns: bool
    least: float


def reach(mechanism: Mechanism, freedom: int = 0, *, most: float | None = None, samples: int = 360) -> Reach:
    """Find the range of a freedom.

    Parameters
    ----------
    mechanism : Mechanism
    freedom : int
    most : float, optional
        The distance from the start that is looked at: by default half its period, or half a turn; of a slide 1 m.
    samples : int
        Places looked at to either side.
    """
    coordinate, period = mechanism.freedoms[freedom].coordinate, mechanism.freedoms[freedom].period
    unit = next(v.unit for v in mechanism.variables if v.name == coordinate)
    if most is None:
        most = 0.5 * period or (pi if unit == "rad" else 1.0)
    known = mechanism.first_set
    p = known.parameters.constants()
    acting, x = mechanism.idle(p), list(mechanism.state(known.initial))
    middle = x[freedom]

    def margin(q: float) -> float:
        """Return the clearance to the limit at a coordinate; less than -1 where the bodies do not reach each other."""
        x[freedom] = q
        try:
            return float(mechanism.equations.clearance(x, acting, p)) - LIMIT_SINE
        except (ArithmeticError, ValueError):
            return -1.0 - LIMIT_SINE

    ends, least = [], margin(middle) + LIMIT_SINE
    for sign in (-1.0, 1.0):
        before = middle
        for q in middle + sign * most * np.arange(1, samples + 1) / samples:
            value = margin(float(q))
            if value < 0.0:
                before = float(brentq(lambda c: max(margin(c), -1.0), before, float(q), xtol=1e-9 * most))
                break
            least, before = min(least, value + LIMIT_SINE), float(q)
        ends.append(before)
    whole = bool(period) and ends[1] - ends[0] > period * (1.0 - 1e-9)
    return Reach(freedom, unit, ends[0], ends[1], whole, least)
