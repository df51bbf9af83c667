"""Commands about vibration: where a mechanism resonates, where it is unstable, and what a decaying record shows."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.markup import escape
from rich.table import Table

from linkwork.errors import InputError, LinkworkError, ParameterError
from linkwork.parameters import field_name

from ..mechanisms import FIVE_BAR, PUBLISHED, mechanism_of
from ..units import RAD_S_PER_RPM
from .common import (
    ENDED_EARLY,
    INTERRUPTED,
    case_options,
    chosen_case,
    console,
    folder_of,
    handled,
    out_option,
    plot_option,
    print_error,
    print_written,
    quantity,
    show_table,
    workers_options,
)

#: Range of speeds where none is given, relative to the natural frequency: beyond twice, where parametric resonance begins.
_RANGE = (0.15, 2.3)


def _require_range(parameters: Any, low: float, high: float, name: str, first: str, last: str) -> None:
    """Refuse a range that is none, in the words of the command line."""
    from ..periodic import format_value, speed_name, unit_of

    unit = unit_of(mechanism_of(parameters), name)
    options = first if first == last else f"{first} and {last}"
    if not low < high:
        span = f"from {format_value(name, low, unit)} to {format_value(name, high, unit)}"
        raise click.UsageError(f"{options}: {span}: it must increase")
    if name == speed_name(mechanism_of(parameters)) and low <= 0.0:
        raise click.UsageError(f"{options}: it begins at {format_value(name, low, unit)}: speeds must be above zero")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chosen:
    """The case that a command is about, and how it is driven there."""

    case: Any
    stem: str
    speed: str | None
    guess_speed: str | None
    folder: Path

    def drive(self, speed: str | None = None) -> Any:
        """What drives the case, its constant forces with it; a speed given takes the place of its drive."""
        from ..periodic import VaryingInputError, drive_of

        speed = speed or self.speed
        value = None if speed is None else quantity(speed, "rad/s", "--speed")
        if value is not None and self.case.inputs.torque is not None:
            print_error("note: the speed is prescribed; the case's torque is left out")
        try:
            drive = drive_of(self.case.parameters, self.case.inputs, self.case.initial, speed=value)
            # that something is free is asked first
            drive.flow(mechanism_of(self.case.parameters))
            return drive
        except InputError as error:
            torque = isinstance(error, VaryingInputError) and error.channel == "torque"
            hint = "; --speed prescribes the speed instead" if torque else ""
            raise InputError(f"{self.case.title}: {error}{hint}") from None

    def start(self, drive: Any) -> list[float] | None:
        """Guess of the orbit's start: none at prescribed speed, else all at zero with a crank speed."""
        if drive.speed_drive:
            if self.guess_speed is not None:
                raise click.UsageError("--guess-speed is for a case driven by a torque: here the speed is prescribed")
            return None
        mechanism = mechanism_of(self.case.parameters)
        flow = drive.flow(mechanism)
        speed = float(getattr(self.case.initial, mechanism.freedoms[flow.crank].initial[1]))
        if self.guess_speed is not None:
            speed = quantity(self.guess_speed, "rad/s", "--guess-speed")
        elif speed <= 0.0:
            if drive.motor is None:
                raise click.UsageError("under a torque a guess of the crank speed is needed: --guess-speed '300 rpm'")
            return None
        return [*[0.0] * (flow.size - 1), speed]

    def finish(self, written: Sequence[Path], problems: Sequence[str], *, interrupted: bool = False) -> None:
        """Report the files and what could not be computed, and exit with what that means."""
        print_written(written)
        for problem in problems:
            print_error(f"note: {problem}")
        if interrupted or problems:
            sys.exit(INTERRUPTED if interrupted else ENDED_EARLY)


