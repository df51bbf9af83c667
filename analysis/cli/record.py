"""`linkwork decrement`: find damping and natural frequency from the record of a decaying vibration."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from ..units import RAD_S_PER_RPM
from .common import console, out_option, output_folder, plot_option, print_paths, quantity, report_errors, show_table


@click.command()
@click.argument("record", type=click.Path(exists=True, dir_okay=False))
@click.option("--time", "time", metavar="NAME", help="Column of the times; by default the first.")
@click.option("--position", metavar="NAME", help="Column of the positions; by default the second.")
@click.option("--time-unit", default="s", help="Unit of the times.")
@click.option("--unit", default="m", help="Unit of the positions, needed for the force of friction.")
@click.option("--from", "first", metavar="TIME", help="Ignore samples before this time, such as '0.2 s': the impulse.")
@click.option("--to", "last", metavar="TIME", help="Ignore samples after this time.")
@click.option(
    "--mass", metavar="MASS", help="Moving mass, such as '600 g': gives the damping coefficient and the stiffness."
)
@click.option("--friction", is_flag=True, help="Fit dry friction in addition to the damper.")
@click.option("--least-swing", type=float, help="Smallest swing that is used, relative to the range; 0.1 by default.")
@plot_option
@out_option()
@report_errors
def decrement(
    record: str, time: str | None, position: str | None, mass: str | None, out: str, plot: bool, **options: Any
) -> None:
    """Find damping and natural frequency from the decaying record of a freedom on its spring, by the logarithmic decrement.

    RECORD is a CSV file of times and positions after an impulse or a release. A decaying vibration with an offset is fitted to
    the turning points of the record by least squares; +- is the standard error. With dry friction the decrement grows from
    cycle to cycle.

    \b
    Examples:
      linkwork decrement record.csv --mass '600 g'
      linkwork decrement record.csv --time 't [s]' --position 'u [mm]' --unit mm --from '0.1 s' --friction
    """
    from .. import figures
    from ..files import read_columns, save_figure, write_csv
    from ..numerics.decay import LEAST_SWING, fit_decay

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
            for name, value, error, unit in _result_rows(
                decay, kg, metre if options["friction"] else None, options["unit"]
            )
        ],
        words=("", "unit"),
    )
    console.print(f"the fit is within {decay.residual:.2g} of the first amplitude (root mean square)", highlight=False)
    stem = output_folder(out) / f"{Path(record).stem}-decrement"
    columns = {
        "time [s]": decay.time,
        f"position [{options['unit']}]": decay.position,
        f"fit [{options['unit']}]": decay.fitted,
    }
    written = [write_csv(f"{stem}.csv", columns)]
    if plot:
        drawn = figures.plot(decay, (t[kept], x[kept]), unit=options["unit"], title=Path(record).name)
        written.append(save_figure(drawn, f"{stem}.png"))
    print_paths(written)


def _result_rows(decay: Any, kg: float | None, metre: float | None, unit: str) -> list[tuple[str, float, float, str]]:
    """Return the results of a fitted decay as rows (name, value, standard error, unit).

    With a mass ``kg`` there are rows of damping and stiffness. With ``metre``, the length of ``unit`` in m, there are rows of
    dry friction.
    """
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
