"""Functions that the commands share: options, console output, exit codes, and reading the case of a command."""

from __future__ import annotations

import os
import re
import sys
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import wraps
from itertools import repeat
from pathlib import Path
from typing import Any, NoReturn

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

from linkwork.errors import AssemblyError, InputError, Interrupted, LinkworkError

from ..libraries import MissingLibraryError, require
from ..units import display_scale
from . import CHECK_FAILED as CHECK_FAILED
from . import ENDED_EARLY as ENDED_EARLY
from . import INTERRUPTED as INTERRUPTED
from . import WRONG as WRONG

#: Standard output; if it is a file or a pipe, its width is large enough for the tables.
console = Console(emoji=False) if sys.stdout.isatty() else Console(emoji=False, width=120)
errors = Console(emoji=False, stderr=True)


def escape_controls(text: str) -> str:
    """Return a text with control characters of a terminal escaped as in Python, such as \\x1b."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


def plain_text(text: str) -> Text:
    """Return a text for a cell of a table; markup and emoji codes in the text have no effect."""
    return Text(escape_controls(text))


#: Patterns of a number in a sentence, and of a number with a unit in SI; numbers in quotes do not match.
NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_QUANTITY = re.compile(rf"(?<![-'\w.])({NUMBER}) (N\.m|N|m)(?!\w|[./](?!rad\b)\w)")


#: Pattern of the beginning of a cell in a column of numbers.
_NUMERIC = re.compile(r"[-+]?(\d|nan|inf)|none$|$")


def in_units(text: str, shown: Callable[[str], tuple[str, float]]) -> str:
    """Return a sentence with its lengths, forces and torques converted from SI to other units.

    ``shown`` receives an SI unit and returns the name of the other unit and the factor to it.
    """

    def convert(found: re.Match[str]) -> str:
        unit, factor = shown(found[2])
        return found[0] if unit == found[2] else f"{float(found[1]) * factor:.6g} {unit}"

    return _QUANTITY.sub(convert, text)


def print_error(text: str, style: str = "yellow") -> None:
    """Print a sentence on standard error; the style is yellow for a note, red for an error."""
    errors.print(escape_controls(text), style=style, markup=False, highlight=False, soft_wrap=True)


def note(text: str) -> None:
    """Print a note on standard error."""
    print_error(f"note: {text}")


def fail(text: str, code: int) -> NoReturn:
    """Print an error and exit with a code."""
    print_error(text, "red")
    sys.exit(code)


def print_paths(paths: Iterable[Path]) -> None:
    """Print the names of the files that were written."""
    for path in paths:
        say(f"wrote {path}")


def report_errors(command: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate a command: report errors as a message and an exit code, and protect files that the command did not write.

    See `analysis.files.outputs` for the protection of files.
    """

    @wraps(command)
    def run(*arguments: Any, **options: Any) -> Any:
        from ..files import attribute_files

        context = click.get_current_context()
        # without the name of the program, which may be python
        names = context.command_path.removeprefix(context.find_root().command_path)
        with attribute_files(names.strip(), bool(context.meta.get(_FORCE))) as writing:
            try:
                return report(*arguments, **options)
            finally:
                for line in writing.notes:
                    note(line)

    def report(*arguments: Any, **options: Any) -> Any:
        try:
            return command(*arguments, **options)
        except (Interrupted, KeyboardInterrupt) as error:
            print_error(str(error) or "interrupted")
            sys.exit(INTERRUPTED)
        except LinkworkError as error:
            text = in_units(str(error), display_scale) if isinstance(error, AssemblyError) else str(error)
        except OSError as error:
            text = f"{error.filename or 'a file'}: {error.strerror or error}"
        except MemoryError as error:
            text = f"not enough memory: {error or 'ask for less at a time'}"
        fail(f"error: {text}", WRONG)

    return run


def check_tolerance(context: click.Context, parameter: click.Parameter, value: float | None) -> float | None:
    """Return the value of a tolerance option, checked to be between 0 and 1 (a callback of Click)."""
    if value is not None and not 0.0 < value <= 1.0:
        raise click.BadParameter(f"{value} is not between 0 and 1")
    return value


