"""Special configurations of a mechanism along a law of the shift: dead centres, singularities, limits of assembly.

Laws that repeat after whole turns are searched by bounds (`mobility`), which miss nothing; any other law by changes of sign.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, tau

import numpy as np
from scipy.optimize import brentq

from linkwork.limits import LIMIT_SINE
from linkwork.slider_crank.parameters import SliderCrankParameters

from . import mobility
from .mobility import DeadCentre
from .quantities import FloatArray
from .shifts import ShiftLaw, ShiftMotion, on_arrays

#: Pieces of a turn in which signs are compared under a law that need not repeat; two zeros in one piece go unseen.
_PIECES = 1440


@dataclass(frozen=True, slots=True)
class Course:
    """A mechanism whose shift follows a law over the crank angle.

    ``speed`` is that of the crank (rad/s). The slope of the shift by the angle depends on it only under a law by time.
    """

    parameters: SliderCrankParameters
    law: ShiftLaw
    speed: float

    def dead_centres(self, low: float, high: float) -> tuple[DeadCentre, ...]:
        """Configurations from ``low`` to ``high`` (rad) in which the slider turns back."""
        return self._zeros(low, high, held=False)

    def singularities(self, low: float, high: float) -> tuple[DeadCentre, ...]:
        """Configurations from ``low`` to ``high`` (rad) in which the slider would turn back if the shift were held."""
        return self._zeros(low, high, held=True)

    def limits(self, low: float, high: float) -> tuple[float, ...]:
        """Ends of the ranges of assembly from ``low`` to ``high`` (rad)."""
        repeating = self.law.repeating(self.parameters)
        if repeating is None:
            at = _places(low, high)
            reached = self._square(at) > 0.0
            changes = np.flatnonzero(reached[1:] != reached[:-1])
            return tuple(
                float(brentq(lambda x: float(self._square(np.array([x]))[0]), at[i], at[i + 1], xtol=1e-14))
                for i in changes
            )
        parts = mobility.ranges(self.parameters, repeating)
        ends = {end for part in parts if not part.full(repeating.span) for end in (part.low, part.high)}
        moved = (end + more for more in _turns(low, high, repeating.span) for end in ends)
        return tuple(sorted(end for end in moved if low <= end <= high))

    def _zeros(self, low: float, high: float, *, held: bool) -> tuple[DeadCentre, ...]:
        """Zeros of the slider's velocity along the law, or with the shift held."""
        repeating = self.law.repeating(self.parameters)
        if repeating is None:
            return self._sign_changes(low, high, 0.0 if held else 1.0)
        find = mobility.singularities if held else mobility.dead_centres
        found = find(self.parameters, repeating)
        moved = (
            c._replace(crank_angle=c.crank_angle + more) for more in _turns(low, high, repeating.span) for c in found
        )
        return tuple(centre for centre in moved if low <= centre.crank_angle <= high)

    def _sign_changes(self, low: float, high: float, pitch: float) -> tuple[DeadCentre, ...]:
        """Zeros of kth + ``pitch`` S1' ks, at `_PIECES` places in the turn and more closely where the sign changes."""
        f, p = on_arrays(), self.parameters.constants()

        def slope(angle: FloatArray) -> FloatArray:
            moving = self._shift(angle)
            k = f.coefficients(f.position(angle, moving.shift, p), p)
            return np.asarray(k.kth + pitch * moving.velocity / (self.speed or 1.0) * k.ks)

        at = _places(low, high)
        reached = self._square(at) > (LIMIT_SINE * p.a2) ** 2
        values = np.zeros(at.shape)
        values[reached] = slope(at[reached])
        positive = values > 0.0
        found = []
        for i in np.flatnonzero((positive[1:] != positive[:-1]) & reached[1:] & reached[:-1]):
            angle = brentq(lambda x: float(slope(np.array([x]))[0]), at[i], at[i + 1], xtol=1e-14)
            moving = self._shift(np.array([angle]))
            q = f.position(np.array([angle]), moving.shift, p)
            outer = bool(positive[i]) == (p.branch > 0.0)
            found.append(DeadCentre(float(angle), float(moving.shift[0]), float(q.s4[0]), outer))
        return tuple(found)

    def _shift(self, angle: FloatArray) -> ShiftMotion:
        return self.law.at(angle, np.full(angle.shape, self.speed or 1.0), np.zeros(angle.shape))

    def _square(self, angle: FloatArray) -> FloatArray:
        """What is positive where the rod reaches the guide (m2)."""
        return np.asarray(on_arrays().assembly_square(angle, self._shift(angle).shift, self.parameters.constants()))


def _turns(low: float, high: float, span: float) -> list[float]:
    """What angles in [0, 2 span] are moved by to have all of them from ``low`` to ``high``."""
    return [span * n for n in range(ceil(low / span) - 2, ceil(high / span) + 1)]


def _places(low: float, high: float) -> FloatArray:
    """Angles between which signs are compared."""
    return np.linspace(low, high, ceil((high - low) / tau * _PIECES) + 1)
