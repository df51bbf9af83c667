"""Conditions on the changes: functions that must not be negative, each at one place of the response."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import LinkworkError

from ..periodic import Crossing, Gradient, Turn, extremum_gradient
from .places import (
    Across,
    FloatArray,
    Found,
    LostError,
    Place,
    Spot,
    centre_of,
    margin_of,
    margin_slopes,
    sampled,
    spot_of,
)
from .wish import AMPLITUDE, Limit, Wish

#: Step in which the level is sought at which an output is greatest, relative to the range's size, and steps at most.
_STEP, _CLIMB = 1e-3, 12
#: Samples that the crank angle of a greatest value may be away from where it was.
_UPHILL = 256


class Condition(Protocol):
    """A function of the changes that must not be negative."""

    #: Violation that counts as none.
    slack: float

    @property
    def group(self) -> str:
        """The requirement that it belongs to."""

    def value(self, x: FloatArray) -> float:
        """The function; raises LostError if the place is not found."""

    def slopes(self, x: FloatArray) -> FloatArray:
        """Its derivatives by the changes, shape (k,)."""


class Inside:
    """No multiplier has crossed a circle in a way at a place: `margin_of` is not negative."""

    slack = 1e-9

    def __init__(self, group: str, place: Place, kind: Crossing, radius: float) -> None:
        self.group, self.place, self.kind, self.radius = group, place, kind, radius

    def value(self, x: FloatArray) -> float:
        return margin_of(self.place.at(x).orbit.monodromy, self.kind, self.radius)

    def slopes(self, x: FloatArray) -> FloatArray:
        found = self.place.at(x)
        return found.along(margin_slopes(found.expansion, self.kind, self.radius))


class Beyond:
    """A point where stability is lost is above a level (side +1) or below it (-1)."""

    slack = 1e-9

    def __init__(self, group: str, place: Place, level: float, side: int) -> None:
        self.group, self.place, self.level, self._share = group, place, level, side / place.wish.size

    def value(self, x: FloatArray) -> float:
        return self._share * (self.place.at(x).spot.level - self.level)

    def slopes(self, x: FloatArray) -> FloatArray:
        slopes: FloatArray = self._share * self.place.at(x).slopes[-1]
        return slopes


class Gone:
    """A closed branch has shrunk to a point, and vanished."""

    slack = 1e-9

    def __init__(self, group: str, wish: Wish, folds: Sequence[Spot]) -> None:
        self.group, self.centre = group, centre_of(wish, folds)
        #: Changes at which the centre is known.
        self.begin, self._there = self.centre.found.x, folds[0].x
        self._sign = -np.sign(self.centre.miss(self.centre.found))

    def value(self, x: FloatArray) -> float:
        try:
            spot = self.centre.at(x).spot
        except LinkworkError:
            if np.array_equal(x, self._there):
                return -1.0  # where the branch is, and too large to have a centre
            raise
        # to be gone for certain it has to be a little beyond the point
        return float(self._sign * self.centre.miss(spot)) - 2.0 * self.slack

    def slopes(self, x: FloatArray) -> FloatArray:
        slopes: FloatArray = self._sign * self.centre.miss_slopes(self.centre.at(x))
        return slopes


class PeakBeyond:
    """A resonance, a maximum of the amplitude over the level, is above a level (side +1) or below it (-1)."""

    slack = 1e-8

    def __init__(self, group: str, wish: Wish, spot: Spot, level: float, side: int) -> None:
        self.group, self.level, self._share = group, level, side / wish.size
        self._wish, self._last = wish, spot

    def _at(self, x: FloatArray) -> Gradient:
        place, spot = peak(self._wish, x, self._last)
        self._last = spot
        return place

    def value(self, x: FloatArray) -> float:
        return self._share * (self._at(x).value - self.level)

    def slopes(self, x: FloatArray) -> FloatArray:
        return self._share * self._at(x).by * self._wish.tolerance


def peak(wish: Wish, x: FloatArray, near: Spot) -> tuple[Gradient, Spot]:
    """The level of a resonance, with its derivatives by the parameters that may be changed, and the motion there.

    Raises LinkworkError if there is none near.
    """
    orbit = Place(wish, Across.at_level(wish, near, near.level), near).at(x).orbit
    found = extremum_gradient(orbit, wish.over, wish.names)
    return found.place, spot_of(wish, x, found.orbit)


class Below:
    """An output is below its limit where it is greatest: at a level of the range and crank angles that go with the changes."""

    slack = 1e-7

    def __init__(self, group: str, wish: Wish, spot: Spot, limit: Limit, angles: Sequence[float]) -> None:
        self.group, self.limit, self.angles = group, limit, tuple(angles)
        self._wish, self._last = wish, spot
        self._known: tuple[bytes, Found, Turn] | None = None

    def _at(self, x: FloatArray) -> tuple[Found, Turn]:
        """The motion there, found by parabolas through the output at three levels."""
        if self._known is not None and self._known[0] == x.tobytes():
            return self._known[1:]
        found, value = self._reading(x, self._last.level)
        # the top of a parabola is off by the square of its width
        for step in (_STEP, 0.1 * _STEP):
            found, value = self._uphill(x, found, value, step * self._wish.size)
        turn = sampled(found.orbit)
        self._last, self.angles = found.spot, climbed(turn, self.limit, self.angles)
        self._known = x.tobytes(), found, turn
        return found, turn

    def _uphill(self, x: FloatArray, found: Found, value: float, step: float) -> tuple[Found, float]:
        """The motion from which no parabola leads to a greater output."""
        for _ in range(_CLIMB):
            level = found.spot.level
            try:
                before, after = (self._reading(x, level + way * step)[1] for way in (-1, 1))
                bend = before - 2.0 * value + after
                move = np.sign(after - before) if bend >= 0.0 else np.clip(0.5 * (before - after) / bend, -10.0, 10.0)
                moved = float(np.clip(level + move * step, *self._wish.span))
                if abs(moved - level) < 1e-3 * step:
                    break
                there, higher = self._reading(x, moved)
            except LostError:
                break  # next to a fold
            if higher < value:
                break
            found, value = there, higher
        return found, value

    def _reading(self, x: FloatArray, level: float) -> tuple[Found, float]:
        found = Place(self._wish, Across.at_level(self._wish, self._last, level), self._last).at(x)
        turn = sampled(found.orbit)
        return found, reading(turn, self.limit, climbed(turn, self.limit, self.angles))

    def value(self, x: FloatArray) -> float:
        return 1.0 - reading(self._at(x)[1], self.limit, self.angles) / float(self.limit.below)

    def slopes(self, x: FloatArray) -> FloatArray:
        (found, turn), names = self._at(x), self._wish.mechanism.output_names
        total, parts = np.zeros(len(x)), parts_of(turn, self.limit)
        for angle, sign in zip(self.angles, (1.0, -1.0)):
            values = [float(series(turn, turn[part])(angle)) for part in parts]
            slopes = [found.output_slopes(names.index(part), angle) for part in parts]
            if len(self.angles) > 1:
                total += 0.5 * sign * slopes[0]
            else:
                # of the magnitude
                total += np.array(values) @ np.array(slopes) / np.linalg.norm(values)
        return np.asarray(-total / self.limit.below)


# Outputs over a turn


def series(turn: Turn, samples: NDArray[np.float64]) -> Callable[[Any], Any]:
    """What was sampled over a turn, as its Fourier series at any crank angle."""
    n = len(samples)
    c = np.fft.rfft(samples) / n
    c[1:] *= 2.0
    if n % 2 == 0:
        c[-1] *= 0.5
    k, way = np.arange(len(c)), n * (turn.angle[1] - turn.angle[0])
    return lambda angle: (c * np.exp(2j * np.pi / way * np.multiply.outer(angle, k))).real.sum(axis=-1)


def parts_of(turn: Turn, limit: Limit) -> list[str]:
    """The outputs that a limit is about: of a joint the components of its force."""
    name = limit.output.removeprefix(AMPLITUDE)
    return [name] if name in turn.names else [p for axis in "xyz" if (p := f"{name}.f{axis}") in turn.names]


def curve(turn: Turn, limit: Limit) -> Callable[[Any], Any]:
    """What a limit is about at any crank angle: of a joint the magnitude of the force."""
    # of its components, which are smooth where the magnitude is not
    parts = [series(turn, turn[part]) for part in parts_of(turn, limit)]
    return lambda angle: reduce(np.hypot, (part(angle) for part in parts))


def reading(turn: Turn, limit: Limit, angles: Sequence[float]) -> float:
    """What a limit bounds, from the values at its crank angles: see `greatest`."""
    values = curve(turn, limit)(np.array(angles))
    return float(abs(values[0])) if len(angles) == 1 else 0.5 * float(values[0] - values[1])


def greatest(turn: Turn, limit: Limit) -> tuple[float, tuple[float, ...]]:
    """What a limit bounds over a turn, and the crank angles of it: one, or those of the greatest and the least value."""
    samples = reduce(np.hypot, (turn[part] for part in parts_of(turn, limit)))
    places = [np.abs(samples).argmax()]
    if limit.output.startswith(AMPLITUDE):
        places = [samples.argmax(), samples.argmin()]
    angles = climbed(turn, limit, [float(turn.angle[place]) for place in places])
    return reading(turn, limit, angles), angles


def climbed(turn: Turn, limit: Limit, angles: Sequence[float]) -> tuple[float, ...]:
    """The crank angles about these at which what a limit bounds is greatest."""
    value, step = curve(turn, limit), float(turn.angle[1] - turn.angle[0])
    signs = (1.0, -1.0) if len(angles) > 1 else (float(np.sign(value(angles[0])) or 1.0),)
    return tuple(_climb(value, angle, step, sign) for angle, sign in zip(angles, signs))


def _climb(value: Callable[[Any], Any], angle: float, step: float, sign: float) -> float:
    """Where a function of the crank angle is greatest (sign +1) or least about an angle."""
    for _ in range(_UPHILL):
        a, b, c = sign * value(angle + step * np.array([-1.0, 0.0, 1.0]))
        if b >= max(a, c):
            break
        angle += step if c > a else -step
    for _ in range(4):
        # the top of the parabola through three values
        a, b, c = value(angle + step * np.array([-1.0, 0.0, 1.0]))
        bend = a - 2.0 * b + c
        if bend == 0.0:
            break
        angle += float(np.clip(0.5 * (a - c) / bend, -1.0, 1.0)) * step
        step *= 0.1
    return angle
