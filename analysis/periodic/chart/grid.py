"""Compute grids of the largest Floquet multiplier, one periodic orbit per point, on all cores; rows are kept on disk."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, Interrupted
from linkwork.parameters import field_name

from ...files import load_array, save_array
from ...mechanisms import Parameters, find_mechanism
from ...numerics.cache import cache_root
from ...numerics.codegen import fingerprint
from ...numerics.workers import check_jobs, record_interrupts, run_in_parallel, worker_count
from ...run import show_progress
from ...run.varied import VariedSequence, array_functions, check_sets, varied_constants
from ...units import si
from ..motion import TOLERANCE, Drive, Plane, Stability, multipliers, spread_starts
from ..motion.discretisation import INTEGRATOR_TOLERANCE, OperatingPoint, can_collocate, operating_point
from ..motion.flow import GAP, IN_LANES, PLAIN, VARIATIONAL, Flow
from ..motion.kernels import REASONS, Status
from ..motion.orbit import MOST_ITERATIONS, SEARCH_TOLERANCE, first_guess
from ..motion.variables import NamedPlane, parameter_places, parameter_unit
from . import kernels
from .kernels import Points, Row, Search

FloatArray = NDArray[np.float64]
Item = TypeVar("Item")
#: Number of starts from which the orbit of a point is sought if it is not found from its neighbour: a power of two.
STARTS = 32
# Functions of the flow that find an orbit, in addition to GAP
_USED = PLAIN, VARIATIONAL, IN_LANES + VARIATIONAL, IN_LANES + GAP


def largest_multipliers(
    rows: Sequence[Parameters], drives: Sequence[Drive], guesses: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Compute the largest Floquet multiplier of the periodic orbit of each mechanism in a row.

    Newton's method starts from the orbit of the neighbouring mechanism, then from the guesses; neighbours in the sequence
    should therefore have similar parameters.

    Parameters
    ----------
    rows, drives : sequences of length m
        Parameters and drive of each mechanism.
    guesses : array_like, shape (n,) or (k, n), optional
        Guess of y for the first mechanism, and further guesses that are used if the first leads to no orbit; see `find_orbit`.

    Returns
    -------
    values : ndarray, shape (m,)
        Largest modulus of the multipliers; NaN if no orbit was found.
    starts : ndarray, shape (m, n)
        y at crank angle 0; NaN if no orbit was found.
    status : ndarray of int, shape (m,)
        `kernels.Status`: 0 if an orbit was found.
    """
    points = [operating_point(parameters, drive) for parameters, drive in zip(rows, drives)]
    given = (None,) if guesses is None else np.atleast_2d(np.asarray(guesses, dtype=float))
    starting = np.array([first_guess(points[0].flow, drives[0], guess) for guess in given])
    return _solve_row(point_row(points, starting[0]), starting, INTEGRATOR_TOLERANCE)


