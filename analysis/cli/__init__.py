"""The ``linkwork`` command.

Exit codes: 0 done; 1 an input was wrong, one sentence says which; 2 the command line was wrong; 3 a run ended early (its data
are kept); 4 a check failed; 130 interrupted from the keyboard (what was computed is kept).
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import click

from linkwork import __version__

WRONG = 1
ENDED_EARLY = 3
CHECK_FAILED = 4
INTERRUPTED = 130

#: Every command: the module of this package that has it, as a function of its name, and its line in ``linkwork --help``.
COMMANDS = {
    "build": ("runs", "Build and validate the FMUs."),
    "check": ("runs", "Compare the FMU with the in-process solver, output by output."),
    "figures": ("runs", "Make the theses' figures, a still and an animation."),
    "info": ("runs", "Describe published sets, a parameter or case file, an FMU."),
    "probe": ("probe", "Probe an FMU of any make with legal and forbidden calls."),
    "resonance": ("vibration", "Follow the periodic motion over speed or a parameter."),
    "run": ("runs", "Run a case file or a published set."),
    "slider-crank": ("slider_crank", "Analyse the generalised slider-crank of Rahman's thesis."),
    "slider-motion": ("slider", "Let the slider move, so that a linkage does its task better."),
    "stability": ("vibration", "Judge the periodic motion and chart where it is unstable."),
    "synthesize": ("design", "Find linkages for a path, a function or a motion."),
}


class LazyCommand(click.Command):
    """A command whose module is imported when it is called, because some modules take seconds to import."""

    def make_context(self, *arguments: Any, **options: Any) -> click.Context:
        assert self.name is not None
        module = import_module(f".{COMMANDS[self.name][0]}", __name__)
        command: click.Command = getattr(module, self.name.replace("-", "_"))
        return command.make_context(*arguments, **options)


@click.group(
    commands=[LazyCommand(name, short_help=line) for name, (_, line) in COMMANDS.items()],
    context_settings={"help_option_names": ["-h", "--help"]},
)
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
