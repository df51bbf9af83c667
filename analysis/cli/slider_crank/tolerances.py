"""`linkwork slider-crank tolerances`: report the effect of manufacturing tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, tau
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from linkwork.errors import InputError

from ... import slider_crank as sc
from ..common import console, note, output_folder, print_paths, quantity, save_plot, show_table, workers_options
from . import options

if TYPE_CHECKING:
    from ...slider_crank import ForceTurn, MonteCarlo, Sensitivities, Tolerance

#: Quantities that have a tolerance by default, and the default half widths by unit.
_TOLERANCES = ("crank.length", "rod.length", "guide.offset", "shift.position", "guide.twist")
_WIDTHS = {"m": "0.25 mm", "rad": "0.1 deg"}


@click.command(short_help="Report the effect of manufacturing tolerances.")
@options.add_mechanism_options
@options.problem_options(points=73)
@click.option(
    "--tolerance",
    "widths",
    multiple=True,
    metavar="NAME=HALF_WIDTH",
    help="A quantity and the half width of its error, such as guide.offset='0.5 mm' or guide.twist='0.2 deg'; can be given "
    "several times. By default 0.25 mm for the lengths and 0.1 deg for the twist.",
)
@click.option(
    "--distribution",
    type=click.Choice(["normal", "uniform", "triangular"]),
    default="normal",
    help="Distribution of the errors; for a normal one the half width is three standard deviations.",
)
@click.option(
    "--quantity",
    "quantities",
    multiple=True,
    default=("slider.position",),
    metavar="NAME",
    help="An output of the FMU, such as crank_pin.fz, or slider.load; can be given several times.",
)
@click.option("--angle", default="30 deg", metavar="ANGLE", help="Crank angle of the histogram.")
@click.option("--samples", type=click.IntRange(2), default=100_000, help="Number of Monte Carlo samples.")
@click.option("--seed", type=click.IntRange(0), default=0, help="The same seed gives the same samples.")
@workers_options()
@options.out_option
@options.plot_option
def tolerances(
    chosen: options.MechanismChoice,
    widths: Sequence[str],
    distribution: str,
    quantities: Sequence[str],
    angle: str,
    out: str,
    plot: bool,
    samples: int,
    seed: int,
    jobs: int | None,
) -> None:
    """Report the effect of manufacturing tolerances: exact sensitivities, a linear estimate, and a Monte Carlo simulation.

    \b
    Examples:
      linkwork slider-crank tolerances
      linkwork slider-crank tolerances --tolerance guide.offset='0.5 mm' --tolerance guide.twist='0.2 deg'
      linkwork slider-crank tolerances --quantity slider.position --quantity crank_pin.fz --load '-20 lbf' --seed 7
    """
    from ...files import write_csv

    at = _reduce_to_turn(quantity(angle, "rad", "--angle"), chosen)
    units, quantities = chosen.units, tuple(dict.fromkeys(quantities))
    defaults = [f"{name}={_WIDTHS[sc.ERRORS[name]]}" for name in _TOLERANCES]
    allowed = [_tolerance(text, distribution) for text in widths or defaults]
    turn = chosen.turn(at=at)
    exact = sc.sensitivities(turn, tuple(t.name for t in allowed), quantities)
    for name in quantities:
        if np.ma.getmaskarray(exact.values[name]).all():
            why = sc.NO_LEVER if turn.without_lever else "all the crank angles are dead centres"
            raise InputError(f"{name} is not determined: {why}; give --load in place of --torque")
    place = int(np.argmin(np.abs(turn.angle - at)))
    here = f"{_degrees(turn, place):.6g} deg"
    if abs(float(turn.angle[place]) - at) > 1e-9:
        note(
            f"the mechanism cannot be assembled at {degrees(at):.6g} deg: the nearest sampled angle, {here}, is used instead"
        )
    rows, slopes = _sensitivity_table(exact, allowed, place, units)
    headings = ("quantity", "to", "unit", f"at {here}", "greatest", "at [deg]")
    show_table(f"{chosen.title}: sensitivities", headings, rows)
    with console.status(f"{samples} samples at {len(turn)} crank angles"):
        found = sc.monte_carlo(turn, allowed, quantities=quantities, samples=samples, seed=seed, n_jobs=jobs)
    stem = str(output_folder(out) / chosen.name)
    files = [write_csv(f"{stem}-sensitivities.csv", slopes)]
    files.append(write_csv(f"{stem}-tolerances.csv", _spread_columns(found, units)))
    _show_spread(found, place, f"{chosen.title}: spread at {here}, {samples} samples", units)
    for message in found.notes(units.system):
        note(message)
    for name in quantities:
        title = f"{chosen.title}: {name.replace('.', ' ')}"
        files += save_plot(plot, found, f"{stem}-tolerances-{name}.png", name, at, units=units.system, title=title)
    print_paths(files)


def _degrees(turn: ForceTurn, i: int) -> float:
    return degrees(float(turn.angle[i]))


def _reduce_to_turn(angle: float, chosen: options.MechanismChoice) -> float:
    """Return a crank angle reduced to the range from 0 to 2 pi (rad).

    Raises InputError if the angle is outside of this range and the shift of the crank differs from turn to turn.
    """
    if 0.0 <= angle <= tau:
        return angle
    if chosen.groove is not None and not chosen.parameters.groove_ratio.is_integer():
        raise InputError(
            f"--angle is {degrees(angle):.6g} deg: with groove.ratio = {chosen.parameters.groove_ratio:g} the shift differs "
            "from turn to turn; give an angle from 0 to 360 deg"
        )
    return float(angle % tau)


def _tolerance(text: str, distribution: str) -> Tolerance:
    """Return the tolerance given by a text NAME=HALF_WIDTH."""
    from ...files import unknown_name

    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        raise click.UsageError(f"--tolerance {text!r}: it must be NAME=HALF_WIDTH, such as guide.offset='0.5 mm'")
    if name not in sc.ERRORS:
        raise unknown_name(name, sc.ERRORS, f"tolerance of {name!r}")
    width = quantity(value, sc.ERRORS[name], name)
    return sc.Tolerance(name, half_width=width, distribution=distribution)


def _sensitivity_table(
    exact: Sensitivities, allowed: Sequence[Tolerance], place: int, units: options.Units
) -> tuple[Sequence[Sequence[str]], dict[str, Any]]:
    """Return the rows of the printed table of sensitivities, and the columns of the CSV file by name with unit.

    ``place`` is the index of the crank angle for which the printed table has values.
    """
    turn, rows = exact.turn, []
    columns: dict[str, Any] = {"crank angle [deg]": np.degrees(turn.angle)}
    for name in exact.derivatives:
        si = sc.QUANTITIES[name]
        clear = turn.clear(poles=si in ("N", "N.m"))
        effect = max(float(np.ma.abs(exact.derivative(name, t.name)).max()) * t.half_width for t in allowed)
        for t in allowed:
            below = sc.ERRORS[t.name]
            unit, scale = _unit_quotient(units.name(si), units.name(below)), units.factor(si) / units.factor(below)
            values = exact.derivative(name, t.name) * scale
            columns[f"d {name} / d {t.name} [{unit}]"] = values.filled(np.nan)
            greatest = np.where(clear, np.ma.abs(values).filled(-1.0), -1.0)
            top = int(np.argmax(greatest))
            # a value that is only a rounding error compared with the greatest effect of any tolerance is printed as zero
            tiny = 1e-12 * effect / t.half_width * scale
            here, most = (_number(values[i] if np.ma.abs(values[i]) > tiny else values[i] * 0.0) for i in (place, top))
            # zero has no angle; there may be no angle that is far enough from poles and limits
            at = f"{_degrees(turn, top):.1f}" if greatest[top] > tiny else ""
            ends = (most, at) if greatest[top] >= 0.0 else ("none", "")
            rows.append((name, t.name, unit, here, *ends))
    return rows, columns


def _number(value: Any, digits: int = 6) -> str:
    return "none" if np.ma.is_masked(value) else f"{value:.{digits}g}"


def _unit_quotient(above: str, below: str) -> str:
    """Return the quotient of two units as text."""
    return f"{above}/({below})" if "." in below or "/" in below else f"{above}/{below}"


def _spread_columns(found: MonteCarlo, units: options.Units) -> dict[str, Any]:
    """Return the results of a Monte Carlo simulation, over crank angles of a turn, as columns by name with unit."""
    columns: dict[str, Any] = {"crank angle [deg]": np.degrees(found.turn.angle)}
    for name, spread in found.spreads.items():
        si, linear = sc.QUANTITIES[name], found.estimates[name]
        parts = {
            "nominal": linear.nominal,
            "linear standard deviation": linear.deviation,
            "linear worst case": linear.worst,
            "standard deviation": spread.deviation,
            "mean": spread.mean,
        }
        parts |= {f"{share:.4g} %": row for share, row in zip(sc.PERCENTILES, spread.percentiles)}
        columns |= {
            f"{name} {what} [{units.name(si)}]": (x * units.factor(si)).filled(np.nan) for what, x in parts.items()
        }
    return columns | {"not assembled": found.not_assembled, "at a dead centre": found.undetermined}


def _show_spread(found: MonteCarlo, place: int, title: str, units: options.Units) -> None:
    """Print the linear estimate and the statistics of the samples at one crank angle; "±" is two standard errors.

    ``place`` is the index of the crank angle.
    """
    rows = []
    for name, spread in found.spreads.items():
        si, linear = sc.QUANTITIES[name], found.estimates[name]
        values = (
            (linear.nominal, 6),
            (linear.deviation, 3),
            (linear.second_deviation, 3),
            (spread.deviation, 3),
            (linear.worst, 3),
            (spread.mean - linear.nominal, 2),
            (2.0 * found.standard_error(name), 1),
        )
        *numbers, off, error = (_number(x[place] * units.factor(si), digits) for x, digits in values)
        rows.append((name, units.name(si), *numbers, f"{off} ± {error}"))
    headings = "quantity", "unit", "nominal", "sd, linear", "sd, 2nd order", "sd, samples", "worst, linear", "mean off"
    show_table(title, headings, rows)
