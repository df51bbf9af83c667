"""Find coexisting motions: all motions at each point of a plane, and the basin of attraction of each stable motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ...display import NotebookResult, format_count, format_turns
from ...files import Whole, unknown_name, write_csv
from ...mechanisms import Parameters
from ...run import takes_published
from ...units import Amount, pair
from ..motion.discretisation import OperatingPoint, OrbitError, operating_point
from ..motion.drive import SAME, Drive, assembly_ranges
from ..motion.flow import GAP, IN_LANES, PLAIN, TOLERANCE, VARIATIONAL, Flow, index, multipliers
from ..motion.orbit import PeriodicOrbit, require_turns, solve_orbit
from ..motion.search import Orbits, search_orbits, unsought_hint
from ..motion.variables import Plane
from . import kernels
from .grid import PointRow, compute_rows, grid_points, point_row, row_code, row_name
from .kernels import LOST, MOST_ORBITS, UNSETTLED, Motions, Points

FloatArray = NDArray[np.float64]
#: Number of guesses from which the motions of a point are sought, after the motions of its neighbour: a power of two.
STARTS = 16
#: Number of rows of a grid whose motions are sought at once, so that all lanes have work while the last search of a point ends.
_TOGETHER = 4
#: Number of samples of a turn from which an amplitude is computed.
SAMPLES = 64
#: For basins: distance from a motion below which the mechanism has settled on this motion, relative to the scale, and the same
#: relative to the distance of the nearest other motion; bound of the integrator's local error, relative to the least of these
#: distances; greatest number of turns.
_NEAR, _APART, _TOLERANCE, _TURNS = 1e-2, 0.2, 1e-4, 3000
#: Number by which `_measures` divides the monodromy matrices: deviations then decay even without damping, and the quadratic
#: form exists.
_GROWTH = 1.001
#: Default plane of basins: its width relative to the range of the motions, and the range relative to the scale below which a
#: coordinate counts as at rest.
_WIDTH, _REST = 1.5, 1e-9
#: Columns of the arrays with the motions of a point: largest multiplier, amplitude, index, first component of the start.
_LARGEST, _AMPLITUDE, _INDEX, _START = range(4)
# Functions of the flow for a search and for a basin, in addition to GAP
_SEARCHED = PLAIN, IN_LANES + VARIATIONAL, IN_LANES + GAP
_FOLLOWED = IN_LANES + PLAIN, IN_LANES + GAP


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Coexistence:
    """The periodic motions of one turn at every point of a grid.

    Attributes
    ----------
    x, y : ndarray, shapes (nx,) and (ny,)
        Values of the two parameters.
    largest : masked array, shape (ny, nx, k)
        Largest modulus of the Floquet multipliers of each motion. The up to k motions of a point are sorted by amplitude;
        entries after the last motion are masked.
    amplitude : masked array, shape (ny, nx, k)
        Half the range of the first free coordinate, such as a slider position (m).
    starts : ndarray, shape (ny, nx, k, n)
        y at crank angle 0; NaN after the last motion.
    index : ndarray of int, shape (ny, nx)
        Sum of the indices of the motions: see `Orbits.index`.
    index_of_all : int
        Value of ``index`` if no motion is missing, unless motions are lost at the limit of assembly.
    swing : (str, str)
        Name and unit of the coordinate whose amplitude is given.
    computed : int
        Number of rows that were not in the cache.
    """

    x: FloatArray
    y: FloatArray
    largest: np.ma.MaskedArray[Any, np.dtype[np.float64]]
    amplitude: np.ma.MaskedArray[Any, np.dtype[np.float64]]
    starts: FloatArray
    index: NDArray[np.int64]
    index_of_all: int
    swing: tuple[str, str]
    computed: int

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of motions found at each point, shape (ny, nx)."""
        return np.asarray(self.largest.count(axis=2))

    @property
    def stable(self) -> NDArray[np.int64]:
        """Number of stable motions found at each point, shape (ny, nx)."""
        return np.asarray(self._is_stable.sum(axis=2))

    @property
    def _is_stable(self) -> NDArray[np.bool_]:
        """Whether each motion is stable, shape (ny, nx, k)."""
        return np.asarray(np.ma.filled(self.largest < 1.0 - TOLERANCE, False))

    @property
    def least(self) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        """Least amplitude of the stable motions at each point, shape (ny, nx)."""
        return self._extreme(np.ma.min)

    @property
    def greatest(self) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        """Greatest amplitude of the stable motions at each point, shape (ny, nx)."""
        return self._extreme(np.ma.max)

    def _extreme(self, reduce: Callable[..., Any]) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        stable = np.ma.masked_where(~self._is_stable, self.amplitude)
        return np.ma.masked_invalid(reduce(stable, axis=2).filled(np.nan))

    def to_csv(self, path: str | Path) -> Path:
        """Write the grid as a CSV table with one row per point, in SI units."""
        columns = {
            "x": np.tile(self.x, len(self.y)),
            "y": np.repeat(self.y, len(self.x)),
            "motions found": self.count.ravel().astype(float),
            "stable motions found": self.stable.ravel().astype(float),
            "amplitude of the smallest stable motion": self.least.filled(np.nan).ravel(),
            "amplitude of the largest stable motion": self.greatest.filled(np.nan).ravel(),
            "sum of the indices": self.index.ravel().astype(float),
        }
        return write_csv(path, columns)


