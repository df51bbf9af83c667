"""Define conditions on the changes of parameters: functions of a motion of the response that must not be negative.

The level is the value of the speed, or of the other quantity whose range is tuned. A motion is given by y at crank angle 0 and
by the level. One further equation picks the motion from its branch: the equation of a plane across the branch, or of a loss of
stability. When the parameters change, the motion is found again from its last position, so that it stays on its branch.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import LinkworkError

from .. import periodic
from ..periodic import Crossing, Family, Gradient, OrbitEquations, PeriodicOrbit, Turn, singular_matrix
from .wishes import AMPLITUDE, Limit, Wish

#: Search for the level at which an output is greatest: step relative to the range's size, and greatest number of steps.
_STEP, _CLIMB = 1e-3, 12
#: Greatest number of samples by which the crank angle of a maximum may move in a search.
_UPHILL = 256
FloatArray = NDArray[np.float64]

#: Newton's method: greatest number of iterations, and correction, relative to the scale, at which a motion counts as found.
ITERATIONS, FOUND = 12, 1e-9
#: Greatest change of a parameter in one step, relative to the larger of its value and its tolerance; greatest correction in a
#: step, relative to the scale.
STRIDE, REACH = 0.05, 0.3
#: Halvings of a step, over all steps, after which a motion counts as lost.
_HALVINGS = 3


class LostError(LinkworkError):
    """A motion was not found again after the parameters changed."""


class Expansion(NamedTuple):
    """Derivatives of a motion with respect to the m = n + 1 + k numbers: y at crank angle 0, the level, and the changes."""

    variations: periodic.Variations  # the variational equations, which have the monodromy matrix
    gaps: FloatArray  # derivatives of y(T) - y(0), shape (n, m)
    monodromies: FloatArray  # derivatives of the monodromy matrix, (n, n, m)
    ways: FloatArray  # derivatives of y at the nodes of the period's panels, (panels, nodes, n, m)
    constants: FloatArray  # derivatives of the drive vector and the constants of the equations, (c, m)


def family(wish: Wish, x: FloatArray, spot: Spot | None = None) -> Family:
    """Return the family of periodic motions over the level, with changes x of the parameters in units of the tolerances.

    If ``spot`` is given, links make as many full turns per period as in the motion at the spot.
    """
    parameters, drive = wish.operation(x, wish.span[0])
    found = Family(parameters=parameters, drive=drive, vary=wish.over)
    return found if spot is None else found.with_ratios(spot.ratios)


class Spot(NamedTuple):
    """A motion of the response, given by the changes of the parameters, y at crank angle 0 and the level."""

    x: FloatArray  # the changes in units of the tolerances, shape (k,)
    y: FloatArray  # y at crank angle 0, shape (n,)
    level: float
    turns: int  # number of common periods in the period
    ratios: Mapping[str, Any]  # ratios of the drive
    coordinate: int = 0  # at a resonance: index of the free coordinate whose amplitude is greatest


def known_spot(wish: Wish, x: FloatArray, orbit: PeriodicOrbit, coordinate: int = 0) -> Spot:
    """Return the `Spot` of a motion that was found with the changes x of the parameters."""
    return Spot(x, orbit.start, wish.level(orbit), orbit.turns, orbit.drive.ratios, coordinate)


def motion(wish: Wish, spot: Spot) -> PeriodicOrbit:
    """Return the orbit that begins at a spot; the orbit's ``residual`` tells how nearly the orbit is closed."""
    return OrbitEquations(family(wish, spot.x, spot), spot.turns, *wish.span)(spot.y, spot.level).data


def expansion(wish: Wish, spot: Spot) -> Expansion:
    """Compute the `Expansion` of the motion at a spot from the first and second variational equations.

    The motion need not be periodic.
    """
    along = periodic.motion_gradient(motion(wish, spot), (wish.over, *wish.names))
    v, n = along.variations, len(spot.y)
    unit = np.append(1.0, wish.tolerance)
    forcing, constants = v.forcing * unit, along.along * unit
    gaps = np.column_stack([v.monodromy - np.eye(n), v.final_deviation(forcing)])
    ways = np.concatenate([v.fundamental, v.solve_from_start(np.zeros((n, len(unit))), forcing)], axis=-1)
    constants = np.column_stack([np.zeros((len(constants), n)), constants])
    return Expansion(v, gaps, v.monodromy_derivatives(ways, constants), ways, constants)


