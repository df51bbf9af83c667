"""The command about the motion of the slider: where a four-bar is not enough, what moves its pivot, and what that takes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from math import degrees
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.markup import escape
from rich.table import Table

from linkwork.errors import Interrupted

from .common import INTERRUPTED, console, errors, handled, prepare_solver, print_written
from .design import settings_of, write_described


@click.command("slider-motion")
@click.argument("case", type=click.Path(exists=True, dir_okay=False))
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="Change a value, such as slider.stroke='30 mm' or slider.harmonics='[1, 2, 3]'.",
)
@click.option("--harmonics", type=click.IntRange(0), help="Of the slider's motion, in place of the case's.")
@click.option("--seed", type=click.IntRange(0), help="Of the random starts: the same seed gives the same motion.")
@click.option("--jobs", type=int, help="Cores; -1 for all.")
@click.option(
    "--out", default="out", show_default=True, type=click.Path(file_okay=False), help="Folder for the results."
)
@click.option("--plots/--no-plots", default=True, show_default=True, help="Whether to write plots.")
@handled
def slider_motion(
    case: str,
    settings: Sequence[str],
    harmonics: int | None,
    seed: int | None,
    jobs: int | None,
    out: str,
    plots: bool,
) -> None:
    """Move the rocker pivot of a linkage by a slider, so that it does the task of a CASE file (TOML or JSON) better.

    With a table [strategy] the simplest mechanism within a tolerance is sought, and why it moved on is told. With [drive] the
    force, torque, power and pin forces of the motion follow, and a case that 'linkwork run' runs; with [tracking] a run under
    control, with [least_effort] the motion of least effort.

    \b
    Examples:
      linkwork slider-motion examples/slider-motion.toml
      linkwork slider-motion examples/slider-motion.toml --set slider.stroke='20 mm' --harmonics 3
    """
    from ..motion.cases import load_slider_case
    from ..synthesis.linkage import SecondCrank, SliderMotion

    overrides = settings_of(settings)
    for name, value in (("slider.harmonics", harmonics), ("search.seed", seed), ("search.jobs", jobs)):
        if value is not None:
            overrides[name] = value
    chosen = load_slider_case(case, overrides)
    prepare_solver()
    folder = Path(out)
    solution, stopped = _moved(chosen) if chosen.strategy is None else _strategy(chosen)
    folder.mkdir(parents=True, exist_ok=True)
    written = _write_solution(solution, folder, chosen.synthesis.title, plots)
    pivot = solution.linkage.pivot
    if stopped is None and chosen.drive is not None:
        if isinstance(pivot, SecondCrank):
            errors.print(
                "note: the pivot is on a second crank, which the plant has not: no forces are computed",
                style="yellow",
                soft_wrap=True,
            )
        else:
            written += _dynamics(chosen, solution, folder, plots)
    elif isinstance(pivot, SliderMotion):
        written.append(_write_motion(solution, folder))
    print_written(written)
    if stopped is not None:
        errors.print(f"{stopped}; the best so far is kept", style="yellow", highlight=False, soft_wrap=True)
        sys.exit(INTERRUPTED)


def _strategy(chosen: Any) -> tuple[Any, Interrupted | None]:
    """The simplest mechanism that will do; and what stopped the search, if anything did."""
    from ..motion import StrategyInterrupted

    stopped = None
    try:
        found = chosen.simplest(progress=console.is_terminal)
    except StrategyInterrupted as error:
        if error.strategy is None:
            raise
        found, stopped = error.strategy, error
    grid = Table(title=escape(f"{chosen.synthesis.title}: the simplest mechanism"), title_justify="left")
    grid.add_column("mechanism")
    grid.add_column("what came of it")
    for step in found.steps:
        grid.add_row(step.mechanism, step.reason, style="green" if found.met and step is found.chosen else None)
    console.print(grid)
    if not found.met:
        errors.print(
            f"note: none meets the tolerance; the nearest is kept: {found.chosen.mechanism}",
            style="yellow",
            highlight=False,
            soft_wrap=True,
        )
    return found.chosen.solution, stopped


def _moved(chosen: Any) -> tuple[Any, Interrupted | None]:
    """The best motion, harmonic by harmonic, beside the fixed pivot; and what stopped it, if anything did."""
    from ..synthesis import SynthesisInterrupted

    stopped = None
    four_bar = chosen.four_bar(progress=console.is_terminal)
    found = [four_bar]
    for harmonics in chosen.slider.harmonics:
        try:
            result = chosen.move(four_bar, harmonics, tuple(found[1:]), progress=console.is_terminal)
        except SynthesisInterrupted as error:
            stopped = error
            if error.synthesis is None:
                break
            result = error.synthesis
        found.append(result.best)
        if stopped:
            break
    _show(chosen.synthesis.title, found)
    return min(found[1:] or found, key=lambda s: s.error), stopped


def _show(title: str, solutions: Sequence[Any]) -> None:
    """The fixed pivot and the motions, a row each, in mm and degrees."""
    from ..motion.motion import greatest
    from ..synthesis.linkage import SliderMotion
    from ..synthesis.report import degrees_told, error_unit, quality_name, quality_unit

    (factor, unit), (scale, length) = quality_unit(solutions[0].task), error_unit(solutions[0].task)
    grid = Table(title=escape(f"{title}: {quality_name(solutions[0].task)}"), title_justify="left")
    grid.add_column("pivot", no_wrap=True)
    headings = (
        f"error [{unit}]",
        f"worst [{length}]",
        "stroke [mm]",
        "du/dphi [mm/rad]",
        "d2u/dphi2 [mm/rad2]",
        "guide [deg]",
        "angle at C [deg]",
    )
    for heading in headings:
        grid.add_column(escape(heading), justify="right", no_wrap=heading.startswith("angle"))
    for s in solutions:
        pivot = s.linkage.pivot
        words, motion = "fixed", ["", "", "", ""]
        if isinstance(pivot, SliderMotion):
            order = pivot.series.order
            words = f"slider, {order} harmonic{'' if order == 1 else 's'}"
            motion = [
                f"{1e3 * pivot.stroke:.5g}",
                *(f"{1e3 * greatest(s.linkage, k):.5g}" for k in (1, 2)),
                f"{degrees(pivot.guide_angle):.2f}",
            ]
        grid.add_row(
            words,
            f"{factor * s.error:.5g}",
            f"{scale * s.evaluation.worst:.4g}",
            *motion,
            degrees_told(s.verdicts),
            style=None if s.verdicts.sound else "yellow",
        )
    console.print(grid)


def _write_solution(solution: Any, folder: Path, title: str, plots: bool) -> list[Path]:
    from ..files import save_figure

    written = write_described(solution, folder, title, curve="curve", report="report", drawing="linkage")
    if plots:
        written.append(save_figure(solution.plot(title=title), folder / "linkage.png"))
    return written


def _motion_columns(linkage: Any, rotation: Any) -> dict[str, Any]:
    """The slider's position and its derivatives by the crank's rotation."""
    series = linkage.pivot.series
    columns = {"crank rotation [rad]": rotation, "slider position [m]": series(rotation)}
    columns["du/dphi [m/rad]"] = series.derivative()(rotation)
    columns["d2u/dphi2 [m/rad2]"] = series.derivative().derivative()(rotation)
    return columns


def _write_motion(solution: Any, folder: Path) -> Path:
    from ..files import write_csv

    turn = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    return write_csv(folder / "motion.csv", _motion_columns(solution.linkage, turn))


# Dynamics


def _dynamics(chosen: Any, solution: Any, folder: Path, plots: bool) -> list[Path]:
    """Force, torque and pin forces; a case that runs; then the run under control and the least effort, where asked for."""
    from ..files import save_figure, write_csv, write_tables
    from ..motion.cases import run_case
    from ..run.case_files import save_parameters

    title = chosen.synthesis.title
    drive = chosen.driven(solution)
    _tell_drive(title, drive)
    own = {}
    if solution.linkage.pivot is not None:
        own = _motion_columns(solution.linkage, drive.crank_angle - solution.linkage.crank_phase)
    written = [write_csv(folder / "motion.csv", own | dict(drive.columns()))]
    end = {"time [s]": np.append(drive.time, drive.period), "slider.force [N]": np.append(drive.force, drive.force[0])}
    written.append(write_csv(folder / "force.csv", end))
    written.append(save_parameters(folder / "five-bar-parameters.toml", drive.parameters))
    written.append(write_tables(folder / "five-bar.toml", run_case(drive, title, "force.csv")))
    if plots:
        written.append(save_figure(drive_figure(title, drive), folder / "motion.png"))
    if chosen.tracking is not None:
        written += _tracking(chosen, drive, folder, plots)
    if chosen.least_effort is not None:
        written += _effort(chosen, drive, solution.linkage, folder, plots)
    return written


def _rows(title: str, rows: Sequence[tuple[str, str]]) -> None:
    console.print(title, style="italic", highlight=False, markup=False, soft_wrap=True)
    grid = Table(show_header=False)
    grid.add_column()
    grid.add_column(justify="right")
    for row in rows:
        grid.add_row(*row)
    console.print(grid)


def _tell_drive(title: str, drive: Any) -> None:
    p = drive.parameters
    rows = [
        ("rms force", f"{drive.rms_force:.5g} N"),
        ("peak force", f"{drive.peak_force:.5g} N"),
        ("mean power", f"{drive.mean_power:.5g} W"),
        ("peak power", f"{drive.peak_power:.5g} W"),
        ("work done in a turn, and taken up", f"{drive.positive_work:.5g} J, {-drive.negative_work:.5g} J"),
        ("peak crank torque", f"{drive.peak_torque:.5g} N.m"),
    ]
    rows += [(f"peak force in pin {pin}", f"{np.hypot(*_pin(drive, pin)).max():.5g} N") for pin in "ABCD"]
    if p.slider_stiffness:
        rows.append(("spring", f"{p.slider_stiffness:.5g} N/m, free at {1e3 * p.slider_spring_free_position:.5g} mm"))
    rows.append(("energy balance of a turn", f"{drive.balance.residual:.1e} J"))
    _rows(f"{title}: the slider's drive at {abs(drive.crank_speed) * 30.0 / np.pi:.5g} rpm", rows)


def _pin(drive: Any, pin: str) -> tuple[Any, Any]:
    return drive[f"pin.{pin}.fx"], drive[f"pin.{pin}.fy"]


def drive_figure(title: str, drive: Any) -> Any:
    """Position, force, power and pin forces over the turn."""
    from ..figures import Curve, Panel, plot_curves

    x = np.degrees(np.abs(drive.crank_angle))
    pins = [Curve(x=x, y=np.hypot(*_pin(drive, pin)), label=pin) for pin in "ABCD"]
    parts = [
        ("slider position [mm]", [Curve(x=x, y=1e3 * drive.states[:, 1])]),
        ("control force [N]", [Curve(x=x, y=drive.force)]),
        ("power of the force [W]", [Curve(x=x, y=drive.power)]),
        ("crank torque [N.m]", [Curve(x=x, y=drive.torque)]),
        ("transmission angle [deg]", [Curve(x=x, y=np.degrees(drive["transmission.angle"]))]),
        ("pin forces [N]", pins),
    ]
    ticks = [0.0, 90.0, 180.0, 270.0, 360.0]
    panels = [
        Panel(x_label="crank angle [deg]", y_label=label, curves=curves, x_ticks=ticks, legend_at="outside")
        for label, curves in parts
    ]
    return plot_curves(panels, title=title, columns=2, size=(4.4, 2.4))


def _tracking(chosen: Any, drive: Any, folder: Path, plots: bool) -> list[Path]:
    from ..figures import Curve, Panel, plot_curves
    from ..files import save_figure, write_csv

    run = chosen.tracked(drive)
    if run.loop.status:
        errors.print(
            f"note: the run under control ended early: {run.loop.message}",
            style="yellow",
            markup=False,
            highlight=False,
            soft_wrap=True,
        )
    else:
        m = run.metrics()
        point = []
        if drive.parameters.coupler_point_distance:
            both = f"{1e3 * m.rms_point_error:.4g} mm, {1e3 * m.peak_point_error:.4g} mm"
            point = [("coupler point error, rms and peak", both)]
        rows = [
            ("slider error, rms and peak", f"{1e3 * m.rms_error:.4g} mm, {1e3 * m.peak_error:.4g} mm"),
            *point,
            ("force, rms and peak", f"{m.rms_force:.5g} N, {m.peak_force:.5g} N"),
            ("power, mean and peak", f"{m.mean_power:.5g} W, {m.peak_power:.5g} W"),
        ]
        _rows(f"run under control over the last turn: {run.method}", rows)
    loop = run.loop
    columns = {
        "time [s]": loop.time,
        "slider position [m]": loop.position,
        "reference [m]": loop.reference,
        "slider error [m]": run.error,
        "coupler point error [m]": run.point_error,
        "slider force [N]": loop.force,
        "power [W]": run.power,
    }
    written = [write_csv(folder / "tracking.csv", columns)]
    if plots:
        panels = [
            Panel(x_label="time [s]", y_label=label, curves=[Curve(x=loop.time, y=values)])
            for label, values in (
                ("slider error [mm]", 1e3 * run.error),
                ("coupler point error [mm]", 1e3 * run.point_error),
                ("control force [N]", loop.force),
            )
        ]
        figure = plot_curves(panels, title=f"Tracking: {run.method}", size=(6.4, 2.2))
        written.append(save_figure(figure, folder / "tracking.png"))
    return written


def _effort(chosen: Any, drive: Any, linkage: Any, folder: Path, plots: bool) -> list[Path]:
    from ..figures import Curve, Panel, plot_curves
    from ..files import save_figure, write_csv
    from ..synthesis import RockerFunction

    with console.status("least effort"):
        least = chosen.relaxed(drive, linkage)
    scale, unit = (180.0 / np.pi, "deg") if isinstance(chosen.synthesis.task, RockerFunction) else (1e3, "mm")
    rows = [
        ("effort minimised", f"{least.cost}: {least.effort:.5g} {'N rms' if least.cost == 'force' else 'W'}"),
        ("of the motion before", f"{drive.rms_force:.5g} N rms, {drive.mean_power:.5g} W mean"),
        ("peak force", f"{np.abs(least.force).max():.5g} N"),
        (
            "departure allowed, and found by a run",
            f"{scale * chosen.least_effort.bound:.4g}, {scale * least.attained:.4g} {unit}",
        ),
        ("change of effort as the intervals are halved", f"{least.mesh_effort:.1e}"),
    ]
    _rows("motion of least effort", rows)
    columns = {
        "crank angle [rad]": least.crank_angle,
        "slider position [m]": least.position,
        "slider velocity [m/s]": least.velocity,
        "slider force [N]": least.force,
        f"departure [{'rad' if unit == 'deg' else 'm'}]": least.error,
    }
    written = [write_csv(folder / "least-effort.csv", columns)]
    if plots:
        x, before = np.degrees(least.crank_angle), np.degrees(drive.crank_angle)
        pairs = (
            ("slider position [mm]", 1e3 * drive.states[:, 1], 1e3 * least.position),
            ("control force [N]", drive.force, least.force),
        )
        panels = [
            Panel(
                x_label="crank angle [deg]",
                y_label=label,
                curves=[Curve(x=before, y=first, label="before"), Curve(x=x, y=second, label="least effort")],
            )
            for label, first, second in pairs
        ]
        figure = plot_curves(panels, title="Motion of least effort", size=(6.4, 2.6))
        written.append(save_figure(figure, folder / "least-effort.png"))
    return written
