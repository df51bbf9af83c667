"""`linkwork slider-crank info` and `picture`: report where a mechanism can be assembled, and draw it."""

from __future__ import annotations

from math import degrees, isinf
from pathlib import Path
from typing import Any

import click

from ... import figures
from ... import slider_crank as sc
from ..common import console, print_paths, quantity, save_plot, say, show_table
from .options import MechanismChoice, add_mechanism_options, angle_text, out_option


@click.command(short_help="Report assembly, dead centres and stroke.")
@add_mechanism_options
def info(chosen: MechanismChoice) -> None:
    """Report where the mechanism can be assembled, its dead centres, its stroke, and the greatest shift of its crank.

    \b
    Examples:
      linkwork slider-crank info --units inch
      linkwork slider-crank info --published rahman-a4-20-alpha4-310
      linkwork slider-crank info --offset '30 in' --set rod.length='40 in'
      linkwork slider-crank info --groove shaft --set groove.amplitude='3 in' --set groove.ratio=2
    """
    p, law, units = chosen.parameters, chosen.law, chosen.units
    margin = sc.assembly_margin(p, law)
    parts = sc.assembled_ranges(p, law)
    most = sc.greatest_shift(p)
    rows = {
        "crank a1, rod a2": f"{units.length(p.crank_length)}, {units.length(p.rod_length)}",
        "offset a4, twist alpha4": f"{units.length(p.guide_offset)}, {degrees(p.guide_twist):.6g} deg",
        "shift S1": units.length(chosen.shift) if chosen.groove is None else "made by the groove",
        "assembly": f"branch {p.assembly_branch:+d}",
        "the crank": "turns fully" if margin.length >= 0.0 else "does not turn fully",
        "least assembly margin": f"{units.length(margin.length)} at {angle_text(margin.crank_angle)}",
        "greatest constant shift for a full turn": (
            "none: it cannot" if most is None else "any" if isinf(most) else units.length(most)
        ),
    }
    show_table(chosen.title, (), rows.items())
    for part in parts:
        say(
            f"range {angle_text(part.low)} to {angle_text(part.high)}: stroke {units.length(part.stroke)}, slider "
            f"{units.length(part.least.slider_position)} to {units.length(part.greatest.slider_position)}"
        )
    found = sc.dead_centres(p, law)
    if not found:
        still = all(part.stroke <= 1e-12 * p.rod_length for part in parts)
        say("no dead centres" + ": the slider stands still, whatever the crank angle" * still)
        return
    length, scale = units.name("m"), units.factor("m")
    show_table(
        "dead centres",
        ("crank angle [deg]", f"shift [{length}]", f"slider position [{length}]", "which"),
        [
            (
                f"{degrees(d.crank_angle):.2f}",
                f"{d.shift * scale:.6g}",
                f"{d.slider_position * scale:.6g}",
                "outer" if d.outer else "inner",
            )
            for d in found
        ],
    )


@click.command(short_help="Draw the mechanism in space.")
@add_mechanism_options
@click.option("--angle", default="30 deg", metavar="ANGLE", help="Crank angle of the picture.")
@click.option("--view", nargs=2, metavar="ELEVATION AZIMUTH", help="Direction of the eye, such as '22 deg' '-112 deg'.")
@click.option("--range", "with_range", is_flag=True, help="Draw also the range of assembly.")
@click.option("--animate", is_flag=True, help="Write also an animation (GIF).")
@click.option("--frames", type=click.IntRange(2), default=48, help="Number of frames of the animation.")
@out_option
def picture(
    chosen: MechanismChoice,
    angle: str,
    view: tuple[str, str] | None,
    with_range: bool,
    animate: bool,
    frames: int,
    out: str,
) -> None:
    """Draw the mechanism in space, with frames 1 and 4, paths and dead centres.

    \b
    Examples:
      linkwork slider-crank picture --units inch
      linkwork slider-crank picture --published rahman-a4-20-alpha4-310 --animate
      linkwork slider-crank picture --set rod.length='30 in' --offset '20 in' --angle '180 deg' --range
    """
    from ...files import save_figure

    p, stem = chosen.parameters, str(Path(out) / chosen.name)
    at = quantity(angle, "rad", "--angle")
    unit = "in" if chosen.units.system == "inch" else "mm"
    common: dict[str, Any] = {"law": chosen.law, "unit": unit, "title": chosen.title}
    seen = common
    if view is not None:
        seen = common | {"view": tuple(degrees(quantity(text, "rad", "--view")) for text in view)}
    written = save_plot(True, p, f"{stem}.png", at, float(chosen.link_shift(at)), **seen)
    if with_range:
        written.append(save_figure(figures.plot_range(p, **common), f"{stem}-range.png"))
    if animate:
        with console.status(f"drawing {frames} pictures"):
            written.append(figures.animate(p, f"{stem}.gif", frames=frames, **seen))
    print_paths(written)