def _about_a_case(command: Callable[..., None]) -> Callable[..., None]:
    """Options of a command about a case, which it receives as one `_Chosen`."""

    @handled
    @wraps(command)
    def with_case(
        case: str | None,
        published: str | None,
        settings: Sequence[str],
        speed: str | None,
        guess_speed: str | None,
        out: str,
        **options: Any,
    ) -> None:
        chosen = chosen_case(case, published, settings)
        stem = Path(case).stem if case else str(published)
        command(_Chosen(case=chosen, stem=stem, speed=speed, guess_speed=guess_speed, folder=Path(out)), **options)

    for option in (
        out_option(help="Folder."),
        click.option("--guess-speed", metavar="SPEED", help="Guess of the crank speed, for a case driven by a torque."),
        click.option("--speed", metavar="SPEED", help="Prescribe this crank speed in the place of the case's drive."),
        case_options(PUBLISHED),
    ):
        with_case = option(with_case)
    return with_case


@click.command()
@_about_a_case
@click.option("--vary", default="drive.speed", show_default=True, metavar="NAME", help="What varies, by its FMI name.")
@click.option(
    "--from", "low", metavar="VALUE", help="Beginning of the range, such as '100 rpm'; bare numbers are in SI."
)
@click.option("--to", "high", metavar="VALUE", help="End of the range.")
@click.option("--doubled/--no-doubled", default=True, show_default=True, help="Follow motions of twice the period.")
@click.option("--plot/--no-plot", default=True, show_default=True, help="Whether to write a plot.")
def resonance(chosen: _Chosen, vary: str, low: str | None, high: str | None, doubled: bool, plot: bool) -> None:
    """Follow the periodic motion of a CASE file's or a published set's mechanism over the speed, or another parameter.

    Writes amplitude, harmonics, crank torque and pin forces along the curve, and reports natural frequency, maxima, folds,
    period doublings, and the classical approximations beside the true motion.

    \b
    Examples:
      linkwork resonance --published rig-2-spring-c
      linkwork resonance --published rig-1-spring-b --from '100 rpm' --to '1300 rpm'
      linkwork resonance --published table-3.1 --vary slider.stiffness --from '1e5 dyn/cm' --to '2e6 dyn/cm'
    """
    from .. import figures
    from ..files import save_figure, write_csv
    from ..periodic import ResponseInterrupted, frequency_response, speed_name, unit_of
    from ..youssef import approximations

    parameters, title = chosen.case.parameters, chosen.case.title
    mechanism = mechanism_of(parameters)
    over_speed = vary == speed_name(mechanism)
    if over_speed and chosen.speed is not None:
        raise click.UsageError(
            "--speed prescribes a speed, but it is the speed that varies: give --from and --to, or --vary"
        )
    natural = _natural(parameters) if over_speed else None
    ends = _ends(parameters, vary, low, high, natural)
    drive = chosen.drive(f"{ends[0]} rad/s" if over_speed else None)
    start = chosen.start(drive)
    interrupted = False
    try:
        response = frequency_response(
            parameters, *ends, drive=drive, vary=vary, start=start, doubled=doubled, progress=console.is_terminal
        )
    except ResponseInterrupted as stopped:
        response, interrupted = stopped.response, True
    factor, unit = (1.0 / RAD_S_PER_RPM, "rpm") if over_speed else (1.0, unit_of(mechanism, vary))
    if natural is not None:
        console.print(
            f"natural frequency (mean effective mass): {natural / RAD_S_PER_RPM:.2f} rpm, {natural:.5g} rad/s",
            highlight=False,
        )
    _branches(title, response, factor, unit)
    stem = folder_of(chosen.folder) / f"{chosen.stem}-resonance"
    written = [response.to_csv(f"{stem}.csv")]
    table = approximations(response) if over_speed and mechanism is FIVE_BAR else None
    _extrema(response, factor, unit, table)
    if table is not None:
        written.append(write_csv(f"{stem}-approximations.csv", table.columns()))
    if plot:
        figure = figures.plot(response, title=title, rpm=over_speed, beside=table)
        written.append(save_figure(figure, f"{stem}.png"))
    chosen.finish(written, response.problems, interrupted=interrupted)


def _natural(parameters: Any) -> float | None:
    """The natural frequency, None where there is no spring."""
    from ..periodic import natural_frequency

    try:
        return natural_frequency(parameters)
    except ParameterError:
        return None


