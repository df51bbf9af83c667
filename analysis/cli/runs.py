"""Commands that build, run, check and show."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import click
import numpy as np
from rich.table import Table

from linkwork import __version__
from linkwork.five_bar.kinematics import assembly_square
from linkwork.five_bar.published import RAD_S_PER_RPM
from linkwork.parameters import field_name

from ..mechanisms import FIVE_BAR, mechanism_of
from ..run.case import PUBLISHED
from .common import (
    CHECK_FAILED,
    ENDED_EARLY,
    INTERRUPTED,
    chosen_case,
    console,
    errors,
    handled,
    number_or_text,
    prepare_solver,
    tolerance_option,
)

#: Outputs that the plot of a check shows, of those that the mechanism has.
COMPARED = (
    "slider.position",
    "slider.velocity",
    "drive.applied_torque",
    "pin.C.fx",
    "pin.C.fy",
    "slider_pin.fx",
    "slider_pin.fy",
)
#: Where FMUs are looked for that are not named.
DEFAULT_FOLDER = Path("build")


@click.command()
@click.argument("models", nargs=-1)
@click.option(
    "--dest", default="build", show_default=True, type=click.Path(file_okay=False), help="Folder for the FMUs."
)
@handled
def build(models: Sequence[str], dest: str) -> None:
    """Build and validate the FMUs.

    \b
    Examples:
      linkwork build
      linkwork build FiveBarSlider --dest fmus
    """
    import build_fmu

    for name in models or build_fmu.MODELS:
        with console.status(f"building {name}"):
            path = build_fmu.build(name, dest)
            build_fmu.try_out(path)
        console.print(f"{path}: valid, {path.stat().st_size / 1024:.0f} KiB", highlight=False, soft_wrap=True)


@click.command()
@click.argument("case", required=False, type=click.Path(exists=True, dir_okay=False))
@click.option("--published", metavar="NAME", help=f"Run a published set instead: {', '.join(PUBLISHED)}.")
@click.option("--fmu", type=click.Path(exists=True, dir_okay=False), help="Run through this FMU instead of in process.")
@click.option(
    "--method", default="compiled", show_default=True, help="compiled, Hamming, or a method of SciPy's solve_ivp."
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="Change a value, such as slider.stiffness='2e6 dyn/cm' or drive.speed='300 rpm'; bare numbers are in SI.",
)
@click.option("--stop-time", metavar="TIME", help="End of the run, such as '2 s'.")
@click.option("--step", metavar="TIME", help="Step of the samples and of the co-simulation, such as '0.1 ms'.")
@click.option("--tolerance", type=float, callback=tolerance_option, help="Tolerance of the solver; 1e-9 by default.")
@click.option(
    "--out", default="out", show_default=True, type=click.Path(file_okay=False), help="Folder for CSV and plot."
)
@click.option("--plot/--no-plot", default=True, show_default=True, help="Whether to write a plot.")
@handled
def run(
    case: str | None,
    published: str | None,
    fmu: str | None,
    method: str,
    settings: Sequence[str],
    stop_time: str | None,
    step: str | None,
    tolerance: float | None,
    out: str,
    plot: bool,
) -> None:
    """Run a CASE file (TOML or JSON) or a published set, and write CSV and a plot.

    \b
    Examples:
      linkwork run --published table-3.1
      linkwork run --published rig-1-spring-a --set slider.coulomb_friction='5 N'
      linkwork run examples/torsion-bar.toml --fmu build/FiveBarSlider.fmu --out results
    """
    from .. import figures
    from ..files import save_figure
    from ..run.cosimulate import cosimulate
    from ..run.simulate import RunInterrupted, simulate
    from ..units import quantity

    chosen = chosen_case(case, published, settings)
    if fmu is not None and method != "compiled":
        raise click.UsageError("--method is for a run in process: the FMU brings its own")

    def seconds(text: str | None, default: float, name: str) -> float:
        return default if text is None else quantity(number_or_text(text), "s", name)

    common = {
        "initial": chosen.initial,
        "stop_time": seconds(stop_time, chosen.stop_time, "--stop-time"),
        "step": seconds(step, chosen.step, "--step"),
        "tolerance": chosen.tolerance if tolerance is None else tolerance,
    }
    interrupted = False
    if fmu is None:
        prepare_solver(chosen.parameters)
    try:
        if fmu is not None:
            result = cosimulate(fmu, chosen.parameters, chosen.inputs, progress=console.is_terminal, **common)
        else:
            result = simulate(chosen.parameters, chosen.inputs, method=method, progress=console.is_terminal, **common)
    except RunInterrupted as stopped:
        result, interrupted = stopped.trajectory, True
    name = (Path(case).stem if case else str(published)) + ("-fmu" if fmu else "")
    written = [result.to_csv(Path(out) / f"{name}.csv")]
    if plot and len(result) > 1:
        second = f"{mechanism_of(chosen.parameters).second}.position"
        names = tuple(
            dict.fromkeys(("slider.position", second, "crank.speed", "drive.applied_torque", "transmission.angle"))
        )
        written.append(save_figure(figures.plot(result, names, title=chosen.title), Path(out) / f"{name}.png"))
    _summary(chosen.title, result)
    for path in written:
        console.print(f"wrote {path}", highlight=False, soft_wrap=True)
    if fmu is not None and not chosen.inputs.held_exactly:
        errors.print(
            f"note: inputs that vary over a step are sampled and held over it ({common['step']:.3g} s), as any master does; "
            "a run in process lets them act continuously. Shorten --step until the result stands.",
            style="yellow",
            soft_wrap=True,
        )
    if interrupted:
        errors.print(f"interrupted at t = {result.time[-1]:.6g} s; what was computed is kept", style="yellow")
        sys.exit(INTERRUPTED)
    if result.status:
        errors.print(
            f"the run ended early: {result.message}", style="red", markup=False, highlight=False, soft_wrap=True
        )
        sys.exit(ENDED_EARLY)


def _summary(title: str, result: Any) -> None:
    grid = Table(title=f"{title}  ({result.source}, {len(result)} samples to t = {result.time[-1]:.6g} s)")
    for heading in ("output", "unit", "least", "greatest", "at the end"):
        grid.add_column(heading, justify="left" if heading in ("output", "unit") else "right")
    for name in result.names:
        values = result[name]
        grid.add_row(name, result.units[name], *(f"{v:.6g}" for v in (values.min(), values.max(), values[-1])))
    console.print(grid)
    for event in result.events:
        console.print(f"{event.name} at t = {event.time:.9g} s", highlight=False)


@click.command()
@click.argument("cases", nargs=-1)
@click.option(
    "--fmu",
    type=click.Path(dir_okay=False),
    help="The FMU to check; by default that of each case's mechanism in build, such as build/FiveBarSlider.fmu.",
)
@click.option("--all", "everything", is_flag=True, help="All standard cases (of the FMU's mechanism), not one of each.")
@click.option(
    "--method",
    "methods",
    multiple=True,
    default=("compiled",),
    show_default=True,
    help="In-process method: compiled, Hamming, or one of SciPy's solve_ivp; can be given often.",
)
@click.option(
    "--tolerance",
    type=float,
    callback=tolerance_option,
    default=1e-6,
    show_default=True,
    help="Largest relative difference that passes.",
)
@click.option(
    "--out", default="out", show_default=True, type=click.Path(file_okay=False), help="Folder for CSV and plots."
)
@handled
def check(
    cases: Sequence[str], fmu: str | None, everything: bool, methods: Sequence[str], tolerance: float, out: str
) -> None:
    """Hold the FMU against the in-process solver, output by output. CASES are names of standard cases or case files.

    \b
    Examples:
      linkwork check
      linkwork check --all --tolerance 1e-8
      linkwork check --method compiled --method Radau
      linkwork check speed-jump examples/torsion-bar.toml
    """
    from .. import figures
    from ..files import save_figure
    from ..run.case_files import load_case
    from ..run.checks import CASES
    from ..run.checks import check as compare_case

    # of an FMU that is named, its own mechanism's
    wanted = None if fmu is None else _model_name(Path(fmu))
    every = {name: case for name, case in CASES.items() if wanted in (None, mechanism_of(case.parameters).fmu)}
    first = {mechanism_of(case.parameters).name: name for name, case in reversed(every.items())}
    names = list(every) if everything else list(cases) or list(first.values())[::-1]
    failed = []
    for name in names:
        if name in CASES:
            case = CASES[name]
        elif Path(name).suffix in (".toml", ".json"):
            case = load_case(name)
        else:
            raise click.UsageError(f"{name!r} is neither a case file nor a standard case ({', '.join(CASES)})")
        prepare_solver(case.parameters)
        stem = Path(name).stem if Path(name).suffix in (".toml", ".json") else name
        for method in methods:
            label = stem if method == "compiled" else f"{stem}-{method}"
            under_test = fmu or DEFAULT_FOLDER / f"{mechanism_of(case.parameters).fmu}.fmu"
            a, b, comparison = compare_case(
                under_test, case, method=method, tolerance=tolerance, progress=console.is_terminal
            )
            _comparison(f"{case.title}: FMU less in process ({a.source})", comparison)
            folder = Path(out)
            a.to_csv(folder / f"{label}-in-process.csv")
            b.to_csv(folder / f"{label}-fmu.csv")
            shown = [name for name in COMPARED if name in a.names]
            n = min(len(a), len(b))
            figure = figures.plot_comparison(
                a.time[:n],
                {o: (a[o][:n], b[o][:n], a.units[o]) for o in shown},
                title=case.title,
                labels=(f"in process ({a.source})", "FMU"),
            )
            save_figure(figure, folder / f"{label}.png")
            console.print(f"wrote {folder / label}.png, -in-process.csv and -fmu.csv", highlight=False, soft_wrap=True)
            for which, result in (("in process", a), ("FMU", b)):
                if result.status:
                    errors.print(
                        f"{which}: the run ended early: {result.message}", style="yellow", markup=False, soft_wrap=True
                    )
            if not comparison.agrees or a.status != b.status:
                failed.append(label)
    if failed:
        errors.print(f"check failed: {', '.join(failed)}", style="red", highlight=False)
        sys.exit(CHECK_FAILED)
    count = len(names) * len(methods)
    console.print(f"{count} of {count} checks pass", style="green", highlight=False)


def _model_name(path: Path) -> str | None:
    """Name of the model in an FMU; None where there is none to read, which the check will tell."""
    from fmpy import read_model_description

    try:
        return str(read_model_description(str(path), validate=False).modelName)
    except (OSError, KeyError, ValueError, BadZipFile):
        return None


def _comparison(title: str, comparison: Any) -> None:
    grid = Table(title=f"{title}, tolerance {comparison.tolerance:g}")
    for heading in ("output", "unit", "largest difference", "rms", "relative", "verdict"):
        grid.add_column(heading, justify="left" if heading in ("output", "unit", "verdict") else "right")
    for d in comparison.differences:
        good = d.relative <= comparison.tolerance
        grid.add_row(
            d.name,
            d.unit,
            f"{d.largest:.2e}",
            f"{d.rms:.2e}",
            f"{d.relative:.1e}",
            "pass" if good else "FAIL",
            style=None if good else "red",
        )
    console.print(grid)


@click.command()
@click.argument("what", required=False)
@handled
def info(what: str | None) -> None:
    """Tell about the published sets, one of them, a parameter or case file, or an FMU.

    \b
    Examples:
      linkwork info
      linkwork info table-3.1
      linkwork info build/FiveBarSlider.fmu
    """
    from ..run.case_files import load_case

    if what is None:
        grid = Table(title="published sets")
        for heading in ("name", "source", "speed [rpm]"):
            grid.add_column(heading)
        for name, entry in PUBLISHED.items():
            grid.add_row(name, entry.source, f"{entry.crank_speed / RAD_S_PER_RPM:g}")
        console.print(grid)
        console.print(f"linkwork {__version__}; compiled code is kept in {_cache()}", highlight=False, soft_wrap=True)
    elif what in PUBLISHED:
        _parameters(PUBLISHED[what].source, PUBLISHED[what].parameters)
    elif Path(what).suffix == ".fmu":
        _fmu(Path(what))
    elif Path(what).suffix in (".toml", ".json"):
        case = load_case(what)
        _parameters(case.title, case.parameters)
    else:
        raise click.UsageError(f"{what!r} is neither a published set ({', '.join(PUBLISHED)}), a file, nor an FMU")


def _cache() -> Path:
    from ..run.compiled import cache_folder

    return cache_folder()


def _parameters(title: str, parameters: Any) -> None:
    grid = Table(title=title)
    for heading in ("parameter", "value", "unit", "meaning"):
        grid.add_column(heading, justify="right" if heading == "value" else "left")
    mechanism = mechanism_of(parameters)
    for variable in mechanism.variables.PARAMETERS:
        value = getattr(parameters, field_name(variable.name), None)
        if value is not None:
            grid.add_row(variable.name, f"{value:.9g}", variable.unit, variable.description)
    console.print(grid)
    if mechanism is not FIVE_BAR:
        console.print("where it can be assembled, dead centres, stroke: linkwork slider-crank info", highlight=False)
        return
    p = parameters.constants()
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    square = [assembly_square(float(a), 0.0, p) for a in angles]
    turns = "turns fully" if min(square) > 0.0 else "does not turn fully"
    console.print(f"with the slider at zero the crank {turns}", highlight=False)


def _fmu(path: Path) -> None:
    from fmpy import read_model_description
    from fmpy.validation import validate_fmu

    if not path.is_file():
        raise click.UsageError(f"there is no file {path}: build it with 'linkwork build'")
    description = read_model_description(str(path))
    grid = Table(
        title=f"{description.modelName} {description.version}, FMI {description.fmiVersion}, {description.guid}"
    )
    for heading in ("variable", "causality", "start", "unit", "description"):
        grid.add_column(heading, justify="right" if heading == "start" else "left")
    for v in description.modelVariables:
        start = "" if v.causality == "output" else f"{float(v.start):.6g}" if v.type == "Real" else str(v.start)
        grid.add_row(v.name, v.causality, start, v.unit or "", v.description)
    console.print(grid)
    problems = validate_fmu(str(path))
    console.print("valid" if not problems else "; ".join(problems), style="green" if not problems else "red")
    if problems:
        sys.exit(CHECK_FAILED)


@click.command()
@click.argument("numbers", nargs=-1)
@click.option("--out", default="out/figures", show_default=True, type=click.Path(file_okay=False), help="Folder.")
@click.option("--list", "listing", is_flag=True, help="Only list the figures.")
@handled
def figures(numbers: Sequence[str], out: str, listing: bool) -> None:
    """Make the theses' figures, a still and an animation of the linkage: plots and CSV. NUMBERS such as 3.2 (Youssef) or R5
    (Rahman's figure 5); all by default.

    \b
    Examples:
      linkwork figures --list
      linkwork figures 3.2 3.4 7.2 R5
      linkwork figures --out figures
    """
    from ..studies import STUDIES, make

    if listing:
        for number, study in STUDIES.items():
            console.print(f"{number:>8}  {study}", highlight=False)
        return
    unknown = [number for number in numbers if number not in STUDIES]
    if unknown:
        raise click.UsageError(f"there is no figure {', '.join(unknown)}: the figures are {', '.join(STUDIES)}")
    for number in numbers or STUDIES:
        with console.status(f"figure {number}"):
            result, paths = make(number, Path(out))
        console.print(
            f"[bold]{number}[/bold]  {result.title}: wrote {', '.join(p.name for p in paths)}", highlight=False
        )
        for verdict in result.verdicts:
            console.print(f"        {verdict}", highlight=False, markup=False, soft_wrap=True)
