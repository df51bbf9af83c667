"""Compare `synthesize` with pylinkage's optimisers, SciPy's differential evolution and CMA-ES on fifty targets, at equal time.

    python -m benchmarks.race                              # runs what is not in the results yet, then prints the tables
    python -m benchmarks.race --again Linkwork             # runs a search afresh on all targets
    python -m benchmarks.race --budget 1 --target square --results out/few.csv

pylinkage's differential evolution calls SciPy's. SciPy's takes part directly, and evaluates a whole generation at once.

Every search has the same unknowns, bounds, constraints and measure (`benchmarks.contest`), and the same processor time on one
thread, so that other work on the machine does not matter. Code is compiled beforehand. Each search is restarted until its time
is over. `synthesize` is called with `FIRST`, then with other seeds and twice the candidates and starts each time. The answer of
a call counts from the end of the call, if that is in time.

The results have a row for each target and search: the least error after each of `TIMES`, infinite as long as no linkage
satisfies the constraints. The file is rewritten after every row. A run that is stopped keeps its rows; the next run continues.
"""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import count
from math import inf, isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from threadpoolctl import threadpool_limits

from analysis.synthesis import InfeasibleError, Search, synthesize
from analysis.synthesis.search.program import make_start

from . import tables
from .black_box import BlackBox
from .contest import (
    BlackBoxSearch,
    Contest,
    Trace,
    run_search,
    search_with_cma,
    search_with_pylinkage_simplex,
    search_with_scipy,
    search_with_swarm,
)
from .targets import TARGETS, Target

OURS = "Linkwork"
RESULTS = Path("out/race.csv")
#: Times at which the error is recorded (s), and the time for each search.
TIMES = (0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0)
BUDGET = 3.0
#: Settings of the first call of `synthesize`, and how often their effort is doubled.
FIRST, DOUBLED = Search(candidates=1 << 11, starts=1), 5
#: Largest relative difference of errors that count as equal; largest error that counts as exact, in sizes of the target.
LEVEL, EXACT = 1e-3, 1e-6
#: A search has found a target if its error is at most this fraction above the least final error of all searches.
FOUND = 0.05


class Row(NamedTuple):
    """Errors of a search on a target at `TIMES`: in m2, or in rad2 for a function.

    An error of at most ``exact`` counts as exact.
    """

    kind: str
    target: str
    search: str
    exact: float
    errors: tuple[float, ...]

    def least_error(self, seconds: float) -> float:
        """Return the error at one of `TIMES` (s), or the error that counts as exact if this is greater."""
        return max(self.exact, self.errors[TIMES.index(seconds)])


# Running


def search_with_linkwork(trace: Trace, box: BlackBox, random: np.random.Generator) -> None:
    """Call `synthesize` with growing effort; measure its answers in the same way as those of the other searches."""
    target, limits, normal = trace.contest.target, trace.contest.limits, trace.contest.normal
    boxes = {box.branch: box for box in trace.contest.boxes}
    for k in count():
        more = 1 << min(k, DOUBLED)
        search = Search(candidates=more * FIRST.candidates, starts=more * FIRST.starts, seed=k)
        with suppress(InfeasibleError):
            answer = synthesize(target.task, target.bounds, target.constraints, kinds=("four-bar",), search=search)
            linkage = answer.best.linkage
            q = make_start(linkage, normal).q
            if ((q >= limits.low - EXACT) & (q <= limits.high + EXACT)).all():
                trace.record_if_best(boxes[linkage.branch], q[limits.high > limits.low])
        trace.tick()


RACERS: Mapping[str, BlackBoxSearch] = {
    OURS: search_with_linkwork,
    "SciPy DE": search_with_scipy,
    "CMA-ES": search_with_cma,
    "pylinkage swarm": search_with_swarm,
    "pylinkage Nelder-Mead": search_with_pylinkage_simplex,
}


def run(target: Target, search: str, budget: float) -> Row:
    """Run one search on a target."""
    contest = Contest.from_target(target)
    normal = contest.normal
    with threadpool_limits(1):
        trace = run_search(RACERS[search], contest, budget)
    exact = (EXACT * normal.unit) ** 2 * (1.0 if contest.on_area else float(normal.weights.sum()))
    errors = tuple(trace.least_error(seconds) if seconds <= budget else np.nan for seconds in TIMES)
    return Row(target.kind, target.name, search, exact, errors)


