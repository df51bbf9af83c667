"""Scan many thousand linkages; compute the best position, size and coupler point of each in closed form.

Variable projection: let the shape of the linkage and the phase of its crank be given. The shape of a four-bar is the ratios of
its links to the ground link; for a slider-crank, to the coupler. The shape of a geared five-bar also includes length and phase
of the second crank. Then the coupler point is z0 + c1 exp(i th2) + c2 exp(i th3). It is linear in three complex unknowns: the
position z0, the size and direction c1, and the coupler point c2. All other unknowns are sampled by a Sobol sequence, which is
scrambled by a seed.

- Timed tasks: shape and phase are sampled.
- Few untimed stations: shape, phase and the stations' crank rotations, in order, are sampled.
- Untimed paths: shape and coupler point are sampled. Each coupler curve is laid over the target by the best similarity
  transformation. Curve and target are compared at equal arc lengths, for all starting points on the curve (by a fast Fourier
  transform of their correlation); for an open path, they are compared for many pieces of the curve.
- Rocker functions: shape and phase are sampled; the mounting angle is the mean of the differences.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import cos, degrees, inf, log, pi, sin

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from ...run import show_progress
from ..linkage.kernels import many_directions, match_windows
from ..linkage.linkage import BY_SHORTEST, Kind, Linkage, SliderCrank
from ..task.constraint import TURNING, InfeasibleError
from ..task.limits import Limits
from ..task.task import Normal
from .program import Start, keep_distinct

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
#: Ranges of l2/l1, l3/l1, l4/l1 that are sampled, uniformly in the logarithm.
SHAPES = ((0.01, 3.0), (0.05, 6.0), (0.05, 6.0))
#: Ranges of l1/l3 and l2/l3 of a slider-crank; of l5/l1 of a second crank; number of rotations at which a five-bar is checked.
GUIDED, SECOND, AROUND = ((1e-3, 2.0), (0.01, 3.0)), (0.01, 3.0), 48
#: Number of candidates that are placed together.
CHUNK = 4096
#: One of this many coupler points is at the crank pin.
PINNED = 64
#: Number of coupler curves of a chunk that are placed over the target: the most similar ones.
PLACED = 160
#: Number of crank steps of a coupler curve, and number of its points at equal arc lengths.
CURVE, EVEN = 128, 64
#: Pieces of a coupler curve that are compared with an open target: number of points at equal arc lengths on each piece; crank
#: steps at which pieces begin; numbers of crank steps in a piece.
PIECE = 24
STARTS = np.arange(0, CURVE, 8)
SPANS = np.array([10, 16, 24, 36, 52, 72, 96, 124])
#: Starts that differ by less than this in the logarithms of their shape and in phase count as the same.
APART = 0.08


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidates:
    """A set of m candidates: quality, shape (m,), and dimensions ``q`` in the order of `UNKNOWNS`, shape (m, 11).

    The quality is infinite for a candidate that was not placed over the target. ``rotation``, shape (m, n), has the crank
    rotations of the stations; None if the task gives them. ``pivot``, shape (m, 2), has length and phase of a second crank.
    """

    quality: FloatArray
    q: FloatArray
    rotation: FloatArray | None
    branch: int
    pivot: FloatArray | None = None


class _FourBarShapes:
    """Shapes of four-bars: the ratios of links that are sampled, and methods that check a shape.

    Each ratio is a link of ``others`` divided by the link ``base`` (indices in `UNKNOWNS`); ``ranges`` limits the ratios.
    """

    base, others, ranges = 2, slice(3, 6), SHAPES

    @staticmethod
    def links(shapes: FloatArray, limits: Limits) -> FloatArray:
        """Return the links (l1, l2, l3, l4, l5) of each shape relative to its base link, shape (m, 5); 0 for an absent link."""
        return np.column_stack([np.ones(len(shapes)), shapes[:, :3], np.zeros(len(shapes))])

    @staticmethod
    def meets_transmission(shapes: FloatArray, links: FloatArray, limits: Limits, least: float) -> NDArray[np.bool_]:
        """Return for each shape whether it meets the least transmission angle (rad) over a turn."""
        l1, l2, l3, l4, _ = links.T
        ends = (l1 - l2) ** 2, (l1 + l2) ** 2
        excess = limits.linkage.transmission_excess(l3, l4, *ends, cos(max(least, TURNING)))
        return np.all([one <= 0.0 for one in excess], axis=0)

    @staticmethod
    def ratios(start: Start) -> FloatArray:
        """Return the ratios of a start's links, by which similar starts are recognised."""
        return start.q[3:6] / start.q[2]