def crossing_margin(monodromy: FloatArray, kind: Crossing, radius: float = 1.0) -> float:
    """Return a determinant that is zero when multipliers cross the circle of ``radius``, and positive if all are inside it."""
    return float(np.linalg.det(singular_matrix(monodromy / radius, kind)[0]))


def margin_slopes(found: Expansion, kind: Crossing, radius: float = 1.0) -> FloatArray:
    """Return the derivatives of `crossing_margin` with respect to y, the level and the changes, shape (n + 1 + k,)."""
    matrix, by = singular_matrix(found.variations.monodromy / radius, kind, found.monodromies / radius)
    return periodic.determinant_derivatives(matrix, by)


# Equations that pick a motion from its branch: ``value`` is the residual, ``slopes`` its derivatives with respect to y, the
# level and the changes, shape (n + 1 + k,)


@dataclass(frozen=True, slots=True, eq=False)
class CrossPlane:
    """A plane across the branch, normal . (y, level) = offset; it fixes the level if only the normal's last entry is not 0."""

    normal: FloatArray
    offset: float

    def value(self, y: FloatArray, level: float, monodromy: FloatArray) -> float:
        return float(self.normal[:-1] @ y + self.normal[-1] * level - self.offset)

    def slopes(self, found: Expansion) -> FloatArray:
        return np.append(self.normal, np.zeros(found.gaps.shape[1] - len(self.normal)))


@dataclass(frozen=True, slots=True)
class StabilityLoss:
    """The equation of a loss of stability: a Floquet multiplier is on the unit circle."""

    kind: Crossing

    def value(self, y: FloatArray, level: float, monodromy: FloatArray) -> float:
        return crossing_margin(monodromy, self.kind)

    def slopes(self, found: Expansion) -> FloatArray:
        return margin_slopes(found, self.kind)


Row = CrossPlane | StabilityLoss


class PickedMotion:
    """The motion that an equation picks from its branch for given changes of the parameters, with its derivatives."""

    def __init__(self, wish: Wish, row: Row, spot: Spot) -> None:
        self.spot = spot
        self._wish, self._row = wish, row

    @cached_property
    def expansion(self) -> Expansion:
        """Derivatives of y(T) - y(0) and of the monodromy matrix at the motion."""
        return expansion(self._wish, self.spot)

    @cached_property
    def orbit(self) -> PeriodicOrbit:
        """The periodic motion."""
        return motion(self._wish, self.spot)

    @cached_property
    def slopes(self) -> FloatArray:
        """Derivatives of y and the level with respect to the changes, shape (n + 1, k)."""
        gaps, n = self.expansion.gaps, len(self.spot.y) + 1
        rows = np.vstack([gaps, self._row.slopes(self.expansion)])
        return -np.linalg.solve(rows[:, :n], rows[:, n:])

    def total_derivatives(self, slopes: FloatArray) -> FloatArray:
        """Convert partial derivatives, (..., n + 1 + k), to total derivatives with respect to the changes, (..., k).

        The partial derivatives are with respect to y, the level and the changes.
        """
        n = len(self.spot.y) + 1
        return slopes[..., n:] + slopes[..., :n] @ self.slopes

    def output_slopes(self, number: int, angle: float) -> FloatArray:
        """Return the derivatives of output ``number`` at a crank angle with respect to the changes, shape (k,)."""
        found = self.expansion
        v = found.variations
        angle = float(angle % (self.spot.turns * v.flow.period))
        panel = int(np.searchsorted(np.cumsum(v.h), angle).clip(0, len(v.h) - 1))
        by_y, by_constant = v.output_derivatives(panel, number)
        nodes = self.total_derivatives(np.einsum("sn,snm->sm", by_y, found.ways[panel]) + by_constant @ found.constants)
        # the polynomial through the panel's nodes, by Lagrange
        away = v.angles[panel] - v.angles[panel][:, None]
        np.fill_diagonal(away, 1.0)
        ahead = np.tile(v.angles[panel] - angle, (len(away), 1))
        np.fill_diagonal(ahead, 1.0)
        weights: FloatArray = np.prod(ahead / away, axis=1)
        return weights @ nodes


