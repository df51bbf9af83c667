"""Plot linkages found by synthesis: drawings to scale with curve and target, errors, transmission angle and trade-offs.

Lengths are shown in mm, angles in degrees.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, log10
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from shapely import MultiLineString, MultiPoint

from linkwork.errors import InputError

from .. import synthesis as syn
from ..units import ROUNDING, display_scale
from . import style
from .animation import check_frames, gif
from .dispatch import animate, plot
from .marks import roomiest_position
from .symbols import CENTRE_LINE, draw_bearing, draw_block, draw_line, draw_link, draw_pin

FloatArray = NDArray[np.float64]

MM_PER_METRE = 1e3
#: Width and height of an A4 sheet in landscape (inches).
A4 = (297.0 / 25.4, 210.0 / 25.4)
#: Greatest length of a magnified error vector, relative to the extent of the target.
LONGEST = 0.12
#: Number of crank rotations at which the linkage must fit in the frame of a picture.
FRAMED = 72


class _Frame:
    """Axis limits (mm) that contain a linkage at all crank ``rotations``, and the size of its pins."""

    def __init__(self, scene: syn.LinkageScene, rotations: FloatArray) -> None:
        places = [pins for phi in rotations if (pins := scene.pins(float(phi))) is not None]
        points = [np.array(list(pins.values())) for pins in places]
        points += [p for p in (*scene.curves, scene.target, scene.guide) if p is not None]
        everything = MM_PER_METRE * np.vstack(points)
        low, high = everything.min(axis=0), everything.max(axis=0)
        self.extent = float((high - low).max())
        #: Length that scales pins, supports and distances of letters (mm).
        self.unit = self.extent / 42.0
        self.low, self.high = low - 3.0 * self.unit, high + 3.0 * self.unit


def _set_one_scale(axis: Axes, low: FloatArray, high: FloatArray) -> None:
    """Give both axes the same scale; the panel shows at least the box from ``low`` to ``high`` (mm)."""
    axis.update_datalim(np.array([low, high]))
    axis.margins(0.0)
    style.use_one_scale(axis)


def _draw_target(axis: Axes, scene: syn.LinkageScene, *, size: float = 3.0) -> None:
    if scene.target is None:
        return
    points = MM_PER_METRE * scene.target
    look: dict[str, Any] = {"color": style.TARGET, "zorder": 3, "label": "target"}
    if scene.target_closed is None:
        axis.plot(*points.T, "o", markersize=size, fillstyle="none", markeredgewidth=style.THIN, **look)
    else:
        closed = np.vstack([points, points[:1]]) if scene.target_closed else points
        axis.plot(*closed.T, linewidth=2.6, alpha=0.8, **look)


def _draw_curves(axis: Axes, scene: syn.LinkageScene, *, traced: bool = True) -> None:
    for piece in scene.curves:
        axis.plot(*(MM_PER_METRE * piece).T, color=style.TRACE, alpha=0.45, linewidth=style.THIN, zorder=2)
    if not scene.curves:
        # for a rocker function the paths of B and C, with gaps where the links cannot be joined
        places = [scene.pins(float(phi)) for phi in scene.transmission[0]]
        for name, colour in (("B", style.CRANK), ("C", style.ROCKER)):
            way = MM_PER_METRE * np.array([(np.nan, np.nan) if pins is None else pins[name] for pins in places])
            axis.plot(*way.T, color=colour, alpha=0.35, linewidth=style.THIN, zorder=2)
    if traced and scene.traced_curve is not None:
        axis.plot(*(MM_PER_METRE * scene.traced_curve).T, color=style.TRACE, linewidth=style.BOLD, zorder=4)


def _draw_linkage(
    axis: Axes, scene: syn.LinkageScene, frame: _Frame, pins: Mapping[str, tuple[float, float]], *, letters: bool = True
) -> None:
    """Draw links, pins and supports at one position; ``pins`` are their positions by name (m)."""
    unit = frame.unit
    at = {name: MM_PER_METRE * np.array(place) for name, place in pins.items()}
    a, b, c, d, e = (at[name] for name in "ABCDE")
    p = at.get("P")
    wide = 3.6 if letters else 2.4
    draw_line(axis, [a, e], **CENTRE_LINE)
    draw_bearing(axis, a, unit)
    if scene.guide is not None:
        _draw_slider(axis, MM_PER_METRE * scene.guide, scene.guide_directions(), d, unit)
    else:
        draw_bearing(axis, e if scene.second_crank else d, unit)
    if scene.second_crank:
        draw_link(axis, [e, d], style.CRANK, wide=wide, zorder=7)
    if not isinstance(scene.linkage, syn.SliderCrank):
        draw_link(axis, [d, c], style.ROCKER, wide=wide, zorder=5)
    draw_link(axis, [b, c, *([] if p is None else [p])], style.COUPLER, wide=wide)
    draw_link(axis, [a, b], style.CRANK, wide=wide, zorder=7)
    for pin in (a, b, c, d, *([e] if scene.second_crank else [])):
        draw_pin(axis, pin, unit)
    if p is not None:
        draw_pin(axis, p, unit, style.TRACE, zorder=10)
    if letters:
        _write_letters(axis, scene, at, unit)


def _draw_slider(
    axis: Axes, guide: FloatArray, directions: tuple[FloatArray, FloatArray], d: FloatArray, unit: float
) -> None:
    along, left = directions
    for side in (-1.0, 1.0):
        rail = [guide[0] - 2.2 * unit * along + side * unit * left, guide[1] + 2.2 * unit * along + side * unit * left]
        draw_line(axis, rail, linewidth=style.THIN, zorder=3)
    draw_block(axis, d, along, unit)


def _write_letters(axis: Axes, scene: syn.LinkageScene, pins: Mapping[str, FloatArray], unit: float) -> None:
    """Write each pin's letter where it is farthest from links, supports, curve and other letters."""
    names = [n for n in scene.pin_letters if n in pins]
    lines = [(pins["A"], pins["B"]), (pins["B"], pins["C"]), (pins["C"], pins["D"]), (pins["A"], pins["E"])]
    if "P" in pins:
        lines += [(pins["B"], pins["P"]), (pins["C"], pins["P"])]
    fixed = [pins["A"], pins["E"] if scene.second_crank else pins["D"]]
    # height and foot of the bearings
    lines += [(pin, pin - np.array([0.0, 2.0 * unit])) for pin in fixed]
    lines += [(pin - np.array([1.8, 1.7]) * unit, pin + np.array([1.5, -1.7]) * unit) for pin in fixed]
    if scene.guide is not None:
        lines.append((MM_PER_METRE * scene.guide[0], MM_PER_METRE * scene.guide[1]))
    if scene.second_crank:
        lines.append((pins["E"], pins["D"]))
    marks = [pins[n] for n in names]
    curves = [MM_PER_METRE * p for p in (*scene.curves, scene.traced_curve, scene.target) if p is not None]
    drawn = [MultiLineString(lines), *(MultiPoint(curve[np.isfinite(curve).all(axis=1)]) for curve in curves)]
    for name in names:
        place = roomiest_position(pins[name], 1.5 * unit, drawn, marks)
        axis.text(place[0], place[1], name, ha="center", va="center", fontsize=style.LETTER, zorder=11)
        marks.append(place)


