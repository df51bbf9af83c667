"""How a search is done, and how its parts are spread over cores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

from linkwork.errors import InputError

from ..files import unknown_name
from ..numerics.workers import check_jobs, cores_of, interruptible, over_workers
from ..run import shown

Item = TypeVar("Item")
Made = TypeVar("Made")
Method = Literal["scan", "differential-evolution", "simplex"]
METHODS: tuple[Method, ...] = ("scan", "differential-evolution", "simplex")


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """How a search is done.

    Attributes
    ----------
    starts : int
        Searches that are run: of a scan, candidates that are polished.
    solutions : int
        At most that many different linkages are returned.
    seed : int
        The same seed gives the same solutions, on any number of cores.
    candidates : int
        Four-bars in the scan.
    method : "scan", "differential-evolution" or "simplex"
        The last two are for comparison: SciPy's differential evolution on the quality function as a black box, and the thesis's
        downhill simplex from many starts.
    n_jobs : int, optional
        Processes, -1 for one a core; of a cluster, inside `joblib.parallel_config`, all of its cores.
    progress : bool
        Show a progress bar.
    """

    starts: int = 24
    solutions: int = 6
    seed: int = 0
    candidates: int = 1 << 16
    method: Method = "scan"
    n_jobs: int | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        for name in ("candidates", "solutions"):
            if getattr(self, name) < 1:
                raise InputError(f"{getattr(self, name)} {name}: there must be at least one")
        check_jobs(self.n_jobs)
        if self.method not in METHODS:
            raise unknown_name(self.method, METHODS, f"method {self.method!r}")
        if self.seed < 0 or int(self.seed) != self.seed or int(self.solutions) != self.solutions:
            raise InputError(
                f"seed {self.seed} and {self.solutions} solutions: both must be whole numbers, the seed not below zero"
            )

    @property
    def cores(self) -> int:
        """Number of workers."""
        return cores_of(self.n_jobs)


USUAL_SEARCH = Search()
#: Where one search follows another.
QUICK_SEARCH = Search(starts=12)


def over_cores(
    work: Callable[[Item], Made], items: Sequence[Item], search: Search, what: str
) -> tuple[list[Made], bool]:
    """The results of all items, in their order on any number of cores; on Ctrl-C of those that were done, and True."""
    made: dict[int, Made] = {}
    with interruptible() as interrupted, shown(search.progress, float(len(items)), what) as show:
        for number, value in over_workers(work, items, interrupted, n_jobs=search.n_jobs):
            made[number] = value
            show(float(len(made)))
            if interrupted:
                break
    return [made[number] for number in sorted(made)], bool(interrupted)
