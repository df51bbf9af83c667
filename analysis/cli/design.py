"""`linkwork synthesize`: find linkages for a task; and functions that all commands about synthesis share."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from linkwork.errors import Interrupted

from ..display import format_count
from ..libraries import MissingLibraryError
from . import common

if TYPE_CHECKING:
    from ..files import Drawing
    from ..synthesis import Assessment, MachineSpec, PinForces, Solution, TradeOff

#: Number of further positions of the linkage that a drawing shows.
POSES = 6


def leave_if_stopped(stopped: Interrupted | None, kept: str) -> None:
    """Exit with the code for an interruption, unless ``stopped`` is None; the sentence ``kept`` says what results are kept."""
    if stopped is not None:
        common.print_error(f"{stopped}; {kept}")
        sys.exit(common.INTERRUPTED)


def search_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add to a command the options that all commands with a search have: plots, folder, workers, seed, objective."""
    for option in (
        common.plot_option,
        common.out_option(help="Folder for the results."),
        common.workers_options(),
        click.option(
            "--seed", type=click.IntRange(0), help="Seed of the search: the same seed gives the same linkages."
        ),
        click.option(
            "--objective",
            type=click.Choice(("error", "worst")),
            help="The objective instead of the case's: error, the quality function of the task, or worst, the greatest error.",
        ),
    ):
        command = option(command)
    return command


def read_overrides(settings: Sequence[str], **options: Any) -> dict[str, Any]:
    """Return the new values of entries of a case file, from ``--set`` and from other options, ``table__name=value``."""
    given = {name.replace("__", "."): value for name, value in options.items() if value is not None}
    return common.changes(settings, "constraints.largest_link='300 mm'") | given


def print_solutions(
    title: str,
    solutions: Sequence[Solution],
    forces: Sequence[PinForces] | None = None,
    violated: Callable[[Solution], str] | None = None,
) -> None:
    """Print a table of ranked solutions, in mm and degrees, with their greatest pin forces if ``forces`` are given.

    ``violated`` returns the constraint that a linkage violates, or an empty text; linkages that violate one are marked.
    """
    from ..synthesis import format_transmission, format_variants, quality_cells, quality_headings

    headings = ["", *quality_headings(solutions[0].task), "largest link [mm]", "transmission angle [deg]"]
    rows = [
        [str(rank), *quality_cells(s), f"{1e3 * s.largest_link:.6g}", format_transmission(s.verdicts)]
        for rank, s in enumerate(solutions, start=1)
    ]
    broken = [violated(s) if violated else "" for s in solutions]
    columns = {
        "pin force [N]": [f"{force.greatest:.4g} on {force.pin}" for force in forces or ()],
        "verdict": [
            ", ".join([v.grashof, *([] if v.full_turn else ["no full turn"]), *v.defects])
            for v in (s.verdicts for s in solutions)
        ],
        "also found": [format_variants(s) for s in solutions],
        "violates": broken,
    }
    for heading, cells in columns.items():
        if any(cells):
            headings.append(heading)
            for row, cell in zip(rows, cells):
                row.append(cell)
    styles = [None if s.verdicts.sound and not what else "yellow" for s, what in zip(solutions, broken)]
    common.show_table(title, headings, rows, styles=styles)


def print_best(best: Assessment) -> None:
    """Print the dimensions of a solution, and the effect of an error in each dimension."""
    head, *rows = best.dimensions
    common.show_table("the first of them", head, rows)
    common.say(best.rounding)


def write_description_files(
    best: Assessment, folder: Path, title: str, *, curve: str, text: str, drawn: str
) -> list[Path]:
    """Write curve, report and drawing (DXF and SVG) of a solution to files, and return the paths.

    ``curve``, ``text`` and ``drawn`` are the names of the files without ending; ``title`` is the title in report and drawing.
    """
    from ..files import write_text
    from ..synthesis import drawing

    described = write_text(folder / f"{text}.txt", f"{title}\n\n{best.report}")
    written = [best.solution.to_csv(folder / f"{curve}.csv"), described]
    picture = drawing(best.solution, poses=POSES, title=title)
    return written + _save_drawing(picture, folder / drawn)


