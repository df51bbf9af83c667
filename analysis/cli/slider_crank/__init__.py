"""Commands about the generalised slider-crank: assembly, forces, tolerances, the dual-number method, pictures."""

from __future__ import annotations

import click

from .. import Commands
from .dual import dual
from .forces import forces
from .mechanism import info, picture
from .tolerances import tolerances


@click.group("slider-crank", cls=Commands)
def slider_crank() -> None:
    """Analyse the generalised slider-crank of Rahman's thesis: offset, shifted along its crank axis, twisted.

    Each command takes a file of parameters (TOML or JSON, with mechanism = "slider-crank") or a published case, and options
    that change parameters. Lengths, angles, speeds and so on are texts with a unit, such as '10 in' or '310 deg'; numbers
    without a unit are in SI.

    \b
    Examples:
      linkwork slider-crank info
      linkwork slider-crank info --offset '30 in' --shift '9 in'
      linkwork slider-crank forces --torque '100 lbf*in' --units inch
      linkwork slider-crank picture --animate
    """


for _command in (info, forces, tolerances, dual, picture):
    slider_crank.add_command(_command)
