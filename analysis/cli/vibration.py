"""Commands about periodic motions: where the slider resonates, and where it is unstable."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.table import Table

from linkwork.five_bar.published import CM_PER_METRE, RAD_S_PER_RPM, SETS

from .common import ENDED_EARLY, chosen_case, console, errors, handled, number_or_text, prepare_solver

#: Range of speeds where none is given, relative to the natural frequency.
_RANGE = (0.15, 1.5)


def _quantity(text: str, unit: str, name: str) -> float:
    from .. import io

    return io.quantity(number_or_text(text), unit, name)


def _stem(case: str | None, published: str | None) -> str:
    return Path(case).stem if case else str(published)


@click.command()
@click.argument("case", required=False, type=click.Path(exists=True, dir_okay=False))
@click.option("--published", metavar="NAME", help=f"A published set instead: {', '.join(SETS)}.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Change a value of the mechanism.")
@click.option("--vary", default="drive.speed", show_default=True, metavar="NAME", help="What varies, by its FMI name.")
@click.option(
    "--from", "low", metavar="VALUE", help="Beginning of the range, such as '100 rpm'; bare numbers are in SI."
)
@click.option("--to", "high", metavar="VALUE", help="End of the range.")
@click.option("--speed", metavar="SPEED", help="Crank speed where something else varies; the case's own by default.")
@click.option("--doubled/--no-doubled", default=True, show_default=True, help="Follow motions of twice the period.")
@click.option("--out", default="out", show_default=True, type=click.Path(file_okay=False), help="Folder.")
@click.option("--plot/--no-plot", default=True, show_default=True, help="Whether to write a plot.")
@handled
def resonance(
    case: str | None,
    published: str | None,
    settings: Sequence[str],
    vary: str,
    low: str | None,
    high: str | None,
    speed: str | None,
    doubled: bool,
    out: str,
    plot: bool,
) -> None:
    """Follow the periodic motion of a CASE file's or a published set's mechanism over the speed, or another parameter.

    Writes amplitude, harmonics, crank torque and pin forces along the curve, and tells natural frequency, maxima, folds,
    period doublings, and the classical approximations beside the true motion.

    \b
    Examples:
      linkwork resonance --published rig-2-spring-c
      linkwork resonance --published rig-1-spring-b --from '100 rpm' --to '1300 rpm'
      linkwork resonance --published table-3.1 --vary slider.stiffness --from '1e5 dyn/cm' --to '2e6 dyn/cm'
    """
    from .. import io
    from ..branches import Family
    from ..orbits import Drive
    from ..resonance import approximations, frequency_response, natural_frequency

    chosen = chosen_case(case, published, settings)
    parameters = chosen.parameters
    over_speed = vary == "drive.speed"
    natural = natural_frequency(parameters) if parameters.slider_stiffness > 0.0 else None
    running = chosen.initial.crank_speed if speed is None else _quantity(speed, "rad/s", "--speed")
    unit = Family(parameters=parameters, drive=Drive(speed=max(running, 1.0)), vary=vary).unit
    if over_speed and natural is not None:
        ends = [factor * natural for factor in _RANGE]
    elif low is None or high is None:
        raise click.UsageError(f"--from and --to are needed for {vary}: there is no natural frequency to begin with")
    else:
        ends = [0.0, 0.0]
    if low is not None:
        ends[0] = _quantity(low, unit, "--from")
    if high is not None:
        ends[1] = _quantity(high, unit, "--to")
    prepare_solver()
    response = frequency_response(
        parameters,
        *ends,
        drive=None if over_speed else Drive(speed=running),
        vary=vary,
        doubled=doubled,
        progress=console.is_terminal,
    )
    factor, shown_unit = (1.0 / RAD_S_PER_RPM, "rpm") if over_speed else (1.0, unit)
    if over_speed and natural is not None:
        console.print(
            f"natural frequency (mean effective mass): {natural / RAD_S_PER_RPM:.2f} rpm, {natural:.5g} rad/s",
            highlight=False,
        )
    _branches(chosen.title, response, factor, shown_unit)
    stem = Path(out) / f"{_stem(case, published)}-resonance"
    written = [response.to_csv(f"{stem}.csv")]
    table = approximations(response) if over_speed else None
    _extrema(response, factor, shown_unit, table)
    if table is not None:
        written.append(io.write_csv(f"{stem}-approximations.csv", table.columns()))
    if plot:
        figure = response.plot(title=chosen.title, rpm=over_speed, beside=table)
        written.append(io.save_figure(figure, f"{stem}.png"))
    for path in written:
        console.print(f"wrote {path}", highlight=False, soft_wrap=True)
    for problem in response.problems:
        errors.print(f"note: {problem}", style="yellow", markup=False, highlight=False, soft_wrap=True)
    if response.problems:
        sys.exit(ENDED_EARLY)


def _branches(title: str, response: Any, factor: float, unit: str) -> None:
    grid = Table(title=f"{title}: periodic motions, {response.family.name} in {unit}", title_justify="left")
    for heading in ("branch", "turns", "points", "from", "to", "stable", "what happens on it"):
        grid.add_column(heading, justify="left" if heading.startswith("what") else "right")
    for number, branch in enumerate(response.branches, start=1):
        stable = np.mean([s.value == "stable" for s in branch.stability()])
        events = [f"{s.kind.value} at {factor * s.parameter:.6g}" for s in branch.special]
        grid.add_row(
            str(number),
            str(branch.turns),
            str(len(branch)),
            f"{factor * branch.parameter[0]:.6g}",
            f"{factor * branch.parameter[-1]:.6g}",
            f"{stable:.0%}",
            "; ".join(events),
        )
    console.print(grid)


def _extrema(response: Any, factor: float, unit: str, table: Any) -> None:
    grid = Table(title="where the amplitude of the slider is largest and least", title_justify="left")
    names = () if table is None else tuple(table.amplitudes)
    for heading in ("", f"at [{unit}]", "amplitude [cm]", "motion", *(f"{name} [cm]" for name in names)):
        grid.add_column(heading, justify="left" if heading in ("", "motion") else "right")
    entries = [("maximum", e) for e in response.maxima()] + [("minimum", e) for e in response.minima()]
    for word, extremum in sorted(entries, key=lambda entry: entry[1].parameter):
        others = [] if table is None else [f"{CM_PER_METRE * v:.4f}" for v in table.at(extremum.parameter).values()]
        grid.add_row(
            word,
            f"{factor * extremum.parameter:.2f}",
            f"{CM_PER_METRE * extremum.amplitude:.4f}",
            extremum.stability.value,
            *others,
        )
    console.print(grid)