def _start_position(scene: syn.LinkageScene) -> tuple[float, Mapping[str, tuple[float, float]]]:
    """Return the first crank rotation (rad) at which the links can be joined, and the positions of the pins there (m)."""
    for phi in (*scene.rotation, *scene.transmission[0]):
        pins = scene.pins(float(phi))
        if pins is not None:
            return float(phi), pins
    raise InputError("the links cannot be joined at any rotation of the crank: there is nothing to draw")


def _framed_rotations(scene: syn.LinkageScene) -> FloatArray:
    """Return crank rotations (rad) at which the links can be joined; the linkage must fit in the frame at all of them."""
    rotation, angle = scene.transmission
    joined = rotation[np.isfinite(angle)]
    return joined[np.linspace(0, len(joined) - 1, min(len(joined), FRAMED + 1)).round().astype(int)]


def magnification(worst: float, extent: float) -> float:
    """Return the greatest factor 1, 2 or 5 times a power of ten that magnifies the worst error to at most `LONGEST` extents."""
    if not (np.isfinite(worst) and worst > 1e-9 * extent):
        return 1.0
    most = LONGEST * extent / worst
    power = 10.0 ** np.floor(log10(most))
    # 0.5 if the logarithm was rounded up
    return max(1.0, float(power * max(m for m in (0.5, 1.0, 2.0, 5.0) if m * power <= most)))