def _solve_row(
    row: PointRow, guesses: FloatArray, tolerance: float
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return the largest multipliers, the starts and the status of the orbits of a row: see `largest_multipliers`."""
    m, n = row.scales.shape
    section = row.first.section(guesses[0], *_USED, tolerance=tolerance, switched=row.switched)
    found = Row(np.full((m, n), np.nan), np.full((m, n * n), np.nan), np.zeros(m, dtype=np.int64))
    kernels.solve_row(section, row.points(), row.search(1), guesses, found)
    values = np.full(m, np.nan)
    good = found.status == Status.DONE
    if good.any():
        values[good] = np.abs(multipliers(found.monodromies[good].reshape(-1, n, n)))[:, 0]
    return values, found.starts, found.status


class GridInterrupted(Interrupted):
    """The computation of a grid was interrupted; the finished rows are kept, and the same call continues from them.

    Attributes
    ----------
    done, rows : int
        Number of finished rows, and number of all rows.
    """

    def __init__(self, done: int, rows: int, folder: Path) -> None:
        self.done = done
        self.rows = rows
        super().__init__(
            f"interrupted with {done} of {rows} rows done, which are kept in {folder}: call again to go on"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """The largest Floquet multiplier of the periodic orbit at each point of a grid.

    Attributes
    ----------
    x, y : ndarray, shapes (nx,) and (ny,)
        Values of the two parameters.
    largest : masked array, shape (ny, nx)
        Largest modulus of the Floquet multipliers; masked if no orbit was found.
    starts : ndarray, shape (ny, nx, n)
        Starts of the orbits, see `PeriodicOrbit`; NaN where no orbit was found.
    status : ndarray of int, shape (ny, nx)
        `kernels.Status`: 0 if an orbit was found, otherwise the reason why not.
    computed : int
        Number of rows that were not in the cache.
    """

    x: FloatArray
    y: FloatArray
    largest: np.ma.MaskedArray[Any, np.dtype[np.float64]]
    starts: FloatArray
    status: NDArray[np.int64]
    computed: int

    def reason(self, row: int, column: int) -> str:
        """Return the reason why no orbit was found at a point; empty if an orbit was found."""
        return REASONS.get(Status(self.status[row, column]), "")

    def nearby_starts(self, x: float, y: float) -> FloatArray:
        """Return the starts of the orbits at up to nine grid points around (x, y), roughly the nearest first; shape (k, n)."""
        across, up = (np.argsort(np.abs(axis - value))[:3] for axis, value in ((self.x, x), (self.y, y)))
        starts = self.starts[np.ix_(up, across)].reshape(-1, self.starts.shape[-1])
        return starts[~np.isnan(starts).any(axis=1)]

    def stability(self, tolerance: float = TOLERANCE) -> NDArray[Any]:
        """Return the `Stability` of the orbit at each point, None where there is no orbit; object array, shape (ny, nx)."""
        margin = 1.0 - self.largest.filled(np.nan)
        result = np.full(margin.shape, Stability.MARGINAL, dtype=object)
        result[margin > tolerance] = Stability.STABLE
        result[margin < -tolerance] = Stability.UNSTABLE
        result[np.isnan(margin)] = None
        return result


def grid_folder() -> Path:
    """Return the folder in which rows of grids are kept, next to the compiled code."""
    return cache_root() / "grids"


def grid(
    operation: Plane,
    x: ArrayLike,
    y: ArrayLike,
    *,
    start: ArrayLike | None = None,
    tolerance: float = INTEGRATOR_TOLERANCE,
    folder: str | Path | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
    what: str = "filling in the stability chart",
) -> Grid:
    """Compute the largest Floquet multiplier of the periodic orbit at every point of a grid.

    The rows are distributed over workers. Each row is stored in a file of the cache; the name of the file is a hash of all that
    the row depends on: mechanisms, drives, guess, tolerance and machine code. After an interruption the same call continues
    from the rows in the cache.

    Parameters
    ----------
    operation : callable
        Function that returns mechanism and drive at a point of the plane: see `plane`.
    x, y : array_like, shapes (nx,) and (ny,)
        Values of the two parameters: in SI, or as texts with units if the plane is a `NamedPlane`.
    start : array_like, shape (n,), optional
        Guess of the first orbit of each row; see `find_orbit`. If this guess leads to no orbit, others are tried.
    tolerance : float
        Bound of the integrator's local error.
    folder : path, optional
        Folder of the cache; `grid_folder` by default.
    n_jobs : int, optional
        Number of processes; -1 for one per core. Inside `joblib.parallel_config` of a cluster the default is all cores of the
        cluster.
    progress : bool
        Show a progress bar.
    what : str
        Text before the progress bar.

    Raises
    ------
    InputError
        If an axis is empty or not finite, or ``n_jobs`` is not usable.
    ParameterError
        If the parameters at a point are not valid, or a text on an axis is not a quantity.
    GridInterrupted
        On Ctrl-C.
    """
    xs, ys, rows, guesses = grid_points(operation, x, y, start, STARTS)
    code = row_code(kernels.solve_row, multipliers)
    data, computed = compute_rows(
        partial(_compute_row, guesses, tolerance),
        rows,
        [row_name(row, guesses, (*_USED, GAP), code, tolerance) for row in rows],
        (len(xs), guesses.shape[1] + 2),
        kernels.solve_row,
        folder=folder,
        n_jobs=n_jobs,
        progress=progress,
        what=what,
    )
    status = data[..., -1].astype(np.int64)
    largest = np.ma.MaskedArray(data[..., 0], mask=status != Status.DONE)
    return Grid(x=xs, y=ys, largest=largest, starts=data[..., 1:-1], status=status, computed=computed)


def _compute_row(guesses: FloatArray, tolerance: float, rows: Sequence[PointRow]) -> FloatArray:
    """Compute rows of a grid, shape (rows, m, n + 2): largest multiplier, start and status of the orbit at each point."""
    return np.array([np.column_stack(_solve_row(row, guesses, tolerance)) for row in rows])


# The operating points of a row in arrays, for the kernels that solve the row


@dataclass(frozen=True, slots=True, eq=False)
class PointRow:
    """The m operating points of a row of a chart, which share a flow."""

    first: OperatingPoint  # the first point
    constants: FloatArray  # constants of the equations of each point, shape (m, constants)
    vectors: FloatArray  # drive vectors, `Drive.vector`, (m, drive)
    scales: FloatArray  # magnitudes of y, (m, n)
    smooth: bool  # whether collocation can be used at all points

    @property
    def flow(self) -> Flow:
        """The flow of the mechanism that all the points share."""
        return self.first.flow

    @property
    def switched(self) -> bool:
        """Whether the mechanism's switch (friction by joint forces) is on at any point: see `Mechanism.is_switched_on`."""
        place = self.first.mechanism.switch_index
        return place >= 0 and bool(self.constants[:, place].any())

    def points(self) -> Points:
        """Return the data of the points as arrays for the kernels."""
        numbers, drives = (np.hstack([a, np.zeros_like(a)]) for a in (self.constants, self.vectors))
        return Points(numbers, drives, self.scales)

    def search(self, turns: int = 1) -> Search:
        """Return the settings of the search for orbits whose period has ``turns`` common periods."""
        return Search(self.flow.period * turns, turns, MOST_ITERATIONS, SEARCH_TOLERANCE, self.smooth)


def point_row(points: Sequence[OperatingPoint], start: FloatArray) -> PointRow:
    """Collect operating points in a row; the magnitudes of y are computed from the guess ``start``.

    Raises InputError if the points do not all have the same kind of drive.
    """
    if any(point.flow is not points[0].flow for point in points):
        raise InputError(
            "the points of a row differ in the kind of drive (speed or torque), in modes or in ratios: these must be the same"
        )
    return PointRow(
        points[0],
        np.array([point.constants for point in points]),
        np.array([point.vector for point in points]),
        np.array([point.scale(start) for point in points]),
        can_collocate([point.drive for point in points], [point.parameters for point in points]),
    )


def grid_rows(operation: Plane, xs: FloatArray, ys: FloatArray, start: FloatArray) -> list[PointRow]:
    """Return the rows of operating points of a grid; in a `NamedPlane` the data of a whole row are computed at once."""
    if isinstance(operation, NamedPlane):
        return [_named_row(operation, xs, y, start) for y in ys.tolist()]
    return [point_row([operating_point(*operation(x, y)) for x in xs.tolist()], start) for y in ys.tolist()]


def _named_row(operation: NamedPlane, xs: FloatArray, y: float, start: FloatArray) -> PointRow:
    """Return the row of a `NamedPlane` at one value ``y`` of the second parameter."""
    first = operating_point(*operation(float(xs[0]), y))
    flow, mechanism = first.flow, first.mechanism
    vectors = np.tile(first.vector, (len(xs), 1))
    sets: Sequence[Parameters] = [first.parameters]
    # checking the two ends is enough: if the drive rejects a value, or a friction is not zero, this happens at an end
    ends = [operating_point(*operation(x, y)) for x in (float(xs.min()), float(xs.max()))]
    factors = parameter_places(flow, first.drive, operation.x)
    if factors is None:
        sets = VariedSequence(first.parameters, {field_name(operation.x): xs}, replace)
        check_sets(mechanism, sets)
    else:
        for place, factor in factors.items():
            vectors[:, place] = factor * xs
    parameters, columns = varied_constants(mechanism, sets)
    states = flow.state(start, vectors.T)
    scale = array_functions(mechanism)[0].find(mechanism.error_scale)(parameters, states)
    constants, scales = np.empty((len(xs), len(columns))), np.empty((len(xs), flow.size))
    for n, column in enumerate(columns):
        constants[:, n] = column
    for n, place in enumerate(flow.places):
        scales[:, n] = scale[place]
    serves = can_collocate([end.drive for end in ends], [end.parameters for end in ends])
    return PointRow(first, constants, vectors, scales, serves)


# Rows over workers, kept on disk


def grid_points(
    operation: Plane, x: ArrayLike, y: ArrayLike, start: ArrayLike | None, count: int
) -> tuple[FloatArray, FloatArray, list[PointRow], FloatArray]:
    """Return the values of x and y of a grid, its rows of operating points, and the guesses for each row, shape (k, n).

    ``count`` is the number of guesses in a set of `spread_starts`. Raises InputError if an axis is empty or not finite,
    ParameterError if a text on an axis is not a quantity.
    """
    if isinstance(operation, NamedPlane):
        mechanism = find_mechanism(operation.parameters)
        x, y = (si(axis, parameter_unit(mechanism, name), name) for axis, name in ((x, operation.x), (y, operation.y)))
    xs, ys = _axis("x", x), _axis("y", y)
    first = operating_point(*operation(float(xs[0]), float(ys[0])))
    guess = first_guess(first.flow, first.drive, start)
    starts = np.vstack([guess, spread_starts(first.parameters, first.drive, guess, count)])
    return xs, ys, grid_rows(operation, xs, ys, guess), starts


def _axis(name: str, values: ArrayLike) -> FloatArray:
    """Return the values of an axis as an array; raise InputError if the axis is empty or a value is not a finite number."""
    with suppress(TypeError, ValueError):
        axis = np.array(values, dtype=float, ndmin=1)
        if axis.ndim == 1 and len(axis) > 0 and np.isfinite(axis).all():
            return axis
    raise InputError(f"the axis {name} of a grid is {values!r:.200}: it must be finite numbers, at least one")


def row_code(*functions: Any) -> tuple[str, ...]:
    """Return texts that identify the code: the fingerprints of ``functions``, and all source texts of this package."""
    sources = (path.read_text(encoding="utf-8") for path in sorted(Path(__file__).parents[1].rglob("*.py")))
    return *map(fingerprint, functions), *sources


def row_name(row: PointRow, guesses: FloatArray, functions: Sequence[int], code: Sequence[str], *numbers: float) -> str:
    """Return the name of a row in the cache: a hash of all that the row depends on.

    ``guesses`` are guesses of y, shape (k, n); ``functions`` are the indices of the flow's functions that are called; ``code``
    is the result of `row_code`; ``numbers`` are further numbers that the row depends on.
    """
    flow, bound = row.flow, row.flow.mechanism.greatest_rotation
    digest = hashlib.sha256(" ".join((flow.fingerprint(*functions, switched=row.switched), *code)).encode())
    digest.update(np.hstack([row.constants, row.vectors, row.scales]).tobytes())
    digest.update(np.array([*guesses.ravel(), *flow.modes, flow.torque, flow.period, bound, *numbers]).tobytes())
    return digest.hexdigest()[:32]


def compute_rows(
    work: Callable[[Sequence[Item]], FloatArray],
    items: Sequence[Item],
    names: Sequence[str],
    shape: tuple[int, ...],
    kernel: Any,
    *,
    folder: str | Path | None,
    n_jobs: int | None,
    progress: bool,
    what: str,
    together: int = 1,
) -> tuple[FloatArray, int]:
    """Return the result of ``work`` for each item, a row of a grid: from the cache, or computed by a worker and cached.

    ``work`` computes up to ``together`` items; its result has a row of the given ``shape`` for each of them. ``names`` are the
    names of the items in the cache: see `row_name`. ``kernel`` is compiled once, before the workers start. The other arguments
    and the exceptions are those of `grid`. The result has the shape (items, *shape). The number of rows that were not in the
    cache is returned, too.
    """
    check_jobs(n_jobs)
    where = grid_folder() if folder is None else Path(folder)
    with suppress(OSError):  # the warning follows when the first row cannot be kept
        where.mkdir(parents=True, exist_ok=True)
    paths = [where / f"{name}.row" for name in names]
    rows: dict[Path, FloatArray] = {}
    missing: dict[Path, Item] = {}
    for path, item in zip(paths, items):
        kept = load_array(path)
        if kept is not None and kept.shape == shape:
            rows[path] = kept
        else:
            missing[path] = item
    if missing:
        _ = kernel.compiled
    unkept = 0
    with record_interrupts() as interrupted, show_progress(progress, float(len(paths)), what) as show:
        show(float(len(rows)))
        # at least two pieces of work for each worker, so that no worker waits long for the others
        size = min(together, 1 + len(missing) // (2 * worker_count(n_jobs)))
        pieces = [list(missing)[n : n + size] for n in range(0, len(missing), size)]
        tasks = [[missing[path] for path in piece] for piece in pieces]
        for number, made in run_in_parallel(work, tasks, interrupted, n_jobs=n_jobs):
            for path, row in zip(pieces[number], made):
                rows[path] = row
                try:
                    save_array(path, row)
                except OSError as error:
                    if not unkept:
                        warnings.warn(f"rows of the grid are not kept: {error}", RuntimeWarning, stacklevel=3)
                    unkept += 1
            show(float(len(rows)))
            if interrupted:
                break
        if interrupted and len(rows) < len(set(paths)):
            raise GridInterrupted(len(rows) - unkept, len(paths), where)
    return np.array([rows[path] for path in paths]), len(missing)


#: Least margin of stability with which a long run distinguishes growth from decay with certainty.
MEASURABLE = 1e-2


def points_to_confirm(found: Grid) -> list[tuple[int, int]]:
    """Choose three points of a grid for long runs: the most stable, the least stable, and the one nearest to a boundary.

    Each point lies at least a tenth of the range away from the edges, so that a figure shows its mark whole, unless unstable
    points lie only next to the edges. The third point has the smallest margin of stability that a long run can still measure.

    Returns
    -------
    list of (int, int)
        Row and column of each point; there may be fewer than three.
    """
    margin = 1.0 - found.largest
    if margin.count() == 0:
        return []
    edges = np.ones(margin.shape, dtype=bool)
    row, column = (max(1, count // 10) for count in margin.shape)
    edges[row:-row, column:-column] = False
    inner = np.ma.masked_where(edges, margin)
    if inner.count() == 0:
        inner = margin
    worst = margin if margin.min() < 0.0 < inner.min() else inner
    places = list(dict.fromkeys((int(inner.argmax()), int(worst.argmin()))))
    size = np.ma.abs(inner)
    size.ravel()[places] = np.ma.masked
    near = np.ma.masked_where(size < MEASURABLE, size)
    if near.count():
        places.append(int(near.argmin()))
    rows, columns = np.unravel_index(places, margin.shape)
    return list(zip(rows.tolist(), columns.tolist()))