def tolerance_option(*names: str, default: float | None = None, help: str) -> Callable[..., Any]:
    """Return an option for a tolerance between 0 and 1."""
    return click.option(*(names or ["--tolerance"]), type=float, callback=check_tolerance, default=default, help=help)


def check_place(context: click.Context, parameter: click.Parameter, value: str | None) -> str | None:
    """Check, before anything is computed, that the folder or file of an option can be written (a callback of Click)."""
    if value is None:
        return value
    place = Path(value)
    # a file is replaced by a new file, for which its folder must be writable
    there = next(path for path in ((place, *place.parents) if place.is_dir() else place.parents) if path.exists())
    if not there.is_dir():
        raise click.BadParameter(f"{value} cannot be made: {there} is no folder")
    if not os.access(there, os.W_OK):
        raise click.BadParameter(f"{value} cannot be written: {there} is read-only")
    return value


def out_option(default: str = "out", help: str = "Folder for CSV and plots.") -> Callable[..., Any]:
    """Return a decorator that adds the options --out and --force."""
    kind = click.Path(file_okay=False)
    out = click.option("--out", default=default, type=kind, callback=check_place, help=help)
    return lambda command: out(force_option(command))


#: Seconds within which the scheduler of a cluster must answer.
_PATIENCE = 10
#: Key under which the context of a command stores the option --force.
_FORCE = "linkwork.force"
force_option = click.option(
    "--force",
    is_flag=True,
    expose_value=False,
    callback=lambda context, _, value: context.meta.update({_FORCE: value}),
    help="Overwrite files that this command did not write, too.",
)


def _number_of_jobs(context: click.Context, parameter: click.Parameter, value: int | None) -> int | None:
    if value is not None and (value == 0 or value < -1):
        raise click.BadParameter(f"{value} is neither -1, for all, nor a number of cores")
    return value


def _join(context: click.Context, parameter: click.Parameter, address: str | None) -> None:
    if address is not None:
        context.with_resource(_cluster(address))


@contextmanager
def _cluster(address: str) -> Iterator[None]:
    """Run the parallel work inside this context on the Dask cluster whose scheduler has this address."""
    _check_libraries("distributed")
    import joblib
    from distributed import Client

    try:
        client: Any = Client(address, timeout=_PATIENCE)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise click.BadParameter(f"no scheduler of Dask answers at {address}: {error}") from None
    with client, joblib.parallel_config("dask", client=client):
        yield


def workers_options(default: int | None = None) -> Callable[..., Any]:
    """Return a decorator that adds the options --jobs and --scheduler, for the number of processes or a cluster."""
    jobs = click.option(
        "--jobs",
        "--cores",
        "jobs",
        type=int,
        default=default,
        callback=_number_of_jobs,
        help="Processes on this machine; -1 for one per core.",
    )
    scheduler = click.option(
        "--scheduler",
        metavar="ADDRESS",
        expose_value=False,
        callback=_join,
        help="Run on the cores of a Dask cluster with this scheduler, such as tcp://10.0.0.5:8786.",
    )
    return lambda command: jobs(scheduler(command))


def output_folder(out: str | Path) -> Path:
    """Return the folder of the option --out; make it if it does not exist."""
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def set_option(example: str) -> Callable[..., Any]:
    """Return the option --set, which can be given several times; its help is "Change a value, such as" and ``example``."""
    return click.option(
        "--set", "settings", multiple=True, metavar="NAME=VALUE", help=f"Change a value, such as {example}."
    )


def _check_libraries(*names: str) -> None:
    """Raise Click's BadParameter if one of the named libraries is not installed."""
    try:
        require(*names)
    except MissingLibraryError as error:
        raise click.BadParameter(str(error)) from None


def _require_plotly(context: click.Context, parameter: click.Parameter, value: bool) -> bool:
    if value:
        _check_libraries("plotly")
    return value


html_option = click.option(
    "--html",
    is_flag=True,
    callback=_require_plotly,
    help="Write the plot also as a page with values under the pointer; needs Plotly.",
)