def _plot_magnified_errors(axis: Axes, scene: syn.LinkageScene) -> None:
    """Plot target and path, without the linkage, with magnified error vectors."""
    assert scene.target is not None
    columns = scene.stations
    wanted = MM_PER_METRE * np.column_stack([columns["target x [m]"], columns["target y [m]"]])
    made = MM_PER_METRE * np.column_stack([columns["path x [m]"], columns["path y [m]"]])
    extent = float(np.ptp(wanted, axis=0).max())
    factor = magnification(float(np.hypot(*(made - wanted).T).max()), extent)
    shown = np.linspace(0, len(wanted) - 1, min(len(wanted), 180)).round().astype(int)
    ends = wanted + factor * (made - wanted)
    strokes = np.stack([wanted[shown], ends[shown], np.full((len(shown), 2), np.nan)], axis=1).reshape(-1, 2)
    times = "" if factor == 1.0 else f" (x {factor:g})"
    _draw_target(axis, scene, size=4.0)
    if scene.traced_curve is not None:
        axis.plot(
            *(MM_PER_METRE * scene.traced_curve).T, color=style.TRACE, linewidth=style.LINE, zorder=4, label="path"
        )
    if not _is_met(scene):
        axis.plot(*strokes.T, color=style.CRANK, linewidth=style.HAIR, zorder=5, label=f"error{times}")
    points = np.vstack([wanted, ends])
    low, high = points.min(axis=0), points.max(axis=0)
    rim = 0.06 * float((high - low).max())
    _set_one_scale(axis, low - rim, high + rim)
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 0.99), ncols=3, borderpad=0.2)


def _function_scale(scene: syn.LinkageScene) -> tuple[str, str, float]:
    """Return a function's heading in `LinkageScene.stations`, the label of its axis, and the factor from SI to the axis."""
    if scene.target is None:
        return "target angle [rad]", "rocker angle [deg]", float(np.degrees(1.0))
    return "target x [m]", "slider position x [mm]", MM_PER_METRE


def _plot_function(axis: Axes, scene: syn.LinkageScene) -> tuple[FloatArray, FloatArray]:
    """Plot the rocker's angle or the slider's position over the crank rotation with its target; return the curve."""
    assert scene.function is not None
    heading, label, factor = _function_scale(scene)
    turns, values = np.degrees(scene.function[0]), factor * scene.function[1]
    colour = style.ROCKER if scene.target is None else style.SLIDER
    axis.plot(turns, values, color=colour, linewidth=style.THIN, alpha=0.5)
    axis.plot(
        turns,
        np.where(_within_task(scene, turns), values, np.nan),
        color=colour,
        label=label.partition(" ")[0],
        zorder=4,
    )
    look: dict[str, Any] = {"markersize": 3.5, "fillstyle": "none", "markeredgewidth": style.THIN}
    x = np.degrees(scene.stations["crank rotation [rad]"])
    axis.plot(x, factor * scene.stations[heading], "o", color=style.TARGET, label="target", zorder=5, **look)
    _label_rotations(axis, turns)
    axis.set_ylabel(label)
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 0.99), ncols=2, borderpad=0.2)
    return turns, values


def _within_task(scene: syn.LinkageScene, turns: FloatArray) -> NDArray[np.bool_]:
    """Return a mask of the crank rotations ``turns`` (deg) that the task uses."""
    begin, end = np.degrees([scene.rotation.min(), scene.rotation.max()])
    return np.asarray((turns >= begin - 1e-9) & (turns <= end + 1e-9))


def _is_met(scene: syn.LinkageScene) -> bool:
    """Return whether the linkage meets the target: all errors are only rounding errors."""
    errors = [scene.stations[name] for name in ("error [m]", "error of angle [rad]") if name in scene.stations]
    return all(np.nanmax(np.abs(error), initial=0.0) < 1e-3 * ROUNDING for error in errors)


