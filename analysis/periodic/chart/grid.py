"""Grids of the largest Floquet multiplier, each point on its own periodic orbit: over cores, kept on disk, gone on with."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, Interrupted
from linkwork.mechanism import Mechanism

from ...files import load_array, save_array
from ...mechanisms import MECHANISMS, Parameters, mechanism_of
from ...numerics.codegen import cache_root, fingerprint
from ...numerics.workers import check_jobs, interruptible, over_workers
from ...run import shown
from ..motion.discretisation import INTEGRATOR_TOLERANCE, section_of
from ..motion.drive import Drive, is_smooth, scale_of, starts_of
from ..motion.floquet import TOLERANCE, Stability, multipliers
from ..motion.flow import GAP, PLAIN, VARIATIONAL
from ..motion.kernels import REASONS, Section, Status
from ..motion.orbit import MOST_ITERATIONS, SEARCH_TOLERANCE, guess_of
from ..motion.variables import Operation, Plane
from . import kernels


class Row(NamedTuple):
    """A row of mechanisms as the kernels take it: what they share; constants, drives and magnitudes of y, each by rows."""

    section: Section
    constants: NDArray[np.float64]
    drives: NDArray[np.float64]
    scales: NDArray[np.float64]


def row_of(
    rows: Sequence[Parameters],
    drives: Sequence[Drive],
    start: NDArray[np.float64],
    *functions: int,
    tolerance: float = INTEGRATOR_TOLERANCE,
) -> Row:
    """What the kernels need of a row of mechanisms and their drives: see `section_of`."""
    mechanism = mechanism_of(rows[0])
    numbers = np.array([(*parameters.constants(),) for parameters in rows])
    vectors = np.array([drive.vector(mechanism) for drive in drives])
    return Row(
        section_of(rows[0], drives[0], start, *functions, tolerance=tolerance, beside=rows),
        np.hstack([numbers, np.zeros_like(numbers)]),
        np.hstack([vectors, np.zeros_like(vectors)]),
        np.array([scale_of(parameters, drive, start) for parameters, drive in zip(rows, drives)]),
    )


def largest_multipliers(
    rows: Sequence[Parameters],
    drives: Sequence[Drive],
    guesses: ArrayLike | None = None,
    *,
    turns: int = 1,
    tolerance: float = INTEGRATOR_TOLERANCE,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Largest Floquet multiplier of each of a row of mechanisms, every one on its own periodic orbit.

    Each is sought from its neighbour's start, so that they should be ordered along a line of a chart, then from the guesses.

    Parameters
    ----------
    rows, drives : sequences of m
    guesses : array_like, shape (n,) or (k, n), optional
        Start of the first, and others where nothing is found from there; see `find_orbit`.
    turns : int
    tolerance : float
        Bound of the integrator's local error.

    Returns
    -------
    values : ndarray, shape (m,)
        Largest modulus of the multipliers; NaN where there is none.
    starts : ndarray, shape (m, n)
        y at crank angle 0; NaN where there is none.
    status : ndarray of int, shape (m,)
        `kernels.Status`: 0 where an orbit was found.
    """
    mechanism = mechanism_of(rows[0])
    flow = drives[0].flow(mechanism)
    if any(drive.flow(mechanism) is not flow for drive in drives):
        raise InputError("a row has both drives by speed and by torque, or other modes or ratios: it must have one kind")
    given = (None,) if guesses is None else np.atleast_2d(np.asarray(guesses, dtype=float))
    starting = np.array([guess_of(flow, drives[0], guess) for guess in given])
    n, first = flow.size, starting[0]
    section, *points = row_of(rows, drives, first, PLAIN, VARIATIONAL, tolerance=tolerance)
    monodromies, starts = np.full((len(rows), n * n), np.nan), np.full((len(rows), n), np.nan)
    status = np.zeros(len(rows), dtype=np.int64)
    kernels.solve_row(
        section,
        tuple(points),
        flow.period * turns,
        turns,
        MOST_ITERATIONS,
        SEARCH_TOLERANCE,
        all(map(is_smooth, dict.fromkeys(rows))),
        starting,
        (starts, monodromies, status),
    )
    values = np.full(len(rows), np.nan)
    good = status == Status.DONE
    if good.any():
        values[good] = np.abs(multipliers(monodromies[good].reshape(-1, n, n)))[:, 0]
    return values, starts, status


Item = TypeVar("Item")

#: Starts from which the orbit of a point is sought where it is not found from its neighbour: a power of two.
STARTS = 32


