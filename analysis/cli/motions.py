"""`linkwork basins`: find all periodic motions at one speed, and their basins of attraction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from ..display import format_count, format_rounds
from ..mechanisms import find_mechanism
from .common import console, html_option, output_folder, quantity, save_picture, say, show_table, workers_options
from .driven import CaseChoice, add_case_options, swing_unit

if TYPE_CHECKING:
    from ..periodic import Orbits


@click.command()
@add_case_options
@click.option(
    "--turns",
    default=4,
    type=click.IntRange(1, 16),
    help="Greatest number of turns in a period of the motions sought; for gears or several cranks, number of common periods.",
)
@click.option("--points", default=200, type=click.IntRange(2, 4000), help="Number of starts along each axis.")
@click.option(
    "--coordinate",
    metavar="NAME",
    help="Free coordinate to draw; by default the one in which the motions differ most, or the first if a range is given.",
)
@click.option("--position", nargs=2, metavar="FROM TO", help="Range of the coordinate, such as '-5 cm' '5 cm'.")
@click.option("--rate", nargs=2, metavar="FROM TO", help="Range of the rate of this coordinate.")
@workers_options(default=-1)
@html_option
def basins(
    chosen: CaseChoice,
    turns: int,
    points: int,
    coordinate: str | None,
    position: tuple[str, str] | None,
    rate: tuple[str, str] | None,
    jobs: int,
    html: bool,
) -> None:
    """Report all periodic motions of a CASE file or a published set at one speed, and on which of them each start settles.

    A start is an initial state at crank angle 0. The axes of the picture are position and rate of a free coordinate (the slider
    of a five-bar); all other coordinates and rates are those of motion 1. Computed rows are kept, so that after an interruption
    the same command continues.

    \b
    Examples:
      linkwork basins --published rig-1-spring-b --speed '1000 rpm'
      linkwork basins --published rig-1-spring-b --speed '1000 rpm' --position '-10 cm' '10 cm' --rate '-10 m/s' '10 m/s'
    """
    from .. import figures
    from ..periodic import basins as find_basins
    from ..periodic import describe_turns, find_coordinate, join_orbits, search_orbits

    parameters, drive = chosen.case.parameters, chosen.drive()
    start = chosen.start(drive)
    flow = drive.flow(find_mechanism(parameters))
    place = find_coordinate(flow, coordinate)
    units = (flow.components[place][1], flow.components[flow.size // 2 + place][1])
    spans: list[Any] = [
        None if texts is None else tuple(quantity(text, unit, option) for text in texts)
        for texts, unit, option in zip((position, rate), units, ("--position", "--rate"))
    ]
    found = [search_orbits(parameters, drive, turns=number, start=start) for number in range(1, turns + 1)]
    _motions(f"{chosen.case.title}: periodic motions of {describe_turns(flow, turns)}", found, flow.turns)
    picture = find_basins(
        parameters,
        drive,
        turns=turns,
        points=points,
        coordinate=coordinate,
        position=spans[0],
        rate=spans[1],
        found=join_orbits(found),
        n_jobs=jobs,
        progress=console.is_terminal,
    )
    shares = [f"{picture.share(n):.1%} in motion {n + 1}" for n in range(len(picture.motions))]
    say(
        f"of {picture.ends.size} starts end {', '.join(shares)}, {picture.share(-1):.1%} at the limit of assembly, "
        f"{picture.share(-2):.1%} in none of them"
    )
    if picture.fixed:
        varied = " and ".join(label.partition(" [")[0] for label in picture.labels)
        say(
            f"the starts differ in {varied}; {', '.join(picture.fixed)} are those of motion 1, "
            "and a motion that differs from it only there may be out of reach (--coordinate NAME: another plane)"
        )
    stem = output_folder(chosen.folder) / f"{chosen.stem}-basins"
    drawn = figures.picture(picture, title=chosen.case.title)
    chosen.finish([picture.to_csv(f"{stem}.csv"), *save_picture(drawn, stem, html=html)], ())


def _motions(title: str, found: Sequence[Orbits], common: int) -> None:
    """Print a table of all motions found at one speed, and whether there may be further motions.

    ``found[n - 1]`` has the motions whose period is n times ``common`` turns of the crank.
    """
    from ..periodic import Stability

    headings = ("motion", "turns", "amplitude", "stability", "largest multiplier")
    rows, number = [], 0
    for orbit in sorted((orbit for part in found for orbit in part.orbits), key=lambda orbit: orbit.amplitude):
        what, size, unit = swing_unit(orbit)
        word = orbit.verdict().stability
        stays = word is not Stability.UNSTABLE
        number += stays
        amplitude = f"{size * orbit.amplitude:.5g} {unit} of {what}{format_rounds(orbit.rounds, ', ')}"
        shown = str(number) if stays else ""
        rows.append((shown, str(orbit.crank_turns), amplitude, word.value, f"{orbit.largest:.6g}"))
    show_table(title, headings, rows)
    for periods, part in enumerate(found, start=1):
        sure = "two methods found the same motions" if part.agreed else "two methods differ: there may be more motions"
        if part.index != part.index_of_all:
            sure = (
                "there may be another motion, or one at which the links lock: motions come and go in pairs, a stable and an "
                f"unstable one, and these do not pair up (the sum of their indices is {part.index}; over all motions it is "
                f"{part.index_of_all})"
            )
        period = "" if len(found) == 1 else f"of {format_count(periods * common, 'turn')}: "
        say(period + sure)