class _SliderCrankShapes(_FourBarShapes):
    """Shapes of slider-cranks: offset and crank relative to the coupler."""

    base, others, ranges = 4, slice(2, 5), (*GUIDED, (1.0, 1.0))

    @staticmethod
    def links(shapes: FloatArray, limits: Limits) -> FloatArray:
        one, none = np.ones(len(shapes)), np.zeros(len(shapes))
        offset = shapes[:, 0] if limits.high[2] > 0.0 else none
        return np.column_stack([offset, shapes[:, 1], one, none, none])

    @staticmethod
    def ratios(start: Start) -> FloatArray:
        return np.array([start.q[3] / start.q[4], 1.0 + start.q[2] / start.q[4]])


class _FiveBarShapes(_FourBarShapes):
    """Shapes of geared five-bars: the ratios of a four-bar, with length and phase of the second crank."""

    @staticmethod
    def links(shapes: FloatArray, limits: Limits) -> FloatArray:
        low, high = np.log(SECOND)
        return np.column_stack([np.ones(len(shapes)), shapes[:, :3], np.exp(low + (high - low) * shapes[:, 6])])

    @staticmethod
    def meets_transmission(shapes: FloatArray, links: FloatArray, limits: Limits, least: float) -> NDArray[np.bool_]:
        """Return for each shape whether it meets the least transmission angle (rad) over a turn of the gears' input.

        The angle is checked at `AROUND` rotations: first at a few of them, then, for the shapes that passed, at the others.
        """
        turned = limits.gears
        allowed = np.ones(len(shapes), dtype=bool)
        for begin, step in ((0, 12), (6, 12), (3, 6), (1, 3), (2, 3)):
            rows = np.flatnonzero(allowed)
            l1, l2, l3, l4, l5 = links[rows].T
            phi = 2.0 * pi * np.arange(begin, AROUND, step)[:, None] / AROUND
            second = np.exp(1j * _second_phase(shapes[rows], 0.0, limits)) * l5 * np.exp(1j * turned[1] * phi)
            off = l1 + second - l2 * np.exp(1j * turned[0] * phi)
            d2 = off.real**2 + off.imag**2
            for excess in Linkage.transmission_excess(l3, l4, d2.min(axis=0), d2.max(axis=0), cos(max(least, TURNING))):
                allowed[rows] &= excess <= 0.0
        return allowed


_SHAPES: Mapping[Kind, type[_FourBarShapes]] = {
    "four-bar": _FourBarShapes,
    "slider-crank": _SliderCrankShapes,
    "geared-five-bar": _FiveBarShapes,
}


