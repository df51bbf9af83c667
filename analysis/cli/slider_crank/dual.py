"""`linkwork slider-crank dual`: compare the thesis's dual-number method with vector mechanics."""

from __future__ import annotations

from math import tau
from pathlib import Path

import click
import numpy as np
from click.core import ParameterSource

from linkwork.slider_crank.assembly import check_assembly

from ... import slider_crank as sc
from ..common import CHECK_FAILED, fail, output_folder, print_paths, say, show_table, tolerance_option
from .options import MechanismChoice, add_mechanism_options, out_option, problem_options


@click.command(short_help="Compare the thesis's dual-number method with vector mechanics.")
@add_mechanism_options
@problem_options(points=361)
@tolerance_option(default=1e-9, help="Largest relative difference that passes.")
@click.option("--two-rotations", is_flag=True, help="Show instead the closure error of the thesis's own method.")
@out_option
def dual(chosen: MechanismChoice, tolerance: float, two_rotations: bool, out: str) -> None:
    """Compare the thesis's dual-number method with vector mechanics, quantity by quantity.

    Dual matrices with true ball joints (three rotations) close the loop, and dual momenta give the forces. Differences are
    relative to the largest quantity of the same unit. --two-rotations shows the form in the thesis instead: it gives each ball
    joint only two rotations, and converges to loops that are not closed.

    \b
    Examples:
      linkwork slider-crank dual
      linkwork slider-crank dual --published rahman-a4-20-alpha4-310 --torque '100 lbf*in'
      linkwork slider-crank dual --two-rotations --units inch
    """
    if two_rotations:
        source = click.get_current_context().get_parameter_source
        for name in ("torque", "load", "speed", "tolerance"):
            if source(name) is not ParameterSource.DEFAULT:
                raise click.UsageError(f"--{name} has no effect with --two-rotations, which is about positions alone")
        _show_two_rotations(chosen, chosen.points, Path(out))
        return
    if chosen.groove == "shaft" and "torque" in chosen.given:
        raise click.UsageError("--torque is for a shift that is driven apart from the crank: give --groove apart")
    found = sc.compare(chosen.turn())
    units, passed = chosen.units, [d.relative <= tolerance for d in found.differences]
    show_table(
        f"{chosen.title}: dual numbers minus vector mechanics, {found.angles} crank angles",
        ("quantity", "unit", "largest", "largest difference", "relative", "verdict"),
        [
            (
                d.quantity,
                units.name(d.unit),
                f"{d.largest * units.factor(d.unit):.6g}",
                f"{d.difference * units.factor(d.unit):.1e}",
                f"{d.relative:.1e}",
                "pass" if ok else "FAIL",
            )
            for d, ok in zip(found.differences, passed)
        ],
        styles=[None if ok else "red" for ok in passed],
    )
    say(
        f"the loop closes to {found.rotation_residual * units.factor('rad'):.1e} {units.name('rad')} and "
        f"{found.length_residual * units.factor('m'):.1e} {units.name('m')} in at most {found.iterations} iterations; moment "
        f"about the rod's line, which no equation asks for: {found.rod_moment * units.factor('N.m'):.1e} {units.name('N.m')}"
    )
    if not all(passed):
        fail("check failed: the two do not agree", CHECK_FAILED)
    say("the two agree", style="green")


def _show_two_rotations(chosen: MechanismChoice, points: int, folder: Path) -> None:
    """Print and write, for crank angles over a turn, the closure error with which the iteration of the thesis ends."""
    from ...files import write_csv

    angle = np.linspace(0.0, tau, points)
    shift = chosen.link_shift(angle)
    short = sc.shortage(chosen.parameters, angle, shift)
    reached = short < 0.0
    if not reached.any():
        worst = int(np.argmin(short))
        check_assembly(float(angle[worst]), float(shift[worst]), chosen.parameters.constants())
    end = sc.settle(chosen.parameters, angle[reached], shift[reached])
    length, scale = chosen.units.name("m"), chosen.units.factor("m")
    columns = {
        "crank angle [deg]": np.degrees(end.crank_angle),
        f"slider position [{length}]": end.unknowns[:, 4] * scale,
        f"off by [{length}]": end.position_error * scale,
        "rotation residual [deg]": np.degrees(end.rotation_residual),
        f"length residual [{length}]": end.length_residual * scale,
        "steps": end.steps.astype(float),
        "settled": end.settled.astype(float),
    }
    shown = range(0, len(end.steps), max(1, len(end.steps) // 12))
    numbers = list(columns.values())[:-1]
    show_table(
        f"{chosen.title}: closure with two rotations per ball joint",
        tuple(columns),
        [(*(f"{x[i]:.6g}" for x in numbers), "yes" if end.settled[i] else "no") for i in shown],
        styles=[None if end.settled[i] else "yellow" for i in shown],
    )
    say(
        f"largest rotation residual {np.degrees(end.rotation_residual).max():.2f} deg, length residual "
        f"{chosen.units.length(float(end.length_residual.max()))}; slider position off by up to "
        f"{chosen.units.length(float(end.position_error.max()))}; the steps become small at {int(end.settled.sum())} of "
        f"{len(end.settled)} crank angles"
    )
    print_paths([write_csv(output_folder(folder) / f"{chosen.name}-two-rotations.csv", columns)])
