"""`linkwork linkage`: report structure and motion of a described linkage, draw it, and print its equations."""

from __future__ import annotations

from math import asin, degrees
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..display import format_count
from .common import out_option, print_paths, report_errors, save_plot, say, show_table

if TYPE_CHECKING:
    from linkwork.mechanism import Mechanism

    from ..linkages import Package


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False))
@click.option("--equations", is_flag=True, help="Print only the equations, as the FMU contains them.")
@out_option(help="Folder for the picture.")
@click.option("--animation", is_flag=True, help="Write also an animation.")
@report_errors
def linkage(file: str, equations: bool, out: str, animation: bool) -> None:
    """Describe the linkage of a FILE and draw it: structure, freedoms, order of the dyads, range of motion, dead centres.

    \b
    Examples:
      linkwork new linkage
      linkwork linkage linkage.toml
      linkwork linkage linkage.toml --equations > equations.py
    """
    from ..linkages import load_package

    package = load_package(file)
    made = package.mechanism()
    if equations:
        click.echo(package.files["equations.py"], nl=False)
        return
    _print_structure(package)
    _print_reach(made)
    _print_dead_centres(package)
    from ..figures import animate

    stem = f"{Path(out) / Path(file).stem}-linkage"
    print_paths([*save_plot(True, made, f"{stem}.png"), *([animate(made, f"{stem}.gif")] if animation else [])])


def _print_structure(package: Package) -> None:
    """Print the number of bodies, joints and degrees of freedom, and the steps by which the bodies' positions are computed."""
    from ..linkages import Dyad, GearStep, RackStep

    d, structure = package.description, package.structure
    lost = 3 * len(structure.bodies) - len(structure.freedoms)
    say(
        f"{d.title or d.name}: {format_count(len(d.bodies), 'moving body')}, {format_count(len(structure.joints), 'joint')}; "
        f"3 x {len(structure.bodies)} - {lost} = {format_count(len(structure.freedoms), 'freedom')} by Gruebler's count"
    )
    rows = []
    steps = [s for step in structure.steps for s in (step.inner_dyads if isinstance(step, Dyad) else (step,))]
    for step in steps:
        if isinstance(step, Dyad):
            outer = " and ".join(side.joint.name for side in step.sides)
            bodies = ", ".join(step.bodies)
            rows.append((bodies, f"dyad {step.kind}", f"held at {outer}, joined at {step.inner.name}"))
        elif isinstance(step, GearStep):
            rows.append((step.body, "gear", f"pinned at {step.pin.name}, geared to {step.mate}"))
        elif isinstance(step, RackStep):
            driver = "rack" if step.turns else "gear"
            rows.append((step.body, step.rack, f"held at {step.joint.name}, moved by the {driver} {step.mate}"))
        else:
            freedom = package.interface.drives[step.freedom]
            driven = f", driven as {freedom.table}" if freedom.table else ""
            if freedom.speed and not freedom.table:
                driven = ", not driven: starts at its speed"
            way = f", measured from {step.body} to {step.parent}" if step.sign < 0 else ""
            rows.append((step.body, f"freedom {freedom.name}", f"from {step.parent} at {step.joint.name}{way}{driven}"))
    columns = ("body", "by", "joints")
    show_table("steps that compute the positions of the bodies", columns, rows)


def _print_reach(made: Mechanism) -> None:
    """Print the range of motion of each coordinate, with the other coordinates at their initial values."""
    from ..linkages import reach

    rows = []
    for number, freedom in enumerate(made.freedoms):
        found = reach(made, number)
        factor, unit = (degrees(1.0), "deg") if found.unit == "rad" else (1e3, "mm")
        ends = [f"{'beyond ' * free}{factor * end:.4g}" for end, free in zip((found.low, found.high), found.open)]
        span = "full turns" if found.turns else f"{' to '.join(ends)} {unit}"
        rows.append((freedom.coordinate, span, f"{degrees(asin(min(1.0, found.least))):.3g}"))
    columns = ("freedom", "range of motion", "least transmission angle [deg]")
    others = ", the other freedoms at their start" if len(rows) > 1 else ""
    show_table(f"range of motion{others}", columns, rows)


def _print_dead_centres(package: Package) -> None:
    """Print the dead centres: the values of each coordinate at which a body that is joined to the ground is at rest."""
    from ..linkages import dead_centres
    from ..units import display_scale

    rows = []
    for number, freedom in enumerate(package.interface.drives):
        unit, factor = display_scale(freedom.unit)
        rows += [
            (freedom.coordinate, centre.name, f"{factor * centre.at:.4f} {unit}")
            for centre in dead_centres(package, number)
        ]
    if rows:
        columns = ("freedom", "stands still", "at")
        show_table("dead centres", columns, rows)
