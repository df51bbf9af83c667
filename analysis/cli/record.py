"""`linkwork decrement`: find damping and natural frequency from the record of a decaying vibration."""

from __future__ import annotations

from contextlib import suppress
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

import click

from linkwork.errors import InputError, ParameterError

from ..units import RAD_S_PER_RPM
from . import common


@click.command()
@click.argument("record", type=click.Path(exists=True, dir_okay=False))
@click.option("--time", "time", metavar="NAME", help="Column of the times; by default the first.")
@click.option("--position", metavar="NAME", help="Column of the positions; by default the second.")
@click.option("--time-unit", help="Unit of the times; by default the unit in the column's heading, or s.")
@click.option(
    "--unit",
    help="Unit of the positions, a length or an angle; by default the unit in the column's heading, or m. It affects only "
    "the force of friction.",
)
@click.option("--from", "first", metavar="TIME", help="Ignore samples before this time, such as '0.2 s': the impulse.")
@click.option("--to", "last", metavar="TIME", help="Ignore samples after this time.")
@click.option(
    "--mass",
    metavar="MASS",
    help="Moving mass, such as '600 g', or for an angle the moment of inertia, such as '2e-3 kg*m^2': gives the damping "
    "coefficient and the stiffness.",
)
@click.option("--friction", is_flag=True, help="Fit dry friction in addition to the damper.")
@click.option("--least-swing", type=float, help="Smallest swing that is used, relative to the range; 0.1 by default.")
@common.plot_option
@common.out_option()
@common.report_errors
def decrement(record: str, time: str | None, position: str | None, out: str, plot: bool, **options: Any) -> None:
    """Find damping and natural frequency from the decaying record of a freedom on its spring, by the logarithmic decrement.

    RECORD is a CSV file of times and positions after an impulse or a release. A decaying vibration with an offset is fitted to
    the turning points of the record by least squares; +- is the standard error. With dry friction the decrement grows from
    cycle to cycle. If the motion is damped so strongly that it has fewer than five turning points, the whole curve is fitted.

    \b
    Examples:
      linkwork decrement record.csv --mass '600 g'
      linkwork decrement record.csv --time 't [s]' --position 'u [mm]' --unit mm --from '0.1 s' --friction
    """
    from ..files import note_assumed_units, read_record, write_csv
    from ..numerics.decay import LEAST_SWING, fit_decay

    (heading, own), (t, x) = read_record(record, (time, position))
    _, _, second = _column_unit(heading, options["time_unit"], "--time-unit", ("s",))
    unit, kind, size = _column_unit(own, options["unit"], "--unit", ("m", "rad"))
    note_assumed_units(Path(record), (heading or options["time_unit"], own or options["unit"]), ("s", "m"))
    t = t * second
    first = common.quantity(options["first"], "s", "--from") if options["first"] else -inf
    last = common.quantity(options["last"], "s", "--to") if options["last"] else inf
    kept = ~((t < first) | (t > last))
    least = LEAST_SWING if options["least_swing"] is None else options["least_swing"]
    decay = fit_decay(t[kept], x[kept], friction=options["friction"], least_swing=least)
    si = _UNITS[kind or "m"]
    moving = None if options["mass"] is None else common.quantity(options["mass"], si[0], "--mass")
    if moving is not None and moving <= 0.0:
        raise click.UsageError(f"--mass {options['mass']}: it must be above zero")
    points = "samples" if decay.whole else "turning points"
    common.show_table(
        f"{Path(record).name}: {len(decay.time)} {points} from {decay.time[0]:.6g} to {decay.time[-1]:.6g} s",
        ("", "value", "+-", "unit"),
        [
            (name, f"{value:.6g}", f"{error:.2g}", its_unit)
            for name, value, error, its_unit in _result_rows(decay, moving, unit, size, si, options["friction"])
        ],
    )
    common.say(f"the fit is within {decay.residual:.2g} of the first amplitude (root mean square)")
    if decay.whole:
        common.note("too few turning points: the whole curve is fitted, in which dry friction would count as damping")
    elif not options["friction"]:
        with suppress(InputError):
            dry = fit_decay(t[kept], x[kept], friction=True, least_swing=least)
            # more than noise and the approximation of the motion by waves can cause
            if dry.friction > 5.0 * dry.friction_error and dry.residual < 0.5 * decay.residual:
                common.note(
                    "the decrement grows from cycle to cycle, as with dry friction: with --friction the damping ratio is "
                    f"{dry.damping_ratio:.3g}, and the fit within {dry.residual:.2g}"
                )
    stem = common.output_folder(out) / f"{Path(record).stem}-decrement"
    columns = {"time [s]": decay.time, f"position [{unit}]": decay.position, f"fit [{unit}]": decay.fitted}
    drawn = common.save_plot(
        plot, decay, f"{stem}.png", (t[kept], x[kept]), unit=unit, title=f"Free decay, {Path(record).stem}"
    )
    common.print_paths([write_csv(f"{stem}.csv", columns), *drawn])