def coexistence(
    operation: Plane,
    x: ArrayLike,
    y: ArrayLike,
    *,
    start: ArrayLike | None = None,
    folder: str | Path | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
    what: str = "motions",
) -> Coexistence:
    """Find all periodic motions of one turn at every point of a grid over two parameters.

    Newton's method starts from the motions of the neighbouring point in the row, then from `STARTS` guesses, with the known
    motions divided out. Where the sum of the indices shows that a motion is missing, the search starts from the motions of the
    neighbouring points, too. A motion that exists only in a short part of a row may still be missed; `find_orbits` searches a
    point closely. An undriven link that has a ratio in the drive goes round in all these motions; any other undriven link only
    swings. `find_orbits` finds motions of both kinds. The rows are distributed over workers and kept as in `grid`.

    Parameters
    ----------
    operation : callable
        See `plane`.
    x, y : array_like, shapes (nx,) and (ny,)
        See `grid`.
    start : array_like, shape (n,), optional
        A further guess; under a torque it is required, as it gives the crank speed, unless the speed follows from a motor.
    folder, n_jobs, progress, what
        See `grid`.

    Raises
    ------
    InputError
        If an axis is empty or not finite, or ``n_jobs`` is not usable.
    ParameterError
        If a text on an axis is not a quantity.
    GridInterrupted
        On Ctrl-C.
    """
    xs, ys, rows, guesses = grid_points(operation, x, y, start, STARTS)
    code = row_code(kernels.solve_all)
    data, computed = compute_rows(
        partial(_compute_motions, guesses),
        rows,
        [row_name(row, guesses, (*_SEARCHED, GAP), code) for row in rows],
        (len(xs), MOST_ORBITS, _START + guesses.shape[1]),
        kernels.solve_all,
        folder=folder,
        n_jobs=n_jobs,
        progress=progress,
        what=what,
        together=_TOGETHER,
    )
    whole = rows[0].flow.index_of_all
    _seek_from_neighbours(operation, xs, ys, data, whole)
    return Coexistence(
        x=xs,
        y=ys,
        largest=np.ma.masked_invalid(data[..., _LARGEST]),
        amplitude=np.ma.masked_invalid(data[..., _AMPLITUDE]),
        starts=data[..., _START:],
        index=_indices(data),
        index_of_all=whole,
        swing=rows[0].flow.components[0],
        computed=computed,
    )


