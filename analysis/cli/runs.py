"""Commands that run cases, check FMUs, describe mechanisms, cases and FMUs, and make the theses' figures."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import degrees
from pathlib import Path
from typing import Any

import click

from linkwork import __version__
from linkwork.errors import InputError

from ..mechanisms import PUBLISHED
from ..units import RAD_S_PER_RPM, display_scale
from . import common

#: A value below this share of the largest value in the same unit is a rounding error, and is printed as zero.
_ROUNDING = 1e-12
#: Folder in which the FMUs of the mechanisms are looked for.
DEFAULT_FOLDER = Path("build")


@click.command()
@common.case_options(PUBLISHED)
@click.option(
    "--fmu", type=click.Path(exists=True, dir_okay=False), help="Run this FMU instead of the in-process solver."
)
@click.option(
    "--interface",
    help="How the FMU is run: co-simulation (the default) with inputs held over each step, linear-co-simulation with linear "
    "inputs over each step, or model-exchange under CVode.",
)
@click.option("--method", default="compiled", help="compiled, balanced, Hamming, or a method of SciPy's solve_ivp.")
@click.option("--stop-time", metavar="TIME", help="End of the run, such as '2 s'.")
@click.option("--step", metavar="TIME", help="Step of the samples and of the co-simulation, such as '0.1 ms'.")
@common.tolerance_option(help="Tolerance of the solver; 1e-9 by default.")
@common.out_option(help="Folder for CSV and plot.")
@common.plot_option
@common.report_errors
def run(
    case: str | None,
    published: str | None,
    settings: Sequence[str],
    fmu: str | None,
    interface: str | None,
    method: str,
    out: str,
    plot: bool,
    **given: str | float | None,
) -> None:
    """Run a CASE file (TOML or JSON) or a published set, and write the results as CSV and a plot.

    \b
    Examples:
      linkwork run --published table-3.1
      linkwork run --published rig-1-spring-a --set slider.coulomb_friction='5 N'
      linkwork run examples/torsion-bar.toml --fmu build/FiveBarSlider.fmu --out results
      linkwork run --published table-3.1 --fmu build/FiveBarSlider-native.fmu --interface model-exchange
    """
    from ..run import RunInterrupted, describe_masses, simulate

    changed: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    for name in ("stop_time", "step"):
        if name in changed:
            changed[name] = common.quantity(changed[name], "s", f"--{name.replace('_', '-')}")
    if any(setting.startswith("run.revolutions=") for setting in settings) and "stop_time" in changed:
        raise click.UsageError("give --stop-time or --set run.revolutions, not both")
    if "stop_time" in changed and (case is not None or settings):
        # the stop time replaces the number of revolutions in the file
        settings = (*settings, f"run.stop_time={changed['stop_time']!r}")
    chosen = common.chosen_case(case, published, settings)
    if fmu is not None and method != "compiled":
        raise click.UsageError("--method is for a run in process: the FMU brings its own")
    if fmu is None and interface is not None:
        raise click.UsageError("--interface is for a run through an FMU: give --fmu")
    chosen = replace(chosen, **changed)
    how = {name: getattr(chosen, name) for name in ("initial", "stop_time", "step", "tolerance")}
    how["progress"] = common.console.is_terminal
    interrupted = False
    try:
        if fmu is not None:
            from ..run import cosimulate  # FMPy takes a tenth of a second

            how |= {"interface": interface} if interface else {}
            result = cosimulate(fmu, chosen.parameters, chosen.inputs, **how)
        else:
            result = simulate(chosen.parameters, chosen.inputs, method=method, **how)
    except RunInterrupted as stopped:
        result, interrupted = stopped.trajectory, True
    stem = common.output_folder(out) / ((Path(case).stem if case else str(published)) + ("-fmu" if fmu else ""))
    written = [result.to_csv(f"{stem}.csv")]
    written += common.save_plot(plot and len(result) > 1, result, f"{stem}.png", title=chosen.title)
    _print_extremes(chosen.title, result)
    common.say(describe_masses(chosen.masses)[0])
    common.print_paths(written)
    for sentence in _coarse_samples(result):
        common.note(sentence)
    if fmu is not None and interface in (None, "co-simulation") and not chosen.inputs.held_exactly:
        common.note(
            f"inputs that vary over a step are sampled and held over it ({chosen.step:.3g} s), as any master does; "
            "a run in process lets them act continuously. Shorten --step until the result no longer changes."
        )
    if interrupted:
        common.print_error(f"interrupted at t = {result.time[-1]:.6g} s; what was computed is kept")
        sys.exit(common.INTERRUPTED)
    if result.status:
        common.print_error(f"the run ended early: {common.in_units(result.message, display_scale)}", "red")
        for sentence in _bare_speeds(case, settings, chosen):
            common.print_error(sentence)
        sys.exit(common.ENDED_EARLY)
    if result.message:
        common.note(result.message)


#: Greatest part of a turn between two samples without a note, and part of a turn of the step that the note proposes.
_COARSE, _FINE = 0.25, 1.0 / 72.0


def _coarse_samples(result: Any) -> Iterator[str]:
    """Yield a note for each crank that turns so far between two samples that extremes between them are missed."""
    import numpy as np

    from ..mechanisms import find_mechanism

    if result.parameters is None or len(result) < 2:
        return
    mechanism = find_mechanism(result.parameters)
    for crank in mechanism.cyclic_freedoms:
        name = mechanism.freedoms[crank].coordinate
        turns = np.abs(np.diff(result[name])) / (2.0 * np.pi)
        most, step = float(turns.max()), float(np.diff(result.time)[turns.argmax()])
        if most > _COARSE:
            yield (
                f"{name} advances by up to {most:.3g} turns from one sample to the next, where it has "
                f"{60.0 * most / step:.4g} rpm: extremes between the samples are missed. "
                f"--step '{1e3 * step * _FINE / most:.2g} ms' has 72 samples a turn there"
            )


def _bare_speeds(file: str | None, settings: Sequence[str], case: Any) -> list[str]:
    """Return a note for each speed that was given without unit; the note asks whether rpm was meant instead of rad/s."""
    from ..files import flatten, read_tables
    from ..mechanisms import find_mechanism
    from ..run import case_inputs

    given = flatten(read_tables(file) if file else {}) | common.changes(settings, "drive.speed='420 rpm'")
    speeds = [name for name, acting in case_inputs(find_mechanism(case.parameters)).items() if acting.unit == "rad/s"]
    return [
        f"{name} = {given[name]:g} has no unit and is taken in rad/s, as {given[name] / RAD_S_PER_RPM:.6g} rpm: "
        f"was '{given[name]:g} rpm' meant?"
        for name in speeds
        if isinstance(given.get(name), (int, float))
    ]


def _print_extremes(title: str, result: Any) -> None:
    """Print least, greatest and last value of each output of a run, where the extremes are, and the events of the run."""
    from ..mechanisms import residual_outputs

    at, place = _places(result)
    headings = ("output", "unit", "least", at, "greatest", at, "at the end")
    columns = list(_with_magnitudes(result))
    largest: dict[str, float] = {}
    for _, x, si in columns:
        largest[si] = max(largest.get(si, 0.0), float(abs(x).max()))
    residuals, rows = residual_outputs(), []
    for name, x, si in columns:
        unit, factor = display_scale(si)
        digits = 2 if name in residuals else 6
        tiny = _ROUNDING * largest[si]
        numbers = [f"{0.0 if abs(v) <= tiny else factor * v:.{digits}g}" for v in (x.min(), x.max(), x[-1])]
        varies = x.max() - x.min() > tiny
        least, greatest = (place(x.argmin()), place(x.argmax())) if varies else ("", "")
        rows.append((name, unit, numbers[0], least, numbers[1], greatest, numbers[2]))
    common.show_table(
        f"{title}  ({result.source}, {len(result)} samples to t = {result.time[-1]:.6g} s)", headings, rows
    )
    for event in result.events:
        common.say(f"{event.name} at t = {event.time:.9g} s")


def _places(result: Any) -> tuple[str, Callable[[Any], str]]:
    """Return a column heading for the places of samples in a run, and a function that gives a sample's place as text.

    The place is the crank angle within its turn if the mechanism has exactly one crank and it moves; otherwise the time.
    """
    from ..mechanisms import find_mechanism

    mechanism = None if result.parameters is None else find_mechanism(result.parameters)
    if mechanism is not None and len(mechanism.cyclic_freedoms) == 1:
        crank = mechanism.freedoms[mechanism.cyclic_freedoms[0]]
        angle = result[crank.coordinate]
        if angle.max() > angle.min():
            return "at [deg]", lambda n: f"{round(degrees(angle[n]), 1) % degrees(crank.period):.1f}"
    return "at [s]", lambda n: f"{result.time[n]:.4g}"


def _with_magnitudes(result: Any) -> Iterator[tuple[str, Any, str]]:
    """Yield name, values and SI unit of each output of a run; the magnitude of a joint force follows its components."""
    import numpy as np

    from ..mechanisms import find_mechanism

    joints = {} if result.parameters is None else find_mechanism(result.parameters).joints
    last = {names[-1]: (joint, names) for joint, names in joints.items() if set(names) <= set(result.names)}
    for name in result.names:
        yield name, result.unwrapped(name), result.units[name]
        if name in last:
            joint, names = last[name]
            yield f"{joint} force", np.sqrt(sum(result[one] ** 2 for one in names)), result.units[name]


@click.command()
@click.argument("cases", nargs=-1)
@click.option(
    "--fmu",
    type=click.Path(dir_okay=False),
    help="The FMU to check; by default the FMUs of each case's mechanism in the folder build, such as build/FiveBarSlider.fmu.",
)
@click.option("--interface", "only", help="co-simulation or model-exchange; by default all that the FMU has.")
@click.option(
    "--all", "everything", is_flag=True, help="All standard cases (of the FMU's mechanism), not one per mechanism."
)
@click.option(
    "--method",
    "methods",
    multiple=True,
    default=("compiled",),
    help="In-process method: compiled, Hamming, or one of SciPy's solve_ivp; can be given several times. Model exchange, which "
    "uses CVode, is compared with the first one only.",
)
@common.tolerance_option(default=1e-6, help="Largest relative difference that passes.")
@common.out_option()
@common.report_errors
def check(
    cases: Sequence[str],
    fmu: str | None,
    only: str | None,
    everything: bool,
    methods: Sequence[str],
    tolerance: float,
    out: str,
) -> None:
    """Compare FMUs with the in-process solver, output by output. CASES are names of standard cases or case files.

    If there are several FMUs or interfaces, the command prints one line for each, and all outputs of each that fails. If there
    is only one, it prints all outputs.

    \b
    Examples:
      linkwork check
      linkwork check --all --tolerance 1e-8
      linkwork check --method compiled --method Radau
      linkwork check speed-jump examples/torsion-bar.toml --fmu build/FiveBarSlider-native.fmu
    """
    from ..mechanisms import find_mechanism
    from ..run import check as compare_case

    failed, count = [], 0
    for name, case in _find_cases(cases, fmu, everything):
        model = find_mechanism(case.parameters).fmu
        runs = [
            (path, interface, words, method)
            for path, interface, words in _find_fmus(model, fmu, only)
            for method in (methods if interface == "co-simulation" else methods[:1])
        ]
        lines = []
        for path, interface, words, method in runs:
            in_process, through_fmu, comparison = compare_case(
                path, case, interface=interface, method=method, tolerance=tolerance, progress=common.console.is_terminal
            )
            good = comparison.agrees and in_process.status == through_fmu.status
            marks = (path.stem.removeprefix(model)[1:], interface if interface != "co-simulation" else "")
            label = "-".join((name, *filter(None, marks), *([method] if method != "compiled" else [])))
            if not good:
                failed.append(label)
            if not good or len(runs) <= len(methods):
                _print_comparison(
                    f"{case.title}: {path.name}, {words}, minus in process ({in_process.source})", comparison
                )
            if not good or path == runs[0][0]:
                _write_comparison(common.output_folder(out) / label, case, in_process, through_fmu)
            worst, verdict = comparison.worst, "pass" if good else "FAIL"
            lines.append((path.name, words, in_process.source, worst.name, f"{worst.relative:.1e}", verdict))
        if len(runs) > len(methods):
            headings = ("FMU", "interface", "in process", "largest difference in", "relative", "verdict")
            styles = [None if line[-1] == "pass" else "red" for line in lines]
            common.show_table(f"{case.title}, tolerance {tolerance:g}", headings, lines, styles=styles)
        count += len(runs)
    if failed:
        common.fail(f"check failed: {', '.join(failed)}", common.CHECK_FAILED)
    common.say(f"{count} of {count} checks pass", style="green")


def _find_fmus(model: str, fmu: str | None, only: str | None) -> list[tuple[Path, str, str]]:
    """Return the FMUs to check as (path, interface, interface in words), one for each interface of each FMU.

    The FMUs are ``fmu`` if it is given, otherwise all FMUs of the model in the folder build. If ``only`` is given, the
    other interfaces are left out.
    """
    from ..run import CHECKED, list_interfaces

    if only is not None and only not in CHECKED:
        raise common.unknown_name_error(only, CHECKED, f"interface {only!r} to check")
    kinds = sorted(DEFAULT_FOLDER.glob(f"{model}-*.fmu")) if fmu is None else []
    first = DEFAULT_FOLDER / f"{model}.fmu" if fmu is None else Path(fmu)
    paths = [path for path in (first, *kinds) if path.is_file()] or [first]
    found = [
        (path, name, words) for path in paths for name, words in list_interfaces(path).items() if only in (None, name)
    ]
    if not found:
        raise InputError(f"{', '.join(map(str, paths))}: there is no {only} in it")
    return found


def _find_cases(names: Sequence[str], fmu: str | None, everything: bool) -> list[tuple[str, Any]]:
    """Return the cases to check, with their names: the standard cases and case files in ``names``.

    If there are no names, return one standard case for each mechanism. If ``everything`` is true, return all standard cases.
    In both cases, if an FMU is given, return only standard cases of its mechanism.
    """
    from ..mechanisms import find_mechanism
    from ..run import CASES, list_interfaces, load_case, read_description

    if not names or everything:
        model = None
        if fmu is not None:
            list_interfaces(fmu)  # it says what is wrong with a file that is no FMU
            model = str(read_description(fmu).modelName)
        of_model = [(name, find_mechanism(case.parameters).fmu) for name, case in CASES.items()]
        of_model = [(name, its_model) for name, its_model in of_model if model in (None, its_model)]
        first = {its_model: name for name, its_model in reversed(of_model)}
        names = [name for name, its_model in of_model if everything or first[its_model] == name]
        if model is not None and not names:
            raise click.UsageError(f"there is no standard case of {model}: name a case file")
    chosen = []
    for name in names:
        if name in CASES:
            chosen.append((name, CASES[name]))
        elif Path(name).suffix in (".toml", ".json"):
            chosen.append((Path(name).stem, load_case(name)))
        elif Path(name).suffix == ".fmu":
            raise click.UsageError(f"{name} is an FMU, not a case: linkwork check --fmu {name}")
        else:
            raise common.unknown_name_error(name, CASES, f"standard case or case file {name!r}")
    return chosen


def _write_comparison(stem: Path, case: Any, in_process: Any, through_fmu: Any) -> None:
    """Write both runs of a check as CSV and their comparison as a plot; report runs that ended early."""
    from .. import figures
    from ..files import save_figure
    from ..mechanisms import find_mechanism

    in_process.to_csv(f"{stem}-in-process.csv")
    through_fmu.to_csv(f"{stem}-fmu.csv")
    mechanism = find_mechanism(case.parameters)
    freedoms, joints = mechanism.freedoms, list(mechanism.joints.values())
    of_freedoms = [name for f in (freedoms[1:] or freedoms) for name in (f.coordinate, f.rate)]
    figure = figures.plot_comparison(
        in_process,
        through_fmu,
        [*of_freedoms, *mechanism.names("drive"), *(joints[len(joints) // 2] if joints else ())],
        title=case.title,
        labels=(f"in process ({in_process.source})", "FMU"),
    )
    save_figure(figure, f"{stem}.png")
    common.say(f"wrote {stem}.png, -in-process.csv and -fmu.csv")
    for which, result in (("in process", in_process), ("FMU", through_fmu)):
        if result.status:
            common.print_error(f"{which}: the run ended early: {result.message}")


def _print_comparison(title: str, comparison: Any) -> None:
    verdicts = ["pass" if d.relative <= comparison.tolerance else "FAIL" for d in comparison.differences]
    common.show_table(
        f"{title}, tolerance {comparison.tolerance:g}",
        ("output", "unit", "largest difference", "rms", "relative", "verdict"),
        [
            (d.name, d.unit, f"{d.largest:.2e}", f"{d.rms:.2e}", f"{d.relative:.1e}", verdict)
            for d, verdict in zip(comparison.differences, verdicts)
        ],
        styles=[None if verdict == "pass" else "red" for verdict in verdicts],
    )


@click.command()
@click.argument("what", required=False)
@common.report_errors
def info(what: str | None) -> None:
    """Describe WHAT: a mechanism, a published set, a parameter file, a case file or an FMU.

    Without WHAT, list all mechanisms and published sets.

    \b
    Examples:
      linkwork info
      linkwork info five-bar
      linkwork info table-3.1
      linkwork info build/FiveBarSlider.fmu
    """
    from ..files import read_tables
    from ..mechanisms import MECHANISMS
    from ..numerics.cache import cache_root
    from ..run import describe_masses, load_case, load_parameters

    if what is None:
        kinds = [(m.name, m.title, f"{m.fmu}.fmu") for m in MECHANISMS.values()]
        common.show_table("mechanisms", ("name", "what it is", "FMU"), kinds)
        sets = [(name, entry.source, f"{entry.crank_speed / RAD_S_PER_RPM:g}") for name, entry in PUBLISHED.items()]
        common.show_table("published sets", ("name", "source", "speed [rpm]"), sets)
        place = cache_root()
        common.say(f"linkwork {__version__}; compiled code is kept in {place}")
    elif what in PUBLISHED:
        _print_parameters(PUBLISHED[what].source, PUBLISHED[what].parameters)
    elif what in MECHANISMS:
        _print_mechanism(MECHANISMS[what])
    elif Path(what).suffix == ".fmu":
        _print_fmu(Path(what))
    elif Path(what).suffix in (".toml", ".json"):
        common.check_kind(what, common.RUN, common.PARAMETERS)
        if common.case_kind(read_tables(what)) == common.PARAMETERS:
            _print_parameters(Path(what).stem, load_parameters(what))
        else:
            case = load_case(what)
            _print_parameters(case.title, case.parameters)
            common.say(describe_masses(case.masses)[0])
    else:
        raise common.unknown_name_error(
            what, (*MECHANISMS, *PUBLISHED), f"mechanism, published set, case file or FMU {what!r}"
        )


def _print_mechanism(mechanism: Any) -> None:
    """Print the entries of a case file for a mechanism: parameters, initial state and inputs."""
    from ..run import case_inputs

    what = case_inputs(mechanism)
    meaning = {v.name: v.description for v in mechanism.variables}
    inputs = {c.argument: meaning[c.name] for c in mechanism.channels}
    parameters = (*mechanism.mechanism_variables.values(), *mechanism.initial_variables.values())
    rows = [(v.name, v.unit, v.description) for v in parameters]
    rows += [(name, unit, inputs.get(argument, "true or false")) for name, (argument, unit) in what.items()]
    common.show_table(mechanism.title, ("in a case file", "unit", "meaning"), rows)


def _print_parameters(title: str, parameters: Any) -> None:
    """Print a table of parameters, and for a five-bar whether the crank can make a full turn."""
    import numpy as np

    from linkwork.five_bar.kinematics import assembly_square
    from linkwork.parameters import field_name

    from ..mechanisms import FIVE_BAR, SLIDER_CRANK, find_mechanism

    mechanism = find_mechanism(parameters)
    values = [(v, getattr(parameters, field_name(v.name))) for v in mechanism.mechanism_variables.values()]
    rows = [(v.name, f"{value:.9g}", v.unit, v.description) for v, value in values]
    common.show_table(title, ("parameter", "value", "unit", "meaning"), rows)
    if mechanism is SLIDER_CRANK:
        common.say("where it can be assembled, dead centres, stroke: linkwork slider-crank info")
    if mechanism is not FIVE_BAR:
        return
    p = parameters.constants()
    clearance = min(assembly_square(float(angle), 0.0, p) for angle in np.linspace(0.0, 2.0 * np.pi, 721))
    turns = "turns fully" if clearance > 0.0 else "does not turn fully"
    common.say(f"with the slider at zero the crank {turns}")


def _print_fmu(path: Path) -> None:
    """Print the variables of an FMU and whether it is valid; exit with an error code if it is not."""
    from fmpy.validation import validate_fmu

    from ..files import check_fmu
    from ..run import read_description

    if not path.is_file():
        raise click.UsageError(f"there is no file {path}: build it with 'linkwork build'")
    check_fmu(path)
    description = read_description(path, validate=True)

    def start(variable: Any) -> str:
        if variable.start is None or variable.causality == "output":
            return ""
        return f"{float(variable.start):.6g}" if variable.type in ("Real", "Float64") else str(variable.start)

    common.show_table(
        f"{description.modelName} {description.version}, FMI {description.fmiVersion}, {description.guid}",
        ("variable", "causality", "start", "unit", "description"),
        [(v.name, v.causality, start(v), v.unit or "", v.description) for v in description.modelVariables],
    )
    problems = validate_fmu(str(path))
    common.say("; ".join(problems) or "valid", style="red" if problems else "green")
    if problems:
        sys.exit(common.CHECK_FAILED)


@click.command()
@click.argument("numbers", nargs=-1)
@common.out_option("out/figures", help="Folder for plots and CSV.")
@common.set_option("rod.length='45 in'; bare numbers are in SI. The verdicts then apply to the changed mechanism")
@click.option("--list", "listing", is_flag=True, help="Only list the figures, with their titles and statements.")
@common.report_errors
def figures(numbers: Sequence[str], out: str, settings: Sequence[str], listing: bool) -> None:
    """Make the figures of the theses: plots, CSV, and each statement of the thesis with a verdict. Also draw the linkage.

    NUMBERS are the figures to make, such as 3.2 (Youssef's) or R5 (Rahman's figure 5); by default all are made. The linkage is
    drawn as a picture and an animation.

    \b
    Examples:
      linkwork figures --list
      linkwork figures 3.2 3.4 7.2 R5
      linkwork figures R5 R36 --set rod.length='45 in'
      linkwork figures --out figures
    """
    from textwrap import indent

    from ..studies import ENTRIES, STUDIES, make
    from ..studies.contents import sentences

    if listing:
        about = sentences()
        for number, study in STUDIES.items():
            place = ENTRIES[number].place
            common.say(f"{number:>8}  {study}{place and f' ({place})'}")
            for sentence in about[number]:
                common.say(f"{'':>10}{sentence}")
        return
    values = common.changes(settings, "rod.length='45 in'")
    if values and not numbers:
        raise click.UsageError("name the figures whose mechanism --set changes, such as linkwork figures R5 --set ...")
    for number in numbers:
        if number not in STUDIES:
            raise common.unknown_name_error(number, STUDIES, f"figure {number}")
    for number in numbers or STUDIES:
        with common.console.status(f"figure {number}"):
            result, paths = make(number, Path(out), values)
        wrote = f": wrote {', '.join(p.name for p in paths)}" if paths else ""
        common.console.print(f"[bold]{number}[/bold]  {result.title}{wrote}", highlight=False)
        if values:
            common.say("  with changed parameters: the verdicts are on the changed mechanism, not on the thesis")
        if result.see:
            common.say(f"  statements that concern it are judged at {result.see}")
        for statement in result.statements:
            common.say(indent(str(statement), "  "))
