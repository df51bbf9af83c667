"""Define the settings of a search, its starts and answers in normal form, and the distribution of work over cores."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import inf, pi
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from linkwork.errors import InputError

from ...numerics.fourier import FourierSeries
from ...numerics.workers import check_jobs, record_interrupts, run_in_parallel, worker_count
from ...run import show_progress
from ..exact.burmester import guidance
from ..exact.four_bar import function_generators
from ..linkage.linkage import FiveBar, Linkage, SliderCrank, wrap_angles
from ..linkage.pivot import CrankUnknown, PivotUnknown, SecondCrank, SliderMotion, SliderUnknown
from ..result.solution import Solution, nearest_rotations
from ..task.constraint import UNKNOWNS
from ..task.limits import Limits
from ..task.task import Motion, Normal, PrecisionPoints, RockerFunction, Task

Item = TypeVar("Item")
Made = TypeVar("Made")


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Settings of a search.

    Attributes
    ----------
    starts : int
        Number of candidates of the scan from which a search is started.
    solutions : int
        Greatest number of different linkages that are returned.
    seed : int
        Seed of the random numbers; the same seed gives the same solutions, on any number of cores.
    candidates : int
        Number of linkages in the scan.
    n_jobs : int, optional
        Number of processes, -1 for one per core. The default is one process; inside `joblib.parallel_config` for a cluster the
        default is all cores of the cluster.
    progress : bool
        Whether to show a progress bar.
    """

    starts: int = 24
    solutions: int = 6
    seed: int = 0
    candidates: int = 1 << 16
    n_jobs: int | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        for name in ("candidates", "solutions"):
            if getattr(self, name) < 1:
                raise InputError(f"{getattr(self, name)} {name}: there must be at least one")
        check_jobs(self.n_jobs)
        if self.seed < 0 or int(self.seed) != self.seed or int(self.solutions) != self.solutions:
            raise InputError(
                f"seed {self.seed} and {self.solutions} solutions: both must be whole numbers, the seed not below zero"
            )

    @property
    def cores(self) -> int:
        """Return the number of workers that share the searches."""
        return worker_count(self.n_jobs)


USUAL_SEARCH = Search()
#: Default settings if many searches follow one another.
QUICK_SEARCH = Search(starts=12)


def run_on_cores(
    work: Callable[[Item], Made], items: Sequence[Item], search: Search, what: str
) -> tuple[list[Made], bool]:
    """Apply ``work`` to all items on several cores; return the results in order, and whether Ctrl-C interrupted the work.

    ``what`` is the text beside the progress bar.
    """
    made: dict[int, Made] = {}
    with record_interrupts() as interrupted, show_progress(search.progress, float(len(items)), what) as show:
        for number, value in run_in_parallel(work, items, interrupted, n_jobs=search.n_jobs):
            made[number] = value
            show(float(len(made)))
            if interrupted:
                break
    return [made[number] for number in sorted(made)], bool(interrupted)


