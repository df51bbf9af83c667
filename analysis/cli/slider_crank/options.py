"""Options that all commands about the slider-crank share: mechanism, units, and force or torque."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce, wraps
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

        text = re.sub(rf"^parameter ([\w.]+) is {common.NUMBER}:", parameter, text)
        return common.in_units(text, lambda si: (self.name(si), self.factor(si)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismChoice:
    """The mechanism that the options of a command choose.

    ``name`` is the first part of the names of files that are written. ``shift`` (m) is the constant shift S1 of the crank; it
    has no effect if a groove moves the crank. ``groove`` is "shaft" for a groove in the crank shaft, "apart" for a drive apart
    from the crank, None without a groove. ``speed`` is the crank speed (rad/s). For a force problem ``given`` has the torque
    (N.m) or the load (N), and ``points`` is the number of crank angles.
    """

    name: str
    title: str
    parameters: SliderCrankParameters
    shift: float
    groove: str | None
    speed: float
    units: Units
    given: Mapping[str, float] = field(default_factory=dict)
    points: int = 0

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

    def turn(self, *, at: float | None = None) -> ForceTurn:
        """Solve the force problem at crank angles over a turn, and at one further crank angle ``at`` (rad).

        Angles at which the mechanism cannot be assembled are left out, with a note.
        """
        angles = np.linspace(0.0, tau, self.points)
        if at is not None and np.abs(angles - at).min() > 1e-9:
            angles = np.sort(np.append(angles, at))
        turn = sc.force_turn(
            self.parameters, crank_speed=self.speed, shift=self.force_law, angles=angles, partial=True, **self.given
        )
        if len(turn.unreachable):
            missing = f"{len(turn.unreachable)} of {len(angles)} crank angles"
            common.note(f"the rod does not reach the guide at {missing}, which are left out")
        return turn


def _choose(
    units: Units,
    *,
    file: str | None,
    published: str | None,
    offset: str | None,
    shift: str | None,
    twist: str | None,
    groove: str | None,
    settings: Sequence[str],
    speed: str | None,
    paced: bool,
) -> MechanismChoice:
    """Return the mechanism that the options choose; ``paced`` says whether the crank speed has an effect.

    Raises LinkworkError if a file, a name or a value is wrong.
    """
    from ...files import unknown_name
    from ...run import load_parameters, read_parameters

    name = published or DEFAULT
    if file is not None:
        if published is not None:
            raise click.UsageError("give either a file of parameters or --published NAME")
        common.check_kind(file, common.PARAMETERS)
        parameters = load_parameters(file)
        if not isinstance(parameters, SliderCrankParameters):
            raise InputError(
                f'{file} is of a five-bar: for a slider-crank it must begin with mechanism = "slider-crank"'
            )
        name = title = Path(file).stem
        start, pace = 0.0, SETS[DEFAULT].crank_speed
    elif name in SETS:
        case = SETS[name]
        title, parameters = case.source, case.parameters
        start, pace = case.initial.shift_position, case.crank_speed
    else:
        raise unknown_name(name, SETS, f"published case {name!r}")
    values = common.changes(settings, "rod.length='45 in'")
    for key, text in (("guide.offset", offset), ("guide.twist", twist)):
        if text is not None:
            values[key] = common.typed_value(text)
    if shift is not None:
        if groove is not None:
            raise click.UsageError("--shift holds the crank, --groove moves it: give one of them")
        start = common.quantity(shift, "m", "--shift")
    if speed is not None:
        pace = common.quantity(speed, "rad/s", "--speed")
    if values:
        parameters = read_parameters(values, parameters)
        assert isinstance(parameters, SliderCrankParameters)
    for key in values if groove is None else ():
        if key.startswith("groove."):
            raise click.UsageError(f"--set {key} has no effect without --groove shaft or --groove apart")
    if groove is not None and parameters.groove_amplitude == 0.0:
        raise click.UsageError(
            f"--groove {groove} with groove.amplitude = 0 makes no shift: give --set groove.amplitude='3 in', say, "
            "or hold the crank with --shift"
        )
    if file is not None:
        held = shift is None and groove is None
        used = [f"S1 = {units.length(start)} (--shift)"] if held else []
        used += ["no groove (--groove)"] if held and parameters.groove_amplitude != 0.0 else []
        used += [f"a crank speed of {pace / RAD_S_PER_RPM:.6g} rpm (--speed)"] if paced and speed is None else []
        if used:
            common.note(f"used by default, as nothing else is given: {', '.join(used)}")
    elif values or shift is not None or groove is not None:
        name, title = "slider-crank", _title(units, parameters, start, groove)
    return MechanismChoice(
        name=name, title=title, parameters=parameters, shift=start, groove=groove, speed=pace, units=units
    )


def _title(units: Units, p: SliderCrankParameters, shift: float, groove: str | None) -> str:
    """Return a title for tables and pictures with offset, shift or groove, and twist of a mechanism."""
    moved = f"S1 = {units.length(shift)}"
    if groove is not None:
        moved = f"SS1 = {units.length(p.groove_amplitude)}, alpha = {p.groove_ratio:g}"
    return f"Slider-crank: a4 = {units.length(p.guide_offset)}, {moved}, alpha4 = {degrees(p.guide_twist):.6g} deg"


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
    @common.report_errors
    def run(**options: Any) -> Any:
        names = ("file", "published", "offset", "shift", "twist", "groove", "settings", "speed")
        own, units = {name: options.pop(name, None) for name in names}, Units(options.pop("units"))
        forces = "torque" in options
        try:
            given = _given(options.pop("torque"), options.pop("load")) if forces else {}
            chosen = _choose(units, **own, paced=forces and not options.get("two_rotations"))
            return command(chosen=replace(chosen, given=given, points=options.pop("points", 0)), **options)
        except LinkworkError as error:
            raise LinkworkError(units.convert_error(str(error))) from error

    for option in reversed(_MECHANISM_OPTIONS):
        run = option(run)
    return run


def problem_options(points: int) -> Callable[[Command], Command]:
    """Return a decorator that adds the options of a force problem: --torque, --load, --points and --speed.

    `add_mechanism_options`, which must stand above this decorator, puts the values into the `MechanismChoice`. ``points`` is
    the default of --points.
    """
    options = (
        speed_option,
        click.option(
            "--torque", metavar="TORQUE", help="Torque on the crank, such as '100 lbf*in'; the slider force is sought."
        ),
        click.option("--load", metavar="FORCE", help="Load on the slider; the crank torque is sought. 0 by default."),
        click.option("--points", type=click.IntRange(2), default=points, help="Number of crank angles over the turn."),
    )
    return lambda command: reduce(lambda done, option: option(done), reversed(options), command)


def _given(torque: str | None, load: str | None) -> dict[str, float]:
    """Return the torque (N.m) or the load (N) that the options of a force problem give."""
    if torque is not None and load is not None:
        raise click.UsageError("give either --torque, to find the slider force, or --load, to find the torque")
    if torque is not None:
        return {"torque": common.quantity(torque, "N.m", "--torque")}
    return {"load": common.quantity("0" if load is None else load, "N", "--load")}


def angle_text(value: float) -> str:
    return f"{degrees(value):.2f} deg"
