"""Commands about design: linkages that trace what is asked for."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from rich.markup import escape
from rich.table import Table

from .common import INTERRUPTED, changes, console, errors, handled, print_written


def settings_of(settings: Sequence[str]) -> dict[str, Any]:
    """Overrides of a case file from NAME=VALUE: a value of TOML, else a text with its unit."""

    def value(text: str) -> Any:
        try:
            return tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            return text

    return changes(settings, value, "constraints.largest_link='300 mm'")


def show_solutions(title: str, solutions: Sequence[Any]) -> None:
    """Ranked solutions as a table, in mm and degrees."""
    from ..synthesis.report import DEFECTS, degrees_told, error_unit, quality_name, quality_unit

    task = solutions[0].task
    factor, unit = quality_unit(task)
    scale, length = error_unit(task)
    grid = Table(title=escape(title), title_justify="left")
    headings = (
        "",
        f"{quality_name(task)} [{unit}]",
        f"rms error [{length}]",
        f"worst [{length}]",
        "largest link [mm]",
        "transmission angle [deg]",
        "verdict",
    )
    for heading in headings:
        grid.add_column(escape(heading), justify="left" if heading == "verdict" else "right")
    for rank, s in enumerate(solutions, start=1):
        v = s.verdicts
        defects = [f"{name} defect" for name in DEFECTS if not getattr(v, name)]
        words = [v.grashof, *([] if v.full_turn else ["no full turn"]), *defects]
        grid.add_row(
            str(rank),
            f"{factor * s.error:.5g}",
            f"{scale * s.evaluation.rms:.4g}",
            f"{scale * s.evaluation.worst:.4g}",
            f"{1e3 * s.linkage.largest_link:.6g}",
            degrees_told(v),
            ", ".join(words),
            style=None if v.sound else "yellow",
        )
    console.print(grid)


def show_best(solution: Any) -> None:
    """Dimensions of a solution, and what an error in each costs."""
    from ..synthesis.report import dimension_rows, rounding_told

    head, *rows = dimension_rows(solution)
    grid = Table(title="the first of them", title_justify="left")
    for k, heading in enumerate(head):
        grid.add_column(heading, justify="left" if k == 0 else "right")
    for row in rows:
        grid.add_row(*row)
    console.print(grid)
    console.print(rounding_told(solution), highlight=False, soft_wrap=True)


def write_described(solution: Any, folder: Path, title: str, *, curve: str, report: str, drawing: str) -> list[Path]:
    """The curve of a solution, its report, and its drawing as DXF and SVG, under these names; what was written."""
    from ..files import save_drawing

    told = folder / f"{report}.txt"
    written = [solution.to_csv(folder / f"{curve}.csv"), told]
    told.write_text(f"{title}\n\n{solution.report()}", encoding="utf-8")
    drawn = solution.drawing(title=title)
    return written + [save_drawing(folder / f"{drawing}.{ending}", drawn) for ending in ("dxf", "svg")]


def write_solution(solution: Any, folder: Path, title: str, *, make: Any, plots: bool, animate: bool) -> list[Path]:
    """Everything about one solution: drawing, curve, report, parameters and a case that runs; what was written."""
    from ..files import save_figure, write_tables
    from ..run.case_files import save_parameters
    from ..synthesis.linkage import SecondCrank

    written = write_described(solution, folder, title, curve="best-curve", report="best-report", drawing="best")
    pivot = solution.linkage.pivot
    if not isinstance(pivot, SecondCrank):
        written.append(save_parameters(folder / "five-bar-parameters.toml", make.five_bar(solution)))
    if pivot is None:
        written.append(write_tables(folder / "five-bar.toml", make.run_case(solution, title)))
    if plots:
        written.append(save_figure(solution.plot(title=title), folder / "best-linkage.png"))
    if animate:
        with console.status("animating"):
            written.append(solution.animate(folder / "best.gif", title=title))
    return written


@click.command()
@click.argument("case", type=click.Path(exists=True, dir_okay=False))
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="Change a value, such as constraints.largest_link='300 mm' or task.n=36; lists as in TOML.",
)
@click.option("--method", help="scan, differential-evolution or simplex; the last two for comparison.")
@click.option("--seed", type=click.IntRange(0), help="Of the scan: the same seed gives the same linkages.")
@click.option("--jobs", type=int, help="Cores; -1 for all.")
@click.option(
    "--out", default="out", show_default=True, type=click.Path(file_okay=False), help="Folder for the results."
)
@click.option("--plots/--no-plots", default=True, show_default=True, help="Whether to write plots.")
@click.option("--animate", is_flag=True, help="Write a GIF of the first linkage over a turn, too.")
@handled
def synthesize(
    case: str,
    settings: Sequence[str],
    method: str | None,
    seed: int | None,
    jobs: int | None,
    out: str,
    plots: bool,
    animate: bool,
) -> None:
    """Find linkages that do what a CASE file (TOML or JSON) asks for: a path, a function of the rocker, a motion.

    Writes the ranked linkages, and of the first its drawing (DXF, SVG), curve, report, plots, the parameters of the FMU, and a
    case that 'linkwork run' runs.

    \b
    Examples:
      linkwork synthesize examples/ellipse.toml
      linkwork synthesize examples/hand-drawn.toml --out hand-drawn --animate
      linkwork synthesize examples/ellipse.toml --set constraints.largest_link='300 mm' --set task.n=36
    """
    from ..files import save_figure
    from ..synthesis import SynthesisInterrupted, TradeOffInterrupted
    from ..synthesis.cases import load_synthesis_case

    overrides = settings_of(settings)
    for name, value in (("method", method), ("seed", seed), ("jobs", jobs)):
        if value is not None:
            overrides[f"search.{name}"] = value
    chosen = load_synthesis_case(case, overrides)
    folder = Path(out)
    stopped: SynthesisInterrupted | None = None
    try:
        result = chosen.solve(progress=console.is_terminal)
    except SynthesisInterrupted as error:
        if error.synthesis is None:
            raise
        result, stopped = error.synthesis, error
    show_solutions(f"{chosen.title}: {len(result.solutions)} linkages, {result.seconds:.1f} s", result.solutions)
    show_best(result.best)
    folder.mkdir(parents=True, exist_ok=True)
    written = [result.to_csv(folder / "solutions.csv")]
    written += write_solution(result.best, folder, chosen.title, make=chosen.make, plots=plots, animate=animate)
    if plots:
        written.append(io.save_figure(result.plot(title=chosen.title), folder / "alternatives.png"))
    print_written(written)
    if not result.best.verdicts.sound:
        errors.print(
            f"note: none of them is free of defects: the first has {result.best.verdicts}",
            style="yellow",
            highlight=False,
            soft_wrap=True,
        )
    if stopped is not None:
        errors.print(f"{stopped}; the best so far is kept", style="yellow", highlight=False, soft_wrap=True)
        sys.exit(INTERRUPTED)
    halted: TradeOffInterrupted | None = None
    try:
        traded = chosen.trade(progress=console.is_terminal)
    except TradeOffInterrupted as error:
        traded, halted = error.trade_off, error
    if traded is not None:
        _trade_off(traded, chosen.title, folder, plots)
    if halted is not None:
        errors.print(f"{halted}; what there is is kept", style="yellow", highlight=False, soft_wrap=True)
        sys.exit(INTERRUPTED)


def _trade_off(traded: Any, title: str, folder: Path, plots: bool) -> None:
    from ..files import save_figure
    from ..synthesis.report import error_unit, limit_told, quality_name, quality_unit

    there = [s for s in traded.solutions if s is not None]
    what = "largest link" if traded.over == "size" else "least transmission angle"
    if not there:
        errors.print(f"note: no linkage keeps any of the limits of the {what}", style="yellow", highlight=False)
        return
    (factor, unit), (scale, length) = quality_unit(there[0].task), error_unit(there[0].task)
    grid = Table(title=escape(f"{title}: error against the {what}"), title_justify="left")
    for heading in ("limit", f"{quality_name(there[0].task)} [{unit}]", f"worst [{length}]"):
        grid.add_column(escape(heading), justify="right")
    for limit, s in zip(traded.limit, traded.solutions):
        numbers = ("no linkage", "") if s is None else (f"{factor * s.error:.5g}", f"{scale * s.evaluation.worst:.4g}")
        grid.add_row(limit_told(traded.over, float(limit)), *numbers)
    console.print(grid)
    written = [traded.to_csv(folder / "trade-off.csv")]
    if plots:
        written.append(io.save_figure(traded.plot(title=title), folder / "trade-off.png"))
    print_written(written)