def _plot_errors(axis: Axes, scene: syn.LinkageScene) -> None:
    """Plot the errors of position and of angle at the stations."""
    columns = scene.stations
    x = np.degrees(columns["crank rotation [rad]"]) if scene.timed else np.arange(len(columns["crank rotation [rad]"]))
    few: dict[str, Any] = {"marker": "o", "markersize": 3.0} if len(x) <= 100 else {}
    if "error [m]" in columns:
        error = MM_PER_METRE * columns["error [m]"]
        axis.plot(x, np.where(error > ROUNDING, error, 0.0), color=style.COLOURS[0], **few)
        axis.set_ylabel("error [mm]")
        # even if all errors are nearly the same
        most = 1.05 * float(error[np.isfinite(error)].max(initial=0.0))
        axis.set_ylim(0.0, max(axis.get_ylim()[1], most, 10.0 * ROUNDING))
    if "error of angle [rad]" in columns:
        beside, colour, of_label, line = axis, style.COLOURS[0], "black", "-"
        if "error [m]" in columns:
            beside, colour, of_label, line = axis.twinx(), style.COLOURS[2], style.COLOURS[2], "--"
            beside.spines["right"].set_visible(True)
            beside.grid(False)
        turned = np.degrees(columns["error of angle [rad]"])
        beside.axhline(0.0, color="0.6", linewidth=style.HAIR)
        beside.plot(x, np.where(np.abs(turned) > ROUNDING, turned, 0.0), color=colour, linestyle=line, **few)
        beside.set_ylabel("error of angle [deg]", color=of_label)
    axis.set_xlabel("crank rotation [deg]" if scene.timed else "target point")
    if scene.timed:
        style.tick_quarter_turns(axis, x.min(), x.max())
    else:
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))


def _plot_transmission(axis: Axes, scene: syn.LinkageScene) -> tuple[FloatArray, FloatArray]:
    """Plot the transmission angle over a crank turn, with a thick line where the task uses it; return the curve."""
    rotation, angle = scene.transmission
    turns, angles = np.degrees(rotation), np.degrees(angle)
    axis.plot(turns, angles, color=style.COUPLER, linewidth=style.THIN, alpha=0.5)
    axis.plot(turns, np.where(_within_task(scene, turns), angles, np.nan), color=style.COUPLER, linewidth=style.BOLD)
    axis.axhline(90.0, color="0.6", linewidth=style.HAIR)
    axis.set_ylim(0.0, 180.0)
    axis.set_yticks([0.0, 40.0, 90.0, 140.0, 180.0])
    _label_rotations(axis, turns)
    axis.set_ylabel("transmission\nangle [deg]")
    return turns, angles


def _plot_pivot_motion(axis: Axes, scene: syn.LinkageScene) -> None:
    """Plot the motion of a movable rocker pivot, on a slider or a second crank, over a crank turn."""
    assert scene.motion is not None
    name, values = scene.motion
    unit, factor = display_scale("m" if name.endswith("[m]") else "rad")
    turns = np.degrees(scene.transmission[0])
    axis.plot(turns, factor * values, color=style.SLIDER)
    _label_rotations(axis, turns)
    axis.set_ylabel(f"{name.partition('[')[0]}[{unit}]".replace(" ", "\n", 1))


def _label_rotations(axis: Axes, turns: FloatArray) -> None:
    """Put the ticks of the x axis at quarter turns of the crank, and name the axis; ``turns`` are its rotations (deg)."""
    style.tick_quarter_turns(axis, turns[0], turns[-1])
    axis.set_xlabel("crank rotation [deg]")


def _draw_panel(axis: Axes, scene: syn.LinkageScene, *, size: float, letters: bool = True) -> None:
    """Draw the linkage at the start of its motion with its curve and the target."""
    _, pins = _start_position(scene)
    frame = _Frame(scene, _framed_rotations(scene))
    _set_one_scale(axis, frame.low, frame.high)
    _draw_target(axis, scene, size=size)
    _draw_curves(axis, scene)
    _draw_linkage(axis, scene, frame, pins, letters=letters)


def _plot_task(axis: Axes, scene: syn.LinkageScene) -> None:
    """Plot target and result of the task: the function, or the path with magnified errors."""
    if scene.function is not None:
        _plot_function(axis, scene)
    else:
        _plot_magnified_errors(axis, scene)


@plot.register
@style.figure_style()
def plot_solution(solution: syn.Solution, *, title: str = "") -> Figure:
    """Plot a linkage to scale, its target and result with magnified errors, the errors, and the transmission angle.

    Raises
    ------
    InputError
        If the links cannot be joined anywhere.
    """
    scene = syn.LinkageScene(solution, title)
    met = _is_met(scene)
    right = ["task", *([] if met else ["errors"]), "transmission", *([] if scene.motion is None else ["motion"])]
    figure = Figure(figsize=(10.4, 3.1 + 1.3 * max(3, len(right))))
    panels = figure.subplot_mosaic(
        [["linkage", name] for name in right], width_ratios=(1.25, 1.0), height_ratios=(2.1, *(1.0 for _ in right[1:]))
    )
    _draw_panel(panels["linkage"], scene, size=2.5)
    _plot_task(panels["task"], scene)
    if not met:
        _plot_errors(panels["errors"], scene)
    _plot_transmission(panels["transmission"], scene)
    if scene.motion is not None:
        _plot_pivot_motion(panels["motion"], scene)
    figure.align_ylabels([panels[name] for name in right])
    return style.finish(figure, scene.title, ["Every target is met: errors are rounding alone."] if met else [])


