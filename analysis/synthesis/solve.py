"""`synthesize`: from a task to ranked linkages, and the trade-off of its error against size or transmission angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from textwrap import fill
from time import perf_counter
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, Interrupted

from .black_box import by_differential_evolution, by_simplex
from .constraints import (
    USUAL,
    Constraint,
    InfeasibleError,
    LargestLink,
    LeastTransmission,
    Limits,
    limits_of,
)
from .linkage import ANGLES, Linkage
from .polish import Polished, distinct, polish
from .program import Answer, PivotUnknown, Start, linkage_of, random_pivot, start_of
from .scan import scan
from .solution import Solution, nearest_rotations, ranked
from .tasks import Normal, RockerFunction, Task, UntimedPath, normal_form, reweighted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Method = Literal["scan", "differential-evolution", "simplex"]
#: Stations of an untimed path where the pivot moves: more than with a fixed one, because harmonics put waves into the curve.
STATIONS = 144
METHODS: tuple[Method, ...] = ("scan", "differential-evolution", "simplex")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Synthesis:
    """Ranked solutions of a task.

    Attributes
    ----------
    task : Task
        With the weights it was solved with.
    solutions : tuple of Solution
        Sound ones first, then by error; different linkages.
    method : str
    seed : int
    starts : int
        Searches that were run.
    seconds : float
        It took (s).
    complete : bool
        False if it was stopped.
    """

    task: Task
    solutions: tuple[Solution, ...]
    method: str
    seed: int
    starts: int
    seconds: float
    complete: bool = True

    @property
    def best(self) -> Solution:
        """The first solution."""
        return self.solutions[0]

    def columns(self) -> dict[str, list[float]]:
        """Rank, errors, verdicts (1 or 0) and dimensions of each solution; SI, units in the names."""
        return columns_of(self.solutions)

    def to_csv(self, path: str | Path) -> Path:
        """Write `columns` to a CSV file."""
        from ..files import write_csv

        return write_csv(path, self.columns())

    def plot(self, *, title: str = "") -> Figure:
        """The ranked linkages beside one another, each with its curve and the target."""
        from .. import figures
        from .report import headline

        scenes = [s.scene(f"{k}: {headline(s)}") for k, s in enumerate(self.solutions, start=1)]
        return figures.plot_alternatives(scenes, title=title)


class SynthesisInterrupted(Interrupted):
    """A synthesis was stopped from the keyboard; ``synthesis`` holds the best so far, or is None if there is none."""

    def __init__(self, synthesis: Synthesis | None, done: int, starts: int) -> None:
        self.synthesis = synthesis
        super().__init__(f"stopped after {done} of {starts} searches")


def synthesize(
    task: Task,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    constraints: Sequence[Constraint] = USUAL,
    weights: ArrayLike | None = None,
    seed: int = 0,
    *,
    method: Method = "scan",
    candidates: int = 1 << 16,
    starts: int = 24,
    solutions: int = 6,
    pivot: PivotUnknown | None = None,
    guesses: Sequence[Solution] = (),
    n_jobs: int = 1,
    progress: bool = False,
) -> Synthesis:
    """Find linkages that do a task.

    A scan over many thousand four-bars, each placed in closed form, gives the starts; each is polished to an optimum with exact
    derivatives. What cannot be done exactly is answered with the best there is, its error told.

    Parameters
    ----------
    task : TimedPath, UntimedPath, RockerFunction, Motion or PrecisionPoints
    bounds : mapping, optional
        (least, greatest) of dimensions by their name in `Linkage` (m, rad); equal ones fix a dimension. Without, links up
        to five times the target's size; of a rocker function, a ground link of 0.1 m and the others up to five times that.
    constraints : sequence
        See `analysis.synthesis.constraints`; by default a transmission angle of at least 40 degrees over a full turn.
    weights : array_like, optional
        One per target, in the place of the task's own.
    seed : int
        Of the scan: the same seed gives the same solutions, on any number of cores.
    method : "scan", "differential-evolution" or "simplex"
        The last two are for comparison: SciPy's differential evolution on the quality function as a black box, and the thesis's
        downhill simplex from many starts.
    candidates : int
        Four-bars in the scan.
    starts : int
        Of them, how many are polished.
    solutions : int
        At most that many different linkages are returned.
    pivot : SliderUnknown or CrankUnknown, optional
        Move the rocker pivot, its motion sought together with the links.
    guesses : sequence of Solution
        Searched from as well.
    n_jobs : int
        Cores, as `joblib.Parallel`.
    progress : bool
        Show a progress bar.

    Raises
    ------
    InputError
        If the task, the weights or a number here is not usable.
    InfeasibleError
        If no linkage keeps all bounds and constraints; it names the one that is hurt most.
    SynthesisInterrupted
        On Ctrl-C, with the best so far.
    MissingLibraryError
        If there are inequalities, and CasADi is not installed.
    """
    for name, value in (("candidates", candidates), ("starts", starts), ("solutions", solutions)):
        if value < 1:
            raise InputError(f"{value} {name}: there must be at least one")
    if method not in METHODS:
        raise InputError(f"method {method!r}: it must be one of {', '.join(METHODS)}")
    if seed < 0 or int(seed) != seed or int(solutions) != solutions:
        raise InputError(f"seed {seed} and {solutions} solutions: both must be whole numbers, the seed not below zero")
    begun = perf_counter()
    task = reweighted(task, weights)
    normal = fitted_form(task, pivot)
    limits = limits_of(task, normal, bounds, constraints)
    if method == "scan":
        begin = [start_from(g.linkage, normal, pivot, g.evaluation.rotation) for g in guesses]
        random = np.random.default_rng(seed)
        try:
            scanned = scan(normal, limits, seed=seed, candidates=candidates, starts=starts)
        except KeyboardInterrupt:
            raise SynthesisInterrupted(None, 0, len(begin) + starts) from None
        for start in scanned:
            motion = start.pivot if pivot is None else random_pivot(pivot, start.q[2], normal.unit, random)
            begin.append(replace(start, pivot=motion))
        done = polish(normal, limits, begin, pivot=pivot, n_jobs=n_jobs, progress=progress)
        total = len(begin)
    else:
        if pivot is not None:
            raise InputError(f"method {method!r} searches linkages with a fixed pivot: use 'scan'")
        search = by_differential_evolution if method == "differential-evolution" else by_simplex
        done = search(normal, limits, seed=seed, starts=starts, n_jobs=n_jobs, progress=progress)
        total = starts
    found = solutions_of(task, normal, limits, done, pivot, solutions)
    seconds = perf_counter() - begun
    result = Synthesis(
        task=task,
        solutions=found,
        method=method,
        seed=seed,
        starts=done.done,
        seconds=seconds,
        complete=not done.interrupted,
    )
    if done.interrupted:
        raise SynthesisInterrupted(result if found else None, done.done, total)
    if not found:
        raise infeasible(done)
    return result


def fitted_form(task: Task, pivot: PivotUnknown | None) -> Normal:
    """Normal form of a task for a search; of an untimed path with more stations where the pivot moves."""
    if pivot is not None and isinstance(task, UntimedPath):
        task = replace(task, samples=max(task.samples, STATIONS))
    return normal_form(task)


def start_from(
    linkage: Linkage, normal: Normal, pivot: PivotUnknown | None, rotation: NDArray[np.float64] | None = None
) -> Start:
    """A linkage as a start, its untimed stations at the given rotations, or else where it comes nearest to them.

    Raises
    ------
    InputError
        If rotations are needed and cannot be found so, because the path is open.
    """
    if normal.timed:
        return start_of(linkage, normal, pivot)
    if rotation is None or len(rotation) != normal.n:
        if normal.points is None or not normal.closed:
            if rotation is None:
                raise InputError("a start for an open path needs the crank rotations of its stations")
            rotation = np.interp(np.linspace(0.0, 1.0, normal.n), np.linspace(0.0, 1.0, len(rotation)), rotation)
        else:
            rotation = nearest_rotations(linkage, normal.origin + normal.unit * normal.points)
    return start_of(linkage, normal, pivot, rotation)


def solutions_of(
    task: Task, normal: Normal, limits: Limits, done: Polished, pivot: PivotUnknown | None, count: int
) -> tuple[Solution, ...]:
    """Answers as solutions, each evaluated afresh, ranked, and at most so many."""
    chosen = distinct(done.kept, 4 * count, pivot)
    made = [
        Solution.of(task, linkage_of(a.start, normal, pivot, limits), _stations(task, normal, a.start.rotation))
        for a in chosen
    ]
    return ranked([s for s in made if isfinite(s.error)])[:count]


def _stations(task: Task, normal: Normal, rotation: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Crank rotations of the task's own stations, from those of the ones it was fitted at."""
    own = normal_form(task)
    if rotation is None or len(rotation) == own.n:
        return rotation
    at, turned = normal.shares, rotation
    if own.closed:
        at = np.append(at, 1.0)
        turned = np.append(rotation, rotation[0] + np.copysign(2.0 * np.pi, rotation[-1] - rotation[0]))
    told: NDArray[np.float64] = np.interp(own.shares, at, turned)
    return told