class TrackedMotion:
    """A motion on a branch, picked by the further equation ``row``, that is found again after the parameters have changed.

    The search begins at ``spot``, the motion that was found last.
    """

    def __init__(self, wish: Wish, row: Row, spot: Spot) -> None:
        self.wish, self.row = wish, row
        self._last = spot
        self._scale = np.append(periodic.motion_scales(*wish.operation(spot.x, spot.level), spot.y), wish.size)

    @classmethod
    def at_level(cls, wish: Wish, spot: Spot, level: float) -> TrackedMotion:
        """Return the motion at a level on the branch of a spot."""
        normal = np.append(np.zeros(len(spot.y)), 1.0 / wish.size)
        return cls(wish, CrossPlane(normal, level / wish.size), spot)

    def find(self, x: FloatArray) -> PickedMotion:
        """Find the motion for changes x in units of the tolerances; raise LostError if the motion is not found again."""
        last = self._last
        moved = np.abs(x - last.x) * self.wish.tolerance
        size = np.maximum(np.abs(self.wish.present), self.wish.tolerance)
        steps = max(1, int(np.ceil(float((moved / size).max()) / STRIDE)))
        done, step, way, halvings = 0.0, 1.0 / steps, x - last.x, 0
        spot, slope = last, None
        while done < 1.0:
            share = min(done + step, 1.0)
            target = x if share == 1.0 else last.x + share * way
            try:
                there = self._newton(target, spot, slope, share - done)
            except LinkworkError as error:
                step, halvings = 0.5 * step, halvings + 1
                if halvings > _HALVINGS:
                    raise LostError(f"a motion near {self.wish.say(spot.level)} is not found again: {error}") from error
                continue
            slope = np.append(there.y - spot.y, there.level - spot.level) / (share - done)
            spot, done = there, share
        self._last = spot
        return PickedMotion(self.wish, self.row, spot)

    def _newton(self, x: FloatArray, begin: Spot, slope: FloatArray | None, ahead: float) -> Spot:
        z = np.append(begin.y, begin.level)
        first = z = z if slope is None else z + ahead * slope
        n = len(begin.y)
        evaluate = OrbitEquations(family(self.wish, x, begin), begin.turns, *self.wish.span)
        size = np.inf
        for count in range(ITERATIONS):
            here = evaluate(z[:n], float(z[n]))
            top = np.column_stack([here.jacobian, here.slope])
            if isinstance(self.row, CrossPlane):
                below = self.row.normal
            else:
                there = expansion(self.wish, begin._replace(x=x, y=z[:n], level=float(z[n])))
                below = self.row.slopes(there)[: n + 1]
            value = self.row.value(z[:n], float(z[n]), here.jacobian + np.eye(n))
            try:
                step = np.linalg.solve(np.vstack([top, below]), np.append(here.residual, value))
            except np.linalg.LinAlgError:
                raise LostError("its equations are singular there") from None
            z, before, size = z - step, size, float(np.abs(step / self._scale).max())
            # the second correction may still be greater than the first
            if not np.abs((z - first) / self._scale).max() < REACH or (count > 2 and size > 0.5 * before > FOUND):
                break
            if size < FOUND:
                return begin._replace(x=x, y=z[:n], level=float(z[n]))
        raise LostError(f"Newton's method does not settle: last correction {size:.1e}")


# Outputs over a turn


def series(turn: Turn, samples: NDArray[np.float64]) -> Callable[[Any], Any]:
    """Return the Fourier series through samples over a period, as a function of the crank angle."""
    n = len(samples)
    c = np.fft.rfft(samples) / n
    c[1:] *= 2.0
    if n % 2 == 0:
        c[-1] *= 0.5
    k, way = np.arange(len(c)), n * (turn.angle[1] - turn.angle[0])
    return lambda angle: (c * np.exp(2j * np.pi / way * np.multiply.outer(angle, k))).real.sum(axis=-1)