#: SI units of mass or moment of inertia, damping coefficient, stiffness and friction, by the SI unit of the position.
_UNITS = {"m": ("kg", "N.s/m", "N/m", "N"), "rad": ("kg.m2", "N.m.s/rad", "N.m/rad", "N.m")}


def _column_unit(own: str, given: str | None, option: str, kinds: tuple[str, ...]) -> tuple[str, str, float]:
    """Return the unit of a column, the SI unit among ``kinds`` that has its dimension, and the factor to this SI unit.

    ``own`` is the unit in the column's heading. If it fits none of ``kinds``, as V of a strain gauge, the SI unit is "" and the
    factor NaN.
    """

    def convert(unit: str) -> tuple[str, str, float]:
        errors = []
        for kind in kinds:
            try:
                return unit, kind, common.quantity(f"1 {unit}", kind, option)
            except ParameterError as error:
                errors.append(error)
        raise errors[0]

    chosen = convert(given) if given else (kinds[0], kinds[0], 1.0)
    if not own:
        return chosen
    try:
        found = convert(own)
    except ParameterError:
        if given:
            return chosen
        if len(kinds) == 1:
            raise InputError(
                f"the times are in {own!r} by their heading, which is no unit of time: give {option}"
            ) from None
        return own, "", nan
    if given and found[1:] != chosen[1:]:
        raise click.UsageError(f"{option} {given}: the column's heading says {own}")
    return found


def _result_rows(
    decay: Any, moving: float | None, unit: str, size: float, si: tuple[str, ...], friction: bool
) -> list[tuple[str, float, float, str]]:
    """Return the results of a fitted decay as rows (name, value, standard error, unit).

    If the mass or moment of inertia ``moving`` is given, there are rows of damping and stiffness, in the units ``si``. With
    ``friction`` there is a row of dry friction over the stiffness. There is also a row of dry friction itself if ``moving`` is
    given and ``size``, the size of ``unit`` in SI, is finite.
    """
    natural, error = decay.natural_frequency, decay.natural_frequency_error
    rows = [
        ("logarithmic decrement", decay.decrement, decay.decrement_error, ""),
        ("damping ratio", decay.damping_ratio, decay.damping_ratio_error, ""),
        ("natural frequency", natural, error, "rad/s"),
        ("", natural / RAD_S_PER_RPM, error / RAD_S_PER_RPM, "rpm"),
    ]
    if friction:
        rows.append(("dry friction over the stiffness", decay.friction, decay.friction_error, unit))
    if moving is not None:
        stiffness = decay.stiffness(moving)
        rows += [("damping coefficient", *decay.damping(moving), si[1]), ("stiffness", *stiffness, si[2])]
        if friction and isfinite(size):
            newton = stiffness[0] * size
            rows.append(("dry friction", newton * decay.friction, newton * decay.friction_error, si[3]))
    return rows