def _save_drawing(picture: Drawing, path: Path) -> list[Path]:
    """Write a drawing as DXF and SVG, and return the paths; ``path`` is without ending. Without ezdxf, write SVG and a note."""
    from ..files import save_drawing

    written = [save_drawing(f"{path}.svg", picture)]
    try:
        return [save_drawing(f"{path}.dxf", picture), *written]
    except MissingLibraryError as error:
        common.note(f"{path}.dxf was not written: {error}")
        return written


def write_linkages(solutions: Sequence[Solution], folder: Path, title: str, *, make: MachineSpec) -> list[Path]:
    """Write the first linkage, and all others that have no defect, as case files for runs; return the paths."""
    from ..files import write_tables
    from ..synthesis import described_case

    names = [(s, "linkage.toml" if rank == 1 else f"linkage-{rank}.toml") for rank, s in enumerate(solutions, start=1)]
    return [
        write_tables(folder / name, described_case(s, make, title), head=make.describe_masses())
        for s, name in names
        if s is solutions[0] or s.verdicts.sound
    ]


def write_solution(
    best: Assessment, folder: Path, title: str, *, make: MachineSpec, plot: bool, animate: bool
) -> list[Path]:
    """Write all files of one solution: drawings, plates, curve, report, parameters, case of a run, plots; return the paths."""
    from .. import figures
    from ..files import save_figure, write_tables
    from ..run import save_parameters
    from ..synthesis import neglected_load, plates, run_case

    written = write_description_files(best, folder, title, curve="best-curve", text="best-report", drawn="best")
    solution = best.solution
    linkage = solution.linkage
    if linkage.kind == "four-bar":
        written.append(
            save_parameters(folder / "five-bar-parameters.toml", make.five_bar(linkage), head=make.describe_masses())
        )
    if linkage.pivot is None:
        case = folder / ("slider-crank.toml" if linkage.kind == "slider-crank" else "five-bar.toml")
        head = make.describe_masses()
        if left_out := neglected_load(linkage, make):
            common.note(left_out)
            head += f"; {left_out}"
        written.append(write_tables(case, run_case(solution, make, title), head=head))
    cut = plates(solution, width=make.width, thickness=make.thickness, pin=make.hole, title=title)
    written += _save_drawing(cut, folder / "best-plates")
    written += common.save_plot(plot, solution, folder / "best-linkage.png", title=title)
    if plot:
        forces = _forces(solution, make)
        made = make.describe(forces=forces is not None, linkage=linkage)
        sheet = figures.plot_sheet(best, forces, title=title, made=made)
        written.append(save_figure(sheet, folder / "best-sheet.pdf"))
    if animate:
        with common.console.status("animating"):
            written.append(figures.animate(solution, folder / "best.gif", title=title))
    return written


def _forces(solution: Solution, make: MachineSpec) -> PinForces | None:
    """Return the pin forces at constant crank speed.

    Return None if a slider moves the pivot, or if the linkage has a circuit or branch defect.
    """
    from ..synthesis import pin_forces

    if solution.linkage.pivot is not None or not (solution.verdicts.circuit and solution.verdicts.branch):
        return None
    return pin_forces(solution.linkage, make, solution.rotation_range)