def curve(turn: Turn, limit: Limit) -> Callable[[Any], Any]:
    """Return the limited quantity, an output or the magnitude of the force in a joint, as a function of the crank angle."""
    # series of the components, which are smooth where the magnitude is not
    parts = [series(turn, turn.oscillation(part)) for part in limit.parts]
    return lambda angle: reduce(np.hypot, (part(angle) for part in parts))


def value_at_angles(turn: Turn, limit: Limit, angles: Sequence[float]) -> float:
    """Return the value that the limit bounds, from the values of the limited quantity at one or two crank angles.

    At one angle the value is the magnitude of the quantity there; at two angles it is half the difference between the quantity
    at the first angle and at the second.
    """
    values = curve(turn, limit)(np.array(angles))
    return float(abs(values[0])) if len(angles) == 1 else 0.5 * float(values[0] - values[1])


def limited_value(turn: Turn, limit: Limit) -> tuple[float, tuple[float, ...]]:
    """Return the value that the limit bounds, over a period, and the crank angles at which it occurs.

    The value is the greatest magnitude of the limited quantity, with one angle; or its amplitude, with the angles of both
    extremes.
    """
    samples = reduce(np.hypot, (turn.oscillation(part) for part in limit.parts))
    places = [np.abs(samples).argmax()]
    if limit.output.startswith(AMPLITUDE):
        places = [samples.argmax(), samples.argmin()]
    angles = peak_angles(turn, limit, [float(turn.angle[place]) for place in places])
    return value_at_angles(turn, limit, angles), angles


def peak_angles(turn: Turn, limit: Limit, angles: Sequence[float]) -> tuple[float, ...]:
    """Refine the crank angles of extreme values of the limited quantity, starting from ``angles``.

    If there is one angle, it becomes the angle of the greatest magnitude; two angles become those of a maximum and a minimum.
    """
    value, step = curve(turn, limit), float(turn.angle[1] - turn.angle[0])
    signs = (1.0, -1.0) if len(angles) > 1 else (float(np.sign(value(angles[0])) or 1.0),)
    return tuple(_climb(value, angle, step, sign) for angle, sign in zip(angles, signs))


def _climb(value: Callable[[Any], Any], angle: float, step: float, sign: float) -> float:
    """Find the crank angle of a maximum (sign +1) or minimum (sign -1) of a function near a given angle."""
    for _ in range(_UPHILL):
        a, b, c = sign * value(angle + step * np.array([-1.0, 0.0, 1.0]))
        if b >= max(a, c):
            break
        angle += step if c > a else -step
    for _ in range(4):
        # go to the top of the parabola through three values
        a, b, c = value(angle + step * np.array([-1.0, 0.0, 1.0]))
        bend = a - 2.0 * b + c
        if bend == 0.0:
            break
        angle += float(np.clip(0.5 * (a - c) / bend, -1.0, 1.0)) * step
        step *= 0.1
    return angle


# Conditions


class Condition(ABC):
    """A function of the changes of parameters that must not be negative."""

    #: Greatest violation that is accepted.
    slack = 1e-9
    #: Name of the requirement to which the condition belongs.
    group: str

    @abstractmethod
    def value(self, x: FloatArray) -> float:
        """Return the value of the condition for changes x of the parameters; raise LostError if the motion is not found."""

    @abstractmethod
    def slopes(self, x: FloatArray) -> FloatArray:
        """Return the derivatives of the value with respect to the k changes of parameters, shape (k,)."""


class MultipliersInside(Condition):
    """Condition that no multiplier has left the circle of ``radius`` by a crossing of ``kind``: `crossing_margin` >= 0."""

    def __init__(self, group: str, place: TrackedMotion, kind: Crossing, radius: float) -> None:
        self.group, self.place, self.kind, self.radius = group, place, kind, radius

    def value(self, x: FloatArray) -> float:
        return crossing_margin(self.place.find(x).orbit.monodromy, self.kind, self.radius)

    def slopes(self, x: FloatArray) -> FloatArray:
        found = self.place.find(x)
        return found.total_derivatives(margin_slopes(found.expansion, self.kind, self.radius))


class StabilityLossBeyond(Condition):
    """Condition that the point at which stability is lost lies above a level (side +1) or below this level (side -1)."""

    def __init__(self, group: str, place: TrackedMotion, level: float, side: int) -> None:
        self.group, self.place, self.level, self._share = group, place, level, side / place.wish.size

    def value(self, x: FloatArray) -> float:
        return self._share * (self.place.find(x).spot.level - self.level)

    def slopes(self, x: FloatArray) -> FloatArray:
        return self._share * self.place.find(x).slopes[-1]