def scan(normal: Normal, limits: Limits, *, seed: int, candidates: int, starts: int) -> list[Start]:
    """Find the best starts of all allowed assemblies, the best first; no two of them are similar.

    ``candidates`` is the number of allowed shapes that are tried, ``starts`` the number of starts that are kept.

    Raises InfeasibleError if no shape is allowed.
    """
    found: list[Candidates] = []
    placed = 0
    with show_progress(False, float(candidates), f"trying {candidates:,} shapes") as show:
        for number, branch in enumerate(limits.branches):
            chunks = _allowed_shapes(limits, seed + 7919 * number, max(1, candidates // len(limits.branches)))
            if normal.outline is not None:
                chunks = _merge_chunks(chunks)
            for chunk, shapes in enumerate(chunks):
                show(float(placed))
                random = np.random.default_rng([seed, chunk, branch + 1])
                found.append(_place_shapes(normal, limits, shapes, branch, random))
                placed += len(shapes)
    if not found:
        raise InfeasibleError(f"no shape of {limits.linkage.kind} {_impossible_limit(limits, seed)}")
    return _distinct_starts(found, starts, limits)


def _allowed_shapes(limits: Limits, seed: int, count: int) -> Iterator[FloatArray]:
    """Yield ``count`` shapes that the limits allow, in arrays with one row per shape; fewer if allowed shapes are rare.

    A row has the ratios (l2/l1, l3/l1, l4/l1), for a slider-crank (l1/l3, l2/l3, 1), followed by six sampled numbers in [0, 1)
    for phase, coupler point and second crank.
    """
    sequence = qmc.Sobol(9, seed=seed)
    kept, tried = 0, 0
    while kept < count and tried < 64 * count:
        unit = sequence.random(CHUNK)
        tried += CHUNK
        shapes = _sample_shapes(unit, limits)
        shapes = shapes[_is_allowed(shapes, limits)][: count - kept]
        kept += len(shapes)
        if len(shapes):
            yield shapes


def _merge_chunks(chunks: Iterator[FloatArray]) -> Iterator[FloatArray]:
    """Merge chunks of shapes until each has at least `CHUNK` rows.

    The best `PLACED` curves of each chunk are placed over the target; if chunks were small, poor curves would be placed, too.
    """
    rows: list[FloatArray] = []
    for chunk in chunks:
        rows.append(chunk)
        if sum(map(len, rows)) >= CHUNK:
            yield np.vstack(rows)
            rows = []
    if rows:
        yield np.vstack(rows)


def _impossible_limit(limits: Limits, seed: int) -> str:
    """Return, in words, the limit that no shape meets; all limits if each one alone can be met."""
    free = replace(limits, low=np.full(len(limits.low), 1e-9), high=np.full(len(limits.high), 1e9))
    alone = {"is within the bounds of the links": replace(limits, turn=None, grashof=None)}
    if limits.turn is not None:
        angle = f"has a transmission angle of {degrees(limits.turn):g} deg over a full turn"
        alone[angle if limits.turn else "has a crank that turns fully"] = replace(free, grashof=None)
    if limits.grashof is not None:
        alone[f"is a {limits.grashof}"] = replace(free, turn=None)
    unit = qmc.Sobol(9, seed=seed).random(CHUNK)
    for words, one in alone.items():
        if not _is_allowed(_sample_shapes(unit, one), one).any():
            return words
    return " and ".join(alone)


def _sample_shapes(unit: FloatArray, limits: Limits) -> FloatArray:
    """Convert rows of nine numbers in [0, 1) to shapes: rows as in `_allowed_shapes`."""
    low, high = np.log(_ratio_ranges(limits)).T
    return np.hstack([np.exp(low + (high - low) * unit[:, :3]), unit[:, 3:]])


def _ratio_ranges(limits: Limits) -> FloatArray:
    """Return the least and the greatest value of each sampled ratio of links, shape (3, 2), within the links' bounds."""
    own = _SHAPES[limits.linkage.kind]
    base, others = own.base, own.others
    given = np.column_stack([limits.low[others] / limits.high[base], limits.high[others] / limits.low[base]])
    ranges = np.array(own.ranges)
    both = np.column_stack([np.maximum(given[:, 0], ranges[:, 0]), np.minimum(given[:, 1], ranges[:, 1])])
    # an offset may be zero
    return np.maximum(np.where(both[:, :1] <= both[:, 1:], both, given), 1e-12)


def _is_allowed(shapes: FloatArray, limits: Limits) -> NDArray[np.bool_]:
    """Return for each shape whether it meets transmission angle, Grashof type and, for some size, the bounds of its links."""
    sized = _SHAPES[limits.linkage.kind].links(shapes, limits)
    links = sized[:, :4]
    allowed = np.ones(len(shapes), dtype=bool)
    if limits.turn is not None:
        allowed = _SHAPES[limits.linkage.kind].meets_transmission(shapes, sized, limits, limits.turn)
    if limits.grashof is not None:
        order = np.sort(links, axis=1)
        excess = order[:, 0] + order[:, 3] - order[:, 1] - order[:, 2]
        if limits.grashof == "triple-rocker":
            allowed &= excess > 0.0
        else:
            shortest = BY_SHORTEST.index(limits.grashof)
            allowed &= (excess < 0.0) & (links.argmin(axis=1) == shortest)
    least, most = _size_range(sized, limits)
    # fixed links leave a single size, apart from rounding
    return allowed & (least <= most * (1.0 + 1e-9))


def _second_phase(shapes: FloatArray, phase: FloatArray | float, limits: Limits) -> FloatArray:
    """Return the phase of the second crank: an angle from ``shapes``, plus the gear ratio times the first crank's ``phase``.

    With this sum the first crank's phase does not affect the coupler curve.
    """
    return 2.0 * pi * shapes[:, 7] + limits.ratio * phase


def _size_range(links: FloatArray, limits: Limits) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest length (m,) of the base link at which all ``links`` are within their bounds.

    Each row of ``links`` has the links of one shape, relative to the base link.
    """
    second = limits.second or (0.0, inf)
    there = links > 0.0
    low, high = (
        np.append(ends[2:6], end) / np.where(there, links, 1.0) for ends, end in zip((limits.low, limits.high), second)
    )
    return np.where(there, low, 0.0).max(axis=1), np.where(there, high, inf).min(axis=1)


def _place_shapes(
    normal: Normal, limits: Limits, shapes: FloatArray, branch: int, random: np.random.Generator
) -> Candidates:
    if normal.of_rocker:
        found = _place_functions(normal, limits, shapes, branch)
    elif normal.of_slider:
        found = _place_slider_functions(normal, limits, shapes, branch)
    elif normal.timed or normal.angle is not None or normal.exact:
        found = _place_timed(normal, limits, shapes, branch, None if normal.timed else random)
    else:
        found = _place_paths(normal, limits, shapes, branch)
    if limits.second is None:
        return _drop_unjoined(normal, limits, found) if limits.way is not None else found
    links = _SHAPES[limits.linkage.kind].links(shapes, limits)
    second = links[:, 4] * found.q[:, 4] / links[:, 2]
    return replace(found, pivot=np.column_stack([second, _second_phase(shapes, found.q[:, 8], limits)]))


def _drop_unjoined(normal: Normal, limits: Limits, found: Candidates) -> Candidates:
    """Return the candidates, with infinite quality if the links cannot be joined between two stations.

    The distance BD is extreme where the crank passes the direction of the ground link.
    """
    rotation = normal.rotation[None] if found.rotation is None else found.rotation  # type: ignore[index]
    begin, end = ((found.q[:, 8] + ends(rotation, axis=1)) / pi for ends in (np.min, np.max))
    l1, l2, l3, l4 = found.q[:, 2:6].T
    bad = np.zeros(len(l1), dtype=bool)
    for odd, reach in ((0.0, l1 - l2), (1.0, l1 + l2)):
        passed = 2.0 * np.ceil(0.5 * (begin - odd)) + odd <= end
        for excess in limits.linkage.transmission_excess(l3, l4, reach**2, reach**2, cos(TURNING)):
            bad |= passed & (excess > 0.0)
    return replace(found, quality=np.where(bad, inf, found.quality))


def _directions(
    shapes: FloatArray,
    phase: FloatArray,
    rotation: FloatArray,
    branch: int,
    limits: Limits,
    turned: FloatArray | float = 0.0,
) -> tuple[ComplexArray, ComplexArray]:
    """Compute the directions of coupler and rocker as complex unit numbers, shape (m, n), for m shapes at n crank rotations.

    ``phase`` is the crank phase of each shape. ``turned`` (rad) is added to all crank rotations; it may differ between shapes.
    """
    first, second = limits.gears
    links = _SHAPES[limits.linkage.kind].links(shapes, limits)
    phases = [phase + first * turned, links[:, 4], _second_phase(shapes, phase, limits) + second * turned]
    rows = np.column_stack([links[:, :4], *phases])
    coupler = np.empty((len(shapes), len(rotation)), dtype=complex)
    rocker = np.empty_like(coupler)
    waves = [wave(turns * rotation) for turns in (first, second) for wave in (np.cos, np.sin)]
    many_directions(*waves, np.ascontiguousarray(rows), float(branch), coupler, rocker)
    return coupler, rocker


def _place_functions(normal: Normal, limits: Limits, shapes: FloatArray, branch: int) -> Candidates:
    """Compute the best mounting angle of sampled shapes and phases for a rocker function, and return them as candidates."""
    assert normal.rotation is not None
    assert normal.angle is not None
    phase = 2.0 * pi * shapes[:, 3]
    _, rocker = _directions(shapes, phase, normal.rotation, branch, limits)
    left: ComplexArray = np.exp(1j * normal.angle) * rocker.conj()
    offset = np.zeros(len(shapes))
    if normal.mounting:
        offset = np.angle((normal.weights * left).sum(axis=1))
        left *= np.exp(-1j * offset)[:, None]
    quality = (normal.weights * np.angle(left) ** 2).sum(axis=1)
    links = _SHAPES[limits.linkage.kind].links(shapes, limits)
    least, most = _size_range(links, limits)
    size = np.sqrt(np.maximum(least, 1e-12) * most)
    q = np.zeros((len(shapes), 11))
    q[:, 2:6] = size[:, None] * links[:, :4]
    q[:, 8], q[:, 10] = phase, offset
    return Candidates(quality=quality, q=q, rotation=None, branch=branch)


def _place_slider_functions(normal: Normal, limits: Limits, shapes: FloatArray, branch: int) -> Candidates:
    """Compute the best size and shaft position of sampled shapes and phases for a slider function; return candidates."""
    assert normal.rotation is not None
    assert normal.points is not None
    phase = 2.0 * pi * shapes[:, 3]
    links, w, x = _SHAPES[limits.linkage.kind].links(shapes, limits), normal.weights, normal.points.real
    coupler, _ = _directions(shapes, phase, normal.rotation, branch, limits)
    travelled = links[:, 1:2] * np.sin(phase[:, None] + normal.rotation) + coupler.imag
    mean, wanted = travelled @ w / w.sum(), float(x @ w / w.sum())
    off = travelled - mean[:, None]
    factor = off @ (w * (x - wanted)) / (off**2 @ w)
    least, most = _size_range(links, limits)
    size = np.clip(np.abs(factor), least, most)
    # seen from the shaft, the slider's position increases to the left
    side = -np.sign(factor)
    quality = (x - wanted + (side * size)[:, None] * off) ** 2 @ w
    # the guide is the x axis: bounds and regions may leave only one of its sides for the shaft
    guide = -normal.origin.imag / normal.unit
    rooms = [(limits.low[1], limits.high[1])]
    rooms += [(np.min(t, axis=(0, 1))[1], np.max(t, axis=(0, 1))[1]) for pivot, t in limits.regions if pivot == "A"]
    lowest, highest = max(low for low, _ in rooms), min(high for _, high in rooms)
    quality[((side > 0.0) & (lowest > guide)) | ((side < 0.0) & (highest < guide))] = inf
    q = np.zeros((len(shapes), 11))
    q[:, 0] = wanted + side * size * mean
    q[:, 1] = guide - side * size * links[:, 0]
    q[:, 2:6] = size[:, None] * links[:, :4]
    q[:, 6], q[:, 7], q[:, 8] = size * links[:, 2], 0.5 * pi * side, phase
    return Candidates(quality=quality, q=q, rotation=None, branch=branch)


def _place_timed(
    normal: Normal, limits: Limits, shapes: FloatArray, branch: int, random: np.random.Generator | None
) -> Candidates:
    """Place sampled shapes at the targets of a path or motion by variable projection; return candidates.

    If the task gives no crank rotations, the stations get random rotations in order, from ``random``.
    """
    phase = 2.0 * pi * shapes[:, 3]
    links = _SHAPES[limits.linkage.kind].links(shapes, limits)
    n = normal.n
    if random is None:
        assert normal.rotation is not None
        rotation = np.broadcast_to(normal.rotation, (len(shapes), n))
        coupler, _ = _directions(shapes, phase, normal.rotation, branch, limits)
    else:
        gaps = random.dirichlet(np.ones(n + 1), len(shapes))[:, :n]
        rotation = 2.0 * pi * np.cumsum(gaps, axis=1) * random.choice([1.0, -1.0], (len(shapes), 1))
        coupler = np.empty((len(shapes), n), dtype=complex)
        for k in range(n):
            coupler[:, k] = _directions(shapes, phase, np.zeros(1), branch, limits, rotation[:, k])[0][:, 0]
    assert normal.points is not None
    crank = np.exp(1j * (phase[:, None] + limits.gears[0] * rotation))
    basis = np.stack([np.ones_like(crank), crank, coupler], axis=1)
    w, p = normal.weights, normal.points
    z = _solve_projection(basis, p, w)
    # the size is clipped to the links' bounds, and the other unknowns are computed again
    least, most = _size_range(links, limits)
    size = np.abs(z[:, 1]) / links[:, 1]
    bounded = np.clip(size, np.maximum(least, 1e-9), most)
    outside = bounded != size
    if outside.any():
        z[outside, 1] *= (bounded / np.maximum(size, 1e-300))[outside]
        rest = _solve_projection(basis[outside][:, [0, 2]], p - z[outside, 1, None] * basis[outside, 1], w)
        z[outside, 0], z[outside, 2] = rest[:, 0], rest[:, 1]
    far = np.abs(z[:, 2]) > limits.high[6]
    z[far, 2] *= limits.high[6] / np.abs(z[far, 2])
    error = np.abs(np.einsum("mk,mkn->mn", z, basis) - p) ** 2
    turn = np.angle(z[:, 1])
    offset = np.zeros(len(shapes))
    if normal.angle is not None:
        left = np.exp(1j * (normal.angle - turn[:, None])) * coupler.conj()
        offset = np.angle((w * left).sum(axis=1))
        error = error + (normal.leverage * np.angle(left * np.exp(-1j * offset)[:, None])) ** 2
    lengths = [bounded[:, None] * links[:, :4], np.abs(z[:, 2])]
    q = np.column_stack([z[:, 0].real, z[:, 0].imag, *lengths, turn, phase, np.angle(z[:, 2]) - turn, offset])
    return Candidates(
        quality=(w * error).sum(axis=1), q=q, rotation=None if random is None else rotation, branch=branch
    )


def _solve_projection(basis: ComplexArray, p: ComplexArray, w: FloatArray) -> ComplexArray:
    """Solve p = z . basis for z, shape (m, k), by weighted least squares in each of m rows.

    ``basis`` has shape (m, k, n), ``p`` shape (n,) or (m, n), and the weights ``w`` shape (n,).
    """
    weighted = basis.conj() * w
    gram = weighted @ basis.transpose(0, 2, 1)
    # transposed: gram[a, b] = sum of conj(basis_a) w basis_b
    gram += 1e-12 * w.sum() * np.eye(basis.shape[1])
    right = (weighted * (p if p.ndim == 1 else p[:, None, :])).sum(axis=2)
    bad = ~np.isfinite(gram).all(axis=(1, 2))
    gram[bad], right[bad] = np.eye(basis.shape[1]), np.nan
    return np.linalg.solve(gram, right[:, :, None])[:, :, 0].astype(complex)


def _place_paths(normal: Normal, limits: Limits, shapes: FloatArray, branch: int) -> Candidates:
    """Lay the coupler curves of sampled shapes over an untimed path by similarity transformations; return candidates."""
    links = _SHAPES[limits.linkage.kind].links(shapes, limits)
    rotation = np.linspace(0.0, 2.0 * pi, CURVE, endpoint=False)
    coupler, _ = _directions(shapes, np.zeros(len(shapes)), rotation, branch, limits)
    # the coupler point lies anywhere about the coupler, evenly in the logarithm of its distance; a few lie on the crank pin,
    # because no search reaches the pin's circle: at zero distance the direction of the point has no meaning
    longest = links.max(axis=1)
    distance = longest * np.exp(np.log(0.1) + np.log(30.0) * shapes[:, 4])
    distance[: len(shapes) // PINNED] = 0.0
    point = distance * np.exp(2j * pi * shapes[:, 5])
    curves = links[:, 1:2] * np.exp(1j * limits.gears[0] * rotation) + point[:, None] * coupler
    return (_place_closed_paths if normal.closed else _place_open_paths)(normal, limits, links, curves, point, branch)


def _place_closed_paths(
    normal: Normal, limits: Limits, links: FloatArray, curves: ComplexArray, point: ComplexArray, branch: int
) -> Candidates:
    assert normal.points is not None
    # a crank that does not turn fully closes no curve
    broken = np.logical_not(np.isfinite(curves).all(axis=1))
    curves = np.where(broken.reshape(-1, 1), 1.0 + 0.0j + np.arange(CURVE), curves)
    target, _ = _resample_evenly(normal.points[None, :], EVEN)
    goal = target[0] - target[0].mean()
    even, turned = _resample_evenly(curves, EVEN)
    mean = even.mean(axis=1)
    even = even - mean[:, None]
    energy = (np.abs(even) ** 2).sum(axis=1)
    best = np.full(len(curves), -inf)
    shift = np.zeros(len(curves), dtype=int)
    way = np.ones(len(curves))
    product = np.zeros(len(curves), dtype=complex)
    spectrum = np.fft.fft(goal)
    for direction in (1.0, -1.0):
        run = even if direction > 0.0 else np.roll(even[:, ::-1], 1, axis=1)
        # sum over k of goal[k] conj(run[k + s]) for every s
        correlation = np.fft.ifft(np.fft.fft(run).conj() * spectrum)
        at = np.abs(correlation).argmax(axis=1)
        value = correlation[np.arange(len(at)), at]
        better = np.abs(value) > best
        best = np.where(better, np.abs(value), best)
        # goal[k] lies over run[k - at]
        shift = np.where(better, at, shift)
        way = np.where(better, direction, way)
        product = np.where(better, value, product)
    scale = product / energy
    bounded, scale = _clip_sizes(scale, links, point, limits)
    misfit = (np.abs(goal) ** 2).sum() - 2.0 * (scale.conj() * product).real + np.abs(scale) ** 2 * energy
    misfit[broken] = inf
    place = target[0].mean() - scale * mean
    # crank rotation of each station: from its share of the target's length and the point of the curve at the target's start
    stations = normal.shares * EVEN
    rotations = np.empty((len(curves), normal.n))
    chosen = np.argsort(misfit)[:PLACED]
    chosen = chosen[np.isfinite(misfit[chosen])]
    for i in chosen:
        index = way[i] * (stations - shift[i])
        table = np.append(turned[i], turned[i, 0] + 2.0 * pi)
        rotations[i] = 2.0 * pi * np.floor(index / EVEN) + np.interp(index % EVEN, np.arange(EVEN + 1), table)
        rotations[i] -= 2.0 * pi * np.floor(rotations[i, 0] / (2.0 * pi))
    quality = np.full(len(curves), inf)
    quality[chosen] = misfit[chosen] * normal.weights.sum() / EVEN
    q = _pack_unknowns(links, bounded, scale, place, point)
    return Candidates(quality=quality, q=q, rotation=rotations, branch=branch)


def _place_open_paths(
    normal: Normal, limits: Limits, links: FloatArray, curves: ComplexArray, point: ComplexArray, branch: int
) -> Candidates:
    assert normal.points is not None
    k = PIECE
    shares = normal.shares
    even = np.interp(np.linspace(0.0, 1.0, k), shares, normal.points.real) + 1j * np.interp(
        np.linspace(0.0, 1.0, k), shares, normal.points.imag
    )
    goal = even - even.mean()
    best = np.empty((len(curves), 4))
    # if the links cannot be joined all round, a curve begins after the gap, so that its pieces end before the next gap
    gaps = ~np.isfinite(curves)
    first = np.where(gaps.any(axis=1), CURVE - np.argmax(gaps[:, ::-1], axis=1), 0)
    curves = np.take_along_axis(curves, (np.arange(CURVE) + first[:, None]) % CURVE, axis=1)
    match_windows(np.ascontiguousarray(curves), goal, STARTS, SPANS, best)
    chosen = np.argsort(best[:, 0])[:PLACED]
    chosen = chosen[np.isfinite(best[chosen, 0])]
    quality = np.full(len(curves), inf)
    q = np.zeros((len(curves), 11))
    rotations = np.zeros((len(curves), normal.n))
    for i in chosen:
        start, span, way = int(best[i, 1]), int(best[i, 2]), best[i, 3]
        part = curves[i, np.arange(start, start + span + 1) % CURVE]
        length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(part)))]) / np.abs(np.diff(part)).sum()
        angles = 2.0 * pi * np.arange(start + first[i], start + first[i] + span + 1) / CURVE
        at = shares if way > 0.0 else 1.0 - shares
        rotations[i] = np.interp(at, length, angles)
        piece = np.interp(at, length, part.real) + 1j * np.interp(at, length, part.imag)
        basis = np.stack([np.ones_like(piece), piece])[None]
        place, scale = _solve_projection(basis, normal.points, normal.weights)[0]
        bounded, scales = _clip_sizes(np.array([scale]), links[i : i + 1], point[i : i + 1], limits)
        if scales[0] != scale:
            place = (normal.weights * (normal.points - scales[0] * piece)).sum() / normal.weights.sum()
        quality[i] = (normal.weights * np.abs(place + scales[0] * piece - normal.points) ** 2).sum()
        q[i] = _pack_unknowns(links[i : i + 1], bounded, scales, np.array([place]), point[i : i + 1])[0]
    return Candidates(quality=quality, q=q, rotation=rotations, branch=branch)


def _clip_sizes(
    scale: ComplexArray, links: FloatArray, point: ComplexArray, limits: Limits
) -> tuple[FloatArray, ComplexArray]:
    """Clip the complex scales of m curves to the bounds of links and coupler point; return their magnitudes and the scales."""
    least, most = _size_range(links, limits)
    most = np.minimum(most, limits.high[6] / np.maximum(np.abs(point), 1e-300))
    size = np.abs(scale)
    bounded = np.clip(size, np.maximum(least, 1e-9), np.maximum(most, np.maximum(least, 1e-9)))
    return bounded, scale * bounded / np.maximum(size, 1e-300)


def _pack_unknowns(
    links: FloatArray, size: FloatArray, scale: ComplexArray, place: ComplexArray, point: ComplexArray
) -> FloatArray:
    """Return the unknowns of linkages, shape (m, 11), from sizes, scales, positions and coupler points."""
    zero, sized = np.zeros(len(links)), size[:, None] * links[:, :4]
    angles = [np.angle(scale), zero, np.angle(point), zero]
    return np.column_stack([place.real, place.imag, sized, size * np.abs(point), *angles])


def _resample_evenly(curves: ComplexArray, k: int) -> tuple[ComplexArray, FloatArray]:
    """Return k points at equal arc lengths on each of m closed curves, shape (m, k), and the crank rotations of these points.

    The points of ``curves`` are at equal crank rotations over a turn.
    """
    m, n = curves.shape
    ring = np.hstack([curves, curves[:, :1]])
    length = np.hstack([np.zeros((m, 1)), np.cumsum(np.abs(np.diff(ring, axis=1)), axis=1)])
    place = length[:, -1:] * np.arange(k) / k
    # the segment of each place, by one sorted search for all rows
    rows = np.arange(m)[:, None]
    offset = 2.0 * rows
    shares = length / length[:, -1:]
    index = np.searchsorted((shares + offset).ravel(), (place / length[:, -1:] + offset).ravel(), side="right") - 1
    index = np.clip(index.reshape(m, k) - rows * (n + 1), 0, n - 1)
    step = np.maximum(length[rows, index + 1] - length[rows, index], 1e-300)
    share = (place - length[rows, index]) / step
    points = (1.0 - share) * ring[rows, index] + share * ring[rows, index + 1]
    return points, 2.0 * pi * (index + share) / n


def _distinct_starts(found: list[Candidates], starts: int, limits: Limits) -> list[Start]:
    """Return the best candidates as starts, at most ``starts``; none of them is within `APART` of a better start."""
    best = [
        Start(
            q=c.q[i],
            branch=c.branch,
            quality=float(c.quality[i]),
            linkage=SliderCrank if limits.linkage is SliderCrank else Linkage,
            rotation=None if c.rotation is None else c.rotation[i],
            pivot=np.empty(0) if c.pivot is None else c.pivot[i],
        )
        for c in found
        for i in np.argsort(c.quality)[: 20 * starts]
        if np.isfinite(c.quality[i]) and np.isfinite(c.q[i]).all()
    ]

    def mark(start: Start) -> FloatArray:
        begin = start.q[8] if start.rotation is None else start.rotation[0]
        links = _SHAPES[limits.linkage.kind].ratios(start)
        if start.q[6] == 0.0:
            # with the coupler point on the crank pin, the other links do not affect the circle that it traces
            links = np.ones(len(links))
        second = (
            [log(start.pivot[0] / start.q[2]), cos(start.pivot[1]), sin(start.pivot[1])] if len(start.pivot) else []
        )
        return np.array([*np.log(links), cos(begin), sin(begin), 5.0 * start.branch, *second])

    return keep_distinct(sorted(best, key=lambda start: start.quality), mark, APART, starts)
