"""Places on the response that go with the parameters: motions at a level or across the branch, and where stability is lost.

A place is a periodic motion, y at crank angle 0 and the level, which is the speed or what else the range is of, that one
further equation picks from the branch. As the parameters change it is found again from where it was, and so keeps to its
branch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import combinations
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import LinkworkError

from ..periodic import Crossing, Family, OrbitEquations, PeriodicOrbit, Turn, Variations, motion_gradient, scale_of
from .wish import Wish

FloatArray = NDArray[np.float64]

#: Newton's method: iterations at most, and the correction relative to the scale at which a place is found.
ITERATIONS, FOUND = 12, 1e-9
#: Change of a parameter, relative to it and to its tolerance, that is made in one step; and the correction that a step may
#: take, relative to the scale.
STRIDE, REACH = 0.05, 0.3
#: Halvings of a step, over all steps, after which a place counts as lost.
_HALVINGS = 3
#: Samples of a turn.
_SAMPLES = 256
#: Times that a closed branch is shrunk at most, and the share of its width each time, to first order.
_SHRINKINGS, _SHRINKAGE = 40, 0.2


class LostError(LinkworkError):
    """A place was not found again."""


class Expansion(NamedTuple):
    """y(T) - y(0) at a place and the monodromy matrix, with their derivatives by y, the level and the k changes.

    Attributes
    ----------
    gaps : ndarray, shape (n, n + 1 + k)
        Derivatives of y(T) - y(0).
    monodromy : ndarray, shape (n, n)
    monodromies : ndarray, shape (n + 1 + k, n, n)
        Its derivatives.
    variations : Variations
        The variational equations they come from.
    ways : ndarray, shape (panels, nodes, n, n + 1 + k)
        Derivatives of the motion over the turn.
    constants : ndarray, shape (c, n + 1 + k)
        Derivatives of the numbers of the drive and the constants of the equations.
    """

    gaps: FloatArray
    monodromy: FloatArray
    monodromies: FloatArray
    variations: Variations
    ways: FloatArray
    constants: FloatArray


def family_at(wish: Wish, x: FloatArray) -> Family:
    """The periodic motions over the level, with changes in their tolerances."""
    parameters, drive = wish.operation(x, wish.span[0])
    return Family(parameters=parameters, drive=drive, vary=wish.over)


class Spot(NamedTuple):
    """A place found: the changes, y, the level, and the turns of the period."""

    x: FloatArray
    y: FloatArray
    level: float
    turns: int = 1


def spot_of(wish: Wish, x: FloatArray, orbit: PeriodicOrbit) -> Spot:
    """Where a motion is."""
    return Spot(x, orbit.start, wish.level_of(orbit), orbit.turns)


def motion(wish: Wish, spot: Spot) -> PeriodicOrbit:
    """The motion that begins there, as far as it closes."""
    orbit: PeriodicOrbit = OrbitEquations(family_at(wish, spot.x), spot.turns, *wish.span)(spot.y, spot.level).data
    return orbit


def sampled(orbit: PeriodicOrbit) -> Turn:
    """Its outputs over the period, each turn in as many samples."""
    return orbit.turn(_SAMPLES * orbit.turns)


def expansion(wish: Wish, spot: Spot) -> Expansion:
    """The derivatives at a place, by the variational equations to second order; it need not be on a motion that closes."""
    along = motion_gradient(motion(wish, spot), (wish.over, *wish.names))
    v, n = along.variations, len(spot.y)
    unit = np.append(1.0, wish.tolerance)
    forcing, constants = v.forcing * unit, along.along * unit
    gaps = np.column_stack([v.monodromy - np.eye(n), v.after(forcing)])
    ways = np.concatenate([v.fundamental, v.from_start(np.zeros((n, len(unit))), forcing)], axis=-1)
    constants = np.column_stack([np.zeros((len(constants), n)), constants])
    monodromies = np.empty((n + len(unit), n, n))
    for column in range(n):
        by_y, by_constant = v.second(v.fundamental[..., column])
        monodromies[:, :, column] = v.after(by_y @ ways + by_constant @ constants).T
    return Expansion(gaps, v.monodromy, monodromies, v, ways, constants)


def margin_matrix(monodromy: FloatArray, kind: Crossing, radius: float = 1.0) -> FloatArray:
    """The matrix A of which det(I - A) is zero where a multiplier crosses a circle in this way, and positive within."""
    if kind is not Crossing.TORUS:
        return monodromy / radius if kind is Crossing.FOLD else -monodromy / radius
    # the minors of order 2, whose eigenvalues are the products of two multipliers
    pairs = list(combinations(range(len(monodromy)), 2))
    minors = [
        [monodromy[a, c] * monodromy[b, d] - monodromy[a, d] * monodromy[b, c] for c, d in pairs] for a, b in pairs
    ]
    return np.array(minors) / radius**2


def margin_of(monodromy: FloatArray, kind: Crossing, radius: float = 1.0) -> float:
    """det(I - A) of `margin_matrix`."""
    matrix = margin_matrix(monodromy, kind, radius)
    return float(np.linalg.det(np.eye(len(matrix)) - matrix))


def margin_slopes(found: Expansion, kind: Crossing, radius: float = 1.0) -> FloatArray:
    """Derivatives of `margin_of` by y, the level and the parameters, exact for those of the matrix: a step along i."""
    step = 1e-30
    matrices = [margin_matrix(found.monodromy + 1j * step * m, kind, radius) for m in found.monodromies]
    return np.array([np.linalg.det(np.eye(len(m)) - m).imag / step for m in matrices])


class Row(Protocol):
    """The equation that picks a place from its branch."""

    def value(self, y: FloatArray, level: float, monodromy: FloatArray) -> float:
        """What is zero at the place."""

    def slopes(self, found: Expansion) -> FloatArray:
        """Its derivatives by y, the level and the changes."""

    def across(self, found: Callable[[], Expansion]) -> FloatArray:
        """Those by y and the level alone."""


@dataclass(frozen=True, slots=True, eq=False)
class Across:
    """In a plane across the branch: normal . (y, level) = offset; at a fixed level where the normal is along it."""

    normal: FloatArray
    offset: float

    @classmethod
    def at_level(cls, wish: Wish, spot: Spot, level: float) -> Across:
        """At a level, of motions like the one at a place."""
        return cls(np.append(np.zeros(len(spot.y)), 1.0 / wish.size), level / wish.size)

    def value(self, y: FloatArray, level: float, monodromy: FloatArray) -> float:
        return float(self.normal[:-1] @ y + self.normal[-1] * level - self.offset)

    def slopes(self, found: Expansion) -> FloatArray:
        return np.append(self.normal, np.zeros(len(found.monodromies) - len(self.normal)))

    def across(self, found: Callable[[], Expansion]) -> FloatArray:
        return self.normal


@dataclass(frozen=True, slots=True)
class Lost:
    """Where a multiplier crosses the unit circle."""

    kind: Crossing

    def value(self, y: FloatArray, level: float, monodromy: FloatArray) -> float:
        return margin_of(monodromy, self.kind)

    def slopes(self, found: Expansion) -> FloatArray:
        return margin_slopes(found, self.kind)

    def across(self, found: Callable[[], Expansion]) -> FloatArray:
        there = found()
        return self.slopes(there)[: len(there.monodromy) + 1]


class Found:
    """A place at some parameters, and how it moves with them."""

    def __init__(self, wish: Wish, row: Row, spot: Spot) -> None:
        self.spot = spot
        self._wish, self._row = wish, row

    @cached_property
    def expansion(self) -> Expansion:
        """The derivatives there."""
        return expansion(self._wish, self.spot)

    @cached_property
    def orbit(self) -> PeriodicOrbit:
        """The motion."""
        return motion(self._wish, self.spot)

    @cached_property
    def slopes(self) -> FloatArray:
        """Derivatives of y and the level by the changes, shape (n + 1, k)."""
        gaps, n = self.expansion.gaps, len(self.spot.y) + 1
        rows = np.vstack([gaps, self._row.slopes(self.expansion)])
        return -np.linalg.solve(rows[:, :n], rows[:, n:])

    def along(self, slopes: FloatArray) -> FloatArray:
        """Derivatives by the changes of what has these by y, the level and the changes, shape (..., n + 1 + k)."""
        n = len(self.spot.y) + 1
        found: FloatArray = slopes[..., n:] + slopes[..., :n] @ self.slopes
        return found

    def output_slopes(self, number: int, angle: float) -> FloatArray:
        """Derivatives by the changes of an output, by its number, at a crank angle; shape (k,)."""
        found = self.expansion
        v = found.variations
        angle = float(angle % (self.spot.turns * v.flow.period))
        panel = int(np.searchsorted(np.cumsum(v.h), angle).clip(0, len(v.h) - 1))
        by_y, by_constant = v.output_derivatives(panel, number)
        nodes = self.along(np.einsum("sn,snm->sm", by_y, found.ways[panel]) + by_constant @ found.constants)
        # the polynomial through the panel's nodes, by Lagrange
        away = v.angles[panel] - v.angles[panel][:, None]
        np.fill_diagonal(away, 1.0)
        ahead = np.tile(v.angles[panel] - angle, (len(away), 1))
        np.fill_diagonal(ahead, 1.0)
        weights: FloatArray = np.prod(ahead / away, axis=1)
        return weights @ nodes


class Place:
    """A place that is found again wherever the parameters go.

    Parameters
    ----------
    wish : Wish
    row : Row
    spot : Spot
        Where it is known.
    """

    def __init__(self, wish: Wish, row: Row, spot: Spot) -> None:
        self.wish, self.row = wish, row
        self._last = spot
        self._scale = np.append(scale_of(*wish.operation(spot.x, spot.level), spot.y), wish.size)

    def at(self, x: FloatArray) -> Found:
        """The place with changes in their tolerances; raises LostError if it is not found again."""
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
        return Found(self.wish, self.row, spot)

    def _newton(self, x: FloatArray, begin: Spot, slope: FloatArray | None, ahead: float) -> Spot:
        z = np.append(begin.y, begin.level)
        first = z = z if slope is None else z + ahead * slope
        n = len(begin.y)
        evaluate = OrbitEquations(family_at(self.wish, x), begin.turns, *self.wish.span)
        size = np.inf
        for count in range(ITERATIONS):
            here = evaluate(z[:n], float(z[n]))
            top = np.column_stack([here.jacobian, here.slope])
            below = self.row.across(partial(expansion, self.wish, begin._replace(x=x, y=z[:n], level=float(z[n]))))
            value = self.row.value(z[:n], float(z[n]), here.jacobian + np.eye(n))
            try:
                step = np.linalg.solve(np.vstack([top, below]), np.append(here.residual, value))
            except np.linalg.LinAlgError:
                raise LostError("its equations are singular there") from None
            z, before, size = z - step, size, float(np.abs(step / self._scale).max())
            # the second correction may still be the greater one
            if not np.abs((z - first) / self._scale).max() < REACH or (count > 2 and size > 0.5 * before > FOUND):
                break
            if size < FOUND:
                return begin._replace(x=x, y=z[:n], level=float(z[n]))
        raise LostError(f"Newton's method does not settle: last correction {size:.1e}")


class Centre(Place):
    """Where a closed branch shrinks to a point and vanishes, found again wherever the parameters go, before that and after it.

    With G = y(T) - y(0), a vector b and a number e, the motions that miss their start by e b have a critical point: G = e b,
    and a vector across G's derivatives by y and by the level. Where e is zero there the branch is a point (an isola centre: M.
    Golubitsky and D. G. Schaeffer, Singularities and Groups in Bifurcation Theory I, Springer 1985, chapter III); e is a smooth
    function of the parameters on both sides of it.

    Parameters
    ----------
    wish : Wish
    spot : Spot
        Inside the branch.

    Raises
    ------
    LostError
        If there is no such point near it.
    """

    def __init__(self, wish: Wish, spot: Spot) -> None:
        super().__init__(wish, Across.at_level(wish, spot, spot.level), spot)
        n = len(spot.y)
        self._b = np.linalg.svd(self._derivatives(expansion(wish, spot))[:, :n])[0][:, -1]
        self._last = self.found = self._newton(spot.x, spot, None, 0.0)
        found = expansion(wish, self._last)
        first, across = self._derivatives(found), self._across(found)
        free = np.linalg.svd(first)[2][n - 1 :]
        bends = np.linalg.eigvalsh(free @ self._second(found, across) @ free.T)
        miss = self.miss(self.found)
        # a bowl is cut in a closed curve, a saddle is not
        if not (bends[0] * bends[1] > 0.0 and miss * bends[0] < 0.0):
            raise LostError(f"no closed branch lies about {wish.say(spot.level)}")

    def miss(self, spot: Spot) -> float:
        """e, relative to the scale of y."""
        return float(self._b @ self._gap(spot))

    def miss_slopes(self, found: Found) -> FloatArray:
        """Its derivatives by the changes, shape (k,)."""
        n = len(found.spot.y)
        slopes: FloatArray = self._across(found.expansion) @ (found.expansion.gaps[:, n + 1 :] / self._scale[:n, None])
        return slopes

    def _gap(self, spot: Spot) -> FloatArray:
        evaluate = OrbitEquations(family_at(self.wish, spot.x), spot.turns, *self.wish.span)
        return np.asarray(evaluate(spot.y, spot.level).residual / self._scale[:-1])

    def _derivatives(self, found: Expansion) -> FloatArray:
        """Of G by y and the level, scaled; shape (n, n + 1)."""
        n = len(found.monodromy)
        return np.asarray(found.gaps[:, : n + 1] * self._scale / self._scale[:n, None])

    def _across(self, found: Expansion) -> FloatArray:
        """The vector across the derivatives, of which the product with b is 1."""
        vector = np.linalg.svd(self._derivatives(found))[0][:, -1]
        return np.asarray(vector / (vector @ self._b))

    def _second(self, found: Expansion, across: FloatArray) -> FloatArray:
        """Second derivatives of the product of a vector with G, scaled; shape (n + 1, n + 1)."""
        v, n = found.variations, len(found.monodromy)
        by_y, by_constant = v.second(found.ways[..., n], found.constants[:, n])
        level = v.after(by_y @ found.ways[..., n : n + 1] + by_constant @ found.constants[:, n : n + 1])
        second = np.empty((n, n + 1, n + 1))
        second[:, :n, :] = found.monodromies[: n + 1].transpose(1, 2, 0)
        second[:, n, :n] = second[:, :n, n]
        second[:, n, n] = level[:, 0]
        return np.asarray(np.einsum("a,aij->ij", across / self._scale[:n], second) * np.outer(self._scale, self._scale))

    def _newton(self, x: FloatArray, begin: Spot, slope: FloatArray | None, ahead: float) -> Spot:
        n = len(begin.y)
        z = np.append(begin.y, begin.level) / self._scale
        first = z = z if slope is None else z + ahead * slope / self._scale
        across, miss = np.empty(0), 0.0
        for _ in range(ITERATIONS):
            spot = begin._replace(x=x, y=z[:n] * self._scale[:n], level=float(z[n] * self._scale[n]))
            found = expansion(self.wish, spot)
            gap, derivatives = self._gap(spot), self._derivatives(found)
            if not len(across):
                across, miss = self._across(found), float(self._b @ gap)
            matrix = np.zeros((2 * n + 2, 2 * n + 2))
            matrix[:n, : n + 1], matrix[:n, n + 1] = derivatives, -self._b
            matrix[n:-1, : n + 1], matrix[n:-1, n + 2 :] = self._second(found, across), derivatives.T
            matrix[-1, n + 2 :] = self._b
            value = np.concatenate([gap - miss * self._b, derivatives.T @ across, [across @ self._b - 1.0]])
            try:
                step = np.linalg.solve(matrix, value)
            except np.linalg.LinAlgError:
                break
            z, miss, across = z - step[: n + 1], miss - float(step[n + 1]), across - step[n + 2 :]
            if not np.abs(z - first).max() < REACH:
                break
            if np.abs(step[: n + 1]).max() < FOUND:
                return begin._replace(x=x, y=z[:n] * self._scale[:n], level=float(z[n] * self._scale[n]))
        raise LostError(f"no closed branch near {self.wish.say(begin.level)} shrinks to a point")


def centre_of(wish: Wish, folds: Sequence[Spot]) -> Centre:
    """The centre of the closed branch with two folds; a large one is shrunk first, by the least changes that do.

    Raises LostError if it cannot be shrunk so far within the bounds of the changes.
    """
    x, places = folds[0].x, [Place(wish, Lost(Crossing.FOLD), fold) for fold in folds]
    low, high = wish.scaled(wish.low), wish.scaled(wish.high)
    for _ in range(_SHRINKINGS):
        first, last = (place.at(x) for place in places)
        try:
            return Centre(
                wish,
                first.spot._replace(
                    y=0.5 * (first.spot.y + last.spot.y), level=0.5 * (first.spot.level + last.spot.level)
                ),
            )
        except LinkworkError:
            pass
        # the square of the width goes to zero evenly
        width, slopes = last.spot.level - first.spot.level, last.slopes[-1] - first.slopes[-1]
        moved = np.clip(x - _SHRINKAGE * width * slopes / (slopes @ slopes), low, high)
        if np.abs(moved - x).max() < FOUND:
            break
        x = moved
    raise LostError(f"the closed branch about {wish.say(folds[0].level)} does not shrink to a point within the bounds")