def _ends(parameters: Any, vary: str, low: str | None, high: str | None, natural: float | None) -> tuple[float, float]:
    """The range to follow, by default about the natural frequency."""
    from ..periodic import speed_name, unit_of

    unit = unit_of(mechanism_of(parameters), vary)
    if natural is None and (low is None or high is None):
        speed = vary == speed_name(mechanism_of(parameters))
        why = "without a spring there is no natural frequency to begin with" if speed else "it has no range of its own"
        raise click.UsageError(f"--from and --to are needed for {vary}: {why}")
    ends = [
        quantity(text, unit, option) if text is not None else factor * (natural or 0.0)
        for text, option, factor in zip((low, high), ("--from", "--to"), _RANGE)
    ]
    _require_range(parameters, ends[0], ends[1], vary, "--from", "--to")
    return ends[0], ends[1]


def _branches(title: str, response: Any, factor: float, unit: str) -> None:
    grid = Table(title=f"{title}: periodic motions over {response.family.name}", title_justify="left")
    events_heading = f"what happens on it, at [{unit}]"
    for heading in ("branch", "turns", "points", f"from [{unit}]", f"to [{unit}]", "motion", events_heading):
        grid.add_column(escape(heading), justify="left" if heading.startswith("what") else "right")
    for number, branch in enumerate(response.branches, start=1):
        words = [s.value for s in branch.stability()]
        shares = ", ".join(f"{words.count(word) / len(words):.0%} {word}" for word in dict.fromkeys(words))
        events = [f"{s.kind.value} at {factor * s.parameter:.6g} ({_form(response.family, s)})" for s in branch.special]
        grid.add_row(
            str(number),
            str(branch.turns),
            str(len(branch)),
            f"{factor * branch.parameter[0]:.6g}",
            f"{factor * branch.parameter[-1]:.6g}",
            shares,
            "; ".join(events),
        )
    console.print(grid)


def _form(family: Any, special: Any) -> str:
    """Whether stability is lost gently or with a jump."""
    from ..periodic import OrbitError, normal_form

    try:
        return normal_form(family, special).words
    except OrbitError:
        return "normal form not found"


def _swing(orbit: Any) -> tuple[str, float, str]:
    """What the amplitude is of, and the factor and unit in which it is printed: centimetres of lengths."""
    what, unit = orbit.swing
    return (what, 100.0, "cm") if unit == "m" else (what, 1.0, unit)


def _friction(parameters: Any) -> bool:
    """Whether there is friction that is not viscous."""
    names = mechanism_of(parameters).mechanism_variables
    return any(getattr(parameters, field_name(name)) for name in names if "friction" in name)


def _extrema(response: Any, factor: float, unit: str, table: Any) -> None:
    entries = [("maximum", e) for e in response.maxima()] + [("minimum", e) for e in response.minima()]
    if not entries:
        console.print("the amplitude has neither a maximum nor a minimum inside the range", highlight=False)
        return
    what, size, cm = _swing(response.branches[0].orbits[0])
    grid = Table(title=f"where the amplitude of {what} is largest and least", title_justify="left")
    names = () if table is None else tuple(table.amplitudes)
    for heading in ("", f"at [{unit}]", f"amplitude [{cm}]", "motion", *(f"{name} [{cm}]" for name in names)):
        grid.add_column(escape(heading), justify="left" if heading in ("", "motion") else "right")
    if table is not None and _friction(response.family.parameters):
        console.print("the approximations are of the mechanism without its Coulomb friction", highlight=False)
    for word, extremum in sorted(entries, key=lambda entry: entry[1].parameter):
        others = [] if table is None else [f"{size * v:.4f}" for v in table.at(extremum.parameter).values()]
        grid.add_row(
            word,
            f"{factor * extremum.parameter:.2f}",
            f"{size * extremum.amplitude:.4f}",
            extremum.stability.value,
            *others,
        )
    console.print(grid)