def prepare_searches() -> None:
    """Compile and load everything that the searches need, before they are timed."""
    for target in {target.kind: target for target in TARGETS}.values():
        for search in RACERS:
            run(target, search, 0.2)


# Results


def read(path: Path) -> list[Row]:
    """Read the rows of a file; return an empty list if there is no file."""
    rows = ([*row.values()] for row in tables.read(path)) if path.exists() else ()
    return [Row(kind, name, by, float(exact), tuple(map(float, errors))) for kind, name, by, exact, *errors in rows]


def write(path: Path, rows: Iterable[Row]) -> None:
    """Write rows to a file."""
    headings = ["kind", "target", "search", "exact", *(f"{seconds:g} s" for seconds in TIMES)]
    tables.write(path, headings, ([*row[:3], *(f"{v:.6g}" for v in (row.exact, *row.errors))] for row in rows))


def sort_rows(rows: Iterable[Row]) -> list[Row]:
    """Sort rows by target, then by search, in the order of `TARGETS` and `RACERS`."""
    targets = [(target.kind, target.name) for target in TARGETS]
    return sorted(rows, key=lambda row: (targets.index(row[:2]), list(RACERS).index(row.search)))


def run_missing(
    path: Path, targets: Sequence[Target], searches: Sequence[str], budget: float, say: Callable[..., Any]
) -> None:
    """Run the searches whose rows are missing in the file of results, and add the rows; report each one by ``say``."""
    rows = {row[:3]: row for row in read(path)}
    wanted = [(target, search) for target in targets for search in searches]
    missing = [(t, s) for t, s in wanted if (t.kind, t.name, s) not in rows]
    if missing:
        prepare_searches()
    for target, search in missing:
        row = run(target, search, budget)
        rows[row[:3]] = row
        write(path, sort_rows(rows.values()))
        say(f"{target.kind}, {target.name}: {search} {row.least_error(last_time([row])):.4g}")


# Tables


def last_time(rows: Iterable[Row]) -> float:
    """Return the last of `TIMES` (s) at which all rows have an error."""
    return max(seconds for k, seconds in enumerate(TIMES) if not any(np.isnan(row.errors[k]) for row in rows))


def rows_by_target(rows: Iterable[Row]) -> dict[tuple[str, str], dict[str, Row]]:
    """Return, for each target on which all searches have run, its rows by search."""
    found: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        found.setdefault(row[:2], {})[row.search] = row
    return {target: by_search for target, by_search in found.items() if set(by_search) == set(RACERS)}


def rival_error(by_search: Mapping[str, Row], seconds: float) -> float:
    """Return the least error of all searches except ours after a time (s); ``by_search`` has the rows of a target."""
    return min(row.least_error(seconds) for search, row in by_search.items() if search != OURS)


def is_ahead(by_search: Mapping[str, Row], seconds: float) -> bool:
    """Return whether no other search has a smaller error than ours; differences within `LEVEL` do not count."""
    ours = by_search[OURS].least_error(seconds)
    return isfinite(ours) and ours <= (1.0 + LEVEL) * rival_error(by_search, seconds)


def is_level(by_search: Mapping[str, Row], seconds: float) -> bool:
    """Return whether our search is ahead and the best other search is equal to it within `LEVEL`."""
    ours = by_search[OURS].least_error(seconds)
    return is_ahead(by_search, seconds) and rival_error(by_search, seconds) <= (1.0 + LEVEL) * ours


def has_found(by_search: Mapping[str, Row], search: str, seconds: float, end: float) -> bool:
    """Return whether a search is within `FOUND` of the least error that any search has at the time ``end`` (s)."""
    return by_search[search].least_error(seconds) <= (1.0 + FOUND) * min(
        row.least_error(end) for row in by_search.values()
    )


def standings(rows: Sequence[Row]) -> list[list[str]]:
    """Count, for each time, the targets on which Linkwork is ahead or level, and the targets that each search has found."""
    targets, end = rows_by_target(rows).values(), last_time(rows)
    return [
        [
            f"{seconds:g}",
            f"{sum(is_ahead(by_search, seconds) for by_search in targets)} of {len(targets)}",
            str(sum(is_level(by_search, seconds) for by_search in targets)),
            *(str(sum(has_found(by_search, search, seconds, end) for by_search in targets)) for search in RACERS),
        ]
        for seconds in TIMES
        if seconds <= end
    ]


