"""Motions beside each other: how many stable ones each point of a plane has, and which of them a start ends in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from ...display import Shown, format_count
from ...files import write_csv
from ...mechanisms import Parameters, mechanism_of
from ...run import takes_published
from ..motion.discretisation import section_of
from ..motion.drive import Drive, extent_of, scale_of, starts_of
from ..motion.floquet import TOLERANCE, multipliers
from ..motion.flow import GAP, PLAIN, VARIATIONAL
from ..motion.orbit import MOST_ITERATIONS, SEARCH_TOLERANCE, PeriodicOrbit, guess_of, require_turns
from ..motion.search import Orbits, orbits_of, passages
from ..motion.variables import Operation, Plane
from . import kernels
from .grid import axes_of, code_of, kept_rows, name_of, row_of
from .kernels import LOST, MOST_ORBITS, UNSETTLED

#: Starts from which the motions of a point are sought beside those of its neighbour: a power of two.
STARTS = 16

#: Samples of a turn from which an amplitude is taken.
SAMPLES = 64

#: Bound of the integrator's local error of a basin, distance from a motion, relative to the scale, at which a start has
#: arrived, and turns at most.
_TOLERANCE, _NEAR, _TURNS = 1e-6, 1e-2, 3000


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Coexistence:
    """The periodic motions of one turn at every point of a grid.

    Attributes
    ----------
    x, y : ndarray, shapes (nx,) and (ny,)
    largest : masked array, shape (ny, nx, k)
        Largest modulus of the Floquet multipliers of each motion, by amplitude; masked where there is no further one.
    amplitude : masked array, shape (ny, nx, k)
        Half the range of the first free coordinate, of a slider position (m).
    starts : ndarray, shape (ny, nx, k, n)
        y at crank angle 0; NaN where there is none.
    swing : (str, str)
        What the amplitude is of, and its unit.
    computed : int
        Rows that were not in the cache.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    largest: np.ma.MaskedArray[Any, np.dtype[np.float64]]
    amplitude: np.ma.MaskedArray[Any, np.dtype[np.float64]]
    starts: NDArray[np.float64]
    swing: tuple[str, str]
    computed: int

    @property
    def count(self) -> NDArray[np.int64]:
        """Motions that were found at each point, shape (ny, nx)."""
        return np.asarray(self.largest.count(axis=2))

    @property
    def stable(self) -> NDArray[np.int64]:
        """Stable motions that were found at each point, shape (ny, nx)."""
        return np.asarray(self._is_stable.sum(axis=2))

    @property
    def _is_stable(self) -> NDArray[np.bool_]:
        """Of each motion, shape (ny, nx, k)."""
        return np.asarray(np.ma.filled(self.largest < 1.0 - TOLERANCE, False))

    @property
    def least(self) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        """Amplitude of the smallest stable motion, shape (ny, nx)."""
        return self._extreme(np.ma.min)

    @property
    def greatest(self) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        """Amplitude of the largest stable motion, shape (ny, nx)."""
        return self._extreme(np.ma.max)

    def _extreme(self, of: Callable[..., Any]) -> np.ma.MaskedArray[Any, np.dtype[np.float64]]:
        stable = np.ma.masked_where(~self._is_stable, self.amplitude)
        return np.ma.masked_invalid(of(stable, axis=2).filled(np.nan))

    def to_csv(self, path: str | Path) -> Path:
        """Write the grid as a table, a row a point, in SI."""
        columns = {
            "x": np.tile(self.x, len(self.y)),
            "y": np.repeat(self.y, len(self.x)),
            "motions found": self.count.ravel().astype(float),
            "stable motions found": self.stable.ravel().astype(float),
            "amplitude of the smallest stable motion": self.least.filled(np.nan).ravel(),
            "amplitude of the largest stable motion": self.greatest.filled(np.nan).ravel(),
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
) -> Coexistence:
    """All periodic motions of one turn that are found at every point of a grid.

    Those of each point are sought from those of its neighbour in the row, then from `STARTS` starts with the known ones divided
    out. A motion that is alone in its part of a row may be missed: `find_orbits` looks at one point more closely. The rows go
    over workers and are kept, as those of `grid` are.

    Parameters
    ----------
    operation : callable
        See `plane`.
    x, y : array_like, shapes (nx,) and (ny,)
        Values of the axes.
    start : array_like, shape (n,), optional
        A further start; under a torque one is needed for the crank speed, unless it follows from a motor.
    folder : path, optional
        Of the cache; see `grid`.
    n_jobs : int, optional
        Processes, -1 for one a core; of a cluster, inside `joblib.parallel_config`, all of its cores.
    progress : bool
        Show a progress bar.

    Raises
    ------
    InputError
        If an axis is empty or not finite, or there are no cores.
    GridInterrupted
        On Ctrl-C.
    """
    xs, ys = axes_of(x, y)
    parameters, drive = operation(float(xs[0]), float(ys[0]))
    mechanism = mechanism_of(parameters)
    flow = drive.flow(mechanism)
    guess = guess_of(flow, drive, start)
    guesses = np.vstack([guess, starts_of(parameters, drive, guess, STARTS)])
    rows = [[operation(first, value) for first in xs.tolist()] for value in ys.tolist()]
    code = code_of(kernels.solve_all)
    data, computed = kept_rows(
        partial(_motions_of, guesses),
        rows,
        [name_of(row, guesses, (VARIATIONAL, PLAIN, GAP), code) for row in rows],
        (len(xs), MOST_ORBITS, flow.size + 2),
        mechanism=mechanism,
        folder=folder,
        n_jobs=n_jobs,
        progress=progress,
        what="motions",
    )
    return Coexistence(
        x=xs,
        y=ys,
        largest=np.ma.masked_invalid(data[..., 0]),
        amplitude=np.ma.masked_invalid(data[..., 1]),
        starts=data[..., 2:],
        swing=flow.components[0],
        computed=computed,
    )


