"""Options and functions that all commands about the periodic motions of a case share."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import click

from linkwork.errors import InputError

from ..mechanisms import PUBLISHED, find_mechanism
from ..units import display_scale
from . import common


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseChoice:
    """The case of a command, with the options about its drive.

    ``stem`` is the first part of the names of the files that are written, ``speed`` and ``guess_speed`` are the texts of the
    options or None, ``folder`` is the folder of the results.
    """

    case: Any
    stem: str
    speed: str | None
    guess_speed: str | None
    folder: Path

    def drive(self, speed: str | None = None) -> Any:
        """Return the drive of the case with its constant forces.

        If a speed is given as text, here or by --speed, it replaces the drive of the crank.
        """
        from ..periodic import NothingFreeError, VaryingInputError, steady_drive

        speed = speed or self.speed
        value = None if speed is None else common.quantity(speed, "rad/s", "--speed")
        if value is not None and self.case.inputs.torque is not None:
            common.note("the speed is prescribed; the case's torque is left out")
        try:
            drive = steady_drive(self.case.parameters, self.case.inputs, self.case.initial, speed=value)
            # raises an error if no degree of freedom is free
            drive.flow(find_mechanism(self.case.parameters))
            return drive
        except NothingFreeError as error:
            force = error.force
            one = force and f"; --set {force}=0 frees one freedom, --set {force}=VALUE sets a force on it"
            raise InputError(
                f"{self.case.title}: all freedoms are commanded, so that nothing can vibrate: linkwork run computes the "
                f"torques and forces of the drives{one}"
            ) from None
        except InputError as error:
            torque = isinstance(error, VaryingInputError) and error.channel == "torque"
            hint = "; --speed prescribes the speed instead" if torque else ""
            raise InputError(f"{self.case.title}: {error}{hint}") from None

    def start(self, drive: Any) -> list[float]:
        """Return a guess of the start of the orbit: the initial coordinates of the case, at rest.

        If the crank is driven by a torque, the guess includes a crank speed.
        """
        from ..periodic import rest_guess

        speed = None if self.guess_speed is None else common.quantity(self.guess_speed, "rad/s", "--guess-speed")
        if drive.speed_drive and speed is not None:
            raise click.UsageError("--guess-speed is for a case driven by a torque: here the speed is prescribed")
        other = ", or --guess-speed '300 rpm'"
        return rest_guess(self.case.parameters, drive, self.case.initial, speed, other=other)

    def has_crank_speed(self, drive: Any) -> bool:
        """Return whether a torque drives the crank and the speed at the start is given, by --guess-speed or in the case."""
        mechanism = find_mechanism(self.case.parameters)
        flow = drive.flow(mechanism)
        return bool(flow.torque and (self.guess_speed or mechanism.state(self.case.initial)[flow.places[-1]] > 0.0))

    def finish(self, written: Sequence[Path], problems: Sequence[str], *, interrupted: bool = False) -> None:
        """Print written files and problems; exit with an error code if there are problems or the command was interrupted."""
        common.print_paths(written)
        for problem in problems:
            common.note(problem)
        if interrupted or problems:
            sys.exit(common.INTERRUPTED if interrupted else common.ENDED_EARLY)


def add_case_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add to a command the options that select a case and its drive; the command receives them as one `CaseChoice`."""

    @common.report_errors
    @wraps(command)
    def run_with_case(
        case: str | None,
        published: str | None,
        settings: Sequence[str],
        speed: str | None,
        guess_speed: str | None,
        out: str,
        **options: Any,
    ) -> None:
        chosen = common.chosen_case(case, published, settings, runs=False)
        stem = Path(case).stem if case else str(published)
        command(CaseChoice(case=chosen, stem=stem, speed=speed, guess_speed=guess_speed, folder=Path(out)), **options)

    for option in (
        common.out_option(help="Folder for the results."),
        click.option("--guess-speed", metavar="SPEED", help="Guess of the crank speed, for a case driven by a torque."),
        click.option("--speed", metavar="SPEED", help="Prescribe this crank speed instead of the case's drive."),
        common.case_options(PUBLISHED),
    ):
        run_with_case = option(run_with_case)
    return run_with_case


def swing_unit(orbit: Any, coordinate: int = 0) -> tuple[str, float, str]:
    """Return the name of a free coordinate, the factor from SI to the unit in which its amplitude is printed, and this unit."""
    what, si = orbit.swings[coordinate]
    unit, factor = display_scale(si)
    return what, factor, unit