def infeasible(done: Polished) -> InfeasibleError:
    """What to say where nothing was found that keeps the constraints."""
    if not done.others:
        return InfeasibleError("no linkage keeps all bounds and constraints")
    nearest: Answer = min(done.others, key=lambda a: a.violation)
    return InfeasibleError(
        f"no linkage keeps all bounds and constraints: of {len(done.others)} searches the nearest violates "
        f"the {nearest.worst or 'quality'} by {nearest.violation:.3g} (in units of the target's size, or rad; "
        f"{nearest.status.replace('_', ' ').lower()})"
    )


def columns_of(solutions: Sequence[Solution]) -> dict[str, list[float]]:
    """What `Synthesis.columns` tells, of any solutions."""
    columns: dict[str, list[float]] = {}

    def put(name: str, value: float) -> None:
        columns.setdefault(name, []).append(float(value))

    for rank, s in enumerate(solutions, start=1):
        angular = isinstance(s.task, RockerFunction)
        unit, length = ("rad2", "rad") if angular else ("m2", "m")
        put("rank", rank)
        put(f"quality [{unit}]", s.error)
        put(f"rms error [{length}]", s.evaluation.rms)
        put(f"worst error [{length}]", s.evaluation.worst)
        for name in ("full_turn", "circuit", "branch", "order"):
            put(f"{name.replace('_', ' ')} (1 or 0)", getattr(s.verdicts, name))
        put("least transmission angle [rad]", s.verdicts.least_transmission)
        put("greatest transmission angle [rad]", s.verdicts.greatest_transmission)
        for name, value in s.linkage.values().items():
            put(name if name == "branch" else f"{name} [{'rad' if name in ANGLES else 'm'}]", value)
    return columns


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TradeOff:
    """The least error over a limit that is tightened.

    Attributes
    ----------
    over : str
        ``size`` or ``transmission``.
    limit : ndarray, shape (n,)
        Largest link (m), or least transmission angle (rad).
    solutions : tuple of Solution or None
        The best at each; None where there is no linkage.
    """

    over: str
    limit: NDArray[np.float64]
    solutions: tuple[Solution | None, ...]

    @property
    def error(self) -> np.ma.MaskedArray:
        """Quality function at each limit, masked where there is no linkage; shape (n,)."""
        values = [np.nan if s is None else s.error for s in self.solutions]
        return np.ma.masked_invalid(np.array(values))

    def to_csv(self, path: str | Path) -> Path:
        """Write each limit with its best linkage, in the columns of `Synthesis.columns`; limits without one are left out."""
        from ..files import write_csv

        there = [(limit, s) for limit, s in zip(self.limit, self.solutions) if s is not None]
        unit = "largest link [m]" if self.over == "size" else "least transmission angle [rad]"
        columns = columns_of([s for _, s in there])
        del columns["rank"]
        return write_csv(path, {f"limit of {unit}": [limit for limit, _ in there], **columns})

    def plot(self, *, title: str = "") -> Figure:
        """Quality function and worst error over the limit."""
        from .. import figures
        from .report import error_unit, quality_name, quality_unit

        task = next((s.task for s in self.solutions if s is not None), None)
        if task is None:
            raise InfeasibleError("there is no linkage at any of the limits: there is nothing to plot")
        (factor, unit), (scale, length) = quality_unit(task), error_unit(task)
        worst = np.array([np.nan if s is None else s.evaluation.worst for s in self.solutions])
        size = self.over == "size"
        name = fill(quality_name(task), 26)
        error = factor * self.error.filled(np.nan)
        return figures.plot_trade_off(
            1e3 * self.limit if size else np.degrees(self.limit),
            {f"{name} [{unit}]": error, f"worst error [{length}]": scale * worst},
            limit_label="limit of the largest link [mm]" if size else "least transmission angle asked for [deg]",
            title=title,
        )