@style.figure_style()
def plot_sheet(
    solution: syn.Solution | syn.Assessment, forces: syn.PinForces | None = None, *, title: str = "", made: str = ""
) -> Figure:
    """Plot an A4 page for the workshop: linkage, curve and target, transmission angle, pin forces, dimensions.

    Parameters
    ----------
    solution : Solution or Assessment
        A solution is assessed first.
    forces : PinForces, optional
        Pin forces; without them there is no panel of them.
    title : str
    made : str
        Note on the material, and on the load case of the forces.

    Raises
    ------
    InputError
        If the links cannot be joined anywhere.
    """
    assessment = solution if isinstance(solution, syn.Assessment) else syn.assess(solution)
    solution = assessment.solution
    scene = syn.LinkageScene(solution, title)
    figure = Figure(figsize=A4)
    right = ["task", "transmission", *(["forces"] if forces is not None else [])]
    rows: list[Any] = [*(["linkage", name] for name in right), ["table", "table"]]
    panels = figure.subplot_mosaic(
        rows, width_ratios=(1.2, 1.0), height_ratios=(*(2.4 if name == "task" else 1.0 for name in right), 1.5)
    )
    _draw_panel(panels["linkage"], scene, size=2.0)
    _plot_task(panels["task"], scene)
    _plot_transmission(panels["transmission"], scene)
    if forces is not None:
        _plot_forces(panels["forces"], forces, "guide" if isinstance(solution.linkage, syn.SliderCrank) else "D")
    head, *dimensions = assessment.dimensions
    panels["table"].axis("off")
    grid = panels["table"].table(dimensions, colLabels=head, cellLoc="right", loc="upper center", edges="horizontal")
    grid.auto_set_font_size(False)
    grid.set_fontsize(style.TINY)
    grid.auto_set_column_width(range(len(head)))
    verdict = f"{solution.verdicts.grashof}; " + syn.headline(solution).replace("\n", "; ")
    return style.finish(figure, scene.title, [line for line in (verdict, assessment.rounding, made) if line])


def _plot_forces(axis: Axes, forces: syn.PinForces, last: str) -> None:
    """Plot the resultant force on each pin over the crank rotation; ``last`` labels the fourth force: D or the guide."""
    for pin, force, colour in zip(("A", "B", "C", last), forces.force.T, style.COLOURS):
        axis.plot(np.degrees(forces.rotation), force, color=colour, label=f"{pin}: {force.max():.3g} N at most")
    _label_rotations(axis, np.degrees(forces.rotation))
    axis.set_ylabel("pin force [N]")
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, borderpad=0.2, columnspacing=1.0)


@plot.register
@style.figure_style()
def plot_alternatives(synthesis: syn.Synthesis, *, title: str = "") -> Figure:
    """Plot the ranked linkages beside one another, each to its own scale, with curve, target and error.

    Raises
    ------
    InputError
        If there are no linkages.
    """
    scenes = [syn.LinkageScene(s, f"{k}: {syn.headline(s)}") for k, s in enumerate(synthesis.solutions, start=1)]
    if not scenes:
        raise InputError("there are no linkages to draw")
    columns = min(3, len(scenes))
    rows = ceil(len(scenes) / columns)
    figure = Figure(figsize=(3.5 * columns, 3.8 * rows + 0.3 + (0.3 if title else 0.0)))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, scene in zip(axes, scenes):
        _draw_panel(axis, scene, size=1.8, letters=False)
        axis.set_title("\n".join(fill(line, 46) for line in scene.title.splitlines()), fontsize=style.SMALL)
    colours = {"crank": style.CRANK, "coupler": style.COUPLER}
    if not all(isinstance(scene.linkage, syn.SliderCrank) for scene in scenes):
        colours["rocker"] = style.ROCKER
    if scenes[0].target is not None:
        colours |= {"target": style.TARGET, "path": style.TRACE}
    handles = [Line2D([], [], color=colour, linewidth=2.4, label=name) for name, colour in colours.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 3 * columns))
    for axis in axes[len(scenes) :]:
        axis.set_visible(False)
    return style.finish(figure, title)


