"""Commands about the generalised slider-crank: what it can do, its forces, its tolerances, the dual-number method, pictures."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import degrees, isinf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from click.core import ParameterSource
from rich.markup import escape
from rich.table import Table

from linkwork.errors import InputError
from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.plant import check_assembly
from linkwork.slider_crank.published import RAD_S_PER_RPM, SETS, PublishedSet

from ..slider_crank import mobility
from .common import CHECK_FAILED, changes, console, errors, handled, number_or_text, tolerance_option
from .design import print_written

if TYPE_CHECKING:
    from ..slider_crank.forces import ForceTurn
    from ..slider_crank.shifts import ShiftLaw
    from ..slider_crank.tolerances import MonteCarlo

#: The case that everything starts from where no other is named.
DEFAULT = "rahman-a4-10-s1-3.5"


@click.group("slider-crank")
def slider_crank() -> None:
    """The generalised slider-crank of Rahman's thesis: offset, shifted along its crank axis, twisted.

    Each command takes a file of parameters (TOML or JSON, with mechanism = "slider-crank") or a published case, and changes of
    it. Lengths, angles, speeds and so on are texts with a unit, such as '10 in' or '310 deg'; bare numbers are in SI.

    \b
    Examples:
      linkwork slider-crank info
      linkwork slider-crank info --offset '30 in' --shift '9 in'
      linkwork slider-crank forces --torque '100 lbf*in' --units inch
      linkwork slider-crank picture --animate
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chosen:
    """The mechanism that a command is about: its name for files, its title, its parameters, how it shifts, its speed."""

    name: str
    title: str
    parameters: SliderCrankParameters
    shift: float
    groove: str | None
    speed: float

    @property
    def law(self) -> mobility.PeriodicShift:
        """The shift over the crank angle, as mobility and pictures take it."""
        return mobility.constant_shift(self.shift) if self.groove is None else mobility.groove_shift(self.parameters)

    @property
    def force_law(self) -> ShiftLaw:
        """The shift over the crank angle, as the force problems take it."""
        from ..slider_crank.shifts import ConstantShift, GrooveShift

        p = self.parameters
        if self.groove is None:
            return ConstantShift(self.shift)
        return GrooveShift(p.groove_amplitude, p.groove_ratio, in_shaft=self.groove == "shaft")

    def shift_at(self, crank_angle: float) -> float:
        """Shift at a crank angle (m)."""
        return self.shift if self.groove is None else float(self.law.at(crank_angle)[0])


_MECHANISM_OPTIONS: Sequence[Callable[[Callable[..., Any]], Callable[..., Any]]] = (
    click.argument("file", required=False, type=click.Path(exists=True, dir_okay=False)),
    click.option("--published", metavar="NAME", help=f"A published case, by default {DEFAULT}: {', '.join(SETS)}."),
    click.option("--offset", metavar="LENGTH", help="Offset a4 between crank axis and guide, such as '10 in'."),
    click.option("--shift", metavar="LENGTH", help="Axial shift S1 of the crank, such as '3.5 in'."),
    click.option("--twist", metavar="ANGLE", help="Twist alpha4 between crank axis and guide, such as '310 deg'."),
    click.option(
        "--groove",
        type=click.Choice(["shaft", "apart"]),
        help="S1 = groove.amplitude sin(groove.ratio theta1): made by a groove in the crank's shaft as in the FMU, or by "
        "something apart from the crank as in the thesis.",
    ),
    click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="NAME=VALUE",
        help="Change a parameter by its name in the FMU, such as rod.length='45 in' or assembly.branch=-1.",
    ),
)