class GridInterrupted(Interrupted):
    """A grid was interrupted; the rows that were done are kept and the same call goes on from there.

    Attributes
    ----------
    done, rows : int
    """

    def __init__(self, done: int, rows: int, folder: Path) -> None:
        self.done = done
        self.rows = rows
        super().__init__(
            f"interrupted with {done} of {rows} rows done, which are kept in {folder}: call again to go on"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """The largest multiplier of the true orbit over a grid.

    Attributes
    ----------
    x, y : ndarray, shapes (nx,) and (ny,)
    largest : masked array, shape (ny, nx)
        Largest modulus of the Floquet multipliers; masked where no orbit was found.
    starts : ndarray, shape (ny, nx, n)
        Starts of the orbits, see `PeriodicOrbit`; NaN where ``largest`` is masked.
    status : ndarray of int, shape (ny, nx)
        `kernels.Status`: 0, or why there is no orbit.
    computed : int
        Rows that were not in the cache.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    largest: np.ma.MaskedArray[Any, np.dtype[np.float64]]
    starts: NDArray[np.float64]
    status: NDArray[np.int64]
    computed: int

    def reason(self, row: int, column: int) -> str:
        """Why a point has no orbit; empty if it has one."""
        return REASONS.get(Status(self.status[row, column]), "")

    def around(self, x: float, y: float) -> NDArray[np.float64]:
        """Starts of the orbits at the points around a place, the nearest first; shape (k, n)."""
        across, up = (np.argsort(np.abs(axis - value))[:3] for axis, value in ((self.x, x), (self.y, y)))
        starts = self.starts[np.ix_(up, across)].reshape(-1, self.starts.shape[-1])
        kept: NDArray[np.float64] = starts[~np.isnan(starts).any(axis=1)]
        return kept

    def stability(self, tolerance: float = TOLERANCE) -> NDArray[Any]:
        """`Stability` of each point, None where no orbit was found; an array of objects of shape (ny, nx)."""
        margin = 1.0 - self.largest.filled(np.nan)
        result = np.full(margin.shape, Stability.MARGINAL, dtype=object)
        result[margin > tolerance] = Stability.STABLE
        result[margin < -tolerance] = Stability.UNSTABLE
        result[np.isnan(margin)] = None
        return result


def grid_folder() -> Path:
    """Folder of the rows of grids that have been computed, beside that of the compiled code."""
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
) -> Grid:
    """The largest Floquet multiplier of the true orbit at every point of a grid.

    The rows go over workers; each is, once done, a file in the cache, under a name made from all it depends on: mechanisms,
    drives, guess, tolerance and the machine code. An interrupted grid goes on from the rows that are there.

    Parameters
    ----------
    operation : callable
        See `plane`.
    x, y : array_like, shapes (nx,) and (ny,)
        Values of the axes.
    start : array_like, shape (n,), optional
        Guess of the first orbit of each row; see `find_orbit`. Where it leads to none, others are tried.
    tolerance : float
        Bound of the integrator's local error.
    folder : path, optional
        Of the cache; `grid_folder` by default.
    n_jobs : int, optional
        Processes, -1 for one a core; of a cluster, inside `joblib.parallel_config`, all of its cores.
    progress : bool
        Show a progress bar.

    Raises
    ------
    InputError
        If an axis is empty or not finite, or there are no cores.
    ParameterError
        If a point is no mechanism.
    GridInterrupted
        On Ctrl-C.
    """
    xs, ys = axes_of(x, y)
    parameters, drive = operation(float(xs[0]), float(ys[0]))
    mechanism = mechanism_of(parameters)
    guess = guess_of(drive.flow(mechanism), drive, start)
    guesses = np.vstack([guess, starts_of(parameters, drive, guess, STARTS)])
    code = code_of(kernels.solve_row, multipliers)
    points = [[operation(first, value) for first in xs.tolist()] for value in ys.tolist()]
    data, computed = kept_rows(
        partial(_compute_row, guesses, tolerance),
        points,
        [name_of(row, guesses, (PLAIN, VARIATIONAL, GAP), code, tolerance) for row in points],
        (len(xs), len(guess) + 2),
        mechanism=mechanism,
        folder=folder,
        n_jobs=n_jobs,
        progress=progress,
        what="filling in the stability chart",
    )
    status = data[..., -1].astype(np.int64)
    return Grid(
        x=xs,
        y=ys,
        largest=np.ma.MaskedArray(data[..., 0], mask=status != Status.DONE),
        starts=data[..., 1:-1],
        status=status,
        computed=computed,
    )


def _compute_row(guesses: NDArray[np.float64], tolerance: float, row: Sequence[Operation]) -> NDArray[np.float64]:
    """A row, with the columns multiplier, start and status."""
    mechanisms, drives = [p for p, _ in row], [drive for _, drive in row]
    values, starts, status = largest_multipliers(mechanisms, drives, guesses, tolerance=tolerance)
    return np.column_stack([values, starts, status])


# Rows over workers, kept on disk


def axes_of(x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values of the axes of a grid; raises InputError if an axis is empty or not finite."""
    xs, ys = (np.array(axis, dtype=float, ndmin=1) for axis in (x, y))
    for name, axis in (("x", xs), ("y", ys)):
        if axis.ndim != 1 or len(axis) == 0 or not np.isfinite(axis).all():
            raise InputError(f"the axis {name} of a grid must be finite numbers, at least one")
    return xs, ys


def code_of(*functions: Any) -> tuple[str, ...]:
    """What computes a row: functions that are compiled, and all Python of this package, whatever of it they are called by."""
    sources = (path.read_text(encoding="utf-8") for path in sorted(Path(__file__).parents[1].rglob("*.py")))
    return *map(fingerprint, functions), *sources


def name_of(
    row: Sequence[Operation],
    guesses: NDArray[np.float64],
    functions: Sequence[int],
    code: Sequence[str],
    *numbers: float,
) -> str:
    """Name under which a row is kept: a hash of all it depends on.

    Parameters
    ----------
    row : sequence of (parameters, Drive)
    guesses : ndarray, shape (k, n)
        Starts; from the first the magnitudes of y are taken.
    functions : sequence of int
        Numbers of the flow's functions that are called.
    code : sequence of str
        Of what computes the row: see `code_of`.
    *numbers : float
        What else goes in.
    """
    mechanism, drive = mechanism_of(row[0][0]), row[0][1]
    flow = drive.flow(mechanism)
    switched = any(mechanism.switched(p.constants()) for p, _ in row)
    digest = hashlib.sha256(" ".join((flow.fingerprint(*functions, switched=switched), *code)).encode())
    columns = [(*p.constants(), *d.vector(mechanism), *scale_of(p, d, guesses[0])) for p, d in row]
    digest.update(np.array(columns).tobytes())
    digest.update(np.array([*guesses.ravel(), *flow.modes, flow.torque, flow.period, *numbers]).tobytes())
    return digest.hexdigest()[:32]


def kept_rows(
    work: Callable[[Item], NDArray[np.float64]],
    items: Sequence[Item],
    names: Sequence[str],
    shape: tuple[int, ...],
    *,
    mechanism: Mechanism,
    folder: str | Path | None,
    n_jobs: int | None,
    progress: bool,
    what: str,
) -> tuple[NDArray[np.float64], int]:
    """The array that ``work`` makes of each item: from the cache, or over workers and then kept there.

    Parameters
    ----------
    names : sequence of str
        Of the items in the cache: see `name_of`.
    shape : tuple of int
        Of each array.
    mechanism : Mechanism
        Which the workers are to know.
    what : str
        Is written before the progress bar.

    Returns
    -------
    rows : ndarray, shape (items, *shape)
    computed : int
        Rows that were not in the cache.

    Raises
    ------
    InputError
        If there are no cores.
    GridInterrupted
        On Ctrl-C.
    """
    check_jobs(n_jobs)
    where = grid_folder() if folder is None else Path(folder)
    with suppress(OSError):  # said once the first row cannot be kept
        where.mkdir(parents=True, exist_ok=True)
    paths = [where / f"{name}.row" for name in names]
    rows: dict[Path, NDArray[np.float64]] = {}
    missing: dict[Path, Item] = {}
    for path, item in zip(paths, items):
        kept = load_array(path)
        if kept is not None and kept.shape == shape:
            rows[path] = kept
        else:
            missing[path] = item
    unkept = 0
    with interruptible() as interrupted, shown(progress, float(len(paths)), what) as show:
        show(float(len(rows)))
        compute, places = partial(_knowing, mechanism, work), list(missing)
        for number, made in over_workers(compute, list(missing.values()), interrupted, n_jobs=n_jobs):
            path = places[number]
            rows[path] = made
            try:
                save_array(path, made)
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


def _knowing(mechanism: Mechanism, work: Callable[[Item], NDArray[np.float64]], item: Item) -> NDArray[np.float64]:
    """The work on an item, in a process in which a mechanism that the caller has registered may be unknown."""
    MECHANISMS.setdefault(mechanism.name, mechanism)
    return work(item)


#: Margin from which on a long run distinguishes growth from decay with certainty.
MEASURABLE = 1e-2


def points_to_confirm(found: Grid) -> list[tuple[int, int]]:
    """Three points of a grid that put it to the test: its most stable, its least stable, and the one nearest to a boundary.

    The last is the point of the least margin, to either side, that a long run can still measure, and none of the two others.

    Returns
    -------
    list of (int, int)
        Rows and columns; as many as have an orbit where these are fewer than three, none where the grid has none.
    """
    margin = 1.0 - found.largest
    if margin.count() == 0:
        return []
    places = list(dict.fromkeys((int(margin.argmax()), int(margin.argmin()))))
    size = np.ma.abs(margin)
    size.ravel()[places] = np.ma.masked
    near = np.ma.masked_where(size < MEASURABLE, size)
    if near.count():
        places.append(int(near.argmin()))
    row, column = np.unravel_index(places, margin.shape)
    return list(zip(row.tolist(), column.tolist()))