def save_picture(picture: Any, path: str | Path, *, html: bool) -> list[Path]:
    """Write a picture as PNG, and with ``html`` also as a web page, and return the paths; ``path`` is without ending."""
    from .. import figures
    from ..files import save_figure, write_text

    written = [save_figure(figures.draw(picture), f"{path}.png")]
    if html:
        written.append(write_text(f"{path}.html", figures.to_html(picture)))
    return written


def save_plot(wanted: bool, result: Any, path: str | Path, *more: Any, **options: Any) -> list[Path]:
    """Plot a result to a file if plots are ``wanted``, and return the paths of the files written."""
    from .. import figures
    from ..files import save_figure

    return [save_figure(figures.plot(result, *more, **options), path)] if wanted else []


plot_option = click.option("--plot/--no-plot", "--plots/--no-plots", default=True, help="Whether to write plots.")


class _CaseFile(click.Path):
    """Path of a case file; the name of a published set is refused with the option that takes it."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not Path(value).exists():
            from ..mechanisms import PUBLISHED

            if value in PUBLISHED:
                self.fail(f"{value} is a published set: --published {value}", param, ctx)
        return super().convert(value, param, ctx)


def case_options(published: Iterable[str]) -> Callable[..., Any]:
    """Return a decorator that adds the argument CASE and the options --published and --set: see `chosen_case`.

    ``published`` are the names of published sets for the help text.
    """
    case = click.argument("case", required=False, type=_CaseFile(exists=True, dir_okay=False))
    words = f"A published set instead of a case: {', '.join(published)}."
    option = click.option("--published", metavar="NAME", help=words)
    setting = set_option("slider.stiffness='2e6 dyn/cm' or drive.speed='300 rpm'; bare numbers are in SI")
    return lambda command: case(option(setting(command)))


def typed_value(text: str) -> Any:
    """Convert a text of the command line to a value: of TOML, as in a case file, or a number; any other text stays a text."""
    with suppress(ValueError, RecursionError):
        return tomllib.loads(f"value = {text}")["value"]
    with suppress(ValueError):
        return float(text)
    return text


def unknown_name_error(name: str, known: Iterable[str], words: str) -> click.UsageError:
    """Return the error for an unknown name on the command line, with the most similar known names.

    ``words`` describe the name in the message, such as "interface 'cs' to check".
    """
    from ..files import unknown_name

    return click.UsageError(str(unknown_name(name, known, words)))


#: Kinds of files with tables: description, and the command that reads the file.
RUN = "a case of a run", "linkwork run"
PARAMETERS = "a file of parameters alone", "linkwork info"
SYNTHESIS = "a synthesis case", "linkwork synthesize"
SLIDER_MOTION = "a case of a slider's motion", "linkwork slider-motion"
TUNING = "a case of a tuning", "linkwork tune"
SYSTEM = "a system of parts", "linkwork system run"
#: Descriptions of files that are not cases, by ending.
_OTHERS = {
    ".fmu": "an FMU: linkwork info {0} describes it, linkwork run CASE --fmu {0} runs it",
    ".csv": "a table of numbers: a case names it as the file of an input or a task",
    ".svg": "a drawing: a synthesis case names it as the file of its task",
    ".dxf": "a drawing, written for CAD: a synthesis case takes SVG or CSV as the file of its task",
    ".py": "a Python script: python {0} runs it",
}


def case_kind(tables: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return the kind of a case file, such as `RUN`, by the names of its tables; None if they fit no kind."""
    from ..linkages import has_linkage
    from ..mechanisms import MECHANISMS
    from ..run import COMMON, case_inputs

    names = set(tables)
    if "parts" in names:
        return SYSTEM
    if has_linkage(tables) and not names & {"tune", "task"}:
        return RUN
    if "tune" in names:
        return TUNING
    if "task" in names:
        return SLIDER_MOTION if names & {"slider", "strategy"} else SYNTHESIS
    if names & {"bounds", "constraints", "search", "make", "trade_off", "linkage", "strategy", "tracking"}:
        return None
    acting = {name.partition(".")[0] for m in MECHANISMS.values() for name in case_inputs(m)}
    if names & (acting | set(COMMON) - {"mechanism", "title"}):
        return RUN
    parameters = {name.partition(".")[0] for m in MECHANISMS.values() for name in m.mechanism_variables}
    return PARAMETERS if names & (parameters | {"mechanism"}) else None