def _compute_motions(guesses: FloatArray, rows: Sequence[PointRow]) -> FloatArray:
    """Compute the motions at the m points of each row, shape (rows, m, MOST_ORBITS, n + 3).

    ``guesses`` are guesses of y, shape (count, n). The last axis has the largest multiplier, the amplitude, the index and the
    start. The motions of a point are sorted by amplitude; entries after the last motion are NaN.
    """
    first, m = rows[0], rows[0].scales.shape[0]
    if any((row.flow, row.switched) != (first.flow, first.switched) for row in rows):
        return np.vstack([_compute_motions(guesses, [row]) for row in rows])
    count, n = m * len(rows), first.flow.size
    samples = SAMPLES * first.flow.turns
    starts, monodromies, swings = (np.full((count, MOST_ORBITS, size), np.nan) for size in (n, n * n, samples))
    counts = np.zeros(count, dtype=np.int64)
    section = first.first.section(guesses[0], *_SEARCHED, switched=first.switched)
    angles = np.linspace(0.0, first.flow.period, samples, endpoint=False)
    points = Points(*map(np.vstack, zip(*[row.points() for row in rows])))
    kernels.solve_all(section, points, first.search(), m, angles, guesses, Motions(starts, monodromies, swings, counts))
    largest, signs = np.full((2, count, MOST_ORBITS), np.nan)
    found = np.arange(MOST_ORBITS) < counts[:, None]
    of = monodromies[found].reshape(-1, n, n)
    largest[found] = np.abs(multipliers(of))[:, 0]
    signs[found] = index(of)
    # evaluate the Fourier series of the samples on a finer grid, as in `Turn.amplitude`
    fine = np.fft.irfft(np.fft.rfft(swings, axis=2), 8 * samples, axis=2) * 8.0
    amplitude = 0.5 * np.ptp(fine, axis=2)
    order = np.argsort(np.where(found, amplitude, np.inf), axis=1, kind="stable")
    amplitude[~found] = np.nan
    whole = np.concatenate([largest[..., None], amplitude[..., None], signs[..., None], starts], axis=2)
    return np.take_along_axis(whole, order[:, :, None], axis=1).reshape(len(rows), m, MOST_ORBITS, _START + n)


def _indices(data: FloatArray) -> NDArray[np.int64]:
    """Return the sum of the indices of the motions at each point; ``data`` is the result of `_compute_motions`."""
    return np.nansum(data[..., _INDEX], axis=2).astype(np.int64)


def _seek_from_neighbours(operation: Plane, xs: FloatArray, ys: FloatArray, data: FloatArray, whole: int) -> None:
    """Add motions to points whose indices do not add up to ``whole``, sought from the motions of neighbouring points.

    A neighbouring point is used if it has more motions than the point itself, or if its own indices add up to ``whole``.
    """
    # points whose motions have not been tried at the points beside them
    fresh = np.ones(data.shape[:2], dtype=bool)
    while fresh.any():
        tried, fresh = fresh, np.zeros_like(fresh)
        sums, counts = _indices(data), np.isfinite(data[..., _LARGEST]).sum(axis=2)
        for j, i in zip(*np.nonzero(sums != whole)):
            point = operating_point(*operation(float(xs[i]), float(ys[j])))
            for row, column in product((j - 1, j, j + 1), (i - 1, i, i + 1)):
                if not (0 <= row < len(ys) and 0 <= column < len(xs) and tried[row, column]):
                    continue
                if counts[row, column] and (counts[row, column] > counts[j, i] or sums[row, column] == whole):
                    starts = data[row, column, : counts[row, column], _START:]
                    fresh[j, i] |= _add_motions(point, starts, data[j, i], whole)


