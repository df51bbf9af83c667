"""Options that all commands about the slider-crank share: mechanism, units, and force or torque."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import wraps
from math import degrees, tau
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from linkwork.errors import InputError, LinkworkError
from linkwork.slider_crank.parameters import SliderCrankParameters
from linkwork.slider_crank.published import SETS

from ... import slider_crank as sc
from ...mechanisms import SLIDER_CRANK
from ...units import RAD_S_PER_RPM
from .. import common
from ..common import (
    NUMBER,
    PARAMETERS,
    changes,
    check_kind,
    in_units,
    number_or_text,
    print_error,
    quantity,
    report_errors,
)

if TYPE_CHECKING:
    from ...slider_crank import ForceTurn, PeriodicShift, ShiftLaw

#: The published case that is used by default.
DEFAULT = "rahman-a4-10-s1-3.5"

Command = Callable[..., Any]


class Units:
    """The system of units of the output: "SI" (lengths in mm) or "inch"; angles are in degrees in both systems."""

    def __init__(self, system: str) -> None:
        self.system = system
        self._table = {**sc.shown_units(system), "rad": sc.UNITS["inch"]["rad"]}

    def name(self, si: str) -> str:
        """Return the name of the unit in which the output shows quantities with the SI unit ``si``."""
        return self._table.get(si, (si, 1.0))[0]

    def factor(self, si: str) -> float:
        """Return the factor from the SI unit ``si`` to the unit of the output."""
        return 1.0 / self._table.get(si, (si, 1.0))[1]

    def length(self, value: float) -> str:
        return f"{value * self.factor('m'):.6g} {self.name('m')}"

    def convert_error(self, text: str) -> str:
        """Return an error message with its quantities converted from SI to the units of the output, except texts in quotes."""
        variables = SLIDER_CRANK.mechanism_variables

        def parameter(found: re.Match[str]) -> str:
            unit = variables[found[1]].unit if found[1] in variables else ""
            return found[0][:-1] + f" {unit}:" if unit in ("m", "N", "N.m") else found[0]

        text = re.sub(rf"^parameter ([\w.]+) is {NUMBER}:", parameter, text)
        return in_units(text, lambda si: (self.name(si), self.factor(si)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismChoice:
    """The mechanism that the options of a command choose.

    ``name`` is the first part of the names of files that are written. ``shift`` (m) is the constant shift S1 of the crank; it
    has no effect if a groove moves the crank. ``groove`` is "shaft" for a groove in the crank shaft, "apart" for a drive apart
    from the crank, None without a groove. ``speed`` is the crank speed (rad/s).
    """

    name: str
    title: str
    parameters: SliderCrankParameters
    shift: float
    groove: str | None
    speed: float
    units: Units

    @property
    def law(self) -> PeriodicShift:
        """Return the shift as a function of the crank angle, for ranges of assembly and pictures."""
        if self.groove is None:
            return sc.constant_shift(self.shift)
        return sc.groove_shift(self.parameters)

    @property
    def force_law(self) -> ShiftLaw:
        """Return the shift as a function of the crank angle, for force problems."""
        p = self.parameters
        if self.groove is None:
            return sc.ConstantShift(self.shift)
        return sc.GrooveShift(p.groove_amplitude, p.groove_ratio, in_shaft=self.groove == "shaft")

    def link_shift(self, crank_angle: Any) -> Any:
        """Return the shift (m) at crank angles (rad)."""
        return self.force_law.at(crank_angle, 0.0, 0.0).shift


@dataclass(frozen=True, slots=True, kw_only=True)
class _MechanismOptions:
    """Options about the mechanism, as texts from the command line."""

    file: str | None
    published: str | None
    offset: str | None
    shift: str | None
    twist: str | None
    groove: str | None
    settings: Sequence[str]
    units: str
    speed: str | None = None

    def choose(self, *, paced: bool) -> MechanismChoice:
        """Return the mechanism that the options choose; ``paced`` says whether the crank speed has an effect.

        Raises LinkworkError if a file, a name or a value is wrong.
        """
        from ...files import unknown_name
        from ...run import load_parameters, read_parameters

        units = Units(self.units)
        start, speed = 0.0, SETS[DEFAULT].crank_speed
        name = self.published or DEFAULT
        if self.file is not None:
            if self.published is not None:
                raise click.UsageError("give either a file of parameters or --published NAME")
            check_kind(self.file, PARAMETERS)
            loaded = load_parameters(self.file)
            if not isinstance(loaded, SliderCrankParameters):
                raise InputError(
                    f'{self.file} is of a five-bar: for a slider-crank it must begin with mechanism = "slider-crank"'
                )
            parameters, name = loaded, Path(self.file).stem
            title = name
        elif name in SETS:
            case = SETS[name]
            title, parameters = case.source, case.parameters
            start, speed = case.initial.shift_position, case.crank_speed
        else:
            raise unknown_name(name, SETS, f"published case {name!r}")
        values = changes(self.settings, number_or_text, "rod.length='45 in'")
        for key, text in (("guide.offset", self.offset), ("guide.twist", self.twist)):
            if text is not None:
                values[key] = number_or_text(text)
        if self.shift is not None:
            if self.groove is not None:
                raise click.UsageError("--shift holds the crank, --groove moves it: give one of them")
            start = quantity(self.shift, "m", "--shift")
        if self.speed is not None:
            speed = quantity(self.speed, "rad/s", "--speed")
        if values:
            changed = read_parameters(values, parameters)
            assert isinstance(changed, SliderCrankParameters)
            parameters = changed
        self._check_groove(parameters, values)
        if self.file is not None:
            self._note_defaults(parameters, units.length(start), speed if paced else None)
        elif values or self.shift is not None or self.groove is not None:
            name, title = "slider-crank", _title(units, parameters, start, self.groove)
        return MechanismChoice(
            name=name, title=title, parameters=parameters, shift=start, groove=self.groove, speed=speed, units=units
        )

    def _check_groove(self, p: SliderCrankParameters, values: Mapping[str, Any]) -> None:
        """Raise a usage error if an option about a groove has no effect."""
        if self.groove is None:
            for name in values:
                if name.startswith("groove."):
                    raise click.UsageError(f"--set {name} has no effect without --groove shaft or --groove apart")
        elif p.groove_amplitude == 0.0:
            raise click.UsageError(
                f"--groove {self.groove} with groove.amplitude = 0 makes no shift: give --set groove.amplitude='3 in', say, "
                "or hold the crank with --shift"
            )

    def _note_defaults(self, p: SliderCrankParameters, start: str, speed: float | None) -> None:
        """Print the default values of shift, groove and speed that are used because no option gives these quantities."""
        used = []
        if self.shift is None and self.groove is None:
            used.append(f"S1 = {start} (--shift)")
            if p.groove_amplitude != 0.0:
                used.append("no groove (--groove)")
        if speed is not None and self.speed is None:
            used.append(f"a crank speed of {speed / RAD_S_PER_RPM:.6g} rpm (--speed)")
        if used:
            note(f"used by default, as nothing else is given: {', '.join(used)}")


def _title(units: Units, p: SliderCrankParameters, shift: float, groove: str | None) -> str:
    """Return a title for tables and pictures with offset, shift or groove, and twist of a mechanism."""
    moved = f"S1 = {units.length(shift)}"
    if groove is not None:
        moved = f"SS1 = {units.length(p.groove_amplitude)}, alpha = {p.groove_ratio:g}"
    return f"Slider-crank: a4 = {units.length(p.guide_offset)}, {moved}, alpha4 = {degrees(p.guide_twist):.6g} deg"


@dataclass(frozen=True, slots=True)
class Problem:
    """A force problem: the given ``torque`` (N.m) or ``load`` (N), and the number of crank angles."""

    given: Mapping[str, float]
    points: int

    def turn(self, chosen: MechanismChoice, *, at: float | None = None) -> ForceTurn:
        """Solve the force problem at crank angles over a turn, and ``at`` one further crank angle (rad).

        Angles at which the mechanism cannot be assembled are left out, with a note.
        """
        angles = np.linspace(0.0, tau, self.points)
        if at is not None and np.abs(angles - at).min() > 1e-9:
            angles = np.sort(np.append(angles, at))
        turn = sc.force_turn(
            chosen.parameters,
            crank_speed=chosen.speed,
            shift=chosen.force_law,
            angles=angles,
            partial=True,
            **self.given,
        )
        if len(turn.unreachable):
            missing = f"{len(turn.unreachable)} of {len(angles)} crank angles"
            note(f"the rod does not reach the guide at {missing}, which are left out")
        return turn


_MECHANISM_OPTIONS = (
    click.argument("file", required=False, type=click.Path(exists=True, dir_okay=False)),
    click.option("--published", metavar="NAME", help=f"A published case, by default {DEFAULT}: {', '.join(SETS)}."),
    click.option("--offset", metavar="LENGTH", help="Offset a4 between crank axis and guide, such as '10 in'."),
    click.option("--shift", metavar="LENGTH", help="Axial shift S1 of the crank, such as '3.5 in'."),
    click.option("--twist", metavar="ANGLE", help="Twist alpha4 between crank axis and guide, such as '310 deg'."),
    click.option(
        "--groove",
        type=click.Choice(["shaft", "apart"]),
        help="S1 = groove.amplitude sin(groove.ratio theta1), produced by a groove in the crank's shaft, as in the FMU, or by "
        "a device apart from the crank, as in the thesis.",
    ),
    common.set_option("rod.length='45 in' or assembly.branch=-1"),
    click.option(
        "-u",
        "--units",
        type=click.Choice(["SI", "inch"]),
        default="SI",
        help="Units of the output. SI: lengths in millimetres, but in metres in the CSV file of forces, as in that of a run; "
        "inch: inches, pounds force and degrees.",
    ),
)
speed_option = click.option("--speed", metavar="SPEED", help="Crank speed, such as '50 rpm'.")
out_option = common.out_option(help="Folder for the results.")
plot_option = common.plot_option


def add_mechanism_options(command: Command) -> Command:
    """Add to a command the options that choose a mechanism; the command receives a `MechanismChoice` as ``chosen``."""

    @wraps(command)
    @report_errors
    def run(**options: Any) -> Any:
        own = {field.name: options.pop(field.name) for field in fields(_MechanismOptions) if field.name in options}
        paced = "torque" in options and not options.get("two_rotations")
        try:
            return command(chosen=_MechanismOptions(**own).choose(paced=paced), **options)
        except LinkworkError as error:
            raise LinkworkError(Units(own["units"]).convert_error(str(error))) from error

    for option in reversed(_MECHANISM_OPTIONS):
        run = option(run)
    return run


def problem_options(points: int) -> Callable[[Command], Command]:
    """Return a decorator that adds the options of a force problem: --torque, --load, --points and --speed.

    The command receives the first three as one `Problem`, its argument ``problem``. ``points`` is the default of --points.
    """

    def decorate(command: Command) -> Command:
        @wraps(command)
        def run(*, torque: str | None, load: str | None, points: int, **options: Any) -> Any:
            if torque is not None and load is not None:
                raise click.UsageError("give either --torque, to find the slider force, or --load, to find the torque")
            given = {"load": quantity("0" if load is None else load, "N", "--load")}
            if torque is not None:
                given = {"torque": quantity(torque, "N.m", "--torque")}
            return command(problem=Problem(given, points), **options)

        for option in (
            click.option(
                "--points", type=click.IntRange(2), default=points, help="Number of crank angles over the turn."
            ),
            click.option(
                "--load", metavar="FORCE", help="Load on the slider; the crank torque is sought. 0 by default."
            ),
            click.option(
                "--torque",
                metavar="TORQUE",
                help="Torque on the crank, such as '100 lbf*in'; the slider force is sought.",
            ),
            speed_option,
        ):
            run = option(run)
        return run

    return decorate


def note(text: str) -> None:
    """Print a note on standard error."""
    print_error(f"note: {text}")


def angle_text(value: float) -> str:
    return f"{degrees(value):.2f} deg"