def _motions_of(guesses: NDArray[np.float64], row: Sequence[Operation]) -> NDArray[np.float64]:
    """Largest multiplier, amplitude and start of each motion of the points of a row, by amplitude; NaN where there is none.

    The shape is (m, MOST_ORBITS, n + 2).
    """
    parameters, drives = [p for p, _ in row], [drive for _, drive in row]
    period, m, n = drives[0].flow(mechanism_of(parameters[0])).period, len(row), guesses.shape[1]
    starts, counts = np.full((m, MOST_ORBITS, n), np.nan), np.zeros(m, dtype=np.int64)
    monodromies, swings = np.full((m, MOST_ORBITS, n * n), np.nan), np.full((m, MOST_ORBITS, SAMPLES), np.nan)
    section, *points = row_of(parameters, drives, guesses[0], VARIATIONAL, PLAIN)
    kernels.solve_all(
        section,
        tuple(points),
        period,
        MOST_ITERATIONS,
        SEARCH_TOLERANCE,
        np.linspace(0.0, period, SAMPLES, endpoint=False),
        guesses,
        (starts, monodromies, swings),
        counts,
    )
    largest = np.full((m, MOST_ORBITS), np.nan)
    found = np.arange(MOST_ORBITS) < counts[:, None]
    largest[found] = np.abs(multipliers(monodromies[found].reshape(-1, n, n)))[:, 0]
    # the series of the samples on a finer grid, as `Turn.amplitude` takes it
    fine = np.fft.irfft(np.fft.rfft(swings, axis=2), 8 * SAMPLES, axis=2) * 8.0
    amplitude = 0.5 * np.ptp(fine, axis=2)
    order = np.argsort(np.where(found, amplitude, np.inf), axis=1, kind="stable")
    amplitude[~found] = np.nan
    whole = np.concatenate([largest[..., None], amplitude[..., None], starts], axis=2)
    return np.take_along_axis(whole, order[:, :, None], axis=1)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Basins(Shown):
    """Which motion each start at crank angle 0 ends in.

    Attributes
    ----------
    position, rate : ndarray, shapes (nx,) and (ny,)
        Starts of the first free coordinate, of a slider (m), and of its rate (m/s); the rest of y is that of the first motion.
    ends : ndarray of int, shape (ny, nx)
        Number of the stable motion among ``motions``; -1 where the links come to the limit of assembly, -2 where none of them
        is met within the turns that are followed.
    found : Orbits
        All motions that were sought, the unstable ones on the boundaries of the basins among them.
    computed : int
        Rows that were not in the cache.
    """

    position: NDArray[np.float64]
    rate: NDArray[np.float64]
    ends: NDArray[np.int64]
    found: Orbits
    computed: int

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
        """Part of the starts that end so."""
        return float(np.mean(self.ends == end))

    def to_csv(self, path: str | Path) -> Path:
        """Write the picture as a table, a row a start."""
        (name, unit), (rate, rate_unit) = self._components()
        columns = {
            f"{name} [{unit}]": np.tile(self.position, len(self.rate)),
            f"{rate} [{rate_unit}]": np.repeat(self.rate, len(self.position)),
            "motion (1 and on; 0: limit of assembly; -1: none)": self.ends.ravel() + 1.0,
        }
        return write_csv(path, columns)

    def _components(self) -> tuple[tuple[str, str], tuple[str, str]]:
        flow = self.motions[0].flow
        return flow.components[0], flow.components[flow.size // 2]

    @property
    def labels(self) -> tuple[str, str]:
        """Names of the two axes with their units."""
        (name, unit), (rate, rate_unit) = self._components()
        return f"{name} [{unit}]", f"{rate} [{rate_unit}]"


@takes_published()
def basins(
    parameters: Parameters,
    drive: Drive,
    *,
    turns: int = 1,
    points: int = 200,
    position: tuple[float, float] | None = None,
    rate: tuple[float, float] | None = None,
    start: ArrayLike | None = None,
    folder: str | Path | None = None,
    n_jobs: int | None = None,
    progress: bool = False,
) -> Basins:
    """Which of the stable periodic motions a start ends in, over a plane of starts; its rows are kept as those of `grid` are.

    Parameters
    ----------
    parameters : parameters of a mechanism
    drive : Drive
    turns : int
        Motions of up to so many turns of the crank are sought.
    points : int
        Of the plane, along each axis.
    position, rate : (float, float), optional
        Ranges of the first free coordinate and of its rate at crank angle 0; as far as the mechanism can be assembled by
        default.
    start : array_like, shape (n,), optional
        Under a torque a guess of y with the crank speed; see `find_orbits`.
    folder : path, optional
        Of the cache; see `grid`.
    n_jobs : int, optional
        Processes, -1 for one a core; of a cluster, inside `joblib.parallel_config`, all of its cores.
    progress : bool
        Show a progress bar.

    Raises
    ------
    InputError
        If there is no stable motion, a range is none, or there are no cores.
    GridInterrupted
        On Ctrl-C; the same call goes on from the rows that are kept.

    Examples
    --------
    >>> from analysis.periodic import Drive, basins
    >>> found = basins("rig-1-spring-b", Drive(speed="1000 rpm"), points=20)
    >>> len(found.motions), found.share(0) > found.share(1) > 0.0
    (2, True)
    """
    require_turns(turns)
    found = orbits_of(parameters, drive, turns=range(1, turns + 1), start=start)
    motions = found.stable
    if not motions:
        raise InputError(f"there is no stable motion of {of_turns(turns)} here: no start ends in one")
    first = motions[0].start
    extent, scale, half = extent_of(parameters, drive, first)[0], scale_of(parameters, drive, first), len(first) // 2
    spans = position or (-extent, extent), rate or tuple(scale[half] / scale[0] * extent * s for s in (-1.0, 1.0))
    for name, (low, high) in zip(("position", "rate"), spans):
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise InputError(f"the range of the {name} is {low} to {high}: it must be finite and increasing")
    across, up = (np.linspace(low, high, points) for low, high in spans)
    # a motion of several turns is met at the beginning of any of them
    passed = [passages(orbit) for orbit in motions]
    known, owner = np.vstack(passed), np.repeat(np.arange(len(motions)), [len(starts) for starts in passed])
    code = code_of(kernels.basins_of)
    ends, computed = kept_rows(
        partial(_ends, parameters, drive, known, across),
        up.tolist(),
        [name_of([(parameters, drive)], known, (PLAIN, GAP), code, *across, value) for value in up.tolist()],
        (points,),
        mechanism=mechanism_of(parameters),
        folder=folder,
        n_jobs=n_jobs,
        progress=progress,
        what="starts",
    )
    met = ends.astype(np.int64)
    met[met >= 0] = owner[met[met >= 0]]
    return Basins(position=across, rate=up, ends=met, found=found, computed=computed)


def of_turns(turns: int) -> str:
    """Up to so many turns, in words."""
    return "one turn" if turns == 1 else f"up to {turns} turns"


def _ends(
    parameters: Parameters,
    drive: Drive,
    known: NDArray[np.float64],
    across: NDArray[np.float64],
    rate: float,
) -> NDArray[np.float64]:
    """The ends of a row of starts."""
    flow = drive.flow(mechanism_of(parameters))
    starts = np.tile(known[0], (len(across), 1))
    starts[:, 0], starts[:, flow.size // 2] = across, rate
    ends = np.zeros(len(across), dtype=np.int64)
    section = section_of(parameters, drive, known[0], PLAIN, tolerance=_TOLERANCE)
    kernels.basins_of(section, flow.period, _NEAR, _TURNS, starts, known, ends)
    return ends.astype(float)