def _add_motions(point: OperatingPoint, starts: FloatArray, into: FloatArray, whole: int) -> bool:
    """Add motions to a point, sought from the motions ``starts`` of a neighbour, until the indices add up to ``whole``.

    For each motion of the point, the nearest of ``starts`` is skipped: it is probably the same motion. Return whether a motion
    was added. ``into`` is the point's part of the result of `_compute_motions`.
    """
    count = before = int(np.isfinite(into[:, _LARGEST]).sum())
    away = np.abs(point.flow.remove_turns(into[:count, None, _START:] - starts) / point.scale(starts[0])).max(axis=2)
    for start in np.delete(starts, away.argmin(axis=1), axis=0):
        if count == MOST_ORBITS or int(np.nansum(into[:, _INDEX])) == whole:
            break
        try:
            orbit = solve_orbit(point, 1, start)
        except OrbitError:
            continue
        if all(orbit.distance(known) > SAME for known in into[:count, _START:]):
            head = orbit.largest, orbit.amplitude, index(orbit.monodromy)
            into[count] = *head, *point.flow.nearest_to_rest(orbit.start)
            count += 1
    into[:count] = into[np.argsort(into[:count, _AMPLITUDE], kind="stable")]
    return count > before


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Basins(NotebookResult):
    """Basins of attraction: for each initial state at crank angle 0, the motion on which the mechanism settles.

    Attributes
    ----------
    position, rate : ndarray, shapes (nx,) and (ny,)
        Initial values of a free coordinate (m for a slider) and of its rate (m/s); the other components of the initial state y
        have the values of the first motion, see ``fixed``.
    ends : ndarray of int, shape (ny, nx)
        Index of the stable motion in ``motions``; -1 if the links reach the limit of assembly, -2 if the mechanism settles on
        no motion within the computed number of turns.
    found : Orbits
        All motions found, also the unstable motions, which lie on the boundaries of the basins.
    computed : int
        Number of rows that were not in the cache.
    place : int
        Index of the coordinate in y.
    """

    position: FloatArray
    rate: FloatArray
    ends: NDArray[np.int64]
    found: Orbits
    computed: int
    place: int = 0

    def __repr__(self) -> str:
        shares = [f"{self.share(number):.1%} to motion {number + 1}" for number in range(len(self.motions))]
        lost = f", {self.share(LOST):.1%} to the limit of assembly"
        rest = f", {self.share(UNSETTLED):.1%} to none of them" if (self.ends == UNSETTLED).any() else ""
        motions = format_count(len(self.motions), "stable motion")
        return f"<Basins: {motions}, {len(self.position)} x {len(self.rate)} starts: {', '.join(shares)}{lost}{rest}>"

    @property
    def motions(self) -> tuple[PeriodicOrbit, ...]:
        """The stable motions, the smallest first."""
        return self.found.stable

    def share(self, end: int) -> float:
        """Return the share of the initial states that end as ``end``: an index into ``motions``, or -1 or -2 as in ``ends``."""
        return float(np.mean(self.ends == end))

    def to_csv(self, path: str | Path) -> Path:
        """Write the basins as a CSV table with one row per initial state."""
        position, rate = self.labels
        columns = {
            position: np.tile(self.position, len(self.rate)),
            rate: np.repeat(self.rate, len(self.position)),
            "motion (1 and on; 0: limit of assembly; -1: none)": self.ends.ravel() + 1.0,
        }
        return write_csv(path, columns)

    @property
    def fixed(self) -> tuple[str, ...]:
        """FMI names of the coordinates and rates that are the same at all starts: they are taken from the first motion.

        A motion that differs from the first motion only in these components may not be reached: a pendulum exactly at rest
        begins to swing only because of rounding errors.
        """
        plane = [name for name, _ in self._components()]
        return tuple(name for name, _ in self.motions[0].flow.components if name not in plane)

    def _components(self) -> tuple[tuple[str, str], tuple[str, str]]:
        flow = self.motions[0].flow
        return flow.components[self.place], flow.components[flow.size // 2 + self.place]

    @property
    def labels(self) -> tuple[str, str]:
        """Names of the two axes, the coordinate and its rate, with units."""
        (name, unit), (rate, rate_unit) = self._components()
        return f"{name} [{unit}]", f"{rate} [{rate_unit}]"


@takes_published()
def basins(
    parameters: Parameters,
    drive: Drive,
    *,
    turns: int = 1,
    points: int = 200,
    coordinate: str | None = None,
    position: tuple[Amount, Amount] | None = None,
    rate: tuple[Amount, Amount] | None = None,
    start: ArrayLike | None = None,
    found: Orbits | None = None,
    folder: str | Path | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> Basins:
    """Compute basins of attraction: the stable periodic motion on which each initial state of a grid settles.

    Parameters
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    turns : int
        Greatest number of turns in the period of the motions that are sought.
    points : int
        Number of initial states along each axis.
    coordinate : str, optional
        FMI name of the free coordinate that varies with its rate, such as "swing.angle"; all other components of y have the
        values of the first motion. By default the coordinate in which the stable motions differ most; if a range is given, the
        first.
    position, rate : (float, float), optional
        Ranges of the coordinate and of its rate at crank angle 0, in SI or as text such as "5 mm"; by default one and a half
        times the range in which the motions found move, as far as the links can be joined.
    start : array_like, shape (n,), optional
        A guess of y that includes the crank speed, for a crank driven by a torque; see `find_orbits`.
    found : Orbits, optional
        Result of `find_orbits` for these parameters and this drive; the motions are then not sought again.
    folder, n_jobs, progress
        See `grid`.

    Raises
    ------
    InputError
        If the drive is not a `Drive`, there is no stable motion or no such coordinate, a range does not increase, or ``n_jobs``
        is not usable.
    ParameterError
        If a range is not two quantities, or ``turns`` or ``points`` is not a whole number.
    GridInterrupted
        On Ctrl-C; the same call, made again, continues from the rows that were finished.

    Examples
    --------
    >>> from analysis.periodic import Drive, basins
    >>> found = basins("rig-1-spring-b", Drive(speed="1000 rpm"), points=20)
    >>> len(found.motions), found.share(0) > found.share(1) > 0.0
    (2, True)
    """
    require_turns(turns)
    points, point = Whole(least=1)(points, "points"), operating_point(parameters, drive)
    flow = point.flow
    half, place = flow.size // 2, find_coordinate(flow, coordinate)
    if position is not None:
        position = pair(position, flow.components[place][1], "position")
    if rate is not None:
        rate = pair(rate, flow.components[half + place][1], "rate")
    if found is None:
        found = search_orbits(parameters, drive, turns=range(1, turns + 1), start=start)
    motions = found.stable
    if not motions:
        raise InputError(
            f"no stable motion of {describe_turns(flow, turns)} was found here, so that there are no basins"
            + unsought_hint(parameters, drive)
            + (found.reason and f": {found.reason}")
        )
    if coordinate is None and position is None and rate is None:
        place = _most_different([_path(orbit) for orbit in motions], motions[0].scale)
    default = _default_plane(parameters, drive, motions[0], np.vstack([_path(orbit) for orbit in found.orbits]), place)
    spans = position or default[0], rate or default[1]
    for name, (low, high) in zip(("position", "rate"), spans):
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise InputError(f"the range of the {name} is {low} to {high}: it must be finite and increasing")
    across, up = (np.linspace(low, high, points) for low, high in spans)
    # a start may settle on a motion of several turns at the beginning of any of its turns
    passed = [orbit.passages() for orbit in motions]
    known, owner = np.vstack(passed), np.repeat(np.arange(len(motions)), [len(starts) for starts in passed])
    row, measures, code = point_row([point], known[0]), _measures(point, found), row_code(kernels.settle_starts)
    ends, computed = compute_rows(
        partial(_ends, point, known, measures, place, across),
        up.tolist(),
        [
            row_name(row, known, (*_FOLLOWED, GAP), code, *measures.ravel(), place, *across, value)
            for value in up.tolist()
        ],
        (points,),
        kernels.settle_starts,
        folder=folder,
        n_jobs=n_jobs,
        progress=progress,
        what="starts",
    )
    met = ends.astype(np.int64)
    met[met >= 0] = owner[met[met >= 0]]
    return Basins(position=across, rate=up, ends=met, found=found, computed=computed, place=place)


def _measures(point: OperatingPoint, found: Orbits) -> FloatArray:
    """Return a matrix for each passage of the stable motions at crank angle 0, shape (k, n, n): see `kernels.settle_starts`.

    The distance from a motion is measured by Lyapunov's quadratic form, which falls from period to period. In the direction in
    which the form is least, this distance equals the distance in units of the scale of y. The scale alone is no measure: if a
    free vibration is much slower than the crank, equal deviations of position and of rate, in units of the scale, may cause
    amplitudes of which one is a hundred times the other.
    """
    passed, measures = {id(orbit): orbit.passages() for orbit in found.orbits}, []
    scale, unit = point.scale(found.orbits[0].start), np.eye(point.flow.size)
    for orbit in found.stable:
        others = np.vstack([np.empty((0, len(scale))), *(starts for of, starts in passed.items() if of != id(orbit))])
        for start in passed[id(orbit)]:
            decay = point.period(start, orbit.periods).monodromy * scale / scale[:, None] / _GROWTH
            form = scipy.linalg.solve_discrete_lyapunov(decay.T, unit)
            measure = np.linalg.cholesky(form / np.linalg.eigvalsh(form)[0]).T / scale
            apart = np.linalg.norm(point.flow.remove_turns(others - start) @ measure.T, axis=1)
            measures.append(measure / min(_NEAR, _APART * apart.min(initial=np.inf)))
    return np.array(measures)


def find_coordinate(flow: Flow, name: str | None) -> int:
    """Return the index in y of the free coordinate with this FMI name, or of the first free coordinate if the name is None.

    Raises InputError if no free coordinate has this name, or if nothing but the crank is free.
    """
    free = [component for component, _ in flow.components[: flow.size // 2]]
    if not free:
        raise InputError(
            f"the {flow.mechanism.name} has no free coordinate other than the crank's angle, so that starts differ only in the "
            "crank speed: use find_orbits to find the motions from a start"
        )
    if name is not None and name not in free:
        raise unknown_name(name, free, f"free coordinate {name!r}")
    return 0 if name is None else free.index(name)


def _path(orbit: PeriodicOrbit) -> FloatArray:
    """Return samples of y over the period, shape (m, n), with angles that begin at most half a turn from `Flow.rest`."""
    flow, n = orbit.flow, SAMPLES * orbit.turns
    y = orbit.sample(np.linspace(0.0, flow.period * orbit.turns, n, endpoint=False))[:, list(flow.places)]
    return np.asarray(y - flow.whole_turns(y[0] - flow.rest))


def _most_different(moved: Sequence[FloatArray], scale: FloatArray) -> int:
    """Return the index of the coordinate for which motions differ most, in the coordinate or in its rate.

    ``moved`` are samples of y for each motion. The measure is the range of all motions together, divided by the range of the
    motion that moves least. It is very large for a pendulum that hangs still in one motion and swings in another; starts with
    the pendulum at rest do not lead to the latter.
    """
    least = np.min([np.ptp(y, axis=0) for y in moved], axis=0)
    ratio, half = (np.ptp(np.vstack(moved), axis=0) + _REST * scale) / (least + _REST * scale), len(scale) // 2
    return int(np.argmax(np.maximum(ratio[:half], ratio[half : 2 * half])))


def _default_plane(
    parameters: Parameters, drive: Drive, first: PeriodicOrbit, moved: FloatArray, place: int
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ranges of a coordinate and of its rate in a plane of starts: `_WIDTH` times the ranges of the motions.

    ``moved`` are samples of y of all motions, ``first`` is the first motion, and ``place`` the index of the coordinate in y.
    The range of the coordinate ends where the links can no longer be joined. In two cases it is instead the largest range,
    symmetric about the initial value, in which they can be joined: if the coordinate is at rest in all motions, and for an
    angle whose range would end at such a limit. If the rate is zero in all motions, its range is that of an oscillation
    through the range of the coordinate at the frequency of the crank.
    """
    lowest, highest = (float(side[place]) for side in assembly_ranges(parameters, drive, first.start))
    rest, scale, rates = float(first.flow.rest[place]), first.scale, place + len(first.start) // 2
    middle, half = 0.5 * (moved.max(axis=0) + moved.min(axis=0)), 0.5 * _WIDTH * np.ptp(moved, axis=0)
    still = half <= _REST * scale
    low, high = max(lowest, middle[place] - half[place]), min(highest, middle[place] + half[place])
    if still[place] or (first.flow.angle_periods[place] > 0.0 and (low == lowest or high == highest)):
        extent = min(rest - lowest, highest - rest)
        low, high = rest - extent, rest + extent
    reach = scale[rates] / scale[place] * 0.5 * (high - low) if still[rates] else half[rates]
    return (float(low), float(high)), (float(middle[rates] - reach), float(middle[rates] + reach))


def describe_turns(flow: Flow, turns: int) -> str:
    """Return the number of crank turns in up to ``turns`` common periods, in words: "one turn", "up to 4 turns"."""
    return ("" if turns == 1 else "up to ") + format_turns(turns * flow.turns)


def _ends(
    point: OperatingPoint,
    known: FloatArray,
    measures: FloatArray,
    place: int,
    across: FloatArray,
    rates: Sequence[float],
) -> FloatArray:
    """Return for each start the index in ``known`` of the motion on which the mechanism settles, or LOST or UNSETTLED.

    Each start is the start of the first known motion, but with a value of ``across``, shape (points,), for the coordinate with
    the index ``place`` in y, and with a value of ``rates`` for its rate, which is the same in a row. ``measures`` is the result
    of `_measures`.
    """
    starts = np.tile(known[0], (len(rates) * len(across), 1))
    starts[:, place] = np.tile(across, len(rates))
    starts[:, point.flow.size // 2 + place] = np.repeat(rates, len(across))
    ends = np.zeros(len(starts), dtype=np.int64)
    near = 1.0 / float(np.linalg.norm(measures * point.scale(known[0]), ord=2, axis=(1, 2)).max())
    section = point.section(known[0], *_FOLLOWED, tolerance=_TOLERANCE * near)
    kernels.settle_starts(section, point.flow.period, _TURNS, starts, known, measures, ends)
    return ends.reshape(len(rates), -1).astype(float)