def mechanism_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of `_chosen`."""
    for option in reversed(_MECHANISM_OPTIONS):
        command = option(command)
    return command


speed_option = click.option("--speed", metavar="SPEED", help="Crank speed, such as '50 rpm'.")
out_option = click.option(
    "--out", default="out", show_default=True, type=click.Path(file_okay=False), help="Folder for the results."
)
units_option = click.option(
    "--units",
    type=click.Choice(["SI", "inch"]),
    default="SI",
    show_default=True,
    help="Of what is told and written; inch: inches, pounds force and degrees.",
)
plot_option = click.option("--plot/--no-plot", default=True, show_default=True, help="Whether to write plots.")


def _chosen(
    told: _Units,
    *,
    file: str | None,
    published: str | None,
    offset: str | None,
    shift: str | None,
    twist: str | None,
    groove: str | None,
    settings: Sequence[str],
    speed: str | None = None,
    paced: bool = False,
) -> _Chosen:
    """The mechanism of the options; ``paced`` says whether the speed matters.

    Raises
    ------
    LinkworkError
        If a file, a name or a value is wrong.
    """
    from ..files import io

    if file is not None and published is not None:
        raise click.UsageError("give either a file of parameters or --published NAME")
    base: PublishedSet | None = None
    if file is not None:
        loaded = io.load_parameters(file)
        if not isinstance(loaded, SliderCrankParameters):
            raise InputError(
                f'{file} is of a five-bar: for a slider-crank it must begin with mechanism = "slider-crank"'
            )
        name, title, parameters = Path(file).stem, Path(file).stem, loaded
        start, pace = 0.0, SETS[DEFAULT].crank_speed
    else:
        name = DEFAULT if published is None else published
        if name not in SETS:
            raise io.unknown_name(name, SETS)
        base = SETS[name]
        title, parameters, start, pace = base.source, base.parameters, base.initial.shift_position, base.crank_speed
    values = changes(settings, number_or_text, "rod.length='45 in'")
    for key, text in (("guide.offset", offset), ("guide.twist", twist)):
        if text is not None:
            values[key] = number_or_text(text)
    if shift is not None:
        if groove is not None:
            raise click.UsageError("--shift holds the crank, --groove moves it: give one of them")
        start = io.quantity(number_or_text(shift), "m", "--shift")
    if speed is not None:
        pace = io.quantity(number_or_text(speed), "rad/s", "--speed")
    if values:
        changed = io.parameters_from(values, parameters)
        assert isinstance(changed, SliderCrankParameters)
        parameters = changed
    _check_groove(groove, parameters, values)
    if file is not None:
        taken = []
        if shift is None and groove is None:
            taken.append(f"S1 = {told.length(start)} (--shift)")
            if parameters.groove_amplitude != 0.0:
                taken.append("no groove (--groove)")
        if paced and speed is None:
            taken.append(f"a crank speed of {pace / RAD_S_PER_RPM:.6g} rpm (--speed)")
        if taken:
            _note(f"the file does not say, and is taken: {', '.join(taken)}")
    if base is not None and (values or shift is not None or groove is not None):
        name, title = "slider-crank", _words(told, parameters, start, groove)
    return _Chosen(name=name, title=title, parameters=parameters, shift=start, groove=groove, speed=pace)


def _check_groove(groove: str | None, p: SliderCrankParameters, values: Mapping[str, Any]) -> None:
    """Make sure that what is said of a groove has an effect."""
    if groove is None:
        for name in values:
            if name.startswith("groove."):
                raise click.UsageError(f"--set {name} has no effect without --groove shaft or --groove apart")
    elif p.groove_amplitude == 0.0:
        raise click.UsageError(
            f"--groove {groove} with groove.amplitude = 0 makes no shift: give --set groove.amplitude='3 in', say, or hold "
            "the crank with --shift"
        )


def _note(text: str) -> None:
    """Tell what a reader must know beside the results."""
    errors.print(f"note: {text}", style="yellow", markup=False, highlight=False, soft_wrap=True)


def _words(told: _Units, p: SliderCrankParameters, shift: float, groove: str | None) -> str:
    """A title of a mechanism that has none."""
    moved = f"S1 = {told.length(shift)}"
    if groove is not None:
        moved = f"SS1 = {told.length(p.groove_amplitude)}, alpha = {p.groove_ratio:g}"
    return f"Slider-crank: a4 = {told.length(p.guide_offset)}, {moved}, alpha4 = {degrees(p.guide_twist):.6g} deg"


class _Units:
    """Numbers as texts in the units of the output."""

    def __init__(self, system: str) -> None:
        from ..slider_crank.forces import UNITS

        self.system = system
        # angles are told in degrees in either
        self.table: dict[str, tuple[str, float]] = {**UNITS[system], "rad": UNITS["inch"]["rad"]}

    def name(self, si: str) -> str:
        """What the unit is called."""
        return self.table.get(si, (si, 1.0))[0]

    def per(self, si: str) -> float:
        """How many of it one of SI is."""
        return 1.0 / self.table.get(si, (si, 1.0))[1]

    def length(self, value: float) -> str:
        return f"{value * self.per('m'):.6g} {self.name('m')}"

    @property
    def picture(self) -> str:
        """Of the lengths in pictures."""
        return "in" if self.system == "inch" else "mm"


def _angle(value: float) -> str:
    return f"{degrees(value):.2f} deg"


@slider_crank.command()
@mechanism_options
@units_option
@handled
def info(units: str, **given: Any) -> None:
    """Tell where the mechanism can be assembled, its dead centres, its stroke, and how far its crank may shift.

    \b
    Examples:
      linkwork slider-crank info --units inch
      linkwork slider-crank info --published rahman-a4-20-alpha4-310
      linkwork slider-crank info --offset '30 in' --set rod.length='40 in'
      linkwork slider-crank info --groove shaft --set groove.amplitude='3 in' --set groove.ratio=2
    """
    from ..figures.slider_crank_picture import assembled_ranges

    told = _Units(units)
    chosen = _chosen(told, **given)
    p, law = chosen.parameters, chosen.law
    margin = mobility.assembly_margin(p, law)
    parts = assembled_ranges(p, law)
    grid = Table(title=escape(chosen.title), title_justify="left", show_header=False)
    grid.add_column("what", no_wrap=True)
    grid.add_column("value")
    shift = told.length(chosen.shift) if chosen.groove is None else "made by the groove"
    most = mobility.greatest_shift(p)
    greatest = "none: it cannot" if most is None else "any" if isinf(most) else told.length(most)
    turns = "turns fully" if margin.length >= 0.0 else "does not turn fully"
    for row in (
        ("crank a1, rod a2", f"{told.length(p.crank_length)}, {told.length(p.rod_length)}"),
        ("offset a4, twist alpha4", f"{told.length(p.guide_offset)}, {degrees(p.guide_twist):.6g} deg"),
        ("shift S1", shift),
        ("assembly", f"branch {p.assembly_branch:+d}"),
        ("the crank", turns),
        ("least assembly margin", f"{told.length(margin.length)} at {_angle(margin.crank_angle)}"),
        ("greatest constant shift for a full turn", greatest),
    ):
        grid.add_row(*row)
    console.print(grid)
    length = told.name("m")
    for part in parts:
        full = f"{_angle(part.low)} to {_angle(part.high)}"
        ends = f"stroke {told.length(part.stroke)}, slider {told.length(part.least.slider_position)}"
        console.print(
            f"range {full}: {ends} to {told.length(part.greatest.slider_position)}", highlight=False, soft_wrap=True
        )
    found = mobility.dead_centres(p, law)
    if not found:
        still = all(part.stroke <= 1e-12 * p.rod_length for part in parts)
        console.print("no dead centres" + ": the slider stands still, whatever the crank angle" * still)
        return
    centres = Table(title="dead centres", title_justify="left")
    for heading in ("crank angle [deg]", f"shift [{length}]", f"slider position [{length}]"):
        centres.add_column(heading, justify="right")
    centres.add_column("which")
    for d in found:
        centres.add_row(
            f"{degrees(d.crank_angle):.2f}",
            f"{d.shift * told.per('m'):.6g}",
            f"{d.slider_position * told.per('m'):.6g}",
            "outer" if d.outer else "inner",
        )
    console.print(centres)


# Forces


def _problem(torque: str | None, load: str | None) -> dict[str, float]:
    """What is given: ``torque`` (N.m) or ``load`` (N)."""
    from ..files import io

    if torque is not None and load is not None:
        raise click.UsageError("give --torque, and the slider's force is sought, or --load, and the torque is")
    if torque is not None:
        return {"torque": io.quantity(number_or_text(torque), "N.m", "--torque")}
    return {"load": 0.0 if load is None else io.quantity(number_or_text(load), "N", "--load")}


def _turn(chosen: _Chosen, given: Mapping[str, float], points: int, *, at: float | None = None) -> ForceTurn:
    """The force problem over the turn and ``at`` an angle of it, or over what of these can be assembled."""
    from ..slider_crank.forces import force_turn

    angles = np.linspace(0.0, 2.0 * np.pi, points)
    if at is not None and np.abs(angles - at).min() > 1e-9:
        angles = np.sort(np.append(angles, at))
    turn = force_turn(
        chosen.parameters,
        crank_speed=chosen.speed,
        shift=chosen.force_law,
        angles=angles,
        partial=True,
        **given,
    )
    if len(turn.unreachable):
        _note(
            f"the rod does not reach the guide at {len(turn.unreachable)} of {len(angles)} crank angles, which are left out"
        )
    return turn


@slider_crank.command()
@mechanism_options
@speed_option
@click.option("--torque", metavar="TORQUE", help="On the crank; the slider's force is sought. Such as '100 lbf*in'.")
@click.option("--load", metavar="FORCE", help="On the slider; the crank's torque is sought. 0 by default.")
@click.option(
    "--frame",
    "frames",
    type=click.IntRange(1, 4),
    multiple=True,
    default=(1,),
    show_default=True,
    help="Of the components shown: 1 ground, 2 crank, 3 rod, 4 guide; can be given often.",
)
@click.option("--points", type=click.IntRange(2), default=721, show_default=True, help="Crank angles over the turn.")
@units_option
@out_option
@plot_option
@handled
def forces(
    torque: str | None,
    load: str | None,
    frames: Sequence[int],
    points: int,
    units: str,
    out: str,
    plot: bool,
    **given: Any,
) -> None:
    """Find all joint forces over a turn: with the torque given the slider's force, with the load given the torque.

    With the torque given there is no finite slider force at the dead centres, and where the crank cannot turn fully all
    forces grow without bound towards the limits of assembly. They are told with the reason; extremes are of what is more than
    10 deg from them.

    \b
    Examples:
      linkwork slider-crank forces --torque '100 lbf*in' --units inch
      linkwork slider-crank forces --load '-20 lbf' --frame 2 --frame 4
      linkwork slider-crank forces crank.toml --speed '300 rpm' --out results
    """
    from ..figures.slider_crank import plot_forces
    from ..files import io

    told = _Units(units)
    chosen = _chosen(told, paced=True, **given)
    turn = _turn(chosen, _problem(torque, load), points)
    clear = turn.clear()
    grid = Table(title=escape(f"{chosen.title}: {turn.sought} sought"), title_justify="left")
    for heading in ("quantity", "unit", "least", "at [deg]", "greatest", "at [deg]"):
        grid.add_column(heading, justify="left" if heading in ("quantity", "unit") else "right")
    quantities = _quantities(turn, frames)
    rows = [_extremes(turn.angle, values, clear if si in ("N", "N.m") else np.True_) for _, si, values in quantities]
    size = {si: 0.0 for _, si, _ in quantities}
    for (_, si, _), row in zip(quantities, rows):
        size[si] = max(size[si], *(abs(value) for value in row[::2]) if row else (0.0,))
    for (name, si, _), row in zip(quantities, rows):
        if row is not None:
            low, at_low, high, at_high = row
            # what is rounding beside the greatest of its kind is none
            ends = (0.0 if abs(value) <= 1e-12 * size[si] else value * told.per(si) for value in (low, high))
            cells = (_texts(value, angle) for value, angle in zip(ends, (at_low, at_high)))
            grid.add_row(name, told.name(si), *(cell for pair in cells for cell in pair))
    console.print(grid)
    _singular(turn, told)
    folder = Path(out)
    written = [turn.to_csv(folder / f"{chosen.name}-forces.csv", units=units)]
    if plot:
        for frame in dict.fromkeys(frames):
            scene = turn.scene(frame, units=units)
            figure = plot_forces(scene, title=f"{chosen.title}: joint forces in frame {frame}")
            written.append(io.save_figure(figure, folder / f"{chosen.name}-forces-frame-{frame}.png"))
    print_written(written)


def _texts(value: float, angle: float) -> tuple[str, str]:
    return f"{value:.6g}", f"{degrees(angle):.1f}"


def _quantities(turn: ForceTurn, frames: Sequence[int]) -> list[tuple[str, str, Any]]:
    """Names, SI units and values of what is told of a turn."""
    from ..slider_crank.forces import JOINTS, WORDS

    found: list[tuple[str, str, Any]] = [
        ("slider position", "m", turn.slider_position),
        ("crank torque", "N.m", turn.torque),
        ("slider force", "N", turn.slider_force),
        ("axial force on the crank", "N", turn.axial_force),
    ]
    for frame in dict.fromkeys(frames):
        for name, moment in JOINTS.items():
            vector, unit = turn.vector(name, frame), "N.m" if moment else "N"
            found += [(f"{WORDS[name]}, {axis}{frame}", unit, vector[:, i]) for i, axis in enumerate("ijk")]
    return found


def _extremes(angle: Any, values: Any, clear: Any) -> tuple[float, float, float, float] | None:
    """Least and greatest of what is clear of singularities and not masked, and their angles; None if nothing is."""
    good = clear & ~np.ma.getmaskarray(values)
    if not good.any():
        return None
    angle, values = angle[good], np.ma.getdata(values)[good]
    low, high = int(np.argmin(values)), int(np.argmax(values))
    return float(values[low]), float(angle[low]), float(values[high]), float(angle[high])


def _singular(turn: ForceTurn, told: _Units) -> None:
    """Dead centres and limits of assembly, and what could not be determined there."""
    from ..slider_crank.forces import CLEAR_DEG, SLIDER_FORCE

    without = f"grows without bound towards it; within {CLEAR_DEG:g} deg it is not among the extremes"
    for d in turn.dead_centres:
        console.print(
            f"dead centre at {_angle(d.crank_angle)}, slider at {told.length(d.slider_position)}", highlight=False
        )
    sentences = []
    if turn.sought == SLIDER_FORCE:
        sentences += [
            f"no slider force at {_angle(d.crank_angle)}: it has no lever on the crank there, and {without}"
            for d in turn.singularities
        ]
    sentences += [
        f"limit of assembly at {_angle(end)}: the rod is perpendicular to the guide there, and every force {without}"
        for end in turn.limits
    ]
    if not turn.clear().any():
        sentences.append("no crank angle is clear of these, and no force has extremes")
    for sentence in (*sentences, *(f"masked: {text}" for text in turn.masked)):
        console.print(sentence, highlight=False, soft_wrap=True)


# Tolerances

#: Half widths where none are given: of each length, and of the twist.
_TOLERANCES = {
    "crank.length": "0.25 mm",
    "rod.length": "0.25 mm",
    "guide.offset": "0.25 mm",
    "shift.position": "0.25 mm",
    "guide.twist": "0.1 deg",
}


@slider_crank.command()
@mechanism_options
@speed_option
@click.option(
    "--tolerance",
    "widths",
    multiple=True,
    metavar="NAME=HALF_WIDTH",
    help="What is in error and by how much, such as guide.offset='0.5 mm' or guide.twist='0.2 deg'; can be given often. By "
    "default the lengths by 0.25 mm and the twist by 0.1 deg.",
)
@click.option(
    "--distribution",
    type=click.Choice(["normal", "uniform", "triangular"]),
    default="normal",
    show_default=True,
    help="Of the errors; a normal one has three standard deviations in the half width.",
)
@click.option(
    "--quantity",
    "quantities",
    multiple=True,
    default=("slider.position",),
    show_default=True,
    metavar="NAME",
    help="An output of the FMU, such as crank_pin.fz, or slider.load; can be given often.",
)
@click.option("--torque", metavar="TORQUE", help="On the crank; the slider's force is sought. Such as '100 lbf*in'.")
@click.option("--load", metavar="FORCE", help="On the slider; the crank's torque is sought. 0 by default.")
@click.option("--angle", default="30 deg", show_default=True, metavar="ANGLE", help="Crank angle of the histogram.")
@click.option("--points", type=click.IntRange(2), default=73, show_default=True, help="Crank angles over the turn.")
@click.option("--samples", type=click.IntRange(2), default=100_000, show_default=True, help="Of the Monte Carlo.")
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="The same seed gives the same samples."
)
@units_option
@out_option
@plot_option
@handled
def tolerances(
    widths: Sequence[str],
    distribution: str,
    quantities: Sequence[str],
    torque: str | None,
    load: str | None,
    angle: str,
    points: int,
    samples: int,
    seed: int,
    units: str,
    out: str,
    plot: bool,
    **given: Any,
) -> None:
    """Tell what manufacturing tolerances do: exact sensitivities, a linear estimate, and a Monte Carlo beside it.

    \b
    Examples:
      linkwork slider-crank tolerances
      linkwork slider-crank tolerances --tolerance guide.offset='0.5 mm' --tolerance guide.twist='0.2 deg'
      linkwork slider-crank tolerances --quantity slider.position --quantity crank_pin.fz --load '-20 lbf' --seed 7
    """
    from ..figures.slider_crank import plot_tolerances
    from ..files import io
    from ..slider_crank import tolerances as study
    from ..slider_crank.forces import NO_LEVER

    told = _Units(units)
    chosen = _chosen(told, paced=True, **given)
    at = _in_the_turn(io.quantity(number_or_text(angle), "rad", "--angle"), chosen)
    allowed = [_tolerance(text, distribution) for text in widths or (f"{k}={v}" for k, v in _TOLERANCES.items())]
    quantities = tuple(dict.fromkeys(quantities))
    turn = _turn(chosen, _problem(torque, load), points, at=at)
    exact = study.sensitivities(turn, tuple(t.name for t in allowed), quantities)
    for quantity in quantities:
        if np.ma.getmaskarray(exact.values[quantity]).all():
            why = NO_LEVER if turn.without_lever else "all the crank angles are dead centres"
            raise InputError(f"{quantity} is not determined: {why}; give --load in place of --torque")
    place = int(np.argmin(np.abs(turn.angle - at)))
    here = f"{degrees(float(turn.angle[place])):.6g} deg"
    if abs(float(turn.angle[place]) - at) > 1e-9:
        _note(
            f"it cannot be assembled at {degrees(at):.6g} deg: the nearest of the angles, {here}, is taken in its place"
        )
    grid = Table(title=escape(f"{chosen.title}: sensitivities"), title_justify="left")
    for heading in ("quantity", "to", "unit", f"at {here}", "greatest", "at [deg]"):
        grid.add_column(heading, justify="left" if heading in ("quantity", "to", "unit") else "right")
    written: dict[str, Any] = {"crank angle [deg]": np.degrees(turn.angle)}
    for quantity in quantities:
        effect = max(float(np.ma.abs(exact.of(quantity, t.name)).max()) * t.extent for t in allowed)
        for t in allowed:
            unit = _ratio(told.name(study.QUANTITIES[quantity]), told.name(study.ERRORS[t.name]))
            scale = told.per(study.QUANTITIES[quantity]) / told.per(study.ERRORS[t.name])
            values = exact.of(quantity, t.name) * scale
            written[f"d {quantity} / d {t.name} [{unit}]"] = values.filled(np.nan)
            considered = turn.clear(poles=study.QUANTITIES[quantity] in ("N", "N.m"))
            greatest = np.where(considered, np.ma.abs(values).filled(-1.0), -1.0)
            top = int(np.argmax(greatest))
            # what is rounding beside the greatest effect of any tolerance is none
            tiny = 1e-12 * effect / t.extent * scale
            texts = [
                "none" if np.ma.is_masked(values[i]) else f"{values[i] if abs(values[i]) > tiny else 0.0:.6g}"
                for i in (place, top)
            ]
            texts.append(f"{degrees(float(turn.angle[top])):.1f}")
            # none may be clear of poles and limits
            grid.add_row(quantity, t.name, unit, *(texts if greatest[top] >= 0.0 else (texts[0], "none", "")))
    console.print(grid)
    with console.status(f"{samples} samples at {len(turn)} crank angles"):
        found = study.monte_carlo(turn, allowed, quantities=quantities, samples=samples, seed=seed)
    folder = Path(out)
    files = [io.write_csv(folder / f"{chosen.name}-sensitivities.csv", written)]
    files.append(io.write_csv(folder / f"{chosen.name}-tolerances.csv", _spread_columns(found, quantities, told)))
    _spread_table(found, quantities, place, f"{chosen.title}: spread at {here}, {samples} samples", told)
    for message in found.notes(units):
        _note(message)
    if plot:
        for quantity in quantities:
            si = study.QUANTITIES[quantity]
            shown = (told.name(si), told.per(si)) if units == "inch" else None
            scene = found.scene(quantity, at, units=units)
            figure = plot_tolerances(scene, title=f"{chosen.title}: {quantity}", shown=shown)
            files.append(io.save_figure(figure, folder / f"{chosen.name}-tolerances-{quantity}.png"))
    print_written(files)


def _in_the_turn(angle: float, chosen: _Chosen) -> float:
    """The same crank angle from 0 to 360 deg.

    Raises
    ------
    InputError
        If it is outside of them and the shift there is another than a turn before or after.
    """
    full = 2.0 * np.pi
    if 0.0 <= angle <= full:
        return angle
    if chosen.groove is not None and not chosen.parameters.groove_ratio.is_integer():
        raise InputError(
            f"--angle is {degrees(angle):.6g} deg: with groove.ratio = {chosen.parameters.groove_ratio:g} the shift is another "
            "in every turn; give an angle from 0 to 360 deg"
        )
    return float(angle % full)


def _ratio(above: str, below: str) -> str:
    """A unit over another."""
    return f"{above}/({below})" if "." in below or "/" in below else f"{above}/{below}"


def _tolerance(text: str, distribution: str) -> Any:
    """A tolerance from NAME=HALF_WIDTH."""
    from ..files import io
    from ..slider_crank.tolerances import ERRORS, Tolerance

    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise click.UsageError(f"--tolerance {text!r}: it must be NAME=HALF_WIDTH, such as guide.offset='0.5 mm'")
    if name not in ERRORS:
        raise io.unknown_name(name, ERRORS)
    width = io.quantity(number_or_text(value), ERRORS[name], name)
    return Tolerance(name, half_width=width, distribution=distribution)


def _spread_columns(found: MonteCarlo, quantities: Sequence[str], told: _Units) -> dict[str, Any]:
    """Everything of a Monte Carlo over the turn."""
    from ..slider_crank.tolerances import PERCENTILES, QUANTITIES

    columns: dict[str, Any] = {"crank angle [deg]": np.degrees(found.turn.angle)}
    for quantity in quantities:
        unit, scale = told.name(QUANTITIES[quantity]), told.per(QUANTITIES[quantity])
        linear, spread = found.estimates[quantity], found.spreads[quantity]
        parts = {
            "nominal": linear.nominal,
            "linear standard deviation": linear.deviation,
            "linear worst case": linear.worst,
            "standard deviation": spread.deviation,
            "mean": spread.mean,
        }
        parts |= {f"{share:.4g} %": row for share, row in zip(PERCENTILES, spread.percentiles)}
        columns |= {f"{quantity} {what} [{unit}]": (x * scale).filled(np.nan) for what, x in parts.items()}
    return columns | {"not assembled": found.not_assembled, "at a dead centre": found.undetermined}


def _spread_table(found: MonteCarlo, quantities: Sequence[str], place: int, title: str, told: _Units) -> None:
    """The estimates and the samples at one crank angle."""
    from ..slider_crank.tolerances import QUANTITIES

    grid = Table(title=escape(title), title_justify="left")
    for heading in (
        "quantity",
        "unit",
        "nominal",
        "sd, linear",
        "sd, 2nd order",
        "sd, samples",
        "worst, linear",
        "mean off",
    ):
        grid.add_column(heading, justify="left" if heading in ("quantity", "unit") else "right")
    for quantity in quantities:
        scale = told.per(QUANTITIES[quantity])
        linear, spread = found.estimates[quantity], found.spreads[quantity]
        cells = (
            linear.nominal[place],
            linear.deviation[place],
            linear.second_deviation[place],
            spread.deviation[place],
            linear.worst[place],
            spread.mean[place] - linear.nominal[place],
        )
        digits = (6, 3, 3, 3, 3, 2)
        texts = ("none" if np.ma.is_masked(x) else f"{x * scale:.{n}g}" for x, n in zip(cells, digits))
        grid.add_row(quantity, told.name(QUANTITIES[quantity]), *texts)
    console.print(grid)


# The dual-number method


@slider_crank.command()
@mechanism_options
@speed_option
@click.option("--torque", metavar="TORQUE", help="On the crank; the slider's force is sought.")
@click.option("--load", metavar="FORCE", help="On the slider; the crank's torque is sought. 0 by default.")
@click.option("--points", type=click.IntRange(2), default=361, show_default=True, help="Crank angles over the turn.")
@click.option(
    "--tolerance",
    type=float,
    callback=tolerance_option,
    default=1e-9,
    show_default=True,
    help="Largest relative difference that passes.",
)
@click.option(
    "--two-rotations", is_flag=True, help="Show instead where the thesis's own closure ends, and how far open."
)
@units_option
@out_option
@handled
def dual(
    torque: str | None,
    load: str | None,
    points: int,
    tolerance: float,
    two_rotations: bool,
    units: str,
    out: str,
    **given: Any,
) -> None:
    """Hold the thesis's dual-number method against vector mechanics, quantity by quantity.

    The loop is closed by dual matrices with true ball joints, forces by dual momenta. Differences are relative to the largest
    quantity of the same unit. --two-rotations shows the thesis's own form, which gives each ball joint two rotations and
    settles on loops that are not closed.

    \b
    Examples:
      linkwork slider-crank dual
      linkwork slider-crank dual --published rahman-a4-20-alpha4-310 --torque '100 lbf*in'
      linkwork slider-crank dual --two-rotations --units inch
    """
    told = _Units(units)
    if two_rotations:
        source = click.get_current_context().get_parameter_source
        for name in ("torque", "load", "speed", "tolerance"):
            if source(name) is not ParameterSource.DEFAULT:
                raise click.UsageError(f"--{name} has no effect with --two-rotations, which is about positions alone")
        _two_rotations(_chosen(told, **given), points, told, Path(out))
        return
    chosen = _chosen(told, paced=True, **given)
    problem = _problem(torque, load)
    if chosen.groove == "shaft" and "torque" in problem:
        raise click.UsageError("--torque is for a shift that is driven apart from the crank: give --groove apart")
    if not _dual_table(chosen, problem, points, tolerance):
        errors.print("check failed: the two do not agree", style="red")
        sys.exit(CHECK_FAILED)
    console.print("the two agree", style="green")


def _dual_table(chosen: _Chosen, problem: Mapping[str, float], points: int, tolerance: float) -> bool:
    """Show the differences; whether all are within the tolerance."""
    from ..slider_crank.comparison import compare

    found = compare(_turn(chosen, problem, points))
    grid = Table(
        title=escape(f"{chosen.title}: dual numbers less vector mechanics, {found.angles} crank angles"),
        title_justify="left",
    )
    for heading in ("quantity", "unit", "largest", "largest difference", "relative", "verdict"):
        grid.add_column(heading, justify="left" if heading in ("quantity", "unit", "verdict") else "right")
    for d in found.differences:
        verdict, style = ("pass", None) if d.relative <= tolerance else ("FAIL", "red")
        numbers = f"{d.largest:.6g}", f"{d.difference:.1e}", f"{d.relative:.1e}"
        grid.add_row(d.quantity, d.unit, *numbers, verdict, style=style)
    console.print(grid)
    console.print(
        f"the loop closes to {found.rotation_residual:.1e} rad and {found.length_residual:.1e} m in at most "
        f"{found.iterations} iterations; moment about the rod's line, which no equation asks for: {found.rod_moment:.1e} N.m",
        highlight=False,
        soft_wrap=True,
    )
    return found.agrees(tolerance)


def _two_rotations(chosen: _Chosen, points: int, told: _Units, folder: Path) -> None:
    """Where the thesis's iteration ends over the turn."""
    from ..files import io
    from ..slider_crank.closure import shortage
    from ..slider_crank.two_rotations import settle

    angle = np.linspace(0.0, 2.0 * np.pi, points)
    shift = np.array([chosen.shift_at(float(a)) for a in angle])
    reached = shortage(chosen.parameters, angle, shift) < 0.0
    if not reached.any():
        worst = int(np.argmin(shortage(chosen.parameters, angle, shift)))
        check_assembly(chosen.parameters, float(angle[worst]), float(shift[worst]))
    end = settle(chosen.parameters, angle[reached], shift[reached])
    length = told.name("m")
    columns = {
        "crank angle [deg]": np.degrees(end.crank_angle),
        f"slider position [{length}]": end.unknowns[:, 4] * told.per("m"),
        f"off by [{length}]": end.position_error * told.per("m"),
        "rotation residual [deg]": np.degrees(end.rotation_residual),
        f"length residual [{length}]": end.length_residual * told.per("m"),
        "steps": end.steps.astype(float),
        "settled": end.settled.astype(float),
    }
    grid = Table(title=escape(f"{chosen.title}: closure with two rotations per ball joint"), title_justify="left")
    for heading in columns:
        grid.add_column(heading, justify="right")
    for i in range(0, len(end.steps), max(1, len(end.steps) // 12)):
        cells = [f"{values[i]:.6g}" for values in columns.values()]
        grid.add_row(*cells[:-1], "yes" if end.settled[i] else "no", style=None if end.settled[i] else "yellow")
    console.print(grid)
    console.print(
        f"largest rotation residual {np.degrees(end.rotation_residual).max():.2f} deg, length residual "
        f"{told.length(float(end.length_residual.max()))}; slider position off by up to "
        f"{told.length(float(end.position_error.max()))}; the steps become small at {int(end.settled.sum())} of "
        f"{len(end.settled)} crank angles",
        highlight=False,
        soft_wrap=True,
    )
    print_written([io.write_csv(folder / f"{chosen.name}-two-rotations.csv", columns)])


# Pictures


@slider_crank.command()
@mechanism_options
@click.option("--angle", default="30 deg", show_default=True, metavar="ANGLE", help="Crank angle of the picture.")
@click.option("--view", nargs=2, metavar="ELEVATION AZIMUTH", help="Of the eye, such as '22 deg' '-112 deg'.")
@click.option("--range", "with_range", is_flag=True, help="Draw also where it can be assembled.")
@click.option("--animate", is_flag=True, help="Write also an animation, GIF.")
@click.option("--frames", type=click.IntRange(2), default=48, show_default=True, help="Pictures in the animation.")
@units_option
@out_option
@handled
def picture(
    angle: str,
    view: tuple[str, str] | None,
    with_range: bool,
    animate: bool,
    frames: int,
    units: str,
    out: str,
    **given: Any,
) -> None:
    """Draw the mechanism in space, with frames 1 and 4, paths and dead centres.

    \b
    Examples:
      linkwork slider-crank picture --units inch
      linkwork slider-crank picture --published rahman-a4-20-alpha4-310 --animate
      linkwork slider-crank picture --set rod.length='30 in' --offset '20 in' --angle '180 deg' --range
    """
    from ..figures import slider_crank_picture as pictures
    from ..files import io

    told = _Units(units)
    chosen = _chosen(told, **given)
    p, folder = chosen.parameters, Path(out)
    turned = io.quantity(number_or_text(angle), "rad", "--angle")
    common: dict[str, Any] = {"law": chosen.law, "unit": told.picture, "title": chosen.title}
    seen = common
    if view is not None:
        eye = [degrees(io.quantity(number_or_text(text), "rad", "--view")) for text in view]
        seen = common | {"view": (eye[0], eye[1])}
    figure = pictures.plot_mechanism(p, turned, chosen.shift_at(turned), **seen)
    written = [io.save_figure(figure, folder / f"{chosen.name}.png")]
    if with_range:
        written.append(io.save_figure(pictures.plot_range(p, **common), folder / f"{chosen.name}-range.png"))
    if animate:
        with console.status(f"drawing {frames} pictures"):
            written.append(pictures.animate_mechanism(p, folder / f"{chosen.name}.gif", frames=frames, **seen))
    print_written(written)
