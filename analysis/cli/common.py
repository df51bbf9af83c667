"""What the commands share: how they speak, how they fail, and which case they are about."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import wraps
from itertools import repeat
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from linkwork.errors import InputError, Interrupted, LinkworkError

WRONG = 1
ENDED_EARLY = 3
CHECK_FAILED = 4
INTERRUPTED = 130


#: Wide enough for the tables where the output goes to a file or a pipe.
console = Console() if sys.stdout.isatty() else Console(width=120)
errors = Console(stderr=True)


def handled(command: Callable[..., Any]) -> Callable[..., Any]:
    """Turn the project's errors into a sentence and an exit code."""

    @wraps(command)
    def run(*arguments: Any, **options: Any) -> Any:
        try:
            return command(*arguments, **options)
        except Interrupted as error:
            errors.print(str(error), style="yellow", markup=False, highlight=False, soft_wrap=True)
            sys.exit(INTERRUPTED)
        except LinkworkError as error:
            errors.print(f"error: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
            sys.exit(WRONG)
        except OSError as error:
            errors.print(f"error: {error.filename or 'a file'}: {error.strerror or error}", style="red", markup=False)
            sys.exit(WRONG)
        except KeyboardInterrupt:
            errors.print("interrupted", style="yellow")
            sys.exit(INTERRUPTED)

    return run


def tolerance_option(context: click.Context, parameter: click.Parameter, value: float | None) -> float | None:
    # written so that NaN, which compares with nothing, is refused too
    if value is not None and not 0.0 < value <= 1.0:
        raise click.BadParameter(f"{value} is not between 0 and 1")
    return value


def number_or_text(text: str) -> bool | int | float | str:
    """A bare number on the command line is in SI, true and false are what they are; anything else is a text with its unit."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def changes(settings: Sequence[str], read: Callable[[str], Any], example: str) -> dict[str, Any]:
    """Values by dotted name from what was given as ``--set NAME=VALUE``."""
    values: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or not name.strip():
            raise click.UsageError(f"--set {setting!r}: it must be NAME=VALUE, such as {example}")
        values[name.strip()] = read(text.strip())
    return values


def prepare_solver(*parameters: Any, orbits: bool = False) -> None:
    """Load the compiled equations of these mechanisms, and say why it takes so long where they are compiled first."""
    with console.status("preparing the solver: a mechanism's equations are compiled once, in about half a minute"):
        from ..run import compiled

        for p in parameters:
            solver = compiled.solver(p.constants())
            for kernel in ("run", "outputs"):
                getattr(solver, kernel)
        if orbits:
            from ..periodic import orbit_kernels  # noqa: F401


def five_bar_case(file: str | None, published: str | None, settings: Sequence[str]) -> Any:
    """The case that a command for five-bars is about.

    Raises
    ------
    InputError
        If it is another mechanism's.
    """
    from ..mechanisms import FIVE_BAR, mechanism_of

    case = chosen_case(file, published, settings)
    mechanism = mechanism_of(case.parameters)
    if mechanism is not FIVE_BAR:
        raise InputError(
            f"{file or published} is a case of the {mechanism.name}: this command is for cases of the {FIVE_BAR.name}"
        )
    return case


def chosen_case(file: str | None, published: str | None, settings: Sequence[str]) -> Any:
    from ..files import io
    from ..run.case import published_case

    if (file is None) == (published is None):
        raise click.UsageError("give either a case file or --published NAME")
    overrides = changes(settings, number_or_text, "slider.stiffness='2e6 dyn/cm'")
    if file is not None:
        return io.load_case(file, overrides)
    assert published is not None
    if overrides:
        return io.case_from({"published": published}, folder=Path.cwd(), title=published, overrides=overrides)
    return published_case(published)


def say(text: str) -> None:
    """Print a sentence as it is, in one line."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def show_table(
    title: str,
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    words: Collection[str] = (),
    styles: Iterable[str | None] = repeat(None),
) -> None:
    """Print a table.

    Parameters
    ----------
    title : str
    headings : sequence of str
        Of the columns; none for a list of names and values.
    rows : iterable of sequence of str
    words : collection of str
        The headings of columns of words, which are aligned to the left; the others are of numbers.
    styles : iterable of str, optional
        Of the rows, in rich's terms.
    """
    grid = Table(title=escape(title), title_justify="left", show_header=bool(headings))
    for heading in headings:
        grid.add_column(escape(heading), justify="left" if heading in words else "right")
    for row, style in zip(rows, styles):
        grid.add_row(*(escape(cell) for cell in row), style=style)
    console.print(grid)