def check_kind(path: str, *wanted: tuple[str, str], settings: Iterable[str] = ()) -> None:
    """Check that a file is of one of the ``wanted`` kinds, such as `RUN`; the error names the command for another kind.

    ``settings`` are dotted names of entries that options of the command line add to the file's entries.
    """
    from ..files import read_tables

    ending = Path(path).suffix.lower()
    if ending in _OTHERS:
        raise InputError(f"{path} is {_OTHERS[ending].format(path)}")
    kind = case_kind(read_tables(path) | {name.partition(".")[0]: None for name in settings})
    if kind is not None and kind not in wanted:
        what, command = kind
        raise InputError(f"{path} is {what}: {command} {path} (this command takes {wanted[0][0]})")


def quantity(text: str, unit: str, option: str) -> float:
    """Return the value of an option in SI, from a text such as "420 rpm" or a number without unit, which is in SI.

    A note gives a speed without unit in rpm.
    """
    from .. import units

    value = units.quantity(given := typed_value(text), unit, option)
    if value and unit == "rad/s" and not isinstance(given, str):
        note(f"{option} {text} has no unit and is taken in rad/s, as {units.display_text(value, unit)}")
    return value


def changes(settings: Sequence[str], example: str) -> dict[str, Any]:
    """Return the new values that the options ``--set NAME=VALUE`` give, by name; ``example`` is for error messages."""
    values: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or not name.strip():
            raise click.UsageError(f"--set {setting!r}: it must be NAME=VALUE, such as {example}")
        values[name.strip()] = typed_value(text.strip())
    return values


def chosen_case(file: str | None, published: str | None, settings: Sequence[str], *, runs: bool = True) -> Any:
    """Return the case of a file or of a published set, with the changes by ``--set``; print warnings about its masses.

    If ``runs`` is false, the case needs no stop time.
    """
    from ..run import describe_masses, load_case, published_case, read_case

    if (file is None) == (published is None):
        raise click.UsageError("give either a case file or --published NAME")
    overrides = changes(settings, "slider.stiffness='2e6 dyn/cm'")
    if not runs and (file or overrides) and "run.revolutions" not in overrides:
        overrides = {"run.stop_time": 1.0} | overrides
    if file is not None:
        check_kind(file, RUN, PARAMETERS)
        case = load_case(file, overrides)
    elif overrides:
        case = read_case({"published": published}, folder=Path.cwd(), title=str(published), overrides=overrides)
    else:
        case = published_case(str(published))
    for warning in describe_masses(case.masses)[1]:
        note(warning)
    return case


def say(text: str, style: str | None = None) -> None:
    """Print a sentence in one line, without markup; the style is green or red for a verdict."""
    console.print(escape_controls(text), style=style, markup=False, highlight=False, soft_wrap=True)


def show_table(
    title: str,
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    unwrapped: Collection[str] = (),
    styles: Iterable[str | None] = repeat(None),
) -> None:
    """Print a table with a row of ``headings``, unless there are none; columns of numbers are aligned to the right.

    ``unwrapped`` are headings of columns whose cells are not wrapped; ``styles`` are styles of rows, by their names in rich.
    """
    grid, rows = Table(title=plain_text(title), title_justify="left", show_header=bool(headings)), list(rows)
    for place, heading in enumerate(headings):
        justify: Any = "right" if all(_NUMERIC.match(row[place]) for row in rows) else "left"
        # in a narrow terminal a long word is wrapped, not truncated
        grid.add_column(plain_text(heading), justify=justify, no_wrap=heading in unwrapped, overflow="fold")
    for row, style in zip(rows, styles):
        grid.add_row(*(plain_text(cell) for cell in row), style=style)
    console.print(grid)