@click.command()
@_about_a_case
@click.option("--x", "x", metavar="NAME", help="Parameter along x, by its FMI name; by default the crank speed.")
@click.option("--x-range", nargs=2, metavar="FROM TO", help="Its range, such as '100 rpm' '1500 rpm'.")
@click.option(
    "--y", "y", metavar="NAME", help="Parameter along y; by default the damping of the first freedom beside the crank."
)
@click.option("--y-range", nargs=2, metavar="FROM TO", help="Its range, such as 0 '2e4 dyn.s/cm'.")
@click.option("--points", default=80, show_default=True, type=click.IntRange(2, 2000), help="Points along each axis.")
@workers_options(default=-1)
@click.option("--chart/--no-chart", "charted", default=True, show_default=True, help="Chart, or the verdict alone.")
@click.option("--coexisting", is_flag=True, help="Seek all motions of every point: how many are stable, and how large.")
def stability(
    chosen: _Chosen,
    x: str | None,
    x_range: tuple[str, str] | None,
    y: str | None,
    y_range: tuple[str, str] | None,
    points: int,
    jobs: int,
    charted: bool,
    coexisting: bool,
) -> None:
    """Report whether the periodic motion of a CASE file's or a published set's mechanism is stable, and chart where it is not.

    The verdict is on the motion at one speed, with its margin. The chart has the largest Floquet multiplier of the true orbit
    at every point, the boundaries of instability traced, that of the linear equation beside it, and three points confirmed by
    long nonlinear runs. Computed rows are kept: a chart that was interrupted goes on.

    \b
    Examples:
      linkwork stability --published table-3.1 --no-chart
      linkwork stability --published rig-2-spring-c --x-range '200 rpm' '1500 rpm' --y-range 0 '6e3 dyn.s/cm'
      linkwork stability --published rig-1-spring-a --y slider.stiffness --y-range '1e6 dyn/cm' '5e6 dyn/cm'
    """
    from .. import figures
    from ..files import save_figure
    from ..periodic import damping_name, require_variable, speed_name, stability_chart
    from ..youssef import linear_motion

    parameters, drive = chosen.case.parameters, chosen.drive()
    start = chosen.start(drive)
    mechanism = mechanism_of(parameters)
    names = (x or speed_name(mechanism) or "drive.speed", y or damping_name(mechanism))
    for name in (x, y):
        if name is not None:
            require_variable(parameters, drive, name)
    ranges, missing = [], None
    if charted:
        for name, own, texts, option in ((names[0], x, x_range, "--x"), (names[1], y, y_range, "--y")):
            try:
                ranges.append(_axis_range(parameters, drive, name, texts, f"{option}-range"))
            except LinkworkError as error:
                if own is not None or texts is not None:
                    raise
                # of an axis that nobody chose: the verdict does not need it
                missing = InputError(f"no chart over {name}, as {option} is not given: {error}")
    _report_verdict(chosen.case.title, parameters, drive, start)
    if missing is not None:
        raise missing
    if not charted:
        return
    found = stability_chart(
        parameters,
        drive,
        names,
        (ranges[0], ranges[1]),
        points=points,
        start=start,
        beside=linear_motion(parameters, drive, names) if mechanism_of(parameters) is FIVE_BAR else None,
        coexisting=coexisting,
        n_jobs=jobs,
        progress=console.is_terminal,
    )
    _regions(found)
    _runs(found)
    stem = folder_of(chosen.folder) / f"{chosen.stem}-stability"
    more = [] if found.beside is None else [found.beside.to_csv(f"{stem}-coexisting.csv")]
    figure = figures.plot(found, title=chosen.case.title)
    written = [
        found.to_csv(f"{stem}.csv"),
        found.boundaries_to_csv(f"{stem}-boundaries.csv"),
        *more,
        save_figure(figure, f"{stem}.png"),
    ]
    chosen.finish(written, found.problems)


