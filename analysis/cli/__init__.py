"""The ``linkwork`` command.

Exit codes: 0 done; 1 an input was wrong (a message says which); 2 the command line was wrong; 3 a run ended early (the data so
far are kept), or a result is incomplete; 4 a check failed; 130 interrupted from the keyboard (the results so far are kept).
"""

from __future__ import annotations

import gc
import sys
from importlib import import_module
from typing import Any

import click

from linkwork import __version__

#: Exit codes beside 0 and Click's 2, see above.
WRONG, ENDED_EARLY, CHECK_FAILED, INTERRUPTED = 1, 3, 4, 130

#: Every command by name: the module of this package that defines the command, and the command's line in ``linkwork --help``.
COMMANDS = {
    "basins": ("motions", "Find all periodic motions, and in which one each start ends."),
    "build": ("making", "Build and validate the FMUs."),
    "check": ("runs", "Compare the FMU with the in-process solver, output by output."),
    "decrement": ("record", "Damping and natural frequency from a decaying record."),
    "exact": ("exact", "Find all linkages through a few poses or points, exactly."),
    "examples": ("making", "Copy the examples to a folder."),
    "figures": ("runs", "Make the theses' figures, a still and an animation."),
    "info": ("runs", "Describe published sets, a parameter or case file, an FMU."),
    "linkage": ("linkage", "Draw a described linkage; say how it moves."),
    "new": ("new", "Write a case file to begin with, every entry explained."),
    "probe": ("probe", "Probe an FMU of any make with legal and forbidden calls."),
    "resonance": ("vibration", "Follow the periodic motion over speed or a parameter."),
    "run": ("runs", "Run a case file or a published set."),
    "slider-crank": ("slider_crank", "Analyse the generalised slider-crank of Rahman's thesis."),
    "slider-motion": ("slider", "Let the slider move, so that a linkage does its task better."),
    "stability": ("vibration", "Judge the periodic motion and chart where it is unstable."),
    "studio": ("studio", "Open a page on which a mechanism moves and can be dragged."),
    "synthesize": ("design", "Find linkages for a path, a function or a motion."),
    "system": ("system", "Wire FMUs to a system: run, check, draw, write SSP."),
    "tune": ("tuning", "Find the least change that removes resonances from a range."),
    "verify": ("verify", "Run the experiments that an FMU carries, and compare."),
}


#: Likeness of an unknown command to a name of the Python interface beyond which this name is suggested.
_ALIKE = 0.85


class Commands(click.Group):
    """A group of commands that reports errors as sentences, and suggests the most similar name for an unknown command."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            from difflib import get_close_matches

            from ..files import unknown_name

            functions = [
                name
                for name in dir(import_module("..", __name__))
                if name.islower() and name.replace("_", "-") not in COMMANDS
            ]
            known = [*functions, *(name.replace("-", "_") for name in self.list_commands(ctx))]
            name = next(iter(get_close_matches(args[0].replace("-", "_"), known, 1, _ALIKE)), "")
            if name in functions:
                words = f"there is no command {args[0]!r}; Python has it: from linkwork import {name}"
                raise click.UsageError(words, ctx)
            raise click.UsageError(str(unknown_name(args[0], self.list_commands(ctx), f"command {args[0]!r}")), ctx)
        return super().resolve_command(ctx, args)

    def main(self, *arguments: Any, standalone_mode: bool = True, **extra: Any) -> Any:
        """Run the command line, report errors in it as sentences, and exit with the exit code."""
        plain: Any = super().main
        if not standalone_mode:
            return plain(*arguments, standalone_mode=False, **extra)
        # imports and results are many long-lived objects: garbage collection would take a tenth of a command's time
        gc.set_threshold(50_000, 20, 100)
        try:
            sys.exit(plain(*arguments, standalone_mode=False, **extra) or 0)
        except click.exceptions.NoArgsIsHelpError as error:
            error.show()
            sys.exit(error.exit_code)
        except click.ClickException as error:
            from .common import print_error

            print_error(f"error: {_sentence(error)}", "red")
            sys.exit(error.exit_code)
        except click.Abort:
            click.echo("interrupted", err=True)
            sys.exit(INTERRUPTED)


def _sentence(error: click.ClickException) -> str:
    """Return the message of a Click error as one sentence that starts in lower case and refers to the help."""
    text = error.format_message().strip().removesuffix(".").replace(". Did you mean", "; did you mean")
    # names such as S1 and a4 at the beginning keep their case
    if text[1:2].islower() or text[1:2] == " ":
        text = text[0].lower() + text[1:]
    context = error.ctx if isinstance(error, click.UsageError) else None
    return text if context is None else f"{text} (see '{context.command_path} --help')"


class LazyCommand(click.Command):
    """A command whose module is imported only when the command is called, because some modules take seconds to import."""

    def make_context(self, *arguments: Any, **options: Any) -> click.Context:
        assert self.name is not None
        module = import_module(f".{COMMANDS[self.name][0]}", __name__)
        command: click.Command = getattr(module, self.name.replace("-", "_"))
        return command.make_context(*arguments, **options)


@click.group(
    cls=Commands,
    commands=[LazyCommand(name, short_help=line) for name, (_, line) in COMMANDS.items()],
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
)
@click.version_option(__version__, prog_name="linkwork")
def main() -> None:
    """Linkages of your own and of two theses: run them, find where they resonate, build and check their FMUs.

    \b
    Examples:
      linkwork examples
      linkwork new five-bar
      linkwork build
      linkwork run --published table-3.1
      linkwork run examples/torsion-bar.toml --fmu build/FiveBarSlider.fmu
      linkwork check --all
      linkwork figures 3.2 3.4
    """