class PeakBeyond(Condition):
    """Condition that a resonance, a maximum of the amplitude, lies above a level (side +1) or below this level (side -1)."""

    slack = 1e-8

    def __init__(self, group: str, wish: Wish, spot: Spot, level: float, side: int) -> None:
        self.group, self.level, self._share = group, level, side / wish.size
        self._wish, self._last = wish, spot

    def _gradient(self, x: FloatArray) -> Gradient:
        place, spot = find_resonance(self._wish, x, self._last)
        self._last = spot
        return place

    def value(self, x: FloatArray) -> float:
        return self._share * (self._gradient(x).value - self.level)

    def slopes(self, x: FloatArray) -> FloatArray:
        return self._share * self._gradient(x).by * self._wish.tolerance


def find_resonance(wish: Wish, x: FloatArray, near: Spot) -> tuple[Gradient, Spot]:
    """Find a resonance near a motion; return its level with the gradient with respect to the changes, and its spot.

    Raises LinkworkError if there is no resonance near the motion.
    """
    orbit = TrackedMotion.at_level(wish, near, near.level).find(x).orbit
    found = periodic.extremum_gradient(orbit, wish.over, wish.names, near.coordinate)
    return found.place, known_spot(wish, x, found.orbit, near.coordinate)


class OutputBelow(Condition):
    """Condition that the maximum of an output, over the range and the crank angle, is below its limit."""

    slack = 1e-7

    def __init__(self, group: str, wish: Wish, spot: Spot, limit: Limit, angles: Sequence[float]) -> None:
        self.group, self.limit, self.angles = group, limit, tuple(angles)
        self._wish, self._last = wish, spot
        self._known: tuple[bytes, PickedMotion, Turn] | None = None

    def _motion_and_turn(self, x: FloatArray) -> tuple[PickedMotion, Turn]:
        """Return the motion of the range that has the greatest maximum of the output, and this motion's outputs over a period.

        ``x`` are the changes in units of the tolerances. The level of the motion is found by parabolas.
        """
        if self._known is not None and self._known[0] == x.tobytes():
            return self._known[1:]
        found, value = self._reading(x, self._last.level)
        # the error of the top of a parabola is proportional to the square of its width
        for step in (_STEP, 0.1 * _STEP):
            found, value = self._uphill(x, found, value, step * self._wish.size)
        turn = found.orbit.resolved_turn(self.limit.parts)
        self._last, self.angles = found.spot, peak_angles(turn, self.limit, self.angles)
        self._known = x.tobytes(), found, turn
        return found, turn

    def _uphill(self, x: FloatArray, found: PickedMotion, value: float, step: float) -> tuple[PickedMotion, float]:
        """Move the level to a maximum of the output, by parabolas over the level; return the motion there and its output."""
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

    def _reading(self, x: FloatArray, level: float) -> tuple[PickedMotion, float]:
        found = TrackedMotion.at_level(self._wish, self._last, level).find(x)
        turn = found.orbit.resolved_turn(self.limit.parts)
        return found, value_at_angles(turn, self.limit, peak_angles(turn, self.limit, self.angles))

    def value(self, x: FloatArray) -> float:
        return 1.0 - value_at_angles(self._motion_and_turn(x)[1], self.limit, self.angles) / float(self.limit.below)

    def slopes(self, x: FloatArray) -> FloatArray:
        (found, turn), names = self._motion_and_turn(x), self._wish.mechanism.output_names
        total, parts = np.zeros(len(x)), self.limit.parts
        for angle, sign in zip(self.angles, (1.0, -1.0)):
            values = [float(series(turn, turn.oscillation(part))(angle)) for part in parts]
            slopes = [found.output_slopes(names.index(part), angle) for part in parts]
            if len(self.angles) > 1:
                total += 0.5 * sign * slopes[0]
            else:
                # derivative of the magnitude
                total += np.array(values) @ np.array(slopes) / np.linalg.norm(values)
        return np.asarray(-total / self.limit.below)
