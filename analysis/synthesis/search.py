"""How a search is done, and how its parts are spread over cores."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeVar

import joblib

from linkwork.errors import InputError

from ..files import unknown_name
from ..numerics.workers import end_with
from ..run import interruptible, shown

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
    n_jobs : int
        Cores, as `joblib.Parallel`.
    progress : bool
        Show a progress bar.
    """

    starts: int = 24
    solutions: int = 6
    seed: int = 0
    candidates: int = 1 << 16
    method: Method = "scan"
    n_jobs: int = 1
    progress: bool = False

    def __post_init__(self) -> None:
        for name in ("candidates", "solutions"):
            if getattr(self, name) < 1:
                raise InputError(f"{getattr(self, name)} {name}: there must be at least one")
        if self.n_jobs == 0:
            raise InputError("0 cores: it must be a number of them, or -1 for all")
        if self.method not in METHODS:
            raise unknown_name(self.method, METHODS, f"method {self.method!r}")
        if self.seed < 0 or int(self.seed) != self.seed or int(self.solutions) != self.solutions:
            raise InputError(
                f"seed {self.seed} and {self.solutions} solutions: both must be whole numbers, the seed not below zero"
            )

    @property
    def cores(self) -> int:
        """Number of cores, as `joblib.Parallel` counts them."""
        return int(joblib.effective_n_jobs(self.n_jobs))


USUAL_SEARCH = Search()
#: Where one search follows another.
QUICK_SEARCH = Search(starts=12)


def over_cores(
    work: Callable[[Item], Made], items: Sequence[Item], search: Search, what: str
) -> tuple[list[Made], bool]:
    """The results of all items, in their order on any number of cores; on Ctrl-C of those that were done, and True."""
    made: dict[int, Made] = {}
    with interruptible() as interrupted, shown(search.progress, float(len(items)), what) as show:
        if search.cores == 1:
            for number, item in enumerate(items):
                made[number] = work(item)
                show(float(number + 1))
                if interrupted:
                    break
        else:
            tasks = (joblib.delayed(_numbered)(work, number, item, os.getpid()) for number, item in enumerate(items))
            results = joblib.Parallel(n_jobs=search.cores, return_as="generator_unordered")(tasks)
            try:
                for number, value in results:
                    made[number] = value
                    show(float(len(made)))
                    if interrupted:
                        break
            except KeyboardInterrupt:  # of a worker
                interrupted.append(True)
            finally:
                with warnings.catch_warnings():
                    warnings.filterwarnings("ignore", message=".*still being processed", category=UserWarning)
                    results.close()
    return [made[number] for number in sorted(made)], bool(interrupted)


def _numbered(work: Callable[[Item], Made], number: int, item: Item, caller: int) -> tuple[int, Made]:
    end_with(caller)
    return number, work(item)
