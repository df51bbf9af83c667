"""`linkwork slider-crank forces`: compute all joint forces over a turn."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from ... import slider_crank as sc
from ..common import output_folder, print_paths, save_plot, say, show_table
from . import options

if TYPE_CHECKING:
    from ...slider_crank import ForceTurn


@click.command(short_help="Find all joint forces over a turn.")
@options.add_mechanism_options
@options.problem_options(points=721)
@click.option(
    "--frame",
    "frames",
    type=click.IntRange(1, 4),
    multiple=True,
    default=(1,),
    help="Frame of the components shown: 1 ground, 2 crank, 3 rod, 4 guide; can be given several times.",
)
@options.out_option
@options.plot_option
def forces(chosen: options.MechanismChoice, frames: Sequence[int], out: str, plot: bool) -> None:
    """Find all joint forces over a turn, and the slider force if the torque is given, or the torque if the load is given.

    If the torque is given, the slider force is not finite at the dead centres. If the crank cannot make a full turn, all forces
    grow without bound towards the limits of assembly. The command lists these crank angles with the reason; the extremes that
    it prints lie more than 10 deg away from them.

    \b
    Examples:
      linkwork slider-crank forces --torque '100 lbf*in' --units inch
      linkwork slider-crank forces --load '-20 lbf' --frame 2 --frame 4
      linkwork slider-crank forces crank.toml --speed '300 rpm' --out results
    """
    from ...files import write_csv

    units, frames = chosen.units, tuple(dict.fromkeys(frames))
    turn = chosen.turn()
    headings = ("quantity", "unit", "least", "at [deg]", "greatest", "at [deg]")
    show_table(f"{chosen.title}: {turn.sought} sought", headings, _extremes(turn, frames, units))
    for sentence in _special_places(turn, units):
        say(sentence)
    stem = str(output_folder(out) / f"{chosen.name}-forces")
    written = [write_csv(f"{stem}.csv", turn.columns(units.system))]
    for frame in frames:
        title = f"{chosen.title}: joint forces in frame {frame}"
        written += save_plot(plot, turn, f"{stem}-frame-{frame}.png", frame, units=units.system, title=title)
    print_paths(written)


def _extremes(turn: ForceTurn, frames: Sequence[int], units: options.Units) -> Sequence[Sequence[str]]:
    """Return the rows of a table: least and greatest value of each quantity, with the crank angles at which they occur.

    ``frames`` are the numbers of the frames in which joint forces are given. Forces and torques near singular angles are left
    out. A constant quantity has no crank angles.
    """
    quantities: list[tuple[str, str, Any]] = [
        ("slider position", "m", turn.slider_position),
        ("crank torque", "N.m", turn.torque),
        ("slider force", "N", turn.slider_force),
        ("axial force on the crank", "N", turn.axial_force),
    ]
    quantities += [
        (f"{joint.words}, {axis}{frame}", joint.unit, values)
        for frame in frames
        for name, joint in sc.JOINTS.items()
        for axis, values in zip("ijk", turn.vector(name, frame).T)
    ]
    clear = turn.clear()
    found = []
    size: dict[str, float] = {}
    for name, si, values in quantities:
        (good,) = np.nonzero(~np.ma.getmaskarray(values) & (clear | (si == "m")))
        if good.size:
            inside = np.ma.getdata(values)[good]
            ends = [good[np.argmin(inside)], good[np.argmax(inside)]]
            found.append((name, si, values, ends))
            size[si] = max(size.get(si, 0.0), *np.abs(inside))
    rows = []
    for name, si, values, ends in found:
        cells = [name, units.name(si)]
        # a value or a change that is only a rounding error compared with the greatest value in the same unit counts as zero
        rounding = 1e-12 * size[si]
        varies = values[ends[1]] - values[ends[0]] > rounding
        for i in ends:
            value = 0.0 if abs(values[i]) <= rounding else values[i] * units.factor(si)
            cells += [f"{value:.6g}", f"{degrees(turn.angle[i]):.1f}" if varies else ""]
        rows.append(cells)
    return rows


def _special_places(turn: ForceTurn, units: options.Units) -> list[str]:
    """Return sentences on the dead centres and limits of assembly, and on the forces that are not determined at them."""
    without = f"grows without bound towards it; within {sc.CLEAR_DEG:g} deg it is not among the extremes"
    sentences = [
        f"dead centre at {options.angle_text(d.crank_angle)}, slider at {units.length(d.slider_position)}"
        for d in turn.dead_centres
    ]
    if turn.sought == sc.SLIDER_FORCE:
        sentences += [
            f"no slider force at {options.angle_text(d.crank_angle)}: it has no lever on the crank there, and {without}"
            for d in turn.singularities
        ]
    sentences += [
        f"limit of assembly at {options.angle_text(d)}: the rod is perpendicular to the guide there, and every force {without}"
        for d in turn.limits
    ]
    if not turn.clear().any():
        sentences.append("all crank angles are too near to these, so that no force has extremes")
    return [*sentences, *(f"masked: {text}" for text in turn.mask_reasons)]
