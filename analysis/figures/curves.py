"""Curves over time, speed or anything else, in panels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from textwrap import fill
from typing import Any, TypeVar

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import ArrayLike, NDArray

from ..mechanisms import MECHANISMS
from ..run import Trajectory
from .dispatch import plot
from .style import COLOURS, STYLE, Figure, finish

_Part = TypeVar("_Part")


@plot.register
def plot_outputs(
    run: Trajectory,
    names: Sequence[str] | None = None,
    *,
    columns: int = 1,
    title: str = "",
) -> Figure:
    """Plot outputs of a run over time, one panel each.

    Parameters
    ----------
    run : Trajectory
    names : sequence of str, optional
        Outputs; by default those that move, the rate of what drives, and the torque, of those that the run has.
    columns : int
        Panels side by side.
    title : str
    """
    names = _telling(run) if names is None else names
    rows = ceil(len(names) / columns)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(6.4 * columns, 1.0 + 1.9 * rows))
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
        for axis, name in zip(axes.flat, names):
            axis.plot(run.time, run[name])
            axis.set_ylabel(f"{name} [{run.units[name]}]")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        if title:
            figure.suptitle(title)
        return finish(figure)


def _telling(run: Trajectory) -> list[str]:
    mechanism = max(MECHANISMS.values(), key=lambda m: len(set(m.output_names) & set(run.names)))
    first, *others = mechanism.freedoms
    moving = ("slider.position", *(freedom.coordinate for freedom in others), first.rate)
    wanted = dict.fromkeys((*moving, "drive.applied_torque", "transmission.angle"))
    return [name for name in wanted if name in run.names] or list(run.names[:4])


def plot_comparison(
    first: Trajectory,
    second: Trajectory,
    names: Sequence[str],
    *,
    title: str = "",
    labels: tuple[str, str] = ("first", "second"),
) -> Figure:
    """Plot outputs of two runs over each other, and the second less the first beside them, a row each.

    Parameters
    ----------
    first, second : Trajectory
        With the same samples, as far as both go.
    names : sequence of str
        Outputs.
    title : str
    labels : (str, str)
        Names of the runs.
    """
    n = min(len(first), len(second))
    time = first.time[:n]
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 0.9 + 1.8 * len(names)))
        rows = figure.subplots(len(names), 2, sharex=True, squeeze=False, width_ratios=(3, 2))
        for (both, difference), name in zip(rows, names):
            a, b, unit = first[name][:n], second[name][:n], first.units[name]
            both.plot(time, a, color=COLOURS[0], label=labels[0])
            both.plot(time, b, "--", color=COLOURS[1], label=labels[1])
            both.set_ylabel(f"{name} [{unit}]", fontsize=8)
            difference.plot(time, b - a, color="0.25", linewidth=1.0)
            difference.set_ylabel(f"difference [{unit}]", fontsize=8)
        rows[0, 0].legend(fontsize=8, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
        rows[0, 1].set_title(f"{labels[1]} less {labels[0]}", fontsize=8.5)
        for axis in rows[-1]:
            axis.set_xlabel("time [s]")
        if title:
            figure.suptitle(title, fontsize=10.5, fontweight="bold")
        figure.align_ylabels()
        return finish(figure)


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One line of a panel: points (n,), what the legend calls it, and how it looks where that is not left to the panel."""

    x: ArrayLike
    y: ArrayLike
    label: str = ""
    colour: str | None = None
    line: str = "-"
    marker: str = ""
    width: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One pair of axes of a plot.

    Attributes
    ----------
    x_label, y_label : str
        With units.
    curves : sequence of Curve
        Drawn in the order of `COLOURS`.
    verticals : mapping
        Dotted vertical lines: text at the top to place along x.
    legend : str, optional
        Heading of the legend; there is one if any curve has a label.
    legend_at : str
        Where it goes, in Matplotlib's words, or "outside", to the right of the axes.
    x_range, y_range : (float, float), optional
    logarithmic : str
        Axes on a logarithmic scale: "", "x", "y" or "xy".
    equal : bool
        One length on both axes.
    filled : sequence of sequence of ndarray, shape (n, 2)
        Areas to shade, each the closed boundaries it has; holes are kept free.
    x_ticks : sequence of float, optional
    """

    x_label: str
    y_label: str
    curves: Sequence[Curve] = ()
    verticals: Mapping[str, float] | None = None
    title: str = ""
    legend: str = ""
    legend_at: str = "best"
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    logarithmic: str = ""
    equal: bool = False
    filled: Sequence[Sequence[NDArray[np.float64]]] = ()
    x_ticks: Sequence[float] | None = None


def plot_curves(
    panels: Sequence[Panel], *, title: str, columns: int = 1, size: tuple[float, float] = (6.4, 3.7)
) -> Figure:
    """Plot curves for print, one pair of axes per panel.

    Parameters
    ----------
    panels : sequence of Panel
    title : str
        Above all of it; a figure of the thesis by its number.
    columns : int
        Panels side by side.
    size : (float, float)
        Width and height of a panel (inches).
    """
    return lay_out(panels, lambda figure, axis, panel: draw_panel(axis, panel), title=title, columns=columns, size=size)


def lay_out(
    parts: Sequence[_Part],
    draw: Callable[[Figure, Axes, _Part], None],
    *,
    title: str,
    columns: int,
    size: tuple[float, float],
) -> Figure:
    """A figure with a pair of axes per part, drawn by ``draw``; see `plot_curves`."""
    rows = ceil(len(parts) / columns)
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(size[0] * columns, 0.35 + size[1] * rows))
        axes = figure.subplots(rows, columns, squeeze=False)
        for axis, part in zip(axes.flat, parts):
            draw(figure, axis, part)
        for axis in list(axes.flat)[len(parts) :]:
            axis.remove()
        # eleven and a half of these letters go to the inch
        figure.suptitle(fill(title, int(11.6 * size[0] * columns)), fontsize=10.5, fontweight="bold")
        return finish(figure)


def draw_panel(axis: Axes, panel: Panel) -> None:
    for boundaries in panel.filled:
        # boundaries that run clockwise are holes in the others
        outline = Outline.make_compound_path(
            *(Outline(np.vstack([ring, ring[:1]]), closed=True) for ring in boundaries)
        )
        axis.add_patch(PathPatch(outline, facecolor="#56B4E9", alpha=0.22, edgecolor="none", zorder=0))
    for number, curve in enumerate(panel.curves):
        axis.plot(
            curve.x,
            curve.y,
            linestyle=curve.line or "none",
            color=curve.colour or COLOURS[number % len(COLOURS)],
            marker=curve.marker or None,
            markersize=4.5,
            label=curve.label or None,
            linewidth=curve.width,
            markeredgewidth=1.2,
            zorder=3 if curve.marker else 2,
        )
    axis.set(xlabel=panel.x_label, ylabel=panel.y_label)
    axis.set_title(panel.title, fontsize=9)
    if "x" in panel.logarithmic:
        axis.set_xscale("log")
    if "y" in panel.logarithmic:
        axis.set_yscale("log")
    if panel.x_ticks is not None:
        axis.set_xticks(panel.x_ticks, [f"{tick:g}" for tick in panel.x_ticks])
        axis.set_xticks([], minor=True)
    if panel.x_range:
        axis.set_xlim(*panel.x_range)
    if panel.y_range:
        axis.set_ylim(*panel.y_range)
    if panel.equal:
        axis.set_aspect("equal")
    for text, place in (panel.verticals or {}).items():
        axis.axvline(place, color="0.35", linestyle=":", linewidth=1.0, zorder=1)
        axis.annotate(
            text,
            (place, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(-2, -3),
            textcoords="offset points",
            rotation=90,
            ha="right",
            va="top",
            fontsize=7.5,
            color="0.25",
        )
    if any(curve.label for curve in panel.curves):
        outside: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
        where = outside if panel.legend_at == "outside" else {"loc": panel.legend_at}
        axis.legend(title=panel.legend or None, fontsize=8, title_fontsize=8, alignment="left", **where)