FloatArray = NDArray[np.float64]
#: Initial amplitude of the motion of a pivot, relative to the ground link.
AMPLITUDE = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Dimensions and assembly of a linkage at which a search starts or ends, in normal form (see `Normal`).

    Attributes
    ----------
    q : ndarray, shape (11,)
        Values of `UNKNOWNS`.
    branch : int
        Assembly, as in `Linkage`.
    pivot : ndarray
        Unknowns of a moving pivot: guide angle and mean position, or length and phase of a second crank; then cosine and sine
        coefficient of each harmonic.
    rotation : ndarray, shape (n,), or None
        Crank rotations of the stations if they are unknown.
    quality : float
        Value of the objective, in the square of the length `Normal.unit`; for a greatest error, in `Normal.unit`.
    given : bool
        Whether the start is a guess, not a candidate of the scan.
    linkage : type
        Type of the linkage; a five-bar is a `Linkage` with a second crank in ``pivot``.
    """

    q: FloatArray
    branch: int
    quality: float = inf
    given: bool = False
    pivot: FloatArray = field(default_factory=lambda: np.empty(0))
    rotation: FloatArray | None = None
    linkage: type[Linkage] = Linkage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """Result of an optimisation: the linkage that it reached, as a `Start`, and whether it meets every constraint.

    ``worst`` is the name of the constraint that is violated most. ``violation`` is the amount of this violation (units, rad, or
    a fraction of the bound), and ``excess`` is the amount as text with its unit. ``status`` is the solver's message.
    """

    start: Start
    feasible: bool
    converged: bool
    violation: float
    worst: str
    excess: str
    status: str
    iterations: int

    @classmethod
    def for_unjoined_links(cls, start: Start) -> Answer:
        """Return an infeasible answer for a start whose links cannot be joined."""
        return cls(
            start=replace(start, quality=inf),
            feasible=False,
            converged=False,
            violation=inf,
            worst="loop closure",
            excess="",
            status="the links cannot be joined at the start",
            iterations=0,
        )


def random_pivot(unknown: PivotUnknown, ground: float, unit: float, random: np.random.Generator) -> FloatArray:
    """Draw random unknowns of a moving pivot, within the bounds of its stroke or length.

    The coefficients of the harmonics decrease with their order.

    Parameters
    ----------
    ground : float
        Ground link, as a multiple of ``unit``.
    unit : float
        Size of the target (m).
    """
    orders = np.repeat(np.arange(1, unknown.harmonics + 1), 2)
    waves = random.standard_normal(2 * unknown.harmonics) / (1.0 + orders)
    if isinstance(unknown, CrankUnknown):
        length = random.uniform(*unknown.length) / unit
        return np.array([length, random.uniform(-pi, pi), *(0.3 * waves)])
    low, high = unknown.guide_angle
    # a guide turned by pi is the same guide
    angle = low + min(high - low, pi) * random.random()
    size = min(AMPLITUDE * ground, 0.25 * unknown.stroke / unit)
    return np.array([angle, size * random.standard_normal(), *(size * waves)])


def pivot_size(pivot: PivotUnknown | None) -> int:
    """Return how many unknowns a moving pivot has."""
    if pivot is None:
        return 0
    return 2 + 2 * pivot.harmonics


def pivot_bounds(pivot: PivotUnknown | None, unit: float) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest values of the unknowns of a moving pivot; ``unit`` is the target's size (m)."""
    if pivot is None:
        return np.empty(0), np.empty(0)
    low, high = np.full(pivot_size(pivot), -inf), np.full(pivot_size(pivot), inf)
    if isinstance(pivot, SliderUnknown):
        low[0], high[0] = pivot.guide_angle
    else:
        low[0], high[0] = pivot.length[0] / unit, pivot.length[1] / unit
    return low, high