@click.command()
@click.argument("case", type=click.Path(exists=True, dir_okay=False))
@common.set_option("constraints.largest_link='300 mm' or task.n=36; lists as in TOML")
@search_options
@click.option("--animate", is_flag=True, help="Write also a GIF of the first linkage over a turn.")
@common.report_errors
def synthesize(
    case: str,
    settings: Sequence[str],
    objective: str | None,
    seed: int | None,
    jobs: int | None,
    out: str,
    plot: bool,
    animate: bool,
) -> None:
    """Find linkages for the task of a CASE file (TOML or JSON): a path, a function, a quick return or a motion.

    The entry search.kinds selects four-bars, slider-cranks and geared five-bars. The command writes the ranked linkages. For
    the first of them it also writes drawing and plates (DXF, SVG), a sheet (PDF), curve, report, plots, the FMU's parameters,
    and a case for 'linkwork run'.

    \b
    Examples:
      linkwork synthesize examples/ellipse.toml
      linkwork synthesize examples/hand-drawn.toml --out hand-drawn --animate
      linkwork synthesize examples/kinds.toml --set search.kinds='["slider-crank"]'
      linkwork synthesize examples/ellipse.toml --set constraints.largest_link='300 mm' --set task.n=36
    """
    from .. import synthesis as syn
    from ..files import write_csv

    overrides = read_overrides(settings, task__objective=objective, search__seed=seed, search__jobs=jobs)
    common.check_kind(case, common.SYNTHESIS)
    chosen = syn.load_synthesis_case(case, overrides)
    stopped: Interrupted | None = None
    try:
        result = chosen.solve(progress=common.console.is_terminal)
    except syn.SynthesisInterrupted as error:
        if error.synthesis is None:
            raise
        result, stopped = error.synthesis, error
    forces = chosen.forces(result.with_variants)
    title = f"{chosen.title}: {format_count(len(result.solutions), 'linkage')}, {result.seconds:.1f} s"
    print_solutions(title, result.solutions, forces)
    best = syn.assess(result.best, chosen.worst_violation)
    print_best(best)
    folder = common.output_folder(out)
    carried = {"greatest pin force [N]": [force.greatest for force in forces]} if forces else {}
    written = [write_csv(folder / "solutions.csv", result.columns() | carried)]
    if syn.has_cognates(result.best):
        others = syn.alternatives(result.best)
        print_solutions(
            "the same curve from other pivots: the first one's cognates", others, violated=chosen.worst_violation
        )
        written.append(write_csv(folder / "cognates.csv", syn.solution_columns(others)))
    written += write_solution(best, folder, chosen.title, make=chosen.make, plot=plot, animate=animate)
    written += write_linkages(result.solutions, folder, chosen.title, make=chosen.make)
    written += common.save_plot(plot, result, folder / "alternatives.png", title=chosen.title)
    common.print_paths(written)
    for note in filter(None, (best.poor, syn.format_short(best.solution), syn.format_sense(chosen.task))):
        common.note(note)
    if crowded := syn.crowded_plates(result.best, chosen.make.hole):
        common.note(
            f"in the plates, holes of {1e3 * chosen.make.hole:g} mm overlap in {' and '.join(crowded)}: smaller make.pin "
            "and make.width, or longer links"
        )
    if not result.best.verdicts.sound:
        common.note(f"none of them is free of defects: the first has {result.best.verdicts}")
    leave_if_stopped(stopped, "the best so far is kept")
    try:
        traded = chosen.trade(progress=common.console.is_terminal)
    except syn.TradeOffInterrupted as error:
        traded, stopped = error.trade_off, error
    if traded is not None:
        common.print_paths(_trade_off(traded, chosen.title, folder, plot, complete=stopped is None))
    leave_if_stopped(stopped, "what there is is kept")


def _trade_off(traded: TradeOff, title: str, folder: Path, plot: bool, *, complete: bool) -> list[Path]:
    from ..synthesis import OVER, format_limit, quality_cells, quality_headings

    task = next((s.task for s in traded.solutions if s is not None), None)
    what = OVER[traded.over].name
    if task is None:
        if complete:
            common.note(f"no linkage keeps any of the limits of the {what}")
        return []
    headings = ("limit", *quality_headings(task)[::2])
    missing = "no linkage" if complete else "none found yet"
    rows = [
        (format_limit(traded.over, float(limit)), *((missing, "") if s is None else quality_cells(s)[::2]))
        for limit, s in zip(traded.limit, traded.solutions)
    ]
    common.show_table(f"{title}: error against the {what}", headings, rows)
    written = [traded.to_csv(folder / "trade-off.csv")]
    return written + common.save_plot(plot, traded, folder / "trade-off.png", title=title)