def finals(rows: Sequence[Row]) -> list[list[str]]:
    """List the final errors of all searches, a row for each target, with the least error in bold."""
    end = last_time(rows)
    lines = []
    for (kind, name), by_search in rows_by_target(rows).items():
        least = min(row.least_error(end) for row in by_search.values())

        def cell(row: Row, least: float = least) -> str:
            value = row.least_error(end)
            text = "exact" if value <= row.exact else f"{value:.4g}" if value < inf else "none"
            return f"**{text}**" if value <= (1.0 + LEVEL) * least else text

        lines.append([kind, name, *(cell(by_search[search]) for search in RACERS)])
    return lines


def list_losses(rows: Sequence[Row]) -> list[str]:
    """List the targets on which another search has a smaller final error, with the relative difference."""
    end = last_time(rows)
    return [
        f"- {kind}, {name}: {by_search[OURS].least_error(end) / rival_error(by_search, end) - 1.0:.2%} above "
        f"{min(by_search.values(), key=lambda row: row.least_error(end)).search}"
        for (kind, name), by_search in rows_by_target(rows).items()
        if not is_ahead(by_search, end)
    ]


def markdown(rows: Sequence[Row], part: str) -> str:
    """Return a part of the page of results in Markdown: the table "standings" or "targets", or the list "lost"."""
    if part == "lost":
        return "\n".join(list_losses(rows) or ["None."])
    headings, lines = {
        "standings": (["s", "Linkwork ahead", "of these level", *RACERS], standings),
        "targets": (["kind", "target", *RACERS], finals),
    }[part]
    return tables.markdown(headings, lines(rows))


def picture(rows: Sequence[Row]) -> Any:
    """Return a figure: the number of targets that each search has found over time, and final errors divided by the least."""
    from analysis.figures import Curve, Panel, plot_curves

    targets, end = rows_by_target(rows).values(), last_time(rows)
    times = [seconds for seconds in TIMES if seconds <= end]
    over_time, profile = [], []
    for search in RACERS:
        width = 2.2 if search == OURS else 1.0
        shares = [sum(has_found(by_search, search, seconds, end) for by_search in targets) for seconds in times]
        ratios = np.sort(
            [
                by_search[search].least_error(end) / min(row.least_error(end) for row in by_search.values())
                for by_search in targets
            ]
        )
        over_time.append(Curve(x=times, y=shares, label=search, width=width))
        profile.append(Curve(x=ratios[np.isfinite(ratios)], y=1 + np.flatnonzero(np.isfinite(ratios)), width=width))
    panels = [
        Panel(
            x_label="time of the processor [s]",
            y_label=f"targets within {FOUND:.0%} of the best",
            curves=over_time,
            logarithmic="x",
            y_range=(0.0, len(targets)),
            legend_at="outside",
        ),
        Panel(
            x_label=f"error after {end:g} s, over the least of all",
            y_label="targets",
            curves=profile,
            logarithmic="x",
            x_range=(0.95, 100.0),
            y_range=(0.0, len(targets)),
        ),
    ]
    return plot_curves(panels, title=f"Quality over time on {len(targets)} targets")


def main(path: Path, targets: Sequence[Target], searches: Sequence[str], budget: float, again: Sequence[str]) -> None:
    """Run the missing searches, and print the tables."""
    console = Console(width=200)
    write(path, [row for row in read(path) if row.search not in again])
    run_missing(path, targets, searches, budget, lambda text: console.print(text, highlight=False))
    rows = read(path)
    for part in ("targets", "standings", "lost"):
        console.print(f"{part}\n{markdown(rows, part)}\n", highlight=False, markup=False)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--budget", type=float, default=BUDGET, help="processor time of each search on each target (s)")
    parser.add_argument("--target", action="append", help="run only this target (repeatable)")
    parser.add_argument("--search", choices=tuple(RACERS), action="append", help="run only this search (repeatable)")
    parser.add_argument("--again", choices=tuple(RACERS), action="append", default=[], help="run this search afresh")
    parser.add_argument("--results", type=Path, default=RESULTS, help="CSV file with the results")
    given = parser.parse_args()
    chosen = [target for target in TARGETS if not given.target or target.name in given.target]
    main(given.results, chosen, given.search or tuple(RACERS), given.budget, given.again)
