"""`linkwork system`: run, check, draw and build systems of FMUs, from a description or an SSP file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from . import Commands, common

if TYPE_CHECKING:
    from ..systems import Wiring


@click.group("system", cls=Commands)
def system() -> None:
    """Run and build systems of FMUs: mechanisms with motors, shafts, loads and controllers.

    FILE is a description (.toml) or an SSP 1.0 archive (.ssp).

    \b
    Examples:
      linkwork system new motor-crank
      linkwork system run motor-crank.toml --stop '3 s'
      linkwork system check motor-crank.toml
      linkwork system build motor-crank.toml
      linkwork system run out/motor-crank.ssp --stop '3 s' --coupling derivatives
      linkwork system host motor-crank.toml
    """


_FILE = click.argument("file", type=click.Path(exists=True, dir_okay=False))


_FMI = click.option(
    "--fmi",
    type=click.Choice(["2", "3"]),
    default="2",
    help="FMI version of the mechanisms' FMUs; has no effect on an SSP file.",
)


def _wiring(file: str, fmi: str = "2") -> Wiring:
    from ..systems import load_system, read_ssp

    if Path(file).suffix == ".ssp":
        return read_ssp(file)
    common.check_kind(file, common.SYSTEM)
    return load_system(file).wiring(fmi=int(fmi))


@system.command()
@click.argument("name", required=False)
@click.argument("file", required=False, type=click.Path(dir_okay=False))
@common.report_errors
def new(name: str | None, file: str | None) -> None:
    """Write the description of the example system NAME.

    Without NAME, list the example systems.

    \b
    Examples:
      linkwork system new
      linkwork system new motor-crank
    """
    from ..files import read_tables, unknown_name, write_text
    from ..systems import library

    known = library()
    if name is None:
        common.show_table("systems", ("name", "what"), [(n, read_tables(p)["title"]) for n, p in known.items()])
        return
    if name not in known:
        raise unknown_name(name, known, f"system {name!r}")
    path = write_text(file or f"{name}.toml", known[name].read_text(encoding="utf-8"))
    common.say(f"wrote {path}; next: linkwork system run {path}")


@system.command()
@_FILE
@_FMI
@common.out_option(help="Folder for the archive.")
@common.report_errors
def build(file: str, fmi: str, out: str) -> None:
    """Build the FMUs of a system and write it as an SSP archive.

    The archive is of SSP 1.0, with --fmi 3 of SSP 2.0.

    \b
    Examples:
      linkwork system build motor-crank.toml
      linkwork system build motor-crank.toml --fmi 3
    """
    from ..systems import write_ssp

    common.say(f"wrote {write_ssp(_wiring(file, fmi), common.output_folder(out) / f'{Path(file).stem}.ssp')}")


@system.command()
@_FILE
@click.option("--step", help="Communication step, such as '1 ms'.")
@click.option("--stop", help="End of the run, such as '3 s'.")
@click.option(
    "--coupling", default="hold", help="How inputs are continued over a step: hold, derivatives, updates, rollback."
)
@click.option(
    "--share",
    type=click.FloatRange(0.0, 1.0, min_open=True),
    help="Choose the steps so that the coupling adds about this share of the power, such as 1e-3.",
)
@_FMI
@common.out_option()
@common.plot_option
@common.report_errors
def run(
    file: str, step: str | None, stop: str | None, coupling: str, share: float | None, fmi: str, out: str, plot: bool
) -> None:
    """Run a system, print its connected outputs and draw them.

    All outputs are written as CSV.

    \b
    Examples:
      linkwork system run motor-crank.toml --stop '3 s'
      linkwork system run motor-crank.toml --share 1e-3
      linkwork system run out/motor-crank.ssp --stop '3 s' --coupling derivatives
    """
    from ..files import write_csv
    from ..systems import run_system
    from ..units import display_scale

    found = run_system(
        _wiring(file, fmi),
        coupling=coupling,
        share=share,
        step=None if step is None else common.quantity(step, "s", "--step"),
        stop_time=None if stop is None else common.quantity(stop, "s", "--stop"),
        progress=True,
    )
    rows = []
    for name in found.connected:
        unit, factor = display_scale(found.units[name])
        values = factor * found.unwrapped(name)
        rows.append((name, unit, f"{values.min():.6g}", f"{values.max():.6g}", f"{values[-1]:.6g}"))
    title = f"{found.title}  ({len(found)} communication points to t = {found.time[-1]:g} s, coupling: {coupling})"
    common.show_table(title, ("output", "unit", "least", "greatest", "at the end"), rows)
    for note in found.notes:
        common.note(note)
    if found.powers:
        advice = found.suggested_step(1e-3)
        then = f"; for 0.1 %, take steps of about {1e3 * advice:.2g} ms" if advice is not None and share is None else ""
        common.say(
            f"work that the coupling added: {100.0 * found.added_work():.2g} % of the work through the power bonds{then}"
        )
    folder, stem = common.output_folder(out), Path(file).stem
    columns = {"time [s]": found.time} | {f"{name} [{found.units[name]}]": x for name, x in found.values.items()}
    columns |= {f"power residual of {name} [W]": power for name, power in found.powers.items()}
    common.say(f"wrote {write_csv(folder / f'{stem}.csv', columns)}")
    common.print_paths(common.save_plot(plot, found, folder / f"{stem}.png"))
    if found.status:
        common.print_error(found.message)
        raise SystemExit(common.ENDED_EARLY)


@system.command()
@_FILE
@click.option("--stop", help="End of the runs, such as '0.2 s'.")
@click.option(
    "--decades", type=click.IntRange(1, 4), default=2, help="Decades over which the communication step is varied."
)
@common.out_option(help="Folder for the plot.")
@common.plot_option
@common.report_errors
def check(file: str, stop: str | None, decades: int, out: str, plot: bool) -> None:
    """Check the connections of a system. For a description also measure how the error of each coupling depends on the step.

    The measurement needs the equations of all parts, and is left out if a part is an FMU. The step is the communication step.
    The reference for the errors is the system as a single model, solved by SciPy with a tolerance of 1e-12.

    \b
    Examples:
      linkwork system check motor-crank.toml
      linkwork system check motor-crank.toml --stop '0.2 s' --decades 3
    """
    from ..systems import convergence, load_system

    wiring = _wiring(file)
    bonds = wiring.bonds()
    common.say(
        f"{wiring.title}: {len(wiring.parts)} parts, {len(wiring.connections)} connections, {len(bonds)} power "
        f"bond{'' if len(bonds) == 1 else 's'}; all match"
    )
    for bond in bonds:
        common.say(f"power bond {bond.effort} -> {bond.effort_to}, back {bond.flow} -> {bond.flow_to}")
    for note in wiring.notes():
        common.note(note)
    if Path(file).suffix == ".ssp":
        return
    described = load_system(file)
    if foreign := [name for name, table in described.parts.items() if table.fmu]:
        common.note(
            f"the equations of {' and '.join(foreign)} are not known: the errors of the couplings are not measured"
        )
        return
    end = None if stop is None else common.quantity(stop, "s", "--stop")
    found = convergence(described, decades=decades, stop_time=end, progress=True)
    rows = [
        (f"{1e3 * step:.4g}", *(f"{errors[n]:.2e}" for errors in found.errors.values()))
        for n, step in enumerate(found.steps)
    ]
    rows.append(("order", *(f"{found.order(way):.2f}" for way in found.errors)))
    common.show_table("greatest relative error of the connected outputs", ("step [ms]", *found.errors), rows)
    if bonds:
        rows = [
            (f"{1e3 * step:.4g}", *(f"{100.0 * powers[n]:.2g}" for powers in found.powers.values()))
            for n, step in enumerate(found.steps)
        ]
        common.show_table("work that the coupling added, relative to the work through the power bonds [%]",
                   ("step [ms]", *found.powers), rows)  # fmt: skip
    for when, message in found.messages.items():
        common.note(f"{when}: {message}")
    common.print_paths(common.save_plot(plot, found, common.output_folder(out) / f"{Path(file).stem}-check.png"))


@system.command()
@_FILE
@common.out_option(help="Folder for the picture.")
@common.report_errors
def draw(file: str, out: str) -> None:
    """Draw the parts of a system and their connections.

    \b
    Examples:
      linkwork system draw motor-crank.toml
    """
    common.print_paths(
        common.save_plot(True, _wiring(file), common.output_folder(out) / f"{Path(file).stem}-diagram.png")
    )


@system.command()
@_FILE
@common.out_option(help="Folder in which the host's folder is made.")
@common.report_errors
def host(file: str, out: str) -> None:
    """Build a system as one C program for real-time targets.

    The program uses neither Python nor dynamic memory. It reports the step times and the missed deadlines.

    \b
    Examples:
      linkwork system host motor-crank.toml
    """
    from ..systems import build_host

    made = build_host(_wiring(file), common.output_folder(out) / f"{Path(file).stem}-host")
    common.say(f"wrote {made} with its sources: {made} STEPS [RATE]")
