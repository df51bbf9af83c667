"""`linkwork exact`: find all linkages that do a task exactly, in closed form, or report that there is none."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import click

from linkwork.errors import InputError

from . import common
from .design import print_best, print_solutions, read_overrides, write_description_files, write_linkages


@click.command()
@click.argument("case", type=click.Path(exists=True, dir_okay=False))
@common.set_option("task.n=4")
@click.option(
    "--crank-phase", metavar="ANGLE", help="For a function: the crank's angle from the ground link at rotation 0."
)
@common.plot_option
@common.out_option(help="Folder for the results.")
@common.report_errors
def exact(case: str, settings: Sequence[str], crank_phase: str | None, plot: bool, out: str) -> None:
    """Find every four-bar that does exactly what a CASE file (TOML or JSON) asks for at a few points.

    For five poses of a body there are up to six four-bars; for four poses there is a curve of dyads (Burmester). For three to
    five points of a rocker function there are up to four four-bars (Freudenstein). Each linkage is checked for defects; if all
    have a defect, no four-bar without defects exists for the task. Bounds and constraints of the case are ignored. The exit
    code is 3 if no linkage is free of defects.

    \b
    Examples:
      linkwork exact examples/five-poses.toml
      linkwork exact examples/sine-function.toml --set task.n=5
    """
    from .. import synthesis as syn
    from ..files import write_csv

    common.check_kind(case, common.SYNTHESIS)
    chosen = syn.load_synthesis_case(case, read_overrides(settings))
    found: syn.Generators | syn.Guidance | syn.GuidanceMap
    task = chosen.task
    closed = isinstance(task, syn.QuickReturn | syn.QuickSwing)
    if closed or not isinstance(task, syn.RockerFunction | syn.PrecisionPoints | syn.Motion):
        which = f"{case} asks for a {type(task).__name__}, not for points of a rocker function or poses of a body"
        raise InputError(f"{which}: linkwork synthesize {case}")
    if isinstance(task, syn.RockerFunction):
        found = syn.function_generators(task, crank_phase=crank_phase)
    elif crank_phase is not None:
        raise InputError("--crank-phase is for a function of the rocker: poses leave the crank's angle free")
    else:
        found = syn.guidance(task)
    common.say(f"{chosen.title}: {found.describe()}")
    folder = common.output_folder(out)
    written = []
    if found.solutions:
        print_solutions(f"{chosen.title}: in closed form", found.solutions)
        if any(syn.quality_cells(s)[-1] != "0" for s in found.solutions):
            common.note(
                "each linkage meets all targets, but one with a branch or circuit defect needs both assemblies for them; "
                "its errors are those in the assembly of the first target"
            )
        best = found.solutions[0]
        written.append(write_csv(folder / "solutions.csv", syn.solution_columns(found.solutions)))
        if best.verdicts.sound:
            assessment = syn.assess(best)
            print_best(assessment)
            written += write_description_files(
                assessment, folder, chosen.title, curve="best-curve", text="best-report", drawn="best"
            )
            written += write_linkages(found.solutions, folder, chosen.title, make=chosen.make)
    if not isinstance(found, syn.Generators):
        written += common.save_plot(plot, found, folder / "poses.png", title=chosen.title)
    if found.solutions:
        written += common.save_plot(plot, found.solutions[0], folder / "best-linkage.png", title=chosen.title)
    common.print_paths(written)
    if not any(s.verdicts.sound for s in found.solutions):
        common.note(found.describe())
        sys.exit(common.ENDED_EARLY)
