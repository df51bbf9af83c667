"""`linkwork slider-motion`: find a slider motion with which a linkage does its task better, and the drive of this motion."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np
from rich.table import Table

from linkwork.errors import Interrupted

from . import common
from .design import leave_if_stopped, read_overrides, search_options, write_description_files, write_linkages

if TYPE_CHECKING:
    from ..numerics.fourier import FourierSeries
    from ..slider import SliderCase, SliderDrive
    from ..synthesis import Solution


@click.command("slider-motion")
@click.argument("case", type=click.Path(exists=True, dir_okay=False))
@common.set_option("slider.stroke='30 mm' or slider.harmonics='[1, 2, 3]'")
@click.option(
    "--harmonics", type=click.IntRange(0), help="Number of harmonics of the slider's motion, instead of the case's."
)
@search_options
@common.report_errors
def slider_motion(
    case: str,
    settings: Sequence[str],
    harmonics: int | None,
    objective: str | None,
    seed: int | None,
    jobs: int | None,
    out: str,
    plot: bool,
) -> None:
    """Move the rocker pivot of a linkage with a slider, so that it does the task of a CASE file (TOML or JSON) better.

    With a table [strategy] in the case, the command finds the simplest mechanism within a tolerance and explains each step.
    With [drive] it computes force, torque, power and pin forces of the motion, and writes a case for 'linkwork run'. With
    [tracking] it simulates the motion with a controller.

    \b
    Examples:
      linkwork slider-motion examples/slider-motion.toml
      linkwork slider-motion examples/slider-motion.toml --set slider.stroke='20 mm' --harmonics 3
      linkwork slider-motion examples/slider-motion.toml --objective worst
    """
    from ..files import write_csv
    from ..slider import load_slider_case
    from ..synthesis import SecondCrank, SliderMotion

    overrides = read_overrides(
        settings, slider__harmonics=harmonics, task__objective=objective, search__seed=seed, search__jobs=jobs
    )
    common.check_kind(case, common.SLIDER_MOTION, settings=overrides)
    chosen = load_slider_case(case, overrides)
    solution, stopped = _find_motion(chosen) if chosen.strategy is None else _find_strategy(chosen)
    folder = common.output_folder(out)
    written = _write_solution(solution, folder, chosen, plot)
    pivot = solution.linkage.pivot
    if stopped is None and chosen.drive is not None:
        if isinstance(pivot, SecondCrank):
            common.note("no forces are computed for a five-bar with a geared second crank: run its linkage.toml")
        else:
            written += _dynamics(chosen, solution, folder, plot)
    elif isinstance(pivot, SliderMotion):
        turn = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
        written.append(write_csv(folder / "motion.csv", _motion_columns(pivot.series, turn)))
    common.print_paths(written)
    leave_if_stopped(stopped, "the best so far is kept")


def _find_strategy(chosen: SliderCase) -> tuple[Any, Interrupted | None]:
    """Find the simplest mechanism within the tolerance; return its solution, and the interruption if there was one."""
    from ..slider import StrategyInterrupted

    stopped = None
    try:
        found = chosen.find_simplest(progress=common.console.is_terminal)
    except StrategyInterrupted as error:
        if error.strategy is None:
            raise
        found, stopped = error.strategy, error
    headings = ("mechanism", "result")
    rows = [(step.mechanism, step.reason) for step in found.steps]
    styles = ["green" if found.met and step is found.chosen else None for step in found.steps]
    common.show_table(f"{chosen.synthesis.title}: the simplest mechanism", headings, rows, styles=styles)
    if not found.met:
        so_far = " so far" if stopped else ""
        common.note(f"none meets the tolerance{so_far}; the nearest is kept: {found.chosen.mechanism}")
    return found.chosen.solution, stopped


def _find_motion(chosen: SliderCase) -> tuple[Any, Interrupted | None]:
    """Find the best motion for each number of harmonics; return the best of all, and the interruption if there was one."""
    from ..synthesis import SynthesisInterrupted

    stopped = None
    four_bar = chosen.find_four_bar(progress=common.console.is_terminal)
    found = [four_bar]
    for harmonics in chosen.slider.harmonics:
        try:
            result = chosen.find_motion(four_bar, harmonics, tuple(found[1:]), progress=common.console.is_terminal)
        except SynthesisInterrupted as error:
            stopped = error
            if error.synthesis is None:
                break
            result = error.synthesis
        found.append(result.best)
        if stopped:
            break
    _print_motions(chosen.synthesis.title, found)
    return min(found[1:] or found, key=lambda s: s.value), stopped


def _print_motions(title: str, solutions: Sequence[Solution]) -> None:
    """Print a table of solutions with fixed and with moved rocker pivot, one row for each, in mm and degrees."""
    from ..slider import greatest_derivative
    from ..synthesis import SliderMotion, format_transmission, quality_cells, quality_headings, quality_name

    task = solutions[0].task
    error, _, worst = quality_headings(task)
    headings = (
        "pivot",
        error.replace(quality_name(task), "error"),
        worst,
        "stroke [mm]",
        "du/dphi [mm/rad]",
        "d2u/dphi2 [mm/rad2]",
        "guide [deg]",
        "angle at C [deg]",
    )
    rows = []
    for s in solutions:
        pivot = s.linkage.pivot
        words, motion = "fixed", ["", "", "", ""]
        if isinstance(pivot, SliderMotion):
            order = pivot.series.order
            words = f"slider, {order} harmonic{'' if order == 1 else 's'}"
            motion = [
                f"{1e3 * pivot.stroke:.5g}",
                *(f"{1e3 * greatest_derivative(s.linkage, k):.5g}" for k in (1, 2)),
                f"{degrees(pivot.guide_angle):.2f}",
            ]
        rows.append((words, *quality_cells(s)[::2], *motion, format_transmission(s.verdicts)))
    styles = [None if s.verdicts.sound else "yellow" for s in solutions]
    title = f"{title}: {quality_name(task)}"
    common.show_table(title, headings, rows, unwrapped=(headings[0], headings[-1]), styles=styles)


def _write_solution(solution: Solution, folder: Path, case: SliderCase, plot: bool) -> list[Path]:
    from ..synthesis import assess

    title, make = case.synthesis.title, case.machine(solution)
    written = write_description_files(assess(solution), folder, title, curve="curve", text="report", drawn="linkage")
    written += write_linkages([solution], folder, title, make=make)
    return written + common.save_plot(plot, solution, folder / "linkage.png", title=title)


def _motion_columns(series: FourierSeries, rotation: Any) -> dict[str, Any]:
    """Return columns, by name with unit, of the slider position and its derivatives with respect to the crank rotation."""
    columns = {"crank rotation [rad]": rotation, "slider position [m]": series(rotation)}
    columns["du/dphi [m/rad]"] = series.derivative()(rotation)
    columns["d2u/dphi2 [m/rad2]"] = series.derivative().derivative()(rotation)
    return columns


# Dynamics


def _dynamics(chosen: SliderCase, solution: Solution, folder: Path, plot: bool) -> list[Path]:
    """Compute and write force, torque and pin forces of a slider motion, and a case file of a run; return the paths.

    If the case has a table [tracking], also simulate the motion with a controller.
    """
    from ..export.controllers import HARMONICS
    from ..files import write_csv, write_tables
    from ..run import save_parameters
    from ..slider import run_case
    from ..synthesis import SliderMotion

    title = chosen.synthesis.title
    drive = chosen.compute_drive(solution)
    _print_drive(title, drive)
    own, pivot = {}, solution.linkage.pivot
    if isinstance(pivot, SliderMotion):
        own = _motion_columns(pivot.series, drive.crank_angle - solution.linkage.crank_phase)
    end = {"time [s]": np.append(drive.time, drive.period), "slider.force [N]": np.append(drive.force, drive.force[0])}
    head = chosen.synthesis.make.describe_masses()
    written = [
        write_csv(folder / "motion.csv", own | dict(drive.columns())),
        write_csv(folder / "force.csv", end),
        save_parameters(folder / "five-bar-parameters.toml", drive.parameters, head=head),
        write_tables(folder / "five-bar.toml", run_case(drive, title, "force.csv"), head=head),
        write_tables(
            folder / "system.toml",
            chosen.system(drive, "five-bar.toml"),
            head="a controller lets the slider follow its motion: linkwork system run system.toml",
        ),
    ]
    if drive.slider.order > HARMONICS:
        common.note(f"the reference in system.toml has the first {HARMONICS} harmonics of the motion only")
    written += common.save_plot(plot, drive, folder / "motion.png", title=title)
    if chosen.tracking is not None:
        written += _tracking(chosen, drive, folder, plot)
    return written


def _print_rows(title: str, rows: Sequence[tuple[str, str]]) -> None:
    common.say(title, style="italic")
    grid = Table(show_header=False)
    grid.add_column()
    grid.add_column(justify="right")
    for row in rows:
        grid.add_row(*row)
    common.console.print(grid)


def _print_drive(title: str, drive: SliderDrive) -> None:
    p = drive.parameters
    rows = [
        ("rms force", f"{drive.rms_force:.5g} N"),
        ("peak force", f"{drive.peak_force:.5g} N"),
        ("mean power", f"{drive.mean_power:.5g} W"),
        ("peak power", f"{drive.peak_power:.5g} W"),
        ("work done in a turn, and taken up", f"{drive.positive_work:.5g} J, {-drive.negative_work:.5g} J"),
        ("peak crank torque", f"{drive.peak_torque:.5g} N.m"),
        *((f"peak force in pin {pin}", f"{drive.pin_force(pin).max():.5g} N") for pin in "ABCD"),
    ]
    if p.slider_stiffness:
        rows.append(("spring", f"{p.slider_stiffness:.5g} N/m, free at {1e3 * p.slider_spring_free_position:.5g} mm"))
    rows.append(("energy balance of a turn", f"{drive.balance.residual:.1e} J"))
    _print_rows(f"{title}: the slider's drive at {abs(drive.crank_speed) * 30.0 / np.pi:.5g} rpm", rows)


def _tracking(chosen: SliderCase, drive: SliderDrive, folder: Path, plot: bool) -> list[Path]:
    from ..files import write_csv

    assert chosen.tracking is not None
    period, design = chosen.tracking.period, chosen.design(drive)
    if design is not None and (growth := float(abs(design.sampled_poles(period)[-1]))) >= 1.0:
        common.note(
            f"sampled every {period:g} s, the feedback is unstable: errors grow by a factor of {growth:.3g} from "
            "sample to sample; shorten tracking.period or lower tracking.bandwidth"
        )
    run = chosen.run_tracking(drive)
    loop = run.loop
    if loop.status:
        common.note(f"the run under control ended early: {loop.message}")
    else:
        m = run.metrics()
        rows = [
            ("slider error, rms and peak", f"{1e3 * m.rms_error:.4g} mm, {1e3 * m.peak_error:.4g} mm"),
            (
                "coupler point error, rms and peak",
                f"{1e3 * m.rms_point_error:.4g} mm, {1e3 * m.peak_point_error:.4g} mm",
            ),
            ("force, rms and peak", f"{m.rms_force:.5g} N, {m.peak_force:.5g} N"),
            ("power, mean and peak", f"{m.mean_power:.5g} W, {m.peak_power:.5g} W"),
        ]
        if not drive.parameters.coupler_point_distance:
            del rows[1]
        _print_rows(f"run under control over the last turn: {run.method}", rows)
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
    return written + common.save_plot(plot, run, folder / "tracking.png")
