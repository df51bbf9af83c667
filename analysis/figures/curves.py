"""Curves over time, speed or anything else, in panels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import ArrayLike, NDArray

from .marks import mark_place, place_marks
from .style import COLOURS, LINE, MARK, SHADE, Figure, finish, styled, write_notes, write_title

_Part = TypeVar("_Part")


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
        Dotted vertical lines: name to place along x. The names are put where they cover no curve.
    dashed : sequence of float
        Places along x of dashed lines without a name.
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
    dashed: Sequence[float] = ()
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
    panels: Sequence[Panel],
    *,
    title: str,
    columns: int = 1,
    size: tuple[float, float] = (6.4, 3.7),
    notes: Sequence[str] = (),
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
    notes : sequence of str
        Sentences at the foot.
    """

    def draw(figure: Figure, axis: Axes, panel: Panel) -> None:
        draw_panel(axis, panel)

    return lay_out(panels, draw, title=title, columns=columns, size=size, notes=notes)


def lay_out(
    parts: Sequence[_Part],
    draw: Callable[[Figure, Axes, _Part], None],
    *,
    title: str,
    columns: int,
    size: tuple[float, float],
    notes: Sequence[str] = (),
) -> Figure:
    """A figure with a pair of axes per part, drawn by ``draw``; see `plot_curves`."""
    rows = ceil(len(parts) / columns)
    with styled():
        figure = Figure(figsize=(size[0] * columns, 0.35 + size[1] * rows))
        axes = figure.subplots(rows, columns, squeeze=False)
        for axis, part in zip(axes.flat, parts):
            draw(figure, axis, part)
        for axis in list(axes.flat)[len(parts) :]:
            axis.remove()
        write_title(figure, title)
        write_notes(figure, notes)
        return place_marks(finish(figure))


def draw_panel(axis: Axes, panel: Panel) -> None:
    for boundaries in panel.filled:
        # boundaries that run clockwise are holes in the others
        outline = Outline.make_compound_path(
            *(Outline(np.vstack([ring, ring[:1]]), closed=True) for ring in boundaries)
        )
        axis.add_patch(PathPatch(outline, facecolor=SHADE, alpha=0.22, edgecolor="none", zorder=0))
    for number, curve in enumerate(panel.curves):
        axis.plot(
            curve.x,
            curve.y,
            linestyle=curve.line or "none",
            color=curve.colour or COLOURS[number % len(COLOURS)],
            marker=curve.marker or None,
            label=curve.label or None,
            linewidth=curve.width,
            markeredgewidth=LINE,
            zorder=3 if curve.marker else 2,
        )
    axis.set(xlabel=panel.x_label, ylabel=panel.y_label)
    axis.set_title(panel.title)
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
    for place in panel.dashed:
        axis.axvline(place, **MARK | {"linestyle": (0, (5, 4))})
    for text, place in (panel.verticals or {}).items():
        mark_place(axis, place, text)
    if any(curve.label for curve in panel.curves):
        outside: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
        where = outside if panel.legend_at == "outside" else {"loc": panel.legend_at}
        axis.legend(title=panel.legend or None, alignment="left", **where)
