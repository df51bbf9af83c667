"""`linkwork build` and `linkwork examples`: build the FMUs, and copy the examples to a folder."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .common import check_place, console, note, report_errors, say

if TYPE_CHECKING:
    from linkwork.mechanism import Mechanism

PACKAGE = Path(__file__).resolve().parents[1]
#: Folders of the examples: beside the package in a checkout, inside the package if Linkwork is installed as a wheel.
EXAMPLES = (PACKAGE.parent / "examples", PACKAGE / "_examples")


def _split_values(context: click.Context, parameter: click.Parameter, values: Sequence[str]) -> tuple[str, ...]:
    """Return the values of an option that is given several times, or once with commas (a callback of Click)."""
    return tuple(name for value in values for name in value.split(",") if name)


@click.command()
@click.argument("models", nargs=-1, metavar="[MODEL]...")
@click.option(
    "--dest", default="build", type=click.Path(file_okay=False), callback=check_place, help="Folder for the FMUs."
)
@click.option(
    "--kinds",
    multiple=True,
    callback=_split_values,
    metavar="KIND,...",
    help="Kinds of FMU: python, native, native-fmi3; by default all.",
)
@click.option(
    "--platforms",
    multiple=True,
    callback=_split_values,
    metavar="PLATFORM,...",
    help="Platforms of native FMUs: all, or some of x86_64-linux, aarch64-linux, x86_64-windows, x86_64-darwin, "
    "aarch64-darwin, and wasm32-wasip2 for FMI 3.0; by default this one.",
)
@click.option(
    "--publish",
    metavar="FOLDER",
    type=click.Path(file_okay=False),
    callback=check_place,
    help="Write each FMU to this folder too, with inputs, reference results and the importers that run it.",
)
@report_errors
def build(
    models: Sequence[str], dest: str, kinds: Sequence[str], platforms: Sequence[str], publish: str | None
) -> None:
    """Build and validate the FMUs of all mechanisms.

    MODEL is the name of a mechanism's FMU, such as FiveBarSlider, or a file that describes a linkage; if it is given, only its
    FMUs are built.

    \b
    Examples:
      linkwork build
      linkwork build FiveBarSlider --dest fmus --kinds python
      linkwork build --kinds native,native-fmi3 --platforms all
      linkwork build press.toml
    """
    from ..export import build_all
    from ..linkages import load_linkage

    described = {name: load_linkage(name) for name in models if Path(name).suffix in (".toml", ".json")}
    models = [described[name].fmu if name in described else name for name in models]
    with console.status("building"):
        for fmu, for_platforms in build_all(models, dest, kinds, platforms, publish_to=publish):
            made = f", {' '.join(for_platforms)}" if for_platforms else ""
            say(f"{fmu}: valid, {fmu.stat().st_size / 1024:.0f} KiB{made}")
    for name, mechanism in described.items():
        if entries := _entries_of_runs(name, mechanism):
            note(
                f"{mechanism.fmu} starts with the values in [linkage] of {name}; {', '.join(entries)} outside of this "
                f"table {'is' if len(entries) == 1 else 'are'} only for runs of the file. Set such values in the master, or in "
                "[linkage]: start and speed of each freedom"
            )


def _entries_of_runs(file: str, mechanism: Mechanism) -> list[str]:
    """Return the parameters, start values and inputs that a file gives outside of the linkage that it describes or names."""
    from ..files import flatten, read_tables
    from ..linkages import with_linkage
    from ..run import case_inputs

    tables = with_linkage(read_tables(file), Path(file).parent)
    known = {name.partition(".")[0] for name in (*(v.name for v in mechanism.variables), *case_inputs(mechanism))}
    entries = [name.split(".") for name in flatten(tables) if name.partition(".")[0] in known]
    return list(dict.fromkeys(".".join(parts[:2]) for parts in entries))


@click.command()
@click.option("--dest", default="examples", type=click.Path(file_okay=False), help="Folder for the examples.")
@click.option("--force", is_flag=True, help="Overwrite files of the same name.")
@report_errors
def examples(dest: str, force: bool) -> None:
    """Copy the examples to a folder: case files of every kind, a drawn curve, Python scripts.

    \b
    Examples:
      linkwork examples
      linkwork run examples/run-up.toml
    """
    source = next(folder for folder in EXAMPLES if folder.is_dir())
    folder = Path(dest)
    files = sorted(
        path.relative_to(source) for path in source.rglob("*") if path.is_file() and path.parent.name != "__pycache__"
    )
    there = [str(path) for path in files if (folder / path).exists()]
    if there and not force:
        names = ", ".join(there[:5]) + (f" and {len(there) - 5} more" if len(there) > 5 else "")
        raise click.UsageError(f"{folder} already has {names}: give --force to overwrite them, or --dest")
    for path in files:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source / path, folder / path)
    say(f"wrote {len(files)} files to {folder}: {', '.join(map(str, files))}")