def clip_to_bounds(q: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the unknowns clipped to their bounds; angles outside their bounds are first shifted by whole turns."""
    q = q.copy()
    angles = slice(UNKNOWNS.index("ground_angle"), len(UNKNOWNS))
    middle = 0.5 * (low[angles] + high[angles])
    nearest = middle + wrap_angles(q[angles] - middle)
    outside = (q[angles] < low[angles]) | (q[angles] > high[angles])
    q[angles] = np.where(outside, nearest, q[angles])
    return np.clip(q, low, high)


def distances_from_bounds(normal: Normal, low: FloatArray, high: FloatArray, start: Start) -> FloatArray:
    """Return by how much each unknown of a start lies outside its bounds (units, rad), shape (11,).

    The value is 0 for an unknown that does not affect the task.
    """
    q = clip_to_bounds(start.q, low[: len(UNKNOWNS)], high[: len(UNKNOWNS)])
    off = np.abs(wrap_angles(q - start.q))
    off[:7] = np.abs(q - start.q)[:7]
    idle: tuple[str, ...] = () if normal.angle is not None else ("output_angle",)
    if normal.of_rocker:
        idle = ("pivot_x", "pivot_y", "point_distance", "ground_angle", "point_angle")
    off[[UNKNOWNS.index(name) for name in idle]] = 0.0
    return off


def make_linkage(
    start: Start, normal: Normal, pivot: PivotUnknown | None = None, limits: Limits | None = None
) -> Linkage:
    """Build the linkage of a start, in SI; an angle is wrapped to [-pi, pi) if ``limits`` allow the wrapped angle."""
    q = start.q.copy()
    q[:7] *= normal.unit
    q[0] += normal.origin.real
    q[1] += normal.origin.imag
    angles = slice(UNKNOWNS.index("ground_angle"), len(UNKNOWNS))
    near = wrap_angles(q[angles])
    if limits is not None:
        outside = (near < limits.low[angles]) | (near > limits.high[angles])
        near = np.where(outside, q[angles], near)
    q[angles] = near
    v = start.pivot
    moved: SliderMotion | SecondCrank | None = None
    if isinstance(pivot, SliderUnknown) and len(v):
        cosines, sines = np.append(v[1], v[2::2]), np.append(0.0, v[3::2])
        moved = SliderMotion(FourierSeries(normal.unit * cosines, normal.unit * sines), float(v[0]))
    elif isinstance(pivot, CrankUnknown) and len(v):
        series = FourierSeries(np.append(0.0, v[2::2]), np.append(0.0, v[3::2]))
        moved = SecondCrank(normal.unit * float(v[0]), pivot.ratio, float(wrap_angles(v[1])), series)
    made: type[Linkage] = FiveBar if isinstance(moved, SecondCrank) else start.linkage
    return made.from_vector(q, start.branch, pivot=moved)


def make_start(
    linkage: Linkage, normal: Normal, pivot: PivotUnknown | None = None, rotation: FloatArray | None = None
) -> Start:
    """Convert a linkage to a start.

    The Fourier series of its pivot's motion is truncated, or padded with zeros, to the harmonics of ``pivot``. ``rotation`` has
    the crank rotations of the stations, if the task does not give them.
    """
    q = np.append(linkage.vector, linkage.output_angle)
    q[0] -= normal.origin.real
    q[1] -= normal.origin.imag
    q[:7] /= normal.unit
    v = np.zeros(pivot_size(pivot))
    if isinstance(pivot, SliderUnknown) and isinstance(linkage.pivot, SliderMotion):
        series = linkage.pivot.series.to_order(pivot.harmonics)
        v[0], v[1] = linkage.pivot.guide_angle, series.mean / normal.unit
        v[2::2], v[3::2] = series.cos[1:] / normal.unit, series.sin[1:] / normal.unit
    elif isinstance(pivot, CrankUnknown):
        v[0] = pivot.length[0] / normal.unit
        if isinstance(linkage.pivot, SecondCrank):
            series = linkage.pivot.series.to_order(pivot.harmonics)
            v[0], v[1] = linkage.pivot.length / normal.unit, linkage.pivot.phase
            v[2::2], v[3::2] = series.cos[1:], series.sin[1:]
    kind = SliderCrank if isinstance(linkage, SliderCrank) else Linkage
    return Start(q=q, branch=linkage.branch, pivot=v, rotation=rotation, given=True, linkage=kind)


def convert_to_start(given: Linkage | Solution, normal: Normal, pivot: PivotUnknown | None) -> Start:
    """Convert a linkage or solution to a start, with crank rotations for untimed stations.

    These are the rotations of the solution, or else the rotations at which the linkage is nearest to the stations. Raises
    InputError if the rotations are not known and the path is open: nearest rotations are found for closed paths only.
    """
    linkage, rotation = (given.linkage, given.evaluation.rotation) if isinstance(given, Solution) else (given, None)
    if normal.timed:
        rotation = None
    elif rotation is None or len(rotation) != normal.n:
        if normal.points is not None and normal.closed:
            rotation = nearest_rotations(linkage, normal.places)
        elif rotation is None:
            raise InputError("a start for an open path needs the crank rotations of its stations")
        else:
            rotation = np.interp(np.linspace(0.0, 1.0, normal.n), np.linspace(0.0, 1.0, len(rotation)), rotation)
    return make_start(linkage, normal, pivot, rotation)


def closed_form_solutions(task: Task) -> tuple[Solution, ...]:
    """Return the four-bars without defects that do a task exactly, found in closed form; empty if there are none.

    Closed forms exist for untimed poses and for rocker functions, if there are as many targets as unknowns.
    """
    try:
        if isinstance(task, RockerFunction):
            return function_generators(task).sound
        if isinstance(task, PrecisionPoints | Motion) and task.angle is not None and task.rotation is None:
            return tuple(s for s in guidance(task).solutions if s.verdicts.sound)
    except InputError:
        # not as many targets as unknowns, or targets that depend on one another
        pass
    return ()


def keep_distinct(items: Iterable[Item], mark: Callable[[Item], FloatArray], distance: float, count: int) -> list[Item]:
    """Return the first ``count`` items that are distinct from one another.

    ``mark`` returns the vector that represents an item. Two items are distinct if a component of their vectors differs by at
    least ``distance``.
    """
    chosen: list[Item] = []
    marks: list[FloatArray] = []
    for item in items:
        own = mark(item)
        if any(np.abs(own - other).max() < distance for other in marks):
            continue
        marks.append(own)
        chosen.append(item)
        if len(chosen) == count:
            break
    return chosen