class TradeOffInterrupted(Interrupted):
    """A trade-off was stopped from the keyboard; ``trade_off`` has the best so far at each limit, None where there is none."""

    def __init__(self, trade_off: TradeOff, done: int, problems: int) -> None:
        self.trade_off = trade_off
        super().__init__(f"stopped after {done} of {problems} problems of the trade-off")


def trade_off(
    task: Task,
    over: Literal["size", "transmission"],
    limits: ArrayLike,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    constraints: Sequence[Constraint] = USUAL,
    weights: ArrayLike | None = None,
    seed: int = 0,
    *,
    starts: int = 12,
    pivot: PivotUnknown | None = None,
    n_jobs: int = 1,
    progress: bool = False,
) -> TradeOff:
    """Error against size or transmission angle, by the epsilon-constraint method with warm starts.

    From the loosest limit to the tightest each problem starts from its own scan and from the solutions of the one before; a
    second pass goes back, so that a solution found late serves the looser limits too, itself or polished anew: the error of
    sound linkages can only grow as a limit is tightened.

    Parameters
    ----------
    task : Task
    over : "size" or "transmission"
    limits : array_like, shape (n,)
        Largest links (m), or least transmission angles (rad).
    bounds, constraints, weights, seed, starts, pivot, n_jobs, progress
        As for `synthesize`; the limit takes the place of a constraint of its own kind.

    Raises
    ------
    InputError
        If ``over`` or the limits are not usable.
    TradeOffInterrupted
        On Ctrl-C, with the best so far at each limit.
    """
    kind = {"size": LargestLink, "transmission": LeastTransmission}.get(over)
    values = np.array(limits, dtype=float)
    if kind is None:
        raise InputError(f"a trade-off over {over!r}: it must be 'size' or 'transmission'")
    if values.ndim != 1 or len(values) < 2 or not np.isfinite(values).all():
        raise InputError("the limits of a trade-off must be finite numbers, at least two")
    rest = tuple(c for c in constraints if not isinstance(c, kind))
    order = np.argsort(-values if over == "size" else values)
    found: dict[int, Solution] = {}

    def result_so_far() -> TradeOff:
        return TradeOff(over=over, limit=values, solutions=tuple(found.get(k) for k in range(len(values))))

    for number, sequence in enumerate((order, order[::-1])):
        previous: list[Solution] = []
        for done, k in enumerate(sequence.tolist()):
            limit: Constraint = LargestLink(length=values[k]) if over == "size" else LeastTransmission(angle=values[k])
            own = [found[k]] if k in found else []
            guesses = [*previous, *own]
            if number and not guesses:
                continue
            # on the way back what keeps the tighter limit keeps this one, too
            kept = guesses if number else own
            try:
                result = synthesize(
                    task,
                    bounds,
                    (*rest, limit),
                    weights,
                    seed,
                    starts=starts if number == 0 else 1,
                    candidates=1 << 14 if number == 0 else 1 << 8,
                    solutions=3,
                    pivot=pivot,
                    guesses=guesses,
                    n_jobs=n_jobs,
                    progress=progress,
                ).solutions
            except InfeasibleError:
                result = ()
            except (SynthesisInterrupted, KeyboardInterrupt) as error:
                last = error.synthesis if isinstance(error, SynthesisInterrupted) else None
                if best := ranked([*kept, *(last.solutions if last else ())])[:1]:
                    found[k] = best[0]
                raise TradeOffInterrupted(result_so_far(), number * len(values) + done, 2 * len(values)) from None
            if not (result or kept):
                continue
            found[k] = ranked([*kept, *result])[0]
            previous = [found[k]] if number else list(result)
    return result_so_far()