@plot.register
@style.figure_style()
def plot_trade_off(traded: syn.TradeOff, *, title: str = "") -> Figure:
    """Plot quality function and worst error over the limit that was varied; limits at which no linkage was found are marked.

    Raises
    ------
    InfeasibleError
        If there is no linkage at any of the limits.
    """
    task = next((s.task for s in traded.solutions if s is not None), None)
    if task is None:
        raise syn.InfeasibleError("there is no linkage at any of the limits: there is nothing to plot")
    (factor, unit), (scale, length) = syn.quality_unit(task), syn.error_unit(task)
    worst = np.array([np.nan if s is None else s.evaluation.worst for s in traded.solutions])
    errors = {
        f"{fill(syn.quality_name(task), 26)} [{unit}]": factor * traded.error.filled(np.nan),
        f"worst error [{length}]": scale * worst,
    }
    over = syn.OVER[traded.over]
    label = f"limit of the {over.name}" if over.small else f"{over.name} asked for"
    limit, limit_label = over.factor * traded.limit, f"{label} [{over.shown}]"
    order = np.argsort(limit)
    figure = Figure(figsize=(6.4, 2.6 * len(errors) + 0.4))
    axes = figure.subplots(len(errors), 1, sharex=True, squeeze=False).ravel()
    for axis, (label, values) in zip(axes, errors.items()):
        there = np.isfinite(values)
        known = values[there]
        if len(known) and known.min() > 0.0 and known.max() > 20.0 * known.min():
            axis.set_yscale("log")
        axis.plot(limit[order], values[order], "-o", color=style.COLOURS[0], markersize=4.0)
        if not there.all():
            # at the foot of the panel, whatever its scale
            foot = {"transform": axis.get_xaxis_transform(), "clip_on": False, "zorder": 5}
            none = limit[~there]
            axis.plot(none, np.full(len(none), 0.04), "x", color=style.COLOURS[1], label="no linkage", **foot)
            axis.legend()
        axis.set_ylabel(label)
    axes[-1].set_xlabel(limit_label)
    figure.align_ylabels()
    return style.finish(figure, title)


@animate.register
@style.figure_style()
def animate_solution(
    solution: syn.Solution, path: str | Path, *, title: str = "", frames: int = 48, frames_per_second: int = 20
) -> Path:
    """Write a GIF of the linkage over a crank turn, with the transmission angle below it.

    For a function, the rocker's angle or the slider's position with its target is plotted instead of the transmission angle.
    Positions at which the links cannot be joined are left out.

    Raises
    ------
    InputError
        If there are fewer than two frames, or the links cannot be joined anywhere.
    """
    check_frames(frames)
    scene = syn.LinkageScene(solution, title)
    first, _ = _start_position(scene)
    backwards = len(scene.rotation) > 1 and scene.rotation[-1] < scene.rotation[0]
    turn = first + (-1.0 if backwards else 1.0) * np.linspace(0.0, 2.0 * np.pi, frames, endpoint=False)
    frame = _Frame(scene, _framed_rotations(scene))
    width, height = frame.high - frame.low
    tall = float(np.clip(5.0 * height / width, 2.5, 7.0))
    figure = Figure(figsize=(5.4, tall + 2.1))
    above, below = figure.subplots(2, 1, height_ratios=(tall, 1.6))
    style.write_title(figure, scene.title)
    x, y = (_plot_transmission if scene.function is None else _plot_function)(below, scene)
    (now,) = below.plot([], [], "o", color=style.CRANK, markersize=style.DOT, zorder=6)
    trace: list[FloatArray] = []
    _set_one_scale(above, frame.low, frame.high)
    _draw_target(above, scene, size=2.0)
    _draw_curves(above, scene, traced=False)
    fixed = set(above.get_children())
    with gif(figure, path, frames_per_second) as (file, add_frame):
        for phi in turn:
            pins = scene.pins(float(phi))
            if pins is None:
                # the trace has a gap there
                trace.append(np.full(2, np.nan))
                continue
            for artist in above.get_children():
                if artist not in fixed:
                    artist.remove()
            if "P" in pins:
                trace.append(MM_PER_METRE * np.array(pins["P"]))
                draw_line(above, trace, color=style.TRACE, linewidth=style.BOLD, zorder=4)
            _draw_linkage(above, scene, frame, pins, letters=False)
            at = x[0] + (np.degrees(phi) - x[0]) % 360.0
            now.set_data([at], [np.interp(at, x, y) if at <= x[-1] + 1e-9 else np.nan])
            add_frame()
    return file
