"""`trade_off`: the least error of a task over a limit of size, transmission angle or pin force that is tightened."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, Interrupted

from ..files import write_csv
from ..units import in_si
from .constraints import (
    USUAL,
    Constraint,
    InfeasibleError,
    LargestLink,
    LeastTransmission,
)
from .forces import MaxPinForce
from .kinds import GEARS, Kind, Stroke
from .linkage import UNITS
from .search import QUICK_SEARCH, Search
from .solution import Solution, ranked
from .solve import SynthesisInterrupted, columns_of, synthesize
from .starts import PivotUnknown
from .tasks import Task


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TradeOff:
    """The least error over a limit that is tightened.

    Attributes
    ----------
    over : str
        What it is over, of `OVER`.
    limit : ndarray, shape (n,)
        Largest link (m), least transmission angle (rad), or greatest force on a pin (N).
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

    def columns(self) -> dict[str, list[float]]:
        """Each limit with the columns of its best linkage, as in `Synthesis.columns`; limits without one are left out."""
        there = [(float(limit), s) for limit, s in zip(self.limit, self.solutions) if s is not None]
        over = OVER[self.over]
        columns = columns_of([s for _, s in there])
        columns.pop("rank", None)
        return {f"limit of {over.name} [{over.unit}]": [limit for limit, _ in there], **columns}

    def to_csv(self, path: str | Path) -> Path:
        """Write `columns` to a CSV file."""
        return write_csv(path, self.columns())


class Over(NamedTuple):
    """What an error is traded for: what its limit is, SI unit, and whether a small limit is the tight one."""

    name: str
    unit: str
    small: bool


OVER: Mapping[str, Over] = {
    "size": Over("largest link", "m", True),
    "transmission": Over("least transmission angle", "rad", False),
    "pin-force": Over("greatest pin force", "N", True),
}


class TradeOffInterrupted(Interrupted):
    """A trade-off was stopped from the keyboard; ``trade_off`` has the best so far at each limit, None where there is none."""

    def __init__(self, trade_off: TradeOff, done: int, problems: int) -> None:
        self.trade_off = trade_off
        super().__init__(f"stopped after {done} of {problems} problems of the trade-off")


@in_si(bounds=UNITS)
def trade_off(
    task: Task,
    over: Literal["size", "transmission", "pin-force"],
    limits: ArrayLike,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    constraints: Sequence[Constraint | Stroke] = USUAL,
    weights: ArrayLike | None = None,
    *,
    pivot: PivotUnknown | None = None,
    search: Search = QUICK_SEARCH,
    kinds: Sequence[Kind] | None = None,
    gears: Sequence[float] = GEARS,
) -> TradeOff:
    """Error against size or transmission angle, by the epsilon-constraint method with warm starts.

    From the loosest limit to the tightest each problem starts from its own scan and from the solutions of the one before; a
    second pass goes back, so that a solution found late serves the looser limits too, itself or polished anew: the error of
    sound linkages can only grow as a limit is tightened.

    Parameters
    ----------
    task : Task
    over : "size", "transmission" or "pin-force"
    limits : array_like, shape (n,)
        Largest links (m), least transmission angles (rad), or greatest forces on the pins (N).
    bounds, constraints, weights, pivot, kinds, gears
        As for `synthesize`; the limit takes the place of a constraint of its own kind. Of pin forces a `MaxPinForce` among the
        constraints says what is made and how it runs.
    search : Search
        As for `synthesize`, but for the candidates, at most 16384, and the solutions.

    Raises
    ------
    InputError
        If ``over`` or the limits are not usable.
    TradeOffInterrupted
        On Ctrl-C, with the best so far at each limit.
    """
    if over not in OVER:
        raise InputError(f"a trade-off over {over!r}: it must be one of {', '.join(OVER)}")
    values = np.array(limits, dtype=float)
    kind = {"size": LargestLink, "transmission": LeastTransmission, "pin-force": MaxPinForce}[over]
    running = next((c for c in constraints if isinstance(c, MaxPinForce)), MaxPinForce(force=1.0))
    if values.ndim != 1 or len(values) < 2 or not np.isfinite(values).all():
        raise InputError("the limits of a trade-off must be finite numbers, at least two")
    rest = tuple(c for c in constraints if not isinstance(c, kind))
    first = replace(search, candidates=min(search.candidates, 1 << 14), solutions=3)
    order = np.argsort(-values if OVER[over].small else values)

    def limit(k: int) -> Constraint:
        if over == "pin-force":
            return replace(running, force=values[k])
        return LargestLink(length=values[k]) if over == "size" else LeastTransmission(angle=values[k])

    def best(k: int, guesses: Sequence[Solution], back: bool) -> tuple[Solution, ...]:
        how = replace(first, starts=1, candidates=1 << 8) if back else first
        which: dict[str, Any] = {"pivot": pivot, "kinds": kinds, "gears": gears}
        return synthesize(task, bounds, (*rest, limit(k)), weights, guesses=guesses, search=how, **which).solutions

    found, done = there_and_back(order.tolist(), best)
    result = TradeOff(over=over, limit=values, solutions=tuple(found.get(k) for k in range(len(values))))
    if done is not None:
        raise TradeOffInterrupted(result, done, 2 * len(values))
    return result


def there_and_back(
    order: Sequence[int],
    search: Callable[[int, Sequence[Solution], bool], Sequence[Solution]],
    begin: Sequence[Solution] = (),
) -> tuple[dict[int, Solution], int | None]:
    """The best solutions of a row of problems, each started from the ones before it, from the loosest to the tightest and back.

    Parameters
    ----------
    order : sequence of int
        The problems, the loosest first.
    search : callable
        Solutions of a problem by its number, from guesses, on the way back or not; it may raise `InfeasibleError`.
    begin : sequence of Solution
        Guesses for the first problem.

    Returns
    -------
    found : dict
        The best solution of each problem that has one. On the way back what keeps the tighter limit keeps the looser one too:
        errors can only grow as the limit is tightened.
    done : int or None
        If it was stopped from the keyboard, how many of twice the problems were done.
    """
    found: dict[int, Solution] = {}
    for back in (False, True):
        previous = [] if back else list(begin)
        for number, k in enumerate(order[::-1] if back else order):
            own = [found[k]] if k in found else []
            guesses = [*previous, *own]
            if back and not guesses:
                continue
            kept = guesses if back else own
            done: int | None = None
            try:
                result = search(k, guesses, back)
            except InfeasibleError:
                result = ()
            except (SynthesisInterrupted, KeyboardInterrupt) as error:
                last = error.synthesis if isinstance(error, SynthesisInterrupted) else None
                result, done = last.solutions if last else (), back * len(order) + number
            if result or kept:
                found[k] = ranked([*kept, *result])[0]
                previous = [found[k]] if back else list(result)
            if done is not None:
                return found, done
    return found, None
