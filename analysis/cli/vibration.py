"""`linkwork resonance` and `linkwork stability`: where a mechanism resonates, and where its periodic motion is unstable."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import Any

import click

from linkwork.errors import InputError, LinkworkError
from linkwork.parameters import field_name

from ..display import format_count, format_rounds
from ..mechanisms import FIVE_BAR, find_mechanism
from ..units import RAD_S_PER_RPM, display_scale
from . import common
from .driven import CaseChoice, add_case_options, swing_unit
from .sensitivity import report_sensitivity

#: Ends of the default range of speeds: multiples of the least and of the greatest natural frequency. The range contains twice
#: the natural frequency, near which parametric resonance begins.
_RANGE = (0.15, 2.3)
#: Greatest difference, relative to their scale, of two starts that count as the same motion.
_SAME_MOTION = 1e-3


def _require_range(parameters: Any, low: float, high: float, name: str, first: str, last: str) -> None:
    """Raise a usage error if a range does not increase, or if it is a range of speeds that does not begin above zero.

    ``first`` and ``last`` are the options that gave the ends of the range, for the message.
    """
    from ..periodic import format_value, parameter_unit, speed_names

    unit = parameter_unit(find_mechanism(parameters), name)
    options = first if first == last else f"{first} and {last}"
    if not low < high:
        span = f"from {format_value(name, low, unit)} to {format_value(name, high, unit)}"
        raise click.UsageError(f"{options}: {span}: it must increase")
    if name in speed_names(find_mechanism(parameters)) and low <= 0.0:
        raise click.UsageError(f"{options}: it begins at {format_value(name, low, unit)}: speeds must be above zero")


@click.command()
@add_case_options
@click.option(
    "--vary",
    metavar="NAME",
    help="FMI name of the parameter to vary; by default the crank speed, for several commanded cranks that of the first, with "
    "constant ratios.",
)
@click.option(
    "--from", "low", metavar="VALUE", help="Beginning of the range, such as '100 rpm'; bare numbers are in SI."
)
@click.option("--to", "high", metavar="VALUE", help="End of the range.")
@click.option(
    "--doublings", default=3, type=click.IntRange(0, 6), help="Number of successive period doublings that are followed."
)
@click.option(
    "--places",
    default=5,
    type=click.IntRange(min=0),
    help="Number of values in the range at which, and at the highest resonance, all motions are sought, to find those that no "
    "branch leads to.",
)
@click.option(
    "--turns",
    default=1,
    type=click.IntRange(1, 16),
    help="Greatest number of turns, or common periods, of the motions sought there; for more than one take some 24 places.",
)
@common.plot_option
@common.html_option
@click.option(
    "--sensitivity",
    is_flag=True,
    help="Report which parameters have the greatest effect on each maximum, fold and so on.",
)
def resonance(
    chosen: CaseChoice,
    vary: str | None,
    low: str | None,
    high: str | None,
    doublings: int,
    places: int,
    turns: int,
    plot: bool,
    html: bool,
    sensitivity: bool,
) -> None:
    """Follow the periodic motions of a CASE file or a published set over the speed, or over another parameter.

    The command writes amplitude, harmonics, crank torque and pin forces along the branches. It reports natural frequencies,
    maxima, folds, branch points, period doublings, the speeds to avoid, and the classical approximations next to the true
    motion.

    An isola is a closed branch that is not connected with any other branch; in the table its end reads "closed". If a branch
    is not followed to an end of the range, or a branch of doubled period is not found, notes say so, and the exit code is 3.

    \b
    Examples:
      linkwork resonance --published rig-2-spring-c --sensitivity
      linkwork resonance --published rig-1-spring-b --from '100 rpm' --to '1300 rpm' --html
      linkwork resonance --published rig-1-spring-b --from '900 rpm' --to '1100 rpm' --doublings 4
      linkwork resonance --published rig-1-spring-b --set slider.damping='2 N*s/m' --turns 4 --places 24
      linkwork resonance --published table-3.1 --vary slider.stiffness --from '1e5 dyn/cm' --to '2e6 dyn/cm'
    """
    from .. import figures, periodic
    from ..files import write_csv
    from ..youssef import approximations

    parameters, title = chosen.case.parameters, chosen.case.title
    mechanism = find_mechanism(parameters)
    # if there are several cranks, the case says which of them are commanded; the ratios of their speeds are kept
    vary = vary or periodic.default_variable(mechanism, chosen.drive() if len(mechanism.cyclic_freedoms) > 1 else None)
    over_speed = vary in periodic.speed_names(mechanism)
    if over_speed and chosen.speed is not None:
        raise click.UsageError(
            "--speed prescribes a speed, but it is the speed that varies: give --from and --to, or --vary"
        )
    natural, modes = None, _find_modes(chosen.case, over_speed)
    with suppress(LinkworkError):  # the mechanism may have no spring
        natural = periodic.natural_frequency(parameters)
    if isinstance(modes, periodic.NothingFreeError):
        chosen.drive("1 rad/s" if over_speed else None)  # its error says what to do; a range would not help
    ends = _range_ends(parameters, vary, low, high, natural, modes)
    drive = chosen.drive(f"{ends[0]} rad/s" if over_speed else None)
    start = chosen.start(drive)
    _print_natural_frequencies(natural, modes)
    interrupted = False
    try:
        response = periodic.frequency_response(
            parameters,
            *ends,
            drive=drive,
            vary=vary,
            start=start,
            doublings=doublings,
            progress=common.console.is_terminal,
        )
        if places:
            response = periodic.with_isolas(response, places=places, turns=turns, progress=common.console.is_terminal)
    except periodic.ResponseInterrupted as stopped:
        response, interrupted = stopped.response, True
    unit, factor = display_scale(periodic.parameter_unit(mechanism, vary))
    _print_branches(title, response, factor, unit)
    stem = common.output_folder(chosen.folder) / f"{chosen.stem}-resonance"
    written = [response.to_csv(f"{stem}.csv")]
    table = approximations(response) if over_speed and mechanism is FIVE_BAR else None
    _print_extrema(response, factor, unit, table)
    _print_ranges_to_avoid(response, factor, unit)
    if table is not None:
        written.append(write_csv(f"{stem}-approximations.csv", table.columns()))
    if sensitivity:
        written += report_sensitivity(response, factor, unit, f"{stem}-sensitivity.csv")
    if plot:
        picture = figures.picture(response, title=title, beside=table)
        written += common.save_picture(picture, stem, html=html)
    chosen.finish(written, response.problems, interrupted=interrupted)


def _find_modes(case: Any, over_speed: bool) -> Any:
    """Return the natural modes of a case about its equilibrium, or the LinkworkError that says why there are none.

    If the speed varies, the drive of the crank in the case does not matter.
    """
    from ..linear import natural_modes
    from ..periodic import steady_drive

    try:
        drive = None
        with suppress(InputError):
            drive = steady_drive(case.parameters, case.inputs, case.initial)
        if drive is None or (over_speed and not drive.speed_drive):
            drive = steady_drive(case.parameters, case.inputs, case.initial, speed=1.0 if over_speed else None)
        inputs = drive.inputs(find_mechanism(case.parameters))
        return natural_modes(case.parameters, inputs, initial=case.initial)
    except LinkworkError as error:
        return error


def _print_natural_frequencies(natural: float | None, modes: Any) -> None:
    """Print the natural frequency of the spring alone (rad/s), if there is one, and a table of the natural modes."""
    if natural is not None:
        common.say(
            f"natural frequency of the spring alone on the mean effective mass: {natural / RAD_S_PER_RPM:.2f} rpm, "
            f"{natural:.5g} rad/s"
        )
    if isinstance(modes, LinkworkError):
        common.say(f"no natural frequencies about the equilibrium: {modes}")
        return
    if not len(modes.frequency_ranges):
        common.say("no free coordinate vibrates about the equilibrium")
    else:
        rows = [
            (name, *(f"{value / RAD_S_PER_RPM:.2f}" for value in frequencies), f"{damping[0]:.4f} to {damping[2]:.4f}")
            for name, frequencies, damping in zip(modes.coordinates, modes.frequency_ranges, modes.damping_ranges)
        ]
        title = "natural frequencies of small vibrations about the equilibrium, the crank held, over its turn"
        headings = ("mostly of", "least [rpm]", "mean [rpm]", "greatest [rpm]", "damping ratio")
        common.show_table(title, headings, rows)
    if modes.unstable:
        common.say(f"the equilibrium is unstable at {modes.unstable} of {len(modes.equilibria)} crank positions")


def _range_ends(
    parameters: Any, vary: str, low: str | None, high: str | None, natural: float | None, modes: Any
) -> tuple[float, float]:
    """Return the ends of the range to follow, in SI; by default a range of speeds around the natural frequencies (rad/s).

    ``natural`` is the natural frequency of the spring alone; if it is None, the mean frequencies of ``modes`` are used.
    """
    from ..periodic import parameter_unit, speed_names

    unit = parameter_unit(find_mechanism(parameters), vary)
    about, why = [natural] if natural else [], "it has no default range"
    if vary not in speed_names(find_mechanism(parameters)):
        about = []
    elif isinstance(modes, LinkworkError):
        why = f"there is no natural frequency to begin with, {modes}"
    else:
        about = about or list(modes.frequency_ranges[:, 1])
        why = "nothing vibrates about the equilibrium, and there is no natural frequency to begin with"
    if not about and (low is None or high is None):
        raise click.UsageError(f"--from and --to are needed for {vary}: {why}")
    ends = [
        common.quantity(text, unit, option) if text is not None else factor * choose(about)
        for text, option, factor, choose in zip((low, high), ("--from", "--to"), _RANGE, (min, max))
    ]
    _require_range(parameters, ends[0], ends[1], vary, "--from", "--to")
    return ends[0], ends[1]


def _print_branches(title: str, response: Any, factor: float, unit: str) -> None:
    from ..periodic import speed_names

    events_heading = f"what happens on it, at [{unit}]"
    headings = ("branch", "turns", "points", f"from [{unit}]", f"to [{unit}]", "motion", events_heading)
    rows = []
    for number, branch in enumerate(response.branches, start=1):
        words = [s.value for s in branch.stability()]
        shares = ", ".join(f"{words.count(word) / len(words):.0%} {word}" for word in dict.fromkeys(words))
        shares += format_rounds(branch.orbits[0].rounds, ", ")
        events = [
            f"{s.kind.value} at {factor * s.parameter:.6g} ({_normal_form_in_words(branch.family, s)})"
            for s in branch.special
        ]
        begins, ends = (f"{factor * branch.parameter[end]:.6g}" for end in (0, -1))
        ends = "closed" if branch.closed else ends
        rows.append((str(number), str(branch.crank_turns), str(len(branch)), begins, ends, shares, "; ".join(events)))
    family = response.family
    varied = "speed" if speed_names(find_mechanism(family.parameters)) == (family.name,) else family.name
    table = f"{title}: how it moves at each {varied}, and where that jumps or becomes unstable (branches of periodic motions)"
    common.show_table(table, headings, rows)


def _normal_form_in_words(family: Any, special: Any) -> str:
    """Return in words whether the motion loses stability gently or with a jump at a special point of a branch."""
    from ..periodic import OrbitError, normal_form

    try:
        return normal_form(family, special).words
    except OrbitError:
        return "normal form not found"


def _has_dry_friction(parameters: Any) -> bool:
    """Return whether the mechanism has dry friction: whether any of its friction parameters is not zero."""
    return any(getattr(parameters, field_name(name)) for name in find_mechanism(parameters).names("friction"))


def _print_extrema(response: Any, factor: float, unit: str, table: Any) -> None:
    entries = [("maximum", e) for e in response.maxima()] + [("minimum", e) for e in response.minima()]
    if not entries:
        common.say("no maximum or minimum of the amplitude inside the range stands out by a thousandth")
        return
    orbit = response.branches[0].orbits[0]
    what, size, length = swing_unit(orbit)
    names = () if table is None else tuple(table.amplitudes)
    alone = len(orbit.swings) == 1
    amplitude = (f"amplitude [{length}]",) if alone else ("of", "amplitude")
    headings = ("", f"at [{unit}]", *amplitude, "motion", *(f"{name} [{length}]" for name in names))
    if table is not None and _has_dry_friction(response.family.parameters):
        common.say("the approximations are of the mechanism without its Coulomb friction")
    entries.sort(key=lambda entry: entry[1].parameter)
    beside = [] if table is None else list(table.at([extremum.parameter for _, extremum in entries]).values())
    rows = []
    for number, (word, extremum) in enumerate(entries):
        of, scale, its_unit = swing_unit(extremum.orbit, extremum.coordinate)
        cells = [f"{size * extremum.amplitude:.3f}"] if alone else [of, f"{scale * extremum.amplitude:.4g} {its_unit}"]
        approximated = [f"{size * values[number]:.3f}" for values in beside]
        rows.append((word, f"{factor * extremum.parameter:.2f}", *cells, extremum.stability.value, *approximated))
    title = f"where the amplitude of {what} is largest and least" if alone else "where amplitudes are largest and least"
    common.show_table(title, headings, rows)


def _print_ranges_to_avoid(response: Any, factor: float, unit: str) -> None:
    """Print the ranges to avoid, of the speed or another parameter, and the jumps at folds.

    The parameter is printed in ``unit``; ``factor`` is the factor from SI to it.
    """
    from ..periodic import greatest_amplitudes

    ranges = response.speeds_to_avoid
    words = "speeds" if response.family.unit == "rad/s" else f"values of {response.family.name}"
    if response.caution:
        common.say(f"{response.caution}: --places seeks them")
    else:
        common.say(f"all motions were sought at {response.sought_values} only: more --places may find more")
    what, size, length = swing_unit(response.branches[0].orbits[0])
    if not ranges:
        tops = greatest_amplitudes(response.branches)
        peak = "at no maximum does the amplitude fall to 0.71 of it on both sides"
        if not response.maxima():
            shown = [swing_unit(response.branches[0].orbits[0], n) for n in range(len(tops))]
            places = [
                f"{scale * value:.4g} {its_unit}{f' of {name}' * (len(tops) > 1)}, at {factor * place:.6g} {unit}"
                for (name, scale, its_unit), (value, place) in zip(shown, tops)
            ]
            peak = f"the amplitude has no peak; it is greatest, {'; '.join(places)}"
        common.say(f"no {words} to avoid: one stable motion throughout, and {peak}")
    else:
        rows = [(f"{factor * a.low:.6g}", f"{factor * a.high:.6g}", a.words) for a in ranges]
        common.show_table(f"{words} to avoid", (f"from [{unit}]", f"to [{unit}]", "because"), rows)
    for jump in response.jumps:
        side, way = ("below", "rises") if jump.direction > 0 else ("above", "falls")
        after = " or ".join(f"{size * amplitude:.4g}" for amplitude in jump.after)
        then = f"it jumps to {after} {length}" if after else "it ends, and no other stable motion was followed"
        common.say(
            f"the stable motion of {size * jump.before:.4g} {length} of {what} is there only {side} "
            f"{factor * jump.parameter:.6g} {unit}: where {response.family.name} {way} past it, {then}"
        )


@click.command()
@add_case_options
@click.option("--x", "x", metavar="NAME", help="Parameter along x, by its FMI name; by default the crank speed.")
@click.option("--x-range", nargs=2, metavar="FROM TO", help="Range of x, such as '100 rpm' '1500 rpm'.")
@click.option(
    "--y", "y", metavar="NAME", help="Parameter along y; by default the damping of the first freedom beside the crank."
)
@click.option("--y-range", nargs=2, metavar="FROM TO", help="Range of y, such as 0 '2e4 dyn.s/cm'.")
@click.option("--points", default=80, type=click.IntRange(2, 2000), help="Points along each axis.")
@common.workers_options(default=-1)
@click.option("--chart/--no-chart", "charted", default=True, help="Whether to compute the chart, not only the verdict.")
@click.option(
    "--coexisting",
    is_flag=True,
    help="Seek all motions at every point, to show how many are stable, and their amplitudes.",
)
@common.html_option
def stability(
    chosen: CaseChoice,
    x: str | None,
    x_range: tuple[str, str] | None,
    y: str | None,
    y_range: tuple[str, str] | None,
    points: int,
    jobs: int,
    charted: bool,
    coexisting: bool,
    html: bool,
) -> None:
    """Report whether the periodic motion of a CASE file or a published set is stable, and chart where it is unstable.

    The verdict is on the motion at one speed, with its margin. The chart shows the largest Floquet multiplier of the true orbit
    at every point, the boundaries of instability, for comparison the boundaries by the linear equation, and three points
    confirmed by long nonlinear runs. A picture without boundaries is written first. Computed rows are kept, so that after an
    interruption the same command continues.

    \b
    Examples:
      linkwork stability --published table-3.1 --no-chart
      linkwork stability --published rig-2-spring-c --x-range '200 rpm' '1500 rpm' --y-range '1e3 dyn.s/cm' '6e3 dyn.s/cm'
      linkwork stability --published rig-1-spring-a --y slider.stiffness --y-range '1e6 dyn/cm' '5e6 dyn/cm'
    """
    from .. import figures
    from ..periodic import damping_name, default_variable, require_variable, stability_chart
    from ..youssef import linear_motion

    parameters, drive = chosen.case.parameters, chosen.drive()
    start = chosen.start(drive)
    mechanism = find_mechanism(parameters)
    for name in (x, y):
        if name is not None:
            require_variable(parameters, drive, name)
    names: list[str] = []
    ranges, missing = [], None
    if charted:
        axes = (
            (x, x_range, "--x", partial(default_variable, mechanism, drive)),
            (y, y_range, "--y", partial(damping_name, mechanism)),
        )
        for own, texts, option, default in axes:
            name = own or ""
            try:
                name = own or default()
                names.append(name)
                ranges.append(_axis_range(parameters, drive, name, texts, f"{option}-range"))
            except LinkworkError as error:
                if own is not None or texts is not None:
                    raise
                # the user chose nothing on this axis, and the verdict does not need a range
                over = name and f" over {name}"
                missing = InputError(f"no chart{over}, as {option} is not given: {error}")
    reached = _report_verdict(chosen.case.title, parameters, drive, start, begins=chosen.has_crank_speed(drive))
    if missing is not None:
        raise missing
    if not charted:
        return
    stem = common.output_folder(chosen.folder) / f"{chosen.stem}-stability"

    def write_first_picture(found: Any) -> None:
        """Write a picture of the chart when only its grid of points is computed; computing its boundaries takes longer."""
        common.print_paths(common.save_picture(figures.picture(found, title=chosen.case.title), stem, html=html))
        common.say("its boundaries follow; after Ctrl-C the picture stays without them")

    axis_names = (names[0], names[1])
    found = stability_chart(
        parameters,
        drive,
        axis_names,
        (ranges[0], ranges[1]),
        points=points,
        start=start,
        beside=linear_motion(parameters, drive, axis_names) if mechanism is FIVE_BAR else None,
        coexisting=coexisting,
        n_jobs=jobs,
        progress=common.console.is_terminal,
        first=write_first_picture,
    )
    _print_regions(found)
    _note_other_motion(found, reached)
    _print_runs(found)
    written = [found.to_csv(f"{stem}.csv"), found.boundaries_to_csv(f"{stem}-boundaries.csv")]
    written += [] if found.beside is None else [found.beside.to_csv(f"{stem}-coexisting.csv")]
    written += common.save_picture(figures.picture(found, title=chosen.case.title), stem, html=html)
    chosen.finish(written, found.problems)


def _axis_range(
    parameters: Any, drive: Any, name: str, texts: tuple[str, str] | None, option: str
) -> tuple[float, float]:
    from ..periodic import default_range, parameter_unit

    if texts is None:
        return default_range(parameters, drive, name)
    low, high = (common.quantity(text, parameter_unit(find_mechanism(parameters), name), option) for text in texts)
    _require_range(parameters, low, high, name, option, option)
    return low, high


def _report_verdict(title: str, parameters: Any, drive: Any, start: Any, *, begins: bool = False) -> Any:
    """Print the verdict on the stability of the motion that the machine reaches, and return this motion.

    For a five-bar the verdict by the linear equation is printed, too. ``start`` is a guess of the motion. The machine is run up
    slowly; if ``begins`` is true, it begins at ``start`` instead.
    """
    from ..periodic import reached_orbit
    from ..youssef import linear_verdict

    orbit = reached_orbit(parameters, drive, guess=start, start=start if begins else None)
    turn, (_, size, unit) = orbit.turn(), swing_unit(orbit)
    values = ", ".join(f"{m.real:.6g}{m.imag:+.6g}i" if m.imag else f"{m.real:.6g}" for m in orbit.multipliers)
    # cranks with a ratio of speeds have a common period; a crank under a torque has only a mean speed
    rpm = drive.speed / RAD_S_PER_RPM if drive.speed_drive else 60.0 * turn.turns / turn.period
    lines = [
        f"{title} at {rpm:.6g} rpm: {orbit.verdict()}",
        f"Floquet multipliers {values}; amplitude {size * orbit.amplitude:.5g} {unit}",
    ]
    if orbit.others:
        others = format_count(orbit.others, "other periodic motion")
        lines.append(f"{others} there: linkwork basins shows which starts lead to each")
    friction = _has_dry_friction(parameters)
    if drive.speed_drive and not friction and find_mechanism(parameters) is FIVE_BAR:
        lines.append(f"by the linear equation about u = 0, as in the thesis: {linear_verdict(parameters, drive)}")
    common.say("\n".join(lines))
    if friction:
        common.note(
            "Coulomb friction is smoothed over 1 mm/s: where it would stick, the model creeps to one place, "
            "and its multipliers are those of the creep"
        )
    return orbit


def _note_other_motion(found: Any, reached: Any) -> None:
    """Print a note if the chart follows another motion at the operating point than the one that the machine reaches."""
    from ..periodic import OrbitError, newton_orbit, parameter_value

    x, y = (parameter_value(reached.parameters, reached.drive, axis.name) for axis in found.axes)
    inside = found.grid.x.min() <= x <= found.grid.x.max() and found.grid.y.min() <= y <= found.grid.y.max()
    starts = found.grid.nearby_starts(x, y)
    if not (inside and len(starts)):
        return
    try:
        charted = newton_orbit(reached.parameters, reached.drive, start=starts[0], settle=False)
    except OrbitError:
        return
    if charted.distance(reached.start) > _SAME_MOTION:
        _, size, unit = swing_unit(charted)
        common.note(
            f"at its operating point the chart follows a motion of amplitude {size * charted.amplitude:.5g} {unit}, not "
            f"the motion of {size * reached.amplitude:.5g} {unit} that the machine reaches: --coexisting shows all motions"
        )


def _print_regions(found: Any) -> None:
    from ..periodic import TOLERANCE, TRUE_ORBIT, Crossing

    x, y = found.axes
    own = {traced.kind for traced in found.boundaries if traced.motion == TRUE_ORBIT}
    count = int((found.grid.largest > 1.0 + TOLERANCE).sum())
    sentences = [f"at {count} of {found.grid.largest.count()} points the motion that was found is unstable"]
    if Crossing.FOLD in own:
        sentences.append("where it crosses a fold it jumps to another motion, however stable both are")
    if found.beside is not None:
        several = int((found.beside.stable > 1).sum())
        sentences.append(f"at {several} of {found.beside.stable.size} points several stable motions were found")
        if unsure := int((found.beside.index != found.beside.index_of_all).sum()):
            sentences.append(
                f"at {unsure} points one more motion must exist, unless it is lost at the limit of assembly"
            )
    elif found.most > 1:
        sentences.append(
            f"up to {found.most} stable motions were found at one point of the lines searched: --coexisting shows where"
        )
    common.say("; ".join(sentences))
    rows = []
    for traced in found.boundaries:
        spans = [
            f"{axis.factor * values.min():.6g} to {axis.factor * values.max():.6g}"
            for axis, values in zip(found.axes, traced.points.T)
        ]
        ends = "; ".join(dict.fromkeys(map(str, traced.ends)))
        rows.append((traced.motion, traced.kind.value, *spans, ends))
    if rows:
        headings = ("motion", "kind", *_headings(x, y), "ends because")
        common.show_table("boundaries of instability", headings, rows)
    for removal in found.removals:
        common.say(removal)


def _headings(*axes: Any) -> list[str]:
    """Return the names of axes with their units, as headings; dots become spaces, where a narrow terminal can wrap the line."""
    return [f"{axis.name.replace('.', ' ')} [{axis.unit}]" for axis in axes]


def _print_runs(found: Any) -> None:
    x, y = found.axes
    headings = (*_headings(x, y), "verdict", "multiplier", "run", "growth a turn", "")
    rows = [
        (
            f"{x.factor * run.x:.6g}",
            f"{y.factor * run.y:.6g}",
            c.verdict.stability.value,
            f"{abs(c.verdict.largest_multiplier):.6f}",
            c.outcome.value,
            f"{c.growth:.6f}",
            "agrees" if c.agrees else "DOES NOT AGREE",
        )
        for run, c in ((run, run.confirmation) for run in found.runs)
    ]
    common.show_table("confirmed by long nonlinear runs", headings, rows)
