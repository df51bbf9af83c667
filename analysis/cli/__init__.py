"""The ``linkwork`` command.

Exit codes: 0 done; 1 something given was wrong, in one sentence; 2 the command line was wrong; 3 a run ended early (its data
are kept); 4 a check failed; 130 interrupted from the keyboard (what was computed is kept).
"""

from __future__ import annotations

import click

from linkwork import __version__

from . import design, runs, slider, slider_crank, vibration
from .common import CHECK_FAILED, ENDED_EARLY, INTERRUPTED, WRONG

__all__ = ["CHECK_FAILED", "ENDED_EARLY", "INTERRUPTED", "WRONG", "main"]


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="linkwork")
def main() -> None:
    """Linkages with two degrees of freedom: build and check the FMU, run cases, make the thesis's figures.

    \b
    Examples:
      linkwork build
      linkwork run --published table-3.1
      linkwork run examples/torsion-bar.toml --fmu build/FiveBarSlider.fmu
      linkwork check --all
      linkwork figures 3.2 3.4
    """


for _command in (
    runs.build,
    runs.run,
    runs.check,
    runs.info,
    runs.figures,
    vibration.resonance,
    vibration.stability,
    design.synthesize,
    slider.slider_motion,
    slider_crank.slider_crank,
):
    main.add_command(_command)