@click.command()
@_about_a_case
@click.option("--points", default=200, show_default=True, type=click.IntRange(2, 4000), help="Starts along each axis.")
@click.option(
    "--position", nargs=2, metavar="FROM TO", help="Range of the first free coordinate, such as '-5 cm' '5 cm'."
)
@click.option("--rate", nargs=2, metavar="FROM TO", help="Range of its rate.")
@workers_options(default=-1)
def basins(
    chosen: _Chosen,
    points: int,
    position: tuple[str, str] | None,
    rate: tuple[str, str] | None,
    jobs: int,
) -> None:
    """Report all periodic motions of a CASE file's or a published set's mechanism at one speed, and which start ends in which.

    The picture is over the position and the rate of the first free coordinate, of a five-bar the slider, at crank angle 0.

    \b
    Examples:
      linkwork basins --published rig-1-spring-b --speed '1000 rpm'
      linkwork basins --published rig-1-spring-b --speed '1000 rpm' --position '-10 cm' '10 cm' --rate '-10 m/s' '10 m/s'
    """
    from .. import figures
    from ..files import save_figure
    from ..periodic import basins as find_basins
    from ..periodic import orbits_of

    parameters, drive = chosen.case.parameters, chosen.drive()
    start = chosen.start(drive)
    flow = drive.flow(mechanism_of(parameters))
    units = (flow.components[0][1], flow.components[flow.size // 2][1])
    spans: list[Any] = [
        None if texts is None else tuple(quantity(text, unit, option) for text in texts)
        for texts, unit, option in zip((position, rate), units, ("--position", "--rate"))
    ]
    found = orbits_of(parameters, drive, start=start)
    _motions(chosen.case.title, found)
    if not found.stable:
        raise InputError("no stable motion of one turn was found: no start ends in one")
    picture = find_basins(
        parameters,
        drive,
        points=points,
        position=spans[0],
        rate=spans[1],
        start=start,
        n_jobs=jobs,
        progress=console.is_terminal,
    )
    shares = [f"{picture.share(n):.1%} in motion {n + 1}" for n in range(len(picture.motions))]
    console.print(
        f"of {picture.ends.size} starts end {', '.join(shares)}, {picture.share(-1):.1%} at the limit of assembly, "
        f"{picture.share(-2):.1%} in none of them",
        highlight=False,
        soft_wrap=True,
    )
    stem = folder_of(chosen.folder) / f"{chosen.stem}-basins"
    figure = figures.plot(picture, title=chosen.case.title)
    chosen.finish([picture.to_csv(f"{stem}.csv"), save_figure(figure, f"{stem}.png")], ())


def _motions(title: str, found: Any) -> None:
    """All motions at one speed, and how sure it is that there are no others."""
    grid = Table(title=f"{title}: periodic motions of one turn", title_justify="left")
    for heading in ("motion", "amplitude", "stability", "largest multiplier"):
        grid.add_column(heading, justify="left" if heading == "stability" else "right")
    number = 0
    for orbit in found.orbits:
        what, size, unit = _swing(orbit)
        stable = orbit in found.stable
        number += stable
        grid.add_row(
            str(number) if stable else "",
            f"{size * orbit.amplitude:.5g} {unit} of {what}",
            orbit.verdict().stability.value,
            f"{orbit.largest:.6g}",
        )
    console.print(grid)
    sure = "two methods found the same motions" if found.agreed else "two methods differ: there may be more motions"
    index = (
        ""
        if found.index == 1
        else f"; their indices add up to {found.index}, not 1: one may be missing, or come to the limit of assembly"
    )
    console.print(sure + index, highlight=False, soft_wrap=True)


def _axis_range(
    parameters: Any, drive: Any, name: str, texts: tuple[str, str] | None, option: str
) -> tuple[float, float]:
    from ..periodic import default_range, unit_of

    if texts is None:
        return default_range(parameters, drive, name)
    low, high = (quantity(text, unit_of(mechanism_of(parameters), name), option) for text in texts)
    _require_range(parameters, low, high, name, option, option)
    return low, high


def _report_verdict(title: str, parameters: Any, drive: Any, start: Any) -> None:
    """The verdict on the motion at one speed, beside that of the linear equation."""
    from ..periodic import orbit_of
    from ..youssef import linear_verdict

    orbit = orbit_of(parameters, drive, start=start)
    turn, (_, size, unit) = orbit.turn(), _swing(orbit)
    values = ", ".join(f"{m.real:.6g}{m.imag:+.6g}i" if m.imag else f"{m.real:.6g}" for m in orbit.multipliers)
    lines = [
        f"{title} at {60.0 * turn.turns / turn.period:.6g} rpm: {orbit.verdict()}",
        f"Floquet multipliers {values}; amplitude {size * turn.amplitude:.5g} {unit}",
    ]
    friction = _friction(parameters)
    if drive.speed_drive and not friction and mechanism_of(parameters) is FIVE_BAR:
        lines.append(f"by the linear equation about u = 0, as in the thesis: {linear_verdict(parameters, drive)}")
    console.print("\n".join(lines), highlight=False, soft_wrap=True)
    if friction:
        print_error(
            "note: Coulomb friction is smoothed over 1 mm/s: where the slider would stick, the model creeps to one place, "
            "and its multipliers are those of the creep"
        )


def _regions(found: Any) -> None:
    from ..periodic import TRUE_ORBIT, Crossing

    x, y = found.axes
    count = int(np.ma.sum(found.grid.largest > 1.0))
    folds = any(traced.kind is Crossing.FOLD and traced.motion == TRUE_ORBIT for traced in found.boundaries)
    console.print(
        f"at {count} of {found.grid.largest.count()} points where a motion was found it is unstable"
        + ("; at a fold the motion jumps to another: see the boundaries" if folds else ""),
        highlight=False,
        soft_wrap=True,
    )
    if found.beside is not None:
        several = int((found.beside.stable > 1).sum())
        console.print(
            f"at {several} of {found.beside.stable.size} points several stable motions were found", highlight=False
        )
    grid = Table(title="boundaries of instability", title_justify="left")
    for heading in ("motion", "kind", f"{x.name} [{x.unit}]", f"{y.name} [{y.unit}]", "ends because"):
        grid.add_column(escape(heading))
    for traced in found.boundaries:
        points = traced.points
        spans = [
            f"{axis.factor * points[:, i].min():.6g} to {axis.factor * points[:, i].max():.6g}"
            for i, axis in enumerate(found.axes)
        ]
        grid.add_row(
            traced.motion, traced.kind.value, *spans, "; ".join(dict.fromkeys(str(end) for end in traced.ends))
        )
    if found.boundaries:
        console.print(grid)
    for removal in found.removals:
        console.print(removal, highlight=False, soft_wrap=True)
    if found.elsewhere:
        console.print(
            f"{found.elsewhere} folds and period doublings on the lines searched belong to other, larger motions: not traced",
            highlight=False,
            soft_wrap=True,
        )


def _runs(found: Any) -> None:
    x, y = found.axes
    grid = Table(title="confirmed by long nonlinear runs", title_justify="left")
    for heading in (
        f"{x.name} [{x.unit}]",
        f"{y.name} [{y.unit}]",
        "verdict",
        "multiplier",
        "run",
        "growth a turn",
        "",
    ):
        grid.add_column(escape(heading))
    for run in found.runs:
        c = run.confirmation
        grid.add_row(
            f"{x.factor * run.x:.6g}",
            f"{y.factor * run.y:.6g}",
            c.verdict.stability.value,
            f"{abs(c.verdict.largest_multiplier):.6f}",
            c.outcome.value,
            f"{c.growth:.6f}",
            "agrees" if c.agrees else "DOES NOT AGREE",
        )
    console.print(grid)


@click.command()
@click.argument("record", type=click.Path(exists=True, dir_okay=False))
@click.option("--time", "time", metavar="NAME", help="Column of the times; by default the first.")
@click.option("--position", metavar="NAME", help="Column of the positions; by default the second.")
@click.option("--time-unit", default="s", show_default=True, help="Unit of the times.")
@click.option("--unit", default="m", show_default=True, help="Unit of the positions: for a force of friction.")
@click.option("--from", "first", metavar="TIME", help="Leave out what is before, such as '0.2 s': the impulse.")
@click.option("--to", "last", metavar="TIME", help="Leave out what is after.")
@click.option(
    "--mass", metavar="MASS", help="Moving mass, such as '600 g': gives the damping coefficient and the stiffness."
)
@click.option("--friction", is_flag=True, help="Fit dry friction beside the damper.")
@click.option("--least-swing", type=float, help="Smallest swing that counts, as a part of the range; 0.1 by default.")
@plot_option
@out_option()
@handled
def decrement(
    record: str, time: str | None, position: str | None, mass: str | None, out: str, plot: bool, **options: Any
) -> None:
    """Damping and natural frequency from the decaying record of a freedom on its spring: the logarithmic decrement.

    RECORD is a CSV file of times and positions after an impulse, or after a release. The turning points are fitted by least
    squares, with the offset of the record; +- is the standard error. Dry friction shows by a decrement that grows from cycle to
    cycle.

    \b
    Examples:
      linkwork decrement record.csv --mass '600 g'
      linkwork decrement record.csv --time 't [s]' --position 'u [mm]' --unit mm --from '0.1 s' --friction
    """
    from .. import figures
    from ..files import read_columns, save_figure, write_csv
    from ..linear import LEAST_SWING, fit_decay

    units = (("time_unit", "s", "--time-unit"), ("unit", "m", "--unit"))
    second, metre = (quantity(f"1 {options[name]}", si, option) for name, si, option in units)
    t, x = read_columns(record, (time, position))
    t = t * second
    first = quantity(options["first"], "s", "--from") if options["first"] else -np.inf
    last = quantity(options["last"], "s", "--to") if options["last"] else np.inf
    kept = ~((t < first) | (t > last))
    decay = fit_decay(
        t[kept],
        x[kept],
        friction=options["friction"],
        least_swing=LEAST_SWING if options["least_swing"] is None else options["least_swing"],
    )
    kg = None if mass is None else quantity(mass, "kg", "--mass")
    if kg is not None and kg <= 0.0:
        raise click.UsageError(f"--mass {mass}: it must be above zero")
    show_table(
        f"{Path(record).name}: {len(decay.time)} turning points from {decay.time[0]:.6g} to {decay.time[-1]:.6g} s",
        ("", "value", "+-", "unit"),
        [
            (name, f"{value:.6g}", f"{error:.2g}", unit)
            for name, value, error, unit in _found(decay, kg, metre if options["friction"] else None, options["unit"])
        ],
        words=("", "unit"),
    )
    console.print(f"the fit is within {decay.residual:.2g} of the first amplitude (root mean square)", highlight=False)
    stem = folder_of(out) / f"{Path(record).stem}-decrement"
    columns = {
        "time [s]": decay.time,
        f"position [{options['unit']}]": decay.position,
        f"fit [{options['unit']}]": decay.fitted,
    }
    written = [write_csv(f"{stem}.csv", columns)]
    if plot:
        drawn = figures.plot(decay, (t[kept], x[kept]), unit=options["unit"], title=Path(record).name)
        written.append(save_figure(drawn, f"{stem}.png"))
    print_written(written)


def _found(decay: Any, kg: float | None, metre: float | None, unit: str) -> list[tuple[str, float, float, str]]:
    """What a decay shows: names, values, standard errors and units; friction where ``metre``, the record's unit, is given."""
    natural, error = decay.natural_frequency, decay.natural_frequency_error
    rows = [
        ("logarithmic decrement", decay.decrement, decay.decrement_error, ""),
        ("damping ratio", decay.damping_ratio, decay.damping_ratio_error, ""),
        ("natural frequency", natural, error, "rad/s"),
        ("", natural / RAD_S_PER_RPM, error / RAD_S_PER_RPM, "rpm"),
    ]
    if metre is not None:
        rows.append(("dry friction over the stiffness", decay.friction, decay.friction_error, unit))
    if kg is not None:
        stiffness = decay.stiffness(kg)
        rows += [("damping coefficient", *decay.damping(kg), "N.s/m"), ("stiffness", *stiffness, "N/m")]
        if metre is not None:
            newton = stiffness[0] * metre
            rows.append(("dry friction", newton * decay.friction, newton * decay.friction_error, "N"))
    return rows
